"""What the aperture sees past near edges, against scenes looked through point by point of the aperture.

The reference needs no buffers: sheets that are flat in the circle's radius are met by every ray, the nearest
counts. Bounds in decibels are for displayed values (sRGB, peak 1). An edge is known to 2 of some 50 points of
the aperture, 4 % of a contrast of half the range at worst and a third of that on average; where a third of
the picture is soft edges, that is 0.8 % of the range or 42 dB, and an ordinary render adds what its pixel
filter lost.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest

from potmesil_addon import jit, visibility
from potmesil_addon.aperture import SAMPLE_POSITIONS, SamplePosition
from potmesil_addon.camera import Film
from potmesil_addon.focus import FocusSettings, average_down, focus_layer
from potmesil_addon.fragments import fragments_of
from potmesil_addon.lens import Lens, circle_of_confusion
from potmesil_addon.progress import run
from potmesil_addon.psf import PsfBuilder, PsfSettings, TableAssignment
from potmesil_addon.samples import SampleLayer, Samples, Window
from potmesil_addon.scatter import WHOLE as WHOLE_LIGHT
from potmesil_addon.scatter import Masks, Scatter, cuts_between_cells, scatter
from potmesil_addon.visibility import (
    CELLS,
    VISIBILITIES,
    aperture_cells,
    brightness_of_lights,
    decide,
)

from .helpers import Array, Picture, focused, make_samples, polygon_vertices_by_hand, square_film

needs_numba = pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")
backends = pytest.mark.parametrize("backend", [pytest.param("numba", marks=needs_numba), "numpy"])

Mode = Literal["points", "ordinary"]
modes = pytest.mark.parametrize("mode", ["points", "ordinary"])

POINTS, ORDINARY = 44.0, 40.0
"""Bounds in dB where hidden layers are rendered."""

GAIN = 5.0
"""What is gained at least over TOG 1982, eq. 22, in dB, where what is hidden is carried on."""

ROWS, COLUMNS = 60, 96
PITCH = 2e-5
ROUND = Lens(0.05, 1.4, 2.0)
PENTAGON = replace(ROUND, blades=5, blade_rotation=0.35)
ANAMORPHIC = replace(ROUND, anamorphic_ratio=1.6)

# The reference: every ray through the aperture, sheet by sheet


@dataclass(frozen=True)
class Sheet:
    """A surface along which the circle's signed radius changes linearly over the pinhole's picture.

    Parameters
    ----------
    radius : float
        At the middle of the picture, in pixels.
    inside : callable
        Whether the sheet is there, of x and y.
    color : callable
        Its premultiplied colours, of x and y: (..., 4).
    slope : tuple of float
        Change of the radius for each pixel in x and in y.
    """

    radius: float
    inside: Callable[[Array, Array], Any]
    color: Callable[[Array, Array], Array]
    slope: tuple[float, float] = (0.0, 0.0)

    def seen(self, x: Array, y: Array, a: tuple[float, float]) -> tuple[Array, Array, Array]:
        """Return where the pinhole sees what is at a place of the picture through a point, and the radius."""
        # x' = x + r(x) a, solved for x.
        flat = self.radius + self.slope[0] * (x - 0.5 * COLUMNS) + self.slope[1] * (y - 0.5 * ROWS)
        radius = flat / (1.0 + self.slope[0] * a[0] + self.slope[1] * a[1])
        return x - radius * a[0], y - radius * a[1], radius


Scene = tuple[Sheet, ...]


def shade(scene: Scene, x: Array, y: Array, a: tuple[float, float] = (0.0, 0.0)) -> tuple[Array, Array]:
    """Return colour and radius of the nearest sheet at places of the picture, seen through a point."""
    color, nearest = np.zeros((*x.shape, 4)), np.full(x.shape, np.inf)
    for sheet in scene:
        u, v, radius = sheet.seen(x, y, a)
        nearer = sheet.inside(u, v) & (radius < nearest)
        color[nearer] = sheet.color(u[nearer], v[nearer])
        nearest[nearer] = radius[nearer]
    return color, nearest


def filter_offsets(share: Array, mode: Mode) -> Array:
    """Return places within a pixel that follow a pixel filter: Cycles' Blackman-Harris, or even."""
    if mode == "points":
        return share - 0.5
    width = 1.5
    x = (np.arange(2000) + 0.5) / 2000
    weight = sum(
        c * np.cos(2.0 * math.pi * k * x) for k, c in enumerate((0.35875, -0.48829, 0.14128, -0.01168))
    )
    return np.asarray(np.interp(share, np.cumsum(weight) / np.sum(weight), (x - 0.5) * width))


def spread_evenly(count: int, dimensions: int, start: float = 0.5) -> Array:
    """Return points of the unit cube that leave no gaps: the golden ratio's steps in each direction."""
    phi = 2.0
    for _ in range(40):
        phi = (1.0 + phi) ** (1.0 / (dimensions + 1))
    return np.asarray(
        (start + np.outer(np.arange(1, count + 1), phi ** -np.arange(1.0, dimensions + 1))) % 1.0
    )


def aperture_points(lens: Lens, share: Array) -> Array:
    """Return points (x, y down) of an aperture, in radii along the film's x, from points of a square."""
    if lens.is_round:
        radius, angle = np.sqrt(share[:, 0]), 2.0 * math.pi * share[:, 1]
        return np.stack([radius * np.cos(angle) / lens.anamorphic_ratio, radius * np.sin(angle)], axis=1)
    # Triangles around the middle, all of one size.
    corners = polygon_vertices_by_hand(lens.blades, lens.blade_rotation, lens.anamorphic_ratio)
    blade = np.floor(share[:, 1] * lens.blades).astype(int)
    along = (share[:, 1] * lens.blades - blade)[:, np.newaxis]
    rim = (1.0 - along) * corners[blade] + along * corners[(blade + 1) % lens.blades]
    return np.asarray(np.sqrt(share[:, :1]) * rim * [1.0, -1.0])


