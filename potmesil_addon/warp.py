"""Instantaneous images: samples moved to where they are at an instant, the nearest one seen.

Samples are joined to sheets, one quad between four neighbours. At an instant every sample stands where
its path has led it, the quads are drawn into the pixels with colours and inverse depths interpolated,
and what is nearer hides what is farther, at that instant and not once for the frame. The mean over
instants that have equal shares of the light is eq. 3-4 of 1983.

Two implementations give the same picture: numba kernels, tile by tile on all cores, and a numpy path
for machines without numba.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from . import jit
from .lens import FloatArray
from .samples import Float32Array
from .scatter import Backend, uses_numba

TILE_ROWS: Final = 64
TILE_COLUMNS: Final = 128
"""Pixels that one thread works on at a time: their sums and fragments stay in its cache."""

_BLOCK_ROWS: Final = 8
_BLOCK_COLUMNS: Final = 16
"""Quads of which it is known together which pixels they reach at an instant."""

_RUN: Final = 16
"""Blocks in a row that are drawn together at most."""

_LINE: Final = _RUN * _BLOCK_COLUMNS + 8
"""Numbers of one kind along a run: a sample more than quads, rounded up.

Arrays of several kinds, such as x, y and inverse depth, have them this far apart. Only as it is a constant
can the compiler see that they do not overlap, and work on several samples at once.
"""

_INSTANTS: Final = 32
"""Instants that are drawn tile by tile before the next ones are: so many blocks' reaches are kept."""

_TILES: Final = 16
"""Tiles for each thread between two reports of progress."""

_LOOK: Final = 0
_REACH: Final = 1
_DRAW: Final = 2
"""Jobs: how far samples move, which pixels blocks of quads reach, the picture."""

NO_TRACK: Final = -1
"""Track of a grid point that belongs to no sheet."""

VECTOR_TRACK: Final = -2
"""Track of a sample that follows its own velocity and acceleration."""

NO_QUAD: Final = 0
QUAD: Final = 1
TORN_QUAD: Final = 2
"""A quad whose corners part company: drawn as what lies behind, in the colour of its far corners."""

_BESIDE: Final = 4
_ABOVE: Final = 8
"""Added to an ordinary quad that has others on both sides, or above and below.

A pixel's centre on its right, or lower, edge is left to the neighbour there. Where a camera pans all of
them lie on edges. A torn quad takes those too: its colours are clean of the nearer surface.
"""

_BEHIND: Final = 1e-6
"""Ratio of depths z'/z below which a sample has passed the camera."""

_INSIDE: Final = 1e-5
"""How far outside a quad, in its own sides, a pixel's centre still counts as inside."""

SAME_DEPTH: Final = 1e-3
"""Relative difference of inverse depths of two fragments of one surface."""

_TRANSPARENT: Final = 1e-5

_FRAGMENT: Final = 6
"""Red, green, blue, alpha, inverse depth, guessed share."""

_EMPTY: Final = np.float32(-1.0)
"""Inverse depth of a pixel at which nothing was drawn yet."""

_NO_PIXEL: Final = -1.0
_LOOK_CLOSER: Final = -2.0
"""In place of the one pixel that a quad holds: it holds none; it may hold several, or is torn."""

# In single precision: one double among them would make the kernels work in double precision.
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_SOLID: Final = np.float32(0.5)
_SAME: Final = np.float32(SAME_DEPTH)
_NEARER: Final = np.float32(1.0 + SAME_DEPTH)
_FARTHER: Final = np.float32(1.0 - SAME_DEPTH)

_SLIT_STEPS: Final = 6
"""Secant steps that find when a sample is met by a travelling slit."""

_LEAST_SLOPE: Final = 1e-3
"""Least change of that time's error with it; below, a sample goes along with the slit."""


class Sheets(NamedTuple):
    """Samples on their grid, joined to surfaces. Several sheets lie on the same grid.

    Parameters
    ----------
    color : ndarray of float32 of shape (2, sheets, rows, columns, 4)
        Premultiplied. First the samples' own; then what a sample gives to torn quads, the colour of its own
        surface clean of what stands before it.
    inverse_depth : ndarray of float32 of shape (sheets, rows, columns)
        1/z' in 1/metres, 0 at infinity.
    track : ndarray of int32 of shape (sheets, rows, columns)
        Which of the tracks' matrices a sample follows, or `VECTOR_TRACK`, or `NO_TRACK`.
    velocity, acceleration : ndarray of float32 of shape (sheets, rows, columns, 2)
        Of samples that follow `VECTOR_TRACK`: pixels a frame, and half of the change a frame of that, so
        that the displacement at time t is velocity t + acceleration t^2.
    guessed : ndarray of float32 of shape (sheets, rows, columns)
        1 where a sample was filled in, 0 where it was rendered.
    quads : ndarray of uint8 of shape (sheets, rows - 1, columns - 1)
        `NO_QUAD`, `QUAD` or `TORN_QUAD` between sample (row, column) and the next ones.
    origin_x, origin_y : float
        Pixel coordinates of the first sample in the output, whose pixel centres are at halves.
    """

    color: Float32Array
    inverse_depth: Float32Array
    track: npt.NDArray[np.int32]
    velocity: Float32Array
    acceleration: Float32Array
    guessed: Float32Array
    quads: npt.NDArray[np.uint8]
    origin_x: float
    origin_y: float


class Schedule(NamedTuple):
    """The instants of an exposure, and the tracks' matrices then.

    Parameters
    ----------
    times : ndarray of float64 of shape (n,)
        Frame times of the instants; with a slit, at the middle of the picture.
    matrices : ndarray of float64 of shape (tracks, m, 3, 4)
        Reprojections (`MotionPaths.reprojection`) at each instant (m = n) or, with a slit, at
        evenly spaced times from `first` in steps of `step`.
    slit_axis : int
        0 for a slit that travels along x, 1 along y; -1 without a slit.
    slit_rate, slit_middle : float
        Frames a pixel by which a place is exposed later than the middle (earlier where negative), and
        the middle's pixel coordinate.
    first, step : float
        See `matrices`.
    """

    times: FloatArray
    matrices: FloatArray
    slit_axis: int = -1
    slit_rate: float = 0.0
    slit_middle: float = 0.0
    first: float = 0.0
    step: float = 1.0

    def only(self, n: int) -> Schedule:
        """Return the schedule of one instant."""
        matrices = self.matrices if self.slit_axis >= 0 else self.matrices[:, n : n + 1]
        return self._replace(times=self.times[n : n + 1], matrices=matrices)


class Background(NamedTuple):
    """What stands still behind and before the sheets, on the output's pixels.

    Parameters
    ----------
    color : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied.
    inverse_depth : ndarray of float32 of shape (rows, columns)
        1/z', 0 at infinity.
    guessed : ndarray of float32 of shape (rows, columns)
        1 where it was filled in.
    """

    color: Float32Array
    inverse_depth: Float32Array
    guessed: Float32Array


def places(sheets: Sheets, schedule: Schedule, n: int, backend: Backend = "auto") -> npt.NDArray[np.float64]:
    """Return where all samples are at an instant.

    Parameters
    ----------
    sheets : Sheets
        The samples.
    schedule : Schedule
        The instants.
    n : int
        Which instant.
    backend : {"auto", "numba", "numpy"}
        Implementation.

    Returns
    -------
    ndarray of float64 of shape (sheets, rows, columns, 3)
        Pixel coordinates x and y, and 1/z' then; 1/z' is -1 for what is no sample or has passed the camera.
    """
    result = np.empty((*sheets.track.shape, 3))
    if not uses_numba(backend):
        for s in range(sheets.track.shape[0]):
            result[s] = _places_numpy(sheets, schedule, n, s)
    else:
        _place_all(sheets, schedule, n, result)
    return result


