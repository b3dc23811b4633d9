"""Focus by hand: the planes in the 3D viewport, and the operators that focus on an object."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Euler, Matrix  # noqa: E402 - only where Blender is

STOP = 5.0


@pytest.fixture
def viewport(module: Any, scene: Any) -> Any:
    del scene
    return module("ui.viewport")


def evaluated(scene: Any) -> Any:
    return scene.camera.evaluated_get(bpy.context.evaluated_depsgraph_get())


def add(scene: Any, name: str, location: tuple[float, float, float], data: Any = None) -> Any:
    """Put an object into the scene and make it active."""
    item = bpy.data.objects.new(name, data)
    item.location = location
    scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    bpy.context.view_layer.update()
    return item


def box(name: str, half: float) -> Any:
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    return mesh


# The planes.


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("size", [(96, 64), (64, 96)])
@pytest.mark.parametrize("aspect", [(1.0, 1.0), (2.0, 1.0)])
def test_corners_lie_in_the_frame_that_blender_shows(
    viewport: Any, scene: Any, fit: str, size: tuple[int, int], aspect: tuple[float, float]
) -> None:
    """Blender's own frame at the distance 1, carried to the depth of each plane."""
    camera = scene.camera
    data = camera.data
    data.sensor_fit, data.sensor_width, data.sensor_height = fit, 36.0, 20.0
    data.shift_x, data.shift_y = 0.15, -0.3
    data.dof.aperture_fstop = STOP
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    camera.location, camera.rotation_euler = (1.0, -2.0, 3.0), (1.1, 0.2, 0.7)
    # Cycles ignores it, and so must the planes.
    camera.scale = 3.0, 0.5, 2.0
    bpy.context.view_layer.update()
    rigid = Matrix.LocRotScale(camera.location, camera.rotation_euler, None)
    frame = data.view_frame(scene=scene)
    found = viewport.planes(scene, evaluated(scene))
    assert [plane.name for plane in found] == ["Near Limit", "Focus", "Far Limit"]
    for plane in found:
        wanted = {tuple(np.round(rigid @ (corner * (plane.depth / -corner.z)), 3)) for corner in frame}
        assert {tuple(np.round(corner, 3)) for corner in plane.corners} == wanted


def test_corners_of_a_plain_camera(viewport: Any, scene: Any) -> None:
    """A film of 36 x 24 mm behind 50 mm sees 0.72 x 0.48 of the depth."""
    scene.camera.data.dof.aperture_fstop = STOP
    (_, focus, _) = viewport.planes(scene, evaluated(scene))
    upper_right, upper_left, lower_left, lower_right = focus.corners
    assert focus.depth == 5.0
    assert tuple(upper_right) == pytest.approx((1.8, 5.0, 1.2), abs=1e-5)
    assert tuple(upper_left) == pytest.approx((-1.8, 5.0, 1.2), abs=1e-5)
    assert tuple(lower_left) == pytest.approx((-1.8, 5.0, -1.2), abs=1e-5)
    assert tuple(lower_right) == pytest.approx((1.8, 5.0, -1.2), abs=1e-5)


def test_depths_are_the_limits_of_the_depth_of_field(viewport: Any, scene: Any) -> None:
    """TOG 1982, eqs. 6 and 7, with H = 1000 F / n = 10 m: near 10/3 m, far 10 m."""
    scene.camera.data.dof.aperture_fstop = STOP
    near, focus, far = viewport.planes(scene, evaluated(scene))
    assert (near.depth, focus.depth, far.depth) == pytest.approx((10.0 / 3.0, 5.0, 10.0))


def test_a_far_limit_at_infinity_has_no_plane(viewport: Any, scene: Any) -> None:
    scene.camera.data.dof.aperture_fstop = 10.0 + 1e-4
    found = viewport.planes(scene, evaluated(scene))
    assert [plane.name for plane in found] == ["Near Limit", "Focus"]
    assert found[0].depth == pytest.approx(2.5, rel=1e-4)


