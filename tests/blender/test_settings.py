"""Our settings behave as Blender's own: keyed, saved, appended, copied with the scene, undone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import pytest

OTHERS: dict[str, Any] = {
    "use_lens": False,
    "coc_model": "paper",
    "psf": "lommel",
    "visibility": "none",
    "uniform_defocus": 1.5,
    "fade": 0.25,
    "use_motion": False,
    "motion_model": "vector",
    "shutter_kind": "focal_plane",
    "slit_edge": "left",
    "slit_width": 0.5,
    "blade_time": 0.125,
    "exposure_count": 3,
    "exposure_duration": 0.25,
    "exposure_spacing": 0.5,
    "gate_angle": 0.25,
    "use_flash": True,
    "flash_curtain": "first",
    "flash_share": 0.25,
    "flash_duration": 0.125,
    "flash_count": 3,
    "sampling": "FINE",
    "use_overscan": False,
    "use_hidden_surfaces": False,
    "depth_peeling": "AUTOMATIC",
    "peel_count": 3,
    "reflections": "REFLECTIONS",
    "max_roughness": 0.5,
    "show_limits": True,
    "use_quality_maps": True,
}
"""A value for each setting that is not its default."""

NOT_HERE = {"samples_path", "stage_of", "effects"}
"""A path, which Blender does not animate, a pointer of our own, and groups, which are looked at below."""

OTHER_EFFECTS: dict[str, Any] = {
    "pupil.use": True,
    "pupil.blade_curvature": 0.25,
    "pupil.obstruction": 0.5,
    "pupil.apodisation": 1.5,
    "pupil.spherical_aberration": -2.5,
    "focal_surface.use": True,
    "focal_surface.tilt": 0.125,
    "focal_surface.swing": -0.125,
    "focal_surface.curvature": 6.5,
    "chromatic.use": True,
    "chromatic.focus_red": 0.25,
    "chromatic.focus_blue": -0.25,
    "chromatic.size_red": 0.0078125,
    "chromatic.size_blue": -0.0078125,
    "vignetting.use": True,
    "vignetting.natural": 0.5,
    "vignetting.mechanical": 0.25,
    "vignetting.fastest_f_stop": 2.0,
    "distortion.use": True,
    "distortion.model": "nuke",
    "distortion.k1": -0.125,
    "distortion.k2": 0.25,
    "distortion.k3": 0.5,
    "distortion.k4": 0.75,
    "distortion.p1": 0.0625,
    "distortion.p2": -0.0625,
    "diffraction.use": True,
    "diffraction.strength": 0.5,
    "diffraction.f_stop": 22.0,
    "diffraction.spectral": False,
    "star.use": True,
    "star.lines": 4,
    "star.rotation": 0.5,
    "star.strength": 0.25,
    "star.groove_width": 40.0,
    "image_filter.use": True,
    "image_filter.strength": 0.5,
    "image_filter.size": 0.5,
    "image_filter.rotation": -0.5,
    "exposure.use": True,
    "exposure.sensitivity": 400.0,
    "exposure.normal_ev": 12.5,
    "exposure.density": 2.0,
    "exposure.tint": (1.0, 0.5, 0.25),
    "grain.use": True,
    "grain.granularity": 20.0,
    "grain.size": 16.0,
    "grain.color": 1.0,
    "grain.seed": 7,
    "noise.use": True,
    "noise.full_well": 5000.0,
    "noise.read_noise": 2.5,
    "noise.seed": 8,
}
"""A value for each setting of the effects that is not its default."""

PICTURES = ("pupil.image", "image_filter.image")
"""Paths of the effects, which Blender does not animate."""


def values(scene: Any) -> dict[str, Any]:
    """Return the settings of a scene."""
    return {name: getattr(scene.potmesil_camera, name) for name in OTHERS}


def plain(value: Any) -> Any:
    """Return a setting's value as it is now, whatever becomes of the setting."""
    return value if isinstance(value, bool | int | float | str) else tuple(value)


