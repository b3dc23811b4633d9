"""Even motion of a still picture, blurred through the frequency domain (1983, figure 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from scipy import fft

from potmesil_addon.lens import FloatArray
from potmesil_addon.motion_psf import ExposedPath, convolve, motion_psf, uniform_transfer
from sample_scenes import plumage

from .comparison import psnr
from .sheet import COLORS, STYLE, displayed, write_plot
from .workshop import Drawing, Figure, Workshop

SIDE: Final = 512
SHARE: Final = 16
"""Side of the picture over its displacement during the exposure."""

_DPI: Final = 150
_LUMINANCE: Final = (0.2126, 0.7152, 0.0722)
_FAINTEST: Final = 10.0**-5.7
"""Magnitude over the largest that is shown black."""


@dataclass(frozen=True, slots=True)
class UniformBlur:
    """A picture that moves evenly to the right during the exposure.

    Parameters
    ----------
    displacement : int
        a of 1983, eq. 3-14, in pixels.
    picture, blurred : ndarray of float64 of shape (rows, columns, 3)
        Scene-linear, before and after. What leaves on the right comes in on the left.
    across : ndarray of float64 of shape (columns,)
        Frequencies u in cycles per pixel, increasing, 0 in the middle.
    spectrum, product : ndarray of complex128 of shape (rows, columns)
        Transforms of the luminance, 0 in the middle: F and F H.
    """

    displacement: int
    picture: FloatArray
    blurred: FloatArray
    across: FloatArray
    spectrum: npt.NDArray[np.complex128]
    product: npt.NDArray[np.complex128]

    @property
    def zeros(self) -> FloatArray:
        """Frequencies u = m / a, m = 1, 2, .., at which nothing is left."""
        return np.arange(1, self.displacement // 2 + 1) / self.displacement

    def inside(self, picture: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """Return the square part of a picture that nothing has come into from the other side."""
        a = self.displacement
        return picture[a // 2 : picture.shape[0] - (a - a // 2), a:]


def uniform_blur(picture: FloatArray, displacement: int) -> UniformBlur:
    """Blur a picture by the product of its transform with that of even motion (1983, eqs. 3-12 and 3-14).

    Parameters
    ----------
    picture : ndarray of float64 of shape (rows, columns, 3)
        Scene-linear.
    displacement : int
        Pixels to the right during the exposure.

    Returns
    -------
    UniformBlur
        The blurred picture and both spectra.
    """
    transfer = uniform_transfer(fft.fftfreq(picture.shape[1]), displacement)
    spectra = fft.fft2(picture, axes=(0, 1))
    products = spectra * transfer[np.newaxis, :, np.newaxis]
    return UniformBlur(
        displacement,
        picture,
        fft.ifft2(products, axes=(0, 1)).real,
        fft.fftshift(fft.fftfreq(picture.shape[1])),
        fft.fftshift(spectra @ _LUMINANCE),
        fft.fftshift(products @ _LUMINANCE),
    )


def blurred_in_space(picture: FloatArray, displacement: int) -> npt.NDArray[np.float32]:
    """Blur a picture by the motion's table of pixels, as the motion processor does (1983, eq. 2-10).

    Parameters
    ----------
    picture : ndarray of float64 of shape (rows, columns, 3)
        Scene-linear.
    displacement : int
        Pixels to the right during the exposure.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        The blurred picture; black comes in on the left.
    """
    path = ExposedPath.polyline([(0.0, 0.0), (displacement, 0.0)], [1.0])
    return convolve(picture, motion_psf(path), "spatial")


def magnitude_over_v(spectrum: npt.NDArray[np.complex128]) -> FloatArray:
    """Return the root mean square over v of a spectrum's magnitude, for each u."""
    return np.asarray(np.sqrt(np.mean(np.abs(spectrum) ** 2, axis=0)))


