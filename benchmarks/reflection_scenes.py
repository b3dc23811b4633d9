"""Scenes whose reflections and refractions are blurred otherwise than the surface that they are seen in.

Three are new: a puddle at night (once more with a cyclist passing), a shop window, and chrome things on a
polished base. The others are the papers' carafes and mirror. What glows is large and lights nothing: lamps
do that, so that references converge. One Blender unit is one metre.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from types import CodeType, ModuleType
from typing import Any

import bpy

from sample_scenes import building, carafe, mirror
from sample_scenes.building import Color, Vector3

COLUMNS, ROWS = 480, 270
SENSOR_MM = 36.0
FRAME = 10

_SAMPLES = 128
_BOUNCES = 6
_CLAMP = 10.0
"""Of indirect light: reflected lights keep their brightness, and chance hits do not become fireflies."""

_MOTION_STEPS = 6
"""Cycles follows 2 ** (steps - 1) pieces of a path within the shutter."""

_STILL: Vector3 = (0.0, 0.0, 0.0)
_UPRIGHT: Vector3 = (90.0, 0.0, 0.0)

_WATER_IOR = 1.33
_GLASS_IOR = 1.45

_DARK: Color = (0.02, 0.022, 0.028)
_CREAM: Color = (0.75, 0.70, 0.58)
_RED: Color = (0.62, 0.06, 0.04)
_BLUE: Color = (0.05, 0.13, 0.45)
_GREEN: Color = (0.06, 0.30, 0.10)
_OCHRE: Color = (0.65, 0.38, 0.07)

_MAGENTA_LIGHT: Color = (1.0, 0.06, 0.40)
_CYAN_LIGHT: Color = (0.05, 0.70, 1.0)
_AMBER_LIGHT: Color = (1.0, 0.48, 0.12)
_WARM_LIGHT: Color = (1.0, 0.80, 0.52)
_GREEN_LIGHT: Color = (0.10, 1.0, 0.32)
_RED_LIGHT: Color = (1.0, 0.05, 0.03)

_RIDE = 0.20
"""Metres a frame that the cyclist moves, 17 km/h at 24 frames a second."""


@dataclass(frozen=True, slots=True)
class ReflectionScene:
    """A scene of the benchmark.

    Parameters
    ----------
    name : str
        For files and tables.
    purpose : str
        What the scene is for, in a line.
    build : callable
        Replaces Blender's current file by the scene and returns it.
    reflecting : tuple of str
        Objects in which something is reflected or refracted.
    lens, moves : bool
        Whether the scene has depth of field and motion blur.
    percentage : int
        Of the picture's size.
    """

    name: str
    purpose: str
    build: Callable[[], bpy.types.Scene]
    reflecting: tuple[str, ...]
    lens: bool = True
    moves: bool = False
    percentage: int = 100

    def key(self) -> str:
        """Return a hash of everything that the scene's picture depends on."""
        facts = {name: value for name, value in asdict(self).items() if name not in {"build", "purpose"}}
        built = self.build
        if isinstance(built, partial):
            facts["options"], built = built.keywords, built.func
        facts["sources"] = _sources(built, {}) | _sources(open_scene, {})
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


def open_scene(item: ReflectionScene) -> bpy.types.Scene:
    """Replace everything in Blender's current file by a scene of the benchmark.

    Parameters
    ----------
    item : ReflectionScene
        Which one.

    Returns
    -------
    Scene
        At its frame, seen through a pinhole and without motion blur.
    """
    scene = item.build()
    scene.render.resolution_percentage = item.percentage
    scene.render.motion_blur_position = "CENTER"
    for thing in scene.objects:
        thing.cycles.use_motion_blur = True
        thing.cycles.motion_steps = _MOTION_STEPS
    return scene


def _sources(function: Callable[..., Any], found: dict[str, str]) -> dict[str, str]:
    """Return the source of a function, of the scenes' functions that it calls, and the constants of all."""
    name = f"{function.__module__}.{function.__name__}"
    if name in found:
        return found
    found[name] = inspect.getsource(function)
    names = sorted(set(_names(function.__code__)))
    spaces = [function.__globals__]
    spaces += [vars(spaces[0][used]) for used in names if _is_ours(spaces[0].get(used))]
    for used in names:
        for value in (space[used] for space in spaces if used in space):
            if inspect.isfunction(value):
                if _is_ours(inspect.getmodule(value)):
                    _sources(value, found)
            elif used.isupper():
                # Functions in tables have another address in each run.
                found[f"{used} of {name}"] = re.sub(r" at 0x[0-9A-Fa-f]+", "", repr(value))
    return found