def _places_numpy(sheets: Sheets, schedule: Schedule, n: int, s: int) -> FloatArray:
    track = sheets.track[s]
    iz = sheets.inverse_depth[s].astype(np.float64)
    x0, y0 = np.meshgrid(*_grid(sheets))
    result = np.stack([x0, y0, np.full(track.shape, -1.0)], axis=2)
    for k in np.unique(track[track != NO_TRACK]):
        at = track == k
        x, y = x0[at], y0[at]
        rest = np.stack([x, y, np.ones(x.size), iz[at]], axis=1)
        moved = rest[:, [0, 1, 3]]
        axis = schedule.slit_axis
        time = np.full(x.size, schedule.times[n])
        if axis >= 0:
            time += schedule.slit_rate * (moved[:, axis] - schedule.slit_middle)
        last_time, last_off = np.zeros(x.size), np.zeros(x.size)
        gone = np.zeros(x.size, dtype=bool)
        for step in range(1 if axis < 0 else _SLIT_STEPS):
            moved = _moved_numpy(sheets, schedule, n, (s, k, at), rest, time)
            gone |= moved[:, 2] < 0.0
            if axis >= 0:
                off = schedule.times[n] + schedule.slit_rate * (moved[:, axis] - schedule.slit_middle) - time
                known = (time != last_time) & (step > 0)
                slope = np.divide(off - last_off, time - last_time, out=np.full(x.size, -1.0), where=known)
                slope = np.where(np.abs(slope) > _LEAST_SLOPE, slope, -1.0)
                last_time, last_off = time, off
                time = time - off / slope
        moved[gone, 2] = -1.0
        result[at] = moved
    return result


def _moved_numpy(
    sheets: Sheets,
    schedule: Schedule,
    n: int,
    which: tuple[int, int, npt.NDArray[np.bool_]],
    rest: FloatArray,
    time: FloatArray,
) -> FloatArray:
    """Return x, y and inverse depth of one track's samples, each at its own time where there is a slit."""
    s, k, at = which
    if k == VECTOR_TRACK:
        t = time[:, np.newaxis]
        way = t * (sheets.velocity[s][at] + t * sheets.acceleration[s][at])
        return np.concatenate([rest[:, :2] + way, rest[:, 3:]], axis=1)
    if schedule.slit_axis < 0:
        h = rest @ schedule.matrices[k, n].T
    else:
        last = schedule.matrices.shape[1] - 1
        place = np.clip((time - schedule.first) / schedule.step, 0.0, last)
        g = np.minimum(place.astype(np.int64), last - 1)
        share = (place - g)[:, np.newaxis]
        h = (1.0 - share) * np.einsum("nij,nj->ni", schedule.matrices[k, g], rest)
        h += share * np.einsum("nij,nj->ni", schedule.matrices[k, g + 1], rest)
    seen = h[:, 2] > _BEHIND
    w = np.where(seen, h[:, 2], 1.0)
    return np.stack([h[:, 0] / w, h[:, 1] / w, np.where(seen, rest[:, 3] / w, -1.0)], axis=1)


class Outlook(NamedTuple):
    """How far samples move over a schedule's instants, in pixels.

    Parameters
    ----------
    length : ndarray of float32 of shape (sheets, rows, columns)
        How long each sample's path is. Once it has passed the camera a sample counts as staying where it
        was last.
    farthest : ndarray of float32 of shape (sheets, rows, columns)
        How far the path takes it from where it was rendered at most.
    right, down : ndarray of float32 of shape (sheets, rows, columns - 1) and (sheets, rows - 1, columns)
        By how much, in x or y, a sample and its right or lower neighbour move apart at most.
    """

    length: Float32Array
    farthest: Float32Array
    right: Float32Array
    down: Float32Array


def outlook(sheets: Sheets, schedule: Schedule, backend: Backend = "auto") -> Outlook:
    """Look how far samples move over a schedule's instants.

    Parameters
    ----------
    sheets, schedule, backend
        See `places`.

    Returns
    -------
    Outlook
        Paths' lengths, and how far neighbours part.
    """
    shape = sheets.track.shape
    found = Outlook(
        np.zeros(shape, dtype=np.float32),
        np.zeros(shape, dtype=np.float32),
        np.zeros((shape[0], shape[1], shape[2] - 1), dtype=np.float32),
        np.zeros((shape[0], shape[1] - 1, shape[2]), dtype=np.float32),
    )
    if uses_numba(backend):
        threads = jit.set_thread_count(None)
        _work(_LOOK, threads, sheets, schedule, _nothing(), found, _no_blocks(), _no_drawing(), _no_sums())
        return found
    rest = np.stack(np.meshgrid(*_grid(sheets)), axis=2)
    last = np.broadcast_to(rest, (*shape, 2))
    for n in range(schedule.times.size):
        place = places(sheets, schedule, n, backend)
        off = place[..., :2] - rest
        found.right[:] = np.maximum(found.right, np.abs(np.diff(off, axis=2)).max(axis=3))
        found.down[:] = np.maximum(found.down, np.abs(np.diff(off, axis=1)).max(axis=3))
        now = np.where(place[..., 2:] >= 0.0, place[..., :2], last)
        if n > 0:
            found.length[:] += np.hypot(*np.moveaxis(now - last, -1, 0))
        found.farthest[:] = np.maximum(found.farthest, np.hypot(*np.moveaxis(now - rest, -1, 0)))
        last = now
    return found


