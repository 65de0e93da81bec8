"""Readings that go off for a sample or two are told from edges, turns and noise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from spa_fo.rig import CampaignData, Trial
from spa_fo.rig.dropouts import dropout_finding, mended, without_dropouts

T_S = np.arange(0.0, 20.0, 0.02)
NOISE_DEG = 0.1


def noisy(angle_deg: np.ndarray, seed: int = 0) -> np.ndarray:
    return angle_deg + NOISE_DEG * np.random.default_rng(seed).standard_normal(angle_deg.size)


SHAPES = {
    "rest": np.zeros(T_S.size),
    "step": np.where(T_S > 5.0, 60.0, 0.0),
    "rise": 60.0 * -np.expm1(-np.maximum(T_S - 5.0, 0.0) / 0.1),
    "triangle": 60.0 * np.abs((T_S / 4.0) % 2.0 - 1.0),
    "wave": 40.0 + 20.0 * np.sin(2.0 * np.pi * 2.0 * T_S),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_what_an_actuator_does_is_no_dropout(shape: str) -> None:
    for seed in range(5):
        angle = noisy(SHAPES[shape], seed)
        np.testing.assert_array_equal(mended(angle), angle)
        # As little where nothing hides it: of a simulation, or a converter with few counts.
        for clean in (SHAPES[shape], np.round(angle / 0.5) * 0.5):
            np.testing.assert_array_equal(mended(clean), clean)


def test_a_converter_that_jumps_between_two_readings_has_no_dropouts() -> None:
    """As a soft arm's camera does: nine readings in ten are one count, the others the next."""
    rng = np.random.default_rng(0)
    noise = 0.003 * rng.standard_normal(T_S.size)
    angle = 0.05 * (rng.random(T_S.size) < 0.1) + noise
    np.testing.assert_array_equal(mended(angle), angle)


@given(
    shape=st.sampled_from(sorted(SHAPES)),
    at=st.integers(0, T_S.size - 2),
    size=st.floats(60.0, 120.0),
    up=st.booleans(),
    long=st.integers(1, 2),
)
def test_a_dropout_is_read_as_what_is_about_it(
    shape: str, at: int, size: float, up: bool, long: int
) -> None:
    angle = noisy(SHAPES[shape])
    off = angle.copy()
    off[at : at + long] += size if up else -size
    assume(shape != "step" or abs(off[at + long - 1]) > 1.0)  # else it is a step that comes later
    found = mended(off)
    if 3 < at < T_S.size - 5:  # at an end nothing says that it comes back
        assert np.abs(found - angle).max() < 0.6 * size
    np.testing.assert_array_equal(found[[0, -1]], off[[0, -1]])
    away = np.arange(T_S.size)
    np.testing.assert_array_equal(found[np.abs(away - at) > 3], off[np.abs(away - at) > 3])


@pytest.mark.parametrize("share", [0.01, 0.06, 0.1])
def test_many_dropouts_are_dropouts(share: float) -> None:
    off = np.arange(3, T_S.size, round(1.0 / share))
    angle = noisy(SHAPES["rest"] + 60.0)
    dropped = angle.copy()
    dropped[off] = 0.0
    np.testing.assert_allclose(mended(dropped), angle, atol=6.0 * NOISE_DEG)


@pytest.mark.parametrize("at", [1, T_S.size - 2])
def test_what_comes_back_at_once_is_a_dropout_at_an_end_too(at: int) -> None:
    angle = noisy(SHAPES["rest"])
    off = angle.copy()
    off[at] += 60.0
    assert np.abs(mended(off) - angle).max() < 6.0 * NOISE_DEG


def overshooting(interval_s: float, hz: float, damping: float, noise_deg: float) -> Trial:
    """Give a trial whose angle swings after a step of its command."""
    t = np.arange(0.0, 20.0, interval_s)
    late, decay = np.maximum(t - 5.0, 0.0), 2.0 * np.pi * hz * damping
    swing = np.exp(-decay * late) * np.cos(2.0 * np.pi * hz * late)
    angle = np.where(t >= 5.0, 60.0 * (1.0 - swing), 0.0)
    none = np.zeros(t.size, dtype=bool)
    noise = noise_deg * np.random.default_rng(1).standard_normal(t.size)
    return Trial(
        experiment="step",
        trial=1,
        protocol="step",
        setpoint_deg=None,
        order=1,
        started_s=0.0,
        t_s=t,
        command_kpa=np.where(t >= 5.0, 50.0, 0.0),
        pressure_kpa=None,
        flex_adc=None,
        angle_deg=angle + noise,
        after_reset=none,
        outside_calibration=none,
    )


