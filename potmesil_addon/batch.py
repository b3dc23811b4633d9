"""Batches: which frames are made and which are there, what became of each, and what a farm hears of it.

A batch runs frame by frame. Every file says in its header how it was made, so that a batch which was stopped
goes on where it was, and a frame of other settings is noticed.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType
from typing import IO, Any, Final, Literal, Protocol, get_args

from . import __version__, memory
from .errors import (
    EXIT_DONE,
    EXIT_INPUT,
    EXIT_MEMORY,
    InputError,
    MemoryLimitError,
    OutputError,
    PotmesilError,
    SettingsError,
)

SETTINGS_ATTRIBUTE: Final = "potmesil:settings"
"""Header attribute: the hash of the settings that a file was made with."""

SAMPLES_ATTRIBUTE: Final = "potmesil:samples"
"""Header attribute of a picture: the digest of the samples that it was made from."""

Existing = Literal["skip", "keep", "overwrite"]
"""What becomes of frames that are there; see `add_batch_options`."""

Standing = Literal["missing", "damaged", "stale", "unknown", "current"]
"""What a file is to a batch: ``unknown`` where its format cannot say how it was made."""

ProgressStyle = Literal["openjd", "afanasy", "tractor", "none"]

EXIT_INTERRUPTED: Final = 130
EXIT_TERMINATED: Final = 143

_GIBIBYTE: Final = 1 << 30
_DIGEST_BYTES: Final = 16
_READ_BYTES: Final = 1 << 20
_RETRY_SECONDS: Final = 1.0
"""Pause before a frame is tried again: what fails for a moment, as a network share does, may have passed."""

_LEAST_STEP: Final = 0.01
_LEAST_SECONDS: Final = 1.0
"""Progress is told when it has grown by this share, and as much time has passed."""

_THREAD_VARIABLES: Final = ("SLURM_CPUS_PER_TASK", "CUE_THREADS")
"""Where farms say how many threads a task may use."""


class Terminated(BaseException):
    """The system asked the process to end."""


@dataclass(frozen=True, slots=True)
class Mark:
    """How a file was made, as its header says.

    Parameters
    ----------
    settings : str
        Hash of the settings.
    samples : str or None
        Digest of the samples that a picture was made from; None where it does not matter.
    """

    settings: str
    samples: str | None = None

    def attributes(self) -> dict[str, str]:
        """Return the header attributes that say so."""
        said = {SETTINGS_ATTRIBUTE: self.settings}
        return said if self.samples is None else {**said, SAMPLES_ATTRIBUTE: self.samples}


class Work(Protocol):
    """One frame of a batch."""

    @property
    def output(self) -> Path:
        """The file that stands for the frame."""

    def standing(self) -> Standing:
        """Return what the frame's files are; the worst of them counts."""

    def make(self) -> Generator[float, None, None]:
        """Make the frame, yielding the share done."""


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """How a batch runs.

    Parameters
    ----------
    existing : {"skip", "keep", "overwrite"}
        What becomes of frames that are there.
    retries : int
        How often a frame that failed is tried again.
    keep_going : bool
        Go on with the other frames after one failed.
    report : Path or None
        Where to write what became of every frame.
    styles : tuple of str
        Whose progress lines to print.
    max_memory : int or None
        Bytes that the process may take.
    """

    existing: Existing = "skip"
    retries: int = 0
    keep_going: bool = False
    report: Path | None = None
    styles: tuple[ProgressStyle, ...] = ("openjd",)
    max_memory: int | None = None


@dataclass(slots=True)
class _Outcome:
    """What became of a frame, for the report."""

    frame: int | None
    status: str = "not_reached"
    output: str | None = None
    standing: str | None = None
    attempts: int = 0
    seconds: float = 0.0
    error: str | None = None
    exit_status: int = EXIT_DONE


