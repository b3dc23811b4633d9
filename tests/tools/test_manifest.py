"""The manifest, the project's metadata and the pinned wheels agree, and Blender will accept them."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WHEEL_PYTHONS = ("3.11", "3.13")

# Blender's own list, bl_pkg's tags.py; the build checks against the real one.
ADDON_TAGS = {
    "3D View", "Add Curve", "Add Mesh", "Animation", "Bake", "Camera", "Compositing", "Development",
    "Game Engine", "Geometry Nodes", "Grease Pencil", "Import-Export", "Lighting", "Material", "Mesh",
    "Modeling", "Node", "Object", "Paint", "Physics", "Pipeline", "Render", "Rigging", "Scene", "Sculpt",
    "Sequencer", "System", "Text Editor", "Tracking", "User Interface", "UV",
}  # fmt: skip


@pytest.fixture(scope="module")
def manifest():
    return tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def pyproject():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def wheel_pins():
    """Pinned versions: {distribution: [(version, python or None), ...]}."""
    pins = {}
    for raw in (ROOT / "requirements" / "wheels.txt").read_text(encoding="utf-8").splitlines():
        line = raw.partition("#")[0].strip()
        if not line:
            continue
        match = re.fullmatch(r'([\w.-]+)==([\w.]+)(?: ; python_version == "([\d.]+)")?', line)
        assert match, f"not an exact pin by Python alone: {line}"
        pins.setdefault(match[1].lower(), []).append((match[2], match[3]))
    return pins


def core_version():
    tree = ast.parse((ROOT / "potmesil_addon" / "__init__.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == [
            "__version__"
        ]:
            return ast.literal_eval(node.value)
    raise AssertionError("potmesil_addon has no __version__")


def test_versions_agree(manifest, pyproject):
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    cited = re.search(r"(?m)^version: (\S+)$", citation)
    assert cited is not None
    assert manifest["version"] == pyproject["project"]["version"] == core_version() == cited[1]


def test_blender_range(manifest):
    assert manifest["schema_version"] == "1.0.0"
    minimum = tuple(map(int, manifest["blender_version_min"].split(".")))
    maximum = tuple(map(int, manifest["blender_version_max"].split(".")))
    tested = sorted(
        tuple(map(int, path.stem.removeprefix("blender-").split(".")))
        for path in (ROOT / "requirements").glob("blender-*.txt")
    )
    assert minimum == (*tested[0], 0)
    # The maximum is the first version that is not supported: right after the newest that is tested.
    assert maximum == (tested[-1][0], tested[-1][1] + 1, 0)


def test_texts_fit_the_listing(manifest):
    for text in (manifest["tagline"], *manifest["permissions"].values()):
        assert len(text) <= 64
        assert text.isprintable()
        assert text[-1].isalnum() or text[-1] in ")]}"
    assert "Blender" not in manifest["name"]


def test_tags_are_blenders(manifest):
    assert manifest["tags"]
    assert set(manifest["tags"]) <= ADDON_TAGS


def test_only_files_are_asked_for(manifest):
    assert set(manifest["permissions"]) == {"files"}


def test_development_manifest_names_no_wheels(manifest):
    assert "wheels" not in manifest
    assert "platforms" not in manifest


def test_wheels_leave_numpy_to_blender():
    assert "numpy" not in wheel_pins()


def test_wheels_differ_by_python_only():
    for name, versions in wheel_pins().items():
        pythons = [python for _, python in versions]
        assert pythons == [None] or sorted(pythons) == sorted(WHEEL_PYTHONS), name


def test_wheels_cover_the_dependencies(pyproject):
    project = pyproject["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["fast"]]
    names = {re.match(r"[\w.-]+", requirement)[0].lower() for requirement in wanted}
    assert names - {"numpy"} <= set(wheel_pins())
    # numba cannot be imported without it.
    assert "llvmlite" in wheel_pins()
