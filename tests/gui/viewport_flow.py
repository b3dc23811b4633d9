"""What a hand does in the 3D viewport: looks at the planes, drags the handle, undoes, focuses on objects.

The driver runs it inside a Blender with a window: ``yield from viewport(hand, SEEN)``, where `hand` has the
driver's `window`, `event` and `shot` and the `folder` of its pictures. It works in a scene of its own, and
puts back the scene and the area.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix, Vector

DRAG = 120
"""Pixels that the handle is dragged by."""

COLORS = (1.0, 0.45, 0.1), (0.2, 0.9, 0.4), (0.2, 0.5, 1.0)
"""Of the near limit, the plane in focus and the far limit."""

DISTANCE = 6.0
"""At which the camera is focused at first."""

STEPS = 6


def scene_to_focus() -> Any:
    """Make a scene with a camera that looks along +y at a row of boxes, 3 to 13 m away."""
    scene = bpy.data.scenes.new("Focus")
    mesh = bpy.data.meshes.new("Box")
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    for number in range(6):
        item = bpy.data.objects.new(f"Box {number}", mesh)
        item.location = -0.9 + 0.45 * number, 3.0 + 2.0 * number, -0.5
        scene.collection.objects.link(item)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.rotation_euler = math.pi / 2, 0.0, 0.0
    camera.data.dof.focus_distance = DISTANCE
    camera.data.dof.aperture_fstop = 2.8
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 1500, 1000
    return scene


def camera() -> Any:
    """Return the scene's camera: undo makes new objects."""
    return bpy.context.window_manager.windows[0].scene.camera


def distance() -> float:
    """Return what the camera is focused at."""
    return float(camera().data.dof.focus_distance)


class Viewport:
    """A 3D viewport in place of the window's largest area."""

    def __init__(self, hand: Any) -> None:
        self.hand = hand
        self.area = max(hand.window().screen.areas, key=lambda area: area.width * area.height)
        self.before = self.area.ui_type
        self.area.ui_type = "VIEW_3D"
        space = self.area.spaces.active
        space.shading.type = "SOLID"
        space.show_region_ui = True
        view = space.region_3d
        view.view_perspective = "PERSP"
        view.view_location = 0.5, 6.0, 0.0
        view.view_rotation = (Matrix.Rotation(0.9, 3, "Z") @ Matrix.Rotation(1.15, 3, "X")).to_quaternion()
        view.view_distance = 16.0

    def region(self, kind: str = "WINDOW") -> Any:
        """Return a region of the area."""
        return next(region for region in self.area.regions if region.type == kind)

    def pixel(self, place: Vector) -> tuple[int, int]:
        """Return where in the window a place of the world is."""
        region = self.region()
        x, y = location_3d_to_region_2d(region, self.area.spaces.active.region_3d, place)
        return region.x + round(x), region.y + round(y)

    def handle(self) -> tuple[tuple[int, int], Vector]:
        """Return where in the window the handle is, and its direction there."""
        foot = Vector(self.pixel(Vector((0.0, distance(), 0.0))))
        along = (Vector(self.pixel(Vector((0.0, distance() + 1.0, 0.0)))) - foot).normalized()
        # The box stands off the plane.
        x, y = foot + along * 35.0
        return (round(x), round(y)), along

    def call(self, operators: Any, name: str, *arguments: Any, **settings: Any) -> None:
        """Run an operator as from this viewport."""
        with bpy.context.temp_override(window=self.hand.window(), area=self.area, region=self.region()):
            getattr(operators, name)(*arguments, **settings)


