"""A street at night, far behind a toy robot that is in focus: its lights become coloured discs.

The robot is 0.17 m tall and stands on wet setts, a paper boat on its string. Lamps, cars and fairy lights
are 10 to 65 m away and tens to hundreds of times brighter than white, so that a lens at f/1.8 spreads each
over a disc that still glows. One Blender unit is one metre.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import building
from .building import Color, Vector3

FOCAL_LENGTH_MM = 65.0
SENSOR_MM = 36.0
F_STOP = 1.8
FOCUS_DISTANCE = 1.17
"""Depth of the robot's eyes, and nearly of its boat, in metres."""

_CAMERA: Vector3 = (0.0, 0.0, 0.115)
_TARGET: Vector3 = (-0.035, 1.2, 0.150)
_ROBOT: Vector3 = (-0.135, 1.2, 0.0)
_ROBOT_TURN = 38.0
_HAND: Vector3 = (0.078, -0.040, 0.078)
"""The robot's hand that holds the string, in its own coordinates."""

_BOAT: Vector3 = (0.085, 1.165, 0.0)
_BOAT_TURN = 12.0

_SODIUM: Color = (1.0, 0.44, 0.10)
_TUNGSTEN: Color = (1.0, 0.56, 0.20)
_WHITE: Color = (1.0, 0.86, 0.62)
_RED: Color = (1.0, 0.035, 0.02)
_AMBER: Color = (1.0, 0.30, 0.02)
_GREEN: Color = (0.04, 1.0, 0.28)
_CYAN: Color = (0.03, 0.62, 1.0)
_BLUE: Color = (0.04, 0.12, 1.0)
_VIOLET: Color = (0.42, 0.06, 1.0)
_MAGENTA: Color = (1.0, 0.04, 0.42)

_PIXEL = SENSOR_MM / 960.0 / FOCAL_LENGTH_MM
"""Width of a pixel at 1 m."""

_LEFT, _RIGHT = -4.2, 5.2
"""Where the house fronts stand, across the street."""


def build() -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Returns
    -------
    Scene
        The scene, 960 x 540, its camera focused on the robot.
    """
    scene = building.empty_scene("Night Street", 960, 540, samples=40, bounces=3)
    scene.cycles.use_denoising = True
    # Wet stones throw the brightest lights on to each other as fireflies.
    scene.cycles.sample_clamp_indirect = 8.0
    building.camera(
        scene, FOCAL_LENGTH_MM, SENSOR_MM, _CAMERA, _TARGET, f_stop=F_STOP, focus_distance=FOCUS_DISTANCE
    )
    building.sky(scene, (0.010, 0.019, 0.046))
    kit = _Kit(scene)
    street = _Street(kit)
    street.ground()
    street.houses()
    street.lamps()
    street.strings()
    street.signs()
    street.traffic()
    street.leaves()
    _robot(kit)
    _boat(kit)
    _set_lighting(scene)
    return scene


def disc_strength(level: float, radius: float, depth: float) -> float:
    """Return how brightly a round light has to glow for its disc to have a given level.

    Parameters
    ----------
    level : float
        Level in the middle of the disc that the lens makes of the light.
    radius, depth : float
        The light's radius, and its distance from the lens, in metres.

    Returns
    -------
    float
        Its radiance: the level times the area of the circle of confusion (TOG 1982, eq. 9, the field of view
        held) over that of the light's sharp image.
    """
    opening = FOCAL_LENGTH_MM / 1000.0 / F_STOP
    return level * (opening * (depth - FOCUS_DISTANCE) / (2.0 * radius * FOCUS_DISTANCE)) ** 2


class _Kit:
    """Meshes and materials that are made once and shared."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene = scene
        self.bulb = building.sphere("Bulb", 1.0, rings=5)
        self.cube = building.box("Cube", (1.0, 1.0, 1.0))
        self.ball = building.sphere("Ball", 1.0, rings=12)
        self.rod = building.cylinder("Rod", 1.0, 1.0, segments=16)
        self.dark = building.principled("Dark", (0.012, 0.013, 0.016), Roughness=0.5)
        self._glows: dict[tuple[Color, float], bpy.types.Material] = {}

    def glow(self, color: Color, strength: float) -> bpy.types.Material:
        """Return the emitter of a colour and strength."""
        known = (color, strength)
        if known not in self._glows:
            self._glows[known] = building.emitter(f"Glow {len(self._glows)}", color, strength)
        return self._glows[known]

    def place(
        self,
        name: str,
        data: bpy.types.ID,
        location: Sequence[float],
        scale: Sequence[float],
        material: bpy.types.Material,
        rotation: Vector3 = (0.0, 0.0, 0.0),
    ) -> bpy.types.Object:
        """Add an object with a material of its own on a mesh that others use too."""
        if not data.materials:
            data.materials.append(self.dark)
        item = building.add(self.scene, name, data, tuple(location), rotation)
        item.scale = scale
        item.material_slots[0].link = "OBJECT"
        item.material_slots[0].material = material
        return item

    def light(
        self, name: str, location: Sequence[float], radius_px: float, color: Color, level: float
    ) -> None:
        """Add a glowing ball by what it is in the picture.

        Parameters
        ----------
        name : str
            Its name.
        location : sequence of float
            Where it is, in metres.
        radius_px : float
            Of the ball in the sharp picture, in pixels.
        color : tuple of float
            Scene-linear.
        level : float
            How bright the disc is that the lens makes of it, where its colour is 1.
        """
        depth = location[1]
        radius = radius_px * _PIXEL * depth
        self.place(
            name, self.bulb, location, (radius,) * 3, self.glow(color, disc_strength(level, radius, depth))
        )

    def bar(
        self,
        name: str,
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        material: bpy.types.Material,
    ) -> bpy.types.Object:
        """Add a round bar from one place to another."""
        first, last = Vector(start), Vector(end)
        along = last - first
        item = self.place(name, self.rod, (first + last) / 2, (radius, radius, along.length), material)
        item.rotation_euler = along.to_track_quat("Z", "Y").to_euler()
        return item


