"""Long work as generators that yield their progress: run to the end, or as a part of longer work."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

T = TypeVar("T")


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
