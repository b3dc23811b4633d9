"""Run our processors in a fresh process and say what they took: seconds, processor time, memory.

`speed.py` starts it with a job as JSON; it prints a line of JSON for each result. Nothing but the standard
library is imported before a job begins, since one of them times the imports.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent

PSFS = ("disc", "polygon", "lommel")
STAGES = ("lens", "motion", "both")

_BLADES = 6
_BLADE_ROTATION = 0.2

_ENOUGH = 3.0
"""Seconds of measuring after which a case is not repeated, once it has had its least number of runs."""

_MOST_RUNS = 7
_LEAST_RUNS = 3
_SLOW = 15.0
"""Seconds of a first run from which one more is all."""

_VERY_SLOW = 60.0
"""Seconds of a first run from which it counts itself: loading the kernels is little beside it."""


@dataclass(frozen=True, slots=True)
class Case:
    """A frame to be made.

    Parameters
    ----------
    size : str
        Columns and rows, as ``1920x1080``.
    stage : {"lens", "motion", "both"}
        Which processors run.
    psf : {"disc", "polygon", "lommel"}
        Kind of point-spread function; ``polygon`` is the disc of an iris with blades.
    visibility : {"none", "aperture"}
        What the focus processor does about what is hidden.
    radius : int
        Largest radius in pixels of a circle of confusion; 0 without a lens.
    """

    size: str
    stage: str = "lens"
    psf: str = "disc"
    visibility: str = "none"
    radius: int = 0

    @property
    def name(self) -> str:
        """For filters and reports."""
        if self.stage == "motion":
            return f"{self.size} motion"
        return f"{self.size} {self.stage} {self.psf} {self.visibility} r{self.radius}"

    @property
    def pixels(self) -> int:
        """Pixels of the frame."""
        return math.prod(int(number) for number in self.size.split("x"))


def settings_of(case: Case, facts: dict[str, Any]) -> Any:
    """Return the processor's settings for a case.

    Parameters
    ----------
    case : Case
        The case.
    facts : dict
        Of the frame: an f-stop, and the radius of the largest circle that it gives.

    Returns
    -------
    ProcessSettings
        The f-stop is such that the largest circle has the case's radius.
    """
    from potmesil_addon.process import ProcessSettings  # noqa: PLC0415
    from potmesil_addon.psf import PsfSettings  # noqa: PLC0415
    from potmesil_addon.samples import LensAttributes  # noqa: PLC0415

    lens = LensAttributes()
    if case.stage != "motion":
        f_stop = facts["f_stop"] * facts["largest_radius"] / case.radius
        blades = _BLADES if case.psf == "polygon" else 0
        lens = LensAttributes(f_stop=f_stop, blades=blades, blade_rotation=_BLADE_ROTATION)
    return ProcessSettings(
        use_lens=case.stage != "motion",
        use_motion=case.stage != "lens",
        lens=lens,
        psf=PsfSettings(kind="lommel" if case.psf == "lommel" else "disc"),
        visibility="aperture" if case.visibility == "aperture" else "none",
        backend="numba",
    )


def _grid(job: dict[str, Any]) -> None:
    """Time cases on one frame, each after a run that does not count."""
    from potmesil_addon import exr  # noqa: PLC0415
    from potmesil_addon.process import process  # noqa: PLC0415
    from potmesil_addon.progress import run  # noqa: PLC0415

    samples = exr.read_samples(Path(job["samples"]))
    for values in job["cases"]:
        case = Case(**values)
        settings = settings_of(case, job["facts"])
        wall: list[float] = []
        cpu: list[float] = []
        # The first run loads kernels and touches memory, and does not count.
        first, spent, result = _timed(lambda settings=settings: run(process(samples, settings)))
        if first > _VERY_SLOW:
            wall, cpu = [first], [spent]
        while not _settled(wall, first):
            seconds, spent, result = _timed(lambda settings=settings: run(process(samples, settings)))
            wall.append(seconds)
            cpu.append(spent)
        _say(
            case=asdict(case),
            seconds=statistics.median(wall),
            least_seconds=min(wall),
            cpu_seconds=statistics.median(cpu),
            busy=sum(cpu) / sum(wall) / cores(),
            runs=len(wall),
            instants=[report["instants"] for report in result.report["motion"]],
        )


def _settled(seconds: list[float], first: float) -> bool:
    """Return whether a case has had its runs."""
    if first > _SLOW:
        return bool(seconds)
    if len(seconds) < _LEAST_RUNS:
        return False
    return len(seconds) >= _MOST_RUNS or sum(seconds) > _ENOUGH


def _memory(job: dict[str, Any]) -> None:
    """Measure the most memory that one frame takes above what is there once its samples are read."""
    from potmesil_addon import exr  # noqa: PLC0415
    from potmesil_addon.process import process  # noqa: PLC0415
    from potmesil_addon.progress import run  # noqa: PLC0415

    case = Case(**job["cases"][0])
    samples = exr.read_samples(Path(job["samples"]))
    before = resident()
    reset = _forget_peak()
    result = run(process(samples, settings_of(case, job["facts"])))
    _say(
        case=asdict(case),
        input_bytes=before,
        peak_bytes=peak_resident() - before,
        # The picture itself is a part of it.
        picture_bytes=result.picture.nbytes + result.guessed.nbytes + result.predicted_error.nbytes,
        exact=reset,
    )


def _stage(job: dict[str, Any]) -> None:
    """Time what the extension does after a render with the file's settings: read, process, write."""
    from potmesil_addon import exr  # noqa: PLC0415
    from potmesil_addon.pictures import write_result  # noqa: PLC0415
    from potmesil_addon.process import ProcessSettings, process  # noqa: PLC0415
    from potmesil_addon.progress import run  # noqa: PLC0415

    source, target = Path(job["samples"]), Path(job["target"])
    parts: list[tuple[float, float, float]] = []
    # The first one loads the kernels.
    for _ in range(1 + job["runs"]):
        reading, _, samples = _timed(lambda: exr.read_samples(source))
        working, _, result = _timed(lambda samples=samples: run(process(samples, ProcessSettings())))
        writing, _, _ = _timed(lambda samples=samples, result=result: write_result(target, result, samples))
        parts.append((reading, working, writing))
    target.unlink()
    read, work, write = (statistics.median(part) for part in zip(*parts[1:], strict=True))
    _say(
        read=read, process=work, write=write, size=result.report["size"], motion=bool(result.report["motion"])
    )


