"""One path for each object, and the time-and-depth buffer that merges them (1983, figure 6, section 4.2).

An object's samples are a picture f with a fourth band, the time for which each pixel is exposed. All of
it is convolved with the object's motion PSF h. In the buffer a nearer surface at rest hides an
object; where an object is seen, it takes its time from what lies behind; and where the times of several
add up to more than the exposure, they are scaled down.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from .lens import FloatArray
from .motion_psf import ExposedPath, convolve_full, motion_psf
from .samples import Float32Array
from .warp import SAME_DEPTH, Background

_NO_TIME: Final = 1e-6
"""Share of the exposure that counts as none; the frequency domain leaves about 1e-15 everywhere."""


@dataclass(frozen=True, slots=True)
class MovingObject:
    """An object with one path for all of its samples.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 5)
        Its instantaneous picture, cut to where it is: premultiplied red, green, blue, then alpha, which is
        the time band as a share of the exposure, then inverse depth times alpha.
    row, column : int
        Pixel of the output at which the picture's first one lies; it may lie outside.
    path : ExposedPath
        Displacement of the picture, and the light along it.
    depth_ratio : ndarray of float64 of shape (n,)
        Inverse depth over that of the rendered frame, at n equal shares of the light.
    """

    picture: Float32Array
    row: int
    column: int
    path: ExposedPath
    depth_ratio: FloatArray


def merge(
    objects: list[MovingObject],
    background: Background | None,
    bins: int,
    output: Float32Array,
    guessed: Float32Array,
) -> Iterator[float]:
    """Blur objects and merge them with what is at rest.

    Parameters
    ----------
    objects : list of MovingObject
        At least one.
    background : Background or None
        What is at rest; without it a pixel is what is seen of it while something is there.
    bins : int
        Parts of equal light into which the exposure is cut. With 1, as in the paper, objects that
        meet at a pixel are scaled down together; with more, the nearer one at that time goes first.
    output : ndarray of float32 of shape (rows, columns, 4)
        Receives the premultiplied picture where an object was; with a background the rest is left as it
        is.
    guessed : ndarray of float32 of shape (rows, columns)
        Receives the share of each pixel's light that was filled in, likewise.

    Yields
    ------
    float
        Share of the work done, rising to 1.
    """
    shape = output.shape[:2]
    color, time = np.zeros((*shape, 4)), np.zeros(shape)
    cut = [split(item.path, bins) for item in objects]
    for b in range(bins):
        share = (b + 0.5) / bins
        order = sorted(range(len(objects)), key=lambda n: -_inverse_depth_at(objects[n], share))
        taken = np.zeros(shape)
        for done, n in enumerate(order):
            window, bands = _blurred(objects[n], cut[n][b], share, shape)
            if bands.size:
                _deposit(bands, window, background, color, taken, ordered=bins > 1)
            yield (b + (done + 1) / len(order)) / bins
        if bins == 1:
            # Where the times add up to more than the exposure, all are scaled down.
            scale = 1.0 / np.maximum(taken, 1.0)
            color *= scale[..., np.newaxis]
            taken *= scale
        time += taken
    time /= bins
    color /= bins
    if background is None:
        output[:] = color / np.maximum(time, _NO_TIME)[..., np.newaxis]
        guessed[:] = 1.0 - np.minimum(time, 1.0)
        return
    touched = (time > 0.0) | (color[..., 3] > 0.0)
    rest = np.maximum(1.0 - time[touched], 0.0)
    output[touched] = color[touched] + rest[:, np.newaxis] * background.color[touched]
    guessed[touched] = rest * background.guessed[touched]


def split(path: ExposedPath, bins: int) -> list[ExposedPath]:
    """Cut a path into parts of equal light.

    Parameters
    ----------
    path : ExposedPath
        Pieces in order of time.
    bins : int
        Number of parts, at least 1.

    Returns
    -------
    list of ExposedPath
        The parts in order of time.
    """
    if bins == 1:
        return [path]
    lit = path.light > 0.0
    segments, light = path.segments[lit], path.light[lit] / path.light.sum()
    after = np.cumsum(light)
    before = after - light
    parts = []
    for b in range(bins):
        begin = np.clip((b / bins - before) / light, 0.0, 1.0)
        end = np.clip(((b + 1) / bins - before) / light, 0.0, 1.0)
        used = end > begin
        if not used.any():  # rounding left nothing between two bins
            used = np.arange(light.size) == min(int(np.searchsorted(after, (b + 0.5) / bins)), light.size - 1)
            end = np.where(used, np.minimum(begin + 1e-9, 1.0), end)
        step = segments[used, 1] - segments[used, 0]
        pieces = (
            segments[used, :1]
            + np.stack([begin[used], end[used]], axis=1)[..., np.newaxis] * (step[:, np.newaxis])
        )
        share = np.maximum((end - begin)[used] * light[used], 1e-300)
        parts.append(ExposedPath(pieces, share))
    return parts


def _inverse_depth_at(item: MovingObject, share: float) -> float:
    """Return an object's mean inverse depth when a share of the light has come in."""
    alpha = float(item.picture[..., 3].sum())
    mean = float(item.picture[..., 4].sum()) / max(alpha, _NO_TIME)
    return mean * _ratio_at(item, share)


