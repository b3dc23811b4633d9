"""Writing loses no frame: writers that are killed, race, find the disk full or the name odd."""

from __future__ import annotations

import ast
import errno
import json
import os
import platform
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from potmesil_addon import cli, exr, files, png
from potmesil_addon.errors import OutputError
from potmesil_addon.reports import write_json

from .helpers import ROOT, importable, plain_channels, write_exr

HERE = Path(__file__).resolve().parent
KILLS = int(os.environ.get("POTMESIL_KILLS", "50"))
"""Of each kind; a long run asks for more."""

LENS = ("--focal-length", "50", "--fstop", "2", "--focus-distance", "3", "--sensor-width", "36")
ONE_THREAD = {"NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@pytest.fixture
def quick_folder(tmp_path: Path) -> Iterator[Path]:
    """A folder in memory where there is one: a disk takes its time to flush."""
    memory = Path("/dev/shm")
    if not (memory.is_dir() and os.access(memory, os.W_OK)):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir=memory, prefix="potmesil_test_") as folder:
        yield Path(folder)


def writers(kind: str, folder: Path, count: int) -> dict[str, int]:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(HERE / "killed.py"), kind, str(folder), str(count)],
        env={**importable(), **ONE_THREAD},
        capture_output=True,
        text=True,
        timeout=400 + count,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    seen: dict[str, int] = json.loads(done.stdout)
    return seen


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.parametrize("kind", ["export", "process"])
def test_writers_killed_at_any_moment_leave_whole_files_or_none(quick_folder: Path, kind: str) -> None:
    seen = writers(kind, quick_folder, KILLS)
    assert seen["kills"] == KILLS
    # It was in the middle of writing, before it and after it.
    assert all(seen[what] > 0 for what in ("parts", "old", "new", "missing")), seen


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_two_machines_on_one_frame_leave_it_whole_at_every_moment(quick_folder: Path) -> None:
    seen = writers("race", quick_folder, 60)
    assert seen["statuses"] == 0
    assert seen["parts"] == 0
    assert seen["changes"] > 1, seen


def test_who_reads_a_file_goes_on_with_it_when_it_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "out.exr"
    exr.write_picture(path, np.zeros((32, 32, 4), dtype=np.float32), {})
    before = path.read_bytes()
    with path.open("rb") as reader:
        assert reader.read(100) == before[:100]
        exr.write_picture(path, np.ones((64, 64, 4), dtype=np.float32), {})
        assert reader.read() == before[100:]
    assert path.read_bytes() != before


_opened: list[str] = []
_watching = [False]


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _watching[0] and isinstance(arguments[0], str | os.PathLike | bytes):
        mode, flags = arguments[1], arguments[2]
        writes = set(mode or "") & set("wax+") or flags & (os.O_WRONLY | os.O_RDWR | os.O_TRUNC | os.O_CREAT)
        if writes:
            _opened.append(os.fsdecode(arguments[0]))


@pytest.fixture
def opened() -> Iterator[list[str]]:
    """The names under which Python opened files for writing."""
    if not _opened:
        # There is no way to take it out again.
        sys.addaudithook(_watch)
    _opened[:] = [""]
    _watching[0] = True
    yield _opened
    _watching[0] = False


