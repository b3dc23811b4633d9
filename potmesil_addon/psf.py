"""Tables of point-spread functions integrated over pixels (TOG 1982, eqs. 23 and 24, figure 10).

A table is the response of the pixels around a sample, as `RowDifferences`, normalised to 1. Tables are
made for the circles of confusion that a picture needs, at equal steps of depth as the papers have
them or at equal steps of the circle itself (the default, which wastes none where it hardly changes).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from . import jit
from .aperture import (
    KEPT_TABLES,
    IntArray,
    RowDifferences,
    SamplePosition,
    ellipse_rows,
    polygon_rows,
    polygon_vertices,
    ragged,
    widened,
)
from .camera import Film
from .diffraction import lommel_intensity
from .errors import SettingsError
from .lens import CocModel, FloatArray, Lens, circle_of_confusion, circle_scale, image_distance
from .pupil import PupilShape
from .samples import Float32Array

PsfKind = Literal["disc", "lommel"]
"""``disc`` is the aperture's geometrical image, evenly lit; ``lommel`` its diffraction pattern."""

TableSpacing = Literal["coc", "equal-z"]
TableLookup = Literal["nearest", "interpolated"]

PSF_KINDS: Final[tuple[PsfKind, ...]] = ("disc", "lommel")
TABLE_SPACINGS: Final[tuple[TableSpacing, ...]] = ("coc", "equal-z")
TABLE_LOOKUPS: Final[tuple[TableLookup, ...]] = ("nearest", "interpolated")

PRIMARY_WAVELENGTHS: Final = (611e-9, 549e-9, 464e-9)
"""Dominant wavelengths in metres of the Rec. 709 red, green and blue primaries."""

MAX_TABLES: Final = 20_000

_MAX_STEPS: Final = 1 << 24

_FARTHEST_STEP: Final = float(1 << 30)
"""Steps past which they are not counted on; that many are refused."""

_LARGEST_CIRCLE: Final = 8192.0
"""Diameter in pixels past which a sample, spread ever thinner, counts as spread no wider."""

_LARGEST_U: Final = 5000.0
"""Defocus past which the diffraction pattern is taken for the geometrical disc it approaches."""

_DELTA_BITS: Final = 25
"""Binary digits of a packed table's entries; see `PsfBuilder.pack`."""

_DIFFRACTION_MARGIN: Final = 10.0 * math.pi
"""How far in v past the geometric shadow edge the diffraction pattern is kept.

An Airy pattern has 98 % of its light within it; the rest is given back by the normalisation.
"""

_SHARP: Final = 0.02
"""Radius in pixels below which a sample is in focus."""

_LEAST_POLYGON: Final = 1e-3
"""Diameter in pixels below which a polygon is drawn no smaller, so that it keeps an area."""

_ANNULI_PER_PIXEL: Final = 16
"""Annuli of large patterns; of a radius below 8 pixels there are twice as many, below 2 four times.

Some 2e-4 of a table's light is then in another pixel than it should be.
"""

_STACKED: Final = 64
"""Discs whose row differences are kept together: those of the annuli between two radii."""

_NODES_PER_RADIAN: Final = 1.2
"""Gauss-Legendre nodes for each unit of v; the intensity has no period shorter than pi."""


@dataclass(frozen=True, slots=True)
class PsfSettings:
    """Which point-spread function, and how it is tabulated.

    Parameters
    ----------
    kind : {"disc", "lommel"}
        Geometrical or diffraction pattern.
    tables : {"coc", "equal-z"}
        Tables at equal steps of the circle of confusion or of depth.
    lookup : {"nearest", "interpolated"}
        Whether a sample takes the nearest table or a mixture of the two beside it.
    step : float, optional
        Step between tables: pixels of diameter for ``coc``, metres for ``equal-z``. By default 1/8 pixel
        (1/4 for ``lommel``), and a thousandth of the depth range.
    wavelengths : tuple of float
        Wavelengths in metres of the red, green and blue primaries, for ``lommel``.
    blocks : bool
        Whether samples that are alike may spread as one; see `blocks`. Only with the nearest of tables at
        equal steps of the circle: the papers' own spread each sample by itself.

    Raises
    ------
    SettingsError
        If the step or a wavelength is not positive.
    """

    kind: PsfKind = "disc"
    tables: TableSpacing = "coc"
    lookup: TableLookup = "nearest"
    step: float | None = None
    wavelengths: tuple[float, float, float] = PRIMARY_WAVELENGTHS
    blocks: bool = True

    def __post_init__(self) -> None:
        if self.step is not None and not (math.isfinite(self.step) and self.step > 0.0):
            raise SettingsError(f"The step between tables must be greater than 0, not {self.step:g}.")
        if not all(math.isfinite(w) and w > 0.0 for w in self.wavelengths):
            raise SettingsError("Wavelengths must be greater than 0.")

    @property
    def uses_blocks(self) -> bool:
        """Whether samples that are alike spread as one."""
        return self.blocks and self.tables == "coc" and self.lookup == "nearest"


