"""Operators: each reads the scene into the core's dataclasses, calls the core, and writes the result."""

from __future__ import annotations

import bpy

from . import (
    all_frames,
    command,
    composite,
    fix,
    focus,
    inspection,
    job,
    live,
    process,
    render,
    setup_passes,
    stage,
    stage_engine,
    work,
)

CLASSES = (
    setup_passes.POTMESIL_OT_setup_passes,
    fix.POTMESIL_OT_fix,
    fix.POTMESIL_OT_fix_all,
    render.POTMESIL_OT_render,
    job.POTMESIL_OT_watch_render,
    process.POTMESIL_OT_process,
    composite.POTMESIL_OT_composite,
    all_frames.POTMESIL_OT_render_animation,
    all_frames.POTMESIL_OT_process_animation,
    stage.POTMESIL_OT_add_stage,
    stage.POTMESIL_OT_remove_stage,
    stage_engine.PotmesilStageEngine,
    live.POTMESIL_OT_live,
    live.POTMESIL_OT_end_live,
    *focus.CLASSES,
    inspection.POTMESIL_OT_inspect,
    inspection.POTMESIL_OT_inspect_hand,
)

_command_handle = None


def register() -> None:
    """Register the operators and the extension's command."""
    global _command_handle  # noqa: PLW0603 - Blender's handle is needed to unregister
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    stage_engine.register()
    _command_handle = bpy.utils.register_cli_command(command.NAME, command.main)


def unregister() -> None:
    """Unregister the command and the operators."""
    inspection.shut_down()
    live.shut_down()
    work.shut_down()
    stage_engine.unregister()
    bpy.utils.unregister_cli_command(_command_handle)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