class _Street:
    """All that is behind the robot, and a little before it."""

    def __init__(self, kit: _Kit) -> None:
        self.kit = kit
        self.random = np.random.default_rng(1982)

    def ground(self) -> None:
        """Lay one wet surface from before the camera to the end of the street."""
        data = building.plane("Ground", 60.0, 200.0)
        building.add(self.kit.scene, "Ground", data, (0.0, 95.0, 0.0), (0.0, 0.0, 0.0), _setts())

    def houses(self) -> None:
        """Build two rows of house fronts with shops below, and towers at the end of the street."""
        front = _house_front()
        for side, shops in (
            (_LEFT, (_TUNGSTEN,)),
            (_RIGHT, (_AMBER, _CYAN, _SODIUM, _MAGENTA, _TUNGSTEN, _CYAN)),
        ):
            y = 7.0
            for number in range(11):
                width, height, depth = self.random.uniform(7.0, 9.0), self.random.uniform(9.0, 17.0), 6.0
                x = side + math.copysign(0.5 * depth, side)
                place = (x, y + 0.5 * width, 0.5 * height)
                self.kit.place("House", self.kit.cube, place, (depth, width - 0.3, height), front)
                if number < len(shops):
                    self._shop(side, y, width, shops[number])
                y += width
        for x, height in ((-14.0, 24.0), (-3.0, 15.0), (8.0, 29.0), (19.0, 18.0)):
            self.kit.place("Tower", self.kit.cube, (x, 130.0, 0.5 * height), (10.0, 8.0, height), front)

    def _shop(self, side: float, y: float, width: float, color: Color) -> None:
        goods = _shop_window(color, 0.5 if side == _LEFT else 1.25)
        inwards = -math.copysign(0.04, side)
        for step in range(4):
            place = (side + inwards, y + width * (0.14 + 0.24 * step), 1.30)
            self.kit.place("Shop", self.kit.cube, place, (0.05, width * 0.20, 1.7), goods)

    def lamps(self) -> None:
        """Put street lamps on the right, lanterns on the walls on the left."""
        for number in range(6):
            x, y, z = _RIGHT - 0.9, 25.0 + 8.0 * number, 3.9
            self.kit.bar("Post", (x, y, 0.0), (x, y, z), 0.05, self.kit.dark)
            self.kit.light("Lamp", (x, y, z), 3.0, _SODIUM, 0.85)
        for y, z in ((10.5, 1.75), (12.8, 2.15)):
            self.kit.light("Lantern", (_LEFT + 0.5, y, z), 3.0, _SODIUM, 0.8)

    def strings(self) -> None:
        """Hang fairy lights across the street."""
        colors = (_TUNGSTEN, _CYAN, _TUNGSTEN, _RED, _AMBER, _GREEN, _TUNGSTEN, _MAGENTA)
        for number, (y, height, sag) in enumerate(((12.0, 2.30, 0.35), (17.0, 3.20, 0.9), (26.0, 4.60, 1.5))):
            count = 10
            for step in range(count):
                share = (step + 0.35 * (number % 2) + 0.3) / count
                x = _LEFT + (_RIGHT - _LEFT) * share
                z = height - sag * (1.0 - (2.0 * share - 1.0) ** 2)
                color = colors[(step + 3 * number) % len(colors)]
                self.kit.light("Fairy Light", (x, y + 0.6 * share, z), 1.8, color, 0.75)

    def signs(self) -> None:
        """Hang out neon letters on both sides."""
        for text, x, y, z, size, color in (
            ("J\nA\nZ\nZ", _RIGHT - 0.75, 21.5, 3.5, 0.8, _VIOLET),
            ("HOTEL", _RIGHT - 3.8, 44.0, 5.0, 1.1, _BLUE),
            ("CAFE", _LEFT + 0.8, 15.0, 1.9, 0.5, _GREEN),
        ):
            curve = bpy.data.curves.new(text.replace("\n", ""), "FONT")
            curve.body, curve.size, curve.align_x = text, size, "CENTER"
            curve.materials.append(self.kit.glow(color, 4.0))
            building.add(self.kit.scene, curve.name, curve, (x, y, z), (90.0, 0.0, 0.0))

    def traffic(self) -> None:
        """Add traffic lights, cars that come and cars that go."""
        for x, y, z, color in ((2.6, 23.0, 2.9, _RED), (0.1, 41.0, 3.3, _GREEN), (3.2, 41.0, 2.6, _GREEN)):
            self.kit.bar("Post", (x, y, 0.0), (x, y, z + 0.4), 0.06, self.kit.dark)
            self.kit.place("Case", self.kit.cube, (x, y, z - 0.3), (0.34, 0.2, 1.0), self.kit.dark)
            self.kit.light("Signal", (x, y - 0.15, z), 3.0, color, 1.0)
        shape = _car()
        for x, y, coming in ((0.75, 24.0, True), (2.9, 27.0, False), (0.5, 41.0, True), (3.0, 45.0, False)):
            self.kit.place("Car", shape, (x, y, 0.0), (1.0, 1.0, 1.0), self.kit.dark)
            for side in (-0.62, 0.62):
                color, level = (_WHITE, 1.2) if coming else (_RED, 1.0)
                self.kit.light("Car Light", (x + side, y - 0.04, 0.68), 3.5, color, level)

    def leaves(self) -> None:
        """Strew fallen leaves: five before the plane in focus, one behind it."""
        autumn = building.material("Leaf", _cloth((0.62, 0.17, 0.015), (0.70, 0.22, 0.02), 0.4))
        shape = _leaf()
        for x, y, tilt, turn in (
            (-0.262, 1.04, 10.0, 35.0),
            (-0.020, 1.02, 10.0, 250.0),
            (0.260, 1.42, 10.0, 110.0),
            (0.172, 0.90, 34.0, 50.0),
            (0.132, 0.88, 24.0, 300.0),
            (-0.150, 0.86, 20.0, 75.0),
        ):
            self.kit.place("Leaf", shape, (x, y, 0.010), (0.055,) * 3, autumn, (tilt, -14.0, turn))


