"""A small scene with one of everything that work on it could leave changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from sample_scenes.building import emitter

from .scenes import card


def artists_scene(folder: Path) -> Any:
    """Make the scene anew in an empty file, also where the extension is off, and return it.

    Parameters
    ----------
    folder : Path
        Takes samples, pictures and a library.

    Returns
    -------
    Scene
        Keyed and changed since, hidden in every way, driven, linked, overridden; with two view layers,
        a second scene, markers, a compositor and settings of the artist's own.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.preferences.edit.use_global_undo = True
    scene = bpy.context.scene
    _settings(scene, folder)
    red, blue = emitter("Red", (1.0, 0.0, 0.0)), emitter("Blue", (0.0, 0.0, 1.0))
    near = card(scene, "Near", (-0.5, 4.0, 0.0), 1.0, red)
    card(scene, "Wall", (0.0, 9.0, 0.0), 30.0, blue)
    card(scene, "Mirror", (1.0, 6.0, 0.0), 1.0, _mirror())
    for frame, x in ((0, -1.0), (4, 1.0)):
        near.location.x = x
        near.keyframe_insert("location", frame=frame)
    near["mark"] = [1.0, 2.0]
    _cameras(scene, near)
    _hidden(scene, red)
    _driven(scene, blue)
    _linked(scene, folder, red)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.location.y = 3.0
    scene.collection.objects.link(lamp)
    _compositor(scene)
    other = bpy.data.scenes.new("Other")
    other.frame_set(7)
    other.camera = scene.camera
    scene.view_layers.new("Second").use = False
    scene.frame_set(2)
    # Changed and not keyed.
    near.location.z = 0.25
    if hasattr(scene, "potmesil_camera"):
        scene.potmesil_camera.fade = 0.75
    layer = scene.view_layers[0]
    for item in layer.objects:
        item.select_set(item.name == "Near", view_layer=layer)
    layer.objects.active = near
    layer.update()
    return scene


def _settings(scene: Any, folder: Path) -> None:
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 24, 16, 100
    cycles.samples = 1
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    image = render.image_settings
    # Blender fills in a default colour space the first time that a format is chosen.
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGB", "16"
    image.file_format, image.color_mode = "PNG", "RGB"
    render.filepath = str(folder / "out" / "frame_")
    render.use_motion_blur = True
    scene.frame_start, scene.frame_end, scene.frame_step = 1, 3, 2
    if hasattr(scene, "potmesil_camera"):
        scene.potmesil_camera.samples_path = str(folder / "samples_####.exr")
    scene.world = bpy.data.worlds.new("World")


def _mirror() -> Any:
    material = bpy.data.materials.new("Silver")
    if material.node_tree is None:
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = 1.0, 0.0
    return material


def _cameras(scene: Any, near: Any) -> None:
    for number, name in enumerate(("Camera", "Close")):
        data = bpy.data.cameras.new(name)
        camera = bpy.data.objects.new(name, data)
        camera.rotation_euler.x = 1.5707963267948966
        camera.location.x = 0.1 * number
        data.dof.use_dof = True
        data.dof.focus_distance, data.dof.aperture_fstop = 9.0, 1.0
        scene.collection.objects.link(camera)
        scene.timeline_markers.new(name, frame=1 + 2 * number).camera = camera
    data = bpy.data.cameras["Camera"]
    data.dof.focus_object = near
    data.dof.keyframe_insert("aperture_fstop", frame=1)
    # A marker at frame 1 says another one than the artist has chosen since.
    scene.camera = bpy.data.objects["Camera"]


def _hidden(scene: Any, material: Any) -> None:
    eye, render, viewport, out = (
        card(scene, name, (0.5, 5.0, 1.0), 0.2, material) for name in ("Eye", "Render", "Viewport", "Out")
    )
    # Blender works out where things are while they can be seen.
    bpy.context.view_layer.update()
    eye.hide_set(True)
    render.hide_render = True
    viewport.hide_viewport = True
    viewport.visible_camera = False
    viewport.modifiers.new("Thick", "SOLIDIFY").show_viewport = False
    collection = bpy.data.collections.new("Apart")
    scene.collection.children.link(collection)
    scene.collection.objects.unlink(out)
    collection.objects.link(out)
    collection.hide_viewport = True
    if hasattr(collection, "potmesil_camera"):
        collection.potmesil_camera.peel = True
    scene.view_layers[0].layer_collection.children["Apart"].hide_viewport = True


def _driven(scene: Any, material: Any) -> None:
    item = card(scene, "Driven", (0.0, 7.0, 1.0), 0.3, material)
    curve = item.driver_add("location", 0)
    curve.driver.expression = "frame / 10"
    if hasattr(scene, "potmesil_camera"):
        curve = scene.driver_add("potmesil_camera.slit_width")
        curve.driver.expression = "0.25"


def _linked(scene: Any, folder: Path, material: Any) -> None:
    item = card(scene, "Prop", (-1.0, 6.0, 1.0), 0.3, material)
    path = str(folder / "library.blend")
    bpy.data.libraries.write(path, {item})
    bpy.data.objects.remove(item)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Prop"]
    (linked,) = wanted.objects
    scene.collection.objects.link(linked)
    linked.override_create(remap_local_usages=False)


def _compositor(scene: Any) -> None:
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("Comp", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    layers = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layers.outputs["Image"], output.inputs[0])
