"""Which part of the aperture sees each surface: nearer ones hide it from some points and not from others.

Through a point a of the aperture, a surface with the signed circle radius r at x is seen at x + r a. What
meets there through one point of the aperture lies on one ray, and the nearest is seen: a depth buffer for
each of some dozens of points, in cells that divide the aperture.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from . import jit
from .aperture import polygon_vertices
from .effects import Pupil
from .fragments import Fragments
from .images import on_change
from .lens import FloatArray, Lens
from .pupil import transmission
from .samples import BRIGHT, Float32Array, is_within
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

LARGE: Final = 6.0
"""Radius in pixels of such a sample's circle from which a cell shows."""

_TILE: Final = 16
"""Pixels along each side of the squares in which it is found out how far the lens looks past edges."""

_LEVEL_X: Final = 0.7548776662466927
_LEVEL_Y: Final = 0.5698402909980532
"""Steps of the level from pixel to pixel: neighbours, and pixels along any line, have levels far apart."""

_CHUNK: Final = 512
"""Fragments at a time that are placed, which the compiler does for several at once, and then drawn."""

_WIDTHS: Final = 1.24
"""Pixels by which the middles of two fragments may be apart that meet: half the widths of both and a little
more for slanted ones. Less than 1 and the tolerance, or all neighbours on one surface would count."""

MOST_RADIUS: Final = 4096.0
"""Radius in pixels past which a circle counts as no larger."""

_LARGEST_SQUARE: Final = 8
"""Side in pixels, a power of 2, of the largest squares that even surfaces are drawn in."""

_STRIDE: Final = 7
"""Step through the cells of a square from one turn to the next; it has no factor in common with their
number."""

_BITS_AT_ONCE: Final = 8
"""Squares of a row whose areas are looked up together."""

_ROUNDING: Final = 1e-9
"""Share of the aperture that is none."""

_ALMOST: Final = float(np.nextafter(np.float32(1.0), np.float32(0.0)))
"""Share of the aperture that is not all of it."""

_TOLERANCE: Final = 0.25
"""Pixels of radius by which surfaces may differ without one hiding the other."""

_RISE: Final = 16.0
"""More than the radius at the middle of a square or a block differs from that at its upper left: a surface's
slope is at most a pixel each pixel, and half of the largest is 8 wide."""


@dataclass(frozen=True, slots=True)
class Whole:
    """What deciding about a band of rows takes to decide as for the whole picture.

    Parameters
    ----------
    top : int
        Row of the whole at which the band begins; a multiple of 16.
    lowest, highest : float
        Least and largest radius of the whole.
    is_part : bool
        Whether there is more than the band.
    """

    top: int
    lowest: float
    highest: float
    is_part: bool = True


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


def aperture_cells(lens: Lens, pixel_ratio: float, pupil: Pupil | None = None) -> ApertureCells:
    """Divide an aperture into cells.

    No two points share their x or their y, so that an upright or level edge passes them one by one.

    Parameters
    ----------
    lens : Lens
        Whose blades and anamorphic ratio count.
    pixel_ratio : float
        Pitch of the pixels along x over that along y.
    pupil : Pupil, optional
        The aperture's shape beyond them.

    Returns
    -------
    ApertureCells
        The cells.
    """
    blades = 0 if lens.is_round else lens.blades
    return _cells(blades, lens.blade_rotation, lens.anamorphic_ratio, pixel_ratio, pupil)


@functools.lru_cache(maxsize=16)
def _cells(
    blades: int, rotation: float, anamorphic_ratio: float, pixel_ratio: float, pupil: Pupil | None
) -> ApertureCells:
    """Divide an aperture into cells; frame after frame has the same one."""
    count = CELLS * _FINE
    fine = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    x, y = np.meshgrid(fine, fine)
    if pupil is not None:
        light = transmission(Lens(1.0, 1.0, 1.0, blades, rotation), pupil, count)
    elif blades == 0:
        light = (x * x + y * y <= 1.0).astype(np.float64)
    else:
        corners = polygon_vertices(blades, rotation, 1.0)
        edges = np.roll(corners, -1, axis=0) - corners
        # Rows count downwards, the corners' y upwards.
        light = np.all(
            [
                ex * (-y - cy) - ey * (x - cx) >= 0.0
                for (ex, ey), (cx, cy) in zip(edges, corners, strict=True)
            ],
            axis=0,
        ).astype(np.float64)
    light = light.reshape(CELLS, _FINE, CELLS, _FINE).swapaxes(1, 2)
    inside = light > 0.0
    area = light.sum(axis=(2, 3)) / light.sum()
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
    stretch_x, stretch_y = 1.0 / anamorphic_ratio, pixel_ratio
    return ApertureCells(point_x * stretch_x, point_y * stretch_y, area, stretch_x, stretch_y)


