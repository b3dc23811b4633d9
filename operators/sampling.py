"""How finely a scene is sampled: a sample for each pixel or two each way, and Cycles' pixel filter."""

from __future__ import annotations

import bpy

from . import compat
from .borrow import Borrowed
from .scene import frame_format

_FINER = 2
"""Samples in a pixel, each way, of Fine and of Points."""

_POINT_FILTER_WIDTH = 0.01

_BLACKMAN_HARRIS_VARIANCE = 0.019184279
"""Of the Blackman-Harris window, over the square of its support."""


def supersampling(scene: bpy.types.Scene) -> int:
    """Return how many samples a pixel is made of, each way, where the scene's engine can give more than one.

    The filters of other engines are not known, so that finer samples could not be filtered down.
    """
    finer = scene.potmesil_camera.sampling != "PIXELS" and scene.render.engine == "CYCLES"
    return _FINER if finer else 1


def filter_variance(scene: bpy.types.Scene) -> float | None:
    """Return the variance along an axis of Cycles' pixel filter as it is set.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    float or None
        In rendered pixels squared; None for other engines.
    """
    if scene.render.engine != "CYCLES":
        return None
    cycles = compat.cycles_settings(scene)
    width = float(cycles.filter_width)
    if cycles.pixel_filter_type == "BLACKMAN_HARRIS":
        # The window reaches as far as its width to each side.
        return _BLACKMAN_HARRIS_VARIANCE * (2.0 * width) ** 2
    if cycles.pixel_filter_type == "GAUSSIAN":
        return width * width / 16.0
    # Box is a pixel wide whatever its width says.
    return 1.0 / 12.0


def borrow_sampling(borrowed: Borrowed, scene: bpy.types.Scene) -> None:
    """Let the scene be rendered as finely as it asks for.

    Parameters
    ----------
    borrowed : Borrowed
        Remembers what the settings were.
    scene : Scene
        A scene with a camera.
    """
    factor = supersampling(scene)
    if factor == 1:
        return
    render = scene.render
    frame = frame_format(scene, scene.camera.data)
    columns, rows = (factor * side for side in frame.frame_size)
    left, top, right, bottom = (factor * side for side in frame.crop)
    # A percentage of an odd number, or of a border, could leave a pixel with a part of its samples.
    borrowed.set(render, "resolution_x", columns)
    borrowed.set(render, "resolution_y", rows)
    borrowed.set(render, "resolution_percentage", 100)
    if frame.border is not None:
        # Blender rounds a border down, so that half a sample more is on the safe side.
        borrowed.set(render, "border_min_x", (left + 0.5) / columns)
        borrowed.set(render, "border_max_x", min((right + 0.5) / columns, 1.0))
        borrowed.set(render, "border_min_y", (rows - bottom + 0.5) / rows)
        borrowed.set(render, "border_max_y", min((rows - top + 0.5) / rows, 1.0))
    if scene.potmesil_camera.sampling == "POINTS":
        cycles = compat.cycles_settings(scene)
        # Cycles' Box filter is always a pixel wide, whatever its width says; this one obeys it.
        borrowed.set(cycles, "pixel_filter_type", "BLACKMAN_HARRIS")
        borrowed.set(cycles, "filter_width", _POINT_FILTER_WIDTH)
