"""Presets of lens, film and iris, of the shutter and of the special effects, in Blender's own menus."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")
mathutils = pytest.importorskip("mathutils")

ROOT = Path(__file__).resolve().parents[2] / "presets"
SHIPPED = sorted(ROOT.rglob("*.py"))
MENUS = {
    "potmesil_camera": "POTMESIL_PT_camera_presets",
    "potmesil_shutter": "POTMESIL_PT_shutter_presets",
    "potmesil_lens": "POTMESIL_PT_lens_presets",
    "potmesil_effects": "POTMESIL_PT_effects_presets",
}


def values(path: Path, scene: Any) -> dict[str, Any]:
    """Return what a preset says, and what the scene has in its place, by the preset's own lines."""
    owners = {
        "camera": scene.camera.data,
        "settings": scene.potmesil_camera,
        "render": scene.render,
        "effects": scene.potmesil_camera.effects,
    }
    found = {}
    for line in path.read_text().splitlines():
        name, separator, value = line.partition(" = ")
        owner, dot, rest = name.partition(".")
        if separator and dot:
            holder = owners[owner]
            *parents, last = rest.split(".")
            for parent in parents:
                holder = getattr(holder, parent)
            is_now = getattr(holder, last)
            if isinstance(is_now, mathutils.Color):
                is_now = tuple(is_now)
            found[name] = (eval(value, {}), is_now)
    return found


def places(folder: str) -> list[Path]:
    """Return the presets that Blender finds for a menu."""
    return [path for found in bpy.utils.preset_paths(folder) for path in Path(found).glob("*.py")]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_preset_sets_all_that_it_says(path: Path, scene: Any) -> None:
    folder = path.parent.name
    (there,) = [place for place in places(folder) if place.name == path.name]
    assert bpy.ops.script.execute_preset(filepath=str(there), menu_idname=MENUS[folder]) == {"FINISHED"}
    for name, (wanted, is_now) in values(there, scene).items():
        assert is_now == (pytest.approx(wanted) if isinstance(wanted, float) else wanted), name


def test_presets_of_a_menu_set_the_same(scene: Any) -> None:
    """So that nothing of the one chosen before is left; a real lens sets the camera besides."""
    for folder in MENUS:
        names = [set(values(path, scene)) for path in SHIPPED if path.parent.name == folder]
        assert len(names) > 5
        camera = {name for each in names for name in each if name.startswith("camera.")}
        assert all(each in (names[0], names[0] | camera) for each in names)


def test_presets_of_effects_are_taken_by_the_core(scene: Any, module: Any) -> None:
    """And each but Neutral, and real lenses of which too little is published, has some of them on."""
    scene_effects = module("operators.effects").scene_effects
    make = module("potmesil_addon.effects").effects_from_json
    for folder in ("potmesil_lens", "potmesil_effects"):
        for path in (path for path in SHIPPED if path.parent.name == folder):
            bpy.ops.script.execute_preset(filepath=str(path), menu_idname=MENUS[folder])
            effects = scene_effects(scene)
            make(effects)
            on = any(value is not None for value in effects.values())
            is_real_lens = "camera.lens" in values(path, scene)
            assert is_real_lens or on == (path.stem != "Neutral"), path
            neutral = path.with_name("Neutral.py")
            bpy.ops.script.execute_preset(filepath=str(neutral), menu_idname=MENUS[folder])


def test_a_preset_leaves_out_no_effect(scene: Any, module: Any) -> None:
    kinds = module("potmesil_addon.effects").KINDS
    said = {
        name.split(".")[1]
        for path in SHIPPED
        if path.parent.name in ("potmesil_lens", "potmesil_effects")
        for name in values(path, scene)
        if name.startswith("effects.")
    }
    assert said == set(kinds)


@pytest.mark.parametrize("kind", ["camera", "shutter", "lens", "effects"])
def test_artist_adds_and_removes_a_preset(kind: str, scene: Any) -> None:
    scene.camera.data.dof.aperture_fstop = 1.25
    scene.potmesil_camera.slit_width = 0.375
    effects = scene.potmesil_camera.effects
    effects.pupil.obstruction, effects.pupil.image = 0.375, "//iris.png"
    effects.star.use, effects.exposure.tint = True, (1.0, 0.5, 0.25)
    add = getattr(bpy.ops.potmesil, f"add_{kind}_preset")
    assert add(name="Mine") == {"FINISHED"}
    folder = f"potmesil_{kind}"
    (path,) = [place for place in places(folder) if place.stem.lower() == "mine"]
    said = values(path, scene)
    assert said == {name: (now, now) for name, (_, now) in said.items()}
    shipped = next(each for each in SHIPPED if each.parent.name == folder)
    assert set(said) == set(values(shipped, scene))
    assert add(name="Mine", remove_name=True) == {"FINISHED"}
    assert not path.exists()


def test_nothing_is_left_when_the_extension_is_off(extension: Any) -> None:
    names = {path.name for path in SHIPPED}
    extension.unregister()
    try:
        assert not names & {path.name for menu in MENUS for path in places(menu)}
    finally:
        extension.register()
    assert names == names & {path.name for menu in MENUS for path in places(menu)}
