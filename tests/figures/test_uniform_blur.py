"""Uniform blur through the frequency domain (1983, figure 4) against closed forms and against space."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from figures import uniform_blur
from figures.workshop import Workshop

SIDE, DISPLACEMENT = 96, 8


def noise() -> uniform_blur.FloatArray:
    """Return a picture that has every frequency."""
    return np.random.default_rng(1983).random((SIDE, SIDE, 3))


def test_the_spectrum_is_dark_where_the_motion_is_whole_periods_and_nowhere_else():
    blur = uniform_blur.uniform_blur(noise(), DISPLACEMENT)
    lost = uniform_blur.magnitude_over_v(blur.product) / uniform_blur.magnitude_over_v(blur.spectrum)
    dark = np.flatnonzero(lost < 1e-9)
    # u = m / a, and across it, not along: bands stand upright.
    m = blur.across[dark] * DISPLACEMENT
    assert sorted(np.rint(m)) == [-4, -3, -2, -1, 1, 2, 3]
    assert m == pytest.approx(np.rint(m), abs=1e-12)
    assert blur.zeros * DISPLACEMENT == pytest.approx([1, 2, 3, 4])
    ua = blur.across * DISPLACEMENT
    assert lost == pytest.approx(np.abs(np.sinc(ua)), abs=1e-9)


@pytest.mark.parametrize("cycles", [1, 5, 17])
def test_waves_become_the_mean_of_what_passes_by(cycles):
    # The mean of cos(k (x - s)) over 0 <= s <= a, which moves it to the right.
    k, x = 2.0 * np.pi * cycles / SIDE, np.arange(SIDE)
    mean = (np.sin(k * x) - np.sin(k * (x - DISPLACEMENT))) / (k * DISPLACEMENT)
    picture = np.broadcast_to(1.0 + np.cos(k * x)[:, np.newaxis], (SIDE, SIDE, 3))
    blur = uniform_blur.uniform_blur(picture, DISPLACEMENT)
    assert blur.blurred[SIDE // 2, :, 0] == pytest.approx(1.0 + mean, abs=1e-12)


def test_in_space_it_is_a_box_that_ends_within_pixels():
    picture = noise()
    blurred = uniform_blur.blurred_in_space(picture, DISPLACEMENT)
    # From the middle of the first pixel to the middle of the last.
    box = np.array([0.5, *[1.0] * (DISPLACEMENT - 1), 0.5]) / DISPLACEMENT
    expected = np.convolve(picture[3, :, 1], box)[:SIDE]
    assert blurred[3, :, 1] == pytest.approx(expected, abs=1e-6)


def test_both_ways_blur_a_smooth_picture_alike_where_nothing_comes_in():
    k, x = 2.0 * np.pi * 3 / SIDE, np.arange(SIDE)
    picture = np.broadcast_to(1.0 + np.cos(k * x)[:, np.newaxis], (SIDE, SIDE, 3))
    blur = uniform_blur.uniform_blur(picture, DISPLACEMENT)
    inside = blur.inside(blur.blurred)
    in_space = blur.inside(uniform_blur.blurred_in_space(picture, DISPLACEMENT))
    assert inside.shape == (SIDE - DISPLACEMENT, SIDE - DISPLACEMENT, 3)
    # A pixel's integral is sinc(u) less than its value, and its aliases are as small.
    assert in_space == pytest.approx(inside, abs=2.0 * (1.0 - np.sinc(3 / SIDE)))


def test_brightness_is_kept():
    picture = noise()
    blurred = uniform_blur.uniform_blur(picture, DISPLACEMENT).blurred
    assert blurred.mean(axis=(0, 1)) == pytest.approx(picture.mean(axis=(0, 1)), rel=1e-12)
    # Each row keeps its own: nothing moves up or down.
    assert blurred.mean(axis=1) == pytest.approx(picture.mean(axis=1), rel=1e-12)


def test_the_figure_is_drawn(tmp_path: Path):
    drawing = uniform_blur.FIGURES[0].draw(Workshop(tmp_path, percentage=25))
    with Image.open(drawing.path) as image:
        assert 200 < image.width < 450
        assert 250 < image.height < 500
    assert drawing.numbers["displacement_pixels"] == 8
    assert drawing.numbers["brightness"] == pytest.approx(1.0)
    # In space and through frequencies differ by the integral over pixels alone.
    assert drawing.numbers["in_space_db"] > 40.0
