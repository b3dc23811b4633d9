"""Compiled kernels on disk: many processes share one folder, and some of them are killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import IO, Any

import pytest

from potmesil_addon import diffraction, jit

from .helpers import importable

pytestmark = pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not here")

KERNEL = '''
import sys, time
from pathlib import Path
from typing import Any

import numpy as np

from potmesil_addon import jit


@jit.kernel()
def doubled(x: Any) -> Any:
    return x + x


def at_once() -> None:
    """Begin when all others do."""
    Path(f"ready{sys.argv[1]}").touch()
    while not Path("go").exists():
        time.sleep(0.001)
'''

TYPES = ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64")

OWN_SHARE = f"""
import sys
import numpy as np
from kernel import at_once, doubled
at_once()
for name in {TYPES!r}[int(sys.argv[1]) :: 2]:
    assert doubled(np.ones(3, name)).tolist() == [2, 2, 2]
"""

MANY_SAVES = """
import sys
from kernel import at_once, doubled
file = doubled._cache._cache_file
doubled._cache._impl.locator.ensure_cache_path()
at_once()
for number in range(100):
    file.save((sys.argv[1], number), sys.argv[1] * 2000 + str(number))
"""

HOLD = """
import sys, time
from pathlib import Path
from potmesil_addon import jit
with jit._alone(Path(sys.argv[1])) as alone:
    print(alone, flush=True)
    time.sleep(60)
"""


def start(folder: Path, code: str, *arguments: str) -> subprocess.Popen[str]:
    environment = {**importable(), "NUMBA_CACHE_DIR": str(folder / "cache")}
    environment["PYTHONPATH"] = os.pathsep.join([str(folder), environment["PYTHONPATH"]])
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: subprocess.Popen[str]) -> str:
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out


def all_at_once(folder: Path, code: str, count: int) -> None:
    (folder / "kernel.py").write_text(KERNEL)
    processes = [start(folder, code, str(number)) for number in range(count)]
    until = time.monotonic() + 60.0
    while not all((folder / f"ready{number}").exists() for number in range(count)):
        assert time.monotonic() < until
        assert all(process.poll() is None for process in processes)
        time.sleep(0.01)
    (folder / "go").touch()
    for process in processes:
        finish(process)


def test_processes_that_compile_one_kernel_at_once_keep_all_of_it(tmp_path: Path) -> None:
    all_at_once(tmp_path, OWN_SHARE, 2)
    code = f"""
import numpy as np
from kernel import doubled
for name in {TYPES!r}:
    array = doubled(np.full(3, 3, name))
    assert array.tolist() == [6, 6, 6] and array.dtype == name
assert sum(doubled.stats.cache_hits.values()) == {len(TYPES)}, doubled.stats
"""
    finish(start(tmp_path, code))


def test_no_signature_gets_anothers_code(tmp_path: Path) -> None:
    all_at_once(tmp_path, MANY_SAVES, 3)
    code = """
from kernel import doubled
file = doubled._cache._cache_file
for process in "012":
    for number in range(100):
        assert file.load((process, number)) == process * 2000 + str(number)
"""
    finish(start(tmp_path, code))


def holder(tmp_path: Path) -> subprocess.Popen[str]:
    """Start a process that holds the lock, and wait until it does."""
    process = start(tmp_path, HOLD, str(tmp_path / "lock"))
    out: IO[str] | None = process.stdout
    assert out is not None
    assert out.readline().strip() == "True"
    return process


def test_a_lock_ends_with_a_process_that_is_killed(tmp_path: Path) -> None:
    process = holder(tmp_path)
    assert jit._lock((tmp_path / "lock").open("ab")) is False
    process.kill()
    process.communicate()
    began = time.monotonic()
    with jit._alone(tmp_path / "lock") as alone:
        assert alone is True
    assert time.monotonic() - began < 1.0
    # It can be had again.
    with jit._alone(tmp_path / "lock") as alone:
        assert alone is True


def test_a_process_that_keeps_the_lock_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jit, "_LOCK_PATIENCE", 0.2)
    process = holder(tmp_path)
    try:
        began = time.monotonic()
        with jit._alone(tmp_path / "lock") as alone:
            assert alone is False
        assert 0.2 <= time.monotonic() - began < 2.0
    finally:
        process.kill()
        process.communicate()


class File:
    """As much of numba's index as is used, in a folder without a disk."""

    def __init__(self, folder: Path) -> None:
        self._cache_path = str(folder)
        self.index: dict[str, str] = {}
        self.data: dict[str, str] = {}
        self.done: list[str] = []

    def _load_index(self) -> dict[str, str]:
        return dict(self.index)

    def _data_name(self, number: int) -> str:
        return f"{number}.nbc"

    def _save_data(self, name: str, data: str) -> None:
        self.done.append("data")
        self.data[name] = data

    def _save_index(self, index: dict[str, str]) -> None:
        self.done.append("index")
        self.index = index


