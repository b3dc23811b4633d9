"""Surfaces of pixels against what was mixed into them: edges whose cover is known, and what lies behind."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from potmesil_addon.fragments import Fragments, fragments_of
from potmesil_addon.samples import Cryptomatte

from .helpers import Array

ROWS, COLUMNS = 24, 32
FINE = 32
"""Places along each side of a pixel that a mixed colour is the mean of: cover to 1/64."""

NEAR, FAR = -8.0, 0.0

Flags = npt.NDArray[np.bool_]


def depth_of(radius: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Return some depth that falls with the radius; 2 m at 0."""
    return np.asarray(1.0 / (0.5 - np.asarray(radius) / 100.0), dtype=np.float32)


def found_in(
    color: npt.ArrayLike,
    radius: npt.ArrayLike,
    *,
    mixed: bool = True,
    mattes: list[Cryptomatte] | None = None,
) -> Fragments:
    """Return the surfaces of views; one view without its axis is a layer without hidden ones."""
    color, radius = np.asarray(color, dtype=np.float32), np.asarray(radius, dtype=np.float32)
    if radius.ndim == 2:
        color, radius = color[np.newaxis], radius[np.newaxis]
    return fragments_of(color, depth_of(radius), radius, 1.0, mixed=mixed, cryptomattes=mattes or [])


def fine_places() -> tuple[Array, Array]:
    y, x = np.mgrid[0 : ROWS * FINE, 0 : COLUMNS * FINE]
    return (x + 0.5) / FINE, (y + 0.5) / FINE


def mean_of_pixels(fine: npt.NDArray[Any]) -> Array:
    shape = (ROWS, FINE, COLUMNS, FINE, *fine.shape[2:])
    return np.asarray(fine.reshape(shape).mean(axis=(1, 3), dtype=np.float64))


def edge(degrees: float, offset: float) -> tuple[Array, Flags]:
    """Return a near half plane's cover of each pixel, and whether it is at the pixel's middle."""
    x, y = fine_places()
    nx, ny = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    off = (x - 0.5 * COLUMNS) * nx + (y - 0.5 * ROWS) * ny + offset
    v, u = np.mgrid[0:ROWS, 0:COLUMNS] + 0.5
    return mean_of_pixels(off > 0.0), (u - 0.5 * COLUMNS) * nx + (v - 0.5 * ROWS) * ny + offset > 0.0


def bar(width: float, degrees: float, offset: float) -> tuple[Array, Flags]:
    """Return a bar's cover of each pixel, and whether it is at the pixel's middle."""
    x, y = fine_places()
    nx, ny = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    v, u = np.mgrid[0:ROWS, 0:COLUMNS] + 0.5
    off = (x - 0.5 * COLUMNS) * nx + (y - 0.5 * ROWS) * ny + offset
    middle = (u - 0.5 * COLUMNS) * nx + (v - 0.5 * ROWS) * ny + offset
    return mean_of_pixels(np.abs(off) < 0.5 * width), np.abs(middle) < 0.5 * width


def mixture(cover: Array, front: npt.ArrayLike, back: npt.ArrayLike) -> Array:
    """Return the colours of pixels that a surface covers some of."""
    share = cover[..., np.newaxis]
    return np.asarray(share * np.asarray(front) + (1.0 - share) * np.asarray(back))


def near_share(found: Fragments) -> Array:
    """Return the share of each pixel that was found to be the near surface's."""
    is_near = found.radius[0] < 0.5 * (NEAR + FAR)
    return np.where(is_near, found.coverage[0], 0.0).astype(np.float64)


def recomposed(found: Fragments) -> Array:
    """Return the pixels that the surfaces make: each over the next."""
    color, left = np.zeros(found.color.shape[1:]), np.ones(found.coverage.shape[1:])
    for sheet in range(found.coverage.shape[0]):
        share = found.coverage[sheet] * left
        color += share[..., np.newaxis] * found.color[sheet].astype(np.float64)
        left = left - share
    return color


