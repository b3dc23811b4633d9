"""TOG 1982, Table 2: what a picture costs at each aperture number, by the papers' processor and by ours."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

from potmesil_addon import jit
from potmesil_addon.focus import FocusSettings, focus_layer
from potmesil_addon.process import ProcessSettings, focus_settings
from potmesil_addon.progress import run
from potmesil_addon.psf import PsfBuilder, PsfKind, PsfSettings
from potmesil_addon.samples import Samples

from .sheet import COLORS, STYLE, markdown_table, write_plot
from .workshop import Drawing, Figure, Workshop

if TYPE_CHECKING:
    import bpy
    from matplotlib.axes import Axes

PAPERS_MINUTES = {16.0: 2.75, 11.0: 3.0, 8.0: 6.0, 5.6: 8.0, 4.0: 15.0, 2.8: 33.0, 2.0: 63.0, 1.4: 125.0}
"""CPU time by aperture number, as printed."""

WIDE = 5.6
"""From here to smaller aperture numbers the papers' time goes with the circle's area."""

_KINDS: tuple[PsfKind, ...] = ("disc", "lommel")
_REPEATS = 7

_NOTHING = 1e-12
"""Less than this of a sample's light in a pixel is rounding."""


@dataclass(frozen=True, slots=True)
class Operations:
    """Work of a focus processor for one picture, which does not depend on the machine.

    Parameters
    ----------
    pixels : float
        Pixels that a sample reaches, its share of the papers' work: the mean over all samples.
    entries : float
        Entries of its table that are added for a sample, its share of our work: the mean over all samples.
    """

    pixels: float
    entries: float


def growth(cost: Mapping[float, float], widest_f_stop: float = WIDE) -> float:
    """Return the exponent p of a cost that grows as (1/n)^p.

    Parameters
    ----------
    cost : mapping of float to float
        Cost by aperture number n.
    widest_f_stop : float
        Larger aperture numbers are left out.

    Returns
    -------
    float
        The slope of log cost over log 1/n, by least squares.
    """
    fitted = {n: value for n, value in cost.items() if n <= widest_f_stop}
    slope, _ = np.polyfit(-np.log(list(fitted)), np.log(list(fitted.values())), 1)
    return float(slope)


def operations(depth: npt.NDArray[np.floating], settings: FocusSettings) -> Operations:
    """Count what one picture takes, by the papers' way and by ours.

    The papers add every pixel of a circle of confusion (TOG 1982, section 3.2). Ours adds the places in each
    row at which the coverage changes, which lie along the circle's rim.

    Parameters
    ----------
    depth : ndarray of float of shape (rows, columns)
        Depths of the samples in metres.
    settings : FocusSettings
        Lens, film and kind of PSF.

    Returns
    -------
    Operations
        Means over the samples.
    """
    builder = PsfBuilder(settings.lens, settings.film, settings.model, settings.psf)
    assignment = builder.assign(depth)
    tables = list(builder.tables(assignment.circles))
    uses = np.bincount(assignment.table.reshape(-1), minlength=len(tables)) / depth.size
    pixels = [np.count_nonzero(table.dense()[0] > _NOTHING) for table in tables]
    entries = [(table.row_end - table.row_begin).sum() * (2 if table.symmetric else 1) for table in tables]
    return Operations(pixels=float(uses @ pixels), entries=float(uses @ entries))


def seconds(samples: Samples, settings: FocusSettings, repeats: int = _REPEATS) -> float:
    """Measure what focusing one layer takes, tables included.

    Parameters
    ----------
    samples : Samples
        With one layer.
    settings : FocusSettings
        Lens, film and kind of PSF.
    repeats : int
        Runs after a first one, which compiles the kernels and is not counted.

    Returns
    -------
    float
        CPU seconds of all threads together, the median of the runs.
    """
    layer = samples.layers[0]
    run(focus_layer(layer, samples, settings))
    times = []
    for _ in range(repeats):
        started = time.process_time()
        run(focus_layer(layer, samples, settings))
        times.append(time.process_time() - started)
    return statistics.median(times)


def _at(samples: Samples, f_stop: float, kind: PsfKind) -> FocusSettings:
    settings = focus_settings(
        samples, ProcessSettings(psf=PsfSettings(kind=kind, blocks=False), visibility="none")
    )
    return replace(settings, lens=replace(settings.lens, f_stop=f_stop))