def _leaf() -> bpy.types.Mesh:
    """Return a leaf 1 m long from its stalk at the origin along y, folded a little along the middle."""
    outline = ((0.0, 0.0), (0.22, 0.18), (0.34, 0.42), (0.25, 0.70), (0.0, 1.0))
    vertices = [(0.0, y, 0.0) for _, y in outline]
    vertices += [(side * x, y, 0.25 * x) for side in (-1.0, 1.0) for x, y in outline[1:-1]]
    faces = []
    for first in (5, 8):
        faces += [(0, 1, first), (1, 2, first + 1, first), (2, 3, first + 2, first + 1), (3, 4, first + 2)]
    data = bpy.data.meshes.new("Leaf")
    data.from_pydata(vertices, [], faces)
    return data


def _car() -> bpy.types.Mesh:
    """Return a car across the y axis, from y = 0 on; its profile is the same all over its width."""
    outline = (
        (0.0, 0.25),
        (0.0, 0.85),
        (0.35, 0.95),
        (0.95, 1.42),
        (2.55, 1.42),
        (3.25, 0.95),
        (4.2, 0.80),
        (4.2, 0.25),
    )
    count = len(outline)
    vertices = [(x, y, z) for x in (-0.86, 0.86) for y, z in outline]
    faces = [(n, (n + 1) % count, count + (n + 1) % count, count + n) for n in range(count)]
    faces += [tuple(range(count))[::-1], tuple(range(count, 2 * count))]
    data = bpy.data.meshes.new("Car")
    data.from_pydata(vertices, [], faces)
    return data


