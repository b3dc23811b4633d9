"""The pictures that other tools make of a samples file: Blender's Defocus node and GEGL's lens blur.

Each is set up in the few ways that it may do best with; the best one counts.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import bpy
import numpy as np
import numpy.typing as npt
from rgba import read_rgba, write_channels
from vector_blur import Setup, blurred, composited

from potmesil_addon.camera import Film
from potmesil_addon.lens import Lens, circle_of_confusion
from potmesil_addon.samples import SampleLayer

Picture = npt.NDArray[np.float32]
Order = Literal["lens", "lens, motion", "motion, lens"]

_BOKEH = {3: "TRIANGLE", 4: "SQUARE", 5: "PENTAGON", 6: "HEXAGON", 7: "HEPTAGON", 8: "OCTAGON"}
"""The node's names for apertures; with more blades it is round."""

_VECTOR_SAMPLES = 64

_LARGEST_SHARE = 0.999
"""Share of the samples whose circles count: a few at grazing angles must not make a tool slow."""


@dataclass(frozen=True, slots=True)
class DefocusSetup:
    """A way to set Blender's Defocus node up.

    Parameters
    ----------
    f_stop : float
        The node's f-stop.
    max_blur : float
        The node's Max Blur, a radius in pixels.
    bokeh : str
        The node's Bokeh Type.
    angle : float
        The node's Angle in radians.
    order : {"lens", "lens, motion", "motion, lens"}
        Whether Vector Blur comes after or before it.
    shutter : float
        Vector Blur's Shutter.
    """

    f_stop: float
    max_blur: float
    bokeh: str = "CIRCLE"
    angle: float = 0.0
    order: Order = "lens"
    shutter: float = 0.0

    @property
    def name(self) -> str:
        """For reports."""
        shape = (
            "" if self.bokeh == "CIRCLE" else f", {self.bokeh.lower()} at {math.degrees(self.angle):.0f} deg"
        )
        chain = "" if self.order == "lens" else f", {self.order}"
        return f"f/{self.f_stop:.3g}, Max Blur {self.max_blur:.3g}{shape}{chain}"


@dataclass(frozen=True, slots=True)
class GeglSetup:
    """A way to set GEGL's lens blur up.

    Parameters
    ----------
    radius : float
        Radius in pixels where the mask is 1.
    """

    radius: float

    @property
    def name(self) -> str:
        """For reports."""
        return f"radius {self.radius:.3g}"


def radii(layer: SampleLayer, lens: Lens, film: Film) -> npt.NDArray[np.float64]:
    """Return the radius in pixels of each sample's circle of confusion, negative before the focus."""
    assert layer.depth is not None
    return np.asarray(0.5 * circle_of_confusion(layer.depth, lens) / film.pitch_x)


def largest_radius(layer: SampleLayer, lens: Lens, film: Film) -> float:
    """Return the largest radius in pixels of a circle of confusion, all but of very few samples."""
    return max(1.0, float(np.quantile(np.abs(radii(layer, lens, film)), _LARGEST_SHARE)))


def defocus_setups(largest: float, lens: Lens, shutter: float | None) -> tuple[DefocusSetup, ...]:
    """Return the ways to set the Defocus node up that a lens may be met best with.

    The node's lens moves to focus and Cycles' does not, so that its circles are larger for the same f-stop;
    it is given the camera's f-stop and the one with which its circles are Cycles'. Max Blur is twice the
    largest circle's radius and, since the node erodes by it, also that radius.

    Parameters
    ----------
    largest : float
        Radius in pixels of the largest circle of confusion.
    lens : Lens
        The camera's.
    shutter : float or None
        Frames that the shutter is open, where motion is wanted too.

    Returns
    -------
    tuple of DefocusSetup
        All to be tried.
    """
    breathing = lens.focus_distance / (lens.focus_distance - lens.focal_length)
    wide, narrow = math.ceil(2.0 * largest), math.ceil(largest)
    found = [(lens.f_stop, wide), (lens.f_stop * breathing, wide), (lens.f_stop * breathing, narrow)]
    shapes = [("CIRCLE", 0.0)]
    if lens.blades in _BOKEH:
        shapes = [(_BOKEH[lens.blades], turn * lens.blade_rotation) for turn in (1.0, -1.0)]
    orders: tuple[Order, ...] = ("lens",) if shutter is None else ("lens, motion", "motion, lens")
    return tuple(
        DefocusSetup(f_stop, max_blur, bokeh, angle, order, shutter or 0.0)
        for f_stop, max_blur in found
        for bokeh, angle in shapes
        for order in orders
    )


