"""Shadows that go with what casts them, and its light on others: moved along their paths on what is at rest.

Two renders, one with the moving objects hidden from the camera alone and one without them, differ by the
moving objects' shadows and bounced light. A point of the receiver looks along the ray to the lamp: where that
ray passes the object now is a point of the object, and the lamp's ray through where that point was at the
rendered frame tells which of the rendered shadow's points is seen here. The mean over the exposure is the
integral of 1983, eq. 3-3, over what is looked up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from . import jit
from .lamps import Lamp
from .lens import FloatArray
from .motion import MotionSettings, instants_for
from .paths import ObjectPath
from .samples import Float32Array, SampleLayer, Samples
from .scatter import Backend, uses_numba
from .shutter import Shutter
from .tracks import Mask, sample_origin

_FAINT: Final = 1e-4
"""Share of the light around a pixel below which a difference of two renders is left where it is."""

_NEAR: Final = 2.0
"""Half sizes of an object's box from its middle within which a ray to a lamp passes it."""

_LEAST_THICKNESS: Final = 0.25
"""Least half size of a box over its largest one, so that flat things are passed by rays too."""

_PROBES: Final = 17
"""Instants at which paths are looked at to learn how long they are and where shadows go."""

_CELL: Final = 8
"""Pixels, each way, of which one is asked whether any shadow comes there."""

_SLIT_GRID: Final = 257
"""Times at which an object's matrices are tabulated for a travelling slit."""

_OFF_PLANE: Final = 1e-3
"""Distance from a receiver's plane over the depth from which the shadow is taken for another surface's."""

_REFINEMENTS: Final = 2
"""How often the place of a shadow is looked for again where it lies on another surface."""

_ALMOST: Final = 1e-9
_STILL: Final = 1e-9
_SAME_DEPTH: Final = 1e-3
"""Share of its depth by which a moving object may lie behind what is at rest and still be seen."""


@dataclass(frozen=True, slots=True)
class _Receivers:
    """What shadows fall on: places in the world and normals towards the camera, NaN where nothing is."""

    points: FloatArray
    normals: FloatArray
    camera: FloatArray
    origin: FloatArray


@dataclass(frozen=True, slots=True)
class _Instants:
    """Instants of the exposure, as places in a table of times.

    Parameters
    ----------
    times : ndarray of float64 of shape (k,)
        The table, in frames.
    places : ndarray of float64 of shape (instants,)
        Place in the table of each instant, in the middle of the picture.
    rate : ndarray of float64 of shape (2,)
        Change of it with each column and row, for a travelling slit.
    middle : ndarray of float64 of shape (2,)
        Column and row where there is none.
    """

    times: FloatArray
    places: FloatArray
    rate: FloatArray
    middle: FloatArray


