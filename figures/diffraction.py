"""The diffraction pattern out of focus as surfaces (TOG 1982, figure 7)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from potmesil_addon.diffraction import axial_intensity, lommel_intensity
from potmesil_addon.lens import FloatArray

from .sheet import STYLE, markdown_table, write_plot
from .workshop import Drawing, Figure, Workshop

DEFOCUS: Final = tuple(math.pi * m for m in range(7))
"""u of figures 7a to 7g."""

REACH: Final = 6.0 * math.pi
"""Largest v of the figures."""

_DPI: Final = 150
_SLICES: Final = 73
_POINTS: Final = 241
_TILT: Final = math.radians(32.0)
"""Height of the eye over the image plane; the view is parallel."""

_HEIGHT: Final = 0.9 * 2.0 * REACH
"""Height of I = 1 in the pictures, in units of v."""

_TONE: Final = 1.0 / 3.0
"""Exponent that makes the faint rings visible in the colours."""

_INK: Final = "#222222"
_NODES: Final = 24


@dataclass(frozen=True, slots=True)
class Surface:
    """I(u, v) over the image plane, for one u.

    Parameters
    ----------
    u : float
        Defocus.
    v : ndarray of float64 of shape (rings,)
        Distances from the axis.
    intensity : ndarray of float64 of shape (rings,)
        Relative to I(0, 0).
    on_axis : float
        I(u, 0) in closed form (eq. 20).
    """

    u: float
    v: FloatArray
    intensity: FloatArray
    on_axis: float

    @property
    def peak(self) -> tuple[float, float]:
        """The v of the largest intensity, and that intensity."""
        at = int(np.argmax(self.intensity))
        return float(self.v[at]), float(self.intensity[at])

    def slices(self, count: int, points: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cut the surface at equal steps of y.

        Parameters
        ----------
        count, points : int
            Slices, and places on each.

        Returns
        -------
        x, y, intensity : ndarray of float64 of shape (count, points)
            From the farthest slice to the nearest; v = sqrt(x^2 + y^2) reaches as far as `v` does.
        """
        reach = float(self.v[-1])
        # None through the very rim, where a slice is a point.
        y = reach * (1.0 - (2.0 * np.arange(count) + 1.0) / count)
        x = np.multiply.outer(np.sqrt(reach**2 - y**2), np.linspace(-1.0, 1.0, points))
        y = np.broadcast_to(y[:, np.newaxis], x.shape)
        return x, y, lommel_intensity(self.u, np.hypot(x, y))


def surfaces(rings: int, reach: float = REACH) -> list[Surface]:
    """Return the papers' seven surfaces, u = 0, π, .. 6π (TOG 1982, eq. 14).

    Parameters
    ----------
    rings : int
        Values of v, from 0 on.
    reach : float
        The last of them.

    Returns
    -------
    list of Surface
        In order of u.
    """
    v = np.linspace(0.0, reach, rings)
    return [Surface(u, v, lommel_intensity(u, v), float(axial_intensity(u))) for u in DEFOCUS]


