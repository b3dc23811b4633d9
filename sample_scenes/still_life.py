"""A macro still life: a screwdriver points into the movement of a pocket watch, polished balls lie behind.

A 100 mm lens at f/4 is focused on the balance's jewel from a quarter of a metre, where the frame is 92 mm
wide. The screwdriver's handle is much nearer, and the lights on the balls become discs. Lengths in this
module are millimetres wherever nothing else is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import bmesh
import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Matrix, Vector
from mathutils.geometry import convex_hull_2d

from . import building
from .building import Color, Vector3, node

F_STOP = 4.0

KEY_POINT = "Jewel 1"
"""The object in focus: the jewel of the balance."""

_METRES = 0.001
_WARM = (1.0, 0.72, 0.42)
_WHITE = (1.0, 0.93, 0.84)
_BLUE = (0.72, 0.86, 1.0)

# The movement, seen along its axis: where its wheels turn.
_PLATE_RADIUS = 21.0
_BALANCE = (5.0, -9.0)
_RATCHET = (-8.5, 6.5)
_CROWN_WHEEL = (-1.6, 14.4)
_CENTRE = (1.5, 1.0)
_THIRD = (10.5, 2.0)
_FOURTH = (9.0, 11.0)
_ESCAPE = (15.6, -3.2)

# A tooth from one gap to the next: share of the pitch, share of the tooth's depth.
_ROUNDED = (
    (0.0, 0.0),
    (0.22, 0.0),
    (0.30, 0.62),
    (0.40, 0.95),
    (0.50, 1.0),
    (0.60, 0.95),
    (0.70, 0.62),
    (0.78, 0.0),
)
_HOOKED = ((0.0, 0.0), (0.45, 0.05), (0.80, 0.55), (0.92, 1.0), (0.97, 0.97), (0.985, 0.0))

Points = npt.NDArray[np.float64]
Parts = list[bpy.types.Object]
Finish = dict[str, bpy.types.Material]


def build() -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Returns
    -------
    Scene
        The scene, its camera focused on the balance's jewel.
    """
    scene = building.empty_scene("Still Life", 960, 540, samples=40, bounces=4)
    scene.cycles.use_denoising = True
    building.sky(scene, (0.30, 0.42, 0.55), 0.05)
    finish = _finishes()
    watch = building.add(scene, "Watch", None, _metres(10.0, 0.0, 16.5), (36.0, 0.0, 0.0))
    for make in (_case, _wheels, _bridges, _balance, _jewels_and_screws, _engravings):
        for part in make(scene, finish):
            part.parent = watch
    _screwdriver(scene, finish, watch.matrix_basis @ Vector(_metres(-5.5, -17.2, 4.2)))
    _desk(scene, finish)
    _lights(scene, _balls(scene, finish))
    _camera(scene, watch.matrix_basis @ scene.objects[KEY_POINT].location)
    return scene


def _camera(scene: bpy.types.Scene, key_point: Vector) -> None:
    """Look down on the watch by 15 degrees."""
    target = Vector(_metres(0.0, 0.0, 20.5))
    down = math.radians(15.0)
    stand = target + 0.265 * Vector((0.0, -math.cos(down), math.sin(down)))
    item = building.camera(scene, 100.0, 36.0, tuple(stand), tuple(target), f_stop=F_STOP)
    item.data.dof.focus_distance = -(item.matrix_basis.inverted() @ key_point).z


