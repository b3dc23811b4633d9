"""Which object a sample belongs to, and what its vector says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.samples import SampleLayer, Samples, Window
from potmesil_addon.tracks import Tracks, assign_tracks, sample_origin, spread
from potmesil_addon.warp import NO_TRACK, VECTOR_TRACK

from .helpers import Array
from .motion_scenes import (
    COLUMNS,
    FOCAL,
    MIDDLE,
    ROWS,
    WALL,
    Card,
    Scene,
    moving,
    plain,
    pose,
    samples_of,
    scene_named,
    vectors_of,
)

GREY = plain((0.5, 0.5, 0.5))


def fixed(x: float, y: float, z: float = 5.0, **turned: Any) -> Any:
    return pose(lambda t: x + 0.0 * t, lambda t: y + 0.0 * t, lambda t: z + 0.0 * t, **turned)


def assigned(samples: Samples, **others: Any) -> Tracks:
    tracks = assign_tracks(samples.layers[0], samples, **others)
    assert tracks is not None
    return tracks


def with_layer(samples: Samples, **changes: Any) -> Samples:
    return replace(samples, layers=(replace(samples.layers[0], **changes),))


@pytest.mark.parametrize("corner", [False, True], ids=["center", "corner"])
@pytest.mark.parametrize("window", [None, Window(-9, -5, COLUMNS + 3, ROWS + 8), Window(20, 10, 70, 50)])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_sample_belongs_to_the_object_whose_index_and_box_it_has(
    turn: float, window: Any, corner: bool
) -> None:
    """Cards at different depths, one in front of another, one turned and seen aslant."""
    cards = (
        WALL,
        Card(
            fixed(-0.8, 0.1, yaw=lambda t: turn + 0.0 * t, roll=lambda t: turn + 0.0 * t), GREY, (0.6, 0.4), 3
        ),
        Card(fixed(0.6, -0.2, 4.0), GREY, (0.4, 0.5), 7),
        Card(fixed(0.5, -0.1, 3.0), GREY, (0.1, 0.2), 4),
    )
    samples = samples_of(Scene(cards), companions=False, window=window, corner=corner)
    tracks = assigned(samples)
    index = samples.layers[0].object_index
    assert index is not None
    assert set(np.unique(index)) == {0, 3, 7, 4}
    # The path of number n is the n-th card's; 0 is the world's.
    np.testing.assert_array_equal(np.array([0, 3, 7, 4])[tracks.track], index)
    assert tracks.paths[0] is None
    assert [path.object_index for path in tracks.paths[1:] if path is not None] == [3, 7, 4]


def test_objects_that_were_never_given_an_index_are_told_by_their_boxes() -> None:
    cards = (
        WALL,
        Card(fixed(-0.8, 0.1), GREY, (0.6, 0.4), 0),
        Card(fixed(0.7, -0.2, 4.0), GREY, (0.4, 0.5), 0),
    )
    samples = samples_of(Scene(cards), companions=False)
    told = samples_of(Scene((WALL, replace(cards[1], index=1), replace(cards[2], index=2))), companions=False)
    np.testing.assert_array_equal(assigned(samples).track, told.layers[0].object_index)
    without = with_layer(samples, object_index=None)
    np.testing.assert_array_equal(assigned(without).track, told.layers[0].object_index)


def test_instances_that_share_an_index_have_their_own_paths() -> None:
    cards = tuple(Card(fixed(0.8 * k, 0.0, 4.0 + 0.5 * k), GREY, (0.3, 0.4), 5) for k in (-2, -1, 0, 1, 2))
    samples = samples_of(Scene((WALL, *cards)), companions=False)
    told = tuple(replace(card, index=k) for k, card in enumerate(cards, start=1))
    np.testing.assert_array_equal(
        assigned(samples).track, samples_of(Scene((WALL, *told))).layers[0].object_index
    )


def test_surface_of_another_index_within_a_box_is_not_the_object_s() -> None:
    """What stands within a box: a hollow object's contents."""
    cards = (
        WALL,
        Card(fixed(0.0, 0.0), GREY, (0.8, 0.6), 1),
        Card(fixed(0.0, 0.0, 4.999), GREY, (0.2, 0.2), 9, moves=False),
    )
    samples = samples_of(Scene(cards), companions=False)
    index = samples.layers[0].object_index
    np.testing.assert_array_equal(assigned(samples).track, np.where(index == 1, 1, 0))


def test_every_sample_of_movers_alone_belongs_to_the_likeliest() -> None:
    """Depths that are off, and indices that are missing."""
    left, right = Card(fixed(-0.9, 0.0), GREY, (0.5, 0.4), 1), Card(fixed(0.9, 0.0), GREY, (0.5, 0.4), 2)
    samples = samples_of(Scene((left, right)), companions=False)
    layer = samples.layers[0]
    assert layer.depth is not None
    index = layer.object_index
    off = with_layer(samples, depth=layer.depth * np.float32(1.006))
    assert not assigned(off).track.any()
    np.testing.assert_array_equal(assigned(off, all_move=True).track, index)
    np.testing.assert_array_equal(assigned(with_layer(off, object_index=None), all_move=True).track, index)
    # An index that no object has says nothing.
    strange = with_layer(off, object_index=np.full_like(index, 77))
    np.testing.assert_array_equal(assigned(strange, all_move=True).track, index)


