"""Whole files or none."""

from __future__ import annotations

import errno
import os
import platform
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from potmesil_addon import files
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


# What is there already.


def test_a_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out.exr").symlink_to(tmp_path / "elsewhere" / "real.exr")
    for text in ("first", "second"):
        write(tmp_path / "out.exr", text)
        assert (tmp_path / "elsewhere" / "real.exr").read_text() == text
    assert (tmp_path / "out.exr").is_symlink()
    assert names(tmp_path / "elsewhere") == ["real.exr"]


def test_a_link_to_itself_is_a_file_afterwards_or_an_error(tmp_path: Path) -> None:
    (tmp_path / "out.exr").symlink_to(tmp_path / "out.exr")
    with pytest.raises(OutputError):
        write(tmp_path / "out.exr")
    assert names(tmp_path) == ["out.exr"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with names")
def test_pipes_and_devices_are_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "null").symlink_to(os.devnull)
    for name in ("pipe", "null"):
        with pytest.raises(OutputError, match="a device or a pipe and no file"):
            write(tmp_path / name)
        assert (tmp_path / name).exists()
    assert names(tmp_path) == ["null", "pipe"]


@pytest.mark.parametrize("name", [".", "..", "folder"])
def test_folders_are_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    (tmp_path / "here" / "folder").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    with pytest.raises(OutputError, match="a folder has this name"):
        write(Path(name))
    assert names(tmp_path / "here") == ["folder"]


@pytest.mark.parametrize("remains", [False, True])
def test_a_folder_that_is_removed_meanwhile_is_said_to_be(tmp_path: Path, remains: bool) -> None:
    folder = tmp_path / "folder"

    def remove() -> None:
        with whole_file(folder / "out.exr") as part:
            part.unlink()
            folder.rmdir()
            if remains:
                folder.write_text("in its place")
            else:
                part.write_text("new")

    with pytest.raises(OutputError, match=r"removed meanwhile|the name of the folder") as caught:
        remove()
    assert str(folder / "out.exr") in str(caught.value)
    assert folder.is_file() == remains


# Names of parts.


def test_a_part_that_another_machine_writes_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Containers can have one host's name, and process ids from 1 on."""
    monkeypatch.setattr(platform, "node", lambda: "node")
    path = tmp_path / "out.exr"
    with whole_file(path) as first:
        first.write_text("first")
        with whole_file(path) as second:
            assert second != first
            second.write_text("second")
        assert path.read_text() == "second"
        assert first.read_text() == "first"
    assert path.read_text() == "first"
    assert names(tmp_path) == ["out.exr"]


@pytest.mark.parametrize("node", ["", "a.b", "x" * 80, "\N{SNOWMAN}/../../etc", "tab\tnew\n"])
def test_a_machines_name_is_any(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, node: str) -> None:
    monkeypatch.setattr(platform, "node", lambda: node)
    with whole_file(tmp_path / "out.exr") as part:
        assert part.parent == tmp_path
        assert files._PART.fullmatch(part.name.removesuffix(".exr"))
        part.write_text("new")
    assert names(tmp_path) == ["out.exr"]


@pytest.mark.parametrize(
    "name",
    [
        "x" * 251 + ".exr",
        "\N{SNOWMAN}" * 83 + ".exr",
        "a." + "s" * 250,
        "." + "h" * 254,
        "\N{GRINNING FACE}" * 62 + ".000001",
        os.fsdecode(b"\xff" * 251 + b".exr"),
        os.fsdecode(b"name\xff.\xff"),
    ],
    ids=lambda name: ascii(name[-12:]),
)
def test_any_name_that_a_file_can_have_has_a_part(tmp_path: Path, name: str) -> None:
    try:
        (tmp_path / name).write_text("old")
    except (OSError, ValueError):
        pytest.skip("the disk does not take this name")
    with whole_file(tmp_path / name) as part:
        # What writes images takes names in UTF-8 alone.
        part.with_suffix("").name.encode()
        part.write_text("new")
    assert (tmp_path / name).read_text() == "new"
    assert len(names(tmp_path)) == 1


