"""The submit programs' descriptions of a job, and the stand-in for Blender. No farm is needed."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from farm import as_blender, stages
from farm.afanasy import submit as afanasy
from farm.opencue import submit as opencue
from potmesil_addon.frames import parse_frames

ROOT = Path(__file__).resolve().parents[2]


def job_of(*words: str) -> stages.Job:
    parser = stages.job_parser("")
    needed = ["/film/shot 1.blend", "--samples", "/film/s/####.exr", "--output", "/film/p/####.png"]
    return stages.read_job(parser, parser.parse_args([*needed, *words]))


@pytest.mark.parametrize(
    "text", ["5", "1-4", "1-10:3", "1,2", "3,50", "1-3,5", "-3--1", "-4-8:2", "1-2,4-5,9", "1,3", "1-5:2,6"]
)
@pytest.mark.parametrize("step", [":", "x"])
def test_written_frames_are_read_back(text: str, step: str) -> None:
    frames = parse_frames(text)
    assert parse_frames(stages.write_frames(frames, step)) == frames


def test_frames_are_written_shortly() -> None:
    assert stages.write_frames([1, 4, 7, 10]) == "1-10:3"
    assert stages.write_frames([1, 4, 7, 10], "x") == "1-10x3"
    assert stages.write_frames([1, 2, 3, 5]) == "1-3,5"
    assert stages.write_frames([-3, -2]) == "-3--2"


def test_chunks_hold_every_frame_once() -> None:
    job = job_of("--frames", "1-10,20", "--chunk", "4")
    assert job.chunks() == [(1, 2, 3, 4), (5, 6, 7, 8), (9, 10, 20)]


def test_opencue_has_a_layer_for_each_stage() -> None:
    first, second = opencue.layers(job_of("--frames", "1-10:3", "--chunk", "2", "--memory", "16"))
    assert (first.name, first.after, second.name, second.after) == ("passes", None, "process", "passes")
    # A chunk of one layer depends on the same chunk of the other.
    assert (first.range, first.chunk) == (second.range, second.chunk) == ("1-10x3", 2)
    assert (second.memory, second.threads) == ("16g", 4)
    words = shlex.split(second.command)
    assert words[:6] == ["blender", "-b", "/film/shot 1.blend", "--command", "potmesil_camera", "process"]
    # No shell may take a path's # for the begin of a comment, and the memory has room for Blender.
    assert {"--frames=#FRAMESPEC#", "--output=/film/p/####.png", "--max-memory=14.4"} <= set(words)


def test_opencue_has_one_layer_for_one_stage() -> None:
    (only,) = opencue.layers(job_of("--frames", "1-10", "--stage", "process"))
    assert (only.name, only.after) == ("process", None)


def test_afanasy_has_a_task_for_each_chunk() -> None:
    first, second = afanasy.blocks(job_of("--frames", "1-10:3,50", "--chunk", "3"))
    assert [task["command"] for task in first["tasks"]] == ["1-7:3", "10,50"]
    assert first["tasks"] == second["tasks"]
    assert "tasks_depend_mask" not in first
    assert second["tasks_depend_mask"] == first["name"] == "passes"
    # Afanasy's service puts a task's command in place of @#@.
    command = second["command"].replace("@#@", second["tasks"][1]["command"])
    words = shlex.split(command)
    assert {"--frames=10,50", "--samples=/film/s/####.exr", "--progress=afanasy"} <= set(words)
    assert "numeric" not in second


def test_printing_a_job_needs_no_farm() -> None:
    words = [sys.executable, "-m", "farm.afanasy.submit", "shot.blend", "--frames", "1-3", "--print"]
    words += ["--samples", "//s/####.exr", "--output", "p/####.exr"]
    printed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    command = json.loads(printed)["job"]["blocks"][1]["command"]
    # A worker has another working folder; // is the .blend file's folder and left to the command.
    assert shlex.split(command)[2] == str(ROOT / "shot.blend")
    assert "--samples=//s/####.exr" in shlex.split(command)
    assert f"--output={ROOT / 'p'}/####.exr" in shlex.split(command)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--frames", "3-1"], "does not run forwards"),
        (["--frames", "1-3", "--output", "/p/film.exr"], "needs a # for the frame's digits"),
        (["--frames", "1-3", "--chunk", "0"], "must be 1 or more"),
    ],
)
def test_what_is_wrong_is_said(words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        job_of(*words)
    assert ended.value.code == 2
    assert sentence in capsys.readouterr().err


COMMAND = ["-b", "-y", "/a b.blend", "--command", "potmesil_camera", "passes", "--frames=1-4"]


def test_stand_in_runs_the_module() -> None:
    words = as_blender.translate(COMMAND, True, "blender")
    assert words[:1] == [sys.executable]
    assert words[2:] == ["--", "--blend", "/a b.blend", "passes", "--frames=1-4"]
    assert Path(words[1]) == ROOT / "farm" / "run.py"


def test_stand_in_runs_a_blender_without_the_extension() -> None:
    words = as_blender.translate(COMMAND, False, "/opt/blender")
    assert words[:6] == ["/opt/blender", "-b", "/a b.blend", "--python-exit-code", "1", "--python"]
    assert words[7:] == ["--", "passes", "--frames=1-4"]


def test_stand_in_runs_a_script() -> None:
    words = ["-b", "--factory-startup", "--python-exit-code", "1", "--python", "x.py", "--", "folder", ""]
    assert as_blender.translate(words, True, "blender") == [sys.executable, "x.py", "--", "folder", ""]
    assert as_blender.translate(words, False, "blender") == ["blender", *words]


def test_stand_in_ends_as_the_program_does(tmp_path: Path) -> None:
    blender = tmp_path / "blender"
    blender.write_text('#!/bin/sh\necho "$@"\nexit 4\n')
    blender.chmod(0o755)
    # -S: no packages, hence no bpy.
    words = [sys.executable, "-S", str(ROOT / "farm" / "as_blender.py"), *COMMAND]
    run = subprocess.run(words, env={"BLENDER": str(blender)}, capture_output=True, text=True, check=False)
    assert run.returncode == 4
    assert re.search(r"--python \S+run\.py -- passes --frames=1-4$", run.stdout.strip())
    missing = subprocess.run(
        words, env={"BLENDER": "/no/blender"}, capture_output=True, text=True, check=False
    )
    assert missing.returncode == 3
    assert missing.stderr == "Error: /no/blender cannot be run: No such file or directory.\n"
    wrong = subprocess.run(
        [*words[:3], "-b"], env={**os.environ}, capture_output=True, text=True, check=False
    )
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("Error: the words name neither")
