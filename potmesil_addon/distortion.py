"""What the lens bends: samples and pictures at the places where a distorting lens images them.

A renderer's camera is a pinhole, whose straight lines stay straight. The models are those of Blender's movie
clips, in the form that libmv gives them in ``simple_pipeline/distortion_models.h``, so that a solved
camera's coefficients can be taken as they are. Points are normalised: (pixel - axis) / focal length in
pixels, y up. With (x, y) undistorted, (x', y') distorted, r and r' their distances from the axis:

- ``polynomial``: (x', y') = (x, y) (1 + k1 r^2 + k2 r^4 + k3 r^6);
- ``division``: (x', y') = (x, y) / (1 + k1 r^2 + k2 r^4), of the undistorted r, as libmv has it;
- ``brown``: (x', y') = (x, y) (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + (t, u) with
  t = p1 (r^2 + 2 x^2) + 2 p2 x y and u = p2 (r^2 + 2 y^2) + 2 p1 x y;
- ``nuke``: (x, y) = (x', y') / (1 + k1 r'^2 + k2 r'^4), the unit of r' being half of the frame's longer side.

A lens that distorts still shows each surface with its own radiance, so a place takes the light of the place
that it shows and no share of it for being stretched: there is no Jacobian in the brightness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from . import jit
from .aperture import SamplePosition
from .camera import Film
from .effects import ChromaticAberration, Distortion
from .lens import FloatArray
from .samples import Cryptomatte, Float32Array, SampleLayer, Window
from .scatter import Backend, uses_numba

_GREEN: Final = 1

_BAND: Final = 1 << 19
"""Pixels whose places are in memory at once."""

_NODES: Final = 1025
"""Radii between which a point's undistorted radius is looked for."""

_STEPS: Final = 60
"""Most steps of an iteration: as many bisections leave rounding only."""

_CLOSE: Final = 1e-9
"""Newton step in focal lengths that is the last one: the next one would be its square."""

_CLOSE_ENOUGH: Final = 1e-6
"""The same for a picture."""

_ACROSS: Final = 65
"""Samples, each way, of the inside of a window."""


@dataclass(frozen=True, slots=True)
class _Bend:
    """One model's formula in normalised coordinates, and how far it goes before it folds back.

    `limit` is the radius where the formula's derivative turns 0, or its denominator, and `reach` what the
    formula makes of it; ``inf`` where it never does.
    """

    coefficients: FloatArray
    limit: float
    reach: float
    divides: bool
    backwards: bool

    @property
    def tangential(self) -> bool:
        """Whether it does not depend on the radius alone."""
        return bool(self.coefficients[4:].any())

    @property
    def numbers(self) -> FloatArray:
        """All of it for a kernel."""
        return np.array(
            [*self.coefficients, self.limit, self.reach, float(self.divides), float(self.backwards)]
        )


