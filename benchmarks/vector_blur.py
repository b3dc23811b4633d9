"""The picture that Blender's Vector Blur node makes of a samples file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import numpy.typing as npt
from rgba import saved_rgba, write_channels

if TYPE_CHECKING:
    from motion_scenes import Exposure

    from potmesil_addon.samples import SampleLayer

Array = npt.NDArray[np.float32]

SAMPLE_COUNTS = (64, 256)

_NO_SURFACE = 1e10


@dataclass(frozen=True, slots=True)
class Setup:
    """A way to set the node up.

    Parameters
    ----------
    shutter : float
        The node's Shutter, in frames.
    samples : int
        The node's Samples.
    vectors : {"both", "ahead", "back"}
        Which halves of the Vector pass it is given; the other one is 0.
    """

    shutter: float
    samples: int
    vectors: str = "both"

    @property
    def name(self) -> str:
        """For reports."""
        return f"shutter {self.shutter:.4g}, {self.samples} samples, vectors {self.vectors}"


def setups(exposure: Exposure, counts: tuple[int, ...] = SAMPLE_COUNTS) -> tuple[Setup, ...]:
    """Return the ways to set the node up that an exposure may be met best with.

    The node's exposure is even, has the frame in its middle and is the same in all rows. Where the frame
    lies at an end it is also given the vectors of that half alone, for twice the time; where the shutter
    has a curve, also an even exposure of the same variance; where it rolls, also the time of one row.

    Parameters
    ----------
    exposure : Exposure
        The scene's shutter.
    counts : tuple of int
        The node's Samples to try.

    Returns
    -------
    tuple of Setup
        All to be tried; the best one counts.
    """
    found = [(exposure.frames, "both")]
    if exposure.position != "CENTER":
        half = "ahead" if exposure.position == "START" else "back"
        found.append((2.0 * exposure.frames, half))
    if exposure.curve:
        times = np.linspace(0.0, 1.0, 1001)
        light = np.interp(times, *np.transpose(exposure.curve))
        light /= light.sum()
        variance = float(light @ times**2 - (light @ times) ** 2)
        found.append((exposure.frames * math.sqrt(12.0 * variance), "both"))
    if exposure.rolling is not None:
        found.append((exposure.frames * exposure.rolling, "both"))
    return tuple(Setup(shutter, count, vectors) for shutter, vectors in found for count in counts)


def vector_blur(layer: SampleLayer, setup: Setup, folder: Path) -> Array:
    """Run Blender's Vector Blur node.

    Parameters
    ----------
    layer : SampleLayer
        Its Combined, Z and Vector are used.
    setup : Setup
        How to set it up.
    folder : Path
        For files that are removed again.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        Scene-linear.
    """
    picture = composited(layer, lambda tree, passes: blurred(tree, passes, setup), folder, setup.vectors)
    return picture[..., :3]


def blurred(tree: Any, passes: Any, setup: Setup, image: Any = None) -> Any:
    """Add a Vector Blur node to a tree, and return the socket of its picture.

    Parameters
    ----------
    tree : NodeTree
        The compositor's nodes.
    passes : Node
        Has Combined, Depth and Vector.
    setup : Setup
        How to set it up.
    image : NodeSocket, optional
        What is blurred in place of Combined.

    Returns
    -------
    NodeSocket
        The blurred picture.
    """
    blur = tree.nodes.new("CompositorNodeVecBlur")
    blur.inputs["Samples"].default_value = setup.samples
    blur.inputs["Shutter"].default_value = setup.shutter
    for source, socket in (
        (image or passes.outputs["Combined"], "Image"),
        (passes.outputs["Depth"], "Depth"),
        (passes.outputs["Vector"], "Speed"),
    ):
        tree.links.new(source, blur.inputs[socket])
    return blur.outputs["Image"]


def composited(
    layer: SampleLayer,
    connect: Callable[[Any, Any], Any],
    folder: Path,
    vectors: str = "both",
    camera: Callable[[bpy.types.Scene, bpy.types.Camera], None] | None = None,
) -> Array:
    """Run Blender's compositor on a samples file.

    Parameters
    ----------
    layer : SampleLayer
        Its Combined, Z and Vector are used.
    connect : callable
        Gets the tree and the node with the passes, and returns the socket of the finished picture.
    folder : Path
        For files that are removed again.
    vectors : {"both", "ahead", "back"}
        Which halves of the Vector pass there are; the other one is 0.
    camera : callable, optional
        Gets the compositor's scene and its camera's data, which some nodes read.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        Scene-linear and premultiplied.
    """
    source = folder / "node_input.exr"
    rows, columns = _write_passes(source, layer, vectors)
    scene = bpy.data.scenes.new("Compositor")
    image = bpy.data.images.load(str(source))
    tree = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
    item = bpy.data.objects.new("Unused", bpy.data.cameras.new("Unused"))
    try:
        scene.collection.objects.link(item)
        scene.camera = item
        if camera is not None:
            camera(scene, item.data)
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        passes = tree.nodes.new("CompositorNodeImage")
        passes.image = image
        output = tree.nodes.new("NodeGroupOutput")
        tree.links.new(connect(tree, passes), output.inputs["Image"])
        render = scene.render
        render.engine = "CYCLES"
        render.resolution_x, render.resolution_y, render.resolution_percentage = columns, rows, 100
        render.use_compositing = True
        render.compositor_device, render.compositor_precision = "CPU", "FULL"
        scene.cycles.samples = 1
        scene.cycles.use_denoising = False
        scene.compositing_node_group = tree
        bpy.ops.render.render(scene=scene.name)
        return saved_rgba(scene)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.node_groups.remove(tree)
        bpy.data.images.remove(image)
        bpy.data.cameras.remove(item.data)
        source.unlink()


def _write_passes(path: Path, layer: SampleLayer, vectors: str) -> tuple[int, int]:
    """Write the three passes with the names that Blender gives them; return their rows and columns."""
    assert layer.depth is not None
    assert layer.vector is not None
    vector = layer.vector.copy()
    if vectors != "both":
        vector[..., slice(0, 2) if vectors == "ahead" else slice(2, 4)] = 0.0
    channels = {f"Layer.Combined.{name}": layer.color[..., n] for n, name in enumerate("RGBA")}
    channels |= {f"Layer.Vector.{name}": vector[..., n] for n, name in enumerate("XYZW")}
    channels["Layer.Depth.V"] = np.where(np.isfinite(layer.depth), layer.depth, _NO_SURFACE)
    write_channels(path, channels)
    rows, columns = layer.depth.shape
    return rows, columns