on_change(_cells.cache_clear)


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
    fragments: Fragments,
    cells: ApertureCells,
    turn: int | None = None,
    *,
    brightest: float = math.inf,
    side: npt.NDArray[np.uint8] | None = None,
    whole: Whole | None = None,
    compiled: bool = True,
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
    brightest : float, optional
        Light, on average over red, green and blue, past which a large circle is seen by itself and is cut
        more finely; see `brightness_of_lights`.
    side : ndarray of uint8 of shape (sheets, rows, columns), optional
        Side of the block of fragments that spreads as one, at its upper left; 0 for those that do not spread
        or do so with their block. By default each for itself.
    whole : Whole, optional
        The picture that the fragments are a band of; by default they are all of it.
    compiled : bool
        Whether to use the compiled kernels.

    Returns
    -------
    Seen
        Masks; those of a block at its upper left, as its middle is seen.
    """
    coverage = fragments.coverage
    if whole is None:
        whole = Whole(0, float(fragments.radius.min()), float(fragments.radius.max()), is_part=False)
    limit = np.empty_like(fragments.radius)
    _find_limits(fragments.radius, fragments.slope, limit)
    may_be, before = _to_decide(fragments, limit, cells.stretch, whole)
    hidden = np.flatnonzero(may_be if side is None else _of_blocks(may_be, side))
    del may_be
    if hidden.size == 0 or (before.radius.size == 0 and not whole.is_part):
        return Seen(*_seen_whole(coverage.shape), np.zeros((0, CELLS), dtype=np.uint16))
    behind = _taken(fragments, hidden, limit, side, whole.top)
    shape = coverage.shape[1:]
    pinholes = cells.pinholes(_SPAN) if turn is None else cells.pinholes(2 * _SPAN, turn)
    squares = _squares_seen(before, behind, pinholes, shape, whole, compiled)
    seen = _shares(squares, cells.area, pinholes.span)
    partly = np.flatnonzero((seen > 0.0) & (seen < 1.0))
    mask = _masks(np.take(squares, partly, axis=1), behind.radius[partly], pinholes.span)
    if turn is None:
        bright = _that_show_their_shape(fragments, hidden[partly], brightest)
        if bright.size:
            which, pinholes = partly[bright], cells.pinholes(1)
            farthest = _farthest_of(hidden[which], limit)
            before = _hiding(fragments, farthest, limit, cells.stretch, whole)
            squares = _squares_seen(before, _some(behind, which), pinholes, shape, whole, compiled)
            seen[which] = _shares(squares, cells.area, pinholes.span)
            mask[bright] = _masks(squares, behind.radius[which], pinholes.span)
            still = (seen[partly] > 0.0) & (seen[partly] < 1.0)
            partly, mask = partly[still], mask[still]
    del limit, before, squares
    share, number = _seen_whole(coverage.shape)
    # Of a block whose middle is seen whole some corner may not be.
    seen[(seen == 1.0) & (behind.side > 1.0)] = _ALMOST
    share.reshape(-1)[hidden] = seen
    number.reshape(-1)[hidden[partly]] = np.arange(partly.size, dtype=np.int32)
    return Seen(share, number, mask)


def _seen_whole(shape: tuple[int, ...]) -> tuple[Float32Array, npt.NDArray[np.int32]]:
    """Return shares and numbers of masks where nothing is hidden in parts."""
    share = np.ones(shape, dtype=np.float32)
    # What lies behind, away from all edges, is not seen.
    share[1:] = 0.0
    return share, np.full(shape, -1, dtype=np.int32)


def _that_show_their_shape(
    fragments: Fragments, which: npt.NDArray[np.int64], brightest: float
) -> npt.NDArray[np.int64]:
    """Return which of fragments are so bright and so blurred that one sees the shape of their circle."""
    large = np.flatnonzero(np.abs(fragments.radius.reshape(-1)[which]) > LARGE)
    light = fragments.color.reshape(-1, 4).take(which[large], axis=0)
    # Adding along so short an axis would take several times as long.
    mean = (light[:, 0] + light[:, 1] + light[:, 2]) / np.float32(3.0)
    return np.asarray(large[mean > brightest])


def brightness_of_lights(color: Float32Array) -> float:
    """Return the light, on average over red, green and blue, past which one sees a sample's own circle.

    Parameters
    ----------
    color : ndarray of float32 of shape (rows, columns, 4)
        What a pinhole sees.

    Returns
    -------
    float
        Four times its mean, but for light that is out of all proportion.
    """
    if not is_within(color, BRIGHT):
        color = np.where(np.abs(color) > BRIGHT, np.float32(0.0), color)
    # Row is added to row, which takes a fraction of the time of adding along them.
    light = color.sum(axis=0, dtype=np.float64)[:, :3]
    return _BRIGHT * float(light.mean()) / max(len(color), 1)


class _Points(NamedTuple):
    """Fragments in a row, or squares of those that are alike, as the kernels read them.

    `side` is that of a square in pixels, around its middle; `level` where a fragment that covers a part of a
    pixel begins to choose among the points of the aperture; `visible_to` the least radius before it that
    hides nothing.
    """

    x: Float32Array
    y: Float32Array
    side: Float32Array
    radius: Float32Array
    slope_x: Float32Array
    slope_y: Float32Array
    coverage: Float32Array
    level: Float32Array
    visible_to: Float32Array


def _some(points: _Points, which: npt.NDArray[np.int64]) -> _Points:
    return _Points(*(values[which] for values in points))


def _of_blocks(some: npt.NDArray[np.bool_], side: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """Return at which fragments those blocks begin that have some of the given ones."""
    of_blocks = np.zeros_like(some)
    _find_blocks(some, side, of_blocks)
    return of_blocks


@jit.kernel(parallel=True)
def _find_blocks(some: Any, side: Any, of_blocks: Any) -> None:
    for row in jit.prange(side.shape[1]):
        y: Any = np.int64(row)
        for sheet in range(side.shape[0]):
            for x in range(side.shape[2]):
                # Without numba a sum of a number and uint8 is uint8, too small for a column.
                size = np.int64(side[sheet, y, x])
                for v in range(y, y + size):
                    for u in range(x, x + size):
                        of_blocks[sheet, y, x] |= some[sheet, v, u]


def _taken(
    fragments: Fragments,
    which: npt.NDArray[np.int64],
    limit: Float32Array,
    side: npt.NDArray[np.uint8] | None,
    top: int,
) -> _Points:
    """Return those fragments whose places are given, or the middles of the blocks that begin there.

    `limit` is that of all fragments; rows count from the whole picture's first, of which theirs is `top`.
    """
    taken = _Points(*(np.empty(which.size, dtype=np.float32) for _ in _Points._fields))
    taken.side[:] = 1.0 if side is None else side.reshape(-1)[which]
    _take(
        which, fragments.radius, fragments.slope, fragments.coverage, limit, fragments.radius.shape[2],
        top, *taken,
    )  # fmt: skip
    return taken


@jit.kernel(parallel=True)
def _take(
    which: Any, radius: Any, slope: Any, coverage: Any, limit: Any, columns: int, top: int,
    out_x: Any, out_y: Any, out_side: Any, out_radius: Any, out_slope_x: Any, out_slope_y: Any,
    out_coverage: Any, out_level: Any, out_visible_to: Any,
) -> None:  # fmt: skip
    rows = radius.shape[1]
    for number in jit.prange(which.size):
        k: Any = np.int64(number)
        sheet, place = which[k] // (rows * columns), which[k] % (rows * columns)
        y, x = place // columns, place % columns
        off = np.float32(0.5) * out_side[k] - np.float32(0.5)
        rise = off * (slope[sheet, y, x, 0] + slope[sheet, y, x, 1])
        out_x[k], out_y[k], out_radius[k] = x + off, top + y + off, radius[sheet, y, x] + rise
        out_slope_x[k], out_slope_y[k] = slope[sheet, y, x, 0], slope[sheet, y, x, 1]
        out_coverage[k], out_visible_to[k] = coverage[sheet, y, x], limit[sheet, y, x] + rise
        level = _LEVEL_X * x + _LEVEL_Y * (top + y)
        out_level[k] = level - math.floor(level)


@jit.kernel(parallel=True)
def _find_limits(radius: Any, slope: Any, limit: Any) -> None:
    """Find the least radius before each fragment that hides nothing."""
    sheets, rows, columns = radius.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for sheet in range(sheets):
            for x in range(columns):
                rise = abs(slope[sheet, y, x, 0]) + abs(slope[sheet, y, x, 1])
                limit[sheet, y, x] = radius[sheet, y, x] - np.float32(_TOLERANCE) - rise


def _to_decide(
    fragments: Fragments, limit: Float32Array, stretch: float, whole: Whole
) -> tuple[npt.NDArray[np.bool_], _Points]:
    """Return which fragments something may hide in parts, and those that may hide them.

    A surface of radius r hides one of R from a point of the aperture only if they are no farther apart than
    R - r: a cone stands over each, and only what it covers can matter.
    """
    shape = fragments.reach.shape
    tiles = tuple(-(-size // _TILE) for size in shape)
    # One over the nearest of what is there, and one that tells how far away edges are.
    cones = np.empty((2, *shape), dtype=np.float32)
    reach, nearest = np.empty((2, *tiles), dtype=np.float32)
    around = np.float32(stretch)
    # Lower than this it does not matter how far away an edge is.
    floor = np.float32((whole.lowest - whole.highest) * stretch - 3.0)
    _look_around(fragments.coverage, fragments.radius, fragments.reach, around, floor, cones, reach, nearest)
    lowest = np.full(tiles, np.float32(np.inf))
    _spread_tiles(reach, nearest, lowest)
    _let_fall(cones)
    may_be = np.empty(limit.shape, dtype=np.bool_)
    farthest = np.empty(shape, dtype=np.float32)
    _mark_hidden(fragments.coverage, fragments.radius, limit, around, cones, lowest, may_be, farthest)
    del cones
    return may_be, _hiding(fragments, farthest, limit, stretch, whole)


def _farthest_of(hidden: npt.NDArray[np.int64], limit: Float32Array) -> Float32Array:
    """Return for each pixel the largest limit of the fragments given; ``-inf`` where there is none."""
    farthest = np.full(limit.shape[1:], np.float32(-np.inf))
    flat, limits = farthest.reshape(-1), limit.reshape(-1)
    # Views of one pixel come one after the other.
    for first, last in itertools.pairwise(np.searchsorted(hidden, np.arange(len(limit) + 1) * flat.size)):
        place = hidden[first:last] % flat.size
        flat[place] = np.maximum(flat[place], limits[hidden[first:last]])
    return farthest


def _hiding(
    fragments: Fragments, farthest: Float32Array, limit: Float32Array, stretch: float, whole: Whole
) -> _Points:
    """Return the fragments that may hide those with the largest limits given, alike ones in squares.

    Those of one pixel come before the squares.
    """
    # What is lower has nothing below it: a cone ends there, not at the picture's border.
    floor = np.float32(whole.lowest * stretch - _WIDTHS - 2.0)
    cones = np.maximum(farthest[np.newaxis] * np.float32(stretch), floor)
    _let_fall(cones)
    side = np.empty(limit.shape, dtype=np.uint8)
    _mark_hiding(fragments.coverage, fragments.radius, farthest, np.float32(stretch), cones, side)
    del cones
    _put_in_squares(fragments.radius, fragments.coverage, side)
    which = np.flatnonzero(side != 0)
    which = which[np.argsort(side.reshape(-1)[which] > 1, kind="stable")]
    return _taken(fragments, which, limit, side, whole.top)


@jit.kernel(parallel=True)
def _look_around(
    coverage: Any, radius: Any, reach: Any, stretch: Any, floor: Any, cones: Any, reach_of_tiles: Any,
    nearest: Any,
) -> None:  # fmt: skip
    """Find peaks of cones over what is nearest and over edges, and how far those are felt in each tile."""
    sheets, rows, columns = radius.shape
    for number in jit.prange(nearest.shape[0]):
        v: Any = np.int64(number)
        # Of each column first: whole rows are worked on several pixels at once.
        felt, lowest = np.zeros(columns, dtype=np.float32), np.full(columns, np.float32(np.inf))
        for y in range(v * _TILE, min((v + 1) * _TILE, rows)):
            near, edges, distance = cones[0, y], cones[1, y], reach[y]
            for x in range(columns):
                near[x] = np.float32(np.inf)
            for sheet in range(sheets):
                radii, there = radius[sheet, y], coverage[sheet, y]
                for x in range(columns):
                    near[x] = min(near[x], radii[x] if there[x] > 0.0 else np.float32(np.inf))
            for x in range(columns):
                lowest[x] = min(lowest[x], near[x])
                felt[x] = max(felt[x], distance[x] * stretch)
                near[x] *= -stretch
                edges[x] = floor if distance[x] == 0.0 else np.float32(0.0)
        for u in range(nearest.shape[1]):
            tile = slice(u * _TILE, min((u + 1) * _TILE, columns))
            reach_of_tiles[v, u], nearest[v, u] = felt[tile].max(), lowest[tile].min()


@jit.kernel(parallel=True)
def _mark_hidden(
    coverage: Any, radius: Any, limit: Any, stretch: Any, cones: Any, lowest: Any, may_be: Any, farthest: Any
) -> None:
    """Mark what something may hide in parts, and find for each pixel the largest limit of that.

    Along a surface without edges nothing is hidden, and what lies behind it is not seen.
    """
    sheets, rows, columns = radius.shape
    one, widths = np.float32(1.0), np.float32(_WIDTHS)
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for x in range(columns):
            least_around, away = lowest[y // _TILE, x // _TILE], -cones[1, y, x]
            most = np.float32(-np.inf)
            for sheet in range(sheets):
                found = coverage[sheet, y, x] > 0.0
                found &= away <= (radius[sheet, y, x] - least_around) * stretch + one
                if found and sheet == 0:
                    found = limit[0, y, x] * stretch + widths >= -_highest_beside(cones[0], y, x)
                may_be[sheet, y, x] = found
                if found:
                    most = max(most, limit[sheet, y, x])
            farthest[y, x] = most


@jit.kernel(parallel=True)
def _mark_hiding(coverage: Any, radius: Any, farthest: Any, stretch: Any, cones: Any, side: Any) -> None:
    """Mark what may hide something, as squares of one pixel."""
    sheets, rows, columns = radius.shape
    one, widths = np.float32(1.0), np.float32(_WIDTHS)
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        most = np.empty(columns, dtype=np.float32)
        most[0] = _highest_beside(cones[0], y, 0)
        most[-1] = _highest_beside(cones[0], y, columns - 1)
        # Counted from 0, which leaves no index to be tested for its sign.
        here, above, below = cones[0, y], cones[0, max(y - 1, 0)], cones[0, min(y + 1, rows - 1)]
        for i in range(columns - 2):
            beside = max(here[i], here[i + 2])
            if y > 0:
                beside = max(beside, above[i], above[i + 1], above[i + 2])
            if y < rows - 1:
                beside = max(beside, below[i], below[i + 1], below[i + 2])
            most[i + 1] = beside - one
        for sheet in range(sheets):
            radii, there, sides = radius[sheet, y], coverage[sheet, y], side[sheet, y]
            for x in range(columns):
                before = radii[x] <= (most[x] + widths) / stretch or radii[x] < farthest[y, x]
                sides[x] = 1 if before and there[x] > 0.0 else 0


@jit.kernel(parallel=True)
def _put_in_squares(radius: Any, coverage: Any, side: Any) -> None:
    """Make squares of what is there and belongs to one surface, in place: their sides at the upper left."""
    sheets, rows, columns = radius.shape
    strips = (rows + _LARGEST_SQUARE - 1) // _LARGEST_SQUARE
    for number in jit.prange(sheets * strips):
        n: Any = np.int64(number)
        # A thread takes numbers that follow each other: each gets strips of all sheets.
        sheet, top = n % sheets, n // sheets * _LARGEST_SQUARE
        bottom = min(top + _LARGEST_SQUARE, rows)
        h = 1
        while h < _LARGEST_SQUARE:
            for y in range(top, bottom - 2 * h + 1, 2 * h):
                for x in range(0, columns - 2 * h + 1, 2 * h):
                    low, high, alike = radius[sheet, y, x], radius[sheet, y, x], True
                    for v in (y, y + h):
                        for u in (x, x + h):
                            low, high = min(low, radius[sheet, v, u]), max(high, radius[sheet, v, u])
                            alike &= side[sheet, v, u] == h and coverage[sheet, v, u] >= 1.0
                    if alike and high - low <= _TOLERANCE:
                        side[sheet, y, x + h], side[sheet, y + h, x] = 0, 0
                        side[sheet, y, x], side[sheet, y + h, x + h] = 2 * h, 0
            h *= 2


def _let_fall(cones: Float32Array) -> None:
    """Turn peaks, in place, into how high the highest cone is over each pixel.

    They fall by 1 for each pixel, across corners as along lines: down and to the right, then up and to the
    left. Whatever is the highest is so in any order, so that rows can be divided among threads.
    """
    strips = min(-(-jit.set_thread_count(None) // len(cones)), cones.shape[1])
    for step in (1, -1):
        _fall_in_strips(cones, strips, step)


@jit.kernel(parallel=True)
def _fall_in_strips(cones: Any, strips: int, step: int) -> None:
    """Let cones fall in each strip of rows by itself, then from strip to strip."""
    rows = cones.shape[1]
    for number in jit.prange(cones.shape[0] * strips):
        n: Any = np.int64(number)
        sheet, strip = n // strips, n % strips
        _fall(cones[sheet], rows * strip // strips, rows * (strip + 1) // strips, step, False)
    for heights in cones:
        for n in range(1, strips):
            edge = rows * (n if step > 0 else strips - n) // strips
            _fall(heights, edge if step > 0 else 0, rows if step > 0 else edge, step, True)


@jit.kernel()
def _fall(heights: Any, begin: int, end: int, step: int, goes_on: bool) -> None:
    """Let cones fall on some rows; with `goes_on` those before them fall on, as far as they are seen."""
    columns = heights.shape[1]
    one = np.float32(1.0)
    first = begin if step > 0 else end - 1
    for k in range(end - begin):
        y = first + k * step
        here = heights[y]
        if k > 0 or goes_on:
            above, changed = heights[y - step], False
            for x, beside in ((0, min(1, columns - 1)), (columns - 1, max(columns - 2, 0))):
                highest = max(above[x], above[beside]) - one
                changed |= highest > here[x]
                here[x] = max(here[x], highest)
            # Counted from 0, which leaves no index to be tested for its sign.
            middle, left, right = here[1:], above[1:], above[2:]
            for x in range(columns - 2):
                highest = max(above[x], left[x], right[x]) - one
                changed |= highest > middle[x]
                middle[x] = max(middle[x], highest)
            if goes_on and not changed:
                return
        before = here[0 if step > 0 else columns - 1]
        for i in range(1, columns):
            x = i if step > 0 else columns - 1 - i
            before = max(here[x], before - one)
            here[x] = before


@jit.kernel(inline=True)
def _highest_beside(heights: Any, y: int, x: int) -> Any:
    """Return how high the cones that stand over other pixels are."""
    rows, columns = heights.shape
    if 0 < y < rows - 1 and 0 < x < columns - 1:
        above = max(heights[y - 1, x - 1], heights[y - 1, x], heights[y - 1, x + 1])
        below = max(heights[y + 1, x - 1], heights[y + 1, x], heights[y + 1, x + 1])
        return max(above, below, heights[y, x - 1], heights[y, x + 1]) - np.float32(1.0)
    found = np.float32(-np.inf)
    for v in range(max(0, y - 1), min(rows, y + 2)):
        for u in range(max(0, x - 1), min(columns, x + 2)):
            if v != y or u != x:
                found = max(found, heights[v, u])
    return found - np.float32(1.0)


@jit.kernel()
def _spread_tiles(reach: Any, radius: Any, lowest: Any) -> None:
    down, across = reach.shape
    for v in range(down):
        for u in range(across):
            if reach[v, u] <= 0.0:
                continue
            tiles = int((reach[v, u] + 1.0) // _TILE) + 1
            least = radius[v, u]
            for j in range(max(0, v - tiles), min(down, v + tiles + 1)):
                for i in range(max(0, u - tiles), min(across, u + tiles + 1)):
                    least = min(least, radius[j, i])
            for j in range(max(0, v - tiles), min(down, v + tiles + 1)):
                for i in range(max(0, u - tiles), min(across, u + tiles + 1)):
                    lowest[j, i] = min(lowest[j, i], least)


def _squares_seen(
    hiding: _Points, hidden: _Points, pinholes: Pinholes, shape: tuple[int, ...], whole: Whole, compiled: bool
) -> Mask:
    """Return which squares of the aperture see hidden fragments: (rows of squares, fragments), a bit each."""
    squares = np.zeros((pinholes.used.shape[0], hidden.radius.size), dtype=np.uint16)
    if compiled:
        farther = np.float32(whole.highest - whole.lowest + 2.0 * _RISE)
        singles = int(np.searchsorted(hiding.side, 1.0, side="right"))
        _look(hiding, singles, hidden, pinholes, whole.top, shape[0], shape[1], squares, farther)
    else:
        _look_numpy(hiding, hidden, pinholes, whole.top, shape[0], shape[1], squares)
    return squares


@jit.kernel(parallel=True)
def _look(
    hiding: _Points, singles: int, hidden: _Points, pinholes: Pinholes, top: int, rows: int,
    columns: int, squares: Any, farther: Any,
) -> None:  # fmt: skip
    """Draw fragments through each point of the aperture, and note which of those behind are seen.

    A row of points is one thread's work. Each draws nearer than all before it, by more than anything that is
    tested lies `farther` than what is drawn: what they left is as good as nothing, and need not be cleared.
    """
    for number in jit.prange(pinholes.used.shape[0]):
        row: Any = np.int64(number)
        # The last place takes what lies outside.
        nearest = np.empty(rows * columns + 1, dtype=np.float32)
        nearest[:] = np.float32(np.inf)
        place = np.empty(_CHUNK, dtype=np.uint32)
        for column in range(pinholes.used.shape[1]):
            if not pinholes.used[row, column]:
                continue
            nearer = np.float32(-column) * farther
            ax, ay = np.float32(pinholes.x[row, column]), np.float32(pinholes.y[row, column])
            dither = np.float32(_dither(row, column))
            _draw(hiding, singles, ax, ay, dither, nearer, nearest, top, rows, columns, place)
            nearest[rows * columns] = np.float32(np.inf)
            bit = np.uint16(1 << column)
            _test(hidden, ax, ay, nearer, nearest, top, rows, columns, squares, row, bit, place)


@jit.kernel(inline=True)
def _dither(row: Any, column: Any) -> Any:
    """Return where a point of the aperture begins to choose among partly covered pixels."""
    return (0.5 + 0.6180339887498949 * (row * CELLS + column)) % 1.0


@jit.kernel()
def _draw(
    points: _Points, singles: int, ax: Any, ay: Any, dither: Any, nearer: Any, nearest: Any, top: int,
    rows: int, columns: int, place: Any,
) -> None:  # fmt: skip
    """Draw fragments through a point of the aperture, each as large as its surface looks from there.

    The first `singles` have one pixel, and almost always look like one: surfaces hardly grow or shrink from
    one point of the aperture to another.
    """
    half, one = np.float32(0.5), np.float32(1.0)
    x, y, radius, level = points.x, points.y, points.radius, points.level
    slope_x, slope_y, coverage = points.slope_x, points.slope_y, points.coverage
    end_x, end_y, first_y = np.int32(columns), np.int32(rows), np.int32(top)
    outside = np.uint32(rows * columns)
    for first in range(0, singles, _CHUNK):
        count = min(_CHUNK, singles - first)
        # Without branches and in 32 bits, which the compiler turns into instructions for many at once.
        for i in range(count):
            k = first + i
            at_x, at_y = x[k] + radius[k] * ax, y[k] + radius[k] * ay
            half_x, half_y = half * (one + slope_x[k] * ax), half * (one + slope_y[k] * ay)
            u, v = np.int32(np.ceil(at_x - half_x)), np.int32(np.ceil(at_y - half_y))
            across, down = np.int32(np.ceil(at_x + half_x)) - u, np.int32(np.ceil(at_y + half_y)) - v
            v -= first_y
            chosen = level[k] + dither
            there = (chosen - np.floor(chosen) < coverage[k]) & (across >= 1) & (down >= 1)
            inside = (u >= 0) & (u < end_x) & (v >= 0) & (v < end_y)
            single = (across == 1) & (down == 1)
            place[i] = (np.uint32(v * end_x + u) if inside else outside) if there & single else outside
            place[i] += np.uint32(1) if there & (not single) else np.uint32(0)
        for i in range(count):
            if place[i] <= outside:
                nearest[place[i]] = min(nearest[place[i]], radius[first + i] + nearer)
            else:
                _draw_square(points, first + i, ax, ay, nearer, nearest, top, rows, columns)
    # All of a square is covered.
    for k in range(singles, radius.size):
        _draw_square(points, k, ax, ay, nearer, nearest, top, rows, columns)


@jit.kernel(inline=True)
def _draw_square(
    points: _Points, k: int, ax: Any, ay: Any, nearer: Any, nearest: Any, top: int, rows: int, columns: int
) -> None:
    """Draw a fragment that looks larger than a pixel."""
    half, one = np.float32(0.5), np.float32(1.0)
    at_x, at_y = points.x[k] + points.radius[k] * ax, points.y[k] + points.radius[k] * ay
    half_x = half * points.side[k] * (one + points.slope_x[k] * ax)
    half_y = half * points.side[k] * (one + points.slope_y[k] * ay)
    left, right = max(math.ceil(at_x - half_x), 0), min(math.ceil(at_x + half_x), columns)
    first, last = max(math.ceil(at_y - half_y) - top, 0), min(math.ceil(at_y + half_y) - top, rows)
    at = points.radius[k] + nearer
    across = right - left
    # As many at once as the compiler knows of; some are lowered twice.
    if across >= 8:
        for row in range(first, last):
            for begin in range(left, right - 8, 8):
                _lower(nearest, row * columns + begin, 8, at)
            _lower(nearest, row * columns + right - 8, 8, at)
    elif across >= 4:
        for row in range(first, last):
            _lower(nearest, row * columns + left, 4, at)
            _lower(nearest, row * columns + right - 4, 4, at)
    else:
        for row in range(first, last):
            for column in range(left, right):
                _lower(nearest, row * columns + column, 1, at)


@jit.kernel(inline=True)
def _lower(nearest: Any, place: int, count: int, at: Any) -> None:
    """Let nothing be farther than `at` in pixels of a row."""
    begin: Any = np.uint64(place)
    for n in range(count):
        nearest[begin + np.uint64(n)] = min(nearest[begin + np.uint64(n)], at)


@jit.kernel()
def _test(
    points: _Points, ax: Any, ay: Any, nearer: Any, nearest: Any, top: int, rows: int,
    columns: int, squares: Any, row: Any, bit: Any, place: Any,
) -> None:  # fmt: skip
    """Note which fragments nothing hides from a point of the aperture."""
    half = np.float32(0.5)
    x, y, radius, visible_to = points.x, points.y, points.radius, points.visible_to
    end_x, end_y, first_y = np.int32(columns), np.int32(rows), np.int32(top)
    outside = np.uint32(rows * columns)
    for first in range(0, radius.size, _CHUNK):
        count = min(_CHUNK, radius.size - first)
        for i in range(count):
            k = first + i
            u = np.int32(np.floor(x[k] + radius[k] * ax + half))
            v = np.int32(np.floor(y[k] + radius[k] * ay + half)) - first_y
            inside = (u >= 0) & (u < end_x) & (v >= 0) & (v < end_y)
            place[i] = np.uint32(v * end_x + u) if inside else outside
        for i in range(count):
            k = first + i
            squares[row, k] |= bit if visible_to[k] + nearer <= nearest[place[i]] else np.uint16(0)


def _look_numpy(
    hiding: _Points, hidden: _Points, pinholes: Pinholes, top: int, rows: int, columns: int, squares: Mask
) -> None:
    """Do the same, all fragments at once for one point of the aperture after the other."""
    half = np.float32(0.5)
    for row, column in np.argwhere(pinholes.used):
        ax, ay = np.float32(pinholes.x[row, column]), np.float32(pinholes.y[row, column])
        nearest = np.full(rows * columns, np.float32(np.inf))
        chosen = hiding.level + np.float32(_dither(row, column))
        p = _some(hiding, np.flatnonzero(chosen - np.floor(chosen) < hiding.coverage))
        at_x, at_y = p.x + p.radius * ax, p.y + p.radius * ay
        half_x, half_y = half * p.side * (1 + p.slope_x * ax), half * p.side * (1 + p.slope_y * ay)
        first_x, end_x = np.ceil(at_x - half_x).astype(np.int64), np.ceil(at_x + half_x).astype(np.int64)
        first_y = np.ceil(at_y - half_y).astype(np.int64) - top
        end_y = np.ceil(at_y + half_y).astype(np.int64) - top
        for j in range(int((end_y - first_y).max(initial=0))):
            for i in range(int((end_x - first_x).max(initial=0))):
                v, u = first_y + j, first_x + i
                at = (v < end_y) & (u < end_x) & (v >= 0) & (v < rows) & (u >= 0) & (u < columns)
                np.minimum.at(nearest, v[at] * columns + u[at], p.radius[at])
        u = np.floor(hidden.x + hidden.radius * ax + half).astype(np.int64)
        v = np.floor(hidden.y + hidden.radius * ay + half).astype(np.int64) - top
        inside = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
        before = np.full(hidden.radius.size, np.float32(np.inf))
        before[inside] = nearest[v[inside] * columns + u[inside]]
        squares[row, hidden.visible_to <= before] |= np.uint16(1 << int(column))


@jit.kernel(parallel=True)
def _add_shares(squares: Any, area: Any, bits: int, share: Any) -> None:
    """Add up the areas of the squares that see each fragment, a few squares of a row at a time.

    `area` has the sum for all squares that those few `bits` may tell of: (rows, parts of a row, sums).
    """
    for number in jit.prange(share.size):
        k: Any = np.int64(number)
        total = 0.0
        for row in range(area.shape[0]):
            for part in range(area.shape[1]):
                total += area[row, part, (squares[row, k] >> (part * bits)) & (area.shape[2] - 1)]
        share[k] = total


def _shares(squares: Mask, area: FloatArray, span: int) -> Float32Array:
    """Return the share of the aperture that sees each fragment."""
    count = CELLS // span
    bits = min(count, _BITS_AT_ONCE)
    parts = area.reshape(count, span, count // bits, bits, span).sum(axis=(1, 4))
    told = (np.arange(1 << bits)[:, np.newaxis] >> np.arange(bits)) & 1
    share = np.empty(squares.shape[1])
    _add_shares(squares, parts @ told.T, bits, share)
    # Sums of the same areas in another order.
    share[share > 1.0 - _ROUNDING] = 1.0
    return share.astype(np.float32)


@jit.kernel(parallel=True)
def _spread_squares(squares: Any, radius: Any, span: int, mask: Any) -> None:
    """Set the bits of the cells of each square, for circles that stand on their heads of those opposite."""
    all_ = (1 << span) - 1
    for number in jit.prange(radius.size):
        k: Any = np.int64(number)
        for row in range(squares.shape[0]):
            bits = 0
            for column in range(squares.shape[0]):
                if (int(squares[row, k]) >> column) & 1 == 1:
                    at = column * span if radius[k] >= 0.0 else CELLS - (column + 1) * span
                    bits |= all_ << at
            for j in range(row * span, (row + 1) * span):
                mask[k, j if radius[k] >= 0.0 else CELLS - 1 - j] = bits


def _masks(squares: Mask, radius: Float32Array, span: int) -> Mask:
    """Return the masks of fragments over their circles."""
    mask = np.zeros((radius.size, CELLS), dtype=np.uint16)
    _spread_squares(squares, radius, span, mask)
    return mask
