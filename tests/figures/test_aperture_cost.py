"""TOG 1982, Table 2: the growth of the papers' times, and of the work counted for our processor."""

from __future__ import annotations

import numpy as np
import pytest

from figures.aperture_cost import PAPERS_MINUTES, Operations, growth, operations
from potmesil_addon.camera import Film
from potmesil_addon.focus import FocusSettings
from potmesil_addon.lens import Lens, circle_of_confusion

FILM = Film(0.030, 0.030, 512, 512)
F_STOPS = (5.6, 4.0, 2.8, 2.0, 1.4)


def counted(depth, f_stop, film=FILM) -> Operations:
    return operations(np.array(depth), FocusSettings(Lens(0.040, f_stop, 1.25236), film))


def test_growth_is_the_power_and_leaves_narrow_apertures_out():
    cost = {n: 7.0 * n**-1.25 for n in (1.0, 1.4, 2.0, 5.6)}
    assert growth(cost) == pytest.approx(1.25)
    assert growth({**cost, 11.0: 1e6}) == pytest.approx(1.25)


def test_the_papers_times_grow_with_the_area_of_the_circle():
    assert growth(PAPERS_MINUTES) == pytest.approx(2.0, abs=0.02)


def test_pixels_are_those_of_the_circle():
    # Far away the circle at f/1.4 is (40 mm)^2 / (1.4 x 1252.4 mm), 15.6 pixels across.
    across = circle_of_confusion(1e6, Lens(0.040, 1.4, 1.25236)) / FILM.pitch_x
    assert across == pytest.approx(15.57, abs=0.01)
    area = np.pi / 4.0 * across**2
    # It also reaches pixels that it covers in part. The rim crosses no more than 4 for each of its diameter.
    rim = 4.0 * across
    pixels = counted([1e6], 1.4).pixels
    assert area < pixels < area + rim


def test_a_sample_in_focus_costs_its_own_pixel():
    assert counted([1.25236], 1.4) == Operations(pixels=1.0, entries=2.0)


def test_our_work_grows_with_the_diameter_and_the_papers_with_the_area():
    # Large circles, where the rim is thin beside the disc: a picture of 4096 pixels.
    fine = Film(0.030, 0.030, 4096, 4096)
    depth = np.linspace(0.7, 3.0, 40)
    counts = {n: counted(depth, n, fine) for n in F_STOPS}
    assert growth({n: count.pixels for n, count in counts.items()}) == pytest.approx(2.0, abs=0.15)
    assert growth({n: count.entries for n, count in counts.items()}) == pytest.approx(1.0, abs=0.05)
