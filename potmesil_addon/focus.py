"""The focus processor: samples and a lens to a picture with depth of field (TOG 1982, section 3.2)."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np

from .camera import Film
from .errors import InputError
from .lens import CocModel, Lens, circle_of_confusion
from .psf import PackedTables, PsfBuilder, PsfSettings
from .samples import Float32Array, SampleLayer, Samples, Window
from .scatter import Backend, Scatter, scatter

Weighting = Literal["1982", "1981"]
"""``1982`` weighs samples alike (TOG 1982, eq. 22), ``1981`` by 1/z^2 (1981, eq. 20)."""

WEIGHTINGS: Final[tuple[Weighting, ...]] = ("1982", "1981")

_LEAST_WEIGHT: Final = 1e-6
"""Least 1/z^2 weight relative to the nearest sample's, so that a far background keeps some."""


@dataclass(frozen=True, slots=True)
class FocusSettings:
    """Everything that the focus processor needs beside the samples.

    Parameters
    ----------
    lens : Lens
        The focused lens with its aperture.
    film : Film
        The display window on the film.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.
    psf : PsfSettings
        Kind of point-spread function and its tables.
    weighting : {"1982", "1981"}
        Weights of the samples.
    backend : {"auto", "numba", "numpy"}
        Implementation; all give the same picture.
    """

    lens: Lens
    film: Film
    model: CocModel = "cycles"
    psf: PsfSettings = field(default_factory=PsfSettings)
    weighting: Weighting = "1982"
    backend: Backend = "auto"


@dataclass(frozen=True, slots=True)
class FocusReport:
    """What the focus processor did to a layer, for reports and tests.

    Parameters
    ----------
    layer : str
        Name of the layer.
    nearest_m, farthest_m : float
        Finite depths of the samples in metres; NaN where none is finite.
    nearest_circle_px, farthest_circle_px : float
        Signed circles of confusion of the nearest and farthest sample, diameters in final pixels.
    tables : int
        Number of tables of point-spread functions.
    table_bytes : int
        Their memory.
    """

    layer: str
    nearest_m: float
    farthest_m: float
    nearest_circle_px: float
    farthest_circle_px: float
    tables: int
    table_bytes: int


def focus_layer(
    layer: SampleLayer, samples: Samples, settings: FocusSettings
) -> Generator[float, None, tuple[Float32Array, FocusReport]]:
    """Spread the samples of one layer over the pixels of the picture (TOG 1982, eq. 22).

    Weights are renormalised at every pixel, so the frame's borders keep their brightness; samples of an
    overscan margin blur into the frame. Alpha is scattered with the colours, which are premultiplied.

    Parameters
    ----------
    layer : SampleLayer
        Samples with a depth.
    samples : Samples
        The file that they belong to: its windows and where samples lie.
    settings : FocusSettings
        Lens, film and how to work.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    picture : ndarray of float32 of shape (rows, columns, 4)
        The display window, premultiplied; 0 where the file has no data.
    report : FocusReport
        What was done.

    Raises
    ------
    InputError
        If the layer has no depth.
    """
    if layer.depth is None:
        raise InputError(
            f"Layer '{layer.name}' has no depth (Z) channel, which a lens needs; "
            "enable the Z pass or switch the lens off."
        )
    depth = layer.depth
    builder = PsfBuilder(settings.lens, settings.film, settings.model, settings.psf, samples.position)
    assignment = builder.assign(depth)
    tables = builder.pack(list(builder.tables(assignment.circles)))
    yield 0.05

    data, display = samples.data_window, samples.display_window
    covered = data
    if samples.position == "corner":
        covered = Window(data.x0, data.y0, data.x1 - 1, data.y1 - 1)
    seen = covered.intersection(display)
    picture = np.zeros((display.rows, display.columns, 4), dtype=np.float32)
    target = np.zeros((seen.rows, seen.columns, 4), dtype=np.float32)
    work = Scatter(
        color=layer.color,
        weight=_weights(depth, settings.weighting),
        assignment=assignment,
        tables=tables,
        origin=(data.x0 - seen.x0, data.y0 - seen.y0),
        shape=(seen.rows, seen.columns),
    )
    for done in scatter(work, target, settings.backend):
        yield 0.05 + 0.95 * done
    picture[seen.within(display)] = target
    return picture, _report(layer.name, depth, samples, settings, tables)


def average_down(picture: Float32Array, factor: int) -> Float32Array:
    """Average squares of pixels into one (TOG 1982, section 3.2, anti-aliasing).

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, channels)
        Premultiplied; rows and columns are multiples of `factor`.
    factor : int
        Side of the squares.

    Returns
    -------
    ndarray of float32 of shape (rows / factor, columns / factor, channels)
        The smaller picture.
    """
    if factor == 1:
        return picture
    rows, columns, channels = picture.shape
    squares = picture.reshape(rows // factor, factor, columns // factor, factor, channels)
    return np.asarray(squares.mean(axis=(1, 3), dtype=np.float64), dtype=np.float32)


def over(front: Float32Array, back: Float32Array) -> Float32Array:
    """Lay one premultiplied picture over another of the same shape."""
    return np.asarray(front + back * (1.0 - front[..., 3:4]), dtype=np.float32)


def _weights(depth: Float32Array, weighting: Weighting) -> Float32Array:
    if weighting == "1982":
        return np.ones_like(depth)
    # Only ratios matter. The papers' scenes are closed: a sample without surface counts as the farthest.
    nearest = np.min(depth)
    if not np.isfinite(nearest):
        return np.ones_like(depth)
    farthest = np.max(depth, where=np.isfinite(depth), initial=nearest)
    ratio = nearest / np.minimum(depth, farthest)
    return np.maximum(ratio * ratio, np.float32(_LEAST_WEIGHT))


def _report(
    name: str, depth: Float32Array, samples: Samples, settings: FocusSettings, tables: PackedTables
) -> FocusReport:
    finite = depth[np.isfinite(depth)]
    nearest, farthest = (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
    circles = circle_of_confusion([float(depth.min()), float(depth.max())], settings.lens, settings.model)
    near_px, far_px = circles / (settings.film.pitch_x * samples.supersampling)
    return FocusReport(
        layer=name,
        nearest_m=nearest,
        farthest_m=farthest,
        nearest_circle_px=float(near_px),
        farthest_circle_px=float(far_px),
        tables=tables.count,
        table_bytes=tables.nbytes,
    )
