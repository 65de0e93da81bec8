"""How a sensor comes from its calibration, and what it reads before it is moved."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from plant_cases import KPA, X, step_release, trials, vector
from spa_fo.plant.chain import chain_for
from spa_fo.plant.grid import campaign_grid
from spa_fo.plant.monotone import monotone_at, monotone_slopes
from spa_fo.plant.specimen import FILM, Memory, Mounting

KNOWN = np.arange(0.0, 91.0, 15.0)
BIAS = np.array([1.4, 0.5, 0.1, -0.1, -0.3, -1.0, -2.9])


def mounting(bias=BIAS):
    return Mounting(known_deg=KNOWN, bias_deg=bias)


def test_the_calibrated_curve_is_right_at_the_known_angles():
    np.testing.assert_allclose(mounting().logged_deg(KNOWN + BIAS), KNOWN, atol=1e-4)


def test_it_is_the_curve_that_a_calibration_would_draw():
    reading = np.linspace(KNOWN[0] + BIAS[0], KNOWN[-1] + BIAS[-1], 50)
    drawn = PchipInterpolator(KNOWN + BIAS, KNOWN)(reading)
    np.testing.assert_allclose(mounting().logged_deg(reading), drawn, atol=1e-4)


@given(st.lists(st.floats(-8.0, 8.0), min_size=2, max_size=7))
@settings(max_examples=100, deadline=None)
def test_its_cubic_is_scipys(bias):
    known, bias = KNOWN[: len(bias)], np.array(bias)
    read = np.maximum.accumulate(known + bias) + 1e-6 * np.arange(known.size)
    at = np.linspace(read[0], read[-1], 40)
    drawn = PchipInterpolator(read, known)
    slopes = monotone_slopes(read, known)
    np.testing.assert_allclose(slopes, drawn.derivative()(read), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(monotone_at(read, known, slopes, at), drawn(at), atol=1e-9)


def test_what_is_no_number_is_drawn_nowhere():
    assert np.isnan(mounting().logged_deg(np.array([np.nan]))).all()


def test_beyond_its_ends_it_goes_straight_on():
    beyond = mounting(0.05 * KNOWN).logged_deg(np.array([-10.5, 105.0]))
    np.testing.assert_allclose(beyond, [-10.0, 100.0], atol=1e-4)


@given(st.lists(st.floats(-40.0, 40.0), min_size=7, max_size=7))
@settings(max_examples=50, deadline=None)
def test_it_never_runs_backwards(bias):
    logged = mounting(np.array(bias)).logged_deg(np.linspace(-60.0, 150.0, 400))
    assert np.all(np.diff(logged) >= -1e-9)


def test_without_bias_nothing_changes():
    reading = np.linspace(-5.0, 80.0, 9)
    assert Mounting().logged_deg(reading) is reading


@pytest.mark.parametrize("delay_s", [None, 0.3])
def test_a_film_that_rests_off_zero_reads_so_from_the_first_sample(delay_s):
    effects = vector("sensor_hysteresis", width_deg=6.0, turn_deg=8.0, lens=0.0)
    if delay_s is not None:
        late = vector("channel_latency", delay_s=delay_s, window_share=0.0)
        effects = np.where(np.isnan(late), effects, late)
    film = Memory().film.copy()
    film[0] = -1.0  # it was last bent back
    chain = chain_for(campaign_grid(trials(step_release()), longest=4), X, KPA)
    angle, _ = chain.mounted(Mounting(film=film)).run(X, effects)
    at_rest = chain.grid.time_s < 0.5
    np.testing.assert_allclose(angle[at_rest], 3.0, atol=1e-9)


@pytest.mark.parametrize("kind", [Mounting, Memory])
def test_a_film_of_before_lags_had_a_tail_has_none(kind) -> None:
    document = kind().to_dict()
    assert kind.from_dict(document | {"film": document["film"][:-1]}).film.size == FILM
    with pytest.raises(ValueError, match="film"):
        kind.from_dict(document | {"film": document["film"][:-2]})
