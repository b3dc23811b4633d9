"""Every text that artists see has a translation, and none has outlived its text.

That Blender shows them is for the tests with a window: the bpy module is built without languages.
"""

from __future__ import annotations

import ast
import inspect
import string
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

from .conftest import ROOT

BLENDER_SIDE = sorted(path for folder in ("ui", "operators") for path in (ROOT / folder).glob("*.py"))
CORE = sorted((ROOT / "potmesil_addon").glob("*.py"))

COMMAND_LINE = (
    *(f"operators/{name}.py" for name in ("command", "movie", "scene_batch")),
    *(f"potmesil_addon/{name}.py" for name in ("batch", "cli", "frames", "keys", "pictures", "png")),
)
"""Modules whose texts are for the command line, which speaks English."""

TAKEN = {
    "iface_": 0,
    "rpt_": 0,
    "tip_": 0,
    "n_": 0,
    "sentence": 2,
    "report": 1,
    "poll_message_set": 0,
    "doing": 0,
    "say": 1,
    "_say": 1,
    "_note": 1,
}
"""Functions that take a text for artists, and which of their arguments it is."""

SHOWN = ("text", "heading")
"""Arguments by name with which Blender draws a text."""


@pytest.fixture
def languages(module: Callable[[str], Any]) -> dict[str, dict[str, str]]:
    return module("ui.translations").LANGUAGES


def test_every_text_has_a_translation(languages: dict[str, dict[str, str]], registered: set[str]) -> None:
    wanted = written_texts() | registered
    assert len(wanted) > 300
    for language, texts in languages.items():
        missing = sorted(wanted - set(texts))
        assert not missing, f"add to ui/language_{language}.py:\n" + "\n".join(missing)


def test_no_translation_has_outlived_its_text(
    languages: dict[str, dict[str, str]], registered: set[str]
) -> None:
    wanted = written_texts() | registered
    for language, texts in languages.items():
        stale = sorted(set(texts) - wanted)
        assert not stale, f"take out of ui/language_{language}.py:\n" + "\n".join(stale)


def test_values_are_filled_in_alike(languages: dict[str, dict[str, str]]) -> None:
    for texts in languages.values():
        wrong = {text: own for text, own in texts.items() if placeholders(text) != placeholders(own)}
        assert not wrong


def test_translations_end_as_the_text_does(languages: dict[str, dict[str, str]]) -> None:
    """A sentence has its full stop, and a label or a tooltip has none."""
    for texts in languages.values():
        wrong = {
            text: own
            for text, own in texts.items()
            if text.endswith(".") != own.endswith(".") or own != own.strip() or not own
        }
        assert not wrong


def test_what_is_put_together_is_looked_up_first() -> None:
    """A text with its values in it is found in no dictionary."""
    found = [
        f"{name_of(path)}:{node.lineno}"
        for path in BLENDER_SIDE
        for node in texts_of(tree_of(path))
        if isinstance(node, ast.JoinedStr) and name_of(path) not in COMMAND_LINE
    ]
    assert not found


def test_texts_are_named_for_blender(
    module: Callable[[str], Any], languages: dict[str, dict[str, str]], given: Given
) -> None:
    assert set(given.languages) == set(languages)
    for language, texts in languages.items():
        assert given.languages[language]["*", "Potmesil Camera"] == "Potmesil Camera"
        for text, own in texts.items():
            for context in ("*", "Operator", module("ui.translations").OWN):
                assert given.languages[language][context, text] == own


def test_dictionaries_go_with_the_extension(module: Callable[[str], Any], given: Given) -> None:
    assert given.package == module("ui.translations").__name__.rpartition(".ui.")[0]
    module("ui.translations").unregister()
    assert given.package is None


class Given:
    """What is registered with Blender, by way of a stand-in for Blender's own translations."""

    def __init__(self) -> None:
        self.package: str | None = None
        self.languages: dict[str, dict[tuple[str, str], str]] = {}

    def register(self, package: str, languages: dict[str, dict[tuple[str, str], str]]) -> None:
        assert self.package is None
        self.package, self.languages = package, languages

    def unregister(self, package: str) -> None:
        assert self.package == package
        self.package, self.languages = None, {}


@pytest.fixture
def given(module: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch) -> Given:
    """A stand-in, as the bpy module is built without other languages and takes note of none."""
    translations = module("ui.translations")
    found = Given()

    class _App:
        translations = found

    class _Bpy:
        app = _App

    monkeypatch.setattr(translations, "bpy", _Bpy)
    translations.register()
    return found


@pytest.fixture
def registered(module: Callable[[str], Any]) -> set[str]:
    """The texts of classes that Blender knows: labels, tooltips, names and choices of properties."""
    found: set[str] = set()
    for cls in (*module("ui").CLASSES, *module("operators").CLASSES):
        kind = cls.bl_rna
        if issubclass(cls, bpy.types.Operator):
            # The class itself knows nothing of the operator's properties.
            group, name = cls.bl_idname.split(".")
            kind = getattr(getattr(bpy.ops, group), name).get_rna_type()
            found.add(kind.description)
        for name in inspect.get_annotations(cls).keys() & kind.properties.keys():
            found |= set(property_texts(kind.properties[name]))
    return found - {""}


def property_texts(item: Any) -> Iterator[str]:
    if item.name != item.identifier:
        yield item.name
    yield item.description
    if item.type == "ENUM":
        for choice in item.enum_items:
            yield choice.name
            yield choice.description


def written_texts() -> set[str]:
    """The texts that stand in the code as constants."""
    found = set()
    for path in (*BLENDER_SIDE, *CORE):
        if name_of(path) not in COMMAND_LINE:
            found |= {node.value for node in texts_of(tree_of(path)) if isinstance(node, ast.Constant)}
    # What names an option of the command line is for the command line.
    return {text for text in found if text and "--" not in text}


def texts_of(tree: ast.AST) -> Iterator[ast.Constant | ast.JoinedStr]:
    """Yield the constants and put-together texts that are shown to artists."""
    for node in ast.walk(tree):
        # Blender calls the menus of presets "Presets" once one was added: what counts is what stands here.
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in ("bl_label", "bl_category"):
            yield from choices_of(node.value)
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in ("InputError", "OutputError", "SettingsError"):
            yield from choices_of(node.args[0])
        elif name == "Finding":
            for argument in node.args[1:3]:
                yield from choices_of(argument)
        elif len(node.args) > TAKEN.get(name, len(node.args)):
            yield from choices_of(node.args[TAKEN[name]])
        for keyword in node.keywords:
            if keyword.arg in SHOWN:
                yield from choices_of(keyword.value)


def choices_of(node: ast.expr) -> Iterator[ast.Constant | ast.JoinedStr]:
    """Yield the texts that an expression can be."""
    if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str)):
        yield node
    elif isinstance(node, ast.IfExp):
        yield from choices_of(node.body)
        yield from choices_of(node.orelse)
    elif isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from choices_of(value)


def placeholders(text: str) -> list[tuple[str, str]]:
    return sorted(
        (name, form or "") for _, name, form, _ in string.Formatter().parse(text) if name is not None
    )


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()
