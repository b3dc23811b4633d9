"""The papers' first test scene: a textured cube, a wrinkled sphere before it, a background all round.

TOG 1982, section 4: the sphere of 20 mm radius at 290 mm, the cube of 100 mm at 550 mm, the background at
980 mm, a 55 mm lens on a 30 x 30 mm frame. One Blender unit is one metre. The papers' picture on the cube
is replaced by a procedural texture with as much detail and colour.
"""

from __future__ import annotations

import math

import bpy

SPHERE_DISTANCE = 0.290
CUBE_DISTANCE = 0.550
BACKGROUND_DISTANCE = 0.980


def build(resolution: int = 512, samples: int = 32, *, moving: bool = False) -> bpy.types.Scene:
    """Replace everything in Blender's current file by the scene.

    Parameters
    ----------
    resolution : int
        Pixels each way.
    samples : int
        Cycles' samples a pixel.
    moving : bool
        Whether the cube spins and the sphere flies past; at frame 1 both are where they are at rest.

    Returns
    -------
    Scene
        The scene, its camera at the origin looking along +y and focused on the cube.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.name = "Cube and Sphere"
    _render_settings(scene, resolution, samples)

    camera = bpy.data.cameras.new("Camera")
    camera.lens = 55.0
    camera.sensor_width = camera.sensor_height = 30.0
    camera.clip_start, camera.clip_end = 0.01, 10.0
    camera.dof.focus_distance = CUBE_DISTANCE
    camera.dof.aperture_fstop = 5.6
    view = _add(scene, "Camera", camera, (0.0, 0.0, 0.0))
    view.rotation_euler = (math.radians(90.0), 0.0, 0.0)
    scene.camera = view

    lamp = bpy.data.lights.new("Light", "POINT")
    lamp.energy = 9.0
    lamp.shadow_soft_size = 0.02
    _add(scene, "Light", lamp, (-0.25, 0.05, 0.35))

    # The face turned to the camera lies at the cube's distance, give or take its slant.
    cube = _add(scene, "Cube", _cube(0.100), (0.025, CUBE_DISTANCE + 0.045, 0.005))
    cube.rotation_euler = (math.radians(22.0), math.radians(12.0), math.radians(38.0))
    cube.data.materials.append(_patchwork())

    sphere = _add(scene, "Sphere", _sphere("Sphere", 0.020), (-0.043, SPHERE_DISTANCE, -0.030))
    sphere.data.materials.append(_wrinkles())

    shell = _add(scene, "Background", _sphere("Background", BACKGROUND_DISTANCE), (0.0, 0.0, 0.0))
    shell.data.materials.append(_sky())
    for index, item in enumerate((cube, sphere, shell), start=1):
        item.pass_index = index
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


def _render_settings(scene: bpy.types.Scene, resolution: int, samples: int) -> None:
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = resolution
    render.resolution_percentage = 100
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 2
    scene.cycles.sample_clamp_indirect = 0.0
    world = bpy.data.worlds.new("World")
    scene.world = world


def _add(
    scene: bpy.types.Scene, name: str, data: bpy.types.ID, location: tuple[float, float, float]
) -> bpy.types.Object:
    item = bpy.data.objects.new(name, data)
    item.location = location
    scene.collection.objects.link(item)
    return item


def _cube(size: float) -> bpy.types.Mesh:
    h = 0.5 * size
    corners = [(x, y, z) for x in (-h, h) for y in (-h, h) for z in (-h, h)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new("Cube")
    mesh.from_pydata(corners, [], faces)
    return mesh


def _sphere(name: str, radius: float, rings: int = 96) -> bpy.types.Mesh:
    segments = 2 * rings
    vertices = [(0.0, 0.0, radius)]
    for ring in range(1, rings):
        polar = math.pi * ring / rings
        for segment in range(segments):
            angle = 2.0 * math.pi * segment / segments
            vertices.append(
                (
                    radius * math.sin(polar) * math.cos(angle),
                    radius * math.sin(polar) * math.sin(angle),
                    radius * math.cos(polar),
                )
            )
    vertices.append((0.0, 0.0, -radius))
    last = len(vertices) - 1

    def at(ring: int, segment: int) -> int:
        return 1 + (ring - 1) * segments + segment % segments

    faces: list[tuple[int, ...]] = []
    for segment in range(segments):
        faces.append((0, at(1, segment), at(1, segment + 1)))
        faces.append((last, at(rings - 1, segment + 1), at(rings - 1, segment)))
        faces.extend(
            (at(r, segment), at(r + 1, segment), at(r + 1, segment + 1), at(r, segment + 1))
            for r in range(1, rings - 1)
        )
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.shade_smooth()
    return mesh


def _material(name: str) -> tuple[bpy.types.Material, bpy.types.ShaderNodeTree, bpy.types.Node]:
    """Return a new diffuse material, its nodes, and its shader."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return material, tree, shader


