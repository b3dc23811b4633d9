"""Shadows that go with what casts them, against closed forms and the mean of many instants.

The camera looks straight down at a floor, so that a pixel is a square of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from potmesil_addon import jit
from potmesil_addon.lamps import Lamp
from potmesil_addon.motion import MotionSettings
from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.samples import SampleLayer, Samples, Window
from potmesil_addon.shadows import moved_shadows
from potmesil_addon.shutter import Shutter, Slit

from .helpers import Array

ROWS, COLUMNS = 60, 90
HEIGHT = 10.0
"""Metres of the camera above the floor, z = 0."""

PIXEL = 0.1
"""Metres."""

SETTINGS = MotionSettings(Shutter(1.0))


def camera() -> CameraPath:
    """At (0, 0, 10), looking down; x right, the world's y up in the picture."""
    focal = HEIGHT / PIXEL
    film = np.array([[focal, 0.0, 0.5 * COLUMNS], [0.0, focal, 0.5 * ROWS], [0.0, 0.0, 1.0]])
    view = np.array([[1.0, 0, 0, 0], [0, -1.0, 0, 0], [0, 0, -1.0, HEIGHT]])
    return CameraPath(np.zeros(1), (film @ view)[np.newaxis])


def mover(
    way: tuple[float, float, float],
    place: tuple[float, float, float] = (0.0, 0.0, 1.0),
    half: tuple[float, float, float] = (0.5, 0.5, 0.0),
) -> ObjectPath:
    """A card that is at a place at the rendered frame and moves evenly by a way in each frame."""
    matrices = np.stack(
        [np.column_stack([np.eye(3), np.add(place, t * np.array(way))]) for t in (-1.0, 0.0, 1.0)]
    )
    return ObjectPath("Card", 1, np.array([-1.0, 0.0, 1.0]), matrices, np.array([np.negative(half), half]))


def floor() -> tuple[Array, Array]:
    """Return x and y in the world of fine points of all pixels, (rows, columns, 8, 8)."""
    fine = (np.arange(8) + 0.5) / 8
    x = (np.arange(COLUMNS)[:, np.newaxis] + fine - 0.5 * COLUMNS) * PIXEL
    y = (0.5 * ROWS - np.arange(ROWS)[:, np.newaxis] - fine) * PIXEL
    shape = (ROWS, COLUMNS, 8, 8)
    return np.broadcast_to(x[None, :, None, :], shape), np.broadcast_to(y[:, None, :, None], shape)


def shaded(path: ObjectPath, lamp: Array, time: float) -> Array:
    """Return what share of each pixel is in a card's shadow at a time."""
    x, y = floor()
    place = path.at(time)[:3, 3]
    # From the floor to the card's height, as a share of the way to the lamp.
    share = place[2] / lamp[2]
    u = x + share * (lamp[0] - lamp[3] * x) - place[0]
    v = y + share * (lamp[1] - lamp[3] * y) - place[1]
    half = path.box[1]
    return np.asarray(((np.abs(u) <= half[0]) & (np.abs(v) <= half[1])).mean(axis=(2, 3)))


def exposed(path: ObjectPath, lamp: Array, times: Array) -> Array:
    """Return the mean of the shadow at many times."""
    return np.asarray(np.mean([shaded(path, lamp, float(t)) for t in times], axis=0))


def layer_of(difference: Array, ground: Array | float = 0.8) -> SampleLayer:
    """Return a layer whose floor has a light, and with its movers a difference to it."""
    absent = np.ones((ROWS, COLUMNS, 4), dtype=np.float32)
    absent[..., :3] = np.broadcast_to(np.asarray(ground, dtype=np.float32), (ROWS, COLUMNS))[..., None]
    color = absent.copy()
    color[..., :3] += difference.astype(np.float32)[..., None]
    depth = np.full((ROWS, COLUMNS), HEIGHT, dtype=np.float32)
    return SampleLayer(
        "View",
        color,
        depth,
        stationary=SampleLayer("stationary", color.copy(), depth),
        moving=SampleLayer("moving", np.zeros_like(color), np.full_like(depth, np.inf)),
        absent=SampleLayer("absent", absent, depth),
    )


def samples_of(layer: SampleLayer, path: ObjectPath, *lamps: Array) -> Samples:
    window = Window(0, 0, COLUMNS, ROWS)
    paths = MotionPaths(camera(), (path,))
    return Samples((layer,), window, window, paths=paths, lamps=tuple(Lamp(lamp) for lamp in lamps))


def shadow_of(result: SampleLayer) -> Array:
    """Return D' of the stationary view's red."""
    assert result.stationary is not None
    assert result.absent is not None
    return np.asarray(result.stationary.color[..., 0] - result.absent.color[..., 0], dtype=np.float64)