def pixel_places(window: Window, inset: float = 0.5) -> tuple[Array, Array]:
    return np.meshgrid(
        np.arange(window.x0, window.x1) + inset, np.arange(window.y0, window.y1) + inset
    )  # fmt: skip


WHOLE = Window(0, 0, COLUMNS, ROWS)


def looked_through(
    scene: Scene, lens: Lens = ROUND, mode: Mode = "points", count: int = 900, start: float = 0.5
) -> Array:
    """Return the picture: the mean over points of the aperture, each with places of its own in the pixels."""
    share = spread_evenly(count, 4, start)
    within = filter_offsets(share[:, 2:], mode)
    x, y = pixel_places(WHOLE)
    total = np.zeros((ROWS, COLUMNS, 4))
    for a, (dx, dy) in zip(aperture_points(lens, share[:, :2]), within, strict=True):
        total += shade(scene, x + dx, y + dy, (float(a[0]), float(a[1])))[0]
    return total / count


# The same scenes as samples


def scale_of(lens: Lens) -> float:
    """Return the film's pixels of radius for each inverse metre."""
    return 0.5 * lens.focal_length * lens.aperture_diameter / PITCH


def depth_of(radius: npt.ArrayLike, lens: Lens = ROUND) -> Array:
    """Return the depth of a signed radius in pixels; infinite at its largest."""
    inverse = 1.0 / lens.focus_distance - np.asarray(radius) / scale_of(lens)
    return np.asarray(1.0 / np.maximum(inverse, 1e-30))


AT_INFINITY = scale_of(ROUND) / ROUND.focus_distance
"""Radius in pixels of what is infinitely far away; 22."""


def rendered(scene: Scene, mode: Mode, lens: Lens, window: Window, inset: float) -> SampleLayer:
    """Return what a render sees: colours through its pixel filter, or of the points; depths of the points."""
    fineness = 2 if mode == "points" else 1
    x, y = pixel_places(window, inset)
    x, y = x / fineness, y / fineness
    color, radius = shade(scene, x, y)
    if mode == "ordinary":
        places = filter_offsets((np.arange(8) + 0.5) / 8, mode)
        color = sum(shade(scene, x + i, y + j)[0] for j in places for i in places) / 64  # type: ignore[assignment]
    depth = np.where(np.isfinite(radius), depth_of(np.where(np.isfinite(radius), radius, 0.0), lens), np.inf)
    depth[depth > 1e9] = np.inf
    return SampleLayer("", color.astype(np.float32), depth.astype(np.float32))


def samples_of(
    scene: Scene,
    mode: Mode = "points",
    *,
    hidden: bool = True,
    lens: Lens = ROUND,
    position: SamplePosition = "center",
    overscan: int = 0,
) -> Samples:
    """Return a samples file of a scene; with its hidden layers, each sheet is left out after the other."""
    fineness = 2 if mode == "points" else 1
    extra = 1 if position == "corner" else 0
    data = Window(
        -overscan * fineness,
        -overscan * fineness,
        (COLUMNS + overscan) * fineness + extra,
        (ROWS + overscan) * fineness + extra,
    )
    inset = 0.5 if position == "center" else 0.0
    layer = rendered(scene, mode, lens, data, inset)
    if hidden:
        behind = tuple(rendered(scene[n:], mode, lens, data, inset) for n in range(1, len(scene)))
        layer = replace(layer, hidden=behind)
    display = Window(0, 0, COLUMNS * fineness, ROWS * fineness)
    return Samples((layer,), data, display, position=position, supersampling=fineness)


def settings_for(samples: Samples, lens: Lens = ROUND, **others: Any) -> FocusSettings:
    window = samples.display_window
    film = Film(COLUMNS * PITCH, ROWS * PITCH, window.columns, window.rows)
    return FocusSettings(lens, film, **{"visibility": "aperture", **others})


def picture_of(samples: Samples, lens: Lens = ROUND, **others: Any) -> Picture:
    return average_down(focused(samples, settings_for(samples, lens, **others)), samples.supersampling)


