"""Views of what near things hide: which objects are left out, and what the samples file says of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .scenes import card, dump
from .test_motion_export import keyed

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@pytest.fixture
def exported(scene: Any, module: Any, tmp_path: Path) -> Callable[[], Any]:
    """Export the scene's samples, and read them."""
    path = tmp_path / "exported.exr"

    def export() -> Any:
        module("operators.export").render_samples(bpy.context, path)
        return module("potmesil_addon.exr").read_samples(path)

    return export


@pytest.fixture
def views(scene: Any, module: Any) -> Callable[[], list[set[str]]]:
    """Return what each further view would leave out."""

    def find() -> list[set[str]]:
        motion = module("potmesil_addon.progress").run(module("operators.motion").sample_motion(scene))
        return [set(names) for names in module("operators.peel").peeled_views(scene, motion)]

    return find


@pytest.fixture
def renders() -> Any:
    """A list that grows by one with each render."""
    begun: list[int] = []

    def count(*_: Any) -> None:
        begun.append(1)

    bpy.app.handlers.render_init.append(count)
    yield begun
    bpy.app.handlers.render_init.remove(count)


def peeling(scene: Any, mode: str = "AUTOMATIC", count: int = 2) -> None:
    own = scene.potmesil_camera
    own.depth_peeling, own.peel_count, own.use_overscan = mode, count, False
    # Circles of the background about 50 pixels wide.
    scene.camera.data.dof.aperture_fstop = 0.05
    scene.camera.data.dof.focus_distance = 2.5


def still(scene: Any, name: str, y: float, size: float = 1.0, x: float = 0.0, color: Any = RED) -> Any:
    return card(scene, name, (x, y, 0.0), size, emitter(name, color))


def three_cards(scene: Any) -> None:
    """A small card before a larger one before a wall, one behind the other."""
    still(scene, "Near", 2.0, 0.4, color=RED).pass_index = 1
    still(scene, "Middle", 5.0, 1.6, color=GREEN).pass_index = 2
    still(scene, "Wall", 12.0, 40.0, color=BLUE).pass_index = 3


