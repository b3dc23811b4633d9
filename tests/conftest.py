"""Which tests may run beside each other, where there are several workers."""

from __future__ import annotations

from pathlib import Path

import pytest

from potmesil_addon import jit

HERE = Path(__file__).resolve().parent


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
