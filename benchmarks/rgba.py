"""Pictures with alpha, to and from Blender and EXR files: premultiplied, scene-linear, row 0 on top."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt
import OpenEXR

Picture = npt.NDArray[np.float32]


def saved_rgba(scene: bpy.types.Scene) -> Picture:
    """Return what was rendered last, by way of a file.

    Parameters
    ----------
    scene : Scene
        Whose image settings are used, and changed.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        The picture.
    """
    image = scene.render.image_settings
    image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    with tempfile.TemporaryDirectory(prefix="potmesil_") as folder:
        path = Path(folder) / "render.exr"
        bpy.data.images["Render Result"].save_render(str(path), scene=scene)
        return read_rgba(path)


def read_rgba(path: Path) -> Picture:
    """Return an EXR file with one layer; without an alpha channel all of it is opaque.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        The picture.
    """
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        pixels = [np.asarray(channels[name].pixels, dtype=np.float32) for name in "RGB"]
        alpha = channels["A"].pixels if "A" in channels else np.ones_like(pixels[0])
        return np.stack([*pixels, alpha], axis=2).astype(np.float32)


def write_channels(path: Path, channels: dict[str, npt.NDArray[np.float32]]) -> None:
    """Write float channels of one size into an EXR file.

    Parameters
    ----------
    path : Path
        The file.
    channels : dict of str to ndarray of shape (rows, columns)
        By name.
    """
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    # The module reads an array's memory and not its strides.
    whole = {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in channels.items()}
    OpenEXR.File(header, whole).write(str(path))
