"""Exact pixel coverage of an aperture's image: ellipses and regular polygons, as sparse rows.

A uniformly lit circle of confusion is constant inside and zero outside, so along a row of pixels its
coverage changes only at the rim. A shape is therefore kept as *row differences*: where the coverage of
a pixel differs from that of the pixel to its left, and by how much. Their running sum along the row is
the coverage again. A shape of radius r has O(r) differences and O(r^2) pixels.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from .lens import FloatArray

IntArray = npt.NDArray[np.int64]

SamplePosition = Literal["center", "corner"]
"""Where samples lie on the pixel grid: at pixel centres (Blender) or at pixel corners (the papers)."""

SAMPLE_POSITIONS: Final[tuple[SamplePosition, ...]] = ("center", "corner")

_KEPT_BYTES: Final = 128 << 20
"""Most memory of tables that are kept for the next frame."""

_POINT: Final = 1e-9
"""Radius in pixels below which a shape is a point."""


@dataclass(frozen=True, slots=True)
class RowDifferences:
    """A point-spread function on the pixel grid as differences along its rows.

    Offsets count pixels from the sample: its own pixel for samples at pixel centres; for samples at
    corners, the pixel to the right of and below the corner. x is to the right, y down.

    Parameters
    ----------
    first_row : int
        Offset of the first row.
    row_begin, row_end : ndarray of int64 of shape (rows,)
        The entries of each row; rows that mirror each other share theirs.
    offset : ndarray of int64 of shape (entries,)
        Horizontal offset of the pixel at which the value changes.
    delta : ndarray of float64 of shape (entries, primaries)
        Change of value, for one PSF common to all colours or for three.
    position : {"center", "corner"}
        Where samples lie on the pixel grid.
    symmetric : bool
        Only the right half is kept: an entry (offset, delta) stands for itself and for
        (`mirror` - offset, -delta).
    block : int
        Side of the square of samples that the shape is the mean of, seen from the upper left one.
    """

    first_row: int
    row_begin: IntArray
    row_end: IntArray
    offset: IntArray
    delta: FloatArray
    position: SamplePosition
    symmetric: bool
    block: int = 1

    @property
    def mirror(self) -> int:
        """Sum of the offsets of an entry and of its mirror image."""
        return self.block if self.position == "center" else self.block - 1

    @property
    def nbytes(self) -> int:
        """Memory of the table in bytes."""
        return sum(int(a.nbytes) for a in (self.row_begin, self.row_end, self.offset, self.delta))

    def dense(self) -> FloatArray:
        """Return the pixel values.

        Returns
        -------
        ndarray of float64 of shape (primaries, rows, columns)
            Values with the sample in the middle (centre samples: odd sizes, corner samples: even
            sizes), so columns and rows beyond the shape may be 0.
        """
        rows = self.row_begin.size
        # From -reach to +reach for centres, from -reach to reach - 1 for corners.
        reach = int(max((self.offset - self.mirror).max(), 0))
        if not self.symmetric:
            reach = max(reach, -int(self.offset.min()))
        columns = 2 * reach + self.mirror
        values = np.zeros((self.delta.shape[1], rows, columns + 1))
        for row in range(rows):
            entries = slice(self.row_begin[row], self.row_end[row])
            at, delta = self.offset[entries], self.delta[entries].T
            # Offsets of one row differ, so plain indexing adds them all.
            values[:, row, at + reach] += delta
            if self.symmetric:
                values[:, row, self.mirror - at + reach] -= delta
        return np.asarray(np.cumsum(values, axis=2)[:, :, :columns])


class KeptTables:
    """Tables of the last frames, as many as fit; the next frame has circles of the same steps."""

    def __init__(self) -> None:
        self._tables: OrderedDict[Hashable, RowDifferences] = OrderedDict()
        self._bytes = 0

    def clear(self) -> None:
        """Forget all tables."""
        self._tables.clear()
        self._bytes = 0

    def get(self, key: Hashable, make: Callable[[], RowDifferences]) -> RowDifferences:
        """Return the table of a key, made where it is not kept."""
        kept = self._tables.get(key)
        if kept is not None:
            self._tables.move_to_end(key)
            return kept
        table = make()
        self._tables[key] = table
        self._bytes += table.nbytes
        while self._bytes > _KEPT_BYTES:
            self._bytes -= self._tables.popitem(last=False)[1].nbytes
        return table


KEPT_TABLES: Final = KeptTables()
"""Tables that take long to make, of all kinds."""


def ellipse_rows(radius_x: float, radius_y: float, position: SamplePosition = "center") -> RowDifferences:
    """Return the exact pixel coverage of an axis-parallel ellipse, normalised to 1 (TOG 1982, eq. 24).

    Parameters
    ----------
    radius_x, radius_y : float
        Semi-axes in pixels, 0 or more. An ellipse without area is a point spread over its pixel (over
        the four pixels around a corner).
    position : {"center", "corner"}
        Where the middle lies on the pixel grid.

    Returns
    -------
    RowDifferences
        One quadrant's rows and right half, shared by symmetry.
    """
    rx, ry = max(radius_x, _POINT), max(radius_y, _POINT)
    half = 0.5 if position == "center" else 0.0
    mirror = 1 if position == "center" else 0
    # Row j >= 0 covers |y| from max(0, j - half) to j + 1 - half; the middle row lies on both sides.
    rows = math.ceil(ry + half)
    j = np.arange(rows)
    y_low, y_high = np.maximum(j - half, 0.0) / ry, (j + 1 - half) / ry
    x_full = rx * np.sqrt(np.clip(1.0 - y_high**2, 0.0, None))
    x_out = rx * np.sqrt(np.clip(1.0 - y_low**2, 0.0, None))
    # Columns before `first` are covered whole, columns after `last` not at all.
    first = np.floor(x_full + half).astype(np.int64)
    last = np.maximum(np.ceil(x_out + half).astype(np.int64) - 1, first)
    row, i = ragged(first, last - first + 2)
    left, right = (i - half) / rx, (i + 1 - half) / rx
    bottom, top = (j[row] - half) / ry, y_high[row]
    coverage = (
        _disc_area(right, top) - _disc_area(left, top) - _disc_area(right, bottom) + _disc_area(left, bottom)
    ) / math.pi
    before = np.concatenate([[0.0], coverage[:-1]])
    before[np.searchsorted(row, j)] = 1.0 / (math.pi * rx * ry)
    delta = coverage - before
    # The middle column has no left neighbour within the right half, and mirrored it has no difference.
    keep = i >= 1
    row, i, delta = row[keep], i[keep], delta[keep]
    end = np.searchsorted(row, j, side="right")
    begin = np.searchsorted(row, j, side="left")
    below = slice(1, None) if position == "center" else slice(None)
    return RowDifferences(
        first_row=-rows + mirror,
        row_begin=np.concatenate([begin[below][::-1], begin]),
        row_end=np.concatenate([end[below][::-1], end]),
        offset=i,
        delta=delta[:, np.newaxis],
        position=position,
        symmetric=True,
    )


def polygon_vertices(blades: int, rotation: float, anamorphic_ratio: float) -> FloatArray:
    """Return the corners of a polygonal aperture as Cycles has it.

    The corners lie on the unit circle, a blade's middle at angle `rotation`; then x is divided by the
    anamorphic ratio.

    Parameters
    ----------
    blades : int
        Number of blades, at least 3.
    rotation : float
        Angle in radians, counter-clockwise as the camera looks.
    anamorphic_ratio : float
        Height over width.

    Returns
    -------
    ndarray of float64 of shape (blades, 2)
        Corners (x, y), x right and y up, counter-clockwise.
    """
    angle = rotation + (2.0 * np.arange(blades) - 1.0) * math.pi / blades
    return np.stack([np.cos(angle) / anamorphic_ratio, np.sin(angle)], axis=1)


def polygon_rows(vertices: npt.ArrayLike, position: SamplePosition = "center") -> RowDifferences:
    """Return the exact pixel coverage of a simple polygon, normalised to 1.

    Every edge adds, to each pixel right of it, the height that it crosses in the pixel's row times the
    mean horizontal distance covered; with the edge's sign the sum over the edges is the coverage.

    Parameters
    ----------
    vertices : array_like of shape (n, 2)
        Corners (x, y) in pixels from the sample, x right and y *down*, in either order.
    position : {"center", "corner"}
        Where the sample lies on the pixel grid.

    Returns
    -------
    RowDifferences
        All rows, both halves.

    Raises
    ------
    ValueError
        If the polygon has no area.
    """
    points = np.asarray(vertices, dtype=np.float64)
    following = np.roll(points, -1, axis=0)
    area = 0.5 * float(np.sum(points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]))
    if abs(area) < _POINT**2:
        raise ValueError("A polygon without area covers no pixel.")
    half = 0.5 if position == "center" else 0.0
    points, following = points + half, following + half
    # A level edge crosses no row.
    sloped = following[:, 1] != points[:, 1]
    points, following = points[sloped], following[sloped]
    falling = following[:, 1] > points[:, 1]
    sign = np.where(falling, -1.0, 1.0) / area
    upper = np.where(falling[:, np.newaxis], points, following)
    lower = np.where(falling[:, np.newaxis], following, points)
    # One piece for each row that an edge crosses.
    first = np.floor(upper[:, 1]).astype(np.int64)
    edge, row = ragged(first, np.ceil(lower[:, 1]).astype(np.int64) - first)
    top = np.maximum(row, upper[edge, 1])
    bottom = np.minimum(row + 1.0, lower[edge, 1])
    slope = (lower[edge, 0] - upper[edge, 0]) / (lower[edge, 1] - upper[edge, 1])
    x_top = upper[edge, 0] + slope * (top - upper[edge, 1])
    x_bottom = upper[edge, 0] + slope * (bottom - upper[edge, 1])
    weight = sign[edge] * (bottom - top)
    x_low, x_high = np.minimum(x_top, x_bottom), np.maximum(x_top, x_bottom)
    column = np.floor(x_low).astype(np.int64)
    piece, i = ragged(column, np.ceil(x_high).astype(np.int64) - column + 1)
    change = _covered_right_of(x_low[piece], x_high[piece], i) - _covered_right_of(
        x_low[piece], x_high[piece], i - 1
    )
    # Pieces of one pixel are added up.
    width = int(i.max() - i.min()) + 1
    key, inverse = np.unique(row[piece] * width + (i - i.min()), return_inverse=True)
    delta: FloatArray = np.bincount(inverse, weights=weight[piece] * change).astype(np.float64)
    entry_row, offset = np.divmod(key, width)
    # Rounding must not leave a row open: what is left would stretch to the frame's border.
    last = np.append(np.flatnonzero(np.diff(entry_row)), entry_row.size - 1)
    delta[last] -= np.add.reduceat(delta, np.append(0, last[:-1] + 1))
    rows = np.arange(int(row.min()), int(row.max()) + 1)
    return RowDifferences(
        first_row=int(rows[0]),
        row_begin=np.searchsorted(entry_row, rows, side="left"),
        row_end=np.searchsorted(entry_row, rows, side="right"),
        offset=offset + int(i.min()),
        delta=delta[:, np.newaxis],
        position=position,
        symmetric=False,
    )


def _covered_right_of(x_low: FloatArray, x_high: FloatArray, pixel: IntArray) -> FloatArray:
    """Return the mean part of a pixel [i, i + 1] that lies right of x, for x even in [x_low, x_high]."""
    near, far = pixel + 1.0 - x_high, pixel + 1.0 - x_low
    # The part is a ramp from 0 to 1. All lengths are differences of the same two numbers, so that an edge
    # which is all but upright loses no digits.
    span = far - near
    start, end = np.clip(near, 0.0, 1.0), np.clip(far, 0.0, 1.0)
    area = 0.5 * (end - start) * (end + start) + np.maximum(far - np.maximum(near, 1.0), 0.0)
    return np.asarray(np.divide(area, span, out=end.copy(), where=span > 0.0))


def _disc_area(x: npt.NDArray[np.floating], y: npt.NDArray[np.floating]) -> FloatArray:
    """Return the signed area of the unit disc between the axes and (x, y), odd in x and in y."""
    sign = np.sign(x) * np.sign(y)
    x, y = np.minimum(np.abs(x), 1.0), np.minimum(np.abs(y), 1.0)
    rim = np.sqrt(1.0 - y**2)
    beyond = y * rim + _segment(x) - _segment(rim)
    return np.asarray(sign * np.where(x <= rim, x * y, beyond))


def _segment(x: npt.NDArray[np.floating]) -> FloatArray:
    """Return the integral from 0 to x of sqrt(1 - t^2)."""
    return np.asarray(0.5 * (x * np.sqrt(1.0 - x**2) + np.arcsin(x)))


def ragged(first: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Return, for ranges of `count` numbers from `first`, whose range each number is of and the number."""
    owner = np.repeat(np.arange(count.size), count)
    start = np.cumsum(count) - count
    return owner, np.arange(owner.size) - start[owner] + first[owner]


