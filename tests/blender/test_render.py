"""Render and Process on real renders: the right way round, settings as they were, Cycles' own blur."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .scenes import card, dump

OpenEXR = pytest.importorskip("OpenEXR")


def _result() -> Any:
    """Return the result image as an array with row 0 on top."""
    return _image("Potmesil Result")


def _image(name: str) -> Any:
    """Return an image as an array with row 0 on top."""
    image = bpy.data.images[name]
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    columns, rows = image.size
    return values.reshape(rows, columns, 4)[::-1]


def _cycles(scene: Any, path: Path) -> Any:
    """Return Cycles' own picture of the scene as it is set."""
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return next(iter(OpenEXR.File(str(path)).channels().values())).pixels[..., :3]


def _settings(scene: Any) -> dict[str, Any]:
    """Return every setting that a render could touch."""
    return {
        "render": dump(scene.render),
        "cycles": dump(scene.cycles),
        "layers": [
            {name: value for name, value in dump(layer, 0).items() if name.startswith("use")}
            for layer in scene.view_layers
        ],
        "dof": dump(scene.camera.data.dof),
        "own": dump(scene.potmesil_camera),
        "frame": scene.frame_current,
        "images": {i.name for i in bpy.data.images} - {"Potmesil Result", "Render Result"},
    }


def test_render_makes_a_samples_file_and_a_result(scene: Any, module: Any, tmp_path: Path) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (0.2, 0.4, 0.6)))
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    picture = _result()
    assert picture.shape == (64, 96, 4)
    np.testing.assert_allclose(picture, np.broadcast_to([0.2, 0.4, 0.6, 1.0], picture.shape), atol=1e-5)
    image = bpy.data.images["Potmesil Result"]
    assert image.is_float
    assert image.alpha_mode == "PREMUL"
    samples = module("potmesil_addon.exr").read_samples(tmp_path / "samples_0001.exr")
    assert samples.layers[0].object_index is not None
    assert samples.layers[0].vector is not None
    np.testing.assert_allclose(samples.layers[0].depth, 5.0, rtol=1e-5)
    assert samples.lens.focus_distance == pytest.approx(5.0)
    assert samples.film.width == pytest.approx(0.036)
    np.testing.assert_allclose(samples.camera.project((0.0, 5.0, 0.0))[0], [48.0, 32.0], atol=1e-3)


def test_every_borrowed_setting_is_given_back(scene: Any) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (1.0, 1.0, 1.0)))
    scene.render.use_motion_blur = True
    scene.camera.data.dof.use_dof = True
    scene.render.image_settings.file_format = "JPEG"
    scene.render.image_settings.color_mode = "BW"
    scene.potmesil_camera.sampling = "POINTS"
    scene.render.use_multiview = True
    before = _settings(scene)
    bpy.ops.potmesil.render()
    assert _settings(scene) == before
    bpy.ops.potmesil.process()
    assert _settings(scene) == before


def test_animated_settings_are_borrowed_and_stay_animated(scene: Any) -> None:
    card(scene, "Left", (-1.5, 4.0, 0.0), 3.0, emitter("Glow", (1.0, 1.0, 1.0)))
    dof = scene.camera.data.dof
    dof.focus_distance, dof.aperture_fstop = 20.0, 0.05
    dof.use_dof = True
    assert dof.keyframe_insert("use_dof", frame=1)
    scene.potmesil_camera.use_lens = False
    bpy.ops.potmesil.render()
    # Without the camera's own blur the card's edge is a pixel or two wide.
    edge = _result()[32, :, 0]
    assert ((edge > 0.05) & (edge < 0.95)).sum() <= 3
    assert dof.use_dof
    dof.use_dof = False
    scene.frame_set(2)
    scene.frame_set(1)
    assert dof.use_dof


def test_settings_are_given_back_after_an_error(scene: Any, tmp_path: Path) -> None:
    # A folder stands where the file belongs: only writing it shows that.
    (tmp_path / "0001.exr").mkdir()
    scene.potmesil_camera.samples_path = str(tmp_path / "####.exr")
    scene.render.use_motion_blur = True
    # Blender fills in a default color space the first time that a format is chosen.
    scene.render.image_settings.file_format = "JPEG"
    before = _settings(scene)
    with pytest.raises(RuntimeError, match="Cannot write"):
        bpy.ops.potmesil.render()
    assert _settings(scene) == before


def test_cancelled_work_gives_everything_back(scene: Any, module: Any) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (1.0, 1.0, 1.0)))
    bpy.ops.potmesil.render()
    before = _settings(scene)
    result = _result().copy()
    scene.camera.data.dof.aperture_fstop = 0.1
    process = module("operators.process")
    steps = process.process_samples(bpy.context, module("operators.export").samples_path(scene))
    next(steps)
    next(steps)
    steps.close()
    scene.camera.data.dof.aperture_fstop = 0.5
    assert _settings(scene) == before
    np.testing.assert_array_equal(_result(), result)


