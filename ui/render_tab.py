"""The panels on the Render tab: shutter, optical printer, quality; and a collection's and an object's own."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from ..operators import compat
from ..operators.cost import RenderCounts, render_counts
from ..operators.scene import RENDERED_TYPES, scene_exposure, uses_reflections
from ..operators.surfaces import surface_of
from ..potmesil_addon.surfaces import SurfaceKind
from . import draw, presets
from .check import CheckPanel

_CURVE_SHAPES = (
    ("SMOOTH", "SMOOTHCURVE"),
    ("ROUND", "SPHERECURVE"),
    ("ROOT", "ROOTCURVE"),
    ("SHARP", "SHARPCURVE"),
    ("LINE", "LINCURVE"),
    ("MAX", "NOCURVE"),
)
"""The shapes that Blender can give the shutter's curve, and their icons."""

_AS_MATERIAL = {
    SurfaceKind.ROUGH: n_("As Material: Opaque"),
    SurfaceKind.POLISHED: n_("As Material: Polished"),
    SurfaceKind.MIRROR: n_("As Material: Mirror"),
    SurfaceKind.GLASS: n_("As Material: Glass"),
    SurfaceKind.CLEAR: n_("As Material: Clear"),
}
"""What an object's materials come to."""


class _RenderPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"


class POTMESIL_PT_render(_RenderPanel, bpy.types.Panel):
    """Render and Process, and what they say."""

    bl_label = "Potmesil Camera"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, the progress, and the last error."""
        draw.buttons(self.layout, context)


class POTMESIL_PT_shutter(_RenderPanel, bpy.types.Panel):
    """The exposure: when and how long Blender's render settings say, and how the shutter opens."""

    bl_label = "Shutter"
    bl_parent_id = "POTMESIL_PT_render"

    def draw_header(self, context: bpy.types.Context) -> None:
        """Draw the switch of the motion processor."""
        self.layout.prop(context.scene.potmesil_camera, "use_motion", text="")

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Draw the menu of shutters."""
        del context
        presets.POTMESIL_PT_shutter_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw Blender's shutter and what Blender has no setting for."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = True
        scene = context.scene
        own = scene.potmesil_camera
        layout.active = own.use_motion
        draw.shutter(layout, scene)
        column = layout.column(align=True)
        column.prop(own, "exposure_count")
        if own.exposure_count > 1:
            column.prop(own, "exposure_duration")
            column.prop(own, "exposure_spacing")
        column = layout.column(align=True)
        column.prop(own, "shutter_kind")
        if own.shutter_kind == "focal_plane":
            column.prop(own, "slit_edge")
            column.prop(own, "slit_width")
        elif own.shutter_kind == "rotary":
            column.prop(own, "slit_edge", text="From")
            column.prop(own, "gate_angle")
        elif own.shutter_kind == "between_lens":
            column.prop(own, "blade_time")
        elif scene.render.engine == "CYCLES":
            _rolling_shutter(column, compat.cycles_settings(scene))
        layout.prop(own, "motion_model")


class POTMESIL_PT_flash(_RenderPanel, bpy.types.Panel):
    """Flashes beside the ambient light."""

    bl_label = "Flash"
    bl_parent_id = "POTMESIL_PT_shutter"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        """Draw the switch of the flash."""
        self.layout.prop(context.scene.potmesil_camera, "use_flash", text="")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw when it fires, and how much light it gives."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = True
        own = context.scene.potmesil_camera
        layout.active = own.use_motion and own.use_flash
        layout.prop(own, "flash_curtain")
        layout.prop(own, "flash_share", text="Share of Light")
        column = layout.column(align=True)
        column.prop(own, "flash_duration", text="Duration")
        column.prop(own, "flash_count")
        if own.use_flash and scene_exposure(context.scene).flash is None:
            draw.sentence(layout, context, "A slit uncovers a part of the film only: no flash fires.", "INFO")


class POTMESIL_PT_shutter_curve(_RenderPanel, bpy.types.Panel):
    """How far the shutter is open over the exposure, as Blender shows it."""

    bl_label = "Shutter Curve"
    bl_parent_id = "POTMESIL_PT_shutter"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw Blender's curve and its preset shapes."""
        layout = self.layout
        layout.active = context.scene.potmesil_camera.use_motion
        layout.template_curve_mapping(context.scene.render, "motion_blur_shutter_curve")
        row = layout.row(align=True)
        for shape, icon in _CURVE_SHAPES:
            row.operator("render.shutter_curve_preset", icon=icon, text="").shape = shape


class POTMESIL_PT_quality(_RenderPanel, bpy.types.Panel):
    """What is rendered beyond the picture, and how sure the result is."""

    bl_label = "Quality"
    bl_parent_id = "POTMESIL_PT_render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the sampling, the further views, and the result's quality."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(context.scene.potmesil_camera, "sampling")
        _further_samples(layout, context)
        _quality(layout, context)


