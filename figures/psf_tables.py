"""The tables of point-spread functions over depth (TOG 1982, figure 10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.transforms import Affine2D

from potmesil_addon.camera import Film
from potmesil_addon.lens import FloatArray, circle_of_confusion
from potmesil_addon.psf import PSF_KINDS, PsfBuilder, PsfKind, PsfSettings, TableSpacing

from .lens_law import papers_lens
from .sheet import COLORS, STYLE, markdown_table, write_plot
from .workshop import Drawing, Figure, Workshop

FILM: Final = Film(width=0.03, height=0.03, columns=1024, rows=1024)
"""Film and evaluated pixels of TOG 1982, section 4."""

NEAREST: Final = 0.27
FARTHEST: Final = 1.2
"""Depths in metres between which tables are made: a little more than the scene of figure 11 has."""

SPACING: Final = 1e-3
"""The papers' step between tables, in metres of depth."""

SHOWN: Final = (0.27, 0.31, 0.36, 0.42, 0.48, 0.55, 0.66, 0.8, 1.0, 1.2)
"""Depths in metres of the tables that are drawn; the lens is focused at 0.55."""

_DPI: Final = 150
_SAMPLES: Final = 20_001
_GREY: Final = 0.75
"""Brightness at which an evenly lit circle is shown; Lommel's rims are up to a fifth brighter."""

_CELL: Final = 46
"""Pixels of a table that a cell of the rows has, each way."""

_MM_PER_PIXEL: Final = 3.4
"""Depth along the axis of the upper drawing, over the side of a table's pixel."""

_RECEDING: Final = (0.42, 0.2)
"""Across and up in the upper drawing, for a pixel away from the eye."""


@dataclass(frozen=True, slots=True)
class Table:
    """One table of a point-spread function.

    Parameters
    ----------
    depth : float
        z' in metres.
    circle : float
        Diameter of the circle of confusion in pixels, negative nearer than the focus.
    values : ndarray of float64 of shape (rows, columns, primaries)
        Response of each pixel.
    """

    depth: float
    circle: float
    values: FloatArray

    @property
    def entries(self) -> int:
        """Pixels along a side of the square around the circle."""
        return int(self.values.shape[0])


@dataclass(frozen=True, slots=True)
class Storage:
    """What the tables of a picture cost.

    Parameters
    ----------
    tables : int
        How many there are.
    quadrant_entries : int
        Entries of all, one quadrant of each, as the papers store them.
    nbytes : int
        Memory in bytes of all as our processor stores them.
    largest_step : float
        Largest difference between the circles of two neighbouring tables, in pixels.
    """

    tables: int
    quadrant_entries: int
    nbytes: int
    largest_step: float


def builder(kind: PsfKind, spacing: TableSpacing = "equal-z") -> PsfBuilder:
    """Return the maker of tables for TOG 1982, figure 12c: 55 mm, f/5.6, focused at 550 mm.

    Parameters
    ----------
    kind : {"disc", "lommel"}
        Geometrical or diffraction pattern.
    spacing : {"equal-z", "coc"}
        The papers' 1 mm of depth, or our default, equal steps of the circle.

    Returns
    -------
    PsfBuilder
        For samples at the corners of pixels.
    """
    step = SPACING if spacing == "equal-z" else None
    return PsfBuilder(papers_lens(), FILM, "paper", PsfSettings(kind, spacing, step=step), "corner")


def tables_at(kind: PsfKind, depths: Sequence[float]) -> list[Table]:
    """Make the tables of some depths.

    Parameters
    ----------
    kind : {"disc", "lommel"}
        Geometrical or diffraction pattern.
    depths : sequence of float
        Depths z' in metres.

    Returns
    -------
    list of Table
        In the order of the depths.
    """
    maker = builder(kind)
    circles = circle_of_confusion(depths, maker.lens, maker.model)
    made = [np.moveaxis(rows.dense(), 0, -1) for rows in maker.tables(circles)]
    return [
        Table(depth, float(circle) / FILM.pitch_x, values)
        for depth, circle, values in zip(depths, circles, made, strict=True)
    ]


