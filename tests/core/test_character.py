"""What a lens does from place to place: tilted planes, curved fields, vignetting, cut discs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from potmesil_addon.camera import Camera, Film
from potmesil_addon.character import LensCharacter, axis_of, character_of
from potmesil_addon.effects import ChromaticAberration, Effects, FocalSurface, Pupil, Vignetting
from potmesil_addon.errors import SettingsError
from potmesil_addon.focus import FocusSettings
from potmesil_addon.lens import Lens
from potmesil_addon.psf import PsfSettings
from potmesil_addon.samples import Samples, Window
from potmesil_addon.visibility import Visibility

from .helpers import Array, focused, make_samples

FOCAL_LENGTH = 0.05
PITCH = 2e-4
ROWS, COLUMNS = 90, 120


def lens(**others: float) -> Lens:
    return Lens(**({"focal_length": FOCAL_LENGTH, "f_stop": 1.4, "focus_distance": 2.0} | others))  # type: ignore[arg-type]


def film() -> Film:
    return Film(COLUMNS * PITCH, ROWS * PITCH, COLUMNS, ROWS)


def scene(depth: Array | float, light: float = 0.0) -> Samples:
    """Return noise, or dark with lights every 30 pixels, at a depth."""
    color = np.ones((ROWS, COLUMNS, 4))
    if light:
        color[..., :3] = 0.0
        color[15::30, 15::30, :3] = light
    else:
        color[..., :3] = np.random.default_rng(1).random((ROWS, COLUMNS, 3))
    return make_samples(color, depth)


def settings(effects: Effects, samples: Samples, **others: object) -> FocusSettings:
    character = character_of(effects, film(), axis_of(samples), samples.display_window)
    values = {"lens": lens(), "film": film(), "visibility": "aperture", "character": character} | others
    return FocusSettings(**values)  # type: ignore[arg-type]


def on_film() -> tuple[Array, Array]:
    x = (np.arange(COLUMNS) + 0.5 - COLUMNS / 2) * PITCH
    y = -(np.arange(ROWS) + 0.5 - ROWS / 2) * PITCH
    return x, y[:, np.newaxis]


@pytest.mark.parametrize("visibility", ["none", "aperture"])
@pytest.mark.parametrize(("tilt", "swing"), [(4.0, 0.0), (-2.0, 1.5), (0.0, -3.0)])
def test_a_tilted_lens_is_sharp_on_scheimpflugs_plane(
    visibility: Visibility, tilt: float, swing: float
) -> None:
    """The plane passes through the point in focus on the axis and the hinge line in the lens's plane."""
    x, y = on_film()
    a, b = math.sin(math.radians(tilt)), math.sin(math.radians(swing))
    # World points (X, Y, Z) of the plane Z / D + Y a / F + X b / F = 1 are seen at x = F X / Z, y = F Y / Z.
    hinge = FOCAL_LENGTH / a if a else math.inf
    depth = np.full((ROWS, COLUMNS), np.nan)
    for j, i in np.ndindex(ROWS, COLUMNS):
        direction = np.array([x[i] / FOCAL_LENGTH, y[j, 0] / FOCAL_LENGTH, 1.0])
        normal = np.array([b / FOCAL_LENGTH, 1.0 / hinge, 1.0 / 2.0])
        depth[j, i] = 1.0 / (normal @ direction)
    assert (depth > 0.0).all()
    samples = scene(depth)
    effects = Effects(focal_surface=FocalSurface(math.radians(tilt), math.radians(swing)))
    sharp = focused(samples, settings(effects, samples, visibility=visibility))
    assert np.abs(sharp - samples.layers[0].color).max() < 2e-3
    plain = focused(samples, settings(Effects(), samples, visibility=visibility))
    assert np.abs(plain - samples.layers[0].color).max() > 0.2


