"""Where the camera and the scene's objects are while the shutter is open, from the evaluated scene.

The scene is evaluated at frames and between them, and what Blender says of every instance is written down:
keyframes, parents, constraints, drivers, physics, instancers and geometry nodes all count, since none of
them is looked at. Frame-change handlers of other add-ons run at each of these times, as in playback.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..potmesil_addon.camera import Camera
from ..potmesil_addon.lens import FloatArray, Lens
from ..potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath, thinned
from ..potmesil_addon.shutter import ShutterAttributes
from .borrow import Borrowed
from .boxes import UNIT_CORNERS, Boxes
from .scene import (
    RENDERED_TYPES,
    evaluated_camera,
    scene_camera,
    scene_exposure,
    scene_lens,
    uses_reflections,
)

LARGEST_MARGIN = 0.25
"""Widest overscan, as a share of the picture's side: a render of at most 2.25 times the pixels."""

_TOLERANCE_PX = 0.1
"""How far from its path's straight pieces a point may be seen before a piece is halved."""

_THINNING_PX = 0.05
"""How far leaving out a time may move a point."""

_STILL_PX = 1e-3
"""Less motion than this is the noise of single precision."""

_SHORTEST = 1.0 / 64.0
"""Frames; pieces of a path are not made shorter."""

_FIRST_TIMES = tuple(n / 4.0 for n in range(-4, 5))
"""Frames from the rendered one, as far as the vector pass reaches: the shutter may be opened wider later."""

_REACH = 0.6
"""How far from its middle, in units of its size, the frame reaches for points that paths are held to."""

_STILL_BOXES = 512
"""So many boxes of things at rest tell well enough how a moving camera's view changes."""

_BOX_MARGIN = 1.0
"""Share of its own size by which a box grows before it is said to be out of view: hair and displacement."""

_STILL_SHAPE = 1e-5
"""Share of an object's size; vertices that move less are at rest."""

_FLAT = 1e-3
"""Thickness, as a share of the largest scale, for what is scaled flat: paths are inverted."""

_SAMPLING_SHARE = 0.9
"""Share of the progress for evaluating the scene; the rest is choosing the times that are kept."""

_LATTICE = np.array([(x, y, z) for x in (0, 1, 2) for y in (0, 1, 2) for z in (0, 1, 2)]) / 2.0

_PHYSICS_MODIFIERS = {
    "CLOTH", "COLLISION", "SOFT_BODY", "FLUID", "DYNAMIC_PAINT", "PARTICLE_SYSTEM", "PARTICLE_INSTANCE",
    "EXPLODE",
}  # fmt: skip

_SUBDIVIDING_MODIFIERS = {"SUBSURF", "MULTIRES"}