@dataclass(frozen=True, slots=True)
class LensMap:
    """Where a distorting lens images what a pinhole images elsewhere.

    Parameters
    ----------
    distortion : Distortion
        Model and coefficients.
    focal_x, focal_y : float
        Focal length in pixels' widths and heights.
    axis_x, axis_y : float
        Where the optical axis meets the picture, in absolute pixels as `Window` counts them: x right, y
        down, pixel centres at halves.
    columns, rows : int
        Size of the frame without overscan, which ``nuke`` goes by.
    size_red, size_blue : float
        By what share red's and blue's pictures are larger than green's.
    """

    distortion: Distortion
    focal_x: float
    focal_y: float
    axis_x: float
    axis_y: float
    columns: int
    rows: int
    size_red: float = 0.0
    size_blue: float = 0.0

    def distort(self, points: npt.ArrayLike) -> FloatArray:
        """Return where green is seen in the picture.

        Parameters
        ----------
        points : array_like of shape (..., 2)
            Places (x, y) in a pinhole's picture, in absolute pixels.

        Returns
        -------
        ndarray of float64 of shape (..., 2)
            Places in the distorted picture; NaN for what lies outside of where the model holds, which would
            fold back into the picture: no light.
        """
        bend = self.bend()
        x, y = self._normalised(points, 1.0)
        return self._pixels(*(_inverse(x, y, bend) if bend.backwards else _checked(x, y, bend)))

    def undistort(self, points: npt.ArrayLike, primary: int | None = None) -> FloatArray:
        """Return what a place in the picture shows.

        Parameters
        ----------
        points : array_like of shape (..., 2)
            Places (x, y) in the distorted picture, in absolute pixels.
        primary : {0, 1, 2} or None
            Red, green or blue; green without.

        Returns
        -------
        ndarray of float64 of shape (..., 2)
            Places in a pinhole's picture; NaN for those that no light reaches.
        """
        bend = self.bend()
        x, y = self._normalised(points, self.scale(_GREEN if primary is None else primary))
        return self._pixels(*(_checked(x, y, bend) if bend.backwards else _inverse(x, y, bend)))

    def scale(self, primary: int) -> float:
        """Return how much larger than green's a primary's picture is, as a factor."""
        return 1.0 + (self.size_red, 0.0, self.size_blue)[primary]

    @property
    def primaries(self) -> tuple[int, ...]:
        """The primaries that need places of their own: all, or green for all."""
        return (0, 1, 2) if self.size_red or self.size_blue else (_GREEN,)

    def bend(self) -> _Bend:
        """Return the formula in normalised coordinates."""
        own = self.distortion
        if own.model == "nuke":
            unit = 0.5 * max(self.columns / self.focal_x, self.rows / self.focal_y)
            return _bend_of([own.k1 / unit**2, own.k2 / unit**4], divides=True, backwards=True)
        if own.model == "division":
            return _bend_of([own.k1, own.k2], divides=True)
        if own.model == "polynomial":
            return _bend_of([own.k1, own.k2, own.k3])
        return _bend_of([own.k1, own.k2, own.k3, own.k4, own.p1, own.p2])

    def _normalised(self, points: npt.ArrayLike, scale: float) -> tuple[FloatArray, FloatArray]:
        points = np.asarray(points, dtype=np.float64)
        x = (points[..., 0] - self.axis_x) / (self.focal_x * scale)
        return x, (self.axis_y - points[..., 1]) / (self.focal_y * scale)

    def _pixels(self, x: FloatArray, y: FloatArray) -> FloatArray:
        return np.stack([self.axis_x + self.focal_x * x, self.axis_y - self.focal_y * y], axis=-1)


def lens_map(
    distortion: Distortion | None,
    chromatic: ChromaticAberration | None,
    focal_length: float,
    film: Film,
    axis: tuple[float, float],
    frame: Window,
) -> LensMap | None:
    """Return where a lens images what a pinhole images elsewhere.

    Parameters
    ----------
    distortion : Distortion or None
        Lines that the lens bends.
    chromatic : ChromaticAberration or None
        Colours that it images at other sizes.
    focal_length : float
        In metres.
    film : Film
        Gives the pixels' size on the film.
    axis : tuple of float
        Where the optical axis meets the picture, in absolute pixels x and y.
    frame : Window
        The picture without overscan.

    Returns
    -------
    LensMap or None
        None where nothing is bent.
    """
    bends = distortion is not None and any(
        (distortion.k1, distortion.k2, distortion.k3, distortion.k4, distortion.p1, distortion.p2)
    )
    sizes = (0.0, 0.0) if chromatic is None else (chromatic.size_red, chromatic.size_blue)
    if not bends and not any(sizes):
        return None
    return LensMap(
        distortion or Distortion(),
        focal_length / film.pitch_x,
        focal_length / film.pitch_y,
        *axis,
        frame.columns,
        frame.rows,
        *sizes,
    )


