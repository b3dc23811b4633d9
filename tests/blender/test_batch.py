"""Batches of a scene's frames: stages, restarts, output settings, videos, signals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .conftest import ROOT
from .scenes import card

OpenEXR = pytest.importorskip("OpenEXR")


@pytest.fixture
def blend(scene: Any, tmp_path: Path) -> Path:
    """A saved .blend file of three small frames with an animated card."""
    scene.render.resolution_x, scene.render.resolution_y = 48, 32
    item = card(scene, "Card", (0.0, 5.0, 0.0), 1.0, emitter("Glow", (1.0, 0.5, 0.25)))
    for frame, x in ((1, -1.0), (3, 1.0)):
        item.location.x = x
        item.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    scene.potmesil_camera.samples_path = "//passes/####.exr"
    scene.render.filepath = "//out/film_####"
    scene.render.image_settings.file_format = "OPEN_EXR"
    path = tmp_path / "a scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def run(module: Any, capsys: Any) -> Any:
    """Run the command, expect an exit status, and return its lines."""

    def runner(*words: object, status: int = 0) -> list[str]:
        capsys.readouterr()
        ended = module("operators.command").main([str(word) for word in words])
        said = capsys.readouterr()
        assert ended == status, said.err
        assert status == 0 or said.err.count("\n") == 1
        return said.out.splitlines() + said.err.splitlines()

    return runner


def saved(lines: list[str]) -> list[str]:
    """Names of the files that were written."""
    return [Path(line[8:-1]).name for line in lines if line.startswith("Saved: '")]


def skipped(lines: list[str]) -> list[str]:
    """Names of the files that were there."""
    prefix = 'Skipping existing frame "'
    return [Path(line[len(prefix) : -1]).name for line in lines if line.startswith(prefix)]


def pixels(path: Path) -> Any:
    """A picture's values."""
    return next(iter(OpenEXR.File(str(path)).channels().values())).pixels


def test_stages_one_by_one_give_what_render_gives(blend: Path, run: Any, tmp_path: Path) -> None:
    names = [f"{frame:04d}.exr" for frame in (1, 2, 3)]
    whole, parts = tmp_path / "whole" / "####.exr", tmp_path / "parts" / "####.exr"
    assert saved(run("render", "--output", whole)) == names
    # The scene's own frames are the default.
    assert skipped(run("passes")) == names
    assert saved(run("process", "--output", parts)) == names
    for name in names:
        assert (whole.parent / name).read_bytes() == (parts.parent / name).read_bytes()
    other = tmp_path / "samples" / "s_####.exr"
    assert saved(run("passes", "--samples", other, "--frames=2")) == ["s_.exr".replace("_", "_0002")]
    again = tmp_path / "again.exr"
    assert saved(run("process", "--samples", other, "--frames=2", "--output", again)) == ["again.exr"]
    assert again.read_bytes() == (whole.parent / names[1]).read_bytes()


def test_only_what_is_missing_or_made_otherwise_is_made_again(blend: Path, run: Any, tmp_path: Path) -> None:
    output = tmp_path / "o" / "####.exr"
    run("render", "--output", output, "--frames=1-2")
    passes = tmp_path / "passes"
    times = {path.name: path.stat().st_mtime_ns for path in passes.iterdir()}
    lines = run("render", "--output", output)
    assert (skipped(lines), saved(lines)) == (["0001.exr", "0002.exr"], ["0003.exr"])
    # Another f-stop needs no other samples.
    bpy.context.scene.camera.data.dof.aperture_fstop = 2.0
    lines = run("render", "--output", output, "--frames=1-2")
    assert saved(lines) == ["0001.exr", "0002.exr"]
    assert sum(line.startswith("Stale: ") for line in lines) == 2
    assert {name: (passes / name).stat().st_mtime_ns for name in times} == times
    # Samples of done pictures may go.
    (passes / "0001.exr").unlink()
    assert skipped(run("render", "--output", output, "--frames=1")) == ["0001.exr"]
    # Other render settings need others.
    bpy.context.scene.cycles.samples = 5
    assert saved(run("passes", "--frames=2")) == ["0002.exr"]
    assert (passes / "0002.exr").stat().st_mtime_ns != times["0002.exr"]
    kept = run("render", "--output", output, "--frames=2", "--existing=keep")
    assert skipped(kept) == ["0002.exr"]
    assert any(line.startswith("Stale: ") and line.endswith("it is kept.") for line in kept)


