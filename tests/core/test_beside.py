"""A process beside this one runs a module of the core, in a package of the same name."""

from __future__ import annotations

from pathlib import Path

import pytest

from potmesil_addon import __version__, beside


@pytest.mark.parametrize("package", ["potmesil_addon", "bl_ext.user_default.camera.potmesil_addon"])
def test_module_runs_in_the_package(package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(beside, "_CORE", package)
    with (tmp_path / "log").open("wb") as log:
        process = beside.start("cli", ["--version"], log)
        assert process.wait(timeout=60) == 0
    assert __version__ in (tmp_path / "log").read_text()


def test_modules_in_the_present_folder_do_not_come_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numpy.py").write_text("raise SystemExit(5)")
    monkeypatch.chdir(tmp_path)
    with (tmp_path / "log").open("wb") as log:
        assert beside.start("cli", ["--version"], log).wait(timeout=60) == 0
