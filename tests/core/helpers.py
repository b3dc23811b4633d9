"""References and small builders for the tests of the core. Nothing here calls what it is a reference for."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenEXR
import pytest
from scipy import special

from potmesil_addon.camera import Film
from potmesil_addon.focus import FocusSettings, focus_layer
from potmesil_addon.progress import run
from potmesil_addon.psf import PsfBuilder
from potmesil_addon.samples import SampleLayer, Samples, Window

Array = npt.NDArray[np.float64]
Picture = npt.NDArray[np.float32]

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"

needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="the files of other people, ../shared/data, are not here"
)


def importable() -> dict[str, str]:
    """Return the environment of a process that finds the core from any folder."""
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


def data_files(folder: str) -> list[Path]:
    """Return the files of one folder of other people's files; none where it is missing."""
    return sorted((DATA / folder).iterdir()) if (DATA / folder).is_dir() else []


def diffraction_integral(u: float, v: npt.ArrayLike) -> Array:
    """Return |2 int_0^1 J0(v p) exp(-i u p^2 / 2) p dp|^2 by Gauss-Legendre on short panels."""
    v = np.atleast_1d(np.asarray(v, dtype=np.float64))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    # At most 10 radians of phase a panel: 24 nodes then leave nothing but rounding.
    panels = math.ceil((0.5 * abs(u) + float(np.abs(v).max(initial=0.0))) / 10.0) + 1
    edges = np.linspace(0.0, 1.0, panels + 1)
    p = (edges[:-1, np.newaxis] + np.diff(edges)[:, np.newaxis] * 0.5 * (nodes + 1.0)).reshape(-1)
    weight = (np.diff(edges)[:, np.newaxis] * 0.5 * weights).reshape(-1)
    integrand = 2.0 * weight * p * np.exp(-0.5j * u * p**2)
    # In slices, so that long profiles at a large u stay small in memory.
    step = max(1, 2_000_000 // p.size)
    field = np.concatenate(
        [special.j0(np.multiply.outer(v[i : i + step], p)) @ integrand for i in range(0, v.size, step)]
    )
    return np.asarray(np.abs(field) ** 2)


def clipped_area(polygon: Array, x0: float, x1: float, y0: float, y1: float) -> float:
    """Return the area of a convex polygon within a box: cut by one side after the other."""
    points = [(float(x), float(y)) for x, y in polygon]
    for axis, bound, sign in ((0, x0, 1.0), (0, x1, -1.0), (1, y0, 1.0), (1, y1, -1.0)):
        kept: list[tuple[float, float]] = []
        for a, b in zip(points, points[1:] + points[:1], strict=True):
            inside_a, inside_b = sign * (a[axis] - bound) >= 0.0, sign * (b[axis] - bound) >= 0.0
            if inside_a:
                kept.append(a)
            if inside_a != inside_b:
                t = (bound - a[axis]) / (b[axis] - a[axis])
                kept.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
        points = kept
    following = points[1:] + points[:1]
    return 0.5 * abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(points, following, strict=True)))


def polygon_coverage(polygon: Array, reach: int, half: float) -> Array:
    """Return a convex polygon's share in each pixel of a square canvas, by clipping.

    Canvas pixel (j, i) covers x from i - reach - half and y from j - reach - half to one more.
    """
    side = 2 * reach + 1
    canvas = np.zeros((side, side))
    for j in range(side):
        for i in range(side):
            x, y = i - reach - half, j - reach - half
            canvas[j, i] = clipped_area(polygon, x, x + 1.0, y, y + 1.0)
    return canvas / canvas.sum()


def ellipse_coverage(rx: float, ry: float, reach: int, half: float, lines: int = 4000) -> Array:
    """Return an ellipse's share in each pixel of a square canvas, by many scan lines a pixel row."""
    side = 2 * reach + 1
    y = (np.arange(side * lines) + 0.5) / lines - reach - half
    width = rx * np.sqrt(np.clip(1.0 - (y / ry) ** 2, 0.0, None))
    left = (np.arange(side) - reach - half)[:, np.newaxis]
    covered = np.clip(width, left, left + 1.0) - np.clip(-width, left, left + 1.0)
    canvas = covered.reshape(side, side, lines).mean(axis=2).T
    return np.asarray(canvas / canvas.sum())


def on_canvas(table: Any, reach: int) -> Array:
    """Return a table's values (primaries, side, side) on a square canvas, offset 0 at index `reach`."""
    values = table.dense()
    canvas = np.zeros((values.shape[0], 2 * reach + 1, 2 * reach + 1))
    top = reach + table.first_row
    left = reach - values.shape[2] // 2
    canvas[:, top : top + values.shape[1], left : left + values.shape[2]] = values
    return canvas


def make_samples(
    color: npt.ArrayLike,
    depth: npt.ArrayLike,
    *,
    data: Window | None = None,
    display: Window | None = None,
    **others: Any,
) -> Samples:
    """Return samples of one layer; both windows begin at 0 unless they are given."""
    color = np.asarray(color, dtype=np.float32)
    rows, columns = color.shape[:2]
    depth = np.broadcast_to(np.asarray(depth, dtype=np.float32), (rows, columns)).copy()
    data = data or Window(0, 0, columns, rows)
    return Samples((SampleLayer("", color, depth),), data, display or data, **others)


def square_film(samples: Samples, pitch: float = 1e-4) -> Film:
    """Return a film for a picture whose pixels are squares of `pitch` metres."""
    window = samples.display_window
    return Film(window.columns * pitch, window.rows * pitch, window.columns, window.rows)