SUN = np.array([0.6, 0.0, 0.8, 0.0])
POINT = np.array([0.5, 0.3, 4.0, 1.0])


def test_a_shadow_under_a_sun_is_blurred_by_a_box() -> None:
    path = mover((2.0, 0.0, 0.0))
    still = -0.5 * shaded(path, SUN, 0.0)
    layer = layer_of(still)
    result = moved_shadows(layer, samples_of(layer, path, SUN), SETTINGS)
    # 2 m are 20 pixels; instants lie in the middles of as many steps or more.
    fine = np.repeat(still, 20, axis=1)
    expected = ndimage.uniform_filter1d(fine, 400, axis=1).reshape(ROWS, COLUMNS, 20).mean(axis=2)
    np.testing.assert_allclose(shadow_of(result), expected, atol=0.012)
    # All of it stays in the picture, and the sun's rays are parallel.
    assert shadow_of(result).sum() == pytest.approx(still.sum(), rel=1e-3)
    np.testing.assert_array_equal(result.color, result.stationary.color)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "way", [(1.0, 0.0, 0.0), (0.5, 0.7, 0.0), (0.4, 0.0, 0.8)], ids=["across", "aslant", "rising"]
)
def test_a_shadow_under_a_lamp_goes_faster_than_what_casts_it(way: tuple[float, float, float]) -> None:
    path = mover(way, (0.0, 0.0, 2.0))
    layer = layer_of(-0.5 * shaded(path, POINT, 0.0))
    result = moved_shadows(layer, samples_of(layer, path, POINT), SETTINGS)
    expected = -0.5 * exposed(path, POINT, (np.arange(64) + 0.5) / 64 - 0.5)
    off = shadow_of(result) - expected
    # Looking up between pixels softens the shadow's edge, by an eighth of its step where it is worst.
    assert np.abs(off).max() < 0.5 / 8
    assert np.sqrt((off * off).mean()) < 0.1 * np.sqrt(((expected - shadow_of(layer)) ** 2).mean())


def test_what_is_not_a_lamps_shadow_goes_along_the_floor() -> None:
    path = mover((2.0, 0.0, 0.0), (0.0, 0.0, 0.1))
    x, y = (values.mean(axis=(2, 3)) for values in floor())
    times = (np.arange(64) + 0.5) / 64 - 0.5
    blob = lambda t: -0.4 * np.exp(-((x - 2.0 * t) ** 2 + y**2) / 0.3)  # noqa: E731
    layer = layer_of(blob(0.0))
    result = moved_shadows(layer, samples_of(layer, path), SETTINGS)
    expected = np.mean([blob(t) for t in times], axis=0)
    # Right beneath the card the nearest point is straight above; beside it, at its edge: both go alike.
    np.testing.assert_allclose(shadow_of(result), expected, atol=0.01)
    assert shadow_of(result).sum() == pytest.approx(shadow_of(layer).sum(), rel=2e-3)


def test_light_on_others_is_moved_and_conserved() -> None:
    path = mover((2.0, 0.0, 0.0), (0.0, 0.0, 0.1))
    x, y = (values.mean(axis=(2, 3)) for values in floor())
    # More than the floor's own light, so that part of it cannot go as a share of that.
    glow = 2.0 * np.exp(-(x * x + y * y) / 0.3)
    layer = layer_of(glow, 0.3)
    moved = shadow_of(moved_shadows(layer, samples_of(layer, path, SUN), SETTINGS))
    assert moved.sum() == pytest.approx(glow.sum(), rel=2e-3)
    assert moved.max() < 0.7 * glow.max()


def test_a_texture_under_a_shadow_stays() -> None:
    path = mover((2.0, 0.0, 0.0))
    ground = 0.6 + 0.3 * np.sin(np.arange(COLUMNS) * 1.3)[np.newaxis] * np.ones((ROWS, 1))
    layer = layer_of(-0.5 * ground * shaded(path, SUN, 0.0), ground)
    result = moved_shadows(layer, samples_of(layer, path, SUN), SETTINGS)
    expected = -0.5 * ground * exposed(path, SUN, (np.arange(80) + 0.5) / 80 - 0.5)
    np.testing.assert_allclose(shadow_of(result), expected, atol=0.02)


