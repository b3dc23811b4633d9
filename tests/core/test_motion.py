"""The motion processor against sums of instants of scenes that are known at every instant.

Bounds in decibels are for the pixels that motion changes, colours being from 0 to about 1. Samples are
joined linearly: a picture that moves by some pixels is blurred along its path anyway, and what is left is
under 1 % rms, 40 dB. Where edges turn or grow by less than a few pixels, an edge of contrast 0.4 is off
by up to a sixth of it on the fifth or less of the changed pixels that are edges: 3 % rms, 31 dB, at worst.
"""

from __future__ import annotations

import contextlib
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy import ndimage

from potmesil_addon import jit
from potmesil_addon.errors import PotmesilError
from potmesil_addon.motion import MotionSettings, expose_layer, prepare
from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.samples import SampleLayer, Samples, Window
from potmesil_addon.shutter import Shutter, ShutterAttributes, Slit, SlitEdge

from .helpers import Array, Picture
from .motion_scenes import (
    COLUMNS,
    FOCAL,
    MIDDLE,
    PX,
    ROWS,
    WALL,
    Card,
    Scene,
    at_instant,
    decibels,
    even,
    exposed,
    mean_of_instants,
    moving,
    plain,
    pose,
    samples_of,
    scene_named,
    shown,
    swept,
    waves,
)

needs_numba = pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")
models = pytest.mark.parametrize("model", ["object", "vector"])

ALONG, EDGES = 40.0, 31.0
"""Bounds in dB; see above."""

OVERSCAN = Window(-16, -12, COLUMNS + 16, ROWS + 12)
HALF = Shutter(0.5)


@cache
def reference(name: str, begin: float = -0.25, end: float = 0.25) -> Array:
    return mean_of_instants(scene_named(name), even(begin, end), 128)


def changed(samples: Samples, expected: Array) -> npt.NDArray[np.bool_]:
    """Return which pixels motion changes by more than 2 %."""
    return np.asarray(np.abs(expected - shown(samples)).max(axis=2) > 0.02)


def check(samples: Samples, shutter: Shutter, expected: Array, bound: float, **others: Any) -> Any:
    """Assert that a picture is within a bound, which the picture at rest is not; return the report."""
    where = changed(samples, expected)
    assert where.sum() > 50
    assert decibels(shown(samples), expected, where) < bound - 3.0
    picture, guessed, report = exposed(samples, shutter, **others)
    assert np.isfinite(picture).all()
    assert picture.min() >= 0.0
    assert decibels(picture, expected, where) > bound
    # Elsewhere an edge of contrast 0.4 is off by a quarter of it at most, halfway between two samples.
    assert np.abs(picture - expected)[~where].max() < 0.02 + 0.1
    assert 0.0 <= guessed.min() <= guessed.max() <= 1.0
    return report


# Sums of instants, what is hidden being rendered


def test_reference_does_not_depend_on_its_instants() -> None:
    """Else it could not judge 40 dB; it is of 128 instants of four rays."""
    for name in ("translation", "yaw"):
        other = mean_of_instants(scene_named(name), even(-0.25, 0.25), 203, seed=0.13)
        assert decibels(reference(name), other, changed(samples_of(scene_named(name)), other)) > ALONG + 10.0


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        ("translation", ALONG),
        ("diagonal", ALONG),
        ("acceleration", ALONG),
        ("curve", ALONG),
        ("rotation", EDGES),
        ("approach", EDGES),
        ("yaw", EDGES),
    ],
)
def test_moving_card_is_the_sum_of_its_instants(name: str, bound: float) -> None:
    samples = samples_of(scene_named(name))
    report = check(samples, HALF, reference(name), bound)
    assert report.hidden == "rendered"
    assert report.guessed == 0.0


@pytest.mark.parametrize("name", ["translation", "acceleration", "curve"])
def test_moving_card_is_the_sum_of_its_instants_sample_by_sample(name: str) -> None:
    report = check(samples_of(scene_named(name)), HALF, reference(name), ALONG, model="vector")
    assert (report.object_paths, report.sample_paths) == (0, 1)
    assert report.instants >= report.longest_path_px


@models
@pytest.mark.parametrize(("position", "begin"), [("start", 0.0), ("center", -0.25), ("end", -0.5)])
def test_position_of_the_frame_in_the_interval(position: Any, begin: float, model: Any) -> None:
    scene = scene_named("diagonal")
    expected = reference("diagonal", begin, begin + 0.5)
    check(samples_of(scene), Shutter(0.5, position), expected, ALONG, model=model)


def of_triangle(share: Array, _x: Array, _y: Array) -> Array:
    """Return times at which shares of a triangle's light have come in: an eighth of a parabola each way."""
    rising = np.sqrt(0.5 * np.minimum(share, 0.5))
    falling = 1.0 - np.sqrt(0.5 * np.minimum(1.0 - share, 0.5))
    return np.asarray(0.5 * np.where(share < 0.5, rising, falling) - 0.25)


@models
def test_triangular_shutter_curve(model: Any) -> None:
    scene = scene_named("acceleration")
    shutter = Shutter(0.5, curve=((0.0, 0.0), (0.5, 1.0), (1.0, 0.0)))
    expected = mean_of_instants(scene, of_triangle, 128)
    check(samples_of(scene), shutter, expected, ALONG, model=model)
    assert decibels(expected, reference("acceleration"), changed(samples_of(scene), expected)) < ALONG - 6.0


@models
def test_multiple_exposure(model: Any) -> None:
    def times(share: Array, _x: Array, _y: Array) -> Array:
        opening = np.floor(3.0 * share)
        return np.asarray(0.5 * (0.4 * opening + 0.2 * (3.0 * share - opening)) - 0.25)

    shutter = Shutter(0.5, openings=((0.0, 0.2), (0.4, 0.6), (0.8, 1.0)))
    scene = scene_named("diagonal")
    expected = mean_of_instants(scene, times, 126)
    check(samples_of(scene), shutter, expected, ALONG, model=model)
    assert decibels(expected, reference("diagonal"), changed(samples_of(scene), expected)) < ALONG - 6.0