def test_planes_follow_a_parent(viewport: Any, scene: Any) -> None:
    rig = add(scene, "Rig", (2.0, 0.0, 0.0))
    rig.rotation_euler = 0.0, 0.0, math.pi / 2
    rig.scale = 4.0, 4.0, 4.0
    scene.camera.parent = rig
    bpy.context.view_layer.update()
    scene.camera.data.dof.aperture_fstop = STOP
    (_, focus, _) = viewport.planes(scene, evaluated(scene))
    # It looks along -x now, and is focused 5 m away whatever the parent's scale.
    assert tuple(focus.matrix.translation) == pytest.approx((-3.0, 0.0, 0.0), abs=1e-5)
    width = (focus.corners[0] - focus.corners[1]).length
    assert width == pytest.approx(3.6, rel=1e-5)


def test_the_plane_in_focus_follows_the_tracked_object(viewport: Any, scene: Any) -> None:
    scene.camera.data.dof.aperture_fstop = STOP
    scene.camera.data.dof.focus_object = add(scene, "Target", (1.0, 3.0, -1.0))
    (_, focus, _) = viewport.planes(scene, evaluated(scene))
    assert focus.depth == pytest.approx(3.0)


def test_planes_that_cover_each_other_are_drawn_from_the_back(viewport: Any, scene: Any) -> None:
    scene.camera.data.dof.aperture_fstop = STOP
    camera = evaluated(scene)
    found = viewport.planes(scene, camera)

    class View:
        """A 3D viewport's eye at y, which looks along or against +y."""

        def __init__(self, y: float, *, along: bool, perspective: bool) -> None:
            turn = Euler((math.pi / 2, 0.0, 0.0 if along else math.pi)).to_matrix().to_4x4()
            self.view_matrix = (Matrix.Translation((0.0, y, 0.0)) @ turn).inverted()
            self.is_perspective = perspective

    def order(view: View) -> list[str]:
        return [plane.name.split()[0] for plane in viewport._back_to_front(found, camera, view)]

    assert order(View(-9.0, along=True, perspective=True)) == ["Far", "Focus", "Near"]
    assert order(View(30.0, along=False, perspective=True)) == ["Near", "Focus", "Far"]
    # Between focus (5 m) and far limit (10 m), nearer to the focus.
    assert order(View(6.0, along=True, perspective=True)) == ["Far", "Near", "Focus"]
    assert order(View(6.0, along=True, perspective=False)) == ["Far", "Focus", "Near"]
    assert order(View(6.0, along=False, perspective=False)) == ["Near", "Focus", "Far"]


def test_nothing_is_drawn_once_the_extension_is_off(extension: Any, viewport: Any) -> None:
    assert len(viewport._handlers) == 2
    for _ in range(2):
        extension.unregister()
        try:
            assert viewport._handlers == []
            assert viewport._shapes == {}
            assert not hasattr(bpy.types, "POTMESIL_GGT_focus")
        finally:
            extension.register()
        assert len(viewport._handlers) == 2


# The operators.


def test_focus_on_the_active_object_takes_its_depth(scene: Any) -> None:
    add(scene, "Target", (2.0, 4.0, 1.0))
    scene.camera.scale = 3.0, 3.0, 3.0
    assert bpy.ops.potmesil.focus_on_active() == {"FINISHED"}
    assert scene.camera.data.dof.focus_distance == pytest.approx(4.0)


def test_focus_follows_constraints_and_parents(scene: Any) -> None:
    rig = add(scene, "Rig", (0.0, 1.0, 0.0))
    target = add(scene, "Target", (0.0, 2.0, 0.0))
    target.parent = rig
    constraint = target.constraints.new("LIMIT_LOCATION")
    constraint.use_min_y, constraint.min_y = True, 7.0
    bpy.ops.potmesil.focus_on_active()
    assert scene.camera.data.dof.focus_distance == pytest.approx(7.0)


def test_focus_on_the_nearest_surface(scene: Any) -> None:
    item = add(scene, "Box", (0.0, 6.0, 0.0), box("Box", 1.0))
    assert bpy.ops.potmesil.focus_on_active(target="SURFACE") == {"FINISHED"}
    assert scene.camera.data.dof.focus_distance == pytest.approx(5.0)
    item.scale = 1.0, 2.0, 1.0
    bpy.ops.potmesil.focus_on_active(target="SURFACE")
    assert scene.camera.data.dof.focus_distance == pytest.approx(4.0)
    # A second box, made by a modifier, 2 m nearer.
    item.modifiers.new("Array", "ARRAY").relative_offset_displace = (0.0, -0.5, 0.0)
    bpy.ops.potmesil.focus_on_active(target="SURFACE")
    assert scene.camera.data.dof.focus_distance == pytest.approx(2.0)


