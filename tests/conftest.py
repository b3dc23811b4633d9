"""Where all tests keep compiled kernels, and which of them may run beside each other."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent

# To compile takes longer than all else. Blenders with the same Python share kernels, as installed extensions
# with the same source do. Subprocesses and Blender with a window inherit this.
os.environ.setdefault("NUMBA_CACHE_DIR", str(HERE.parent / "build" / "kernels"))

from potmesil_addon import jit  # noqa: E402 - numba reads its folder when it is imported


def pytest_configure(config: pytest.Config) -> None:
    """Let a worker's kernels run on one thread, unless a test asks for more.

    Threads that wait for small kernels keep a core busy, and each other from the work.
    """
    if hasattr(config, "workerinput"):
        jit.set_thread_count(1)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep a file's tests together, and those of the installed extension, which compile the same kernels."""
    if not config.pluginmanager.hasplugin("xdist"):
        return
    for item in items:
        installed = item.path.parent == HERE / "blender" and "extension" in getattr(item, "fixturenames", ())
        item.add_marker(pytest.mark.xdist_group("extension" if installed else str(item.path)))