def slit_times(edge: SlitEdge, width: float, frames: float) -> Callable[[Array, Array, Array], Array]:
    def times(share: Array, x: Array, y: Array) -> Array:
        along = {"top": y, "bottom": 1.0 - y, "left": x, "right": 1.0 - x}[edge]
        return np.asarray(frames * ((share - 0.5) * width + (along - 0.5) * (1.0 - width)))

    return times


@pytest.mark.parametrize("edge", ["top", "bottom", "left", "right"])
def test_slit_from_each_edge(edge: SlitEdge) -> None:
    scene = moving(x=lambda t: 30.0 * PX * t, y=lambda t: 20.0 * PX * t)
    expected = mean_of_instants(scene, slit_times(edge, 0.2, 1.0), 128)
    report = check(samples_of(scene), Shutter(1.0, slit=Slit(edge, 0.2)), expected, ALONG)
    assert report.object_paths == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slit_overtaken_slowly(sign: float) -> None:
    """A card goes three quarters as fast as the slit, with it and against it."""
    scene = moving(y=lambda t: sign * 60.0 * PX * t)
    expected = mean_of_instants(scene, slit_times("top", 0.2, 1.0), 128)
    check(samples_of(scene), Shutter(1.0, slit=Slit("top", 0.2)), expected, ALONG)


def test_slit_of_full_width_is_no_slit() -> None:
    samples = samples_of(scene_named("rotation"))
    picture, _, _ = exposed(samples, Shutter(0.5, slit=Slit("left", 1.0)))
    np.testing.assert_allclose(picture, exposed(samples, HALF)[0], atol=1e-6)


def test_slit_of_no_width_shears_a_moving_card() -> None:
    scene = moving(x=lambda t: 30.0 * PX * t)
    expected = mean_of_instants(scene, slit_times("top", 0.0, 1.0), 64)
    check(samples_of(scene), Shutter(1.0, slit=Slit("top", 0.0)), expected, EDGES)


# The camera


def test_pan_is_the_sum_of_its_instants() -> None:
    samples = samples_of(scene_named("pan"), window=OVERSCAN, companions=False)
    report = check(samples, HALF, reference("pan"), ALONG)
    assert report.moving > 0.99


def test_pan_of_a_sky_at_infinity_needs_no_depth() -> None:
    """Turning the camera moves points alike at any depth."""
    samples = samples_of(scene_named("pan"), window=OVERSCAN, companions=False)
    far = replace(samples.layers[0], depth=np.full_like(samples.layers[0].depth, np.inf))
    check(replace(samples, layers=(far,)), HALF, reference("pan"), ALONG)


def test_dolly_with_two_depth_layers() -> None:
    """What the card uncovers of the wall is in no sample: the error falls to less than a third."""
    samples = samples_of(scene_named("dolly"), window=OVERSCAN, companions=False)
    expected = reference("dolly")
    where = changed(samples, expected)
    picture, guessed, report = exposed(samples, HALF)
    assert decibels(picture, expected, where) > decibels(shown(samples), expected, where) + 10.0
    assert report.hidden == "filled"
    # Off the edges, where nothing is uncovered, it is the sum of instants.
    sure = ndimage.binary_erosion(guessed == 0.0, iterations=2, border_value=1) & where
    assert sure.sum() > 1000
    assert decibels(picture, expected, sure) > ALONG


def test_moving_card_before_a_moving_camera() -> None:
    """Both companions are seen by the camera: nothing is guessed but beyond the border."""
    camera = pose(x=lambda t: 0.4 * t, z=lambda t: 0.0 * t)
    card = moving(x=lambda t: 16.0 * PX * t, y=lambda t: 10.0 * PX * t).cards[1]
    scene = Scene((WALL, card), camera, camera_moves=True)
    expected = mean_of_instants(scene, even(-0.25, 0.25), 128)
    report = check(samples_of(scene, window=OVERSCAN), HALF, expected, ALONG)
    assert report.guessed == 0.0


def test_camera_that_moves_with_the_card_sees_it_sharp() -> None:
    scene = Scene(
        (WALL, moving(x=lambda t: 1.2 * t).cards[1]),
        pose(x=lambda t: -1.2 * t, z=lambda t: 0.0 * t),
        camera_moves=True,
    )
    samples = samples_of(scene, window=OVERSCAN)
    picture, _, _ = exposed(samples, HALF)
    inside = ndimage.binary_erosion(at_instant(scene).object_index == 1, iterations=2)
    np.testing.assert_allclose(picture[inside], shown(samples)[inside], atol=1e-4)


# Who hides whom


def test_card_passes_behind_what_stands_before_it() -> None:
    """The post's edges lie on pixel borders, so that no sample of it is mixed."""
    scene = scene_named("behind a post")
    check(samples_of(scene), HALF, reference("behind a post"), ALONG)


@models
def test_nearer_of_two_movers_hides_the_other_at_each_instant(model: Any) -> None:
    scene = scene_named("crossing")
    expected = reference("crossing", 0.0, 0.5)
    report = check(samples_of(scene), Shutter(0.5, "start"), expected, ALONG, model=model)
    assert report.object_paths == (2 if model == "object" else 0)