def displayed(linear: npt.NDArray[Any]) -> Array:
    linear = np.clip(linear[..., :3].astype(np.float64), 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def decibels(picture: npt.NDArray[Any], expected: npt.NDArray[Any], border: int = 14) -> float:
    """Return the PSNR of displayed values, away from the border, past which samples know nothing."""
    within = (slice(border, picture.shape[0] - border), slice(border, picture.shape[1] - border))
    off = displayed(picture)[within] - displayed(expected)[within]
    return -10.0 * math.log10(max(float((off**2).mean()), 1e-30))


# Scenes


def everywhere(x: Array, y: Array) -> npt.NDArray[np.bool_]:
    return np.ones(np.broadcast_shapes(x.shape, y.shape), dtype=bool)


def plain(*color: float) -> Callable[[Array, Array], Array]:
    rgba = np.array([*color, 1.0])
    return lambda x, _: np.broadcast_to(rgba, (*x.shape, 4))


def waves(period: float, phase: float, *color: float) -> Callable[[Array, Array], Array]:
    k = 2.0 * math.pi / period

    def at(x: Array, y: Array) -> Array:
        level = 0.5 + 0.25 * np.sin(k * x + phase) + 0.25 * np.sin(1.3 * k * y + 2.0 * phase + 0.3 * k * x)
        rgb = level[..., np.newaxis] * np.array(color)
        return np.concatenate([rgb, np.ones((*x.shape, 1))], axis=-1)

    return at


def slanted_bar(middle: float, lean: float, half: float) -> Callable[[Array, Array], Any]:
    return lambda x, y: np.abs(x - lean * (y - 0.5 * ROWS) - middle) < half


def ball(x: Array, y: Array) -> Any:
    return (x - 48.0) ** 2 + (y - 30.0) ** 2 < 17.0**2


WALL = Sheet(6.0, everywhere, waves(18.0, 1.0, 0.2, 0.9, 0.5))
SHARP_WALL = replace(WALL, radius=0.0)
BALL = Sheet(0.0, ball, waves(13.0, 2.0, 0.9, 0.3, 0.3))
BAR = Sheet(-8.0, slanted_bar(34.0, 0.3, 7.0), waves(31.0, 3.0, 0.4, 0.4, 1.0))
NEAREST = Sheet(-12.0, slanted_bar(66.0, -0.5, 5.0), waves(31.0, 4.0, 1.0, 1.0, 0.4))

SCENES: dict[str, Scene] = {
    "bar before a sharp wall": (BAR, SHARP_WALL),
    "ball before a wall": (BALL, WALL),
    "bars before a wall": (NEAREST, BAR, WALL),
    "bars, ball and wall": (NEAREST, BAR, BALL, WALL),
}
SIMPLE = ("bar before a sharp wall", "ball before a wall")


@cache
def reference(name: str, mode: Mode, lens: Lens = ROUND) -> Array:
    return looked_through(SCENES[name], lens, mode)


# Against the reference


@pytest.mark.parametrize("lens", [ROUND, PENTAGON], ids=["round", "pentagon"])
def test_reference_does_not_depend_on_its_points(lens: Lens) -> None:
    """Else it could not judge 44 dB."""
    name = "bars, ball and wall"
    other = looked_through(SCENES[name], lens, count=700, start=0.13)
    assert decibels(reference(name, "points", lens), other) > POINTS + 8.0


@modes
@pytest.mark.parametrize("name", SCENES)
def test_hidden_layers_show_what_the_aperture_sees(name: str, mode: Mode) -> None:
    expected = reference(name, mode)
    samples = samples_of(SCENES[name], mode)
    assert decibels(picture_of(samples, visibility="none"), expected) < ORDINARY - GAIN
    assert decibels(picture_of(samples), expected) > (POINTS if mode == "points" else ORDINARY)


@modes
@pytest.mark.parametrize("name", SCENES)
def test_what_is_hidden_is_carried_on(name: str, mode: Mode) -> None:
    expected = reference(name, mode)
    samples = samples_of(SCENES[name], mode, hidden=False)
    without = decibels(picture_of(samples, visibility="none"), expected)
    assert decibels(picture_of(samples), expected) > without + (GAIN if name in SIMPLE else 3.0)


@pytest.mark.parametrize("lens", [PENTAGON, replace(PENTAGON, blade_rotation=-1.1), ANAMORPHIC])
@pytest.mark.parametrize("name", ["bar before a sharp wall", "bars, ball and wall"])
def test_other_apertures(name: str, lens: Lens) -> None:
    """A pentagon points the other way before the focus than behind it.

    Of the points that divide a disc, a pentagon has three quarters.
    """
    expected = reference(name, "points", lens)
    turned = replace(lens, blade_rotation=lens.blade_rotation + math.pi, anamorphic_ratio=1.0)
    otherwise = decibels(picture_of(samples_of(SCENES[name]), turned), expected)
    assert decibels(picture_of(samples_of(SCENES[name]), lens), expected) > max(ORDINARY, otherwise + 1.0)


@pytest.mark.parametrize("name", ["bar before a sharp wall", "bars before a wall"])
def test_corner_samples(name: str) -> None:
    """A pixel is the mean of its four corners, which smooths it once more."""
    expected = reference(name, "points")
    # Corners of the finer pixels: a tent of half a pixel in place of the box of a whole one.
    picture = picture_of(samples_of(SCENES[name], position="corner"))
    assert decibels(picture, expected) > ORDINARY


@pytest.mark.parametrize("name", ["ball before a wall", "bars before a wall"])
def test_diffraction_of_a_fast_lens_is_next_to_nothing(name: str) -> None:
    """At f/1.4 the Airy disc is a twentieth of a pixel: the picture is that of geometry."""
    settings = PsfSettings(kind="lommel")
    assert decibels(picture_of(samples_of(SCENES[name]), psf=settings), reference(name, "points")) > ORDINARY


def test_interpolated_tables() -> None:
    name = "bars before a wall"
    picture = picture_of(samples_of(SCENES[name]), psf=PsfSettings(lookup="interpolated"))
    assert decibels(picture, reference(name, "points")) > POINTS


@pytest.mark.parametrize("hidden", [True, False])
def test_overscan_makes_the_border_as_good_as_the_rest(hidden: bool) -> None:
    """Wide circles are 12 pixels; to be sure of the surfaces there, some more."""
    name = "bars before a wall"
    expected = reference(name, "points")
    samples = samples_of(SCENES[name], hidden=hidden, overscan=16)
    within = decibels(picture_of(samples_of(SCENES[name], hidden=hidden)), expected)
    assert decibels(picture_of(samples), expected, border=0) > (POINTS if hidden else within - 1.0)


# No leaks, no halos


@modes
@pytest.mark.parametrize("hidden", [True, False])
@pytest.mark.parametrize(
    ("lens", "radius"),
    [(ROUND, 6.0), (ROUND, 20.0), (PENTAGON, 6.0), (ANAMORPHIC, 6.0)],
    ids=["round", "round, far", "pentagon", "anamorphic"],
)
def test_sharp_ball_stays_what_it_is_before_a_blurred_wall(
    lens: Lens, radius: float, hidden: bool, mode: Mode
) -> None:
    """However far the wall is blurred, nothing of it lies on the ball."""
    samples = samples_of((BALL, replace(WALL, radius=radius)), mode, hidden=hidden)
    pinhole = average_down(samples.layers[0].color, samples.supersampling)
    x, y = pixel_places(WHOLE)
    # A pixel at the rim is partly the wall's.
    inner = np.hypot(x - 48.0, y - 30.0) < 17.0 - 2.0
    assert inner.sum() > 600
    assert np.abs(picture_of(samples, lens) - pinhole)[inner].max() < 1e-3
    leaking = picture_of(samples, lens, visibility="none")
    assert np.abs(leaking - pinhole)[inner].max() > 0.05


@modes
@pytest.mark.parametrize("hidden", [True, False])
@pytest.mark.parametrize("name", SCENES)
def test_one_color_stays_that_color(name: str, hidden: bool, mode: Mode) -> None:
    """Whatever hides what: of one colour nothing can be seen, up to the border."""
    color = plain(0.25, 0.7, 12.5)
    scene = tuple(replace(sheet, color=color) for sheet in SCENES[name])
    picture = picture_of(samples_of(scene, mode, hidden=hidden))
    np.testing.assert_allclose(picture, np.broadcast_to([0.25, 0.7, 12.5, 1.0], picture.shape), rtol=1e-5)


def disc_beyond(distance: Array) -> Array:
    """Return the share of the unit disc beyond a straight line at a signed distance from its middle."""
    d = np.clip(distance, -1.0, 1.0)
    return np.asarray((np.arccos(d) - d * np.sqrt(1.0 - d**2)) / math.pi)


@pytest.mark.parametrize("behind", [0.0, 3.5, 5.0, 10.0])
@pytest.mark.parametrize("degrees", [0.0, 90.0, 30.0, 200.0])
@modes
def test_soft_edge_follows_the_share_of_the_disc(mode: Mode, degrees: float, behind: float) -> None:
    """A near half plane over a plain wall: each pixel's cover is the disc's part that falls on the plane."""
    radius = 9.0
    normal = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    # Between points of an upright edge, which would show it elsewhere; of an ordinary render, anywhere.
    middle = np.array([0.5 * COLUMNS, 0.5 * ROWS]) + (0.5 if mode == "points" else 0.37)

    def within(x: Array, y: Array) -> Any:
        return (x - middle[0]) * normal[0] + (y - middle[1]) * normal[1] > 0.0

    scene = (Sheet(-radius, within, plain(1.0, 1.0, 1.0)), Sheet(behind, everywhere, plain(0.0, 0.0, 0.0)))
    for hidden in (True, False):
        picture = picture_of(samples_of(scene, mode, hidden=hidden))[..., 0]
        x, y = pixel_places(WHOLE)
        # Mean over the pixel, from a few lines across it.
        expected = np.zeros_like(x)
        for step in (np.arange(8) + 0.5) / 8 - 0.5:
            off = (x - middle[0]) * normal[0] + (y - middle[1]) * normal[1]
            expected += disc_beyond(-(off + step) / radius) / 8
        inner = (slice(14, -14), slice(14, -14))
        assert expected[inner].min() < 0.01
        assert expected[inner].max() > 0.99
        assert np.abs(picture - expected)[inner].max() < 2.0 / 64.0, hidden


@modes
@pytest.mark.parametrize("hidden", [True, False])
def test_sharp_edge_before_a_blurred_wall_stays_sharp(hidden: bool, mode: Mode) -> None:
    """The wall shows up to the edge as bright as it is, and nothing of it lies on what is sharp."""
    scene = (
        Sheet(0.0, lambda x, _: x < 48.0, plain(0.1, 0.1, 0.1)),
        Sheet(8.0, everywhere, plain(0.9, 0.9, 0.9)),
    )
    picture = picture_of(samples_of(scene, mode, hidden=hidden))[14:-14, 14:-14, 0]
    # The ordinary pixel filter reaches a quarter of a pixel into the neighbour.
    off = 1 if mode == "ordinary" else 0
    assert np.abs(picture[:, : 34 - off] - 0.1).max() < 1e-3
    assert np.abs(picture[:, 34 + off :] - 0.9).max() < 2.0 / 64.0 * 0.8


@pytest.mark.parametrize("hidden", [True, False])
def test_near_bar_keeps_its_shape_up_to_the_border(hidden: bool) -> None:
    """An upright bar is the same in every row, also where the picture ends and samples with it."""
    scene = (
        Sheet(-8.0, slanted_bar(48.0, 0.0, 12.0), plain(1.0, 1.0, 1.0)),
        Sheet(0.0, everywhere, plain(0.0, 0.0, 0.0)),
    )
    picture = picture_of(samples_of(scene, hidden=hidden))[..., 0]
    assert np.abs(picture - picture[ROWS // 2]).max() < 2.0 / 64.0


# Tilted planes


@pytest.mark.parametrize("slope", [(0.3, 0.0), (0.0, -0.6), (0.6, 0.6), (0.9, 0.0)])
def test_tilted_plane_hides_nothing_of_itself(slope: tuple[float, float]) -> None:
    """The picture is that without visibility, to the bit."""
    scene = (Sheet(0.0, everywhere, waves(18.0, 1.0, 0.2, 0.9, 0.5), slope),)
    lens = replace(ROUND, focus_distance=1.0)
    samples = samples_of(scene, lens=lens, position="corner")
    assert circle_of_confusion(np.asarray(samples.layers[0].depth), lens).min() < -1e-5
    pictures = [picture_of(samples, lens, visibility=v) for v in ("none", "aperture")]
    assert pictures[0].tobytes() == pictures[1].tobytes()


@modes
@pytest.mark.parametrize("slope", [(0.3, 0.0), (0.1, 0.2)])
def test_tilted_plane_with_a_bar_before_it(slope: tuple[float, float], mode: Mode) -> None:
    """An edge elsewhere must not make the plane hide parts of itself: a smooth gradient stays smooth."""

    def gradient(x: Array, y: Array) -> Array:
        level = 0.25 + 0.5 * x / COLUMNS
        return np.stack([level, level, level, np.ones_like(level)], axis=-1)

    bar = Sheet(-26.0, lambda _, y: y < 6.0, gradient)
    plane = Sheet(0.0, everywhere, gradient, slope)
    lens = replace(ROUND, focus_distance=1.0)
    expected = looked_through((plane,), lens, mode, count=400)
    for hidden in (True, False):
        picture = picture_of(samples_of((bar, plane), mode, lens=lens, hidden=hidden), lens)
        # As far from bar and border as circles reach.
        inner = (slice(36, 46), slice(24, 72))
        off = picture[inner] - expected[inner]
        # A sample's disc is centred where the pinhole sees it: of slope s and radius r it is off by r s / 4,
        # 1.1 pixels, and a pixel is 0.5 / 96.
        assert np.abs(off).max() < 1e-2
        bands = np.diff(picture[inner][..., 0], n=2, axis=1)
        assert np.abs(bands).max() < 2e-3


# A light half hidden

LAMP = 100.0
SIDES = {"left": (-1, 0), "right": (1, 0), "above": (0, -1), "below": (0, 1)}


@cache
def half_hidden(side: str, lamp: float, plate: float) -> Scene:
    """Return a lit pixel in the dark, to one side of the edge of a dark plate before it."""
    along = np.array(SIDES[side])
    at = np.array([48.0, 30.0]) + 0.5 * np.where(along == 0, 1, along)

    def beside(x: Array, y: Array) -> Any:
        return (x - 48.0) * along[0] + (y - 30.0) * along[1] < 0.0

    def light(x: Array, y: Array) -> Array:
        lit = LAMP * ((np.abs(x - at[0]) < 0.5) & (np.abs(y - at[1]) < 0.5))
        return np.stack([lit, lit, lit, np.ones_like(x)], axis=-1)

    return Sheet(plate, beside, plain(0.0, 0.0, 0.0)), Sheet(lamp, everywhere, light)


@pytest.mark.parametrize("lens", [ROUND, PENTAGON], ids=["round", "pentagon"])
@pytest.mark.parametrize("where", ["behind the focus", "before the focus"])
@pytest.mark.parametrize("side", SIDES)
def test_half_hidden_light_shows_the_right_half(side: str, where: str, lens: Lens) -> None:
    """A light beside the edge of a plate before it: on the plate's side its circle is cut off.

    Behind the focus the half on the light's side is left. Of a light before the focus, whose image stands on
    its head, a plate that is nearer still leaves the other half.
    """
    lamp, plate = (8.0, 0.0) if where == "behind the focus" else (-7.0, -14.0)
    scene = half_hidden(side, lamp, plate)
    expected = looked_through(scene, lens, count=400)[..., 0]
    x, y = pixel_places(WHOLE)
    along = (x - 48.0) * SIDES[side][0] + (y - 30.0) * SIDES[side][1]
    kept = along > 0.0 if where == "behind the focus" else along < 0.0
    assert expected[kept].sum() > 0.7 * expected.sum()
    for hidden in (True, False):
        picture = picture_of(samples_of(scene, hidden=hidden), lens)[..., 0].astype(np.float64)
        # The edge is known to 2 of 64 points and to half a pixel, 0.8 of a radius at most in the middle.
        off = 2.0 / 64.0 + 0.5 * 0.8 / 7.0
        assert picture.sum() == pytest.approx(expected.sum(), abs=off * LAMP), hidden
        part = expected[kept].sum() / expected.sum()
        assert picture[kept].sum() / picture.sum() == pytest.approx(part, abs=0.1)
        # Its middle lies where it should.
        for place in (x, y):
            middle = float((expected * place).sum() / expected.sum())
            assert float((picture * place).sum() / picture.sum()) == pytest.approx(middle, abs=0.6)


# Highlights


@modes
@pytest.mark.parametrize("hidden", [True, False])
@pytest.mark.parametrize("away", [0, 1, 3])
def test_highlight_beside_a_near_edge_is_not_carried_on(away: int, hidden: bool, mode: Mode) -> None:
    """It lies on a sharp wall, and only its own pixel and its filter's neighbours show it."""
    x0, y0 = 48 + away, 30

    def wall(x: Array, y: Array, peak: float) -> Array:
        lit = (np.floor(x) == x0) & (np.floor(y) == y0)
        level = np.where(lit, peak, 0.3)
        return np.stack([level, level, level, np.ones_like(level)], axis=-1)

    bar = Sheet(-8.0, lambda x, _: x < 48.0, plain(0.5, 0.4, 0.3))
    pictures = []
    for peak in (0.3, 1000.0):
        sharp = Sheet(0.0, everywhere, lambda x, y, peak=peak: wall(x, y, peak))  # type: ignore[misc]
        pictures.append(picture_of(samples_of((bar, sharp), mode, hidden=hidden))[..., 0])
    added = pictures[1].astype(np.float64) - pictures[0]
    around = (slice(y0 - 1, y0 + 2), slice(x0 - 1, x0 + 2))
    # Half of the aperture or more sees it.
    assert 350.0 < added[around].sum() < 1100.0
    added[around] = 0.0
    # What is carried on may be somewhat brighter for it, but not a highlight.
    assert np.abs(added).max() < 0.3


# Transparent film

SKY = Sheet(AT_INFINITY, everywhere, lambda x, _: np.zeros((*x.shape, 4)))


@modes
@pytest.mark.parametrize("hidden", [True, False])
@pytest.mark.parametrize("name", ["bar", "bars and ball"])
def test_transparent_film(name: str, hidden: bool, mode: Mode) -> None:
    """Where there is no surface the film is clear, infinitely far away; alpha is blurred like a colour."""
    things = (BAR,) if name == "bar" else (NEAREST, BAR, BALL)
    expected = looked_through((*things, SKY), ROUND, mode, count=600)
    samples = samples_of((*things, SKY), mode, hidden=hidden, overscan=24)
    assert np.isinf(np.asarray(samples.layers[0].depth)).any()
    picture = picture_of(samples)
    assert picture[..., 3].min() >= -1e-7
    assert picture[..., 3].max() <= 1.0 + 1e-5
    bound = POINTS if mode == "points" else ORDINARY
    if name != "bar":
        # Short of it by 9 and 6 dB: where blurred bars hide parts of a sharp thing and of the film behind it,
        # the cells of both meet at its rim, and a little of the clear film shows in it.
        bound -= 9.0 if mode == "points" else 6.0
    if name == "bar" or hidden:
        for channel in (3, 0, 1, 2):
            off = picture[..., channel] - expected[..., channel]
            assert -10.0 * math.log10(float((off**2).mean())) > bound, channel


# Quiet pictures


def cap(rows: int, columns: int) -> Array:
    """Return radii that grow by up to 0.45 pixels each pixel."""
    x, y = np.meshgrid(np.arange(columns) - 25.0, np.arange(rows) - 20.0)
    return np.asarray(-8.0 + 0.009 * (x**2 + y**2))


@pytest.mark.parametrize("lens", [ROUND, PENTAGON, ANAMORPHIC], ids=["round", "pentagon", "anamorphic"])
def test_without_edges_visibility_changes_nothing(lens: Lens) -> None:
    """To the bit. Of corner samples, since those in the middle of ordinary pixels are filtered already."""
    rng = np.random.default_rng(4)
    color, depth = rng.random((41, 51, 4)), depth_of(cap(41, 51), lens)
    samples = make_samples(color, depth, display=Window(0, 0, 50, 40), position="corner")
    settings = FocusSettings(lens, square_film(samples, PITCH), visibility="none")
    pictures = [focused(samples, replace(settings, visibility=v)) for v in VISIBILITIES]
    assert pictures[0].tobytes() == pictures[1].tobytes()


@backends
@pytest.mark.parametrize("mixed", [True, False])
def test_without_edges_the_whole_aperture_sees_all(mixed: bool, backend: Any) -> None:
    radius = cap(40, 50).astype(np.float32)[np.newaxis]
    color = np.random.default_rng(4).random((1, 40, 50, 4)).astype(np.float32)
    fragments = fragments_of(color, depth_of(radius).astype(np.float32), radius, 1.0, mixed=mixed)
    bright = brightness_of_lights(fragments.color[0])
    seen = decide(fragments, aperture_cells(ROUND, 1.0), brightest=bright, compiled=backend == "numba")
    assert not fragments.coverage[1:].any()
    assert (seen.share[0] == 1.0).all()
    assert (seen.number[0] == -1).all()


@pytest.mark.parametrize("radius", [0.0, 0.4, 1.0, 3.0, 8.0])
def test_wall_without_edges_is_blurred_as_the_lens_does(radius: float) -> None:
    """An ordinary render has its pixel filter already, and is not to be filtered by another one."""
    scene = (Sheet(radius, everywhere, waves(9.0, 1.0, 0.9, 0.7, 0.5)),)
    expected = looked_through(scene, ROUND, "ordinary")
    assert decibels(picture_of(samples_of(scene, "ordinary")), expected) > ORDINARY


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 3), (2, 9)])
@backends
def test_tiny_pictures_keep_their_color(shape: tuple[int, int], backend: Any) -> None:
    rng = np.random.default_rng(1)
    depth = depth_of(rng.choice([-9.0, 0.0, 6.0], shape))
    color = np.broadcast_to(np.array([0.25, 0.5, 3.0, 1.0]), (*shape, 4))
    samples = make_samples(color, depth)
    picture = focused(
        samples, FocusSettings(ROUND, square_film(samples, PITCH), visibility="aperture", backend=backend)
    )
    np.testing.assert_allclose(picture, color, rtol=1e-5)


