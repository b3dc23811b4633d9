"""From a render to a samples file: passes switched on, blur switched off, the camera saved with it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy

from ..potmesil_addon.errors import InputError
from ..potmesil_addon.frames import frame_path
from ..potmesil_addon.preflight import Finding, check_scene
from . import compat
from .borrow import Borrowed
from .scene import evaluated_camera, scene_camera, scene_facts, scene_lens, scene_shutter

RENDER_RESULT = "Render Result"

_POINT_FILTER_WIDTH = 0.01
_POINT_SUPERSAMPLING = 2


def refuse_errors(scene: bpy.types.Scene) -> tuple[Finding, ...]:
    """Raise InputError with the first finding that keeps the scene from rendering; return the others."""
    findings = check_scene(scene_facts(scene))
    for finding in findings:
        if finding.severity == "error":
            raise InputError(finding.text)
    return findings


def borrow_for_render(borrowed: Borrowed, scene: bpy.types.Scene) -> None:
    """Change, until they are given back, the settings that a samples file needs otherwise.

    Parameters
    ----------
    borrowed : Borrowed
        Remembers what the settings were.
    scene : Scene
        A scene with a camera.
    """
    render = scene.render
    borrowed.set(render, "use_motion_blur", False)
    borrowed.set(render, "use_multiview", False)
    borrowed.set(scene.camera.data.dof, "use_dof", False)
    borrowed.set(render, "use_compositing", False)
    borrowed.set(render, "use_sequencer", False)
    for layer in scene.view_layers:
        if layer.use:
            borrowed.set(layer, "use_pass_combined", True)
            borrowed.set(layer, "use_pass_z", True)
            borrowed.set(layer, "use_pass_vector", True)
            borrowed.set(layer, "use_pass_object_index", True)
    if uses_point_samples(scene):
        cycles = compat.cycles_settings(scene)
        # Cycles' Box filter is always a pixel wide, whatever its width says; this one obeys it.
        borrowed.set(cycles, "pixel_filter_type", "BLACKMAN_HARRIS")
        borrowed.set(cycles, "filter_width", _POINT_FILTER_WIDTH)
        borrowed.set(render, "resolution_percentage", render.resolution_percentage * _POINT_SUPERSAMPLING)


def uses_point_samples(scene: bpy.types.Scene) -> bool:
    """Return whether the scene asks for point samples and its engine can give them."""
    return bool(scene.potmesil_camera.point_samples and scene.render.engine == "CYCLES")


def save_samples(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, path: Path) -> None:
    """Save the Render Result as a samples file, with the camera that it was rendered with.

    Called while the render's settings are still borrowed, so that the camera has the render's size.

    Parameters
    ----------
    scene : Scene
        The scene that was rendered.
    depsgraph : Depsgraph
        The scene evaluated at the rendered frame.
    path : Path
        The samples file; written whole or not at all.

    Raises
    ------
    InputError
        If there is no render to save.
    OutputError
        If the file cannot be written.
    """
    # Blender's start-up would pay for OpenEXR's and numba's import if this stood above.
    from ..potmesil_addon import exr  # noqa: PLC0415

    camera = evaluated_camera(scene, depsgraph)
    attributes = exr.camera_attributes(scene_camera(scene, camera), scene_lens(camera), scene_shutter(scene))
    if uses_point_samples(scene):
        attributes["potmesil:supersampling"] = _POINT_SUPERSAMPLING
    image = bpy.data.images.get(RENDER_RESULT)
    if image is None:
        raise InputError("There is no render to save; render the scene first.")
    with tempfile.TemporaryDirectory(prefix="potmesil_") as folder, Borrowed() as borrowed:
        rendered = Path(folder) / "render.exr"
        compat.borrow_multilayer_exr(borrowed, scene)
        try:
            image.save_render(str(rendered), scene=scene)
        except RuntimeError as error:
            raise InputError(
                f"Blender cannot save the render ({str(error).strip()}); render again."
            ) from error
        exr.annotate(rendered, path, attributes)


def render_samples(context: bpy.types.Context, path: Path) -> None:
    """Render the current frame and save its samples, blocking while Blender renders.

    Parameters
    ----------
    context : Context
        Its scene is rendered.
    path : Path
        The samples file.

    Raises
    ------
    InputError
        If the scene cannot be rendered.
    OutputError
        If the file cannot be written.
    """
    scene = context.scene
    refuse_errors(scene)
    with Borrowed() as borrowed:
        borrow_for_render(borrowed, scene)
        bpy.ops.render.render(scene=scene.name)
        save_samples(scene, context.evaluated_depsgraph_get(), path)


def samples_path(scene: bpy.types.Scene) -> Path:
    """Return where the scene's samples of the current frame belong.

    A path relative to a .blend file that was never saved goes into Blender's temporary folder.
    """
    template = scene.potmesil_camera.samples_path or "//potmesil/####.exr"
    if template.startswith("//") and not bpy.data.filepath:
        resolved = Path(bpy.app.tempdir) / template.removeprefix("//")
    else:
        resolved = Path(bpy.path.abspath(template))
    return frame_path(resolved, scene.frame_current)
