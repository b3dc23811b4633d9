"""A fast action with rotating wheels: a racing car of the thirties at sunset, the camera going along with it.

Frame 1 is in the middle of the motion. The shutter is the half frame of a film camera, in which the road
passes by a quarter of a metre and each wheel turns as far as it rolls. One Blender unit is one metre.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import building
from .building import Color, Vector3

SPEED = 0.56
"""Metres a frame, along x."""

SHUTTER = 0.5
"""Frames: the 180 degrees of a film camera's."""

AXLES = ((0.84, 0.41), (-0.80, 0.46))
"""Place along the car and radius of the front and the rear wheels, in metres."""

_TRACK = 0.62
_SPOKES = 6
_SEED = 3

_SUNSET = (
    (0.000, (0.10, 0.085, 0.07)),
    (0.499, (0.25, 0.18, 0.12)),
    (0.501, (1.30, 0.66, 0.22)),
    (0.545, (1.00, 0.52, 0.30)),
    (0.590, (0.50, 0.42, 0.50)),
    (0.650, (0.18, 0.32, 0.60)),
    (1.000, (0.06, 0.13, 0.33)),
)
"""Colours of the sky from straight down to straight up."""


def build() -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Returns
    -------
    Scene
        The scene at frame 1.
    """
    scene = building.empty_scene("Wheels", 960, 540, samples=12, bounces=3)
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.render.motion_blur_shutter = SHUTTER
    # At f/5.6 the trees' circles are little more than a pixel wide.
    building.extension_settings(scene, use_lens=False)
    eye, aim = (0.95, -3.55, 0.42), (0.10, 0.0, 0.56)
    camera = building.camera(scene, 36.0, 36.0, eye, aim, f_stop=5.6, focus_distance=3.1)
    _drive_along(camera)
    _light(scene)
    _ground(scene)
    _roadside(scene)
    _car(scene)
    _stones(scene)
    return scene


def _drive_along(item: bpy.types.Object, speed: Vector3 = (SPEED, 0.0, 0.0)) -> None:
    """Let an object go evenly, in metres a frame, past where it is now."""
    for axis, rate in enumerate(speed):
        if rate:
            building.drive(item, "location", axis, rate)
    item.cycles.motion_steps = 2


def _light(scene: bpy.types.Scene) -> None:
    """Let a low sun shine from behind the camera's shoulder under a sky of sunset."""
    building.lamp(
        scene, "Sun", "SUN", 6.0, (-6.0, -8.0, 3.4), (0.0, 0.0, 0.4), size=1.5, color=(1.0, 0.62, 0.30)
    )
    building.gradient_sky(scene, _SUNSET, 0.75)


def _ground(scene: bpy.types.Scene) -> None:
    """Lay meadows, a road with a kerb of red and white on either side, and hills far away."""
    grass = _speckled("Grass", (0.075, 0.115, 0.020), (0.20, 0.22, 0.045), 2.3)
    building.add(scene, "Meadow", building.plane("Meadow", 400.0, 400.0), (0.0, 0.0, -0.02), (0, 0, 0), grass)
    asphalt = _speckled("Asphalt", (0.065, 0.062, 0.066), (0.125, 0.118, 0.115), 7.0)
    building.add(scene, "Road", building.plane("Road", 400.0, 5.2), (0.0, 0.2, 0.0), (0, 0, 0), asphalt)
    red = building.diffuse("Kerb Red", (0.55, 0.03, 0.02))
    white = building.diffuse("Kerb White", (0.75, 0.72, 0.66))
    for name, paint, first in (("Red", red, 0), ("White", white, 1)):
        for side, y in (("Near", -2.2), ("Far", 2.6)):
            stones = [(1.1 * n, y, 0.02) for n in range(first - 24, 25, 2)]
            mesh = _boxes(f"{side} Kerb {name}", stones, (1.1, 0.34, 0.09))
            building.add(scene, mesh.name, mesh, (0, 0, 0), (0, 0, 0), paint)
    line = _boxes("Line", [(4.0 * n, 1.2, 0.003) for n in range(-14, 15)], (1.6, 0.12, 0.004))
    building.add(scene, "Line", line, (0, 0, 0), (0, 0, 0), white)
    hill = building.sphere("Hill", 1.0, rings=20)
    for number, (x, y, width, height) in enumerate(
        ((-60, 110, 60, 13), (5, 130, 70, 10), (70, 105, 45, 15), (-115, 120, 50, 20)), start=1
    ):
        item = building.add(scene, f"Hill {number}", hill, (x, y, -2.0))
        item.scale = (width, 20.0, height)
    hill.materials.append(_speckled("Hill", (0.06, 0.085, 0.04), (0.12, 0.13, 0.05), 0.15))


