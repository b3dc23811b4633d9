"""The lens models against Blender's own node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from .test_stage import OpenEXR, file_output, make_tree

COLUMNS, ROWS = 160, 100
FOCAL = 150.0
LIGHTS = [(25.0, 20.0), (80.0, 50.0), (131.0, 30.0), (40.0, 79.0), (120.0, 82.0), (60.0, 28.0)]

CASES = [
    ("brown", {"k1": -0.25}),
    ("brown", {"k1": 0.2, "k2": 0.1, "k3": -0.05, "k4": 0.1}),
    ("brown", {"p1": 0.05}),
    ("brown", {"k1": -0.1, "p2": -0.04}),
    ("polynomial", {"k1": -0.2, "k2": 0.05}),
    ("polynomial", {"k1": 0.2, "k3": 0.1}),
    ("division", {"k1": -0.2}),
    ("division", {"k1": 0.2, "k2": 0.1}),
    ("nuke", {"k1": -0.07}),
    ("nuke", {"k1": 0.07, "k2": 0.03}),
]


def soft_lights() -> np.ndarray:
    x, y = np.arange(COLUMNS) + 0.5, (np.arange(ROWS) + 0.5)[:, np.newaxis]
    return sum(np.exp(-0.5 * ((x - a) ** 2 + (y - b) ** 2) / 1.5**2) for a, b in LIGHTS)


def clip_with(folder: Path, model: str, coefficients: dict[str, float]) -> Any:
    """Return a movie clip of the picture's size with a camera whose axis is off the middle."""
    frame = bpy.data.images.new("Frame", COLUMNS, ROWS)
    frame.filepath_raw, frame.file_format = str(folder / "frame.png"), "PNG"
    frame.save()
    clip = bpy.data.movieclips.load(str(folder / "frame.png"))
    camera = clip.tracking.camera
    camera.distortion_model = model.upper()
    camera.units = "PIXELS"
    camera.focal_length_pixels = FOCAL
    # Pixels from the lower left corner.
    camera.principal_point_pixels = (84.0, 47.0)
    prefix = "" if model == "polynomial" else f"{model}_"
    for name, value in coefficients.items():
        setattr(camera, prefix + name, value)
    return clip


def blenders(scene: Any, folder: Path, clip: Any) -> np.ndarray:
    """Return the lights as Blender's node distorts them, row 0 on top."""
    image = bpy.data.images.new("Lights", COLUMNS, ROWS, float_buffer=True, is_data=True)
    values = np.ones((ROWS, COLUMNS, 4), dtype=np.float32)
    values[..., :3] = soft_lights()[::-1, :, np.newaxis]
    image.pixels.foreach_set(values.reshape(-1))
    scene.render.resolution_x, scene.render.resolution_y = COLUMNS, ROWS
    tree, layers, output = make_tree(scene)
    tree.nodes.remove(layers)
    source = tree.nodes.new("CompositorNodeImage")
    source.image = image
    node = tree.nodes.new("CompositorNodeMovieDistortion")
    node.clip = clip
    if "Type" in node.inputs:
        node.inputs["Type"].default_value = "Distort"
    else:
        node.distortion_type = "DISTORT"
    tree.links.new(source.outputs[0], node.inputs[0])
    # The node's picture is as large as what it bends; over another one it is cut to that one's frame.
    frame = tree.nodes.new("CompositorNodeImage")
    frame.image = bpy.data.images.new("Black", COLUMNS, ROWS, float_buffer=True, is_data=True)
    over = tree.nodes.new("CompositorNodeAlphaOver")
    tree.links.new(frame.outputs[0], over.inputs["Background"])
    tree.links.new(node.outputs[0], over.inputs["Foreground"])
    tree.links.new(over.outputs[0], output.inputs[0])
    tree.links.new(over.outputs[0], file_output(tree, folder, "Image"))
    scene.cycles.samples = 1
    bpy.ops.render.render()
    (path,) = folder.glob("*Image*.exr")
    channels = OpenEXR.File(str(path)).channels()
    (key,) = channels
    return np.asarray(channels[key].pixels, dtype=np.float64)[..., 0]


def peak(picture: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return the middle of the light around a place."""
    left, top = max(round(x) - 7, 0), max(round(y) - 7, 0)
    part = picture[top : top + 14, left : left + 14]
    total = part.sum()
    across, down = np.arange(part.shape[1]) + left + 0.5, np.arange(part.shape[0]) + top + 0.5
    return np.array([(part * across).sum(), (part * down[:, np.newaxis]).sum()]) / total


@pytest.mark.skipif(
    bpy.app.version < (5, 2, 0), reason="before Blender 5.2 the node's picture is shifted by up to two pixels"
)
@pytest.mark.parametrize(("model", "coefficients"), CASES, ids=str)
def test_lights_lie_where_blenders_node_has_them(
    scene: Any, module: Any, tmp_path: Path, model: str, coefficients: dict[str, float]
) -> None:
    picture = blenders(scene, tmp_path, clip_with(tmp_path, model, coefficients))
    distortion, effects = module("potmesil_addon.distortion"), module("potmesil_addon.effects")
    lens = distortion.LensMap(
        effects.Distortion(model, **coefficients), FOCAL, FOCAL, 84.0, ROWS - 47.0, COLUMNS, ROWS
    )
    window = module("potmesil_addon.samples").Window(0, 0, COLUMNS, ROWS)
    lights = np.repeat(soft_lights()[..., np.newaxis], 4, axis=2).astype(np.float32)
    ours = distortion.distorted_picture(lights, window, window, lens)[..., 1]
    wanted = lens.distort(LIGHTS)
    found = np.array([peak(picture, *place) for place in wanted])
    # The node's picture grows or shrinks, by an odd number of pixels too, and is put into the middle.
    found -= np.clip(np.round(2.0 * (found - wanted).mean(axis=0)) / 2.0, -0.5, 0.5)
    np.testing.assert_allclose(found, wanted, atol=0.25)
    np.testing.assert_allclose([peak(ours, *place) for place in wanted], wanted, atol=0.25)
    # Enough to tell signs and models apart.
    assert np.hypot(*(wanted - LIGHTS).T).max() > 1.5
