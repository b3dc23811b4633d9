"""Kernels are compiled for a picture by a second process too, into the folder that all use."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")


def test_the_second_process_compiles_what_a_picture_needs(
    scene: Any, module: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The papers' plain sum needs few kernels.
    scene.potmesil_camera.visibility = "none"
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    kernels, beside = module("operators.kernels"), module("potmesil_addon.beside")
    # A folder without kernels, of which nothing has been read into this process. The tests of the core may
    # have named one for all.
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(kernels, "cache_folder", lambda: tmp_path / "kernels")
    started = []
    start = beside.start
    monkeypatch.setattr(beside, "start", lambda *arguments: started.append(start(*arguments)))
    values = module("operators.process").settings_values(bpy.context)
    kernels.compile_beside(module("operators.export").samples_path(scene), values)
    assert not started
    kernels._help("some kernel")
    kernels._help("another one")
    (process,) = started
    assert process.wait(timeout=300.0) == 0
    names = {path.name.split("-")[0] for path in (tmp_path / "kernels").rglob("*.nbi")}
    assert "scatter._scatter_bands" in names
    assert "blocks._put_together" in names


def test_the_second_process_ends_with_the_picture(
    scene: Any, module: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernels, process = module("operators.kernels"), module("operators.process")
    monkeypatch.setattr(
        module("potmesil_addon.beside"), "start", lambda *_: subprocess.Popen(["sleep", "600"])
    )
    for number, end in enumerate(("close", "throw")):
        steps = process.process_samples(bpy.context, tmp_path / f"missing_{number}.exr")
        next(steps)
        kernels._help("some kernel")
        helper = kernels._Wanted.process
        assert helper.poll() is None
        if end == "close":
            steps.close()
        else:
            with pytest.raises(module("potmesil_addon.errors").PotmesilError):
                next(steps)
        assert helper.poll() is not None
        assert kernels._Wanted.process is None
