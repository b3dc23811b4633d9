"""From a samples file to a picture: settings resolved, layers focused and laid over each other."""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar

import numpy as np

from . import jit
from .camera import Film
from .errors import SettingsError
from .focus import FocusReport, FocusSettings, Weighting, average_down, focus_layer, over
from .lens import CocModel, Lens
from .motion import MotionModel
from .psf import PsfSettings
from .samples import Float32Array, LensAttributes, SampleLayer, Samples, Window
from .scatter import Backend
from .shutter import ShutterAttributes

T = TypeVar("T")


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
    backend : {"auto", "numba", "numpy"}
        Implementation.
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
    backend: Backend = "auto"


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
    """

    picture: Float32Array
    display_window: Window
    report: dict[str, Any]


def process(samples: Samples, settings: ProcessSettings) -> Generator[float, None, Result]:
    """Turn samples into a picture with depth of field.

    Several layers are focused each by itself and laid over each other, the one with the nearer middle
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
    """
    started = time.perf_counter()
    reports: list[FocusReport] = []
    focus = focus_settings(samples, settings) if settings.use_lens else None
    layers = sorted(samples.layers, key=_middle_depth)
    picture: Float32Array | None = None
    for number, layer in enumerate(layers):
        if focus is None:
            focused = _sharp(layer, samples)
        else:
            steps = focus_layer(layer, samples, focus)
            focused, layer_report = yield from scaled(steps, number / len(layers), 1.0 / len(layers))
            reports.append(layer_report)
        picture = focused if picture is None else over(picture, focused)
    assert picture is not None
    picture = average_down(picture, samples.supersampling)
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
        "focus": [asdict(r) for r in reports],
        "motion": None,
        "repaired": samples.repaired,
        "threads": jit.set_thread_count(None),
        "compiled": jit.HAVE_NUMBA and settings.backend != "numpy",
        "seconds": time.perf_counter() - started,
    }
    yield 1.0
    return Result(picture, window, report)


def run(steps: Generator[float, None, T]) -> T:
    """Run a generator of progress to its end.

    Parameters
    ----------
    steps : generator
        Yields progress, returns a result.

    Returns
    -------
    object
        The result.
    """
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            result: T = stop.value
            return result


def scaled(steps: Generator[float, None, T], start: float, share: float) -> Generator[float, None, T]:
    """Run a part of some work, its progress scaled into the whole's.

    Parameters
    ----------
    steps : generator
        Yields progress from 0 to 1, returns a result.
    start, share : float
        Where the part begins in the whole, and how much of it it is.

    Yields
    ------
    float
        Share of the whole done.

    Returns
    -------
    object
        The part's result.
    """
    while True:
        try:
            yield start + share * next(steps)
        except StopIteration as stop:
            result: T = stop.value
            return result


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
    lens = Lens(
        focal_length=_known(wanted.focal_length, stored.focal_length, "focal length"),
        f_stop=_known(wanted.f_stop, stored.f_stop, "f-stop", option="--fstop"),
        focus_distance=_known(wanted.focus_distance, stored.focus_distance, "focus distance"),
        blades=_first(wanted.blades, stored.blades, 0),
        blade_rotation=_first(wanted.blade_rotation, stored.blade_rotation, 0.0),
        anamorphic_ratio=_first(wanted.anamorphic_ratio, stored.anamorphic_ratio, 1.0),
    )
    return FocusSettings(lens, film, settings.model, settings.psf, settings.weighting, settings.backend)


def _known(wanted: float | None, stored: float | None, name: str, option: str | None = None) -> float:
    value = _first(wanted, stored, math.nan)
    if math.isnan(value):
        raise SettingsError(
            f"The file does not say the {name}; give {option or '--' + name.replace(' ', '-')}."
        )
    return value


def _first(wanted: T | None, stored: T | None, default: T) -> T:
    if wanted is not None:
        return wanted
    return default if stored is None else stored


def _middle_depth(layer: SampleLayer) -> float:
    """Return the median depth of what a layer shows, to order layers front to back."""
    if layer.depth is None:
        return math.inf
    shown = layer.depth[(layer.color[..., 3] > 0.0) & np.isfinite(layer.depth)]
    return float(np.median(shown)) if shown.size else math.inf


def _sharp(layer: SampleLayer, samples: Samples) -> Float32Array:
    """Return the pinhole picture: the samples themselves, corner samples averaged into their pixels."""
    data, display = samples.data_window, samples.display_window
    color = layer.color
    if samples.position == "corner":
        color = 0.25 * (color[:-1, :-1] + color[1:, :-1] + color[:-1, 1:] + color[1:, 1:])
    covered = Window(data.x0, data.y0, data.x0 + color.shape[1], data.y0 + color.shape[0])
    seen = covered.intersection(display)
    picture = np.zeros((display.rows, display.columns, 4), dtype=np.float32)
    picture[seen.y0 - display.y0 : seen.y1 - display.y0, seen.x0 - display.x0 : seen.x1 - display.x0] = color[
        seen.y0 - data.y0 : seen.y1 - data.y0, seen.x0 - data.x0 : seen.x1 - data.x0
    ]
    return picture


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
        "weighting": focus.weighting,
    }