@dataclass(frozen=True, slots=True)
class TableAssignment:
    """Which table each sample takes.

    Parameters
    ----------
    circles : ndarray of float64 of shape (tables,)
        Signed diameter of the circle of confusion of each table in metres, near ones first for ``coc``.
    table : ndarray of int32, the samples' shape
        Index of the sample's table.
    fraction : ndarray of float32, the samples' shape, or None
        Share of the table after it, from 0 to 1, when looked up interpolated.
    """

    circles: FloatArray
    table: npt.NDArray[np.int32]
    fraction: npt.NDArray[np.float32] | None


@dataclass(frozen=True, slots=True)
class PackedTables:
    """All tables of a picture in flat arrays, as the kernels read them.

    Table t has the rows ``rows[t]`` to ``rows[t + 1]``, the first at offset ``first_row[t]``; row r has
    the entries ``row_begin[r]`` to ``row_end[r]``. Entry ``sums + r``, at offset 0, is what these add up to:
    of symmetric tables minus the value in the row's middle. See `RowDifferences` for the rest.
    """

    first_row: npt.NDArray[np.int32]
    rows: IntArray
    row_begin: IntArray
    row_end: IntArray
    offset: npt.NDArray[np.int32]
    delta: FloatArray
    symmetric: bool
    mirror: npt.NDArray[np.int32]

    @property
    def count(self) -> int:
        """Number of tables."""
        return self.first_row.size

    @property
    def primaries(self) -> int:
        """1 where all colours share a PSF, 3 where each primary has its own."""
        return int(self.delta.shape[1])

    @property
    def sums(self) -> int:
        """Where the sums of rows begin among the entries."""
        return int(self.offset.size - self.row_begin.size)

    @property
    def last_row(self) -> npt.NDArray[np.int32]:
        """Offset of each table's last row."""
        return np.asarray(self.first_row + np.diff(self.rows) - 1, dtype=np.int32)

    @property
    def reach_x(self) -> int:
        """Largest horizontal distance in pixels that any table covers, either way."""
        return int(np.abs(self.offset).max()) + 1

    @property
    def bytes_each(self) -> IntArray:
        """Memory of each table in bytes."""
        entries = self.row_end - self.row_begin
        of_entry = self.offset.itemsize + self.delta.itemsize * self.primaries
        of_row = self.row_begin.itemsize + self.row_end.itemsize + of_entry
        per_row = np.concatenate([[0], np.cumsum(of_row + entries * of_entry)])
        of_tables = per_row[self.rows[1:]] - per_row[self.rows[:-1]]
        return np.asarray(of_tables + self.first_row.itemsize + self.rows.itemsize)

    @property
    def nbytes(self) -> int:
        """Memory of the tables in bytes."""
        return sum(
            int(a.nbytes)
            for a in (
                self.first_row,
                self.rows,
                self.row_begin,
                self.row_end,
                self.offset,
                self.delta,
            )
        )


