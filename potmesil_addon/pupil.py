"""The pupil: which light an aperture lets through, and the image of it that a point out of focus becomes.

Pupil coordinates have the aperture's rim at radius 1, x right and y up, *before* the anamorphic squeeze,
which divides x by the ratio afterwards. A ray through the pupil at p lands on the film at::

    p (c / 2 - L / (2 n^3) |p|^2)

from the chief ray's place, with the signed circle of confusion c, the f-stop n and the longitudinal
spherical aberration L of f/1 (third order). An evenly lit pupil without aberration is exact: polygons,
in O(radius) row differences. Any other is a quadrature over its cells.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from .aperture import (
    KEPT_TABLES,
    IntArray,
    RowDifferences,
    SamplePosition,
    ellipse_rows,
    polygon_rows,
    polygon_vertices,
    widened,
)
from .camera import Film
from .effects import ChromaticAberration, Pupil, Vignetting
from .errors import SettingsError
from .images import on_change, read_image
from .lens import FloatArray, Lens

_ROUND: Final = 128
"""Corners, about, of a polygon for a round rim: its sagitta is 3e-4 of the radius, a pixel of 3000."""

_LEAST_DIAMETER: Final = 1e-3
"""Diameter in pixels below which a pupil's image is drawn no smaller, so that it keeps an area."""

_CELLS_PER_PIXEL: Final = 2.0
"""Cells of the quadrature for each pixel of an image, each way."""

_LEAST_CELLS: Final = 64
_MOST_CELLS: Final = 2048

_RINGS: Final = 6
"""Rings of the field in which the barrel cuts the same shape; ring k has 6 k parts."""

_LEAST_CUT: Final = 4.0
"""Diameter of a circle in pixels from which the barrel's cut is a matter of shape."""

_COARSE: Final = 24.0
"""Circles that the barrel cuts while the diameter grows e times: each is within 2 % of its own."""


class Barrel(NamedTuple):
    """The two ends of a lens's barrel, as seen through its pupil.

    Parameters
    ----------
    x, y : float
        Where the far end's rim lies in pupil coordinates; the near end's is opposite.
    radius : float
        Of both.
    """

    x: float
    y: float
    radius: float


def outline(lens: Lens, pupil: Pupil | None = None) -> FloatArray:
    """Return the rim of the aperture as a polygon.

    Parameters
    ----------
    lens : Lens
        Blades and their rotation.
    pupil : Pupil, optional
        Curvature of the blades: an arc through two corners, from the straight chord (0) to the circle
        through all corners (1).

    Returns
    -------
    ndarray of float64 of shape (n, 2)
        Corners (x, y) in pupil coordinates, counter-clockwise.
    """
    curvature = 0.0 if pupil is None else pupil.blade_curvature
    if lens.is_round or curvature == 1.0:
        # Of the same area as the circle.
        radius = math.sqrt(2.0 * math.pi / (_ROUND * math.sin(2.0 * math.pi / _ROUND)))
        angle = 2.0 * math.pi * np.arange(_ROUND) / _ROUND
        return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = polygon_vertices(lens.blades, lens.blade_rotation, 1.0)
    if curvature == 0.0:
        return corners
    radius, arc = blade_arc(lens.blades, curvature)
    half = math.pi / lens.blades
    sagitta = curvature * (1.0 - math.cos(half))
    along = np.linspace(-arc, arc, 2 * math.ceil(0.5 * _ROUND / lens.blades), endpoint=False)
    x, y = radius * np.cos(along) - radius + math.cos(half) + sagitta, radius * np.sin(along)
    middle = lens.blade_rotation + 2.0 * math.pi * np.arange(lens.blades)[:, np.newaxis] / lens.blades
    turned = np.stack([np.cos(middle) * x - np.sin(middle) * y, np.sin(middle) * x + np.cos(middle) * y], 2)
    return np.asarray(turned.reshape(-1, 2))


