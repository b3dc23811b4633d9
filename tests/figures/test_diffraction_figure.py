"""The surfaces of TOG 1982, figure 7: axis, zeros, shape and light against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import special

from figures import diffraction
from figures.workshop import Workshop

PI = math.pi


def test_the_surfaces_are_the_papers_seven_with_their_values_on_the_axis():
    every = diffraction.surfaces(601)
    assert [surface.u / PI for surface in every] == pytest.approx([0, 1, 2, 3, 4, 5, 6])
    for surface in every:
        assert surface.v[-1] == pytest.approx(6.0 * PI)
        quarter = surface.u / 4.0
        axis = (math.sin(quarter) / quarter) ** 2 if quarter else 1.0
        assert surface.on_axis == pytest.approx(axis, abs=1e-12)
        assert surface.intensity[0] == pytest.approx(axis, abs=1e-10)
    # Dark on the axis at 4π and brightest on a ring: at J1(v) = 0, where every u has an extreme.
    dark = every[4]
    assert dark.on_axis < 1e-12 < every[5].on_axis
    assert dark.peak[0] == pytest.approx(special.jn_zeros(1, 1)[0], abs=6.0 * PI / 600)


def test_in_focus_it_is_airys_pattern():
    surface = diffraction.surfaces(60001)[0]
    dark = np.flatnonzero(np.diff(np.sign(np.diff(surface.intensity))) > 0) + 1
    assert surface.v[dark[:3]] == pytest.approx(special.jn_zeros(1, 3), abs=1e-3)
    v = surface.v[1:]
    assert surface.intensity[1:] == pytest.approx((2.0 * special.j1(v) / v) ** 2, abs=1e-10)


def test_slices_cut_a_surface_that_is_the_same_all_around():
    surface = diffraction.surfaces(20001)[3]
    x, y, intensity = surface.slices(21, 41)
    assert (np.diff(y[:, 0]) < 0).all()
    assert np.hypot(x, y)[:, 0] == pytest.approx(6.0 * PI)
    assert intensity == pytest.approx(np.interp(np.hypot(x, y), surface.v, surface.intensity), abs=1e-6)


def test_defocus_moves_light_and_loses_none():
    for v in (1.0, 3.8317, 6.0 * PI):
        airy = 1.0 - special.j0(v) ** 2 - special.j1(v) ** 2
        assert diffraction.light_within(0.0, v) == pytest.approx(airy, abs=1e-10)
    # Far outside the geometric shadow only the light that the rim scatters is left: 2 / (π v) of all.
    v = 100.0 * PI
    for u in diffraction.DEFOCUS:
        assert 1.0 - diffraction.light_within(u, v) == pytest.approx(2.0 / (PI * v), rel=0.01)


def test_the_figure_is_drawn(tmp_path: Path):
    drawing = diffraction.FIGURES[0].draw(Workshop(tmp_path, percentage=25))
    with Image.open(drawing.path) as image:
        assert 300 < image.width < 600
        assert 150 < image.height < 350
    assert drawing.table.count("\n") == 8
