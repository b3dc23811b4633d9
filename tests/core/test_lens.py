"""Geometrical optics (TOG 1982, sections 2.2 and 2.3): its table, numbers by hand, traced rays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from potmesil_addon.errors import SettingsError
from potmesil_addon.lens import (
    COC_MODELS,
    CocModel,
    Lens,
    circle_of_confusion,
    circle_of_confusion_at_infinity,
    depth_of_field,
    depth_of_field_for_circle,
    hyperfocal_distance,
    image_distance,
)

# TOG 1982, table 1, for a 55 mm lens: f-stop, focus, far limit, near limit, depth of field, all in mm.
TABLE_1 = [
    (5.6, 2000, 2511, 1662, 849),
    (5.6, 980, 1089, 891, 198),
    (5.6, 550, 583, 521, 62),
    (5.6, 290, 299, 282, 17),
    (11, 2000, 3333, 1429, 1904),
    (11, 980, 1219, 819, 400),
    (11, 550, 618, 495, 123),
    (11, 290, 308, 274, 34),
    (22, 2000, 10000, 1111, 8889),
    (22, 980, 1612, 704, 908),
    (22, 550, 705, 451, 254),
    (22, 290, 328, 260, 68),
]

F = 0.05
SHAPES: list[tuple[int, ...]] = [(), (0,), (3,), (2, 3), (4, 1, 2)]

models = pytest.mark.parametrize("model", COC_MODELS)


@pytest.mark.parametrize(("f_stop", "focus", "far", "near", "total"), TABLE_1)
def test_table_1_to_the_millimetre(f_stop: float, focus: int, far: int, near: int, total: int) -> None:
    limits = depth_of_field(Lens(0.055, f_stop, focus / 1000.0))
    assert round(limits.far * 1000.0) == far
    assert round(limits.near * 1000.0) == near
    # The table's last column is the difference of the rounded limits.
    assert round(limits.far * 1000.0) - round(limits.near * 1000.0) == total
    assert abs(limits.total * 1000.0 - total) < 1.0


@pytest.mark.parametrize(("f_stop", "diameter_mm"), [(5.6, 9.82), (11.0, 5.00), (22.0, 2.50)])
def test_aperture_diameters_of_table_1(f_stop: float, diameter_mm: float) -> None:
    assert Lens(0.055, f_stop, 1.0).aperture_diameter * 1000.0 == pytest.approx(diameter_mm, abs=0.005)


@given(st.floats(0.001, 1e4), st.floats(0.001, 1.0))
def test_lens_law(distance: float, focal_length: float) -> None:
    image = float(image_distance(distance, focal_length))
    assert 1.0 / image + 1.0 / distance == pytest.approx(1.0 / focal_length, rel=1e-12, abs=1e-9)


@given(st.floats(1.01, 100.0))
def test_lens_law_is_its_own_inverse(ratio: float) -> None:
    there = image_distance(ratio * F, F)
    assert float(image_distance(there, F)) == pytest.approx(ratio * F, rel=1e-11)


def test_image_distance_at_its_special_places() -> None:
    assert float(image_distance(math.inf, F)) == F
    assert float(image_distance(F, F)) == math.inf
    assert float(image_distance(2.0 * F, F)) == pytest.approx(2.0 * F, rel=1e-15)
    # Within the focal length the image is virtual: half of it gives as much on the object's side.
    assert float(image_distance(0.5 * F, F)) == pytest.approx(-F, rel=1e-15)


def test_hyperfocal_distance_by_hand() -> None:
    # 1000 * 50 mm / 4 = 12.5 m
    assert hyperfocal_distance(Lens(F, 4.0, 1.0)) == pytest.approx(12.5, rel=1e-15)
    assert hyperfocal_distance(Lens(F, 4.0, 1.0), criterion=500.0) == pytest.approx(6.25, rel=1e-15)


def test_focused_at_the_hyperfocal_distance() -> None:
    limits = depth_of_field(Lens(F, 4.0, 12.5))
    assert limits.far == math.inf
    assert limits.total == math.inf
    assert limits.near == pytest.approx(6.25, rel=1e-15)


def test_focused_at_infinity() -> None:
    limits = depth_of_field(Lens(F, 4.0, math.inf))
    assert limits.far == math.inf
    assert limits.near == limits.hyperfocal == pytest.approx(12.5, rel=1e-15)


def test_focused_beyond_the_hyperfocal_distance() -> None:
    limits = depth_of_field(Lens(F, 4.0, 50.0))
    assert limits.far == math.inf
    # 50 * 12.5 / 62.5
    assert limits.near == pytest.approx(10.0, rel=1e-15)


@given(st.floats(0.1, 12.0))
def test_focus_is_the_harmonic_mean_of_the_limits(distance: float) -> None:
    limits = depth_of_field(Lens(F, 4.0, distance))
    assert 1.0 / limits.near + 1.0 / limits.far == pytest.approx(2.0 / distance, rel=1e-12)
    assert limits.near < distance < limits.far


def test_circles_by_hand() -> None:
    lens = Lens(F, 2.0, 2.0)
    # F^2/n = 1.25e-3; Cycles (4 - 2) / (4 * 2), the paper (4 - 2) / (4 * 1.95).
    assert float(circle_of_confusion(4.0, lens, "cycles")) == pytest.approx(3.125e-4, rel=1e-14)
    assert float(circle_of_confusion(4.0, lens, "paper")) == pytest.approx(1.25e-3 / 3.9, rel=1e-14)
    assert float(circle_of_confusion(1.0, lens, "cycles")) == pytest.approx(-6.25e-4, rel=1e-14)
    assert float(circle_of_confusion(1.0, lens, "paper")) == pytest.approx(-1.25e-3 / 1.95, rel=1e-14)


def traced_circle(point: float, lens: Lens, model: CocModel) -> float:
    """Return the signed circle on the image plane from two rays through the aperture's rim."""
    hits = []
    for rim in (0.5 * lens.aperture_diameter, -0.5 * lens.aperture_diameter):
        if model == "paper":
            # A thin lens bends a ray by its height over F; the film stands where the focus converges.
            film = 1.0 / (1.0 / lens.focal_length - 1.0 / lens.focus_distance)
            slope = rim / point - rim / lens.focal_length
            # Behind the lens the picture stands on its head.
            hits.append(-(rim + film * slope))
        else:
            # Cycles aims every ray at the focused plane, where the pinhole's ray of its pixel meets it.
            on_plane = rim * (1.0 - lens.focus_distance / point)
            hits.append(on_plane / lens.focus_distance * lens.focal_length)
    return hits[0] - hits[1]