def blade_arc(blades: int, curvature: float) -> tuple[float, float]:
    """Return the radius of a curved blade's rim, and half of the angle by which it turns.

    Parameters
    ----------
    blades : int
        At least 3.
    curvature : float
        Greater than 0, up to 1: the sagitta grows evenly from 0 to the circle's.

    Returns
    -------
    tuple of float
        In pupil coordinates, and in radians.
    """
    half = math.pi / blades
    chord, sagitta = math.sin(half), curvature * (1.0 - math.cos(half))
    radius = (chord * chord + sagitta * sagitta) / (2.0 * sagitta)
    return radius, math.asin(min(chord / radius, 1.0))


def transmission(lens: Lens, pupil: Pupil | None, size: int, barrel: Barrel | None = None) -> FloatArray:
    """Return what share of light each cell of the square [-1, 1]^2 around the pupil lets through.

    Parameters
    ----------
    lens : Lens
        Blades and rotation. The anamorphic ratio does not count: pupil coordinates have no squeeze.
    pupil : Pupil or None
        The aperture's shape beyond them.
    size : int
        Cells along each side, even.
    barrel : Barrel, optional
        What cuts it.

    Returns
    -------
    ndarray of float64 of shape (size, size)
        From 0 to 1, row 0 on top; exact areas at the rim.

    Raises
    ------
    InputError
        If the aperture's picture cannot be read.
    """
    pupil = pupil or Pupil()
    if pupil.image:
        clear = _picture(pupil.image, size)
        if barrel is not None:
            clear = clear * _covered([(_opening(barrel), 1.0)], size)
    elif barrel is None and (lens.is_round or pupil.blade_curvature == 1.0):
        # Without corners, which would diffract.
        clear = np.clip(_round_cells(1.0, size) - _round_cells(pupil.obstruction, size), 0.0, 1.0)
    else:
        clear = _covered(_shapes(lens, pupil, barrel), size)
    if pupil.apodisation > 0.0:
        middle = (np.arange(size) + 0.5) * (2.0 / size) - 1.0
        falling = np.exp(-pupil.apodisation * middle**2)
        clear = clear * falling * falling[:, np.newaxis]
    return np.asarray(clear)


