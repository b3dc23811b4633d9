"""Submit an animation to Slurm: an array for each stage, each task waiting for its own of the stage before.

    python farm/slurm/submit.py chunks.txt --memory 4000 --threads 4 --time 1:00:00 -- \
        blender -b shot.blend --command potmesil_camera {stage} --output=/shared/out/####.exr

A line of the chunk file is a task's frames. Needs Slurm's sbatch and scontrol, and of Python its own library.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

SCRIPT: Final = Path(__file__).resolve().parent / "potmesil_camera.sbatch"
STAGE: Final = "{stage}"


class SubmitError(Exception):
    """Something that the user has to mend, in one sentence."""


def parser() -> argparse.ArgumentParser:
    """Return the command line's parser."""
    made = argparse.ArgumentParser(
        usage="%(prog)s [options] CHUNKS -- COMMAND ...",
        description="Submit an animation to Slurm, an array of tasks for each stage.",
        epilog="Everything after -- is the command that a task runs, with {stage} where the stage belongs; "
        "--frames and --max-memory are added to it.",
    )
    made.add_argument("chunks", type=Path, metavar="CHUNKS", help="a file with a task's frames in each line")
    made.add_argument("--stages", default="passes,process", metavar="STAGE,...", help="default: %(default)s")
    made.add_argument(
        "--memory", type=_positive, default=4000, metavar="MB", help="of a task (default: %(default)s)"
    )
    made.add_argument(
        "--most-memory",
        type=_positive,
        metavar="MB",
        help="where it was too small a task is queued again with twice as much, up to this",
    )
    made.add_argument(
        "--threads", type=_positive, default=4, metavar="N", help="of a task (default: %(default)s)"
    )
    made.add_argument(
        "--time", default="1:00:00", metavar="H:MM:SS", help="a task's limit (default: %(default)s)"
    )
    made.add_argument(
        "--retries",
        type=_count,
        default=2,
        metavar="N",
        help="times a task is queued again (default: %(default)s)",
    )
    made.add_argument("--at-once", type=_positive, metavar="N", help="tasks that may run at the same time")
    made.add_argument("--name", default="potmesil_camera", help="the jobs' name (default: %(default)s)")
    made.add_argument(
        "--logs",
        type=Path,
        default=Path("logs"),
        metavar="FOLDER",
        help="where the tasks' logs go (default: %(default)s)",
    )
    made.add_argument(
        "--sbatch",
        action="append",
        default=[],
        metavar="OPTION",
        help="one for sbatch, such as --sbatch=--partition=render; may be repeated",
    )
    made.add_argument("--dry-run", action="store_true", help="print what would be submitted")
    return made


def sbatch_command(
    options: argparse.Namespace, chunks: Path, count: int, stage: str, after: str | None
) -> list[str]:
    """Return the sbatch command of a stage.

    Parameters
    ----------
    options : argparse.Namespace
        The command line's.
    chunks : Path
        The chunk file, absolute.
    count : int
        How many chunks it has.
    stage : str
        What takes the place of ``{stage}`` in the command.
    after : str or None
        The array whose tasks have to be done before, each before the one with its index.
    """
    command = [
        "sbatch",
        "--parsable",
        f"--job-name={options.name}.{stage}",
        f"--array=0-{count - 1}" + (f"%{options.at_once}" if options.at_once else ""),
        f"--mem={options.memory}M",
        f"--cpus-per-task={options.threads}",
        f"--time={options.time}",
        f"--output={options.logs.resolve()}/%x.%A_%a.log",
        *([f"--dependency=aftercorr:{after}", "--kill-on-invalid-dep=yes"] if after else []),
        *options.sbatch,
        str(SCRIPT),
        f"-r{options.retries}",
        *([f"-m{options.most_memory}"] if options.most_memory else []),
        str(chunks),
    ]
    return [*command, *(word.replace(STAGE, stage) for word in options.command)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Submit, and print each stage's job number; return the exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        The command line's words; default: this process's.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    own = words.index("--") if "--" in words else len(words)
    options = parser().parse_args(words[:own], argparse.Namespace(command=words[own + 1 :]))
    try:
        _submit(options)
    except SubmitError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 3
    return 0


def _submit(options: argparse.Namespace) -> None:
    stages = [stage for stage in options.stages.split(",") if stage]
    if not options.command:
        raise SubmitError("There is no command; put it after --, with {stage} where the stage belongs.")
    if not stages or (len(stages) > 1 and not any(STAGE in word for word in options.command)):
        raise SubmitError("The command does not say where the stage belongs; write {stage} there.")
    lines = _read_chunks(options.chunks)
    if not options.dry_run:
        _check_size(len(lines))
        options.logs.mkdir(parents=True, exist_ok=True)
    # Tasks read it when they begin, which may be tomorrow: a copy that nobody edits.
    kept = options.logs.resolve() / f"{options.name}.{time.strftime('%Y%m%d-%H%M%S')}.{os.getpid()}.chunks"
    if not options.dry_run:
        shutil.copyfile(options.chunks, kept)
    after = None
    for stage in stages:
        command = sbatch_command(options, kept, len(lines), stage, after)
        if options.dry_run:
            print(shlex.join(command))
            after = f"<{stage}>"
            continue
        after = _output(command).strip().split(";")[0]
        print(f"{stage}: {after}")


def _read_chunks(path: Path) -> list[str]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise SubmitError(f"Cannot read '{path}': {error.strerror}.") from error
    if not lines:
        raise SubmitError(f"'{path}' names no frames; write a range into each line.")
    for number, line in enumerate(lines, 1):
        if not re.fullmatch(r"[-0-9,:x.]+", line):
            raise SubmitError(
                f"Line {number} of '{path}' is no range of frames: '{line}'; write one such as 1-8."
            )
    return lines


def _check_size(count: int) -> None:
    """Refuse more tasks than this cluster's arrays may have: Slurm itself only says "Invalid job array"."""
    found = re.search(r"^MaxArraySize\s*=\s*(\d+)", _output(["scontrol", "show", "config"]), re.MULTILINE)
    if found and count > int(found[1]):
        raise SubmitError(
            f"{count} chunks, and arrays have at most {found[1]} tasks here; make the chunks larger."
        )


def _output(command: Sequence[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise SubmitError(
            f"There is no {command[0]} here; run this on a machine that submits to Slurm."
        ) from error
    if done.returncode:
        raise SubmitError(f"{command[0]} failed: {(done.stderr or done.stdout).strip()}")
    return done.stdout


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is less than 1")
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{value} is less than 0")
    return value


if __name__ == "__main__":
    sys.exit(main())
