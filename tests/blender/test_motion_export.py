"""What moves, from the evaluated scene into the samples file: paths, shutter, and what is hidden."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from sample_scenes.building import emitter

from .scenes import card, dump

OpenEXR = pytest.importorskip("OpenEXR")

# Pixels per unit of something 5 m away, for the scene's 50 mm lens on 36 mm and 96 pixels.
SCALE = 96.0 * 50.0 / 36.0 / 5.0


@pytest.fixture
def sampled(scene: Any, module: Any) -> Callable[[], Any]:
    """Sample the scene's motion."""
    run = module("potmesil_addon.progress").run
    sample_motion = module("operators.motion").sample_motion
    return lambda: run(sample_motion(scene))


@pytest.fixture
def exported(scene: Any, module: Any, tmp_path: Path) -> Callable[[], Any]:
    """Export the scene's samples, and read them."""
    path = tmp_path / "exported.exr"

    def export() -> Any:
        module("operators.export").render_samples(bpy.context, path)
        return module("potmesil_addon.exr").read_samples(path)

    return export


def keyed(owner: Any, name: str, values: dict[float, Any], interpolation: str = "LINEAR") -> None:
    """Key a property; the scene is left at frame 1."""
    for frame, value in values.items():
        setattr(owner, name, value)
        owner.keyframe_insert(name, frame=frame)
    animation = owner.id_data.animation_data
    for layer in animation.action.layers:
        for strip in layer.strips:
            for curve in strip.channelbag(animation.action_slot).fcurves:
                for point in curve.keyframe_points:
                    point.interpolation = interpolation
    bpy.context.scene.frame_set(1)


def path_of(motion: Any, name: str) -> Any:
    (path,) = (path for path in motion.paths.objects if path.name == name)
    return path


def names_of(motion: Any) -> list[str]:
    return [path.name for path in motion.paths.objects]


def pixels(matrix: Any, points: Any) -> Any:
    x, y, w = matrix[:3] @ np.concatenate([points, np.ones((len(points), 1))], axis=1).T
    return np.stack([x / w, y / w], axis=1)


def matrix_now(name: str, parent: str | None = None) -> Any:
    """Return an instance's matrix in the scene as it is evaluated now."""
    graph = bpy.context.evaluated_depsgraph_get()
    for instance in graph.object_instances:
        of = instance.parent.name if instance.is_instance else None
        if (instance.object.name, of) == (name, parent):
            return np.array(instance.matrix_world)
    raise AssertionError(name)


def farthest_from_truth(scene: Any, module: Any, motion: Any, path: Any, *, shown: Any) -> float:
    """Return how far from their places, in pixels, the path and the camera's put the corners of a box."""
    adapter = module("operators.scene")
    low, high = path.box
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
    frame = scene.frame_current
    worst = 0.0
    for time in np.linspace(-1.0, 1.0, 65):
        at = frame + float(time)
        scene.frame_set(math.floor(at), subframe=at - math.floor(at))
        graph = bpy.context.evaluated_depsgraph_get()
        camera = adapter.scene_camera(scene, adapter.evaluated_camera(scene, graph)).matrix
        truth = pixels(camera @ shown(), corners)
        ours = pixels(motion.paths.camera.at(float(time)) @ path.at(float(time)), corners)
        worst = max(worst, float(np.abs(truth - ours).max()))
    scene.frame_set(frame)
    return worst


def glowing(scene: Any, name: str = "Card", x: float = 0.0, y: float = 5.0, z: float = 0.0) -> Any:
    return card(scene, name, (x, y, z), 1.0, emitter(name, (1.0, 0.5, 0.25)))


def test_straight_motion_needs_three_times(scene: Any, sampled: Any) -> None:
    item = glowing(scene)
    item.pass_index = 7
    keyed(item, "location", {-1: (-0.6, 5, 0), 3: (0.6, 5, 0)})
    path = path_of(sampled(), "Card")
    assert path.object_index == 7
    assert not path.deforming
    np.testing.assert_allclose(path.times, [-1.0, 0.0, 1.0])
    np.testing.assert_allclose(path.matrices[:, 0, 3], [-0.3, 0.0, 0.3], atol=1e-6)
    np.testing.assert_allclose(path.box, [[-0.5, 0.0, -0.5], [0.5, 0.0, 0.5]], atol=1e-6)


def test_rotation_keeps_to_the_circle(scene: Any, sampled: Any) -> None:
    item = glowing(scene)
    keyed(item, "rotation_euler", {0: (0, -1.5, 0), 2: (0, 1.5, 0)})
    motion = sampled()
    path = path_of(motion, "Card")
    assert 5 < path.times.size < 65
    camera = motion.paths.camera.at(0.0)
    corner = np.array([[0.5, 0.0, 0.5]])
    for time in np.linspace(-1.0, 1.0, 101):
        turned = np.array(Matrix.Translation((0, 5, 0)) @ Matrix.Rotation(1.5 * float(time), 4, "Y"))
        truth = pixels(camera @ turned, corner)
        ours = pixels(camera @ path.at(float(time)), corner)
        assert np.hypot(*(truth - ours)[0]) < 0.1


