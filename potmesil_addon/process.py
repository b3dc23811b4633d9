"""From a samples file to a picture: settings resolved, layers focused and laid over each other."""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final, TypeVar

import numpy as np

from . import jit
from .bands import check_picture
from .camera import Film
from .cascade import cascade
from .character import Bend, LensCharacter, axis_of, character_of
from .develop import Development, develop, is_developed
from .effects import KINDS, Effects
from .errors import SettingsError
from .focus import FocusReport, FocusSettings, Weighting, average_down, focus_layer, over
from .images import look_again
from .lens import CocModel, Lens
from .memory import return_what_is_freed
from .motion import MotionModel, MotionReport, MotionSettings, expose_layer, prepare, report_of
from .pixel_filter import filter_down
from .printer import defocus_evenly, fade
from .progress import scaled
from .psf import PsfSettings
from .samples import Float32Array, LensAttributes, SampleLayer, Samples, Window, mended
from .scatter import Backend, uses_numba
from .seen import put_together, spread_out, take_apart
from .shadows import moved_shadows
from .sheets import on_display
from .shutter import ShutterAttributes
from .variation import variation
from .visibility import Visibility

T = TypeVar("T")

_NOTEWORTHY: Final = 0.02
"""Share of guessed light from which a pixel counts as resting on guesses."""

_SURROUNDINGS: Final = 8.0
"""Pixels around a guess whose variation tells how far it may be off."""

_OTHER_SURFACE: Final = 0.5
"""Share of guesses that another of the surfaces around may stand at the place of."""

_RESAMPLING: Final = 0.05
"""Error of a sharp pixel over the variation around it, from the different ways to filter it."""

_CAMERA_SHARE: Final = 0.8
"""Share of the progress of what comes before the picture is developed and printed."""

_NEED_NO_LENS: Final = ("image_filter", "grain", "noise")
"""Effects for which a lens need not be known."""


@dataclass(frozen=True, slots=True)
class ProcessSettings:
    """What to do to a samples file; what is None is taken from the file.

    Parameters
    ----------
    use_lens : bool
        Run the focus processor.
    use_motion : bool
        Run the motion processor, where the file knows a shutter and what moves.
    lens : LensAttributes
        Lens and aperture in place of the file's.
    shutter : ShutterAttributes
        The exposure in place of the file's.
    motion_model : {"auto", "object", "vector"}
        Whether an object's samples share a path.
    sensor_width, sensor_height : float or None
        Size of the sensor in metres in place of the file's; see `Film.from_sensor`.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.
    psf : PsfSettings
        Kind of point-spread function and its tables.
    weighting : {"1982", "1981"}
        Weights of the samples.
    visibility : {"aperture", "none"}
        Whether nearer surfaces hide farther ones from parts of the aperture, or, as in the papers, not.
    reflections : bool
        Blur what the file has of mirrors and glass with the depth and motion of what is seen there, or with
        those of the surface.
    shadows : bool
        Move the shadows of moving objects, where the file has them apart.
    uniform_defocus : float
        Diameter in metres on the film of the circle that the finished picture is evenly defocused by.
    fade : float
        Share of the finished picture's light: 0 is black, 1 all of it.
    effects : Effects
        What a real lens, filter, film and sensor add.
    frame : int
        Number of the frame, which has its own grain and noise.
    backend : {"auto", "numba", "numpy"}
        Implementation.
    max_memory : int or None
        Bytes that the process may have in all; see `bands`. The picture is the same.

    Raises
    ------
    SettingsError
        If the defocus or the fade is negative or not finite.
    """

    use_lens: bool = True
    use_motion: bool = True
    lens: LensAttributes = field(default_factory=LensAttributes)
    shutter: ShutterAttributes = field(default_factory=ShutterAttributes)
    motion_model: MotionModel = "auto"
    sensor_width: float | None = None
    sensor_height: float | None = None
    model: CocModel = "cycles"
    psf: PsfSettings = field(default_factory=PsfSettings)
    weighting: Weighting = "1982"
    visibility: Visibility = "aperture"
    reflections: bool = True
    shadows: bool = True
    uniform_defocus: float = 0.0
    fade: float = 1.0
    effects: Effects = field(default_factory=Effects)
    frame: int = 0
    backend: Backend = "auto"
    max_memory: int | None = None

    def __post_init__(self) -> None:
        for name, value in (("Uniform defocus", self.uniform_defocus), ("Fade", self.fade)):
            if not (math.isfinite(value) and value >= 0.0):
                raise SettingsError(f"{name} must be a number of 0 or more, not {value:g}.")


