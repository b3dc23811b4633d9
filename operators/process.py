"""Process: the picture again from the last samples file, without rendering."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..potmesil_addon.shutter import Flash, ShutterAttributes, Slit
from . import kernels
from .composite import composite, refuse_unready
from .effects import scene_effects
from .export import samples_path
from .result import ERROR_NAME, GUESSED_NAME, show_result, store_map, store_result
from .scene import evaluated_camera, scene_exposure, scene_lens
from .stage import stage_scene
from .work import SteppedOperator, doing

if TYPE_CHECKING:
    from ..potmesil_addon.process import ProcessSettings
    from ..potmesil_addon.samples import Float32Array

T = TypeVar("T")

_PROCESS_SHARE = 0.8
"""Share of the progress bar for processing; the rest is the compositor."""


class POTMESIL_OT_process(SteppedOperator, bpy.types.Operator):
    """Blur the last rendered samples with the present focus, f-stop and shutter, without rendering again"""

    bl_idname = "potmesil.process"
    bl_label = "Process"
    bl_options = {"REGISTER", "UNDO"}

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Process the samples of the current frame, and let the compositor see the picture."""
        yield from picture_steps(context, samples_path(context.scene), self if interactive else None)


def picture_steps(
    context: bpy.types.Context, path: Path, operator: SteppedOperator | None
) -> Iterator[float]:
    """Process a samples file, and run the compositor where the scene has a stage.

    Parameters
    ----------
    context : Context
        Its scene's camera and settings are used.
    path : Path
        The samples file of the current frame.
    operator : SteppedOperator or None
        Whose step this is, where Blender's window is to stay free.

    Yields
    ------
    float
        Share of the work done.

    Raises
    ------
    PotmesilError
        If the file or a setting is wrong.
    """
    scene = context.scene
    if stage_scene(scene) is None:
        yield from process_samples(context, path)
        return
    refuse_unready(scene)
    for done in process_samples(context, path):
        yield _PROCESS_SHARE * done
    for done in composite(scene, operator):
        yield _PROCESS_SHARE + (1.0 - _PROCESS_SHARE) * done


def process_samples(
    context: bpy.types.Context, path: Path, scene: bpy.types.Scene | None = None
) -> Generator[float, None, bpy.types.Image]:
    """Process a samples file with the scene's settings into the result image, and note how sure it is.

    Parameters
    ----------
    context : Context
        Its scene's camera and settings are used.
    path : Path
        The samples file.
    scene : Scene or None
        The scene, where the artist may have gone to another one meanwhile.

    Yields
    ------
    float
        Share of the work done.

    Returns
    -------
    Image
        The result.

    Raises
    ------
    PotmesilError
        If the file or a setting is wrong.
    """
    scene = scene or context.scene
    doing(iface_("Processing Frame {frame}").format(frame=scene.frame_current), timed=True)
    kernels.use_user_cache()
    from ..potmesil_addon import exr  # noqa: PLC0415 - see kernels
    from ..potmesil_addon.preview import settings_from_json  # noqa: PLC0415
    from ..potmesil_addon.process import process  # noqa: PLC0415
    from ..potmesil_addon.progress import scaled  # noqa: PLC0415

    values = _values_of(scene, context)
    settings = settings_from_json(values)
    kernels.compile_beside(path, values)
    try:
        yield 0.0
        stamp = _stamp(path)
        samples = exr.read_samples(path)
        yield 0.1
        result = yield from scaled(by_turns(process(samples, settings)), 0.1, 0.9)
    finally:
        kernels.end_beside()
    image = store_result(result.picture)
    _Last.picture = None
    if stage_scene(scene) is None:
        show_result(context, image)
    elif len(samples.layers) == 1:
        _Last.key, _Last.picture = (stamp, values, samples.layers[0].name), result.picture
    if scene.potmesil_camera.use_quality_maps:
        store_map(ERROR_NAME, result.predicted_error)
        store_map(GUESSED_NAME, result.guessed)
    state, quality = context.window_manager.potmesil_camera, result.report["quality"]
    state.guessed_pixels, state.expected_error = quality["guessed_pixels"], quality["predicted_error"]
    state.has_quality = True
    return image


