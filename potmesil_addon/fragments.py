"""What a lens may see of a layer: each pixel's surfaces, front to back, with what near ones hide.

A pinhole sees one surface at a pixel, or two where an anti-aliased edge passes through it. From other points
of the aperture one sees past near edges what the pinhole does not: a rendered hidden layer tells what is
there, or else the surface beside the edge is carried on behind it.

The kernels are loops that also run without numba, only slower.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from . import jit
from .samples import BRIGHT, Cryptomatte, Float32Array

# Bits of `jumps`: to which neighbour the depth jumps.
LEFT: Final = 1
RIGHT: Final = 2
UP: Final = 4
DOWN: Final = 8

_LEAST_JUMP: Final = 0.5
"""Difference in pixels of the radii of neighbours below which they show one surface, however it lies."""

_JUMP: Final = 1.0
"""Difference from which they never do: a surface along which the radius grows by more than a pixel each
pixel passes through the lens."""

_STEEPER: Final = 3.0
"""How much more than its neighbourhood a step between those must rise to be a jump."""

_WINDOW: Final = 2
"""Pixels around an edge, each way, in which the clean colours of its two surfaces are looked for."""

_SPACING: Final = 16
"""Rows between those that a thread works on one after the other."""

_LAMP: Final = 8.0
"""How many times as bright as those around a pixel is that is a highlight and no texture."""

_TWO_WIDE: Final = 0.7
"""Share of a pixel's neighbourhood from which a line is two pixels wide, of which the middle is full."""

_PURE: Final = 1.0 / 256.0
"""Share of a pixel below which a surface is taken not to touch it."""

_UNPLACED: Final = 0.1
"""Most of a pixel that may belong to ids that are on neither side of an edge, or on both."""

_NO_SHARE: Final = -1.0
"""Where it is not known what share of a pixel is the nearer surface's."""

_LEAST_RANGE: Final = 0.01
"""Least variance of the shares around a pixel from which the colours of both surfaces can be told."""

_LEAST_SQUARE: Final = 0.001
"""Least mean square of a surface's shares around a pixel that tell its colour, the other one's known."""

_CLEAN: Final = 0.95
"""Share of a pixel from which its colour is its surface's own: the ends of a filter are faint and far."""

_SLIVER: Final = 0.1
"""How far the part of a surface that a pixel shows may be off, as a share of how much both vary."""

_DEEPEST: Final = 4
"""Surfaces behind one another that are remembered along a line."""

_SMOOTHINGS: Final = 3
"""Times that what was carried on is averaged with its neighbours, against streaks along the lines."""

_BRIGHTER: Final = 3.0
"""How much brighter than what was carried on so far a pixel may count."""

_TEXTURE: Final = 3.0
"""Pixels over which errors of what was carried on are taken to go together."""

_MOST_SQUARE: Final = 1e30
"""Most that a square of light counts when it is added up in single precision."""

_LEAST_DOUBT: Final = 0.03
"""Least error of an edge pixel's shares."""

_LONG_MEMORY: Final = 0.1
"""The same for its variation as `_MEMORY` for the colour."""

AROUND: Final = 16
"""Rows around a row, and more, on which the split of its pixels depends."""

_ROWS_AT_ONCE: Final = 128
"""Rows of a survey that are looked at together."""

# What is remembered along a line: how many surfaces, the variation, the mean colour, and then radii, depths,
# places, variations and colours of the surfaces.
_RADIUS: Final = 6
_DEPTH: Final = _RADIUS + _DEEPEST
_AT: Final = _DEPTH + _DEEPEST
_VARIES: Final = _AT + _DEEPEST
_COLOR: Final = _VARIES + _DEEPEST
_REMEMBERED: Final = _COLOR + 4 * _DEEPEST

_NO_MEMORY: Final = np.zeros((0, _REMEMBERED))

_MEMORY: Final = 0.35
"""How much of the colour that is carried on behind an edge the last pixel before it makes up."""


class Fragments(NamedTuple):
    """The surfaces of each pixel: sheet 0 is what a pinhole sees first, the others lie behind it.

    Parameters
    ----------
    color : ndarray of float32 of shape (sheets, rows, columns, 4)
        Premultiplied, each surface's own.
    depth : ndarray of float32 of shape (sheets, rows, columns)
        Depth z' in metres; ``inf`` where there is no surface.
    radius : ndarray of float32 of shape (sheets, rows, columns)
        Signed radius of the circle of confusion in sample pixels along x, negative before the focus.
    coverage : ndarray of float32 of shape (sheets, rows, columns)
        Share of the pixel that the surface covers before anything hides it; 0 where there is none.
    guessed : ndarray of float32 of shape (sheets, rows, columns)
        1 where a surface was carried on, 0 where it was rendered.
    doubt : ndarray of float32 of shape (sheets, rows, columns)
        How far, on average over red, green and blue, the colour may be off: the variation of what was carried
        on, or what an edge pixel's two surfaces differ by, as far as their shares are not sure.
    slope : ndarray of float32 of shape (sheets, rows, columns, 2)
        Change of the radius along the surface, for each pixel in x and in y.
    reach : ndarray of float32 of shape (rows, columns)
        Beside an edge, how far in pixels it is felt: the difference of the radii. Elsewhere 0.
    """

    color: Float32Array
    depth: Float32Array
    radius: Float32Array
    coverage: Float32Array
    guessed: Float32Array
    doubt: Float32Array
    slope: Float32Array
    reach: Float32Array


class Beyond(NamedTuple):
    """What lies above and below a band of rows, as far as surfaces are carried on from there.

    Parameters
    ----------
    usual : float
        Light that is usual in the whole picture.
    first, last : int
        First row that is carried on from above, and the one after the first from below.
    down, up : ndarray of float64 of shape (columns, numbers)
        What is remembered there in each column; empty where nothing is.
    """

    usual: float
    first: int
    last: int
    down: npt.NDArray[np.float64]
    up: npt.NDArray[np.float64]

    def seen_from(self, row: int) -> Beyond:
        """Return the same with rows that count from another row."""
        moved = [self.down.copy(), self.up.copy()]
        for memory in moved:
            memory[:, _AT : _AT + _DEEPEST] -= row
        return Beyond(self.usual, self.first - row, self.last - row, *moved)


