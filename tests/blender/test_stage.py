"""The compositor stage on real trees: what the compositor sees, and that nothing is left changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .scenes import card, dump

OpenEXR = pytest.importorskip("OpenEXR")

FIVE = bpy.app.version >= (5, 0, 0)


def tree_of(scene: Any) -> Any:
    return scene.compositing_node_group if FIVE else scene.node_tree


def make_tree(scene: Any) -> tuple[Any, Any, Any]:
    """Return an empty tree's output node, its Render Layers node, and itself."""
    if FIVE:
        tree = bpy.data.node_groups.new("Comp", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    layers = tree.nodes.new("CompositorNodeRLayers")
    layers.location = (-300.0, 120.0)
    return tree, layers, output


def file_output(tree: Any, folder: Path, name: str) -> Any:
    """Add a File Output node that writes a float EXR; return its input."""
    node = tree.nodes.new("CompositorNodeOutputFile")
    if FIVE:
        node.format.media_type = "IMAGE"
    node.format.file_format = "OPEN_EXR"
    node.format.color_depth = "32"
    if FIVE:
        node.directory = str(folder)
        node.file_name = ""
        node.file_output_items.new("FLOAT" if name != "Image" else "RGBA", name)
        return node.inputs[0]
    node.base_path = str(folder)
    node.file_slots[0].path = name
    return node.inputs[0]


def written(folder: Path, name: str) -> Any:
    """Return the only picture that a node wrote under a name."""
    (path,) = folder.glob(f"*{name}*.exr")
    return pixels(path)


def pixels(path: Path) -> Any:
    channels = OpenEXR.File(str(path)).channels()
    (key,) = [key for key in channels if key in ("RGBA", "RGB", "V", "Y")] or list(channels)[:1]
    return np.asarray(channels[key].pixels, dtype=np.float32)


def links(tree: Any) -> set[tuple[Any, ...]]:
    def end(socket: Any, node: Any) -> tuple[Any, ...]:
        return node.name, socket.identifier

    return {
        (*end(link.from_socket, link.from_node), *end(link.to_socket, link.to_node), link.is_muted)
        for link in tree.links
    }


def plain(value: Any) -> Any:
    """Return a value that outlives the data that it was read from."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value if isinstance(value, str | int | float | bool | None) else repr(value)


def value_of(socket: Any) -> Any:
    return socket.default_value if socket.type in ("VALUE", "INT", "BOOLEAN") else None


def node_values(node: Any) -> dict[str, Any]:
    values = {key: plain(value) for key, value in dump(node, 1).items() if key not in ("inputs", "outputs")}
    for side in ("inputs", "outputs"):
        # Of passes that were on for a while, Blender keeps sockets that are not there for anyone.
        values[side] = [
            (socket.identifier, socket.hide, value_of(socket))
            for socket in getattr(node, side)
            if socket.enabled
        ]
    values["custom"] = sorted(node.keys())
    return values


def whole(scene: Any) -> dict[str, Any]:
    """Return everything about a scene's compositor that a stage could touch."""
    tree = tree_of(scene)
    return {
        "tree": tree and tree.name,
        "names": tree and tree.nodes.keys(),
        "nodes": tree
        and {(node.name, key): value for node in tree.nodes for key, value in node_values(node).items()},
        "active": tree and tree.nodes.active and tree.nodes.active.name,
        "links": tree and links(tree),
        "render": plain(dump(scene.render)),
        "use_nodes": None if FIVE else scene.use_nodes,
        "layers": [
            {name: value for name, value in dump(layer, 0).items() if name.startswith("use")}
            for layer in scene.view_layers
        ],
        "scenes": sorted(bpy.data.scenes.keys()),
        "groups": sorted(bpy.data.node_groups.keys()),
        "objects": sorted(bpy.data.objects.keys()),
        "cameras": sorted(bpy.data.cameras.keys()),
        "dof": plain(dump(scene.camera.data.dof)),
        "own": plain(dump(scene.potmesil_camera)),
        "frame": scene.frame_current,
    }


def changes(before: dict[str, Any], after: dict[str, Any]) -> dict[Any, Any]:
    """Return what differs between two dumps."""
    found: dict[Any, Any] = {}
    for key in before.keys() | after.keys():
        old, new = before.get(key), after.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            found.update({(key, inner): value for inner, value in changes(old, new).items()})
        elif old != new:
            found[key] = (old, new)
    return found


@pytest.fixture
def shot(scene: Any, tmp_path: Path) -> Any:
    """A near red card before a blue wall, far out of focus; frames are written as float EXR."""
    card(scene, "Near", (-0.5, 4.0, 0.0), 1.0, emitter("Red", (1.0, 0.0, 0.0)))
    card(scene, "Wall", (0.0, 9.0, 0.0), 30.0, emitter("Blue", (0.0, 0.0, 1.0)))
    scene.camera.data.dof.focus_distance = 9.0
    scene.camera.data.dof.aperture_fstop = 0.2
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGBA"
    scene.render.filepath = str(tmp_path / "frame_")
    scene.potmesil_camera.use_overscan = False
    scene.frame_end = 1
    return scene


def processed(module: Callable[[str], Any], layer: str | None = None) -> Any:
    """Return what the processors make of the current samples."""
    exr, core = module("potmesil_addon.exr"), module("potmesil_addon.process")
    samples = exr.read_samples(
        module("operators.export").samples_path(bpy.context.scene), None if layer is None else (layer,)
    )
    settings = module("operators.process").process_settings(bpy.context)
    return module("potmesil_addon.progress").run(core.process(samples, settings)).picture


def inverted(tree: Any, source: Any) -> Any:
    """Add what only a compositor would do: 1 minus the picture."""
    node = tree.nodes.new("CompositorNodeInvert")
    color = next(socket for socket in node.inputs if socket.type == "RGBA")
    tree.links.new(source, color)
    return node.outputs[0]


def simple(scene: Any) -> Any:
    tree, layers, output = make_tree(scene)
    tree.links.new(inverted(tree, layers.outputs["Image"]), output.inputs[0])
    return tree


def test_f12_composites_the_processed_picture(shot: Any, module: Any, tmp_path: Path) -> None:
    simple(shot)
    assert bpy.ops.potmesil.add_stage() == {"FINISHED"}
    before = whole(shot)
    bpy.ops.render.render(write_still=True)
    frame = pixels(tmp_path / "frame_.exr")
    picture = processed(module)
    assert np.ptp(picture[..., 0]) > 0.5
    soft = (picture[..., 0] > 0.1) & (picture[..., 0] < 0.9)
    assert soft.sum() > 200
    np.testing.assert_allclose(frame[..., :3], 1.0 - picture[..., :3], atol=1e-3)
    assert changes(before, whole(shot)) == {}


def test_composite_follows_the_camera_without_rendering(shot: Any, module: Any, tmp_path: Path) -> None:
    tree = simple(shot)
    bpy.ops.potmesil.add_stage()
    bpy.ops.render.render()
    target = file_output(tree, tmp_path / "out", "Image")
    tree.links.new(next(n for n in tree.nodes if n.bl_idname == "CompositorNodeGroup").outputs[0], target)
    # Were the scene rendered again, the card would be gone.
    bpy.data.objects["Near"].hide_render = True
    pictures = []
    for operator, f_stop in (("composite", 0.2), ("composite", 0.4), ("process", 0.8)):
        shot.camera.data.dof.aperture_fstop = f_stop
        before = whole(shot)
        assert getattr(bpy.ops.potmesil, operator)() == {"FINISHED"}
        assert changes(before, whole(shot)) == {}
        pictures.append(written(tmp_path / "out", "Image"))
        np.testing.assert_allclose(pictures[-1][..., :3], processed(module)[..., :3], atol=1e-3)
    assert pictures[0][..., 0].max() > 0.9
    assert np.abs(pictures[0] - pictures[1]).max() > 0.05
    assert np.abs(pictures[1] - pictures[2]).max() > 0.05


@pytest.mark.parametrize("way", ["ctrl_f12", "button"])
def test_animations_composite_every_frame(shot: Any, module: Any, tmp_path: Path, way: str) -> None:
    simple(shot)
    shot.frame_end = 3
    shot.frame_step = 2
    near, dof = bpy.data.objects["Near"], shot.camera.data.dof
    for frame, x, f_stop in ((1, -1.0, 0.2), (3, 1.0, 1.0)):
        near.location.x, dof.aperture_fstop = x, f_stop
        near.keyframe_insert("location", frame=frame)
        dof.keyframe_insert("aperture_fstop", frame=frame)
    shot.frame_set(1)
    bpy.ops.potmesil.add_stage()
    before = whole(shot)
    if way == "button":
        assert bpy.ops.potmesil.render_animation() == {"FINISHED"}
    else:
        bpy.ops.render.render(animation=True)
    assert changes(before, whole(shot)) == {}
    soft = []
    for frame in (1, 3):
        shot.frame_set(frame)
        picture = processed(module)
        seen = 1.0 - pixels(tmp_path / f"frame_{frame:04d}.exr")[..., :3]
        np.testing.assert_allclose(seen, picture[..., :3], atol=1e-3)
        soft.append(int(((seen[..., 0] > 0.1) & (seen[..., 0] < 0.9)).sum()))
    assert not (tmp_path / "frame_0002.exr").exists()
    assert soft[0] > 1.5 * soft[1]
    # The same again, wider open and without rendering.
    near.hide_render = True
    shot.potmesil_camera.use_lens = False
    bpy.ops.potmesil.composite(animation=True)
    shot.frame_set(3)
    seen = 1.0 - pixels(tmp_path / "frame_0003.exr")[..., :3]
    np.testing.assert_allclose(seen, processed(module)[..., :3], atol=1e-3)


def artists_tree(scene: Any, folder: Path) -> Any:
    """Make a tree as artists have them: frames, reroutes, nested groups, muted links, File Output."""
    scene.view_layers[0].use_pass_z = True
    scene.view_layers[0].use_pass_mist = True
    tree, layers, output = make_tree(scene)
    layers.label, layers.width, layers.use_custom_color = "Beauty", 200.0, True
    layers.color = (0.2, 0.4, 0.1)
    frame = tree.nodes.new("NodeFrame")
    layers.parent = frame
    layers.outputs["Alpha"].hide = True
    innermost = bpy.data.node_groups.new("Innermost", "CompositorNodeTree")
    outer = bpy.data.node_groups.new("Outer", "CompositorNodeTree")
    for group in (innermost, outer):
        for direction in ("INPUT", "OUTPUT"):
            group.interface.new_socket("Image", in_out=direction, socket_type="NodeSocketColor")
        start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
        if group == innermost:
            group.links.new(inverted(group, start.outputs[0]), end.inputs[0])
        else:
            inner = group.nodes.new("CompositorNodeGroup")
            inner.node_tree = innermost
            group.links.new(start.outputs[0], inner.inputs[0])
            group.links.new(inner.outputs[0], end.inputs[0])
    nested = tree.nodes.new("CompositorNodeGroup")
    nested.node_tree = outer
    reroute = tree.nodes.new("NodeReroute")
    tree.links.new(layers.outputs["Image"], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], nested.inputs[0])
    tree.links.new(nested.outputs[0], output.inputs[0])
    viewer = tree.nodes.new("CompositorNodeViewer")
    link = tree.links.new(layers.outputs["Image"], viewer.inputs[0])
    link.is_muted = True
    tree.links.new(layers.outputs["Depth"], file_output(tree, folder / "depth", "Depth"))
    tree.links.new(layers.outputs["Mist"], file_output(tree, folder / "mist", "Mist"))
    for node in tree.nodes:
        node.select = node == nested
    tree.nodes.active = nested
    return tree


