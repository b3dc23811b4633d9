"""The OpenJD template, checked and run by OpenJD's own program: with a stub, and with Blender as a module."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FARM = ROOT / ".venv" / "farm" / "bin"
BUNDLE = ROOT / "farm" / "openjd"
TEMPLATE = BUNDLE / "template.yaml"

pytestmark = pytest.mark.skipif(
    not (FARM / "openjd").exists(), reason="OpenJD's program is not installed: make test-farm"
)


@dataclass(frozen=True)
class Shot:
    """A job's files, in a folder whose name has a blank."""

    folder: Path
    blender: Path
    environment: dict[str, str]

    @property
    def samples(self) -> Path:
        return self.folder / "samples"

    @property
    def pictures(self) -> Path:
        return self.folder / "pictures"

    def words(self, command: str, **changes: object) -> list[str]:
        values = {
            "BlendFile": self.folder / "shot.blend",
            "Samples": self.samples / "####.exr",
            "Output": self.pictures / "####.exr",
            "Blender": self.blender,
            "FrameRetries": 0,
            "MaxMemory": 4,
            **changes,
        }
        parameters = [word for name, value in values.items() for word in ("-p", f"{name}={value}")]
        return [str(FARM / "openjd"), command, str(TEMPLATE), *parameters]

    def run(self, *more: str, **changes: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*self.words("run", **changes), *more],
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )

    def calls(self) -> list[tuple[str, str]]:
        """The stage and the frames of each run of the stub, which are then forgotten."""
        path = self.samples / "calls.txt"
        runs = [json.loads(line) for line in path.read_text().splitlines()]
        path.unlink()
        return [(words[0], words[1].removeprefix("--frames=")) for words in runs]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.exr"))


@pytest.fixture
def stub(tmp_path: Path) -> Shot:
    folder = tmp_path / "a shot"
    folder.mkdir()
    (folder / "shot.blend").touch()
    blender = tmp_path / "blender"
    blender.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{HERE / "stub_blender.py"}" "$@"\n')
    blender.chmod(0o755)
    return Shot(folder, blender, {**os.environ, "PYTHONPATH": str(ROOT)})