class POTMESIL_PT_printer(_RenderPanel, bpy.types.Panel):
    """What happens to the finished picture: uniform defocus and fades."""

    bl_label = "Optical Printer"
    bl_parent_id = "POTMESIL_PT_render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what can be animated over a shot."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = True
        own = context.scene.potmesil_camera
        column = layout.column(align=True)
        column.prop(own, "uniform_defocus")
        column.prop(own, "fade")


class POTMESIL_PT_collection(bpy.types.Panel):
    """What the extension does with a collection."""

    bl_label = "Potmesil Camera"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "collection"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show where Blender shows a collection, which the scene's own is not."""
        return context.collection != context.scene.collection

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the mark for depth peeling."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = context.scene.potmesil_camera.depth_peeling == "COLLECTIONS"
        layout.prop(context.collection.potmesil_camera, "peel")


class POTMESIL_PT_object(bpy.types.Panel):
    """What light does at an object."""

    bl_label = "Potmesil Camera"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show for objects that can show in a render."""
        return context.object is not None and context.object.type in RENDERED_TYPES

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the choice of a surface, and what the materials come to."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = uses_reflections(context.scene)
        own = context.object.potmesil_camera
        column = layout.column(align=True)
        column.prop(own, "surface")
        if own.surface == "AUTO":
            found = surface_of(context.object, context.scene.potmesil_camera.max_roughness)
            kinds = set(found.kinds)
            text = _AS_MATERIAL[found.kinds[0]] if len(kinds) == 1 else n_("As Material: Differs by Slot")
            _beside_names(column).label(text=text)


def _further_samples(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what is rendered beyond the picture, where the processors that need it are on."""
    scene = context.scene
    own = scene.potmesil_camera
    column = layout.column(align=True)
    row = column.row()
    row.active = own.use_motion or own.use_lens
    row.prop(own, "use_overscan")
    row = column.row()
    row.active = own.use_motion
    row.prop(own, "use_hidden_surfaces")
    column = layout.column(align=True)
    column.active = own.use_lens
    column.prop(own, "depth_peeling")
    if own.depth_peeling == "AUTOMATIC":
        column.prop(own, "peel_count")
    marked = any(collection.potmesil_camera.peel for collection in scene.collection.children_recursive)
    if own.depth_peeling == "COLLECTIONS" and not marked:
        draw.sentence(column, context, "No collection is marked Peel Off, in its own properties.", "INFO")
    _reflections(layout, context)


def _reflections(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what is done with what mirrors and glass show, and what all of the views cost."""
    scene = context.scene
    own = scene.potmesil_camera
    column = layout.column(align=True)
    column.active = scene.render.engine == "CYCLES" and (own.use_motion or own.use_lens)
    column.prop(own, "reflections")
    if own.reflections != "OFF":
        column.prop(own, "max_roughness")
    counts = render_counts(scene)
    if uses_reflections(scene) and not counts.probes:
        draw.sentence(column, context, "No material is a mirror, glass or polished within the limit.", "INFO")
    _cost(layout, counts)


def _cost(layout: bpy.types.UILayout, counts: RenderCounts) -> None:
    """Draw how many renders a frame takes, where it takes more than one."""
    if counts.full == 1 and not counts.probes:
        return
    if not counts.probes:
        text = iface_("Up to {full} Renders")
    elif counts.full == 1:
        text = iface_("1 Render and {probes} Probes")
    else:
        text = iface_("Up to {full} Renders and {probes} Probes")
    _beside_names(layout).label(text=text.format(full=counts.full, probes=counts.probes))


def _beside_names(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Return where a label stands below the values, and not below their names."""
    split = layout.split(factor=0.4)
    split.label()
    return split


def _quality(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw how sure the result is, and the switch for pictures of that."""
    state = context.window_manager.potmesil_camera
    column = layout.column(align=True)
    column.prop(context.scene.potmesil_camera, "use_quality_maps")
    if state.has_quality:
        guessed = iface_("Guessed: {share:.1f} % of the Pixels")
        column.label(text=guessed.format(share=100.0 * state.guessed_pixels))
        error = iface_("Expected Error: {share:.1f} % of White")
        column.label(text=error.format(share=100.0 * state.expected_error))


def _rolling_shutter(column: bpy.types.UILayout, cycles: Any) -> None:
    """Draw Cycles' own rolling shutter."""
    if cycles is None:
        return
    column.prop(cycles, "rolling_shutter_type", text="Rolling")
    if cycles.rolling_shutter_type != "NONE":
        column.prop(cycles, "rolling_shutter_duration", text="Line Time")


class POTMESIL_PT_render_check(_RenderPanel, CheckPanel, bpy.types.Panel):
    """What stands in the way of a good picture."""

    bl_parent_id = "POTMESIL_PT_render"


CLASSES = (
    POTMESIL_PT_render,
    POTMESIL_PT_shutter,
    POTMESIL_PT_flash,
    POTMESIL_PT_shutter_curve,
    POTMESIL_PT_quality,
    POTMESIL_PT_printer,
    POTMESIL_PT_render_check,
    POTMESIL_PT_collection,
    POTMESIL_PT_object,
)
