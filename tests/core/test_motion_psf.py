"""Motion point-spread functions against closed forms, transforms and sums of very many instants."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, signal

from potmesil_addon import motion_psf as module
from potmesil_addon.errors import SettingsError
from potmesil_addon.motion_psf import (
    INTERPOLATIONS,
    ConvolutionMethod,
    ExposedPath,
    Interpolation,
    MotionPsf,
    convolve,
    convolve_full,
    focal_plane_response,
    focal_plane_transfer,
    motion_psf,
    motion_transfer,
    path_of,
    uniform_response,
    uniform_transfer,
)
from potmesil_addon.shutter import Shutter, even_openings

Array = npt.NDArray[np.float64]

both = pytest.mark.parametrize("interpolation", INTERPOLATIONS)


def line(*places: tuple[float, float]) -> ExposedPath:
    """Return a polyline passed in equal times a piece."""
    count = len(places) - 1
    return ExposedPath.polyline(places, np.full(count, 1.0 / count))


def entry(psf: MotionPsf, column: int, row: int) -> float:
    """Return the table's value at an offset, 0 outside."""
    j, i = row - psf.first_row, column - psf.first_column
    inside = 0 <= j < psf.table.shape[0] and 0 <= i < psf.table.shape[1]
    return float(psf.table[j, i]) if inside else 0.0


def on_canvas(psf: MotionPsf, reach: int) -> Array:
    """Return the table on a square canvas with offset 0 at index `reach`."""
    canvas = np.zeros((2 * reach + 1, 2 * reach + 1))
    top, left = psf.first_row + reach, psf.first_column + reach
    canvas[top : top + psf.table.shape[0], left : left + psf.table.shape[1]] = psf.table
    return canvas


def instants(path: ExposedPath, interpolation: Interpolation, reach: int, count: int = 100_000) -> Array:
    """Return the table from points at equal times along each piece, each put on its pixels."""
    canvas = np.zeros((2 * reach + 1, 2 * reach + 1))
    share = (np.arange(count) + 0.5) / count
    for (begin, end), light in zip(path.segments, path.light / path.light.sum(), strict=True):
        x, y = (begin + share[:, np.newaxis] * (end - begin)).T
        if interpolation == "box":
            np.add.at(canvas, (np.rint(y).astype(int) + reach, np.rint(x).astype(int) + reach), light / count)
            continue
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        for di in (0, 1):
            for dj in (0, 1):
                weight = (1.0 - np.abs(x - i - di)) * (1.0 - np.abs(y - j - dj))
                np.add.at(canvas, (j + dj + reach, i + di + reach), weight * light / count)
    return canvas


def centroid(psf: MotionPsf) -> Array:
    columns = np.arange(psf.table.shape[1]) + psf.first_column
    rows = np.arange(psf.table.shape[0]) + psf.first_row
    return np.array([psf.table.sum(axis=0) @ columns, psf.table.sum(axis=1) @ rows])


# --- tables -----------------------------------------------------------------------------------------------


@both
def test_no_motion_is_an_impulse(interpolation: Interpolation) -> None:
    psf = motion_psf(line((0, 0), (0, 0)), interpolation)
    assert psf.table.tolist() == [[1.0]]
    assert (psf.first_row, psf.first_column) == (0, 0)


@pytest.mark.parametrize("a", [7.3, -4.0, 0.2, 0.9, 33.0])
@pytest.mark.parametrize("upright", [False, True])
def test_even_motion_is_eq_3_15_over_pixels(a: float, upright: bool) -> None:
    end = (0.0, a) if upright else (a, 0.0)
    psf = motion_psf(line((0, 0), end))
    along = psf.table[:, 0] if upright else psf.table[0]
    assert psf.table.size == along.size
    first = psf.first_row if upright else psf.first_column
    low, high = min(0.0, a), max(0.0, a)
    assert first == math.floor(low + 0.5)
    for n, value in enumerate(along, start=first):
        inside = max(0.0, min(high, n + 0.5) - max(low, n - 0.5))
        assert value == pytest.approx(inside * float(uniform_response(0.5 * a, a)), abs=1e-14)


def test_sub_pixel_motion_across_a_border() -> None:
    psf = motion_psf(line((0.4, 0), (0.6, 0)))
    assert psf.table[0] == pytest.approx([0.5, 0.5], abs=1e-14)
    assert motion_psf(line((0.1, 0.2), (0.3, -0.1))).table.tolist() == [[1.0]]