def test_index_comes_before_the_box_among_movers() -> None:
    a, b = Card(fixed(0.0, 0.0), GREY, (0.5, 0.4), 1), Card(fixed(0.1, 0.0), GREY, (0.5, 0.4), 2)
    samples = samples_of(Scene((a, b)), companions=False)
    index = samples.layers[0].object_index
    assert index is not None
    swapped = with_layer(samples, object_index=np.where(index > 0, 3 - index, 0).astype(np.int32))
    expected = np.where(index > 0, 3 - index, 0)
    np.testing.assert_array_equal(assigned(swapped, all_move=True).track, expected)


def test_nothing_and_infinity_belong_to_the_world() -> None:
    samples = samples_of(moving(), companions=False)
    layer = samples.layers[0]
    sky = with_layer(samples, depth=np.full((ROWS, COLUMNS), np.inf, np.float32))
    assert not assigned(sky).track.any()
    clear = with_layer(samples, color=np.zeros_like(layer.color))
    assert not assigned(clear).track.any()


def test_object_around_the_camera_is_found_before_it() -> None:
    """Its box reaches behind the camera, where nothing projects."""
    floor = np.array([[-1.0, 0.9, -4.0], [1.0, 1.1, 20.0]])
    samples = samples_of(moving(), companions=False)
    y = (np.arange(ROWS)[:, np.newaxis] + 0.5 - MIDDLE[1]) / FOCAL * np.ones((1, COLUMNS))
    x = (np.arange(COLUMNS) + 0.5 - MIDDLE[0]) / FOCAL
    with np.errstate(divide="ignore"):
        depth = np.where(y > 0.1, 1.0 / y, np.inf).astype(np.float32)
    path = ObjectPath("floor", 2, np.zeros(1), np.eye(3, 4)[np.newaxis], floor)
    assert samples.paths is not None
    samples = with_layer(samples, depth=depth, object_index=np.full((ROWS, COLUMNS), 2, np.int32))
    samples = replace(samples, paths=MotionPaths(samples.paths.camera, (path,)))
    inside = np.isfinite(depth) & (np.abs(x * depth) <= 1.0) & (depth < 20.0)
    track = assigned(samples).track
    assert (track[inside] == 1).all()
    assert not track[~np.isfinite(depth)].any()
    # And one that lies behind the camera alone has nothing.
    behind = replace(path, box=np.array([[-1.0, -1.0, -9.0], [1.0, 1.0, -4.0]]))
    samples = replace(samples, paths=MotionPaths(samples.paths.camera, (behind,)))
    assert not assigned(samples).track.any()


def test_scaled_and_tiny_objects_are_found() -> None:
    """Matrices may scale by anything: margins are in the object's own size."""
    scene = moving()
    samples = samples_of(scene, companions=False)
    expected = assigned(samples).track
    assert expected.any()
    assert samples.paths is not None
    path = samples.paths.objects[0]
    for scale in (1e-4, 1e4):
        matrices = path.matrices * np.array([scale, scale, scale, 1.0])
        scaled = replace(path, matrices=matrices, box=path.box / scale)
        other = replace(samples, paths=MotionPaths(samples.paths.camera, (scaled,)))
        np.testing.assert_array_equal(assigned(other).track, expected)


def test_deforming_objects_follow_the_vectors() -> None:
    samples = samples_of(moving(), companions=False, vectors=True)
    assert samples.paths is not None
    path = replace(samples.paths.objects[0], deforming=True)
    soft = replace(samples, paths=MotionPaths(samples.paths.camera, (path,)))
    index = samples.layers[0].object_index
    np.testing.assert_array_equal(assigned(soft).track, np.where(index == 1, VECTOR_TRACK, 0))
    # Without vectors its own matrices are the best there is.
    np.testing.assert_array_equal(assigned(with_layer(soft, vector=None)).track, index)


def test_without_paths_or_depth_all_follow_the_vectors() -> None:
    samples = samples_of(moving(), companions=False, vectors=True)
    for other in (replace(samples, paths=None), with_layer(samples, depth=None)):
        tracks = assigned(other)
        assert (tracks.track == VECTOR_TRACK).all()
        assert tracks.paths == (None,)
    bare = with_layer(replace(samples, paths=None), vector=None)
    assert assign_tracks(bare.layers[0], bare) is None


def test_camera_that_moves_needs_no_objects() -> None:
    samples = samples_of(scene_named("pan"), companions=False)
    tracks = assigned(samples)
    assert not tracks.track.any()
    assert tracks.paths == (None,)


# Vectors


def velocities(vector: Any) -> tuple[list[float], list[float]]:
    values = np.zeros((1, 2, 4), dtype=np.float32)
    values[0, 0] = vector
    window = Window(0, 0, 2, 1)
    layer = SampleLayer("", np.ones((1, 2, 4), np.float32), None, None, values)
    tracks = assign_tracks(layer, Samples((layer,), window, window))
    assert tracks is not None
    assert not tracks.velocity[0, 1].any()
    return tracks.velocity[0, 0].tolist(), tracks.acceleration[0, 0].tolist()


