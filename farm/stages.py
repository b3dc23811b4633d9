"""What the submit programs share: the options of a job, the command of a stage, and frames in chunks."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

from potmesil_addon.errors import SettingsError
from potmesil_addon.frames import parse_frames

STAGES: Final = ("passes", "process")
"""The stages of a frame, in order: samples file, picture."""


@dataclass(frozen=True)
class Job:
    """The frames of a scene, and how the workers make them.

    Parameters
    ----------
    name : str
        The job's name, without blanks.
    blend : str
        Absolute path of the .blend file, as the workers see it.
    frames : tuple of int
        In rising order.
    samples, output : str
        Absolute paths of samples files and pictures, with a `#`.
    chunk : int
        Frames of a task, 1 or more.
    existing : str
        `skip`, `keep` or `overwrite`.
    threads : int
        Cores of a task, 1 or more.
    memory_gib : float
        Memory of a task.
    retries : int
        Times that the farm tries a failed task again.
    stages : tuple of str
        Of `STAGES`.
    blender : str
        The program that the workers run.
    """

    name: str
    blend: str
    frames: tuple[int, ...]
    samples: str
    output: str
    chunk: int
    existing: str
    threads: int
    memory_gib: float
    retries: int
    stages: tuple[str, ...]
    blender: str

    def command(self, stage: str, frames: str, progress: str) -> list[str]:
        """Return the words of the command that makes a task's frames.

        Parameters
        ----------
        stage : str
            `passes` or `process`.
        frames : str
            The farm's own placeholder for a task's frames.
        progress : str
            What `--progress` takes.
        """
        # Room for what is not the processors': Blender and its libraries.
        limit = max(1.0, 0.9 * self.memory_gib)
        return [
            self.blender,
            "-b",
            self.blend,
            "--command",
            "potmesil_camera",
            stage,
            f"--frames={frames}",
            f"--samples={self.samples}",
            *([f"--output={self.output}"] if stage == "process" else []),
            f"--existing={self.existing}",
            f"--threads={self.threads}",
            f"--max-memory={limit:g}",
            f"--progress={progress}",
        ]

    def chunks(self) -> list[tuple[int, ...]]:
        """Return the frames of each task."""
        return [self.frames[i : i + self.chunk] for i in range(0, len(self.frames), self.chunk)]


def write_frames(frames: Sequence[int], step: str = ":") -> str:
    """Return frames as a range: `5`, `1-4`, `1-7:3`, `1-2,5`.

    Parameters
    ----------
    frames : sequence of int
        At least one, in rising order.
    step : str
        What stands before a step: `:`, or `x` as in Nuke and OpenCue.
    """
    if len(frames) > 2:
        width = frames[1] - frames[0]
        if width > 1 and all(b - a == width for a, b in pairwise(frames)):
            return f"{frames[0]}-{frames[-1]}{step}{width}"
    pieces, first = [], 0
    for i in range(1, len(frames) + 1):
        if i == len(frames) or frames[i] != frames[i - 1] + 1:
            run = frames[first:i]
            pieces.append(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}")
            first = i
    return ",".join(pieces)


def job_parser(description: str) -> argparse.ArgumentParser:
    """Return a parser with the options that `read_job` takes apart."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("blend", type=Path, help="the .blend file, where the workers find it too")
    parser.add_argument("--frames", required=True, metavar="RANGE", help="as 1-100, 1-100:2 or 1,2,9-12")
    parser.add_argument("--samples", required=True, metavar="TEMPLATE", help="samples files, with a #")
    parser.add_argument("--output", required=True, metavar="TEMPLATE", help="pictures, with a #")
    parser.add_argument("--name", help="the job's name; default: that of the .blend file")
    parser.add_argument("--stage", choices=STAGES, help="this stage only; default: both, one after the other")
    parser.add_argument("--chunk", type=_positive, default=10, metavar="N", help="frames a task; default: 10")
    parser.add_argument("--existing", choices=("skip", "keep", "overwrite"), default="skip")
    parser.add_argument("--threads", type=_positive, default=4, metavar="N", help="cores a task; default: 4")
    parser.add_argument("--memory", type=_gib, default=8.0, metavar="GIB", help="memory a task; default: 8")
    parser.add_argument("--retries", type=int, default=2, metavar="N", help="of a failed task; default: 2")
    parser.add_argument("--blender", default="blender", help="the program that the workers run")
    parser.add_argument("--print", action="store_true", help="print the job, and send nothing")
    return parser


def read_job(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Job:
    """Return the job that options ask for, or end with status 2 and a sentence.

    Parameters
    ----------
    parser : ArgumentParser
        Says what is wrong.
    options : Namespace
        Of a parser made by `job_parser`.
    """
    try:
        frames = parse_frames(options.frames)
    except SettingsError as error:
        parser.error(str(error))
    for option in ("samples", "output"):
        path = getattr(options, option)
        if "#" not in Path(path).name:
            parser.error(f"--{option} {path}: the file's name needs a # for the frame's digits.")
        # `//` is the .blend file's folder, which the command knows.
        if not path.startswith("//"):
            setattr(options, option, str(Path(path).absolute()))
    return Job(
        name="_".join((options.name or options.blend.stem).split()),
        blend=str(options.blend.absolute()),
        frames=frames,
        samples=options.samples,
        output=options.output,
        chunk=options.chunk,
        existing=options.existing,
        threads=options.threads,
        memory_gib=options.memory,
        retries=options.retries,
        stages=(options.stage,) if options.stage else STAGES,
        blender=options.blender,
    )


def _positive(text: str) -> int:
    """Return a whole number of 1 or more."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return number


def _gib(text: str) -> float:
    """Return a size of 1 or more."""
    number = float(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return number