def test_process_follows_the_camera_without_rendering(scene: Any) -> None:
    card(scene, "Near", (-0.5, 4.0, 0.0), 1.0, emitter("Red", (1.0, 0.0, 0.0)))
    card(scene, "Wall", (0.0, 9.0, 0.0), 30.0, emitter("Blue", (0.0, 0.0, 1.0)))
    scene.camera.data.dof.focus_distance = 4.0
    scene.camera.data.dof.aperture_fstop = 100.0
    bpy.ops.potmesil.render()
    sharp = _result().copy()
    renders = []
    bpy.app.handlers.render_init.append(lambda *_: renders.append(1))
    try:
        # On the wall: a sharp card before an even wall would look the same at any f-stop.
        scene.camera.data.dof.focus_distance = 9.0
        scene.camera.data.dof.aperture_fstop = 0.5
        bpy.ops.potmesil.process()
    finally:
        bpy.app.handlers.render_init.pop()
    assert not renders
    blurred = _result()
    assert np.abs(blurred - sharp).max() > 0.05
    scene.potmesil_camera.use_lens = False
    bpy.ops.potmesil.process()
    np.testing.assert_allclose(_result(), sharp, atol=0.02)


def test_undo_and_redo_leave_the_scene_alone(scene: Any) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (1.0, 1.0, 1.0)))
    bpy.ops.potmesil.render()
    bpy.ops.ed.undo_push(message="rendered")
    before = _settings(scene)
    bpy.ops.potmesil.process()
    bpy.ops.ed.undo_push(message="processed")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        step()
        assert _settings(bpy.context.scene) == before
    assert bpy.ops.potmesil.process() == {"FINISHED"}


def test_result_is_displayed_as_renders_are_and_stays_over_undo(scene: Any) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (3.0, 2.0, 1.0)))
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.potmesil.render()
    image = bpy.data.images["Potmesil Result"]
    # Blender displays no image of another source with the scene's view transform.
    assert image.source == "FILE"
    assert image.use_view_as_render
    before = _result()
    bpy.ops.ed.undo_push(message="rendered")
    scene.frame_end += 1
    bpy.ops.ed.undo_push(message="changed")
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(_result(), before)


def test_process_without_samples_says_what_to_do(scene: Any) -> None:
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.potmesil.process()


def test_picture_is_the_right_way_round(scene: Any) -> None:
    card(scene, "Red", (1.0, 5.0, 0.6), 0.6, emitter("Red", (1.0, 0.0, 0.0)))
    card(scene, "Green", (-1.0, 5.0, -0.6), 0.6, emitter("Green", (0.0, 1.0, 0.0)))
    bpy.ops.potmesil.render()
    picture = _result()
    assert picture[:32, 48:, 0].sum() > 10.0
    assert picture[32:, :48, 1].sum() > 10.0
    assert picture[32:, :48, 0].sum() < 0.1
    assert picture[:32, 48:, 1].sum() < 0.1


def test_film_alpha_is_premultiplied_and_blurs_with_the_color(scene: Any) -> None:
    scene.render.film_transparent = True
    card(scene, "Card", (0.0, 9.0, 0.0), 2.0, emitter("Glow", (0.8, 0.4, 0.2)))
    bpy.ops.potmesil.render()
    picture = _result()
    alpha = picture[..., 3]
    assert alpha.min() < 1e-6
    assert alpha.max() > 1.0 - 1e-6
    soft = (alpha > 0.1) & (alpha < 0.9)
    assert soft.sum() > 20
    np.testing.assert_allclose(
        picture[soft][:, :3] / alpha[soft][:, None],
        np.broadcast_to([0.8, 0.4, 0.2], (soft.sum(), 3)),
        atol=2e-3,
    )


@pytest.mark.parametrize("sampling", ["FINE", "POINTS"])
def test_finer_samples_give_the_final_size(scene: Any, module: Any, tmp_path: Path, sampling: str) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (1.0, 1.0, 1.0)))
    scene.potmesil_camera.sampling = sampling
    bpy.ops.potmesil.render()
    assert tuple(bpy.data.images["Potmesil Result"].size) == (96, 64)
    np.testing.assert_allclose(_result()[..., 1], 1.0, atol=1e-5)
    samples = module("potmesil_addon.exr").read_samples(tmp_path / "samples_0001.exr")
    assert samples.supersampling == 2
    assert (samples.display_window.rows, samples.display_window.columns) == (128, 192)
    # The margin for the lens is of samples, too.
    assert samples.layers[0].depth.shape == (134, 198)


