"""Scenes with one kind of motion each, rendered at `FRAME`, for measuring motion blur.

The camera stands at the origin and looks along +y; a unit at depth D is `FOCAL_PIXELS` / D pixels wide.
Colours are emitted, so that few samples give a reference without noise and nothing casts a shadow.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import bpy

# isort: split
# The module bpy brings these with it.
import bmesh
from mathutils import Matrix, Vector

COLUMNS, ROWS = 480, 270
FRAME = 10
LENS_MM, SENSOR_MM = 35.0, 36.0
FOCAL_PIXELS = COLUMNS * LENS_MM / SENSOR_MM

_MOTION_STEPS = 6
"""Cycles follows 2 ** (steps - 1) pieces of a path within the shutter."""

_KEYS_A_FRAME = 16
"""Keys of a motion that is given as a function of time."""

Color = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Exposure:
    """Blender's shutter settings of a scene.

    Parameters
    ----------
    frames : float
        Time that the shutter is open.
    position : {"CENTER", "START", "END"}
        Where the frame's own time lies in it.
    curve : tuple of (float, float)
        Points of the shutter curve, joined by straight lines; empty for Blender's own, open all the time.
    rolling : float or None
        Cycles' rolling shutter duration, the share of the time that a row is exposed.
    """

    frames: float = 0.5
    position: str = "CENTER"
    curve: tuple[tuple[float, float], ...] = ()
    rolling: float | None = None


@dataclass(frozen=True, slots=True)
class MotionScene:
    """A scene of the benchmark.

    Parameters
    ----------
    name : str
        For files and tables.
    build : callable
        Fills an empty scene; its docstring says what the scene is for.
    exposure : Exposure
        The shutter.
    bounces : int
        Bounces of light.
    """

    name: str
    build: Callable[[bpy.types.Scene], None]
    exposure: Exposure = field(default_factory=Exposure)
    bounces: int = 0

    @property
    def purpose(self) -> str:
        """What the scene is for, in a line."""
        return " ".join((self.build.__doc__ or "").split())

    def key(self) -> str:
        """Return a hash of everything that the scene's picture depends on."""
        facts = {
            "exposure": asdict(self.exposure),
            "bounces": self.bounces,
            "constants": {name: repr(value) for name, value in globals().items() if name in _CONSTANTS},
            "sources": _sources(self.build, {}) | _sources(open_scene, {}),
        }
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


SCENES: dict[str, MotionScene] = {}

_CONSTANTS = (
    "COLUMNS", "ROWS", "FRAME", "LENS_MM", "SENSOR_MM", "_MOTION_STEPS", "_KEYS_A_FRAME",
    "RED", "BLUE", "GREEN", "OCHRE", "DARK", "CREAM", "PAIRS",
)  # fmt: skip
"""What a picture depends on beside the functions that make the scene."""


def open_scene(item: MotionScene) -> bpy.types.Scene:
    """Replace everything in Blender's current file by a scene of the benchmark.

    Parameters
    ----------
    item : MotionScene
        Which one.

    Returns
    -------
    Scene
        At `FRAME`, with motion blur on.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.name = item.name
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = COLUMNS, ROWS, 100
    render.use_motion_blur = True
    _expose(scene, item.exposure)
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = item.bounces
    scene.cycles.sample_clamp_indirect = 0.0
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("World")

    camera = bpy.data.cameras.new("Camera")
    camera.lens, camera.sensor_width = LENS_MM, SENSOR_MM
    camera.clip_start, camera.clip_end = 0.05, 200.0
    camera.dof.focus_distance = 5.0
    view = bpy.data.objects.new("Camera", camera)
    view.rotation_euler = (math.radians(90.0), 0.0, 0.0)
    scene.collection.objects.link(view)
    scene.camera = view

    item.build(scene)
    for index, thing in enumerate((o for o in scene.objects if o.type == "MESH"), start=1):
        thing.pass_index = index
    for thing in scene.objects:
        thing.cycles.use_motion_blur = True
        thing.cycles.use_deform_motion = True
        thing.cycles.motion_steps = _MOTION_STEPS
    scene.frame_set(FRAME)
    return scene


def _sources(function: Callable[..., Any], found: dict[str, str]) -> dict[str, str]:
    """Return the source of a function and of all functions of this module that it calls."""
    if function.__name__ not in found:
        found[function.__name__] = inspect.getsource(function)
        for name in function.__code__.co_names:
            called = globals().get(name)
            if inspect.isfunction(called) and called.__module__ == __name__:
                _sources(called, found)
    return found


def _scene(
    exposure: Exposure | None = None, bounces: int = 0
) -> Callable[[Callable[[bpy.types.Scene], None]], Callable[[bpy.types.Scene], None]]:
    """Enter a scene into `SCENES` under its builder's name."""

    def enter(build: Callable[[bpy.types.Scene], None]) -> Callable[[bpy.types.Scene], None]:
        name = build.__name__
        SCENES[name] = MotionScene(name, build, exposure or Exposure(), bounces)
        return build

    return enter


