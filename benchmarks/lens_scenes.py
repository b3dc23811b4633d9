"""Scenes with one difficulty of depth of field each, rendered at `FRAME`, for measuring the lens' blur.

The camera stands at the origin and looks along +y. Things are placed in pixels from the picture's middle, at
a depth, so that a builder reads like the picture. The f-stop follows from how large a circle of confusion
should be at a depth. Colours are emitted, except where the scene's point is light, so that references
converge.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import json
import math
import random
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from types import CodeType
from typing import Any

import bpy

# isort: split
# The module bpy brings these with it.
import bmesh
from mathutils import Matrix

from sample_scenes import building

FRAME = 10
SENSOR_MM = 36.0

_MOTION_STEPS = 6
"""Cycles follows 2 ** (steps - 1) pieces of a path within the shutter."""

Color = tuple[float, float, float]
Pattern = Callable[[Any], Any]
"""Adds nodes to a tree and returns the socket of a colour."""


@dataclass(frozen=True, slots=True)
class View:
    """Camera and frame of a scene.

    Parameters
    ----------
    columns, rows : int
        Pixels.
    lens_mm : float
        Focal length; the sensor's longer side is `SENSOR_MM`.
    blades : int
        Blades of the iris; 0 is round.
    blade_rotation : float
        Degrees.
    film_transparent : bool
        Whether there is alpha where nothing is.
    bounces : int
        Bounces of light.
    """

    columns: int = 480
    rows: int = 270
    lens_mm: float = 50.0
    blades: int = 0
    blade_rotation: float = 0.0
    film_transparent: bool = False
    bounces: int = 0


@dataclass(frozen=True, slots=True)
class LensScene:
    """A scene of the benchmark.

    Parameters
    ----------
    name : str
        For files and tables.
    build : callable
        Fills an empty scene and focuses it; its docstring says what the scene is for.
    view : View
        Camera and frame.
    moves : bool
        Whether the scene is for lens and motion together.
    frames : int
        How many frames there are; of one scene `FRAME` alone counts.
    """

    name: str
    build: Callable[[bpy.types.Scene], None]
    view: View = field(default_factory=View)
    moves: bool = False
    frames: int = 1

    @property
    def purpose(self) -> str:
        """What the scene is for, in a line."""
        return " ".join((self.build.__doc__ or "").split())

    def key(self) -> str:
        """Return a hash of everything that the scene's picture depends on."""
        facts = {
            "view": asdict(self.view),
            "moves": self.moves,
            "constants": {name: repr(value) for name, value in globals().items() if name in _CONSTANTS},
            "sources": _sources(self.build, {}) | _sources(open_scene, {}),
        }
        if self.frames > 1:
            facts["frames"] = self.frames
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


SCENES: dict[str, LensScene] = {}

SEQUENCES: dict[str, LensScene] = {}
"""Scenes of `FRAMES` frames, in which the focus or the camera moves."""

FRAMES = 48

_CONSTANTS = (
    "FRAME", "SENSOR_MM", "_MOTION_STEPS", "RED", "BLUE", "GREEN", "OCHRE", "DARK", "CREAM", "GREY", "PAIRS",
)  # fmt: skip
"""What a picture depends on beside the functions that make the scene."""


def open_scene(item: LensScene) -> bpy.types.Scene:
    """Replace everything in Blender's current file by a scene of the benchmark.

    Parameters
    ----------
    item : LensScene
        Which one.

    Returns
    -------
    Scene
        At `FRAME`, seen through a pinhole and without motion blur.
    """
    view = item.view
    scene = building.empty_scene(item.name, view.columns, view.rows, samples=128, bounces=view.bounces)
    scene.render.film_transparent = view.film_transparent
    scene.render.motion_blur_shutter, scene.render.motion_blur_position = 0.5, "CENTER"
    camera = building.camera(
        scene, view.lens_mm, SENSOR_MM, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), f_stop=2.8, focus_distance=1.0
    )
    camera.data.dof.aperture_blades = view.blades
    camera.data.dof.aperture_rotation = math.radians(view.blade_rotation)
    item.build(scene)
    for thing in scene.objects:
        thing.cycles.use_motion_blur = True
        thing.cycles.motion_steps = _MOTION_STEPS
    scene.frame_set(FRAME)
    return scene


def circle_radius(scene: bpy.types.Scene, depth: float) -> float:
    """Return the signed radius in pixels of the circle of confusion at a depth, negative before the focus."""
    camera = scene.camera.data
    focal = camera.lens / 1000.0
    aperture = focal / camera.dof.aperture_fstop
    circle = focal * aperture * (1.0 / camera.dof.focus_distance - 1.0 / depth)
    return 0.5 * circle * _pixels(scene) / (SENSOR_MM / 1000.0)


