from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import naive_identify
from spa_fo.plant import (
    Ludwick,
    ludwick_step,
    second_moment,
    second_moment_as_printed,
    second_order_step,
)

T = np.arange(1, 51) / 5.0


@pytest.mark.parametrize("exponent", [0.6, 1.0, 1.727, 2.365])
@pytest.mark.parametrize("u", [0.5, 2.0, -1.0])
def test_runge_kutta_against_an_adaptive_method(exponent: float, u: float) -> None:
    model = Ludwick(exponent, 0.7, 1.812, 1.3)
    expected = naive_identify.ludwick(T, u, model)
    # Below an exponent of one the force has infinite slope at rest.
    tolerance = 1e-7 if exponent >= 1 else 3e-5
    np.testing.assert_allclose(ludwick_step(T, u, model), expected, rtol=0, atol=tolerance)


def test_an_exponent_of_one_is_the_linear_model() -> None:
    model = Ludwick(1.0, 0.4, 1.3, 0.8)
    linear = second_order_step(T, 0.8 / 1.3**2, 0.4, 1.3)
    np.testing.assert_allclose(ludwick_step(T, 1.5, model), 1.5 * linear, atol=1e-7)


def test_it_settles_at_the_static_angle() -> None:
    model = Ludwick(2.365, 0.7, 1.812, 0.9)
    static = (0.9 * 1.5 / 1.812**2) ** (1.0 / 2.365)
    assert ludwick_step([200.0], 1.5, model)[0] == pytest.approx(static, rel=1e-9)


@given(st.floats(0.1, 3.0), st.floats(0.5, 3.0))
@settings(max_examples=25, deadline=None)
def test_the_response_is_odd_in_the_input(u: float, exponent: float) -> None:
    model = Ludwick(exponent, 0.7, 1.8, 1.0)
    np.testing.assert_array_equal(ludwick_step(T, -u, model), -ludwick_step(T, u, model))


def test_second_moment_of_a_rectangle() -> None:
    assert second_moment(1.0, 0.03, 0.024) == pytest.approx(0.03 * 0.024**3 / 12)
    assert second_moment_as_printed(1.0, 0.03, 0.024) == pytest.approx(0.03 * 0.024**3 / 6)


@pytest.mark.parametrize("values", [(0, 0.7, 1, 1), (1, -0.7, 1, 1), (1, 0.7, np.nan, 1)])
def test_bad_parameters(values: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="positive"):
        Ludwick(*values)


def test_times_must_be_sorted() -> None:
    with pytest.raises(ValueError, match="sorted"):
        ludwick_step([1.0, 0.5], 1.0, Ludwick(1.0, 0.7, 1.0, 1.0))
