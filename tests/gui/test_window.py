"""The extension in a real window: panel, Render, Process; and the real command line of the same Blender."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
BLENDER = os.environ.get("BLENDER", "")
PICTURES = ROOT / "build" / "gui"

pytestmark = [
    pytest.mark.gui,
    pytest.mark.skipif(not BLENDER, reason="BLENDER names no Blender with a window"),
]


@pytest.fixture(scope="module")
def blender(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Run the Blender with the extension installed and preferences of its own."""
    folder = tmp_path_factory.mktemp("blender")
    subprocess.run(
        [sys.executable, str(ROOT / "tools" / "build_extension.py"), "--output", str(folder)], check=True
    )
    (archive,) = folder.glob("*.zip")
    resources = folder / "resources"
    resources.mkdir()
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(resources)}

    def run(*arguments: str, timeout: float = 180.0) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [BLENDER, *arguments],
            env=environment,
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )

    # A Blender that is a script may install itself at its first call.
    assert run("--version", timeout=1200.0).returncode == 0
    done = run("--command", "extension", "install-file", "-r", "user_default", "-e", str(archive))
    assert done.returncode == 0, done.stdout + done.stderr
    return run


@pytest.fixture(scope="module")
def seen(blender: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the driven session wrote down; its pictures are kept in build/gui."""
    folder = tmp_path_factory.mktemp("seen")
    script = str(ROOT / "tests" / "gui" / "drive.py")
    done = blender("--enable-event-simulate", "--python", script, "--", str(folder), timeout=900.0)
    PICTURES.mkdir(parents=True, exist_ok=True)
    for picture in folder.glob("*.png"):
        shutil.copy(picture, PICTURES)
    result = folder / "seen.json"
    assert result.exists(), done.stdout + done.stderr
    values: dict[str, Any] = json.loads(result.read_text())
    return values


def test_render_button_makes_a_result_and_shows_it(seen: dict[str, Any]) -> None:
    assert seen["errors"] == []
    assert seen["started"]
    assert seen["error"] == ""
    assert seen["result"] == [480, 270]
    assert seen["shown"] == "Potmesil Result"


def test_process_button_refocuses(seen: dict[str, Any]) -> None:
    assert seen["refocused"]


def test_the_panel_knows_how_sure_the_result_is(seen: dict[str, Any]) -> None:
    known, guessed, expected_error = seen["quality"]
    assert known
    assert 0.0 < guessed < 1.0
    assert 0.0 < expected_error < 0.2


def test_process_button_takes_the_present_shutter(seen: dict[str, Any]) -> None:
    assert seen["exposed"]
    assert seen["error_after_process"] == ""


def test_escape_cancels_the_render_and_gives_everything_back(seen: dict[str, Any]) -> None:
    assert seen["borrowed"]
    assert seen["given_back"]
    assert seen["handlers"] == 0
    assert seen["result_kept"]
    assert seen["file_format"] == "PNG"


@pytest.mark.parametrize(
    "name", ["panel", "aperture", "shutter_curve", "printer", "rendered", "processed", "exposed"]
)
def test_window_is_drawn(seen: dict[str, Any], name: str) -> None:
    png = pytest.importorskip("png")
    columns, rows, lines, _ = png.Reader(str(PICTURES / f"{name}.png")).asRGB8()
    picture = np.vstack([np.asarray(line) for line in lines])
    assert (columns, rows) == (1600, 900)
    assert picture.std() > 5.0


def test_command_renders_frames(blender: Any, tmp_path: Path) -> None:
    blend = tmp_path / "scene.blend"
    make = (
        "import bpy; s = bpy.context.scene; s.render.engine = 'CYCLES'; s.cycles.samples = 1; "
        "s.cycles.use_denoising = False; s.render.resolution_x = s.render.resolution_y = 32; "
        f"bpy.ops.wm.save_as_mainfile(filepath={str(blend)!r})"
    )
    assert blender("-b", "--python-exit-code", "1", "--python-expr", make).returncode == 0
    render = ("--command", "potmesil_camera", "render", "--frames", "1-2")
    done = blender("-b", str(blend), *render, "--output", str(tmp_path / "####.exr"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "0001.exr").exists()
    assert (tmp_path / "0002.exr").exists()
    again = tmp_path / "again_####.exr"
    script = ("--python-exit-code", "1", "--python", str(ROOT / "farm" / "run.py"), "--")
    done = blender("-b", str(blend), *script, "render", "--output", str(again))
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "again_0001.exr").exists()


def test_command_on_a_missing_file_is_wrong_input(blender: Any, tmp_path: Path) -> None:
    done = blender(
        "-b", str(tmp_path / "missing.blend"), "--command", "potmesil_camera", "render", "--output", "x.exr"
    )
    assert done.returncode == 3
    assert "No .blend file is open" in done.stderr