@models
@given(st.floats(0.06, 500.0), st.floats(0.06, 500.0), st.floats(0.7, 32.0))
def test_circle_equals_two_traced_rim_rays(
    model: CocModel, point: float, focus: float, f_stop: float
) -> None:
    lens = Lens(F, f_stop, focus)
    traced = traced_circle(point, lens, model)
    # The traced heights cancel from the size of the aperture.
    assert float(circle_of_confusion(point, lens, model)) == pytest.approx(traced, rel=1e-9, abs=1e-12)


def test_circle_in_the_papers_own_letters() -> None:
    """TOG 1982, eq. 9, with its letters put right: |V_D - V_P| / V_P times the aperture."""
    lens = Lens(F, 2.8, 3.0)
    for point in (0.5, 1.0, 10.0, 1000.0):
        plane, image = F * 3.0 / (3.0 - F), F * point / (point - F)
        expected = (plane - image) / image * F / 2.8
        assert float(circle_of_confusion(point, lens, "paper")) == pytest.approx(expected, rel=1e-10)


@models
def test_circle_is_negative_before_the_focus_and_positive_behind(model: CocModel) -> None:
    lens = Lens(F, 2.8, 3.0)
    assert (circle_of_confusion([0.1, 1.0, 2.999], lens, model) < 0.0).all()
    assert (circle_of_confusion([3.001, 10.0, math.inf], lens, model) > 0.0).all()
    assert float(circle_of_confusion(3.0, lens, model)) == 0.0


