"""What film and sensor do to the light that reaches them: exposure, an emulsion's grain, a sensor's noise."""

from __future__ import annotations

import functools
import math
from typing import Final

import numpy as np
from scipy import fft

from .camera import Film
from .effects import Color, Exposure, FilmGrain, SensorNoise
from .errors import SettingsError
from .lens import FloatArray
from .samples import Float32Array

_GRANULARITY_APERTURE: Final = 48e-6
"""Diameter in metres of the disc over which RMS granularity is measured."""

_MANY: Final = 1000.0
"""Mean of a Poisson distribution from which it is taken for a normal one; its skewness is then 0.03."""

_MOST_DEVIATION: Final = 0.5
"""Most that density deviates from pixel to pixel."""

_TOO_BRIGHT: Final = 1e30
"""Light from which its electrons are more than single precision has."""

_BAND: Final = 128
"""Rows at a time: random numbers in double precision would be the most memory of all."""


def exposure_factor(exposure: Exposure, f_stop: float, exposure_time: float) -> Color:
    """Return by how much a picture is brightened (TOG 1982, section 3.2: "would be simple to add").

    The exposure value of f-stop n, exposure time t and film speed S is log2(n^2 / t) - log2(S / 100).
    A picture is as it is where that equals `normal_ev`.

    Parameters
    ----------
    exposure : Exposure
        Film speed, filters, and the exposure value that changes nothing.
    f_stop : float
        Aperture number, greater than 0.
    exposure_time : float
        In seconds, greater than 0.

    Returns
    -------
    tuple of float
        Factors for red, green and blue, 0 or more.

    Raises
    ------
    SettingsError
        If the f-stop or the time is not positive and finite.
    """
    for name, value in (("f-stop", f_stop), ("exposure time", exposure_time)):
        if not (math.isfinite(value) and value > 0.0):
            raise SettingsError(f"To expose the picture the {name} must be greater than 0, not {value:g}.")
    value = math.log2(f_stop * f_stop / exposure_time) - math.log2(exposure.sensitivity / 100.0)
    gain = 2.0 ** (exposure.normal_ev - value - exposure.density)
    red, green, blue = (gain * share for share in exposure.tint)
    return red, green, blue


def add_noise(picture: Float32Array, noise: SensorNoise, sensitivity: float, frame: int) -> Float32Array:
    """Return a picture as a sensor counts it: photons come by chance, and charge is read out with an error.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear. White, 1, is `full_well` electrons at ISO 100 and fewer at others.
    noise : SensorNoise
        Full well, read-out noise and seed.
    sensitivity : float
        ISO speed.
    frame : int
        Number of the frame; the same frame always has the same noise.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        With the same alpha. Values may be negative, so that the mean of dark parts is kept. What is clear
        film is not read out: a picture to lay over another has noise where it has something.
    """
    electrons = noise.full_well * 100.0 / sensitivity
    random = _generator(noise.seed, frame)
    noisy = picture.copy()
    for first in range(0, picture.shape[0], _BAND):
        band = noisy[first : first + _BAND]
        # What is too bright to count stays as it is.
        countable = np.abs(band[..., :3]) < _TOO_BRIGHT
        mean = np.where(countable, band[..., :3], np.float32(0.0)) * electrons
        # Light below 0, which a filter may leave, has no photons to count.
        counted = np.maximum(mean, 0.0)
        spread = random.standard_normal(mean.shape, dtype=np.float32) * np.sqrt(counted)
        few = counted < _MANY
        spread[few] = random.poisson(counted[few]) - counted[few]
        read = random.standard_normal(mean.shape, dtype=np.float32) * np.float32(noise.read_noise)
        counted = (mean + spread + read * band[..., 3:]) / electrons
        np.copyto(band[..., :3], counted, where=countable)
    return noisy