@dataclass(frozen=True, slots=True)
class Result:
    """A finished picture.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear, row 0 on top.
    display_window : Window
        Where the picture lies.
    report : dict
        What was done, ready for JSON.
    guessed : ndarray of float32 of shape (rows, columns)
        Share of each pixel's light that rests on filled-in surfaces, from 0 to 1.
    predicted_error : ndarray of float32 of shape (rows, columns)
        How far each pixel is expected to be off, on average over red, green and blue; scene-linear.
    """

    picture: Float32Array
    display_window: Window
    report: dict[str, Any]
    guessed: Float32Array
    predicted_error: Float32Array


def process(samples: Samples, settings: ProcessSettings) -> Generator[float, None, Result]:
    """Turn samples into a picture with depth of field and motion blur.

    Several layers are processed each by itself and laid over each other, the one with the nearer middle
    depth in front.

    Parameters
    ----------
    samples : Samples
        A samples file.
    settings : ProcessSettings
        What to do.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    Result
        The picture and a report.

    Raises
    ------
    SettingsError
        If something that the lens needs is neither in the file nor in the settings.
    InputError
        If a layer lacks its depth.
    MemoryLimitError
        If the memory that the process may have is too little.
    """
    started = time.perf_counter()
    look_again(effect.image for effect in (settings.effects.pupil, settings.effects.image_filter) if effect)
    samples = mended(samples)
    done: list[_Layer] = []
    focus = focus_settings(samples, settings) if settings.use_lens else None
    motion = motion_settings(samples, settings) if settings.use_motion else None
    printed = _film(samples, settings) if settings.uniform_defocus > 0.0 else None
    character = _character(samples, settings)
    bend = None if character is None else character.bend
    # A lens that bends the picture shows more or less than the pinhole did.
    taken = samples if bend is None else samples.showing(bend.needed)
    if settings.max_memory is not None:
        return_what_is_freed()
    check_picture(samples.display_window.rows * samples.display_window.columns, settings.max_memory)
    layers = sorted(taken.layers, key=_middle_depth) if len(taken.layers) > 1 else taken.layers
    developed = is_developed(settings.effects)
    camera_share = 1.0 if printed is None and not developed else _CAMERA_SHARE
    share = camera_share / len(layers)
    for number, layer in enumerate(layers):
        steps = _process_parts(layer, taken, focus, motion, settings, bend)
        done.append((yield from scaled(steps, number * share, share)))
    picture, guessed, doubt = done[0].picture, done[0].guessed, done[0].doubt
    for behind in done[1:]:
        through = 1.0 - picture[..., 3]
        guessed = np.asarray(guessed + behind.guessed * through, dtype=np.float32)
        doubt = np.asarray(doubt + behind.doubt * through, dtype=np.float32)
        picture = over(picture, behind.picture)
    if bend is not None:
        guessed = np.maximum(guessed, _beyond(samples, bend))
    factor, pixel_filter = samples.supersampling, samples.pixel_filter
    if pixel_filter is None or settings.visibility == "none":
        # As the papers do.
        picture = average_down(picture, factor)
    else:
        picture = filter_down(picture, factor, pixel_filter)
    guessed = average_down(guessed[..., np.newaxis], factor)[..., 0]
    doubt = average_down(doubt[..., np.newaxis], factor)[..., 0]
    rest = 1.0 - camera_share
    if developed:
        work = _development(samples, settings, picture.shape[0], picture.shape[1])
        part = rest if printed is None else 0.5 * rest
        picture, doubt = yield from scaled(develop(picture, doubt, work), camera_share, part)
    if printed is not None:
        pixels = replace(printed, columns=picture.shape[1], rows=picture.shape[0])
        steps_of_printer = _printed(picture, guessed, pixels, samples, settings)
        part = 0.5 * rest if developed else rest
        picture, guessed = yield from scaled(steps_of_printer, 1.0 - part, part)
    if settings.fade != 1.0:
        picture = fade(picture, settings.fade)
        doubt = doubt * np.float32(settings.fade)
    predicted_error = _predicted_error(picture, doubt, compiled=uses_numba(settings.backend))
    display = samples.display_window
    window = Window(
        display.x0 // samples.supersampling,
        display.y0 // samples.supersampling,
        display.x0 // samples.supersampling + picture.shape[1],
        display.y0 // samples.supersampling + picture.shape[0],
    )
    report = {
        "size": [picture.shape[1], picture.shape[0]],
        "layers": [layer.name for layer in layers],
        "lens": None if focus is None else _lens_report(focus),
        "focus": [asdict(layer.focus) for layer in done if layer.focus is not None],
        "shutter": None if motion is None else asdict(motion.shutter),
        "motion": [asdict(layer.motion) for layer in done if layer.motion is not None],
        "effects": {name: said for name, said in asdict(settings.effects).items() if said is not None},
        "uniform_defocus_mm": settings.uniform_defocus * 1000.0,
        "fade": settings.fade,
        "quality": {
            "guessed_pixels": float(np.mean(guessed > _NOTEWORTHY)),
            "guessed_light": float(np.mean(guessed)),
            "predicted_error": float(np.sqrt(np.mean(np.square(predicted_error, dtype=np.float64)))),
        },
        "repaired": samples.repaired,
        "threads": jit.set_thread_count(None),
        "compiled": uses_numba(settings.backend),
        "seconds": time.perf_counter() - started,
    }
    yield 1.0
    return Result(picture, window, report, guessed, predicted_error)