@dataclass(frozen=True, slots=True)
class PupilShape:
    """Makes tables of a pupil's image for one lens on one film, where it is more than blades can say.

    Parameters
    ----------
    lens : Lens
        Blades, rotation, squeeze and f-stop.
    film : Film
        The pixel grid.
    pupil : Pupil or None
        Shape, apodisation, spherical aberration.
    chromatic : ChromaticAberration or None
        Where red and blue focus.
    vignetting : Vignetting or None
        The barrel.
    """

    lens: Lens
    film: Film
    pupil: Pupil | None = None
    chromatic: ChromaticAberration | None = None
    vignetting: Vignetting | None = None

    @property
    def is_cut(self) -> bool:
        """Whether the shape varies over the field."""
        return self.vignetting is not None and self.vignetting.mechanical > 0.0

    @property
    def aberration(self) -> float:
        """How far rays of the pupil's rim land from where they would without aberration, in metres."""
        if self.pupil is None:
            return 0.0
        return -self.pupil.spherical_aberration / (2.0 * self.lens.f_stop**3)

    @property
    def colors(self) -> tuple[float, ...]:
        """What is added to a circle's diameter in metres for each primary; one number where all are alike."""
        chromatic = self.chromatic
        if chromatic is None or chromatic.focus_red == chromatic.focus_blue == 0.0:
            return (0.0,)
        return -chromatic.focus_red / self.lens.f_stop, 0.0, -chromatic.focus_blue / self.lens.f_stop

    def barrel(self, cell: int) -> Barrel | None:
        """Return the barrel as it cuts in a cell of the field; see `field_cells`."""
        if not self.is_cut:
            return None
        assert self.vignetting is not None
        x, y = _middle_of(cell)
        return barrel_at(self.lens, self.vignetting, x, y)

    def table(self, circle: float, side: int, cell: int, position: SamplePosition) -> RowDifferences:
        """Return the table of a circle of confusion, normalised to 1, made where it is not kept.

        Parameters
        ----------
        circle : float
            Signed diameter in metres.
        side : int
            Side of the block of samples that it is for.
        cell : int
            Cell of the field.
        position : {"center", "corner"}
            Where samples lie on the pixel grid.

        Returns
        -------
        RowDifferences
            Without symmetry; for each primary where `colors` differ.
        """
        key = self, circle, side, cell, position
        if side == 1:
            return KEPT_TABLES.get(key, lambda: self._make(circle, cell, position))
        return KEPT_TABLES.get(key, lambda: widened(self.table(circle, 1, cell, position), side))

    def _make(self, circle: float, cell: int, position: SamplePosition) -> RowDifferences:
        barrel = self.barrel(cell)
        tables = [self._image(circle + more, barrel, position) for more in self.colors]
        return tables[0] if len(tables) == 1 else _merged(tables)

    def _image(self, circle: float, barrel: Barrel | None, position: SamplePosition) -> RowDifferences:
        """Return the table of one primary."""
        pupil = self.pupil or Pupil()
        per_x, per_y = self._scale
        if self.aberration == pupil.apodisation == 0.0 and not pupil.image:
            least = _LEAST_DIAMETER / max(per_x, per_y)
            radius = 0.5 * math.copysign(max(abs(circle), least), circle)
            shapes = _shapes(self.lens, pupil, barrel)
            scale = [radius * per_x, -radius * per_y]
            tables = [polygon_rows(shape * scale, position) for shape, _ in shapes]
            areas = np.array([sign * polygon_area(shape) for shape, sign in shapes])
            if len(tables) == 1:
                return tables[0]
            merged = _merged(tables)
            return replace(merged, delta=merged.delta @ areas[:, np.newaxis] / areas.sum())
        return self._quadrature(0.5 * circle, barrel, position)

    @property
    def _scale(self) -> tuple[float, float]:
        """Pixels for each metre across, squeezed, and down."""
        return 1.0 / self.film.pitch_x / self.lens.anamorphic_ratio, 1.0 / self.film.pitch_y

    def _quadrature(self, radius: float, barrel: Barrel | None, position: SamplePosition) -> RowDifferences:
        """Return the table of a pupil that is not evenly lit, or whose rays do not meet in a point.

        Each cell of the pupil is a box on the film, as large as it is imaged, over the pixels around it.
        """
        per_x, per_y = self._scale
        widest = max(abs(radius), abs(radius + self.aberration), abs(radius + 3.0 * self.aberration))
        wanted = 2.0 * widest * max(per_x, per_y) * _CELLS_PER_PIXEL
        size = 1 << math.ceil(math.log2(min(max(wanted, _LEAST_CELLS), _MOST_CELLS)))
        clear = _kept_transmission(self.lens, self.pupil, size, barrel)
        row, column = np.nonzero(clear)
        u, v = (column + 0.5) * (2.0 / size) - 1.0, 1.0 - (row + 0.5) * (2.0 / size)
        square = u * u + v * v
        stretch = radius + self.aberration * square
        box = np.abs(radius + 2.0 * self.aberration * square) * (2.0 / size)
        half = 0.5 if position == "center" else 0.0
        x, y = u * stretch * per_x + half, -v * stretch * per_y + half
        return _boxes(x, y, box * per_x, box * per_y, clear[row, column], position)


def barrel_at(lens: Lens, vignetting: Vignetting, x: float, y: float) -> Barrel:
    """Return the ends of the barrel as a place of the field sees them.

    From the side the two rims, one before the aperture and one behind it, lie apart; light that passes both
    and the aperture has the form of a cat's eye. Stopping down makes the aperture smaller and leaves them.

    Parameters
    ----------
    lens : Lens
        Its f-stop.
    vignetting : Vignetting
        The barrel.
    x, y : float
        Place on the film, x right and y up in the picture, 1 in its corner.

    Returns
    -------
    Barrel
        In pupil coordinates.
    """
    fastest = vignetting.fastest_f_stop
    stopped = max(lens.f_stop / fastest, 1.0) if fastest > 0.0 else 1.0
    shift = vignetting.mechanical * stopped
    return Barrel(shift * x, shift * y, stopped)


