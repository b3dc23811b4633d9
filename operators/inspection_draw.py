"""What Inspect Focus draws over the result: only with Blender's own shaders, in pixels of the region."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import blf
import bpy
import gpu
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..potmesil_addon.inspection import COLORS, ZONES
from .result import RESULT_NAME
from .scene import as_length

if TYPE_CHECKING:
    from ..potmesil_addon.inspection import Reading
    from ..potmesil_addon.samples import Float32Array
    from .inspection import Session

FLAGS = ("inspect_overlay", "inspect_readout", "inspect_psf", "inspect_compare", "split")
"""Properties of the state that decide what is drawn."""

ZONE_NAMES = {"near": n_("Near"), "sharp": n_("Sharp"), "far": n_("Far")}

_FONT = 0
_TEXT_SIZE = 12.0
_LINE = 1.5
"""Height of a line of text over its size."""

_BOX = (0.0, 0.0, 0.0, 0.8)
_WHITE = (1.0, 1.0, 1.0, 1.0)
_PSF_SIDE = 112.0
_BESIDE = 18.0
"""Distance of the read-out from the mouse."""

_PIXEL_AT = 0.5 if bpy.app.version >= (5, 2, 0) else 0.0
"""Where in a pixel of the screen it is that Blender's own transform says of what the image shows there."""

_MARGIN = 10.0
_KNOB = 7.0