def _grid(sheets: Sheets) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return x of the columns and y of the rows where samples were rendered."""
    rows, columns = sheets.track.shape[1:]
    return sheets.origin_x + np.arange(columns), sheets.origin_y + np.arange(rows)


class _Blocks(NamedTuple):
    """What blocks of quads reach from the `first` instant on.

    `filled`, of shape (sheets, block rows, block columns), tells which blocks have any quads. `boxes`, of
    shape (instants, sheets * block rows, block columns + 1, 4), has the first column and row of pixels, and
    the last ones, that a block reaches in a picture of some height and width; at a row's end, that all of
    the row does.
    """

    first: int
    height: int
    width: int
    filled: npt.NDArray[np.bool_]
    boxes: npt.NDArray[np.int32]


class _Drawing(NamedTuple):
    """Which tiles, given by their top and left, are drawn, and before or behind what.

    Fragments of less than the least alpha are not drawn. With the `last` instants sums become means.
    """

    tiles: npt.NDArray[np.int64]
    least_alpha: float
    has_background: bool
    last: bool


class _Sums(NamedTuple):
    """What the kernels add instants to; an inverse depth of no size is not wanted."""

    output: Float32Array
    guessed: Float32Array
    times_seen: npt.NDArray[np.int16]
    inverse_depth: Float32Array


def _no_outlook() -> Outlook:
    """Return one of the right types that is not looked at, as are the others below."""
    return Outlook(*(np.zeros((0, 0, 0), dtype=np.float32) for _ in range(4)))


def _no_blocks() -> _Blocks:
    return _Blocks(0, 0, 0, np.zeros((0, 0, 0), dtype=bool), np.zeros((0, 0, 0, 4), dtype=np.int32))


def _no_drawing() -> _Drawing:
    return _Drawing(np.zeros((0, 2), dtype=np.int64), 0.0, False, False)


def _no_sums() -> _Sums:
    nothing = np.zeros((0, 0), dtype=np.float32)
    return _Sums(np.zeros((0, 0, 4), np.float32), nothing, np.zeros((0, 0), np.int16), nothing)


def expose(
    sheets: Sheets,
    schedule: Schedule,
    background: Background | None,
    output: Float32Array,
    guessed: Float32Array,
    backend: Backend = "auto",
) -> Iterator[float]:
    """Average the images of all instants (1983, eq. 3-4).

    A pixel that no sheet reaches at any instant is the background's, to the bit. Without a background a
    pixel is averaged over the instants at which something is there; the others count as guessed.

    Parameters
    ----------
    sheets : Sheets
        What moves.
    schedule : Schedule
        When.
    background : Background or None
        What does not.
    output : ndarray of float32 of shape (rows, columns, 4)
        Receives the premultiplied picture.
    guessed : ndarray of float32 of shape (rows, columns)
        Receives the share of each pixel's light that was filled in.
    backend : {"auto", "numba", "numpy"}
        ``auto`` takes numba where it loads.

    Yields
    ------
    float
        Share of the work done, rising to 1.
    """
    if not uses_numba(backend):
        yield from _expose_numpy(sheets, schedule, background, output, guessed)
        return
    output[:] = 0.0
    guessed[:] = 0.0
    sums = _Sums(output, guessed, np.zeros(guessed.shape, dtype=np.int16), np.empty((0, 0), dtype=np.float32))
    # With nothing behind, what is transparent is seen too; otherwise it must not touch a pixel.
    yield from _drawn(sheets, schedule, background, 0.0 if background is None else _TRANSPARENT, sums)


def instant(
    sheets: Sheets,
    schedule: Schedule,
    n: int,
    background: Background | None,
    shape: tuple[int, int],
    backend: Backend = "auto",
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Return the samples of one instant, as if the scene had been rendered then.

    Parameters
    ----------
    sheets, schedule, background
        See `expose`.
    n : int
        Which instant.
    shape : tuple of int
        Rows and columns of the output.
    backend : {"auto", "numba", "numpy"}
        Implementation.

    Returns
    -------
    color : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied.
    inverse_depth : ndarray of float32 of shape (rows, columns)
        1/z' of what is seen; -1 where nothing is.
    guessed : ndarray of float32 of shape (rows, columns)
        Share that was filled in.
    """
    fragments = np.zeros((*shape, _FRAGMENT), dtype=np.float32)
    schedule = schedule.only(n)
    least_alpha = 0.0 if background is None else _TRANSPARENT
    if not uses_numba(backend):
        seen = _draw_numpy(sheets, schedule, 0, fragments, least_alpha)
    else:
        color, hints = np.zeros((*shape, 4), dtype=np.float32), np.zeros(shape, dtype=np.float32)
        sums = _Sums(color, hints, np.zeros(shape, dtype=np.int16), np.full(shape, _EMPTY))
        deque(_drawn(sheets, schedule, None, least_alpha, sums), maxlen=0)
        fragments[..., :4], fragments[..., 4], fragments[..., 5] = color, sums.inverse_depth, hints
        seen = sums.times_seen > 0
    if background is not None:
        fragments = _before_background(fragments, seen, background)
    else:
        fragments[~seen, 4] = -1.0
    return (
        np.ascontiguousarray(fragments[..., :4]),
        np.ascontiguousarray(fragments[..., 4]),
        np.ascontiguousarray(fragments[..., 5]),
    )


def _before_background(
    fragments: Float32Array, seen: npt.NDArray[np.bool_], background: Background
) -> Float32Array:
    """Return fragments laid before or behind what stands still."""
    result = np.concatenate(
        [background.color, background.inverse_depth[..., np.newaxis], background.guessed[..., np.newaxis]],
        axis=2,
    )
    front = fragments[..., 4] >= background.inverse_depth * (1.0 - SAME_DEPTH)
    over = seen & front
    through = (1.0 - fragments[over, 3])[:, np.newaxis]
    result[over, :4] = fragments[over, :4] + through * background.color[over]
    result[over, 5] = fragments[over, 5] + through[:, 0] * background.guessed[over]
    solid = over & (fragments[..., 3] >= 0.5)
    result[solid, 4] = fragments[solid, 4]
    under = seen & ~front
    through = (1.0 - background.color[under, 3])[:, np.newaxis]
    result[under, :4] = background.color[under] + through * fragments[under, :4]
    result[under, 5] = background.guessed[under] + through[:, 0] * fragments[under, 5]
    return np.asarray(result)


def _nothing() -> Background:
    """Return a background of the right types that is not looked at."""
    empty = np.zeros((1, 1), dtype=np.float32)
    return Background(np.zeros((1, 1, 4), dtype=np.float32), empty, empty)


@jit.kernel()
def _place_on_slit(
    sheets: Any, schedule: Any, n: int, s: int, row: int, column: int
) -> tuple[float, float, float]:
    """Return x, y and inverse depth of a sample where a travelling slit meets it, -1 once it is gone.

    Both are there at one time: secant steps to that time.
    """
    k = sheets.track[s, row, column]
    x0, y0 = sheets.origin_x + column, sheets.origin_y + row
    iz = float(sheets.inverse_depth[s, row, column])
    x, y, w = x0, y0, 1.0
    last_t, last_off = 0.0, 0.0
    t = schedule.times[n]
    t += schedule.slit_rate * ((x0 if schedule.slit_axis == 0 else y0) - schedule.slit_middle)
    for step in range(_SLIT_STEPS):
        if k == VECTOR_TRACK:
            x = x0 + t * (sheets.velocity[s, row, column, 0] + t * sheets.acceleration[s, row, column, 0])
            y = y0 + t * (sheets.velocity[s, row, column, 1] + t * sheets.acceleration[s, row, column, 1])
        else:
            at = min(max((t - schedule.first) / schedule.step, 0.0), schedule.matrices.shape[1] - 1.0)
            g = min(int(at), schedule.matrices.shape[1] - 2)
            share = at - g
            m = schedule.matrices[k, g]
            x = m[0, 0] * x0 + m[0, 1] * y0 + m[0, 2] + m[0, 3] * iz
            y = m[1, 0] * x0 + m[1, 1] * y0 + m[1, 2] + m[1, 3] * iz
            w = m[2, 0] * x0 + m[2, 1] * y0 + m[2, 2] + m[2, 3] * iz
            m = schedule.matrices[k, g + 1]
            x += share * (m[0, 0] * x0 + m[0, 1] * y0 + m[0, 2] + m[0, 3] * iz - x)
            y += share * (m[1, 0] * x0 + m[1, 1] * y0 + m[1, 2] + m[1, 3] * iz - y)
            w += share * (m[2, 0] * x0 + m[2, 1] * y0 + m[2, 2] + m[2, 3] * iz - w)
            if not w > _BEHIND:
                return x0, y0, -1.0
            x, y = x / w, y / w
        place = x if schedule.slit_axis == 0 else y
        off = schedule.times[n] + schedule.slit_rate * (place - schedule.slit_middle) - t
        slope = (off - last_off) / (t - last_t) if step > 0 and t != last_t else -1.0
        last_t, last_off = t, off
        t -= off / (slope if abs(slope) > _LEAST_SLOPE else -1.0)
    return x, y, iz / w


