"""The point-spread function of a motion: the light along the path of an image (1983, section 3.1).

An object whose image moves by r'(t) during the exposure leaves, at each place, light in proportion to
the time it is there: the density along the path is 1 / speed (1983, eq. 3-9). Paths are kept as
straight pieces, each with the share of the light that falls while the image passes it evenly, and are
integrated over pixels without sampling. Displacements are in pixels, x right and y down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy import fft

from .aperture import ragged
from .errors import SettingsError
from .lens import FloatArray
from .shutter import Shutter

Interpolation = Literal["box", "linear"]
"""``box`` gives an instant to the pixel it lies in, ``linear`` shares it among the four around it."""

ConvolutionMethod = Literal["auto", "spatial", "frequency", "separable"]

INTERPOLATIONS: Final[tuple[Interpolation, ...]] = get_args(Interpolation)
CONVOLUTION_METHODS: Final[tuple[ConvolutionMethod, ...]] = get_args(ConvolutionMethod)

MAX_ENTRIES: Final = 1 << 25
"""Largest table: a path across a picture of 8K."""

_FLATNESS: Final = 0.02
"""Largest change of the light along a piece that counts as even, over the shutter's largest light."""

_TRACE: Final = 1e-15
"""Share of the light below which a pixel's is rounding, such as a path leaves that cuts a pixel's corner."""

_RANK_TOLERANCE: Final = 1e-12
"""Distance from an outer product, over the table's largest entry, that is rounding."""

_BLOCK: Final = 1 << 14
"""Values that are worked on at once, so that they stay in the processor's nearer memory."""

_TRANSFORM_COST: Final = 1.0
"""Cost of a real 2-D transform of n values, over that of n log2(n) multiply-adds of the spatial sum.

Measured on pictures of 300 x 300 to 1920 x 1080: 0.3 to 0.6 ns for each n log2(n) of a transform with its
share of the product, against 0.4 to 0.6 ns for a multiply-add.
"""


@dataclass(frozen=True, slots=True)
class ExposedPath:
    """Straight pieces of a path and the light that falls while the image passes each at an even speed.

    Pieces need not join: between two openings of a multiple exposure there is no light.

    Parameters
    ----------
    segments : ndarray of float64 of shape (k, 2, 2)
        Begin and end (x, y) of each piece: displacement in pixels from where the object was rendered,
        x right and y down. Where both are the same the image rests.
    light : ndarray of float64 of shape (k,)
        Share of the exposure that falls on each piece, 0 or more.

    Raises
    ------
    SettingsError
        If there are no pieces, a number is not finite, light is negative or there is none.
    """

    segments: FloatArray
    light: FloatArray

    def __post_init__(self) -> None:
        if self.light.size == 0 or self.segments.shape != (self.light.size, 2, 2):
            raise SettingsError("A motion path needs one share of light for each of its pieces, and a piece.")
        if not (np.isfinite(self.segments).all() and np.isfinite(self.light).all()):
            raise SettingsError("A motion path has a place or light that is no number; check the animation.")
        if (self.light < 0.0).any() or not self.light.any():
            raise SettingsError("The light along a motion path must be 0 or more, and not 0 everywhere.")

    @classmethod
    def polyline(cls, places: npt.ArrayLike, light: npt.ArrayLike) -> ExposedPath:
        """Return a path whose pieces join.

        Parameters
        ----------
        places : array_like of shape (k + 1, 2)
            Vertices (x, y) in pixels, x right and y down.
        light : array_like of shape (k,)
            Share of the exposure that falls on each piece.

        Returns
        -------
        ExposedPath
            The path.

        Raises
        ------
        SettingsError
            As for the class.
        """
        vertices = np.asarray(places, dtype=np.float64).reshape(-1, 2)
        return cls(np.stack([vertices[:-1], vertices[1:]], axis=1), np.asarray(light, dtype=np.float64))

    @property
    def mean(self) -> FloatArray:
        """Mean displacement (x, y) in pixels over the light."""
        return np.asarray(self.light @ self.segments.mean(axis=1) / self.light.sum())


