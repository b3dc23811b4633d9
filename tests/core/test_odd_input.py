"""Odd input: the right picture or one clear sentence, alone and in pairs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from potmesil_addon.camera import Film
from potmesil_addon.errors import PotmesilError, SettingsError
from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.process import ProcessSettings, Result, process
from potmesil_addon.progress import run
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples
from potmesil_addon.scatter import Backend
from potmesil_addon.shutter import ShutterAttributes
from potmesil_addon.tracks import assign_tracks

from .helpers import Array, Picture, ellipse_coverage, make_samples

PITCH = 1e-4
LENS = LensAttributes(0.05, 2.8, 3.0)
WAYS = [
    (lens, motion, visible) for lens in (False, True) for motion in (False, True) for visible in (False, True)
]
WAYS = [
    (lens, motion, visible) for lens, motion, visible in WAYS if (lens or motion) and (lens or not visible)
]
"""Lens, motion, and what hides what; the last is the lens's alone."""


def odd(
    color: Any,
    depth: Any,
    vector: tuple[float, ...] | None = None,
    lens: LensAttributes = LENS,
    **others: Any,
) -> Samples:
    """Return samples with a lens, a shutter of half a frame, and vectors in the middle half each way."""
    samples = make_samples(color, depth, lens=lens, shutter=ShutterAttributes(frames=0.5), **others)
    layer = samples.layers[0]
    rows, columns = layer.color.shape[:2]
    if vector is not None:
        moving = np.zeros(layer.color.shape, dtype=np.float32)
        moving[rows // 4 : max(1, 3 * rows // 4), columns // 4 : max(1, 3 * columns // 4)] = vector
        samples = replace(samples, layers=(replace(layer, vector=moving),))
    return replace(samples, film=Film(columns * PITCH, rows * PITCH, columns, rows))


def done(samples: Samples, way: tuple[bool, bool, bool], backend: Backend = "auto") -> Result:
    lens, motion, visible = way
    wanted = ProcessSettings(
        use_lens=lens, use_motion=motion, visibility="aperture" if visible else "none", backend=backend
    )
    return run(process(samples, wanted))


def painted(rows: int = 24, columns: int = 32, seed: int = 3) -> tuple[Picture, Picture]:
    """Return colours of noise, and depths with steps."""
    rng = np.random.default_rng(seed)
    color = rng.random((rows, columns, 4), dtype=np.float32)
    color[..., 3] = 1.0
    depth = np.full((rows, columns), 6.0, dtype=np.float32)
    depth[:, : columns // 3] = 2.4
    depth[: rows // 5] = np.inf
    return color, depth


def spread_by(samples: Samples, way: tuple[bool, bool, bool] = (True, False, False)) -> Array:
    return done(samples, way).picture.astype(np.float64)


# The lens


@pytest.mark.parametrize("distance", [0.0, -1.0, -math.inf])
def test_no_lens_focuses_on_itself(distance: float) -> None:
    samples = odd(*painted(), lens=replace(LENS, focus_distance=distance))
    with pytest.raises(SettingsError, match="Focus distance must be a number greater than 0"):
        done(samples, (True, True, True))


@pytest.mark.parametrize(("what", "said"), [("focus_distance", "focus distance"), ("f_stop", "f-stop")])
def test_what_is_no_number_is_said(what: str, said: str) -> None:
    samples = odd(*painted(), lens=replace(LENS, **{what: math.nan}))  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match=f"The {said} must be a number, not nan; give --f"):
        done(samples, (True, False, True))


@pytest.mark.parametrize("visible", [False, True])
@pytest.mark.parametrize(
    ("f_stop", "distance", "depth"),
    [
        (0.1, math.inf, 250.0), (2.8, math.inf, 20.0), (128.0, math.inf, 0.05), (0.1, 3.0, 3.3),
        (0.1, 0.03, 0.03005), (2.8, 0.03, 0.031), (2.8, 3.0, math.inf), (128.0, 0.03, math.inf),
    ],
)  # fmt: skip
def test_a_point_becomes_the_circle_of_the_closed_form(
    f_stop: float, distance: float, depth: float, visible: bool
) -> None:
    size = 41
    color = np.zeros((size, size, 4), dtype=np.float32)
    color[..., 3] = 1.0
    color[20, 20, :3] = 1.0
    samples = odd(color, depth, lens=LensAttributes(0.05, f_stop, distance))
    picture = spread_by(samples, (True, False, visible))[..., 0]
    radius = 0.5 * abs(0.05**2 / f_stop * (1.0 / distance - 1.0 / depth)) / PITCH
    y, x = np.indices(picture.shape) - 20
    lit = picture > 1e-9
    assert np.hypot(x, y)[lit].max() <= radius + 2.2
    assert lit[np.hypot(x, y) < radius - 1.0].all()
    assert picture.sum() == pytest.approx(1.0, rel=1e-4)
    # A pixel's square, and a disc evenly lit: the radius of gyration.
    assert (picture * (x * x + y * y)).sum() == pytest.approx(0.5 * radius**2 + 1 / 6, abs=0.35)
    if radius > 3.0:
        disc = ellipse_coverage(radius, radius, 20, 0.5)
        assert np.abs(picture - disc).sum() < 0.25


def test_the_widest_and_the_narrowest_aperture_stay_in_bounds() -> None:
    flat = np.full((6, 9, 4), 0.5, dtype=np.float32)
    for f_stop in (1e-3, 0.1, 128.0, 1e9):
        samples = odd(flat, painted(6, 9)[1], lens=replace(LENS, f_stop=f_stop))
        # Without numba tables of thousands of pixels take long.
        for backend in ("numba",) if f_stop < 0.1 else ("numba", "numpy"):
            picture = done(samples, (True, False, True), backend).picture
            np.testing.assert_allclose(picture, 0.5, rtol=1e-5)


def test_everything_at_infinity_is_blurred_alike() -> None:
    rng = np.random.default_rng(5)
    color = rng.random((24, 32, 4), dtype=np.float32)
    color[..., 3] = 1.0
    at_infinity = spread_by(odd(color, np.inf), (True, False, True))
    far_away = spread_by(odd(color, 1e8), (True, False, True))
    np.testing.assert_allclose(at_infinity, far_away, atol=1e-6)
    moved = spread_by(odd(np.roll(color, (2, 3), (0, 1)), np.inf), (True, False, True))
    inner = slice(8, -8)
    np.testing.assert_allclose(
        np.roll(at_infinity, (2, 3), (0, 1))[inner, inner], moved[inner, inner], rtol=2e-3, atol=2e-3
    )
    in_focus = odd(color, np.inf, lens=replace(LENS, focus_distance=math.inf))
    assert np.array_equal(done(in_focus, (True, False, True)).picture, color)


# Colours


def test_light_without_alpha_is_added() -> None:
    color, depth = painted()
    glow = np.zeros_like(color)
    glow[12, 16, :3] = 5.0
    for way, around in (((True, False, False), 1.5), ((True, False, True), np.inf)):
        picture = spread_by(odd(glow, np.where(glow[..., 0] > 0.0, 1.5, around)), way)
        assert picture[..., 3].max() == 0.0
        assert picture[12, 16].max() < 1.0
        np.testing.assert_allclose(picture[..., :3].sum(axis=(0, 1)), 5.0, rtol=1e-5)
    near = np.full(glow.shape[:2], 2.0, dtype=np.float32)
    layers = SampleLayer("far", color, depth), SampleLayer("glow", glow, near)
    behind = replace(odd(color, depth), layers=layers)
    both = spread_by(behind)
    parts = [spread_by(replace(behind, layers=(layer,))) for layer in behind.layers]
    np.testing.assert_allclose(both, parts[0] + parts[1], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("backend", ["numba", "numpy"])
@pytest.mark.parametrize("light", [1e12, 1e30, -1e30])
def test_a_highlight_lights_what_it_reaches_alone(
    way: tuple[bool, bool, bool], backend: Backend, light: float
) -> None:
    for place in ((12, 16), (3, 22)):
        color, depth = painted()
        usual = done(odd(color, depth, (4.0, 1.0, 4.0, 1.0)), way, backend).picture
        color[place][:3] = light
        result = done(odd(color, depth, (4.0, 1.0, 4.0, 1.0)), way, backend)
        more = result.picture.astype(np.float64) - usual
        y, x = np.indices(usual.shape[:2])
        away = np.hypot(y - place[0], x - place[1]) > 10.0
        np.testing.assert_allclose(result.picture[away], usual[away], atol=0.02)
        assert more[..., :3].sum() == pytest.approx(3.0 * light, rel=0.1)
        assert np.isfinite(result.picture).all()
        assert np.isfinite(result.predicted_error).all()


def test_rounding_of_highlights_stays_where_they_are() -> None:
    color, _ = painted()
    lamps = color.copy()
    lamps[4, 3], lamps[10, 8], lamps[18, 12] = 1e30, 1e10, 1e20
    for backend in ("numba", "numpy"):
        usual, lit = (
            done(odd(c, np.float32(2.0)), (True, False, False), backend).picture for c in (color, lamps)
        )
        np.testing.assert_allclose(lit[:, 20:], usual[:, 20:], rtol=1e-6)


def test_colours_are_cut_off_before_sums_of_them_overflow() -> None:
    color, depth = painted()
    color[::2, ::2, :3] = np.finfo(np.float32).max
    for way in WAYS:
        result = done(odd(color, depth, (4.0, 1.0, 4.0, 1.0)), way)
        assert np.isfinite(result.picture).all()
        assert np.isfinite(result.predicted_error).all()


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_replaced_and_counted(nothing: float) -> None:
    color, depth = painted()
    color[12, 16, 1], color[2, 3, 3] = nothing, nothing
    depth[20, 5] = math.nan
    samples = odd(color, depth, (4.0, 1.0, 4.0, 1.0))
    samples.layers[0].vector[12, 12, 0] = nothing  # type: ignore[index]
    before = color.copy()
    mean = [
        np.delete(color[y - 1 : y + 2, x - 1 : x + 2].reshape(9, 4), 4, 0).mean(0)
        for y, x in ((12, 16), (2, 3))
    ]
    pinhole = run(process(samples, ProcessSettings(use_lens=False, use_motion=False)))
    np.testing.assert_allclose([pinhole.picture[12, 16], pinhole.picture[2, 3]], mean, rtol=1e-6)
    for way in WAYS:
        result = done(samples, way)
        assert np.isfinite(result.picture).all()
        assert result.report["repaired"] == {"color": 2, "vector": 1, "depth": 1}
    assert np.array_equal(color, before, equal_nan=True)
    assert np.array_equal(samples.layers[0].color, before, equal_nan=True)


# Sizes


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 2), (2, 1), (3, 3)])
@pytest.mark.parametrize("way", WAYS)
def test_small_pictures(size: tuple[int, int], way: tuple[bool, bool, bool]) -> None:
    rng = np.random.default_rng(2)
    color = rng.random((*size, 4), dtype=np.float32)
    color[..., 3] = 1.0
    for backend in ("numba", "numpy"):
        samples = odd(color, rng.uniform(1.0, 9.0, size), (4.0, 1.0, 4.0, 1.0))
        picture = done(samples, way, backend).picture
        assert picture.shape == color.shape
        assert (picture >= 0.0).all()
        assert picture.max() <= color.max() + 1e-6
        layer = replace(samples.layers[0], color=np.ones_like(color))
        flat = done(replace(samples, layers=(layer,)), way, backend).picture
        np.testing.assert_allclose(flat, 1.0, rtol=1e-5)