@models
def test_focused_at_infinity_infinity_is_sharp(model: CocModel) -> None:
    lens = Lens(F, 2.0, math.inf)
    assert float(circle_of_confusion(math.inf, lens, model)) == 0.0
    # F^2 / (n P): 1.25e-3 / 10, for both models.
    assert float(circle_of_confusion(10.0, lens, model)) == pytest.approx(-1.25e-4, rel=1e-14)


@models
def test_circle_at_infinity_is_the_limit(model: CocModel) -> None:
    lens = Lens(F, 2.0, 4.0)
    limit = circle_of_confusion_at_infinity(lens, model)
    image = F * 4.0 / (4.0 - F)
    expected = (image - F) / 2.0 if model == "paper" else F**2 / (2.0 * 4.0)
    assert limit == pytest.approx(expected, rel=1e-12)
    assert limit == float(circle_of_confusion(math.inf, lens, model))
    far = float(circle_of_confusion(1e9, lens, model))
    assert 0.0 < limit - far < 1e-8 * limit


@models
@given(st.floats(0.06, 200.0), st.floats(1e-6, 1e-3))
def test_circle_at_the_film_limits_is_the_criterion(model: CocModel, focus: float, circle: float) -> None:
    lens = Lens(F, 2.8, focus)
    limits = depth_of_field_for_circle(lens, circle, model)
    assert 0.0 < limits.near < focus < limits.far
    assert float(circle_of_confusion(limits.near, lens, model)) == pytest.approx(-circle, rel=1e-9)
    if math.isfinite(limits.far):
        assert float(circle_of_confusion(limits.far, lens, model)) == pytest.approx(circle, rel=1e-6)
    else:
        assert circle_of_confusion_at_infinity(lens, model) <= circle * (1.0 + 1e-12)


@models
def test_film_hyperfocal_is_where_the_far_limit_reaches_infinity(model: CocModel) -> None:
    circle = 30e-6
    hyperfocal = depth_of_field_for_circle(Lens(F, 2.8, 3.0), circle, model).hyperfocal
    # F^2 / (n c), and the focal length more where the film moves back for the focus.
    assert hyperfocal == pytest.approx(F**2 / (2.8 * circle) + (F if model == "paper" else 0.0), rel=1e-12)
    before = depth_of_field_for_circle(Lens(F, 2.8, 0.9999 * hyperfocal), circle, model)
    after = depth_of_field_for_circle(Lens(F, 2.8, 1.0001 * hyperfocal), circle, model)
    assert math.isfinite(before.far)
    assert after.far == math.inf
    assert after.near == pytest.approx(hyperfocal / 2.0, rel=1e-2)


@models
def test_film_limits_focused_at_infinity(model: CocModel) -> None:
    limits = depth_of_field_for_circle(Lens(F, 2.5, math.inf), 1e-5, model)
    # F^2 / (n c) = 2.5e-3 / 2.5 / 1e-5
    assert limits.near == pytest.approx(100.0, rel=1e-12)
    assert limits.far == math.inf


BAD_NUMBERS = [0.0, -1.0, -0.0, math.nan, -math.inf]


@pytest.mark.parametrize("value", [*BAD_NUMBERS, math.inf])
@pytest.mark.parametrize(
    ("field", "name"),
    [("focal_length", "Focal length"), ("f_stop", "F-stop"), ("anamorphic_ratio", "Anamorphic ratio")],
)
def test_lens_refuses(field: str, name: str, value: float) -> None:
    values = {"focal_length": F, "f_stop": 2.8, "focus_distance": 2.0, "anamorphic_ratio": 1.0, field: value}
    with pytest.raises(SettingsError, match=name):
        Lens(**values)