def test_two_cards_apart_have_their_own_motions() -> None:
    texture = waves((0.6, 0.4, 0.3), 0.7)
    left = Card(pose(lambda t: PX * (-24.0 + 18.0 * t), lambda t: 6.0 * PX * t), texture, (0.3, 0.3), 1)
    right = Card(pose(lambda t: 24.0 * PX + 0.0 * t, lambda t: -20.0 * PX * t), texture, (0.3, 0.3), 2)
    scene = Scene((WALL, left, right))
    report = check(samples_of(scene), HALF, mean_of_instants(scene, even(-0.25, 0.25), 128), ALONG)
    assert (report.object_paths, report.sample_paths) == (2, 0)


@pytest.mark.parametrize("depth", [5.0, 6.5])
def test_nothing_spans_two_cards_that_part(depth: float) -> None:
    """They touch in the frame: each edge ends within a pixel, and the wall shows between them."""
    scale = depth / 5.0
    left = moving(x=lambda t: -0.3125 - 20.0 * PX * t).cards[1]
    right = Card(
        pose(x=lambda t: scale * (0.3125 + 20.0 * PX * t), z=lambda t: depth + 0.0 * t),
        waves((0.8, 0.2, 0.2), 0.9), (0.3125 * scale, 0.4), 2,
    )  # fmt: skip
    scene = Scene((WALL, replace(left, half=(0.3125, 0.4)), right))
    expected = mean_of_instants(scene, even(0.0, 0.5), 128)
    check(samples_of(scene), Shutter(0.5, "start"), expected, EDGES)


def test_card_that_turns_into_another_ones_way() -> None:
    """A bar that turns about its middle goes nowhere on the mean, yet sweeps over the card's path."""
    texture = waves((0.8, 0.3, 0.2), 0.6)
    bar = Card(pose(roll=lambda t: 3.0 * t, z=lambda t: 4.0 + 0.0 * t), texture, (1.4, 0.12), 2)
    card = Card(
        pose(lambda t: 50.0 * PX * t, lambda t: -0.75 + 0.0 * t), waves((0.3, 0.7, 0.6), 0.8), (0.3, 0.2)
    )
    scene = Scene((WALL, bar, card))
    expected = mean_of_instants(scene, even(-0.25, 0.25), 128)
    check(samples_of(scene), HALF, expected, EDGES)
    # Where both pass they share the exposure.
    both = swept(replace(scene, cards=(WALL, bar)), -0.25, 0.25) & swept(
        replace(scene, cards=(WALL, card)), -0.25, 0.25
    )
    picture, _, _ = exposed(samples_of(scene), HALF)
    assert both.sum() > 20
    assert decibels(picture, expected, both) > EDGES


@models
def test_card_leaves_through_the_border(model: Any) -> None:
    scene = scene_named("out of the picture")
    check(samples_of(scene, window=OVERSCAN), HALF, reference("out of the picture"), ALONG, model=model)


# One render alone


@pytest.mark.parametrize("name", ["translation", "diagonal", "acceleration"])
@pytest.mark.parametrize("vectors", [False, True], ids=["paths", "vectors"])
def test_without_companions_the_hidden_is_filled_in_and_said_so(name: str, vectors: bool) -> None:
    """The wall behind has to be guessed: less than a third of the error is left."""
    samples = samples_of(scene_named(name), companions=False, paths=not vectors, vectors=vectors)
    expected = reference(name)
    where = changed(samples, expected)
    picture, guessed, report = exposed(samples, HALF)
    assert report.hidden == "filled"
    assert decibels(picture, expected, where) > decibels(shown(samples), expected, where) + 9.5
    # Only where the card was in the frame there is anything to guess.
    there = ndimage.binary_dilation(samples.layers[0].object_index == 1, iterations=4)
    assert guessed[there].max() > 0.3
    assert not guessed[~there].any()
    sure = where & (guessed < 0.02)
    assert decibels(picture, expected, sure) > EDGES


def test_plain_wall_is_filled_in_as_it_is() -> None:
    scene = moving(x=lambda t: 40.0 * PX * t)
    scene = replace(scene, cards=(replace(WALL, texture=plain((0.5, 0.4, 0.2))), scene.cards[1]))
    expected = mean_of_instants(scene, even(-0.25, 0.25), 128)
    check(samples_of(scene, companions=False), HALF, expected, ALONG)


def test_shutter_that_opens_late_shows_the_filled_wall() -> None:
    """From frame 1/2 on the card has left its place, which has to be seen without it."""
    scene = moving(x=lambda t: 80.0 * PX * t - 24.0 * PX)
    scene = replace(scene, cards=(replace(WALL, texture=plain((0.5, 0.4, 0.2))), scene.cards[1]))
    shutter = Shutter(1.0, "start", openings=((0.5, 0.75),))
    samples = samples_of(scene, companions=False)
    check(samples, shutter, mean_of_instants(scene, even(0.5, 0.75), 128), ALONG)


# The vector pass


def blob(vector: tuple[float, float, float, float]) -> Samples:
    """Return a bright patch on black, which alone has a vector."""
    color = np.zeros((41, 61, 4), dtype=np.float32)
    color[..., 3] = 1.0
    vectors = np.zeros((41, 61, 4), dtype=np.float32)
    patch = (slice(18, 23), slice(27, 34))
    color[patch] = 1.0
    vectors[patch] = vector
    window = Window(0, 0, 61, 41)
    return Samples((SampleLayer("", color, None, None, vectors),), window, window)


def shift(samples: Samples, shutter: Shutter) -> tuple[float, float]:
    """Return by how much the light's middle moves, x right and y down."""
    light = exposed(samples, shutter)[0][..., 0].astype(np.float64)
    assert light.sum() == pytest.approx(35.0, rel=1e-4)
    rows, columns = np.mgrid[0:41, 0:61]
    return float((light * columns).sum() / light.sum()) - 30.0, float(
        (light * rows).sum() / light.sum()
    ) - 20.0