@dataclass(frozen=True, slots=True)
class Frame:
    """Where a region shows an image: left and lower edge, width and height, in pixels of the region."""

    left: float
    bottom: float
    width: float
    height: float

    @classmethod
    def of(cls, region: bpy.types.Region, space: Any) -> Frame:
        """Return where an Image Editor's region shows its image."""
        columns, rows = space.image.size
        width, height = space.zoom[0] * columns, space.zoom[1] * rows
        u, v = region.view2d.region_to_view(0.0, 0.0)
        return cls(_PIXEL_AT - u * width, _PIXEL_AT - v * height, width, height)

    def x(self, u: float) -> float:
        """Return the column at which a place from 0 to 1 is."""
        return self.left + u * self.width

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Return which place of the image, from 0 to 1, is at a place of the region."""
        return (x - self.left) / self.width, (y - self.bottom) / self.height


def canvases(window: bpy.types.Window) -> Iterator[tuple[bpy.types.Area, bpy.types.Region]]:
    """Yield the Image Editors of a window that show the result, each with its main region."""
    for area in window.screen.areas:
        if area.type == "IMAGE_EDITOR" and getattr(area.spaces.active.image, "name", "") == RESULT_NAME:
            for region in area.regions:
                if region.type == "WINDOW":
                    yield area, region


class Painter:
    """Draws what a session has worked out, as long as it is not closed.

    Parameters
    ----------
    session : Session
        What there is to draw.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._textures: dict[str, tuple[Any, Any]] = {}
        self._handle: Any = bpy.types.SpaceImageEditor.draw_handler_add(
            self._draw, (), "WINDOW", "POST_PIXEL"
        )

    def close(self) -> None:
        """Draw no more, and free what was on the graphics card."""
        if self._handle is not None:
            bpy.types.SpaceImageEditor.draw_handler_remove(self._handle, "WINDOW")
        self._handle = None
        self._textures.clear()

    def _draw(self) -> None:
        """Draw into the region that Blender is drawing."""
        context, session = bpy.context, self._session
        region, space = context.region, context.space_data
        image = getattr(space, "image", None)
        if image is None or image.name != RESULT_NAME or session.view is None or 0 in image.size:
            return
        state, frame = context.window_manager.potmesil_camera, Frame.of(region, space)
        gpu.state.blend_set("ALPHA")
        comparing = state.inspect_compare and session.before is not None
        if comparing:
            self._before(frame, region, space, state.split)
        if session.settings is not None:
            if state.inspect_overlay and session.overlay is not None:
                self._texture("overlay", session.overlay, frame)
        if comparing:
            _line(frame, region, state.split)
        if session.settings is not None and session.cursor is not None:
            found = session.reading() if session.cursor.region == region.as_pointer() else None
            if found is not None and state.inspect_psf and session.point is not None:
                self._point(session.point, session.point_width)
            if found is not None and state.inspect_readout and not session.dragging:
                _readout(context.scene, region, found, session.cursor.x, session.cursor.y)
        gpu.state.blend_set("NONE")

    def _before(self, frame: Frame, region: bpy.types.Region, space: Any, split: float) -> None:
        """Draw the render before the lens to the left of the line."""
        before = self._session.before
        assert before is not None
        left, right = max(0.0, frame.left), min(float(region.width), frame.x(split))
        bottom, top = max(0.0, frame.bottom), min(float(region.height), frame.bottom + frame.height)
        if right <= left or top <= bottom:
            return
        # It hides the result, and what is clear in it shows what Blender shows behind clear images.
        if space.display_channels == "COLOR_ALPHA" and not _is_opaque(before):
            _checker(left, bottom, right, top)
        else:
            _fill(left, bottom, right, top, (0.0, 0.0, 0.0, 1.0))
        self._texture("before", before, frame, split)

    def _point(self, picture: Float32Array, width: float) -> None:
        """Draw the point-spread function into the lower left corner, with its width below it."""
        scale = _scale()
        margin, side, line = _MARGIN * scale, _PSF_SIDE * scale, _LINE * _TEXT_SIZE * scale
        _fill(margin, margin, 2.0 * margin + side, 2.0 * margin + side + line, _BOX)
        frame = Frame(1.5 * margin, 1.5 * margin + line, side, side)
        _fill(frame.left, frame.bottom, frame.left + side, frame.bottom + side, (0.0, 0.0, 0.0, 1.0))
        self._texture("point", picture, frame)
        _text(1.5 * margin, 1.8 * margin, iface_("{width:.3g} px wide").format(width=width), _WHITE)

    def _texture(self, name: str, picture: Float32Array, frame: Frame, share: float = 1.0) -> None:
        """Draw a picture's left share over a frame, each of its pixels a rectangle."""
        kept = self._textures.get(name)
        if kept is None or kept[0] is not picture:
            rows, columns = picture.shape[:2]
            flat = np.ascontiguousarray(picture[::-1]).reshape(-1)
            data = gpu.types.Buffer("FLOAT", flat.size, flat)
            texture = gpu.types.GPUTexture((columns, rows), format="RGBA8", data=data)
            # Before Blender 5.1 pixels run into each other where they are drawn larger.
            if hasattr(texture, "filter_mode"):
                texture.filter_mode(False)
            kept = picture, texture
            self._textures[name] = kept
        shader = gpu.shader.from_builtin("IMAGE")
        right, top = frame.x(share), frame.bottom + frame.height
        corners = ((frame.left, frame.bottom), (right, frame.bottom), (right, top), (frame.left, top))
        uv = ((0.0, 0.0), (share, 0.0), (share, 1.0), (0.0, 1.0))
        batch = batch_for_shader(shader, "TRI_FAN", {"pos": corners, "texCoord": uv})
        with _exact_pixels():
            shader.bind()
            shader.uniform_sampler("image", kept[1])
            batch.draw(shader)


