"""Where compiled kernels are kept inside Blender, and who compiles them.

numba and scipy take the better part of a second to import. Modules of the core that use them are
imported where they are first needed, after `use_user_cache`, so that Blender starts no slower.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
from pathlib import Path
from typing import Any

import bpy

from ..potmesil_addon import beside
from ..potmesil_addon.errors import InputError

_EXTENSION = __package__.rpartition(".")[0]


def use_user_cache() -> None:
    """Keep compiled kernels in a folder of the user's, which upgrades leave alone."""
    from ..potmesil_addon import jit  # noqa: PLC0415 - imports numba

    jit.set_cache_directory(cache_folder())


def compile_beside(samples: Path, settings: dict[str, Any]) -> None:
    """Have a second process compile kernels too, should any of a picture's have to be, until `end_beside`.

    Parameters
    ----------
    samples : Path
        The samples file.
    settings : dict
        As `process.settings_values` has them.
    """
    from ..potmesil_addon import jit  # noqa: PLC0415 - imports numba

    end_beside()
    _Wanted.arguments = [str(samples), json.dumps(settings), str(cache_folder())]
    if not _Wanted.listening and (os.cpu_count() or 1) > 1:
        _Wanted.listening = True
        jit.on_compile(_help)


def end_beside() -> None:
    """End that process: the picture is there, or nobody waits for it any more."""
    _Wanted.arguments = None
    process, _Wanted.process = _Wanted.process, None
    if process is not None:
        process.kill()
        process.wait()


class _Wanted:
    """What the next picture's kernels are for; None once there is a process that compiles them."""

    arguments: list[str] | None = None
    listening = False
    process: subprocess.Popen[bytes] | None = None


def _help(_: str) -> None:
    arguments, _Wanted.arguments = _Wanted.arguments, None
    if arguments is not None:
        # Alone it takes longer, and comes to the same.
        with contextlib.suppress(OSError, InputError):
            _Wanted.process = beside.start("warm", arguments, subprocess.DEVNULL)


def cache_folder() -> Path:
    """Return that folder."""
    if _EXTENSION.startswith("bl_ext."):
        return Path(bpy.utils.extension_path_user(_EXTENSION, path="kernels", create=True))
    # A checkout that a script loaded.
    return Path(bpy.utils.user_resource("DATAFILES", path="potmesil_camera/kernels", create=True))
