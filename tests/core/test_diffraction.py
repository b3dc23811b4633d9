"""Lommel's intensity against quadrature of the diffraction integral, and its closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, special

from potmesil_addon.diffraction import (
    _hankel,
    _lommel_compiled,
    _lommel_numpy,
    airy,
    axial_intensity,
    lommel_intensity,
    optical_defocus,
    optical_radius,
)
from potmesil_addon.lens import Lens

from .helpers import Array, diffraction_integral

PI = math.pi

DEFOCUS = [
    0.0, 1e-6, 9.9e-4, 1e-3, 0.5, PI, 2 * PI, 3 * PI, 4 * PI, 5 * PI, 6 * PI,
    8 * PI, 12 * PI, 16 * PI, 40 * PI, 50.0, 200 * PI,
]  # fmt: skip
"""The papers' figure 7, the axial zeros 4 pi m, and what a wide lens makes of a far background."""


def distances(u: float, count: int = 241) -> Array:
    """Return v from the axis to u + 60, with the shadow edge and both sides of the code's own seams."""
    seams = [1e-12, 1e-7, 9.9e-7, 1e-6, 1.01e-6, 9.9e-4, 1e-3, 1.01e-3]
    edge = [u, np.nextafter(u, 0.0), np.nextafter(u, math.inf)]
    edge += [u * (1.0 + sign * s) for s in (1e-12, 1e-9, 1e-6, 1e-3) for sign in (-1.0, 1.0)]
    return np.sort(np.concatenate([np.linspace(0.0, u + 60.0, count), seams, edge]))


def worst(u: float, v: Array, intensity: Array) -> float:
    """Return the largest error relative to the reference profile's own peak."""
    reference = diffraction_integral(u, v)
    return float(np.abs(intensity - reference).max() / reference.max())


@pytest.mark.parametrize(
    ("u", "v"), [(0.0, 1.0), (0.5, 0.0), (PI, 2.0), (4 * PI, 4 * PI), (50.0, 30.0), (50.0, 70.0)]
)
def test_the_reference_agrees_with_adaptive_quadrature(u: float, v: float) -> None:
    def part(f: np.ufunc, p: float) -> float:
        return 2.0 * float(special.j0(v * p)) * float(f(0.5 * u * p * p)) * p

    cosine, _ = integrate.quad(lambda p: part(np.cos, p), 0.0, 1.0, epsabs=1e-13, epsrel=1e-12, limit=400)
    sine, _ = integrate.quad(lambda p: part(np.sin, p), 0.0, 1.0, epsabs=1e-13, epsrel=1e-12, limit=400)
    assert float(diffraction_integral(u, v)[0]) == pytest.approx(cosine**2 + sine**2, abs=1e-12)


@pytest.mark.parametrize("u", DEFOCUS)
def test_profile_equals_quadrature(u: float) -> None:
    v = distances(u)
    assert worst(u, v, lommel_intensity(u, v)) < 1e-6


@pytest.mark.parametrize("u", DEFOCUS)
def test_documented_accuracy_up_to_200_pi(u: float) -> None:
    v = distances(u)
    assert worst(u, v, lommel_intensity(u, v)) < 1e-11


@pytest.mark.parametrize("u", [1000.0, 400 * PI, 2500.0, 5000.0])
def test_documented_accuracy_up_to_5000(u: float) -> None:
    v = distances(u, count=121)
    assert worst(u, v, lommel_intensity(u, v)) < 1e-9


@given(st.floats(0.0, 150.0), st.floats(0.0, 250.0))
def test_any_point_equals_quadrature(u: float, v: float) -> None:
    # The peak lies at or inside the shadow edge.
    peak = diffraction_integral(u, np.linspace(0.0, u + 4.0, 200)).max()
    assert abs(float(lommel_intensity(u, v)) - float(diffraction_integral(u, v)[0])) < 1e-6 * peak


def test_airy_equals_scipys_bessel_function() -> None:
    v = np.linspace(-80.0, 80.0, 4001)
    v = v[v != 0.0]
    np.testing.assert_allclose(airy(v), (2.0 * special.jv(1, v) / v) ** 2, rtol=1e-12, atol=1e-16)
    assert float(airy(0.0)) == 1.0
    # The first dark ring, 3.8317 (1.22 pi).
    assert float(airy(3.8317059702075125)) < 1e-30


def test_in_focus_it_is_the_airy_pattern() -> None:
    v = np.linspace(0.0, 100.0, 1001)
    np.testing.assert_allclose(lommel_intensity(0.0, v), airy(v), rtol=0.0, atol=1e-13)