def _lights(scene: bpy.types.Scene, balls: bpy.types.Collection) -> None:
    """Add three soft boxes, a light for edges from behind, and two small ones for the balls alone."""
    for name, power, place, size, color in (
        ("Soft Box", 4.0, (-0.34, 0.10, 0.36), 0.26, _WHITE),
        # The plates mirror its edge to the camera.
        ("Overhead", 0.8, (-0.13, 0.02, 0.45), 0.42, _WHITE),
        ("Fill", 1.4, (0.42, -0.25, 0.30), 0.30, _BLUE),
        ("Rim", 2.5, (0.35, 0.45, 0.16), 0.06, _WARM),
    ):
        building.lamp(scene, name, "AREA", power, place, size=size, color=color)
    for x, color in ((0.32, _WARM), (-0.32, _WHITE)):
        spark = building.lamp(
            scene, "Spark", "AREA", 11.0, (x, 0.62, 0.18), (0.0, 0.25, 0.0), size=0.03, color=color
        )
        # As if screened from the desk, which stays dark behind the discs.
        spark.light_linking.receiver_collection = balls


# Materials


def _finishes() -> dict[str, bpy.types.Material]:
    """Return every material by name."""

    def metal(name: str, color: Color, roughness: float, **values: Any) -> bpy.types.Material:
        return building.principled(name, color, Metallic=1.0, Roughness=roughness, **values)

    made = [
        metal("Gold", (0.95, 0.62, 0.24), 0.16),
        metal("Polished Gold", (0.92, 0.60, 0.26), 0.13),
        metal("Polished Steel", (0.72, 0.73, 0.75), 0.10),
        metal("Tool Steel", (0.34, 0.35, 0.37), 0.28),
        metal("Blued Steel", (0.03, 0.07, 0.42), 0.16),
        building.principled("Ruby", (0.45, 0.004, 0.035), Roughness=0.06, Coat_Weight=1.0),
        building.principled("Red Lacquer", (0.52, 0.014, 0.004), Roughness=0.55, Specular_IOR_Level=0.2),
        metal("Blue Anodised", (0.02, 0.20, 0.75), 0.22),
        metal("Yellow Anodised", (0.95, 0.52, 0.03), 0.22),
        building.principled("Ink", (0.008, 0.008, 0.010), Roughness=0.5),
        building.material("Striped Silver", _striped),
        building.material("Grained Plate", _grained),
        building.material("Sunburst Steel", _sunburst),
        building.material("Engraved Silver", _engraved),
        building.material("Leather", _leather),
        building.material("Walnut", _walnut),
    ]
    return {item.name: item for item in made}


def _object_place(tree: bpy.types.ShaderNodeTree, scale: Vector3 = (1.0, 1.0, 1.0)) -> bpy.types.NodeSocket:
    """Return where a surface is on its object, in millimetres."""
    place = node(tree, "TexCoord").outputs["Object"]
    return node(tree, "Mapping", Vector=place, Scale=tuple(1000.0 * s for s in scale)).outputs[0]


def _bump(
    tree: bpy.types.ShaderNodeTree, height: bpy.types.NodeSocket, depth_mm: float, **values: Any
) -> bpy.types.NodeSocket:
    return node(tree, "Bump", Height=height, Distance=depth_mm * _METRES, **values).outputs[0]


def _sine(tree: bpy.types.ShaderNodeTree, value: bpy.types.NodeSocket, rate: float) -> bpy.types.NodeSocket:
    """Return the sine of a value times a rate."""
    product, sine = node(tree, "Math", operation="MULTIPLY"), node(tree, "Math", operation="SINE")
    product.inputs[1].default_value = rate
    tree.links.new(value, product.inputs[0])
    tree.links.new(product.outputs[0], sine.inputs[0])
    return sine.outputs[0]