ONE_SIDE = [
    # Half of the way to the next frame: x - Z and y + W, or against the way from the last: x + X, y - Y.
    ((6.0, 0.0, 0.0, 0.0), (-3.0, 0.0)),
    ((0.0, 6.0, 0.0, 0.0), (0.0, 3.0)),
    ((0.0, 0.0, 6.0, 0.0), (-3.0, 0.0)),
    ((0.0, 0.0, 0.0, 6.0), (0.0, 3.0)),
]


@models
@pytest.mark.parametrize(("vector", "middle"), ONE_SIDE)
def test_each_component_of_a_vector_has_blender_s_sign(vector: Any, middle: Any, model: Any) -> None:
    """Where one side is 0 all over, as at an animation's ends, motion is even."""
    samples = blob(vector)
    for position, sign in (("start", 1.0), ("end", -1.0), ("center", 0.0)):
        settings = MotionSettings(Shutter(1.0, position), model)  # type: ignore[arg-type]
        motion = prepare(samples.layers[0], samples, settings)
        assert motion is not None
        picture = run(expose_layer(motion, samples.layers[0]))[0][..., 0].astype(np.float64)
        rows, columns = np.mgrid[0:41, 0:61]
        assert (picture * columns).sum() / 35.0 == pytest.approx(30.0 + sign * middle[0], abs=0.02)
        assert (picture * rows).sum() / 35.0 == pytest.approx(20.0 + sign * middle[1], abs=0.02)


def test_vectors_of_both_sides_bend_the_path_to_a_parabola() -> None:
    # From (+6, -2) through 0 to (-2, +5): v = (-4, 3.5), a = (2, 1.5).
    samples = blob((6.0, 2.0, 2.0, 5.0))
    # The middle of v t + a t^2 over the frame is v / 2 + a / 3.
    assert shift(samples, Shutter(1.0, "start")) == pytest.approx((-2.0 + 2.0 / 3.0, 1.75 + 0.5), abs=0.03)
    assert shift(samples, Shutter(1.0, "end")) == pytest.approx((2.0 + 2.0 / 3.0, -1.75 + 0.5), abs=0.03)


@pytest.mark.parametrize(("position", "place"), [("start", (-2.0, 5.0)), ("end", (6.0, -2.0))])
def test_parabola_goes_through_the_places_of_three_frames(position: Any, place: tuple[float, float]) -> None:
    # An opening at the very end makes the interval a frame long; it has a ten-thousandth of the light.
    openings = ((0.999, 1.0),) if position == "start" else ((0.0, 0.001), (1.0 - 1e-7, 1.0))
    samples = blob((6.0, 2.0, 2.0, 5.0))
    assert shift(samples, Shutter(1.0, position, openings=openings)) == pytest.approx(place, abs=0.05)


def test_vectors_of_a_moving_card_are_what_its_path_says() -> None:
    """Acceleration is a parabola in the picture too; both ways of knowing it give one picture."""
    scene = scene_named("acceleration")
    by_paths, _, _ = exposed(samples_of(scene, companions=False), HALF)
    by_vectors, _, _ = exposed(samples_of(scene, companions=False, paths=False, vectors=True), HALF)
    assert np.abs(by_paths - by_vectors).max() < 2e-3


# Light


def lamp(height: float = 1e4) -> Scene:
    card = Card(
        pose(lambda t: 22.0 * PX * t, lambda t: 13.0 * PX * t), plain((height, height, height)), (0.2, 0.15)
    )
    return Scene((card,))


LAMPS: dict[str, dict[str, Any]] = {
    "companions": {},
    "paths": {"companions": False},
    "vectors": {"companions": False, "paths": False, "vectors": True},
}


@models
@pytest.mark.parametrize("kind", list(LAMPS))
def test_light_of_a_moving_lamp_is_kept(kind: str, model: Any) -> None:
    """Quads share a sample's light among pixels without remainder; floats of 24 bits are summed."""
    samples = samples_of(lamp(), **LAMPS[kind])
    picture, _, _ = exposed(samples, HALF, model=model)
    before, after = (np.asarray(p, np.float64).sum(axis=(0, 1)) for p in (samples.layers[0].color, picture))
    np.testing.assert_allclose(after, before, rtol=1e-4)
    assert picture.min() >= 0.0
    # Nowhere more than all of it, and at most its share of the time: 8 pixels of a path of 13.
    assert picture[..., 0].max() < 0.75 * 1e4
    np.testing.assert_allclose(picture[..., 0], 1e4 * picture[..., 3], rtol=1e-4, atol=1e-2)


@models
def test_lamp_over_a_wall_leaves_the_wall_s_light(model: Any) -> None:
    """Each pixel of wall is dimmed for as long as the lamp hides it."""
    scene = replace(lamp(50.0), cards=(replace(WALL, texture=plain((2.0, 2.0, 2.0))), lamp(50.0).cards[0]))
    samples = samples_of(scene)
    picture, _, _ = exposed(samples, HALF, model=model)
    before = samples.layers[0].color.astype(np.float64).sum(axis=(0, 1))
    np.testing.assert_allclose(picture.astype(np.float64).sum(axis=(0, 1)), before, rtol=1e-5)
    np.testing.assert_allclose(picture[..., 3], 1.0, atol=1e-5)


def test_transparent_film_before_a_moving_camera() -> None:
    """Nothing at all is a background too: alpha and colours are the sum of instants."""
    pan = scene_named("pan")
    scene = replace(pan, cards=(pan.cards[1],))
    samples = samples_of(scene, window=OVERSCAN, companions=False)
    expected = mean_of_instants(scene, even(-0.25, 0.25), 128)
    picture, _, _ = exposed(samples, HALF)
    where = changed(samples, expected)
    assert decibels(picture, expected, where) > ALONG
    assert decibels(picture[..., 3:], expected[..., 3:], where) > ALONG
    assert picture[..., 3].sum() == pytest.approx(expected[..., 3].sum(), rel=0.01)


