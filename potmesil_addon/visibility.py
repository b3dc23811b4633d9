"""Which part of the aperture sees each surface: nearer ones hide it from some points and not from others.

Through a point a of the aperture, a surface with the signed circle radius r at x is seen at x + r a. What
meets there through one point of the aperture lies on one ray, and the nearest is seen: a depth buffer for
each of some dozens of points, in cells that divide the aperture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from . import jit
from .aperture import polygon_vertices
from .fragments import Fragments
from .lens import FloatArray, Lens
from .samples import Float32Array
from .scatter import CELLS

Visibility = Literal["aperture", "none"]
"""``aperture`` decides what is hidden for each part of the aperture; ``none`` is the papers' eq. 22."""

Mask = npt.NDArray[np.uint16]

VISIBILITIES: Final[tuple[Visibility, ...]] = ("aperture", "none")

_SPAN: Final = 2
"""Cells along each side of a square that one point decides for, but for bright samples."""

_FINE: Final = 8
"""Points along each side of a cell that tell how much of it lies within the aperture."""

_BRIGHT: Final = 4.0
"""Light of a sample over the mean from which its circle is seen by itself, and its cut must look sharp."""

_LARGE: Final = 6.0
"""Radius in pixels of such a sample's circle from which a cell shows."""

_TILE: Final = 16
"""Pixels along each side of the squares in which it is found out whether anything can be hidden."""

MOST_RADIUS: Final = 4096.0
"""Radius in pixels past which a circle counts as no larger."""

_STRIDE: Final = 7
"""Step through the cells of a square from one turn to the next; it has no factor in common with their
number."""

_TOLERANCE: Final = 0.25
"""Pixels of radius by which surfaces may differ without one hiding the other."""


class Pinholes(NamedTuple):
    """Points of the aperture, in squares of cells.

    Parameters
    ----------
    x, y : ndarray of float64 of shape (n, n)
        Where a sample behind the focus is imaged through them, in its circle's radii along x; y down.
    used : ndarray of bool of shape (n, n)
        Which of them lie within the aperture.
    span : int
        Cells along each side that a point stands for.
    """

    x: FloatArray
    y: FloatArray
    used: npt.NDArray[np.bool_]
    span: int