def pattern(seed: int, low: float = 0.2, high: float = 0.8, smooth: float = 6.0) -> Array:
    """Return opaque colours that change smoothly."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:ROWS, 0:COLUMNS]
    color = np.ones((ROWS, COLUMNS, 4))
    for c in range(3):
        a, b, phase = rng.uniform(0.5, 1.0, 3)
        wave = 0.5 + 0.5 * np.sin((a * u + b * v) * 2.0 * math.pi / smooth / 3.0 + 6.0 * phase)
        color[..., c] = low + (high - low) * wave
    return color


EDGES = pytest.mark.parametrize(
    ("degrees", "offset"),
    [
        (0.0, 0.3),
        (0.0, -0.45),
        (90.0, 0.2),
        (180.0, 0.1),
        (30.0, 0.0),
        (45.0, 0.25),
        (67.0, -0.4),
        (200.0, 0.3),
    ],
)
COLORS: dict[str, tuple[list[float], list[float]]] = {
    "white and black": ([1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]),
    "dark and light": ([0.02, 0.03, 0.02, 1.0], [0.7, 0.8, 0.9, 1.0]),
    "as bright": ([0.8, 0.2, 0.5, 1.0], [0.2, 0.8, 0.5, 1.0]),
    "alike": ([0.5, 0.5, 0.5, 1.0], [0.6, 0.6, 0.6, 1.0]),
    "a lamp": ([50.0, 40.0, 30.0, 1.0], [0.1, 0.1, 0.2, 1.0]),
    "transparent": ([0.3, 0.6, 0.3, 1.0], [0.0, 0.0, 0.0, 0.0]),
}


# Un-mixing


@EDGES
@pytest.mark.parametrize("colors", COLORS)
def test_cover_of_a_straight_edge_is_found(colors: str, degrees: float, offset: float) -> None:
    front, back = COLORS[colors]
    cover, is_near = edge(degrees, offset)
    found = found_in(mixture(cover, front, back), np.where(is_near, NEAR, FAR))
    assert np.abs(near_share(found) - cover).max() < 0.02
    # And with it each surface's own colour; at the picture's border there may be nothing beside the pixel.
    seen = near_share(found) > 0.05
    seen[[0, -1]], seen[:, [0, -1]] = False, False
    scale = max(*front, *back)
    assert np.abs(found.color[0][seen] - front).max() < 0.03 * scale
    behind = (found.coverage[0] < 0.95) & seen
    assert np.abs(found.color[1][behind] - back).max() < 0.03 * scale


@EDGES
def test_cover_of_an_edge_between_patterns(degrees: float, offset: float) -> None:
    """Colours change by a few percent from a pixel to the next, the edge's contrast is half or more."""
    cover, is_near = edge(degrees, offset)
    front, back = pattern(1, 0.7, 0.9, 20.0), pattern(2, 0.05, 0.2, 20.0)
    found = found_in(mixture(cover, front, back), np.where(is_near, NEAR, FAR))
    assert np.abs(near_share(found) - cover).max() < 0.1


@EDGES
@pytest.mark.parametrize("kind", ["plain", "patterns", "noise", "lamps"])
def test_surfaces_add_up_to_the_pixel(kind: str, degrees: float, offset: float) -> None:
    """Whatever the shares are taken to be, seen through a pinhole nothing may change."""
    cover, is_near = edge(degrees, offset)
    rng = np.random.default_rng(5)
    if kind == "plain":
        color = mixture(cover, [0.9, 0.2, 0.1, 1.0], [0.1, 0.3, 0.6, 1.0])
    elif kind == "patterns":
        color = mixture(cover, pattern(3), pattern(4, 0.0, 1.0))
    else:
        color = np.ones((ROWS, COLUMNS, 4))
        color[..., :3] = rng.random((ROWS, COLUMNS, 3))
        if kind == "lamps":
            color[rng.random((ROWS, COLUMNS)) < 0.1, :3] = 500.0
    found = found_in(color, np.where(is_near, NEAR, FAR))
    np.testing.assert_allclose(recomposed(found), color, rtol=1e-4, atol=1e-4 * color.max())


@pytest.mark.parametrize("views", [1, 2, 3])
@pytest.mark.parametrize("mixed", [True, False])
@pytest.mark.parametrize("peak", [1.0, 1e4])
def test_no_negative_colors_no_shares_beyond_1(peak: float, mixed: bool, views: int) -> None:
    """Noise in colour and depth, on a partly transparent film."""
    rng = np.random.default_rng(8)
    alpha = rng.choice([0.0, 0.4, 1.0], (views, ROWS, COLUMNS, 1))
    color = np.concatenate([alpha * rng.random((views, ROWS, COLUMNS, 3)) * peak, alpha], axis=-1)
    radius = np.sort(rng.choice([-12.0, -3.0, 0.0, 5.0], (views, ROWS, COLUMNS)), axis=0)
    found = found_in(color, radius, mixed=mixed)
    for values in found:
        assert np.isfinite(values).all()
    assert found.color.min() >= 0.0
    for values in (found.coverage, found.guessed):
        assert values.min() >= 0.0
        assert values.max() <= 1.0
    assert found.depth.min() > 0.0


