"""What Blender writes is there whole or not at all, under any name, and on a full disk."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from sample_scenes.building import emitter

from .conftest import ROOT
from .scenes import card

OpenEXR = pytest.importorskip("OpenEXR")

KILLS = int(os.environ.get("POTMESIL_KILLS", "10"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_exports_killed_at_any_moment_leave_whole_files_or_none(tmp_path: Path) -> None:
    # A disk takes its time to flush.
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else tmp_path
    with tempfile.TemporaryDirectory(dir=memory, prefix="potmesil_test_") as folder:
        script = ROOT / "tests" / "blender" / "killed_exports.py"
        environment = {
            **os.environ,
            "BLENDER_USER_RESOURCES": str(tmp_path),
        }
        done = subprocess.run(
            [sys.executable, "-W", "ignore", str(script), folder, str(KILLS)],
            env=environment,
            capture_output=True,
            text=True,
            timeout=300 + 3 * KILLS,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    seen = json.loads(next(line for line in done.stdout.splitlines() if line.startswith("{")))
    assert seen["kills"] == KILLS
    assert seen["new"] > 0
    assert seen["missing"] > 0


@pytest.fixture
def small(scene: Any) -> Any:
    """A card, in a picture of few pixels without motion, written as PNG."""
    card(scene, "Near", (0.0, 4.0, 0.0), 2.0, emitter("Red", (1.0, 0.0, 0.0)))
    scene.render.resolution_x, scene.render.resolution_y = 24, 16
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format = "PNG"
    own = scene.potmesil_camera
    own.use_overscan = own.use_hidden_surfaces = own.use_motion = False
    scene.frame_start = scene.frame_end = 7
    return scene


# Blender takes a backslash in a path of its own for a slash, and braces for a template.
ODD = 'it\'s "odd"\n100%d \N{GRINNING FACE} e\N{COMBINING ACUTE ACCENT} . '


@pytest.mark.parametrize("name", [ODD, os.fsdecode(b"bytes \xff")], ids=["odd", "bytes"])
def test_odd_names_are_names(small: Any, tmp_path: Path, name: str) -> None:
    """Of the .blend file and its folder, the scene, samples and pictures, by Blender's own paths."""
    folder = tmp_path / name
    try:
        folder.mkdir()
    except (OSError, ValueError):
        pytest.skip("the disk does not take this name")
    if name == ODD:
        small.name = name
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"))
    small.potmesil_camera.samples_path = f"//samples/{name}_####.exr"
    small.render.filepath = f"//out/{name}_####.png"
    assert bpy.ops.potmesil.render_animation() == {"FINISHED"}
    assert [path.name for path in (folder / "samples").iterdir()] == [f"{name}_0007.exr"]
    assert [path.name for path in (folder / "out").iterdir()] == [f"{name}_0007.png"]
    # Once more over what is there, from the samples.
    before = (folder / "out" / f"{name}_0007.png").stat().st_ino
    assert bpy.ops.potmesil.process_animation() == {"FINISHED"}
    (picture,) = (folder / "out").iterdir()
    assert picture.stat().st_ino != before


def test_what_is_beside_an_unsaved_file_is_refused_in_a_sentence(small: Any) -> None:
    small.render.filepath = "//out/"
    with pytest.raises(RuntimeError, match=r"relative to a \.blend file that was never saved") as caught:
        bpy.ops.potmesil.render_animation()
    assert str(caught.value).strip().count("\n") == 0


def test_a_folder_removed_while_blender_renders_is_made_again(small: Any, tmp_path: Path) -> None:
    out = tmp_path / "gone"
    out.mkdir()
    small.render.filepath = str(out / "####.png")

    def remove(*_: object) -> None:
        out.rmdir()

    bpy.app.handlers.render_post.append(remove)
    try:
        bpy.ops.potmesil.render_animation()
    finally:
        bpy.app.handlers.render_post.remove(remove)
    assert [path.name for path in out.iterdir()] == ["0007.png"]


@pytest.fixture
def small_files() -> Iterator[None]:
    """Let no file become larger than 4 kB: to a writer it is as if the disk were full."""
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, before)


# Blender 5 crashes where it cannot write WebP.
FORMATS = ["PNG", "JPEG", "OPEN_EXR", "TIFF", "BMP", "TARGA", "TARGA_RAW", "IRIS", "JPEG2000", "HDR", "DPX"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limits")
@pytest.mark.parametrize("kind", FORMATS)
def test_a_picture_that_finds_no_room_is_not_there(
    small: Any, module: Any, tmp_path: Path, request: pytest.FixtureRequest, kind: str
) -> None:
    """Blender says nothing of it for PNG, BMP and Targa."""
    files, errors = module("potmesil_addon.files"), module("potmesil_addon.errors")
    image = bpy.data.images.new("Noise", 160, 160, float_buffer=True)
    image.pixels.foreach_set(np.random.default_rng(0).random(160 * 160 * 4, dtype=np.float32))
    small.render.image_settings.file_format = kind
    path = tmp_path / ("out.tga" if kind.startswith("TARGA") else f"out.{kind.lower()}")
    path.write_text("old")

    def write() -> None:
        with files.whole_file(path) as part:
            image.save_render(str(part), scene=small)

    request.getfixturevalue("small_files")
    with pytest.raises(errors.OutputError, match="Cannot write") as caught:
        write()
    assert "\n" not in str(caught.value)
    assert ".part" not in str(caught.value)
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_a_path_as_long_as_blender_takes_is_written(small: Any, module: Any, tmp_path: Path) -> None:
    """Blender cuts longer ones, and writes what is left of them."""
    files = module("potmesil_addon.files")
    image = bpy.data.images.new("Dot", 4, 4)
    folder = tmp_path
    while len(str(folder)) < 800:
        folder = folder / ("f" * 100)
    path = folder / ("x" * (1018 - len(str(folder))) + ".png")
    with files.whole_file(path) as part:
        image.save_render(str(part), scene=small)
    assert [each.name for each in folder.iterdir()] == [path.name]
