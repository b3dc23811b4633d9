"""Which tests may run beside each other, where there are several workers."""

from __future__ import annotations

from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep a file's tests together, and those of the installed extension, which compile the same kernels."""
    if not config.pluginmanager.hasplugin("xdist"):
        return
    for item in items:
        installed = item.path.parent == HERE / "blender" and "extension" in getattr(item, "fixturenames", ())
        item.add_marker(pytest.mark.xdist_group("extension" if installed else str(item.path)))
