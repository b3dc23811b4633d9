"""PNG files: the sRGB curve, straight alpha, and what a reader gets back."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import png as pypng
import pytest

from potmesil_addon.errors import OutputError
from potmesil_addon.png import srgb, write_png, write_png_table


def decoded(path: Path) -> Any:
    columns, rows, lines, info = pypng.Reader(filename=str(path)).read()
    values = np.array([list(line) for line in lines])
    return values.reshape(rows, columns, info["planes"]), info


def picture(pixels: Any) -> Any:
    return np.asarray(pixels, dtype=np.float32)


@pytest.mark.parametrize(
    ("linear", "shown"),
    # Half of the display's range is 0.2140411 of the light; 18 % grey shows as 0.4614.
    [
        (0.0, 0.0),
        (1.0, 1.0),
        (0.21404114, 0.5),
        (0.18, 0.46135613),
        (0.002, 0.02584),
        (-3.0, 0.0),
        (7.0, 1.0),
    ],
)
def test_srgb_curve(linear: float, shown: float) -> None:
    assert float(srgb(linear)) == pytest.approx(shown, abs=1e-7)


def test_srgb_curve_has_no_step_at_its_seam() -> None:
    below, above = srgb([0.0031308, 0.0031309])
    assert above - below == pytest.approx(12.92 * 1e-7, abs=1e-7)


@pytest.mark.parametrize("shape", [(), (3,), (2, 3), (0, 2)])
def test_srgb_keeps_any_shape(shape: tuple[int, ...]) -> None:
    assert srgb(np.zeros(shape)).shape == shape


def test_first_row_is_on_top_and_first_column_left(tmp_path: Path) -> None:
    pixels = np.zeros((2, 3, 4))
    pixels[..., 3] = 1.0
    pixels[0, 2, 0] = 1.0
    pixels[1, 0, 2] = 1.0
    write_png(tmp_path / "out.png", picture(pixels))
    values, info = decoded(tmp_path / "out.png")
    assert info["size"] == (3, 2)
    assert info["planes"] == 3
    assert values[0].tolist() == [[0, 0, 0], [0, 0, 0], [255, 0, 0]]
    assert values[1].tolist() == [[0, 0, 255], [0, 0, 0], [0, 0, 0]]


def test_alpha_is_straight_and_linear(tmp_path: Path) -> None:
    # Half of a white that is half there; a color without alpha is none.
    pixels = [[[0.5, 0.5, 0.5, 0.5], [0.0, 0.0, 0.0, 0.0], [0.25, 0.0, 1.0, 1.0]]]
    write_png(tmp_path / "out.png", picture(pixels))
    values, info = decoded(tmp_path / "out.png")
    assert info["planes"] == 4
    assert values[0, 0].tolist() == [255, 255, 255, 128]
    assert values[0, 1].tolist() == [0, 0, 0, 0]
    assert values[0, 2].tolist() == [137, 0, 255, 255]


def test_what_a_display_cannot_show_is_clipped(tmp_path: Path) -> None:
    write_png(tmp_path / "out.png", picture([[[1e6, -1.0, 0.5, 1.0000001]]]))
    assert decoded(tmp_path / "out.png")[0][0, 0].tolist() == [255, 0, 188]


def test_table_is_16_bit_with_its_largest_value_white(tmp_path: Path) -> None:
    table = np.zeros((3, 2, 3))
    table[0, 1] = [0.2, 0.1, 0.05]
    write_png_table(tmp_path / "out.png", table)
    values, info = decoded(tmp_path / "out.png")
    assert info["bitdepth"] == 16
    assert values[0, 1].tolist() == [65535, 32768, 16384]
    assert not values[1:].any()


def test_without_pypng_the_error_names_the_other_format(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "png", None)
    with pytest.raises(OutputError, match=r"\.exr"):
        write_png(tmp_path / "out.png", picture([[[0.0, 0.0, 0.0, 1.0]]]))
    assert not list(tmp_path.iterdir())
