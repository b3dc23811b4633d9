"""From Blender's scene to the core's dataclasses: camera, lens, shutter, facts for the pre-flight check."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_

from ..potmesil_addon.camera import Camera, FrameFormat
from ..potmesil_addon.errors import InputError, SettingsError
from ..potmesil_addon.frames import frame_path
from ..potmesil_addon.lens import Lens, circle_of_confusion_at_infinity
from ..potmesil_addon.paths import thinned
from ..potmesil_addon.preflight import SceneFacts
from ..potmesil_addon.shutter import (
    Curve,
    Flash,
    ShutterAttributes,
    ShutterPosition,
    Slit,
    even_openings,
    rotary_slit,
)
from ..potmesil_addon.surfaces import SurfaceKind
from . import compat
from .stage import stage_scene

DEFAULT_CLAMP = 10.0
"""Cycles' own default for indirect light, which hardly touches a highlight that the camera sees."""

_LEAST_FOCUS_DISTANCE = 1e-5

_CURVE_SAMPLES = 256
"""Cycles' own table of the shutter curve has as many values."""

_CURVE_TOLERANCE = 1e-3
"""Openness by which a straight piece of the shutter curve may be off."""

RENDERED_TYPES = ("MESH", "CURVE", "CURVES", "SURFACE", "META", "FONT", "VOLUME", "POINTCLOUD")
"""Types of objects that can show in a render and have a pass index."""

DEFAULT_SAMPLES_PATH = "//potmesil/####.exr"


def scene_facts(scene: bpy.types.Scene, path: Path | None = None) -> SceneFacts:
    """Return what the pre-flight check asks of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    path : Path or None
        The samples file, where it is not the scene's own.

    Returns
    -------
    SceneFacts
        Plain values.
    """
    from .cost import kinds_in  # noqa: PLC0415 - it needs this module

    own = scene.potmesil_camera
    layers = [layer for layer in scene.view_layers if layer.use]
    cycles = compat.cycles_settings(scene) if scene.render.engine == "CYCLES" else None
    camera = scene.camera.data if scene.camera is not None and scene.camera.type == "CAMERA" else None
    rendered = [item for item in scene.objects if _is_rendered(item)]
    template = samples_template(scene)
    folder = (path or samples_path(scene)).parent
    relative = template.startswith("//") and folder == samples_path(scene).parent
    staged = stage_scene(scene) is not None
    switches = compat.compositor_switches(scene)
    blurs = own.use_lens or own.use_motion
    shadows = own.reflections == "REFLECTIONS_AND_SHADOWS"
    # Looking into all materials takes a while, and no other engine tells what they show.
    kinds = kinds_in(scene) if blurs and cycles is not None else frozenset()
    return SceneFacts(
        engine=scene.render.engine,
        has_cycles=compat.cycles_settings(scene) is not None,
        camera_type=None if camera is None else camera.type,
        has_inactive_camera=any(item.type == "CAMERA" for item in scene.objects),
        camera_linked=camera is not None and not camera.is_editable,
        has_depth=all(layer.use_pass_z for layer in layers),
        has_vector=all(layer.use_pass_vector for layer in layers),
        has_object_index=all(layer.use_pass_object_index for layer in layers),
        wants_motion=own.use_motion,
        motion_blur=scene.render.use_motion_blur,
        depth_of_field=camera is not None and camera.dof.use_dof,
        focus_at_lens=camera is not None
        and camera.dof.focus_object is None
        and camera.dof.focus_distance < _LEAST_FOCUS_DISTANCE,
        nothing_blurred=camera is not None and own.use_lens and _is_sharp_everywhere(scene, scene.camera),
        renders_anything=bool(layers),
        all_on_index_zero=len(rendered) > 1 and not any(o.pass_index for o in rendered),
        denoising=cycles is not None
        and cycles.use_denoising
        and any(compat.view_layer_denoises(layer) for layer in layers),
        clamped=cycles is not None
        and (cycles.sample_clamp_direct > 0.0 or 0.0 < cycles.sample_clamp_indirect < DEFAULT_CLAMP),
        wants_reflections=blurs and own.reflections != "OFF",
        # Shadows move without mirrors, too.
        nothing_reflects=uses_reflections(scene) and not (shadows and own.use_motion) and not kinds,
        flat_mirrors=own.reflections == "OFF" and bool(kinds & {SurfaceKind.MIRROR, SurfaceKind.GLASS}),
        wants_shadows=shadows,
        stereo=scene.render.use_multiview,
        region=scene.render.use_border and not scene.render.use_crop_to_border,
        compositing_off=staged
        and not (
            scene.render.use_compositing
            and all(
                getattr(getattr(scene, owner) if owner else scene, name) == on for owner, name, on in switches
            )
        ),
        interface_free=staged and not scene.render.use_lock_interface,
        unwritable_folder="" if is_writable(folder) else str(folder),
        samples_relative=relative,
        temporary_samples=relative and not bpy.data.filepath,
        one_samples_file=path is None
        and "#" not in Path(template).name
        and scene.frame_end > scene.frame_start,
    )


