"""The scatter of TOG 1982, eq. 22: every sample spread over pixels by its table, sums kept by weight.

Row differences of all samples are added into one band of pixels, then summed along the rows; the cost
of a sample grows with the diameter of its circle. Sums are in double precision: a highlight's rows must
cancel again to far below the picture's dark parts.

Two implementations give the same picture: a numba kernel, band by band on all cores, and a numpy path
for machines without numba.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from . import jit
from .psf import PackedTables, TableAssignment
from .samples import BRIGHT, Float32Array, is_within

Backend = Literal["auto", "numba", "numpy"]

BACKENDS: Final[tuple[Backend, ...]] = ("auto", "numba", "numpy")

BAND_ROWS: Final = 32
"""Rows of pixels that one thread works on at a time; a band of 1920 pixels fits a core's cache."""

_WIDE: Final = 1 << 30
"""Farther left or right than any table."""

_BRIGHT_RANGE: Final = 16
"""Powers of two that lights summed together span at most."""

_NO_LIGHT: Final = 1e-12
"""Weight below which no sample reached a pixel; rounding leaves some 1e-16 of the weights around it."""

# Accumulated channels: red, green, blue, alpha, then the weights. With one PSF for all colours there is
# one weight; with one for each primary there are three, and alpha goes with green.
_SHARED_PRIMARY: Final = (0, 0, 0, 0, 0)
_OWN_PRIMARY: Final = (0, 1, 2, 1, 0, 1, 2)


Marks = tuple[Float32Array, Float32Array]
"""Two more numbers of each sample."""


class Masks(NamedTuple):
    """Which parts of the aperture see samples, in square cells over each sample's circle.

    Parameters
    ----------
    number : ndarray of int32 of shape (sheets, rows, columns)
        Row of `cells` of each sample; -1 for one that spreads over all of its table.
    group : ndarray of uint8 of shape (sheets, rows, columns)
        `WHOLE`, `PARTLY` or `BEHIND`: in which sum a sample counts.
    cells : ndarray of uint16 of shape (masks, 16)
        Bit i of number j: light reaches column i and row j of the cells.
    cuts : ndarray of int32 of shape (tables, 17)
        Columns of each table's pixels at which cells begin, and the last one ends: see `cuts_between_cells`.
    radius_y : ndarray of float64 of shape (tables,)
        Half height in pixels of the square that the cells divide, for each table.
    sharp : ndarray of bool of shape (rows, columns)
        Pixels of the output that a surface in focus covers, to which nothing behind the focus gives light.
    """

    number: npt.NDArray[np.int32]
    group: npt.NDArray[np.uint8]
    cells: npt.NDArray[np.uint16]
    cuts: npt.NDArray[np.int32]
    radius_y: npt.NDArray[np.float64]
    sharp: npt.NDArray[np.bool_]


WHOLE: Final = 0
"""Samples that all of the aperture sees: their weights are exact."""

PARTLY: Final = 1
"""Samples that parts of the aperture see: as exact as the cells are."""

BEHIND: Final = 2
"""The same behind the plane in focus."""

_MOST_GAIN: Final = 2.0
"""Most that what is partly hidden is strengthened by where weights are missing."""

CELLS: Final = 16
"""Cells along each side of the square around a circle; a row of them is a number of a mask."""

_BITS: Final = np.array([int(f"{0x077CB531 << n & 0xFFFFFFFF:032b}"[:5], 2) for n in range(32)]).argsort()
"""Place of a number's only bit, by the five highest bits of its product with de Bruijn's sequence."""

NO_MARKS: Final = (np.zeros((0, 0, 0), dtype=np.float32), np.zeros((0, 0, 0), dtype=np.float32))
"""What kernels get in place of marks."""

_NO_MASKS: Final = Masks(
    np.zeros((0, 0, 0), dtype=np.int32),
    np.zeros((0, 0, 0), dtype=np.uint8),
    np.zeros((0, CELLS), dtype=np.uint16),
    np.zeros((0, CELLS + 1), dtype=np.int32),
    np.zeros(0),
    np.zeros((0, 0), dtype=np.bool_),
)


