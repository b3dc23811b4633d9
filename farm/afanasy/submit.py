"""Submit a job to CGRU's Afanasy: a block for each stage, each task of the second after its own of the first.

python -m farm.afanasy.submit shot.blend --frames 1-99 --samples /s/####.exr --output /p/####.exr

from the project's folder, in CGRU's environment, which brings the module af. `--print` writes the job as JSON
and needs none. The parser is Afanasy's own `generic`.
"""

from __future__ import annotations

import json
import shlex
import sys
from typing import TYPE_CHECKING

from farm.stages import Job, job_parser, read_job, write_frames

if TYPE_CHECKING:
    from typing import Any


def blocks(job: Job) -> list[dict[str, Any]]:
    """Return the blocks of a job, as Afanasy's server reads them.

    A block has a list of tasks and is not `numeric`: any frames will do, and the parser takes a percentage as
    that of the whole task. In a numeric block it would be a frame's.

    Parameters
    ----------
    job : Job
        What to make.
    """
    return [
        {
            "name": stage,
            "service": "generic",
            "parser": "generic",
            # A task's own command, its frames, takes the place of @#@.
            "command": shlex.join(job.command(stage, "@#@", "afanasy")),
            "errors_retries": job.retries,
            "errors_task_same_host": 1,
            "need_memory": int(job.memory_gib * 1024),
            **({"tasks_depend_mask": job.stages[i - 1]} if i else {}),
            "tasks": [{"name": frames, "command": frames} for frames in map(write_frames, job.chunks())],
        }
        for i, stage in enumerate(job.stages)
    ]


def job_of(job: Job) -> Any:
    """Return af's job."""
    import af  # type: ignore[import-not-found]  # noqa: PLC0415 - CGRU's, and only in its environment

    made = af.Job(job.name)
    for data in blocks(job):
        block = af.Block(data["name"], data["service"])
        block.setParser(data["parser"])
        block.setCommand(data["command"])
        block.setErrorsRetries(data["errors_retries"])
        block.setErrorsTaskSameHost(data["errors_task_same_host"])
        block.setNeedMemory(data["need_memory"])
        if "tasks_depend_mask" in data:
            block.setTasksDependMask(data["tasks_depend_mask"])
        for each in data["tasks"]:
            task = af.Task(each["name"])
            task.setCommand(each["command"])
            block.tasks.append(task)
        made.blocks.append(block)
    return made


def main() -> int:
    """Send the job, or print it."""
    parser = job_parser(__doc__.partition("\n")[0])
    options = parser.parse_args()
    job = read_job(parser, options)
    if options.print:
        print(json.dumps({"job": {"name": job.name, "blocks": blocks(job)}}, indent=1))
        return 0
    try:
        made = job_of(job)
    except ImportError as error:
        print(f"Error: CGRU's Python is missing ({error}); run this in its environment.", file=sys.stderr)
        return 3
    sent, _ = made.send()
    if not sent:
        print("Error: Afanasy's server did not take the job.", file=sys.stderr)
        return 4
    return 0


if __name__ == "__main__":
    sys.exit(main())
