"""Submit a job to OpenCue: a layer for each stage, each chunk of the second after its own of the first.

python -m farm.opencue.submit shot.blend --frames 1-99 --samples /s/####.exr --output /p/####.exr

from the project's folder, with OpenCue's pyoutline. `--print` writes the job's XML and needs no cuebot.
"""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from farm.stages import Job, job_parser, read_job, write_frames

if TYPE_CHECKING:
    from typing import Any


@dataclass(frozen=True)
class Layer:
    """A layer of the job, in pyoutline's words.

    Parameters
    ----------
    name : str
        The stage.
    command : str
        One line for the shell; OpenCue puts a chunk's frames in place of `#FRAMESPEC#`.
    range : str
        All frames.
    chunk : int
        Frames of a task.
    threads : int
        Cores of a task.
    memory : str
        Memory of a task, as `8g`.
    after : str or None
        The layer whose chunk has to be done first.
    """

    name: str
    command: str
    range: str
    chunk: int
    threads: int
    memory: str
    after: str | None


def layers(job: Job) -> list[Layer]:
    """Return the layers of a job."""
    return [
        Layer(
            name=stage,
            command=shlex.join(job.command(stage, "#FRAMESPEC#", "openjd")),
            # A colon would be a staggered order and no step.
            range=write_frames(job.frames, "x"),
            chunk=job.chunk,
            threads=job.threads,
            memory=f"{job.memory_gib:g}g",
            after=job.stages[i - 1] if i else None,
        )
        for i, stage in enumerate(job.stages)
    ]


def outline_of(job: Job) -> Any:
    """Return pyoutline's job."""
    import outline  # noqa: PLC0415 - OpenCue's, and only where it is installed
    from outline.modules.shell import Shell  # noqa: PLC0415

    made = outline.Outline(job.name, frame_range=write_frames(job.frames, "x"))
    for layer in layers(job):
        shell = Shell(
            layer.name,
            command=layer.command,
            range=layer.range,
            chunk=layer.chunk,
            cores=layer.threads,
            threadable=layer.threads > 1,
            memory=layer.memory,
        )
        made.add_layer(shell)
        if layer.after:
            shell.depend_on(layer.after)
    return made


def main() -> int:
    """Send the job, or print it."""
    parser = job_parser(__doc__.partition("\n")[0])
    parser.add_argument("--show", default="testing", help="OpenCue's show; default: testing")
    parser.add_argument("--shot", default="default", help="default: default")
    options = parser.parse_args()
    job = read_job(parser, options)
    try:
        import outline.cuerun  # noqa: PLC0415
    except ImportError as error:
        print(
            f"Error: OpenCue's pyoutline is missing ({error}); install opencue_pyoutline and packaging.",
            file=sys.stderr,
        )
        return 3
    launcher = outline.cuerun.OutlineLauncher(
        outline_of(job), show=options.show, shot=options.shot, maxretries=job.retries
    )
    if options.print:
        print(launcher.serialize(use_pycuerun=False))
    else:
        launcher.launch(use_pycuerun=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
