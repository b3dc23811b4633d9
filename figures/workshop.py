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
from potmesil_addon.process import ProcessSettings, Result, process
from potmesil_addon.progress import run
from potmesil_addon.samples import Samples

if TYPE_CHECKING:
    import bpy

    from sample_scenes.catalogue import SampleScene

Picture = npt.NDArray[np.float32]

_EXPORT = Path(__file__).resolve().parent.parent / "operators"
"""What makes samples files: they are rendered again when it changes."""

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
    extra : tuple of Path
        Other files that the documentation shows, such as an animation.
    """

    path: Path
    numbers: dict[str, Any]
    table: str = ""
    extra: tuple[Path, ...] = ()


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
        texts = [path.read_text(encoding="utf-8") for path in sorted(_EXPORT.glob("*.py"))]
        texts += [
            inspect.getsource(item) if inspect.ismodule(item) or callable(item) else repr(item)
            for item in (*sources, self.percentage, self.samples)
        ]
        text = "\n".join(texts)
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
        """Return the samples of a scene, rendered once; see `rendered_path`."""
        return exr.read_samples(self.rendered_path(name, scene_name, prepare=prepare))

    def rendered_path(
        self,
        name: str,
        scene_name: str,
        *,
        prepare: Callable[[bpy.types.Scene], None] | None = None,
        frame: int | None = None,
    ) -> Path:
        """Return the samples file of a scene, rendered once.

        Parameters
        ----------
        name : str
            Of the samples file, without its ending.
        scene_name : str
            A name in the catalogue of scenes.
        prepare : callable, optional
            Changes the scene before it is rendered.
        frame : int, optional
            In place of the scene's current one. The name has to say which it is.

        Returns
        -------
        Path
            The file.
        """
        # Figures without scenes need no Blender.
        from sample_scenes import building, catalogue, rendering  # noqa: PLC0415

        item = catalogue.SCENES[scene_name]

        def make(path: Path) -> None:
            rendering.extension()
            scene = item.open(percentage=self.percentage, samples=self.samples)
            if prepare is not None:
                prepare(scene)
            if frame is not None:
                scene.frame_set(frame)
            rendering.render_samples(scene, path)

        return self.cached(f"{name}.exr", make, building, *_sources(item), prepare)

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

        sources = (building, *_sources(item), prepare, lens, shutter, count)
        return rendering.read_picture(self.cached(f"{name}.exr", make, *sources))


def _sources(item: SampleScene) -> list[Any]:
    """Return what a scene depends on: its module, those of scenes that it takes things from, its options."""
    module = inspect.getmodule(item.build)
    assert module is not None
    used = {inspect.getmodule(value) for value in vars(module).values() if callable(value)}
    package = module.__name__.rpartition(".")[0]
    own = [other for other in used if other is not None and other.__name__.startswith(f"{package}.")]
    return [module, *sorted(own, key=lambda other: other.__name__), item.options]


def processed(samples: Samples, settings: ProcessSettings) -> Result:
    """Run both processors to their end."""
    return run(process(samples, settings))
