"""Odd scenes: times that are no ordinary frames, stereo views, several scenes, indices that run out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import drive, emitter

from .scenes import card, dump

OpenEXR = pytest.importorskip("OpenEXR")


def _small(scene: Any) -> None:
    scene.render.resolution_x, scene.render.resolution_y = 96, 16
    scene.cycles.samples = 64
    scene.cycles.seed = 3


def _bar(scene: Any, rate: float = 0.15) -> Any:
    """Add a glowing bar, 5 m away, that goes right by a rate a frame of the scene's own time."""
    item = card(scene, "Bar", (0.0, 5.0, 0.0), 0.6, emitter("Glow", (1.0, 0.5, 0.25)))
    drive(item, "location", 0, rate)
    return item


def _ours(module: Any, path: Path) -> Any:
    """Export the frame that the scene is at, and return its picture with motion blur, and the samples."""
    core = module("potmesil_addon.process")
    module("operators.export").render_samples(bpy.context, path)
    samples = module("potmesil_addon.exr").read_samples(path)
    wanted = core.ProcessSettings(use_lens=False)
    return module("potmesil_addon.progress").run(core.process(samples, wanted)).picture[..., :3], samples


def _cycles(scene: Any, path: Path) -> Any:
    """Return Cycles' own picture of the frame, with motion blur."""
    scene.render.use_motion_blur = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    scene.render.use_motion_blur = False
    return next(iter(OpenEXR.File(str(path)).channels().values())).pixels[..., :3]


def _at(frame: int, subframe: float = 0.0, remap: tuple[int, int] = (100, 100)) -> Callable[[Any], None]:
    def go(scene: Any) -> None:
        scene.render.frame_map_old, scene.render.frame_map_new = remap
        # Where the scene's own time is the first frame's, wherever that is.
        own = (frame + subframe) * remap[0] / remap[1]
        scene.camera.location[0] = 0.15 * (own - 1.0)
        scene.frame_set(frame, subframe=subframe)

    return go


@pytest.mark.parametrize("position", ["START", "CENTER", "END"])
@pytest.mark.parametrize(
    "go", [_at(-12), _at(0), _at(7, 0.625), _at(-3, 0.25), _at(20, 0.0, (100, 300)), _at(21, 0.5, (100, 50))]
)
def test_blur_is_cycles_own_at_odd_times(
    scene: Any, module: Any, tmp_path: Path, go: Callable[[Any], None], position: str
) -> None:
    _small(scene)
    _bar(scene)
    scene.render.motion_blur_shutter = 1.0
    scene.render.motion_blur_position = position
    go(scene)
    now = scene.frame_current, scene.frame_subframe
    theirs = _cycles(scene, tmp_path / "theirs.exr")
    picture, samples = _ours(module, tmp_path / "ours.exr")
    assert (scene.frame_current, scene.frame_subframe) == now
    # Light before and after the middle, in pixels: how long the blur is, and which way.
    profile, expected = (p[4:12, :, 0].mean(axis=0) for p in (picture, theirs))
    x = np.arange(96) + 0.5
    place, right = (float((p * x).sum() / p.sum()) for p in (profile, expected))
    assert place == pytest.approx(right, abs=0.15)
    long, wide = (float((p * (x - place) ** 2).sum() / p.sum()) for p in (profile, expected))
    assert long == pytest.approx(wide, rel=0.05)
    assert np.abs(profile - expected).mean() < 0.01
    stretch = scene.render.frame_map_old / scene.render.frame_map_new
    (path,) = samples.paths.objects
    went = path.at(1.0)[0, 3] - path.at(0.0)[0, 3]
    assert went == pytest.approx(0.15 * stretch, rel=1e-4)


def test_stereo_views_are_said_and_the_cameras_own_one_is_rendered(
    scene: Any, module: Any, tmp_path: Path
) -> None:
    _small(scene)
    _bar(scene)
    scene.frame_set(1)
    plain, _ = _ours(module, tmp_path / "plain.exr")
    scene.render.use_multiview = True
    scene.camera.data.stereo.interocular_distance = 0.5
    for view_format in ("STEREO_3D", "MULTIVIEW"):
        scene.render.views_format = view_format
        before = dump(scene.render)
        picture, samples = _ours(module, tmp_path / f"{view_format}.exr")
        assert [layer.name for layer in samples.layers] == ["ViewLayer"]
        np.testing.assert_array_equal(picture, plain)
        assert dump(scene.render) == before
        findings = module("potmesil_addon.preflight").check_scene(
            module("operators.scene").scene_facts(scene)
        )
        assert "Stereo Views" in [finding.title for finding in findings]


