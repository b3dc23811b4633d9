"""Whole files or none: results are written beside their place, flushed to disk and renamed into it."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from .errors import OutputError

_STALE_AFTER: Final = 24 * 3600.0
"""Age in seconds from which a left-over part of a killed process is taken for abandoned."""


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path that becomes `path` only if the block ends without an error.

    Parameters
    ----------
    path : Path
        Where the file will be. Its folder is made if it is missing.

    Yields
    ------
    Path
        A path in the same folder, to be written by the block.

    Raises
    ------
    OutputError
        If the folder or the file cannot be written. An older file at `path` is then as it was.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_stale_parts(path)
        yield part
        with part.open("rb+") as stream:
            os.fsync(stream.fileno())
        part.replace(path)
    except (OSError, RuntimeError) as error:
        # The OpenEXR module reports what the system says as a RuntimeError.
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise OutputError(f"Cannot write '{path}': {reason}; check the folder and the disk.") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def _remove_stale_parts(path: Path) -> None:
    """Remove what a killed process left of the same file a day or more ago."""
    for old in path.parent.glob(f".{_escape(path.stem)}.*.part{_escape(path.suffix)}"):
        with contextlib.suppress(OSError):
            if time.time() - old.stat().st_mtime > _STALE_AFTER:
                old.unlink()


def _escape(name: str) -> str:
    """Return a glob pattern that matches a name and nothing else."""
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)