def _roadside(scene: bpy.types.Scene) -> None:
    """Put up trees, a fence, and flags in all colours along the far side."""
    rng = np.random.default_rng(_SEED)
    bark = building.diffuse("Bark", (0.13, 0.065, 0.03))
    leaves = [
        _speckled(name, low, high, 3.0)
        for name, low, high in (
            ("Leaves 1", (0.05, 0.11, 0.02), (0.16, 0.25, 0.04)),
            ("Leaves 2", (0.16, 0.10, 0.015), (0.42, 0.26, 0.04)),
            ("Leaves 3", (0.20, 0.05, 0.012), (0.48, 0.14, 0.03)),
        )
    ]
    trunk = building.cylinder("Trunk", 0.14, 2.4, top=0.09, segments=16)
    trunk.materials.append(bark)
    crowns = []
    for number, paint in enumerate(leaves, start=1):
        crowns.append(building.sphere(f"Crown {number}", 1.0, rings=24))
        crowns[-1].materials.append(paint)
    for number in range(26):
        x = -30.0 + 2.6 * number + rng.uniform(-0.9, 0.9)
        y = rng.uniform(7.0, 12.0)
        tall = rng.uniform(0.85, 1.35)
        building.add(scene, f"Trunk {number}", trunk, (x, y, 1.0)).scale = (1.0, 1.0, tall)
        crown = building.add(scene, f"Crown {number}", crowns[number % 3], (x, y, 1.3 + 2.1 * tall))
        wide = rng.uniform(1.0, 1.5)
        crown.scale = (wide, wide, wide * rng.uniform(1.1, 1.7))
    wood = building.diffuse("White Wood", (0.72, 0.68, 0.60))
    posts = _boxes("Posts", [(1.5 * n + 0.4, 4.6, 0.42) for n in range(-16, 20)], (0.09, 0.09, 0.9))
    rails = _boxes("Rails", [(0.0, 4.6, z) for z in (0.42, 0.74)], (70.0, 0.05, 0.07))
    for mesh in (posts, rails):
        building.add(scene, mesh.name, mesh, (0, 0, 0), (0, 0, 0), wood)
    poles = [(3.0 * n - 0.6, 5.6, 1.5) for n in range(-9, 12)]
    building.add(scene, "Poles", _boxes("Poles", poles, (0.05, 0.05, 3.0)), (0, 0, 0), (0, 0, 0), wood)
    colors: Sequence[Color] = ((0.80, 0.06, 0.03), (0.95, 0.60, 0.04), (0.03, 0.25, 0.62), (0.75, 0.72, 0.65))
    for number, color in enumerate(colors):
        flags = [(x - 0.55, y, 2.62) for x, y, _ in poles[number :: len(colors)]]
        paint = building.diffuse(f"Flag {number}", color)
        mesh = _boxes(f"Flags {number}", flags, (1.05, 0.03, 0.66))
        building.add(scene, mesh.name, mesh, (0, 0, 0), (0, 0, 0), paint)


