"""Which path each sample follows: its object's transform, the camera's, or what the vector pass says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from .lens import FloatArray
from .paths import MotionPaths, ObjectPath
from .samples import Float32Array, SampleLayer, Samples
from .warp import NO_TRACK, VECTOR_TRACK

Mask = npt.NDArray[np.bool_]
Indices = tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]

_BOX_MARGIN: Final = 0.02
"""By how much of its size a sample may lie outside its object's bounding box: depths are not exact."""

_DEPTH_MARGIN: Final = 1e-4
"""The same as a share of the sample's distance."""

_TIE: Final = 1e-3

_NO_VECTOR: Final = 1e-3
"""Pixels below which a whole layer's vectors to one side count as not there."""


@dataclass(frozen=True, slots=True)
class Tracks:
    """The path of every sample of a layer.

    Parameters
    ----------
    track : ndarray of int32 of shape (rows, columns)
        Index into `paths`, `warp.VECTOR_TRACK` or `warp.NO_TRACK`.
    velocity, acceleration : ndarray of float32 of shape (rows, columns, 2)
        From the vector pass; see `warp.Sheets`.
    paths : tuple of ObjectPath or None
        Objects; ``None``, which is always the first, for a world at rest.
    """

    track: npt.NDArray[np.int32]
    velocity: Float32Array
    acceleration: Float32Array
    paths: tuple[ObjectPath | None, ...]

    def select(self, indices: Indices, keep: Mask) -> Tracks:
        """Return tracks taken from other samples, and none where `keep` is false."""
        track = np.where(keep, self.track[indices], np.int32(NO_TRACK))
        return Tracks(track, self.velocity[indices], self.acceleration[indices], self.paths)


def assign_tracks(layer: SampleLayer, samples: Samples, *, all_move: bool = False) -> Tracks | None:
    """Find the path of every sample.

    A sample belongs to the object whose index it has and in whose bounding box it lies; indices alone
    will not do, since instances share one and objects may never have been given any. Objects that change
    their shape, and files without paths, follow the vector pass.

    Parameters
    ----------
    layer : SampleLayer
        The samples.
    samples : Samples
        The file that they belong to.
    all_move : bool
        Whether the layer shows moving objects alone, so that each sample belongs to the likeliest.

    Returns
    -------
    Tracks or None
        ``None`` where the file says nothing of motion.
    """
    shape = layer.color.shape[:2]
    velocity, acceleration = _from_vectors(layer.vector, shape)
    if samples.paths is None or layer.depth is None:
        if layer.vector is None:
            return None
        everywhere = np.full(shape, VECTOR_TRACK, dtype=np.int32)
        return Tracks(everywhere, velocity, acceleration, (None,))
    track = _by_boxes(layer, samples, samples.paths, all_move=all_move)
    if layer.vector is not None:
        for number, path in enumerate(samples.paths.objects, start=1):
            if path.deforming:
                track[track == number] = VECTOR_TRACK
    return Tracks(track, velocity, acceleration, (None, *samples.paths.objects))


def sample_origin(samples: Samples) -> tuple[float, float]:
    """Return the pixel coordinates of the first sample in the display window."""
    inset = 0.5 if samples.position == "center" else 0.0
    data, display = samples.data_window, samples.display_window
    return data.x0 - display.x0 + inset, data.y0 - display.y0 + inset