def window_needed(lens_map: LensMap, target: Window, margin: int = 2) -> Window:
    """Return the pixels of a pinhole's picture that a distorted one shows.

    Parameters
    ----------
    lens_map : LensMap
        The lens.
    target : Window
        The distorted picture.
    margin : int
        Pixels more on each side, for interpolation.

    Returns
    -------
    Window
        May be larger or smaller than the picture, and as large as the model goes.
    """
    points = np.concatenate([_border(target), _inside(target), _folds(lens_map, target)])
    seen = np.concatenate([lens_map.undistort(points, primary) for primary in lens_map.primaries])
    seen = seen[np.isfinite(seen).all(axis=1)]
    if seen.size == 0:
        return target
    x0, y0 = (math.floor(value) - margin for value in seen.min(axis=0).tolist())
    x1, y1 = (math.ceil(value) + margin for value in seen.max(axis=0).tolist())
    return Window(x0, y0, x1, y1)


def distorted_layer(
    layer: SampleLayer,
    data: Window,
    target: Window,
    lens_map: LensMap,
    position: SamplePosition,
    backend: Backend = "auto",
) -> SampleLayer:
    """Return a layer's samples where the lens images them.

    Colours are interpolated (Catmull-Rom, limited to the nearest four samples' range), each primary at its
    own place and alpha at green's. All else is the nearest sample's, as no surface lies between two.

    Parameters
    ----------
    layer : SampleLayer
        A pinhole's samples.
    data : Window
        Where they lie, as many as there are samples each way.
    target : Window
        Where samples are wanted.
    lens_map : LensMap
        The lens.
    position : {"center", "corner"}
        Where samples lie on the pixel grid.
    backend : {"auto", "numba", "numpy"}
        Implementation.

    Returns
    -------
    SampleLayer
        Without vectors and without the views that only motion needs, which comes before. Where there is no
        data colours are 0, depths ``inf`` and numbers 0; a primary whose data ends a little before green's
        has its border carried on.
    """
    work = _Resampling(data, target, lens_map, position, backend)
    result = work.of_layer(layer)
    work.run()
    return result


def distorted_picture(
    picture: Float32Array, window: Window, target: Window, lens_map: LensMap, backend: Backend = "auto"
) -> Float32Array:
    """Return a finished picture as the lens images it.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, channels)
        A pinhole's picture; red, green and blue come first where there are three channels or more.
    window : Window
        Where it lies.
    target : Window
        Where a picture is wanted.
    lens_map : LensMap
        The lens.
    backend : {"auto", "numba", "numpy"}
        Implementation.

    Returns
    -------
    ndarray of float32 of shape (target rows, target columns, channels)
        Interpolated as `distorted_layer` does; 0 where there is no data.
    """
    work = _Resampling(window, target, lens_map, "center", backend)
    result = work.of_colors(picture)
    work.run()
    return result


