"""The memory that the process is said to take is its own."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from potmesil_addon import memory

from .helpers import importable

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems tell less")


def test_what_is_held_and_was_held() -> None:
    before = memory.resident()
    held = np.ones(100 << 20, dtype=np.uint8)
    assert memory.resident() - before > 0.9 * held.nbytes
    assert memory.peak() >= memory.resident() - (1 << 20)
    most = memory.peak()
    del held
    # Linux counts in steps, core by core.
    assert memory.peak() >= most - (1 << 20)


def test_a_large_parent_does_not_count() -> None:
    """Else a small frame is over its cap on a farm whose worker is large."""
    held = np.ones(400 << 20, dtype=np.uint8)
    told = "from potmesil_addon import memory; print(memory.peak())"
    done = subprocess.run(
        [sys.executable, "-c", told], env=importable(), capture_output=True, text=True, check=True
    )
    assert int(done.stdout) < held.nbytes // 2