def _cold(job: dict[str, Any]) -> None:
    """Time the imports and the first frames of a process, each case's first and second."""
    started = time.perf_counter()
    from potmesil_addon import exr  # noqa: PLC0415
    from potmesil_addon.process import process  # noqa: PLC0415
    from potmesil_addon.progress import run  # noqa: PLC0415

    imports = time.perf_counter() - started
    samples = exr.read_samples(Path(job["samples"]))
    for values in job["cases"]:
        case = Case(**values)
        settings = settings_of(case, job["facts"])
        first, _, _ = _timed(lambda settings=settings: run(process(samples, settings)))
        later = min(_timed(lambda settings=settings: run(process(samples, settings)))[0] for _ in range(3))
        _say(case=values, imports=imports, first=first, later=later)
    if job.get("code"):
        from machine_code import report  # noqa: PLC0415

        _say(code=report("potmesil_addon"))


def _machine(_job: dict[str, Any]) -> None:
    from roofline import measured_limits  # noqa: PLC0415

    _say(limits=asdict(measured_limits()))


def _work(job: dict[str, Any]) -> None:
    from roofline import work_of  # noqa: PLC0415

    from potmesil_addon import exr  # noqa: PLC0415

    samples = exr.read_samples(Path(job["samples"]))
    for values in job["cases"]:
        case = Case(**values)
        work = work_of(samples, settings_of(case, job["facts"]), job["instants"].get(case.name, 0))
        _say(case=values, work=asdict(work))


def _timed(make: Any) -> tuple[float, float, Any]:
    """Return the seconds and the processor seconds of all threads that something takes, and what it makes."""
    started, cpu = time.perf_counter(), time.process_time()
    made = make()
    return time.perf_counter() - started, time.process_time() - cpu, made


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def resident() -> int:
    """Return the memory in bytes that this process has now."""
    return _status("VmRSS")


def peak_resident() -> int:
    """Return the most memory in bytes that this process has had since `_forget_peak`."""
    return _status("VmHWM")


def _status(name: str) -> int:
    """Return a number of bytes that Linux knows of this process."""
    for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
        if line.startswith(f"{name}:"):
            return 1024 * int(line.split()[1])
    raise OSError(f"The system does not tell {name}.")


def _forget_peak() -> bool:
    """Let the peak begin anew: reading a file takes more for a moment. Return whether the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return False
    return True


def _say(**values: Any) -> None:
    print("RESULT " + json.dumps(values), flush=True)


JOBS = {
    "grid": _grid,
    "memory": _memory,
    "stage": _stage,
    "cold": _cold,
    "machine": _machine,
    "work": _work,
}

if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    asked = json.loads(sys.argv[1])
    JOBS[asked["kind"]](asked)