def _ratio_at(item: MovingObject, share: float) -> float:
    return float(item.depth_ratio[min(int(share * item.depth_ratio.size), item.depth_ratio.size - 1)])


def _blurred(
    item: MovingObject, path: ExposedPath, share: float, shape: tuple[int, int]
) -> tuple[tuple[slice, slice], FloatArray]:
    """Return the part of the output that an object's blurred picture covers, and its five bands there."""
    reach = tuple(max(shape[k], item.picture.shape[k]) + abs((item.row, item.column)[k]) for k in (0, 1))
    full, row, column = convolve_full(item.picture, motion_psf(path, "linear", reach=(reach[0], reach[1])))
    row, column = row + item.row, column + item.column
    top, left = max(row, 0), max(column, 0)
    bottom = max(min(row + full.shape[0], shape[0]), top)
    right = max(min(column + full.shape[1], shape[1]), left)
    bands = full[top - row : bottom - row, left - column : right - column].astype(np.float64)
    bands[..., 4] *= _ratio_at(item, share)
    return (slice(top, bottom), slice(left, right)), bands


def _deposit(
    bands: FloatArray,
    window: tuple[slice, slice],
    background: Background | None,
    color: FloatArray,
    taken: FloatArray,
    *,
    ordered: bool,
) -> None:
    """Add an object's colours and its time to those of one part of the exposure."""
    there = bands[..., 3] > _NO_TIME
    time = np.where(there, np.minimum(bands[..., 3], 1.0), 0.0)
    kept = there.astype(np.float64)
    if background is not None:
        # A surface at rest that stands before an object keeps its time, and may let the object through.
        depth = np.divide(bands[..., 4], bands[..., 3], out=np.zeros_like(time), where=there)
        hidden = there & (depth < background.inverse_depth[window] * (1.0 - SAME_DEPTH))
        through = np.where(hidden, 1.0 - background.color[window][..., 3], 0.0)
        color[window] += bands[..., :4] * through[..., np.newaxis]
        kept[hidden] = 0.0
    if ordered:
        free = np.maximum(1.0 - taken[window], 0.0)
        wanted = time * kept
        kept *= np.divide(np.minimum(wanted, free), wanted, out=np.zeros_like(time), where=wanted > 0.0)
    color[window] += bands[..., :4] * kept[..., np.newaxis]
    taken[window] += time * kept


def meeting(low: FloatArray, high: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which objects' swept rectangles meet another's.

    Parameters
    ----------
    low, high : ndarray of float64 of shape (objects, 2)
        Corners (x, y) of the rectangles in pixels.

    Returns
    -------
    ndarray of bool of shape (objects,)
        True for an object that may meet another.
    """
    beside, above = np.moveaxis(low[:, np.newaxis] > high + 2.0, -1, 0)
    meets = ~(beside | beside.T | above | above.T)
    np.fill_diagonal(meets, val=False)
    return np.asarray(meets.any(axis=1))
