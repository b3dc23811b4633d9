"""An animation on a real Slurm cluster of three nodes, and what goes wrong on one: `make test-slurm`.

Each of the 24 frames has to be there once, whole, and as a single machine makes it.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from .cluster import Cluster, started, why_not

OpenEXR = pytest.importorskip("OpenEXR")

ROOT = Path(__file__).resolve().parents[3]
SUBMIT = ROOT / "farm" / "slurm" / "submit.py"
CHUNKS = ROOT / "farm" / "openjd" / "chunks.py"
TEMPLATE = ROOT / "farm" / "openjd" / "template.yaml"
FARM_PYTHON = ROOT / ".venv" / "farm" / "bin" / "python"
FRAMES = 24
PROCESS = [sys.executable, "-m", "potmesil_addon", "process"]
WITHOUT_NUMBA = ROOT / "tests" / "without_numba"
ENVIRONMENT = {"PYTHONPATH": os.pathsep.join([str(WITHOUT_NUMBA), str(ROOT)])}

reason = (
    "takes a cluster and two minutes: make test-slurm" if "POTMESIL_SLURM" not in os.environ else why_not()
)
pytestmark = [pytest.mark.skipif(reason is not None, reason=str(reason)), pytest.mark.slow]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with started(tmp_path_factory.mktemp("cluster")) as running:
        yield running


@dataclass
class Shot:
    """An animation, and what a single machine makes of it."""

    folder: Path
    blend: Path
    samples: Path
    pictures: Path
    """From the .blend, with the scene's settings."""
    plain: Path
    """From the samples files, without Blender."""


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    folder = tmp_path_factory.mktemp("a shot")
    made = Shot(folder, folder / "shot.blend", folder / "samples", folder / "pictures", folder / "plain")
    alone([sys.executable, str(Path(__file__).parent / "shot.py"), str(made.blend), str(FRAMES)])
    for stage in ("passes", "process"):
        alone([*blender(made.blend), stage, *files(made.samples, made.pictures), f"--frames=1-{FRAMES}"])
    alone(
        [
            *PROCESS,
            f"{made.samples}/####.exr",
            f"--output={made.plain}/####.exr",
            f"--frames=1-{FRAMES}",
        ]
    )
    for result in (made.samples, made.pictures, made.plain):
        assert names(result) == every_frame()
    return made


def alone(command: list[str]) -> None:
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def blender(blend: Path) -> list[str]:
    return [sys.executable, str(ROOT / "farm" / "run.py"), "--", "--blend", str(blend)]


def files(samples: Path, pictures: Path) -> list[str]:
    return [f"--samples={samples}/####.exr", f"--output={pictures}/####.exr"]


def every_frame() -> list[str]:
    return [f"{frame:04d}.exr" for frame in range(1, FRAMES + 1)]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write_chunks(folder: Path, size: int) -> Path:
    """Write the chunks of the OpenJD template."""
    path = folder / f"chunks of {size}.txt"
    words = [str(TEMPLATE), "Process", f"Frames=1-{FRAMES}", f"ChunkSize={size}"]
    with path.open("w") as file:
        subprocess.run([str(FARM_PYTHON), str(CHUNKS), *words], stdout=file, check=True)
    return path


def submit(cluster: Cluster, chunks: Path, logs: Path, command: list[str], *options: str) -> list[str]:
    """Submit as a user does; return the arrays' numbers."""
    words = ["--threads=1", "--memory=600", "--time=0:30:00", f"--logs={logs}", *options]
    said = cluster.run([sys.executable, str(SUBMIT), str(chunks), *words, "--", *command], **ENVIRONMENT)
    return re.findall(r": (\d+)$", said, re.MULTILINE)


def ended(cluster: Cluster, job: str, tasks: int) -> dict[str, dict[str, str]]:
    """Wait for the end of an array, and return what Slurm says of each task."""

    def over() -> bool:
        found = own()
        return len(found) == tasks and not any(
            task["JobState"] in ("PENDING", "RUNNING", "COMPLETING", "REQUEUED") for task in found.values()
        )

    def own() -> dict[str, dict[str, str]]:
        return {key.split("_")[1]: task for key, task in cluster.jobs().items() if key.startswith(f"{job}_")}

    cluster.wait(f"job {job}", over, 180)
    return own()


def log(logs: Path, job: str, task: int) -> str:
    (path,) = logs.glob(f"*.{job}_{task}.log")
    return path.read_text()


