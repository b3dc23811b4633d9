"""What the scenes are built with: an empty file, meshes, materials, lamps, keys.

One Blender unit is one metre. Angles are in degrees here, since scenes are written by hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import bpy  # isort: skip - brings bmesh and mathutils
import bmesh
import numpy as np
import numpy.typing as npt
from mathutils import Matrix, Vector

Vector3 = tuple[float, float, float]
Color = tuple[float, float, float]


def empty_scene(name: str, columns: int, rows: int, *, samples: int, bounces: int = 4) -> bpy.types.Scene:
    """Replace everything in Blender's current file by an empty scene for Cycles.

    Parameters
    ----------
    name : str
        The scene's name.
    columns, rows : int
        Pixels of the picture.
    samples : int
        Cycles' samples a pixel; all are taken, and nothing is denoised.
    bounces : int
        Most bounces of light, of every kind.

    Returns
    -------
    Scene
        With a black world, no camera and no lamp, shown through the sRGB curve alone.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.name = name
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = columns, rows
    render.resolution_percentage = 100
    cycles = scene.cycles
    cycles.samples = samples
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    for kind in ("max", "diffuse", "glossy", "transmission"):
        setattr(cycles, f"{kind}_bounces", bounces)
    cycles.sample_clamp_indirect = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    scene.view_settings.view_transform = "Standard"
    world = bpy.data.worlds.new("World")
    scene.world = world
    sky(scene, (0.0, 0.0, 0.0))
    return scene


