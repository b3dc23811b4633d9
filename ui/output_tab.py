"""The panel on the Output tab: where samples are kept, animations, and what the compositor sees."""

from __future__ import annotations

import bpy

from . import draw


class POTMESIL_PT_output(bpy.types.Panel):
    """The samples file, the compositor stage, and all frames."""

    bl_label = "Potmesil Camera"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "output"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the file and the buttons."""
        layout = self.layout
        column = layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(context.scene.potmesil_camera, "samples_path", text="Samples")
        draw.stage(layout, context)
        draw.animation(layout, context)


CLASSES = (POTMESIL_PT_output,)
