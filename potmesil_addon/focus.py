"""The focus processor: samples and a lens to a picture with depth of field (TOG 1982, section 3.2)."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from .bands import divide, need_of_lens
from .blocks import put_in_blocks
from .camera import Film
from .character import LensCharacter
from .errors import InputError, SettingsError
from .fragments import (
    AROUND,
    Beyond,
    Views,
    carried_past_the_border,
    fragments_of,
    remembered,
    survey,
)
from .lens import CocModel, Lens, circle_of_confusion
from .progress import scaled
from .psf import (
    MAX_TABLES,
    PackedTables,
    PsfBuilder,
    PsfSettings,
    TableAssignment,
    circles_for_filtered_samples,
)
from .pupil import circle_in_cells, shows_its_cut
from .samples import Cryptomatte, Float32Array, SampleLayer, Samples, Window
from .scatter import (
    Backend,
    Marks,
    Masks,
    Scatter,
    cuts_between_cells,
    put_in_groups,
    scatter,
    uses_numba,
)
from .visibility import (
    LARGE,
    MOST_RADIUS,
    ApertureCells,
    Visibility,
    Whole,
    aperture_cells,
    brightness_of_lights,
    decide,
)

Weighting = Literal["1982", "1981"]
"""``1982`` weighs samples alike (TOG 1982, eq. 22), ``1981`` by 1/z^2 (1981, eq. 20)."""

WEIGHTINGS: Final[tuple[Weighting, ...]] = ("1982", "1981")

_LEAST_MASKED: Final = 3.0
"""Radius in pixels below which a hidden part of a circle makes it weaker and not another shape."""

_MOST_BEYOND: Final = 256
"""Most samples by which a border is carried on."""

_CLEAR: Final = 0.5
"""Alpha below which a sample is clear film, and in no block: at rims of sharp things all of it shows."""

_IN_FOCUS: Final = 0.5
"""Radius in samples up to which a surface is in focus: its samples stay in their own pixels."""

_LEAST_SIDE: Final = 2
"""Rows and columns below which there is nothing beside a sample that could hide it."""

_ROWS_AT_ONCE: Final = 128
"""Rows whose depths are looked at together."""

_ALIGNED: Final = 16
"""Rows of the largest blocks and tiles."""

_SQUARE: Final = 8
"""Rows of the largest squares of what may hide something."""

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
    visibility : {"none", "aperture"}
        Whether nearer surfaces hide farther ones, for each part of the aperture (``aperture``), or light of
        all samples is added (``none``, the papers).
    backend : {"auto", "numba", "numpy"}
        Implementation; all give the same picture.
    character : LensCharacter or None
        What is different from place to place, and a pupil that is more than its blades.
    max_memory : int or None
        Bytes that the process may have in all; the picture is made in bands of rows where it would take more.
        It stays the same, to the bit.
    """

    lens: Lens
    film: Film
    model: CocModel = "cycles"
    psf: PsfSettings = field(default_factory=PsfSettings)
    weighting: Weighting = "1982"
    visibility: Visibility = "none"
    backend: Backend = "auto"
    character: LensCharacter | None = None
    max_memory: int | None = None


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


@dataclass(frozen=True, slots=True)
class Focused:
    """A layer with depth of field, on the display window.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied; 0 where the file has no data.
    guessed : ndarray of float32 of shape (rows, columns)
        Share of each pixel's light that rests on surfaces that were carried on behind others.
    doubt : ndarray of float32 of shape (rows, columns)
        How far a pixel may be off by what was guessed and by edges, on average over red, green and blue.
    report : FocusReport
        What was done.
    """

    picture: Float32Array
    guessed: Float32Array
    doubt: Float32Array
    report: FocusReport