@contextlib.contextmanager
def _exact_pixels() -> Iterator[None]:
    """Draw where coordinates say: Blender's own matrix moves all by three eighths of a pixel."""
    region = bpy.context.region
    x, y = 2.0 / region.width, 2.0 / region.height
    rows = ((x, 0.0, 0.0, -1.0), (0.0, y, 0.0, -1.0), (0.0, 0.0, -1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    with gpu.matrix.push_pop_projection():
        gpu.matrix.load_projection_matrix(Matrix(rows))
        yield


def _scale() -> float:
    return float(bpy.context.preferences.system.ui_scale)


def _is_opaque(picture: Float32Array) -> bool:
    return bool(picture[..., 3].min() >= 1.0)


def _triangles(corners: Any, color: tuple[float, ...], kind: str = "TRI_FAN") -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, kind, {"pos": corners})
    shader.bind()
    shader.uniform_float("color", color)
    batch.draw(shader)


def _fill(left: float, bottom: float, right: float, top: float, color: tuple[float, ...]) -> None:
    _triangles(((left, bottom), (right, bottom), (right, top), (left, top)), color)


def _checker(left: float, bottom: float, right: float, top: float) -> None:
    """Draw the squares that Blender draws behind clear images, from the region's corner on."""
    theme = bpy.context.preferences.themes[0].user_interface
    size = float(theme.transparent_checker_size)
    _fill(left, bottom, right, top, (*theme.transparent_checker_secondary[:3], 1.0))
    i, j = np.meshgrid(
        np.arange(int(left // size), int(right // size) + 1),
        np.arange(int(bottom // size), int(top // size) + 1),
    )
    even = (i + j) % 2 == 0
    x0, y0 = np.clip(i[even] * size, left, right), np.clip(j[even] * size, bottom, top)
    x1, y1 = np.clip((i[even] + 1) * size, left, right), np.clip((j[even] + 1) * size, bottom, top)
    corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y0, x1, y1, x0, y1], axis=-1)
    primary = (*theme.transparent_checker_primary[:3], 1.0)
    _triangles(corners.reshape(-1, 2).astype(np.float32), primary, "TRIS")


def _line(frame: Frame, region: bpy.types.Region, split: float) -> None:
    """Draw the line between before and after, with the knob to take it by and the two words."""
    scale, x = _scale(), frame.x(split)
    bottom, top = max(0.0, frame.bottom), min(float(region.height), frame.bottom + frame.height)
    if not 0.0 <= x <= region.width or top <= bottom:
        return
    for half, color in ((2.0, (0.0, 0.0, 0.0, 0.6)), (1.0, _WHITE)):
        _fill(x - half * scale, bottom, x + half * scale, top, color)
    middle = 0.5 * (bottom + top)
    for radius, color in ((_KNOB + 1.5, (0.0, 0.0, 0.0, 0.6)), (_KNOB, _WHITE)):
        r = radius * scale
        _triangles(((x - r, middle), (x, middle - r), (x + r, middle), (x, middle + r)), color)
    gap, y = _MARGIN * scale, bottom + 2.0 * _MARGIN * scale
    before = iface_("Before")
    width = blf.dimensions(_FONT, before)[0] if _sized() else 0.0
    for text, left in ((before, x - gap - width), (iface_("After"), x + gap)):
        _label(left, y, text)


def _sized() -> bool:
    """Make the font as large as ours."""
    blf.size(_FONT, _TEXT_SIZE * _scale())
    return True


def _label(x: float, y: float, text: str) -> None:
    """Draw a word with a box behind it."""
    _sized()
    width, height = blf.dimensions(_FONT, text)
    pad = 0.4 * _MARGIN * _scale()
    _fill(x - pad, y - pad, x + width + pad, y + height + pad, _BOX)
    _text(x, y, text, _WHITE)


def _text(x: float, y: float, text: str, color: tuple[float, ...]) -> None:
    _sized()
    blf.color(_FONT, *color)
    blf.position(_FONT, x, y, 0.0)
    blf.draw(_FONT, text)


def lines_of(scene: bpy.types.Scene, found: Reading) -> list[str]:
    """Return the lines of the read-out.

    Parameters
    ----------
    scene : Scene
        Its units.
    found : Reading
        What is under the mouse.

    Returns
    -------
    list of str
        Where it lies, its distance, and its circle of confusion in pixels and on the film.
    """
    return [
        iface_(ZONE_NAMES[found.zone]),
        as_length(scene, found.depth),
        f"{abs(found.circle_px):.3g} px",
        f"{abs(found.circle) * 1000.0:.3g} mm",
    ]


def _readout(scene: bpy.types.Scene, region: bpy.types.Region, found: Reading, x: float, y: float) -> None:
    """Draw the lines of the read-out beside the mouse, where there is room for them."""
    scale, lines = _scale(), lines_of(scene, found)
    _sized()
    pad, line = 0.6 * _MARGIN * scale, _LINE * _TEXT_SIZE * scale
    width = max(blf.dimensions(_FONT, text)[0] for text in lines) + 2.0 * pad
    height = line * len(lines) + pad
    left, top = x + _BESIDE * scale, y - 0.5 * _BESIDE * scale
    if left + width > region.width:
        left = x - _BESIDE * scale - width
    if top - height < 0.0:
        top = y + 0.5 * _BESIDE * scale + height
    _fill(left, top - height, left + width, top, _BOX)
    for number, text in enumerate(lines):
        color = (*COLORS[ZONES.index(found.zone)], 1.0) if number == 0 else _WHITE
        _text(left + pad, top - line * (number + 1) + 0.2 * line, text, color)
