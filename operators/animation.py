"""The curves and drivers that animate a property, wherever a Blender version keeps them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import bpy


def curves_of(owner: Any, name: str) -> Iterator[bpy.types.FCurve]:
    """Find what animates a property.

    Parameters
    ----------
    owner : bpy_struct
        Blender data that has the property.
    name : str
        The property's name.

    Yields
    ------
    FCurve
        Keyed curves and drivers.
    """
    animation = getattr(owner.id_data, "animation_data", None)
    if animation is None:
        return
    try:
        path = owner.path_from_id(name)
    except ValueError:  # data that has no path cannot be animated either
        return
    for curve in (*_keyed(animation), *animation.drivers):
        if curve.data_path == path:
            yield curve


def _keyed(animation: bpy.types.AnimData) -> Iterator[bpy.types.FCurve]:
    action = animation.action
    if action is None:
        return
    # Blender 5.0 left only the curves of layers and slots, which 4.5 has too.
    for layer in action.layers:
        for strip in layer.strips:
            bag = strip.channelbag(animation.action_slot) if animation.action_slot else None
            if bag is not None:
                yield from bag.fcurves
