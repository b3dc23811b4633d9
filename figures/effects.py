"""Charts of the special effects: lights over the field and through the focus, cards, ramps, a moving ball."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from potmesil_addon import png
from potmesil_addon.camera import Film
from potmesil_addon.effects import (
    ChromaticAberration,
    Diffraction,
    Distortion,
    Effects,
    Exposure,
    FilmGrain,
    FocalSurface,
    ImageFilter,
    Pupil,
    SensorNoise,
    StarFilter,
    Vignetting,
)
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window
from potmesil_addon.shutter import Flash, ShutterAttributes, Slit, rotary_slit

from .sheet import displayed, write_sheet
from .workshop import Drawing, Figure, Workshop

Picture = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]

COLUMNS: Final = 480
ROWS: Final = 270
FOCAL_LENGTH: Final = 0.05
FOCUS: Final = 0.5
FILM_WIDTH: Final = 0.036
_PITCH: Final = FILM_WIDTH / COLUMNS
_STRIP: Final = 74
_CIRCLES: Final = (-45, -30, -15, 0, 15, 30, 45)
"""Diameters of circles of confusion in pixels, near ones negative, at f/1.4."""


def film_of(columns: int, rows: int) -> Film:
    """Return a part of a film 36 mm wide."""
    return Film(columns * _PITCH, rows * _PITCH, columns, rows)


def samples_of(color: Picture, depth: Any, margin: int = 0, **others: Any) -> Samples:
    """Return samples of a lens of 50 mm at f/1.4, focused at half a metre, known past the picture."""
    rows, columns = color.shape[0] - 2 * margin, color.shape[1] - 2 * margin
    depths = np.broadcast_to(np.asarray(depth, dtype=np.float32), color.shape[:2]).copy()
    return Samples(
        (SampleLayer("", color, depths),),
        Window(-margin, -margin, columns + margin, rows + margin),
        Window(0, 0, columns, rows),
        film=film_of(columns, rows),
        lens=LensAttributes(FOCAL_LENGTH, 1.4, FOCUS),
        shutter=ShutterAttributes(exposure_time=1.0 / 48.0, frames_per_second=24.0),
        **others,
    )


def grey(rows: int, columns: int, value: float = 0.02) -> Picture:
    """Return an even opaque picture."""
    color = np.full((rows, columns, 4), value, dtype=np.float32)
    color[..., 3] = 1.0
    return color


def field(light: float = 1500.0) -> Samples:
    """Return a grid of lights far behind the focus."""
    color = grey(ROWS, COLUMNS)
    color[27::54, 24::48, :3] = light
    return samples_of(color, 8.0)


def through() -> Samples:
    """Return a row of lights from before the focus, on the left, to behind it."""
    color = grey(_STRIP, COLUMNS)
    depth = np.full((_STRIP, COLUMNS), 9.0)
    vergence = FOCAL_LENGTH**2 / 1.4
    for n, circle in enumerate(_CIRCLES):
        x = 40 + n * 66
        color[_STRIP // 2, x, :3] = 900.0
        # All around it is as far, so that nothing hides its disc.
        depth[:, 0 if n == 0 else x - 33 : x + 33] = 1.0 / (1.0 / FOCUS - circle * _PITCH / vergence)
    return samples_of(color, depth)


def ground() -> Samples:
    """Return a tiled ground one metre below a level camera, with lights above it."""
    x = (np.arange(COLUMNS) + 0.5 - COLUMNS / 2) * _PITCH
    y = (np.arange(ROWS) + 0.5 - ROWS / 2)[:, np.newaxis] * _PITCH
    with np.errstate(divide="ignore"):
        depth = np.where(y > 0.0, FOCAL_LENGTH / np.maximum(y, 1e-9), np.inf)
    reachable = np.where(np.isfinite(depth) & (depth < 400.0), depth, 400.0)
    tiles = (np.floor(4.0 * x * reachable / FOCAL_LENGTH) + np.floor(2.0 * reachable)) % 2
    color = grey(ROWS, COLUMNS, 0.1)
    below = np.broadcast_to(y > 0.0, tiles.shape)
    color[below, :3] = np.where(tiles[below, np.newaxis] > 0.5, 0.6, 0.05)
    color[20:120:30, 30::60, :3] = 200.0
    return samples_of(color, np.where(depth < 400.0, depth, np.inf))


def checks(margin: int = 90) -> Samples:
    """Return a board of squares in focus, known past the picture."""
    rows, columns = ROWS + 2 * margin, COLUMNS + 2 * margin
    color = grey(rows, columns, 0.7)
    j, i = np.indices((rows, columns))
    dark = ((j - margin - 15) // 30 + (i - margin) // 30) % 2 == 0
    color[dark, :3] = 0.08
    return samples_of(color, FOCUS, margin)


def sparks(light: float = 4e4) -> Samples:
    """Return small lights in focus, each ten times as bright as the one before."""
    color = grey(ROWS, COLUMNS, 0.003)
    for n in range(3):
        color[60 + 75 * n, 80 + 160 * n, :3] = light / 10.0 ** (2 - n)
        color[60 + 75 * n, (80 + 160 * (n + 1)) % COLUMNS, :3] = np.array([1.0, 0.3, 0.1]) * light / 10.0
    return samples_of(color, FOCUS)


def ramp(rows: int = 90) -> Samples:
    """Return a grey ramp from black to white."""
    color = grey(rows, COLUMNS)
    color[..., :3] = (np.linspace(0.0, 1.0, COLUMNS) ** 2.2)[:, np.newaxis]
    return samples_of(color, FOCUS)


def ball(speed: float = 150.0) -> Samples:
    """Return a ball that crosses the picture by so many pixels a frame."""
    color = grey(90, COLUMNS, 0.05)
    j, i = np.indices((90, COLUMNS))
    inside = np.hypot(i + 0.5 - COLUMNS / 2, j + 0.5 - 45) < 22
    color[:, ::40, :3] = 0.15
    color[inside, :3] = (0.9, 0.45, 0.1)
    color[inside & (i < COLUMNS / 2), :3] = (0.1, 0.35, 0.8)
    vector = np.zeros((90, COLUMNS, 4), dtype=np.float32)
    # To where it was, and from where it will be, as Blender has it.
    vector[inside, 0], vector[inside, 2] = -speed, -speed
    made = samples_of(color, np.where(inside, 0.45, FOCUS))
    return replace(made, layers=(replace(made.layers[0], vector=vector),))


def taken(samples: Samples, effects: Effects, *, exposure: float = 0.0, **others: Any) -> Bytes:
    """Return what a lens makes of samples, to look at."""
    lens = LensAttributes(**others.pop("lens", {}))
    settings = ProcessSettings(**({"use_motion": False} | others), lens=lens, effects=effects)
    return displayed(run(process(samples, settings)).picture, exposure=exposure)


def _drawing(
    workshop: Workshop,
    name: str,
    pictures: Sequence[tuple[str, Bytes]],
    columns: int,
    effects: Sequence[Effects],
    **options: Any,
) -> Drawing:
    path = write_sheet(workshop.folder / f"{name}.png", pictures, columns, **options)
    said = [
        {key: value for key, value in asdict(each).items() if value is not None and key != "image"}
        for each in effects
    ]
    return Drawing(path, {"effects": said, "pictures": [caption for caption, _ in pictures]})


def _chart(
    workshop: Workshop,
    name: str,
    samples: Samples,
    kinds: Sequence[tuple[str, Effects, dict[str, Any]]],
    columns: int,
    exposure: float = 0.0,
) -> Drawing:
    pictures = [
        (caption, taken(samples, on, **({"exposure": exposure} | others))) for caption, on, others in kinds
    ]
    return _drawing(workshop, name, pictures, columns, [on for _, on, _ in kinds])


def _drawn_heart(workshop: Workshop) -> Path:
    """Draw a heart, as it might be cut from black paper and held before a lens."""
    y, x = np.mgrid[1.3:-1.3:256j, -1.3:1.3:256j]
    inside = (x * x + y * y - 0.8) ** 3 - 1.6 * x * x * y**3 < 0.0
    picture = grey(256, 256, 0.0)
    picture[inside, :3] = 1.0
    path = workshop.folder / "heart.png"
    png.write_png(path, picture)
    return path


def _draw_pupil(workshop: Workshop) -> Drawing:
    """Draw pupils, through the focus."""
    heart = str(_drawn_heart(workshop))
    six = {"lens": {"blades": 6, "blade_rotation": 0.3}}
    kinds = [
        ("Near (left) to far (right): six straight blades", Effects(), six),
        ("Blade curvature 0.5", Effects(pupil=Pupil(blade_curvature=0.5)), six),
        ("Anamorphic ratio 2", Effects(), {"lens": {"anamorphic_ratio": 2.0}}),
        ("Obstruction 0.45", Effects(pupil=Pupil(obstruction=0.45)), {}),
        ("Apodisation 3", Effects(pupil=Pupil(apodisation=3.0)), {}),
        (
            "Spherical aberration -4 mm: soft behind the focus",
            Effects(pupil=Pupil(spherical_aberration=-4e-3)),
            {},
        ),
        (
            "Spherical aberration 4 mm: rims behind the focus",
            Effects(pupil=Pupil(spherical_aberration=4e-3)),
            {},
        ),
        ("A picture as the aperture", Effects(pupil=Pupil(image=heart)), {}),
    ]
    return _chart(workshop, "effect_pupil", through(), kinds, 2)


def _draw_focal_surface(workshop: Workshop) -> Drawing:
    """Draw a tilted plane in focus and a curved field."""
    far = {"lens": {"focus_distance": math.inf, "f_stop": 1.0}}
    # Scheimpflug: the hinge one focal length over the sine below the lens, where the ground is.
    tilt = -math.asin(FOCAL_LENGTH / 1.0)
    plane = FocalSurface(tilt=tilt)
    kinds = [
        ("Level ground, f/1, focused at infinity", Effects(), far),
        (f"Lens tilted by {math.degrees(tilt):.1f} degrees", Effects(focal_surface=plane), far),
        ("Tilted up by 8 degrees, focused at 3 m", Effects(focal_surface=FocalSurface(tilt=0.14)),
         {"lens": {"focus_distance": 3.0}}),
    ]  # fmt: skip
    pictures = [(caption, taken(ground(), on, **others)) for caption, on, others in kinds]
    curved = Effects(focal_surface=FocalSurface(curvature=15.0))
    pictures.append(
        ("Curvature 15 / m: lights behind the focus", taken(field(), curved, lens={"f_stop": 4.0}))
    )
    return _drawing(workshop, "effect_focal_surface", pictures, 2, [*(on for _, on, _ in kinds), curved])


def _draw_chromatic(workshop: Workshop) -> Drawing:
    """Draw colours that focus elsewhere, and at other sizes."""
    focus = ChromaticAberration(focus_red=0.3e-3, focus_blue=-0.3e-3)
    size = ChromaticAberration(size_red=0.012, size_blue=-0.012)
    strips = [
        ("Near to far, all colours alike", taken(through(), Effects())),
        ("Red focuses 0.3 mm behind green, blue before", taken(through(), Effects(chromatic=focus))),
    ]
    boards = [
        ("No lateral colour (a corner, enlarged)", taken(checks(), Effects())),
        ("Red 1.2 % larger, blue smaller", taken(checks(), Effects(chromatic=size))),
    ]
    part = np.s_[: _STRIP // 2, : COLUMNS // 2]
    pictures = [*strips, *((c, np.repeat(np.repeat(board[part], 2, 0), 2, 1)) for c, board in boards)]
    return _drawing(
        workshop, "effect_chromatic", pictures, 2, [Effects(chromatic=focus), Effects(chromatic=size)]
    )


def _draw_vignetting(workshop: Workshop) -> Drawing:
    """Draw cat's eyes and dark corners."""
    barrel = Vignetting(natural=1.0, mechanical=0.45, fastest_f_stop=2.0)
    wide, card = {"lens": {"f_stop": 2.0}}, samples_of(grey(ROWS, COLUMNS, 0.5), FOCUS)
    kinds = [
        ("f/2", Effects(), wide),
        ("Mechanical 0.45 at f/2", Effects(vignetting=barrel), wide),
        ("Stopped down to f/2.8", Effects(vignetting=barrel), {"lens": {"f_stop": 2.8}}),
    ]
    pictures = [(caption, taken(field(), on, **others)) for caption, on, others in kinds]
    pictures.append(("A grey card at f/2", taken(card, Effects(vignetting=barrel), **wide)))
    return _drawing(workshop, "effect_vignetting", pictures, 2, [on for _, on, _ in kinds])


