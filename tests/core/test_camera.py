"""The pinhole camera: every sign, Blender's sensor fit, and points projected by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from potmesil_addon.camera import (
    Camera,
    Film,
    FrameFormat,
    SensorFit,
    camera_rotation,
    pan_tilt_swing,
    without_scale,
)
from potmesil_addon.errors import SettingsError

MM = 1e-3
LEVEL = np.eye(4)
"""A camera in the world's origin that looks along the world's -z."""

SMALL = 0.3


def frame(columns: int = 1000, rows: int = 500, **others: Any) -> FrameFormat:
    return FrameFormat(
        sensor_width=36 * MM, sensor_height=24 * MM, resolution_x=columns, resolution_y=rows, **others
    )


def forward(rotation: np.ndarray) -> np.ndarray:
    """Return where a camera looks, in the world."""
    return -rotation[2]


def pixel_of(camera: Camera, x: float, y: float, z: float) -> list[float]:
    pixels, _ = camera.project([x, y, z])
    return pixels.tolist()


# Angles


def test_at_rest_it_looks_along_y_with_z_up() -> None:
    rotation = camera_rotation(0.0, 0.0, 0.0)
    np.testing.assert_allclose(rotation @ [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], atol=1e-15)
    np.testing.assert_allclose(rotation @ [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(rotation @ [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], atol=1e-15)


def test_pan_turns_left() -> None:
    looks = forward(camera_rotation(SMALL, 0.0, 0.0))
    np.testing.assert_allclose(looks, [-math.sin(SMALL), math.cos(SMALL), 0.0], atol=1e-15)


def test_tilt_raises() -> None:
    looks = forward(camera_rotation(0.0, SMALL, 0.0))
    np.testing.assert_allclose(looks, [0.0, math.cos(SMALL), math.sin(SMALL)], atol=1e-15)


def test_swing_rolls_counter_clockwise() -> None:
    # Its top leans to its own left, so what it sees turns clockwise.
    top = camera_rotation(0.0, 0.0, SMALL)[1]
    np.testing.assert_allclose(top, [-math.sin(SMALL), 0.0, math.cos(SMALL)], atol=1e-15)


@given(st.floats(-3.14, 3.14), st.floats(-1.57, 1.57), st.floats(-3.14, 3.14))
def test_angles_round_trip(pan: float, tilt: float, swing: float) -> None:
    rotation = camera_rotation(pan, tilt, swing)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(pan_tilt_swing(rotation), (pan, tilt, swing), atol=1e-9)


@pytest.mark.parametrize("tilt", [math.pi / 2, -math.pi / 2])
@pytest.mark.parametrize("pan", [0.0, 1.0, -2.5])
def test_looking_straight_up_or_down_has_no_pan(tilt: float, pan: float) -> None:
    rotation = camera_rotation(pan, tilt, 0.4)
    angles = pan_tilt_swing(rotation)
    assert angles[0] == 0.0
    assert angles[1] == pytest.approx(tilt, abs=1e-7)
    np.testing.assert_allclose(camera_rotation(*angles), rotation, atol=1e-12)


# Projection


def test_point_projected_by_hand() -> None:
    # 36 mm over 1000 pixels; at 5 m a 50 mm lens makes 3.6 mm of 0.36 m, which is 100 pixels.
    camera = Camera.from_format(LEVEL, 50 * MM, frame())
    assert pixel_of(camera, 0.36, 0.18, -5.0) == pytest.approx([600.0, 200.0], abs=1e-9)
    assert pixel_of(camera, 0.0, 0.0, -5.0) == pytest.approx([500.0, 250.0], abs=1e-9)


def test_point_projected_by_a_camera_that_moved_and_turned() -> None:
    # At (1, 2, 3), turned 90 degrees to the left: it looks along -x, its right hand is +y.
    to_camera = np.eye(4)
    to_camera[:3, :3] = camera_rotation(math.pi / 2, 0.0, 0.0)
    to_camera[:3, 3] = -to_camera[:3, :3] @ [1.0, 2.0, 3.0]
    camera = Camera.from_format(to_camera, 50 * MM, frame())
    pixels, depth = camera.project([1.0 - 5.0, 2.0 + 0.36, 3.0 + 0.18])
    assert float(depth) == pytest.approx(5.0, abs=1e-12)
    assert pixels.tolist() == pytest.approx([600.0, 200.0], abs=1e-9)


def test_matrix_gives_homogeneous_pixels_and_depth() -> None:
    """TOG 1982, eq. 1: its third row is the depth along the axis, not the distance."""
    camera = Camera.from_format(LEVEL, 50 * MM, frame())
    x, y, w = camera.matrix @ [3.0, 4.0, -12.0, 1.0]
    assert w == pytest.approx(12.0, abs=1e-12)
    # 3 m at 12 m: 12.5 mm, 347.22 pixels; 4 m: 16.67 mm, 462.96 pixels.
    assert x / w == pytest.approx(500.0 + 12.5 / 0.036, abs=1e-9)
    assert y / w == pytest.approx(250.0 - 50.0 / 3.0 / 0.036, abs=1e-9)


def test_depth_is_negative_behind_the_camera() -> None:
    camera = Camera.from_format(LEVEL, 50 * MM, frame())
    assert camera.project([0.0, 0.0, 2.0])[1] == -2.0


@pytest.mark.parametrize("shape", [(), (0,), (4,), (2, 3)])
def test_project_keeps_any_shape(shape: tuple[int, ...]) -> None:
    camera = Camera.from_format(LEVEL, 50 * MM, frame())
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (*shape, 3)) - [0.0, 0.0, 5.0]
    pixels, depth = camera.project(points)
    assert pixels.shape == (*shape, 2)
    assert depth.shape == shape
    np.testing.assert_allclose(depth, -points[..., 2], atol=1e-15)


# Sensor fit. The point lies 0.36 m right of and 0.18 m above the axis at 5 m: 3.6 and 1.8 mm on the film.


@pytest.mark.parametrize(
    ("fit", "columns", "rows", "pitch_um", "pixel"),
    [
        ("AUTO", 1000, 500, 36.0, (600.0, 200.0)),
        ("AUTO", 500, 1000, 36.0, (350.0, 450.0)),
        ("AUTO", 800, 800, 45.0, (480.0, 360.0)),
        ("HORIZONTAL", 1000, 500, 36.0, (600.0, 200.0)),
        ("HORIZONTAL", 500, 1000, 72.0, (300.0, 475.0)),
        ("VERTICAL", 1000, 500, 48.0, (575.0, 212.5)),
        ("VERTICAL", 500, 1000, 24.0, (400.0, 425.0)),
    ],
)
def test_sensor_fit(
    fit: SensorFit, columns: int, rows: int, pitch_um: float, pixel: tuple[float, float]
) -> None:
    camera = Camera.from_format(LEVEL, 50 * MM, frame(columns, rows, sensor_fit=fit))
    assert pixel_of(camera, 0.36, 0.18, -5.0) == pytest.approx(pixel, abs=1e-9)
    assert camera.film.pitch_x == pytest.approx(pitch_um * 1e-6, rel=1e-12)
    assert camera.film.pitch_y == pytest.approx(pitch_um * 1e-6, rel=1e-12)
    assert camera.film.width == pytest.approx(columns * pitch_um * 1e-6, rel=1e-12)
    assert camera.film.height == pytest.approx(rows * pitch_um * 1e-6, rel=1e-12)


@pytest.mark.parametrize(
    ("fit", "columns", "rows", "aspect", "pitch_um"),
    [
        # 400 pixels twice as wide as high are 800 by 500 units: landscape, 36 mm over 800.
        ("AUTO", 400, 500, (2.0, 1.0), (90.0, 45.0)),
        # 500 by 800 units: portrait, 36 mm over 800.
        ("AUTO", 500, 400, (1.0, 2.0), (45.0, 90.0)),
        # Only the ratio counts.
        ("AUTO", 400, 500, (1.0, 0.5), (90.0, 45.0)),
        ("HORIZONTAL", 500, 400, (1.0, 2.0), (72.0, 144.0)),
        # 24 mm over 500 rows.
        ("VERTICAL", 400, 500, (2.0, 1.0), (96.0, 48.0)),
        # 24 mm over 800 units of height.
        ("VERTICAL", 500, 400, (1.0, 2.0), (30.0, 60.0)),
    ],
)
def test_pixel_aspect(
    fit: SensorFit, columns: int, rows: int, aspect: tuple[float, float], pitch_um: tuple[float, float]
) -> None:
    described = frame(columns, rows, sensor_fit=fit, pixel_aspect_x=aspect[0], pixel_aspect_y=aspect[1])
    film = Camera.from_format(LEVEL, 50 * MM, described).film
    assert (film.pitch_x * 1e6, film.pitch_y * 1e6) == pytest.approx(pitch_um, rel=1e-12)


def test_positive_shift_shows_what_is_right_and_above() -> None:
    # A tenth of the width, 100 pixels: the axis moves left and down in the picture.
    camera = Camera.from_format(LEVEL, 50 * MM, frame(shift_x=0.1, shift_y=0.1))
    assert pixel_of(camera, 0.0, 0.0, -5.0) == pytest.approx([400.0, 350.0], abs=1e-9)
    assert (camera.axis_x, camera.axis_y) == pytest.approx((400.0, 350.0), abs=1e-9)


@pytest.mark.parametrize(
    ("fit", "columns", "rows", "axis"),
    [
        ("AUTO", 500, 1000, (50.0, 600.0)),  # of the height, the longer side
        ("HORIZONTAL", 500, 1000, (150.0, 550.0)),  # of the width
        ("VERTICAL", 1000, 500, (400.0, 300.0)),  # of the height
    ],
)
def test_shift_counts_the_fitted_side(
    fit: SensorFit, columns: int, rows: int, axis: tuple[float, float]
) -> None:
    camera = Camera.from_format(
        LEVEL, 50 * MM, frame(columns, rows, sensor_fit=fit, shift_x=0.2, shift_y=0.1)
    )
    assert (camera.axis_x, camera.axis_y) == pytest.approx(axis, abs=1e-9)


def test_border_crops_with_y_up() -> None:
    # The right half but its last tenth, and the upper half.
    described = frame(border=(0.5, 0.9, 0.5, 1.0))
    assert described.crop == (500, 0, 900, 250)
    camera = Camera.from_format(LEVEL, 50 * MM, described)
    assert (camera.film.columns, camera.film.rows) == (400, 250)
    assert camera.film.width == pytest.approx(0.4 * 36 * MM, rel=1e-12)
    # The pixel (600, 200) of the whole frame.
    assert pixel_of(camera, 0.36, 0.18, -5.0) == pytest.approx([100.0, 200.0], abs=1e-9)


def test_lower_border_cuts_rows_from_the_top() -> None:
    assert frame(border=(0.0, 1.0, 0.0, 0.5)).crop == (0, 250, 1000, 500)


@pytest.mark.parametrize(
    ("side", "low", "high", "pixels"),
    [
        (10, 0.3, 0.7, (3, 7)),
        (10, 0.1, 0.7, (1, 7)),
        (10, 0.2, 0.9, (2, 9)),
        (20, 0.05, 0.95, (1, 19)),
        (30, 0.1, 0.7, (3, 21)),
        (100, 0.29, 0.57, (29, 57)),
        (50, 0.58, 0.94, (29, 47)),
    ],
)
def test_border_is_rounded_as_blender_rounds_it(
    side: int, low: float, high: float, pixels: tuple[int, int]
) -> None:
    """Blender keeps a border, and multiplies it by the resolution, in single precision."""
    first, last = float(np.float32(low)), float(np.float32(high))
    left, top, right, bottom = frame(side, side, border=(first, last, first, last)).crop
    assert (left, right) == pixels
    assert (side - bottom, side - top) == pixels


@pytest.mark.parametrize(
    ("columns", "rows", "percentage", "size"),
    [
        (1001, 501, 50, (500, 250)),
        (1920, 1080, 33, (633, 356)),
        (3, 3, 200, (6, 6)),
        (1999, 7, 99, (1979, 6)),
    ],
)
def test_resolution_percentage_rounds_down(
    columns: int, rows: int, percentage: int, size: tuple[int, int]
) -> None:
    described = frame(columns, rows, resolution_percentage=percentage)
    assert described.frame_size == size
    film = Camera.from_format(LEVEL, 50 * MM, described).film
    assert (film.columns, film.rows) == size
    # The sensor lies along the rounded picture.
    assert max(film.width, film.height) == pytest.approx(36 * MM, rel=1e-12)


def test_scale_of_the_camera_object_does_not_count() -> None:
    turn = np.eye(4)
    turn[:3, :3] = camera_rotation(0.4, -0.2, 0.1).T
    turn[:3, 3] = [1.0, -2.0, 0.5]
    scaled = turn @ np.diag([2.0, 0.5, 3.0, 1.0])
    np.testing.assert_allclose(without_scale(np.linalg.inv(scaled)), np.linalg.inv(turn), atol=1e-14)
    plain = Camera.from_format(np.linalg.inv(turn), 50 * MM, frame())
    other = Camera.from_format(np.linalg.inv(scaled), 50 * MM, frame())
    np.testing.assert_allclose(plain.matrix, other.matrix, atol=1e-9)


def test_a_camera_without_size_is_refused() -> None:
    with pytest.raises(SettingsError, match="scale"):
        without_scale(np.diag([1.0, 1.0, 0.0, 1.0]))


# Film


def test_film_of_a_landscape_picture_takes_the_width() -> None:
    film = Film.from_sensor(1000, 500, sensor_width=36 * MM, sensor_height=24 * MM)
    assert (film.width, film.height) == pytest.approx((36 * MM, 18 * MM), rel=1e-12)


def test_film_of_a_portrait_picture_takes_the_height() -> None:
    film = Film.from_sensor(500, 1000, sensor_width=36 * MM, sensor_height=24 * MM)
    assert (film.width, film.height) == pytest.approx((12 * MM, 24 * MM), rel=1e-12)


def test_film_of_a_square_picture_takes_the_width() -> None:
    film = Film.from_sensor(500, 500, sensor_width=36 * MM, sensor_height=24 * MM)
    assert (film.width, film.height) == pytest.approx((36 * MM, 36 * MM), rel=1e-12)


@pytest.mark.parametrize(("columns", "rows"), [(1000, 500), (500, 1000)])
def test_film_takes_the_one_side_it_is_given(columns: int, rows: int) -> None:
    by_width = Film.from_sensor(columns, rows, sensor_width=30 * MM)
    by_height = Film.from_sensor(columns, rows, sensor_height=30 * MM)
    assert (by_width.width, by_width.height) == pytest.approx((30 * MM, 30 * MM * rows / columns), rel=1e-12)
    assert (by_height.width, by_height.height) == pytest.approx(
        (30 * MM * columns / rows, 30 * MM), rel=1e-12
    )


def test_film_counts_the_pixels_shape() -> None:
    # 400 pixels twice as wide as high are wider than 500 rows.
    film = Film.from_sensor(400, 500, 2.0, sensor_width=36 * MM, sensor_height=24 * MM)
    assert film.width == pytest.approx(36 * MM, rel=1e-12)
    assert film.pitch_x / film.pitch_y == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("width", [30e-6, 40.0])
def test_film_refuses_pixels_that_are_lines(width: float) -> None:
    with pytest.raises(SettingsError, match="times as wide as high"):
        Film(width, 24 * MM, 36, 24)


def test_film_needs_a_side() -> None:
    with pytest.raises(SettingsError, match="width or its height"):
        Film.from_sensor(10, 10)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("side", ["sensor_width", "sensor_height"])
def test_film_refuses_a_sensor_without_size(side: str, value: float) -> None:
    with pytest.raises(SettingsError, match="greater than 0"):
        Film.from_sensor(10, 10, **{side: value})


@pytest.mark.parametrize(("columns", "rows"), [(0, 10), (10, 0), (-1, 10)])
def test_film_refuses_a_picture_without_pixels(columns: int, rows: int) -> None:
    with pytest.raises(SettingsError, match="holds nothing"):
        Film(36 * MM, 24 * MM, columns, rows)
