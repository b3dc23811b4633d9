"""Figures go into the documentation: small pictures in the fitting format, tables between their marks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from figures.catalogue import FIGURES
from figures.publish import publish
from figures.workshop import Drawing

ROOT = Path(__file__).resolve().parents[2]


def drawn(folder: Path, *, photographic: bool) -> Path:
    """Save a picture with many colours or with two."""
    down, across = np.mgrid[0:300, 0:2000]
    values = np.stack([down % 256, across % 256, (down + across) % 256], axis=2).astype(np.uint8)
    if not photographic:
        values = np.where(values[..., :1] > 127, 255, 0).astype(np.uint8).repeat(3, axis=2)
    path = folder / "drawn.png"
    Image.fromarray(values).save(path)
    return path


@pytest.mark.parametrize(("photographic", "name"), [(True, "a.jpg"), (False, "a.png")])
def test_plots_stay_png_and_photographs_become_jpeg(tmp_path: Path, photographic: bool, name: str) -> None:
    drawing = Drawing(drawn(tmp_path, photographic=photographic), {})
    publish("a", drawing, tmp_path / "docs")
    (written,) = (tmp_path / "docs" / "images" / "figures").iterdir()
    assert written.name == name
    with Image.open(written) as image:
        assert image.size == (1400, 210)


def test_a_table_goes_between_its_marks(tmp_path: Path) -> None:
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    page.write_text("before\n<!-- a:begin -->\nold\n<!-- a:end -->\n<!-- b:begin -->\nkept\n<!-- b:end -->\n")
    drawing = Drawing(drawn(tmp_path, photographic=False), {}, table="| new |")
    assert page in publish("a", drawing, tmp_path / "docs")
    text = "before\n<!-- a:begin -->\n| new |\n<!-- a:end -->\n<!-- b:begin -->\nkept\n<!-- b:end -->\n"
    assert page.read_text() == text


def test_every_figure_is_in_the_documentation() -> None:
    pages = "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md"))
    missing = [
        figure.name
        for figure in FIGURES
        if f"images/figures/{figure.name}.png" not in pages
        and f"images/figures/{figure.name}.jpg" not in pages
    ]
    assert missing == []
    for picture in (ROOT / "docs" / "images" / "figures").iterdir():
        assert f"images/figures/{picture.name}" in pages
        assert picture.stat().st_size < 600_000
