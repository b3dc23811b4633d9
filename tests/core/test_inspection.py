"""What is shown of a lens: circles, zones and point-spread functions against formulas and the processor."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from potmesil_addon import inspection
from potmesil_addon.camera import Film
from potmesil_addon.errors import InputError, SettingsError
from potmesil_addon.focus import FocusSettings
from potmesil_addon.inspection import ZONES, View
from potmesil_addon.lens import CocModel, Lens, depth_of_field
from potmesil_addon.process import ProcessSettings
from potmesil_addon.psf import PsfSettings
from potmesil_addon.samples import LensAttributes

from .helpers import focused, make_samples, plain_channels, write_exr

PITCH = 1e-5
FILM = Film(64 * PITCH, 48 * PITCH, 64, 48)
LENS = Lens(0.05, 2.0, 2.0)


def view(depth: Any = 2.0, **others: Any) -> View:
    color = np.random.default_rng(1).random((48, 64, 4))
    color[..., 3] = 1.0
    return inspection.view_of(make_samples(color, depth, film=FILM, **others))


def settings(lens: Lens = LENS, **others: Any) -> FocusSettings:
    return FocusSettings(lens, FILM, **others)


def moments(values: Any) -> tuple[float, float, float, float]:
    """Return the means and the variances along columns and rows, from the middle."""
    values = values.sum(axis=2) / values.sum()
    at = np.arange(values.shape[0]) - 0.5 * (values.shape[0] - 1)
    across, down = values.sum(axis=0), values.sum(axis=1)
    x, y = float(across @ at), float(down @ at)
    return x, y, float(across @ (at - x) ** 2), float(down @ (at - y) ** 2)


@pytest.mark.parametrize("depth", [0.3, 1.0, 2.0, 3.5, 40.0, math.inf])
@pytest.mark.parametrize("model", ["cycles", "paper"])
def test_circles_are_those_of_the_lens(depth: float, model: CocModel) -> None:
    """TOG 1982, eq. 9, worked out; F^2/n is 1.25e-3 m^2."""
    focal, focus = 0.05, 2.0
    away = 1.0 if math.isinf(depth) else (depth - focus) / depth
    expected = 1.25e-3 * away / (focus - focal if model == "paper" else focus)
    found = inspection.circles_in_pixels(depth, settings(model=model))
    assert found == pytest.approx(expected / PITCH, abs=1e-12)
    assert inspection.circles_in_pixels(depth, settings(model=model), 2) == pytest.approx(0.5 * found)


def test_zones_change_at_the_limits_that_the_panel_shows() -> None:
    limits = depth_of_field(LENS)
    # TOG 1982, eqs. 6 and 7, with H = 1000 F / n = 25 m.
    assert (limits.near, limits.far) == (pytest.approx(50.0 / 27.0), pytest.approx(50.0 / 23.0))
    depths = np.array(
        [
            0.1,
            np.nextafter(limits.near, 0.0),
            limits.near,
            2.0,
            limits.far,
            np.nextafter(limits.far, math.inf),
            math.inf,
        ]
    )
    assert inspection.zones(depths, limits).tolist() == [0, 0, 1, 1, 1, 2, 2]


def test_from_the_hyperfocal_distance_on_infinity_is_sharp() -> None:
    limits = depth_of_field(replace(LENS, focus_distance=25.0))
    found = inspection.zones(np.array([12.4, 12.6, 1e6, math.inf], dtype=np.float32), limits)
    assert [ZONES[zone] for zone in found] == ["near", "sharp", "sharp", "sharp"]


def test_colours_of_the_zones() -> None:
    depth = np.array([[1.0, 2.0, 3.0], [math.inf, 2.0, 0.5]], dtype=np.float32)
    found = inspection.overlay(depth, depth_of_field(LENS), 0.5)
    near, sharp, far = (np.array([*color, 0.5], np.float32) for color in inspection.COLORS)
    np.testing.assert_array_equal(found, [[near, sharp, far], [far, sharp, near]])
    np.testing.assert_array_equal(inspection.overlay(depth, depth_of_field(LENS), 0.5, 2), [[near, far]])


@pytest.mark.parametrize(("depth", "zone"), [(1.0, "near"), (2.0, "sharp"), (8.0, "far"), (math.inf, "far")])
def test_a_reading_says_what_the_functions_say(depth: float, zone: str) -> None:
    depths = np.full((48, 64), 5.0, dtype=np.float32)
    depths[47, 63] = depth
    found = inspection.reading(view(depths), settings(), 63.5 / 64, 0.5 / 48)
    assert found is not None
    assert (found.depth, found.zone) == (depth, zone)
    assert found.circle_px == pytest.approx(float(inspection.circles_in_pixels(depth, settings())))
    assert found.circle == pytest.approx(found.circle_px * PITCH)


@pytest.mark.parametrize(("u", "v"), [(-0.01, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.01)])
def test_there_is_no_reading_outside(u: float, v: float) -> None:
    assert inspection.reading(view(), settings(), u, v) is None


def test_rows_count_downwards() -> None:
    depths = np.arange(1.0, 48.0 * 64.0 + 1.0, dtype=np.float32).reshape(48, 64)
    for u, v, expected in ((0.001, 0.999, 1.0), (0.999, 0.999, 64.0), (0.001, 0.001, 47.0 * 64.0 + 1.0)):
        found = inspection.reading(view(depths), settings(), u, v)
        assert found is not None
        assert found.depth == expected


@pytest.mark.parametrize("kind", ["disc", "lommel"])
@pytest.mark.parametrize("depth", [1.5, 2.0, 2.3, math.inf])
@pytest.mark.parametrize("position", ["center", "corner"])
def test_a_point_keeps_its_light(kind: Any, depth: float, position: Any) -> None:
    at = view() if position == "center" else view(np.full((48, 64), 2.0), position="corner")
    values, pixel = inspection.point_spread(depth, at, settings(psf=PsfSettings(kind=kind)))
    assert values.shape[0] == values.shape[1]
    assert values.shape[0] % 2 == (1 if position == "center" else 0)
    np.testing.assert_allclose(values.sum(axis=(0, 1)), 1.0, atol=1e-6)
    assert pixel == 1.0
    np.testing.assert_allclose(moments(values)[:2], 0.0, atol=1e-9)


@pytest.mark.parametrize("depth", [1.5, 3.0, math.inf])
def test_a_disc_is_as_wide_as_its_circle(depth: float) -> None:
    """A disc's variance along an axis is a quarter of its radius squared; a pixel adds 1/12."""
    at, lens = view(), settings()
    values, _ = inspection.point_spread(depth, at, lens)
    radius = 0.5 * abs(float(inspection.circles_in_pixels(depth, lens)))
    _, _, across, down = moments(values)
    assert across == pytest.approx(0.25 * radius**2 + 1.0 / 12.0, rel=0.02)
    assert down == pytest.approx(across, rel=1e-3)
    lit = np.flatnonzero(values.sum(axis=(0, 2)) > 0.0)
    assert lit.size == pytest.approx(2.0 * radius, abs=2.0)


