"""Several samples made one pixel, as the renderer's own pixel filter would have."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy import optimize

from .lens import FloatArray
from .samples import Float32Array, PixelFilter

_BLACKMAN_HARRIS: Final = (0.35875, 0.48829, 0.14128, 0.01168)
_UNIT_VARIANCE: Final = 0.019184279
"""Variance of the Blackman-Harris window over its width squared."""

_LEAST_VARIANCE: Final = 1.0 / 12.0
"""Variance in pixels squared of the mean of a pixel's own samples; no narrower filter is made of them."""


def filter_down(picture: Float32Array, factor: int, pixel_filter: PixelFilter) -> Float32Array:
    """Filter samples down to pixels, so that together with their own filter they are as wide as a pixel's.

    The kernel is a Blackman-Harris window with the variance that is missing.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, channels)
        Premultiplied samples; rows and columns are multiples of `factor`.
    factor : int
        Samples for each pixel, each way.
    pixel_filter : PixelFilter
        The renderer's filter.

    Returns
    -------
    ndarray of float32 of shape (rows / factor, columns / factor, channels)
        The pixels.
    """
    if factor == 1:
        return picture
    missing = pixel_filter.pixel_variance - pixel_filter.sample_variance / factor**2
    kernel = _kernel(factor, max(missing, _LEAST_VARIANCE))
    reach = (kernel.size - factor) // 2
    result = picture.astype(np.float64)
    for axis in (0, 1):
        lines = np.moveaxis(result, axis, 0)
        padded = np.concatenate([lines[:1]] * reach + [lines] + [lines[-1:]] * reach)
        count = lines.shape[0] // factor
        total = sum(
            weight * padded[k : k + factor * (count - 1) + 1 : factor]
            for k, weight in enumerate(kernel.tolist())
        )
        result = np.moveaxis(np.asarray(total), 0, axis)
    return np.asarray(result, dtype=np.float32)


def _kernel(factor: int, variance: float) -> FloatArray:
    """Return weights of samples around a pixel's middle with a variance in pixels squared, summing to 1."""
    reach = math.ceil(math.sqrt(variance / _UNIT_VARIANCE)) * factor
    offset = (np.arange(-reach, reach + factor) + 0.5 * (1 - factor)) / factor
    offset += (offset[0] + offset[-1]) * -0.5

    def weights(width: float) -> FloatArray:
        phase = 2.0 * math.pi * (offset / width + 0.5)
        a0, a1, a2, a3 = _BLACKMAN_HARRIS
        window = a0 - a1 * np.cos(phase) + a2 * np.cos(2.0 * phase) - a3 * np.cos(3.0 * phase)
        window = np.where(np.abs(offset) < 0.5 * width, np.maximum(window, 0.0), 0.0)
        return np.asarray(window / window.sum())

    def excess(width: float) -> float:
        return float(weights(width) @ (offset * offset)) - variance

    wide = 2.0 * reach / factor
    narrow = max(2.02 * float(np.abs(offset).min()), 1.0 / factor)
    width = wide if excess(wide) <= 0.0 or excess(narrow) >= 0.0 else optimize.brentq(excess, narrow, wide)
    kernel = weights(width)
    unused = int(np.flatnonzero(kernel)[0]) // factor * factor
    return kernel[unused : kernel.size - unused]
