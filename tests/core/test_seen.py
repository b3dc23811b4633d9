"""Light of mirrors and glass taken apart and put together: nothing is lost, and it ends with the mirror."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from potmesil_addon.camera import Film
from potmesil_addon.focus import FocusSettings
from potmesil_addon.lens import Lens, circle_of_confusion
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window
from potmesil_addon.seen import put_together, spread_out, take_apart

ROWS, COLUMNS = 48, 64
PITCH = 36e-3 / COLUMNS
MIRROR = (slice(8, 40), slice(12, 52))
SURFACE, IMAGE = 2.0, 6.0
LENS = Lens(focal_length=0.05, f_stop=0.15, focus_distance=2.0)


def scene(content: np.ndarray, *, share: float = 0.5, behind: float = SURFACE) -> Samples:
    """A mirror in a wall: the wall is grey, and so is the mirror's own light."""
    shape = (ROWS, COLUMNS)
    light = np.zeros((*shape, 4), dtype=np.float32)
    light[MIRROR] = [0.0, 0.0, 0.0, share]
    light[..., :3] = share * content[..., np.newaxis] * (light[..., 3:] > 0.0)
    color = np.full((*shape, 4), 0.2, dtype=np.float32)
    color[..., 3] = 1.0
    color[..., :3] += light[..., :3]
    depth = np.full(shape, behind, dtype=np.float32)
    depth[MIRROR] = SURFACE
    seen = np.where(light[..., 3] > 0.0, np.float32(IMAGE), depth)
    layer = SampleLayer("View", color, depth, reflected=SampleLayer("View (reflected)", light, seen))
    window = Window(0, 0, COLUMNS, ROWS)
    return Samples(
        (layer,),
        window,
        window,
        film=Film(36e-3, 27e-3, COLUMNS, ROWS),
        lens=LensAttributes(LENS.focal_length, LENS.f_stop, LENS.focus_distance),
    )


def spot() -> np.ndarray:
    content = np.zeros((ROWS, COLUMNS), dtype=np.float32)
    content[24, 32] = 10.0
    return content


def picture(samples: Samples, **settings: Any) -> np.ndarray:
    return run(process(samples, ProcessSettings(use_motion=False, **settings))).picture


def test_parts_add_up_to_the_picture() -> None:
    samples = scene(np.random.default_rng(3).random((ROWS, COLUMNS), dtype=np.float32))
    layer = samples.layers[0]
    parts = take_apart(layer)
    assert parts is not None
    shown = [(content.layer.color, content.rows, content.columns) for content in parts.contents]
    shares = [share.color for share in parts.shares]
    whole = parts.surfaces.color[..., :3] + put_together(shares, shown)
    np.testing.assert_allclose(whole, layer.color[..., :3], atol=1e-6)


@pytest.mark.parametrize("visibility", ["aperture", "none"])
@pytest.mark.parametrize("bent", [0.0, 1.0])
def test_a_lens_without_blur_gives_the_picture(visibility: str, bent: float) -> None:
    random = np.random.default_rng(4)
    samples = scene(random.random((ROWS, COLUMNS), dtype=np.float32))
    light = samples.layers[0].reflected
    assert light is not None
    bends = bent * random.random((ROWS, COLUMNS, 2), dtype=np.float32)
    layer = replace(samples.layers[0], reflected=replace(light, astigmatism=bends))
    samples = replace(samples, layers=(layer,))
    sharp = replace(samples, lens=replace(samples.lens, f_stop=1e5))
    result = picture(sharp, visibility=visibility)
    np.testing.assert_allclose(result, samples.layers[0].color, atol=1e-4)


