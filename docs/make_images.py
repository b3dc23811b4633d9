"""Make `docs/images/demo.png` from the demo's four pictures: pinhole and f/5.6 above, f/11 and f/22 below.

Run it by hand after `make demo`, with the Python of any of the project's environments::

    .venv/dev/bin/python docs/make_images.py

Each picture is cut to its middle and made smaller in scene-linear light, so that fine detail keeps its
brightness.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt
import png

ROOT = Path(__file__).resolve().parent.parent
NAMES = ("pinhole", "f5.6", "f11", "f22")
GAP = 4
"""White pixels between the pictures."""


def read_linear(path: Path) -> npt.NDArray[np.float64]:
    """Return an 8-bit sRGB PNG as scene-linear values of shape (rows, columns, 3)."""
    columns, rows, values, _ = png.Reader(filename=str(path)).asRGB8()
    x = np.array([list(row) for row in values]).reshape(rows, columns, 3) / 255.0
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def to_srgb(x: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """Return scene-linear values as 8-bit sRGB."""
    y = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0) ** (1.0 / 2.4) - 0.055)
    return np.rint(255.0 * y).astype(np.uint8)


def shrink(picture: npt.NDArray[np.float64], side: int) -> npt.NDArray[np.float64]:
    """Return a square picture averaged down to `side` pixels each way, exactly by area."""
    edges = np.linspace(0.0, picture.shape[0], side + 1)
    for axis in (0, 1):
        picture = np.moveaxis(picture, axis, 0)
        sums = np.concatenate([np.zeros_like(picture[:1]), np.cumsum(picture, axis=0)])
        whole = np.minimum(edges.astype(int), len(picture) - 1)
        part = (edges - whole)[:, np.newaxis, np.newaxis]
        at = sums[whole] + part * picture[whole]
        picture = np.moveaxis(np.diff(at, axis=0) / np.diff(edges)[:, np.newaxis, np.newaxis], 0, axis)
    return picture


def main() -> int:
    """Write the sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--demo", type=Path, default=ROOT / "build" / "demo", help="folder of the pictures")
    parser.add_argument("--side", type=int, default=280, help="pixels of a picture, each way")
    options = parser.parse_args()
    side: int = options.side
    sheet = np.full((2 * side + GAP, 2 * side + GAP, 3), 255, dtype=np.uint8)
    for number, name in enumerate(NAMES):
        picture = read_linear(options.demo / f"{name}.png")
        cut = len(picture) // 32
        # A little left of and below the middle, where the sphere and the cube are.
        picture = picture[3 * cut : -cut, cut : -3 * cut]
        y, x = (n * (side + GAP) for n in divmod(number, 2))
        sheet[y : y + side, x : x + side] = to_srgb(shrink(picture, side))
    target = ROOT / "docs" / "images" / "demo.png"
    target.parent.mkdir(exist_ok=True)
    writer = png.Writer(width=sheet.shape[1], height=sheet.shape[0], greyscale=False, compression=9)
    with target.open("wb") as stream:
        writer.write(stream, sheet.reshape(len(sheet), -1))
    print(f"Saved: {target.relative_to(ROOT)}, {target.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