def test_acceleration_from_rest_is_one_over_the_square_root() -> None:
    """Where x = a t^2 / 2 the time until x is sqrt(2 x / a), whose slope is 1 / speed (eq. 3-9)."""
    acceleration, pieces = 23.0, 4000
    t = np.linspace(0.0, 1.0, pieces + 1)
    places = np.stack([0.5 * acceleration * t**2, np.zeros_like(t)], axis=1)
    psf = motion_psf(ExposedPath.polyline(places, np.full(pieces, 1.0 / pieces)))
    edges = np.clip(np.arange(psf.table.shape[1] + 1) - 0.5, 0.0, 0.5 * acceleration)
    time = np.sqrt(2.0 * edges / acceleration)
    assert psf.table[0] == pytest.approx(np.diff(time), abs=1e-7)
    density = [
        integrate.quad(lambda x: 1.0 / math.sqrt(2.0 * acceleration * x), low, high)[0]
        for low, high in pairwise(edges)
    ]
    assert psf.table[0] == pytest.approx(density, abs=1e-7)


@both
def test_a_circle_has_the_light_of_its_arcs(interpolation: Interpolation) -> None:
    radius, pieces = 6.3, 20_000
    angle = np.linspace(0.0, 2.0 * math.pi, pieces + 1)
    places = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    path = ExposedPath.polyline(places, np.full(pieces, 1.0 / pieces))
    canvas = on_canvas(motion_psf(path, interpolation), 9)
    # Not mirrored to the last digit, because the vertices are not.
    for mirrored in (canvas[::-1], canvas[:, ::-1], canvas.T):
        assert canvas == pytest.approx(mirrored, abs=1e-12)
    if interpolation == "box":
        # The rightmost pixel of the middle row holds the arc between y = -1/2 and y = 1/2.
        assert canvas[9, 9 + 6] == pytest.approx(2.0 * math.asin(0.5 / radius) / (2.0 * math.pi), abs=1e-7)
    expected = instants(path, interpolation, 9, count=40)
    assert canvas == pytest.approx(expected, abs=1e-5)


@both
def test_a_path_that_turns_back_is_the_path_itself(interpolation: Interpolation) -> None:
    there = motion_psf(line((0.2, -0.3), (9.1, 4.4)), interpolation)
    back = motion_psf(line((0.2, -0.3), (9.1, 4.4), (0.2, -0.3)), interpolation)
    assert back.table == pytest.approx(there.table, abs=1e-15)
    assert (back.first_row, back.first_column) == (there.first_row, there.first_column)


@both
def test_a_path_may_be_cut_anywhere(interpolation: Interpolation) -> None:
    whole = motion_psf(line((-3.3, 2.2), (8.9, -5.7)), interpolation)
    share = np.sort(np.random.default_rng(1).random(50))
    cuts = np.concatenate([[0.0], share, [1.0]])
    places = np.array([-3.3, 2.2]) + cuts[:, np.newaxis] * np.array([12.2, -7.9])
    parts = motion_psf(ExposedPath.polyline(places, np.diff(cuts)), interpolation)
    assert on_canvas(parts, 12) == pytest.approx(on_canvas(whole, 12), abs=1e-13)


PATHS = [
    ((0.0, 0.0), (11.3, 7.9)),
    ((0.31, -0.77), (-8.4, 3.2), (-8.4, 9.9), (2.2, 9.9)),
    ((-3.1, 2.0), (4.2, -6.6), (0.11, 0.13), (0.14, 0.12)),
    ((5.4, 5.25), (5.4, -2.75)),
    ((0.0, 0.0), (9.0, 9.0)),
]


@both
@pytest.mark.parametrize("places", PATHS)
def test_tables_are_the_sum_of_many_instants(
    places: tuple[tuple[float, float], ...], interpolation: Interpolation
) -> None:
    path = line(*places)
    canvas = on_canvas(motion_psf(path, interpolation), 15)
    tolerance = 3e-5 if interpolation == "box" else 1e-8
    assert canvas == pytest.approx(instants(path, interpolation, 15), abs=tolerance)


