"""Run inside a Blender with a window: writes all of it down before and after what needs a window, and undoes.

blender --enable-event-simulate --python untouched_flow.py -- FOLDER
"""

from __future__ import annotations

import importlib
import json
import sys
import time
import traceback
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
SEEN: dict[str, Any] = {"errors": [], "changed": {}}
PACKAGE = "bl_ext.user_default.potmesil_camera"


def dumper() -> Any:
    """Return the tests' own `dump`, without the package around it, which needs pytest."""
    folder = Path(__file__).resolve().parents[1] / "blender"
    package = types.ModuleType("blender_tests")
    package.__path__ = [str(folder)]
    conftest = types.ModuleType("blender_tests.conftest")
    conftest.PACKAGE = PACKAGE  # type: ignore[attr-defined]
    sys.modules.update({"blender_tests": package, "blender_tests.conftest": conftest})
    return importlib.import_module("blender_tests.dump")


DUMPER = dumper()

BESIDES = (
    *DUMPER.WORKED_OUT,
    # The window shows what was made last, and Blender where the mouse is.
    r"^window_managers",
)


def module(name: str) -> Any:
    """Return a module of the installed extension."""
    return sys.modules[f"{PACKAGE}.{name}"]


def context() -> Any:
    """Return the window, the Image Editor and its region, for operators."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "IMAGE_EDITOR")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def call(name: str) -> None:
    """Call an operator as a click does, with an undo step."""
    with context():
        getattr(bpy.ops.potmesil, name)("INVOKE_DEFAULT", True)


def key(kind: str) -> None:
    """Press and release a key over the result."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "IMAGE_EDITOR")
    x, y = area.x + area.width // 2, area.y + area.height // 2
    window.event_simulate(type=kind, value="PRESS", x=x, y=y)
    window.event_simulate(type=kind, value="RELEASE", x=x, y=y)


def step(name: str) -> None:
    """Undo or redo."""
    with context():
        getattr(bpy.ops.ed, name)()


def wait(done: Any, seconds: float) -> Iterator[float]:
    """Look every tenth of a second whether something has happened."""
    until = time.monotonic() + seconds
    while not done() and time.monotonic() < until:
        yield 0.1
    assert done()


def written_down() -> Any:
    """Return what there is, as it is after the next redraw."""
    bpy.context.view_layer.update()
    return DUMPER.dump()


def same(name: str, before: Any) -> None:
    """Note what differs from what was written down."""
    SEEN["changed"][name] = [line[:300] for line in DUMPER.differences(before, written_down(), BESIDES)]


def focus() -> Any:
    """Return the camera's depth of field."""
    return bpy.context.scene.camera.data.dof


def state() -> Any:
    """Return what the extension says of its work."""
    return bpy.context.window_manager.potmesil_camera


def story() -> Iterator[float]:
    """Render, look, focus, and end each of it in every way."""
    area = max(bpy.context.window_manager.windows[0].screen.areas, key=lambda area: area.width * area.height)
    area.ui_type = "IMAGE_EDITOR"
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x, scene.render.resolution_y = 160, 90
    bpy.context.preferences.view.render_display_type = "NONE"
    scene.potmesil_camera.samples_path = str(FOLDER / "samples_####.exr")
    focus().focus_distance = 8.0
    # The first one sets up passes and shows its result, which is what it is for.
    call("render")
    yield from wait(lambda: not state().running and (FOLDER / "samples_0001.exr").exists(), 120.0)
    yield 1.0

    before = written_down()
    call("render")
    yield 0.2
    yield from wait(lambda: not state().running, 120.0)
    yield 0.5
    same("render", before)
    call("process")
    yield 0.2
    yield from wait(lambda: not state().running, 120.0)
    same("process", before)
    scene.cycles.samples, scene.render.resolution_x, scene.render.resolution_y = 100_000, 960, 540
    before = written_down()
    call("render")
    yield from wait(lambda: bpy.app.is_job_running("RENDER"), 10.0)
    yield 1.0
    SEEN["running"] = bool(state().running)
    key("ESC")
    yield from wait(lambda: not state().running, 60.0)
    yield 0.5
    same("render escaped", before)
    scene.cycles.samples, scene.render.resolution_x, scene.render.resolution_y = 1, 160, 90

    inspection, live = module("operators.inspection"), module("operators.live")
    before = written_down()
    call("inspect")
    yield from wait(
        lambda: inspection.session() is not None and inspection.session().overlay is not None, 60.0
    )
    yield 0.5
    key("ESC")
    yield from wait(lambda: inspection.session() is None, 10.0)
    same("inspect escaped", before)
    call("inspect")
    yield from wait(lambda: inspection.session() is not None, 10.0)
    call("inspect")
    yield 0.5
    same("inspect pressed again", before)

    def on() -> Iterator[float]:
        call("live")
        yield from wait(lambda: live._session is not None and live._session.updates > 0, 300.0)

    yield from on()
    call("live")
    yield from wait(lambda: live._session is None, 10.0)
    same("live pressed again", before)
    yield from on()
    focus().focus_distance = 5.0
    yield 0.5
    call("end_live")
    yield from wait(lambda: live._session is None, 10.0)
    yield 0.5
    same("live taken back", before)

    with context():
        bpy.ops.ed.undo_push(message="Before")
    before = written_down()
    yield from on()
    focus().focus_distance = 5.0
    yield 0.5
    call("live")
    yield from wait(lambda: live._session is None, 10.0)
    yield 0.5
    confirmed = written_down()
    SEEN["confirmed"] = [line[:300] for line in DUMPER.differences(before, confirmed, BESIDES)]
    for name, expected in (("undo", before), ("redo", confirmed), ("undo again", before)):
        step(name.partition(" ")[0])
        yield 0.5
        same(name, expected)
    call("process")
    yield 0.2
    yield from wait(lambda: not state().running, 120.0)
    same("process after undo", before)


def main() -> None:
    """Tell the story, write down what was seen, and end."""
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

    bpy.app.timers.register(tick, first_interval=3.0, persistent=True)


main()