# The same picture however it is made


def busy(mode: Mode = "ordinary", hidden: bool = True) -> Samples:
    return samples_of(SCENES["bars, ball and wall"], mode, hidden=hidden)


VARIANTS: dict[str, dict[str, Any]] = {
    "disc": {},
    "pentagon": {"lens": PENTAGON},
    "anamorphic": {"lens": ANAMORPHIC},
    "lommel": {"psf": PsfSettings(kind="lommel")},
    "interpolated": {"psf": PsfSettings(lookup="interpolated")},
    "interpolated pentagon": {"lens": PENTAGON, "psf": PsfSettings(lookup="interpolated")},
}


@needs_numba
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("hidden", [True, False])
def test_backends_agree(variant: str, hidden: bool) -> None:
    pictures = [picture_of(busy(hidden=hidden), **VARIANTS[variant], backend=b) for b in ("numba", "numpy")]
    assert np.abs(pictures[0] - pictures[1]).max() < 1e-4


@needs_numba
@pytest.mark.parametrize("position", SAMPLE_POSITIONS)
def test_backends_agree_on_points_and_corners(position: SamplePosition) -> None:
    samples = samples_of(SCENES["bars before a wall"], position=position)
    pictures = [picture_of(samples, backend=b) for b in ("numba", "numpy")]
    assert np.abs(pictures[0] - pictures[1]).max() < 1e-4