def test_nothing_is_opened_for_writing_under_its_final_name(tmp_path: Path, opened: list[str]) -> None:
    """Python's own opens are listened to; a library's would show in the old file, which is kept by a link."""
    source = write_exr(tmp_path / "in.exr", plain_channels(8, 12))
    out, kept = tmp_path / "out", tmp_path / "kept"
    out.mkdir()
    kept.mkdir()
    names = (
        "out.exr",
        "out.png",
        "mask.png",
        "mask.exr",
        "error.exr",
        "report.json",
        "job.json",
        "table.png",
    )
    for name in (*names, "samples.exr", "table.exr"):
        (out / name).write_text("old")
        (kept / name).hardlink_to(out / name)
    _opened.clear()
    common = ["process", str(source), *LENS, "--existing", "overwrite"]
    extra = [f"--{what}={out / name}" for what, name in (("report", names[5]), ("job-report", names[6]))]
    assert cli.main([*common, "-o", str(out / "out.exr"), f"--mask={out / 'mask.png'}", *extra]) == 0
    maps = [f"--mask={out / 'mask.exr'}", f"--error-map={out / 'error.exr'}"]
    assert cli.main([*common, "-o", str(out / "out.png"), *maps]) == 0
    for name in ("table.png", "table.exr"):
        table = ["psf", *LENS[:6], "--depth", "9", "--pixel-pitch-um", "50", "-o", str(out / name)]
        assert cli.main(table) == 0
    exr.annotate(source, out / "samples.exr", {})
    inside = {Path(name).name for name in opened if Path(name).parent == out}
    assert inside
    assert all(name.startswith(".") and ".part." in name for name in inside), inside
    for name in (*names, "samples.exr", "table.exr"):
        assert (kept / name).read_text() == "old"
        assert (out / name).stat().st_ino != (kept / name).stat().st_ino
        assert (out / name).stat().st_size > 20
    assert len(list(out.iterdir())) == len(names) + 2


WRITES = {"write_text", "write_bytes", "touch", "save_render", "savetxt", "save", "copyfile", "copy2", "move"}
ELSEWHERE = {
    "files.py": "the one place",
    "jit.py": "the lock beside compiled kernels",
    "worker.py": "the pipe of Live Focus, in a folder of its own",
    "live.py": "the pipe of Live Focus, in a folder of its own",
    "inspection.py": "a folder that goes away",
}
"""Modules that write what is no result."""

GIVEN = {
    "save_render": "a path that its callers give, in a folder that goes away",
    "stamp": "a part",
    "_placeholder": "Blender's own empty placeholders, where no file is",
}
"""Functions that write what they are given, or no content."""


def is_write(call: ast.Call) -> bool:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name in WRITES and isinstance(call.func, ast.Attribute):
        return True
    words = [*call.args, *(keyword.value for keyword in call.keywords if keyword.arg == "mode")]
    modes = [word.value for word in words if isinstance(word, ast.Constant) and isinstance(word.value, str)]
    return name in ("open", "fdopen") and any(set(mode) <= set("rwaxbt+") - {"r"} for mode in modes if mode)


def writes_outside(node: ast.AST, function: str = "", inside: bool = False) -> Iterator[tuple[str, int]]:
    """Yield function and line of every call that writes outside of a `whole_file`."""
    for child in ast.iter_child_nodes(node):
        within, name = inside, function
        if isinstance(child, ast.FunctionDef):
            name = child.name
        elif isinstance(child, ast.With):
            within = inside or any("whole_file(" in ast.unparse(item) for item in child.items)
        elif isinstance(child, ast.Call) and is_write(child) and not inside:
            yield function, child.lineno
        yield from writes_outside(child, name, within)


def test_all_that_writes_writes_whole_files() -> None:
    found = []
    for folder in ("potmesil_addon", "operators", "ui"):
        for path in (ROOT / folder).rglob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            places = [(name, line) for name, line in writes_outside(tree) if name not in GIVEN]
            found += [f"{path.name}:{line}" for _, line in places if path.name not in ELSEWHERE]
    assert not found


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("open(path, 'wb')", 1),
        ("path.open('a')", 1),
        ("path.open(mode='x')", 1),
        ("path.open('rb')", 0),
        ("path.write_text('x')", 1),
        ("with whole_file(path) as part:\n    part.write_text('x')", 0),
        ("with whole_file(path) as part, part.open('wb') as stream:\n    pass", 0),
    ],
)
def test_the_walk_sees_writes(source: str, count: int) -> None:
    assert len(list(writes_outside(ast.parse(source)))) == count


# Full and read-only disks.


@pytest.fixture
def small_files() -> Iterator[None]:
    """Let no file become larger than 2 kB: what is written is cut short, and the system says so."""
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, before)


NOISE = np.random.default_rng(0).random((32, 32, 4), dtype=np.float32)


