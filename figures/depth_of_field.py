"""Depth of field as the papers print it and show it, and as pictures have it (TOG 1982, section 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy import ndimage

from potmesil_addon.camera import Film
from potmesil_addon.focus import average_down
from potmesil_addon.lens import (
    DEFAULT_CRITERION,
    CocModel,
    DepthOfField,
    FloatArray,
    Lens,
    depth_of_field,
    hyperfocal_distance,
    image_distance,
)
from potmesil_addon.process import ProcessSettings
from potmesil_addon.psf import PsfKind, PsfSettings
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window

from .sheet import COLORS, STYLE, displayed, markdown_table, write_plot, write_sheet
from .workshop import Drawing, Figure, Picture, Workshop, processed

if TYPE_CHECKING:
    import bpy

FOCAL_LENGTH: Final = 0.055
PICTURE_SIDE: Final = 512
SUPERSAMPLING: Final = 2
TABLE_STEP: Final = 0.001
"""The papers' distance between tables of point-spread functions in metres."""


@dataclass(frozen=True, slots=True)
class Printed:
    """A row of Table 1 as it is printed, in millimetres."""

    figure: str
    f_stop: float
    focus: int
    far: int
    near: int
    total: int

    @property
    def lens(self) -> Lens:
        """The lens of the row."""
        return Lens(FOCAL_LENGTH, self.f_stop, self.focus / 1000.0)


TABLE_1: Final = (
    Printed("12a", 5.6, 2000, 2511, 1662, 849),
    Printed("12b", 5.6, 980, 1089, 891, 198),
    Printed("12c", 5.6, 550, 583, 521, 62),
    Printed("12d", 5.6, 290, 299, 282, 17),
    Printed("13a", 11, 2000, 3333, 1429, 1904),
    Printed("13b", 11, 980, 1219, 819, 400),
    Printed("13c", 11, 550, 618, 495, 123),
    Printed("13d", 11, 290, 308, 274, 34),
    Printed("14a", 22, 2000, 10000, 1111, 8889),
    Printed("14b", 22, 980, 1612, 704, 908),
    Printed("14c", 22, 550, 705, 451, 254),
    Printed("14d", 22, 290, 328, 260, 68),
)

OBJECTS: Final = ("cube", "sphere", "background")
"""What the scene shows, in the order of their object indices from 1 on."""


def as_the_papers(row: Printed, kind: PsfKind = "lommel", model: CocModel = "paper") -> ProcessSettings:
    """Return how the papers process a picture of Table 1.

    Parameters
    ----------
    row : Printed
        Lens and focus.
    kind : {"lommel", "disc"}
        The papers' diffraction pattern, or the disc that it is in geometrical optics.
    model : {"paper", "cycles"}
        How out-of-focus points are imaged.

    Returns
    -------
    ProcessSettings
        Tables 1 mm of depth apart, of which each sample takes the nearest (TOG 1982, section 4), and the
        light of all samples added, whatever hides them (eq. 22).
    """
    lens = LensAttributes(
        focal_length=FOCAL_LENGTH, f_stop=row.f_stop, focus_distance=row.lens.focus_distance
    )
    psf = PsfSettings(kind=kind, tables="equal-z", lookup="nearest", step=TABLE_STEP)
    return ProcessSettings(use_motion=False, lens=lens, model=model, psf=psf, visibility="none")


# Figures 11 to 14.


