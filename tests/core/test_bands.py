"""Pictures made in bands are those made at once, to the bit, and keep to the memory they may have."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from potmesil_addon import bands, focus
from potmesil_addon.bands import Need, divide
from potmesil_addon.camera import Film
from potmesil_addon.effects import Distortion, Effects
from potmesil_addon.errors import EXIT_MEMORY, MemoryLimitError
from potmesil_addon.process import ProcessSettings, Result, process
from potmesil_addon.progress import run
from potmesil_addon.psf import PsfSettings
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window
from potmesil_addon.shutter import ShutterAttributes

from .helpers import importable

ROWS, COLUMNS = 480, 24


def view(generator: np.random.Generator, nearest: float, cards: int, *, moves: bool = False) -> SampleLayer:
    """Return random cards before a wall, some slanted, with lights."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    depth = 6.0 + 0.002 * y
    color = np.ones((ROWS, COLUMNS, 4))
    color[..., :3] = (0.3 + 0.2 * np.sin(x / 3.0) * np.cos(y / 5.0))[..., np.newaxis]
    vector, index = np.zeros((ROWS, COLUMNS, 4)), np.zeros((ROWS, COLUMNS), dtype=np.int32)
    for number in range(cards):
        row, column = generator.uniform(0, ROWS), generator.uniform(0, COLUMNS)
        z = generator.uniform(nearest, 5.0) + generator.uniform(-1e-3, 1e-3) * (y - row)
        there = (abs(y - row) < generator.uniform(2, 60)) & (abs(x - column) < generator.uniform(1, 12))
        there &= z < depth
        depth[there], index[there] = z[there], number + 1
        color[there, :3] = generator.uniform(0, 1, 3)
        travel = generator.uniform(-6, 6, 2) if number % 3 == 0 else np.zeros(2)
        vector[there] = [*-travel, *travel]
    color[generator.random((ROWS, COLUMNS)) < 0.003, :3] *= 40.0
    return SampleLayer(
        "",
        color.astype(np.float32),
        depth.astype(np.float32),
        index,
        vector.astype(np.float32) if moves else None,
    )


def scene(seed: int, *, hidden: bool = False, mirror: bool = False, **others: Any) -> Samples:
    """Return a tall scene whose circles are small, so that bands need not all of it."""
    generator = np.random.default_rng(seed)
    moves = bool(others.pop("moves", False))
    layer = view(generator, 1.2, 12, moves=moves)
    if hidden:
        layer = replace(layer, hidden=(view(generator, 3.0, 6),))
    if mirror:
        seen = view(generator, 3.0, 6)
        alpha = np.where(np.arange(ROWS) % 160 < 60, np.float32(0.5), np.float32(0.0))[:, np.newaxis]
        light = seen.color * alpha[..., np.newaxis]
        light[..., 3] = alpha
        depth = np.where(alpha > 0.0, seen.depth, np.float32(np.inf)).astype(np.float32)
        layer = replace(layer, color=np.maximum(layer.color, light), reflected=SampleLayer("", light, depth))
    data = Window(0, 0, COLUMNS, ROWS)
    display = others.pop("display", data)
    film = Film(display.columns * 1e-4, display.rows * 1e-4, display.columns, display.rows)
    lens = LensAttributes(0.05, others.pop("f_stop", 8.0), 2.0)
    shutter = ShutterAttributes(frames=0.5)
    return Samples((layer,), data, display, lens=lens, film=film, shutter=shutter, **others)


