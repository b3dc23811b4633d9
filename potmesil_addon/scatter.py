"""The scatter of TOG 1982, eq. 22: every sample spread over pixels by its table, sums kept by weight.

Row differences of all samples are added into one band of pixels, then summed along the rows; the cost
of a sample grows with the diameter of its circle. Sums are in double precision: a highlight's rows must
cancel again to far below the picture's dark parts.

Two implementations give the same picture: a numba kernel, band by band on all cores, and a numpy path
for machines without numba.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from . import jit
from .psf import PackedTables, TableAssignment
from .samples import Float32Array

Backend = Literal["auto", "numba", "numpy"]

BACKENDS: Final[tuple[Backend, ...]] = ("auto", "numba", "numpy")

BAND_ROWS: Final = 32
"""Rows of pixels that one thread works on at a time; a band of 1920 pixels fits a core's cache."""

_NO_LIGHT: Final = 1e-12
"""Weight below which no sample reached a pixel; rounding leaves some 1e-16 of the weights around it."""

# Accumulated channels: red, green, blue, alpha, then the weights. With one PSF for all colours there is
# one weight; with one for each primary there are three, and alpha goes with green.
_SHARED_PRIMARY: Final = (0, 0, 0, 0, 0)
_OWN_PRIMARY: Final = (0, 1, 2, 1, 0, 1, 2)


@dataclass(frozen=True, slots=True)
class Scatter:
    """One layer of samples on its way to pixels.

    Parameters
    ----------
    color : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied red, green, blue, alpha of the samples; finite.
    weight : ndarray of float32 of shape (rows, columns)
        Weight of each sample, 0 or more: 1 everywhere, or 1/z^2 (1981, eq. 20).
    assignment : TableAssignment
        Table of each sample.
    tables : PackedTables
        The tables.
    origin : tuple of int
        Column and row of the output at which the samples' first column and row lie.
    shape : tuple of int
        Rows and columns of the output.
    """

    color: Float32Array
    weight: Float32Array
    assignment: TableAssignment
    tables: PackedTables
    origin: tuple[int, int]
    shape: tuple[int, int]


def uses_numba(backend: Backend) -> bool:
    """Return whether a backend means the compiled kernels here.

    Raises
    ------
    RuntimeError
        If numba is asked for and missing.
    """
    if backend == "numba" and not jit.HAVE_NUMBA:
        raise RuntimeError("numba is not available.")
    return jit.HAVE_NUMBA and backend != "numpy"