def corner_samples(samples: Samples) -> Samples:
    """Return samples at pixel centres as the corners of the pixels between them (TOG 1982, section 4).

    Parameters
    ----------
    samples : Samples
        Of n + 1 columns and rows, a pixel more than the film has, each way.

    Returns
    -------
    Samples
        The same samples on a picture of n columns and rows, which are averaged by 2 each way. Its film is
        smaller by half a pixel on every side.
    """
    columns, rows = samples.display_window.columns - 1, samples.display_window.rows - 1
    film = samples.film
    assert film is not None
    smaller = Film(film.pitch_x * columns, film.pitch_y * rows, columns, rows)
    camera = samples.camera
    if camera is not None:
        camera = replace(camera, film=smaller, axis_x=camera.axis_x - 0.5, axis_y=camera.axis_y - 0.5)
    return replace(
        samples,
        data_window=Window(0, 0, columns + 1, rows + 1),
        display_window=Window(0, 0, columns, rows),
        position="corner",
        supersampling=SUPERSAMPLING,
        pixel_filter=None,
        film=smaller,
        camera=camera,
    )


def picture_side(workshop: Workshop) -> int:
    """Return the rows and columns of the pictures: 512 at full size, always even."""
    return 2 * workshop.pixels(PICTURE_SIDE // 2)


def rendered_corners(workshop: Workshop) -> Samples:
    """Return corner samples of the cube and the sphere: 1025 x 1025 at full size.

    Parameters
    ----------
    workshop : Workshop
        Says how large.

    Returns
    -------
    Samples
        For pictures of `picture_side`.
    """
    pixels = SUPERSAMPLING * picture_side(workshop)

    def prepare(scene: bpy.types.Scene) -> None:
        render, camera = scene.render, scene.camera.data
        render.resolution_x = render.resolution_y = pixels + 1
        render.resolution_percentage = 100
        camera.sensor_width = camera.sensor_height = camera.sensor_width * (pixels + 1) / pixels
        # Points in place of areas; the scene has no noise that more than one could average.
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 0.01
        scene.cycles.samples = 1
        scene.potmesil_camera.sampling = "PIXELS"
        # The papers' samples end where the picture does.
        scene.potmesil_camera.use_overscan = False

    return corner_samples(workshop.rendered("tog_11_14", "cube_and_sphere", prepare=prepare))


def object_masks(samples: Samples) -> dict[str, npt.NDArray[np.bool_]]:
    """Return where each object fills the picture, a margin away from the others.

    Parameters
    ----------
    samples : Samples
        Corner samples of the scene.

    Returns
    -------
    dict of str to ndarray of bool
        By the names of `OBJECTS`, of the averaged picture's shape.
    """
    index = samples.layers[0].object_index
    assert index is not None
    inner = index[1::2, 1::2]
    margin = max(1, inner.shape[0] // 32)
    return {
        name: ndimage.binary_erosion(inner == number, iterations=margin)
        for number, name in enumerate(OBJECTS, start=1)
    }


def sharpness(picture: Picture, mask: npt.NDArray[np.bool_]) -> float:
    """Return how strongly neighbouring pixels of an object differ.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Scene-linear.
    mask : ndarray of bool of shape (rows, columns)
        The object.

    Returns
    -------
    float
        Root mean square of the gradient of green, each pixel.
    """
    down, right = np.gradient(picture[..., 1].astype(np.float64))
    return float(np.sqrt((down[mask] ** 2 + right[mask] ** 2).mean()))


def draw_pictures(workshop: Workshop) -> Drawing:
    """Draw the pinhole picture and the twelve of figures 12 to 14, and save each at full size."""
    samples = rendered_corners(workshop)
    masks = object_masks(samples)
    pinhole = processed(samples, ProcessSettings(use_lens=False, use_motion=False)).picture
    cells = [
        ("11: pinhole", _half(pinhole)),
        ("11, detail", _detail(pinhole, (0.0, 0.0))),
        ("11, detail", _detail(pinhole, (0.32, 0.23))),
        ("11, detail", _detail(pinhole, (0.02, 0.46))),
    ]
    _save(workshop, "11", pinhole)
    whole = {name: sharpness(pinhole, mask) for name, mask in masks.items()}
    numbers: dict[str, Any] = {}
    for row in TABLE_1:
        result = processed(samples, as_the_papers(row))
        report = result.report["focus"][0]
        numbers[row.figure] = {
            "sharpness": {
                name: sharpness(result.picture, mask) / whole[name] for name, mask in masks.items()
            },
            **{name: report[name] for name in ("nearest_m", "farthest_m", "tables", "table_bytes")},
            **{name: report[name] for name in ("nearest_circle_px", "farthest_circle_px")},
        }
        _save(workshop, row.figure, result.picture)
        cells.append((f"{row.figure}: {row.focus} mm, f/{row.f_stop:g}", _half(result.picture)))
    path = write_sheet(
        workshop.path("tog_11_14"),
        [(text, displayed(picture)) for text, picture in cells],
        4,
        caption="TOG 1982, figures 11 to 14. The columns are focused behind everything, on the background, "
        "on the cube and on the sphere. Above stand the pinhole picture and its details, twice as large.",
    )
    return Drawing(path, numbers)


def _half(picture: Picture) -> Picture:
    return average_down(picture, 2)


def _detail(picture: Picture, corner: tuple[float, float]) -> Picture:
    """Return a part of a picture, half its size each way."""
    side = picture.shape[0] // 2
    left, top = (round(share * picture.shape[0]) for share in corner)
    return picture[top : top + side, left : left + side]


def _save(workshop: Workshop, figure: str, picture: Picture) -> None:
    Image.fromarray(displayed(picture)).save(workshop.path(f"tog_{figure}"), optimize=True)


# Depth of field measured in a picture.

_PATCH_PIXELS: Final = 24
"""Pixels across the criterion's patch in the pictures that are measured."""

_REACH: Final = 1.5
"""How far these pictures go, in blur over the patch."""

_ROWS: Final = 720
_COLUMNS: Final = 3 * _PATCH_PIXELS


@dataclass(frozen=True, slots=True)
class Measured:
    """The blur of an edge that recedes from the camera, and where it grows past the criterion.

    Parameters
    ----------
    depth : ndarray of float64 of shape (rows,)
        Distance of the edge in each row of the picture in metres.
    blur : ndarray of float64 of shape (rows,)
        Diameter in metres on the film of the disc that spreads the edge as far as the picture has it.
    patch : float
        Diameter in metres on the film of the patch that the eye takes for a point.
    near, far : float
        Distances in metres at which the blur grows past the patch; infinity where it does not.
    """

    depth: FloatArray
    blur: FloatArray
    patch: float
    near: float
    far: float


def patch_on_film(lens: Lens, model: CocModel = "paper", criterion: float = DEFAULT_CRITERION) -> float:
    """Return the image of the patch MN that the eye takes for a point (TOG 1982, figure 3).

    The patch lies in the plane in focus, which the lens images sharply: D / 1000 across at D, it is V / 1000
    across on the film at V.

    Parameters
    ----------
    lens : Lens
        The focused lens.
    model : {"paper", "cycles"}
        Whether the film is at the lens law's V or stays at F.
    criterion : float
        Distance over the smallest diameter resolved at it.

    Returns
    -------
    float
        Diameter in metres.
    """
    if model == "cycles":
        return lens.focal_length / criterion
    return float(image_distance(lens.focus_distance, lens.focal_length)) / criterion


def receding_edge(lens: Lens, patch: float) -> Samples:
    """Return samples of a plane that recedes from the camera, black on the left and white on the right.

    Parameters
    ----------
    lens : Lens
        Says around which distance.
    patch : float
        Diameter in metres on the film that `_PATCH_PIXELS` pixels cover.

    Returns
    -------
    Samples
        A small part of the film around the axis, the far end on top. As on every plane, the inverse of the
        depth changes evenly from row to row.
    """
    middle, half = 1.0 / lens.focus_distance, _REACH / hyperfocal_distance(lens)
    # Not quite to the horizon.
    farthest = max(middle - half, 0.02 * middle)
    depth = 1.0 / np.linspace(farthest, middle + half, _ROWS)
    color = np.zeros((_ROWS, _COLUMNS, 4), dtype=np.float32)
    color[:, _COLUMNS // 2 :, :3] = 1.0
    color[..., 3] = 1.0
    window = Window(0, 0, _COLUMNS, _ROWS)
    pitch = patch / _PATCH_PIXELS
    every = np.repeat(depth[:, np.newaxis], _COLUMNS, axis=1).astype(np.float32)
    return Samples(
        layers=(SampleLayer("", color, every),),
        data_window=window,
        display_window=window,
        film=Film(_COLUMNS * pitch, _ROWS * pitch, _COLUMNS, _ROWS),
    )


def edge_blur(picture: Picture, pitch: float) -> FloatArray:
    """Return how wide an upright edge is spread in every row of a picture.

    The differences along a row are the line that the edge's every point is spread to. An evenly lit disc of
    diameter c spreads a point to a line with the standard deviation c / 4.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, channels)
        Scene-linear; green is measured.
    pitch : float
        Width of a pixel on the film in metres.

    Returns
    -------
    ndarray of float64 of shape (rows,)
        Four standard deviations in metres.
    """
    line = np.diff(picture[..., 1].astype(np.float64), axis=1)
    line /= line.sum(axis=1, keepdims=True)
    place = np.arange(line.shape[1]) * pitch
    mean = line @ place
    variance = line @ place**2 - mean**2
    return np.asarray(4.0 * np.sqrt(np.maximum(variance, 0.0)))


def sharp_range(depth: FloatArray, blur: FloatArray, focus: float, patch: float) -> tuple[float, float]:
    """Return the distances around the focus at which a blur grows past a patch.

    Parameters
    ----------
    depth : ndarray of float64 of shape (rows,)
        Distances in metres, falling.
    blur : ndarray of float64 of shape (rows,)
        Diameters in metres.
    focus : float
        Distance in metres that is sharp.
    patch : float
        Diameter in metres.

    Returns
    -------
    near, far : float
        Distances in metres, 0 and infinity where the blur stays below the patch. Between rows the blur is
        taken as even in the inverse of the distance.
    """

    def crossing(inverse: FloatArray, values: FloatArray) -> float:
        beyond = np.flatnonzero(values > patch)
        if beyond.size == 0:
            return math.nan
        last = int(beyond[0])
        return float(np.interp(patch, values[last - 1 : last + 1], inverse[last - 1 : last + 1]))

    middle = int(np.argmin(np.abs(1.0 / depth - 1.0 / focus)))
    inverse = 1.0 / depth
    near = crossing(inverse[middle:], blur[middle:])
    far = crossing(inverse[middle::-1], blur[middle::-1])
    return (0.0 if math.isnan(near) else 1.0 / near), (math.inf if math.isnan(far) else 1.0 / far)


def measured(row: Printed, kind: PsfKind = "disc", model: CocModel = "paper") -> Measured:
    """Photograph a receding edge with the lens of a row of Table 1, and measure where it turns blurred.

    Parameters
    ----------
    row : Printed
        Lens and focus; its printed limits are not looked at.
    kind : {"disc", "lommel"}
        Point-spread function.
    model : {"paper", "cycles"}
        How out-of-focus points are imaged.

    Returns
    -------
    Measured
        What the picture shows.
    """
    patch = patch_on_film(row.lens, model)
    samples = receding_edge(row.lens, patch)
    picture = processed(samples, as_the_papers(row, kind, model)).picture
    depth = np.asarray(samples.layers[0].depth, dtype=np.float64)[:, 0]
    blur = edge_blur(picture, patch / _PATCH_PIXELS)
    near, far = sharp_range(depth, blur, row.lens.focus_distance, patch)
    return Measured(depth, blur, patch, near, far)


_MM: Final = 1e3
_UM: Final = 1e6


def draw_measured(workshop: Workshop) -> Drawing:
    """Plot the blur measured against the distance, with the criterion and the printed limits."""
    discs = [measured(row) for row in TABLE_1]
    patterns = [measured(row, "lommel") for row in TABLE_1]
    with mpl.rc_context(STYLE):
        plot, panels = plt.subplots(3, 4, figsize=(10.0, 7.0), layout="constrained")
        for row, disc, pattern, axes in zip(TABLE_1, discs, patterns, panels.flat, strict=True):
            axes.axvspan(row.near, row.far, color=COLORS[2], alpha=0.12, linewidth=0.0)
            axes.axhline(disc.patch * _UM, color=COLORS[5], linewidth=0.8, linestyle=(0, (4, 3)))
            axes.plot(pattern.depth * _MM, pattern.blur * _UM, color=COLORS[1], linewidth=0.9)
            axes.plot(disc.depth * _MM, disc.blur * _UM, color=COLORS[0], linewidth=1.4)
            limits = np.array([disc.near, disc.far])
            axes.plot(limits * _MM, [disc.patch * _UM] * 2, "o", color=COLORS[0], markersize=3.5)
            axes.set_xscale("function", functions=(_reciprocal, _reciprocal))
            axes.set_xlim(disc.depth[-1] * _MM, min(disc.depth[0] * _MM, 1.5 * row.far))
            axes.set_xticks([row.near, row.focus, row.far], [f"{row.near}", f"{row.focus}", f"{row.far}"])
            axes.set_ylim(0.0, 1.4 * disc.patch * _UM)
            axes.set_title(f"{row.figure}: f/{row.f_stop:g}, {row.focus} mm")
        for axes in panels[:, 0]:
            axes.set_ylabel("blur on the film (µm)")
        for axes in panels[-1]:
            axes.set_xlabel("distance (mm)")
        handles = [
            plt.Line2D([], [], color=COLORS[0], linewidth=1.4, label="measured, disc"),
            plt.Line2D(
                [], [], color=COLORS[1], linewidth=0.9, label="measured, the papers' diffraction pattern"
            ),
            plt.Line2D([], [], color=COLORS[5], linewidth=0.8, linestyle=(0, (4, 3)), label="patch V/1000"),
            plt.Rectangle((0, 0), 1, 1, color=COLORS[2], alpha=0.12, label="printed depth of field"),
        ]
        plot.legend(handles=handles, loc="outside upper center", ncols=4)
        path = write_plot(workshop.path("tog_dof_measured"), plot)
        plt.close(plot)
    numbers = _errors(discs, patterns)
    return Drawing(path, numbers, _measured_table(numbers))


def _reciprocal(values: npt.ArrayLike) -> FloatArray:
    """Place distances as a receding plane has them in a picture: evenly in their inverse."""
    with np.errstate(divide="ignore"):
        return np.asarray(-1e6 / np.asarray(values, dtype=np.float64))


def _errors(discs: list[Measured], patterns: list[Measured]) -> dict[str, Any]:
    """Return what was measured beside the exact limits, in millimetres and percent."""
    numbers = {}
    for row, disc, pattern in zip(TABLE_1, discs, patterns, strict=True):
        exact = depth_of_field(row.lens)
        numbers[row.figure] = {
            "patch_um": disc.patch * _UM,
            "near_mm": disc.near * _MM,
            "near_error_mm": (disc.near - exact.near) * _MM,
            "near_error_percent": 100.0 * (disc.near / exact.near - 1.0),
            "far_mm": disc.far * _MM,
            "far_error_mm": (disc.far - exact.far) * _MM,
            "far_error_percent": 100.0 * (disc.far / exact.far - 1.0),
            "lommel_near_mm": pattern.near * _MM,
            "lommel_far_mm": pattern.far * _MM,
        }
    return numbers


def _measured_table(numbers: dict[str, Any]) -> str:
    head = [
        "Figure",
        "D⁺",
        "measured",
        "error",
        "%",
        "D⁻",
        "measured",
        "error",
        "%",
        "D⁺, pattern",
        "D⁻, pattern",
    ]
    rows = []
    for row in TABLE_1:
        found, exact = numbers[row.figure], depth_of_field(row.lens)
        cells: list[Any] = [row.figure]
        for side, limit in (("far", exact.far), ("near", exact.near)):
            values = (limit * _MM, found[f"{side}_mm"], found[f"{side}_error_mm"])
            # Plus 0 so that a small negative number is no negative zero.
            cells += [round(value, 1) + 0.0 for value in values]
            cells.append(round(found[f"{side}_error_percent"], 2) + 0.0)
        rows.append([*cells, round(found["lommel_far_mm"]), round(found["lommel_near_mm"])])
    return markdown_table(head, rows)


def draw_table(workshop: Workshop) -> Drawing:
    """Draw Table 1 as bars from the near to the far limit, and write it beside the printed one."""
    found = [measured(row) for row in TABLE_1]
    places = np.arange(len(TABLE_1))
    exact = [depth_of_field(row.lens) for row in TABLE_1]
    with mpl.rc_context(STYLE):
        plot, axes = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
        axes.set_axisbelow(True)
        near, total = (_MM * np.array([getattr(e, name) for e in exact]) for name in ("near", "total"))
        axes.barh(places, total, left=near, height=0.5, color="#9db8d2", label="D⁻ to D⁺")
        ends = [[row.near for row in TABLE_1], [row.far for row in TABLE_1]]
        axes.plot(ends, [places, places], "k|", markersize=14)
        seen = _MM * np.array([[m.near for m in found], [m.far for m in found]])
        axes.plot(seen, [places, places], "o", color=COLORS[1], markersize=4)
        axes.plot([row.focus for row in TABLE_1], places, "kD", markersize=3, label="focus")
        axes.plot([], [], "k|", markersize=10, label="printed")
        axes.plot([], [], "o", color=COLORS[1], markersize=4, label="measured in pictures")
        axes.set_xscale("log")
        ticks = [200, 290, 400, 550, 750, 980, 1400, 2000, 3000, 5000, 10000]
        axes.set_xticks(ticks, [str(tick) for tick in ticks])
        axes.minorticks_off()
        axes.set_yticks(places, [f"{row.figure}  f/{row.f_stop:g}" for row in TABLE_1])
        axes.invert_yaxis()
        axes.set_xlabel("distance from the lens (mm)")
        plot.legend(loc="outside upper center", ncols=4)
        path = write_plot(workshop.path("table_1"), plot)
        plt.close(plot)
    return Drawing(path, *_table_1(exact, found))


def _table_1(exact: list[DepthOfField], found: list[Measured]) -> tuple[dict[str, Any], str]:
    """Return our Table 1 in millimetres, and as a table beside the printed and the measured one."""
    head = ["Figure", "n", "D", "D⁺", "printed", "measured", "D⁻", "printed", "measured"]
    head += ["Depth of field", "printed", "measured"]
    numbers, rows = {}, []
    for row, ours, seen in zip(TABLE_1, exact, found, strict=True):
        far, near = round(ours.far * _MM), round(ours.near * _MM)
        numbers[row.figure] = {"far": far, "near": near, "total": far - near}
        cells = [row.figure, row.f_stop, row.focus, far, row.far, round(seen.far * _MM)]
        cells += [near, row.near, round(seen.near * _MM)]
        rows.append([*cells, far - near, row.total, round((seen.far - seen.near) * _MM)])
    return numbers, markdown_table(head, rows)


FIGURES = (
    Figure("table_1", "TOG 1982, table 1", draw_table),
    Figure("tog_11_14", "TOG 1982, figures 11 to 14", draw_pictures),
    Figure("tog_dof_measured", "TOG 1982, table 1 measured in pictures", draw_measured),
)
