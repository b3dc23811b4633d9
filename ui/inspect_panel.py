"""The panel of Inspect Focus in the Image Editor's sidebar."""

from __future__ import annotations

import bpy

from ..operators.inspection_draw import ZONE_NAMES
from . import draw

_ZONE_ICONS = {"near": "COLORSET_02_VEC", "sharp": "COLORSET_03_VEC", "far": "COLORSET_04_VEC"}
"""Blender's own squares of orange, green and blue."""


class POTMESIL_PT_inspect(bpy.types.Panel):
    """What is drawn over the result, and what its colours mean."""

    bl_label = "Inspect"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Potmesil"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the switch, what it shows, and the legend."""
        layout = self.layout
        state = context.window_manager.potmesil_camera
        layout.operator("potmesil.inspect", icon="VIEWZOOM", depress=state.inspect)
        if state.inspect_message:
            draw.sentence(layout, context, state.inspect_message, "INFO")
        column = layout.column(heading="Show")
        column.use_property_split = True
        column.active = state.inspect
        for name in ("inspect_overlay", "inspect_readout", "inspect_psf", "inspect_compare"):
            column.prop(state, name)
        split = column.column()
        split.active = state.inspect_compare
        split.prop(state, "split")
        if state.inspect and not context.scene.potmesil_camera.use_lens:
            draw.sentence(layout, context, "Depth of field is off: the result is sharp everywhere.", "INFO")
        row = layout.row()
        row.active = state.inspect and state.inspect_overlay
        for zone, name in ZONE_NAMES.items():
            row.label(text=name, icon=_ZONE_ICONS[zone])


CLASSES = (POTMESIL_PT_inspect,)
