from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import naive_identify
from identify_cases import steps
from spa_fo.fractional import step_map
from spa_fo.identify import free_bounds, printed_bounds, widened_bounds
from spa_fo.identify.fitness import reduce_data, swarm_rmse, target_of

DATA = steps(2, seed=3)
MAP = step_map(DATA.t)


@given(
    alpha2=st.floats(1.1, 1.9),
    share=st.floats(0.1, 0.95),
    coefficients=st.tuples(st.floats(0.1, 3), st.floats(0.3, 4), st.floats(0.1, 3)),
)
@settings(max_examples=15, deadline=None)
def test_one_response_serves_all_data_sets(
    alpha2: float, share: float, coefficients: tuple[float, ...]
) -> None:
    x = np.array([alpha2, share * alpha2, *coefficients])
    target = target_of(DATA)
    y = MAP.response(x)
    total = np.sum(target.weight * (y - target.mean) ** 2) + target.constant
    assert total == pytest.approx(naive_identify.sum_of_squares(DATA, x), rel=1e-9)


@given(st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_the_identity_holds_for_any_weights(seed: int) -> None:
    generator = np.random.default_rng(seed)
    w = generator.uniform(0.0, 2.0, DATA.angle_rad.shape)
    y = generator.normal(size=DATA.points)
    mean, weight = np.empty(DATA.points), np.empty(DATA.points)
    constant = reduce_data(DATA.angle_rad, DATA.u, w, mean, weight)
    direct = np.sum(w * (DATA.angle_rad - DATA.u[:, np.newaxis] * y) ** 2)
    assert np.sum(weight * (y - mean) ** 2) + constant == pytest.approx(direct, rel=1e-10)


def test_the_swarms_fitness_is_the_plain_rmse_and_infinite_outside() -> None:
    generator = np.random.default_rng(1)
    positions = generator.uniform([1.0, 0.9, 0.4, 0.8, 0.6], [1.9, 1.6, 1.1, 2.2, 2.1], (20, 5))
    for bounds in (printed_bounds(), widened_bounds(), free_bounds()):
        found = np.empty(20)
        swarm_rmse(positions, bounds.lower, bounds.upper, target_of(DATA), MAP.arrays, found)
        expected = [naive_identify.rmse(DATA, bounds, x) for x in positions]
        np.testing.assert_allclose(found, expected, rtol=1e-9)
        assert np.isinf(found).any()
