"""Panels and properties: what the artist sees and what is saved with the scene."""

from __future__ import annotations

import bpy

from . import (
    camera_tab,
    effects_panels,
    effects_properties,
    inspect_panel,
    output_tab,
    presets,
    properties,
    render_tab,
    sidebars,
    translations,
    viewport,
)

_CHECKS = (camera_tab.POTMESIL_PT_camera_check, render_tab.POTMESIL_PT_render_check)
"""What stands below all other panels of its tab."""

CLASSES = (
    *effects_properties.CLASSES,
    properties.PotmesilSceneSettings,
    properties.PotmesilCollectionSettings,
    properties.PotmesilObjectSettings,
    properties.PotmesilState,
    *presets.CLASSES,
    *(cls for cls in (*camera_tab.CLASSES, *render_tab.CLASSES) if cls not in _CHECKS),
    *effects_panels.CLASSES,
    *_CHECKS,
    *output_tab.CLASSES,
    *sidebars.CLASSES,
    *inspect_panel.CLASSES,
    *viewport.CLASSES,
)


def register() -> None:
    """Register translations, properties and panels."""
    translations.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    presets.register()
    bpy.types.Scene.potmesil_camera = bpy.props.PointerProperty(type=properties.PotmesilSceneSettings)
    bpy.types.Collection.potmesil_camera = bpy.props.PointerProperty(
        type=properties.PotmesilCollectionSettings
    )
    bpy.types.Object.potmesil_camera = bpy.props.PointerProperty(
        type=properties.PotmesilObjectSettings, override={"LIBRARY_OVERRIDABLE"}
    )
    bpy.types.WindowManager.potmesil_camera = bpy.props.PointerProperty(type=properties.PotmesilState)
    viewport.register()


def unregister() -> None:
    """Unregister panels, properties and translations."""
    viewport.unregister()
    del bpy.types.WindowManager.potmesil_camera
    del bpy.types.Object.potmesil_camera
    del bpy.types.Collection.potmesil_camera
    del bpy.types.Scene.potmesil_camera
    presets.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    translations.unregister()