def test_what_runs_or_rests_on_a_border_is_shared() -> None:
    along = motion_psf(line((0.0, 0.5), (6.0, 0.5)))
    assert along.table == pytest.approx(np.array([[1, 2, 2, 2, 2, 2, 1]] * 2) / 24.0, abs=1e-15)
    assert (along.first_row, along.first_column) == (0, 0)
    corner = motion_psf(line((-0.5, 1.5), (-0.5, 1.5)))
    assert corner.table.tolist() == [[0.25, 0.25], [0.25, 0.25]]
    assert (corner.first_row, corner.first_column) == (1, -1)


def test_a_path_through_corners_has_only_its_diagonal() -> None:
    psf = motion_psf(line((-0.5, -0.5), (6.5, 6.5)))
    assert psf.table == pytest.approx(np.eye(7) / 7.0, abs=1e-15)
    assert np.count_nonzero(psf.table) == 7


def test_linear_rest_shares_by_distance() -> None:
    psf = motion_psf(line((2.25, -0.5), (2.25, -0.5)), "linear")
    assert psf.table == pytest.approx(np.array([[0.375, 0.125], [0.375, 0.125]]), abs=1e-15)
    assert (psf.first_row, psf.first_column) == (-1, 2)


def test_pieces_need_not_join_and_dark_ones_do_not_count() -> None:
    segments = np.array([[[0, 0], [2, 0]], [[50, 50], [60, 60]], [[10, 0], [12, 0]]], dtype=float)
    psf = motion_psf(ExposedPath(segments, np.array([0.3, 0.0, 0.1])))
    assert psf.table.shape == (1, 13)
    assert not psf.table[0, 3:10].any()
    assert psf.table[0, :3].sum() == pytest.approx(0.75, abs=1e-14)


small = st.floats(-20.0, 20.0, allow_subnormal=False)
place = st.tuples(small, small)
grid_place = st.tuples(st.integers(-16, 16), st.integers(-16, 16)).map(lambda p: (p[0] / 4.0, p[1] / 4.0))


@both
@given(
    places=st.lists(st.one_of(place, grid_place), min_size=2, max_size=8),
    seed=st.integers(0, 99),
)
def test_light_is_conserved_and_kept_in_place(
    places: list[tuple[float, float]], interpolation: Interpolation, seed: int
) -> None:
    light = np.random.default_rng(seed).uniform(0.1, 1.0, len(places) - 1)
    path = ExposedPath.polyline(places, light)
    psf = motion_psf(path, interpolation)
    assert psf.table.sum() == pytest.approx(1.0, abs=1e-12)
    assert (psf.table >= 0.0).all()
    borders = (psf.table[0], psf.table[-1], psf.table[:, 0], psf.table[:, -1])
    assert all(border.any() for border in borders)
    assert np.count_nonzero(psf.table) <= 4 * sum(
        abs(a[0] - b[0]) + abs(a[1] - b[1]) + 4 for a, b in pairwise(places)
    )
    # Linear interpolation keeps the mean displacement; a pixel integral is off by half a pixel at most.
    assert centroid(psf) == pytest.approx(path.mean, abs=1e-12 if interpolation == "linear" else 0.5 + 1e-12)


@both
@given(places=st.lists(st.one_of(place, grid_place), min_size=2, max_size=5))
def test_a_mirrored_path_has_the_mirrored_table(
    places: list[tuple[float, float]], interpolation: Interpolation
) -> None:
    canvas = on_canvas(motion_psf(line(*places), interpolation), 22)
    mirrored = on_canvas(motion_psf(line(*[(-x, y) for x, y in places]), interpolation), 22)
    turned = on_canvas(motion_psf(line(*[(y, x) for x, y in places]), interpolation), 22)
    backwards = on_canvas(motion_psf(line(*places[::-1]), interpolation), 22)
    assert mirrored[:, ::-1] == pytest.approx(canvas, abs=1e-12)
    assert pytest.approx(canvas, abs=1e-12) == turned.T
    assert backwards == pytest.approx(canvas, abs=1e-12)


@both
@given(
    places=st.lists(place, min_size=2, max_size=4),
    step=st.tuples(st.integers(-9, 9), st.integers(-9, 9)),
)
def test_whole_pixels_only_move_the_offset(
    places: list[tuple[float, float]], step: tuple[int, int], interpolation: Interpolation
) -> None:
    canvas = on_canvas(motion_psf(line(*places), interpolation), 32)
    moved = motion_psf(line(*[(x + step[0], y + step[1]) for x, y in places]), interpolation)
    expected = np.roll(canvas, (step[1], step[0]), axis=(0, 1))
    assert on_canvas(moved, 32) == pytest.approx(expected, abs=1e-12)