@pytest.mark.parametrize("sampling", ["FINE", "POINTS"])
def test_finer_samples_see_what_pixels_see(scene: Any, module: Any, tmp_path: Path, sampling: str) -> None:
    # Sizes, percentages and borders of which the double is not twice the pixels.
    card(scene, "Card", (0.1, 4.0, 0.1), 0.5, emitter("Glow", (1.0, 1.0, 1.0)))
    own, render = scene.potmesil_camera, scene.render
    own.use_lens = own.use_motion = False
    render.resolution_x, render.resolution_y, render.resolution_percentage = 115, 77, 73
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.21, 0.83
    render.border_min_y, render.border_max_y = 0.15, 1.0
    scene.cycles.samples = 64
    read = module("potmesil_addon.exr").read_samples
    borders = (render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y)
    bpy.ops.potmesil.render()
    plain, pixels = _result().copy(), read(tmp_path / "samples_0001.exr")
    own.sampling = sampling
    bpy.ops.potmesil.render()
    fine, samples = _result(), read(tmp_path / "samples_0001.exr")
    assert fine.shape == plain.shape
    assert (render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y) == borders
    assert samples.display_window.columns == 2 * pixels.display_window.columns
    assert samples.film.width == pytest.approx(pixels.film.width, rel=1e-5)
    seen, wanted = (np.array(each.camera.project((0.1, 4.0, 0.1))[0]) for each in (samples, pixels))
    np.testing.assert_allclose(0.5 * seen, wanted, atol=1e-3)
    # Points put each edge of the card at a border between them.
    off, more = (0.05, 0.02) if sampling == "FINE" else (0.25, 0.1)
    np.testing.assert_allclose(_centroid(fine[..., 1]), _centroid(plain[..., 1]), atol=off)
    assert fine[..., 1].sum() == pytest.approx(plain[..., 1].sum(), rel=more)


def _filter_of(path: Path) -> dict[str, float]:
    return dict(json.loads(OpenEXR.File(str(path)).header()["potmesil:filter"]))


@pytest.mark.parametrize(
    ("kind", "width", "variance"),
    [
        ("BLACKMAN_HARRIS", 1.5, 0.019184279 * 9.0),
        ("BLACKMAN_HARRIS", 3.0, 0.019184279 * 36.0),
        ("GAUSSIAN", 1.5, 2.25 / 16.0),
        ("BOX", 1.5, 1.0 / 12.0),
    ],
)
@pytest.mark.parametrize("sampling", ["PIXELS", "FINE", "POINTS"])
def test_samples_say_how_they_are_filtered(
    scene: Any, tmp_path: Path, sampling: str, kind: str, width: float, variance: float
) -> None:
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = kind, width
    scene.potmesil_camera.sampling = sampling
    bpy.ops.potmesil.render()
    stored = _filter_of(tmp_path / "samples_0001.exr")
    assert stored["pixel_variance"] == pytest.approx(variance)
    of_points = 0.019184279 * 0.02**2
    assert stored["sample_variance"] == pytest.approx(of_points if sampling == "POINTS" else variance)
    assert scene.cycles.pixel_filter_type == kind
    assert scene.cycles.filter_width == pytest.approx(width)


@pytest.mark.parametrize(("kind", "width"), [("BLACKMAN_HARRIS", 3.0), ("GAUSSIAN", 4.0), ("BOX", 1.5)])
def test_filters_are_as_wide_as_samples_say(
    scene: Any, module: Any, tmp_path: Path, kind: str, width: float
) -> None:
    """Steps from pixel to pixel over an edge spread by the filter and by a pixel's width."""
    left = card(scene, "Left", (-5.0, 5.0, 0.0), 10.0, emitter("Glow", (1.0, 1.0, 1.0)))
    # The edge slants through the middle, and so crosses pixels everywhere.
    left.rotation_euler.y = 0.1
    left.location.x, left.location.z = -5.0 * np.cos(0.1), 5.0 * np.sin(0.1)
    scene.potmesil_camera.use_lens = False
    scene.cycles.samples = 1024
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = kind, width
    bpy.ops.potmesil.render()
    steps = -np.diff(_result()[8:-8, :, 1].astype(np.float64), axis=1)
    x, y = np.arange(steps.shape[1]), np.arange(steps.shape[0])
    edge = np.polyval(np.polyfit(y, (steps * x).sum(axis=1) / steps.sum(axis=1), 1), y)
    measured = (steps * (x - edge[:, np.newaxis]) ** 2).sum() / steps.sum()
    expected = _filter_of(tmp_path / "samples_0001.exr")["pixel_variance"]
    # Cycles draws from a table of the filter, which is a little wider.
    assert measured == pytest.approx(expected + 1.0 / 12.0, rel=0.05)