def in_bands(samples: Samples, wanted: ProcessSettings, height: int) -> tuple[Result, int]:
    """Return a picture made in bands of some height, and in how many."""
    made = []

    def at_height(rows: int, *_: Any) -> list[tuple[int, int]]:
        made.append(-(-rows // height))
        return [(first, min(first + height, rows)) for first in range(0, rows, height)]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(focus, "divide", at_height)
        patched.setattr(Need, "fits", lambda *_: False)
        limit = replace(wanted, max_memory=1 << 60)
        return run(process(samples, limit)), max(made)


def assert_same(samples: Samples, wanted: ProcessSettings, height: int) -> None:
    """Make a picture at once and in bands, and compare all there is of it."""
    whole = run(process(samples, wanted))
    result, count = in_bands(samples, wanted, height)
    assert count > 1
    for name in ("picture", "guessed", "predicted_error"):
        np.testing.assert_array_equal(getattr(result, name), getattr(whole, name), err_msg=name)
    of_time = ("seconds",)
    assert {k: v for k, v in result.report.items() if k not in of_time} == {
        k: v for k, v in whole.report.items() if k not in of_time
    }


@settings(max_examples=10)
@given(
    seed=st.integers(0, 1000),
    height=st.integers(1, 240),
    visibility=st.sampled_from(["aperture", "aperture", "none"]),
    f_stop=st.sampled_from([4.0, 8.0, 16.0]),
    others=st.sampled_from(
        [
            {},
            {"position": "corner"},
            {"display": Window(2, 7, 22, 459)},
            {"supersampling": 2},
            {"hidden": True},
        ]
    ),
)
def test_bands_make_the_same_picture(
    seed: int, height: int, visibility: Any, f_stop: float, others: dict[str, Any]
) -> None:
    # The picture's rows stay so many that bands are a part of them.
    samples = scene(seed, f_stop=f_stop, **others)
    assert_same(samples, ProcessSettings(visibility=visibility), max(height, 12))


@pytest.mark.parametrize(
    ("of_scene", "wanted"),
    [
        ({"moves": True}, {}),
        ({"moves": True}, {"visibility": "none"}),
        ({"mirror": True}, {}),
        ({}, {"psf": PsfSettings(lookup="interpolated")}),
        ({}, {"visibility": "none", "weighting": "1981"}),
        ({}, {"psf": PsfSettings(kind="lommel")}),
        ({}, {"lens": LensAttributes(blades=5)}),
        ({}, {"effects": Effects(distortion=Distortion(k1=0.02))}),
        ({}, {"backend": "numpy"}),
    ],
)
def test_bands_of_every_kind_are_the_same(of_scene: dict[str, Any], wanted: dict[str, Any]) -> None:
    assert_same(scene(7, **of_scene), ProcessSettings(**wanted), 150)


def test_band_depends_on_rows_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its margin a band is another picture: the comparison can fail."""
    monkeypatch.setattr(focus, "_margin", lambda *_: 0)
    samples, wanted = scene(7), ProcessSettings()
    whole, (result, _) = run(process(samples, wanted)), in_bands(samples, wanted, 50)
    assert not np.array_equal(result.picture, whole.picture)


def test_fewest_bands_that_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bands, "resident", lambda: 1000)
    need = Need(fixed=100, row=10, kept=1, survey=2)
    assert divide(400, 400, 20, need, 1000 + 100 + 400 * 11) == [(0, 400)]
    assert divide(400, 400, 20, need, 1000 + 100 + 400 + 256 * 10) == [(0, 200), (200, 400)]
    assert len(divide(400, 400, 20, need, 1000 + 100 + 400 + 255 * 10)) == 3


@pytest.mark.parametrize("margin", [None, 20, 5000])
def test_what_does_not_fit_is_refused(monkeypatch: pytest.MonkeyPatch, margin: int | None) -> None:
    monkeypatch.setattr(bands, "resident", lambda: 1 << 30)
    need = Need(fixed=0, row=1 << 20, kept=0, survey=0)
    with pytest.raises(
        MemoryLimitError, match=r"takes \d+\.\d\d GiB of memory and 1\.01 GiB is all"
    ) as caught:
        divide(400, 400, margin, need, int(1.01 * 2**30))
    assert caught.value.exit_status == EXIT_MEMORY == 33


@pytest.mark.parametrize("moves", [False, True])
def test_processing_refuses(moves: bool) -> None:
    with pytest.raises(MemoryLimitError):
        run(process(scene(1, moves=moves), ProcessSettings(use_lens=not moves, max_memory=1 << 20)))


_CAPPED = """
import json, resource, sys
import numpy as np
from dataclasses import replace
from potmesil_addon import focus
from potmesil_addon.memory import peak, resident
from potmesil_addon.camera import Film
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window

rows, columns, more = map(int, sys.argv[1:])
y, x = np.ogrid[:rows, :columns]
near = (x // 97 + y // 71) % 2 == 0
depth = np.where(near, 1.5, 8.0).astype(np.float32)
color = np.ones((rows, columns, 4), dtype=np.float32)
color[..., 0] = np.where(near, 0.8, 0.2)
window = Window(0, 0, columns, rows)
film = Film(0.036, 0.02025, columns, rows)
lens = LensAttributes(0.05, 16.0, 3.0)
samples = Samples((SampleLayer("", color, depth),), window, window, lens=lens, film=film)
limit = resident() + more
made, divide = [], focus.divide
focus.divide = lambda *all: made.append(divide(*all)) or made[-1]
run(process(samples, ProcessSettings(max_memory=limit)))
print(json.dumps([limit, peak(), len(made[0])]))
"""


_PLENTY = 10**10


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is in other units elsewhere")
def test_limit_is_kept() -> None:
    def made(rows: int, columns: int, more: int) -> tuple[int, int, int]:
        command = [sys.executable, "-c", _CAPPED, str(rows), str(columns), str(more)]
        done = subprocess.run(command, env=importable(), capture_output=True, text=True, check=True)
        limit, peak, count = json.loads(done.stdout.splitlines()[-1])
        return limit, peak, count

    # Compilers take memory too, where kernels are not yet on disk: a process of its own leaves them there.
    made(400, 32, _PLENTY)
    made(1080, 1920, 290 * 10**6)
    limit, peak, count = made(1080, 1920, 290 * 10**6)
    assert count > 1
    assert peak <= limit
