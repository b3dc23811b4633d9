"""A process that compiles kernels for another one, which needs them too, from the last one on.

``python -m potmesil_addon.warm SAMPLES SETTINGS [KERNELS]``. The first picture on a machine waits for all its
kernels, one after the other: Python compiles one at a time. The process that makes the picture compiles them
in the order in which it needs them, this one the other way round, and both leave them on disk. Where they
meet, all are there. It is worth its start only once something has to be compiled, see `jit.on_compile`, and
it ends with the process that started it.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from .camera import Film
from .samples import Samples, Window

_SIDE: Final = 24
"""Rows and columns of the part of the frame that is enough to call every kernel."""


def main(arguments: list[str]) -> int:
    """Compile the kernels that a picture needs.

    Parameters
    ----------
    arguments : list of str
        The samples file, the settings as JSON (`preview.settings_to_json`), and where compiled kernels are
        kept if that is not up to numba.

    Returns
    -------
    int
        Exit status: 0 done, 2 usage.
    """
    if len(arguments) not in (2, 3) or not Path(arguments[0]).is_file():
        print("usage: python -m potmesil_addon.warm SAMPLES SETTINGS [KERNELS]", file=sys.stderr)
        return 2
    parent = os.getppid()
    from . import jit  # noqa: PLC0415 - imports numba

    if not jit.HAVE_NUMBA:
        return 0
    if len(arguments) == 3:
        jit.set_cache_directory(Path(arguments[2]))
    # Kernels take their folder from the moment of their import.
    from . import exr  # noqa: PLC0415
    from .preview import settings_from_json  # noqa: PLC0415
    from .process import focus_settings, process  # noqa: PLC0415
    from .progress import run  # noqa: PLC0415

    samples = exr.read_samples(Path(arguments[0]))
    settings = settings_from_json(json.loads(arguments[1]))
    film = focus_settings(samples, settings).film if settings.use_lens else None
    small = part_of(samples, film)
    settings = replace(settings, sensor_width=None, sensor_height=None)
    # As far as it comes: what is compiled too few is compiled by the other process.
    with jit.rehearsal() as kernels, contextlib.suppress(Exception), np.errstate(all="ignore"):
        run(process(small, settings))
    for compile_one in reversed(kernels):
        if os.getppid() != parent:
            break
        compile_one()
    return 0


def part_of(samples: Samples, film: Film | None) -> Samples:
    """Return a small square of samples, where depths differ the most, as a frame of its own.

    Parameters
    ----------
    samples : Samples
        The frame.
    film : Film or None
        Its film, if it has one; pixels keep their size on it.

    Returns
    -------
    Samples
        At most 24 by 24 samples, of all layers.
    """
    data = samples.data_window
    rows, columns = min(_SIDE, data.rows), min(_SIDE, data.columns)
    y, x = _busiest(samples.layers[0].depth, rows, columns)
    window = Window(0, 0, columns, rows)
    if film is not None:
        film = film.with_pixels(columns, rows)
    cut = np.s_[y : y + rows, x : x + columns]
    return replace(
        samples,
        layers=tuple(layer.mapped(lambda values: values[cut]) for layer in samples.layers),
        data_window=window,
        display_window=window,
        film=film,
    )


def _busiest(depth: npt.NDArray[np.float32] | None, rows: int, columns: int) -> tuple[int, int]:
    """Return the first row and column of the square in which 1 / depth has the widest range."""
    if depth is None:
        return 0, 0
    height, width = depth.shape[0] // rows * rows, depth.shape[1] // columns * columns
    squares = (1.0 / depth[:height, :width]).reshape(height // rows, rows, width // columns, columns)
    spread = squares.max(axis=(1, 3)) - squares.min(axis=(1, 3))
    row, column = divmod(int(np.argmax(spread)), spread.shape[1])
    return row * rows, column * columns


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