@EDGES
def test_alpha_stays_within_1(degrees: float, offset: float) -> None:
    cover, is_near = edge(degrees, offset)
    color = mixture(cover, pattern(1, 0.0, 1.0), [0.0, 0.0, 0.0, 0.0])
    found = found_in(color, np.where(is_near, NEAR, FAR))
    assert found.color[..., 3].max() <= 1.0 + 1e-5


@EDGES
def test_equal_colors_on_both_sides(degrees: float, offset: float) -> None:
    """Only the depths tell then: of a pixel and its eight neighbours, about as a pixel filter weighs them."""
    cover, is_near = edge(degrees, offset)
    color = np.broadcast_to(np.array([0.4, 0.5, 0.6, 1.0]), (ROWS, COLUMNS, 4))
    found = found_in(color, np.where(is_near, NEAR, FAR))
    off = np.abs(near_share(found) - cover)
    # The depth at the pixel's middle alone is off by a half at worst and a quarter on average.
    assert off.max() < 0.5
    assert off[(cover > 0.0) & (cover < 1.0)].mean() < 0.25
    for sheet in (0, 1):
        there = found.coverage[sheet] > 0.0
        np.testing.assert_allclose(found.color[sheet][there], color[there], atol=1e-5)


@pytest.mark.parametrize("offset", [0.0, 0.2, 0.4, -0.3])
@pytest.mark.parametrize("degrees", [0.0, 90.0])
def test_bar_three_pixels_wide(degrees: float, offset: float) -> None:
    """Its middle is clean."""
    cover, is_near = bar(3.0, degrees, offset)
    found = found_in(mixture(cover, [0.9, 0.8, 0.2, 1.0], [0.1, 0.1, 0.3, 1.0]), np.where(is_near, NEAR, FAR))
    assert np.abs(near_share(found) - cover).max() < 0.02


@pytest.mark.parametrize("width", [1.0, 1.5, 2.0])
@pytest.mark.parametrize(
    ("degrees", "offset"), [(0.0, 0.5), (0.0, 0.3), (90.0, 0.25), (30.0, 0.1), (50.0, 0.2)]
)
def test_thin_bar_keeps_its_light(width: float, degrees: float, offset: float) -> None:
    """Nothing tells a hair's own colour; how much light it has does not depend on that."""
    cover, is_near = bar(width, degrees, offset)
    color = mixture(cover, [0.9, 0.8, 0.2, 1.0], [0.0, 0.0, 0.0, 1.0])
    found = found_in(color, np.where(is_near, NEAR, FAR))
    np.testing.assert_allclose(recomposed(found), color, atol=1e-3)
    light = near_share(found) * found.color[0, ..., 0]
    inner = slice(6, -6)
    expected = 0.9 * cover[inner, inner].sum()
    assert light[inner, inner].sum() == pytest.approx(expected, rel=0.1)
    # Nor is it wider than it was by more than a pixel filter makes it.
    assert near_share(found)[inner, inner].sum() <= cover[inner, inner].sum() * (1.0 + 1.0 / width)


def test_point_samples_are_not_mixed() -> None:
    rng = np.random.default_rng(3)
    _, is_near = edge(30.0, 0.2)
    color = rng.random((ROWS, COLUMNS, 4))
    radius = np.where(is_near, NEAR, FAR)
    found = found_in(color, radius, mixed=False)
    assert (found.coverage[0] == 1.0).all()
    assert np.array_equal(found.color[0], color.astype(np.float32))
    assert np.array_equal(found.radius[0], radius.astype(np.float32))