def meeting(near: float, share: np.ndarray) -> Samples:
    """Two mirrors that meet in the middle, where each pixel's light is mixed by a share of the second.

    The first shows something dark and infinitely far away, the second something bright at a distance.
    """
    samples = scene(np.zeros((ROWS, COLUMNS), dtype=np.float32))
    layer = samples.layers[0]
    light = layer.reflected
    assert light is not None
    assert light.depth is not None
    whole = np.broadcast_to(share, (ROWS, COLUMNS)).astype(np.float32)
    of_mirrors = light.color.copy()
    content = DARK + (BRIGHT - DARK) * whole
    of_mirrors[..., :3] = of_mirrors[..., 3:] * content[..., np.newaxis]
    patch = np.where(whole >= 0.5, 2, 1).astype(np.int32)
    there = light.color[..., 3] > 0.0
    depth = np.where(there, np.where(patch == 2, np.float32(near), np.float32(np.inf)), light.depth)
    color = layer.color.copy()
    color[..., :3] += of_mirrors[..., :3]
    reflected = replace(
        light, color=of_mirrors, depth=depth, patch=np.where(there, patch, 0).astype(np.int32)
    )
    return replace(samples, layers=(replace(layer, color=color, reflected=reflected),))


DARK, BRIGHT = 0.1, 8.0


def test_pixels_in_which_mirrors_meet_are_parted() -> None:
    """What is bright in one mirror spreads nothing into another that is far out of focus."""
    share = np.clip(np.arange(COLUMNS) - 31.25, 0.0, 1.0)
    samples = meeting(SURFACE, share)
    layer = samples.layers[0]
    parts = take_apart(layer)
    assert parts is not None
    shown = [(content.layer.color, content.rows, content.columns) for content in parts.contents]
    whole = parts.surfaces.color[..., :3] + put_together([part.color for part in parts.shares], shown)
    np.testing.assert_allclose(whole, layer.color[..., :3], atol=1e-5)
    # Each patch shows one thing.
    for content, value in zip(parts.contents, (DARK, BRIGHT), strict=True):
        there = content.layer.color[..., 3] > 0.0
        shows = content.layer.color[there, 0] / content.layer.color[there, 3]
        np.testing.assert_allclose(shows, value, rtol=1e-3)
    result = picture(samples)
    inside = (slice(12, 36), slice(14, 50))
    np.testing.assert_allclose(result[inside], layer.color[inside], atol=2e-3)


def test_pixels_that_show_something_else_are_left_alone() -> None:
    share = np.clip(np.arange(COLUMNS) - 31.25, 0.0, 1.0)
    samples = meeting(SURFACE, share)
    layer = samples.layers[0]
    light = layer.reflected
    assert light is not None
    # A glint along the edge is brighter than either mirror.
    light.color[:, 31, :3] += 20.0 * light.color[:, 31, 3:]
    parts = take_apart(layer)
    assert parts is not None
    brightest = [
        (content.layer.color[..., :3] / np.maximum(content.layer.color[..., 3:], 1e-3)).max()
        for content in parts.contents
    ]
    assert brightest[0] == pytest.approx(20.0 + DARK, rel=1e-3)
    assert brightest[1] == pytest.approx(BRIGHT, rel=1e-3)


def test_flat_strips_of_a_mirror_show_no_more_than_the_lens_sees_in_them() -> None:
    """Beside a strip the directions change fast: a lens that would see 8 pixels of a plane sees 3."""
    lens = Lens(focal_length=0.05, f_stop=0.278, focus_distance=SURFACE)
    focus = FocusSettings(lens, Film(36e-3, 27e-3, COLUMNS, ROWS))
    assert abs(float(circle_of_confusion(np.inf, lens, focus.model))) / PITCH == pytest.approx(8.0, rel=0.01)
    near = np.float32(1.05 * SURFACE)
    light = np.ones((ROWS, COLUMNS, 4), dtype=np.float32)
    light[..., :3] = 0.0
    light[:, (29, 35), :3] = 10.0

    def middle(width: int) -> float:
        flat = np.abs(np.arange(COLUMNS) - 32) <= width // 2
        astigmatism = np.zeros((ROWS, COLUMNS, 2), dtype=np.float32)
        # So far away along x is what it shows.
        astigmatism[:, flat, 0] = 1.0 / near
        depth = np.full((ROWS, COLUMNS), near)
        spread = spread_out(SampleLayer("Seen", light, depth, astigmatism=astigmatism), focus)
        return float(spread.color[24, 32, 0])

    assert middle(COLUMNS) > 1.0
    assert middle(3) == pytest.approx(0.0, abs=1e-6)