def test_what_is_at_rest_is_not_listed(scene: Any, sampled: Any) -> None:
    glowing(scene, "Still")
    keyed(glowing(scene, "Keyed"), "location", {0: (1, 5, 0), 2: (1, 5, 0)})
    # Out of view, with no samples in the file.
    keyed(glowing(scene, "Elsewhere"), "location", {0: (40, 5, 0), 2: (41, 5, 0)})
    keyed(glowing(scene, "Behind"), "location", {0: (0, -5, 0), 2: (1, -5, 0)})
    hidden = glowing(scene, "Hidden")
    keyed(hidden, "location", {0: (0, 5, 0), 2: (1, 5, 0)})
    hidden.hide_render = True
    motion = sampled()
    assert motion.paths.objects == ()
    assert not motion.paths.camera.moves
    assert motion.paths.camera.times.tolist() == [0.0]


def test_moving_parent_takes_children_and_constrained_objects_along(
    scene: Any, module: Any, sampled: Any
) -> None:
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    keyed(parent, "rotation_euler", {0: (0, -0.8, 0), 2: (0, 0.8, 0)})
    parent.location = (0, 5, 0)
    child = glowing(scene, "Child", 0.7, 0.0)
    child.parent = parent
    held = glowing(scene, "Held", 0.2, 5.0, 0.5)
    held.constraints.new("CHILD_OF").target = parent
    curve = bpy.data.curves.new("Rail", "CURVE")
    spline = curve.splines.new("POLY")
    spline.points.add(2)
    for point, place in zip(spline.points, [(-1, 6, 0, 1), (0, 6, 0.5, 1), (1, 6, 0, 1)], strict=True):
        point.co = place
    rail = bpy.data.objects.new("Rail", curve)
    rail.hide_render = True
    scene.collection.objects.link(rail)
    rider = glowing(scene, "Rider", 0.0, 0.0)
    follow = rider.constraints.new("FOLLOW_PATH")
    follow.target = rail
    follow.use_fixed_location = True
    follow.offset_factor = 0.2
    follow.keyframe_insert("offset_factor", frame=0)
    follow.offset_factor = 0.7
    follow.keyframe_insert("offset_factor", frame=2)
    scene.frame_set(1)
    motion = sampled()
    assert sorted(names_of(motion)) == ["Child", "Held", "Rider"]
    for name in ("Child", "Held", "Rider"):
        path = path_of(motion, name)
        assert path.times.size > 3
        assert farthest_from_truth(scene, module, motion, path, shown=lambda n=name: matrix_now(n)) < 0.1


def test_driven_motion_between_the_frames_is_found(scene: Any, module: Any, sampled: Any) -> None:
    item = glowing(scene)
    # Where it was at every whole frame.
    driver = item.driver_add("location", 0).driver
    driver.expression = "0.5 * sin(2 * pi * frame)"
    scene.frame_set(1)
    motion = sampled()
    path = path_of(motion, "Card")
    assert farthest_from_truth(scene, module, motion, path, shown=lambda: matrix_now("Card")) < 0.1


def test_a_jump_is_held_to_a_sixty_fourth_of_a_frame(scene: Any, sampled: Any) -> None:
    keyed(glowing(scene), "location", {-9: (0, 5, 0), 1.5: (1, 5, 0)}, "CONSTANT")
    path = path_of(sampled(), "Card")
    assert path.at(0.5 - 1 / 64)[0, 3] == pytest.approx(0.0, abs=1e-6)
    assert path.at(0.5)[0, 3] == pytest.approx(1.0, abs=1e-6)


