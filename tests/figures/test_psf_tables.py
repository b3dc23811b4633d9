"""The tables of TOG 1982, figure 10: their sizes, their sums and how many there are."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from figures import psf_tables
from figures.workshop import Workshop


def circle_in_pixels(depth: float) -> float:
    """Return TOG 1982, eq. 9, from the lens law: 55 mm, f/5.6, focused at 550 mm, 1024 pixels on 30 mm."""
    image, film = (1.0 / (1.0 / 55.0 - 1.0 / p) for p in (1000.0 * depth, 550.0))
    return 55.0 / 5.6 * (film - image) / image * 1024 / 30.0


@pytest.mark.parametrize("kind", ["disc", "lommel"])
def test_tables_are_the_square_around_the_circle_and_hold_all_of_its_light(kind):
    for table in psf_tables.tables_at(kind, psf_tables.SHOWN):
        circle = circle_in_pixels(table.depth)
        assert table.circle == pytest.approx(circle, rel=1e-9, abs=1e-9)
        assert table.values.shape == (table.entries, table.entries, 1 if kind == "disc" else 3)
        # A square of whole pixels on both sides of a corner, none of them beyond the circle.
        assert 0.0 <= 0.5 * table.entries - 0.5 * abs(circle) <= 1.0
        assert table.values.sum(axis=(0, 1)) == pytest.approx(1.0, abs=1e-9)
        assert table.values == pytest.approx(table.values[::-1, ::-1], abs=1e-12)
        assert table.values == pytest.approx(table.values.transpose(1, 0, 2), abs=1e-9)


def test_an_evenly_lit_disc_has_the_value_of_its_area():
    table = psf_tables.tables_at("disc", [psf_tables.NEAREST])[0]
    middle = table.entries // 2
    area = 0.25 * math.pi * circle_in_pixels(psf_tables.NEAREST) ** 2
    assert table.values[middle, middle, 0] == pytest.approx(1.0 / area, rel=1e-9)
    assert table.values[0, 0, 0] == 0.0


def test_the_papers_spacing_has_a_table_each_millimetre():
    circles = psf_tables.table_circles("disc", "equal-z")
    depths = np.linspace(0.27, 1.2, 931)
    assert circles == pytest.approx([circle_in_pixels(z) for z in depths], rel=1e-9, abs=1e-9)


def test_equal_circles_need_half_the_tables_and_leave_a_smaller_step():
    papers, ours = (psf_tables.storage("disc", spacing) for spacing in ("equal-z", "coc"))
    # From -32 to the far end each 1/8 pixel; nearer, where circles are larger, at most 1/8 of 38.63 / 32.
    even = (32.0 + circle_in_pixels(1.2)) * 8.0
    grown = 32.0 * 8.0 * math.log(-circle_in_pixels(0.27) / 32.0)
    assert ours.tables == pytest.approx(even + grown + 1.0, abs=1.0)
    assert ours.largest_step < 0.155 < papers.largest_step
    assert papers.tables == 931
    # Discs from 270 to 1200 mm: a quadrant has the radius, rounded up, along its side.
    sides = [max(math.ceil(0.5 * abs(circle_in_pixels(z)) - 1e-9), 1) for z in np.linspace(0.27, 1.2, 931)]
    assert papers.quadrant_entries == sum(side**2 for side in sides)
    assert ours.nbytes < papers.nbytes


def test_the_figure_is_drawn(tmp_path: Path):
    drawing = psf_tables.FIGURES[0].draw(Workshop(tmp_path, percentage=25))
    with Image.open(drawing.path) as image:
        assert 250 < image.width < 500
        assert 180 < image.height < 400
    assert "931" in drawing.table
