"""The magnet of 1983, figure 7: ten metal balls in the air, drawn to the poles of a horseshoe magnet.

The shutter opens on frame 1, when all balls still rest, and T is one frame: each ball then runs along its
own path with its own even acceleration, for up to 2T. One Blender unit is one metre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import bmesh
import bpy
from mathutils import Matrix, Vector

from . import building
from .building import Vector3

EXPOSURE = 1.0
"""The paper's T in frames."""

BALL_RADIUS = 0.025

_BEND_RADIUS = 0.098
_ARM_LENGTH = 0.090
_POLE_LENGTH = 0.048
_BAR_WIDTH, _BAR_DEPTH, _BAR_EDGE = 0.068, 0.056, 0.011
_BEND_STEPS, _EDGE_STEPS = 48, 6

_MAGNET_PLACE = Vector((0.225, 0.0, 0.190))
_MAGNET_TURN = math.radians(-52.0)
"""About the axis of view, from poles that point down."""

_SKY = (
    (0.00, (0.02, 0.02, 0.025)),
    (0.47, (0.10, 0.08, 0.07)),
    (0.53, (0.85, 0.80, 0.72)),
    (1.00, (0.30, 0.42, 0.60)),
)
"""Colours from below to above."""


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball that starts from rest when the shutter opens.

    Parameters
    ----------
    start : tuple of float
        Where it hangs, in metres.
    end : tuple of float
        Where it is after 2T.
    bend : tuple of float
        How far its path leaves the straight line, four times the distance halfway along; metres.
    """

    start: Vector3
    end: Vector3
    bend: Vector3 = (0.0, 0.0, 0.0)

    def place(self, time: float) -> Vector3:
        """Return where its middle is at a time from the shutter's opening, in units of T."""
        share = (max(time, 0.0) / 2.0) ** 2
        return tuple(
            a + (b - a) * share + c * share * (1.0 - share)
            for a, b, c in zip(self.start, self.end, self.bend, strict=True)
        )

    def animate(self, item: bpy.types.Object) -> None:
        """Drive an object's place by the frame, between whole frames too."""
        share = f"pow(max(frame - 1, 0) / {2.0 * EXPOSURE}, 2)"
        for axis, (a, b, c) in enumerate(zip(self.start, self.end, self.bend, strict=True)):
            driver = item.driver_add("location", axis).driver
            driver.expression = f"{a} + {b - a} * {share} + {c} * {share} * (1 - {share})"


BALLS = (
    Ball((-0.350, 0.02, 0.315), (-0.050, 0.00, 0.280), (0.0, 0.0, 0.06)),
    Ball((-0.385, -0.04, 0.165), (-0.105, 0.00, 0.190), (0.0, 0.0, -0.03)),
    Ball((-0.195, 0.03, 0.215), (-0.060, 0.00, 0.225)),
    Ball((-0.330, 0.00, -0.010), (-0.012, 0.01, 0.105), (0.02, 0.0, -0.04)),
    Ball((-0.155, -0.06, 0.055), (-0.045, 0.00, 0.165)),
    Ball((-0.365, 0.03, -0.230), (0.058, 0.00, 0.052), (-0.03, 0.0, 0.03)),
    Ball((-0.150, -0.02, -0.170), (0.075, 0.00, -0.012), (0.04, 0.0, -0.03)),
    Ball((-0.080, 0.04, -0.370), (0.095, 0.00, -0.072), (0.0, 0.0, 0.0)),
    Ball((0.120, 0.00, -0.240), (0.150, 0.00, -0.080)),
    Ball((0.320, -0.03, -0.320), (0.205, 0.00, -0.058), (0.06, 0.0, 0.04)),
)
"""From the upper left around to the lower right."""


