"""Paths of objects and of the camera against direct projection, in files and damaged ones."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from potmesil_addon.camera import Camera, Film, camera_rotation
from potmesil_addon.errors import InputError
from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath, interpolated, thinned

Array = npt.NDArray[np.float64]

FILM = Film(0.036, 0.024, 960, 640)
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
TIMES = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])


def camera_at(
    pan: float = 0.0, tilt: float = 0.0, swing: float = 0.0, at: tuple[float, ...] = (0, 0, 0)
) -> Camera:
    """Return a camera of 50 mm at a place; at pan and tilt 0 it looks along +y with +z up."""
    world_to_camera = np.identity(4)
    world_to_camera[:3, :3] = camera_rotation(pan, tilt, swing)
    world_to_camera[:3, 3] = -world_to_camera[:3, :3] @ np.array(at, dtype=float)
    return Camera(world_to_camera, 0.05, FILM, 480.0, 320.0)


def moving_camera(time: float) -> Camera:
    return camera_at(0.3 * time, 0.2 * time, -0.1 * time, (time, 0.5 * time, -0.3 * time))


def spinning(time: float) -> Array:
    """Return object to world (3, 4) of a scaled object that turns, comes nearer and moves sideways."""
    angle = 2.0 * time
    turn = np.array(
        [[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    scale = np.diag([0.7, 1.3, -0.5])
    place = np.array([0.5 + 2.0 * time, 9.0 - 3.0 * time, 0.4 * time])
    return np.concatenate([turn @ scale, place[:, np.newaxis]], axis=1)


def object_path(times: Array = TIMES, **others: Any) -> ObjectPath:
    matrices = np.stack([spinning(float(t)) for t in times])
    return ObjectPath("wheel", 7, times, matrices, BOX, **others)


def camera_path(times: Array = TIMES) -> CameraPath:
    return CameraPath(times, np.stack([moving_camera(float(t)).matrix for t in times]))


RESTING = CameraPath(np.array([0.0]), camera_at().matrix[np.newaxis])


def seen(camera: Camera, points: Array) -> Array:
    """Return (x, y, 1, 1/z) of world points."""
    pixels, depth = camera.project(points)
    return np.concatenate([pixels, np.ones((len(points), 1)), 1.0 / depth[:, np.newaxis]], axis=1)


def apply(matrix: Array, samples: Array) -> tuple[Array, Array]:
    """Return pixels and depths at the other time of samples (x, y, 1, 1/z)."""
    homogeneous = samples @ matrix.T
    scale = homogeneous[:, 2]
    return homogeneous[:, :2] / scale[:, np.newaxis], scale / samples[:, 3]


LOCAL = np.random.default_rng(6).uniform(-1.0, 1.0, (20, 3))
WORLD = np.array([0.0, 8.0, 0.0]) + np.random.default_rng(7).uniform(-1.5, 1.5, (20, 3))


# --- reprojection -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", TIMES)
@pytest.mark.parametrize("camera_moves", [False, True])
def test_points_of_a_moving_object_are_where_they_are_projected(time: float, camera_moves: bool) -> None:
    path = object_path()
    paths = MotionPaths(camera_path() if camera_moves else RESTING, (path,))
    camera = moving_camera if camera_moves else lambda _: camera_at()
    before, after = ((LOCAL @ spinning(t)[:, :3].T) + spinning(t)[:, 3] for t in (0.0, time))
    pixels, depth = apply(paths.reprojection(path, time), seen(camera(0.0), before))
    expected, expected_depth = camera(time).project(after)
    assert pixels == pytest.approx(expected, abs=1e-9)
    assert depth == pytest.approx(expected_depth, abs=1e-12)


@pytest.mark.parametrize("time", TIMES)
def test_a_scene_at_rest_moves_with_the_camera_alone(time: float) -> None:
    paths = MotionPaths(camera_path())
    pixels, depth = apply(paths.reprojection(None, time), seen(moving_camera(0.0), WORLD))
    expected, expected_depth = moving_camera(time).project(WORLD)
    assert pixels == pytest.approx(expected, abs=1e-9)
    assert depth == pytest.approx(expected_depth, abs=1e-12)


@pytest.mark.parametrize("time", TIMES)
def test_points_at_infinity_only_see_the_camera_turn(time: float) -> None:
    paths = MotionPaths(camera_path())
    directions = WORLD / np.linalg.norm(WORLD, axis=1)[:, np.newaxis]
    pixels, _ = moving_camera(0.0).project(directions)
    samples = np.concatenate([pixels, np.ones((20, 1)), np.zeros((20, 1))], axis=1)
    homogeneous = samples @ paths.reprojection(None, time).T
    turned = moving_camera(time)
    expected, _ = turned.project(directions + np.linalg.inv(turned.world_to_camera)[:3, 3])
    assert homogeneous[:, :2] / homogeneous[:, 2:] == pytest.approx(expected, abs=1e-9)
    # Points far away go there.
    far, _ = turned.project(1e12 * directions)
    assert far == pytest.approx(expected, abs=1e-6)


def test_the_rendered_frame_is_where_it_is() -> None:
    path = object_path()
    paths = MotionPaths(camera_path(), (path,))
    for some in (None, path):
        assert paths.reprojection(some, 0.0) == pytest.approx(np.eye(3, 4), abs=1e-9)


def test_an_object_in_a_car_with_the_camera_rests_in_the_picture() -> None:
    """What moves as the camera does stays on its pixels."""
    rig = [np.linalg.inv(moving_camera(float(t)).world_to_camera)[:3] for t in TIMES]
    path = ObjectPath("dashboard", 0, TIMES, np.stack(rig), BOX)
    paths = MotionPaths(camera_path(), (path,))
    for time in TIMES:
        assert paths.reprojection(path, float(time)) == pytest.approx(np.eye(3, 4), abs=1e-9)


def test_zoom_moves_points_away_from_the_axis() -> None:
    wide, tele = camera_at().matrix, camera_at().matrix.copy()
    # Twice the focal length: pixels from the axis times two, the depth as it was.
    tele[:2] = 2.0 * wide[:2] - np.array([[480.0], [320.0]]) * wide[2]
    paths = MotionPaths(CameraPath(np.array([0.0, 1.0]), np.stack([wide, tele])))
    pixels, depth = apply(paths.reprojection(None, 1.0), np.array([[500.0, 300.0, 1.0, 0.25]]))
    assert pixels[0] == pytest.approx([520.0, 280.0])
    assert depth[0] == pytest.approx(4.0)


def test_points_between_stored_times_are_on_the_straight_line() -> None:
    path = object_path(np.array([0.0, 1.0]))
    paths = MotionPaths(RESTING, (path,))
    samples = seen(camera_at(), LOCAL @ spinning(0.0)[:, :3].T + spinning(0.0)[:, 3])
    places = [apply(paths.reprojection(path, t), samples)[0] for t in (0.0, 0.3, 1.0)]
    there, whole = places[1] - places[0], places[2] - places[0]
    assert there[:, 0] * whole[:, 1] == pytest.approx(there[:, 1] * whole[:, 0], abs=1e-6)


def test_a_straight_flight_towards_the_camera_needs_two_times() -> None:
    """The matrices are linear then, so even the perspective between the times is exact."""
    matrices = np.tile(np.eye(3, 4), (2, 1, 1))
    matrices[:, :, 3] = [[1.0, 20.0, 0.0], [2.0, 4.0, 1.0]]
    path = ObjectPath("ball", 1, np.array([0.0, 1.0]), matrices, BOX)
    paths = MotionPaths(RESTING, (path,))
    samples = seen(camera_at(), LOCAL + matrices[0, :, 3])
    for time in (0.1, 0.5, 0.9):
        place = (1.0 - time) * matrices[0, :, 3] + time * matrices[1, :, 3]
        expected, _ = camera_at().project(LOCAL + place)
        assert apply(paths.reprojection(path, time), samples)[0] == pytest.approx(expected, abs=1e-9)


# --- interpolation and thinning ---------------------------------------------------------------------------


def test_interpolated_is_linear_and_goes_on() -> None:
    times, values = np.array([-1.0, 0.0, 2.0]), np.array([[0.0, 10.0], [1.0, 20.0], [5.0, 0.0]])
    for time, expected in (
        (-1.0, [0, 10]),
        (-0.5, [0.5, 15]),
        (0.0, [1, 20]),
        (0.5, [2, 15]),
        (2.0, [5, 0]),
        (3.0, [7, -10]),
        (-2.0, [-1, 0]),
    ):
        assert interpolated(times, values, time) == pytest.approx(expected)
    assert interpolated(times[:1], values[:1], 7.0).tolist() == [0.0, 10.0]


def test_moves_says_whether_there_is_more_than_one_time() -> None:
    assert camera_path().moves
    assert not RESTING.moves
    assert RESTING.at(3.0)[:3].tolist() == RESTING.matrices[0].tolist()
    assert RESTING.at(0.0)[3].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_a_track_at_rest_keeps_time_0_alone() -> None:
    values = np.ones((5, 3, 4))
    assert thinned(TIMES, values, np.zeros((5, 8, 2)), 0.1).tolist() == [False, False, True, False, False]
    assert thinned(TIMES[2:3], values[:1], np.zeros((1, 8, 2)), 0.1).tolist() == [True]


def test_an_even_motion_keeps_its_ends_and_time_0() -> None:
    places = TIMES[:, np.newaxis, np.newaxis] * np.ones((5, 8, 2))
    kept = thinned(TIMES, TIMES, places, 0.01)
    assert kept.tolist() == [True, False, True, False, True]


@given(seed=st.integers(0, 300), tolerance=st.floats(0.01, 5.0))
def test_thinned_stays_within_its_tolerance(seed: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    times = np.unique(np.concatenate([[0.0], rng.uniform(-1.0, 1.0, 30)]))
    waves = np.sin(times[:, np.newaxis, np.newaxis] * rng.uniform(0.0, 5.0, (1, 4, 2)))
    places = rng.uniform(0.0, 30.0) * waves
    kept = thinned(times, times, places, tolerance)
    assert kept[np.flatnonzero(times == 0.0)].all()
    assert kept[[0, -1]].all()
    for time, place in zip(times, places, strict=True):
        off = interpolated(times[kept], places[kept], float(time)) - place
        assert np.hypot(*off.T).max() <= tolerance + 1e-9


def test_places_that_are_not_known_keep_their_times() -> None:
    places = np.zeros((5, 3, 2))
    places[3, 1] = np.nan
    assert thinned(TIMES, TIMES, places, 1.0)[3]


def test_time_0_may_be_first_or_last() -> None:
    times = np.linspace(0.0, 1.0, 11)
    places = (times**2)[:, np.newaxis, np.newaxis] * np.full((1, 2), 50.0)
    for when in (times, times - 1.0):
        kept = thinned(when, when, places, 1.0)
        assert kept[[0, -1]].all()
        assert 4 <= kept.sum() <= 8


def test_matrices_of_the_kept_times_keep_points_within_the_tolerance() -> None:
    """An object that comes nearer so that its picture moves evenly, which its matrix then does not."""
    camera = camera_at()
    times = np.linspace(0.0, 1.0, 21)
    depth = 20.0 - 16.0 * times
    matrices = np.tile(np.eye(3, 4), (21, 1, 1))
    matrices[:, 1, 3] = depth
    # Its centre goes from the middle of the picture 200 pixels to the right at an even speed.
    matrices[:, 0, 3] = depth * 200.0 * times * FILM.pitch_x / 0.05
    centre = camera.project(matrices[:, :, 3])[0][:, np.newaxis]
    # In the world, at the scale that the picture has of the nearest place.
    scale = 0.05 / FILM.pitch_x / depth.min()
    world = matrices[:, np.newaxis, :, 3] * scale
    kept = thinned(times, matrices, np.concatenate([world[..., :2], world[..., 1:]], axis=1), 0.1)
    path = ObjectPath("plane", 1, times[kept], matrices[kept], BOX)
    paths = MotionPaths(CameraPath(np.array([0.0]), camera.matrix[np.newaxis]), (path,))
    samples = seen(camera, matrices[0, :, 3][np.newaxis])
    for time, place in zip(times, centre, strict=True):
        pixels, _ = apply(paths.reprojection(path, float(time)), samples)
        assert pixels == pytest.approx(place, abs=0.1)


# --- files ------------------------------------------------------------------------------------------------


def full() -> MotionPaths:
    return MotionPaths(
        camera_path(), (object_path(), object_path(TIMES[2:3], deforming=True), object_path(TIMES[1:4]))
    )


def test_paths_survive_json() -> None:
    paths = full()
    again = MotionPaths.from_json(paths.to_json())
    assert len(again.objects) == 3
    for one, other in zip((paths.camera, *paths.objects), (again.camera, *again.objects), strict=True):
        assert other.times == pytest.approx(one.times, rel=1e-9)
        assert other.matrices == pytest.approx(one.matrices, rel=1e-9, abs=1e-12)
        assert other.matrices.dtype == np.float64
    for one, other in zip(paths.objects, again.objects, strict=True):
        assert (other.name, other.object_index, other.deforming) == (
            one.name,
            one.object_index,
            one.deforming,
        )
        assert other.box == pytest.approx(one.box)
    # What was rounded once stays.
    assert MotionPaths.from_json(again.to_json()).to_json() == again.to_json()


def test_rounding_does_not_move_a_pixel() -> None:
    paths = full()
    again = MotionPaths.from_json(paths.to_json())
    samples = seen(moving_camera(0.0), LOCAL @ spinning(0.0)[:, :3].T + spinning(0.0)[:, 3])
    for time in (-0.5, 0.1, 0.5):
        places = [apply(p.reprojection(p.objects[0], time), samples)[0] for p in (paths, again)]
        assert places[0] == pytest.approx(places[1], abs=1e-4)


@given(name=st.text(max_size=20), index=st.integers(-(2**31), 2**31))
def test_any_name_survives_json(name: str, index: int) -> None:
    path = ObjectPath(name, index, TIMES[2:3], np.eye(3, 4)[np.newaxis], BOX)
    again = MotionPaths.from_json(MotionPaths(RESTING, (path,)).to_json())
    assert (again.objects[0].name, again.objects[0].object_index) == (name, index)


def test_another_version_is_named() -> None:
    values = json.loads(full().to_json())
    values["version"] = 99
    with pytest.raises(InputError, match="version 99"):
        MotionPaths.from_json(json.dumps(values))


HUGE = "1" + "0" * 400
TRACK = '{"times":[0],"matrices":[[1,0,0,0,0,1,0,0,0,0,1,0]]}'


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "null",
        "[]",
        "5",
        '"version"',
        "{}",
        '{"version":1}',
        "[" * 100_000,
        '{"version":1,"camera":null,"objects":[]}',
        '{"version":1,"camera":' + TRACK + "}",
        '{"version":1,"camera":' + TRACK + ',"objects":null}',
        '{"version":1,"camera":' + TRACK + ',"objects":[5]}',
        '{"version":1,"camera":' + TRACK.replace("[0]", "[]", 1) + ',"objects":[]}',
        '{"version":1,"camera":' + TRACK.replace("[0]", "0", 1) + ',"objects":[]}',
        '{"version":1,"camera":' + TRACK.replace("[0]", "[NaN]", 1) + ',"objects":[]}',
        '{"version":1,"camera":' + TRACK.replace("[0]", "[0,1]", 1) + ',"objects":[]}',
        '{"version":1,"camera":' + TRACK.replace("[[1,", "[[Infinity,") + ',"objects":[]}',
        '{"version":1,"camera":' + TRACK.replace("[[1,", f"[[{HUGE},") + ',"objects":[]}',
        '{"version":1,"camera":' + TRACK.replace("1", "0") + ',"objects":[]}',
    ],
)
def test_damaged_text_is_an_input_error(text: str) -> None:
    with pytest.raises(InputError, match="damaged"):
        MotionPaths.from_json(text)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("index", math.inf),
        ("index", math.nan),
        ("index", "a"),
        ("index", None),
        ("box", [[0, 0, 0]]),
        ("box", None),
        ("box", [[0, 0, 0], [1, 1, 10**400]]),
        ("times", [0.5, 0.0, 1.0, 2.0, 3.0]),
        ("times", [0.0, 0.0, 1.0, 2.0, 3.0]),
        ("matrices", [[0.0] * 12] * 5),
        ("matrices", [[1.0] * 11] * 5),
    ],
)
def test_a_damaged_object_is_an_input_error(key: str, value: Any) -> None:
    values = json.loads(full().to_json())
    values["objects"][0][key] = value
    with pytest.raises(InputError, match="damaged"):
        MotionPaths.from_json(json.dumps(values))


def leaves(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield each container in a JSON value with each of its keys."""
    keys = range(len(value)) if isinstance(value, list) else list(value)
    for key in keys:
        yield value, key
        if isinstance(value[key], list | dict):
            yield from leaves(value[key])