def test_highlight_of_the_far_surface_stays_on_it() -> None:
    """A lamp on the wall, in a pixel beside the edge: neither of the surfaces' usual colours explains it."""
    _, is_near = edge(0.0, 0.0)
    for x in (14, 15):
        color = np.where(is_near[..., np.newaxis], [0.5, 0.4, 0.3, 1.0], [0.2, 0.2, 0.3, 1.0])
        color[12, x, :3] = 1000.0
        assert not is_near[12, x]
        found = found_in(color, np.where(is_near, NEAR, FAR))
        light = found.coverage * found.color[..., 0]
        light[1:] *= 1.0 - found.coverage[0]
        assert light[found.radius > 0.5 * (NEAR + FAR)].max() > 900.0
        assert light[found.radius < 0.5 * (NEAR + FAR)].max() < 100.0


# Un-mixing with known coverages


def matte(covers: dict[int, Array]) -> Cryptomatte:
    """Return a Cryptomatte of ids' covers, in ranks by cover; where two are equal in any order."""
    cover = np.stack([np.asarray(values, dtype=np.float32) for values in covers.values()])
    ids = np.broadcast_to(np.array(list(covers), dtype=np.uint32)[:, np.newaxis, np.newaxis], cover.shape)
    order = np.argsort(-cover, axis=0, kind="stable")
    cover, ids = np.take_along_axis(cover, order, axis=0), np.take_along_axis(ids, order, axis=0)
    return Cryptomatte(np.where(cover > 0.0, ids, np.uint32(0)), cover)


BALL, WALL, DOOR = 0x7FC01234, 0x00000001, 0xFFA00001


