"""Render: the passes of one frame into a samples file, and the processors on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

from ..potmesil_addon.errors import InputError
from .borrow import Borrowed
from .export import borrow_for_render, refuse_errors, render_samples, samples_path, save_samples
from .process import process_samples
from .work import CancelledError, SteppedOperator

_RENDER_SHARE = 0.6
"""Share of the progress bar for Blender's render; how far it is, Blender does not tell."""


class POTMESIL_OT_render(SteppedOperator, bpy.types.Operator):
    """Render the current frame without blur, save its samples, and focus them"""

    bl_idname = "potmesil.render"
    bl_label = "Render"
    bl_options = {"REGISTER", "UNDO"}

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Render, save the samples, process them."""
        path = samples_path(context.scene)
        if interactive:
            yield from self._render_as_job(context, path)
        else:
            render_samples(context, path)
        for done in process_samples(context, path):
            yield _RENDER_SHARE + (1.0 - _RENDER_SHARE) * done

    def _render_as_job(self, context: bpy.types.Context, path: Path) -> Iterator[float]:
        """Render as Blender's own job, with its window, its progress and its ESC, and save the samples."""
        scene = context.scene
        refuse_errors(scene)
        ended: list[str] = []

        # Blender calls handlers from the render's thread: only note what happened.
        def complete(*_: Any) -> None:
            ended.append("complete")

        def cancelled(*_: Any) -> None:
            ended.append("cancel")

        with Borrowed() as borrowed, _Handlers(complete, cancelled):
            borrow_for_render(borrowed, scene)
            bpy.ops.render.render("INVOKE_DEFAULT", scene=scene.name)
            if not ended and not bpy.app.is_job_running("RENDER"):
                raise InputError("Blender did not start the render; end other renders and try again.")
            while not ended or bpy.app.is_job_running("RENDER"):
                yield 0.0
            # Blender tells the handlers of a render that ESC ended that it is complete.
            if self.escaped or "cancel" in ended:
                raise CancelledError
            save_samples(scene, context.evaluated_depsgraph_get(), path)
        yield _RENDER_SHARE


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