def _sources(function: Callable[..., Any], found: dict[str, str]) -> dict[str, str]:
    """Return the source of a function and of all functions here and of `building` that it calls."""
    name = f"{function.__module__}.{function.__name__}"
    if name not in found:
        found[name] = _meaning(function)
        spaces = {__name__: globals(), building.__name__: vars(building)}
        for used in _names(function.__code__):
            for module, space in spaces.items():
                called = space.get(used)
                if inspect.isfunction(called) and called.__module__ == module:
                    _sources(called, found)
    return found


def _meaning(function: Callable[..., Any]) -> str:
    """Return the source of a function without what does not count: layout, comments and docstrings."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.dump(tree)


def _names(code: CodeType) -> set[str]:
    """Return the names that a function uses, those within its inner functions among them."""
    found = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found |= _names(constant)
    return found


def _scene(
    view: View | None = None, *, moves: bool = False
) -> Callable[[Callable[[bpy.types.Scene], None]], Callable[[bpy.types.Scene], None]]:
    """Enter a scene into `SCENES` under its builder's name."""

    def enter(build: Callable[[bpy.types.Scene], None]) -> Callable[[bpy.types.Scene], None]:
        name = build.__name__
        SCENES[name] = LensScene(name, build, view or View(), moves)
        return build

    return enter


# The scenes.


@_scene()
def bars(scene: bpy.types.Scene) -> None:
    """Hold thin blurred bars before a sharp wall: a bar is all soft edge, and the wall shows through."""
    _focus(scene, 1.5, near=(0.5, 14.0))
    _wall(scene, 1.5, _patchwork(34.0))
    for number, (x, width, turn) in enumerate(
        ((-190, 4, 0), (-120, 8, 8), (-50, 14, -5), (25, 5, 12), (80, 22, 0), (150, 10, -14), (205, 6, 4))
    ):
        first, second = PAIRS[number % len(PAIRS)]
        depth = 0.5 + 0.05 * (number % 3)
        _card(
            scene,
            f"Bar {number}",
            (x, depth, 0),
            (width, 420),
            _material(f"Bar {number}", _checks(first, second, 30.0)),
            (0, turn, 0),
        )
    _card(scene, "White bar", (118, 0.55, 0), (5, 420), _material("White", _plain((2.0, 1.9, 1.7))))
    _card(scene, "Crossbar", (0, 0.52, -70), (600, 7), _material("Crossbar", _checks(RED, CREAM, 60.0)))


@_scene()
def subject(scene: bpy.types.Scene) -> None:
    """Keep a subject lit by the sun sharp between blurred leaves before and a blurred wall behind it."""
    _subject(scene)


@_scene()
def highlights(scene: bpy.types.Scene) -> None:
    """Put lamps of 50 to 500 before and behind the focus, some partly hidden by sharp or blurred things."""
    _focus(scene, 1.5, near=(0.7, 13.0))
    _wall(scene, 6.0, _patchwork(5.0, 0.35))
    chance = random.Random(3)
    for number in range(26):
        place = (chance.uniform(-230, 230), chance.uniform(3.0, 5.5), chance.uniform(-125, 125))
        strength = chance.choice((50.0, 120.0, 500.0))
        tint = chance.choice(((1.0, 0.85, 0.55), (0.55, 0.8, 1.0), (1.0, 0.4, 0.3), (0.7, 1.0, 0.6)))
        lamp = _material(f"Lamp {number}", _plain(tint, strength))
        _ball(scene, f"Lamp {number}", place, chance.choice((2.6, 3.4, 4.2)), lamp, rings=12)
    for number, (x, z, strength) in enumerate(((-60, 80, 50.0), (95, -30, 200.0), (180, 70, 90.0))):
        lamp = _material(f"Near lamp {number}", _plain((1.0, 0.9, 0.7), strength))
        _ball(scene, f"Near lamp {number}", (x, 0.72, z), 4.0, lamp, rings=12)
    _ball(scene, "Sphere", (-95, 1.5, -25), 62, _material("Sphere", _checks(RED, CREAM, 24.0)))
    for number, x in enumerate((20, 62, 104)):
        pair = PAIRS[number]
        post = _material(f"Post {number}", _checks(*pair, 26.0))
        _card(scene, f"Post {number}", (x, 1.5, 0), (14, 420), post)
    _card(
        scene,
        "Near slat",
        (-10, 0.75, 30),
        (560, 12),
        _material("Slat", _checks(BLUE, DARK, 40.0)),
        (0, 18, 0),
    )


