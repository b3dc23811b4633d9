"""Diffraction at a round aperture: the Airy pattern and Lommel's intensity I(u, v) out of focus.

`u` measures the defocus and `v` the distance from the axis (TOG 1982, eqs. 16 to 19); both are
dimensionless. The intensity is that of the focus's centre, I(0, 0) = 1: the papers' I0 differs between
1981 and 1982 and cancels in every use.

Outside the geometric shadow edge (v > u) the U series of TOG 1982, eqs. 14 and 15, is used, inside it
the V series with its cosine and sine terms (Born and Wolf, Principles of Optics, 8.8.1), since the U
series loses all digits there. Away from the edge few orders of the Bessel functions count, and the
recurrence over the orders goes up from J0 and J1, as is stable below v. Near the edge, and where v is
small, it comes down from an order past v (Miller's), so no term overflows and the cost is proportional
to v.

Accuracy: below 1e-11 of the profile's own peak (not only of I(0, 0)) up to u = 200 pi, below 1e-9 up
to u = 5000 at any v; measured against quadrature of the diffraction integral.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy import special

from . import jit
from .lens import FloatArray, Lens, image_distance

_SMALL_U: Final = 1e-3
"""Where both u and v are below this, the Taylor series is exact to 1e-13."""

_SMALL_V: Final = 1e-6
"""Below this, J0 = 1 and J1 = v / 2 are exact enough and the recurrence would overflow."""

_DIGITS: Final = 32.0
"""Terms below exp(-32), 1e-14, of the first are left out."""

_LEAST_RISING: Final = 32.0
"""Where v is below this, the recurrence comes down: Hankel's expansion of J0 and J1 is for large v."""

