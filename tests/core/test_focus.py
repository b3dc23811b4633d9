"""The focus processor against TOG 1982, eq. 22, worked sample by sample, and against what light must do."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from potmesil_addon import jit
from potmesil_addon.aperture import SAMPLE_POSITIONS, SamplePosition
from potmesil_addon.camera import Film
from potmesil_addon.errors import InputError
from potmesil_addon.focus import WEIGHTINGS, FocusSettings, Weighting, average_down, focus_layer, over
from potmesil_addon.lens import Lens, circle_of_confusion
from potmesil_addon.progress import run
from potmesil_addon.psf import TABLE_LOOKUPS, TABLE_SPACINGS, PsfSettings
from potmesil_addon.samples import SampleLayer, Samples, Window
from potmesil_addon.scatter import BAND_ROWS, Backend

from .helpers import (
    Array,
    ellipse_coverage,
    eq_22,
    focused,
    make_samples,
    polygon_coverage,
    polygon_vertices_by_hand,
    square_film,
)

BACKENDS: list[Any] = [
    pytest.param("numba", marks=pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")),
    "numpy",
]

backends = pytest.mark.parametrize("backend", BACKENDS)
positions = pytest.mark.parametrize("position", SAMPLE_POSITIONS)
weightings = pytest.mark.parametrize("weighting", WEIGHTINGS)

PITCH = 1.5e-4
WIDE = Lens(0.05, 1.4, 2.0)
"""Circles of 11 pixels at 0.7 m and 6 at infinity."""

PENTAGON = replace(WIDE, blades=5, blade_rotation=0.3, anamorphic_ratio=1.5)
SLOW = Lens(0.05, 16.0, 2.0)
FINE_PITCH = 5e-6
"""Pixels that are fine enough to see diffraction at f/16."""

KINDS = ("disc", "polygon", "lommel")


def random_samples(position: SamplePosition, kind: str = "disc", seed: int = 3) -> Samples:
    """Return samples whose data window lies across the display window, some without a surface."""
    rng = np.random.default_rng(seed)
    extra = 1 if position == "corner" else 0
    rows, columns = 12 + extra, 17 + extra
    nearest, farthest = (1.7, 2.4) if kind == "lommel" else (0.7, 8.0)
    depth = rng.uniform(nearest, farthest, (rows, columns))
    depth[rng.random((rows, columns)) < 0.1] = np.inf
    color = rng.random((rows, columns, 4))
    return make_samples(
        color,
        depth,
        data=Window(-2, 1, columns - 2, rows + 1),
        display=Window(0, 0, 14, 13),
        position=position,
    )


def settings_for(samples: Samples, kind: str, **others: Any) -> FocusSettings:
    lens = {"disc": WIDE, "polygon": PENTAGON, "lommel": SLOW}[kind]
    pitch = FINE_PITCH if kind == "lommel" else PITCH
    return FocusSettings(lens, square_film(samples, pitch), **others)


def weights_of(samples: Samples, weighting: Weighting) -> Array:
    """Return 1, or 1/z^2 (1981, eq. 20) relative to the nearest, no surface counting as the farthest."""
    depth = np.asarray(samples.layers[0].depth, dtype=np.float64)
    if weighting == "1982":
        return np.ones_like(depth)
    finite = depth[np.isfinite(depth)]
    return np.asarray(np.maximum((finite.min() / np.minimum(depth, finite.max())) ** 2, 1e-6))


# Equation 22


@weightings
@pytest.mark.parametrize("lookup", TABLE_LOOKUPS)
@pytest.mark.parametrize("spacing", TABLE_SPACINGS)
@positions
@pytest.mark.parametrize("kind", KINDS)
def test_picture_equals_eq_22(
    kind: str, position: SamplePosition, spacing: Any, lookup: Any, weighting: Weighting
) -> None:
    samples = random_samples(position, kind)
    psf = PsfSettings(
        kind="lommel" if kind == "lommel" else "disc",
        tables=spacing,
        lookup=lookup,
        step=0.3 if spacing == "equal-z" else None,
    )
    settings = settings_for(samples, kind, psf=psf, weighting=weighting)
    expected = eq_22(samples, settings, weights_of(samples, weighting))
    assert expected[1:].max() > 0.5
    pictures = {}
    for backend in ("numba", "numpy"):
        if backend == "numba" and not jit.HAVE_NUMBA:
            continue
        pictures[backend] = focused(samples, replace(settings, backend=backend))
        assert np.abs(pictures[backend] - expected).max() < 1e-5, backend
    if len(pictures) == 2:
        assert np.abs(pictures["numba"] - pictures["numpy"]).max() < 1e-6


@positions
@pytest.mark.parametrize("kind", ["disc", "polygon"])
@pytest.mark.parametrize("model", ["cycles", "paper"])
def test_picture_equals_eq_22_from_the_depths_alone(kind: str, position: SamplePosition, model: Any) -> None:
    """Nothing of ours but the picture: circles by formula, coverage by scan lines and by clipping."""
    samples = random_samples(position, kind, seed=8)
    settings = settings_for(samples, kind, model=model)
    depth = np.asarray(samples.layers[0].depth, dtype=np.float64)
    lens, window, display = settings.lens, samples.data_window, samples.display_window
    plane = lens.focus_distance - (lens.focal_length if model == "paper" else 0.0)
    scale = lens.focal_length**2 / lens.f_stop * lens.focus_distance / plane
    circles = scale * (1.0 / lens.focus_distance - 1.0 / depth)
    # Tables stand an eighth of a pixel apart.
    eighths = np.rint(circles / PITCH * 8.0)
    half, reach = (0.5 if position == "center" else 0.0), 12
    coverage = {}
    for number in np.unique(eighths):
        radius = 0.5 * number / 8.0
        if kind == "disc":
            size = max(abs(radius), 0.05)
            coverage[number] = ellipse_coverage(size, size, reach, half)
        else:
            # The sign turns the polygon round; a small one stands for a point.
            size = radius or 1e-3
            corners = polygon_vertices_by_hand(lens.blades, lens.blade_rotation, lens.anamorphic_ratio)
            coverage[number] = polygon_coverage(corners * [size, -size], reach, half)
    padded = (display.rows + 4 * reach, display.columns + 4 * reach)
    numerator, denominator = np.zeros((*padded, 4)), np.zeros(padded)
    for row, column in np.ndindex(*depth.shape):
        y, x = row + window.y0 + reach, column + window.x0 + reach
        place = (slice(y, y + 2 * reach + 1), slice(x, x + 2 * reach + 1))
        h = coverage[eighths[row, column]]
        numerator[place] += h[..., np.newaxis] * samples.layers[0].color[row, column]
        denominator[place] += h
    inner = (slice(2 * reach, 2 * reach + 13), slice(2 * reach, 2 * reach + 14))
    expected = numerator[inner] / np.maximum(denominator[inner], 1e-12)[..., np.newaxis]
    picture = focused(samples, settings)
    # The first row of the display window has no data.
    assert np.abs(picture - expected)[1:12].max() < 1e-5
    assert not picture[0].any()


def test_two_samples_by_hand() -> None:
    """One pixel beside another, at 1 m and 2 m, both 1.6 pixels wide: weights 1 and 1/4 by 1981, eq. 20."""
    # With F^2/n = 1.6 * 4 pitches the circles are 6.4 (1/D - 1/P) = -1.6 and 1.6 for D = 4/3.
    lens = Lens(0.05, 0.05**2 / (6.4 * PITCH), 4.0 / 3.0)
    samples = make_samples([[[1.0, 0.0, 0.5, 1.0], [0.0, 1.0, 0.5, 1.0]]], [[1.0, 2.0]])
    circles = circle_of_confusion([1.0, 2.0], lens) / PITCH
    np.testing.assert_allclose(circles, [-1.6, 1.6], rtol=1e-12)
    # 1.6 lies between the tables of 1.5 and 1.625.
    share = ellipse_coverage(0.8125, 0.8125, 1, 0.5)
    own, other = share[1, 1], share[1, 0]
    for weighting, w in (("1982", 1.0), ("1981", 0.25)):
        settings = FocusSettings(lens, square_film(samples, PITCH), weighting=weighting)  # type: ignore[arg-type]
        left, right = focused(samples, settings)[0]
        assert left[0] == pytest.approx(own / (own + w * other), abs=1e-6)
        assert right[0] == pytest.approx(other / (other + w * own), abs=1e-6)
        assert left[0] + left[1] == pytest.approx(1.0, abs=1e-6)
        assert left[2] == right[2] == pytest.approx(0.5, abs=1e-6)


# The same picture however it is made


@pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")
@pytest.mark.parametrize("kind", KINDS)
def test_picture_does_not_depend_on_the_number_of_threads(kind: str, all_threads: int) -> None:
    if all_threads < 2:
        pytest.skip("this machine has one core")
    rng = np.random.default_rng(6)
    rows = 5 * BAND_ROWS + 7
    nearest, farthest = (1.5, 3.0) if kind == "lommel" else (0.5, 20.0)
    samples = make_samples(rng.random((rows, 40, 4)), rng.uniform(nearest, farthest, (rows, 40)))
    psf = PsfSettings(kind="lommel" if kind == "lommel" else "disc", lookup="interpolated")
    settings = settings_for(samples, kind, psf=psf, backend="numba")
    pictures = []
    for threads in (1, 2):
        assert jit.set_thread_count(threads) == threads
        pictures.append(focused(samples, settings))
    assert pictures[0].tobytes() == pictures[1].tobytes()


@pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")
def test_backends_agree_on_large_circles_and_tall_pictures() -> None:
    rng = np.random.default_rng(9)
    rows = 2 * BAND_ROWS + 5
    depth = rng.uniform(0.2, 30.0, (rows, 50))
    samples = make_samples(rng.random((rows, 50, 4)) * 100.0, depth)
    settings = settings_for(samples, "disc")
    pictures = [focused(samples, replace(settings, backend=backend)) for backend in ("numba", "numpy")]
    assert np.abs(pictures[0] - pictures[1]).max() < 1e-6 * 100.0


def test_progress_rises_to_1() -> None:
    samples = random_samples("center")
    for backend in ("numpy", "auto"):
        steps = focus_layer(samples.layers[0], samples, settings_for(samples, "disc", backend=backend))
        shares = list(steps)
        assert shares == sorted(shares)
        assert shares[0] > 0.0
        assert shares[-1] == pytest.approx(1.0)


# What light must do


@backends
@positions
@pytest.mark.parametrize("kind", KINDS)
@weightings
def test_constant_picture_stays_constant_up_to_the_border(
    kind: str, position: SamplePosition, backend: Backend, weighting: Weighting
) -> None:
    """One color, whatever the depths: eq. 22 divides by the weights that reached the pixel."""
    random = random_samples(position, kind)
    color = np.array([0.25, 0.7, 12.5, 1.0], dtype=np.float32)
    assert random.layers[0].depth is not None
    rows, columns = random.layers[0].depth.shape
    extra = 1 if position == "corner" else 0
    samples = make_samples(
        np.broadcast_to(color, (rows, columns, 4)),
        random.layers[0].depth,
        display=Window(0, 0, columns - extra, rows - extra),
        position=position,
    )
    psf = PsfSettings(kind="lommel" if kind == "lommel" else "disc", lookup="interpolated")
    picture = focused(samples, settings_for(samples, kind, psf=psf, weighting=weighting, backend=backend))
    assert picture.shape == (rows - extra, columns - extra, 4)
    np.testing.assert_allclose(picture, np.broadcast_to(color, picture.shape), rtol=1e-6)


def depth_of_circle(circle_px: float, lens: Lens = WIDE, pitch: float = PITCH) -> float:
    """Return the depth whose signed circle has a diameter of some pixels, for the Cycles model."""
    inverse = 1.0 / lens.focus_distance - circle_px * pitch / (lens.focal_length**2 / lens.f_stop)
    assert inverse > 0.0
    return 1.0 / inverse


def one_light(
    circle_px: float, lens: Lens = WIDE, *, at: tuple[int, int] = (20, 25), shape: tuple[int, int] = (41, 51)
) -> Any:
    """Return the picture of one lit pixel in the dark, all at the depth of one circle."""
    color = np.zeros((*shape, 4))
    color[..., 3] = 1.0
    color[at] = [1.0, 2.0, 3.0, 1.0]
    samples = make_samples(color, depth_of_circle(circle_px, lens))
    return focused(samples, FocusSettings(lens, square_film(samples, PITCH)))


@pytest.mark.parametrize("circle_px", [-9.0, -2.5, 0.0, 1.25, 4.0])
def test_one_light_becomes_its_disc(circle_px: float) -> None:
    picture = one_light(circle_px)
    # A disc within the pixel stands for a point.
    radius = max(0.5 * abs(circle_px), 0.05)
    expected = np.zeros((41, 51))
    expected[10:31, 15:36] = ellipse_coverage(radius, radius, 10, 0.5)
    for channel, value in enumerate((1.0, 2.0, 3.0)):
        np.testing.assert_allclose(picture[..., channel], value * expected, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("lens", [WIDE, replace(WIDE, blades=6, blade_rotation=0.2)], ids=["disc", "hexagon"])
@pytest.mark.parametrize("circle_px", [-8.0, 0.0, 4.5])
def test_one_light_keeps_its_energy_and_its_place(circle_px: float, lens: Lens) -> None:
    light = one_light(circle_px, lens)[..., 1].astype(np.float64)
    assert light.sum() == pytest.approx(2.0, abs=1e-5)
    rows, columns = np.mgrid[0:41, 0:51]
    assert (light * rows).sum() / light.sum() == pytest.approx(20.0, abs=1e-5)
    assert (light * columns).sum() / light.sum() == pytest.approx(25.0, abs=1e-5)


@pytest.mark.parametrize("at", [(3, 7), (30, 7), (3, 44)])
def test_light_stays_at_its_row_and_column(at: tuple[int, int]) -> None:
    picture = one_light(0.0, at=at)
    assert np.argwhere(picture[..., 0] > 1e-9).tolist() == [list(at)]


def test_data_window_places_the_samples() -> None:
    # The sample of row 0, column 0 lies at x = 3, y = 2 of a display window that begins at (1, -1).
    color = np.zeros((2, 2, 4))
    color[0, 0] = 1.0
    samples = make_samples(color, 2.0, data=Window(3, 2, 5, 4), display=Window(1, -1, 9, 7))
    picture = focused(samples, FocusSettings(WIDE, square_film(samples, PITCH)))
    assert picture.shape == (8, 8, 4)
    assert np.argwhere(picture[..., 0] > 0.0).tolist() == [[3, 2]]


def test_corner_sample_lights_the_four_pixels_around_it() -> None:
    color = np.zeros((6, 8, 4))
    color[2, 5] = 1.0
    samples = make_samples(color, 2.0, display=Window(0, 0, 7, 5), position="corner")
    picture = focused(samples, FocusSettings(WIDE, square_film(samples, PITCH)))
    lit = np.argwhere(picture[..., 0] > 1e-9).tolist()
    assert lit == [[1, 4], [1, 5], [2, 4], [2, 5]]
    np.testing.assert_allclose(picture[1:3, 4:6, 0], 0.25, rtol=1e-6)


def extent(picture: Any, at: tuple[int, int] = (20, 25)) -> dict[str, int]:
    """Return how many pixels the light reaches up, down, left and right of its place."""
    rows, columns = np.nonzero(picture[..., 0] > 1e-6)
    return {
        "up": at[0] - rows.min(),
        "down": rows.max() - at[0],
        "left": at[1] - columns.min(),
        "right": columns.max() - at[1],
    }


def traced_offsets(lens: Lens, depth: float, points: Array) -> Array:
    """Return where rays through points of the aperture (x right, y up) meet the picture (pixels, y up).

    Cycles aims each ray at the plane in focus; seen from there, a point on the axis has moved.
    """
    diameter = lens.focal_length / lens.f_stop
    on_plane = 0.5 * diameter * points * (1.0 - lens.focus_distance / depth)
    return np.asarray(on_plane / lens.focus_distance * lens.focal_length / PITCH)


@pytest.mark.parametrize(("circle_px", "side", "other"), [(5.0, "up", "down"), (-8.0, "down", "up")])
def test_triangle_points_up_behind_the_focus_and_down_before_it(
    circle_px: float, side: str, other: str
) -> None:
    # Three blades turned by -90 degrees: a corner up, as the camera looks.
    lens = replace(WIDE, blades=3, blade_rotation=-math.pi / 2.0)
    reach = extent(one_light(circle_px, lens))
    assert reach[side] > reach[other]
    assert reach["left"] == reach["right"]


@pytest.mark.parametrize(("circle_px", "side", "other"), [(5.0, "left", "right"), (-8.0, "right", "left")])
def test_triangle_points_left_behind_the_focus_and_right_before_it(
    circle_px: float, side: str, other: str
) -> None:
    lens = replace(WIDE, blades=3, blade_rotation=0.0)
    reach = extent(one_light(circle_px, lens))
    assert reach[side] > reach[other]
    assert reach["up"] == reach["down"]


@pytest.mark.parametrize("circle_px", [-9.0, 5.0])
@pytest.mark.parametrize("rotation", [0.3, -1.0, 2.5])
def test_polygon_lies_where_rays_through_the_iris_fall(circle_px: float, rotation: float) -> None:
    lens = replace(WIDE, blades=3, blade_rotation=rotation)
    rim = polygon_vertices_by_hand(3, rotation, 1.0)
    fallen = traced_offsets(lens, depth_of_circle(circle_px), rim) * [1.0, -1.0]
    expected = np.zeros((41, 51))
    expected[10:31, 15:36] = polygon_coverage(fallen, 10, 0.5)
    np.testing.assert_allclose(one_light(circle_px, lens)[..., 0], expected, rtol=0.0, atol=1e-5)


def test_anamorphic_lens_narrows_the_light() -> None:
    reach = extent(one_light(-8.0, replace(WIDE, anamorphic_ratio=2.0)))
    assert (reach["left"], reach["right"], reach["up"], reach["down"]) == (2, 2, 4, 4)


def test_farther_behind_the_focus_is_wider() -> None:
    spreads = [extent(one_light(circle))["left"] for circle in (0.0, 2.0, 4.0)]
    assert spreads == sorted(set(spreads))


@backends
@pytest.mark.parametrize("kind", KINDS)
def test_premultiplied_color_unpremultiplies_to_itself(kind: str, backend: Backend) -> None:
    """One straight color under any alpha: blurred together, color over alpha is that color."""
    rng = np.random.default_rng(7)
    alpha = rng.random((14, 19, 1))
    alpha[rng.random((14, 19)) < 0.3] = 0.0
    straight = np.array([0.2, 0.9, 4.0])
    random = rng.uniform(*((1.5, 3.0) if kind == "lommel" else (0.7, 8.0)), (14, 19))
    samples = make_samples(np.concatenate([straight * alpha, alpha], axis=2), random)
    psf = PsfSettings(kind="lommel" if kind == "lommel" else "disc")
    picture = focused(samples, settings_for(samples, kind, psf=psf, backend=backend))
    shown = picture[..., 3] > 1e-3
    # Alpha goes with green; red and blue have patterns of their own under diffraction.
    for channel in (1,) if kind == "lommel" else (0, 1, 2):
        np.testing.assert_allclose(
            picture[..., channel][shown] / picture[..., 3][shown], straight[channel], rtol=1e-5
        )
    assert picture[..., 3].min() >= -1e-7
    assert picture[..., 3].max() <= 1.0 + 1e-6


def test_overscan_blurs_into_the_frame() -> None:
    # A light 2 pixels left of the frame with a radius of 4.
    color = np.zeros((20, 20, 4))
    color[..., 3] = 1.0
    color[10, 3] = 1.0
    samples = make_samples(
        color, depth_of_circle(-8.0), data=Window(-5, -5, 15, 15), display=Window(0, 0, 10, 10)
    )
    picture = focused(samples, FocusSettings(WIDE, square_film(samples, PITCH)))
    disc = ellipse_coverage(4.0, 4.0, 6, 0.5)
    # The frame's pixel (5, 0) is 2 to the right of the light.
    np.testing.assert_allclose(picture[1:10, 0:5, 0], disc[2:11, 8:13], rtol=0.0, atol=1e-5)
    assert picture[5, 0, 0] > 0.01


@positions
def test_outside_the_data_window_there_is_nothing(position: SamplePosition) -> None:
    extra = 1 if position == "corner" else 0
    samples = make_samples(
        np.ones((6 + extra, 7 + extra, 4)),
        depth_of_circle(-8.0),
        data=Window(4, 3, 11 + extra, 9 + extra),
        display=Window(0, 0, 16, 14),
        position=position,
    )
    for backend in ("auto", "numpy"):
        picture = focused(samples, FocusSettings(WIDE, square_film(samples, PITCH), backend=backend))
        np.testing.assert_allclose(picture[3:9, 4:11], 1.0, rtol=1e-6)
        picture[3:9, 4:11] = 0.0
        assert not picture.any()


def test_windows_that_do_not_meet_give_an_empty_picture() -> None:
    samples = make_samples(np.ones((3, 3, 4)), 2.0, data=Window(20, 20, 23, 23), display=Window(0, 0, 8, 6))
    for backend in ("auto", "numpy"):
        picture = focused(samples, FocusSettings(WIDE, square_film(samples, PITCH), backend=backend))
        assert picture.shape == (6, 8, 4)
        assert not picture.any()


# A highlight. The background is sharp, so a pixel outside the highlight's disc is the background alone.

SHARP_FAR = replace(WIDE, focus_distance=math.inf)
"""Focused at infinity, where the background is."""


@backends
@pytest.mark.parametrize("blades", [0, 5, 6, 7])
@pytest.mark.parametrize("circle_px", [0.0, -3.3, -20.0])
def test_highlight_leaves_no_streak(circle_px: float, blades: int, backend: Backend) -> None:
    """Rows are sums of differences: 1e6 added and taken away again has to leave nothing."""
    lens = replace(SHARP_FAR, blades=blades, blade_rotation=0.1)
    color = np.full((41, 90, 4), 0.25)
    color[20, 30, :3] = 1e6
    depth = np.full((41, 90), np.inf)
    if circle_px:
        depth[20, 30] = depth_of_circle(circle_px, lens)
    samples = make_samples(color, depth)
    picture = focused(samples, FocusSettings(lens, square_film(samples, PITCH), backend=backend))
    radius = math.ceil(0.5 * abs(circle_px)) + 1
    assert picture[20, 30, 0] > 1e3
    outside = np.ones((41, 90), dtype=bool)
    outside[20 - radius : 21 + radius, 30 - radius : 31 + radius] = False
    assert np.abs(picture[outside] - 0.25).max() < 1e-6


@backends
@pytest.mark.parametrize("circle_px", [-1.0, -3.3, -20.0])
@pytest.mark.parametrize(("blades", "degrees"), [(4, 90), (4, 180), (6, 30), (6, 90), (8, 90)])
def test_highlight_leaves_no_streak_of_blenders_angles(
    circle_px: float, blades: int, degrees: int, backend: Backend
) -> None:
    """Blender keeps angles in single precision, so an upright blade is a hair off upright."""
    angle = float(np.float32(math.radians(degrees)))
    lens = replace(SHARP_FAR, blades=blades, blade_rotation=angle)
    color = np.full((31, 90, 4), 0.25)
    color[15, 30, :3] = 1e6
    depth = np.full((31, 90), np.inf)
    depth[15, 30] = depth_of_circle(circle_px, lens)
    samples = make_samples(color, depth)
    picture = focused(samples, FocusSettings(lens, square_film(samples, PITCH), backend=backend))
    assert np.abs(picture[:, 45:] - 0.25).max() < 1e-6
    assert np.abs(picture[:, :15] - 0.25).max() < 1e-6


@backends
def test_highlight_leaves_no_streak_of_diffraction(backend: Backend) -> None:
    color = np.full((31, 200, 4), 0.25)
    color[15, 60, :3] = 1e6
    depth = np.full((31, 200), np.inf)
    lens = Lens(0.05, 4.0, math.inf)
    # 20 pixels wide; the pattern is kept 10 pi in v past its edge, 5 pixels, and the Airy disc likewise.
    depth[15, 60] = 0.05**2 / 4.0 / (20.0 * FINE_PITCH)
    samples = make_samples(color, depth)
    psf = PsfSettings(kind="lommel")
    settings = FocusSettings(lens, square_film(samples, FINE_PITCH), psf=psf, backend=backend)
    picture = focused(samples, settings)
    assert picture[15, 60, 0] > 1.0
    assert np.abs(picture[:, 90:] - 0.25).max() < 1e-6
    assert np.abs(picture[:, :30] - 0.25).max() < 1e-6


@backends
@pytest.mark.parametrize("pitch", [1e-4, PITCH, 2e-4, 3e-4])
@pytest.mark.parametrize("far", [10.0, 100.0])
def test_near_highlight_leaves_no_streak_on_a_far_background(
    far: float, pitch: float, backend: Backend
) -> None:
    """By 1981, eq. 20, a background a hundred times as far has a ten thousandth of the weight."""
    lens = replace(WIDE, focus_distance=far)
    color = np.full((41, 90, 4), 0.25)
    color[20, 30, :3] = 1e6
    depth = np.full((41, 90), far)
    depth[20, 30] = 1.0
    samples = make_samples(color, depth)
    settings = FocusSettings(lens, square_film(samples, pitch), weighting="1981", backend=backend)
    radius = math.ceil(0.5 * abs(float(circle_of_confusion(1.0, lens))) / pitch) + 1
    assert radius < 20
    picture = focused(samples, settings)
    assert np.abs(picture[:, 31 + radius :] - 0.25).max() < 1e-6
    assert np.abs(picture[:, : 30 - radius] - 0.25).max() < 1e-6


# The rest


def test_far_background_keeps_some_weight() -> None:
    """By 1/z^2 a sky at 1e6 m would have none, and its pixels would be black."""
    color = np.full((9, 9, 4), 0.5)
    depth = np.full((9, 9), 1e6)
    depth[4, 4] = 1.0
    for lens in (WIDE, replace(WIDE, focus_distance=1e6)):
        samples = make_samples(color, depth)
        settings = FocusSettings(lens, square_film(samples, PITCH), weighting="1981")
        np.testing.assert_allclose(focused(samples, settings), 0.5, rtol=1e-6)


def test_all_at_infinity_is_weighed_alike() -> None:
    samples = make_samples(np.full((5, 6, 4), 0.5), np.inf)
    for weighting in WEIGHTINGS:
        settings = FocusSettings(WIDE, square_film(samples, PITCH), weighting=weighting)
        np.testing.assert_allclose(focused(samples, settings), 0.5, rtol=1e-6)


def test_layer_without_depth_is_named() -> None:
    layer = SampleLayer("Fog", np.zeros((3, 3, 4), dtype=np.float32))
    samples = Samples((layer,), Window(0, 0, 3, 3), Window(0, 0, 3, 3))
    with pytest.raises(InputError, match="'Fog' has no depth"):
        run(focus_layer(layer, samples, FocusSettings(WIDE, Film(1.0, 1.0, 3, 3))))


def test_report_says_what_was_done() -> None:
    depth = np.array([[1.0, 4.0, np.inf]])
    samples = make_samples(np.ones((1, 3, 4)), depth)
    settings = FocusSettings(WIDE, square_film(samples, PITCH))
    report = run(focus_layer(samples.layers[0], samples, settings)).report
    assert (report.nearest_m, report.farthest_m) == (1.0, 4.0)
    # 2.5 mm / 1.4 (1/2 - 1) and (1/2 - 0), in pixels of 0.15 mm.
    assert report.nearest_circle_px == pytest.approx(-2.5 / 1.4 * 0.5 / 0.15, rel=1e-9)
    assert report.farthest_circle_px == pytest.approx(2.5 / 1.4 * 0.5 / 0.15, rel=1e-9)
    assert report.tables == 3
    assert report.table_bytes > 0
    # Of a picture with four samples a pixel, in its final pixels.
    finer = run(focus_layer(samples.layers[0], replace(samples, supersampling=2), settings)).report
    assert finer.farthest_circle_px == pytest.approx(report.farthest_circle_px / 2.0, rel=1e-12)


def test_scatter_wants_the_numba_that_it_is_told_to_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "HAVE_NUMBA", False)
    samples = random_samples("center")
    with pytest.raises(RuntimeError, match="numba"):
        focused(samples, settings_for(samples, "disc", backend="numba"))
    # Left to itself it takes the other path.
    assert focused(samples, settings_for(samples, "disc", backend="auto")).any()


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_average_down_takes_the_mean_of_squares(factor: int) -> None:
    small = np.random.default_rng(2).random((4, 5, 4)).astype(np.float32)
    large = np.repeat(np.repeat(small, factor, axis=0), factor, axis=1)
    large[::factor, ::factor] += np.float32(0.5 * (factor > 1))
    expected = small + 0.5 / factor**2 * (factor > 1)
    np.testing.assert_allclose(average_down(large, factor), expected, rtol=1e-6)


def test_over_is_porter_and_duffs() -> None:
    front = np.array([[[0.2, 0.0, 0.1, 0.5]]], dtype=np.float32)
    back = np.array([[[0.4, 0.6, 0.0, 0.8]]], dtype=np.float32)
    np.testing.assert_allclose(over(front, back), [[[0.4, 0.3, 0.1, 0.9]]], atol=1e-7)
