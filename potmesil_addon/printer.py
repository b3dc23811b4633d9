"""What an optical printer does to the finished picture: uniform defocus and fades (TOG 1982, section 1).

Both act on the film that the camera exposed and not on the scene, so depth plays no part: the whole
picture is imaged through one space-invariant point-spread function, and gets a share of its light.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from .camera import Film
from .lens import Lens
from .psf import PsfBuilder, TableAssignment
from .samples import Float32Array
from .scatter import Backend, Scatter, scatter


def defocus_evenly(
    picture: Float32Array, film: Film, circle: float, aperture: Lens, backend: Backend = "auto"
) -> Generator[float, None, Float32Array]:
    """Image every pixel as the same circle of confusion.

    At the picture's border the light that would leave it is given back by renormalisation, as the focus
    processor does (TOG 1982, eq. 22).

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear.
    film : Film
        The picture on the film.
    circle : float
        Diameter of the circle in metres on the film, 0 or more.
    aperture : Lens
        Gives the circle its shape: blades, their rotation, the anamorphic ratio.
    backend : {"auto", "numba", "numpy"}
        Implementation.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        The blurred picture.
    """
    builder = PsfBuilder(aperture, film)
    circles = np.array([circle])
    shape = (1, *picture.shape[:2])
    work = Scatter(
        color=picture[np.newaxis],
        weight=np.ones(shape, dtype=np.float32),
        assignment=TableAssignment(circles, np.zeros(shape, dtype=np.int32), None),
        tables=builder.pack(list(builder.tables(circles))),
        origin=(0, 0),
        shape=shape[1:],
    )
    blurred = np.zeros_like(picture)
    yield from scatter(work, blurred, backend=backend)
    return blurred


def fade(picture: Float32Array, share: float) -> Float32Array:
    """Expose the picture to a share of its light.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear.
    share : float
        0 is black, 1 the picture itself. Linear in light, as a fading shutter's opening is.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        The picture with the same alpha.
    """
    return np.asarray(picture * np.array([share, share, share, 1.0]), dtype=np.float32)
