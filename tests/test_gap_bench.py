"""What a given model tells of the coefficients."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from spa_fo.fractional import step_response
from spa_fo.gap.data.evidence import step_deg_of
from spa_fo.gap.data.searched import HIGHEST, LOWEST, searched_spread, to_x, to_z
from spa_fo.gap.fit.bench import hidden_deg, level_prior
from spa_fo.gap.fit.coefficients import (
    Coefficients,
    KnownResponse,
    error_of,
    identified,
    usual,
)
from spa_fo.gap.fit.nuisances import most
from spa_fo.gap.noise.bench_noise import BenchNoise
from spa_fo.gap.noise.coloured import CORRELATION_S, Scatter, Spectrum
from spa_fo.gap.noise.dwell_error import UNKNOWN, DwellError
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import Model
from spa_fo.plant.paper import TABLE_I

NOISE = BenchNoise(
    Spectrum(0.01, np.full(CORRELATION_S.size, 0.01)),
    Scatter(0.01, 0.2, 0.01),
    DwellError(0.2, 9.0, 0.0),
)
T = np.geomspace(0.05, 8.0, 60)


USUAL = np.mean([x.as_array() for x in TABLE_I.values()], axis=0)


def response_of(known: Coefficients) -> KnownResponse:
    assert known.response is not None
    return known.response


def squares(known: Coefficients, z: np.ndarray) -> float:
    """Misfit of the known response, and of what is usual."""
    away = z - known.mean
    left = response_of(known).left(z)
    return float(left @ left + away @ np.linalg.solve(known.spread, away))


@pytest.mark.parametrize(
    "given",
    [
        TABLE_I["design_1"].as_array(),
        np.array([1.98, 1.308, 14.82, 14.63, 7.88]),  # badly conditioned
    ],
)
def test_its_step_response_is_known_and_the_rest_is_as_usual(given: np.ndarray) -> None:
    centre, known = identified(given, NOISE, 6.0, 8.0)
    final = given[4] / given[3]
    missed = step_response(T, *to_x(centre)) - step_response(T, *given)
    assert np.abs(missed).max() < 0.01 * final
    assert 1.0 < centre[0] < 1.9
    slopes = response_of(known).slopes(centre)
    covariance = np.linalg.inv(slopes.T @ slopes + np.linalg.inv(known.spread))
    # The gain is known, orders and damping hardly.
    sigma = np.sqrt(np.diag(covariance))
    assert sigma[4] < 0.03
    assert sigma[2] > 0.1


def test_coefficients_that_change_the_response_are_no_plausible_ones() -> None:
    # Three and a half deviations away, were the valley straight; the response changes by a fifth.
    given = np.array([1.36, 1.25, 0.77, 1.70, 0.98])
    centre, known = identified(given, NOISE, 6.0, 8.0)
    far = to_z(np.array([1.37, 1.11, 0.12, 0.72, 0.41]))
    slopes = response_of(known).slopes(centre)
    precision = slopes.T @ slopes + np.linalg.inv(known.spread)
    straight = float((far - centre) @ precision @ (far - centre))
    assert squares(known, far) - squares(known, centre) > 20.0 * straight


def test_what_it_says_of_a_long_hold_is_known_too() -> None:
    # The same up to some seconds, and then it creeps.
    creeping = to_z(np.array([1.3644, 0.1021, 0.4034, 0.6441, 0.5074]))
    centre, short = identified(np.array([1.351, 1.0, 0.0843, 1.0151, 0.5163]), NOISE, 6.0, 8.0)
    _, long = identified(np.array([1.351, 1.0, 0.0843, 1.0151, 0.5163]), NOISE, 6.0, 60.0)
    late = [
        float(np.sum(response_of(known).left(creeping) ** 2))
        - float(np.sum(response_of(known).left(centre) ** 2))
        for known in (short, long)
    ]
    assert response_of(long).times_s[-1] == pytest.approx(60.0)
    assert late[1] > 2.0 * late[0]


def test_slopes_are_those_of_the_response() -> None:
    centre, known = identified(TABLE_I["design_1"].as_array(), NOISE, 6.0, 8.0)
    response = response_of(known)
    for k, column in enumerate(response.slopes(centre).T):
        step = 1e-3 * np.eye(5)[k]
        moved = response.left(centre - step) - response.left(centre + step)
        np.testing.assert_allclose(column, moved / 2e-3, rtol=1e-3, atol=2e-3)


def test_a_gap_of_the_fixture_makes_the_response_less_sure() -> None:
    given = TABLE_I["design_1"].as_array()

    def of_gain(angle_deg: float) -> float:
        centre, known = identified(given, NOISE, 6.0, 8.0, angle_deg)
        louder = centre + np.array([0.0, 0.0, 0.0, 0.0, 0.01])
        return squares(known, louder) - squares(known, centre)

    assert of_gain(20.0) < 0.6 * of_gain(np.inf)


def test_what_may_have_shifted_is_known_as_far_as_it_may() -> None:
    centre, known = identified(USUAL, NOISE, 6.0, 8.0)
    moved = known.shifted(centre)
    s = SETTINGS
    shift = searched_spread(centre, s.shift_orders, s.shift_logs, s.shift_gain)
    np.testing.assert_allclose(moved.spread, known.spread + shift)
    wider = response_of(moved).root @ response_of(moved).root.T
    known_so_far = response_of(known).root @ response_of(known).root.T
    root, times_s = np.linalg.cholesky(shift), response_of(known).times_s
    draws = centre + np.random.default_rng(3).standard_normal((4000, 5)) @ root.T
    draws = np.clip(draws, LOWEST, HIGHEST)
    responses = np.array([step_response(times_s, *to_x(z)) for z in draws])
    apart = (responses - step_response(times_s, *to_x(centre))) / response_of(known).gain
    mean_square = apart.T @ apart / len(draws)
    np.testing.assert_allclose(wider - known_so_far, mean_square, atol=0.15 * mean_square.max())
    assert response_of(moved).log_noise == pytest.approx(np.linalg.slogdet(wider)[1])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_large_shift_bends_the_response(sign: float) -> None:
    """Two standard deviations are no more than three in each direction, by the draws alone."""
    centre, known = identified(USUAL, NOISE, 6.0, 8.0)
    s = SETTINGS
    shift = searched_spread(centre, s.shift_orders, s.shift_logs, s.shift_gain)
    far = centre + 2.0 * sign * np.sqrt(np.diag(shift)) * np.array([1.0, 0.0, -1.0, 0.5, 1.0])
    straight = response_of(known).wider(centre, shift).left(far)
    drawn = response_of(known.shifted(centre)).left(far)
    assert drawn @ drawn < 5.0 * 3.0**2 + drawn.size < straight @ straight


def test_beside_tempered_evidence_what_a_model_tells_counts_whole() -> None:
    centre, known = identified(USUAL, NOISE, 6.0, 8.0)
    far = centre + np.array([0.02, -0.01, 0.1, 0.05, 0.01])
    tempered = SETTINGS.temper * squares(replace(known.untempered(), spread=np.eye(5) * 1e9), far)
    assert tempered == pytest.approx(squares(replace(known, spread=np.eye(5) * 1e9), far), rel=1e-3)
    bare = usual(USUAL, 6.0)
    assert bare.untempered() is bare


def test_what_a_model_tells_is_as_probable_as_its_response() -> None:
    # So little is left open that the response is straight over it: a normal distribution.
    centre, known = identified(USUAL, NOISE, 6.0, 8.0)
    narrow = replace(known, mean=centre, spread=np.diag([1e-4, 1e-4, 1e-3, 1e-3, 1e-4]) ** 2)
    response = response_of(narrow)
    slopes = response.root @ response.slopes(centre)
    covariance = response.root @ response.root.T + slopes @ narrow.spread @ slopes.T
    left = response.values - step_response(response.times_s, *to_x(centre)) / response.gain
    naive = multivariate_normal(np.zeros(left.size), covariance).logpdf(left)
    assert narrow.log_evidence(centre) == pytest.approx(float(naive), abs=0.02)
    assert usual(USUAL, 6.0).log_evidence(centre) == 0.0


def test_a_model_of_the_campaign_itself_tells_what_is_usual() -> None:
    known = usual(USUAL, 6.0)
    assert known.response is None
    assert known.shifted(known.mean) is known
    np.testing.assert_allclose(known.mean, to_z(USUAL), atol=0.02)


def test_a_usual_actuator_is_its_own_centre() -> None:
    centre, _ = identified(USUAL, NOISE, 6.0, 8.0)
    np.testing.assert_allclose(centre, to_z(USUAL), atol=0.02)


def level(repeats: int, compared: bool, value: float) -> float:
    spectrum = Spectrum(0.01, np.full(CORRELATION_S.size, 0.01), repeats)
    noise = BenchNoise(spectrum, Scatter(0.01, 0.2, 0.01), UNKNOWN, compared)
    return level_prior(SimpleNamespace(noise=noise), value)  # type: ignore[arg-type]


def test_noise_is_no_more_than_twice_what_repeats_or_a_reference_say() -> None:
    assert np.isinf(level(8, False, 2.9))
    assert np.isinf(level(0, True, 2.9))
    assert np.isfinite(level(8, False, 2.0))
    assert np.isfinite(level(0, False, 2.9))
    assert level(8, False, 1.0) == 0.0 > level(8, False, 1.4) > level(8, False, 2.0)


@pytest.mark.parametrize("noise_deg", [0.0, 0.05, 0.1, 0.2, 0.6])
def test_a_step_hides_what_noise_of_its_size_does_not_show(noise_deg: float) -> None:
    step, rng = 0.5, np.random.default_rng(1)
    angle = np.linspace(0.0, 5.0, 400)
    noise = noise_deg * rng.normal(size=(2000, angle.size))
    read = step * np.round((angle + noise) / step)
    shared = float(np.std(read.mean(axis=0) - angle))  # the same in all repeats
    seen = float(np.hypot(noise_deg, step / np.sqrt(12.0)))
    q = step_deg_of([SimpleNamespace(angle_deg=read[0])])  # type: ignore[list-item]
    evidence = SimpleNamespace(step_deg=q, noise_deg=seen, line_deg=0.0)
    found = hidden_deg(evidence)  # type: ignore[arg-type]
    assert found == pytest.approx(shared, rel=0.3, abs=0.02)


@pytest.mark.parametrize("repeats", [3, 8, 40])
def test_a_scatter_is_hardly_ever_beyond_its_bound(repeats: int) -> None:
    rng = np.random.default_rng(repeats)
    estimates = np.sqrt(rng.chisquare(repeats, 200_000) / repeats)
    beyond = np.mean(most(repeats) * estimates < 1.0)
    if most(repeats) < most(0):
        assert beyond == pytest.approx(1e-3, rel=0.4)
    assert most(repeats) <= most(0)


def test_a_model_says_by_how_much_it_errs() -> None:
    models = [{"model": "fractional order", "rms_deg": 0.8}, {"model": "other", "rms_deg": 0.1}]
    orders = {"models": models, "independent_samples": 20.0}
    model = Model("arm", "rubber", TABLE_I["design_1"], 30.0, extra={"orders": orders})
    assert error_of(model) == pytest.approx(0.4 * SETTINGS.model_error)
    for unsaid in ({}, {"orders": None}, {"orders": {"models": models[1:]}}):
        assert error_of(replace(model, extra=unsaid)) is None

    def of_gain(error_deg: float | None) -> float:
        centre, known = identified(USUAL, NOISE, 6.0, 8.0, 30.0, error_deg)
        louder = centre + np.array([0.0, 0.0, 0.0, 0.0, 0.01])
        return squares(known, louder) - squares(known, centre)

    assert of_gain(2.0) < 0.5 * of_gain(0.0)
    said_nothing, sure = of_gain(None), of_gain(0.0)
    assert 0.7 * sure < said_nothing < 0.95 * sure