class _Resampling:
    """Arrays to be resampled, and their results, which are filled in bands of rows."""

    def __init__(
        self, data: Window, target: Window, lens_map: LensMap, position: SamplePosition, backend: Backend
    ) -> None:
        self._data, self._target, self._lens = data, target, lens_map
        self._offset = 0.5 if position == "center" else 0.0
        self._compiled = uses_numba(backend)
        self._colors: list[tuple[Float32Array, Float32Array]] = []
        self._others: list[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = []

    def of_layer(self, layer: SampleLayer) -> SampleLayer:
        """Return the layer that `run` will fill."""

        def part(of: SampleLayer | None) -> SampleLayer | None:
            return None if of is None else self.of_layer(of)

        matte = layer.cryptomatte
        return replace(
            layer,
            color=self.of_colors(layer.color),
            depth=self._nearest(layer.depth, math.inf),
            object_index=self._nearest(layer.object_index),
            vector=None,
            stationary=None,
            moving=None,
            hidden=tuple(self.of_layer(view) for view in layer.hidden),
            cryptomatte=None if matte is None else self._of_cryptomatte(matte),
            reflected=part(layer.reflected),
            transmitted=part(layer.transmitted),
            absent=None,
            patch=self._nearest(layer.patch),
            astigmatism=self._nearest(layer.astigmatism),
        )

    def of_colors(self, source: Float32Array) -> Float32Array:
        """Return the picture that `run` will fill."""
        result = np.zeros((self._target.rows, self._target.columns, source.shape[2]), dtype=np.float32)
        self._colors.append((np.ascontiguousarray(source, dtype=np.float32), result))
        return result

    def _nearest(self, source: Any, missing: float = 0.0) -> Any:
        if source is None:
            return None
        shape = (self._target.rows, self._target.columns, *source.shape[2:])
        result = np.full(shape, missing, dtype=source.dtype)
        self._others.append((source, result))
        return result

    def _of_cryptomatte(self, matte: Cryptomatte) -> Cryptomatte:
        def of_ranks(values: npt.NDArray[Any]) -> Any:
            ranks = values.shape[0]
            result = np.zeros((ranks, self._target.rows, self._target.columns), dtype=values.dtype)
            self._others.extend(zip(values, result, strict=True))
            return result

        return Cryptomatte(of_ranks(matte.ids), of_ranks(matte.coverage))

    def run(self) -> None:
        """Fill all results."""
        rows = max(1, _BAND // max(1, self._target.columns))
        green = self._lens.primaries.index(_GREEN)
        resample = _resample_compiled if self._compiled else _resample
        for first in range(0, self._target.rows, rows):
            band = slice(first, min(first + rows, self._target.rows))
            places = self._places(band)
            for color, wanted in self._colors:
                resample(color, places, wanted[band], _channel_order(color.shape[2], len(places)), green)
            if not self._others:
                continue
            x, y = places[green, ..., 0] + 0.5, places[green, ..., 1] + 0.5
            there = (x >= 0.0) & (x < self._data.columns) & (y >= 0.0) & (y < self._data.rows)
            from_rows, from_columns = y[there].astype(np.intp), x[there].astype(np.intp)
            for source, result in self._others:
                result[band][there] = source[from_rows, from_columns]

    def _places(self, band: slice) -> FloatArray:
        """Return (primaries, rows, columns, 2) what a band's samples show, counted in the data's samples."""
        lens, origin = self._lens, np.array([self._data.x0, self._data.y0]) + self._offset
        shape = (len(lens.primaries), band.stop - band.start, self._target.columns, 2)
        places = np.empty(shape)
        x0, y0 = self._target.x0 + self._offset, self._target.y0 + band.start + self._offset
        if self._compiled:
            frame = np.array([lens.axis_x, lens.axis_y, lens.focal_x, lens.focal_y])
            scales = np.array([lens.scale(primary) for primary in lens.primaries])
            _find_places(x0, y0, frame, lens.bend().numbers, scales, places)
        else:
            points = np.stack(np.meshgrid(x0 + np.arange(shape[2]), y0 + np.arange(shape[1])), axis=-1)
            for n, primary in enumerate(lens.primaries):
                places[n] = lens.undistort(points, primary)
        places -= origin
        return places


def _channel_order(channels: int, maps: int) -> npt.NDArray[np.int64]:
    """Return (channels, 2) channels and the map of each, those of one map beside each other."""
    if maps == 1:
        found = [(channel, 0) for channel in range(channels)]
    else:
        found = [(c, c if c < 3 and channels >= 3 else _GREEN) for c in range(channels)]
    return np.array(sorted(found, key=lambda pair: pair[1]), dtype=np.int64).reshape(-1, 2)


def _border(window: Window) -> FloatArray:
    """Return places all around a window, half a pixel apart."""
    x = np.arange(2 * window.columns + 1) * 0.5 + window.x0
    y = np.arange(2 * window.rows + 1) * 0.5 + window.y0
    sides = [np.meshgrid(x, [window.y0, window.y1]), np.meshgrid([window.x0, window.x1], y)]
    return np.concatenate([np.stack(side, axis=-1).reshape(-1, 2) for side in sides])


def _inside(window: Window) -> FloatArray:
    x = np.linspace(window.x0, window.x1, _ACROSS)
    y = np.linspace(window.y0, window.y1, _ACROSS)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _folds(lens: LensMap, window: Window) -> FloatArray:
    """Return places just within the circles, one for each primary, where the model ends in a window."""
    bend = lens.bend()
    end = bend.limit if bend.backwards else bend.reach
    if not math.isfinite(end):
        return np.empty((0, 2))
    angle = np.linspace(0.0, 2.0 * math.pi, 8 * (window.columns + window.rows))
    circle = np.stack([lens.focal_x * np.cos(angle), lens.focal_y * np.sin(angle)], axis=-1)
    sizes = [end * (1.0 - 1e-9) * lens.scale(primary) for primary in lens.primaries]
    points = np.concatenate([np.array([lens.axis_x, lens.axis_y]) + size * circle for size in sizes])
    inside = (points >= [window.x0, window.y0]) & (points <= [window.x1, window.y1])
    return np.asarray(points[inside.all(axis=1)])


def _bend_of(values: list[float], *, divides: bool = False, backwards: bool = False) -> _Bend:
    """Return a formula with its range."""
    coefficients = np.array(values + [0.0] * (6 - len(values)))
    series = np.concatenate([[1.0], coefficients[:4]])
    order = 2.0 * np.arange(5)
    # The numerator of the derivative of r q(r^2), or of r / q(r^2).
    turns = _first_root(series * (1.0 - order if divides else 1.0 + order))
    pole = _first_root(series) if divides else math.inf
    if not math.isfinite(min(turns, pole)):
        return _Bend(coefficients, math.inf, math.inf, divides, backwards)
    if pole <= turns:
        return _Bend(coefficients, pole, math.inf, divides, backwards)
    factor = float(np.polynomial.polynomial.polyval(turns**2, series))
    return _Bend(coefficients, turns, turns / factor if divides else turns * factor, divides, backwards)


def _first_root(series: FloatArray) -> float:
    """Return the smallest r > 0 at which a polynomial in r^2 that begins with 1 is 0; inf without one."""
    used = np.trim_zeros(series, "b")
    if used.size < 2:
        return math.inf
    # By 1 / r^2, so that coefficients that are next to nothing are not what it is divided by.
    inverse = np.roots(used)
    real = inverse.real[(np.abs(inverse.imag) < 1e-9 * np.abs(inverse)) & (inverse.real > 0.0)]
    return float(1.0 / math.sqrt(real.max())) if real.size else math.inf


def _bent(x: Any, y: Any, numbers: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Return a formula's place x, y and its Jacobian dx/dx, dx/dy = dy/dx, dy/dy: of numbers or of arrays."""
    p1, p2 = numbers[4], numbers[5]
    s = x * x + y * y
    q = 1.0 + s * (numbers[0] + s * (numbers[1] + s * (numbers[2] + s * numbers[3])))
    slope = numbers[0] + s * (2.0 * numbers[1] + s * (3.0 * numbers[2] + s * 4.0 * numbers[3]))
    if numbers[8] != 0.0:
        q = 1.0 / q
        slope = -slope * q * q
    across = 2.0 * x * y
    return (
        x * q + p1 * (s + 2.0 * x * x) + p2 * across,
        y * q + p2 * (s + 2.0 * y * y) + p1 * across,
        q + 2.0 * x * x * slope + 6.0 * p1 * x + 2.0 * p2 * y,
        across * slope + 2.0 * p1 * y + 2.0 * p2 * x,
        q + 2.0 * y * y * slope + 2.0 * p1 * x + 6.0 * p2 * y,
    )


_bent_at: Final = jit.kernel()(_bent)


def _weights(t: Any, weights: Any) -> None:
    """Fill Catmull and Rom's weights of 4 neighbours for places t from 0 to 1 between the middle ones."""
    weights[0] = t * (-0.5 + t * (1.0 - 0.5 * t))
    weights[1] = 1.0 + t * t * (-2.5 + 1.5 * t)
    weights[2] = t * (0.5 + t * (2.0 - 1.5 * t))
    weights[3] = t * t * (-0.5 + 0.5 * t)


_weights_at: Final = jit.kernel()(_weights)


def _checked(x: FloatArray, y: FloatArray, bend: _Bend) -> tuple[FloatArray, FloatArray]:
    """Return what the formula makes of places, NaN beyond where it holds."""
    with np.errstate(all="ignore"):
        u, v, xx, xy, yy = _bent(x, y, bend.numbers)
        # The Jacobian is symmetric: where it is positive definite nothing is mirrored.
        holds = (np.hypot(x, y) < bend.limit) & (xx * yy > xy * xy) & (xx + yy > 0.0)
    return np.where(holds, u, np.nan), np.where(holds, v, np.nan)


def _inverse(x: FloatArray, y: FloatArray, bend: _Bend) -> tuple[FloatArray, FloatArray]:
    """Return the places of which the formula makes (x, y), NaN where there are none."""
    distance = np.hypot(x, y)
    inside = np.minimum(distance, (1.0 - 1e-6) * bend.reach) if bend.tangential else distance
    radius = _radius_before(inside, bend)
    share = np.divide(radius, distance, out=np.ones_like(radius), where=distance > 0.0)
    u, v = x * share, y * share
    return _newton(x, y, u, v, bend) if bend.tangential else (u, v)


def _radius_before(distance: FloatArray, bend: _Bend) -> FloatArray:
    """Return the radii that the formula takes to given ones, without its tangential terms; NaN for none."""
    numbers = bend.numbers.copy()
    numbers[4:6] = 0.0

    def after(radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        made = _bent(radius, np.zeros_like(radius), numbers)
        return made[0], made[2]

    there = distance < bend.reach
    wanted = distance[there]
    most, top = float(wanted.max(initial=0.0)), bend.limit
    if math.isinf(top):
        top = max(most, 1.0)
        while after(np.array(top))[0] < most:
            top *= 2.0
    nodes = np.linspace(0.0, top, _NODES)
    with np.errstate(all="ignore"):
        begin = after(nodes[1:-1])[0].searchsorted(wanted, side="right")
        low, high = nodes[begin], nodes[begin + 1]
        radius = 0.5 * (low + high)
        for _ in range(_STEPS):
            made, slope = after(radius)
            low, high = np.where(made <= wanted, radius, low), np.where(made > wanted, radius, high)
            step = radius - (made - wanted) / slope
            step = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
            done = float(np.abs(step - radius).max(initial=0.0)) < _CLOSE
            radius = step
            if done:
                break
    result = np.full(distance.shape, np.nan)
    result[there] = radius
    return result


def _newton(
    x: FloatArray, y: FloatArray, u: FloatArray, v: FloatArray, bend: _Bend
) -> tuple[FloatArray, FloatArray]:
    """Return the places of which the formula makes (x, y), from a guess; NaN where it comes to none."""
    numbers = bend.numbers
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            made_x, made_y, xx, xy, yy = _bent(u, v, numbers)
            off_x, off_y, determinant = x - made_x, y - made_y, xx * yy - xy * xy
            step_x = (off_x * yy - off_y * xy) / determinant
            step_y = (off_y * xx - off_x * xy) / determinant
            u, v = u + step_x, v + step_y
            close = np.hypot(step_x, step_y) < _CLOSE
            if close.all():
                break
        holds = close & (determinant > 0.0) & (xx + yy > 0.0) & (np.hypot(u, v) < bend.limit)
    return np.where(holds, u, np.nan), np.where(holds, v, np.nan)


@jit.kernel()
def _radius_before_at(wanted: float, numbers: Any) -> float:
    """Return `_radius_before` of one radius that is less than the formula's reach."""
    low, high = 0.0, numbers[6]
    if not math.isfinite(high):
        high = max(wanted, 1.0)
        while _bent_radius_at(high, numbers)[0] < wanted:
            high *= 2.0
    radius = 0.5 * (low + high)
    for _ in range(_STEPS):
        made, slope = _bent_radius_at(radius, numbers)
        if made <= wanted:
            low = radius
        else:
            high = radius
        step = radius - (made - wanted) / slope
        if not (low <= step <= high):
            step = 0.5 * (low + high)
        done = abs(step - radius) < _CLOSE
        radius = step
        if done:
            break
    return float(radius)


@jit.kernel()
def _bent_radius_at(r: float, numbers: Any) -> tuple[float, float]:
    """Return a formula's radius and its derivative, without tangential terms."""
    made = _bent_at(r, 0.0, numbers)
    return made[0] - 3.0 * numbers[4] * r * r, made[2] - 6.0 * numbers[4] * r


@jit.kernel()
def _newton_at(x: float, y: float, u: float, v: float, steps: int, numbers: Any) -> tuple[bool, float, float]:
    """Return `_newton` of one place, and whether it came to one."""
    for _ in range(steps):
        made_x, made_y, xx, xy, yy = _bent_at(u, v, numbers)
        off_x, off_y, determinant = x - made_x, y - made_y, xx * yy - xy * xy
        share = 1.0 / determinant
        step_x, step_y = (off_x * yy - off_y * xy) * share, (off_y * xx - off_x * xy) * share
        u, v = u + step_x, v + step_y
        if step_x * step_x + step_y * step_y < _CLOSE_ENOUGH * _CLOSE_ENOUGH:
            return determinant > 0.0 and xx + yy > 0.0 and u * u + v * v < numbers[6] ** 2, u, v
    return False, math.nan, math.nan


@jit.kernel()
def _inverse_at(x: float, y: float, u: float, v: float, numbers: Any) -> tuple[float, float]:
    """Return `_inverse` of one place, from a guess that is mostly close."""
    radial = numbers[4] == 0.0 and numbers[5] == 0.0
    distance = math.sqrt(x * x + y * y)
    if radial and distance >= numbers[7]:
        return math.nan, math.nan
    found, near_u, near_v = _newton_at(x, y, u, v, 4, numbers)
    if found:
        return near_u, near_v
    radius = _radius_before_at(min(distance, (1.0 - 1e-6 * (not radial)) * numbers[7]), numbers)
    share = radius / distance if distance > 0.0 else 1.0
    if radial:
        return x * share, y * share
    found, near_u, near_v = _newton_at(x, y, x * share, y * share, _STEPS, numbers)
    return (near_u, near_v) if found else (math.nan, math.nan)


@jit.kernel(parallel=True)
def _find_places(x0: float, y0: float, frame: Any, numbers: Any, scales: Any, places: Any) -> None:
    """Fill (primaries, rows, columns, 2) with what places in the distorted picture show, in pixels."""
    for number in jit.prange(places.shape[0] * places.shape[1]):
        n: Any = np.int64(number) // places.shape[1]
        row: Any = np.int64(number) % places.shape[1]
        y = (frame[1] - y0 - row) / (frame[3] * scales[n])
        # From one pixel to the next it is moved by nearly as much more as from the last to this.
        moved_x, moved_y, more_x, more_y = 0.0, 0.0, 0.0, 0.0
        unit = 1.0 / (frame[2] * scales[n])
        for column in range(places.shape[2]):
            x = (x0 + column - frame[0]) * unit
            if numbers[9] == 0.0:
                u, v = _inverse_at(x, y, x + moved_x + more_x, y + moved_y + more_y, numbers)
            elif x * x + y * y < numbers[6] ** 2:
                made = _bent_at(x, y, numbers)
                u, v = made[0], made[1]
            else:
                u, v = math.nan, math.nan
            if math.isfinite(u):
                more_x, more_y = u - x - moved_x, v - y - moved_y
                moved_x, moved_y = u - x, v - y
            places[n, row, column, 0] = frame[0] + frame[2] * u
            places[n, row, column, 1] = frame[1] - frame[3] * v


@jit.kernel(parallel=True)
def _resample_compiled(source: Any, places: Any, result: Any, order: Any, green: int) -> None:
    """Fill `result` with the source's colours at places in it; what green does not see stays as it is."""
    rows, columns = source.shape[0], source.shape[1]
    for number in jit.prange(result.shape[0]):
        row: Any = np.int64(number)
        across, down = np.empty(4), np.empty(4)
        i, j = np.empty(4, np.int64), np.empty(4, np.int64)
        for column in range(result.shape[1]):
            x, y = places[green, row, column, 0], places[green, row, column, 1]
            if not (-0.5 <= x < columns - 0.5 and -0.5 <= y < rows - 0.5):
                continue
            last = -1
            for k in range(order.shape[0]):
                channel, n = order[k, 0], order[k, 1]
                if n != last:
                    last = n
                    x, y = places[n, row, column, 0], places[n, row, column, 1]
                    if math.isfinite(x):
                        x, y = min(max(x, 0.0), columns - 1.0), min(max(y, 0.0), rows - 1.0)
                        left, above = int(x), int(y)
                        _weights_at(x - left, across)
                        _weights_at(y - above, down)
                        for tap in range(4):
                            i[tap] = min(max(left + tap - 1, 0), columns - 1)
                            j[tap] = min(max(above + tap - 1, 0), rows - 1)
                if not math.isfinite(x):
                    continue
                total = 0.0
                for tap in range(4):
                    line = 0.0
                    for other in range(4):
                        line += across[other] * source[j[tap], i[other], channel]
                    total += down[tap] * line
                a, b = source[j[1], i[1], channel], source[j[1], i[2], channel]
                c, d = source[j[2], i[1], channel], source[j[2], i[2], channel]
                least, most = min(a, b, c, d), max(a, b, c, d)
                result[row, column, channel] = min(max(total, least), most)


def _resample(
    source: Float32Array, places: FloatArray, result: Float32Array, order: npt.NDArray[np.int64], green: int
) -> None:
    """Do what `_resample_compiled` does."""
    rows, columns = source.shape[:2]
    x, y = places[green, ..., 0], places[green, ..., 1]
    with np.errstate(invalid="ignore"):
        there = (x >= -0.5) & (x < columns - 0.5) & (y >= -0.5) & (y < rows - 0.5)
    for n in range(len(places)):
        here = there & np.isfinite(places[n, ..., 0])
        channels = order[order[:, 1] == n, 0]
        if not here.any() or channels.size == 0:
            continue
        x = np.clip(places[n, ..., 0][here], 0.0, columns - 1.0)
        y = np.clip(places[n, ..., 1][here], 0.0, rows - 1.0)
        left, above = x.astype(np.intp), y.astype(np.intp)
        across, down = np.empty((4, x.size)), np.empty((4, y.size))
        _weights(x - left, across)
        _weights(y - above, down)
        i = np.clip(left + np.arange(-1, 3)[:, np.newaxis], 0, columns - 1)
        j = np.clip(above + np.arange(-1, 3)[:, np.newaxis], 0, rows - 1)
        for channel in channels.tolist():
            plane = source[..., channel]
            total = sum(down[b] * sum(across[a] * plane[j[b], i[a]] for a in range(4)) for b in range(4))
            nearest = np.stack([plane[j[b], i[a]] for b in (1, 2) for a in (1, 2)])
            result[here, channel] = np.clip(total, nearest.min(axis=0), nearest.max(axis=0))