def shape(scene: Any, name: str, points: Any, faces: Any) -> Any:
    """Add a mesh."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    item = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(item)
    return item


def collection_of(scene: Any, name: str, *items: str, inside: Any = None) -> Any:
    """Add a collection marked *Peel Off*, with objects in it."""
    collection = bpy.data.collections.new(name)
    (inside or scene.collection).children.link(collection)
    for item in items:
        collection.objects.link(bpy.data.objects[item])
    collection.potmesil_camera.peel = True
    return collection


# ----- the samples file


def test_views_behind_show_what_was_hidden(scene: Any, exported: Any, renders: list[int]) -> None:
    three_cards(scene)
    peeling(scene)
    (layer,) = exported().layers
    assert len(renders) == 3
    assert [other.name for other in layer.hidden] == ["ViewLayer (behind 1)", "ViewLayer (behind 2)"]
    first, second = layer.hidden
    assert set(np.unique(layer.object_index)) == {1, 2, 3}
    assert set(np.unique(first.object_index)) == {2, 3}
    assert set(np.unique(second.object_index)) == {3}
    near = layer.object_index == 1
    assert near.sum() > 400
    np.testing.assert_allclose(first.depth[near], 5.0, rtol=1e-5)
    np.testing.assert_allclose(first.color[near], np.broadcast_to([0, 1, 0, 1], (near.sum(), 4)), atol=1e-5)
    np.testing.assert_allclose(second.depth, 12.0, rtol=1e-5)
    np.testing.assert_allclose(second.color, np.broadcast_to([0, 0, 1, 1], second.color.shape), atol=1e-5)
    # Where nothing was taken away the views are alike.
    np.testing.assert_array_equal(first.object_index[~near], layer.object_index[~near])
    assert first.vector is not None


def test_hidden_things_still_cast_shadows(scene: Any, exported: Any) -> None:
    still(scene, "Wall", 6.0, 40.0)
    bpy.data.objects["Wall"].data.materials[0] = bpy.data.materials.new("White")
    still(scene, "Near", 2.0, 0.5)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.rotation_euler = (np.pi / 2, 0.0, 0.0)
    scene.collection.objects.link(sun)
    peeling(scene)
    (hidden,) = exported().layers[0].hidden
    np.testing.assert_allclose(hidden.depth, 6.0, rtol=1e-5)
    assert hidden.color[32, 48, 0] < 0.1 * hidden.color[32, 5, 0]


def test_alpha_is_as_the_film_has_it(scene: Any, exported: Any) -> None:
    three_cards(scene)
    bpy.data.objects["Wall"].scale = (0.05, 1.0, 1.0)
    bpy.data.objects["Middle"].is_holdout = True
    scene.render.film_transparent = True
    peeling(scene)
    layer = exported().layers[0]
    first, second = layer.hidden
    near = layer.object_index == 1
    assert (layer.color[near][:, 3] > 0.0).all()
    # What is held out has neither colour nor depth, and still hides what is behind it.
    np.testing.assert_array_equal(first.color[near], 0.0)
    assert np.isinf(first.depth[near]).all()
    assert second.color[32, 48, 3] == pytest.approx(1.0)
    assert second.color[32, 2, 3] == 0.0
    assert np.isinf(second.depth[32, 2])


@pytest.mark.parametrize("sampling", ["PIXELS", "POINTS"])
def test_together_with_moving_objects_overscan_and_view_layers(
    scene: Any, exported: Any, renders: list[int], sampling: str
) -> None:
    three_cards(scene)
    keyed(bpy.data.objects["Middle"], "location", {0: (-0.3, 5, 0), 2: (0.3, 5, 0)})
    peeling(scene, count=1)
    scene.potmesil_camera.use_overscan = True
    scene.potmesil_camera.sampling = sampling
    other = scene.view_layers.new("Other")
    other.use_pass_z = True
    samples = exported()
    assert len(renders) == 4
    assert sorted(layer.name for layer in samples.layers) == ["Other", "ViewLayer"]
    assert samples.data_window.columns > samples.display_window.columns
    for layer in samples.layers:
        assert set(np.unique(layer.stationary.object_index)) == {1, 3}
        assert set(np.unique(layer.moving.object_index)) == {0, 2}
        (hidden,) = layer.hidden
        assert hidden.depth.shape == layer.depth.shape
        assert set(np.unique(hidden.object_index)) == {2, 3}
        # What moves is where it is at the frame.
        middle = hidden.object_index == 2
        assert (middle | (layer.object_index == 1) == (layer.object_index != 3)).mean() > 0.99


@pytest.mark.parametrize("why", ["off", "no lens", "nothing in front", "nothing marked", "all in focus"])
def test_no_view_without_need(scene: Any, exported: Any, renders: list[int], why: str) -> None:
    three_cards(scene)
    peeling(scene)
    own = scene.potmesil_camera
    if why == "off":
        own.depth_peeling = "OFF"
    elif why == "no lens":
        own.use_lens = False
    elif why == "nothing in front":
        for name in ("Near", "Middle"):
            bpy.data.objects.remove(bpy.data.objects[name])
    elif why == "nothing marked":
        own.depth_peeling = "COLLECTIONS"
    elif why == "all in focus":
        scene.camera.data.dof.aperture_fstop = 22.0
    assert exported().layers[0].hidden == ()
    assert len(renders) == 1


def test_command_leaves_the_views_out_without_a_lens(
    scene: Any, module: Any, tmp_path: Path, renders: list[int]
) -> None:
    three_cards(scene)
    peeling(scene)
    scene.potmesil_camera.use_overscan = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    main = module("operators.command").main
    read = module("potmesil_addon.exr").read_samples
    output, kept = str(tmp_path / "out.exr"), tmp_path / "kept.exr"
    words = ["render", "--frames", str(scene.frame_current), "--output", output, "--samples", str(kept)]
    assert main([*words, "--no-lens"]) == 0
    samples = read(kept)
    assert (len(renders), samples.layers[0].hidden) == (1, ())
    assert samples.data_window == samples.display_window
    assert main(words) == 0
    assert len(read(kept).layers[0].hidden) == 2
    assert bpy.context.scene.potmesil_camera.use_lens


# ----- which objects


def test_ground_and_walls_are_kept(scene: Any, views: Any) -> None:
    ground = [(-50, -10, -0.6), (50, -10, -0.6), (50, 300, -0.6), (-50, 300, -0.6)]
    shape(scene, "Ground", ground, [(0, 1, 2, 3)])
    room = [(x, y, z) for x in (-60, 60) for y in (-20, 310) for z in (-1, 40)]
    shape(scene, "Room", room, [(0, 1, 3, 2), (4, 5, 7, 6), (2, 3, 7, 6)])
    shape(scene, "Fence", [(4, 1, -0.6), (4, 200, -0.6), (4, 200, 1), (4, 1, 1)], [(0, 1, 2, 3)])
    still(scene, "Post", 2.0, 0.2)
    still(scene, "Man", 6.0, 1.0, 0.5)
    still(scene, "House", 30.0, 10.0)
    peeling(scene, count=4)
    assert views() == [{"Post"}, {"Post", "Man"}, {"Post", "Man", "House"}]
    scene.potmesil_camera.peel_count = 1
    assert views() == [{"Post"}]


def test_groups_part_where_circles_differ_most(scene: Any, views: Any) -> None:
    for name, y in (("A", 1.0), ("B", 1.05), ("C", 3.0), ("D", 3.2), ("Wall", 40.0)):
        still(scene, name, y, 0.2 * y, 0.1 * y)
    peeling(scene)
    assert views() == [{"A", "B"}, {"A", "B", "C", "D"}]
    scene.potmesil_camera.peel_count = 4
    assert {"A"} in views()


def test_what_is_out_of_the_picture_makes_no_view(scene: Any, views: Any) -> None:
    three_cards(scene)
    bpy.data.objects["Near"].location.x = 1.5
    still(scene, "Behind", -3.0)
    hidden = still(scene, "Hidden", 1.5)
    hidden.visible_camera = False
    still(scene, "Not Rendered", 1.4).hide_render = True
    peeling(scene)
    assert views() == [{"Middle"}]


def test_families_and_instances_go_together(scene: Any, views: Any) -> None:
    still(scene, "Wall", 40.0, 60.0)
    body = still(scene, "Body", 2.0, 0.3)
    still(scene, "Hat", 0.5, 0.2).parent = body
    source = still(scene, "Source", 0.0, 0.4)
    scene.collection.objects.unlink(source)
    group = bpy.data.collections.new("Group")
    group.objects.link(source)
    empty = bpy.data.objects.new("Instancer", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", group
    empty.location = (0.4, 6.0, 0.0)
    scene.collection.objects.link(empty)
    peeling(scene)
    assert views() == [{"Body", "Hat"}, {"Body", "Hat", "Instancer"}]
    # All of a scene under one parent is no family.
    root = bpy.data.objects.new("Root", None)
    scene.collection.objects.link(root)
    for name in ("Wall", "Body", "Instancer"):
        bpy.data.objects[name].parent = root
    assert views() == [{"Body", "Hat"}, {"Body", "Hat", "Instancer"}]


def test_marked_collections_go_one_after_the_other(scene: Any, views: Any) -> None:
    three_cards(scene)
    still(scene, "Nearest", 1.5, 0.2)
    still(scene, "Away", -5.0)
    peeling(scene, "COLLECTIONS", 1)
    collection_of(scene, "Back", "Wall")
    front = collection_of(scene, "Front", "Near", "Away")
    collection_of(scene, "Inner", "Nearest", inside=front)
    collection_of(scene, "Out of View", "Away")
    unmarked = collection_of(scene, "Unmarked", "Middle")
    unmarked.potmesil_camera.peel = False
    inner, outer = {"Nearest"}, {"Nearest", "Near", "Away"}
    assert views() == [inner, outer, outer | {"Wall"}]


# ----- the artist's scene is as it was


def settings(scene: Any) -> Any:
    return (
        dump(scene.render),
        dump(scene.cycles),
        dump(scene.camera.data),
        dump(scene.potmesil_camera),
        scene.frame_current,
        {item.name: (item.visible_camera, item.hide_viewport, item.hide_get()) for item in scene.objects},
        {image.name for image in bpy.data.images} - {"Render Result"},
    )


@pytest.fixture
def prepared(scene: Any) -> Any:
    """The three cards, one of which moves, with something that is hidden from the camera already."""
    three_cards(scene)
    keyed(bpy.data.objects["Middle"], "location", {0: (-0.3, 5, 0), 2: (0.3, 5, 0)})
    still(scene, "Unseen", 3.0).visible_camera = False
    peeling(scene)
    scene.potmesil_camera.use_overscan = True
    scene.render.use_persistent_data = True
    # Blender fills in a default color space the first time that a format is chosen.
    scene.render.image_settings.file_format = "JPEG"
    return scene


def test_every_setting_is_given_back(prepared: Any, exported: Any) -> None:
    before = settings(prepared)
    assert len(exported().layers[0].hidden) == 2
    assert settings(prepared) == before


@pytest.mark.parametrize("how", ["error", "cancel"])
@pytest.mark.parametrize("renders_done", [0, 3, 4])
def test_every_setting_is_given_back_in_mid_render(
    prepared: Any, module: Any, tmp_path: Path, how: str, renders_done: int
) -> None:
    before = settings(prepared)
    seen = []

    def render(scene: Any) -> Any:
        seen.append(sum(not item.visible_camera for item in prepared.objects))
        if how == "error" and len(seen) > renders_done:
            raise ZeroDivisionError
        yield 0.5
        bpy.ops.render.render(scene=scene.name)
        yield 1.0

    path = tmp_path / "a.exr"
    steps = module("operators.export").export_samples(prepared, path, render)
    if how == "error":
        with pytest.raises(ZeroDivisionError):
            list(steps)
    else:
        done = [next(steps)]
        while len(seen) <= renders_done:
            done.append(next(steps))
        assert done == sorted(done)
        steps.close()
    # The last of the five views is the picture, the two before it leave out one card, and two.
    assert seen[-1] > 1 or renders_done == 4
    assert settings(prepared) == before
    assert not path.exists()


def test_panel_of_a_collection(extension: Any, scene: Any) -> None:
    assert bpy.types.POTMESIL_PT_collection.bl_context == "collection"
    collection = bpy.data.collections.new("Trees")
    assert not collection.potmesil_camera.peel
    assert scene.potmesil_camera.depth_peeling == "OFF"
    assert scene.potmesil_camera.peel_count == 2
