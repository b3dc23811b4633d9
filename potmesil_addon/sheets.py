"""From samples to sheets and a background: what moves, what it hides, and where surfaces part.

Colours of an ordinary render are anti-aliased, its depths, indices and vectors are not. A moving
object's edge is therefore un-mixed: C = a F + (1 - a) B, with B what lies behind (rendered, or filled
in) and F the object's own colour beside the edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage, spatial

from .lens import FloatArray
from .samples import BRIGHT, Float32Array, SampleLayer, Samples, Window
from .tracks import Mask, Tracks, nearest_known, spread
from .warp import NO_QUAD, NO_TRACK, QUAD, TORN_QUAD, VECTOR_TRACK, Background

DEPTH_STEP: Final = 0.03
"""Relative difference of inverse depths from which neighbours may be of different surfaces."""

_TORN: Final = 0.5
"""Pixels by which neighbours of different surfaces part before the surface between them is torn."""

_STRETCHED: Final = 64.0
"""Pixels by which neighbours of one surface may part; vectors that are noise part them by more."""

_EDGE: Final = 2
"""Pixels on either side of an object's outline whose colours may be mixed."""

_SAME_COLOR: Final = 1e-3
"""Difference of colours, relative to their size, below which an edge cannot be un-mixed and need not be."""

_OFF_THE_LINE: Final = 0.2
"""Distance of an edge's colour from the line between its two surfaces', as a share of that line."""

_PIXEL_FILTER: Final = (0.25, 0.5, 0.25)
"""About the weights that Cycles' default pixel filter gives three pixels in a row."""

_SQUARES: Final = 1e15
"""Light whose squares are past single precision's range."""

_LEAST_OUTLINE: Final = 3
"""Pixels, each way, below which an object has no outline to speak of."""

_MOST_OUTLINES: Final = 64
"""Objects above which none is completed behind another; many small ones hide little of each other."""

_SOLID: Final = 0.5

_AROUND: Final = ndimage.generate_binary_structure(2, 2)


_ROWS_AT_ONCE: Final = 128
"""Rows whose colours are taken apart together."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """One sheet's samples on the data window; see `warp.Sheets`."""

    color: Float32Array
    inverse_depth: Float32Array
    tracks: Tracks
    guessed: Float32Array
    surface: npt.NDArray[np.int32]


def inverse_depth(layer: SampleLayer) -> Float32Array:
    """Return 1/z' of a layer's samples, 0 at infinity and where the layer has no depth."""
    if layer.depth is None:
        return np.zeros(layer.color.shape[:2], dtype=np.float32)
    return np.asarray(1.0 / layer.depth, dtype=np.float32)


def whole_sheet(layer: SampleLayer, tracks: Tracks) -> Sheet:
    """Return a layer as one sheet."""
    return Sheet(
        layer.color, inverse_depth(layer), tracks, np.zeros(layer.color.shape[:2], np.float32),
        _surface(layer, tracks),
    )  # fmt: skip


def rendered_movers(moving: SampleLayer, tracks: Tracks) -> Sheet:
    """Return moving objects that were rendered alone, their edges in their alpha.

    Parameters
    ----------
    moving : SampleLayer
        The moving objects on a transparent film.
    tracks : Tracks
        Their paths.

    Returns
    -------
    Sheet
        The objects with a rim of transparent samples that move with them.
    """
    depths = inverse_depth(moving)
    shown = moving.color[..., 3] > 0.0
    known = shown & (tracks.track != NO_TRACK)
    if moving.depth is not None:
        known &= np.isfinite(moving.depth)
    if not known.any():
        return _no_movers(moving, tracks)
    rim = ndimage.binary_dilation(shown, _AROUND)
    surface = _surface(moving, tracks)
    tracks, nearest = spread(tracks, known, rim)
    return Sheet(moving.color, depths[nearest], tracks, np.zeros(shown.shape, np.float32), surface[nearest])


