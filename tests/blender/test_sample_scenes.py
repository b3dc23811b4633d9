"""Every sample scene, built by its script and opened from its file, through Cycles and both processors."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from potmesil_addon import exr
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from sample_scenes import catalogue, rendering

SAVED = [name for name, item in catalogue.SCENES.items() if item.saved]
WIDTH = 64
MOST_BYTES = 1_500_000


def contents(scene: Any) -> dict[str, Any]:
    """Return what makes a scene: places, shapes, materials, lamps, keys, the camera and the size."""
    things = {}
    for item in scene.objects:
        bpy.context.view_layer.update()
        data = item.data
        entry = {
            "kind": item.type,
            "matrix": np.round(np.array(item.matrix_world), 4).tolist(),
            "materials": [slot.material.name for slot in item.material_slots if slot.material],
            "index": item.pass_index,
        }
        if item.type == "MESH":
            places = np.empty(3 * len(data.vertices), dtype=np.float32)
            data.vertices.foreach_get("co", places)
            entry["shape"] = [len(data.polygons), *np.round(places.reshape(-1, 3).std(axis=0), 4).tolist()]
        elif item.type == "LIGHT":
            entry["power"] = round(data.energy, 4)
        things[item.name] = entry
    camera = scene.camera.data
    nodes = {item.name: len(item.node_tree.nodes) for item in bpy.data.materials if item.node_tree}
    return {
        "objects": things,
        "materials": nodes,
        "lens": [round(x, 4) for x in (camera.lens, camera.sensor_width, camera.dof.aperture_fstop)],
        "focus": round(camera.dof.focus_distance, 4),
        "size": [scene.render.resolution_x, scene.render.resolution_y],
        "samples": scene.cycles.samples,
        "frame": scene.frame_current,
        "extension": [getattr(scene.potmesil_camera, name) for name in ("use_lens", "sampling")],
        "exposure": [round(scene.render.motion_blur_shutter, 4), scene.render.motion_blur_position],
    }


def browsed_folders() -> list[bytes]:
    """Return where the file browsers in the file's screens begin."""
    areas = [area for screen in bpy.data.screens for area in screen.areas]
    spaces = [space for area in areas for space in area.spaces if space.type == "FILE_BROWSER"]
    return [space.params.directory for space in spaces if space.params is not None]


@pytest.fixture(scope="module", params=SAVED)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def built(name: str, extension: Any) -> dict[str, Any]:
    return contents(catalogue.SCENES[name].open())


def test_the_file_is_what_the_script_builds(
    name: str, built: dict[str, Any], extension: Any, tmp_path: Path
) -> None:
    path = catalogue.file_of(name)
    assert path.stat().st_size < MOST_BYTES
    before = hashlib.sha256(path.read_bytes()).digest()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    assert contents(scene) == built
    # Everything that the file needs is in it.
    assert all(image.packed_file for image in bpy.data.images if image.source == "FILE")
    assert not bpy.data.libraries
    assert set(browsed_folders()) <= {b"//"}
    longer = max(scene.render.resolution_x, scene.render.resolution_y)
    scene.render.resolution_percentage = max(1, round(100 * WIDTH / longer))
    scene.cycles.samples = 1
    samples = exr.read_samples(rendering.render_samples(scene, tmp_path / "samples.exr"))
    layer = samples.layers[0]
    assert layer.depth is not None
    assert np.isfinite(layer.depth).any()
    result = run(process(samples, ProcessSettings()))
    color = result.picture[..., :3]
    assert np.isfinite(color).all()
    assert color.std() > 0.01
    # The focus is on something that is there.
    assert layer.depth.min() < scene.camera.data.dof.focus_distance < layer.depth.max()
    assert hashlib.sha256(path.read_bytes()).digest() == before