_Key = tuple[str, str | None, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class SampledMotion:
    """What sampling a scene's motion found.

    Parameters
    ----------
    paths : MotionPaths
        Paths of the camera and of what moves or deforms and may be in view at the rendered frame.
    camera : Camera
        The camera at the rendered frame, as a render has it.
    lens : Lens
        Its lens there.
    shutter : ShutterAttributes
        The exposure there.
    moving : frozenset of str
        Full names of the objects that moving things belong to: the objects themselves, or the
        instancers of moving instances. To hide these is to hide all that moves.
    still : frozenset of str
        Full names of the objects and instancers that all else belongs to.
    pairs : frozenset of (str, str or None)
        Full names of every object that renders and of its instancer.
    margins : tuple of int
        Columns and rows around the picture from which something comes into it during the exposure.
    boxes : Boxes
        Every instance that may be in view at the rendered frame.
    """

    paths: MotionPaths
    camera: Camera
    lens: Lens
    shutter: ShutterAttributes
    moving: frozenset[str]
    still: frozenset[str]
    pairs: frozenset[tuple[str, str | None]]
    margins: tuple[int, int]
    boxes: Boxes


@contextlib.contextmanager
def kept_scene(scene: bpy.types.Scene) -> Iterator[None]:
    """Bring a scene back to its frame, with changes that were never keyed, when the block ends.

    Going to another frame, and a render too, gives everything animated the value of its curve or driver.

    Parameters
    ----------
    scene : Scene
        The scene.
    """
    frame, subframe, camera = scene.frame_current, scene.frame_subframe, scene.camera
    before = [(item, path, value) for item, path in _animated() for value in _read(item, path)]
    try:
        yield
    finally:
        if (scene.frame_current, scene.frame_subframe) != (frame, subframe):
            go_to(scene, frame + subframe)
        for item, path, value in before:
            # What was deleted in the meantime is left alone.
            with contextlib.suppress(ReferenceError):
                if any(now != value for now in _read(item, path)):
                    _write(item, path, value)
        # A marker may have chosen another camera.
        with contextlib.suppress(ReferenceError):
            if scene.camera != camera:
                scene.camera = camera


def go_to(scene: bpy.types.Scene, time: float) -> None:
    """Evaluate a scene at a time in frames.

    Before frame 0 Blender says a time as the next whole frame and a negative rest, which it does not take
    when it is given one.

    Parameters
    ----------
    scene : Scene
        The scene.
    time : float
        Frame and the part of one after it.
    """
    scene.frame_set(math.floor(time), subframe=time - math.floor(time))


def sample_motion(scene: bpy.types.Scene) -> Generator[float, None, SampledMotion]:
    """Evaluate a scene over the shutter's interval, and at least from a frame before to a frame after.

    Times lie a quarter of a frame apart, and closer (down to 1/64) where the way that a point of a
    moving object's box, or of the scene at rest, is seen to take between two times is off the path by
    more than 0.1 pixel. The resolution counts as it is set when this begins.

    An object is listed where it may be in view at the rendered frame; one that is not has no samples.
    Instances are told apart by their object, instancer and number. Not covered are:

    - physics and simulations that are neither baked nor played up to the frame;
    - objects with physics that only the render shows, and subdivision, which counts as in the viewport;
    - shapes that change but are the same at the frame, at the ends of the range and at those of the
      shutter, hair that only its particle system moves, and the shapes that a geometry-nodes instance
      of no object of its own changes to;
    - lights, which have no pass index.

    Parameters
    ----------
    scene : Scene
        A scene with a camera.

    Yields
    ------
    float
        Share of the work done, as far as it is known.

    Returns
    -------
    SampledMotion
        Paths, and which objects move.

    Raises
    ------
    InputError
        If the scene has no camera.
    """
    with kept_scene(scene), Borrowed() as borrowed:
        _show_what_renders(borrowed, scene)
        sampler = _Sampler(scene)
        first = sampler.first_times()
        for done, time in enumerate(first):
            sampler.visit(time)
            yield _SAMPLING_SHARE * 0.5 * (done + 1) / len(first)
        suspects = sampler.suspects()
        halved = 0
        while suspects:
            a, c = suspects.pop()
            if c - a < 2.0 * _SHORTEST - 1e-9:
                continue
            b = 0.5 * (a + c)
            sampler.visit(b)
            if sampler.off(a, b, c) > _TOLERANCE_PX:
                suspects.extend([(a, b), (b, c)])
            halved += 1
            known = 0.5 + 0.5 * halved / (halved + len(suspects) + 1)
            yield _SAMPLING_SHARE * known
        return (yield from sampler.result())


@dataclass(slots=True)
class _Instance:
    """An instance at the rendered frame."""

    name: str
    owner: str
    item: bpy.types.Object
    object_index: int
    box: FloatArray


@dataclass(slots=True)
class _Seen:
    """All rendered instances at one time."""

    matrices: dict[_Key, FloatArray] = field(default_factory=dict)
    instances: dict[_Key, _Instance] = field(default_factory=dict)
    pairs: set[tuple[str, str | None]] = field(default_factory=set)


class _Sampler:
    """The scene's instances and camera at all times that were visited."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene = scene
        self.now = scene.frame_current + scene.frame_subframe
        self.rendered = _rendered_names(scene)
        self.cameras: dict[float, FloatArray] = {}
        self.matrices: dict[float, npt.NDArray[np.float64]] = {}
        self.keys: list[_Key] = []
        self.instances: list[_Instance] = []
        self.in_view: list[bool] = []
        self.all_around = uses_reflections(scene)
        self.shapes: dict[str, npt.NDArray[np.float32]] = {}
        self.deforming: set[str] = set()

    def first_times(self) -> list[float]:
        """Return the times to begin with: 0 first, then in an order in which physics can run."""
        shutter = scene_exposure(self.scene).resolve()
        assert shutter is not None
        interval = shutter.interval
        begin, end = min(-1.0, *interval), max(1.0, *interval)
        now = self.now
        # A simulation steps from each whole frame to the next one only.
        whole = _rounded(n - now for n in range(math.ceil(now + begin), math.floor(now + end) + 1))
        times = whole | _rounded((*_FIRST_TIMES, begin, end, *interval))
        forward = sorted(time for time in whole if time > 0.0)
        rest = sorted(times - {0.0, *forward})
        self.shape_times = _rounded((begin, end, *interval, -1.0, 1.0)) - {0.0}
        return [0.0, *forward, *rest]

    def visit(self, time: float) -> None:
        """Evaluate the scene at a time and write down where everything is."""
        scene = self.scene
        if time == 0.0:
            go_to(scene, self.now)
            # After the evaluation, since a marker may choose the camera.
            self.camera_object = scene.camera
        else:
            go_to(scene, self.now + time)
        graphs = [layer.depsgraph for layer in scene.view_layers if layer.use]
        if time == 0.0:
            self._begin(graphs)
        else:
            camera = self.camera_object.evaluated_get(graphs[0])
            self.cameras[time] = scene_camera(scene, camera).matrix
            seen = self._see(graphs).matrices
            absent = np.full((3, 4), np.nan)
            rows = [seen.get(key, absent) for key in self.keys]
            self.matrices[time] = np.array(rows, dtype=np.float64).reshape(-1, 3, 4)
            # What is not there at a time, NaN, did not move by that.
            self.moved |= (np.abs(self.matrices[time] - self.matrices[0.0]) > 0.0).any(axis=(1, 2))
        if time in self.shape_times:
            self._compare_shapes(graphs)

    def _begin(self, graphs: list[bpy.types.Depsgraph]) -> None:
        """Write down the rendered frame, and what may be in view there."""
        scene = self.scene
        camera = evaluated_camera(scene, graphs[0])
        self.camera = scene_camera(scene, camera)
        self.lens = scene_lens(camera)
        self.shutter = scene_exposure(scene)
        self.cameras[0.0] = self.camera.matrix
        self.nearest = max(self.camera.clip_start, 1e-6)
        seen = self._see(graphs, details=True)
        self.pairs = seen.pairs
        for key, instance in seen.instances.items():
            matrix = seen.matrices[key]
            finite = np.isfinite(matrix).all() and np.isfinite(instance.box).all()
            in_view = finite and self._may_be_in_view(matrix, instance.box)
            # A mirror may show what the camera does not.
            if in_view or (finite and self.all_around):
                self.in_view.append(in_view)
                self.keys.append(key)
                self.instances.append(instance)
        rows = [seen.matrices[key] for key in self.keys]
        self.matrices[0.0] = np.array(rows, dtype=np.float64).reshape(-1, 3, 4)
        self.moved = np.zeros(len(self.keys), dtype=bool)
        boxes = np.array([instance.box for instance in self.instances]).reshape(-1, 2, 3)
        low, size = boxes[:, :1], boxes[:, 1:] - boxes[:, :1]
        self.corners = low + UNIT_CORNERS * size
        self.lattice = low + _LATTICE * size
        self.view_points = self._view_points()
        for item in {instance.item.name_full: instance.item for instance in self.instances}.values():
            if _may_deform(item):
                shape = _shape(item.evaluated_get(graphs[0]))
                if shape is not None:
                    self.shapes[item.name_full] = shape

    def _see(self, graphs: list[bpy.types.Depsgraph], *, details: bool = False) -> _Seen:
        """Return the instances that render."""
        seen = _Seen()
        wanted = None if details else set(self.keys)
        for graph in graphs:
            for instance in graph.object_instances:
                item = instance.object
                if item.type not in RENDERED_TYPES or not instance.show_self:
                    continue
                original = item.original
                name = original.name_full
                parent = instance.parent.original if instance.is_instance else None
                key: _Key = (name, None, ())
                if parent is not None:
                    key = (name, parent.name_full, tuple(instance.persistent_id))
                if wanted is not None:
                    if key in wanted:
                        seen.matrices[key] = np.array(instance.matrix_world)[:3]
                    continue
                if key[1 if parent is not None else 0] not in self.rendered:
                    continue
                if parent is not None and parent.instance_type == "COLLECTION" and original.hide_render:
                    continue
                seen.pairs.add(key[:2])
                if key in seen.instances:  # in another view layer too
                    continue
                seen.matrices[key] = np.array(instance.matrix_world)[:3]
                corners = np.array(item.bound_box)
                seen.instances[key] = _Instance(
                    name=name if parent is None else f"{parent.name_full}/{name}",
                    owner=key[1] or name,
                    item=original,
                    object_index=item.pass_index,
                    box=np.stack([corners.min(axis=0), corners.max(axis=0)]),
                )
        return seen

    def _may_be_in_view(self, matrix: FloatArray, box: FloatArray) -> bool:
        """Return whether a box, grown by its own size, reaches into the view at the rendered frame.

        The view is as large as the widest overscan makes it.
        """
        size = box[1] - box[0]
        grown = box + _BOX_MARGIN * np.stack([-size, size])
        corners = grown[0] + UNIT_CORNERS * (grown[1] - grown[0])
        x, y, w = self._homogeneous(self.cameras[0.0], matrix, corners)
        film = self.camera.film
        # A pixel around for the reach of the pixel filter.
        margin_x, margin_y = LARGEST_MARGIN * film.columns + 1.0, LARGEST_MARGIN * film.rows + 1.0
        outside = (
            w < 0.0,
            x < -margin_x * w,
            x > (film.columns + margin_x) * w,
            y < -margin_y * w,
            y > (film.rows + margin_y) * w,
            w > self.camera.clip_end,
        )
        return bool(matrix[:, :3].any()) and not any(side.all() for side in outside)

    @staticmethod
    def _homogeneous(camera: FloatArray, matrix: FloatArray, points: FloatArray) -> tuple[FloatArray, ...]:
        """Return (x'' w'', y'' w'', w'') of points of objects, given as ([n,] points, 3)."""
        world = points @ np.swapaxes(matrix[..., :3], -1, -2) + matrix[..., np.newaxis, :, 3]
        seen = world @ camera[:, :3].T + camera[:, 3]
        return seen[..., 0], seen[..., 1], seen[..., 2]

    def _pixels(self, camera: FloatArray, matrix: FloatArray, points: FloatArray) -> FloatArray:
        """Return pixels, NaN where a point is not in front of the camera or not in the frame."""
        x, y, w = self._homogeneous(camera, matrix, points)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = np.stack([x / w, y / w], axis=-1)
            size = np.array([self.camera.film.columns, self.camera.film.rows])
            near = (np.abs(pixels / size - 0.5) <= _REACH).all(axis=-1) & (w > self.nearest)
        pixels[~near] = np.nan
        return pixels

    def _view_points(self) -> FloatArray:
        """Return points of the world at rest, to see the camera's motion by."""
        film = self.camera.film
        columns, rows = np.meshgrid(np.linspace(0, film.columns, 5), np.linspace(0, film.rows, 5))
        inverse = np.linalg.inv(self.camera.matrix[:, :3])
        ray = np.stack([columns, rows, np.ones_like(columns)], axis=-1).reshape(-1, 3) @ inverse.T
        center = -inverse @ self.camera.matrix[:, 3]
        focus = max(self.lens.focus_distance, 10.0 * self.nearest)
        grid = [center + distance * focus * ray for distance in (1.0, 10.0, 1000.0)]
        return np.concatenate(grid)

    def _still_points(self) -> FloatArray:
        """Return points in the view, and the corners of what is at rest."""
        still = np.flatnonzero(~self.moved)
        chosen = still[:: max(1, still.size // _STILL_BOXES)]
        matrices = self.matrices[0.0][chosen]
        world = self.corners[chosen] @ np.swapaxes(matrices[..., :3], -1, -2) + matrices[:, np.newaxis, :, 3]
        return np.concatenate([self.view_points, world.reshape(-1, 3)])

    def _compare_shapes(self, graphs: list[bpy.types.Depsgraph]) -> None:
        """Find the objects whose shape is not that of the rendered frame."""
        for instance in self.instances:
            name = instance.item.name_full
            if name not in self.shapes:
                continue
            reference = self.shapes[name]
            shape = _shape(instance.item.evaluated_get(graphs[0]))
            size = float(np.ptp(reference)) if reference.size else 0.0
            if (
                shape is None
                or shape.shape != reference.shape
                or (shape.size and float(np.abs(shape - reference).max()) > _STILL_SHAPE * size)
            ):
                self.deforming.add(name)
                del self.shapes[name]

    def suspects(self) -> list[tuple[float, float]]:
        """Return the intervals at whose ends a path is off its neighbours' straight line."""
        times = sorted(self.cameras)
        found: dict[tuple[float, float], None] = {}
        for a, b, c in zip(times, times[1:], times[2:], strict=False):
            if self.off(a, b, c) > _TOLERANCE_PX:
                found[a, b] = found[b, c] = None
        return list(found)

    def off(self, a: float, b: float, c: float) -> float:
        """Return how far, in pixels, paths stored at a and c alone would show a point off its place at b."""
        share = (b - a) / (c - a)
        camera = (1.0 - share) * self.cameras[a] + share * self.cameras[c]
        worst = 0.0
        if (self.cameras[a] != self.cameras[b]).any() or (self.cameras[c] != self.cameras[b]).any():
            identity = np.eye(3, 4)
            points = self._still_points()
            worst = _farthest(
                self._pixels(self.cameras[b], identity, points), self._pixels(camera, identity, points)
            )
        moved = self.moved
        if moved.any():
            before, now, after = (self.matrices[time][moved] for time in (a, b, c))
            line = (1.0 - share) * before + share * after
            points = self.lattice[moved]
            places = self._pixels(self.cameras[b], now, points)
            worst = max(worst, _farthest(places, self._pixels(camera, line, points)))
        return worst

    def result(self) -> Generator[float, None, SampledMotion]:
        """Return the paths, at no more times than they need."""
        times = np.array(sorted(self.cameras))
        objects = []
        owners = set()
        all_matrices = np.stack([self.matrices[time] for time in times], axis=1)
        for n, instance in enumerate(self.instances):
            deforming = instance.item.name_full in self.deforming and not self._is_generated(n)
            if not (self.moved[n] or deforming):
                continue
            yield _SAMPLING_SHARE + (1.0 - _SAMPLING_SHARE) * n / len(self.instances)
            path = self._object_path(n, times, all_matrices[n], deforming=deforming)
            if path is not None:
                objects.append(path)
                owners.add(instance.owner)
        moving = _whole_instancers(owners, self.pairs)
        still = {parent or name for name, parent in self.pairs} - moving
        return SampledMotion(
            paths=MotionPaths(self._camera_path(times), tuple(objects)),
            camera=self.camera,
            lens=self.lens,
            shutter=self.shutter,
            moving=frozenset(moving),
            still=frozenset(still),
            pairs=frozenset(self.pairs),
            margins=self._margins(),
            boxes=self._boxes(),
        )

    def _boxes(self) -> Boxes:
        """Return where the instances' boxes are at the rendered frame."""
        seen = np.flatnonzero(self.in_view)
        matrices = self.matrices[0.0][seen]
        world = self.corners[seen] @ np.swapaxes(matrices[..., :3], -1, -2) + matrices[:, np.newaxis, :, 3]
        return Boxes(tuple(self.instances[n].owner for n in seen), world)

    def _margins(self) -> tuple[int, int]:
        """Return how far, across and down, things at the picture's border move during the exposure."""
        shutter = self.shutter.resolve()
        assert shutter is not None
        begin, end = shutter.interval
        film = self.camera.film
        size = np.array([film.columns, film.rows])
        identity = np.eye(3, 4)
        still = self._still_points()
        before = self._places(self.cameras[0.0], identity, still)
        moved = np.flatnonzero(self.moved)
        moved_before = self._places(self.cameras[0.0], self.matrices[0.0][moved], self.lattice[moved])
        # What is inside all of the time has nothing to bring in.
        crossing = ~_inside(moved_before, size).all(axis=1)
        farthest = np.zeros(2)
        for time, camera in self.cameras.items():
            if not begin <= time <= end:
                continue
            ways = [(before, self._places(camera, identity, still))]
            if crossing.any():
                chosen = moved[crossing]
                now = self._places(camera, self.matrices[time][chosen], self.lattice[chosen])
                ways.append((moved_before[crossing], now))
            for old, new in ways:
                seen = _inside(old, size) | _inside(new, size)
                way = np.nan_to_num(np.abs(new - old)[seen])
                farthest = np.maximum(farthest, way.max(axis=0, initial=0.0))
        needed = np.where(farthest > _STILL_PX, np.ceil(farthest) + 1.0, 0.0)
        columns, rows = np.minimum(needed, LARGEST_MARGIN * size).astype(int)
        return int(columns), int(rows)

    def _places(self, camera: FloatArray, matrix: FloatArray, points: FloatArray) -> FloatArray:
        """Return pixels, NaN where a point is not in front of the camera."""
        x, y, w = self._homogeneous(camera, matrix, points)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = np.stack([x / w, y / w], axis=-1)
        pixels[~(w > self.nearest)] = np.nan
        return pixels

    def _is_generated(self, n: int) -> bool:
        """Return whether an instance is of geometry that its instancer's nodes made, and of no object."""
        name, parent, _ = self.keys[n]
        return name == parent

    def _object_path(
        self, n: int, times: FloatArray, matrices: FloatArray, *, deforming: bool
    ) -> ObjectPath | None:
        """Return an instance's path, or None for one at rest."""
        zero = int(np.searchsorted(times, 0.0))
        there = np.isfinite(matrices).all(axis=(1, 2))
        # Something that is born or dies: the times around the rendered frame at which it is there.
        gone = np.flatnonzero(~there)
        begin = int(gone[gone < zero].max(initial=-1)) + 1
        end = int(gone[gone > zero].min(initial=times.size))
        times, matrices, zero = times[begin:end], matrices[begin:end], zero - begin

        world = self.corners[n] @ np.swapaxes(matrices[..., :3], 1, 2) + matrices[:, np.newaxis, :, 3]
        scaled = world * self._pixels_per_unit(n)
        keep = np.zeros(times.size, dtype=bool)
        keep[zero] = True
        if float(np.abs(scaled - scaled[zero]).max()) > _STILL_PX:
            # Matrices are interpolated, so points go straight in the world and not in the picture: it is
            # there that the line is held to, at the scale of the picture.
            pairs = np.concatenate([scaled[..., :2], scaled[..., [2, 2]] * [1.0, 0.0]], axis=1)
            keep = thinned(times, matrices, pairs, _THINNING_PX)
        elif not deforming:
            return None
        instance = self.instances[n]
        return ObjectPath(
            name=instance.name,
            object_index=instance.object_index,
            times=times[keep],
            matrices=_invertible(matrices[keep], matrices[zero]),
            box=instance.box,
            deforming=deforming,
        )

    def _pixels_per_unit(self, n: int) -> float:
        """Return the scale in the picture of the nearest part of an instance that is in view."""
        camera, matrix = self.cameras[0.0], self.matrices[0.0][n]
        _, _, depth = self._homogeneous(camera, matrix, self.lattice[n])
        in_view = np.isfinite(self._pixels(camera, matrix, self.lattice[n])[:, 0])
        nearest = depth[in_view].min() if in_view.any() else max(np.abs(depth).mean(), self.nearest)
        film = self.camera.film
        return float(self.camera.focal_length / min(film.pitch_x, film.pitch_y) / nearest)

    def _camera_path(self, times: FloatArray) -> CameraPath:
        matrices = np.stack([self.cameras[time] for time in times])
        zero = int(np.searchsorted(times, 0.0))
        points = self._still_points()
        seen = points @ np.swapaxes(matrices[..., :3], 1, 2) + matrices[:, np.newaxis, :, 3]
        in_view = np.isfinite(self._pixels(matrices[zero], np.eye(3, 4), points)[:, 0])
        seen = seen[:, in_view] / seen[zero, in_view, 2:]
        # As for objects: what is interpolated is x'' w'', y'' w'' and w'', the first two here from the
        # middle of the picture, the last at the picture's scale.
        film = self.camera.film
        half = 0.5 * np.array([film.columns, film.rows])
        places = seen[..., :2] - half * seen[..., 2:]
        places = np.concatenate([places, half * seen[..., 2:]], axis=1)
        keep = np.zeros(times.size, dtype=bool)
        keep[zero] = True
        if float(np.abs(places - places[zero]).max()) > _STILL_PX:
            keep = thinned(times, matrices, places, _THINNING_PX)
        return CameraPath(times[keep], matrices[keep])


def _rounded(times: Iterable[float]) -> set[float]:
    """Return times that differ by more than single precision's noise, which the file could not keep apart."""
    return {round(time, 6) for time in times}


def _inside(pixels: FloatArray, size: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return which pixels lie in the picture."""
    with np.errstate(invalid="ignore"):
        return np.asarray(((pixels >= 0.0) & (pixels <= size)).all(axis=-1))


def _farthest(places: FloatArray, others: FloatArray) -> float:
    """Return the largest distance between points that both have."""
    distance = np.hypot(*np.moveaxis(places - others, -1, 0))
    known = distance[np.isfinite(distance)]
    return float(known.max(initial=0.0))


def _whole_instancers(moving: set[str], pairs: set[tuple[str, str | None]]) -> set[str]:
    """Return the moving owners, with those that cannot be hidden or shown apart from them.

    An object that is seen itself and is also instanced elsewhere goes with its instancer: hidden for the
    one it would be hidden for the other.
    """
    moving = set(moving)
    seen_itself = {name for name, parent in pairs if parent is None}
    linked = [
        {name, parent} for name, parent in pairs if parent is not None and name in seen_itself | {parent}
    ]
    grows = True
    while grows:
        mixed = [both for both in linked if both & moving and both - moving]
        grows = bool(mixed)
        moving.update(*mixed)
    return moving


def _invertible(matrices: FloatArray, reference: FloatArray) -> FloatArray:
    """Return a track, with some thickness for an object that its scale makes flat at the rendered frame."""
    u, scales, v = np.linalg.svd(reference[:, :3])
    missing = np.where(scales < _FLAT * scales[0], _FLAT * scales[0] - scales, 0.0)
    if not missing.any():
        return matrices
    thick = matrices.copy()
    thick[:, :, :3] += (u * missing) @ v
    return thick


def _rendered_names(scene: bpy.types.Scene) -> set[str]:
    """Return the full names of the objects that the scene's own collections let render."""
    names: set[str] = set()

    def walk(layer_collection: bpy.types.LayerCollection) -> None:
        collection = layer_collection.collection
        if collection.hide_render:
            return
        if not layer_collection.exclude:
            names.update(item.name_full for item in collection.objects if not item.hide_render)
        for child in layer_collection.children:
            walk(child)

    for layer in scene.view_layers:
        if layer.use:
            walk(layer.layer_collection)
    return names


def _show_what_renders(borrowed: Borrowed, scene: bpy.types.Scene) -> None:
    """Let the viewport's evaluation, the only one a script can ask for, have what only the render shows."""
    rendered = _rendered_names(scene)
    for layer in scene.view_layers:
        if not layer.use:
            continue
        for collection in _below(layer.layer_collection):
            if not collection.collection.hide_render:
                _borrow_false(borrowed, collection, "hide_viewport")
                _borrow_false(borrowed, collection.collection, "hide_viewport")
    for item in scene.objects:
        # Physics of what is edited would start again, unless it is baked.
        if item.name_full not in rendered or _has_physics(item):
            continue
        _borrow_false(borrowed, item, "hide_viewport")
        for modifier in item.modifiers:
            if (
                modifier.show_render
                and not modifier.show_viewport
                and modifier.type not in _SUBDIVIDING_MODIFIERS
            ):
                borrowed.set(modifier, "show_viewport", True)
        if item.is_instancer and item.show_instancer_for_viewport != item.show_instancer_for_render:
            borrowed.set(item, "show_instancer_for_viewport", item.show_instancer_for_render)
    for layer in scene.view_layers:
        if layer.use:
            for item in layer.objects:
                if item.name_full in rendered and item.hide_get(view_layer=layer):
                    borrowed.set(_Eye(item, layer), "shut", False)


def _below(layer_collection: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    yield layer_collection
    for child in layer_collection.children:
        yield from _below(child)


def _borrow_false(borrowed: Borrowed, owner: Any, name: str) -> None:
    if getattr(owner, name):
        borrowed.set(owner, name, False)


class _Eye:
    """The eye of an object in the outliner, which is no property, as something to be borrowed."""

    id_data = None
    """Nothing animates it."""

    def __init__(self, item: bpy.types.Object, layer: bpy.types.ViewLayer) -> None:
        self._item, self._layer = item, layer

    @property
    def shut(self) -> bool:
        """Whether it hides the object in the viewport."""
        return bool(self._item.hide_get(view_layer=self._layer))

    @shut.setter
    def shut(self, value: bool) -> None:
        self._item.hide_set(value, view_layer=self._layer)


def _has_physics(item: bpy.types.Object) -> bool:
    return (
        item.rigid_body is not None
        or item.soft_body is not None
        or len(item.particle_systems) > 0
        or (item.field is not None and item.field.type != "NONE")
        or any(modifier.type in _PHYSICS_MODIFIERS for modifier in item.modifiers)
    )


def _may_deform(item: bpy.types.Object) -> bool:
    """Return whether anything could change an object's shape with time."""
    data = item.data
    parent = item.parent
    return (
        len(item.modifiers) > 0
        or getattr(data, "shape_keys", None) is not None
        or getattr(data, "animation_data", None) is not None
        or item.type == "META"
        or getattr(data, "bevel_object", None) is not None
        or getattr(data, "taper_object", None) is not None
        or bool(getattr(data, "is_sequence", False))
        or (parent is not None and parent.type in ("ARMATURE", "LATTICE", "CURVE"))
    )


def _shape(item: bpy.types.Object) -> npt.NDArray[np.float32] | None:
    """Return an evaluated object's points one after the other, or None for one that has none."""
    if item.type == "MESH":
        return _coordinates(item.data.vertices, "co")
    if item.type in ("CURVES", "POINTCLOUD"):
        position = item.data.attributes.get("position")
        return None if position is None else _coordinates(position.data, "vector")
    if item.type in ("CURVE", "SURFACE", "FONT", "META"):
        try:
            mesh = item.to_mesh()
        except RuntimeError:  # no geometry, as all but one metaball of a family
            return None
        shape = _coordinates(mesh.vertices, "co") if mesh is not None else None
        item.to_mesh_clear()
        return shape
    if item.type == "VOLUME" and item.data.is_sequence:
        return np.array([item.data.grids.frame], dtype=np.float32)
    return None


def _coordinates(points: Any, name: str) -> npt.NDArray[np.float32]:
    values = np.empty(3 * len(points), dtype=np.float32)
    points.foreach_get(name, values)
    return values


def _animated() -> Iterator[tuple[bpy.types.ID, str]]:
    """Find every property that curves or drivers animate: its ID and its path there."""
    for prop in bpy.data.bl_rna.properties:
        if prop.type != "COLLECTION":
            continue
        for item in getattr(bpy.data, prop.identifier):
            # Trees inside materials, worlds and lights are in no collection of their own.
            for owner in (item, getattr(item, "node_tree", None)):
                animation = getattr(owner, "animation_data", None)
                if animation is not None:
                    for path in dict.fromkeys(_paths(animation)):
                        yield owner, path


def _paths(animation: bpy.types.AnimData) -> Iterator[str]:
    for driver in animation.drivers:
        yield driver.data_path
    pairs = [(animation.action, animation.action_slot)]
    for track in animation.nla_tracks:
        pairs.extend(_strip_actions(track.strips))
    for action, slot in pairs:
        if action is None or slot is None:
            continue
        for layer in action.layers:
            for strip in layer.strips:
                bag = strip.channelbag(slot)
                if bag is not None:
                    yield from (curve.data_path for curve in bag.fcurves)


def _strip_actions(strips: Any) -> Iterator[tuple[Any, Any]]:
    for strip in strips:
        yield strip.action, strip.action_slot
        yield from _strip_actions(strip.strips)


def _read(item: bpy.types.ID, path: str) -> list[Any]:
    """Return a property's value as a list of one, or of none where the path leads nowhere."""
    try:
        value = item.path_resolve(path)
    except ValueError:
        return []
    return [value if isinstance(value, str) or not hasattr(value, "__len__") else tuple(value)]


def _write(item: bpy.types.ID, path: str, value: Any) -> None:
    if path.endswith('"]'):
        place, _, name = path.removesuffix('"]').rpartition('["')
        owner = item.path_resolve(place) if place else item
        owner[bpy.utils.unescape_identifier(name)] = value
        return
    place, _, name = path.rpartition(".")
    # A property that became read-only keeps what its curve or driver says.
    with contextlib.suppress(AttributeError, TypeError):
        setattr(item.path_resolve(place) if place else item, name, value)
