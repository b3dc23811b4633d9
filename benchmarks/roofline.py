"""How fast this machine can be, and how much a frame asks of it: the two sides of a roofline.

What a frame needs is counted from its tables and not from the code that does it: additions of the entries of
all samples' tables, sums along the rows, divisions, and the bytes of what is read and written once.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numba import njit, prange

from potmesil_addon.blocks import put_in_blocks
from potmesil_addon.focus import FocusSettings
from potmesil_addon.process import ProcessSettings, focus_settings
from potmesil_addon.psf import PsfBuilder
from potmesil_addon.samples import SampleLayer, Samples

_CHANNELS = 5
"""Red, green, blue, alpha and the weight."""

_BYTES_READ = 4 * 5
"""Colour and depth of a sample, in single precision."""

_BYTES_WRITTEN = 4 * 4

_VECTOR_BYTES = 4 * 4
"""Of a sample's motion."""

_QUAD_OPERATIONS = 2 * 6 + 2 + 6
"""Of a pixel at an instant: six values interpolated both ways, a comparison of depths, a sum."""

_LARGE = 1 << 24
"""Numbers of 8 bytes in each array that is far larger than a cache."""

_SMALL = 1 << 13
"""Numbers of 8 bytes in each of three arrays, for each thread, that stay in the nearer caches."""

_LANES = 1024
_CHAIN = 16
_ROUNDS = 40_000
_TRIES = 7


@dataclass(frozen=True, slots=True)
class Limits:
    """What the machine can do, all cores together.

    Parameters
    ----------
    memory : float
        Bytes a second to and from memory (a = b + s c over large arrays).
    cache : float
        The same over arrays that stay in the caches.
    single, double : float
        Floating-point operations a second in single and double precision, on vectors, a multiplication and
        an addition fused counting as two.
    threads : int
        How many took part.
    """

    memory: float
    cache: float
    single: float
    double: float
    threads: int


@dataclass(frozen=True, slots=True)
class Work:
    """What a frame asks for at least.

    Parameters
    ----------
    operations : float
        Additions, multiplications and divisions of floating-point numbers.
    bytes : float
        What must be read from and written to memory once.
    added_bytes : float
        What must be read from and written to the sums, which caches hold: in single precision.
    """

    operations: float
    bytes: float
    added_bytes: float

    def least_seconds(self, limits: Limits) -> float:
        """Return the seconds below which no program can do this work on a machine, in single precision."""
        return max(self.operations / limits.single, self.bytes / limits.memory)

    def cache_seconds(self, limits: Limits) -> float:
        """Return the seconds below which no program can that keeps its sums in the caches."""
        return max(self.least_seconds(limits), self.added_bytes / limits.cache)

    @property
    def intensity(self) -> float:
        """Operations a byte of memory."""
        return self.operations / self.bytes


def work_of(samples: Samples, settings: ProcessSettings, instants: int = 0) -> Work:
    """Count what a frame needs.

    Of visibility nothing is counted: it is what the picture asks for beyond the papers, and has no least
    amount. Of motion, every sample is drawn once at every instant.

    Parameters
    ----------
    samples : Samples
        With one layer.
    settings : ProcessSettings
        Which processors, and how.
    instants : int
        How many are averaged, for motion.

    Returns
    -------
    Work
        The counts.
    """
    layer = samples.layers[0]
    assert layer.depth is not None
    pixels = layer.depth.size
    times = max(instants, 1) if settings.use_motion else 1
    count = read = added = 0.0
    if settings.use_lens:
        entries = entries_a_sample(layer, focus_settings(samples, settings))
        channels = _CHANNELS + 2 * (settings.psf.kind == "lommel")
        # Each entry is a multiplication and an addition; then a sum along the row and a division.
        count += pixels * times * (2 * channels * entries + channels + 4)
        added += pixels * times * 2 * 4 * channels * (entries + 1)
    if settings.use_motion:
        count += pixels * times * _QUAD_OPERATIONS
        read += pixels * _VECTOR_BYTES
        added += pixels * times * 2 * 4 * 6
    return Work(count, read + pixels * (_BYTES_READ + _BYTES_WRITTEN), added)


