"""Scenes of today: what the papers' camera does for pictures as they are made now."""

from __future__ import annotations

from functools import partial

from .comparison import compare, side_by_side
from .workshop import Drawing, Figure, Workshop

_REFERENCE_SAMPLES = 96
"""Denoised, as these scenes are."""


def _draw(workshop: Workshop, *, scene: str, lens: bool, what: str) -> Drawing:
    compared = compare(
        workshop,
        scene,
        lens=lens,
        shutter=not lens,
        papers=False,
        reference_samples=_REFERENCE_SAMPLES,
    )
    return side_by_side(workshop, scene, compared, columns=1, what=what)


FIGURES = (
    Figure(
        "night_street",
        "Scene: night street",
        partial(_draw, scene="night_street", lens=True, what="65 mm at f/1.8, focused on the robot's eyes."),
    ),
    Figure(
        "still_life",
        "Scene: still life",
        partial(_draw, scene="still_life", lens=True, what="100 mm at f/4, focused on the balance's jewel."),
    ),
    Figure(
        "wheels",
        "Scene: wheels",
        partial(_draw, scene="wheels", lens=False, what="The shutter is open for half a frame."),
    ),
)
