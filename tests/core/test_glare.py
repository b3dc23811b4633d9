"""Glare: patterns of apertures against closed forms, streaks across grooves, light that is kept."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import special

from potmesil_addon.aperture import polygon_vertices
from potmesil_addon.camera import Film
from potmesil_addon.effects import Diffraction, Effects, ImageFilter, Pupil, StarFilter
from potmesil_addon.errors import InputError, SettingsError
from potmesil_addon.glare import glare
from potmesil_addon.lens import Lens
from potmesil_addon.png import write_png
from potmesil_addon.progress import run
from potmesil_addon.psf import PRIMARY_WAVELENGTHS
from potmesil_addon.samples import Float32Array

from .helpers import Array

SIDE = 201
MIDDLE = SIDE // 2
GREEN = PRIMARY_WAVELENGTHS[1]
PRIMARIES = Diffraction(spectral=False)


def lens(**others: object) -> Lens:
    return Lens(**({"focal_length": 0.05, "f_stop": 16.0, "focus_distance": 2.0} | others))  # type: ignore[arg-type]


def film(pitch: float, pitch_y: float | None = None, side: int = SIDE) -> Film:
    return Film(side * pitch, side * (pitch_y or pitch), side, side)


def point(side: int = SIDE, light: float = 1.0) -> Float32Array:
    picture = np.zeros((side, side, 4), dtype=np.float32)
    picture[..., 3] = 1.0
    picture[side // 2, side // 2, :3] = light
    return picture


def spread(effects: Effects, its: Lens, pixels: Film) -> Array:
    return run(glare(point(pixels.columns), pixels, its, effects)).astype(np.float64)


def places(pitch: float, pitch_y: float | None = None, fine: int = 1) -> tuple[Array, Array]:
    """Return x and y on the film of points in pixels, y up."""
    at = (np.arange(SIDE * fine) + 0.5) / fine - 0.5 * SIDE
    return at * pitch, -at[:, np.newaxis] * (pitch_y or pitch)


def pixel_means(values: Array, fine: int) -> Array:
    return values.reshape(SIDE, fine, SIDE, fine).mean(axis=(1, 3))


def polygon_transform(corners: Array, x: Array, y: Array) -> Array:
    """Return the transform of a polygon, edge by edge (Green's theorem), at frequencies in radians."""
    kx, ky = np.broadcast_arrays(x, y)
    square = np.maximum(kx * kx + ky * ky, 1e-12)
    total = np.zeros(kx.shape, dtype=np.complex128)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = kx * (x1 - x0) + ky * (y1 - y0)
        middle = kx * (x0 + x1) / 2 + ky * (y0 + y1) / 2
        across = kx * (y1 - y0) - ky * (x1 - x0)
        total += across * np.sinc(along / (2 * math.pi)) * np.exp(-1j * middle)
    return 1j * total / square


def test_a_round_aperture_makes_airys_pattern() -> None:
    pitch = 2e-6
    found = spread(Effects(diffraction=PRIMARIES), lens(), film(pitch))
    x, y = places(pitch, fine=4)
    for n, wavelength in enumerate(PRIMARY_WAVELENGTHS):
        v = math.pi * np.hypot(x, y) / (wavelength * 16.0)
        airy = (2.0 * special.j1(v) / v) ** 2
        wanted = pixel_means(airy, 4) * math.pi / (4.0 * (wavelength * 16.0) ** 2) * pitch**2
        inner = np.hypot(*places(pitch)) < 40 * pitch
        assert np.abs(found[..., n] - wanted)[inner].max() < 0.02 * wanted.max()
        # Rings, a hundredth of the middle and less.
        rings = inner & (np.hypot(*places(pitch)) > 1.5 * 1.22 * wavelength * 16.0)
        assert np.abs(found[..., n] - wanted)[rings].sum() < 0.08 * wanted[rings].sum()


@pytest.mark.parametrize(("blades", "rotation"), [(3, 0.3), (4, 0.0), (5, 0.1), (6, 0.2), (7, 0.0)])
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_straight_blades_make_the_transform_of_their_polygon(
    blades: int, rotation: float, ratio: float
) -> None:
    pitch = 4e-6
    its = lens(blades=blades, blade_rotation=rotation, anamorphic_ratio=ratio)
    found = spread(Effects(diffraction=PRIMARIES), its, film(pitch))[..., 1]
    x, y = places(pitch, fine=6)
    corners = polygon_vertices(blades, rotation, ratio)
    # Radians for each half height of the aperture.
    scale = math.pi / (GREEN * 16.0)
    intensity = np.abs(polygon_transform(corners, scale * x, scale * y)) ** 2
    wanted = pixel_means(intensity, 6)
    wanted /= intensity.sum() / 36.0
    inner = np.hypot(*places(pitch)) < 60 * pitch
    # All but the light beyond the picture.
    assert found[inner].sum() == pytest.approx(wanted[inner].sum(), rel=0.03)
    assert np.abs(found - wanted)[inner].max() < 0.03 * wanted.max()
    # Far from the middle, where spikes are, pixel by pixel.
    far = inner & (np.hypot(*places(pitch)) > 25 * pitch)
    assert np.abs(found - wanted)[far].sum() < 0.2 * wanted[far].sum()


@pytest.mark.parametrize(("blades", "points"), [(5, 10), (6, 6), (7, 14), (8, 8)])
@pytest.mark.parametrize("f_stop", [4.0, 22.0])
def test_blades_make_as_many_points_as_they_have_sides_or_twice_as_many(
    blades: int, points: int, f_stop: float
) -> None:
    """Across each edge, to both sides; those of parallel edges fall together. Far out at f/4, edges alone."""
    rotation = 0.13
    its = lens(blades=blades, blade_rotation=rotation, f_stop=f_stop)
    found = spread(Effects(diffraction=Diffraction()), its, film(10e-6, side=401))[..., 1]
    angle = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    ring = np.zeros(angle.size)
    for radius in np.arange(90.0, 130.0, 0.5):
        row = np.rint(200.0 - radius * np.sin(angle)).astype(int)
        column = np.rint(200.0 + radius * np.cos(angle)).astype(int)
        ring += found[row, column]
    ring = np.convolve(np.tile(ring, 3), np.ones(5), "same")[720:1440]
    peaks = np.flatnonzero(
        (ring > np.roll(ring, 1)) & (ring >= np.roll(ring, -1)) & (ring > 0.3 * ring.max())
    )
    assert peaks.size == points
    # One of them stands across the first blade, whose middle is at the rotation.
    assert np.abs(np.angle(np.exp(1j * (angle[peaks] - rotation)))).min() < 0.02


def test_stopping_down_makes_the_pattern_as_much_larger() -> None:
    small = spread(Effects(diffraction=PRIMARIES), lens(f_stop=8.0, blades=6), film(2e-6))
    large = spread(Effects(diffraction=PRIMARIES), lens(f_stop=16.0, blades=6), film(4e-6))
    assert np.abs(small - large)[..., :3].max() < 1e-6
    other = spread(
        Effects(diffraction=replace(PRIMARIES, f_stop=16.0)), lens(f_stop=2.0, blades=6), film(4e-6)
    )
    assert np.array_equal(large, other)


def test_a_curved_blade_has_no_spike() -> None:
    its = lens(blades=6, f_stop=22.0)
    straight = spread(Effects(diffraction=Diffraction()), its, film(1e-5))[MIDDLE, MIDDLE + 60, 1]
    round_ = spread(Effects(diffraction=Diffraction(), pupil=Pupil(blade_curvature=1.0)), its, film(1e-5))
    disc = spread(Effects(diffraction=Diffraction()), lens(f_stop=22.0), film(1e-5))
    assert straight > 20.0 * round_[MIDDLE, MIDDLE + 60, 1]
    assert np.abs(round_ - disc)[..., :3].max() < 1e-3


@pytest.mark.parametrize("pitch_y", [None, 6e-6])
@pytest.mark.parametrize(("line", "rotation"), [(0, 0.0), (1, 0.0), (0, 0.4)])
def test_grooves_spread_light_as_a_slit_does(pitch_y: float | None, line: int, rotation: float) -> None:
    pitch, width = 8e-6, 40e-6
    star = StarFilter(lines=2, rotation=rotation, strength=0.5, groove_width=width)
    found = spread(Effects(star=star), lens(), film(pitch, pitch_y))
    x, y = places(pitch, pitch_y)
    way = rotation + line * math.pi / 2.0
    along, across = x * math.cos(way) + y * math.sin(way), y * math.cos(way) - x * math.sin(way)
    near = (np.abs(across) < 2.0 * pitch) & (along > 4.0 * pitch)
    # Where green and red have their first zeros the other colours have light; each falls off as the mean
    # over its spectrum does, which half of the light is within.
    light = found[near] * np.ones(4)
    order = np.argsort(along[near])
    running = np.cumsum(light[order], axis=0) / light.sum(axis=0)
    half = along[near][order][[np.searchsorted(running[:, n], 0.5) for n in range(3)]]
    assert half[0] > half[1] > half[2]
    # Beyond the first zero of green, wavelength F / width, a slit has 10 % of the light at most.
    zero = GREEN * 0.05 / width
    outside = light[along[near] > zero, 1].sum() / light[:, 1].sum()
    assert outside < 0.25
    # A quarter of the light in each line, by both sides.
    # What reaches the border is brightened as an even picture is there.
    assert found[..., 1].sum() == pytest.approx(1.0, abs=1e-2)


def test_a_slits_first_zero_is_at_wavelength_times_focal_length_over_width() -> None:
    """Of one primary's own spectrum a blue and a red line are told apart; here the closed form of the sum."""
    from potmesil_addon.spectrum import primaries_of_wavelengths

    pitch, width = 4e-6, 300e-6
    star = StarFilter(lines=1, strength=1.0, groove_width=width)
    found = spread(Effects(star=star), lens(), film(pitch))
    wavelengths, shares = primaries_of_wavelengths()
    x = places(pitch, fine=50)[0]
    for n in range(3):
        profile = sum(
            share[n] * np.sinc(width * x / (wavelength * 0.05)) ** 2 * width / (wavelength * 0.05)
            for wavelength, share in zip(wavelengths, shares, strict=True)
        )
        wanted = np.clip(profile.reshape(SIDE, 50).mean(axis=1) * pitch, 0.0, None)
        inner = np.abs(np.arange(SIDE) - MIDDLE) < 65
        got = found[:, :, n].sum(axis=0)
        # The light of farther orders, which fades out, is given back to all.
        wanted *= got[inner].sum() / wanted[inner].sum()
        assert np.abs(got - wanted)[inner].max() < 0.02 * wanted.max()


def test_streaks_turn_counter_clockwise() -> None:
    star = StarFilter(lines=1, rotation=math.radians(30.0), strength=1.0, groove_width=5e-6)
    found = spread(Effects(star=star), lens(), film(1e-5))[..., 1]
    # To the right and up: rows count downwards.
    up, right = round(50 * math.sin(math.radians(30.0))), round(50 * math.cos(math.radians(30.0)))
    assert found[MIDDLE - up - 1 : MIDDLE - up + 2, MIDDLE + right].sum() > 1e-4
    assert found[MIDDLE + up - 1 : MIDDLE + up + 2, MIDDLE + right].sum() < 1e-9


ALL = Effects(diffraction=Diffraction(), star=StarFilter(lines=3, strength=0.4))


def test_light_is_kept_and_alpha_untouched() -> None:
    found = spread(ALL, lens(blades=5), film(1e-5))
    assert found[..., :3].sum(axis=(0, 1)) == pytest.approx(1.0, abs=1e-2)
    assert np.array_equal(found[..., 3], np.ones((SIDE, SIDE)))
    assert found[..., :3].min() >= 0.0


def test_an_even_picture_stays_even_to_its_border() -> None:
    picture = np.full((60, 90, 4), 0.7, dtype=np.float32)
    pixels = Film(90e-5, 60e-5, 90, 60)
    assert run(glare(picture, pixels, lens(blades=5), ALL)) == pytest.approx(0.7, abs=1e-5)


def test_light_does_not_come_in_from_the_other_side() -> None:
    picture = np.zeros((80, 80, 4), dtype=np.float32)
    picture[40, 2, :3] = 1e6
    star = StarFilter(lines=1, strength=0.5, groove_width=10e-6)
    found = run(glare(picture, Film(80e-5, 80e-5, 80, 80), lens(), Effects(star=star)))
    assert found[40, 30, 1] > 1.0
    # The streak fades out within 40 pixels.
    assert np.abs(found[:, 60:, :3]).max() < 1e-2


@pytest.mark.parametrize("light", [1e5, 1e30])
def test_rounding_stays_far_below_what_is_spread(light: float) -> None:
    star = StarFilter(lines=1, rotation=0.0, strength=0.1)
    found = run(glare(point(light=light), film(1e-5), lens(), Effects(star=star)))
    assert np.isfinite(found).all()
    assert found[MIDDLE, MIDDLE, 1] > 0.9 * light
    away = np.abs(np.arange(SIDE) - MIDDLE) > 3
    assert np.abs(found[away, :, :3]).max() < 1e-7 * light


def test_no_strength_is_no_change() -> None:
    picture = point()
    off = Effects(
        diffraction=Diffraction(strength=0.0),
        star=StarFilter(strength=0.0),
        image_filter=ImageFilter(strength=0.0),
    )
    assert run(glare(picture, film(1e-5), lens(), off)) is picture


@pytest.fixture
def arrow(tmp_path: Path) -> Path:
    """Return a picture that is bright on its right, red, and on top, green."""
    picture = np.zeros((40, 40, 4), dtype=np.float32)
    picture[..., 3] = 1.0
    picture[18:22, 30:38, 0] = 1.0
    picture[2:10, 18:22, 1] = 1.0
    path = tmp_path / "arrow.png"
    write_png(path, picture)
    return path


@pytest.mark.parametrize("turned", [0.0, 90.0])
def test_a_picture_is_what_a_point_becomes(arrow: Path, turned: float) -> None:
    shape = ImageFilter(str(arrow), strength=0.6, size=0.4, rotation=math.radians(turned))
    found = spread(Effects(image_filter=shape), lens(), film(1e-5))
    assert found[MIDDLE, MIDDLE, 2] == pytest.approx(0.4, abs=1e-6)
    assert found[..., :3].sum() == pytest.approx(3.0, rel=1e-2)
    at = np.arange(SIDE) - MIDDLE
    middles = []
    for n in (0, 1):
        light = found[..., n].copy()
        light[MIDDLE, MIDDLE] = 0.0
        middles.append(
            ((light.sum(axis=0) * at).sum() / light.sum(), -(light.sum(axis=1) * at).sum() / light.sum())
        )
    # 14 of 20 pixels from its middle, which is 40 % of the frame wide.
    out = 14.0 / 40.0 * 0.4 * SIDE
    wanted = [(out, 0.0), (0.0, out)] if turned == 0.0 else [(0.0, out), (-out, 0.0)]
    assert np.array(middles) == pytest.approx(np.array(wanted), abs=0.6)


@pytest.mark.parametrize("primary", [None, 0])
def test_a_picture_may_take_all_of_the_light(tmp_path: Path, primary: int | None) -> None:
    """Also one whose light is far from its middle, or of one colour: no pixel is brightened without end."""
    values = np.zeros((40, 40, 4), dtype=np.float32)
    values[..., 3] = 1.0
    values[2:6, 34:38, slice(0, 3) if primary is None else primary] = 1.0
    path = tmp_path / "corner.png"
    write_png(path, values)
    shape = ImageFilter(str(path), strength=1.0, size=0.9)
    picture = np.random.default_rng(0).random((SIDE, SIDE, 4)).astype(np.float32)
    found = run(glare(picture, film(1e-5), lens(), Effects(image_filter=shape)))
    assert np.isfinite(found).all()
    assert found[..., :3].max() < 4.0 * (1.0 if primary is None else 3.0)


def test_a_round_rim_goes_on_beyond_its_pattern() -> None:
    """Past the reach of the aperture's cells the light falls with the third power of the distance."""
    found = spread(Effects(diffraction=PRIMARIES), lens(f_stop=2.0), film(20e-6, side=401))[200, :, 1]
    for near, far in ((60, 90), (100, 140)):
        means = [found[200 + at - 5 : 200 + at + 6].mean() for at in (near, far)]
        assert means[0] / means[1] == pytest.approx((far / near) ** 3, rel=0.15)


def test_pictures_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    black = tmp_path / "black.png"
    write_png(black, np.zeros((8, 8, 4), dtype=np.float32) + np.array([0, 0, 0, 1], dtype=np.float32))
    for name, error, match in (
        (str(black), SettingsError, "black"),
        (str(tmp_path / "no.png"), InputError, "no picture"),
        (str(tmp_path / "a.jpg"), InputError, "must end in"),
    ):
        with pytest.raises(error, match=match):
            spread(Effects(image_filter=ImageFilter(name)), lens(), film(1e-5))