def cut_out_movers(
    layer: SampleLayer, tracks: Tracks, moves: Mask
) -> tuple[Sheet, Float32Array, Float32Array, Float32Array]:
    """Take moving objects out of a picture and fill in what they hide.

    Parameters
    ----------
    layer : SampleLayer
        The ordinary render.
    tracks : Tracks
        Paths of its samples.
    moves : ndarray of bool of shape (rows, columns)
        Which samples move.

    Returns
    -------
    movers : Sheet
        The moving objects with un-mixed edges.
    color : ndarray of float32 of shape (rows, columns, 4)
        The picture without them.
    depth : ndarray of float32 of shape (rows, columns)
        Its inverse depth.
    guessed : ndarray of float32 of shape (rows, columns)
        1 where it was filled in.
    """
    depths = inverse_depth(layer)
    surface = _surface(layer, tracks)
    band = ndimage.binary_dilation(moves, _AROUND, _EDGE)
    nearest = nearest_known(moves)
    # A nearer surface at rest covers the object: its pixels are neither mixed with it nor behind it.
    before = ~moves & (depths > depths[nearest] * (1.0 + DEPTH_STEP))
    covered = before & _within_outlines(surface, moves)
    hole = (band & ~before) | moves
    source = ~band & (depths <= depths[nearest] * (1.0 + DEPTH_STEP))
    for instead in (~band, ~moves, np.ones_like(moves)):
        if not source.any():
            source = instead
    filled = np.dstack([layer.color, depths])
    fill_in(filled, source, hole)
    behind = filled[..., :4]
    inner = ndimage.binary_erosion(moves, _AROUND, border_value=1)
    front = _mean_around(layer.color, inner if inner.any() else moves, hole)
    # Where a covering surface ends the object does not: that is no edge of it.
    edge = hole & ~inner & ~ndimage.binary_dilation(covered, _AROUND)
    alpha = np.where(edge, _unmixed(layer.color, front, behind, moves), moves.astype(np.float32))
    del front, inner, source, before
    color = layer.color * moves[..., np.newaxis]
    of_edge = alpha[edge][:, np.newaxis]
    color[edge] = np.maximum(layer.color[edge] - (1.0 - of_edge) * behind[edge], 0.0)
    color[edge, 3] = np.minimum(color[edge, 3], of_edge[:, 0])
    if covered.any():
        # Colours at the cover's edge are mixed with it; deeper inside they are the object's own.
        known = moves & ~ndimage.binary_dilation(covered, _AROUND, _EDGE)
        unknown = ndimage.binary_dilation(covered, _AROUND, _EDGE) & (moves | covered)
        fill_in(color, known if known.any() else moves, unknown)
    uncovered = hole & (alpha > 0.0)
    still = np.where(uncovered[..., np.newaxis], behind, layer.color)
    in_front = depths[nearest]
    # What is filled in lies behind the object that was seen there.
    depths = np.where(hole, np.minimum(filled[..., 4], in_front), depths)
    del filled, behind, alpha
    own = tracks.select(nearest, hole | covered)
    movers = Sheet(color, in_front, own, covered.astype(np.float32), surface[nearest])
    return movers, still, depths, uncovered.astype(np.float32)


def covered_movers(sheet: Sheet) -> Sheet | None:
    """Fill in what nearer moving objects hide of farther ones.

    Parameters
    ----------
    sheet : Sheet
        Moving objects.

    Returns
    -------
    Sheet or None
        Of each object the part within its convex outline that another one covers, in its own colours and
        at its own depth, with the samples beside it; ``None`` where none covers another.
    """
    there = (sheet.tracks.track != NO_TRACK) & (sheet.color[..., 3] > _SOLID)
    numbers = np.unique(sheet.surface[there])
    if not 1 < numbers.size <= _MOST_OUTLINES:
        return None
    color, iz = sheet.color.copy(), sheet.inverse_depth.copy()
    taken = np.full(there.shape, -1.0, dtype=np.float32)
    source = np.indices(there.shape, dtype=np.int64)
    covered, rim = np.zeros(there.shape, dtype=bool), np.zeros(there.shape, dtype=bool)
    for number in numbers:
        own = there & (sheet.surface == number)
        found = _outline(own)
        if found is None:
            continue
        part, inside = found
        mine, others = own[part], there[part] & ~own[part]
        nearest = ndimage.distance_transform_edt(~mine, return_indices=True, return_distances=False)
        depth = sheet.inverse_depth[part][tuple(nearest)]
        hidden = inside & others & (sheet.inverse_depth[part] > depth * (1.0 + DEPTH_STEP))
        hidden &= depth > taken[part]
        if not hidden.any():
            continue
        # Colours at the cover's edge are mixed with it.
        known = mine & ~ndimage.binary_dilation(hidden, _AROUND, _EDGE)
        filled = sheet.color[part].copy()
        fill_in(filled, known if known.any() else mine, hidden)
        color[part][hidden], iz[part][hidden] = filled[hidden], depth[hidden]
        taken[part][hidden] = depth[hidden]
        for axis in (0, 1):
            source[axis][part][hidden] = nearest[axis][hidden] + part[axis].start
        covered[part] |= hidden
        rim[part] |= mine & ndimage.binary_dilation(hidden, _AROUND)
    if not covered.any():
        return None
    indices = (source[0], source[1])
    return Sheet(
        color,
        iz,
        sheet.tracks.select(indices, covered | rim),
        covered.astype(np.float32),
        sheet.surface[indices],
    )