# The scenes.


@_scene()
def translation(scene: bpy.types.Scene) -> None:
    """Move a ball across a detailed wall: the plainest motion blur there is."""
    _wall(scene)
    _glide(_ball(scene, "Ball", (0.0, 5.0, 0.0), 0.6, _checker("Ball", RED, CREAM, 5.0)), (80.0, 0.0, 30.0))


@_scene()
def rotation(scene: bpy.types.Scene) -> None:
    """Turn a fan of four thin blades by 60 degrees: paths are arcs, and the blades leave gaps."""
    _wall(scene)
    fan = _fan(scene, (0.0, 5.0, 0.0))
    _keys(fan, "rotation_euler", 1, [(t, math.radians(120.0) * (t - FRAME)) for t in (8, 12)])


@_scene()
def acceleration(scene: bpy.types.Scene) -> None:
    """Start one ball and stop another within the shutter: blur is dense where they are slow."""
    _wall(scene)
    start = _ball(scene, "Starting", (-1.0, 5.0, 0.6), 0.4, _checker("Starting", RED, CREAM, 6.0))
    stop = _ball(scene, "Stopping", (0.4, 5.0, -0.6), 0.4, _checker("Stopping", BLUE, CREAM, 6.0))
    span = _units(240.0, 5.0)
    _follow(start, "location", 0, lambda t: -0.9 + span * _ease(t - 9.75))
    _follow(stop, "location", 0, lambda t: 0.9 - span * _ease(10.25 - t))


@_scene()
def curved_path(scene: bpy.types.Scene) -> None:
    """Carry a ball round an arc of 100 degrees without turning it: each point's path is bent."""
    _wall(scene)
    ball = _ball(scene, "Ball", (0.0, 5.0, 0.0), 0.3, _checker("Ball", RED, CREAM, 8.0))
    turn = math.radians(200.0)
    _follow(ball, "location", 0, lambda t: 0.85 * math.sin(turn * (t - FRAME)))
    _follow(ball, "location", 2, lambda t: 0.85 * math.cos(turn * (t - FRAME)) - 0.3)


@_scene()
def camera_pan(scene: bpy.types.Scene) -> None:
    """Pan the camera 5 degrees over columns, small lamps and an open sky: all of the picture moves."""
    _sky(scene)
    _colonnade(scene)
    _keys(scene.camera, "rotation_euler", 2, [(t, math.radians(10.0) * (t - FRAME)) for t in (8, 12)])


@_scene()
def camera_dolly(scene: bpy.types.Scene) -> None:
    """Slide the camera past near and far things: parallax, and background that only the blur shows."""
    _wall(scene, depth=12.0)
    for number, (x, depth) in enumerate(((-0.55, 2.0), (0.35, 2.6), (-0.3, 4.0), (1.2, 4.5), (0.6, 7.0))):
        _post(scene, f"Post {number}", (x, depth, 0.0), 0.09, _checker(f"Post {number}", *PAIRS[number], 9.0))
    _ball(scene, "Ball", (0.0, 3.2, -0.2), 0.3, _checker("Ball", RED, CREAM, 8.0))
    _keys(scene.camera, "location", 0, [(t, 0.4 * (t - FRAME)) for t in (8, 12)])


