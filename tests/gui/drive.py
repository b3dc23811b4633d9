"""Run inside a Blender with a window: uses the panel as a hand would and writes down what happened.

blender --enable-event-simulate --python drive.py -- FOLDER
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy

# The parts of the story that have files of their own lie beside this one.
sys.path.insert(0, str(Path(__file__).parent))

import inspect_flow
from viewport_flow import viewport

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
SEEN: dict[str, Any] = {"errors": []}

TABS = ("data", "render", "output")
# Where the Render button is, from the left and the top of the Properties editor's region.
RENDER_BUTTON = (70, 97)
PROCESS_BUTTON = (190, 97)
LIVE_BUTTON = (70, 127)
F_STOP = (147, 258)
APERTURE_TITLE = (100, 430)
CURVE_TITLE = (100, 389)
PRINTER_TITLE = (100, 441)


def shot(name: str) -> None:
    """Save what an artist would see."""
    print(f"{name}.png", flush=True)
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
        # Only ours are left on these tabs, so that their buttons are where the test looks for them.
        if getattr(panel, "bl_context", "") in TABS and not panel.__name__.startswith("POTMESIL"):
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
    at_rest = render_handlers()
    yield 1.0
    yield from tab("DATA")
    shot("panel")
    yield from aperture_panel()
    yield from tab("RENDER")
    shot("render_tab")
    yield from shutter_panel()
    yield from printer_panel()
    yield from tab("OUTPUT")
    shot("output_tab")
    yield from tab("DATA")
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
    yield from live_focus()
    for part in (live_drag, live_sidebar, live_undo, live_scenes, live_render, live_window, live_extension):
        yield from guarded(part())
    yield from guarded(inspect_flow.inspect(SimpleNamespace(**globals()), SEEN.setdefault("inspect", {})))
    yield from guarded(stage())
    hand = SimpleNamespace(window=window, event=event, shot=shot, folder=FOLDER)
    yield from guarded(viewport(hand, SEEN))
    yield from cancelled_render()
    SEEN["handlers"] = render_handlers() - at_rest
    scene = bpy.context.scene
    scene.cycles.samples = 4
    # The default is relative to the file, and two of them are opened now.
    scene.potmesil_camera.samples_path = str(live_module().samples_path(scene))
    yield from guarded(inspect_flow.opened(SimpleNamespace(**globals()), SEEN["inspect"]))
    yield from guarded(live_file())


def render_handlers() -> int:
    """Return how many handlers wait for a render's end."""
    return len(bpy.app.handlers.render_complete) + len(bpy.app.handlers.render_cancel)


def guarded(steps: Iterator[float]) -> Iterator[float]:
    """Take some steps; what goes wrong there does not keep us from what comes after."""
    try:
        yield from steps
    except Exception:
        SEEN["errors"].append(traceback.format_exc())


def tab(name: str) -> Iterator[float]:
    """Go to a tab of the Properties editor."""
    area("PROPERTIES").spaces.active.context = name
    yield 1.0


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
    for kind in ("focal_plane", "between_lens", "rotary"):
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


def live_module() -> Any:
    """The extension's own module."""
    return sys.modules[next(name for name in sys.modules if name.endswith("potmesil_camera.operators.live"))]


def live_session() -> Any:
    """What the extension knows of Live Focus, None while it is off."""
    return live_module().session()


def processors() -> tuple[float, float]:
    """Return the processor seconds that everything, and that this Blender, have taken so far."""
    line = Path("/proc/stat").read_text().splitlines()[0]
    user, nice, system, _, _, *others = map(int, line.split()[1:8])
    own = os.times()
    return (user + nice + system + sum(others)) / os.sysconf("SC_CLK_TCK"), own.user + own.system


