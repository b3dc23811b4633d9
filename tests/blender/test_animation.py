"""All frames without a stage: rendered, processed and written, or processed from samples that are there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .scenes import card

OpenEXR = pytest.importorskip("OpenEXR")


@pytest.fixture
def shot(scene: Any, tmp_path: Path) -> Any:
    """A near red card that crosses a blue wall in three frames, written as float EXR."""
    near = card(scene, "Near", (-0.5, 4.0, 0.0), 1.0, emitter("Red", (1.0, 0.0, 0.0)))
    card(scene, "Wall", (0.0, 9.0, 0.0), 30.0, emitter("Blue", (0.0, 0.0, 1.0)))
    for frame, x in ((1, -1.0), (3, 1.0)):
        near.location.x = x
        near.keyframe_insert("location", frame=frame)
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGBA"
    scene.render.filepath = str(tmp_path / "out" / "frame_")
    own = scene.potmesil_camera
    own.use_overscan = own.use_hidden_surfaces = own.use_motion = False
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 3, 2
    scene.frame_set(2)
    return scene


def _pixels(path: Path) -> Any:
    return next(iter(OpenEXR.File(str(path)).channels().values())).pixels[..., :3]


def _result() -> Any:
    image = bpy.data.images["Potmesil Result"]
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)[::-1, :, :3]


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_render_animation_writes_every_frame(shot: Any, tmp_path: Path) -> None:
    assert bpy.ops.potmesil.render_animation() == {"FINISHED"}
    out = tmp_path / "out"
    assert _names(out) == ["frame_0001.exr", "frame_0003.exr"]
    assert shot.frame_current == 2
    assert bpy.context.window_manager.potmesil_camera.doing == ""
    first, last = (_pixels(out / f"frame_000{frame}.exr") for frame in (1, 3))
    middles = [
        (np.arange(96) * each[..., 0].sum(axis=0)).sum() / each[..., 0].sum() for each in (first, last)
    ]
    assert middles[0] < 40.0
    assert middles[1] > 56.0
    # Each is the picture that Process makes of that frame.
    shot.frame_set(3)
    bpy.ops.potmesil.process()
    np.testing.assert_allclose(_result(), last, atol=1e-6)
    # The same again with another f-stop, from the samples.
    shot.frame_set(2)
    bpy.data.objects["Near"].hide_render = True
    shot.camera.data.dof.aperture_fstop = 0.1
    assert bpy.ops.potmesil.process_animation() == {"FINISHED"}
    assert shot.frame_current == 2
    again = _pixels(out / "frame_0003.exr")
    assert again[..., 0].sum() == pytest.approx(last[..., 0].sum(), rel=0.1)
    assert np.abs(again - last).max() > 0.1


def test_frames_are_written_with_the_view_transform_and_the_format(shot: Any, tmp_path: Path) -> None:
    shot.frame_end = 1
    shot.render.image_settings.file_format = "PNG"
    shot.view_settings.view_transform = "Standard"
    bpy.data.objects["Near"].hide_render = True
    bpy.ops.potmesil.render_animation()
    image = bpy.data.images.load(str(tmp_path / "out" / "frame_0001.png"))
    values = np.array(image.pixels[:]).reshape(-1, 4)
    np.testing.assert_allclose(values, np.broadcast_to([0.0, 0.0, 1.0, 1.0], values.shape), atol=0.01)


def test_overwrite_and_placeholders_are_those_of_the_output(shot: Any, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "frame_0001.exr").write_bytes(b"mine")
    shot.render.use_overwrite, shot.render.use_placeholder = False, True
    assert bpy.ops.potmesil.render_animation() == {"FINISHED"}
    assert (out / "frame_0001.exr").read_bytes() == b"mine"
    assert not (tmp_path / "samples_0001.exr").exists()
    assert _pixels(out / "frame_0003.exr").shape == (64, 96, 3)
    with pytest.raises(RuntimeError, match="All frames are there"):
        bpy.ops.potmesil.render_animation()


def test_an_output_path_that_blender_cannot_fill_in_is_named(shot: Any, module: Any) -> None:
    shot.render.filepath += "{nothing}_"
    if bpy.app.version < (5, 0, 0):
        pytest.skip("paths had no variables before Blender 5.0")
    with pytest.raises(RuntimeError, match=r"output path is not valid: .*\{nothing\}"):
        bpy.ops.potmesil.render_animation()


def test_an_error_names_its_frame_and_earlier_frames_stay(shot: Any, tmp_path: Path) -> None:
    bpy.ops.potmesil.render_animation()
    out = tmp_path / "out"
    for path in out.iterdir():
        path.unlink()
    (tmp_path / "samples_0003.exr").unlink()
    shot.render.use_placeholder = True
    with pytest.raises(RuntimeError, match="Frame 3: "):
        bpy.ops.potmesil.process_animation()
    assert _names(out) == ["frame_0001.exr"]
    assert shot.frame_current == 2
    assert bpy.context.window_manager.potmesil_camera.error.startswith("Frame 3: ")


def test_cancelled_work_leaves_whole_frames_and_the_scene(shot: Any, module: Any, tmp_path: Path) -> None:
    bpy.ops.potmesil.render_animation()
    out = tmp_path / "out"
    for path in out.iterdir():
        path.unlink()
    shot.render.use_placeholder = True
    frames = module("operators.all_frames")
    steps = frames._written_frames(bpy.context, None, renders=False)
    shares = []
    for share in steps:
        shares.append(share)
        if share > 0.6:
            break
    steps.close()
    assert shares == sorted(shares)
    assert _names(out) == ["frame_0001.exr"]
    assert shot.frame_current == 2


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda scene: _format(scene, "VIDEO", "FFMPEG"), "not as a movie"),
        (lambda scene: _format(scene, "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER"), "one layer"),
        (lambda scene: setattr(scene.render, "filepath", "//out/"), "never saved"),
        (lambda scene: setattr(scene.render, "filepath", __file__ + "/out/"), "Cannot write frames"),
    ],
)
def test_output_that_cannot_be_written_is_refused_before_the_render(
    shot: Any, tmp_path: Path, spoil: Any, words: str
) -> None:
    spoil(shot)
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.potmesil.render_animation()
    assert not (tmp_path / "samples_0001.exr").exists()


def test_one_samples_file_for_all_frames_is_refused(shot: Any, tmp_path: Path) -> None:
    shot.potmesil_camera.samples_path = str(tmp_path / "one.exr")
    with pytest.raises(RuntimeError, match="same samples file"):
        bpy.ops.potmesil.process_animation()


def _format(scene: Any, medium: str, name: str) -> None:
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = medium
    image.file_format = name