def _setts() -> bpy.types.Material:
    """Stones with domed tops, wet, so that every one has a highlight of its own."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        stones = building.node(
            tree, "TexVoronoi", feature="DISTANCE_TO_EDGE", Vector=place, Scale=16.0, Randomness=0.45
        )
        dome = building.node(
            tree, "MapRange", interpolation_type="SMOOTHSTEP", Value=stones.outputs["Distance"], From_Max=0.28
        )
        grain = building.node(tree, "TexNoise", Vector=place, Scale=180.0, Detail=3.0)
        pools = building.node(tree, "TexNoise", Vector=place, Scale=1.3, Detail=2.0)
        rough = building.node(
            tree, "MapRange", Value=pools.outputs[0], From_Min=0.40, From_Max=0.62, To_Min=0.08, To_Max=0.20
        )
        fine = building.node(tree, "Bump", Distance=0.0008, Strength=0.5, Height=grain.outputs[0])
        stone = building.node(
            tree, "Bump", Distance=0.012, Strength=0.8, Height=dome.outputs[0], Normal=fine.outputs[0]
        )
        film = building.node(tree, "Bump", Distance=0.010, Strength=0.7, Height=dome.outputs[0])
        tint = building.node(
            tree,
            "Mix",
            data_type="RGBA",
            Factor=dome.outputs[0],
            A=(0.006, 0.006, 0.008, 1.0),
            B=(0.045, 0.046, 0.054, 1.0),
        )
        return building.node(
            tree,
            "BsdfPrincipled",
            Base_Color=tint.outputs["Result"],
            Roughness=0.35,
            Normal=stone.outputs[0],
            Coat_Weight=1.0,
            Coat_Roughness=rough.outputs[0],
            Coat_Normal=film.outputs[0],
        ).outputs["BSDF"]

    return building.material("Setts", shade)


def _shop_window(color: Color, level: float) -> bpy.types.Material:
    """Shelves behind glass, lit from above."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        stretched = building.node(tree, "Mapping", Vector=place, Scale=(0.0, 7.0, 5.0))
        goods = building.node(
            tree, "TexVoronoi", Vector=stretched.outputs[0], distance="CHEBYCHEV", Scale=1.0
        )
        value = building.node(tree, "SeparateXYZ", Vector=goods.outputs["Color"])
        height = building.node(tree, "SeparateXYZ", Vector=place)
        above = building.node(
            tree, "MapRange", Value=height.outputs["Z"], From_Min=-0.5, From_Max=0.5, To_Min=0.4, To_Max=1.3
        )
        stock = building.node(
            tree, "MapRange", Value=value.outputs["X"], To_Min=0.25 * level, To_Max=1.35 * level
        )
        strength = _product(tree, stock.outputs[0], above.outputs[0])
        return building.node(tree, "Emission", Color=color, Strength=strength).outputs[0]

    return building.material("Shop Window", shade)


