"""Long work in slices: one generator, stepped by a modal operator or run to its end by `execute`."""

from __future__ import annotations

import time
from collections.abc import Iterator

import bpy

from ..potmesil_addon.errors import PotmesilError

_SLICE_SECONDS = 0.05
_TIMER_SECONDS = 0.02


class CancelledError(Exception):
    """The artist cancelled the render that the work waited for."""


class SteppedOperator:
    """Mixin for operators whose work is a generator of progress.

    A subclass has `steps`, which does the work and yields its share done. Closing the generator cancels
    it: what it holds is given back in its ``finally`` blocks.
    """

    escaped = False
    """Whether the artist pressed ESC while Blender rendered."""

    _timer: bpy.types.Timer | None = None
    _steps: Iterator[float] | None = None

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Do the work, yielding the share done from 0 to 1."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do all of the work at once, as scripts and background runs want it."""
        try:
            for _ in self.steps(context, interactive=False):
                pass
        except PotmesilError as error:
            return self._failed(context, error)
        _state(context).error = ""
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the work and keep Blender responsive while it runs."""
        del event
        if bpy.app.background:
            return self.execute(context)
        state = _state(context)
        if state.running:
            self.report({"WARNING"}, "Potmesil Camera is working already")
            return {"CANCELLED"}
        self._steps = self.steps(context, interactive=True)
        try:
            # A render that starts here has its event handler under ours, so that we see its ESC.
            next(self._steps)
        except PotmesilError as error:
            return self._failed(context, error)
        state.running, state.progress, state.error = True, 0.0, ""
        manager = context.window_manager
        self._timer = manager.event_timer_add(_TIMER_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Do a slice of the work at each tick of the timer; ESC cancels."""
        if event.type == "ESC" and event.value == "PRESS":
            if bpy.app.is_job_running("RENDER"):
                self.escaped = True
                return {"PASS_THROUGH"}
            self.cancel(context)
            self.report({"INFO"}, "Cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        assert self._steps is not None
        state = _state(context)
        until = time.perf_counter() + _SLICE_SECONDS
        try:
            while time.perf_counter() < until:
                before = state.progress
                state.progress = next(self._steps)
                if state.progress == before:
                    break  # it waits for Blender
        except StopIteration:
            self._end(context)
            return {"FINISHED"}
        except CancelledError:
            self._end(context)
            return {"CANCELLED"}
        except PotmesilError as error:
            self._end(context)
            return self._failed(context, error)
        except BaseException:
            self._end(context)
            raise
        redraw_panels(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the work and give back what it holds; Blender also calls this when it closes a window."""
        if self._steps is not None:
            self._steps.close()
        self._end(context)

    def _end(self, context: bpy.types.Context) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
        self._timer = self._steps = None
        _state(context).running = False
        redraw_panels(context)

    def _failed(self, context: bpy.types.Context, error: PotmesilError) -> set[str]:
        _state(context).error = str(error)
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


def _state(context: bpy.types.Context) -> bpy.types.PropertyGroup:
    return context.window_manager.potmesil_camera


def redraw_panels(context: bpy.types.Context) -> None:
    """Draw again where our panels and results stand."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("PROPERTIES", "IMAGE_EDITOR"):
                area.tag_redraw()