def _is_ours(value: Any) -> bool:
    """Return whether a value is this module or one of the sample scenes'."""
    return isinstance(value, ModuleType) and value.__name__.startswith((__name__, "sample_scenes."))


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that a function uses, those within its inner functions among them."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


# The scenes.


def puddle(*, moving: bool = False) -> bpy.types.Scene:
    """Replace everything in Blender's current file by a puddle at night.

    Parameters
    ----------
    moving : bool
        Whether a cyclist passes behind it.

    Returns
    -------
    Scene
        The scene, its camera close to the ground and focused on a toy duck in the puddle.
    """
    scene = _empty("Puddle")
    scene.render.motion_blur_shutter = 0.5
    building.sky(scene, (0.010, 0.014, 0.030))
    _camera(scene, 50.0, (0.0, 0.0, 0.17), (0.0, 2.0, 0.065), f_stop=1.6, focus_distance=0.95)
    ground = building.plane("Ground", 24.0, 30.0)
    building.add(scene, "Ground", ground, (0.0, 11.0, 0.0), _STILL, _asphalt((0.02, 1.55), (0.48, 0.95)))
    _duck(scene, (-0.07, 0.95, 0.0))
    for number, (x, y) in enumerate(((0.36, 1.75), (-0.62, 2.2), (0.62, 3.0), (-1.25, 3.9), (1.5, 4.6))):
        post = building.cylinder(f"Bollard {number}", 0.045, 0.42, segments=32)
        paint = _checks(f"Bollard {number}", _CREAM, (_RED, _BLUE)[number % 2], 9.0)
        building.add(scene, f"Bollard {number}", post, (x, y, 0.21), _STILL, paint)
    bricks = _checks("Bricks", (0.16, 0.07, 0.045), (0.06, 0.045, 0.05), 1.6)
    building.add(scene, "Front", building.plane("Front", 24.0, 9.0), (0.0, 14.0, 4.5), _UPRIGHT, bricks)
    lights = (_WARM_LIGHT, _AMBER_LIGHT, _CYAN_LIGHT, _WARM_LIGHT, _GREEN_LIGHT)
    for number in range(21):
        column, row = number % 7, number // 7
        color = lights[(3 * number + row) % len(lights)]
        place = (-4.5 + 1.5 * column, 13.95, 0.75 + 1.35 * row)
        _glow(scene, f"Window {number}", (0.7, 0.85), place, color, 0.5 + 0.5 * (number * 7 % 4))
    signs = (
        (0.36, 1.30, -1.95, 8.5, 1.05, _MAGENTA_LIGHT, 5.0),
        (1.20, 0.32, 1.35, 9.5, 0.95, _CYAN_LIGHT, 4.0),
        (0.30, 0.90, 2.55, 8.0, 1.00, _AMBER_LIGHT, 5.0),
        (0.55, 0.55, -0.55, 10.5, 1.75, _GREEN_LIGHT, 3.5),
        (0.80, 0.25, -0.80, 7.5, 0.55, _WARM_LIGHT, 4.0),
    )
    for number, (width, height, x, y, z, color, strength) in enumerate(signs):
        _glow(scene, f"Sign {number}", (width, height), (x, y, z), color, strength)
    lamps = ((0.62, 6.0, 1.35), (-2.9, 7.0, 1.55), (0.15, 11.0, 1.1), (-1.25, 6.5, 1.15))
    for number, (x, y, z) in enumerate(lamps):
        lamp = building.sphere(f"Lamp {number}", 0.10, rings=16)
        glow = building.add(scene, f"Lamp {number}", lamp, (x, y, z), _STILL)
        _let_glow(glow, _WARM_LIGHT, 9.0)
        rod = building.cylinder(f"Rod {number}", 0.025, z, segments=16)
        building.add(scene, f"Rod {number}", rod, (x, y, 0.5 * z), _STILL, building.diffuse("Rod", _DARK))
    _area(scene, "Street lamp", 420.0, (-2.8, 1.4, 3.4), (0.2, 2.6, 0.0), 0.45, _AMBER_LIGHT)
    _area(scene, "Shop light", 90.0, (2.2, -0.6, 2.4), (0.1, 1.6, 0.0), 0.9, (0.70, 0.85, 1.0))
    if moving:
        _cyclist(scene, (0.0, 2.75, 0.0))
    scene.frame_set(FRAME)
    return scene