def test_removing_restores_the_tree(shot: Any, tmp_path: Path) -> None:
    tree = artists_tree(shot, tmp_path)
    shot.render.use_compositing = False
    before = whole(shot)
    bpy.ops.potmesil.add_stage()
    changed = whole(shot)
    assert changed["links"] != before["links"]
    assert changed["nodes"] != before["nodes"]
    (group,) = [
        n for n in tree.nodes if n.bl_idname == "CompositorNodeGroup" and n.node_tree.name == "Potmesil Stage"
    ]
    layers = tree.nodes["Render Layers"]
    assert group.label == "Beauty"
    assert group.width == 200.0
    assert [socket.name for socket in group.outputs] == [s.name for s in layers.outputs if s.enabled]
    assert not any(socket.is_linked for socket in layers.outputs)
    # Once more changes nothing.
    bpy.ops.potmesil.add_stage()
    assert changes(changed, whole(shot)) == {}
    bpy.ops.potmesil.remove_stage()
    assert changes(before, whole(shot)) == {}
    assert not bpy.ops.potmesil.remove_stage.poll()


def test_artists_trees_keep_working(shot: Any, module: Any, tmp_path: Path) -> None:
    artists_tree(shot, tmp_path)
    shot.world = bpy.data.worlds.new("World")
    bpy.ops.render.render()
    rendered = {name: written(tmp_path / name.lower(), name) for name in ("Depth", "Mist")}
    bpy.ops.potmesil.add_stage()
    before = whole(shot)
    # Another frame, rendered with margins and at twice the size, must still fit.
    for sampling in ("PIXELS", "FINE"):
        shot.potmesil_camera.sampling = sampling
        shot.potmesil_camera.use_overscan = sampling == "FINE"
        before["own"] = plain(dump(shot.potmesil_camera))
        if sampling == "PIXELS":
            bpy.ops.render.render(write_still=True)
        else:
            bpy.ops.potmesil.render()
            bpy.data.images["Render Result"].save_render(str(tmp_path / "frame_.exr"), scene=shot)
        assert changes(before, whole(shot)) == {}
        frame = pixels(tmp_path / "frame_.exr")
        np.testing.assert_allclose(frame[..., :3], 1.0 - processed(module)[..., :3], atol=1e-3)
        for name, values in rendered.items():
            now = written(tmp_path / name.lower(), name)
            assert now.shape == values.shape
            # Of edges a finer sample may see the other side.
            assert (np.abs(now - values) < 1e-2 * values + 1e-4).mean() > (
                0.999 if sampling == "PIXELS" else 0.95
            )


