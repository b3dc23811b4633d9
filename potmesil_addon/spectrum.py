"""The visible spectrum: how much of red, green and blue each wavelength is."""

from __future__ import annotations

import functools
from typing import Final

import numpy as np

from .lens import FloatArray

_STEP: Final = 10e-9
_FIRST: Final = 380e-9

_CIE_1931: Final = np.array(
    [
        (0.001368, 0.000039, 0.006450), (0.004243, 0.000120, 0.020050), (0.014310, 0.000396, 0.067850),
        (0.043510, 0.001210, 0.207400), (0.134380, 0.004000, 0.645600), (0.283900, 0.011600, 1.385600),
        (0.348280, 0.023000, 1.747060), (0.336200, 0.038000, 1.772110), (0.290800, 0.060000, 1.669200),
        (0.195360, 0.090980, 1.287640), (0.095640, 0.139020, 0.812950), (0.032010, 0.208020, 0.465180),
        (0.004900, 0.323000, 0.272000), (0.009300, 0.503000, 0.158200), (0.063270, 0.710000, 0.078250),
        (0.165500, 0.862000, 0.042160), (0.290400, 0.954000, 0.020300), (0.433450, 0.994950, 0.008750),
        (0.594500, 0.995000, 0.003900), (0.762100, 0.952000, 0.002100), (0.916300, 0.870000, 0.001650),
        (1.026300, 0.757000, 0.001100), (1.062200, 0.631000, 0.000800), (1.002600, 0.503000, 0.000340),
        (0.854450, 0.381000, 0.000190), (0.642400, 0.265000, 0.000050), (0.447900, 0.175000, 0.000020),
        (0.283500, 0.107000, 0.000000), (0.164900, 0.061000, 0.000000), (0.087400, 0.032000, 0.000000),
        (0.046770, 0.017000, 0.000000), (0.022700, 0.008210, 0.000000), (0.011359, 0.004102, 0.000000),
        (0.005790, 0.002091, 0.000000), (0.002899, 0.001047, 0.000000), (0.001440, 0.000520, 0.000000),
        (0.000690, 0.000249, 0.000000), (0.000332, 0.000120, 0.000000), (0.000166, 0.000060, 0.000000),
        (0.000083, 0.000030, 0.000000), (0.000042, 0.000015, 0.000000),
    ]
)  # fmt: skip
"""Colour matching functions of the CIE 1931 2 degree observer, 380 to 780 nm by 10 nm (CIE 015)."""

_XYZ_TO_REC_709: Final = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
"""ITU-R BT.709 primaries; the rows of each primary are scaled to a white of equal energy afterwards."""


@functools.cache
def primaries_of_wavelengths() -> tuple[FloatArray, FloatArray]:
    """Return how much of an even spectrum's red, green and blue comes from each wavelength.

    Returns
    -------
    wavelengths : ndarray of float64 of shape (41,)
        In metres, rising.
    shares : ndarray of float64 of shape (41, 3)
        Add up to 1 for each primary, so that white stays white. Negative where a pure colour lies outside of
        what the primaries can show.
    """
    wavelengths = _FIRST + _STEP * np.arange(len(_CIE_1931))
    shares = _CIE_1931 @ _XYZ_TO_REC_709.T
    return np.asarray(wavelengths), np.asarray(shares / shares.sum(axis=0))
