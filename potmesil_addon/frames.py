"""Frame ranges as people and render farms write them, and the paths of frames."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from .errors import SettingsError

MAX_FRAMES: Final = 1_048_574
"""Blender's own largest frame number."""

_RANGE: Final = re.compile(r"(-?\d+)(?:(?:-|\.\.)(-?\d+)(?:[:x](\d+))?)?")


def parse_frames(text: str) -> tuple[int, ...]:
    """Return the frames of a range such as ``5``, ``1-10``, ``1-10:2``, ``1-10x2``, ``1..10``, ``-3--1``.

    Parameters
    ----------
    text : str
        Ranges, parted by commas.

    Returns
    -------
    tuple of int
        Frames in rising order, each once.

    Raises
    ------
    SettingsError
        If the text is no range, runs backwards, or is longer than any animation.
    """
    frames: set[int] = set()
    for piece in text.split(","):
        match = _RANGE.fullmatch(piece.strip())
        if match is None:
            raise SettingsError(
                f"'{piece.strip()}' is no frame range; write it as 5, 1-10, 1-10:2 or 1,3,7-9."
            )
        first = int(match[1])
        last = first if match[2] is None else int(match[2])
        step = 1 if match[3] is None else int(match[3])
        if last < first or step < 1:
            raise SettingsError(f"The frame range '{piece.strip()}' does not run forwards.")
        if abs(first) > MAX_FRAMES or abs(last) > MAX_FRAMES:
            raise SettingsError(f"The frame range '{piece.strip()}' is beyond frame {MAX_FRAMES}.")
        frames.update(range(first, last + 1, step))
    return tuple(sorted(frames))


def frame_path(template: Path, frame: int, *, several: bool = False) -> Path:
    """Return the path of a frame: the last run of ``#`` in the file's name becomes its number.

    Parameters
    ----------
    template : Path
        Such as ``out/####.exr``.
    frame : int
        Frame number; negative ones keep their sign before the zeros.
    several : bool
        Add a number of four digits where the name has no ``#``, as Blender does.

    Returns
    -------
    Path
        The frame's path.
    """
    runs = list(re.finditer(r"#+", template.name))
    if not runs:
        return (
            template.with_name(f"{template.stem}{_digits(frame, 4)}{template.suffix}")
            if several
            else template
        )
    run = runs[-1]
    name = template.name[: run.start()] + _digits(frame, len(run[0])) + template.name[run.end() :]
    return template.with_name(name)


def existing_frames(template: Path) -> tuple[int, ...]:
    """Return the frames whose files exist, in rising order.

    Parameters
    ----------
    template : Path
        With a ``#``, as in `frame_path`.

    Returns
    -------
    tuple of int
        Frames, each once.
    """
    run = list(re.finditer(r"#+", template.name))[-1]
    before, after = re.escape(template.name[: run.start()]), re.escape(template.name[run.end() :])
    name = re.compile(rf"{before}(-?\d+){after}")
    folder = template.parent
    found = (name.fullmatch(item.name) for item in folder.iterdir()) if folder.is_dir() else ()
    frames = {int(match[1]) for match in found if match is not None}
    # A number with other zeros is another file.
    return tuple(sorted(frame for frame in frames if frame_path(template, frame).exists()))


def _digits(frame: int, width: int) -> str:
    return f"{'-' if frame < 0 else ''}{abs(frame):0{width}d}"
