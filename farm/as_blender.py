#!/usr/bin/env python3
"""Stand in for `blender` where the extension is not installed, or where there is only the bpy module.

farm/as_blender.py -b scene.blend --command potmesil_camera COMMAND ...

takes the words that the farm's jobs give to Blender and runs the same through farm/run.py: under the Python
that runs this, if it has bpy, otherwise in the Blender that the environment variable BLENDER names.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

RUN = Path(__file__).resolve().parent / "run.py"
EXTENSION = "potmesil_camera"


def translate(words: list[str], module: bool, blender: str) -> list[str]:
    """Return the command line for words that are meant for Blender.

    Parameters
    ----------
    words : list of str
        What follows `blender`: options, perhaps a .blend file, then `--command potmesil_camera ...` or
        `--python SCRIPT -- ...`.
    module : bool
        Whether to run under the bpy module.
    blender : str
        The Blender that takes over where that is not so.

    Returns
    -------
    list of str
        The program and its arguments.

    Raises
    ------
    ValueError
        The words name neither the extension's command nor a script.
    """
    scene = [word for word in words[: _first(words, "--command", "--python")] if not word.startswith("-")]
    if "--command" in words:
        name, *arguments = [*words[words.index("--command") + 1 :], ""][:-1] or [""]
        if name != EXTENSION:
            raise ValueError(f"only --command {EXTENSION} can be stood in for, not {name or 'none'}.")
        if module:
            return [sys.executable, str(RUN), "--", *(["--blend", scene[0]] if scene else []), *arguments]
        return [blender, "-b", *scene, "--python-exit-code", "1", "--python", str(RUN), "--", *arguments]
    if "--python" not in words:
        raise ValueError(f"the words name neither --command {EXTENSION} nor --python SCRIPT.")
    if module:
        return [sys.executable, *words[words.index("--python") + 1 :]]
    return [blender, *words]


def _first(words: list[str], *options: str) -> int:
    """Return where the first of some options stands, or the number of words."""
    return min((words.index(option) for option in options if option in words), default=len(words))


def main() -> int:
    """Become the program, so that a signal to this one reaches it."""
    module = importlib.util.find_spec("bpy") is not None
    try:
        command = translate(sys.argv[1:], module, os.environ.get("BLENDER", "blender"))
    except ValueError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    if os.name == "nt":
        # Windows' exec ends the calling process at once, and a farm would take the task for done.
        return subprocess.call(command)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        print(f"Error: {command[0]} cannot be run: {error.strerror}.", file=sys.stderr)
        return 3


if __name__ == "__main__":
    sys.exit(main())
