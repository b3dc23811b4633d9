"""Where Blender's versions differ: the one module that knows, by asking for what is there."""

from __future__ import annotations

from typing import Any

import bpy

from .borrow import Borrowed


def borrow_multilayer_exr(borrowed: Borrowed, scene: bpy.types.Scene) -> None:
    """Make the scene's output a float multilayer EXR, until the borrowed settings are given back.

    Parameters
    ----------
    borrowed : Borrowed
        Remembers what the settings were.
    scene : Scene
        The scene.
    """
    image = scene.render.image_settings
    values: dict[str, Any] = {
        "file_format": "OPEN_EXR_MULTILAYER",
        "color_mode": "RGBA",
        "color_depth": "32",
        # The samples file is written once more with its attributes and is compressed then.
        "exr_codec": "NONE",
        "color_management": "FOLLOW_SCENE",
    }
    # Blender 5.0 added the medium, which limits the formats and so comes first.
    if hasattr(image, "media_type"):
        values = {"media_type": "MULTI_LAYER_IMAGE", **values}
    # Blender 5.0 cannot write several parts with pixels that are not square.
    if hasattr(image, "use_exr_interleave") and scene.render.pixel_aspect_x != scene.render.pixel_aspect_y:
        values["use_exr_interleave"] = True
    borrowed.set_all(image, values)


def cycles_settings(scene: bpy.types.Scene) -> Any:
    """Return the scene's Cycles settings, or None where Blender is built without Cycles."""
    return getattr(scene, "cycles", None)


def view_layer_denoises(view_layer: bpy.types.ViewLayer) -> bool:
    """Return whether Cycles denoises a view layer, as far as the layer itself decides it."""
    cycles = getattr(view_layer, "cycles", None)
    return bool(getattr(cycles, "use_denoising", True))
