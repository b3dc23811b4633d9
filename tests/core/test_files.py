"""Whole files or none."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from potmesil_addon.errors import OutputError
from potmesil_addon.files import whole_file


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write(path: Path, text: str = "new") -> None:
    with whole_file(path) as part:
        part.write_text(text)


def test_file_appears_when_the_block_ends(tmp_path: Path) -> None:
    path = tmp_path / "out.exr"
    with whole_file(path) as part:
        assert part.parent == path.parent
        assert part.suffix == path.suffix
        assert part != path
        part.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert names(tmp_path) == ["out.exr"]


def test_missing_folders_are_made(tmp_path: Path) -> None:
    write(tmp_path / "a" / "b" / "out.json")
    assert (tmp_path / "a" / "b" / "out.json").read_text() == "new"


def test_older_file_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "out.exr"
    path.write_text("a longer old text")
    write(path)
    assert path.read_text() == "new"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, GeneratorExit])
def test_error_in_the_block_leaves_the_old_file(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "out.exr"
    path.write_text("old")

    def broken() -> None:
        with whole_file(path) as part:
            part.write_text("half")
            raise error

    with pytest.raises(error):
        broken()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["out.exr"]


@pytest.mark.parametrize(
    "failure", [OSError(28, "No space left on device"), RuntimeError("cannot write: No space left on device")]
)
def test_a_full_disk_is_an_output_error_that_says_so(tmp_path: Path, failure: Exception) -> None:
    path = tmp_path / "out.exr"
    path.write_text("old")

    def full() -> None:
        with whole_file(path) as part:
            part.write_text("half")
            raise failure

    with pytest.raises(OutputError, match="No space left on device") as caught:
        full()
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert path.read_text() == "old"
    assert names(tmp_path) == ["out.exr"]


def test_a_block_that_writes_nothing_is_an_output_error(tmp_path: Path) -> None:
    def idle() -> None:
        with whole_file(tmp_path / "out.exr"):
            pass

    with pytest.raises(OutputError):
        idle()
    assert names(tmp_path) == []


def folder_is_a_file(tmp_path: Path) -> Path:
    (tmp_path / "file").write_text("old")
    return tmp_path / "file" / "out.exr"


def target_is_a_folder(tmp_path: Path) -> Path:
    (tmp_path / "out.exr").mkdir()
    return tmp_path / "out.exr"


def folder_is_read_only(tmp_path: Path) -> Path:
    if not hasattr(os, "geteuid") or os.geteuid() == 0:
        pytest.skip("this user may write everywhere")
    (tmp_path / "locked").mkdir(mode=0o500)
    return tmp_path / "locked" / "out.exr"


@pytest.mark.parametrize("place", [folder_is_a_file, target_is_a_folder, folder_is_read_only])
def test_unwritable_place_is_an_output_error(tmp_path: Path, place: Callable[[Path], Path]) -> None:
    path = place(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(OutputError) as caught:
        write(path)
    assert str(path) in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before


def aged(path: Path, hours: float) -> Path:
    path.write_text("part")
    then = time.time() - 3600.0 * hours
    os.utime(path, (then, then))
    return path


def test_parts_of_killed_processes_are_cleared_after_a_day(tmp_path: Path) -> None:
    stale = [
        aged(tmp_path / name, 30.0)
        for name in (
            ".out.node-1.1234.part.exr",
            ".other.0007.node-2.1-0a1b2c3d.part.exr",
            ".x\ny.n.1.part.exr",
        )
    ]
    fresh = aged(tmp_path / ".out.node-1.4321.part.exr", 2.0)
    others = [
        aged(tmp_path / name, 30.0)
        for name in (".in.part.exr", "out.node.1.part.exr", ".out.node.1.part.png", ".out.node.x.part.exr")
    ]
    write(tmp_path / "out.exr")
    assert not any(path.exists() for path in stale)
    assert fresh.exists()
    assert all(path.exists() for path in others)


def test_names_with_brackets_are_names(tmp_path: Path) -> None:
    write(tmp_path / "out[ab]*.exr")
    assert names(tmp_path) == ["out[ab]*.exr"]