def sky(scene: bpy.types.Scene, color: Color, strength: float = 1.0) -> bpy.types.Node:
    """Let the world shine evenly, and return its background node."""
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(n for n in scene.world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength
    return background


def extension_settings(scene: bpy.types.Scene, **values: Any) -> None:
    """Change the extension's settings of a scene, by name, where the extension is registered."""
    if hasattr(scene, "potmesil_camera"):
        for name, value in values.items():
            setattr(scene.potmesil_camera, name, value)


def gradient_sky(scene: bpy.types.Scene, stops: Sequence[tuple[float, Color]], strength: float) -> None:
    """Let the world shine in colours that go by height.

    Parameters
    ----------
    scene : Scene
        The scene.
    stops : sequence of (float, tuple of float)
        Places from 0 (straight down) over 0.5 (the horizon) to 1 (straight up), rising, with their
        scene-linear colours.
    strength : float
        Of all colours.
    """
    background = sky(scene, (1.0, 1.0, 1.0), strength)
    tree = scene.world.node_tree
    direction = node(tree, "TexCoord").outputs["Generated"]
    height = node(tree, "SeparateXYZ", Vector=direction).outputs["Z"]
    share = node(tree, "MapRange", Value=height, From_Min=-1.0).outputs[0]
    ramp = node(tree, "ValToRGB", Fac=share)
    elements = ramp.color_ramp.elements
    while len(elements) < len(stops):
        elements.new(0.5)
    for element, (position, color) in zip(elements, stops, strict=True):
        element.position, element.color = position, (*color, 1.0)
    tree.links.new(ramp.outputs["Color"], background.inputs["Color"])


def add(
    scene: bpy.types.Scene,
    name: str,
    data: bpy.types.ID | None,
    location: Vector3 = (0.0, 0.0, 0.0),
    rotation: Vector3 = (0.0, 0.0, 0.0),
    *materials: bpy.types.Material,
) -> bpy.types.Object:
    """Add an object to a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    name : str
        The object's name.
    data : ID or None
        Mesh, lamp, camera or curve; ``None`` for an empty.
    location : tuple of float
        In metres.
    rotation : tuple of float
        Euler angles in degrees, XYZ.
    *materials : Material
        Become the data's, where it has none yet.

    Returns
    -------
    Object
        The object. Meshes get the next pass index.
    """
    item = bpy.data.objects.new(name, data)
    item.location = location
    item.rotation_euler = tuple(math.radians(angle) for angle in rotation)
    scene.collection.objects.link(item)
    if isinstance(data, bpy.types.Mesh):
        item.pass_index = 1 + max((other.pass_index for other in scene.objects if other != item), default=0)
    for material in materials if materials and not data.materials else ():
        data.materials.append(material)
    return item


def camera(
    scene: bpy.types.Scene,
    focal_length_mm: float,
    sensor_mm: float,
    location: Vector3,
    target: Vector3,
    *,
    f_stop: float,
    focus_distance: float | None = None,
) -> bpy.types.Object:
    """Add the scene's camera.

    Parameters
    ----------
    scene : Scene
        The scene.
    focal_length_mm : float
        Focal length of the lens.
    sensor_mm : float
        The sensor's longer side.
    location, target : tuple of float
        Where it stands, and what is in the middle of the picture.
    f_stop : float
        Aperture number n.
    focus_distance : float, optional
        Depth of the plane in focus in metres. By default the target's.

    Returns
    -------
    Object
        The camera.
    """
    data = bpy.data.cameras.new("Camera")
    data.lens = focal_length_mm
    data.sensor_width = data.sensor_height = sensor_mm
    data.clip_start, data.clip_end = 0.01, 1000.0
    item = add(scene, "Camera", data, location)
    look_at(item, target)
    # Cycles' own depth of field stays off: the samples are the pinhole camera's.
    data.dof.aperture_fstop = f_stop
    distance = (Vector(target) - Vector(location)).length
    data.dof.focus_distance = distance if focus_distance is None else focus_distance
    scene.camera = item
    return item


def look_at(item: bpy.types.Object, target: Vector3) -> None:
    """Turn a camera or a lamp towards a place, upright."""
    direction = Vector(target) - item.location
    item.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def lamp(
    scene: bpy.types.Scene,
    name: str,
    kind: str,
    power: float,
    location: Vector3,
    target: Vector3 = (0.0, 0.0, 0.0),
    *,
    size: float = 0.1,
    color: Color = (1.0, 1.0, 1.0),
) -> bpy.types.Object:
    """Add a lamp.

    Parameters
    ----------
    scene : Scene
        The scene.
    name : str
        The lamp's name.
    kind : {"POINT", "SPOT", "AREA", "SUN"}
        Kind of lamp.
    power : float
        Watts; for a sun watts a square metre.
    location, target : tuple of float
        Where it is, and what it shines at.
    size : float
        Radius of a point or spot, side of an area in metres, angle of a sun in degrees.
    color : tuple of float
        Scene-linear.

    Returns
    -------
    Object
        The lamp.
    """
    data = bpy.data.lights.new(name, kind)
    data.energy = power
    data.color = color
    if kind == "AREA":
        data.size = size
    elif kind == "SUN":
        data.angle = math.radians(size)
    else:
        data.shadow_soft_size = size
    item = add(scene, name, data, location)
    look_at(item, target)
    return item


def mesh(name: str, build: Callable[[bmesh.types.BMesh], Any], *, smooth: bool = False) -> bpy.types.Mesh:
    """Return a mesh with texture coordinates that is filled by a function.

    Parameters
    ----------
    name : str
        The mesh's name.
    build : callable
        Gets an empty bmesh and fills it.
    smooth : bool
        Whether faces are shaded as one curved surface.

    Returns
    -------
    Mesh
        The mesh.
    """
    work = bmesh.new()
    work.loops.layers.uv.new("UVMap")
    build(work)
    data = bpy.data.meshes.new(name)
    work.to_mesh(data)
    work.free()
    if smooth:
        data.shade_smooth()
    return data


def box(name: str, size: Vector3, *, bevel: float = 0.0) -> bpy.types.Mesh:
    """Return a box around the origin, edges rounded by so many metres.

    Each face shows the whole texture, upright on the four sides.
    """

    def build(work: bmesh.types.BMesh) -> None:
        bmesh.ops.create_cube(work, size=1.0, matrix=Matrix.Diagonal((*size, 1.0)), calc_uvs=True)
        uv = work.loops.layers.uv.active
        for face in work.faces:
            level = abs(face.normal.z) > 0.5
            up = Vector((0.0, 1.0, 0.0)) if level else Vector((0.0, 0.0, 1.0))
            right = up.cross(face.normal)
            for loop in face.loops:
                place = loop.vert.co
                loop[uv].uv = (0.5 + math.copysign(0.5, right @ place), 0.5 + math.copysign(0.5, up @ place))
        if bevel > 0.0:
            bmesh.ops.bevel(work, geom=work.edges[:], offset=bevel, segments=3, profile=0.5, affect="EDGES")

    return mesh(name, build)


def sphere(name: str, radius: float, rings: int = 48) -> bpy.types.Mesh:
    """Return a smooth sphere around the origin."""
    return mesh(
        name,
        lambda work: bmesh.ops.create_uvsphere(
            work, u_segments=2 * rings, v_segments=rings, radius=radius, calc_uvs=True
        ),
        smooth=True,
    )


def cylinder(
    name: str, radius: float, height: float, *, top: float | None = None, segments: int = 48
) -> bpy.types.Mesh:
    """Return a closed cylinder, or a cone with another radius at its top, around the origin along z."""
    data = mesh(
        name,
        lambda work: bmesh.ops.create_cone(
            work,
            cap_ends=True,
            segments=segments,
            radius1=radius,
            radius2=radius if top is None else top,
            depth=height,
            calc_uvs=True,
        ),
    )
    for face in data.polygons:
        face.use_smooth = len(face.vertices) == 4
    return data


def plane(name: str, width: float, depth: float) -> bpy.types.Mesh:
    """Return a rectangle around the origin that faces up, its texture from corner to corner."""

    def build(work: bmesh.types.BMesh) -> None:
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        face = work.faces.new([work.verts.new((0.5 * width * x, 0.5 * depth * y, 0.0)) for x, y in corners])
        uv = work.loops.layers.uv.active
        for loop, (x, y) in zip(face.loops, corners, strict=True):
            loop[uv].uv = (0.5 + 0.5 * x, 0.5 + 0.5 * y)

    return mesh(name, build)


def turned(
    name: str, profile: Sequence[tuple[float, float]], segments: int = 96, *, smooth: bool = True
) -> bpy.types.Mesh:
    """Return a surface of revolution about z.

    Parameters
    ----------
    name : str
        The mesh's name.
    profile : sequence of (float, float)
        Radius and height in metres along the outline. Walking along it with rising height, the outside is
        on the side of larger radii. An end with radius 0 is closed.
    segments : int
        Steps around the axis.
    smooth : bool
        Whether faces are shaded as one curved surface.

    Returns
    -------
    Mesh
        The surface; u runs around, v along the outline.
    """
    turns = np.linspace(0.0, 2.0 * math.pi, segments, endpoint=False)
    vertices = [(r * math.cos(a), r * math.sin(a), z) for r, z in profile for a in turns]
    faces = [
        (
            ring * segments + step,
            ring * segments + (step + 1) % segments,
            (ring + 1) * segments + (step + 1) % segments,
            (ring + 1) * segments + step,
        )
        for ring in range(len(profile) - 1)
        for step in range(segments)
    ]
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    layer = data.uv_layers.new(name="UVMap")
    last = len(profile) - 1
    for number in range(len(faces)):
        ring, step = divmod(number, segments)
        corners = ((step, ring), (step + 1, ring), (step + 1, ring + 1), (step, ring + 1))
        for loop, (u, v) in enumerate(corners):
            layer.data[4 * number + loop].uv = (u / segments, v / last)
    work = bmesh.new()
    work.from_mesh(data)
    bmesh.ops.remove_doubles(work, verts=work.verts, dist=1e-7)
    work.to_mesh(data)
    work.free()
    if smooth:
        data.shade_smooth()
    return data


def picture(name: str, pixels: npt.NDArray[np.floating[Any]]) -> bpy.types.Image:
    """Return an image made of pixels and packed into the file.

    Parameters
    ----------
    name : str
        The image's name.
    pixels : ndarray of float of shape (rows, columns, 3)
        Display values (sRGB) from 0 to 1, row 0 on top.

    Returns
    -------
    Image
        The image, 8 bits deep.
    """
    rows, columns, _ = pixels.shape
    image = bpy.data.images.new(name, columns, rows)
    values = np.ones((rows, columns, 4), dtype=np.float32)
    values[..., :3] = pixels[::-1]
    image.pixels.foreach_set(values.reshape(-1))
    image.update()
    image.pack()
    return image


def tree_of(material: bpy.types.Material) -> bpy.types.ShaderNodeTree:
    """Return a material's nodes. Before Blender 5.0 they have to be asked for, and after it that warns."""
    if material.node_tree is None:
        material.use_nodes = True
    return material.node_tree


def node(tree: bpy.types.NodeTree, kind: str, **values: Any) -> bpy.types.Node:
    """Add a node.

    Parameters
    ----------
    tree : NodeTree
        The nodes.
    kind : str
        Its type without ``ShaderNode``.
    **values
        Sockets by name, with ``_`` for a space, and properties: a socket that is given links to it, another
        value becomes its default. Colours may leave out alpha.

    Returns
    -------
    Node
        The node.
    """
    new = tree.nodes.new(f"ShaderNode{kind}")
    # Properties first: what sockets there are may depend on them.
    sockets = {}
    for name, value in values.items():
        if name in new.bl_rna.properties and name not in {"color"}:
            setattr(new, name, value)
        else:
            sockets[name.replace("_", " ")] = value
    for name, value in sockets.items():
        enabled = [socket for socket in new.inputs if socket.name == name and socket.enabled]
        place = enabled[0] if enabled else new.inputs[name]
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, place)
        elif place.type == "RGBA" and len(value) == 3:
            place.default_value = (*value, 1.0)
        else:
            place.default_value = value
    return new


