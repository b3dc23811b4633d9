"""Run inside a Blender with a window and a fresh profile: does what the README says, and nothing else.

blender --enable-event-simulate --python first_use.py -- FOLDER SCENE.blend
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

FOLDER, BLEND = map(Path, sys.argv[sys.argv.index("--") + 1 :][:2])
SEEN: dict[str, Any] = {"errors": []}

# Where the buttons are, from the left and the top of the sidebar.
RENDER_BUTTON = (70, 55)
LIVE_BUTTON = (110, 85)
TAB_FROM_RIGHT = 10


def shot(name: str) -> None:
    """Save what an artist would see."""
    print(f"{name}.png", flush=True)
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)


def windows() -> list[Any]:
    """Return Blender's windows, the main one first."""
    return list(bpy.context.window_manager.windows)


def areas(kind: str) -> list[tuple[Any, Any]]:
    """Return the areas of a kind, each with its window."""
    return [(window, area) for window in windows() for area in window.screen.areas if area.type == kind]


def region(area: Any, kind: str) -> Any:
    """Return a region of an area."""
    return next(each for each in area.regions if each.type == kind)


def press(window: Any, kind: str, x: int, y: int) -> None:
    """Press and release a key or a button at a place."""
    for event, value in (("MOUSEMOVE", "NOTHING"), (kind, "PRESS"), (kind, "RELEASE")):
        window.event_simulate(type=event, value=value, x=x, y=y)


def move(window: Any, x: int, y: int) -> None:
    """Move the mouse to a place."""
    for at in (x - 3, x):
        window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=at, y=y)


def state() -> Any:
    return bpy.context.window_manager.potmesil_camera


def wait(done: Any, seconds: float) -> Iterator[float]:
    """Look every tenth of a second whether something has happened."""
    until = time.time() + seconds
    while not done() and time.time() < until:
        yield 0.1
    if not done():
        SEEN["errors"].append(f"nothing happened within {seconds} s")


def story() -> Iterator[float]:
    """What the README says."""
    scene = bpy.context.scene
    # Enough to see what happens, on a machine that also draws the window.
    scene.cycles.samples, scene.render.resolution_percentage = 8, 75
    window, view = areas("VIEW_3D")[0]
    canvas = region(view, "WINDOW")
    middle = canvas.x + canvas.width // 2, canvas.y + canvas.height // 2
    move(window, *middle)
    yield 0.5
    press(window, "N", *middle)
    yield 1.0
    sidebar = region(view, "UI")
    SEEN["sidebar"] = sidebar.width > 1
    # The tabs stand at the sidebar's edge; which is where depends on the names of the others.
    sidebar.active_panel_category = "Potmesil"
    view.tag_redraw()
    yield 1.0
    shot("first_1")
    dof = scene.camera.data.dof
    before = dof.focus_distance, dof.focus_object and dof.focus_object.name
    top = sidebar.y + sidebar.height
    place = sidebar.x + RENDER_BUTTON[0], top - RENDER_BUTTON[1]
    move(window, *place)
    yield 0.3
    press(window, "LEFTMOUSE", *place)
    yield from wait(lambda: state().running, 10.0)
    yield 1.0
    shot("first_rendering")
    yield from wait(lambda: not state().running, 400.0)
    yield 2.0
    SEEN["error"] = state().error
    SEEN["shown"] = [getattr(area.spaces.active.image, "name", "") for _, area in areas("IMAGE_EDITOR")]
    shot("first_2")
    place = sidebar.x + LIVE_BUTTON[0], top - LIVE_BUTTON[1]
    move(window, *place)
    yield 0.3
    press(window, "LEFTMOUSE", *place)
    yield from wait(lambda: state().live, 10.0)
    yield from wait(lambda: not state().live_message, 300.0)
    yield 3.0
    shot("first_3")
    window, editor = areas("IMAGE_EDITOR")[-1]
    canvas = region(editor, "WINDOW")
    # A ball behind the watch.
    u, v = 0.31, 0.685
    x, y = canvas.view2d.view_to_region(u, v, clip=False)
    place = canvas.x + x, canvas.y + y
    move(window, *place)
    yield 0.3
    press(window, "LEFTMOUSE", *place)
    yield 1.0
    yield from wait(lambda: state().has_quality, 120.0)
    yield 2.0
    SEEN["focus"] = [before[0], dof.focus_distance]
    SEEN["message"] = state().live_message
    shot("first_4")
    press(window, "RET", *place)
    yield from wait(lambda: not state().live, 20.0)
    SEEN["kept"] = dof.focus_distance


def main() -> None:
    bpy.context.preferences.view.show_splash = False
    bpy.ops.wm.open_mainfile(filepath=str(BLEND), load_ui=False)
    steps = story()

    def tick() -> float | None:
        try:
            return next(steps)
        except StopIteration:
            pass
        except Exception:
            SEEN["errors"].append(traceback.format_exc())
        (FOLDER / "seen.json").write_text(json.dumps(SEEN))
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(tick, first_interval=3.0, persistent=True)


main()