@dataclass(frozen=True, slots=True)
class MotionPsf:
    """A motion's response on the pixel grid, h of 1983, eq. 3-9.

    Parameters
    ----------
    table : ndarray of float64 of shape (rows, columns)
        Share of a sample's energy that falls on each pixel, 0 or more; the sum is 1, or less where the
        table was cut to a reach. Every border has an entry that is not 0, unless nothing is left.
    first_row, first_column : int
        Offset of the table's first row and column from the sample, of any sign; rows count down.
    """

    table: FloatArray
    first_row: int
    first_column: int

    def separated(self) -> tuple[FloatArray, FloatArray] | None:
        """Return the two one-dimensional functions whose product is this one (1983, eq. 2-12).

        Returns
        -------
        row : ndarray of float64 of shape (columns,)
            h1, the horizontal function; its sum is 1.
        column : ndarray of float64 of shape (rows,)
            h2, the vertical one; its sum is the table's.
            ``None`` instead of both where the table is no outer product to rounding (1e-12 of its
            largest entry). Level, upright and resting paths always are one.
        """
        # If the table is a product, its sums along the rows and columns are the factors.
        total = float(self.table.sum())
        column = self.table.sum(axis=1)
        row = self.table.sum(axis=0) / (total or 1.0)
        off = np.abs(self.table - np.multiply.outer(column, row)).max()
        return (row, column) if off <= _RANK_TOLERANCE * self.table.max() else None


def path_of(shutter: Shutter, times: npt.ArrayLike, places: npt.ArrayLike) -> ExposedPath:
    """Return the path that a shutter sees of a motion: r'(t) of 1983, eq. 3-2, with the light along it.

    Where the shutter opens or closes slowly, pieces are cut until the light changes by less than 2 % of
    its largest along each. The light of every piece is exact.

    Parameters
    ----------
    shutter : Shutter
        When light is let in. The slit of a focal-plane shutter only moves the times of each row, which
        `places` must already have.
    times : array_like of shape (n,)
        Positions in the shutter's interval, increasing, 0 where it begins and 1 where it ends.
    places : array_like of shape (n, 2)
        Displacement (x, y) in pixels at these times, x right and y down. Between them the image moves
        evenly; before the first and after the last it rests.

    Returns
    -------
    ExposedPath
        Pieces in order of time, none where no light falls; the light's sum is 1.

    Raises
    ------
    SettingsError
        If the times do not increase, the shapes do not fit or a number is not finite.
    """
    t = np.asarray(times, dtype=np.float64)
    r = np.asarray(places, dtype=np.float64)
    if t.ndim != 1 or t.size == 0 or r.shape != (t.size, 2):
        raise SettingsError("A motion path needs one place (x, y) for each of its times, and a time.")
    if not (np.isfinite(t).all() and np.isfinite(r).all()):
        raise SettingsError("A motion path has a time or place that is no number; check the animation.")
    if (np.diff(t) <= 0.0).any():
        raise SettingsError("The times of a motion path must increase.")
    t0, t1, d0, d1 = shutter.pieces().T
    edges = np.union1d(np.concatenate([t0, t1]), t[(t > t0[0]) & (t < t1[-1])])
    piece = np.searchsorted(t0, edges[:-1], side="right") - 1
    inside = edges[:-1] < t1[piece]
    begin, end, piece = edges[:-1][inside], edges[1:][inside], piece[inside]
    slope = (d1 - d0) / (t1 - t0)
    moving = (_at(begin, t, r) != _at(end, t, r)).any(axis=1)
    change = np.abs(slope[piece]) * (end - begin) / max(d0.max(), d1.max())
    cuts = np.where(moving, np.maximum(np.ceil(change / _FLATNESS), 1.0), 1.0).astype(np.int64)
    owner, number = ragged(np.zeros_like(cuts), cuts)
    width = ((end - begin) / cuts)[owner]
    begin, end = begin[owner] + number * width, begin[owner] + (number + 1) * width
    piece = piece[owner]
    light = (d0[piece] + slope[piece] * (0.5 * (begin + end) - t0[piece])) * (end - begin)
    # Rounding must not make the dark end of a curve negative.
    light = np.maximum(light, 0.0)
    lit = light > 0.0
    segments = np.stack([_at(begin, t, r), _at(end, t, r)], axis=1)[lit]
    return ExposedPath(segments, light[lit] / light.sum())


