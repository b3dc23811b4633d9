"""The spectrum: the standard observer's table and the primaries made of it."""

from __future__ import annotations

import numpy as np
import pytest

from potmesil_addon.spectrum import _CIE_1931, primaries_of_wavelengths


def test_the_table_is_the_standard_observers() -> None:
    # By 10 nm the three functions have equal sums; 1 nm's luminous one adds up to 106.857.
    sums = _CIE_1931.sum(axis=0) * 10.0
    assert sums == pytest.approx(106.86, abs=0.1)
    wavelengths, _ = primaries_of_wavelengths()
    assert wavelengths[[0, -1]] == pytest.approx([380e-9, 780e-9])
    assert wavelengths[np.argmax(_CIE_1931[:, 1])] == pytest.approx(560e-9)


def test_white_stays_white_and_wavelengths_have_their_colours() -> None:
    wavelengths, shares = primaries_of_wavelengths()
    assert shares.sum(axis=0) == pytest.approx(1.0)
    for wavelength, primary in ((611e-9, 0), (540e-9, 1), (464e-9, 2)):
        nearest = shares[np.argmin(np.abs(wavelengths - wavelength))]
        assert np.argmax(nearest) == primary
    # Blue-green has less than no red: no display shows it.
    assert shares[np.argmin(np.abs(wavelengths - 500e-9)), 0] < 0.0
