"""Images of the pupil: exact areas, closed forms of light over radius, and which side is cut."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from potmesil_addon.aperture import ellipse_rows
from potmesil_addon.camera import Film
from potmesil_addon.effects import ChromaticAberration, Pupil, Vignetting
from potmesil_addon.errors import SettingsError
from potmesil_addon.lens import Lens
from potmesil_addon.psf import PsfBuilder, PsfSettings
from potmesil_addon.pupil import (
    Barrel,
    PupilShape,
    _middle_of,
    barrel_at,
    clear_share,
    field_cells,
    outline,
    transmission,
)

from .helpers import Array, on_canvas

PITCH = 1e-5


def lens(**others: object) -> Lens:
    return Lens(**({"focal_length": 0.05, "f_stop": 2.0, "focus_distance": 2.0} | others))  # type: ignore[arg-type]


def film(across: float = 1.0) -> Film:
    return Film(width=100 * PITCH * across, height=100 * PITCH, columns=100, rows=100)


def image(shape: PupilShape, diameter: float, *, reach: int = 60, cell: int = 0) -> Array:
    """Return a table's values for a circle of so many pixels, the sample in the middle."""
    return on_canvas(shape.table(diameter * PITCH, 1, cell, "center"), reach)


def area_of(polygon: npt.NDArray[np.float64]) -> float:
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def radii(reach: int = 60) -> Array:
    """Return how far each pixel's middle is from the sample's."""
    at = np.arange(2 * reach + 1) - reach
    return np.asarray(np.hypot(at, at[:, np.newaxis]))


@pytest.mark.parametrize("blades", [3, 5, 6, 9])
@pytest.mark.parametrize("curvature", [0.0, 0.3, 0.8, 1.0])
def test_a_curved_blade_is_an_arc_through_its_corners(blades: int, curvature: float) -> None:
    half = math.pi / blades
    wanted = 0.5 * blades * math.sin(2.0 * half)
    if curvature > 0.0:
        # A circular segment on each side of the polygon.
        chord, sagitta = math.sin(half), curvature * (1.0 - math.cos(half))
        radius = (chord**2 + sagitta**2) / (2.0 * sagitta)
        angle = 2.0 * math.asin(min(chord / radius, 1.0))
        wanted += blades * 0.5 * radius**2 * (angle - math.sin(angle))
    rim = outline(lens(blades=blades, blade_rotation=0.4), Pupil(blade_curvature=curvature))
    assert area_of(rim) == pytest.approx(wanted, rel=2e-3)
    # The middle of the first blade is at the angle of rotation.
    out = np.hypot(*rim.T)[np.argmin(np.abs(np.angle(np.exp(1j * (np.arctan2(*rim.T[::-1]) - 0.4)))))]
    if 0.0 < curvature < 1.0:
        assert out == pytest.approx(math.cos(half) + curvature * (1.0 - math.cos(half)), abs=1e-9)


def test_straight_blades_are_those_of_the_disc_tables() -> None:
    its = lens(blades=6, blade_rotation=0.2)
    circle = np.array([31.0, -17.3]) * PITCH
    known = list(PsfBuilder(its, film()).tables(circle))
    shaped = list(PsfBuilder(its, film(), shape=PupilShape(its, film(), Pupil())).tables(circle))
    for a, b in zip(known, shaped, strict=True):
        assert np.abs(a.dense() - b.dense()).max() < 1e-12 * a.dense().max()


def test_an_obstruction_is_a_hole_and_the_rest_is_even() -> None:
    values = image(PupilShape(lens(), film(), Pupil(obstruction=0.4)), 100.0)[0]
    r, ring = radii(), 1.0 / (math.pi * 50.0**2 * (1.0 - 0.4**2))
    assert values.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(values[r < 19.0]).max() < 1e-15
    assert values[(r > 21.0) & (r < 49.0)] == pytest.approx(ring, rel=1e-3)