def _within_outlines(surface: npt.NDArray[np.int32], moves: Mask) -> Mask:
    """Return which pixels lie within the convex outline of an object that moves."""
    inside = np.zeros(moves.shape, dtype=bool)
    for number in np.unique(surface[moves]):
        found = _outline(moves & (surface == number))
        if found is not None:
            inside[found[0]] |= found[1]
    return inside


def _outline(mask: Mask) -> tuple[tuple[slice, slice], Mask] | None:
    """Return the convex outline of some pixels, filled, on the rectangle around them."""
    points = np.argwhere(mask)
    low, high = points.min(axis=0), points.max(axis=0) + 1
    if min(high - low) < _LEAST_OUTLINE:
        return None
    try:
        outline = spatial.ConvexHull(points)
    except spatial.QhullError:  # all in one line
        return None
    grid = np.moveaxis(np.indices(high - low), 0, -1) + low
    inside = (grid @ outline.equations[:, :2].T + outline.equations[:, 2] <= 0.0).all(axis=2)
    return (slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))), np.asarray(inside)


def join(
    sheet: Sheet, right: FloatArray, down: FloatArray, *, before_something: bool
) -> tuple[npt.NDArray[np.uint8], Float32Array]:
    """Join the samples of a sheet by quads, torn where surfaces part.

    Parameters
    ----------
    sheet : Sheet
        The samples.
    right, down : ndarray of float64 of shapes (rows, columns - 1) and (rows - 1, columns)
        Pixels by which a sample and its right or lower neighbour move apart at most.
    before_something : bool
        Whether what lies behind the sheet is known, so that it shows where two objects move apart.

    Returns
    -------
    quads : ndarray of uint8 of shape (rows - 1, columns - 1)
        `NO_QUAD`, `QUAD` or `TORN_QUAD`.
    behind : ndarray of float32 of shape (rows, columns, 4)
        The colour that a sample gives to torn quads beside it.
    """
    iz, surface = sheet.inverse_depth, sheet.surface

    everything = slice(None)
    beside = (everything, slice(None, -1)), (everything, slice(1, None))
    above = (slice(None, -1), everything), (slice(1, None), everything)

    def quads_with(test: Callable[[tuple[slice, slice], tuple[slice, slice], FloatArray], Mask]) -> Mask:
        across, along = test(*beside, right), test(*above, down)
        return np.asarray(across[:-1] | across[1:] | along[:, :-1] | along[:, 1:])

    other = quads_with(lambda a, b, parted: (parted > _TORN) & (surface[a] != surface[b]))
    step = quads_with(
        lambda a, b, parted: (
            (parted > _TORN) & (np.abs(iz[a] - iz[b]) > DEPTH_STEP * np.maximum(iz[a], iz[b]))
        )
    )
    torn = other | step
    there = sheet.tracks.track != NO_TRACK
    whole = there[:-1, :-1] & there[1:, :-1] & there[:-1, 1:] & there[1:, 1:]
    # What is stretched as far as this is no surface, and would cost as much as it is large.
    whole &= torn | ~quads_with(lambda _a, _b, parted: parted > _STRETCHED)
    if before_something:
        whole &= ~other
    quads = np.where(whole, np.where(torn, TORN_QUAD, QUAD), NO_QUAD).astype(np.uint8)
    return quads, _clean(sheet, quads == TORN_QUAD)