def annotated(path: Path) -> None:
    exr.annotate(path.with_name("in.exr"), path, {})


LARGE = {
    "picture.exr": lambda path: exr.write_picture(path, NOISE, {}),
    "samples.exr": annotated,
    "picture.png": lambda path: png.write_png(path, NOISE),
    "report.json": lambda path: write_json(path, {"x": "long" * 1000}),
}


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limits")
@pytest.mark.parametrize("name", LARGE)
def test_a_file_that_cannot_become_so_large_is_not_there(
    tmp_path: Path, request: pytest.FixtureRequest, name: str
) -> None:
    exr.write_picture(tmp_path / "in.exr", NOISE, {})
    (tmp_path / name).write_text("old")
    request.getfixturevalue("small_files")
    with pytest.raises(OutputError, match=os.strerror(errno.EFBIG)) as caught:
        LARGE[name](tmp_path / name)
    assert "takes no file of this size" in str(caught.value)
    assert str(caught.value).count("\n") == 0
    assert (tmp_path / name).read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["in.exr", name])


ON_SMALL_DISK = """
import json, os, subprocess, sys
from pathlib import Path
from tests.core.test_writing import LARGE, LENS, NOISE
from potmesil_addon import cli, exr
from potmesil_addon.errors import OutputError

disk, source = Path(sys.argv[1]), sys.argv[2]
said = {}

def attempt(what):
    for name, write in LARGE.items():
        try:
            write(disk / name)
            said[what, name] = "nothing"
        except OutputError as error:
            said[what, name] = str(error)
        assert (disk / name).read_text() == "old"
    status = cli.main(["process", source, *LENS, "-o", str(disk / "picture.exr"), "--existing", "overwrite"])
    assert status == 4 and (disk / "picture.exr").read_text() == "old"
    assert sorted(os.listdir(disk)) == sorted(["filling", "in.exr", *LARGE])

exr.write_picture(disk / "in.exr", NOISE[:4, :4], {})
for name in LARGE:
    (disk / name).write_text("old")
with (disk / "filling").open("wb", buffering=0) as filling:
    try:
        while filling.write(b"x" * 4096):
            pass
    except OSError:
        pass
attempt("full")
subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
attempt("read-only")
print(json.dumps([[*key, text] for key, text in said.items()]))
"""