def build() -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Returns
    -------
    Scene
        The scene at frame 1, with a shutter of 2T that opens on the frame.
    """
    scene = building.empty_scene("Magnet", 512, 512, samples=96, bounces=3)
    scene.render.motion_blur_shutter = 2.0 * EXPOSURE
    scene.render.motion_blur_position = "START"
    building.camera(scene, 50.0, 32.0, (-0.28, -1.34, 0.16), (-0.010, 0.0, -0.010), f_stop=22.0)
    _light(scene)
    _wall(scene)
    _magnet(scene)
    steel = building.principled("Steel", (0.90, 0.91, 0.92), Metallic=1.0, Roughness=0.12)
    shape = building.sphere("Ball", BALL_RADIUS, rings=32)
    for number, ball in enumerate(BALLS, start=1):
        item = building.add(scene, f"Ball {number}", shape, ball.start, (0.0, 0.0, 0.0), steel)
        ball.animate(item)
        # Shadows of what moves stay where they were: better none than ten that rest.
        item.visible_shadow = False
        # Cycles' own motion blur would go evenly through a whole exposure.
        item.cycles.motion_steps = 5
    return scene


def _light(scene: bpy.types.Scene) -> None:
    """Add soft boxes for the metal to reflect, and a sky that is bright above the horizon."""
    aim = (0.0, 0.1, 0.0)
    building.lamp(scene, "Key", "AREA", 30.0, (-1.0, -0.9, 1.2), aim, size=1.3, color=(1.0, 0.94, 0.86))
    building.lamp(scene, "Fill", "AREA", 14.0, (1.4, -1.0, 0.2), aim, size=1.0, color=(0.78, 0.89, 1.0))
    building.lamp(scene, "Top", "AREA", 9.0, (0.3, 0.0, 1.2), aim, size=0.7)
    building.gradient_sky(scene, _SKY, 0.8)


def _wall(scene: bpy.types.Scene) -> None:
    """Put up a wall like a drawing board, so that it shows through the blurred balls."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        grid = building.node(
            tree,
            "TexBrick",
            offset=0.0,
            Vector=place,
            Color1=(0.024, 0.058, 0.078),
            Color2=(0.034, 0.074, 0.096),
            Mortar=(0.13, 0.21, 0.24),
            Scale=1.0,
            Mortar_Size=0.0016,
            Mortar_Smooth=0.3,
            Brick_Width=0.08,
            Row_Height=0.08,
        )
        return building.node(tree, "BsdfDiffuse", Color=grid.outputs["Color"]).outputs[0]

    wall = building.plane("Wall", 6.0, 6.0)
    building.add(scene, "Wall", wall, (0.0, 0.32, 0.0), (90.0, 0.0, 0.0), building.material("Wall", shade))


def _magnet(scene: bpy.types.Scene) -> None:
    """Hang up a horseshoe, painted red but for its poles."""
    paint = building.principled(
        "Paint", (0.40, 0.010, 0.008), Roughness=0.25, Coat_Weight=0.6, Coat_Roughness=0.08
    )
    bare = building.principled("Bare Metal", (0.66, 0.66, 0.67), Metallic=1.0, Roughness=0.24)
    turn = (0.0, math.degrees(-_MAGNET_TURN), 0.0)
    place = tuple(_MAGNET_PLACE)
    building.add(scene, "Magnet", _horseshoe(), place, turn, paint)
    size = (_BAR_WIDTH - 0.003, _BAR_DEPTH - 0.003, _POLE_LENGTH + 0.01)
    for name, side in (("Pole 1", -1.0), ("Pole 2", 1.0)):
        middle = Vector((side * _BEND_RADIUS, 0.0, 0.005 - _ARM_LENGTH - 0.5 * _POLE_LENGTH))
        at = _MAGNET_PLACE + Matrix.Rotation(-_MAGNET_TURN, 3, "Y") @ middle
        building.add(scene, name, building.box(name, size, bevel=0.005), tuple(at), turn, bare)


def _horseshoe() -> bpy.types.Mesh:
    """Return a bar with rounded edges bent around the origin in the xz plane, its arms down along z."""
    turns = [math.pi * step / _BEND_STEPS for step in range(_BEND_STEPS + 1)]
    bend = [(_BEND_RADIUS * math.cos(a), _BEND_RADIUS * math.sin(a), a) for a in turns]
    stations = [(_BEND_RADIUS, -_ARM_LENGTH, 0.0), *bend, (-_BEND_RADIUS, -_ARM_LENGTH, math.pi)]
    outline = _rounded_outline(_BAR_WIDTH, _BAR_DEPTH, _BAR_EDGE)

    def sweep(work: bmesh.types.BMesh) -> None:
        rings = [
            [
                work.verts.new((x + across * math.cos(a), depth, z + across * math.sin(a)))
                for across, depth in outline
            ]
            for x, z, a in stations
        ]
        for near, far in pairwise(rings):
            for k in range(len(outline)):
                work.faces.new((near[k - 1], near[k], far[k], far[k - 1]))
        work.faces.new(rings[0])
        work.faces.new(rings[-1][::-1])
        bmesh.ops.recalc_face_normals(work, faces=work.faces[:])

    data = building.mesh("Magnet", sweep, smooth=True)
    data.set_sharp_from_angle(angle=math.radians(50.0))
    return data


def _rounded_outline(width: float, depth: float, edge: float) -> list[tuple[float, float]]:
    """Return the corners of a rectangle around the origin with rounded edges, counter-clockwise."""
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    points = []
    for quarter, (x, y) in enumerate(corners):
        for step in range(_EDGE_STEPS + 1):
            angle = 0.5 * math.pi * (quarter + step / _EDGE_STEPS)
            points.append(
                (
                    x * (0.5 * width - edge) + edge * math.cos(angle),
                    y * (0.5 * depth - edge) + edge * math.sin(angle),
                )
            )
    return points