def effect_values(scene: Any) -> dict[str, Any]:
    """Return the settings of a scene's effects."""
    own = scene.potmesil_camera.effects
    return {name: plain(own.path_resolve(name)) for name in OTHER_EFFECTS}


def group_of(scene: Any, name: str) -> tuple[Any, str]:
    """Return what holds a setting of an effect, and what it is called there."""
    effect, field = name.split(".")
    return getattr(scene.potmesil_camera.effects, effect), field


def change_all(scene: Any) -> None:
    """Give every setting another value."""
    for name, value in OTHERS.items():
        assert getattr(scene.potmesil_camera, name) != value
        setattr(scene.potmesil_camera, name, value)
    for name, value in OTHER_EFFECTS.items():
        group, field = group_of(scene, name)
        assert plain(getattr(group, field)) != value
        setattr(group, field, value)
    for name in PICTURES:
        group, field = group_of(scene, name)
        setattr(group, field, "//elsewhere.png")
    scene.potmesil_camera.samples_path = "//elsewhere/####.exr"


def test_every_setting_is_looked_at_here(scene: Any) -> None:
    names = {p.identifier for p in scene.potmesil_camera.bl_rna.properties}
    view_options = {p.identifier for p in scene.potmesil_camera.bl_rna.properties if not p.is_animatable}
    assert names - {"rna_type", "name"} - NOT_HERE - view_options == set(OTHERS)
    effects = {
        f"{effect.identifier}.{item.identifier}"
        for effect in scene.potmesil_camera.effects.bl_rna.properties
        if effect.type == "POINTER" and effect.identifier != "rna_type"
        for item in effect.fixed_type.properties
        if item.type != "POINTER" and item.identifier != "name"
    }
    assert effects == {*OTHER_EFFECTS, *PICTURES}


@pytest.mark.parametrize("name", sorted(OTHERS))
def test_every_setting_can_be_keyed(scene: Any, name: str) -> None:
    own = scene.potmesil_camera
    before = getattr(own, name)
    assert own.keyframe_insert(name, frame=1)
    setattr(own, name, OTHERS[name])
    assert own.keyframe_insert(name, frame=2)
    scene.frame_set(1)
    assert getattr(own, name) == before
    scene.frame_set(2)
    assert getattr(own, name) == OTHERS[name]


@pytest.mark.parametrize("name", sorted(OTHER_EFFECTS))
def test_every_setting_of_an_effect_can_be_keyed(scene: Any, name: str) -> None:
    group, field = group_of(scene, name)
    before = plain(getattr(group, field))
    assert group.keyframe_insert(field, frame=1)
    setattr(group, field, OTHER_EFFECTS[name])
    assert group.keyframe_insert(field, frame=2)
    scene.frame_set(1)
    assert plain(getattr(group, field)) == before
    scene.frame_set(2)
    assert plain(getattr(group, field)) == OTHER_EFFECTS[name]


def test_settings_survive_save_and_load(scene: Any, tmp_path: Path) -> None:
    change_all(scene)
    blend = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=blend)
    loaded = bpy.context.scene
    assert values(loaded) == OTHERS
    assert effect_values(loaded) == OTHER_EFFECTS
    assert all(loaded.potmesil_camera.effects.path_resolve(name) == "//elsewhere.png" for name in PICTURES)
    assert loaded.potmesil_camera.samples_path == "//elsewhere/####.exr"


@pytest.mark.parametrize("link", [False, True])
def test_settings_come_along_with_an_appended_or_linked_scene(scene: Any, tmp_path: Path, link: bool) -> None:
    change_all(scene)
    scene.name = "Shot"
    blend = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(blend, link=link) as (_, wanted):
        wanted.scenes = ["Shot"]
    (shot,) = wanted.scenes
    assert values(shot) == OTHERS
    assert effect_values(shot) == OTHER_EFFECTS


