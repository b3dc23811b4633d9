"""The macro still life: the jewel is in focus, the foreground is near, and its own lens is Cycles'."""

from __future__ import annotations

from types import ModuleType

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view

from figures.comparison import psnr
from figures.workshop import Workshop, processed
from potmesil_addon.lens import Lens, circle_of_confusion
from potmesil_addon.process import ProcessSettings
from potmesil_addon.samples import LensAttributes, Samples
from potmesil_addon.sheets import on_display
from sample_scenes import catalogue, still_life

NAME = "still_life"


@pytest.fixture(scope="module")
def workshop(extension: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("still_life"), percentage=15, samples=4)


@pytest.fixture(scope="module")
def samples(workshop) -> Samples:
    return workshop.rendered(NAME, NAME)


def test_the_jewel_is_seen_and_in_focus(samples):
    scene = catalogue.SCENES[NAME].open()
    bpy.context.view_layer.update()
    jewel = scene.objects[still_life.KEY_POINT].matrix_world.translation
    x, y, depth = world_to_camera_view(scene, scene.camera, jewel)
    assert samples.lens.focus_distance == pytest.approx(depth, abs=1e-6)
    seen = on_display(samples, samples.layers[0].depth)
    rows, columns = seen.shape
    # Nothing is in front of it: the jewel and its setting are less than a millimetre deep.
    assert seen[int((1.0 - y) * rows), int(x * columns)] == pytest.approx(depth, abs=0.001)


def test_a_near_foreground_fills_the_lower_left_and_a_far_background_the_top(samples):
    lens = Lens(samples.lens.focal_length, samples.lens.f_stop, samples.lens.focus_distance)
    circles = circle_of_confusion(on_display(samples, samples.layers[0].depth), lens) / samples.film.width
    height, width = circles.shape
    near = circles < -0.04
    assert 0.08 < near.mean() < 0.33
    rows, columns = np.nonzero(near)
    assert rows.min() > 0.5 * height
    assert columns.max() < 0.5 * width
    assert np.median(circles[: height // 5]) > 0.08


def test_the_scene_s_own_lens_is_nearest_to_cycles(workshop, samples):
    reference = workshop.cycles("reference", NAME, lens=True)

    def nearness(**lens: float) -> float:
        settings = ProcessSettings(use_motion=False, lens=LensAttributes(**lens))
        return psnr(processed(samples, settings).picture, reference)

    focus = samples.lens.focus_distance
    others = {
        "wide open": nearness(f_stop=0.5 * still_life.F_STOP),
        "stopped down": nearness(f_stop=2.0 * still_life.F_STOP),
        "nearer": nearness(focus_distance=focus - 0.020),
        "farther": nearness(focus_distance=focus + 0.020),
    }
    assert nearness() > max(others.values()), others


def test_meshes_are_shared_and_the_file_is_small(tmp_path):
    path = tmp_path / "still_life.blend"
    catalogue.save(NAME, path)
    assert path.stat().st_size < 1_500_000
    balls = {item.data for item in bpy.context.scene.objects if item.name.startswith("Ball ")}
    assert len(balls) == 5