class Views(NamedTuple):
    """The views of a layer, see `fragments_of`."""

    color: Float32Array
    depth: Float32Array
    radius: Float32Array
    cryptomattes: Sequence[Cryptomatte | None]


def fragments_of(
    color: Float32Array,
    depth: Float32Array,
    radius: Float32Array,
    stretch: float,
    *,
    mixed: bool,
    cryptomattes: Sequence[Cryptomatte | None] = (),
    beyond: Beyond | None = None,
) -> Fragments:
    """Find the surfaces of each pixel in the views of a layer.

    Parameters
    ----------
    color : ndarray of float32 of shape (views, rows, columns, 4)
        Premultiplied: the layer's own view, then those of its hidden surfaces, nearest first.
    depth : ndarray of float32 of shape (views, rows, columns)
        Depth z' in metres.
    radius : ndarray of float32 of shape (views, rows, columns)
        Signed radius of the circle of confusion in pixels along x.
    stretch : float
        Larger axis of the aperture's image over the one along x.
    mixed : bool
        Whether a pixel at an edge has the colours of both surfaces (an ordinary render) or of the one that
        its depth tells (point samples).
    cryptomattes : sequence of Cryptomatte or None
        Of each view how much of a pixel is whose, where that is known.
    beyond : Beyond, optional
        Of a band of rows what lies above and below; by default nothing does.

    Returns
    -------
    Fragments
        As many sheets as views, and at least two.
    """
    found, own, jumps = _split_views(color, depth, radius, mixed=mixed, cryptomattes=cryptomattes)
    rows, columns = jumps.shape
    weight = np.zeros((rows, columns), dtype=np.float32)
    if beyond is None:
        beyond = Beyond(_usual(_roots(own), columns), 0, rows, _NO_MEMORY, _NO_MEMORY)
    usual = beyond.usual
    # As many as there are lines, and none for lines that begin at the picture's border.
    _carry_on(
        0, own, depth[0], radius[0], jumps, stretch, usual, found, weight, 0, columns, _NO_MEMORY, _NO_MEMORY
    )
    _carry_on(
        1, own, depth[0], radius[0], jumps, stretch, usual, found, weight, *beyond[1:3],
        beyond.down.copy(), beyond.up.copy(),
    )  # fmt: skip
    _finish(weight, found.radius, found.color, found.coverage, found.guessed, found.doubt)
    place = np.flatnonzero(found.guessed[1] != 0.0)
    smooth = np.empty((place.size, 4), dtype=np.float32)
    for _ in range(_SMOOTHINGS):
        _smooth(False, place, found.radius, found.coverage, found.color, smooth)
        _smooth(True, place, found.radius, found.coverage, found.color, smooth)
    return found


def _roots(own: Float32Array) -> npt.NDArray[np.float64]:
    """Return the sums over rows of the roots of colours, so that a few lamps do not count for much."""
    sums = np.zeros(own.shape[0])
    _add_roots(own, sums)
    return sums


def _usual(roots: npt.NDArray[np.float64], columns: int) -> float:
    """Return the light that is usual in a picture, of which the sums of the rows' roots are given."""
    return float(roots.sum() / (3 * roots.size * columns)) ** 2 * 3.0


def _split_views(
    color: Float32Array,
    depth: Float32Array,
    radius: Float32Array,
    *,
    mixed: bool,
    cryptomattes: Sequence[Cryptomatte | None],
) -> tuple[Fragments, Float32Array, npt.NDArray[np.uint8]]:
    """Find all but what is carried on; also the colours of the surfaces that depths tell, and jumps."""
    views, rows, columns = radius.shape
    sheets = max(2, views)
    found = Fragments(
        color=np.zeros((sheets, rows, columns, 4), dtype=np.float32),
        depth=np.repeat(depth[:1], sheets, axis=0),
        radius=np.repeat(radius[:1], sheets, axis=0),
        coverage=np.zeros((sheets, rows, columns), dtype=np.float32),
        guessed=np.zeros((sheets, rows, columns), dtype=np.float32),
        doubt=np.zeros((sheets, rows, columns), dtype=np.float32),
        slope=np.zeros((sheets, rows, columns, 2), dtype=np.float32),
        reach=np.zeros((rows, columns), dtype=np.float32),
    )
    jumps = np.zeros((rows, columns), dtype=np.uint8)
    edge = np.zeros((rows, columns), dtype=np.bool_)
    shares = np.full((rows, columns), _NO_SHARE, dtype=np.float32)
    nothing = np.zeros((0, rows, columns), dtype=np.float32)
    unknown = Cryptomatte(nothing.view(np.uint32), nothing)
    blended = np.zeros((rows, columns), dtype=np.bool_)
    for view in range(views - 1, -1, -1):
        _find_jumps(radius[view], jumps, found.slope[view], found.reach)
        _mark_edges(jumps, edge)
        found.color[view], found.depth[view], found.radius[view] = color[view], depth[view], radius[view]
        if mixed:
            matte = (cryptomattes[view] if view < len(cryptomattes) else None) or unknown
            _know_shares(matte.ids, matte.coverage, radius[view], edge, shares)
            _mark_blended(radius[view], edge, shares, blended)
            if view > 0:
                _purify(color[view], radius[view], blended, found.color[view])
    if views > 1:
        _keep_hidden(found.radius, found.coverage)
    found.coverage[0] = 1.0
    own = color[0]
    if mixed:
        own = np.empty_like(own)
        _split(
            color[0], depth[0], radius[0], edge, blended, shares, views > 1,
            *found[:4], found.doubt, found.slope, own,
        )  # fmt: skip
    return found, own, jumps


