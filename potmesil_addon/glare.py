"""Glare: what aperture, filters and lens surfaces make of lights, as one convolution of the finished picture.

The light of a point is spread by the same function wherever it is: the Fraunhofer pattern of the aperture,
streaks across the grooves of a star filter, or a picture. Each keeps the light that it gets. A share that
stays where it is is added as it is, so that rounding in the frequency domain is that of what is spread.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage, special

from .aperture import polygon_vertices
from .camera import Film
from .effects import Diffraction, Effects, ImageFilter, Pupil, StarFilter
from .errors import SettingsError
from .images import on_change, read_image
from .lens import FloatArray, Lens
from .psf import PRIMARY_WAVELENGTHS
from .pupil import blade_arc, outline, polygon_area, transmission
from .samples import Float32Array
from .spectrum import primaries_of_wavelengths

_PUPIL_CELLS: Final = (256, 512, 1024, 2048)
"""Cells across an aperture, whose pattern has half as many widths of wavelength times f-stop to a side."""

_PADDINGS: Final = (2, 4, 8, 16)
"""Samples of a pattern for each width of wavelength times f-stop."""

_MOST_SIDE: Final = 4096
"""Samples of a pattern, each way, unless the fewest are more."""

_TRUE: Final = 0.5
"""Share of these up to which cells of the aperture tell the pattern. Farther out its rim does."""

_LEAST_SHARE: Final = 2e-3
"""Share of a primary below which a wavelength is left out."""

_FADE: Final = 0.7
"""Share of the reach from which a function fades out to its end, so that no square is seen."""

_LEAST_KEPT: Final = 0.25
"""Share of an even picture's light below which a border is not brightened further."""

_STEPS_PER_PIXEL: Final = 4
"""Points of a streak for each pixel."""

_SUPERSAMPLED: Final = 3
"""Points, each way, at which a picture is looked up for a pixel."""


