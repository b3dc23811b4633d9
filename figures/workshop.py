"""Where figures are made: how large, from which samples files, and kept where."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from potmesil_addon import exr
from potmesil_addon.process import ProcessSettings, Result, process, run
from potmesil_addon.samples import Samples

if TYPE_CHECKING:
    import bpy

Picture = npt.NDArray[np.float32]

_FINGERPRINT_LENGTH = 12


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure that was drawn.

    Parameters
    ----------
    path : Path
        Its picture, a PNG file.
    numbers : dict
        What was measured for it, ready for JSON.
    table : str
        Markdown for the documentation; may be empty.
    """

    path: Path
    numbers: dict[str, Any]
    table: str = ""


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure or a table that can be drawn.

    Parameters
    ----------
    name : str
        Of its files, and of its place in the documentation.
    title : str
        What it is.
    draw : callable
        Draws it in a workshop.
    """

    name: str
    title: str
    draw: Callable[[Workshop], Drawing]


@dataclass(frozen=True, slots=True)
class Workshop:
    """A folder for figures and for what they are made from.

    Parameters
    ----------
    folder : Path
        Receives ``NAME.png`` and has ``cache`` inside.
    percentage : int
        Size of rendered pictures; 100 is what the documentation shows.
    samples : int or None
        Cycles' samples a pixel in place of the scenes' own, also for references.
    """

    folder: Path
    percentage: int = 100
    samples: int | None = None

    def path(self, name: str) -> Path:
        """Return the path of a figure's picture."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder / f"{name}.png"

    def pixels(self, full: int) -> int:
        """Return a number of pixels at this workshop's size."""
        return max(8, full * self.percentage // 100)

    def cached(self, name: str, make: Callable[[Path], None], *sources: Any) -> Path:
        """Return a file, made once for as long as its sources stay as they are.

        Parameters
        ----------
        name : str
            The file's name, with its ending.
        make : callable
            Makes the file at a path.
        *sources
            Modules, functions and values that the file depends on.

        Returns
        -------
        Path
            The file.
        """
        text = "\n".join(
            inspect.getsource(item) if inspect.ismodule(item) or callable(item) else repr(item)
            for item in (*sources, self.percentage, self.samples)
        )
        mark = hashlib.sha256(text.encode()).hexdigest()[:_FINGERPRINT_LENGTH]
        stem, _, ending = name.partition(".")
        path = self.folder / "cache" / f"{stem}-{mark}.{ending}"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_name(f"part-{path.name}")
            make(part)
            part.replace(path)
        return path

    def rendered(
        self,
        name: str,
        scene_name: str,
        *,
        prepare: Callable[[bpy.types.Scene], None] | None = None,
    ) -> Samples:
        """Return the samples of a scene, rendered once.

        Parameters
        ----------
        name : str
            Of the samples file.
        scene_name : str
            A name in the catalogue of scenes.
        prepare : callable, optional
            Changes the scene before it is rendered, such as its frame.

        Returns
        -------
        Samples
            What the file holds.
        """
        # Figures without scenes need no Blender.
        from sample_scenes import building, catalogue, rendering  # noqa: PLC0415

        item = catalogue.SCENES[scene_name]

        def make(path: Path) -> None:
            rendering.extension()
            scene = item.open(percentage=self.percentage, samples=self.samples)
            if prepare is not None:
                prepare(scene)
            rendering.render_samples(scene, path)

        sources = (building, inspect.getmodule(item.build), item.options, prepare)
        return exr.read_samples(self.cached(f"{name}.exr", make, *sources))

    def cycles(
        self,
        name: str,
        scene_name: str,
        *,
        lens: bool = False,
        shutter: bool = False,
        samples: int | None = None,
        prepare: Callable[[bpy.types.Scene], None] | None = None,
    ) -> Picture:
        """Return a picture of Cycles' own, rendered once.

        Parameters
        ----------
        name : str
            Of the file.
        scene_name : str
            A name in the catalogue of scenes.
        lens, shutter : bool
            Whether with Cycles' own depth of field and motion blur.
        samples : int, optional
            Samples a pixel, where the workshop has none of its own.
        prepare : callable, optional
            Changes the scene before it is rendered.

        Returns
        -------
        ndarray of float32 of shape (rows, columns, 3)
            Scene-linear, row 0 on top.
        """
        from sample_scenes import building, catalogue, rendering  # noqa: PLC0415

        item = catalogue.SCENES[scene_name]
        count = samples if self.samples is None else self.samples

        def make(path: Path) -> None:
            scene = item.open(percentage=self.percentage, samples=self.samples)
            if prepare is not None:
                prepare(scene)
            picture = rendering.render_picture(scene, lens=lens, shutter=shutter, samples=count)
            opaque = np.ones((*picture.shape[:2], 1), dtype=np.float32)
            exr.write_picture(path, np.concatenate([picture, opaque], axis=2), {})

        sources = (building, inspect.getmodule(item.build), item.options, prepare, lens, shutter, count)
        return rendering.read_picture(self.cached(f"{name}.exr", make, *sources))


def processed(samples: Samples, settings: ProcessSettings) -> Result:
    """Run both processors to their end."""
    return run(process(samples, settings))