def test_movers_cover_what_changes() -> None:
    path = mover((2.0, 0.0, 0.0))
    layer = layer_of(-0.5 * shaded(path, SUN, 0.0))
    assert layer.moving is not None
    assert layer.moving.depth is not None
    cover, depth = layer.moving.color.copy(), layer.moving.depth.copy()
    cover[:20, :, 3], depth[:20] = 1.0, HEIGHT - 1.0
    cover[20:30, :, 3], depth[20:30] = 0.25, HEIGHT - 1.0
    # Behind the floor nothing covers it.
    cover[30:40, :, 3], depth[30:40] = 1.0, HEIGHT + 1.0
    layer = replace(layer, moving=replace(layer.moving, color=cover, depth=depth))
    result = moved_shadows(layer, samples_of(layer, path, SUN), SETTINGS)
    assert result.stationary is not None
    assert layer.stationary is not None
    change = result.stationary.color - layer.stationary.color
    np.testing.assert_array_equal(result.color[:20], layer.color[:20])
    np.testing.assert_allclose(result.color[20:30], (layer.color + 0.75 * change)[20:30], atol=1e-6)
    np.testing.assert_array_equal(result.color[30:], result.stationary.color[30:])
    assert np.abs(change[30:40]).max() > 0.1
    assert result.color.min() >= 0.0


def shutters() -> list[Shutter]:
    return [
        Shutter(1.0),
        Shutter(0.5, "start", curve=((0.0, 0.0), (1.0, 1.0))),
        Shutter(1.0, slit=Slit("top", 0.2)),
    ]


@pytest.mark.parametrize("shutter", shutters(), ids=["even", "curve", "slit"])
@pytest.mark.parametrize("lamps", [(), (SUN,), (POINT, SUN)], ids=["none", "sun", "two"])
def test_numba_and_numpy_agree_for_any_number_of_threads(shutter: Shutter, lamps: tuple[Array, ...]) -> None:
    path = mover((1.0, 0.4, 0.2))
    layer = layer_of(-0.5 * shaded(path, SUN, 0.0) - 0.2 * shaded(path, POINT, 0.0))
    # A wall beyond a line: shadows climb from the floor.
    depth = np.minimum(layer.depth, (HEIGHT - 2.0 * np.maximum(floor()[0].mean(axis=(2, 3)) - 2.0, 0.0)))
    assert layer.stationary is not None
    layer = replace(layer, stationary=replace(layer.stationary, depth=depth.astype(np.float32)))
    samples, settings = samples_of(layer, path, *lamps), MotionSettings(shutter)
    plain = moved_shadows(layer, samples, settings, "numpy")
    if not jit.HAVE_NUMBA:
        pytest.skip("numba is not installed")
    threads = jit.set_thread_count(None)
    try:
        jit.set_thread_count(1)
        one = moved_shadows(layer, samples, settings, "numba")
        jit.set_thread_count(2)
        two = moved_shadows(layer, samples, settings, "numba")
    finally:
        jit.set_thread_count(threads)
    np.testing.assert_array_equal(one.color, two.color)
    np.testing.assert_allclose(one.color, plain.color, atol=1e-5)
    assert np.abs(one.color - layer.color).max() > 0.05


def test_a_slit_gives_each_row_its_time() -> None:
    path = mover((2.0, 0.0, 0.0))
    layer = layer_of(-0.5 * shaded(path, SUN, 0.0))
    shutter = Shutter(1.0, slit=Slit("top", 0.1))
    result = shadow_of(moved_shadows(layer, samples_of(layer, path, SUN), MotionSettings(shutter)))
    for row in (26, 33):
        times = shutter.frame_times(shutter.times((np.arange(32) + 0.5) / 32), (row + 0.5) / ROWS)
        np.testing.assert_allclose(result[row], -0.5 * exposed(path, SUN, times)[row], atol=0.06)


def change_nothing() -> dict[str, Callable[[SampleLayer, Samples], tuple[SampleLayer, Samples]]]:
    rest = mover((0.0, 0.0, 0.0))
    return {
        "rests": lambda layer, samples: (layer, replace(samples, paths=MotionPaths(camera(), (rest,)))),
        "no object": lambda layer, samples: (layer, replace(samples, paths=MotionPaths(camera()))),
        "no paths": lambda layer, samples: (layer, replace(samples, paths=None)),
        "no absent": lambda layer, samples: (replace(layer, absent=None), samples),
        "no stationary": lambda layer, samples: (replace(layer, stationary=None), samples),
        "no shadow": lambda layer, samples: (replace(layer, stationary=layer.absent), samples),
    }


@pytest.mark.parametrize("what", change_nothing())
def test_the_layer_stays_as_it_is_where_nothing_moves(what: str) -> None:
    path = mover((2.0, 0.0, 0.0))
    layer = layer_of(-0.5 * shaded(path, SUN, 0.0))
    layer, samples = change_nothing()[what](layer, samples_of(layer, path, SUN))
    assert moved_shadows(layer, samples, SETTINGS) is layer


def test_no_time_leaves_the_picture() -> None:
    path = mover((2.0, 0.0, 0.0))
    layer = layer_of(-0.5 * shaded(path, SUN, 0.0))
    result = moved_shadows(layer, samples_of(layer, path, SUN), MotionSettings(Shutter(0.0)))
    np.testing.assert_allclose(result.color, layer.color, atol=1e-6)