@both
def test_a_reach_leaves_out_what_is_beyond(interpolation: Interpolation) -> None:
    path = line((-40.3, 9.2), (33.1, -17.7), (3.3, 3.3), (3.3, 200.0), (3.3, 3.3))
    whole, cut = motion_psf(path, interpolation), motion_psf(path, interpolation, reach=(6, 11))
    canvas = on_canvas(whole, 210)
    seen = np.zeros_like(canvas)
    seen[204:217, 199:222] = canvas[204:217, 199:222]
    assert on_canvas(cut, 210) == pytest.approx(seen, abs=1e-14)
    assert cut.table.shape[0] <= 13
    assert cut.table.shape[1] <= 23
    nothing = motion_psf(line((100, 100), (101, 100)), interpolation, reach=(6, 11))
    assert nothing.table.tolist() == [[0.0]]
    assert nothing.separated() is not None


def test_a_reach_makes_a_path_across_the_world_cheap() -> None:
    path = line((-1e12, 3.0), (1e12, 3.0))
    psf = motion_psf(path, reach=(1080, 1920))
    assert psf.table.shape == (1, 3841)
    assert psf.table == pytest.approx(0.5e-12, rel=1e-3)
    with pytest.raises(SettingsError, match=r"moves over 2000000000003 x 3 pixels.*shorten"):
        motion_psf(path)


def test_thousands_of_pieces() -> None:
    rng = np.random.default_rng(4)
    places = np.cumsum(rng.normal(0.0, 1.0, (20_001, 2)), axis=0)
    psf = motion_psf(ExposedPath.polyline(places, np.full(20_000, 5e-5)), "linear")
    assert psf.table.sum() == pytest.approx(1.0, abs=1e-12)


@both
def test_far_places_lose_nothing(interpolation: Interpolation) -> None:
    near = motion_psf(line((0.125, 0.25), (3.5, 2.75)), interpolation)
    far = motion_psf(line((1e8 + 0.125, -1e8 + 0.25), (1e8 + 3.5, -1e8 + 2.75)), interpolation)
    assert far.table == pytest.approx(near.table, abs=1e-7)
    assert far.first_column - near.first_column == 100_000_000


@pytest.mark.parametrize(
    ("places", "light", "message"),
    [
        ([[0, 0], [math.nan, 0]], [1.0], "no number"),
        ([[0, 0], [math.inf, 0]], [1.0], "no number"),
        ([[0, 0], [1, 0]], [math.nan], "no number"),
        ([[0, 0], [1, 0]], [-1.0], "0 or more"),
        ([[0, 0], [1, 0], [2, 0]], [2.0, -1.0], "0 or more"),
        ([[0, 0], [1, 0]], [0.0], "not 0 everywhere"),
        ([], [], "a piece"),
        ([[0, 0]], [], "a piece"),
        ([[0, 0], [1, 0]], [0.5, 0.5], "one share of light"),
    ],
)
def test_bad_paths_say_what_is_wrong(places: list[list[float]], light: list[float], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        ExposedPath.polyline(places, light)


def test_unknown_choices_are_named() -> None:
    with pytest.raises(SettingsError, match="box, linear, not 'cubic'"):
        motion_psf(line((0, 0), (1, 0)), "cubic")  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="not 'magic'"):
        convolve(np.ones((2, 2, 1)), MotionPsf(np.ones((1, 1)), 0, 0), "magic")  # type: ignore[arg-type]
    for shape in ((2, 2), (0, 2, 1)):
        with pytest.raises(SettingsError, match="rows, columns and channels"):
            convolve(np.ones(shape), MotionPsf(np.ones((1, 1)), 0, 0))


# --- transforms -------------------------------------------------------------------------------------------


def table_transform(psf: MotionPsf, u: Array, v: Array) -> npt.NDArray[np.complex128]:
    """Return the transform of the table taken as impulses, which has period 1."""
    columns = np.arange(psf.table.shape[1]) + psf.first_column
    rows = np.arange(psf.table.shape[0]) + psf.first_row
    horizontal = np.exp(-2j * np.pi * np.multiply.outer(u, columns))
    vertical = np.exp(-2j * np.pi * np.multiply.outer(v, rows))
    return np.asarray(np.einsum("kr,rc,kc->k", vertical, psf.table, horizontal))


