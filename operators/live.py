"""Live Focus: the result follows focus, aperture and shutter while they change, made by processes of its own.

Blender's window is never waited for and never waits: workers beside it compute, and a timer looks now and
then at what changed and at what they have finished.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess
import tempfile
import time
from dataclasses import fields
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..potmesil_addon import beside
from ..potmesil_addon.effects import KINDS
from ..potmesil_addon.errors import InputError, PotmesilError
from .animation import curves_of
from .export import samples_path
from .kernels import cache_folder
from .process import settings_values
from .result import RESULT_NAME, is_ours, show_result, shows_result, store_resized
from .work import redraw_panels

_TICK = 0.01
_REST = 0.3
"""Seconds without a change after which the whole picture is made."""

_SIGN_OF_LIFE = 1.0
_MOST_STARTS = 3
"""Times that a worker is started before it counts as broken."""

_LAST_WAIT = 300.0
"""Seconds that the whole picture may take after the artist has confirmed."""

_NOTE = 4.0
"""Seconds for which a note on what the mouse did stays."""

_FOLDER_PREFIX = "potmesil_live_"
_ABANDONED = 86400.0
"""Seconds without a sign of life after which a folder is of a Blender and workers that were all killed."""

_REQUESTS, _REPLIES = "requests.jsonl", "replies.jsonl"

_NOTHING_THERE = n_("There is nothing at this place to focus on.")
_HELP = n_("Live Focus: Drag in the Image to Focus, Enter to Confirm, Esc to Cancel")

_CAMERA_SETTINGS = ("lens",)
_DOF_SETTINGS = (
    "focus_object",
    "focus_subtarget",
    "focus_distance",
    "aperture_fstop",
    "aperture_blades",
    "aperture_rotation",
    "aperture_ratio",
)
_RENDER_SETTINGS = ("motion_blur_shutter", "motion_blur_position")
_OWN_SETTINGS = (
    "use_lens",
    "coc_model",
    "psf",
    "visibility",
    "reflections",
    "uniform_defocus",
    "fade",
    "use_motion",
    "motion_model",
    "shutter_kind",
    "slit_edge",
    "slit_width",
    "blade_time",
    "exposure_count",
    "exposure_duration",
    "exposure_spacing",
    "gate_angle",
    "use_flash",
    "flash_curtain",
    "flash_share",
    "flash_duration",
    "flash_count",
)
_EFFECT_SETTINGS = {
    f"potmesil_camera.effects.{name}": ("use", *(item.name for item in fields(kind)))
    for name, kind in KINDS.items()
}
_EFFECT_SETTINGS["potmesil_camera.effects.distortion"] += ("clip",)

_POINTERS = {"focus_object": "objects", "clip": "movieclips"}
"""Settings that point to data of Blender's, and where that is."""


class _Worker:
    """A process that computes, and the two files by which we talk to it."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._rest = b""
        self._heard = 0.0
        self._starts = 0
        self.waiting: int | None = None
        """Number of the request that it works on."""

    def send(self, message: dict[str, Any]) -> None:
        """Ask for something; what was asked before is given up.

        Raises
        ------
        InputError
            If no worker can be started.
        """
        if self._process is None or self._process.poll() is not None:
            self._start()
        self._write(message)
        self.waiting = message["id"] if message["kind"] != "stop" else None

    def replies(self) -> list[dict[str, Any]]:
        """Return what it said since the last call, and tell it that we are there."""
        if self._process is None or self._folder is None:
            return []
        now = time.monotonic()
        if now - self._heard > _SIGN_OF_LIFE:
            self._write(None)
        if self._process.poll() is not None and self.waiting is not None:
            # It is started again with the next request.
            self.waiting = None
            return [{"gone": True}]
        *lines, self._rest = (self._rest + (self._incoming.read() or b"")).split(b"\n")
        found = [json.loads(line) for line in lines if line]
        for reply in found:
            if reply.get("id") == self.waiting:
                self.waiting = None
        return found

    def array(self, name: str, shape: list[int]) -> np.ndarray[Any, np.dtype[np.float32]]:
        """Return a picture that it has written."""
        assert self._folder is not None
        return np.fromfile(self._folder / name, dtype=np.float32).reshape(shape)

    def mapped(self, name: str, shape: list[int]) -> np.ndarray[Any, np.dtype[np.float32]]:
        """Return an array that it has written and that stays on disk."""
        assert self._folder is not None
        return np.memmap(self._folder / name, dtype=np.float32, mode="r", shape=tuple(shape))

    def close(self) -> None:
        """End the process and remove its files."""
        process, self._process = self._process, None
        if process is not None:
            # Nothing of it is kept, so that there is nothing to wait for.
            process.kill()
            process.wait()
            self._incoming.close()
            self._outgoing.close()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
        self._folder, self.waiting, self._rest = None, None, b""

    def _write(self, message: dict[str, Any] | None) -> None:
        line = b"" if message is None else json.dumps(message).encode()
        self._outgoing.write(line + b"\n")
        self._heard = time.monotonic()

    def _start(self) -> None:
        self.close()
        if self._starts >= _MOST_STARTS:
            raise InputError("Live Focus does not start on this computer; use Process instead.")
        self._starts += 1
        _remove_abandoned()
        self._folder = folder = Path(tempfile.mkdtemp(prefix=_FOLDER_PREFIX))
        for name in (_REQUESTS, _REPLIES):
            (folder / name).touch()
        self._outgoing = (folder / _REQUESTS).open("ab", buffering=0)
        self._incoming = (folder / _REPLIES).open("rb", buffering=0)
        try:
            with (folder / "log.txt").open("wb") as log:
                self._process = beside.start("worker", [str(folder), str(cache_folder())], log)
        except OSError as error:
            text = rpt_("Live Focus does not start: {reason}; use Process instead.")
            raise InputError(text.format(reason=error)) from error


def _remove_abandoned() -> None:
    """Remove the folders of those who were killed before they could do it themselves."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_FOLDER_PREFIX}*"):
        with contextlib.suppress(OSError):
            # It grows each second while someone is there.
            if time.time() - (folder / _REQUESTS).stat().st_mtime > _ABANDONED:
                shutil.rmtree(folder, ignore_errors=True)