@EDGES
@pytest.mark.parametrize("background", ["a wall", "nothing"])
@pytest.mark.parametrize("colors", ["equal", "patterns", "noise"])
def test_known_cover_is_taken_whatever_the_colors(
    colors: str, background: str, degrees: float, offset: float
) -> None:
    cover, is_near = edge(degrees, offset)
    rng = np.random.default_rng(9)
    color = {
        "equal": np.full((ROWS, COLUMNS, 4), 0.5),
        "patterns": mixture(cover, pattern(3), pattern(4, 0.0, 1.0)),
        "noise": rng.random((ROWS, COLUMNS, 4)),
    }[colors]
    known = matte({BALL: cover, WALL: 1.0 - cover} if background == "a wall" else {BALL: cover})
    found = found_in(color, np.where(is_near, NEAR, FAR), mattes=[known])
    # What covers less than 1/256 is left out.
    assert np.abs(near_share(found) - cover).max() < 1.0 / 256.0 + 1e-6
    np.testing.assert_allclose(recomposed(found), color, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("width", [0.4, 0.7, 1.2, 1.5, 2.0])
@pytest.mark.parametrize(
    ("degrees", "offset"), [(0.0, 0.4), (0.0, 0.3), (90.0, 0.25), (30.0, 0.1), (50.0, 0.2)]
)
def test_wire_of_known_cover_has_its_own_color(width: float, degrees: float, offset: float) -> None:
    """No pixel shows it alone, and renderers give a pixel's depth at a random place in it."""
    cover, _ = bar(width, degrees, offset)
    wire, wall = np.array([0.9, 0.8, 0.2, 1.0]), np.array([0.1, 0.2, 0.4, 1.0])
    is_near = np.random.default_rng(4).random(cover.shape) < cover
    color = mixture(cover, wire, wall)
    found = found_in(color, np.where(is_near, NEAR, FAR), mattes=[matte({BALL: cover, WALL: 1.0 - cover})])
    share = near_share(found)
    # A wire that no depth nearby tells of is not known to be there.
    beside = np.zeros_like(is_near)
    for j, i in [(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1)]:
        beside |= np.roll(is_near, (j, i), axis=(0, 1))
    seen = np.zeros_like(is_near)
    seen[3:-3, 3:-3] = (beside & (cover > 0.1) & (cover < 0.99))[3:-3, 3:-3]
    # Where the few depths nearby happen to be those of pixels with little of the wire, they mislead.
    right = np.abs(share - cover)[seen] < 1.0 / 256.0 + 1e-6
    assert seen.sum() >= 12
    assert right.mean() > 0.9
    np.testing.assert_allclose(recomposed(found), color, atol=1e-4)
    off = np.abs(found.color[:2] - np.stack([wire, wall])[:, np.newaxis, np.newaxis]).max(axis=-1)
    assert off[:, seen][:, right].mean() < 0.02
    assert off[:, seen][:, right].max() < 0.1


def test_farther_surface_of_two_ids() -> None:
    """A door in the wall: both are behind the near edge, in whatever order."""
    cover, is_near = edge(30.0, 0.2)
    rest = 1.0 - cover
    door = np.clip(11.5 - np.arange(ROWS), 0.0, 1.0)[:, np.newaxis]
    known = matte({BALL: cover, WALL: rest * (1.0 - door), DOOR: rest * door})
    color = np.full((ROWS, COLUMNS, 4), 0.5)
    found = found_in(color, np.where(is_near, NEAR, FAR), mattes=[known])
    assert np.abs(near_share(found) - cover).max() < 1.0 / 256.0 + 1e-6


@pytest.mark.parametrize("known", ["one id", "no id", "both sides"])
def test_a_thing_before_itself_is_split_by_its_colors(known: str) -> None:
    """Its id is on both sides of the edge and tells nothing."""
    cover, is_near = edge(30.0, 0.2)
    color = mixture(cover, [0.9, 0.2, 0.1, 1.0], [0.1, 0.3, 0.6, 1.0])
    radius = np.where(is_near, NEAR, FAR)
    ones = np.ones((ROWS, COLUMNS))
    covers = {
        "one id": {BALL: ones},
        "no id": {BALL: 0.0 * ones},
        "both sides": {BALL: (np.arange(ROWS) % 2)[:, np.newaxis] * ones, WALL: ones * 0.0},
    }[known]
    found = found_in(color, radius, mattes=[matte(covers)])
    for mine, theirs in zip(found, found_in(color, radius), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_clean_colors_may_be_next_to_an_edge() -> None:
    """A bar of two pixels between pixels' borders: nothing is mixed, and nothing is to be split."""
    cover, is_near = bar(2.0, 0.0, 0.0)
    assert set(np.unique(cover)) == {0.0, 1.0}
    color = np.where(is_near[..., np.newaxis], pattern(3), pattern(4))
    found = found_in(color, np.where(is_near, NEAR, FAR), mattes=[matte({BALL: cover, WALL: 1.0 - cover})])
    assert (found.coverage[0] == 1.0).all()
    np.testing.assert_array_equal(found.color[0], color.astype(np.float32))


def test_hidden_views_have_coverages_of_their_own() -> None:
    """A pixel of one that its own surface fills stays as it is, beside an edge too."""
    cover, is_bar = bar(2.0, 0.0, 0.0)
    hidden = np.where(is_bar[..., np.newaxis], pattern(5), pattern(6))
    radius = np.stack([np.full((ROWS, COLUMNS), -9.0), np.where(is_bar, -3.0, 3.0)])
    front = np.broadcast_to(np.array([0.0, 1.0, 0.0, 1.0]), hidden.shape)
    mattes = [matte({DOOR: np.ones((ROWS, COLUMNS))}), matte({BALL: cover, WALL: 1.0 - cover})]
    found = found_in(np.stack([front, hidden]), radius, mattes=mattes)
    np.testing.assert_allclose(found.color[1], hidden, atol=1e-6)


@pytest.mark.parametrize("views", [1, 2])
def test_coverages_that_fit_nothing_do_no_harm(views: int) -> None:
    rng = np.random.default_rng(8)
    alpha = rng.choice([0.0, 0.4, 1.0], (views, ROWS, COLUMNS, 1))
    color = np.concatenate([alpha * rng.random((views, ROWS, COLUMNS, 3)) * 100.0, alpha], axis=-1)
    radius = np.sort(rng.choice([-12.0, -3.0, 0.0, 5.0], (views, ROWS, COLUMNS)), axis=0)
    ids = rng.choice(np.array([0, BALL, WALL, DOOR], dtype=np.uint32), (views, 3, ROWS, COLUMNS))
    cover = rng.random((views, 3, ROWS, COLUMNS)).astype(np.float32)
    mattes = [Cryptomatte(i, np.where(i == 0, np.float32(0.0), c)) for i, c in zip(ids, cover, strict=True)]
    found = found_in(color, radius, mattes=mattes)
    for values in found:
        assert np.isfinite(values).all()
    assert found.color.min() >= 0.0
    for values in (found.coverage, found.guessed):
        assert values.min() >= 0.0
        assert values.max() <= 1.0
    if views == 1:
        np.testing.assert_allclose(recomposed(found), color[0], rtol=1e-4, atol=1e-3)


# Jumps


def plane(slope_x: float, slope_y: float) -> Array:
    v, u = np.mgrid[0:ROWS, 0:COLUMNS]
    return np.asarray(slope_x * (u - 0.5 * COLUMNS) + slope_y * (v - 0.5 * ROWS))


def has_edges(radius: Array) -> bool:
    """Return whether anything is taken for an edge: felt, split or carried on."""
    color = np.random.default_rng(1).random((ROWS, COLUMNS, 4))
    found = found_in(color, radius)
    return bool(found.reach.any() or found.coverage[1:].any() or (found.coverage[0] < 1.0).any())


@pytest.mark.parametrize("slope", [0.1, 0.3, 0.49, 0.51, 0.7, 0.9, -0.9])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (1.0, 1.0), (-1.0, 0.4)])
def test_plane_has_no_edges(direction: tuple[float, float], slope: float) -> None:
    """Nor at the frame's border."""
    assert not has_edges(plane(slope * direction[0], slope * direction[1]))