def focus_layer(
    layer: SampleLayer, samples: Samples, settings: FocusSettings, turn: int | None = None
) -> Generator[float, None, Focused]:
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
    turn : int, optional
        Number of this instant where many are added up; see `visibility.decide`.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    Focused
        The picture, how sure it is, and a report.

    Raises
    ------
    InputError
        If the layer has no depth.
    MemoryLimitError
        If not even a band of it can be made in the memory that there is.
    """
    if layer.depth is None:
        raise InputError(
            f"Layer '{layer.name}' has no depth (Z) channel, which a lens needs; "
            "enable the Z pass or switch the lens off."
        )
    bend = None if settings.character is None else settings.character.bend
    if bend is not None:
        circles = circle_of_confusion(layer.depth, settings.lens, settings.model) / settings.film.pitch_x
        reach = math.ceil(min(0.5 * float(np.abs(circles).max()), _MOST_BEYOND))
        layer, samples = bend.layer(layer, samples, reach)
    assert layer.depth is not None
    seen = _seen_window(samples)
    shape = None if settings.character is None else settings.character.shape(settings.lens, settings.film)
    builder = PsfBuilder(settings.lens, settings.film, settings.model, settings.psf, samples.position, shape)
    picture = np.zeros((seen.rows, seen.columns, 4), dtype=np.float32)
    guessed, doubt = np.zeros((2, seen.rows, seen.columns), dtype=np.float32)
    bands = _bands(layer, samples, builder, settings, turn)
    used: _Tables = {}
    done = 0.0
    for band in bands:
        share = (band.last - band.first) / seen.rows if seen.rows else 1.0
        rows = slice(band.first, band.last)
        steps = _spread(band, samples, builder, settings, turn, picture[rows], guessed[rows], doubt[rows])
        used.update((yield from scaled(steps, done, share)))
        done += share
    report = _report(layer.name, layer.depth, samples, settings, used)
    yield 1.0
    picture, guessed, doubt = (_on_display(values, samples) for values in (picture, guessed, doubt))
    return Focused(picture, guessed, doubt, report)


@dataclass(frozen=True, slots=True)
class _Band:
    """Rows of the picture, and what gives them light.

    `first` and `last` are rows of the pixels that there is data for. The rest is of the whole picture, and
    None where the band is all of it: what decides what is hidden, the nearest and the farthest depth, by how
    many rows and columns the data are carried on, surfaces that go on above and below, and the light past
    which samples are lights.
    """

    first: int
    last: int
    layer: SampleLayer
    samples: Samples
    sees_all: bool
    whole: Whole | None = None
    depths: tuple[np.float32, np.float32] | None = None
    past: tuple[tuple[int, int], tuple[int, int]] | None = None
    beyond: Beyond | None = None
    brightest: float | None = None


def _bands(
    layer: SampleLayer, samples: Samples, builder: PsfBuilder, settings: FocusSettings, turn: int | None
) -> Iterator[_Band]:
    """Return the bands that a picture is made in: one, or as many as it takes to keep to the memory."""
    seen, data = _seen_window(samples), samples.data_window
    all_of_it = _Band(0, seen.rows, layer, samples, _sees_all(layer, settings))
    if settings.max_memory is None:
        yield all_of_it
        return
    sees_all, sheets = all_of_it.sees_all, max(2, len(_views(layer)))
    need = need_of_lens(settings, sheets=0 if sees_all else sheets, columns=data.columns)
    # What the weights of 1981 and tables at equal steps of depth are like takes all surfaces.
    divides = (sees_all or settings.weighting == "1982") and settings.psf.tables == "coc"
    margin, knowledge = None, None
    if divides and not need.fits(data.rows, settings.max_memory):
        knowledge = _know(layer, samples, settings)
        margin = _margin(knowledge, builder, settings, turn, sees_all)
    places = divide(seen.rows, data.rows, margin, need, settings.max_memory)
    if len(places) == 1 or knowledge is None:
        yield all_of_it
        return
    yield from _divided(layer, samples, settings, places, margin or 0, knowledge)


@dataclass(frozen=True, slots=True)
class _Knowledge:
    """Least and largest radii of all views, and circles on the film, of a picture; the front view's radii."""

    lowest: float
    highest: float
    depths: tuple[np.float32, np.float32]
    focused: tuple[float, float]
    radius: Float32Array


