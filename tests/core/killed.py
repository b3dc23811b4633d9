"""Writers that are killed, or write at once: forked by a process ``killed.py KIND FOLDER COUNT``.

It has everything imported and compiled, so that a writer's time is that of its work. Every file must be one
of those that a whole run writes, and parts those of dead writers; it prints what it saw.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import itertools
import json
import os
import random
import re
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import png

from potmesil_addon import jit

# As the tests have it, before a kernel's module is imported.
jit.set_cache_directory(Path(os.environ["NUMBA_CACHE_DIR"]))

from potmesil_addon import cli, exr, files  # noqa: E402 - as said

PARTS = re.compile(r"\..*\.(\d+)\.part\.(?:exr|png|json)")
VERSIONS = 2


class Series:
    """A folder, what writes into it, and what its files may hold."""

    def __init__(self, folder: Path, work: Callable[[int], object]) -> None:
        self.folder = folder
        self.work = work
        self.whole: set[tuple[str, str]] = set()
        self.spans: list[float] = []
        for version in range(VERSIONS):
            started = time.perf_counter()
            os.waitpid(self.start(version), 0)
            self.spans.append(time.perf_counter() - started)
            self.whole |= {(path.name, digest(path)) for path in folder.iterdir()}

    def start(self, version: int) -> int:
        pid = os.fork()
        if not pid:
            try:
                with contextlib.redirect_stdout(io.StringIO()):
                    self.work(version)
            finally:
                os._exit(0)
        return pid

    def kill(self, kills: int, seed: int) -> dict[str, int]:
        """Kill writers, and look after each."""
        moments = random.Random(seed)
        names = {name for name, _ in self.whole}
        assert names
        # A mask may be black in all versions.
        assert len(self.whole) > len(names)
        seen = {"kills": 0, "parts": 0, "old": 0, "new": 0, "missing": 0}
        for number in itertools.count():
            if seen["kills"] == kills:
                return seen
            if number % 4 == 0:
                # Some begin with an empty folder.
                for path in self.folder.iterdir():
                    path.unlink()
            before = {path.name: path.stat().st_ino for path in self.folder.iterdir()}
            pid = self.start(number % VERSIONS)
            time.sleep(moments.uniform(0.0, max(self.spans)))
            os.kill(pid, signal.SIGKILL)
            _, status = os.waitpid(pid, 0)
            seen["kills"] += os.WIFSIGNALED(status)
            for path in self.folder.iterdir():
                if part := PARTS.fullmatch(path.name):
                    assert int(part[1]) == pid, f"{path.name} is a part of nobody who was killed"
                    seen["parts"] += 1
                    path.unlink()
                else:
                    assert (path.name, digest(path)) in self.whole, f"{path.name} is not whole"
                    seen["old" if before.get(path.name) == path.stat().st_ino else "new"] += 1
            seen["missing"] += len(names) - sum(1 for _ in self.folder.iterdir())
        raise AssertionError


def digest(path: Path) -> str:
    """Return a digest of what a file holds: of a picture its pixels, of a report all but what it took."""
    if path.suffix == ".json":
        report = json.loads(path.read_text())
        return repr([(key, value) for key, value in sorted(report.items()) if "seconds" not in key])
    if path.suffix == ".png":
        chunks = list(png.Reader(bytes=path.read_bytes()).chunks())
        assert chunks[-1] == (b"IEND", b"")
        # Blender writes the time into a text.
        return hashlib.blake2b(b"".join(content for kind, content in chunks if kind == b"IDAT")).hexdigest()
    with OpenEXR.File(str(path), separate_channels=True) as file:
        found = hashlib.blake2b()
        for part in file.parts:
            for name, channel in sorted(part.channels.items()):
                found.update(name.encode() + channel.pixels.tobytes())
    return found.hexdigest()


def export(folder: Path) -> Series:
    """What an export ends with: a picture and an annotated render, of other pixels in each version."""
    noise = np.random.default_rng(1).random((VERSIONS, 128, 160, 4), dtype=np.float32)
    out = folder / "out"
    out.mkdir()
    for version in range(VERSIONS):
        exr.write_picture(folder / f"render_{version}.exr", noise[version], {})

    def work(version: int) -> None:
        for frame in range(2):
            exr.annotate(folder / f"render_{version}.exr", out / f"samples_{frame:04d}.exr", {})
            exr.write_picture(out / f"picture_{frame:04d}.exr", noise[version], {})

    return Series(out, work)


def process(folder: Path) -> Series:
    """The whole command, with maps and a report, of another f-stop in each version."""
    rows, columns = 24, 32
    pixels = np.random.default_rng(2).random((rows, columns, 4), dtype=np.float32)
    pixels[..., 3] = 1.0
    depth = np.where(np.arange(columns) < columns // 2, 1.0, 5.0).astype(np.float32)
    channels = {name: np.ascontiguousarray(pixels[..., n]) for n, name in enumerate("RGBA")}
    channels["Z"] = np.repeat(depth[np.newaxis], rows, axis=0)
    for frame in (1, 2):
        OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, channels).write(
            str(folder / f"in.{frame:04d}.exr")
        )
    out = folder / "out"
    out.mkdir()

    def work(version: int) -> int:
        options = {
            "--output": "out.####.exr",
            "--mask": "mask.####.png",
            "--error-map": "error.####.exr",
            "--report": "report.####.json",
        }
        words = [word for name, value in options.items() for word in (name, str(out / value))]
        lens = ["--focal-length", "50", "--focus-distance", "1", "--fstop", str(2.0 + version)]
        fixed = ["--sensor-width", "36", "--existing", "overwrite", "--threads", "1", "--progress", "none"]
        return cli.main(["process", str(folder / "in.####.exr"), *words, *lens, *fixed])

    # Kernels are loaded here and not in each writer.
    with contextlib.redirect_stdout(io.StringIO()):
        assert work(0) == 0
    for path in out.iterdir():
        path.unlink()
    return Series(out, work)


def race(folder: Path, count: int) -> dict[str, int]:
    """Let two machines write one frame again and again, and read it all the while."""
    noise = np.random.default_rng(3).random((VERSIONS, 96, 64, 4), dtype=np.float32)
    path = folder / "frame.exr"
    versions = []
    for version in range(VERSIONS):
        exr.write_picture(path, noise[version], {})
        versions.append(digest(path))
    writers = []
    for version in range(VERSIONS):
        pid = os.fork()
        if not pid:
            try:
                files.platform.node = lambda number=version: f"machine {number}"
                for _ in range(count):
                    exr.write_picture(path, noise[version], {})
            except BaseException:
                os._exit(1)
            os._exit(0)
        writers.append(pid)
    seen = {"statuses": 0, "parts": 0, "changes": 0, "reads": 0}
    last = -1
    while writers:
        version = versions.index(digest(path))
        seen["changes"] += version != last
        seen["reads"] += 1
        last = version
        for pid in list(writers):
            ended, status = os.waitpid(pid, os.WNOHANG)
            if ended:
                writers.remove(pid)
                seen["statuses"] += abs(status)
    seen["parts"] = sum(1 for _ in folder.iterdir()) - 1
    return seen


def main(arguments: list[str]) -> None:
    """Run one series, and print what was seen."""
    kind, folder, count = arguments
    jit.set_thread_count(1)
    if kind == "race":
        print(json.dumps(race(Path(folder), int(count))))
        return
    kinds: dict[str, Any] = {"export": export, "process": process}
    print(json.dumps(kinds[kind](Path(folder)).kill(int(count), seed=int(count))))


if __name__ == "__main__":
    main(sys.argv[1:])
