"""Lens and motion together, against instants that are focused one by one and against rays.

Bounds in decibels as in `test_motion`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from potmesil_addon import cascade
from potmesil_addon.camera import Film
from potmesil_addon.cascade import parts_of
from potmesil_addon.focus import FocusSettings, focus_layer
from potmesil_addon.lens import Lens
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.samples import LensAttributes, Samples, Window
from potmesil_addon.shutter import Shutter, ShutterAttributes
from potmesil_addon.visibility import Visibility

from .helpers import Array
from .motion_scenes import (
    COLUMNS,
    PX,
    ROWS,
    WALL,
    Card,
    Scene,
    at_instant,
    decibels,
    exposed,
    plain,
    pose,
    samples_of,
    scene_named,
    seen,
    shown,
)

ALONG, EDGES = 40.0, 31.0


def lens_of(circle_px: float, focus: float = 10.0) -> Lens:
    """Return a lens that is focused at 10 m and gives 5 m a circle of some pixels of 0.1 mm."""
    # c = F^2 / n (1 / 5 - 1 / 10)
    return Lens(0.05, 0.05**2 / (10.0 * circle_px * 1e-4), focus)


FILM = Film(COLUMNS * 1e-4, ROWS * 1e-4, COLUMNS, ROWS)


def focused_instants(scene: Scene, times: Array, lenses: list[Lens]) -> Array:
    """Return the mean of eq. 22's pictures of instants that are known."""
    total = np.zeros((ROWS, COLUMNS, 4))
    window = Window(0, 0, COLUMNS, ROWS)
    for t, lens in zip(times, lenses, strict=True):
        layer = at_instant(scene, float(t), sub=3)
        total += run(focus_layer(layer, Samples((layer,), window, window), FocusSettings(lens, FILM))).picture
    return total / times.size


def cascaded(
    samples: Samples, lens: Lens, shutter: ShutterAttributes, visibility: Visibility = "none"
) -> Any:
    attributes = LensAttributes(lens.focal_length, lens.f_stop, lens.focus_distance)
    samples = replace(samples, lens=attributes, film=FILM, shutter=shutter)
    return run(process(samples, ProcessSettings(visibility=visibility)))


def through_aperture(scene: Scene, lens: Lens, a: tuple[float, float]) -> Scene:
    """Return the scene as a point of the aperture sees it, the plane in focus staying where it is.

    A point at depth z moves by the circle's radius times `a` = (x, y down), a point of the unit disc.
    """
    # r = F^2 / (2 n) (1/D - 1/z) on the film is what a camera that is moved by o sees, f o (1/D - 1/z).
    off = 0.5 * np.array(a) * lens.focal_length * lens.aperture_diameter / (1e-4 * scene.focal)

    def camera(t: Array) -> Array:
        moved = np.array(scene.camera(t))
        moved[..., :2, 3] -= off
        return moved

    middle = scene.middle + scene.focal * off / lens.focus_distance
    return replace(scene, camera=camera, middle=(float(middle[0]), float(middle[1])))


@cache
def lens_reference(name: str, circle_px: float, count: int = 1600) -> Array:
    """Return half a frame with depth of field: each ray has its time and its point of the aperture."""
    scene, lens = scene_named(name), lens_of(circle_px)
    # Points that leave no gaps in time, aperture and pixel: the golden ratio's steps for five dimensions.
    step = 1.1347241384015194 ** -np.arange(1.0, 6.0)
    share = (0.5 + np.outer(np.arange(1, count + 1), step)) % 1.0
    total = np.zeros((ROWS, COLUMNS, 4))
    for t, radius, angle, dx, dy in share:
        a = (
            math.sqrt(radius) * math.cos(2.0 * math.pi * angle),
            math.sqrt(radius) * math.sin(2.0 * math.pi * angle),
        )
        x, y = np.arange(COLUMNS) + dx, np.arange(ROWS)[:, np.newaxis] + dy
        total += seen(through_aperture(scene, lens, a), np.array(0.5 * t - 0.25), x, y)[0]
    return total / count


@pytest.mark.parametrize(
    ("name", "bound"), [("translation", ALONG), ("approach", EDGES), ("behind a post", EDGES)]
)
def test_defocused_card_hides_what_the_aperture_does_not_see(name: str, bound: float) -> None:
    """Edges are known to a part of the aperture at each instant, and to all of it over the exposure."""
    lens = lens_of(6.0)
    expected = lens_reference(name, 6.0)
    samples, shutter = samples_of(scene_named(name)), ShutterAttributes(frames=0.5)
    where = np.abs(expected - shown(samples)).max(axis=2) > 0.02
    without = decibels(cascaded(samples, lens, shutter).picture, expected, where)
    result = cascaded(samples, lens, shutter, "aperture")
    assert decibels(result.picture, expected, where) > max(bound, without + 2.0)
    assert 0.0 <= result.guessed.min() <= result.guessed.max() <= 1.0