def still_picture(workshop: Workshop) -> FloatArray:
    """Return the picture that stands for the paper's natural one, scene-linear."""
    side = SHARE * max(4, workshop.pixels(SIDE) // SHARE)

    def make(path: Path) -> None:
        with path.open("wb") as file:
            np.save(file, plumage.plumage(side))

    return _linear(np.load(workshop.cached("uniform_blur.npy", make, plumage, side)))


def draw_uniform_blur(workshop: Workshop) -> Drawing:
    """Draw the picture, its spectrum, the product with the transfer function, and the blurred picture."""
    picture = still_picture(workshop)
    a = picture.shape[1] // SHARE
    blur = uniform_blur(picture, a)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        plot = plt.figure(figsize=(8.6, 10.6))
        grid = plot.add_gridspec(3, 2, height_ratios=(1.0, 1.0, 0.5), hspace=0.2, wspace=0.14)
        _draw_picture(plot.add_subplot(grid[0, 0]), blur.inside(blur.picture), "(a) the picture")
        _draw_spectrum(plot.add_subplot(grid[0, 1]), blur, blur.spectrum, "(b) its spectrum")
        _draw_spectrum(plot.add_subplot(grid[1, 0]), blur, blur.product, "(c) times the transfer function")
        _draw_picture(plot.add_subplot(grid[1, 1]), blur.inside(blur.blurred), "(d) transformed back")
        _draw_magnitudes(plot.add_subplot(grid[2, :]), blur)
        path = write_plot(workshop.path("motion_4"), plot, dpi=workshop.pixels(_DPI))
        plt.close(plot)
    in_space = blur.inside(blurred_in_space(picture, a))
    inside = blur.inside(blur.blurred)
    numbers = {
        "displacement_pixels": a,
        "in_space_db": psnr(in_space, inside.astype(np.float32)),
        "brightness": float(blur.blurred.mean() / picture.mean()),
    }
    return Drawing(path, numbers)


def _linear(shown: FloatArray) -> FloatArray:
    """Return scene-linear values of display values (IEC 61966-2-1)."""
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def _draw_picture(axes: Axes, picture: npt.NDArray[np.floating], title: str) -> None:
    axes.imshow(displayed(picture), interpolation="lanczos")
    axes.axis("off")
    axes.set_title(title)


def _draw_spectrum(axes: Axes, blur: UniformBlur, spectrum: npt.NDArray[np.complex128], title: str) -> None:
    """Draw the logarithm of a spectrum's magnitude, on one scale for both."""
    largest = float(np.abs(blur.spectrum).max())
    levels = np.log10(np.maximum(np.abs(spectrum) / largest, _FAINTEST))
    axes.imshow(
        levels,
        cmap="gray",
        vmin=math.log10(_FAINTEST),
        vmax=-1.2,
        extent=(-0.5, 0.5, 0.5, -0.5),
        interpolation="antialiased",
    )
    ticks = [-0.5, -0.25, 0.0, 0.25, 0.5]
    axes.set_xticks(ticks)
    axes.set_yticks(ticks)
    axes.tick_params(labelsize=7)
    axes.set_title(f"{title}; u and v in cycles per pixel")


def _draw_magnitudes(axes: Axes, blur: UniformBlur) -> None:
    """Draw both spectra's magnitude over u, with the zeros of the transfer function."""
    positive = (blur.across > 0.0) & (blur.across <= 8.5 / blur.displacement)
    u = blur.across[positive]
    for spectrum, text in ((blur.spectrum, "(b)"), (blur.product, "(c)")):
        magnitude = magnitude_over_v(spectrum)[positive] / np.abs(blur.spectrum).max()
        axes.semilogy(u, np.maximum(magnitude, 1e-9), label=text, linewidth=1.1)
    axes.set_ylim(1e-7, 1e-1)
    for zero in blur.zeros[blur.zeros < u[-1]]:
        axes.axvline(zero, color=COLORS[5], linewidth=0.6, linestyle=":")
    ticks = [m / blur.displacement for m in range(9)]
    axes.set_xticks(ticks, ["0", "1/a", *(f"{m}/a" for m in range(2, 9))])
    axes.set(xlabel=f"u; a = {blur.displacement} pixels", ylabel="magnitude, mean over v", xlim=(0.0, u[-1]))
    axes.legend(loc="upper right", ncols=2)


FIGURES = (Figure("motion_4", "1983, figure 4: uniform motion blur", draw_uniform_blur),)