def samples_template(scene: bpy.types.Scene) -> str:
    """Return where the scene's samples belong, as the artist wrote it."""
    return scene.potmesil_camera.samples_path or DEFAULT_SAMPLES_PATH


def samples_path(scene: bpy.types.Scene) -> Path:
    """Return where the scene's samples of the current frame belong.

    A path relative to a .blend file that was never saved goes into Blender's temporary folder.
    """
    template = samples_template(scene)
    if template.startswith("//") and not bpy.data.filepath:
        resolved = Path(bpy.app.tempdir) / template.removeprefix("//")
    else:
        resolved = Path(bpy.path.abspath(template))
    return frame_path(resolved, scene.frame_current)


def is_writable(folder: Path) -> bool:
    """Return whether a file can be written into a folder, which may have to be made first."""
    while True:
        try:
            if folder.exists():
                return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)
        except OSError:
            return False
        if folder == folder.parent:
            return False
        folder = folder.parent


def _is_sharp_everywhere(scene: bpy.types.Scene, camera: bpy.types.Object) -> bool:
    """Return whether circles of confusion stay below a pixel from half of the focus distance to infinity.

    At half of the distance they are as large as at infinity.
    """
    pixel = frame_format(scene, camera.data).fitted_pitch[0]
    try:
        return circle_of_confusion_at_infinity(scene_lens(camera), scene.potmesil_camera.coc_model) < pixel
    except SettingsError:
        return False


def rendered_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's objects that can show in a render, in the order of their names."""
    return sorted((item for item in scene.objects if _is_rendered(item)), key=lambda item: item.name_full)


def _is_rendered(item: bpy.types.Object) -> bool:
    return item.type in RENDERED_TYPES and not item.hide_render


def focus_distance(camera: bpy.types.Object) -> float:
    """Return the distance of the plane in focus along the optical axis, in Blender units.

    Parameters
    ----------
    camera : Object
        An evaluated camera object. Its focus object, if it has one, wins over the distance, as in
        Cycles; for an armature the bone chosen there.

    Returns
    -------
    float
        The distance, 0 or more.
    """
    dof = camera.data.dof
    target = dof.focus_object
    if target is None:
        return float(dof.focus_distance)
    location = target.matrix_world.translation
    if dof.focus_subtarget and target.type == "ARMATURE":
        bone = target.pose.bones.get(dof.focus_subtarget)
        if bone is not None:
            location = target.matrix_world @ bone.matrix.translation
    axis = camera.matrix_world.to_3x3().col[2].normalized()
    return abs(float(axis.dot(camera.matrix_world.translation - location)))


def scene_lens(camera: bpy.types.Object) -> Lens:
    """Return the lens of Blender's camera.

    One Blender unit is one metre, as Cycles' own aperture has it, whatever the scene's unit scale; and as
    in Cycles the focus distance is never quite 0.

    Parameters
    ----------
    camera : Object
        An evaluated camera object.

    Returns
    -------
    Lens
        Lens, aperture and focus.
    """
    data = camera.data
    return Lens(
        focal_length=data.lens / 1000.0,
        f_stop=data.dof.aperture_fstop,
        focus_distance=max(focus_distance(camera), _LEAST_FOCUS_DISTANCE),
        blades=data.dof.aperture_blades,
        blade_rotation=data.dof.aperture_rotation,
        anamorphic_ratio=data.dof.aperture_ratio,
    )


def frame_format(scene: bpy.types.Scene, data: bpy.types.Camera) -> FrameFormat:
    """Return the image frame that the scene renders with a camera."""
    render = scene.render
    border = None
    if render.use_border and render.use_crop_to_border:
        border = (render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y)
    return FrameFormat(
        sensor_width=data.sensor_width / 1000.0,
        sensor_height=data.sensor_height / 1000.0,
        sensor_fit=data.sensor_fit,
        shift_x=data.shift_x,
        shift_y=data.shift_y,
        resolution_x=render.resolution_x,
        resolution_y=render.resolution_y,
        resolution_percentage=render.resolution_percentage,
        pixel_aspect_x=render.pixel_aspect_x,
        pixel_aspect_y=render.pixel_aspect_y,
        border=border,
    )


def scene_camera(scene: bpy.types.Scene, camera: bpy.types.Object) -> Camera:
    """Return the pinhole camera that the scene renders with.

    Parameters
    ----------
    scene : Scene
        Its resolution and border count.
    camera : Object
        An evaluated camera object.

    Returns
    -------
    Camera
        In metres, one for each Blender unit.
    """
    data = camera.data
    return Camera.from_format(
        np.linalg.inv(np.array(camera.matrix_world)),
        data.lens / 1000.0,
        frame_format(scene, data),
        clip_start=data.clip_start,
        clip_end=data.clip_end,
    )


