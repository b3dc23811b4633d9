"""The one door to numba: a typed decorator, the threading layer, and where compiled kernels are kept.

numba is optional. Where it is missing or does not load, `HAVE_NUMBA` is false and callers take their
numpy path. Nothing here imports numba before a kernel module asks for it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

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
    return cast(
        "Callable[[Function], Function]",
        # fastmath stays off: sums keep their order, so the picture does not depend on the machine.
        numba.njit(
            cache=True,
            parallel=parallel,
            nogil=True,
            error_model="numpy",
            inline="always" if inline else "never",
        ),
    )


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