@jit.kernel()
def _place_line(
    sheets: Any, schedule: Any, n: int, s: int, row: int, first: int, count: int, line: Any
) -> None:
    """Fill `line` with x, y and inverse depth, -1 for what is not there, of samples from the `first` on.

    Neighbours mostly share their track. What follows from it is worked out once for all that do.
    """
    track, inverse_depth = sheets.track[s, row, first : first + count], sheets.inverse_depth[s, row]
    velocity, acceleration = sheets.velocity[s, row].reshape(-1), sheets.acceleration[s, row].reshape(-1)
    x0, y0 = sheets.origin_x + first, sheets.origin_y + row
    # Mostly all do, which several comparisons at once can tell.
    other: Any = np.int32(0)
    for i in range(count):
        other |= track[i] ^ track[0]
    begin = 0
    while begin < count:
        k = track[begin]
        end = count if other == 0 else begin + 1
        while end < count and track[end] == k:
            end += 1
        # Counted from the span's own begin: what starts at 0 cannot be negative, which saves tests.
        here, depths, across = line[begin:], inverse_depth[first + begin :], x0 + begin
        if k == NO_TRACK:
            for i in range(end - begin):
                here[i] = across + i
                here[i + _LINE] = y0
                here[i + 2 * _LINE] = -1.0
        elif schedule.slit_axis >= 0:
            for i in range(end - begin):
                x, y, iz = _place_on_slit(sheets, schedule, n, s, row, first + begin + i)
                here[i] = x
                here[i + _LINE] = y
                here[i + 2 * _LINE] = iz
        elif k == VECTOR_TRACK:
            t = schedule.times[n]
            v, a = velocity[2 * (first + begin) :], acceleration[2 * (first + begin) :]
            for i in range(end - begin):
                here[i] = across + i + t * (v[2 * i] + t * a[2 * i])
                here[i + _LINE] = y0 + t * (v[2 * i + 1] + t * a[2 * i + 1])
                here[i + 2 * _LINE] = depths[i]
        else:
            m = schedule.matrices[k, n]
            m0, m1, m3 = m[0, 0], m[0, 1] * y0 + m[0, 2], m[0, 3]
            m4, m5, m7 = m[1, 0], m[1, 1] * y0 + m[1, 2], m[1, 3]
            m8, m9, m11 = m[2, 0], m[2, 1] * y0 + m[2, 2], m[2, 3]
            for i in range(end - begin):
                x, z = across + i, float(depths[i])
                w = m8 * x + m9 + m11 * z
                per_w = 1.0 / w
                here[i] = (m0 * x + m1 + m3 * z) * per_w
                here[i + _LINE] = (m4 * x + m5 + m7 * z) * per_w
                here[i + 2 * _LINE] = z * per_w if w > _BEHIND else -1.0
        begin = end


@jit.kernel(parallel=True)
def _place_all(sheets: Any, schedule: Any, n: int, result: Any) -> None:
    """Fill `result` with where all samples are at an instant."""
    columns = result.shape[2]
    for number in jit.prange(result.shape[1]):
        # A parallel loop counts without sign, which would turn indices into floats.
        row: Any = np.int64(number)
        line = np.empty(3 * _LINE)
        for s in range(result.shape[0]):
            for first in range(0, columns, _LINE):
                count = min(_LINE, columns - first)
                _place_line(sheets, schedule, n, s, row, first, count, line)
                for i in range(count):
                    for c in range(3):
                        result[s, row, first + i, c] = line[i + c * _LINE]


@jit.kernel()
def _look_at_rows(begin: int, step: int, sheets: Any, schedule: Any, found: Any) -> None:
    """Fill rows of an `Outlook`."""
    rows, columns = sheets.track.shape[1], sheets.track.shape[2]
    upper, lower = np.empty(3 * _LINE), np.empty(3 * _LINE)
    last, most = np.empty(2 * _LINE), np.empty(4 * _LINE)
    for row in range(begin, rows, step):
        below = min(row + 1, rows - 1)
        for s in range(sheets.track.shape[0]):
            # The last sample of a run is the first one of the next.
            for first in range(0, columns - 1, _LINE - 1):
                count = min(_LINE, columns - first)
                x0, y0 = sheets.origin_x + first, sheets.origin_y + row
                for i in range(count):
                    last[i] = x0 + i
                    last[i + _LINE] = y0
                for i in range(4 * _LINE):
                    most[i] = 0.0
                for n in range(schedule.times.size):
                    _place_line(sheets, schedule, n, s, row, first, count, upper)
                    _place_line(sheets, schedule, n, s, below, first, count, lower)
                    counted = 0.0 if n == 0 else 1.0
                    for i in range(count):
                        there = upper[i + 2 * _LINE] >= 0.0
                        x = upper[i] if there else last[i]
                        y = upper[i + _LINE] if there else last[i + _LINE]
                        most[i] += counted * np.sqrt((x - last[i]) ** 2 + (y - last[i + _LINE]) ** 2)
                        away = np.sqrt((x - x0 - i) ** 2 + (y - y0) ** 2)
                        most[i + _LINE] = max(most[i + _LINE], away)
                        last[i] = x
                        last[i + _LINE] = y
                        along = max(abs(lower[i] - upper[i]), abs(lower[i + _LINE] - upper[i + _LINE] - 1.0))
                        most[i + 3 * _LINE] = max(most[i + 3 * _LINE], along)
                    for i in range(count - 1):
                        across = max(
                            abs(upper[i + 1] - upper[i] - 1.0), abs(upper[i + 1 + _LINE] - upper[i + _LINE])
                        )
                        most[i + 2 * _LINE] = max(most[i + 2 * _LINE], across)
                for i in range(count):
                    found.length[s, row, first + i] = most[i]
                    found.farthest[s, row, first + i] = most[i + _LINE]
                    if i < count - 1:
                        found.right[s, row, first + i] = most[i + 2 * _LINE]
                    if below > row:
                        found.down[s, row, first + i] = most[i + 3 * _LINE]


@jit.kernel()
def _reach_of_blocks(begin: int, step: int, sheets: Any, schedule: Any, blocks: Any) -> None:
    """Find which pixels blocks of quads reach at some instants; last in each row, which all of it does."""
    filled, boxes = blocks.filled, blocks.boxes
    block_rows, block_columns = filled.shape[1], filled.shape[2]
    columns = sheets.track.shape[2]
    height, width = blocks.height, blocks.width
    line, ends = np.empty(3 * _LINE), np.empty(4 * _LINE)
    for block_row in range(begin, boxes.shape[1], step):
        s, top = block_row // block_rows, block_row % block_rows * _BLOCK_ROWS
        bottom = min(top + _BLOCK_ROWS, sheets.track.shape[1] - 1)
        for n in range(boxes.shape[0]):
            box = boxes[n, block_row]
            for b in range(block_columns + 1):
                box[b, 0] = width
                box[b, 1] = height
                box[b, 2] = -1
                box[b, 3] = -1
            for run in range(0, block_columns, _RUN):
                run_end = min(run + _RUN, block_columns)
                some = False
                for b in range(run, run_end):
                    some |= filled[s, block_row % block_rows, b]
                if not some:
                    continue
                left = run * _BLOCK_COLUMNS
                count = min(run_end * _BLOCK_COLUMNS, columns - 1) + 1 - left
                for i in range(2 * _LINE):
                    ends[i] = np.inf
                    ends[i + 2 * _LINE] = -np.inf
                for row in range(top, bottom + 1):
                    _place_line(sheets, schedule, blocks.first + n, s, row, left, count, line)
                    for i in range(count):
                        x, y = line[i], line[i + _LINE]
                        there = line[i + 2 * _LINE] >= 0.0
                        ends[i] = min(ends[i], x if there else np.inf)
                        ends[i + _LINE] = min(ends[i + _LINE], y if there else np.inf)
                        ends[i + 2 * _LINE] = max(ends[i + 2 * _LINE], x if there else -np.inf)
                        ends[i + 3 * _LINE] = max(ends[i + 3 * _LINE], y if there else -np.inf)
                for b in range(run, run_end):
                    if not filled[s, block_row % block_rows, b]:
                        continue
                    near = (b - run) * _BLOCK_COLUMNS
                    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
                    for i in range(near, min(near + _BLOCK_COLUMNS + 1, count)):
                        low_x, low_y = min(low_x, ends[i]), min(low_y, ends[i + _LINE])
                        high_x = max(high_x, ends[i + 2 * _LINE])
                        high_y = max(high_y, ends[i + 3 * _LINE])
                    box[b, 0] = int(min(max(np.ceil(low_x - 0.5 - _INSIDE), 0.0), width))
                    box[b, 1] = int(min(max(np.ceil(low_y - 0.5 - _INSIDE), 0.0), height))
                    box[b, 2] = int(max(min(np.floor(high_x - 0.5 + _INSIDE), width - 1.0), -1.0))
                    box[b, 3] = int(max(min(np.floor(high_y - 0.5 + _INSIDE), height - 1.0), -1.0))
                    for c in range(2):
                        box[-1, c] = min(box[-1, c], box[b, c])
                        box[-1, 2 + c] = max(box[-1, 2 + c], box[b, 2 + c])


