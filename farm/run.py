"""The extension's command for a Blender that has not got it installed, or got it under any repository's name.

blender -b scene.blend --python-exit-code 1 --python farm/run.py -- render --frames 1-4 --output out/####.exr

With Blender as a Python module, bpy, the .blend file is named by --blend:

python farm/run.py --blend scene.blend render --frames 1-4 --output out/####.exr
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import importlib.util
import os
import shutil
import sys
import traceback
from pathlib import Path
from types import ModuleType

import bpy

PACKAGE = "potmesil_camera"

MISSING_INPUT = 3
"""As potmesil_addon.errors has it, which may not be loaded yet."""


def load_extension() -> ModuleType:
    """Return the extension's root package: the enabled one, or this checkout, registered.

    Returns
    -------
    module
        The package; its ``operators.command.main`` is the command.
    """
    for name, module in list(sys.modules.items()):
        if name.startswith("bl_ext.") and name.endswith(f".{PACKAGE}"):
            return module
    root = Path(__file__).resolve().parent.parent
    spec = importlib.util.spec_from_file_location(
        PACKAGE, root / "__init__.py", submodule_search_locations=[str(root)]
    )
    assert spec is not None
    assert spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    sys.modules[PACKAGE] = package
    spec.loader.exec_module(package)
    package.register()
    if bpy.app.module:
        # Blender 4.5 as a module crashes at its end where a script's classes are still registered.
        atexit.register(package.unregister)
    return package


def open_blend(path: str) -> None:
    """Open a .blend file, whose scripts stay off, or end with the status of missing input."""
    try:
        bpy.ops.wm.open_mainfile(filepath=str(Path(path).absolute()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        print(f"Error: {' '.join(str(error).removeprefix('Error:').split())}", file=sys.stderr)
        raise SystemExit(MISSING_INPUT) from error


def main() -> int:
    """Run the command with the words after ``--``, or those after the script's name."""
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    package = load_extension()
    if arguments[:1] == ["--blend"] and len(arguments) > 1:
        open_blend(arguments[1])
        arguments = arguments[2:]
    command = importlib.import_module(f"{package.__name__}.operators.command")
    return command.main(arguments)


def end(status: int | str | None) -> None:
    """End the process without what Blender as a module does at its end: 4.5 hangs there once a driver ran.

    Parameters
    ----------
    status : int or str or None
        As `sys.exit` takes it.
    """
    if isinstance(status, str):
        print(status, file=sys.stderr)
        status = 1
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    for stream in (sys.stdout, sys.stderr):
        # Who reads may be gone.
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(status or 0)


def main_as_module() -> None:
    """Run the command, and end the process whatever comes of it."""
    try:
        end(main())
    except SystemExit as stop:
        end(stop.code)
    except BaseException:
        traceback.print_exc()
        end(1)


if __name__ == "__main__":
    if bpy.app.module:
        main_as_module()
    sys.exit(main())
