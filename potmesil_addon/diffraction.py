"""Diffraction at a round aperture: the Airy pattern and Lommel's intensity I(u, v) out of focus.

`u` measures the defocus and `v` the distance from the axis (TOG 1982, eqs. 16 to 19); both are
dimensionless. The intensity is that of the focus's centre, I(0, 0) = 1: the papers' I0 differs between
1981 and 1982 and cancels in every use.

Outside the geometric shadow edge (v > u) the U series of TOG 1982, eqs. 14 and 15, is used, inside it
the V series with its cosine and sine terms (Born and Wolf, Principles of Optics, 8.8.1), since the U
series loses all digits there. Both are summed by one backward recurrence over the Bessel orders, so no
term overflows and the cost is proportional to v.

Accuracy: below 1e-11 of the profile's own peak (not only of I(0, 0)) up to u = 200 pi, below 1e-9 up
to u = 5000 at any v; measured against quadrature of the diffraction integral.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import special

from . import jit
from .lens import FloatArray, Lens, image_distance

_SMALL_U: Final = 1e-3
"""Where both u and v are below this, the Taylor series is exact to 1e-13."""

_SMALL_V: Final = 1e-6
"""Below this, J0 = 1 and J1 = v / 2 are exact enough and the recurrence would overflow."""

_TINY: Final = 1e-250
"""Where Miller's recurrence starts: any number, small enough to grow from."""

_RESCALE_ABOVE: Final = 1e200
_RESCALE_BY: Final = 1e-200


def airy(v: npt.ArrayLike) -> FloatArray:
    """Return the Airy pattern (2 J1(v) / v)^2 (TOG 1982, eq. 13).

    Parameters
    ----------
    v : array_like
        Optical distance from the axis, any shape and sign.

    Returns
    -------
    ndarray of float64
        Intensity, 1 at v = 0, same shape.
    """
    v = np.asarray(v, dtype=np.float64)
    safe = np.where(v == 0.0, 1.0, v)
    return np.where(v == 0.0, 1.0, (2.0 * special.j1(safe) / safe) ** 2)


def lommel_intensity(u: npt.ArrayLike, v: npt.ArrayLike) -> FloatArray:
    """Return the intensity I(u, v) in the image of a point out of focus (TOG 1982, eq. 14).

    It equals the squared modulus of the diffraction integral::

        2 * integral from 0 to 1 of J0(v p) exp(-i u p^2 / 2) p dp

    Parameters
    ----------
    u : array_like
        Optical defocus, any shape that broadcasts with `v`; only its magnitude matters.
    v : array_like
        Optical distance from the axis; only its magnitude matters.

    Returns
    -------
    ndarray of float64
        Intensity relative to I(0, 0), of the broadcast shape, 0 or more. NaN where an input is NaN.
    """
    u, v = np.broadcast_arrays(np.abs(np.asarray(u, np.float64)), np.abs(np.asarray(v, np.float64)))
    evaluate = _lommel_compiled if jit.HAVE_NUMBA else _lommel_numpy
    return evaluate(u.flatten(), v.flatten()).reshape(u.shape)


def axial_intensity(u: npt.ArrayLike) -> FloatArray:
    """Return I(u, 0) = (sin(u/4) / (u/4))^2 (TOG 1982, eq. 20), zero at u = 4 pi m.

    Parameters
    ----------
    u : array_like
        Optical defocus, any shape.

    Returns
    -------
    ndarray of float64
        Intensity relative to I(0, 0), same shape.
    """
    return np.asarray(np.sinc(np.asarray(u, dtype=np.float64) / (4.0 * math.pi)) ** 2)


def optical_defocus(depth: npt.ArrayLike, lens: Lens, wavelength: float) -> FloatArray:
    """Return u = k (d/2F)^2 (V_P - V_D) as the papers have it (TOG 1982, eq. 18).

    The papers put the focal length for the image distance, which makes u larger by about
    (1 + magnification)^2.

    Parameters
    ----------
    depth : array_like
        Distances P of the points in metres, any shape; ``inf`` is valid.
    lens : Lens
        The focused lens.
    wavelength : float
        Wavelength in metres.

    Returns
    -------
    ndarray of float64
        u, positive for points nearer than the plane in focus (they converge behind the film).
    """
    half_angle = 0.5 / lens.f_stop
    shift = image_distance(depth, lens.focal_length) - image_distance(lens.focus_distance, lens.focal_length)
    with np.errstate(over="ignore"):
        return np.asarray(2.0 * math.pi / wavelength * half_angle * half_angle * shift)


def optical_radius(radius: npt.ArrayLike, lens: Lens, wavelength: float) -> FloatArray:
    """Return v = k (d/2F) r (TOG 1982, eq. 17).

    Parameters
    ----------
    radius : array_like
        Distances r from the axis on the image plane in metres, any shape.
    lens : Lens
        The lens; its focus distance does not matter.
    wavelength : float
        Wavelength in metres.

    Returns
    -------
    ndarray of float64
        v, same shape.
    """
    r = np.asarray(radius, dtype=np.float64)
    with np.errstate(over="ignore"):
        return np.asarray(2.0 * math.pi / wavelength * (0.5 / lens.f_stop) * r)


