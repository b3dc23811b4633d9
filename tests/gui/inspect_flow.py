"""Inspect Focus in a real window: what the mouse reads, the overlay, the split, and what is left afterwards.

The steps are generators of pauses in seconds, and use the helpers of `drive`, which is given to them.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

COLORS = ((1.0, 0.45, 0.1), (0.2, 0.9, 0.4), (0.2, 0.5, 1.0))
OPACITY = 0.4


def extension(name: str) -> Any:
    """Return a module of the installed extension."""
    return sys.modules[next(key for key in sys.modules if key.endswith(f"potmesil_camera.{name}"))]


def session() -> Any:
    """Return what the extension knows of Inspect Focus, None while it is off."""
    return extension("operators.inspection").session()


def canvas(drive: Any) -> Any:
    """Return the region that shows the result."""
    return next(r for r in drive.area("IMAGE_EDITOR").regions if r.type == "WINDOW")


def on_screen(drive: Any, u: float, v: float) -> tuple[int, int]:
    """Return the pixel of the window at which a place of the result is."""
    region = canvas(drive)
    frame = extension("operators.inspection_draw").Frame.of(region, drive.area("IMAGE_EDITOR").spaces.active)
    return int(region.x + frame.left + u * frame.width), int(region.y + frame.bottom + v * frame.height)


def pixel(name: str, drive: Any, x: int, y: int) -> list[int]:
    """Return the mean colour of 7 x 7 pixels of a picture that was taken of the window."""
    path = str(Path(drive.FOLDER) / f"{name}.png")
    row = drive.window().height - 1 - y
    crop = f"7x7+{x - 3}+{row - 3}"
    command = ["convert", path, "-crop", crop, "-scale", "1x1!", "-depth", "8", "rgb:-"]
    return list(subprocess.run(command, check=True, capture_output=True).stdout)


def move(drive: Any, u: float, v: float) -> None:
    """Move the mouse over a place of the result."""
    x, y = on_screen(drive, u, v)
    drive.event("MOUSEMOVE", "NOTHING", x - 3, y)
    drive.event("MOUSEMOVE", "NOTHING", x, y)


def toggle(drive: Any) -> None:
    """Press the button in the Image Editor's sidebar."""
    editor = drive.area("IMAGE_EDITOR")
    with bpy.context.temp_override(window=drive.window(), area=editor, region=canvas(drive)):
        bpy.ops.potmesil.inspect("INVOKE_DEFAULT")


def inspect(drive: Any, seen: dict[str, Any]) -> Iterator[float]:
    """Look at the result of the scene that is there, which has samples: overlay, read-out, split, end.

    Parameters
    ----------
    drive : module
        The helpers: `event`, `shot`, `area`, `window`, `wait`, `state`, `click`, and `FOLDER`.
    seen : dict
        Takes what happened.

    Yields
    ------
    float
        Pauses in seconds.
    """
    editor, state = drive.area("IMAGE_EDITOR"), drive.state()
    space, scene = editor.spaces.active, bpy.context.scene
    space.image = bpy.data.images["Potmesil Result"]
    with bpy.context.temp_override(window=drive.window(), area=editor, region=canvas(drive)):
        bpy.ops.image.view_all(fit_view=True)
    yield 0.5
    drive.shot("inspect_off")
    toggle(drive)
    yield from drive.wait(lambda: session() is not None and session().overlay is not None, 60.0)
    yield 0.5
    yield from _overlay(drive, seen)
    space.show_region_ui = True
    yield 0.5
    sidebar = next(r for r in editor.regions if r.type == "UI")
    sidebar.active_panel_category = "Potmesil"
    editor.tag_redraw()
    yield 1.0
    drive.shot("inspect_sidebar")
    space.show_region_ui = False
    yield 0.5
    yield from _compare(drive, seen)
    # Another focus is seen at once.
    dof = scene.camera.data.dof
    before, known = dof.focus_distance, session().settings
    dof.focus_distance = 2.0 * before
    yield from drive.wait(lambda: session().settings is not known, 5.0)
    seen["follows"] = session().settings.lens.focus_distance / before
    dof.focus_distance = before
    x, y = on_screen(drive, 0.7, 0.3)
    drive.event("MOUSEMOVE", "NOTHING", x, y)
    drive.event("ESC", "PRESS", x, y)
    drive.event("ESC", "RELEASE", x, y)
    yield 0.5
    seen["left"] = {"escape": left_over(state)}
    drive.shot("inspect_ended")
    yield from _with_live(drive, seen)
    yield from _two_windows(drive, seen)