def motion_psf(
    path: ExposedPath, interpolation: Interpolation = "box", reach: tuple[int, int] | None = None
) -> MotionPsf:
    """Integrate the light along a path over pixels (1983, eq. 3-9).

    A pixel is the unit square around an integer displacement. ``box`` gives it the light that falls while
    the image of the sample is within the square, which is the paper's PSF under the pixel
    integral of eq. 2-10. A path that runs along the border of two pixels, and an image at rest on a
    border or corner, is shared evenly by the pixels that meet there, so that a mirrored path has
    the mirrored table. ``linear`` shares each instant among the four pixels around it by their
    distance (the integral of the path with a tent two pixels wide): it keeps the mean displacement
    exactly, and an image that rests half a pixel away is blurred over two pixels instead of being moved
    to one. Both are exact sums over the parts of the path between the lines of the grid, not
    samples of it.

    Parameters
    ----------
    path : ExposedPath
        Pieces in pixels, x right and y down, with their light.
    interpolation : {"box", "linear"}
        How an instant falls on pixels.
    reach : tuple of int, optional
        Largest (vertical, horizontal) offset of interest, 0 or more: the picture's size, for a path that
        leaves it by far. The rest of the path costs nothing and its light is left out.

    Returns
    -------
    MotionPsf
        The table, normalised to 1; times the exposure it is energy.

    Raises
    ------
    SettingsError
        If the path covers too many pixels.
    """
    if interpolation not in INTERPOLATIONS:
        raise SettingsError(f"Interpolation is one of {', '.join(INTERPOLATIONS)}, not '{interpolation}'.")
    lit = path.light > 0.0
    segments, light = path.segments[lit], path.light[lit] / path.light.sum()
    if reach is not None:
        segments, light = _within(segments, light, np.array([reach[1], reach[0]]) + 1.0)
        if light.size == 0:
            return MotionPsf(np.zeros((1, 1)), 0, 0)
    # Wide enough for any way of sharing an instant.
    low = np.floor(segments.min(axis=(0, 1))) - 1.0
    size = np.ceil(segments.max(axis=(0, 1))) + 2.0 - low
    if not size.prod() <= MAX_ENTRIES:
        raise SettingsError(
            f"An object moves over {size[0]:.0f} x {size[1]:.0f} pixels during the exposure, too many for "
            "one point-spread function; shorten the exposure or hide the object."
        )
    part, t0, t1 = _cut_by_grid(segments, 0.5 if interpolation == "box" else 0.0)
    begin = segments[part, 0] + t0[:, np.newaxis] * (segments[part, 1] - segments[part, 0])
    end = segments[part, 0] + t1[:, np.newaxis] * (segments[part, 1] - segments[part, 0])
    share_of = _box_shares if interpolation == "box" else _tent_shares
    pixel, share = share_of(begin, end)
    share *= (light[part] * (t1 - t0))[:, np.newaxis]
    columns, rows = size.astype(np.int64)
    index = (pixel[..., 1] - low[1]) * columns + (pixel[..., 0] - low[0])
    sums = np.bincount(
        index.astype(np.int64).reshape(-1), weights=share.reshape(-1), minlength=rows * columns
    )
    table = np.asarray(sums, dtype=np.float64).reshape(rows, columns)
    table[table < _TRACE] = 0.0
    first_row, first_column = int(low[1]), int(low[0])
    if reach is not None:
        table[np.abs(np.arange(rows) + first_row) > reach[0]] = 0.0
        table[:, np.abs(np.arange(columns) + first_column) > reach[1]] = 0.0
    used_rows, used_columns = np.flatnonzero(table.any(axis=1)), np.flatnonzero(table.any(axis=0))
    if used_rows.size == 0:
        return MotionPsf(np.zeros((1, 1)), 0, 0)
    top, left = int(used_rows[0]), int(used_columns[0])
    table = table[top : used_rows[-1] + 1, left : used_columns[-1] + 1].copy()
    return MotionPsf(table, first_row + top, first_column + left)