@pytest.mark.parametrize("kind", ["EMPTY", "LINK_COPY", "FULL_COPY"])
def test_settings_are_copied_with_the_scene(scene: Any, kind: str) -> None:
    change_all(scene)
    with bpy.context.temp_override(scene=scene):
        bpy.ops.scene.new(type=kind)
    copy = next(item for item in bpy.data.scenes if item != scene)
    assert values(copy) == OTHERS
    assert effect_values(copy) == OTHER_EFFECTS
    copy.potmesil_camera.fade = 1.0
    copy.potmesil_camera.effects.star.lines = 1
    assert scene.potmesil_camera.fade == 0.25
    assert scene.potmesil_camera.effects.star.lines == 4


def test_settings_are_undone(scene: Any) -> None:
    bpy.context.preferences.edit.use_global_undo = True
    before, effects_before = values(scene), effect_values(scene)
    bpy.ops.ed.undo_push(message="before")
    change_all(scene)
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert values(bpy.context.scene) == before
    assert effect_values(bpy.context.scene) == effects_before
    bpy.ops.ed.redo()
    assert values(bpy.context.scene) == OTHERS
    assert effect_values(bpy.context.scene) == OTHER_EFFECTS


def camera_at(scene: Any, name: str, distance: float, f_stop: float) -> Any:
    """Add a camera with a focus distance and an f-stop."""
    item = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    item.data.dof.focus_distance, item.data.dof.aperture_fstop = distance, f_stop
    scene.collection.objects.link(item)
    return item


def lens_of(module: Any, scene: Any) -> tuple[float, float]:
    """Return focus distance and f-stop that the processors would get."""
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        lens = module("operators.process").settings_values(bpy.context)["lens"]
    return lens["focus_distance"], round(lens["f_stop"], 4)


def test_the_active_camera_counts_also_by_markers(scene: Any, module: Any) -> None:
    near, far = camera_at(scene, "Near", 2.0, 1.4), camera_at(scene, "Far", 9.0, 8.0)
    scene.camera = far
    assert lens_of(module, scene) == (9.0, 8.0)
    for frame, camera in ((1, near), (10, far)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    scene.frame_set(5)
    assert lens_of(module, scene) == (2.0, 1.4)
    scene.frame_set(10)
    assert lens_of(module, scene) == (9.0, 8.0)


def test_each_scene_has_its_own(scene: Any, module: Any) -> None:
    scene.camera.data.dof.aperture_fstop = 2.0
    other = bpy.data.scenes.new("Other")
    other.camera = camera_at(other, "Second", 3.0, 16.0)
    scene.potmesil_camera.psf, other.potmesil_camera.psf = "disc", "lommel"
    process = module("operators.process")
    for each, expected in ((scene, "disc"), (other, "lommel"), (scene, "disc")):
        with bpy.context.temp_override(scene=each, view_layer=each.view_layers[0]):
            assert process.settings_values(bpy.context)["psf"] == {"kind": expected}
    assert (lens_of(module, scene), lens_of(module, other)) == ((5.0, 2.0), (3.0, 16.0))


def test_a_linked_camera_is_followed_and_an_override_wins(scene: Any, module: Any, tmp_path: Path) -> None:
    item = camera_at(scene, "Hero", 4.0, 2.8)
    blend = str(tmp_path / "library.blend")
    bpy.data.libraries.write(blend, {item})
    bpy.data.objects.remove(item)
    with bpy.data.libraries.load(blend, link=True) as (_, wanted):
        wanted.objects = ["Hero"]
    (linked,) = wanted.objects
    scene.collection.objects.link(linked)
    scene.camera = linked
    assert lens_of(module, scene) == (4.0, 2.8)
    mine = linked.override_create(remap_local_usages=True)
    data = mine.data.override_create(remap_local_usages=True)
    data.dof.focus_distance = 6.5
    scene.camera = mine
    assert lens_of(module, scene) == (6.5, 2.8)


def test_another_view_layer_changes_no_lens(scene: Any, module: Any) -> None:
    first = lens_of(module, scene)
    layer = scene.view_layers.new("Second")
    with bpy.context.temp_override(scene=scene, view_layer=layer):
        lens = module("operators.process").settings_values(bpy.context)["lens"]
    assert (lens["focus_distance"], round(lens["f_stop"], 4)) == first
