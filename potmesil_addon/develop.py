"""From the light behind the lens to a developed picture: glare, vignetting, exposure, grain and noise.

They follow in the order in which light meets them, on the finished picture's pixels, before the optical
printer.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from .camera import Film
from .character import LensCharacter
from .effects import Effects
from .errors import SettingsError
from .lens import Lens
from .progress import scaled
from .samples import Float32Array, Window

_GLARE_SHARE = 0.8
"""Share of the progress that glare takes."""

_NORMAL_SENSITIVITY = 100.0
"""ISO speed of a sensor where none is said."""


@dataclass(frozen=True, slots=True)
class Development:
    """Everything that is done to a finished picture.

    Parameters
    ----------
    effects : Effects
        What is on.
    lens : Lens
        The lens that took it.
    film : Film
        Its pixels on the film.
    window : Window
        The picture, in the pixels of the character's axis.
    character : LensCharacter or None
        What the lens does from place to place.
    exposure_time : float or None
        In seconds, where it is known.
    frame : int
        Number of the frame, which has its own grain and noise.
    """

    effects: Effects
    lens: Lens
    film: Film
    window: Window
    character: LensCharacter | None
    exposure_time: float | None
    frame: int


def is_developed(effects: Effects) -> bool:
    """Return whether an effect acts on the finished picture."""
    on_light = effects.diffraction, effects.star, effects.image_filter, effects.vignetting
    on_film = effects.exposure, effects.grain, effects.noise
    return any(effect is not None for effect in (*on_light, *on_film))


def develop(
    picture: Float32Array, doubt: Float32Array, work: Development
) -> Generator[float, None, tuple[Float32Array, Float32Array]]:
    """Do to a picture what filters, lens, film and sensor do to light.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear.
    doubt : ndarray of float32 of shape (rows, columns)
        How far pixels may be off.
    work : Development
        What to do.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    picture : ndarray of float32 of shape (rows, columns, 4)
        With the same alpha.
    doubt : ndarray of float32 of shape (rows, columns)
        How far its pixels may be off, brightened as they are; grain and noise are no errors.

    Raises
    ------
    SettingsError
        If the exposure time is needed and not known.
    """
    # Off, an effect does not even cost the time to load it.
    from .emulsion import add_grain, add_noise, exposure_factor  # noqa: PLC0415
    from .glare import glare  # noqa: PLC0415

    effects, sensitivity = work.effects, _NORMAL_SENSITIVITY
    gain = np.ones(3, dtype=np.float32)
    if effects.exposure is not None:
        if work.exposure_time is None:
            raise SettingsError(
                "The file does not say the exposure time, which brightens the picture; give --shutter."
            )
        gain[:] = exposure_factor(effects.exposure, work.lens.f_stop, work.exposure_time)
        sensitivity = effects.exposure.sensitivity
    if (effects.diffraction, effects.star, effects.image_filter) != (None,) * 3:
        picture = yield from scaled(glare(picture, work.film, work.lens, effects), 0.0, _GLARE_SHARE)
    if effects.vignetting is not None and work.character is not None:
        share = work.character.vignetted(work.lens, work.film, work.window)
        picture = _brightened(picture, share[..., np.newaxis])
        doubt = doubt * share
    if effects.exposure is not None:
        picture = _brightened(picture, gain)
        doubt = doubt * gain.mean()
    if effects.noise is not None:
        picture = add_noise(picture, effects.noise, sensitivity, work.frame)
    if effects.grain is not None:
        picture = add_grain(picture, effects.grain, work.film, work.frame)
    yield 1.0
    return picture, doubt


def _brightened(picture: Float32Array, gain: Float32Array) -> Float32Array:
    """Return a picture with its light times a gain, and the same alpha."""
    brightened = picture.copy()
    brightened[..., :3] *= gain
    return brightened