def soft_lamp(u: Array, v: Array) -> Array:
    """Return a bell of a pixel's width at 5 m, which few rays sum up well."""
    bell = np.exp(-0.5 * (u**2 + v**2) / PX**2)
    return np.asarray(bell[..., np.newaxis] * np.array([100.0, 80.0, 60.0]))


def test_defocused_moving_lamp_is_a_disc_swept_along_its_path() -> None:
    card = Card(pose(lambda t: 40.0 * PX * t, lambda t: 16.0 * PX * t), soft_lamp, (4.0 * PX, 4.0 * PX))
    scene = Scene((replace(WALL, texture=plain((0.0, 0.0, 0.0))), card))
    lens = lens_of(7.0)
    times = (np.arange(80) + 0.5) / 80 * 0.5 - 0.25
    expected = focused_instants(scene, times, [lens] * 80)
    result = cascaded(samples_of(scene), lens, ShutterAttributes(frames=0.5))
    assert result.report["motion"][0]["hidden"] == "rendered"
    # Of the brightest, in the pixels that have a hundredth of it. Discs are put down each eighth of their
    # diameter, 8 or 9 over each other: 4 % rms of ripple, of which pixel and lamp leave less than half.
    lit = expected[..., 0] > 0.01 * expected[..., 0].max()
    assert decibels(result.picture / expected.max(), expected / expected.max(), lit) > EDGES
    np.testing.assert_allclose(result.picture.sum(axis=(0, 1)), expected.sum(axis=(0, 1)), rtol=0.01)
    # By geometry: as wide as the disc, as long as path and disc.
    rows, columns = np.nonzero(lit)
    assert np.ptp(columns) + 1 == pytest.approx(20.0 + 8.0, abs=2.0)
    assert np.ptp(rows) + 1 == pytest.approx(8.0 + 8.0, abs=2.0)


@pytest.mark.parametrize(("name", "bound"), [("translation", ALONG), ("approach", EDGES)])
def test_defocused_card_is_the_sum_of_focused_instants(name: str, bound: float) -> None:
    """An approaching card's circle grows with it."""
    scene, lens = scene_named(name), lens_of(6.0)
    times = (np.arange(48) + 0.5) / 48 * 0.5 - 0.25
    expected = focused_instants(scene, times, [lens] * 48)
    result = cascaded(samples_of(scene), lens, ShutterAttributes(frames=0.5))
    at_rest = focused_instants(scene, np.zeros(1), [lens])
    where = np.abs(expected - at_rest).max(axis=2) > 0.02
    assert decibels(at_rest, expected, where) < bound - 3.0
    assert decibels(result.picture, expected, where) > bound


def test_circle_follows_a_card_through_the_plane_of_focus() -> None:
    """A lamp comes from 7 m to 3 m, without moving on the film: 2.3 pixels, none, 5.3 pixels."""
    card = Card(pose(z=lambda t: 5.0 - 8.0 * t), soft_lamp, (4.0 * PX, 4.0 * PX))
    scene = Scene((replace(WALL, texture=plain((0.0, 0.0, 0.0))), card))
    lens = Lens(0.05, 0.05**2 / (40.0 * 1e-4), 5.0)
    times = (np.arange(64) + 0.5) / 64 * 0.5 - 0.25
    expected = focused_instants(scene, times, [lens] * 64)
    samples = samples_of(scene)
    result = cascaded(samples, lens, ShutterAttributes(frames=0.5))
    sharp = focused_instants(scene, np.zeros(1), [lens])
    peak = expected.max()
    lit = expected[..., 0] > 0.01 * peak
    assert decibels(sharp / peak, expected / peak, lit) < EDGES - 3.0
    assert decibels(result.picture / peak, expected / peak, lit) > EDGES


def test_blades_of_a_between_the_lens_shutter_stop_the_lens_down() -> None:
    """The radius rises and falls evenly, so light goes with its square and its sum with the cube."""
    scene, lens = scene_named("translation"), lens_of(10.0)
    share = (np.arange(64) + 0.5) / 64
    place = np.where(share < 0.5, np.cbrt(share / 4.0), 1.0 - np.cbrt((1.0 - share) / 4.0))
    opening = 2.0 * np.minimum(place, 1.0 - place)
    lenses = [replace(lens, f_stop=lens.f_stop / float(r)) for r in opening]
    expected = focused_instants(scene, 0.5 * place - 0.25, lenses)
    wide_open = focused_instants(scene, 0.5 * place - 0.25, [lens] * 64)
    at_rest = focused_instants(scene, np.zeros(1), [lens])
    where = np.abs(expected - at_rest).max(axis=2) > 0.02
    result = cascaded(samples_of(scene), lens, ShutterAttributes(frames=0.5, blade_time=0.5))
    assert decibels(wide_open, expected, where) < ALONG - 3.0
    assert decibels(result.picture, expected, where) > ALONG