@_scene()
def approach(scene: bpy.types.Scene) -> None:
    """Fly a ball towards the camera: it grows, and its points move faster the nearer they are."""
    _wall(scene)
    ball = _ball(scene, "Ball", (0.45, 3.5, 0.2), 0.5, _checker("Ball", RED, CREAM, 6.0))
    _keys(ball, "location", 1, [(t, 3.5 - 2.0 * (t - FRAME)) for t in (9, 11)])
    near = _ball(scene, "Aside", (-1.4, 4.0, -0.5), 0.35, _checker("Aside", BLUE, CREAM, 8.0))
    _keys(near, "location", 1, [(t, 4.0 - 2.2 * (t - FRAME)) for t in (9, 11)])


@_scene()
def deformation(scene: bpy.types.Scene) -> None:
    """Run waves over a flag: its points move, its matrix does not."""
    _wall(scene)
    _flag(scene, (0.0, 5.0, 0.0))


@_scene()
def occluder(scene: bpy.types.Scene) -> None:
    """Move a ball behind posts and in front of a wall: it must show between the posts and never on them."""
    _wall(scene)
    for number, (x, radius) in enumerate(((-0.75, 0.06), (-0.2, 0.12), (0.25, 0.04), (0.7, 0.09))):
        _post(
            scene, f"Post {number}", (x, 4.0, 0.0), radius, _checker(f"Post {number}", *PAIRS[number], 12.0)
        )
    ball = _ball(scene, "Ball", (0.0, 6.0, 0.0), 0.8, _checker("Ball", RED, CREAM, 4.0))
    _glide(ball, (90.0, 0.0, -20.0))


@_scene()
def crossing(scene: bpy.types.Scene) -> None:
    """Cross two movers at different depths: the one in front hides the other for a part of the time."""
    _wall(scene)
    near = _ball(scene, "Near", (-0.25, 4.0, 0.1), 0.4, _checker("Near", RED, CREAM, 7.0))
    far = _box(scene, "Far", (0.25, 6.0, -0.1), (0.9, 0.3, 0.9), _checker("Far", BLUE, CREAM, 5.0))
    _glide(near, (110.0, 0.0, 0.0))
    _glide(far, (-100.0, 0.0, 40.0))


@_scene()
def border(scene: bpy.types.Scene) -> None:
    """Sweep thin rods across the frame's border: half of their light comes from outside the picture."""
    _wall(scene)
    upright = _post(scene, "Upright", (-2.5, 5.0, 0.0), 0.08, _checker("Upright", RED, CREAM, 4.0))
    _glide(upright, (120.0, 0.0, 0.0))
    lying = _box(scene, "Lying", (0.8, 5.0, 1.4), (2.2, 0.1, 0.16), _plain("Lying", CREAM, 1.5))
    _glide(lying, (0.0, 0.0, -90.0))


@_scene()
def small_mover(scene: bpy.types.Scene) -> None:
    """Shoot a small bright ball through a still room: every other pixel must stay as it is."""
    _wall(scene)
    _post(scene, "Post", (0.9, 4.0, 0.0), 0.1, _checker("Post", *PAIRS[2], 9.0))
    ball = _ball(scene, "Ball", (0.0, 5.0, 0.3), 0.07, _plain("Ball", (1.0, 0.8, 0.3), 3.0))
    _glide(ball, (130.0, 0.0, 50.0))


