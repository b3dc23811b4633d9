"""Pixel coverage of ellipses and polygons: worked by hand, and against scan lines and clipping."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from potmesil_addon.aperture import (
    SAMPLE_POSITIONS,
    SamplePosition,
    ellipse_rows,
    polygon_rows,
    polygon_vertices,
)

from .helpers import Array, ellipse_coverage, on_canvas, polygon_coverage

positions = pytest.mark.parametrize("position", SAMPLE_POSITIONS)


def half_of(position: SamplePosition) -> float:
    """Return how far the sample lies right of and below the corner of the pixel at offset 0."""
    return 0.5 if position == "center" else 0.0


def turned(blades: int, rotation: float, radius: float, ratio: float = 1.0) -> Array:
    """Return a polygon's corners in pixels with y down."""
    return polygon_vertices(blades, rotation, ratio) * [radius, -radius]


# By hand


@pytest.mark.parametrize("radius", [0.0, 1e-12, 0.1, 0.3, 0.5])
def test_circle_inside_a_pixel_fills_that_pixel(radius: float) -> None:
    assert ellipse_rows(radius, radius).dense().tolist() == [[[pytest.approx(1.0, abs=1e-14)]]]


@pytest.mark.parametrize("radius", [0.0, 1e-12, 0.4, 1.0])
def test_circle_on_a_corner_is_quartered(radius: float) -> None:
    np.testing.assert_allclose(
        ellipse_rows(radius, radius, "corner").dense(), np.full((1, 2, 2), 0.25), atol=1e-14
    )


def test_unit_circle_by_hand() -> None:
    # Beyond x = 1/2 and within |y| <= 1/2 lies int sqrt(1 - y^2) - 1/2 = (sqrt(3)/4 + pi/6) - 1/2.
    edge = math.sqrt(3.0) / 4.0 + math.pi / 6.0 - 0.5
    corner = (math.pi - 1.0 - 4.0 * edge) / 4.0
    expected = np.array([[corner, edge, corner], [edge, 1.0, edge], [corner, edge, corner]]) / math.pi
    np.testing.assert_allclose(ellipse_rows(1.0, 1.0).dense()[0], expected, atol=1e-14)


def test_four_blades_at_rotation_0_are_an_upright_square_by_hand() -> None:
    # A blade's middle at angle 0: corners at 45 degrees. Radius sqrt(2) is the square from -1 to 1.
    square = turned(4, 0.0, math.sqrt(2.0))
    np.testing.assert_allclose(np.abs(square), 1.0, atol=1e-15)
    expected = np.array([[0.25, 0.5, 0.25], [0.5, 1.0, 0.5], [0.25, 0.5, 0.25]]) / 4.0
    np.testing.assert_allclose(on_canvas(polygon_rows(square), 1)[0], expected, atol=1e-14)


def test_square_on_a_corner_covers_four_whole_pixels() -> None:
    canvas = on_canvas(polygon_rows(turned(4, 0.0, math.sqrt(2.0)), "corner"), 2)[0]
    expected = np.zeros((5, 5))
    expected[1:3, 1:3] = 0.25
    np.testing.assert_allclose(canvas, expected, atol=1e-14)


def test_four_blades_turned_by_45_degrees_stand_on_a_corner_by_hand() -> None:
    # |x| + |y| <= 1 has the area 2: the middle pixel whole, a triangle of 1/4 in each beside it.
    diamond = turned(4, math.pi / 4.0, 1.0)
    expected = np.array([[0.0, 0.25, 0.0], [0.25, 1.0, 0.25], [0.0, 0.25, 0.0]]) / 2.0
    np.testing.assert_allclose(on_canvas(polygon_rows(diamond), 1)[0], expected, atol=1e-14)


def test_square_beside_its_sample_lies_where_its_corners_say() -> None:
    # x from 1 to 3 and y, down, from 0 to 1, seen from a corner.
    square = [(1.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0)]
    canvas = on_canvas(polygon_rows(square, "corner"), 3)[0]
    assert np.argwhere(canvas > 1e-12).tolist() == [[3, 4], [3, 5]]
    np.testing.assert_allclose(canvas[3, 4:6], 0.5, atol=1e-14)


