"""The one door to numba: a typed decorator, the threading layer, and where compiled kernels are kept.

numba is optional. Where it is missing or does not load, `HAVE_NUMBA` is false and callers take their
numpy path. Nothing here imports numba before a kernel module asks for it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import itertools
import os
import re
import sys
import time
import types
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, TypeVar

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

Function = TypeVar("Function", bound=Callable[..., Any])

# The workqueue layer ships with numba itself and needs no OpenMP or TBB beside Blender's own.
os.environ.setdefault("NUMBA_THREADING_LAYER", "workqueue")

try:
    import numba
except Exception:  # a half-removed llvmlite raises OSError, a numpy mismatch ImportError or SystemError
    numba = None

HAVE_NUMBA: Final = numba is not None

if HAVE_NUMBA:
    # Off by default for the sake of old LLVMs. The scatter adds a pixel's channels with it at once.
    numba.config.SLP_VECTORIZE = 1

_KERNELS: Final[list[Any]] = []
"""All kernels of the modules that were imported, as numba has them."""

_RELATIVE_IMPORT: Final = re.compile(rb"^from \.(?:(\w+) import| import (\([^)]*\)|[^\n]*))", re.MULTILINE)
"""Imports of a module from its own package, but for those within functions."""

_LOCK: Final = "kernels.lock"
_LOCK_PATIENCE: Final = 2.0
"""Seconds that another process is waited for while it saves a kernel, which takes it milliseconds."""

_LOCK_NAP: Final = 0.005

if TYPE_CHECKING:
    prange = range
else:
    prange = numba.prange if HAVE_NUMBA else range


def kernel(*, parallel: bool = False, inline: bool = False) -> Callable[[Function], Function]:
    """Compile a function with numba, cached on disk; leave it alone where numba is missing.

    Parameters
    ----------
    parallel : bool
        Run the function's `prange` loops on all threads.
    inline : bool
        Put the function's body where it is called; for the few lines of an innermost loop.

    Returns
    -------
    callable
        The decorator.
    """
    if not HAVE_NUMBA:
        return lambda function: function
    # fastmath stays off: sums keep their order, so the picture does not depend on the machine.
    compiled = numba.njit(
        cache=True,
        parallel=parallel,
        nogil=True,
        error_model="numpy",
        inline="always" if inline else "never",
    )

    def decorate(function: Function) -> Function:
        dispatcher: Any = compiled(function)
        # A numba whose insides are others keeps them as it does.
        with contextlib.suppress(AttributeError, TypeError):
            _keep(dispatcher._cache, Path(function.__code__.co_filename))  # noqa: SLF001 - see there
        _KERNELS.append(dispatcher)
        return dispatcher  # type: ignore[no-any-return]

    return decorate


def _keep(cache: Any, source: Path) -> None:
    """Have numba know a kernel on disk by its source's text, and save it by `_save`.

    numba goes by the path and the date of the kernel's own module. So kernels would be compiled again for
    each installation, which farms have many of, and kept where a module changed whose functions are built in.

    Parameters
    ----------
    cache : Cache
        numba's, of one kernel; there is no public way in.
    source : Path
        The kernel's module.
    """
    locator = cache._impl.locator  # noqa: SLF001
    # Unless nobody may write there, numba has made a folder in it that is named after the module's.
    own = Path(cache._cache_path)  # noqa: SLF001
    if numba.config.CACHE_DIR and own.parent == Path(numba.config.CACHE_DIR):
        cache._cache_path = locator._cache_path = str(own.parent)  # noqa: SLF001
        with contextlib.suppress(OSError):
            own.rmdir()
    file = type(cache._cache_file)(  # noqa: SLF001
        cache_path=cache._cache_path,  # noqa: SLF001
        filename_base=cache._impl.filename_base,  # noqa: SLF001
        source_stamp=_digest(source),
    )
    file.save = types.MethodType(_save, file)
    cache._cache_file = file  # noqa: SLF001


@functools.cache
def _digest(source: Path) -> str:
    """Return a hash of a module's text, and of those that it imports from its own package."""
    found, coming = {}, [source]
    while coming:
        path = coming.pop()
        if path not in found and path.is_file():
            found[path] = path.read_bytes()
            names = b",".join(b"".join(match) for match in _RELATIVE_IMPORT.findall(found[path]))
            coming += [path.with_name(f"{name}.py") for name in re.findall(r"\w+", names.decode())]
    texts = sorted((path.name, hashlib.sha256(text).hexdigest()) for path, text in found.items())
    return hashlib.sha256(repr(texts).encode()).hexdigest()


