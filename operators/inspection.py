"""Inspect Focus: what the lens does, drawn over the result; and the result beside the render before it."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.app.translations import pgettext_rpt as rpt_

from ..potmesil_addon import inspection
from ..potmesil_addon.errors import InputError, PotmesilError
from ..potmesil_addon.files import working_folder
from ..potmesil_addon.lens import depth_of_field
from . import inspection_draw, kernels, live
from .borrow import Borrowed
from .export import samples_path
from .process import settings_values
from .result import RESULT_NAME
from .work import redraw_panels

if TYPE_CHECKING:
    from ..potmesil_addon.focus import FocusSettings
    from ..potmesil_addon.inspection import Reading, View
    from ..potmesil_addon.samples import Float32Array

T = TypeVar("T")

_TICK = 0.04
_REST = 0.3
"""Seconds without a change after which all is worked out as finely as it can be."""

_AT_ONCE = 1_000_000
"""Samples whose zones are worked out while a hand moves; every other one each way of 1920 x 1080."""

_OPACITY = 0.4
_GRIP = 8.0
"""Distance from the line, in pixels of the interface at its standard scale, at which it can be taken."""

_ON_THE_WAY = "potmesil_before.png"


@dataclass(frozen=True, slots=True)
class Place:
    """Where the mouse is: the region's pointer, a place in the image from 0 to 1, and one in the region."""

    region: int
    u: float
    v: float
    x: float
    y: float


