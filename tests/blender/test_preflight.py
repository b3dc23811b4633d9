"""The pre-flight check on real scenes."""

from __future__ import annotations

from typing import Any

import bpy
import pytest

from sample_scenes.building import emitter

from .scenes import card


def _titles(scene: Any, module: Any) -> list[str]:
    facts = module("operators.scene").scene_facts(scene)
    return [finding.title for finding in module("potmesil_addon.preflight").check_scene(facts)]


def test_prepared_scene_has_no_findings(scene: Any, module: Any) -> None:
    bpy.ops.potmesil.setup_passes()
    assert _titles(scene, module) == []


def test_findings_name_what_is_there(scene: Any, module: Any) -> None:
    for x in (0.0, 1.0):
        card(scene, "Card", (x, 5.0, 0.0), 1.0, emitter("Glow", (1.0, 1.0, 1.0)))
    scene.camera.data.dof.use_dof = True
    scene.cycles.use_denoising = True
    scene.cycles.sample_clamp_direct = 10.0
    titles = _titles(scene, module)
    assert any(title.startswith("Passes Off: Z, Vector, Object Index") for title in titles)
    assert {"Objects Share Index 0", "Camera Blurs Already", "Denoising On", "Samples Clamped"} <= set(titles)


def test_focus_that_was_never_set_is_named_and_renders_as_in_cycles(scene: Any, module: Any) -> None:
    card(scene, "Wall", (0.0, 5.0, 0.0), 20.0, emitter("Glow", (1.0, 1.0, 1.0)))
    scene.camera.data.dof.focus_distance = 0.0
    assert "Focus Distance Is 0" in _titles(scene, module)
    assert bpy.ops.potmesil.render() == {"FINISHED"}


def test_render_refuses_without_a_camera(scene: Any) -> None:
    scene.camera = None
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.potmesil.render()
    assert "no camera" in bpy.context.window_manager.potmesil_camera.error


def test_render_refuses_a_panoramic_camera(scene: Any) -> None:
    scene.camera.data.type = "PANO"
    with pytest.raises(RuntimeError, match="panoramic"):
        bpy.ops.potmesil.render()


def test_set_up_passes_numbers_objects_and_keeps_what_is_unique(scene: Any) -> None:
    glow = emitter("Glow", (1.0, 1.0, 1.0))
    cards = [card(scene, f"Card {i}", (i, 5.0, 0.0), 1.0, glow) for i in range(5)]
    for item, index in zip(cards, (7, 7, 0, 3, 0), strict=True):
        item.pass_index = index
    bpy.ops.potmesil.setup_passes()
    layer = scene.view_layers[0]
    assert layer.use_pass_z
    assert layer.use_pass_vector
    assert layer.use_pass_object_index
    indices = [item.pass_index for item in cards]
    assert len(set(indices)) == 5
    assert 0 not in indices
    assert indices[0] == 7
    assert indices[3] == 3
    before = list(indices)
    bpy.ops.potmesil.setup_passes()
    assert [item.pass_index for item in cards] == before


def test_set_up_passes_undoes(scene: Any) -> None:
    card(scene, "Card", (0.0, 5.0, 0.0), 1.0, emitter("Glow", (1.0, 1.0, 1.0)))
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.potmesil.setup_passes()
    bpy.ops.ed.undo_push(message="after")
    assert bpy.data.objects["Card"].pass_index == 1
    bpy.ops.ed.undo()
    assert bpy.data.objects["Card"].pass_index == 0
    assert not bpy.context.scene.view_layers[0].use_pass_z