def _car(scene: bpy.types.Scene) -> None:
    """Build the car, driver and all, that goes along with the camera."""
    car = building.add(scene, "Car", None)
    _drive_along(car)
    chrome = building.principled("Chrome", (0.86, 0.84, 0.80), Metallic=1.0, Roughness=0.22)
    black = building.principled("Black", (0.015, 0.015, 0.017), Roughness=0.5)
    leather = building.principled("Leather", (0.22, 0.085, 0.03), Roughness=0.55)
    paint = _livery()
    _part(car, _body(), (0.0, 0.0, 0.60), paint, (0.0, 90.0, 0.0), (1.0, 0.92, 1.0))
    grille = building.cylinder("Grille", 0.225, 0.01)
    _part(car, grille, (1.165, 0.0, 0.60), black, (0.0, 90.0, 0.0), (1.0, 0.92, 1.0))
    rim = _ring("Grille Rim", 0.235, 0.022)
    _part(car, rim, (1.16, 0.0, 0.60), chrome, (0.0, 90.0, 0.0), (1.0, 0.92, 1.0))
    bars = _boxes("Bars", [(1.175, 0.06 * n, 0.60) for n in range(-2, 3)], (0.012, 0.014, 0.38))
    _part(car, bars, (0.0, 0.0, 0.0), chrome)
    _part(car, building.sphere("Seat", 1.0, 16), (-0.38, 0.0, 0.93), black, scale=(0.36, 0.24, 0.07))
    _part(car, _ring("Seat Rim", 1.0, 0.09), (-0.38, 0.0, 0.945), leather, scale=(0.36, 0.25, 0.4))
    red = building.principled(
        "Red", (0.48, 0.010, 0.006), Roughness=0.3, Coat_Weight=0.5, Coat_Roughness=0.15
    )
    _part(car, building.sphere("Hump", 1.0, 16), (-0.88, 0.0, 0.84), red, scale=(0.44, 0.17, 0.24))
    _part(car, _capsule("Exhaust", 0.045, 1.75), (-0.55, -0.42, 0.42), chrome, (0.0, 90.0, 0.0))
    for n in range(4):
        stub = _capsule(f"Stub {n}", 0.03, 0.30)
        _part(car, stub, (0.20 + 0.14 * n, -0.39, 0.50), chrome, (20.0, -40.0, 0.0))
    for n, y in enumerate((-0.26, 0.26)):
        _part(car, building.sphere(f"Lamp {n}", 0.10, 16), (1.00, y, 0.88), chrome)
    screen = _ring("Screen", 0.17, 0.014)
    _part(car, screen, (0.04, 0.0, 1.00), chrome, (0.0, 70.0, 0.0), (0.75, 1.1, 1.0))
    _driver(car, leather, chrome, black)
    spokes = building.principled("Spokes", (0.85, 0.55, 0.06), Roughness=0.35)
    paints = {"Tyre": _rubber(), "Rim": chrome, "Spokes": spokes, "Hub": chrome, "Spinner": chrome}
    for end, (x, radius) in zip(("Front", "Rear"), AXLES, strict=True):
        shapes = _wheel_shapes(radius, paints)
        axle = building.cylinder(f"{end} Axle", 0.035, 2.0 * _TRACK, segments=16)
        _part(car, axle, (x, 0.0, radius), black, (90.0, 0.0, 0.0))
        for side, y in (("Near", -_TRACK), ("Far", _TRACK)):
            # Plain behind the spokes: what a mover hides of another is filled in evenly.
            drum = building.cylinder(f"{side} {end} Drum", 0.58 * radius, 0.04)
            _part(car, drum, (x, 0.82 * y, radius), black, (90.0, 0.0, 0.0))
            _wheel(car, f"{side} {end}", (x, y, radius), radius, shapes)


def _part(
    car: bpy.types.Object,
    data: bpy.types.Mesh | None,
    location: Vector3,
    paint: bpy.types.Material | None = None,
    rotation: Vector3 = (0.0, 0.0, 0.0),
    scale: Vector3 = (1.0, 1.0, 1.0),
    *,
    name: str = "",
) -> bpy.types.Object:
    """Fix a part to the car, placed from the middle of the car on the road."""
    paints = () if paint is None else (paint,)
    item = building.add(car.users_scene[0], name or data.name, data, location, rotation, *paints)
    item.scale = scale
    item.parent = car
    item.cycles.motion_steps = 3
    return item