def convolve(
    image: npt.NDArray[np.floating], psf: MotionPsf, method: ConvolutionMethod = "auto"
) -> npt.NDArray[np.float32]:
    """Blur a picture by a motion within its own window (1983, eqs. 2-10 and 2-11).

    Beyond its window the picture is black, and what moves out of it is lost.

    Parameters
    ----------
    image : ndarray of float of shape (rows, columns, channels)
        Picture; colours, the time band or anything else that the motion moves, all finite.
    psf : MotionPsf
        The motion.
    method : {"auto", "spatial", "frequency", "separable"}
        See `convolve_full`.

    Returns
    -------
    ndarray of float32, the shape of `image`
        The blurred picture.

    Raises
    ------
    SettingsError
        As for `convolve_full`.
    """
    _check_image(image)
    rows, columns = image.shape[:2]
    # Entries that move all of the picture out of its window would only make the work larger.
    top, bottom = np.clip([1 - rows - psf.first_row, rows - psf.first_row], 0, psf.table.shape[0])
    left, right = np.clip([1 - columns - psf.first_column, columns - psf.first_column], 0, psf.table.shape[1])
    result = np.zeros(image.shape, dtype=np.float32)
    table = psf.table[top:bottom, left:right]
    if not table.any():
        return result
    near = MotionPsf(table, psf.first_row + int(top), psf.first_column + int(left))
    full, first_row, first_column = convolve_full(image, near, method)
    to_rows, from_rows = _overlap(rows, first_row, full.shape[0])
    to_columns, from_columns = _overlap(columns, first_column, full.shape[1])
    result[to_rows, to_columns] = full[from_rows, from_columns]
    return result


def convolve_full(
    image: npt.NDArray[np.floating], psf: MotionPsf, method: ConvolutionMethod = "auto"
) -> tuple[npt.NDArray[np.float32], int, int]:
    """Blur a picture by a motion, with all that the motion carries out of the picture's window.

    Sums are kept in double precision. The methods agree to a millionth of the picture's largest value.
    ``spatial`` is eq. 2-10 of 1983 over the entries that are not 0, which a path has few of;
    ``separable`` does so in one direction after the other (eq. 2-12); ``frequency`` is eq. 2-11, with
    the picture enlarged by black so that nothing wraps around. What is black stays black but
    for rounding, of either sign and about 1e-15 of the picture's largest value, with ``frequency``;
    with the others it is 0. Nothing is clipped, because a caller that divides by a time band has
    to treat little time as none anyway.

    ``auto`` takes what costs least, in multiply-adds, of (with C channels and N pixels of result)
    entries x N C, (rows + columns of the table) x N C where it is separable, and
    (2 C + 1) N log2 N, whose terms take as long as was measured.

    Parameters
    ----------
    image : ndarray of float of shape (rows, columns, channels)
        Picture, all finite.
    psf : MotionPsf
        The motion.
    method : {"auto", "spatial", "frequency", "separable"}
        How it is done.

    Returns
    -------
    image : ndarray of float32 of shape (rows + table rows - 1, columns + table columns - 1, channels)
        The blurred picture.
    first_row, first_column : int
        Where its first pixel lies from the first of `image`.

    Raises
    ------
    SettingsError
        If the image has another shape, or the separable method is asked for a table that is no product.
    """
    _check_image(image)
    if method not in CONVOLUTION_METHODS:
        raise SettingsError(
            f"A convolution's method is one of {', '.join(CONVOLUTION_METHODS)}, not '{method}'."
        )
    factors = psf.separated() if method in ("auto", "separable") else None
    if method == "auto":
        method = _cheapest(image.shape, psf, factors is not None)
    if method == "frequency":
        result = _frequency(image, psf.table)
    elif method == "spatial":
        result = _spatial(image, psf.table).astype(np.float32)
    elif factors is not None:
        row, column = factors
        result = _spatial(_spatial(image, column[:, np.newaxis]), row[np.newaxis]).astype(np.float32)
    else:
        raise SettingsError(
            "This motion is neither level nor upright, so its point-spread function is no product of two; "
            "choose the spatial or frequency method."
        )
    return result, psf.first_row, psf.first_column