def shop_window() -> bpy.types.Scene:
    """Replace everything in Blender's current file by a shop window.

    Returns
    -------
    Scene
        The scene, its camera looking aslant through the pane and focused on the goods. The pane reflects
        the street on the camera's side; through a door at the back another street is seen.
    """
    scene = _empty("Shop Window")
    building.sky(scene, (0.012, 0.016, 0.030))
    _camera(scene, 36.0, (-0.75, -1.0, 1.33), (-0.06, 0.55, 1.22), f_stop=0.9, focus_distance=1.62)
    pane = building.box("Pane", (1.9, 0.008, 1.3))
    building.add(scene, "Pane", pane, (0.22, 0.0, 1.3), _STILL, _pane())
    # The front around the pane.
    bricks = _checks("Bricks", (0.36, 0.13, 0.08), (0.12, 0.07, 0.06), 14.0)
    paint = _checks("Paint", (0.10, 0.28, 0.24), (0.05, 0.14, 0.13), 30.0)
    for name, size, place, look in (
        ("Pillar", (1.2, 0.16, 3.0), (-1.42, 0.0, 1.5), bricks),
        ("Far pillar", (1.2, 0.16, 3.0), (1.85, 0.0, 1.5), bricks),
        ("Sill", (2.2, 0.24, 0.40), (0.22, -0.03, 0.80), paint),
        ("Left bar", (0.07, 0.09, 1.3), (-0.73, 0.0, 1.3), paint),
        ("Middle bar", (0.06, 0.09, 1.3), (0.24, 0.0, 1.3), paint),
    ):
        building.add(scene, name, building.box(name, size, bevel=0.004), place, _STILL, look)
    sticker = building.plane("Sticker", 0.16, 0.11)
    tag = _checks("Sticker", _OCHRE, _CREAM, 45.0)
    building.add(scene, "Sticker", sticker, (-0.20, -0.012, 1.02), _UPRIGHT, tag)
    _goods(scene)
    # The room, and the street behind it.
    planks = _checks("Planks", (0.26, 0.17, 0.10), (0.16, 0.10, 0.06), 5.0)
    building.add(scene, "Boards", building.plane("Boards", 7.0, 4.0), (1.0, 2.05, 0.55), _STILL, planks)
    paper = _checks("Paper", (0.30, 0.27, 0.22), (0.18, 0.20, 0.20), 6.0)
    for name, size, place in (
        ("Back left", (2.0, 0.05, 3.0), (-0.75, 3.2, 1.7)),
        ("Back right", (3.0, 0.05, 3.0), (3.40, 3.2, 1.7)),
    ):
        building.add(scene, name, building.box(name, size), place, _STILL, paper)
    behind = (
        (0.9, 1.4, 0.9, 7.5, 1.9, _AMBER_LIGHT, 0.9),
        (0.6, 0.6, 2.0, 7.0, 1.1, _CYAN_LIGHT, 1.2),
        (0.5, 1.6, 2.7, 8.0, 1.5, _MAGENTA_LIGHT, 0.9),
        (0.5, 0.4, 1.4, 6.5, 0.7, _WARM_LIGHT, 1.5),
    )
    before = (
        (0.7, 1.7, 1.6, -4.6, 1.7, _AMBER_LIGHT, 3.0),
        (1.1, 0.4, 2.6, -5.0, 1.9, _CYAN_LIGHT, 3.5),
        (0.5, 0.5, 0.9, -3.4, 1.0, _GREEN_LIGHT, 2.6),
        (0.6, 1.2, 3.9, -6.0, 1.5, _MAGENTA_LIGHT, 3.5),
        (0.9, 0.7, 2.1, -4.2, 0.8, _WARM_LIGHT, 2.6),
        (0.5, 1.0, 0.3, -4.0, 1.6, _WARM_LIGHT, 2.6),
        (0.35, 0.35, 3.0, -4.4, 1.3, _RED_LIGHT, 3.5),
    )
    for number, (width, height, x, y, z, color, strength) in enumerate(behind + before):
        _glow(scene, f"Light {number}", (width, height), (x, y, z), color, strength)
    _area(scene, "Ceiling", 42.0, (0.4, 1.5, 2.9), (0.2, 1.0, 1.0), 1.0, (1.0, 0.90, 0.75))
    _area(scene, "Street lamp", 90.0, (-2.6, -2.2, 3.4), (0.0, 0.0, 1.2), 0.6, (0.85, 0.92, 1.0))
    scene.frame_set(FRAME)
    return scene