@jit.kernel()
def _pixels_of_quads(
    upper: Any, lower: Any, quads: Any, first: int, count: int,
    top: int, left: int, rows: int, columns: int, found: Any,
) -> None:  # fmt: skip
    """Find the pixel of a tile whose centre lies in each quad between two lines, and where in the quad.

    Most quads hold just one. What `found` has for a quad is u, v, and the pixel in the tile or `_NO_PIXEL`
    or `_LOOK_CLOSER`. There is no branch in the loop, so that it works on several quads at once.
    """
    most_x, most_y = left + columns - 1.0, top + rows - 1.0
    for i in range(count):
        xa, xb, xc, xd = upper[i], upper[i + 1], lower[i], lower[i + 1]
        ya, yb, yc, yd = upper[i + _LINE], upper[i + 1 + _LINE], lower[i + _LINE], lower[i + 1 + _LINE]
        za, zb = upper[i + 2 * _LINE], upper[i + 1 + 2 * _LINE]
        zc, zd = lower[i + 2 * _LINE], lower[i + 1 + 2 * _LINE]
        kind = quads[first + i]
        beyond_x = -_INSIDE if kind & _BESIDE else _INSIDE
        beyond_y = -_INSIDE if kind & _ABOVE else _INSIDE
        begin_x = np.ceil(min(xa, xb, xc, xd) - 0.5 - _INSIDE)
        begin_y = np.ceil(min(ya, yb, yc, yd) - 0.5 - _INSIDE)
        last_x = np.floor(max(xa, xb, xc, xd) - 0.5 + beyond_x)
        last_y = np.floor(max(ya, yb, yc, yd) - 0.5 + beyond_y)
        some = (begin_x <= min(last_x, most_x)) & (begin_y <= min(last_y, most_y))
        some &= (last_x >= left) & (last_y >= top) & (min(za, zb, zc, zd) >= 0.0) & (kind != NO_QUAD)
        several = (begin_x < last_x) | (begin_y < last_y) | (kind & TORN_QUAD != 0)
        # The triangle a, b, c with a's corner as origin, and d, c, b with d's.
        ux, uy, vx, vy = xb - xa, yb - ya, xc - xa, yc - ya
        per_area = 1.0 / (ux * vy - uy * vx)
        dx, dy = begin_x + 0.5 - xa, begin_y + 0.5 - ya
        u, v = (dx * vy - dy * vx) * per_area, (ux * dy - uy * dx) * per_area
        in_first = (u >= -_INSIDE) & (v >= -_INSIDE) & (u + v <= 1.0 + _INSIDE)
        px, py, qx, qy = xc - xd, yc - yd, xb - xd, yb - yd
        per_area = 1.0 / (px * qy - py * qx)
        dx, dy = begin_x + 0.5 - xd, begin_y + 0.5 - yd
        u2, v2 = 1.0 - (dx * qy - dy * qx) * per_area, 1.0 - (px * dy - py * dx) * per_area
        in_second = (u2 <= 1.0 + _INSIDE) & (v2 <= 1.0 + _INSIDE) & (u2 + v2 >= 1.0 - _INSIDE)
        at = (begin_y - top) * columns + (begin_x - left) if in_first | in_second else _NO_PIXEL
        at = _LOOK_CLOSER if several else at
        # What lies outside by rounding must not be extrapolated: beside a highlight it would show.
        found[i] = min(max(u if in_first else u2, 0.0), 1.0)
        found[i + _LINE] = min(max(v if in_first else v2, 0.0), 1.0)
        found[i + 2 * _LINE] = at if some else _NO_PIXEL


