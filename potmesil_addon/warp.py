"""Instantaneous images: samples moved to where they are at an instant, the nearest one seen.

Samples are joined to sheets, one quad between four neighbours. At an instant every sample stands where
its path has led it, the quads are drawn into the pixels with colours and inverse depths interpolated,
and what is nearer hides what is farther, at that instant and not once for the frame. The mean over
instants that have equal shares of the light is eq. 3-4 of 1983.

Two implementations give the same picture: a numba kernel, band by band on all cores, and a numpy path
for machines without numba.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from . import jit
from .lens import FloatArray
from .samples import Float32Array
from .scatter import Backend, uses_numba

BAND_ROWS: Final = 32
"""Rows of pixels that one thread works on at a time."""

NO_TRACK: Final = -1
"""Track of a grid point that belongs to no sheet."""

VECTOR_TRACK: Final = -2
"""Track of a sample that follows its own velocity and acceleration."""

NO_QUAD: Final = 0
QUAD: Final = 1
TORN_QUAD: Final = 2
"""A quad whose corners part company: drawn as what lies behind, in the colour of its far corners."""

_BEHIND: Final = 1e-6
"""Ratio of depths z'/z below which a sample has passed the camera."""

_INSIDE: Final = 1e-5
"""How far outside a quad, in its own sides, a pixel's centre still counts as inside."""

SAME_DEPTH: Final = 1e-3
"""Relative difference of inverse depths of two fragments of one surface."""

_TRANSPARENT: Final = 1e-5

