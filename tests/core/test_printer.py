"""Uniform defocus and fades of the finished picture."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from potmesil_addon.camera import Film
from potmesil_addon.errors import SettingsError
from potmesil_addon.lens import Lens
from potmesil_addon.printer import defocus_evenly, fade
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window

from .helpers import ellipse_coverage

FILM = Film(0.030, 0.020, 60, 40)
ROUND = Lens(1.0, 1.0, math.inf)


def random_picture(rows: int = 40, columns: int = 60) -> np.ndarray:
    rng = np.random.default_rng(5)
    return rng.uniform(0.0, 1.0, (rows, columns, 4)).astype(np.float32)


def test_a_point_becomes_the_circle() -> None:
    picture = np.zeros((40, 60, 4), dtype=np.float32)
    picture[20, 30] = 1.0
    # 3.1 mm on pixels of half a millimetre.
    blurred = run(defocus_evenly(picture, FILM, 3.1e-3, ROUND))
    disc = ellipse_coverage(3.1, 3.1, 10, 0.5)
    size = disc.shape[0] // 2
    seen = blurred[20 - size : 21 + size, 30 - size : 31 + size, 0]
    np.testing.assert_allclose(seen, disc, atol=1e-6)


@pytest.mark.parametrize("backend", ["numba", "numpy"])
def test_it_is_a_convolution_with_brightness_kept_at_the_border(backend: str) -> None:
    picture = random_picture()
    disc = ellipse_coverage(2.4, 2.4, 7, 0.5)
    blurred = run(defocus_evenly(picture, FILM, 2.4e-3, ROUND, backend))
    reach = ndimage.convolve(np.ones((40, 60)), disc, mode="constant")
    for channel in range(4):
        expected = ndimage.convolve(picture[..., channel].astype(float), disc, mode="constant") / reach
        np.testing.assert_allclose(blurred[..., channel], expected, atol=1e-6)


def test_a_flat_picture_stays_flat() -> None:
    flat = np.full((40, 60, 4), 0.37, dtype=np.float32)
    np.testing.assert_allclose(run(defocus_evenly(flat, FILM, 5e-3, ROUND)), flat, rtol=1e-6)


def test_the_iris_gives_the_shape() -> None:
    picture = np.zeros((40, 60, 4), dtype=np.float32)
    picture[20, 30] = 1.0
    square = replace(ROUND, blades=4, blade_rotation=math.radians(45.0))
    lit = run(defocus_evenly(picture, FILM, 6e-3, square))[..., 0] > 1e-4
    # A square with its corners on the circle; a full circle would light 113 pixels.
    assert 60 <= lit.sum() <= 100


def test_fade_leaves_alpha() -> None:
    picture = random_picture()
    faded = fade(picture, 0.25)
    np.testing.assert_array_equal(faded[..., :3], picture[..., :3] * np.float32(0.25))
    np.testing.assert_array_equal(faded[..., 3], picture[..., 3])
    assert not fade(picture, 0.0)[..., :3].any()


def still(*, film: Film | None = FILM) -> Samples:
    layer = SampleLayer("", random_picture(), np.linspace(1.0, 9.0, 2400, dtype=np.float32).reshape(40, 60))
    window = Window(0, 0, 60, 40)
    return Samples((layer,), window, window, lens=LensAttributes(0.05, 1.4, 3.0), film=film)


def test_off_it_is_the_same_picture_to_the_bit() -> None:
    plain = run(process(still(), ProcessSettings()))
    off = run(process(still(), ProcessSettings(uniform_defocus=0.0, fade=1.0)))
    np.testing.assert_array_equal(off.picture, plain.picture)


def test_process_defocuses_what_the_lens_made_and_then_fades() -> None:
    camera = run(process(still(), ProcessSettings())).picture
    result = run(process(still(), ProcessSettings(uniform_defocus=2e-3, fade=0.5)))
    expected = fade(run(defocus_evenly(camera, FILM, 2e-3, ROUND)), 0.5)
    np.testing.assert_allclose(result.picture, expected, atol=1e-7)
    assert result.report["uniform_defocus_mm"] == pytest.approx(2.0)
    assert result.report["fade"] == 0.5


def test_without_a_lens_every_depth_is_blurred_alike() -> None:
    settings = ProcessSettings(use_lens=False, uniform_defocus=2e-3)
    one = still()
    other = replace(one, layers=(replace(one.layers[0], depth=None),))
    np.testing.assert_array_equal(run(process(one, settings)).picture, run(process(other, settings)).picture)


def test_supersampled_pictures_are_defocused_by_the_same_circle() -> None:
    large = np.repeat(np.repeat(random_picture(20, 30), 2, axis=0), 2, axis=1)
    window = Window(0, 0, 60, 40)
    samples = Samples((SampleLayer("", large),), window, window, supersampling=2, film=FILM)
    settings = ProcessSettings(use_lens=False, use_motion=False, uniform_defocus=4e-3)
    expected = run(defocus_evenly(random_picture(20, 30), replace(FILM, columns=30, rows=20), 4e-3, ROUND))
    np.testing.assert_allclose(run(process(samples, settings)).picture, expected, atol=1e-6)


def test_a_defocus_needs_the_film() -> None:
    with pytest.raises(SettingsError, match="--sensor-width"):
        run(process(still(film=None), ProcessSettings(use_lens=False, uniform_defocus=1e-3)))


@pytest.mark.parametrize("value", [-0.1, math.inf, math.nan])
@pytest.mark.parametrize("name", ["uniform_defocus", "fade"])
def test_values_out_of_range_are_refused(name: str, value: float) -> None:
    with pytest.raises(SettingsError, match="0 or more"):
        ProcessSettings(**{name: value})