class Session:
    """Inspect Focus from the button to its end."""

    def __init__(self, context: bpy.types.Context) -> None:
        self._window = context.window.as_pointer()
        self._stamp: tuple[str, int, int] | None = None
        self._values = ""
        self._zoned: Any = None
        self._step = 1
        self._changed = 0.0
        self._look: Any = None
        self._look_changed = 0.0
        self._shown: Any = None
        self._flags: Any = None
        self._point: Any = None
        self._wrong: dict[str, tuple[Any, PotmesilError]] = {}
        self._hands: dict[int, tuple[int, Any]] = {}
        self._begun = 0
        self.view: View | None = None
        self.settings: FocusSettings | None = None
        self.overlay: Float32Array | None = None
        self.before: Float32Array | None = None
        self.point: Float32Array | None = None
        self.point_width = 0.0
        """Width of the picture of the point-spread function in pixels of the result."""
        self.cursor: Place | None = None
        self.dragging = False
        self.cursor_changed = False
        self.longest_tick = 0.0

    # Each tick.

    def tick(self) -> bool:
        """Look at what changed, and work out what is drawn; return whether to go on."""
        manager = bpy.context.window_manager
        windows = list(manager.windows)
        if not windows:
            return False
        window = next((w for w in windows if w.as_pointer() == self._window), windows[0])
        state = manager.potmesil_camera
        if live.rendering(state):
            # The samples are about to be replaced.
            return True
        self._take_hands(windows)
        try:
            with bpy.context.temp_override(window=window):
                changed = self.update(bpy.context)
        except PotmesilError as error:
            self.settings = None
            changed = say(state, str(error))
        else:
            changed |= say(state, "")
        flags = tuple(getattr(state, name) for name in inspection_draw.FLAGS)
        if changed or flags != self._flags:
            self._flags = flags
            redraw()
        return True

    def update(self, context: bpy.types.Context) -> bool:
        """Follow the samples file, the settings and how images are displayed; return whether any changed.

        Raises
        ------
        PotmesilError
            If there are no samples, or the file or a setting is wrong.
        """
        state = context.window_manager.potmesil_camera
        changed = self._read(context.scene)
        values = settings_values(context)
        text = json.dumps(values)
        if changed or text != self._values or self.settings is None:
            from ..potmesil_addon.preview import settings_from_json  # noqa: PLC0415 - see kernels

            assert self.view is not None
            self._values, changed = text, True
            self.settings = inspection.view_settings(self.view, settings_from_json(values))
        if state.inspect_overlay:
            changed |= self._color_zones()
        if state.inspect_psf:
            changed |= self._spread_point()
        if state.inspect_compare:
            changed |= self._render_before(context.scene)
        return changed

    def _read(self, scene: bpy.types.Scene) -> bool:
        """Read the samples where the file is not that read last; return whether it was."""
        path = samples_path(scene)
        try:
            status = path.stat()
        except OSError:
            self._stamp = self.view = None
            frame = scene.frame_current
            text = rpt_("Frame {frame} has no samples yet; press Render to make them.")
            raise InputError(text.format(frame=frame)) from None
        stamp = str(path), status.st_mtime_ns, status.st_size
        if stamp == self._stamp and self.view is not None:
            return False
        kernels.use_user_cache()
        self._stamp, self.view = stamp, None
        self.view = self._once("samples", stamp, lambda: inspection.read_view(path))
        return True

    def _color_zones(self) -> bool:
        """Colour what is near, sharp and far, coarsely first where a picture is very large."""
        assert self.view is not None
        assert self.settings is not None
        depth, limits = self.view.depth, depth_of_field(self.settings.lens)
        now = time.monotonic()
        if self._zoned != (self._stamp, limits):
            self._zoned, self._changed = (self._stamp, limits), now
            self._step = max(1, math.ceil(math.sqrt(depth.size / _AT_ONCE)))
        elif self._step > 1 and now - self._changed > _REST:
            self._step = 1
        else:
            return False
        self.overlay = inspection.overlay(depth, limits, _OPACITY, self._step)
        return True

    def _spread_point(self) -> bool:
        """Make the picture of the point-spread function under the mouse."""
        found = self.reading()
        if found is None or self.view is None or self.settings is None:
            return False
        key = self.settings, self._stamp, found.depth
        if key == self._point:
            return False
        self._point = key
        values, pixel = inspection.point_spread(found.depth, self.view, self.settings)
        self.point, self.point_width = inspection.psf_picture(values), pixel * values.shape[1]
        return True

    def _render_before(self, scene: bpy.types.Scene) -> bool:
        """Bring the render before the lens to how Blender displays the result."""
        image = bpy.data.images.get(RESULT_NAME)
        if image is None or self.view is None:
            return False
        # Blender displays images that it takes for made by itself without the scene's view.
        as_render, now = image.use_view_as_render and image.source != "GENERATED", time.monotonic()
        look = self._stamp, look_of(scene, as_render=as_render)
        if look != self._look:
            self._look, self._look_changed = look, now
        # While a value of the display is dragged, the old picture stays.
        if look == self._shown or (self._shown is not None and now - self._look_changed < _REST):
            return False
        picture = self.view.picture
        self.before = self._once("before", look, lambda: display_values(scene, picture, as_render=as_render))
        self._shown = look
        return True

    def _once(self, what: str, key: Any, work: Callable[[], T]) -> T:
        """Do something that may take long; what went wrong with it is not tried again, but said again."""
        known = self._wrong.get(what)
        if known is not None and known[0] == key:
            raise known[1]
        try:
            return work()
        except PotmesilError as error:
            self._wrong[what] = key, error
            raise

    def reading(self) -> Reading | None:
        """Return what the lens does to what is under the mouse; None where there is nothing to read."""
        if self.cursor is None or self.view is None or self.settings is None:
            return None
        return inspection.reading(self.view, self.settings, self.cursor.u, self.cursor.v)

    # Events: one hand for each window.

    def _take_hands(self, windows: list[bpy.types.Window]) -> None:
        """See to it that each window's events come to us, and before they come to Live Focus."""
        below = live.session()
        for window in windows:
            known = self._hands.get(window.as_pointer())
            if self.dragging or (known is not None and known[1] is below):
                continue
            with bpy.context.temp_override(window=window):
                bpy.ops.potmesil.inspect_hand("INVOKE_DEFAULT")

    def begin_hand(self, window: bpy.types.Window) -> int:
        """Return the number of a window's new hand; the former one lets go."""
        self._begun += 1
        self._hands[window.as_pointer()] = self._begun, live.session()
        return self._begun

    def has_hand(self, window: bpy.types.Window, number: int) -> bool:
        """Return whether a hand is the present one of its window."""
        return self._hands.get(window.as_pointer(), (0, None))[0] == number

    def end_hand(self, number: int) -> None:
        """Forget a hand that Blender took away, as it does when a window closes."""
        self._hands = {key: known for key, known in self._hands.items() if known[0] != number}

    def near_line(self, context: bpy.types.Context, place: Place | None) -> bool:
        """Return whether a place is near enough to the line between before and after to take it."""
        state = context.window_manager.potmesil_camera
        if place is None or not state.inspect_compare or self.before is None:
            return False
        region = region_of(context.window, place.region)
        if region is None:
            return False
        frame = inspection_draw.Frame.of(*region)
        return abs(place.x - frame.x(state.split)) <= _GRIP * context.preferences.system.ui_scale

    def move(self, context: bpy.types.Context, place: Place | None) -> None:
        """Follow the mouse, with the line where it was taken."""
        state = context.window_manager.potmesil_camera
        if self.dragging:
            if place is not None:
                state.split = min(1.0, max(0.0, place.u))
        else:
            self.show_cursor(context.window, taken=self.near_line(context, place))
        before, self.cursor = self.cursor, place
        if place != before:
            redraw({key.region for key in (place, before) if key is not None})

    def show_cursor(self, window: bpy.types.Window, *, taken: bool) -> None:
        """Show by the mouse's cursor whether the line can be taken."""
        if taken and not self.cursor_changed:
            window.cursor_modal_set("MOVE_X")
        elif not taken and self.cursor_changed:
            window.cursor_modal_restore()
        self.cursor_changed = taken


