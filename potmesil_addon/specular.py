"""What mirrors and glass show: how far away it appears, and where it goes while the shutter is open.

A probe (TOG 1982, figures 15 and 16: the accumulated z') follows the path of light through each pixel to
where it ends. What is seen there appears where rays that leave the camera's lens side by side meet again:
at the length of the path in plane mirrors, elsewhere in curved ones and through glass.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage, sparse

from .lens import FloatArray
from .paths import MotionPaths, ObjectPath
from .samples import Float32Array

Mask = npt.NDArray[np.bool_]

GLASS_STEP: Final = 32
"""What passing through a surface of glass adds to the bounces; a reflection adds 1."""

NUMBER_STEP: Final = 1024
"""What the second surface's number is multiplied by to be added to the bounces, if light goes on there."""

NOWHERE: Final = -1
"""Number of what is infinitely far away, whose place is a direction."""

_LARGEST_STEP: Final = 6.0
"""Pixels by which what is seen may shift between the cameras of a probe; more is another surface's."""

_OFF_THE_SURFACE: Final = 0.3
"""Distance in pixels from the surface beside it, for each pixel of shift, that is another surface's."""

_SAME_WAY: Final = 0.985
"""Cosine of the angle, 10 degrees, by which a mirror may turn from sample to sample."""

_STEP: Final = 0.1
"""Share of its inverse depth by which a mirror may come nearer from sample to sample."""

_JUMP: Final = 4.0
"""By how many times a step is longer than those beside it where what is seen jumps."""

_SHARPLY_CURVED: Final = 1e3
"""Turn of what is reflected, over the angle between samples, of the sharpest edges."""

_SMALL_PATCH: Final = 48
"""Samples below which a patch is taken together with other small ones."""

_BLOCK: Final = 12
"""Samples, about, from which patches are so far from each other that they may share a number."""

_MOST_NUMBERS: Final = 4

_EDGE: Final = 1.5
"""Pixels around a mirror that may show some of it."""

_AROUND: Final = 3
"""Samples to each side of which the middle depth is taken in a curved surface."""

_AT_ONCE: Final = 1 << 18

_NEARBY: Final = 16.0
"""Pixels from which depths are taken where rays beside each other end at different things."""

_SAME_SURFACE: Final = 0.05
"""Difference of depths, as a share, up to which such pixels are of one surface."""

_TOUCHING: Final = 0.01
"""Distance of something from its image, over that of the mirror, from which it tells how the mirror faces."""

_LEAST_PATH: Final = 1e-6
"""Least way from a mirror to what it shows, as a share of its distance."""

_NEAREST: Final = 0.25
"""Least distance at which something appears, over that of the surface that shows it."""

_PLANE: Final = 0.03
"""Difference of where things appear and the length of their paths, as a share, in a mirror that is plane."""

_IN_BOX: Final = 0.05
"""By how much of its size a place may lie outside its object's bounding box."""


@dataclass(frozen=True, slots=True)
class Probe:
    """What a probe saw in each sample of a view.

    Parameters
    ----------
    length : ndarray of float32 of shape (rows, columns)
        Length of the path of light in metres, from the plane at which the camera begins to see.
    number : ndarray of int32 of shape (rows, columns)
        Which object is at its end: a key of `names`, `NOWHERE`, or 0 where the path got lost.
    bounces : ndarray of int32 of shape (rows, columns)
        Reflections on the way, and `GLASS_STEP` for each surface of glass; 0 where the surface neither
        reflects nor lets through.
    second : ndarray of int32 of shape (rows, columns)
        Number of the object that the path meets next, if it goes on there; else 0.
    place : ndarray of float32 of shape (3, rows, columns, 3)
        Where the path ends, in the world and from the camera, or its direction if nowhere: seen from the
        camera, and from cameras that stand `baseline` farther to the right and upwards.
    baseline : float
        Metres.
    names : dict of int to str
        Full names of the objects.
    """

    length: Float32Array
    number: npt.NDArray[np.int32]
    bounces: npt.NDArray[np.int32]
    second: npt.NDArray[np.int32]
    place: Float32Array
    baseline: float
    names: Mapping[int, str]

    @classmethod
    def from_renders(
        cls, path: Float32Array, places: Sequence[Float32Array], baseline: float, names: Mapping[int, str]
    ) -> Probe:
        """Return what a probe's renders say.

        Parameters
        ----------
        path : ndarray of float32 of shape (rows, columns, 3)
            Length, number and bounces.
        places : sequence of ndarray of float32 of shape (rows, columns, 3)
            Three of them; or none, where only `there` is asked.
        baseline, names
            See `Probe`.
        """
        number, bounces = (np.rint(path[..., n]).astype(np.int32) for n in (1, 2))
        place = np.stack(places) if places else np.zeros((0, *path.shape), dtype=np.float32)
        second, bounces = np.divmod(bounces, NUMBER_STEP)
        return cls(np.ascontiguousarray(path[..., 0]), number, bounces, second, place, baseline, names)

    @property
    def there(self) -> Mask:
        """Which samples show a surface that reflects or lets through."""
        return np.asarray(self.bounces > 0)


