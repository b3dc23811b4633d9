"""Put figures into the documentation: small pictures, and tables between their marks."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from PIL import Image

from .workshop import Drawing

_DOCS = Path(__file__).resolve().parent.parent / "docs"
_WIDTH = 1400
_JPEG_QUALITY = 86
_COLORS_OF_A_PLOT = 10_000
"""More colours than this, and a picture is a photograph rather than a plot."""


def publish(name: str, drawing: Drawing, docs: Path = _DOCS) -> list[Path]:
    """Write a figure's picture and table into the documentation.

    Parameters
    ----------
    name : str
        The figure's name. A page may hold ``<!-- NAME:begin -->`` and ``<!-- NAME:end -->`` around its table.
    drawing : Drawing
        The figure.
    docs : Path
        The documentation's folder.

    Returns
    -------
    list of Path
        What was written. Pictures are ``images/figures/NAME.png`` for plots and ``NAME.jpg`` for others.
    """
    folder = docs / "images" / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for old in (folder / f"{name}.png", folder / f"{name}.jpg"):
        old.unlink(missing_ok=True)
    with Image.open(drawing.path) as opened:
        image = opened.convert("RGB")
    photographic = image.getcolors(_COLORS_OF_A_PLOT) is None
    if image.width > _WIDTH:
        image = image.resize((_WIDTH, round(image.height * _WIDTH / image.width)), Image.Resampling.LANCZOS)
    written = []
    if photographic:
        written.append(folder / f"{name}.jpg")
        image.save(written[-1], quality=_JPEG_QUALITY, subsampling=0, optimize=True)
    else:
        written.append(folder / f"{name}.png")
        image.quantize(256, dither=Image.Dither.NONE).save(written[-1], optimize=True)
    for other in drawing.extra:
        written.append(folder / other.name)
        shutil.copyfile(other, written[-1])
    if drawing.table:
        written += _insert(name, drawing.table, docs)
    return written


def _insert(name: str, table: str, docs: Path) -> list[Path]:
    """Put a table between its marks on every page that has them; return the pages that changed."""
    marks = re.compile(rf"(<!-- {re.escape(name)}:begin -->\n).*?(<!-- {re.escape(name)}:end -->)", re.DOTALL)
    changed = []
    for page in sorted(docs.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        new = marks.sub(lambda found: f"{found[1]}{table}\n{found[2]}", text)
        if new != text:
            page.write_text(new, encoding="utf-8")
            changed.append(page)
    return changed