@_scene()
def camera_and_object(scene: bpy.types.Scene) -> None:
    """Follow a box with the camera: the box is nearly sharp, turns slowly, and the room streaks by."""
    _colonnade(scene)
    _wall(scene, depth=12.0)
    box = _box(scene, "Box", (0.0, 3.5, 0.0), (0.7, 0.7, 0.7), _checker("Box", RED, CREAM, 6.0))
    _keys(box, "location", 0, [(t, 0.55 * (t - FRAME)) for t in (8, 12)])
    _keys(box, "rotation_euler", 2, [(t, 0.5 + 0.35 * (t - FRAME)) for t in (8, 12)])
    _keys(scene.camera, "rotation_euler", 2, [(t, -math.radians(8.5) * (t - FRAME)) for t in (8, 12)])


@_scene(Exposure(position="START"))
def shutter_start(scene: bpy.types.Scene) -> None:
    """Open the shutter at the frame: all of the blur lies ahead of where the ball is seen."""
    translation(scene)


@_scene(Exposure(curve=((0.0, 0.0), (0.5, 1.0), (1.0, 0.0))))
def shutter_curve(scene: bpy.types.Scene) -> None:
    """Open and close the shutter slowly: the blur fades at both ends."""
    _wall(scene)
    _glide(_ball(scene, "Ball", (-0.6, 5.0, 0.4), 0.4, _checker("Ball", RED, CREAM, 6.0)), (120.0, 0.0, 0.0))
    rod = _box(scene, "Rod", (0.6, 5.0, -0.1), (0.08, 0.08, 1.6), _plain("Rod", CREAM))
    _glide(rod, (-140.0, 0.0, 0.0))


@_scene(Exposure(frames=1.0, rolling=0.15))
def rolling_shutter(scene: bpy.types.Scene) -> None:
    """Expose row after row while the camera pans and a rod passes: upright things lean."""
    _wall(scene, depth=12.0)
    for number, x in enumerate((-1.6, -0.5, 0.6, 1.7)):
        _post(scene, f"Post {number}", (x, 5.0, 0.0), 0.09, _checker(f"Post {number}", *PAIRS[number], 9.0))
    rod = _post(scene, "Rod", (0.1, 4.0, 0.0), 0.05, _checker("Rod", RED, CREAM, 8.0))
    _glide(rod, (-90.0, 0.0, 0.0))
    _keys(scene.camera, "rotation_euler", 2, [(t, math.radians(6.0) * (t - FRAME)) for t in (8, 12)])


@_scene()
def lit(scene: bpy.types.Scene) -> None:
    """Light moving and turning things by a sun, without shadows: their shading stays where the light is."""
    _wall(scene, lit=True)
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle, sun.use_shadow = 3.0, 0.0, False
    lamp = bpy.data.objects.new("Sun", sun)
    lamp.rotation_euler = (math.radians(50.0), math.radians(-20.0), math.radians(20.0))
    scene.collection.objects.link(lamp)
    ball = _ball(scene, "Ball", (-0.7, 5.0, 0.2), 0.5, _checker("Ball", RED, CREAM, 6.0, lit=True))
    _glide(ball, (90.0, 0.0, 20.0))
    box = _box(scene, "Box", (0.9, 5.0, -0.2), (0.8, 0.8, 0.8), _checker("Box", BLUE, CREAM, 5.0, lit=True))
    box.rotation_euler[0] = 0.4
    _keys(box, "rotation_euler", 2, [(t, 0.4 + math.radians(60.0) * (t - FRAME)) for t in (8, 12)])


# What they are made of.

RED: Color = (0.75, 0.08, 0.05)
BLUE: Color = (0.06, 0.18, 0.70)
GREEN: Color = (0.10, 0.45, 0.12)
OCHRE: Color = (0.60, 0.36, 0.06)
DARK: Color = (0.03, 0.03, 0.05)
CREAM: Color = (0.90, 0.82, 0.62)
PAIRS: tuple[tuple[Color, Color], ...] = (
    (GREEN, DARK),
    (OCHRE, CREAM),
    (DARK, OCHRE),
    (BLUE, GREEN),
    (GREEN, CREAM),
)