def _values_of(scene: bpy.types.Scene, context: bpy.types.Context) -> dict[str, Any]:
    """Return the settings of a scene that need not be the context's."""
    if context.scene == scene:
        return settings_values(context)
    layer = next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])
    with context.temp_override(scene=scene, view_layer=layer):
        return settings_values(context)


class _Last:
    """The last picture that was processed for a stage, which composites it next."""

    key: Any = None
    picture: Float32Array | None = None


def known_picture(path: Path, values: dict[str, Any], layer: str) -> Float32Array | None:
    """Return the picture that a view layer's samples were made into last, if nothing has changed since.

    Parameters
    ----------
    path : Path
        The samples file.
    values : dict
        The settings, see `scene_settings`.
    layer : str
        The view layer.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4) or None
        The picture, row 0 on top.
    """
    return _Last.picture if _Last.key == (_stamp(path), values, layer) else None


def _stamp(path: Path) -> tuple[str, int, int] | None:
    """Return what tells a file from what stood in its place before."""
    try:
        facts = path.stat()
    except OSError:
        return None
    return str(path), facts.st_mtime_ns, facts.st_size


_turns: dict[str, object] = {}


def by_turns(steps: Generator[float, None, T]) -> Generator[float, None, T]:
    """Run processors so that another run of them, in a render's thread, goes on only between two steps.

    Numba ends Blender where two threads run its kernels at a time.

    Parameters
    ----------
    steps : generator
        Yields progress, returns a result.

    Yields
    ------
    float
        The same progress.

    Returns
    -------
    object
        The same result.
    """
    token = object()
    while True:
        # One thread at a time gets through this, as Python guards dictionaries.
        while _turns.setdefault("turn", token) is not token:
            time.sleep(0.001)
        try:
            done = next(steps)
        except StopIteration as stop:
            result: T = stop.value
            return result
        finally:
            del _turns["turn"]
        yield done


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
    return scene_settings(context.scene, context.evaluated_depsgraph_get())


def scene_settings(scene: bpy.types.Scene, graph: bpy.types.Depsgraph) -> dict[str, Any]:
    """Return the settings of a scene as plain values.

    Parameters
    ----------
    scene : Scene
        The scene.
    graph : Depsgraph
        What it was evaluated into.

    Returns
    -------
    dict
        For `preview.settings_from_json`.

    Raises
    ------
    InputError
        If the scene has no camera.
    """
    own = scene.potmesil_camera
    lens = scene_lens(evaluated_camera(scene, graph))
    return {
        "use_lens": own.use_lens,
        "use_motion": own.use_motion,
        "lens": asdict(lens),
        "shutter": asdict(panel_shutter(scene)),
        "motion_model": own.motion_model,
        "model": own.coc_model,
        "psf": {"kind": own.psf},
        "visibility": own.visibility,
        "reflections": own.reflections != "OFF",
        "shadows": own.reflections == "REFLECTIONS_AND_SHADOWS",
        # Blender keeps camera lengths in millimetres.
        "uniform_defocus": own.uniform_defocus / 1000.0,
        "fade": own.fade,
        "effects": scene_effects(scene),
        "frame": scene.frame_current,
    }


def panel_shutter(scene: bpy.types.Scene) -> ShutterAttributes:
    """Return the exposure of a scene with nothing left open.

    A curve, an opening or a slit that is gone from the panel must not come back from the samples file:
    one opening is an empty tuple, all of the film at once a slit of width 1, and no flash one without light.
    """
    said = scene_exposure(scene)
    return replace(
        said,
        curve=said.curve or (),
        openings=said.openings or (),
        blade_time=said.blade_time or 0.0,
        slit=said.slit or Slit(width=1.0),
        flash=said.flash or Flash(share=0.0),
    )