_HANKEL: Final = tuple(
    tuple(
        math.prod((4 * order * order - (2 * j - 1) ** 2) / (8.0 * j) for j in range(1, k + 1))
        * (-1.0) ** (k // 2)
        for k in range(16)
    )
    for order in (0, 1)
)
"""Coefficients of Hankel's expansions of J0 and J1 in powers of 1 / v, to 1e-16 from v = 32 on."""

_LANES: Final = 16
"""Points that one call of the compiled kernel works out side by side, in a processor's vector unit."""

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
    """Return I(u, v) for flat arrays of magnitudes, all points of an order in numpy at once."""
    result = np.full(u.shape, np.nan)
    result[(np.isinf(u) & ~np.isnan(v)) | (np.isinf(v) & ~np.isnan(u))] = 0.0
    index = np.flatnonzero(np.isfinite(u) & np.isfinite(v))
    u, v = u[index], v[index]
    ratio = np.divide(np.minimum(u, v), np.maximum(u, v), out=np.zeros_like(u), where=(u + v) > 0.0)
    with np.errstate(divide="ignore"):
        orders = np.abs(_DIGITS / np.log(ratio))
    rising = (v >= _LEAST_RISING) & (orders <= v)
    even, odd, tail = np.ones_like(u), 0.5 * v, np.zeros_like(u)
    up, down = np.flatnonzero(rising), np.flatnonzero(~rising & (v >= _SMALL_V))
    even[up], odd[up], tail[up] = _rising_sums(v[up], ratio[up] ** 2, orders[up])
    even[down], odd[down], tail[down] = _falling_sums(v[down], ratio[down] ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        phase = 0.5 * (u + v * ratio)
        v_series = 4.0 * ((even - np.cos(phase)) ** 2 + (ratio * odd - np.sin(phase)) ** 2) / u**2
        u_series = 4.0 * (odd**2 + (ratio * tail) ** 2) / v**2
    intensity = np.where(v < u, v_series, u_series)
    small = (u < _SMALL_U) & (v < _SMALL_U)
    result[index] = np.where(small, 1.0 - 0.25 * v**2 - u**2 / 48.0, intensity)
    return result


def _rising_sums(
    v: FloatArray, square: FloatArray, orders: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the sums of `_rise` for points in flat arrays."""
    # With the most orders first, the points that are not done yet are always the first ones.
    ranks = np.argsort(-orders, kind="stable")
    v, square, orders = v[ranks], square[ranks], orders[ranks]
    below, current = special.j0(v), special.j1(v)
    even, odd, tail, power = below.copy(), current.copy(), np.zeros_like(v), np.ones_like(v)
    for k in range(1, math.ceil(orders.max(initial=0.0)), 2):
        now = slice(0, int(np.searchsorted(-orders, -k, side="left")))
        below[now] = k * (2.0 / v[now]) * current[now] - below[now]
        tail[now] += power[now] * below[now]
        current[now] = (k + 1) * (2.0 / v[now]) * below[now] - current[now]
        power[now] *= -square[now]
        odd[now] += power[now] * current[now]
    even -= square * tail
    back = np.argsort(ranks)
    return even[back], odd[back], tail[back]


def _falling_sums(v: FloatArray, square: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the sums of `_fall` for points in flat arrays."""
    # With the largest v first, the points whose recurrence has begun are always the first ones.
    ranks = np.argsort(-v, kind="stable")
    v, square = v[ranks], square[ranks]
    odd, tail, total, above, current = np.zeros((5, v.size))
    first = np.array([_first_order(x) for x in v.tolist()], dtype=np.int64)
    active = 0
    for k in range(int(first.max(initial=0)), 0, -2):
        begun = int(np.searchsorted(-first, -k, side="right"))
        current[active:begun] = _TINY
        active = begun
        now = slice(0, active)
        tail[now] = current[now] - square[now] * tail[now]
        total[now] += 2.0 * current[now]
        above[now] = k * (2.0 / v[now]) * current[now] - above[now]
        odd[now] = above[now] - square[now] * odd[now]
        current[now] = (k - 1) * (2.0 / v[now]) * above[now] - current[now]
        large = np.flatnonzero(np.abs(current[now]) > _RESCALE_ABOVE)
        for term in (odd, tail, total, above, current):
            term[large] *= _RESCALE_BY
    total += current
    back = np.argsort(ranks)
    even = (current - square * tail) / total
    return even[back], (odd / total)[back], (tail / total)[back]


@jit.kernel()
def _first_order(v: float) -> int:
    """Return an even order from which Miller's recurrence for J_k(v) is exact to double precision."""
    return 2 * (int(v + 12.0 * v ** (1.0 / 3.0)) // 2 + 15)


@jit.kernel()
def _hankel(v: float) -> tuple[float, float]:
    """Return J0(v) and J1(v) for large v by Hankel's asymptotic expansion."""
    inverse = 1.0 / v
    square = inverse * inverse
    p_0, q_0, p_1, q_1 = 0.0, 0.0, 0.0, 0.0
    for k in range(14, -1, -2):
        p_0 = _HANKEL[0][k] + square * p_0
        q_0 = _HANKEL[0][k + 1] + square * q_0
        p_1 = _HANKEL[1][k] + square * p_1
        q_1 = _HANKEL[1][k + 1] + square * q_1
    sine, cosine = math.sin(v), math.cos(v)
    plus, minus = sine + cosine, sine - cosine
    scale = math.sqrt(inverse / math.pi)
    return (
        scale * (p_0 * plus - q_0 * inverse * minus),
        scale * (p_1 * minus + q_1 * inverse * plus),
    )


# The state of `_LANES` points in one flat array, whose parts the compiler knows to lie apart.
_INVERSE, _SQUARE, _CURRENT, _OTHER, _POWER, _TOTAL, _ODD, _TAIL, _END, _PARTS = (
    _LANES * part for part in range(10)
)


@jit.kernel()
def _rise(state: Any, most: int) -> None:
    """Add up orders from J0 (`_OTHER`) and J1 (`_CURRENT`) on, up to each point's `_END`.

    `_ODD` and `_TAIL` become the sums over s of (-1)^s ratio^(2s) J_(k+2s) for k = 1 and 2.
    """
    for k in range(1, most, 2):
        order = float(k)
        for i in range(_LANES):
            inverse, power = state[_INVERSE + i], state[_POWER + i]
            goes_on = order < state[_END + i]
            below = order * inverse * state[_CURRENT + i] - state[_OTHER + i]
            state[_TAIL + i] += power * below if goes_on else 0.0
            current = (order + 1.0) * inverse * below - state[_CURRENT + i]
            power *= -state[_SQUARE + i]
            state[_ODD + i] += power * current if goes_on else 0.0
            state[_OTHER + i], state[_CURRENT + i], state[_POWER + i] = below, current, power


@jit.kernel()
def _fall(state: Any, most: int) -> None:
    """Add up orders from each point's `_END`, an even one, down to J0: Miller's backward recurrence.

    `_CURRENT` is J_k and `_OTHER` J_(k+1), both times one unknown factor. `_ODD` and `_TAIL` become Horner's
    sums of (-1)^s ratio^(2s) J_(k+2s) for k = 1 and 2. `_TOTAL` collects J_0 + 2 (J_2 + J_4 + ...), which
    is 1 and so gives the factor.
    """
    for k in range(most, 0, -2):
        order = float(k)
        for i in range(_LANES):
            inverse, square = state[_INVERSE + i], state[_SQUARE + i]
            current = _TINY if order == state[_END + i] else state[_CURRENT + i]
            tail = current - square * state[_TAIL + i]
            total = state[_TOTAL + i] + 2.0 * current
            above = order * inverse * current - state[_OTHER + i]
            odd = above - square * state[_ODD + i]
            current = (order - 1.0) * inverse * above - current
            scale = _RESCALE_BY if abs(current) > _RESCALE_ABOVE else 1.0
            state[_TAIL + i], state[_ODD + i], state[_TOTAL + i] = tail * scale, odd * scale, total * scale
            state[_OTHER + i], state[_CURRENT + i] = above * scale, current * scale


@jit.kernel()
def _lommel_lanes(u: Any, v: Any, result: Any) -> None:
    """Put I(u, v) of at most `_LANES` points with u, v >= 0 into `result`.

    They take the same steps side by side, but no point's value depends on another's.
    """
    up, down = np.zeros((2, _PARTS))
    most_up, most_down = 0, 0
    for i in range(u.size):
        x = v[i]
        if not (x >= _SMALL_V and math.isfinite(x) and math.isfinite(u[i])):
            continue
        ratio = min(u[i], x) / max(u[i], x)
        orders = 0.0 if ratio == 0.0 else (_DIGITS / -math.log(ratio) if ratio < 1.0 else math.inf)
        if x >= _LEAST_RISING and orders <= x:
            up[_INVERSE + i], up[_SQUARE + i] = 2.0 / x, ratio * ratio
            up[_OTHER + i], up[_CURRENT + i] = _hankel(x)
            up[_ODD + i], up[_POWER + i], up[_END + i] = up[_CURRENT + i], 1.0, orders
            up[_TOTAL + i] = up[_OTHER + i]
            most_up = max(most_up, math.ceil(orders))
        else:
            down[_INVERSE + i], down[_SQUARE + i] = 2.0 / x, ratio * ratio
            down[_END + i] = _first_order(x)
            most_down = max(most_down, _first_order(x))
    _rise(up, most_up)
    _fall(down, most_down)
    for i in range(u.size):
        x, y = v[i], u[i]
        if math.isnan(x) or math.isnan(y):
            result[i] = math.nan
            continue
        if math.isinf(x) or math.isinf(y):
            result[i] = 0.0
            continue
        if y < _SMALL_U and x < _SMALL_U:
            result[i] = 1.0 - 0.25 * x * x - y * y / 48.0
            continue
        even, odd, tail = 1.0, 0.5 * x, 0.0
        if up[_INVERSE + i] > 0.0:
            even, odd, tail = up[_TOTAL + i], up[_ODD + i], up[_TAIL + i]
            even -= up[_SQUARE + i] * tail
        elif down[_INVERSE + i] > 0.0:
            total = down[_TOTAL + i] + down[_CURRENT + i]
            odd, tail = down[_ODD + i] / total, down[_TAIL + i] / total
            even = (down[_CURRENT + i] / total) - down[_SQUARE + i] * tail
        ratio = min(y, x) / max(y, x)
        if x < y:
            # V0 = even and V1 = ratio * odd. The sum 1 + V0^2 + V1^2 - 2 V0 cos - 2 V1 sin of Born and Wolf
            # is written as two squares, which keeps its digits where it is small.
            phase = 0.5 * (y + x * ratio)
            a = even - math.cos(phase)
            b = ratio * odd - math.sin(phase)
            result[i] = 4.0 * (a * a + b * b) / (y * y)
        else:
            # U1 = ratio * odd and U2 = ratio^2 * tail; a ratio cancels against the 2/u before them.
            b = ratio * tail
            result[i] = 4.0 * (odd * odd + b * b) / (x * x)


@jit.kernel(parallel=True)
def _lommel_compiled(u: FloatArray, v: FloatArray) -> FloatArray:
    """Return I(u, v) for flat arrays of magnitudes, some points at a time."""
    result = np.empty(u.size)
    for part in jit.prange((u.size + _LANES - 1) // _LANES):
        lanes = slice(part * _LANES, (part + 1) * _LANES)
        _lommel_lanes(u[lanes], v[lanes], result[lanes])
    return result
