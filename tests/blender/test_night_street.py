"""The street at night: the robot is in focus, and a far light becomes the disc that the lens law says."""

from __future__ import annotations

import math
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from figures.comparison import psnr
from figures.workshop import Workshop, processed
from potmesil_addon.lens import Lens, circle_of_confusion
from potmesil_addon.process import ProcessSettings
from potmesil_addon.samples import Samples
from potmesil_addon.sheets import on_display
from sample_scenes import catalogue, night_street

EYE = (-0.13, 1.18, 0.152)
SIGNAL = (0.1, 40.85, 3.3)
"""The green traffic light that has dark houses all round; its disc is meant to have level 1."""

FOCUSED = ProcessSettings(use_motion=False)


@pytest.fixture(scope="module")
def workshop(extension: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("street"), percentage=25, samples=8)


def around_the_signal(scene: Any) -> None:
    """Let only the neighbourhood of the traffic light be rendered, with many samples."""
    render = scene.render
    render.resolution_percentage = 100
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.50, 0.62
    render.border_min_y, render.border_max_y = 0.55, 0.76
    scene.cycles.samples = 64
    scene.cycles.use_denoising = False


@pytest.fixture(scope="module")
def samples(workshop) -> Samples:
    return workshop.rendered("night_street", "night_street")


def pixel(samples, place: tuple[float, float, float]) -> tuple[int, int]:
    """Return the row and column of the picture where a place is seen."""
    x, y = samples.camera.project(place)[0]
    return int(y), int(x)


def circle_px(samples, depth: float) -> float:
    """Return the diameter in pixels of the circle that a point at a depth becomes."""
    lens = Lens(samples.lens.focal_length, samples.lens.f_stop, samples.lens.focus_distance)
    return float(circle_of_confusion([depth], lens, "cycles")[0] / samples.film.pitch_x)


def test_the_robot_is_in_focus(samples):
    depth = on_display(samples, samples.layers[0].depth)[pixel(samples, EYE)]
    assert samples.lens.focus_distance == pytest.approx(night_street.FOCUS_DISTANCE)
    # The picture has a quarter of its size: half a pixel at full size.
    assert abs(circle_px(samples, depth)) < 0.125


def test_a_far_light_becomes_a_disc_of_the_level_that_it_was_made_for(workshop):
    samples = workshop.rendered("signal", "night_street", prepare=around_the_signal)
    picture = processed(samples, FOCUSED).picture
    row, column = pixel(samples, SIGNAL)
    diameter = circle_px(samples, SIGNAL[1])
    assert diameter == pytest.approx(51.97, abs=0.01)
    side = round(0.7 * diameter)
    part = picture[row - side : row + side, column - side : column + side, 1]
    core = round(0.3 * diameter)
    level = part[side - core : side + core, side - core : side + core].mean()
    # The ball is a decagon, with less area than its circle; the houses add a hundredth.
    assert level == pytest.approx(5.0 * math.sin(math.pi / 5.0) / math.pi, rel=0.03)
    # The light's own size softens the rim evenly to both sides, so that half the level stays on the circle.
    measured = 2.0 * math.sqrt(np.count_nonzero(part > 0.5 * level) / math.pi)
    assert measured == pytest.approx(diameter, rel=0.01)


def test_ours_is_near_to_what_cycles_makes_of_it(workshop, samples):
    picture = processed(samples, FOCUSED).picture
    # With few samples most discs of Cycles' own are missed altogether.
    finer = replace(workshop, samples=40)
    reference = finer.cycles("night_street-cycles", "night_street", lens=True)
    pinhole = processed(samples, ProcessSettings(use_lens=False, use_motion=False)).picture
    # Less than half the error that the pinhole picture has.
    assert psnr(picture, reference) > psnr(pinhole, reference) + 6.1


def test_the_file_is_small_since_meshes_are_shared(extension, tmp_path):
    path = tmp_path / "night_street.blend"
    catalogue.save("night_street", path)
    assert path.stat().st_size < 1_000_000
    scene = catalogue.SCENES["night_street"].open()
    bulbs = [item for item in scene.objects if item.name.startswith("Fairy Light")]
    assert len(bulbs) == 30
    assert len({item.data for item in bulbs}) == 1