def _overlay(drive: Any, seen: dict[str, Any]) -> Iterator[float]:
    """Note what is read at some places, and the colours there with and without the overlay."""
    seen["places"] = []
    for u, v in ((0.5, 0.5), (0.1, 0.9), (0.9, 0.1)):
        move(drive, u, v)
        yield 0.5
        found = session().reading()
        seen["places"].append({"zone": found.zone, "depth": found.depth, "circle_px": found.circle_px})
    # Away from the places: the read-out must not lie over them.
    drive.event("MOUSEMOVE", "NOTHING", 5, 5)
    yield 0.5
    drive.shot("inspect")
    for place, (u, v) in zip(seen["places"], ((0.5, 0.5), (0.1, 0.9), (0.9, 0.1)), strict=True):
        x, y = on_screen(drive, u, v)
        place["off"], place["on"] = pixel("inspect_off", drive, x, y), pixel("inspect", drive, x, y)
        color = COLORS[("near", "sharp", "far").index(place["zone"])]
        place["expected"] = [
            (1.0 - OPACITY) * off + OPACITY * 255.0 * c for off, c in zip(place["off"], color, strict=True)
        ]


def _compare(drive: Any, seen: dict[str, Any]) -> Iterator[float]:
    """Drag the line between before and after."""
    state = drive.state()
    state.inspect_overlay, state.inspect_compare, state.split = False, True, 0.5
    yield from drive.wait(lambda: session().before is not None, 20.0)
    yield 0.5
    move(drive, 0.5, 0.5)
    yield 0.5
    seen["cursor"] = [session().cursor_changed]
    drive.shot("compare")
    drive.event("LEFTMOUSE", "PRESS", *on_screen(drive, 0.5, 0.5))
    for u in (0.45, 0.4, 0.35, 0.3):
        yield 0.1
        drive.event("MOUSEMOVE", "NOTHING", *on_screen(drive, u, 0.5))
    drive.event("LEFTMOUSE", "RELEASE", *on_screen(drive, 0.3, 0.5))
    yield 0.3
    seen["split"] = state.split
    move(drive, 0.7, 0.7)
    yield 0.5
    seen["cursor"].append(session().cursor_changed)
    drive.shot("compare_dragged")
    state.inspect_overlay, state.inspect_compare, state.split = True, False, 0.5


def _with_live(drive: Any, seen: dict[str, Any]) -> Iterator[float]:
    """With Live Focus on too: the line is dragged, a drag beside it focuses, Esc ends one after the other."""
    state, dof = drive.state(), bpy.context.scene.camera.data.dof
    dof.focus_object = None
    state.inspect_compare, state.split = True, 0.5
    toggle(drive)
    yield from drive.live_on()
    yield from drive.wait(lambda: session().before is not None, 20.0)
    yield 1.0
    before = dof.focus_distance
    x, y = on_screen(drive, 0.5, 0.5)
    drive.event("MOUSEMOVE", "NOTHING", x, y)
    drive.event("LEFTMOUSE", "PRESS", x, y)
    yield 0.1
    drive.event("MOUSEMOVE", "NOTHING", *on_screen(drive, 0.6, 0.5))
    yield 0.1
    drive.event("LEFTMOUSE", "RELEASE", *on_screen(drive, 0.6, 0.5))
    yield 0.3
    seen["with_live"] = {"split": state.split, "focus_kept": dof.focus_distance == before}
    x, y = on_screen(drive, 0.4, 0.4)
    move(drive, 0.4, 0.4)
    yield 0.5
    read = session().reading().depth
    drive.event("LEFTMOUSE", "PRESS", x, y)
    yield 0.3
    drive.event("LEFTMOUSE", "RELEASE", x, y)
    yield 0.3
    seen["with_live"]["focused"] = [dof.focus_distance, read]
    for _ in range(2):
        drive.event("ESC", "PRESS", x, y)
        drive.event("ESC", "RELEASE", x, y)
        yield 0.5
        seen["with_live"].setdefault("ended", []).append([state.inspect, state.live])
    state.inspect_compare = False