def _lommel_numpy(u: FloatArray, v: FloatArray) -> FloatArray:
    """Return I(u, v) for flat arrays of magnitudes, all orders of all points in numpy."""
    result = np.full(u.shape, np.nan)
    result[(np.isinf(u) & ~np.isnan(v)) | (np.isinf(v) & ~np.isnan(u))] = 0.0
    index = np.flatnonzero(np.isfinite(u) & np.isfinite(v))
    # In falling order of v the points whose recurrence has begun are always the first ones.
    index = index[np.argsort(-v[index], kind="stable")]
    u, v = u[index], v[index]
    recurring = int(np.count_nonzero(v >= _SMALL_V))
    inside = v < u
    ratio = np.divide(np.minimum(u, v), np.maximum(u, v), out=np.zeros_like(u), where=(u + v) > 0.0)
    square = ratio**2
    even, odd, total, above, current = np.zeros((5, u.size))
    even_tail = np.zeros(u.size)
    first = np.array([_first_order(x) for x in v[:recurring]], dtype=np.int64)
    active = 0
    for k in range(int(first[0]) if recurring else -1, -1, -1):
        begun = int(np.searchsorted(-first, -k, side="right"))
        current[active:begun] = _TINY
        active = begun
        now = slice(0, active)
        if k % 2 == 0:
            even_tail[now] = even[now]
            even[now] = current[now] - square[now] * even[now]
            total[now] += current[now] * (1.0 if k == 0 else 2.0)
        else:
            odd[now] = current[now] - square[now] * odd[now]
        below = k * (2.0 / v[now]) * current[now] - above[now]
        above[now] = current[now]
        current[now] = below
        large = np.flatnonzero(np.abs(below) > _RESCALE_ABOVE)
        for term in (current, above, even, even_tail, odd, total):
            term[large] *= _RESCALE_BY
    for term in (even, even_tail, odd):
        term[:recurring] /= total[:recurring]
    even[recurring:], even_tail[recurring:], odd[recurring:] = 1.0, 0.0, 0.5 * v[recurring:]
    with np.errstate(divide="ignore", invalid="ignore"):
        phase = 0.5 * (u + v * ratio)
        v_series = 4.0 * ((even - np.cos(phase)) ** 2 + (ratio * odd - np.sin(phase)) ** 2) / u**2
        u_series = 4.0 * (odd**2 + (ratio * even_tail) ** 2) / v**2
    intensity = np.where(inside, v_series, u_series)
    small = (u < _SMALL_U) & (v < _SMALL_U)
    result[index] = np.where(small, 1.0 - 0.25 * v**2 - u**2 / 48.0, intensity)
    return result


@jit.kernel()
def _first_order(v: float) -> int:
    """Return an order from which Miller's backward recurrence for J_k(v) is exact to double precision."""
    return int(v + 12.0 * v ** (1.0 / 3.0)) + 30


@jit.kernel()
def _lommel_point(u: float, v: float) -> float:
    """Return I(u, v) for one point with u, v >= 0."""
    if math.isnan(u) or math.isnan(v):
        return math.nan
    if math.isinf(u) or math.isinf(v):
        return 0.0
    if u < _SMALL_U and v < _SMALL_U:
        return 1.0 - 0.25 * v * v - u * u / 48.0
    inside = v < u
    ratio = v / u if inside else u / v
    square = ratio * ratio
    # Going down in k, `current` is J_k and `above` J_(k+1), both times one unknown factor. `even` and
    # `odd` are Horner's sums of (-1)^s ratio^(2s) J_(k+2s) down to k = 0 and 1, `even_tail` down to
    # k = 2. `total` collects J_0 + 2 (J_2 + J_4 + ...), which is 1 and so gives the factor.
    even = 1.0
    even_tail = 0.0
    odd = 0.5 * v
    if v >= _SMALL_V:
        even = 0.0
        odd = 0.0
        total = 0.0
        above = 0.0
        current = _TINY
        inverse = 2.0 / v
        for k in range(_first_order(v), -1, -1):
            if k % 2 == 0:
                even_tail = even
                even = current - square * even
                total += current if k == 0 else 2.0 * current
            else:
                odd = current - square * odd
            below = k * inverse * current - above
            above = current
            current = below
            if abs(current) > _RESCALE_ABOVE:
                current *= _RESCALE_BY
                above *= _RESCALE_BY
                even *= _RESCALE_BY
                even_tail *= _RESCALE_BY
                odd *= _RESCALE_BY
                total *= _RESCALE_BY
        even /= total
        even_tail /= total
        odd /= total
    if inside:
        # V0 = even and V1 = ratio * odd. The sum 1 + V0^2 + V1^2 - 2 V0 cos - 2 V1 sin of Born and Wolf
        # is written as two squares, which keeps its digits where it is small.
        phase = 0.5 * (u + v * ratio)
        a = even - math.cos(phase)
        b = ratio * odd - math.sin(phase)
        return 4.0 * (a * a + b * b) / (u * u)
    # U1 = ratio * odd and U2 = ratio^2 * even_tail; a ratio cancels against the 2/u before them.
    b = ratio * even_tail
    return 4.0 * (odd * odd + b * b) / (v * v)


@jit.kernel(parallel=True)
def _lommel_compiled(u: FloatArray, v: FloatArray) -> FloatArray:
    """Return I(u, v) for flat arrays of magnitudes, point by point."""
    result = np.empty(u.size)
    for i in jit.prange(u.size):
        result[i] = _lommel_point(u[i], v[i])
    return result
