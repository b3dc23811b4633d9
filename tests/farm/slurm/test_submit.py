"""What is given to Slurm, and what a task does by itself: without Slurm."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

FARM = Path(__file__).resolve().parents[3] / "farm" / "slurm"
COMMAND = [
    "blender",
    "-b",
    "a shot.blend",
    "--command",
    "potmesil_camera",
    "{stage}",
    "--output=/out/####.exr",
]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Slurm is not on Windows")


@pytest.fixture
def submit() -> ModuleType:
    spec = importlib.util.spec_from_file_location("potmesil_slurm_submit", FARM / "submit.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def write_program(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.fixture
def slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with programs that only note how they were called; arrays have at most 1000 tasks."""
    programs = tmp_path / "bin"
    programs.mkdir()
    calls = tmp_path / "calls"
    calls.touch()
    # One argument a line, and a blank line after a call.
    note = f'for word in "$(basename "$0")" "$@"; do echo "$word"; done >> \'{calls}\'; echo >> \'{calls}\''
    write_program(programs / "sbatch", f"{note}; echo \"$(grep -c '^sbatch$' '{calls}')00;farm\"")
    write_program(
        programs / "scontrol",
        f"{note}; [ $1 != show ] || echo 'MaxArraySize            = 1000'; exit ${{REFUSED:-0}}",
    )
    write_program(programs / "scancel", note)
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    return tmp_path


def calls(slurm: Path, program: str = "") -> list[list[str]]:
    made = [call.splitlines() for call in (slurm / "calls").read_text().split("\n\n") if call]
    return [call for call in made if call[0] == program or not program]