def test_each_scene_of_a_file_has_its_own_samples(scene: Any, module: Any, tmp_path: Path) -> None:
    _small(scene)
    _bar(scene)
    # The other one is elsewhere in time, smaller, and shows the same bar.
    other = scene.copy()
    other.name, other.use_fake_user = "Other", True
    other.camera = scene.camera.copy()
    other.collection.objects.link(other.camera)
    other.camera.data = scene.camera.data.copy()
    other.camera.data.lens = 25.0
    other.render.resolution_x = 48
    other.potmesil_camera.samples_path = str(tmp_path / "other_####.exr")
    other.frame_set(4)
    scene.frame_set(1)
    blend = tmp_path / "two.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    command = module("operators.command").main
    for name, frame, columns, rate in (("Scene", 1, 96, 4.0), ("Other", 4, 48, 1.0)):
        bpy.ops.wm.open_mainfile(filepath=str(blend))
        out, stored = tmp_path / f"{name}.exr", tmp_path / f"{name}_samples.exr"
        words = ["--scene", name, "--frames", str(frame), "--output", str(out), "--samples", str(stored)]
        assert command(["render", *words, "--no-lens"]) == 0
        samples = module("potmesil_addon.exr").read_samples(stored)
        assert samples.display_window.columns == columns
        (path,) = samples.paths.objects
        camera = samples.paths.camera
        places = [camera.at(t) @ path.at(t)[:, 3] for t in (0.0, 1.0)]
        went = places[1][0] / places[1][2] - places[0][0] / places[0][2]
        assert went == pytest.approx(rate * 0.15 / 4.0 * 96 * 50 / 36 / 5, rel=0.01)
    assert command(["render", "--scene", "Third", "--output", str(out)]) == 3


def test_scene_strips_do_not_stand_in_the_way(scene: Any, module: Any, tmp_path: Path) -> None:
    _small(scene)
    _bar(scene)
    scene.frame_set(1)
    plain, _ = _ours(module, tmp_path / "plain.exr")
    other = bpy.data.scenes.new("Cut")
    editor = other.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_scene("Shot", scene, 1, 1)
    own = scene.sequence_editor_create()
    strips = own.strips if hasattr(own, "strips") else own.sequences
    strips.new_scene("Itself", other, 1, 1)
    scene.render.use_sequencer = True
    picture, _ = _ours(module, tmp_path / "cut.exr")
    np.testing.assert_array_equal(picture, plain)
    assert scene.render.use_sequencer


def test_many_objects_on_one_index_move_each_its_own_way(scene: Any, module: Any, tmp_path: Path) -> None:
    scene.render.resolution_x = scene.render.resolution_y = 128
    scene.cycles.samples = 1
    scene.camera.data.sensor_width = 36.0
    glow = emitter("Glow", (1.0, 1.0, 1.0))
    side = 12
    for n in range(side * side):
        x, z = (n % side - 5.5) * 0.3, (n // side - 5.5) * 0.3
        item = card(scene, f"Card {n}", (x, 5.0, z), 0.15, glow)
        item.pass_index = 32767
        drive(item, "location", 0 if n % 2 else 2, 0.02)
    scene.frame_set(1)
    _, samples = _ours(module, tmp_path / "many.exr")
    layer = samples.layers[0]
    assert len(samples.paths.objects) == side * side
    assert set(np.unique(layer.object_index)) <= {0, 32767}
    tracks = module("potmesil_addon.tracks").assign_tracks(layer, samples)
    seen = layer.object_index == 32767
    scale = 128 * 50.0 / 36.0 / 5.0
    y, x = np.nonzero(seen)
    column, row = np.rint((x + 0.5 - 64) / scale / 0.3 + 5.5), np.rint((64 - y - 0.5) / scale / 0.3 + 5.5)
    expected = [f"Card {int(n)}" for n in row * side + column]
    found = [path.name for path in (samples.paths.objects[n - 1] for n in tracks.track[seen])]
    assert found == expected
    assert set(found) == {path.name for path in samples.paths.objects}
