"""Samples made pixels as the renderer's own filter would."""

from __future__ import annotations

import numpy as np
import pytest

from potmesil_addon.errors import SettingsError
from potmesil_addon.pixel_filter import filter_down
from potmesil_addon.samples import PixelFilter

BLACKMAN_HARRIS = 0.019184279 * 3.0**2
"""Variance in pixels squared of Blender's default filter, 3 pixels wide."""


def spread(factor: int, pixel_filter: PixelFilter) -> tuple[float, float]:
    """Return the sum and the variance in pixels squared of what one sample becomes, over all its places."""
    count = 24
    total, variance = 0.0, 0.0
    for place in range(factor):
        samples = np.zeros((count * factor, count * factor, 1), dtype=np.float32)
        at = 12 * factor + place
        samples[:, at] = 1.0
        pixels = filter_down(samples, factor, pixel_filter)[count // 2, :, 0].astype(np.float64)
        off = np.arange(count) + 0.5 - (at + 0.5) / factor
        total += pixels.sum()
        variance += pixels @ (off * off)
    return total, variance / total


@pytest.mark.parametrize("factor", [2, 3, 4])
@pytest.mark.parametrize("sample_variance", [0.0, BLACKMAN_HARRIS])
@pytest.mark.parametrize("width", [2.8, 3.0, 4.0])
def test_both_filters_together_are_as_wide_as_the_pixels(
    factor: int, sample_variance: float, width: float
) -> None:
    wanted = 0.019184279 * width**2
    total, variance = spread(factor, PixelFilter(wanted, sample_variance))
    assert total == pytest.approx(1.0, abs=1e-6)
    assert variance + sample_variance / factor**2 == pytest.approx(wanted, rel=1e-3)


def test_never_narrower_than_the_mean_of_a_pixel() -> None:
    _, variance = spread(4, PixelFilter(0.0, 0.5))
    assert variance == pytest.approx(1.0 / 12.0, rel=1e-3)


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_even_color_stays(factor: int) -> None:
    samples = np.full((4 * factor, 5 * factor, 4), 0.7, dtype=np.float32)
    pixels = filter_down(samples, factor, PixelFilter(BLACKMAN_HARRIS, BLACKMAN_HARRIS))
    assert pixels.shape == (4, 5, 4)
    np.testing.assert_allclose(pixels, 0.7, rtol=1e-6)


def test_one_sample_a_pixel_is_the_pixel() -> None:
    samples = np.random.default_rng(1).random((5, 4, 4)).astype(np.float32)
    assert filter_down(samples, 1, PixelFilter(BLACKMAN_HARRIS, 0.0)).tobytes() == samples.tobytes()


@pytest.mark.parametrize("values", [(-1.0, 0.0), (0.1, float("nan")), (float("inf"), 0.1)])
def test_filters_that_cannot_be(values: tuple[float, float]) -> None:
    with pytest.raises(SettingsError, match="variance"):
        PixelFilter(*values)


def test_points_mix_no_surfaces() -> None:
    assert PixelFilter(BLACKMAN_HARRIS, 1e-5).makes_points
    assert not PixelFilter(BLACKMAN_HARRIS, BLACKMAN_HARRIS).makes_points