@needs_numba
@pytest.mark.parametrize("variant", ["disc", "interpolated pentagon", "lommel"])
def test_picture_does_not_depend_on_the_number_of_threads(variant: str, all_threads: int) -> None:
    if all_threads < 2:
        pytest.skip("this machine has one core")
    pictures = []
    for threads in (1, 2):
        assert jit.set_thread_count(threads) == threads
        pictures.append(
            [picture_of(busy(hidden=h), **VARIANTS[variant], backend="numba") for h in (True, False)]
        )
    for one, two in zip(*pictures, strict=True):
        assert one.tobytes() == two.tobytes()


# How sure the picture is


def test_guessed_is_0_where_all_is_rendered_and_not_behind_what_is_carried_on() -> None:
    name = "bar before a sharp wall"
    for hidden in (True, False):
        samples = samples_of(SCENES[name], hidden=hidden)
        guessed = run(focus_layer(samples.layers[0], samples, settings_for(samples))).guessed
        assert guessed.min() >= 0.0
        assert guessed.max() <= 1.0
        # What lies past the border is guessed, and felt as far as circles reach; samples are half a pixel.
        inner = guessed[36:-36]
        # The bar is 14 pixels wide and its circles 16; halfway behind its rim half of the light is guessed.
        if hidden:
            assert inner.max() < 1e-6
        else:
            assert inner.max() > 0.25
        # Past the circles' reach nothing is.
        assert not guessed[:, 2 * 70 :].any()


