"""The pre-flight check on real scenes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import bpy
import pytest

from sample_scenes.building import emitter

from .scenes import card, dump
from .test_reflections import clear_glass, silver


def _titles(scene: Any, module: Any) -> list[str]:
    facts = module("operators.scene").scene_facts(scene)
    return [finding.title for finding in module("potmesil_addon.preflight").check_scene(facts)]


def test_prepared_scene_has_no_findings(scene: Any, module: Any) -> None:
    bpy.ops.potmesil.setup_passes()
    assert _titles(scene, module) == []


def test_findings_name_what_is_there(scene: Any, module: Any) -> None:
    for x in (0.0, 1.0):
        card(scene, "Card", (x, 5.0, 0.0), 1.0, emitter("Glow", (1.0, 1.0, 1.0)))
    scene.camera.data.dof.use_dof = True
    scene.cycles.use_denoising = True
    scene.cycles.sample_clamp_direct = 10.0
    titles = _titles(scene, module)
    assert any(title.startswith("Passes Off: Z, Vector, Object Index") for title in titles)
    assert {"Objects Share Index 0", "Camera Blurs Already", "Denoising On", "Samples Clamped"} <= set(titles)


def test_focus_that_was_never_set_is_named_and_renders_as_in_cycles(scene: Any, module: Any) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (1.0, 1.0, 1.0)))
    scene.camera.data.dof.focus_distance = 0.0
    assert "Focus Distance Is 0" in _titles(scene, module)
    assert bpy.ops.potmesil.render() == {"FINISHED"}


def test_render_refuses_without_a_camera(scene: Any) -> None:
    scene.camera = None
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.potmesil.render()
    assert "no camera" in bpy.context.window_manager.potmesil_camera.error


def test_render_refuses_a_panoramic_camera(scene: Any) -> None:
    scene.camera.data.type = "PANO"
    with pytest.raises(RuntimeError, match="panoramic"):
        bpy.ops.potmesil.render()


def test_set_up_passes_numbers_objects_and_keeps_what_is_unique(scene: Any) -> None:
    glow = emitter("Glow", (1.0, 1.0, 1.0))
    cards = [card(scene, f"Card {i}", (i, 5.0, 0.0), 1.0, glow) for i in range(5)]
    for item, index in zip(cards, (7, 7, 0, 3, 0), strict=True):
        item.pass_index = index
    bpy.ops.potmesil.setup_passes()
    layer = scene.view_layers[0]
    assert layer.use_pass_z
    assert layer.use_pass_vector
    assert layer.use_pass_object_index
    indices = [item.pass_index for item in cards]
    assert len(set(indices)) == 5
    assert 0 not in indices
    assert indices[0] == 7
    assert indices[3] == 3
    before = list(indices)
    bpy.ops.potmesil.setup_passes()
    assert [item.pass_index for item in cards] == before


def test_set_up_passes_undoes(scene: Any) -> None:
    card(scene, "Card", (0.0, 5.0, 0.0), 1.0, emitter("Glow", (1.0, 1.0, 1.0)))
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.potmesil.setup_passes()
    bpy.ops.ed.undo_push(message="after")
    assert bpy.data.objects["Card"].pass_index == 1
    bpy.ops.ed.undo()
    assert bpy.data.objects["Card"].pass_index == 0
    assert not bpy.context.scene.view_layers[0].use_pass_z


def _render(name: str, value: Any) -> Callable[[Any], None]:
    return lambda scene: setattr(scene.render, name, value)


def _camera(name: str, value: Any) -> Callable[[Any], None]:
    return lambda scene: setattr(scene.camera.data, name, value)


def _dof(name: str, value: Any) -> Callable[[Any], None]:
    return lambda scene: setattr(scene.camera.data.dof, name, value)


def _cycles(name: str, value: Any) -> Callable[[Any], None]:
    return lambda scene: setattr(scene.cycles, name, value)


def _without_camera(scene: Any) -> None:
    bpy.data.cameras.remove(scene.camera.data)


def _staged(name: str) -> Callable[[Any], None]:
    def spoil(scene: Any) -> None:
        bpy.ops.potmesil.add_stage()
        setattr(scene.render, name, False)

    return spoil


def _samples(path: str) -> Callable[[Any], None]:
    return lambda scene: setattr(scene.potmesil_camera, "samples_path", path)


def _own(**values: Any) -> Callable[[Any], None]:
    def spoil(scene: Any) -> None:
        for name, value in values.items():
            setattr(scene.potmesil_camera, name, value)

    return spoil


def _with_mirror(scene: Any) -> None:
    card(scene, "Mirror", (0.0, 6.0, 0.0), 1.0, silver())


def _eevee_with_reflections(scene: Any) -> None:
    scene.potmesil_camera.reflections = "REFLECTIONS"
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"


SPOILED: list[tuple[str, str, Callable[[Any], None], set[str]]] = [
    ("add_camera", "No Camera", _without_camera, {"camera", "cameras"}),
    ("activate_camera", "No Active Camera", lambda scene: setattr(scene, "camera", None), {"camera"}),
    ("perspective_camera", "Panoramic Camera", _camera("type", "PANO"), {"camera_data"}),
    ("perspective_camera", "No Perspective Camera", _camera("type", "ORTHO"), {"camera_data"}),
    ("use_cycles", "Engine Without Passes", _render("engine", "BLENDER_WORKBENCH"), {"render"}),
    ("use_view_layer", "No View Layer", lambda scene: setattr(scene.view_layers[0], "use", False), {"layer"}),
    ("focus_middle", "Focus Distance Is 0", _dof("focus_distance", 0.0), {"dof"}),
    ("open_aperture", "Hardly Anything Is Blurred", _dof("aperture_fstop", 64.0), {"dof"}),
    ("motion_blur_off", "Motion Blur On", _render("use_motion_blur", True), {"render"}),
    ("camera_blur_off", "Camera Blurs Already", _dof("use_dof", True), {"dof"}),
    ("denoising_off", "Denoising On", _cycles("use_denoising", True), {"cycles"}),
    ("clamping_off", "Samples Clamped", _cycles("sample_clamp_direct", 3.0), {"cycles"}),
    ("clamping_off", "Samples Clamped", _cycles("sample_clamp_indirect", 3.0), {"cycles"}),
    ("use_cycles", "Reflections Without Cycles", _eevee_with_reflections, {"render"}),
    ("reflections_off", "Nothing Reflects", _own(reflections="REFLECTIONS"), {"own"}),
    ("reflections_on", "Reflections Off", _with_mirror, {"own"}),
    (
        "motion_on",
        "Shadows Do Not Move",
        _own(reflections="REFLECTIONS_AND_SHADOWS", use_motion=False),
        {"own"},
    ),
    ("stereo_off", "Stereo Views", _render("use_multiview", True), {"render"}),
    ("region_off", "Render Region", _render("use_border", True), {"render"}),
    ("compositing_on", "Compositing Off", _staged("use_compositing"), {"render"}),
    ("lock_interface", "Interface Not Locked", _staged("use_lock_interface"), {"render"}),
    ("number_samples", "One Samples File", _samples("/tmp/potmesil/one.exr"), {"own"}),
]


def _whole(scene: Any) -> dict[str, Any]:
    """Return everything that a fix could touch, by what it belongs to."""
    camera = scene.camera
    return {
        "camera": camera and camera.name,
        "cameras": sorted(bpy.data.cameras.keys()),
        "camera_data": camera and {k: v for k, v in dump(camera.data, 0).items() if k != "dof"},
        "dof": camera and dump(camera.data.dof),
        "render": dump(scene.render),
        "cycles": dump(scene.cycles),
        "layer": {name: v for name, v in dump(scene.view_layers[0], 0).items() if name.startswith("use")},
        "own": dump(scene.potmesil_camera),
        "indices": [item.pass_index for item in scene.objects if item.type != "CAMERA"],
        "frame": scene.frame_current,
    }


@pytest.mark.parametrize(
    ("fix", "title", "spoil", "changed"), SPOILED, ids=[f"{each[0]}-{each[1]}" for each in SPOILED]
)
def test_each_fix_mends_its_finding_and_nothing_else(
    scene: Any, module: Any, fix: str, title: str, spoil: Callable[[Any], None], changed: set[str]
) -> None:
    card(scene, "Wall", (0.0, 7.0, 0.0), 20.0, emitter("Glow", (1.0, 1.0, 1.0)))
    bpy.ops.potmesil.setup_passes()
    spoil(scene)
    bpy.context.view_layer.update()
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    findings = module("potmesil_addon.preflight").check_scene(
        module("operators.scene").scene_facts(bpy.context.scene)
    )
    assert (title, fix) in [(finding.title, finding.fix) for finding in findings]
    before = _whole(bpy.context.scene)
    assert bpy.ops.potmesil.fix(fix=fix) == {"FINISHED"}
    after = _whole(bpy.context.scene)
    assert title not in _titles(bpy.context.scene, module)
    differing = {key for key in before if before[key] != after[key]}
    # Where there was no camera, none could be looked into.
    assert differing - ({"camera_data", "dof"} if before["camera"] is None else set()) == changed
    for part in changed & {"render", "cycles", "dof", "own"}:
        names = {name for name, value in after[part].items() if before[part][name] != value}
        # Blender's own answer to which engines there are.
        assert len(names - {"use_spherical_stereo", "has_multiple_engines"}) == 1
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert title in _titles(bpy.context.scene, module)


def test_mirrors_count_where_something_blurs_them(scene: Any, module: Any) -> None:
    titles = {"Nothing Reflects", "Reflections Off", "Reflections Without Cycles"}
    item = card(scene, "Window", (0.0, 6.0, 0.0), 1.0, clear_glass(1.5))
    own = scene.potmesil_camera
    assert titles & set(_titles(scene, module)) == {"Reflections Off"}
    # A polished floor is no mirror, and costs as much: who wants it knows.
    item.potmesil_camera.surface = "POLISHED"
    assert not titles & set(_titles(scene, module))
    item.potmesil_camera.surface = "OPAQUE"
    assert not titles & set(_titles(scene, module))
    own.reflections = "REFLECTIONS"
    assert titles & set(_titles(scene, module)) == {"Nothing Reflects"}
    # Shadows move without mirrors, too.
    own.reflections = "REFLECTIONS_AND_SHADOWS"
    assert not titles & set(_titles(scene, module))
    own.reflections, own.use_lens, own.use_motion = "REFLECTIONS", False, False
    assert not titles & set(_titles(scene, module))


def test_every_fix_has_its_way_and_a_tooltip(module: Any) -> None:
    ways = module("operators.fix").WAYS
    assert set(ways) == set(get_args(module("potmesil_addon.preflight").Fix))
    for way in ways.values():
        assert way.label
        assert way.tooltip
        assert not way.tooltip.endswith(".")


def test_a_camera_that_was_added_sees_the_whole_scene(scene: Any) -> None:
    _without_camera(scene)
    cards = [
        card(scene, f"Card {x}", (x, 30.0, 2.0), 1.0, emitter("Glow", (1.0, 1.0, 1.0))) for x in (-40, 60)
    ]
    bpy.context.view_layer.update()
    assert bpy.ops.potmesil.fix(fix="add_camera") == {"FINISHED"}
    from bpy_extras.object_utils import world_to_camera_view

    for item in cards:
        place = world_to_camera_view(scene, scene.camera, item.location)
        assert 0.0 < place.x < 1.0
        assert 0.0 < place.y < 1.0
        assert scene.camera.data.clip_start < place.z < scene.camera.data.clip_end


def test_the_focus_is_on_what_the_middle_shows(scene: Any) -> None:
    glow = emitter("Glow", (1.0, 1.0, 1.0))
    card(scene, "Wall", (0.0, 7.0, 0.0), 20.0, glow)
    card(scene, "Aside", (-3.0, 4.0, 0.0), 1.0, glow)
    scene.camera.data.dof.focus_distance = 0.0
    bpy.context.view_layer.update()
    bpy.ops.potmesil.fix(fix="focus_middle")
    assert math.isclose(scene.camera.data.dof.focus_distance, 7.0, rel_tol=1e-5)
    # Where the middle shows nothing, it is the middle of what is before the camera.
    bpy.data.objects.remove(bpy.data.objects["Wall"])
    card(scene, "Other", (3.0, 8.0, 0.0), 1.0, glow)
    card(scene, "Behind", (0.0, -8.0, 0.0), 1.0, glow)
    bpy.context.view_layer.update()
    bpy.ops.potmesil.fix(fix="focus_middle")
    assert math.isclose(scene.camera.data.dof.focus_distance, 6.0, rel_tol=1e-5)


def test_an_open_aperture_blurs_the_farthest_by_a_hundredth(scene: Any, module: Any) -> None:
    dof = scene.camera.data.dof
    dof.aperture_fstop = 64.0
    scene.render.resolution_x = 1000
    bpy.ops.potmesil.fix(fix="open_aperture")
    lens = module("operators.scene").scene_lens(scene.camera)
    circle = module("potmesil_addon.lens").circle_of_confusion_at_infinity(lens)
    assert math.isclose(circle, 0.36e-3, rel_tol=1e-4)


def test_samples_that_cannot_be_kept_are_refused_before_the_render(
    scene: Any, module: Any, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("no folder")
    scene.potmesil_camera.samples_path = str(tmp_path / "file" / "deeper" / "####.exr")
    with pytest.raises(RuntimeError, match="Cannot write samples"):
        bpy.ops.potmesil.render()
    state = bpy.context.window_manager.potmesil_camera
    assert "Cannot write samples" in state.error
    assert bpy.ops.potmesil.fix(fix="samples_beside") == {"FINISHED"}
    assert state.error == ""
    # The file was never saved: Blender's temporary folder has them.
    assert _titles(scene, module)[-1] == "File Not Saved"
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    assert module("operators.scene").samples_path(scene).is_relative_to(bpy.app.tempdir)


def test_a_linked_camera_is_left_alone_and_said(scene: Any, module: Any, tmp_path: Path) -> None:
    scene.camera.data.type = "ORTHO"
    bpy.data.libraries.write(str(tmp_path / "cameras.blend"), {scene.camera})
    bpy.data.objects.remove(scene.camera)
    with bpy.data.libraries.load(str(tmp_path / "cameras.blend"), link=True) as (there, here):
        here.objects = there.objects
    scene.collection.objects.link(here.objects[0])
    scene.camera = here.objects[0]
    assert {"No Perspective Camera", "Camera Is Linked"} <= set(_titles(scene, module))
    with pytest.raises(RuntimeError, match="linked from another file"):
        bpy.ops.potmesil.fix(fix="perspective_camera")
    assert scene.camera.data.type == "ORTHO"


def test_what_is_animated_is_not_changed_for_a_moment(scene: Any) -> None:
    dof = scene.camera.data.dof
    dof.use_dof = True
    dof.keyframe_insert("use_dof", frame=1)
    with pytest.raises(RuntimeError, match="is animated"):
        bpy.ops.potmesil.fix(fix="camera_blur_off")
    assert dof.use_dof


def test_fix_all_makes_a_scene_ready_that_was_never_prepared(extension: Any, module: Any) -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    scene.camera = None
    assert {"No Active Camera", "Not Cycles"} <= set(_titles(scene, module))
    assert bpy.ops.potmesil.fix_all() == {"FINISHED"}
    check = module("potmesil_addon.preflight").check_scene
    findings = check(module("operators.scene").scene_facts(scene))
    assert {finding.severity for finding in findings} <= {"note"}
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    scene.cycles.samples = 2
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