@dataclass(frozen=True, slots=True)
class View:
    """The view that a probe was rendered in.

    Parameters
    ----------
    paths : MotionPaths
        The camera and what moves.
    origin : (float, float)
        Pixel coordinates of the first sample; see `tracks.sample_origin`.
    clip_start : float
        Depth in metres at which the camera begins to see.
    depth : ndarray of float32 of shape (rows, columns)
        Depth z' of the surfaces that reflect or let through.
    track : ndarray of int32 of shape (rows, columns)
        Number of the moving object, from 1, that each surface belongs to; below 1 for none.
    normal : ndarray of float32 of shape (rows, columns, 3) or None
        Normals of the surfaces in the world, as they are shaded.
    index : ndarray of int32 of shape (rows, columns) or None
        Their object indices.
    """

    paths: MotionPaths
    origin: tuple[float, float]
    clip_start: float
    depth: Float32Array
    track: npt.NDArray[np.int32]
    normal: Float32Array | None = None
    index: npt.NDArray[np.int32] | None = None

    @property
    def eye(self) -> FloatArray:
        """Where the camera is, of shape (3,)."""
        camera = self.paths.camera.at(0.0)[:3]
        return np.asarray(-np.linalg.inv(camera[:, :3]) @ camera[:, 3])

    def rays(self) -> FloatArray:
        """Return the way from the camera to depth 1 of each sample, of shape (rows, columns, 3)."""
        rows, columns = self.depth.shape
        x, y = np.meshgrid(self.origin[0] + np.arange(columns), self.origin[1] + np.arange(rows))
        inverse = np.linalg.inv(self.paths.camera.at(0.0)[:3, :3])
        return np.asarray(np.stack([x, y, np.ones_like(x)], axis=-1) @ inverse.T)

    def focal_px(self) -> tuple[float, float]:
        """Return the focal length in pixels across and down."""
        camera = self.paths.camera.at(0.0)[:3, :3]
        # The rows of a camera's matrix are of the axes, each off by the optical axis' pixel.
        axis = camera[2] / (camera[2] @ camera[2])
        along = camera[:2] - np.outer(camera[:2] @ axis, camera[2])
        across, down = np.linalg.norm(along, axis=1) / np.linalg.norm(camera[2])
        return float(across), float(down)


@dataclass(frozen=True, slots=True)
class Seen:
    """Where what mirrors or glass show appears.

    Parameters
    ----------
    there : ndarray of bool of shape (rows, columns)
        Samples of surfaces that reflect or let through, whose path did not get lost.
    depth : ndarray of float32 of shape (rows, columns)
        Depth z' in metres at which what is seen there appears, also in the pixels around; the surface's own
        elsewhere.
    path_depth : ndarray of float32 of shape (rows, columns)
        The length of its path along the optical axis, which the papers take.
    astigmatism : ndarray of float32 of shape (rows, columns, 2)
        How much farther away, in inverse metres, it appears along one axis of the picture than `depth` says,
        times the cosine and sine of twice the angle of that axis, counted from x to y, which is down. 0
        where it appears at one distance.
    normal : ndarray of float32 of shape (rows, columns, 3) or None
        Normals of the surfaces: where something is reflected once, half-way between the ways out and in
        at the very sample, and what the view has elsewhere.
    vector : ndarray of float32 of shape (rows, columns, 4) or None
        Its motion as a vector pass has it; None where nothing moves.
    """

    there: Mask
    depth: Float32Array
    path_depth: Float32Array
    astigmatism: Float32Array
    normal: Float32Array | None
    vector: Float32Array | None