def _know(layer: SampleLayer, samples: Samples, settings: FocusSettings) -> _Knowledge:
    """Look at all depths, a few rows at a time."""
    assert layer.depth is not None
    rows = layer.depth.shape[0]
    radius = np.empty(layer.depth.shape, dtype=np.float32)
    lowest, highest = math.inf, -math.inf
    circles = [0.0, 0.0]
    for first in range(0, rows, _ROWS_AT_ONCE):
        part, window = _rows_of(layer, samples, first, min(first + _ROWS_AT_ONCE, rows))
        depths = _focused_depth(_depths_of(part, settings), settings, window)
        found = _radii(depths, settings)
        radius[first : first + _ROWS_AT_ONCE] = found[0]
        lowest, highest = min(lowest, float(found.min())), max(highest, float(found.max()))
        circle = circle_of_confusion(depths, settings.lens, settings.model)
        circles = [min(circles[0], float(circle.min())), max(circles[1], float(circle.max()))]
    return _Knowledge(lowest, highest, _range_of(layer.depth), (circles[0], circles[1]), radius)


def _rows_of(layer: SampleLayer, samples: Samples, first: int, last: int) -> tuple[SampleLayer, Samples]:
    """Return some rows of a layer's views, and the file with a window of these alone."""
    rows = slice(first, last)

    def part(view: SampleLayer) -> SampleLayer:
        matte = view.cryptomatte
        if matte is not None:
            matte = Cryptomatte(
                np.ascontiguousarray(matte.ids[:, rows]), np.ascontiguousarray(matte.coverage[:, rows])
            )
        depth = None if view.depth is None else view.depth[rows]
        return SampleLayer(view.name, view.color[rows], depth, cryptomatte=matte)

    data = samples.data_window
    window = Window(data.x0, data.y0 + first, data.x1, data.y0 + last)
    own = replace(part(layer), hidden=tuple(part(view) for view in layer.hidden))
    return own, replace(samples, data_window=window)


def _margin(
    found: _Knowledge, builder: PsfBuilder, settings: FocusSettings, turn: int | None, sees_all: bool
) -> int:
    """Return how many rows above and below a band may count for it."""
    reach = 0
    for table in builder.tables(np.array(found.focused, dtype=np.float64)):
        reach = max(reach, -table.first_row, table.first_row + table.row_begin.size)
    # Circles of tables are rounded, and a block's rows lie below its first.
    reach = math.ceil(1.02 * reach) + _ALIGNED
    if sees_all:
        return reach
    stretch = _cells_of(settings).stretch
    apart = math.ceil((found.highest - found.lowest) * stretch)
    largest = math.ceil(max(-found.lowest, found.highest) * stretch)
    # What may hide a sample, and what decides whether that is put into a square with its neighbours.
    hides = max(apart + _ALIGNED, largest) + _SQUARE + apart + _SQUARE
    if turn is None and largest > LARGE:
        # Lights are seen once more by themselves, where they are hidden in parts.
        hides *= 2
    # Whether that is asked at all is found out in tiles.
    return reach + hides + apart + 3 * _ALIGNED + AROUND