@_scene()
def slanted_planes(scene: bpy.types.Scene) -> None:
    """Run a floor and slanted cards through the focus: circles change everywhere, with few silhouettes."""
    _focus(scene, 1.4, near=(0.55, 14.0))
    floor = _material("Floor", _checks(CREAM, (0.12, 0.14, 0.2), 9.0))
    building.add(scene, "Floor", building.plane("Floor", 16.0, 16.0), (0.0, 7.0, -0.19), (0, 0, 17), floor)
    _wall(scene, 9.0, _noise((0.10, 0.16, 0.30), (0.55, 0.62, 0.70), 0.8))
    card = _material("Card", _stripes(DARK, CREAM, 70.0))
    _card(scene, "Card", (-60, 1.35, 10), (330, 130), card, (0, 0, 62))
    other = _material("Second card", _patchwork(22.0, 1.6))
    _card(scene, "Second card", (120, 1.6, 20), (230, 110), other, (0, 0, -55))


@_scene()
def peers_scene(scene: bpy.types.Scene) -> None:
    """Repeat the scene that other tools were measured with: small circles, two posts, a sphere, lamps."""
    _focus(scene, 3.0, near=(1.0, 7.0))
    _wall(scene, 8.0, _checks((0.55, 0.55, 0.6), (0.15, 0.2, 0.3), 3.0))
    for number in range(18):
        x, z = -220 + 95 * (number % 6) - 20 * (number // 6), 95 - 95 * (number // 6)
        dot = _material(f"Dot {number}", _plain((1.0, 0.8, 0.5), 20.0 + 30.0 * (number % 3)))
        _ball(scene, f"Dot {number}", (x, 7.8, z), 1.4, dot, rings=8)
    _ball(scene, "Sphere", (40, 3.0, -10), 75, _material("Sphere", _checks(RED, CREAM, 9.0)))
    _card(scene, "Post", (-110, 1.0, 0), (34, 420), _material("Post", _checks(GREEN, OCHRE, 22.0)))
    _card(scene, "Thin post", (-20, 1.0, 0), (4, 420), _material("Thin post", _plain((0.9, 0.9, 0.9))))


@_scene()
def near_near(scene: bpy.types.Scene) -> None:
    """Lay blurred near things over others nearer to the focus, over a sharp wall: three depths meet."""
    _focus(scene, 1.6, near=(0.42, 26.0))
    _wall(scene, 1.9, _patchwork(30.0))
    middle = _material("Middle", _checks(BLUE, CREAM, 26.0))
    _card(scene, "Middle", (-40, 0.8, -10), (190, 120), middle, (0, 24, 0))
    _ball(scene, "Ball", (95, 0.85, 40), 52, _material("Ball", _checks(GREEN, CREAM, 30.0)))
    nearest = _material("Nearest", _checks(RED, OCHRE, 40.0))
    _card(scene, "Nearest", (-95, 0.42, 25), (46, 420), nearest, (0, -20, 0))
    _card(scene, "Nearest thin", (60, 0.45, 0), (12, 420), _material("Thin", _plain(CREAM)), (0, 35, 0))
    _ball(scene, "Nearest ball", (150, 0.44, -60), 48, _material("Nearest ball", _checks(OCHRE, DARK, 40.0)))


@_scene()
def near_third(scene: bpy.types.Scene) -> None:
    """Let one blurred near thing fill a third of the picture: a wide soft edge over sharp detail."""
    _focus(scene, 1.5, near=(0.45, 24.0))
    _wall(scene, 1.7, _patchwork(30.0))
    _ball(scene, "Subject", (90, 1.45, 5), 70, _material("Subject", _checks(BLUE, CREAM, 22.0)))
    _ball(scene, "Near", (-190, 0.56, -45), 165, _material("Near", _noise(RED, OCHRE, 22.0)))


@_scene()
def clutter(scene: bpy.types.Scene) -> None:
    """Scatter 320 leaves over all depths: everywhere some edge before another one at another blur."""
    _focus(scene, 1.5, near=(0.55, 15.0))
    _wall(scene, 7.0, _noise((0.04, 0.08, 0.05), (0.45, 0.55, 0.60), 1.4))
    greens = [
        (0.10, 0.45, 0.12),
        (0.30, 0.50, 0.08),
        (0.05, 0.22, 0.10),
        (0.65, 0.55, 0.12),
        (0.60, 0.15, 0.05),
    ]
    leaves = [
        _material(f"Leaf {n}", _stripes(color, tuple(0.45 * c for c in color), 60.0 + 20.0 * n))
        for n, color in enumerate(greens)
    ]
    chance = random.Random(7)
    meshes = {}
    for number in range(320):
        depth = 1.0 / chance.uniform(1.0 / 6.0, 1.0 / 0.55)
        kind = number % len(leaves)
        if kind not in meshes:
            meshes[kind] = _leaf(f"Leaf {kind}")
            meshes[kind].materials.append(leaves[kind])
        place = (chance.uniform(-250, 250), depth, chance.uniform(-145, 145))
        size = chance.uniform(0.03, 0.075)
        turn = tuple(chance.uniform(-180.0, 180.0) for _ in range(3))
        leaf = building.add(scene, f"Leaf {number}", meshes[kind], _at(scene, *place), turn)
        leaf.scale = (size, size, size)


@_scene(View(film_transparent=True))
def alpha(scene: bpy.types.Scene) -> None:
    """Leave the film transparent: holes before and behind the focus, a half-transparent card, a holdout."""
    _focus(scene, 1.5, near=(0.6, 13.0))
    _ball(scene, "Subject", (-30, 1.5, 0), 62, _material("Subject", _checks(RED, CREAM, 24.0)))
    grid = _grid(scene, "Near grid", (-120, 0.6, 20), (150, 210), 5, 9.0, _checks(GREEN, DARK, 40.0))
    grid.rotation_euler[1] = math.radians(14.0)
    _grid(scene, "Far grid", (110, 4.5, 10), (300, 300), 9, 12.0, _checks(BLUE, CREAM, 2.5))
    glass = _material("Glass", _checks(OCHRE, CREAM, 30.0), opacity=0.5)
    _card(scene, "Glass", (60, 0.9, -40), (130, 120), glass, (0, -12, 0))
    holdout = _ball(scene, "Holdout", (150, 0.7, 40), 46, _material("Holdout", _plain(CREAM)))
    holdout.is_holdout = True


@_scene(View(lens_mm=100.0))
def macro(scene: bpy.types.Scene) -> None:
    """Focus close with a long lens: circles of 40 pixels, from blurred pollen to a blurred background."""
    _focus(scene, 0.30, near=(0.2735, 20.0))
    # The far side has 40 pixels at about 0.37 m, and what is behind more: all of it lies before 0.37 m.
    _wall(scene, 0.365, _noise((0.05, 0.20, 0.06), (0.75, 0.60, 0.25), 45.0))
    _ball(scene, "Core", (10, 0.305, -20), 88, _material("Core", _checks(OCHRE, DARK, 260.0)))
    petal = _material("Petal", _stripes((0.75, 0.2, 0.45), (0.9, 0.7, 0.75), 420.0))
    for number in range(9):
        angle = 40.0 * number
        x, z = 10 + 150 * math.cos(math.radians(angle)), -20 + 150 * math.sin(math.radians(angle))
        depth = 0.312 + 0.012 * (number % 3)
        _card(scene, f"Petal {number}", (x, depth, z), (150, 46), petal, (0, -angle, 0))
    grain = _material("Grain", _checks(CREAM, OCHRE, 700.0))
    chance = random.Random(5)
    for number in range(14):
        place = (chance.uniform(-210, 210), chance.uniform(0.268, 0.285), chance.uniform(-115, 115))
        _ball(scene, f"Grain {number}", place, chance.uniform(5, 16), grain)
    dew = _material("Dew", _plain((1.0, 0.95, 0.85), 8.0))
    for number in range(4):
        place = (chance.uniform(-220, 220), 0.36, chance.uniform(-120, 120))
        _ball(scene, f"Dew {number}", place, 8.0, dew, rings=16)


@_scene(View(lens_mm=18.0))
def wide(scene: bpy.types.Scene) -> None:
    """Look through a wide lens with a blurred railing close by: blur across the frame, and at its borders."""
    _focus(scene, 1.2, near=(0.22, 24.0))
    floor = _material("Floor", _checks(CREAM, (0.2, 0.22, 0.3), 5.0))
    building.add(scene, "Floor", building.plane("Floor", 20.0, 20.0), (0.0, 9.0, -0.5), (0, 0, 12), floor)
    _wall(scene, 5.0, _patchwork(5.0))
    for number, (x, depth) in enumerate(((-150, 1.5), (-60, 1.2), (40, 2.2), (130, 1.3), (200, 3.0))):
        box = _material(f"Box {number}", _checks(*PAIRS[number], 9.0))
        size = _units(scene, 60.0, depth)
        place = _at(scene, x, depth, -30.0)
        building.add(scene, f"Box {number}", building.box(f"Box {number}", (size, size, 2.2 * size)), place,
                     (0, 0, 25 * number), box)  # fmt: skip
    for number, x in enumerate((-205, -95, 15, 125, 225)):
        post = _material(f"Rail post {number}", _checks(*PAIRS[(number + 2) % 5], 70.0))
        _card(scene, f"Rail post {number}", (x, 0.24, -130), (14, 280), post, (0, 3 * number - 6, 0))
    _card(scene, "Rail", (0, 0.22, -15), (620, 24), _material("Rail", _stripes(RED, CREAM, 90.0)), (0, 3, 0))


@_scene(View(columns=270, rows=480, lens_mm=85.0, blades=6, blade_rotation=12.0))
def portrait(scene: bpy.types.Scene) -> None:
    """Stand a figure upright before lamps, through an aperture of six blades."""
    _focus(scene, 2.2, near=(1.35, 12.0))
    _wall(scene, 8.0, _noise((0.02, 0.03, 0.06), (0.20, 0.16, 0.25), 1.2))
    skin = _material("Skin", _checks((0.75, 0.45, 0.32), (0.6, 0.3, 0.2), 40.0))
    _ball(scene, "Head", (10, 2.2, 70), 58, skin)
    coat = _material("Coat", _checks(BLUE, DARK, 26.0))
    body = building.cylinder(
        "Body", _units(scene, 88, 2.25), _units(scene, 300, 2.25), top=_units(scene, 48, 2.25)
    )
    building.add(scene, "Body", body, _at(scene, 10, 2.25, -145), (0, 0, 0), coat)
    hair = _material("Hair", _plain((0.06, 0.03, 0.02)))
    chance = random.Random(11)
    for number in range(24):
        angle = chance.uniform(20.0, 160.0)
        x, z = 10 + 62 * math.cos(math.radians(angle)), 70 + 62 * math.sin(math.radians(angle))
        turn = 90.0 - angle + chance.uniform(-30.0, 30.0)
        _card(scene, f"Hair {number}", (x, 2.2, z), (1.2, 46), hair, (0, turn, 0))
    for number in range(22):
        place = (chance.uniform(-130, 130), chance.uniform(4.5, 7.5), chance.uniform(-90, 230))
        tint = chance.choice(((1.0, 0.8, 0.45), (1.0, 0.35, 0.25), (0.5, 0.75, 1.0)))
        lamp = _material(f"Lamp {number}", _plain(tint, chance.choice((60.0, 140.0))))
        _ball(scene, f"Lamp {number}", place, 4.0, lamp, rings=12)
    twig = _material("Twig", _checks(GREEN, (0.3, 0.5, 0.1), 40.0))
    for number, (x, z, turn) in enumerate(
        ((-105, -60, 20), (-80, -150, -30), (100, -190, 40), (112, 30, -15))
    ):
        _card(scene, f"Twig {number}", (x, 1.35 + 0.04 * number, z), (20, 120), twig, (0, turn, 0))


@_scene(moves=True)
def blurred_mover(scene: bpy.types.Scene) -> None:
    """Move a ball that is out of focus over a sharp wall: one thing is blurred by motion and by the lens."""
    _focus(scene, 1.5, near=(0.6, 10.0))
    _wall(scene, 1.6, _patchwork(32.0))
    ball = _ball(scene, "Ball", (0, 0.62, 10), 48, _material("Ball", _checks(RED, CREAM, 40.0)))
    _glide(scene, ball, (80.0, 25.0))
    post = _material("Post", _checks(GREEN, DARK, 26.0))
    _card(scene, "Post", (95, 1.4, 0), (22, 420), post)


@_scene(moves=True)
def sharp_mover(scene: bpy.types.Scene) -> None:
    """Move a ball that is in focus over a far blurred wall and behind a near blurred post."""
    _focus(scene, 1.5, near=(0.7, 11.0))
    _wall(scene, 6.0, _patchwork(7.0))
    ball = _ball(scene, "Ball", (-40, 1.5, 0), 60, _material("Ball", _checks(BLUE, CREAM, 22.0)))
    _glide(scene, ball, (90.0, -20.0))
    _card(scene, "Post", (60, 0.7, 0), (30, 420), _material("Post", _checks(OCHRE, DARK, 40.0)), (0, 10, 0))


@_scene(moves=True)
def dolly(scene: bpy.types.Scene) -> None:
    """Slide the camera past a blurred near post, a sharp ball and a far wall, each with its own motion."""
    _focus(scene, 1.5, near=(0.7, 9.0))
    _wall(scene, 5.0, _patchwork(8.0))
    _ball(scene, "Ball", (60, 1.5, -10), 60, _material("Ball", _checks(RED, CREAM, 22.0)))
    for number, (x, depth) in enumerate(((-120, 0.75), (-10, 1.1), (150, 2.6))):
        post = _material(f"Post {number}", _checks(*PAIRS[number], 16.0 / depth))
        _card(scene, f"Post {number}", (x, depth, 0), (24, 420), post, (0, 6 * number, 0))
    step = _units(scene, 36.0, 1.5)
    building.key(scene.camera, "location", {FRAME + n: (step * n, 0.0, 0.0) for n in (-2, 2)})


# The sequences.

_SMALL = View(columns=320, rows=180)


def focus_pull(scene: bpy.types.Scene) -> None:
    """Pull the focus from near leaves over a subject to a far wall; nothing moves."""
    _still(scene)
    near, far = 1.0 / 0.62, 1.0 / 4.5
    distances = {n: 1.0 / (near + (far - near) * (n - 1) / (FRAMES - 1)) for n in range(1, FRAMES + 1)}
    building.key(scene.camera.data, "dof.focus_distance", distances)


def camera_move(scene: bpy.types.Scene) -> None:
    """Slide the camera past near leaves, focused on a subject: silhouettes creep over what is behind."""
    _still(scene)
    half = _units(scene, 24.0, 1.5)
    building.key(scene.camera, "location", {1: (-half, 0.0, 0.0), FRAMES: (half, 0.0, 0.0)})


for _build in (focus_pull, camera_move):
    SEQUENCES[_build.__name__] = LensScene(_build.__name__, _build, _SMALL, frames=FRAMES)


# What they are made of.

RED: Color = (0.75, 0.08, 0.05)
BLUE: Color = (0.06, 0.18, 0.70)
GREEN: Color = (0.10, 0.45, 0.12)
OCHRE: Color = (0.60, 0.36, 0.06)
DARK: Color = (0.03, 0.03, 0.05)
CREAM: Color = (0.90, 0.82, 0.62)
GREY: Color = (0.35, 0.35, 0.38)
PAIRS: tuple[tuple[Color, Color], ...] = (
    (GREEN, DARK),
    (OCHRE, CREAM),
    (DARK, OCHRE),
    (BLUE, GREEN),
    (RED, CREAM),
)


def _focus(scene: bpy.types.Scene, distance: float, *, near: tuple[float, float]) -> None:
    """Focus at a distance, with the f-stop that gives a depth a circle of so many pixels' radius."""
    depth, radius = near
    camera = scene.camera.data
    focal = camera.lens / 1000.0
    circle = 2.0 * radius * (SENSOR_MM / 1000.0) / _pixels(scene)
    camera.dof.focus_distance = distance
    camera.dof.aperture_fstop = focal**2 * abs(1.0 / distance - 1.0 / depth) / circle


def _pixels(scene: bpy.types.Scene) -> int:
    """Return how many pixels the sensor's longer side has."""
    return int(max(scene.render.resolution_x, scene.render.resolution_y))


def _units(scene: bpy.types.Scene, pixels: float, depth: float) -> float:
    """Return how many units are as wide as a number of pixels at a depth."""
    return pixels * depth * SENSOR_MM / (scene.camera.data.lens * _pixels(scene))


def _at(scene: bpy.types.Scene, x: float, depth: float, z: float) -> building.Vector3:
    """Return the place at a depth that is seen so many pixels right of and above the picture's middle."""
    return (_units(scene, x, depth), depth, _units(scene, z, depth))


def _card(
    scene: bpy.types.Scene,
    name: str,
    place: tuple[float, float, float],
    size: tuple[float, float],
    material: bpy.types.Material,
    turn: building.Vector3 = (0.0, 0.0, 0.0),
) -> bpy.types.Object:
    """Add a rectangle that faces the camera, then turned about its middle; place and size in pixels."""
    width, height = (_units(scene, side, place[1]) for side in size)
    data = building.plane(name, width, height)
    data.transform(Matrix.Rotation(math.radians(90.0), 4, "X"))
    return building.add(scene, name, data, _at(scene, *place), turn, material)


def _ball(
    scene: bpy.types.Scene,
    name: str,
    place: tuple[float, float, float],
    radius: float,
    material: bpy.types.Material,
    rings: int = 32,
) -> bpy.types.Object:
    """Add a ball; place and radius in pixels."""
    data = building.sphere(name, _units(scene, radius, place[1]), rings)
    return building.add(scene, name, data, _at(scene, *place), (0.0, 0.0, 0.0), material)


def _wall(scene: bpy.types.Scene, depth: float, pattern: Pattern, *, lit: bool = False) -> bpy.types.Object:
    """Add a wall across all that the camera sees."""
    material = _material("Wall", pattern, lit=lit)
    return _card(scene, "Wall", (0.0, depth, 0.0), (1200.0, 1200.0), material)


def _grid(
    scene: bpy.types.Scene,
    name: str,
    place: tuple[float, float, float],
    size: tuple[float, float],
    count: int,
    width: float,
    pattern: Pattern,
) -> bpy.types.Object:
    """Add a lattice of `count` bars each way with holes between them; sizes in pixels."""
    across, up, bar = (_units(scene, pixels, place[1]) for pixels in (*size, width))

    def build(work: bmesh.types.BMesh) -> None:
        for number in range(count):
            share = number / (count - 1) - 0.5
            for middle, sides in (
                ((share * across, 0.0, 0.0), (bar, 0.0, up + bar)),
                ((0.0, 0.0, share * up), (across + bar, 0.0, bar)),
            ):
                corners = [
                    work.verts.new([m + 0.5 * sign[axis > 0] * side for axis, (m, side) in enumerate(zip(
                        middle, sides, strict=True))])
                    for sign in ((-1, -1), (1, -1), (1, 1), (-1, 1))
                ]  # fmt: skip
                work.faces.new(corners)

    return building.add(
        scene, name, building.mesh(name, build), _at(scene, *place), (0.0, 0.0, 0.0), _material(name, pattern)
    )


def _leaf(name: str) -> bpy.types.Mesh:
    """Return a pointed leaf of length 2 in the plane y = 0."""
    outline = [(0.0, -1.0), (0.35, -0.45), (0.42, 0.1), (0.25, 0.6), (0.0, 1.0), (-0.25, 0.6), (-0.42, 0.1),
               (-0.35, -0.45)]  # fmt: skip

    def build(work: bmesh.types.BMesh) -> None:
        work.faces.new([work.verts.new((x, 0.0, z)) for x, z in outline])

    return building.mesh(name, build)


def _glide(scene: bpy.types.Scene, thing: bpy.types.Object, pixels: tuple[float, float]) -> None:
    """Move a thing evenly, so many pixels a frame at its own depth."""
    here = tuple(thing.location)
    step = [_units(scene, speed, here[1]) for speed in pixels]
    places = {FRAME + n: (here[0] + n * step[0], here[1], here[2] + n * step[1]) for n in (-2, 2)}
    building.key(thing, "location", places)


def _subject(scene: bpy.types.Scene) -> None:
    """Fill a scene with a lit subject in focus between near leaves and a far wall with lamps."""
    _focus(scene, 1.5, near=(0.6, 18.0))
    building.sky(scene, (0.75, 0.85, 1.0), 0.35)
    building.lamp(scene, "Sun", "SUN", 2.6, (0.0, 0.0, 4.0), (1.6, 3.4, 0.0), size=0.0)
    _wall(scene, 5.0, _patchwork(7.0), lit=True)
    head = _material("Head", _checks(RED, CREAM, 26.0), lit=True)
    _ball(scene, "Head", (20, 1.5, 25), 68, head)
    body = building.cylinder(
        "Body", _units(scene, 85, 1.55), _units(scene, 150, 1.55), top=_units(scene, 45, 1.55)
    )
    coat = _material("Coat", _stripes(BLUE, CREAM, 45.0), lit=True)
    building.add(scene, "Body", body, _at(scene, 20, 1.55, -125), (0.0, 0.0, 0.0), coat)
    for number, (x, depth, z) in enumerate(((-150, 3.2, 40), (150, 3.8, 10), (110, 3.0, 70), (-60, 3.6, 90))):
        far = _material(f"Far {number}", _checks(*PAIRS[number], 12.0), lit=True)
        _ball(scene, f"Far {number}", (x, depth, z), 26, far)
    leaf = _leaf("Leaf")
    leaf.materials.append(_material("Leaf", _stripes((0.16, 0.5, 0.12), (0.35, 0.6, 0.1), 55.0), lit=True))
    chance = random.Random(2)
    for number in range(16):
        place = (chance.uniform(-245, -110), chance.uniform(0.55, 0.75), chance.uniform(-140, 20))
        if number % 4 == 3:
            place = (-place[0], place[1], place[2] - 30.0)
        turn = (chance.uniform(-30, 30), chance.uniform(-90, 90), chance.uniform(-40, 40))
        thing = building.add(scene, f"Leaf {number}", leaf, _at(scene, *place), turn)
        thing.scale = (0.05, 0.05, 0.05)


def _still(scene: bpy.types.Scene) -> None:
    """Fill a scene with a subject in focus, leaves close by, posts and a wall far behind; all of it glows."""
    _focus(scene, 1.5, near=(0.6, 11.0))
    _wall(scene, 5.0, _patchwork(7.0))
    _ball(scene, "Head", (12, 1.5, 14), 46, _material("Head", _checks(RED, CREAM, 26.0)))
    _card(scene, "Body", (12, 1.55, -70), (90, 76), _material("Body", _stripes(BLUE, CREAM, 60.0)))
    for number, (x, depth) in enumerate(((-70, 3.2), (85, 2.4), (120, 3.8))):
        post = _material(f"Post {number}", _checks(*PAIRS[number], 9.0))
        _card(scene, f"Post {number}", (x, depth, 0), (9, 300), post, (0.0, 4.0 * number, 0.0))
    leaf = _leaf("Leaf")
    leaf.materials.append(_material("Leaf", _stripes((0.16, 0.5, 0.12), (0.5, 0.75, 0.2), 55.0)))
    chance = random.Random(4)
    for number in range(12):
        side = 1 if number % 3 == 2 else -1
        place = (side * chance.uniform(60, 165), chance.uniform(0.58, 0.8), chance.uniform(-95, 20))
        turn = (chance.uniform(-30, 30), chance.uniform(-90, 90), chance.uniform(-40, 40))
        thing = building.add(scene, f"Leaf {number}", leaf, _at(scene, *place), turn)
        thing.scale = (0.05, 0.05, 0.05)


# What they look like.


def _material(name: str, pattern: Pattern, *, lit: bool = False, opacity: float = 1.0) -> bpy.types.Material:
    """Return a material that glows in the colours of a pattern, or scatters light in them."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        color = pattern(tree)
        shader = building.node(tree, "BsdfDiffuse" if lit else "Emission", Color=color).outputs[0]
        if opacity == 1.0:
            return shader
        return building.mixed(tree, opacity, building.node(tree, "BsdfTransparent").outputs[0], shader)

    material = building.material(name, shade)
    # What glows is seen and lights nothing: looking for it costs time and adds noise.
    material.cycles.emission_sampling = "NONE"
    return material


def _coordinates(tree: Any) -> Any:
    """Return texture coordinates that are nowhere on the edge between two checks of a flat face."""
    place = building.node(tree, "TexCoord").outputs["Object"]
    return building.node(tree, "Mapping", Vector=place, Location=(0.00137, 0.00119, 0.00171)).outputs[0]


def _plain(color: Color, strength: float = 1.0) -> Pattern:
    """Return one colour."""

    def pattern(tree: Any) -> Any:
        socket = building.node(tree, "RGB").outputs[0]
        socket.default_value = (*(strength * c for c in color), 1.0)
        return socket

    return pattern


def _checks(first: Color, second: Color, scale: float) -> Pattern:
    """Return checks of two colours, so many to a unit."""
    return lambda tree: building.node(
        tree, "TexChecker", Vector=_coordinates(tree), Color1=first, Color2=second, Scale=scale
    ).outputs["Color"]


def _stripes(first: Color, second: Sequence[float], scale: float) -> Pattern:
    """Return fine lines of two colours along x and z, so many to a unit."""

    def pattern(tree: Any) -> Any:
        waves = building.node(
            tree,
            "TexWave",
            wave_type="BANDS",
            bands_direction="DIAGONAL",
            Vector=_coordinates(tree),
            Scale=scale / 6.3,
        )
        return _between(tree, waves.outputs["Fac"], first, second)

    return pattern


def _noise(first: Color, second: Color, scale: float) -> Pattern:
    """Return clouds of two colours."""

    def pattern(tree: Any) -> Any:
        clouds = building.node(tree, "TexNoise", Vector=_coordinates(tree), Scale=scale, Detail=4.0)
        share = building.node(tree, "MapRange", Value=clouds.outputs[0], From_Min=0.35, From_Max=0.65)
        return _between(tree, share.outputs[0], first, second)

    return pattern


def _between(tree: Any, share: Any, first: Sequence[float], second: Sequence[float]) -> Any:
    ramp = building.node(tree, "ValToRGB", Fac=share)
    for element, color in zip(ramp.color_ramp.elements, (first, second), strict=True):
        element.color = (*color, 1.0)
    return ramp.outputs["Color"]


def _patchwork(scale: float, strength: float = 2.2) -> Pattern:
    """Return coloured cells under fine checks: detail at every size."""

    def pattern(tree: Any) -> Any:
        place = _coordinates(tree)
        cells = building.node(tree, "TexVoronoi", Vector=place, Scale=scale)
        checks = building.node(
            tree,
            "TexChecker",
            Vector=place,
            Scale=2.3 * scale,
            Color1=(0.42, 0.42, 0.42),
            Color2=(0.14, 0.14, 0.16),
        )
        both = building.node(tree, "VectorMath", operation="MULTIPLY")
        tree.links.new(cells.outputs["Color"], both.inputs[0])
        tree.links.new(checks.outputs["Color"], both.inputs[1])
        louder = building.node(tree, "VectorMath", operation="SCALE")
        tree.links.new(both.outputs[0], louder.inputs[0])
        louder.inputs["Scale"].default_value = strength
        return louder.outputs[0]

    return pattern