@pytest.mark.parametrize("diameter", [100.0, -40.0])
def test_apodisation_falls_as_a_gaussian_of_the_radius(diameter: float) -> None:
    strength, radius = 3.0, abs(diameter) / 2.0
    values = image(PupilShape(lens(), film(), Pupil(apodisation=strength)), diameter)[0]
    r = radii()
    peak = strength / (math.pi * radius**2 * (1.0 - math.exp(-strength)))
    inner = r < radius - 2.0
    wanted = peak * np.exp(-strength * (r[inner] / radius) ** 2)
    # A pixel's mean differs from its middle by its curvature.
    assert np.abs(values[inner] - wanted).max() < 3.0 * peak / radius**2
    assert values.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(values[r > radius + 1.5]).max() < 1e-15


@pytest.mark.parametrize("diameter", [80.0, -80.0, 0.0])
@pytest.mark.parametrize("shift", [-0.3e-3, 0.4e-3])
def test_spherical_aberration_lands_light_where_third_order_rays_do(diameter: float, shift: float) -> None:
    shape = PupilShape(lens(f_stop=1.4), film(), Pupil(spherical_aberration=shift))
    values = image(shape, diameter)[0]
    radius, aberration = 0.5 * diameter, -shift / (2.0 * 1.4**3) / PITCH
    # Light within a radius on the film: the parts of the pupil, even in its squared radius, that land there.
    square = (np.arange(200_000) + 0.5) / 200_000
    lands = np.abs(np.sqrt(square) * (radius + aberration * square))
    assert values.sum() == pytest.approx(1.0, abs=1e-12)
    for share in (0.2, 0.5, 0.8, 0.95):
        within = share * lands.max()
        if within < 5.0:
            # Too few pixels to tell.
            continue
        assert values[radii() <= within].sum() == pytest.approx((lands <= within).mean(), abs=0.03), share


def test_a_lens_that_focuses_its_rim_short_has_bright_rims_before_the_focus() -> None:
    """Undercorrected: soft behind the plane in focus, a ring before it."""
    shape = PupilShape(lens(f_stop=1.4), film(), Pupil(spherical_aberration=-0.3e-3))
    behind, before = image(shape, 80.0)[0], image(shape, -80.0)[0]
    at_rim = [np.flatnonzero(values[60] > 0.5 * values[60].max())[-1] - 60 for values in (behind, before)]
    assert before[60, 60 + at_rim[1] - 2] > 1.1 * before[60, 60]
    assert behind[60, 60 + at_rim[0] - 2] < 0.9 * behind[60, 60]


def test_rays_at_the_rim_of_f_1_meet_as_far_behind_as_is_said() -> None:
    """At f/1 in the rim's own focus its rays land on the axis."""
    shift = 0.2e-3
    fast = PupilShape(lens(f_stop=1.0), film(), Pupil(spherical_aberration=shift))
    # The film is by `shift` farther behind than the axis' focus, so the circle is that over the f-stop.
    assert 0.5 * shift / 1.0 + fast.aberration == pytest.approx(0.0, abs=1e-18)
    stopped = PupilShape(lens(f_stop=2.0), film(), Pupil(spherical_aberration=shift))
    assert stopped.aberration == pytest.approx(fast.aberration / 8.0)


def test_quadrature_comes_to_the_exact_polygon() -> None:
    its = lens(blades=7, blade_rotation=0.3, anamorphic_ratio=1.6)
    for pixels in (film(), film(0.7)):
        exact = image(PupilShape(its, pixels, Pupil(blade_curvature=0.4, obstruction=0.3)), 41.0)
        same = Pupil(blade_curvature=0.4, obstruction=0.3, apodisation=1e-12)
        summed = image(PupilShape(its, pixels, same), 41.0)
        # At the rim a cell of a third of a pixel is as light as its covered part, all over.
        assert np.abs(exact - summed).max() < 0.05 * exact.max()
        assert np.abs(exact - summed).sum() < 0.01


def test_red_and_blue_focus_behind_green_by_their_shift_over_the_f_stop() -> None:
    fringes = ChromaticAberration(focus_red=0.08e-3, focus_blue=-0.04e-3)
    shape = PupilShape(lens(f_stop=2.0), film(), None, fringes)
    found = image(shape, 30.0)
    for values, diameter in zip(found, (30.0 - 4.0, 30.0, 30.0 + 2.0), strict=True):
        wanted = on_canvas(ellipse_rows(diameter / 2.0, diameter / 2.0), 60)[0]
        assert np.abs(values - wanted).max() < 3e-3 * wanted.max()


