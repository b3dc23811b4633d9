"""The picture that the documentation opens with: one scene at four apertures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from potmesil_addon.process import ProcessSettings
from potmesil_addon.samples import LensAttributes

from .sheet import cut, displayed, write_sheet
from .workshop import Drawing, Figure, Workshop, processed

if TYPE_CHECKING:
    import bpy

SCENE = "cube_and_sphere"
F_STOPS = (5.6, 11.0, 22.0)

_PART = (0.03, 0.09, 0.91, 0.97)
"""What is shown: a little left of and below the middle, where the sphere and the cube are."""


def _fine(scene: bpy.types.Scene) -> None:
    """Ask for the samples that the demo has."""
    scene.potmesil_camera.sampling = "FINE"
    scene.potmesil_camera.use_motion = False


def draw(workshop: Workshop) -> Drawing:
    """Draw the pinhole picture and three f-stops, all from one samples file."""
    samples = workshop.rendered(SCENE, SCENE, prepare=_fine)
    settings = {"Pinhole": ProcessSettings(use_lens=False, use_motion=False)}
    for f_stop in F_STOPS:
        lens = LensAttributes(f_stop=f_stop)
        settings[f"f/{f_stop:g}"] = ProcessSettings(use_motion=False, lens=lens)
    pictures = [
        (text, displayed(cut(processed(samples, each).picture, _PART))) for text, each in settings.items()
    ]
    return Drawing(write_sheet(workshop.path("demo"), pictures, 2), {})


FIGURES = (Figure("demo", "The demo scene", draw),)
