"""Where moving objects and the camera are during the exposure: r(t) of 1983, eqs. 3-1 to 3-3.

A samples file carries them in the attribute ``potmesil:motion``. Matrices between two stored times
are interpolated linearly, which moves projected points along the straight line between their stored
places; export stores as many times as keep that within 0.1 pixel of the truth.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from . import schemas
from .errors import InputError
from .lens import FloatArray

VERSION: Final = 1

_SHORTEST: Final = 1e-6
"""Frames between two times at least; export has 1/64."""

_LARGEST_INVERSE: Final = 1e30
"""Numbers of inverse matrices from here on are those of a damaged one, and products of them may overflow."""


@dataclass(frozen=True, slots=True)
class CameraPath:
    """The pinhole camera over time.

    Parameters
    ----------
    times : ndarray of float64 of shape (k,)
        Frames from the rendered frame, increasing; one time for a camera at rest.
    matrices : ndarray of float64 of shape (k, 3, 4)
        World to pixels of the samples (`Camera.matrix`), so that zoom and shift move too.
    """

    times: FloatArray
    matrices: FloatArray

    @property
    def moves(self) -> bool:
        """Whether the picture of a scene at rest changes."""
        return self.times.size > 1

    def at(self, time: npt.ArrayLike) -> FloatArray:
        """Return the 4x4 matrix at one or more times: world to (x'' w'', y'' w'', w'', 1)."""
        return _square(interpolated(self.times, self.matrices, time))

    def on_other_pixels(self, scale: float, x: float, y: float) -> CameraPath:
        """Return the same camera for pixels that are `scale` of these apart, the first at (x, y) of these."""
        pixels = np.array([[scale, 0.0, -scale * x], [0.0, scale, -scale * y], [0.0, 0.0, 1.0]])
        return replace(self, matrices=pixels @ self.matrices)


@dataclass(frozen=True, slots=True)
class ObjectPath:
    """One object, or one instance of it, over time.

    Parameters
    ----------
    name : str
        For reports.
    object_index : int
        Its pass index.
    times : ndarray of float64 of shape (k,)
        Frames from the rendered frame, increasing; one time for an object that only deforms.
    matrices : ndarray of float64 of shape (k, 3, 4)
        Object to world.
    box : ndarray of float64 of shape (2, 3)
        Corners of its bounding box in its own coordinates at the rendered frame.
    deforming : bool
        Whether its shape changes, so that the matrices do not tell where its points go.
    """

    name: str
    object_index: int
    times: FloatArray
    matrices: FloatArray
    box: FloatArray
    deforming: bool = False

    def at(self, time: npt.ArrayLike) -> FloatArray:
        """Return the 4x4 matrix at one or more times: object to world."""
        return _square(interpolated(self.times, self.matrices, time))


@dataclass(frozen=True, slots=True)
class MotionPaths:
    """All that moves in a frame. What is not listed is at rest in the world.

    Parameters
    ----------
    camera : CameraPath
        The camera.
    objects : tuple of ObjectPath
        Objects that move by themselves or change their shape.
    """

    camera: CameraPath
    objects: tuple[ObjectPath, ...] = ()

    def reprojection(self, path: ObjectPath | None, time: npt.ArrayLike) -> FloatArray:
        """Return where points seen at the rendered frame are at other times.

        Parameters
        ----------
        path : ObjectPath or None
            The object that they belong to; ``None`` for a scene at rest.
        time : array_like
            Frames from the rendered frame.

        Returns
        -------
        ndarray of float64, the shape of `time` and then (3, 4)
            Takes (x, y, 1, 1/z) of the rendered frame to (x' s, y' s, s), where s = z' / z. Points at
            infinity (1/z = 0) need no care.
        """
        moved = self.camera.at(time)
        if path is not None:
            moved = moved @ path.at(time) @ np.linalg.inv(path.at(0.0))
        return np.asarray((moved @ np.linalg.inv(self.camera.at(0.0)))[..., :3, :])

    def to_json(self) -> str:
        """Return the text of the ``potmesil:motion`` attribute."""
        return json.dumps(
            {
                "version": VERSION,
                "camera": _track_to_json(self.camera.times, self.camera.matrices),
                "objects": [
                    {
                        "name": path.name,
                        "index": path.object_index,
                        "box": _plain(path.box),
                        "deforming": path.deforming,
                        **_track_to_json(path.times, path.matrices),
                    }
                    for path in self.objects
                ],
            },
            separators=(",", ":"),
        )

    @classmethod
    def from_json(cls, text: str) -> MotionPaths:
        """Return the paths that `to_json` wrote.

        Raises
        ------
        InputError
            If the text is not of that form.
        """
        try:
            values = schemas.parse(text)
            version = values["version"]
            if isinstance(version, int) and version != VERSION:
                raise InputError(
                    f"The file's motion paths are of version {version}, which this release cannot "
                    "read; export it again."
                )
            schemas.check(values, schemas.MOTION)
            camera = CameraPath(*_track_from_json(values["camera"]))
            objects = tuple(
                ObjectPath(
                    name=entry["name"],
                    object_index=int(entry["index"]),
                    times=times,
                    matrices=matrices,
                    box=_array(entry["box"], (2, 3)),
                    deforming=entry["deforming"],
                )
                for entry in values["objects"]
                for times, matrices in [_track_from_json(entry)]
            )
            paths = cls(camera, objects)
            own = [path.at(0.0) for path in objects]
            # Processing inverts each, and the way from an object to pixels.
            for matrix in (camera.at(0.0), *own, *(camera.at(0.0) @ to_world for to_world in own)):
                with np.errstate(all="ignore"):
                    inverse = np.linalg.inv(matrix)
                if not (np.abs(inverse) < _LARGEST_INVERSE).all():
                    raise ValueError("a matrix cannot be inverted")
        except (ValueError, TypeError, KeyError, OverflowError, np.linalg.LinAlgError) as error:
            raise InputError("The file's motion paths are damaged; export it again.") from error
        return paths


def interpolated(times: FloatArray, values: FloatArray, time: npt.ArrayLike) -> FloatArray:
    """Return an array between stored times, linearly; before the first and after the last, extended."""
    time = np.asarray(time, dtype=np.float64)
    if times.size == 1:
        return np.broadcast_to(values[0], time.shape + values.shape[1:])
    k = np.clip(np.searchsorted(times, time) - 1, 0, times.size - 2)
    share = (time - times[k]) / (times[k + 1] - times[k])
    share = share.reshape(time.shape + (1,) * (values.ndim - 1))
    return np.asarray((1.0 - share) * values[k] + share * values[k + 1])


def _square(matrices: FloatArray) -> FloatArray:
    """Return 4x4 matrices from their first three rows."""
    last = np.broadcast_to([[0.0, 0.0, 0.0, 1.0]], (*matrices.shape[:-2], 1, 4))
    return np.concatenate([matrices, last], axis=-2)


def thinned(
    times: FloatArray, values: FloatArray, places: FloatArray, tolerance: float
) -> npt.NDArray[np.bool_]:
    """Choose the times of a track that are needed to keep points within a tolerance.

    Parameters
    ----------
    times : ndarray of shape (k,)
        Increasing; one of them is 0, which is always kept.
    values : ndarray of shape (k, ...)
        The track, to say whether anything changes at all.
    places : ndarray of shape (k, points, 2)
        Where points of the object are at each time, in coordinates that the matrices take them to before
        any division, such as the world's: only there does what is interpolated go straight.
    tolerance : float
        Largest distance from the straight line between two kept times, in the places' unit.

    Returns
    -------
    ndarray of bool of shape (k,)
        Which times to keep: only time 0 for a track that never changes.
    """
    keep = np.zeros(times.size, dtype=bool)
    zero = int(np.argmin(np.abs(times)))
    keep[zero] = True
    if times.size == 1 or not (values != values[0]).any():
        return keep
    keep[[0, -1]] = True
    stack = [(0, zero), (zero, times.size - 1)]
    while stack:
        a, b = stack.pop()
        if b - a < 2:
            continue
        share = ((times[a + 1 : b] - times[a]) / (times[b] - times[a]))[:, np.newaxis, np.newaxis]
        line = (1.0 - share) * places[a] + share * places[b]
        off = np.nan_to_num(np.hypot(*np.moveaxis(places[a + 1 : b] - line, -1, 0)).max(axis=1), nan=np.inf)
        worst = int(np.argmax(off))
        if off[worst] > tolerance:
            middle = a + 1 + worst
            keep[middle] = True
            stack.extend([(a, middle), (middle, b)])
    return keep


def _track_to_json(times: FloatArray, matrices: FloatArray) -> dict[str, Any]:
    return {"times": _plain(times), "matrices": _plain(matrices.reshape(-1, 12))}


def _track_from_json(values: dict[str, Any]) -> tuple[FloatArray, FloatArray]:
    times = _array(values["times"], (len(values["times"]),))
    matrices = _array(values["matrices"], (times.size, 12)).reshape(-1, 3, 4)
    if times.size == 0 or (np.diff(times) < _SHORTEST).any():
        raise ValueError("times must increase")
    return times, matrices


def _array(values: Any, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError("not the shape or not finite")
    return array


def _plain(values: FloatArray) -> Any:
    """Return nested lists, with ten digits: less than a millionth of a pixel on the widest picture."""
    rounded = np.vectorize(lambda value: float(f"{value:.10g}"), otypes=[float])(values)
    return rounded.tolist()