@dataclass(slots=True)
class Lines:
    """Lines on standard output: whole, at once and at the start of a line, as farms read them.

    Parameters
    ----------
    styles : tuple of str
        Whose progress lines to print.
    stream : file or None
        Where to; by default standard output as it is when a line is printed.
    """

    styles: tuple[ProgressStyle, ...] = ("openjd",)
    stream: IO[str] | None = None
    _share: float = field(default=-1.0, init=False)
    _told: float = field(default=-_LEAST_SECONDS, init=False)

    def say(self, text: str) -> None:
        """Print a line; one that nobody reads any more stops no frame."""
        stream = self.stream or sys.stdout
        line = " ".join(text.splitlines())
        with contextlib.suppress(OSError, ValueError):
            try:
                print(line, file=stream, flush=True)
            except UnicodeEncodeError:
                # Names of files may be none of the terminal's.
                print(line.encode("ascii", "backslashreplace").decode("ascii"), file=stream, flush=True)

    def status(self, text: str) -> None:
        """Say what is being done."""
        if "openjd" in self.styles:
            self.say(f"openjd_status: {text}")
        if "afanasy" in self.styles:
            self.say(f"ACTIVITY: {text}")

    def failed(self, text: str) -> None:
        """Say why the batch fails."""
        if "openjd" in self.styles:
            self.say(f"openjd_fail: {text}")

    def progress(self, share: float, *, now: bool = False) -> None:
        """Say how much of the batch is done, where there is something new to say.

        Parameters
        ----------
        share : float
            From 0 to 1.
        now : bool
            Say it in any case.
        """
        time_now = time.monotonic()
        if not now and (share < self._share + _LEAST_STEP or time_now < self._told + _LEAST_SECONDS):
            return
        self._share, self._told = share, time_now
        if "openjd" in self.styles:
            self.say(f"openjd_progress: {100.0 * share:.1f}")
        if "afanasy" in self.styles:
            self.say(f"PROGRESS: {100.0 * share:.0f}%")
        if "tractor" in self.styles:
            self.say(f"TR_PROGRESS {100.0 * share:.0f}%")


def add_batch_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that `batch_options` reads.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Receives the options.
    """
    parser.add_argument(
        "--existing",
        choices=get_args(Existing),
        default="skip",
        help="frames that are there: skip (default) those that are whole and made with the same settings, "
        "and name and make again the others; keep all that are whole; overwrite all",
    )
    parser.add_argument(
        "--frame-retries",
        type=int,
        default=0,
        metavar="N",
        help="how often a frame that failed is tried again",
    )
    parser.add_argument(
        "--keep-going", action="store_true", help="go on with the other frames after one failed"
    )
    parser.add_argument(
        "--job-report", type=Path, metavar="OUT.json", help="write what became of every frame"
    )
    parser.add_argument(
        "--progress",
        action="append",
        choices=get_args(ProgressStyle),
        help="whose progress lines to print (default: openjd); may be repeated",
    )
    parser.add_argument(
        "--max-memory", type=float, metavar="GIB", help="memory that the process may take, in all"
    )


def batch_options(options: argparse.Namespace) -> BatchOptions:
    """Return what the options of `add_batch_options` ask for.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.

    Returns
    -------
    BatchOptions
        The batch's.

    Raises
    ------
    SettingsError
        If a number is out of range.
    """
    if options.frame_retries < 0:
        raise SettingsError("--frame-retries must be 0 or more.")
    cap = options.max_memory
    if cap is not None and not 0.0 < cap < float(1 << 20):
        raise SettingsError("--max-memory must be greater than 0, in GiB.")
    return BatchOptions(
        existing=options.existing,
        retries=options.frame_retries,
        keep_going=options.keep_going,
        report=None if options.job_report is None else options.job_report.absolute(),
        styles=tuple(options.progress or ("openjd",)),
        max_memory=None if cap is None else int(cap * _GIBIBYTE),
    )


def thread_count(asked: int | None, environment: Mapping[str, str] | None = None) -> int | None:
    """Return how many threads to use: what is asked for, what the farm allows, or None for all cores.

    Parameters
    ----------
    asked : int or None
        What ``--threads`` says.
    environment : mapping, optional
        By default the process's own.

    Returns
    -------
    int or None
        Number of threads.
    """
    if asked is not None:
        return asked
    environment = os.environ if environment is None else environment
    for name in _THREAD_VARIABLES:
        text = environment.get(name, "")
        if text.isascii() and text.isdigit() and int(text) > 0:
            return int(text)
    return None


def settings_hash(values: Mapping[str, Any]) -> str:
    """Return a hash of settings, which files made with them carry.

    Parameters
    ----------
    values : mapping
        Plain values; what `json` does not know counts as its text.

    Returns
    -------
    str
        32 hexadecimal digits. The extension's version goes in: another one may make other pictures.
    """
    text = json.dumps({"version": __version__, **values}, sort_keys=True, default=str)
    return hashlib.blake2b(text.encode(), digest_size=_DIGEST_BYTES).hexdigest()


def file_digest(path: Path) -> str:
    """Return a digest of what a file holds.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        32 hexadecimal digits.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    digest = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    try:
        with path.open("rb") as stream:
            while part := stream.read(_READ_BYTES):
                digest.update(part)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}; check the file.") from error
    return digest.hexdigest()