def _draw_distortion(workshop: Workshop) -> Drawing:
    """Draw a board through lenses that bend it."""
    kinds = [
        ("No distortion", Effects(), {}),
        ("Brown, k1 = -0.8: barrel", Effects(distortion=Distortion(k1=-0.8)), {}),
        ("Brown, k1 = 0.8: pincushion", Effects(distortion=Distortion(k1=0.8)), {}),
        ("Brown, p1 = 0.15: tangential", Effects(distortion=Distortion(p1=0.15)), {}),
        ("Division, k1 = 0.6", Effects(distortion=Distortion(model="division", k1=0.6)), {}),
        ("Nuke, k1 = -0.15", Effects(distortion=Distortion(model="nuke", k1=-0.15)), {}),
    ]
    return _chart(workshop, "effect_distortion", checks(), kinds, 2)


def _draw_diffraction(workshop: Workshop) -> Drawing:
    """Draw stars of irises."""
    kinds: list[tuple[str, Effects, dict[str, Any]]] = []
    for f_stop, blades in ((4, 6), (11, 6), (22, 6), (22, 5), (22, 7), (22, 8), (22, 0)):
        shape = f"{blades} blades" if blades else "round"
        lens = {"f_stop": float(f_stop), "blades": blades, "blade_rotation": 0.2}
        kinds.append((f"f/{f_stop}, {shape}", Effects(diffraction=Diffraction()), {"lens": lens}))
    bent = Effects(diffraction=Diffraction(), pupil=Pupil(blade_curvature=0.3))
    kinds.append(("f/22, 6 blades, curvature 0.3", bent, {"lens": {"f_stop": 22.0, "blades": 6}}))
    return _chart(workshop, "effect_diffraction", sparks(4e6), kinds, 2)