def test_collection_instances_are_objects_of_their_own(scene: Any, module: Any, sampled: Any) -> None:
    source = glowing(scene, "Source", 0.0, 0.0)
    scene.collection.objects.unlink(source)
    source.pass_index = 4
    collection = bpy.data.collections.new("Group")
    collection.objects.link(source)
    for name in ("Moving", "Still"):
        empty = bpy.data.objects.new(name, None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location = (0.5, 5, 0)
        scene.collection.objects.link(empty)
    keyed(bpy.data.objects["Moving"], "location", {0: (-1, 5, 0), 2: (0, 6, 0)})
    motion = sampled()
    assert names_of(motion) == ["Moving/Source"]
    path = path_of(motion, "Moving/Source")
    assert path.object_index == 4
    assert motion.moving == {"Moving"}
    assert motion.still == {"Still"}
    shown = lambda: matrix_now("Source", "Moving")  # noqa: E731
    assert farthest_from_truth(scene, module, motion, path, shown=shown) < 0.1


def nodes_host(scene: Any, instanced: Any = None) -> Any:
    """Add points that carry cubes, or another object, which a node tree raises with the frame."""
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata([(-0.6, 5, 0), (0.6, 5, 0)], [], [])
    host = bpy.data.objects.new("Host", mesh)
    scene.collection.objects.link(host)
    tree = bpy.data.node_groups.new("Raise", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    kinds = (
        "NodeGroupInput",
        "NodeGroupOutput",
        "GeometryNodeInstanceOnPoints",
        "GeometryNodeTranslateInstances",
        "GeometryNodeInputSceneTime",
        "ShaderNodeCombineXYZ",
        "ShaderNodeMath",
        "GeometryNodeMeshCube" if instanced is None else "GeometryNodeObjectInfo",
    )
    entry, leave, on_points, translate, clock, vector, scale, thing = (tree.nodes.new(kind) for kind in kinds)
    if instanced is None:
        thing.inputs["Size"].default_value = (0.4, 0.4, 0.4)
    else:
        thing.inputs["Object"].default_value = instanced
        thing.inputs["As Instance"].default_value = True
    scale.operation = "MULTIPLY"
    scale.inputs[1].default_value = 0.3
    geometry = thing.outputs["Mesh" if instanced is None else "Geometry"]
    for source, sink in (
        (entry.outputs[0], on_points.inputs["Points"]),
        (geometry, on_points.inputs["Instance"]),
        (on_points.outputs[0], translate.inputs["Instances"]),
        (clock.outputs["Frame"], scale.inputs[0]),
        (scale.outputs[0], vector.inputs["Z"]),
        (vector.outputs[0], translate.inputs["Translation"]),
        (translate.outputs[0], leave.inputs[0]),
    ):
        tree.links.new(source, sink)
    host.modifiers.new("Raise", "NODES").node_group = tree
    scene.frame_set(1)
    return host


def test_geometry_nodes_instances_move(scene: Any, sampled: Any) -> None:
    nodes_host(scene)
    motion = sampled()
    assert names_of(motion) == ["Host/Host"] * 2
    for path in motion.paths.objects:
        assert not path.deforming
        np.testing.assert_allclose(path.at(1.0) - path.at(0.0), _shift(0, 0, 0.3), atol=1e-5)
    assert motion.moving == {"Host"}


def _shift(x: float, y: float, z: float) -> Any:
    matrix = np.zeros((4, 4))
    matrix[:3, 3] = x, y, z
    return matrix


def test_objects_that_nodes_instance_go_with_their_instancer(scene: Any, sampled: Any) -> None:
    source = glowing(scene, "Source", 0.0, 0.0)
    nodes_host(scene, source)
    motion = sampled()
    assert names_of(motion) == ["Host/Source"] * 2
    # The source lies at the origin, out of view and at rest, but cannot be hidden by itself.
    assert motion.moving == {"Host", "Source"}


def test_particles_that_are_objects_move(scene: Any, sampled: Any) -> None:
    drop = glowing(scene, "Drop", 0.0, -20.0)
    source = card(scene, "Source", (0, 5, 1), 1.0, emitter("Source", (1, 1, 1)))
    source.modifiers.new("Rain", "PARTICLE_SYSTEM")
    settings = source.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 8, 1, 1, 50
    settings.render_type, settings.instance_object, settings.particle_size = "OBJECT", drop, 0.1
    settings.normal_factor = 0.0
    for frame in range(1, 6):
        scene.frame_set(frame)
    motion = sampled()
    drops = [path for path in motion.paths.objects if path.name == "Source/Drop"]
    assert len(drops) == 8
    for path in drops:
        fall = path.at(1.0)[2, 3] - path.at(0.0)[2, 3]
        assert -0.1 < fall < -0.01


def falling(scene: Any) -> Any:
    """Add a card that falls as a rigid body, played up to frame 12."""
    item = glowing(scene, "Falling", 0.0, 8.0, 1.0)
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    bpy.ops.rigidbody.object_add()
    item.rigid_body.collision_shape = "BOX"
    for frame in range(1, 13):
        scene.frame_set(frame)
    return item


def test_rigid_body_falls_as_the_simulation_has_it(scene: Any, module: Any, sampled: Any) -> None:
    falling(scene)
    motion = sampled()
    path = path_of(motion, "Falling")
    assert path.at(1.0)[2, 3] < path.at(0.0)[2, 3] < path.at(-1.0)[2, 3]
    assert farthest_from_truth(scene, module, motion, path, shown=lambda: matrix_now("Falling")) < 0.1


def test_export_leaves_simulations_alone(scene: Any, exported: Any) -> None:
    item = falling(scene)
    glowing(scene, "Wall", 0.0, 12.0)
    before = matrix_now("Falling")
    samples = exported()
    assert samples.layers[0].stationary is not None
    assert not scene.rigidbody_world.point_cache.is_outdated
    np.testing.assert_array_equal(matrix_now("Falling"), before)
    scene.frame_set(11)
    scene.frame_set(12)
    np.testing.assert_array_equal(matrix_now("Falling"), before)
    assert item.visible_camera


def test_linked_objects_move_and_keep_their_index(
    scene: Any, module: Any, exported: Any, tmp_path: Path
) -> None:
    item = glowing(scene, "Linked")
    item.pass_index = 12
    keyed(item, "location", {0: (-0.3, 5, 0), 2: (0.3, 5, 0)})
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {item})
    bpy.data.objects.remove(item)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Linked"]
    linked = bpy.data.objects["Linked"]
    assert linked.library is not None
    scene.collection.objects.link(linked)
    scene.frame_set(1)
    samples = exported()
    (path,) = samples.paths.objects
    assert path.object_index == 12
    np.testing.assert_allclose(path.at(1.0)[0, 3], 0.3, atol=1e-6)
    layer = samples.layers[0]
    assert set(np.unique(layer.stationary.object_index)) == {0}
    np.testing.assert_array_equal(layer.moving.object_index == 12, layer.object_index == 12)
    assert linked.visible_camera


def test_shape_keys_deform(scene: Any, sampled: Any) -> None:
    for name, value in (("Swelling", 1.0), ("Ready", 0.0)):
        item = glowing(scene, name)
        item.shape_key_add(name="Basis")
        key = item.shape_key_add(name="Big")
        for point in key.data:
            point.co *= 1.5
        key.value = 0.0
        key.keyframe_insert("value", frame=0)
        key.value = value
        key.keyframe_insert("value", frame=2)
    scene.frame_set(1)
    motion = sampled()
    path = path_of(motion, "Swelling")
    assert path.deforming
    assert path.times.tolist() == [0.0]
    assert names_of(motion) == ["Swelling"]
    assert motion.moving == {"Swelling"}


def test_armatures_deform(scene: Any, sampled: Any) -> None:
    armature = bpy.data.objects.new("Armature", bpy.data.armatures.new("Armature"))
    armature.location = (0, 5, 0)
    scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    pose = armature.pose.bones["Bone"]
    pose.rotation_mode = "XYZ"
    keyed(pose, "rotation_euler", {0: (0, 0, 0), 2: (0, 0.5, 0)})
    for name in ("Skin", "Moving Skin"):
        skin = glowing(scene, name)
        skin.vertex_groups.new(name="Bone").add([2, 3], 1.0, "REPLACE")
        modifier = skin.modifiers.new("Armature", "ARMATURE")
        modifier.object = armature
        # What only the render shows counts too.
        modifier.show_viewport = False
    keyed(bpy.data.objects["Moving Skin"], "location", {0: (0, 5, 0), 2: (0.5, 5, 0)})
    rigid = glowing(scene, "Rigid")
    rigid.modifiers.new("Thick", "SOLIDIFY")
    motion = sampled()
    assert sorted(names_of(motion)) == ["Moving Skin", "Skin"]
    assert all(path.deforming for path in motion.paths.objects)
    assert path_of(motion, "Moving Skin").times.size == 3
    assert path_of(motion, "Skin").times.size == 1
    assert not skin.modifiers[0].show_viewport


def test_camera_moves_turns_and_zooms(scene: Any, module: Any, sampled: Any) -> None:
    glowing(scene, "Still", 0.5)
    keyed(scene.camera, "rotation_euler", {0: (1.5, 0, -0.1), 2: (1.6, 0.05, 0.1)})
    keyed(scene.camera, "location", {0: (-0.2, 0, 0), 2: (0.2, 0.4, 0)}, "BEZIER")
    data = scene.camera.data
    keyed(data, "lens", {0: 40.0, 2: 60.0})
    keyed(data, "shift_x", {0: 0.0, 2: 0.2})
    motion = sampled()
    assert motion.paths.objects == ()
    assert motion.paths.camera.moves
    adapter = module("operators.scene")
    points = np.random.default_rng(1).uniform((-1, 4, -0.6), (1, 40, 0.6), (50, 3))
    for time in np.linspace(-1.0, 1.0, 65):
        at = 1.0 + float(time)
        scene.frame_set(math.floor(at), subframe=at - math.floor(at))
        graph = bpy.context.evaluated_depsgraph_get()
        truth = adapter.scene_camera(scene, adapter.evaluated_camera(scene, graph)).matrix
        ours = motion.paths.camera.at(float(time))
        assert np.abs(pixels(truth, points) - pixels(ours, points)).max() < 0.1


def test_an_object_that_follows_the_camera_stays_in_the_picture(
    scene: Any, module: Any, sampled: Any
) -> None:
    keyed(scene.camera, "rotation_euler", {0: (1.57, 0, -0.3), 2: (1.57, 0, 0.3)})
    held = card(scene, "Held", (0, 0, -3), 1.0, emitter("Held", (1, 1, 1)))
    held.rotation_euler.x = -math.pi / 2
    held.parent = scene.camera
    scene.frame_set(1)
    motion = sampled()
    path = path_of(motion, "Held")
    assert farthest_from_truth(scene, module, motion, path, shown=lambda: matrix_now("Held")) < 0.1


def test_markers_do_not_change_the_camera_within_a_frame(scene: Any, sampled: Any) -> None:
    other = scene.camera.copy()
    other.location.x = 3.0
    scene.collection.objects.link(other)
    for frame, camera in ((0, scene.camera), (2, other)):
        scene.timeline_markers.new("Cut", frame=frame).camera = camera
    scene.frame_set(1)
    first = scene.camera
    motion = sampled()
    assert not motion.paths.camera.moves
    assert scene.camera == first != other


def test_what_only_the_render_shows_counts(scene: Any, sampled: Any) -> None:
    hidden = [glowing(scene, name) for name in ("Eye", "Monitor", "Collection")]
    collection = bpy.data.collections.new("Off")
    scene.collection.children.link(collection)
    scene.collection.objects.unlink(hidden[2])
    collection.objects.link(hidden[2])
    for item in hidden:
        keyed(item, "location", {0: (0, 5, 0), 2: (0.3, 5, 0)})
    hidden[0].hide_set(True)
    hidden[1].hide_viewport = True
    collection.hide_viewport = True
    assert sorted(names_of(sampled())) == ["Collection", "Eye", "Monitor"]
    assert hidden[0].hide_get()
    assert hidden[1].hide_viewport
    assert collection.hide_viewport


def test_flat_scale_can_be_inverted(scene: Any, module: Any, sampled: Any) -> None:
    item = glowing(scene)
    keyed(item, "location", {0: (0, 5, 0), 2: (0.3, 5, 0)})
    item.scale.y = 0.0
    paths = sampled().paths
    again = module("potmesil_addon.paths").MotionPaths.from_json(paths.to_json())
    moved = again.reprojection(again.objects[0], 1.0)
    x, y, s = moved @ [48.0, 32.0, 1.0, 1.0 / 5.0]
    assert (x / s, y / s) == (pytest.approx(48.0 + 0.15 * SCALE, abs=1e-3), pytest.approx(32.0, abs=1e-3))


def test_frames_between_frames_can_be_rendered(scene: Any, sampled: Any) -> None:
    keyed(glowing(scene), "location", {0: (0, 5, 0), 4: (1, 5, 0)})
    scene.frame_set(1, subframe=0.25)
    path = path_of(sampled(), "Card")
    assert path.at(0.0)[0, 3] == pytest.approx(0.3125, abs=1e-5)
    assert path.at(1.0)[0, 3] == pytest.approx(0.5625, abs=1e-5)
    assert (scene.frame_current, scene.frame_subframe) == (1, 0.25)


def test_a_long_shutter_is_covered(scene: Any, sampled: Any) -> None:
    keyed(glowing(scene), "location", {-9: (-1, 5, 0), 11: (1, 5, 0)})
    scene.render.motion_blur_shutter = 3.0
    scene.render.motion_blur_position = "START"
    assert path_of(sampled(), "Card").times[[0, -1]].tolist() == [-1.0, 3.0]


# ----- the artist's scene is as it was


def unkeyed_scene(scene: Any) -> tuple[Any, Any, Any]:
    """Animate an object, a material, a custom property and by a strip, and change each without a key."""
    item = glowing(scene)
    keyed(item, "location", {0: (0, 5, 0), 2: (1, 5, 0)})
    item["strength [x].y"] = 1.0
    item.keyframe_insert('["strength [x].y"]', frame=1)
    tree = bpy.data.materials["Card"].node_tree
    glow = next(node for node in tree.nodes if node.type == "EMISSION").inputs["Color"]
    glow.keyframe_insert("default_value", frame=1)
    track = scene.camera.animation_data_create().nla_tracks.new()
    action = bpy.data.actions.new("Move")
    scene.camera.animation_data.action = action
    scene.camera.location.z = 0.5
    scene.camera.keyframe_insert("location", frame=1)
    strip = track.strips.new("Move", 1, action)
    if strip.action_slot is None:
        strip.action_slot = action.slots[0]
    scene.camera.animation_data.action = None
    scene.frame_set(1)
    item.location = (0.25, 5.5, 0.125)
    item["strength [x].y"] = 4.0
    glow.default_value = (0.1, 0.2, 0.3, 1.0)
    scene.camera.location.z = 0.25
    return item, glow, scene.camera


def assert_unkeyed(item: Any, glow: Any, camera: Any) -> None:
    assert tuple(item.location) == (0.25, 5.5, 0.125)
    assert item["strength [x].y"] == 4.0
    assert tuple(glow.default_value) == pytest.approx((0.1, 0.2, 0.3, 1.0))
    assert camera.location.z == 0.25


def test_changes_without_a_key_are_kept(scene: Any, sampled: Any, exported: Any) -> None:
    things = unkeyed_scene(scene)
    sampled()
    assert_unkeyed(*things)
    bpy.context.view_layer.update()
    assert_unkeyed(*things)
    samples = exported()
    assert_unkeyed(*things)
    bpy.context.view_layer.update()
    assert_unkeyed(*things)
    # As every render, this one shows what is keyed, and its camera is the one that it says.
    assert samples.paths.objects[0].at(0.0)[0, 3] == pytest.approx(0.5, abs=1e-5)
    np.testing.assert_allclose(
        samples.camera.matrix / 5.0, samples.paths.camera.at(0.0)[:3] / 5.0, rtol=1e-4, atol=1e-3
    )


@pytest.mark.parametrize("how", ["error", "cancel"])
def test_frame_and_changes_are_back_after_an_error_or_a_cancel(
    scene: Any, module: Any, sampled: Any, monkeypatch: Any, how: str
) -> None:
    things = unkeyed_scene(scene)
    things[0].hide_viewport = True
    scene.frame_set(4, subframe=0.5)
    things[0].location = (0.25, 5.5, 0.125)
    motion = module("operators.motion")
    if how == "cancel":
        steps = motion.sample_motion(scene)
        for _ in range(4):
            next(steps)
        assert scene.frame_current + scene.frame_subframe != 4.5
        steps.close()
    else:
        monkeypatch.setattr(motion._Sampler, "off", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            sampled()
    assert (scene.frame_current, scene.frame_subframe) == (4, 0.5)
    assert tuple(things[0].location) == (0.25, 5.5, 0.125)
    assert things[0].hide_viewport


# ----- the shutter


def test_shutter_is_the_render_settings(scene: Any, exported: Any) -> None:
    scene.render.motion_blur_position = "END"
    keyed(scene.render, "motion_blur_shutter", {1: 0.25, 3: 1.25})
    scene.frame_set(2)
    said = exported().shutter
    assert (said.frames, said.position) == (pytest.approx(0.75), "end")
    assert said.exposure_time == pytest.approx(0.75 / 24.0)
    assert said.frames_per_second == pytest.approx(24.0)
    assert (said.curve, said.slit) == (None, None)


def test_shutter_curve_is_a_polyline(scene: Any, exported: Any) -> None:
    mapping = scene.render.motion_blur_shutter_curve
    points = mapping.curves[0].points
    points[0].location, points[1].location, points[2].location = (0.0, 0.0), (0.25, 1.0), (1.0, 0.0)
    for point in points:
        point.handle_type = "VECTOR"
    mapping.update()
    curve = exported().shutter.curve
    np.testing.assert_allclose(curve, [(0.0, 0.0), (0.25, 1.0), (1.0, 0.0)], atol=1e-5)
    for point in points:
        point.handle_type = "AUTO"
    mapping.update()
    curve = np.array(exported().shutter.curve)
    assert 8 < len(curve) < 100
    x = np.linspace(0.0, 1.0, 997)
    truth = np.clip([mapping.evaluate(mapping.curves[0], t) for t in x], 0.0, 1.0)
    np.testing.assert_allclose(np.interp(x, *curve.T), truth, atol=4e-3)


def test_rolling_shutter_is_a_slit_from_the_top(scene: Any, exported: Any) -> None:
    scene.cycles.rolling_shutter_type = "TOP"
    scene.cycles.rolling_shutter_duration = 0.3
    slit = exported().shutter.slit
    assert (slit.edge, slit.width) == ("top", pytest.approx(0.3))


# ----- what moving objects hide


def passing(scene: Any) -> Any:
    """Add a card that moves in front of a wall."""
    moving = glowing(scene, "Moving", 0.0, 4.0)
    moving.pass_index = 3
    keyed(moving, "location", {0: (-0.3, 4, 0), 2: (0.3, 4, 0)})
    wall = card(scene, "Wall", (0.0, 8.0, 0.0), 30.0, emitter("Wall", (0.0, 0.25, 1.0)))
    wall.pass_index = 5
    scene.frame_set(1)
    return moving


def test_companions_show_what_moving_objects_hide(scene: Any, exported: Any) -> None:
    passing(scene)
    layer = exported().layers[0]
    front = layer.object_index == 3
    assert 100 < front.sum() < 2000
    inside = np.zeros_like(front)
    inside[2:-2, 2:-2] = front[4:, 4:] & front[4:, :-4] & front[:-4, 4:] & front[:-4, :-4]
    still, moving = layer.stationary, layer.moving
    np.testing.assert_allclose(still.color, np.broadcast_to([0, 0.25, 1, 1], still.color.shape), atol=1e-5)
    np.testing.assert_allclose(still.depth, 8.0, rtol=1e-5)
    np.testing.assert_array_equal(still.object_index, 5)
    np.testing.assert_allclose(still.vector, 0.0, atol=1e-4)
    np.testing.assert_array_equal(moving.object_index == 3, front)
    np.testing.assert_allclose(moving.depth[inside], 4.0, rtol=1e-5)
    assert np.isinf(moving.depth[~front]).all()
    assert (moving.color[moving.object_index == 0].max(axis=0) < 1.0).all()
    assert (moving.color[:10] == 0.0).all()
    np.testing.assert_allclose(moving.color[inside][:, 3], 1.0, atol=1e-5)
    np.testing.assert_allclose(moving.vector[inside], layer.vector[inside], atol=1e-3)
    assert np.abs(moving.vector[inside][:, 2]).min() > 5.0


def test_what_stands_in_front_does_not_hide_what_moves(scene: Any, exported: Any) -> None:
    keyed(glowing(scene, "Moving", 0.0, 6.0), "location", {0: (-0.3, 6, 0), 2: (0.3, 6, 0)})
    bpy.data.objects["Moving"].pass_index = 3
    card(scene, "Fence", (0.3, 4.0, 0.0), 0.6, emitter("Fence", (1.0, 1.0, 1.0))).pass_index = 9
    layer = exported().layers[0]
    assert (layer.moving.object_index == 3).sum() > (layer.object_index == 3).sum() + 50
    assert (layer.stationary.object_index == 9).any()
    assert not (layer.moving.object_index == 9).any()


@pytest.mark.parametrize("why", ["nothing moves", "only the camera", "not allowed"])
def test_no_companions_without_need(scene: Any, exported: Any, why: str) -> None:
    passing(scene)
    if why == "not allowed":
        scene.potmesil_camera.use_hidden_surfaces = False
    else:
        bpy.data.objects["Moving"].animation_data_clear()
    if why == "only the camera":
        keyed(scene.camera, "location", {0: (0, 0, 0), 2: (0.3, 0, 0)})
    renders = []
    bpy.app.handlers.render_init.append(lambda *_: renders.append(1))
    try:
        samples = exported()
    finally:
        bpy.app.handlers.render_init.pop()
    assert len(renders) == 1
    assert samples.layers[0].stationary is None
    assert samples.paths.camera.moves == (why == "only the camera")
    assert bool(samples.paths.objects) == (why == "not allowed")


@pytest.mark.parametrize("kind", ["collection", "nodes", "nodes of objects"])
def test_instances_are_hidden_with_their_instancer(scene: Any, exported: Any, kind: str) -> None:
    card(scene, "Wall", (0.0, 8.0, 0.0), 30.0, emitter("Wall", (0.0, 0.25, 1.0))).pass_index = 5
    index = 4
    if kind == "nodes":
        nodes_host(scene).pass_index = index
    else:
        source = glowing(scene, "Source", 0.0, 0.0)
        source.pass_index = index
        if kind == "nodes of objects":
            # Seen itself too, at rest.
            source.scale = (0.3, 0.3, 0.3)
            source.location = (0.0, 5.0, -0.6)
            nodes_host(scene, source)
        else:
            scene.collection.objects.unlink(source)
            group = bpy.data.collections.new("Group")
            group.objects.link(source)
            empty = bpy.data.objects.new("Moving", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", group
            scene.collection.objects.link(empty)
            keyed(empty, "location", {0: (-0.3, 5, 0), 2: (0.3, 5, 0)})
    layer = exported().layers[0]
    assert (layer.object_index == index).sum() > 50
    assert (layer.stationary.object_index == 5).all()
    np.testing.assert_array_equal(layer.moving.object_index == index, layer.object_index == index)
    assert not (layer.moving.object_index == 5).any()
    assert all(item.visible_camera for item in bpy.data.objects)


def test_companions_are_right_with_kept_render_data_and_point_samples(scene: Any, exported: Any) -> None:
    passing(scene)
    scene.render.use_persistent_data = True
    scene.potmesil_camera.sampling = "POINTS"
    scene.potmesil_camera.use_lens = False
    for _ in range(2):
        samples = exported()
        layer = samples.layers[0]
        assert layer.moving.depth.shape == (128, 192)
        assert set(np.unique(layer.object_index)) == {3, 5}
        assert set(np.unique(layer.stationary.object_index)) == {5}
        assert set(np.unique(layer.moving.object_index)) == {0, 3}
    assert scene.render.use_persistent_data
    # Paths are in the pixels of the samples.
    np.testing.assert_allclose(
        pixels(samples.paths.camera.at(0.0), np.array([[0.0, 5.0, 0.0]])), [[96.0, 64.0]], atol=1e-3
    )


def test_every_setting_is_given_back(scene: Any, exported: Any, module: Any, monkeypatch: Any) -> None:
    moving = passing(scene)
    glowing(scene, "Unseen", 0.3, 3.0).visible_camera = False
    moving.visible_camera = True
    assert moving.keyframe_insert("visible_camera", frame=1)
    # Blender fills in a default color space the first time that a format is chosen.
    scene.render.image_settings.file_format = "JPEG"

    def settings() -> Any:
        return (
            dump(scene.render),
            dump(scene.cycles),
            scene.frame_current,
            scene.frame_subframe,
            {item.name: (item.visible_camera, item.hide_viewport, item.hide_get()) for item in scene.objects},
            [curve.mute for item in scene.objects for curve in _curves(item)],
            {image.name for image in bpy.data.images} - {"Render Result"},
        )

    before = settings()
    layer = exported().layers[0]
    assert (layer.stationary.object_index == 5).all()
    assert settings() == before
    export = module("operators.export")
    monkeypatch.setattr(export, "save_render", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        exported()
    assert settings() == before


def _curves(item: Any) -> list[Any]:
    animation = item.animation_data
    if animation is None or animation.action is None:
        return []
    return [
        curve
        for layer in animation.action.layers
        for strip in layer.strips
        for curve in strip.channelbag(animation.action_slot).fcurves
    ]


def test_samples_file_with_companions_opens_in_blender(scene: Any, exported: Any, tmp_path: Path) -> None:
    passing(scene)
    exported()
    image = bpy.data.images.load(str(tmp_path / "exported.exr"))
    scene.render.engine = "BLENDER_WORKBENCH"
    # A multilayer image tells what it holds when something asks for its size.
    assert image.source == "FILE"
    assert tuple(image.size) in ((96, 64), (0, 0))
    file = OpenEXR.File(str(tmp_path / "exported.exr"), separate_channels=True)
    names = {name for part in file.parts for name in part.channels}
    for suffix in ("", " (stationary)", " (moving)"):
        assert f"ViewLayer{suffix}.Combined.R" in names
        assert f"ViewLayer{suffix}.Vector.W" in names


# ----- the vector pass


@pytest.mark.parametrize(("x", "z"), [(1.0, 0.0), (0.0, 1.0)])
def test_signs_of_the_vector_pass(scene: Any, exported: Any, x: float, z: float) -> None:
    """Previous position = (x + X, y - Y), next position = (x - Z, y + W), in pixels with y down."""
    item = glowing(scene)
    item.pass_index = 1
    keyed(item, "location", {0: (-0.3 * x, 5, -0.3 * z), 1: (0, 5, 0), 2: (0.6 * x, 5, 0.6 * z)})
    samples = exported()
    layer = samples.layers[0]
    vector = layer.vector[32, 48]
    before = np.array([-0.3 * x * SCALE, 0.3 * z * SCALE])
    after = np.array([0.6 * x * SCALE, -0.6 * z * SCALE])
    np.testing.assert_allclose(vector[:2] * [1, -1], before, atol=1e-3)
    np.testing.assert_allclose(vector[2:] * [-1, 1], after, atol=1e-3)
    # So say the paths.
    (path,) = samples.paths.objects
    for time, shift in ((-1.0, before), (1.0, after)):
        px, py, s = samples.paths.reprojection(path, time) @ [48.0, 32.0, 1.0, 0.2]
        np.testing.assert_allclose([px / s - 48.0, py / s - 32.0], shift, atol=1e-3)


def test_vectors_of_the_background_follow_the_camera(scene: Any, exported: Any) -> None:
    glowing(scene)
    keyed(scene.camera, "rotation_euler", {0: (math.pi / 2, 0, 0.02), 2: (math.pi / 2, 0, -0.02)})
    scene.camera.data.shift_x = 0.1
    vector = exported().layers[0].vector
    expected = pytest.approx(0.02 * 5 * SCALE, rel=0.15)
    # The camera turns right, so that all goes left.
    assert (vector[32, 40, 0], vector[32, 40, 2]) == (expected, expected)
    # Where there is no surface, Blender tells it from 5.2 on.
    expected = 0.0 if bpy.app.version < (5, 2) else expected
    assert (vector[3, 3, 0], vector[3, 3, 2]) == (expected, expected)


def test_times_stay_apart_in_the_file(scene: Any, module: Any, sampled: Any) -> None:
    keyed(glowing(scene), "location", {0: (0, 5, 0), 4: (1, 5, 0)}, "BEZIER")
    scene.render.motion_blur_shutter = 0.6
    scene.frame_set(1, subframe=0.3)
    paths = sampled().paths
    again = module("potmesil_addon.paths").MotionPaths.from_json(paths.to_json())
    assert again.objects[0].times.size == paths.objects[0].times.size
    assert again.objects[0].at(0.0) == pytest.approx(paths.objects[0].at(0.0), abs=1e-8)
