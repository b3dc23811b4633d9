"""The scene's lamps as points, for shadows that go with what casts them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

if TYPE_CHECKING:
    from ..potmesil_addon.lamps import Lamp


def lamps_of(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[Lamp, ...]:
    """Return the lamps that shine at the current frame, those of instances too.

    Surfaces that give off light are not listed.

    Parameters
    ----------
    scene : Scene
        The scene.
    depsgraph : Depsgraph
        The scene, evaluated.

    Returns
    -------
    tuple of Lamp
        A point, spot or area lamp at its middle; a sun as the direction towards it.
    """
    from ..potmesil_addon.lamps import Lamp  # noqa: PLC0415 - see kernels

    rendered = {item.name_full for item in scene.objects if not item.hide_render}
    lamps = []
    for instance in depsgraph.object_instances:
        item = instance.object
        owner = instance.parent if instance.is_instance else item
        if item.type != "LIGHT" or owner.original.name_full not in rendered:
            continue
        if item.data.energy == 0.0 or not any(item.data.color):
            continue
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        # A lamp shines along its own -z.
        towards = matrix[:3, 2] / max(float(np.linalg.norm(matrix[:3, 2])), 1e-30)
        place = (*towards, 0.0) if item.data.type == "SUN" else (*matrix[:3, 3], 1.0)
        lamps.append(Lamp(np.array(place)))
    return tuple(lamps)
