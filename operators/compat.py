"""Where Blender's versions differ: the one module that knows, by asking for what is there."""

from __future__ import annotations

from typing import Any

import bpy

from .borrow import Borrowed


def borrow_multilayer_exr(borrowed: Borrowed, scene: bpy.types.Scene) -> None:
    """Make the scene's output a float multilayer EXR, until the borrowed settings are given back.

    Parameters
    ----------
    borrowed : Borrowed
        Remembers what the settings were.
    scene : Scene
        The scene.
    """
    image = scene.render.image_settings
    values: dict[str, Any] = {
        "file_format": "OPEN_EXR_MULTILAYER",
        "color_mode": "RGBA",
        "color_depth": "32",
        # The samples file is written once more with its attributes and is compressed then.
        "exr_codec": "NONE",
        "color_management": "FOLLOW_SCENE",
    }
    # Blender 5.0 added the medium, which limits the formats and so comes first.
    if hasattr(image, "media_type"):
        values = {"media_type": "MULTI_LAYER_IMAGE", **values}
    # Blender 5.0 cannot write several parts with pixels that are not square.
    if hasattr(image, "use_exr_interleave") and scene.render.pixel_aspect_x != scene.render.pixel_aspect_y:
        values["use_exr_interleave"] = True
    borrowed.set_all(image, values)


def cycles_settings(scene: bpy.types.Scene) -> Any:
    """Return the scene's Cycles settings, or None where Blender is built without Cycles."""
    return getattr(scene, "cycles", None)


def view_layer_denoises(view_layer: bpy.types.ViewLayer) -> bool:
    """Return whether Cycles denoises a view layer, as far as the layer itself decides it."""
    cycles = getattr(view_layer, "cycles", None)
    return bool(getattr(cycles, "use_denoising", True))


def use_nodes(owner: Any) -> None:
    """Give a material or world a node tree, where it has none."""
    if owner.node_tree is None:
        owner.use_nodes = True


def compositor_tree(scene: bpy.types.Scene) -> Any:
    """Return a scene's compositor tree, or None where it has none."""
    # Blender 5.0 made it a node group like any other.
    if hasattr(scene, "compositing_node_group"):
        return scene.compositing_node_group
    return scene.node_tree


def make_compositor_tree(scene: bpy.types.Scene) -> Any:
    """Give a scene that has none a compositor tree that shows the render as it is.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    NodeTree
        The tree: a Render Layers node and an output.
    """
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group or bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
        scene.compositing_node_group = tree
        if not tree.interface.items_tree:
            tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()  # from 4.5 on, Blender itself may have put the same nodes there
        output = tree.nodes.new("CompositorNodeComposite")
    layer = tree.nodes.new("CompositorNodeRLayers")
    layer.scene = scene
    output.location.x = 400.0
    tree.links.new(layer.outputs["Image"], output.inputs[0])
    return tree


def remove_compositor_tree(scene: bpy.types.Scene) -> None:
    """Take away what `make_compositor_tree` gave."""
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group
        scene.compositing_node_group = None
        if not tree.users:
            bpy.data.node_groups.remove(tree)
    else:
        scene.node_tree.nodes.clear()


def compositor_switches(scene: bpy.types.Scene) -> tuple[tuple[str, str, bool], ...]:
    """Return what else has to be on for the compositor to run: what it is in, its name, its value."""
    if hasattr(scene, "compositing_node_group"):
        return ()
    return (("", "use_nodes", True),)


def new_interface_socket(tree: Any, socket: Any, direction: str) -> None:
    """Give a node group's interface a socket of the same name and kind as a socket of a node.

    Parameters
    ----------
    tree : NodeTree
        The group's tree.
    socket : NodeSocket
        The socket.
    direction : {"INPUT", "OUTPUT"}
        Into the group or out of it.
    """
    kinds = {"RGBA": "NodeSocketColor", "VALUE": "NodeSocketFloat", "VECTOR": "NodeSocketVector"}
    item = tree.interface.new_socket(socket.name, in_out=direction, socket_type=kinds[socket.type])
    if socket.name == "Vector":
        # To the frame before and to the one after.
        item.dimensions = 4