def material(
    name: str, shade: Callable[[bpy.types.ShaderNodeTree], bpy.types.NodeSocket]
) -> bpy.types.Material:
    """Return a material whose surface a function makes.

    Parameters
    ----------
    name : str
        The material's name.
    shade : callable
        Gets the empty nodes and returns the socket of the surface's shader.

    Returns
    -------
    Material
        The material.
    """
    new = bpy.data.materials.new(name)
    tree = tree_of(new)
    tree.nodes.clear()
    node(tree, "OutputMaterial", Surface=shade(tree))
    return new


def diffuse(name: str, color: Color) -> bpy.types.Material:
    """Return a matt material of one colour."""
    return material(name, lambda tree: node(tree, "BsdfDiffuse", Color=color).outputs[0])


def painted(name: str, image: bpy.types.Image) -> bpy.types.Material:
    """Return a matt material that shows an image."""

    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        texture = node(tree, "TexImage", image=image, interpolation="Cubic")
        return node(tree, "BsdfDiffuse", Color=texture.outputs["Color"]).outputs[0]

    return material(name, shade)


def principled(name: str, color: Color, **values: Any) -> bpy.types.Material:
    """Return a Principled material; `values` are its sockets, such as ``Roughness=0.2``."""
    return material(
        name, lambda tree: node(tree, "BsdfPrincipled", Base_Color=color, **values).outputs["BSDF"]
    )