def test_nearest_surface_where_the_line_to_the_origin_misses_it(scene: Any) -> None:
    """A frame around the line of sight, whose nearest corner stands at a depth of 5 m."""
    mesh = bpy.data.meshes.new("Frame")
    mesh.from_pydata([(1.0, -1.0, 0.0), (2.0, 0.0, 0.0), (2.0, 0.0, 1.0)], [], [(0, 1, 2)])
    add(scene, "Frame", (0.0, 6.0, 0.0), mesh)
    bpy.ops.potmesil.focus_on_active(target="SURFACE")
    assert scene.camera.data.dof.focus_distance == pytest.approx(5.0)


def test_nearest_surface_of_text(scene: Any) -> None:
    curve = bpy.data.curves.new("Text", "FONT")
    curve.body, curve.extrude = "O", 0.25
    curve.align_x, curve.align_y = "LEFT", "BOTTOM"
    item = add(scene, "Text", (0.0, 6.0, 0.0), curve)
    item.rotation_euler = math.pi / 2, 0.0, 0.0
    bpy.ops.potmesil.focus_on_active(target="SURFACE")
    assert scene.camera.data.dof.focus_distance == pytest.approx(5.75, abs=1e-3)


def test_an_object_without_surface_has_its_origin_in_focus(scene: Any) -> None:
    add(scene, "Empty", (0.0, 3.0, 0.0))
    bpy.ops.potmesil.focus_on_active(target="SURFACE")
    assert scene.camera.data.dof.focus_distance == pytest.approx(3.0)
    add(scene, "Bare", (0.0, 2.0, 0.0), bpy.data.meshes.new("Bare"))
    bpy.ops.potmesil.focus_on_active(target="SURFACE")
    assert scene.camera.data.dof.focus_distance == pytest.approx(2.0)


def test_nothing_is_set_for_an_object_behind_the_camera(scene: Any) -> None:
    add(scene, "Behind", (0.0, -3.0, 0.0))
    dof = scene.camera.data.dof
    before = dof.focus_object = add(scene, "Before", (0.0, 3.0, 0.0))
    bpy.context.view_layer.objects.active = bpy.data.objects["Behind"]
    with pytest.raises(RuntimeError, match="not before the camera"):
        bpy.ops.potmesil.focus_on_active()
    assert (dof.focus_distance, dof.focus_object) == (5.0, before)


def test_beside_the_cameras_settings_the_other_selected_object_counts(scene: Any) -> None:
    target, camera = add(scene, "Target", (0.0, 3.0, 0.0)), scene.camera
    bpy.context.view_layer.objects.active = camera
    for item in scene.objects:
        item.select_set(item == camera)
    assert not bpy.ops.potmesil.focus_on_active.poll()
    target.select_set(True)
    assert bpy.ops.potmesil.focus_on_active() == {"FINISHED"}
    assert camera.data.dof.focus_distance == pytest.approx(3.0)
    assert bpy.ops.potmesil.track_object() == {"FINISHED"}
    assert camera.data.dof.focus_object == target


def test_buttons_say_what_is_missing(scene: Any) -> None:
    bpy.context.view_layer.objects.active = None
    with pytest.raises(RuntimeError, match="no active object"):
        bpy.ops.potmesil.focus_on_active()
    bpy.context.view_layer.objects.active = scene.camera
    scene.camera.select_set(True)
    with pytest.raises(RuntimeError, match="camera itself"):
        bpy.ops.potmesil.track_object()
    with pytest.raises(RuntimeError, match="tracks no object"):
        bpy.ops.potmesil.stop_tracking()
    scene.camera = add(scene, "Empty", (0.0, 1.0, 0.0))
    for name in ("focus_on_active", "track_object", "stop_tracking"):
        with pytest.raises(RuntimeError, match="no camera"):
            getattr(bpy.ops.potmesil, name)()