# Against brute force


@positions
@pytest.mark.parametrize(
    ("rx", "ry"), [(0.7, 0.7), (1.5, 1.5), (2.37, 2.37), (5.0, 5.0), (3.3, 1.2), (0.4, 2.6), (0.05, 4.0)]
)
def test_ellipse_equals_scan_lines(rx: float, ry: float, position: SamplePosition) -> None:
    canvas = on_canvas(ellipse_rows(rx, ry, position), 7)[0]
    expected = ellipse_coverage(rx, ry, 7, half_of(position))
    np.testing.assert_allclose(canvas, expected, atol=2e-6)


@positions
@pytest.mark.parametrize("blades", [3, 4, 5, 6, 9])
@pytest.mark.parametrize(
    ("rotation", "radius", "ratio"), [(0.0, 2.5, 1.0), (0.3, 4.2, 1.0), (1.1, 0.6, 1.0), (-0.7, 3.1, 2.0)]
)
def test_polygon_equals_clipping(
    blades: int, rotation: float, radius: float, ratio: float, position: SamplePosition
) -> None:
    corners = turned(blades, rotation, radius, ratio)
    canvas = on_canvas(polygon_rows(corners, position), 6)[0]
    np.testing.assert_allclose(canvas, polygon_coverage(corners, 6, half_of(position)), atol=1e-13)


def test_polygon_with_many_blades_is_a_disc() -> None:
    canvas = on_canvas(polygon_rows(turned(2000, 0.1, 3.7)), 5)
    np.testing.assert_allclose(canvas, on_canvas(ellipse_rows(3.7, 3.7), 5), atol=1e-6)


def test_either_order_of_corners_is_the_same_polygon() -> None:
    corners = turned(5, 0.3, 3.3)
    np.testing.assert_allclose(
        polygon_rows(corners[::-1]).dense(), polygon_rows(corners).dense(), rtol=0.0, atol=1e-14
    )


@positions
@given(st.floats(0.0, 60.0), st.floats(0.0, 60.0))
def test_ellipse_sums_to_1_and_is_not_negative(position: SamplePosition, rx: float, ry: float) -> None:
    values = ellipse_rows(rx, ry, position).dense()
    assert float(values.sum()) == pytest.approx(1.0, abs=1e-12)
    # The running sums round to the last digit of the values that they add up.
    assert float(values.min()) >= -1e-14
    assert float(values.max()) <= 1.0 + 1e-14


@positions
@given(st.integers(3, 16), st.floats(-7.0, 7.0), st.floats(0.1, 60.0), st.floats(0.2, 5.0))
def test_polygon_sums_to_1_and_is_not_negative(
    position: SamplePosition, blades: int, rotation: float, radius: float, ratio: float
) -> None:
    table = polygon_rows(turned(blades, rotation, radius, ratio), position)
    values = table.dense()
    assert float(values.sum()) == pytest.approx(1.0, abs=1e-12)
    assert float(values.min()) >= -1e-12
    assert values.shape[1] == table.row_begin.size


def ends_of_rows(corners: Array, position: SamplePosition) -> Array:
    """Return what is left of each row's running sum after its last pixel."""
    table = polygon_rows(corners, position)
    rows = zip(table.row_begin, table.row_end, strict=True)
    return np.array([table.delta[begin:end, 0].sum() for begin, end in rows])


@positions
@given(st.integers(3, 12), st.floats(-4.0, 4.0), st.floats(0.1, 60.0), st.floats(0.5, 2.0))
def test_polygon_rows_end_in_nothing(
    position: SamplePosition, blades: int, rotation: float, radius: float, ratio: float
) -> None:
    """What is left would be drawn from here to the frame's border; a highlight is 1e6 times as bright."""
    assert np.abs(ends_of_rows(turned(blades, rotation, radius, ratio), position)).max() < 1e-13