def _house_front() -> bpy.types.Material:
    """Dark masonry with windows, some of them lit."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "NewGeometry").outputs["Position"]
        cells = building.node(tree, "VectorMath", operation="DIVIDE")
        tree.links.new(place, cells.inputs[0])
        cells.inputs[1].default_value = (1.5, 1.5, 2.9)
        number, inside = (building.node(tree, "VectorMath", operation=o) for o in ("FLOOR", "FRACTION"))
        for part in (number, inside):
            tree.links.new(cells.outputs[0], part.inputs[0])
        chance = building.node(tree, "TexWhiteNoise", Vector=number.outputs[0])
        axes = building.node(tree, "SeparateXYZ", Vector=inside.outputs[0])
        across = _between(tree, axes.outputs["Y"], 0.24, 0.76)
        along = _between(tree, axes.outputs["X"], 0.24, 0.76)
        up = _between(tree, axes.outputs["Z"], 0.25, 0.80)
        facing = building.node(
            tree, "SeparateXYZ", Vector=building.node(tree, "NewGeometry").outputs["Normal"]
        )
        sideways = building.node(tree, "Math", operation="ABSOLUTE")
        tree.links.new(facing.outputs["X"], sideways.inputs[0])
        column = building.node(tree, "Mix", Factor=sideways.outputs[0], A=along, B=across)
        lit = building.node(tree, "Math", operation="GREATER_THAN")
        lit.inputs[1].default_value = 0.72
        tree.links.new(chance.outputs["Value"], lit.inputs[0])
        window = _product(tree, _product(tree, column.outputs[0], up), lit.outputs[0])
        warm = building.node(
            tree,
            "Mix",
            data_type="RGBA",
            Factor=chance.outputs["Color"],
            A=(0.50, 0.22, 0.06, 1.0),
            B=(0.20, 0.24, 0.30, 1.0),
        )
        wall = building.node(
            tree,
            "BsdfPrincipled",
            Base_Color=(0.055, 0.055, 0.065),
            Roughness=0.7,
            Emission_Color=warm.outputs["Result"],
            Emission_Strength=window,
        )
        # What is farther off is lighter and bluer, as through damp air.
        far = building.node(tree, "SeparateXYZ", Vector=place)
        haze = building.node(
            tree, "MapRange", Value=far.outputs["Y"], From_Min=8.0, From_Max=130.0, To_Max=0.055
        )
        mist = building.node(tree, "Emission", Color=(0.30, 0.55, 1.0), Strength=haze.outputs[0])
        both = building.node(tree, "AddShader")
        tree.links.new(wall.outputs["BSDF"], both.inputs[0])
        tree.links.new(mist.outputs[0], both.inputs[1])
        return both.outputs[0]

    new = building.material("House Front", shade)
    # Walls are too large and too dark to be worth looking for as lamps.
    new.cycles.emission_sampling = "NONE"
    return new


def _between(
    tree: bpy.types.ShaderNodeTree, value: bpy.types.NodeSocket, low: float, high: float
) -> bpy.types.NodeSocket:
    middle = building.node(tree, "Math", operation="COMPARE")
    tree.links.new(value, middle.inputs[0])
    middle.inputs[1].default_value = 0.5 * (low + high)
    middle.inputs[2].default_value = 0.5 * (high - low)
    return middle.outputs[0]


def _product(
    tree: bpy.types.ShaderNodeTree, first: bpy.types.NodeSocket, second: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    both = building.node(tree, "Math", operation="MULTIPLY")
    tree.links.new(first, both.inputs[0])
    tree.links.new(second, both.inputs[1])
    return both.outputs[0]


@dataclass(frozen=True, slots=True)
class _Toy:
    """Parts of a toy, all children of one empty."""

    kit: _Kit
    root: bpy.types.Object

    def box(self, size: Vector3, place: Vector3, look: bpy.types.Material, bevel: float = 0.001) -> None:
        """Add a block with rounded edges."""
        data = building.box("Block", size, bevel=bevel)
        data.shade_smooth()
        self._keep(building.add(self.kit.scene, "Block", data, place, (0.0, 0.0, 0.0), look))

    def ball(self, radii: Vector3, place: Vector3, look: bpy.types.Material) -> None:
        """Add an ellipsoid."""
        self._keep(self.kit.place("Ball", self.kit.ball, place, radii, look))

    def bar(self, start: Vector3, end: Vector3, radius: float, look: bpy.types.Material) -> None:
        """Add a round bar."""
        self._keep(self.kit.bar("Bar", start, end, radius, look))

    def hose(self, start: Vector3, end: Vector3, radius: float, look: bpy.types.Material) -> None:
        """Add a ribbed bar."""
        self.bar(start, end, 0.8 * radius, look)
        first, last = Vector(start), Vector(end)
        count = max(2, round((last - first).length / (1.1 * radius)))
        step = (last - first) / count
        for number in range(count):
            middle = first + step * (number + 0.5)
            self.bar(middle - 0.25 * step, middle + 0.25 * step, radius, look)

    def mesh(self, data: bpy.types.Mesh, place: Vector3, look: bpy.types.Material) -> bpy.types.Object:
        """Add a mesh of its own."""
        item = building.add(self.kit.scene, data.name, data, place, (0.0, 0.0, 0.0), look)
        self._keep(item)
        return item

    def _keep(self, item: bpy.types.Object) -> None:
        item.parent = self.root


def _toy(kit: _Kit, name: str, place: Vector3, turn: float) -> _Toy:
    return _Toy(kit, building.add(kit.scene, name, None, place, (0.0, 0.0, turn)))


def _robot(kit: _Kit) -> None:
    """Add the robot, turned towards its boat, under a red umbrella."""
    toy = _toy(kit, "Robot", _ROBOT, _ROBOT_TURN)
    paint = building.principled(
        "Enamel", (0.07, 0.38, 0.36), Roughness=0.32, Coat_Weight=0.6, Coat_Roughness=0.12
    )
    cream = building.principled("Cream Enamel", (0.62, 0.50, 0.33), Roughness=0.35, Coat_Weight=0.4)
    metal = building.principled("Tin", (0.52, 0.53, 0.55), Metallic=1.0, Roughness=0.27)
    _legs(toy, paint, metal)
    _body(toy, paint, cream, metal)
    _head(toy, paint, metal)
    _umbrella(toy, metal)


def _legs(toy: _Toy, paint: bpy.types.Material, metal: bpy.types.Material) -> None:
    for x in (-0.0175, 0.0175):
        toy.box((0.027, 0.040, 0.016), (x, -0.005, 0.008), paint, 0.006)
        toy.hose((x, 0.0, 0.014), (x, 0.0, 0.048), 0.0095, metal)


def _body(toy: _Toy, paint: bpy.types.Material, cream: bpy.types.Material, metal: bpy.types.Material) -> None:
    toy.box((0.050, 0.036, 0.010), (0.0, 0.0, 0.050), metal, 0.003)
    toy.box((0.068, 0.048, 0.064), (0.0, 0.0, 0.086), paint, 0.009)
    toy.box((0.048, 0.004, 0.030), (0.0, -0.0240, 0.094), cream, 0.0018)
    toy.bar((-0.010, -0.024, 0.094), (-0.010, -0.0285, 0.094), 0.0115, metal)
    toy.bar((-0.010, -0.024, 0.094), (-0.010, -0.0290, 0.094), 0.0090, toy.kit.glow(_TUNGSTEN, 0.9))
    toy.bar((-0.010, -0.0292, 0.094), (-0.0045, -0.0292, 0.0985), 0.0008, toy.kit.dark)
    for z, color in ((0.1015, _RED), (0.094, _AMBER), (0.0865, _GREEN)):
        toy.ball((0.0032, 0.0022, 0.0032), (0.0115, -0.0262, z), toy.kit.glow(color, 1.6))
    for z in (0.0625, 0.067, 0.0715):
        toy.box((0.034, 0.002, 0.0016), (0.0, -0.0240, z), toy.kit.dark, 0.0004)
    for x in (-0.029, 0.029):
        for z in (0.060, 0.112):
            toy.ball((0.0016, 0.0016, 0.0016), (x, -0.0240, z), metal)
    # One arm holds the umbrella, the other one the boat's string.
    for shoulder, elbow, hand in (
        ((-0.040, 0.0, 0.106), (-0.060, -0.010, 0.080), (-0.054, -0.030, 0.098)),
        ((0.040, 0.0, 0.106), (0.062, -0.012, 0.086), _HAND),
    ):
        toy.ball((0.0105, 0.0105, 0.0105), shoulder, metal)
        toy.hose(shoulder, elbow, 0.0070, metal)
        toy.ball((0.0076, 0.0076, 0.0076), elbow, metal)
        toy.hose(elbow, hand, 0.0070, metal)
        toy.ball((0.0085, 0.0085, 0.0085), hand, paint)


def _head(toy: _Toy, paint: bpy.types.Material, metal: bpy.types.Material) -> None:
    toy.hose((0.0, 0.0, 0.114), (0.0, 0.0, 0.128), 0.0115, metal)
    toy.box((0.060, 0.048, 0.044), (0.0, 0.0, 0.148), paint, 0.011)
    for x in (-0.0145, 0.0145):
        toy.bar((x, -0.022, 0.152), (x, -0.0275, 0.152), 0.0112, metal)
        toy.ball((0.0088, 0.0040, 0.0088), (x, -0.0270, 0.152), toy.kit.glow(_TUNGSTEN, 1.5))
        toy.ball((0.0036, 0.0020, 0.0036), (x + 0.0022, -0.0302, 0.1505), toy.kit.dark)
    toy.box((0.026, 0.003, 0.0064), (0.0, -0.0240, 0.1345), toy.kit.dark, 0.0008)
    for x in (-0.0085, -0.0028, 0.0028, 0.0085):
        toy.box((0.0014, 0.004, 0.0064), (x, -0.0242, 0.1345), metal, 0.0003)
    for side in (-1.0, 1.0):
        toy.bar((side * 0.029, 0.0, 0.150), (side * 0.036, 0.0, 0.150), 0.0100, metal)
        toy.ball((0.004, 0.004, 0.004), (side * 0.038, 0.0, 0.150), paint)


def _umbrella(toy: _Toy, metal: bpy.types.Material) -> None:
    foot, top = Vector((-0.056, -0.034, 0.070)), Vector((-0.024, -0.010, 0.236))
    toy.bar(tuple(foot), tuple(top), 0.0017, metal)
    toy.ball((0.0045, 0.0045, 0.0090), tuple(foot), toy.kit.dark)
    toy.ball((0.0030, 0.0030, 0.0060), tuple(top), metal)
    cloth = building.material("Umbrella Cloth", _cloth((0.62, 0.022, 0.018), (0.80, 0.040, 0.022), 0.45))
    canopy = toy.mesh(_canopy(0.098, 0.046), tuple(top), cloth)
    canopy.rotation_euler = (top - foot).to_track_quat("Z", "Y").to_euler()


def _cloth(
    seen: Color, through: Color, share: float
) -> Callable[[bpy.types.ShaderNodeTree], bpy.types.NodeSocket]:
    """Return the shading of something thin that light comes through."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        front = building.node(tree, "BsdfDiffuse", Color=seen)
        back = building.node(tree, "BsdfTranslucent", Color=through)
        return building.mixed(tree, share, front.outputs[0], back.outputs[0])

    return shade


