"""Flamenco's job type, compiled as its Manager does and run as its Worker does."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
NODE = shutil.which("node")
SCRIPT = ROOT / "farm" / "flamenco" / "potmesil_camera.js"

pytestmark = pytest.mark.skipif(NODE is None, reason="node is not installed")

# The Worker's own (command_blender.go, 3.9-dev).
STEPS = (
    re.compile(r"(?:^|(?:render\s+\|\s+))Time: ([0-9:.]+)"),
    re.compile(r"(?:^|(?:render\s+\|\s+))[sS]kipping existing frame"),
)
SAVED = re.compile(r"(?:^|(?:render\s+\|\s+))Saved: '(.*)'")


def manager(job: dict[str, Any], script: str | Path = SCRIPT, version: float = 3.8) -> Any:
    words = [str(NODE), str(HERE / "flamenco_manager.cjs"), str(script), str(version)]
    run = subprocess.run(words, input=json.dumps(job), capture_output=True, text=True, check=False)
    if run.returncode:
        raise ValueError(run.stderr.strip())
    return json.loads(run.stdout)


def settings(**changes: Any) -> dict[str, Any]:
    fixed = {
        "frames": "1-10",
        "chunk_size": 4,
        "samples": "/film/s/####.exr",
        "output": "/film/p/####.png",
        "blendfile": "/film/shot 1.blend",
        "scene": "Scene",
    }
    return {"name": "a job", "settings": {**fixed, **changes}}


@pytest.mark.parametrize(
    ("frames", "size", "chunks"),
    [
        ("1..10,20..25,40,3..8", 4, ["1-4", "5-8", "9,10,20,21", "22-25", "40"]),
        (" 1  .. 10,\t20..25\n,40   ", 4, ["1-4", "5-8", "9,10,20,21", "22-25", "40"]),
        ("47", 4, ["47"]),
        ("1-3", 3, ["1-3"]),
    ],
)
def test_harness_chunks_as_the_manager(frames: str, size: int, chunks: list[str]) -> None:
    assert manager({"frames": frames, "chunk_size": size}, "chunks") == chunks


def test_each_chunk_is_processed_after_its_own_passes() -> None:
    tasks = manager(settings())["tasks"]
    assert [task["name"] for task in tasks] == [
        *("passes-1-4", "process-1-4", "passes-5-8", "process-5-8", "passes-9,10", "process-9,10")
    ]
    assert [task["dependencies"] for task in tasks] == [[], [0], [], [2], [], [4]]
    assert [task["commands"][0]["steps"] for task in tasks] == [4, 4, 4, 4, 2, 2]


@pytest.mark.parametrize(
    ("stage", "command"), [("all", "render"), ("passes", "passes"), ("process", "process")]
)
def test_one_task_a_chunk_where_one_command_does_it(stage: str, command: str) -> None:
    tasks = manager(settings(stage=stage))["tasks"]
    assert [task["name"] for task in tasks] == [f"{command}-{chunk}" for chunk in ("1-4", "5-8", "9,10")]
    assert all(task["dependencies"] == [] for task in tasks)


def test_options_are_passed_where_they_are_set() -> None:
    plain = manager(settings(stage="process"))["tasks"][0]["commands"][0]["parameters"]["args"]
    assert not [word for word in plain if word.startswith(("--threads", "--max-memory"))]
    job = settings(stage="process", threads=8, max_memory=6.5, existing="keep", frame_retries=5)
    words = manager(job)["tasks"][0]["commands"][0]["parameters"]["args"]
    assert {"--threads=8", "--max-memory=6.5", "--existing=keep", "--frame-retries=5"} <= set(words)


def test_movie_waits_for_all_pictures() -> None:
    made = manager(settings(stage="both", movie="/film/film.mp4"))["tasks"]
    assert made[-1]["name"] == "movie"
    assert made[-1]["dependencies"] == [1, 3, 5]
    assert "--input=/film/p/####.png" in made[-1]["commands"][0]["parameters"]["args"]
    with pytest.raises(ValueError, match="a movie needs pictures"):
        manager(settings(stage="passes", movie="/film/film.mp4"))


def test_manager_before_steps() -> None:
    tasks = manager(settings(), version=3.7)["tasks"]
    assert len(tasks) == 6
    assert "steps" not in tasks[0]["commands"][0]


def test_unknown_stage_is_refused() -> None:
    with pytest.raises(ValueError, match='"post" is no stage'):
        manager(settings(stage="post"))


def test_settings_are_what_the_add_on_knows() -> None:
    kinds = {"string", "int32", "float", "bool"}
    keys = {"key", "type", "subtype", "choices", "propargs", "label", "description", "default", "eval"}
    keys |= {"evalInfo", "visible", "required", "editable"}
    for setting in manager(settings())["job_type"]["settings"]:
        assert setting["type"] in kinds
        assert setting.keys() <= keys
        assert not setting.get("choices") or setting["default"] in setting["choices"]


def test_worker_counts_a_step_for_each_frame(tmp_path: Path) -> None:
    scene = tmp_path / "shot 1.blend"
    scene.touch()
    templates = {name: str(tmp_path / name / "####.exr") for name in ("samples", "output")}
    tasks = manager(settings(frames="1-3,7", chunk_size=3, blendfile=str(scene), **templates))["tasks"]
    for kind in ("made", "skipped"):
        saved = []
        for task in tasks:
            (command,) = task["commands"]
            parameters = command["parameters"]
            assert (command["name"], parameters["exe"], parameters["exeArgs"]) == (
                "blender-render",
                "{blender}",
                "{blenderArgs}",
            )
            # The stub takes no more than one -b, which {blenderArgs} has too.
            words = [*parameters["argsBefore"], parameters["blendfile"], *parameters["args"]]
            run = subprocess.run(
                [sys.executable, str(HERE / "stub_blender.py"), *words],
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                capture_output=True,
                text=True,
                check=True,
            )
            lines = run.stdout.splitlines()
            assert sum(bool(step.search(line)) for line in lines for step in STEPS) == command["steps"]
            saved += [match[1] for line in lines if (match := SAVED.search(line))]
        assert len(saved) == (8 if kind == "made" else 0)
    assert sorted(path.name for path in (tmp_path / "output").iterdir()) == [
        *("0001.exr", "0002.exr", "0003.exr", "0007.exr")
    ]
