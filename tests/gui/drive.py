"""Run inside a Blender with a window: uses the panel as a hand would and writes down what happened.

blender --enable-event-simulate --python drive.py -- FOLDER
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

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
SEEN: dict[str, Any] = {"errors": []}

# Where the Render button is, from the left and the top of the Properties editor's region.
RENDER_BUTTON = (70, 97)
PROCESS_BUTTON = (190, 97)
APERTURE_TITLE = (100, 323)
CURVE_TITLE = (100, 531)
PRINTER_TITLE = (100, 558)


def shot(name: str) -> None:
    """Save what an artist would see."""
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)


def window() -> Any:
    return bpy.context.window_manager.windows[0]


def area(kind: str) -> Any:
    return next(a for a in window().screen.areas if a.type == kind)


def event(kind: str, value: str, x: int, y: int) -> None:
    window().event_simulate(type=kind, value=value, x=x, y=y)


def click(offset: tuple[int, int]) -> None:
    """Click into the Properties editor."""
    region = next(r for r in area("PROPERTIES").regions if r.type == "WINDOW")
    x, y = region.x + offset[0], region.y + region.height - offset[1]
    event("MOUSEMOVE", "NOTHING", x - 2, y)
    event("MOUSEMOVE", "NOTHING", x, y)
    event("LEFTMOUSE", "PRESS", x, y)
    event("LEFTMOUSE", "RELEASE", x, y)


def prepare() -> None:
    """Lay out an Image Editor beside the camera's properties, and a scene worth a look."""
    for panel in bpy.types.Panel.__subclasses__():
        # Only ours is left on the camera's tab, so that its buttons are where the test looks for them.
        if getattr(panel, "bl_context", "") == "data" and not panel.__name__.startswith("POTMESIL"):
            bpy.utils.unregister_class(panel)
    outliner = area("OUTLINER")
    with bpy.context.temp_override(window=window(), area=outliner, region=outliner.regions[-1]):
        bpy.ops.screen.area_close()
    area("VIEW_3D").ui_type = "IMAGE_EDITOR"
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = 480, 270
    cube = bpy.data.objects["Cube"]
    for frame, x in ((0, -1.0), (2, 1.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    camera = scene.camera
    camera.data.dof.focus_distance = 8.0
    camera.data.dof.aperture_fstop = 0.2
    bpy.context.view_layer.objects.active = camera
    bpy.context.preferences.view.render_display_type = "NONE"


def wait(done: Any, seconds: float) -> Iterator[float]:
    """Look every tenth of a second whether something has happened."""
    until = time.time() + seconds
    while not done() and time.time() < until:
        yield 0.1
    if not done():
        SEEN["errors"].append(f"nothing happened within {seconds} s")


def state() -> Any:
    return bpy.context.window_manager.potmesil_camera


def pixels() -> list[float]:
    image = bpy.data.images.get("Potmesil Result")
    return [] if image is None else list(image.pixels[:: 4 * 97])


def story() -> Iterator[float]:
    """What the hand does; each number is a pause in seconds."""
    prepare()
    yield 1.0
    area("PROPERTIES").spaces.active.context = "DATA"
    yield 1.5
    shot("panel")
    yield from aperture_panel()
    yield from shutter_panel()
    yield from printer_panel()
    click(RENDER_BUTTON)
    yield from wait(lambda: state().running, 5.0)
    SEEN["started"] = state().running
    longest, last = 0.0, time.perf_counter()
    # Kernels are compiled first, and that takes longer on a busy machine.
    until = time.time() + 400.0
    while state().running and time.time() < until:
        yield 0.05
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
    SEEN["longest_pause"] = longest
    yield 1.0
    shot("rendered")
    SEEN["error"] = state().error
    SEEN["result"] = list(bpy.data.images["Potmesil Result"].size)
    SEEN["shown"] = getattr(area("IMAGE_EDITOR").spaces.active.image, "name", None)
    first = pixels()
    bpy.context.scene.camera.data.dof.focus_distance = 20.0
    click(PROCESS_BUTTON)
    yield 0.3
    yield from wait(lambda: not state().running, 120.0)
    yield 0.5
    shot("processed")
    SEEN["refocused"] = first != pixels()
    SEEN["quality"] = [state().has_quality, state().guessed_pixels, state().expected_error]
    yield from longer_shutter()
    yield from cancelled_render()


def aperture_panel() -> Iterator[float]:
    """Open the aperture's settings, and close them."""
    click(APERTURE_TITLE)
    yield 1.0
    shot("aperture")
    click(APERTURE_TITLE)
    yield 0.5


def shutter_panel() -> Iterator[float]:
    """Show what each kind of shutter asks for, and open and close its curve."""
    own = bpy.context.scene.potmesil_camera
    own.exposure_count = 5
    for kind in ("focal_plane", "between_lens"):
        own.shutter_kind = kind
        area("PROPERTIES").tag_redraw()
        yield 1.0
        shot(f"shutter_{kind}")
    own.exposure_count, own.shutter_kind = 1, "whole"
    area("PROPERTIES").tag_redraw()
    yield 0.5
    click(CURVE_TITLE)
    yield 1.0
    shot("shutter_curve")
    click(CURVE_TITLE)
    yield 0.5


def printer_panel() -> Iterator[float]:
    """Open the printer's settings, and close them."""
    own = bpy.context.scene.potmesil_camera
    own.uniform_defocus, own.fade = 1.5, 0.6
    click(PRINTER_TITLE)
    yield 1.0
    shot("printer")
    own.uniform_defocus, own.fade = 0.0, 1.0
    click(PRINTER_TITLE)
    yield 0.5


def longer_shutter() -> Iterator[float]:
    """Open the shutter longer, and press Process."""
    before = pixels()
    bpy.context.scene.render.motion_blur_shutter = 1.5
    click(PROCESS_BUTTON)
    yield 0.3
    yield from wait(lambda: not state().running, 120.0)
    yield 0.5
    shot("exposed")
    SEEN["exposed"] = before != pixels()
    SEEN["error_after_process"] = state().error


def cancelled_render() -> Iterator[float]:
    """Start a render that would take minutes, and press ESC."""
    scene = bpy.context.scene
    scene.cycles.samples = 100_000
    scene.render.use_motion_blur = True
    scene.camera.data.dof.use_dof = True
    before = pixels()
    click(RENDER_BUTTON)
    yield from wait(lambda: bpy.app.is_job_running("RENDER"), 10.0)
    yield 1.0
    SEEN["borrowed"] = not scene.render.use_motion_blur
    region = next(r for r in area("PROPERTIES").regions if r.type == "WINDOW")
    event("ESC", "PRESS", region.x + 70, region.y + 70)
    event("ESC", "RELEASE", region.x + 70, region.y + 70)
    yield from wait(lambda: not state().running, 20.0)
    SEEN["given_back"] = scene.render.use_motion_blur and scene.camera.data.dof.use_dof
    SEEN["handlers"] = len(bpy.app.handlers.render_complete) + len(bpy.app.handlers.render_cancel)
    SEEN["result_kept"] = pixels() == before
    SEEN["file_format"] = scene.render.image_settings.file_format


def main() -> None:
    bpy.context.preferences.view.show_splash = False
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

    bpy.app.timers.register(tick, first_interval=3.0)


main()
