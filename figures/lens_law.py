"""Geometrical optics of the papers' 55 mm lens, drawn to scale (TOG 1982, figures 2 to 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

from potmesil_addon.lens import (
    CocModel,
    FloatArray,
    Lens,
    circle_of_confusion,
    circle_of_confusion_at_infinity,
    depth_of_field,
    image_distance,
)

from .sheet import COLORS, STYLE, markdown_table, write_plot
from .workshop import Drawing, Figure, Workshop

FOCAL_LENGTH: Final = 0.055
"""Focal length in metres of the lens of TOG 1982, Table 1."""

F_STOPS: Final = (5.6, 11.0, 22.0)
FOCUS_DISTANCES: Final = (2.0, 0.98, 0.55, 0.29)
"""Aperture numbers and focused distances in metres of TOG 1982, Table 1."""

_MM: Final = 1e3
_UM: Final = 1e6
_DPI: Final = 150
_INK: Final = "#222222"
_GLASS: Final = "#9db8d2"

_OBJECT_HEIGHT: Final = 0.02
"""Radius in metres of the sphere of TOG 1982, figure 11, which stands 290 mm from the lens."""

_GLASS_RADIUS: Final = 0.023
"""Half the height in metres at which the glass is drawn: all construction rays pass through it."""


def papers_lens(f_stop: float = 5.6, focus_distance: float = 0.55) -> Lens:
    """Return the 55 mm lens of TOG 1982, Table 1.

    Parameters
    ----------
    f_stop : float
        Aperture number n.
    focus_distance : float
        Focused distance D in metres.

    Returns
    -------
    Lens
        The lens, with a round aperture.
    """
    return Lens(FOCAL_LENGTH, f_stop, focus_distance)


@dataclass(frozen=True, slots=True)
class RayDiagram:
    """How a lens images one point (TOG 1982, figure 2).

    Places are (along, height) in metres: along the optical axis from the lens, negative in front of it, and
    away from the axis.

    Parameters
    ----------
    tip : ndarray of float64 of shape (2,)
        The point.
    image : ndarray of float64 of shape (2,)
        Where the lens law has its image.
    rays : ndarray of float64 of shape (3, 3, 2)
        Three rays by construction, each from the point to the lens to the image: the one that arrives
        parallel to the axis, the one through the lens' centre, and the one through the front focus.
    cone : ndarray of float64 of shape (2, 3, 2)
        The rays through the upper and the lower rim of the aperture: the light that makes the picture.
    """

    tip: FloatArray
    image: FloatArray
    rays: FloatArray
    cone: FloatArray


def ray_diagram(lens: Lens, height: float) -> RayDiagram:
    """Construct the image of a point in the plane in focus.

    Parameters
    ----------
    lens : Lens
        The lens, focused beyond its focal length.
    height : float
        Distance of the point from the axis in metres.

    Returns
    -------
    RayDiagram
        Rays that end at the distance of `image_distance`.
    """
    d, f = lens.focus_distance, lens.focal_length
    v = float(image_distance(d, f))
    tip, image = np.array([-d, height]), np.array([v, -height * v / d])
    rim = 0.5 * lens.aperture_diameter
    at_lens = [height, 0.0, -height * f / (d - f), rim, -rim]
    lines = np.array([[tip, (0.0, y), image] for y in at_lens])
    return RayDiagram(tip, image, lines[:3], lines[3:])


@dataclass(frozen=True, slots=True)
class SharpTriangles:
    """The triangles from which the depth of field follows (TOG 1982, figure 3 and eq. 3).

    Places are (distance, height) in metres, the distance in front of the lens. Letters are the paper's.

    Parameters
    ----------
    left, right : ndarray of float64 of shape (2,)
        L and R: the rim of the aperture.
    m, n : ndarray of float64 of shape (2,)
        M and N: the ends of the patch of a thousandth of the distance, in the plane in focus.
    a, b : ndarray of float64 of shape (2,)
        A and B: the far and the near limit, on the axis.
    """

    left: FloatArray
    right: FloatArray
    m: FloatArray
    n: FloatArray
    a: FloatArray
    b: FloatArray


def sharp_triangles(lens: Lens) -> SharpTriangles:
    """Return the triangles of a lens focused nearer than its hyperfocal distance.

    Parameters
    ----------
    lens : Lens
        The lens.

    Returns
    -------
    SharpTriangles
        With the apexes at the limits of `depth_of_field`.
    """
    limits = depth_of_field(lens)
    rim = 0.5 * lens.aperture_diameter
    # The criterion: the eye resolves a thousandth of the distance.
    patch = 0.5 * lens.focus_distance * lens.aperture_diameter / limits.hyperfocal
    return SharpTriangles(
        left=np.array([0.0, rim]),
        right=np.array([0.0, -rim]),
        m=np.array([lens.focus_distance, patch]),
        n=np.array([lens.focus_distance, -patch]),
        a=np.array([limits.far, 0.0]),
        b=np.array([limits.near, 0.0]),
    )


@dataclass(frozen=True, slots=True)
class ConfusionTriangles:
    """The triangles from which the circle of confusion follows (TOG 1982, figure 4 and eq. 8).

    Places are (distance, height) in metres, the distance behind the lens.

    Parameters
    ----------
    left, right : ndarray of float64 of shape (2,)
        L and R: the rim of the aperture.
    a : ndarray of float64 of shape (2,)
        A: where the point converges, on the axis.
    e, b : ndarray of float64 of shape (2,)
        E and B: where the rays from L and R meet the film. They have crossed where A lies before it.
    """

    left: FloatArray
    right: FloatArray
    a: FloatArray
    e: FloatArray
    b: FloatArray


def confusion_triangles(lens: Lens, depth: float) -> ConfusionTriangles:
    """Return the triangles of a point out of focus, with the film where the lens law has it.

    Parameters
    ----------
    lens : Lens
        The lens, focused beyond its focal length.
    depth : float
        Distance P of the point in metres, beyond the focal length.

    Returns
    -------
    ConfusionTriangles
        With EB the `circle_of_confusion` of the papers' model.
    """
    film = float(image_distance(lens.focus_distance, lens.focal_length))
    circle = float(circle_of_confusion(depth, lens, "paper"))
    rim = 0.5 * lens.aperture_diameter
    return ConfusionTriangles(
        left=np.array([0.0, rim]),
        right=np.array([0.0, -rim]),
        a=np.array([float(image_distance(depth, lens.focal_length)), 0.0]),
        # A point too far away converges before the film: positive circles stand on their head.
        e=np.array([film, -0.5 * circle]),
        b=np.array([film, 0.5 * circle]),
    )


@dataclass(frozen=True, slots=True)
class ConfusionCurve:
    """The circle of confusion over distance, for one lens (TOG 1982, figure 5).

    Parameters
    ----------
    lens : Lens
        The focused lens.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.
    depth, circle : ndarray of float64 of shape (n,)
        Distances and signed diameters on the film in metres.
    at_infinity : float
        What the diameter approaches.
    limits, limit_circles : ndarray of float64 of shape (2,)
        The near and the far limit of the depth of field, and the signed diameters there.
    """

    lens: Lens
    model: CocModel
    depth: FloatArray
    circle: FloatArray
    at_infinity: float
    limits: FloatArray
    limit_circles: FloatArray


def confusion_curve(lens: Lens, model: CocModel, depth: FloatArray) -> ConfusionCurve:
    """Evaluate the circle of confusion at distances, and at the limits of the depth of field.

    Parameters
    ----------
    lens : Lens
        The focused lens.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.
    depth : ndarray of float64 of shape (n,)
        Distances in metres.

    Returns
    -------
    ConfusionCurve
        The curve.
    """
    sharp = depth_of_field(lens)
    limits = np.array([sharp.near, sharp.far])
    return ConfusionCurve(
        lens,
        model,
        depth,
        circle_of_confusion(depth, lens, model),
        circle_of_confusion_at_infinity(lens, model),
        limits,
        circle_of_confusion(limits, lens, model),
    )


def draw_lens_law(workshop: Workshop) -> Drawing:
    """Draw the lens law: rays to scale, and the image distance over the distance."""
    lens = papers_lens(focus_distance=0.29)
    with mpl.rc_context(STYLE):
        plot, (above, below) = plt.subplots(2, 1, figsize=(8.5, 5.0), height_ratios=(1.0, 1.5))
        _draw_rays(above, lens, ray_diagram(lens, _OBJECT_HEIGHT))
        distances = _draw_image_distances(below)
        plot.subplots_adjust(hspace=0.12)
        path = write_plot(workshop.path("tog_2"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    return Drawing(path, {"image_distance_mm": {f"{d * _MM:g}": v * _MM for d, v in distances.items()}})


def draw_sharp_triangles(workshop: Workshop) -> Drawing:
    """Draw the triangles of the depth of field for the papers' three apertures."""
    lenses = [papers_lens(f_stop) for f_stop in F_STOPS]
    exaggeration = 28.0
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        heights = [1.25 * lens.aperture_diameter for lens in lenses]
        plot, every = plt.subplots(3, 1, figsize=(8.5, 6.8), sharex=True, height_ratios=heights)
        for axes, lens, height in zip(every, lenses, heights, strict=True):
            axes.set_aspect(exaggeration)
            axes.set_ylim(-0.5 * _MM * height, 0.5 * _MM * height)
            _draw_sharp(axes, lens, sharp_triangles(lens))
        every[-1].set_xlim(-25, 745)
        every[-1].set_xlabel(f"distance from the lens in mm; heights are {exaggeration:g} times larger")
        plot.subplots_adjust(hspace=0.22)
        path = write_plot(workshop.path("tog_3"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    limits = {f"{lens.f_stop:g}": depth_of_field(lens) for lens in lenses}
    return Drawing(path, {n: {"near_mm": x.near * _MM, "far_mm": x.far * _MM} for n, x in limits.items()})


def draw_confusion_triangles(workshop: Workshop) -> Drawing:
    """Draw the similar triangles of the circle of confusion, for a near and a far point."""
    lens, depths = papers_lens(), (0.29, 0.98)
    exaggeration = 2.5
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        plot, every = plt.subplots(2, 1, figsize=(8.0, 7.2), sharex=True)
        for axes, depth in zip(every, depths, strict=True):
            axes.set_aspect(exaggeration)
            axes.set_ylim(-6.4, 7.2)
            _draw_confusion(axes, lens, depth)
            axes.set_xlim(-6, 76)
        text = f"distance behind the lens in mm; heights are {exaggeration:g} times larger"
        every[-1].set_xlabel(text)
        plot.subplots_adjust(hspace=0.08)
        path = write_plot(workshop.path("tog_4"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    circles = circle_of_confusion(np.array(depths), lens, "paper")
    return Drawing(
        path, {f"{p * _MM:g}": {"circle_um": c * _UM} for p, c in zip(depths, circles, strict=True)}
    )


def draw_asymmetry(workshop: Workshop) -> Drawing:
    """Draw the circle of confusion over distance, signed and as a size, in both models."""
    lenses = [papers_lens(focus_distance=d) for d in FOCUS_DISTANCES]
    with mpl.rc_context(STYLE):
        plot, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.3), width_ratios=(1.25, 1.0))
        _draw_signed(left, lenses)
        _draw_sizes(right, [papers_lens(f_stop) for f_stop in F_STOPS])
        plot.subplots_adjust(wspace=0.26)
        path = write_plot(workshop.path("tog_5"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    head = [
        "D (mm)",
        "V (mm)",
        "D⁻ (mm)",
        "D⁺ (mm)",
        "c at D⁻ and D⁺, paper (µm)",
        "the same, cycles",
        "c at D/2 and ∞, paper (µm)",
        "the same, cycles",
    ]
    rows = [_asymmetry_row(lens) for lens in lenses]
    return Drawing(path, {"rows": rows}, markdown_table(head, rows))


def _asymmetry_row(lens: Lens) -> list[float]:
    """Return a focused distance's numbers: distances in mm and circles in micrometres."""
    sharp = depth_of_field(lens)
    distances = (
        lens.focus_distance,
        float(image_distance(lens.focus_distance, FOCAL_LENGTH)),
        sharp.near,
        sharp.far,
    )
    models: tuple[CocModel, ...] = ("paper", "cycles")
    limits = [float(circle_of_confusion(sharp.far, lens, model)) for model in models]
    infinity = [circle_of_confusion_at_infinity(lens, model) for model in models]
    return [
        round(distances[0] * _MM),
        round(distances[1] * _MM, 2),
        *(round(d * _MM) for d in distances[2:]),
        *(round(c * _UM, 1) for c in (*limits, *infinity)),
    ]


def _draw_rays(axes: Axes, lens: Lens, rays: RayDiagram) -> None:
    """Draw the lens, the rays and the image, at one scale for both axes."""
    axes.set_aspect("equal")
    axes.set(xlim=(-300, 84), ylim=(-44, 26))
    axes.axis("off")
    d, f = lens.focus_distance * _MM, lens.focal_length * _MM
    v, image_height = rays.image * _MM
    height = float(rays.tip[1]) * _MM
    axes.plot([-d - 8, v + 14], [0, 0], color=_INK, linewidth=0.7)
    axes.fill(*(np.concatenate([rays.cone[0], rays.cone[1, ::-1]]).T * _MM), color="#f2d9a0", linewidth=0)
    axes.add_patch(Ellipse((0, 0), 5, 2 * _MM * _GLASS_RADIUS, facecolor=_GLASS, edgecolor="none", alpha=0.7))
    rim = 0.5 * lens.aperture_diameter * _MM
    for side in (1, -1):
        axes.plot([0, 0], [side * rim, side * _GLASS_RADIUS * _MM], color=_INK, linewidth=2.0)
    for ray, color in zip(rays.rays, COLORS, strict=False):
        _line(axes, ray, color, linewidth=1.2)
    for x, y in ((-d, height), (v, image_height)):
        arrow = {"arrowstyle": "-|>", "color": _INK, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (x, y), (x, 0), arrowprops={**arrow, "mutation_scale": min(10.0, 1.5 * abs(y))})
    axes.plot([-f, f], [0, 0], "o", color=_INK, markersize=3)
    axes.text(-f - 2, -3, "F", ha="right", va="top")
    axes.text(f + 2, 3, "F", ha="left", va="bottom")
    level = -_GLASS_RADIUS * _MM - 7
    _measure(axes, -d, 0, level, f"D = {d:.0f} mm")
    _measure(axes, 0, v, level, f"V = {v:.1f} mm")
    axes.set_title(f"55 mm lens at f/{lens.f_stop:g} to scale; the light that passes the aperture in yellow")


def _draw_image_distances(axes: Axes) -> dict[float, float]:
    """Draw V over D and return V for the papers' distances, in metres."""
    d = np.geomspace(0.08, 10.0, 400)
    axes.semilogx(d * _MM, image_distance(d, FOCAL_LENGTH) * _MM)
    axes.axhline(FOCAL_LENGTH * _MM, color=COLORS[5], linewidth=1, linestyle="--")
    axes.text(85, FOCAL_LENGTH * _MM - 2, "V = F for a point at infinity", va="top", color=COLORS[5])
    distances = {d: float(image_distance(d, FOCAL_LENGTH)) for d in (2.0 * FOCAL_LENGTH, *FOCUS_DISTANCES)}
    for distance, image in distances.items():
        axes.plot(distance * _MM, image * _MM, "o", color=COLORS[1], markersize=4)
        text = f"{distance * _MM:.0f} → {image * _MM:.1f}"
        axes.annotate(text, (distance * _MM, image * _MM), (6, 6), textcoords="offset points")
    axes.set(xlabel="distance D in mm", ylabel="image distance V in mm", xlim=(80, 10000), ylim=(40, 180))
    _plain_ticks(axes, (100, 200, 500, 1000, 2000, 5000, 10000))
    return distances


def _draw_sharp(axes: Axes, lens: Lens, triangles: SharpTriangles) -> None:
    """Draw the cones that meet at the near and the far limit, and the patch where they are equally wide."""
    t = triangles
    sharp = depth_of_field(lens)
    axes.axvspan(sharp.near * _MM, sharp.far * _MM, color="#e9f1e6", linewidth=0)
    axes.axhline(0, color=_INK, linewidth=0.6)
    _line(axes, [t.left, t.a, t.right], COLORS[0], linewidth=1.1)
    beyond = [t.m * [1, -1], t.b, t.m]
    _line(axes, [t.left, t.b, t.right], COLORS[1], linewidth=1.1)
    _line(axes, beyond, COLORS[1], linewidth=1.1, linestyle="--")
    _line(axes, [t.left, t.right], _INK, linewidth=2.5)
    _line(axes, [t.m, t.n], COLORS[2], linewidth=2.5)
    axes.spines[:].set_visible(False)
    axes.set_yticks([])
    axes.tick_params(bottom=axes.get_subplotspec().is_last_row())
    for name, place, offset in (
        ("L", t.left, (-9, -2)),
        ("R", t.right, (-9, -6)),
        ("M", t.m, (3, 3)),
        ("N", t.n, (3, -10)),
        ("A", t.a, (3, 4)),
        ("B", t.b, (-10, 4)),
    ):
        axes.annotate(name, place * _MM, offset, textcoords="offset points")
    text = (
        f"f/{lens.f_stop:g}: LR = {lens.aperture_diameter * _MM:.2f} mm, MN = {2 * t.m[1] * _MM:.2f} mm, "
        f"D⁻ = {sharp.near * _MM:.0f} mm, D = {t.m[0] * _MM:.0f} mm, D⁺ = {sharp.far * _MM:.0f} mm"
    )
    axes.set_title(text, loc="left")


def _draw_confusion(axes: Axes, lens: Lens, depth: float) -> None:
    """Draw the light of a point that converges off the film."""
    t = confusion_triangles(lens, depth)
    film, apex = float(t.e[0]) * _MM, float(t.a[0]) * _MM
    axes.spines[:].set_visible(False)
    axes.set_yticks([])
    axes.tick_params(bottom=axes.get_subplotspec().is_last_row())
    axes.plot([-4, 74], [0, 0], color=_INK, linewidth=0.6)
    axes.fill(*(np.array([t.left, t.a, t.right]).T * _MM), color="#f2d9a0", linewidth=0)
    _line(axes, [t.left, t.a, t.right], COLORS[0], linewidth=1.1)
    if apex < film:
        _line(axes, [t.e, t.a, t.b], COLORS[0], linewidth=1.1)
        axes.fill(*(np.array([t.e, t.a, t.b]).T * _MM), color="#f2d9a0", linewidth=0)
    _line(axes, [t.left, t.right], _INK, linewidth=2.5)
    axes.plot([film, film], [-5.6, 5.6], color=COLORS[5], linewidth=1.0)
    _line(axes, [t.e, t.b], COLORS[1], linewidth=3.0)
    for name, place, offset in (
        ("L", t.left, (-10, -3)),
        ("R", t.right, (-10, -4)),
        ("A", t.a, (4, 4) if apex > film else (-12, 4)),
        ("E", t.e, (5, 5) if apex < film else (-10, 4)),
        ("B", t.b, (5, -12) if apex < film else (-10, -11)),
    ):
        axes.annotate(name, place * _MM, offset, textcoords="offset points")
    circle = abs(float(circle_of_confusion(depth, lens, "paper"))) * _MM
    where = "behind" if apex > film else "before"
    text = (
        f"Focused at {lens.focus_distance * _MM:.0f} mm at f/{lens.f_stop:g}, the film at {film:.2f} mm. "
        f"A point at {depth * _MM:.0f} mm converges\nat {apex:.2f} mm, {where} the film: EB = {circle:.2f} mm"
    )
    axes.set_title(text, loc="left", y=0.95)


def _draw_signed(axes: Axes, lenses: Sequence[Lens]) -> None:
    """Draw signed circles for all focused distances, solid in the papers' model, dashed in Cycles'."""
    depth = np.geomspace(0.15, 12.0, 600)
    for lens, color in zip(lenses, COLORS, strict=False):
        paper = confusion_curve(lens, "paper", depth)
        cycles = confusion_curve(lens, "cycles", depth)
        axes.plot(
            depth * _MM, paper.circle * _MM, color=color, label=f"D = {lens.focus_distance * _MM:.0f} mm"
        )
        axes.plot(depth * _MM, cycles.circle * _MM, color=color, linewidth=1, linestyle="--")
        axes.plot(paper.limits * _MM, paper.limit_circles * _MM, "|", color=color, markersize=9)
        for curve, face in ((paper, color), (cycles, "white")):
            axes.plot(
                1.0,
                curve.at_infinity * _MM,
                "<",
                color=color,
                markerfacecolor=face,
                markersize=6,
                transform=axes.get_yaxis_transform(),
                clip_on=False,
            )
    axes.axhline(0, color=_INK, linewidth=0.7)
    axes.set(xscale="log", xlim=(150, 12000), ylim=(-2.2, 2.5))
    axes.set(xlabel="distance P in mm", ylabel="signed circle of confusion in mm")
    axes.set_title("f/5.6; solid: paper, dashed: cycles; bars: D⁻ and D⁺, triangles: limit at infinity")
    axes.legend(loc="upper left")
    _plain_ticks(axes, (200, 500, 1000, 2000, 5000, 10000))


def _draw_sizes(axes: Axes, lenses: Sequence[Lens]) -> None:
    """Draw the sizes of circles around one focused distance for all apertures."""
    depth = np.linspace(0.25, 1.2, 1200)
    for lens, color in zip(lenses, COLORS, strict=False):
        curve = confusion_curve(lens, "paper", depth)
        axes.plot(depth * _MM, np.abs(curve.circle) * _MM, color=color, label=f"f/{lens.f_stop:g}")
        axes.plot(curve.limits * _MM, np.abs(curve.limit_circles) * _MM, "o", color=color, markersize=3.5)
    axes.set(xlabel="distance P in mm", ylabel="circle of confusion in mm", xlim=(250, 1200), ylim=(0, 1.25))
    axes.set_title("paper, focused at 550 mm; dots: D⁻ and D⁺")
    axes.legend(loc="upper right")


def _line(axes: Axes, places: Sequence[FloatArray] | FloatArray, color: str, **options: float | str) -> None:
    """Draw a line through places in metres, on axes in mm."""
    axes.plot(*(np.array(places).T * _MM), color=color, **options)


def _measure(axes: Axes, begin: float, end: float, level: float, text: str) -> None:
    """Draw a dimension line with its text."""
    arrow = {"arrowstyle": "<->", "color": _INK, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (begin, level), (end, level), arrowprops=arrow)
    axes.text(0.5 * (begin + end), level - 2, text, ha="center", va="top")


def _plain_ticks(axes: Axes, ticks: Sequence[float]) -> None:
    """Write numbers instead of powers on a logarithmic axis."""
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()


FIGURES = (
    Figure("tog_2", "TOG 1982, figure 2: lens law", draw_lens_law),
    Figure("tog_3", "TOG 1982, figure 3: depth of field", draw_sharp_triangles),
    Figure("tog_4", "TOG 1982, figure 4: circle of confusion", draw_confusion_triangles),
    Figure("tog_5", "TOG 1982, figure 5: asymmetry of depth of field", draw_asymmetry),
)
