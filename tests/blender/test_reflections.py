"""What mirrors and glass show, exported: its distance and motion, and the scene as it was."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import diffuse, emitter, material, node

from .scenes import card, dump
from .test_motion_export import keyed

RED, WHITE = (1.0, 0.1, 0.1), (1.0, 1.0, 1.0)


@pytest.fixture
def exported(scene: Any, module: Any, tmp_path: Path) -> Callable[[], Any]:
    """Export the scene's samples, and read them."""
    path = tmp_path / "exported.exr"

    def export() -> Any:
        module("operators.export").render_samples(bpy.context, path)
        return module("potmesil_addon.exr").read_samples(path)

    return export


@pytest.fixture
def prepared(scene: Any) -> Any:
    """A mirror 4 m before the camera, a red wall 3 m behind it, with reflections on."""
    own = scene.potmesil_camera
    own.reflections, own.use_overscan = "REFLECTIONS", False
    card(scene, "Mirror", (0.0, 4.0, 0.0), 40.0, silver()).pass_index = 2
    card(scene, "Wall", (0.0, -3.0, 0.0), 60.0, emitter("Wall", RED)).pass_index = 5
    return scene


def silver() -> Any:
    return material("Silver", lambda tree: node(tree, "BsdfGlossy", Roughness=0.0).outputs[0])


def clear_glass(ior: float) -> Any:
    return material("Glass", lambda tree: node(tree, "BsdfGlass", Roughness=0.0, IOR=ior).outputs[0])