# Cells of the aperture


@pytest.mark.parametrize("lens", [ROUND, PENTAGON, ANAMORPHIC, replace(PENTAGON, blades=3)])
def test_cells_divide_the_aperture(lens: Lens) -> None:
    cells = aperture_cells(lens, 1.0)
    assert cells.area.shape == (CELLS, CELLS)
    assert cells.area.sum() == pytest.approx(1.0, abs=1e-12)
    lit = cells.area > 0.0
    fine = aperture_points(lens, spread_evenly(40000, 2))
    edges = np.linspace(-1.0, 1.0, CELLS + 1)
    share, _, _ = np.histogram2d(fine[:, 1], fine[:, 0], (edges, edges / lens.anamorphic_ratio))
    np.testing.assert_allclose(cells.area, share / 40000, atol=2e-3)
    # Each point lies in its cell.
    j, i = np.nonzero(lit)
    assert (np.floor((cells.x[lit] / cells.stretch_x + 1.0) * 0.5 * CELLS) == i).all()
    assert (np.floor((cells.y[lit] / cells.stretch_y + 1.0) * 0.5 * CELLS) == j).all()
    # And in the aperture.
    if lens.is_round:
        assert np.hypot(cells.x[lit] * lens.anamorphic_ratio, cells.y[lit]).max() <= 1.0


