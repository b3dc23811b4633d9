"""Blender's own preset menus for camera, shutter, lens and filters, and the presets that come along.

A preset of ours is a file as Blender's menu writes it; see the folder ``presets``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ..potmesil_addon.effects import KINDS

_FOLDER = str(Path(__file__).absolute().parents[1])
"""What holds ``presets``, for Blender to look in beside the artist's own."""

_CAMERA = 'camera = getattr(bpy.context, "camera", None) or bpy.context.scene.camera.data'

_EFFECTS = "effects = bpy.context.scene.potmesil_camera.effects"

_LENS_EFFECTS = ("pupil", "focal_surface", "chromatic", "vignetting", "distortion")
"""The effects that a lens has by itself."""


def _values_of(names: tuple[str, ...]) -> Iterator[str]:
    """Yield the settings of effects; a clip is left out, as it is one file's own."""
    for name in names:
        for field in ("use", *(item.name for item in fields(KINDS[name]))):
            yield f"effects.{name}.{field}"


class POTMESIL_PT_camera_presets(PresetPanel, bpy.types.Panel):
    """The menu of films, lenses and irises."""

    bl_label = "Lens and Film Presets"
    preset_subdir = "potmesil_camera"
    preset_operator = "script.execute_preset"
    preset_add_operator = "potmesil.add_camera_preset"


class POTMESIL_OT_add_camera_preset(AddPresetBase, bpy.types.Operator):
    """Add or remove a preset of lens, film and iris"""

    bl_idname = "potmesil.add_camera_preset"
    bl_label = "Add Lens and Film Preset"
    preset_menu = "POTMESIL_PT_camera_presets"
    preset_subdir = "potmesil_camera"
    preset_defines = (_CAMERA, "settings = bpy.context.scene.potmesil_camera")
    preset_values = (
        "camera.lens",
        "camera.sensor_fit",
        "camera.sensor_width",
        "camera.sensor_height",
        "camera.dof.aperture_fstop",
        "camera.dof.aperture_blades",
        "camera.dof.aperture_rotation",
        "camera.dof.aperture_ratio",
        "settings.coc_model",
    )


class POTMESIL_PT_shutter_presets(PresetPanel, bpy.types.Panel):
    """The menu of shutters."""

    bl_label = "Shutter Presets"
    preset_subdir = "potmesil_shutter"
    preset_operator = "script.execute_preset"
    preset_add_operator = "potmesil.add_shutter_preset"


class POTMESIL_OT_add_shutter_preset(AddPresetBase, bpy.types.Operator):
    """Add or remove a preset of the shutter"""

    bl_idname = "potmesil.add_shutter_preset"
    bl_label = "Add Shutter Preset"
    preset_menu = "POTMESIL_PT_shutter_presets"
    preset_subdir = "potmesil_shutter"
    preset_defines = (
        "render = bpy.context.scene.render",
        "settings = bpy.context.scene.potmesil_camera",
    )
    preset_values = (
        "render.motion_blur_shutter",
        "render.motion_blur_position",
        "settings.exposure_count",
        "settings.exposure_duration",
        "settings.exposure_spacing",
        "settings.shutter_kind",
        "settings.slit_edge",
        "settings.slit_width",
        "settings.blade_time",
        "settings.gate_angle",
        "settings.use_flash",
        "settings.flash_curtain",
        "settings.flash_share",
        "settings.flash_duration",
        "settings.flash_count",
    )


class POTMESIL_PT_lens_presets(PresetPanel, bpy.types.Panel):
    """The menu of lenses by their character."""

    bl_label = "Lens Presets"
    preset_subdir = "potmesil_lens"
    preset_operator = "script.execute_preset"
    preset_add_operator = "potmesil.add_lens_preset"


class POTMESIL_OT_add_lens_preset(AddPresetBase, bpy.types.Operator):
    """Add or remove a preset of the lens's character"""

    bl_idname = "potmesil.add_lens_preset"
    bl_label = "Add Lens Preset"
    preset_menu = "POTMESIL_PT_lens_presets"
    preset_subdir = "potmesil_lens"
    preset_defines = (_EFFECTS,)
    preset_values = tuple(_values_of(_LENS_EFFECTS))


class POTMESIL_PT_effects_presets(PresetPanel, bpy.types.Panel):
    """The menu of filters, films and sensors."""

    bl_label = "Filter and Film Presets"
    preset_subdir = "potmesil_effects"
    preset_operator = "script.execute_preset"
    preset_add_operator = "potmesil.add_effects_preset"


class POTMESIL_OT_add_effects_preset(AddPresetBase, bpy.types.Operator):
    """Add or remove a preset of filters, film and sensor"""

    bl_idname = "potmesil.add_effects_preset"
    bl_label = "Add Filter and Film Preset"
    preset_menu = "POTMESIL_PT_effects_presets"
    preset_subdir = "potmesil_effects"
    preset_defines = (_EFFECTS,)
    preset_values = tuple(_values_of(tuple(name for name in KINDS if name not in _LENS_EFFECTS)))


CLASSES = (
    POTMESIL_PT_camera_presets,
    POTMESIL_OT_add_camera_preset,
    POTMESIL_PT_shutter_presets,
    POTMESIL_OT_add_shutter_preset,
    POTMESIL_PT_lens_presets,
    POTMESIL_OT_add_lens_preset,
    POTMESIL_PT_effects_presets,
    POTMESIL_OT_add_effects_preset,
)


def register() -> None:
    """Let Blender find the presets."""
    bpy.utils.register_preset_path(_FOLDER)


def unregister() -> None:
    """Leave them out again; the artist's own stay on disk."""
    bpy.utils.unregister_preset_path(_FOLDER)