def _values_of(owner: Any, names: tuple[str, ...]) -> dict[str, Any]:
    """Return what settings are, in a form that no later change of them reaches."""
    values = {name: getattr(owner, name) for name in names}
    for name, value in values.items():
        if name in _POINTERS:
            # Undo and redo make new objects, and the old ones are gone.
            values[name] = value and value.name_full
        elif not isinstance(value, bool | int | float | str):
            values[name] = tuple(value)
    return values


class _Session:
    """Live Focus in one window, from the button to its end."""

    def __init__(self, context: bpy.types.Context) -> None:
        self._window = context.window.as_pointer()
        self._preview, self._whole = _Worker(), _Worker()
        self._before: dict[tuple[str, str, str], dict[str, Any]] = {}
        self._frames: dict[tuple[str, str], tuple[str, int]] = {}
        self._key = ""
        self._request: dict[str, Any] = {}
        self._changed = time.monotonic()
        self._number = 0
        self._asked = self._shown = self._finished = ""
        self._sent = {"preview": "", "full": ""}
        self._failed = ""
        self._result: np.ndarray[Any, np.dtype[np.float32]] | None = None
        self._depth: tuple[str, np.ndarray[Any, np.dtype[np.float32]]] | None = None
        self._seen_result = False
        self.confirmed: float | None = None
        self.dragging = False
        self.updates = 0
        self.tier: list[Any] = []
        self.compiled: dict[str, list[str]] = {"preview": [], "full": []}
        self._note_until = 0.0
        self.longest_tick = 0.0
        self._remember(context.scene)
        self._keep_result()

    # What the artist may change, and gets back.

    def _remember(self, scene: bpy.types.Scene) -> None:
        """Note what the settings of a scene and its camera are, the first time that they are seen."""
        now = scene.name_full, scene.frame_current
        if ("scene", scene.name_full, "render") not in self._before:
            self._frames["scene", scene.name_full] = now
            settings = {"render": _RENDER_SETTINGS, "potmesil_camera": _OWN_SETTINGS, **_EFFECT_SETTINGS}
            for part, names in settings.items():
                self._before["scene", scene.name_full, part] = _values_of(scene.path_resolve(part), names)
        camera = scene.camera
        if camera is None or camera.type != "CAMERA":
            return
        data = camera.data
        if ("camera", data.name_full, "dof") not in self._before:
            self._frames["camera", data.name_full] = now
            self._before["camera", data.name_full, ""] = {n: getattr(data, n) for n in _CAMERA_SETTINGS}
            self._before["camera", data.name_full, "dof"] = _values_of(data.dof, _DOF_SETTINGS)

    def restore(self) -> bool:
        """Put back every setting that was changed; return whether there was any."""
        changed = False
        for (kind, full_name, part), values in self._before.items():
            found = bpy.data.scenes if kind == "scene" else bpy.data.cameras
            data = next((item for item in found if item.name_full == full_name), None)
            if data is None:
                continue
            owner = data.path_resolve(part) if part else data
            scene_name, frame = self._frames[kind, full_name]
            scene = next((item for item in bpy.data.scenes if item.name_full == scene_name), None)
            elsewhere = scene is None or scene.frame_current != frame
            for name, before in values.items():
                value = before
                if name in _POINTERS:
                    there = getattr(bpy.data, _POINTERS[name])
                    value = next((item for item in there if item.name_full == before), None)
                # At another frame what is animated is right as it is.
                if elsewhere and any(curves_of(owner, name)):
                    continue
                now = getattr(owner, name)
                if (tuple(now) if isinstance(value, tuple) else now) != value:
                    with contextlib.suppress(AttributeError):  # linked data cannot be changed
                        setattr(owner, name, value)
                        changed = True
        if self._result is not None:
            store_resized(self._result)
        return changed

    def _keep_result(self) -> None:
        image = bpy.data.images.get(RESULT_NAME)
        if image is not None and image.has_data and is_ours(image):
            columns, rows = image.size
            values = np.empty(rows * columns * 4, dtype=np.float32)
            image.pixels.foreach_get(values)
            self._result = values.reshape(rows, columns, 4)[::-1]

    # Each tick.

    def tick(self) -> bool:
        """Look at what changed and what is finished; return whether to go on."""
        manager = bpy.context.window_manager
        window = next((w for w in manager.windows if w.as_pointer() == self._window), None)
        if window is None:
            return False
        state = manager.potmesil_camera
        if self._note_until and time.monotonic() >= self._note_until:
            self._note(state, "")
        self._receive(state)
        if rendering(state):
            # The samples are about to be replaced.
            return True
        with bpy.context.temp_override(window=window):
            if self.confirmed is None:
                try:
                    self._look(bpy.context)
                except PotmesilError as error:
                    self._say(state, str(error))
                    return True
            self._ask()
        if self.confirmed is None:
            return True
        ended = self._finished == self._key or not self._key or self._failed == self._key
        return not ended and time.monotonic() - self.confirmed < _LAST_WAIT

    def _look(self, context: bpy.types.Context) -> None:
        """Note whether anything that the picture depends on has changed."""
        scene = context.scene
        self._remember(scene)
        path = samples_path(scene)
        try:
            status = path.stat()
        except OSError:
            self._key = ""
            frame = scene.frame_current
            text = rpt_("Frame {frame} has no samples yet; press Render to make them.")
            raise InputError(text.format(frame=frame)) from None
        stamp = [status.st_mtime_ns, status.st_size]
        request = {"path": str(path), "stamp": stamp, "settings": settings_values(context)}
        key = json.dumps(request)
        if key != self._key:
            self._key, self._request, self._changed = key, request, time.monotonic()
            if self._whole.waiting is not None:
                self._whole.send({"kind": "stop", "id": 0})

    def _ask(self) -> None:
        """Ask for a preview of what changed, and for the whole picture when the hand rests."""
        if not self._key or self._failed == self._key:
            return
        if self._preview.waiting is None and self._asked != self._key:
            self._send(self._preview, "preview")
            self._asked = self._key
        rested = time.monotonic() - self._changed > _REST and not self.dragging
        shown = self._shown == self._key or self.confirmed is not None
        if rested and shown and self._finished != self._key and self._whole.waiting is None:
            self._send(self._whole, "full")

    def _send(self, worker: _Worker, kind: str) -> None:
        self._number += 1
        self._sent[kind] = self._key
        worker.send({"kind": kind, "id": self._number, **self._request})

    def _receive(self, state: Any) -> None:
        """Take what the workers have finished."""
        for worker, kind in ((self._preview, "preview"), (self._whole, "full")):
            for reply in worker.replies():
                if "error" in reply:
                    self._failed = self._sent[kind]
                    self._say(state, reply["error"])
                elif "compiling" in reply:
                    self.compiled[kind].append(reply["compiling"])
                    self._say(state, "Compiling Kernels (Once)")
                elif "gone" in reply:
                    self._asked = self._shown = ""
                elif "depth" in reply:
                    self._depth = reply["path"], worker.mapped(reply["depth"], reply["shape"])
                elif "picture" in reply:
                    self._show(state, worker, reply, kind)

    def _show(self, state: Any, worker: _Worker, reply: dict[str, Any], kind: str) -> None:
        """Put a finished picture into the result, unless a better one is there already."""
        key = self._sent[kind]
        if kind == "full" and key != self._key:
            return  # something changed meanwhile, and a preview of that is shown
        if kind == "preview" and self._finished == key:
            return
        image = store_resized(worker.array(reply["picture"], reply["shape"]))
        if not self._seen_result:
            show_result(bpy.context, image)
            self._seen_result = True
        if kind == "full":
            self._finished = key
            quality = reply["quality"]
            state.guessed_pixels, state.expected_error = quality["guessed_pixels"], quality["predicted_error"]
        else:
            self._shown, self.tier = key, reply["tier"]
            self.updates += 1
        state.has_quality = kind == "full"
        self._say(state, "")
        _redraw(image)

    def _note(self, state: Any, text: str) -> None:
        """Say what the mouse did, for some seconds: the next picture comes before anybody has read it."""
        self._note_until = 0.0
        self._say(state, text)
        self._note_until = time.monotonic() + _NOTE if text else 0.0

    def _say(self, state: Any, text: str) -> None:
        if not text and time.monotonic() < self._note_until:
            return
        if state.live_message != text:
            state.live_message = text
            redraw_panels(bpy.context)

    # The mouse.

    def focus_at(self, context: bpy.types.Context, u: float, v: float) -> None:
        """Focus on what the result shows at a place, from 0 to 1 to the right and upwards."""
        state, scene = context.window_manager.potmesil_camera, context.scene
        if not (0.0 <= u < 1.0 and 0.0 < v <= 1.0) or scene.camera is None:
            return
        if self._depth is None or self._depth[0] != self._request.get("path"):
            return
        depth = self._depth[1]
        rows, columns = depth.shape
        distance = float(depth[min(rows - 1, int((1.0 - v) * rows)), min(columns - 1, int(u * columns))])
        dof = scene.camera.data.dof
        if not np.isfinite(distance):
            self._note(state, _NOTHING_THERE)
        elif any(curve.driver is not None for curve in curves_of(dof, "focus_distance")):
            self._note(state, "A driver sets the focus distance; remove it to focus by hand.")
        elif not scene.camera.data.is_editable:
            self._note(state, "The camera is linked from another file; make it local to focus by hand.")
        else:
            if dof.focus_object is not None:
                text = rpt_("{name} is no longer the focus object: the mouse sets the distance.")
                self._note(state, text.format(name=dof.focus_object.name))
                dof.focus_object = None
            elif state.live_message == _NOTHING_THERE:
                self._note(state, "")
            dof.focus_distance = distance

    def close(self) -> None:
        """End the workers."""
        self._depth = None  # a mapped file cannot be removed everywhere
        self._preview.close()
        self._whole.close()