def entries_a_sample(layer: SampleLayer, settings: FocusSettings) -> float:
    """Return how many entries of tables are added, blocks of samples being one, for each sample of a layer.

    Parameters
    ----------
    layer : SampleLayer
        With depths.
    settings : FocusSettings
        Lens, film and kind of PSF.

    Returns
    -------
    float
        Entries.
    """
    builder = PsfBuilder(settings.lens, settings.film, settings.model, settings.psf)
    assert layer.depth is not None
    color, weight = layer.color[np.newaxis].copy(), np.ones((1, *layer.depth.shape), dtype=np.float32)
    assignment = builder.assign(layer.depth[np.newaxis])
    assignment, side = put_in_blocks(color, weight, assignment, builder, compiled=True)
    tables = builder.pack(list(builder.tables(assignment.circles, side)))
    uses = np.bincount(assignment.table[weight > 0.0], minlength=tables.count)
    before = np.concatenate([[0], np.cumsum(tables.row_end - tables.row_begin)])
    entries = before[tables.rows[1:]] - before[tables.rows[:-1]]
    return float(uses @ entries) * (2 if tables.symmetric else 1) / layer.depth.size


def measured_limits() -> Limits:
    """Measure the machine: the best of some tries, on all threads.

    Returns
    -------
    Limits
        What it reaches.
    """
    threads = numba.get_num_threads()
    a, b, c = (np.full(_LARGE, value) for value in (0.0, 1.0, 2.0))
    memory = 3 * a.nbytes / _best(lambda: _triad(a, b, c, 3.0))
    small = [np.full((threads, _SMALL), value) for value in (0.0, 1.0, 2.0)]
    repeats = 2000
    cache = 3 * repeats * small[0].nbytes / _best(lambda: _triad_again(*small, 3.0, repeats))

    def rate(kernel: Any, dtype: Any) -> float:
        values = np.full((threads, _LANES), 1.0, dtype=dtype)
        factor, term = dtype(0.999), dtype(0.001)
        seconds = _best(lambda: kernel(values, factor, term, _ROUNDS))
        return 2.0 * threads * _LANES * _CHAIN * _ROUNDS / seconds

    return Limits(
        memory=memory,
        cache=cache,
        single=rate(_fused, np.float32),
        double=rate(_fused, np.float64),
        threads=threads,
    )


def _best(run: Callable[[], Any]) -> float:
    """Return the least seconds of some tries, compiling left out."""
    run()
    found = []
    for _ in range(_TRIES):
        started = time.perf_counter()
        run()
        found.append(time.perf_counter() - started)
    return min(found)


@njit(parallel=True)
def _triad(a: Any, b: Any, c: Any, factor: float) -> None:
    for i in prange(a.size):
        a[i] = b[i] + factor * c[i]


@njit(parallel=True)
def _triad_again(a: Any, b: Any, c: Any, factor: float, repeats: int) -> None:
    for thread in prange(a.shape[0]):
        for n in range(repeats):
            for i in range(a.shape[1]):
                a[thread, i] = b[thread, i] + factor * c[thread, i]
            # Another value in each round, so that no round can be left out.
            b[thread, n % b.shape[1]] = n


@njit(parallel=True, fastmath={"contract"})
def _fused(values: Any, factor: Any, term: Any, rounds: int) -> None:
    """Work on eight chains of vectors side by side: fused, and none has to wait for its own last result."""
    part = _LANES // 8
    for thread in prange(values.shape[0]):
        own = values[thread]
        for _ in range(rounds):
            for i in range(part):
                a, b, c, d = own[i], own[i + part], own[i + 2 * part], own[i + 3 * part]
                e, f, g, h = own[i + 4 * part], own[i + 5 * part], own[i + 6 * part], own[i + 7 * part]
                for _ in range(_CHAIN):
                    a, b, c, d = a * factor + term, b * factor + term, c * factor + term, d * factor + term
                    e, f, g, h = e * factor + term, f * factor + term, g * factor + term, h * factor + term
                own[i], own[i + part], own[i + 2 * part], own[i + 3 * part] = a, b, c, d
                own[i + 4 * part], own[i + 5 * part], own[i + 6 * part], own[i + 7 * part] = e, f, g, h
