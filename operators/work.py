"""Long work in slices: one generator, stepped by a modal operator or run to its end by `execute`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..potmesil_addon.errors import PotmesilError
from ..potmesil_addon.progress import TimeLeft, clock_text, progress_text

_SLICE_SECONDS = 0.05
_TIMER_SECONDS = 0.02

_LEFT_OVER_SECONDS = 0.2

_NOT_KNOWN = -1.0
"""The time left, as the panels' state has it, while nothing is known."""


class CancelledError(Exception):
    """The artist cancelled the render that the work waited for."""


@dataclass
class _Work:
    """Work that goes on beside the artist's.

    Parameters
    ----------
    steps : iterator of float
        Does it, yielding the share done.
    timer : Timer or None
        Calls for its slices.
    clock : TimeLeft or None
        How long it still takes, where that can be told.
    by_frames : bool
        Whether the pace is known only at the ends of frames.
    status : str
        What the status bar says.
    workspaces : set of str
        Whose status bars say something of ours: the artist may go from one to another.
    """

    steps: Iterator[float]
    timer: bpy.types.Timer | None = None
    clock: TimeLeft | None = None
    by_frames: bool = False
    status: str = ""
    workspaces: set[str] = field(default_factory=set)


_work: _Work | None = None

_left_over: set[str] = set()
"""Workspaces that the artist left, and whose status bars say something of ours."""


def doing(text: str, *, timed: bool = False) -> None:
    """Say what is being done from now on.

    Parameters
    ----------
    text : str
        For the panels and the status bar, such as ``Processing Frame 12``.
    timed : bool
        Whether all that comes goes on at one pace, so that the time left can be told.
    """
    state = _state()
    state.doing = text
    if _work is not None and not _work.by_frames:
        _work.clock = TimeLeft(time.perf_counter(), state.progress) if timed else None


def begin_frames(share: float = 0.0) -> None:
    """Tell the time left by whole frames from now on, as their parts go on at paces of their own.

    Parameters
    ----------
    share : float
        Share of the whole work that is done already.
    """
    if _work is not None:
        _work.by_frames = True
        _work.clock = TimeLeft(time.perf_counter(), share, least=0.0)


def frame_done(share: float) -> None:
    """Note that a frame has ended.

    Parameters
    ----------
    share : float
        Share of the whole work that is done.
    """
    if _work is not None and _work.by_frames and _work.clock is not None:
        _work.clock.update(time.perf_counter(), share)


def by_frames(steps: Iterator[float], start: float = 0.0) -> Iterator[float]:
    """Run work that yields at the ends of frames as the rest of some work, and time it.

    Parameters
    ----------
    steps : iterator of float
        Yields its share done.
    start : float
        Where it begins in the whole.

    Yields
    ------
    float
        Share of the whole done.
    """
    begin_frames(start)
    before = 0.0
    for share in steps:
        if share > before:
            frame_done(start + (1.0 - start) * share)
            before = share
        yield start + (1.0 - start) * share