_session: _Session | None = None


def session() -> _Session | None:
    """Return what is going on, for tests and panels; None while Live Focus is off."""
    return _session


def _tick() -> float | None:
    if _session is None:
        return None
    state = bpy.context.window_manager.potmesil_camera
    started, mine = time.perf_counter(), _session
    try:
        going_on = mine.tick()
    except PotmesilError as error:
        state.live_message = str(error)
        going_on = False
    except BaseException:
        shut_down()
        raise
    mine.longest_tick = max(mine.longest_tick, time.perf_counter() - started)
    if not going_on:
        message = state.live_message
        shut_down()
        state.live_message = message
        return None
    return _TICK


def _begin(context: bpy.types.Context) -> None:
    global _session  # noqa: PLW0603 - there is one Live Focus at a time
    shut_down()
    _session = _Session(context)
    state = context.window_manager.potmesil_camera
    state.live, state.live_message = True, n_("Starting")
    bpy.app.handlers.load_pre.append(_file_closes)
    bpy.app.timers.register(_tick, first_interval=_TICK)
    _status(context, iface_(_HELP))


def _end(context: bpy.types.Context, *, keep: bool) -> bool:
    """End Live Focus, with the present settings or those of before; return whether any was put back."""
    if _session is None:
        return False
    state = context.window_manager.potmesil_camera
    state.live = False
    _status(context, None)
    if keep:
        # The whole picture is still finished.
        _session.confirmed = time.monotonic()
        return False
    changed = _session.restore()
    shut_down()
    return changed


