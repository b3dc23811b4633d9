"""Where compiled kernels are kept inside Blender.

numba and scipy take the better part of a second to import. Modules of the core that use them are
imported where they are first needed, after `use_user_cache`, so that Blender starts no slower.
"""

from __future__ import annotations

from pathlib import Path

import bpy

_EXTENSION = __package__.rpartition(".")[0]


def use_user_cache() -> None:
    """Keep compiled kernels in a folder of the user's, which upgrades leave alone."""
    from ..potmesil_addon import jit  # noqa: PLC0415 - imports numba

    jit.set_cache_directory(cache_folder())


def cache_folder() -> Path:
    """Return that folder."""
    if _EXTENSION.startswith("bl_ext."):
        return Path(bpy.utils.extension_path_user(_EXTENSION, path="kernels", create=True))
    # A checkout that a script loaded.
    return Path(bpy.utils.user_resource("DATAFILES", path="potmesil_camera/kernels", create=True))