def paced(seconds: float, seen: dict[str, Any], change: Any) -> Iterator[float]:
    """Change something every 50 ms, and note how often the window was free and the picture followed."""
    session = live_session()
    updates = 0 if session is None else session.updates
    start = last = time.perf_counter()
    gaps, changed = [], 0
    while last - start < seconds:
        if last - start >= 0.05 * changed:
            change(changed)
            changed += 1
        yield 0.0
        now = time.perf_counter()
        gaps.append(now - last)
        last = now
    gaps.sort()
    seen["longest_gap"], seen["median_gap"] = gaps[-1], gaps[len(gaps) // 2]
    seen["gaps_over_100_ms"] = sum(gap > 0.1 for gap in gaps)
    if session is not None:
        seen["updates"] = (session.updates - updates) / (last - start)
        seen["longest_tick"], seen["tier"] = session.longest_tick, session.tier


def live_focus() -> Iterator[float]:
    """Pull focus with Live Focus on, by the panel's values and by the mouse; cancel, and confirm."""
    scene = bpy.context.scene
    camera = scene.camera.data
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    scene.cycles.samples = 4
    scene.render.motion_blur_shutter = 0.5
    scene.potmesil_camera.use_motion = False
    camera.dof.focus_distance, camera.dof.aperture_fstop = 8.0, 0.8
    click(RENDER_BUTTON)
    yield 0.5
    yield from wait(lambda: not state().running, 120.0)
    yield 0.5
    before = pixels()
    editor = area("IMAGE_EDITOR")
    region = next(r for r in editor.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=editor, region=region):
        bpy.ops.image.view_all(fit_view=True)
    yield 0.5
    width = editor.spaces.active.zoom[0] * 960
    live = SEEN["live"] = {}

    def pull(n: int) -> None:
        camera.dof.focus_distance = 5.0 + 4.0 * abs((n % 40) / 20.0 - 1.0)

    def pull_alone(n: int) -> None:
        pull(n)
        region.tag_redraw()

    # The window without us: the same setting changes, and all that previews would draw again is drawn.
    live["window"] = {}
    busy, own = processors()
    start = time.perf_counter()
    yield from paced(3.0, live["window"], pull_alone)
    busy, own = (now - before for now, before in zip(processors(), (busy, own), strict=True))
    live["window"]["others"] = (busy - own) / (time.perf_counter() - start)
    camera.dof.focus_distance = 8.0
    yield 0.5
    click(LIVE_BUTTON)
    yield from wait(lambda: state().live, 5.0)
    live["started"] = state().live
    # Kernels are compiled first, for minutes where the machine has other things to do.
    yield from wait(lambda: live_session() is not None and live_session().updates > 0, 300.0)
    yield from wait(lambda: state().has_quality, 120.0)
    live["message"], live["compiled"] = state().live_message, live_session().compiled
    yield 2.0

    def stop_down(n: int) -> None:
        camera.dof.aperture_fstop = 0.5 + 0.05 * n

    yield from paced(2.0, {}, pull)  # how good a preview can be is found out meanwhile
    for name, change in (("focus", pull), ("f_stop", stop_down)):
        live[name] = {}
        live_session().longest_tick = 0.0
        yield from paced(3.0, live[name], change)
        live[name]["size"] = list(bpy.data.images["Potmesil Result"].size)
    live["width_kept"] = abs(editor.spaces.active.zoom[0] * live["f_stop"]["size"][0] / width - 1.0)
    shot("live_dragged")
    yield 0.3
    yield from wait(lambda: state().has_quality, 120.0)
    yield 0.5
    live["whole"] = list(bpy.data.images["Potmesil Result"].size)
    shot("live")
    camera.dof.focus_object = bpy.data.objects["Light"]
    yield 0.5
    middle = region.x + region.width // 2, region.y + region.height // 2
    event("MOUSEMOVE", "NOTHING", middle[0] - 9, middle[1])
    event("LEFTMOUSE", "PRESS", *middle)
    yield 0.3
    live["focused_at"] = camera.dof.focus_distance
    yield 1.0
    live["note"] = state().live_message
    shot("live_note")
    event("MOUSEMOVE", "NOTHING", middle[0], middle[1] - 3)
    event("LEFTMOUSE", "RELEASE", middle[0], middle[1] - 3)
    yield 0.5
    event("ESC", "PRESS", *middle)
    event("ESC", "RELEASE", *middle)
    yield 1.0
    live["cancelled"] = [state().live, camera.dof.focus_distance, round(camera.dof.aperture_fstop, 4)]
    live["result_back"] = pixels() == before
    live["ended"] = live_session() is None
    # Again, and kept; and the shutter.
    scene.potmesil_camera.use_motion = True
    click(LIVE_BUTTON)
    yield from wait(lambda: live_session() is not None and live_session().updates > 0, 300.0)

    def open_longer(n: int) -> None:
        scene.render.motion_blur_shutter = 0.2 + 0.02 * n

    live["shutter"] = {}
    yield from paced(2.0, {}, open_longer)
    yield from paced(3.0, live["shutter"], open_longer)
    # As many instants as pixels of the path: a short one is soon done.
    camera.dof.focus_distance, scene.render.motion_blur_shutter = 6.5, 0.1
    click(LIVE_BUTTON)
    yield from wait(lambda: live_session() is None, 120.0)
    live["confirmed"] = [state().live, camera.dof.focus_distance, state().has_quality]
    live["whole_after"] = list(bpy.data.images["Potmesil Result"].size)
    shot("live_confirmed")
    scene.potmesil_camera.use_motion = False


def live_on() -> Iterator[float]:
    """Start Live Focus, and wait for its first picture."""
    with bpy.context.temp_override(window=window()):
        bpy.ops.potmesil.live("INVOKE_DEFAULT")
    yield from wait(lambda: live_session() is not None and live_session().updates > 0, 120.0)


def live_off(operator: str) -> Iterator[float]:
    """End Live Focus by one of its buttons."""
    with bpy.context.temp_override(window=window()):
        # True: with an undo step, as a click makes it.
        getattr(bpy.ops.potmesil, operator)("INVOKE_DEFAULT", True)
    yield from wait(lambda: live_session() is None, 120.0)


def live_drag() -> Iterator[float]:
    """Drag the f-stop in the panel with Live Focus on; one undo takes the drag back."""
    yield from live_on()
    dof = bpy.context.scene.camera.data.dof
    before, updates = dof.aperture_fstop, live_session().updates
    region = next(r for r in area("PROPERTIES").regions if r.type == "WINDOW")
    x, y = region.x + F_STOP[0], region.y + region.height - F_STOP[1]
    event("MOUSEMOVE", "NOTHING", x - 3, y)
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.3
    event("LEFTMOUSE", "PRESS", x, y)
    for step in range(1, 13):
        event("MOUSEMOVE", "NOTHING", x + 3 * step, y)
        yield 0.1
    event("LEFTMOUSE", "RELEASE", x + 36, y)
    yield from wait(lambda: live_session().updates > updates, 20.0)
    dragged = [before, dof.aperture_fstop]
    with bpy.context.temp_override(window=window(), area=area("PROPERTIES")):
        bpy.ops.ed.undo()
    yield 0.5
    SEEN["live"]["f_stop_dragged"] = [*dragged, bpy.context.scene.camera.data.dof.aperture_fstop]
    yield from live_off("end_live")


def workers() -> list[tuple[int, str]]:
    """Return the processes and the folders of Live Focus."""
    session = live_session()
    both = [worker for worker in (session._preview, session._whole) if worker._process is not None]
    return [(worker._process.pid, str(worker._folder)) for worker in both]


def left_over(known: list[tuple[int, str]]) -> list[str]:
    """Return what is still there of Live Focus after its end."""
    left = ["timer"] if any(m.endswith("live") and is_timed(m) for m in list(sys.modules)) else []
    for pid, folder in known:
        status = Path(f"/proc/{pid}/stat")
        if status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z":
            left.append(f"process {pid}")
        if Path(folder).exists():
            left.append(folder)
    return left


def is_timed(module: str) -> bool:
    """Return whether the timer of a module of ours is registered."""
    found = getattr(sys.modules[module], "_tick", None)
    return found is not None and bpy.app.timers.is_registered(found)


def live_sidebar() -> Iterator[float]:
    """Show the tab in the Image Editor's sidebar while Live Focus is on."""
    yield from live_on()
    space = area("IMAGE_EDITOR").spaces.active
    space.show_region_ui = True
    yield 0.5
    region = next(r for r in area("IMAGE_EDITOR").regions if r.type == "UI")
    region.active_panel_category = "Potmesil"
    area("IMAGE_EDITOR").tag_redraw()
    yield 1.0
    SEEN["live"]["category"] = region.active_panel_category
    shot("live_sidebar")
    space.show_region_ui = False
    known = workers()
    yield from live_off("end_live")
    yield 0.5
    SEEN["live"]["left"] = {"cancel": left_over(known)}


def live_undo() -> Iterator[float]:
    """Undo while Live Focus is on; and what was confirmed, which is one step."""
    seen: list[float] = []

    def focus(distance: float | None = None) -> float:
        dof = bpy.context.scene.camera.data.dof
        if distance is not None:
            dof.focus_distance = distance
            with bpy.context.temp_override(window=window()):
                bpy.ops.ed.undo_push(message="Focus")
        return float(dof.focus_distance)

    def step(operator: str) -> None:
        with bpy.context.temp_override(window=window(), area=area("PROPERTIES")):
            getattr(bpy.ops.ed, operator)()
        seen.append(focus())

    focus(8.0)
    yield from live_on()
    # As a drag over the result sets it: without a step of its own.
    bpy.context.scene.camera.data.dof.focus_distance = 5.5
    yield 0.5
    yield from live_off("live")
    step("undo")
    yield 0.5
    step("redo")
    yield 0.5
    yield from live_on()
    focus(6.0)
    focus(7.0)
    yield 0.5
    step("undo")
    yield 0.2
    updates = live_session().updates
    bpy.context.scene.camera.data.dof.focus_distance = 4.0
    yield from wait(lambda: live_session().updates > updates, 20.0)
    seen.append(float(state().live))
    yield from live_off("end_live")
    SEEN["live"]["undo"] = [*seen, focus()]


def live_scenes() -> Iterator[float]:
    """Go to another scene and back."""
    first = bpy.context.scene
    yield from live_on()
    window().scene = bpy.data.scenes.new("Other")
    yield 0.5
    without_camera = state().live_message
    window().scene = first
    updates = live_session().updates
    first.camera.data.dof.focus_distance = 4.5
    yield from wait(lambda: live_session().updates > updates, 20.0)
    yield 0.5
    SEEN["live"]["scenes"] = [without_camera, state().live_message, state().live]
    yield from live_off("end_live")


def live_render() -> Iterator[float]:
    """Press Render while Live Focus is on: once to the end, and once with Esc over the result."""
    scene = bpy.context.scene
    seen = SEEN["live"]["render"] = {}
    yield from live_on()
    scene.render.resolution_x, scene.render.resolution_y = 480, 270
    click(RENDER_BUTTON)
    yield from wait(lambda: state().running, 10.0)
    yield from wait(lambda: not state().running, 120.0)
    yield 2.0
    image = bpy.data.images["Potmesil Result"]
    yield from wait(lambda: state().has_quality, 60.0)
    seen["size"] = [*image.size, state().live]
    scene.cycles.samples = 100_000
    click(RENDER_BUTTON)
    yield from wait(lambda: bpy.app.is_job_running("RENDER"), 10.0)
    yield 1.0
    region = next(r for r in area("IMAGE_EDITOR").regions if r.type == "WINDOW")
    middle = region.x + region.width // 2, region.y + region.height // 2
    event("MOUSEMOVE", "NOTHING", middle[0] - 9, middle[1])
    event("MOUSEMOVE", "NOTHING", *middle)
    event("ESC", "PRESS", *middle)
    event("ESC", "RELEASE", *middle)
    yield from wait(lambda: not state().running, 20.0)
    yield 1.0
    seen["escaped"] = [state().running, state().live, live_session() is not None]
    scene.cycles.samples = 4
    yield from live_off("end_live")


def live_window() -> Iterator[float]:
    """Close the window that Live Focus belongs to."""
    with bpy.context.temp_override(window=window()):
        bpy.ops.wm.window_new()
    yield 1.0
    other = bpy.context.window_manager.windows[-1]
    with bpy.context.temp_override(window=other):
        bpy.ops.potmesil.live("INVOKE_DEFAULT")
    yield from wait(lambda: live_session() is not None and live_session().updates > 0, 120.0)
    known = workers()
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()
    yield 1.0
    SEEN["live"]["left"]["window"] = [*left_over(known), *(["on"] if state().live else [])]


def live_extension() -> Iterator[float]:
    """Switch the extension off while Live Focus is on."""
    name = next(name for name in sys.modules if name.endswith(".potmesil_camera"))
    yield from live_on()
    known = workers()
    with bpy.context.temp_override(window=window()):
        bpy.ops.preferences.addon_disable(module=name)
    yield 1.0
    SEEN["live"]["left"]["extension"] = left_over(known)
    with bpy.context.temp_override(window=window()):
        bpy.ops.preferences.addon_enable(module=name)
    yield 1.0


def live_file() -> Iterator[float]:
    """Open a file while Live Focus is on; then quit while it is on."""
    blend = str(FOLDER / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend, copy=True)
    yield from live_on()
    known = workers()
    with bpy.context.temp_override(window=window()):
        bpy.ops.wm.open_mainfile(filepath=blend)
    yield 1.0
    SEEN["live"]["left"]["file"] = [*left_over(known), *(["on"] if state().live else [])]
    yield from live_on()
    SEEN["live"]["at_quit"] = workers()


def stage() -> Iterator[float]:
    """Put a stage into the compositor and render through it: by F12, by the panel, by Esc; remove it."""
    scene = bpy.context.scene
    seen = SEEN["stage"] = {}
    scene.cycles.samples = 16
    dof = scene.camera.data.dof
    dof.focus_distance, dof.aperture_fstop = 4.0, 0.05
    editor = area("IMAGE_EDITOR")
    editor.ui_type = "CompositorNodeTree"
    tree = artists_tree(scene)
    before = links(tree)
    with bpy.context.temp_override(window=window(), area=editor, region=editor.regions[-1]):
        bpy.ops.potmesil.add_stage("INVOKE_DEFAULT")
    editor.spaces.active.show_region_ui = True
    sidebar = next(r for r in editor.regions if r.type == "UI")
    yield 1.0
    sidebar.active_panel_category = "Potmesil"
    canvas = next(r for r in editor.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=editor, region=canvas):
        bpy.ops.node.view_all()
    yield 1.0
    shot("stage")
    middle = canvas.x + canvas.width // 3, canvas.y + canvas.height // 3
    event("MOUSEMOVE", "NOTHING", middle[0] - 9, middle[1])
    event("MOUSEMOVE", "NOTHING", *middle)
    event("F12", "PRESS", *middle)
    event("F12", "RELEASE", *middle)
    yield from wait(lambda: bpy.app.is_job_running("RENDER"), 20.0)
    yield from wait(lambda: not bpy.app.is_job_running("RENDER"), 300.0)
    yield 1.0
    seen["f12"] = composited(scene)
    seen["error"] = state().error
    shot("stage_f12")
    yield from pressed("process")
    seen["process"] = composited(scene)
    result = bpy.data.images["Potmesil Result"]
    seen["processed"] = 1.0 - sum(result.pixels[0::4]) / (result.size[0] * result.size[1])
    dof.focus_distance = 20.0
    yield from pressed("composite")
    seen["composite"] = composited(scene)
    yield from pressed("render")
    seen["render"] = [composited(scene), state().error]
    scene.cycles.samples = 100_000
    yield from pressed("render_animation", escape=middle)
    seen["render_animation"] = state().error
    seen["muted"] = [node.name for node in tree.nodes if node.mute]
    scene.cycles.samples = 4
    with bpy.context.temp_override(window=window(), area=area("PROPERTIES")):
        bpy.ops.potmesil.remove_stage("INVOKE_DEFAULT")
    yield 1.0
    shot("stage_removed")
    seen["links_back"] = links(tree) == before
    seen["scenes"] = bpy.data.scenes.keys()
    editor.ui_type = "IMAGE_EDITOR"
    scene.render.use_compositing = False


def pressed(operator: str, escape: tuple[int, int] | None = None) -> Iterator[float]:
    """Start an operator of ours as its button does, and wait for its end; or press Esc while it renders."""
    with bpy.context.temp_override(window=window(), area=area("PROPERTIES")):
        getattr(bpy.ops.potmesil, operator)("INVOKE_DEFAULT")
    if escape is not None:
        yield from wait(lambda: bpy.app.is_job_running("RENDER"), 10.0)
        yield 1.0
        event("ESC", "PRESS", *escape)
        event("ESC", "RELEASE", *escape)
    yield from wait(lambda: not state().running, 120.0)
    yield 0.5


def artists_tree(scene: Any) -> Any:
    """Make a compositor tree: an inverted picture through a reroute, and one that is seen in a Viewer."""
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("Grade", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    layers, reroute, invert, viewer = (
        tree.nodes.new(name)
        for name in ("CompositorNodeRLayers", "NodeReroute", "CompositorNodeInvert", "CompositorNodeViewer")
    )
    for node, x, y in ((reroute, 330, -60), (invert, 420, 60), (output, 680, 60), (viewer, 420, -160)):
        node.location = x, y
    color = next(socket for socket in invert.inputs if socket.type == "RGBA")
    for start, end in ((layers, reroute.inputs[0]), (reroute, color), (invert, output.inputs[0])):
        tree.links.new(start.outputs[0], end)
    tree.links.new(reroute.outputs[0], viewer.inputs[0])
    return tree


def links(tree: Any) -> list[list[str]]:
    """Return what is connected with what."""
    return sorted(
        [link.from_node.name, link.from_socket.name, link.to_node.name, link.to_socket.name]
        for link in tree.links
    )


def composited(scene: Any) -> float:
    """Return the mean of red over what the compositor made."""
    path = str(FOLDER / "composited.exr")
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    bpy.data.images["Render Result"].save_render(path, scene=scene)
    settings.file_format, settings.color_depth = "PNG", "8"
    image = bpy.data.images.load(path)
    mean = sum(image.pixels[0::4]) / (image.size[0] * image.size[1])
    bpy.data.images.remove(image)
    return float(mean)


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

    bpy.app.timers.register(tick, first_interval=3.0, persistent=True)


main()
