"""How far a picture is from a reference: PSNR, SSIM and FLIP, over all of it and inside a region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import flip_evaluator
import numpy as np
import numpy.typing as npt
from scipy import ndimage

Picture = npt.NDArray[np.float32]
Region = npt.NDArray[np.bool_]

_SSIM_SIGMA = 1.5
_SSIM_K1, _SSIM_K2 = 0.01, 0.03

_VISIBLE = 1.0 / 255.0
_SPECK = 12
_MARGIN = 3


@dataclass(frozen=True, slots=True)
class Likeness:
    """How like a reference a picture is.

    Parameters
    ----------
    psnr : float
        Peak signal-to-noise ratio in dB of the picture as displayed; ``inf`` for the same picture.
    linear_psnr : float
        The same of the scene-linear values as they are, against a peak of 1.
    ssim : float
        Mean structural similarity as displayed, 1 for the same picture.
    flip : float
        Mean FLIP error as displayed, 0 for the same picture.
    """

    psnr: float
    linear_psnr: float
    ssim: float
    flip: float

    def to_json(self) -> dict[str, float | None]:
        """Return the values, with None for infinity."""
        return {name: value if np.isfinite(value) else None for name, value in asdict(self).items()}


def displayed(linear: npt.NDArray[Any]) -> Picture:
    """Return scene-linear values as they are displayed: clipped to 0..1 and sRGB-encoded.

    Parameters
    ----------
    linear : ndarray
        Scene-linear values.

    Returns
    -------
    ndarray of float32
        From 0 to 1.
    """
    x = np.clip(linear, 0.0, 1.0).astype(np.float64)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055).astype(np.float32)


def psnr(reference: Picture, picture: Picture, region: Region | None = None) -> float:
    """Return the peak signal-to-noise ratio in dB against a peak of 1.

    Parameters
    ----------
    reference, picture : ndarray of shape (rows, columns, 3)
        Displayed or linear.
    region : ndarray of bool of shape (rows, columns), optional
        Where to compare.

    Returns
    -------
    float
        ``inf`` where both are the same.
    """
    square = (reference.astype(np.float64) - picture) ** 2
    error = float(np.mean(square if region is None else square[region]))
    return float("inf") if error == 0.0 else -10.0 * float(np.log10(error))


def ssim_map(reference: Picture, picture: Picture) -> npt.NDArray[np.float64]:
    """Return the structural similarity (Wang et al. 2004) about each pixel, the mean of its channels.

    Parameters
    ----------
    reference, picture : ndarray of shape (rows, columns, 3)
        Displayed.

    Returns
    -------
    ndarray of float64 of shape (rows, columns)
        With the paper's Gaussian window of 1.5 pixels.
    """
    a, b = reference.astype(np.float64), picture.astype(np.float64)

    def mean(x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return ndimage.gaussian_filter(x, (_SSIM_SIGMA, _SSIM_SIGMA, 0.0), truncate=3.5)

    mean_a, mean_b = mean(a), mean(b)
    spread_a = mean(a * a) - mean_a**2
    spread_b = mean(b * b) - mean_b**2
    shared = mean(a * b) - mean_a * mean_b
    c1, c2 = _SSIM_K1**2, _SSIM_K2**2
    similarity = (2.0 * mean_a * mean_b + c1) * (2.0 * shared + c2)
    similarity /= (mean_a**2 + mean_b**2 + c1) * (spread_a + spread_b + c2)
    return np.asarray(similarity.mean(axis=2))


def flip_map(reference: Picture, picture: Picture) -> Picture:
    """Return the FLIP error (Andersson et al. 2020) of each pixel at its own default viewing distance.

    Parameters
    ----------
    reference, picture : ndarray of shape (rows, columns, 3)
        Displayed.

    Returns
    -------
    ndarray of float32 of shape (rows, columns)
        From 0 to 1.
    """
    error, _, _ = flip_evaluator.evaluate(
        np.ascontiguousarray(reference), np.ascontiguousarray(picture), "LDR", applyMagma=False
    )
    return np.asarray(error, dtype=np.float32).reshape(reference.shape[0], reference.shape[1], -1)[..., 0]


def compare(reference: Picture, picture: Picture, region: Region) -> tuple[Likeness, Likeness]:
    """Compare a picture with a reference.

    Parameters
    ----------
    reference, picture : ndarray of float32 of shape (rows, columns, 3)
        Scene-linear.
    region : ndarray of bool of shape (rows, columns)
        What is looked at by itself.

    Returns
    -------
    Likeness, Likeness
        Over the whole picture, and inside the region.
    """
    found = compare_regions(reference, picture, {"frame": None, "region": region})
    return found["frame"], found["region"]


def compare_regions(
    reference: Picture, picture: Picture, regions: Mapping[str, Region | None]
) -> dict[str, Likeness]:
    """Compare a picture with a reference in several regions.

    Parameters
    ----------
    reference, picture : ndarray of float32 of shape (rows, columns, 3)
        Scene-linear.
    regions : mapping of str to ndarray of bool of shape (rows, columns)
        By name; None is the whole picture.

    Returns
    -------
    dict of str to Likeness
        In each.
    """
    shown_reference, shown = displayed(reference), displayed(picture)
    similarity = ssim_map(shown_reference, shown)
    error = flip_map(shown_reference, shown)
    everywhere = np.ones(similarity.shape, dtype=bool)

    def within(where: Region | None) -> Likeness:
        chosen = everywhere if where is None else where
        return Likeness(
            psnr(shown_reference, shown, where),
            psnr(reference, picture, where),
            float(similarity[chosen].mean()),
            float(error[chosen].mean()),
        )

    return {name: within(where) for name, where in regions.items()}


def moving_region(sharp: Picture, first: Picture, second: Picture) -> Region:
    """Return where motion changes a picture, and a few pixels round it.

    Parameters
    ----------
    sharp : ndarray of float32 of shape (rows, columns, 3)
        Scene-linear, without motion blur.
    first, second : ndarray of float32 of shape (rows, columns, 3)
        Two references with independent noise.

    Returns
    -------
    ndarray of bool of shape (rows, columns)
        Where the difference is more than 1/255 as displayed and more than their noise.
    """
    mean = displayed(0.5 * (first + second))
    change = np.abs(mean - displayed(sharp)).max(axis=2)
    noise = np.abs(displayed(first) - displayed(second)).max(axis=2)
    changed = change > _VISIBLE + 3.0 * ndimage.gaussian_filter(noise, 2.0)
    labels, count = ndimage.label(changed, structure=np.ones((3, 3)))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    return np.asarray(ndimage.binary_dilation(sizes[labels] >= _SPECK, iterations=_MARGIN))