_session: Session | None = None
_painter: inspection_draw.Painter | None = None


def session() -> Session | None:
    """Return what is going on, for tests; None while Inspect Focus is off."""
    return _session


def say(state: Any, text: str) -> bool:
    """Say something in the panel; return whether it is new."""
    if state.inspect_message == text:
        return False
    state.inspect_message = text
    redraw_panels(bpy.context)
    return True


def redraw(regions: set[int] | None = None) -> None:
    """Draw the editors again that show the result, or only some regions of them."""
    for window in bpy.context.window_manager.windows:
        for area, region in inspection_draw.canvases(window):
            if regions is None:
                area.tag_redraw()
            elif region.as_pointer() in regions:
                region.tag_redraw()


def region_of(
    window: bpy.types.Window, pointer: int
) -> tuple[bpy.types.Region, bpy.types.SpaceImageEditor] | None:
    """Return a region that shows the result, and its editor."""
    for area, region in inspection_draw.canvases(window):
        if region.as_pointer() == pointer:
            return region, area.spaces.active
    return None


def place_of(context: bpy.types.Context, event: bpy.types.Event) -> Place | None:
    """Return where in the result the mouse is, None where it is not over an Image Editor that shows it."""
    x, y = event.mouse_x, event.mouse_y
    for area, main in inspection_draw.canvases(context.window):
        inside = [
            region
            for region in area.regions
            if region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
        ]
        if main not in inside:
            continue
        if any(region.type != "WINDOW" and region.width > 1 and region.height > 1 for region in inside):
            return None  # a header or a sidebar lies over the picture
        # The middle of the pixel that the mouse points at.
        at_x, at_y = x - main.x + 0.5, y - main.y + 0.5
        frame = inspection_draw.Frame.of(main, area.spaces.active)
        return Place(main.as_pointer(), *frame.place(at_x, at_y), at_x, at_y)
    return None


