"""Rendering the scenes: samples files by the extension, and Cycles' own blur to compare them with."""

from __future__ import annotations

import functools
import importlib
import runpy
import tempfile
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import numpy.typing as npt
import OpenEXR

ROOT = Path(__file__).resolve().parent.parent

Picture = npt.NDArray[np.float32]


@functools.cache
def extension() -> ModuleType:
    """Return the extension's root package: the enabled one, or this checkout's, registered."""
    package: ModuleType = runpy.run_path(str(ROOT / "farm" / "run.py"))["load_extension"]()
    return package


def render_samples(scene: bpy.types.Scene, path: Path) -> Path:
    """Render the current frame and save its samples, as the extension does.

    Parameters
    ----------
    scene : Scene
        The scene; its settings of the extension count.
    path : Path
        The samples file.

    Returns
    -------
    Path
        The same.
    """
    export = importlib.import_module(f"{extension().__name__}.operators.export")
    path.parent.mkdir(parents=True, exist_ok=True)
    with bpy.context.temp_override(scene=scene):
        export.render_samples(bpy.context, path)
    return path


def render_picture(
    scene: bpy.types.Scene, *, lens: bool = False, shutter: bool = False, samples: int | None = None
) -> Picture:
    """Render the current frame with Cycles alone.

    Parameters
    ----------
    scene : Scene
        The scene.
    lens : bool
        Whether with Cycles' own depth of field.
    shutter : bool
        Whether with Cycles' own motion blur.
    samples : int, optional
        Samples a pixel in place of the scene's.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        Scene-linear, row 0 on top.
    """
    scene.camera.data.dof.use_dof = lens
    scene.render.use_motion_blur = shutter
    before = scene.cycles.samples
    scene.cycles.samples = before if samples is None else samples
    bpy.ops.render.render(scene=scene.name)
    scene.cycles.samples = before
    scene.camera.data.dof.use_dof = scene.render.use_motion_blur = False
    return saved_render(scene)


def saved_render(scene: bpy.types.Scene) -> Picture:
    """Return what was rendered last, by way of a file.

    Parameters
    ----------
    scene : Scene
        Whose image settings are used, and changed.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        Scene-linear, row 0 on top.
    """
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGB", "32"
    with tempfile.TemporaryDirectory(prefix="potmesil_") as folder:
        path = Path(folder) / "render.exr"
        bpy.data.images["Render Result"].save_render(str(path), scene=scene)
        return read_picture(path)


def read_picture(path: Path) -> Picture:
    """Return the red, green and blue of an EXR file.

    Parameters
    ----------
    path : Path
        With one layer.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        Scene-linear, row 0 on top.
    """
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[name].pixels for name in "RGB"], axis=2).astype(np.float32)