@dataclass(frozen=True, slots=True)
class PsfBuilder:
    """Makes tables for one lens on one film.

    Parameters
    ----------
    lens : Lens
        The focused lens with its aperture.
    film : Film
        The pixel grid that the tables are for.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged. The diffraction pattern of ``paper`` ends at the
        circle of confusion (TOG 1982, section 3.2), that of ``cycles`` fades out past it.
    settings : PsfSettings
        Kind of PSF and of tables.
    position : {"center", "corner"}
        Where samples lie on the pixel grid.
    shape : PupilShape or None
        Makes the tables where the pupil's image is more than blades, rotation and squeeze can say.

    Raises
    ------
    SettingsError
        If diffraction is asked of an aperture that is not round, or tables are to be interpolated where they
        differ over the field.
    """

    lens: Lens
    film: Film
    model: CocModel = "cycles"
    settings: PsfSettings = field(default_factory=PsfSettings)
    position: SamplePosition = "center"
    shape: PupilShape | None = None

    def __post_init__(self) -> None:
        if self.settings.kind == "lommel" and not (self.lens.is_round and self.shape is None):
            raise SettingsError(
                "Lommel's diffraction pattern is that of a round, clear and perfect aperture; "
                "set the blades to 0 and leave out what shapes the aperture, or choose the disc PSF."
            )
        if self.shape is not None and self.shape.is_cut and self.settings.lookup == "interpolated":
            raise SettingsError(
                "Between the shapes that mechanical vignetting cuts nothing is interpolated; "
                "choose the nearest table."
            )

    def assign(
        self, depth: npt.NDArray[np.floating], coverage: Float32Array | None = None
    ) -> TableAssignment:
        """Choose the tables for samples.

        Parameters
        ----------
        depth : ndarray of float
            Depths of the samples in metres, any shape, greater than 0; ``inf`` is valid.
        coverage : ndarray of float32 of the same shape (sheets, rows, columns), optional
            0 where there is no sample; such places get the table of the first sheet's.

        Returns
        -------
        TableAssignment
            Tables that are in use and the samples' indices into them.

        Raises
        ------
        SettingsError
            If more tables would be needed than is sensible.
        """
        settings = self.settings
        spacing = _EqualDepths if settings.tables == "equal-z" else _EqualCircles
        steps = spacing.create(self, depth)
        fraction = None if settings.lookup == "nearest" else np.empty(depth.shape, dtype=np.float32)
        index = np.empty(depth.shape, dtype=np.int32)
        steps.count(depth, coverage, index, fraction)
        first = int(index.min())
        if int(index.max()) - first > _MAX_STEPS:
            raise SettingsError(
                "The nearest and the farthest sample lie too many steps of tables apart; "
                "use a larger step between them or tables at equal steps of the circle."
            )
        index -= np.int32(first)
        used = tables_used(index, int(index.max()) + 1)
        if fraction is not None:
            used = np.append(used, False)
            used[1:] |= used[:-1].copy()
        values = np.flatnonzero(used)
        if values.size > MAX_TABLES:
            raise SettingsError(
                f"The picture needs {values.size} tables of point-spread functions and {MAX_TABLES} is the "
                "most; use a larger step between them or tables at equal steps of the circle."
            )
        renumber(index, used)
        return TableAssignment(circles=steps.circle(values + first), table=index, fraction=fraction)

    def tables(
        self, circles: FloatArray, side: IntArray | None = None, cell: IntArray | None = None
    ) -> Iterator[RowDifferences]:
        """Make tables one by one.

        Parameters
        ----------
        circles : ndarray of float64 of shape (tables,)
            Signed diameters of the circle of confusion in metres.
        side : ndarray of int64 of shape (tables,), optional
            Side of the block of samples that each table is for, a power of 2; by default 1.
        cell : ndarray of int64 of shape (tables,), optional
            Cell of the field that each table is for, see `pupil.field_cells`; by default the middle.

        Yields
        ------
        RowDifferences
            The table for each circle, normalised to 1.
        """
        sides = [1] * circles.size if side is None else side.tolist()
        if self.shape is not None:
            cells = [0] * circles.size if cell is None else cell.tolist()
            for circle, of_block, of_cell in zip(circles.tolist(), sides, cells, strict=True):
                yield self.shape.table(circle, of_block, of_cell, self.position)
        elif self.settings.kind == "lommel":
            yield from self._lommel_tables(circles, sides)
        elif self.lens.is_round:
            for circle, of_block in zip(np.abs(circles), sides, strict=True):
                yield _disc_rows(*self._radii(0.5 * float(circle)), self.position, of_block)
        else:
            for circle, of_block in zip(circles, sides, strict=True):
                yield self._polygon_table(float(circle), of_block)

    def _polygon_table(self, circle: float, side: int) -> RowDifferences:
        """Make the table of a block of samples, or take that of an earlier frame."""
        lens, film = self.lens, self.film
        iris = lens.blades, lens.blade_rotation, lens.anamorphic_ratio
        # Beyond the plane in focus the aperture's image stands upright, before it on its head.
        # Pixel rows count downwards.
        scale = 0.5 / film.pitch_x, -0.5 / film.pitch_y
        size = math.copysign(max(abs(circle), _LEAST_POLYGON * film.pitch_x), circle)

        def make() -> RowDifferences:
            return widened(polygon_rows(polygon_vertices(*iris) * scale * size, self.position), side)

        return KEPT_TABLES.get((iris, scale, size, self.position, side), make)

    def pack(self, tables: list[RowDifferences]) -> PackedTables:
        """Put tables into flat arrays.

        Entries are rounded to 25 binary digits of the table's largest. Times a colour's 24 digits they
        fit a double exactly, so that a row that was opened closes again without a trace, however bright
        the sample; a table's values change by 3e-8 of its largest.

        Parameters
        ----------
        tables : list of RowDifferences
            At least one, all of this builder's.

        Returns
        -------
        PackedTables
            The same tables.
        """
        entries = np.cumsum([0] + [t.offset.size for t in tables])
        row_begin = np.concatenate([t.row_begin + e for t, e in zip(tables, entries, strict=False)])
        row_end = np.concatenate([t.row_end + e for t, e in zip(tables, entries, strict=False)])
        delta = np.concatenate([_rounded(t) for t in tables])
        return PackedTables(
            first_row=np.array([t.first_row for t in tables], dtype=np.int32),
            rows=np.cumsum([0] + [t.row_begin.size for t in tables]),
            row_begin=row_begin,
            row_end=row_end,
            offset=np.concatenate([*(t.offset for t in tables), 0 * row_begin]).astype(np.int32),
            delta=np.concatenate([delta, _sums_of_rows(row_begin, row_end, delta)]),
            symmetric=tables[0].symmetric,
            mirror=np.array([t.mirror for t in tables], dtype=np.int32),
        )

    def _radii(self, radius: float) -> tuple[float, float]:
        """Return the semi-axes in pixels of a circle's image, squeezed by the anamorphic ratio."""
        ratio = self.lens.anamorphic_ratio
        return radius / self.film.pitch_x / ratio, radius / self.film.pitch_y

    def _optical_defocus(self, circles: FloatArray, wavelength: float) -> FloatArray:
        """Return |u| of the points that have these circles of confusion."""
        wave_number = 2.0 * math.pi / wavelength
        if self.model == "cycles":
            # The image plane is at F, so v = k (d/2F) r is exact and u is v at the circle's rim.
            return np.asarray(wave_number / (4.0 * self.lens.f_stop) * np.abs(circles))
        # TOG 1982, eq. 18, with V_P from c = d (V_D - V_P) / V_P.
        plane = float(image_distance(self.lens.focus_distance, self.lens.focal_length))
        shift = plane * circles / (self.lens.aperture_diameter + circles)
        return np.asarray(wave_number * (0.5 / self.lens.f_stop) ** 2 * np.abs(shift))

    def _lommel_tables(self, circles: FloatArray, sides: list[int]) -> Iterator[RowDifferences]:
        """Make diffraction tables, or take those of an earlier frame."""
        per_v = tuple(w * self.lens.f_stop / math.pi for w in self.settings.wavelengths)
        pixels_x, pixels_y = self._radii(1.0)
        step = min(self.film.pitch_x, self.film.pitch_y) / _ANNULI_PER_PIXEL
        optics = _Optics(per_v, pixels_x, pixels_y, step, self.position)
        margin = _DIFFRACTION_MARGIN * max(per_v) if self.model == "cycles" else 0.0
        defocus = np.stack([self._optical_defocus(circles, w) for w in self.settings.wavelengths], axis=1)
        for circle, u, side in zip(circles.tolist(), defocus.tolist(), sides, strict=True):
            radius = 0.5 * abs(circle)
            if max(u) > _LARGEST_U:
                disc = _disc_rows(radius * pixels_x, radius * pixels_y, self.position, side)
                yield replace(disc, delta=np.repeat(disc.delta, 3, axis=1))
                continue
            reach = max(radius + margin, step)
            pixels = max(radius, math.pi * max(per_v)) / (_ANNULI_PER_PIXEL * step)
            finer = 4 if pixels < 2.0 else 2 if pixels < 8.0 else 1
            yield _lommel_table(optics._replace(step=step / finer), tuple(u), reach, side)