def _two_windows(drive: Any, seen: dict[str, Any]) -> Iterator[float]:
    """Read in a second window, and close it."""
    with bpy.context.temp_override(window=drive.window()):
        bpy.ops.wm.window_new()
    yield 1.0
    other = bpy.context.window_manager.windows[-1]
    other.screen.areas[0].ui_type = "IMAGE_EDITOR"
    other.screen.areas[0].spaces.active.image = bpy.data.images["Potmesil Result"]
    toggle(drive)
    yield from drive.wait(lambda: session() is not None and session().overlay is not None, 20.0)
    yield 0.5
    area = other.screen.areas[0]
    region = next(r for r in area.regions if r.type == "WINDOW")
    frame = extension("operators.inspection_draw").Frame.of(region, area.spaces.active)
    x, y = int(region.x + frame.x(0.5)), int(region.y + frame.bottom + 0.5 * frame.height)
    other.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x - 3, y=y)
    other.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
    yield 0.5
    cursor = session().cursor
    seen["second_window"] = cursor is not None and cursor.region == region.as_pointer()
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()
    yield 1.0
    move(drive, 0.5, 0.5)
    yield 0.5
    seen["after_closing"] = session() is not None and session().reading() is not None
    toggle(drive)
    yield 0.3
    seen["left"]["button"] = left_over(drive.state())


def opened(drive: Any, seen: dict[str, Any]) -> Iterator[float]:
    """Disable the extension, and open the file, while Inspect Focus is on; the samples must be on disk.

    Parameters
    ----------
    drive : module
        As `inspect` has it.
    seen : dict
        The same that `inspect` has filled.

    Yields
    ------
    float
        Pauses in seconds.
    """
    name = next(name for name in sys.modules if name.endswith(".potmesil_camera"))
    drive.area("IMAGE_EDITOR").spaces.active.image = bpy.data.images["Potmesil Result"]
    toggle(drive)
    yield 1.0
    module = extension("operators.inspection")
    painter = module._painter
    with bpy.context.temp_override(window=drive.window()):
        bpy.ops.preferences.addon_disable(module=name)
    yield 0.5
    seen["left"]["extension"] = [] if painter._handle is None and not painter._textures else ["painter"]
    with bpy.context.temp_override(window=drive.window()):
        bpy.ops.preferences.addon_enable(module=name)
    yield 0.5
    toggle(drive)
    yield 1.0
    painter = extension("operators.inspection")._painter
    blend = str(Path(drive.FOLDER) / f"inspect_{int(time.time())}.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend, copy=True)
    with bpy.context.temp_override(window=drive.window()):
        bpy.ops.wm.open_mainfile(filepath=blend)
    yield 1.0
    seen["left"]["file"] = [
        *left_over(drive.state()),
        *([] if painter._handle is None and not painter._textures else ["painter"]),
    ]


def left_over(state: Any) -> list[str]:
    """Return what is still there of Inspect Focus after its end."""
    module = extension("operators.inspection")
    found = {
        "session": module.session() is not None,
        "painter": module._painter is not None,
        "timer": bpy.app.timers.is_registered(module._tick),
        "handler": module._file_closes in bpy.app.handlers.load_pre,
        "state": bool(state.inspect),
    }
    return [name for name, there in found.items() if there]
