"""Typical coefficients: as fast and as strong as the model they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from spa_fo.fractional import step_response
from spa_fo.gap.data.searched import at_rate
from spa_fo.gap.fit.coefficients import typical
from spa_fo.plant.paper import TABLE_I

USUAL = np.mean([x.as_array() for x in TABLE_I.values()], axis=0)
HORIZON_S = 6.0


def rise_s(x: NDArray[np.float64]) -> float:
    """Slow twin: the first of very many samples that has risen far enough."""
    time = np.linspace(0.0, HORIZON_S, 60_001)[1:]
    y = step_response(time, *x)
    return float(time[np.flatnonzero(y >= 0.63 * y[-1])[0]])


@settings(max_examples=20, deadline=None)
@given(st.floats(0.4, 8.0), st.floats(0.2, 5.0))
def test_an_actuator_of_the_papers_kind_is_itself(rate_factor: float, gain: float) -> None:
    x = at_rate(USUAL, rate_factor)
    x[4] *= gain
    np.testing.assert_allclose(typical(x, HORIZON_S), x, rtol=0.06)


@pytest.mark.parametrize(
    "bent",
    [
        [1.317, 1.297, 0.001, 1.156, 0.373],  # a leak has taken the damping
        [1.307, 0.043, 1.094, 0.001, 0.302],  # and a slow supply the stiffness
        [1.363, 1.343, 891.7, 999.997, 348.2],  # inertia without effect
        [1.98, 1.25, 153.5, 135.8, 73.7],
    ],
)
def test_a_bent_model_becomes_a_typical_one_as_fast_and_as_strong(bent: list[float]) -> None:
    x = np.array(bent)
    found = typical(x, HORIZON_S)
    np.testing.assert_allclose(found[:2], USUAL[:2])
    end = np.array([HORIZON_S])
    np.testing.assert_allclose(step_response(end, *found), step_response(end, *x), rtol=1e-9)
    assert rise_s(found) == pytest.approx(rise_s(x), rel=0.05)


def test_one_far_slower_than_any_gets_the_slowest() -> None:
    found = typical(at_rate(USUAL, 1e-5), HORIZON_S)
    assert np.all(np.isfinite(found))
    assert np.all(found > 0.0)