def _driver(
    car: bpy.types.Object,
    leather: bpy.types.Material,
    chrome: bpy.types.Material,
    black: bpy.types.Material,
) -> None:
    """Seat a driver with helmet, goggles and scarf."""
    skin = building.principled("Skin", (0.62, 0.33, 0.20), Roughness=0.6)
    cream = building.principled("Helmet", (0.80, 0.70, 0.50), Roughness=0.35)
    yellow = building.diffuse("Scarf", (0.90, 0.50, 0.03))
    head = Vector((-0.36, 0.0, 1.30))

    def on_head(
        data: bpy.types.Mesh, offset: Vector3, paint: bpy.types.Material, turn: float, scale: Vector3
    ) -> None:
        _part(car, data, tuple(head + Vector(offset)), paint, (0.0, turn, 0.0), scale)

    _part(car, building.sphere("Torso", 1.0, 16), (-0.42, 0.0, 1.02), leather, scale=(0.17, 0.23, 0.24))
    on_head(building.sphere("Head", 0.165, 24), (0.0, 0.0, 0.0), skin, 0.0, (1.0, 0.95, 1.05))
    on_head(building.sphere("Nose", 0.035, 16), (0.17, 0.0, -0.03), skin, 0.0, (1.0, 1.0, 1.0))
    dome = [(0.183 * math.sin(a), 0.183 * math.cos(a)) for a in np.linspace(0.62 * math.pi, 0.0, 15)]
    on_head(
        building.turned("Helmet", dome, segments=48), (-0.012, 0.0, 0.012), cream, -24.0, (1.0, 0.97, 1.0)
    )
    on_head(_ring("Strap", 0.184, 0.016), (-0.01, 0.0, 0.03), black, -6.0, (1.0, 0.97, 1.6))
    for side, y in (("Near", -0.062), ("Far", 0.062)):
        on_head(building.sphere(f"{side} Glass", 0.05, 16), (0.145, y, 0.035), black, 0.0, (0.6, 1.0, 0.85))
        on_head(_ring(f"{side} Frame", 0.052, 0.011), (0.158, y, 0.036), chrome, 90.0, (0.85, 1.0, 1.0))
    on_head(_ring("Knot", 0.11, 0.045), (-0.03, 0.0, -0.17), yellow, 0.0, (1.0, 1.0, 1.0))
    for number, y in enumerate((-0.06, 0.05)):
        _part(car, _scarf(f"Scarf {number}", 1.3 * number), (-0.46, y, 1.15), yellow)
    _part(car, _ring("Steering Wheel", 0.17, 0.016), (-0.06, 0.0, 0.99), black, (0.0, -65.0, 0.0))
    for number, y in enumerate((-0.19, 0.19)):
        _part(car, _capsule(f"Arm {number}", 0.055, 0.36), (-0.22, y, 1.04), leather, (0.0, 80.0, 0.0))


def _wheel_shapes(radius: float, paints: Mapping[str, bpy.types.Material]) -> list[bpy.types.Mesh]:
    """Return the parts of a wheel about y, painted by their names."""
    section = 0.185 * radius
    inside = radius - 2.0 * section
    shapes = {
        "Tyre": _ring("Tyre", radius - section, section, sides=24),
        "Rim": _ring("Rim", inside + 0.012, 0.024),
        "Spokes": _spokes(inside, 0.5 * section),
        "Hub": _capsule("Hub", 0.07, 0.26),
        "Spinner": _boxes("Spinner", [(0.0, 0.0, 0.13), (0.0, 0.0, -0.13)], (0.20, 0.045, 0.03)),
    }
    for name, data in shapes.items():
        data.transform(Matrix.Rotation(math.radians(90.0), 4, "X"))
        data.materials.append(paints[name])
    return list(shapes.values())


def _wheel(
    car: bpy.types.Object, name: str, hub: Vector3, radius: float, shapes: Sequence[bpy.types.Mesh]
) -> None:
    """Put a wheel on its axle that turns as it rolls."""
    wheel = _part(car, None, hub, name=name)
    wheel.driver_add("rotation_euler", 1).driver.expression = f"{SPEED / radius} * (frame - 1) + {hub[0]}"
    for number, data in enumerate(shapes, start=1):
        item = building.add(car.users_scene[0], f"{name} {number}", data)
        item.parent = wheel
        item.cycles.motion_steps = 3


def _stones(scene: bpy.types.Scene) -> None:
    """Let the rear wheels throw stones, which the car leaves behind."""
    rng = np.random.default_rng(_SEED)
    stone = building.diffuse("Stone", (0.55, 0.43, 0.31))
    for number in range(26):
        size = rng.uniform(0.014, 0.032)
        x, z = rng.uniform(-1.75, -0.95), rng.uniform(0.04, 0.5)
        y = -_TRACK + rng.uniform(-0.25, 0.25)
        item = building.add(scene, f"Stone {number}", _stone(f"Stone {number}", size, rng), (x, y, z))
        item.data.materials.append(stone)
        _drive_along(item, (SPEED * rng.uniform(0.35, 0.85), 0.0, rng.uniform(-0.03, 0.07)))