def _units(pixels: float, depth: float) -> float:
    """Return how many units are as wide as a number of pixels at a depth."""
    return pixels * depth / FOCAL_PIXELS


def _ease(t: float) -> float:
    """Return how far something is that starts at 0 and is then ever faster, 1 after a frame."""
    return max(t, 0.0) ** 2


def _expose(scene: bpy.types.Scene, exposure: Exposure) -> None:
    render = scene.render
    render.motion_blur_shutter = exposure.frames
    render.motion_blur_position = exposure.position
    if exposure.curve:
        mapping = render.motion_blur_shutter_curve
        points = mapping.curves[0].points
        while len(points) > 2:
            points.remove(points[1])
        while len(points) < len(exposure.curve):
            points.new(0.5, 0.5)
        for point, place in zip(points, exposure.curve, strict=True):
            point.location = place
            point.handle_type = "VECTOR"
        mapping.update()
    if exposure.rolling is not None:
        scene.cycles.rolling_shutter_type = "TOP"
        scene.cycles.rolling_shutter_duration = exposure.rolling


def _keys(
    thing: bpy.types.Object, path: str, axis: int, keys: Sequence[tuple[float, float]], name: str = "LINEAR"
) -> None:
    """Animate a component of a thing's place or turn, by default evenly."""
    for time, value in keys:
        getattr(thing, path)[axis] = value
        thing.keyframe_insert(path, index=axis, frame=time)
    # The preference for new keys is not obeyed without a window.
    animation = thing.animation_data
    for layer in animation.action.layers:
        for strip in layer.strips:
            for curve in strip.channelbag(animation.action_slot).fcurves:
                if (curve.data_path, curve.array_index) == (path, axis):
                    for point in curve.keyframe_points:
                        point.interpolation = name


def _follow(thing: bpy.types.Object, path: str, axis: int, place: Callable[[float], float]) -> None:
    """Animate a component by a function of time, from a frame before to a frame after."""
    times = [FRAME + n / _KEYS_A_FRAME for n in range(-_KEYS_A_FRAME, _KEYS_A_FRAME + 1)]
    _keys(thing, path, axis, [(time, place(time)) for time in times])


def _glide(thing: bpy.types.Object, pixels: tuple[float, float, float]) -> None:
    """Move a thing evenly, so many pixels a frame at its own depth."""
    for axis, speed in enumerate(pixels):
        if speed:
            here = thing.location[axis]
            step = _units(speed, thing.location[1])
            _keys(thing, "location", axis, [(t, here + step * (t - FRAME)) for t in (8, 12)])


def _link(
    scene: bpy.types.Scene,
    name: str,
    shape: bmesh.types.BMesh,
    place: tuple[float, float, float],
    material: bpy.types.Material,
    *,
    smooth: bool = False,
) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    if smooth:
        mesh.shade_smooth()
    mesh.materials.append(material)
    thing = bpy.data.objects.new(name, mesh)
    thing.location = place
    scene.collection.objects.link(thing)
    return thing


def _ball(
    scene: bpy.types.Scene,
    name: str,
    place: tuple[float, float, float],
    radius: float,
    material: bpy.types.Material,
) -> bpy.types.Object:
    shape = bmesh.new()
    bmesh.ops.create_uvsphere(shape, u_segments=64, v_segments=32, radius=radius)
    return _link(scene, name, shape, place, material, smooth=True)


def _box(
    scene: bpy.types.Scene,
    name: str,
    place: tuple[float, float, float],
    size: tuple[float, float, float],
    material: bpy.types.Material,
) -> bpy.types.Object:
    shape = bmesh.new()
    bmesh.ops.create_cube(shape, size=1.0, matrix=Matrix.Diagonal((*size, 1.0)))
    return _link(scene, name, shape, place, material)