def chrome() -> bpy.types.Scene:
    """Replace everything in Blender's current file by chrome things on a polished base.

    Returns
    -------
    Scene
        The scene, its camera focused on the label of a chrome bottle.
    """
    scene = _empty("Chrome")
    building.sky(scene, (0.05, 0.055, 0.065))
    _camera(scene, 85.0, (0.0, -0.95, 0.26), (0.01, 0.0, 0.075), f_stop=3.2, focus_distance=0.92)
    base = building.plane("Base", 1.6, 1.5)
    building.add(scene, "Base", base, (0.0, 0.15, 0.0), _STILL, _polished("Base", (0.02, 0.022, 0.03), 2.2))
    metal = building.material(
        "Chrome",
        lambda tree: building.node(tree, "BsdfGlossy", Roughness=0.0, Color=(0.80, 0.82, 0.84)).outputs[0],
    )
    ball = building.sphere("Sphere", 0.052, rings=64)
    building.add(scene, "Sphere", ball, (-0.105, -0.03, 0.052), _STILL, metal)
    outline = [(0.0, 0.0), (0.030, 0.0), (0.036, 0.002), (0.038, 0.008), (0.038, 0.118), (0.036, 0.130),
               (0.028, 0.142), (0.015, 0.150), (0.013, 0.156), (0.013, 0.182), (0.0, 0.187)]  # fmt: skip
    bottle = building.turned("Bottle", outline, segments=128)
    building.add(scene, "Bottle", bottle, (0.0, 0.0, 0.0), _STILL, metal)
    label = building.turned("Label", [(0.0384, 0.045), (0.0384, 0.095)], segments=128)
    building.add(scene, "Label", label, (0.0, 0.0, 0.0), _STILL, _checks("Label", _CREAM, _RED, 110.0))
    cube = building.box("Tin", (0.075, 0.06, 0.085), bevel=0.012)
    building.add(scene, "Tin", cube, (0.112, 0.055, 0.0425), (0.0, 0.0, 24.0), metal)
    dice = building.box("Dice", (0.034, 0.034, 0.034), bevel=0.004)
    building.add(
        scene, "Dice", dice, (0.062, -0.10, 0.017), (0.0, 0.0, 33.0), _checks("Dice", _OCHRE, _BLUE, 90.0)
    )
    stone = building.sphere("Marble", 0.022, rings=32)
    building.add(
        scene, "Marble", stone, (-0.035, -0.13, 0.022), _STILL, _checks("Marble", _GREEN, _CREAM, 80.0)
    )
    far = building.sphere("Far ball", 0.045, rings=32)
    building.add(
        scene, "Far ball", far, (-0.14, 0.28, 0.045), _STILL, _checks("Far ball", _RED, _CREAM, 34.0)
    )
    cloth = _checks("Backdrop", (0.30, 0.36, 0.42), (0.10, 0.13, 0.20), 13.0)
    building.add(scene, "Backdrop", building.plane("Backdrop", 3.0, 2.0), (0.0, 0.75, 0.7), _UPRIGHT, cloth)
    for name, size, place, turn, strength in (
        ("Left softbox", (0.35, 0.55), (-0.62, -0.40, 0.42), (90.0, 0.0, -55.0), 2.4),
        ("Right softbox", (0.25, 0.60), (0.65, -0.25, 0.40), (90.0, 0.0, 60.0), 3.2),
        ("Strip", (0.90, 0.06), (0.0, -1.15, 0.62), (70.0, 0.0, 180.0), 4.0),
    ):
        box = building.add(scene, name, building.plane(name, *size), place, turn)
        _let_glow(box, (1.0, 0.97, 0.93), strength, lights=True)
    _area(scene, "Top light", 7.0, (0.15, -0.1, 0.95), (0.0, 0.05, 0.0), 0.30, (1.0, 0.96, 0.90))
    scene.frame_set(FRAME)
    return scene