def corners_averaged(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the means of the four corner samples of every pixel."""
    total = values[:-1, :-1] + values[1:, :-1] + values[:-1, 1:] + values[1:, 1:]
    return np.asarray(np.float32(0.25) * total, dtype=np.float32)


def on_display(samples: Samples, values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return samples as pixels of the display window, 0 where there are none; corners are averaged."""
    data, display = samples.data_window, samples.display_window
    if samples.position == "corner":
        values = corners_averaged(values)
    covered = Window(data.x0, data.y0, data.x0 + values.shape[1], data.y0 + values.shape[0])
    seen = covered.intersection(display)
    pixels = np.zeros((display.rows, display.columns, *values.shape[2:]), dtype=np.float32)
    pixels[seen.within(display)] = values[seen.within(covered)]
    return pixels


def background_of(
    samples: Samples, color: Float32Array, depth: Float32Array, guessed: Float32Array
) -> Background:
    """Return what stands still on the display window."""
    return Background(on_display(samples, color), on_display(samples, depth), on_display(samples, guessed))


def fill_in(values: Float32Array, known: Mask, wanted: Mask) -> None:
    """Fill in values smoothly from what is known around them, by averages on ever coarser grids.

    Parameters
    ----------
    values : ndarray of float32 of shape (rows, columns, channels)
        Values; the wanted ones are replaced.
    known : ndarray of bool of shape (rows, columns)
        Which may be filled from.
    wanted : ndarray of bool of shape (rows, columns)
        Which to fill.
    """
    if values.max(initial=0.0) > BRIGHT or values.min(initial=0.0) < -BRIGHT:
        dim = known & (np.abs(values).max(axis=2) <= BRIGHT)
        known = dim if dim.any() else known
    if known.all() or known.size <= 1:
        values[wanted & ~known] = 0.0
        return
    pyramid = [_halved(values, known.astype(np.float32))]
    while not (pyramid[-1][1] > 0.0).all() and max(pyramid[-1][1].shape) > 1:
        pyramid.append(_halved(*pyramid[-1]))
    result = pyramid[-1][0]
    for finer, weight in reversed(pyramid[:-1]):
        coarse = _doubled(result, finer.shape[:2])
        result = weight[..., np.newaxis] * finer + (1.0 - weight[..., np.newaxis]) * coarse
    at = np.nonzero(wanted & ~known)
    values[at] = _doubled_at(result, wanted.shape, at)


def _halved(values: Float32Array, weight: Float32Array) -> tuple[Float32Array, Float32Array]:
    rows, columns = weight.shape[0] + weight.shape[0] % 2, weight.shape[1] + weight.shape[1] % 2
    padded = np.zeros((rows, columns, values.shape[2] + 1), dtype=np.float32)
    inside = padded[: weight.shape[0], : weight.shape[1]]
    # Where nothing is known may be anything, infinity too.
    np.multiply(values, weight[..., np.newaxis], out=inside[..., :-1], where=weight[..., np.newaxis] > 0.0)
    inside[..., -1] = weight
    total = padded.reshape(rows // 2, 2, columns // 2, 2, -1).sum(axis=(1, 3))
    below = np.maximum(total[..., -1:], np.float32(1e-20))
    return total[..., :-1] / below, np.minimum(total[..., -1], np.float32(1.0))


def _doubled(values: Float32Array, shape: tuple[int, int]) -> Float32Array:
    """Return values on a grid of twice the size, between the coarse ones linearly."""
    for axis in (0, 1):
        n = shape[axis]
        low, high, share = _between(n, values.shape[axis])
        share = share.reshape((n, 1, 1) if axis == 0 else (1, n, 1))
        values = values.take(low, axis) * (1.0 - share) + values.take(high, axis) * share
    return values


def _doubled_at(
    values: Float32Array, shape: tuple[int, ...], at: tuple[npt.NDArray[np.int64], ...]
) -> Float32Array:
    """Return what `_doubled` does at some places, as rows of a table: most of a picture is not filled in."""
    (above, below, down), (left, right, across) = (
        _between(n, m) for n, m in zip(shape, values.shape, strict=False)
    )
    row, column = at
    y, x = down[row][:, np.newaxis], across[column][:, np.newaxis]
    before, after = (
        values[above[row], side[column]] * (1.0 - y) + values[below[row], side[column]] * y
        for side in (left, right)
    )
    return np.asarray(before * (1.0 - x) + after * x)


def _between(size: int, coarse: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Float32Array]:
    """Return between which places of a grid of half the size each lies, and how far on from the first."""
    at = np.clip((np.arange(size) - 0.5) / 2.0, 0.0, coarse - 1.0)
    low = at.astype(np.int64)
    return low, np.minimum(low + 1, coarse - 1), (at - low).astype(np.float32)


def _surface(layer: SampleLayer, tracks: Tracks) -> npt.NDArray[np.int32]:
    """Return a number for each surface: its track, or its object index where vectors are followed."""
    if layer.object_index is None:
        return tracks.track
    return np.where(tracks.track == VECTOR_TRACK, np.int32(-10) - layer.object_index, tracks.track)


def _no_movers(layer: SampleLayer, tracks: Tracks) -> Sheet:
    nothing = Tracks(np.full_like(tracks.track, NO_TRACK), tracks.velocity, tracks.acceleration, tracks.paths)
    return Sheet(
        layer.color, inverse_depth(layer), nothing, np.zeros(tracks.track.shape, np.float32),
        np.zeros(tracks.track.shape, dtype=np.int32),
    )  # fmt: skip


def _mean_around(color: Float32Array, source: Mask, wanted: Mask) -> Float32Array:
    """Return the mean colour of the sources within a few pixels, farther ones where there are none."""
    if color.max(initial=0.0) > BRIGHT or color.min(initial=0.0) < -BRIGHT:
        # The filter goes along a line with one sum, out of which these would leave more than there is else.
        color = np.where(np.abs(color).max(axis=2, keepdims=True) > BRIGHT, np.float32(0.0), color)
        source = source & (color[..., 3] > 0.0)
    weight = source.astype(np.float32)
    size = 2 * _EDGE + 3
    below = ndimage.uniform_filter(weight, size)
    mean = np.empty_like(color)
    least = np.maximum(below, 1e-6)
    for c in range(color.shape[2]):
        mean[..., c] = ndimage.uniform_filter(color[..., c] * weight, size) / least
    del least
    near = below > 0.5 / size**2
    if not near.any():
        return color
    fill_in(mean, near, wanted & ~near)
    return mean


def _unmixed(
    color: Float32Array | FloatArray,
    front: Float32Array | FloatArray,
    behind: Float32Array | FloatArray,
    label: Mask,
) -> Float32Array:
    """Return a of C = a F + (1 - a) B by least squares over the colours.

    Where the colours do not tell, because F and B are alike or C lies off the line between them (an
    object with a pattern), it is the share of object among the labels around.
    """
    alpha, clear = np.empty(label.shape, dtype=np.float32), np.empty(label.shape, dtype=bool)
    # In parts: what is in between would take more than all of the pictures.
    for first in range(0, len(label), _ROWS_AT_ONCE):
        rows = slice(first, first + _ROWS_AT_ONCE)
        alpha[rows], clear[rows] = _along_line(color[rows], front[rows], behind[rows])
    around = label.astype(np.float32)
    for axis in (0, 1):
        around = ndimage.convolve1d(around, _PIXEL_FILTER, axis, mode="nearest")
    return np.asarray(np.where(clear, alpha, around), dtype=np.float32)


def _along_line(
    color: Float32Array | FloatArray, front: Float32Array | FloatArray, behind: Float32Array | FloatArray
) -> tuple[Float32Array, Mask]:
    """Return where a colour lies on the line between two others, from 0 to 1, and whether that tells."""
    if max(np.abs(values).max(initial=0.0) for values in (color, front, behind)) > _SQUARES:
        color, front, behind = (values.astype(np.float64) for values in (color, front, behind))
    difference = front - behind
    size = (difference**2).sum(axis=2)
    along = ((color - behind) * difference).sum(axis=2)
    clear = size > _SAME_COLOR**2 * ((front**2).sum(axis=2) + (behind**2).sum(axis=2)) + 1e-12
    alpha = np.divide(along, size, out=np.zeros_like(size), where=clear)
    alpha = np.clip(alpha, 0.0, 1.0)
    off = ((color - behind - alpha[..., np.newaxis] * difference) ** 2).sum(axis=2)
    clear &= off <= _OFF_THE_LINE**2 * size
    return alpha, clear


def _clean(sheet: Sheet, torn: Mask) -> Float32Array:
    """Return colours in which samples at a tear have that of their own surface farther away from it."""
    at_tear = np.zeros(sheet.inverse_depth.shape, dtype=bool)
    for part in ((slice(None, -1), slice(None, -1)), (slice(None, -1), slice(1, None)),
                 (slice(1, None), slice(None, -1)), (slice(1, None), slice(1, None))):  # fmt: skip
        at_tear[part] |= torn
    rows, columns = np.nonzero(at_tear)
    if rows.size == 0:
        return sheet.color
    reach = np.arange(-2, 3)
    near_rows = rows[:, np.newaxis, np.newaxis] + reach[:, np.newaxis]
    near_columns = columns[:, np.newaxis, np.newaxis] + reach
    height, width = sheet.inverse_depth.shape
    inside = (near_rows >= 0) & (near_rows < height) & (near_columns >= 0) & (near_columns < width)
    around = (np.clip(near_rows, 0, height - 1), np.clip(near_columns, 0, width - 1))
    iz = sheet.inverse_depth
    own = iz[rows, columns][:, np.newaxis, np.newaxis]
    alike = np.abs(iz[around] - own) <= 2.0 * DEPTH_STEP * np.maximum(iz[around], own)
    alike &= sheet.surface[around] == sheet.surface[rows, columns][:, np.newaxis, np.newaxis]
    weight = (inside & alike & ~at_tear[around]).astype(np.float32)
    count = weight.sum(axis=(1, 2))
    found = count > 0.0
    mean = np.einsum("nij,nijc->nc", weight, sheet.color[around]) / np.maximum(count, 1.0)[:, np.newaxis]
    result = sheet.color.copy()
    result[rows[found], columns[found]] = mean[found]
    return result
