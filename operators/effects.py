"""From the scene's special effects to plain values in the core's units."""

from __future__ import annotations

from dataclasses import Field, fields
from typing import Any

import bpy

from ..potmesil_addon.effects import KINDS, UNITS, Distortion

CLIP_COEFFICIENTS: dict[str, dict[str, str]] = {
    "brown": {
        "k1": "brown_k1",
        "k2": "brown_k2",
        "k3": "brown_k3",
        "k4": "brown_k4",
        "p1": "brown_p1",
        "p2": "brown_p2",
    },
    "polynomial": {"k1": "k1", "k2": "k2", "k3": "k3"},
    "division": {"k1": "division_k1", "k2": "division_k2"},
    "nuke": {"k1": "nuke_k1", "k2": "nuke_k2"},
}
"""The fields of `effects.Distortion` that each model has, and what a movie clip's camera calls them."""


def scene_effects(scene: bpy.types.Scene) -> dict[str, dict[str, Any] | None]:
    """Return the special effects of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    dict
        For `effects.effects_from_json`: for each effect its fields in metres and radians, ``None`` for one
        that is off. Paths are absolute.
    """
    own = scene.potmesil_camera.effects
    found: dict[str, dict[str, Any] | None] = {}
    for name, kind in KINDS.items():
        group = getattr(own, name)
        found[name] = _values(group, kind) if group.use else None
    if found["distortion"] is not None and own.distortion.clip is not None:
        found["distortion"] = clip_distortion(own.distortion.clip)
    return found


def clip_distortion(clip: bpy.types.MovieClip) -> dict[str, Any]:
    """Return the distortion of the camera that a movie clip was solved with.

    Parameters
    ----------
    clip : MovieClip
        The clip.

    Returns
    -------
    dict
        The fields of `effects.Distortion`; 0 for coefficients that the clip's model has not.
    """
    camera = clip.tracking.camera
    model = camera.distortion_model.lower()
    names = CLIP_COEFFICIENTS[model]
    coefficients = {
        item.name: float(getattr(camera, names[item.name])) if item.name in names else 0.0
        for item in fields(Distortion)
        if item.name != "model"
    }
    return {"model": model, **coefficients}


def panel_unit(item: Field[Any]) -> float:
    """Return what one of the panel's units of a field is in the core's: Blender keeps angles in radians."""
    unit = item.metadata["unit"]
    return 1.0 if unit == "deg" else UNITS[unit]


def _values(group: bpy.types.PropertyGroup, kind: type[Any]) -> dict[str, Any]:
    return {item.name: _value(getattr(group, item.name), item) for item in fields(kind)}


def _value(value: Any, item: Field[Any]) -> Any:
    about = item.metadata
    if "path" in about:
        return bpy.path.abspath(value) if value else ""
    if "color" in about:
        return [float(part) for part in value]
    if "least" not in about or isinstance(value, int):
        return value
    # Blender's own limits are floats, which may be greater than the same limits as the core has them.
    return min(max(value * panel_unit(item), about["least"]), about["most"])
