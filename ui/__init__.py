"""Panels and properties: what the artist sees and what is saved with the scene."""

from __future__ import annotations

import bpy

from . import panels, presets, properties

CLASSES = (
    properties.PotmesilSceneSettings,
    properties.PotmesilCollectionSettings,
    properties.PotmesilState,
    *presets.CLASSES,
    *panels.CLASSES,
)


def register() -> None:
    """Register properties and panels."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    presets.register()
    bpy.types.Scene.potmesil_camera = bpy.props.PointerProperty(type=properties.PotmesilSceneSettings)
    bpy.types.Collection.potmesil_camera = bpy.props.PointerProperty(
        type=properties.PotmesilCollectionSettings
    )
    bpy.types.WindowManager.potmesil_camera = bpy.props.PointerProperty(type=properties.PotmesilState)


def unregister() -> None:
    """Unregister panels and properties."""
    del bpy.types.WindowManager.potmesil_camera
    del bpy.types.Collection.potmesil_camera
    del bpy.types.Scene.potmesil_camera
    presets.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
