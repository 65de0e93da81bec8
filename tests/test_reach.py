"""What is plausible of an effect goes with how far a rig goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant_cases import SIXTY, campaign_data, step_release, trials
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.plant.effects.effect import (
    USUAL_DEG,
    USUAL_KPA,
    USUAL_RISE_S,
    Reach,
    amplitude,
    shape,
)
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.report.glossary import typical

TURN = shape("turn_deg", "deg", centre=20.0, factor=2.0, low=1.0, high=90.0, starts=(10.0, 40.0))
PLAY = amplitude("play_kpa", "kPa", spread=2.0, high=30.0, start=1.0)


def test_degrees_go_with_the_angle_and_kpa_with_the_pressure() -> None:
    turn, play = (each.at(Reach(0.5, 3.0)) for each in (TURN, PLAY))
    assert (turn.centre, turn.starts, turn.spread) == (10.0, (5.0, 20.0), TURN.spread)
    assert (play.centre, play.starts, play.spread) == (0.0, (3.0,), 6.0)
    assert (turn.low, turn.high, play.high) == (1.0, 90.0, 30.0)
    lag = amplitude("lag_s", "s", spread=0.1, high=3.0, start=0.1)
    assert lag.at(Reach(0.1, 10.0)) == lag


def test_times_go_with_the_time_in_which_a_rig_rises() -> None:
    lag = amplitude("lag_s", "s", spread=0.1, high=3.0, start=0.1)
    slow = lag.at(Reach(time=5.0))
    assert (slow.spread, slow.starts, slow.high) == (0.5, (0.5,), 3.0)
    rate = shape("rate", "kPa/s", centre=100.0, factor=2.0, low=1.0, high=1e3)
    assert rate.at(Reach(pressure=3.0, time=5.0)).centre == pytest.approx(60.0)
    tone = amplitude("tone_hz", "Hz", spread=1.0, high=9.0, start=1.0)  # nothing of the rig's own
    assert tone.at(Reach(time=5.0)) == tone
    late = LIBRARY["sensor_lag"].parameters[0]
    assert late.at(Reach(time=3.0)).starts == tuple(3.0 * each for each in late.starts)


def test_powers_of_its_own_stand_before_the_unit() -> None:
    growth = LIBRARY["gain_growth"].parameters[0]
    assert growth.at(Reach(0.2, 5.0)).spread == pytest.approx(growth.spread / 5.0)
    assert replace(PLAY, goes_with=(0.0, 0.0)).at(Reach(2.0, 9.0)).spread == PLAY.spread


def test_what_only_repeats_tell_stays_without_them() -> None:
    by_peak = LIBRARY["mullins_softening"].parameters[-1]
    assert by_peak.by_repeats
    assert by_peak.at(Reach()) == by_peak
    assert by_peak.at(Reach(repeats=False)) == replace(by_peak, spread=0.01 * by_peak.spread)
    loadings = LIBRARY["mullins_softening"].parameters[1]
    assert loadings.at(Reach(repeats=False)) == loadings


@given(st.floats(0.01, 10.0), st.floats(0.01, 100.0), st.floats(0.1, 10.0))
def test_centres_and_starts_stay_within_bounds(angle: float, pressure: float, time: float) -> None:
    for effect in LIBRARY.values():
        for parameter in effect.parameters:
            there = parameter.at(Reach(angle, pressure, time=time))
            assert there.spread > 0.0
            assert all(there.low <= v <= there.high for v in (there.centre, *there.starts))


def reaching(angle: float = 1.0, pressure: float = 1.0, kpa: float = SIXTY) -> Evidence:
    """Make a campaign of a step whose angle and pressure are scaled."""
    own = tuple(
        replace(
            trial,
            angle_deg=angle * np.interp(trial.t_s, [1.0, 2.0], [0.0, 40.0]),
            command_kpa=pressure * trial.command_kpa,
        )
        for trial in trials(step_release(kpa), step_release(0.5 * kpa))
    )
    return collect(campaign_data(own))


def test_a_campaign_reaches_its_largest_angle_and_pressure() -> None:
    reach = reaching().reach
    assert reach.angle == pytest.approx(40.0 / USUAL_DEG, rel=0.01)
    assert reach.pressure == pytest.approx(SIXTY / USUAL_KPA)
    further = reaching(angle=3.0, pressure=0.1).reach
    assert further.angle == pytest.approx(3.0 * reach.angle, rel=0.01)
    assert further.pressure == pytest.approx(0.1 * reach.pressure)


def test_a_short_pulse_counts_and_a_dropout_does_not() -> None:
    (trial,) = trials(step_release(SIXTY))
    pulse = np.where((trial.t_s > 2.0) & (trial.t_s < 2.1), SIXTY, 0.0)
    angle = np.where(np.arange(trial.t_s.size) == 300, 500.0, 0.1 * trial.t_s)
    found = collect(campaign_data((replace(trial, command_kpa=pulse, angle_deg=angle),)))
    assert found.reach.pressure == pytest.approx(SIXTY / USUAL_KPA)
    assert found.reach.angle < 5.0 / USUAL_DEG


def test_a_search_may_be_narrower_than_what_a_model_file_may_hold() -> None:
    typical_s = LIBRARY["creep"].parameters[1]
    assert typical_s.low < typical_s.at(Reach()).low == USUAL_RISE_S
    assert typical_s.at(Reach(time=3.0)).low == pytest.approx(3.0 * USUAL_RISE_S)
    approach = next(p for p in LIBRARY["slew_limit"].parameters if p.name == "approach_kpa")
    assert approach.at(Reach()).high == 9.0 < approach.high
    held = LIBRARY["sensor_freeze"].parameters[0]
    assert held.low == 0.0 < held.at(Reach()).low


def test_the_pages_say_what_is_typical_of_this_rig() -> None:
    assert typical(PLAY) == "up to 2"
    assert typical(PLAY.at(Reach(1.0, 5.0))) == "up to 10"


def test_a_ceiling_lies_beyond_what_the_same_sensor_has_read() -> None:
    ceiling = LIBRARY["sensor_saturation"].parameters[0]
    assert ceiling.beyond_read
    there = ceiling.at(Reach(read_deg=70.0))
    assert there.low == 70.0
    assert there.centre == 70.0
    assert min(there.starts) == 70.0
    assert ceiling.at(Reach()).low == ceiling.low
    knee = LIBRARY["sensor_saturation"].parameters[1]
    assert knee.at(Reach(read_deg=70.0)) == knee
