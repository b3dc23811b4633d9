"""Pictures to look at: scene-linear values through the sRGB curve into a PNG file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from .errors import OutputError
from .files import whole_file
from .samples import Float32Array


def srgb(linear: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return display values of scene-linear ones (IEC 61966-2-1), clipped to what a display shows.

    Parameters
    ----------
    linear : array_like
        Scene-linear values, any shape.

    Returns
    -------
    ndarray of float64
        Values from 0 to 1, same shape.
    """
    x = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)


def write_png(path: Path, picture: Float32Array) -> None:
    """Write a premultiplied scene-linear picture as an 8-bit sRGB PNG with straight alpha.

    Parameters
    ----------
    path : Path
        The file.
    picture : ndarray of float32 of shape (rows, columns, 4)
        The picture. Alpha is left out where every pixel is opaque.

    Raises
    ------
    OutputError
        If it cannot be written or the pypng package is missing.
    """
    alpha = np.clip(picture[..., 3:4], 0.0, 1.0)
    color = np.divide(picture[..., :3], alpha, out=np.zeros_like(picture[..., :3]), where=alpha > 0.0)
    opaque = bool(np.all(alpha >= 1.0))
    values = srgb(color) if opaque else np.concatenate([srgb(color), alpha], axis=2)
    _write(path, np.rint(255.0 * values).astype(np.uint8))


def write_png_table(path: Path, table: npt.NDArray[np.float64]) -> None:
    """Write a table of point-spread functions as a 16-bit PNG, linear, its largest value white.

    Parameters
    ----------
    path : Path
        The file.
    table : ndarray of float64 of shape (rows, columns, 3)
        Values of 0 or more.

    Raises
    ------
    OutputError
        If it cannot be written or the pypng package is missing.
    """
    _write(path, np.rint(65535.0 * table / table.max()).astype(np.uint16))


def _write(path: Path, values: npt.NDArray[np.unsignedinteger]) -> None:
    try:
        import png  # noqa: PLC0415 - optional: only PNG output needs it
    except ImportError:
        raise OutputError("Writing PNG files needs the pypng package; write an .exr file instead.") from None
    rows, columns, channels = values.shape
    writer = png.Writer(
        width=columns,
        height=rows,
        greyscale=False,
        alpha=channels == 4,
        bitdepth=8 * values.dtype.itemsize,
    )
    with whole_file(path) as part, part.open("wb") as stream:
        writer.write(stream, values.reshape(rows, columns * channels))