def test_what_is_seen_is_blurred_by_its_own_distance() -> None:
    result = picture(scene(spot()))
    without = picture(scene(spot()), reflections=False)
    # The mirror is in focus, so that without its own distance the spot stays a pixel.
    assert without[24, 32, 0] == pytest.approx(5.2, rel=1e-3)
    lit = result[..., 0] - 0.2 > 1e-4
    radius = 0.5 * abs(float(circle_of_confusion(IMAGE, LENS, "cycles"))) / PITCH
    assert radius > 4.0
    y, x = np.nonzero(lit)
    assert np.hypot(y - 24, x - 32).max() == pytest.approx(radius, abs=1.5)
    np.testing.assert_allclose(np.sum(result[..., 0] - 0.2), 5.0, rtol=0.01)


def test_light_ends_where_the_mirror_in_focus_ends() -> None:
    content = np.full((ROWS, COLUMNS), 4.0, dtype=np.float32)
    samples = scene(content, behind=30.0)
    result = picture(samples)
    inside = np.zeros((ROWS, COLUMNS), dtype=bool)
    inside[MIRROR] = True
    # The corners' pixels lie beside two edges, at which the wall is carried on behind the mirror.
    np.testing.assert_allclose(result[inside, 0], 2.2, rtol=0.02)
    np.testing.assert_allclose(result[~inside, 0], 0.2, rtol=2e-3)


def test_a_mirror_out_of_focus_ends_softly_around_what_is_sharp() -> None:
    content = np.full((ROWS, COLUMNS), 4.0, dtype=np.float32)
    samples = scene(content, behind=30.0)
    near = replace(samples, lens=replace(samples.lens, focus_distance=IMAGE))
    result = picture(near)
    edge = result[24, 4:24, 0]
    assert edge[0] == pytest.approx(0.2, abs=0.02)
    assert edge[-1] == pytest.approx(2.2, rel=0.01)
    assert (np.diff(edge) > -0.02).all()
    assert ((edge > 0.5) & (edge < 1.9)).sum() >= 3


def test_colors_of_light_stay() -> None:
    samples = scene(np.ones((ROWS, COLUMNS), dtype=np.float32))
    layer = samples.layers[0]
    assert layer.reflected is not None
    tinted = layer.reflected.color * np.float32([1.0, 0.6, 0.2, 1.0])
    color = layer.color.copy()
    color[..., :3] += tinted[..., :3] - layer.reflected.color[..., :3]
    layer = replace(layer, color=color, reflected=replace(layer.reflected, color=tinted))
    result = picture(replace(samples, layers=(layer,)))
    np.testing.assert_allclose(result[24, 32, :3], [0.7, 0.5, 0.3], rtol=1e-3)


def test_nothing_is_taken_apart_without_mirrors() -> None:
    layer = scene(spot()).layers[0]
    assert take_apart(replace(layer, reflected=None)) is None
    assert layer.reflected is not None
    dark = replace(layer.reflected, color=np.zeros_like(layer.reflected.color))
    assert take_apart(replace(layer, reflected=dark)) is None
    without_depth = replace(layer.reflected, depth=None)
    assert take_apart(replace(layer, reflected=without_depth)) is None


def test_other_views_are_taken_apart_too() -> None:
    layer = scene(spot()).layers[0]
    other = replace(layer, name="View (stationary)")
    parts = take_apart(replace(layer, stationary=other, moving=other, hidden=(other,)))
    assert parts is not None
    for whole in (parts.surfaces, *parts.shares):
        views = (whole.stationary, whole.moving, *whole.hidden)
        for view in views:
            assert view is not None
            np.testing.assert_array_equal(view.color, whole.color)
            assert view.reflected is None