def test_transparent_film_stays_so_through_lens_and_motion() -> None:
    pan = scene_named("pan")
    scene, lens = replace(pan, cards=(pan.cards[1],)), lens_of(6.0)
    times = (np.arange(48) + 0.5) / 48 * 0.5 - 0.25
    expected = focused_instants(scene, times, [lens] * 48)
    result = cascaded(samples_of(scene, companions=False), lens, ShutterAttributes(frames=0.5))
    where = expected[..., 3] > 0.01
    assert decibels(result.picture[..., 3:], expected[..., 3:]) > ALONG
    assert decibels(result.picture, expected, where) > EDGES


# Parts of the exposure


def test_parts_have_equal_light_and_no_gaps() -> None:
    parts = parts_of(Shutter(0.5, curve=((0.0, 0.0), (1.0, 1.0))), 5)
    np.testing.assert_allclose(parts, [(0.2 * n, 0.2 * (n + 1)) for n in range(5)])


def test_no_part_goes_on_from_one_opening_to_the_next() -> None:
    openings = ((0.0, 0.1), (0.4, 0.7), (0.9, 1.0))
    parts = parts_of(Shutter(0.5, openings=openings), 8)
    edges = [parts[0][0], *(last for _, last in parts)]
    assert edges[0] == 0.0
    assert edges[-1] == pytest.approx(1.0)
    assert np.isclose(edges, 0.2).any()
    assert np.isclose(edges, 0.8).any()
    # 2 of 8 parts for a fifth of the light, 5 for three fifths.
    assert len(parts) == 2 + 5 + 2


def test_more_openings_than_parts_are_divided_as_one() -> None:
    openings = tuple((0.1 * n, 0.1 * n + 0.05) for n in range(10))
    np.testing.assert_allclose(parts_of(Shutter(0.5, openings=openings), 2), [(0.0, 0.5), (0.5, 1.0)])


@pytest.mark.parametrize("name", ["translation", "approach", "crossing", "yaw", "behind a post", "lamp"])
def test_parts_are_as_good_as_instants(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few parts, blurred by motion and then focused, against focusing every instant by itself.

    The lamp goes eight pixels in a part, and half-way through it most pixels that it has lit show the wall.
    """
    if name == "lamp":
        card = Card(pose(lambda t: 120.0 * PX * t), soft_lamp, (4.0 * PX, 4.0 * PX))
        samples = samples_of(Scene((replace(WALL, texture=plain((0.02, 0.02, 0.02))), card)))
    else:
        samples = samples_of(scene_named(name))
    lens, shutter = lens_of(8.0), ShutterAttributes(frames=0.5)
    count, result = counted_parts(samples, lens, shutter, monkeypatch)
    assert count <= 8
    monkeypatch.setattr(cascade, "_part_count", lambda *_: 10000)
    many, expected = counted_parts(samples, lens, shutter, monkeypatch)
    assert many >= 2 * count
    peak = expected.max()
    where = np.abs(expected - shown(samples)).max(axis=2) > 0.02 * peak
    assert decibels(result / peak, expected / peak, where) > ALONG


def counted_parts(
    samples: Samples, lens: Lens, shutter: ShutterAttributes, monkeypatch: pytest.MonkeyPatch
) -> tuple[int, Any]:
    """Return in how many parts a picture was focused, and the picture."""
    focused = []

    def count(*arguments: Any) -> Any:
        focused.append(1)
        return focus_layer(*arguments)

    monkeypatch.setattr(cascade, "focus_layer", count)
    picture = cascaded(samples, lens, shutter, "aperture").picture
    return len(focused), picture


@pytest.mark.parametrize("size", [1.0, 2.0])
def test_something_tiny_moves(size: float) -> None:
    """So few samples that a look at some of all would miss them."""
    card = Card(pose(lambda t: 40.0 * PX * t), plain((1.0, 0.5, 0.2)), (size * PX, size * PX))
    result = cascaded(
        samples_of(Scene((WALL, card))), lens_of(6.0), ShutterAttributes(frames=0.5), "aperture"
    )
    assert np.isfinite(result.picture).all()
    assert result.report["motion"][0]["moving"] > 0.0


@pytest.mark.parametrize("name", ["translation", "dolly", "behind a post"])
def test_lens_that_blurs_nothing_leaves_the_blur_of_motion(name: str) -> None:
    """All circles are below half a pixel: the exposure is one part, and the lens has nothing to add."""
    samples = samples_of(scene_named(name))
    blurred = exposed(samples, Shutter(0.5))[0]
    result = cascaded(samples, lens_of(0.4), ShutterAttributes(frames=0.5), "aperture")
    where = np.abs(blurred - shown(samples)).max(axis=2) > 0.02
    assert decibels(result.picture, blurred, where) > ALONG
    assert result.report["motion"][0]["instants"] >= 8