def test_the_index_speaks_only_of_what_is_there(tmp_path: Path) -> None:
    file = File(tmp_path)
    jit._save(file, "a", "code of a")
    jit._save(file, "b", "code of b")
    assert file.done == ["data", "index"] * 2
    assert file.index == {"a": "1.nbc", "b": "2.nbc"}
    jit._save(file, "a", "new code of a")
    assert file.data == {"1.nbc": "new code of a", "2.nbc": "code of b"}
    assert file.index == {"a": "1.nbc", "b": "2.nbc"}


@pytest.mark.parametrize("alone", [False, None])
def test_without_a_lock_nothing_is_mixed_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alone: bool | None
) -> None:
    monkeypatch.setattr(jit, "_lock", lambda _: alone)
    monkeypatch.setattr(jit, "_LOCK_PATIENCE", 0.01)
    files: list[Any] = [File(tmp_path), File(tmp_path)]
    for file in files:
        jit._save(file, "a", "code")
    if alone is False:
        assert not files[0].data
    else:
        # Each has a name of its own, as if the other were not there.
        assert len({*files[0].data, *files[1].data}) == 2


def test_a_folder_that_cannot_be_written_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        jit._save(File(tmp_path / "nowhere"), "a", "code")


def test_every_kernel_saves_so() -> None:
    kernel: Any = diffraction._first_order
    assert kernel._cache._cache_file.save.__func__ is jit._save


def test_kernels_are_kept_where_they_are_told_to_be(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    finish(start(tmp_path, "from kernel import doubled\nassert doubled(2) == 4"))
    assert list((tmp_path / "cache").rglob("*doubled*.nbi"))


REHEARSAL = """
import numpy as np
from potmesil_addon import jit

@jit.kernel()
def inner(x):
    return 2.0 * x

@jit.kernel(parallel=True)
def outer(values, result):
    for i in jit.prange(values.size):
        result[i] = inner(values[i])

@jit.kernel()
def refused(values):
    return values[99]

told = []
jit.on_compile(lambda name: told.append(name) if name in ("inner", "outer", "refused") else None)
values, result = np.arange(3.0), np.zeros(3)
with jit.rehearsal() as kernels:
    for _ in range(2):
        outer(values, result)
    assert refused(values) is None
assert result.tolist() == [0.0, 2.0, 4.0]
assert not told and not outer.signatures and len(kernels) == 2
kernels[0]()
assert sorted(told) == ["inner", "outer"] and len(outer.signatures) == 1
outer(values, result)
assert sorted(told) == ["inner", "outer"]
assert inner(1.5) == 3.0
"""


def test_a_rehearsal_compiles_nothing_but_knows_what_to(tmp_path: Path) -> None:
    (tmp_path / "rehearsal.py").write_text(REHEARSAL)
    finish(start(tmp_path, "import rehearsal"))


PACKAGE = {
    "__init__.py": "",
    "kernel.py": """
from .jit import kernel
from .parts import (
    part,
)


@kernel()
def whole(x: float) -> float:
    return 10.0 * part(x)
""",
    "parts.py": """
from . import jit


@jit.kernel()
def part(x: float) -> float:
    return x + 1.0
""",
}

CALL = """
from package.kernel import whole
print(whole(1.0), sum(whole.stats.cache_hits.values()))
"""


def package(folder: Path, cache: Path, **changes: str) -> str:
    """Write a package with a copy of `jit`, call its kernel, and return what that says."""
    place = folder / "package"
    place.mkdir(parents=True, exist_ok=True)
    (place / "jit.py").write_bytes(Path(jit.__file__).read_bytes())
    for name, text in {**PACKAGE, **changes}.items():
        (place / name).write_text(text)
    done = subprocess.run(
        [sys.executable, "-c", CALL],
        env={**os.environ, "PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_another_installation_finds_the_kernels(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert package(tmp_path / "one", cache) == "20.0 0"
    os.utime(tmp_path / "one" / "package" / "kernel.py", (1.0, 1.0))
    assert package(tmp_path / "one", cache) == "20.0 1"
    assert package(tmp_path / "another", cache) == "20.0 1"
    assert not [path for path in cache.iterdir() if path.is_dir()]


def test_kernels_are_compiled_again_where_what_they_call_is_another(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    changed = PACKAGE["parts.py"].replace("1.0", "2.0")
    assert package(tmp_path / "one", cache) == "20.0 0"
    assert package(tmp_path / "one", cache, **{"parts.py": changed}) == "30.0 0"
    assert package(tmp_path / "one", cache, **{"parts.py": changed}) == "30.0 1"
