"""The three-parameter Mittag-Leffler function."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numba
import numpy as np
import pymittagleffler
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naive_fractional import naive_mittag_leffler
from spa_fo.fractional import mittag_leffler

GOLDEN = json.loads((Path(__file__).parent / "golden" / "fractional.json").read_text())


@pytest.mark.parametrize("case", GOLDEN["mittag_leffler"], ids=lambda case: str(case["arguments"]))
def test_golden_values(case):
    expected = float(case["value"])
    found = mittag_leffler(*case["arguments"])
    assert abs(found - expected) < 1e-12 * max(1.0, abs(expected))


@settings(deadline=None, max_examples=80)
@given(
    st.floats(0.3, 1.999),
    st.floats(-3.0, 10.0),
    st.floats(0.05, 5.0),
    st.floats(0.01, 40.0),
    st.booleans(),
)
def test_against_its_series(alpha, beta, gamma, radius, negative):
    if negative and alpha < 0.5:
        radius = min(radius, 5.0)
    z = (-1.0 if negative else 1.0) * radius**alpha
    expected = float(naive_mittag_leffler(z, alpha, beta, gamma))
    condition = 1.0 if negative else 1.0 + radius
    rounding = 1e-15 * radius ** (1.0 - beta) if negative and beta < 0.0 else 0.0
    error = abs(mittag_leffler(z, alpha, beta, gamma) - expected)
    assert error < 5e-11 * max(1.0, abs(expected)) * condition + rounding


@pytest.mark.parametrize("alpha", [1.15, 1.2, 1.21875])
@pytest.mark.parametrize(("beta", "gamma"), [(0.0, 5.0), (0.0, 4.0), (-0.5, 4.0), (1.0, 5.0)])
def test_a_pair_of_branch_points_far_to_the_left_counts_by_its_order(alpha, beta, gamma):
    z = -(40.0**alpha)
    error = abs(
        mittag_leffler(z, alpha, beta, gamma) - float(naive_mittag_leffler(z, alpha, beta, gamma))
    )
    assert error < 1e-13 + 1e-15 * 40.0 ** (1.0 - beta)


@pytest.mark.parametrize(("alpha", "beta", "gamma"), [(1.125, -3.0, 5.0), (1.205, -2.5, 1.0)])
def test_a_negative_beta_costs_accuracy_as_said(alpha, beta, gamma):
    z = -(40.0**alpha)
    error = abs(
        mittag_leffler(z, alpha, beta, gamma) - float(naive_mittag_leffler(z, alpha, beta, gamma))
    )
    assert error < 5e-11 + 1e-15 * 40.0 ** (1.0 - beta)


@pytest.mark.parametrize("alpha", [0.3, 0.9, 1.0, 1.1, 1.406, 1.95])
@pytest.mark.parametrize("beta", [0.7, 1.0, 2.4])
def test_two_parameters_against_pymittagleffler(alpha, beta):
    z = -np.geomspace(1e-3, 1e3, 25)
    expected = pymittagleffler.mittag_leffler(z.astype(complex), alpha, beta).real
    np.testing.assert_allclose(mittag_leffler(z, alpha, beta), expected, rtol=0, atol=1e-11)


def test_closed_forms():
    z = np.array([-30.0, -2.0, -0.1, 0.0, 0.4, 5.0])
    np.testing.assert_allclose(mittag_leffler(z, 1.0), np.exp(z), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(
        mittag_leffler(z[1:4], 0.5),
        [math.exp(value**2) * math.erfc(-value) for value in z[1:4]],
        rtol=1e-12,
    )
    assert mittag_leffler(0.0, 1.3, 2.2, 0.7) == pytest.approx(1.0 / math.gamma(2.2), rel=1e-15)
    assert mittag_leffler(0.0, 1.3, -1.0) == 0.0
    x = np.geomspace(1e-2, 1e2, 30)
    np.testing.assert_allclose(mittag_leffler(-(x**2), 2.0), np.cos(x), rtol=0, atol=1e-11)
    np.testing.assert_allclose(mittag_leffler(-(x**2), 2.0, 2.0), np.sin(x) / x, rtol=0, atol=1e-11)
    np.testing.assert_allclose(mittag_leffler(x**2, 2.0), np.cosh(x), rtol=1e-10)
    # E^γ_{1,1} is Kummer's function 1F1(γ; 1; z); γ = 2 gives (1 + z) e^z.
    np.testing.assert_allclose(
        mittag_leffler(z, 1.0, 1.0, 2.0), (1.0 + z) * np.exp(z), rtol=1e-10, atol=1e-12
    )


@settings(deadline=None, max_examples=60)
@given(st.floats(0.1, 1.99), st.floats(0.0, 5.0), st.floats(0.1, 3.9), st.floats(-1e4, -1e-3))
def test_recurrence_in_gamma(alpha, beta, gamma, z):
    """αγ E^{γ+1}_{α,β+1} = E^γ_{α,β} + (αγ − β) E^γ_{α,β+1}."""
    left = alpha * gamma * mittag_leffler(z, alpha, beta + 1.0, gamma + 1.0)
    first = mittag_leffler(z, alpha, beta, gamma)
    second = (alpha * gamma - beta) * mittag_leffler(z, alpha, beta + 1.0, gamma)
    assert abs(left - first - second) < 1e-10 * max(1.0, abs(first), abs(second))


def test_shape_and_overflow():
    z = np.array([[-1.0, 2.0], [0.0, 1e4]])
    e = mittag_leffler(z, 0.5)
    assert e.shape == z.shape
    assert e[1, 1] == math.inf
    assert mittag_leffler(1e300, 1.0) == math.inf
    assert np.shape(mittag_leffler(-1.0, 0.5)) == ()


@pytest.mark.parametrize(
    "arguments",
    [
        (math.nan, 1.0),
        (math.inf, 1.0),
        (1.0, 0.0),
        (1.0, 2.1),
        (1.0, math.nan),
        (1.0, 1.0, 10.5),
        (1.0, 1.0, -3.5),
        (1.0, 1.0, math.nan),
        (1.0, 1.0, 1.0, 0.0),
        (1.0, 1.0, 1.0, 5.5),
    ],
)
def test_refuses_what_is_outside_the_domain(arguments):
    with pytest.raises(ValueError, match="must"):
        mittag_leffler(*arguments)


def test_the_same_bits_for_one_and_all_threads():
    z = np.linspace(-30.0, 3.0, 999)
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        one = mittag_leffler(z, 1.406, 2.406, 2.0)
    finally:
        numba.set_num_threads(threads)
    assert np.array_equal(one, mittag_leffler(z, 1.406, 2.406, 2.0))
