"""What goes on now: how far it is, how long it still takes, and how to end it."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..operators.work import how_far


def draw_progress(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the progress of the work that goes on, if there is any.

    Parameters
    ----------
    layout : UILayout
        Where.
    context : Context
        Its window manager knows what goes on.
    """
    state = context.window_manager.potmesil_camera
    if not state.running:
        return
    column = layout.column(align=True)
    column.progress(factor=state.progress, text=state.doing or "Working")
    column.label(text=iface_("{progress}, Esc to Cancel").format(progress=how_far(state)))