@pytest.mark.parametrize("a", [5.7, -12.25, 0.3])
def test_even_motions_table_has_the_transform_of_eq_3_14(a: float) -> None:
    """Times the pixel's sinc and summed over the aliases that the pixel grid brings."""
    psf = motion_psf(line((0, 0), (a, 0)))
    u = np.linspace(-0.5, 0.5, 21)
    aliases = u[:, np.newaxis] + np.arange(-40_000, 40_001)
    expected = (uniform_transfer(aliases, a) * np.sinc(aliases)).sum(axis=1)
    assert table_transform(psf, u, np.zeros_like(u)) == pytest.approx(expected, abs=1e-5)


def test_a_path_of_any_shape_has_its_transform() -> None:
    path = line((0.3, -0.2), (6.1, 2.2), (3.3, 8.8), (3.3, 8.8))
    psf = motion_psf(path, "linear")
    rng = np.random.default_rng(3)
    u, v = rng.uniform(-0.5, 0.5, (2, 12))
    k = np.arange(-25, 26)
    uu = u[:, np.newaxis, np.newaxis] + k[:, np.newaxis]
    vv = v[:, np.newaxis, np.newaxis] + k
    expected = (motion_transfer(path, uu, vv) * np.sinc(uu) ** 2 * np.sinc(vv) ** 2).sum(axis=(1, 2))
    assert table_transform(psf, u, v) == pytest.approx(expected, abs=2e-4)


def test_even_motion_is_a_path_of_one_piece() -> None:
    u = np.linspace(-2.0, 2.0, 41)
    path = ExposedPath.polyline([(0, 0), (4.4, 0)], [0.25])
    assert motion_transfer(path, u, 0.3) == pytest.approx(uniform_transfer(u, 4.4, 0.25), abs=1e-15)
    assert motion_transfer(path, 0.0, 0.0) == pytest.approx(0.25)


def test_eq_3_14_is_the_integral_of_eq_3_13_and_the_transform_of_eq_3_15() -> None:
    a, exposure = 3.3, 0.7
    for u in (0.0, 0.21, -1.4):
        along_time = [
            integrate.quad(lambda t, f=f, u=u: f(2.0 * math.pi * u * a * t / exposure), 0.0, exposure)[0]
            for f in (math.cos, math.sin)
        ]
        along_path = [
            integrate.quad(
                lambda x, f=f, u=u: float(uniform_response(x, a, exposure)) * f(2.0 * math.pi * u * x), 0.0, a
            )[0]
            for f in (math.cos, math.sin)
        ]
        expected = complex(uniform_transfer(u, a, exposure))
        assert complex(along_time[0], -along_time[1]) == pytest.approx(expected, abs=1e-12)
        assert complex(along_path[0], -along_path[1]) == pytest.approx(expected, abs=1e-12)


def test_even_response_lies_between_0_and_a() -> None:
    x = np.array([-0.1, 0.0, 1.0, 4.0, 4.1])
    assert uniform_response(x, 4.0, 2.0).tolist() == [0.0, 0.5, 0.5, 0.5, 0.0]
    assert uniform_response(-x, -4.0, 2.0).tolist() == [0.0, 0.5, 0.5, 0.5, 0.0]
    with pytest.raises(SettingsError, match="not 0"):
        uniform_response(0.0, 0.0)


def test_focal_plane_triangle_is_the_slits_overlap_with_itself() -> None:
    d = 0.8
    u = np.array([-1.0, -0.8, -0.4, 0.0, 0.2, 0.8, 3.0])
    assert focal_plane_transfer(u, d) == pytest.approx([0, 0, 0.5, 1, 0.75, 0, 0], abs=1e-15)
    # A slit of width d shifted by u covers itself by d - |u|.
    slit = np.ones(800)
    overlap = signal.correlate(slit, slit) / 800.0
    shift = np.arange(-799, 800) * d / 800.0
    assert focal_plane_transfer(shift, d) == pytest.approx(overlap, abs=1e-12)


def test_focal_plane_response_is_the_triangles_transform() -> None:
    d = 1.7
    for x in (0.0, 0.3, 1.0 / 1.7, 2.2):
        value = 2.0 * integrate.quad(lambda u, x=x: (1 - u / d) * math.cos(2.0 * math.pi * u * x), 0.0, d)[0]
        assert float(focal_plane_response(x, d)) == pytest.approx(value, abs=1e-12)
    for function in (focal_plane_transfer, focal_plane_response):
        for bad in (0.0, -1.0, math.nan):
            with pytest.raises(SettingsError, match="wider than 0"):
                function(0.0, bad)