def test_view_layers_are_processed_each_by_itself(shot: Any, module: Any, tmp_path: Path) -> None:
    layer = shot.view_layers.new("Wall Only")
    shot.view_layers[0].name = "All"
    collection = bpy.data.collections.new("Cards")
    shot.collection.children.link(collection)
    near = bpy.data.objects["Near"]
    shot.collection.objects.unlink(near)
    collection.objects.link(near)
    layer.layer_collection.children["Cards"].exclude = True
    tree, first, output = make_tree(shot)
    second = tree.nodes.new("CompositorNodeRLayers")
    first.layer, second.layer = "All", "Wall Only"
    tree.links.new(first.outputs["Image"], output.inputs[0])
    tree.links.new(second.outputs["Image"], file_output(tree, tmp_path / "second", "Image"))
    before = whole(shot)
    bpy.ops.potmesil.add_stage()
    bpy.ops.render.render(write_still=True)
    for frame, name in ((tmp_path / "frame_.exr", "All"), (None, "Wall Only")):
        seen = pixels(frame) if frame else written(tmp_path / "second", "Image")
        np.testing.assert_allclose(seen[..., :3], processed(module, name)[..., :3], atol=1e-3)
        assert (seen[..., 0].max() > 0.5) == (name == "All")
    bpy.ops.potmesil.process()
    seen = written(tmp_path / "second", "Image")
    np.testing.assert_allclose(seen[..., :3], processed(module, "Wall Only")[..., :3], atol=1e-3)
    bpy.ops.potmesil.remove_stage()
    assert changes(before, whole(shot)) == {}


