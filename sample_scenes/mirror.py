"""A textured cube and three glass spheres fly past a planar mirror (SIGGRAPH 1983, figure 8).

Each follows a path of its own while mirror and camera rest. Frame 1 is the instantaneous picture, and the
shutter is open for one frame around it. One Blender unit is one metre.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np

from . import building
from .carafe import glass
from .plumage import drawn_plumage

FRAME = 1

_PICTURE_SIDE = 384
_CUBE_SIDE = 0.24
_CUBE_ANGLES = np.radians((24.0, -14.0, 24.0))
_CUBE_SPIN = np.radians((0.0, 0.0, 7.0))
"""Radians a frame."""

_KEYS_A_FRAME = 8


def cube_path(time: float) -> building.Vector3:
    """Return where the cube's middle is: it flies straight and evenly (metres; frames from `FRAME`)."""
    return (-0.17 + 0.070 * time, -0.38, 0.30 + 0.022 * time)


def rising_path(time: float) -> building.Vector3:
    """Return where the first sphere is: it rises straight and evenly."""
    return (-0.36 + 0.020 * time, -0.27, 0.60 + 0.085 * time)


def circling_path(time: float) -> building.Vector3:
    """Return where the second sphere is: on an upright circle of 110 mm radius, 1.1 radians a frame."""
    angle = 1.1 * time - 0.9
    return (0.10 + 0.11 * math.cos(angle), -0.44, 0.20 + 0.11 * math.sin(angle))


def falling_path(time: float) -> building.Vector3:
    """Return where the third sphere is: thrown to the right, it falls ever faster."""
    return (0.26 + 0.060 * time, -0.28, 0.55 - 0.070 * time - 0.060 * time * time)


SPHERES: dict[str, tuple[Callable[[float], building.Vector3], float]] = {
    "Rising": (rising_path, 0.080),
    "Circling": (circling_path, 0.065),
    "Falling": (falling_path, 0.075),
}
"""Path and radius of each sphere."""


def build() -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Returns
    -------
    Scene
        The scene at `FRAME`. Pass indices are 1 for the cube, 2 to 4 for the spheres and 5 for the mirror.
    """
    scene = building.empty_scene("Mirror", 512, 512, samples=48, bounces=10)
    scene.cycles.diffuse_bounces = 1
    scene.cycles.sample_clamp_indirect = 3.0
    scene.render.motion_blur_shutter = 1.0
    scene.frame_start, scene.frame_end = FRAME - 1, FRAME + 1
    _add_moving(scene)
    _add_room(scene)
    building.sky(scene, (0.10, 0.12, 0.15))
    building.camera(scene, 45.0, 36.0, (0.95, -1.65, 0.62), (0.06, -0.1, 0.37), f_stop=8.0)
    target = (0.0, -0.3, 0.2)
    building.lamp(scene, "Window", "AREA", 46.0, (-1.0, -1.3, 1.5), target, size=0.6, color=(1.0, 0.95, 0.88))
    building.lamp(scene, "Lamp", "AREA", 18.0, (1.5, -0.8, 1.2), target, size=0.3, color=(0.82, 0.9, 1.0))
    scene.frame_set(FRAME)
    return scene


def _add_moving(scene: bpy.types.Scene) -> None:
    """Add the cube and the spheres with their keys."""
    image = building.picture("Plumage", drawn_plumage(_PICTURE_SIDE))
    cube = building.add(
        scene,
        "Cube",
        building.box("Cube", (_CUBE_SIDE,) * 3),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        building.painted("Plumage", image),
    )
    _follow(cube, cube_path)
    turns = {FRAME + t: tuple(_CUBE_ANGLES + t * _CUBE_SPIN) for t in (-1, 1)}
    building.key(cube, "rotation_euler", turns)
    clear = glass()
    for name, (path, radius) in SPHERES.items():
        ball = building.add(
            scene, name, building.sphere(name, radius), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), clear
        )
        _follow(ball, path)


def _follow(item: bpy.types.Object, path: Callable[[float], building.Vector3]) -> None:
    """Key an object along its path, from a frame before the picture to a frame after it."""
    times = np.arange(-_KEYS_A_FRAME, _KEYS_A_FRAME + 1) / _KEYS_A_FRAME
    building.key(item, "location", {FRAME + t: path(t) for t in times.tolist()})


def _add_room(scene: bpy.types.Scene) -> None:
    """Add the mirror in its frame, the floor and a wall behind."""
    silver = building.material(
        "Silver",
        lambda tree: building.node(tree, "BsdfGlossy", Roughness=0.0, Color=(0.88, 0.90, 0.90)).outputs[0],
    )
    still = (0.0, 0.0, 0.0)
    upright = (90.0, 0.0, 0.0)
    building.add(scene, "Mirror", building.plane("Mirror", 1.30, 0.80), (0.0, 0.0, 0.44), upright, silver)
    gilt = building.diffuse("Gilt", (0.50, 0.33, 0.11))
    for name, size, place in (
        ("Top", (1.38, 0.03, 0.04), (0.0, 0.0, 0.86)),
        ("Bottom", (1.38, 0.03, 0.04), (0.0, 0.0, 0.02)),
        ("Left", (0.04, 0.03, 0.80), (-0.67, 0.0, 0.44)),
        ("Right", (0.04, 0.03, 0.80), (0.67, 0.0, 0.44)),
    ):
        building.add(scene, f"Frame {name}", building.box(name, size, bevel=0.006), place, still, gilt)
    floor = building.plane("Floor", 8.0, 8.0)
    building.add(scene, "Floor", floor, still, still, building.diffuse("Slate", (0.13, 0.15, 0.17)))
    wall = building.plane("Wall", 8.0, 4.0)
    building.add(
        scene, "Wall", wall, (0.0, 0.6, 2.0), upright, building.diffuse("Plaster", (0.22, 0.17, 0.14))
    )