def test_a_curved_field_is_sharp_on_a_bowl() -> None:
    x, y = on_film()
    curvature = 1.0 / 0.08
    # The film is r^2 K / 2 behind the image surface, where nearer points are imaged: 1/F = 1/D + 1/V.
    distance_on_axis = 1.0 / (1.0 / FOCAL_LENGTH - 1.0 / 2.0)
    image = distance_on_axis + 0.5 * curvature * (x * x + y * y)
    depth = 1.0 / (1.0 / FOCAL_LENGTH - 1.0 / image)
    samples = scene(depth)
    effects = Effects(focal_surface=FocalSurface(curvature=curvature))
    # To first order in the sag over the image distance, which the magnification of 2.5 % changes.
    sharp = focused(samples, settings(effects, samples))
    plain = focused(samples, settings(Effects(), samples))
    color = samples.layers[0].color
    assert np.abs(sharp - color)[..., :3].mean() < 0.1 * np.abs(plain - color)[..., :3].mean()


def test_beyond_infinity_circles_go_on_growing() -> None:
    """A lens that is sharp at infinity on the axis is, tilted, past it on one side."""
    samples = scene(math.inf, light=1.0)
    effects = Effects(focal_surface=FocalSurface(tilt=math.radians(3.0)))
    at_infinity = settings(effects, samples, lens=lens(focus_distance=math.inf, f_stop=0.2))
    picture = focused(samples, at_infinity)[..., 1]
    assert np.isfinite(picture).all()
    # Lights about as far above and below the axis are as large, one with an image upright and one on its head.
    assert picture[:30].max() == pytest.approx(picture[-30:].max(), rel=0.08)
    assert picture[:30].max() < 0.2 * picture[30:60].max()


def test_equal_steps_of_depth_know_one_focus_only() -> None:
    samples = scene(3.0)
    effects = Effects(focal_surface=FocalSurface(tilt=0.1))
    with pytest.raises(SettingsError, match="equal steps"):
        focused(samples, settings(effects, samples, psf=PsfSettings(tables="equal-z")))


NEUTRAL = [
    Effects(),
    Effects(pupil=Pupil()),
    Effects(focal_surface=FocalSurface()),
    Effects(chromatic=ChromaticAberration()),
    Effects(vignetting=Vignetting(mechanical=0.0)),
]


@pytest.mark.parametrize("effects", NEUTRAL, ids=lambda effects: str(effects)[8:40])
@pytest.mark.parametrize("blades", [0, 5])
def test_off_or_neutral_the_picture_is_the_same_to_the_last_bit(effects: Effects, blades: int) -> None:
    depth = np.where(np.arange(COLUMNS) < 60, 1.2, 4.0) + np.zeros((ROWS, 1))
    samples = scene(depth)
    its = lens(blades=blades)
    known = focused(samples, FocusSettings(its, film(), visibility="aperture"))
    assert np.array_equal(known, focused(samples, settings(effects, samples, lens=its)))


@pytest.mark.parametrize("visibility", ["none", "aperture"])
def test_the_barrel_cuts_discs_towards_the_corners(visibility: Visibility) -> None:
    samples, fast = scene(8.0, light=1.0), lens(f_stop=0.3)
    effects = Effects(vignetting=Vignetting(mechanical=0.4))
    plain, cut = (
        focused(samples, settings(on, samples, visibility=visibility, lens=fast))[..., 1]
        for on in (Effects(), effects)
    )
    even = focused(scene(8.0, light=0.0), settings(effects, samples, visibility=visibility, lens=fast))
    assert even[..., 3] == pytest.approx(1.0, abs=1e-5)
    # What the barrel takes away is a matter of vignetting: every light keeps its light, but for what eq. 22
    # divides by. The middles of cut discs move by up to 0.4 radii, 3 pixels, over 75 of the field, and
    # twice as much of that is density: 8 %.
    for j in range(0, ROWS, 30):
        for i in range(0, COLUMNS, 30):
            part = np.s_[j : j + 30, i : i + 30]
            assert cut[part].sum() == pytest.approx(plain[part].sum(), rel=0.09)
    # The corner's disc is narrower along the way out and as long across it.
    at = np.arange(30) - 15.0
    along, across = at - at[:, np.newaxis], at + at[:, np.newaxis]
    corner = np.s_[0:30, 90:120]

    def spread(picture: Array, way: Array) -> float:
        light = picture[corner] / picture[corner].sum()
        return float((light * way**2).sum() - (light * way).sum() ** 2)

    narrow, long = ([spread(p, way) for p in (plain, cut)] for way in (along, across))
    assert narrow[1] < 0.6 * narrow[0]
    assert long[1] > 0.8 * long[0]
    # It is the upper right side that is missing.
    assert (cut[corner] * along).sum() < -1.0 * cut[corner].sum()


