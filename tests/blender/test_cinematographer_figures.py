"""Focus pull, uniform defocus and fades: what is measured in the animations."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from PIL import Image

from figures import cinematographer
from figures.workshop import Drawing, Workshop


@pytest.fixture(scope="module")
def drawing(extension: Any, tmp_path_factory: pytest.TempPathFactory) -> Drawing:
    # Not smaller: at 980 mm the blur of a focus on the cube would be less than a pixel.
    return cinematographer.draw(Workshop(tmp_path_factory.mktemp("figures"), percentage=64, samples=1))


def test_the_focus_goes_from_the_sphere_over_the_cube_to_the_background(drawing: Drawing) -> None:
    curves = drawing.numbers["sharpness"]["pull"]
    sharpest = [int(np.argmax(curves[thing])) + 1 for thing in ("Sphere", "Cube", "Background")]
    assert sharpest[0] < sharpest[1] < sharpest[2]
    # The keys put the focus on the cube's distance in frame 13, and on the background's from 22 on, which at
    # f/5.6 and this size is sharp some frames before.
    assert 11 <= sharpest[1] <= 15
    background = curves["Background"]
    assert min(background[21:]) > 0.95
    assert max(background[:13]) < 0.6


def test_uniform_defocus_takes_detail_from_everything(drawing: Drawing) -> None:
    for values in drawing.numbers["sharpness"]["defocus"].values():
        assert values[-1] < 0.35 * values[0]


def test_the_fade_is_linear_in_light(drawing: Drawing) -> None:
    light = np.array(drawing.numbers["light_of_fade"])
    share = np.interp(np.arange(1, 25), [1, 8, 17, 24], [0, 1, 1, 0])
    assert light[0] == light[-1] == 0.0
    # The things move a little, and with them the light.
    np.testing.assert_allclose(light / light.max(), share, atol=0.05)


def test_each_animation_is_one_command(drawing: Drawing) -> None:
    assert all(words.startswith("process shot.####.exr -o ") for words in drawing.numbers["commands"])
    json.dumps(drawing.numbers)


def test_the_animations_lie_beside_each_other(drawing: Drawing) -> None:
    with Image.open(drawing.extra[0]) as film:
        assert film.n_frames == cinematographer.FRAMES
        assert film.width == 3 * film.height
    with Image.open(drawing.path) as sheet:
        assert min(sheet.size) > 400
