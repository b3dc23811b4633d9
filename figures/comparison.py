"""Pinhole, ours and Cycles' own beside each other, with how near ours comes."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from potmesil_addon.process import ProcessSettings
from potmesil_addon.samples import Samples
from potmesil_addon.sheets import on_display

from .sheet import cut, displayed, markdown_table, write_sheet
from .workshop import Drawing, Picture, Workshop, processed

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


def nearness(
    where: dict[str, npt.NDArray[np.bool_]], reference: Picture, **pictures: Picture
) -> dict[str, dict[str, float]]:
    """Return how near pictures come to a reference in parts of it.

    Parameters
    ----------
    where : dict of str to ndarray of bool of shape (rows, columns)
        The parts.
    reference : ndarray of float32 of shape (rows, columns, channels)
        Scene-linear.
    **pictures
        Scene-linear pictures of the reference's size.

    Returns
    -------
    dict of str to dict of str to float
        PSNR in decibels by part and picture.
    """
    return {
        part: {
            name: psnr(picture[mask][np.newaxis], reference[mask][np.newaxis])
            for name, picture in pictures.items()
        }
        for part, mask in where.items()
    }


def nearness_table(numbers: dict[str, dict[str, float]], heads: tuple[str, str]) -> str:
    """Return a table of what `nearness` returns for the pictures "pinhole" and "ours"."""
    rows = [(part, f"{value['pinhole']:.1f}", f"{value['ours']:.1f}") for part, value in numbers.items()]
    return markdown_table(("PSNR against Cycles' own, dB", *heads), rows)


def side_by_side(
    workshop: Workshop,
    name: str,
    scene_name: str,
    *,
    lens: bool = True,
    shutter: bool = False,
    reference_samples: int = 256,
    settings: ProcessSettings | None = None,
    box: tuple[float, float, float, float] = WHOLE,
    columns: int = 3,
    what: str = "",
) -> Drawing:
    """Draw a scene three times: pinhole, by our processors, and by Cycles' own depth of field or motion blur.

    Parameters
    ----------
    workshop : Workshop
        Where and how large.
    name : str
        The figure's name.
    scene_name : str
        A scene in the catalogue, whose camera has the lens and whose shutter is the scene's.
    lens, shutter : bool
        Whether with depth of field and with motion blur.
    reference_samples : int
        Cycles' samples a pixel of the reference.
    settings : ProcessSettings, optional
        How the samples are processed otherwise.
    box : tuple of float
        Part of the picture that is shown, as shares of its size.
    columns : int
        Pictures in a row.
    what : str
        Begin of the caption.

    Returns
    -------
    Drawing
        The sheet. ``numbers`` has the PSNR of ours and of the pinhole picture against Cycles' own, in dB.
    """
    samples = workshop.rendered(scene_name, scene_name)
    pinhole = processed(samples, ProcessSettings(use_lens=False, use_motion=False)).picture
    if settings is None:
        settings = ProcessSettings(use_lens=lens, use_motion=shutter)
    ours = processed(samples, settings).picture
    reference = workshop.cycles(
        f"{scene_name}-cycles", scene_name, lens=lens, shutter=shutter, samples=reference_samples
    )
    numbers = {"ours_db": psnr(ours, reference), "pinhole_db": psnr(pinhole, reference)}
    sharp = "Pinhole" if lens else "Instantaneous"
    near = (
        f"{numbers['ours_db']:.1f} dB from Cycles, the {sharp.lower()} picture {numbers['pinhole_db']:.1f} dB"
    )
    pictures = [(sharp, pinhole), ("Ours", ours), ("Cycles' own", reference)]
    path = write_sheet(
        workshop.path(name),
        [(text, _shown(picture, box)) for text, picture in pictures],
        columns,
        caption=f"{what} Ours is {near}.".strip(),
    )
    return Drawing(path, numbers)


def _shown(picture: Picture, box: tuple[float, float, float, float]) -> npt.NDArray[np.uint8]:
    return displayed(cut(picture, box))