def test_the_scenes_own_camera_is_focused(scene: Any) -> None:
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    scene.collection.objects.link(other)
    first = scene.camera
    other.location = 0.0, 1.0, 0.0
    other.rotation_euler = first.rotation_euler
    scene.camera = other
    add(scene, "Target", (0.0, 4.0, 0.0))
    bpy.ops.potmesil.focus_on_active()
    assert other.data.dof.focus_distance == pytest.approx(3.0)
    assert first.data.dof.focus_distance == 5.0


def test_tracking_keeps_the_object_in_focus_and_stopping_keeps_the_distance(scene: Any, module: Any) -> None:
    target = add(scene, "Target", (0.0, 4.0, 0.0))
    dof = scene.camera.data.dof
    assert bpy.ops.potmesil.track_object() == {"FINISHED"}
    assert dof.focus_object == target
    target.location.y = 7.0
    bpy.context.view_layer.update()
    assert module("operators.scene").focus_distance(evaluated(scene)) == pytest.approx(7.0)
    assert bpy.ops.potmesil.stop_tracking() == {"FINISHED"}
    assert dof.focus_object is None
    assert dof.focus_distance == pytest.approx(7.0)


def test_focusing_by_hand_ends_the_tracking(scene: Any) -> None:
    add(scene, "Tracked", (0.0, 4.0, 0.0))
    bpy.ops.potmesil.track_object()
    add(scene, "Target", (0.0, 2.0, 0.0))
    bpy.ops.potmesil.focus_on_active()
    assert scene.camera.data.dof.focus_object is None
    assert scene.camera.data.dof.focus_distance == pytest.approx(2.0)