def _body() -> bpy.types.Mesh:
    """Return the body, turned about z with its nose up: a pointed tail and a round opening in front."""
    knots = (
        (-1.38, 0.00), (-1.34, 0.06), (-1.20, 0.15), (-0.90, 0.26), (-0.50, 0.355), (-0.10, 0.39),
        (0.30, 0.385), (0.70, 0.345), (0.95, 0.30), (1.10, 0.262), (1.16, 0.240),
    )  # fmt: skip
    places, radii = np.array(knots).T
    z = np.linspace(places[0], places[-1], 70)
    smooth = np.convolve(np.pad(np.interp(z, places, radii), 4, mode="edge"), np.full(9, 1.0 / 9.0), "valid")
    # The ends stay where they are.
    smooth[0], smooth[-1] = radii[0], radii[-1]
    return building.turned("Body", [*zip(smooth, z, strict=True), (0.22, 1.165), (0.0, 1.165)], segments=72)


def _livery() -> bpy.types.Material:
    """Return the body's paint: red, with a number, louvres and a band of cream, seen from the side."""
    rows, columns = 260, 800
    up, along = np.meshgrid(np.linspace(0.42, -0.42, rows), np.linspace(-1.40, 1.20, columns), indexing="ij")
    red, cream, ink = (0.72, 0.10, 0.07), (0.95, 0.90, 0.78), (0.10, 0.09, 0.09)
    pixels = np.ones((rows, columns, 3)) * red
    x, z = along + 0.02, up - 0.05
    pixels[(along > 0.97) & (along < 1.07)] = cream
    pixels[np.hypot(x, z) < 0.235] = cream
    bar = (np.abs(z - 0.125) < 0.027) & (np.abs(x) < 0.095)
    leg = (np.abs(x - 0.065 - 0.45 * (z - 0.125)) < 0.032) & (np.abs(z) < 0.152)
    pixels[bar | leg] = ink
    louvres = (along > 0.26) & (along < 0.86) & (np.mod(along, 0.075) < 0.028) & (np.abs(up - 0.02) < 0.10)
    pixels[louvres] = 0.25 * np.array(red)
    image = building.picture("Livery", pixels)

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        # The body's z is the car's length, and its x points down.
        place = building.node(tree, "TexCoord").outputs["Object"]
        split = building.node(tree, "SeparateXYZ", Vector=place)
        u = building.node(tree, "MapRange", Value=split.outputs["Z"], From_Min=-1.40, From_Max=1.20)
        v = building.node(tree, "MapRange", Value=split.outputs["X"], From_Min=0.42, From_Max=-0.42)
        at = building.node(tree, "CombineXYZ", X=u.outputs[0], Y=v.outputs[0])
        texture = building.node(tree, "TexImage", Vector=at.outputs[0], image=image, extension="EXTEND")
        return building.node(
            tree,
            "BsdfPrincipled",
            Base_Color=texture.outputs["Color"],
            Roughness=0.3,
            Coat_Weight=0.5,
            Coat_Roughness=0.15,
        ).outputs["BSDF"]

    return building.material("Livery", shade)


def _rubber() -> bpy.types.Material:
    """Return the tyres' rubber, with three white marks on the wall, whose arcs show how far it turns."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        def math_node(
            operation: str, value: bpy.types.NodeSocket, *others: bpy.types.NodeSocket | float
        ) -> bpy.types.NodeSocket:
            new = building.node(tree, "Math", operation=operation)
            for socket, given in zip(new.inputs, (value, *others), strict=False):
                if isinstance(given, bpy.types.NodeSocket):
                    tree.links.new(given, socket)
                else:
                    socket.default_value = given
            return new.outputs[0]

        split = building.node(
            tree, "SeparateXYZ", Vector=building.node(tree, "TexCoord").outputs["UV"]
        ).outputs
        turn = math_node("FRACT", math_node("MULTIPLY", split["X"], 3.0))
        on_wall = math_node("COMPARE", split["Y"], 0.52, 0.045)
        ramp = building.node(
            tree, "ValToRGB", Fac=math_node("MULTIPLY", math_node("LESS_THAN", turn, 0.16), on_wall)
        )
        ramp.color_ramp.elements[0].color = (0.022, 0.021, 0.022, 1.0)
        ramp.color_ramp.elements[1].color = (0.75, 0.72, 0.66, 1.0)
        return building.node(
            tree, "BsdfPrincipled", Base_Color=ramp.outputs["Color"], Roughness=0.75
        ).outputs["BSDF"]

    return building.material("Rubber", shade)


def _speckled(name: str, low: Color, high: Color, scale: float) -> bpy.types.Material:
    """Return a matt material that varies between two colours, `scale` times a metre."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        noise = building.node(tree, "TexNoise", Vector=place, Scale=scale, Detail=3.0)
        ramp = building.node(tree, "ValToRGB", Fac=noise.outputs[0])
        for element, position, color in zip(ramp.color_ramp.elements, (0.36, 0.64), (low, high), strict=True):
            element.position, element.color = position, (*color, 1.0)
        return building.node(tree, "BsdfDiffuse", Color=ramp.outputs["Color"]).outputs[0]

    return building.material(name, shade)