def test_card_larger_than_half_of_a_transparent_film() -> None:
    """One sheet of all samples: a pixel at the edge is the card's or not, so half a pixel may be missing."""
    card = Card(pose(x=lambda t: 20.0 * PX * t), waves((0.4, 0.6, 0.5), 0.8), (2.0, 1.3))
    scene = Scene((card,))
    samples = samples_of(scene, companions=False)
    expected = mean_of_instants(scene, even(-0.25, 0.25), 128)
    picture, _, _ = exposed(samples, HALF)
    around = 2.0 * (2.0 + 1.3) * 2.0 / PX
    assert abs(picture[..., 3].sum() - expected[..., 3].sum()) < 0.5 * around
    assert decibels(picture, expected, changed(samples, expected)) > EDGES


def test_picture_of_one_color_keeps_it_up_to_the_border() -> None:
    """A moving card of the wall's color, and a camera that moves, change nothing."""
    color = (0.25, 0.7, 12.5)
    cards = (replace(WALL, texture=plain(color)), replace(moving().cards[1], texture=plain(color)))
    expected = np.broadcast_to([*color, 1.0], (ROWS, COLUMNS, 4))
    for name in ("rotation", "translation", "out of the picture"):
        card = replace(cards[1], pose=scene_named(name).cards[1].pose)
        for companions in (True, False):
            picture, _, _ = exposed(samples_of(Scene((cards[0], card)), companions=companions), HALF)
            np.testing.assert_allclose(picture, expected, rtol=1e-5)
    for name in ("pan", "dolly"):
        scene = replace(scene_named(name), cards=tuple(replace(c, moves=False) for c in cards))
        picture, _, _ = exposed(samples_of(scene, companions=False), HALF)
        np.testing.assert_allclose(picture, expected, rtol=1e-5)


# What stands still


@pytest.mark.parametrize("alpha", [False, True], ids=["opaque", "translucent"])
@models
@pytest.mark.parametrize("kind", list(LAMPS))
def test_pixels_that_nothing_reaches_are_the_input_s_to_the_bit(kind: str, model: Any, alpha: bool) -> None:
    scene = moving(x=lambda t: 10.0 * PX * t, y=lambda t: 6.0 * PX * t)
    samples = samples_of(scene, **LAMPS[kind])
    layer = samples.layers[0]
    noise = np.random.default_rng(5).random((ROWS, COLUMNS, 4), dtype=np.float32)
    color = layer.color * (0.5 + noise)
    if not alpha:
        color[..., 3] = 1.0
    far = ~ndimage.binary_dilation(swept(scene, -0.25, 0.25), np.ones((3, 3)), iterations=4)
    assert far.sum() > 0.7 * far.size
    layer = replace(layer, color=np.where(far[..., np.newaxis], color, layer.color))
    samples = replace(samples, layers=(layer,), shutter=ShutterAttributes(frames=0.5))
    result = run(process(samples, ProcessSettings(use_lens=False, motion_model=model)))
    assert result.report["motion"][0]["moving"] > 0.0
    assert np.abs(result.picture - layer.color).max() > 0.1
    assert result.picture[far].tobytes() == layer.color[far].tobytes()
    assert not result.guessed[far].any()


def test_file_in_which_nothing_moves_is_left_alone() -> None:
    samples = samples_of(moving(x=lambda t: 0.0 * t))
    assert prepare(samples.layers[0], samples, MotionSettings(HALF)) is None
    result = run(
        process(replace(samples, shutter=ShutterAttributes(frames=0.5)), ProcessSettings(use_lens=False))
    )
    assert result.picture.tobytes() == samples.layers[0].color.tobytes()
    assert result.report["motion"][0]["instants"] == 0


def test_shutter_of_no_length_changes_nothing() -> None:
    samples = samples_of(scene_named("translation"))
    assert prepare(samples.layers[0], samples, MotionSettings(Shutter(0.0))) is None


# One path for an object


def test_object_and_sample_models_agree_on_pure_translation() -> None:
    """One interpolates the picture, the other its path; both spread a sample over two pixels each way."""
    samples = samples_of(scene_named("diagonal"))
    by_object, _, first = exposed(samples, HALF)
    by_sample, _, second = exposed(samples, HALF, model="vector")
    assert (first.object_paths, first.sample_paths) == (1, 0)
    assert (second.object_paths, second.sample_paths) == (0, 1)
    assert decibels(by_object, by_sample, changed(samples, reference("diagonal"))) > 46.0


def test_object_forced_to_one_path_does_not_turn() -> None:
    """The papers' model: a card that turns about its middle stays as it is."""
    samples = samples_of(scene_named("rotation"))
    auto, _, report = exposed(samples, HALF)
    assert (report.object_paths, report.sample_paths) == (0, 1)
    forced, _, report = exposed(samples, HALF, model="object")
    assert (report.object_paths, report.sample_paths) == (1, 0)
    # Its middle is known to a fraction of a pixel only.
    assert decibels(forced, samples.layers[0].color) > 40.0
    assert decibels(auto, forced, changed(samples, reference("rotation"))) < 30.0


def test_object_and_sample_models_in_one_picture() -> None:
    texture = waves((0.6, 0.4, 0.3), 0.7)
    turning = Card(pose(lambda t: -24.0 * PX + 0.0 * t, roll=lambda t: 3.0 * t), texture, (0.5, 0.25), 1)
    sliding = Card(pose(lambda t: 24.0 * PX + 0.0 * t, lambda t: 24.0 * PX * t), texture, (0.3, 0.3), 2)
    scene = Scene((WALL, turning, sliding))
    report = check(samples_of(scene), HALF, mean_of_instants(scene, even(-0.25, 0.25), 128), EDGES)
    assert (report.object_paths, report.sample_paths) == (1, 1)