def clear_share(lens: Lens, pupil: Pupil | None, barrel: Barrel) -> float:
    """Return what share of the pupil's light passes the barrel."""
    pupil = pupil or Pupil()
    if pupil.image or pupil.apodisation > 0.0:
        whole = _kept_transmission(lens, pupil, 2 * _LEAST_CELLS, None).sum()
        return float(transmission(lens, pupil, 2 * _LEAST_CELLS, barrel).sum() / whole)
    whole, cut = (
        sum(math.copysign(polygon_area(shape), weight) for shape, weight in _shapes(lens, pupil, b))
        for b in (None, barrel)
    )
    return cut / whole


def field_cells(x: FloatArray, y: FloatArray) -> IntArray:
    """Return in which cell of the field places lie.

    Parameters
    ----------
    x, y : ndarray of float64
        Places on the film, 1 in the picture's corner; what is farther out counts as in the last ring.

    Returns
    -------
    ndarray of int64
        0 in the middle; ring k has the 6 k cells from 1 + 3 k (k - 1) on.
    """
    ring = np.minimum(np.rint(np.hypot(x, y) * _RINGS), _RINGS).astype(np.int64)
    parts = np.maximum(6 * ring, 1)
    part = np.rint(np.arctan2(y, x) * parts / (2.0 * math.pi)).astype(np.int64) % parts
    return np.asarray(np.where(ring == 0, 0, 1 + 3 * ring * (ring - 1) + part))


def _middle_of(cell: int) -> tuple[float, float]:
    """Return the place on the film in the middle of a cell."""
    if cell == 0:
        return 0.0, 0.0
    ring = int((3.0 + math.sqrt(12.0 * cell - 3.0)) / 6.0)
    angle = 2.0 * math.pi * (cell - 1 - 3 * ring * (ring - 1)) / (6 * ring)
    return ring / _RINGS * math.cos(angle), ring / _RINGS * math.sin(angle)


def circle_in_cells(circles: FloatArray, pitch: float) -> FloatArray:
    """Return circles at equal ratios for those whose shape the barrel cuts, so that shapes stay few.

    Parameters
    ----------
    circles : ndarray of float64
        Signed diameters in metres.
    pitch : float
        Distance between pixels in metres.

    Returns
    -------
    ndarray of float64
        The same for those too small to show a shape.
    """
    size = np.abs(circles) / pitch
    coarse = np.exp(np.rint(np.log(np.maximum(size, 1.0)) * _COARSE) / _COARSE)
    return np.asarray(np.where(size < _LEAST_CUT, circles, np.copysign(coarse * pitch, circles)))


def shows_its_cut(circles: FloatArray, pitch: float) -> npt.NDArray[np.bool_]:
    """Return which circles are large enough to show what the barrel cuts off."""
    return np.asarray(np.abs(circles) >= _LEAST_CUT * pitch)


def _shapes(lens: Lens, pupil: Pupil, barrel: Barrel | None) -> list[tuple[FloatArray, float]]:
    """Return polygons with the signs with which their areas make the pupil, in pupil coordinates."""
    rim = outline(lens, pupil)
    shapes = [(rim, 1.0)]
    if pupil.obstruction > 0.0:
        shapes.append((pupil.obstruction * _circle(), -1.0))
    if barrel is not None:
        shapes = [(_through(barrel, shape), weight) for shape, weight in shapes]
        shapes = [
            (shape, weight) for shape, weight in shapes if len(shape) > 2 and polygon_area(shape) > 1e-6
        ]
    if not shapes:
        raise SettingsError("The barrel covers all of the aperture in the corners; lower its vignetting.")
    return shapes


