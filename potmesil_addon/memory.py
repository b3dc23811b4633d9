"""What memory this process takes.

Examples
--------
>>> resident() > 0
True
"""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path
from typing import Final

_OF_PROCESS: Final = Path("/proc/self")

_MMAP_THRESHOLD: Final = -3
"""Number of that parameter in malloc.h."""

_LARGER: Final = 4 * 2**20


def resident() -> int:
    """Return the bytes of memory that the process holds; the most that it has held on a Mac.

    Returns
    -------
    int
        Resident set size.
    """
    if (_OF_PROCESS / "statm").exists():
        return int((_OF_PROCESS / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    if sys.platform == "win32":
        return _counters_of_windows()[2]
    # Nothing in the standard library says what it holds now.
    return peak()


def peak() -> int:
    """Return the most bytes of memory that the process has held.

    Returns
    -------
    int
        Of this program alone: Linux lets the number that `getrusage` tells begin with what the program held
        that started this one.
    """
    if (_OF_PROCESS / "status").exists():
        for line in (_OF_PROCESS / "status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    if sys.platform == "win32":
        return _counters_of_windows()[1]
    import resource  # noqa: PLC0415 - not on Windows

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Kilobytes but on a Mac.
    return most if sys.platform == "darwin" else most * 1024


def return_what_is_freed() -> None:
    """From now on give the system all larger pieces of memory that are freed, at once.

    glibc keeps pieces of up to 32 MiB, such as a frame's depths, for as long as anything lies behind them.
    """
    if sys.platform == "linux":
        import ctypes  # noqa: PLC0415 - only here

        with contextlib.suppress(AttributeError):
            ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LARGER)


def _counters_of_windows() -> list[int]:
    import ctypes  # noqa: PLC0415 - only here

    counters = (ctypes.c_size_t * 10)(10 * ctypes.sizeof(ctypes.c_size_t))
    kernel = getattr(ctypes, "windll").kernel32  # noqa: B009 - there on Windows alone
    kernel.GetCurrentProcess.restype = ctypes.c_void_p
    kernel.K32GetProcessMemoryInfo.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32]
    kernel.K32GetProcessMemoryInfo(kernel.GetCurrentProcess(), counters, ctypes.sizeof(counters))
    # The structure's size and the number of page faults, 4 bytes each; the peak; what is held now.
    return list(counters)
