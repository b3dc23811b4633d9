"""Tables of point-spread functions: normalised, centred, the right one for each sample."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy import interpolate

from potmesil_addon import aperture, psf
from potmesil_addon.aperture import SAMPLE_POSITIONS, SamplePosition, ellipse_rows
from potmesil_addon.camera import Film
from potmesil_addon.errors import SettingsError
from potmesil_addon.lens import Lens, circle_of_confusion
from potmesil_addon.psf import MAX_TABLES, PRIMARY_WAVELENGTHS, PsfBuilder, PsfSettings

from .helpers import Array, diffraction_integral, on_canvas

PITCH = 5e-6
SQUARE = Film(PITCH * 100, PITCH * 80, 100, 80)
OBLONG = Film(PITCH * 200, PITCH * 80, 100, 80)

CIRCLES = np.array([-60.3, -13.0, -2.2, -0.4, 0.0, 0.3, 1.0, 7.7, 41.5]) * PITCH

positions = pytest.mark.parametrize("position", SAMPLE_POSITIONS)


def lens(blades: int = 0, rotation: float = 0.0, ratio: float = 1.0, f_stop: float = 8.0) -> Lens:
    return Lens(0.05, f_stop, 2.0, blades, rotation, ratio)


BUILDERS: list[tuple[str, dict[str, Any]]] = [
    ("disc", {"lens": lens()}),
    ("disc paper", {"lens": lens(), "model": "paper"}),
    ("squeezed disc", {"lens": lens(ratio=1.7)}),
    ("disc on oblong pixels", {"lens": lens(), "film": OBLONG}),
    ("hexagon", {"lens": lens(6, 0.3)}),
    ("squeezed pentagon", {"lens": lens(5, 1.0, 0.6)}),
    ("pentagon on oblong pixels", {"lens": lens(5, 1.0), "film": OBLONG}),
    ("lommel", {"lens": lens(), "settings": PsfSettings(kind="lommel")}),
    ("lommel paper", {"lens": lens(), "settings": PsfSettings(kind="lommel"), "model": "paper"}),
    ("squeezed lommel", {"lens": lens(ratio=1.7), "settings": PsfSettings(kind="lommel")}),
    ("lommel on oblong pixels", {"lens": lens(), "film": OBLONG, "settings": PsfSettings(kind="lommel")}),
]

SYMMETRIC = [(name, options) for name, options in BUILDERS if options["lens"].blades % 2 == 0]
"""An odd polygon's pixels are not symmetric, only its area is."""

every_kind = pytest.mark.parametrize("options", [o for _, o in BUILDERS], ids=[name for name, _ in BUILDERS])


def builder(options: dict[str, Any], position: SamplePosition = "center") -> PsfBuilder:
    return PsfBuilder(**{"film": SQUARE, **options}, position=position)


def first_moments(canvas: Array, reach: int, half: float) -> Array:
    """Return each primary's centroid (x, y) from the sample, of pixel values taken at pixel centres."""
    at = np.arange(canvas.shape[1]) - reach + 0.5 - half
    return np.stack([canvas.sum(axis=1) @ at, canvas.sum(axis=2) @ at], axis=1)


@every_kind
@positions
def test_tables_sum_to_1_for_each_primary(options: dict[str, Any], position: SamplePosition) -> None:
    """TOG 1982, eq. 24."""
    made = builder(options, position)
    lommel = made.settings.kind == "lommel"
    for table in made.tables(CIRCLES):
        values = table.dense()
        assert values.shape[0] == (3 if lommel else 1)
        np.testing.assert_allclose(values.sum(axis=(1, 2)), 1.0, rtol=0.0, atol=1e-12)
        assert float(values.min()) >= -1e-12


