"""How many renders a frame takes, as the panel says, and as they are counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from sample_scenes.building import emitter

from .scenes import card
from .test_motion_export import keyed
from .test_reflections import clear_glass, silver


@pytest.fixture
def counts(scene: Any, module: Any) -> Callable[..., tuple[int, int]]:
    """Change settings, and return the counts."""

    def find(**values: Any) -> tuple[int, int]:
        for name, value in values.items():
            setattr(scene.potmesil_camera, name, value)
        found = module("operators.cost").render_counts(scene)
        return found.full, found.probes

    return find


def test_a_picture_alone_is_one_render(counts: Any) -> None:
    assert counts(use_hidden_surfaces=False) == (1, 0)


def test_every_setting_counts(scene: Any, counts: Any) -> None:
    card(scene, "Mirror", (0.0, 5.0, 0.0), 1.0, silver())
    assert counts(use_hidden_surfaces=True) == (3, 0)
    assert counts(reflections="REFLECTIONS") == (3, 6)
    assert counts(depth_peeling="AUTOMATIC", peel_count=3) == (6, 9)
    assert counts(use_lens=False) == (3, 6)
    assert counts(reflections="REFLECTIONS_AND_SHADOWS", use_hidden_surfaces=False) == (4, 10)
    assert counts(use_motion=False, use_lens=True) == (4, 7)
    assert counts(use_lens=False) == (1, 0)


def test_glass_has_two_kinds_of_light(scene: Any, counts: Any) -> None:
    item = card(scene, "Window", (0.0, 5.0, 0.0), 1.0, clear_glass(1.5))
    assert counts(use_hidden_surfaces=False, reflections="REFLECTIONS") == (1, 8)
    item.potmesil_camera.surface = "POLISHED"
    assert counts() == (1, 4)
    item.hide_render = True
    assert counts() == (1, 0)


def test_collections_that_are_marked_count(scene: Any, counts: Any) -> None:
    for name in ("Near", "Far", "Ground"):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        collection.potmesil_camera.peel = name != "Ground"
    assert counts(use_hidden_surfaces=False, depth_peeling="COLLECTIONS") == (3, 0)


def test_other_engines_render_once(scene: Any, counts: Any) -> None:
    card(scene, "Mirror", (0.0, 5.0, 0.0), 1.0, silver())
    scene.render.engine = "BLENDER_WORKBENCH"
    assert counts(reflections="REFLECTIONS_AND_SHADOWS", depth_peeling="AUTOMATIC") == (1, 0)


@pytest.mark.parametrize("reflections", ["REFLECTIONS", "REFLECTIONS_AND_SHADOWS"])
def test_as_many_are_rendered(scene: Any, module: Any, counts: Any, tmp_path: Path, reflections: str) -> None:
    card(scene, "Mirror", (0.0, 6.0, 0.0), 40.0, silver())
    card(scene, "Window", (-1.0, 5.0, 0.0), 1.0, clear_glass(1.5))
    item = card(scene, "Moving", (0.0, 4.0, 0.0), 0.5, emitter("Glow", (1.0, 1.0, 1.0)))
    keyed(item, "location", {0: (-0.5, 4.0, 0.0), 2: (0.5, 4.0, 0.0)})
    scene.cycles.samples = 1
    said = counts(use_overscan=False, use_hidden_surfaces=True, reflections=reflections)
    rendered = []

    def render(each: Any) -> Any:
        rendered.append(each == scene)
        bpy.ops.render.render(scene=each.name)
        yield 1.0

    list(module("operators.export").export_samples(scene, tmp_path / "a.exr", render))
    assert (rendered.count(True), rendered.count(False)) == said


class Layout:
    """A stand-in that notes what a panel draws; the bpy module has no window."""

    def __init__(self) -> None:
        self.drawn: list[str] = []
        self.active = True

    def _same(self, **_: Any) -> Layout:
        return self

    column = row = split = _same

    def prop(self, _: Any, name: str, **__: Any) -> None:
        self.drawn.append(name)

    def label(self, text: str = "", **_: Any) -> None:
        self.drawn.append(text)


@pytest.mark.parametrize(
    ("values", "label"),
    [
        ({}, "reflections"),
        ({"use_hidden_surfaces": True}, "Up to 3 Renders"),
        ({"reflections": "REFLECTIONS"}, "1 Render and 4 Probes"),
        ({"reflections": "REFLECTIONS_AND_SHADOWS"}, "Up to 4 Renders and 10 Probes"),
    ],
)
def test_the_panel_says_what_it_costs(
    scene: Any, module: Any, counts: Any, values: dict[str, Any], label: str
) -> None:
    card(scene, "Mirror", (0.0, 5.0, 0.0), 1.0, silver())
    counts(**{"use_hidden_surfaces": False, **values})
    layout = Layout()
    module("ui.render_tab")._reflections(layout, bpy.context)
    assert layout.drawn[-1] == label
    assert ("max_roughness" in layout.drawn) == ("reflections" in values)


def test_the_panel_of_an_object_says_what_its_material_is(scene: Any, module: Any) -> None:
    item = card(scene, "Mirror", (0.0, 5.0, 0.0), 1.0, silver())
    bpy.context.view_layer.objects.active = item
    panel = module("ui.render_tab").POTMESIL_PT_object
    assert panel.bl_context == "object"
    assert panel.poll(bpy.context)
    for surface, drawn in (("AUTO", "As Material: Mirror"), ("GLASS", "surface")):
        item.potmesil_camera.surface = surface
        layout = Layout()
        panel.draw(SimpleNamespace(layout=layout), bpy.context)
        assert layout.drawn[-1] == drawn
        assert not layout.active


def test_panels_do_not_look_into_materials_again_and_again(
    scene: Any, module: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    cost = module("operators.cost")
    card(scene, "Mirror", (0.0, 5.0, 0.0), 1.0, silver())
    asked: list[str] = []

    def surface_of(asked_of: Any, limit: float) -> Any:
        asked.append(asked_of.name)
        return module("operators.surfaces").surface_of(asked_of, limit)

    monkeypatch.setattr(cost, "surface_of", surface_of)
    monkeypatch.setattr(cost, "_KEPT_SECONDS", 60.0)
    monkeypatch.setattr(cost, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    kind = module("potmesil_addon.surfaces").SurfaceKind
    assert [cost.kinds_in(scene) for _ in range(3)] == [{kind.MIRROR}] * 3
    assert asked == ["Mirror"]
    card(scene, "Window", (0.0, 5.0, 0.0), 1.0, clear_glass(1.5))
    assert cost.kinds_in(scene) == {kind.MIRROR, kind.GLASS}
    cost._Last.key = None