@dataclass(frozen=True, slots=True)
class _Layer:
    """A processed layer."""

    picture: Float32Array
    guessed: Float32Array
    doubt: Float32Array
    focus: FocusReport | None = None
    motion: MotionReport | None = None


def _process_parts(
    layer: SampleLayer,
    samples: Samples,
    focus: FocusSettings | None,
    motion: MotionSettings | None,
    settings: ProcessSettings,
    bend: Bend | None,
) -> Generator[float, None, _Layer]:
    """Run the processors on one layer, and on what its mirrors and glass show by itself."""
    picture_window = samples.display_window if bend is None else bend.picture
    blurs = focus is not None or motion is not None
    parts = take_apart(layer) if settings.reflections and blurs else None
    # A mirror's picture of what moves is no shadow.
    lit = layer if parts is None else parts.surfaces
    if motion is not None and settings.shadows:
        lit = moved_shadows(lit, samples, motion, settings.backend)
    if parts is None:
        return (yield from _process_layer(lit, samples, focus, motion, bend))
    share = 1.0 / (1 + len(parts.shares) + len(parts.contents))
    surfaces = yield from scaled(_process_layer(lit, samples, focus, motion, bend), 0.0, share)
    done, shares, contents = share, [], []
    for layer_of_shares in parts.shares:
        steps = _process_layer(layer_of_shares, samples, focus, motion, bend)
        shares.append((yield from scaled(steps, done, share)).picture)
        done += share
    for content in parts.contents:
        # Paths are those of surfaces: what is seen has its own in its vectors.
        window = content.window(samples.data_window)
        display = window.intersection(samples.display_window)
        done += share
        if display.columns == 0 or display.rows == 0:
            contents.append((np.zeros((0, 0, 4), dtype=np.float32), slice(0, 0), slice(0, 0)))
            continue
        alone = replace(samples, paths=None, data_window=window, display_window=display)
        still = content.layer.vector is None
        seen = content.layer if focus is None else spread_out(content.layer, focus)
        steps = _process_layer(seen, alone, focus, None if still else motion, bend)
        shown = yield from scaled(steps, done - share, share)
        # A lens that bends puts it somewhere on the whole picture.
        place = display if bend is None else picture_window
        contents.append((shown.picture, *place.within(picture_window)))
    picture = surfaces.picture.copy()
    picture[..., :3] += put_together(shares, contents)
    return replace(surfaces, picture=picture)


def _process_layer(
    layer: SampleLayer,
    samples: Samples,
    focus: FocusSettings | None,
    motion: MotionSettings | None,
    bend: Bend | None,
) -> Generator[float, None, _Layer]:
    """Run the processors that are wanted on one layer; the picture is on the bent one's window."""
    moving = None if motion is None else prepare(layer, samples, motion)
    if moving is not None and focus is not None:
        cascaded = yield from cascade(moving, layer, focus)
        picture, guessed = cascaded.picture, cascaded.guessed
        of_guesses = _doubt_of_guesses(picture, guessed, compiled=uses_numba(focus.backend))
        report = report_of(moving, layer, cascaded.instants, guessed)
        return _Layer(picture, guessed, cascaded.doubt + of_guesses, cascaded.focus, report)
    if moving is not None and motion is not None:
        steps = expose_layer(moving, layer)
        # They let go of it once they can.
        del moving
        picture, guessed, report = yield from steps
        if bend is not None:
            window = samples.display_window
            picture, guessed = bend.values(picture, window), bend.values(guessed, window)
        doubt = _doubt_of_guesses(picture, guessed, compiled=uses_numba(motion.backend))
        return _Layer(picture, guessed, doubt, motion=report)
    motion_report = None if motion is None else MotionReport(layer.name)
    if focus is None:
        picture = on_display(samples, layer.color)
        if bend is not None:
            picture = bend.values(picture, samples.display_window)
        nothing = np.zeros(picture.shape[:2], dtype=np.float32)
        return _Layer(picture, nothing, nothing, motion=motion_report)
    focused = yield from focus_layer(layer, samples, focus)
    of_guesses = _doubt_of_guesses(focused.picture, focused.guessed, compiled=uses_numba(focus.backend))
    doubt = focused.doubt + _OTHER_SURFACE * of_guesses
    return _Layer(focused.picture, focused.guessed, doubt, focused.report, motion_report)


