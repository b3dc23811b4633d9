"""Contact sheets: pictures side by side with their names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

_LABEL_ROWS = 18
_GAP = 4


def write_sheet(path: Path, pictures: Sequence[tuple[str, npt.NDArray[np.float32]]], columns: int) -> None:
    """Write pictures in rows, each under its name.

    Parameters
    ----------
    path : Path
        A PNG or JPEG file.
    pictures : sequence of (str, ndarray of shape (rows, columns, 3))
        Names, and values from 0 to 1 as displayed, all of one size.
    columns : int
        Pictures in a row.
    """
    height, width = pictures[0][1].shape[:2]
    rows = -(-len(pictures) // columns)
    cell = (width + _GAP, height + _LABEL_ROWS + _GAP)
    sheet = Image.new("RGB", (cell[0] * columns - _GAP, cell[1] * rows - _GAP), (24, 24, 24))
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(13)
    for number, (name, values) in enumerate(pictures):
        x, y = cell[0] * (number % columns), cell[1] * (number // columns)
        draw.text((x + 4, y + 1), name, fill=(255, 255, 255), font=font)
        pixels = np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
        sheet.paste(Image.fromarray(pixels), (x, y + _LABEL_ROWS))
    sheet.save(path)