@pytest.mark.parametrize("steepest", [0.4, 0.9])
@pytest.mark.parametrize("kind", ["cap", "bowl", "wave"])
def test_curved_surface_has_no_edges(kind: str, steepest: float) -> None:
    v, u = np.mgrid[0:ROWS, 0:COLUMNS]
    x, y = u - 15.3, v - 11.7
    if kind == "wave":
        radius = steepest * 12.0 / (2.0 * math.pi) * np.sin(2.0 * math.pi * x / 12.0)
    else:
        radius = steepest * (x**2 / 15.0 + y**2 / 13.0) / 2.0 * (1.0 if kind == "bowl" else -1.0)
    steps = max(np.abs(np.diff(radius, axis=axis)).max() for axis in (0, 1))
    assert steps <= steepest * 1.1
    assert not has_edges(radius)


@pytest.mark.parametrize("slope", [0.0, 0.3, -0.3])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("step", [2.0, -2.0, 10.0])
def test_step_of_two_pixels_is_an_edge(step: float, axis: int, slope: float) -> None:
    radius = plane(slope, slope)
    at = [slice(None), slice(None)]
    at[axis] = slice(12, None)
    radius[tuple(at)] += step
    found = found_in(np.ones((ROWS, COLUMNS, 4)), radius)
    reach = np.moveaxis(found.reach, axis, 0)
    assert (reach[11:13] > 0.0).all()
    np.testing.assert_allclose(reach[11:13], abs(step + slope), atol=1e-4)
    assert not reach[:11].any()
    assert not reach[13:].any()


def test_slopes_are_those_of_the_surface() -> None:
    """Of each surface by itself, also beside an edge."""
    radius = plane(0.3, -0.2)
    radius[:, 16:] += 9.0
    found = found_in(np.ones((ROWS, COLUMNS, 4)), radius, mixed=False)
    np.testing.assert_allclose(found.slope[0, ..., 0], 0.3, atol=1e-4)
    np.testing.assert_allclose(found.slope[0, ..., 1], -0.2, atol=1e-4)


# Behind


def test_rendered_surfaces_lie_behind() -> None:
    """A view without the near bar: what lies behind it there, and nothing anew elsewhere."""
    _, is_near = bar(6.0, 0.0, 0.0)
    back = pattern(6)
    color = np.stack([np.where(is_near[..., np.newaxis], [0.5, 0.1, 0.1, 1.0], back), back])
    radius = np.stack([np.where(is_near, NEAR, FAR), np.full((ROWS, COLUMNS), FAR)])
    found = found_in(color, radius, mixed=False)
    assert np.array_equal(found.coverage[1] > 0.0, is_near)
    np.testing.assert_allclose(found.color[1][is_near], back[is_near], atol=1e-6)
    assert (found.radius[1][is_near] == FAR).all()
    assert not found.guessed.any()


def test_surfaces_behind_one_another() -> None:
    """Three views; the second leaves out only one of two bars."""
    _, first = bar(8.0, 0.0, 0.0)
    _, second = bar(6.0, 90.0, 0.0)
    radius = np.stack(
        [
            np.where(first, -8.0, np.where(second, -3.0, 4.0)),
            np.where(second, -3.0, 4.0),
            np.full((ROWS, COLUMNS), 4.0),
        ]
    )
    color = np.ones((3, ROWS, COLUMNS, 4)) * np.array([0.2, 0.5, 0.8]).reshape(3, 1, 1, 1)
    found = found_in(color, radius, mixed=False)
    assert np.array_equal(found.coverage[1] > 0.0, first)
    assert np.array_equal(found.coverage[2] > 0.0, second)
    assert (found.color[2][second] == np.float32(0.8)).all()