def _post(
    scene: bpy.types.Scene,
    name: str,
    place: tuple[float, float, float],
    radius: float,
    material: bpy.types.Material,
) -> bpy.types.Object:
    """Add an upright rod that is taller than the picture."""
    shape = bmesh.new()
    bmesh.ops.create_cone(
        shape, cap_ends=True, segments=48, radius1=radius, radius2=radius, depth=1.4 * place[1]
    )
    return _link(scene, name, shape, place, material)


def _wall(scene: bpy.types.Scene, depth: float = 8.0, *, lit: bool = False) -> bpy.types.Object:
    """Add a detailed wall that is larger than what any camera here sees."""
    shape = bmesh.new()
    matrix = Matrix.Rotation(math.radians(90.0), 4, "X")
    bmesh.ops.create_grid(shape, x_segments=1, y_segments=1, size=depth, matrix=matrix)
    return _link(scene, "Wall", shape, (0.0, depth, 0.0), _patchwork("Wall", 24.0 / depth, lit=lit))


def _fan(scene: bpy.types.Scene, place: tuple[float, float, float]) -> bpy.types.Object:
    shape = bmesh.new()
    blade = Matrix.Translation((0.6, 0.0, 0.0)) @ Matrix.Diagonal((1.1, 0.02, 0.12, 1.0))
    for number in range(4):
        turn = Matrix.Rotation(math.radians(90.0 * number + 20.0), 4, "Y")
        bmesh.ops.create_cube(shape, size=1.0, matrix=turn @ blade)
    return _link(scene, "Fan", shape, place, _checker("Fan", RED, CREAM, 7.0))


def _colonnade(scene: bpy.types.Scene) -> None:
    """Add columns and small lamps from near to far, over a floor."""
    shape = bmesh.new()
    bmesh.ops.create_grid(shape, x_segments=1, y_segments=1, size=8.0)
    _link(scene, "Floor", shape, (0.0, 8.0, -1.0), _checker("Floor", OCHRE, DARK, 1.3))
    places = ((-1.2, 3.0), (1.1, 3.6), (-0.4, 5.0), (2.4, 6.0), (-3.4, 7.0), (0.9, 9.0), (-2.0, 11.0))
    for number, (x, depth) in enumerate(places):
        pair = PAIRS[number % len(PAIRS)]
        _box(
            scene,
            f"Column {number}",
            (x, depth, -0.1),
            (0.3, 0.3, 1.8),
            _checker(f"Column {number}", *pair, 7.0),
        )
        lamp = _plain(f"Lamp {number}", (1.0, 0.85, 0.5), 6.0)
        _ball(scene, f"Lamp {number}", (x + 0.5, depth + 0.4, 0.35), 0.04, lamp)


def _flag(scene: bpy.types.Scene, place: tuple[float, float, float]) -> bpy.types.Object:
    """Add a flag, held on the left, with waves that run along it by two shape keys in turn."""
    shape = bmesh.new()
    matrix = Matrix.Rotation(math.radians(90.0), 4, "X") @ Matrix.Diagonal((1.0, 0.65, 1.0, 1.0))
    bmesh.ops.create_grid(shape, x_segments=60, y_segments=20, size=1.3, matrix=matrix, calc_uvs=False)
    layer = shape.loops.layers.uv.new("Flag")
    for face in shape.faces:
        for loop in face.loops:
            loop[layer].uv = (loop.vert.co.x, loop.vert.co.z)
    flag = _link(
        scene, "Flag", shape, place, _checker("Flag", RED, CREAM, 4.0, coordinates="UV"), smooth=True
    )
    flag.shape_key_add(name="Rest")
    for name, phase in (("Sine", 0.0), ("Cosine", 0.5 * math.pi)):
        key = flag.shape_key_add(name=name)
        key.slider_min = -1.0
        for point in key.data:
            x, _, z = point.co
            held = (x + 1.3) / 2.6
            wave = held * math.sin(4.0 * x + phase)
            point.co = Vector((x + 0.1 * wave, 0.5 * wave, z + 0.45 * wave))
    keys = flag.data.shape_keys.key_blocks
    for step in range(-_KEYS_A_FRAME, _KEYS_A_FRAME + 1):
        angle = math.radians(60.0) * step / _KEYS_A_FRAME
        for name, value in (("Sine", math.cos(angle)), ("Cosine", math.sin(angle))):
            keys[name].value = value
            keys[name].keyframe_insert("value", frame=FRAME + step / _KEYS_A_FRAME)
    return flag