@pytest.mark.parametrize("distance", [0.2, 0.9, 1.6])
def test_two_discs_leave_a_lens_of_known_area(distance: float) -> None:
    wanted = (2.0 * math.acos(distance / 2.0) - 0.5 * distance * math.sqrt(4.0 - distance**2)) / math.pi
    barrel = Barrel(0.5 * distance * math.cos(1.1), 0.5 * distance * math.sin(1.1), 1.0)
    assert clear_share(lens(), None, barrel) == pytest.approx(wanted, abs=1e-3)
    assert clear_share(lens(), Pupil(apodisation=1e-9), barrel) == pytest.approx(wanted, abs=2e-3)
    cells = transmission(lens(), None, 64, barrel)
    assert cells.mean() * 4.0 / math.pi == pytest.approx(wanted, abs=1e-3)


def test_a_barrel_around_all_of_the_pupil_cuts_nothing_and_one_beside_it_all() -> None:
    its = lens(blades=6)
    assert clear_share(its, None, Barrel(0.1, 0.1, 3.0)) == pytest.approx(1.0, rel=1e-12)
    # A small opening in the middle of the pupil, of two rims 0.2 apart.
    small = (2.0 * math.acos(1.0 / 3.0) - (2.0 / 3.0) * math.sqrt(1.0 - 1.0 / 9.0)) * 0.3**2
    share = clear_share(lens(), None, Barrel(0.1, 0.0, 0.3))
    assert share == pytest.approx(small / math.pi, rel=2e-3)
    with pytest.raises(SettingsError, match="barrel"):
        clear_share(lens(), None, Barrel(5.0, 0.0, 1.0))


def test_the_barrel_leaves_a_cats_eye_across_the_way_out_of_the_picture() -> None:
    shape = PupilShape(lens(), film(), vignetting=Vignetting(mechanical=0.4))
    right = int(field_cells(np.array([1.0]), np.array([0.0]))[0])
    up_right = int(field_cells(np.array([1.0]), np.array([1.0]))[0])
    for diameter in (80.0, -80.0):
        seen = image(shape, diameter, cell=right)[0] > 0.0
        # Discs of radius 40 whose middles are 32 apart: 48 wide and twice sqrt(40^2 - 16^2) high.
        assert seen[60].sum() == pytest.approx(48, abs=2)
        assert seen[:, 60].sum() == pytest.approx(2.0 * math.sqrt(40.0**2 - 16.0**2), abs=2)
        # Rows count downwards: towards the upper right corner it is narrow.
        oblique = image(shape, diameter, cell=up_right)[0] > 0.0
        assert np.trace(oblique) > 1.2 * np.trace(oblique[:, ::-1])
    for cell in (0, right, up_right):
        assert image(shape, 80.0, cell=cell).sum() == pytest.approx(1.0)


def test_stopping_down_leaves_the_barrel_where_it_is() -> None:
    barrel = Vignetting(mechanical=0.6, fastest_f_stop=1.4)
    stops = (1.4, 2.0, 2.8, 5.6)
    shares = [clear_share(lens(f_stop=n), None, barrel_at(lens(f_stop=n), barrel, 1.0, 0.0)) for n in stops]
    assert shares == sorted(shares)
    assert shares[0] < 0.3
    assert shares[-1] == pytest.approx(1.0)
    # Rims of the radius of f/1.4's pupil, 0.6 of it to either side, for a pupil of 0.7 of it.
    its = barrel_at(lens(f_stop=2.0), barrel, 1.0, 0.0)
    assert its == pytest.approx((0.6 * 2.0 / 1.4, 0.0, 2.0 / 1.4))


def test_every_cell_of_the_field_holds_its_own_middle() -> None:
    cells = np.arange(127)
    x, y = np.array([_middle_of(cell) for cell in cells.tolist()]).T
    assert np.array_equal(field_cells(x, y), cells)
    assert field_cells(np.array([3.0]), np.array([0.0])) == field_cells(np.array([1.0]), np.array([0.0]))


def test_a_pupil_is_no_matter_of_lommels_round_pattern() -> None:
    shape = PupilShape(lens(), film(), Pupil(obstruction=0.3))
    with pytest.raises(SettingsError, match="Lommel"):
        PsfBuilder(lens(), film(), settings=PsfSettings(kind="lommel"), shape=shape)
