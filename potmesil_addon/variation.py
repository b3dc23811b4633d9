"""How much a picture varies from pixel to pixel, by which errors of resampling and of guesses are judged."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from scipy import ndimage

from . import jit
from .samples import Float32Array

_TRUNCATE: Final = 4.0
"""Standard deviations at which a Gaussian ends."""

_CELLS_PER_SIGMA: Final = 2.0
"""Cells in a standard deviation that pixels are averaged over first, squares as well."""

_BAND_ROWS: Final = 64
"""Rows that one thread works on at a time, which with those around them fit a core's cache."""


def variation(picture: Float32Array, sigma: float, *, compiled: bool) -> Float32Array:
    """Return the standard deviation around each pixel of the mean of red, green and blue.

    Pixels around are weighed by a Gaussian; those beyond the border are as the border's.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Scene-linear.
    sigma : float
        Standard deviation in pixels of the Gaussian.
    compiled : bool
        Whether to take the compiled kernel or scipy; both give the same but for rounding.

    Returns
    -------
    ndarray of float32 of shape (rows, columns)
        0 or more.
    """
    cell = max(1, int(sigma / _CELLS_PER_SIGMA))
    shape = -(-picture.shape[0] // cell), -(-picture.shape[1] // cell)
    powers = np.empty((2, *shape))
    if compiled:
        reach = int(_TRUNCATE * sigma / cell + 0.5)
        weights = np.exp(-0.5 * (np.arange(reach + 1) * cell / sigma) ** 2)
        _find_powers(picture, cell, powers)
        spread = np.empty(shape, dtype=np.float32)
        _find_spread(powers, weights / (2.0 * weights.sum() - weights[0]), spread)
    else:
        level = picture[..., :3].mean(axis=2, dtype=np.float64)
        rows, columns = (np.arange(0, size, cell) for size in level.shape)
        pixels = np.diff(np.append(rows, level.shape[0]))[:, np.newaxis] * np.diff(
            np.append(columns, level.shape[1])
        )
        for power in range(2):
            cells = np.add.reduceat(np.add.reduceat(level ** (power + 1), rows), columns, axis=1) / pixels
            powers[power] = ndimage.gaussian_filter(cells, sigma / cell, mode="nearest", truncate=_TRUNCATE)
        spread = np.sqrt(np.maximum(powers[1] - powers[0] * powers[0], 0.0)).astype(np.float32)
    if cell > 1:
        spread = np.repeat(np.repeat(spread, cell, axis=0), cell, axis=1)
    return spread[: picture.shape[0], : picture.shape[1]]


@jit.kernel(parallel=True)
def _find_powers(picture: Any, cell: int, powers: Any) -> None:
    """Average the level, and its square, over cells of pixels."""
    rows, columns = picture.shape[:2]
    for row in jit.prange(powers.shape[1]):
        y: Any = np.int64(row)
        for x in range(powers.shape[2]):
            first, second = 0.0, 0.0
            bottom, right = min((y + 1) * cell, rows), min((x + 1) * cell, columns)
            for v in range(y * cell, bottom):
                for u in range(x * cell, right):
                    light = float(picture[v, u, 0]) + float(picture[v, u, 1]) + float(picture[v, u, 2])
                    level = light / 3.0
                    first += level
                    second += level * level
            pixels = (bottom - y * cell) * (right - x * cell)
            powers[0, y, x], powers[1, y, x] = first / pixels, second / pixels


@jit.kernel(parallel=True)
def _find_spread(powers: Any, weights: Any, spread: Any) -> None:
    """Blur both along the rows of a band and of those around it, then along its columns."""
    rows, columns = spread.shape
    reach = weights.size - 1
    for number in jit.prange((rows + _BAND_ROWS - 1) // _BAND_ROWS):
        top: Any = np.int64(number) * _BAND_ROWS
        bottom = min(top + _BAND_ROWS, rows)
        first, last = max(top - reach, 0), min(bottom + reach, rows)
        line = np.empty(columns + 2 * reach)
        blurred = np.empty((2, last - first, columns))
        for power in range(2):
            for y in range(first, last):
                for x in range(columns + 2 * reach):
                    line[x] = powers[power, y, min(max(x - reach, 0), columns - 1)]
                for x in range(columns):
                    blurred[power, y - first, x] = weights[0] * line[x + reach]
                for k in range(1, reach + 1):
                    for x in range(columns):
                        both = line[x + reach - k] + line[x + reach + k]
                        blurred[power, y - first, x] += weights[k] * both
        total = np.empty((2, columns))
        for y in range(top, bottom):
            for power in range(2):
                for x in range(columns):
                    total[power, x] = 0.0
                for k in range(-reach, reach + 1):
                    v, weight = min(max(y + k, 0), rows - 1) - first, weights[abs(k)]
                    for x in range(columns):
                        total[power, x] += weight * blurred[power, v, x]
            for x in range(columns):
                spread[y, x] = math.sqrt(max(total[1, x] - total[0, x] * total[0, x], 0.0))
