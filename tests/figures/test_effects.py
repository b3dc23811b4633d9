"""Charts of the special effects: each effect has one, in the documentation too, that shows what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from figures import effects
from figures.workshop import Workshop
from potmesil_addon.effects import KINDS, Effects, Pupil, Vignetting

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_every_effect_has_its_chart_in_the_documentation() -> None:
    names = {figure.name for figure in effects.FIGURES}
    assert names == {f"effect_{kind}" for kind in KINDS} | {"effect_shutters"}
    text = (DOCS / "effects.md").read_text(encoding="utf-8")
    for name in names:
        (picture,) = (DOCS / "images" / "figures").glob(f"{name}.*")
        assert f"images/figures/{picture.name}" in text


def test_lights_through_the_focus_are_as_large_as_they_are_said() -> None:
    picture = effects.taken(effects.through(), Effects(pupil=Pupil(obstruction=0.5)))[..., 1].astype(float)
    lit = picture[37] > picture[0, 0] + 30
    for n, circle in enumerate((-45, -30, -15, 0, 15, 30, 45)):
        part = np.flatnonzero(lit[40 + 66 * n - 33 : 40 + 66 * n + 33])
        assert np.ptp(part) + 1 == pytest.approx(max(abs(circle), 1), abs=2)


def test_the_field_is_darker_to_the_corners() -> None:
    picture = effects.taken(effects.field(), Effects(vignetting=Vignetting(mechanical=0.4)))[..., 1].astype(
        float
    )
    assert picture[2, 2] < picture[ROW, COLUMN] - 3


ROW, COLUMN = effects.ROWS // 2 + 20, effects.COLUMNS // 2 + 3


@pytest.mark.parametrize("name", ["effect_exposure", "effect_shutters"])
def test_a_chart_is_drawn(name: str, tmp_path: Path) -> None:
    figure = next(figure for figure in effects.FIGURES if figure.name == name)
    drawing = figure.draw(Workshop(tmp_path))
    with Image.open(drawing.path) as picture:
        assert picture.width > 2 * effects.COLUMNS
    assert drawing.numbers
