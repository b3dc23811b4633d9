"""Blender's own render, run as its job from a modal operator of ours."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy

from ..potmesil_addon.errors import InputError
from .borrow import Borrowed
from .work import CancelledError, SteppedOperator


def render_as_job(
    operator: SteppedOperator, scene: bpy.types.Scene, *, animation: bool = False, locked: bool = False
) -> Iterator[float]:
    """Render as Blender's own job, with its window, its progress and its ESC.

    Of an animation, the share done is that of its frames.

    Parameters
    ----------
    operator : SteppedOperator
        Whose step this is.
    scene : Scene
        The scene.
    animation : bool
        Render all frames and write them, as Render Animation does.
    locked : bool
        Let Blender lock its interface if the scene asks for it. Nobody but Blender then sees its ESC.

    Yields
    ------
    float
        Share of the work done; how far the render of a frame is, Blender does not tell.

    Raises
    ------
    InputError
        If Blender does not start the render.
    CancelledError
        If the artist ended it.
    """
    ended: list[str] = []
    written: list[None] = []

    # Blender calls handlers from the render's thread: only note what happened.
    def complete(*_: Any) -> None:
        ended.append("complete")

    def cancelled(*_: Any) -> None:
        ended.append("cancel")

    def wrote(*_: Any) -> None:
        written.append(None)

    frames = len(range(scene.frame_start, scene.frame_end + 1, scene.frame_step)) if animation else 1
    with _Handlers(complete, cancelled, wrote), Borrowed() as borrowed:
        if not locked:
            borrowed.set(scene.render, "use_lock_interface", False)
        POTMESIL_OT_watch_render.escaped = False
        bpy.ops.render.render("INVOKE_DEFAULT", animation=animation, scene=scene.name)
        if not ended and not bpy.app.is_job_running("RENDER"):
            raise InputError("Blender did not start the render; end other renders and try again.")
        bpy.ops.potmesil.watch_render("INVOKE_DEFAULT")
        while not ended or bpy.app.is_job_running("RENDER"):
            yield min(len(written) / frames, 1.0) if animation else 0.0
    # Blender tells the handlers of a render that ESC ended that it is complete.
    if operator.escaped or POTMESIL_OT_watch_render.escaped or "cancel" in ended:
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

    def __init__(
        self, complete: Callable[..., None], cancelled: Callable[..., None], wrote: Callable[..., None]
    ) -> None:
        self._pairs = (
            (bpy.app.handlers.render_complete, complete),
            (bpy.app.handlers.render_cancel, cancelled),
            (bpy.app.handlers.render_write, wrote),
        )

    def __enter__(self) -> None:
        for handlers, function in self._pairs:
            handlers.append(function)

    def __exit__(self, *_: object) -> None:
        for handlers, function in self._pairs:
            if function in handlers:
                handlers.remove(function)
