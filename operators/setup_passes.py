"""Set Up Passes: what the processors need from a render, switched on for good."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.translations import pgettext_rpt as rpt_

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
        if self.assign_indices:
            changed = set_up_passes(context.scene)
            text = rpt_("Passes enabled, {count} objects given an index of their own")
            self.report({"INFO"}, text.format(count=changed))
        else:
            enable_passes(context.scene)
            self.report({"INFO"}, "Passes enabled")
        return {"FINISHED"}


def set_up_passes(scene: bpy.types.Scene) -> int:
    """Switch on the passes and number the objects; return how many were given a new index."""
    enable_passes(scene)
    return assign_indices(scene)


def enable_passes(scene: bpy.types.Scene) -> None:
    """Switch on the passes that a samples file needs."""
    for layer in scene.view_layers:
        layer.use_pass_combined = True
        layer.use_pass_z = True
        layer.use_pass_vector = True
        layer.use_pass_object_index = True


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