def _beyond(samples: Samples, bend: Bend) -> Float32Array:
    """Return where a bent picture shows what the file has no data of: 1 there, 0 elsewhere."""
    data, extra = samples.data_window, 1 if samples.position == "corner" else 0
    covered = Window(data.x0, data.y0, data.x1 - extra, data.y1 - extra)
    known = bend.values(np.ones((covered.rows, covered.columns), dtype=np.float32), covered)
    return np.asarray(1.0 - np.clip(known, 0.0, 1.0), dtype=np.float32)


def _doubt_of_guesses(picture: Float32Array, guessed: Float32Array, *, compiled: bool) -> Float32Array:
    """Return how far guessed light may be off: as much as what is seen around it varies."""
    if not guessed.any():
        return np.zeros_like(guessed)
    return guessed * variation(picture, _SURROUNDINGS, compiled=compiled)


def _predicted_error(picture: Float32Array, doubt: Float32Array, *, compiled: bool) -> Float32Array:
    """Return how far pixels are expected to be off.

    Guesses and edges add to what all resampling costs, which is the more the more a picture varies from
    pixel to pixel.
    """
    resampling = np.float32(_RESAMPLING) * variation(picture, 1.0, compiled=compiled)
    return np.asarray(np.hypot(doubt, resampling))


def _printed(
    picture: Float32Array, guessed: Float32Array, film: Film, samples: Samples, settings: ProcessSettings
) -> Generator[float, None, tuple[Float32Array, Float32Array]]:
    """Defocus the finished picture evenly, and the mask of what was guessed with it."""
    circle, aperture = settings.uniform_defocus, _aperture(samples, settings)
    share = 0.5 if guessed.any() else 1.0
    picture = yield from scaled(defocus_evenly(picture, film, circle, aperture, settings.backend), 0.0, share)
    if share < 1.0:
        mask = np.repeat(guessed[..., np.newaxis], 4, axis=2)
        mask = yield from scaled(defocus_evenly(mask, film, circle, aperture, settings.backend), share, share)
        guessed = mask[..., 0]
    return picture, guessed


def focus_settings(samples: Samples, settings: ProcessSettings) -> FocusSettings:
    """Complete the settings of the focus processor from the file.

    Parameters
    ----------
    samples : Samples
        The samples file.
    settings : ProcessSettings
        What overrides it.

    Returns
    -------
    FocusSettings
        Lens, film and how to work.

    Raises
    ------
    SettingsError
        If something is neither in the file nor in the settings; the sentence names the option.
    """
    wanted, stored = settings.lens, samples.lens
    film = _film(samples, settings)
    lens = replace(
        _aperture(samples, settings),
        focal_length=_known(wanted.focal_length, stored.focal_length, "focal length"),
        f_stop=_known(wanted.f_stop, stored.f_stop, "f-stop", option="--fstop"),
        focus_distance=_known(wanted.focus_distance, stored.focus_distance, "focus distance"),
    )
    return FocusSettings(
        lens,
        film,
        settings.model,
        settings.psf,
        settings.weighting,
        settings.visibility,
        settings.backend,
        _character(samples, settings),
        settings.max_memory,
    )


def _character(samples: Samples, settings: ProcessSettings) -> LensCharacter | None:
    """Return the lens's character on the samples' own pixels."""
    effects = settings.effects
    of_lens = effects.pupil, effects.focal_surface, effects.chromatic, effects.vignetting, effects.distortion
    if of_lens == (None,) * 5:
        return None
    focal_length = _known(settings.lens.focal_length, samples.lens.focal_length, "focal length")
    film = _film(samples, settings)
    return character_of(effects, focal_length, film, axis_of(samples), samples.display_window)