@dataclass(frozen=True, slots=True)
class Survey:
    """What is known of a picture before it is worked on in bands.

    Parameters
    ----------
    front : ndarray of float32 of shape (rows, columns, 4)
        Colours of sheet 0.
    own : ndarray of float32 of shape (rows, columns, 4)
        Colours of the surfaces that the depths tell, clean of others.
    jumps : ndarray of uint8 of shape (rows, columns)
        Where the depth jumps.
    usual : float
        Usual light.
    """

    front: Float32Array
    own: Float32Array
    jumps: npt.NDArray[np.uint8]
    usual: float


def survey(shape: tuple[int, int], views: Callable[[int, int], Views], *, mixed: bool) -> Survey:
    """Look at all of a picture, a few rows at a time.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns.
    views : callable
        Returns the views of the rows from one to before another.
    mixed : bool
        See `fragments_of`.

    Returns
    -------
    Survey
        The same, to the bit, as if looked at at once.
    """
    rows, columns = shape
    own, jumps = np.empty((rows, columns, 4), dtype=np.float32), np.empty((rows, columns), dtype=np.uint8)
    # Point samples show one surface each: both are what was rendered.
    front = np.empty_like(own) if mixed else own
    for first in range(0, rows, _ROWS_AT_ONCE):
        last = min(first + _ROWS_AT_ONCE, rows)
        top, bottom = max(first - AROUND, 0), min(last + AROUND, rows)
        part = views(top, bottom)
        found, own_part, jumps_part = _split_views(
            part.color, part.depth, part.radius, mixed=mixed, cryptomattes=part.cryptomattes
        )
        inside = slice(first - top, last - top)
        own[first:last], jumps[first:last] = own_part[inside], jumps_part[inside]
        if mixed:
            front[first:last] = found.color[0, inside]
    return Survey(front, own, jumps, _usual(_roots(own), columns))


def remembered(
    found: Survey, depth: Float32Array, radius: Float32Array, edges: Sequence[tuple[int, int]]
) -> list[Beyond]:
    """Return what is carried on into bands of rows from above and from below.

    Parameters
    ----------
    found : Survey
        The whole picture.
    depth, radius : ndarray of float32 of shape (rows, columns)
        Its depths, and its circles' radii.
    edges : sequence of (int, int)
        First row of each band, and the one after its last, in which what is carried on is to be right. They
        rise.

    Returns
    -------
    list of Beyond
        For each band; rows are those of the whole.
    """
    rows, columns = found.jumps.shape
    nothing = np.zeros((2, 0, 0), dtype=np.float32)
    of_four = nothing[..., np.newaxis]
    none = Fragments(of_four, nothing, nothing, nothing, nothing, nothing, of_four, nothing[0])
    memory = np.zeros((2, columns, _REMEMBERED))
    scan = found.own, depth, radius, found.jumps, -math.inf, found.usual, none, nothing[0]
    down, at = [], 0
    for first, _ in edges:
        if first > at:
            _carry_one_way(1, 1, *scan, at, first, memory[0])
            at = first
        down.append(memory[0].copy())
    up, at = [], rows
    for _, last in reversed(edges):
        if last < at:
            _carry_one_way(1, -1, *scan, last, at, memory[1])
            at = last
        up.append(memory[1].copy())
    return [
        Beyond(found.usual, *edge, above, below)
        for edge, above, below in zip(edges, down, reversed(up), strict=True)
    ]


def carried_past_the_border(
    fragments: list[Float32Array], beyond: tuple[tuple[int, int], tuple[int, int]]
) -> Fragments:
    """Carry all surfaces on past the samples' border, as guesses.

    Parameters
    ----------
    fragments : list of ndarray
        What `Fragments` consists of, in its order; the list is emptied.
    beyond : tuple of (int, int)
        Rows above and below, columns left and right.

    Returns
    -------
    Fragments
        The same with that many more rows and columns, the last ones again and again.
    """
    (above, below), (left, right) = beyond
    if not (above or below or left or right):
        result = Fragments(*fragments)
        fragments.clear()
        return result
    rows, columns = fragments[-1].shape
    shape = above + rows + below, left + columns + right
    padded: list[Float32Array] = []
    while fragments:
        values = fragments.pop(0)
        # The last has no sheets, and some have several numbers for each place.
        numbers = values.shape[3:]
        more = np.empty((*values.shape[: 1 if fragments else 0], *shape, *numbers), dtype=np.float32)
        count = math.prod(numbers)
        _carry_past(values.reshape(-1, rows, columns, count), above, left, more.reshape(-1, *shape, count))
        padded.append(more)
    result = Fragments(*padded)
    guessed = result.guessed
    for strip in (
        guessed[:, :above], guessed[:, above + rows :], guessed[..., :left], guessed[..., left + columns :]
    ):  # fmt: skip
        strip[:] = 1.0
    return result


@jit.kernel(parallel=True)
def _carry_past(values: Any, above: int, left: int, more: Any) -> None:
    """Copy sheets of values into larger ones, at `above` and `left`, and the outermost ones beyond."""
    rows, columns = values.shape[1:3]
    for number in jit.prange(more.shape[0] * more.shape[1]):
        n: Any = np.int64(number)
        sheet, row = n // more.shape[1], n % more.shape[1]
        y = min(max(row - above, 0), rows - 1)
        source, target = values[sheet, y].reshape(-1), more[sheet, row].reshape(-1)
        count = values.shape[3]
        for i in range(columns * count):
            target[left * count + i] = source[i]
        for x in range(left):
            for c in range(count):
                target[x * count + c] = source[c]
        for x in range(left + columns, more.shape[2]):
            for c in range(count):
                target[x * count + c] = source[(columns - 1) * count + c]