def widened(table: RowDifferences, side: int) -> RowDifferences:
    """Return the mean table of a block of samples, as seen from its upper left one.

    Parameters
    ----------
    table : RowDifferences
        The table of each of its samples.
    side : int
        Samples along each side of the block, a power of 2.

    Returns
    -------
    RowDifferences
        Normalised to 1.
    """
    while table.block < side:
        table = _of_twice_the_side(table)
    return table


def _of_twice_the_side(table: RowDifferences) -> RowDifferences:
    """Return the mean of a table and of those of the blocks to the right of it, below, and both."""
    step = table.block
    # Rows that mirror each other share their entries.
    row, entry = ragged(table.row_begin, table.row_end - table.row_begin)
    offset, delta = table.offset[entry], table.delta[entry]
    left = int(offset.min())
    shape = table.row_begin.size + step, int(offset.max()) - left + 1 + step
    place = row * shape[1] + offset - left
    places = np.concatenate([place, place + step, place + step * shape[1], place + step * (shape[1] + 1)])
    dense = np.stack(
        [np.bincount(places, np.tile(0.25 * d, 4), shape[0] * shape[1]) for d in delta.T], axis=1
    )
    filled = np.flatnonzero(np.bincount(places, minlength=dense.shape[0]))
    bounds = np.searchsorted(filled, np.arange(shape[0] + 1) * shape[1])
    return replace(
        table,
        row_begin=bounds[:-1],
        row_end=bounds[1:],
        offset=filled % shape[1] + left,
        delta=np.asarray(dense[filled], dtype=np.float64),
        block=2 * step,
    )