class _Grid(NamedTuple):
    """The pixels around a point of light: `down` rows and `across` columns to either side."""

    down: int
    across: int
    pitch_x: float
    pitch_y: float

    @property
    def shape(self) -> tuple[int, int]:
        return 2 * self.down + 1, 2 * self.across + 1

    def faded(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return what a function is multiplied by at places, in pixels, to end without an edge."""
        out = np.hypot(x / (self.across + 1.0), y / (self.down + 1.0))
        return np.asarray(0.5 + 0.5 * np.cos(math.pi * np.clip((out - _FADE) / (1.0 - _FADE), 0.0, 1.0)))

    @property
    def window(self) -> FloatArray:
        """What a function over all pixels is multiplied by."""
        y = np.arange(-self.down, self.down + 1, dtype=np.float64)
        x = np.arange(-self.across, self.across + 1, dtype=np.float64)
        return self.faded(x, y[:, np.newaxis])


def glare(
    picture: Float32Array, film: Film, lens: Lens, effects: Effects
) -> Generator[float, None, Float32Array]:
    """Spread the light of a picture by the aperture's diffraction, a star filter and a picture.

    An even picture stays even to its border: what leaves it is given back by dividing by the share that
    stays, as the focus processor does. Beyond the border nothing is known of lights. A function reaches half
    of the picture's longer side, where it fades out; the little that it has beyond is given to the rest.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear.
    film : Film
        Its pixels on the film.
    lens : Lens
        Focal length, f-stop and iris.
    effects : Effects
        Diffraction, star filter and picture, and the pupil's shape.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        With the same alpha: glare adds light and covers nothing.

    Raises
    ------
    InputError
        If a picture cannot be read.
    SettingsError
        If a picture is black.
    """
    rows, columns = picture.shape[:2]
    diffraction, star, image = effects.diffraction, effects.star, effects.image_filter
    if diffraction is not None and diffraction.strength == 0.0:
        diffraction = None
    star = None if star is not None and star.strength == 0.0 else star
    image = None if image is not None and image.strength == 0.0 else image
    if (diffraction, star, image) == (None,) * 3:
        yield 1.0
        return picture
    pupil = effects.pupil if diffraction is not None else None
    spread = _spread(rows, columns, film.pitch_x, film.pitch_y, lens, pupil, diffraction, star, image)
    yield 0.4
    result = picture.copy()
    lit = bool(picture[..., :3].min() >= 0.0)
    for n in range(3):
        light = fft.irfft2(
            fft.rfft2(picture[..., n], spread.shape, workers=-1) * spread.transfer[n],
            spread.shape,
            workers=-1,
        )[:rows, :columns]
        if lit:
            # Rounding may leave less than nothing.
            np.maximum(light, 0.0, out=light)
        result[..., n] = (spread.stays[n] * picture[..., n] + light) / spread.kept[n]
        yield 0.4 + 0.2 * (n + 1)
    return result


@dataclass(frozen=True, slots=True)
class _Spread:
    """What a picture's transforms are multiplied by.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the transform, as large as picture and function together reach.
    transfer : ndarray of complex64 of shape (3, rows, columns / 2 + 1)
        Of what is spread, for each primary.
    stays : ndarray of float32 of shape (3,)
        Share of the light that stays in its pixel.
    kept : ndarray of float32 of shape (3, picture's rows, picture's columns)
        Share of an even picture's light that does not leave it.
    """

    shape: tuple[int, int]
    transfer: npt.NDArray[np.complex64]
    stays: Float32Array
    kept: Float32Array


@functools.lru_cache(maxsize=1)
def _spread(
    rows: int,
    columns: int,
    pitch_x: float,
    pitch_y: float,
    lens: Lens,
    pupil: Pupil | None,
    diffraction: Diffraction | None,
    star: StarFilter | None,
    image: ImageFilter | None,
) -> _Spread:
    """Return the function of all effects together; the next frame has the same one."""
    reach = max(rows, columns) // 2
    grid = _Grid(min(reach, rows), min(reach, columns), pitch_x, pitch_y)
    shape = fft.next_fast_len(rows + grid.down, True), fft.next_fast_len(columns + grid.across, True)
    parts: list[tuple[FloatArray, float]] = []
    if diffraction is not None:
        parts.append((_diffraction_function(grid, lens, pupil, diffraction), diffraction.strength))
    if star is not None:
        parts.append((_star_function(grid, lens.focal_length, star), star.strength))
    if image is not None:
        parts.append((_image_function(grid, columns, image), image.strength))
    transfer = np.empty((3, shape[0], shape[1] // 2 + 1), dtype=np.complex64)
    stays, kept = np.empty(3, dtype=np.float32), np.empty((3, rows, columns), dtype=np.float32)
    even = fft.rfft2(np.ones((rows, columns), dtype=np.float32), shape, workers=-1)
    for n in range(3):
        all_of_it: Any = None
        still = 1.0
        for function, strength in parts:
            # The middle pixel's light stays where it is.
            middle = float(function[n, grid.down, grid.across])
            stay = 1.0 - strength + strength * middle
            spread = (strength * function[n]).astype(np.float32)
            spread[grid.down, grid.across] = 0.0
            of_part = fft.rfft2(_placed(spread, grid, shape), workers=-1) + np.float32(stay)
            all_of_it = of_part if all_of_it is None else all_of_it * of_part
            still *= stay
        transfer[n] = all_of_it - np.float32(still)
        stays[n] = still
        kept[n] = fft.irfft2(even * transfer[n], shape, workers=-1)[:rows, :columns] + np.float32(still)
        # A coloured picture may have more of one primary than it gets, or none.
        all_light = float(np.float32(still) + transfer[n, 0, 0].real)
        kept[n] /= all_light if all_light > _LEAST_KEPT else 1.0
        np.clip(kept[n], _LEAST_KEPT if all_light > _LEAST_KEPT else 1.0, None, out=kept[n])
    return _Spread(shape, transfer, stays, kept)


def _placed(function: Float32Array, grid: _Grid, shape: tuple[int, int]) -> Float32Array:
    """Return a function on a periodic grid, its middle in the first pixel."""
    placed = np.zeros(shape, dtype=np.float32)
    for rows, to_rows in _halves(grid.down):
        for columns, to_columns in _halves(grid.across):
            placed[to_rows, to_columns] = function[rows, columns]
    return placed


def _halves(reach: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the middle and what is after it, and what is before it, each with where it goes."""
    before = slice(-reach, None) if reach > 0 else slice(0, 0)
    return (slice(reach, None), slice(0, reach + 1)), (slice(0, reach), before)


def _weights(*, spectral: bool) -> tuple[FloatArray, FloatArray]:
    """Return wavelengths, and the share of each primary's light that comes from them."""
    if not spectral:
        return np.array(PRIMARY_WAVELENGTHS), np.eye(3)
    wavelengths, shares = primaries_of_wavelengths()
    counts = np.abs(shares).max(axis=1) > _LEAST_SHARE
    return wavelengths[counts], shares[counts] / shares[counts].sum(axis=0)


def _normalised(function: FloatArray, grid: _Grid) -> FloatArray:
    """Return functions of the primaries that fade out at their end and have all of their light."""
    faded = np.clip(function, 0.0, None) * grid.window
    return np.asarray(faded / faded.sum(axis=(1, 2), keepdims=True))


def _diffraction_function(
    grid: _Grid, lens: Lens, pupil: Pupil | None, diffraction: Diffraction
) -> FloatArray:
    """Return the Fraunhofer pattern of an aperture over the pixels, (3, rows, columns).

    The intensity is the squared modulus of the transform of the aperture's amplitude; a frequency of one
    over its diameter is imaged wavelength times f-stop from the middle.
    """
    f_stop = diffraction.f_stop if diffraction.f_stop > 0.0 else lens.f_stop
    # The squeeze makes the aperture narrower and its pattern wider.
    scale_x, scale_y = f_stop * lens.anamorphic_ratio, f_stop
    wavelengths, shares = _weights(spectral=diffraction.spectral)
    widest = max(
        grid.across * grid.pitch_x / (wavelengths[0] * scale_x),
        grid.down * grid.pitch_y / (wavelengths[0] * scale_y),
    )
    cells = next((size for size in _PUPIL_CELLS if size >= 2.0 * widest), _PUPIL_CELLS[-1])
    # An intensity is known by two samples a unit; to look between them there are as many as pixels or more.
    finest = min(grid.pitch_x / scale_x, grid.pitch_y / scale_y) / wavelengths[0]
    padding = next(
        p for p in _PADDINGS if p * finest >= 2.0 or p == _PADDINGS[-1] or 2 * p * cells > _MOST_SIDE
    )
    iris = Lens(1.0, 1.0, 1.0, lens.blades, lens.blade_rotation)
    pattern = _pattern(iris, pupil, cells, padding)
    # The pattern is the same on both sides of the middle: the lower half tells all.
    half = np.zeros((3, grid.down + 1, grid.shape[1]))
    for wavelength, share in zip(wavelengths, shares, strict=True):
        down = _borders(-0.5, grid.down, grid.pitch_y / (wavelength * scale_y), cells, padding)
        across = _borders(
            -grid.across - 0.5, grid.across, grid.pitch_x / (wavelength * scale_x), cells, padding
        )
        light = _between(_between(pattern, down, 0), across, 1)
        for n in range(3):
            if share[n] != 0.0:
                half[n] += share[n] * light
    function = np.concatenate([half[:, :0:-1, ::-1], half], axis=1)
    scales = scale_x, scale_y, 0.5 * _TRUE * cells
    if pupil is None or replace(pupil, obstruction=0.0, blade_curvature=0.0) == Pupil():
        curvature = 1.0 if lens.is_round else 0.0 if pupil is None else pupil.blade_curvature
        if curvature > 0.0:
            _add_rim(function, grid, iris, curvature, wavelengths, shares, scales)
        else:
            _add_edges(function, grid, iris, wavelengths, shares, scales)
    return _normalised(function, grid)


@functools.lru_cache(maxsize=1)
def _pattern(iris: Lens, pupil: Pupil | None, cells: int, padding: int) -> FloatArray:
    """Return the light of an aperture's pattern up to each border of its samples, from the upper left.

    There are `padding` samples for each wavelength times f-stop.
    """
    amplitude = np.sqrt(transmission(iris, pupil, cells)).astype(np.float32)
    side = padding * cells
    middle = side // 2
    transform = fft.rfft2(amplitude, (side, side), workers=-1)
    right = fft.fftshift(transform.real**2 + transform.imag**2, axes=0)
    # Cells have the mean of what they cover, which takes from high frequencies.
    upright = np.sinc(np.arange(-middle, middle) / side)[:, np.newaxis] ** -2
    level = np.sinc(np.arange(middle + 1) / side) ** -2
    right *= (upright * level).astype(np.float32)
    # A pupil of real transmission has a pattern that is the same on both sides of the middle.
    intensity = np.empty((side + 1, side + 1), dtype=np.float32)
    intensity[:-1, middle:] = right
    intensity[-1, middle:] = right[0]
    intensity[:, :middle] = intensity[::-1, :middle:-1]
    total = np.zeros((side + 2, side + 2))
    np.cumsum(np.cumsum(intensity, axis=0, dtype=np.float64), axis=1, out=total[1:, 1:])
    # All of the light, inside of the reach and beyond it, is the aperture's.
    return np.asarray(total / (float(np.square(amplitude, dtype=np.float64).sum()) * side * side))


def _borders(first: float, reach: int, pitch: float, cells: int, padding: int) -> FloatArray:
    """Return where the borders of pixels lie among those of a pattern's samples."""
    borders = np.arange(first, reach + 1.0) * pitch * padding
    most = 0.5 * _TRUE * cells * padding
    return np.clip(borders, -most, most) + 0.5 * cells * padding + 0.5


def _between(total: Any, borders: FloatArray, axis: int) -> Any:
    """Return what lies between borders, from sums up to each sample's."""
    below = np.minimum(borders.astype(np.int64), total.shape[axis] - 2)
    part = borders - below
    part = part[:, np.newaxis] if axis == 0 else part
    at = np.take(total, below, axis=axis)
    return np.diff(at + part * (np.take(total, below + 1, axis=axis) - at), axis=axis)


def _add_rim(
    function: FloatArray,
    grid: _Grid,
    iris: Lens,
    curvature: float,
    wavelengths: FloatArray,
    shares: FloatArray,
    scales: tuple[float, float, float],
) -> None:
    """Add what a round rim diffracts beyond the reach of its pattern, on the mean over rings.

    Far out Airy's pattern has 1 / (pi u)^3 of the light for each unit of area, in units of wavelength times
    f-stop: half of it from either of the two places whose normals point there. The light of an arc is
    proportional to its radius, and there where it has normals.
    """
    scale_x, scale_y, begin = scales
    x = np.arange(-grid.across, grid.across + 1) * (grid.pitch_x / scale_x)
    y = np.arange(-grid.down, grid.down + 1)[:, np.newaxis] * (grid.pitch_y / scale_y)
    # A pixel has the light of those wavelengths whose pattern ends before it, all of them in proportion.
    ended = np.searchsorted(begin * wavelengths, np.maximum(np.abs(x), np.abs(y)))
    radius = np.hypot(x, y)
    area = grid.pitch_x / scale_x * grid.pitch_y / scale_y
    light = np.divide(area, (math.pi * radius) ** 3, out=np.zeros_like(radius), where=ended > 0)
    if curvature < 1.0:
        bend, arc = blade_arc(iris.blades, curvature)
        rim = outline(iris, Pupil(blade_curvature=curvature))
        # Rows count downwards. Normals repeat with the blades; those of the other side are seen from behind.
        turned, step = np.arctan2(-y, x) - iris.blade_rotation, 2.0 * math.pi / iris.blades
        places = sum(
            np.abs((turned + side + 0.5 * step) % step - 0.5 * step) < arc for side in (0.0, math.pi)
        )
        light *= places * (0.5 * bend * math.pi / polygon_area(rim))
    for n in range(3):
        function[n] += np.append(0.0, np.cumsum(wavelengths * shares[:, n]))[ended] * light


def _add_edges(
    function: FloatArray,
    grid: _Grid,
    iris: Lens,
    wavelengths: FloatArray,
    shares: FloatArray,
    scales: tuple[float, float, float],
) -> None:
    """Add what each straight edge of an aperture diffracts beyond the reach of its pattern.

    An edge of the length l of a pupil of the area A, both in radii, has l / (2 pi^2 A) (1 / u - 1 / u') of
    the light between u and u' to either side of itself, in units of wavelength times f-stop: the transform
    of the edge alone, whose fringes with others are finer than a pixel there.
    """
    scale_x, scale_y, begin = scales
    corners = polygon_vertices(iris.blades, iris.blade_rotation, 1.0)
    edges = np.roll(corners, -1, axis=0) - corners
    area = polygon_area(corners)
    step = min(grid.pitch_x / scale_x, grid.pitch_y / scale_y) / _STEPS_PER_PIXEL
    farthest = math.hypot(grid.across * grid.pitch_x / scale_x, grid.down * grid.pitch_y / scale_y)
    # Distances over the f-stop.
    borders = np.arange(1, math.ceil(farthest / step) + 2) * step
    places = borders[:-1] + 0.5 * step
    for along in edges:
        length = math.hypot(*along)
        normal = np.array([along[1], -along[0]]) / length
        # The pattern is known in a square.
        first = begin / np.abs(normal).max()
        light = np.zeros((places.size, 3))
        for wavelength, share in zip(wavelengths, shares, strict=True):
            beyond = -1.0 / np.maximum(borders / wavelength, first)
            light += np.diff(beyond)[:, np.newaxis] * share
        light *= length / (2.0 * math.pi**2 * area)
        for sign in (1.0, -1.0):
            x = sign * places * normal[0] * scale_x / grid.pitch_x + grid.across
            y = -sign * places * normal[1] * scale_y / grid.pitch_y + grid.down
            _add_points(function, x, y, light)


def _star_function(grid: _Grid, focal_length: float, star: StarFilter) -> FloatArray:
    """Return streaks across grooves over the pixels, (3, rows, columns).

    Each set of parallel grooves of the width w is a slit: it spreads light across itself by
    sinc^2(w x / (wavelength F)), over the pixels at x on the film.
    """
    wavelengths, shares = _weights(spectral=True)
    step = min(grid.pitch_x, grid.pitch_y) / _STEPS_PER_PIXEL
    reach = math.ceil(math.hypot(grid.across * grid.pitch_x, grid.down * grid.pitch_y) / step)
    borders: FloatArray = np.asarray((np.arange(-reach, reach + 2) - 0.5) * step)
    along = np.zeros((borders.size - 1, 3))
    for wavelength, share in zip(wavelengths, shares, strict=True):
        turns = borders * star.groove_width / (wavelength * focal_length)
        along += np.diff(_sinc_square_integral(turns))[:, np.newaxis] * share
    along = np.clip(along, 0.0, None)
    place = np.arange(-reach, reach + 1) * step
    function = np.zeros((3, *grid.shape))
    for line in range(star.lines):
        angle = star.rotation + math.pi * line / star.lines
        x = np.asarray(place * math.cos(angle) / grid.pitch_x)
        y = np.asarray(-place * math.sin(angle) / grid.pitch_y)
        light = along * grid.faded(x, y)[:, np.newaxis]
        _add_points(function, x + grid.across, y + grid.down, light / (light.sum(axis=0) * star.lines))
    return function


def _sinc_square_integral(x: FloatArray) -> FloatArray:
    """Return the integral of sinc^2 from 0 to x: Si(2 pi x) / pi - sin^2(pi x) / (pi^2 x)."""
    safe = np.where(x == 0.0, 1.0, x)
    part = np.where(x == 0.0, 0.0, np.sin(math.pi * x) ** 2 / (math.pi**2 * safe))
    return np.asarray(special.sici(2.0 * math.pi * x)[0] / math.pi - part)


def _add_points(function: FloatArray, x: FloatArray, y: FloatArray, light: FloatArray) -> None:
    """Add points of light to the four pixels around each."""
    rows, columns = function.shape[1:]
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    for j, i in np.ndindex(2, 2):
        row, column = top + j, left + i
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        share = (1.0 - np.abs(x - column)) * (1.0 - np.abs(y - row))
        place = (row * columns + column)[inside]
        for n in range(3):
            np.add.at(function[n].reshape(-1), place, (share * light[:, n])[inside])


def _image_function(grid: _Grid, columns: int, image: ImageFilter) -> FloatArray:
    """Return a picture over the pixels, its middle on the point of light, (3, rows, columns).

    Its colours are kept: all three primaries together have as much light as they get.
    """
    picture = read_image(Path(image.image)).astype(np.float64)
    # Pixels of the picture for each of the frame's, along both of its own axes.
    per_pixel = picture.shape[1] / (image.size * columns)
    fine = (np.arange(_SUPERSAMPLED) + 0.5) / _SUPERSAMPLED - 0.5
    cosine, sine = math.cos(image.rotation), math.sin(image.rotation)
    y, x = np.mgrid[-grid.down : grid.down + 1, -grid.across : grid.across + 1].astype(np.float64)
    softened = picture
    if per_pixel > _SUPERSAMPLED:
        # What lies between the points would be missed.
        sigma = 0.5 * per_pixel / _SUPERSAMPLED
        softened = ndimage.gaussian_filter(picture, (sigma, sigma, 0.0))
    function = np.zeros((3, *grid.shape))
    aspect = grid.pitch_y / grid.pitch_x
    for dy in fine:
        for dx in fine:
            right, up = x + dx, -(y + dy) * aspect
            column = (cosine * right + sine * up) * per_pixel + 0.5 * picture.shape[1] - 0.5
            row = (sine * right - cosine * up) * per_pixel + 0.5 * picture.shape[0] - 0.5
            for n in range(3):
                function[n] += ndimage.map_coordinates(softened[..., n], [row, column], order=1)
    function = np.clip(function, 0.0, None) * grid.window
    total = function.sum(axis=(1, 2)).mean()
    if not total > 0.0:
        raise SettingsError(f"'{image.image}' is black; choose a picture with light in it.")
    return np.asarray(function / total)


on_change(_spread.cache_clear)
on_change(_pattern.cache_clear)
