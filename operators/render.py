"""Render: the passes of one frame into a samples file, and the processors on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy

from ..potmesil_addon.errors import InputError
from .export import export_samples, render_samples, samples_path
from .process import process_samples
from .work import CancelledError, SteppedOperator

_RENDER_SHARE = 0.6
"""Share of the progress bar for the export; how far a render of it is, Blender does not tell."""


class POTMESIL_OT_render(SteppedOperator, bpy.types.Operator):
    """Render the current frame without blur, save its samples, and focus them"""

    bl_idname = "potmesil.render"
    bl_label = "Render"
    bl_options = {"REGISTER", "UNDO"}

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Render, save the samples, process them."""
        path = samples_path(context.scene)
        if interactive:
            scene = context.scene
            for done in export_samples(scene, path, lambda: self._render_as_job(scene)):
                yield _RENDER_SHARE * done
        else:
            render_samples(context, path)
        for done in process_samples(context, path):
            yield _RENDER_SHARE + (1.0 - _RENDER_SHARE) * done

    def _render_as_job(self, scene: bpy.types.Scene) -> Iterator[float]:
        """Render as Blender's own job, with its window, its progress and its ESC."""
        ended: list[str] = []

        # Blender calls handlers from the render's thread: only note what happened.
        def complete(*_: Any) -> None:
            ended.append("complete")

        def cancelled(*_: Any) -> None:
            ended.append("cancel")

        with _Handlers(complete, cancelled):
            POTMESIL_OT_watch_render.escaped = False
            bpy.ops.render.render("INVOKE_DEFAULT", scene=scene.name)
            if not ended and not bpy.app.is_job_running("RENDER"):
                raise InputError("Blender did not start the render; end other renders and try again.")
            bpy.ops.potmesil.watch_render("INVOKE_DEFAULT")
            while not ended or bpy.app.is_job_running("RENDER"):
                yield 0.0
        # Blender tells the handlers of a render that ESC ended that it is complete.
        if self.escaped or POTMESIL_OT_watch_render.escaped or "cancel" in ended:
            raise CancelledError
        yield 1.0


class POTMESIL_OT_watch_render(bpy.types.Operator):
    """Notice that ESC ends a render, whose own operator tells nobody"""

    bl_idname = "potmesil.watch_render"
    bl_label = "Watch Render"
    bl_options = {"INTERNAL"}

    escaped = False
    """Whether ESC was pressed since the last render began."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Lie above the render's operator, which was started before, and so see its events first."""
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look for ESC, and leave every event to the others."""
        if event.type == "ESC" and event.value == "PRESS" and bpy.app.is_job_running("RENDER"):
            POTMESIL_OT_watch_render.escaped = True
        if not bpy.app.is_job_running("RENDER"):
            return {"FINISHED", "PASS_THROUGH"}
        return {"PASS_THROUGH"}


class _Handlers:
    """Render handlers for as long as a block runs."""

    def __init__(self, complete: Callable[..., None], cancelled: Callable[..., None]) -> None:
        self._pairs = (
            (bpy.app.handlers.render_complete, complete),
            (bpy.app.handlers.render_cancel, cancelled),
        )

    def __enter__(self) -> None:
        for handlers, function in self._pairs:
            handlers.append(function)

    def __exit__(self, *_: object) -> None:
        for handlers, function in self._pairs:
            if function in handlers:
                handlers.remove(function)
