"""1983, figure 8: a textured cube and three glass spheres before a mirror, an instant and an exposure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from potmesil_addon.process import ProcessSettings

from .comparison import nearness, nearness_table, seen, side_by_side
from .workshop import Drawing, Figure, Workshop, processed

CUBE, SPHERES, MIRROR = 1, (2, 3, 4), 5
"""Object indices in the scene."""

_REFERENCE_SAMPLES = 384


def _draw(workshop: Workshop) -> Drawing:
    drawing = side_by_side(
        workshop,
        "motion_8",
        "mirror",
        lens=False,
        shutter=True,
        reference_samples=_REFERENCE_SAMPLES,
        what="1983, figure 8: the instantaneous picture, and the shutter open for one frame while cube and "
        "spheres move, each along its own path. In ours what the mirror shows, and the shadows, stay as they "
        "are at the instant.",
    )
    samples = workshop.rendered("mirror", "mirror")
    still = processed(samples, ProcessSettings(use_lens=False, use_motion=False)).picture
    ours = processed(samples, ProcessSettings(use_lens=False)).picture
    # Where no moving object comes in the way during the exposure, ours shows what it showed at the instant.
    untouched = (still == ours).all(axis=2)
    mirror = seen(samples, MIRROR)
    parts = {
        "Whole picture": np.ones_like(mirror),
        "Cube, where it is at the instant": seen(samples, CUBE),
        "Spheres, where they are at the instant": np.any([seen(samples, index) for index in SPHERES], axis=0),
        "Mirror, where nothing comes before it": mirror & untouched,
        "All but the mirror": ~mirror,
    }
    reference = workshop.cycles("mirror-cycles", "mirror", shutter=True, samples=_REFERENCE_SAMPLES)
    near = nearness(parts, reference, pinhole=still, ours=ours)
    table = nearness_table(near, ("instantaneous", "ours"))
    unchanged = float(untouched[mirror].mean())
    numbers = {**drawing.numbers, "parts_db": near, "share_of_mirror_unchanged": unchanged}
    return replace(drawing, numbers=numbers, table=table)


FIGURES = (Figure("motion_8", "1983, figure 8", _draw),)