# However it is made


@needs_numba
@pytest.mark.parametrize("companions", [True, False], ids=["companions", "alone"])
@pytest.mark.parametrize("name", ["rotation", "approach", "crossing", "dolly", "behind a post"])
def test_backends_agree(name: str, companions: bool) -> None:
    samples = samples_of(scene_named(name), companions=companions)
    pictures = [exposed(samples, HALF, model="vector", backend=backend) for backend in ("numba", "numpy")]
    for a, b in zip(pictures[0][:2], pictures[1][:2], strict=True):
        assert np.abs(a - b).max() < 1e-6
    assert pictures[0][2] == pictures[1][2] or pictures[0][2].guessed == pytest.approx(pictures[1][2].guessed)


@needs_numba
def test_backends_agree_with_a_slit_and_behind_the_camera() -> None:
    slit = Shutter(1.0, slit=Slit("bottom", 0.3))
    through = moving(z=lambda t: 2.0 - 6.0 * t, x=lambda t: 0.4 + 0.0 * t, yaw=lambda t: 0.3 + 0.0 * t)
    for scene, shutter in ((scene_named("rotation"), slit), (through, Shutter(1.0, "start"))):
        pictures = [exposed(samples_of(scene), shutter, backend=backend)[0] for backend in ("numba", "numpy")]
        assert np.abs(pictures[0] - pictures[1]).max() < 1e-6


@needs_numba
@pytest.mark.parametrize("name", ["rotation", "dolly"])
def test_picture_does_not_depend_on_the_number_of_threads(name: str, all_threads: int) -> None:
    if all_threads < 2:
        pytest.skip("this machine has one core")
    samples = samples_of(scene_named(name))
    pictures = []
    for threads in (1, 2):
        assert jit.set_thread_count(threads) == threads
        pictures.append(exposed(samples, HALF)[0])
    assert pictures[0].tobytes() == pictures[1].tobytes()


@models
def test_progress_rises_to_1(model: Any) -> None:
    samples = samples_of(scene_named("diagonal"))
    motion = prepare(samples.layers[0], samples, MotionSettings(HALF, model))
    assert motion is not None
    shares = list(expose_layer(motion, samples.layers[0]))
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


# Where the samples lie


@pytest.mark.parametrize("name", ["translation", "rotation", "pan"])
def test_corner_samples(name: str) -> None:
    """A pixel is the mean of its four corners, which smooths edges once more."""
    samples = samples_of(scene_named(name), window=OVERSCAN, corner=True)
    check(samples, HALF, reference(name), EDGES)


@pytest.mark.parametrize("name", ["translation", "acceleration"])
@pytest.mark.parametrize("vectors", [False, True], ids=["paths", "vectors"])
def test_supersampled_file(name: str, vectors: bool) -> None:
    """Twice the samples each way: paths and vectors are in pixels of the samples."""
    scene = scene_named(name)
    fine = replace(
        scene,
        rows=2 * ROWS,
        columns=2 * COLUMNS,
        focal=2.0 * FOCAL,
        middle=(2.0 * MIDDLE[0], 2.0 * MIDDLE[1]),
    )
    samples = samples_of(fine, companions=not vectors, paths=not vectors, vectors=vectors, supersampling=2)
    samples = replace(samples, shutter=ShutterAttributes(frames=0.5))
    result = run(process(samples, ProcessSettings(use_lens=False)))
    assert result.picture.shape == (ROWS, COLUMNS, 4)
    expected = reference(name)
    sharp = at_instant(scene).color
    where = np.abs(expected - sharp).max(axis=2) > 0.02
    if vectors:
        # Hidden parts are guessed.
        assert decibels(result.picture, expected, where) > decibels(sharp, expected, where) + 6.0
    else:
        assert decibels(result.picture, expected, where) > ALONG
    assert result.report["motion"][0]["longest_path_px"] < 22.0


@models
def test_data_window_smaller_than_the_display_window(model: Any) -> None:
    """As in a render of a border: the same picture within it, none beyond."""
    scene = moving(x=lambda t: 20.0 * PX * t)
    part = Window(9, 7, 84, 55)
    whole, _, _ = exposed(samples_of(scene), HALF, model=model)
    picture, guessed, _ = exposed(samples_of(scene, window=part), HALF, model=model)
    inside = (slice(part.y0, part.y1), slice(part.x0, part.x1))
    np.testing.assert_allclose(picture[inside], whole[inside], atol=1e-6)
    beyond = np.ones(picture.shape[:2], dtype=bool)
    beyond[inside] = False
    assert not picture[beyond].any()
    assert not guessed[inside].any()


def test_display_window_that_does_not_begin_at_0() -> None:
    """Windows moved together change nothing: matrices are in pixels of the display window."""
    samples = samples_of(scene_named("rotation"))
    moved = replace(
        samples,
        data_window=Window(7, -3, COLUMNS + 7, ROWS - 3),
        display_window=Window(7, -3, COLUMNS + 7, ROWS - 3),
    )
    assert exposed(moved, HALF)[0].tobytes() == exposed(samples, HALF)[0].tobytes()


# What may come


def with_layer(samples: Samples, **changes: Any) -> Samples:
    return replace(samples, layers=(replace(samples.layers[0], **changes),))


def sound(samples: Samples, shutter: Shutter = HALF, **others: Any) -> tuple[Picture, Any]:
    """Return a picture, whatever it is, that is finite and not negative, and the report."""
    motion = prepare(samples.layers[0], samples, MotionSettings(shutter, **others))
    if motion is None:
        return shown(samples), None
    picture, guessed, report = run(expose_layer(motion, samples.layers[0]))
    assert np.isfinite(picture).all()
    assert picture.min() >= 0.0
    assert np.isfinite(guessed).all()
    return picture, report