def test_scenes_without_a_tree_are_given_one(shot: Any, module: Any, tmp_path: Path) -> None:
    before = whole(shot)
    bpy.ops.potmesil.add_stage()
    bpy.ops.render.render(write_still=True)
    frame = pixels(tmp_path / "frame_.exr")
    np.testing.assert_allclose(frame[..., :3], processed(module)[..., :3], atol=1e-3)
    bpy.ops.potmesil.remove_stage()
    after = whole(shot)
    if not FIVE:
        # Blender cannot take an embedded tree away again; it is empty, and off.
        assert after["nodes"] == {}
        for values in (before, after):
            for name in ("tree", "names", "nodes", "links", "active"):
                values.pop(name)
    assert changes(before, after) == {}


@pytest.mark.parametrize("crop", [False, True])
def test_render_regions_are_composited(shot: Any, module: Any, tmp_path: Path, crop: bool) -> None:
    simple(shot)
    bpy.ops.potmesil.add_stage()
    render = shot.render
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.25, 1.0
    bpy.ops.render.render(write_still=True)
    once = region_of(pixels(tmp_path / "frame_.exr"), crop)
    np.testing.assert_allclose(once[..., :3], 1.0 - region_of(processed(module), crop)[..., :3], atol=1e-3)
    bpy.ops.potmesil.render()
    bpy.data.images["Render Result"].save_render(str(tmp_path / "frame_.exr"), scene=shot)
    again = region_of(pixels(tmp_path / "frame_.exr"), crop)
    np.testing.assert_allclose(again[..., :3], 1.0 - region_of(processed(module), crop)[..., :3], atol=1e-3)
    # What lies around a region is not rendered, which shows at its border only.
    np.testing.assert_allclose(once[16:-16, 16:-16], again[16:-16, 16:-16], atol=0.05)


