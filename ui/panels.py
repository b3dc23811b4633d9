"""The panel beside Blender's own Depth of Field: focus, shutter, printer, pre-flight check, buttons."""

from __future__ import annotations

from typing import Any

import bpy

from ..operators import compat
from ..operators import scene as adapter
from ..operators.stage import stage_scene
from ..potmesil_addon.errors import PotmesilError
from ..potmesil_addon.lens import depth_of_field
from ..potmesil_addon.preflight import check_scene
from . import presets

_ICONS = {"error": "CANCEL", "warning": "ERROR", "note": "INFO"}
_CURVE_SHAPES = (
    ("SMOOTH", "SMOOTHCURVE"),
    ("ROUND", "SPHERECURVE"),
    ("ROOT", "ROOTCURVE"),
    ("SHARP", "SHARPCURVE"),
    ("LINE", "LINCURVE"),
    ("MAX", "NOCURVE"),
)
"""The shapes that Blender can give the shutter's curve, and their icons."""

_LABEL_WIDTH = 6.2
"""Pixels a character at the standard interface scale, to break a sentence into labels."""


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
        state = context.window_manager.potmesil_camera
        scene = context.scene
        if state.running:
            layout.progress(factor=state.progress, text="Working (Esc to Cancel)")
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.enabled = not state.running
        row.operator("potmesil.render", icon="RENDER_STILL")
        row.operator("potmesil.process", icon="FILE_REFRESH")
        if _has_stage(scene):
            _composite(layout, context)
        _live(layout, context)
        if state.error:
            _sentence(layout, context, state.error, "CANCEL")
        if scene.camera is None or scene.camera.data != context.camera:
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
        camera = context.camera
        dof = camera.dof
        own = context.scene.potmesil_camera
        layout.active = own.use_lens
        column = layout.column(align=True)
        column.prop(dof, "focus_object", text="Focus on Object")
        if dof.focus_object is not None and dof.focus_object.type == "ARMATURE":
            column.prop_search(dof, "focus_subtarget", dof.focus_object.data, "bones", text="Focus Bone")
        distance = column.row()
        distance.active = dof.focus_object is None
        distance.prop(dof, "focus_distance", text="Focus Distance")
        column = layout.column(align=True)
        column.prop(camera, "lens", text="Focal Length")
        column.prop(dof, "aperture_fstop", text="F-Stop")
        _limits(layout, context)


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
        column = layout.column(align=True)
        column.prop(dof, "aperture_blades", text="Blades")
        column.prop(dof, "aperture_rotation", text="Rotation")
        column.prop(dof, "aperture_ratio", text="Ratio")
        layout.prop(own, "coc_model")
        layout.prop(own, "psf")
        layout.prop(own, "visibility")


class POTMESIL_PT_shutter(_CameraPanel, bpy.types.Panel):
    """The exposure: when and how long Blender's render settings say, and how the shutter opens."""

    bl_label = "Shutter"
    bl_parent_id = "POTMESIL_PT_camera"

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
        column = layout.column(align=True)
        column.prop(scene.render, "motion_blur_position", text="Position")
        column.prop(scene.render, "motion_blur_shutter", text="Shutter")
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
        elif own.shutter_kind == "between_lens":
            column.prop(own, "blade_time")
        elif scene.render.engine == "CYCLES":
            _rolling_shutter(column, compat.cycles_settings(scene))
        layout.prop(own, "motion_model")


class POTMESIL_PT_shutter_curve(_CameraPanel, bpy.types.Panel):
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


class POTMESIL_PT_printer(_CameraPanel, bpy.types.Panel):
    """What happens to the finished picture: uniform defocus and fades."""

    bl_label = "Optical Printer"
    bl_parent_id = "POTMESIL_PT_camera"
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