def test_on_the_axis_it_is_a_squared_sinc() -> None:
    u = np.concatenate([np.linspace(1e-3, 300.0, 2001), [1000.0, 5000.0]])
    expected = (np.sin(u / 4.0) / (u / 4.0)) ** 2
    np.testing.assert_allclose(lommel_intensity(u, 0.0), expected, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(axial_intensity(u), expected, rtol=0.0, atol=1e-15)
    assert float(axial_intensity(0.0)) == float(lommel_intensity(0.0, 0.0)) == 1.0


@pytest.mark.parametrize("m", [1, 2, 3, 10, 50])
def test_the_axis_is_dark_at_4_pi_m(m: int) -> None:
    u = 4 * PI * m
    assert float(lommel_intensity(u, 0.0)) < 1e-28
    assert float(lommel_intensity(-u, 0.0)) < 1e-28
    assert float(axial_intensity(u)) < 1e-28
    # Between two zeros there is light.
    assert float(lommel_intensity(u + 2 * PI, 0.0)) == pytest.approx((2 * m * PI + PI) ** -2 * 4, rel=1e-10)


def test_even_in_both_variables() -> None:
    u, v = np.meshgrid(np.linspace(0.0, 40.0, 17), np.linspace(0.0, 70.0, 23))
    there = lommel_intensity(u, v)
    for signs in ((-1, 1), (1, -1), (-1, -1)):
        assert np.array_equal(lommel_intensity(signs[0] * u, signs[1] * v), there)


@pytest.mark.parametrize("v", [0.5, 5.0, 20.0, 100.0])
def test_continuous_across_the_shadow_edge(v: float) -> None:
    """The two series meet at u = v; the intensity is smooth there."""
    u = v + np.array([-1e-7, 0.0, 1e-7])
    low, edge, high = lommel_intensity(u, v)
    assert abs(low - edge) < 1e-7 * float(lommel_intensity(v, 0.5 * v) + edge)
    assert abs(high - edge) < 1e-7 * float(lommel_intensity(v, 0.5 * v) + edge)


@pytest.mark.parametrize("u", [0.0, 3.0, 4 * PI, 40.0])
def test_total_energy_is_two(u: float) -> None:
    """By Parseval's theorem for the Hankel transform: int I v dv = 4 int_0^1 p dp = 2.

    Far outside the shadow I is 4 J1(v)^2 / v^2, whose integral from V on is 4 / (pi V) to order V^-2.
    """
    end = 2000.0
    nodes, weights = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(0.0, end, 1001)
    v = edges[:-1, np.newaxis] + 1.0 + nodes
    energy = float(((lommel_intensity(u, v) * v) @ weights).sum())
    assert energy + 4.0 / (PI * end) == pytest.approx(2.0, abs=2e-6)


def test_encircled_energy_of_the_airy_pattern() -> None:
    """Rayleigh: 1 - J0^2 - J1^2 of the light lies within v."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    for end in (1.0, 3.8317, 10.0, 60.0):
        v = 0.5 * end * (nodes + 1.0)
        energy = float((lommel_intensity(0.0, v) * v) @ weights) * 0.5 * end
        assert energy == pytest.approx(2.0 * (1.0 - special.j0(end) ** 2 - special.j1(end) ** 2), abs=1e-12)


def test_far_out_of_focus_the_circle_is_evenly_lit() -> None:
    """All light within v = u, spread evenly: 4 / u^2 on the average."""
    u = 4000.0
    v = np.linspace(0.0, 0.8 * u, 4001)
    mean = float((lommel_intensity(u, v) * v).sum() / v.sum())
    assert mean == pytest.approx(4.0 / u**2, rel=1e-2)
    assert float(lommel_intensity(u, 1.3 * u)) < 0.01 * 4.0 / u**2


@pytest.mark.parametrize("evaluate", [_lommel_compiled, _lommel_numpy])
@pytest.mark.parametrize("u", [*DEFOCUS, 5000.0])
def test_intensity_is_never_negative(evaluate: object, u: float) -> None:
    assert callable(evaluate)
    v = distances(u, count=61)
    assert (evaluate(np.full(v.shape, u), v) >= 0.0).all()


@pytest.mark.parametrize("u", [*DEFOCUS, 1000.0, 5000.0])
def test_both_implementations_agree(u: float) -> None:
    v = distances(u, count=121)
    compiled, plain = _lommel_compiled(np.full(v.shape, u), v), _lommel_numpy(np.full(v.shape, u), v)
    assert float(np.abs(compiled - plain).max()) <= 1e-12 * float(compiled.max())


def test_hankels_expansion_is_exact_from_where_it_is_used() -> None:
    v = np.concatenate([np.linspace(32.0, 200.0, 4001), np.linspace(200.0, 6000.0, 4001)])
    expansion = np.array([_hankel(x) for x in v.tolist()])
    # scipy's j0 and j1 are off by 5e-15 in some of its releases.
    expected = np.stack([special.jv(0, v), special.jv(1, v)], axis=1)
    np.testing.assert_allclose(expansion, expected, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("u", [31.9, 32.1, 60.0, 300.0, 3000.0])
def test_both_recurrences_meet(u: float) -> None:
    """Where points change from the recurrence that goes up to the one that comes down nothing shows."""
    v = np.concatenate([np.linspace(31.0, 33.0, 101), np.linspace(0.6 * u, 1.5 * u, 801)])
    assert worst(u, v, lommel_intensity(u, v)) < 1e-9


def test_a_points_neighbours_do_not_matter() -> None:
    rng = np.random.default_rng(8)
    u, v = rng.uniform(0.0, 900.0, 100), rng.uniform(0.0, 900.0, 100)
    v[10:20] = u[10:20]
    together = _lommel_compiled(u, v)
    order = rng.permutation(u.size)
    assert np.array_equal(_lommel_compiled(u[order], v[order]), together[order])
    assert np.array_equal([float(lommel_intensity(a, b)) for a, b in zip(u, v, strict=True)], together)


def test_both_implementations_agree_on_mixed_points() -> None:
    rng = np.random.default_rng(5)
    u, v = rng.uniform(0.0, 100.0, 500), rng.uniform(0.0, 150.0, 500)
    v[::7], u[::11] = 0.0, 0.0
    v[3], u[4], u[5], v[6] = math.nan, math.nan, math.inf, math.inf
    np.testing.assert_allclose(_lommel_compiled(u, v), _lommel_numpy(u, v), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("u", "v", "expected"),
    [
        ((), (), ()),
        ((3,), (), (3,)),
        ((), (4,), (4,)),
        ((2, 1), (3,), (2, 3)),
        ((2, 3), (2, 3), (2, 3)),
        ((2, 1, 1), (1, 3, 2), (2, 3, 2)),
        ((0,), (1,), (0,)),
    ],
)
def test_shapes_broadcast(u: tuple[int, ...], v: tuple[int, ...], expected: tuple[int, ...]) -> None:
    rng = np.random.default_rng(2)
    many_u, many_v = rng.uniform(0.0, 20.0, u), rng.uniform(0.0, 30.0, v)
    result = lommel_intensity(many_u, many_v)
    assert result.shape == expected
    assert result.dtype == np.float64
    both = np.broadcast_arrays(many_u, many_v)
    each = [float(lommel_intensity(a, b)) for a, b in zip(both[0].flat, both[1].flat, strict=True)]
    assert result.reshape(-1).tolist() == each


def test_inputs_stay_as_they_are() -> None:
    u, v = np.array([-3.0, 2.0]), np.array([-1.0, 5.0])
    lommel_intensity(u, v)
    assert u.tolist() == [-3.0, 2.0]
    assert v.tolist() == [-1.0, 5.0]


@pytest.mark.parametrize(
    ("u", "v", "expected"),
    [
        (math.nan, 1.0, math.nan),
        (1.0, math.nan, math.nan),
        (math.nan, math.inf, math.nan),
        (math.inf, math.nan, math.nan),
        (math.inf, 1.0, 0.0),
        (1.0, math.inf, 0.0),
        (-math.inf, 0.0, 0.0),
        (math.inf, math.inf, 0.0),
    ],
)
def test_nan_and_infinity(u: float, v: float, expected: float) -> None:
    flat = np.array([abs(u)]), np.array([abs(v)])
    for value in (lommel_intensity(u, v), _lommel_numpy(*flat)[0], _lommel_compiled(*flat)[0]):
        np.testing.assert_equal(float(value), expected)


def test_defocus_by_hand() -> None:
    """TOG 1982, eq. 18: k (d/2F)^2 (V_P - V_D)."""
    # 50 mm at f/2 focused at infinity: V_D = 50 mm; a point at 1.05 m has V_P = 52.5 mm. (1/4)^2 k 2.5 mm.
    lens = Lens(0.05, 2.0, math.inf)
    expected = 2.0 * PI / 500e-9 / 16.0 * 2.5e-3
    assert float(optical_defocus(1.05, lens, 500e-9)) == pytest.approx(expected, rel=1e-12)
    assert float(optical_defocus(math.inf, lens, 500e-9)) == 0.0


def test_defocus_is_positive_before_the_focus() -> None:
    lens = Lens(0.05, 2.0, 3.0)
    assert (optical_defocus([1.0, 2.0, 2.99], lens, 549e-9) > 0.0).all()
    assert (optical_defocus([3.01, 10.0, math.inf], lens, 549e-9) < 0.0).all()
    assert float(optical_defocus(3.0, lens, 549e-9)) == 0.0


def test_radius_by_hand() -> None:
    """TOG 1982, eq. 17: k (d/2F) r, so the first dark ring of f/4 and 500 nm is at 2.44 um."""
    radius = 3.8317059702 * 500e-9 * 4.0 / PI
    assert radius == pytest.approx(2.44e-6, rel=1e-3)
    assert float(optical_radius(radius, Lens(0.05, 4.0, 1.0), 500e-9)) == pytest.approx(
        3.8317059702, rel=1e-12
    )


@pytest.mark.parametrize("shape", [(), (3,), (2, 3), (0, 2)])
def test_conversions_keep_any_shape(shape: tuple[int, ...]) -> None:
    lens = Lens(0.05, 2.0, 3.0)
    values = np.linspace(1.0, 5.0, math.prod(shape)).reshape(shape)
    assert optical_defocus(values, lens, 5e-7).shape == shape
    assert optical_radius(values, lens, 5e-7).shape == shape
    assert airy(values).shape == shape
    assert axial_intensity(values).shape == shape
