"""How much a picture varies: against sums over all pixels, and both implementations against each other."""

from __future__ import annotations

import numpy as np
import pytest

from potmesil_addon import jit
from potmesil_addon.variation import variation

needs_numba = pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")
backends = pytest.mark.parametrize("compiled", [pytest.param(True, marks=needs_numba), False])


@backends
def test_is_the_weighted_standard_deviation(compiled):
    rng = np.random.default_rng(3)
    picture = rng.random((19, 23, 4), dtype=np.float32)
    level = np.pad(picture[..., :3].mean(axis=2, dtype=np.float64), 4, mode="edge")
    weight = np.exp(-0.5 * np.arange(-4, 5) ** 2 / 1.0)
    weight = np.outer(weight, weight) / weight.sum() ** 2
    found = variation(picture, 1.0, compiled=compiled)
    for y, x in ((0, 0), (7, 11), (18, 22), (3, 20)):
        around = level[y : y + 9, x : x + 9]
        mean = (weight * around).sum()
        assert found[y, x] == pytest.approx(np.sqrt((weight * (around - mean) ** 2).sum()), rel=1e-4)


@backends
@pytest.mark.parametrize("sigma", [1.0, 8.0])
def test_even_picture_does_not_vary(compiled, sigma):
    assert variation(np.full((30, 41, 4), 0.25, dtype=np.float32), sigma, compiled=compiled).max() < 1e-6


@backends
def test_fine_noise_counts_where_pixels_are_averaged_first(compiled):
    """Noise of one standard deviation, in one channel of three, however wide the Gaussian."""
    rng = np.random.default_rng(5)
    picture = np.full((120, 130, 4), 10.0, dtype=np.float32)
    picture[..., 0] += rng.standard_normal((120, 130))
    found = variation(picture, 8.0, compiled=compiled)
    assert found.mean() == pytest.approx(1.0 / 3.0, rel=0.05)


@needs_numba
@pytest.mark.parametrize("shape", [(1, 1), (2, 67), (131, 70)])
@pytest.mark.parametrize("sigma", [1.0, 8.0])
def test_both_implementations_agree(shape, sigma):
    picture = np.random.default_rng(7).random((*shape, 4), dtype=np.float32) ** 4
    both = [variation(picture, sigma, compiled=compiled) for compiled in (True, False)]
    assert both[0].shape == shape
    np.testing.assert_allclose(both[0], both[1], atol=1e-6)
