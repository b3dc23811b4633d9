"""Where what mirrors and glass show appears: against plane mirrors, the mirror equation and Snell's law."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.specular import (
    GLASS_STEP,
    NOWHERE,
    NUMBER_STEP,
    Probe,
    View,
    as_share,
    grown,
    indices,
    patches,
    resolve,
    seen_light,
    spread_numbers,
    within,
)

ROWS, COLUMNS = 24, 32
FOCAL = 400.0
"""Pixels."""

BASELINE = 0.004
UP = np.array([0.0, 0.0, 1.0])

CAMERA = np.array(
    [
        [FOCAL, 0.5 * COLUMNS, 0.0, 0.0],
        [0.0, 0.5 * ROWS, -FOCAL, 0.0],
        [0.0, 1.0, 0.0, 0.0],
    ]
)
"""Stands at the origin and looks along +y with +z up."""

Trace = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, int]]
"""From eye and directions to places, lengths and bounces."""


def rays() -> np.ndarray:
    x, y = np.meshgrid(np.arange(COLUMNS) + 0.5, np.arange(ROWS) + 0.5)
    return np.stack([(x - 0.5 * COLUMNS) / FOCAL, np.ones_like(x), -(y - 0.5 * ROWS) / FOCAL], axis=-1)


def probe_of(trace: Trace, *, number: int = 7) -> Probe:
    places = []
    directions = rays()
    for shift in (np.zeros(3), BASELINE * np.array([1.0, 0.0, 0.0]), BASELINE * UP):
        place, length, bounces = trace(shift, directions)
        places.append(place)
        if not shift.any():
            lengths = length
    whole = np.full((ROWS, COLUMNS), bounces, dtype=np.int32)
    return Probe(
        lengths.astype(np.float32),
        np.full_like(whole, number),
        whole,
        np.zeros_like(whole),
        np.stack(places).astype(np.float32),
        BASELINE,
        {7: "Seen"},
    )


def view_of(depth: float | np.ndarray, *objects: ObjectPath, track: int = 0, camera: Any = None) -> View:
    path = CameraPath(np.zeros(1), CAMERA[np.newaxis]) if camera is None else camera
    return View(
        MotionPaths(path, objects),
        (0.5, 0.5),
        0.0,
        np.broadcast_to(np.float32(depth), (ROWS, COLUMNS)).astype(np.float32),
        np.full((ROWS, COLUMNS), track, dtype=np.int32),
    )


def to_plane(eye: np.ndarray, ways: np.ndarray, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return how many of its ways each ray takes to a plane."""
    return ((point - eye) @ normal) / (ways @ normal)


