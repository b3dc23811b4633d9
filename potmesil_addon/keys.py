"""Values that change over the frames of an animation, as the command line writes them."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from .errors import SettingsError

Scale = Literal["even", "reciprocal", "stops"]
"""In what a value goes evenly: itself, its reciprocal (distances, as a focusing lens travels), or its
logarithm (f-stops)."""

_SCALES: Final[dict[Scale, tuple[Callable[[float], float], Callable[[float], float]]]] = {
    "even": (lambda value: value, lambda x: x),
    "reciprocal": (lambda value: 1.0 / value, lambda x: 1.0 / x if x else math.inf),
    "stops": (math.log2, lambda x: 2.0**x),
}


@dataclass(frozen=True, slots=True)
class Keys:
    """A value at frames; before the first and after the last it stays.

    Parameters
    ----------
    frames : tuple of float
        Rising; empty for a value that never changes.
    values : tuple of float
        One for each frame, or the only one.
    """

    frames: tuple[float, ...]
    values: tuple[float, ...]

    @property
    def animated(self) -> bool:
        """Whether the value depends on the frame."""
        return bool(self.frames)

    def at(self, frame: float | None, scale: Scale = "even") -> float:
        """Return the value at a frame.

        Parameters
        ----------
        frame : float or None
            The frame, ``None`` where there is none.
        scale : {"even", "reciprocal", "stops"}
            In what the value goes evenly between its keys. Where a key's value has no place on the scale
            (0, or less than 0) the value itself goes evenly.

        Returns
        -------
        float
            The value.

        Raises
        ------
        SettingsError
            If the value depends on the frame and there is none.
        """
        if not self.animated:
            return self.values[0]
        if frame is None:
            raise SettingsError("Values with keys (FRAME=VALUE) need frames; give --frames.")
        after = bisect_right(self.frames, frame)
        if after == 0:
            return self.values[0]
        if after == len(self.frames):
            return self.values[-1]
        first, second = self.values[after - 1], self.values[after]
        begin, end = self.frames[after - 1], self.frames[after]
        share = (frame - begin) / (end - begin)
        forwards, backwards = _SCALES[scale if min(first, second) > 0.0 else "even"]
        if first == second or share == 0.0:
            return first
        return backwards((1.0 - share) * forwards(first) + share * forwards(second))


def parse_keys(text: str) -> Keys:
    """Return the keys of ``2.8`` or of ``1=0.29,24=0.98``.

    Parameters
    ----------
    text : str
        A number, or frames with their values, parted by commas.

    Returns
    -------
    Keys
        The value or values.

    Raises
    ------
    SettingsError
        If the text is neither, or the frames do not rise.
    """
    wrong = SettingsError(f"'{text}' is neither a number nor keys such as 1=0.29,24=0.98 (FRAME=VALUE).")
    try:
        if "=" not in text:
            return Keys((), (float(text),))
        pairs = [piece.split("=") for piece in text.split(",")]
        frames = tuple(float(frame) for frame, _ in pairs)
        values = tuple(float(value) for _, value in pairs)
    except ValueError:
        raise wrong from None
    if not all(map(math.isfinite, frames)) or any(map(math.isnan, values)):
        raise wrong
    if any(later <= earlier for earlier, later in itertools.pairwise(frames)):
        raise SettingsError(f"The frames of the keys '{text}' do not rise.")
    return Keys(frames, values)
