"""Long work as generators that yield their progress: run to the end, as a part of more, and timed."""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Final, TypeVar

T = TypeVar("T")

_LEAST_SECONDS: Final = 2.0
"""What takes less than this has no time left worth showing."""

_SMOOTHING_SECONDS: Final = 3.0
"""Time in which a change of pace has become two thirds of what is shown."""

_MOST_LATE: Final = 2.0
"""How many times as long as the pace says smoothing may make it."""


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


class TimeLeft:
    """How long some work still takes, by the share done so far and the time that it took.

    What is smoothed is the moment of the end, so that between two updates the seconds run down.

    Parameters
    ----------
    now : float
        The time in seconds, of any clock.
    share : float
        Share of the whole that was done before, and not at this pace.
    least : float
        Share of what was left then that has to be done before the pace means something.
    """

    def __init__(self, now: float, share: float = 0.0, least: float = 0.05) -> None:
        self._start, self._from = now, share
        self._least = max(least * (1.0 - share), 1e-9)
        self._end: float | None = None
        self._last = now

    def update(self, now: float, share: float) -> None:
        """Note what is done.

        Parameters
        ----------
        now : float
            The time in seconds, of the same clock.
        share : float
            Share of the whole that is done, from 0 to 1.
        """
        done, taken = share - self._from, now - self._start
        if done < self._least or taken < _LEAST_SECONDS:
            return
        end = now + taken * (1.0 - share) / done
        if self._end is None:
            self._end = end
        else:
            self._end += (end - self._end) * -math.expm1((self._last - now) / _SMOOTHING_SECONDS)
            # Work that is suddenly almost done has not the time left that it had.
            self._end = min(self._end, now + _MOST_LATE * (end - now))
        self._last = now

    def seconds(self, now: float) -> float | None:
        """Return how long it still takes.

        Parameters
        ----------
        now : float
            The time in seconds, of the same clock.

        Returns
        -------
        float or None
            Seconds, 0 or more; ``None`` while nothing is known.
        """
        return None if self._end is None else max(self._end - now, 0.0)


def clock_text(seconds: float) -> str:
    """Return a time as Blender shows the rest of a render: ``00:12``, from an hour on ``1:00:12``.

    Parameters
    ----------
    seconds : float
        The time, 0 or more.

    Returns
    -------
    str
        Whole seconds.
    """
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes:02d}:{rest:02d}"


def progress_text(share: float, seconds: float | None) -> str:
    """Return how far work is: ``48 %, 00:05 Remaining``.

    Parameters
    ----------
    share : float
        Share of the work that is done, from 0 to 1.
    seconds : float or None
        How long it still takes; ``None`` where nothing is known.

    Returns
    -------
    str
        A few words.
    """
    done = f"{math.floor(100.0 * share)} %"
    return done if seconds is None else f"{done}, {clock_text(seconds)} Remaining"
