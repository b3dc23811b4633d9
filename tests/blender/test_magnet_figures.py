"""1983, figure 7: the balls' paths, light and images against their closed form; and wheels that roll."""

from __future__ import annotations

import math
from dataclasses import replace
from types import ModuleType

import bpy
import numpy as np
import pytest
from scipy import ndimage

from figures import magnet as drawn
from figures.workshop import Workshop
from potmesil_addon.shutter import parse_openings
from sample_scenes import magnet, wheels

FAST = 5
"""The ball with the longest path."""


@pytest.fixture(scope="module")
def samples(extension: ModuleType, tmp_path_factory: pytest.TempPathFactory):
    workshop = Workshop(tmp_path_factory.mktemp("magnet"), percentage=50, samples=32)

    def prepare(scene):
        # Exactly a pixel wide, so that coverage is a mean over pixels.
        scene.cycles.pixel_filter_type = "BOX"

    return workshop.rendered("magnet", "magnet", prepare=prepare)


@pytest.fixture(scope="module")
def alone(samples):
    return drawn.moving_alone(samples)


@pytest.fixture(scope="module")
def time_bands(alone):
    """The share of the exposure for which any ball is at a pixel, by the picture's letter."""
    return {item.letter: drawn.exposed(alone, item).picture[..., 3] for item in drawn.EXPOSURES}


def pixel(samples, ball, time):
    """Return where the middle of a ball is seen at times in units of T: x, y, and its radius in pixels."""
    places = np.array([(*ball.place(t), 1.0) for t in np.atleast_1d(time)])
    x, y, w = samples.paths.camera.matrices[0] @ places.T
    film = samples.film
    radius = magnet.BALL_RADIUS * samples.lens.focal_length / film.pitch_x / w
    return np.stack([x / w, y / w], axis=1), radius


def openings(exposure):
    """Return when the shutter opens and closes, in units of T."""
    if exposure.letter == "d":
        return [(0.4 * n, 0.4 * n + 0.2) for n in range(5)]
    return [(0.0, {"b": 1.0, "c": 2.0}[exposure.letter])]


def instants(exposure, count=400):
    """Return the middles of many equal parts of the time that the shutter is open."""
    parts = [np.linspace(a, b, count, endpoint=False) + 0.5 * (b - a) / count for a, b in openings(exposure)]
    return np.concatenate(parts)


def expected_time(samples, exposure, points):
    """Return the share of the exposure for which some ball covers points, by quadrature."""
    covered = np.zeros((len(points), instants(exposure).size), dtype=bool)
    for ball in magnet.BALLS:
        middle, radius = pixel(samples, ball, instants(exposure))
        covered |= np.hypot(*np.moveaxis(points[:, np.newaxis] - middle, -1, 0)) < radius
    return covered.mean(axis=1)


def over_a_pixel(samples, exposure, points):
    """Return the same as the mean over a pixel around each point."""
    steps = (-0.4, -0.2, 0.0, 0.2, 0.4)
    offsets = [(x, y) for x in steps for y in steps]
    return np.mean([expected_time(samples, exposure, points + offset) for offset in offsets], axis=0)


def read(picture, points):
    """Return a picture's values between pixel centres, which lie at halves."""
    return ndimage.map_coordinates(picture, points[:, ::-1].T - 0.5, order=1)


def test_samples_follow_ten_balls_for_two_exposures(samples):
    paths = {path.name: path for path in samples.paths.objects}
    assert set(paths) == {f"Ball {n}" for n in range(1, 11)}
    assert not samples.paths.camera.moves
    for number, ball in enumerate(magnet.BALLS, start=1):
        path = paths[f"Ball {number}"]
        assert path.times[-1] == pytest.approx(2.0 * magnet.EXPOSURE)
        for time in (0.0, 0.3, 1.0, 1.37, 2.0):
            # Paths are kept to a tenth of a pixel, of which each is 3.4 mm wide there.
            assert path.at(time * magnet.EXPOSURE)[:3, 3] == pytest.approx(ball.place(time), abs=4e-4)


