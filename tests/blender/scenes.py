"""Small things to put into a scene."""

from __future__ import annotations

from typing import Any

import bpy


def card(scene: Any, name: str, center: tuple[float, float, float], size: float, material: Any) -> Any:
    """Add a square that faces the camera, its middle at a place."""
    h = 0.5 * size
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-h, 0, -h), (h, 0, -h), (h, 0, h), (-h, 0, h)], [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    item.location = center
    scene.collection.objects.link(item)
    return item


def dump(data: Any, depth: int = 3) -> dict[str, Any]:
    """Return every readable setting of Blender data, to compare before and after."""
    values: dict[str, Any] = {}
    for prop in data.bl_rna.properties:
        name = prop.identifier
        if name == "rna_type":
            continue
        value = getattr(data, name)
        if prop.type == "POINTER":
            if depth and value is not None and not isinstance(value, bpy.types.ID):
                values[name] = dump(value, depth - 1)
            else:
                values[name] = getattr(value, "name_full", value)
        elif prop.type == "COLLECTION":
            values[name] = [
                dump(item, depth - 1) if depth and not isinstance(item, bpy.types.ID) else item.name_full
                for item in value
                if hasattr(item, "bl_rna")
            ]
        else:
            values[name] = list(value) if getattr(prop, "is_array", False) else value
    return values
