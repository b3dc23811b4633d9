"""What a samples file holds: the papers' hidden-surface samples, one set for each view layer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .aperture import SamplePosition
from .camera import Camera, Film
from .errors import SettingsError
from .lamps import Lamp
from .paths import MotionPaths
from .shutter import ShutterAttributes

Float32Array = npt.NDArray[np.float32]

BRIGHTEST: Final = 1e36
"""Light past which a colour counts as this much, so that sums of some stay in single precision's range."""

BRIGHT: Final = float(1 << 30)
"""Light past which a sample tells nothing of those around it, and rounding in its sums would show there."""

_AT_ONCE: Final = 1 << 18
"""Values that are looked at before the next ones are."""

_POINT_VARIANCE: Final = 0.02
"""Variance in sample pixels squared below which a sample is a point, and mixes no surfaces."""


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of pixels: first column and row, and the ones after the last; y down."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.x1 - self.x0

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.y1 - self.y0

    def intersection(self, other: Window) -> Window:
        """Return the pixels that both windows have; without any, a window of no size."""
        x0, y0 = max(self.x0, other.x0), max(self.y0, other.y0)
        return Window(x0, y0, max(x0, min(self.x1, other.x1)), max(y0, min(self.y1, other.y1)))

    def within(self, outer: Window) -> tuple[slice, slice]:
        """Return the rows and columns of an outer window's pixels that this one is."""
        rows = slice(self.y0 - outer.y0, self.y1 - outer.y0)
        return rows, slice(self.x0 - outer.x0, self.x1 - outer.x0)


@dataclass(frozen=True, slots=True)
class Cryptomatte:
    """Which surfaces each pixel shows and how much of each, after the renderer's own pixel filter.

    Parameters
    ----------
    ids : ndarray of uint32 of shape (ranks, rows, columns)
        Hashes of names, to be compared and nothing else; 0 where a rank is not used. In order of coverage.
    coverage : ndarray of float32 of shape (ranks, rows, columns)
        Share of the pixel, from 0 to 1; 0 where a rank is not used. What is missing to 1 shows no surface.
    """

    ids: npt.NDArray[np.uint32]
    coverage: Float32Array


