"""The benchmark of speed: what it reads in machine code, counts for a frame, and makes of times."""

import math
import platform
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

numba = pytest.importorskip("numba")
pytest.importorskip("matplotlib")

import machine_code  # noqa: E402
import roofline  # noqa: E402
import speed_report  # noqa: E402
import speed_runs  # noqa: E402
from speed_runs import Case  # noqa: E402

from potmesil_addon.camera import Film  # noqa: E402
from potmesil_addon.process import ProcessSettings, focus_settings  # noqa: E402
from potmesil_addon.psf import PsfBuilder  # noqa: E402
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window  # noqa: E402

VECTORS = """
f:
\txorl\t%eax, %eax
.LBB0_1:
\tvmovsd\t(%rdi), %xmm0
.LBB0_2:
\tvmulps\t(%rsi,%rax), %ymm1, %ymm2
\tvaddps\t%ymm2, %ymm3, %ymm3
\taddq\t$32, %rax
\tjne\t.LBB0_2
\tvaddsd\t%xmm0, %xmm1, %xmm1
\tdecq\t%rcx
\tjne\t.LBB0_1
\tretq
"""

NUMBERS = """
g:
.LBB1_1:
\tcallq\tNRT_MemInfo_alloc_safe_aligned
\tvaddss\t%xmm0, %xmm1, %xmm1
\tje\t.LBB1_1
\tvfmadd213sd\t%xmm0, %xmm1, %xmm2
\tjne\t.LBB1_1
\tvaddsd\t%xmm0, %xmm1, %xmm1
\tretq
"""

COPY = """
h:
.LBB2_1:
\tmovq\t(%rsi), %rax
\tjne\t.LBB2_1
"""


def test_only_the_innermost_loop_counts():
    (loop,) = machine_code.innermost_loops(VECTORS)
    assert (loop.packed, loop.single, loop.bits, loop.calls) == (2, 0, 256, ())
    assert loop.vectorised
    assert not loop.allocates


def test_a_loop_reaches_to_its_last_jump_back():
    (loop,) = machine_code.innermost_loops(NUMBERS)
    assert (loop.packed, loop.single, loop.bits) == (0, 2, 0)
    assert not loop.vectorised
    assert loop.allocates


def test_loops_without_arithmetic_are_left_out():
    assert machine_code.innermost_loops(COPY) == []


def test_a_loop_that_numba_makes_is_recognised():
    def plus(a, b):
        for i in range(a.size):
            a[i] += b[i]

    def running(a):
        for i in range(1, a.size):
            a[i] += a[i - 1]

    if platform.machine().lower() not in ("x86_64", "amd64"):
        pytest.skip("the instructions are those of x86-64")
    array = numba.float32[::1]
    fast = numba.njit((array, array))(plus).inspect_asm()
    slow = numba.njit((array,))(running).inspect_asm()
    assert any(loop.vectorised for text in fast.values() for loop in machine_code.innermost_loops(text))
    loops = [loop for text in slow.values() for loop in machine_code.innermost_loops(text)]
    assert loops
    assert not any(loop.vectorised for loop in loops)


@pytest.fixture
def samples():
    rng = np.random.default_rng(1)
    depth = rng.uniform(0.5, 8.0, (12, 20)).astype(np.float32)
    color = rng.uniform(0.0, 1.0, (12, 20, 4)).astype(np.float32)
    return Samples(
        layers=(SampleLayer("", color, depth),),
        data_window=Window(0, 0, 20, 12),
        display_window=Window(0, 0, 20, 12),
        lens=LensAttributes(focal_length=0.05, f_stop=4.0, focus_distance=1.6),
        film=Film(0.0018, 0.00108, 20, 12),
    )


