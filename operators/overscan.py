"""Overscan: a margin around the picture, from which something moves or blurs into it."""

from __future__ import annotations

import bpy
import numpy as np

from ..potmesil_addon.effects import Effects, effects_from_json
from ..potmesil_addon.lens import circle_of_confusion
from . import kernels
from .borrow import Borrowed
from .effects import scene_effects
from .motion import LARGEST_MARGIN, SampledMotion
from .scene import frame_format


def uses_overscan(scene: bpy.types.Scene) -> bool:
    """Return whether the scene asks for what lies beyond the picture's border, and has no other border."""
    own = scene.potmesil_camera
    if not own.use_overscan or scene.render.use_border:
        return False
    return bool(own.use_motion or own.use_lens or _bends(_effects(scene)))


def overscan_margins(scene: bpy.types.Scene, motion: SampledMotion) -> tuple[int, int]:
    """Return how wide the margin must be for the exposure, for the lens and for what it bends.

    Parameters
    ----------
    scene : Scene
        The scene.
    motion : SampledMotion
        What moves, and what is before the camera.

    Returns
    -------
    tuple of int
        Columns and rows more on each side, at most a quarter of the picture's.
    """
    own = scene.potmesil_camera
    film = motion.camera.film
    needed = np.zeros(2)
    if own.use_motion:
        needed += motion.margins
    if own.use_lens:
        # What moves into the picture from outside brings its circle along.
        needed += lens_margins(motion, own.coc_model)
    effects = _effects(scene)
    if _bends(effects):
        needed += distortion_margins(motion, effects)
    columns, rows = np.minimum(needed, LARGEST_MARGIN * np.array([film.columns, film.rows])).astype(int)
    return int(columns), int(rows)


def lens_margins(motion: SampledMotion, coc_model: str) -> tuple[int, int]:
    """Return the largest radius, across and down, of circles of confusion that reach in over the border.

    It is an upper bound: the background may be infinitely far away, and what reaches over the border is
    taken for as near there as its bounding box.

    Parameters
    ----------
    motion : SampledMotion
        Camera, lens, and what is before them.
    coc_model : {"cycles", "paper"}
        How out-of-focus points are imaged.

    Returns
    -------
    tuple of int
        Columns and rows, at most a quarter of the picture's; 0 where no circle is a pixel wide.
    """
    camera, lens = motion.camera, motion.lens
    film = camera.film
    largest = np.floor(LARGEST_MARGIN * np.array([film.columns, film.rows]))
    crossing = motion.boxes.crossing(camera)
    margins = largest
    while True:
        inverse = motion.boxes.inverse_depths(camera, margins)[crossing, 0]
        nearest = float(np.nanmax(inverse, initial=0.0)) if np.isfinite(inverse).any() else 0.0
        with np.errstate(divide="ignore"):
            depths = 1.0 / np.array([0.0, nearest])
        circle = float(np.abs(circle_of_confusion(depths, lens, coc_model)).max())  # type: ignore[arg-type]
        # An anamorphic aperture is narrower than it is high, or wider.
        diameters = circle / np.array([film.pitch_x * lens.anamorphic_ratio, film.pitch_y])
        needed = np.where(diameters < 1.0, 0.0, np.minimum(np.ceil(0.5 * diameters), largest))
        # What lies farther out than the largest circle reaches does not count, and may have been the nearest.
        if (needed >= margins).all() or not needed.any():
            return int(needed[0]), int(needed[1])
        margins = needed


def distortion_margins(motion: SampledMotion, effects: Effects) -> tuple[int, int]:
    """Return how far over the border a lens sees that distorts, or images colours at other sizes.

    Parameters
    ----------
    motion : SampledMotion
        The camera.
    effects : Effects
        What its lens does.

    Returns
    -------
    tuple of int
        Columns and rows; 0 where it sees less than a pinhole.
    """
    kernels.use_user_cache()
    from ..potmesil_addon.distortion import lens_map, window_needed  # noqa: PLC0415 - see kernels
    from ..potmesil_addon.samples import Window  # noqa: PLC0415

    camera = motion.camera
    columns, rows = camera.film.columns, camera.film.rows
    frame = Window(0, 0, columns, rows)
    lens = lens_map(
        effects.distortion,
        effects.chromatic,
        camera.focal_length,
        camera.film,
        (camera.axis_x, camera.axis_y),
        frame,
    )
    if lens is None:
        return 0, 0
    needed = window_needed(lens, frame)
    return max(0, -needed.x0, needed.x1 - columns), max(0, -needed.y0, needed.y1 - rows)


def _effects(scene: bpy.types.Scene) -> Effects:
    return effects_from_json(scene_effects(scene))


def _bends(effects: Effects) -> bool:
    """Return whether straight lines are bent, or colours imaged at other sizes."""
    chromatic = effects.chromatic
    return effects.distortion is not None or bool(
        chromatic is not None and (chromatic.size_red or chromatic.size_blue)
    )


def borrow_overscan(borrowed: Borrowed, scene: bpy.types.Scene, margins: tuple[int, int]) -> None:
    """Let the camera see more on all sides.

    Parameters
    ----------
    borrowed : Borrowed
        Remembers what the settings were.
    scene : Scene
        The scene, its other settings borrowed already.
    margins : tuple of int
        Columns and rows more on each side.
    """
    if margins == (0, 0):
        return
    margin_x, margin_y = margins
    camera, render = scene.camera.data, scene.render
    frame = frame_format(scene, camera)
    columns, rows = frame.frame_size
    pitch_x, _ = frame.fitted_pitch
    shift_x, shift_y = frame.shift
    columns, rows = columns + 2 * margin_x, rows + 2 * margin_y
    borrowed.set(render, "resolution_x", columns)
    borrowed.set(render, "resolution_y", rows)
    borrowed.set(render, "resolution_percentage", 100)
    width = pitch_x * columns
    borrowed.set(camera, "sensor_fit", "HORIZONTAL")
    borrowed.set(camera, "sensor_width", width * 1000.0)
    # Blender gives the shift in units of the fitted side, which has become longer.
    borrowed.set(camera, "shift_x", -shift_x / width)
    borrowed.set(camera, "shift_y", -shift_y / width)
