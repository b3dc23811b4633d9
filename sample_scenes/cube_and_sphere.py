"""The papers' first test scene: a textured cube, a wrinkled sphere before it, a background all round.

TOG 1982, section 4: the sphere of 20 mm radius at 290 mm, the cube of 100 mm at 550 mm, the background at
980 mm, a 55 mm lens on a 30 x 30 mm frame. One Blender unit is one metre. In place of the papers' picture
the cube wears our own plumage.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy

from . import building
from .plumage import drawn_plumage

SPHERE_DISTANCE = 0.290
CUBE_DISTANCE = 0.550
BACKGROUND_DISTANCE = 0.980

TEXTURE_SIDE = 512
AMBIENT = 0.14
"""Share of its colour with which every surface glows, for the light that bounces would bring."""


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
    # Light without bounces from one point, as the papers' hidden-surface processor has it: no noise.
    scene = building.empty_scene("Cube and Sphere", 512, 512, samples=16, bounces=0)
    building.camera(scene, 55.0, 30.0, (0.0, 0.0, 0.0), (0.0, CUBE_DISTANCE, 0.0), f_stop=5.6)
    building.lamp(scene, "Light", "POINT", 46.0, (-0.48, -0.14, 0.50), size=0.0)

    # What the camera sees of cube and sphere lies around their distance, with their middles behind it.
    cube = building.add(
        scene,
        "Cube",
        building.box("Cube", (0.100, 0.100, 0.100)),
        (0.022, CUBE_DISTANCE + 0.030, 0.012),
        (24.0, -8.0, 30.0),
        _feathers(),
    )
    sphere = building.add(
        scene,
        "Sphere",
        building.sphere("Sphere", 0.020),
        (-0.0375, SPHERE_DISTANCE + 0.012, -0.0354),
        (0.0, 0.0, 0.0),
        _wrinkles(),
    )
    shell = building.sphere("Background", BACKGROUND_DISTANCE)
    building.add(scene, "Background", shell, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), _sky())
    if moving:
        building.drive(cube, "rotation_euler", 2, math.radians(24.0))
        building.drive(sphere, "location", 0, 0.030)
        building.drive(sphere, "location", 2, 0.006)
    return scene


def _lit(
    tree: bpy.types.ShaderNodeTree, color: bpy.types.NodeSocket, normal: bpy.types.NodeSocket | None = None
) -> bpy.types.NodeSocket:
    """Return a matt surface that also glows a little: shades of 1982, without noise in any sample."""
    normals = {} if normal is None else {"Normal": normal}
    matt = building.node(tree, "BsdfDiffuse", Color=color, **normals).outputs[0]
    glow = building.node(tree, "Emission", Color=color, Strength=AMBIENT).outputs[0]
    both = building.node(tree, "AddShader")
    tree.links.new(matt, both.inputs[0])
    tree.links.new(glow, both.inputs[1])
    return both.outputs[0]


def _material(
    name: str, shade: Callable[[bpy.types.ShaderNodeTree], bpy.types.NodeSocket]
) -> bpy.types.Material:
    """Return a material whose glow is not sought as a lamp, which would cost samples and bring noise."""
    material = building.material(name, shade)
    material.cycles.emission_sampling = "NONE"
    return material


def _feathers() -> bpy.types.Material:
    """Our picture in place of the papers' mandrill, once on every side."""
    image = building.picture("Plumage", drawn_plumage(TEXTURE_SIDE))

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        return _lit(
            tree, building.node(tree, "TexImage", image=image, interpolation="Cubic").outputs["Color"]
        )

    return _material("Feathers", shade)


def _wrinkles() -> bpy.types.Material:
    """Brown, with folds and pores as of old leather."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        noise = building.node(tree, "TexNoise", Vector=place, Scale=130.0, Detail=5.0, Distortion=0.9)
        bump = building.node(tree, "Bump", Strength=1.0, Distance=0.012, Height=noise.outputs[0])
        brown = building.node(tree, "RGB")
        brown.outputs[0].default_value = (0.36, 0.15, 0.055, 1.0)
        return _lit(tree, brown.outputs[0], bump.outputs[0])

    return _material("Wrinkles", shade)


def _sky() -> bpy.types.Material:
    """Blue, and faintly mottled at every scale, so that its focus can be seen and measured."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        noise = building.node(tree, "TexNoise", Vector=place, Scale=55.0, Detail=6.0, Roughness=0.65)
        ramp = building.node(tree, "ValToRGB", Fac=noise.outputs[0])
        dark, light = ramp.color_ramp.elements
        dark.position, dark.color = 0.35, (0.028, 0.10, 0.36, 1.0)
        light.position, light.color = 0.65, (0.055, 0.19, 0.55, 1.0)
        return _lit(tree, ramp.outputs["Color"])

    return _material("Sky", shade)