# --- the path a shutter sees ------------------------------------------------------------------------------


def seen_light(path: ExposedPath, low: float, high: float) -> float:
    """Return the light between two places of a level path that only moves to the right."""
    x0, x1 = path.segments[:, 0, 0], path.segments[:, 1, 0]
    inside = np.clip(high, x0, x1) - np.clip(low, x0, x1)
    return float((path.light * inside / (x1 - x0)).sum())


def test_an_open_shutter_sees_the_motion_as_it_is() -> None:
    path = path_of(Shutter(), [0.0, 0.25, 1.0], [(0, 0), (4, 0), (4, 3)])
    assert path.segments.tolist() == [[[0, 0], [4, 0]], [[4, 0], [4, 3]]]
    assert path.light == pytest.approx([0.25, 0.75])


def test_a_motion_of_one_time_rests() -> None:
    path = path_of(Shutter(curve=((0, 0), (0.5, 1), (1, 0))), [0.3], [(2, 1)])
    assert path.light.sum() == pytest.approx(1.0)
    assert motion_psf(path).table.tolist() == [[1.0]]


def test_multiple_exposure_of_figure_7d() -> None:
    """Five openings of 0.2 T every 0.4 T, over 1.8 T in all."""
    shutter = Shutter(frames=1.0, openings=even_openings(5, 0.2, 0.4))
    path = path_of(shutter, [0.0, 1.0], [(0, 0), (18, 0)])
    begins = np.array([0.0, 4.0, 8.0, 12.0, 16.0])
    assert path.segments[:, 0, 0] == pytest.approx(begins, abs=1e-12)
    assert path.segments[:, 1, 0] == pytest.approx(begins + 2.0, abs=1e-12)
    assert path.light == pytest.approx([0.2] * 5, abs=1e-12)
    psf = motion_psf(path)
    expected = [0.05, 0.1, 0.05, 0.0] * 5
    assert psf.table[0] == pytest.approx(expected[:-1], abs=1e-12)


SHUTTERS = [
    Shutter(curve=((0.0, 0.0), (0.3, 1.0), (1.0, 0.0))),
    Shutter(curve=((0.2, 0.1), (0.8, 1.0))),
    Shutter(blade_time=0.3),
    Shutter(blade_time=0.5, openings=((0.1, 0.4), (0.5, 1.3))),
    Shutter(curve=((0.0, 1.0), (1.0, 0.0)), openings=even_openings(3, 0.2, 0.4)),
]


@pytest.mark.parametrize("shutter", SHUTTERS)
def test_the_light_along_a_path_is_the_shutters(shutter: Shutter) -> None:
    times = np.array([0.0, 0.17, 0.6, 1.0])
    x = np.array([0.0, 9.0, 12.0, 40.0])
    path = path_of(shutter, times, np.stack([x, np.zeros(4)], axis=1))
    assert path.light.sum() == pytest.approx(1.0, abs=1e-12)
    assert (np.diff(path.segments[:, :, 0], axis=1) > 0.0).all()
    assert (path.segments[1:, 0, 0] >= path.segments[:-1, 1, 0] - 1e-12).all()
    for begin, end in ((0.0, 0.1), (0.05, 0.33), (0.4, 0.41), (0.17, 0.6), (0.9, 1.0)):
        low, high = np.interp([begin, end], times, x)
        assert seen_light(path, low, high) == pytest.approx(shutter.light(begin, end), abs=2e-4)
    # The pieces' own shares are exact.
    for (low, high), light in zip(path.segments[:, :, 0], path.light, strict=True):
        begin, end = np.interp([low, high], x, times)
        assert light == pytest.approx(shutter.light(begin, end), abs=1e-12)