@dataclass(frozen=True, slots=True)
class SampleLayer:
    """The samples of one view layer, on the pixel grid of the data window.

    Parameters
    ----------
    name : str
        The view layer's name; empty where the file names none.
    color : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied red, green, blue, alpha; scene-linear and finite.
    depth : ndarray of float32 of shape (rows, columns) or None
        Depth z' along the optical axis in metres, greater than 0; ``inf`` where there is no surface.
    object_index : ndarray of int32 of shape (rows, columns) or None
        Pass index of the object seen.
    vector : ndarray of float32 of shape (rows, columns, 4) or None
        Motion in pixels as the file has it (Blender: to the previous frame x, y, to the next x, y).
    stationary : SampleLayer or None
        The same view without its moving objects, so that what they hide is there.
    moving : SampleLayer or None
        The moving objects alone on a transparent film, so that what hides them is not.
    hidden : tuple of SampleLayer
        The same view with more and more of what is nearest left out, so that what it hides is there.
    cryptomatte : Cryptomatte or None
        Coverages of the objects that are seen.
    reflected, transmitted : SampleLayer or None
        The part of the layer's light that polished surfaces reflect, and that comes through glass. Its
        alpha is what share of white light the surface reflects or lets through; depth, index and vector
        are those of what is seen there, where it appears. Of a layer that is part of another one only the
        colours are known.
    patch : ndarray of int32 of shape (rows, columns) or None
        Of light that is reflected or transmitted: patches of mirrors and glass that lie beside each other
        have different numbers, from 1; what one shows does not spread into another.
    astigmatism : ndarray of float32 of shape (rows, columns, 2) or None
        Of light that is reflected or transmitted: see `specular.Seen`.
    absent : SampleLayer or None
        The same view where what moves does not exist, so that its shadow and its light are missing.
    """

    name: str
    color: Float32Array
    depth: Float32Array | None = None
    object_index: npt.NDArray[np.int32] | None = None
    vector: Float32Array | None = None
    stationary: SampleLayer | None = None
    moving: SampleLayer | None = None
    hidden: tuple[SampleLayer, ...] = ()
    cryptomatte: Cryptomatte | None = None
    reflected: SampleLayer | None = None
    transmitted: SampleLayer | None = None
    absent: SampleLayer | None = None
    patch: npt.NDArray[np.int32] | None = None
    astigmatism: Float32Array | None = None

    def mapped(self, change: Callable[[npt.NDArray[Any]], npt.NDArray[Any]]) -> SampleLayer:
        """Return the layer, and all that belongs to it, on another grid.

        Parameters
        ----------
        change : callable
            Takes an array whose first axes are rows and columns to one on the other grid.

        Returns
        -------
        SampleLayer
            With the same name.
        """

        def of_ranks(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return np.ascontiguousarray(np.moveaxis(change(np.moveaxis(values, 0, -1)), -1, 0))

        changed: dict[str, Any] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                changed[item.name] = np.ascontiguousarray(change(value))
            elif isinstance(value, SampleLayer):
                changed[item.name] = value.mapped(change)
            elif isinstance(value, Cryptomatte):
                changed[item.name] = Cryptomatte(of_ranks(value.ids), of_ranks(value.coverage))
            elif item.name == "hidden":
                changed[item.name] = tuple(view.mapped(change) for view in value)
        return replace(self, **changed)


@dataclass(frozen=True, slots=True)
class LensAttributes:
    """What a file says of lens and aperture; ``None`` where it says nothing. Metres and radians."""

    focal_length: float | None = None
    f_stop: float | None = None
    focus_distance: float | None = None
    blades: int | None = None
    blade_rotation: float | None = None
    anamorphic_ratio: float | None = None


@dataclass(frozen=True, slots=True)
class PixelFilter:
    """What the renderer filters with, as far as it matters here.

    Parameters
    ----------
    pixel_variance : float
        Variance along an axis of the filter that makes the picture's pixels, in pixels squared.
    sample_variance : float
        That of the filter that the samples were rendered with, in sample pixels squared.

    Raises
    ------
    SettingsError
        If one is negative or not finite.
    """

    pixel_variance: float
    sample_variance: float

    def __post_init__(self) -> None:
        for value in (self.pixel_variance, self.sample_variance):
            if not (math.isfinite(value) and value >= 0.0):
                raise SettingsError(f"A pixel filter's variance must be 0 or more, not {value:g}.")

    @property
    def makes_points(self) -> bool:
        """Whether each sample shows one point, not a neighbourhood."""
        return self.sample_variance < _POINT_VARIANCE


@dataclass(frozen=True, slots=True)
class Samples:
    """A samples file in memory.

    Parameters
    ----------
    layers : tuple of SampleLayer
        At least one.
    data_window : Window
        Where the samples lie. May be smaller than the display window or reach past it (overscan).
    display_window : Window
        The picture.
    pixel_aspect : float
        Width over height of a pixel.
    position : {"center", "corner"}
        Whether samples lie at pixel centres or corners. Corner samples are one more than the pixels,
        each way.
    supersampling : int
        Samples for each final pixel, each way.
    pixel_filter : PixelFilter or None
        The renderer's filter, with which they are filtered down; without, squares of them are averaged.
    lens : LensAttributes
        Lens and aperture of the camera.
    film : Film or None
        The display window on the film.
    camera : Camera or None
        The pinhole camera that the samples were made with.
    shutter : ShutterAttributes
        The exposure.
    paths : MotionPaths or None
        Where moving objects and the camera are over time.
    lamps : tuple of Lamp
        What casts shadows.
    repaired : dict of str to int
        How many values of each kind were not finite and were replaced from their neighbours.
    attributes : dict
        Header attributes that a result carries on, as the OpenEXR module has them.
    """

    layers: tuple[SampleLayer, ...]
    data_window: Window
    display_window: Window
    pixel_aspect: float = 1.0
    position: SamplePosition = "center"
    supersampling: int = 1
    pixel_filter: PixelFilter | None = None
    lens: LensAttributes = field(default_factory=LensAttributes)
    film: Film | None = None
    camera: Camera | None = None
    shutter: ShutterAttributes = field(default_factory=ShutterAttributes)
    paths: MotionPaths | None = None
    lamps: tuple[Lamp, ...] = ()
    repaired: dict[str, int] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)

    def showing(self, window: Window) -> Samples:
        """Return the same samples for a picture on another window, mirrored at their border to cover it.

        Parameters
        ----------
        window : Window
            The other display window.

        Returns
        -------
        Samples
            Film, camera and paths are those of the other picture; the lens and all distances are the same.
        """
        extra = 1 if self.position == "corner" else 0
        data, display = self.data_window, self.display_window
        before = max(data.y0 - window.y0, 0), max(data.x0 - window.x0, 0)
        after = max(window.y1 + extra - data.y1, 0), max(window.x1 + extra - data.x1, 0)
        layers = self.layers
        if any((*before, *after)):

            def carried_on(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
                widths = [*zip(before, after, strict=True), *[(0, 0)] * (values.ndim - 2)]
                return np.pad(values, widths, mode="symmetric")

            layers = tuple(layer.mapped(carried_on) for layer in layers)
        left, above = window.x0 - display.x0, window.y0 - display.y0
        film, camera, paths = self.film, self.camera, self.paths
        if film is not None:
            film = film.with_pixels(window.columns, window.rows)
        if camera is not None:
            camera = replace(
                camera,
                film=camera.film.with_pixels(window.columns, window.rows),
                axis_x=camera.axis_x - left,
                axis_y=camera.axis_y - above,
            )
        if paths is not None:
            paths = replace(paths, camera=paths.camera.on_other_pixels(1.0, left, above))
        return replace(
            self,
            layers=layers,
            data_window=Window(
                data.x0 - before[1], data.y0 - before[0], data.x1 + after[1], data.y1 + after[0]
            ),
            display_window=window,
            film=film,
            camera=camera,
            paths=paths,
        )

    @property
    def mixes_surfaces(self) -> bool:
        """Whether samples at edges have the colours of both surfaces, as ordinary pixels do."""
        if self.pixel_filter is not None:
            return not self.pixel_filter.makes_points
        return self.supersampling == 1 and self.position == "center"

    @property
    def knows_motion(self) -> bool:
        """Whether paths or a vector pass say what moves."""
        return self.paths is not None or any(layer.vector is not None for layer in self.layers)


def mended(samples: Samples) -> Samples:
    """Return samples whose colours, depths and vectors can all be calculated with.

    What is not finite is replaced from its neighbours and counted in `Samples.repaired`; a depth of infinity
    is none of that. A depth of 0 or less means that there is no surface. Colours past 1e36 become that much.

    Parameters
    ----------
    samples : Samples
        Samples; they stay as they are.

    Returns
    -------
    Samples
        The same object where there is nothing to mend.
    """
    counts = dict(samples.repaired)
    layers = tuple(_mended(layer, counts) for layer in samples.layers)
    if all(new is old for new, old in zip(layers, samples.layers, strict=True)):
        return samples
    return replace(samples, layers=layers, repaired=counts)


def is_within(values: Float32Array, limit: float) -> bool:
    """Return whether no value is farther from 0 than a limit, nor NaN.

    Parameters
    ----------
    values : ndarray of float32
        Of any shape.
    limit : float
        Limit, 0 or more.

    Returns
    -------
    bool
        True where there are no values.
    """
    flat = values.reshape(-1)
    # So few at once that the second look finds them in a cache. NaN is in no range.
    parts = (flat[first : first + _AT_ONCE] for first in range(0, flat.size, _AT_ONCE))
    return all(bool(part.max() <= limit and part.min() >= -limit) for part in parts)


def _mended(layer: SampleLayer, counts: dict[str, int]) -> SampleLayer:
    """Return a layer, with all that belongs to it, that can be calculated with; itself where it can be."""
    changed: dict[str, Any] = {}
    for name in ("color", "vector"):
        values = getattr(layer, name)
        if values is None or is_within(values, BRIGHTEST):
            continue
        values = values.copy()
        count_repaired(counts, name, repair(values, np.asarray(~np.isfinite(values).all(axis=2))))
        changed[name] = np.clip(values, -BRIGHTEST, BRIGHTEST, dtype=np.float32)
    if layer.depth is not None and layer.depth.size > 0 and not layer.depth.min() > 0.0:
        depth = np.where(layer.depth <= 0.0, np.float32(np.inf), layer.depth)
        count_repaired(counts, "depth", repair_depth(depth))
        changed["depth"] = depth
    for item in fields(layer):
        value = getattr(layer, item.name)
        if isinstance(value, SampleLayer):
            view = _mended(value, counts)
            if view is not value:
                changed[item.name] = view
    hidden = tuple(_mended(view, counts) for view in layer.hidden)
    if any(new is not old for new, old in zip(hidden, layer.hidden, strict=True)):
        changed["hidden"] = hidden
    return replace(layer, **changed) if changed else layer


def repair_depth(depth: Float32Array) -> int:
    """Replace depths of NaN from their neighbours, in place, and return how many there were.

    The mean is of inverse depths, so that infinity counts.
    """
    broken = np.isnan(depth)
    if not broken.any():
        return 0
    inverse = np.divide(1.0, depth, dtype=np.float32)
    count = repair(inverse, broken)
    with np.errstate(divide="ignore"):
        depth[broken] = 1.0 / inverse[broken]
    return count


def count_repaired(counts: dict[str, int], what: str, number: int) -> None:
    """Add to the number of values of a kind that were replaced."""
    if number:
        counts[what] = counts.get(what, 0) + number


def repair(values: Float32Array, broken: npt.NDArray[np.bool_]) -> int:
    """Replace broken values by the mean of their sound neighbours, from the rim of a hole inwards.

    Parameters
    ----------
    values : ndarray of float32 of shape (rows, columns) or (rows, columns, channels)
        Changed in place.
    broken : ndarray of bool of shape (rows, columns)
        Which pixels to replace. Where no pixel is sound all become 0.

    Returns
    -------
    int
        Number of pixels replaced.
    """
    count = int(np.count_nonzero(broken))
    if count == 0:
        return 0
    rows, columns = broken.shape
    values[broken] = 0.0
    if count == broken.size:
        return count
    sound = ~broken
    around = np.array([(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1) if (j, i) != (0, 0)])
    # Each pass looks only at what touches the one before: a hole may be most of the picture.
    border = np.zeros((rows + 2, columns + 2), dtype=bool)
    for j, i in around:
        border[1 + j : 1 + j + rows, 1 + i : 1 + i + columns] |= sound
    left = np.argwhere(broken & border[1:-1, 1:-1])
    while left.size:
        near = left[:, np.newaxis] + around
        inside = ((near >= 0) & (near < [rows, columns])).all(axis=2)
        j, i = np.clip(near[..., 0], 0, rows - 1), np.clip(near[..., 1], 0, columns - 1)
        usable = inside & sound[j, i]
        mask = usable.reshape(usable.shape + (1,) * (values.ndim - 2))
        total = np.where(mask, values[j, i].astype(np.float64), 0.0).sum(axis=1)
        number = usable.sum(axis=1).reshape((-1,) + (1,) * (values.ndim - 2))
        values[left[:, 0], left[:, 1]] = total / number
        sound[left[:, 0], left[:, 1]] = True
        following = np.unique((j * columns + i)[inside & ~sound[j, i]])
        left = np.stack(np.divmod(following, columns), axis=1)
    return count