@jit.kernel(inline=True)
def _jumps_between(before: float, here: float, there: float, after: float) -> bool:
    """Return whether two neighbours show different surfaces, given what lies on either side of them."""
    step = there - here
    rise = abs(step)
    if rise <= _LEAST_JUMP:
        return False
    sign = 1.0 if step > 0.0 else -1.0
    steepness = max(0.0, min(sign * (here - before), sign * (after - there)))
    return rise > min(_JUMP, _LEAST_JUMP + _STEEPER * steepness)


@jit.kernel(parallel=True)
def _find_jumps(radius: Any, jumps: Any, slope: Any, reach: Any) -> None:
    """Find where the depth jumps, how far that is felt, and how surfaces lie in between."""
    rows, columns = radius.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for x in range(columns):
            here = radius[y, x]
            bits = 0
            farthest = 0.0
            for axis in range(2):
                at, end = (x, columns - 1) if axis == 0 else (y, rows - 1)
                rise, count = 0.0, 0
                for side in (-1, 1):
                    if (side < 0 and at == 0) or (side > 0 and at == end):
                        continue
                    i, j = (side, 0) if axis == 0 else (0, side)
                    there = radius[y + j, x + i]
                    # Where the picture ends the surface is taken to go on as on the other side.
                    has_before, has_after = 0 <= at - side <= end, 0 <= at + 2 * side <= end
                    before = radius[y - j, x - i] if has_before else here
                    after = radius[y + 2 * j, x + 2 * i] if has_after else there
                    if not has_before:
                        before = here - (after - there)
                    if not has_after:
                        after = there + (here - before)
                    if _jumps_between(before, here, there, after):
                        bits |= (LEFT if side < 0 else RIGHT) if axis == 0 else (UP if side < 0 else DOWN)
                        farthest = max(farthest, abs(there - here))
                    else:
                        rise += side * (there - here)
                        count += 1
                slope[y, x, axis] = rise / count if count > 0 else 0.0
            jumps[y, x] = bits
            reach[y, x] = farthest


@jit.kernel(parallel=True)
def _mark_edges(jumps: Any, edge: Any) -> None:
    """Mark pixels beside a jump, also across a corner: an ordinary pixel filter mixes surfaces there."""
    rows, columns = jumps.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for x in range(columns):
            found = jumps[y, x] != 0
            if not found:
                # Across a corner there is a jump on the way there, round it.
                for i, across in ((-1, LEFT), (1, RIGHT)):
                    for j, along in ((-1, UP), (1, DOWN)):
                        if 0 <= y + j < rows and 0 <= x + i < columns:
                            found = found or (jumps[y, x + i] & along) != 0 or (jumps[y + j, x] & across) != 0
            edge[y, x] = found


@jit.kernel()
def _middle_of(radius: Any, y: int, x: int, reach: int) -> tuple[float, float]:
    """Return the radius between the two surfaces around a pixel, and how far they are apart."""
    rows, columns = radius.shape
    low, high = radius[y, x], radius[y, x]
    for v in range(max(0, y - reach), min(rows, y + reach + 1)):
        for u in range(max(0, x - reach), min(columns, x + reach + 1)):
            low, high = min(low, radius[v, u]), max(high, radius[v, u])
    return 0.5 * (low + high), high - low


@jit.kernel()
def _cover_of(ids: Any, coverage: Any, y: int, x: int, wanted: Any) -> float:
    """Return an id's share of a pixel; that of 0 is what has none."""
    cover = 0.0
    for rank in range(ids.shape[0]):
        if wanted == 0:
            cover += coverage[rank, y, x]
        elif ids[rank, y, x] == wanted:
            return float(coverage[rank, y, x])
    return max(0.0, 1.0 - cover) if wanted == 0 else 0.0


@jit.kernel()
def _side_of(ids: Any, coverage: Any, radius: Any, y: int, x: int, middle: float, wanted: Any) -> int:
    """Return whether an id is the nearer surface's (-1), the farther one's (1) or cannot be told (0).

    Where it fills pixels, their depths tell. Something thinner is where it covers most.
    """
    rows, columns = radius.shape
    whole_near, whole_far = 0, 0
    near, far, near_count, far_count = 0.0, 0.0, 0, 0
    for v in range(max(0, y - _WINDOW), min(rows, y + _WINDOW + 1)):
        for u in range(max(0, x - _WINDOW), min(columns, x + _WINDOW + 1)):
            cover = _cover_of(ids, coverage, v, u, wanted)
            whole = cover > 1.0 - _PURE
            if radius[v, u] < middle:
                near += cover
                near_count += 1
                whole_near += 1 if whole else 0
            else:
                far += cover
                far_count += 1
                whole_far += 1 if whole else 0
    if whole_near > 0 or whole_far > 0:
        if whole_near > 0 and whole_far > 0:
            return 0
        return -1 if whole_near > 0 else 1
    if near_count == 0 or far_count == 0:
        return 0
    near, far = near / near_count, far / far_count
    return 0 if near == far else (-1 if near > far else 1)


@jit.kernel(inline=True)
def _row_from_all_over(number: Any, rows: int) -> Any:
    """Return the rows in an order in which any thread, which takes neighbours in it, gets some from all over.

    Where the edges are in a picture is where the work is. Some numbers give no row of the picture.
    """
    n: Any = np.int64(number)
    each = (rows + _SPACING - 1) // _SPACING
    return n % each * _SPACING + n // each