@dataclass(frozen=True, slots=True)
class Scatter:
    """One layer of samples on its way to pixels.

    Parameters
    ----------
    color : ndarray of float32 of shape (sheets, rows, columns, 4)
        Premultiplied red, green, blue, alpha of the samples; finite.
    weight : ndarray of float32 of shape (sheets, rows, columns)
        Weight of each sample, 0 or more: 1 everywhere, or 1/z^2 (1981, eq. 20).
    assignment : TableAssignment
        Table of each sample, (sheets, rows, columns).
    tables : PackedTables
        The tables.
    origin : tuple of int
        Column and row of the output at which the samples' first column and row lie.
    shape : tuple of int
        Rows and columns of the output.
    masks : Masks, optional
        Which parts of the aperture see each sample; by default all do.
    marks : tuple of two ndarrays of float32 of shape (sheets, rows, columns), optional
        Two more numbers of each sample, to be spread as its colour is.
    """

    color: Float32Array
    weight: Float32Array
    assignment: TableAssignment
    tables: PackedTables
    origin: tuple[int, int]
    shape: tuple[int, int]
    masks: Masks | None = None
    marks: Marks | None = None


def put_in_groups(
    share: Float32Array, radius: Float32Array, in_focus: float, table: npt.NDArray[np.int32],
    is_small: npt.NDArray[np.bool_], number: npt.NDArray[np.int32], weight: Float32Array,
) -> npt.NDArray[np.uint8]:  # fmt: skip
    """Choose the sums in which samples count, and weaken in place those that spread over all of their table.

    Parameters
    ----------
    share : ndarray of float32 of shape (sheets, rows, columns)
        Share of the aperture that sees each sample.
    radius : ndarray of float32 of shape (sheets, rows, columns)
        Signed radii of circles of confusion in pixels.
    in_focus : float
        Largest radius of what is not behind the focus.
    table : ndarray of int32 of shape (sheets, rows, columns)
        Table of each sample.
    is_small : ndarray of bool of shape (tables,)
        Of which tables the parts are not told apart.
    number : ndarray of int32 of shape (sheets, rows, columns)
        See `Masks`; becomes -1 for samples with such a table.
    weight : ndarray of float32 of shape (sheets, rows, columns)
        See `Scatter`; becomes less where a sample that is hidden in parts has no mask.

    Returns
    -------
    ndarray of uint8 of shape (sheets, rows, columns)
        See `Masks`.
    """
    group = np.empty(share.shape, dtype=np.uint8)
    _find_groups(share, radius, in_focus, table, is_small, number, weight, group)
    return group


@jit.kernel(parallel=True)
def _find_groups(
    share: Any, radius: Any, in_focus: float, table: Any, is_small: Any, number: Any, weight: Any, group: Any
) -> None:
    sheets, rows, columns = share.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for sheet in range(sheets):
            for x in range(columns):
                seen = share[sheet, y, x]
                partly = BEHIND if radius[sheet, y, x] > in_focus else PARTLY
                group[sheet, y, x] = WHOLE if seen == 1.0 else partly
                if is_small[table[sheet, y, x]]:
                    number[sheet, y, x] = -1
                if number[sheet, y, x] < 0:
                    weight[sheet, y, x] *= seen