class POTMESIL_PT_samples(_CameraPanel, bpy.types.Panel):
    """What is rendered, where it goes, and what stands in its way."""

    bl_label = "Samples"
    bl_parent_id = "POTMESIL_PT_camera"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the samples file and the pre-flight check."""
        layout = self.layout
        own = context.scene.potmesil_camera
        column = layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(own, "samples_path", text="File")
        column.prop(own, "sampling")
        _further_samples(column, context)
        _quality(column, context)
        findings = check_scene(adapter.scene_facts(context.scene))
        box = layout.box()
        if not findings:
            box.label(text="Ready to Render", icon="CHECKMARK")
        for finding in findings:
            column = box.column(align=True)
            column.label(text=finding.title, icon=_ICONS[finding.severity])
            _sentence(column, context, finding.text)
        if any(finding.fix == "setup_passes" for finding in findings):
            box.operator("potmesil.setup_passes", icon="RENDERLAYERS")


class POTMESIL_PT_stage(_CameraPanel, bpy.types.Panel):
    """Whether the compositor sees the processed picture."""

    bl_label = "Compositor"
    bl_parent_id = "POTMESIL_PT_camera"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons that add and remove the stage."""
        _stage(self.layout, context)


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
        """Draw the buttons, the progress, and the last error."""
        layout = self.layout
        state = context.window_manager.potmesil_camera
        if state.running:
            layout.progress(factor=state.progress, text="Working (Esc to Cancel)")
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.enabled = not state.running
        row.operator("potmesil.render", icon="RENDER_STILL")
        row.operator("potmesil.process", icon="FILE_REFRESH")
        if _has_stage(context.scene):
            _composite(layout, context)
        _stage(layout, context)
        if state.error:
            _sentence(layout, context, state.error, "CANCEL")


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


class POTMESIL_PT_image(bpy.types.Panel):
    """Focus, aperture and shutter beside the result."""

    bl_label = "Potmesil Camera"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Potmesil"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, and what can be changed after the render."""
        layout = self.layout
        state = context.window_manager.potmesil_camera
        scene = context.scene
        own = scene.potmesil_camera
        if state.running:
            layout.progress(factor=state.progress, text="Working (Esc to Cancel)")
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.enabled = not state.running
        row.operator("potmesil.process", icon="FILE_REFRESH")
        _live(layout, context)
        if state.error:
            _sentence(layout, context, state.error, "CANCEL")
        if scene.camera is None or scene.camera.type != "CAMERA":
            layout.label(text="The Scene Has No Camera", icon="INFO")
            return
        camera = scene.camera.data
        layout.use_property_split = True
        column = layout.column(align=True)
        column.active = own.use_lens
        column.prop(camera.dof, "focus_object", text="Focus on Object")
        distance = column.row()
        distance.active = camera.dof.focus_object is None
        distance.prop(camera.dof, "focus_distance", text="Focus Distance")
        column.prop(camera, "lens", text="Focal Length")
        column.prop(camera.dof, "aperture_fstop", text="F-Stop")
        column = layout.column(align=True)
        column.active = own.use_motion
        column.prop(scene.render, "motion_blur_position", text="Position")
        column.prop(scene.render, "motion_blur_shutter", text="Shutter")


def _has_stage(scene: bpy.types.Scene) -> bool:
    """Return whether a scene's compositor sees the processed picture."""
    return stage_scene(scene) is not None


