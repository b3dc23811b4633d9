"""Focus in the 3D viewport: the limits of what appears sharp as planes, a handle, a tab in the sidebar."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import blf
import bpy
import gpu
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

from ..operators import focus
from ..operators import scene as adapter
from ..potmesil_addon.errors import PotmesilError
from ..potmesil_addon.lens import depth_of_field
from . import draw

NEAR_COLOR = (1.0, 0.45, 0.1)
FOCUS_COLOR = (0.2, 0.9, 0.4)
FAR_COLOR = (0.2, 0.5, 1.0)

_FILL, _LINE, _HIDDEN_LINE = 0.12, 0.9, 0.25
"""Opacity of a plane, of its outline, and of its outline behind things."""

_LINE_WIDTH = 1.5
_LABEL_GAP = 6
"""Pixels between a plane's corner and its label at the standard interface scale."""

_CORNERS = ((0.5, 0.5, 0.0), (-0.5, 0.5, 0.0), (-0.5, -0.5, 0.0), (0.5, -0.5, 0.0))


@dataclass(frozen=True)
class Plane:
    """What lies at one depth before the camera and is in its picture.

    Parameters
    ----------
    name : str
        What the plane stands for.
    depth : float
        Distance along the optical axis in Blender units.
    color : tuple of float
        Red, green and blue.
    matrix : Matrix
        From the square of side 1 around the origin, in x and y, to the world.
    """

    name: str
    depth: float
    color: tuple[float, float, float]
    matrix: Matrix

    @property
    def corners(self) -> list[Vector]:
        """Upper right, upper left, lower left and lower right corner in the world."""
        return [self.matrix @ Vector(corner) for corner in _CORNERS]


def planes(scene: bpy.types.Scene, camera: bpy.types.Object) -> list[Plane]:
    """Return the near limit, the plane in focus and the far limit of a camera.

    A far limit at infinity has no plane: at any depth, the end of clipping too, it would show a limit
    where there is none.

    Parameters
    ----------
    scene : Scene
        Its resolution decides the shape.
    camera : Object
        An evaluated perspective camera.

    Returns
    -------
    list of Plane
        From near to far; none where the camera has no valid lens.
    """
    try:
        lens = adapter.scene_lens(camera)
        sharp = depth_of_field(lens)
    except PotmesilError:
        return []
    frame = adapter.frame_format(scene, camera.data)
    columns, rows = frame.frame_size
    pitch_x, pitch_y = frame.fitted_pitch
    axis_x, axis_y = frame.shift
    # Cycles takes no notice of a camera's scale.
    to_world = camera.matrix_world.normalized()
    found = []
    for name, depth, color in (
        (n_("Near Limit"), sharp.near, NEAR_COLOR),
        (n_("Focus"), lens.focus_distance, FOCUS_COLOR),
        (n_("Far Limit"), sharp.far, FAR_COLOR),
    ):
        if depth == float("inf"):
            continue
        scale = depth / lens.focal_length
        place = Matrix.Translation((-axis_x * scale, -axis_y * scale, -depth))
        size = Matrix.Diagonal((columns * pitch_x * scale, rows * pitch_y * scale, 1.0, 1.0))
        found.append(Plane(name, depth, color, to_world @ place @ size))
    return found