def test_with_visibility_a_pixels_own_width_is_taken_off() -> None:
    """As the processor does with filtered samples: the variance is the circle's alone."""
    lens = settings(visibility="aperture")
    values, _ = inspection.point_spread(2.3, view(), lens)
    radius = 0.5 * abs(float(inspection.circles_in_pixels(2.3, lens)))
    assert moments(values)[2] == pytest.approx(0.25 * radius**2, rel=0.02)


@pytest.mark.parametrize(("depth", "blades", "rotation"), [(2.6, 3, 0.0), (1.6, 3, 0.0), (2.6, 5, 0.4)])
def test_it_is_what_the_processor_makes_of_a_point(depth: float, blades: int, rotation: float) -> None:
    """Its right side up, too: a triangle's corner is to the right behind the plane in focus."""
    color = np.zeros((49, 65, 4), dtype=np.float32)
    color[24, 32] = 1.0
    film = Film(65 * PITCH, 49 * PITCH, 65, 49)
    lens = replace(LENS, f_stop=8.0, blades=blades, blade_rotation=rotation)
    samples = make_samples(color, depth, film=film)
    chosen = FocusSettings(lens, film)
    values, _ = inspection.point_spread(depth, inspection.view_of(samples), chosen)
    reach = values.shape[0] // 2
    assert reach < 24
    picture = focused(samples, chosen)[24 - reach : 25 + reach, 32 - reach : 33 + reach, 0]
    np.testing.assert_allclose(values[..., 0], picture, atol=1e-6)