def test_pieces_are_cut_until_the_light_is_even() -> None:
    shutter = Shutter(curve=((0.0, 0.0), (0.5, 1.0), (1.0, 0.0)))
    path = path_of(shutter, [0.0, 1.0], [(0, 0), (10, 0)])
    density = path.light / np.diff(path.segments[:, :, 0], axis=1)[:, 0]
    assert np.abs(np.diff(density)).max() <= 0.02 * 0.2 + 1e-12
    psf = motion_psf(path)
    edges = np.clip(np.arange(12) - 0.5, 0.0, 10.0) / 10.0
    expected = np.diff(np.where(edges < 0.5, 2.0 * edges**2, 1.0 - 2.0 * (1.0 - edges) ** 2))
    assert psf.table[0] == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(
    ("times", "places", "message"),
    [
        ([], [], "and a time"),
        ([0.0, 1.0], [(0, 0)], "one place"),
        ([0.0, 0.0], [(0, 0), (1, 1)], "must increase"),
        ([0.0, math.nan], [(0, 0), (1, 1)], "no number"),
        ([0.0, 1.0], [(0, 0), (math.inf, 1)], "no number"),
    ],
)
def test_bad_motions_say_what_is_wrong(
    times: list[float], places: list[tuple[float, float]], message: str
) -> None:
    with pytest.raises(SettingsError, match=message):
        path_of(Shutter(), times, places)


# --- separability -----------------------------------------------------------------------------------------


@both
@pytest.mark.parametrize(
    "places", [((0, 0), (7.7, 0)), ((0.3, 0.4), (0.3, -9.2)), ((1.2, 3.4), (1.2, 3.4)), ((-3, 0.5), (5, 0.5))]
)
def test_level_and_upright_motions_are_products(
    places: tuple[tuple[float, float], ...], interpolation: Interpolation
) -> None:
    psf = motion_psf(line(*places), interpolation)
    factors = psf.separated()
    assert factors is not None
    row, column = factors
    assert np.multiply.outer(column, row) == pytest.approx(psf.table, abs=1e-15)
    assert row.sum() == pytest.approx(1.0)
    assert column.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    "places", [((0, 0), (3, 1)), ((0, 0), (5, 5)), ((0, 0), (9, 0), (9, 9)), ((0, 0), (1, 1))]
)
def test_slanted_motions_are_no_products(places: tuple[tuple[float, float], ...]) -> None:
    assert motion_psf(line(*places)).separated() is None


def test_any_outer_product_is_found_and_a_disturbed_one_is_not() -> None:
    rng = np.random.default_rng(8)
    table = np.multiply.outer(rng.random(40), rng.random(30))
    table /= table.sum()
    assert MotionPsf(table, 0, 0).separated() is not None
    table[17, 12] += 1e-8 * table.max()
    assert MotionPsf(table, 0, 0).separated() is None


# --- convolution ------------------------------------------------------------------------------------------

METHODS: tuple[ConvolutionMethod, ...] = ("spatial", "frequency", "separable", "auto")


def direct(image: Array, psf: MotionPsf) -> Array:
    """Return the full convolution by scipy's direct sum."""
    channels = [signal.convolve2d(image[..., c], psf.table) for c in range(image.shape[2])]
    return np.stack(channels, axis=2)


@pytest.mark.parametrize("brightest", [1.0, 1e4])
@pytest.mark.parametrize("places", [((0.2, 0), (13.3, 0)), ((0, -3), (0, -20.5)), ((-2, 1), (9, 8), (4, 12))])
def test_methods_agree(places: tuple[tuple[float, float], ...], brightest: float) -> None:
    rng = np.random.default_rng(5)
    image = rng.random((37, 23, 4)).astype(np.float32)
    image[rng.random((37, 23)) < 0.02] *= brightest
    image[10:20, 5:15] = 0.0
    psf = motion_psf(line(*places), "linear")
    expected = direct(image.astype(np.float64), psf)
    limit = 1e-6 * float(image.max())
    for method in METHODS:
        if method == "separable" and psf.separated() is None:
            with pytest.raises(SettingsError, match="spatial or frequency"):
                convolve_full(image, psf, method)
            continue
        full, first_row, first_column = convolve_full(image, psf, method)
        assert full.dtype == np.float32
        assert (first_row, first_column) == (psf.first_row, psf.first_column)
        assert full == pytest.approx(expected, abs=limit)
        assert full.min() >= -1e-14 * image.max()
        if method == "spatial":
            assert full.min() >= 0.0
        # The same window is the full one's, seen through the picture's frame.
        wide = np.zeros((37 + 160, 23 + 160, 4), dtype=np.float32)
        top, left = 80 + first_row, 80 + first_column
        wide[top : top + full.shape[0], left : left + full.shape[1]] = full
        assert convolve(image, psf, method) == pytest.approx(wide[80:-80, 80:-80], abs=limit)


