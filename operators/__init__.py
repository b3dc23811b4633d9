"""Operators: each reads the scene into the core's dataclasses, calls the core, and writes the result."""

from __future__ import annotations

import bpy

from . import command, live, process, render, setup_passes

CLASSES = (
    setup_passes.POTMESIL_OT_setup_passes,
    render.POTMESIL_OT_render,
    render.POTMESIL_OT_watch_render,
    process.POTMESIL_OT_process,
    live.POTMESIL_OT_live,
    live.POTMESIL_OT_end_live,
)

_command_handle = None


def register() -> None:
    """Register the operators and the extension's command."""
    global _command_handle  # noqa: PLW0603 - Blender's handle is needed to unregister
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    _command_handle = bpy.utils.register_cli_command(command.NAME, command.main)


def unregister() -> None:
    """Unregister the command and the operators."""
    live.shut_down()
    bpy.utils.unregister_cli_command(_command_handle)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