def resolve(probe: Probe, view: View, reach: float) -> Seen:
    """Find where what a probe saw appears, and how it moves.

    A point at distance d shifts by f b / d in a camera that stands b farther to the side. How far what is
    seen has shifted, s, is told by the places that neighbouring samples see: the surface at the end of a
    path goes on by J (its places' derivatives) from sample to sample, and J s is the way between the places
    that the two cameras see in one sample. Of the two distances, across and down, the mean of the inverse
    ones counts. Where neighbours see other things it is that of samples nearby, or the length of the path.
    After a single reflection the mirror equation tells more, from the normals of the mirror: two distances
    of an astigmatic image, along two axes.

    Parameters
    ----------
    probe : Probe
        What was seen.
    view : View
        The view.
    reach : float
        Frames to both sides of the rendered one between which motion is followed.

    Returns
    -------
    Seen
        Depths and motion.
    """
    rays = view.rays()
    astigmatism = np.zeros((*view.depth.shape, 2), dtype=np.float32)
    there = probe.there & (probe.number != 0)
    along = np.linalg.norm(rays, axis=-1)
    path_depth = np.where(probe.number == NOWHERE, np.inf, view.clip_start + probe.length / along)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(there, 1.0 / path_depth, 1.0 / view.depth)
        jacobian, known = _jacobian(probe)
        shifts, sure = _shifts(probe, jacobian, known & there)
        focal = np.array(view.focal_px())
        found = shifts / (focal * probe.baseline) * np.array([1.0, -1.0])
        both = np.where(sure, found, 0.0).sum(axis=-1) / np.maximum(sure.sum(axis=-1), 1)
        nearest = 1.0 / (_NEAREST * view.depth)
        met = there & sure.any(axis=-1)
        inverse = np.where(met, np.clip(both, 0.0, nearest), inverse)
        bent = met & (np.abs(inverse * path_depth - 1.0) > _PLANE)
        bent |= met & (probe.number == NOWHERE) & (inverse * view.depth > _PLANE)
        inverse = _middling(inverse, bent, probe, view.depth)
        inverse = _neighbours(inverse, met, there, probe, view.depth)
        normal = None
        if view.normal is not None:
            normal = _normals(probe, view, view.normal, rays, path_depth)
            inverses, angle = _by_normals(view, normal, rays, path_depth)
            once = there & (probe.bounces == 1) & np.isfinite(inverses).all(axis=0)
            first, second = np.clip(inverses, 0.0, nearest)
            # A mirror that is hollow along one axis may have the second image before the first.
            inverse = np.where(once, np.maximum(first, second), inverse)
            farther = np.where(once, first - second, 0.0)
            turned = np.stack([np.cos(2.0 * angle), np.sin(2.0 * angle)], axis=-1)
            astigmatism = (np.nan_to_num(farther)[..., np.newaxis] * turned).astype(np.float32)
        depth = np.asarray(1.0 / inverse, dtype=np.float32)
    vector = _vectors(probe, view, there, rays, path_depth, inverse, jacobian, reach)
    if there.any() and not there.all():
        # A pixel whose middle shows something else may show some of a mirror too; a path may get lost.
        distance, nearest = ndimage.distance_transform_edt(~there, return_indices=True)
        edge = ~there & ((distance < _EDGE) | probe.there)
        at = tuple(places[edge] for places in nearest)
        depth[edge] = depth[at]
        astigmatism[edge] = astigmatism[at]
        if vector is not None:
            vector[edge] = vector[at]
    return Seen(there, depth, path_depth.astype(np.float32), astigmatism, normal, vector)


def _normals(
    probe: Probe, view: View, normal: Float32Array, rays: FloatArray, path_depth: FloatArray
) -> Float32Array:
    """Return normals of mirrors at the very samples; a renderer's are those of whole pixels."""
    nowhere = probe.number == NOWHERE
    at_end = probe.place[0] + np.where(nowhere[..., np.newaxis], 0.0, view.eye)
    image = rays * np.where(nowhere, 1.0, path_depth)[..., np.newaxis]
    way = np.linalg.norm(at_end - np.where(nowhere[..., np.newaxis], 0.0, view.eye) - image, axis=-1)
    sure = (probe.bounces == 1) & (probe.number != 0) & (nowhere | (way > _TOUCHING * view.depth))
    found = _mirror_planes(view, rays, at_end, path_depth, nowhere)[..., :3]
    return np.where(sure[..., np.newaxis], found, normal).astype(np.float32)