@pytest.mark.parametrize("method", METHODS)
def test_a_bright_pixel_moves_right_and_down(method: ConvolutionMethod) -> None:
    image = np.zeros((9, 7, 1), dtype=np.float32)
    image[4, 3] = 1000.0
    end = (6.5, 0.0) if method == "separable" else (6.5, 11.0)
    path = line((2.5, 0.0), end)
    full, first_row, first_column = convolve_full(image, motion_psf(path, "linear"), method)
    rows, columns = np.indices(full.shape[:2])
    total = full.sum(dtype=np.float64)
    assert total == pytest.approx(1000.0, rel=1e-6)
    assert (full[..., 0] * (columns + first_column)).sum() / total == pytest.approx(
        3.0 + path.mean[0], abs=1e-5
    )
    assert (full[..., 0] * (rows + first_row)).sum() / total == pytest.approx(4.0 + path.mean[1], abs=1e-5)
    assert path.mean[0] > 0.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("x", "y"), [(100.0, 0.0), (-100.0, 0.0), (0.0, 9.0), (0.0, -9.0), (7.0, 0.0)])
def test_what_leaves_the_window_is_lost(method: ConvolutionMethod, x: float, y: float) -> None:
    image = np.ones((9, 7, 2), dtype=np.float32)
    assert not convolve(image, motion_psf(line((x, y), (x, y))), method).any()
    partly = motion_psf(line((0, 0), (0, 0), (x, y), (x, y)))
    if partly.separated() is not None or method != "separable":
        assert convolve(image, partly, method)[4, 0].min() >= 1.0 / 3.0 - 1e-6


def test_no_motion_leaves_the_picture_as_it_is() -> None:
    image = (1e4 * np.random.default_rng(2).random((8, 9, 3)) ** 9).astype(np.float32)
    psf = motion_psf(line((0, 0), (0, 0)))
    assert np.array_equal(convolve(image, psf), image)
    assert np.array_equal(convolve(image, psf, "separable"), image)
    shifted = convolve(image, motion_psf(line((2, -3), (2, -3))), "spatial")
    assert np.array_equal(shifted[:5, 2:], image[3:, :7])
    assert not shifted[5:].any()
    assert not shifted[:, :2].any()


def test_the_picture_is_not_changed_and_its_layout_does_not_matter() -> None:
    image = np.random.default_rng(2).random((8, 9, 3)).astype(np.float32)
    before = image.copy()
    psf = motion_psf(line((0, 0), (3, 2)))
    for method in ("spatial", "frequency"):
        expected = convolve(image, psf, method)
        assert np.array_equal(convolve(np.asfortranarray(image), psf, method), expected)
        assert np.array_equal(convolve(image[::-1, ::-1][::-1, ::-1], psf, method), expected)
    assert np.array_equal(image, before)


@given(seed=st.integers(0, 200), method=st.sampled_from(("spatial", "frequency", "auto")))
def test_convolution_is_linear_and_keeps_energy(seed: int, method: ConvolutionMethod) -> None:
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 20, 2)
    f, g = rng.random((2, rows, columns, 2))
    psf = motion_psf(line(*rng.uniform(-9.0, 9.0, (3, 2))))
    blurred = [convolve_full(image, psf, method)[0] for image in (f, g, 2.0 * f + 3.0 * g)]
    assert 2.0 * blurred[0] + 3.0 * blurred[1] == pytest.approx(blurred[2], abs=1e-5)
    assert blurred[0].sum(axis=(0, 1)) == pytest.approx(f.sum(axis=(0, 1)), rel=1e-5)


def test_a_cheap_method_is_chosen() -> None:
    picture = (1080, 1920, 4)

    def choice(*places: tuple[float, float]) -> ConvolutionMethod:
        psf = motion_psf(line(*places))
        return module._cheapest(picture, psf, psf.separated() is not None)

    assert choice((0, 0), (0, 0)) == "spatial"
    assert choice((0, 0), (5, 3)) == "spatial"
    assert choice((0, 0), (400, 300)) == "frequency"
    # A level path is a product, but its one row costs an addition more.
    assert choice((0, 0), (30, 0)) == "spatial"
    thick = MotionPsf(np.full((9, 9), 1.0 / 81.0), -4, -4)
    assert module._cheapest(picture, thick, separable=True) == "separable"