def test_a_file_that_was_cut_off_is_made_again(blend: Path, run: Any, tmp_path: Path) -> None:
    output = tmp_path / "o.exr"
    words = ("render", "--output", output, "--frames=2")
    run(*words)
    whole = output.read_bytes()
    output.write_bytes(whole[: len(whole) // 2])
    samples = tmp_path / "passes" / "0002.exr"
    samples.write_bytes(samples.read_bytes()[:-20])
    lines = run(*words)
    assert f"Damaged: '{output}' is not whole; it is made again." in lines
    assert output.read_bytes() == whole
    assert skipped(run("passes", "--frames=2")) == ["0002.exr"]


def test_the_scene_writes_as_its_output_says(blend: Path, run: Any, tmp_path: Path) -> None:
    scene = bpy.context.scene
    scene.render.image_settings.color_depth, scene.render.image_settings.exr_codec = "16", "DWAA"
    assert saved(run("render")) == [f"film_{frame:04d}.exr" for frame in (1, 2, 3)]
    path = tmp_path / "out" / "film_0002.exr"
    assert OpenEXR.File(str(path)).header()["compression"] == OpenEXR.DWAA_COMPRESSION
    own = tmp_path / "own.exr"
    run("process", "--output", own, "--frames=2")
    half = pixels(path)
    assert half.dtype == np.float16
    assert np.abs(half[..., :3] - pixels(own)[..., :3]).max() < 0.02
    assert len(skipped(run("process"))) == 3
    scene.render.image_settings.file_format = "PNG"
    assert saved(run("process", "--frames=2")) == ["film_0002.png"]
    assert skipped(run("process", "--frames=2")) == ["film_0002.png"]
    scene.view_settings.exposure = 1.0
    assert saved(run("process", "--frames=2")) == ["film_0002.png"]
    # A JPEG cannot say how it was made.
    scene.render.image_settings.file_format = "JPEG"
    assert saved(run("process", "--frames=2")) == ["film_0002.jpg"]
    assert saved(run("process", "--frames=2")) == ["film_0002.jpg"]
    assert skipped(run("process", "--frames=2", "--existing=keep")) == ["film_0002.jpg"]
    assert not list((tmp_path / "out").glob(".*"))


def test_the_compositor_writes_where_there_is_a_stage(blend: Path, run: Any, tmp_path: Path) -> None:
    assert bpy.ops.potmesil.add_stage() == {"FINISHED"}
    assert saved(run("render", "--frames=2")) == ["film_0002.exr"]
    plain = tmp_path / "plain.exr"
    run("process", "--frames=2", "--output", plain)
    assert np.abs(pixels(tmp_path / "out" / "film_0002.exr") - pixels(plain)).max() < 1e-3
    assert skipped(run("render", "--frames=2")) == ["film_0002.exr"]


def test_the_scene_is_as_it_was(blend: Path, run: Any, tmp_path: Path) -> None:
    scene = bpy.context.scene
    scene.frame_set(2)
    item = bpy.data.objects["Card"]
    item.location.x = 0.125
    threads = scene.render.threads_mode, scene.render.threads
    run("render", "--frames=1,3", "--output", tmp_path / "####.exr", "--threads", "1", "--no-motion")
    assert scene.frame_current == 2
    assert item.location.x == pytest.approx(0.125)
    assert (scene.render.threads_mode, scene.render.threads) == threads
    assert scene.potmesil_camera.use_motion


def test_a_video_of_the_frames(blend: Path, run: Any, tmp_path: Path) -> None:
    run("render", "--output", tmp_path / "f" / "####.exr")
    scenes = {scene.name for scene in bpy.data.scenes}
    target = tmp_path / "a film.mp4"
    assert saved(run("movie", "--input", tmp_path / "f" / "####.exr", "--output", target)) == ["a film.mp4"]
    assert {scene.name for scene in bpy.data.scenes} == scenes
    clip = bpy.data.movieclips.load(str(target))
    assert (clip.frame_duration, tuple(clip.size)) == (3, (48, 32))
    # The card goes from the left to the right.
    strip_scene = bpy.data.scenes.new("Look")
    editor = strip_scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_movie("Film", str(target), channel=1, frame_start=1)
    strip_scene.render.resolution_x, strip_scene.render.resolution_y = 48, 32
    strip_scene.view_settings.view_transform = "Standard"
    strip_scene.frame_start, strip_scene.frame_end = 1, 3
    strip_scene.render.filepath = str(tmp_path / "look_####.png")
    bpy.ops.render.render(scene="Look", animation=True)
    middles = []
    for frame in (1, 3):
        image = bpy.data.images.load(str(tmp_path / f"look_{frame:04d}.png"))
        values = np.array(image.pixels[:]).reshape(32, 48, 4)[..., 0]
        middles.append((values.sum(axis=0) * np.arange(48)).sum() / values.sum())
    assert middles[0] < 20.0
    assert middles[1] > 28.0


def test_a_video_has_no_holes(blend: Path, run: Any, tmp_path: Path) -> None:
    run("render", "--output", tmp_path / "f" / "####.exr")
    (tmp_path / "f" / "0002.exr").unlink()
    words = ("movie", "--input", tmp_path / "f" / "####.exr", "--output", tmp_path / "film.mp4")
    assert any("0002.exr' is missing" in line for line in run(*words, status=3))
    assert not (tmp_path / "film.mp4").exists()
    run("movie", "--input", tmp_path / "f" / "####.exr", "--output", tmp_path / "film.txt", status=2)
    run("movie", "--input", tmp_path / "f" / "a.exr", "--output", tmp_path / "film.mp4", status=2)
    bpy.context.scene.render.filepath = "//film"
    if hasattr(bpy.context.scene.render.image_settings, "media_type"):
        bpy.context.scene.render.image_settings.media_type = "VIDEO"
    bpy.context.scene.render.image_settings.file_format = "FFMPEG"
    assert any("command movie" in line for line in run("render", status=3))


def test_a_render_that_fails_is_tried_again(
    blend: Path, run: Any, module: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    batch = module("operators.scene_batch")
    render = batch._render

    def fails_once(scene: Any) -> Any:
        calls.append(scene.frame_current)
        if len(calls) == 1:
            raise batch.PotmesilError("Blender could not render: no luck")
        return render(scene)

    monkeypatch.setattr(batch, "_render", fails_once)
    report = tmp_path / "job.json"
    words = ("render", "--frames=1-2", "--output", tmp_path / "####.exr", "--job-report", report)
    main = module("operators.command").main
    assert main([str(word) for word in (*words, "--frame-retries", 1)]) == 0
    said = json.loads(report.read_text())
    assert [(item["frame"], item["status"], item["attempts"]) for item in said["frames"]] == [
        (1, "made", 2),
        (2, "made", 1),
    ]
    assert {*calls[2:]} == {1, 2}


def test_missing_samples_name_the_frame(blend: Path, run: Any, tmp_path: Path) -> None:
    lines = run("process", "--frames=2", "--output", tmp_path / "o.exr", status=3)
    assert any(line.startswith("Error: Frame 2: ") and "0002.exr' does not exist" in line for line in lines)


def test_sigterm_ends_a_batch_within_its_grace(blend: Path, tmp_path: Path) -> None:
    bpy.context.scene.cycles.samples = 4000
    bpy.context.scene.render.resolution_x = 640
    bpy.context.scene.frame_end = 50
    bpy.ops.wm.save_mainfile()
    script = ROOT / "farm" / "run.py"
    command = [sys.executable, script, "--blend", blend, "render", "--output", tmp_path / "o" / "####.exr"]
    with subprocess.Popen(
        [str(word) for word in command],
        cwd="/",
        env={name: value for name, value in os.environ.items() if name != "HOME"},
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("openjd_status: rendering frame 1"):
                break
        time.sleep(1.0)
        asked = time.monotonic()
        process.send_signal(signal.SIGTERM)
        process.stdout.read()
        # Blender renders in C, and dies of the signal; a shell calls that 143.
        assert process.wait() in (143, -signal.SIGTERM)
    assert time.monotonic() - asked < 5.0
    left = list((tmp_path / "o").iterdir()) if (tmp_path / "o").is_dir() else []
    assert all(not path.name.startswith(".") and pixels(path).size for path in left)


def test_a_missing_blend_file_is_wrong_input(tmp_path: Path) -> None:
    words = [sys.executable, str(ROOT / "farm" / "run.py"), "--blend", str(tmp_path / "none.blend"), "render"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert "none.blend" in done.stderr
    assert "Traceback" not in done.stderr