def test_blades_turn_with_the_iris() -> None:
    """A squeezed aperture is higher than wide, and a triangle stands on its head before the focus."""
    _, _, across, down = moments(
        inspection.point_spread(3.0, view(), settings(replace(LENS, anamorphic_ratio=2.0)))[0]
    )
    assert down == pytest.approx(4.0 * across, rel=0.02)
    lens = settings(replace(LENS, blades=3, f_stop=4.0))
    behind = inspection.point_spread(2.5, view(), lens)[0][..., 0]
    turned = settings(replace(LENS, blades=3, f_stop=4.0, blade_rotation=math.pi))
    np.testing.assert_allclose(
        inspection.point_spread(2.5, view(), turned)[0][..., 0], behind[::-1, ::-1], atol=1e-9
    )
    before = inspection.point_spread(1.0 / (1.0 - 1.0 / 2.5), view(), lens)[0][..., 0]
    np.testing.assert_allclose(before, behind[::-1, ::-1], atol=1e-6)


def test_large_circles_are_drawn_coarser() -> None:
    lens = settings(replace(LENS, f_stop=0.1))
    circle = abs(float(inspection.circles_in_pixels(math.inf, lens)))
    assert circle > 3.0 * inspection.MOST_PSF
    values, pixel = inspection.point_spread(math.inf, view(), lens)
    assert values.shape[0] <= inspection.MOST_PSF + 8
    assert math.sqrt(4.0 * moments(values)[2]) * pixel == pytest.approx(0.5 * circle, rel=0.02)


def test_a_finer_sampled_picture_counts_its_own_pixels() -> None:
    fine = view(supersampling=2)
    coarse = inspection.reading(view(), settings(), 0.5, 0.5)
    found = inspection.reading(fine, settings(), 0.5, 0.5)
    assert coarse is not None
    assert found is not None
    assert found.circle_px == 0.5 * coarse.circle_px
    assert inspection.point_spread(3.0, fine, settings())[1] == 0.5
    assert fine.picture.shape == (24, 32, 4)


def test_diffraction_needs_a_round_aperture() -> None:
    lens = settings(replace(LENS, blades=5), psf=PsfSettings(kind="lommel"))
    with pytest.raises(SettingsError, match="blades"):
        inspection.point_spread(3.0, view(), lens)


def test_the_brightest_value_is_white() -> None:
    for kind in ("disc", "lommel"):
        values, _ = inspection.point_spread(2.3, view(), settings(psf=PsfSettings(kind=kind)))
        picture = inspection.psf_picture(values)
        assert picture.shape == (*values.shape[:2], 4)
        assert picture[..., :3].max() == pytest.approx(1.0)
        assert (picture[..., 3] == 1.0).all()
        assert picture[0, 0, 0] == 0.0


def test_a_file_is_read_without_what_is_behind(tmp_path: Path) -> None:
    channels = plain_channels(5, 7)
    named = {f"ViewLayer.Combined.{name}": channels[name] for name in "RGBA"}
    named["ViewLayer.Depth.Z"] = channels["Z"]
    for suffix in (" (stationary)", " (moving)", " (behind 1)"):
        other = plain_channels(5, 7, seed=2)
        named |= {f"ViewLayer{suffix}.Combined.{name}": other[name] for name in "RGBA"}
        named[f"ViewLayer{suffix}.Depth.Z"] = other["Z"]
    found = inspection.read_view(write_exr(tmp_path / "samples.exr", named))
    (layer,) = found.samples.layers
    assert (layer.stationary, layer.moving, layer.hidden, layer.vector) == (None, None, (), None)
    np.testing.assert_array_equal(found.depth, channels["Z"])
    np.testing.assert_array_equal(found.picture[..., 1], channels["G"])
    with pytest.raises(InputError, match="does not exist"):
        inspection.read_view(tmp_path / "none.exr")


def test_settings_win_over_the_file() -> None:
    known = LensAttributes(focal_length=0.05, f_stop=2.0, focus_distance=2.0)
    chosen = ProcessSettings(lens=replace(known, focus_distance=7.0))
    found = inspection.view_settings(view(lens=known), chosen)
    assert (found.lens.focus_distance, found.lens.f_stop, found.film) == (7.0, 2.0, FILM)