def look_of(scene: bpy.types.Scene, *, as_render: bool) -> tuple[Any, ...]:
    """Return all that decides how an image of scene-linear values is displayed.

    Parameters
    ----------
    scene : Scene
        Its colour management.
    as_render : bool
        Whether the image is displayed as a render is.

    Returns
    -------
    tuple
        Plain values; those of the view only where they count.
    """
    device = scene.display_settings.display_device
    if not as_render:
        return (device,)
    view = scene.view_settings
    values = [device]
    for item in view.bl_rna.properties:
        if item.type in ("BOOLEAN", "INT", "FLOAT", "ENUM", "STRING"):
            value = getattr(view, item.identifier)
            values.append(value if isinstance(value, bool | int | float | str) else tuple(value))
    if view.use_curve_mapping:
        mapping = view.curve_mapping
        values += [tuple(mapping.black_level), tuple(mapping.white_level)]
        values += [(tuple(p.location), p.handle_type) for curve in mapping.curves for p in curve.points]
    return tuple(values)


def display_values(
    scene: bpy.types.Scene, picture: Float32Array, *, as_render: bool
) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Return a picture as Blender displays an image of its values.

    Only Blender itself knows its views, looks and curves: it writes the picture to a file of 8 bits as it
    would display it, and that is read again.

    Parameters
    ----------
    scene : Scene
        Its colour management.
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear, row 0 on top.
    as_render : bool
        Whether the image is displayed as a render is, or without view and look.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        Display values with straight alpha, row 0 on top.

    Raises
    ------
    InputError
        If the scene is linked from another file.
    """
    rows, columns = picture.shape[:2]
    image = bpy.data.images.new(_ON_THE_WAY, columns, rows, alpha=True, float_buffer=True)
    loaded = None
    try:
        image.alpha_mode = "PREMUL"
        image.pixels.foreach_set(np.ascontiguousarray(picture[::-1], dtype=np.float32).reshape(-1))
        with working_folder() as folder, Borrowed() as borrowed:
            path = folder / _ON_THE_WAY
            _borrow_display(borrowed, scene, as_render=as_render)
            image.save_render(str(path), scene=scene)
            loaded = bpy.data.images.load(str(path))
            loaded.alpha_mode = "STRAIGHT"
            values = np.empty(rows * columns * 4, dtype=np.float32)
            loaded.pixels.foreach_get(values)
    except (AttributeError, RuntimeError) as error:
        text = rpt_("The render cannot be compared: {reason}")
        raise InputError(text.format(reason=error)) from error
    finally:
        for made in (image, loaded):
            if made is not None:
                bpy.data.images.remove(made)
    return np.ascontiguousarray(values.reshape(rows, columns, 4)[::-1])


def _borrow_display(borrowed: Borrowed, scene: bpy.types.Scene, *, as_render: bool) -> None:
    """Make the scene's output 8 bits of what is displayed, until that is given back."""
    output = scene.render.image_settings
    values: dict[str, Any] = {
        "file_format": "PNG",
        "color_mode": "RGBA",
        "color_depth": "8",
        "compression": 0,
        "color_management": "FOLLOW_SCENE" if as_render else "OVERRIDE",
    }
    # Blender 5.0 added the medium, which limits the formats and so comes first.
    if hasattr(output, "media_type"):
        values = {"media_type": "IMAGE", **values}
    borrowed.set_all(output, values)
    borrowed.set(scene.render, "dither_intensity", 0.0)
    if as_render:
        return
    borrowed.set(output.display_settings, "display_device", scene.display_settings.display_device)
    view = {"view_transform": "Standard", "look": "None", "exposure": 0.0, "gamma": 1.0}
    borrowed.set_all(output.view_settings, {**view, "use_curve_mapping": False})


def _tick() -> float | None:
    if _session is None:
        return None
    mine, started = _session, time.perf_counter()
    try:
        going_on = mine.tick()
    except BaseException:
        shut_down()
        raise
    mine.longest_tick = max(mine.longest_tick, time.perf_counter() - started)
    if not going_on:
        shut_down()
        return None
    return _TICK