def block(scene: Any, name: str, near: float, far: float, size: float, made_of: Any) -> Any:
    """Add a box that faces the camera."""
    h = 0.5 * size
    mesh = bpy.data.meshes.new(name)
    corners = [(x, y, z) for y in (near, far) for z in (-h, h) for x in (-h, h)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(made_of)
    item = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(item)
    return item


def everything() -> dict[str, Any]:
    """Return what is in the file, and what objects, materials and scenes are set to."""
    kinds = ("scenes", "objects", "meshes", "materials", "worlds", "cameras", "lights", "node_groups")
    found: dict[str, Any] = {kind: sorted(item.name for item in getattr(bpy.data, kind)) for kind in kinds}
    for item in bpy.data.objects:
        found[f"object {item.name}"] = dump(item, 1)
        found[f"own {item.name}"] = sorted(item.keys())
    for scene in bpy.data.scenes:
        found[f"scene {scene.name}"] = dump(scene.render)
        # Blender gives it a name when anything is saved.
        found[f"scene {scene.name}"]["image_settings"].pop("linear_colorspace_settings")
        found[f"cycles {scene.name}"] = dump(scene.cycles)
        for layer in scene.view_layers:
            passes = [name for name in dir(layer) if name.startswith("use_")]
            found[f"layer {scene.name} {layer.name}"] = {name: getattr(layer, name) for name in passes}
            found[f"override {scene.name} {layer.name}"] = layer.material_override
            found[f"denoising {scene.name} {layer.name}"] = layer.cycles.denoising_store_passes
    return found


def changes(before: dict[str, Any], now: dict[str, Any], path: str = "") -> list[str]:
    """Return what is not as it was."""
    found = []
    for name in before.keys() | now.keys():
        old, new = before.get(name), now.get(name)
        if isinstance(old, dict) and isinstance(new, dict):
            found += changes(old, new, f"{path}/{name}")
        elif old != new:
            found.append(f"{path}/{name}: {old} -> {new}")
    return found


def test_plane_mirror_shows_the_wall_behind_the_camera(prepared: Any, exported: Any) -> None:
    layer = exported().layers[0]
    assert layer.transmitted is None
    np.testing.assert_allclose(layer.depth, 4.0, rtol=1e-4)
    # To the mirror and back, past the camera and on.
    np.testing.assert_allclose(layer.reflected.depth, 11.0, rtol=2e-3)
    assert (layer.reflected.object_index == 5).all()
    np.testing.assert_allclose(layer.reflected.color[..., :3], layer.color[..., :3], atol=1e-5)
    assert layer.reflected.color[..., 3].min() > 0.5
    assert layer.reflected.vector is None


@pytest.mark.parametrize("clip", [0.01, 1.5])
def test_clip_start_is_part_of_the_path(prepared: Any, exported: Any, module: Any, clip: float) -> None:
    prepared.camera.data.clip_start = clip
    layer = exported().layers[0]
    np.testing.assert_allclose(layer.reflected.depth, 11.0, rtol=2e-3)


def test_mirrors_are_seen_in_mirrors(prepared: Any, exported: Any) -> None:
    bpy.data.objects["Wall"].data.materials[0] = silver()
    card(scene=prepared, name="Far", center=(0.0, 9.0, 0.0), size=100.0, material=emitter("Far", WHITE))
    mirror = bpy.data.objects["Mirror"]
    mirror.scale = (0.02, 1.0, 0.02)
    layer = exported().layers[0]
    there = layer.reflected.color[..., 3] > 0.5
    inner = there & (np.abs(layer.depth - 4.0) < 1e-3)
    assert inner.any()
    # The small mirror shows the one behind, and that the far wall beyond the small mirror's own sides.
    middle = np.median(layer.reflected.depth[inner])
    assert middle == pytest.approx(4.0 + 7.0 + 12.0, rel=0.02)


def test_glass_brings_what_is_behind_it_nearer(scene: Any, exported: Any) -> None:
    scene.potmesil_camera.reflections, scene.potmesil_camera.use_overscan = "REFLECTIONS", False
    block(scene, "Pane", 2.0, 3.2, 20.0, clear_glass(1.5))
    card(scene, "Wall", (0.0, 6.0, 0.0), 60.0, emitter("Wall", RED)).pass_index = 9
    layer = exported().layers[0]
    middle = (slice(28, 36), slice(42, 54))
    np.testing.assert_allclose(layer.transmitted.depth[middle], 6.0 - 1.2 + 1.2 / 1.5, rtol=0.01)
    # Paths through the very edge between two triangles get lost, and take the depth beside them.
    assert (layer.transmitted.object_index[middle] == 9).mean() > 0.8
    assert layer.reflected is not None


def test_lamps_are_seen_at_their_own_distance(prepared: Any, exported: Any) -> None:
    light = bpy.data.lights.new("Lamp", "AREA")
    light.size = 4.0
    lamp = bpy.data.objects.new("Lamp", light)
    lamp.location, lamp.rotation_euler = (0.0, -1.0, 0.0), (math.pi / 2.0, 0.0, 0.0)
    prepared.collection.objects.link(lamp)
    layer = exported().layers[0]
    assert layer.reflected.depth[32, 48] == pytest.approx(9.0, rel=2e-3)


def test_what_moves_in_a_mirror_goes_the_mirrored_way(prepared: Any, exported: Any) -> None:
    mover = card(prepared, "Mover", (0.0, -1.0, 0.0), 3.0, emitter("Mover", WHITE))
    mover.pass_index = 7
    keyed(mover, "location", {0: (-0.4, -1.0, 0.0), 1: (0.0, -1.0, 0.0), 2: (0.4, -1.0, 0.0)})
    prepared.frame_set(1)
    layer = exported().layers[0]
    seen = layer.reflected.object_index == 7
    assert seen.any()
    focal = prepared.camera.data.lens / prepared.camera.data.sensor_width * 96
    # The camera does not see it; its image is 9 m away, and goes to the same side.
    np.testing.assert_allclose(layer.reflected.vector[seen][:, 2], -focal * 0.4 / 9.0, rtol=0.02)
    np.testing.assert_allclose(layer.reflected.vector[seen][:, 3], 0.0, atol=0.01)
    assert not layer.reflected.vector[~seen].any() or np.abs(layer.reflected.vector[~seen]).max() < 4.0


def test_without_blur_the_parts_are_the_picture(prepared: Any, exported: Any, module: Any) -> None:
    block(prepared, "Pane", 2.0, 2.2, 0.8, clear_glass(1.45))
    card(prepared, "Floor", (0.6, 3.0, -0.4), 0.8, diffuse("Paint", RED))
    samples = exported()
    layer = samples.layers[0]
    assert layer.reflected is not None
    assert layer.transmitted is not None
    process = module("potmesil_addon.process")
    lens = module("potmesil_addon.samples").LensAttributes(f_stop=1e6)
    steps = process.process(samples, process.ProcessSettings(lens=lens, use_motion=False))
    result = module("potmesil_addon.progress").run(steps)
    np.testing.assert_allclose(result.picture[..., :3], layer.color[..., :3], atol=1e-4)


def test_light_passes_are_kept_where_the_artist_wants_them(
    prepared: Any, module: Any, tmp_path: Path
) -> None:
    def names() -> set[str]:
        module("operators.export").render_samples(bpy.context, tmp_path / "kept.exr")
        raw = module("potmesil_addon.exr").read_raw(tmp_path / "kept.exr")
        return {channel.full_name for channel in raw.channels if "Gloss" in channel.full_name}

    assert not names()
    prepared.view_layers[0].use_pass_glossy_color = True
    assert names()


def test_override_decides_what_a_surface_is(prepared: Any, exported: Any) -> None:
    bpy.data.objects["Mirror"].potmesil_camera.surface = "OPAQUE"
    assert exported().layers[0].reflected is None


def test_rough_mirrors_keep_their_own_depth(prepared: Any, exported: Any) -> None:
    bpy.data.objects["Mirror"].data.materials[0] = material(
        "Brushed", lambda tree: node(tree, "BsdfGlossy", Roughness=0.6).outputs[0]
    )
    assert exported().layers[0].reflected is None


def test_off_renders_once_and_parts_nothing(prepared: Any, exported: Any) -> None:
    prepared.potmesil_camera.reflections = "OFF"
    layer = exported().layers[0]
    assert layer.reflected is None


@pytest.mark.parametrize("after", [0, 2])
@pytest.mark.parametrize("how", ["error", "cancel"])
def test_scene_is_as_it_was(prepared: Any, module: Any, tmp_path: Path, how: str, after: int) -> None:
    light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    prepared.collection.objects.link(light)
    before = everything()
    done = []

    def render(scene: Any) -> Any:
        done.append(scene.name)
        if how == "error" and len(done) > after:
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
        shares = [next(steps)]
        while len(done) <= after:
            shares.append(next(steps))
        assert shares == sorted(shares)
        steps.close()
    assert not changes(before, everything())
    assert not path.exists()


def test_scene_is_as_it_was_at_the_end(prepared: Any, exported: Any) -> None:
    before = everything()
    exported()
    assert not changes(before, everything())