@positions
@pytest.mark.parametrize("radius", [0.5, 1.65, 10.0, 40.0])
@pytest.mark.parametrize("angle", [1e-10, 1e-8, 4.4e-8, 1e-6, 1e-4])
def test_nearly_upright_blades_end_in_nothing(position: SamplePosition, radius: float, angle: float) -> None:
    """Blender's angles have single precision: 90 degrees are off by 4.4e-8."""
    for sign in (-1.0, 1.0):
        for quarter in (0.0, math.pi / 2.0):
            ends = ends_of_rows(turned(4, quarter + sign * angle, radius), position)
            assert np.abs(ends).max() < 1e-13


@positions
@given(st.floats(0.0, 20.0), st.floats(0.0, 20.0))
def test_ellipse_is_symmetric_both_ways(position: SamplePosition, rx: float, ry: float) -> None:
    values = ellipse_rows(rx, ry, position).dense()[0]
    np.testing.assert_allclose(values, values[::-1], rtol=0.0, atol=0.0)
    np.testing.assert_allclose(values, values[:, ::-1], rtol=0.0, atol=1e-14)


@positions
@given(st.floats(0.1, 20.0))
def test_circle_is_symmetric_about_the_diagonal(position: SamplePosition, radius: float) -> None:
    values = ellipse_rows(radius, radius, position).dense()[0]
    np.testing.assert_allclose(values, values.T, rtol=0.0, atol=1e-13)


@positions
@pytest.mark.parametrize("radius", [0.2, 1.0, 3.9])
def test_rows_lie_around_the_sample(position: SamplePosition, radius: float) -> None:
    table = ellipse_rows(radius, radius, position)
    rows = table.row_begin.size
    first, last = table.first_row, table.first_row + rows - 1
    assert first + last == (0 if position == "center" else -1)
    assert table.dense().shape[2] % 2 == (1 if position == "center" else 0)


# Orientation


def test_corners_go_counter_clockwise_with_y_up_from_a_blades_middle() -> None:
    corners = polygon_vertices(3, 0.0, 1.0)
    degrees = np.degrees(np.arctan2(corners[:, 1], corners[:, 0]))
    assert degrees.tolist() == pytest.approx([-60.0, 60.0, 180.0])


def test_rotation_is_counter_clockwise() -> None:
    # A corner that points up goes to the left.
    before = polygon_vertices(3, -math.pi / 2.0, 1.0)
    after = polygon_vertices(3, -math.pi / 2.0 + 0.2, 1.0)
    top = int(np.argmax(before[:, 1]))
    np.testing.assert_allclose(before[top], [0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(after[top], [-math.sin(0.2), math.cos(0.2)], atol=1e-15)


def test_pixel_rows_count_downwards() -> None:
    # Corners given with y down: an apex at y = -3 is above the sample, at negative offsets.
    table = polygon_rows([(0.0, -3.0), (2.0, 1.0), (-2.0, 1.0)])
    canvas = on_canvas(table, 4)[0]
    assert table.first_row == -3
    widths = (canvas > 1e-12).sum(axis=1)
    assert widths[1] < widths[3] < widths[5]
    assert widths[6] == 0


def test_anamorphic_ratio_narrows_x() -> None:
    round_corners, narrow = polygon_vertices(6, 0.3, 1.0), polygon_vertices(6, 0.3, 2.0)
    np.testing.assert_allclose(narrow[:, 0], 0.5 * round_corners[:, 0], atol=1e-15)
    np.testing.assert_allclose(narrow[:, 1], round_corners[:, 1], atol=0.0)


def test_polygon_without_area_is_refused() -> None:
    with pytest.raises(ValueError, match="area"):
        polygon_rows([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])


@positions
def test_differences_are_as_few_as_the_rim_is_long(position: SamplePosition) -> None:
    """The scatter's cost: entries grow with the radius, not with the area."""
    for radius in (20.0, 80.0):
        assert ellipse_rows(radius, radius, position).offset.size < 4.0 * radius
        assert polygon_rows(turned(6, 0.2, radius), position).offset.size < 12.0 * radius