def _save(self: Any, key: Any, data: Any) -> None:
    """Keep a compiled kernel on disk in numba's stead, one process at a time.

    numba reads an index of signatures, adds one, writes it back, and then writes the code. Of two processes
    that do so at once the one's signature ends up with the other's code; of one that is killed half-way,
    with that of an older version. Here the index is locked, and written once what it speaks of is there.

    Parameters
    ----------
    self : IndexDataCacheFile
        numba's, of one kernel.
    key, data : object
        Signature and code as numba has them.
    """
    with _alone(Path(self._cache_path) / _LOCK) as alone:
        if alone is False:
            return
        overloads = self._load_index()
        taken = set(overloads.values())
        # Where files cannot be locked a name that nobody else takes keeps signatures apart; at worst one of
        # two kernels is compiled again.
        numbers = itertools.count(1 if alone else uuid.uuid4().int)
        free = (name for name in map(self._data_name, numbers) if name not in taken)
        name = overloads.get(key) or next(free)
        self._save_data(name, data)
        if key not in overloads:
            self._save_index({**overloads, key: name})


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[bool | None]:
    """Hold the system's lock on a file, which ends with the process whatever becomes of it.

    Parameters
    ----------
    path : Path
        A file for nothing else; it is made where it is missing, and stays.

    Yields
    ------
    bool or None
        True with the lock, False where another process kept it for too long, None where the file system
        has no locks.
    """
    with path.open("ab") as file:
        until = time.monotonic() + _LOCK_PATIENCE
        while (alone := _lock(file)) is False and time.monotonic() < until:
            time.sleep(_LOCK_NAP)
        try:
            yield alone
        finally:
            if alone:
                _unlock(file)


def _lock(file: IO[bytes]) -> bool | None:
    """Try to lock a file, at once; return what `_alone` yields."""
    try:
        if sys.platform == "win32":
            file.seek(0)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return None
    return True


def _unlock(file: IO[bytes]) -> None:
    """Let others have the file before it is closed, which Windows may do later than it is told to."""
    if sys.platform == "win32":
        file.seek(0)
        msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)
    else:
        fcntl.flock(file, fcntl.LOCK_UN)


def set_cache_directory(directory: Path) -> None:
    """Keep compiled kernels in a folder of the user's rather than beside the source.

    Has to run before a kernel module is imported; an installed extension's own folder may be read-only
    and is wiped on upgrade. A cached kernel names the package that it was compiled in, and the same
    source can be loaded as several, so each package has its own subfolder.

    Parameters
    ----------
    directory : Path
        The folder; it is made when the first kernel is compiled. The environment variable
        ``NUMBA_CACHE_DIR`` wins over it.
    """
    if HAVE_NUMBA:
        chosen = os.environ.get("NUMBA_CACHE_DIR", str(directory))
        numba.config.CACHE_DIR = str(Path(chosen) / (__package__ or ""))


def cache_directory() -> Path | None:
    """Return the folder that `set_cache_directory` was given; None where it was not."""
    chosen = Path(numba.config.CACHE_DIR) if HAVE_NUMBA and numba.config.CACHE_DIR else None
    return chosen.parent if chosen is not None and chosen.name == __package__ else None


def on_compile(tell: Callable[[str], None]) -> None:
    """Have a function called with a kernel's name each time that one is compiled and not read from disk.

    Parameters
    ----------
    tell : callable
        Called before the kernel is compiled, for as long as the process lives.
    """
    if not HAVE_NUMBA:
        return
    from numba.core import event  # noqa: PLC0415 - numba may be missing

    def started(_: Any, compiled: Any) -> None:
        tell(compiled.data["dispatcher"].py_func.__name__)

    # numba asks for a subclass, and has no types to check one by.
    listener = type("Listener", (event.Listener,), {"on_start": started, "on_end": lambda *_: None})
    event.register("numba:compile", listener())


@contextlib.contextmanager
def rehearsal() -> Iterator[list[Callable[[], object]]]:
    """Run kernels as the Python that they also are, and note what would have been compiled.

    Meant for a few dozen samples, whose picture is not looked at: what Python computes otherwise, or
    refuses to, does not matter. Only kernels that were not called before take part.

    Yields
    ------
    list of callable
        Grows in the order in which kernels are called. Each compiles one of them, or reads it from disk;
        they are to be called when the rehearsal is over.
    """
    noted: dict[tuple[int, Any], Callable[[], object]] = {}
    compiling: list[Callable[[], object]] = []
    depth = 0

    def rehearse(kernel: Any) -> Callable[..., Any]:
        def play(*arguments: Any) -> Any:
            nonlocal depth
            depth += 1
            try:
                return kernel.py_func(*arguments)
            except (ArithmeticError, LookupError, TypeError, ValueError):
                # Kernels that their callers call give back nothing, except through arrays.
                if depth > 1:
                    raise
                return None
            finally:
                depth -= 1

        def note(*arguments: Any) -> Any:
            # A kernel that is called by another one is compiled with it.
            if depth == 0:
                signature = tuple(numba.typeof(argument) for argument in arguments)
                key = id(kernel), signature
                if key not in noted:
                    noted[key] = functools.partial(kernel.compile, signature)
                    compiling.append(noted[key])
            return play

        return note

    # What numba calls for types that it has no code for yet; it then calls what it is given.
    for kernel in _KERNELS:
        kernel._compile_for_args = rehearse(kernel)  # noqa: SLF001 - numba has no public way in
    try:
        yield compiling
    finally:
        for kernel in _KERNELS:
            del kernel._compile_for_args  # noqa: SLF001


def set_thread_count(threads: int | None) -> int:
    """Choose how many threads the kernels use.

    Parameters
    ----------
    threads : int or None
        Threads, at least 1; ``None`` leaves numba's own choice (all cores).

    Returns
    -------
    int
        The number in force: 1 without numba, never more than the machine started with.
    """
    if not HAVE_NUMBA:
        return 1
    if threads is not None:
        numba.set_num_threads(max(1, min(threads, numba.config.NUMBA_NUM_THREADS)))
    return int(numba.get_num_threads())
