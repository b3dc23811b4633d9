"""The papers' first test scene: a textured cube, a wrinkled sphere before it, a background all round.

TOG 1982, section 4: the sphere of 20 mm radius at 290 mm, the cube of 100 mm at 550 mm, the background at
980 mm, a 55 mm lens on a 30 x 30 mm frame. One Blender unit is one metre. The papers' picture on the cube
is replaced by a procedural texture with as much detail and colour.
"""

from __future__ import annotations

import math

import bpy

from . import building

SPHERE_DISTANCE = 0.290
CUBE_DISTANCE = 0.550
BACKGROUND_DISTANCE = 0.980


def build(*, moving: bool = False) -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Parameters
    ----------
    moving : bool
        Whether the cube spins and the sphere flies past; at frame 1 both are where they are at rest.

    Returns
    -------
    Scene
        The scene, its camera at the origin looking along +y and focused on the cube.
    """
    scene = building.empty_scene("Cube and Sphere", 512, 512, samples=32, bounces=2)
    building.camera(scene, 55.0, 30.0, (0.0, 0.0, 0.0), (0.0, CUBE_DISTANCE, 0.0), f_stop=5.6)
    building.lamp(scene, "Light", "POINT", 9.0, (-0.25, 0.05, 0.35), size=0.02)

    # The face turned to the camera lies at the cube's distance, give or take its slant.
    cube = building.add(
        scene,
        "Cube",
        building.box("Cube", (0.100, 0.100, 0.100)),
        (0.025, CUBE_DISTANCE + 0.045, 0.005),
        (22.0, 12.0, 38.0),
        _patchwork(),
    )
    sphere = building.add(
        scene,
        "Sphere",
        building.sphere("Sphere", 0.020),
        (-0.043, SPHERE_DISTANCE, -0.030),
        (0.0, 0.0, 0.0),
        _wrinkles(),
    )
    shell = building.sphere("Background", BACKGROUND_DISTANCE, rings=96)
    building.add(scene, "Background", shell, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _sky())
    if moving:
        # Evenly, whatever the preferences say of new keys.
        _drive(cube, "rotation_euler", 2, math.radians(24.0))
        _drive(sphere, "location", 0, 0.030)
        _drive(sphere, "location", 2, 0.006)
    return scene


def _drive(item: bpy.types.Object, name: str, axis: int, rate: float) -> None:
    """Let a value grow by a rate a frame from what it is at frame 1."""
    rest = getattr(item, name)[axis]
    item.driver_add(name, axis).driver.expression = f"{rest} + {rate} * (frame - 1)"


def _patchwork() -> bpy.types.Material:
    """Coloured cells with fine dark lines: detail at every scale, so that sharpness can be seen."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        cells = building.node(tree, "TexVoronoi", Vector=place, Scale=130.0)
        vivid = building.node(tree, "HueSaturation", Color=cells.outputs["Color"], Saturation=1.5)
        lines = building.node(tree, "TexVoronoi", feature="DISTANCE_TO_EDGE", Vector=place, Scale=130.0)
        rim = building.node(tree, "Math", operation="GREATER_THAN")
        rim.inputs[1].default_value = 0.06
        tree.links.new(lines.outputs["Distance"], rim.inputs[0])
        grain = building.node(
            tree, "TexChecker", Vector=place, Scale=500.0, Color1=(1.0, 1.0, 1.0), Color2=(0.45, 0.45, 0.45)
        )
        dark, fine = (building.node(tree, "VectorMath", operation="MULTIPLY") for _ in range(2))
        tree.links.new(vivid.outputs["Color"], dark.inputs[0])
        tree.links.new(rim.outputs[0], dark.inputs[1])
        tree.links.new(dark.outputs[0], fine.inputs[0])
        tree.links.new(grain.outputs["Color"], fine.inputs[1])
        return building.node(tree, "BsdfDiffuse", Color=fine.outputs[0]).outputs[0]

    return building.material("Patchwork", shade)


def _wrinkles() -> bpy.types.Material:
    """Brown, with bumps as of crumpled leather."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        noise = building.node(tree, "TexNoise", Vector=place, Scale=260.0, Detail=3.0)
        bump = building.node(tree, "Bump", Distance=0.004, Height=noise.outputs[0])
        shader = building.node(tree, "BsdfDiffuse", Color=(0.42, 0.19, 0.07), Normal=bump.outputs[0])
        return shader.outputs[0]

    return building.material("Wrinkles", shade)


def _sky() -> bpy.types.Material:
    """Blue, with a grid of lighter lines so that its focus can be judged."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        turn = building.node(tree, "Mapping", Vector=place, Rotation=(math.radians(90.0), 0.0, 0.0))
        grid = building.node(
            tree,
            "TexBrick",
            offset=0.0,
            Vector=turn.outputs[0],
            Color1=(0.05, 0.13, 0.42),
            Color2=(0.08, 0.20, 0.55),
            Mortar=(0.55, 0.65, 0.80),
            Scale=12.0,
            Mortar_Size=0.012,
            Brick_Width=0.5,
            Row_Height=0.5,
        )
        return building.node(tree, "BsdfDiffuse", Color=grid.outputs["Color"]).outputs[0]

    return building.material("Sky", shade)