def _one_sample_a_pixel(scene: bpy.types.Scene) -> None:
    scene.potmesil_camera.sampling = "PIXELS"
    # A margin would be counted with the picture.
    scene.potmesil_camera.use_overscan = False


def _draw(workshop: Workshop) -> Drawing:
    samples = workshop.rendered("table_2", "carafe", prepare=_one_sample_a_pixel)
    depth = samples.layers[0].depth
    assert depth is not None
    times = {kind: {n: seconds(samples, _at(samples, n, kind)) for n in PAPERS_MINUTES} for kind in _KINDS}
    counts = {kind: {n: operations(depth, _at(samples, n, kind)) for n in PAPERS_MINUTES} for kind in _KINDS}
    costs = {
        "papers": {n: 60.0 * minutes for n, minutes in PAPERS_MINUTES.items()},
        **times,
        "pixels": {n: count.pixels for n, count in counts["disc"].items()},
        **{f"{kind}_changes": {n: count.entries for n, count in counts[kind].items()} for kind in _KINDS},
    }
    with plt.rc_context(STYLE):
        plot, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.6), layout="constrained")
        left.set_title("CPU time of a picture, seconds")
        _line(left, costs["papers"], "Papers, Prime 750", COLORS[1], "s")
        _line(left, costs["lommel"], "Ours, diffraction", COLORS[2], "^")
        _line(left, costs["disc"], "Ours, disc", COLORS[0], "o")
        right.set_title("Additions for a sample of this picture")
        _line(right, costs["lommel_changes"], "Ours, diffraction: changes along rows", COLORS[2], "^")
        _line(right, costs["pixels"], "The papers' way: pixels of the circle", COLORS[1], "s")
        _line(right, costs["disc_changes"], "Ours, disc: changes along rows", COLORS[0], "o")
        for axes in (left, right):
            _finish(axes)
        path = write_plot(workshop.path("table_2"), plot)
        plt.close(plot)

    slopes = {name: growth(cost) for name, cost in costs.items()}
    numbers = {
        "growth": slopes,
        "cost": {name: {f"{n:g}": value for n, value in cost.items()} for name, cost in costs.items()},
        "compiled": jit.HAVE_NUMBA,
    }
    return Drawing(path, numbers, _table(costs, slopes))


def _table(costs: Mapping[str, Mapping[float, float]], slopes: Mapping[str, float]) -> str:
    """Return the papers' table with our columns and the growth of each."""
    rows = [
        (
            f"{n:g}",
            f"{PAPERS_MINUTES[n]:g}",
            f"{1000.0 * costs['disc'][n]:.0f}",
            f"{1000.0 * costs['lommel'][n]:.0f}",
            *(f"{costs[name][n]:.1f}" for name in ("pixels", "disc_changes", "lommel_changes")),
        )
        for n in PAPERS_MINUTES
    ]
    rows.append(("growth", *(f"{slope:.2f}" for slope in slopes.values())))
    head = (
        "n",
        "papers, min",
        "disc, ms",
        "diffraction, ms",
        "pixels of the circle",
        "changes, disc",
        "changes, diffraction",
    )
    return markdown_table(head, rows)


def _line(axes: Axes, cost: Mapping[float, float], name: str, color: str, marker: str) -> None:
    """Draw a cost with the power of 1/n that fits it at wide apertures."""
    slope = growth(cost)
    wide = np.array([n for n in cost if n <= WIDE])
    middle = math.exp(statistics.fmean(math.log(cost[n]) + slope * math.log(n) for n in wide))
    axes.plot(list(cost), list(cost.values()), marker, color=color, label=f"{name}: growth {slope:.2f}")
    axes.plot(wide, middle * wide**-slope, color=color, linewidth=1.2)


def _finish(axes: Axes) -> None:
    """Let apertures open to the right, each at its number."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.invert_xaxis()
    axes.set_xticks(list(PAPERS_MINUTES), [f"{n:g}" for n in PAPERS_MINUTES])
    axes.minorticks_off()
    axes.set_xlabel("Aperture number n (1/n grows to the right)")
    axes.legend(loc="upper left")
    low, high = axes.get_ylim()
    # Room for the legend.
    axes.set_ylim(low, high * (high / low) ** 0.35)


FIGURES = (Figure("table_2", "TOG 1982, table 2", _draw),)
