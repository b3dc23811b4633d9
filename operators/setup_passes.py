"""Set Up Passes: what the processors need from a render, switched on for good."""

from __future__ import annotations

from typing import Any

import bpy

from .scene import rendered_objects

_LARGEST_INDEX = 32767


class POTMESIL_OT_setup_passes(bpy.types.Operator):
    """Enable the passes that depth of field and motion blur are made from"""

    bl_idname = "potmesil.setup_passes"
    bl_label = "Set Up Passes"
    bl_options = {"REGISTER", "UNDO"}

    assign_indices: bpy.props.BoolProperty(
        name="Object Indices",
        description="Give every object a pass index of its own; indices that are unique already stay",
        default=True,
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Switch on the passes and number the objects."""
        scene = context.scene
        for layer in scene.view_layers:
            layer.use_pass_combined = True
            layer.use_pass_z = True
            layer.use_pass_vector = True
            layer.use_pass_object_index = True
        if self.assign_indices:
            changed = assign_indices(scene)
            self.report({"INFO"}, f"Passes enabled, {changed} objects given an index of their own")
        else:
            self.report({"INFO"}, "Passes enabled")
        return {"FINISHED"}


def assign_indices(scene: bpy.types.Scene) -> int:
    """Give every rendered object of a scene a pass index of its own.

    Indices that one object alone has are kept; objects linked from another file cannot be changed.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    int
        Number of objects that were given a new index.
    """
    rendered: list[Any] = rendered_objects(scene)
    taken: set[int] = set()
    unnumbered = []
    for item in rendered:
        if item.library is not None or (item.pass_index and item.pass_index not in taken):
            taken.add(item.pass_index)
        else:
            unnumbered.append(item)
    free = (index for index in range(1, _LARGEST_INDEX + 1) if index not in taken)
    changed = 0
    for item, index in zip(unnumbered, free, strict=False):
        item.pass_index = index
        changed += 1
    return changed