def _divided(
    layer: SampleLayer, samples: Samples, settings: FocusSettings, places: list[tuple[int, int]], margin: int,
    found: _Knowledge,
) -> Iterator[_Band]:  # fmt: skip
    """Return the bands of a picture between the given rows."""
    assert layer.depth is not None
    seen, data = _seen_window(samples), samples.data_window
    sees_all = _sees_all(layer, settings)
    (above, below), (left, right) = (0, 0), (0, 0)
    brightest, surveyed = None, None
    if not sees_all:
        mixed = samples.mixes_surfaces
        surveyed = survey(
            layer.depth.shape, lambda a, b: _views_of(*_rows_of(layer, samples, a, b), settings), mixed=mixed
        )
        if surveyed.jumps.any():
            stretched = found.radius * _cells_of(settings).stretch
            (above, below), (left, right) = _beyond_the_data(stretched, samples)
        front, past = surveyed.front, ((above, below), (left, right))
        if any(map(any, past)):
            front = np.pad(front, (*past, (0, 0)), mode="edge")
        brightest = brightness_of_lights(front)
        del front
        surveyed = replace(surveyed, front=np.zeros((0, 0, 4), dtype=np.float32))
    shift = seen.y0 - data.y0
    needed = []
    for first, last in places:
        top = max(0, first + shift - margin)
        if top > 0:
            # Squares, blocks and tiles of the whole picture are those of the band.
            top = max(0, (top + above) // _ALIGNED * _ALIGNED - above)
        needed.append((top, min(last + shift + margin, data.rows)))
    beyond: list[Beyond] | list[None] = [None] * len(places)
    if surveyed is not None:
        edges = [
            (top and top + AROUND, bottom if bottom == data.rows else bottom - AROUND)
            for top, bottom in needed
        ]
        beyond = remembered(surveyed, layer.depth, found.radius, edges)
        del surveyed
    lowest, highest, depths = found.lowest, found.highest, found.depths
    del found
    for (first, last), (top, bottom), remains in zip(places, needed, beyond, strict=True):
        part, of_part = _rows_of(layer, samples, top, bottom)
        window = Window(seen.x0, seen.y0 + first, seen.x1, seen.y0 + last)
        yield _Band(
            first,
            last,
            part,
            replace(of_part, display_window=window),
            sees_all,
            Whole(top and top + above, lowest, highest),
            depths,
            ((above if top == 0 else 0, below if bottom == data.rows else 0), (left, right)),
            None if remains is None else remains.seen_from(top),
            brightest,
        )


def _spread(
    band: _Band, samples: Samples, builder: PsfBuilder, settings: FocusSettings, turn: int | None,
    picture: Float32Array, guessed: Float32Array, doubt: Float32Array,
) -> Generator[float, None, _Tables]:  # fmt: skip
    """Spread the samples of a band over its pixels, and return which tables that took."""
    data, seen = band.samples.data_window, _seen_window(samples)
    sources = _sources(band, builder, settings, turn)
    yield 0.2
    work = Scatter(
        color=sources.color,
        weight=sources.weight,
        assignment=sources.assignment,
        tables=sources.tables,
        origin=(data.x0 - sources.left - seen.x0, data.y0 - sources.above - seen.y0 - band.first),
        shape=picture.shape[:2],
        masks=sources.masks,
        marks=sources.marks,
    )
    marks = None if sources.marks is None else np.zeros((*picture.shape[:2], 2), dtype=np.float32)
    for done in scatter(work, picture, marks, settings.backend):
        yield 0.2 + 0.8 * done
    tables = _tables_of(sources)
    # What takes most of the memory goes before the pictures are made.
    del work, sources
    if marks is not None:
        np.clip(marks[..., 0], 0.0, 1.0, out=guessed)
        np.maximum(marks[..., 1], 0.0, out=doubt)
    return tables


@dataclass(frozen=True, slots=True)
class _Sources:
    """Everything that gives light, in sheets: (sheets, rows, columns); `side` and `cell` are the tables'."""

    color: Float32Array
    weight: Float32Array
    assignment: TableAssignment
    tables: PackedTables
    side: npt.NDArray[np.int64]
    cell: npt.NDArray[np.int64] | None
    masks: Masks | None = None
    marks: Marks | None = None
    left: int = 0
    above: int = 0


_Tables = dict[tuple[float, int, int], int]
"""Tables by circle, side of the block and cell of the field, and their bytes."""


def _tables_of(sources: _Sources) -> _Tables:
    circles, tables = sources.assignment.circles, sources.tables
    cells = np.zeros(circles.size, dtype=np.int64) if sources.cell is None else sources.cell
    kinds = zip(circles.tolist(), sources.side.tolist(), cells.tolist(), strict=True)
    return dict(zip(kinds, tables.bytes_each.tolist(), strict=True))


def _sees_all(layer: SampleLayer, settings: FocusSettings) -> bool:
    """Return whether the light of all samples is added, and nothing hides anything."""
    return settings.visibility == "none" or min(layer.color.shape[:2]) < _LEAST_SIDE


def _views(layer: SampleLayer) -> list[SampleLayer]:
    """Return the layer's own view and those of what it hides."""
    return [layer, *(view for view in layer.hidden if view.depth is not None)]


def _depths_of(layer: SampleLayer, settings: FocusSettings) -> Float32Array:
    """Return the depths of the views that count, (views, rows, columns)."""
    views = _views(layer)
    assert layer.depth is not None
    if len(views) == 1 or _sees_all(layer, settings):
        return layer.depth[np.newaxis]
    return np.stack([view.depth for view in views if view.depth is not None])


def _cells_of(settings: FocusSettings) -> ApertureCells:
    pupil = None if settings.character is None else settings.character.pupil
    return aperture_cells(settings.lens, settings.film.pitch_x / settings.film.pitch_y, pupil)


def _sources(band: _Band, builder: PsfBuilder, settings: FocusSettings, turn: int | None) -> _Sources:
    """Return what gives light: the layer's samples, or its surfaces with what the aperture sees of them."""
    layer, samples = band.layer, band.samples
    assert layer.depth is not None
    compiled = uses_numba(settings.backend)
    if band.sees_all:
        depth = layer.depth[np.newaxis]
        weight = _weights(depth, settings.weighting, band.depths)
        color = layer.color[np.newaxis].copy()
        assigned = builder.assign(_focused_depth(depth, settings, samples))
        assignment, side = put_in_blocks(color, weight, assigned, builder, compiled=compiled)
        assignment, side, cell = _in_cells(assignment, side, builder, settings, samples)
        tables = builder.pack(list(builder.tables(assignment.circles, side, cell)))
        return _Sources(color, weight, assignment, tables, side, cell)
    pitch = settings.film.pitch_x
    cells = _cells_of(settings)
    views = _views_of(layer, samples, settings)
    radius = views.radius
    radii = float(radius.min()), float(radius.max())
    fragments = fragments_of(
        views.color,
        views.depth,
        radius,
        cells.stretch,
        mixed=samples.mixes_surfaces,
        cryptomattes=views.cryptomattes,
        beyond=band.beyond,
    )
    del views
    above, left = 0, 0
    if fragments.reach.any() if band.past is None else any(map(any, band.past)):
        beyond = band.past or _beyond_the_data(radius[0] * cells.stretch, samples)
        (above, _), (left, _) = beyond
        # A list, which lets each array go when it is done with: a large frame's take half a gigabyte.
        parts = list(fragments)
        del fragments
        fragments = carried_past_the_border(parts, beyond)
    del radius
    weight = _weights(fragments.depth, settings.weighting) * fragments.coverage
    brightest = brightness_of_lights(fragments.color[0]) if band.brightest is None else band.brightest
    assignment, side = put_in_blocks(
        fragments.color,
        weight,
        builder.assign(_focused_depth(fragments.depth, settings, samples, left, above), fragments.coverage),
        builder,
        brightest=brightest,
        least_alpha=_CLEAR,
        marks=(fragments.guessed, fragments.doubt),
        compiled=compiled,
    )
    assignment, side, cell = _in_cells(assignment, side, builder, settings, samples, left, above)
    # Nothing from here on asks for depths, nor for slopes once it is decided what is hidden.
    nothing = np.zeros((0, 0, 0), dtype=np.float32)
    fragments = fragments._replace(depth=nothing)
    of_block = side.astype(np.uint8)[assignment.table]
    of_block *= weight > 0.0
    whole = band.whole or Whole(0, *radii, is_part=False)
    visible = decide(
        fragments, cells, turn, brightest=brightest, side=of_block, whole=whole, compiled=compiled
    )
    fragments = fragments._replace(slope=nothing)
    radius_x = 0.5 * np.abs(assignment.circles) / pitch * cells.stretch_x
    # Of a small circle the parts are not told apart: it is only as much weaker as it is hidden.
    is_small = radius_x < _LEAST_MASKED
    group = put_in_groups(
        visible.share, fragments.radius, _IN_FOCUS, assignment.table, is_small, visible.number, weight
    )
    in_focus = (np.abs(fragments.radius[0]) <= _IN_FOCUS) & (fragments.coverage[0] == 1.0)
    spread = assignment.circles
    if settings.psf.kind == "disc" and samples.position == "center":
        spread = circles_for_filtered_samples(spread, pitch)
    tables = builder.pack(list(builder.tables(spread, side, cell)))
    masks = Masks(
        visible.number,
        group,
        visible.mask,
        cuts_between_cells(radius_x, tables.mirror),
        radius_x * (cells.stretch_y / cells.stretch_x),
        _on_output(in_focus, samples, above, left),
    )
    marks = fragments.guessed, fragments.doubt
    return _Sources(fragments.color, weight, assignment, tables, side, cell, masks, marks, left, above)


def _views_of(layer: SampleLayer, samples: Samples, settings: FocusSettings) -> Views:
    """Return a layer's views as `fragments_of` takes them."""
    views, depths = _views(layer), _depths_of(layer, settings)
    colors = layer.color[np.newaxis] if len(views) == 1 else np.stack([view.color for view in views])
    radius = _radii(_focused_depth(depths, settings, samples), settings)
    return Views(colors, depths, radius, [view.cryptomatte for view in views])


def _focused_depth(
    depths: Float32Array, settings: FocusSettings, samples: Samples, left: int = 0, above: int = 0
) -> Float32Array:
    """Return depths that are as far out of focus on the optical axis as samples are where they lie.

    Beyond infinity a depth is negative, as one over it goes on through 0.
    """
    if settings.character is None:
        return depths
    window = _grown(samples.data_window, depths.shape, left, above)
    shift = settings.character.vergence(settings.lens, settings.film, window, samples.position)
    if shift is None:
        return depths
    if settings.psf.tables == "equal-z":
        raise SettingsError(
            "Tables at equal steps of depth are for a lens that is sharp at one depth all over; "
            "choose tables at equal steps of the circle."
        )
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (1.0 / depths - shift), dtype=np.float32)