SCENES: dict[str, ReflectionScene] = {
    item.name: item
    for item in (
        ReflectionScene(
            "carafe",
            "TOG 1982, figure 15: a glazed carafe on polished tiles",
            carafe.build,
            ("Carafe", "Floor"),
            percentage=50,
        ),
        ReflectionScene(
            "carafe_glass",
            "TOG 1982, figure 16: a carafe of glass on polished tiles",
            partial(carafe.build, transparent=True),
            ("Carafe", "Floor"),
            percentage=50,
        ),
        ReflectionScene(
            "mirror",
            "SIGGRAPH 1983, figure 8: things fly past a mirror; motion alone",
            mirror.build,
            ("Mirror", *mirror.SPHERES),
            lens=False,
            moves=True,
            percentage=50,
        ),
        ReflectionScene(
            "puddle",
            "a puddle at night, the lights in it far behind the focus and its water about it",
            puddle,
            ("Ground",),
        ),
        ReflectionScene(
            "puddle_moving",
            "the same with a cyclist, a reflection and a shadow passing; lens and motion",
            partial(puddle, moving=True),
            ("Ground",),
            moves=True,
        ),
        ReflectionScene(
            "shop_window",
            "goods in focus behind a pane that reflects a street, and another street behind them",
            shop_window,
            ("Pane",),
        ),
        ReflectionScene(
            "chrome",
            "a product shot: chrome sphere, bottle and tin on a polished base, softboxes in all of them",
            chrome,
            ("Sphere", "Bottle", "Tin", "Base"),
        ),
    )
}


# What stands in them.


def _empty(name: str) -> bpy.types.Scene:
    """Return an empty scene of this benchmark's size."""
    scene = building.empty_scene(name, COLUMNS, ROWS, samples=_SAMPLES, bounces=_BOUNCES)
    scene.cycles.diffuse_bounces = 0
    scene.cycles.sample_clamp_indirect = _CLAMP
    return scene


def _camera(
    scene: bpy.types.Scene,
    lens_mm: float,
    location: Vector3,
    target: Vector3,
    *,
    f_stop: float,
    focus_distance: float,
) -> None:
    building.camera(scene, lens_mm, SENSOR_MM, location, target, f_stop=f_stop, focus_distance=focus_distance)


def _duck(scene: bpy.types.Scene, place: Vector3) -> None:
    """Add a toy duck of balls."""
    yellow = _checks("Duck", (0.80, 0.52, 0.05), (0.62, 0.30, 0.03), 120.0)
    x, y, z = place
    for name, radius, offset, scale in (
        ("Duck body", 0.036, (0.0, 0.0, 0.020), (1.35, 1.0, 0.75)),
        ("Duck head", 0.021, (0.030, 0.0, 0.060), (1.0, 1.0, 1.0)),
        ("Duck bill", 0.009, (0.054, 0.0, 0.057), (1.5, 1.0, 0.6)),
    ):
        look = building.diffuse("Bill", (0.7, 0.10, 0.02)) if name == "Duck bill" else yellow
        at = (x + offset[0], y + offset[1], z + offset[2])
        building.add(scene, name, building.sphere(name, radius, rings=24), at, _STILL, look).scale = scale


def _cyclist(scene: bpy.types.Scene, place: Vector3) -> None:
    """Add a cyclist of boxes and wheels who rides to the right and is at a place at `FRAME`."""
    coat = _checks("Coat", _RED, _CREAM, 16.0)
    steel = building.diffuse("Frame", (0.55, 0.58, 0.62))
    parts: list[tuple[str, bpy.types.Mesh, Vector3, Vector3, bpy.types.Material]] = [
        ("Bar", building.box("Bar", (0.50, 0.03, 0.05)), (0.0, 0.0, 0.44), (0.0, -10.0, 0.0), steel),
        ("Fork", building.box("Fork", (0.04, 0.03, 0.40)), (0.27, 0.0, 0.38), (0.0, -16.0, 0.0), steel),
        ("Leg", building.box("Leg", (0.10, 0.09, 0.46)), (-0.02, -0.06, 0.45), (0.0, 18.0, 0.0), coat),
        ("Body", building.box("Body", (0.22, 0.20, 0.46)), (-0.02, 0.0, 0.88), (0.0, 24.0, 0.0), coat),
        (
            "Head",
            building.sphere("Head", 0.10, rings=24),
            (0.13, 0.0, 1.22),
            _STILL,
            building.diffuse("Skin", (0.6, 0.35, 0.24)),
        ),
    ]
    spokes = _checks("Spokes", _CREAM, _BLUE, 14.0)
    for name, x in (("Front wheel", 0.34), ("Back wheel", -0.34)):
        disc = building.cylinder(name, 0.20, 0.04)
        parts.append((name, disc, (x, 0.0, 0.20), _UPRIGHT, spokes))
    things = [
        (building.add(scene, name, data, _STILL, turn, look), at) for name, data, at, turn, look in parts
    ]
    beam = building.add(scene, "Headlight", building.sphere("Headlight", 0.045, rings=16), _STILL)
    _let_glow(beam, _WARM_LIGHT, 8.0)
    things.append((beam, (0.40, -0.02, 0.60)))
    for thing, at in things:
        here = tuple(p + a for p, a in zip(place, at, strict=True))
        stops = {FRAME + n: (here[0] + n * _RIDE, here[1], here[2]) for n in (-2, 2)}
        building.key(thing, "location", stops)