class SteppedOperator:
    """Mixin for operators whose work is a generator of progress.

    A subclass has `steps`, which does the work and yields its share done. Closing the generator cancels
    it: what it holds is given back in its ``finally`` blocks.
    """

    escaped = False
    """Whether the artist pressed ESC while Blender rendered."""

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Do the work, yielding the share done from 0 to 1."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do all of the work at once, as scripts and background runs want it."""
        try:
            for _ in self.steps(context, interactive=False):
                pass
        except PotmesilError as error:
            return self._failed(error)
        finally:
            _state().doing = ""
        _state().error = ""
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the work and keep Blender responsive while it runs."""
        global _work  # noqa: PLW0603 - Blender forgets a modal operator whose class is unregistered
        del event
        if bpy.app.background:
            return self.execute(context)
        state = _state()
        if state.running or _work is not None:
            self.report({"WARNING"}, "Potmesil Camera is working already")
            return {"CANCELLED"}
        state.progress, state.seconds_left, state.doing = 0.0, _NOT_KNOWN, ""
        _work = _Work(self.steps(context, interactive=True))
        try:
            # A render that starts here has its event handler under ours, so that we see its ESC.
            next(_work.steps)
        except StopIteration:
            shut_down()
            return {"FINISHED"}
        except PotmesilError as error:
            shut_down()
            return self._failed(error)
        except BaseException:
            shut_down()
            raise
        state.running, state.error = True, ""
        manager = context.window_manager
        _work.timer = manager.event_timer_add(_TIMER_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        _show(context, _work)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Do a slice of the work at each tick of the timer; ESC cancels."""
        work = _work
        if work is None:
            return {"CANCELLED", "PASS_THROUGH"}
        if event.type == "ESC" and event.value == "PRESS":
            if bpy.app.is_job_running("RENDER"):
                self.escaped = True
                return {"PASS_THROUGH"}
            self.cancel(context)
            self.report({"INFO"}, "Cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        state = _state()
        until = time.perf_counter() + _SLICE_SECONDS
        try:
            while time.perf_counter() < until:
                before = state.progress
                state.progress = next(work.steps)
                if work.clock is not None and not work.by_frames:
                    work.clock.update(time.perf_counter(), state.progress)
                if state.progress == before:
                    break  # it waits for Blender
        except StopIteration:
            shut_down()
            return {"FINISHED"}
        except CancelledError:
            shut_down()
            return {"CANCELLED"}
        except PotmesilError as error:
            shut_down()
            return self._failed(error)
        except BaseException:
            shut_down()
            raise
        left = None if work.clock is None else work.clock.seconds(time.perf_counter())
        state.seconds_left = _NOT_KNOWN if left is None else left
        _show(context, work)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the work and give back what it holds; Blender also calls this when it closes a window."""
        del context
        shut_down()

    def _failed(self, error: PotmesilError) -> set[str]:
        _state().error = str(error)
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


def shut_down() -> None:
    """End the work, if there is any: give back what it holds, and clear the status bar."""
    global _work
    work, _work = _work, None
    if work is None:
        return
    try:
        work.steps.close()
    finally:
        if work.timer is not None:
            bpy.context.window_manager.event_timer_remove(work.timer)
        state = _state()
        state.running, state.doing, state.seconds_left = False, "", _NOT_KNOWN
        _left_over.update(work.workspaces)
        if _clear_left_over() and not bpy.app.timers.is_registered(_clear_left_over):
            bpy.app.timers.register(_clear_left_over, first_interval=_LEFT_OVER_SECONDS, persistent=True)
        redraw_panels(bpy.context)


def _show(context: bpy.types.Context, work: _Work) -> None:
    """Say in the status bar and in the panels how far the work is, where that has changed."""
    state = _state()
    text = iface_("Potmesil Camera: {progress}, Esc to Cancel")
    status = text.format(progress=progress_words(state))
    workspace = context.workspace
    if workspace is None or (status == work.status and workspace.name in work.workspaces):
        return
    work.status = status
    work.workspaces.add(workspace.name)
    _set_status(workspace.name, status)
    redraw_panels(context)


def progress_words(state: bpy.types.PropertyGroup) -> str:
    """Return what is being done and how far it is: ``Processing Frame 12, 48 %, 00:05 Remaining``."""
    return f"{state.doing or iface_('Working')}, {how_far(state)}"


def how_far(state: bpy.types.PropertyGroup) -> str:
    """Return how far the work is: ``48 %, 00:05 Remaining``."""
    done = progress_text(state.progress, None)
    if state.seconds_left < 0.0:
        return done
    return iface_("{done}, {time} Remaining").format(done=done, time=clock_text(state.seconds_left))


def _set_status(name: str, text: str | None) -> bool:
    """Set or clear what the status bar says in a workspace; return whether that is shown, or gone."""
    workspace: Any = bpy.data.workspaces.get(name)
    if workspace is None:
        return True
    # Blender tells the workspace of a window, and cannot be asked for another one.
    for window in bpy.context.window_manager.windows:
        if window.workspace == workspace:
            with bpy.context.temp_override(window=window):
                workspace.status_text_set(text)
            return True
    return False


def _clear_left_over() -> float | None:
    """Clear what we said in a workspace as soon as the artist comes back to it."""
    said = set() if _work is None else _work.workspaces
    _left_over.difference_update({name for name in _left_over - said if _set_status(name, None)} | said)
    return _LEFT_OVER_SECONDS if _left_over else None


def _state() -> Any:
    return bpy.context.window_manager.potmesil_camera


def redraw_panels(context: bpy.types.Context) -> None:
    """Draw again where our panels and results stand."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("PROPERTIES", "IMAGE_EDITOR", "NODE_EDITOR"):
                area.tag_redraw()
            elif area.type == "VIEW_3D":
                # The scene itself has not changed, and takes its time to draw.
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()