class _Optics(NamedTuple):
    """What all diffraction tables of a picture share.

    Parameters
    ----------
    per_v : tuple of float
        Metres for each unit of v, for red, green and blue.
    pixels_x, pixels_y : float
        Pixels for each metre.
    step : float
        Width of an annulus in metres.
    position : {"center", "corner"}
        Where samples lie on the pixel grid.
    """

    per_v: tuple[float, ...]
    pixels_x: float
    pixels_y: float
    step: float
    position: SamplePosition

    def table(self, u: tuple[float, ...], reach: float) -> RowDifferences:
        """Return a single sample's table: a sum of discs, one for each annulus of the radial profile.

        The pattern is taken as constant over annuli, with exactly the light that the profile has in each.
        A stack of discs with exact pixel coverage then gives the pixel integrals.
        """
        step = self.step
        annuli = max(1, math.ceil(reach / step))
        mean = _annulus_means(u, tuple(step / per_v for per_v in self.per_v), annuli)
        # The last annulus is lit as far as the pattern reaches.
        inner = (annuli - 1) * step
        mean[-1] *= (reach**2 - inner**2) / ((annuli * step) ** 2 - inner**2)
        # Disc k, of radius (k + 1) step, lies under all annuli up to k.
        weights = mean - np.append(mean[1:], np.zeros((1, mean.shape[1])), axis=0)
        parts = [_disc_stack(self, first) for first in range(0, annuli, _STACKED)]
        quadrant = np.zeros((*parts[-1].shape_quadrant, weights.shape[1]))
        for k, part in enumerate(parts):
            rows, columns = part.shape_quadrant
            lit = weights[k * _STACKED : (k + 1) * _STACKED]
            added = part.stack @ lit if len(lit) == _STACKED else part.stack[:, : len(lit)] @ lit
            quadrant[:rows, :columns] += added.reshape(rows, columns, -1)
        return _rows_of_quadrant(quadrant, self.position)


