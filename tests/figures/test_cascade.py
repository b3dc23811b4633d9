"""Cascaded point-spread functions (1983, figure 5): light, order, both domains, moments, known shapes."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from figures import cascade
from figures.workshop import Workshop

EVERY = cascade.cascades()


@pytest.mark.parametrize("row", EVERY, ids=lambda row: row.result.name)
def test_light_is_kept_and_moments_add(row):
    assert row.result.values.sum() == pytest.approx(1.0, abs=1e-5)
    assert row.result.mean == pytest.approx(sum(factor.mean for factor in row.factors), abs=1e-3)
    sigma = sum(factor.covariance for factor in row.factors)
    assert row.result.covariance == pytest.approx(sigma, rel=1e-4, abs=1e-2)


@pytest.mark.parametrize("row", EVERY, ids=lambda row: row.result.name)
def test_neither_order_nor_domain_matters(row):
    for factors, method in itertools.product(itertools.permutations(row.factors), ("spatial", "frequency")):
        other = cascade.cascaded(row.result.name, factors, method).result
        assert (other.first_row, other.first_column) == (row.result.first_row, row.result.first_column)
        assert np.abs(other.values - row.result.values).max() < 1e-6 * row.result.values.max()


def test_factors_have_the_moments_of_their_shapes():
    # Whole pixels add a twelfth each way, but for what a sharp rim leaves of Sheppard's correction.
    disc, line = cascade.lens_disc().covariance, cascade.even_motion().covariance
    assert np.diag(disc) == pytest.approx((cascade.DISC / 4.0) ** 2 + 1.0 / 12.0, rel=2e-3)
    assert line[0, 0] == pytest.approx(cascade.EVEN**2 / 12.0 + 1.0 / 12.0, rel=1e-3)
    assert line[1, 1] == 0.0
    # Light grows with the square of the radius: mean square radius over the light, R^2 times this.
    blades = 0.4
    square = (1.0 - 2.0 * blades + 2.0 * blades / 5.0) / (1.0 - 2.0 * blades + 2.0 * blades / 3.0)
    opening = cascade.opening_lens().covariance
    assert opening[0, 0] == pytest.approx((cascade.DISC / 4.0) ** 2 * square + 1.0 / 12.0, rel=1e-3)


def test_disc_and_line_make_a_stadium():
    stadium = cascade.cascaded("", [cascade.lens_disc(), cascade.even_motion()]).result
    rows, columns = stadium.values.shape
    # Length and height of the sum of both shapes, to whole pixels.
    assert columns == pytest.approx(cascade.DISC + cascade.EVEN, abs=2.0)
    assert rows == pytest.approx(cascade.DISC, abs=2.0)
    # In the middle the whole chord of the disc passes: d / (area a).
    middle = stadium.values[-stadium.first_row, -stadium.first_column]
    assert middle == pytest.approx(4.0 / (math.pi * cascade.DISC * cascade.EVEN), rel=0.01)


def test_five_openings_are_one_repeated():
    dash = cascade.even_motion(0.2 * cascade.EVEN)
    repeated = cascade.cascaded("", [dash, cascade.exposures()]).result
    at_once = cascade.even_motion(cascade.EVEN, cascade.OPENINGS)
    assert repeated.values == pytest.approx(at_once.values, abs=1e-7)
    assert (repeated.first_row, repeated.first_column) == (at_once.first_row, at_once.first_column)
    lit = np.flatnonzero(np.diff((repeated.values[0] > 0.0).astype(int), prepend=0) == 1)
    assert np.diff(lit) == pytest.approx([18, 18, 18, 18])


def test_the_slower_the_brighter():
    arc = cascade.curved_motion()
    half = -arc.first_column
    # It begins slowly on the left, and leaves fast on the right (1983, eq. 3-9).
    assert arc.values[:, :half].sum() > 1.5 * arc.values[:, half + 1 :].sum()


def test_the_figure_is_drawn(tmp_path: Path):
    drawing = cascade.FIGURES[0].draw(Workshop(tmp_path, percentage=25))
    with Image.open(drawing.path) as image:
        assert 250 < image.width < 500
        assert 180 < image.height < 400
    assert drawing.table.count("\n") == 1 + len(EVERY)