def add_grain(picture: Float32Array, grain: FilmGrain, film: Film, frame: int) -> Float32Array:
    """Return a picture on film: its density varies by the grains of silver, or clouds of dye, that make it.

    Grain is a Gaussian field of density, smooth over a grain, that has the deviation of the RMS granularity
    over a disc of 48 um. Over areas larger than a grain deviation times the square root of the area is
    constant (Selwyn's law).

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied and scene-linear.
    grain : FilmGrain
        Granularity, size, share of colour, and seed.
    film : Film
        The picture's pixels on the film.
    frame : int
        Number of the frame; the same frame always has the same grain.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 4)
        With the same alpha, and the same mean wherever it is even.
    """
    if grain.granularity == 0.0:
        return picture
    rows, columns = picture.shape[:2]
    transfer, deviation = _grain_filter(rows, columns, film.pitch_x, film.pitch_y, grain.size)
    scale = grain.granularity / 1000.0
    # Of a density that varies by more from pixel to pixel hardly any would let light through.
    scale = min(scale, _MOST_DEVIATION / deviation)
    random = _generator(grain.seed, frame)

    def field() -> Float32Array:
        white = random.standard_normal((rows, columns), dtype=np.float32)
        return np.asarray(fft.irfft2(fft.rfft2(white, workers=-1) * transfer, (rows, columns), workers=-1))

    common = field() if grain.color < 1.0 else None
    grainy = picture.copy()
    # The mean of 10^-D of a normal density D is 10^(ln 10 var / 2).
    mean = math.log(10.0) * (scale * deviation) ** 2 / 2.0
    for primary in range(3):
        density = np.float32(0.0) if common is None else common * np.float32(math.sqrt(1.0 - grain.color))
        if grain.color > 0.0:
            density = density + field() * np.float32(math.sqrt(grain.color))
        grainy[..., primary] *= np.power(np.float32(10.0), np.float32(-scale) * density - np.float32(mean))
    return grainy


@functools.lru_cache(maxsize=2)
def _grain_filter(
    rows: int, columns: int, pitch_x: float, pitch_y: float, size: float
) -> tuple[Float32Array, float]:
    """Return what makes white noise the density of grain of granularity 1000, and its deviation in a pixel.

    The density's spectrum is that of Gaussian grains as large in moment as discs of the diameter `size`, seen
    through pixels. Frequencies are those of the periodic picture, and aliased ones are added to theirs, so
    that pixels larger than a grain see all of its power.
    """
    power = np.zeros((rows, columns // 2 + 1))
    sigma = 0.25 * size
    along, across = fft.fftfreq(rows) / pitch_y, fft.rfftfreq(columns) / pitch_x
    # Past the third deviation of the grain's own spectrum nothing is left.
    most_x, most_y = (
        math.ceil(min(3.0 / (2.0 * math.pi * sigma) * p + 0.5, 16.0)) for p in (pitch_x, pitch_y)
    )
    part_x = _seen_power(across, pitch_x, sigma, most_x)
    part_y = _seen_power(along, pitch_y, sigma, most_y)
    power = part_y[:, np.newaxis] * part_x
    # A white field of one number in each pixel has the power pitch_x pitch_y; what the granularity's disc
    # leaves of the grain's own spectrum sets the level.
    level = 1.0 / _through_disc(sigma)
    power *= level / (pitch_x * pitch_y)
    # Of the columns that a real transform leaves out, each has its mirror image.
    twice = np.full(power.shape[1], 2.0)
    twice[0] = 1.0
    if columns % 2 == 0:
        twice[-1] = 1.0
    deviation = math.sqrt(float((power * twice).sum()) / (rows * columns))
    return np.sqrt(power).astype(np.float32), deviation


def _seen_power(frequency: FloatArray, pitch: float, sigma: float, most: int) -> FloatArray:
    """Return the power along an axis of Gaussian grain seen through pixels, with all that is aliased."""
    shifted = frequency + np.arange(-most, most + 1)[:, np.newaxis] / pitch
    grain = np.exp(-((2.0 * math.pi * sigma * shifted) ** 2))
    return np.asarray((grain * np.sinc(pitch * shifted) ** 2).sum(axis=0))


@functools.lru_cache(maxsize=8)
def _through_disc(sigma: float) -> float:
    """Return the variance over the granularity's disc of Gaussian grain of unit spectral density.

    The integral over frequencies of exp(-(2 pi sigma f)^2) (2 J1(pi d f) / (pi d f))^2: as the overlap of two
    discs at a distance, under the grain's own Gaussian covariance of variance 2 sigma^2.
    """
    radius = 0.5 * _GRANULARITY_APERTURE
    nodes, weights = np.polynomial.legendre.leggauss(200)
    reach = min(2.0 * radius, 12.0 * math.sqrt(2.0) * sigma)
    distance = 0.5 * reach * (nodes + 1.0)
    half = np.minimum(distance / (2.0 * radius), 1.0)
    overlap = (2.0 / math.pi) * (np.arccos(half) - half * np.sqrt(1.0 - half * half))
    covariance = np.exp(-(distance**2) / (4.0 * sigma**2)) / (4.0 * math.pi * sigma**2)
    mean = 2.0 * math.pi * distance * overlap * covariance / (math.pi * radius**2)
    # The covariance is that of the density; the variance of the mean is its mean over pairs of points.
    return float(0.5 * reach * (weights * mean).sum())


def _generator(seed: int, frame: int) -> np.random.Generator:
    """Return random numbers of a frame; frames before 0 have others than those after it."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, abs(frame), int(frame < 0)])))