def plane_mirror(normal: np.ndarray, point: np.ndarray, wall_y: float) -> Trace:
    """A mirror that shows a wall at a y."""

    def trace(eye: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        first = to_plane(eye, ways, normal, point)[..., np.newaxis] * ways
        onward = ways - 2.0 * (ways @ normal)[..., np.newaxis] * normal
        hit = eye + first
        steps = (wall_y - hit[..., 1]) / onward[..., 1]
        second = steps[..., np.newaxis] * onward
        return hit + second, np.linalg.norm(first, axis=-1) + np.linalg.norm(second, axis=-1), 1

    return trace


def slab(near: float, thick: float, ior: float, wall_y: float) -> Trace:
    """A pane of glass square to the axis, and a wall behind it."""

    def trace(eye: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        unit = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
        inside = unit / ior
        inside[..., 1] = np.sqrt(1.0 - inside[..., 0] ** 2 - inside[..., 2] ** 2)
        legs = [(unit, near), (inside, thick), (unit, wall_y - near - thick)]
        place, length = np.broadcast_to(eye, ways.shape).copy(), np.zeros(ways.shape[:2])
        for way, depth in legs:
            steps = depth / way[..., 1]
            place += steps[..., np.newaxis] * way
            length += steps
        return place, length, 2 * GLASS_STEP

    return trace


def ball_mirror(center: np.ndarray, radius: float, wall_y: float) -> Trace:
    """A convex mirror that shows a wall behind the camera."""

    def trace(eye: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        unit = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
        away = eye - center
        b = unit @ away
        steps = -b - np.sqrt(b * b - away @ away + radius * radius)
        hit = eye + steps[..., np.newaxis] * unit
        normal = (hit - center) / radius
        onward = unit - 2.0 * (unit * normal).sum(axis=-1, keepdims=True) * normal
        more = (wall_y - hit[..., 1]) / onward[..., 1]
        return hit + more[..., np.newaxis] * onward, steps + more, 1

    return trace


@pytest.mark.parametrize("turn", [0.0, 20.0, -35.0])
def test_plane_mirror_shows_things_at_the_length_of_the_path(turn: float) -> None:
    angle = np.radians(turn)
    normal = np.array([np.sin(angle), -np.cos(angle), 0.0])
    point = np.array([0.0, 3.0, 0.0])
    if turn:
        # What is seen in a mirror that is turned is before it to the side: a wall square to its own normal.
        trace = _turned_wall(normal, point)
    else:
        trace = plane_mirror(normal, point, -2.0)
    probe = probe_of(trace)
    seen = resolve(probe, view_of(3.0), 0.5)
    assert seen.there.all()
    assert seen.vector is None
    expected = probe.length / np.linalg.norm(rays(), axis=-1)
    np.testing.assert_allclose(seen.path_depth, expected, rtol=1e-6)
    np.testing.assert_allclose(seen.depth, expected, rtol=2e-3)


def _turned_wall(normal: np.ndarray, point: np.ndarray) -> Trace:
    def trace(eye: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        first = to_plane(eye, ways, normal, point)[..., np.newaxis] * ways
        onward = ways - 2.0 * (ways @ normal)[..., np.newaxis] * normal
        hit = eye + first
        wall = point + 2.5 * normal
        steps = ((wall - hit) @ normal) / (onward @ normal)
        second = steps[..., np.newaxis] * onward
        return hit + second, np.linalg.norm(first, axis=-1) + np.linalg.norm(second, axis=-1), 1

    return trace


def test_clip_start_is_added_to_the_path() -> None:
    probe = probe_of(plane_mirror(np.array([0.0, -1.0, 0.0]), np.array([0.0, 3.0, 0.0]), -2.0))
    view = view_of(3.0)
    moved = View(view.paths, view.origin, 0.25, view.depth, view.track)
    short = Probe(
        probe.length - 0.25 * np.linalg.norm(rays(), axis=-1).astype(np.float32),
        *(getattr(probe, name) for name in ("number", "bounces", "second", "place", "baseline", "names")),
    )
    np.testing.assert_allclose(
        resolve(short, moved, 0.5).path_depth, resolve(probe, view, 0.5).path_depth, rtol=1e-5
    )


def test_pane_of_glass_brings_what_is_behind_it_nearer() -> None:
    thick, ior, wall = 0.6, 1.5, 4.0
    seen = resolve(probe_of(slab(1.0, thick, ior, wall)), view_of(1.0), 0.5)
    # Paraxial: the pane counts as thick / ior. At the edge of the picture rays are 2.3 degrees off the axis.
    np.testing.assert_allclose(seen.depth, wall - thick + thick / ior, rtol=2e-3)
    np.testing.assert_allclose(seen.path_depth, wall, rtol=2e-4)


@pytest.mark.parametrize("wall", [-1.0, -20.0])
def test_ball_shows_things_where_the_mirror_equation_has_them(wall: float) -> None:
    center, radius = np.array([0.0, 2.0, 0.0]), 0.5
    near = 1.5
    trace = ball_mirror(center, radius, wall)
    unit = rays() / np.linalg.norm(rays(), axis=-1, keepdims=True)
    b = unit @ -center
    depth = ((-b - np.sqrt(b * b - 4.0 + radius * radius)) * unit[..., 1]).astype(np.float32)
    seen = resolve(probe_of(trace), view_of(depth), 0.5)
    # 1/o + 1/i = -2/r, of a wall at distance o before the ball.
    behind = 1.0 / (2.0 / radius + 1.0 / (near - wall))
    middle = (slice(10, 14), slice(14, 18))
    np.testing.assert_allclose(seen.depth[middle], near + behind, rtol=0.01)
    assert (seen.path_depth[middle] > near + (near - wall) - 0.1).all()


@pytest.mark.parametrize("wall", [-1.0, -20.0, -1e6])
@pytest.mark.parametrize("side", [0.0, 0.2])
def test_normals_tell_what_the_mirror_equation_does(wall: float, side: float) -> None:
    """Also where neighbours see different things, and aslant: 1/o + 1/i = -2/(r cos t) and -2 cos t/r."""
    center, radius = np.array([side, 2.0, 0.0]), 0.5
    unit = rays() / np.linalg.norm(rays(), axis=-1, keepdims=True)
    b = unit @ -center
    steps = -b - np.sqrt(b * b - center @ center + radius * radius)
    depth = (steps * unit[..., 1]).astype(np.float32)
    normal = ((steps[..., np.newaxis] * unit - center) / radius).astype(np.float32)
    probe = probe_of(ball_mirror(center, radius, wall))
    probe.number[:] = np.arange(probe.number.size).reshape(probe.number.shape) + 1
    view = dataclasses.replace(view_of(depth), normal=normal)
    seen = resolve(probe, view, 0.5)
    y, x = 12, 16
    cosine = -float(unit[y, x] @ normal[y, x])
    before, behind = float(steps[y, x]), float(probe.length[y, x] - steps[y, x])
    powers = (2.0 / (radius * cosine), 2.0 * cosine / radius)
    distances = [before + 1.0 / (power + 1.0 / behind) for power in powers]
    near, far = sorted(distances)
    assert seen.depth[y, x] == pytest.approx(near * unit[y, x, 1], rel=5e-3)
    astigmatism = np.hypot(*seen.astigmatism[y, x])
    expected = (1.0 / near - 1.0 / far) / unit[y, x, 1]
    assert astigmatism == pytest.approx(expected, rel=0.02, abs=2e-3)


@pytest.mark.parametrize(("across", "down"), [(2.0, -1.0), (-1.0, 2.0), (-0.8, -1.0), (2.0, 0.5)])
def test_hollow_along_one_axis_puts_an_image_before_the_other(across: float, down: float) -> None:
    """A flat mirror whose normals turn as a saddle's: 1/o + 1/i = -2 k along each axis."""
    depth, wall = 2.0, -1.0
    ways = rays()
    hit = depth * ways
    normal = np.stack([across * hit[..., 0], -np.ones(hit.shape[:2]), down * hit[..., 2]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)

    def trace(eye: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        onward = ways - 2.0 * (ways * normal).sum(axis=-1, keepdims=True) * normal
        steps = (wall - hit[..., 1]) / onward[..., 1]
        second = steps[..., np.newaxis] * onward
        return hit + second, np.linalg.norm(hit, axis=-1) + np.linalg.norm(second, axis=-1), 1

    view = dataclasses.replace(view_of(depth), normal=normal.astype(np.float32))
    seen = resolve(probe_of(trace), view, 0.5)
    images = [depth + 1.0 / (2.0 * power + 1.0 / (depth - wall)) for power in (across, down)]
    y, x = 12, 16
    assert seen.depth[y, x] == pytest.approx(min(images), rel=5e-3)
    difference = 1.0 / images[1] - 1.0 / images[0]
    # Along x the farther one is the first image, along y the second.
    np.testing.assert_allclose(seen.astigmatism[y, x], [difference, 0.0], rtol=0.02, atol=2e-3)


def mirrors(there: np.ndarray, second: np.ndarray | None = None) -> Probe:
    """A probe that saw one thing in mirrors."""
    whole = np.zeros(there.shape, dtype=np.int32)
    place = np.zeros((3, *there.shape, 3), dtype=np.float32)
    place[..., 0], place[..., 2] = np.meshgrid(np.arange(there.shape[1]), np.arange(there.shape[0]))
    second = whole if second is None else second
    return Probe(place[0, ..., 0], whole + 7, there.astype(np.int32), second, place, BASELINE, {})


def test_patches_end_where_mirrors_turn_and_small_ones_are_one() -> None:
    there = np.ones((40, 60), dtype=bool)
    there[:, 50:] = False
    depth = np.full(there.shape, 2.0, dtype=np.float32)
    normal = np.zeros((*there.shape, 3), dtype=np.float32)
    normal[..., 1] = -1.0
    normal[:, 25:] = [0.6, -0.8, 0.0]
    normal[4:6, 4:8] = [0.0, 0.0, 1.0]
    found, small = patches(mirrors(there), depth, normal, None)
    assert (found[:, 50:] == 0).all()
    faces = found[20, 10], found[20, 40]
    assert faces[0] != faces[1]
    assert found[5, 5] not in (0, *faces)
    assert small.sum() == 8


def test_patches_end_where_a_mirror_in_a_mirror_does() -> None:
    there = np.ones((40, 60), dtype=bool)
    depth = np.full(there.shape, 2.0, dtype=np.float32)
    normal = np.zeros((*there.shape, 3), dtype=np.float32)
    normal[..., 1] = -1.0
    second = np.zeros(there.shape, dtype=np.int32)
    second[:, 20:] = 3
    probe = mirrors(there, second)
    # Another face of the same mirror shows another part of the same thing.
    probe.place[:, :, 40:] += 30.0
    found, _ = patches(probe, depth, normal, None)
    # The outer ones are so far apart that they may share a number.
    assert found[10, 10] != found[10, 30] != found[10, 50]


def test_patches_far_apart_share_a_number() -> None:
    there = np.zeros((30, 200), dtype=bool)
    there[5:25, 5:25] = there[5:25, 150:190] = True
    normal = np.zeros((*there.shape, 3), dtype=np.float32)
    normal[..., 1] = -1.0
    found, _ = patches(mirrors(there), np.full(there.shape, 2.0, dtype=np.float32), normal, None)
    assert (found[there] == 1).all()
    assert (spread_numbers(found, grown(there, mixed=True)) == grown(there, mixed=True)).all()


def test_sky_in_a_plane_mirror_is_infinitely_far() -> None:
    def trace(eye: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        unit = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
        return unit * np.array([1.0, -1.0, 1.0]), 3.0 * np.linalg.norm(ways, axis=-1), 1

    seen = resolve(probe_of(trace, number=NOWHERE), view_of(3.0), 0.5)
    assert np.isinf(seen.path_depth).all()
    assert (seen.depth > 1e4).all()


def test_sky_in_a_ball_is_half_a_radius_behind_it() -> None:
    center, radius = np.array([0.0, 2.0, 0.0]), 0.5

    def trace(eye: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        place, length, bounces = ball_mirror(center, radius, -1e6)(eye, ways)
        return place / np.linalg.norm(place, axis=-1, keepdims=True), length, bounces

    seen = resolve(probe_of(trace, number=NOWHERE), view_of(1.5), 0.5)
    np.testing.assert_allclose(seen.depth[10:14, 14:18], 1.5 + 0.5 * radius, rtol=0.01)


def moving(way: np.ndarray, box: tuple[float, float] = (-100.0, 100.0), name: str = "Seen") -> ObjectPath:
    """An object that goes `way` in a frame."""
    matrices = np.stack([np.eye(3, 4) for _ in range(3)])
    matrices[0, :, 3], matrices[2, :, 3] = -way, way
    return ObjectPath(name, 1, np.array([-1.0, 0.0, 1.0]), matrices, np.array([[box[0]] * 3, [box[1]] * 3]))


def places(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacements of a frame before and after, y down, of a vector pass."""
    return vector[..., :2] * [1.0, -1.0], vector[..., 2:] * [-1.0, 1.0]


def projected(points: np.ndarray) -> np.ndarray:
    seen = points @ CAMERA[:, :3].T + CAMERA[:, 3]
    return seen[..., :2] / seen[..., 2:]


def test_what_moves_in_a_plane_mirror_takes_the_mirrored_path() -> None:
    normal, point = np.array([0.0, -1.0, 0.0]), np.array([0.0, 3.0, 0.0])
    probe = probe_of(plane_mirror(normal, point, -2.0))
    way = np.array([0.03, 0.2, -0.01])
    vector = resolve(probe, view_of(3.0, moving(way)), 0.5).vector
    assert vector is not None
    image = rays() * 8.0
    way_of_image = way * [1.0, -1.0, 1.0]
    before, after = places(vector)
    # Followed for half a frame to both sides, on a parabola.
    for side, sign in ((before, -1.0), (after, 1.0)):
        true = projected(image + sign * way_of_image) - projected(image)
        np.testing.assert_allclose(side, true, atol=0.02)


def test_image_goes_twice_as_fast_as_its_mirror() -> None:
    normal, point = np.array([0.0, -1.0, 0.0]), np.array([0.0, 3.0, 0.0])
    probe = probe_of(plane_mirror(normal, point, -2.0))
    mirror = moving(np.array([0.05, 0.1, 0.0]), name="Mirror")
    vector = resolve(probe, view_of(3.0, mirror, track=1), 0.5).vector
    assert vector is not None
    image = rays() * 8.0
    _, after = places(vector)
    # Along the mirror nothing changes; along its normal the image goes twice the way.
    true = projected(image + np.array([0.0, 0.2, 0.0])) - projected(image)
    np.testing.assert_allclose(after, true, atol=0.02)


def test_what_moves_behind_a_thin_pane_goes_straight() -> None:
    probe = probe_of(slab(1.0, 0.01, 1.5, 4.0))
    way = np.array([0.05, 0.0, 0.02])
    vector = resolve(probe, view_of(1.0, moving(way)), 0.5).vector
    assert vector is not None
    _, after = places(vector)
    true = projected(rays() * 4.0 + way) - projected(rays() * 4.0)
    np.testing.assert_allclose(after, true, atol=0.02)


def test_what_moves_is_smaller_in_a_ball() -> None:
    center, radius = np.array([0.0, 2.0, 0.0]), 0.5
    probe = probe_of(ball_mirror(center, radius, -20.0))
    way = np.array([1.0, 0.0, 0.0])
    vector = resolve(probe, view_of(1.5, moving(way)), 0.5).vector
    assert vector is not None
    before, after = places(vector)
    # The image is i / o as large as the thing: 0.2471 / 21.5, seen at 1.5 + i.
    behind = 1.0 / (2.0 / radius + 1.0 / 21.5)
    expected = FOCAL * behind / 21.5 / (1.5 + behind)
    np.testing.assert_allclose(after[10:14, 14:18, 0], expected, rtol=0.03)
    np.testing.assert_allclose(before[10:14, 14:18, 0], -expected, rtol=0.03)


def test_highlights_go_with_a_ball() -> None:
    center, radius = np.array([0.0, 2.0, 0.0]), 0.5
    probe = probe_of(ball_mirror(center, radius, -1000.0))
    ball = moving(np.array([0.02, 0.0, 0.0]), name="Ball")
    vector = resolve(probe, view_of(1.5, ball, track=1), 0.5).vector
    assert vector is not None
    _, after = places(vector)
    np.testing.assert_allclose(after[12, 16], [FOCAL * 0.02 / 1.75, 0.0], atol=0.03)


def test_nothing_moves_where_what_moves_is_not_seen() -> None:
    probe = probe_of(plane_mirror(np.array([0.0, -1.0, 0.0]), np.array([0.0, 3.0, 0.0]), -2.0))
    elsewhere = moving(np.array([1.0, 0.0, 0.0]), name="Other")
    assert resolve(probe, view_of(3.0, elsewhere), 0.5).vector is None


def test_paths_that_got_lost_are_those_beside_them() -> None:
    probe = probe_of(plane_mirror(np.array([0.0, -1.0, 0.0]), np.array([0.0, 3.0, 0.0]), -2.0))
    probe.number[:, :5] = 0
    probe.bounces[:, -5:] = 0
    seen = resolve(probe, view_of(3.0), 0.5)
    assert seen.there[:, 5:-5].all()
    assert not seen.there[:, :5].any()
    assert not seen.there[:, -5:].any()
    np.testing.assert_allclose(seen.depth[:, :5], 8.0, rtol=2e-3)
    # The pixel beside a mirror may show some of it; those beyond show their own surface.
    np.testing.assert_allclose(seen.depth[:, -5], seen.depth[:, -6])
    assert (seen.depth[:, -4:] == 3.0).all()


def test_probe_reads_what_its_renders_hold() -> None:
    path = np.zeros((2, 3, 3), dtype=np.float32)
    path[..., 0] = 4.5
    path[..., 1] = 7.0
    path[0, 0] = (0.0, NOWHERE, 1.0)
    path[..., 2] = 1.0 + GLASS_STEP * 2 + NUMBER_STEP * 9
    probe = Probe.from_renders(path, [], 0.1, {7: "Seen", 9: "Ball"})
    assert probe.second[1, 1] == 9
    assert probe.bounces[1, 1] == 1 + 2 * GLASS_STEP
    assert probe.there.all()
    assert (indices(probe, {"Seen": 12}) == np.array([[0, 12, 12], [12, 12, 12]])).all()


def test_light_is_no_more_than_there_is() -> None:
    direct = np.full((1, 2, 3), 0.5, dtype=np.float32)
    color = np.broadcast_to(np.float32([0.4, 0.2, 0.1]), (1, 2, 3))
    light = seen_light(direct, direct, color)
    np.testing.assert_allclose(light[0, 0], [0.4, 0.2, 0.1, 0.4])
    picture = np.float32([[[0.3, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]]])
    np.testing.assert_allclose(within(light, picture)[0], [[0.3, 0.2, 0.1, 0.4], [0.4, 0.2, 0.1, 0.4]])
    noisy = np.float32([[[0.8, 0.2, 0.4], [0.0, 0.0, 0.0]]])
    denoised = np.float32([[[0.6, 0.3, 0.2, 1.0], [0.6, 0.3, 0.2, 1.0]]])
    np.testing.assert_allclose(
        as_share(light, noisy, denoised)[0], [[0.3, 0.3, 0.05, 0.4], [0.6, 0.3, 0.2, 0.4]], rtol=1e-6
    )


def test_edges_of_mirrors_mix_but_not_those_of_points() -> None:
    there = np.zeros((5, 5), dtype=bool)
    there[2, 2] = True
    assert grown(there, mixed=True).sum() == 9
    assert grown(there, mixed=False).sum() == 1
