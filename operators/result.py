"""The processed picture, and the maps of how sure it is, as images in Blender."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

if TYPE_CHECKING:
    from ..potmesil_addon.samples import Float32Array

RESULT_NAME = "Potmesil Result"
ERROR_NAME = "Potmesil Error"
GUESSED_NAME = "Potmesil Guessed"


def store_result(picture: Float32Array) -> bpy.types.Image:
    """Put a picture into the image `Potmesil Result`, scene-linear float with premultiplied alpha.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Row 0 on top; Blender's images begin at the bottom.

    Returns
    -------
    Image
        The image, made where it was missing.
    """
    image = _store(RESULT_NAME, picture)
    if not image.use_view_as_render:
        image.use_view_as_render = True
    return image


def store_resized(picture: Float32Array) -> bpy.types.Image:
    """Put a picture of any size into the result; what an Image Editor shows keeps its place and size.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Row 0 on top.

    Returns
    -------
    Image
        The image.
    """
    image = bpy.data.images.get(RESULT_NAME)
    if image is None or tuple(image.size) == (picture.shape[1], picture.shape[0]):
        return store_result(picture)
    views = list(_views_of(image))
    image = store_result(picture)
    for window, area, region, zoom, middle in views:
        space: Any = area.spaces.active
        if space.image != image:
            continue
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.image.view_zoom_ratio(ratio=zoom / picture.shape[1])
            now = _middle(region)
            columns, rows = picture.shape[1], picture.shape[0]
            shift = (columns * (middle[0] - now[0]), rows * (middle[1] - now[1]))
            if max(map(abs, shift)) >= 1.0:
                bpy.ops.image.view_pan(offset=shift)
    return image


def _views_of(image: bpy.types.Image) -> Iterator[tuple[Any, Any, Any, float, tuple[float, float]]]:
    """Yield where an image is shown: window, area, region, its width on the screen, what is in the middle."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            space: Any = area.spaces.active
            if area.type == "IMAGE_EDITOR" and space.image == image:
                region = next(region for region in area.regions if region.type == "WINDOW")
                yield window, area, region, space.zoom[0] * image.size[0], _middle(region)


def _middle(region: bpy.types.Region) -> tuple[float, float]:
    """Return the place in the image, from 0 to 1, that is in a region's middle."""
    x, y = region.view2d.region_to_view(0.5 * region.width, 0.5 * region.height)
    return float(x), float(y)


def store_map(name: str, values: Float32Array) -> bpy.types.Image:
    """Put a value for each pixel into a grey and opaque image.

    Parameters
    ----------
    name : str
        The image's name.
    values : ndarray of float32 of shape (rows, columns)
        Row 0 on top.

    Returns
    -------
    Image
        The image, made where it was missing.
    """
    picture = np.ones((*values.shape, 4), dtype=np.float32)
    picture[..., :3] = values[..., np.newaxis]
    return _store(name, picture)


def _store(name: str, picture: Float32Array) -> bpy.types.Image:
    """Put a picture into a float image of our own."""
    rows, columns = picture.shape[:2]
    image = bpy.data.images.get(name)
    if image is not None and not is_ours(image):
        image.name = f"{name}.old"
        image = None
    if image is None:
        image = bpy.data.images.new(name, 1, 1, alpha=True, float_buffer=True)
        image.alpha_mode = "PREMUL"
        # Blender displays an image with the scene's view transform only if it takes it for one of a file.
        image.pixels.foreach_set(np.zeros(4, dtype=np.float32))
        image.update()
        image.pack()
    if tuple(image.size) != (columns, rows):
        image.scale(columns, rows)
    image.pixels.foreach_set(np.ascontiguousarray(picture[::-1], dtype=np.float32).reshape(-1))
    image.update()
    return image


def is_ours(image: bpy.types.Image) -> bool:
    """Return whether an image is one that pictures are put into, and no file of the artist's."""
    return bool(image.source == "FILE" and image.packed_file and not image.filepath and image.is_float)


def show_result(context: bpy.types.Context, image: bpy.types.Image) -> None:
    """Show the image where an Image Editor shows a render, a former result, or nothing."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if shows_result(area):
                space: Any = area.spaces.active
                space.image = image
                area.tag_redraw()


def shows_result(area: bpy.types.Area) -> bool:
    """Return whether an area is an Image Editor with a render, a former result, or nothing."""
    if area.type != "IMAGE_EDITOR":
        return False
    space: Any = area.spaces.active
    return space.image is None or space.image.type == "RENDER_RESULT" or space.image.name == RESULT_NAME
