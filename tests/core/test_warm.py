"""The process that compiles kernels for another one: the same ones, from a small part of the frame."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from potmesil_addon import jit, warm
from potmesil_addon.camera import Film
from potmesil_addon.samples import Cryptomatte, SampleLayer, Samples, Window

from .helpers import importable, plain_channels, write_exr

SETTINGS = {
    "use_motion": False,
    "visibility": "none",
    "sensor_width": 0.036,
    "lens": {"focal_length": 0.05, "f_stop": 0.5, "focus_distance": 2.0},
}

FRAME = """
import json, sys
from pathlib import Path
from potmesil_addon import exr, jit
from potmesil_addon.preview import settings_from_json
from potmesil_addon.process import process
from potmesil_addon.progress import run
compiled = []
jit.on_compile(compiled.append)
run(process(exr.read_samples(Path(sys.argv[1])), settings_from_json(json.loads(sys.argv[2]))))
print([name for name in compiled if name.startswith("_")])
"""


def frame(rows: int = 60, columns: int = 100) -> Samples:
    """Return samples that tell where they come from, with a step of depth in one place."""
    rng = np.random.default_rng(0)
    depth = np.full((rows, columns), 9.0, dtype=np.float32)
    depth[30:33, 70:75] = 1.0
    matte = Cryptomatte(
        rng.integers(1, 9, (2, rows, columns)).astype(np.uint32),
        rng.random((2, rows, columns), dtype=np.float32),
    )
    color = rng.random((rows, columns, 4), dtype=np.float32)
    behind = SampleLayer("", 2.0 * color, 2.0 * depth)
    layer = SampleLayer("", color, depth, vector=3.0 * color, hidden=(behind,), cryptomatte=matte)
    window = Window(5, 6, 5 + columns, 6 + rows)
    return Samples((layer,), window, window)


def test_the_part_is_where_depths_differ() -> None:
    samples = frame()
    part = warm.part_of(samples, Film(0.1, 0.06, 100, 60))
    layer, whole = part.layers[0], samples.layers[0]
    assert layer.depth is not None
    assert layer.depth.shape == (24, 24)
    assert sorted(np.unique(layer.depth).tolist()) == [1.0, 9.0]
    cut = np.s_[24:48, 48:72]
    assert np.array_equal(layer.color, whole.color[cut])
    assert layer.vector is not None
    assert np.array_equal(layer.vector, 3.0 * layer.color)
    assert np.array_equal(layer.hidden[0].color, 2.0 * layer.color)
    assert layer.cryptomatte is not None
    assert whole.cryptomatte is not None
    assert np.array_equal(layer.cryptomatte.ids, whole.cryptomatte.ids[:, 24:48, 48:72])
    assert np.array_equal(layer.cryptomatte.coverage, whole.cryptomatte.coverage[:, 24:48, 48:72])
    assert part.data_window == part.display_window == Window(0, 0, 24, 24)
    assert part.film is not None
    assert part.film.pitch_x == pytest.approx(0.001)
    assert part.film.pitch_y == pytest.approx(0.001)


def test_a_small_frame_is_its_own_part() -> None:
    part = warm.part_of(frame(7, 10), None)
    assert part.layers[0].color.shape == (7, 10, 4)
    assert part.film is None


def test_a_frame_without_depth_has_a_part() -> None:
    layer = SampleLayer("", np.ones((40, 50, 4), dtype=np.float32))
    window = Window(0, 0, 50, 40)
    part = warm.part_of(Samples((layer,), window, window), None)
    assert part.layers[0].color.shape == (24, 24, 4)
    assert part.layers[0].depth is None


@pytest.mark.parametrize("arguments", [[], ["nowhere.exr", "{}"], ["a", "b", "c", "d"]])
def test_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert warm.main(arguments) == 2
    assert "usage" in capsys.readouterr().err


def python(*arguments: str, kernels: Path) -> str:
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**importable(), "NUMBA_CACHE_DIR": str(kernels)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not here")
def test_afterwards_a_frame_compiles_nothing(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "samples.exr", plain_channels(50, 70))
    kernels, settings = tmp_path / "kernels", json.dumps(SETTINGS)
    python("-m", "potmesil_addon.warm", str(path), settings, kernels=kernels)
    saved = {file.name for file in kernels.rglob("*.nbc")}
    assert any("_scatter_bands" in name for name in saved)
    assert python("-c", FRAME, str(path), settings, kernels=kernels).strip() == "[]"
    assert {file.name for file in kernels.rglob("*.nbc")} == saved


@pytest.mark.skipif(not jit.HAVE_NUMBA or os.name != "posix", reason="numba is not here, or no shell is")
def test_it_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    """A shell that starts it and goes leaves nothing behind that compiles for half a minute."""
    path = write_exr(tmp_path / "samples.exr", plain_channels(50, 70))
    code = (
        "import os, sys, types\n"
        "from potmesil_addon import warm\n"
        "parents = iter([1, 2])\n"
        "os.getppid = lambda: next(parents)\n"
        "raise SystemExit(warm.main(sys.argv[1:]))\n"
    )
    python("-c", code, str(path), json.dumps(SETTINGS), kernels=tmp_path / "kernels")
    assert not list((tmp_path / "kernels").rglob("*.nbc"))