@jit.kernel(parallel=True)
def _know_shares(ids: Any, coverage: Any, radius: Any, edge: Any, shares: Any) -> None:
    """Find from coverages the nearer surface's share of each pixel at an edge, where they tell.

    Also near an edge, where something thin may cover a part of a pixel and no depth beside it tells so.
    """
    rows, columns = radius.shape
    for number in jit.prange((rows + _SPACING - 1) // _SPACING * _SPACING):
        y = _row_from_all_over(number, rows)
        for x in range(columns if y < rows else 0):
            shares[y, x] = _NO_SHARE
            if ids.shape[0] == 0:
                continue
            if not edge[y, x]:
                # Ranks fall: mostly the first one tells.
                most, left = coverage[0, y, x], 1.0
                if most >= 1.0 - _PURE:
                    continue
                for rank in range(ids.shape[0]):
                    most, left = max(most, coverage[rank, y, x]), left - coverage[rank, y, x]
                if max(most, left) >= 1.0 - _PURE:
                    continue
            middle, apart = _middle_of(radius, y, x, 1 if edge[y, x] else _WINDOW)
            if apart <= _LEAST_JUMP:
                continue
            near, far = 0.0, 0.0
            for rank in range(ids.shape[0] + 1):
                # At last what no surface covers.
                wanted = ids[rank, y, x] if rank < ids.shape[0] else np.uint32(0)
                if rank < ids.shape[0] and wanted == 0:
                    continue
                cover = _cover_of(ids, coverage, y, x, wanted)
                if cover <= 0.0:
                    continue
                side = _side_of(ids, coverage, radius, y, x, middle, wanted)
                if side < 0:
                    near += cover
                elif side > 0:
                    far += cover
            if near + far >= 1.0 - _UNPLACED:
                shares[y, x] = near / (near + far)


@jit.kernel(parallel=True)
def _mark_blended(radius: Any, edge: Any, shares: Any, blended: Any) -> None:
    """Mark the pixels that may show more than the surface that their depth tells."""
    rows, columns = radius.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for x in range(columns):
            blended[y, x] = edge[y, x]
            if shares[y, x] >= 0.0:
                middle, _ = _middle_of(radius, y, x, 1 if edge[y, x] else _WINDOW)
                own = shares[y, x] if radius[y, x] < middle else 1.0 - shares[y, x]
                blended[y, x] = own < _CLEAN


@jit.kernel()
def _colors_of_both(
    color: Any, radius: Any, blended: Any, shares: Any, y: int, x: int,
    near: float, far: float, apart: float, front: Any, back: Any, has_front: bool, has_back: bool,
) -> bool:  # fmt: skip
    """Find by least squares the colours of two surfaces of which only mixtures with known shares are seen.

    One of them may be given. Return whether the shares tell.
    """
    rows, columns = radius.shape
    ff, fb, bb, total = 0.0, 0.0, 0.0, 0.0
    f, b = np.zeros(4), np.zeros(4)
    for v in range(max(0, y - _WINDOW), min(rows, y + _WINDOW + 1)):
        for u in range(max(0, x - _WINDOW), min(columns, x + _WINDOW + 1)):
            is_near, is_far = abs(radius[v, u] - near) <= apart, abs(radius[v, u] - far) <= apart
            if not (is_near or is_far):
                continue
            share = shares[v, u]
            if not blended[v, u]:
                share = 1.0 if is_near else 0.0
            elif share < 0.0:
                continue
            w = 1.0 / (1.0 + (v - y) * (v - y) + (u - x) * (u - x))
            total += w
            ff += w * share * share
            fb += w * share * (1.0 - share)
            bb += w * (1.0 - share) * (1.0 - share)
            for c in range(4):
                f[c] += w * share * color[v, u, c]
                b[c] += w * (1.0 - share) * color[v, u, c]
    determinant = ff * bb - fb * fb
    if has_front:
        if bb <= _LEAST_SQUARE * total:
            return False
        for c in range(4):
            back[c] = max(0.0, (b[c] - fb * front[c]) / bb)
    elif has_back:
        if ff <= _LEAST_SQUARE * total:
            return False
        for c in range(4):
            front[c] = max(0.0, (f[c] - fb * back[c]) / ff)
    else:
        if determinant <= _LEAST_RANGE * total * total:
            return False
        for c in range(4):
            front[c] = max(0.0, (bb * f[c] - fb * b[c]) / determinant)
            back[c] = max(0.0, (ff * b[c] - fb * f[c]) / determinant)
    return True


@jit.kernel()
def _clean_color(
    color: Any, radius: Any, edge: Any, y: int, x: int, wanted: float, apart: float, mean: Any
) -> float:
    """Put the mean colour of a surface near a pixel into `mean`; return its variance, -1 where none is."""
    rows, columns = radius.shape
    # A lamp in the window is no part of the surface's colour. Roots, so that it does not raise the level.
    level, total = 0.0, 0.0
    for v in range(max(0, y - _WINDOW), min(rows, y + _WINDOW + 1)):
        for u in range(max(0, x - _WINDOW), min(columns, x + _WINDOW + 1)):
            if not edge[v, u] and abs(radius[v, u] - wanted) <= apart:
                level += math.sqrt(max(color[v, u, 0] + color[v, u, 1] + color[v, u, 2], 0.0))
                total += 1.0
    most = _LAMP * (level / max(total, 1.0)) ** 2
    total, square = 0.0, 0.0
    for c in range(4):
        mean[c] = 0.0
    for v in range(max(0, y - _WINDOW), min(rows, y + _WINDOW + 1)):
        for u in range(max(0, x - _WINDOW), min(columns, x + _WINDOW + 1)):
            if edge[v, u] or abs(radius[v, u] - wanted) > apart:
                continue
            light = color[v, u, 0] + color[v, u, 1] + color[v, u, 2]
            if light > most or light < -BRIGHT:
                continue
            w = 1.0 / (1.0 + (v - y) * (v - y) + (u - x) * (u - x))
            total += w
            for c in range(4):
                value = color[v, u, c]
                mean[c] += w * value
                square += w * value * value
    if total == 0.0:
        return -1.0
    length = 0.0
    for c in range(4):
        mean[c] /= total
        length += mean[c] * mean[c]
    return max(0.0, square / total - length)


@jit.kernel()
def _nearest_of(radius: Any, y: int, x: int, middle: float, near: bool) -> tuple[int, int]:
    """Return the pixel of a surface, nearer or farther than `middle`, next to a pixel or itself."""
    rows, columns = radius.shape
    best, best_y, best_x = 9, y, x
    for j in (-1, 0, 1):
        for i in (-1, 0, 1):
            v, u = y + j, x + i
            if 0 <= v < rows and 0 <= u < columns and (radius[v, u] < middle) == near:
                distance = j * j + i * i
                if distance < best:
                    best, best_y, best_x = distance, v, u
    return best_y, best_x


@jit.kernel(parallel=True)
def _split(
    color: Any, depth: Any, radius: Any, edge: Any, blended: Any, shares: Any, has_hidden: bool,
    out_color: Any, out_depth: Any, out_radius: Any, out_coverage: Any, out_doubt: Any, out_slope: Any,
    own: Any,
) -> None:  # fmt: skip
    """Split the pixels at edges into their two surfaces, so that these add up to the pixel again.

    `own` gets the colours of those surfaces that the depths tell; of pixels in one piece, the pixels'.

    Where the share of the nearer one is not known, it follows from the pixel's colour and the clean colours
    beside the edge, or, where those do not differ enough to tell, from how many neighbours show it.
    """
    rows, columns = radius.shape
    for number in jit.prange((rows + _SPACING - 1) // _SPACING * _SPACING):
        y = _row_from_all_over(number, rows)
        front, back = np.empty(4), np.empty(4)
        for x in range(columns if y < rows else 0):
            for c in range(4):
                own[y, x, c] = color[y, x, c]
            if not edge[y, x]:
                continue
            here = radius[y, x]
            middle, between = _middle_of(radius, y, x, 1)
            if between <= _LEAST_JUMP:
                continue
            # Nearer to the one surface than to the other.
            apart = min(_JUMP, 0.5 * between)
            is_near = here < middle
            near_y, near_x = _nearest_of(radius, y, x, middle, True)
            far_y, far_x = _nearest_of(radius, y, x, middle, False)
            near_radius, far_radius = radius[near_y, near_x], radius[far_y, far_x]
            front_varies = _clean_color(color, radius, blended, y, x, near_radius, apart, front)
            back_varies = _clean_color(color, radius, blended, y, x, far_radius, apart, back)
            # The view of the hidden surfaces shows the farther one whole.
            rendered = has_hidden and out_radius[1, y, x] > middle
            if rendered:
                back_varies = 0.0
                for c in range(4):
                    back[c] = out_color[1, y, x, c]
            known = shares[y, x] >= 0.0
            if known and (front_varies < 0.0 or back_varies < 0.0):
                told = _colors_of_both(
                    color, radius, blended, shares, y, x, near_radius, far_radius, apart,
                    front, back, front_varies >= 0.0, back_varies >= 0.0,
                )  # fmt: skip
                if told:
                    # As sure as the other one.
                    varies = max(front_varies, back_varies, 0.0)
                    front_varies = varies if front_varies < 0.0 else front_varies
                    back_varies = varies if back_varies < 0.0 else back_varies
            thin = is_near and front_varies < 0.0
            if back_varies < 0.0 and (thin or not is_near):
                # Nothing wider than the edge itself tells what these surfaces look like.
                continue
            if front_varies < 0.0:
                front_varies = 0.0
                for c in range(4):
                    front[c] = color[near_y, near_x, c]
            if back_varies < 0.0:
                back_varies = 0.0
                for c in range(4):
                    back[c] = color[far_y, far_x, c]
            expected, total = 0.0, 0.0
            for v in range(max(0, y - 1), min(rows, y + 2)):
                for u in range(max(0, x - 1), min(columns, x + 2)):
                    w = (2.0 - abs(v - y)) * (2.0 - abs(u - x))
                    total += w
                    if radius[v, u] < middle:
                        expected += w
            expected /= total
            along, length, size = 0.0, 0.0, 0.0
            for c in range(4):
                d = front[c] - back[c]
                along += (color[y, x, c] - back[c]) * d
                length += d * d
                size += front[c] * front[c] + back[c] * back[c]
            doubt = front_varies + back_varies + 1e-4 * size + 1e-12
            share = min(max((along + doubt * expected) / (length + doubt), 0.0), 1.0)
            clear = front[3] - back[3] > 0.5
            if known:
                share = shares[y, x]
            elif clear:
                # Before a clear film the alpha is the share, whatever the colours.
                share = min(max((color[y, x, 3] - back[3]) / (front[3] - back[3]), 0.0), 1.0)
            if thin:
                # A line of which no pixel is full: at least as much as no light at all would take away.
                if not known:
                    share = expected if expected < _TWO_WIDE else 1.0
                    for c in range(4):
                        if back[c] > 0.0:
                            share = max(share, min(1.0 - color[y, x, c] / back[c], 1.0))
                if share >= _PURE:
                    for c in range(4):
                        front[c] = max(0.0, (color[y, x, c] - (1.0 - share) * back[c]) / share)
            elif not known:
                unexplained = 0.0
                for c in range(4):
                    off = color[y, x, c] - share * front[c] - (1.0 - share) * back[c]
                    unexplained += off * off
                if unexplained > length + 4.0 * doubt:
                    # Something else is there, such as a lamp: it stays where the depth says.
                    continue
            if share < _PURE:
                if is_near:
                    # What the depth saw is a sliver: the pixel shows the other surface.
                    out_depth[0, y, x], out_radius[0, y, x] = depth[far_y, far_x], far_radius
                    out_slope[0, y, x, :] = 0.0
                    out_coverage[1, y, x] = 0.0
                continue
            if not is_near:
                out_depth[0, y, x], out_radius[0, y, x] = depth[near_y, near_x], near_radius
                out_slope[0, y, x, :] = 0.0
            if share > 1.0 - _PURE:
                continue
            unsure = math.sqrt(length / 3.0 * doubt / (length + doubt)) + _LEAST_DOUBT * math.sqrt(
                length / 3.0
            )
            out_doubt[0, y, x], out_doubt[1, y, x] = unsure, unsure
            # What the two do not explain is given to both, to each as far as it varies, so that the pixel
            # stays what it was.
            least = _SLIVER * (front_varies + back_varies) + 1e-4 * size + 1e-12
            to_front, to_back = share * (front_varies + least), (1.0 - share) * (back_varies + least)
            if rendered or clear:
                to_front, to_back = 1.0, 0.0
            rest = share * to_front + (1.0 - share) * to_back
            for c in range(4):
                whole = color[y, x, c]
                off = whole - share * front[c] - (1.0 - share) * back[c]
                near = front[c] + off * to_front / rest
                far = back[c] + off * to_back / rest
                if near < 0.0:
                    near, far = 0.0, whole / (1.0 - share)
                elif far < 0.0:
                    near, far = whole / share, 0.0
                elif c == 3 and near > 1.0:
                    near, far = 1.0, (whole - share) / (1.0 - share)
                elif c == 3 and far > 1.0:
                    near, far = (whole - 1.0 + share) / share, 1.0
                out_color[0, y, x, c], out_color[1, y, x, c] = near, far
                own[y, x, c] = near if here == out_radius[0, y, x] else far
            out_coverage[0, y, x] = share
            out_coverage[1, y, x] = 1.0
            if not rendered:
                out_depth[1, y, x], out_radius[1, y, x] = depth[far_y, far_x], far_radius


@jit.kernel(parallel=True)
def _purify(color: Any, radius: Any, edge: Any, output: Any) -> None:
    """Give pixels at edges the clean colour of the surface that their depth tells."""
    rows, columns = radius.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        mean = np.empty(4)
        for x in range(columns):
            if edge[y, x] and _clean_color(color, radius, edge, y, x, radius[y, x], _LEAST_JUMP, mean) >= 0.0:
                for c in range(4):
                    output[y, x, c] = mean[c]


@jit.kernel(parallel=True)
def _keep_hidden(radius: Any, coverage: Any) -> None:
    """Keep of the views of hidden surfaces what lies behind the view before it."""
    views, rows, columns = radius.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for x in range(columns):
            last = radius[0, y, x]
            for view in range(1, views):
                if radius[view, y, x] - last > _LEAST_JUMP:
                    last = radius[view, y, x]
                    coverage[view, y, x] = 1.0


@jit.kernel(parallel=True)
def _add_roots(color: Any, sums: Any) -> None:
    """Add up the square roots of the colours of each row, but for those that tell nothing of the others."""
    rows, columns = color.shape[:2]
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        total = 0.0
        for x in range(columns):
            for c in range(3):
                if color[y, x, c] <= BRIGHT:
                    total += math.sqrt(max(color[y, x, c], 0.0))
        sums[y] = total


@jit.kernel()
def _carry_along(
    line: int, axis: int, way: int,
    own: Any, depth: Any, radius: Any, jumps: Any, stretch: float, usual: float,
    found: Fragments, weight: Any, begin: int, end: int, memory: Any,
) -> None:  # fmt: skip
    """Carry surfaces on behind what hides them, one way along one line from `begin` to before `end`.

    A surface that a nearer one interrupts is remembered until it is met again or passed, and stands behind
    the nearer one as far as the lens can look past the edge. Where the line goes on before it begins,
    `memory` has what is remembered there; what it is at the end goes there too.
    """
    sheets = found.coverage.shape[0]
    jump = RIGHT if way > 0 else LEFT
    if axis == 1:
        jump = DOWN if way > 0 else UP
    seen_radius, seen_depth = np.empty(_DEEPEST), np.empty(_DEEPEST)
    seen_at, seen_color = np.empty(_DEEPEST, dtype=np.int64), np.empty((_DEEPEST, 4))
    seen_varies = np.empty(_DEEPEST)
    mean = np.zeros(4)
    varies = 0.0
    open_ = 0
    last_y, last_x = -1, -1
    before = begin - 1 if way > 0 else end
    remembers = memory.shape[0] > 0
    if remembers and 0 <= before < radius.shape[1 - axis]:
        last_y, last_x = (line, before) if axis == 0 else (before, line)
        kept = memory[line]
        open_, varies = int(kept[0]), kept[1]
        for c in range(4):
            mean[c] = kept[2 + c]
        for k in range(_DEEPEST):
            seen_radius[k], seen_depth[k] = kept[_RADIUS + k], kept[_DEPTH + k]
            seen_at[k], seen_varies[k] = int(kept[_AT + k]), kept[_VARIES + k]
            for c in range(4):
                seen_color[k, c] = kept[_COLOR + 4 * k + c]
    for step in range(end - begin):
        at = begin + step if way > 0 else end - 1 - step
        y, x = (line, at) if axis == 0 else (at, line)
        here = radius[y, x]
        parts = last_y >= 0 and (jumps[last_y, last_x] & jump) != 0
        if parts and here < radius[last_y, last_x]:
            if open_ == _DEEPEST:
                for k in range(1, _DEEPEST):
                    seen_radius[k - 1], seen_depth[k - 1] = seen_radius[k], seen_depth[k]
                    seen_at[k - 1], seen_varies[k - 1] = seen_at[k], seen_varies[k]
                    for c in range(4):
                        seen_color[k - 1, c] = seen_color[k, c]
                open_ -= 1
            seen_radius[open_], seen_depth[open_] = radius[last_y, last_x], depth[last_y, last_x]
            seen_at[open_], seen_varies[open_] = at - way, varies
            for c in range(4):
                seen_color[open_, c] = mean[c]
            open_ += 1
        fresh = parts or last_y < 0
        bright = own[y, x, 0] + own[y, x, 1] + own[y, x, 2]
        most = max(0.0 if fresh else _BRIGHTER * (mean[0] + mean[1] + mean[2]), 2.0 * usual)
        # Most highlights are small: one beside an edge is not taken to go on behind it.
        dimmed = 1.0
        if most < bright and not fresh:
            dimmed = most / bright
        elif abs(bright) > BRIGHT:
            dimmed = min(most / abs(bright), 1.0)
        off = 0.0
        for c in range(3):
            off += (dimmed * own[y, x, c] - mean[c]) / 3.0
        varies = 0.0 if fresh else varies + _LONG_MEMORY * (off * off - varies)
        for c in range(4):
            value = own[y, x, c] * (dimmed if c < 3 else 1.0)
            mean[c] = value if fresh else mean[c] + _MEMORY * (value - mean[c])
        last_y, last_x = y, x
        while open_ > 0 and seen_radius[open_ - 1] - here <= _LEAST_JUMP:
            open_ -= 1
        if open_ == 0:
            continue
        top = open_ - 1
        away = abs(at - seen_at[top])
        if away > (seen_radius[top] - here) * stretch + 1.0:
            continue
        rendered = False
        for s in range(1, sheets):
            rendered = rendered or found.coverage[s, y, x] > 0.0
        if rendered:
            continue
        w = 1.0 / (away * away)
        alike = abs(seen_radius[top] - found.radius[1, y, x]) <= _JUMP
        # guessed holds the weight of the nearest edge until all are known.
        level = (seen_color[top, 0] + seen_color[top, 1] + seen_color[top, 2]) / 3.0
        # doubt holds the sum of squares until all are known.
        square = min(w * (seen_varies[top] + level * level), _MOST_SQUARE)
        if weight[y, x] == 0.0 or (not alike and w > found.guessed[1, y, x]):
            weight[y, x] = w
            found.doubt[1, y, x] = square
            for c in range(4):
                found.color[1, y, x, c] = w * seen_color[top, c]
        elif alike:
            weight[y, x] += w
            found.doubt[1, y, x] += square
            for c in range(4):
                found.color[1, y, x, c] += w * seen_color[top, c]
        if w > found.guessed[1, y, x]:
            found.guessed[1, y, x] = w
            found.radius[1, y, x], found.depth[1, y, x] = seen_radius[top], seen_depth[top]
    if remembers:
        kept = memory[line]
        kept[0], kept[1] = open_, varies
        for c in range(4):
            kept[2 + c] = mean[c]
        for k in range(open_):
            kept[_RADIUS + k], kept[_DEPTH + k] = seen_radius[k], seen_depth[k]
            kept[_AT + k], kept[_VARIES + k] = seen_at[k], seen_varies[k]
            for c in range(4):
                kept[_COLOR + 4 * k + c] = seen_color[k, c]


@jit.kernel(parallel=True)
def _carry_on(
    axis: int,
    own: Any,
    depth: Any,
    radius: Any,
    jumps: Any,
    stretch: float,
    usual: float,
    found: Fragments,
    weight: Any,
    first: int,
    last: int,
    memory: Any,
    memory_back: Any,
) -> None:
    """Carry surfaces on behind what hides them, along all lines of an axis, both ways.

    On the way there from `first` to the line's end, on the way back from before `last` to its beginning.
    """
    for number in jit.prange(radius.shape[axis]):
        line: Any = np.int64(number)
        _carry_along(
            line, axis, 1, own, depth, radius, jumps, stretch, usual, found, weight, first,
            radius.shape[1 - axis], memory,
        )  # fmt: skip
        _carry_along(
            line, axis, -1, own, depth, radius, jumps, stretch, usual, found, weight, 0, last, memory_back,
        )  # fmt: skip


@jit.kernel(parallel=True)
def _carry_one_way(
    axis: int,
    way: int,
    own: Any,
    depth: Any,
    radius: Any,
    jumps: Any,
    stretch: float,
    usual: float,
    found: Fragments,
    weight: Any,
    begin: int,
    end: int,
    memory: Any,
) -> None:
    """Carry surfaces on along a piece of all lines of an axis, one way."""
    for number in jit.prange(radius.shape[axis]):
        line: Any = np.int64(number)
        _carry_along(
            line, axis, way, own, depth, radius, jumps, stretch, usual, found, weight, begin, end, memory
        )


@jit.kernel(parallel=True)
def _finish(weight: Any, radius: Any, color: Any, coverage: Any, guessed: Any, doubt: Any) -> None:
    """Turn the sums of what was carried on into means."""
    rows, columns = weight.shape
    for row in jit.prange(rows):
        y: Any = np.int64(row)
        for x in range(columns):
            if weight[y, x] > 0.0:
                for c in range(4):
                    color[1, y, x, c] /= weight[y, x]
                level = (color[1, y, x, 0] + color[1, y, x, 1] + color[1, y, x, 2]) / 3.0
                variance = max(0.0, doubt[1, y, x] / weight[y, x] - level * level)
                # A wide circle mixes places whose errors have nothing to do with each other.
                doubt[1, y, x] = math.sqrt(variance) / (1.0 + abs(radius[1, y, x]) / _TEXTURE)
                coverage[1, y, x] = 1.0
                guessed[1, y, x] = 1.0


@jit.kernel(parallel=True)
def _smooth(done: bool, place: Any, radius: Any, coverage: Any, color: Any, smooth: Any) -> None:
    """Average what was carried on with its neighbours of the same surface, at the places given.

    Once that is done for all of them, the colours are replaced.
    """
    rows, columns = coverage.shape[1:]
    for number in jit.prange(place.size):
        k: Any = np.int64(number)
        y, x = place[k] // columns, place[k] % columns
        if done:
            for c in range(4):
                color[1, y, x, c] = smooth[k, c]
            continue
        total = 0.0
        r, g, b, a = 0.0, 0.0, 0.0, 0.0
        for v in range(max(0, y - 1), min(rows, y + 2)):
            for u in range(max(0, x - 1), min(columns, x + 2)):
                if coverage[1, v, u] > 0.0 and abs(radius[1, v, u] - radius[1, y, x]) <= _JUMP:
                    total += 1.0
                    r, g = r + color[1, v, u, 0], g + color[1, v, u, 1]
                    b, a = b + color[1, v, u, 2], a + color[1, v, u, 3]
        smooth[k, 0], smooth[k, 1] = r / total, g / total
        smooth[k, 2], smooth[k, 3] = b / total, a / total