def scatter(work: Scatter, output: Float32Array, backend: Backend = "auto") -> Iterator[float]:
    """Scatter samples into pixels and divide by the weights, a few bands at a time.

    Parameters
    ----------
    work : Scatter
        Samples, tables and output size.
    output : ndarray of float32 of shape (rows, columns, 4)
        Receives the premultiplied picture. Pixels that no sample reaches become 0.
    backend : {"auto", "numba", "numpy"}
        ``auto`` takes numba where it loads.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Raises
    ------
    RuntimeError
        If numba is asked for and missing.
    """
    if not uses_numba(backend):
        yield from _scatter_numpy(work, output)
        return
    tables, assignment = work.tables, work.assignment
    rows = work.shape[0]
    bands = -(-rows // BAND_ROWS)
    fraction = assignment.fraction
    first_row, last_row = _row_reach(work)
    arguments = (
        work.color,
        work.weight,
        assignment.table,
        np.zeros((0, 0), dtype=np.float32) if fraction is None else fraction,
        fraction is not None,
        first_row,
        last_row,
        tables.first_row,
        tables.rows,
        tables.row_begin,
        tables.row_end,
        tables.offset,
        tables.delta,
        tables.symmetric,
        tables.mirror,
        tuple(range(tables.primaries)),
        work.origin[0],
        work.origin[1],
        output,
    )
    together = jit.set_thread_count(None) * 2
    for first in range(0, bands, together):
        _scatter_bands(first, min(first + together, bands), *arguments)
        yield min(first + together, bands) / bands


def _row_reach(work: Scatter) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the first and last output row that each row of samples reaches."""
    table = work.assignment.table
    top, bottom = work.tables.first_row, work.tables.last_row
    if work.assignment.fraction is not None:
        top = np.minimum(top, np.append(top[1:], top[-1]))
        bottom = np.maximum(bottom, np.append(bottom[1:], bottom[-1]))
    rows = np.arange(table.shape[0]) + work.origin[1]
    return rows + top[table].min(axis=1), rows + bottom[table].max(axis=1)


@jit.kernel(inline=True)
def _add(
    total: Any, row: int, at: int, r: float, g: float, b: float, a: float, w: float,
    delta: Any, e: int, sign: float, primaries: tuple[int, ...],
) -> None:  # fmt: skip
    """Add one entry of a table to the sums of one pixel."""
    d = sign * delta[e, 0]
    if len(primaries) == 1:
        total[row, at, 0] += r * d
        total[row, at, 1] += g * d
        total[row, at, 2] += b * d
        total[row, at, 3] += a * d
        total[row, at, 4] += w * d
    else:
        green, blue = sign * delta[e, 1], sign * delta[e, 2]
        total[row, at, 0] += r * d
        total[row, at, 1] += g * green
        total[row, at, 2] += b * blue
        total[row, at, 3] += a * green
        total[row, at, 4] += w * d
        total[row, at, 5] += w * green
        total[row, at, 6] += w * blue


@jit.kernel()
def _add_table(
    total: Any, t: int, x: int, y: int, r: float, g: float, b: float, a: float, w: float,
    first_row: Any, rows: Any, row_begin: Any, row_end: Any, offset: Any, delta: Any,
    symmetric: bool, mirror: int, primaries: tuple[int, ...],
) -> None:  # fmt: skip
    """Add one sample through table `t` to a band of sums; `y` counts from the band's first row."""
    band_rows, columns = total.shape[0], total.shape[1]
    start = y + first_row[t]
    first = rows[t]
    for j in range(max(0, -start), min(rows[t + 1] - first, band_rows - start)):
        for e in range(row_begin[first + j], row_end[first + j]):
            # What begins left of the frame has begun at its edge; what begins right of it is not seen.
            at = x + offset[e]
            if at < columns:
                _add(total, start + j, max(at, 0), r, g, b, a, w, delta, e, 1.0, primaries)
            if symmetric:
                at = x + mirror - offset[e]
                if at < columns:
                    _add(total, start + j, max(at, 0), r, g, b, a, w, delta, e, -1.0, primaries)


@jit.kernel(parallel=True)
def _scatter_bands(
    first_band: int, end_band: int,
    color: Any, weight: Any, table: Any, fraction: Any, interpolated: bool,
    first_reached: Any, last_reached: Any,
    first_row: Any, rows: Any, row_begin: Any, row_end: Any, offset: Any, delta: Any,
    symmetric: bool, mirror: int, primaries: tuple[int, ...],
    origin_x: int, origin_y: int, output: Any,
) -> None:  # fmt: skip
    """Scatter all samples that reach some bands of the output into them, and divide by the weights.

    A band belongs to one thread and takes its samples in raster order, so the sums do not depend on the
    number of threads. The length of `primaries` is known to the compiler, the shape of `delta` is not:
    a test of the latter in the innermost loop would cost several times as much as the loop.
    """
    height, columns = output.shape[0], output.shape[1]
    channels = 4 + len(primaries)
    for band in jit.prange(first_band, end_band):
        top = band * BAND_ROWS
        bottom = min(top + BAND_ROWS, height)
        total = np.zeros((bottom - top, columns, channels))
        for row in range(color.shape[0]):
            if last_reached[row] < top or first_reached[row] >= bottom:
                continue
            y = row + origin_y - top
            for column in range(color.shape[1]):
                x = column + origin_x
                t = table[row, column]
                after = float(fraction[row, column]) if interpolated else 0.0
                # In single precision, so that times a table's entry the product is exact.
                w: Any = np.float32(weight[row, column] * (1.0 - after))
                r, g = color[row, column, 0] * w, color[row, column, 1] * w
                b, a = color[row, column, 2] * w, color[row, column, 3] * w
                _add_table(
                    total, t, x, y, r, g, b, a, w, first_row, rows, row_begin, row_end, offset, delta,
                    symmetric, mirror, primaries,
                )  # fmt: skip
                if after > 0.0:
                    w = np.float32(weight[row, column] * after)
                    r, g = color[row, column, 0] * w, color[row, column, 1] * w
                    b, a = color[row, column, 2] * w, color[row, column, 3] * w
                    _add_table(
                        total, t + 1, x, y, r, g, b, a, w, first_row, rows, row_begin, row_end, offset,
                        delta, symmetric, mirror, primaries,
                    )  # fmt: skip
        for row in range(bottom - top):
            for column in range(1, columns):
                for c in range(channels):
                    total[row, column, c] += total[row, column - 1, c]
            for column in range(columns):
                for c in range(4):
                    below = total[row, column, 4]
                    if len(primaries) == 3 and c > 0:
                        below = total[row, column, 6 if c == 2 else 5]
                    value = total[row, column, c] / below if below > _NO_LIGHT else 0.0
                    output[top + row, column, c] = value


def _scatter_numpy(work: Scatter, output: Float32Array) -> Iterator[float]:
    """Scatter all samples, table by table and entry by entry."""
    tables, assignment = work.tables, work.assignment
    primary = np.array(_SHARED_PRIMARY if tables.primaries == 1 else _OWN_PRIMARY)
    height, columns = work.shape
    # A margin all round takes what falls outside, so no entry needs a test.
    left = max(0, -work.origin[0]) + tables.reach_x
    right = max(0, work.origin[0] + work.color.shape[1] - columns) + tables.reach_x
    above = max(0, -work.origin[1]) - int(tables.first_row.min())
    below = max(0, work.origin[1] + work.color.shape[0] - height) + int(tables.last_row.max())
    stride = left + columns + right + 1
    total = np.zeros(((above + height + below) * stride, primary.size))
    color, weight = work.color.reshape(-1, 4), work.weight.reshape(-1)
    row, column = np.divmod(np.arange(weight.size), work.color.shape[1])
    place = (row + work.origin[1] + above) * stride + column + work.origin[0] + left
    fraction = None if assignment.fraction is None else assignment.fraction.reshape(-1)
    table = assignment.table.reshape(-1)
    order = np.argsort(table, kind="stable")
    bounds = np.searchsorted(table[order], np.arange(tables.count + 1))

    def add(t: int, samples: npt.NDArray[np.int64], share: npt.NDArray[np.floating]) -> None:
        # In single precision as in the kernel, so that times a table's entry the product is exact.
        w = (weight[samples] * share).astype(np.float32)[:, np.newaxis]
        weights = np.repeat(w, primary.size - 4, axis=1)
        value = np.concatenate([color[samples] * w, weights], axis=1).astype(np.float64)
        _add_samples(tables, t, place[samples], value, stride, primary, total)

    for t in range(tables.count):
        samples = order[bounds[t] : bounds[t + 1]]
        after = np.zeros(samples.size) if fraction is None else fraction[samples].astype(np.float64)
        add(t, samples, 1.0 - after)
        if after.any():
            add(t + 1, samples, after)
        yield (t + 1) / (tables.count + 1)
    picture = np.cumsum(total.reshape(-1, stride, primary.size), axis=1)
    picture = picture[above : above + height, left : left + columns]
    below_line = picture[..., 4 + primary[:4]] if tables.primaries == 3 else picture[..., 4:5]
    output[:] = np.divide(
        picture[..., :4],
        below_line,
        out=np.zeros_like(picture[..., :4]),
        where=below_line > _NO_LIGHT,
    )
    yield 1.0


def _add_samples(
    tables: PackedTables,
    t: int,
    place: npt.NDArray[np.int64],
    value: npt.NDArray[np.float64],
    stride: int,
    primary: npt.NDArray[np.int64],
    total: npt.NDArray[np.float64],
) -> None:
    """Add samples that share a table; no two have the same place, so plain indexing adds them all."""
    for j in range(int(tables.rows[t + 1] - tables.rows[t])):
        r = tables.rows[t] + j
        line = place + (int(tables.first_row[t]) + j) * stride
        for e in range(tables.row_begin[r], tables.row_end[r]):
            change = value * tables.delta[e, primary]
            total[line + tables.offset[e]] += change
            if tables.symmetric:
                total[line + tables.mirror - tables.offset[e]] -= change
