"""1983, figure 8: a textured cube and three glass spheres before a mirror, an instant and an exposure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .comparison import by_parts, compare, parts_table, seen, side_by_side
from .workshop import Drawing, Figure, Workshop

CUBE, SPHERES, MIRROR = 1, (2, 3, 4), 5
"""Object indices in the scene."""

_REFERENCE_SAMPLES = 384


def _draw(workshop: Workshop) -> Drawing:
    compared = compare(workshop, "mirror", lens=False, shutter=True, reference_samples=_REFERENCE_SAMPLES)
    drawing = side_by_side(
        workshop,
        "motion_8",
        compared,
        what="1983, figure 8: the instantaneous picture, and the shutter open for one frame while cube and "
        "spheres move, each along its own path. In ours what the mirror shows, and the shadows, stay as they "
        "are at the instant.",
    )
    # Where no moving object comes in the way during the exposure, ours shows what it showed at the instant.
    untouched = (compared.sharp == compared.ours).all(axis=2)
    mirror = seen(compared.samples, MIRROR)
    spheres = [seen(compared.samples, index) for index in SPHERES]
    near = by_parts(
        compared,
        {
            "Whole picture": np.ones_like(mirror),
            "Cube, where it is at the instant": seen(compared.samples, CUBE),
            "Spheres, where they are at the instant": np.any(spheres, axis=0),
            "Mirror, where nothing comes before it": mirror & untouched,
            "All but the mirror": ~mirror,
        },
    )
    unchanged = float(untouched[mirror].mean())
    numbers = {**drawing.numbers, "parts_db": near, "share_of_mirror_unchanged": unchanged}
    return replace(
        drawing, numbers=numbers, table=parts_table(near, {"sharp": "instantaneous", "ours": "ours"})
    )


FIGURES = (Figure("motion_8", "1983, figure 8", _draw),)