def _grown(data: Window, shape: tuple[int, ...], left: int, above: int) -> Window:
    """Return the window of samples that were carried on past the data's border."""
    rows, columns = shape[-2:]
    x0, y0 = data.x0 - left, data.y0 - above
    return Window(x0, y0, x0 + columns, y0 + rows)


def _in_cells(
    assignment: TableAssignment,
    side: npt.NDArray[np.int64],
    builder: PsfBuilder,
    settings: FocusSettings,
    samples: Samples,
    left: int = 0,
    above: int = 0,
) -> tuple[TableAssignment, npt.NDArray[np.int64], npt.NDArray[np.int64] | None]:
    """Choose a table for each cell of the field where the barrel cuts the pupil's image."""
    if builder.shape is None or not builder.shape.is_cut:
        return assignment, side, None
    assert settings.character is not None
    pitch = settings.film.pitch_x
    cut = shows_its_cut(assignment.circles, pitch)
    window = _grown(samples.data_window, assignment.table.shape, left, above)
    cells = settings.character.cells(settings.film, window, samples.position)
    most = int(cells.max()) + 1
    # One table for all circles that are about alike.
    of_circle = np.stack([circle_in_cells(assignment.circles, pitch), side.astype(np.float64)])
    kinds, kind = np.unique(of_circle, axis=1, return_inverse=True)
    kind = kind.reshape(-1)
    wanted = kind[assignment.table] * most + np.where(cut[assignment.table], cells, 0)
    used = np.bincount(wanted.reshape(-1), minlength=kinds.shape[1] * most) > 0
    number = np.flatnonzero(used)
    if number.size > MAX_TABLES:
        raise SettingsError(
            f"Mechanical vignetting takes {number.size} tables of point-spread functions here and "
            f"{MAX_TABLES} is the most; use larger steps between them."
        )
    compact = np.cumsum(used, dtype=np.int32) - np.int32(1)
    circles, sides = kinds[:, number // most]
    return TableAssignment(circles, compact[wanted], None), sides.astype(np.int64), number % most


def _radii(depths: Float32Array, settings: FocusSettings) -> Float32Array:
    """Return the signed radii of circles of confusion, in pixels along x."""
    radius = np.empty(depths.shape, dtype=np.float32)
    for view, depth in enumerate(depths):
        circles = circle_of_confusion(depth, settings.lens, settings.model)
        radius[view] = np.clip(0.5 / settings.film.pitch_x * circles, -MOST_RADIUS, MOST_RADIUS)
    return radius


def _seen_window(samples: Samples) -> Window:
    """Return the pixels of the display window that the file has data for."""
    data = samples.data_window
    if samples.position == "corner":
        data = Window(data.x0, data.y0, data.x1 - 1, data.y1 - 1)
    return data.intersection(samples.display_window)


def _on_display(values: Float32Array, samples: Samples) -> Float32Array:
    """Return values of the pixels that the file has data for on the display window, 0 where it has none."""
    seen, display = _seen_window(samples), samples.display_window
    if seen == display:
        return values
    placed = np.zeros((display.rows, display.columns, *values.shape[2:]), dtype=np.float32)
    placed[seen.within(display)] = values
    return placed


def _on_output(
    values: npt.NDArray[np.bool_], samples: Samples, above: int, left: int
) -> npt.NDArray[np.bool_]:
    """Return what samples say of the pixels that they lie in; corner samples of none."""
    seen, data = _seen_window(samples), samples.data_window
    if samples.position == "corner":
        return np.zeros((seen.rows, seen.columns), dtype=np.bool_)
    row, column = seen.y0 - data.y0 + above, seen.x0 - data.x0 + left
    return np.ascontiguousarray(values[row : row + seen.rows, column : column + seen.columns])


def _beyond_the_data(radius: Float32Array, samples: Samples) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return by how many rows and columns, on either side, the data's border is to be carried on.

    So far its circles reach into the picture. Half of a blurred thing that ends with the data would weigh
    too little against what is sharp beside it.
    """
    data, display = samples.data_window, samples.display_window

    def missing(border: Float32Array, overscan: int) -> int:
        reach = math.ceil(float(np.abs(border).max()))
        return min(max(reach - max(overscan, 0), 0), _MOST_BEYOND)

    rows = missing(radius[0], display.y0 - data.y0), missing(radius[-1], data.y1 - display.y1)
    columns = missing(radius[:, 0], display.x0 - data.x0), missing(radius[:, -1], data.x1 - display.x1)
    return rows, columns


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


def _weights(
    depth: Float32Array, weighting: Weighting, depths: tuple[np.float32, np.float32] | None = None
) -> Float32Array:
    """Return weights; `depths` are the nearest and the farthest of the picture where that is larger."""
    if weighting == "1982":
        return np.ones_like(depth)
    # Only ratios matter. The papers' scenes are closed: a sample without surface counts as the farthest.
    nearest, farthest = depths or _range_of(depth)
    if not np.isfinite(nearest):
        return np.ones_like(depth)
    ratio = nearest / np.minimum(depth, farthest)
    return np.maximum(ratio * ratio, np.float32(_LEAST_WEIGHT))


def _range_of(depth: Float32Array) -> tuple[np.float32, np.float32]:
    """Return the least depth and the largest finite one."""
    nearest = np.float32(np.min(depth))
    return nearest, np.float32(np.max(depth, where=np.isfinite(depth), initial=nearest))


def _report(
    name: str, depth: Float32Array, samples: Samples, settings: FocusSettings, tables: _Tables
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
        tables=len(tables),
        # The array of where tables begin has one more.
        table_bytes=sum(tables.values()) + 8,
    )