def shown_camera(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the evaluated camera whose planes a 3D viewport shows, None where it shows none.

    Through the camera itself there is nothing to see: each plane would lie over the whole picture.
    """
    scene, space, view = context.scene, context.space_data, context.region_data
    camera = focus.scene_camera(scene)
    if camera is None or not scene.potmesil_camera.show_limits or camera.data.type != "PERSP":
        return None
    if view is None or not space.overlay.show_overlays:
        return None
    if view.view_perspective == "CAMERA" and space.camera == camera:
        return None
    # It is up to date whenever something is drawn, and drawing must not evaluate.
    depsgraph = context.view_layer.depsgraph
    return None if depsgraph is None else camera.evaluated_get(depsgraph)


_shapes: dict[str, Any] = {}
"""The square and its outline: made once, as a plane is the same square under another matrix."""

_handlers: list[Any] = []


def _shape(kind: str) -> tuple[Any, Any]:
    """Return shader and batch of the square ("fill") or of its outline ("line")."""
    if kind not in _shapes:
        if kind == "fill":
            shader = gpu.shader.from_builtin("UNIFORM_COLOR")
            corners = [_CORNERS[number] for number in (0, 1, 3, 2)]
            batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners})
        else:
            shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
            batch = batch_for_shader(shader, "LINE_STRIP", {"pos": [*_CORNERS, _CORNERS[0]]})
        _shapes[kind] = shader, batch
    found: tuple[Any, Any] = _shapes[kind]
    return found


@contextmanager
def _blended() -> Iterator[None]:
    """Draw translucently, and leave the state of the graphics card as it was."""
    state = gpu.state
    blend, test, mask = state.blend_get(), state.depth_test_get(), state.depth_mask_get()
    state.blend_set("ALPHA")
    state.depth_mask_set(False)
    try:
        yield
    finally:
        state.blend_set(blend)
        state.depth_test_set(test)
        state.depth_mask_set(mask)


def _draw_planes() -> None:
    context = bpy.context
    camera = shown_camera(context)
    if camera is None:
        return
    view, region = context.region_data, context.region
    line_width = _LINE_WIDTH * context.preferences.system.ui_scale
    with _blended():
        for plane in _back_to_front(planes(context.scene, camera), camera, view):
            with gpu.matrix.push_pop():
                gpu.matrix.multiply_matrix(plane.matrix)
                shader, batch = _shape("fill")
                gpu.state.depth_test_set("LESS_EQUAL")
                shader.uniform_float("color", (*plane.color, _FILL))
                batch.draw(shader)
                shader, batch = _shape("line")
                shader.bind()
                shader.uniform_float("viewportSize", (region.width, region.height))
                shader.uniform_float("lineWidth", line_width)
                for test, opacity in (("NONE", _HIDDEN_LINE), ("LESS_EQUAL", _LINE)):
                    gpu.state.depth_test_set(test)
                    shader.uniform_float("color", (*plane.color, opacity))
                    batch.draw(shader)


def _back_to_front(found: list[Plane], camera: bpy.types.Object, view: bpy.types.RegionView3D) -> list[Plane]:
    """Return planes in the order in which they cover each other."""
    to_view = view.view_matrix.inverted()
    if view.is_perspective:
        eye = focus.depth_of(camera, to_view.translation)
    else:
        # From far away on the side from which it looks.
        away = camera.matrix_world.to_3x3().col[2].dot(to_view.to_3x3().col[2])
        eye = -float("inf") if away > 0.0 else float("inf")
    if abs(eye) == float("inf"):
        return sorted(found, key=lambda plane: plane.depth, reverse=eye < 0.0)
    return sorted(found, key=lambda plane: abs(plane.depth - eye), reverse=True)


def _draw_labels() -> None:
    context = bpy.context
    camera = shown_camera(context)
    if camera is None:
        return
    scale = context.preferences.system.ui_scale
    font, size = 0, context.preferences.ui_styles[0].widget.points * scale
    blf.size(font, size)
    blf.enable(font, blf.SHADOW)
    blf.shadow(font, 3, 0.0, 0.0, 0.0, 0.8)
    blf.shadow_offset(font, 0, 0)
    taken: list[tuple[float, float, float]] = []
    for plane in planes(context.scene, camera):
        place = _label_place(context, plane)
        if place is None:
            continue
        text = f"{iface_(plane.name)} {adapter.as_length(context.scene, plane.depth)}"
        left, bottom = place[0], place[1] + _LABEL_GAP * scale
        right, height = left + blf.dimensions(font, text)[0], 1.3 * size
        # Planes that lie close together have their labels one above the other.
        while any(left < r and right > a and abs(bottom - b) < height for a, r, b in taken):
            bottom += 0.5 * height
        taken.append((left, right, bottom))
        blf.position(font, left, bottom, 0.0)
        blf.color(font, *plane.color, 1.0)
        blf.draw(font, text)
    blf.disable(font, blf.SHADOW)


def _label_place(context: bpy.types.Context, plane: Plane) -> Vector | None:
    """Return the plane's corner that is highest in the region, None where no corner is in sight."""
    region = context.region
    places = [location_3d_to_region_2d(region, context.region_data, corner) for corner in plane.corners]
    seen = [
        place
        for place in places
        if place is not None and 0.0 <= place[0] < region.width and 0.0 <= place[1] < region.height
    ]
    return max(seen, key=lambda place: place[1], default=None)


class POTMESIL_GGT_focus(bpy.types.GizmoGroup):
    """The handle at the plane in focus; where an object or a driver decides the distance there is none."""

    bl_idname = "POTMESIL_GGT_focus"
    bl_label = "Focus Plane"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    # Not hidden by things: the plane in focus often lies inside of one.
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show where the planes are shown and the distance can be set by hand."""
        space = context.space_data
        if not space.show_gizmo_context or shown_camera(context) is None:
            return False
        data = context.scene.camera.data
        return data.dof.focus_object is None and not focus.is_linked(data) and not focus.is_driven(data)

    def setup(self, context: bpy.types.Context) -> None:
        """Make the handle."""
        handle = self.gizmos.new("GIZMO_GT_arrow_3d")
        handle.draw_style = "BOX"
        handle.draw_options = {"STEM"}
        handle.length = 0.8
        handle.use_undo = True
        handle.use_draw_modal = True
        handle.line_width = 2.0
        handle.color = FOCUS_COLOR
        handle.alpha = 1.0
        handle.color_highlight = tuple(0.5 + 0.5 * value for value in FOCUS_COLOR)
        handle.alpha_highlight = 1.0
        self.handle = handle
        self._place(context)

    def refresh(self, context: bpy.types.Context) -> None:
        """Follow what changed."""
        self._place(context)

    def draw_prepare(self, context: bpy.types.Context) -> None:
        """Follow what moved: with the frame, the camera may be another and the distance too."""
        self._place(context)

    def _place(self, context: bpy.types.Context) -> None:
        camera = shown_camera(context)
        if camera is None or self.handle.is_modal:
            return
        matrix = camera.matrix_world.normalized()
        # The arrow points along z, and the camera looks along -z.
        self.handle.matrix_basis = matrix @ Matrix.Diagonal((1.0, -1.0, -1.0, 1.0))
        # As the field in the panel: with its limits, undo, tooltip and Auto Keying.
        self.handle.target_set_prop("offset", context.scene.camera.data.dof, "focus_distance")


class POTMESIL_PT_viewport(bpy.types.Panel):
    """Focus beside the scene."""

    bl_label = "Potmesil Camera"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Potmesil"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, focus and lens of the scene's camera, what focuses it, and the limits."""
        layout = self.layout
        draw.buttons(layout, context)
        camera = focus.scene_camera(context.scene)
        if camera is None:
            layout.label(text="The Scene Has No Camera", icon="INFO")
            return
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.active = context.scene.potmesil_camera.use_lens
        draw.lens(column, camera.data)
        draw_focus_tools(column, context)
        draw.limits(column, context, camera)


def draw_focus_tools(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what focuses the scene's camera on an object, and the switch of the planes.

    Parameters
    ----------
    layout : UILayout
        Where.
    context : Context
        In the Properties editor for a camera; the buttons are off where it is not the scene's.
    """
    camera = focus.scene_camera(context.scene)
    shown = getattr(context, "camera", None)
    here = camera is not None and shown in (None, camera.data)
    column = layout.column(align=True)
    column.enabled = here
    column.operator("potmesil.focus_on_active", icon="OBJECT_DATA")
    if here and camera.data.dof.focus_object is not None:
        row = column.row(align=True)
        row.operator("potmesil.track_object", icon="CON_TRACKTO")
        row.operator("potmesil.stop_tracking", text="", icon="X")
    else:
        column.operator("potmesil.track_object", icon="CON_TRACKTO")
        view = getattr(context.space_data, "region_3d", None)
        if view is not None and view.view_perspective == "CAMERA":
            # Blender's own, which measures in this view only.
            pick = column.operator("ui.eyedropper_depth", icon="EYEDROPPER")
            pick.prop_data_path = "scene.camera.data.dof.focus_distance"
    layout.prop(context.scene.potmesil_camera, "show_limits")


CLASSES = (POTMESIL_GGT_focus, POTMESIL_PT_viewport)


def register() -> None:
    """Draw in every 3D viewport from now on."""
    space = bpy.types.SpaceView3D
    _handlers.append(space.draw_handler_add(_draw_planes, (), "WINDOW", "POST_VIEW"))
    _handlers.append(space.draw_handler_add(_draw_labels, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """Draw no more, and let go of what the graphics card holds."""
    while _handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
    _shapes.clear()
