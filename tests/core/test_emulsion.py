"""Exposure in stops, photons by Poisson's law, grain by its measured granularity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import ndimage, stats

from potmesil_addon.camera import Film
from potmesil_addon.effects import Exposure, FilmGrain, SensorNoise
from potmesil_addon.emulsion import add_grain, add_noise, exposure_factor
from potmesil_addon.errors import SettingsError
from potmesil_addon.samples import Float32Array

from .helpers import Array


def even(value: float, rows: int = 300, columns: int = 400, alpha: float = 1.0) -> Float32Array:
    picture = np.full((rows, columns, 4), value, dtype=np.float32)
    picture[..., 3] = alpha
    return picture


def film_of(picture: Float32Array, pitch_x: float, pitch_y: float | None = None) -> Film:
    rows, columns = picture.shape[:2]
    return Film(columns * pitch_x, rows * (pitch_y or pitch_x), columns, rows)


def test_the_normal_exposure_value_changes_nothing() -> None:
    # f/8 and 1/60 s at ISO 100: log2(64 * 60).
    normal = Exposure(normal_ev=math.log2(64.0 * 60.0))
    assert exposure_factor(normal, 8.0, 1.0 / 60.0) == pytest.approx((1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("exposure", "f_stop", "seconds", "stops"),
    [
        (Exposure(sensitivity=200.0), 4.0, 0.02, 1.0),
        (Exposure(), 4.0 / math.sqrt(2.0), 0.02, 1.0),
        (Exposure(), 4.0, 0.04, 1.0),
        (Exposure(sensitivity=400.0), 8.0, 0.02, 0.0),
        (Exposure(density=3.0), 4.0, 0.02, -3.0),
        (Exposure(normal_ev=10.6), 4.0, 0.02, 2.0),
    ],
)
def test_a_stop_is_a_factor_of_two(exposure: Exposure, f_stop: float, seconds: float, stops: float) -> None:
    reference = exposure_factor(Exposure(), 4.0, 0.02)[1]
    assert exposure_factor(exposure, f_stop, seconds)[1] / reference == pytest.approx(2.0**stops)


def test_a_tint_is_a_share_for_each_primary() -> None:
    plain = exposure_factor(Exposure(), 4.0, 0.02)
    tinted = exposure_factor(Exposure(tint=(1.0, 0.5, 0.0)), 4.0, 0.02)
    assert tinted == pytest.approx((plain[0], 0.5 * plain[1], 0.0))


@pytest.mark.parametrize(("f_stop", "seconds"), [(0.0, 0.1), (4.0, 0.0), (4.0, math.inf), (math.nan, 0.1)])
def test_what_exposes_nothing_is_refused(f_stop: float, seconds: float) -> None:
    with pytest.raises(SettingsError, match="greater than 0"):
        exposure_factor(Exposure(), f_stop, seconds)


@pytest.mark.parametrize("value", [0.0, 0.003, 0.05, 1.0, 8.0])
@pytest.mark.parametrize("sensitivity", [100.0, 3200.0])
def test_noise_is_that_of_photons_and_of_reading_out(value: float, sensitivity: float) -> None:
    noise = SensorNoise(full_well=40_000.0, read_noise=5.0)
    electrons = 40_000.0 * 100.0 / sensitivity
    values = add_noise(even(value), noise, sensitivity, 1)[..., :3].astype(np.float64) * electrons
    wanted = value * electrons + 25.0
    count = values.size
    assert values.mean() == pytest.approx(value * electrons, abs=5.0 * math.sqrt(wanted / count))
    assert values.var() == pytest.approx(wanted, rel=6.0 * math.sqrt(2.0 / count))


def test_photons_past_the_bound_are_those_of_the_normal_law() -> None:
    """From 1000 on; the largest difference of the two distributions is 0.2 % there."""
    values = add_noise(even(2.0), SensorNoise(full_well=1000.0, read_noise=0.0), 100.0, 3)[..., :3] * 1000.0
    counts = np.sort(values.reshape(-1).astype(np.float64))
    difference = np.abs(stats.poisson.cdf(counts, 2000.0) - np.arange(counts.size) / counts.size).max()
    assert difference < 0.02


def test_few_photons_come_by_poissons_law() -> None:
    values = add_noise(even(0.4), SensorNoise(full_well=10.0, read_noise=0.0), 100.0, 3)[..., :3] * 10.0
    counts = np.bincount(np.rint(values).astype(int).reshape(-1))
    assert np.abs(values - np.rint(values)).max() < 1e-4
    expected = stats.poisson.pmf(np.arange(counts.size), 4.0) * values.size
    enough = expected > 20.0
    chi_square = (((counts - expected) ** 2) / expected)[enough].sum()
    assert chi_square < stats.chi2.ppf(0.9999, enough.sum())


def test_photons_are_as_skewed_as_they_should_up_to_the_bound() -> None:
    values = add_noise(even(0.9), SensorNoise(full_well=1000.0, read_noise=0.0), 100.0, 3)[..., :3]
    assert stats.skew(values.reshape(-1)) == pytest.approx(1.0 / math.sqrt(900.0), abs=0.02)


@pytest.mark.parametrize("what", ["noise", "grain"])
def test_a_frame_always_has_its_own(what: str) -> None:
    picture = even(0.3, 40, 60)

    def made(seed: int, frame: int) -> Float32Array:
        if what == "noise":
            return add_noise(picture, SensorNoise(seed=seed), 100.0, frame)
        return add_grain(picture, FilmGrain(seed=seed), film_of(picture, 1e-5), frame)

    kinds = [made(0, 7), made(1, 7), made(0, 8), made(0, -7), made(0, 0)]
    assert np.array_equal(kinds[0], made(0, 7))
    for n, a in enumerate(kinds):
        assert np.array_equal(a[..., 3], picture[..., 3])
        for b in kinds[n + 1 :]:
            assert abs(np.corrcoef(a[..., 0].reshape(-1), b[..., 0].reshape(-1))[0, 1]) < 0.1


def test_clear_film_has_no_noise_and_black_no_grain() -> None:
    clear = even(0.0, alpha=0.0)
    assert np.array_equal(add_noise(clear, SensorNoise(), 100.0, 1), clear)
    black = even(0.0)
    assert np.array_equal(add_grain(black, FilmGrain(), film_of(black, 1e-5), 1), black)


def test_highlights_and_negative_light_stay_finite() -> None:
    picture = even(1e30)
    picture[:10, :, :3] = -1.0
    picture[10:20, :, :3] = 3e38
    assert np.isfinite(add_noise(picture, SensorNoise(), 100.0, 1)).all()
    picture[10:20, :, :3] = 1e30
    assert np.isfinite(add_grain(picture, FilmGrain(), film_of(picture, 1e-5), 1)).all()


def density_of(picture: Float32Array, value: float) -> Array:
    return -np.log10(picture[..., :3].astype(np.float64) / value)


@pytest.mark.parametrize("pitch", [2e-6, 3e-6])
@pytest.mark.parametrize("size", [8e-6, 20e-6])
@pytest.mark.parametrize("squeeze", [1.0, 1.5])
def test_granularity_is_what_a_disc_of_48_um_sees(pitch: float, size: float, squeeze: float) -> None:
    picture = even(0.5, 500, 600)
    grain = FilmGrain(granularity=12.0, size=size, color=1.0)
    film = film_of(picture, pitch, pitch * squeeze)
    density = density_of(add_grain(picture, grain, film, 4), 0.5)
    # Coverage of pixels by the disc, from points within each.
    half = math.ceil(24e-6 / pitch) + 1
    fine = (np.arange((2 * half + 1) * 16) + 0.5) / 16 - half - 0.5
    inside = np.hypot(fine * pitch, fine[:, np.newaxis] * pitch * squeeze) <= 24e-6
    disc = inside.reshape(2 * half + 1, 16, 2 * half + 1, 16).mean(axis=(1, 3))
    seen = [
        ndimage.convolve(density[..., n], disc / disc.sum(), mode="wrap")[::2, ::2].std() for n in range(3)
    ]
    # Standard error of a deviation over some thousands of discs beside each other is a hundredth.
    assert np.mean(seen) == pytest.approx(12.0 / 1000.0, rel=0.03)


@pytest.mark.parametrize("times", [4, 16])
def test_large_pixels_have_the_grain_of_the_small_ones_in_them(times: int) -> None:
    fine, coarse = even(0.5, 1024, 1024), even(0.5)
    grain = FilmGrain(granularity=3.0, size=12e-6)
    density = density_of(add_grain(fine, grain, film_of(fine, 3e-6), 1), 0.5)
    means = density.reshape(1024 // times, times, 1024 // times, times, 3).mean(axis=(1, 3))
    found = density_of(add_grain(coarse, grain, film_of(coarse, 3e-6 * times), 1), 0.5).std()
    assert found == pytest.approx(means.std(), rel=0.03)


def test_pixels_far_larger_than_grains_follow_selwyns_law() -> None:
    found = []
    for pitch in (200e-6, 400e-6):
        picture = even(0.5)
        found.append(density_of(add_grain(picture, FilmGrain(), film_of(picture, pitch), 1), 0.5).std())
    assert found[0] / found[1] == pytest.approx(2.0, rel=0.02)
    # Deviation times the square root of the area is that of the disc, but for the grains at its rim.
    assert found[0] * 200e-6 == pytest.approx(0.010 * math.sqrt(math.pi) * 24e-6, rel=0.05)


def test_grain_keeps_the_mean_brightness() -> None:
    picture = even(0.5, 600, 800)
    grainy = add_grain(picture, FilmGrain(granularity=60.0), film_of(picture, 4e-6), 2)[..., :3]
    assert grainy.std() > 0.2
    assert grainy.mean(dtype=np.float64) == pytest.approx(0.5, rel=0.02)


def test_grains_are_as_large_as_they_are() -> None:
    """The Gaussian of a disc's second moment has correlations down to 1/e at half of its diameter."""
    picture = even(0.5, 400, 400)
    density = density_of(add_grain(picture, FilmGrain(size=32e-6), film_of(picture, 2e-6), 1), 0.5)[..., 1]
    spectrum = np.abs(np.fft.fft2(density)) ** 2
    correlation = np.real(np.fft.ifft2(spectrum))
    correlation /= correlation[0, 0]
    # exp(-d^2 / (4 sigma^2)) with sigma a quarter of the diameter.
    for pixels in (4, 8, 12):
        wanted = math.exp(-((pixels * 2e-6) ** 2) / (4.0 * 8e-6**2))
        assert correlation[0, pixels] == pytest.approx(wanted, abs=0.08)
        assert correlation[pixels, 0] == pytest.approx(wanted, abs=0.08)


@pytest.mark.parametrize(("color", "wanted"), [(0.0, 1.0), (0.5, 0.5), (1.0, 0.0)])
def test_emulsions_share_as_much_of_their_grain_as_is_said(color: float, wanted: float) -> None:
    picture = even(0.5)
    grain = FilmGrain(color=color)
    density = density_of(add_grain(picture, grain, film_of(picture, 2e-5), 1), 0.5).reshape(-1, 3)
    found = np.corrcoef(density.T)
    assert found[0, 1] == pytest.approx(wanted, abs=0.02)
    assert found[1, 2] == pytest.approx(wanted, abs=0.02)
    assert density.std(axis=0).std() < 0.02 * density.std()


def test_the_coarsest_grain_lets_light_through() -> None:
    picture = even(0.5, 600, 800)
    grainy = add_grain(picture, FilmGrain(granularity=200.0, size=1e-6), film_of(picture, 1e-6), 1)
    assert grainy[..., :3].mean(dtype=np.float64) == pytest.approx(0.5, rel=0.02)


def test_no_granularity_is_no_grain() -> None:
    picture = even(0.5)
    assert add_grain(picture, FilmGrain(granularity=0.0), film_of(picture, 1e-5), 1) is picture