def _goods(scene: bpy.types.Scene) -> None:
    """Add what the shop sells, from near the pane to the back."""
    goods: tuple[tuple[str, bpy.types.Mesh, Vector3, bpy.types.Material], ...] = (
        (
            "Vase",
            building.turned(
                "Vase", [(0.0, 0.0), (0.05, 0.0), (0.085, 0.09), (0.07, 0.17), (0.035, 0.22), (0.05, 0.26)]
            ),
            (-0.10, 0.55, 1.05),
            _checks("Vase", _BLUE, _CREAM, 38.0),
        ),
        (
            "Box",
            building.box("Box", (0.16, 0.16, 0.16), bevel=0.006),
            (0.14, 0.50, 1.13),
            _checks("Box", _RED, _OCHRE, 31.0),
        ),
        ("Ball", building.sphere("Ball", 0.10), (0.47, 0.95, 1.15), _checks("Ball", _GREEN, _CREAM, 27.0)),
        (
            "Globe",
            building.sphere("Globe", 0.16),
            (-0.05, 1.55, 1.21),
            _checks("Globe", _OCHRE, _BLUE, 18.0),
        ),
        (
            "Crate",
            building.box("Crate", (0.4, 0.4, 0.7), bevel=0.01),
            (0.85, 1.9, 0.95),
            _checks("Crate", _CREAM, _DARK, 9.0),
        ),
        ("Tall", building.cylinder("Tall", 0.09, 0.9), (0.45, 2.3, 1.3), _checks("Tall", _RED, _CREAM, 12.0)),
        (
            "Near",
            building.sphere("Near", 0.05),
            (-0.30, 0.16, 1.10),
            _checks("Near", _CREAM, _RED, 60.0),
        ),
    )
    for name, data, place, look in goods:
        building.add(scene, name, data, place, _STILL, look)
    table = building.box("Table", (1.9, 0.9, 0.05), bevel=0.004)
    wood = _checks("Wood", (0.33, 0.20, 0.10), (0.22, 0.13, 0.06), 11.0)
    building.add(scene, "Table", table, (0.25, 0.62, 1.02), _STILL, wood)


def _area(
    scene: bpy.types.Scene,
    name: str,
    power: float,
    location: Vector3,
    target: Vector3,
    size: float,
    color: Color,
) -> None:
    building.lamp(scene, name, "AREA", power, location, target, size=size, color=color)


def _glow(
    scene: bpy.types.Scene,
    name: str,
    size: tuple[float, float],
    place: Vector3,
    color: Color,
    strength: float,
) -> None:
    """Add an upright rectangle that glows, with a dark cross in it so that its blur can be told."""
    width, height = size
    item = building.add(scene, name, building.plane(name, width, height), place, _UPRIGHT)
    _let_glow(item, color, strength)
    # Towards the camera whose light it is: those behind it are seen from their other side.
    side = -0.01 if place[1] > 0.0 else 0.01
    for part, sides in (("across", (width, 0.08 * height)), ("upright", (0.08 * width, height))):
        bar = building.plane(f"{name} {part}", *sides)
        at = (place[0], place[1] + side, place[2])
        building.add(scene, f"{name} {part}", bar, at, _UPRIGHT, building.diffuse("Bars", _DARK))


