"""TOG 1982, figures 15 and 16: an earthenware and a glass carafe, pinhole, ours and Cycles' own lens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from potmesil_addon.process import ProcessSettings

from .comparison import by_parts, compare, parts_table, seen, side_by_side
from .workshop import Drawing, Figure, Workshop, processed

CARAFE = 1
"""The carafe's object index in both scenes."""

_SECTION = (0.19, 0.19, 0.81, 0.81)


def _draw(workshop: Workshop, name: str, scene_name: str, what: str) -> Drawing:
    compared = compare(workshop, scene_name)
    drawing = side_by_side(workshop, name, compared, box=_SECTION, what=what)
    carafe = seen(compared.samples, CARAFE)
    parts = by_parts(
        compared,
        {"Whole picture": np.ones_like(carafe), "Carafe": carafe, "All but the carafe": ~carafe},
        {"default": processed(compared.samples, ProcessSettings(use_motion=False)).picture},
    )
    names = {"sharp": "pinhole", "ours": "ours, as the papers", "default": "ours, by default"}
    return replace(drawing, numbers={**drawing.numbers, "parts_db": parts}, table=parts_table(parts, names))


def _draw_opaque(workshop: Workshop) -> Drawing:
    return _draw(
        workshop,
        "tog_15",
        "carafe",
        "TOG 1982, figure 15: 40 mm lens, f/1.4, focused on the carafe at 1252 mm, 110 mm depth of field, "
        "tiles of 50 x 50 mm; a section of 512 x 512 pixels. Ours has the floor's reflection in the belly as "
        "sharp as the belly itself, and the carafe's on the floor as blurred as the floor there.",
    )


def _draw_transparent(workshop: Workshop) -> Drawing:
    return _draw(
        workshop,
        "tog_16",
        "carafe_glass",
        "TOG 1982, figure 16: the same in glass. Ours has the floor seen through the carafe as sharp as the "
        "glass before it.",
    )


FIGURES = (
    Figure("tog_15", "TOG 1982, figure 15", _draw_opaque),
    Figure("tog_16", "TOG 1982, figure 16", _draw_transparent),
)
