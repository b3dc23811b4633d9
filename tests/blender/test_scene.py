"""Blender's scene read into the core's camera and lens, against Blender's own projection."""

from __future__ import annotations

import itertools
import math
from typing import Any

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

FITS = ("AUTO", "HORIZONTAL", "VERTICAL")
# Whole numbers of pixels at 75 %: Blender's function knows nothing of the rounding that a render does.
SIZES = ((1920, 1080), (1080, 1920), (512, 512), (332, 776))


def _camera(scene: Any, module: Any) -> Any:
    adapter = module("operators.scene")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return adapter.scene_camera(scene, adapter.evaluated_camera(scene, depsgraph))


@pytest.mark.parametrize(("fit", "size"), list(itertools.product(FITS, SIZES)))
@pytest.mark.parametrize("aspect", [(1.0, 1.0), (2.0, 1.0), (1.0, 1.6)])
def test_projection_is_blenders(
    scene: Any, module: Any, fit: str, size: tuple[int, int], aspect: tuple[float, float]
) -> None:
    rng = np.random.default_rng(hash((fit, size, aspect)) % 2**32)
    data = scene.camera.data
    data.sensor_fit = fit
    data.sensor_width, data.sensor_height = 36.0, 20.0
    data.lens = 43.0
    data.shift_x, data.shift_y = 0.13, -0.21
    scene.camera.location = (1.0, -2.0, 3.0)
    scene.camera.rotation_euler = (1.2, 0.3, -0.7)
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 75
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    bpy.context.view_layer.update()
    camera = _camera(scene, module)
    columns, rows = size[0] * 75 // 100, size[1] * 75 // 100
    assert (camera.film.columns, camera.film.rows) == (columns, rows)
    matrix = np.array(scene.camera.matrix_world)
    for _ in range(20):
        local = np.append(rng.uniform([-2, -2, -9], [2, 2, -1]), 1.0)
        point = (matrix @ local)[:3]
        seen = world_to_camera_view(scene, scene.camera, Vector(point))
        pixel, depth = camera.project(point)
        assert pixel[0] == pytest.approx(seen.x * columns, abs=0.01)
        assert pixel[1] == pytest.approx((1.0 - seen.y) * rows, abs=0.01)
        assert depth == pytest.approx(seen.z, rel=1e-5)


def test_scale_of_the_camera_object_does_not_matter(scene: Any, module: Any) -> None:
    scene.camera.rotation_euler = (1.2, 0.3, -0.7)
    bpy.context.view_layer.update()
    plain = _camera(scene, module).matrix
    scene.camera.scale = (3.0, 3.0, 3.0)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(_camera(scene, module).matrix, plain, atol=1e-3)


def test_cropped_border_moves_the_axis(scene: Any, module: Any) -> None:
    scene.render.resolution_x, scene.render.resolution_y = 200, 100
    whole = _camera(scene, module)
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
    scene.render.border_min_y, scene.render.border_max_y = 0.5, 1.0
    cut = _camera(scene, module)
    assert (cut.film.columns, cut.film.rows) == (100, 50)
    assert cut.film.pitch_x == pytest.approx(whole.film.pitch_x)
    point = (0.1, 5.0, 0.2)
    np.testing.assert_allclose(cut.project(point)[0], whole.project(point)[0] - [50.0, 0.0])


def test_focus_object_is_measured_along_the_axis(scene: Any, module: Any) -> None:
    target = bpy.data.objects.new("Target", None)
    target.location = (3.0, 7.0, -2.0)
    scene.collection.objects.link(target)
    scene.camera.data.dof.focus_object = target
    bpy.context.view_layer.update()
    adapter = module("operators.scene")
    camera = adapter.evaluated_camera(scene, bpy.context.evaluated_depsgraph_get())
    assert adapter.focus_distance(camera) == pytest.approx(7.0, abs=1e-5)


def test_lens_is_the_cameras(scene: Any, module: Any) -> None:
    dof = scene.camera.data.dof
    scene.camera.data.lens = 85.0
    dof.aperture_fstop, dof.aperture_blades = 1.8, 7
    dof.aperture_rotation, dof.aperture_ratio = math.radians(20.0), 1.5
    adapter = module("operators.scene")
    lens = adapter.scene_lens(adapter.evaluated_camera(scene, bpy.context.evaluated_depsgraph_get()))
    assert lens.focal_length == pytest.approx(0.085)
    assert lens.f_stop == pytest.approx(1.8)
    assert (lens.blades, lens.anamorphic_ratio) == (7, pytest.approx(1.5))
    assert math.degrees(lens.blade_rotation) == pytest.approx(20.0)


def test_distances_are_shown_in_the_scenes_units(scene: Any, module: Any) -> None:
    adapter = module("operators.scene")
    assert adapter.as_length(scene, math.inf) == "Infinity"
    scene.unit_settings.system = "METRIC"
    assert adapter.as_length(scene, 2.5) == "2.5 m"
    scene.unit_settings.system = "NONE"
    assert adapter.as_length(scene, 2.5) == "2.5"