def test_a_very_wide_picture() -> None:
    rng = np.random.default_rng(2)
    color = rng.random((16, 16384, 4), dtype=np.float32)
    color[..., 3] = 1.0
    depth = np.full((16, 16384), 6.0, dtype=np.float32)
    depth[:, ::64] = 2.0
    whole = spread_by(odd(color, depth), (True, False, True))
    assert whole.shape == color.shape
    # As good as the same in pieces.
    piece = spread_by(odd(color[:, 8000:8200], depth[:, 8000:8200]), (True, False, True))
    assert np.abs(whole[:, 8050:8150] - piece[:, 50:150]).mean() < 1e-4


# Objects


def line_of_objects(count: int, index: Any) -> tuple[Samples, Any]:
    """Return squares of four pixels in rows, every other one going right, the others down."""
    side = math.ceil(math.sqrt(count))
    size = 9 * side + 4
    camera = np.array([[100.0, 0.0, 0.0, 0.0], [0.0, 100.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    color = np.zeros((size, size, 4), dtype=np.float32)
    depth = np.full((size, size), np.inf, dtype=np.float32)
    indices = np.zeros((size, size), dtype=np.int32)
    number = np.zeros((size, size), dtype=np.int32)
    times = np.array([-1.0, 0.0, 1.0])
    paths = []
    for n in range(count):
        y, x = 4 + 9 * (n // side), 4 + 9 * (n % side)
        at = (slice(y, y + 4), slice(x, x + 4))
        color[at], depth[at], indices[at], number[at] = 1.0, 10.0, index(n), n + 1
        matrices = np.tile(np.eye(3, 4), (3, 1, 1))
        matrices[:, 0, 3], matrices[:, 1, 3], matrices[:, 2, 3] = (x + 2.0) / 10.0, (y + 2.0) / 10.0, 10.0
        matrices[:, n % 2, 3] += 0.2 * times
        box = np.array([[-0.2, -0.2, -0.01], [0.2, 0.2, 0.01]])
        paths.append(ObjectPath(f"Square {n}", index(n), times, matrices, box, False))
    samples = make_samples(
        color, depth, shutter=ShutterAttributes(frames=1.0),
        paths=MotionPaths(CameraPath(np.zeros(1), camera[np.newaxis]), tuple(paths)),
    )  # fmt: skip
    layer = replace(samples.layers[0], object_index=indices)
    return replace(samples, layers=(layer,)), number


@pytest.mark.parametrize(
    ("count", "index"), [(1000, lambda _: 7), (9, lambda n: 32768 + n), (9, lambda n: 2**31 - 1 - n)]
)
def test_objects_are_told_apart_whatever_their_indices(count: int, index: Any) -> None:
    samples, number = line_of_objects(count, index)
    tracks = assign_tracks(samples.layers[0], samples)
    assert tracks is not None
    assert np.array_equal(tracks.track, number)
    result = done(samples, (False, True, False))
    light = result.picture[..., 0]
    assert light.sum() == pytest.approx(16.0 * count, rel=0.01)
    # A path of 2 pixels: of the first one, which goes right, and of the second, which goes down.
    ramp = [0.0, 0.25, 0.75, 1.0, 1.0, 0.75, 0.25, 0.0]
    np.testing.assert_allclose(light[5, 2:10], ramp, atol=0.02)
    np.testing.assert_allclose(light[2:10, 14], ramp, atol=0.02)


# Pairs

_ODD_DEPTHS = (math.inf, 1e-6, 0.03, 2.0, 3.0, 6.0, 1e8, math.nan, -1.0, 0.0)
_ODD_LIGHTS = (0.0, 0.5, -0.5, 1e5, 1e12, 1e30, -1e30, 3e38, math.nan, math.inf)


@st.composite
def odd_samples(draw: st.DrawFn) -> Samples:
    rows, columns = draw(st.sampled_from([(1, 1), (1, 17), (23, 1)]) | st.tuples(*[st.integers(1, 40)] * 2))
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    color = np.full((rows, columns, 4), 0.5, dtype=np.float32)
    if draw(st.booleans()):
        color[...] = rng.random(color.shape)
    color[..., 3] = draw(st.sampled_from([0.0, 0.25, 1.0]))
    for light in draw(st.lists(st.sampled_from(_ODD_LIGHTS), max_size=2)):
        color[rng.integers(rows), rng.integers(columns), : rng.integers(1, 5)] = light
    depths = draw(st.lists(st.sampled_from(_ODD_DEPTHS), min_size=1, max_size=3))
    depth = np.array(depths)[rng.integers(len(depths), size=(-(-rows // 5), -(-columns // 5)))]
    depth = np.repeat(np.repeat(depth, 5, axis=0), 5, axis=1)[:rows, :columns]
    vector = draw(st.sampled_from([None, (4.0, 1.0, 4.0, 1.0), (0.0, 0.0, 60.0, 0.0), (math.nan,) * 4]))
    lens = LensAttributes(
        0.05, draw(st.sampled_from([0.1, 2.8, 128.0])), draw(st.sampled_from([0.0, 0.03, 3.0, math.inf]))
    )
    return odd(color, depth, vector, lens)


@settings(max_examples=30)
@given(samples=odd_samples(), way=st.sampled_from(WAYS))
def test_pairs_of_odd_things(samples: Samples, way: tuple[bool, bool, bool]) -> None:
    pictures = []
    for backend in ("numba", "numpy"):
        try:
            result = done(samples, way, backend)  # type: ignore[arg-type]
        except PotmesilError:
            assert way[0]
            assert samples.lens.focus_distance == 0.0
            return
        assert np.isfinite(result.picture).all()
        assert np.isfinite(result.predicted_error).all()
        assert np.isfinite(result.guessed).all()
        pictures.append(result.picture)
    color = samples.layers[0].color
    level = max(1.0, float(np.nan_to_num(np.abs(pictures[0])).max()))
    np.testing.assert_allclose(*pictures, rtol=1e-4, atol=1e-6 * level)
    if (color == color[0, 0]).all() and color[0, 0, 3] == 1.0 and np.abs(color).max() < 1e36:
        np.testing.assert_allclose(pictures[0], color, rtol=1e-4)