def defocus(layer: SampleLayer, lens: Lens, film: Film, setup: DefocusSetup, folder: Path) -> Picture:
    """Run Blender's Defocus node, on the CPU.

    Parameters
    ----------
    layer : SampleLayer
        Its Combined, Z and, for motion, Vector are used.
    lens : Lens
        What the node takes from its camera: focal length and focus distance.
    film : Film
        The display window; a pixel of it is one of the layer's.
    setup : DefocusSetup
        How to set it up.
    folder : Path
        For files that are removed again.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        Scene-linear and premultiplied.
    """
    assert layer.depth is not None
    columns = layer.depth.shape[1]
    found: dict[str, Any] = {}

    def camera(scene: bpy.types.Scene, data: bpy.types.Camera) -> None:
        found["scene"] = scene
        data.lens = lens.focal_length * 1000.0
        data.sensor_fit = "HORIZONTAL"
        data.sensor_width = film.pitch_x * columns * 1000.0
        data.dof.focus_distance = lens.focus_distance

    def connect(tree: Any, passes: Any) -> Any:
        motion = Setup(setup.shutter, _VECTOR_SAMPLES)
        image = passes.outputs["Combined"]
        if setup.order == "motion, lens":
            image = blurred(tree, passes, motion)
        node = tree.nodes.new("CompositorNodeDefocus")
        node.scene = found["scene"]
        node.use_zbuffer = True
        node.f_stop, node.blur_max = setup.f_stop, setup.max_blur
        node.bokeh, node.angle = setup.bokeh, setup.angle
        tree.links.new(image, node.inputs["Image"])
        tree.links.new(passes.outputs["Depth"], node.inputs["Z"])
        if setup.order == "lens, motion":
            return blurred(tree, passes, motion, node.outputs["Image"])
        return node.outputs["Image"]

    return composited(layer, connect, folder, camera=camera)


def gegl_program() -> str | None:
    """Return GEGL's command, where it is installed (Debian: ``apt-get install gegl``)."""
    return shutil.which("gegl")


def gegl_setups(largest: float) -> tuple[GeglSetup, ...]:
    """Return the ways to set GEGL's lens blur up: by the circle's radius, and by half a pixel more."""
    return (GeglSetup(largest), GeglSetup(largest + 0.5))


def lens_blur(layer: SampleLayer, lens: Lens, film: Film, setup: GeglSetup, folder: Path) -> Picture:
    """Run GEGL's ``gegl:lens-blur`` on linear floats, with circles over the largest one as its mask.

    Parameters
    ----------
    layer : SampleLayer
        Its Combined and Z are used.
    lens : Lens
        The camera's.
    film : Film
        The display window; a pixel of it is one of the layer's.
    setup : GeglSetup
        How to set it up.
    folder : Path
        For files that are removed again.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        Scene-linear and premultiplied.
    """
    program = gegl_program()
    assert program is not None
    source, mask, result = (folder / f"gegl_{name}.exr" for name in ("source", "mask", "result"))
    largest = largest_radius(layer, lens, film)
    share = np.clip(np.abs(radii(layer, lens, film)) / largest, 0.0, 1.0).astype(np.float32)
    write_channels(source, {name: layer.color[..., n] for n, name in enumerate("RGBA")})
    write_channels(mask, dict.fromkeys("RGB", share))
    try:
        subprocess.run(
            [program, str(source), "-o", str(result), "--", "gegl:lens-blur", f"radius={setup.radius}",
             "linear-mask=true", "aux=[", "gegl:exr-load", f"path={mask}", "]"],
            check=True, capture_output=True, env={**os.environ, "GEGL_USE_OPENCL": "no"},
        )  # fmt: skip
        # Where nothing is, it divides by an alpha of 0.
        return np.nan_to_num(read_rgba(result))
    finally:
        for path in (source, mask, result):
            path.unlink(missing_ok=True)


def timed(picture: Any) -> tuple[Picture, float]:
    """Return what a function makes, and the seconds that it takes."""
    started = time.perf_counter()
    made = picture()
    return made, time.perf_counter() - started