def _striped(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
    """German silver with Geneva stripes: bands ground by a turning disc, 1.7 mm each."""
    place = _object_place(tree)
    turned = node(tree, "Mapping", Vector=place, Rotation=(0.0, 0.0, math.radians(35.0))).outputs[0]
    stripes = node(tree, "TexWave", Vector=turned, Scale=0.185, wave_profile="SIN")
    fine = node(tree, "Mapping", Vector=turned, Scale=(1.0, 14.0, 1.0)).outputs[0]
    scratches = node(tree, "TexNoise", Vector=fine, Scale=1.6, Detail=3.0)
    ground = _bump(tree, stripes.outputs["Fac"], 0.03)
    return node(
        tree,
        "BsdfPrincipled",
        Base_Color=(0.78, 0.72, 0.62),
        Metallic=1.0,
        Roughness=0.27,
        Normal=_bump(tree, scratches.outputs[0], 0.012, Normal=ground),
    ).outputs[0]


def _grained(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
    """Rhodium plate with circular graining: overlapping spots, each turned by a peg."""
    cells = node(tree, "TexVoronoi", Vector=_object_place(tree), Scale=0.62, Randomness=0.25)
    rings = _sine(tree, cells.outputs["Distance"], 42.0)
    return node(
        tree,
        "BsdfPrincipled",
        Base_Color=(0.74, 0.72, 0.68),
        Metallic=1.0,
        Roughness=0.25,
        Normal=_bump(tree, rings, 0.012),
    ).outputs[0]


def _sunburst(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
    """Steel brushed in circles around the wheel's axis: the light is a bow tie."""
    rings = node(
        tree, "TexWave", wave_type="RINGS", rings_direction="Z", Vector=_object_place(tree), Scale=1.2
    )
    return node(
        tree,
        "BsdfPrincipled",
        Base_Color=(0.66, 0.67, 0.70),
        Metallic=1.0,
        Roughness=0.30,
        Anisotropic=0.85,
        Tangent=node(tree, "Tangent", direction_type="RADIAL", axis="Z").outputs[0],
        Normal=_bump(tree, rings.outputs["Fac"], 0.006),
    ).outputs[0]


def _engraved(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
    """German silver with scrolls cut by hand: lines of equal height of a noise."""
    noise = node(tree, "TexNoise", Vector=_object_place(tree), Scale=0.26, Detail=0.0)
    scrolls = _sine(tree, noise.outputs[0], 80.0)
    cut = node(tree, "ValToRGB", Fac=scrolls)
    cut.color_ramp.elements[0].position, cut.color_ramp.elements[1].position = 0.0, 0.25
    tint = node(tree, "ValToRGB", Fac=cut.outputs[0])
    tint.color_ramp.elements[0].color = (0.36, 0.29, 0.20, 1.0)
    tint.color_ramp.elements[1].color = (0.80, 0.73, 0.62, 1.0)
    return node(
        tree,
        "BsdfPrincipled",
        Base_Color=tint.outputs[0],
        Metallic=1.0,
        Roughness=0.24,
        Normal=_bump(tree, cut.outputs[0], 0.05),
    ).outputs[0]


def _leather(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
    """Petrol leather with its grain."""
    place = _object_place(tree)
    grain = node(tree, "TexVoronoi", feature="SMOOTH_F1", Vector=place, Scale=1.1)
    cloud = node(tree, "TexNoise", Vector=place, Scale=0.03, Detail=4.0)
    tint = node(tree, "ValToRGB", Fac=cloud.outputs[0])
    tint.color_ramp.elements[0].color = (0.001, 0.018, 0.024, 1.0)
    tint.color_ramp.elements[1].color = (0.003, 0.044, 0.054, 1.0)
    return node(
        tree,
        "BsdfPrincipled",
        Base_Color=tint.outputs[0],
        Roughness=0.60,
        Specular_IOR_Level=0.08,
        Normal=_bump(tree, grain.outputs["Distance"], 0.20),
    ).outputs[0]


def _walnut(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
    """Dark wood, waxed."""
    grain = node(tree, "TexNoise", Vector=_object_place(tree, (0.05, 1.0, 1.0)), Scale=0.8, Detail=5.0)
    tint = node(tree, "ValToRGB", Fac=grain.outputs[0])
    tint.color_ramp.elements[0].color = (0.020, 0.008, 0.004, 1.0)
    tint.color_ramp.elements[1].color = (0.150, 0.060, 0.025, 1.0)
    return node(tree, "BsdfPrincipled", Base_Color=tint.outputs[0], Roughness=0.35).outputs[0]


# Shapes


def _metres(x: float, y: float, z: float) -> Vector3:
    return _METRES * x, _METRES * y, _METRES * z


def _circle(radius: float, count: int = 48, centre: Sequence[float] = (0.0, 0.0)) -> Points:
    angles = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    return np.asarray(centre) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _hull(*circles: tuple[float, float, float]) -> Points:
    """Return the outline of the convex hull of circles (x, y, radius), cut off at the plate's edge."""
    points = np.concatenate([_circle(radius, 64, (x, y)) for x, y, radius in circles])
    points = points[convex_hull_2d([Vector(point) for point in points])]
    beyond = np.linalg.norm(points, axis=1, keepdims=True) / (_PLATE_RADIUS - 0.4)
    return points / np.maximum(beyond, 1.0)


def _inset(outline: Points, distance: float) -> Points:
    """Return an outline that runs counterclockwise, moved inwards."""
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return outline + distance * np.stack([-along[:, 1], along[:, 0]], axis=1)


def _raised(outline: Points, height: float) -> Points:
    return np.column_stack([outline, np.full(len(outline), height)])


def _skin(work: bmesh.types.BMesh, rings: Sequence[Points], *, capped: bool = True) -> None:
    """Join closed outlines of shape (n, 3); cap both ends, or join the last with the first."""
    rows = [[work.verts.new(_METRES * point) for point in ring] for ring in rings]
    pairs = list(zip(rows, rows[1:] if capped else rows[1:] + rows[:1], strict=not capped))
    for lower, upper in pairs:
        for k in range(len(lower)):
            n = (k + 1) % len(lower)
            work.faces.new((lower[k], lower[n], upper[n], upper[k]))
    if capped:
        work.faces.new(rows[0][::-1])
        work.faces.new(rows[-1])


def _slab(work: bmesh.types.BMesh, outline: Points, bottom: float, top: float, chamfer: float = 0.0) -> None:
    """Add a plate with an outline that runs counterclockwise, its upper edge chamfered."""
    rings = [_raised(outline, bottom), _raised(outline, top - chamfer)]
    if chamfer > 0.0:
        rings.append(_raised(_inset(outline, chamfer), top))
    _skin(work, rings)


def _toothed(teeth: int, radius: float, depth: float, tooth: Sequence[tuple[float, float]]) -> Points:
    """Return the outline of a wheel; each tooth as in `_ROUNDED`."""
    pitch, height = np.array(tooth).T
    angles = (2.0 * math.pi / teeth) * (np.arange(teeth)[:, None] + pitch).ravel()
    radii = radius - depth * (1.0 - np.tile(height, teeth))
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def _wheel(
    name: str,
    teeth: int,
    radius: float,
    thickness: float,
    *,
    rim: float = 1.0,
    spokes: int = 5,
    depth: float | None = None,
    tooth: Sequence[tuple[float, float]] = _ROUNDED,
) -> bpy.types.Mesh:
    """Return a spoked wheel around the origin, its lower side at 0."""
    height = 4.2 * radius / teeth if depth is None else depth
    outer = _toothed(teeth, radius, height, tooth)
    inner_radius = radius - height - rim
    inner = outer / np.linalg.norm(outer, axis=1, keepdims=True) * inner_radius
    hub = 0.16 * radius + 0.35

    def fill(work: bmesh.types.BMesh) -> None:
        loop = [(outer, 0.0), (outer, thickness), (inner, thickness), (inner, 0.0)]
        _skin(work, [_raised(outline, z) for outline, z in loop], capped=False)
        _slab(work, _circle(hub), -0.2, thickness + 0.25, 0.1)
        for turn in np.arange(spokes) * 2.0 * math.pi / spokes:
            spoke = np.array(
                [
                    (0.5 * hub, -0.09 * radius),
                    (inner_radius + 0.1, -0.055 * radius),
                    (inner_radius + 0.1, 0.055 * radius),
                    (0.5 * hub, 0.09 * radius),
                ]
            )
            _slab(work, _turned_by(spoke, turn), 0.02, thickness - 0.02)

    return building.mesh(name, fill)


def _sweep(work: bmesh.types.BMesh, path: Points, section: Points) -> None:
    """Move a section of shape (n, 2), its axes outwards and up, along a flat path of shape (k, 2)."""
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    outwards = np.stack([along[:, 1], -along[:, 0]], axis=1)
    rings = [
        np.column_stack([place + section[:, :1] * normal, section[:, 1]])
        for place, normal in zip(path, outwards, strict=True)
    ]
    _skin(work, rings)


def _turned_by(outline: Points, angle: float) -> Points:
    c, s = math.cos(angle), math.sin(angle)
    return outline @ np.array([[c, s], [-s, c]])


def _turned(name: str, profile: Sequence[tuple[float, float]], segments: int) -> bpy.types.Mesh:
    return building.turned(name, [(_METRES * r, _METRES * z) for r, z in profile], segments, smooth=False)


def _rounded(
    name: str, profile: Sequence[tuple[float, float]], radius: float, segments: int = 96
) -> bpy.types.Mesh:
    """Return a smooth surface of revolution whose profile has its corners rounded."""
    points = [np.array(point) for point in profile]
    outline = [points[0]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        start, end = (
            corner + radius * way / np.linalg.norm(way) for way in (before - corner, after - corner)
        )
        outline += [
            (1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end for t in np.linspace(0, 1, 5)
        ]
    data = _turned(name, [(float(r), float(z)) for r, z in (*outline, points[-1])], segments)
    data.shade_smooth()
    return data


def _screw() -> bpy.types.Mesh:
    """Return a slotted screw head of 1.2 mm radius that stands on 0."""

    def fill(work: bmesh.types.BMesh) -> None:
        _slab(work, _circle(1.2), 0.0, 0.35)
        for side in (0.0, math.pi):
            reach = math.asin(0.17 / 1.2)
            angles = np.linspace(side + reach, side + math.pi - reach, 24)
            half = 1.2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            _slab(work, half, 0.3, 0.75, 0.10)

    return building.mesh("Screw", fill)


# The watch


def _case(scene: bpy.types.Scene, finish: Finish) -> Parts:
    """Add the golden case with crown and bow, the plate inside, and the block that it leans on."""
    case = _rounded(
        "Case",
        [
            *((0.0, -7.0), (18.0, -7.0), (25.5, -4.0), (26.0, 0.4), (24.6, 2.6)),
            *((22.2, 2.6), (21.4, 1.4), (21.4, -1.2), (0.0, -1.2)),
        ],
        0.55,
        160,
    )
    edge = _PLATE_RADIUS
    plate = _turned("Plate", [(0.0, -1.5), (edge, -1.5), (edge, -0.2), (edge - 0.2, 0.0), (0.0, 0.0)], 96)
    block = _rounded("Block", [(0.0, -40.0), (25.0, -40.0), (25.0, -6.0), (0.0, -6.0)], 0.8)
    neck = _rounded("Neck", [(0.0, 0.0), (4.4, 0.0), (3.4, 3.0), (3.8, 6.0), (0.0, 6.0)], 0.6, 48)
    crown = _wheel("Crown", 32, 4.2, 5.0, rim=4.0, spokes=0, depth=0.5)
    angles = np.linspace(-0.15 * math.pi, 1.15 * math.pi, 64)
    ring = 9.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    bow = building.mesh("Bow", lambda work: _sweep(work, ring, _circle(1.5, 16)), smooth=True)
    rows = (
        (case, (0.0, 0.0, 0.0), 0.0, "Polished Gold"),
        (plate, (0.0, 0.0, 0.0), 0.0, "Grained Plate"),
        (block, (0.0, 0.0, 0.0), 0.0, "Walnut"),
        (neck, (0.0, 24.5, -1.5), -90.0, "Polished Gold"),
        (crown, (0.0, 30.8, -1.5), -90.0, "Polished Gold"),
        (bow, (0.0, 34.0, -1.5), 0.0, "Polished Gold"),
    )
    return [
        building.add(scene, data.name, data, _metres(*place), (lean, 0.0, 0.0), finish[material])
        for data, place, lean, material in rows
    ]


def _wheels(scene: bpy.types.Scene, finish: Finish) -> Parts:
    """Add the train, and the two winding wheels on top of their bridge."""
    centre = _wheel("Centre Wheel", 80, 7.4, 0.45, rim=1.1)
    third = _wheel("Third Wheel", 75, 5.6, 0.4)
    escape = _wheel("Escape Wheel", 15, 3.9, 0.3, rim=0.4, spokes=4, depth=1.1, tooth=_HOOKED)
    ratchet = _wheel("Ratchet Wheel", 54, 6.4, 0.7, rim=4.2, spokes=0, depth=0.55)
    crown = _wheel("Crown Wheel", 36, 4.4, 0.7, rim=2.6, spokes=0, depth=0.55)
    rows = (
        ("Centre Wheel", centre, (*_CENTRE, 2.2), 0.0, "Gold"),
        ("Third Wheel", third, (*_THIRD, 1.3), 11.0, "Gold"),
        ("Fourth Wheel", third, (*_FOURTH, 2.3), 3.0, "Gold"),
        ("Escape Wheel", escape, (*_ESCAPE, 1.4), 0.0, "Polished Steel"),
        ("Ratchet Wheel", ratchet, (*_RATCHET, 4.3), 0.0, "Sunburst Steel"),
        ("Crown Wheel", crown, (*_CROWN_WHEEL, 4.3), 4.0, "Sunburst Steel"),
    )
    return [
        building.add(scene, name, data, _metres(*place), (0.0, 0.0, turn), finish[material])
        for name, data, place, turn, material in rows
    ]


def _bridges(scene: bpy.types.Scene, finish: Finish) -> Parts:
    """Add the bridges: one below the winding wheels, a finger for each wheel, the cock of the balance."""
    x, y = _BALANCE
    silver, steel = "Striped Silver", "Polished Steel"
    rows = (
        (
            "Winding Bridge",
            _hull((*_RATCHET, 9.8), (*_CROWN_WHEEL, 5.4), (-17.0, 5.0, 4.0)),
            3.2,
            4.2,
            silver,
        ),
        ("Train Bridge", _hull((-10.0, -9.5, 6.6), (-17.0, -4.5, 3.5), (-6.0, -15.5, 4.8)), 0.3, 3.6, silver),
        ("Centre Bridge", _hull((*_CENTRE, 2.2), (-6.0, -5.6, 2.4)), 3.2, 4.0, silver),
        ("Third Bridge", _hull((*_THIRD, 2.0), (19.0, 4.2, 3.2)), 3.0, 4.0, silver),
        ("Fourth Bridge", _hull((*_FOURTH, 2.0), (13.0, 16.5, 3.4)), 3.2, 4.0, silver),
        ("Escape Bridge", _hull((*_ESCAPE, 1.5), (20.0, -3.0, 2.4)), 2.4, 3.2, silver),
        ("Balance Cock", _hull((x, y, 2.4), (16.0, -13.0, 4.2)), 4.9, 6.0, "Engraved Silver"),
        ("Cock Foot", _hull((16.6, -12.6, 3.0)), 0.0, 5.0, silver),
        ("Regulator", _hull((x, y, 1.0), (x - 4.6, y + 3.6, 0.22)), 6.0, 6.3, steel),
    )

    def slab(name: str, outline: Points, bottom: float, top: float) -> bpy.types.Mesh:
        chamfer = min(0.28, 0.4 * (top - bottom))
        return building.mesh(name, lambda work: _slab(work, outline, bottom, top, chamfer))

    nowhere = (0.0, 0.0, 0.0)
    return [
        building.add(scene, name, slab(name, outline, bottom, top), nowhere, nowhere, finish[material])
        for name, outline, bottom, top, material in rows
    ]


def _balance(scene: bpy.types.Scene, finish: Finish) -> Parts:
    """Add the balance with its timing screws, and its spring."""

    def fill(work: bmesh.types.BMesh) -> None:
        rim = [(7.6, 0.0), (7.6, 0.8), (6.7, 0.8), (6.7, 0.0)]
        _skin(work, [_raised(_circle(r, 96), z) for r, z in rim], capped=False)
        _slab(work, _circle(1.1), -0.4, 0.9, 0.1)
        for turn in np.arange(3) * 2.0 * math.pi / 3.0:
            _slab(
                work,
                _turned_by(np.array([(0.5, -0.5), (6.9, -0.4), (6.9, 0.4), (0.5, 0.5)]), turn),
                0.15,
                0.6,
            )
        for turn in np.arange(18) * 2.0 * math.pi / 18.0:
            place = Matrix.Rotation(turn, 4, "Z") @ Matrix.Translation(_metres(8.0, 0.0, 0.4))
            bmesh.ops.create_cone(
                work,
                cap_ends=True,
                segments=16,
                radius1=0.42 * _METRES,
                radius2=0.42 * _METRES,
                depth=0.8 * _METRES,
                matrix=place @ Matrix.Rotation(0.5 * math.pi, 4, "Y"),
            )

    turns = np.linspace(0.0, 22.0 * math.pi, 700)
    spiral = np.linspace(1.3, 5.4, turns.size)[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ribbon = np.array([(-0.05, 0.0), (0.05, 0.0), (0.05, 0.4), (-0.05, 0.4)])
    wheel = building.mesh("Balance", fill)
    spring = building.mesh("Hairspring", lambda work: _sweep(work, spiral, ribbon))
    return [
        building.add(scene, "Balance", wheel, _metres(*_BALANCE, 2.8), (0.0, 0.0, 20.0), finish["Gold"]),
        building.add(
            scene, "Hairspring", spring, _metres(*_BALANCE, 3.9), (0.0, 0.0, 0.0), finish["Blued Steel"]
        ),
    ]


def _jewels_and_screws(scene: bpy.types.Scene, finish: Finish) -> Parts:
    """Add a jewel in its setting to each bridge, that of the balance first, and screws."""
    jewel = _rounded("Jewel", [(0.2, 0.0), (0.25, 0.22), (0.95, 0.30), (1.1, 0.0)], 0.05, 32)
    setting = _rounded("Setting", [(1.05, 0.0), (1.05, 0.22), (1.65, 0.22), (1.75, 0.0)], 0.06, 40)
    screw = _screw()
    upright = (0.0, 0.0, 0.0)
    parts = []
    for number, place in enumerate(
        (
            (*_BALANCE, 6.3),
            (*_CENTRE, 4.0),
            (*_THIRD, 4.0),
            (*_FOURTH, 4.0),
            (*_ESCAPE, 3.2),
            (-12.6, -5.6, 3.6),
        ),
        start=1,
    ):
        for name, data, material in (
            (f"Jewel {number}", jewel, "Ruby"),
            (f"Setting {number}", setting, "Gold"),
        ):
            parts.append(building.add(scene, name, data, _metres(*place), upright, finish[material]))
    for number, (x, y, z, turn) in enumerate(
        (
            (*_RATCHET, 5.0, 20.0),
            (*_CROWN_WHEEL, 5.0, 75.0),
            (-16.5, -2.6, 3.6, 120.0),
            (-5.5, -17.2, 3.6, 15.0),
            (-17.0, 4.8, 4.2, 60.0),
            (-5.8, -5.4, 4.0, 100.0),
            (18.2, 4.2, 4.0, 140.0),
            (13.3, 15.0, 4.0, 80.0),
            (18.8, -3.4, 3.2, 30.0),
            (15.9, -13.2, 6.0, 52.0),
        ),
        start=1,
    ):
        place = _metres(x, y, z)
        parts.append(
            building.add(scene, f"Screw {number}", screw, place, (0.0, 0.0, turn), finish["Blued Steel"])
        )
    return parts


def _engravings(scene: bpy.types.Scene, finish: Finish) -> Parts:
    """Add lettering filled with ink, a hair above the train's bridge."""
    parts = []
    for text, size, y in (("POTMESIL", 2.2, -10.0), ("17 JEWELS", 1.15, -12.1), ("No 1982", 1.15, -13.9)):
        letters = bpy.data.curves.new(text, "FONT")
        letters.body, letters.size, letters.align_x = text, size * _METRES, "CENTER"
        letters.offset = 0.02 * letters.size
        letters.materials.append(finish["Ink"])
        parts.append(building.add(scene, text, letters, _metres(-11.4, y, 3.62)))
    return parts


# Around the watch


def _screwdriver(scene: bpy.types.Scene, finish: Finish, tip: Vector) -> None:
    """Add a screwdriver from a place in metres towards the lower left of the camera."""
    handle = _rounded(
        "Handle",
        [
            *((0.0, 52.0), (3.5, 52.0), (8.6, 59.0), (8.6, 70.0), (6.9, 75.0)),
            *((11.5, 83.0), (11.5, 140.0), (0.0, 140.0)),
        ],
        1.0,
    )
    shaft = _rounded("Shaft", [(0.0, 3.0), (0.9, 8.0), (0.9, 55.0), (0.0, 55.0)], 0.3, 32)
    blade = building.box("Blade", _metres(1.7, 0.28, 8.0))
    blade.transform(Matrix.Translation(_metres(0.0, 0.0, 4.0)))
    turn = (Vector(_metres(-49.0, -140.0, 35.0)) - tip).to_track_quat("Z", "Y").to_euler()
    for data, material in ((handle, "Red Lacquer"), (shaft, "Tool Steel"), (blade, "Tool Steel")):
        item = building.add(scene, data.name, data, tuple(tip), (0.0, 0.0, 0.0), finish[material])
        item.rotation_euler = turn


def _desk(scene: bpy.types.Scene, finish: Finish) -> None:
    """Add the leather, and parts of another movement that lie on it."""
    leather = building.plane("Leather", 2.4, 2.4)
    building.add(scene, "Leather", leather, (0.0, 0.6, 0.0), (0.0, 0.0, 0.0), finish["Leather"])
    wheel, screw, jewel = (bpy.data.meshes[name] for name in ("Centre Wheel", "Screw", "Jewel"))
    for number, (data, x, y) in enumerate(
        (
            (wheel, 48.0, 45.0),
            (wheel, -52.0, 60.0),
            (screw, 38.0, -10.0),
            (jewel, 41.5, -5.0),
        )
    ):
        building.add(scene, f"Loose Part {number}", data, _metres(x, y, 0.3))


def _balls(scene: bpy.types.Scene, finish: Finish) -> bpy.types.Collection:
    """Add polished balls behind the watch, and return them."""
    balls = bpy.data.collections.new("Balls")
    random = np.random.default_rng(1982)
    kinds = []
    for material in ("Polished Gold", "Polished Steel", "Ruby", "Blue Anodised", "Yellow Anodised"):
        kinds.append(building.sphere(f"{material} Ball", 4.5 * _METRES, rings=24))
        kinds[-1].materials.append(finish[material])
    for number in range(40):
        y = random.uniform(70.0, 400.0)
        # Within a frame that widens with the distance from the camera.
        x = random.uniform(-0.2, 0.2) * (250.0 + y)
        ball = building.add(scene, f"Ball {number}", kinds[number % len(kinds)], _metres(x, y, 4.5))
        balls.objects.link(ball)
    return balls
