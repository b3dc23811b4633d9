"""Settings and fixtures that all tests of the core share."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

from potmesil_addon import jit

jit.set_cache_directory(Path(os.environ["NUMBA_CACHE_DIR"]))

# The same examples on every run: a test that fails once in a while helps nobody.
hypothesis.settings.register_profile("core", derandomize=True, deadline=None, max_examples=60, database=None)
hypothesis.settings.load_profile("core")


@pytest.fixture
def all_threads() -> Iterator[int]:
    """Let the kernels use all threads, give their number, and put back afterwards what they used."""
    before = jit.set_thread_count(None)
    yield jit.set_thread_count(sys.maxsize)
    jit.set_thread_count(before)