def _draw_star(workshop: Workshop) -> Drawing:
    """Draw star filters."""
    kinds = [
        ("2 directions: 4 points", Effects(star=StarFilter()), {}),
        (
            "4 directions, turned by 15 degrees",
            Effects(star=StarFilter(lines=4, rotation=math.radians(15.0))),
            {},
        ),
        ("1 direction, half of the light", Effects(star=StarFilter(lines=1, strength=0.5)), {}),
        (
            "Grooves of 60 um: short streaks, in colours",
            Effects(star=StarFilter(lines=2, groove_width=60e-6)),
            {},
        ),
    ]
    return _chart(workshop, "effect_star", sparks(), kinds, 2)


def _draw_image_filter(workshop: Workshop) -> Drawing:
    """Draw a glare from a picture."""
    heart = str(_drawn_heart(workshop))
    on = Effects(image_filter=ImageFilter(heart, strength=0.5, size=0.15, rotation=math.radians(20.0)))
    return _chart(
        workshop, "effect_image_filter", sparks(), [("Without", Effects(), {}), ("A heart", on, {})], 2
    )


def _draw_exposure(workshop: Workshop) -> Drawing:
    """Draw a ramp in other exposures."""
    normal = math.log2(1.4**2 * 48.0)
    kinds = [
        ("As it is", Effects(), {}),
        ("ISO 400: two stops", Effects(exposure=Exposure(400.0, normal)), {}),
        ("f/2.8: two stops less", Effects(exposure=Exposure(100.0, normal)), {"lens": {"f_stop": 2.8}}),
        ("A warm filter", Effects(exposure=Exposure(100.0, normal, tint=(1.0, 0.75, 0.45))), {}),
    ]
    return _chart(workshop, "effect_exposure", ramp(), kinds, 2)