def _lommel_table(optics: _Optics, u: tuple[float, ...], reach: float, side: int) -> RowDifferences:
    """Return the diffraction table of a block of samples, made where it is not kept."""
    key = optics, u, reach, side
    if side == 1:
        return KEPT_TABLES.get(key, lambda: optics.table(u, reach))
    return KEPT_TABLES.get(key, lambda: widened(_lommel_table(optics, u, reach, 1), side))


@dataclass(frozen=True, slots=True)
class _DiscStack:
    stack: sparse.csc_matrix
    shape_quadrant: tuple[int, int]


@functools.lru_cache(maxsize=64)
def _disc_stack(optics: _Optics, first: int) -> _DiscStack:
    """Return the row differences of some discs in one quadrant, from that of radius (first + 1) steps on."""
    data, row, column = [], [], []
    step_x, step_y = optics.step * optics.pixels_x, optics.step * optics.pixels_y
    last = first + _STACKED
    widest = ellipse_rows(last * step_x, last * step_y, optics.position)
    rows = widest.first_row + widest.row_begin.size
    columns = int(widest.offset.max()) + 1
    for k in range(first + 1, last + 1):
        disc = ellipse_rows(k * step_x, k * step_y, optics.position)
        lower = slice(-disc.first_row, None)
        of_row, entry = ragged(disc.row_begin[lower], (disc.row_end - disc.row_begin)[lower])
        data.append(disc.delta[entry, 0] * (math.pi * k * step_x * k * step_y))
        row.append(of_row * columns + disc.offset[entry])
        column.append(np.full(entry.size, k - 1 - first))
    stack = sparse.csc_matrix(
        (np.concatenate(data), (np.concatenate(row), np.concatenate(column))),
        shape=(rows * columns, _STACKED),
    )
    return _DiscStack(stack, (rows, columns))


def tables_used(table: npt.NDArray[np.int32], count: int) -> npt.NDArray[np.bool_]:
    """Return which tables any samples have.

    Parameters
    ----------
    table : ndarray of int32
        Each sample's table, any shape.
    count : int
        Number of tables.

    Returns
    -------
    ndarray of bool of shape (count,)
        True for those that are used.
    """
    used = np.zeros(count, dtype=np.bool_)
    if jit.HAVE_NUMBA:
        _mark_used(table.reshape(-1), used)
    else:
        used[table] = True
    return used