def _by_normals(
    view: View, normal: Float32Array, rays: FloatArray, path_depth: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return two inverse depths at which what is seen after one reflection appears: the mirror equation.

    A mirror at distance p that turns from sample to sample turns what it reflects by u beyond what a plane
    one does. A point at q behind it, seen with f u = g, appears at 1/i = (p + g q) / (p (p + q + g q)): at
    p + q for g = 0, and at the mirror itself if it turns fast. As a matrix of the picture's axes g has two
    such values, and the axes that they belong to.

    Returns
    -------
    inverses : ndarray of float64 of shape (2, rows, columns)
        The first belongs to the axis along which the mirror bulges more; it is the larger one unless the
        mirror is hollow along the other.
    angle : ndarray of float64 of shape (rows, columns)
        Of the axis that the second belongs to, from x to y, which is down.
    """
    length = np.linalg.norm(rays, axis=-1)
    way = rays / length[..., np.newaxis]
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float64)
        p = view.depth * length
        far = p / np.maximum(path_depth * length - p, _LEAST_PATH * p)
    camera = view.paths.camera.at(0.0)[:3, :3]
    ahead = camera[2] / np.linalg.norm(camera[2])
    sides = camera[:2] - np.outer(camera[:2] @ ahead, ahead)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    g = np.empty((*view.depth.shape, 2, 2))
    for n, (axis, focal) in enumerate(zip((1, 0), view.focal_px(), strict=True)):
        turn, known = _along(view, unit, axis)
        along = (way * turn).sum(axis=-1, keepdims=True)
        u = 2.0 * (along * unit - (way * unit).sum(axis=-1, keepdims=True) * turn)
        g[..., n] = focal * (u @ sides.T)
        # A face of a single sample: what it shows is as good as on it.
        g[~known, n, n] = _SHARPLY_CURVED
    mean, difference = 0.5 * (g[..., 0, 0] + g[..., 1, 1]), 0.5 * (g[..., 0, 0] - g[..., 1, 1])
    aslant = 0.5 * (g[..., 0, 1] + g[..., 1, 0])
    spread = np.hypot(difference, aslant)
    # The axis of the larger value; the other is square to it.
    angle = 0.5 * np.arctan2(aslant, difference) + 0.5 * np.pi
    with np.errstate(divide="ignore", invalid="ignore"):
        values = [length * (far + k) / (p * (1.0 + far + k)) for k in (mean + spread, mean - spread)]
    return np.stack(values), angle


def _along(view: View, normal: FloatArray, axis: int) -> tuple[FloatArray, Mask]:
    """Return the change of normals from sample to sample of one face, and where it has a neighbour."""
    with np.errstate(divide="ignore"):
        near = 1.0 / view.depth
    ahead = np.roll(near, -1, axis)
    with np.errstate(invalid="ignore"):
        same = np.abs(near - ahead) <= _STEP * np.maximum(near, ahead)
        same &= (normal * np.roll(normal, -1, axis)).sum(axis=-1) > _SAME_WAY
    if view.index is not None:
        same &= view.index == np.roll(view.index, -1, axis)
    same[(slice(None),) * axis + (-1,)] = False
    step = np.where(same[..., np.newaxis], np.roll(normal, -1, axis) - normal, 0.0)
    count = same.astype(int) + np.roll(same, 1, axis)
    change = np.nan_to_num((step + np.roll(step, 1, axis)) / np.maximum(count, 1)[..., np.newaxis])
    return change, count > 0


def _neighbours(
    inverse: FloatArray, met: Mask, there: Mask, probe: Probe, surface: Float32Array
) -> FloatArray:
    """Return inverse depths also where samples beside each other do not tell them: those of samples nearby.

    Along the edges of what is seen in curved surfaces they are far nearer than the length of the path.
    """
    if not met.any() or not (there & ~met).any():
        return inverse
    distance, nearest = ndimage.distance_transform_edt(~met, return_indices=True)
    at = tuple(nearest)
    near = there & ~met & (distance <= _NEARBY) & (probe.bounces[at] == probe.bounces)
    near &= np.abs(surface[at] - surface) <= _SAME_SURFACE * surface
    return np.where(near, inverse[at], inverse)


def _middling(inverse: FloatArray, bent: Mask, probe: Probe, surface: Float32Array) -> FloatArray:
    """Return inverse depths with the middle one of those around where a curved surface shows something.

    Small faces, and things far away that the next sample has left behind, make single ones useless.
    """
    rows, columns = np.nonzero(bent)
    result = inverse.copy()
    steps = range(-_AROUND, _AROUND + 1)
    for begin in range(0, rows.size, _AT_ONCE):
        row, column = rows[begin : begin + _AT_ONCE], columns[begin : begin + _AT_ONCE]
        values = []
        for j in steps:
            for i in steps:
                y, x = np.clip(row + j, 0, bent.shape[0] - 1), np.clip(column + i, 0, bent.shape[1] - 1)
                same = bent[y, x] & (probe.bounces[y, x] == probe.bounces[row, column])
                same &= np.abs(surface[y, x] - surface[row, column]) <= _SAME_SURFACE * surface[row, column]
                values.append(np.where(same, inverse[y, x], np.nan))
        result[row, column] = np.nanmedian(values, axis=0)
    return result


def _jacobian(probe: Probe) -> tuple[FloatArray, Mask]:
    """Return how the places that are seen go on from sample to sample, (rows, columns, 3, 2), where known."""
    place = probe.place[0].astype(np.float64)
    jacobian = np.zeros((*place.shape, 2))
    known = np.ones(place.shape[:2], dtype=bool)
    for n, axis in enumerate((1, 0)):
        same = np.ones(place.shape[:2], dtype=bool)
        for values in (probe.number, probe.bounces):
            same &= values == np.roll(values, -1, axis)
        last = (slice(None),) * axis + (-1,)
        same[last] = False
        step = np.where(same[..., np.newaxis], np.roll(place, -1, axis) - place, 0.0)
        before, behind = np.roll(same, 1, axis), np.roll(step, 1, axis)
        count = same.astype(int) + before
        jacobian[..., n] = (step + behind) / np.maximum(count, 1)[..., np.newaxis]
        known &= count > 0
    return jacobian, known


def _shifts(probe: Probe, jacobian: FloatArray, known: Mask) -> tuple[FloatArray, Mask]:
    """Return the pixels by which what is seen shifts in each shifted camera, and where that is sure."""
    shifts = np.zeros((*known.shape, 2))
    sure = np.zeros((*known.shape, 2), dtype=bool)
    j = jacobian[known]
    square = np.einsum("nia,nib->nab", j, j)
    determinant = np.linalg.det(square)
    size = np.trace(square, axis1=1, axis2=2)
    good = determinant > 1e-8 * size * size
    square[~good] = np.eye(2)
    inverse = np.linalg.inv(square)
    for n in range(2):
        way = (probe.place[1 + n] - probe.place[0])[known].astype(np.float64)
        shift = np.einsum("nab,nib,ni->na", inverse, j, way)
        left = np.linalg.norm(way - np.einsum("nia,na->ni", j, shift), axis=1)
        length = np.linalg.norm(shift, axis=1)
        fits = good & (length < _LARGEST_STEP)
        fits &= left < _OFF_THE_SURFACE * np.sqrt(0.5 * size) * np.maximum(length, 0.5)
        shifts[known, n], sure[known, n] = shift[:, n], fits
    return shifts, sure


def _vectors(
    probe: Probe,
    view: View,
    there: Mask,
    rays: FloatArray,
    path_depth: FloatArray,
    inverse: FloatArray,
    jacobian: FloatArray,
    reach: float,
) -> Float32Array | None:
    """Return the motion of what is seen as Blender's vector pass has it, None where nothing moves.

    In a plane mirror an object's path is its mirror image, through glass that does not bend much it is its
    own. Elsewhere what is seen goes with the surface that shows it, and by the motion of the object at the
    end as its places go from sample to sample.
    """
    paths = view.paths
    if not (paths.camera.moves or paths.objects):
        return None
    seen = _tracks(probe, view, there)
    mirrors = probe.bounces % GLASS_STEP
    through = (mirrors == 0) & (probe.bounces > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        plain = np.abs(inverse * path_depth - 1.0) < _PLANE
        plain |= (probe.number == NOWHERE) & (inverse * view.depth < _PLANE)
    plane = plain & (probe.bounces == 1)
    eye, camera = view.eye, paths.camera
    at_end = np.concatenate([probe.place[0].astype(np.float64), np.ones((*there.shape, 1))], axis=-1)
    at_end[probe.number == NOWHERE, 3] = 0.0
    at_end[..., :3] += at_end[..., 3:] * eye
    image = np.concatenate([rays + inverse[..., np.newaxis] * eye, inverse[..., np.newaxis]], axis=-1)
    flat = _mirror_planes(view, rays, at_end, path_depth, probe.number == NOWHERE)
    second = _tracks_by_name(probe, view, there & ~plane & (mirrors > 0))
    moves = there & (paths.camera.moves | (seen > 0) | (second > 0) | (view.track > 0))
    if not moves.any():
        return None
    nearest_flat = flat[moves]
    if plane.any():
        _, nearest = ndimage.distance_transform_edt(~plane, return_indices=True)
        nearest_flat = flat[tuple(nearest)][moves]
    sides = []
    for time in (-reach, reach):
        place = _places(image[moves], camera.at(time))
        ends = _moved(paths, seen[moves], at_end[moves], time)
        surfaces = _moved_frames(paths, view.track[moves], time)
        in_plane, straight = plane[moves], through[moves] & plain[moves]
        bent = ~(in_plane | straight)
        mirrored = _reflected(ends, _moved_planes(flat[moves], surfaces))
        place[in_plane] = _places(mirrored, camera.at(time))[in_plane]
        way = ends - at_end[moves]
        # A moving thing in a mirror that light passes or is reflected by: its image goes with it.
        carrier = _moved_frames(paths, second[moves], time)
        inside = _reflected(image[moves], nearest_flat)
        inside = _reflected(np.einsum("nab,nb->na", carrier, inside), _moved_planes(nearest_flat, surfaces))
        place[straight] = _places(image[moves] + way * image[moves][:, 3:], camera.at(time))[straight]
        going = np.einsum("nab,nb->na", surfaces, image[moves])
        going = np.where((second[moves] > 0)[:, np.newaxis], inside, going)
        place[bent] = (_places(going, camera.at(time)) + _carried(jacobian[moves], way[:, :3]))[bent]
        sides.append(place - _places(image[moves], camera.at(0.0)))
    return _as_vector(moves, sides[0], sides[1], reach)


def _as_vector(moves: Mask, before: FloatArray, after: FloatArray, reach: float) -> Float32Array | None:
    """Return displacements at two times as those of a frame before and after, on one parabola."""
    velocity = 0.5 * (after - before) / reach
    acceleration = 0.5 * (after + before) / (reach * reach)
    x, y = (acceleration - velocity).T, (acceleration + velocity).T
    vector = np.zeros((*moves.shape, 4), dtype=np.float32)
    values = np.nan_to_num(np.stack([x[0], -x[1], -y[0], y[1]], axis=-1), posinf=0.0, neginf=0.0)
    vector[moves] = values
    return vector


def _tracks(probe: Probe, view: View, there: Mask) -> npt.NDArray[np.int32]:
    """Return the number, from 1, of the moving object that each place is of; 0 for none."""
    found = np.zeros(there.shape, dtype=np.int32)
    eye = view.eye
    for number, name in probe.names.items():
        candidates = [
            (n, path)
            for n, path in enumerate(view.paths.objects, start=1)
            if path.name == name or path.name.endswith(f"/{name}")
        ]
        if not candidates:
            continue
        at = there & (probe.number == number)
        if not at.any():
            continue
        places = probe.place[0][at].astype(np.float64) + eye
        off = np.stack([_off_box(path, places) for _, path in candidates])
        best = off.argmin(axis=0)
        numbers = np.array([n for n, _ in candidates], dtype=np.int32)[best]
        found[at] = np.where(off.min(axis=0) <= 1.0 + _IN_BOX, numbers, 0)
    return found


def _tracks_by_name(probe: Probe, view: View, there: Mask) -> npt.NDArray[np.int32]:
    """Return the number, from 1, of the moving object from which a path goes on next; 0 for none."""
    found = np.zeros(there.shape, dtype=np.int32)
    numbers = {path.name: n for n, path in enumerate(view.paths.objects, start=1)}
    for number in np.unique(probe.second[there]):
        # Of instances it is not known which one that is.
        found[there & (probe.second == number)] = numbers.get(probe.names.get(int(number), ""), 0)
    return found


def _off_box(path: ObjectPath, places: FloatArray) -> FloatArray:
    """Return how far places are from the middle of an object's box, 1 on its sides."""
    inverse = np.linalg.inv(path.at(0.0))
    local = places @ inverse[:3, :3].T + inverse[:3, 3]
    half = 0.5 * (path.box[1] - path.box[0])
    half = np.maximum(half, 1e-3 * half.max(initial=1e-9))
    return np.asarray((np.abs(local - path.box.mean(axis=0)) / half).max(axis=1))


def _moved(paths: MotionPaths, track: npt.NDArray[np.int32], ends: FloatArray, time: float) -> FloatArray:
    """Return where places are at a time."""
    return np.asarray(np.einsum("nab,nb->na", _moved_frames(paths, track, time), ends))


def _moved_frames(paths: MotionPaths, track: npt.NDArray[np.int32], time: float) -> FloatArray:
    """Return what takes each sample's world at the rendered frame to that of a time, (n, 4, 4)."""
    frames = [np.eye(4)]
    for path in paths.objects:
        still = path.deforming
        frames.append(np.eye(4) if still else path.at(time) @ np.linalg.inv(path.at(0.0)))
    return np.asarray(np.stack(frames)[np.maximum(track, 0)])


def _mirror_planes(
    view: View, rays: FloatArray, at_end: FloatArray, path_depth: FloatArray, nowhere: Mask
) -> FloatArray:
    """Return the plane, (normal, offset), in which each sample's end is the image that is seen.

    A mirror lies half-way between what it shows and where that appears.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        image = view.eye + rays * np.where(nowhere, 1.0, path_depth)[..., np.newaxis]
        way = np.where(
            nowhere[..., np.newaxis],
            at_end[..., :3] - rays / np.linalg.norm(rays, axis=-1, keepdims=True),
            at_end[..., :3] - image,
        )
        normal = way / np.linalg.norm(way, axis=-1, keepdims=True)
        surface = view.eye + rays * view.depth[..., np.newaxis]
        half_way = np.where(nowhere[..., np.newaxis], surface, 0.5 * (image + at_end[..., :3]))
        offset = -(normal * half_way).sum(axis=-1)
    return np.asarray(np.nan_to_num(np.concatenate([normal, offset[..., np.newaxis]], axis=-1)))


def _moved_planes(planes: FloatArray, frames: FloatArray) -> FloatArray:
    """Return planes that go with their surfaces, with unit normals."""
    moved: FloatArray = np.einsum("nba,nb->na", np.linalg.inv(frames), planes)
    return np.asarray(moved / np.maximum(np.linalg.norm(moved[:, :3], axis=1, keepdims=True), 1e-12))


def _reflected(points: FloatArray, planes: FloatArray) -> FloatArray:
    """Return the mirror images of homogeneous points."""
    reflected: FloatArray = points.copy()
    reflected[:, :3] -= 2.0 * (points * planes).sum(axis=1, keepdims=True) * planes[:, :3]
    return reflected


def _carried(jacobian: FloatArray, way: FloatArray) -> FloatArray:
    """Return by how many pixels something is seen to go that goes a way at the end of its path."""
    if not way.any():
        return np.zeros((way.shape[0], 2))
    square = np.einsum("nia,nib->nab", jacobian, jacobian)
    size = np.trace(square, axis1=1, axis2=2)[:, np.newaxis, np.newaxis]
    square += np.eye(2) * np.maximum(1e-6 * size, 1e-12)
    return np.asarray(np.einsum("nab,nib,ni->na", np.linalg.inv(square), jacobian, way))


def _places(points: FloatArray, camera: FloatArray) -> FloatArray:
    """Return the pixels at which homogeneous points of the world are seen."""
    seen = points @ camera[:3].T
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(seen[:, :2] / seen[:, 2:])


def indices(probe: Probe, of_objects: Mapping[str, int]) -> npt.NDArray[np.int32]:
    """Return the pass indices of the objects that a probe saw, 0 where it saw none.

    Parameters
    ----------
    probe : Probe
        What was seen.
    of_objects : mapping of str to int
        Pass indices by full names.

    Returns
    -------
    ndarray of int32 of shape (rows, columns)
        Indices.
    """
    table = np.zeros(max(probe.names, default=0) + 1, dtype=np.int32)
    for number, name in probe.names.items():
        table[number] = of_objects.get(name, 0)
    return np.asarray(table[np.clip(probe.number, 0, table.size - 1)])


def patches(
    probe: Probe,
    depth: Float32Array,
    normal: Float32Array,
    index: npt.NDArray[np.int32] | None,
    vector: Float32Array | None = None,
) -> tuple[npt.NDArray[np.int32], Mask]:
    """Part mirrors and glass into patches that show something each by itself, as the faces of a cube do.

    Where samples beside each other are of different objects or depths, or face different ways, patches end;
    in what a mirror shows of other mirrors also where those end, or where what they show jumps. Patches near
    each other are given different numbers, as few as will do.

    Parameters
    ----------
    probe : Probe
        What was seen.
    depth : ndarray of float32 of shape (rows, columns)
        Depth of the surfaces in metres.
    normal : ndarray of float32 of shape (rows, columns, 3)
        Their normals.
    index : ndarray of int32 of shape (rows, columns) or None
        Their object indices.
    vector : ndarray of float32 of shape (rows, columns, 4), optional
        Motion of what is seen: the edges of mirrors that move in a mirror part nothing.

    Returns
    -------
    number : ndarray of int32 of shape (rows, columns)
        From 1; 0 where there is no mirror or glass.
    small : ndarray of bool of shape (rows, columns)
        Which samples are of small patches, which have one number.
    """
    # A path that got lost tells nothing of patches.
    there = probe.there & (probe.number != 0)
    result = np.zeros(there.shape, dtype=np.int32)
    if not there.any():
        return result, np.zeros(there.shape, dtype=bool)
    ids = np.arange(there.size).reshape(there.shape)
    moves = np.zeros(there.shape, dtype=bool) if vector is None else (vector != 0.0).any(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = 1.0 / depth
        unit = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    edges = []
    for axis in (1, 0):
        here, next_ = _pairs(axis)
        with np.errstate(invalid="ignore"):
            joined = there[here] & there[next_]
            joined &= (unit[here] * unit[next_]).sum(axis=-1) > _SAME_WAY
            joined &= np.abs(near[here] - near[next_]) <= _STEP * np.maximum(near[here], near[next_])
        if index is not None:
            joined &= index[here] == index[next_]
        joined &= ~_jumps(probe, axis) | moves[here] | moves[next_]
        edges.append((ids[here][joined], ids[next_][joined]))
    begin, end = (np.concatenate(ends) for ends in zip(*edges, strict=True))
    graph = sparse.coo_array((np.ones(begin.size, dtype=np.int8), (begin, end)), shape=(there.size,) * 2)
    _, label = sparse.csgraph.connected_components(graph, directed=False)
    found = label[there.reshape(-1)]
    sizes = np.bincount(found)
    large = np.flatnonzero(sizes >= _SMALL_PATCH)
    # The small ones are one patch, which is everywhere.
    order = np.full(sizes.size, large.size)
    order[large[np.argsort(-sizes[large], kind="stable")]] = np.arange(large.size)
    patch = np.full(there.shape, -1)
    patch[there] = order[found]
    numbers = _numbered(patch, large.size)
    result[there] = numbers[patch[there]]
    return result, patch == large.size


def _pairs(axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return which samples have one after them along an axis, and those."""
    every, first, onward = slice(None), slice(None, -1), slice(1, None)
    return ((every, first), (every, onward)) if axis == 1 else ((first, every), (onward, every))


def _jumps(probe: Probe, axis: int) -> Mask:
    """Return between which samples along an axis what is seen in a mirror's mirror jumps.

    Whether that is an edge of the second mirror, which is sharp, or of what it shows is not known.
    """
    step = np.linalg.norm(np.diff(probe.place[0], axis=axis), axis=-1)
    here, next_ = _pairs(axis)
    mirrors = probe.bounces % GLASS_STEP
    twice = ((probe.second[here] > 0) & (mirrors[here] > 0)) | (
        (probe.second[next_] > 0) & (mirrors[next_] > 0)
    )
    other = (probe.number[here] != probe.number[next_]) | (probe.second[here] != probe.second[next_])
    around = np.minimum(np.roll(step, 1, axis), np.roll(step, -1, axis))
    return np.asarray(twice & (other | (step > _JUMP * around)))


def _numbered(patch: npt.NDArray[np.int64], count: int) -> npt.NDArray[np.int32]:
    """Return numbers, from 1, of patches in the order of their size and of what is left, at index `count`."""
    blocks: dict[tuple[int, int], set[int]] = {}
    for j in range(0, patch.shape[0], _BLOCK):
        for i in range(0, patch.shape[1], _BLOCK):
            inside = set(np.unique(patch[j : j + _BLOCK, i : i + _BLOCK]).tolist()) - {-1, count}
            if inside:
                blocks[j // _BLOCK, i // _BLOCK] = inside
    beside: dict[int, set[int]] = {n: set() for n in range(count)}
    for (j, i), inside in blocks.items():
        around = set().union(*(blocks.get((j + y, i + x), set()) for y in (-1, 0, 1) for x in (-1, 0, 1)))
        for n in inside:
            beside[n] |= around - {n}
    numbers = np.zeros(count + 1, dtype=np.int32)
    for n in range(count):
        taken = [int(numbers[other]) for other in beside[n] if other < n]
        free = [k for k in range(1, _MOST_NUMBERS + 1) if k not in taken]
        numbers[n] = free[0] if free else min(range(1, _MOST_NUMBERS + 1), key=taken.count)
    numbers[count] = numbers.max() + 1
    return numbers


def on_their_surfaces(seen: Seen, small: Mask, depth: Float32Array) -> None:
    """Let what small patches show appear on them: their edges, not what they show, are what one sees.

    Parameters
    ----------
    seen : Seen
        Changed in place.
    small : ndarray of bool of shape (rows, columns)
        Samples of small patches.
    depth : ndarray of float32 of shape (rows, columns)
        Depth of the surfaces in metres.
    """
    seen.depth[small] = depth[small]
    seen.astigmatism[small] = 0.0


def spread_numbers(number: npt.NDArray[np.int32], wanted: Mask) -> npt.NDArray[np.int32]:
    """Return numbers of patches also where only a part of a pixel is of one: those of the nearest."""
    if not number.any() or not (wanted & (number == 0)).any():
        return number
    _, nearest = ndimage.distance_transform_edt(number == 0, return_indices=True)
    return np.where(wanted, number[tuple(nearest)], number)


def grown(there: Mask, *, mixed: bool) -> Mask:
    """Return samples that may show some of what others show: pixels at edges mix surfaces, points do not."""
    return ndimage.binary_dilation(there, np.ones((3, 3), bool)) if mixed else there


def seen_light(direct: Float32Array, indirect: Float32Array, color: Float32Array) -> Float32Array:
    """Return the light that surfaces reflect, or let through, with what share of white light they do.

    Parameters
    ----------
    direct, indirect : ndarray of float32 of shape (rows, columns, 3)
        The renderer's light passes, over the surfaces' colour.
    color : ndarray of float32 of shape (rows, columns, 3)
        The surfaces' colour.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        Light, and the largest of the shares of red, green and blue.
    """
    light = np.empty((*color.shape[:2], 4), dtype=np.float32)
    light[..., :3] = color * (direct + indirect)
    light[..., 3] = color.max(axis=-1)
    return light


def within(light: Float32Array, color: Float32Array) -> Float32Array:
    """Return a part of a picture's light that is no more than all of it, nor less than none.

    Parameters
    ----------
    light : ndarray of float32 of shape (rows, columns, 4)
        The part; its fourth channel stays.
    color : ndarray of float32 of shape (rows, columns, 3 or 4)
        The picture.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        The part.
    """
    result = light.copy()
    np.clip(light[..., :3], 0.0, np.maximum(color[..., :3], 0.0), out=result[..., :3])
    return result


def as_share(light: Float32Array, noisy: Float32Array, color: Float32Array) -> Float32Array:
    """Return light of a picture that was not denoised as the same share of one that was.

    Parameters
    ----------
    light : ndarray of float32 of shape (rows, columns, 4)
        A part of the picture's light; its fourth channel stays.
    noisy : ndarray of float32 of shape (rows, columns, 3 or 4)
        The picture before it was denoised.
    color : ndarray of float32 of shape (rows, columns, 4)
        The denoised picture.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        The part.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(np.nan_to_num(light[..., :3] / noisy[..., :3]), 0.0, 1.0)
    result = light.copy()
    result[..., :3] = share * color[..., :3]
    return result
