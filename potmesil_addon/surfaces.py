"""What light does at a surface, as the probe that follows its path is told."""

from __future__ import annotations

import enum
from collections.abc import Sequence

_BITS = 3
"""For each slot; as many as the kinds need."""

_SLOTS = 8
"""Times three bits are the 24 that a float of four bytes holds exactly."""


class SurfaceKind(enum.IntEnum):
    """What happens to the path of light at a surface."""

    ROUGH = 0
    """It ends here."""
    POLISHED = 1
    """It is reflected at first sight, but ends here if it comes from another mirror: a clear coat."""
    MIRROR = 2
    """It is always reflected, as by metal."""
    GLASS = 3
    """It is bent and goes through; at first sight it is reflected, too."""
    CLEAR = 4
    """It goes straight through."""


def packed(kinds: Sequence[SurfaceKind]) -> float:
    """Return the kinds of an object's material slots as one number, which an object can carry.

    Parameters
    ----------
    kinds : sequence of SurfaceKind
        One for each slot. From the ninth on they are left out: those slots count as the eighth.

    Returns
    -------
    float
        Three bits for each slot, the first slot's the lowest; exact in four bytes.
    """
    return float(sum(int(kind) << (_BITS * slot) for slot, kind in enumerate(kinds[:_SLOTS])))
