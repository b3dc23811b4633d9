"""Lamps: where the light comes from that a moving object takes away from what is behind it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Final

import numpy as np

from . import schemas
from .errors import InputError
from .lens import FloatArray

VERSION: Final = 1


@dataclass(frozen=True, slots=True)
class Lamp:
    """A lamp at the rendered frame, as a point.

    Parameters
    ----------
    place : ndarray of float64 of shape (4,)
        Homogeneous place in the world: (x, y, z, 1) of a lamp somewhere, and (x, y, z, 0), the unit direction
        towards it, of one that is infinitely far away.
    """

    place: FloatArray


def lamps_to_json(lamps: tuple[Lamp, ...]) -> str:
    """Return the text of the ``potmesil:lamps`` attribute."""
    return json.dumps({"version": VERSION, "places": [lamp.place.tolist() for lamp in lamps]})


def lamps_from_json(text: str) -> tuple[Lamp, ...]:
    """Return the lamps that `lamps_to_json` wrote.

    Raises
    ------
    InputError
        If the text is not of that form.
    """
    try:
        values = schemas.parse(text, schemas.LAMPS)
    except schemas.JsonError as error:
        raise InputError("The file's lamps are damaged; export it again.") from error
    return tuple(Lamp(np.array(place, dtype=np.float64)) for place in values["places"])
