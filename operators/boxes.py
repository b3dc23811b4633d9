"""Bounding boxes before the camera: which of them are in view, and from what depth to what depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..potmesil_addon.camera import Camera
from ..potmesil_addon.lens import FloatArray

UNIT_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
"""The corners of a box from 0 to 1, in the order in which all corners are listed."""

_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))

_SHALLOW = 1.25
"""Far over near depth up to which a box's own corners tell its depth well enough where it leaves the view."""


@dataclass(frozen=True, slots=True)
class Boxes:
    """The bounding boxes of instances at the rendered frame.

    Parameters
    ----------
    owners : tuple of str
        Full names of the objects that the instances belong to: the objects themselves, or their
        instancers.
    corners : ndarray of shape (n, 8, 3)
        In the world, ordered as `UNIT_CORNERS`.
    """

    owners: tuple[str, ...]
    corners: FloatArray

    def inverse_depths(self, camera: Camera, margins: npt.ArrayLike = (0.0, 0.0)) -> FloatArray:
        """Return one over the nearest and the farthest depth of what each box has in view.

        Parameters
        ----------
        camera : Camera
            The camera.
        margins : array_like of shape (2,)
            Columns and rows by which the view is larger than the picture on each side.

        Returns
        -------
        ndarray of shape (n, 2)
            1/m, near before far; NaN for a box that is not in view. Of a box around the camera only
            the faces count.
        """
        seen = self._seen(camera)
        distances = _distances(seen, camera, margins)
        found = np.full((len(self.owners), 2), np.nan)
        possible = ~(distances < 0.0).all(axis=1).any(axis=-1)
        for n in np.flatnonzero(possible):
            depths = seen[n, :, 2]
            shallow = depths.min() >= max(_clip_start(camera), depths.max() / _SHALLOW)
            if not (shallow or (distances[n] >= 0.0).all()):
                depths = _clipped_depths(seen[n], camera, margins)
            if depths.size:
                found[n] = 1.0 / depths.min(), 1.0 / depths.max()
        return found

    def crossing(self, camera: Camera) -> npt.NDArray[np.bool_]:
        """Return which boxes are not wholly inside the picture."""
        return np.asarray((_distances(self._seen(camera), camera, (0.0, 0.0)) < 0.0).any(axis=(1, 2)))

    def around(self, camera: Camera) -> npt.NDArray[np.bool_]:
        """Return which boxes have the camera inside them, or nearer than its clipping."""
        place = -camera.world_to_camera[:3, :3].T @ camera.world_to_camera[:3, 3]
        first = self.corners[:, :1]
        edges = self.corners[:, [4, 2, 1]] - first
        # A flat box has no inverse.
        shares = np.clip((place - first) @ np.linalg.pinv(edges), 0.0, 1.0)
        gaps = np.linalg.norm(first + shares @ edges - place, axis=-1)[:, 0]
        return np.asarray(gaps <= _clip_start(camera))

    def _seen(self, camera: Camera) -> FloatArray:
        """Return the corners as (x'' w'', y'' w'', w''), w'' being the depth."""
        return np.asarray(self.corners @ camera.matrix[:, :3].T + camera.matrix[:, 3])


def _clip_start(camera: Camera) -> float:
    return max(camera.clip_start, 1e-6)


def _distances(seen: FloatArray, camera: Camera, margins: npt.ArrayLike) -> FloatArray:
    """Return how far inside of each side of the view points are, negative outside, in a last axis of 6."""
    x, y, depth = np.moveaxis(seen, -1, 0)
    margin_x, margin_y = np.asarray(margins, dtype=np.float64)
    film = camera.film
    sides = (
        depth - _clip_start(camera),
        camera.clip_end - depth,
        x + margin_x * depth,
        (film.columns + margin_x) * depth - x,
        y + margin_y * depth,
        (film.rows + margin_y) * depth - y,
    )
    return np.stack(sides, axis=-1)


def _clipped_depths(corners: FloatArray, camera: Camera, margins: npt.ArrayLike) -> FloatArray:
    """Return the depths of the corners of a box's faces after the view's sides have cut them."""
    depths = [np.empty(0)]
    for face in _FACES:
        polygon = corners[list(face)]
        for side in range(6):
            if not len(polygon):
                break
            # These are linear in the points, so that an edge is cut at the ratio of its ends' distances.
            here = _distances(polygon, camera, margins)[:, side]
            after, there = np.roll(polygon, -1, axis=0), np.roll(here, -1)
            cut = (here < 0.0) != (there < 0.0)
            share = np.where(cut, here, 0.0) / np.where(cut, here - there, 1.0)
            pairs = np.stack([polygon, polygon + share[:, np.newaxis] * (after - polygon)], axis=1)
            keep = np.stack([here >= 0.0, cut], axis=1)
            polygon = pairs[keep]
        if len(polygon):
            depths.append(polygon[:, 2])
    return np.concatenate(depths)
