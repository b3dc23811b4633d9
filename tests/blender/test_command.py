"""The extension's command on .blend files, and the demo."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import png as pypng
import pytest

from sample_scenes.building import emitter

from .conftest import ROOT
from .scenes import card

OpenEXR = pytest.importorskip("OpenEXR")


@pytest.fixture
def blend(scene: Any, tmp_path: Path) -> Path:
    """A saved .blend file with an animated card."""
    item = card(scene, "Card", (0.0, 5.0, 0.0), 1.0, emitter("Glow", (1.0, 0.5, 0.25)))
    item.location.x = -1.0
    item.keyframe_insert("location", frame=1)
    item.location.x = 1.0
    item.keyframe_insert("location", frame=3)
    path = tmp_path / "animated scene.blend"
    scene.potmesil_camera.samples_path = "//passes/####.exr"
    scene.frame_end = 1
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_render_writes_every_frame(blend: Path, module: Any, capsys: Any, tmp_path: Path) -> None:
    main = module("operators.command").main
    output = tmp_path / "out" / "post_####.exr"
    assert main(["render", "--frames", "1-3:2", "--output", str(output), "--psf", "disc"]) == 0
    lines = capsys.readouterr().out.splitlines()
    centers = []
    for frame in (1, 3):
        path = tmp_path / "out" / f"post_{frame:04d}.exr"
        assert f"Saved: '{path}'" in lines
        header = OpenEXR.File(str(path)).header()
        assert header["aperture"] == pytest.approx(0.5)
        pixels = next(iter(OpenEXR.File(str(path)).channels().values())).pixels
        centers.append(pixels[..., 0].sum(axis=0).argmax())
    assert centers[0] < 48 < centers[1]
    assert sorted(p.name for p in (tmp_path / "passes").iterdir()) == ["0001.exr", "0003.exr"]
    assert sum(line.startswith("Time: ") for line in lines) == 2
    assert "openjd_progress: 100.0" in lines
    assert any(line.startswith("Note: Passes Off: Z, Vector, Object Index.") for line in lines)


def test_options_win_over_the_camera(blend: Path, module: Any, tmp_path: Path) -> None:
    main = module("operators.command").main
    assert main(["render", "--output", str(tmp_path / "x.exr"), "--fstop", "2", "--focus-distance", "7"]) == 0
    header = OpenEXR.File(str(tmp_path / "x.exr")).header()
    assert header["aperture"] == pytest.approx(2.0)
    assert header["focus"] == pytest.approx(7.0)


def test_command_follows_the_panel_where_no_option_speaks(blend: Path, module: Any, tmp_path: Path) -> None:
    main = module("operators.command").main
    bpy.context.scene.potmesil_camera.use_lens = False
    assert main(["render", "--output", str(tmp_path / "sharp.exr")]) == 0
    bpy.context.scene.potmesil_camera.use_lens = True
    bpy.context.scene.potmesil_camera.coc_model = "paper"
    bpy.context.scene.potmesil_camera.visibility = "none"
    assert main(["render", "--output", str(tmp_path / "paper.exr")]) == 0
    words = ["--coc-model", "cycles", "--visibility", "aperture"]
    assert main(["render", "--output", str(tmp_path / "cycles.exr"), *words]) == 0
    lens = {
        name: OpenEXR.File(str(tmp_path / f"{name}.exr")).header().get("potmesil:lens", "")
        for name in ("sharp", "paper", "cycles")
    }
    assert lens["sharp"] == ""
    assert '"coc_model": "paper"' in lens["paper"]
    assert '"coc_model": "cycles"' in lens["cycles"]
    assert '"visibility": "none"' in lens["paper"]
    assert '"visibility": "aperture"' in lens["cycles"]


def test_the_printer_follows_the_panel_frame_by_frame(blend: Path, module: Any, tmp_path: Path) -> None:
    own = bpy.context.scene.potmesil_camera
    for frame, fade, defocus in ((1, 0.25, 0.0), (3, 1.0, 6.0)):
        own.fade, own.uniform_defocus = fade, defocus
        own.keyframe_insert("fade", frame=frame)
        own.keyframe_insert("uniform_defocus", frame=frame)
    main = module("operators.command").main
    words = ["--no-lens", "--no-motion", "--output"]
    assert main(["render", "--frames", "1,3", *words, str(tmp_path / "a####.exr")]) == 0
    for name in ("a0001", "a0003"):
        samples = tmp_path / "passes" / f"{name[1:]}.exr"
        assert main(["process", str(samples), *words, str(tmp_path / f"{name}_plain.exr")]) == 0
    dim, soft, bright, sharp = (
        OpenEXR.File(str(tmp_path / f"{name}.exr")).channels()["RGBA"].pixels[..., 0]
        for name in ("a0001", "a0003", "a0001_plain", "a0003_plain")
    )
    assert dim.max() == pytest.approx(0.25 * bright.max(), rel=1e-6)
    # A circle of 6 mm on a film of 36 mm is 16 of 96 pixels wide, and softens the card's edge by as much.
    row = soft[32] / sharp.max()
    assert 12 <= int(((row > 0.02) & (row < 0.98)).sum()) <= 40


def test_effects_follow_the_panel_frame_by_frame_and_options_win(
    blend: Path, module: Any, tmp_path: Path
) -> None:
    exposure = bpy.context.scene.potmesil_camera.effects.exposure
    exposure.use = True
    for frame, density in ((1, 1.0), (3, 3.0)):
        exposure.density = density
        exposure.keyframe_insert("density", frame=frame)
    main = module("operators.command").main
    words = ["--no-lens", "--no-motion"]
    assert main(["render", "--frames", "1,3", *words, "--output", str(tmp_path / "a####.exr")]) == 0
    options = ["--effect", "exposure.density=2", "--effect", "vignetting"]
    assert main(["render", "--frames", "1", *words, *options, "--output", str(tmp_path / "b.exr")]) == 0
    assert (
        main(["render", "--frames", "1", *words, "--effect", "exposure=off", "-o", str(tmp_path / "c.exr")])
        == 0
    )

    def read(name: str) -> Any:
        return OpenEXR.File(str(tmp_path / f"{name}.exr"))

    one, three, two, off = (
        read(name).channels()["RGBA"].pixels[..., 0].max() for name in ("a0001", "a0003", "b", "c")
    )
    assert one / three == pytest.approx(4.0, rel=1e-3)
    # Near the middle there is hardly any vignetting.
    assert one / two == pytest.approx(2.0, rel=3e-2)
    said = json.loads(read("b").header()["potmesil:effects"])
    assert set(said) == {"exposure", "vignetting"}
    assert said["exposure"]["normal_ev"] == pytest.approx(exposure.normal_ev)
    assert "potmesil:effects" not in read("c").header()
    # f/2.8 or whatever the camera has, half a frame of 24: the exposure value says by how much.
    f_stop = bpy.context.scene.camera.data.dof.aperture_fstop
    stops = exposure.normal_ev - 1.0 - np.log2(f_stop**2 * 48.0)
    assert one / off == pytest.approx(2.0**stops, rel=1e-3)


def test_keys_of_options_are_looked_up_at_each_frame(blend: Path, module: Any, tmp_path: Path) -> None:
    main = module("operators.command").main
    words = ["--output", str(tmp_path / "k####.exr"), "--focus-distance", "1=4,3=8"]
    assert main(["render", "--frames", "1-3", *words]) == 0
    focus = [OpenEXR.File(str(tmp_path / f"k{n:04d}.exr")).header()["focus"] for n in (1, 2, 3)]
    assert focus == pytest.approx([4.0, 16.0 / 3.0, 8.0])


def test_samples_go_where_they_are_told_and_process_again(blend: Path, module: Any, tmp_path: Path) -> None:
    main = module("operators.command").main
    samples = tmp_path / "kept.exr"
    assert main(["render", "--output", str(tmp_path / "a.png"), "--samples", str(samples)]) == 0
    assert main(["process", str(samples), "-o", str(tmp_path / "b.png")]) == 0
    # As everywhere in Blender, // is the file's folder.
    assert main(["process", f"//{samples.relative_to(tmp_path)}", "-o", "//c.png"]) == 0
    assert (tmp_path / "c.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    one, other = (pypng.Reader(filename=str(tmp_path / f"{name}.png")).asDirect() for name in "ab")
    assert np.array_equal(np.vstack(list(one[2])), np.vstack(list(other[2])))
    assert main(["info", str(samples)]) == 0


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["render", "--frame-retries", "-1"], 2),
        (["render", "--max-memory", "0"], 2),
        (["render", "--existing", "guess"], 2),
        (["render", "--frames", "3-1", "--output", "x.exr"], 2),
        (["render", "--frames", "a", "--output", "x.exr"], 2),
        (["render", "--output", "x.jpg"], 2),
        (["render", "--output", "x.exr", "--scene", "Nowhere"], 3),
        (["render", "--output", "x.exr", "--fstop", "-1"], 2),
        (["nonsense"], 2),
        (["--help"], 0),
        (["render", "--help"], 0),
    ],
)
def test_usage_ends_in_its_exit_status(
    blend: Path, module: Any, capsys: Any, arguments: list[str], status: int
) -> None:
    assert module("operators.command").main(arguments) == status
    assert "Traceback" not in capsys.readouterr().err


def test_missing_blend_file_is_wrong_input(scene: Any, module: Any, capsys: Any) -> None:
    assert module("operators.command").main(["render", "--output", "x.exr"]) == 3
    assert capsys.readouterr().err.count("\n") == 1


def test_script_runs_the_command_without_the_extension_installed(blend: Path, tmp_path: Path) -> None:
    code = (
        "import bpy, runpy, sys; bpy.ops.wm.open_mainfile(filepath=sys.argv[1]); "
        f"runpy.run_path({str(ROOT / 'farm' / 'run.py')!r}, run_name='__main__')"
    )
    output = tmp_path / "####.png"
    command = [
        sys.executable,
        "-c",
        code,
        str(blend),
        "--",
        "render",
        "--frames",
        "2",
        "--output",
        str(output),
    ]
    # Kernels of a package of their own take longer to compile than all else here.
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "tests" / "without_numba")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "0002.png").stat().st_size > 100


def test_demo_writes_its_pictures(tmp_path: Path) -> None:
    command = [
        sys.executable,
        *("-m", "sample_scenes.demo", "--output", str(tmp_path), "--percentage", "10", "--samples", "2"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in ("pinhole", "f5.6", "f11", "f22"):
        assert (tmp_path / f"{name}.png").stat().st_size > 1000
    assert "f/11: sharp from 495 to 618 mm" in done.stdout