def focused(samples: Samples, settings: FocusSettings) -> Picture:
    """Return the focus processor's picture of the first layer."""
    return run(focus_layer(samples.layers[0], samples, settings)).picture


def eq_22(samples: Samples, settings: FocusSettings, weight: Array) -> Array:
    """Return TOG 1982, eq. 22, sample by sample, from the tables' dense values."""
    layer = samples.layers[0]
    assert layer.depth is not None
    builder = PsfBuilder(settings.lens, settings.film, settings.model, settings.psf, samples.position)
    assignment = builder.assign(layer.depth)
    tables = list(builder.tables(assignment.circles))
    reach = 2 + max(max(abs(t.first_row), t.dense().shape[2], t.row_begin.size) for t in tables)
    canvases = [on_canvas(table, reach) for table in tables]
    window, display = samples.data_window, samples.display_window
    shape = (display.rows + 2 * reach, display.columns + 2 * reach)
    numerator, denominator = np.zeros((4, *shape)), np.zeros((4, *shape))
    for row, column in np.ndindex(*layer.depth.shape):
        y = row + window.y0 - display.y0
        x = column + window.x0 - display.x0
        h = canvases[assignment.table[row, column]]
        if assignment.fraction is not None and assignment.fraction[row, column] > 0.0:
            after = float(assignment.fraction[row, column])
            h = (1.0 - after) * h + after * canvases[assignment.table[row, column] + 1]
        # Alpha goes with green where each primary has its own function.
        h = weight[row, column] * np.broadcast_to(h, (3, *h.shape[1:]))[[0, 1, 2, 1]]
        j0, i0 = max(0, -y), max(0, -x)
        j1, i1 = min(2 * reach + 1, shape[0] - y), min(2 * reach + 1, shape[1] - x)
        if j1 <= j0 or i1 <= i0:
            continue
        place = (slice(None), slice(y + j0, y + j1), slice(x + i0, x + i1))
        color = layer.color[row, column].astype(np.float64)[:, np.newaxis, np.newaxis]
        numerator[place] += color * h[:, j0:j1, i0:i1]
        denominator[place] += h[:, j0:j1, i0:i1]
    inner = (slice(None), slice(reach, reach + display.rows), slice(reach, reach + display.columns))
    numerator, denominator = numerator[inner], denominator[inner]
    picture = np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 1e-12)
    # Where the file has no data there is no picture.
    covered = np.zeros((display.rows, display.columns), dtype=bool)
    extra = 1 if samples.position == "corner" else 0
    covered[
        max(0, window.y0 - display.y0) : max(0, window.y1 - extra - display.y0),
        max(0, window.x0 - display.x0) : max(0, window.x1 - extra - display.x0),
    ] = True
    return np.where(covered[..., np.newaxis], np.moveaxis(picture, 0, 2), 0.0)


def write_exr(path: Path, channels: dict[str, npt.NDArray[Any]], **header: Any) -> Path:
    """Write an EXR file of one part straight through the OpenEXR module."""
    complete = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(complete, dict(channels)).write(str(path))
    return path


def plain_channels(rows: int, columns: int, seed: int = 0) -> dict[str, npt.NDArray[Any]]:
    """Return R, G, B, A and Z of random samples, opaque and between 1 and 9 metres away."""
    rng = np.random.default_rng(seed)
    channels = {name: rng.random((rows, columns), dtype=np.float32) for name in "RGB"}
    channels["A"] = np.ones((rows, columns), dtype=np.float32)
    channels["Z"] = (1.0 + 8.0 * rng.random((rows, columns))).astype(np.float32)
    return channels


def box(x0: int, y0: int, x1: int, y1: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return an EXR box from the first to the last pixel, both included."""
    return np.array([x0, y0], dtype=np.int32), np.array([x1, y1], dtype=np.int32)


def crafted_exr(
    channels: Sequence[tuple[str, int, int]],
    side: int = 8,
    extra: Sequence[tuple[str, str, bytes]] = (),
) -> bytes:
    """Return an uncompressed float EXR of zeros, byte by byte, for what the OpenEXR module does not write.

    Parameters
    ----------
    channels : sequence of tuple
        Name and subsampling in x and y, by name in rising order.
    side : int
        Pixels each way.
    extra : sequence of tuple
        Name, type and value of more header attributes.
    """
    chlist = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", 2, 0, x, y) for name, x, y in channels)
    window = struct.pack("<4i", 0, 0, side - 1, side - 1)
    attributes = [
        ("channels", "chlist", chlist + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
        *extra,
    ]
    header = struct.pack("<ii", 20000630, 2)
    for name, kind, value in attributes:
        header += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    chunks = []
    for y in range(side):
        size = sum(4 * (side // sx) for _, sx, sy in channels if y % sy == 0)
        chunks.append(struct.pack("<ii", y, size) + bytes(size))
    offsets, at = b"", len(header) + 8 * side
    for chunk in chunks:
        offsets += struct.pack("<Q", at)
        at += len(chunk)
    return header + offsets + b"".join(chunks)


def polygon_vertices_by_hand(blades: int, rotation: float, ratio: float) -> Array:
    """Return an iris' corners as Cycles draws it: a blade's middle at `rotation`, x right and y up."""
    corners = []
    for blade in range(blades):
        angle = rotation + 2.0 * math.pi * blade / blades - math.pi / blades
        corners.append((math.cos(angle) / ratio, math.sin(angle)))
    return np.array(corners)