def write_chunks(folder: Path, *lines: str) -> Path:
    path = folder / "my chunks.txt"
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def test_each_picture_waits_for_its_own_passes(
    submit: ModuleType, slurm: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chunks = write_chunks(slurm, "1-4", "5,9-11", "-3--1")
    options = ["--threads=8", "--memory", "6000", "--most-memory=24000", "--time=2:00:00", "--retries=3"]
    more = ["--at-once=2", f"--logs={slurm / 'logs'}", "--name=shot", "--sbatch=--partition=render"]
    assert submit.main([str(chunks), *options, *more, "--", *COMMAND]) == 0
    assert capsys.readouterr().out.splitlines() == ["passes: 100", "process: 200"]
    passes, process = calls(slurm, "sbatch")
    assert "--array=0-2%2" in passes
    for words in (passes, process):
        assert {"--mem=6000M", "--cpus-per-task=8", "--time=2:00:00", "--partition=render"} <= set(words)
        script = words.index(str(FARM / "potmesil_camera.sbatch"))
        assert words[script + 1 : script + 3] == ["-r3", "-m24000"]
        kept = Path(words[script + 3])
        assert kept.parent == slurm / "logs"
        assert kept.read_text() == chunks.read_text()
    assert passes[-len(COMMAND) :] == [word.replace("{stage}", "passes") for word in COMMAND]
    assert not any(word.startswith("--dependency") for word in passes)
    assert "--dependency=aftercorr:100" in process
    assert process[-len(COMMAND) :] == [word.replace("{stage}", "process") for word in COMMAND]


def test_dry_run_submits_nothing(submit: ModuleType, slurm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = slurm / "logs"
    assert submit.main([str(write_chunks(slurm, "1-4")), f"--logs={logs}", "--dry-run", "--", *COMMAND]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 2
    assert "'a shot.blend'" in said[0]
    assert not calls(slurm)
    assert not logs.exists()


@pytest.mark.parametrize(
    ("lines", "command", "words"),
    [
        (["1-4"], ["blender"], "write {stage} there"),
        (["1-4"], [], "put it after --"),
        ([], COMMAND, "names no frames"),
        (["1-4", "", "9"], COMMAND, "Line 2 of"),
        (["1-4", "all"], COMMAND, "is no range of frames: 'all'"),
        (["1"] * 1001, COMMAND, "at most 1000 tasks here; make the chunks larger"),
    ],
)
def test_what_is_wrong_is_said_before_anything_is_submitted(
    submit: ModuleType,
    slurm: Path,
    capsys: pytest.CaptureFixture[str],
    lines: list[str],
    command: list[str],
    words: str,
) -> None:
    chunks = write_chunks(slurm, *lines)
    assert submit.main([str(chunks), f"--logs={slurm / 'logs'}", "--", *command]) == 3
    said = capsys.readouterr().err
    assert said.startswith("Error: ")
    assert words in said
    assert said.count("\n") == 1
    assert not calls(slurm, "sbatch")


def test_missing_slurm_and_chunk_file_are_named(
    submit: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert submit.main([str(tmp_path / "none.txt"), "--", *COMMAND]) == 3
    assert "none.txt': No such file" in capsys.readouterr().err
    monkeypatch.setenv("PATH", str(tmp_path))
    assert submit.main([str(write_chunks(tmp_path, "1")), "--", *COMMAND]) == 3
    assert "There is no scontrol here" in capsys.readouterr().err


def task(slurm: Path, command: str, *options: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the second task of an array; `command` is a shell's text."""
    chunks = write_chunks(slurm, "1-4", "5-8")
    known = {
        "SLURM_ARRAY_TASK_ID": "1",
        "SLURM_ARRAY_JOB_ID": "77",
        "SLURM_JOB_ID": "77",
        "SLURM_MEM_PER_NODE": "1000",
        **variables,
    }
    words = [*options, str(chunks), "sh", "-c", command, "sh", "a b"]
    return subprocess.run(
        ["bash", str(FARM / "potmesil_camera.sbatch"), *words],
        env={**os.environ, **known},
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )


def test_task_adds_its_frames_and_limit(slurm: Path) -> None:
    done = task(slurm, 'printf "%s|" "$@"')
    assert (done.returncode, done.stdout) == (0, "a b|--frames=5-8|--max-memory=0.879|")
    done = task(
        slurm, 'printf "%s|" "$@"', SLURM_MEM_PER_NODE="", SLURM_MEM_PER_CPU="500", SLURM_CPUS_ON_NODE="4"
    )
    assert done.stdout == "a b|--frames=5-8|--max-memory=1.758|"
    # A whole node's memory.
    assert task(slurm, 'printf "%s|" "$@"', SLURM_MEM_PER_NODE="0").stdout == "a b|--frames=5-8|"
    assert not calls(slurm)


@pytest.mark.parametrize(
    ("code", "restarts", "requeued"),
    [(4, "", True), (4, "1", True), (4, "2", False), *((code, "", False) for code in (1, 2, 3, 33))],
)
def test_only_what_may_help_is_queued_again(slurm: Path, code: int, restarts: str, requeued: bool) -> None:
    done = task(slurm, f"exit {code}", SLURM_RESTART_COUNT=restarts)
    assert done.returncode == code
    assert calls(slurm) == ([["scontrol", "requeue", "77_1"]] if requeued else [])
    if code == 4:
        assert ("queued again" if requeued else "given up after 3 runs") in done.stderr


def test_refused_requeue_is_said(slurm: Path) -> None:
    done = task(slurm, "exit 4", REFUSED="1")
    assert done.returncode == 4
    assert "Slurm did not queue it again (exit 4)" in done.stderr


@pytest.mark.parametrize(("most", "asked"), [("", 0), ("1000", 0), ("1500", 1500), ("9000", 2000)])
def test_more_memory_is_asked_for_up_to_a_limit(slurm: Path, most: str, asked: int) -> None:
    done = task(slurm, "exit 33", *([f"-m{most}"] if most else []), SLURM_RESTART_COUNT="5")
    assert done.returncode == 33
    if asked:
        assert calls(slurm) == [
            ["scontrol", "requeuehold", "77_1"],
            ["scontrol", "update", "JobId=77_1", f"MinMemoryNode={asked}"],
            ["scontrol", "release", "77_1"],
        ]
    else:
        assert not calls(slurm)
        assert "1000 MB of memory were too small (exit 33). Submit it again with more." in done.stderr


@pytest.mark.parametrize(("signal", "code", "requeued"), [("TERM", 143, False), ("USR1", 143, True)])
def test_command_ends_before_its_task(slurm: Path, signal: str, code: int, requeued: bool) -> None:
    # Slurm sends TERM to all, and USR1 to the script alone.
    command = (
        "trap 'sleep 0.3; echo cleared up; exit 143' TERM; kill -s %s $PPID; %s while :; do sleep 0.05; done"
    )
    done = task(slurm, command % (signal, "kill -s TERM $$;" if signal == "TERM" else ""))
    assert done.returncode == code
    assert done.stdout == "cleared up\n"
    assert calls(slurm) == ([["scontrol", "requeue", "77_1"]] if requeued else [])


@pytest.mark.parametrize(
    ("options", "variables", "words"),
    [
        (("-rmany",), {}, "whole numbers"),
        ((), {"SLURM_ARRAY_TASK_ID": "2"}, "has no line 2"),
        ((), {"SLURM_ARRAY_TASK_ID": ""}, "--array"),
    ],
)
def test_wrong_use_of_the_script_is_named(
    slurm: Path, options: tuple[str, ...], variables: dict[str, str], words: str
) -> None:
    done = task(slurm, "echo never", *options, **variables)
    assert done.returncode == 2
    assert words in done.stderr
    assert not done.stdout