@pytest.mark.parametrize(("interval_s", "hz", "damping"), [(0.05, 4.0, 0.2), (0.1, 2.0, 0.3)])
@pytest.mark.parametrize("noise_deg", [0.0, 0.1])
def test_what_swings_as_fast_as_it_is_sampled_is_left(
    interval_s: float, hz: float, damping: float, noise_deg: float
) -> None:
    trial = overshooting(interval_s, hz, damping, noise_deg)
    off = trial.angle_deg.copy()
    off[[20, -20]] += 70.0  # before the step, and long after it
    data = CampaignData(cast(Any, None), (replace(trial, angle_deg=off),))
    found = without_dropouts(data).trials[0].angle_deg
    left = np.setdiff1d(np.arange(off.size), [20, off.size - 20])
    np.testing.assert_array_equal(found[left], trial.angle_deg[left])
    assert np.abs(found - trial.angle_deg).max() < 5.0
    (said,) = dropout_finding(data)
    assert said.endswith(f": 2 of {off.size}.")
    assert dropout_finding(CampaignData(cast(Any, None), (trial,))) == ()


@pytest.mark.parametrize("interval_s", [0.02, 0.04])
def test_a_sine_or_a_step_long_ago_hides_no_dropout(interval_s: float) -> None:
    trial = overshooting(interval_s, 4.0, 0.5, 0.1)
    t = trial.t_s
    assert trial.command_kpa is not None
    sine = 25.0 * (1.0 - np.cos(2.0 * np.pi * t / 3.5))
    driven = replace(trial, command_kpa=sine, angle_deg=sine + 0.05 * np.cos(40.0 * t))
    for one, at in ((driven, round(7.3 / interval_s)), (trial, round(5.6 / interval_s))):
        off = one.angle_deg.copy()
        off[at] += 30.0
        data = CampaignData(cast(Any, None), (replace(one, angle_deg=off),))
        found = without_dropouts(data).trials[0].angle_deg
        assert np.abs(found - one.angle_deg).max() < 2.0, at


def test_what_comes_back_to_where_it_was_is_no_swing() -> None:
    trial = overshooting(0.01, 0.2, 0.7, 0.2)
    off, at = trial.angle_deg.copy(), 502  # 20 ms after the step
    off[at] += 20.0
    data = CampaignData(cast(Any, None), (replace(trial, angle_deg=off),))
    found = without_dropouts(data).trials[0].angle_deg
    assert np.abs(found - trial.angle_deg).max() < 1.5
    np.testing.assert_array_equal(np.delete(found, at), np.delete(trial.angle_deg, at))


@pytest.mark.parametrize("rows", [1, 2])
def test_what_follows_a_pulse_of_the_input_is_no_dropout(rows: int) -> None:
    trial = overshooting(0.2, 4.0, 0.5, 0.1)
    assert trial.command_kpa is not None
    pulse = np.zeros(trial.t_s.size)
    pulse[40 : 40 + rows] = 50.0
    angle = 60.0 * pulse / 50.0 + 0.1 * np.random.default_rng(2).standard_normal(pulse.size)
    quick = replace(trial, command_kpa=pulse, angle_deg=angle)
    found = without_dropouts(CampaignData(cast(Any, None), (quick,))).trials[0].angle_deg
    np.testing.assert_array_equal(found, angle)


def test_samples_that_are_held_twice_are_left() -> None:
    held = np.repeat(SHAPES["triangle"][::8], 2)
    np.testing.assert_array_equal(mended(held), held)


def test_a_log_of_few_samples_is_left_alone() -> None:
    angle = np.array([0.0, 0.0, 50.0, 0.0, 0.0])
    assert mended(angle) is angle
