"""What a lens does to samples, for the eye: circles of confusion, near, sharp and far, the PSF of a place.

Everything comes from the functions that the processors themselves use. Those are imported where they are
first needed: this module is light enough for Blender to load when it starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
import numpy.typing as npt

from .lens import DepthOfField, FloatArray, circle_of_confusion, depth_of_field
from .png import srgb
from .samples import Float32Array, Samples

if TYPE_CHECKING:
    from .focus import FocusSettings
    from .process import ProcessSettings

Zone = Literal["near", "sharp", "far"]
"""Whether something lies before, within or behind the depth of field."""

ZONES: Final[tuple[Zone, ...]] = ("near", "sharp", "far")

COLORS: Final = ((1.0, 0.45, 0.1), (0.2, 0.9, 0.4), (0.2, 0.5, 1.0))
"""Red, green and blue of the zones as a display has them, in the order of `ZONES`."""

MOST_PSF: Final = 192
"""Diameter in samples past which a point-spread function is drawn on a coarser grid."""


@dataclass(frozen=True, slots=True)
class View:
    """What a samples file shows through its pinhole.

    Parameters
    ----------
    samples : Samples
        The file's camera, lens and film; its layers have colour and depth alone.
    depth : ndarray of float32 of shape (rows, columns)
        Depth in metres of what each sample of the picture shows; ``inf`` where there is no surface.
    picture : ndarray of float32 of shape (rows, columns, 4)
        The picture without a lens and without motion blur, premultiplied and scene-linear. Its rows and
        columns are those of the finished picture, of which a pixel may have several samples.
    """

    samples: Samples
    depth: Float32Array
    picture: Float32Array


@dataclass(frozen=True, slots=True)
class Reading:
    """What a lens does to a point.

    Parameters
    ----------
    depth : float
        Its distance along the optical axis in metres; ``inf`` where there is no surface.
    circle : float
        Signed diameter of its circle of confusion on the film in metres, negative nearer than the plane in
        focus.
    circle_px : float
        The same in pixels of the finished picture.
    zone : {"near", "sharp", "far"}
        Where it lies.
    """

    depth: float
    circle: float
    circle_px: float
    zone: Zone


def read_view(path: Path) -> View:
    """Read from a samples file what its pinhole shows, and nothing else of it.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    View
        Depth and picture.

    Raises
    ------
    InputError
        If the file cannot be read or holds no colour.
    """
    from . import exr  # noqa: PLC0415 - imports OpenEXR

    raw = exr.read_raw(path)
    layers = {channel.parsed.layer for channel in raw.channels}
    others = {
        f"{name}{suffix}"
        for name in layers
        for suffix in (exr.STATIONARY, exr.MOVING, *map(exr.behind, range(1, len(layers))))
    }
    channels = tuple(
        channel
        for channel in raw.channels
        if channel.parsed.layer not in others and channel.parsed.name in ("combined", "depth")
    )
    return view_of(exr.samples_of(replace(raw, channels=channels), path))


def view_of(samples: Samples) -> View:
    """Return what samples show through a pinhole.

    Parameters
    ----------
    samples : Samples
        A samples file.

    Returns
    -------
    View
        Depth and picture.
    """
    from .preview import depth_map  # noqa: PLC0415 - imports numba
    from .process import ProcessSettings, process  # noqa: PLC0415
    from .progress import run  # noqa: PLC0415

    pinhole = ProcessSettings(use_lens=False, use_motion=False, visibility="aperture", backend="numpy")
    return View(samples, depth_map(samples), run(process(samples, pinhole)).picture)


def view_settings(view: View, settings: ProcessSettings) -> FocusSettings:
    """Return what the focus processor works with on a view's samples.

    Parameters
    ----------
    view : View
        The samples.
    settings : ProcessSettings
        What to do with them.

    Returns
    -------
    FocusSettings
        Lens, film and models.

    Raises
    ------
    SettingsError
        If something that the lens needs is known to neither.
    """
    from .process import focus_settings  # noqa: PLC0415 - imports numba

    return focus_settings(view.samples, settings)


def zones(depth: npt.NDArray[np.floating], limits: DepthOfField) -> npt.NDArray[np.uint8]:
    """Return where things lie: before, within or behind the depth of field (TOG 1982, eqs. 6 and 7).

    Parameters
    ----------
    depth : ndarray of float
        Depths in metres, any shape; ``inf`` is valid.
    limits : DepthOfField
        The limits that the panel shows.

    Returns
    -------
    ndarray of uint8
        Indices into `ZONES`, same shape. What lies on a limit is sharp.
    """
    return np.asarray((depth >= limits.near).view(np.uint8) + (depth > limits.far).view(np.uint8))


def overlay(
    depth: npt.NDArray[np.floating], limits: DepthOfField, opacity: float = 1.0, step: int = 1
) -> Float32Array:
    """Return the zones as colours.

    Parameters
    ----------
    depth : ndarray of float of shape (rows, columns)
        Depths in metres.
    limits : DepthOfField
        The limits of what is sharp.
    opacity : float
        Alpha of all pixels.
    step : int
        Every which row and column is taken, from the first on.

    Returns
    -------
    ndarray of float32 of shape (rows / step, columns / step, 4)
        Display values with straight alpha; sizes are rounded up.
    """
    palette = np.array([(*color, opacity) for color in COLORS], dtype=np.float32)
    return np.asarray(np.take(palette, zones(depth[::step, ::step], limits), axis=0))


def circles_in_pixels(depth: npt.ArrayLike, settings: FocusSettings, supersampling: int = 1) -> FloatArray:
    """Return signed diameters of circles of confusion in pixels of the finished picture.

    Parameters
    ----------
    depth : array_like
        Depths in metres, any shape; ``inf`` is valid.
    settings : FocusSettings
        Lens and film.
    supersampling : int
        Samples for each pixel, each way.

    Returns
    -------
    ndarray of float64
        Diameters along a row, same shape; negative nearer than the plane in focus.
    """
    circles = circle_of_confusion(depth, settings.lens, settings.model)
    return np.asarray(circles / (settings.film.pitch_x * supersampling))


def reading(view: View, settings: FocusSettings, u: float, v: float) -> Reading | None:
    """Return what a lens does to what a place of the picture shows.

    Parameters
    ----------
    view : View
        The samples.
    settings : FocusSettings
        Lens and film.
    u, v : float
        The place, from 0 to 1 to the right and upwards.

    Returns
    -------
    Reading or None
        ``None`` outside the picture.
    """
    if not (0.0 <= u < 1.0 and 0.0 < v <= 1.0):
        return None
    rows, columns = view.depth.shape
    depth = float(view.depth[min(rows - 1, int((1.0 - v) * rows)), min(columns - 1, int(u * columns))])
    circle = float(circle_of_confusion(depth, settings.lens, settings.model))
    pixels = float(circles_in_pixels(depth, settings, view.samples.supersampling))
    zone = ZONES[int(zones(np.asarray([depth]), depth_of_field(settings.lens))[0])]
    return Reading(depth, circle, pixels, zone)


def point_spread(depth: float, view: View, settings: FocusSettings) -> tuple[FloatArray, float]:
    """Return what becomes of a point, from the tables that the focus processor has for it.

    Parameters
    ----------
    depth : float
        The point's depth in metres; ``inf`` is valid.
    view : View
        Where samples lie, and how many a pixel has.
    settings : FocusSettings
        Lens, film and kind of point-spread function.

    Returns
    -------
    values : ndarray of float64 of shape (size, size, primaries)
        Shares of the point's light, which is in the middle; row 0 on top. Each primary's sum is 1; there is
        one where all have the same.
    pixel : float
        Size of a value in pixels of the finished picture: 1 over the supersampling, or more where the
        circle is so large that it is drawn on a coarser grid.

    Raises
    ------
    SettingsError
        If diffraction is asked of an aperture that is not round.
    """
    from .psf import PsfBuilder, circles_for_filtered_samples  # noqa: PLC0415 - imports scipy

    film, samples = settings.film, view.samples
    across = abs(float(circles_in_pixels(depth, settings)))
    coarser = max(1, math.ceil(across / MOST_PSF))
    if coarser > 1:
        columns, rows = max(1, film.columns // coarser), max(1, film.rows // coarser)
        film = replace(
            film,
            width=film.pitch_x * coarser * columns,
            height=film.pitch_y * coarser * rows,
            columns=columns,
            rows=rows,
        )
    builder = PsfBuilder(settings.lens, film, settings.model, settings.psf, samples.position)
    circles = builder.assign(np.array([depth], dtype=np.float64)).circles[:1]
    if settings.visibility == "aperture" and settings.psf.kind == "disc" and samples.position == "center":
        circles = circles_for_filtered_samples(circles, film.pitch_x)
    table = next(builder.tables(circles))
    values = np.moveaxis(table.dense(), 0, -1)
    rows, columns = values.shape[:2]
    # The point is on a pixel's middle, or on the corner of the middle four.
    odd = 1 if samples.position == "center" else 0
    reach = max(-table.first_row, table.first_row + rows - odd, (columns - odd) // 2)
    square = np.zeros((2 * reach + odd, 2 * reach + odd, values.shape[2]))
    top, left = reach + table.first_row, reach - (columns - odd) // 2
    square[top : top + rows, left : left + columns] = values
    return square, coarser / samples.supersampling


def psf_picture(values: FloatArray) -> Float32Array:
    """Return a point-spread function as a picture for a display, its brightest value white.

    Parameters
    ----------
    values : ndarray of float64 of shape (rows, columns, primaries)
        From `point_spread`.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        Opaque display values through the sRGB curve.
    """
    picture = np.ones((*values.shape[:2], 4), dtype=np.float32)
    picture[..., :3] = srgb(values / values.max())
    return picture