def standing(path: Path, mark: Mark) -> Standing:
    """Return what a file is to a batch that would make it with a mark.

    The file is read as a whole: one that was cut off, by a full disk or a lost network, is damaged.

    Parameters
    ----------
    path : Path
        An EXR or PNG file, or one of another format.
    mark : Mark
        How it would be made now.

    Returns
    -------
    {"missing", "damaged", "stale", "unknown", "current"}
        What it is.
    """
    from . import exr, png  # noqa: PLC0415 - Blender's start-up would pay for numpy's friends
    from .cut import is_cut  # noqa: PLC0415

    if not path.is_file():
        return "missing"
    said: dict[str, Any] | None
    try:
        if path.suffix.lower() == ".exr":
            said = exr.read_whole_header(path)
        elif path.suffix.lower() == ".png":
            said = png.read_texts(path)
        else:
            return "unknown" if path.stat().st_size and not is_cut(path) else "damaged"
    except (InputError, OSError):
        return "damaged"
    if said is None:
        return "unknown"
    same = said.get(SETTINGS_ATTRIBUTE) == mark.settings
    if mark.samples is not None:
        same = same and said.get(SAMPLES_ATTRIBUTE) == mark.samples
    return "current" if same else "stale"


def worst(standings: Sequence[Standing]) -> Standing:
    """Return the standing of a frame of several files.

    Parameters
    ----------
    standings : sequence of str
        Of each file.

    Returns
    -------
    {"missing", "damaged", "stale", "unknown", "current"}
        The first of these that one of them is.
    """
    return min(standings, key=get_args(Standing).index)


def run_batch(
    frames: Sequence[int | None],
    begin: Callable[[int | None], Work],
    options: BatchOptions,
    doing: str = "processing",
) -> int:
    """Make frames, one by one.

    Parameters
    ----------
    frames : sequence of int or None
        Their numbers; None where there is one picture without a number.
    begin : callable
        Returns the work of a frame, which may ask what is there before it is made.
    options : BatchOptions
        How the batch runs.
    doing : str
        What the lines call the work.

    Returns
    -------
    int
        Exit status: 0 where all frames are there, else that of what failed.

    Raises
    ------
    OutputError
        If the report cannot be written.
    """
    _stand_somewhere()
    lines = Lines(options.styles)
    outcomes = [_Outcome(frame) for frame in frames]
    started = time.monotonic()
    status = EXIT_DONE
    try:
        with _raises_on_sigterm():
            for done, outcome in enumerate(outcomes):
                _run_frame(outcome, begin, options, lines, (done, len(frames), doing))
                # What a retry may help with counts for more.
                status = max(status, outcome.exit_status)
                if outcome.exit_status != EXIT_DONE and not options.keep_going:
                    break
                lines.progress((done + 1) / len(frames), now=True)
                if done + 1 < len(frames):
                    _refuse_memory(options)
    except KeyboardInterrupt:
        status = EXIT_INTERRUPTED
    except Terminated:
        status = EXIT_TERMINATED
        lines.say("Terminated: the frames that are there stay, and the next run goes on from them.")
    except MemoryLimitError as error:
        _say_error(lines, str(error))
        status = error.exit_status
    if options.report is not None:
        _write_report(options.report, outcomes, status, time.monotonic() - started)
    return status


def _stand_somewhere() -> None:
    """Leave a folder that was removed: numba asks where it is while it compiles."""
    try:
        Path.cwd()
    except FileNotFoundError:
        os.chdir(tempfile.gettempdir())