def _development(samples: Samples, settings: ProcessSettings, rows: int, columns: int) -> Development:
    """Return what is to be done to the finished picture, which may have fewer pixels than samples."""
    effects = settings.effects
    film = replace(_film(samples, settings), columns=columns, rows=rows)
    lens, window = _aperture(samples, settings), Window(0, 0, columns, rows)
    if any(getattr(effects, name) is not None for name in KINDS if name not in _NEED_NO_LENS):
        wanted, stored = settings.lens, samples.lens
        lens = replace(
            lens,
            focal_length=_known(wanted.focal_length, stored.focal_length, "focal length"),
            f_stop=_known(wanted.f_stop, stored.f_stop, "f-stop", option="--fstop"),
        )
    display, axis = samples.display_window, axis_of(samples)
    axis = (axis[0] - display.x0) / samples.supersampling, (axis[1] - display.y0) / samples.supersampling
    character = character_of(effects, lens.focal_length, film, axis, window)
    shutter = settings.shutter.over(samples.shutter)
    seconds = shutter.exposure_time
    if shutter.frames is not None and shutter.frames_per_second is not None:
        seconds = shutter.frames / shutter.frames_per_second
    if seconds is not None and shutter.slit is not None:
        # As long as the slit uncovers a point of the film.
        seconds *= shutter.slit.width
    return Development(effects, lens, film, window, character, seconds, settings.frame)


def motion_settings(samples: Samples, settings: ProcessSettings) -> MotionSettings | None:
    """Complete the settings of the motion processor from the file.

    Parameters
    ----------
    samples : Samples
        The samples file.
    settings : ProcessSettings
        What overrides it.

    Returns
    -------
    MotionSettings or None
        ``None`` where no length of the exposure is known, or the file has neither paths nor vectors.

    Raises
    ------
    SettingsError
        If a shutter is asked for whose length nobody says.
    """
    shutter = settings.shutter.over(samples.shutter).resolve()
    if shutter is None:
        if settings.shutter.needs_length:
            raise SettingsError("The file does not say how long the shutter is open; give --shutter.")
        return None
    if not samples.knows_motion:
        return None
    return MotionSettings(shutter, settings.motion_model, settings.backend, settings.max_memory)


def _film(samples: Samples, settings: ProcessSettings) -> Film:
    """Return the display window on the film."""
    film = samples.film
    if settings.sensor_width is not None or settings.sensor_height is not None:
        film = Film.from_sensor(
            samples.display_window.columns,
            samples.display_window.rows,
            samples.pixel_aspect,
            sensor_width=settings.sensor_width,
            sensor_height=settings.sensor_height,
        )
    if film is None:
        raise SettingsError("The file does not say the size of the sensor; give --sensor-width.")
    return film


def _aperture(samples: Samples, settings: ProcessSettings) -> Lens:
    """Return a lens of which only the aperture's shape counts."""
    wanted, stored = settings.lens, samples.lens
    return Lens(
        focal_length=1.0,
        f_stop=1.0,
        focus_distance=math.inf,
        blades=_first(wanted.blades, stored.blades, 0),
        blade_rotation=_first(wanted.blade_rotation, stored.blade_rotation, 0.0),
        anamorphic_ratio=_first(wanted.anamorphic_ratio, stored.anamorphic_ratio, 1.0),
    )


def _known(wanted: float | None, stored: float | None, name: str, option: str | None = None) -> float:
    option = option or "--" + name.replace(" ", "-")
    value = wanted if wanted is not None else stored
    if value is None:
        raise SettingsError(f"The file does not say the {name}; give {option}.")
    if math.isnan(value):
        raise SettingsError(f"The {name} must be a number, not nan; give {option}.")
    return value


def _first(wanted: T | None, stored: T | None, default: T) -> T:
    if wanted is not None:
        return wanted
    return default if stored is None else stored


def _middle_depth(layer: SampleLayer) -> float:
    """Return the median depth of what a layer shows, to order layers front to back."""
    if layer.depth is None:
        return math.inf
    # Light without alpha shows as well.
    shown = layer.depth[layer.color.any(axis=2) & np.isfinite(layer.depth)]
    return float(np.median(shown)) if shown.size else math.inf


def _lens_report(focus: FocusSettings) -> dict[str, Any]:
    lens, film = focus.lens, focus.film
    return {
        "focal_length_mm": lens.focal_length * 1000.0,
        "f_stop": lens.f_stop,
        "focus_distance_m": None if math.isinf(lens.focus_distance) else lens.focus_distance,
        "blades": lens.blades,
        "blade_rotation_deg": math.degrees(lens.blade_rotation),
        "anamorphic_ratio": lens.anamorphic_ratio,
        "film_mm": [film.width * 1000.0, film.height * 1000.0],
        "coc_model": focus.model,
        "psf": focus.psf.kind,
        "tables": focus.psf.tables,
        "lookup": focus.psf.lookup,
        "blocks": focus.psf.uses_blocks,
        "weighting": focus.weighting,
        "visibility": focus.visibility,
    }