def uniform_transfer(u: npt.ArrayLike, a: float, exposure: float = 1.0) -> npt.NDArray[np.complex128]:
    """Return the transfer function of even motion (1983, eq. 3-14).

    H(u) = T sin(pi u a)/(pi u a) e^{-j pi u a}. The paper's eq. 3-13 lost a u in the exponent: it is the
    integral of e^{-j 2 pi u x0(t)}.

    Parameters
    ----------
    u : array_like
        Frequency in cycles per pixel along the motion.
    a : float
        Displacement in pixels during the exposure, of either sign; 0 gives T.
    exposure : float
        Exposure time T; 1 for a PSF normalised to 1.

    Returns
    -------
    ndarray of complex128, the shape of `u`
        H(u), for the transform with e^{-j 2 pi u x}.
    """
    ua = np.asarray(u, dtype=np.float64) * a
    return np.asarray(exposure * np.sinc(ua) * np.exp(-1j * np.pi * ua))


def uniform_response(x: npt.ArrayLike, a: float, exposure: float = 1.0) -> FloatArray:
    """Return the PSF of even motion: ``T / |a|`` between 0 and a, 0 elsewhere (1983, eq. 3-15).

    Parameters
    ----------
    x : array_like
        Displacement in pixels.
    a : float
        Displacement in pixels during the exposure, of either sign, which the paper has positive; not 0.
    exposure : float
        Exposure time T; 1 for a PSF normalised to 1.

    Returns
    -------
    ndarray of float64, the shape of `x`
        Energy per pixel of length.

    Raises
    ------
    SettingsError
        If nothing moves: the response is then an impulse, which has no values.
    """
    if not (math.isfinite(a) and a != 0.0):
        raise SettingsError(f"The response to even motion needs a displacement that is not 0, not {a:g}.")
    along = np.asarray(x, dtype=np.float64) / a
    return np.asarray(np.where((along >= 0.0) & (along <= 1.0), exposure / abs(a), 0.0))


def focal_plane_transfer(u: npt.ArrayLike, d: float) -> FloatArray:
    """Return the transfer function of a focal-plane shutter's slit (1983, eq. 3-16).

    ``1 - |u| / d`` for ``|u| < d``, and 0 beyond. This is the optical transfer function of a slit (Shack
    1964): the overlap of the slit with itself shifted by u, which is the blur of the slit itself as an
    aperture across its width. That the slit travels, so that each part of the film has its own times,
    is no part of it; `Shutter.slit` has it.

    Parameters
    ----------
    u : array_like
        Frequency across the slit, in the units of `d`.
    d : float
        Frequency at which nothing is transferred any more, greater than 0: for the paper the slit's
        width over the aperture's radius, in units in which a full aperture of that radius ends at 2.

    Returns
    -------
    ndarray of float64, the shape of `u`
        Transfer from 0 to 1; the same at u and -u, and no phase. The paper leaves u = 0 out, where it is 1.

    Raises
    ------
    SettingsError
        If `d` is not greater than 0.
    """
    _check_cutoff(d)
    return np.asarray(np.maximum(1.0 - np.abs(np.asarray(u, dtype=np.float64)) / d, 0.0))


def focal_plane_response(x: npt.ArrayLike, d: float) -> FloatArray:
    """Return the PSF whose transform is `focal_plane_transfer`: d sinc^2(d x), of integral 1.

    Parameters
    ----------
    x : array_like
        Displacement across the slit, in one over the units of `d`.
    d : float
        As for `focal_plane_transfer`.

    Returns
    -------
    ndarray of float64, the shape of `x`
        Diffraction pattern of a slit, sinc(x) = sin(pi x)/(pi x).

    Raises
    ------
    SettingsError
        If `d` is not greater than 0.
    """
    _check_cutoff(d)
    return np.asarray(d * np.sinc(d * np.asarray(x, dtype=np.float64)) ** 2)


