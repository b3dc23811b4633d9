"""1983, figure 7: a magnet and ten metal balls through four shutters, from one samples file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from potmesil_addon.motion import MotionModel
from potmesil_addon.process import ProcessSettings, Result
from potmesil_addon.samples import SampleLayer, Samples
from potmesil_addon.shutter import ShutterAttributes, parse_openings

from .comparison import psnr
from .sheet import displayed, markdown_table, write_sheet
from .workshop import Drawing, Figure, Picture, Workshop, processed

if TYPE_CHECKING:
    import bpy

EXPOSURE = 1.0
"""The paper's T in frames, as in the scene."""

SHOWN_MODEL: MotionModel = "object"
"""The paper's: one path for each ball, and the time-and-depth buffer."""

_REFERENCE_SAMPLES = 128


@dataclass(frozen=True, slots=True)
class Exposure:
    """One of the figure's exposures.

    Parameters
    ----------
    letter : str
        Of its picture in the paper.
    text : str
        How long the shutter is open.
    shutter : ShutterAttributes
        The same for the motion processor. Openings are in units of T.
    """

    letter: str
    text: str
    shutter: ShutterAttributes


EXPOSURES = (
    Exposure("b", "Exposure T", ShutterAttributes(frames=EXPOSURE, position="start")),
    Exposure("c", "Exposure 2T", ShutterAttributes(frames=2.0 * EXPOSURE, position="start")),
    Exposure(
        "d",
        "Five openings of 0.2T, one each 0.4T",
        ShutterAttributes(frames=EXPOSURE, position="start", openings=parse_openings("5x0.2@0.4")),
    ),
)


def exposed(samples: Samples, exposure: Exposure, model: MotionModel = SHOWN_MODEL) -> Result:
    """Run the motion processor on the samples of the instant.

    Parameters
    ----------
    samples : Samples
        Rendered when the shutter opens.
    exposure : Exposure
        When light comes in.
    model : {"auto", "object", "vector"}
        Whether a ball's samples share a path.

    Returns
    -------
    Result
        The picture.
    """
    settings = ProcessSettings(use_lens=False, shutter=exposure.shutter, motion_model=model)
    return processed(samples, settings)


def instantaneous(samples: Samples) -> Picture:
    """Return the picture of the instant at which the shutter opens."""
    return processed(samples, ProcessSettings(use_lens=False, use_motion=False)).picture


def moving_alone(samples: Samples) -> Samples:
    """Return samples whose balls move before nothing at all.

    The alpha of what the motion processor makes of them is the paper's time band: the share of the
    exposure for which a ball is at a pixel.

    Parameters
    ----------
    samples : Samples
        With the views of what rests and of what moves.

    Returns
    -------
    Samples
        The same paths, and no light but the balls'.
    """
    return replace(samples, layers=tuple(_alone(layer) for layer in samples.layers))


def _alone(layer: SampleLayer) -> SampleLayer:
    assert layer.stationary is not None
    assert layer.moving is not None
    nothing = replace(layer.stationary, color=np.zeros_like(layer.stationary.color))
    return replace(layer, color=layer.moving.color, stationary=nothing)


def light(picture: Picture) -> float:
    """Return the sum of a picture's red, green and blue; scene-linear."""
    return float(picture[..., :3].sum(dtype=np.float64))


def motion_7(workshop: Workshop) -> Drawing:
    """Draw the instant and the three exposures, and two of them by Cycles' own motion blur.

    Parameters
    ----------
    workshop : Workshop
        Where and how large.

    Returns
    -------
    Drawing
        The sheet. ``numbers`` has, by the picture's letter, ``path_px``: the longest path in pixels;
        ``light``: the balls' light over that of the instant; and dB against Cycles: ``instant_db``,
        ``object_db`` and ``auto_db``.
    """
    samples = workshop.rendered("magnet", "magnet")
    instant = instantaneous(samples)
    alone = moving_alone(samples)
    whole = light(instantaneous(alone))
    pictures = [("(a) Instantaneous", instant)]
    references, numbers = {}, {}
    for exposure in EXPOSURES:
        shown = exposed(samples, exposure)
        each = exposed(samples, exposure, "auto").picture
        reference = reference_of(workshop, exposure)
        pictures.append((f"({exposure.letter}) {exposure.text}", shown.picture))
        references[exposure.letter] = reference
        numbers[exposure.letter] = {
            "path_px": shown.report["motion"][0]["longest_path_px"],
            "light": light(exposed(alone, exposure).picture) / whole,
            "instant_db": psnr(instant, reference),
            "object_db": psnr(shown.picture, reference),
            "auto_db": psnr(each, reference),
        }
    pictures += [(f"Cycles' own motion blur for ({letter})", references[letter]) for letter in "cd"]
    path = write_sheet(workshop.path("motion_7"), [(text, displayed(p)) for text, p in pictures], columns=2)
    return Drawing(path, numbers, _table(numbers))


def reference_of(workshop: Workshop, exposure: Exposure) -> Picture:
    """Return Cycles' own motion blur; several openings are the mean of as many renders.

    Parameters
    ----------
    workshop : Workshop
        Where and how large.
    exposure : Exposure
        When light comes in.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        Scene-linear.
    """
    openings = exposure.shutter.openings or ((0.0, (exposure.shutter.frames or 0.0) / EXPOSURE),)
    renders = [
        workshop.cycles(
            f"magnet-opened-{round(1000.0 * begin)}-{round(1000.0 * end)}",
            "magnet",
            shutter=True,
            samples=-(-_REFERENCE_SAMPLES // len(openings)),
            prepare=_opened(begin * EXPOSURE, end * EXPOSURE),
        )
        for begin, end in openings
    ]
    return np.mean(renders, axis=0, dtype=np.float32)


def _opened(begin: float, end: float) -> Callable[[bpy.types.Scene], None]:
    """Return what lets a scene's shutter open and close, in frames from its first one."""

    def prepare(scene: bpy.types.Scene) -> None:
        whole = int(begin)
        scene.frame_set(1 + whole, subframe=begin - whole)
        scene.render.motion_blur_shutter = end - begin
        # So that the noise of several openings is not the same one.
        scene.cycles.seed = round(1000.0 * begin)

    return prepare


def _table(numbers: dict[str, dict[str, float]]) -> str:
    head = (
        "Picture",
        "Longest path, pixels",
        "Light of the balls",
        "Instantaneous, dB",
        "One path for each ball, dB",
        "`auto`, dB",
    )
    rows = [
        (
            f"({exposure.letter}) {exposure.text}",
            round(values["path_px"]),
            f"{100.0 * values['light']:.1f} %",
            *(f"{values[name]:.1f}" for name in ("instant_db", "object_db", "auto_db")),
        )
        for exposure in EXPOSURES
        for values in [numbers[exposure.letter]]
    ]
    return markdown_table(head, rows)


FIGURES = (Figure("motion_7", "1983, figure 7", motion_7),)