def test_cut_discs_are_not_to_be_interpolated() -> None:
    samples = scene(8.0)
    effects = Effects(vignetting=Vignetting(mechanical=0.4))
    with pytest.raises(SettingsError, match="interpolated"):
        focused(samples, settings(effects, samples, psf=PsfSettings(lookup="interpolated")))


def test_colours_focus_at_their_own_distances() -> None:
    """A light behind the focus by so much that red, whose focus lies behind green's, is the sharper one."""
    samples = scene(4.0, light=1.0)
    effects = Effects(chromatic=ChromaticAberration(focus_red=0.3e-3, focus_blue=-0.3e-3))
    picture = focused(samples, settings(effects, samples, lens=lens(f_stop=0.5)))
    at = np.hypot(np.arange(30) - 15, np.arange(30)[:, np.newaxis] - 15)
    part = picture[30:60, 30:60]
    spread = [(part[..., n] * at**2).sum() / part[..., n].sum() for n in range(3)]
    # Circles of c - focus / n and a second moment of c^2 / 8, beside that of pixels.
    circle = 0.5**-1 * FOCAL_LENGTH**2 * (1 / 2.0 - 1 / 4.0)
    for found, shift in zip(spread, (0.3e-3, 0.0, -0.3e-3), strict=True):
        wanted = ((circle - shift / 0.5) / PITCH) ** 2 / 8.0
        assert found == pytest.approx(wanted, abs=0.25)
    assert spread[0] < spread[1] < spread[2]


def test_light_falls_with_the_fourth_power_of_the_cosine() -> None:
    samples = scene(3.0)
    character = character_of(
        Effects(vignetting=Vignetting()), film(), axis_of(samples), samples.display_window
    )
    assert character is not None
    share = character.vignetted(lens(), film(), samples.display_window)
    x, y = on_film()
    angle = np.arctan(np.hypot(x, y) / FOCAL_LENGTH)
    assert share == pytest.approx(np.cos(angle) ** 4, abs=1e-6)
    half = replace(character, vignetting=Vignetting(natural=0.5)).vignetted(
        lens(), film(), samples.display_window
    )
    assert half == pytest.approx(0.5 + 0.5 * np.cos(angle) ** 4, abs=1e-6)


def test_the_barrel_takes_the_light_that_two_discs_have_not_in_common() -> None:
    samples = scene(3.0)
    vignetting = Vignetting(natural=0.0, mechanical=0.5)
    character = character_of(Effects(vignetting=vignetting), film(), axis_of(samples), samples.display_window)
    assert character is not None
    share = character.vignetted(lens(), film(), samples.display_window)
    x, y = on_film()
    # In the corner the discs, of radius 1, are as far apart as one of them is wide, times 0.5.
    distance = 2.0 * 0.5 * np.hypot(x, y) / math.hypot(COLUMNS / 2 * PITCH, ROWS / 2 * PITCH)
    wanted = (2 * np.arccos(distance / 2) - 0.5 * distance * np.sqrt(4 - distance**2)) / math.pi
    assert share == pytest.approx(wanted, abs=2e-3)


def test_the_axis_is_where_the_camera_has_it() -> None:
    camera = Camera(np.eye(4), FOCAL_LENGTH, film(), axis_x=20.0, axis_y=70.0)
    samples = replace(scene(3.0), camera=camera, display_window=Window(10, 5, 10 + COLUMNS, 5 + ROWS))
    assert axis_of(samples) == (30.0, 75.0)
    assert axis_of(replace(samples, camera=None)) == (10 + COLUMNS / 2, 5 + ROWS / 2)
    character = LensCharacter((30.0, 75.0), 1.0, vignetting=Vignetting())
    share = character.vignetted(lens(), film(), samples.display_window)
    assert np.unravel_index(np.argmax(share), share.shape) in [(69, 19), (70, 20), (69, 20), (70, 19)]