def _draw_grain(workshop: Workshop) -> Drawing:
    """Draw grain, enlarged."""
    pictures, effects = [], []
    # A part of 35 mm cine film, so that grains are pixels large.
    part = replace(ramp(), film=Film(COLUMNS * 6e-6, 90 * 6e-6, COLUMNS, 90))
    for granularity, size, color in (
        (5.0, 10e-6, 0.5),
        (15.0, 10e-6, 0.5),
        (15.0, 30e-6, 0.5),
        (15.0, 30e-6, 0.0),
    ):
        on = Effects(grain=FilmGrain(granularity, size, color))
        caption = f"RMS granularity {granularity:g}, {size * 1e6:g} um, colour {color:g}"
        pictures.append((caption, taken(part, on, use_lens=False)))
        effects.append(on)
    return _drawing(workshop, "effect_grain", pictures, 2, effects)


def _draw_noise(workshop: Workshop) -> Drawing:
    """Draw noise at film speeds."""
    pictures, effects = [], []
    for sensitivity in (100.0, 3200.0, 25_600.0):
        # Brightened by its film speed, darkened by as much less light.
        stops = math.log2(sensitivity / 100.0)
        on = Effects(
            exposure=Exposure(sensitivity, math.log2(1.4**2 * 48.0), density=stops),
            noise=SensorNoise(full_well=30_000.0, read_noise=4.0),
        )
        pictures.append((f"ISO {sensitivity:g}", taken(ramp(), on)))
        effects.append(on)
    return _drawing(workshop, "effect_noise", pictures, 1, effects)