def _by_boxes(
    layer: SampleLayer, samples: Samples, paths: MotionPaths, *, all_move: bool
) -> npt.NDArray[np.int32]:
    """Return the number (from 1) of the object in whose box each sample lies, 0 for none's."""
    assert layer.depth is not None
    shape = layer.depth.shape
    best = np.full(shape, np.inf if all_move else 1.0 + 3.0 * _TIE)
    track = np.zeros(shape, dtype=np.int32)
    finite = np.isfinite(layer.depth) & (layer.color[..., 3] > 0.0)
    anyones = np.zeros(shape, dtype=bool)
    if all_move and layer.object_index is not None:
        # Where every sample has to belong to some object: those whose index no object has.
        anyones = ~np.isin(layer.object_index, [path.object_index for path in paths.objects])
    origin = sample_origin(samples)
    for number, path in enumerate(paths.objects, start=1):
        to_pixels = paths.camera.at(0.0) @ path.at(0.0)
        part = (slice(None), slice(None)) if all_move else _window_of(path.box, to_pixels, origin, shape)
        candidate = finite[part]
        if layer.object_index is not None:
            candidate = candidate & ((layer.object_index[part] == path.object_index) | anyones[part])
        rows, columns = np.nonzero(candidate)
        if rows.size == 0:
            continue
        depth = layer.depth[part][rows, columns].astype(np.float64)
        x = columns + (part[1].start or 0) + origin[0]
        y = rows + (part[0].start or 0) + origin[1]
        pixel = np.stack([x * depth, y * depth, depth, np.ones_like(depth)])
        local = (np.linalg.inv(to_pixels) @ pixel)[:3].T
        scale = float(np.linalg.norm(path.at(0.0)[:3, :3], axis=0).min())
        half = 0.5 * (path.box[1] - path.box[0])
        margin = _BOX_MARGIN * half.max() + _DEPTH_MARGIN * depth[:, np.newaxis] / max(scale, 1e-12)
        axes = np.abs(local - path.box.mean(axis=0)) / (half + margin)
        # Where the worst axis tells nothing apart, the others do.
        off = axes.max(axis=1) + _TIE * axes.sum(axis=1)
        better = off < best[part][rows, columns]
        at = (rows[better] + (part[0].start or 0), columns[better] + (part[1].start or 0))
        best[at] = off[better]
        track[at] = number
    return track


def _window_of(
    box: FloatArray, to_pixels: FloatArray, origin: tuple[float, float], shape: tuple[int, ...]
) -> tuple[slice, slice]:
    """Return the part of the samples' grid that a box can cover."""
    corners = np.array([[x, y, z, 1.0] for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]])
    projected = corners @ to_pixels[:3].T
    if (projected[:, 2] <= 0.0).any():
        return slice(0, shape[0]), slice(0, shape[1])
    pixels = projected[:, :2] / projected[:, 2:]
    low = np.floor(pixels.min(axis=0) - origin - 2.0).clip(0.0, [shape[1], shape[0]]).astype(int)
    high = np.ceil(pixels.max(axis=0) - origin + 3.0).clip(0.0, [shape[1], shape[0]]).astype(int)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _from_vectors(vector: Float32Array | None, shape: tuple[int, ...]) -> tuple[Float32Array, Float32Array]:
    """Return velocity and acceleration of the parabola through the places at three frames.

    Blender's vectors have y up and point against the motion to the next frame: the place was
    (x + X, y - Y) a frame ago and will be (x - Z, y + W) in the next, y down. At the ends of an animation
    one side is 0 all over; motion is then even.
    """
    if vector is None:
        return np.zeros((*shape, 2), dtype=np.float32), np.zeros((*shape, 2), dtype=np.float32)
    before = vector[..., :2] * np.array([1.0, -1.0], dtype=np.float32)
    after = vector[..., 2:] * np.array([-1.0, 1.0], dtype=np.float32)
    if np.abs(before).max(initial=0.0) < _NO_VECTOR:
        before = -after
    elif np.abs(after).max(initial=0.0) < _NO_VECTOR:
        after = -before
    half = np.float32(0.5)
    return np.ascontiguousarray(half * (after - before)), np.ascontiguousarray(half * (after + before))


def spread(tracks: Tracks, known: Mask, wanted: Mask) -> tuple[Tracks, Indices]:
    """Give samples that belong to no object the path of the nearest one that does.

    Parameters
    ----------
    tracks : Tracks
        Paths of all samples.
    known : ndarray of bool
        Which of them are right.
    wanted : ndarray of bool
        Which samples to return paths for; the others have none.

    Returns
    -------
    tracks : Tracks
        The paths.
    indices : tuple of ndarray of int32
        Row and column of the sample that each was taken from.
    """
    nearest = nearest_known(known)
    return tracks.select(nearest, wanted), nearest


def nearest_known(known: Mask) -> Indices:
    """Return row and column of the nearest sample that is known, for each sample."""
    row, column = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return row, column
