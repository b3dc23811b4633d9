#!/usr/bin/env python3
"""Reckon what an animation takes on a farm: hours, storage, network, tasks and failures. Needs only Python.

python farm/plan.py --frames 100000 --workers 1000 --render 230 --process 13 --size 1920x1080

docs/farm_planning.md says where the numbers come from, and what to do about those that are too large.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from typing import Final

FILE_OPERATIONS: Final = {"passes": 20, "process": 29, "skip": 13}
"""Opens, stats, renames and flushes of a frame's files, counted with strace."""


@dataclass(frozen=True)
class Animation:
    """What is made, on what.

    Parameters
    ----------
    frames, workers, chunk : int
        Frames of the animation, tasks that run at once, and frames of a task; 1 or more.
    pixels : int
        Of a frame.
    render_s, process_s : float
        Seconds that a worker takes for a frame's samples, and for its picture.
    start_s : float
        Seconds from a task's begin to its first frame.
    cold_s : float
        Seconds that a worker's first picture takes longer, as its kernels are compiled.
    samples_bytes, picture_bytes : float
        A frame's files, in bytes for each pixel.
    scene_bytes : float
        What a task reads before its first frame: the .blend file and what it links to.
    hours_between_failures : float
        Of a worker.
    failing : float
        Share of frames that fail and are made again.
    """

    frames: int
    workers: int
    chunk: int
    pixels: int
    render_s: float
    process_s: float
    start_s: float
    cold_s: float
    samples_bytes: float
    picture_bytes: float
    scene_bytes: float
    hours_between_failures: float
    failing: float

    @property
    def tasks(self) -> int:
        """Tasks of a stage."""
        return math.ceil(self.frames / self.chunk)

    def busy_s(self, stage: str) -> float:
        """Return the seconds that all workers together spend on a stage, nothing having failed."""
        frame = self.render_s if stage == "passes" else self.process_s
        cold = 0.0 if stage == "passes" else self.cold_s * min(self.workers, self.tasks)
        return self.frames * frame + self.tasks * self.start_s + cold

    def frames_a_second(self, stage: str) -> float:
        """Return how many frames of a stage all workers finish in a second."""
        frame = self.render_s if stage == "passes" else self.process_s
        return min(self.workers, self.tasks) / (frame + self.start_s / self.chunk)

    def hours(self, stage: str) -> float:
        """Return how long a stage takes: evenly shared work, and the last task, for which others wait."""
        frame = self.render_s if stage == "passes" else self.process_s
        last = self.start_s + self.chunk * frame
        return (self.busy_s(stage) / min(self.workers, self.tasks) + 0.5 * last) / 3600.0

    @property
    def lost_workers(self) -> float:
        """How many workers fail while both stages run."""
        return sum(map(self.busy_s, ("passes", "process"))) / 3600.0 / self.hours_between_failures

    @property
    def lost_s(self) -> float:
        """Seconds of work that failures cost: whole frames stay, so that half of one is lost, and a start."""
        frame = self.render_s + self.process_s
        return self.lost_workers * (0.5 * self.render_s + self.start_s) + self.frames * self.failing * frame

    def read_s(self) -> float:
        """Return the bytes a second that are read while pictures are made."""
        return self.frames_a_second("process") * (
            self.samples_bytes * self.pixels + self.scene_bytes / self.chunk
        )

    def written_s(self, stage: str) -> float:
        """Return the bytes a second that a stage writes."""
        size = self.samples_bytes if stage == "passes" else self.picture_bytes
        return self.frames_a_second(stage) * size * self.pixels

    def workers_for(self, bytes_a_second: float) -> int:
        """Return how many workers may make pictures where the file server reads so much."""
        each = self.read_s() / min(self.workers, self.tasks)
        return min(self.workers, int(bytes_a_second / each))


