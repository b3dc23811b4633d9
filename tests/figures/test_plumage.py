"""The picture on the cube is as rich as a photograph: detail at every scale, every hue, an eye in it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import rgb_to_hsv
from scipy import ndimage

from sample_scenes.plumage import plumage

SIDE = 256


@pytest.fixture(scope="module")
def picture():
    return plumage(SIDE)


def spectrum(picture):
    """Return energies and frequencies (cycles a pixel) of a picture's luminance, without its mean."""
    grey = picture @ [0.2126, 0.7152, 0.0722]
    side = grey.shape[0]
    window = np.outer(np.hanning(side), np.hanning(side))
    energy = np.abs(np.fft.fft2((grey - grey.mean()) * window)) ** 2
    return energy, np.hypot(np.fft.fftfreq(side)[:, np.newaxis], np.fft.fftfreq(side))


def fine_share(picture):
    energy, frequency = spectrum(picture)
    return energy[frequency > 1 / 8].sum() / energy[frequency > 1.5 / SIDE].sum()


def test_display_values_of_the_asked_shape(picture):
    assert picture.shape == (SIDE, SIDE, 3)
    assert picture.dtype == np.float64
    assert picture.min() >= 0.0
    assert picture.max() <= 1.0


def test_the_same_seed_draws_the_same_picture(picture):
    assert np.array_equal(plumage(64), plumage(64))
    assert not np.allclose(plumage(64), plumage(64, seed=1), atol=0.1)


def test_amplitudes_fall_as_one_over_the_frequency(picture):
    # Photographs of nature have exponents from 0.8 to 1.5 (Tolhurst, Tadmor and Chao, 1992).
    energy, frequency = spectrum(picture)
    edges = np.geomspace(4 / SIDE, 0.45, 12)
    bands = [(frequency >= low) & (frequency < high) for low, high in pairwise(edges)]
    amplitude = [np.sqrt(energy[band].mean()) for band in bands]
    slope = np.polyfit(np.log(np.sqrt(edges[1:] * edges[:-1])), np.log(amplitude), 1)[0]
    assert -1.5 < slope < -0.8


def test_fine_octaves_have_their_share(picture):
    blurred = ndimage.gaussian_filter(picture, (2.0, 2.0, 0.0))
    assert fine_share(picture) > 0.12
    assert fine_share(blurred) < 0.02


def test_every_hue_and_white_are_there(picture):
    hue, saturation, value = np.moveaxis(rgb_to_hsv(picture), 2, 0)
    vivid = (saturation > 0.5) & (value > 0.35)
    shares = np.histogram(hue[vivid], 12, (0.0, 1.0))[0] / hue.size
    assert shares.min() > 0.005
    assert vivid.mean() > 0.4
    assert ((saturation < 0.15) & (value > 0.75)).mean() > 0.05


def test_an_eye_looks_out_of_it_upright(picture):
    def around(x, y):
        rows, columns = (
            slice(round(y * SIDE) - 3, round(y * SIDE) + 4),
            slice(round(x * SIDE) - 3, round(x * SIDE) + 4),
        )
        return picture[rows, columns].mean(axis=(0, 1))

    pupil, iris, highlight = around(0.46, 0.46), around(0.53, 0.44), around(0.42, 0.40)
    assert pupil.max() < 0.1
    assert iris[0] > 0.6
    assert iris[2] < 0.3
    assert highlight.min() > 0.8
    # Scarlet above, blue below.
    assert np.argmax(picture[: SIDE // 12].mean(axis=(0, 1))) == 0
    assert np.argmax(picture[-SIDE // 12 :].mean(axis=(0, 1))) == 2
