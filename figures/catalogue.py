"""All figures in the papers' order."""

from __future__ import annotations

from . import (
    aperture_cost,
    carafe,
    cascade,
    cinematographer,
    demo,
    depth_of_field,
    diffraction,
    effects,
    lens_law,
    magnet,
    mirror,
    psf_tables,
    today,
    uniform_blur,
)
from .workshop import Figure

FIGURES: tuple[Figure, ...] = (
    *demo.FIGURES,
    *lens_law.FIGURES,
    *diffraction.FIGURES,
    *psf_tables.FIGURES,
    *depth_of_field.FIGURES,
    *carafe.FIGURES,
    *aperture_cost.FIGURES,
    *cinematographer.FIGURES,
    *uniform_blur.FIGURES,
    *cascade.FIGURES,
    *magnet.FIGURES,
    *mirror.FIGURES,
    *today.FIGURES,
    *effects.FIGURES,
)
