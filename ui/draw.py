"""What several panels draw: the buttons, what goes on, sentences over as many lines as they need."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from ..operators import scene as adapter
from ..operators.stage import stage_scene
from ..potmesil_addon.errors import PotmesilError
from ..potmesil_addon.lens import depth_of_field
from .progress_bar import draw_progress

_LABEL_WIDTH = 6.2
"""Pixels a character at the standard interface scale, to break a sentence into labels."""


def buttons(layout: bpy.types.UILayout, context: bpy.types.Context, *, render: bool = True) -> None:
    """Draw the progress, Render, Process and Live Focus, and the last error.

    Parameters
    ----------
    layout : UILayout
        Where.
    context : Context
        Its window manager knows what goes on.
    render : bool
        Whether Render is among the buttons.
    """
    state = context.window_manager.potmesil_camera
    draw_progress(layout, context)
    row = layout.row(align=True)
    row.scale_y = 1.4
    row.enabled = not state.running
    if render:
        row.operator("potmesil.render", icon="RENDER_STILL")
    row.operator("potmesil.process", icon="FILE_REFRESH")
    if has_stage(context.scene):
        column = layout.column()
        column.enabled = not state.running
        column.operator("potmesil.composite", icon="NODE_COMPOSITING")
    live(layout, context)
    if state.error:
        sentence(layout, context, state.error, "CANCEL")


def has_stage(scene: bpy.types.Scene) -> bool:
    """Return whether a scene's compositor sees the processed picture."""
    return stage_scene(scene) is not None


def animation(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what is done with all frames."""
    state = context.window_manager.potmesil_camera
    column = layout.column(align=True)
    column.enabled = not state.running
    column.operator("potmesil.render_animation", icon="RENDER_ANIMATION")
    if has_stage(context.scene):
        column.operator("potmesil.composite", text="Composite Animation", icon="SEQUENCE").animation = True
    else:
        column.operator("potmesil.process_animation", icon="SEQUENCE")


def stage(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the buttons that add, update and remove the stage."""
    scene = context.scene
    state = context.window_manager.potmesil_camera
    row = layout.row(align=True)
    row.enabled = not state.running
    if not has_stage(scene):
        row.operator("potmesil.add_stage", icon="ADD")
        return
    row.operator("potmesil.add_stage", text="Update Stage", icon="FILE_REFRESH")
    row.operator("potmesil.remove_stage", icon="X")


def live(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
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
        sentence(layout, context, state.live_message, "INFO")


def lens(layout: bpy.types.UILayout, camera: bpy.types.Camera) -> None:
    """Draw Blender's own focus, focal length and f-stop of a camera."""
    dof = camera.dof
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


def shutter(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw Blender's own shutter."""
    column = layout.column(align=True)
    column.prop(scene.render, "motion_blur_position", text="Position")
    column.prop(scene.render, "motion_blur_shutter", text="Shutter")
    column.prop(scene.potmesil_camera, "shutter_angle", text="Angle")


def limits(layout: bpy.types.UILayout, context: bpy.types.Context, item: bpy.types.Object | None) -> None:
    """Draw the limits of what appears sharp through a camera.

    Parameters
    ----------
    layout : UILayout
        Where.
    context : Context
        Its scene has the film's format and the units.
    item : Object or None
        The camera.
    """
    scene = context.scene
    if item is None or item.type != "CAMERA":
        return
    try:
        camera = item.evaluated_get(context.evaluated_depsgraph_get())
        scene_lens = adapter.scene_lens(camera)
    except PotmesilError as error:
        sentence(layout, context, str(error), "ERROR")
        return
    sharp = depth_of_field(scene_lens)
    column = layout.column(align=True)
    rows = [
        (n_("Near Limit"), sharp.near),
        (n_("Far Limit"), sharp.far),
        (n_("Hyperfocal"), sharp.hyperfocal),
    ]
    if camera.data.dof.focus_object is not None:
        rows.insert(0, (n_("Focused At"), scene_lens.focus_distance))
    for name, value in rows:
        split = column.split(factor=0.4)
        left = split.row()
        left.alignment = "RIGHT"
        left.label(text=name)
        split.label(text=adapter.as_length(scene, value))
    if scene.unit_settings.scale_length != 1.0:
        column.label(text="The Lens Takes One Unit for One Metre", icon="INFO")


def sentence(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "BLANK1") -> None:
    """Draw a sentence, in the artist's language, over as many labels as the region's width needs."""
    scale = context.preferences.system.ui_scale
    width = max(20, int(context.region.width / (_LABEL_WIDTH * scale)) - 8)
    column = layout.column(align=True)
    line = ""
    lines = []
    for word in iface_(text).split():
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}" if line else word
    lines.append(line)
    for number, part in enumerate(lines):
        column.label(text=part, icon=icon if number == 0 else "BLANK1")