def clipped(polygon: FloatArray, middle: FloatArray, disc: FloatArray) -> FloatArray:
    """Return the part of a convex polygon within a disc.

    Its corners are the polygon's within the disc, the disc's within the polygon, and where edges cross the
    rim; about a point inside of a convex shape their order is that of their angles.

    Parameters
    ----------
    polygon : ndarray of float64 of shape (n, 2)
        Corners, counter-clockwise.
    middle : ndarray of float64 of shape (2,)
        The disc's.
    disc : ndarray of float64 of shape (k, 2)
        Corners of a polygon for its rim, counter-clockwise.

    Returns
    -------
    ndarray of float64 of shape (m, 2)
        Corners, counter-clockwise; fewer than three where nothing is left.
    """
    radius = float(np.hypot(*(disc[0] - middle)))
    start, along = polygon - middle, np.roll(polygon, -1, axis=0) - polygon
    # |start + t along| = radius
    a, b = (along * along).sum(axis=1), (start * along).sum(axis=1)
    root = b * b - a * ((start * start).sum(axis=1) - radius * radius)
    meets = (root > 0.0) & (a > 0.0)
    crossings = []
    for sign in (-1.0, 1.0):
        t = np.divide(sign * np.sqrt(np.maximum(root, 0.0)) - b, a, out=np.full_like(a, -1.0), where=meets)
        on_edge = (t >= 0.0) & (t < 1.0)
        crossings.append((polygon + t[:, np.newaxis] * along)[on_edge])
    to_disc = disc[:, np.newaxis] - polygon
    left_of_edges = (along[:, 0] * to_disc[..., 1] - along[:, 1] * to_disc[..., 0] >= 0.0).all(axis=1)
    inside = (start * start).sum(axis=1) <= radius * radius
    corners = np.concatenate([polygon[inside], disc[left_of_edges], *crossings])
    if len(corners) == 0:
        return polygon[:0]
    away = corners - corners.mean(axis=0)
    return np.asarray(corners[np.argsort(np.arctan2(away[:, 1], away[:, 0]))])


def _circle() -> FloatArray:
    return outline(Lens(1.0, 1.0, 1.0))


def _through(barrel: Barrel, shape: FloatArray) -> FloatArray:
    """Return the part of a convex polygon that passes both ends of a barrel."""
    for sign in (1.0, -1.0):
        middle = sign * np.array([barrel.x, barrel.y])
        if len(shape) > 0:
            shape = clipped(shape, middle, barrel.radius * _circle() + middle)
    return shape


def _opening(barrel: Barrel) -> FloatArray:
    """Return all that passes both ends of a barrel."""
    return _through(barrel, (barrel.radius + math.hypot(barrel.x, barrel.y)) * _circle())


def polygon_area(polygon: FloatArray) -> float:
    """Return the area of a polygon with counter-clockwise corners (x, y), y up."""
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _round_cells(radius: float, size: int) -> FloatArray:
    """Return which share of each cell a disc around the middle covers."""
    covered = np.zeros((size, size))
    if radius > 0.0:
        table = ellipse_rows(0.5 * radius * size, 0.5 * radius * size, "corner").dense()[0]
        first = size // 2 - table.shape[0] // 2
        inside = slice(first, first + table.shape[0])
        covered[inside, inside] = table * (math.pi * (0.5 * radius * size) ** 2)
    return covered


