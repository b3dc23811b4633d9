"""1983, figure 8: the paths of cube and spheres, what the mirror shows, and what the exposure blurs."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from figures import mirror as drawn
from figures.comparison import seen
from figures.workshop import Workshop, processed
from potmesil_addon.process import ProcessSettings
from sample_scenes import mirror

PATHS = {"Cube": mirror.cube_path, **{name: path for name, (path, _) in mirror.SPHERES.items()}}


@pytest.fixture(scope="module")
def workshop(extension: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("mirror"), percentage=25, samples=16)


@pytest.fixture(scope="module")
def instant(workshop):
    samples = workshop.rendered("mirror", "mirror")
    return processed(samples, ProcessSettings(use_lens=False, use_motion=False)).picture[..., :3]


@pytest.fixture(scope="module")
def exposed(workshop):
    samples = workshop.rendered("mirror", "mirror")
    return processed(samples, ProcessSettings(use_lens=False)).picture[..., :3]


def test_samples_know_the_four_that_move_and_their_paths(workshop):
    samples = workshop.rendered("mirror", "mirror")
    moving = {path.name: path for path in samples.paths.objects}
    assert set(moving) == set(PATHS)
    assert samples.shutter.frames == pytest.approx(1.0)
    assert not samples.paths.camera.moves
    for name, place in PATHS.items():
        for time in (-0.5, 0.0, 0.25, 0.5):
            # A tenth of a pixel, which paths are kept to, is 1.2 mm there in a picture of 128 pixels.
            assert moving[name].at(time)[:3, 3] == pytest.approx(place(time), abs=1.2e-3)


def test_mirror_shows_the_cube(workshop, instant):
    without = workshop.rendered("mirror-without", "mirror", prepare=_without_cube)
    there = workshop.rendered("mirror", "mirror")
    glass = seen(there, drawn.MIRROR) & seen(without, drawn.MIRROR)
    changed = _reflection(workshop, instant)
    assert 0.03 < changed.sum() / glass.sum() < 0.25


def test_exposure_blurs_the_cube_along_its_path(workshop, instant, exposed):
    cube = seen(workshop.rendered("mirror", "mirror"), drawn.CUBE)

    def detail(picture, axis):
        both = cube & np.roll(cube, 1, axis)
        return np.abs(picture - np.roll(picture, 1, axis)).mean(axis=2)[both].mean()

    # It flies from left to right, with 3 in 10 of that upwards.
    along, across = (detail(exposed, axis) / detail(instant, axis) for axis in (1, 0))
    assert along < 0.45
    assert along < 0.75 * across


def test_reflections_stay_as_they_are_at_the_instant(workshop, instant, exposed):
    cycles = workshop.cycles("mirror-cycles", "mirror", shutter=True)
    reflected = _reflection(workshop, instant)
    kept = (exposed == instant).all(axis=2)
    assert kept[reflected].mean() > 0.6
    error = np.abs(exposed - cycles).mean(axis=2)
    wall = np.zeros_like(kept)
    wall[: len(wall) // 8] = True
    assert error[reflected & kept].mean() > 3.0 * error[wall].mean()


def test_figure_comes_nearer_where_things_move(workshop):
    drawing = drawn.FIGURES[0].draw(workshop)
    assert drawing.path.exists()
    parts = drawing.numbers["parts_db"]
    cube = parts["Cube, where it is at the instant"]
    assert cube["ours"] > cube["sharp"] + 3.0
    assert parts["Mirror, where nothing comes before it"]["ours"] < parts["All but the mirror"]["ours"]
    assert drawing.numbers["share_of_mirror_unchanged"] > 0.7


def _reflection(workshop, instant) -> Any:
    """Return where the mirror, and nothing before it, shows the cube."""
    without = workshop.rendered("mirror-without", "mirror", prepare=_without_cube)
    empty = processed(without, ProcessSettings(use_lens=False, use_motion=False)).picture[..., :3]
    glass = seen(workshop.rendered("mirror", "mirror"), drawn.MIRROR) & seen(without, drawn.MIRROR)
    return glass & (np.abs(instant - empty).max(axis=2) > 0.08)


def _without_cube(scene: Any) -> None:
    scene.objects["Cube"].hide_render = True