def _patchwork() -> bpy.types.Material:
    """Coloured cells with fine dark lines: detail at every scale, so that sharpness can be seen."""
    material, tree, shader = _material("Patchwork")
    place = tree.nodes.new("ShaderNodeTexCoord")
    cells = tree.nodes.new("ShaderNodeTexVoronoi")
    cells.inputs["Scale"].default_value = 130.0
    vivid = tree.nodes.new("ShaderNodeHueSaturation")
    vivid.inputs["Saturation"].default_value = 1.5
    lines = tree.nodes.new("ShaderNodeTexVoronoi")
    lines.feature = "DISTANCE_TO_EDGE"
    lines.inputs["Scale"].default_value = 130.0
    rim = tree.nodes.new("ShaderNodeMath")
    rim.operation = "GREATER_THAN"
    rim.inputs[1].default_value = 0.06
    grain = tree.nodes.new("ShaderNodeTexChecker")
    grain.inputs["Scale"].default_value = 500.0
    grain.inputs["Color1"].default_value = (1.0, 1.0, 1.0, 1.0)
    grain.inputs["Color2"].default_value = (0.45, 0.45, 0.45, 1.0)
    dark = tree.nodes.new("ShaderNodeVectorMath")
    dark.operation = "MULTIPLY"
    fine = tree.nodes.new("ShaderNodeVectorMath")
    fine.operation = "MULTIPLY"
    for texture in (cells, lines, grain):
        tree.links.new(place.outputs["Object"], texture.inputs["Vector"])
    tree.links.new(cells.outputs["Color"], vivid.inputs["Color"])
    tree.links.new(lines.outputs["Distance"], rim.inputs[0])
    tree.links.new(vivid.outputs["Color"], dark.inputs[0])
    tree.links.new(rim.outputs[0], dark.inputs[1])
    tree.links.new(dark.outputs[0], fine.inputs[0])
    tree.links.new(grain.outputs["Color"], fine.inputs[1])
    tree.links.new(fine.outputs[0], shader.inputs["Color"])
    return material


def _wrinkles() -> bpy.types.Material:
    """Brown, with bumps as of crumpled leather."""
    material, tree, shader = _material("Wrinkles")
    shader.inputs["Color"].default_value = (0.42, 0.19, 0.07, 1.0)
    place = tree.nodes.new("ShaderNodeTexCoord")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 260.0
    noise.inputs["Detail"].default_value = 3.0
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value = 0.004
    tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    return material


def _sky() -> bpy.types.Material:
    """Blue, with a grid of lighter lines so that its focus can be judged."""
    material, tree, shader = _material("Sky")
    place = tree.nodes.new("ShaderNodeTexCoord")
    grid = tree.nodes.new("ShaderNodeTexBrick")
    grid.offset = 0.0
    grid.inputs["Color1"].default_value = (0.05, 0.13, 0.42, 1.0)
    grid.inputs["Color2"].default_value = (0.08, 0.20, 0.55, 1.0)
    grid.inputs["Mortar"].default_value = (0.55, 0.65, 0.80, 1.0)
    grid.inputs["Scale"].default_value = 12.0
    grid.inputs["Mortar Size"].default_value = 0.012
    grid.inputs["Brick Width"].default_value = 0.5
    grid.inputs["Row Height"].default_value = 0.5
    turn = tree.nodes.new("ShaderNodeMapping")
    turn.inputs["Rotation"].default_value = (math.radians(90.0), 0.0, 0.0)
    tree.links.new(place.outputs["Object"], turn.inputs["Vector"])
    tree.links.new(turn.outputs["Vector"], grid.inputs["Vector"])
    tree.links.new(grid.outputs["Color"], shader.inputs["Color"])
    return material
