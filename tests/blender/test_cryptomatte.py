"""Coverages in real renders: the shares of the colours, and the artist's passes as they were."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .scenes import card


def _edges(scene: Any) -> None:
    """Add a slanted red card, and a red wire of half a pixel, before a blue wall."""
    red, blue = emitter("Red", (1.0, 0.0, 0.0)), emitter("Blue", (0.0, 0.0, 1.0))
    card(scene, "Wall", (0.0, 6.0, 0.0), 20.0, blue)
    card(scene, "Card", (-0.7, 3.0, 0.1), 1.2, red).rotation_euler = (0.0, 0.3, 0.0)
    wire = card(scene, "Wire", (0.5, 3.0, 0.0), 1.0, red)
    wire.scale = (0.016, 1.0, 1.6)
    wire.rotation_euler = (0.0, 0.1, 0.0)
    scene.cycles.samples = 64


def _samples(module: Any, tmp_path: Path) -> Any:
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    return module("potmesil_addon.exr").read_samples(tmp_path / "samples_0001.exr")


def _covers(layer: Any) -> dict[int, Any]:
    """Return the cover of each id of a layer."""
    matte = layer.cryptomatte
    return {
        int(wanted): np.where(matte.ids == wanted, matte.coverage, 0.0).sum(axis=0)
        for wanted in np.unique(matte.ids)
        if wanted
    }


def test_coverages_are_the_shares_of_the_colors(scene: Any, module: Any, tmp_path: Path) -> None:
    """Cycles filters both alike: of three plain colours each pixel is their mean by coverage."""
    _edges(scene)
    (layer,) = _samples(module, tmp_path).layers
    covers = _covers(layer)
    assert len(covers) == 3
    wall = max(covers.values(), key=lambda cover: cover.mean())
    np.testing.assert_allclose(layer.color[..., 2], wall, atol=1e-6)
    np.testing.assert_allclose(layer.color[..., 0], sum(covers.values()) - wall, atol=1e-6)
    assert ((wall > 0.05) & (wall < 0.95)).sum() > 60
    wire = min(covers.values(), key=lambda cover: cover.mean())
    assert 0.2 < wire.max() < 0.9


def test_coverages_are_the_alpha_before_a_clear_film(scene: Any, module: Any, tmp_path: Path) -> None:
    _edges(scene)
    scene.objects["Wall"].hide_render = True
    scene.render.film_transparent = True
    (layer,) = _samples(module, tmp_path).layers
    np.testing.assert_allclose(sum(_covers(layer).values()), layer.color[..., 3], atol=1e-6)
    assert (layer.color[..., 3] == 0.0).any()


def test_edges_are_split_by_their_coverages(scene: Any, module: Any, tmp_path: Path) -> None:
    """Between two surfaces of one colour only coverages tell."""
    _edges(scene)
    scene.objects["Wall"].data.materials[0] = scene.objects["Card"].data.materials[0]
    (layer,) = _samples(module, tmp_path).layers
    wall = max(_covers(layer).values(), key=lambda cover: cover.mean())
    radius = np.where(layer.depth < 4.0, np.float32(-8.0), np.float32(0.0))
    found = module("potmesil_addon.fragments").fragments_of(
        layer.color[np.newaxis],
        layer.depth[np.newaxis],
        radius[np.newaxis],
        1.0,
        mixed=True,
        cryptomattes=[layer.cryptomatte],
    )
    share = np.where(found.radius[0] < -4.0, found.coverage[0], 0.0)
    off = np.abs(share - (1.0 - wall))
    # Cycles' depth is that of one place in a pixel, so that beside a wire it may be the wall's all around.
    seen = (wall > 0.05) & (wall < 0.95)
    assert (off[seen] < 0.01).mean() > 0.9
    # Without them, neighbours are counted.
    guessed = module("potmesil_addon.fragments").fragments_of(
        layer.color[np.newaxis], layer.depth[np.newaxis], radius[np.newaxis], 1.0, mixed=True
    )
    without = np.where(guessed.radius[0] < -4.0, guessed.coverage[0], 0.0)
    assert np.abs(without - (1.0 - wall))[seen].mean() > 5.0 * off[seen].mean()


@pytest.mark.parametrize("own", [False, True])
def test_the_scenes_passes_stay_as_they_were(scene: Any, module: Any, tmp_path: Path, own: bool) -> None:
    _edges(scene)
    layer = bpy.context.view_layer
    layer.use_pass_cryptomatte_object = own
    layer.pass_cryptomatte_depth = 6
    samples = _samples(module, tmp_path)
    assert (layer.use_pass_cryptomatte_object, layer.pass_cryptomatte_depth) == (own, 6)
    raw = module("potmesil_addon.exr").read_raw(tmp_path / "samples_0001.exr")
    levels = {c.full_name.split(".")[-2] for c in raw.channels if "Crypto" in c.full_name}
    # What the artist asks for is there whole, for other programs.
    assert len(levels) == (3 if own else 2)
    assert samples.layers[0].cryptomatte is not None


@pytest.mark.parametrize(
    ("name", "value", "there"),
    [
        ("sampling", "FINE", True),
        ("sampling", "POINTS", False),
        ("use_lens", False, False),
        ("visibility", "none", False),
    ],
)
def test_coverages_are_rendered_where_they_are_used(
    scene: Any, module: Any, tmp_path: Path, name: str, value: Any, there: bool
) -> None:
    _edges(scene)
    setattr(scene.potmesil_camera, name, value)
    (layer,) = _samples(module, tmp_path).layers
    assert (layer.cryptomatte is not None) == there


def test_every_view_has_coverages_and_overscan_too(scene: Any, module: Any, tmp_path: Path) -> None:
    _edges(scene)
    scene.camera.data.dof.focus_distance = 6.0
    scene.camera.data.dof.aperture_fstop = 0.2
    scene.potmesil_camera.depth_peeling = "AUTOMATIC"
    scene.potmesil_camera.use_overscan = True
    samples = _samples(module, tmp_path)
    (layer,) = samples.layers
    assert samples.data_window.columns > samples.display_window.columns
    assert len(layer.hidden) >= 1
    for view in (layer, *layer.hidden):
        assert view.cryptomatte.coverage.shape[1:] == view.depth.shape
        assert view.cryptomatte.ids.shape == view.cryptomatte.coverage.shape
    # The wall alone is left: it covers all that it covered together with the others.
    wall = max(_covers(layer), key=lambda wanted: _covers(layer)[wanted].mean())
    assert set(_covers(layer.hidden[-1])) == {wall}