def _let_glow(item: bpy.types.Object, color: Color, strength: float, *, lights: bool = False) -> None:
    """Let an object glow; unless it is to light others, it is seen and reflected alone."""
    glow = building.emitter(item.name, color, strength)
    item.data.materials.append(glow)
    if not lights:
        # Looking for it costs time, and rays that find it by chance are noise.
        glow.cycles.emission_sampling = "NONE"
        item.visible_diffuse = item.visible_shadow = False


# What they look like.


def _checks(name: str, first: Color, second: Color, scale: float) -> bpy.types.Material:
    """Return a matt material of checks, so many to a metre."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        # No flat face lies on the edge between two checks.
        moved = building.node(tree, "Mapping", Vector=place, Location=(0.00137, 0.00119, 0.00171))
        color = building.node(
            tree, "TexChecker", Vector=moved.outputs[0], Color1=first, Color2=second, Scale=scale
        )
        return building.node(tree, "BsdfDiffuse", Color=color.outputs["Color"]).outputs[0]

    return building.material(name, shade)


def _mirrored(tree: bpy.types.ShaderNodeTree, matt: bpy.types.NodeSocket, ior: float) -> bpy.types.NodeSocket:
    """Return a matt surface under a smooth layer that reflects as Fresnel says."""
    gloss = building.node(tree, "BsdfGlossy", Roughness=0.0, Color=(1.0, 1.0, 1.0))
    return building.mixed(tree, building.node(tree, "Fresnel", IOR=ior).outputs[0], matt, gloss.outputs[0])


def _polished(name: str, color: Color, ior: float) -> bpy.types.Material:
    """Return a colour under a polish."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        return _mirrored(tree, building.node(tree, "BsdfDiffuse", Color=color).outputs[0], ior)

    return building.material(name, shade)


def _asphalt(middle: tuple[float, float], radii: tuple[float, float]) -> bpy.types.Material:
    """Return dry asphalt with a puddle in it, about an ellipse of this middle and these radii in metres."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "NewGeometry").outputs["Position"]
        grain = building.node(tree, "TexNoise", Vector=place, Scale=60.0, Detail=3.0).outputs[0]
        patches = building.node(tree, "TexNoise", Vector=place, Scale=3.0, Detail=2.0).outputs[0]
        ramp = building.node(tree, "ValToRGB", Fac=grain)
        for element, at, color in zip(
            ramp.color_ramp.elements, (0.38, 0.62), ((0.05, 0.052, 0.055), (0.32, 0.31, 0.30)), strict=True
        ):
            element.position, element.color = at, (*color, 1.0)
        dry = building.node(tree, "BsdfDiffuse", Color=ramp.outputs["Color"])
        mud = building.node(tree, "BsdfDiffuse", Color=(0.006, 0.006, 0.006))
        # How far out of the ellipse a place is, the edge made uneven.
        scaled = building.node(
            tree,
            "Mapping",
            vector_type="TEXTURE",
            Vector=place,
            Location=(*middle, 0.0),
            Scale=(*radii, 1.0),
        )
        length = building.node(tree, "VectorMath", operation="LENGTH", Vector=scaled.outputs[0])
        uneven = building.node(tree, "MapRange", Value=patches, To_Min=-0.45, To_Max=0.45)
        out = building.node(tree, "Math", operation="ADD")
        tree.links.new(length.outputs["Value"], out.inputs[0])
        tree.links.new(uneven.outputs[0], out.inputs[1])
        share = building.node(tree, "MapRange", Value=out.outputs[0], From_Min=0.97, From_Max=1.03)
        water = _mirrored(tree, mud.outputs[0], _WATER_IOR)
        return building.mixed(tree, share.outputs[0], water, dry.outputs[0])

    return building.material("Asphalt", shade)


def _pane() -> bpy.types.Material:
    """Return the glass of a window, which lets light through to its shadow."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        glass = building.node(tree, "BsdfGlass", Roughness=0.0, IOR=_GLASS_IOR, Color=(1.0, 1.0, 1.0))
        clear = building.node(tree, "BsdfTransparent", Color=(0.9, 0.9, 0.9))
        shadow = building.node(tree, "LightPath").outputs["Is Shadow Ray"]
        return building.mixed(tree, shadow, glass.outputs[0], clear.outputs[0])

    return building.material("Pane", shade)