def test_the_active_bone_counts_in_pose_mode(scene: Any) -> None:
    armature = bpy.data.armatures.new("Rig")
    rig = add(scene, "Rig", (0.0, 5.0, 0.0), armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.edit_bones.new("Head")
    bone.head, bone.tail = (0.0, 2.0, 0.0), (0.0, 2.0, 1.0)
    bpy.ops.object.mode_set(mode="POSE")
    armature.bones.active = armature.bones["Head"]
    rig.pose.bones["Head"].location.z = 0.5
    bpy.context.view_layer.update()
    bpy.ops.potmesil.focus_on_active()
    depth = (rig.matrix_world @ rig.pose.bones["Head"].matrix).translation.y
    assert depth != pytest.approx(7.0)
    assert scene.camera.data.dof.focus_distance == pytest.approx(depth)
    bpy.ops.potmesil.track_object()
    dof = scene.camera.data.dof
    assert (dof.focus_object, dof.focus_subtarget) == (rig, "Head")
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.potmesil.track_object()
    assert dof.focus_subtarget == ""


def test_a_driver_is_not_overridden(scene: Any, module: Any) -> None:
    dof = scene.camera.data.dof
    dof.driver_add("focus_distance").driver.expression = "3.0"
    tracked = dof.focus_object = add(scene, "Target", (0.0, 4.0, 0.0))
    assert module("operators.focus").is_driven(scene.camera.data)
    for name in ("focus_on_active", "stop_tracking"):
        with pytest.raises(RuntimeError, match="A driver sets the focus distance"):
            getattr(bpy.ops.potmesil, name)()
    assert dof.focus_object == tracked


def keys(scene: Any, module: Any) -> list[tuple[float, float]]:
    """Return the keys of the focus distance."""
    (curve,) = module("operators.animation").curves_of(scene.camera.data.dof, "focus_distance")
    return [tuple(point.co) for point in curve.keyframe_points]


def test_auto_keying_keys_an_animated_distance(scene: Any, module: Any) -> None:
    dof = scene.camera.data.dof
    dof.keyframe_insert("focus_distance", frame=1)
    add(scene, "Target", (0.0, 3.0, 0.0))
    scene.frame_set(10)
    bpy.ops.potmesil.focus_on_active()
    assert keys(scene, module) == [(1.0, 5.0)]
    assert dof.focus_distance == pytest.approx(3.0)
    scene.tool_settings.use_keyframe_insert_auto = True
    try:
        bpy.ops.potmesil.focus_on_active()
        assert keys(scene, module) == [(1.0, 5.0), (10.0, 3.0)]
        # Where no curve takes a key, nothing is changed.
        (curve,) = module("operators.animation").curves_of(dof, "focus_distance")
        curve.lock = True
        bpy.data.objects["Target"].location.y = 4.0
        with pytest.raises(RuntimeError, match="takes no key"):
            bpy.ops.potmesil.focus_on_active()
        assert dof.focus_distance == pytest.approx(3.0)
    finally:
        scene.tool_settings.use_keyframe_insert_auto = False


def test_auto_keying_leaves_what_is_not_animated(scene: Any, module: Any) -> None:
    add(scene, "Target", (0.0, 3.0, 0.0))
    scene.tool_settings.use_keyframe_insert_auto = True
    try:
        bpy.ops.potmesil.focus_on_active()
    finally:
        scene.tool_settings.use_keyframe_insert_auto = False
    assert list(module("operators.animation").curves_of(scene.camera.data.dof, "focus_distance")) == []


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A file with a camera that looks along +y."""
    path = tmp_path / "library.blend"
    camera = bpy.data.objects.new("Linked", bpy.data.cameras.new("Linked"))
    camera.rotation_euler = math.pi / 2, 0.0, 0.0
    bpy.data.libraries.write(str(path), {camera}, fake_user=True)
    bpy.data.cameras.remove(camera.data)
    return path


def test_a_linked_camera_is_left_as_it_is(scene: Any, module: Any, library: Path) -> None:
    with bpy.data.libraries.load(str(library), link=True) as (there, here):
        here.objects = there.objects
    (camera,) = here.objects
    scene.collection.objects.link(camera)
    scene.camera = camera
    before = camera.data.dof.focus_distance
    add(scene, "Target", (0.0, 3.0, 0.0))
    assert module("operators.focus").is_linked(camera.data)
    for name in ("focus_on_active", "track_object"):
        with pytest.raises(RuntimeError, match="linked from another file"):
            getattr(bpy.ops.potmesil, name)()
    assert (camera.data.dof.focus_distance, camera.data.dof.focus_object) == (before, None)


def test_an_overridden_camera_can_be_focused(scene: Any, module: Any, library: Path) -> None:
    with bpy.data.libraries.load(str(library), link=True) as (there, here):
        here.objects = there.objects
    (linked,) = here.objects
    scene.collection.objects.link(linked)
    camera = linked.override_create(remap_local_usages=True)
    camera.data = linked.data.override_create(remap_local_usages=True)
    scene.camera = camera
    add(scene, "Target", (0.0, 3.0, 0.0))
    assert not module("operators.focus").is_linked(camera.data)
    bpy.ops.potmesil.focus_on_active()
    assert camera.data.dof.focus_distance == pytest.approx(3.0)


def test_each_button_is_one_undo_step(scene: Any) -> None:
    for name in ("POTMESIL_OT_focus_on_active", "POTMESIL_OT_track_object", "POTMESIL_OT_stop_tracking"):
        assert {"REGISTER", "UNDO"} <= getattr(bpy.types, name).bl_options


def test_the_handle_is_there_only_where_it_can_be_dragged(viewport: Any, scene: Any) -> None:
    """In a 3D viewport as the group sees it; a real one needs a window."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    space = SimpleNamespace(
        overlay=SimpleNamespace(show_overlays=True),
        camera=scene.camera,
        show_gizmo_context=True,
    )
    view = SimpleNamespace(view_perspective="PERSP")
    layer = SimpleNamespace(depsgraph=depsgraph)
    context = SimpleNamespace(scene=scene, space_data=space, region_data=view, view_layer=layer)

    def shown() -> tuple[bool, bool]:
        return viewport.shown_camera(context) is not None, viewport.POTMESIL_GGT_focus.poll(context)

    assert shown() == (False, False)
    scene.potmesil_camera.show_limits = True
    assert shown() == (True, True)
    space.show_gizmo_context = False
    assert shown() == (True, False)
    space.show_gizmo_context = True
    scene.camera.data.dof.focus_object = add(scene, "Target", (0.0, 3.0, 0.0))
    assert shown() == (True, False)
    scene.camera.data.dof.focus_object = None
    view.view_perspective = "CAMERA"
    assert shown() == (False, False)
    view.view_perspective = "PERSP"
    scene.camera.data.dof.driver_add("focus_distance")
    assert shown() == (True, False)
    space.overlay.show_overlays = False
    assert shown() == (False, False)
    space.overlay.show_overlays = True
    scene.camera.data.type = "ORTHO"
    assert shown() == (False, False)
