"""Measure how fast the processors are, beside Blender's nodes, GEGL, Cycles and what the machine can do.

All sides are measured in one run, each frame in processes of its own. Frames and sample scenes are rendered
once and kept in build/bench/cache/speed; numbers, tables and plots go to build/bench/speed. BLENDER names
the Blender whose nodes are measured; without it that is the module bpy.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "build" / "bench" / "speed"

sys.path.insert(0, str(ROOT))

import speed_report  # noqa: E402
from speed_runs import PSFS, Case, cores  # noqa: E402

from figures.publish import publish  # noqa: E402
from figures.workshop import Drawing  # noqa: E402

VECTOR_SAMPLES = 32
SHUTTER = 0.5

PLOTS = {
    "speed": "Seconds over the largest circle of confusion",
    "speed_roofline": "Operations a second over operations a byte",
}
"""What the plots in the documentation show."""

Results = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Plan:
    """What a run measures.

    Parameters
    ----------
    sizes : tuple of str
        Frames, as ``1920x1080``.
    cases : tuple of Case
        What our processors do.
    memory : tuple of Case
        Of which the memory is measured.
    defocus : dict of str to tuple of int
        Radii at which Blender's Defocus node is run, by size.
    gegl : dict of str to tuple of int
        Radii at which GEGL's lens-blur is run, by size.
    scenes : tuple of str
        Sample scenes.
    percentage : int
        Of their size.
    cap : float
        Seconds that one run of another tool may take; what is expected to take longer is left out.
    repeats : int
        Runs of the other tools.
    """

    sizes: tuple[str, ...]
    cases: tuple[Case, ...]
    memory: tuple[Case, ...]
    defocus: dict[str, tuple[int, ...]]
    gegl: dict[str, tuple[int, ...]]
    scenes: tuple[str, ...]
    percentage: int = 100
    cap: float = 300.0
    repeats: int = 3


def full_plan() -> Plan:
    """Return what a measurement takes."""
    small, middle, large = "960x540", "1920x1080", "3840x2160"
    cases = [
        Case(size, "lens", psf, visibility, radius)
        for size in (small, middle)
        for psf in PSFS
        for visibility in ("none", "aperture")
        for radius in (4, 8, 16, 32, 64, 128)
    ]
    cases += [
        Case(large, "lens", "disc", visibility, radius)
        for visibility in ("none", "aperture")
        for radius in (8, 16, 32, 64, 128)
    ]
    cases += [
        Case(large, "lens", psf, visibility, 64)
        for psf in ("polygon", "lommel")
        for visibility in ("none", "aperture")
    ]
    for size in (small, middle, large):
        cases += [Case(size, "motion"), Case(size, "both", "disc", "aperture", 32)]
    memory = [
        Case(size, "lens", "disc", visibility, 64)
        for size in (small, middle, large)
        for visibility in ("none", "aperture")
    ]
    memory += [Case(large, "lens", psf, "aperture", 64) for psf in ("polygon", "lommel")]
    memory += [Case(large, "motion"), Case(large, "both", "disc", "aperture", 32)]
    return Plan(
        sizes=(small, middle, large),
        cases=tuple(cases),
        memory=tuple(memory),
        defocus={small: (4, 8, 16, 32, 64), middle: (8, 16, 32, 64), large: (16,)},
        gegl={small: (8, 32), middle: (8, 16, 32, 64), large: (32, 64)},
        scenes=(
            "carafe", "carafe_glass", "cube_and_sphere", "magnet", "mirror", "night_street", "still_life",
            "wheels",
        ),
    )  # fmt: skip


def quick_plan() -> Plan:
    """Return what a look takes: one small frame, and little of everything."""
    size = "480x270"
    cases = [Case(size, "lens", psf, visibility, 8) for psf in PSFS for visibility in ("none", "aperture")]
    cases += [Case(size, "lens", "disc", visibility, 16) for visibility in ("none", "aperture")]
    cases += [Case(size, "motion"), Case(size, "both", "disc", "aperture", 8)]
    return Plan(
        sizes=(size,),
        cases=tuple(cases),
        memory=(cases[0], cases[1]),
        defocus={size: (8, 16)},
        gegl={size: (8, 16)},
        scenes=("still_life",),
        percentage=25,
        cap=10.0,
    )


class Bench:
    """A run of the benchmark.

    Parameters
    ----------
    plan : Plan
        What is measured.
    filters : sequence of str
        Words that a case's name must all have, one of them being enough; empty for all cases.
    path : Path
        Where the results are kept after each part.
    """

    def __init__(self, plan: Plan, filters: Sequence[str], path: Path) -> None:
        self.plan, self.filters, self.path = plan, filters, path
        self.results: Results = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        # Frames that no case asks for need no rendering.
        self.sizes = tuple(size for size in plan.sizes if self.wanted(plan.cases, size))
        if not self.sizes:
            raise SystemExit("No case has these words; --list names them.")
        self.frames: dict[str, Path] = {}
        self.kernels = OUTPUT / "kernels"

    def wanted(self, cases: Sequence[Case], size: str | None = None) -> list[Case]:
        """Return the cases that are asked for, of one size or of all."""
        return [
            case
            for case in cases
            if size in (None, case.size)
            and (not self.filters or any(_has_words(case.name, words) for words in self.filters))
        ]

    def keep(self, name: str, values: Any) -> None:
        """Remember a part's results, on disk too."""
        self.results[name] = values
        part = self.path.with_suffix(".part")
        part.write_text(json.dumps(self.results, indent=1) + "\n", encoding="utf-8")
        part.replace(self.path)

    def prepare(self, parts: Sequence[str], *, again: bool) -> None:
        """Render what is not there, or all of it again."""
        sizes = [word for size in self.sizes for word in ("--size", size)]
        scenes = (
            [word for scene in self.plan.scenes for word in ("--scene", scene)] if "stage" in parts else []
        )
        command = [sys.executable, str(Path(__file__).with_name("speed_frames.py")), *sizes, *scenes]
        command += ["--percentage", str(self.plan.percentage), *(["--again"] if again else [])]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        folders = json.loads(done.stdout.strip().splitlines()[-1])
        self.frames = {name: Path(folder) for name, folder in folders.items()}
        self.keep("frames", {size: self.facts(size) for size in self.sizes})

    def facts(self, name: str) -> dict[str, Any]:
        """Return what is known of a frame or a sample scene."""
        return dict(json.loads((self.frames[name] / "facts.json").read_text(encoding="utf-8")))

    def job(self, kind: str, size: str, cases: Sequence[Case] = (), **more: Any) -> Iterator[Results]:
        """Run a job on a frame in a fresh process, and yield its results as they come."""
        job = {
            "kind": kind,
            "samples": str(self.frames[size] / "samples.exr"),
            "facts": self.facts(size),
            "cases": [asdict(case) for case in cases],
            **more,
        }
        return self.child(job, self.kernels)

    def child(self, job: Results, kernels: Path) -> Iterator[Results]:
        """Run a job of `speed_runs` with compiled kernels kept in a folder."""
        script = Path(__file__).with_name("speed_runs.py")
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(kernels)}
        return _results([sys.executable, str(script), json.dumps(job)], environment)

    # The parts.

    def grid(self) -> None:
        """Time our processors."""
        found = []
        for size in self.sizes:
            cases = self.wanted(self.plan.cases, size)
            for number, result in enumerate(self.job("grid", size, cases) if cases else ()):
                found.append(result)
                busy = f"cores {100.0 * result['busy']:.0f} % busy"
                say(f"{cases[number].name}: {result['seconds']:.3f} s, {busy}")
        self.keep("ours", found)

    def memory(self) -> None:
        """Measure memory, each case in a process of its own."""
        cases = self.wanted(self.plan.memory)
        # Compiling takes memory too, and is not what is measured.
        smallest = self.sizes[0]
        list(self.job("cold", smallest, [Case(smallest, *_rest(case)) for case in cases]))
        found = []
        for case in cases:
            found += list(self.job("memory", case.size, [case]))
            say(f"{case.name}: {found[-1]['peak_bytes'] / 1e6:.0f} MB")
        self.keep("memory", found)

    def peers(self) -> None:
        """Time Blender's Defocus and Vector Blur nodes, and GEGL's lens-blur."""
        found = []
        for size in self.sizes:
            found += [result | {"size": size} for result in self._nodes(size)]
            if shutil.which("gegl"):
                found += self._gegl(size)
        if not shutil.which("gegl"):
            say("GEGL is not installed (Debian: apt-get install gegl): it is left out")
        self.keep("peers", found)

    def _nodes(self, size: str) -> Iterator[Results]:
        columns, rows = (int(number) for number in size.split("x"))
        facts = self.facts(size)
        # The node's lens moves to focus and Cycles' does not: with this its circles are Cycles'.
        breathing = facts["focus_distance"] / (facts["focus_distance"] - facts["focal_length"])
        runs = [
            {
                "name": f"defocus r{radius}",
                "node": "defocus",
                "f_stop": facts["f_stop"] * facts["largest_radius"] / radius * breathing,
                "max_blur": radius,
                "cost": radius**2,
            }
            for radius in self.plan.defocus[size]
        ]
        vector = {"name": "vector blur", "node": "vector", "samples": VECTOR_SAMPLES, "shutter": SHUTTER}
        runs.append(vector | {"cost": 0})
        job = {
            "passes": str(self.frames[size] / "passes.exr"),
            "columns": columns,
            "rows": rows,
            "facts": facts,
            "runs": runs,
            "cap": self.plan.cap,
            "repeats": self.plan.repeats,
            "enough": self.plan.cap / 10.0,
        }
        script = str(Path(__file__).with_name("speed_nodes.py"))
        program = os.environ.get("BLENDER")
        start = [program, "-b", "--factory-startup", "--python-exit-code", "1", "--python"] if program else [
            sys.executable]  # fmt: skip
        with tempfile.TemporaryDirectory(prefix="potmesil_") as folder:
            path = Path(folder) / "job.json"
            path.write_text(json.dumps(job), encoding="utf-8")
            environment = {**os.environ, "BLENDER_USER_RESOURCES": str(ROOT / "build" / "bench" / "blender")}
            for result in _results([*start, script, *(["--"] if program else []), str(path)], environment):
                told = f"{result['seconds']:.2f} s" if "seconds" in result else "left out"
                say(f"{size} {result['name']}: {told}")
                yield result

    def _gegl(self, size: str) -> list[Results]:
        """Time GEGL, less what reading and writing the same files take."""
        folder = self.frames[size]
        mask = ["aux=[", "gegl:exr-load", f"path={folder / 'mask.exr'}", "]"]
        with tempfile.TemporaryDirectory(prefix="potmesil_") as scratch:
            start = ["gegl", str(folder / "source.exr"), "-o", str(Path(scratch) / "result.exr"), "--"]
            # Laying the mask over the picture reads the same two files and computes next to nothing.
            empty = statistics.median(_gegl_seconds([*start, "gegl:over", *mask]) for _ in range(3))
            found = []
            for radius in self.plan.gegl[size]:
                command = [*start, "gegl:lens-blur", f"radius={radius}", "linear-mask=true", *mask]
                times = [_gegl_seconds(command)]
                while len(times) < self.plan.repeats and sum(times) < self.plan.cap / 10.0:
                    times.append(_gegl_seconds(command))
                seconds = max(statistics.median(times) - empty, 0.0)
                found.append(
                    {
                        "name": f"gegl r{radius}",
                        "size": size,
                        "seconds": seconds,
                        "runs": len(times),
                        "empty": empty,
                    }
                )
                say(f"{size} GEGL r{radius}: {seconds:.2f} s")
        return found

    def stage(self) -> None:
        """Time reading, processing and writing on the sample scenes, beside their pinhole render."""
        found = []
        for scene in self.plan.scenes:
            with tempfile.TemporaryDirectory(prefix="potmesil_") as scratch:
                job = {
                    "kind": "stage",
                    "samples": str(self.frames[scene] / "samples.exr"),
                    "target": str(Path(scratch) / "result.exr"),
                    "runs": 3,
                }
                known = {"scene": scene} | self.facts(scene)
                found += [result | known for result in self.child(job, self.kernels)]
            one = found[-1]
            seconds = one["read"] + one["process"] + one["write"]
            say(f"{scene}: {seconds:.2f} s after a render of {one['pinhole_seconds']:.2f} s")
        self.keep("stage", found)

    def cold(self) -> None:
        """Time the first frame of a fresh process, with no compiled kernels and with all of them."""
        size = self.sizes[0]
        found = []
        for case in (
            Case(size, "lens", "disc", "aperture", 16),
            Case(size, "lens", "disc", "none", 16),
            Case(size, "motion"),
            Case(size, "both", "disc", "aperture", 16),
        ):
            with tempfile.TemporaryDirectory(prefix="potmesil_") as kernels:
                for cache in ("empty", "full"):
                    job = {
                        "kind": "cold",
                        "samples": str(self.frames[size] / "samples.exr"),
                        "facts": self.facts(size),
                        "cases": [asdict(case)],
                    }
                    found += [result | {"cache": cache} for result in self.child(job, Path(kernels))]
                    one = found[-1]
                    told = f"imports {one['imports']:.2f} s, first {one['first']:.2f} s"
                    say(f"{case.name}, cache {cache}: {told}")
        self.keep("cold", found)

    def roofline(self) -> None:
        """Measure the machine's limits, count what the frames need, and look at the machine code."""
        size = self.sizes[0]
        limits = next(iter(self.job("machine", size)))["limits"]
        self.keep("limits", limits)
        ours = self.results.get("ours", [])
        instants = {Case(**one["case"]).name: sum(one["instants"]) for one in ours}
        work = []
        for frame in self.sizes:
            cases = [Case(**one["case"]) for one in ours if one["case"]["size"] == frame]
            work += list(self.job("work", frame, cases, instants=instants)) if cases else []
        self.keep("work", work)
        cases = [Case(size, "lens", psf, visibility, 8) for psf, visibility in (
            ("disc", "none"), ("lommel", "none"), ("disc", "aperture"), ("lommel", "aperture"))]  # fmt: skip
        cases += [Case(size, "motion")]
        with tempfile.TemporaryDirectory(prefix="potmesil_") as kernels:
            job = {
                "kind": "cold",
                "samples": str(self.frames[size] / "samples.exr"),
                "facts": self.facts(size),
                "cases": [asdict(case) for case in cases],
                "code": True,
            }
            self.keep("code", next(one["code"] for one in self.child(job, Path(kernels)) if "code" in one))