def _covered(shapes: list[tuple[FloatArray, float]], size: int) -> FloatArray:
    """Return which share of each cell shapes cover."""
    covered = np.zeros((size, size))
    for shape, weight in shapes:
        scaled = shape * [0.5 * size, -0.5 * size]
        table = polygon_rows(scaled, "corner")
        values = table.dense()[0] * abs(polygon_area(scaled))
        # Around the sample on the corner in the middle; a disc's polygon may reach past the square.
        top, left = table.first_row + size // 2, size // 2 - values.shape[1] // 2
        rows = slice(max(top, 0), min(top + values.shape[0], size))
        columns = slice(max(left, 0), min(left + values.shape[1], size))
        inside = values[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
        covered[rows, columns] += weight * inside
    return np.clip(covered, 0.0, 1.0)


@functools.lru_cache(maxsize=64)
def _kept_transmission(lens: Lens, pupil: Pupil | None, size: int, barrel: Barrel | None) -> FloatArray:
    values = transmission(lens, pupil, size, barrel)
    values.flags.writeable = False
    return values


@functools.lru_cache(maxsize=8)
def _picture(path: str, size: int) -> FloatArray:
    """Return the brightness of an aperture's picture, 1 where it is brightest, over the square."""
    grey = read_image(Path(path)).astype(np.float64).mean(axis=2)
    grey = np.clip(grey, 0.0, None)
    if not grey.max() > 0.0:
        raise SettingsError(f"'{path}' is black and lets no light through; choose another picture.")
    zoomed = ndimage.zoom(grey, (size / grey.shape[0], size / grey.shape[1]), order=1, grid_mode=True,
                          mode="nearest")  # fmt: skip
    return np.asarray(zoomed / zoomed.max())


on_change(_picture.cache_clear)
on_change(_kept_transmission.cache_clear)
on_change(KEPT_TABLES.clear)


def _boxes(
    x: FloatArray, y: FloatArray, width: FloatArray, height: FloatArray, light: FloatArray,
    position: SamplePosition,
) -> RowDifferences:  # fmt: skip
    """Return the table of light in boxes of at most a pixel; x and y from the sample's own pixel's corner."""
    left, top = np.floor(x - 0.5 * width), np.floor(y - 0.5 * height)
    # Share of a box left of, and above, the pixel's border within it.
    across = np.clip((left + 1.0 - x) / np.maximum(width, 1e-9) + 0.5, 0.0, 1.0)
    down = np.clip((top + 1.0 - y) / np.maximum(height, 1e-9) + 0.5, 0.0, 1.0)
    column, row = left.astype(np.int64), top.astype(np.int64)
    first_row, first_column = int(row.min()), int(column.min())
    shape = int(row.max()) - first_row + 2, int(column.max()) - first_column + 2
    place = (row - first_row) * shape[1] + column - first_column
    values = np.zeros(shape[0] * shape[1])
    for j, share_down in ((0, down), (1, 1.0 - down)):
        for i, share_across in ((0, across), (1, 1.0 - across)):
            weights = light * share_down * share_across
            values += np.bincount(place + j * shape[1] + i, weights, values.size)
    return _rows_of(values.reshape(shape) / values.sum(), first_row, first_column, position)


def _rows_of(
    values: FloatArray, first_row: int, first_column: int, position: SamplePosition
) -> RowDifferences:
    """Return pixel values as row differences."""
    filled = np.flatnonzero(values.any(axis=1))
    values = values[filled[0] : filled[-1] + 1]
    delta = np.diff(values, axis=1, prepend=0.0, append=0.0)
    row, column = np.nonzero(delta)
    rows = np.arange(values.shape[0])
    return RowDifferences(
        first_row=first_row + int(filled[0]),
        row_begin=np.searchsorted(row, rows, side="left"),
        row_end=np.searchsorted(row, rows, side="right"),
        offset=column + first_column,
        delta=delta[row, column][:, np.newaxis],
        position=position,
        symmetric=False,
    )


def _merged(tables: list[RowDifferences]) -> RowDifferences:
    """Return one table with a column of entries for each of some tables of one column."""
    first_row = min(table.first_row for table in tables)
    rows = np.arange(first_row, max(table.first_row + table.row_begin.size for table in tables))
    left = min(int(table.offset.min()) for table in tables)
    width = max(int(table.offset.max()) for table in tables) - left + 1
    places = [
        (np.repeat(np.arange(t.row_begin.size), t.row_end - t.row_begin) + t.first_row - first_row) * width
        + t.offset
        - left
        for t in tables
    ]
    place, number = np.unique(np.concatenate(places), return_inverse=True)
    delta = np.zeros((place.size, len(tables)))
    of_table = np.repeat(np.arange(len(tables)), [part.size for part in places])
    delta[number, of_table] = np.concatenate([table.delta[:, 0] for table in tables])
    row, offset = np.divmod(place, width)
    return RowDifferences(
        first_row=first_row,
        row_begin=np.searchsorted(row, rows - first_row, side="left"),
        row_end=np.searchsorted(row, rows - first_row, side="right"),
        offset=offset + left,
        delta=delta,
        position=tables[0].position,
        symmetric=False,
    )
