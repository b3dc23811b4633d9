"""Cascaded point-spread functions of lens, motion and shutter as pictures (1983, figure 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from potmesil_addon.aperture import ellipse_rows
from potmesil_addon.camera import Film
from potmesil_addon.lens import FloatArray, Lens
from potmesil_addon.motion_psf import (
    ConvolutionMethod,
    ExposedPath,
    MotionPsf,
    convolve_full,
    focal_plane_response,
    motion_psf,
    path_of,
)
from potmesil_addon.psf import PsfBuilder, PsfSettings
from potmesil_addon.shutter import Openings, Shutter, even_openings

from .sheet import STYLE, markdown_table, write_plot
from .workshop import Drawing, Figure, Workshop

DISC: Final = 21.0
"""Diameter of the lens' circle of confusion in pixels."""

EVEN: Final = 45.0
"""Displacement of the even motion in pixels during the exposure T: 0.4 T are whole pixels."""

OPENINGS: Final = even_openings(5, 0.2, 0.4)
"""Five exposures of 0.2 T at 0.4 T, as in 1983, figure 7d."""

_DPI: Final = 150
_SMALL_DISC: Final = 9.0
"""Diameter in pixels of a circle that leaves five exposures apart."""

_REACH: Final = (36, 56)
"""Pixels from the middle of a picture to its border, down and across."""

_TONE: Final = 0.6
_INSTANTS: Final = 200
_PLACES: Final = 121

_LOMMEL_PITCH: Final = 5e-6
_LOMMEL_DEFOCUS: Final = 6.0 * math.pi
_SLIT: Final = 1.0 / 9.0
"""Frequency in cycles per pixel at which the focal-plane shutter's slit transfers nothing more."""

_BLADES: Final = 0.4
"""Share of the exposure that the between-the-lens shutter's blades take to open, and again to close."""


@dataclass(frozen=True, slots=True)
class Psf:
    """A point-spread function on pixels, with the point it belongs to.

    Parameters
    ----------
    name : str
        What it is of.
    values : ndarray of float64 of shape (rows, columns)
        Share of the light on each pixel.
    first_row, first_column : int
        Where the first pixel lies from the point's own; rows count down.
    """

    name: str
    values: FloatArray
    first_row: int
    first_column: int

    @property
    def mean(self) -> FloatArray:
        """Mean displacement (x, y) in pixels."""
        return np.array([weight @ place / self.values.sum() for weight, place in self._marginals()])

    @property
    def covariance(self) -> FloatArray:
        """Second moments about the mean in square pixels: [[xx, xy], [xy, yy]]."""
        (columns, x), (rows, y) = self._marginals()
        total = self.values.sum()
        x, y = x - columns @ x / total, y - rows @ y / total
        mixed = y @ self.values @ x
        return np.array([[columns @ x**2, mixed], [mixed, rows @ y**2]]) / total

    def _marginals(self) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        """Return the light of columns with their places, and the same of rows."""
        rows, columns = (np.arange(size, dtype=np.float64) for size in self.values.shape)
        return (
            (self.values.sum(axis=0), columns + self.first_column),
            (self.values.sum(axis=1), rows + self.first_row),
        )


@dataclass(frozen=True, slots=True)
class Cascade:
    """Point-spread functions and the one that they make together.

    Parameters
    ----------
    factors : tuple of Psf
        In the order in which they are drawn; any order makes the same.
    result : Psf
        Their convolution.
    """

    factors: tuple[Psf, ...]
    result: Psf


def cascaded(name: str, factors: Sequence[Psf], method: ConvolutionMethod = "spatial") -> Cascade:
    """Convolve point-spread functions (1983, eq. 2-10) or multiply their transforms (eq. 2-11).

    Parameters
    ----------
    name : str
        What the result is.
    factors : sequence of Psf
        At least one.
    method : {"spatial", "frequency", "auto", "separable"}
        How it is done; see `convolve_full`.

    Returns
    -------
    Cascade
        The result is as large as all of its factors together.
    """
    result = factors[0]
    for factor in factors[1:]:
        table = MotionPsf(factor.values, factor.first_row, factor.first_column)
        blurred, row, column = convolve_full(result.values[..., np.newaxis], table, method)
        values = blurred[..., 0].astype(np.float64)
        result = Psf(name, values, result.first_row + row, result.first_column + column)
    return Cascade(tuple(factors), result)


