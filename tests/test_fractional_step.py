"""Step response point by point, its Jacobian, the pole and the printed series."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spa_fo
from naive_fractional import naive_series_step, naive_step_response
from spa_fo.fractional import (
    grunwald_letnikov_simulate,
    grunwald_letnikov_step,
    mittag_leffler,
    prabhakar_series_step,
    step_response,
    step_response_jacobian,
)
from spa_fo.fractional.characteristic import find_pole

GOLDEN = json.loads((Path(__file__).parent / "golden" / "fractional.json").read_text())
TABLE = {
    "DS20": (1.406, 1.196, 0.794, 1.638, 0.934),
    "FX-Pro": (1.424, 1.170, 0.986, 2.103, 0.728),
}
X = TABLE["DS20"]


@st.composite
def parameters(draw):
    """Any parameters of the domain, orders as close as 1e-8."""
    alpha2 = draw(st.floats(0.1, 1.9999999))
    alpha1 = min(alpha2 * draw(st.floats(0.02, 1.0)), alpha2 - 1e-8)
    a1 = math.exp(draw(st.floats(-6, 4)))
    a0 = math.exp(draw(st.floats(-4, 4)))
    return alpha2, alpha1, a1, a0, a0 * draw(st.floats(0.1, 3.0))


@pytest.mark.parametrize("row", TABLE)
def test_golden_values(golden_step, row):
    t = np.array([float(value) for value in golden_step[row]])
    y = np.array([float(value) for value in golden_step[row].values()])
    np.testing.assert_allclose(step_response(t, *TABLE[row]), y, rtol=2e-13)


@pytest.mark.parametrize("case", GOLDEN["step"], ids=lambda case: str(case["x"]))
def test_against_multiple_precision(case):
    y = np.array(case["y"], dtype=float)
    np.testing.assert_allclose(step_response(case["t"], *case["x"]), y, rtol=3e-13)


@pytest.mark.parametrize("case", GOLDEN["jacobian"], ids=lambda case: f"{case['x']} {case['t']}")
def test_jacobian_against_multiple_precision(case):
    expected = np.array(case["gradient"], dtype=float)
    found = step_response_jacobian([case["t"]], *case["x"])
    assert found.shape == (1, 5)
    np.testing.assert_allclose(found[0], expected, rtol=1e-11, atol=2e-13)


def test_relative_accuracy_at_the_ends():
    early = step_response(1e-9, *X)
    leading = X[4] * 1e-9 ** X[0] / math.gamma(X[0] + 1.0)
    assert early == pytest.approx(leading, rel=3e-2)
    assert early == pytest.approx(float(naive_step_response(1e-9, X)), rel=1e-12)
    late = step_response([1e9, 1e50, 1e100], *X)
    np.testing.assert_allclose(late, X[4] / X[3], rtol=1e-9)
    tiny = step_response([1e-100, 1e-200, 5e-324], *X)
    assert np.all(np.diff(tiny) <= 0.0)
    assert tiny[0] == pytest.approx(X[4] * 1e-100 ** X[0] / math.gamma(X[0] + 1.0), rel=1e-12)
    extremes = step_response_jacobian([1e-300, 1e-100, 1e50, 1e100], *X)
    gain = [0.0, 0.0, 0.0, -X[4] / X[3] ** 2, 1.0 / X[3]]
    np.testing.assert_allclose(extremes[:2], 0.0, atol=1e-100)
    np.testing.assert_allclose(extremes[2:], [gain, gain], rtol=1e-11, atol=1e-13)


def test_shape_order_and_start():
    t = np.array([[3.0, 0.0, 1.0], [0.5, 7.0, 3.0]])
    y = step_response(t, *X)
    assert y.shape == t.shape
    assert y[0, 1] == 0.0
    assert y[0, 0] == y[1, 2]
    assert step_response(1.0, *X) == y[0, 2]
    assert np.shape(step_response(1.0, *X)) == ()
    assert step_response([], *X).shape == (0,)
    assert np.all(step_response_jacobian([0.0], *X) == 0.0)
    assert spa_fo.step_response is step_response


@pytest.mark.parametrize(
    ("position", "value"),
    [
        (0, -1.0),
        (0, math.nan),
        (0, math.inf),
        (0, 1e101),
        (1, 2.0001),
        (1, 1.1),
        (2, 0.0),
        (3, -0.1),
        (4, 0.0),
    ]
    + [(i, math.nan) for i in range(1, 6)],
)
def test_refuses_what_is_outside_the_domain(position, value):
    arguments = [1.0, *X]
    arguments[position] = value
    with pytest.raises(ValueError, match=r"must"):
        step_response(*arguments)


def test_refuses_a_jacobian_at_a_matrix_of_times():
    with pytest.raises(ValueError, match="one-dimensional"):
        step_response_jacobian([[1.0]], *X)


@pytest.mark.parametrize("x", [(2.0, 0.8, 0.9, 4.0, 2.0), (2.0, 1.6, 0.3, 1.0, 0.5)])
def test_an_actuator_with_a_mass_against_multiple_precision(x):
    t = [0.02, 0.3, 1.0, 3.0, 9.0]
    expected = [float(naive_step_response(one, x)) for one in t]
    np.testing.assert_allclose(step_response(t, *x), expected, rtol=1e-11)
    ahead = step_response_jacobian(t, *x)
    for k, h in enumerate([-1e-6, 1e-6, 1e-6, 1e-6, 1e-6]):
        moved = np.array(x) + h * np.eye(5)[k]
        slope = (step_response(t, *moved) - step_response(t, *x)) / h
        np.testing.assert_allclose(ahead[:, k], slope, atol=1e-5)


@given(st.floats(0.02, 1.5), st.floats(0.2, 100.0))
def test_a_mass_on_a_damped_spring_is_the_textbooks(damping, a0):
    omega = math.sqrt(a0)
    x = 2.0, 1.0, 2.0 * damping * omega, a0, a0
    t = np.linspace(0.0, 20.0 / omega, 60)
    root = np.sqrt(complex(damping**2 - 1.0)) * omega + 1e-9j
    p, q = -damping * omega + root, -damping * omega - root
    expected = 1.0 + ((q * np.exp(p * t) - p * np.exp(q * t)) / (p - q)).real
    np.testing.assert_allclose(step_response(t, *x), expected, atol=1e-6)


def test_a_mass_that_nothing_damps_is_refused():
    with pytest.raises(ValueError, match="a1 must be positive where alpha2 = 2"):
        step_response(1.0, 2.0, 1.0, 0.0, 1.0, 1.0)


@settings(deadline=None, max_examples=60)
@given(parameters(), st.floats(0.01, 100.0))
def test_scaling_of_time(x, c):
    """With s → s/c: y(ct; a1, a0, b0) = y(t; a1 c^(α2−α1), a0 c^α2, b0 c^α2)."""
    alpha2, alpha1, a1, a0, b0 = x
    t = np.array([0.01, 0.3, 2.0, 20.0])
    scaled = (alpha2, alpha1, a1 * c ** (alpha2 - alpha1), a0 * c**alpha2, b0 * c**alpha2)
    np.testing.assert_allclose(
        step_response(c * t, *x), step_response(t, *scaled), rtol=0, atol=1e-11 * b0 / a0
    )


@settings(deadline=None, max_examples=60)
@given(parameters())
def test_linear_in_b0_and_bounded(x):
    t = np.geomspace(1e-3, 1e4, 30)
    y = step_response(t, *x)
    gain = x[4] / x[3]
    np.testing.assert_allclose(step_response(t, *x[:4], 2.5 * x[4]), 2.5 * y, rtol=1e-14)
    assert np.all(np.isfinite(y))
    assert np.all(y > 0.0)
    assert np.all(y < 2.0 * gain * (1 + 1e-12))


@settings(deadline=None, max_examples=40)
@given(st.floats(0.1, 1.0), st.floats(0.05, 0.99), st.floats(0.01, 10.0), st.floats(0.05, 10.0))
def test_rises_monotonically_for_orders_up_to_one(alpha2, share, a1, a0):
    y = step_response(np.geomspace(1e-3, 1e6, 60), alpha2, alpha2 * share, a1, a0, a0)
    assert np.all(np.diff(y) > -1e-13)
    assert y[-1] < 1.0 + 1e-13


def test_tends_to_the_static_gain():
    t = np.array([1e2, 1e4, 1e6, 1e8])
    distance = np.abs(step_response(t, *X) - X[4] / X[3])
    assert np.all(np.diff(distance) < 0.0)
    # The slowest term of the tail is K (a1/a0) t^(−α1)/Γ(1 − α1).
    tail = X[4] / X[3] * X[2] / X[3] * t[-1] ** -X[1] / abs(math.gamma(1.0 - X[1]))
    assert distance[-1] == pytest.approx(tail, rel=1e-3)


def test_without_middle_term_it_is_a_mittag_leffler_function():
    t = np.linspace(0.1, 8.0, 20)
    expected = 0.8 * t**1.6 * mittag_leffler(-1.3 * t**1.6, 1.6, 2.6)
    np.testing.assert_allclose(step_response(t, 1.6, 0.9, 0.0, 1.3, 0.8), expected, atol=1e-12)


@settings(deadline=None, max_examples=100)
@given(parameters())
def test_the_pole_is_a_root_of_d(x):
    alpha2, alpha1, a1, a0, _ = x
    log_pole = find_pole(alpha2, alpha1, a1, a0)
    if log_pole == 0:
        return
    assert math.pi / alpha2 <= log_pole.imag < math.pi
    terms = np.array([np.exp(alpha2 * log_pole), a1 * np.exp(alpha1 * log_pole), a0])
    assert abs(terms.sum()) < 1e-13 * np.abs(terms).sum()


@settings(deadline=None, max_examples=30)
@given(st.floats(1.05, 1.95), st.floats(0.05, 0.999), st.floats(0.55, 0.965), st.floats(-3.0, 3.0))
def test_finds_a_pole_placed_at_will(alpha2, share, turn, log_modulus):
    """Choose p, solve D(p) = 0 for a1 and a0, and find p again."""
    alpha1 = alpha2 * share
    log_p = complex(log_modulus, turn * math.pi)
    a1 = -(np.exp(alpha2 * log_p)).imag / (np.exp(alpha1 * log_p)).imag
    a0 = -(np.exp(alpha2 * log_p) + a1 * np.exp(alpha1 * log_p)).real
    if turn * alpha2 <= 1.001 or a1 <= 0.0 or a0 <= 1e-6:
        return
    assert find_pole(alpha2, alpha1, a1, a0) == pytest.approx(log_p, rel=1e-7)


def test_the_printed_series_is_another_function():
    """Eq. 15 as printed decays to zero; the corrected one tends to b0/a0."""
    assert prabhakar_series_step(100.0, *X, printed=True) == pytest.approx(0.0585, abs=5e-5)
    assert prabhakar_series_step(100.0, *X) == pytest.approx(0.5705, abs=5e-5)
    for printed in (False, True):
        series = float(naive_series_step(1.5, X, printed))
        assert prabhakar_series_step(1.5, *X, printed=printed) == pytest.approx(series, rel=1e-12)


def test_grunwald_letnikov_converges_to_it():
    t = np.linspace(0.0, 10.0, 11)
    errors = [
        np.abs(grunwald_letnikov_step(t, *X, steps=n) - step_response(t, *X)).max()
        for n in (500, 1000, 2000)
    ]
    assert errors[0] < 2e-2
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.1)
    assert np.all(grunwald_letnikov_step([0.0], *X) == 0.0)
    with pytest.raises(ValueError, match="equally spaced"):
        grunwald_letnikov_simulate([0.0, 1.0, 3.0], [1.0, 1.0, 1.0], *X)