def _boxes(name: str, places: Sequence[Vector3], size: Vector3) -> bpy.types.Mesh:
    """Return equal boxes around several places as one mesh."""

    def build(work: bmesh.types.BMesh) -> None:
        for place in places:
            matrix = Matrix.Translation(place) @ Matrix.Diagonal((*size, 1.0))
            bmesh.ops.create_cube(work, size=1.0, matrix=matrix)

    return building.mesh(name, build)


def _ring(name: str, radius: float, thickness: float, *, sides: int = 12) -> bpy.types.Mesh:
    """Return a torus about z."""
    turns = np.linspace(-0.5 * math.pi, 1.5 * math.pi, sides + 1)
    profile = [(radius + thickness * math.cos(a), thickness * math.sin(a)) for a in turns]
    return building.turned(name, profile, segments=72)


def _capsule(name: str, radius: float, length: float) -> bpy.types.Mesh:
    """Return a rod with round ends around the origin along z."""
    turns = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 10)
    half = 0.5 * length - radius
    profile = [(radius * max(math.cos(a), 0.0), radius * math.sin(a) + math.copysign(half, a)) for a in turns]
    return building.turned(name, profile, segments=20)


def _spokes(length: float, depth: float) -> bpy.types.Mesh:
    """Return the spokes of a wheel about z, thinner towards the rim."""

    def build(work: bmesh.types.BMesh) -> None:
        for step in range(_SPOKES):
            made = bmesh.ops.create_cube(work, size=1.0)["verts"]
            for corner in made:
                out = corner.co.y + 0.5
                width = 0.085 - 0.035 * out
                corner.co = Vector(
                    (corner.co.x * width, out * length, corner.co.z * depth * (1.0 - 0.4 * out))
                )
            bmesh.ops.rotate(work, verts=made, matrix=Matrix.Rotation(2.0 * math.pi * step / _SPOKES, 3, "Z"))

    return building.mesh("Spokes", build)


def _scarf(name: str, phase: float) -> bpy.types.Mesh:
    """Return a ribbon that flutters backwards from the origin."""
    steps = np.linspace(0.0, 1.0, 41)
    middle = [
        (
            -0.85 * s,
            0.05 * s * math.sin(9.0 * s + 2.0 * phase),
            0.10 * s * math.sin(11.0 * s + phase) + 0.10 * s,
        )
        for s in steps
    ]
    edge = [(0.035 + 0.03 * s, 0.055 + 0.03 * s) for s in steps]

    def build(work: bmesh.types.BMesh) -> None:
        rows = [
            [work.verts.new((x, y - a, z - b)), work.verts.new((x, y + a, z + b))]
            for (x, y, z), (a, b) in zip(middle, edge, strict=True)
        ]
        for near, far in pairwise(rows):
            work.faces.new((near[0], near[1], far[1], far[0]))

    return building.mesh(name, build, smooth=True)


def _stone(name: str, size: float, rng: np.random.Generator) -> bpy.types.Mesh:
    """Return a rough stone."""

    def build(work: bmesh.types.BMesh) -> None:
        bmesh.ops.create_icosphere(work, subdivisions=1, radius=size)
        for corner in work.verts:
            corner.co *= rng.uniform(0.7, 1.2)

    return building.mesh(name, build)
