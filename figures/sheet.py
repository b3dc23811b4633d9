"""How figures look: pictures beside each other under their letters, plots in one style."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from potmesil_addon.png import srgb

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

# No window: figures go to files.
mpl.use("Agg")

COLORS = ("#1f5fa8", "#c8401f", "#2f8a4d", "#8a5fa8", "#b8860b", "#555555")
"""Line colours in order, told apart by every kind of colour vision and in grey."""

STYLE = {
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": mpl.cycler(color=COLORS),
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8,
}
"""For ``matplotlib.rc_context``."""

_GAP = 8
_TEXT_ROWS = 20
_FONT = 14
_INK = (20, 20, 20)
_PAPER = (255, 255, 255)
_PIXELS_PER_LETTER = 7.2


def displayed(linear: npt.ArrayLike, *, exposure: float = 0.0) -> npt.NDArray[np.uint8]:
    """Return scene-linear values as 8-bit display values.

    Parameters
    ----------
    linear : array_like of shape (rows, columns, channels)
        Scene-linear; an alpha channel is dropped.
    exposure : float
        Stops that the picture is made brighter by.

    Returns
    -------
    ndarray of uint8 of shape (rows, columns, 3)
        sRGB.
    """
    values = np.asarray(linear, dtype=np.float64)[..., :3] * 2.0**exposure
    return np.rint(255.0 * srgb(values)).astype(np.uint8)


def write_sheet(
    path: Path,
    pictures: Sequence[tuple[str, npt.NDArray[np.uint8]]],
    columns: int,
    *,
    caption: str = "",
    zoom: int = 1,
) -> Path:
    """Write pictures in rows, each with its text below, and a caption under all.

    Parameters
    ----------
    path : Path
        A PNG file.
    pictures : sequence of (str, ndarray of uint8 of shape (rows, columns, 3))
        Texts and display values, all of one size.
    columns : int
        Pictures in a row.
    caption : str
        Wrapped to the sheet's width.
    zoom : int
        Times that every pixel is repeated, each way.

    Returns
    -------
    Path
        The same path.
    """
    height, width = (zoom * side for side in pictures[0][1].shape[:2])
    font = ImageFont.load_default(_FONT)
    rows = -(-len(pictures) // columns)
    lines = max(len(_wrapped(text, width)) for text, _ in pictures)
    cell = (width + _GAP, height + lines * _TEXT_ROWS + _GAP)
    below = _wrapped(caption, cell[0] * columns) if caption else []
    size = (cell[0] * columns + _GAP, cell[1] * rows + _GAP + _TEXT_ROWS * len(below))
    sheet = Image.new("RGB", size, _PAPER)
    draw = ImageDraw.Draw(sheet)
    for number, (text, values) in enumerate(pictures):
        row, column = divmod(number, columns)
        x, y = _GAP + cell[0] * column, _GAP + cell[1] * row
        pixels = np.repeat(np.repeat(values, zoom, axis=0), zoom, axis=1)
        sheet.paste(Image.fromarray(pixels), (x, y))
        for line, words in enumerate(_wrapped(text, width)):
            draw.text((x, y + height + 2 + line * _TEXT_ROWS), words, fill=_INK, font=font)
    for line, words in enumerate(below):
        draw.text((_GAP, cell[1] * rows + 2 + line * _TEXT_ROWS), words, fill=_INK, font=font)
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path, optimize=True)
    return path


def write_plot(path: Path, plot: Plot, **options: Any) -> Path:
    """Save a matplotlib figure as PNG, and close it.

    Parameters
    ----------
    path : Path
        A PNG file.
    plot : matplotlib.figure.Figure
        The plot.
    **options
        Of ``savefig``.

    Returns
    -------
    Path
        The same path.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Without matplotlib's version the same plot is the same file.
    plot.savefig(path, bbox_inches="tight", metadata={"Software": None}, **options)
    return path


def cut(picture: npt.NDArray[Any], box: tuple[float, float, float, float]) -> npt.NDArray[Any]:
    """Return a part of a picture.

    Parameters
    ----------
    picture : ndarray of shape (rows, columns, ...)
        The picture.
    box : tuple of float
        Left, top, right, bottom as shares of its size.

    Returns
    -------
    ndarray
        The part.
    """
    rows, columns = picture.shape[:2]
    left, top, right, bottom = box
    return picture[round(top * rows) : round(bottom * rows), round(left * columns) : round(right * columns)]


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a table in Markdown, numbers to the right."""
    numeric = [all(isinstance(row[n], int | float) for row in rows) for n in range(len(head))]
    lines = [
        "| " + " | ".join(head) + " |",
        "|" + "|".join("---:" if right else "---" for right in numeric) + "|",
    ]
    lines += ["| " + " | ".join(str(value) for value in row) + " |" for row in rows]
    return "\n".join(lines)


def _wrapped(text: str, width: float) -> list[str]:
    return textwrap.wrap(text, max(8, int(width / _PIXELS_PER_LETTER)))