@pytest.mark.parametrize("backend", [pytest.param("numba", marks=needs_numba), "numpy"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (6, 1), (2, 2)])
def test_tiny_pictures_keep_their_color(shape: tuple[int, int], backend: Any) -> None:
    """Of one color and opaque, so that any motion of them gives it back."""
    color = np.full((*shape, 4), 1.0, dtype=np.float32)
    color[..., :3] = 0.5
    window = Window(0, 0, shape[1], shape[0])
    for part in (np.ones(shape, dtype=bool), np.arange(shape[0] * shape[1]).reshape(shape) == 0):
        vector = np.where(part[..., np.newaxis], np.float32(3.0), np.float32(0.0))
        vector = np.ascontiguousarray(np.broadcast_to(vector, (*shape, 4)))
        samples = Samples((SampleLayer("", color, np.ones(shape, np.float32), None, vector),), window, window)
        picture, _ = sound(samples, backend=backend)
        np.testing.assert_allclose(picture, color, rtol=1e-5)


def test_card_that_covers_all() -> None:
    scene = Scene(
        (WALL, replace(moving(x=lambda t: 12.0 * PX * t, roll=lambda t: 0.3 * t).cards[1], half=(9.0, 9.0)))
    )
    expected = mean_of_instants(scene, even(-0.25, 0.25), 128)
    report = check(samples_of(scene, window=OVERSCAN, companions=False), HALF, expected, ALONG)
    assert report.moving == 1.0


@models
def test_card_that_covers_all_with_companions(model: Any) -> None:
    scene = Scene((WALL, replace(moving(x=lambda t: 12.0 * PX * t).cards[1], half=(9.0, 9.0))))
    expected = mean_of_instants(scene, even(-0.25, 0.25), 128)
    check(samples_of(scene, window=OVERSCAN), HALF, expected, ALONG, model=model)


def test_vectors_need_no_depth() -> None:
    samples = samples_of(scene_named("diagonal"), companions=False, paths=False, vectors=True)
    with_depth, _ = sound(samples)
    without, report = sound(with_layer(samples, depth=None))
    at_infinity, _ = sound(with_layer(samples, depth=np.full((ROWS, COLUMNS), np.inf, np.float32)))
    assert report.object_paths == 1
    np.testing.assert_allclose(without, at_infinity, atol=1e-6)
    # Depths only tell what may be filled in from.
    expected = reference("diagonal")
    where = changed(samples, expected)
    assert decibels(without, expected, where) > decibels(with_depth, expected, where) - 3.0


def test_paths_without_depth_or_vectors_are_of_no_use() -> None:
    samples = with_layer(samples_of(scene_named("diagonal"), companions=False), depth=None)
    assert prepare(samples.layers[0], samples, MotionSettings(HALF)) is None


@pytest.mark.parametrize("part", ["vector", "depth"])
def test_companions_that_lack_something_do_no_harm(part: str) -> None:
    samples = samples_of(scene_named("translation"), vectors=True, paths=part == "depth")
    layer = samples.layers[0]
    assert layer.moving is not None
    assert layer.stationary is not None
    changes: dict[str, Any] = {part: None}
    samples = with_layer(
        samples, moving=replace(layer.moving, **changes), stationary=replace(layer.stationary, **changes)
    )
    picture, _ = sound(samples)
    expected = reference("translation")
    where = changed(samples, expected)
    assert decibels(picture, expected, where) > decibels(shown(samples), expected, where) + 6.0


def test_empty_moving_layer() -> None:
    samples = samples_of(scene_named("translation"))
    nothing = SampleLayer(
        "", np.zeros((ROWS, COLUMNS, 4), np.float32), np.full((ROWS, COLUMNS), np.inf, np.float32),
        np.zeros((ROWS, COLUMNS), np.int32),
    )  # fmt: skip
    picture, _ = sound(with_layer(samples, moving=nothing))
    assert picture.tobytes() == samples.layers[0].color.tobytes()


def test_empty_moving_layer_before_a_moving_camera() -> None:
    samples = samples_of(scene_named("pan"), window=OVERSCAN)
    check(samples, HALF, reference("pan"), ALONG)


@pytest.mark.parametrize("companions", [True, False], ids=["companions", "alone"])
@pytest.mark.parametrize("model", ["auto", "object"])
def test_card_that_passes_the_camera(companions: bool, model: Any) -> None:
    """From 2 m to 4 m behind; what is behind the camera is not seen."""
    scene = moving(z=lambda t: 2.0 - 6.0 * t, x=lambda t: 0.4 + 0.0 * t, yaw=lambda t: 0.3 + 0.0 * t)
    scene = replace(scene, cards=(WALL, replace(scene.cards[1], half=(0.3, 0.2))))
    samples = samples_of(scene, companions=companions)
    begun = time.perf_counter()
    picture, report = sound(samples, Shutter(1.0, "start"), model=model)
    assert time.perf_counter() - begun < 20.0
    assert report.instants <= 2048
    if companions and model == "auto":
        expected = mean_of_instants(scene, even(0.0, 1.0), 256)
        assert decibels(picture, expected, changed(samples, expected)) > EDGES


@models
@pytest.mark.parametrize("size", [1e6, 1e30])
def test_huge_velocities_of_an_object(size: float, model: Any) -> None:
    """It is gone for all but an instant: what it hid is seen."""
    scene = Scene((replace(WALL, texture=plain((0.5, 0.4, 0.2))), moving().cards[1]))
    samples = samples_of(scene, companions=False, paths=False, vectors=True)
    layer = samples.layers[0]
    assert layer.vector is not None
    vector = np.zeros_like(layer.vector)
    vector[layer.object_index == 1] = [size, 0.0, size, 0.0]
    begun = time.perf_counter()
    picture, report = sound(with_layer(samples, vector=vector), Shutter(1.0, "start"), model=model)
    assert time.perf_counter() - begun < 20.0
    assert report.longest_path_px == pytest.approx(size, rel=1e-3)
    inside = ndimage.binary_erosion(layer.object_index == 1, iterations=3)
    # One of 2048 instants at most may have it.
    wall = at_instant(Scene(scene.cards[:1])).color
    assert decibels(layer.color, wall, inside) < 20.0
    assert decibels(picture, wall, inside) > ALONG