def region_of(picture: Any, crop: bool) -> Any:
    """Return the part of a picture that the test's region shows."""
    assert picture.shape[:2] == ((48, 48) if crop else (64, 96))
    return picture if crop else picture[:48, 24:72]


def test_what_goes_wrong_is_said_and_leaves_the_scene_alone(shot: Any, tmp_path: Path) -> None:
    tree, layers, output = make_tree(shot)
    tree.nodes.remove(layers)
    before = whole(shot)
    with pytest.raises(RuntimeError, match="no Render Layers node of this scene"):
        bpy.ops.potmesil.add_stage()
    assert changes(before, whole(shot)) == {}
    layers = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layers.outputs["Image"], output.inputs[0])
    bpy.ops.potmesil.add_stage()
    before = whole(shot)
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.potmesil.composite()
    assert changes(before, whole(shot)) == {}
    (tmp_path / "file").write_text("no folder")
    shot.potmesil_camera.samples_path = str(tmp_path / "file" / "####.exr")
    before = whole(shot)
    state = bpy.context.window_manager.potmesil_camera
    bpy.ops.render.render()
    assert "Cannot write" in state.error
    assert changes(before, whole(shot)) == {}
    shot.camera.data.type = "PANO"
    before = whole(shot)
    bpy.ops.render.render()
    assert "perspective" in state.error
    assert changes(before, whole(shot)) == {}
    shot.camera.data.type = "PERSP"
    shot.potmesil_camera.samples_path = str(tmp_path / "####.exr")
    bpy.ops.render.render()
    assert state.error == ""
    extra = tree.nodes.new("CompositorNodeRLayers")
    with pytest.raises(RuntimeError, match="press Add Stage"):
        bpy.ops.potmesil.composite()
    bpy.ops.potmesil.add_stage()
    assert "potmesil_stage" in extra
    bpy.ops.potmesil.remove_stage()
    assert not any(node.keys() for node in tree.nodes)