def test_templates_are_valid() -> None:
    for template in (TEMPLATE, ROOT / "farm" / "openjd_movie" / "template.yaml"):
        run = subprocess.run(
            [FARM / "openjd", "check", template], capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stdout


def test_parameter_values_are_the_templates_own() -> None:
    script = (
        "import json, sys, yaml; print(json.dumps([yaml.safe_load(open(path)) for path in sys.argv[1:]]))"
    )
    paths = [TEMPLATE, BUNDLE / "parameter_values.yaml"]
    run = subprocess.run([FARM / "python", "-c", script, *paths], capture_output=True, text=True, check=True)
    template, values = json.loads(run.stdout)
    known = {each["name"] for each in template["parameterDefinitions"]}
    # In YAML a # after a blank begins a comment, and would cut a description short.
    assert all(each["description"].endswith(".") for each in template["parameterDefinitions"])
    named = {each["name"] for each in values["parameterValues"] if ":" not in each["name"]}
    assert named <= known


def test_summary_counts_the_frames(stub: Shot) -> None:
    run = subprocess.run(stub.words("summary", Frames="1-100"), capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
    assert "'Passes' (100 total Tasks)" in run.stdout
    assert "'Process' (100 total Tasks)" in run.stdout


def chunks(*words: str) -> subprocess.CompletedProcess[str]:
    command = [FARM / "python", BUNDLE / "chunks.py", TEMPLATE, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_chunks_for_schedulers_with_arrays() -> None:
    assert chunks("Process", "Frames=1-10", "ChunkSize=4").stdout.split() == ["1-4", "5-7", "8-10"]
    lines = chunks("Passes", "Frames=-3--1,1-19:3,50", "ChunkSize=4").stdout.split()
    assert lines == ["-3--1,1", "4-13:3", "16,19,50"]
    for words, sentence in (
        (("Post", "Frames=1-10"), "There is no step Post: the template has Passes, Process."),
        (("Process", "Frames=1..4"), "Unexpected '.' in '1..4'"),
        (("Process", "Frams=1-4"), "not defined in the template: Frams"),
    ):
        run = chunks(*words)
        assert (run.returncode, run.stdout) == (2, "")
        assert run.stderr.startswith("Error: ")
        assert sentence in run.stderr


def test_all_passes_come_before_the_pictures(stub: Shot) -> None:
    run = stub.run(Frames="1-5:2,10", ChunkSize=3)
    assert run.returncode == 0, run.stdout
    assert stub.calls() == [("passes", "1,3"), ("passes", "5,10"), ("process", "1,3"), ("process", "5,10")]
    assert names(stub.samples) == names(stub.pictures) == ["0001.exr", "0003.exr", "0005.exr", "0010.exr"]


def test_one_chunk_of_a_step(stub: Shot) -> None:
    run = stub.run("--step", "Passes", "-tp", "Frame=2-3", Frames="1-10")
    assert run.returncode == 0, run.stdout
    assert stub.calls() == [("passes", "2-3")]


def test_failed_frame_ends_the_job_and_the_same_job_resumes_it(stub: Shot) -> None:
    stub.samples.mkdir()
    broken = stub.samples / "fail-3"
    broken.touch()
    failed = stub.run(Frames="1-6", ChunkSize=2)
    assert failed.returncode == 1
    assert "exited with code: 4" in failed.stdout
    assert "Error: Frame 3" in failed.stdout
    assert names(stub.pictures) == ["0001.exr", "0002.exr"]
    broken.unlink()
    again = stub.run(Frames="1-6", ChunkSize=2)
    assert again.returncode == 0, again.stdout
    # Six samples files and two pictures were there.
    assert again.stdout.count("Skipping existing frame") == 8
    assert len(names(stub.pictures)) == 6


def test_zip_that_cannot_be_installed_ends_the_job(stub: Shot, tmp_path: Path) -> None:
    # An importable bpy whose Blender does nothing, as the real one does where the zip is wrong.
    (tmp_path / "bpy.py").write_text("class app:\n    binary_path = '/bin/true'\n")
    stub.environment["PYTHONPATH"] += os.pathsep + str(tmp_path)
    archive = tmp_path / "missing.zip"
    run = stub.run(Frames="1-2", ExtensionZip=archive)
    assert run.returncode == 1
    assert f"{archive} could not be installed." in run.stdout
    assert not stub.samples.exists()


def test_zip_is_installed_into_the_sessions_folder(stub: Shot, tmp_path: Path) -> None:
    installer = tmp_path / "installer"
    installer.write_text(
        '#!/bin/sh\necho "$BLENDER_USER_RESOURCES" "$@" > "$0.log"\n'
        'mkdir -p "$BLENDER_USER_RESOURCES/extensions/user_default/potmesil_camera"\n'
    )
    installer.chmod(0o755)
    (tmp_path / "bpy.py").write_text(f"class app:\n    binary_path = {str(installer)!r}\n")
    stub.environment["PYTHONPATH"] += os.pathsep + str(tmp_path)
    run = stub.run(Frames="1-2", ExtensionZip=tmp_path / "a zip.zip")
    assert run.returncode == 0, run.stdout
    resources, command = (tmp_path / "installer.log").read_text().split(" ", 1)
    assert command.strip() == (
        f"--command extension install-file -r user_default -e {tmp_path / 'a zip.zip'}"
    )
    # The tasks find it there: openjd_env sets it for them.
    assert f"openjd_env: BLENDER_USER_RESOURCES={resources}" in run.stdout
    assert not Path(resources).exists()


# With Blender


@pytest.fixture(scope="module")
def blend(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("bpy", reason="the bpy module is not installed")
    folder = tmp_path_factory.mktemp("real") / "a shot"
    folder.mkdir()
    path = folder / "shot.blend"
    words = [sys.executable, str(HERE / "slurm" / "shot.py"), str(path), "4"]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    return path


@pytest.fixture
def real(blend: Path, tmp_path: Path) -> Shot:
    # as_blender.py runs under the first python3 of the path. Kernels take longer to compile than frames.
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    resources = tmp_path / "user"
    resources.mkdir()
    changes = {
        "PATH": path,
        "PYTHONPATH": str(ROOT / "tests" / "without_numba"),
        "BLENDER_USER_RESOURCES": str(resources),
    }
    return Shot(blend.parent, ROOT / "farm" / "as_blender.py", {**os.environ, **changes})


def whole(path: Path) -> bool:
    """Whether a file can be read to its last pixel and shows something."""
    openexr = pytest.importorskip("OpenEXR")
    parts = openexr.File(str(path)).parts
    return all(channel.pixels.size for part in parts for channel in part.channels.values()) and any(
        channel.pixels.any() for part in parts for channel in part.channels.values()
    )


@pytest.mark.blender
def test_frames_of_a_blend_file(real: Shot) -> None:
    """Passes, a picture that cannot be written, and the same job once more, which makes what is missing."""
    every = [f"{frame:04d}.exr" for frame in range(1, 5)]
    # Nobody, root neither, replaces a folder by a file.
    obstacle = real.pictures / "0003.exr"
    obstacle.mkdir(parents=True)
    failed = real.run(Frames="1-4", ChunkSize=4)
    assert failed.returncode == 1
    assert "exited with code: 4" in failed.stdout
    assert "Error: Frame 3: " in failed.stdout
    assert names(real.samples) == every
    assert [name for name in names(real.pictures) if (real.pictures / name).is_file()] == every[:2]

    obstacle.rmdir()
    before = {path: path.stat().st_mtime_ns for path in real.folder.glob("*/*.exr")}
    again = real.run(Frames="1-4", ChunkSize=4)
    assert again.returncode == 0, again.stdout
    assert again.stdout.count("Skipping existing frame") == len(before) == 6
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert again.stdout.count("Saved: '") == 2
    assert "openjd_progress: 100.0" in again.stdout
    assert names(real.samples) == names(real.pictures) == every
    assert all(whole(path) for path in real.folder.glob("*/*.exr"))
    # Nothing half-written stays.
    assert not list(real.folder.glob("*/.*"))


@pytest.mark.blender
def test_ended_job_leaves_whole_frames(real: Shot) -> None:
    """SIGINT to OpenJD's program, as a cancelled job, reaches the command beneath it."""
    words = real.words("run", Frames="1-400", ChunkSize=400, Samples=real.folder / "ended" / "####.exr")
    job = subprocess.Popen(
        [*words, "--step", "Passes"],
        env=real.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        assert job.stdout is not None
        for line in job.stdout:
            if "Saved: '" in line:
                break
        begun = time.monotonic()
        job.send_signal(signal.SIGINT)
        rest = job.stdout.read()
        assert job.wait() == 1
    finally:
        job.kill()
        job.stdout.close()
    assert "exited with code" in rest
    # The grace is 60 s; a render ends with its process.
    assert time.monotonic() - begun < 30
    made = names(real.folder / "ended")
    assert 0 < len(made) < 400
    assert all(whole(real.folder / "ended" / name) for name in made)
