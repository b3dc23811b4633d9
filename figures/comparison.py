"""The sharp picture, ours and Cycles' own beside each other, with how near ours comes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from potmesil_addon.process import ProcessSettings
from potmesil_addon.samples import Samples
from potmesil_addon.sheets import on_display

from .sheet import cut, displayed, markdown_table, write_sheet
from .workshop import Drawing, Picture, Workshop, processed

if TYPE_CHECKING:
    import bpy

WHOLE = (0.0, 0.0, 1.0, 1.0)


def psnr(first: Picture, second: Picture) -> float:
    """Return the peak signal-to-noise ratio of two pictures as they are displayed.

    Parameters
    ----------
    first, second : ndarray of float32 of shape (rows, columns, channels)
        Scene-linear; more than three channels are dropped.

    Returns
    -------
    float
        Decibels; infinity for equal pictures.
    """
    difference = displayed(first).astype(np.float64) - displayed(second)
    error = float(np.mean(difference * difference))
    return math.inf if error == 0.0 else 10.0 * math.log10(255.0**2 / error)


def seen(samples: Samples, object_index: int) -> npt.NDArray[np.bool_]:
    """Return where a picture shows an object and nothing else.

    Parameters
    ----------
    samples : Samples
        A samples file with object indices.
    object_index : int
        The object's pass index.

    Returns
    -------
    ndarray of bool of shape (rows, columns)
        The display window in final pixels; true where all samples of a pixel are the object's.
    """
    index = samples.layers[0].object_index
    assert index is not None
    shown = on_display(samples, (index == object_index).astype(np.float32)) == 1.0
    factor = samples.supersampling
    rows, columns = shown.shape
    return shown.reshape(rows // factor, factor, columns // factor, factor).all(axis=(1, 3))


@dataclass(frozen=True, slots=True)
class Compared:
    """A scene three times.

    Parameters
    ----------
    samples : Samples
        What ours is made from.
    sharp : ndarray of float32 of shape (rows, columns, 4)
        The samples without any blur.
    ours : ndarray of float32 of shape (rows, columns, 4)
        By our processors.
    reference : ndarray of float32 of shape (rows, columns, 3)
        Cycles' own depth of field or motion blur.
    lens : bool
        Whether with depth of field; otherwise it is motion blur alone.
    """

    samples: Samples
    sharp: Picture
    ours: Picture
    reference: Picture
    lens: bool


def compare(
    workshop: Workshop,
    scene_name: str,
    *,
    lens: bool = True,
    shutter: bool = False,
    papers: bool = True,
    reference_samples: int = 256,
) -> Compared:
    """Render a scene for us and with Cycles' own blur, and process it.

    Parameters
    ----------
    workshop : Workshop
        Where and how large.
    scene_name : str
        A scene in the catalogue, whose camera has the lens and whose shutter is the scene's.
    lens, shutter : bool
        Whether with depth of field and with motion blur.
    papers : bool
        Whether ours is the papers' model: samples that end where the picture does, the light of all added
        whatever hides them (TOG 1982, eq. 22), finer ones averaged. Otherwise it is what the extension does
        unless it is told.
    reference_samples : int
        Cycles' samples a pixel of the reference.

    Returns
    -------
    Compared
        The pictures.
    """

    def prepare(scene: bpy.types.Scene) -> None:
        own = scene.potmesil_camera
        own.use_lens, own.use_motion = lens, shutter
        if papers and lens:
            own.use_overscan = False

    samples = workshop.rendered(f"{scene_name}-papers" if papers else scene_name, scene_name, prepare=prepare)
    settings = ProcessSettings(use_lens=lens, use_motion=shutter, visibility="none" if papers else "aperture")
    averaged = replace(samples, pixel_filter=None) if papers else samples
    return Compared(
        samples,
        processed(averaged, ProcessSettings(use_lens=False, use_motion=False)).picture,
        processed(averaged, settings).picture,
        workshop.cycles(
            f"{scene_name}-cycles", scene_name, lens=lens, shutter=shutter, samples=reference_samples
        ),
        lens,
    )


def side_by_side(
    workshop: Workshop,
    name: str,
    compared: Compared,
    *,
    box: tuple[float, float, float, float] = WHOLE,
    columns: int = 3,
    what: str = "",
) -> Drawing:
    """Draw a scene three times: without blur, by our processors, and by Cycles.

    Parameters
    ----------
    workshop : Workshop
        Where.
    name : str
        The figure's name.
    compared : Compared
        The pictures.
    box : tuple of float
        Part of them that is shown, as shares of their size.
    columns : int
        Pictures in a row.
    what : str
        Begin of the caption.

    Returns
    -------
    Drawing
        The sheet. ``numbers`` has the PSNR of ours and of the sharp picture against Cycles' own, in dB.
    """
    sharp, ours = (psnr(picture, compared.reference) for picture in (compared.sharp, compared.ours))
    title = "Pinhole" if compared.lens else "Instantaneous"
    near = f"Ours is {ours:.1f} dB from Cycles, the {title.lower()} picture {sharp:.1f} dB."
    pictures = [(title, compared.sharp), ("Ours", compared.ours), ("Cycles' own", compared.reference)]
    path = write_sheet(
        workshop.path(name),
        [(text, displayed(cut(picture, box))) for text, picture in pictures],
        columns,
        caption=f"{what} {near}".strip(),
    )
    return Drawing(path, {"ours_db": ours, "sharp_db": sharp})


def by_parts(
    compared: Compared,
    parts: Mapping[str, npt.NDArray[np.bool_]],
    others: Mapping[str, Picture] | None = None,
) -> dict[str, dict[str, float]]:
    """Return how near the sharp picture and ours come to Cycles' own in parts of the picture.

    Parameters
    ----------
    compared : Compared
        The pictures.
    parts : mapping of str to ndarray of bool of shape (rows, columns)
        The parts by name.
    others : mapping of str to ndarray of float32 of shape (rows, columns, channels), optional
        Other pictures of the same scene, by name.

    Returns
    -------
    dict of str to dict of str to float
        PSNR in decibels by part and picture, ``sharp``, ``ours`` and the others.
    """
    pictures = {"sharp": compared.sharp, "ours": compared.ours, **(others or {})}
    return {
        part: {
            name: psnr(picture[mask][np.newaxis], compared.reference[mask][np.newaxis])
            for name, picture in pictures.items()
        }
        for part, mask in parts.items()
    }


def parts_table(numbers: Mapping[str, Mapping[str, float]], names: Mapping[str, str]) -> str:
    """Return a table of what `by_parts` returns.

    Parameters
    ----------
    numbers : mapping of str to mapping of str to float
        PSNR by part and picture.
    names : mapping of str to str
        The pictures' names, as columns in this order, and what stands above each.

    Returns
    -------
    str
        Markdown.
    """
    rows = [(part, *(f"{value[name]:.1f}" for name in names)) for part, value in numbers.items()]
    return markdown_table(("PSNR against Cycles' own, dB", *names.values()), rows)
