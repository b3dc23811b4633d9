"""Pictures that the artist gives: of an aperture, of a glare."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
import OpenEXR

from .errors import InputError
from .files import utf8_path
from .samples import Float32Array

MOST_SIDE: Final = 4096
"""Columns or rows of the largest picture that is read."""

_GREY: Final = 0.04045
"""sRGB value up to which the curve is straight."""

_STAMPS: Final[dict[str, tuple[int, int]]] = {}
_FORGET: Final[list[Callable[[], None]]] = []


def read_image(path: Path) -> Float32Array:
    """Read a picture as light.

    Parameters
    ----------
    path : Path
        Ends in ``.exr`` (scene-linear) or ``.png`` (8 or 16 bits, sRGB). A grey picture has three equal
        channels; alpha is multiplied in.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        Scene-linear and finite, row 0 on top.

    Raises
    ------
    InputError
        If it cannot be read, has another format, or is too large.
    """
    kind = path.suffix.lower()
    if kind not in (".exr", ".png"):
        raise InputError(f"'{path}' must end in .exr or .png; save the picture as one of them.")
    try:
        values = _read_exr(path) if kind == ".exr" else _read_png(path)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"There is no picture '{path}'.") from None
    except Exception as error:
        # The readers raise whatever a damaged file makes them.
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"The picture '{path}' cannot be read: {reason}") from None
    light = np.nan_to_num(values.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    return np.asarray(light, dtype=np.float32)


def on_change(forget: Callable[[], None]) -> None:
    """Have something called when a picture is another one than it was, so that nothing of it is kept."""
    _FORGET.append(forget)


def look_again(paths: Iterable[str]) -> None:
    """Find out whether pictures that were read before have been changed since.

    Parameters
    ----------
    paths : iterable of str
        Pictures about to be used; empty ones do not count.
    """
    for path in filter(None, paths):
        try:
            facts = Path(path).stat()
        except OSError:
            continue
        stamp = facts.st_mtime_ns, facts.st_size
        if _STAMPS.setdefault(path, stamp) != stamp:
            _STAMPS[path] = stamp
            for forget in _FORGET:
                forget()


def _check_size(path: Path, columns: int, rows: int) -> None:
    if not (0 < columns <= MOST_SIDE and 0 < rows <= MOST_SIDE):
        raise InputError(
            f"The picture '{path}' is {columns} x {rows}; at most {MOST_SIDE} on a side are read."
        )


def _read_exr(path: Path) -> Any:
    with utf8_path(path) as name, OpenEXR.File(name, separate_channels=True, header_only=True) as header:
        low, high = header.header()["dataWindow"]
    _check_size(path, int(high[0] - low[0]) + 1, int(high[1] - low[1]) + 1)
    with utf8_path(path) as name, OpenEXR.File(name, separate_channels=True) as file:
        channels = {name.rpartition(".")[2]: channel.pixels for name, channel in file.channels().items()}
    # Premultiplied already.
    names = [name for name in ("R", "G", "B") if name in channels]
    if not names:
        names = ["Y"] if "Y" in channels else sorted(channels)[:1]
    color = np.stack([channels[name] for name in names], axis=2)
    return color if color.shape[2] == 3 else np.repeat(color[..., :1], 3, axis=2)


def _read_png(path: Path) -> Any:
    try:
        import png  # noqa: PLC0415 - optional: only PNG pictures need it
    except ImportError:
        raise InputError(f"Reading '{path}' needs the pypng package; save the picture as .exr.") from None
    with path.open("rb") as file:
        columns, rows, _, _ = png.Reader(file=file).read()
        _check_size(path, columns, rows)
        file.seek(0)
        columns, rows, lines, info = png.Reader(file=file).asRGBA()
        most = (1 << info["bitdepth"]) - 1
        values = np.vstack([np.asarray(line, dtype=np.float32) for line in lines]) / most
    values = values.reshape(rows, columns, 4)
    color, alpha = values[..., :3], values[..., 3:]
    linear = np.where(color <= _GREY, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
    return linear * alpha
