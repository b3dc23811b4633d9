"""Fixes: each finding of the pre-flight check put right with one click, as one step of undo."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, get_args

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_
from mathutils import Matrix, Vector

from ..potmesil_addon.errors import InputError, PotmesilError
from ..potmesil_addon.lens import circle_of_confusion_at_infinity
from ..potmesil_addon.preflight import Finding, Fix, check_scene
from . import compat
from .animation import curves_of
from .scene import (
    DEFAULT_CLAMP,
    DEFAULT_SAMPLES_PATH,
    evaluated_camera,
    frame_format,
    rendered_objects,
    samples_template,
    scene_facts,
    scene_lens,
)
from .setup_passes import set_up_passes

_VIEWPORT_ZOOM = 2.0
"""Blender's viewport shows twice the width that a camera with its focal length does."""

_VIEW_DIRECTION = (0.65, -0.62, 0.44)
"""From the scene to a camera that has no viewport to follow: from the front, the right and above."""

_ROOM = 1.2
"""How much larger than the scene the view is that such a camera has."""

_FOCUS_OF_NOTHING = 10.0
"""Blender's own focus distance of new cameras."""

_BLUR_SHARE = 0.01
"""Share of the picture's longer side that the farthest is blurred by, where the aperture is opened."""

_LEAST_BLUR_PX = 2.0

_LOWEST_F_STOP = 0.1


@dataclass(frozen=True, slots=True)
class _Way:
    """How a finding is put right.

    Parameters
    ----------
    label : str
        On its button.
    tooltip : str
        What the button does.
    apply : callable
        Does it.
    """

    label: str
    tooltip: str
    apply: Callable[[bpy.types.Context], None]