def emitter(name: str, color: Color, strength: float = 1.0) -> bpy.types.Material:
    """Return a material that glows evenly."""
    return material(name, lambda tree: node(tree, "Emission", Color=color, Strength=strength).outputs[0])


def mixed(
    tree: bpy.types.ShaderNodeTree,
    share: bpy.types.NodeSocket | float,
    first: bpy.types.NodeSocket,
    second: bpy.types.NodeSocket,
) -> bpy.types.NodeSocket:
    """Return a mixture of two shaders: the second one's share, and the first's for the rest."""
    mixture = node(tree, "MixShader", Fac=share)
    # Both sockets have the same name.
    tree.links.new(first, mixture.inputs[1])
    tree.links.new(second, mixture.inputs[2])
    return mixture.outputs[0]


def drive(item: bpy.types.Object, name: str, axis: int, rate: float) -> None:
    """Let a value grow by a rate a frame from what it is at frame 1, evenly whatever the preferences say."""
    rest = getattr(item, name)[axis]
    item.driver_add(name, axis).driver.expression = f"{rest} + {rate} * (frame - 1)"


def key(
    owner: bpy.types.ID,
    path: str,
    values: Mapping[float, float | Sequence[float]],
    interpolation: str = "LINEAR",
) -> None:
    """Animate a property.

    Parameters
    ----------
    owner : ID
        What has the property.
    path : str
        Its data path.
    values : mapping of float to float or sequence
        Values by frame. Colours, places and angles (radians) are whole.
    interpolation : str
        Of the curves, which go on straight before the first and after the last frame.

    Notes
    -----
    Blender takes the interpolation of new keys from the preferences, and not at all without a window.
    """
    holder, _, name = path.rpartition(".")
    target = owner.path_resolve(holder) if holder else owner
    for frame, value in values.items():
        setattr(target, name, value)
        owner.keyframe_insert(path, frame=frame)
    for curve in _curves(owner):
        if curve.data_path == path:
            curve.extrapolation = "LINEAR"
            for point in curve.keyframe_points:
                point.interpolation = interpolation


def _curves(owner: bpy.types.ID) -> list[bpy.types.FCurve]:
    """Return the animation curves of data with keys."""
    animation = owner.animation_data
    return [
        curve
        for layer in animation.action.layers
        for strip in layer.strips
        for curve in strip.channelbag(animation.action_slot).fcurves
    ]