def scene_shutter(scene: bpy.types.Scene) -> ShutterAttributes:
    """Return the exposure of Blender's render settings at the current frame.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    ShutterAttributes
        Length, position and, where the shutter is not open all the time, curve; with Cycles' rolling
        shutter its slit.
    """
    render = scene.render
    rate = render.fps / render.fps_base
    positions: dict[str, ShutterPosition] = {"START": "start", "CENTER": "center", "END": "end"}
    cycles = compat.cycles_settings(scene) if render.engine == "CYCLES" else None
    slit = None
    if cycles is not None and cycles.rolling_shutter_type == "TOP":
        slit = Slit("top", cycles.rolling_shutter_duration)
    return ShutterAttributes(
        exposure_time=render.motion_blur_shutter / rate,
        frames_per_second=rate,
        frames=render.motion_blur_shutter,
        position=positions[render.motion_blur_position],
        curve=_shutter_curve(render.motion_blur_shutter_curve),
        slit=slit,
    )


def scene_exposure(scene: bpy.types.Scene) -> ShutterAttributes:
    """Return all that a scene says of the exposure: Blender's render settings and our own.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    ShutterAttributes
        ``None`` for a curve, openings or a slit that the shutter has not.
    """
    own = scene.potmesil_camera
    said = scene_shutter(scene)
    slit = said.slit if own.shutter_kind == "whole" else None
    if own.shutter_kind == "focal_plane":
        slit = Slit(own.slit_edge, own.slit_width)
    elif own.shutter_kind == "rotary":
        frames, slit = rotary_slit(scene.render.motion_blur_shutter, own.gate_angle, own.slit_edge)
        seconds = frames * scene.render.fps_base / scene.render.fps
        said = replace(said, frames=frames, exposure_time=seconds)
    openings = None
    if own.exposure_count > 1:
        # A spacing below the duration is one exposure right after the other.
        spacing = max(own.exposure_spacing, own.exposure_duration)
        openings = even_openings(own.exposure_count, own.exposure_duration, spacing)
    blade_time = own.blade_time if own.shutter_kind == "between_lens" else None
    flash = None
    if own.use_flash and not _is_slit(slit):
        flash = Flash(
            own.flash_curtain,
            own.flash_share,
            # Longer, and flashes would be one after the other.
            min(own.flash_duration, 1.0 / own.flash_count),
            own.flash_count,
        )
    return replace(said, openings=openings, blade_time=blade_time, slit=slit, flash=flash)


def _is_slit(slit: Slit | None) -> bool:
    """Return whether the film is uncovered bit by bit, so that no flash lights all of it."""
    return slit is not None and slit.width < 1.0


def _shutter_curve(mapping: bpy.types.CurveMapping) -> Curve | None:
    """Return the openness as straight pieces, or None where the shutter is open, or shut, all the time."""
    mapping.initialize()
    curve = mapping.curves[0]
    knots = [point.location.x for point in curve.points]
    x = np.unique(np.clip([*np.linspace(0.0, 1.0, _CURVE_SAMPLES), *knots], 0.0, 1.0))
    y = np.clip([mapping.evaluate(curve, position) for position in x], 0.0, 1.0)
    if (y >= 1.0).all() or (y <= 0.0).all():
        return None
    keep = thinned(x - x[0], y, np.stack([np.zeros_like(y), y], axis=-1)[:, np.newaxis], _CURVE_TOLERANCE)
    return tuple((float(a), float(b)) for a, b in zip(x[keep], y[keep], strict=True))


def evaluated_camera(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object:
    """Return the scene's camera as animation, constraints and drivers leave it.

    Raises
    ------
    InputError
        If the scene has no camera.
    """
    if scene.camera is None or scene.camera.type != "CAMERA":
        raise InputError("The scene has no camera; add one and make it active.")
    return scene.camera.evaluated_get(depsgraph)


def render_graph(scene: bpy.types.Scene) -> bpy.types.Depsgraph:
    """Return what a scene was last evaluated into, of the first view layer that is rendered."""
    return next(layer.depsgraph for layer in scene.view_layers if layer.use)


def uses_reflections(scene: bpy.types.Scene) -> bool:
    """Return whether the scene asks for what mirrors and glass show and its engine tells it."""
    own = scene.potmesil_camera
    return bool(
        own.reflections != "OFF" and (own.use_lens or own.use_motion) and scene.render.engine == "CYCLES"
    )


def as_length(scene: bpy.types.Scene, value: float) -> str:
    """Return a distance in Blender units as the scene's unit settings display it."""
    units = scene.unit_settings
    if math.isinf(value):
        return iface_("Infinity")
    if units.system == "NONE":
        return f"{value:.4g}"
    return bpy.utils.units.to_string(
        units.system, "LENGTH", value * units.scale_length, precision=4, split_unit=False
    )