def _canopy(radius: float, height: float, ribs: int = 8) -> bpy.types.Mesh:
    """Return an umbrella's cloth, its top at the origin: taut between ribs, with an arched rim."""
    steps, rings = 6 * ribs, 8
    turns = np.arange(steps) * 2.0 * math.pi / steps
    slack = np.abs(np.sin(0.5 * ribs * turns))
    vertices = []
    for ring in range(1, rings + 1):
        share = ring / rings
        across = radius * np.sin(0.5 * math.pi * share * 0.96) * (1.0 - 0.10 * slack * share**2)
        down = -height * (1.0 - np.cos(0.5 * math.pi * share)) * (1.0 - 0.16 * slack * share**4)
        vertices += list(zip(across * np.cos(turns), across * np.sin(turns), down, strict=True))
    vertices.append((0.0, 0.0, 0.0))
    faces = [(steps * rings, step, (step + 1) % steps) for step in range(steps)]
    for ring in range(rings - 1):
        for step in range(steps):
            after = (step + 1) % steps
            low, high = ring * steps, (ring + 1) * steps
            faces.append((low + step, high + step, high + after, low + after))
    data = bpy.data.meshes.new("Canopy")
    data.from_pydata(vertices, [], faces)
    return data


def _boat(kit: _Kit) -> None:
    """Add a folded paper boat with a candle inside, and the string from the robot's hand."""
    toy = _toy(kit, "Boat", _BOAT, _BOAT_TURN)
    paper = building.material("Paper", _cloth((0.82, 0.79, 0.72), (0.90, 0.74, 0.50), 0.5))
    toy.mesh(_folded_boat(0.13, 0.042, 0.032), (0.0, 0.0, 0.0), paper)
    candle = building.lamp(kit.scene, "Candle", "POINT", 0.10, _BOAT, size=0.004, color=(1.0, 0.55, 0.20))
    candle.location.z = 0.040
    candle.visible_camera = False
    hand = _turned(_HAND, _ROBOT_TURN) + Vector(_ROBOT)
    bow = _turned((-0.065, 0.0, 0.045), _BOAT_TURN) + Vector(_BOAT)
    _string(kit, hand, bow)