@jit.kernel()
def _mark_used(index: Any, used: Any) -> None:
    """Mark which numbers there are; numpy's ways of counting take three times as long."""
    for k in range(index.size):
        used[np.uint64(index[k])] = True


def renumber(table: npt.NDArray[np.int32], used: npt.NDArray[np.bool_]) -> None:
    """Give the tables that are used numbers from 0 on without gaps, in place.

    Parameters
    ----------
    table : ndarray of int32
        Each sample's table, any shape, C-contiguous.
    used : ndarray of bool of shape (count,)
        Which tables have a number then: all that samples have, at least.
    """
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    if jit.HAVE_NUMBA:
        _renumber(table.reshape(-1), number)
    else:
        table[:] = number[table]


@jit.kernel()
def _renumber(index: Any, number: Any) -> None:
    """Look up each number; numpy would first make all of them twice as large."""
    for k in range(index.size):
        index[k] = number[np.uint64(index[k])]


@jit.kernel(parallel=True)
def _count_steps(
    depth: Any, coverage: Any, scale: float, per_focus_distance: float, pitch: float, even_until: float,
    step: float, index: Any, fraction: Any,
) -> None:  # fmt: skip
    """Count steps up to the circle of each sample; a logarithm for few of them.

    `depth` is flat, in rows of sheets. Without fractions it is the nearest step.
    """
    for number in jit.prange(depth.shape[1]):
        k: Any = np.int64(number)
        for sheet in range(depth.shape[0]):
            if sheet > 0 and coverage[sheet, k] <= 0.0:
                index[sheet, k] = index[0, k]
                if fraction.size > 0:
                    fraction[sheet, k] = fraction[0, k]
                continue
            p = float(depth[sheet, k])
            circle = scale * (per_focus_distance - 1.0 / p) / pitch
            size = min(abs(circle), _LARGEST_CIRCLE)
            if size > even_until:
                size = even_until * (1.0 + math.log(size / even_until))
            position = min(max(math.copysign(size, circle) / step, -_FARTHEST_STEP), _FARTHEST_STEP)
            if fraction.size == 0:
                index[sheet, k] = np.int32(np.rint(position))
            else:
                below = math.floor(position)
                index[sheet, k] = np.int32(below)
                fraction[sheet, k] = position - below


def _rounded_steps(position: FloatArray, index: npt.NDArray[np.int32], fraction: Float32Array | None) -> None:
    """Split positions into whole steps and fractions, or round them."""
    np.clip(position, -_FARTHEST_STEP, _FARTHEST_STEP, out=position)
    if fraction is None:
        index[:] = np.rint(position)
        return
    index[:] = np.floor(position)
    fraction[:] = position - index


@dataclass(frozen=True, slots=True)
class _EqualCircles:
    """Steps equal in the circle's diameter up to a size, then equal in its ratio.

    Past that size a table differs from the next by less than half a percent of the circle, so a sample
    before the lens does not cost thousands of tables.
    """

    scale: float
    builder: PsfBuilder
    step: float
    even_until: float

    @classmethod
    def create(cls, builder: PsfBuilder, depth: npt.NDArray[np.floating]) -> _EqualCircles:
        del depth
        lommel = builder.settings.kind == "lommel"
        step = builder.settings.step or (0.25 if lommel else 0.125)
        return cls(builder.film.pitch_x, builder, step, even_until=max(16.0 if lommel else 32.0, 8.0 * step))

    def count(
        self,
        depth: npt.NDArray[np.floating],
        coverage: Float32Array | None,
        index: npt.NDArray[np.int32],
        fraction: Float32Array | None,
    ) -> None:
        lens, model = self.builder.lens, self.builder.model
        if jit.HAVE_NUMBA:
            sheets = depth.shape[0] if coverage is not None else 1
            nothing = np.zeros((0, 0), dtype=np.float32)
            _count_steps(
                depth.reshape(sheets, -1),
                nothing if coverage is None else coverage.reshape(sheets, -1),
                circle_scale(lens, model),
                1.0 / lens.focus_distance,
                self.scale,
                self.even_until,
                self.step,
                index.reshape(sheets, -1),
                nothing if fraction is None else fraction.reshape(sheets, -1),
            )
            return
        circle = circle_of_confusion(_there(depth, coverage), lens, model) / self.scale
        size = np.minimum(np.abs(circle), _LARGEST_CIRCLE)
        with np.errstate(divide="ignore"):
            grown = self.even_until * (1.0 + np.log(size / self.even_until))
        size = np.where(size <= self.even_until, size, grown)
        _rounded_steps(np.sign(circle) * size / self.step, index, fraction)

    def circle(self, index: IntArray) -> FloatArray:
        size = np.abs(index) * self.step
        grown = self.even_until * np.exp(np.maximum(size / self.even_until - 1.0, 0.0))
        return np.asarray(np.sign(index) * np.where(size <= self.even_until, size, grown) * self.scale)