@dataclass(frozen=True, slots=True)
class ApertureCells:
    """An aperture in cells, with a point in each.

    Parameters
    ----------
    x, y : ndarray of float64 of shape (CELLS, CELLS)
        The points where a sample behind the focus is imaged, in its circle's radii along x; y down.
    area : ndarray of float64 of shape (CELLS, CELLS)
        Shares of the aperture; they add up to 1.
    stretch_x, stretch_y : float
        Semi-axes of the aperture's image over the radius along x.
    """

    x: FloatArray
    y: FloatArray
    area: FloatArray
    stretch_x: float
    stretch_y: float

    @property
    def stretch(self) -> float:
        """Larger semi-axis of the aperture's image over the radius along x."""
        return max(self.stretch_x, self.stretch_y)

    def pinholes(self, span: int, turn: int = 0) -> Pinholes:
        """Return points through which to look, one in each square of cells.

        Parameters
        ----------
        span : int
            Cells along each side of a square.
        turn : int
            Which of a square's cells has the point; another one at each turn.

        Returns
        -------
        Pinholes
            The points.
        """
        count = CELLS // span
        squares = [
            values.reshape(count, span, count, span).swapaxes(1, 2).reshape(count, count, span * span)
            for values in (self.x, self.y, self.area)
        ]
        # A column of squares has its points in all columns of cells, a row in all rows.
        along = np.arange(count)
        step = _STRIDE * turn % (span * span)
        column = (along[:, np.newaxis] + step) % span + 0 * along
        row = (along + step // span) % span + 0 * along[:, np.newaxis]
        order = (np.arange(span * span) + (row * span + column)[..., np.newaxis]) % (span * span)
        within = np.take_along_axis(squares[2], order, axis=2) > 0.0
        chosen = np.take_along_axis(order, within.argmax(axis=2)[..., np.newaxis], axis=2)
        x, y = (np.take_along_axis(values, chosen, axis=2)[..., 0] for values in squares[:2])
        return Pinholes(x, y, np.asarray(within.any(axis=2)), span)


def aperture_cells(lens: Lens, pixel_ratio: float) -> ApertureCells:
    """Divide an aperture into cells.

    No two points share their x or their y, so that an upright or level edge passes them one by one.

    Parameters
    ----------
    lens : Lens
        Whose blades and anamorphic ratio count.
    pixel_ratio : float
        Pitch of the pixels along x over that along y.

    Returns
    -------
    ApertureCells
        The cells.
    """
    count = CELLS * _FINE
    fine = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    x, y = np.meshgrid(fine, fine)
    if lens.is_round:
        inside = x * x + y * y <= 1.0
    else:
        corners = polygon_vertices(lens.blades, lens.blade_rotation, 1.0)
        edges = np.roll(corners, -1, axis=0) - corners
        # Rows count downwards, the corners' y upwards.
        inside = np.all(
            [
                ex * (-y - cy) - ey * (x - cx) >= 0.0
                for (ex, ey), (cx, cy) in zip(edges, corners, strict=True)
            ],
            axis=0,
        )
    inside = inside.reshape(CELLS, _FINE, CELLS, _FINE).swapaxes(1, 2)
    area = inside.sum(axis=(2, 3)) / inside.sum()
    reversed_ = np.array([int(f"{n:04b}"[::-1], 2) for n in range(CELLS)])
    within = (reversed_ + 0.5) / CELLS
    point_x, point_y = np.zeros((CELLS, CELLS)), np.zeros((CELLS, CELLS))
    for j, i in np.argwhere(area > 0.0):
        # The point of a cell that reaches out of the aperture is the nearest that does not.
        v, u = np.nonzero(inside[j, i])
        off = ((u + 0.5) / _FINE - within[j]) ** 2 + ((v + 0.5) / _FINE - within[i]) ** 2
        k = int(np.argmin(off))
        exact = off[k] <= 0.5 / _FINE**2
        point_x[j, i] = (i + (within[j] if exact else (u[k] + 0.5) / _FINE)) / CELLS * 2.0 - 1.0
        point_y[j, i] = (j + (within[i] if exact else (v[k] + 0.5) / _FINE)) / CELLS * 2.0 - 1.0
    stretch_x, stretch_y = 1.0 / lens.anamorphic_ratio, pixel_ratio
    return ApertureCells(point_x * stretch_x, point_y * stretch_y, area, stretch_x, stretch_y)


@dataclass(frozen=True, slots=True)
class Seen:
    """What the aperture sees of fragments.

    Parameters
    ----------
    share : ndarray of float32 of shape (sheets, rows, columns)
        Share of the aperture that sees each fragment.
    number : ndarray of int32 of shape (sheets, rows, columns)
        Which mask a fragment has; -1 for one that is seen whole or not at all.
    mask : ndarray of uint16 of shape (masks, CELLS)
        Bit i of number j: the fragment's light reaches cell (i, j) of the square around its circle.
    """

    share: Float32Array
    number: npt.NDArray[np.int32]
    mask: Mask


def decide(
    fragments: Fragments, cells: ApertureCells, turn: int | None = None, *, compiled: bool = True
) -> Seen:
    """Find out which cells of the aperture see each fragment.

    Parameters
    ----------
    fragments : Fragments
        The surfaces of each pixel.
    cells : ApertureCells
        The aperture.
    turn : int, optional
        Number of this instant where many are added up. Each then looks through few points, and each through
        others: an instant of one point is a part of the aperture and of the time.
    compiled : bool
        Whether to use the compiled kernels.

    Returns
    -------
    Seen
        Masks.
    """
    coverage = fragments.coverage
    share = np.ones(coverage.shape, dtype=np.float32)
    # What lies behind, away from all edges, is not seen.
    share[1:] = 0.0
    number = np.full(coverage.shape, -1, dtype=np.int32)
    stretch = cells.stretch
    nearest, farthest = _surroundings(fragments, stretch)
    solid = coverage > 0.0
    hiding = np.flatnonzero(solid & (fragments.radius + _TOLERANCE < farthest))
    # Along a surface without edges nothing is hidden, however far what is nearest reaches.
    away = ndimage.distance_transform_cdt(fragments.reach == 0.0, metric="chessboard")
    beyond = (fragments.radius - nearest) * stretch + 1.0
    hidden = np.flatnonzero(solid & (fragments.radius - _TOLERANCE > nearest) & (away <= beyond))
    mask = np.zeros((hidden.size, CELLS), dtype=np.uint16)
    if hidden.size == 0 or hiding.size == 0:
        return Seen(share, number, mask)
    test = _test_cells if compiled else _test_cells_numpy
    rows, columns = coverage.shape[1:]
    before, behind = _taken(fragments, hiding), _taken(fragments, hidden)
    pinholes = cells.pinholes(_SPAN) if turn is None else cells.pinholes(2 * _SPAN, turn)
    test(before, behind, pinholes, rows, columns, mask)
    seen = _shares(mask, behind.radius, cells.area)
    if turn is None:
        bright = np.flatnonzero((seen > 0.0) & (seen < 1.0) & _shows_its_shape(fragments, hidden))
        if bright.size:
            finer = np.zeros((bright.size, CELLS), dtype=np.uint16)
            test(before, _some(behind, bright), cells.pinholes(1), rows, columns, finer)
            mask[bright] = finer
            seen[bright] = _shares(finer, behind.radius[bright], cells.area)
    partly = (seen > 0.0) & (seen < 1.0)
    share.reshape(-1)[hidden] = seen
    number.reshape(-1)[hidden[partly]] = np.arange(np.count_nonzero(partly), dtype=np.int32)
    return Seen(share, number, mask[partly])


def _shows_its_shape(fragments: Fragments, which: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return which fragments are so bright and so blurred that one sees the shape of their circle."""
    light = fragments.color[..., :3].reshape(-1, 3)[which].mean(axis=1)
    usual = float(fragments.color[0, ..., :3].mean())
    large = np.abs(fragments.radius.reshape(-1)[which]) > _LARGE
    return np.asarray((light > _BRIGHT * usual) & large)


class _Points(NamedTuple):
    """Fragments in a row: where and how they lie, and the least radius before them that hides nothing."""

    x: Float32Array
    y: Float32Array
    radius: Float32Array
    slope_x: Float32Array
    slope_y: Float32Array
    coverage: Float32Array
    visible_to: Float32Array


def _some(points: _Points, which: npt.NDArray[np.int64]) -> _Points:
    return _Points(*(values[which] for values in points))


def _taken(fragments: Fragments, which: npt.NDArray[np.int64]) -> _Points:
    rows, columns = fragments.coverage.shape[1:]
    y, x = np.divmod(which % (rows * columns), columns)
    slope = fragments.slope.reshape(-1, 2)[which]
    radius = fragments.radius.reshape(-1)[which]
    return _Points(
        x.astype(np.float32),
        y.astype(np.float32),
        radius,
        np.ascontiguousarray(slope[:, 0]),
        np.ascontiguousarray(slope[:, 1]),
        fragments.coverage.reshape(-1)[which],
        radius - np.float32(_TOLERANCE) - np.abs(slope).sum(axis=1),
    )


def _surroundings(fragments: Fragments, stretch: float) -> tuple[Float32Array, Float32Array]:
    """Return the least and the largest radius near each pixel, as far as edges there are felt.

    Where none is felt it is the other way round: nothing is nearer than the one or farther than the other.
    """
    rows, columns = fragments.reach.shape
    down, across = -(-rows // _TILE), -(-columns // _TILE)
    reach = _in_tiles(fragments.reach, 0.0, down, across).max(axis=(1, 3)) * stretch
    solid = fragments.coverage > 0.0
    low = np.where(solid, fragments.radius, np.float32(np.inf)).min(axis=0)
    high = np.where(solid, fragments.radius, np.float32(-np.inf)).max(axis=0)
    low = _in_tiles(low, np.inf, down, across).min(axis=(1, 3))
    high = _in_tiles(high, -np.inf, down, across).max(axis=(1, 3))
    nearest = np.full((down, across), np.float32(np.inf))
    farthest = np.full((down, across), np.float32(-np.inf))
    _spread_tiles(reach, low, high, nearest, farthest)

    def pixels(tiles: Float32Array) -> Float32Array:
        return np.repeat(np.repeat(tiles, _TILE, axis=0), _TILE, axis=1)[:rows, :columns]

    return pixels(nearest), pixels(farthest)


def _in_tiles(values: Float32Array, beyond: float, down: int, across: int) -> Float32Array:
    padded = np.full((down * _TILE, across * _TILE), np.float32(beyond))
    padded[: values.shape[0], : values.shape[1]] = values
    return padded.reshape(down, _TILE, across, _TILE)


@jit.kernel()
def _spread_tiles(reach: Any, low: Any, high: Any, nearest: Any, farthest: Any) -> None:
    down, across = reach.shape
    for v in range(down):
        for u in range(across):
            if reach[v, u] <= 0.0:
                continue
            tiles = int((reach[v, u] + 1.0) // _TILE) + 1
            least, most = low[v, u], high[v, u]
            for j in range(max(0, v - tiles), min(down, v + tiles + 1)):
                for i in range(max(0, u - tiles), min(across, u + tiles + 1)):
                    least, most = min(least, low[j, i]), max(most, high[j, i])
            for j in range(max(0, v - tiles), min(down, v + tiles + 1)):
                for i in range(max(0, u - tiles), min(across, u + tiles + 1)):
                    nearest[j, i] = min(nearest[j, i], least)
            # What is hidden this far from the edge may be looked for as far again from there.
            tiles *= 2
            for j in range(max(0, v - tiles), min(down, v + tiles + 1)):
                for i in range(max(0, u - tiles), min(across, u + tiles + 1)):
                    farthest[j, i] = max(farthest[j, i], most)


@jit.kernel(parallel=True)
def _test_cells(
    hiding: _Points, hidden: _Points, pinholes: Pinholes, rows: int, columns: int, mask: Any
) -> None:
    """Draw fragments through each point of the aperture, and note which of those behind are seen.

    A row of points is one thread's work. It owns the masks' numbers of each of its rows of cells, or for
    fragments before the focus, whose image stands on its head, of the rows opposite.
    """
    for number in jit.prange(pinholes.used.shape[0]):
        row: Any = np.int64(number)
        nearest = np.empty(rows * columns, dtype=np.float32)
        for column in range(pinholes.used.shape[1]):
            if not pinholes.used[row, column]:
                continue
            nearest[:] = np.float32(np.inf)
            ax, ay = np.float32(pinholes.x[row, column]), np.float32(pinholes.y[row, column])
            _draw(hiding, ax, ay, _dither(row, column), nearest, rows, columns)
            _test(hidden, ax, ay, nearest, rows, columns, mask, row, column, pinholes.span)


@jit.kernel(inline=True)
def _dither(row: Any, column: Any) -> Any:
    """Return where a point of the aperture begins to choose among partly covered pixels."""
    return 0.5 + 0.6180339887498949 * (row * CELLS + column)


@jit.kernel()
def _draw(points: _Points, ax: Any, ay: Any, dither: float, nearest: Any, rows: int, columns: int) -> None:
    """Draw fragments through a point of the aperture, each as large as its surface looks from there."""
    half = np.float32(0.5)
    for k in range(points.radius.size):
        if points.coverage[k] < 1.0:
            level = dither + 0.7548776662466927 * points.x[k] + 0.5698402909980532 * points.y[k]
            if level - math.floor(level) >= points.coverage[k]:
                continue
        radius = points.radius[k]
        at_x, at_y = points.x[k] + radius * ax, points.y[k] + radius * ay
        half_x = half + half * points.slope_x[k] * ax
        half_y = half + half * points.slope_y[k] * ay
        u, v = math.ceil(at_x - half_x), math.ceil(at_y - half_y)
        # Almost always one pixel: surfaces hardly grow or shrink from one point of the aperture to another.
        while v < at_y + half_y:
            if 0 <= v < rows:
                i = u
                while i < at_x + half_x:
                    if 0 <= i < columns:
                        nearest[v * columns + i] = min(nearest[v * columns + i], radius)
                    i += 1
            v += 1


@jit.kernel()
def _test(
    points: _Points, ax: Any, ay: Any, nearest: Any, rows: int, columns: int,
    mask: Any, row: Any, column: Any, span: int,
) -> None:  # fmt: skip
    """Note in the masks which fragments nothing hides from a point of the aperture."""
    bits = np.uint16(((1 << span) - 1) << (column * span))
    opposite = np.uint16(((1 << span) - 1) << (CELLS - (column + 1) * span))
    half = np.float32(0.5)
    for k in range(points.radius.size):
        radius = points.radius[k]
        u = math.floor(points.x[k] + radius * ax + half)
        v = math.floor(points.y[k] + radius * ay + half)
        if 0 <= u < columns and 0 <= v < rows:
            if points.visible_to[k] > nearest[v * columns + u]:
                continue
        for j in range(row * span, (row + 1) * span):
            if radius < 0.0:
                mask[k, CELLS - 1 - j] |= opposite
            else:
                mask[k, j] |= bits


def _test_cells_numpy(
    hiding: _Points, hidden: _Points, pinholes: Pinholes, rows: int, columns: int, mask: Mask
) -> None:
    """Do the same, all fragments at once for one point of the aperture after the other."""
    half = np.float32(0.5)
    span = pinholes.span
    for row, column in np.argwhere(pinholes.used):
        ax, ay = np.float32(pinholes.x[row, column]), np.float32(pinholes.y[row, column])
        nearest = np.full(rows * columns, np.float32(np.inf))
        level = _dither(row, column) + 0.7548776662466927 * hiding.x + 0.5698402909980532 * hiding.y
        there = (hiding.coverage == 1.0) | (level - np.floor(level) < hiding.coverage)
        p = _some(hiding, np.flatnonzero(there))
        at_x, at_y = p.x + p.radius * ax, p.y + p.radius * ay
        half_x, half_y = half + half * p.slope_x * ax, half + half * p.slope_y * ay
        first_x, end_x = np.ceil(at_x - half_x).astype(np.int64), np.ceil(at_x + half_x).astype(np.int64)
        first_y, end_y = np.ceil(at_y - half_y).astype(np.int64), np.ceil(at_y + half_y).astype(np.int64)
        for j in range(int((end_y - first_y).max(initial=0))):
            for i in range(int((end_x - first_x).max(initial=0))):
                v, u = first_y + j, first_x + i
                at = (v < end_y) & (u < end_x) & (v >= 0) & (v < rows) & (u >= 0) & (u < columns)
                np.minimum.at(nearest, v[at] * columns + u[at], p.radius[at])
        u = np.floor(hidden.x + hidden.radius * ax + half).astype(np.int64)
        v = np.floor(hidden.y + hidden.radius * ay + half).astype(np.int64)
        inside = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
        before = np.full(hidden.radius.size, np.float32(np.inf))
        before[inside] = nearest[v[inside] * columns + u[inside]]
        seen = hidden.visible_to <= before
        near = hidden.radius < 0.0
        bits = ((1 << span) - 1) << (int(column) * span)
        opposite = ((1 << span) - 1) << (CELLS - (int(column) + 1) * span)
        for j in range(row * span, (row + 1) * span):
            mask[seen & near, CELLS - 1 - j] |= np.uint16(opposite)
            mask[seen & ~near, j] |= np.uint16(bits)


@jit.kernel(parallel=True)
def _add_shares(mask: Any, radius: Any, area: Any, share: Any) -> None:
    """Add up the areas of the cells that masks let light through."""
    for number in jit.prange(radius.size):
        k: Any = np.int64(number)
        total = 0.0
        for row in range(CELLS):
            bits = int(mask[k, row])
            own = CELLS - 1 - row if radius[k] < 0.0 else row
            column = 0
            while bits >> column != 0:
                if (bits >> column) & 1 == 1:
                    total += area[own, CELLS - 1 - column if radius[k] < 0.0 else column]
                column += 1
        # Sums of the same areas in another order.
        share[k] = 1.0 if total > 1.0 - 1e-9 else total


def _shares(mask: Mask, radius: Float32Array, area: FloatArray) -> Float32Array:
    """Return the share of the aperture that masks let through."""
    share = np.zeros(radius.size, dtype=np.float32)
    _add_shares(mask, radius, area, share)
    return share