def test_whole_cells_points_share_neither_row_nor_column() -> None:
    """So an upright or a level edge passes the points one by one."""
    cells = aperture_cells(ROUND, 1.0)
    whole = cells.area >= cells.area.max() - 1e-12
    for values in (cells.x[whole], cells.y[whole]):
        assert np.unique(np.round(values, 9)).size == values.size


@backends
@pytest.mark.parametrize("lens", [ROUND, PENTAGON], ids=["round", "pentagon"])
@pytest.mark.parametrize("radius", [8.0, -6.0])
def test_share_that_sees_past_an_edge(radius: float, lens: Lens, backend: Any) -> None:
    """A surface beside the straight edge of a nearer one, by the share of the aperture beyond the edge."""
    columns, edge, near = 64, 32, -9.0
    row = np.where(np.arange(columns) < edge, near, radius).astype(np.float32)
    radii = np.broadcast_to(row, (1, 48, columns)).copy()
    color = np.ones((1, 48, columns, 4), dtype=np.float32)
    fragments = fragments_of(color, depth_of(radii).astype(np.float32), radii, 1.0, mixed=False)
    bright = brightness_of_lights(fragments.color[0])
    seen = decide(fragments, aperture_cells(lens, 1.0), brightest=bright, compiled=backend == "numba")
    points = aperture_points(lens, spread_evenly(20000, 2))[:, 0]
    off = []
    for column in range(edge, edge + 16):
        # The near edge is seen at edge + near a, the sample at column + 1/2 + radius a.
        visible = column + 0.5 + radius * points > edge + near * points
        off.append(float(seen.share[0, 24, column] - visible.mean()))
    # Both are drawn to pixels, half a pixel off each. A radius in the middle is 2 / pi of a disc, and 0.8 of
    # a pentagon.
    rounded = 0.8 / abs(radius - near)
    assert np.abs(off).max() < 2.0 / 64.0 + rounded
    assert abs(np.mean(off)) < 2.0 / 64.0
    assert (seen.share[0, :, :edge] == 1.0).all()


# Masks

ALL = 2**CELLS - 1
"""A row of cells that let all light through."""