def colored(view: Viewport, name: str) -> list[int]:
    """Take a picture, and return how many of its pixels have the planes' colours: near, focus, far."""
    view.hand.shot(name)
    image = bpy.data.images.load(str(view.hand.folder / f"{name}.png"))
    columns, rows = image.size
    pixels = np.empty(rows * columns * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    region = view.region()
    x, y = region.x, region.y
    # Left of the sidebar and below the view's axes, whose colours are alike.
    right, top = view.region("UI").x, y + 3 * region.height // 4
    shown = pixels.reshape(rows, columns, 4)[y:top, x:right]
    return [int((np.abs(shown[..., :3] - color).max(axis=-1) < 0.12).sum()) for color in COLORS]


def dragged(view: Viewport, found: dict[str, Any]) -> Iterator[float]:
    """Drag the handle away from the camera; take it back; drag, and let it be with Esc."""
    for name in ("dragged", "escaped"):
        before = distance()
        place, along = view.handle()
        yield from moved(view, Vector(place), along, escape=name == "escaped")
        found[name] = [before, distance()]
        view.hand.shot(f"viewport_{name}")
        if name == "dragged":
            view.call(bpy.ops.ed, "undo")
            yield 0.5
            found["undone"] = distance()


def moved(view: Viewport, start: Vector, along: Vector, *, escape: bool) -> Iterator[float]:
    """Press at a place, move the mouse, and let go or press Esc."""
    event = view.hand.event
    x, y = round(start.x), round(start.y)
    event("MOUSEMOVE", "NOTHING", x - 3, y)
    event("MOUSEMOVE", "NOTHING", x, y)
    yield 0.5
    event("LEFTMOUSE", "PRESS", x, y)
    yield 0.2
    for step in range(1, STEPS + 1):
        x, y = (round(value) for value in start + along * (DRAG * step / STEPS))
        event("MOUSEMOVE", "NOTHING", x, y)
        yield 0.1
    if escape:
        event("ESC", "PRESS", x, y)
        event("ESC", "RELEASE", x, y)
        yield 0.2
    event("LEFTMOUSE", "RELEASE", x, y)
    yield 0.7


def focused(view: Viewport, found: dict[str, Any]) -> Iterator[float]:
    """Focus on an object, track another and let go of it, as the sidebar's buttons do; undo each."""
    objects = view.hand.window().view_layer.objects
    objects.active = bpy.data.objects["Box 3"]
    view.call(bpy.ops.potmesil, "focus_on_active", "INVOKE_DEFAULT", True)
    yield 0.5
    found["focused"] = distance()
    view.call(bpy.ops.ed, "undo")
    yield 0.5
    found["unfocused"] = distance()
    view.hand.window().view_layer.objects.active = bpy.data.objects["Box 4"]
    view.call(bpy.ops.potmesil, "track_object", "INVOKE_DEFAULT", True)
    yield 0.7
    found["tracked"] = camera().data.dof.focus_object.name
    view.hand.shot("viewport_tracked")
    # There is nothing to drag now: the mouse selects what is there.
    before = distance()
    place, along = view.handle()
    yield from moved(view, Vector(place), along, escape=True)
    found["tracked_dragged"] = [before, distance()]
    view.call(bpy.ops.potmesil, "stop_tracking", "INVOKE_DEFAULT", True)
    yield 0.5
    found["stopped"] = [camera().data.dof.focus_object is None, distance()]


def viewport(hand: Any, seen: dict[str, Any]) -> Iterator[float]:
    """Do all of it; each number is a pause in seconds.

    Parameters
    ----------
    hand : object
        The driver's `window`, `event` and `shot`, and the `folder` of its pictures.
    seen : dict
        What happened goes to ``seen["viewport"]``.
    """
    found = seen["viewport"] = {}
    window = hand.window()
    first = window.scene.name
    window.scene = scene_to_focus()
    view = Viewport(hand)
    yield 1.0
    view.region("UI").active_panel_category = "Potmesil"
    yield 0.5
    window.view_layer.objects.active = bpy.data.objects["Box 2"]
    found["off"] = colored(view, "viewport_off")
    window.scene.potmesil_camera.show_limits = True
    yield 1.0
    found["on"] = colored(view, "viewport")
    view.call(bpy.ops.ed, "undo_push", message="Before")
    yield from dragged(view, found)
    yield from focused(view, found)
    yield from switched_off(view, found)
    hand.window().scene = bpy.data.scenes[first]
    view.area.spaces.active.show_region_ui = False
    view.area.ui_type = view.before
    bpy.data.scenes.remove(bpy.data.scenes["Focus"])
    yield 0.5


def switched_off(view: Viewport, found: dict[str, Any]) -> Iterator[float]:
    """Switch the extension off, and on again."""
    name = next(name for name in sys.modules if name.endswith(".potmesil_camera"))
    # What is selected has an outline of the near limit's colour.
    view.call(bpy.ops.object, "select_all", action="DESELECT")
    view.call(bpy.ops.preferences, "addon_disable", module=name)
    yield 1.0
    found["disabled"] = colored(view, "viewport_disabled")
    view.call(bpy.ops.preferences, "addon_enable", module=name)
    yield 1.0
    found["enabled"] = colored(view, "viewport_enabled")