@pytest.mark.parametrize("options", [o for _, o in SYMMETRIC], ids=[name for name, _ in SYMMETRIC])
@positions
def test_tables_are_centred_on_the_sample(options: dict[str, Any], position: SamplePosition) -> None:
    half = 0.5 if position == "center" else 0.0
    for table in builder(options, position).tables(CIRCLES):
        reach = 2 + max(table.dense().shape[1:])
        np.testing.assert_allclose(
            first_moments(on_canvas(table, reach), reach, half), 0.0, rtol=0.0, atol=1e-9
        )


def test_odd_polygons_lie_around_the_sample() -> None:
    # Of a large circle the pixels are fine enough that their centroid is the polygon's own.
    for table in builder({"lens": lens(5, 1.0)}).tables(np.array([-200.0, 200.0]) * PITCH):
        np.testing.assert_allclose(first_moments(on_canvas(table, 120), 120, 0.5), 0.0, rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("blades", [0, 3, 6])
def test_in_focus_a_sample_keeps_to_its_pixel(blades: int) -> None:
    (table,) = builder({"lens": lens(blades)}).tables(np.array([0.0]))
    canvas = on_canvas(table, 3)[0]
    assert canvas[3, 3] == pytest.approx(1.0, abs=1e-9)
    assert np.count_nonzero(np.abs(canvas) > 1e-9) == 1


@pytest.mark.parametrize("blades", [0, 4, 6])
def test_in_focus_a_corner_sample_is_shared_by_four_pixels(blades: int) -> None:
    (table,) = builder({"lens": lens(blades)}, "corner").tables(np.array([0.0]))
    expected = np.zeros((7, 7))
    expected[2:4, 2:4] = 0.25
    np.testing.assert_allclose(on_canvas(table, 3)[0], expected, atol=1e-9)


def test_diameter_of_the_table_is_the_circle() -> None:
    # A disc of 41.5 pixels' diameter reaches 20.75 from the middle: to the pixel at 20, past its half.
    (table,) = builder({"lens": lens()}).tables(np.array([41.5 * PITCH]))
    middle = on_canvas(table, 25)[0][25]
    assert np.flatnonzero(middle > 0.0).tolist() == list(range(4, 47))
    area = math.pi * 20.75**2
    assert middle[25] == pytest.approx(1.0 / area, rel=1e-12)


def test_anamorphic_ratio_narrows_the_disc() -> None:
    (table,) = builder({"lens": lens(ratio=2.0)}).tables(np.array([40.0 * PITCH]))
    values = on_canvas(table, 25)[0]
    wide, high = np.ptp(np.argwhere(values > 0.0), axis=0)[::-1] + 1
    assert (wide, high) == (21, 41)


def test_oblong_pixels_narrow_the_table() -> None:
    (table,) = builder({"lens": lens(), "film": OBLONG}).tables(np.array([40.0 * PITCH]))
    wide, high = np.ptp(np.argwhere(on_canvas(table, 25)[0] > 0.0), axis=0)[::-1] + 1
    assert (wide, high) == (21, 41)


@positions
@pytest.mark.parametrize(("blades", "rotation"), [(3, 0.0), (5, 0.7), (7, -1.1)])
def test_a_near_polygon_is_a_far_one_turned_by_180_degrees(
    blades: int, rotation: float, position: SamplePosition
) -> None:
    made = builder({"lens": lens(blades, rotation, 1.3)}, position)
    near, far = (on_canvas(table, 20)[0] for table in made.tables(np.array([-23.7, 23.7]) * PITCH))
    if position == "corner":
        # A corner lies between the offsets -1 and 0.
        near, far = near[:-1, :-1], far[:-1, :-1]
    np.testing.assert_allclose(near, far[::-1, ::-1], rtol=0.0, atol=1e-14)
    assert np.abs(near - far).max() > 1e-4


def test_far_polygon_stands_upright() -> None:
    # Three blades at -90 degrees: a corner up, a blade level below.
    (table,) = builder({"lens": lens(3, -math.pi / 2.0)}).tables(np.array([40.0 * PITCH]))
    rows = np.flatnonzero(on_canvas(table, 25)[0].sum(axis=1) > 1e-12) - 25
    # Radius 20 up, half of it down.
    assert (rows[0], rows[-1]) == (-20, 10)


# Diffraction


def lommel_reference(made: PsfBuilder, circle: float, wavelength: float, u: float, reach: float) -> Array:
    """Return pixel integrals of the diffraction pattern within a radius, from the integral itself."""
    per_v = wavelength * made.lens.f_stop / math.pi
    v = np.linspace(0.0, reach / per_v, 2 + math.ceil(reach / per_v * 16.0))
    profile = interpolate.CubicSpline(v * per_v, diffraction_integral(u, v))
    pixels = math.ceil(reach / PITCH + 0.5)
    fine = 32
    at = (np.arange((2 * pixels + 1) * fine) + 0.5) / fine - pixels - 0.5
    if made.position == "corner":
        at += 0.5
    radius = np.hypot(at[:, np.newaxis] * made.film.pitch_y, at * made.film.pitch_x)
    values = np.where(radius <= reach, profile(np.minimum(radius, reach)), 0.0)
    side = 2 * pixels + 1
    canvas = values.reshape(side, fine, side, fine).mean(axis=(1, 3))
    return np.asarray(canvas / canvas.sum())


@positions
@pytest.mark.parametrize("circle_px", [0.0, 0.7, -4.0, 11.3])
@pytest.mark.parametrize("f_stop", [4.0, 16.0])
def test_lommel_pixels_equal_the_integrated_profile(
    circle_px: float, f_stop: float, position: SamplePosition
) -> None:
    """TOG 1982, eq. 23, with the lens at rest: u is v at the circle's rim, the pattern kept 10 pi past it."""
    made = builder({"lens": lens(f_stop=f_stop), "settings": PsfSettings(kind="lommel")}, position)
    circle = circle_px * PITCH
    margin = 10.0 * max(PRIMARY_WAVELENGTHS) * f_stop
    (table,) = made.tables(np.array([circle]))
    for primary, wavelength in enumerate(PRIMARY_WAVELENGTHS):
        u = 2.0 * math.pi / wavelength / (2.0 * f_stop) * abs(circle) / 2.0
        expected = lommel_reference(made, circle, wavelength, u, abs(circle) / 2.0 + margin)
        reach = expected.shape[0] // 2
        np.testing.assert_allclose(on_canvas(table, reach)[primary], expected, rtol=0.0, atol=2e-3)


@pytest.mark.parametrize("f_stop", [2.0, 8.0])
@pytest.mark.parametrize("circle_px", [0.0, 2.7, 24.0])
def test_lommel_annuli_are_fine_enough(circle_px: float, f_stop: float) -> None:
    """Next to annuli of 1/128 pixel a table has little of its light in other pixels."""
    made = builder({"lens": lens(f_stop=f_stop), "settings": PsfSettings(kind="lommel")})
    circle = circle_px * PITCH
    (table,) = made.tables(np.array([circle]))
    per_v = PRIMARY_WAVELENGTHS[1] * f_stop / math.pi
    reach = abs(circle) / 2.0 + 10.0 * max(PRIMARY_WAVELENGTHS) * f_stop
    count = math.ceil(reach / PITCH * 128)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    edges = np.linspace(0.0, reach, count + 1)
    radius = (edges[:-1, np.newaxis] + 0.5 * reach / count * (nodes + 1.0)).reshape(-1)
    u = 2.0 * math.pi / PRIMARY_WAVELENGTHS[1] / (2.0 * f_stop) * abs(circle) / 2.0
    energy = (diffraction_integral(u, radius / per_v) * radius).reshape(count, -1) @ weights
    mean = energy * (reach / count) / (edges[1:] ** 2 - edges[:-1] ** 2)
    pixels = math.ceil(reach / PITCH + 0.5)
    expected = np.zeros((2 * pixels + 1, 2 * pixels + 1))
    for k, step in enumerate(mean - np.append(mean[1:], 0.0)):
        disc = ellipse_rows(float(edges[k + 1]) / PITCH, float(edges[k + 1]) / PITCH)
        expected += step * edges[k + 1] ** 2 * on_canvas(disc, pixels)[0]
    expected /= expected.sum()
    assert float(np.abs(on_canvas(table, pixels)[1] - expected).sum()) < 3e-4


@pytest.mark.parametrize(
    ("options", "other", "stands_on_its_head"),
    [
        # Before and beyond the focus a diffraction pattern is the same, and an iris is not.
        (
            {"lens": lens(), "settings": PsfSettings(kind="lommel")},
            {"lens": lens(f_stop=7.9), "settings": PsfSettings(kind="lommel")},
            False,
        ),
        ({"lens": lens(5, 0.3)}, {"lens": lens(5, 0.4)}, True),
    ],
    ids=["lommel", "polygon"],
)
def test_tables_are_kept_for_the_next_frame(
    options: dict[str, Any], other: dict[str, Any], stands_on_its_head: bool
) -> None:
    made = builder(options)
    circles = np.array([-12.0, 5.0, 5.0, 12.0]) * PITCH
    sides = np.array([2, 1, 1, 1])
    first, second = list(made.tables(circles, sides)), list(made.tables(circles, sides))
    assert all(a is b for a, b in zip(first, second, strict=True))
    assert first[1] is first[2]
    assert first[0].block == 2
    assert (first[3] is not next(made.tables(-circles[3:]))) == stands_on_its_head
    # Another lens has others.
    assert first[3] is not next(builder(other).tables(circles[3:]))


def test_kept_lommel_tables_do_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    made = builder({"lens": lens(), "settings": PsfSettings(kind="lommel")})
    circles = np.arange(1.0, 30.0) * PITCH
    plenty = list(made.tables(circles))
    kept = aperture.KeptTables()
    monkeypatch.setattr(psf, "KEPT_TABLES", kept)
    monkeypatch.setattr(aperture, "_KEPT_BYTES", 100_000)
    few = list(made.tables(circles))
    assert 0 < kept._bytes <= 100_000
    assert kept._bytes == sum(table.nbytes for table in kept._tables.values())
    for a, b in zip(plenty, few, strict=True):
        assert np.array_equal(a.delta, b.delta)
    # The last ones are those that are kept.
    assert next(made.tables(circles[-1:])) is few[-1]
    assert next(made.tables(circles[:1])) is not few[0]


@pytest.mark.parametrize("depth", [0.8, 1.7, 2.4, 50.0])
def test_the_papers_lommel_pixels_end_at_the_circle(depth: float) -> None:
    """u by TOG 1982, eq. 18 and the lens law; nothing outside the circle of confusion (section 3.2)."""
    f_stop = 16.0
    aperture = lens(f_stop=f_stop)
    made = builder({"lens": aperture, "settings": PsfSettings(kind="lommel"), "model": "paper"})
    circle = float(circle_of_confusion(depth, aperture, "paper"))
    (table,) = made.tables(np.array([circle]))
    image, plane = 0.05 * depth / (depth - 0.05), 0.05 * 2.0 / (2.0 - 0.05)
    for primary, wavelength in enumerate(PRIMARY_WAVELENGTHS):
        u = 2.0 * math.pi / wavelength * (0.5 / f_stop) ** 2 * (image - plane)
        expected = lommel_reference(made, circle, wavelength, u, abs(circle) / 2.0)
        reach = expected.shape[0] // 2
        np.testing.assert_allclose(on_canvas(table, reach)[primary], expected, rtol=0.0, atol=2e-3)


def test_red_spreads_wider_than_blue() -> None:
    (table,) = builder({"lens": lens(f_stop=16.0), "settings": PsfSettings(kind="lommel")}).tables(
        np.zeros(1)
    )
    canvas = on_canvas(table, 40)
    spread = (canvas * np.hypot(*np.mgrid[-40:41, -40:41])).sum(axis=(1, 2))
    assert spread[0] > spread[1] > spread[2]
    assert canvas[0, 40, 40] < canvas[1, 40, 40] < canvas[2, 40, 40]


def test_lommel_of_a_wide_lens_comes_near_the_disc() -> None:
    circle = np.array([30.0 * PITCH])
    (disc,) = builder({"lens": lens(f_stop=1.0)}).tables(circle)
    (wave,) = builder({"lens": lens(f_stop=1.0), "settings": PsfSettings(kind="lommel")}).tables(circle)
    # The rings at the rim are all that is left of diffraction.
    difference = np.abs(on_canvas(wave, 20) - on_canvas(disc, 20))
    assert float(difference.sum(axis=(1, 2)).max()) < 0.25
    assert float(difference[:, 14:27, 14:27].max() * math.pi * 15.0**2) < 0.15


def test_lommel_of_a_huge_circle_costs_no_more_than_the_disc() -> None:
    # A sample just before the lens: 2 mm across at f/1 is u = 6770 for blue, 100 mm is 339 000.
    for circle in (2e-3, 0.1):
        (disc,) = builder({"lens": lens(f_stop=1.0)}).tables(np.array([circle]))
        (wave,) = builder({"lens": lens(f_stop=1.0), "settings": PsfSettings(kind="lommel")}).tables(
            np.array([circle])
        )
        assert wave.offset.size < 2 * disc.offset.size
        assert wave.delta.shape[1] == 3
        assert abs(wave.first_row - disc.first_row) <= 30


def test_lommel_needs_a_round_aperture() -> None:
    with pytest.raises(SettingsError, match="round"):
        builder({"lens": lens(5), "settings": PsfSettings(kind="lommel")})


@pytest.mark.parametrize("step", [0.0, -1.0, math.nan, math.inf])
def test_settings_refuse_a_step(step: float) -> None:
    with pytest.raises(SettingsError, match="step"):
        PsfSettings(step=step)


@pytest.mark.parametrize("wavelength", [0.0, -5e-7, math.nan, math.inf])
def test_settings_refuse_a_wavelength(wavelength: float) -> None:
    with pytest.raises(SettingsError, match="Wavelengths"):
        PsfSettings(wavelengths=(6e-7, wavelength, 4e-7))


# Which table a sample takes


def spread_depths(nearest: float = 0.3, farthest: float = 60.0, shape: tuple[int, int] = (20, 30)) -> Any:
    depth = np.random.default_rng(4).uniform(1.0 / farthest, 1.0 / nearest, shape)
    return (1.0 / depth).astype(np.float32)


def taken_circles(made: PsfBuilder, depth: Any) -> tuple[Array, Array]:
    """Return for each sample the circle of its tables, mixed by the fraction, and its own."""
    assignment = made.assign(depth)
    circles = assignment.circles[assignment.table]
    if assignment.fraction is not None:
        after = assignment.circles[np.minimum(assignment.table + 1, assignment.circles.size - 1)]
        circles = circles * (1.0 - assignment.fraction) + after * assignment.fraction
    return circles, circle_of_confusion(depth, made.lens, made.model)


@pytest.mark.parametrize(("step", "used"), [(None, 0.125), (0.5, 0.5), (0.02, 0.02)])
def test_nearest_table_is_within_half_a_step(step: float | None, used: float) -> None:
    made = builder({"lens": lens(f_stop=4.0), "settings": PsfSettings(step=step)})
    taken, own = taken_circles(made, spread_depths(1.9, 2.2))
    assert np.abs(own).max() < 32.0 * PITCH
    assert np.abs(taken - own).max() <= 0.5 * used * PITCH * (1.0 + 1e-9)
    assert np.abs(taken - own).max() > 0.4 * used * PITCH


def test_nearest_lommel_table_is_within_half_a_step() -> None:
    made = builder({"lens": lens(f_stop=8.0), "settings": PsfSettings(kind="lommel")})
    taken, own = taken_circles(made, spread_depths(1.9, 2.2))
    assert np.abs(own).max() < 16.0 * PITCH
    assert np.abs(taken - own).max() <= 0.125 * PITCH * (1.0 + 1e-9)


def test_past_32_pixels_a_table_is_within_half_a_percent_of_the_circle() -> None:
    made = builder({"lens": lens(f_stop=1.4)})
    taken, own = taken_circles(made, spread_depths())
    large = np.abs(own) > 32.0 * PITCH
    assert large.mean() > 0.5
    assert (np.abs(taken / own - 1.0)[large]).max() < 0.0025
    assert np.abs(taken - own)[~large].max() <= 0.0625 * PITCH * (1.0 + 1e-9)


def test_a_sample_before_the_lens_does_not_cost_thousands_of_tables() -> None:
    made = builder({"lens": lens(f_stop=1.4)})
    assert (
        made.assign(np.geomspace(1e-4, 1e4, 20_000).reshape(100, 200).astype(np.float32)).circles.size < 5000
    )


@pytest.mark.parametrize("spacing", ["coc", "equal-z"])
def test_fractions_mix_to_the_samples_own_place(spacing: Any) -> None:
    depth = spread_depths(1.9, 2.2)
    made = builder(
        {
            "lens": lens(f_stop=4.0),
            "settings": PsfSettings(
                lookup="interpolated", tables=spacing, step=0.01 if spacing == "equal-z" else None
            ),
        }
    )
    assignment = made.assign(depth)
    assert assignment.fraction is not None
    assert assignment.fraction.min() >= 0.0
    assert assignment.fraction.max() <= 1.0
    if spacing == "coc":
        taken, own = taken_circles(made, depth)
        np.testing.assert_allclose(taken, own, rtol=0.0, atol=1e-5 * 0.125 * PITCH)
        return
    # Places between the tables are equal steps of depth, not of the circle.
    nearest = float(depth.min())
    place = (depth.astype(np.float64) - nearest) / 0.01
    below = nearest + np.floor(place) * 0.01
    expected = circle_of_confusion(below, made.lens, "cycles")
    np.testing.assert_allclose(assignment.circles[assignment.table], expected, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(assignment.fraction, place - np.floor(place), rtol=0.0, atol=1e-5)


def test_every_interpolated_sample_has_a_table_after_its_own() -> None:
    for settings in (
        PsfSettings(lookup="interpolated"),
        PsfSettings(lookup="interpolated", tables="equal-z", step=0.05),
    ):
        made = builder({"lens": lens(), "settings": settings})
        depth = spread_depths()
        depth[3, 4:9] = np.inf
        assignment = made.assign(depth)
        assert assignment.fraction is not None
        mixed = assignment.fraction > 0.0
        assert assignment.table[mixed].max() + 1 < assignment.circles.size


def test_equal_z_tables_stand_a_millimetre_apart() -> None:
    """TOG 1982, section 4: 1 mm between tables, the nearest one used."""
    made = builder({"lens": lens(), "settings": PsfSettings(tables="equal-z", step=1e-3)})
    depth = np.array([[1.0, 1.0004, 1.0006, 1.0031, 1.25, 1.0]], dtype=np.float32)
    assignment = made.assign(depth)
    of_tables = 1.0 + np.array([0.0, 0.001, 0.003, 0.25])
    np.testing.assert_allclose(
        assignment.circles, circle_of_confusion(of_tables, made.lens, "cycles"), rtol=0.0, atol=1e-15
    )
    assert assignment.table.tolist() == [[0, 0, 1, 2, 3, 0]]


def test_equal_z_tables_by_default_part_the_range_in_a_thousand() -> None:
    made = builder({"lens": lens(), "settings": PsfSettings(tables="equal-z")})
    depth = np.linspace(1.0, 3.0, 40_001, dtype=np.float32).reshape(1, -1)
    circles = made.assign(depth).circles
    assert circles.size == 1001
    np.testing.assert_allclose(
        circles, circle_of_confusion(np.linspace(1.0, 3.0, 1001), made.lens, "cycles"), rtol=0.0, atol=1e-12
    )


@pytest.mark.parametrize("lookup", ["nearest", "interpolated"])
@pytest.mark.parametrize("spacing", ["coc", "equal-z"])
def test_infinity_has_its_own_table(lookup: Any, spacing: Any) -> None:
    step = 0.01 if spacing == "equal-z" else None
    made = builder({"lens": lens(), "settings": PsfSettings(tables=spacing, lookup=lookup, step=step)})
    depth = np.array([[1.0, 1.5, math.inf, 9.0, math.inf]], dtype=np.float32)
    taken, own = taken_circles(made, depth)
    tolerance = 1e-12 if spacing == "equal-z" else 0.0025 * float(own[0, 2])
    assert np.abs(taken - own)[0, [2, 4]].max() <= tolerance
    assert np.isfinite(made.assign(depth).circles).all()


def test_nothing_but_infinity_needs_one_table() -> None:
    for spacing in ("coc", "equal-z"):
        made = builder({"lens": lens(), "settings": PsfSettings(tables=spacing)})
        assignment = made.assign(np.full((2, 3), np.inf, dtype=np.float32))
        assert assignment.circles.size == 1
        expected = float(circle_of_confusion(math.inf, made.lens, "cycles"))
        assert float(assignment.circles[0]) == pytest.approx(expected, rel=0.0025)


def test_too_many_tables_are_refused() -> None:
    made = builder({"lens": lens(), "settings": PsfSettings(tables="equal-z", step=1e-3)})
    depth = np.linspace(1.0, 1.0 + 1.5e-3 * MAX_TABLES, MAX_TABLES + 2, dtype=np.float32).reshape(2, -1)
    with pytest.raises(SettingsError, match="larger step"):
        made.assign(depth)


def test_a_far_sample_does_not_cost_memory() -> None:
    """One sample far away must not ask for a list of all the tables before it."""
    made = builder({"lens": lens(), "settings": PsfSettings(tables="equal-z", step=1e-6)})
    depth = np.array([[1.0, 9e8]], dtype=np.float32)
    # To refuse is as good.
    with contextlib.suppress(SettingsError):
        assert made.assign(depth).circles.size == 2


def test_packed_tables_are_the_tables() -> None:
    """Entries may be rounded to 25 binary digits of the largest; rows end in exactly nothing."""
    for options in (BUILDERS[0][1], BUILDERS[4][1], BUILDERS[7][1]):
        made = builder(options)
        tables = list(made.tables(CIRCLES))
        packed = made.pack(tables)
        assert packed.count == len(tables)
        assert packed.primaries == tables[0].dense().shape[0]
        assert packed.last_row.tolist() == [t.first_row + t.row_begin.size - 1 for t in tables]
        assert packed.reach_x >= max(np.abs(t.offset).max() for t in tables)
        assert packed.nbytes > 0
        rows: Sequence[int] = packed.rows.tolist()
        for t, table in enumerate(tables):
            digit = 2.0**-25 * np.abs(table.delta).max()
            for j, row in enumerate(range(rows[t], rows[t + 1])):
                entries = slice(packed.row_begin[row], packed.row_end[row])
                own = slice(table.row_begin[j], table.row_end[j])
                assert packed.offset[entries].tolist() == table.offset[own].tolist()
                difference = np.abs(packed.delta[entries] - table.delta[own])
                # The last one takes what rounding the others has left.
                assert difference[:-1].max(initial=0.0) <= digit
                assert difference.max(initial=0.0) <= digit * max(1, difference.shape[0])
                if not packed.symmetric:
                    assert (packed.delta[entries].sum(axis=0) == 0.0).all()