def light_within(u: float, v: float) -> float:
    """Return the share of a pattern's light that falls within a circle.

    Parameters
    ----------
    u : float
        Defocus.
    v : float
        Radius of the circle.

    Returns
    -------
    float
        The integral of I(u, v) v over v, by Gauss-Legendre, times 1/2: from 0 to 1.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    width = v / math.ceil(v / math.pi)
    begins = np.arange(round(v / width)) * width
    places = begins[:, np.newaxis] + 0.5 * width * (nodes + 1.0)
    return float(0.5 * ((lommel_intensity(u, places) * places) @ (0.5 * width * weights)).sum())


def draw_surfaces(workshop: Workshop) -> Drawing:
    """Draw the seven surfaces at one height scale, and the scale."""
    fine = surfaces(6001)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        plot, every = plt.subplots(2, 4, figsize=(13.0, 7.6))
        for number, (axes, surface) in enumerate(zip(every.flat, fine, strict=False)):
            _draw_surface(axes, surface, 2 * (workshop.pixels(_SLICES) // 2) + 1)
            axes.set_title(
                f"({'abcdefg'[number]}) u = {_of_pi(number)}, I(u, 0) = {surface.on_axis:.3f}", y=-0.1
            )
        _draw_scale(every.flat[-1])
        plot.subplots_adjust(left=0, right=1, bottom=0.06, top=1, wspace=0.05, hspace=0.1)
        path = write_plot(workshop.path("tog_7"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    rows = [_row(number, surface) for number, surface in enumerate(fine)]
    head = ["figure", "u", "I(u, 0)", "largest I", "at v", "light within v = 6π (%)"]
    return Drawing(path, {"rows": rows}, markdown_table(head, rows))


def _row(number: int, surface: Surface) -> list[str | float]:
    v, peak = surface.peak
    light = 100.0 * light_within(surface.u, REACH)
    return [
        f"7{'abcdefg'[number]}",
        _of_pi(number),
        round(surface.on_axis, 4),
        round(peak, 4),
        round(v, 2),
        round(light, 1),
    ]


def _of_pi(number: int) -> str:
    """Return a multiple of π in words of mathematics."""
    return "0" if number == 0 else f"{'' if number == 1 else number}π"


def _draw_surface(axes: Axes, surface: Surface, slices: int) -> None:
    """Draw slices from back to front, each hiding what lies behind it; an odd number cuts the axis too."""
    _set_view(axes)
    for x, y, intensity in zip(*surface.slices(slices, _POINTS), strict=True):
        across, up = _seen(x, y, intensity)
        axes.fill_between(across, up, _seen(x, y, 0.0)[1], color="white", linewidth=0)
        line = np.stack([across, up], axis=1)
        tone = 0.4 + 0.6 * (0.5 * (intensity[1:] + intensity[:-1])) ** _TONE
        colors = mpl.colormaps["YlGnBu"](tone)
        pieces = np.stack([line[:-1], line[1:]], axis=1)
        axes.add_collection(LineCollection(pieces, colors=colors, linewidth=0.8, snap=False))


def _draw_scale(axes: Axes) -> None:
    """Draw the axes that all surfaces share (figure 7h)."""
    _set_view(axes)
    angle = np.linspace(0.0, 2.0 * math.pi, 200)
    axes.plot(*_seen(REACH * np.cos(angle), REACH * np.sin(angle), 0.0), color="#999999", linewidth=0.8)
    for x, y in ((REACH, 0.0), (0.0, REACH)):
        axes.plot(*np.transpose([_seen(-x, -y, 0.0), _seen(x, y, 0.0)]), color=_INK, linewidth=1)
    axes.plot(*np.transpose([_seen(REACH, 0.0, 0.0), _seen(REACH, 0.0, 1.0)]), color=_INK, linewidth=1)
    for level in (0.5, 1.0):
        across, up = _seen(REACH, 0.0, level)
        axes.plot([across - 0.5, across], [up, up], color=_INK, linewidth=1)
        axes.text(across - 1.0, up, f"I = {level:g}", ha="right", va="center")
    for x, y, text, align in (
        (-REACH, 0.0, "x = −6π", "left"),
        (REACH, 0.0, "6π", "right"),
        (0.0, -REACH, "y = −6π", "left"),
        (0.0, REACH, "6π", "left"),
    ):
        across, up = _seen(x, y, 0.0)
        axes.text(across + (0.6 if align == "left" else -0.6), up + 0.7, text, ha=align, va="bottom")
    axes.set_title("(h) the scale of all; v = √(x² + y²)", y=-0.1)


def _seen(
    x: npt.ArrayLike, y: npt.ArrayLike, intensity: npt.ArrayLike
) -> tuple[npt.ArrayLike, npt.NDArray[np.float64]]:
    """Return where places are in the picture: across and up."""
    up = np.multiply(y, math.sin(_TILT)) + np.multiply(intensity, _HEIGHT * math.cos(_TILT))
    return x, up


def _set_view(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set(xlim=(-1.04 * REACH, 1.04 * REACH), ylim=(-0.56 * REACH, 1.02 * _HEIGHT * math.cos(_TILT)))


FIGURES = (Figure("tog_7", "TOG 1982, figure 7: intensity distribution of diffraction", draw_surfaces),)
