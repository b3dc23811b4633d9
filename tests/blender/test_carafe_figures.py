"""TOG 1982, figures 15 and 16: the carafe's place, its tiles, and what it mirrors and lets through."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from figures import carafe as drawn
from figures.comparison import psnr
from figures.workshop import Workshop, processed
from potmesil_addon.lens import Lens, depth_of_field
from potmesil_addon.process import ProcessSettings
from sample_scenes import building, carafe

FLOOR = 2


@pytest.fixture(scope="module")
def workshop(extension: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("carafe"), percentage=25, samples=16)


def test_depth_of_field_is_the_papers_and_holds_the_carafe(workshop):
    samples = workshop.rendered("carafe", "carafe")
    lens = Lens(samples.lens.focal_length, samples.lens.f_stop, samples.lens.focus_distance)
    limits = depth_of_field(lens)
    layer = samples.layers[0]
    depth = layer.depth[layer.object_index == drawn.CARAFE]
    assert lens.focal_length == pytest.approx(0.040)
    assert lens.f_stop == pytest.approx(1.4)
    assert samples.film.width == pytest.approx(0.030)
    assert limits.total == pytest.approx(0.110, abs=1e-5)
    assert depth.size > 1000
    assert limits.near < depth.min()
    assert depth.max() < limits.far
    assert 0.5 * (depth.min() + depth.max()) == pytest.approx(lens.focus_distance, abs=0.003)


def test_tiles_are_50_mm(workshop):
    samples = workshop.rendered("carafe", "carafe")
    layer = samples.layers[0]
    floor = (layer.object_index == FLOOR) & (layer.depth < 1.8)
    x, y, z = _world(samples)[floor].T
    assert np.abs(z).max() < 1e-5
    cos, sin = math.cos(carafe.TURN), math.sin(carafe.TURN)
    light = np.log(np.maximum(layer.color[floor][:, 1], 0.01))

    def agreement(side: float) -> float:
        parity = (np.floor((cos * x - sin * y) / side) + np.floor((sin * x + cos * y) / side)) % 2
        return float(np.corrcoef(parity, light)[0, 1])

    # Tiles that are 1 mm off are out of step by half a tile at the floor's borders.
    assert agreement(0.050) > 0.95
    assert max(agreement(0.049), agreement(0.051)) < 0.75


def test_floor_reaches_before_and_behind_the_depth_of_field(workshop):
    samples = workshop.rendered("carafe", "carafe")
    layer = samples.layers[0]
    depth = layer.depth[layer.object_index == FLOOR]
    assert depth.min() < 0.6 * samples.lens.focus_distance
    assert depth.max() > 2.0 * samples.lens.focus_distance


def test_glass_shows_the_floor_and_glaze_mirrors_it(workshop):
    green = {}
    for name in ("carafe", "carafe_glass"):
        layer = workshop.rendered(f"{name}-green", name, prepare=_green_floor).layers[0]
        rows = np.flatnonzero((layer.object_index == drawn.CARAFE).any(axis=1))
        lower = np.zeros_like(layer.object_index, dtype=bool)
        lower[rows[2 * rows.size // 3] : rows[-1]] = True
        green[name] = layer.color[lower & (layer.object_index == drawn.CARAFE), 1]
    # Two walls of glass pass most of a floor of brightness 1; a glaze of index 2.4 mirrors 17 % and more.
    assert np.median(green["carafe_glass"]) > 0.6
    assert 0.12 < green["carafe"].mean() < 0.5


@pytest.mark.parametrize("figure", drawn.FIGURES, ids=lambda figure: figure.name)
def test_figure_defocuses_the_floor_alone(workshop, figure):
    drawing = figure.draw(workshop)
    assert drawing.path.exists()
    assert drawing.numbers["ours_db"] > drawing.numbers["sharp_db"] + 2.0
    samples = workshop.rendered("carafe", "carafe")
    pinhole = processed(samples, ProcessSettings(use_lens=False, use_motion=False)).picture
    ours = processed(samples, ProcessSettings(use_motion=False)).picture
    kept = drawn.seen(samples, drawn.CARAFE)
    assert kept.sum() > 300
    assert psnr(ours[kept][None], pinhole[kept][None]) > psnr(ours[~kept][None], pinhole[~kept][None]) + 6.0


def _green_floor(scene: Any) -> None:
    scene.objects["Floor"].data.materials[0] = building.emitter("Green", (0.0, 1.0, 0.0))


def _world(samples: Any) -> npt.NDArray[np.float64]:
    """Return the place in the world of each sample."""
    depth = samples.layers[0].depth.astype(np.float64)
    rows, columns = depth.shape
    left, top = samples.data_window.x0, samples.data_window.y0
    x, y = np.meshgrid(np.arange(columns) + left + 0.5, np.arange(rows) + top + 0.5)
    projected = np.stack([x * depth, y * depth, depth, np.ones_like(depth)], axis=-1)
    return (projected @ np.linalg.inv(samples.paths.camera.at(0.0)).T)[..., :3]
