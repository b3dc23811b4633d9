"""The motion processor: samples, paths and a shutter to a picture with motion blur (1983, section 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from .scatter import Backend
from .shutter import Shutter

MotionModel = Literal["auto", "object", "vector"]
"""``object`` gives each object one path (1983), ``vector`` each sample its own, ``auto`` what is needed."""

MOTION_MODELS: Final[tuple[MotionModel, ...]] = ("auto", "object", "vector")


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Everything that the motion processor needs beside the samples.

    Parameters
    ----------
    shutter : Shutter
        The exposure.
    model : {"auto", "object", "vector"}
        Whether an object's samples share a path.
    backend : {"auto", "numba", "numpy"}
        Implementation; all give the same picture.
    """

    shutter: Shutter
    model: MotionModel = "auto"
    backend: Backend = "auto"