_FRAGMENT: Final = 6
"""Red, green, blue, alpha, inverse depth, guessed share."""

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
    rows, columns = track.shape
    x0, y0 = np.meshgrid(sheets.origin_x + np.arange(columns), sheets.origin_y + np.arange(rows))
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
    has_background = background is not None
    still = _nothing((1, 1)) if background is None else background
    lowest, highest = _reach(sheets, schedule)
    bands = -(-output.shape[0] // BAND_ROWS)
    together = jit.set_thread_count(None)
    for first in range(0, bands, together):
        end = min(first + together, bands)
        _expose_bands(first, end, sheets, schedule, still, has_background, lowest, highest, output, guessed)
        yield end / bands


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
        stamp = np.full(shape, -1, dtype=np.int32)
        lowest, highest = _reach(sheets, schedule)
        _instant_bands(sheets, schedule, least_alpha, lowest, highest, fragments, stamp)
        seen = stamp == 0
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


def _nothing(shape: tuple[int, int]) -> Background:
    """Return a background of the right types that is not looked at."""
    empty = np.zeros(shape, dtype=np.float32)
    return Background(np.zeros((*shape, 4), dtype=np.float32), empty, empty)


def _reach(sheets: Sheets, schedule: Schedule) -> tuple[Float32Array, Float32Array]:
    """Return the least and greatest y of each row of quads at each instant, (sheets, instants, rows - 1)."""
    shape = (sheets.track.shape[0], schedule.times.size, sheets.track.shape[1] - 1)
    lowest = np.empty(shape, dtype=np.float32)
    highest = np.empty(shape, dtype=np.float32)
    _reach_rows(sheets, schedule, lowest, highest)
    return lowest, highest


@jit.kernel()
def _place(sheets: Any, schedule: Any, n: int, s: int, row: int, column: int) -> tuple[float, float, float]:
    """Return x, y and inverse depth of a sample at an instant; an inverse depth of -1 once it is gone."""
    k = sheets.track[s, row, column]
    x0, y0 = sheets.origin_x + column, sheets.origin_y + row
    if k == NO_TRACK:
        return x0, y0, -1.0
    iz = float(sheets.inverse_depth[s, row, column])
    x, y, w = x0, y0, 1.0
    t, last_t, last_off = schedule.times[n], 0.0, 0.0
    if schedule.slit_axis >= 0:
        t += schedule.slit_rate * ((x0 if schedule.slit_axis == 0 else y0) - schedule.slit_middle)
    for step in range(1 if schedule.slit_axis < 0 else _SLIT_STEPS):
        if k == VECTOR_TRACK:
            x = x0 + t * (sheets.velocity[s, row, column, 0] + t * sheets.acceleration[s, row, column, 0])
            y = y0 + t * (sheets.velocity[s, row, column, 1] + t * sheets.acceleration[s, row, column, 1])
        else:
            if schedule.slit_axis < 0:
                g, share = n, 0.0
            else:
                at = min(max((t - schedule.first) / schedule.step, 0.0), schedule.matrices.shape[1] - 1.0)
                g = min(int(at), schedule.matrices.shape[1] - 2)
                share = at - g
            m = schedule.matrices[k, g]
            x = m[0, 0] * x0 + m[0, 1] * y0 + m[0, 2] + m[0, 3] * iz
            y = m[1, 0] * x0 + m[1, 1] * y0 + m[1, 2] + m[1, 3] * iz
            w = m[2, 0] * x0 + m[2, 1] * y0 + m[2, 2] + m[2, 3] * iz
            if share > 0.0:
                m = schedule.matrices[k, g + 1]
                x += share * (m[0, 0] * x0 + m[0, 1] * y0 + m[0, 2] + m[0, 3] * iz - x)
                y += share * (m[1, 0] * x0 + m[1, 1] * y0 + m[1, 2] + m[1, 3] * iz - y)
                w += share * (m[2, 0] * x0 + m[2, 1] * y0 + m[2, 2] + m[2, 3] * iz - w)
            if not w > _BEHIND:
                return x0, y0, -1.0
            x, y = x / w, y / w
        if schedule.slit_axis >= 0:
            # The slit meets the sample where both are at one time: secant steps to that time.
            place = x if schedule.slit_axis == 0 else y
            off = schedule.times[n] + schedule.slit_rate * (place - schedule.slit_middle) - t
            slope = (off - last_off) / (t - last_t) if step > 0 and t != last_t else -1.0
            last_t, last_off = t, off
            t -= off / (slope if abs(slope) > _LEAST_SLOPE else -1.0)
    return x, y, iz / w


@jit.kernel()
def _place_row(sheets: Any, schedule: Any, n: int, s: int, row: int, line: Any) -> None:
    """Fill `line` (columns, 3) with x, y and inverse depth of a row of samples at an instant."""
    track, inverse_depth = sheets.track[s, row], sheets.inverse_depth[s, row]
    y0 = sheets.origin_y + row
    last = NO_TRACK
    m0, m1, m3, m4, m5, m7, m8, m9, m11 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for column in range(line.shape[0]):
        k = track[column]
        if schedule.slit_axis >= 0 or k < 0:
            x, y, iz = _place(sheets, schedule, n, s, row, column)
        else:
            if k != last:
                # Neighbours mostly share their matrix; y0's part of it is the same all along the row.
                m = schedule.matrices[k, n]
                m0, m1, m3 = m[0, 0], m[0, 1] * y0 + m[0, 2], m[0, 3]
                m4, m5, m7 = m[1, 0], m[1, 1] * y0 + m[1, 2], m[1, 3]
                m8, m9, m11 = m[2, 0], m[2, 1] * y0 + m[2, 2], m[2, 3]
                last = k
            x0, iz = sheets.origin_x + column, float(inverse_depth[column])
            w = m8 * x0 + m9 + m11 * iz
            if w > _BEHIND:
                x, y, iz = (m0 * x0 + m1 + m3 * iz) / w, (m4 * x0 + m5 + m7 * iz) / w, iz / w
            else:
                x, y, iz = x0, y0, -1.0
        line[column, 0] = x
        line[column, 1] = y
        line[column, 2] = iz


@jit.kernel(parallel=True)
def _place_all(sheets: Any, schedule: Any, n: int, result: Any) -> None:
    """Fill `result` with where all samples are at an instant."""
    for row in jit.prange(result.shape[1]):
        for s in range(result.shape[0]):
            _place_row(sheets, schedule, n, s, row, result[s, row])


@jit.kernel(parallel=True)
def _reach_rows(sheets: Any, schedule: Any, lowest: Any, highest: Any) -> None:
    """Find how far up and down each row of quads reaches at each instant."""
    for instant_ in jit.prange(schedule.times.size):
        # A parallel loop counts without sign, which would turn indices into floats.
        n: Any = np.int64(instant_)
        line = np.empty((sheets.track.shape[2], 3))
        for s in range(sheets.track.shape[0]):
            above_low, above_high = np.inf, -np.inf
            for row in range(sheets.track.shape[1]):
                low, high = np.inf, -np.inf
                _place_row(sheets, schedule, n, s, row, line)
                for column in range(line.shape[0]):
                    if line[column, 2] >= 0.0:
                        low = min(low, line[column, 1])
                        high = max(high, line[column, 1])
                if row > 0:
                    lowest[s, n, row - 1] = min(low, above_low)
                    highest[s, n, row - 1] = max(high, above_high)
                above_low, above_high = low, high


@jit.kernel(inline=True)
def _put(
    fragments: Any,
    stamp: Any,
    n: int,
    at: int,
    r: float,
    g: float,
    b: float,
    a: float,
    iz: float,
    guess: float,
) -> bool:
    """Lay a fragment over or under what is at pixel `at` of a band; return whether it is the first there."""
    first = stamp[at] != n
    f = at * _FRAGMENT
    old_depth, old_alpha = fragments[f + 4], fragments[f + 3]
    wins = first
    if not first and abs(iz - old_depth) <= SAME_DEPTH * old_depth:
        # Two quads share an edge, or a surface meets itself: the more solid of the two is seen.
        wins = np.float32(a) > old_alpha
    if wins:
        stamp[at] = n
        fragments[f] = r
        fragments[f + 1] = g
        fragments[f + 2] = b
        fragments[f + 3] = a
        fragments[f + 4] = iz
        fragments[f + 5] = guess
    elif iz > old_depth * (1.0 + SAME_DEPTH):
        through = 1.0 - a
        fragments[f] = r + through * fragments[f]
        fragments[f + 1] = g + through * fragments[f + 1]
        fragments[f + 2] = b + through * fragments[f + 2]
        fragments[f + 3] = a + through * old_alpha
        fragments[f + 5] = guess + through * fragments[f + 5]
        if a >= 0.5:
            fragments[f + 4] = iz
    elif iz < old_depth * (1.0 - SAME_DEPTH) and old_alpha < 1.0:
        through = 1.0 - old_alpha
        fragments[f] += through * r
        fragments[f + 1] += through * g
        fragments[f + 2] += through * b
        fragments[f + 3] += through * a
        fragments[f + 5] += through * guess
        if old_alpha < 0.5:
            fragments[f + 4] = iz
    return bool(first)


@jit.kernel()
def _draw_row(
    color: Any, guessed: Any, quads: Any, first_sample: int, behind: int, columns: int,
    upper: Any, lower: Any, least_alpha: float, n: int, top: int, rows: int, width: int,
    fragments: Any, stamp: Any, touched: Any, count: int,
) -> int:  # fmt: skip
    """Draw a row of quads into a band; return how many pixels of the band were touched so far.

    Arrays are flat here, and the colours of torn quads `behind` elements after the others: numba checks
    every index of several dimensions for its sign, which took longer than the rest.
    """
    for column in range(columns - 1):
        kind = quads[column]
        if kind == NO_QUAD:
            continue
        xa, ya, za = upper[column, 0], upper[column, 1], upper[column, 2]
        xb, yb, zb = upper[column + 1, 0], upper[column + 1, 1], upper[column + 1, 2]
        xc, yc, zc = lower[column, 0], lower[column, 1], lower[column, 2]
        xd, yd, zd = lower[column + 1, 0], lower[column + 1, 1], lower[column + 1, 2]
        begin_y = max(0, int(np.ceil(min(ya, yb, yc, yd) - 0.5 - _INSIDE)) - top)
        end_y = min(rows, int(np.floor(max(ya, yb, yc, yd) - 0.5 + _INSIDE)) + 1 - top)
        if begin_y >= end_y or min(za, zb, zc, zd) < 0.0:
            continue
        begin_x = max(0, int(np.ceil(min(xa, xb, xc, xd) - 0.5 - _INSIDE)))
        end_x = min(width, int(np.floor(max(xa, xb, xc, xd) - 0.5 + _INSIDE)) + 1)
        if begin_x >= end_x:
            continue
        # Where each corner takes its colour from: itself, or in a torn quad a far corner.
        oa = first_sample + column
        ob, oc, od = oa + 1, oa + columns, oa + columns + 1
        sa, sb, sc, sd = oa, ob, oc, od
        if kind == TORN_QUAD:
            far = min(za, zb, zc, zd)
            limit = 0.5 * (far + max(za, zb, zc, zd))
            fa, fb, fc, fd = za <= limit, zb <= limit, zc <= limit, zd <= limit
            # Near corners take the far one beside them, or below, or across.
            sa = behind + (oa if fa else (ob if fb else (oc if fc else od)))
            sb = behind + (ob if fb else (oa if fa else (od if fd else oc)))
            sc = behind + (oc if fc else (od if fd else (oa if fa else ob)))
            sd = behind + (od if fd else (oc if fc else (ob if fb else oa)))
            za, zb, zc, zd = far, far, far, far
        # The triangle a, b, c with a's corner as origin, and d, c, b with d's.
        ux, uy, vx, vy = xb - xa, yb - ya, xc - xa, yc - ya
        det = ux * vy - uy * vx
        px, py, qx, qy = xc - xd, yc - yd, xb - xd, yb - yd
        det2 = px * qy - py * qx
        for j in range(begin_y, end_y):
            y = top + j + 0.5
            for i in range(begin_x, end_x):
                x = i + 0.5
                inside = False
                u, v = 0.0, 0.0
                if det != 0.0:
                    dx, dy = x - xa, y - ya
                    u, v = (dx * vy - dy * vx) / det, (ux * dy - uy * dx) / det
                    inside = u >= -_INSIDE and v >= -_INSIDE and u + v <= 1.0 + _INSIDE
                if not inside and det2 != 0.0:
                    dx, dy = x - xd, y - yd
                    u, v = 1.0 - (dx * qy - dy * qx) / det2, 1.0 - (px * dy - py * dx) / det2
                    inside = u <= 1.0 + _INSIDE and v <= 1.0 + _INSIDE and u + v >= 1.0 - _INSIDE
                if not inside:
                    continue
                # What lies outside by rounding must not be extrapolated: beside a highlight it would show.
                u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
                wa, wb, wc, wd = (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v
                a, b, c, d = 4 * sa, 4 * sb, 4 * sc, 4 * sd
                alpha = wa * color[a + 3] + wb * color[b + 3] + wc * color[c + 3] + wd * color[d + 3]
                if alpha < least_alpha:
                    continue
                guess = alpha
                if kind == QUAD:
                    guess = wa * guessed[oa] + wb * guessed[ob] + wc * guessed[oc] + wd * guessed[od]
                first_here = _put(
                    fragments, stamp, n, j * width + i,
                    wa * color[a] + wb * color[b] + wc * color[c] + wd * color[d],
                    wa * color[a + 1] + wb * color[b + 1] + wc * color[c + 1] + wd * color[d + 1],
                    wa * color[a + 2] + wb * color[b + 2] + wc * color[c + 2] + wd * color[d + 2],
                    alpha, wa * za + wb * zb + wc * zc + wd * zd, guess,
                )  # fmt: skip
                if first_here:
                    touched[count] = j * width + i
                    count += 1
    return count


@jit.kernel()
def _draw_band(
    sheets: Any, schedule: Any, n: int, least_alpha: float, lowest: Any, highest: Any,
    top: int, rows: int, width: int,
    fragments: Any, stamp: Any, touched: Any, upper: Any, lower: Any,
) -> int:  # fmt: skip
    """Draw all sheets at an instant into a band; return the number of pixels touched."""
    count = 0
    first, last = top + 0.5 - _INSIDE, top + rows - 0.5 + _INSIDE
    color, guessed = sheets.color.reshape(-1), sheets.guessed.reshape(-1)
    sheet_rows, columns = sheets.track.shape[1], sheets.track.shape[2]
    behind = sheets.track.size
    for s in range(sheets.track.shape[0]):
        placed = -1
        for row in range(sheet_rows - 1):
            if not (highest[s, n, row] >= first and lowest[s, n, row] <= last):
                continue
            if placed == row:
                # The last row's lower line is this one's upper.
                upper, lower = lower, upper
            else:
                _place_row(sheets, schedule, n, s, row, upper)
            _place_row(sheets, schedule, n, s, row + 1, lower)
            placed = row + 1
            count = _draw_row(
                color, guessed, sheets.quads[s, row], (s * sheet_rows + row) * columns, behind, columns,
                upper, lower, least_alpha, n, top, rows, width, fragments, stamp, touched, count,
            )  # fmt: skip
    return count


@jit.kernel()
def _add_instant(
    total: Any, fragments: Any, color: Any, inverse_depth: Any, guessed: Any, has_background: bool,
    at: int, below: int,
) -> None:  # fmt: skip
    """Add pixel `at` of a band's instant, before or behind what stands still (`below`), to its sums."""
    f, t, k = _FRAGMENT * at, 5 * at, 4 * below
    if not has_background:
        for c in range(4):
            total[t + c] += fragments[f + c]
        total[t + 4] += fragments[f + 5]
    elif fragments[f + 4] >= inverse_depth[below] * (1.0 - SAME_DEPTH):
        through = 1.0 - fragments[f + 3]
        for c in range(4):
            total[t + c] += fragments[f + c] + through * color[k + c]
        total[t + 4] += fragments[f + 5] + through * guessed[below]
    else:
        through = 1.0 - color[k + 3]
        for c in range(4):
            total[t + c] += color[k + c] + through * fragments[f + c]
        total[t + 4] += guessed[below] + through * fragments[f + 5]


@jit.kernel()
def _expose_band(
    sheets: Any, schedule: Any, background: Any, has_background: bool, lowest: Any, highest: Any,
    top: int, output: Any, guessed: Any,
) -> None:  # fmt: skip
    """Average all instants in a band of the output."""
    rows, columns = guessed.shape
    instants = schedule.times.size
    still_color, still_depth = background.color.reshape(-1), background.inverse_depth.reshape(-1)
    still_guessed = background.guessed.reshape(-1)
    total = np.zeros(rows * columns * 5)
    times_seen = np.zeros(rows * columns, dtype=np.int32)
    fragments = np.empty(rows * columns * _FRAGMENT, dtype=np.float32)
    stamp = np.full(rows * columns, -1, dtype=np.int32)
    touched = np.empty(rows * columns, dtype=np.int32)
    upper = np.empty((sheets.track.shape[2], 3))
    lower = np.empty((sheets.track.shape[2], 3))
    # With nothing behind, what is transparent is seen too; otherwise it must not touch a pixel.
    least_alpha = _TRANSPARENT if has_background else 0.0
    for n in range(instants):
        count = _draw_band(
            sheets, schedule, n, least_alpha, lowest, highest, top, rows, columns,
            fragments, stamp, touched, upper, lower,
        )  # fmt: skip
        for p in range(count):
            at = touched[p]
            times_seen[at] += 1
            _add_instant(
                total, fragments, still_color, still_depth, still_guessed, has_background,
                at, top * columns + at,
            )  # fmt: skip
    for j in range(rows):
        for i in range(columns):
            at = j * columns + i
            seen = times_seen[at]
            if not has_background:
                for c in range(4):
                    output[j, i, c] = total[5 * at + c] / seen if seen > 0 else 0.0
                guessed[j, i] = (total[5 * at + 4] + instants - seen) / instants
                continue
            below = (top + j) * columns + i
            hint = still_guessed[below]
            # To the bit where nothing was: no sum comes near what never changed.
            for c in range(4):
                still = still_color[4 * below + c]
                mean = (total[5 * at + c] + (instants - seen) * still) / instants
                output[j, i, c] = still if seen == 0 else mean
            guessed[j, i] = hint if seen == 0 else (total[5 * at + 4] + (instants - seen) * hint) / instants


@jit.kernel(parallel=True)
def _expose_bands(
    first_band: int, end_band: int,
    sheets: Any, schedule: Any, background: Any, has_background: bool, lowest: Any, highest: Any,
    output: Any, guessed: Any,
) -> None:  # fmt: skip
    """Average all instants in some bands; a band belongs to one thread."""
    for band in jit.prange(first_band, end_band):
        top = band * BAND_ROWS
        bottom = min(top + BAND_ROWS, output.shape[0])
        _expose_band(
            sheets, schedule, background, has_background, lowest, highest,
            top, output[top:bottom], guessed[top:bottom],
        )  # fmt: skip


@jit.kernel(parallel=True)
def _instant_bands(
    sheets: Any, schedule: Any, least_alpha: float, lowest: Any, highest: Any, fragments: Any, stamp: Any
) -> None:
    """Draw the schedule's only instant, all bands."""
    for band in jit.prange(-(-stamp.shape[0] // BAND_ROWS)):
        top = band * BAND_ROWS
        bottom = min(top + BAND_ROWS, stamp.shape[0])
        pixels = slice(top * stamp.shape[1], bottom * stamp.shape[1])
        _draw_band(
            sheets, schedule, 0, least_alpha, lowest, highest, top, bottom - top, stamp.shape[1],
            fragments.reshape(-1, _FRAGMENT)[pixels].reshape(-1), stamp.reshape(-1)[pixels],
            np.empty((bottom - top) * stamp.shape[1], dtype=np.int32),
            np.empty((sheets.track.shape[2], 3)), np.empty((sheets.track.shape[2], 3)),
        )  # fmt: skip


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
    corner_rows, corner_columns = np.nonzero(sheets.quads[s])
    near = (corner_rows, corner_columns), (corner_rows, corner_columns + 1)
    far = (corner_rows + 1, corner_columns), (corner_rows + 1, corner_columns + 1)
    corners = np.stack([place[at] for at in (*near, *far)], axis=1)
    whole = (corners[..., 2] >= 0.0).all(axis=1)
    corners, corner_rows, corner_columns = corners[whole], corner_rows[whole], corner_columns[whole]
    low = np.ceil(corners[..., :2].min(axis=1) - 0.5 - _INSIDE).clip(0.0, [width, height]).astype(np.int64)
    high = np.floor(corners[..., :2].max(axis=1) - 0.5 + _INSIDE).clip(-1.0, [width - 1.0, height - 1.0])
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