def _turned(place: Vector3, degrees: float) -> Vector:
    """Return a place turned about the vertical."""
    return Matrix.Rotation(math.radians(degrees), 3, "Z") @ Vector(place)


def _string(kit: _Kit, first: Vector, last: Vector, sag: float = 0.020, count: int = 10) -> None:
    twine = building.diffuse("Twine", (0.55, 0.45, 0.32))
    shares = np.linspace(0.0, 1.0, count + 1)
    places = [first.lerp(last, s) - Vector((0.0, 0.0, 4.0 * sag * s * (1.0 - s))) for s in shares]
    for start, end in itertools.pairwise(places):
        kit.bar("String", start, end, 0.0008, twine)


def _folded_boat(length: float, width: float, rim: float) -> bpy.types.Mesh:
    """Return the paper boat that everyone folds: a hull that rises to both ends, and a tent in its middle."""
    half, side, keel = 0.5 * length, 0.5 * width, 0.30 * length
    bow, stern = (-half, 0.0, 1.45 * rim), (half, 0.0, 1.45 * rim)
    vertices = [
        bow,
        stern,
        (-keel, 0.0, 0.0),
        (keel, 0.0, 0.0),
        (0.0, -side, rim),
        (0.0, side, rim),
        (-0.55 * half, 0.0, 0.75 * rim),
        (0.55 * half, 0.0, 0.75 * rim),
        (0.0, 0.0, 2.35 * rim),
        (0.0, -0.75 * side, 0.0),
        (0.0, 0.75 * side, 0.0),
    ]
    faces = []
    for edge, foot in ((4, 9), (5, 10)):
        faces += [(0, 2, edge), (2, foot, edge), (foot, 3, edge), (3, 1, edge), (6, edge, 8), (edge, 7, 8)]
    data = bpy.data.meshes.new("Paper Boat")
    data.from_pydata(vertices, [], faces)
    return data


def _set_lighting(scene: bpy.types.Scene) -> None:
    """Add what a film crew would: lamps from behind on both sides, and one from the front."""
    chest = (_ROBOT[0], _ROBOT[1], 0.12)
    for name, power, place, size, color in (
        ("Cyan Rim", 2.5, (-0.75, 1.65, 0.22), 0.25, (0.15, 0.60, 1.0)),
        ("Magenta Rim", 2.5, (0.50, 1.75, 0.25), 0.25, (1.0, 0.16, 0.42)),
        ("Back", 4.0, (-0.10, 1.75, 0.62), 0.25, (1.0, 0.75, 0.55)),
        ("Key", 3.9, (-0.50, 0.45, 0.26), 0.35, (1.0, 0.72, 0.48)),
    ):
        lamp = building.lamp(scene, name, "AREA", power, place, chest, size=size, color=color)
        lamp.visible_camera = False
