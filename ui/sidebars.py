"""The tabs in the sidebars of the Image Editor and of the compositor."""

from __future__ import annotations

import bpy

from . import draw


class POTMESIL_PT_image(bpy.types.Panel):
    """Focus, aperture and shutter beside the result."""

    bl_label = "Potmesil Camera"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Potmesil"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, and what can be changed after the render."""
        layout = self.layout
        scene = context.scene
        own = scene.potmesil_camera
        draw.buttons(layout, context, render=False)
        if scene.camera is None or scene.camera.type != "CAMERA":
            layout.label(text="The Scene Has No Camera", icon="INFO")
            return
        layout.use_property_split = True
        column = layout.column()
        column.active = own.use_lens
        draw.lens(column, scene.camera.data)
        column = layout.column()
        column.active = own.use_motion
        draw.shutter(column, scene)


class POTMESIL_PT_compositor(bpy.types.Panel):
    """The stage, beside the tree that it is in."""

    bl_label = "Potmesil Camera"
    bl_space_type = "NODE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Potmesil"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show in the compositor only."""
        return bool(context.space_data.tree_type == "CompositorNodeTree")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, the progress, the last error, and what is done with all frames."""
        draw.buttons(self.layout, context)
        draw.stage(self.layout, context)
        draw.animation(self.layout, context)


CLASSES = (POTMESIL_PT_image, POTMESIL_PT_compositor)
