"""Python processes beside this one, which run a module of the core and nothing of Blender's."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import IO

from .errors import InputError

_NEEDED = ("numpy", "scipy", "numba", "llvmlite", "OpenEXR")
_CORE = __package__ or ""

_BOOT = """
import importlib, sys, types
core, root, main, *arguments = sys.argv[1:]
name = ""
for part in core.split(".")[:-1]:
    name = f"{name}.{part}".lstrip(".")
    sys.modules[name] = module = types.ModuleType(name)
    module.__path__ = []
(module.__path__ if name else sys.path).append(root)
raise SystemExit(importlib.import_module(f"{core}.{main}").main(arguments))
"""
"""Runs a module of the core in a package of the same name as here, inside Blender as well, without the rest.

A compiled kernel on disk belongs to a package by its name: with the same one, what a process has compiled is
there for all.
"""


def start(module: str, arguments: list[str], log: IO[bytes] | int) -> subprocess.Popen[bytes]:
    """Start a process.

    Parameters
    ----------
    module : str
        Name of a module of the core; its `main` is called.
    arguments : list of str
        What it is called with.
    log : file or int
        Where its output goes, as `subprocess` has it.

    Returns
    -------
    subprocess.Popen
        The process.

    Raises
    ------
    InputError
        If Blender's Python is not where it is expected.
    OSError
        If the process does not start.
    """
    # As it is named here: kernels on disk are found by the path of their source.
    root = Path(__file__).absolute().parents[1]
    flags = 0
    if sys.platform == "win32":
        flags = subprocess.CREATE_NO_WINDOW | subprocess.BELOW_NORMAL_PRIORITY_CLASS
    return subprocess.Popen(
        # Without -P a module in the folder where Blender was started would come first.
        [_python(), "-P", "-c", _BOOT, _CORE, str(root), module, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        env=_environment(),
        creationflags=flags,
    )


def _python() -> str:
    """Return this program's Python, or the one that Blender brings."""
    if Path(sys.executable).stem.lower().startswith("python"):
        return sys.executable
    names = ("bin/python.exe",) if sys.platform == "win32" else (f"bin/python3.{sys.version_info.minor}",)
    for name in names:
        if (Path(sys.prefix) / name).is_file():
            return str(Path(sys.prefix) / name)
    raise InputError("Blender's Python is not found; use Process instead of Live Focus.")


def _environment() -> dict[str, str]:
    """Return what lets the process find the packages that Blender finds."""
    folders: list[str] = []
    for name in _NEEDED:
        # Nothing is imported here: that would take the better part of a second.
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.origin:
            place = Path(spec.origin).parent
            folder = str(place.parent if Path(spec.origin).stem == "__init__" else place)
            if folder not in folders:
                folders.append(folder)
    return {**os.environ, "PYTHONPATH": os.pathsep.join(folders), "PYTHONDONTWRITEBYTECODE": "1"}
