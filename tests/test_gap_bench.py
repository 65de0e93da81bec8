"""What a given model tells of the coefficients."""

from __future__ import annotations

import numpy as np
import pytest

from spa_fo.fractional import step_response
from spa_fo.gap.data.searched import to_x, to_z
from spa_fo.gap.fit.bench import known_response
from spa_fo.gap.noise.bench_noise import BenchNoise
from spa_fo.gap.noise.coloured import CORRELATION_S, Scatter, Spectrum
from spa_fo.plant.paper import TABLE_I

NOISE = BenchNoise(Spectrum(0.01, np.full(CORRELATION_S.size, 0.01)), Scatter(0.01, 0.2, 0.01), 0.2)
T = np.geomspace(0.05, 8.0, 60)


@pytest.mark.parametrize(
    "given",
    [
        TABLE_I["design_1"].as_array(),
        np.array([1.98, 1.308, 14.82, 14.63, 7.88]),  # badly conditioned
    ],
)
def test_its_step_response_is_known_and_the_rest_is_as_usual(given: np.ndarray) -> None:
    centre, covariance = known_response(given, NOISE, 6.0)
    final = given[4] / given[3]
    missed = step_response(T, *to_x(centre)) - step_response(T, *given)
    assert np.abs(missed).max() < 0.01 * final
    assert 1.0 < centre[0] < 1.9
    np.testing.assert_allclose(covariance, covariance.T, rtol=1e-9, atol=1e-12)
    assert np.linalg.eigvalsh(covariance).min() > 1e-6
    # The gain is known, orders and damping hardly.
    sigma = np.sqrt(np.diag(covariance))
    assert sigma[4] < 0.03
    assert sigma[2] > 0.1


def test_a_gap_of_the_fixture_makes_the_response_less_sure() -> None:
    given = TABLE_I["design_1"].as_array()
    sure, unsure = (known_response(given, NOISE, 6.0, angle)[1][4, 4] for angle in (np.inf, 20.0))
    assert unsure > sure + 0.9 * (0.2 / 20.0) ** 2


def test_a_usual_actuator_is_its_own_centre() -> None:
    usual = np.mean([x.as_array() for x in TABLE_I.values()], axis=0)
    centre, _ = known_response(usual, NOISE, 6.0)
    np.testing.assert_allclose(centre, to_z(usual), atol=0.02)
