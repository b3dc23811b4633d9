"""The zip installs, enables, disables and enables again, and leaves nothing behind."""

from __future__ import annotations

import importlib
import typing
from pathlib import Path
from types import ModuleType
from typing import Any

import addon_utils
import bpy
import pytest

from .conftest import PACKAGE


def _registered() -> bool:
    return hasattr(bpy.types, "POTMESIL_OT_render")


def test_zip_enables(extension: ModuleType) -> None:
    assert _registered()
    assert hasattr(bpy.types, "POTMESIL_PT_camera")
    assert hasattr(bpy.context.scene, "potmesil_camera")
    assert "bl_ext" in extension.__name__


def test_no_policy_is_violated(extension: ModuleType) -> None:
    warnings = getattr(addon_utils, "_extensions_warnings_get", dict)()
    assert PACKAGE not in warnings


def test_disable_takes_all_out_and_enable_brings_it_back(extension: ModuleType) -> None:
    handlers = _handlers()
    addon_utils.disable(PACKAGE)
    assert not _registered()
    assert not hasattr(bpy.types, "POTMESIL_PT_camera")
    assert not hasattr(bpy.context.scene, "potmesil_camera")
    assert not hasattr(bpy.context.window_manager, "potmesil_camera")
    others = [each for each in handlers if not each[1].startswith(PACKAGE)]
    assert len(others) < len(handlers)
    assert _handlers() == others
    addon_utils.enable(PACKAGE)
    assert _registered()
    assert sorted(_handlers()) == sorted(handlers)
    assert hasattr(bpy.context.scene, "potmesil_camera")


def test_shipped_core_is_the_installed_one(extension: ModuleType) -> None:
    core = importlib.import_module(f"{PACKAGE}.potmesil_addon.lens")
    assert Path(core.__file__).is_relative_to(Path(extension.__file__).parent)


@pytest.mark.parametrize(
    "name",
    [
        "render",
        "process",
        "setup_passes",
        "add_stage",
        "remove_stage",
        "composite",
        "render_animation",
        "process_animation",
        "fix_all",
        "live",
        "inspect",
        "focus_on_active",
        "track_object",
        "stop_tracking",
    ],
)
def test_operators_have_blenders_manners(extension: ModuleType, name: str) -> None:
    operator = getattr(bpy.ops.potmesil, name).get_rna_type()
    # Blender writes prepositions small.
    assert operator.name == operator.name.title().replace(" On ", " on ")
    tooltip = operator.description
    assert tooltip
    assert not tooltip.endswith(".")


@pytest.mark.parametrize(
    ("module_name", "name"),
    [("ui.properties", "PotmesilSceneSettings"), ("operators.setup_passes", "POTMESIL_OT_setup_passes")],
)
def test_properties_have_tooltips_without_a_full_stop(module: Any, module_name: str, name: str) -> None:
    cls = getattr(module(module_name), name)
    for prop_name, prop in typing.get_type_hints(cls).items():
        if hasattr(prop, "keywords"):
            tooltip = prop.keywords["description"]
            assert tooltip, prop_name
            assert not tooltip.endswith("."), prop_name


def _handlers() -> list[tuple[str, str]]:
    """Return every handler's list and module."""
    lists = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    return [
        (name, getattr(function, "__module__", ""))
        for name, functions in lists.items()
        if isinstance(functions, list)
        for function in functions
    ]
