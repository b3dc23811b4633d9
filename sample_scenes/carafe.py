"""A carafe on a tiled floor, of glazed earthenware or of glass (TOG 1982, figures 15 and 16).

The papers give the lens (40 mm at f/1.4), its frame (30 x 30 mm), the tiles (50 x 50 mm) and the depth of
field (110 mm), but no distances. By their eqs. 6 and 7 a depth of field of t belongs to the focus distance
D = H sqrt(t / (2 H + t)), which is 1252.4 mm here; the carafe stands there, and all of it that the camera
sees lies within those 110 mm. One Blender unit is one metre.
"""

from __future__ import annotations

import math

import bpy
from mathutils import Vector
from mathutils.geometry import interpolate_bezier

from . import building

FOCAL_LENGTH_MM = 40.0
FILM_MM = 30.0
F_STOP = 1.4
TILE = 0.050
DEPTH_OF_FIELD = 0.110

_HYPERFOCAL = FOCAL_LENGTH_MM / F_STOP
"""In metres: 1000 F / n."""

FOCUS_DISTANCE = _HYPERFOCAL * math.sqrt(DEPTH_OF_FIELD / (2.0 * _HYPERFOCAL + DEPTH_OF_FIELD))

_PITCH = math.radians(12.0)
TURN = math.radians(27.0)
"""Of the tiles about the vertical, so that their edges run into the depth on both sides."""

_FOCUSED = (0.0, -0.020, 0.137)
"""What the lens is focused on: the middle, in depth, of what can be seen of the carafe."""

_WALL = 1.8
"""How far behind the carafe the floor ends."""

_STEPS = 12
"""Straight pieces for each curve of the outline."""

_Curve = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]

_OUTLINE: tuple[_Curve, ...] = (
    # Radius and height in mm. The hollow underside, the rim of the foot, and its waist.
    ((0.0, 5.0), (14.0, 5.0), (31.0, 4.0), (42.0, 0.0)),
    ((42.0, 0.0), (45.5, -0.2), (48.0, 1.5), (47.5, 4.5)),
    ((47.5, 4.5), (46.5, 10.0), (41.0, 10.0), (41.0, 15.0)),
    # Belly, shoulder and neck.
    ((41.0, 15.0), (41.0, 25.0), (78.0, 44.0), (78.0, 86.0)),
    ((78.0, 86.0), (78.0, 134.0), (22.0, 150.0), (19.5, 206.0)),
    ((19.5, 206.0), (18.0, 240.0), (21.0, 272.0), (36.0, 300.0)),
    # Over the lip and down the inner wall to a thick bottom.
    ((36.0, 300.0), (37.4, 303.0), (34.0, 304.8), (32.4, 301.8)),
    ((32.4, 301.8), (17.6, 273.0), (14.5, 240.0), (16.0, 206.0)),
    ((16.0, 206.0), (18.4, 148.0), (74.0, 132.0), (74.0, 86.0)),
    ((74.0, 86.0), (74.0, 42.0), (38.0, 24.0), (0.0, 24.0)),
)


def build(*, transparent: bool = False) -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Parameters
    ----------
    transparent : bool
        Whether the carafe is of glass (figure 16) instead of earthenware (figure 15).

    Returns
    -------
    Scene
        The scene, its camera focused on the carafe, whose pass index is 1.
    """
    scene = building.empty_scene("Carafe", 512, 512, samples=24, bounces=10)
    scene.cycles.diffuse_bounces = 1
    building.extension_settings(scene, sampling="POINTS")
    scene.cycles.sample_clamp_indirect = 3.0
    building.add(
        scene,
        "Carafe",
        building.turned("Carafe", outline(), segments=96),
        (0.0, 0.0, 0.0002),
        (0.0, 0.0, 0.0),
        glass() if transparent else _glaze(),
    )
    building.sky(scene, (0.09, 0.10, 0.12))
    away = Vector((0.0, -math.cos(_PITCH), math.sin(_PITCH))) * FOCUS_DISTANCE
    building.camera(scene, FOCAL_LENGTH_MM, FILM_MM, tuple(Vector(_FOCUSED) + away), _FOCUSED, f_stop=F_STOP)
    building.lamp(
        scene, "Window", "AREA", 30.0, (-1.0, -0.7, 1.1), _FOCUSED, size=0.7, color=(1.0, 0.94, 0.85)
    )
    building.lamp(scene, "Lamp", "AREA", 13.0, (1.25, 0.5, 0.9), _FOCUSED, size=0.35, color=(0.8, 0.9, 1.0))
    still = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    building.add(scene, "Floor", building.plane("Floor", 8.0, 7.0), *still, _tiles())
    wall = building.plane("Wall", 8.0, 4.0)
    building.add(
        scene,
        "Wall",
        wall,
        (0.0, _WALL, 2.0),
        (90.0, 0.0, 0.0),
        building.diffuse("Plaster", (0.10, 0.15, 0.14)),
    )
    return scene


def outline() -> list[tuple[float, float]]:
    """Return the carafe's outline: radius and height in metres, from below over the lip to the inside."""
    points = [(0.0, _OUTLINE[0][0][1])]
    for curve in _OUTLINE:
        points += [(p.x, p.y) for p in interpolate_bezier(*map(Vector, curve), _STEPS + 1)[1:]]
    return [(0.001 * radius, 0.001 * height) for radius, height in points]


def glass() -> bpy.types.Material:
    """Return clear glass that lets light through to its shadow, which without caustics would be black."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        glass = building.node(tree, "BsdfGlass", Roughness=0.0, IOR=1.5, Color=(0.97, 0.99, 0.98))
        clear = building.node(tree, "BsdfTransparent", Color=(0.80, 0.85, 0.83))
        shadow = building.node(tree, "LightPath").outputs["Is Shadow Ray"]
        return building.mixed(tree, shadow, glass.outputs[0], clear.outputs[0])

    return building.material("Glass", shade)


def _tiles() -> bpy.types.Material:
    """Return glossy tiles in two colours."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "NewGeometry").outputs["Position"]
        turned = building.node(tree, "Mapping", Vector=place, Rotation=(0.0, 0.0, TURN))
        # The checker is one in space: halfway between two layers its colours cannot change places.
        lifted = building.node(tree, "Mapping", Vector=turned.outputs[0], Location=(0.0, 0.0, 0.5 * TILE))
        color = building.node(
            tree,
            "TexChecker",
            Vector=lifted.outputs[0],
            Scale=1.0 / TILE,
            Color1=(0.78, 0.72, 0.60),
            Color2=(0.012, 0.055, 0.085),
        )
        return _polished(tree, color.outputs["Color"], ior=1.8)

    return building.material("Tiles", shade)


def _glaze() -> bpy.types.Material:
    """Return a deep red glaze, as bright a mirror as lustre ware."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        color = building.node(tree, "RGB").outputs[0]
        color.default_value = (0.36, 0.022, 0.012, 1.0)
        return _polished(tree, color, ior=2.4)

    return building.material("Glaze", shade)


def _polished(
    tree: bpy.types.ShaderNodeTree, color: bpy.types.NodeSocket, *, ior: float
) -> bpy.types.NodeSocket:
    """Return a matt colour under a clear layer that reflects as Fresnel says."""
    matt = building.node(tree, "BsdfDiffuse", Color=color)
    mirror = building.node(tree, "BsdfGlossy", Roughness=0.0, Color=(1.0, 1.0, 1.0))
    share = building.node(tree, "Fresnel", IOR=ior).outputs[0]
    return building.mixed(tree, share, matt.outputs[0], mirror.outputs[0])