@dataclass(frozen=True, slots=True)
class _EqualDepths:
    """Steps equal in depth between the nearest and the farthest sample (TOG 1982, section 3.2).

    Samples at infinity, which the papers' closed scenes have not, share one table after the last.
    """

    builder: PsfBuilder
    nearest: float
    step: float
    last: int

    @classmethod
    def create(cls, builder: PsfBuilder, depth: npt.NDArray[np.floating]) -> _EqualDepths:
        finite = depth[np.isfinite(depth)]
        if finite.size == 0:
            return cls(builder, nearest=1.0, step=1.0, last=0)
        nearest, farthest = float(finite.min()), float(finite.max())
        step = builder.settings.step or max((farthest - nearest) / 1000.0, 1e-6)
        return cls(builder, nearest, step, last=math.ceil((farthest - nearest) / step))

    def count(
        self,
        depth: npt.NDArray[np.floating],
        coverage: Float32Array | None,
        index: npt.NDArray[np.int32],
        fraction: Float32Array | None,
    ) -> None:
        depth = _there(depth, coverage).astype(np.float64)
        # One index is left free so that interpolation never reaches the table of infinity.
        position = np.where(np.isfinite(depth), (depth - self.nearest) / self.step, self.last + 2.0)
        _rounded_steps(position, index, fraction)

    def circle(self, index: IntArray) -> FloatArray:
        depth = np.where(index >= self.last + 2, math.inf, self.nearest + index * self.step)
        circle = circle_of_confusion(depth, self.builder.lens, self.builder.model)
        limit = _LARGEST_CIRCLE * self.builder.film.pitch_x
        return np.clip(circle, -limit, limit)


def _there(depth: npt.NDArray[Any], coverage: Float32Array | None) -> npt.NDArray[Any]:
    """Return depths with those of the first sheet where there is no sample."""
    return depth if coverage is None else np.where(coverage > 0.0, depth, depth[:1])


def circles_for_filtered_samples(circles: FloatArray, pitch: float) -> FloatArray:
    """Return circles whose tables spread the samples of a filtered picture as their own circles would.

    A table is integrated over pixels (TOG 1982, eq. 23), as a point of light is seen. The samples of an
    ordinary render are filtered already, and once is enough: the table to take is the one whose variance is
    that of the circle without a pixel, a quarter of the radius squared.

    Parameters
    ----------
    circles : ndarray of float64
        Signed diameters in metres.
    pitch : float
        Distance between pixels in metres.

    Returns
    -------
    ndarray of float64
        Signed diameters in metres, the same shape; up to half a pixel wider or narrower.
    """
    radius = 0.5 * np.abs(circles) / pitch
    tabulated, variance = _variances()
    wanted = 0.25 * radius * radius
    # Far past a pixel the integration adds its variance of 1/12, whatever the radius.
    far = np.sqrt(np.maximum(radius * radius - 1.0 / 3.0, 0.0))
    matched = np.where(wanted < variance[-1], np.interp(wanted, variance, tabulated), far)
    return np.asarray(np.copysign(2.0 * pitch * np.where(radius < _SHARP, radius, matched), circles))


@functools.cache
def _variances() -> tuple[FloatArray, FloatArray]:
    """Return radii in pixels from half a pixel, which spreads nothing, and the variances of their tables."""
    radius: FloatArray = np.arange(0.5, 8.0, 0.05, dtype=np.float64)
    variance: FloatArray = np.empty(radius.size)
    for k, r in enumerate(radius.tolist()):
        values = ellipse_rows(r, r).dense()[0].sum(axis=0)
        at = np.arange(values.size) - values.size // 2
        variance[k] = values @ (at * at)
    return radius, variance


@functools.lru_cache(maxsize=2048)
def _disc_rows(radius_x: float, radius_y: float, position: SamplePosition, side: int) -> RowDifferences:
    """Return a disc's table; frame after frame has circles of the same steps."""
    return widened(ellipse_rows(radius_x, radius_y, position), side)


