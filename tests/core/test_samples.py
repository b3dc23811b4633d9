"""Windows and the repair of values that are not finite."""

from __future__ import annotations

import numpy as np
import pytest

from potmesil_addon.camera import Camera, Film
from potmesil_addon.paths import CameraPath, MotionPaths
from potmesil_addon.samples import Cryptomatte, SampleLayer, Samples, Window, repair


def test_window_counts_its_pixels() -> None:
    window = Window(-2, 3, 5, 4)
    assert (window.columns, window.rows) == (7, 1)


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (Window(2, 3, 8, 9), Window(2, 3, 8, 9)),
        (Window(-5, 4, 3, 30), Window(0, 4, 3, 10)),
        (Window(-5, -5, 50, 50), Window(0, 0, 10, 10)),
    ],
)
def test_intersection(other: Window, expected: Window) -> None:
    window = Window(0, 0, 10, 10)
    assert window.intersection(other) == expected
    assert other.intersection(window) == expected


@pytest.mark.parametrize("other", [Window(10, 0, 20, 10), Window(-9, -9, -1, -1), Window(3, 30, 5, 40)])
def test_windows_that_do_not_meet_have_an_intersection_of_no_size(other: Window) -> None:
    nothing = Window(0, 0, 10, 10).intersection(other)
    assert nothing.columns * nothing.rows == 0
    assert nothing.columns >= 0
    assert nothing.rows >= 0


def test_sound_values_stay_as_they_are() -> None:
    values = np.random.default_rng(1).random((4, 5)).astype(np.float32)
    before = values.copy()
    assert repair(values, np.zeros((4, 5), dtype=bool)) == 0
    assert np.array_equal(values, before)


def test_a_hole_takes_the_mean_of_its_sound_neighbours() -> None:
    values = np.array([[1.0, 2.0, 4.0], [9.0, np.nan, 16.0]], dtype=np.float32)
    assert repair(values, np.isnan(values)) == 1
    assert values.tolist() == [[1.0, 2.0, 4.0], [9.0, pytest.approx(32.0 / 5.0), 16.0]]


def test_holes_side_by_side_do_not_count_for_each_other() -> None:
    values = np.array([[8.0, np.nan, np.inf, 4.0]], dtype=np.float32)
    assert repair(values, ~np.isfinite(values)) == 2
    assert values.tolist() == [[8.0, 8.0, 4.0, 4.0]]


def test_a_wide_hole_is_filled_from_its_rim_inwards() -> None:
    values = np.full((1, 7), np.nan, dtype=np.float32)
    values[0, 0], values[0, 6] = 0.0, 6.0
    assert repair(values, np.isnan(values)) == 5
    # From both sides by turns; the middle one lies between them.
    assert values.tolist() == [[0.0, 0.0, 0.0, 3.0, 6.0, 6.0, 6.0]]


def test_channels_are_repaired_together() -> None:
    values = np.zeros((1, 3, 2), dtype=np.float32)
    values[0] = [[1.0, 10.0], [np.nan, 20.0], [3.0, 30.0]]
    assert repair(values, np.isnan(values).any(axis=2)) == 1
    assert values[0].tolist() == [[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]]


def test_without_a_sound_value_all_become_0() -> None:
    values = np.full((3, 2), np.nan, dtype=np.float32)
    assert repair(values, np.isnan(values)) == 6
    assert not values.any()


def test_every_hole_is_filled() -> None:
    rng = np.random.default_rng(3)
    values = rng.uniform(1.0, 2.0, (40, 30)).astype(np.float32)
    broken = rng.random((40, 30)) < 0.8
    values[broken] = np.nan
    sound = values[~broken].copy()
    assert repair(values, broken) == broken.sum()
    assert np.isfinite(values).all()
    assert values.min() >= 1.0
    assert values.max() <= 2.0
    assert np.array_equal(values[~broken], sound)


def test_another_picture_of_the_same_samples_sees_the_same_points() -> None:
    film = Film(0.036, 0.024, 36, 24)
    camera = Camera(np.eye(4), 0.05, film, axis_x=17.0, axis_y=13.0)
    path = CameraPath(np.zeros(1), camera.matrix[np.newaxis])
    window = Window(100, 50, 136, 74)
    color = np.random.default_rng(0).random((24, 36, 4)).astype(np.float32)
    ids = np.arange(2 * 24 * 36, dtype=np.uint32).reshape(2, 24, 36)
    layer = SampleLayer(
        "",
        color,
        color[..., 0],
        hidden=(SampleLayer("behind", color[..., ::-1].copy()),),
        cryptomatte=Cryptomatte(ids, np.ones((2, 24, 36), np.float32)),
    )
    samples = Samples((layer,), window, window, film=film, camera=camera, paths=MotionPaths(path))
    wider = samples.showing(Window(97, 52, 140, 74))
    assert wider.display_window == Window(97, 52, 140, 74)
    assert wider.data_window == Window(97, 50, 140, 74)
    assert wider.film is not None
    assert (wider.film.pitch_x, wider.film.pitch_y) == pytest.approx((film.pitch_x, film.pitch_y))
    # A point's absolute pixel stays; the picture's corner moved by 3 columns and -2 rows.
    points = np.array([[0.3, 0.2, -4.0], [-0.1, 0.4, -9.0]])
    assert wider.camera is not None
    assert wider.camera.project(points)[0] - [3.0, -2.0] == pytest.approx(camera.project(points)[0])
    assert wider.paths is not None
    assert wider.paths.camera.at(0.0)[:3] == pytest.approx(wider.camera.matrix)
    bent = wider.layers[0]
    assert np.array_equal(bent.color[:, 3:-4], color)
    assert np.array_equal(bent.color[:, 2::-1], color[:, :3])
    assert bent.depth is not None
    assert np.array_equal(bent.depth[:, -4], color[:, -1, 0])
    assert bent.cryptomatte is not None
    assert np.array_equal(bent.cryptomatte.ids[:, :, 3:-4], ids)
    assert np.array_equal(bent.hidden[0].color[:, 3:-4], color[..., ::-1])
    smaller = samples.showing(Window(110, 60, 120, 70))
    assert smaller.layers is samples.layers