def table(plan: Animation, server: float, array: int) -> list[tuple[str, str]]:
    """Return what is reckoned, line by line.

    Parameters
    ----------
    plan : Animation
        What is made.
    server : float
        Bytes a second that the file server reads.
    array : int
        Tasks that an array of the scheduler may have.
    """
    both = sum(map(plan.busy_s, ("passes", "process")))
    starts = 2 * plan.tasks * plan.start_s
    # In one task the samples are read from the memory of the machine that has just written them.
    together = plan.workers / (plan.render_s + plan.process_s + plan.start_s / plan.chunk)
    operations = {
        stage: plan.frames_a_second(stage) * FILE_OPERATIONS[stage] for stage in ("passes", "process")
    }
    return [
        ("Work of all workers", f"{both / 3600:,.0f} h"),
        ("of which rendering", f"{100 * plan.frames * plan.render_s / both:.1f} %"),
        ("of which starts of tasks", f"{100 * starts / both:.2f} %"),
        ("Passes take", f"{plan.hours('passes'):,.2f} h"),
        ("Pictures take", f"{plan.hours('process'):,.2f} h"),
        ("Tasks of a stage", f"{plan.tasks:,}"),
        (f"Arrays of {array:,}", f"{math.ceil(plan.tasks / array):,}"),
        ("A task of passes takes", f"{(plan.start_s + plan.chunk * plan.render_s) / 60:,.1f} min"),
        ("A task of pictures takes", f"{(plan.start_s + plan.chunk * plan.process_s) / 60:,.1f} min"),
        ("Samples file", f"{plan.samples_bytes * plan.pixels / 1e6:,.1f} MB"),
        ("Picture", f"{plan.picture_bytes * plan.pixels / 1e6:,.1f} MB"),
        ("All samples files", f"{plan.frames * plan.samples_bytes * plan.pixels / 1e12:,.2f} TB"),
        ("All pictures", f"{plan.frames * plan.picture_bytes * plan.pixels / 1e12:,.2f} TB"),
        ("Written during passes", f"{plan.written_s('passes') / 1e6:,.0f} MB/s"),
        ("Read during pictures", f"{plan.read_s() / 1e6:,.0f} MB/s"),
        ("Written during pictures", f"{plan.written_s('process') / 1e6:,.0f} MB/s"),
        (f"Workers that {server / 1e9:g} GB/s feed with samples", f"{plan.workers_for(server):,}"),
        (
            "Written by both stages in one task",
            f"{together * (plan.samples_bytes + plan.picture_bytes) * plan.pixels / 1e6:,.0f} MB/s",
        ),
        ("File operations during passes", f"{operations['passes']:,.0f} /s"),
        ("File operations during pictures", f"{operations['process']:,.0f} /s"),
        ("Workers that fail", f"{plan.lost_workers:,.1f}"),
        ("Frames that fail", f"{plan.frames * plan.failing:,.0f}"),
        ("Work lost by both", f"{plan.lost_s / 3600:,.1f} h"),
    ]


def _size(text: str) -> int:
    """Return the pixels of a size such as 1920x1080."""
    width, times, height = text.partition("x")
    if not (times and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"'{text}' is no size; write it as 1920x1080.")
    return int(width) * int(height)


def _count(text: str) -> int:
    """Return a whole number of 1 or more."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' must be a whole number of 1 or more.")
    return int(text)


def _amount(text: str) -> float:
    """Return a finite number of 0 or more."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 <= number < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' must be a number of 0 or more.")
    return number


def _more(text: str) -> float:
    """Return a finite number above 0."""
    number = _amount(text)
    if not number:
        raise argparse.ArgumentTypeError("must be more than 0.")
    return number


def main(words: list[str] | None = None) -> int:
    """Print the table.

    Parameters
    ----------
    words : list of str, optional
        Arguments; default: the program's own.
    """
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    add = parser.add_argument
    add("--frames", type=_count, default=100_000)
    add("--workers", type=_count, default=1000, help="tasks that run at once")
    add("--chunk", type=_count, default=10, help="frames a task")
    add("--size", type=_size, default="1920x1080", metavar="WxH")
    add("--render", type=_more, required=True, metavar="SECONDS", help="a frame's samples")
    add("--process", type=_more, required=True, metavar="SECONDS", help="a frame's picture")
    add("--start", type=_amount, default=2.3, metavar="SECONDS", help="of a task, to its first frame")
    add(
        "--cold",
        type=_amount,
        default=43.0,
        metavar="SECONDS",
        help="to compile a worker's kernels; 0: shared",
    )
    add("--samples-bytes", type=_more, default=33.0, metavar="BYTES", help="of a samples file, a pixel")
    add("--picture-bytes", type=_more, default=12.0, metavar="BYTES", help="of a picture, a pixel")
    add("--scene-bytes", type=_amount, default=200e6, metavar="BYTES", help="that a task reads at its start")
    add("--mtbf", type=_more, default=2000.0, metavar="HOURS", help="between failures of a worker")
    add("--failing", type=_amount, default=0.001, metavar="SHARE", help="of frames that fail")
    add("--server", type=_more, default=5.0, metavar="GB/s", help="that the file server reads")
    add("--array", type=_count, default=1001, metavar="TASKS", help="that an array may have")
    options = parser.parse_args(words)
    plan = Animation(
        frames=options.frames,
        workers=options.workers,
        chunk=options.chunk,
        pixels=options.size,
        render_s=options.render,
        process_s=options.process,
        start_s=options.start,
        cold_s=options.cold,
        samples_bytes=options.samples_bytes,
        picture_bytes=options.picture_bytes,
        scene_bytes=options.scene_bytes,
        hours_between_failures=options.mtbf,
        failing=options.failing,
    )
    rows = table(plan, options.server * 1e9, options.array)
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value:>12}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