def _composite(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what runs the compositor, for the frame and for all frames."""
    state = context.window_manager.potmesil_camera
    column = layout.column(align=True)
    column.enabled = not state.running
    column.operator("potmesil.composite", icon="NODE_COMPOSITING")
    column.operator("potmesil.composite", text="Composite Animation", icon="SEQUENCE").animation = True
    column.operator("potmesil.render_animation", icon="RENDER_ANIMATION")


def _stage(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the buttons that add, update and remove the stage."""
    scene = context.scene
    state = context.window_manager.potmesil_camera
    row = layout.row(align=True)
    row.enabled = not state.running
    if not _has_stage(scene):
        row.operator("potmesil.add_stage", icon="ADD")
        return
    row.operator("potmesil.add_stage", text="Update Stage", icon="FILE_REFRESH")
    row.operator("potmesil.remove_stage", icon="X")
    if not scene.render.use_compositing:
        _sentence(layout, context, "Compositing is off in the output's post processing.", "ERROR")
    if not scene.render.use_lock_interface:
        _sentence(layout, context, "Turn Render > Lock Interface on: renders follow what moves.", "ERROR")


def _live(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the switch of Live Focus, and below it what there is to say."""
    state = context.window_manager.potmesil_camera
    row = layout.row(align=True)
    row.enabled = not state.running
    row.operator(
        "potmesil.live",
        text="Confirm" if state.live else "Live Focus",
        icon="CHECKMARK" if state.live else "PLAY",
        depress=state.live,
    )
    if state.live:
        row.operator("potmesil.end_live", text="Cancel", icon="X")
    if state.live_message:
        _sentence(layout, context, state.live_message, "INFO")


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
        _sentence(column, context, "No collection is marked Peel Off, in its own properties.", "INFO")


def _quality(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw how sure the result is, and the switch for pictures of that."""
    state = context.window_manager.potmesil_camera
    column = layout.column(align=True)
    column.prop(context.scene.potmesil_camera, "use_quality_maps")
    if state.has_quality:
        column.label(text=f"Guessed: {100.0 * state.guessed_pixels:.1f} % of the Pixels")
        column.label(text=f"Expected Error: {100.0 * state.expected_error:.1f} % of White")


def _rolling_shutter(column: bpy.types.UILayout, cycles: Any) -> None:
    """Draw Cycles' own rolling shutter."""
    if cycles is None:
        return
    column.prop(cycles, "rolling_shutter_type", text="Rolling")
    if cycles.rolling_shutter_type != "NONE":
        column.prop(cycles, "rolling_shutter_duration", text="Line Time")


def _limits(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the limits of what appears sharp, for the camera whose panel this is."""
    scene = context.scene
    item = context.object
    if item is None or item.type != "CAMERA":
        return
    try:
        camera = item.evaluated_get(context.evaluated_depsgraph_get())
        lens = adapter.scene_lens(camera)
    except PotmesilError as error:
        _sentence(layout, context, str(error), "ERROR")
        return
    limits = depth_of_field(lens)
    column = layout.column(align=True)
    rows = [("Near Limit", limits.near), ("Far Limit", limits.far), ("Hyperfocal", limits.hyperfocal)]
    if camera.data.dof.focus_object is not None:
        rows.insert(0, ("Focused At", lens.focus_distance))
    for name, value in rows:
        split = column.split(factor=0.4)
        left = split.row()
        left.alignment = "RIGHT"
        left.label(text=name)
        split.label(text=adapter.as_length(scene, value))
    if scene.unit_settings.scale_length != 1.0:
        column.label(text="The Lens Takes One Unit for One Metre", icon="INFO")


def _sentence(
    layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "BLANK1"
) -> None:
    """Draw a sentence over as many labels as the region's width needs."""
    scale = context.preferences.system.ui_scale
    width = max(20, int(context.region.width / (_LABEL_WIDTH * scale)) - 8)
    column = layout.column(align=True)
    line = ""
    lines = []
    for word in text.split():
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}" if line else word
    lines.append(line)
    for number, part in enumerate(lines):
        column.label(text=part, icon=icon if number == 0 else "BLANK1")


CLASSES = (
    POTMESIL_PT_camera,
    POTMESIL_PT_focus,
    POTMESIL_PT_aperture,
    POTMESIL_PT_shutter,
    POTMESIL_PT_shutter_curve,
    POTMESIL_PT_printer,
    POTMESIL_PT_samples,
    POTMESIL_PT_stage,
    POTMESIL_PT_compositor,
    POTMESIL_PT_collection,
    POTMESIL_PT_image,
)