def shut_down() -> None:
    """Stop everything at once, as a file that closes or an extension that is switched off needs it."""
    global _session
    ended, _session = _session, None
    if ended is None:
        return
    ended.close()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    if _file_closes in bpy.app.handlers.load_pre:
        bpy.app.handlers.load_pre.remove(_file_closes)
    manager = bpy.context.window_manager
    if manager is not None and hasattr(manager, "potmesil_camera"):
        manager.potmesil_camera.live, manager.potmesil_camera.live_message = False, ""
    _status(bpy.context, None)
    redraw_panels(bpy.context)


@persistent
def _file_closes(*_: Any) -> None:
    shut_down()


def rendering(state: Any) -> bool:
    """Return whether Render or Process works, or Blender renders."""
    return bool(state.running or bpy.app.is_job_running("RENDER"))


def _status(context: bpy.types.Context, text: str | None) -> None:
    workspace = getattr(context, "workspace", None)
    if workspace is not None:
        workspace.status_text_set(text)


def _redraw(image: bpy.types.Image) -> None:
    """Draw the result again where it is shown, and nothing else: drawing is most of a preview's time."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type != "IMAGE_EDITOR" or area.spaces.active.image != image:
                continue
            for region in area.regions:
                if region.type == "WINDOW":
                    region.tag_redraw()


def _window_of_result(context: bpy.types.Context) -> bpy.types.Window:
    """Return the window that shows the result, or will: this one where it can, else that of renders."""
    windows = sorted(context.window_manager.windows, key=lambda window: window != context.window)
    for _ in range(2):
        for window in windows:
            if any(shows_result(area) for area in window.screen.areas):
                return window
        # Opened as the artist's preferences say, which may be nowhere.
        bpy.ops.render.view_show("INVOKE_DEFAULT")
        windows = list(context.window_manager.windows)
    return context.window


def _place(context: bpy.types.Context, event: bpy.types.Event) -> tuple[float, float] | None:
    """Return where in the result the mouse is, None where it is not over an Image Editor that shows it."""
    x, y = event.mouse_x, event.mouse_y
    for area in context.window.screen.areas:
        if area.type != "IMAGE_EDITOR" or getattr(area.spaces.active.image, "name", "") != RESULT_NAME:
            continue
        main = None
        for region in area.regions:
            inside = region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
            if inside and region.type == "WINDOW":
                main = region
            elif inside and region.width > 1 and region.height > 1:
                return None  # a header or a sidebar lies over the picture
        if main is not None:
            u, v = main.view2d.region_to_view(x - main.x, y - main.y)
            return float(u), float(v)
    return None


class POTMESIL_OT_live(bpy.types.Operator):
    """Let the result follow focus, aperture and shutter while they change; hold and drag in it to focus"""

    bl_idname = "potmesil.live"
    bl_label = "Live Focus"
    bl_options = {"REGISTER", "UNDO"}

    _mine: _Session | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Live Focus needs a window."""
        return context.window is not None and not bpy.app.background

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin, or end with the present settings where it is on."""
        del event
        if context.window_manager.potmesil_camera.live:
            _end(context, keep=True)
            return {"FINISHED"}
        # A modal operator hears of the mouse in its own window only.
        with context.temp_override(window=_window_of_result(context)):
            _begin(bpy.context)
            context.window_manager.modal_handler_add(self)
        self._mine = _session
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take the keys and the mouse over the result, and leave the rest to Blender."""
        mine = self._mine
        if mine is None or _session is not mine or mine.confirmed is not None:
            # It was ended from elsewhere, and the undo step is there.
            self._mine = None
            return {"CANCELLED", "PASS_THROUGH"}
        if rendering(context.window_manager.potmesil_camera):
            # Esc is for the render.
            mine.dragging = False
            return {"PASS_THROUGH"}
        if event.type == "MOUSEMOVE" and mine.dragging:
            place = _place(context, event)
            if place is not None:
                mine.focus_at(context, *place)
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and event.value == "RELEASE" and mine.dragging:
            mine.dragging = False
            return {"RUNNING_MODAL"}
        if event.type in ("LEFTMOUSE", "ESC", "RET", "NUMPAD_ENTER") and event.value == "PRESS":
            place = _place(context, event)
            # Over a panel these keys end the typing of a number.
            if place is None:
                return {"PASS_THROUGH"}
            if event.type == "LEFTMOUSE":
                mine.dragging = True
                mine.focus_at(context, *place)
                return {"RUNNING_MODAL"}
            keep = event.type != "ESC"
            changed = _end(context, keep=keep)
            self._mine = None
            return {"FINISHED"} if keep or changed else {"CANCELLED"}
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop; Blender calls this when it closes the window or the file."""
        del context
        mine, self._mine = self._mine, None
        if mine is not None and _session is mine:
            shut_down()


class POTMESIL_OT_end_live(bpy.types.Operator):
    """End Live Focus with the settings as they were when it began"""

    bl_idname = "potmesil.end_live"
    bl_label = "Cancel Live Focus"
    bl_options = {"INTERNAL", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """There is something to end only while it is on."""
        return bool(context.window_manager.potmesil_camera.live)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Put everything back."""
        return {"FINISHED"} if _end(context, keep=False) else {"CANCELLED"}