def motion_transfer(path: ExposedPath, u: npt.ArrayLike, v: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    """Return the transform of the light along a path: the integral of e^{-j 2 pi (u x + v y)} dt.

    The integral of 1983, eq. 3-12, for motion in any direction. A straight piece gives the sinc of
    eq. 3-14 with the phase of its middle. It knows no pixels: the table of `motion_psf` with ``box``
    has, summed over all aliases, this times sinc(u) sinc(v); with ``linear`` these squared.

    Parameters
    ----------
    path : ExposedPath
        Pieces with their light.
    u, v : array_like
        Frequencies in cycles per pixel, horizontal and vertical (down), of shapes that broadcast.

    Returns
    -------
    ndarray of complex128, the shape of `u` and `v` together
        H(u, v); at 0 the path's light.
    """
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    total = np.zeros(u.shape, dtype=np.complex128)
    # One piece at a time: all of them times all frequencies may not fit into memory.
    for (begin, end), light in zip(path.segments, path.light, strict=True):
        step, middle = end - begin, 0.5 * (begin + end)
        phase = np.exp(-2j * np.pi * (u * middle[0] + v * middle[1]))
        total += light * np.sinc(u * step[0] + v * step[1]) * phase
    return total


def _check_cutoff(d: float) -> None:
    if not (math.isfinite(d) and d > 0.0):
        raise SettingsError(f"A focal-plane shutter's slit must be wider than 0, not {d:g}.")


def _check_image(image: npt.NDArray[np.floating]) -> None:
    if image.ndim != 3 or image.size == 0:
        raise SettingsError(f"A picture to blur has rows, columns and channels, not the shape {image.shape}.")


def _at(when: FloatArray, times: FloatArray, places: FloatArray) -> FloatArray:
    """Return places (n, 2) at times, linearly between the stored ones."""
    return np.stack([np.interp(when, times, places[:, axis]) for axis in (0, 1)], axis=1)


def _within(segments: FloatArray, light: FloatArray, reach: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the parts of pieces where |x| <= reach[0] and |y| <= reach[1], with their light."""
    begin, step = segments[:, 0], segments[:, 1] - segments[:, 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        crossings = np.stack([(-reach - begin) / step, (reach - begin) / step])
    still = step == 0.0
    outside = still & (np.abs(begin) > reach)
    enter = np.where(still, 0.0, crossings.min(axis=0)).max(axis=1)
    leave = np.where(still, 1.0, crossings.max(axis=0)).min(axis=1)
    enter, leave = np.clip(enter, 0.0, 1.0), np.clip(leave, 0.0, 1.0)
    # A piece that only touches the border from outside is left with no light.
    keep = (leave > enter) & ~outside.any(axis=1)
    ends = begin[:, np.newaxis] + np.stack([enter, leave], axis=1)[..., np.newaxis] * step[:, np.newaxis]
    return ends[keep], (light * (leave - enter))[keep]


def _cut_by_grid(segments: FloatArray, shift: float) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
    """Cut pieces where x + shift or y + shift is an integer.

    Returns
    -------
    piece : ndarray of int64 of shape (n,)
        Which piece each part is of.
    begin, end : ndarray of float64 of shape (n,)
        Where on the piece the part begins and ends, from 0 to 1.
    """
    count = segments.shape[0]
    pieces, crossings = [np.arange(count), np.arange(count)], [np.zeros(count), np.ones(count)]
    for axis in (0, 1):
        a, b = segments[:, 0, axis] + shift, segments[:, 1, axis] + shift
        # Lines strictly between the ends.
        first = np.floor(np.minimum(a, b)).astype(np.int64) + 1
        lines = np.maximum(np.ceil(np.maximum(a, b)).astype(np.int64) - first, 0)
        owner, line = ragged(first, lines)
        pieces.append(owner)
        crossings.append((line - a[owner]) / (b[owner] - a[owner]))
    piece, t = np.concatenate(pieces), np.clip(np.concatenate(crossings), 0.0, 1.0)
    order = np.lexsort((t, piece))
    piece, t = piece[order], t[order]
    # Through a corner two lines are crossed at once; nothing lies between them.
    keep = (piece[1:] == piece[:-1]) & (t[1:] > t[:-1])
    return piece[:-1][keep], t[:-1][keep], t[1:][keep]


def _box_shares(begin: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the pixels (n, 4, 2) of parts within one pixel or along its border, and shares (n, 4)."""
    middle = 0.5 * (begin + end)
    # The same pixel but on a border, where they are the two that meet there.
    below, above = np.ceil(middle - 0.5), np.floor(middle + 0.5)
    return _four(below, above), np.full((middle.shape[0], 4), 0.25)


def _tent_shares(begin: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the pixels (n, 4, 2) around parts within one cell of pixel centres, and shares (n, 4).

    Along a part both weights change evenly, and the mean of the product of two such is the product
    of their means and a twelfth of the product of their changes.
    """
    cell = np.floor(0.5 * (begin + end))
    begin, end = np.clip(begin - cell, 0.0, 1.0), np.clip(end - cell, 0.0, 1.0)
    x, y = 0.5 * (begin + end).T
    both = (end - begin).prod(axis=1) / 12.0
    shares = [(1.0 - x) * (1.0 - y) + both, x * (1.0 - y) - both, (1.0 - x) * y - both, x * y + both]
    # A part that ends on a pixel's own row or column could be left with a share below 0 by rounding.
    return _four(cell, cell + 1.0), np.maximum(np.stack(shares, axis=1), 0.0)


def _four(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the corners (n, 4, 2) of boxes between (x, y) low and high, x first."""
    x = np.stack([low[:, 0], high[:, 0], low[:, 0], high[:, 0]], axis=1)
    y = np.stack([low[:, 1], low[:, 1], high[:, 1], high[:, 1]], axis=1)
    return np.stack([x, y], axis=2)


def _overlap(size: int, first: int, other: int) -> tuple[slice, slice]:
    """Return where a range of `other` from `first` lies in one of `size` from 0, in both their indices."""
    begin, end = max(first, 0), min(first + other, size)
    return slice(begin, max(end, begin)), slice(begin - first, max(end, begin) - first)


def _cheapest(shape: tuple[int, ...], psf: MotionPsf, separable: bool) -> ConvolutionMethod:
    """Return the method that needs the fewest multiply-adds."""
    rows, columns = psf.table.shape
    n, channels = (shape[0] + rows - 1) * (shape[1] + columns - 1), shape[2]
    costs: dict[ConvolutionMethod, float] = {
        "spatial": float(np.count_nonzero(psf.table)) * n * channels,
        "frequency": _TRANSFORM_COST * (2 * channels + 1) * n * math.log2(n + 1),
    }
    if separable:
        costs["separable"] = float(rows + columns) * n * channels
    return min(costs, key=lambda method: costs[method])


def _spatial(image: npt.NDArray[np.floating], table: FloatArray) -> FloatArray:
    """Return the full convolution, one multiply-add of the picture for each entry that is not 0."""
    rows, columns, channels = image.shape
    shape = (rows + table.shape[0] - 1, columns + table.shape[1] - 1, channels)
    wide = np.zeros((rows, *shape[1:]))
    wide[:, :columns] = image
    # In rows as wide as the result's an offset is one number; only black runs over into the next row.
    source, result = wide.reshape(-1), np.zeros(math.prod(shape))
    row, column = np.nonzero(table)
    entries = list(
        zip(((row * shape[1] + column) * channels).tolist(), table[row, column].tolist(), strict=True)
    )
    # The black at the end of the last row would run over the result's end.
    last = source.size - (shape[1] - columns) * channels
    # Not by BLAS: its threads wait for each other, at a hundred times the cost where the cores are busy.
    for begin in range(0, last, _BLOCK):
        block = source[begin : min(begin + _BLOCK, last)]
        product = np.empty_like(block)
        for shift, value in entries:
            np.multiply(block, value, out=product)
            result[begin + shift : begin + shift + block.size] += product
    return result.reshape(shape)


def _frequency(image: npt.NDArray[np.floating], table: FloatArray) -> npt.NDArray[np.float32]:
    """Return the full convolution by real transforms, one channel after the other to save memory."""
    rows, columns = image.shape[0] + table.shape[0] - 1, image.shape[1] + table.shape[1] - 1
    size = (fft.next_fast_len(rows, real=True), fft.next_fast_len(columns, real=True))
    transfer = fft.rfft2(table, size)
    result = np.empty((rows, columns, image.shape[2]), dtype=np.float32)
    for channel in range(image.shape[2]):
        spectrum = fft.rfft2(image[..., channel].astype(np.float64), size)
        spectrum *= transfer
        result[..., channel] = fft.irfft2(spectrum, size, overwrite_x=True)[:rows, :columns]
    return result
