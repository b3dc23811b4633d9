"""A process beside Blender that makes previews and finished pictures while the window stays free.

``python -m potmesil_addon.worker FOLDER [KERNELS]`` reads requests from a file in the folder, a line of JSON
each, and appends replies to another; pictures are files of their own. A file that grows can be looked at
without waiting on every system, which a pipe cannot. The newest request wins: work on an older one ends at
its next step. It ends when it is told to, when the process that started it is gone, or when nothing has been
heard for a while; in the last two cases nobody else is left to remove the folder, and it does so.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sys
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any, Final

import numpy as np

from .errors import PotmesilError
from .samples import Float32Array, Samples

REQUESTS: Final = "requests.jsonl"
REPLIES: Final = "replies.jsonl"

SILENCE: Final = 60.0
"""Seconds without a word after which the other side is taken for gone."""

_NAP: Final = 0.003
_LONG_NAP: Final = 0.02
_AWAKE: Final = 2.0
_PATIENCE: Final = 15
"""How much the window goes before, as `os.nice` counts it: drawn by software, it wants the processors too."""


class Inbox:
    """The lines that another process appends to a file.

    Parameters
    ----------
    path : Path
        The file; it is made where it is missing.
    """

    def __init__(self, path: Path) -> None:
        path.touch()
        self._file = path.open("rb", buffering=0)
        self._rest = b""

    def lines(self) -> list[bytes]:
        """Return the lines that were completed since the last call, without waiting."""
        *lines, self._rest = (self._rest + (self._file.read() or b"")).split(b"\n")
        return lines

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class Outbox:
    """Appends lines to a file for another process.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("ab", buffering=0)

    def send(self, message: dict[str, Any] | None = None) -> None:
        """Append a message, or an empty line as a sign of life."""
        line = b"" if message is None else json.dumps(message).encode()
        self._file.write(line + b"\n")

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class Worker:
    """Answers requests.

    Parameters
    ----------
    folder : Path
        Where requests come from, and replies and pictures go to.
    kernels : Path or None
        Where compiled kernels are kept, see `jit.set_cache_directory`; None leaves it to numba.
    """

    def __init__(self, folder: Path, kernels: Path | None = None) -> None:
        self._folder, self._kernels = folder, kernels
        self._parent = os.getppid()
        self._inbox, self._outbox = Inbox(folder / REQUESTS), Outbox(folder / REPLIES)
        self._heard = time.monotonic()
        self._newest: dict[str, Any] | None = None
        self._ended = self._orphaned = self._prepared = False
        self._file: tuple[str, list[int]] | None = None
        self._whole: Samples | None = None
        self._previewer: Any = None
        self._warm: list[Any] = []
        self._maps = 0

    def run(self) -> None:
        """Work until told to end, or until nothing is heard any more."""
        self._outbox.send({"ready": True})
        worked = time.monotonic()
        while self._listen():
            request, self._newest = self._newest, None
            if request is None:
                time.sleep(_NAP if time.monotonic() - worked < _AWAKE else _LONG_NAP)
                continue
            self._answer(request)
            worked = time.monotonic()
        if self._orphaned:
            self._inbox.close()
            self._outbox.close()
            shutil.rmtree(self._folder, ignore_errors=True)

    def _listen(self) -> bool:
        """Take what was asked since the last time, of which the newest counts; return whether to go on."""
        now = time.monotonic()
        lines = self._inbox.lines()
        if lines:
            self._heard = now
        for line in lines:
            if line:
                self._newest = json.loads(line)
        if (self._newest or {}).get("kind") == "end":
            self._ended = True
        # Where a process that ends hands its children on, a new parent is known at once.
        elif now - self._heard > SILENCE or os.getppid() != self._parent:
            self._ended = self._orphaned = True
        return not self._ended

    def _answer(self, request: dict[str, Any]) -> None:
        started = time.perf_counter()
        try:
            steps = self._steps(request)
            while True:
                try:
                    next(steps)
                except StopIteration as stop:
                    reply = stop.value
                    break
                if not self._listen() or self._newest is not None:
                    steps.close()
                    return
        except PotmesilError as error:
            reply = {"error": str(error)}
        except MemoryError:
            reply = {"error": "There is not enough memory for this picture."}
        if reply is not None:
            self._outbox.send({"id": request["id"], "seconds": time.perf_counter() - started, **reply})

    def _steps(self, request: dict[str, Any]) -> Generator[float, None, dict[str, Any] | None]:
        """Do what is asked, in steps between which newer requests are looked for."""
        self._prepare()
        # Imported here, since kernels take their folder from the moment of their import.
        from .preview import Previewer, settings_from_json  # noqa: PLC0415
        from .process import process  # noqa: PLC0415

        kind = request["kind"]
        if kind == "stop":
            return None
        whole = kind == "full"
        settings = settings_from_json(request["settings"])
        fresh = self._load(request, whole=whole)
        yield 0.0
        if whole:
            assert self._whole is not None
            result = yield from process(self._whole, settings)
            return {**self._kept(result.picture, "full"), "quality": result.report["quality"]}
        assert isinstance(self._previewer, Previewer)
        if fresh or self._warm != [settings.use_motion, settings.use_lens, settings.psf.kind]:
            self._warm = [settings.use_motion, settings.use_lens, settings.psf.kind]
            self._previewer.warm_up(settings)
        picture, tier = self._previewer.picture(settings)
        return {**self._kept(picture, "preview"), "tier": [tier.factor, tier.visibility]}

    def _prepare(self) -> None:
        """Say where compiled kernels are, and tell the window of each that is not there yet."""
        if self._prepared:
            return
        self._prepared = True
        from . import jit  # noqa: PLC0415 - imports numba

        if self._kernels is not None:
            jit.set_cache_directory(self._kernels)
        jit.on_compile(lambda name: self._outbox.send({"compiling": name}))

    def _load(self, request: dict[str, Any], *, whole: bool) -> bool:
        """Read the samples in the form that the work needs; return whether they are not those read last."""
        from . import exr  # noqa: PLC0415
        from .preview import Previewer, depth_map  # noqa: PLC0415

        file = request["path"], request["stamp"]
        if self._file != file:
            self._file = self._whole = self._previewer = None
        fresh = (self._whole if whole else self._previewer) is None
        if fresh:
            samples = exr.read_samples(Path(request["path"]))
            if whole:
                self._whole = samples
            else:
                self._previewer = Previewer(samples)
                self._maps += 1
                depth = depth_map(samples)
                name = f"depth_{self._maps}.f32"
                depth.tofile(self._folder / name)
                told = {"depth": name, "shape": list(depth.shape), "stamp": request["stamp"]}
                self._outbox.send({**told, "path": request["path"]})
            self._file = file
        return fresh

    def _kept(self, picture: Float32Array, name: str) -> dict[str, Any]:
        """Write a picture where the other side finds it; it asks for the next after it has read this."""
        file = f"{name}.f32"
        np.ascontiguousarray(picture).tofile(self._folder / file)
        return {"picture": file, "shape": list(picture.shape)}


def main(arguments: list[str]) -> int:
    """Run a worker in the folder that the arguments name.

    Parameters
    ----------
    arguments : list of str
        The folder, and where compiled kernels are kept if that is not up to numba.

    Returns
    -------
    int
        Exit status: 0 done, 2 usage.
    """
    if len(arguments) not in (1, 2) or not Path(arguments[0]).is_dir():
        print("usage: python -m potmesil_addon.worker FOLDER [KERNELS]", file=sys.stderr)
        return 2
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(_PATIENCE)
    Worker(*map(Path, arguments)).run()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