@pytest.mark.parametrize("exposure", drawn.EXPOSURES, ids=lambda item: item.letter)
def test_shutter_opens_when_the_paper_says(exposure):
    shutter = exposure.shutter.resolve()
    shares = (np.arange(2000) + 0.5) / 2000
    times = shutter.frame_times(shutter.times(shares)) / magnet.EXPOSURE
    assert times == pytest.approx(instants(exposure, 2000 // len(openings(exposure))), abs=1e-9)


@pytest.mark.parametrize("exposure", drawn.EXPOSURES, ids=lambda item: item.letter)
def test_time_at_a_place_is_the_balls_own(samples, time_bands, exposure):
    ball = magnet.BALLS[FAST]
    points, _ = pixel(samples, ball, np.linspace(0.0, 2.0, 120))
    points = np.floor(points) + 0.5
    # From rest the share grows by 0.16 in the first pixel, and paths are kept to a tenth of one: 0.016. The
    # coverage of an edge is known to 0.09 from 32 samples, and stays there for up to a fifth of T: 0.018.
    expected = over_a_pixel(samples, exposure, points)
    assert read(time_bands[exposure.letter], points) == pytest.approx(expected, abs=0.04)


def test_five_openings_may_be_given_in_units_of_either_exposure():
    double = replace(drawn.EXPOSURES[2].shutter, frames=2.0, openings=parse_openings("5x0.1@0.2")).resolve()
    shares = np.linspace(0.01, 0.99, 50)
    single = drawn.EXPOSURES[2].shutter.resolve()
    both = [shutter.frame_times(shutter.times(shares)) for shutter in (single, double)]
    assert both[0] == pytest.approx(both[1], abs=1e-9)


def test_a_faster_ball_leaves_less_light(samples, alone):
    longer = drawn.exposed(alone, drawn.EXPOSURES[1]).picture[..., :3].mean(axis=2)
    for ball in (magnet.BALLS[n] for n in (0, FAST, 9)):
        points, _ = pixel(samples, ball, (0.2, 0.8, 1.3, 1.8))
        left = read(ndimage.uniform_filter(longer, 5), points)
        assert (np.diff(left) < 0.0).all()
        # From rest to nine tenths of the time the speed grows ninefold.
        assert left[-1] < 0.4 * left[0]


def test_five_openings_leave_five_images(samples, time_bands):
    ball = magnet.BALLS[FAST]
    times = np.linspace(0.0, 2.0, 800)
    points, radius = pixel(samples, ball, times)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    band = read(time_bands["d"], points)
    for begin, end in openings(drawn.EXPOSURES[2]):
        first, last = np.interp((begin, end), times, along)
        assert np.interp(0.5 * (first + last), along, band) > 0.08
    # Where the ball has left its place by the next opening, there is nothing between its images.
    gaps = [(0.2 + 0.4 * n, 0.4 + 0.4 * n) for n in range(2, 4)]
    for begin, end in gaps:
        last, first = np.interp((begin, end), times, along)
        assert first - last > 2.0 * radius.max()
        assert np.interp(0.5 * (first + last), along, band) < 0.02


@pytest.mark.parametrize("exposure", drawn.EXPOSURES, ids=lambda item: item.letter)
def test_the_balls_keep_their_light(alone, exposure):
    whole = drawn.light(drawn.instantaneous(alone))
    kept = drawn.light(drawn.exposed(alone, exposure).picture) / whole
    # No ball is ever seen before another, which would lose light.
    assert kept == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("model", ["object", "auto"])
def test_the_picture_stays_where_nothing_passes(samples, model):
    exposure = drawn.EXPOSURES[1]
    instant = drawn.instantaneous(samples)
    rows, columns = instant.shape[:2]
    y, x = np.mgrid[:rows, :columns] + 0.5
    away = np.ones((rows, columns), dtype=bool)
    for ball in magnet.BALLS:
        for middle, radius in zip(*pixel(samples, ball, np.linspace(0.0, 2.0, 201)), strict=True):
            # The pixel filter reaches 1.5 pixels around an edge, and resampling one more.
            away &= np.hypot(x - middle[0], y - middle[1]) > radius + 4.0
    assert away.mean() > 0.6
    shown = drawn.exposed(samples, exposure, model).picture
    np.testing.assert_array_equal(shown[away], instant[away])


def test_the_sheet_comes_nearer_to_cycles(extension, tmp_path):
    drawing = drawn.motion_7(Workshop(tmp_path, percentage=25, samples=8))
    assert drawing.path.exists()
    assert set(drawing.numbers) == set("bcd")
    for values in drawing.numbers.values():
        assert values["object_db"] > values["instant_db"] + 2.0
        assert values["auto_db"] > values["instant_db"] + 2.0
    paths = [drawing.numbers[letter]["path_px"] for letter in "bc"]
    # Twice the time from rest, four times the way.
    assert paths[1] / paths[0] == pytest.approx(4.0, rel=0.02)
    assert drawing.table.count("\n") == 4


def test_wheels_roll_on_the_road(extension):
    scene = wheels.build()
    touching = {}
    for step in (0.0, 0.01):
        scene.frame_set(1, subframe=step)
        for end, (_, radius) in zip(("Front", "Rear"), wheels.AXLES, strict=True):
            wheel = scene.objects[f"Near {end}"].matrix_world
            if step == 0.0:
                below = wheel.translation.copy()
                below.z -= radius
                touching[end] = wheel.inverted() @ below
                assert below.z == pytest.approx(0.0, abs=1e-6)
            else:
                # What touches the road rests on it, while the hub goes on.
                moved = wheel @ touching[end]
                assert moved.z == pytest.approx(0.0, abs=1e-4)
                way = moved.x - (wheel.translation.x - wheels.SPEED * step)
                assert way == pytest.approx(0.0, abs=0.01 * wheels.SPEED * step)
                assert math.isclose(
                    scene.camera.matrix_world.translation.x - 0.95, wheels.SPEED * step, rel_tol=1e-3
                )
    assert bpy.context.scene.render.motion_blur_shutter == wheels.SHUTTER
