"""Sheets, tables and distances of pictures."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from figures.comparison import psnr
from figures.sheet import cut, displayed, markdown_table, write_sheet


def test_psnr_of_a_known_difference() -> None:
    first = np.zeros((4, 5, 3), dtype=np.float32)
    second = first.copy()
    # sRGB 0.5 is 188 of 255; one value of sixty differs by it.
    second[0, 0, 0] = 0.5
    assert psnr(first, first) == math.inf
    assert psnr(first, second) == pytest.approx(10.0 * math.log10(255.0**2 / (188.0**2 / 60.0)))


def test_display_values_are_srgb() -> None:
    linear = np.array([[[0.0, 0.18, 1.0, 0.3]]])
    np.testing.assert_array_equal(displayed(linear), [[[0, 118, 255]]])
    np.testing.assert_array_equal(displayed(linear, exposure=1.0)[0, 0], displayed(2.0 * linear)[0, 0])


def test_pictures_stand_in_rows_as_they_are(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    pictures = [(f"({letter})", rng.integers(0, 256, (30, 80, 3), dtype=np.uint8)) for letter in "abcd"]
    path = write_sheet(tmp_path / "sheet.png", pictures, 2, caption="All four.")
    with Image.open(path) as image:
        values = np.asarray(image)
    # 8 pixels around, 20 for a line of text below each and for the caption.
    assert values.shape == (8 + 2 * (30 + 20 + 8) + 20, 8 + 2 * (80 + 8), 3)
    for number, (_, picture) in enumerate(pictures):
        row, column = divmod(number, 2)
        y, x = 8 + 58 * row, 8 + 88 * column
        np.testing.assert_array_equal(values[y : y + 30, x : x + 80], picture)
        # Its letter is below it.
        assert values[y + 30 : y + 50, x : x + 80].min() < 128


def test_pixels_can_be_repeated(tmp_path: Path) -> None:
    picture = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    with Image.open(write_sheet(tmp_path / "s.png", [("", picture)], 1, zoom=3)) as image:
        values = np.asarray(image)
    np.testing.assert_array_equal(values[8:20:3, 8:20:3], picture)


def test_a_cut_is_a_share_of_the_picture() -> None:
    picture = np.arange(200).reshape(10, 20)
    np.testing.assert_array_equal(cut(picture, (0.5, 0.1, 1.0, 0.3)), picture[1:3, 10:20])


def test_numbers_stand_to_the_right() -> None:
    assert markdown_table(("a", "b"), [("x", 1), ("y", 2.5)]) == (
        "| a | b |\n|---|---:|\n| x | 1 |\n| y | 2.5 |"
    )
