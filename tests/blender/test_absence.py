"""Objects that exist for no ray while they are borrowed, and the lamps that shine."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .scenes import card
from .test_motion_export import keyed

RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
FLAGS = tuple(f"visible_{ray}" for ray in RAYS)


def lit_wall(scene: Any) -> Any:
    """A white wall under a sun from behind the camera, and a card whose shadow falls on it."""
    white = bpy.data.materials.new("White")
    card(scene, "Wall", (0.0, 6.0, 0.0), 40.0, white)
    blocker = card(scene, "Blocker", (0.0, 4.0, 0.0), 1.0, emitter("Blocker", (1.0, 0.0, 0.0)))
    add_light(scene, "Sun", "SUN").rotation_euler = (0.5 * math.pi, 0.0, 0.0)
    return blocker


def add_light(scene: Any, name: str, kind: str, place: Any = (0.0, 0.0, 0.0)) -> Any:
    light = bpy.data.lights.new(name, kind)
    item = bpy.data.objects.new(name, light)
    item.location = place
    scene.collection.objects.link(item)
    return item


def rendered(scene: Any, path: Path) -> Any:
    """Return what a render shows, (rows, columns, 3)."""
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels).reshape(image.size[1], image.size[0], 4)[..., :3]
    bpy.data.images.remove(image)
    return pixels


def test_what_is_absent_has_no_shadow_and_no_light(scene: Any, module: Any, tmp_path: Path) -> None:
    blocker = lit_wall(scene)
    blocker.hide_render = True
    without = rendered(scene, tmp_path / "without.exr")
    blocker.hide_render = False
    with module("operators.borrow").Borrowed() as borrowed:
        module("operators.absence").hidden_from_camera(borrowed, scene, {"Blocker"})
        shadowed = rendered(scene, tmp_path / "shadowed.exr")
    with module("operators.borrow").Borrowed() as borrowed:
        module("operators.absence").absent(borrowed, scene, {"Blocker"})
        absent = rendered(scene, tmp_path / "absent.exr")
    np.testing.assert_allclose(absent, without, rtol=1e-5, atol=1e-6)
    assert np.abs(shadowed - without).max() > 0.2 * without.max()


def test_instances_are_absent_with_their_instancer(scene: Any, module: Any, tmp_path: Path) -> None:
    blocker = lit_wall(scene)
    group = bpy.data.collections.new("Group")
    group.objects.link(blocker)
    scene.collection.objects.unlink(blocker)
    empty = rendered(scene, tmp_path / "empty.exr")
    instancer = bpy.data.objects.new("Instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", group
    scene.collection.objects.link(instancer)
    assert np.abs(rendered(scene, tmp_path / "there.exr") - empty).max() > 0.1
    with module("operators.borrow").Borrowed() as borrowed:
        module("operators.absence").absent(borrowed, scene, {"Instancer"})
        absent = rendered(scene, tmp_path / "absent.exr")
    np.testing.assert_allclose(absent, empty, rtol=1e-5, atol=1e-6)


def test_flags_and_what_animates_them_are_given_back(scene: Any, module: Any) -> None:
    blocker = lit_wall(scene)
    blocker.visible_glossy = False
    keyed(blocker, "visible_shadow", {1: True, 2: True}, "CONSTANT")
    scene.render.use_persistent_data = True
    before = {(item.name, flag): getattr(item, flag) for item in bpy.data.objects for flag in FLAGS}
    with module("operators.borrow").Borrowed() as borrowed:
        module("operators.absence").absent(borrowed, scene, {"Blocker"})
        scene.frame_set(2)
        assert not any(getattr(blocker, flag) for flag in FLAGS)
        assert all(getattr(bpy.data.objects["Wall"], flag) for flag in FLAGS)
        assert not scene.render.use_persistent_data
    assert {(item.name, flag): getattr(item, flag) for item in bpy.data.objects for flag in FLAGS} == before
    assert scene.render.use_persistent_data
    curves = list(module("operators.animation").curves_of(blocker, "visible_shadow"))
    assert curves
    assert not any(curve.mute for curve in curves)


def test_lamps_are_points_and_directions(scene: Any, module: Any) -> None:
    add_light(scene, "Point", "POINT", (1.0, 2.0, 3.0))
    add_light(scene, "Sun", "SUN").rotation_euler = (0.0, 0.5 * math.pi, 0.0)
    add_light(scene, "Hidden", "AREA").hide_render = True
    add_light(scene, "Off", "SPOT").data.energy = 0.0
    inner = add_light(scene, "Inner", "AREA", (0.0, 0.0, 1.0))
    group = bpy.data.collections.new("Group")
    group.objects.link(inner)
    scene.collection.objects.unlink(inner)
    instancer = bpy.data.objects.new("Instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", group
    instancer.location = (5.0, 0.0, 0.0)
    scene.collection.objects.link(instancer)
    lamps = module("operators.lamps").lamps_of(scene, bpy.context.evaluated_depsgraph_get())
    places = sorted(lamp.place.round(5).tolist() for lamp in lamps)
    assert places == pytest.approx(np.array([[1, 0, 0, 0], [1, 2, 3, 1], [5, 0, 1, 1]]), abs=1e-5)
