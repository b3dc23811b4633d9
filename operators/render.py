"""Render: the passes of one frame into a samples file, and the processors on it."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .composite import refuse_unready
from .export import export_samples, render_samples, samples_path
from .job import render_as_job
from .process import picture_steps
from .stage import stage_scene
from .work import SteppedOperator

_RENDER_SHARE = 0.6
"""Share of the progress bar for the export; how far a render of it is, Blender does not tell."""


class POTMESIL_OT_render(SteppedOperator, bpy.types.Operator):
    """Render the current frame without blur, save its samples, and focus them"""

    bl_idname = "potmesil.render"
    bl_label = "Render"
    bl_options = {"REGISTER", "UNDO"}

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Render, save the samples, process them, composite them where there is a stage."""
        scene = context.scene
        path = samples_path(scene)
        if stage_scene(scene) is not None:
            refuse_unready(scene)
        if interactive:
            for done in export_samples(scene, path, lambda wanted: render_as_job(self, wanted)):
                yield _RENDER_SHARE * done
        else:
            render_samples(context, path)
        for done in picture_steps(context, path, self if interactive else None):
            yield _RENDER_SHARE + (1.0 - _RENDER_SHARE) * done
