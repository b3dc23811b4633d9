"""The panels on a camera's Data tab: focus, lens, limits, aperture."""

from __future__ import annotations

import bpy

from . import draw, presets
from .check import CheckPanel
from .viewport import draw_focus_tools


class _CameraPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show where Blender shows a camera."""
        return context.camera is not None


class POTMESIL_PT_camera(_CameraPanel, bpy.types.Panel):
    """Render and Process, and what they say."""

    bl_label = "Potmesil Camera"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Draw the menu of lenses and films."""
        del context
        presets.POTMESIL_PT_camera_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, the progress, and the last error."""
        layout = self.layout
        draw.buttons(layout, context)
        active = context.scene.camera
        if active is None or active.data != context.camera:
            layout.label(text="Not the Scene's Active Camera", icon="INFO")


class POTMESIL_PT_focus(_CameraPanel, bpy.types.Panel):
    """The plane in focus and the lens, straight from Blender's camera."""

    bl_label = "Focus"
    bl_parent_id = "POTMESIL_PT_camera"

    def draw_header(self, context: bpy.types.Context) -> None:
        """Draw the switch of the focus processor."""
        self.layout.prop(context.scene.potmesil_camera, "use_lens", text="")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw focus, lens, and the limits of the depth of field."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = True
        layout.active = context.scene.potmesil_camera.use_lens
        draw.lens(layout, context.camera)
        draw_focus_tools(layout, context)
        draw.limits(layout, context, context.object)


class POTMESIL_PT_aperture(_CameraPanel, bpy.types.Panel):
    """The iris, and how points out of focus are imaged."""

    bl_label = "Aperture"
    bl_parent_id = "POTMESIL_PT_focus"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw Blender's iris and our models."""
        layout = self.layout
        layout.use_property_split = True
        dof = context.camera.dof
        own = context.scene.potmesil_camera
        layout.active = own.use_lens
        column = layout.column(align=True)
        column.prop(dof, "aperture_blades", text="Blades")
        column.prop(dof, "aperture_rotation", text="Rotation")
        column.prop(dof, "aperture_ratio", text="Ratio")
        layout.prop(own, "coc_model")
        layout.prop(own, "psf")
        layout.prop(own, "visibility")


class POTMESIL_PT_camera_check(_CameraPanel, CheckPanel, bpy.types.Panel):
    """What stands in the way of a good picture."""

    bl_parent_id = "POTMESIL_PT_camera"


CLASSES = (POTMESIL_PT_camera, POTMESIL_PT_focus, POTMESIL_PT_aperture, POTMESIL_PT_camera_check)