def lens_disc(diameter: float = DISC) -> Psf:
    """Return the evenly lit circle of confusion (TOG 1982, eq. 23)."""
    return _centred("lens: circle of confusion", ellipse_rows(0.5 * diameter, 0.5 * diameter).dense()[0])


def lens_diffraction() -> Psf:
    """Return Lommel's pattern of a lens at f/16 in green light, u = 6π out of focus (TOG 1982, figure 7g)."""
    film = Film(width=64 * _LOMMEL_PITCH, height=64 * _LOMMEL_PITCH, columns=64, rows=64)
    settings = PsfSettings("lommel")
    builder = PsfBuilder(Lens(0.05, 16.0, math.inf), film, "cycles", settings)
    green = 1
    # u is v at the circle's rim: k / (4 n) of its diameter.
    circle = _LOMMEL_DEFOCUS * 4.0 * 16.0 * settings.wavelengths[green] / (2.0 * math.pi)
    table = next(builder.tables(np.array([circle])))
    return _centred("lens: diffraction, u = 6π", table.dense()[green])


def even_motion(
    displacement: float = EVEN, openings: Openings = (), name: str = "motion: even, during T"
) -> Psf:
    """Return the trace of an image that moves evenly to the right (1983, eq. 3-15).

    Parameters
    ----------
    displacement : float
        Pixels in the time T.
    openings : tuple of (float, float)
        When the shutter is open, in units of T; empty for all of T.
    name : str
        What it is of.

    Returns
    -------
    Psf
        The middle of the shutter's interval in its origin.
    """
    shutter = Shutter(frames=1.0, openings=openings)
    half = 0.5 * displacement * shutter.length
    return _traced(name, path_of(shutter, [0.0, 1.0], [[-half, 0.0], [half, 0.0]]))


def curved_motion(blade_time: float = 0.0) -> Psf:
    """Return the trace of an image that speeds up along an arc: bright where it is slow (1983, eq. 3-9).

    Parameters
    ----------
    blade_time : float
        Share of the exposure that the shutter's blades take to open, and again to close.

    Returns
    -------
    Psf
        Dark towards the ends where the blades take their time.
    """
    t = np.linspace(0.0, 1.0, _PLACES)
    angle = math.radians(200.0) - math.radians(230.0) * (0.3 * t + 0.7 * t**2)
    places = 22.0 * np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    return _traced("motion: an arc, ever faster", path_of(Shutter(1.0, blade_time=blade_time), t, places))


def exposures() -> Psf:
    """Return where an even motion is when the shutter opens, once for each of the five exposures."""
    # Instants: what moves while the shutter is open is a factor of its own.
    begins = np.array([begin for begin, _ in OPENINGS])
    x = EVEN * (begins - begins.mean())
    places = np.stack([x, np.zeros_like(x)], axis=1)
    light = np.full(begins.size, 1.0 / begins.size)
    return _traced("shutter: five exposures", ExposedPath(np.stack([places, places], axis=1), light))


def slit() -> Psf:
    """Return the diffraction of a focal-plane shutter's slit, across it (1983, eq. 3-16)."""
    reach = _REACH[1]
    values = focal_plane_response(np.arange(-reach, reach + 1), _SLIT)[np.newaxis]
    return Psf("shutter: focal-plane slit", values / values.sum(), 0, -reach)