def _draw_shutters(workshop: Workshop) -> Drawing:
    """Draw a ball that moves to the right, through each shutter."""
    frames, slit = rotary_slit(0.5, math.radians(120.0))
    shutters = {
        "180 degrees, all of the film at once": ShutterAttributes(frames=0.5),
        "Rotary disc of 180 degrees, gate of 120": ShutterAttributes(frames=frames, slit=slit),
        "Rolling shutter, from the top": ShutterAttributes(frames=0.5, slit=Slit("top", 0.05)),
        "Focal plane, slit of 0.2 from the left": ShutterAttributes(frames=0.5, slit=Slit("left", 0.2)),
        "Between the lens, blades 0.4": ShutterAttributes(frames=0.5, blade_time=0.4),
        "Flash with the first curtain": ShutterAttributes(frames=0.8, flash=Flash("first", 0.5)),
        "Flash with the second curtain": ShutterAttributes(frames=0.8, flash=Flash("second", 0.5)),
        "Strobe of 5, little ambient light": ShutterAttributes(
            frames=1.0, flash=Flash("first", 0.95, 0.002, 5)
        ),
    }
    moving = ball()
    pictures = [
        (caption, taken(moving, Effects(), use_lens=False, use_motion=True, shutter=shutter))
        for caption, shutter in shutters.items()
    ]
    path = write_sheet(workshop.folder / "effect_shutters.png", pictures, 2)
    return Drawing(path, {"shutters": {caption: asdict(shutter) for caption, shutter in shutters.items()}})


FIGURES: tuple[Figure, ...] = (
    Figure("effect_pupil", "Aperture shapes", _draw_pupil),
    Figure("effect_focal_surface", "Tilt and field curvature", _draw_focal_surface),
    Figure("effect_chromatic", "Chromatic aberration", _draw_chromatic),
    Figure("effect_vignetting", "Vignetting", _draw_vignetting),
    Figure("effect_distortion", "Distortion", _draw_distortion),
    Figure("effect_diffraction", "Diffraction of the aperture", _draw_diffraction),
    Figure("effect_star", "Star filters", _draw_star),
    Figure("effect_image_filter", "Filter from a picture", _draw_image_filter),
    Figure("effect_exposure", "Exposure", _draw_exposure),
    Figure("effect_grain", "Film grain", _draw_grain),
    Figure("effect_noise", "Sensor noise", _draw_noise),
    Figure("effect_shutters", "Shutters", _draw_shutters),
)
