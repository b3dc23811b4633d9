"""Scripts that a .blend file brings stay off, unless Blender's own switch turns them on."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import pytest

from .conftest import ROOT

RUN = ROOT / "farm" / "run.py"


@pytest.fixture
def trap(scene: Any, tmp_path: Path) -> Path:
    """A .blend file with a text that runs when it is opened, and a driver that runs a script."""
    script = tmp_path / "driver.py"
    script.write_text(f"open({str(tmp_path / 'driver ran')!r}, 'w').close()\n")
    text = bpy.data.texts.new("trap.py")
    text.write(f"open({str(tmp_path / 'text ran')!r}, 'w').close()\n")
    text.use_module = True
    item = bpy.data.objects.new("Driven", None)
    scene.collection.objects.link(item)
    driver = item.driver_add("location", 0).driver
    driver.expression = f"bpy.utils.execfile({str(script)!r}) and 0.0"
    path = tmp_path / "trap.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    for name in ran(tmp_path):
        (tmp_path / name).unlink()
    return path


def ran(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.name.endswith(" ran")}


def run(command: list[str], resources: Path) -> int:
    resources.mkdir(exist_ok=True)
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(resources)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=120)
    return done.returncode


def test_the_trap_is_one(trap: Path, tmp_path: Path) -> None:
    # Blender 4.5 as a module hangs at its end where a driver has run, see farm/run.py.
    code = (
        "import bpy, os, sys; bpy.ops.wm.open_mainfile(filepath=sys.argv[1], use_scripts=True); os._exit(0)"
    )
    assert run([sys.executable, "-c", code, str(trap)], tmp_path / "user") == 0
    assert ran(tmp_path) == {"text ran", "driver ran"}


@pytest.mark.skipif(
    "--blend" not in RUN.read_text(encoding="utf-8"), reason="the script opens no file by itself"
)
def test_the_farm_script_runs_nothing_of_a_file(trap: Path, tmp_path: Path) -> None:
    """With input that is missing the command ends at once: the file is open by then."""
    command = [sys.executable, str(RUN), "--blend", str(trap), "info", str(tmp_path / "no.exr")]
    assert run(command, tmp_path / "user") == 3
    assert not ran(tmp_path)


@pytest.mark.skipif(not os.environ.get("BLENDER"), reason="no Blender is named in $BLENDER")
@pytest.mark.parametrize("switch", ["", "--enable-autoexec"])
def test_blender_itself_needs_its_switch(trap: Path, tmp_path: Path, switch: str) -> None:
    command = [shutil.which(os.environ["BLENDER"]) or os.environ["BLENDER"], "-b", *filter(None, [switch])]
    words = ["--python-exit-code", "1", "--python", str(RUN), "--", "info", str(tmp_path / "no.exr")]
    assert run([*command, str(trap), *words], tmp_path / "user") == 3
    assert ran(tmp_path) == ({"text ran", "driver ran"} if switch else set())