def _run_frame(
    outcome: _Outcome,
    begin: Callable[[int | None], Work],
    options: BatchOptions,
    lines: Lines,
    place: tuple[int, int, str],
) -> None:
    """Make a frame, or find that it is there, and note what became of it."""
    done, count, doing = place
    name = "" if outcome.frame is None else f"frame {outcome.frame}"
    started = time.monotonic()
    outcome.status, outcome.error = "failed", None
    while True:
        outcome.attempts += 1
        error: PotmesilError | None = None
        try:
            work = begin(outcome.frame)
            outcome.output = str(work.output)
            outcome.standing = "missing" if options.existing == "overwrite" else work.standing()
            if _is_kept(outcome.standing, options.existing):
                if outcome.standing == "stale":
                    lines.say(f"Stale: '{work.output}' was made with other settings or samples; it is kept.")
                lines.say(f'Skipping existing frame "{work.output}"')
                outcome.status = "skipped" if outcome.standing == "current" else "kept"
                return
            _say_standing(lines, work.output, outcome.standing)
            lines.status(" ".join(filter(None, (doing, name))) + f" ({done + 1} of {count})")
            for share in work.make():
                lines.progress((done + share) / count)
        except PotmesilError as caught:
            error = caught
        except MemoryError:
            error = MemoryLimitError(
                "There is not enough memory for this picture; use a machine with more, or give --max-memory."
            )
        except OSError as caught:
            error = OutputError(f"{caught.strerror or caught}; check the folder and the disk.")
        except Exception as caught:
            error = PotmesilError(f"Something unforeseen went wrong ({type(caught).__name__}: {caught}).")
        if error is None:
            outcome.status = "made"
            outcome.seconds = time.monotonic() - started
            minutes, seconds = divmod(outcome.seconds, 60.0)
            lines.say(f"Saved: '{work.output}'")
            lines.say(f"Time: {int(minutes):02d}:{seconds:05.2f}")
            return
        sentence = f"{name.capitalize()}: {error}" if name else str(error)
        _say_error(lines, sentence)
        # Wrong input stays wrong, and memory as small as it is.
        if outcome.attempts > options.retries or error.exit_status in (2, EXIT_INPUT, EXIT_MEMORY):
            outcome.error, outcome.exit_status = str(error), error.exit_status
            outcome.seconds = time.monotonic() - started
            lines.failed(sentence)
            return
        lines.say(f"Trying {name or 'it'} again ({outcome.attempts} of {options.retries}).")
        time.sleep(_RETRY_SECONDS)


def _is_kept(found: Standing, existing: Existing) -> bool:
    return found == "current" or (existing == "keep" and found in ("stale", "unknown"))


def _say_standing(lines: Lines, path: Path, found: Standing) -> None:
    """Name a file that is there and is made again, and why."""
    if found == "stale":
        lines.say(f"Stale: '{path}' was made with other settings or samples; it is made again.")
    elif found == "damaged":
        lines.say(f"Damaged: '{path}' is not whole; it is made again.")
    elif found == "unknown":
        lines.say(f"Unknown: '{path}' cannot say how it was made; it is made again.")


def _say_error(lines: Lines, sentence: str) -> None:
    Lines(lines.styles, sys.stderr).say(f"Error: {sentence}")


def _write_report(path: Path, outcomes: Sequence[_Outcome], status: int, seconds: float) -> None:
    from .reports import write_json  # noqa: PLC0415 - see standing

    counted = {name: sum(item.status == name for item in outcomes) for name in _STATUSES}
    write_json(
        path,
        {
            "version": __version__,
            "exit_status": status,
            "host": socket.gethostname(),
            "seconds": seconds,
            "peak_memory_bytes": memory.peak(),
            **counted,
            "frames": [asdict(item) for item in outcomes],
        },
    )


_STATUSES: Final = ("made", "skipped", "kept", "failed", "not_reached")


def _refuse_memory(options: BatchOptions) -> None:
    """Raise MemoryLimitError where the process has taken more than it may."""
    most = memory.peak()
    if options.max_memory is not None and most > options.max_memory:
        raise MemoryLimitError(
            f"The process took {most / _GIBIBYTE:.2f} GiB of the {options.max_memory / _GIBIBYTE:.2f} GiB "
            "that --max-memory allows; give it more, or render smaller frames."
        )


@contextlib.contextmanager
def _raises_on_sigterm() -> Iterator[None]:
    """Let SIGTERM end the block with `Terminated`, so that what it holds is given back."""

    def end(number: int, frame: FrameType | None) -> None:
        del number, frame
        # A second one would break into the clearing up.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise Terminated

    with _on_sigterm(end):
        yield


@contextlib.contextmanager
def dies_on_sigterm() -> Iterator[None]:
    """Let SIGTERM end the process at once in a block: while Blender renders, Python hears no signal."""
    with _on_sigterm(signal.SIG_DFL):
        yield


@contextlib.contextmanager
def _on_sigterm(handler: Any) -> Iterator[None]:
    try:
        before = signal.signal(signal.SIGTERM, handler)
    except ValueError:  # not in the main thread, where signals are not ours
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