@pytest.mark.parametrize(
    ("vector", "velocity", "acceleration"),
    [
        # A frame ago at (x + X, y - Y), in the next at (x - Z, y + W).
        ((4.0, 0.0, 0.0, 0.0), (-4.0, 0.0), (0.0, 0.0)),
        ((0.0, 4.0, 0.0, 0.0), (0.0, 4.0), (0.0, 0.0)),
        ((0.0, 0.0, 4.0, 0.0), (-4.0, 0.0), (0.0, 0.0)),
        ((0.0, 0.0, 0.0, 4.0), (0.0, 4.0), (0.0, 0.0)),
        ((3.0, 5.0, 3.0, 5.0), (-3.0, 5.0), (0.0, 0.0)),
        # Through +6 and -2: v = (-2 - 6) / 2, a = (-2 + 6) / 2.
        ((6.0, 0.0, 2.0, 0.0), (-4.0, 0.0), (2.0, 0.0)),
        ((0.0, 1.0, 1.0, 7.0), (-0.5, 4.0), (-0.5, 3.0)),
        ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
    ],
)
def test_vector_is_a_parabola_through_three_frames(vector: Any, velocity: Any, acceleration: Any) -> None:
    v, a = velocities(vector)
    assert v == pytest.approx(velocity)
    assert a == pytest.approx(acceleration)


def test_vectors_of_a_scene_give_back_its_places() -> None:
    """By the camera's and the object's matrices at three frames, for every sample."""
    camera = pose(lambda t: 0.3 * t, lambda t: -0.1 * t**2, lambda t: 0.2 * t, yaw=lambda t: 0.03 * t)
    card = Card(
        pose(lambda t: 0.2 * t + 0.1 * t**2, lambda t: -0.3 * t, lambda t: 5.0 - 0.4 * t), GREY, (1.0, 0.7)
    )
    scene = Scene((WALL, card), camera, camera_moves=True)
    samples = samples_of(scene, companions=False, paths=False, vectors=True)
    tracks, layer = assigned(samples), samples.layers[0]
    assert samples_of(scene).paths is not None
    paths = samples_of(scene).paths
    assert paths is not None
    x, y = np.meshgrid(np.arange(COLUMNS) + 0.5, np.arange(ROWS) + 0.5)
    assert layer.depth is not None
    rest = np.stack([x, y, np.ones_like(x), 1.0 / layer.depth], axis=-1)
    for time in (-1.0, 1.0):
        place = time * (tracks.velocity + time * tracks.acceleration)
        for index, path in ((0, None), (1, paths.objects[0])):
            there = rest @ paths.reprojection(path, time).T
            off = there[..., :2] / there[..., 2:] - rest[..., :2]
            at = layer.object_index == index
            assert np.abs(off[at]).max() > 2.0
            np.testing.assert_allclose(place[at], off[at], atol=1e-3)
    assert vectors_of(scene, layer).tobytes() == layer.vector.tobytes()  # type: ignore[union-attr]


# Places


@pytest.mark.parametrize(("position", "inset"), [("center", 0.5), ("corner", 0.0)])
def test_first_sample_lies_in_the_display_window(position: Any, inset: float) -> None:
    layer = SampleLayer("", np.zeros((4, 5, 4), np.float32))
    samples = Samples((layer,), Window(-3, 2, 2, 6), Window(1, -4, 9, 9), 1.0, position)
    assert sample_origin(samples) == (-4.0 + inset, 6.0 + inset)


def test_spread_gives_the_nearest_sample_s_path() -> None:
    track = np.zeros((5, 9), dtype=np.int32)
    track[2, 1], track[2, 7] = 3, 4
    velocity = np.zeros((5, 9, 2), dtype=np.float32)
    velocity[2, 1], velocity[2, 7] = [1.0, 2.0], [5.0, 6.0]
    tracks = Tracks(track, velocity, 2.0 * velocity, (None,))
    wanted = np.ones((5, 9), dtype=bool)
    wanted[0] = False
    own, nearest = spread(tracks, track > 0, wanted)
    assert (own.track[0] == NO_TRACK).all()
    assert (own.track[1:, :4] == 3).all()
    assert (own.track[1:, 5:] == 4).all()
    np.testing.assert_array_equal(own.velocity[:, 8], np.broadcast_to([5.0, 6.0], (5, 2)))
    np.testing.assert_array_equal(own.acceleration[:, 0], np.broadcast_to([2.0, 4.0], (5, 2)))
    assert (nearest[0] == 2).all()


def test_reference_cameras_are_those_of_the_file() -> None:
    """The scenes' own projection and the core's reprojection meet at the rendered frame."""
    paths = samples_of(scene_named("dolly")).paths
    assert paths is not None
    identity: Array = paths.reprojection(None, 0.0)
    np.testing.assert_allclose(identity, np.eye(4)[:3], atol=1e-12)
    assert isinstance(paths.camera, CameraPath)