class POTMESIL_OT_fix(bpy.types.Operator):
    """Put a finding of the check right"""

    bl_idname = "potmesil.fix"
    bl_label = "Fix"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    fix: bpy.props.EnumProperty(
        name="Fix",
        description="What to do",
        items=_ITEMS,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Say what the button does."""
        del context
        return tip_(WAYS[properties.fix].tooltip)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do it, or say in one sentence why not."""
        return _apply(self, context, [self.fix])


class POTMESIL_OT_fix_all(bpy.types.Operator):
    """Put right all that keeps the scene from rendering well; notes are left as they are"""

    bl_idname = "potmesil.fix_all"
    bl_label = "Fix All"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do what the errors and the warnings name, or say in one sentence why not."""
        return _apply(self, context, fixes_of_all(check_scene(scene_facts(context.scene))))


def fixes_of_all(findings: tuple[Finding, ...]) -> list[Fix]:
    """Return what puts all errors and warnings right, each fix once, in order.

    Where the artist has to choose a file, nothing can be done for all at once.
    """
    asked = [found.fix for found in findings if found.severity != "note"]
    return [fix for fix in dict.fromkeys(asked) if fix is not None and fix != "save_as"]


def label_of(fix: Fix) -> str:
    """Return what stands on a fix's button."""
    return WAYS[fix].label


def _apply(operator: bpy.types.Operator, context: bpy.types.Context, fixes: list[Fix]) -> set[str]:
    """Apply fixes one after the other; an error that the panel shows goes with its finding."""
    scene, state = context.scene, context.window_manager.potmesil_camera
    before = {found.text for found in check_scene(scene_facts(scene))}
    for number, fix in enumerate(fixes):
        try:
            WAYS[fix].apply(context)
        except PotmesilError as error:
            operator.report({"ERROR"}, str(error))
            # What was done before stays, and is a step of undo.
            return {"FINISHED"} if number else {"CANCELLED"}
    # What was added counts from now on, and not from the next redraw on.
    context.view_layer.update()
    if state.error in before - {found.text for found in check_scene(scene_facts(scene))}:
        state.error = ""
    return {"FINISHED"}


def _set(owner: Any, name: str, value: Any) -> None:
    """Change a setting for good.

    Raises
    ------
    InputError
        If it would not stay so: it is in another file, or animated.
    """
    data = owner.id_data
    if not data.is_editable:
        text = rpt_("'{name}' is linked from another file; make it local, or a library override.")
        raise InputError(text.format(name=data.name))
    if any(True for _ in curves_of(owner, name)):
        label = iface_(owner.bl_rna.properties[name].name)
        text = rpt_("{label} of '{name}' is animated; change its keys or its driver instead.")
        raise InputError(text.format(label=label, name=data.name))
    setattr(owner, name, value)


def _camera_data(scene: bpy.types.Scene) -> Any:
    if scene.camera is None or scene.camera.type != "CAMERA":
        raise InputError("The scene has no camera; add one and make it active.")
    return scene.camera.data


def _add_camera(context: bpy.types.Context) -> None:
    """Add a camera that sees what the viewport shows, or else the whole scene, and make it active."""
    scene = context.scene
    _refuse_linked(scene)
    data = bpy.data.cameras.new("Camera")
    camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(camera)
    view = _viewport(context)
    if view is None:
        _frame_scene(scene, camera)
    else:
        region = view.region_3d
        place = region.view_location + region.view_rotation @ Vector((0.0, 0.0, region.view_distance))
        camera.matrix_world = Matrix.Translation(place) @ region.view_rotation.to_matrix().to_4x4()
        data.lens = view.lens / _VIEWPORT_ZOOM
        data.clip_start, data.clip_end = view.clip_start, view.clip_end
    scene.camera = camera
    context.view_layer.update()
    data.dof.focus_distance = _middle_distance(context)


def _activate_camera(context: bpy.types.Context) -> None:
    scene = context.scene
    _refuse_linked(scene)
    cameras = [item for item in scene.objects if item.type == "CAMERA"]
    if not cameras:
        raise InputError("The scene has no camera; add one and make it active.")
    chosen = context.active_object
    scene.camera = chosen if chosen in cameras else min(cameras, key=lambda item: item.name_full)


def _refuse_linked(scene: bpy.types.Scene) -> None:
    if not scene.is_editable:
        text = rpt_("The scene '{name}' is linked from another file; make it local first.")
        raise InputError(text.format(name=scene.name))


def _viewport(context: bpy.types.Context) -> Any:
    """Return the 3D viewport that the artist looks at, the largest one of the screen, or None."""
    if context.screen is None or bpy.app.background:
        return None
    areas = [area for area in context.screen.areas if area.type == "VIEW_3D"]
    if not areas:
        return None
    return max(areas, key=lambda area: area.width * area.height).spaces.active


def _frame_scene(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Place a camera so that it sees all of the scene's objects."""
    corners = _corners(scene)
    if not len(corners):
        corners = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    middle = Vector(0.5 * (corners.min(axis=0) + corners.max(axis=0)))
    radius = max(0.5 * float(np.linalg.norm(np.ptp(corners, axis=0))), 1e-3)
    frame = camera.data.view_frame(scene=scene)
    narrow = min(abs(frame[0].x), abs(frame[0].y)) / abs(frame[0].z)
    distance = _ROOM * radius / math.sin(math.atan(narrow))
    towards = Vector(_VIEW_DIRECTION).normalized()
    turn = towards.to_track_quat("Z", "Y")
    camera.matrix_world = Matrix.Translation(middle + distance * towards) @ turn.to_matrix().to_4x4()
    camera.data.clip_start = min(camera.data.clip_start, 0.01 * distance)
    camera.data.clip_end = max(camera.data.clip_end, 2.0 * (distance + radius))


def _corners(scene: bpy.types.Scene) -> Any:
    """Return the corners of the boxes of what renders, in world space, one a row."""
    points = [item.matrix_world @ Vector(each) for item in rendered_objects(scene) for each in item.bound_box]
    return np.array(points).reshape(-1, 3)


def _middle_distance(context: bpy.types.Context) -> float:
    """Return how far along the optical axis that lies which the picture's middle shows.

    Where it shows nothing, it is the middle of what is before the camera.
    """
    scene = context.scene
    graph = context.evaluated_depsgraph_get()
    camera = evaluated_camera(scene, graph)
    matrix = camera.matrix_world.normalized()
    frame = camera.data.view_frame(scene=scene)
    middle = sum(frame, Vector()) / len(frame)
    if camera.data.type != "PERSP":
        middle = Vector((0.0, 0.0, -1.0))
    direction = (matrix.to_3x3() @ middle).normalized()
    place = matrix.translation
    axis = -matrix.to_3x3().col[2]
    start = place + direction * camera.data.clip_start / max(direction.dot(axis), 1e-6)
    hit, location, *_ = scene.ray_cast(graph, start, direction)
    if hit:
        return max(float(axis.dot(location - place)), camera.data.clip_start)
    depths = (_corners(scene) - np.array(place)) @ np.array(axis)
    before = depths[depths > camera.data.clip_start]
    return float(0.5 * (before.min() + before.max())) if before.size else _FOCUS_OF_NOTHING


def _perspective_camera(context: bpy.types.Context) -> None:
    _set(_camera_data(context.scene), "type", "PERSP")


def _use_cycles(context: bpy.types.Context) -> None:
    if compat.cycles_settings(context.scene) is None:
        raise InputError("This Blender has no Cycles; enable its add-on in the preferences.")
    _set(context.scene.render, "engine", "CYCLES")


def _use_view_layer(context: bpy.types.Context) -> None:
    _set(context.view_layer, "use", True)


def _focus_middle(context: bpy.types.Context) -> None:
    _set(_camera_data(context.scene).dof, "focus_distance", _middle_distance(context))


def _open_aperture(context: bpy.types.Context) -> None:
    """Choose the f-stop at which the farthest is blurred well."""
    scene = context.scene
    dof = _camera_data(scene).dof
    camera = evaluated_camera(scene, context.evaluated_depsgraph_get())
    circle = circle_of_confusion_at_infinity(scene_lens(camera), scene.potmesil_camera.coc_model)
    frame = frame_format(scene, camera.data)
    wanted = frame.fitted_pitch[0] * max(_BLUR_SHARE * max(frame.frame_size), _LEAST_BLUR_PX)
    _set(dof, "aperture_fstop", max(dof.aperture_fstop * circle / wanted, _LOWEST_F_STOP))


def _motion_blur_off(context: bpy.types.Context) -> None:
    _set(context.scene.render, "use_motion_blur", False)


def _camera_blur_off(context: bpy.types.Context) -> None:
    _set(_camera_data(context.scene).dof, "use_dof", False)


def _denoising_off(context: bpy.types.Context) -> None:
    _set(compat.cycles_settings(context.scene), "use_denoising", False)


def _clamping_off(context: bpy.types.Context) -> None:
    cycles = compat.cycles_settings(context.scene)
    for name in ("sample_clamp_direct", "sample_clamp_indirect"):
        # Cycles' own clamping of indirect light hardly touches what the camera sees, and stays.
        if name == "sample_clamp_direct" or getattr(cycles, name) < DEFAULT_CLAMP:
            _set(cycles, name, 0.0)


def _reflections_on(context: bpy.types.Context) -> None:
    _set(context.scene.potmesil_camera, "reflections", "REFLECTIONS")


def _reflections_off(context: bpy.types.Context) -> None:
    _set(context.scene.potmesil_camera, "reflections", "OFF")


def _motion_on(context: bpy.types.Context) -> None:
    _set(context.scene.potmesil_camera, "use_motion", True)


def _stereo_off(context: bpy.types.Context) -> None:
    _set(context.scene.render, "use_multiview", False)


def _region_off(context: bpy.types.Context) -> None:
    _set(context.scene.render, "use_border", False)


def _compositing_on(context: bpy.types.Context) -> None:
    scene = context.scene
    _set(scene.render, "use_compositing", True)
    for owner, name, value in compat.compositor_switches(scene):
        _set(getattr(scene, owner) if owner else scene, name, value)


def _lock_interface(context: bpy.types.Context) -> None:
    _set(context.scene.render, "use_lock_interface", True)


def _samples_beside(context: bpy.types.Context) -> None:
    _set(context.scene.potmesil_camera, "samples_path", DEFAULT_SAMPLES_PATH)


def _number_samples(context: bpy.types.Context) -> None:
    """Put the frame's number before the suffix."""
    template = samples_template(context.scene).replace("\\", "/")
    folder, slash, name = template.rpartition("/")
    path = PurePosixPath(name)
    _set(
        context.scene.potmesil_camera,
        "samples_path",
        f"{folder}{slash}{path.stem}_####{path.suffix or '.exr'}",
    )


def _save_as(context: bpy.types.Context) -> None:
    if bpy.app.background:
        raise InputError("The file was never saved, or cannot be where it is; save it first.")
    bpy.ops.wm.save_as_mainfile("INVOKE_DEFAULT")


def _set_up_passes(context: bpy.types.Context) -> None:
    set_up_passes(context.scene)


WAYS: dict[Fix, _Way] = {
    "add_camera": _Way(
        "Add Camera",
        "Add a camera that sees what the viewport shows, focused on its middle, and make it active",
        _add_camera,
    ),
    "activate_camera": _Way(
        "Make Active", "Render with the selected camera, or the first one by name", _activate_camera
    ),
    "perspective_camera": _Way("Make Perspective", "Make the camera a perspective one", _perspective_camera),
    "use_cycles": _Way("Use Cycles", "Render with Cycles, which gives all passes", _use_cycles),
    "use_view_layer": _Way("Use View Layer", "Use the active view layer for rendering", _use_view_layer),
    "setup_passes": _Way(
        "Set Up Passes",
        "Enable the passes, and give every object a pass index of its own",
        _set_up_passes,
    ),
    "focus_middle": _Way("Focus on Middle", "Focus on what the middle of the picture shows", _focus_middle),
    "open_aperture": _Way(
        "Open Aperture",
        "Lower the f-stop until the farthest is blurred by a hundredth of the picture's longer side",
        _open_aperture,
    ),
    "motion_blur_off": _Way("Turn Off", "Turn the engine's own motion blur off", _motion_blur_off),
    "camera_blur_off": _Way("Turn Off", "Turn the camera's own depth of field off", _camera_blur_off),
    "denoising_off": _Way("Turn Off", "Turn the denoising of renders off", _denoising_off),
    "clamping_off": _Way("Turn Off", "Set the clamping of light to 0, which is off", _clamping_off),
    "reflections_on": _Way(
        "Turn On", "Focus and move what mirrors and glass show apart from their surfaces", _reflections_on
    ),
    "reflections_off": _Way("Turn Off", "Do not look for mirrors and glass", _reflections_off),
    "motion_on": _Way("Turn On", "Turn the motion processor on", _motion_on),
    "stereo_off": _Way("Turn Off", "Render the camera's own view alone", _stereo_off),
    "region_off": _Way("Turn Off", "Render the whole picture", _region_off),
    "compositing_on": _Way("Turn On", "Let renders run the compositor", _compositing_on),
    "lock_interface": _Way(
        "Turn On", "Keep the window from drawing the scene while a render goes on", _lock_interface
    ),
    "samples_beside": _Way("Beside the File", "Keep samples beside the .blend file", _samples_beside),
    "number_samples": _Way("Number Them", "Put the frame's number into the samples path", _number_samples),
    "save_as": _Way("Save As...", "Choose where to save the file", _save_as),
}
"""Every fix there is."""

_ITEMS = [(fix, WAYS[fix].label, WAYS[fix].tooltip) for fix in get_args(Fix)]