def test_other_engines_give_pixels(scene: Any, module: Any) -> None:
    sampling = module("operators.sampling")
    scene.potmesil_camera.sampling = "FINE"
    assert sampling.supersampling(scene) == 2
    scene.render.engine = "BLENDER_WORKBENCH"
    assert sampling.supersampling(scene) == 1
    assert sampling.filter_variance(scene) is None


def test_process_says_how_sure_the_result_is(scene: Any, module: Any, tmp_path: Path) -> None:
    card(scene, "Near", (-0.5, 1.0, 0.3), 0.6, emitter("Red", (1.0, 0.0, 0.0)))
    card(scene, "Wall", (0.0, 9.0, 0.0), 30.0, emitter("Blue", (0.0, 0.0, 1.0)))
    state = bpy.context.window_manager.potmesil_camera
    bpy.ops.potmesil.render()
    assert not {"Potmesil Error", "Potmesil Guessed"} & set(bpy.data.images.keys())
    core = module("potmesil_addon.process")
    samples = module("potmesil_addon.exr").read_samples(tmp_path / "samples_0001.exr")
    settings = module("operators.process").process_settings(bpy.context)
    result = module("potmesil_addon.progress").run(core.process(samples, settings))
    quality = result.report["quality"]
    assert state.has_quality
    assert quality["guessed_pixels"] > 0.0
    assert state.guessed_pixels == pytest.approx(quality["guessed_pixels"])
    assert state.expected_error == pytest.approx(quality["predicted_error"])
    scene.potmesil_camera.use_quality_maps = True
    bpy.ops.potmesil.process()
    for name, values in (("Potmesil Error", result.predicted_error), ("Potmesil Guessed", result.guessed)):
        stored = _image(name)
        np.testing.assert_allclose(stored[..., :3], values[..., np.newaxis].repeat(3, axis=2), atol=1e-6)
        np.testing.assert_array_equal(stored[..., 3], 1.0)
    scene.potmesil_camera.visibility = "none"
    bpy.ops.potmesil.process()
    assert state.guessed_pixels == 0.0
    assert _image("Potmesil Guessed")[..., :3].max() == 0.0


@pytest.mark.parametrize(
    ("depth", "ratio", "blades"),
    [(3.0, 1.0, 3), (9.0, 1.0, 3), (9.0, 1.7, 3), (3.0, 1.7, 3), (9.0, 1.5, 0), (3.0, 1.0, 5)],
)
def test_bokeh_has_cycles_size_shape_and_orientation(
    scene: Any, tmp_path: Path, depth: float, ratio: float, blades: int
) -> None:
    # A small light, wide open: its blur is the aperture's image and nothing else. The frame is wide enough
    # for the renormalisation at its border not to reach the light.
    # Point samples, since an anti-aliased light this small is half made of its rim, which has the depth of
    # what lies behind.
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.potmesil_camera.sampling = "POINTS"
    card(
        scene,
        "Light",
        (0.02 * depth, depth, 0.01 * depth),
        0.012 * depth,
        emitter("Glow", (1.0, 1.0, 1.0), 50.0),
    )
    dof = scene.camera.data.dof
    dof.aperture_fstop, dof.aperture_blades = 0.06, blades
    dof.aperture_rotation, dof.aperture_ratio = 0.2, ratio
    scene.cycles.samples = 16
    bpy.ops.potmesil.render()
    ours = _result()[..., 1].astype(np.float64)
    dof.use_dof = True
    scene.cycles.samples = 1024
    truth = _cycles(scene, tmp_path / "truth.exr")[..., 1].astype(np.float64)
    shape = _correlation(ours, truth)
    assert shape > 0.99
    for wrong in (ours[::-1], ours[:, ::-1], ours[::-1, ::-1]):
        # More blades are too nearly symmetric to tell.
        if blades == 3:
            assert _correlation(_aligned(wrong, truth), truth) < shape - 0.01
    np.testing.assert_allclose(_centroid(ours), _centroid(truth), atol=0.25)
    np.testing.assert_allclose(_spread(ours), _spread(truth), rtol=0.04)


def _correlation(a: Any, b: Any) -> float:
    return float((a * b).sum() / np.sqrt((a**2).sum() * (b**2).sum()))


def _centroid(a: Any) -> Any:
    y, x = np.indices(a.shape)
    return np.array([(a * y).sum(), (a * x).sum()]) / a.sum()


def _spread(a: Any) -> Any:
    y, x = np.indices(a.shape)
    cy, cx = _centroid(a)
    return np.sqrt(np.array([(a * (y - cy) ** 2).sum(), (a * (x - cx) ** 2).sum()]) / a.sum())


def _aligned(a: Any, b: Any) -> Any:
    return np.roll(a, np.rint(_centroid(b) - _centroid(a)).astype(int), axis=(0, 1))
