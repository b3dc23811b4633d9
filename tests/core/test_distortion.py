"""Lens distortion and lateral colour: where things go, and what is carried along."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from potmesil_addon.camera import Film
from potmesil_addon.distortion import LensMap, distorted_layer, distorted_picture, lens_map, window_needed
from potmesil_addon.effects import ChromaticAberration, Distortion
from potmesil_addon.samples import Cryptomatte, SampleLayer, Window

MODELS = [
    Distortion("brown", -0.3),
    Distortion("brown", -0.2, 0.05, -0.01, 0.002, 0.01, -0.02),
    Distortion("brown", 0.2),
    Distortion("polynomial", 0.3, -0.05, 0.01),
    Distortion("polynomial", -0.3),
    Distortion("division", -0.3),
    Distortion("division", 0.2, -0.05),
    Distortion("nuke", 0.08, 0.005),
    Distortion("nuke", -0.1),
]
BACKENDS = ["numba", "numpy"]

# Shifted, with pixels half as wide again as high.
SHIFTED = LensMap(Distortion("brown", -0.3), 100.0, 150.0, 53.0, 31.0, 96, 64)


def with_model(distortion: Distortion, lens: LensMap = SHIFTED) -> LensMap:
    return replace(lens, distortion=distortion)


def grid(window: Window, step: float = 5.0) -> np.ndarray:
    x, y = np.arange(window.x0, window.x1, step), np.arange(window.y0, window.y1, step)
    return np.stack(np.meshgrid(x, y), axis=-1)


def formula(distortion: Distortion, x: float, y: float, unit: float) -> tuple[float, float, float, float]:
    """Return an undistorted and a distorted point, of which (x, y) is the one that the model begins with."""
    r2 = x * x + y * y
    d = distortion
    if d.model == "nuke":
        q = 1.0 + d.k1 * (r2 / unit**2) + d.k2 * (r2 / unit**2) ** 2
        return x / q, y / q, x, y
    if d.model == "division":
        q = 1.0 + d.k1 * r2 + d.k2 * r2**2
        return x, y, x / q, y / q
    q = 1.0 + d.k1 * r2 + d.k2 * r2**2 + d.k3 * r2**3 + d.k4 * r2**4
    tx = d.p1 * (r2 + 2.0 * x * x) + d.p2 * 2.0 * x * y
    ty = d.p2 * (r2 + 2.0 * y * y) + d.p1 * 2.0 * x * y
    return x, y, x * q + tx, y * q + ty


# ----- the models


@pytest.mark.parametrize("distortion", MODELS, ids=str)
def test_points_go_where_the_formula_says(distortion: Distortion) -> None:
    lens = with_model(distortion)
    for x, y in [(0.0, 0.0), (0.21, 0.13), (-0.4, 0.05), (0.1, -0.22)]:
        # Half of the longer side: 48 pixels' widths, of which 100 are the focal length.
        before_x, before_y, after_x, after_y = formula(distortion, x, y, 0.48)
        place = lens.distort([53.0 + 100.0 * before_x, 31.0 - 150.0 * before_y])
        np.testing.assert_allclose(place, [53.0 + 100.0 * after_x, 31.0 - 150.0 * after_y], atol=1e-9)


def test_by_hand() -> None:
    # 0.5 to the right and 0.2 up: r^2 = 0.29.
    lens = with_model(Distortion("polynomial", 0.1))
    np.testing.assert_allclose(lens.distort([103.0, 1.0]), [53.0 + 51.45, 31.0 - 30.87])
    # 0.01 (0.29 + 0.5) and 0.01 * 2 * 0.1.
    lens = with_model(Distortion("brown", p1=0.01))
    np.testing.assert_allclose(lens.distort([103.0, 1.0]), [103.0 + 0.79, 1.0 - 0.3])
    # 0.01 * 2 * 0.1 and 0.01 (0.29 + 0.08).
    lens = with_model(Distortion("brown", p2=0.01))
    np.testing.assert_allclose(lens.distort([103.0, 1.0]), [103.0 + 0.2, 1.0 - 0.555])


def test_nuke_goes_by_the_longer_side_whichever_it_is() -> None:
    upright = replace(SHIFTED, distortion=Distortion("nuke", 0.1), columns=60, rows=120)
    # Half of 120 pixels' heights is 0.4 focal lengths, half of 60 widths 0.3: the rim's distance is 1.
    np.testing.assert_allclose(upright.undistort([53.0, 31.0 - 60.0]), [53.0, 31.0 - 60.0 / 1.1])


@pytest.mark.parametrize("primary", [0, 1, 2, None])
@pytest.mark.parametrize("distortion", MODELS, ids=str)
def test_there_and_back(distortion: Distortion, primary: int | None) -> None:
    lens = replace(with_model(distortion), size_red=0.01, size_blue=-0.02)
    points = grid(Window(0, 0, 96, 64))
    size = {0: 1.01, 2: 0.98}.get(primary, 1.0)
    seen = lens.distort(lens.undistort(points, primary))
    assert np.isfinite(seen).all()
    np.testing.assert_allclose([53.0, 31.0] + size * (seen - [53.0, 31.0]), points, atol=1e-9)
    np.testing.assert_allclose(lens.undistort(lens.distort(points)), points, atol=1e-9)


def test_what_would_fold_back_is_no_light() -> None:
    lens = with_model(Distortion("polynomial", -0.3))
    # r (1 - 0.3 r^2) turns at r = 1 / sqrt(0.9), where it is two thirds of r.
    limit = 1.0 / math.sqrt(0.9)
    inside, outside = lens.distort([[53.0 + 99.9 * limit, 31.0], [53.0 + 100.1 * limit, 31.0]])
    assert inside[0] == pytest.approx(53.0 + 100.0 * 2.0 / 3.0 * limit, abs=1e-3)
    assert np.isnan(outside).all()
    inside, outside = lens.undistort(
        [[53.0 + 66.666 * limit, 31.0], [53.0 + 66.667 * limit, 31.0]],
    )
    assert 0.9 < (inside[0] - 53.0) / 100.0 / limit < 1.0
    assert np.isnan(outside).all()


def test_a_denominator_of_nothing_ends_the_model() -> None:
    nuke = with_model(Distortion("nuke", -1.0))
    assert np.isnan(nuke.undistort([53.0 + 48.1, 31.0])).all()
    division = with_model(Distortion("division", -1.0))
    assert np.isnan(division.distort([53.0 + 100.1, 31.0])).all()
    far = division.undistort([53.0 + 1e6, 31.0])
    assert 99.0 < far[0] - 53.0 < 100.0


def test_nothing_is_mirrored_by_tangential_terms() -> None:
    lens = with_model(Distortion("brown", p1=1.0))
    # x + 3 p1 x^2 turns at x = -1/6.
    assert np.isfinite(lens.distort([53.0 - 16.6, 31.0])).all()
    assert np.isnan(lens.distort([53.0 - 16.7, 31.0])).all()
    # The lowest that it comes to is -1/12.
    assert lens.undistort([53.0 - 8.3, 31.0])[0] > 53.0 - 16.7
    assert np.isnan(lens.undistort([53.0 - 8.4, 31.0])).all()


def test_nothing_bent_is_no_map() -> None:
    film, frame = Film(0.036, 0.024, 96, 64), Window(0, 0, 96, 64)
    nothing = Distortion(), ChromaticAberration(focus_red=1e-4)
    assert lens_map(*nothing, 0.05, film, (48.0, 32.0), frame) is None
    assert lens_map(None, None, 0.05, film, (48.0, 32.0), frame) is None
    lens = lens_map(Distortion(k1=0.1), ChromaticAberration(size_blue=0.01), 0.05, film, (50.0, 30.0), frame)
    assert lens is not None
    assert (lens.focal_x, lens.focal_y) == pytest.approx((0.05 / 0.000375, 0.05 / 0.000375))
    assert (lens.axis_x, lens.axis_y, lens.columns, lens.size_blue) == (50.0, 30.0, 96, 0.01)
    assert lens_map(None, ChromaticAberration(size_red=0.01), 0.05, film, (50.0, 30.0), frame) is not None


# ----- pictures


DATA, TARGET = Window(-25, -17, 125, 90), Window(-3, 4, 90, 61)


def spot(window: Window, x: float, y: float, deviation: float = 2.0) -> np.ndarray:
    """Return a soft white spot at a place."""
    across = (np.arange(window.x0, window.x1) + 0.5 - x) / deviation
    down = (np.arange(window.y0, window.y1) + 0.5 - y) / deviation
    value = np.exp(-0.5 * (down[:, np.newaxis] ** 2 + across**2))
    return np.repeat(value[..., np.newaxis], 4, axis=2).astype(np.float32)


def middle(plane: np.ndarray, window: Window, corner: float = 0.5) -> np.ndarray:
    plane = plane.astype(np.float64)
    x, y = np.arange(window.x0, window.x1) + corner, np.arange(window.y0, window.y1) + corner
    return np.array([(plane * x).sum(), (plane * y[:, np.newaxis]).sum()]) / plane.sum()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("distortion", MODELS, ids=str)
def test_lights_land_where_the_formula_says(distortion: Distortion, backend: str) -> None:
    lens = with_model(distortion)
    for x, y in [(20.0, 20.0), (53.0, 31.0), (70.3, 44.8), (60.0, 18.2)]:
        picture = distorted_picture(spot(DATA, x, y, 1.2), DATA, TARGET, lens, backend)
        # A small spot is stretched evenly.
        np.testing.assert_allclose(middle(picture[..., 1], TARGET), lens.distort([x, y]), atol=0.05)


@pytest.mark.parametrize("backend", BACKENDS)
def test_red_is_larger_and_blue_smaller(backend: str) -> None:
    lens = replace(with_model(Distortion()), size_red=0.04, size_blue=-0.05)
    picture = distorted_picture(spot(DATA, 80.0, 50.0), DATA, TARGET, lens, backend)
    for channel, size in ((0, 1.04), (1, 1.0), (2, 0.95), (3, 1.0)):
        expected = 53.0 + 27.0 * size, 31.0 + 19.0 * size
        np.testing.assert_allclose(middle(picture[..., channel], TARGET), expected, atol=0.02)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("distortion", MODELS, ids=str)
def test_flat_stays_flat(distortion: Distortion, backend: str) -> None:
    lens = replace(with_model(distortion), size_red=0.01)
    flat = np.full((DATA.rows, DATA.columns, 4), 0.37, dtype=np.float32)
    np.testing.assert_array_equal(distorted_picture(flat, DATA, TARGET, lens, backend), np.float32(0.37))


@pytest.mark.parametrize("backend", BACKENDS)
def test_no_light_rings(backend: str) -> None:
    picture = np.full((DATA.rows, DATA.columns, 4), 0.01, dtype=np.float32)
    picture[40:43, 80:82] = 1e5
    result = distorted_picture(picture, DATA, TARGET, SHIFTED, backend)
    assert result.min() == np.float32(0.01)
    assert 1e4 < result.max() <= 1e5


@pytest.mark.parametrize("backend", BACKENDS)
def test_next_to_nothing_gives_the_picture_back(backend: str) -> None:
    picture = np.random.default_rng(3).random((DATA.rows, DATA.columns, 4), dtype=np.float32)
    inside = DATA.intersection(TARGET).within(DATA)
    for distortion in (Distortion(k1=1e-12), Distortion("nuke", 1e-12), Distortion("division", -1e-12)):
        result = distorted_picture(picture, DATA, TARGET, with_model(distortion), backend)
        np.testing.assert_allclose(result, picture[inside], atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_straight_edge_bends_by_the_formula(backend: str) -> None:
    # White right of x = 80, its edge soft over 4 pixels on both sides.
    ramp = np.clip((np.arange(DATA.x0, DATA.x1) + 0.5 - 80.0) / 8.0 + 0.5, 0.0, 1.0)
    picture = np.broadcast_to(ramp[:, np.newaxis], (DATA.rows, DATA.columns, 4)).astype(np.float32)
    result = distorted_picture(picture, DATA, TARGET, SHIFTED, backend)[..., 1]
    for row in (0, 10, 27, 50):
        found = np.interp(0.5, result[row], np.arange(TARGET.x0, TARGET.x1) + 0.5)
        along = SHIFTED.distort(np.stack([np.full(4000, 80.0), np.linspace(-20.0, 90.0, 4000)], axis=-1))
        expected = np.interp(row + TARGET.y0 + 0.5, along[:, 1], along[:, 0])
        assert found == pytest.approx(expected, abs=0.05)
        assert expected < 79.45


def test_both_ways_to_compute_agree() -> None:
    picture = np.random.default_rng(4).random((DATA.rows, DATA.columns, 4), dtype=np.float32)
    wide = Window(-40, -50, 150, 130)
    for distortion in [*MODELS, Distortion("brown", -0.8), Distortion("nuke", -0.5)]:
        lens = replace(with_model(distortion), size_red=0.01, size_blue=-0.02)
        one, other = (distorted_picture(picture, DATA, wide, lens, backend) for backend in BACKENDS)
        np.testing.assert_allclose(one, other, atol=1e-4)


@pytest.mark.parametrize("channels", [1, 3, 5])
def test_any_number_of_channels(channels: int) -> None:
    lens = replace(SHIFTED, size_red=0.02, size_blue=-0.02)
    whole = np.random.default_rng(5).random((DATA.rows, DATA.columns, 5), dtype=np.float32)
    results = [distorted_picture(whole[..., :channels], DATA, TARGET, lens, backend) for backend in BACKENDS]
    np.testing.assert_allclose(*results, atol=1e-4)
    if channels == 1:
        plain = distorted_picture(whole[..., :1], DATA, TARGET, SHIFTED)
        np.testing.assert_array_equal(results[0], plain)


@pytest.mark.parametrize("backend", BACKENDS)
def test_without_data_there_is_nothing(backend: str) -> None:
    data, target = Window(30, 20, 70, 50), Window(0, 0, 96, 64)
    picture = np.ones((data.rows, data.columns, 4), dtype=np.float32)
    result = distorted_picture(picture, data, target, SHIFTED, backend)
    shown = SHIFTED.undistort(grid(target, 1.0) + 0.5)
    expected = ((shown > [30.0, 20.0]) & (shown < [70.0, 50.0])).all(axis=2)
    np.testing.assert_array_equal(result[..., 1], expected.astype(np.float32))


# ----- samples


def surfaces(data: Window) -> SampleLayer:
    """Return samples whose every number says which row and column it comes from."""
    rng = np.random.default_rng(6)
    number = np.arange(data.rows * data.columns, dtype=np.int32).reshape(data.rows, data.columns)
    depth = (1.0 + number % 7).astype(np.float32)
    return SampleLayer(
        "Layer",
        rng.random((data.rows, data.columns, 4), dtype=np.float32),
        depth,
        object_index=number,
        vector=np.ones((data.rows, data.columns, 4), dtype=np.float32),
        cryptomatte=Cryptomatte(
            np.stack([number, number + 1]).astype(np.uint32), rng.random((2, *number.shape), dtype=np.float32)
        ),
        patch=number + 2,
        astigmatism=np.stack([number, -number], axis=-1).astype(np.float32),
    )


@pytest.mark.parametrize("position", ["center", "corner"])
@pytest.mark.parametrize("backend", BACKENDS)
def test_depths_and_numbers_are_the_nearest_samples(backend: str, position: str) -> None:
    layer = surfaces(DATA)
    result = distorted_layer(layer, DATA, TARGET, SHIFTED, position, backend)
    offset = 0.5 if position == "center" else 0.0
    shown = SHIFTED.undistort(grid(TARGET, 1.0) + offset) - offset - [DATA.x0, DATA.y0]
    column, row = np.rint(np.moveaxis(shown, -1, 0)).astype(int)
    for name in ("depth", "object_index", "patch", "astigmatism"):
        wanted = getattr(layer, name)[row, column]
        np.testing.assert_array_equal(getattr(result, name), wanted)
        assert getattr(result, name).dtype == wanted.dtype
    assert result.cryptomatte is not None
    assert layer.cryptomatte is not None
    np.testing.assert_array_equal(result.cryptomatte.ids, layer.cryptomatte.ids[:, row, column])
    np.testing.assert_array_equal(result.cryptomatte.coverage, layer.cryptomatte.coverage[:, row, column])
    assert result.vector is None


@pytest.mark.parametrize("backend", BACKENDS)
def test_samples_at_corners_lie_half_a_pixel_off(backend: str) -> None:
    x = np.arange(DATA.x0, DATA.x1, dtype=np.float32)
    layer = SampleLayer("", np.broadcast_to(x[:, np.newaxis], (DATA.rows, DATA.columns, 4)).copy())
    result = distorted_layer(layer, DATA, TARGET, SHIFTED, "corner", backend)
    np.testing.assert_allclose(result.color[..., 1], SHIFTED.undistort(grid(TARGET, 1.0))[..., 0], atol=1e-4)


def test_all_that_belongs_to_a_layer_goes_along() -> None:
    part = surfaces(DATA)
    layer = replace(
        part, hidden=(part, part), reflected=part, transmitted=part, stationary=part, moving=part, absent=part
    )
    result = distorted_layer(layer, DATA, TARGET, SHIFTED, "center")
    assert (result.stationary, result.moving, result.absent, result.vector) == (None, None, None, None)
    for other in (*result.hidden, result.reflected, result.transmitted):
        assert other is not None
        np.testing.assert_array_equal(other.color, result.color)
        np.testing.assert_array_equal(other.depth, result.depth)
        np.testing.assert_array_equal(other.patch, result.patch)
    bare = distorted_layer(SampleLayer("", part.color), DATA, TARGET, SHIFTED, "center")
    np.testing.assert_array_equal(bare.color, result.color)
    assert bare.depth is None


@pytest.mark.parametrize("backend", BACKENDS)
def test_beyond_the_data_is_no_surface(backend: str) -> None:
    small = Window(40, 20, 60, 40)
    result = distorted_layer(surfaces(small), small, Window(0, 0, 96, 64), SHIFTED, "center", backend)
    assert result.depth is not None
    assert np.isinf(result.depth[0, 0])
    assert not result.color[0, 0].any()
    assert np.isfinite(result.depth[30, 50])
    np.testing.assert_array_equal(np.isinf(result.depth), ~result.color.any(axis=2))


# ----- overscan


@pytest.mark.parametrize("distortion", [*MODELS, Distortion("brown", -0.9), Distortion("nuke", 0.6)], ids=str)
def test_the_window_needed_is_enough_and_not_too_large(distortion: Distortion) -> None:
    target = Window(0, 0, 96, 64)
    lens = replace(with_model(distortion), size_red=0.02, size_blue=-0.01)
    needed = window_needed(lens, target, margin=0)
    fine = grid(Window(0, 0, 97, 65), 0.25)
    fine = fine[(fine <= [96.0, 64.0]).all(axis=2)]
    shown = np.concatenate([lens.undistort(fine, primary) for primary in range(3)])
    low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
    assert (low >= [needed.x0, needed.y0]).all()
    assert (high <= [needed.x1, needed.y1]).all()
    # Next to a fold the finest grid ends a little before what is seen.
    assert (low - [needed.x0, needed.y0] < 6.0).all()
    assert ([needed.x1, needed.y1] - high < 6.0).all()


def test_the_margin_is_added() -> None:
    target = Window(0, 0, 96, 64)
    bare, more = (window_needed(SHIFTED, target, margin) for margin in (0, 2))
    assert (more.x0, more.y0, more.x1, more.y1) == (bare.x0 - 2, bare.y0 - 2, bare.x1 + 2, bare.y1 + 2)
    assert bare.x0 < 0
    assert bare.x1 > 96
