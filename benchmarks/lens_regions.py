"""Where a lens' blur is difficult, by the samples' depths and colours alone and without a reference."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage

Region = npt.NDArray[np.bool_]

REGIONS: Final = {
    "near": "Near foreground: as far as blurred silhouettes before the focus reach",
    "edge": "Focus edges: as far as the blur beside silhouettes in focus reaches",
    "highlights": "Highlights: as far as the circles of samples brighter than 4 reach",
}
"""Names and what they are."""

_SHARP = 1.0
"""Radius in pixels of the circle of what counts as in focus."""

_BLURRED = 0.5
"""Radius in pixels of what counts as blurred."""

_STEP = 1.0
"""Difference of radii in pixels, of neighbours, that is a silhouette."""

_BRIGHT = 4.0

_RIM = 1.0
"""Pixels that the pixel filter adds to every reach."""


def regions(
    radius: npt.NDArray[np.floating], color: npt.NDArray[np.floating], least: int = 100
) -> dict[str, Region]:
    """Return the regions that a picture has.

    Parameters
    ----------
    radius : ndarray of shape (rows, columns)
        Radii of circles of confusion in pixels, negative before the focus.
    color : ndarray of shape (rows, columns, channels)
        Scene-linear.
    least : int
        Smaller regions, in pixels, are left out.

    Returns
    -------
    dict of str to ndarray of bool
        By the names of `REGIONS`.
    """
    size = np.abs(radius)
    farthest = ndimage.maximum_filter(radius, size=3, mode="nearest")
    # A silhouette is where a pixel has a neighbour that lies behind it: what slants has small steps.
    silhouette = farthest - radius > _STEP
    near = reached(silhouette & (radius < -_BLURRED), size)
    edge = reached(silhouette & (size <= _SHARP), np.maximum(np.abs(farthest), size))
    highlights = reached(color[..., :3].max(axis=2) > _BRIGHT, size)
    found = {"near": near, "edge": edge, "highlights": highlights}
    return {name: region for name, region in found.items() if np.count_nonzero(region) >= least}


def reached(where: Region, radius: npt.NDArray[np.floating]) -> Region:
    """Return the union of discs around pixels, each of its own radius and a rim.

    Parameters
    ----------
    where : ndarray of bool of shape (rows, columns)
        The pixels.
    radius : ndarray of shape (rows, columns)
        Radii in pixels.

    Returns
    -------
    ndarray of bool of shape (rows, columns)
        What the discs cover.
    """
    covered = np.zeros(where.shape, dtype=bool)
    # Whole pixels, rounded up: one distance transform for all discs of a size.
    whole = np.ceil(radius).astype(int)
    for size in np.unique(whole[where]):
        distance = ndimage.distance_transform_edt(~(where & (whole == size)))
        covered |= distance <= size + _RIM
    return covered