PARTS: dict[str, Callable[[Bench], None]] = {
    "grid": Bench.grid,
    "memory": Bench.memory,
    "peers": Bench.peers,
    "stage": Bench.stage,
    "cold": Bench.cold,
    "roofline": Bench.roofline,
}


def _rest(case: Case) -> tuple[str, str, str, int]:
    return case.stage, case.psf, case.visibility, case.radius


def _has_words(name: str, words: str) -> bool:
    found = name.split()
    return all(word in found for word in words.split())


def _results(command: Sequence[str], environment: dict[str, str]) -> Iterator[Results]:
    """Run a program and yield the results that it prints, among whatever else it prints."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as program:
        assert program.stdout is not None
        for line in program.stdout:
            if line.startswith("RESULT "):
                yield json.loads(line[len("RESULT ") :])
    if program.returncode:
        raise SystemExit(f"{Path(command[0]).name} ended with {program.returncode}.")


def _gegl_seconds(command: Sequence[str]) -> float:
    started = time.perf_counter()
    threads = {"GEGL_THREADS": str(cores()), "GEGL_USE_OPENCL": "no"}
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, **threads})
    return time.perf_counter() - started


def machine() -> Results:
    """Name the machine in words."""
    model, memory = platform.processor() or platform.machine(), 0.0
    cpu, info = Path("/proc/cpuinfo"), Path("/proc/meminfo")
    if cpu.exists():
        facts = [line.partition(":") for line in cpu.read_text(encoding="utf-8").splitlines()]
        model = next((value.strip() for name, _, value in facts if name.strip() == "model name"), model)
        flags = next((value.split() for name, _, value in facts if name.strip() == "flags"), [])
        widest = next((name for name in ("avx512f", "avx2", "avx") if name in flags), "")
        model += {"avx512f": " with AVX-512", "avx2": " with AVX2", "avx": " with AVX", "": ""}[widest]
    if info.exists():
        memory = 1024 * int(info.read_text(encoding="ascii").split()[1])
    return {
        "processor": model,
        "cores": cores(),
        "memory_bytes": memory,
        "system": platform.system(),
        "python": platform.python_version(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan,
    }


def say(text: str) -> None:
    """Tell how far the work is."""
    print(text, file=sys.stderr, flush=True)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small frame: a look, and no measurement")
    parser.add_argument("--part", action="append", choices=PARTS, help="only this; may be repeated")
    parser.add_argument(
        "--case",
        action="append",
        metavar="WORDS",
        help="only cases with these words, such as '1920x1080 disc r32'; may be repeated",
    )
    parser.add_argument("--list", action="store_true", help="name the cases")
    parser.add_argument(
        "--again", action="store_true", help="render again what is kept: Cycles' times are those of this run"
    )
    parser.add_argument("--prepare", action="store_true", help="render what is missing, and stop")
    parser.add_argument(
        "--report", action="store_true", help="measure nothing: tables and plots of what is kept"
    )
    parser.add_argument("--docs", action="store_true", help="put tables and plots into the documentation")
    options = parser.parse_args()
    if options.docs and (options.quick or options.case):
        parser.error("only measurements of all cases can go into the documentation")
    plan = quick_plan() if options.quick else full_plan()
    if options.list:
        print("\n".join(case.name for case in plan.cases))
        return 0
    OUTPUT.mkdir(parents=True, exist_ok=True)
    # A part of the cases has no place in the documentation.
    stem = "part" if options.case else "quick" if options.quick else "results"
    bench = Bench(plan, options.case or (), OUTPUT / f"{stem}.json")
    parts = options.part or list(PARTS)
    if not options.report:
        known = machine()
        bench.prepare(parts, again=options.again)
        if options.prepare:
            return 0
        bench.keep("machine", known)
        for name in parts:
            say(f"== {name}")
            PARTS[name](bench)
    text = speed_report.report(bench.results)
    (OUTPUT / f"{stem}.md").write_text(text, encoding="utf-8")
    plots = speed_report.plots(bench.results, OUTPUT, stem)
    print(text)
    if options.docs:
        shown = "\n\n".join(f"![{PLOTS[name]}](images/figures/{name}.png)" for name in plots)
        for name, path in plots.items():
            table = f"{shown}\n\n{text}" if name == "speed" else ""
            for written in publish(name, Drawing(path, {}, table)):
                say(str(written.relative_to(ROOT)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