def cuts_between_cells(
    radius_x: npt.NDArray[np.float64], mirror: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """Return at which columns the cells over circles begin and end.

    Parameters
    ----------
    radius_x : ndarray of float64 of shape (tables,)
        Half width in pixels of the square that the cells divide, for each table.
    mirror : ndarray of int32 of shape (tables,)
        Sum of the columns of a pixel and of its mirror image: `PackedTables.mirror`.

    Returns
    -------
    ndarray of int32 of shape (tables, 17)
        The outermost cells have all that is beyond.
    """
    cells = np.arange(CELLS + 1) * (2.0 / CELLS) - 1.0
    cuts = np.floor(cells * radius_x[:, np.newaxis] + 0.5 * mirror[:, np.newaxis] + 0.5).astype(np.int32)
    cuts[:, 0], cuts[:, -1] = -_WIDE, _WIDE
    return cuts


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


def scatter(
    work: Scatter, output: Float32Array, marks: Float32Array | None = None, backend: Backend = "auto"
) -> Iterator[float]:
    """Scatter samples into pixels and divide by the weights, a few bands at a time.

    Parameters
    ----------
    work : Scatter
        Samples, tables and output size.
    output : ndarray of float32 of shape (rows, columns, 4)
        Receives the premultiplied picture. Pixels that no sample reaches become 0.
    marks : ndarray of float32 of shape (rows, columns, 2), optional
        Receives the samples' marks; with green's table where the primaries differ.
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
    if is_within(work.color, BRIGHT):
        yield from _scatter(work, output, marks, backend)
    else:
        yield from _scatter_apart(work, output, marks, backend)


def _scatter_apart(
    work: Scatter, output: Float32Array, marks: Float32Array | None, backend: Backend
) -> Iterator[float]:
    """Scatter samples of which some are too bright to be summed with the others, in steps of brightness.

    A sum cancels to about 1e-16 of the brightest light in it, which must not be seen where that light does
    not reach.
    """
    mark_1, mark_2 = work.marks or np.zeros((2, *work.weight.shape), dtype=np.float32)
    most = np.maximum(np.abs(work.color).max(axis=-1), np.abs(mark_2))
    step = np.where(most > BRIGHT, (np.frexp(most / BRIGHT)[1] + _BRIGHT_RANGE - 1) // _BRIGHT_RANGE, 0)
    steps = np.unique(np.append(step, 0))
    part, parted = np.empty_like(output), np.empty((*work.shape, 2), dtype=np.float32)
    total = np.zeros(output.shape)
    for done, number in enumerate(steps):
        here = step == number
        own = replace(
            work,
            color=np.where(here[..., np.newaxis], work.color, np.float32(0.0)),
            marks=(
                mark_1 if number == 0 else here.astype(np.float32),
                np.where(here, mark_2, np.float32(0.0)),
            ),
        )
        for share in _scatter(own, part, parted, backend):
            yield (done + share) / steps.size
        if number > 0:
            part[parted[..., 0] <= _NO_LIGHT] = 0.0
            parted[parted[..., 0] <= _NO_LIGHT] = 0.0
        total += part
        if marks is not None and number == 0:
            marks[:] = parted
        elif marks is not None:
            marks[..., 1] += parted[..., 1]
    output[:] = total


def _scatter(
    work: Scatter, output: Float32Array, marks: Float32Array | None, backend: Backend
) -> Iterator[float]:
    """Scatter samples whose sums' rounding shows nowhere."""
    if not uses_numba(backend):
        yield from _scatter_numpy(work, output, marks)
        return
    tables, assignment = work.tables, work.assignment
    rows = work.shape[0]
    bands = -(-rows // BAND_ROWS)
    fraction = assignment.fraction
    first_row, last_row = _row_reach(work)
    masks = _NO_MASKS if work.masks is None else work.masks
    arguments = (
        work.color,
        work.weight,
        assignment.table,
        np.zeros((0, 0, 0), dtype=np.float32) if fraction is None else fraction,
        fraction is not None,
        first_row,
        last_row,
        tables.first_row,
        tables.rows,
        tables.row_begin,
        tables.row_end,
        tables.offset,
        tables.delta,
        tables.sums,
        tables.symmetric,
        tables.mirror,
        tuple(range(tables.primaries)),
        () if marks is None else (0, 1),
        work.origin[0],
        work.origin[1],
        masks,
        work.masks is not None,
        *(NO_MARKS if work.marks is None else work.marks),
        output,
        np.zeros((0, 0, 2), dtype=np.float32) if marks is None else marks,
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
    rows = np.arange(table.shape[1]) + work.origin[1]
    first, last = np.empty(rows.size, dtype=np.int64), np.empty(rows.size, dtype=np.int64)
    _extremes(table, top, bottom, first, last)
    return rows + first, rows + last


@jit.kernel(parallel=True)
def _extremes(table: Any, top: Any, bottom: Any, first: Any, last: Any) -> None:
    """Find the least first and the largest last row of the tables in each row of samples."""
    for number in jit.prange(table.shape[1]):
        y: Any = np.int64(number)
        least, most = top[table[0, y, 0]], bottom[table[0, y, 0]]
        for sheet in range(table.shape[0]):
            for x in range(table.shape[2]):
                t = table[sheet, y, x]
                least, most = min(least, top[t]), max(most, bottom[t])
        first[y], last[y] = least, most


@jit.kernel(inline=True)
def _add(
    total: Any, line: int, x: int, r: float, g: float, b: float, a: float, w: float, q: float, d: float,
    delta: Any, e: int, sign: float, primaries: tuple[int, ...], marks: tuple[int, ...],
) -> None:  # fmt: skip
    """Add one entry of a table to the sums of one pixel of the line that begins at `line`.

    What begins left of the frame has begun at its edge. All sums are read before one is written, and their
    places have no sign, so that the compiler adds several channels with one instruction.
    """
    f = sign * delta[e, 0]
    i: Any = np.uint64(line + max(x, 0) * _channels(primaries, marks))
    if len(primaries) == 1:
        t0, t1 = total[i] + r * f, total[i + np.uint64(1)] + g * f
        t2, t3 = total[i + np.uint64(2)] + b * f, total[i + np.uint64(3)] + a * f
        t4 = total[i + np.uint64(4)] + w * f
        if len(marks) == 2:
            t5, t6 = total[i + np.uint64(5)] + q * f, total[i + np.uint64(6)] + d * f
            # Two times four sums are two instructions.
            t7 = total[i + np.uint64(7)] + w * f
            total[i + np.uint64(5)], total[i + np.uint64(6)] = t5, t6
            total[i + np.uint64(7)] = t7
        total[i], total[i + np.uint64(1)] = t0, t1
        total[i + np.uint64(2)], total[i + np.uint64(3)] = t2, t3
        total[i + np.uint64(4)] = t4
    else:
        green, blue = sign * delta[e, 1], sign * delta[e, 2]
        t0, t1 = total[i] + r * f, total[i + np.uint64(1)] + g * green
        t2, t3 = total[i + np.uint64(2)] + b * blue, total[i + np.uint64(3)] + a * green
        t4, t5 = total[i + np.uint64(4)] + w * f, total[i + np.uint64(5)] + w * green
        t6 = total[i + np.uint64(6)] + w * blue
        total[i], total[i + np.uint64(1)] = t0, t1
        total[i + np.uint64(2)], total[i + np.uint64(3)] = t2, t3
        total[i + np.uint64(4)], total[i + np.uint64(5)] = t4, t5
        total[i + np.uint64(6)] = t6
        if len(marks) == 2:
            total[i + np.uint64(7)] += q * green
            total[i + np.uint64(8)] += d * green


@jit.kernel(inline=True)
def _channels(primaries: tuple[int, ...], marks: tuple[int, ...]) -> int:
    """Return the sums of a pixel: colour and alpha, a weight for each primary, marks."""
    if len(marks) == 0:
        return 4 + len(primaries)
    return 8 if len(primaries) == 1 else 9


@jit.kernel()
def _add_part_of_row(
    total: Any, line: int, x: int, columns: int, r: float, g: float, b: float, a: float, w: float,
    q: float, d: float, begin: int, end: int, offset: Any, delta: Any, symmetric: bool, mirror: int,
    primaries: tuple[int, ...], marks: tuple[int, ...], low: int, high: int, run: Any,
) -> None:  # fmt: skip
    """Add what lies from column `low` up to `high` of a table's row.

    It opens with the value that the row has there, follows the row, and closes. `run` has room for two
    entries.
    """
    for p in range(len(primaries)):
        run[0, p] = 0.0
        run[1, p] = 0.0
    for e in range(begin, end):
        for side in range(2 if symmetric else 1):
            at = offset[e] if side == 0 else mirror - offset[e]
            sign = 1.0 if side == 0 else -1.0
            if at <= low:
                for p in range(len(primaries)):
                    run[0, p] += sign * delta[e, p]
            elif at < high and x + at < columns:
                _add(total, line, x + at, r, g, b, a, w, q, d, delta, e, sign, primaries, marks)
            if at < high:
                for p in range(len(primaries)):
                    run[1, p] += sign * delta[e, p]
    for e in range(2):
        at = low if e == 0 else high
        if abs(at) < _WIDE and x + at < columns:
            _add(total, line, x + at, r, g, b, a, w, q, d, run, e, 1.0 - 2.0 * e, primaries, marks)


@jit.kernel(inline=True)
def _add_table(
    total: Any, plane: int, height: int, columns: int,
    t: int, x: int, y: int, r: float, g: float, b: float, a: float, w: float, q: float, d: float,
    first_row: Any, rows: Any, row_begin: Any, row_end: Any, offset: Any, delta: Any, sums: int,
    symmetric: bool, mirror_of: Any, primaries: tuple[int, ...], marks: tuple[int, ...],
    masks: Any, number: int, run: Any,
) -> None:  # fmt: skip
    """Add one sample through table `t` to a band of sums; `y` counts from the band's first row.

    Of a sample with a mask, those parts that it lets through: runs of cells in each row. What begins right
    of the frame is not seen.
    """
    start = y + first_row[t]
    first, mirror = rows[t], mirror_of[t]
    stride = columns * _channels(primaries, marks)
    scale = _rows_of_cells(masks.radius_y[t]) if number >= 0 else 0.0
    for j in range(max(0, -start), min(rows[t + 1] - first, height - start)):
        line = plane + (start + j) * stride
        begin, end = row_begin[first + j], row_end[first + j]
        if begin == end:
            continue
        bits = 1
        if number >= 0:
            down = (first_row[t] + j + 0.5 - 0.5 * mirror) * scale
            bits = int(masks.cells[number, min(max(math.floor(down + 0.5 * CELLS), 0), CELLS - 1)])
        while bits != 0:
            # A carry through the lowest run of bits puts one past its end.
            lowest = bits & -bits
            carried = bits + lowest
            bits &= carried
            low, high = -_WIDE, _WIDE
            if number >= 0:
                low, high = masks.cuts[t, _place_of(lowest)], masks.cuts[t, _place_of(carried & -carried)]
                if low >= high:
                    continue
            # A symmetric table's row is even between its first entry and that one's mirror image. Whatever
            # begins or ends there does so at once, and what does beyond the last entry follows the row.
            inner = offset[begin] if symmetric else 0
            outer = offset[end - 1] if symmetric else _WIDE - 1
            whole_left, whole_right = low < mirror - outer, high > outer
            if not (
                (whole_left or mirror - inner <= low < inner)
                and (whole_right or mirror - inner < high <= inner)
            ):
                _add_part_of_row(
                    total, line, x, columns, r, g, b, a, w, q, d, begin, end, offset, delta, symmetric,
                    mirror, primaries, marks, low, high, run,
                )  # fmt: skip
                continue
            # The left half and the right one: entry by entry, or at once what they add up to.
            for half in range(2):
                e, last, at, step, sign = begin, end, x, 1, 1.0
                if half == 0:
                    if not symmetric:
                        continue
                    at, step, sign = x + mirror, -1, -1.0
                if not (whole_left if half == 0 else whole_right):
                    e, at = sums + first + j, x + (low if half == 0 else high)
                    last = e + 1
                while e < last:
                    if at + step * offset[e] < columns:
                        _add(
                            total, line, at + step * offset[e], r, g, b, a, w, q, d, delta, e, sign,
                            primaries, marks,
                        )  # fmt: skip
                    e += 1


@jit.kernel(inline=True)
def _place_of(bit: int) -> Any:
    """Return the place of a number's only bit."""
    return _BITS[((bit * 0x077CB531) & 0xFFFFFFFF) >> 27]


@jit.kernel(inline=True)
def _rows_of_cells(radius_y: float) -> float:
    """Return the rows of cells in a pixel."""
    return 0.5 * CELLS / max(radius_y, _NO_LIGHT)


@jit.kernel(parallel=True)
def _scatter_bands(
    first_band: int, end_band: int,
    color: Any, weight: Any, table: Any, fraction: Any, interpolated: bool,
    first_reached: Any, last_reached: Any,
    first_row: Any, rows: Any, row_begin: Any, row_end: Any, offset: Any, delta: Any, sums: int,
    symmetric: bool, mirror: Any, primaries: tuple[int, ...], marks: tuple[int, ...],
    origin_x: int, origin_y: int, masks: Any, masked: bool, mark_1: Any, mark_2: Any,
    output: Any, marks_out: Any,
) -> None:  # fmt: skip
    """Scatter all samples that reach some bands of the output into them, and divide by the weights.

    A band belongs to one thread and takes its samples in raster order, so the sums do not depend on the
    number of threads. The length of `primaries` is known to the compiler, the shape of `delta` is not:
    a test of the latter in the innermost loop would cost several times as much as the loop.
    """
    height, columns = output.shape[0], output.shape[1]
    channels = _channels(primaries, marks)
    half = (end_band - first_band + 1) // 2
    for k in jit.prange(end_band - first_band):
        n: Any = np.int64(k)
        # A thread takes numbers that follow each other; bands beside each other have about as much in them.
        top = (first_band + (2 * n if n < half else 2 * (n - half) + 1)) * BAND_ROWS
        bottom = min(top + BAND_ROWS, height)
        # Planes of whole, partly hidden, and hidden samples behind the focus: most need only the first.
        size = (bottom - top) * columns * channels
        total = np.zeros(3 * size if masked else size)
        run = np.zeros((2, len(primaries)))
        for row in range(color.shape[1]):
            if last_reached[row] < top or first_reached[row] >= bottom:
                continue
            y = row + origin_y - top
            for sheet in range(color.shape[0]):
                for column in range(color.shape[2]):
                    whole = weight[sheet, row, column]
                    if whole == 0.0:
                        continue
                    x = column + origin_x
                    number = masks.number[sheet, row, column] if masked else -1
                    plane = size * masks.group[sheet, row, column] if masked else 0
                    after = float(fraction[sheet, row, column]) if interpolated else 0.0
                    for further in range(2 if after > 0.0 else 1):
                        t = table[sheet, row, column] + further
                        # In single precision, so that times a table's entry the product is exact.
                        w: Any = np.float32(whole * (after if further == 1 else 1.0 - after))
                        r, g = color[sheet, row, column, 0] * w, color[sheet, row, column, 1] * w
                        b, a = color[sheet, row, column, 2] * w, color[sheet, row, column, 3] * w
                        q: Any = np.float32(0.0)
                        d: Any = np.float32(0.0)
                        if len(marks) == 2:
                            q, d = mark_1[sheet, row, column] * w, mark_2[sheet, row, column] * w
                        _add_table(
                            total, plane, bottom - top, columns, t, x, y, r, g, b, a, w, q, d, first_row,
                            rows, row_begin, row_end, offset, delta, sums, symmetric, mirror, primaries,
                            marks, masks, number, run,
                        )  # fmt: skip
        for row in range(bottom - top):
            line = row * columns * channels
            for first in range(line, total.size, size):
                for i in range(first + channels, first + columns * channels):
                    total[i] += total[i - channels]
            for column in range(columns):
                behind = masked and not masks.sharp[top + row, column]
                i = line + column * channels
                for c in range(4 + len(marks)):
                    at, sum_of = 4, c
                    if len(primaries) == 3 and c > 0:
                        at = 6 if c == 2 else 5
                    if c >= 4:
                        sum_of += len(primaries)
                    light, below = total[i + sum_of], total[i + at]
                    if masked:
                        more, partly = total[size + i + sum_of], total[size + i + at]
                        if behind:
                            more += total[2 * size + i + sum_of]
                            partly += total[2 * size + i + at]
                        gain = _gain(below, partly)
                        light, below = light + gain * more, below + gain * partly
                    value = light / below if below > _NO_LIGHT else 0.0
                    if c < 4:
                        output[top + row, column, c] = value
                    elif len(marks) == 2:
                        marks_out[top + row, column, c - 4] = value


@jit.kernel(inline=True)
def _gain(whole: float, partly: float) -> float:
    """Return what the weight of partly hidden samples is to be multiplied by, so that all add up to 1.

    What is seen whole is exact, and what is hidden in parts is as exact as the cells: it is what is left.
    """
    return min(max((1.0 - whole) / max(partly, _NO_LIGHT), 0.0), _MOST_GAIN)


def _scatter_numpy(work: Scatter, output: Float32Array, marks: Float32Array | None) -> Iterator[float]:
    """Scatter all samples, table by table and entry by entry."""
    tables, assignment = work.tables, work.assignment
    primary = np.array(_SHARED_PRIMARY if tables.primaries == 1 else _OWN_PRIMARY)
    if marks is not None:
        primary = np.append(primary, primary[[1, 1]])
    height, columns = work.shape
    sheets, sample_rows, sample_columns = work.weight.shape
    # A margin takes what falls outside, so that few entries need a test: no wider than the picture, since
    # circles may be far larger.
    left = max(0, -work.origin[0]) + min(tables.reach_x, columns + sample_columns)
    right = max(0, work.origin[0] + sample_columns - columns) + min(tables.reach_x, columns + sample_columns)
    stride = left + columns + right + 1
    grid = _Grid(height, stride, left)
    totals = np.zeros((3, height * stride, primary.size))
    row, column = np.divmod(np.arange(sample_rows * sample_columns), sample_columns)
    place = (row + work.origin[1]) * stride + column + work.origin[0] + left
    for sheet in range(sheets):
        color, weight = work.color[sheet].reshape(-1, 4), work.weight[sheet].reshape(-1)
        fraction = None if assignment.fraction is None else assignment.fraction[sheet].reshape(-1)
        used = np.flatnonzero(weight > 0.0)
        table = assignment.table[sheet].reshape(-1)[used]
        order = used[np.argsort(table, kind="stable")]
        bounds = np.searchsorted(np.sort(table), np.arange(tables.count + 1))
        for t in range(tables.count):
            samples = order[bounds[t] : bounds[t + 1]]
            after = np.zeros(samples.size) if fraction is None else fraction[samples].astype(np.float64)
            for n, share in ((t, 1.0 - after), (t + 1, after)):
                if not share.any():
                    continue
                # In single precision as in the kernel, so that times a table's entry the product is exact.
                w = (weight[samples] * share).astype(np.float32)[:, np.newaxis]
                marked = [mark[sheet].reshape(-1, 1)[samples] * w for mark in work.marks or ()]
                values = [color[samples] * w, np.repeat(w, tables.primaries, axis=1), *marked]
                value = np.concatenate(values, axis=1).astype(np.float64)
                if work.masks is None:
                    _add_samples(tables, n, place[samples], value, grid, primary, totals[0])
                    continue
                number = work.masks.number[sheet].reshape(-1)[samples]
                group = work.masks.group[sheet].reshape(-1)[samples]
                for g, total in enumerate(totals):
                    which = np.flatnonzero((group == g) & (number < 0))
                    _add_samples(tables, n, place[samples[which]], value[which], grid, primary, total)
                    which = np.flatnonzero((group == g) & (number >= 0))
                    cells, at = work.masks.cells[number[which]], place[samples[which]]
                    _add_masked(tables, n, at, value[which], grid, primary, total, work.masks, cells)
            yield (sheet + (t + 1) / (tables.count + 1)) / sheets
    added = np.cumsum(totals.reshape(3, -1, stride, primary.size), axis=2)
    whole, partly, behind = added[:, :, left : left + columns]
    sums = np.r_[0:4, 4 + tables.primaries : primary.size]
    weights = 4 + primary[sums]
    light, below_line = whole[..., sums], whole[..., weights]
    if work.masks is not None:
        partly = partly + np.where(work.masks.sharp[..., np.newaxis], 0.0, behind)
        gain = np.clip((1.0 - below_line) / np.maximum(partly[..., weights], _NO_LIGHT), 0.0, _MOST_GAIN)
        light, below_line = light + gain * partly[..., sums], below_line + gain * partly[..., weights]
    values = np.divide(light, below_line, out=np.zeros_like(light), where=below_line > _NO_LIGHT)
    output[:] = values[..., :4]
    if marks is not None:
        marks[:] = values[..., 4:]
    yield 1.0


class _Grid(NamedTuple):
    """Rows of the picture with a margin on either side, one after the other.

    Parameters
    ----------
    rows : int
        Rows of the picture.
    stride : int
        Pixels of a row with its margins.
    left : int
        Pixels of the left margin.
    """

    rows: int
    stride: int
    left: int

    def met(self, place: npt.NDArray[np.int64], down: int) -> slice:
        """Return which of places in rising order lie in the picture's rows once they are moved down."""
        first, last = np.searchsorted(place, [-down * self.stride, (self.rows - down) * self.stride])
        return slice(int(first), int(last))

    def add(
        self,
        total: npt.NDArray[np.float64],
        line: npt.NDArray[np.int64],
        at: int,
        value: npt.NDArray[np.float64],
    ) -> None:
        """Add values `at` columns beside places, no two of them the same.

        What begins left of the margin has begun at its edge, and what begins right of it is not seen.
        """
        column = line % self.stride + at
        inside = (column >= 0) & (column < self.stride)
        if inside.all():
            total[line + at] += value
            return
        total[line[inside] + at] += value[inside]
        before = column < 0
        np.add.at(total, line[before] // self.stride * self.stride, value[before])


def _add_samples(
    tables: PackedTables,
    t: int,
    place: npt.NDArray[np.int64],
    value: npt.NDArray[np.float64],
    grid: _Grid,
    primary: npt.NDArray[np.int64],
    total: npt.NDArray[np.float64],
) -> None:
    """Add samples that share a table; no two have the same place, so plain indexing adds them all."""
    for j in range(int(tables.rows[t + 1] - tables.rows[t])):
        down = int(tables.first_row[t]) + j
        met = grid.met(place, down)
        if met.start == met.stop:
            continue
        line, lit = place[met] + down * grid.stride, value[met]
        offset, delta = _row_entries(tables, t, j)
        for at, entry in zip(offset.tolist(), delta, strict=True):
            grid.add(total, line, at, lit * entry[primary])


def _row_entries(
    tables: PackedTables, t: int, j: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Return the entries of a table's row, both halves."""
    row = int(tables.rows[t]) + j
    entries = slice(tables.row_begin[row], tables.row_end[row])
    offset, delta = tables.offset[entries].astype(np.int64), tables.delta[entries]
    if tables.symmetric:
        offset = np.concatenate([offset, tables.mirror[t] - offset])
        delta = np.concatenate([delta, -delta])
    return offset, delta


def _add_masked(
    tables: PackedTables,
    t: int,
    place: npt.NDArray[np.int64],
    value: npt.NDArray[np.float64],
    grid: _Grid,
    primary: npt.NDArray[np.int64],
    total: npt.NDArray[np.float64],
    masks: Masks,
    cells: npt.NDArray[np.uint16],
) -> None:
    """Add samples that share a table through their masks, cell by cell."""
    scale = _rows_of_cells(float(masks.radius_y[t]))
    for j in range(int(tables.rows[t + 1] - tables.rows[t])):
        met = grid.met(place, int(tables.first_row[t]) + j)
        if met.start == met.stop:
            continue
        down = (int(tables.first_row[t]) + j + 0.5 - 0.5 * int(tables.mirror[t])) * scale
        cell_row = math.floor(down + 0.5 * CELLS)
        row_bits = cells[met, min(max(cell_row, 0), CELLS - 1)]
        line, light = place[met] + (int(tables.first_row[t]) + j) * grid.stride, value[met]
        offset, delta = _row_entries(tables, t, j)
        for cell in range(CELLS):
            lit = np.flatnonzero(row_bits >> cell & 1)
            low, high = masks.cuts[t, cell], masks.cuts[t, cell + 1]
            if lit.size == 0 or low >= high:
                continue
            before, within = offset <= low, (offset > low) & (offset < high)
            entries = [(low, delta[before].sum(axis=0)), *zip(offset[within], delta[within], strict=True)]
            entries.append((high, -delta[offset < high].sum(axis=0)))
            for at, entry in entries:
                if abs(at) < _WIDE:
                    grid.add(total, line[lit], int(at), light[lit] * entry[primary])