def in_own_namespace(folder: Path, script: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run Python with a disk of 32 kB at a folder that nobody else sees."""
    if shutil.which("unshare") is None:
        pytest.skip("there is no unshare here")
    mounted = 'mount -t tmpfs -o size=32k,mode=777 tmpfs "$1" || exit 77; shift; exec "$@"'
    words = [sys.executable, "-c", script, str(folder), *map(str, arguments)]
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", mounted, "sh", str(folder), *words],
        env=importable(),
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    if "unshare" in done.stderr or done.returncode == 77:
        pytest.skip("this user may not mount")
    return done


def test_full_and_read_only_disks_leave_old_files_and_say_what_to_do(tmp_path: Path) -> None:
    source = write_exr(tmp_path / "in.exr", plain_channels(32, 48))
    disk = tmp_path / "disk"
    disk.mkdir()
    done = in_own_namespace(disk, ON_SMALL_DISK, source)
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("[")]
    said = {(what, name): text for what, name, text in json.loads(lines[-1])}
    assert len(said) == 2 * len(LARGE)
    for (what, name), text in said.items():
        code = errno.ENOSPC if what == "full" else errno.EROFS
        advice = "free space on the disk" if what == "full" else "the disk can only be read"
        assert text.startswith(f"Cannot write '{disk / name}': {os.strerror(code)}; {advice}"), text
    errors = [line for line in done.stderr.splitlines() if line.startswith("Error: ")]
    assert [os.strerror(code) in line for code, line in zip((28, 30), errors, strict=True)] == [True] * 2


# Names.

ODD = [
    "with blanks in it",
    " blank before and after ",
    'it\'s "quoted" `twice`',
    "back\\slash",
    "new\nline\ttab",
    "100%d %s {0} {name}",
    "a$HOME;&|<>(*)?[x]!~",
    "smile \N{GRINNING FACE} \N{CJK UNIFIED IDEOGRAPH-5F71}",
    "composed \N{LATIN SMALL LETTER E WITH ACUTE}",
    "combining e\N{COMBINING ACUTE ACCENT}",
    "-dash=before",
    "dots. . ..",
    "\N{LATIN SMALL LETTER U WITH DIAERESIS}" * 115,
    "x" * 240,
    os.fsdecode(b"bytes \xff\xfe"),
]


def takes(folder: Path, name: str) -> bool:
    """Return whether the disk takes a name."""
    try:
        (folder / name).mkdir()
    except (OSError, ValueError):
        return False
    return True


@pytest.mark.parametrize("name", ODD, ids=ascii)
def test_odd_names_are_names(tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str) -> None:
    folder = tmp_path / name
    if not takes(tmp_path, name):
        pytest.skip("the disk does not take this name")
    short = name.encode(errors="surrogateescape")[:200].decode(errors="surrogateescape")
    source = folder / f"{name[:100]}.0007.exr"
    write_exr(tmp_path / "in.exr", plain_channels(6, 8)).rename(source)
    out = folder / "new" / short
    words = [
        ("--output", ".####.exr"),
        ("--mask", ".mask.png"),
        ("--error-map", ".error.exr"),
        ("--report", ".json"),
        ("--job-report", ".job.json"),
    ]
    options = [f"{option}={out}{end}" for option, end in words]
    assert cli.main(["process", str(source), "--frames=7", *LENS, *options]) == 0, capfd.readouterr().err
    ends = (".0007.exr", ".mask.png", ".error.exr", ".json", ".job.json")
    assert {path.name for path in out.parent.iterdir()} == {f"{short}{end}" for end in ends}
    assert exr.read_raw(out.parent / f"{short}.0007.exr") is not None
    lines = capfd.readouterr().out.splitlines()
    assert sum(line.startswith("Saved: '") for line in lines) == 1
    # What is there is found again.
    assert cli.main(["process", str(source), "--frames=7", *LENS, *options]) == 0
    assert "Skipping existing frame" in capfd.readouterr().out


@pytest.mark.parametrize("name", ["smile \N{GRINNING FACE}", os.fsdecode(b"\xc3\xa9 bytes \xff")], ids=ascii)
def test_names_that_the_terminal_has_not_are_printed_all_the_same(tmp_path: Path, name: str) -> None:
    if not takes(tmp_path, name):
        pytest.skip("the disk does not take this name")
    source = tmp_path / name / "in.exr"
    write_exr(tmp_path / "in.exr", plain_channels(6, 8)).rename(source)
    output = source.with_name("out.exr")
    for path, status, start in ((source, 0, b""), (source.with_name("none.exr"), 3, b"Error: ")):
        done = subprocess.run(
            [sys.executable, "-m", "potmesil_addon", "process", str(path), *LENS, "-o", str(output)],
            env={**importable(), "LANG": "C", "LC_ALL": "C", "PYTHONIOENCODING": "ascii"},
            capture_output=True,
            timeout=400,
            check=False,
        )
        assert done.returncode == status, done.stderr
        assert (b"Saved: '" in done.stdout) == (status == 0)
        assert done.stderr.startswith(start)
        assert done.stderr.count(b"\n") == (status > 0)


def test_a_path_of_two_slashes_is_a_path(tmp_path: Path) -> None:
    source = write_exr(tmp_path / "in.exr", plain_channels(6, 8))
    assert cli.main(["process", f"/{source}", *LENS, "-o", f"/{tmp_path}/new//out.exr"]) == 0
    assert (tmp_path / "new" / "out.exr").is_file()


def test_the_machines_name_is_in_a_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "node", lambda: "node 1.farm/\N{LATIN SMALL LETTER E WITH ACUTE}")
    with files.whole_file(tmp_path / "out.0001.exr") as part:
        assert part.name == f".out.0001.node-1-farm-.{os.getpid()}.part.exr"
        part.write_text("new")