def mask_work(lens: Lens, kind: str, position: SamplePosition, circle: float) -> tuple[Scatter, Masks]:
    """Return one white sample on its way to black pixels, and masks that let all through."""
    film = Film(64 * PITCH, 48 * PITCH, 64, 48)
    if kind == "lommel":
        lens = replace(lens, f_stop=16.0)
    builder = PsfBuilder(lens, film, settings=PsfSettings(kind=kind), position=position)  # type: ignore[arg-type]
    circles = np.array([circle * PITCH, 0.0])
    shape = (2, 48, 64)
    weight, table = np.zeros(shape, dtype=np.float32), np.ones(shape, dtype=np.int32)
    weight[0, 23, 30], table[0] = 1.0, 0
    weight[1] = 1.0
    color = np.zeros((*shape, 4), dtype=np.float32)
    color[0] = 1.0
    work = Scatter(
        color=color,
        weight=weight,
        assignment=TableAssignment(circles, table, None),
        tables=builder.pack(list(builder.tables(circles))),
        origin=(0, 0),
        shape=(48, 64),
    )
    radius = 0.5 * abs(circle)
    # Of the exact ones, whose sums stay as they are.
    masks = Masks(
        number=-table,
        group=np.full(shape, WHOLE_LIGHT, dtype=np.uint8),
        cells=np.full((1, CELLS), ALL, dtype=np.uint16),
        cuts=cuts_between_cells(np.array([radius / lens.anamorphic_ratio, 0.0]), work.tables.mirror),
        radius_y=np.array([radius, 0.0]),
        sharp=np.zeros(work.shape, dtype=np.bool_),
    )
    return work, masks


def reached_by(work: Scatter, backend: Any) -> Array:
    """Return the weights of the pixels: white light over black samples, in focus, whose weights are 1."""
    picture = np.zeros((*work.shape, 4), dtype=np.float32)
    list(scatter(work, picture, backend=backend))
    white = picture[..., 0].astype(np.float64)
    return white / (1.0 - white)


KINDS = {"disc": ROUND, "polygon": PENTAGON, "narrow": ANAMORPHIC, "lommel": ROUND}


@backends
@pytest.mark.parametrize("position", SAMPLE_POSITIONS)
@pytest.mark.parametrize("circle", [-17.0, 7.3])
@pytest.mark.parametrize("kind", KINDS)
def test_masks_cut_and_lose_nothing(kind: str, circle: float, position: SamplePosition, backend: Any) -> None:
    """What a mask lets through and what its opposite does are the whole, and each is a part of it."""
    work, masks = mask_work(KINDS[kind], "lommel" if kind == "lommel" else "disc", position, circle)
    whole = reached_by(work, backend)
    assert whole.sum() == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(reached_by(replace(work, masks=masks), backend), whole, atol=1e-7)
    rng = np.random.default_rng(2)
    for _ in range(4):
        cells = rng.integers(0, ALL + 1, (1, CELLS)).astype(np.uint16)
        parts = [reached_by(replace(work, masks=masks._replace(cells=c)), backend) for c in (cells, ~cells)]
        np.testing.assert_allclose(parts[0] + parts[1], whole, atol=1e-7)
        assert min(part.min() for part in parts) > -1e-7
        # A pixel belongs to one cell.
        assert (np.minimum(*parts) < 1e-7).all()


@backends
@pytest.mark.parametrize("kind", ["disc", "narrow"])
@pytest.mark.parametrize("part", [(0.05, 0.4), (0.4, 0.05), (0.3, 0.7), (0.95, 0.5), (0.5, 0.95), (0.7, 0.3)])
def test_mask_of_one_cell_lights_that_cell(part: tuple[float, float], kind: str, backend: Any) -> None:
    column, row = (int(share * CELLS) for share in part)
    work, masks = mask_work(KINDS[kind], "disc", "center", 42.0)
    cells = np.zeros((1, CELLS), dtype=np.uint16)
    cells[0, row] = 1 << column
    light = reached_by(replace(work, masks=masks._replace(cells=cells)), backend)
    y, x = np.nonzero(light > 1e-9)
    radius_y = float(masks.radius_y[0])
    radius_x = radius_y / KINDS[kind].anamorphic_ratio
    # Pixel 30 has its middle at 0. A cell is rounded to pixels, and a rim's pixel reaches out by one.
    for place, middle, radius, number in ((x, 30, radius_x, column), (y, 23, radius_y, row)):
        low, high = (2.0 * number / CELLS - 1.0) * radius, (2.0 * (number + 1) / CELLS - 1.0) * radius
        assert place.min() - middle >= low - 1.0
        assert place.max() - middle <= high + 1.0
    area = aperture_cells(KINDS[kind], 1.0).area[row, column]
    assert light.sum() == pytest.approx(area, abs=0.25 * area + 2e-3)


def test_blocks_of_wide_pictures_are_found_without_numba() -> None:
    side = np.zeros((1, 2, 300), dtype=np.uint8)
    side[0, 0, 254], side[0, 0, 298] = 2, 2
    some = np.zeros(side.shape, dtype=np.bool_)
    some[0, 1, 255], some[0, 1, 299] = True, True
    found = np.zeros_like(some)
    getattr(visibility._find_blocks, "py_func", visibility._find_blocks)(some, side, found)
    assert np.argwhere(found).tolist() == [[0, 0, 254], [0, 0, 298]]


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (2, 3), (40, 31)])
@pytest.mark.parametrize("strips", [1, 2, 5])
def test_cones_fall_alike_however_rows_are_divided(shape: tuple[int, int], strips: int) -> None:
    rng = np.random.default_rng(5)
    peaks = np.where(rng.random((2, *shape)) < 0.05, rng.integers(0, 20, (2, *shape)), -15).astype(np.float32)
    peaks[1, 0, 0] = np.inf
    y, x = np.mgrid[: shape[0], : shape[1]].reshape(2, -1, 1, 1)
    away = np.maximum(abs(y - np.arange(shape[0])[:, np.newaxis]), abs(x - np.arange(shape[1])))
    expected = (peaks[:, np.newaxis] - away).max(axis=(2, 3)).reshape(peaks.shape)
    for step in (1, -1):
        visibility._fall_in_strips(peaks, min(strips, shape[0]), step)
    np.testing.assert_array_equal(peaks, expected)
