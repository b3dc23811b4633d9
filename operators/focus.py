"""Focus by hand: on an object once, or on an object wherever it goes."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from ..potmesil_addon.errors import InputError
from . import scene as adapter
from .animation import curves_of

_LEAST_DEPTH = 1e-5
"""Nearer than this nothing can be in focus; behind the camera depths are negative."""

_LINKED = n_("The camera is linked from another file; make it local to focus by hand.")
_DRIVEN = n_("A driver sets the focus distance; remove it to focus by hand.")


def scene_camera(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the scene's active camera, None where there is none or something else in its place."""
    camera = scene.camera
    return camera if camera is not None and camera.type == "CAMERA" else None


def is_linked(data: bpy.types.Camera) -> bool:
    """Return whether a camera comes from another file, so that what is written to it is lost."""
    override = data.override_library
    return not data.is_editable or (override is not None and override.is_system_override)


def is_driven(data: bpy.types.Camera) -> bool:
    """Return whether a driver sets a camera's focus distance."""
    return any(curve.driver is not None for curve in curves_of(data.dof, "focus_distance"))


def target_object(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the object to focus on.

    Parameters
    ----------
    context : Context
        Its view layer has the active object and the selection.

    Returns
    -------
    Object or None
        The active object; where that is the scene's camera, as it is beside the camera's own settings,
        the one other object that is selected.
    """
    objects, camera = context.view_layer.objects, context.scene.camera
    if objects.active is None or objects.active != camera:
        return objects.active
    others = [item for item in objects.selected if item != camera]
    return others[0] if len(others) == 1 else None


def set_focus_distance(scene: bpy.types.Scene, distance: float) -> str:
    """Focus the scene's camera at a distance, in place of the object that it tracks.

    Where the distance is animated, Auto Keying inserts a key, as when a number is typed into its field.

    Parameters
    ----------
    scene : Scene
        The scene.
    distance : float
        Along the optical axis in Blender units.

    Returns
    -------
    str
        A sentence for the artist; empty where there is nothing to say.

    Raises
    ------
    InputError
        If the distance cannot be set; nothing is written then.
    """
    data = scene.camera.data
    dof = data.dof
    if is_linked(data):
        raise InputError(_LINKED)
    if is_driven(data):
        raise InputError(_DRIVEN)
    before, tracked = dof.focus_distance, dof.focus_object
    dof.focus_distance = distance
    keyed = any(True for _ in curves_of(dof, "focus_distance"))
    auto_keyed = keyed and scene.tool_settings.use_keyframe_insert_auto
    if auto_keyed and not _insert_key(scene, dof):
        dof.focus_distance = before
        raise InputError("The focus distance takes no key; unlock its curve or turn Auto Keying off.")
    if tracked is not None:
        dof.focus_object = None
        dof.focus_subtarget = ""
        return rpt_("{name} is no longer tracked.").format(name=tracked.name)
    if keyed and not auto_keyed:
        return n_("The focus distance is animated: insert a key to keep it.")
    return ""


def _insert_key(scene: bpy.types.Scene, dof: bpy.types.CameraDOFSettings) -> bool:
    """Key the focus distance as Auto Keying is set up; return whether it took the key."""
    tools = scene.tool_settings
    options = set()
    if tools.auto_keying_mode == "REPLACE_KEYS":
        options.add("INSERTKEY_REPLACE")
    if tools.use_keyframe_cycle_aware:
        options.add("INSERTKEY_CYCLE_AWARE")
    try:
        done = dof.keyframe_insert("focus_distance", options=options, keytype=tools.keyframe_type)
    except RuntimeError:  # how Blender says that a curve or an action takes no keys
        return False
    # Auto Keying that only replaces keys has nothing to do where there is none.
    return done or bool(options & {"INSERTKEY_REPLACE"})


def _bone(item: bpy.types.Object) -> bpy.types.PoseBone | None:
    """Return the bone that the artist poses, by which an armature is meant in Pose Mode."""
    if item.type != "ARMATURE" or item.mode != "POSE" or item.data.bones.active is None:
        return None
    return item.pose.bones.get(item.data.bones.active.name)


def _origin(item: bpy.types.Object) -> Vector:
    """Return the place in the world that Blender focuses on when it tracks an object."""
    bone = _bone(item)
    return (item.matrix_world @ bone.matrix if bone is not None else item.matrix_world).translation


def surface_point(item: bpy.types.Object, eye: Vector) -> Vector | None:
    """Return the place where an eye that looks at an object's origin sees its surface.

    Parameters
    ----------
    item : Object
        An evaluated object.
    eye : Vector
        In the world.

    Returns
    -------
    Vector or None
        In the world; where the line to the origin misses the object, as through a ring, what of the
        surface is nearest. ``None`` for an object without a surface.
    """
    try:
        mesh = item.to_mesh()
    except RuntimeError:  # lights, empties and the like
        return None
    try:
        if mesh is None or not mesh.polygons:
            return None
        mesh.calc_loop_triangles()
        corners = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
        mesh.vertices.foreach_get("co", corners)
        triangles = np.empty(len(mesh.loop_triangles) * 3, dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", triangles)
    finally:
        item.to_mesh_clear()
    matrix = np.array(item.matrix_world, dtype=np.float64)
    world = corners.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    tree = BVHTree.FromPolygons(world.tolist(), triangles.reshape(-1, 3).tolist(), all_triangles=True)
    direction = item.matrix_world.translation - eye
    seen = tree.ray_cast(eye, direction)[0] if direction.length > 0.0 else None
    return seen if seen is not None else tree.find_nearest(eye)[0]


def depth_of(camera: bpy.types.Object, place: Vector) -> float:
    """Return how far a place lies before a camera along its optical axis, in Blender units.

    Parameters
    ----------
    camera : Object
        An evaluated camera object. Its scale does not count, as in Cycles.
    place : Vector
        In the world.

    Returns
    -------
    float
        Negative behind the camera.
    """
    matrix: Matrix = camera.matrix_world
    axis = matrix.to_3x3().col[2].normalized()
    return float(axis.dot(matrix.translation - place))


class _FocusOperator:
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """There must be a camera, and something else to focus on."""
        if scene_camera(context.scene) is None:
            cls.poll_message_set(tip_("The scene has no camera"))
            return False
        if target_object(context) is not None:
            return True
        if context.view_layer.objects.active is None:
            cls.poll_message_set(tip_("There is no active object"))
        else:
            cls.poll_message_set(
                tip_("The active object is the camera itself; select one other object with it")
            )
        return False


class POTMESIL_OT_focus_on_active(_FocusOperator, bpy.types.Operator):
    """Set the focus distance of the scene's camera to the active object, where it is now"""

    bl_idname = "potmesil.focus_on_active"
    bl_label = "Focus on Active Object"
    bl_options = {"REGISTER", "UNDO"}

    target: bpy.props.EnumProperty(
        name="Focus On",
        description="What of the object is in focus",
        items=(
            ("ORIGIN", "Origin", "The object's origin, or the active bone in Pose Mode"),
            (
                "SURFACE",
                "Nearest Surface",
                "The first of its surface on the line from the camera to its origin, or, where that misses "
                "it, the nearest",
            ),
        ),
        default="ORIGIN",
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Measure the depth along the optical axis and set the distance."""
        scene = context.scene
        item = target_object(context)
        try:
            depsgraph = context.evaluated_depsgraph_get()
            camera = adapter.evaluated_camera(scene, depsgraph)
            evaluated = item.evaluated_get(depsgraph)
            place = None
            if self.target == "SURFACE":
                place = surface_point(evaluated, camera.matrix_world.translation)
            distance = depth_of(camera, _origin(evaluated) if place is None else place)
            if distance < _LEAST_DEPTH:
                raise InputError(rpt_("{name} is not before the camera.").format(name=item.name))
            said = set_focus_distance(scene, distance)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if self.target == "SURFACE" and place is None:
            said = said or rpt_("{name} has no surface; its origin is in focus.").format(name=item.name)
        text = rpt_("Focused on {name} at {distance}")
        length = adapter.as_length(scene, distance)
        self.report({"INFO"}, said or text.format(name=item.name, distance=length))
        return {"FINISHED"}


class POTMESIL_OT_track_object(_FocusOperator, bpy.types.Operator):
    """Keep the active object, or the active bone in Pose Mode, in focus wherever it goes"""

    bl_idname = "potmesil.track_object"
    bl_label = "Track Active Object"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make the object Blender's own focus object."""
        item = target_object(context)
        data = context.scene.camera.data
        if is_linked(data):
            self.report({"ERROR"}, _LINKED)
            return {"CANCELLED"}
        bone = _bone(item)
        data.dof.focus_object = item
        data.dof.focus_subtarget = "" if bone is None else bone.name
        return {"FINISHED"}


class POTMESIL_OT_stop_tracking(bpy.types.Operator):
    """Leave the focus at the distance where the tracked object is now"""

    bl_idname = "potmesil.stop_tracking"
    bl_label = "Stop Tracking"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """There must be something that is tracked."""
        camera = scene_camera(context.scene)
        if camera is None:
            cls.poll_message_set(tip_("The scene has no camera"))
            return False
        if camera.data.dof.focus_object is None:
            cls.poll_message_set(tip_("The camera tracks no object"))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Take the distance over, and let go of the object."""
        scene = context.scene
        try:
            camera = adapter.evaluated_camera(scene, context.evaluated_depsgraph_get())
            said = set_focus_distance(scene, adapter.focus_distance(camera))
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, said)
        return {"FINISHED"}


CLASSES = (POTMESIL_OT_focus_on_active, POTMESIL_OT_track_object, POTMESIL_OT_stop_tracking)
