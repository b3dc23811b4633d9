"""What a lens does from place to place: tilted planes, curved fields, vignetting, cut discs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from potmesil_addon.camera import Camera, Film
from potmesil_addon.character import LensCharacter, axis_of, character_of
from potmesil_addon.distortion import lens_map
from potmesil_addon.effects import ChromaticAberration, Distortion, Effects, FocalSurface, Pupil, Vignetting
from potmesil_addon.errors import SettingsError
from potmesil_addon.focus import FocusSettings
from potmesil_addon.lens import Lens
from potmesil_addon.paths import CameraPath, MotionPaths
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.psf import PsfSettings
from potmesil_addon.samples import LensAttributes, Samples, Window
from potmesil_addon.shutter import ShutterAttributes
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
    character = character_of(effects, FOCAL_LENGTH, film(), axis_of(samples), samples.display_window)
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
    # Lights about as far above and below the axis are as large, upright and on their heads.
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
    # What the barrel takes away is a matter of vignetting: every light keeps its light.
    for j in range(0, ROWS, 30):
        for i in range(0, COLUMNS, 30):
            part = np.s_[j : j + 30, i : i + 30]
            assert cut[part].sum() == pytest.approx(plain[part].sum(), rel=0.02)
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
        Effects(vignetting=Vignetting()), FOCAL_LENGTH, film(), axis_of(samples), samples.display_window
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
    character = character_of(
        Effects(vignetting=vignetting), FOCAL_LENGTH, film(), axis_of(samples), samples.display_window
    )
    assert character is not None
    share = character.vignetted(lens(), film(), samples.display_window)
    x, y = on_film()
    # In the corner the discs, of radius 1, are as far apart as one of them is wide, times 0.5.
    distance = 2.0 * 0.5 * np.hypot(x, y) / math.hypot(COLUMNS / 2 * PITCH, ROWS / 2 * PITCH)
    wanted = (2 * np.arccos(distance / 2) - 0.5 * distance * np.sqrt(4 - distance**2)) / math.pi
    assert share == pytest.approx(wanted, abs=2e-3)


BARREL = Distortion(k1=-1.0)


def bent_samples(margin: int, **others: object) -> Samples:
    """Return lights before the camera, known up to a margin around the picture."""
    rows, columns = ROWS + 2 * margin, COLUMNS + 2 * margin
    color = np.zeros((rows, columns, 4))
    color[..., 3] = 1.0
    for j, i in np.ndindex(3, 3):
        # A pixel filter's footprint, whose middle can be told between pixels.
        rows_of, columns_of = (slice(margin + 14 + n, -margin or None, 30) for n in (j, i))
        color[rows_of, columns_of, :3] = (1, 2, 1)[j] * (1, 2, 1)[i] / 4.0
    data = Window(-margin, -margin, COLUMNS + margin, ROWS + margin)
    lens_of = LensAttributes(FOCAL_LENGTH, 1.4, 2.0)
    return make_samples(
        color, 2.0, data=data, display=Window(0, 0, COLUMNS, ROWS), film=film(), lens=lens_of, **others
    )


def middle_of_light(picture: Array, around: tuple[float, float]) -> tuple[float, float]:
    x, y = (round(value) for value in around)
    part = picture[y - 6 : y + 7, x - 6 : x + 7, 1]
    at = np.arange(-6, 7) + 0.5
    return x + float((part * at).sum() / part.sum()), y + float((part.T * at).sum() / part.sum())


def still_card(samples: Samples) -> Samples:
    """Return samples with paths, in which nothing moves but far behind."""
    camera = Camera(np.eye(4), FOCAL_LENGTH, film(), COLUMNS / 2, ROWS / 2)
    turned = camera.matrix.copy()
    # A camera that is swung by so much that all moves 4 pixels to the right.
    turned[0] += 4.0 * turned[2]
    path = CameraPath(
        np.array([-1.0, 0.0, 1.0]), np.stack([turned, camera.matrix, 2 * camera.matrix - turned])
    )
    return replace(samples, camera=camera, paths=MotionPaths(path))


@pytest.mark.parametrize("use_lens", [False, True])
@pytest.mark.parametrize("use_motion", [False, True])
@pytest.mark.parametrize("margin", [0, 12])
def test_lights_land_where_the_distorting_lens_puts_them(
    use_lens: bool, use_motion: bool, margin: int
) -> None:
    samples = still_card(bent_samples(margin))
    wanted = ProcessSettings(
        use_lens=use_lens,
        use_motion=use_motion,
        shutter=ShutterAttributes(frames=0.5),
        effects=Effects(distortion=BARREL),
    )
    result = run(process(samples, wanted))
    assert result.picture.shape == (ROWS, COLUMNS, 4)
    known = lens_map(BARREL, None, FOCAL_LENGTH, film(), (COLUMNS / 2, ROWS / 2), samples.display_window)
    assert known is not None
    for y in range(15, ROWS, 30):
        for x in range(15, COLUMNS, 30):
            place = known.distort(np.array([x + 0.5, y + 0.5]))
            found = middle_of_light(result.picture, (float(place[0]) - 0.5, float(place[1]) - 0.5))
            assert found == pytest.approx(tuple(place.tolist()), abs=0.1)
    # A barrel shows more than the pinhole did: without a margin its border is carried on.
    assert result.picture[..., 3] == pytest.approx(1.0, abs=1e-4)
    # That is a guess, and said to be one.
    assert (result.guessed[0, 0] == 1.0) == (margin == 0)
    assert result.guessed[ROWS // 2, COLUMNS // 2] < 1.0


def test_discs_stay_round_where_the_picture_is_bent() -> None:
    """A warp of the finished picture would make them as oval as it makes squares."""
    samples = replace(bent_samples(20), lens=LensAttributes(FOCAL_LENGTH, 0.25, 4.0))
    strong = Effects(distortion=Distortion(k1=-3.5))
    picture = run(process(samples, ProcessSettings(effects=strong))).picture[..., 1]
    at = np.arange(26) - 12.5
    known = lens_map(strong.distortion, None, FOCAL_LENGTH, film(), (60.0, 45.0), samples.display_window)
    assert known is not None
    x, y = (round(v) for v in known.distort(np.array([15.5, 45.5])).tolist())
    part = picture[y - 13 : y + 13, x - 13 : x + 13]
    across, down = (
        (part.sum(axis=n) * (at - (part.sum(axis=n) * at).sum() / part.sum()) ** 2).sum() / part.sum()
        for n in (0, 1)
    )
    squeezed = known.distort(np.array([[16.5, 45.5], [14.5, 45.5], [15.5, 46.5], [15.5, 44.5]]))
    oval = (squeezed[0, 0] - squeezed[1, 0]) / (squeezed[2, 1] - squeezed[3, 1])
    assert oval < 0.8
    assert across / down == pytest.approx(1.0, abs=0.05)


def test_a_lens_that_bends_nothing_changes_no_bit() -> None:
    samples = bent_samples(5)
    plain = run(process(samples, ProcessSettings())).picture
    neutral = Effects(distortion=Distortion(), chromatic=ChromaticAberration())
    assert np.array_equal(plain, run(process(samples, ProcessSettings(effects=neutral))).picture)


def test_red_and_blue_are_larger_by_their_share() -> None:
    samples = bent_samples(5)
    fringes = Effects(chromatic=ChromaticAberration(size_red=0.02, size_blue=-0.02))
    picture = run(process(samples, ProcessSettings(effects=fringes))).picture
    for primary, share in ((0, 0.02), (1, 0.0), (2, -0.02)):
        part = picture[60:90, 90:120, primary]
        at = np.arange(30) + 0.5
        x = 90 + float((part.sum(axis=0) * at).sum() / part.sum())
        assert x - COLUMNS / 2 == pytest.approx((105.5 - COLUMNS / 2) * (1.0 + share), abs=0.1)


def test_the_axis_is_where_the_camera_has_it() -> None:
    camera = Camera(np.eye(4), FOCAL_LENGTH, film(), axis_x=20.0, axis_y=70.0)
    samples = replace(scene(3.0), camera=camera, display_window=Window(10, 5, 10 + COLUMNS, 5 + ROWS))
    assert axis_of(samples) == (30.0, 75.0)
    assert axis_of(replace(samples, camera=None)) == (10 + COLUMNS / 2, 5 + ROWS / 2)
    character = LensCharacter((30.0, 75.0), 1.0, vignetting=Vignetting())
    share = character.vignetted(lens(), film(), samples.display_window)
    assert np.unravel_index(np.argmax(share), share.shape) in [(69, 19), (70, 20), (69, 20), (70, 19)]