@jit.kernel()
def _draw_quads(
    color: Any, guessed: Any, quads: Any, corner: int, columns: int, behind: int, upper: Any, lower: Any,
    first: int, count: int, found: Any, closer: tuple[int, ...], least_alpha: float,
    top: int, left: int, rows: int, width: int, pixels: Any, depth: Any, guess: Any,
) -> None:  # fmt: skip
    """Draw the quads between two lines into a tile; sample `corner` is the first one's upper left.

    Arrays are flat here, and the colours of torn quads `behind` elements after the others: numba checks
    every index of several dimensions for its sign, which took longer than the rest. It counts references
    to an array at every call that is put in place, which would take longer than that: hence one loop.
    It draws the quads that hold one pixel, or where `closer` is not empty those that want a closer look. The
    length of a tuple is known to the compiler, which leaves out what only the others need.
    """
    for i in range(count):
        at = found[i + 2 * _LINE]
        if at < 0.0 if len(closer) == 0 else at != _LOOK_CLOSER:
            continue
        a = corner + i
        b, c, d = a + 1, a + columns, a + columns + 1
        sa, sb, sc, sd = a, b, c, d
        za, zb = upper[i + 2 * _LINE], upper[i + 1 + 2 * _LINE]
        zc, zd = lower[i + 2 * _LINE], lower[i + 1 + 2 * _LINE]
        torn = False
        u, v = found[i], found[i + _LINE]
        begin, begin_x, begin_y, across, down = int(at), 0, 0, 1, 1
        xa, ya, xd, yd = 0.0, 0.0, 0.0, 0.0
        ux, uy, vx, vy, px, py, qx, qy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        per_area, per_area2 = 0.0, 0.0
        if len(closer) == 1:
            kind = quads[first + i]
            xa, xb, xc, xd = upper[i] - left, upper[i + 1] - left, lower[i] - left, lower[i + 1] - left
            ya, yb = upper[i + _LINE] - top, upper[i + 1 + _LINE] - top
            yc, yd = lower[i + _LINE] - top, lower[i + 1 + _LINE] - top
            beyond_x = -_INSIDE if kind & _BESIDE else _INSIDE
            beyond_y = -_INSIDE if kind & _ABOVE else _INSIDE
            begin_x = int(max(np.ceil(min(xa, xb, xc, xd) - 0.5 - _INSIDE), 0.0))
            begin_y = int(max(np.ceil(min(ya, yb, yc, yd) - 0.5 - _INSIDE), 0.0))
            across = int(min(np.floor(max(xa, xb, xc, xd) - 0.5 + beyond_x), width - 1.0)) + 1 - begin_x
            down = int(min(np.floor(max(ya, yb, yc, yd) - 0.5 + beyond_y), rows - 1.0)) + 1 - begin_y
            begin = begin_y * width + begin_x
            # The triangle a, b, c with a's corner as origin, and d, c, b with d's.
            ux, uy, vx, vy = xb - xa, yb - ya, xc - xa, yc - ya
            px, py, qx, qy = xc - xd, yc - yd, xb - xd, yb - yd
            per_area, per_area2 = 1.0 / (ux * vy - uy * vx), 1.0 / (px * qy - py * qx)
            torn = kind & TORN_QUAD != 0
        if torn:
            far = min(za, zb, zc, zd)
            limit = 0.5 * (far + max(za, zb, zc, zd))
            fa, fb, fc, fd = za <= limit, zb <= limit, zc <= limit, zd <= limit
            # Near corners take the colour of the far one beside them, or below, or across.
            sa = behind + (a if fa else (b if fb else (c if fc else d)))
            sb = behind + (b if fb else (a if fa else (d if fd else c)))
            sc = behind + (c if fc else (d if fd else (a if fa else b)))
            sd = behind + (d if fd else (c if fc else (b if fb else a)))
            za, zb, zc, zd = far, far, far, far
        sa, sb, sc, sd = 4 * sa, 4 * sb, 4 * sc, 4 * sd
        nearest = max(za, zb, zc, zd)
        for row in range(down):
            for column in range(across):
                pixel = begin + row * width + column
                if len(closer) == 1 and nearest < depth[pixel] * _FARTHER and pixels[4 * pixel + 3] >= _ONE:
                    continue
                if len(closer) == 1:
                    dx, dy = begin_x + column + 0.5 - xa, begin_y + row + 0.5 - ya
                    u, v = (dx * vy - dy * vx) * per_area, (ux * dy - uy * dx) * per_area
                    if not (u >= -_INSIDE and v >= -_INSIDE and u + v <= 1.0 + _INSIDE):
                        dx, dy = dx + xa - xd, dy + ya - yd
                        u, v = 1.0 - (dx * qy - dy * qx) * per_area2, 1.0 - (px * dy - py * dx) * per_area2
                        if not (u <= 1.0 + _INSIDE and v <= 1.0 + _INSIDE and u + v >= 1.0 - _INSIDE):
                            continue
                    u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
                da, db, dc, dd = (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v
                # Depths and alphas decide what is seen: they have to come out the same all over a surface.
                iz: Any = np.float32(da * za + db * zb + dc * zc + dd * zd)
                alpha: Any = np.float32(
                    da * color[sa + 3] + db * color[sb + 3] + dc * color[sc + 3] + dd * color[sd + 3]
                )
                if alpha < least_alpha:
                    continue
                wa: Any = np.float32(da)
                wb: Any = np.float32(db)
                wc: Any = np.float32(dc)
                wd: Any = np.float32(dd)
                red = wa * color[sa] + wb * color[sb] + wc * color[sc] + wd * color[sd]
                green = wa * color[sa + 1] + wb * color[sb + 1] + wc * color[sc + 1] + wd * color[sd + 1]
                blue = wa * color[sa + 2] + wb * color[sb + 2] + wc * color[sc + 2] + wd * color[sd + 2]
                hint = alpha
                if not torn:
                    hint = wa * guessed[a] + wb * guessed[b] + wc * guessed[c] + wd * guessed[d]
                old_depth, f = depth[pixel], 4 * pixel
                old_alpha = pixels[f + 3]
                if old_depth < _ZERO or (abs(iz - old_depth) <= _SAME * old_depth and alpha > old_alpha):
                    # Two quads share an edge, or a surface meets itself: the more solid of the two is seen.
                    pixels[f] = red
                    pixels[f + 1] = green
                    pixels[f + 2] = blue
                    pixels[f + 3] = alpha
                    depth[pixel] = iz
                    guess[pixel] = hint
                elif iz > old_depth * _NEARER:
                    through = _ONE - alpha
                    pixels[f] = red + through * pixels[f]
                    pixels[f + 1] = green + through * pixels[f + 1]
                    pixels[f + 2] = blue + through * pixels[f + 2]
                    pixels[f + 3] = alpha + through * old_alpha
                    guess[pixel] = hint + through * guess[pixel]
                    if alpha >= _SOLID:
                        depth[pixel] = iz
                elif iz < old_depth * _FARTHER and old_alpha < _ONE:
                    through = _ONE - old_alpha
                    pixels[f] += through * red
                    pixels[f + 1] += through * green
                    pixels[f + 2] += through * blue
                    pixels[f + 3] += through * alpha
                    guess[pixel] += through * hint
                    if old_alpha < _SOLID:
                        depth[pixel] = iz


@jit.kernel(inline=True)
def _draw_tile(
    sheets: Any, schedule: Any, n: int, boxes: Any, least_alpha: float,
    top: int, left: int, rows: int, width: int, pixels: Any, depth: Any, guess: Any,
    upper: Any, lower: Any, found: Any,
) -> tuple[int, int]:  # fmt: skip
    """Draw all sheets at an instant into a tile; return the first and last row that may be touched."""
    color, guessed = sheets.color.reshape(-1), sheets.guessed.reshape(-1)
    sheet_rows, columns = sheets.track.shape[1], sheets.track.shape[2]
    behind = sheets.track.size
    block_rows, block_columns = -(-(sheet_rows - 1) // _BLOCK_ROWS), boxes.shape[1] - 1
    bottom, right = top + rows - 1, left + width - 1
    first_touched, last_touched = rows, -1
    for block_row in range(boxes.shape[0]):
        box = boxes[block_row]
        if box[-1, 0] > right or box[-1, 2] < left or box[-1, 1] > bottom or box[-1, 3] < top:
            continue
        begin, end = -1, 0
        for b in range(block_columns):
            if box[b, 0] <= right and box[b, 2] >= left and box[b, 1] <= bottom and box[b, 3] >= top:
                begin, end = b if begin < 0 else begin, b + 1
                first_touched = min(first_touched, max(box[b, 1] - top, 0))
                last_touched = max(last_touched, min(box[b, 3] - top, rows - 1))
        if begin < 0:
            continue
        s, row = block_row // block_rows, block_row % block_rows * _BLOCK_ROWS
        row_end = min(row + _BLOCK_ROWS, sheet_rows - 1)
        for run in range(begin, end, _RUN):
            first = run * _BLOCK_COLUMNS
            count = min(min(run + _RUN, end) * _BLOCK_COLUMNS, columns - 1) - first
            _place_line(sheets, schedule, n, s, row, first, count + 1, upper)
            for r in range(row, row_end):
                _place_line(sheets, schedule, n, s, r + 1, first, count + 1, lower)
                quads = sheets.quads[s, r]
                # Torn quads first: of two fragments alike theirs, clean of the nearer surface, is to be seen.
                _pixels_of_quads(upper, lower, quads, first, count, top, left, rows, width, found)
                _draw_quads(
                    color, guessed, quads, (s * sheet_rows + r) * columns + first, columns, behind,
                    upper, lower, first, count, found, (1,), least_alpha, top, left, rows, width,
                    pixels, depth, guess,
                )  # fmt: skip
                _draw_quads(
                    color, guessed, quads, (s * sheet_rows + r) * columns + first, columns, behind,
                    upper, lower, first, count, found, (), least_alpha, top, left, rows, width,
                    pixels, depth, guess,
                )  # fmt: skip
                upper, lower = lower, upper
    return first_touched, last_touched


@jit.kernel()
def _add_row(
    pixels: Any, depth: Any, guess: Any, first: int, width: int, total: Any, hints: Any, seen: Any, left: int
) -> None:
    """Add a row of a tile's fragments to its sums."""
    for i in range(4 * width):
        total[4 * left + i] += pixels[4 * first + i]
    for i in range(width):
        hints[left + i] += guess[first + i]
    for i in range(width):
        seen[left + i] += depth[first + i] >= _ZERO


@jit.kernel(inline=True)
def _add_row_before(
    pixels: Any, depth: Any, guess: Any, first: int, width: int,
    color: Any, inverse_depth: Any, guessed: Any, total: Any, hints: Any, seen: Any, left: int,
) -> None:  # fmt: skip
    """Add a row of a tile's fragments to its sums, before or behind what stands still."""
    for i in range(width):
        iz = depth[first + i]
        if iz < _ZERO:
            continue
        at, f = left + i, 4 * (first + i)
        a = 4 * at
        if iz >= inverse_depth[at] * _FARTHER:
            through = _ONE - pixels[f + 3]
            for c in range(4):
                total[a + c] += pixels[f + c] + through * color[a + c]
            hints[at] += guess[first + i] + through * guessed[at]
        else:
            through = _ONE - color[a + 3]
            for c in range(4):
                total[a + c] += color[a + c] + through * pixels[f + c]
            hints[at] += guessed[at] + through * guess[first + i]
        seen[at] += 1


@jit.kernel(inline=True)
def _finish_row(
    instants: int, has_background: bool, color: Any, guessed: Any, total: Any, hints: Any, seen: Any,
    left: int, right: int,
) -> None:  # fmt: skip
    """Turn a row's sums over all instants into means."""
    for i in range(left, right):
        times = seen[i]
        if not has_background:
            for c in range(4 * i, 4 * i + 4):
                total[c] = total[c] / times if times > 0 else _ZERO
            hints[i] = (hints[i] + instants - times) / instants
            continue
        # To the bit where nothing was: no sum comes near what never changed.
        for c in range(4 * i, 4 * i + 4):
            total[c] = (total[c] + (instants - times) * color[c]) / instants if times > 0 else color[c]
        hints[i] = (hints[i] + (instants - times) * guessed[i]) / instants if times > 0 else guessed[i]


@jit.kernel()
def _expose_tiles(
    begin: int, step: int,
    sheets: Any, schedule: Any, background: Any, blocks: Any, drawing: Any, sums: Any,
) -> None:  # fmt: skip
    """Add some instants to some tiles' sums, and turn them into means with the last ones.

    A tile belongs to one thread, so the picture does not depend on their number.
    """
    height, width = sums.guessed.shape
    tiles, has_background = drawing.tiles, drawing.has_background
    output, guessed, times_seen, inverse_depth = (
        sums.output,
        sums.guessed,
        sums.times_seen,
        sums.inverse_depth,
    )
    size = TILE_ROWS * TILE_COLUMNS
    pixels, guess = np.zeros(4 * size, dtype=np.float32), np.zeros(size, dtype=np.float32)
    depth = np.full(size, _EMPTY)
    upper, lower, found = np.empty(3 * _LINE), np.empty(3 * _LINE), np.empty(3 * _LINE)
    for number in range(begin, tiles.shape[0], step):
        top, left = tiles[number, 0], tiles[number, 1]
        rows, columns = min(TILE_ROWS, height - top), min(TILE_COLUMNS, width - left)
        for n in range(blocks.boxes.shape[0]):
            first, last = _draw_tile(
                sheets, schedule, blocks.first + n, blocks.boxes[n], drawing.least_alpha,
                top, left, rows, columns, pixels, depth, guess, upper, lower, found,
            )  # fmt: skip
            for row in range(first, last + 1):
                y, at = top + row, row * columns
                if has_background:
                    _add_row_before(
                        pixels, depth, guess, at, columns, background.color[y].reshape(-1),
                        background.inverse_depth[y], background.guessed[y],
                        output[y].reshape(-1), guessed[y], times_seen[y], left,
                    )  # fmt: skip
                else:
                    _add_row(
                        pixels, depth, guess, at, columns,
                        output[y].reshape(-1), guessed[y], times_seen[y], left,
                    )  # fmt: skip
                if inverse_depth.size > 0:
                    for i in range(columns):
                        inverse_depth[y, left + i] = depth[at + i]
            # The tile is left empty for the next instant.
            for i in range(first * columns, (last + 1) * columns):
                depth[i] = _EMPTY
                guess[i] = _ZERO
            for i in range(4 * first * columns, 4 * (last + 1) * columns):
                pixels[i] = _ZERO
        if drawing.last:
            for y in range(top, top + rows):
                still = y if has_background else 0
                _finish_row(
                    schedule.times.size, has_background, background.color[still].reshape(-1),
                    background.guessed[still], output[y].reshape(-1), guessed[y], times_seen[y],
                    left, left + columns,
                )  # fmt: skip


@jit.kernel(parallel=True)
def _work(
    job: int, workers: int, sheets: Any, schedule: Any, background: Any,
    found: Any, blocks: Any, drawing: Any, sums: Any,
) -> None:  # fmt: skip
    """Share a job out to all threads: each does every so manyth of its rows, rows of blocks, or tiles.

    What a parallel loop calls is compiled several times over, hence one loop for all jobs. Only what it calls
    may write to the arrays: of what the loop itself writes to those in a tuple nothing is kept.
    """
    for number in jit.prange(workers):
        # A parallel loop counts without sign, which would turn indices into floats.
        worker: Any = np.int64(number)
        if job == _LOOK:
            _look_at_rows(worker, workers, sheets, schedule, found)
        elif job == _REACH:
            _reach_of_blocks(worker, workers, sheets, schedule, blocks)
        else:
            _expose_tiles(worker, workers, sheets, schedule, background, blocks, drawing, sums)


def _filled_blocks(quads: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """Return which blocks have any quads, (sheets, block rows, block columns)."""
    sheets, rows, columns = quads.shape
    shape = (-(-rows // _BLOCK_ROWS), -(-columns // _BLOCK_COLUMNS))
    padded = np.zeros((sheets, shape[0] * _BLOCK_ROWS, shape[1] * _BLOCK_COLUMNS), dtype=bool)
    padded[:, :rows, :columns] = quads != NO_QUAD
    blocks = padded.reshape(sheets, shape[0], _BLOCK_ROWS, shape[1], _BLOCK_COLUMNS)
    return np.asarray(blocks.any(axis=(2, 4)))


def _with_neighbours(quads: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return quads of which ordinary ones between two others are marked by `_BESIDE` and `_ABOVE`."""
    ordinary, result = quads == QUAD, quads.copy()
    for axis, mark in ((2, _BESIDE), (1, _ABOVE)):
        one, middle, other = ((slice(None),) * axis + (slice(k, k - 2 or None),) for k in range(3))
        result[middle] += np.uint8(mark) * (ordinary[one] & ordinary[middle] & ordinary[other])
    return result


def _drawn(
    sheets: Sheets, schedule: Schedule, background: Background | None, least_alpha: float, sums: _Sums
) -> Iterator[float]:
    """Draw all instants by the kernels, tile by tile; with no inverse depth wanted, turn sums into means."""
    height, width = sums.guessed.shape
    filled = _filled_blocks(sheets.quads)
    sheets = sheets._replace(quads=_with_neighbours(sheets.quads))
    tiles = np.mgrid[0:height:TILE_ROWS, 0:width:TILE_COLUMNS].reshape(2, -1).T.copy()
    threads = jit.set_thread_count(None)
    instants = schedule.times.size
    still = _nothing() if background is None else background
    for first in range(0, instants, _INSTANTS):
        count = min(_INSTANTS, instants - first)
        boxes = np.empty((count, filled.shape[0] * filled.shape[1], filled.shape[2] + 1, 4), dtype=np.int32)
        blocks = _Blocks(first, height, width, filled, boxes)
        _work(_REACH, threads, sheets, schedule, still, _no_outlook(), blocks, _no_drawing(), _no_sums())
        last = first + count == instants and sums.inverse_depth.size == 0
        for begin in range(0, len(tiles), threads * _TILES):
            end = min(begin + threads * _TILES, len(tiles))
            drawing = _Drawing(tiles[begin:end], least_alpha, background is not None, last)
            _work(_DRAW, threads, sheets, schedule, still, _no_outlook(), blocks, drawing, sums)
            yield (first + count * end / len(tiles)) / instants


def _expose_numpy(
    sheets: Sheets,
    schedule: Schedule,
    background: Background | None,
    output: Float32Array,
    guessed: Float32Array,
) -> Iterator[float]:
    """Average all instants, each drawn as a whole."""
    shape = output.shape[:2]
    total = np.zeros((*shape, 5))
    times_seen = np.zeros(shape, dtype=np.int64)
    for n in range(schedule.times.size):
        fragments = np.zeros((*shape, _FRAGMENT), dtype=np.float32)
        seen = _draw_numpy(sheets, schedule, n, fragments, 0.0 if background is None else _TRANSPARENT)
        if background is not None:
            fragments = _before_background(fragments, seen, background)
        total[seen] += fragments[seen][:, [0, 1, 2, 3, 5]]
        times_seen += seen
        yield (n + 1) / (schedule.times.size + 1)
    count = schedule.times.size
    rest = (count - times_seen)[..., np.newaxis]
    if background is None:
        output[:] = total[..., :4] / np.maximum(times_seen, 1)[..., np.newaxis]
        guessed[:] = (total[..., 4] + rest[..., 0]) / count
    else:
        touched = times_seen > 0
        output[:] = background.color
        guessed[:] = background.guessed
        output[touched] = ((total[..., :4] + rest * background.color) / count)[touched]
        guessed[touched] = ((total[..., 4] + rest[..., 0] * background.guessed) / count)[touched]
    yield 1.0


def _draw_numpy(
    sheets: Sheets, schedule: Schedule, n: int, fragments: Float32Array, least_alpha: float
) -> npt.NDArray[np.bool_]:
    """Draw all sheets at an instant into fragments; return which pixels were touched."""
    height, width = fragments.shape[:2]
    moved = places(sheets, schedule, n, "numpy")
    found = [
        _quad_fragments(sheets, moved, s, height, width, least_alpha) for s in range(sheets.track.shape[0])
    ]
    pixel = np.concatenate([f[0] for f in found])
    value = np.concatenate([f[1] for f in found])
    # The kernel's order: sheet by sheet, quad by quad. Fragments of one pixel are laid one by one.
    order = np.argsort(pixel, kind="stable")
    pixel, value = pixel[order], value[order]
    begins = np.flatnonzero(np.r_[True, pixel[1:] != pixel[:-1]]) if pixel.size else np.zeros(0, np.int64)
    rank = np.arange(pixel.size) - np.repeat(begins, np.diff(np.r_[begins, pixel.size]))
    flat = fragments.reshape(-1, _FRAGMENT)
    for k in range(int(rank.max(initial=-1)) + 1):
        at = rank == k
        flat[pixel[at]] = value[at] if k == 0 else _laid(flat[pixel[at]], value[at])
    seen = np.zeros(height * width, dtype=bool)
    seen[pixel] = True
    return seen.reshape(height, width)


def _laid(old: Float32Array, new: Float32Array) -> Float32Array:
    """Return fragments laid over or under what is there, as `_put` does."""
    same = np.abs(new[:, 4] - old[:, 4]) <= SAME_DEPTH * old[:, 4]
    nearer = new[:, 4] > old[:, 4]
    front, back = np.where(nearer[:, np.newaxis], (new, old), (old, new))
    channels = [0, 1, 2, 3, 5]
    result = front.copy()
    result[:, channels] += (1.0 - front[:, 3:4]) * back[:, channels]
    result[:, 4] = np.where(front[:, 3] >= 0.5, front[:, 4], back[:, 4])
    result[same] = np.where((new[:, 3] > old[:, 3])[:, np.newaxis], new, old)[same]
    return np.asarray(result)


def _quad_fragments(
    sheets: Sheets, moved: FloatArray, s: int, height: int, width: int, least_alpha: float
) -> tuple[npt.NDArray[np.int64], Float32Array]:
    """Return the pixels that one sheet's quads cover, in the order of the quads, and the fragments there."""
    place = moved[s]
    kinds = _with_neighbours(sheets.quads[s : s + 1])[0]
    corner_rows, corner_columns = np.nonzero(kinds)
    near = (corner_rows, corner_columns), (corner_rows, corner_columns + 1)
    far = (corner_rows + 1, corner_columns), (corner_rows + 1, corner_columns + 1)
    corners = np.stack([place[at] for at in (*near, *far)], axis=1)
    kind = kinds[corner_rows, corner_columns]
    between = (kind[:, np.newaxis] & np.array([_BESIDE, _ABOVE])) != 0
    low = np.ceil(corners[..., :2].min(axis=1) - 0.5 - _INSIDE)
    high = np.floor(corners[..., :2].max(axis=1) - 0.5 + np.where(between, -_INSIDE, _INSIDE))
    # In each row those that hold one pixel come last, as in the kernel.
    several = (high > low).any(axis=1) | (kind & TORN_QUAD != 0)
    order = np.lexsort((corner_columns, ~several, corner_rows))
    order = order[(corners[order, :, 2] >= 0.0).all(axis=1)]
    corners, corner_rows, corner_columns = corners[order], corner_rows[order], corner_columns[order]
    low = low[order].clip(0.0, [width, height]).astype(np.int64)
    high = high[order].clip(-1.0, [width - 1.0, height - 1.0])
    size = np.maximum(high.astype(np.int64) + 1 - low, 0)
    count = size[:, 0] * size[:, 1]
    quad = np.repeat(np.arange(count.size), count)
    inner = np.arange(quad.size) - np.repeat(np.cumsum(count) - count, count)
    j, i = np.divmod(inner, np.maximum(size[quad, 0], 1))
    i, j = i + low[quad, 0], j + low[quad, 1]
    a, b, c, d = (corners[quad, at, :2] for at in range(4))
    x = np.stack([i + 0.5, j + 0.5], axis=1)

    def solve(p: FloatArray, q: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        with np.errstate(divide="ignore", invalid="ignore"):
            det = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
            return (
                (r[:, 0] * q[:, 1] - r[:, 1] * q[:, 0]) / det,
                (p[:, 0] * r[:, 1] - p[:, 1] * r[:, 0]) / det,
            )

    u, v = solve(b - a, c - a, x - a)
    first = (u >= -_INSIDE) & (v >= -_INSIDE) & (u + v <= 1.0 + _INSIDE)
    u2, v2 = solve(c - d, b - d, x - d)
    u2, v2 = 1.0 - u2, 1.0 - v2
    second = (u2 <= 1.0 + _INSIDE) & (v2 <= 1.0 + _INSIDE) & (u2 + v2 >= 1.0 - _INSIDE)
    u, v = np.where(first, u, u2).clip(0.0, 1.0), np.where(first, v, v2).clip(0.0, 1.0)
    inside = first | second
    quad, i, j, u, v = quad[inside], i[inside], j[inside], u[inside], v[inside]
    weights = np.stack([(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v], axis=1)
    values = _corner_values(sheets, s, corner_rows, corner_columns, corners)
    fragment = np.einsum("nk,nkc->nc", weights, values[quad]).astype(np.float32)
    solid = fragment[:, 3] >= least_alpha
    return (j * width + i)[solid], fragment[solid]


def _corner_values(
    sheets: Sheets, s: int, rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64], corners: FloatArray
) -> FloatArray:
    """Return (quads, 4, fragment) values at the quads' corners, torn quads' as what lies behind."""
    at = [(rows, columns), (rows, columns + 1), (rows + 1, columns), (rows + 1, columns + 1)]
    values = np.concatenate(
        [
            np.stack([sheets.color[0, s][k] for k in at], axis=1),
            corners[..., 2:],
            np.stack([sheets.guessed[s][k] for k in at], axis=1)[..., np.newaxis],
        ],
        axis=2,
    )
    torn = sheets.quads[s][rows, columns] == TORN_QUAD
    depth = corners[torn, :, 2]
    least = depth.min(axis=1)
    far = depth <= 0.5 * (least + depth.max(axis=1))[:, np.newaxis]
    behind = np.stack([sheets.color[1, s][k][torn] for k in at], axis=1)
    for k in range(4):
        # Of a far corner: the corner itself, the one beside it, the one below it, the one across.
        beside = np.array([k, k ^ 1, k ^ 2, k ^ 3])
        chosen = beside[np.argmax(far[:, beside], axis=1)]
        values[torn, k, :4] = np.take_along_axis(behind, chosen[:, np.newaxis, np.newaxis], axis=1)[:, 0]
    values[torn, :, 4] = least[:, np.newaxis]
    values[torn, :, 5] = values[torn, :, 3]
    return np.asarray(values)