def opening_lens(diameter: float = DISC) -> Psf:
    """Return the circle of confusion of a lens whose shutter's blades open and close (1983, section 3.2).

    Parameters
    ----------
    diameter : float
        Of the circle at full aperture, in pixels.

    Returns
    -------
    Psf
        Circles of all radii that the aperture has, each with its light.
    """
    shutter = Shutter(frames=1.0, blade_time=_BLADES)
    # Equal shares of light, so every circle counts alike.
    times = shutter.times((np.arange(_INSTANTS) + 0.5) / _INSTANTS)
    full = lens_disc(diameter)
    total = np.zeros_like(full.values)
    for radius in 0.5 * diameter * shutter.opening(times):
        circle = ellipse_rows(radius, radius).dense()[0]
        top, left = ((a - b) // 2 for a, b in zip(total.shape, circle.shape, strict=True))
        total[top : top + circle.shape[0], left : left + circle.shape[1]] += circle / _INSTANTS
    return _centred("lens: blades open and close", total)


def cascades() -> list[Cascade]:
    """Return the rows of the figure."""
    dash = even_motion(0.2 * EVEN, name="motion: even, during 0.2 T")
    return [
        cascaded("a stadium", [lens_disc(), even_motion()]),
        cascaded("five stadiums", [lens_disc(_SMALL_DISC), dash, exposures()]),
        cascaded("all three", [lens_diffraction(), curved_motion(), slit()]),
        cascaded("a soft stroke", [opening_lens(), curved_motion(_BLADES)]),
    ]


def draw_cascades(workshop: Workshop) -> Drawing:
    """Draw every cascade as its factors with * between them, and what they make after =."""
    every = cascades()
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        plot, grid = plt.subplots(len(every), 4, figsize=(11.0, 8.0))
        for row, cascade in zip(grid, every, strict=True):
            _draw_row(row, cascade)
        plot.subplots_adjust(wspace=0.16, hspace=0.12)
        path = write_plot(workshop.path("motion_5"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    head = ["cascade", "sum", "σ across, factors (pixels)", "σ across, cascade", "σ down, cascade"]
    rows = [_row(cascade) for cascade in every]
    return Drawing(path, {"rows": rows}, markdown_table(head, rows))


def _centred(name: str, values: FloatArray) -> Psf:
    """Return a PSF of odd size around the point it belongs to."""
    rows, columns = values.shape
    return Psf(name, values, -(rows // 2), -(columns // 2))


def _traced(name: str, path: ExposedPath) -> Psf:
    """Return the PSF of a path, its light integrated over pixels."""
    psf = motion_psf(path)
    return Psf(name, psf.table, psf.first_row, psf.first_column)


def _row(cascade: Cascade) -> list[str | float]:
    factors = " * ".join(factor.name for factor in cascade.factors)
    across = ", ".join(f"{math.sqrt(factor.covariance[0, 0]):.2f}" for factor in cascade.factors)
    sigma = np.sqrt(np.diag(cascade.result.covariance))
    total = round(float(cascade.result.values.sum()), 6)
    return [factors, total, across, *(round(float(s), 2) for s in sigma)]


def _draw_row(row: Sequence[Axes], cascade: Cascade) -> None:
    """Draw the factors and the result, as far to the right as they go."""
    pictures = (*cascade.factors, cascade.result)
    for axes in row:
        axes.axis("off")
    for number, (axes, psf) in enumerate(zip(row[-len(pictures) :], pictures, strict=True)):
        _draw_psf(axes, psf)
        sign = "" if number == 0 else "=" if psf is cascade.result else "∗"
        axes.text(-0.08, 0.5, sign, transform=axes.transAxes, ha="center", va="center", fontsize=16)


def _draw_psf(axes: Axes, psf: Psf) -> None:
    """Draw a PSF around its point, its largest value white."""
    axes.imshow(_framed(psf) ** _TONE, cmap="gray", vmin=0.0, interpolation="nearest")
    axes.set_title(psf.name, y=-0.16)


def _framed(psf: Psf) -> npt.NDArray[np.float64]:
    """Return a PSF's values in a frame of the figure's size, the table's middle in its own."""
    down, across = _REACH
    frame = np.zeros((2 * down + 1, 2 * across + 1))
    rows = down - psf.values.shape[0] // 2 + np.arange(psf.values.shape[0])
    columns = across - psf.values.shape[1] // 2 + np.arange(psf.values.shape[1])
    inside = np.ix_((rows >= 0) & (rows < frame.shape[0]), (columns >= 0) & (columns < frame.shape[1]))
    kept = psf.values[inside]
    frame[np.ix_(rows[inside[0].ravel()], columns[inside[1].ravel()])] = np.maximum(kept, 0.0)
    return frame


FIGURES = (Figure("motion_5", "1983, figure 5: cascaded point-spread functions", draw_cascades),)