@dataclass(frozen=True, slots=True)
class _Cause:
    """A moving object before a lamp, which is (0, 0, 0, 0) for light from all around."""

    path: ObjectPath
    lamp: FloatArray

    def tables(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return object to world and back over time, and object to world at the rendered frame."""
        forward = self.path.at(times)
        return (
            np.ascontiguousarray(forward[:, :3]),
            np.ascontiguousarray(np.linalg.inv(forward)[:, :3]),
            np.ascontiguousarray(self.path.at(0.0)[:3]),
        )


def moved_shadows(
    layer: SampleLayer, samples: Samples, settings: MotionSettings, backend: Backend = "auto"
) -> SampleLayer:
    """Blur the shadows of moving objects, and their light on others, by their motion.

    Let S be the light of what is at rest with the moving objects' shadows on it, A without, and D = S - A.
    Where D lies within -A and A it belongs to the receiver's own light and moves as D / A, so that a texture
    under a shadow stays; what is left of it, bounced light on something dark, moves as it is:

        D'(x) = mean over the exposure of A(x) (D / A)(q) + (rest of D)(q), q = q(x, t).

    q is where the light's ray through the same point of the object meets the receiver at the rendered frame.
    Where it would lie on another surface the receiver is looked for there. A shadow that grows or shrinks is
    so worked out rightly too, where light would not be conserved.

    Parameters
    ----------
    layer : SampleLayer
        With the views `stationary`, with a depth, `absent` and, where movers are seen, `moving`.
    samples : Samples
        The file that it belongs to, with paths, and with lamps where there are any.
    settings : MotionSettings
        The exposure.
    backend : {"auto", "numba", "numpy"}
        Implementation; all give the same picture.

    Returns
    -------
    SampleLayer
        The layer with colours of itself and of its stationary view changed, float32 of shape (rows, columns,
        4), scene-linear; alpha stays. The layer itself where a view is missing or nothing moves.

    Notes
    -----
    Each pixel's D has one cause: the object and lamp whose ray it is that passes nearest the object's middle,
    measured in half sizes of its box; where two shadows overlap they go with the nearer cause. Where no ray
    passes near, and where D is bounced light, the nearest object moves it along the surface. A lamp counts as
    the point that it is listed as; its penumbra moves with its middle. What lies beyond the samples is taken
    to be as their border.
    """
    found = _changed(layer, samples, settings, backend)
    if found is None or layer.stationary is None or layer.absent is None:
        return layer
    change, before = found, layer.stationary.color
    stationary = replace(layer.stationary, color=_added(before, change))
    shown = np.float32(1.0) - _cover(layer)[..., np.newaxis]
    return replace(layer, color=_added(layer.color, change * shown), stationary=stationary)


def _changed(
    layer: SampleLayer, samples: Samples, settings: MotionSettings, backend: Backend
) -> Float32Array | None:
    """Return D' - D, or None where nothing changes."""
    view, absent, paths = layer.stationary, layer.absent, samples.paths
    if view is None or absent is None or view.depth is None or paths is None:
        return None
    shutter = settings.shutter
    probes = _instants(samples, shutter, _PROBES)
    if not any(_moves(path, probes.times) for path in paths.objects):
        return None
    light = np.maximum(absent.color[..., :3], np.float32(0.0))
    difference = view.color[..., :3] - absent.color[..., :3]
    level = np.maximum(view.color[..., :3], absent.color[..., :3]).max(axis=2)
    receivers = _receivers(view.depth, samples, paths.camera.at(0.0))
    there: Mask = np.asarray(np.isfinite(receivers.normals).all(axis=2))
    strong = there & (np.abs(difference).max(axis=2) > _FAINT * level)
    if not strong.any():
        return None
    causes, cause = _causes(receivers, strong, difference.sum(axis=2), paths.objects, samples.lamps)
    share = np.clip(difference, -light, light)
    source = np.empty((*strong.shape, 6), dtype=np.float32)
    source[..., :3] = np.divide(share, light, out=np.zeros_like(share), where=light > 0.0)
    source[..., 3:] = difference - share
    change = np.zeros_like(difference)
    compiled = uses_numba(backend)
    for number, item in enumerate(causes):
        own: Mask = np.equal(cause, number)
        if not own.any() or not _moves(item.path, probes.times):
            continue
        own_source = np.where(own[..., np.newaxis], source, np.float32(0.0))
        length, step = _longest(receivers, item, own, probes)
        instants = _instants(samples, shutter, instants_for(length))
        first, last = _reached(receivers, item, own, probes, step)
        wanted = np.flatnonzero((first <= last) & there | own)
        # From one probe before to one after, in instants.
        each = instants.places.size / _PROBES
        window = np.stack([np.floor((first - 0.5) * each), np.ceil((last + 1.5) * each)], axis=-1)
        window = np.clip(window, 0, instants.places.size).astype(np.int64).reshape(-1, 2)[wanted]
        gather = _gathered if compiled else _gathered_by_numpy
        tables = item.tables(instants.times)
        mean = np.zeros((wanted.size, 6))
        gather(
            wanted,
            window,
            receivers.points,
            receivers.normals,
            receivers.camera,
            receivers.origin,
            own_source,
            *tables,
            item.path.box.astype(np.float64),
            item.lamp,
            instants.places,
            instants.rate,
            instants.middle,
            mean,
        )
        rows, columns = np.unravel_index(wanted, strong.shape)
        moved = light[rows, columns] * mean[:, :3] + mean[:, 3:]
        before = np.where(own, np.float32(1.0), np.float32(0.0))[..., np.newaxis] * difference
        change[rows, columns] += (moved - before[rows, columns]).astype(np.float32)
    return change


def _added(color: Float32Array, change: Float32Array) -> Float32Array:
    """Return colours with a change, which makes nothing negative."""
    result = color.copy()
    result[..., :3] = np.maximum(color[..., :3] + change, np.minimum(color[..., :3], np.float32(0.0)))
    return result


def _cover(layer: SampleLayer) -> Float32Array:
    """Return how much of each pixel is a moving object's, from 0 to 1."""
    if layer.moving is None:
        return np.zeros(layer.color.shape[:2], dtype=np.float32)
    cover = np.clip(layer.moving.color[..., 3], np.float32(0.0), np.float32(1.0))
    # The view of movers alone shows them before what hides them, too.
    if layer.moving.depth is not None and layer.stationary is not None and layer.stationary.depth is not None:
        seen = layer.moving.depth <= layer.stationary.depth * (1.0 + _SAME_DEPTH)
        edge = ~np.isfinite(layer.moving.depth)
        cover = np.where(seen | edge, cover, np.float32(0.0))
    return cover


def _moves(path: ObjectPath, times: FloatArray) -> bool:
    """Return whether an object's box is elsewhere at any of some times than at the rendered frame."""
    corners = np.array(
        [[*path.box[[i, j, k], [0, 1, 2]], 1.0] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    way = (path.at(times) - path.at(0.0)) @ corners.T
    return bool(np.abs(way).max() > _STILL * max(1.0, float(np.abs(path.at(0.0) @ corners.T).max())))


def _instants(samples: Samples, shutter: Shutter, count: int) -> _Instants:
    """Return instants with equal shares of the light."""
    positions = shutter.times((np.arange(count) + 0.5) / count)
    times = shutter.frame_times(positions)
    slit = shutter.slit
    display = samples.display_window
    middle = 0.5 * np.array([display.columns, display.rows])
    if slit is None or slit.width == 1.0 or shutter.length == 0.0:
        return _Instants(times, np.arange(count, dtype=np.float64), np.zeros(2), middle)
    begin, end = shutter.interval
    grid = np.linspace(begin, end, _SLIT_GRID)
    step = float(grid[1] - grid[0])
    axis = 0 if slit.edge in ("left", "right") else 1
    rate = np.zeros(2)
    rate[axis] = (end - begin) * (1.0 - slit.width) / (2.0 * middle[axis]) / step
    return _Instants(grid, (times - begin) / step, rate if slit.edge in ("left", "top") else -rate, middle)


def _receivers(depth: Float32Array, samples: Samples, camera: FloatArray) -> _Receivers:
    """Return where the samples lie in the world, and the normals of their surfaces."""
    rows, columns = depth.shape
    origin = np.array(sample_origin(samples))
    x, y = np.meshgrid(origin[0] + np.arange(columns), origin[1] + np.arange(rows))
    z = np.where(np.isfinite(depth), depth, np.nan).astype(np.float64)
    points = np.stack([x * z, y * z, z, np.ones_like(z)], axis=-1) @ np.linalg.inv(camera).T[:, :3]
    normals = np.cross(_slope(points, z, 1), _slope(points, z, 0))
    with np.errstate(invalid="ignore", divide="ignore"):
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    # The third row of the camera's matrix points away from it.
    eye = np.linalg.inv(camera)[:3] @ np.array([0.0, 0.0, 0.0, 1.0])
    normals *= np.where(((eye - points) * normals).sum(axis=2, keepdims=True) < 0.0, -1.0, 1.0)
    return _Receivers(points, np.asarray(normals, dtype=np.float64), np.ascontiguousarray(camera[:3]), origin)


def _slope(points: FloatArray, depth: FloatArray, axis: int) -> FloatArray:
    """Return the way to a neighbour along an axis, on the side where the depth changes less."""
    # One over the depth changes evenly along a plane, the depth at a slant does not.
    inverse = 1.0 / depth
    empty = np.full_like(np.take(points, [0], axis=axis), np.nan)
    step = np.diff(points, axis=axis)
    bend = np.abs(np.diff(inverse, axis=axis))
    after = np.concatenate([step, empty], axis=axis)
    before = np.concatenate([empty, step], axis=axis)
    far_after = np.concatenate([bend, empty[..., 0]], axis=axis)
    far_before = np.concatenate([empty[..., 0], bend], axis=axis)
    use = np.isnan(far_before) | (far_after < far_before)
    return np.where(use[..., np.newaxis] & ~np.isnan(after), after, before)


def _causes(
    receivers: _Receivers,
    strong: Mask,
    difference: Float32Array,
    objects: tuple[ObjectPath, ...],
    lamps: tuple[Lamp, ...],
) -> tuple[list[_Cause], npt.NDArray[np.int32]]:
    """Return what may cast shadows, and for each pixel which of it does, -1 for nothing."""
    points, normals = receivers.points[strong], receivers.normals[strong]
    nearest = np.full(len(points), np.inf)
    near = np.full(len(points), np.inf)
    around = np.full(len(points), -1, dtype=np.int32)
    by_lamp = np.full(len(points), -1, dtype=np.int32)
    causes: list[_Cause] = []
    for path in objects:
        start = path.at(0.0)
        back = np.linalg.inv(start)
        size = np.linalg.norm(start[:3, :3], axis=0)
        half = 0.5 * (path.box[1] - path.box[0]) * size
        half = np.maximum(half, max(_LEAST_THICKNESS * half.max(), 1e-12)) / np.maximum(size, 1e-12)
        local = points @ back[:3, :3].T + back[:3, 3]
        gap = (local - np.clip(local, *path.box)) * size
        distance = np.linalg.norm(gap, axis=1)
        around[distance < nearest] = len(causes)
        nearest = np.minimum(nearest, distance)
        causes.append(_Cause(path, np.zeros(4)))
        local = (local - path.box.mean(axis=0)) / half
        for lamp in lamps:
            way = lamp.place[:3] - lamp.place[3] * points
            ray = way @ back[:3, :3].T / half
            length = np.maximum((ray * ray).sum(axis=1), 1e-300)
            at = np.maximum(-(local * ray).sum(axis=1) / length, 0.0)
            at = np.minimum(at, 1.0) if lamp.place[3] else at
            off = np.abs(local + at[:, np.newaxis] * ray).max(axis=1)
            better = ((way * normals).sum(axis=1) > 0.0) & (off < np.minimum(near, _NEAR))
            near[better], by_lamp[better] = off[better], len(causes)
            causes.append(_Cause(path, lamp.place.astype(np.float64)))
    cause = np.full(strong.shape, -1, dtype=np.int32)
    cause[strong] = np.where((by_lamp >= 0) & (difference[strong] < 0.0), by_lamp, around)
    return causes, cause


def _longest(receivers: _Receivers, cause: _Cause, own: Mask, probes: _Instants) -> tuple[float, float]:
    """Return the lengths of the longest path of a shadow and of its longest step between probes, in pixels.

    Beyond the samples all is as at their border, so that what goes on there, to the horizon, is no way.
    """
    rows, columns = own.shape
    pixels = np.flatnonzero(own)
    pixels = pixels[:: max(1, pixels.size // 4096)]
    before, length, longest = None, np.zeros(pixels.size), np.zeros(pixels.size)
    for n in range(probes.places.size):
        place = np.clip(_looked_up(receivers, cause, pixels, probes, n), 0.0, [columns - 1, rows - 1])
        if before is not None:
            step = np.nan_to_num(np.hypot(*(place - before).T))
            length += step
            longest = np.maximum(longest, step)
        before = place
    # The first and the last instant lie half a step inside.
    whole = float(np.quantile(length, 0.99)) * _PROBES / (_PROBES - 1)
    return whole, float(np.quantile(longest, 0.99))


def _reached(
    receivers: _Receivers, cause: _Cause, own: Mask, probes: _Instants, step: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return, for each pixel, the first and the last probe at which a shadow may be there, by whole cells.

    Where none ever is the last one is before the first.
    """
    rows, columns = own.shape
    y, x = np.mgrid[_CELL // 2 : rows + _CELL : _CELL, _CELL // 2 : columns + _CELL : _CELL]
    y, x = np.minimum(y, rows - 1), np.minimum(x, columns - 1)
    # Between two probes shadows go on, from either by half a step, and within a cell as well.
    margin = 2 * _CELL + math.ceil(0.5 * step)
    reach = ndimage.distance_transform_edt(~own) <= margin
    first, last = np.full(y.shape, _PROBES), np.full(y.shape, -1)
    pixels = (y * columns + x).ravel()
    for n in range(_PROBES):
        place = _looked_up(receivers, cause, pixels, probes, n)
        known: Mask = np.asarray(np.isfinite(place).all(axis=1))
        at = np.clip(np.rint(np.where(known[:, np.newaxis], place, 0.0)), 0, [columns - 1, rows - 1]).astype(
            int
        )
        now = (known & reach[at[:, 1], at[:, 0]]).reshape(y.shape)
        first[now], last[now] = np.minimum(first[now], n), n
    first, last = ndimage.minimum_filter(first, 3), ndimage.maximum_filter(last, 3)
    every = np.ix_(np.arange(rows) // _CELL, np.arange(columns) // _CELL)
    return first[every], last[every]


def _looked_up(
    receivers: _Receivers, cause: _Cause, pixels: npt.NDArray[np.int64], instants: _Instants, n: int
) -> FloatArray:
    """Return the column and row that pixels look at at an instant, NaN for none."""
    return _look_up(
        pixels,
        receivers.points,
        receivers.normals,
        receivers.camera,
        receivers.origin,
        *cause.tables(instants.times),
        cause.path.box.astype(np.float64),
        cause.lamp,
        float(instants.places[n]),
        instants.rate,
        instants.middle,
    )


def _look_up(
    pixels: npt.NDArray[np.int64],
    points: FloatArray,
    normals: FloatArray,
    camera: FloatArray,
    origin: FloatArray,
    forward: FloatArray,
    inverse: FloatArray,
    start: FloatArray,
    box: FloatArray,
    lamp: FloatArray,
    instant: float,
    rate: FloatArray,
    middle: FloatArray,
) -> FloatArray:
    """Return the column and row that pixels look at at an instant, NaN for none."""
    rows, columns = points.shape[:2]
    y, x = np.divmod(pixels, columns)
    point, normal = points[y, x], normals[y, x]
    index = instant + rate[0] * (origin[0] + x - middle[0]) + rate[1] * (origin[1] + y - middle[1])
    index = np.clip(index, 0.0, len(forward) - 1.0)
    k = np.minimum(index.astype(np.int64), max(len(forward) - 2, 0))
    later = np.minimum(k + 1, len(forward) - 1)
    share = (index - k)[:, np.newaxis, np.newaxis]
    now = forward[k] + share * (forward[later] - forward[k])
    back = inverse[k] + share * (inverse[later] - inverse[k])
    if not lamp.any():
        local = np.clip(_taken(back, point), box[0], box[1])
        way = _taken(start, local) - _taken(now, local)
        target = point + way - (way * normal).sum(axis=1, keepdims=True) * normal
        return _projected(camera, origin, target)
    with np.errstate(invalid="ignore", divide="ignore"):
        ray = lamp[:3] - lamp[3] * point
        center = _taken(now, np.broadcast_to(0.5 * (box[0] + box[1]), point.shape))
        at = ((center - point) * ray).sum(axis=1) / (ray * ray).sum(axis=1)
        good = (at > 0.0) & ((at < 1.0) | (lamp[3] == 0.0)) & ((ray * normal).sum(axis=1) > 0.0)
        through = _taken(start, _taken(back, point + at[:, np.newaxis] * ray))
        away = lamp[3] * through - lamp[:3]
        target = _met(through, away, point, normal)
        place = _projected(camera, origin, target)
        for _ in range(_REFINEMENTS):
            known: Mask = np.asarray(np.isfinite(place).all(axis=1))
            seen = np.floor(np.where(known[:, np.newaxis], place, 0.0) + 0.5)
            seen = np.clip(seen, 0, [columns - 1, rows - 1]).astype(np.int64)
            other, facing = points[seen[:, 1], seen[:, 0]], normals[seen[:, 1], seen[:, 0]]
            depth = target @ camera[2, :3] + camera[2, 3]
            off = np.abs(((other - target) * facing).sum(axis=1)) > _OFF_PLANE * depth
            better = _met(through, away, other, facing)
            there = _projected(camera, origin, better)
            use = known & off & np.isfinite(there).all(axis=1)
            target = np.where(use[:, np.newaxis], better, target)
            place = np.where(use[:, np.newaxis], there, place)
    return np.where(good[:, np.newaxis], place, np.nan)


def _taken(matrix: FloatArray, point: FloatArray) -> FloatArray:
    return np.asarray((matrix[..., :3] @ point[..., np.newaxis])[..., 0] + matrix[..., 3])


def _met(through: FloatArray, away: FloatArray, point: FloatArray, normal: FloatArray) -> FloatArray:
    """Return where rays meet planes from before, NaN where they do not."""
    down = (away * normal).sum(axis=1)
    at = ((point - through) * normal).sum(axis=1) / down
    at = np.where((down < -_ALMOST) & (at > 0.0), at, np.nan)
    return through + at[:, np.newaxis] * away


def _projected(camera: FloatArray, origin: FloatArray, target: FloatArray) -> FloatArray:
    h = target @ camera[:, :3].T + camera[:, 3]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(h[:, 2:] > 0.0, h[:, :2] / h[:, 2:] - origin, np.nan)


def _gathered_by_numpy(
    pixels: npt.NDArray[np.int64],
    window: npt.NDArray[np.int64],
    points: FloatArray,
    normals: FloatArray,
    camera: FloatArray,
    origin: FloatArray,
    source: Float32Array,
    forward: FloatArray,
    inverse: FloatArray,
    start: FloatArray,
    box: FloatArray,
    lamp: FloatArray,
    instants: FloatArray,
    rate: FloatArray,
    middle: FloatArray,
    mean: FloatArray,
) -> None:
    """Average what pixels look at over all instants, in whose window alone there is something."""
    rows, columns = points.shape[:2]
    for n, instant in enumerate(instants):
        now = np.flatnonzero((window[:, 0] <= n) & (n < window[:, 1]))
        place = _look_up(
            pixels[now],
            points,
            normals,
            camera,
            origin,
            forward,
            inverse,
            start,
            box,
            lamp,
            float(instant),
            rate,
            middle,
        )
        known: Mask = np.asarray(np.isfinite(place).all(axis=1))
        x = np.clip(place[known, 0], 0.0, columns - 1.0)
        y = np.clip(place[known, 1], 0.0, rows - 1.0)
        i = np.minimum(x.astype(np.int64), max(columns - 2, 0))
        j = np.minimum(y.astype(np.int64), max(rows - 2, 0))
        right, below = np.minimum(i + 1, columns - 1), np.minimum(j + 1, rows - 1)
        u, v = (x - i)[:, np.newaxis], (y - j)[:, np.newaxis]
        above = (1.0 - u) * source[j, i] + u * source[j, right]
        under = (1.0 - u) * source[below, i] + u * source[below, right]
        mean[now[known]] += (1.0 - v) * above + v * under
    mean /= instants.size


@jit.kernel(inline=True)
def _dot(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    return ax * bx + ay * by + az * bz


@jit.kernel(parallel=True)
def _gathered(
    pixels: Any,
    window: Any,
    points: Any,
    normals: Any,
    camera: Any,
    origin: Any,
    source: Any,
    forward: Any,
    inverse: Any,
    start: Any,
    box: Any,
    lamp: Any,
    instants: Any,
    rate: Any,
    middle: Any,
    mean: Any,
) -> None:
    """Do the same; each pixel by itself, so that threads do not matter."""
    rows, columns = points.shape[:2]
    last = forward.shape[0] - 1
    around = lamp[0] == 0.0 and lamp[1] == 0.0 and lamp[2] == 0.0 and lamp[3] == 0.0
    for number in jit.prange(pixels.size):
        y, x = pixels[number] // columns, pixels[number] % columns
        px, py, pz = points[y, x, 0], points[y, x, 1], points[y, x, 2]
        nx, ny, nz = normals[y, x, 0], normals[y, x, 1], normals[y, x, 2]
        rx, ry, rz = lamp[0] - lamp[3] * px, lamp[1] - lamp[3] * py, lamp[2] - lamp[3] * pz
        if not around and not _dot(rx, ry, rz, nx, ny, nz) > 0.0:
            continue
        local, world, other = np.empty(3), np.empty(3), np.empty(3)
        shift = rate[0] * (origin[0] + x - middle[0]) + rate[1] * (origin[1] + y - middle[1])
        for n in range(window[number, 0], window[number, 1]):
            index = min(max(instants[n] + shift, 0.0), float(last))
            k = min(int(index), max(last - 1, 0))
            later, share = min(k + 1, last), index - k
            at = 0.0
            if not around:
                for a in range(3):
                    value = 0.0
                    for b in range(4):
                        m = forward[k, a, b] + share * (forward[later, a, b] - forward[k, a, b])
                        value += m * (0.5 * (box[0, b] + box[1, b]) if b < 3 else 1.0)
                    world[a] = value
                at = _dot(world[0] - px, world[1] - py, world[2] - pz, rx, ry, rz)
                at /= _dot(rx, ry, rz, rx, ry, rz)
                if not (at > 0.0 and (at < 1.0 or lamp[3] == 0.0)):
                    continue
            ox, oy, oz = px + at * rx, py + at * ry, pz + at * rz
            for a in range(3):
                value = 0.0
                for b in range(4):
                    m = inverse[k, a, b] + share * (inverse[later, a, b] - inverse[k, a, b])
                    value += m * (ox if b == 0 else oy if b == 1 else oz if b == 2 else 1.0)
                local[a] = min(max(value, box[0, a]), box[1, a]) if around else value
            for a in range(3):
                world[a] = start[a, 3] + _dot(
                    start[a, 0], start[a, 1], start[a, 2], local[0], local[1], local[2]
                )
            if around:
                for a in range(3):
                    value = 0.0
                    for b in range(4):
                        m = forward[k, a, b] + share * (forward[later, a, b] - forward[k, a, b])
                        value += m * (local[b] if b < 3 else 1.0)
                    other[a] = world[a] - value
                up = _dot(other[0], other[1], other[2], nx, ny, nz)
                tx, ty, tz = px + other[0] - up * nx, py + other[1] - up * ny, pz + other[2] - up * nz
                ex, ey, ez = 0.0, 0.0, 0.0
            else:
                ex, ey, ez = (
                    lamp[3] * world[0] - lamp[0],
                    lamp[3] * world[1] - lamp[1],
                    lamp[3] * world[2] - lamp[2],
                )
                down = _dot(ex, ey, ez, nx, ny, nz)
                far = _dot(px - world[0], py - world[1], pz - world[2], nx, ny, nz) / down
                if not (down < -_ALMOST and far > 0.0):
                    continue
                tx, ty, tz = world[0] + far * ex, world[1] + far * ey, world[2] + far * ez
            w = _dot(camera[2, 0], camera[2, 1], camera[2, 2], tx, ty, tz) + camera[2, 3]
            if not w > 0.0:
                continue
            qx = (_dot(camera[0, 0], camera[0, 1], camera[0, 2], tx, ty, tz) + camera[0, 3]) / w - origin[0]
            qy = (_dot(camera[1, 0], camera[1, 1], camera[1, 2], tx, ty, tz) + camera[1, 3]) / w - origin[1]
            if not around:
                for _ in range(_REFINEMENTS):
                    i = int(min(max(math.floor(qx + 0.5), 0.0), columns - 1.0))
                    j = int(min(max(math.floor(qy + 0.5), 0.0), rows - 1.0))
                    fx, fy, fz = normals[j, i, 0], normals[j, i, 1], normals[j, i, 2]
                    gx, gy, gz = points[j, i, 0], points[j, i, 1], points[j, i, 2]
                    if not abs(_dot(gx - tx, gy - ty, gz - tz, fx, fy, fz)) > _OFF_PLANE * w:
                        break
                    down = _dot(ex, ey, ez, fx, fy, fz)
                    far = _dot(gx - world[0], gy - world[1], gz - world[2], fx, fy, fz) / down
                    if not (down < -_ALMOST and far > 0.0):
                        break
                    sx, sy, sz = world[0] + far * ex, world[1] + far * ey, world[2] + far * ez
                    depth = _dot(camera[2, 0], camera[2, 1], camera[2, 2], sx, sy, sz) + camera[2, 3]
                    if not depth > 0.0:
                        break
                    tx, ty, tz, w = sx, sy, sz, depth
                    qx = _dot(camera[0, 0], camera[0, 1], camera[0, 2], tx, ty, tz) + camera[0, 3]
                    qy = _dot(camera[1, 0], camera[1, 1], camera[1, 2], tx, ty, tz) + camera[1, 3]
                    qx, qy = qx / w - origin[0], qy / w - origin[1]
            qx, qy = min(max(qx, 0.0), columns - 1.0), min(max(qy, 0.0), rows - 1.0)
            i, j = min(int(qx), max(columns - 2, 0)), min(int(qy), max(rows - 2, 0))
            right, below = min(i + 1, columns - 1), min(j + 1, rows - 1)
            u, v = qx - i, qy - j
            for c in range(6):
                above = (1.0 - u) * source[j, i, c] + u * source[j, right, c]
                under = (1.0 - u) * source[below, i, c] + u * source[below, right, c]
                mean[number, c] += (1.0 - v) * above + v * under
        for c in range(6):
            mean[number, c] /= instants.size