def _begin(context: bpy.types.Context) -> None:
    global _session, _painter  # noqa: PLW0603 - there is one Inspect Focus at a time
    shut_down()
    _session = Session(context)
    _painter = inspection_draw.Painter(_session)
    state = context.window_manager.potmesil_camera
    state.inspect, state.inspect_message = True, ""
    bpy.app.handlers.load_pre.append(_file_closes)
    bpy.app.timers.register(_tick, first_interval=_TICK)


def shut_down() -> None:
    """Stop everything at once, and leave nothing of it."""
    global _session, _painter
    ended, _session = _session, None
    painter, _painter = _painter, None
    if painter is not None:
        painter.close()
    if ended is None:
        return
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    if _file_closes in bpy.app.handlers.load_pre:
        bpy.app.handlers.load_pre.remove(_file_closes)
    manager = bpy.context.window_manager
    if manager is None:
        return
    if ended.cursor_changed:
        for window in manager.windows:
            window.cursor_modal_restore()
    if hasattr(manager, "potmesil_camera"):
        manager.potmesil_camera.inspect, manager.potmesil_camera.inspect_message = False, ""
    redraw_panels(bpy.context)


@persistent
def _file_closes(*_: Any) -> None:
    shut_down()


class POTMESIL_OT_inspect(bpy.types.Operator):
    """Show over the result what is near, sharp and far, what the lens does under the mouse, and the render before it"""  # noqa: E501 - a tooltip

    bl_idname = "potmesil.inspect"
    bl_label = "Inspect Focus"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """There is something to draw on only in a window."""
        return context.window is not None and not bpy.app.background

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Begin, or end where it is on."""
        if context.window_manager.potmesil_camera.inspect:
            shut_down()
            return {"FINISHED"}
        image = bpy.data.images.get(RESULT_NAME)
        if image is None:
            self.report({"ERROR"}, "There is no result yet; press Render to make one.")
            return {"CANCELLED"}
        space: Any = context.space_data
        if space is not None and space.type == "IMAGE_EDITOR":
            space.image = image
        _begin(context)
        return {"FINISHED"}


class POTMESIL_OT_inspect_hand(bpy.types.Operator):
    """Follow the mouse in one window while Inspect Focus is on"""

    bl_idname = "potmesil.inspect_hand"
    bl_label = "Inspect Focus"
    bl_options = {"INTERNAL"}

    _mine: Session | None = None
    _number = 0

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Ask for Inspect Focus, which it belongs to."""
        return context.window is not None and _session is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin."""
        del event
        assert _session is not None
        self._mine, self._number = _session, _session.begin_hand(context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take Esc and the line between before and after, and leave the rest to others."""
        mine = self._mine
        if mine is None or _session is not mine or not mine.has_hand(context.window, self._number):
            self._mine = None
            return {"CANCELLED", "PASS_THROUGH"}
        if live.rendering(context.window_manager.potmesil_camera):
            # Esc is for the render.
            mine.dragging = False
            return {"PASS_THROUGH"}
        if event.type in ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE"):
            mine.move(context, place_of(context, event))
            return {"RUNNING_MODAL"} if mine.dragging else {"PASS_THROUGH"}
        if event.type == "LEFTMOUSE" and event.value == "RELEASE" and mine.dragging:
            mine.dragging = False
            return {"RUNNING_MODAL"}
        if event.type in ("LEFTMOUSE", "ESC") and event.value == "PRESS":
            place = place_of(context, event)
            if event.type == "LEFTMOUSE" and mine.near_line(context, place):
                mine.dragging = True
                mine.move(context, place)
                return {"RUNNING_MODAL"}
            if event.type == "ESC" and place is not None:
                self._mine = None
                shut_down()
                return {"FINISHED"}
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Let go; Blender calls this when it closes the window or the file."""
        del context
        mine, self._mine = self._mine, None
        if mine is not None and _session is mine:
            mine.end_hand(self._number)