def test_bugs_are_said_and_leave_the_scene_alone(shot: Any, module: Any, monkeypatch: Any) -> None:
    simple(shot)
    bpy.ops.potmesil.add_stage()
    before = whole(shot)
    state = bpy.context.window_manager.potmesil_camera
    for name, what in (
        ("operators.stage_engine", "annotate_render"),
        ("operators.stage_engine", "sample_motion"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(module(name), what, lambda *_: 1 / 0)
            bpy.ops.render.render()
        assert "ZeroDivisionError" in state.error
        assert changes(before, whole(shot)) == {}
    bpy.ops.render.render()
    assert state.error == ""
    with monkeypatch.context() as patch:
        patch.setattr(module("operators.stage_engine"), "known_picture", lambda *_: 1 / 0)
        with pytest.raises(RuntimeError, match="ZeroDivisionError"):
            bpy.ops.potmesil.composite()
    assert changes(before, whole(shot)) == {}


def test_a_stage_that_was_taken_apart_is_mended(shot: Any) -> None:
    tree = simple(shot)
    before = whole(shot)
    for part in ("Processed", "Potmesil Stage"):
        bpy.ops.potmesil.add_stage()
        tree.nodes["Render Layers"].mute = True
        bpy.ops.potmesil.remove_stage()
        assert changes(before, whole(shot)) == {}
        bpy.ops.potmesil.add_stage()
        tree.nodes.remove(next(node for node in tree.nodes if node.label == part))
        bpy.ops.potmesil.add_stage()
        assert len([node for node in tree.nodes if "potmesil_stage" in node]) == 3
        bpy.ops.potmesil.remove_stage()
        if part == "Processed":
            assert changes(before, whole(shot)) == {}


@pytest.mark.skipif(not FIVE, reason="trees cannot be shared")
def test_shared_trees_are_refused(shot: Any) -> None:
    simple(shot)
    other = bpy.data.scenes.new("Other")
    other.compositing_node_group = shot.compositing_node_group
    before = whole(shot)
    with pytest.raises(RuntimeError, match="shared with the scene 'Other'"):
        bpy.ops.potmesil.add_stage()
    assert changes(before, whole(shot)) == {}


def test_a_stage_is_one_step_of_undo(shot: Any) -> None:
    simple(shot)
    bpy.ops.ed.undo_push(message="tree")
    before = whole(bpy.context.scene)
    bpy.ops.potmesil.add_stage()
    bpy.ops.ed.undo_push(message="stage")
    staged = whole(bpy.context.scene)
    bpy.ops.ed.undo()
    assert changes(before, whole(bpy.context.scene)) == {}
    bpy.ops.ed.redo()
    assert changes(staged, whole(bpy.context.scene)) == {}
    bpy.ops.potmesil.remove_stage()
    assert changes(before, whole(bpy.context.scene)) == {}


@pytest.mark.parametrize("way", ["open", "append"])
def test_saved_and_appended_scenes_keep_their_stage(shot: Any, module: Any, tmp_path: Path, way: str) -> None:
    shot.name = "Staged"
    artists_tree(shot, tmp_path)
    before = whole(shot)
    bpy.ops.potmesil.add_stage()
    blend = str(tmp_path / "staged.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    if way == "open":
        bpy.ops.wm.open_mainfile(filepath=blend)
    else:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.ops.wm.append(directory=f"{blend}/Scene", filename="Staged")
        bpy.context.window.scene = bpy.data.scenes["Staged"]
    scene = bpy.context.scene
    bpy.ops.render.render(write_still=True)
    frame = pixels(tmp_path / "frame_.exr")
    np.testing.assert_allclose(frame[..., :3], 1.0 - processed(module)[..., :3], atol=1e-3)
    bpy.ops.potmesil.remove_stage()
    after = whole(scene)
    for name in ("nodes", "links", "render", "layers", "own"):
        assert changes({name: before[name]}, {name: after[name]}) == {}
