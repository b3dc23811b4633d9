"""The margin that is rendered around the picture for what comes in from outside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .scenes import card, dump
from .test_motion_export import keyed


def turning_scene(scene: Any) -> None:
    """Cards side by side before a camera that turns by about 12 pixels a frame."""
    for n, color in enumerate([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1)]):
        card(scene, f"Card {n}", (1.2 * (n - 2), 5.0, 0.3 * (n - 2)), 1.0, emitter(f"Glow {n}", color))
    keyed(scene.camera, "rotation_euler", {0: (np.pi / 2, 0.0, -0.08), 2: (np.pi / 2, 0.0, 0.08)})


def lens_only(scene: Any, fstop: float = 0.05, focus: float = 2.5) -> None:
    own = scene.potmesil_camera
    own.use_motion, own.use_lens = False, True
    scene.camera.data.dof.aperture_fstop, scene.camera.data.dof.focus_distance = fstop, focus


def radius(depth: float, fstop: float = 0.05, focus: float = 2.5) -> float:
    """Return a circle's radius in pixels of 0.375 mm, for 50 mm in Cycles' model."""
    return 0.5 * 2.5e-3 / fstop * abs(1.0 / focus - 1.0 / depth) / 0.375e-3


def margins_of(scene: Any, module: Any) -> Any:
    motion = module("potmesil_addon.progress").run(module("operators.motion").sample_motion(scene))
    return module("operators.overscan").overscan_margins(scene, motion)


def export(scene: Any, module: Any, path: Path) -> Any:
    module("operators.export").render_samples(bpy.context, path)
    return module("potmesil_addon.exr").read_samples(path)


@pytest.mark.parametrize(
    "setting", ["plain", "shift", "portrait", "vertical", "aspect", "percentage", "points"]
)
def test_the_picture_lies_where_it_lay_without(scene: Any, module: Any, tmp_path: Path, setting: str) -> None:
    turning_scene(scene)
    scene.cycles.seed = 1
    camera, render = scene.camera.data, scene.render
    if setting == "shift":
        camera.shift_x, camera.shift_y = 0.1, -0.07
    elif setting == "portrait":
        render.resolution_x, render.resolution_y = 64, 96
    elif setting == "vertical":
        camera.sensor_fit, camera.sensor_height = "VERTICAL", 20.0
    elif setting == "aspect":
        render.pixel_aspect_x = 1.5
    elif setting == "percentage":
        render.resolution_percentage = 73
    elif setting == "points":
        scene.potmesil_camera.sampling = "POINTS"
    scene.potmesil_camera.use_overscan = False
    plain = export(scene, module, tmp_path / "plain.exr")
    scene.potmesil_camera.use_overscan = True
    wide = export(scene, module, tmp_path / "wide.exr")
    assert plain.data_window == plain.display_window == wide.display_window
    left, top = -wide.data_window.x0, -wide.data_window.y0
    assert left >= 3
    rows, columns = plain.data_window.rows, plain.data_window.columns
    inside = (slice(top, top + rows), slice(left, left + columns))
    # Other samples fall on other pixels, so edges between the cards may differ.
    same_depth = np.isclose(wide.layers[0].depth[inside], plain.layers[0].depth, rtol=1e-3)
    assert same_depth.mean() > 0.96
    # What Blender 5.2 says of the motion where there is no surface depends on the frame.
    surface = same_depth & np.isfinite(plain.layers[0].depth)
    off = np.abs(wide.layers[0].vector[inside] - plain.layers[0].vector)[surface]
    assert np.median(off) < 0.02
    difference = [
        np.abs(np.roll(wide.layers[0].color, (row, column), (0, 1))[inside] - plain.layers[0].color).mean()
        for row, column in ((0, 0), (0, 1), (0, -1), (1, 0), (-1, 0))
    ]
    assert difference[0] < 0.5 * min(difference[1:])
    assert np.array_equal(wide.camera.matrix, plain.camera.matrix)


def test_the_margin_is_as_wide_as_things_move(scene: Any, module: Any) -> None:
    turning_scene(scene)
    run = module("potmesil_addon.progress").run
    margins = run(module("operators.motion").sample_motion(scene)).margins
    # 0.08 radians a frame are 10.7 pixels, the shutter is open for a quarter of a frame on either side.
    assert 4 <= margins[0] <= 6
    assert margins[1] <= 2


def test_what_moves_within_the_picture_needs_none(scene: Any, module: Any, tmp_path: Path) -> None:
    item = card(scene, "Card", (0.0, 5.0, 0.0), 0.4, emitter("Glow", (1.0, 1.0, 1.0)))
    keyed(item, "location", {0: (-0.5, 5.0, 0.0), 2: (0.5, 5.0, 0.0)})
    scene.potmesil_camera.use_lens = False
    samples = export(scene, module, tmp_path / "a.exr")
    assert samples.data_window == samples.display_window


def test_a_long_way_is_cut_to_a_quarter(scene: Any, module: Any) -> None:
    turning_scene(scene)
    scene.render.motion_blur_shutter = 2.0
    keyed(scene.camera, "rotation_euler", {0: (np.pi / 2, 0.0, -1.0), 2: (np.pi / 2, 0.0, 1.0)})
    run = module("potmesil_addon.progress").run
    assert run(module("operators.motion").sample_motion(scene)).margins[0] == 24


@pytest.mark.parametrize("sampling", ["PIXELS", "POINTS"])
def test_settings_are_given_back(scene: Any, module: Any, tmp_path: Path, sampling: str) -> None:
    turning_scene(scene)
    scene.potmesil_camera.sampling = sampling
    names = ("resolution_x", "resolution_y", "resolution_percentage", "use_border")

    def settings() -> Any:
        return [getattr(scene.render, name) for name in names], dump(scene.camera.data)

    before = settings()
    samples = export(scene, module, tmp_path / "a.exr")
    assert samples.data_window != samples.display_window
    assert settings() == before


def test_no_margin_with_a_border(scene: Any, module: Any, tmp_path: Path) -> None:
    turning_scene(scene)
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
    samples = export(scene, module, tmp_path / "a.exr")
    assert samples.data_window == samples.display_window


# ----- for the lens


@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_the_margin_holds_the_circles_of_the_background(scene: Any, module: Any, ratio: float) -> None:
    lens_only(scene, 0.1)
    scene.camera.data.dof.aperture_ratio = ratio
    expected = radius(np.inf, 0.1)
    assert 13.0 < expected < 14.0
    assert margins_of(scene, module) == (np.ceil(expected / ratio), 14)
    scene.potmesil_camera.coc_model = "paper"
    assert margins_of(scene, module) == (np.ceil(expected / ratio / (1.0 - 0.05 / 2.5)), 14)


def test_what_is_near_at_the_border_counts(scene: Any, module: Any) -> None:
    lens_only(scene, 0.1)
    glow = emitter("Glow", (1.0, 1.0, 1.0))
    # Wholly inside, however near.
    item = card(scene, "Inside", (0.0, 0.5, 0.0), 0.02, glow)
    assert margins_of(scene, module) == (14, 14)
    item.scale = (5.0, 1.0, 1.0)
    item.location = (0.35, 1.0, 0.0)
    expected = np.ceil(radius(1.0, 0.1))
    assert expected == 20
    # In height a quarter of the picture.
    assert margins_of(scene, module) == (20, 16)
    # Outside, 21 pixels of 48 to half the picture's width of 0.36: too far out to reach in.
    item.location.x = 0.36 + 0.05 + 21.0 / 48.0 * 0.36
    assert margins_of(scene, module) == (14, 14)


def test_ground_counts_where_the_margin_ends(scene: Any, module: Any) -> None:
    lens_only(scene, 0.2)
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-9, -9, -0.3), (9, -9, -0.3), (9, 90, -0.3), (-9, 90, -0.3)], [], [(0, 1, 2, 3)])
    scene.collection.objects.link(bpy.data.objects.new("Ground", mesh))
    _, rows = margins_of(scene, module)
    # Row r below the middle shows the ground 0.3 * 133.3 / r away.
    for margin in range(1, 17):
        if radius(40.0 / (32 + margin), 0.2) <= margin:
            break
    assert margin <= rows <= margin + 1
    assert rows < 16


def test_the_lens_has_at_most_a_quarter_and_nothing_for_less_than_a_pixel(scene: Any, module: Any) -> None:
    lens_only(scene, 0.01)
    assert margins_of(scene, module) == (24, 16)
    lens_only(scene, 2.8)
    assert margins_of(scene, module) == (0, 0)


def test_motion_and_lens_add(scene: Any, module: Any) -> None:
    lens_only(scene, 0.2)
    turning_scene(scene)
    (lens, _) = margins_of(scene, module)
    own = scene.potmesil_camera
    own.use_motion, own.use_lens = True, False
    (motion, _) = margins_of(scene, module)
    own.use_lens = True
    assert motion >= 4
    assert margins_of(scene, module)[0] == motion + lens
    own.use_overscan = False
    assert not module("operators.overscan").uses_overscan(scene)


def test_what_is_outside_blurs_in(scene: Any, module: Any, tmp_path: Path) -> None:
    lens_only(scene, 0.1)
    # From 2 to 12 pixels outside of the picture's right border.
    width = 10.0 * 10.0 / 133.3
    card(scene, "Card", (10.0 * 55.0 / 133.3, 10.0, 0.0), width, emitter("Glow", (1.0, 1.0, 1.0)))
    process = module("potmesil_addon.process")
    sums = []
    for overscan in (False, True):
        scene.potmesil_camera.use_overscan = overscan
        samples = export(scene, module, tmp_path / "a.exr")
        settings = process.ProcessSettings(use_motion=False)
        result = module("potmesil_addon.progress").run(process.process(samples, settings))
        sums.append(float(result.picture[..., 0].sum()))
    assert sums[0] == 0.0
    assert sums[1] > 5.0


# ----- for distortion


@pytest.mark.parametrize("model", ["brown", "polynomial"])
def test_the_margin_holds_what_a_barrel_shows(scene: Any, module: Any, model: str) -> None:
    own = scene.potmesil_camera
    own.use_motion = own.use_lens = False
    overscan = module("operators.overscan")
    assert not overscan.uses_overscan(scene)
    distortion = own.effects.distortion
    distortion.use, distortion.model, distortion.k1 = True, model, -0.3
    assert overscan.uses_overscan(scene)
    # The corner is 48, 32 pixels of 133.3 to the focal length away from the axis.
    x, y = 0.36, 0.24
    distance = np.hypot(x, y)
    for _ in range(100):
        distance = np.hypot(x, y) / (1.0 - 0.3 * distance**2)
    larger = distance / np.hypot(x, y)
    expected = np.ceil((larger - 1.0) * np.array([48.0, 32.0])) + 2
    assert margins_of(scene, module) == tuple(expected.tolist())
    assert expected[0] > 4
    distortion.k1 = 0.3
    # Two are for interpolation.
    assert max(margins_of(scene, module)) <= 2


def test_distortion_adds_to_the_lens_and_stops_at_a_quarter(scene: Any, module: Any) -> None:
    lens_only(scene, 0.2)
    alone = margins_of(scene, module)
    distortion = scene.potmesil_camera.effects.distortion
    distortion.use, distortion.k1 = True, -0.3
    both = margins_of(scene, module)
    scene.potmesil_camera.use_lens = False
    bent = margins_of(scene, module)
    assert bent[0] > 2
    assert both == (alone[0] + bent[0], alone[1] + bent[1])
    distortion.k1 = -1.0
    assert margins_of(scene, module) == (24, 16)


def test_colours_of_other_sizes_have_a_margin(scene: Any, module: Any) -> None:
    own = scene.potmesil_camera
    own.use_motion = own.use_lens = False
    own.effects.chromatic.use = True
    assert not module("operators.overscan").uses_overscan(scene)
    own.effects.chromatic.size_blue = -0.05
    assert module("operators.overscan").uses_overscan(scene)
    # 48 / 0.95 and 32 / 0.95, and two more.
    assert margins_of(scene, module) == (5, 4)
    own.effects.chromatic.size_blue = 0.05
    # What blue sees is less than green's own.
    assert margins_of(scene, module) == (2, 2)


def test_what_is_outside_is_rendered_for_a_barrel(scene: Any, module: Any, tmp_path: Path) -> None:
    scene.potmesil_camera.use_motion = scene.potmesil_camera.use_lens = False
    distortion = scene.potmesil_camera.effects.distortion
    distortion.use, distortion.k1 = True, -0.3
    samples = export(scene, module, tmp_path / "a.exr")
    margins = margins_of(scene, module)
    assert samples.data_window.x0 == -margins[0]
    assert samples.data_window.y1 == 64 + margins[1]
    assert (samples.display_window.columns, samples.display_window.rows) == (96, 64)