def test_long_names_that_begin_alike_have_their_own_parts(tmp_path: Path) -> None:
    with whole_file(tmp_path / ("x" * 250 + "1")) as one, whole_file(tmp_path / ("x" * 250 + "2")) as other:
        assert one != other
        one.write_text("1")
        other.write_text("2")
    assert [path.read_text() for path in sorted(tmp_path.iterdir())] == ["1", "2"]


def test_a_part_is_no_longer_than_blender_takes(tmp_path: Path) -> None:
    """Blender cuts paths after 1023 bytes and writes what is left of them."""
    folder = tmp_path
    while len(str(folder)) < 800:
        folder = folder / ("f" * 100)
    name = "x" * (1018 - len(str(folder))) + ".exr"
    with whole_file(folder / name) as part:
        assert len(os.fsencode(part)) <= 1023
        part.write_text("new")
    assert (folder / name).is_file()


# What the system says.


class Log:
    """What was done with files, in order, and what fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.done: list[str] = []
        self.fail: dict[str, list[int]] = {}
        for owner, name in ((os, "open"), (os, "fsync"), (Path, "replace"), (Path, "mkdir")):
            monkeypatch.setattr(owner, name, self.wrap(name, getattr(owner, name)))

    def wrap(self, name: str, function: Any) -> Any:
        def call(*arguments: Any, **others: Any) -> Any:
            kind = name
            if name == "fsync":
                kind = "fsync folder" if stat.S_ISDIR(os.fstat(arguments[0]).st_mode) else "fsync file"
            self.done.append(kind)
            if self.fail.get(kind):
                code = self.fail[kind].pop(0)
                if code:
                    raise OSError(code, os.strerror(code))
            return function(*arguments, **others)

        return call


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> Log:
    return Log(monkeypatch)


def test_the_file_is_on_the_disk_before_it_has_its_name_and_the_folder_after(
    tmp_path: Path, log: Log
) -> None:
    write(tmp_path / "out.exr")
    kept = [what for what in log.done if what not in ("open", "mkdir")]
    assert kept == ["fsync file", "replace", "fsync folder"]


STEPS = ["mkdir", "open", "fsync file", "replace"]
ADVICE = {
    errno.ENOSPC: "free space on the disk or choose another folder",
    errno.EDQUOT: "free space of yours on the disk or choose another folder",
    errno.EROFS: "the disk can only be read, choose another folder",
    errno.EIO: "check the disk, and the connection to it",
    errno.ENOENT: "the folder was removed meanwhile, make it and the file again",
    errno.ESTALE: "check the connection to the network folder",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.EILSEQ: "the disk does not take this name, choose another one",
    errno.EMFILE: "check the folder and the disk",
}


@pytest.mark.parametrize("code", ADVICE, ids=errno.errorcode.get)
@pytest.mark.parametrize("step", STEPS)
def test_each_error_is_a_sentence_of_its_own(tmp_path: Path, log: Log, step: str, code: int) -> None:
    path = tmp_path / "out.exr"
    path.write_text("old")
    log.fail[step] = [code]
    with pytest.raises(OutputError) as caught:
        write(path)
    assert str(caught.value) == f"Cannot write '{path}': {os.strerror(code)}; {ADVICE[code]}."
    assert path.read_text() == "old"
    assert names(tmp_path) == ["out.exr"]


@pytest.mark.parametrize("code", [errno.EACCES, errno.EPERM])
def test_what_may_not_be_written_is_a_sentence(tmp_path: Path, log: Log, code: int) -> None:
    log.fail["open"] = [code]
    with pytest.raises(OutputError, match="get the right to write there or choose another folder"):
        write(tmp_path / "out.exr")
    assert names(tmp_path) == []


@pytest.mark.parametrize("code", [errno.EINVAL, errno.ENOTSUP])
@pytest.mark.parametrize("step", ["fsync file", "fsync folder"])
def test_file_systems_that_cannot_flush_are_written_to(
    tmp_path: Path, log: Log, step: str, code: int
) -> None:
    log.fail[step] = [code]
    write(tmp_path / "out.exr")
    assert (tmp_path / "out.exr").read_text() == "new"


def test_a_folder_that_could_not_be_flushed_is_said_to_be(tmp_path: Path, log: Log) -> None:
    log.fail["fsync folder"] = [errno.EIO]
    with pytest.raises(OutputError, match="check the disk"):
        write(tmp_path / "out.exr")
    assert (tmp_path / "out.exr").read_text() == "new"


@pytest.mark.parametrize("code", [errno.EACCES, errno.EPERM, errno.EBUSY, errno.ETXTBSY])
def test_a_file_that_is_open_elsewhere_is_waited_for(
    tmp_path: Path, log: Log, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    monkeypatch.setattr(files, "_NAP", 0.001)
    log.fail["replace"] = [code] * 3
    write(tmp_path / "out.exr")
    assert log.done.count("replace") == 4
    assert (tmp_path / "out.exr").read_text() == "new"


def test_a_file_that_stays_open_elsewhere_is_a_sentence(
    tmp_path: Path, log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files, "_NAP", 0.001)
    monkeypatch.setattr(files, "_PATIENCE", 0.01)
    (tmp_path / "out.exr").write_text("old")
    log.fail["replace"] = [errno.EACCES] * 1000
    with pytest.raises(OutputError, match="close the file where it is open"):
        write(tmp_path / "out.exr")
    assert log.done.count("replace") < 1000
    assert (tmp_path / "out.exr").read_text() == "old"
    assert names(tmp_path) == ["out.exr"]


@pytest.mark.parametrize("message", ["internal error, see console", "Error: x\nError: y\n"])
def test_an_error_without_a_reason_is_looked_into(tmp_path: Path, log: Log, message: str) -> None:
    """Blender names none where the disk is full; then nothing more can be written either."""

    def fail() -> None:
        with whole_file(tmp_path / "out.exr") as part:
            part.write_text("half")
            raise RuntimeError(f"{message} {part}")

    with pytest.raises(OutputError, match="check the folder, the disk and the output settings") as caught:
        fail()
    assert "\n" not in str(caught.value)
    assert ".part" not in str(caught.value)
    log.fail["fsync file"] = [errno.ENOSPC]
    with pytest.raises(OutputError, match="free space on the disk"):
        fail()
    assert names(tmp_path) == []


def test_a_picture_that_was_cut_short_is_not_put_in_place(tmp_path: Path, log: Log) -> None:
    path = tmp_path / "out.png"
    path.write_text("old")

    def cut() -> None:
        with whole_file(path) as part:
            part.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(40))

    with pytest.raises(OutputError, match="it was cut short; free space"):
        cut()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["out.png"]


def test_a_folder_is_not_listed_for_each_of_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = []
    scandir = os.scandir
    monkeypatch.setattr(os, "scandir", lambda path: listed.append(path) or scandir(path))
    for frame in range(5):
        write(tmp_path / f"{frame:04d}.exr")
    assert len(listed) == 1


def test_working_folders_of_the_dead_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    long_ago = time.time() - 2 * 86400.0
    folders = {
        name: tmp_path / name
        for name in (f"potmesil_work_{ended.pid}_old", f"potmesil_work_{ended.pid}_new",
                     f"potmesil_work_{os.getpid()}_old", "potmesil_work_mine", "potmesil_work_x_old")
    }  # fmt: skip
    for name, folder in folders.items():
        folder.mkdir()
        (folder / "render.exr").touch()
        if not name.endswith("new"):
            os.utime(folder, (long_ago, long_ago))
    with files.working_folder() as own:
        assert own.is_dir()
        assert own.parent == tmp_path
    left = {path.name for path in tmp_path.iterdir()}
    assert left == folders.keys() - {f"potmesil_work_{ended.pid}_old"}


def test_a_working_folder_goes_with_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def interrupted() -> None:
        with files.working_folder() as own:
            (own / "render.exr").touch()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not list(tmp_path.iterdir())