def _rounded(table: RowDifferences) -> FloatArray:
    """Return a table's entries as multiples of one power of two that close every row exactly."""
    unit = 2.0 ** (math.floor(math.log2(float(np.abs(table.delta).max()))) + 1 - _DELTA_BITS)
    delta = np.rint(table.delta / unit)
    if not table.symmetric:
        filled = table.row_end > table.row_begin
        begin, last = table.row_begin[filled], table.row_end[filled] - 1
        delta[last] -= np.add.reduceat(delta, begin, axis=0)
    return np.asarray(delta * unit)


def _sums_of_rows(row_begin: IntArray, row_end: IntArray, delta: FloatArray) -> FloatArray:
    """Return what the entries of each row add up to."""
    sums = np.zeros((row_begin.size, delta.shape[1]))
    filled = np.flatnonzero(row_end > row_begin)
    bounds = np.stack([row_begin[filled], row_end[filled]], axis=1).reshape(-1)
    # The last bound is where the entries end, for which reduceat wants one more.
    padded = np.concatenate([delta, np.zeros((1, delta.shape[1]))])
    sums[filled] = np.add.reduceat(padded, bounds, axis=0)[::2]
    return sums


def _annulus_means(u: tuple[float, ...], widths: tuple[float, ...], count: int) -> FloatArray:
    """Return the mean intensity in annuli of equal width in v, by Gauss-Legendre in each.

    Parameters
    ----------
    u, widths : tuple of float
        Defocus and the annuli's width in v, for each primary.
    count : int
        Number of annuli.

    Returns
    -------
    ndarray of float64 of shape (count, primaries)
        Means relative to I(0, 0).
    """
    edges = np.arange(count)[:, np.newaxis]
    rules = [_gauss(max(3, math.ceil(width * _NODES_PER_RADIAN))) for width in widths]
    v = [
        width * (edges + 0.5 * (nodes + 1.0)).reshape(-1)
        for width, (nodes, _) in zip(widths, rules, strict=True)
    ]
    sizes = [part.size for part in v]
    intensity = lommel_intensity(np.repeat(u, sizes), np.concatenate(v))
    parts = np.split(intensity * np.concatenate(v), np.cumsum(sizes)[:-1])
    means = [
        part.reshape(count, -1) @ weights / (width * (2.0 * edges[:, 0] + 1.0))
        for part, width, (_, weights) in zip(parts, widths, rules, strict=True)
    ]
    return np.stack(means, axis=1)


@functools.cache
def _gauss(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of a Gauss-Legendre rule."""
    return np.polynomial.legendre.leggauss(nodes)


def _rows_of_quadrant(quadrant: FloatArray, position: SamplePosition) -> RowDifferences:
    """Return a table from its lower right quadrant of row differences, normalised to 1.

    Parameters
    ----------
    quadrant : ndarray of shape (rows, columns, primaries)
        Differences of pixel values along the rows; column 0, where symmetry leaves none, is 0.
    position : {"center", "corner"}
        Where samples lie on the pixel grid.
    """
    mirror = 1 if position == "center" else 0
    last = int(np.flatnonzero(np.abs(quadrant).max(axis=(1, 2)) > 0.0).max())
    quadrant = quadrant[: last + 1]
    # The value of a column is minus the sum of the differences beyond it, since the last one is 0.
    values = -np.cumsum(quadrant[:, ::-1], axis=1)[:, ::-1]
    beyond = np.concatenate([values[:, 1:], np.zeros_like(values[:, :1])], axis=1)
    total = 2.0 * beyond.sum(axis=1) - mirror * beyond[:, 0]
    total = 2.0 * total.sum(axis=0) - mirror * total[0]
    row, column = np.nonzero(np.abs(quadrant).max(axis=2) > 0.0)
    rows = np.arange(last + 1)
    begin, end = np.searchsorted(row, rows), np.searchsorted(row, rows, side="right")
    return RowDifferences(
        first_row=-(last + 1) + mirror,
        row_begin=np.concatenate([begin[mirror:][::-1], begin]),
        row_end=np.concatenate([end[mirror:][::-1], end]),
        offset=column,
        delta=quadrant[row, column] / total,
        position=position,
        symmetric=True,
    )