@pytest.mark.parametrize("value", BAD_NUMBERS)
def test_lens_refuses_a_focus_distance(value: float) -> None:
    with pytest.raises(SettingsError, match="Focus distance"):
        Lens(F, 2.8, value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_lens_refuses_an_endless_rotation(value: float) -> None:
    with pytest.raises(SettingsError, match="rotation"):
        Lens(F, 2.8, 2.0, blades=5, blade_rotation=value)


@pytest.mark.parametrize("blades", [-1, 1001])
def test_lens_refuses_blades_that_no_iris_has(blades: int) -> None:
    with pytest.raises(SettingsError, match="Blades"):
        Lens(F, 2.8, 2.0, blades=blades)


@pytest.mark.parametrize("ratio", [0.9e-3, 1001.0])
def test_lens_refuses_an_aperture_that_is_a_slit(ratio: float) -> None:
    with pytest.raises(SettingsError, match="Anamorphic ratio"):
        Lens(F, 2.8, 2.0, anamorphic_ratio=ratio)


@pytest.mark.parametrize(("blades", "is_round"), [(0, True), (1, True), (2, True), (3, False), (9, False)])
def test_fewer_than_three_blades_are_round(blades: int, is_round: bool) -> None:
    assert Lens(F, 2.8, 2.0, blades=blades).is_round is is_round


@pytest.mark.parametrize("value", [*BAD_NUMBERS, math.inf])
def test_criteria_are_refused(value: float) -> None:
    lens = Lens(F, 2.8, 2.0)
    with pytest.raises(SettingsError, match="Criterion"):
        hyperfocal_distance(lens, value)
    with pytest.raises(SettingsError, match="Criterion"):
        depth_of_field(lens, value)
    with pytest.raises(SettingsError, match="Circle"):
        depth_of_field_for_circle(lens, value)


@pytest.mark.parametrize("focus", [F, 0.5 * F])
def test_the_papers_lens_cannot_focus_within_its_focal_length(focus: float) -> None:
    lens = Lens(F, 2.8, focus)
    for call in (
        lambda: circle_of_confusion(1.0, lens, "paper"),
        lambda: circle_of_confusion_at_infinity(lens, "paper"),
        lambda: depth_of_field_for_circle(lens, 1e-5, "paper"),
    ):
        with pytest.raises(SettingsError, match="cannot focus"):
            call()
    # Cycles can: it does not move the film.
    assert float(circle_of_confusion(2.0 * focus, lens, "cycles")) > 0.0


@pytest.mark.parametrize("shape", SHAPES)
@models
def test_circle_keeps_any_shape(model: CocModel, shape: tuple[int, ...]) -> None:
    lens = Lens(F, 2.8, 3.0)
    depth = np.linspace(1.0, 9.0, math.prod(shape)).reshape(shape)
    circles = circle_of_confusion(depth, lens, model)
    assert circles.shape == shape
    assert circles.dtype == np.float64
    each = [float(circle_of_confusion(x, lens, model)) for x in depth.reshape(-1)]
    assert circles.reshape(-1).tolist() == each


@pytest.mark.parametrize("shape", SHAPES)
def test_image_distance_keeps_any_shape(shape: tuple[int, ...]) -> None:
    distance = np.linspace(1.0, 9.0, math.prod(shape)).reshape(shape)
    images = image_distance(distance, F)
    assert images.shape == shape
    assert images.reshape(-1).tolist() == [float(image_distance(x, F)) for x in distance.reshape(-1)]


@models
def test_nan_stays_nan_and_touches_nothing_else(model: CocModel) -> None:
    lens = Lens(F, 2.8, 3.0)
    circles = circle_of_confusion([1.0, math.nan, math.inf], lens, model)
    assert np.isnan(circles).tolist() == [False, True, False]
    assert np.isnan(image_distance([1.0, math.nan, math.inf], F)).tolist() == [False, True, False]