junk = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**400), 10**400),
    st.floats(),
    st.text(max_size=4),
    st.lists(st.integers(0, 3), max_size=3),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)


@given(data=st.data(), value=junk, delete=st.booleans())
def test_any_damage_to_one_value_is_an_input_error_or_readable(data: Any, value: Any, delete: bool) -> None:
    values = json.loads(MotionPaths(RESTING, (object_path(TIMES[1:4]),)).to_json())
    container, key = data.draw(st.sampled_from(list(leaves(values))))
    if delete:
        del container[key]
    else:
        container[key] = value
    try:
        paths = MotionPaths.from_json(json.dumps(values))
    except InputError:
        return
    for path in (None, *paths.objects):
        assert paths.reprojection(path, 0.1).shape == (3, 4)
    paths.to_json()


@given(cut=st.integers(0, 3000), byte=st.characters(max_codepoint=127))
def test_damaged_characters_are_an_input_error_or_readable(cut: int, byte: str) -> None:
    text = MotionPaths(RESTING, (object_path(TIMES[1:4]),)).to_json()
    cut %= len(text)
    for damaged in (text[:cut], text[:cut] + byte + text[cut + 1 :]):
        try:
            MotionPaths.from_json(damaged)
        except InputError:
            continue
        assert damaged != text[:cut]