def test_neighbours_torn_apart_by_huge_vectors_take_no_longer() -> None:
    """Quads as large as the picture, at 2048 instants: 768 samples must not take minutes."""
    rng = np.random.default_rng(1)
    vector = (1e6 * rng.normal(size=(24, 32, 4))).astype(np.float32)
    window = Window(0, 0, 32, 24)
    samples = Samples(
        (SampleLayer("", np.ones((24, 32, 4), np.float32), None, None, vector),), window, window
    )
    begun = time.perf_counter()
    picture, _ = sound(samples)
    assert picture.max() <= 1.0 + 1e-6
    assert time.perf_counter() - begun < 5.0


def many_cards(count: int, rows: int, columns: int, apart: int) -> Samples:
    """Return cards of 2 x 2 pixels on a lattice, each with a path of 2 pixels of its own."""
    color = np.full((rows, columns, 4), 0.3, dtype=np.float32)
    color[..., 3] = 1.0
    depth, index = np.full((rows, columns), 10.0, np.float32), np.zeros((rows, columns), np.int32)
    keys, objects = np.array([-1.0, 1.0]), []
    middle, half = np.array([0.5 * columns, 0.5 * rows]), 1.0 * PX
    places = [(x, y) for y in range(4, rows - 8, apart) for x in range(4, columns - 8, apart)][:count]
    assert len(places) == count
    for n, (x, y) in enumerate(places, start=1):
        part = (slice(y, y + 2), slice(x, x + 2))
        color[part], depth[part], index[part] = 1.0, 5.0, n
        matrices = np.tile(np.eye(3, 4), (2, 1, 1))
        matrices[:, :2, 3] = (np.array([x, y]) + 1.0 - middle) * PX
        matrices[:, 2, 3] = 5.0
        matrices[:, 0, 3] += np.array([-4.0, 4.0]) * PX
        box = np.array([[-half, -half, -0.01], [half, half, 0.01]])
        objects.append(ObjectPath(f"card {n}", n, keys, matrices, box))
    film = np.array([[[FOCAL, 0.0, middle[0], 0.0], [0.0, FOCAL, middle[1], 0.0], [0.0, 0.0, 1.0, 0.0]]])
    window = Window(0, 0, columns, rows)
    paths = MotionPaths(CameraPath(np.zeros(1), film), tuple(objects))
    return Samples((SampleLayer("", color, depth, index),), window, window, paths=paths)


def test_many_objects_need_little_more_memory_and_time_than_one() -> None:
    """A picture of 0.15 megapixels is 2.5 MB, a sheet of it about 20; 150 pictures would be 370 MB."""
    samples = many_cards(150, 320, 480, 20)
    tracemalloc.start()
    begun = time.perf_counter()
    picture, report = sound(samples)
    seconds = time.perf_counter() - begun
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert report.object_paths + report.sample_paths == 150
    assert peak < 150e6
    assert seconds < 10.0
    # Every card moves: 4 pixels of light over their half-seconds of 2 pixels each.
    total = (picture[..., 0].astype(np.float64) - 0.3).sum()
    assert total == pytest.approx(150 * 4 * 0.7, rel=1e-3)


def test_thousands_of_objects() -> None:
    samples = many_cards(2000, 320, 480, 8)
    begun = time.perf_counter()
    _, report = sound(samples)
    assert report.object_paths + report.sample_paths == 2000
    assert time.perf_counter() - begun < 20.0


def test_paths_that_are_no_motion_are_refused_or_still() -> None:
    """A path with one key is at rest; an empty list of objects and a camera at rest too."""
    samples = samples_of(scene_named("translation"), companions=False)
    assert samples.paths is not None
    one = samples.paths.objects[0]
    single = replace(one, times=np.zeros(1), matrices=one.matrices[64:65])
    for objects in ((), (single,)):
        still = replace(samples, paths=replace(samples.paths, objects=objects))
        assert prepare(still.layers[0], still, MotionSettings(HALF)) is None


def test_errors_are_of_the_core() -> None:
    """Whatever a path says, a picture comes or a sentence, no traceback."""
    samples = samples_of(scene_named("translation"))
    assert samples.paths is not None
    one = samples.paths.objects[0]
    for factor in (1e8, 1e20, 1e150):
        wild = replace(one, matrices=one.matrices * np.where(np.arange(4) == 3, factor, 1.0))
        matrices = wild.matrices.copy()
        matrices[64] = one.matrices[64]
        paths = replace(samples.paths, objects=(replace(wild, matrices=matrices),))
        with contextlib.suppress(PotmesilError):
            sound(replace(samples, paths=paths))


@pytest.mark.parametrize("name", ["translation", "rotation", "pan"])
def test_layers_may_lie_in_memory_in_any_order(name: str) -> None:
    samples = samples_of(scene_named(name), companions=False, vectors=True)
    layer = samples.layers[0]
    assert layer.depth is not None
    assert layer.vector is not None
    changes = {
        "color": np.asfortranarray(layer.color),
        "depth": np.asfortranarray(layer.depth),
        "vector": np.asfortranarray(layer.vector),
    }
    expected, _, _ = exposed(samples, HALF)
    np.testing.assert_array_equal(exposed(with_layer(samples, **changes), HALF)[0], expected)
