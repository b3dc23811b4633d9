"""Batches of frames: what is skipped, made again, tried again and reported, and how they end."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from potmesil_addon import batch, cli, exr, png
from potmesil_addon.batch import BatchOptions, Lines, Mark, run_batch, settings_hash, standing, worst
from potmesil_addon.errors import InputError, MemoryLimitError, OutputError, PotmesilError

from .test_cli import LENS, rendered_file

ROOT = Path(__file__).resolve().parents[2]
PICTURE = np.full((6, 8, 4), 0.5, dtype=np.float32)


@dataclass
class Frames:
    """Frames that only note that they were made, and fail as they are told to."""

    standings: dict[int, batch.Standing] = field(default_factory=dict)
    failures: dict[int, list[BaseException]] = field(default_factory=dict)
    made: list[int] = field(default_factory=list)

    def begin(self, frame: int | None) -> Any:
        assert frame is not None
        return _Frame(self, frame)


@dataclass
class _Frame:
    frames: Frames
    number: int

    @property
    def output(self) -> Path:
        return Path(f"/out/{self.number:04d}.exr")

    def standing(self) -> batch.Standing:
        return self.frames.standings.get(self.number, "missing")

    def make(self) -> Generator[float, None, None]:
        yield 0.5
        waiting = self.frames.failures.get(self.number)
        if waiting:
            raise waiting.pop(0)
        self.frames.made.append(self.number)


@pytest.fixture(autouse=True)
def no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "_RETRY_SECONDS", 0.0)


def test_frames_that_are_there_are_skipped_and_the_others_named(capsys: Any) -> None:
    frames = Frames({1: "current", 2: "stale", 3: "damaged", 4: "missing", 5: "unknown"})
    assert run_batch(range(1, 6), frames.begin, BatchOptions()) == 0
    assert frames.made == [2, 3, 4, 5]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == 'Skipping existing frame "/out/0001.exr"'
    assert "Stale: '/out/0002.exr' was made with other settings or samples; it is made again." in lines
    assert "Damaged: '/out/0003.exr' is not whole; it is made again." in lines
    assert "Unknown: '/out/0005.exr' cannot say how it was made; it is made again." in lines
    assert [line for line in lines if line.startswith("Saved: ")] == [
        f"Saved: '/out/{n:04d}.exr'" for n in (2, 3, 4, 5)
    ]
    assert sum(bool(re.fullmatch(r"Time: \d\d:\d\d\.\d\d", line)) for line in lines) == 4
    assert "openjd_status: processing frame 2 (2 of 5)" in lines
    assert lines[-1] == "openjd_progress: 100.0"


def test_keep_makes_only_what_is_not_whole(capsys: Any) -> None:
    frames = Frames({1: "current", 2: "stale", 3: "damaged", 4: "missing", 5: "unknown"})
    assert run_batch(range(1, 6), frames.begin, BatchOptions(existing="keep")) == 0
    assert frames.made == [3, 4]
    out = capsys.readouterr().out
    assert "Stale: '/out/0002.exr' was made with other settings or samples; it is kept." in out


def test_overwrite_makes_all() -> None:
    frames = Frames(dict.fromkeys(range(1, 4), "current"))
    assert run_batch(range(1, 4), frames.begin, BatchOptions(existing="overwrite")) == 0
    assert frames.made == [1, 2, 3]


def test_a_frame_that_failed_is_tried_again(capsys: Any) -> None:
    frames = Frames(failures={2: [OutputError("The disk is full."), OSError(5, "Input/output error")]})
    assert run_batch((1, 2, 3), frames.begin, BatchOptions(retries=2)) == 0
    assert frames.made == [1, 2, 3]
    said = capsys.readouterr()
    assert "Trying frame 2 again (2 of 2)." in said.out
    assert said.err.splitlines() == [
        "Error: Frame 2: The disk is full.",
        "Error: Frame 2: Input/output error; check the folder and the disk.",
    ]
    assert "openjd_fail" not in said.out


def test_a_frame_that_goes_on_failing_ends_the_batch(capsys: Any) -> None:
    frames = Frames(failures={2: [PotmesilError("No.")] * 9})
    assert run_batch((1, 2, 3), frames.begin, BatchOptions(retries=3)) == 4
    assert frames.made == [1]
    assert len(frames.failures[2]) == 5
    assert "openjd_fail: Frame 2: No." in capsys.readouterr().out.splitlines()


def test_wrong_input_is_not_tried_again() -> None:
    frames = Frames(failures={1: [InputError("Damaged.")] * 2})
    assert run_batch((1, 2), frames.begin, BatchOptions(retries=3)) == 3
    assert len(frames.failures[1]) == 1
    assert frames.made == []


def test_the_others_are_made_where_a_batch_keeps_going() -> None:
    frames = Frames(failures={1: [InputError("Damaged.")], 3: [OutputError("Full.")]})
    assert run_batch((1, 2, 3, 4), frames.begin, BatchOptions(keep_going=True)) == 4
    assert frames.made == [2, 4]


@pytest.mark.parametrize("error", [MemoryError(), MemoryLimitError("Too little.")])
def test_memory_has_its_own_exit_status(error: BaseException, capsys: Any) -> None:
    assert run_batch((1,), Frames(failures={1: [error]}).begin, BatchOptions(retries=2)) == 33
    assert capsys.readouterr().err.count("\n") == 1


def test_a_process_over_its_memory_stops_between_frames(capsys: Any) -> None:
    frames = Frames()
    assert run_batch((1, 2), frames.begin, BatchOptions(max_memory=1 << 20)) == 33
    assert frames.made == [1]
    assert "--max-memory" in capsys.readouterr().err


def test_all_frames_are_there_though_the_last_took_too_much() -> None:
    assert run_batch((1,), Frames().begin, BatchOptions(max_memory=1 << 20)) == 0


def test_ctrl_c_and_sigterm_have_their_exit_status(tmp_path: Path) -> None:
    interrupted = Frames(failures={2: [KeyboardInterrupt()]})
    assert run_batch((1, 2), interrupted.begin, BatchOptions()) == 130
    terminated = Frames(failures={2: [batch.Terminated()]})
    report = tmp_path / "job.json"
    assert run_batch((1, 2, 3), terminated.begin, BatchOptions(report=report)) == 143
    assert [item["status"] for item in json.loads(report.read_text())["frames"]] == [
        "made",
        "failed",
        "not_reached",
    ]


def test_sigterm_reaches_the_frame_and_the_old_handler_comes_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    given_back = []

    class Slow(_Frame):
        def make(self) -> Generator[float, None, None]:
            try:
                yield 0.1
                os.kill(os.getpid(), signal.SIGTERM)
                time.sleep(5.0)
            finally:
                given_back.append(self.number)

    assert run_batch((1, 2), lambda n: Slow(Frames(), n or 0), BatchOptions()) == 143
    assert given_back == [1]
    assert signal.getsignal(signal.SIGTERM) == before


def test_the_report_says_what_became_of_every_frame(tmp_path: Path) -> None:
    path = tmp_path / "job.json"
    frames = Frames({1: "current", 2: "stale"}, {3: [OutputError("Full.")]})
    assert run_batch((1, 2, 3, 4), frames.begin, BatchOptions(report=path)) == 4
    said = json.loads(path.read_text())
    assert said["exit_status"] == 4
    assert (said["made"], said["skipped"], said["failed"], said["not_reached"]) == (1, 1, 1, 1)
    assert said["peak_memory_bytes"] > 1 << 20
    assert [(item["frame"], item["status"], item["standing"]) for item in said["frames"]] == [
        (1, "skipped", "current"),
        (2, "made", "stale"),
        (3, "failed", "missing"),
        (4, "not_reached", None),
    ]
    assert said["frames"][2]["error"] == "Full."


@pytest.mark.parametrize(
    ("style", "line"), [("afanasy", "PROGRESS: 50%"), ("tractor", "TR_PROGRESS 50%"), ("none", "")]
)
def test_progress_in_the_words_of_a_farm(style: Any, line: str, capsys: Any) -> None:
    run_batch((1, 2), Frames().begin, BatchOptions(styles=(style,)))
    lines = capsys.readouterr().out.splitlines()
    assert not line or line in lines
    assert not any(line.startswith("openjd") for line in lines)


def test_a_line_is_one_line_that_any_terminal_takes() -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    Lines(stream=stream).say("a\nb \N{SNOWMAN} \udce4")
    stream.seek(0)
    assert stream.read() == "a b \\u2603 \\udce4\n"


def test_nobody_has_to_read_the_lines() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    stream = os.fdopen(writing, "w")
    Lines(stream=stream).say("gone")
    with pytest.raises(BrokenPipeError):
        stream.close()


@pytest.mark.parametrize(
    ("environment", "threads"),
    [
        ({}, None),
        ({"SLURM_CPUS_PER_TASK": "3", "CUE_THREADS": "5"}, 3),
        ({"CUE_THREADS": "5"}, 5),
        ({"SLURM_CPUS_PER_TASK": "many"}, None),
    ],
)
def test_threads_are_those_that_the_farm_allows(environment: dict[str, str], threads: int | None) -> None:
    assert batch.thread_count(None, environment) == threads
    assert batch.thread_count(7, environment) == 7


def test_the_hash_is_of_values_and_not_of_their_order() -> None:
    one = settings_hash({"a": 1.0, "b": [1, 2]})
    assert one == settings_hash({"b": (1, 2), "a": 1.0})
    assert one != settings_hash({"a": 1.5, "b": [1, 2]})
    assert re.fullmatch("[0-9a-f]{32}", one)


def marked(folder: Path, ending: str, mark: Mark) -> Path:
    """A small picture that says how it was made."""
    path = folder / f"picture{ending}"
    if ending == ".png":
        png.write_png(path, PICTURE, mark.attributes())
    else:
        exr.write_picture(path, PICTURE, mark.attributes())
    return path


@pytest.mark.parametrize("ending", [".exr", ".png"])
def test_standing_of_a_file(tmp_path: Path, ending: str) -> None:
    mark = Mark("5e77", "5a3e")
    path = marked(tmp_path, ending, mark)
    assert standing(path, mark) == "current"
    assert standing(path, Mark("5e77")) == "current"
    assert standing(path, replace(mark, settings="0")) == "stale"
    assert standing(path, replace(mark, samples="0")) == "stale"
    assert standing(tmp_path / f"other{ending}", mark) == "missing"
    content = path.read_bytes()
    for end in (0, 3, len(content) // 3, 2 * len(content) // 3, len(content) - 1):
        path.write_bytes(content[:end])
        assert standing(path, mark) == "damaged", end
    middle = len(content) // 2
    path.write_bytes(content[:middle] + bytes(len(content) - middle))
    assert standing(path, mark) == "damaged"


def test_standing_of_files_that_say_nothing(tmp_path: Path) -> None:
    path = tmp_path / "picture.jpg"
    path.write_bytes(b"")
    assert standing(path, Mark("a")) == "damaged"
    path.write_bytes(b"something")
    assert standing(path, Mark("a")) == "unknown"
    exr.write_picture(tmp_path / "plain.exr", PICTURE, {})
    assert standing(tmp_path / "plain.exr", Mark("a")) == "stale"
    assert worst(["current", "stale", "damaged"]) == "damaged"


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "DWAA"])
def test_stamping_leaves_pixels_as_they_are(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "a.exr"
    pixels = np.random.default_rng(1).random((70, 33, 3), dtype=np.float32).astype(np.float16)
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": pixels}).write(str(path))
    before = OpenEXR.File(str(path))
    exr.stamp(path, {"potmesil:settings": "1234", "a name that is longer than 31 bytes": "\N{SNOWMAN}"})
    after = OpenEXR.File(str(path))
    assert after.header()["potmesil:settings"] == "1234"
    assert after.header()["a name that is longer than 31 bytes"] == "\N{SNOWMAN}"
    assert np.array_equal(before.channels()["RGB"].pixels, after.channels()["RGB"].pixels)
    assert after.header()["compression"] == header["compression"]


def test_stamping_parts_and_tiles(tmp_path: Path) -> None:
    path = tmp_path / "parts.exr"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part(dict(header), {f"{n}.R": np.full((40, 9), n, dtype=np.float32)}, f"p{n}")
        for n in range(3)
    ]
    OpenEXR.File(parts).write(str(path))
    exr.stamp(path, {"potmesil:settings": "1"})
    file = OpenEXR.File(str(path))
    assert file.parts[0].header["potmesil:settings"] == "1"
    assert [float(next(iter(part.channels.values())).pixels.mean()) for part in file.parts] == [0.0, 1.0, 2.0]
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match="not a whole OpenEXR file"):
        exr.stamp(path, {"a": "b"})


def run(*words: object) -> int:
    """The command line in this process."""
    return cli.main([str(word) for word in words])


def test_process_goes_on_where_it_was_stopped(tmp_path: Path, capsys: Any) -> None:
    source = rendered_file(tmp_path)
    job = ("process", source, "-o", tmp_path / "o.####.exr", "--mask", tmp_path / "m.####.exr", *LENS)
    assert run(*job, "--frames", "1-2") == 0
    first = {path: path.read_bytes() for path in tmp_path.glob("[om].*.exr")}
    assert len(first) == 4
    capsys.readouterr()
    (tmp_path / "m.0002.exr").unlink()
    assert run(*job, "--frames", "1-3", "--threads", "1") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f'Skipping existing frame "{tmp_path / "o.0001.exr"}"'
    assert [line[-10:] for line in lines if line.startswith("Saved")] == [
        "o.0002.exr"[-9:] + "'",
        "o.0003.exr"[-9:] + "'",
    ]
    assert all(path.read_bytes() == content for path, content in first.items())


@pytest.mark.parametrize(
    ("words", "again"),
    [
        (("--fstop", "2"), True),
        (("--effect", "exposure.density=1"), True),
        (("--backend", "numba"), False),
        (("--threads", "2", "--frame-retries", "1"), False),
    ],
)
def test_other_settings_make_a_picture_stale(
    tmp_path: Path, capsys: Any, words: tuple[str, ...], again: bool
) -> None:
    source = rendered_file(tmp_path)
    assert run("process", source, "-o", tmp_path / "o.exr") == 0
    capsys.readouterr()
    assert run("process", source, "-o", tmp_path / "o.exr", *words) == 0
    out = capsys.readouterr().out
    assert ("Stale: " in out) == again
    assert ("Skipping existing frame" in out) != again


def test_other_samples_make_a_picture_stale(tmp_path: Path, capsys: Any) -> None:
    source = rendered_file(tmp_path)
    assert run("process", source, "-o", tmp_path / "o.exr") == 0
    content = source.read_bytes()
    exr.stamp(source, {"a": "b"})
    capsys.readouterr()
    assert run("process", source, "-o", tmp_path / "o.exr") == 0
    # A file without a digest of its own counts byte by byte.
    assert "Stale: " in capsys.readouterr().out
    source.write_bytes(content)


def test_nothing_needs_a_home_or_a_folder_to_be_in(tmp_path: Path) -> None:
    source = rendered_file(tmp_path)
    gone = tmp_path / "gone"
    gone.mkdir()
    code = (
        f"import os, sys; os.rmdir({str(gone)!r}); sys.path.insert(0, {str(ROOT)!r})\n"
        "from potmesil_addon.cli import main\nsys.exit(main(sys.argv[1:]))"
    )
    kept = {
        name: value for name, value in os.environ.items() if name in ("PATH", "SYSTEMROOT", "LD_LIBRARY_PATH")
    }
    # These need few kernels, which are compiled: there is no folder where they could be found.
    words = ["process", str(source), "-o", str(tmp_path / "o.exr"), "--no-motion", "--visibility", "none"]
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, *words],
        cwd=gone,
        env=kept,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "o.exr").is_file()
