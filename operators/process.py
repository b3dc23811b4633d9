"""Process: the picture again from the last samples file, without rendering."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ..potmesil_addon.shutter import ShutterAttributes, Slit
from . import kernels
from .export import samples_path
from .result import ERROR_NAME, GUESSED_NAME, show_result, store_map, store_result
from .scene import evaluated_camera, scene_exposure, scene_lens
from .work import SteppedOperator

if TYPE_CHECKING:
    from ..potmesil_addon.process import ProcessSettings


class POTMESIL_OT_process(SteppedOperator, bpy.types.Operator):
    """Blur the last rendered samples with the present focus, f-stop and shutter, without rendering again"""

    bl_idname = "potmesil.process"
    bl_label = "Process"
    bl_options = {"REGISTER", "UNDO"}

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Process the samples of the current frame."""
        del interactive
        yield from process_samples(context, samples_path(context.scene))


def process_samples(context: bpy.types.Context, path: Path) -> Iterator[float]:
    """Process a samples file with the scene's settings into the result image, and note how sure it is.

    Parameters
    ----------
    context : Context
        Its scene's camera and settings are used.
    path : Path
        The samples file.

    Yields
    ------
    float
        Share of the work done.

    Raises
    ------
    PotmesilError
        If the file or a setting is wrong.
    """
    kernels.use_user_cache()
    from ..potmesil_addon import exr  # noqa: PLC0415 - see kernels
    from ..potmesil_addon.process import process, scaled  # noqa: PLC0415

    settings = process_settings(context)
    yield 0.0
    samples = exr.read_samples(path)
    yield 0.1
    result = yield from scaled(process(samples, settings), 0.1, 0.9)
    show_result(context, store_result(result.picture))
    if context.scene.potmesil_camera.use_quality_maps:
        store_map(ERROR_NAME, result.predicted_error)
        store_map(GUESSED_NAME, result.guessed)
    state, quality = context.window_manager.potmesil_camera, result.report["quality"]
    state.guessed_pixels, state.expected_error = quality["guessed_pixels"], quality["predicted_error"]
    state.has_quality = True


def process_settings(context: bpy.types.Context) -> ProcessSettings:
    """Return the scene's settings for the processors.

    The lens is the camera's and the exposure the scene's as they stand now; the film, and what moves
    where, are those of the samples file.
    """
    from ..potmesil_addon.preview import settings_from_json  # noqa: PLC0415 - see kernels

    return settings_from_json(settings_values(context))


def settings_values(context: bpy.types.Context) -> dict[str, Any]:
    """Return the same settings as plain values, without loading the processors.

    Raises
    ------
    InputError
        If the scene has no camera.
    """
    scene = context.scene
    own = scene.potmesil_camera
    lens = scene_lens(evaluated_camera(scene, context.evaluated_depsgraph_get()))
    return {
        "use_lens": own.use_lens,
        "use_motion": own.use_motion,
        "lens": asdict(lens),
        "shutter": asdict(panel_shutter(scene)),
        "motion_model": own.motion_model,
        "model": own.coc_model,
        "psf": {"kind": own.psf},
        "visibility": own.visibility,
        # Blender keeps camera lengths in millimetres.
        "uniform_defocus": own.uniform_defocus / 1000.0,
        "fade": own.fade,
    }


def panel_shutter(scene: bpy.types.Scene) -> ShutterAttributes:
    """Return the exposure of a scene with nothing left open.

    A curve, an opening or a slit that is gone from the panel must not come back from the samples file:
    one opening is an empty tuple, and all of the film at once a slit of width 1.
    """
    said = scene_exposure(scene)
    return replace(
        said,
        curve=said.curve or (),
        openings=said.openings or (),
        blade_time=said.blade_time or 0.0,
        slit=said.slit or Slit(width=1.0),
    )
