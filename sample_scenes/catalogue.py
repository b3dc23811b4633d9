"""All scenes by name, each with the file that it is saved to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from . import carafe, cube_and_sphere, magnet, mirror, night_street, rendering, still_life, wheels

FOLDER = Path(__file__).resolve().parent


@dataclass(frozen=True, slots=True)
class SampleScene:
    """A scene that a script builds.

    Parameters
    ----------
    build : callable
        Replaces Blender's current file by the scene and returns it, at the size and with the samples that
        it is meant for.
    purpose : str
        What it shows.
    options : dict
        Arguments of `build`.
    saved : bool
        Whether it has a .blend file.
    """

    build: Callable[..., bpy.types.Scene]
    purpose: str
    options: dict[str, Any] = field(default_factory=dict)
    saved: bool = True

    def open(self, *, percentage: int = 100, samples: int | None = None) -> bpy.types.Scene:
        """Build the scene, smaller or with other samples where asked.

        Parameters
        ----------
        percentage : int
            Of the picture's size.
        samples : int, optional
            Cycles' samples a pixel.

        Returns
        -------
        Scene
            The scene.
        """
        scene = self.build(**self.options)
        scene.render.resolution_percentage = percentage
        if samples is not None:
            scene.cycles.samples = samples
        return scene


SCENES: dict[str, SampleScene] = {
    "cube_and_sphere": SampleScene(cube_and_sphere.build, "TOG 1982, figures 11 to 14"),
    "cube_and_sphere_moving": SampleScene(
        cube_and_sphere.build, "the same with both in motion", {"moving": True}, saved=False
    ),
    "carafe": SampleScene(carafe.build, "TOG 1982, figure 15"),
    "carafe_glass": SampleScene(carafe.build, "TOG 1982, figure 16", {"transparent": True}),
    "magnet": SampleScene(magnet.build, "1983, figure 7"),
    "mirror": SampleScene(mirror.build, "1983, figure 8"),
    "night_street": SampleScene(night_street.build, "highlights far out of focus"),
    "still_life": SampleScene(still_life.build, "a macro lens and a near foreground"),
    "wheels": SampleScene(wheels.build, "a fast action, the camera going along"),
}


def file_of(name: str) -> Path:
    """Return the .blend file of a scene."""
    return FOLDER / f"{name}.blend"


def save(name: str, path: Path) -> None:
    """Build a scene and save it, compressed and with everything packed, the extension's settings with it.

    Parameters
    ----------
    name : str
        One of `SCENES`.
    path : Path
        The .blend file. Files of Blender 4.5 open in every later one.
    """
    rendering.extension()
    SCENES[name].open()
    _forget_folders()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, copy=True)


def _forget_folders() -> None:
    """Let the file browsers in the screens begin beside the .blend file, and not in someone's home folder."""
    for screen in bpy.data.screens:
        for space in (space for area in screen.areas for space in area.spaces):
            if space.type == "FILE_BROWSER" and space.params is not None:
                space.params.directory = b"//"