# What they look like.


def _material(name: str, *, lit: bool) -> tuple[bpy.types.Material, Any, Any]:
    """Return a new material, its nodes, and the socket that takes its colour."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse" if lit else "ShaderNodeEmission")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material, tree, shader.inputs["Color"]


def _plain(name: str, color: Color, strength: float = 1.0) -> bpy.types.Material:
    material, _, socket = _material(name, lit=False)
    socket.default_value = (*(strength * c for c in color), 1.0)
    return material


def _coordinates(tree: Any, kind: str = "Object") -> Any:
    """Return texture coordinates that are nowhere on the edge between two checks of a flat face."""
    place = tree.nodes.new("ShaderNodeTexCoord")
    shift = tree.nodes.new("ShaderNodeMapping")
    shift.inputs["Location"].default_value = (0.0137, 0.0119, 0.0171)
    tree.links.new(place.outputs[kind], shift.inputs["Vector"])
    return shift.outputs[0]


def _checker(
    name: str, first: Color, second: Color, scale: float, *, lit: bool = False, coordinates: str = "Object"
) -> bpy.types.Material:
    """Return checks of two colours, so many to a unit."""
    material, tree, socket = _material(name, lit=lit)
    checks = tree.nodes.new("ShaderNodeTexChecker")
    checks.inputs["Scale"].default_value = scale
    checks.inputs["Color1"].default_value = (*first, 1.0)
    checks.inputs["Color2"].default_value = (*second, 1.0)
    tree.links.new(_coordinates(tree, coordinates), checks.inputs["Vector"])
    tree.links.new(checks.outputs["Color"], socket)
    return material


def _patchwork(name: str, scale: float, *, lit: bool = False) -> bpy.types.Material:
    """Return coloured cells under fine checks: detail at every size."""
    material, tree, socket = _material(name, lit=lit)
    place = _coordinates(tree)
    cells = tree.nodes.new("ShaderNodeTexVoronoi")
    cells.inputs["Scale"].default_value = scale
    checks = tree.nodes.new("ShaderNodeTexChecker")
    checks.inputs["Scale"].default_value = 2.3 * scale
    checks.inputs["Color1"].default_value = (0.42, 0.42, 0.42, 1.0)
    checks.inputs["Color2"].default_value = (0.14, 0.14, 0.16, 1.0)
    both = tree.nodes.new("ShaderNodeVectorMath")
    both.operation = "MULTIPLY"
    for texture in (cells, checks):
        tree.links.new(place, texture.inputs["Vector"])
    tree.links.new(cells.outputs["Color"], both.inputs[0])
    tree.links.new(checks.outputs["Color"], both.inputs[1])
    tree.links.new(both.outputs[0], socket)
    return material


def _sky(scene: bpy.types.Scene) -> None:
    """Give the world clouds: detail where there is no surface."""
    tree = scene.world.node_tree
    tree.nodes.clear()
    place = tree.nodes.new("ShaderNodeTexCoord")
    clouds = tree.nodes.new("ShaderNodeTexVoronoi")
    clouds.inputs["Scale"].default_value = 18.0
    tint = tree.nodes.new("ShaderNodeVectorMath")
    tint.operation = "MULTIPLY_ADD"
    tint.inputs[1].default_value = (0.5, 0.45, 0.3)
    tint.inputs[2].default_value = (0.05, 0.12, 0.3)
    shader = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(place.outputs["Generated"], clouds.inputs["Vector"])
    tree.links.new(clouds.outputs["Distance"], tint.inputs[0])
    tree.links.new(tint.outputs[0], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