def test_operations_are_those_of_every_entry(samples):
    settings = ProcessSettings(use_motion=False, visibility="none")
    focus = focus_settings(samples, settings)
    builder = PsfBuilder(focus.lens, focus.film, focus.model, focus.psf)
    assignment = builder.assign(samples.layers[0].depth)
    tables = list(builder.tables(assignment.circles))
    added = 0
    for t in assignment.table.ravel():
        for begin, end in zip(tables[t].row_begin, tables[t].row_end, strict=True):
            added += (2 if tables[t].symmetric else 1) * int(end - begin)
    work = roofline.work_of(samples, settings)
    pixels = 12 * 20
    # Five channels: a product and a sum for each entry, a sum along the row; then four divisions.
    assert work.operations == pytest.approx(10 * added + 5 * pixels + 4 * pixels)
    assert work.bytes == pixels * 4 * (4 + 1 + 4)
    assert work.added_bytes == pytest.approx(2 * 4 * 5 * (added + pixels))


def test_least_seconds_are_those_of_the_slower_side():
    limits = roofline.Limits(memory=10.0, cache=100.0, single=50.0, double=25.0, threads=2)
    assert roofline.Work(100.0, 10.0, 0.0).least_seconds(limits) == 2.0
    assert roofline.Work(10.0, 40.0, 0.0).least_seconds(limits) == 4.0
    assert roofline.Work(10.0, 40.0, 900.0).cache_seconds(limits) == 9.0


def test_growth_compares_with_half_the_radius():
    assert speed_report.growth({8: 1.0, 16: 2.0, 64: 9.0}) == {16: 2.0}


def test_times_within_the_noise_of_what_was_subtracted_are_none():
    peers = [
        {"name": "gegl r8", "size": "960x540", "seconds": 0.01, "empty": 0.4},
        {"name": "gegl r32", "size": "960x540", "seconds": 0.2, "empty": 0.4},
        {"name": "defocus r64", "size": "960x540", "left_out": 400.0, "cap": 300.0},
    ]
    assert speed_report.peers_of({"peers": peers}, "gegl") == {("960x540", 32): 0.2}
    assert speed_report.peers_of({"peers": peers}, "defocus") == {}


def test_targets_follow_from_the_medians():
    def one(case, seconds):
        values = {"size": case.size, "stage": case.stage, "psf": case.psf}
        values |= {"visibility": case.visibility, "radius": case.radius}
        return {"case": values, "seconds": seconds, "busy": 0.95, "instants": []}

    results = {
        "ours": [
            one(Case("1920x1080", "lens", "disc", "none", 32), 0.5),
            one(Case("1920x1080", "lens", "disc", "aperture", 32), 2.0),
            one(Case("3840x2160", "lens", "disc", "none", 32), 1.9),
        ],
        "peers": [{"name": "defocus r32", "size": "1920x1080", "seconds": 54.0}],
    }
    told = {what: (value, reached) for what, _, value, reached in speed_report.targets(results)}
    assert told["Defocus / lens stage, 1920x1080, radius 32, visibility none"] == (pytest.approx(108.0), True)
    assert told["Defocus / lens stage, 1920x1080, radius 32, visibility aperture"] == (27.0, False)
    assert told["Defocus / lens stage, 1920x1080, radius 64, visibility none"] == (None, None)
    assert told["Time a pixel, larger over smaller frame, most"] == (pytest.approx(0.95), True)
    assert "**no**" in speed_report.report(results)


def test_the_f_stop_gives_the_radius_that_is_asked_for(samples):
    facts = {"f_stop": 4.0, "largest_radius": 8.0}
    settings = speed_runs.settings_of(Case("20x12", "lens", "disc", "none", 32), facts)
    assert settings.lens.f_stop == pytest.approx(1.0)
    assert settings.use_lens
    assert not settings.use_motion


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="needs Linux")
def test_the_peak_begins_anew():
    held = np.ones(40_000_000 // 8)
    del held
    if not speed_runs._forget_peak():
        pytest.skip("the system does not let the peak begin anew")
    before = speed_runs.resident()
    assert speed_runs.peak_resident() - before < 10_000_000
    held = np.ones(80_000_000 // 8)
    assert speed_runs.peak_resident() - before == pytest.approx(80_000_000, rel=0.1)
    assert math.isfinite(held[0])
