"""Pictures to look at: scene-linear values through the sRGB curve into a PNG file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError, OutputError
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


def write_png(path: Path, picture: Float32Array, texts: Mapping[str, str] | None = None) -> None:
    """Write a premultiplied scene-linear picture as an 8-bit sRGB PNG with straight alpha.

    Parameters
    ----------
    path : Path
        The file.
    picture : ndarray of float32 of shape (rows, columns, 4)
        The picture. Alpha is left out where every pixel is opaque.
    texts : mapping of str to str, optional
        What the file says of itself.

    Raises
    ------
    OutputError
        If it cannot be written or the pypng package is missing.
    """
    alpha = np.clip(picture[..., 3:4], 0.0, 1.0)
    color = np.divide(picture[..., :3], alpha, out=np.zeros_like(picture[..., :3]), where=alpha > 0.0)
    opaque = bool(np.all(alpha >= 1.0))
    values = srgb(color) if opaque else np.concatenate([srgb(color), alpha], axis=2)
    _write(path, np.rint(255.0 * values).astype(np.uint8), texts)


def read_texts(path: Path) -> dict[str, Any] | None:
    """Return the texts of a PNG file, all of which is read and checked.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict or None
        Texts by keyword; None where the pypng package is missing.

    Raises
    ------
    InputError
        If the file is not whole.
    """
    try:
        import png  # noqa: PLC0415 - optional
    except ImportError:
        return None
    texts: dict[str, Any] = {}
    try:
        with path.open("rb") as stream:
            kind = b""
            for kind, content in png.Reader(file=stream).chunks():
                if kind == b"tEXt":
                    keyword, _, text = content.partition(b"\0")
                    texts[keyword.decode("latin-1")] = text.decode("latin-1")
    except (png.Error, EOFError, ValueError) as error:
        raise InputError(f"'{path}' is not a whole PNG file.") from error
    if kind != b"IEND":
        raise InputError(f"'{path}' is not a whole PNG file.")
    return texts


def stamp(path: Path, texts: Mapping[str, str]) -> None:
    """Add texts to a PNG file in its place; without the pypng package it stays as it is.

    Parameters
    ----------
    path : Path
        A whole file, which no one else reads yet.
    texts : mapping of str to str
        By keyword; both in Latin-1.
    """
    try:
        import png  # noqa: PLC0415 - optional
    except ImportError:
        return
    with path.open("rb") as stream:
        chunks = list(png.Reader(file=stream).chunks())
    added = [(b"tEXt", f"{keyword}\0{text}".encode("latin-1")) for keyword, text in texts.items()]
    with path.open("wb") as stream:
        png.write_chunks(stream, [*chunks[:-1], *added, chunks[-1]])


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


def _write(
    path: Path, values: npt.NDArray[np.unsignedinteger], texts: Mapping[str, str] | None = None
) -> None:
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
    with whole_file(path) as part:
        with part.open("wb") as stream:
            writer.write(stream, values.reshape(rows, columns * channels))
        if texts:
            stamp(part, texts)
