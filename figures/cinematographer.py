"""The cinematographer's list of TOG 1982, section 1: focus pull, uniform defocus, fade in and out.

Three animations of one sequence of samples files, each made by one command of `process`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy import ndimage

from potmesil_addon import cli, exr
from potmesil_addon.frames import frame_path
from potmesil_addon.samples import Samples

from .comparison import seen
from .sheet import STYLE, displayed, write_plot
from .workshop import Drawing, Figure, Picture, Workshop

if TYPE_CHECKING:
    import bpy

SCENE = "cube_and_sphere_moving"
FRAMES = 24
THINGS = {"Cube": 1, "Sphere": 2, "Background": 3}
"""What is looked at, by its pass index."""

_SHOWN_FRAMES = (1, 5, 10, 14, 19, 24)
_FRAMES_PER_SECOND = 12
_HALF_SIZE = 50
_RIM = 3
"""Pixels of an outline that are left out where sharpness is measured."""


@dataclass(frozen=True, slots=True)
class Shot:
    """An animation.

    Parameters
    ----------
    name : str
        Of its files.
    title : str
        What it is called.
    options : tuple of str
        Options of `process` that make it.
    """

    name: str
    title: str
    options: tuple[str, ...]


SHOTS = (
    Shot("pull", "Focus pull", ("--fstop", "5.6", "--focus-distance", "1=0.29,4=0.29,13=0.55,22=0.98")),
    Shot("defocus", "Uniform defocus", ("--fstop", "22", "--uniform-defocus", "1=0,4=0,24=1.5")),
    Shot("fade", "Fade in and out", ("--fstop", "11", "--fade", "1=0,8=1,17=1,24=0")),
)


def draw(workshop: Workshop) -> Drawing:
    """Draw six frames of each animation, and what is measured in all; the animations lie beside it."""
    template = _sequence(workshop)
    folder = workshop.folder / "cinematographer"
    films = {shot.name: _shoot(shot, template, folder) for shot in SHOTS}
    masks = regions(exr.read_samples(frame_path(template, 1)))
    sharp = {name: sharpness(film, masks) for name, film in films.items()}
    light = [float(picture[..., :3].mean()) for picture in films["fade"]]
    numbers = {
        "commands": [" ".join(_command(shot, Path("shot.####.exr"), Path("out"))) for shot in SHOTS],
        "sharpness": {
            name: {thing: values.tolist() for thing, values in curves.items()}
            for name, curves in sharp.items()
        },
        "light_of_fade": light,
    }
    path = _strips(workshop.path("cinematographer"), films, sharp, light)
    return Drawing(path, numbers, extra=(_animation(workshop.folder / "cinematographer.webp", films),))


def regions(samples: Samples) -> dict[str, npt.NDArray[np.bool_]]:
    """Return where each thing is seen, without its outline.

    Parameters
    ----------
    samples : Samples
        With object indices.

    Returns
    -------
    dict of str to ndarray of bool of shape (rows, columns)
        One mask a thing.
    """
    return {
        name: ndimage.binary_erosion(seen(samples, number), iterations=_RIM, border_value=1)
        for name, number in THINGS.items()
    }


def sharpness(
    film: list[Picture], masks: dict[str, npt.NDArray[np.bool_]]
) -> dict[str, npt.NDArray[np.float64]]:
    """Return how much fine detail each thing shows in each frame, relative to its sharpest frame.

    Parameters
    ----------
    film : list of ndarray of shape (rows, columns, channels)
        Frames, scene-linear.
    masks : dict of str to ndarray of bool
        Where each thing is.

    Returns
    -------
    dict of str to ndarray of float64 of shape (frames,)
        The mean size of the Laplacian within the mask, its largest value 1.
    """
    details = [np.abs(ndimage.laplace(picture[..., :3].mean(axis=2, dtype=np.float64))) for picture in film]
    curves = {name: np.array([detail[mask].mean() for detail in details]) for name, mask in masks.items()}
    return {name: values / values.max() for name, values in curves.items()}


def _slowly(scene: bpy.types.Scene) -> None:
    """Let everything move in all frames as far as it did in one, and render what the lens needs."""
    for item in scene.objects:
        for curve in item.animation_data.drivers if item.animation_data else ():
            curve.driver.expression = curve.driver.expression.replace("frame - 1", f"(frame - 1) / {FRAMES}")
    scene.potmesil_camera.use_motion = False
    # The papers' samples end where the picture does.
    scene.potmesil_camera.use_overscan = False


def _sequence(workshop: Workshop) -> Path:
    """Render the sequence of samples files, and return its template."""
    # Half the size: an animation is shown small.
    smaller = Workshop(workshop.folder, workshop.percentage * _HALF_SIZE // 100, workshop.samples)
    for frame in range(1, FRAMES + 1):
        path = smaller.rendered_path(f"shot.{frame:04d}", SCENE, prepare=_slowly, frame=frame)
    return path.with_name(path.name.replace(f".{FRAMES:04d}.", ".####."))


def _command(shot: Shot, template: Path, folder: Path) -> list[str]:
    """Return the words of the command that makes an animation."""
    target = folder / f"{shot.name}.####.exr"
    return ["process", str(template), "-o", str(target), "--no-motion", "--visibility", "none", *shot.options]


def _shoot(shot: Shot, template: Path, folder: Path) -> list[Picture]:
    """Run the command of an animation, and return its frames."""
    words = [*_command(shot, template, folder), "--frames", f"1-{FRAMES}"]
    if cli.main(words) != 0:
        raise RuntimeError(f"The command failed: {' '.join(words)}")
    target = folder / f"{shot.name}.####.exr"
    return [exr.read_samples(frame_path(target, frame)).layers[0].color for frame in range(1, FRAMES + 1)]


def _strips(
    path: Path,
    films: dict[str, list[Picture]],
    sharp: dict[str, dict[str, npt.NDArray[np.float64]]],
    light: list[float],
) -> Path:
    frames = np.arange(1, FRAMES + 1)
    with mpl.rc_context(STYLE):
        plot = plt.figure(figsize=(10.5, 6.1))
        grid = plot.add_gridspec(
            len(SHOTS),
            len(_SHOWN_FRAMES) + 1,
            width_ratios=[1.0] * len(_SHOWN_FRAMES) + [1.9],
            wspace=0.06,
            hspace=0.5,
        )
        for row, shot in enumerate(SHOTS):
            for column, frame in enumerate(_SHOWN_FRAMES):
                axes = plot.add_subplot(grid[row, column])
                axes.imshow(displayed(films[shot.name][frame - 1]), interpolation="lanczos")
                axes.set_axis_off()
                axes.set_title(shot.title if column == 0 else "", loc="left", fontweight="bold")
                axes.text(0.5, -0.04, f"{frame}", transform=axes.transAxes, ha="center", va="top", fontsize=8)
            axes = plot.add_subplot(grid[row, -1])
            axes.set_position(axes.get_position().translated(0.045, 0.0))
            if shot.name == "fade":
                axes.plot(frames, np.array(light) / max(light), color="black", label="Light")
            else:
                for thing, values in sharp[shot.name].items():
                    axes.plot(frames, values, label=thing)
            axes.set_ylim(0.0, 1.08)
            axes.set_title(
                "Share of light" if shot.name == "fade" else "Fine detail, of its most", loc="left"
            )
            axes.set_xticks(_SHOWN_FRAMES)
            if shot.name == "defocus":
                axes.legend(loc="upper right")
        axes.set_xlabel("Frame")
        write_plot(path, plot)
        plt.close(plot)
    return path


def _animation(path: Path, films: dict[str, list[Picture]]) -> Path:
    """Write the animations beside each other as one WebP file."""
    frames = [
        Image.fromarray(np.concatenate([displayed(film[number]) for film in films.values()], axis=1))
        for number in range(FRAMES)
    ]
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=1000 // _FRAMES_PER_SECOND, loop=0, quality=75
    )
    return path


FIGURES = (Figure("cinematographer", "TOG 1982, section 1", draw),)