def pixels(path: Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {
            f"{part}.{name}": channel.pixels
            for part in range(len(file.parts))
            for name, channel in file.channels(part).items()
        }


def assert_same_pixels(path: Path, reference: Path) -> None:
    ours, theirs = pixels(path), pixels(reference)
    assert ours.keys() == theirs.keys()
    for name, values in ours.items():
        np.testing.assert_array_equal(values, theirs[name], err_msg=f"{path.name} {name}")


def assert_all_there(folder: Path, reference: Path, killed: str | None = None) -> None:
    """Every frame once, byte for byte, and beside them at most a part file of a frame that was killed."""
    there = names(folder)
    if killed is not None:
        there = [name for name in there if not re.fullmatch(rf"\.{killed}\..+\.part\.exr", name)]
    assert there == every_frame()
    for name in there:
        assert pixels(folder / name)
        assert (folder / name).read_bytes() == (reference / name).read_bytes(), name


# Plain run.


def test_passes_and_then_pictures_on_three_nodes(cluster: Cluster, shot: Shot, tmp_path: Path) -> None:
    samples, pictures, logs = tmp_path / "samples", tmp_path / "pictures", tmp_path / "logs"
    command = [*blender(shot.blend), "{stage}", *files(samples, pictures)]
    first, second = submit(cluster, write_chunks(tmp_path, 8), logs, command, "--memory=1500")
    passes, process = ended(cluster, first, 3), ended(cluster, second, 3)
    assert {task["JobState"] for task in [*passes.values(), *process.values()]} == {"COMPLETED"}, (
        cluster.story()
    )
    assert {task["NodeList"] for task in passes.values()} == {"n1", "n2", "n3"}
    for index, task in process.items():
        assert task["StartTime"] >= passes[index]["EndTime"]
    assert names(samples) == every_frame()
    for name in every_frame():
        assert_same_pixels(samples / name, shot.samples / name)
    assert names(pictures) == every_frame()
    for name in every_frame():
        assert_same_pixels(pictures / name, shot.pictures / name)


# Troubles, all in one array of six tasks.


@dataclass
class Troubles:
    """What became of an array in which much went wrong, and of the same array submitted again."""

    job: str
    logs: Path
    pictures: Path
    tasks: dict[str, dict[str, str]]
    killed_node: str
    left: dict[str, bytes]
    """Each file that was there after the first array."""
    again: str
    tasks_again: dict[str, dict[str, str]] = field(default_factory=dict)

    def log(self, task: int) -> str:
        return log(self.logs, self.job, task)

    def log_again(self, task: int) -> str:
        return log(self.logs, self.again, task)


def heavy(path: Path, times: int = 16) -> None:
    """Make a samples file so large that a process stays with it."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        parts = []
        for part in file.parts:
            header = dict(part.header)
            for window in ("dataWindow", "displayWindow"):
                low, high = header[window]
                header[window] = (low, low + (high - low + 1) * times - 1)
            channels = {name: np.tile(c.pixels, (times, times)) for name, c in part.channels.items()}
            parts.append(OpenEXR.Part(header, channels, part.name()))
        whole = OpenEXR.File(parts)
    path.unlink()
    whole.write(str(path))


@pytest.fixture(scope="module")
def troubles(cluster: Cluster, shot: Shot, tmp_path_factory: pytest.TempPathFactory) -> Troubles:
    folder = tmp_path_factory.mktemp("troubles")
    samples, pictures, logs = folder / "samples", folder / "pictures", folder / "logs"
    shutil.copytree(shot.samples, samples)
    pictures.mkdir()

    def picture(frame: int) -> Path:
        return pictures / f"{frame:04d}.exr"

    def samples_file(frame: int) -> Path:
        return samples / f"{frame:04d}.exr"

    def mend(frame: int) -> None:
        fresh = samples / "fresh"
        shutil.copyfile(shot.samples / f"{frame:04d}.exr", fresh)
        fresh.replace(samples_file(frame))

    # Tasks 0, 3 and 5 stay with their third frame until something happens to them.
    for frame in (3, 15, 23):
        heavy(samples_file(frame))
    # Tasks 1 and 2 cannot write theirs: there is a folder in its place.
    for frame in (7, 11):
        (picture(frame) / "in the way").mkdir(parents=True)
    # Task 4 finds rubbish in place of its samples.
    samples_file(19).write_bytes(b"rubbish")

    command = [*PROCESS, f"{samples}/####.exr", f"--output={pictures}/####.exr"]
    chunks = write_chunks(folder, 4)
    (job,) = submit(cluster, chunks, logs, command, "--stages=process", "--retries=1", "--memory=1500")

    def state(task: int) -> dict[str, str]:
        return cluster.jobs().get(f"{job}_{task}", {"JobState": "PENDING", "Restarts": "0"})

    cluster.wait("frame 2", picture(2).exists)
    killed_node = state(0)["NodeList"]
    cluster.kill_node(killed_node)
    mend(3)
    cluster.wait("task 2 to be queued again", lambda: state(2)["Restarts"] == "1")
    shutil.rmtree(picture(11))
    cluster.wait("frame 14", picture(14).exists)
    cluster.run(["scancel", f"{job}_3"])
    cluster.wait("the end of task 3", lambda: state(3)["JobState"] == "CANCELLED", 20)
    cluster.wait("frame 22", picture(22).exists)
    cluster.run(["scancel", "--batch", "--signal=USR1", f"{job}_5"])
    mend(23)
    tasks = ended(cluster, job, 6)
    left = {path.name: path.read_bytes() for path in pictures.iterdir() if path.is_file()}

    mend(15)
    mend(19)
    shutil.rmtree(picture(7))
    cluster.start_node(killed_node)
    (again,) = submit(cluster, chunks, logs, command, "--stages=process", "--memory=1500")
    made = Troubles(job, logs, pictures, tasks, killed_node, left, again)
    made.tasks_again = ended(cluster, again, 6)
    return made


def test_lost_node(cluster: Cluster, troubles: Troubles) -> None:
    task = troubles.tasks["0"]
    assert (task["JobState"], task["Restarts"]) == ("COMPLETED", "1")
    assert task["NodeList"] != troubles.killed_node
    said = (cluster.folder / "slurmctld.log").read_text()
    assert re.search(
        rf"requeue job JobId={troubles.job}_0\(\d+\) due to failure of node {troubles.killed_node}", said
    )
    assert troubles.log(0).count("Skipping existing frame") == 2


def test_failing_frame_is_tried_to_the_limit(troubles: Troubles) -> None:
    task = troubles.tasks["1"]
    assert (task["JobState"], task["Restarts"], task["ExitCode"]) == ("FAILED", "1", "4:0")
    assert "a frame failed (exit 4); queued again" in troubles.log(1)
    assert "a frame failed; given up after 2 runs (exit 4)" in troubles.log(1)
    assert troubles.log(1).count("Error: Frame 7: ") == 2


def test_mended_frame_goes_on_where_it_was(troubles: Troubles) -> None:
    task = troubles.tasks["2"]
    assert (task["JobState"], task["Restarts"]) == ("COMPLETED", "1")
    assert troubles.log(2).count("Skipping existing frame") == 2


def test_cancelled_task_ends_soon_with_whole_frames(troubles: Troubles) -> None:
    assert troubles.tasks["3"]["JobState"] == "CANCELLED"
    assert "exit 143" in troubles.log(3)
    assert not [name for name in troubles.left if name.startswith(("0015", ".0015", "0016", ".0016"))]


def test_wrong_input_is_not_tried_again(troubles: Troubles) -> None:
    task = troubles.tasks["4"]
    assert (task["JobState"], task["Restarts"], task["ExitCode"]) == ("FAILED", "0", "3:0")


def test_task_whose_time_is_up_goes_on_later(troubles: Troubles) -> None:
    task = troubles.tasks["5"]
    assert (task["JobState"], task["Restarts"]) == ("COMPLETED", "1")
    assert "its time was up (exit 143); queued again" in troubles.log(5)
    assert troubles.log(5).count("Skipping existing frame") == 2


def test_whatever_was_left_is_whole(troubles: Troubles, shot: Shot) -> None:
    frames = [name for name in troubles.left if not name.startswith(".")]
    missing = (7, 8, 15, 16, 19, 20)
    assert sorted(frames) == [f"{frame:04d}.exr" for frame in range(1, FRAMES + 1) if frame not in missing]
    for name in frames:
        assert troubles.left[name] == (shot.plain / name).read_bytes(), name


def test_submitted_again_it_is_complete(troubles: Troubles, shot: Shot) -> None:
    assert {task["JobState"] for task in troubles.tasks_again.values()} == {"COMPLETED"}
    skipped = sum(troubles.log_again(task).count("Skipping existing frame") for task in range(6))
    assert skipped == sum(not name.startswith(".") for name in troubles.left)
    assert_all_there(troubles.pictures, shot.plain, killed="0003")


# Memory.


def test_too_little_memory_is_named_and_more_is_asked_for(
    cluster: Cluster, shot: Shot, tmp_path: Path
) -> None:
    pictures, logs = tmp_path / "pictures", tmp_path / "logs"
    command = [*PROCESS, f"{shot.samples}/####.exr", f"--output={pictures}/####.exr"]
    chunks = write_chunks(tmp_path, FRAMES)
    options = ("--stages=process", "--memory=75")
    (job,) = submit(cluster, chunks, logs, command, *options)
    (more,) = submit(cluster, chunks, logs, command, *options, "--most-memory=600")
    task = ended(cluster, job, 1)["0"]
    assert (task["JobState"], task["Restarts"], task["ExitCode"]) == ("FAILED", "0", "33:0")
    assert "75 MB of memory were too small (exit 33). Submit it again with more." in log(logs, job, 0)
    task = ended(cluster, more, 1)["0"]
    assert task["JobState"] == "COMPLETED"
    assert "75 MB of memory were too small (exit 33); queued again with 150 MB." in log(logs, more, 0)
    assert_all_there(pictures, shot.plain)


def test_memory_that_slurm_refuses_is_named(cluster: Cluster, tmp_path: Path) -> None:
    # In place of a render, whose memory the extension cannot limit.
    greedy = [
        sys.executable,
        "-c",
        "import time; x = bytearray(400 << 20); x[::4096] = x[::4096]; time.sleep(60)",
    ]
    options = ("--stages=process", "--memory=100", "--sbatch=--acctg-freq=task=1")
    (job,) = submit(cluster, write_chunks(tmp_path, FRAMES), tmp_path, greedy, *options)
    task = ended(cluster, job, 1)["0"]
    assert task["JobState"] in ("FAILED", "CANCELLED", "OUT_OF_MEMORY"), task
    assert "emory" in log(tmp_path, job, 0)