def test_mixed_edges_of_hidden_views_are_cleaned() -> None:
    """A pixel of a hidden view that is half of something else would show that through the near surface."""
    cover, is_bar = bar(6.0, 0.0, 0.3)
    hidden = mixture(cover, [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0])
    radius = np.stack([np.full((ROWS, COLUMNS), -9.0), np.where(is_bar, -3.0, 3.0)])
    front = np.broadcast_to(np.array([0.0, 1.0, 0.0, 1.0]), hidden.shape)
    found = found_in(np.stack([front, hidden]), radius)
    clean = np.where(is_bar[..., np.newaxis], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0])
    np.testing.assert_allclose(found.color[1], clean, atol=1e-5)


@pytest.mark.parametrize("mixed", [True, False])
def test_wall_is_carried_on_as_far_as_the_lens_looks(mixed: bool) -> None:
    """Behind a wide plate, for the difference of the radii; farther behind it nothing is seen."""
    x = np.arange(64)
    is_near = np.broadcast_to(x >= 32, (ROWS, 64))
    color = np.where(is_near[..., np.newaxis], [0.8, 0.1, 0.1, 1.0], [0.1, 0.2, 0.7, 1.0])
    found = found_in(color, np.where(is_near, -8.0, 2.0), mixed=mixed)
    behind = found.coverage[1] > 0.0
    assert behind[:, 32:41].all()
    assert not behind[:, 44:].any()
    assert not behind[:, :31].any()
    guessed = found.guessed[1] > 0.0
    assert guessed[:, 33:41].all()
    np.testing.assert_allclose(found.color[1][guessed], [[0.1, 0.2, 0.7, 1.0]] * guessed.sum(), atol=1e-5)
    assert (found.radius[1][guessed] == 2.0).all()
    np.testing.assert_allclose(found.depth[1][guessed], depth_of(2.0), rtol=1e-6)


def test_wall_behind_a_bar_is_a_mixture_of_both_sides() -> None:
    """Nearer to the left it looks like the left, and in the middle like the mean."""
    color = np.ones((ROWS, COLUMNS, 4))
    color[:, :12, :3], color[:, 20:, :3] = 0.2, 0.8
    radius = np.full((ROWS, COLUMNS), 0.0)
    radius[:, 12:20] = -10.0
    found = found_in(color, radius, mixed=False)
    level = found.color[1, 12, 12:20, 0]
    assert (np.diff(level) > 0.0).all()
    assert level[0] < 0.35
    assert level[-1] > 0.65
    np.testing.assert_allclose(level + level[::-1], 1.0, atol=1e-5)


@pytest.mark.parametrize("wall", [0.3, 0.0], ids=["grey wall", "black wall"])
@pytest.mark.parametrize("away", [0, 1, 2, 5])
@pytest.mark.parametrize("mixed", [True, False])
def test_highlight_beside_an_edge_is_not_carried_on(mixed: bool, away: int, wall: float) -> None:
    _, is_near = edge(0.0, 0.0)
    color = np.where(is_near[..., np.newaxis], [0.5, 0.4, 0.3, 1.0], [wall, wall, wall, 1.0])
    color[12, 15 - away, :3] = 1000.0
    found = found_in(color, np.where(is_near, NEAR, FAR), mixed=mixed)
    behind = found.guessed[1] > 0.0
    assert behind.sum() > 8 * ROWS
    # A pixel may count some times what its neighbours do: on a black wall, as nothing.
    assert found.color[1][behind].max() < max(3.0 * wall, 0.01 * 1000.0)


@pytest.mark.parametrize("shape", [(2, 2), (2, 9), (3, 3), (9, 2)])
@pytest.mark.parametrize("mixed", [True, False])
def test_tiny_pictures(mixed: bool, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(2)
    color = rng.random((*shape, 4))
    found = found_in(color, rng.choice([-9.0, 0.0, 4.0], shape), mixed=mixed)
    for values in found:
        assert np.isfinite(values).all()
    np.testing.assert_allclose(recomposed(found), color, atol=1e-5)