def table_circles(kind: PsfKind, spacing: TableSpacing) -> FloatArray:
    """Return the circles of all tables between the nearest and the farthest depth.

    Parameters
    ----------
    kind : {"disc", "lommel"}
        Geometrical or diffraction pattern.
    spacing : {"equal-z", "coc"}
        How tables are spaced.

    Returns
    -------
    ndarray of float64 of shape (tables,)
        Signed diameters in pixels, from near to far.
    """
    # Samples dense enough that every table in between is used.
    return builder(kind, spacing).assign(np.linspace(NEAREST, FARTHEST, _SAMPLES)).circles / FILM.pitch_x


def storage(kind: PsfKind, spacing: TableSpacing) -> Storage:
    """Make all tables and count what they cost.

    Parameters
    ----------
    kind : {"disc", "lommel"}
        Geometrical or diffraction pattern.
    spacing : {"equal-z", "coc"}
        How tables are spaced.

    Returns
    -------
    Storage
        The counts.
    """
    maker, circles = builder(kind, spacing), table_circles(kind, spacing)
    tables = list(maker.tables(circles * FILM.pitch_x))
    packed = maker.pack(tables)
    # A table of corner samples is as wide as high, with as many rows above the sample as below.
    entries = sum((table.row_begin.size // 2) ** 2 for table in tables)
    return Storage(packed.count, entries, packed.nbytes, float(np.abs(np.diff(circles)).max()))


def draw_tables(workshop: Workshop) -> Drawing:
    """Draw tables along z', beside each other, and how their size goes with depth."""
    discs, patterns = tables_at("disc", SHOWN), tables_at("lommel", SHOWN)
    with mpl.rc_context(STYLE):
        plot = plt.figure(figsize=(11.0, 8.6))
        grid = plot.add_gridspec(3, 2, height_ratios=(1.25, 1.2, 1.6), hspace=0.22, wspace=0.2)
        _draw_along_axis(plot.add_subplot(grid[0, :]), discs)
        _draw_rows(plot.add_subplot(grid[1, :]), discs, patterns)
        _draw_sizes(plot.add_subplot(grid[2, 0]), discs)
        _draw_steps(plot.add_subplot(grid[2, 1]))
        path = write_plot(workshop.path("tog_10"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    sizes = [[f"{t.depth * 1e3:.0f}", round(t.circle, 1), f"{t.entries} × {t.entries}"] for t in discs]
    costs = [
        _cost_row(kind, spacing, storage(kind, spacing))
        for kind in PSF_KINDS
        for spacing in ("equal-z", "coc")
    ]
    table = markdown_table(["z' (mm)", "circle (pixels)", "entries"], sizes)
    head = ["tables", "spacing", "number", "largest step (pixels)", "entries, one quadrant", "ours (kB)"]
    return Drawing(path, {"sizes": sizes, "storage": costs}, f"{table}\n\n{markdown_table(head, costs)}")


def _cost_row(kind: PsfKind, spacing: TableSpacing, cost: Storage) -> list[str | float]:
    words = "1 mm" if spacing == "equal-z" else "equal in the circle"
    step = round(cost.largest_step, 2)
    return [kind, words, cost.tables, step, cost.quadrant_entries, round(cost.nbytes / 1024)]


def _picture(table: Table) -> npt.NDArray[np.uint8]:
    """Return a table as a picture, linear, with an evenly lit circle at a fixed grey."""
    # A circle smaller than a pixel lights all four around the corner evenly.
    area = max(0.25 * np.pi * table.circle**2, 4.0)
    values = np.broadcast_to(table.values, (*table.values.shape[:2], 3))
    return np.rint(255.0 * np.minimum(_GREY * area * values, 1.0)).astype(np.uint8)


def _draw_along_axis(axes: Axes, tables: Sequence[Table]) -> None:
    """Draw tables as upright squares along the optical axis, seen from the near end."""
    across, up = _RECEDING
    axes.plot(
        [t.depth * 1e3 / _MM_PER_PIXEL for t in (tables[0], tables[-1])], [0, 0], color="black", linewidth=0.8
    )
    for order, table in enumerate(reversed(tables)):
        side, x = table.entries, table.depth * 1e3 / _MM_PER_PIXEL
        # The axis pierces the middle of each square.
        sheared = Affine2D.from_values(across, up, 0.0, 1.0, x, 0.0) + axes.transData
        edges = (-0.5 * side, 0.5 * side, -0.5 * side, 0.5 * side)
        axes.imshow(
            _picture(table),
            extent=edges,
            transform=sheared,
            interpolation="nearest",
            zorder=2 + order,
            clip_on=False,
        )
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * 0.5 * side
        axes.plot(*corners.T, color=COLORS[0], linewidth=0.8, transform=sheared, zorder=2 + order)
        axes.text(x, -30, f"{table.depth * 1e3:.0f}", ha="center", va="top")
    axes.set_aspect("equal")
    axes.set(xlim=(tables[0].depth * 1e3 / _MM_PER_PIXEL - 14, tables[-1].depth * 1e3 / _MM_PER_PIXEL + 14))
    axes.set_ylim(-38, 26)
    axes.axis("off")
    axes.set_title("Tables along z' (mm), at one scale of pixels; 55 mm at f/5.6 focused at 550 mm")


def _draw_rows(axes: Axes, discs: Sequence[Table], patterns: Sequence[Table]) -> None:
    """Draw tables beside each other: discs above, diffraction patterns in their three primaries below."""
    sheet = np.full((2 * _CELL, _CELL * len(discs), 3), 255, dtype=np.uint8)
    for row, tables in enumerate((discs, patterns)):
        for column, table in enumerate(tables):
            top = row * _CELL + (_CELL - table.entries) // 2
            left = column * _CELL + (_CELL - table.entries) // 2
            sheet[top : top + table.entries, left : left + table.entries] = _picture(table)
    axes.imshow(sheet, interpolation="nearest")
    for column, table in enumerate(discs):
        text = f"{table.entries} × {table.entries}"
        axes.text((column + 0.5) * _CELL, 2 * _CELL + 2, text, ha="center", va="top")
    for row, kind in enumerate(PSF_KINDS):
        axes.text(-4, (row + 0.5) * _CELL, kind, ha="right", va="center")
    axes.axis("off")


def _draw_sizes(axes: Axes, tables: Sequence[Table]) -> None:
    """Draw the number of entries and the circle over depth."""
    depth = np.arange(NEAREST, FARTHEST + 0.5 * SPACING, SPACING)
    every = tables_at("disc", depth.tolist())
    axes.step(
        depth * 1e3, [t.entries for t in every], where="mid", label="entries along a side", linewidth=1.2
    )
    axes.plot(depth * 1e3, [abs(t.circle) for t in every], label="circle of confusion", linewidth=1.2)
    axes.plot(
        [t.depth * 1e3 for t in tables], [t.entries for t in tables], "o", color=COLORS[0], markersize=4
    )
    axes.set(xlabel="z' in mm", ylabel="pixels", ylim=(0, 45))
    axes.legend(loc="upper right")


def _draw_steps(axes: Axes) -> None:
    """Draw how far neighbouring tables differ, over the depth where they lie."""
    maker = builder("disc")
    depth = np.linspace(NEAREST, FARTHEST, _SAMPLES)
    sizes = circle_of_confusion(depth, maker.lens, maker.model) / FILM.pitch_x
    for spacing, text in (("equal-z", "papers: each 1 mm"), ("coc", "ours: equal in the circle")):
        circles = table_circles("disc", spacing)
        middle = np.interp(0.5 * (circles[1:] + circles[:-1]), sizes, depth)
        axes.plot(middle * 1e3, np.diff(circles), label=f"{text}, {circles.size} tables", linewidth=1.2)
    axes.set(xlabel="z' in mm", ylabel="pixels of circle from table to table", ylim=(0, 0.3))
    axes.legend(loc="upper right")


FIGURES = (Figure("tog_10", "TOG 1982, figure 10: tables of point-spread functions", draw_tables),)
