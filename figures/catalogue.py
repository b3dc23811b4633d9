"""All figures in the papers' order."""

from __future__ import annotations

from .workshop import Figure

FIGURES: tuple[Figure, ...] = ()
