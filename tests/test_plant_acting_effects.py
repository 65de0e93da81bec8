"""The library's effects that act on a series: against slow twins, and against their physics."""

from __future__ import annotations

import math
import sys
from itertools import pairwise

import numpy as np
import pytest

import naive_plant as naive
from plant_cases import X, parameters, step_release, trials, triangle, vector
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.explanations import beforehand
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import chain
from spa_fo.plant.effects.drive_overshoot import peak
from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.library import CONTRACT, IDS, LIBRARY, absent
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.plant.stages import true_pressure
from test_plant_effects import CELL, angles, jerky

ACTING = tuple(name for name in IDS if LIBRARY[name].act is not None)


def act(effect: str, *series: np.ndarray, **changes: float) -> np.ndarray:
    function = LIBRARY[effect].act
    assert function is not None
    return np.asarray(function(*series, *parameters(effect, **changes).values()))


def middles(lengths: np.ndarray) -> np.ndarray:
    return np.asarray(np.cumsum(lengths) - 0.5 * lengths)


def fine(signal: np.ndarray) -> np.ndarray:
    return np.repeat(signal, CELL)


def coarse(signal: np.ndarray) -> np.ndarray:
    return np.asarray(signal.reshape(-1, CELL).mean(axis=1))


def uneven(n: int = 400) -> np.ndarray:
    """Lengths of steps, s: short, long, short again, each some whole milliseconds."""
    return np.random.default_rng(3).choice([0.02, 0.04, 0.16, 0.32], n)


def spread(signal: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Hold each step's value for its milliseconds."""
    return np.repeat(signal, np.round(lengths / naive.MS).astype(int))


def gathered(signal: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    ends = np.concatenate([[0], np.cumsum(np.round(lengths / naive.MS).astype(int))])
    return np.array([signal[first:end].mean() for first, end in pairwise(ends.tolist())])


LEVELS = np.repeat([0.0, 20.0, 55.0, 30.0, 0.0, 40.0, 0.0, 5.0], 50)


# --- drive -----------------------------------------------------------------------------------


def driven(name: str, command: np.ndarray, **changes: float) -> np.ndarray:
    starts = np.array([0, command.size])
    return true_pressure(command, starts, vector(name, **changes), np.zeros(2))


@pytest.mark.parametrize("damping", [0.05, 0.3, 1.0, 1.7])
def test_an_overshoot_against_a_fine_loop(damping: float) -> None:
    slow = naive.ringing(fine(jerky()), 0.15, 1.2, damping)
    found = driven("drive_overshoot", jerky(), damping=damping)
    np.testing.assert_allclose(found, coarse(slow), atol=0.06)


@pytest.mark.parametrize("damping", [0.1, 0.999999999, 1.0, 1.8])
def test_an_overshoot_is_as_large_as_it_says_and_leaves_the_level(damping: float) -> None:
    step = np.full(6000, 50.0)
    found = driven("drive_overshoot", step, fraction=0.2, period_s=4.0, damping=damping)
    assert found.max() == pytest.approx(60.0, abs=0.05)
    assert found[-1] == pytest.approx(50.0, abs=1e-6)
    assert peak(1.0) == pytest.approx(math.exp(-1.0))


# --- actuator --------------------------------------------------------------------------------


def test_a_gain_that_grows_and_one_that_falls() -> None:
    p, time = np.array([0.0, 30.0, 60.0]), np.arange(3.0)
    for growth, exponent in ((0.05, 1.0), (-0.05, 1.0), (0.02, 2.0)):
        found = act("gain_growth", p, time, growth=growth, exponent=exponent)
        np.testing.assert_allclose(found, p * (1.0 + growth * (p / 30.0) ** exponent), rtol=0.006)
    assert (act("gain_growth", p[1:], time[1:], growth=-2.0) > 0.0).all()


def test_a_pressure_to_a_power_is_such_a_gain() -> None:
    p = np.linspace(10.0, 60.0, 50)
    wanted = p**1.22 / 30.0**0.22

    def apart(growth: float, exponent: float) -> float:
        found = act("gain_growth", p, p, growth=growth, exponent=exponent)
        scale = (found @ wanted) / (found @ found)
        return float(np.abs(scale * found / wanted - 1.0).max())

    assert min(apart(g, n) for g in np.linspace(0.1, 1.0, 10) for n in (0.4, 0.6, 1.0)) < 0.03


def test_a_fold_opens_above_its_threshold() -> None:
    p = np.array([-1.0, 0.0, 0.5, 4.0, 40.0, 80.0])
    found = act("opening_fold", p, p, opening_kpa=4.0, sharpness=3.0)
    np.testing.assert_allclose(found[-2:], p[-2:] - 4.0, atol=0.01)
    assert found[:2].tolist() == [-1.0, 0.0]
    assert found[2] < 0.01
    assert found[3] == pytest.approx(4.0 * (1.0 - 2.0 ** (-1.0 / 3.0)))
    assert np.isfinite(act("opening_fold", p, p, opening_kpa=1e-9, sharpness=20.0)).all()


def test_a_set_against_a_loop_of_milliseconds() -> None:
    lengths, p = uneven(), LEVELS
    share = (p / 30.0) ** 3
    slow = naive.ratchet(spread(share / (1.0 + share), lengths), 3.0, 40.0)
    found = act("pressure_set", p, middles(lengths), set_kpa=2.0, building_s=3.0, recovery_s=40.0)
    np.testing.assert_allclose(found - p, 2.0 * gathered(slow, lengths), atol=0.02)


def test_a_set_ratchets_saturates_and_fades() -> None:
    # Ten pulses of 10 s with rests of 10 s, then a rest of five times the recovery.
    lengths = np.concatenate([np.full(1000, 0.2), np.full(100, 10.0)])
    p = np.concatenate([np.tile(np.repeat([60.0, 0.0], 50), 10), np.zeros(100)])
    found = act("pressure_set", p, middles(lengths), building_s=8.0, recovery_s=200.0) - p
    rests = found[99:1000:100]
    assert (np.diff(rests) > 0.0).all()
    assert np.diff(rests)[-1] < 0.1 * rests[0]
    assert rests[-1] < 2.0
    assert found[-1] < 0.02


def test_a_body_mode_against_a_fine_loop() -> None:
    lengths = uneven()
    slow = naive.oscillator(spread(LEVELS, lengths), math.pi, 0.05)
    found = act("body_mode", LEVELS, middles(lengths), share=1.0, frequency_hz=0.5, damping=0.05)
    np.testing.assert_allclose(found, gathered(slow, lengths), atol=0.1)


def test_a_body_swings_at_its_frequency_and_dies_away() -> None:
    time = FINEST_STEP_S * (np.arange(1000) + 0.5)
    p = np.full(time.size, 50.0)
    swing = (act("body_mode", p, time, share=0.3, frequency_hz=0.5, damping=0.1) - p) / 50.0
    slower = math.pi * math.sqrt(1.0 - 0.01)
    exact = -np.exp(-0.1 * math.pi * time) * (
        np.cos(slower * time) + 0.1 * math.pi / slower * np.sin(slower * time)
    )
    np.testing.assert_allclose(swing, 0.3 * exact, atol=1e-3)


@pytest.mark.parametrize("lag", [0.4, -0.4])
def test_damping_that_goes_with_the_pressure_against_a_loop(lag: float) -> None:
    lengths = uneven()
    p = spread(LEVELS, lengths)
    empty = np.exp(-p / 15.0)
    slow = naive.trailing(p, lag * (1.0 - empty) if lag > 0.0 else -lag * empty)
    found = act("pressure_damping", LEVELS, middles(lengths), lag_s=lag)
    np.testing.assert_allclose(found, gathered(slow, lengths), atol=0.02)


def test_the_inflated_actuator_is_slower_or_the_empty_one() -> None:
    own = trials(step_release(), step_release(10.0))
    plain = angles(own, absent())
    for lag, slow, quick in ((0.4, 0, 1), (-0.4, 1, 0)):
        found = angles(own, vector("pressure_damping", lag_s=lag))
        missing = [1.0 - one[40] / other[40] for one, other in zip(found, plain, strict=True)]
        assert missing[slow] > 1.2 * missing[quick] > 0.0


# --- sensor ----------------------------------------------------------------------------------


def test_the_size_of_a_rotation_is_never_negative() -> None:
    angle = np.linspace(-20.0, 60.0, 81)
    found = act("unsigned_reading", angle, angle, share=1.0, across_deg=3.0, zero_deg=0.0)
    np.testing.assert_allclose(found, np.sqrt(angle**2 + 9.0))
    assert found.min() == pytest.approx(3.0)
    # Tared where it is bent, what is less than that is read as more.
    tared = act("unsigned_reading", angle, angle, share=1.0, across_deg=0.005, zero_deg=10.0)
    np.testing.assert_allclose(tared, 10.0 + np.abs(angle - 10.0), atol=0.006)


# --- all of them -----------------------------------------------------------------------------


UNSEEN = ("drive_hunting", "supply_limit", "tear")  # in the logs at hand


def test_they_stand_behind_the_contracts() -> None:
    assert IDS[: len(CONTRACT)] == CONTRACT
    assert IDS[len(CONTRACT) :] == ACTING
    for name in ACTING:
        effect: Effect = LIBRARY[name]
        assert 0.0 < effect.odds < 1.0
        assert effect.shown_in
        assert effect.equivalents
        assert set(effect.equivalents) <= set(IDS)
        assert effect.act is not None
        said = str(sys.modules[effect.act.__module__].__doc__)
        assert ("Seen in" in " ".join(said.split())) is (name not in UNSEEN), name


def test_what_is_known_beforehand_adds_up_to_one() -> None:
    singles = [math.exp(log_prior((name,))) for name in IDS]
    assert sum(singles) == pytest.approx(SETTINGS.single)
    assert singles[0] / singles[-1] == pytest.approx(1.0 / LIBRARY[IDS[-1]].odds)
    left = [n for n in IDS if n != "parameter_shift"]
    pairs = sum(
        math.exp(log_prior((one, other))) for i, one in enumerate(left) for other in left[:i]
    )
    beside = sum(math.exp(log_prior(("parameter_shift", name))) for name in left)
    assert pairs + beside / SETTINGS.shift_beside == pytest.approx(SETTINGS.pair)
    assert beforehand(IDS[:2]) == 0.0
    assert beforehand(ACTING[:1]) < 0.0


def test_an_effect_that_looks_at_the_pressure_alone_is_simulated_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    runs: list[int] = []
    move = chain.move
    monkeypatch.setattr(chain, "move", lambda *a: (runs.append(1), move(*a))[1])
    own = trials(step_release(), triangle())
    angles(own, vector("gain_growth"), X)
    assert len(runs) == 1


def test_a_torn_actuator_bends_less_from_a_moment_on() -> None:
    time = np.arange(0.0, 100.0, 0.02)
    p = 30.0 * np.sin(0.3 * time) ** 2
    for lost in (0.3, -0.2):
        found = act("tear", p, time, lost=lost, since=0.4)
        before, after = time < 0.39 * time[-1], time > 0.41 * time[-1]
        np.testing.assert_allclose(found[before], p[before], atol=0.01)
        np.testing.assert_allclose(found[after], (1.0 - lost) * p[after], atol=0.01)


def test_a_sensor_that_came_off_reads_the_rest_and_a_level() -> None:
    time = np.arange(0.0, 100.0, 0.02)
    angle = 30.0 * np.sin(0.3 * time) ** 2
    found = act("sensor_detachment", angle, time, lost=0.6, level_deg=3.0, since=0.4)
    before, after = time < 0.39 * time[-1], time > 0.41 * time[-1]
    np.testing.assert_allclose(found[before], angle[before], atol=0.01)
    np.testing.assert_allclose(found[after], 0.4 * angle[after] + 3.0, atol=0.01)
    dead = act("sensor_detachment", angle, time, lost=1.0, level_deg=0.0, since=0.001)
    assert np.abs(dead[time > 1.0]).max() < 0.1


def test_a_reading_that_froze_keeps_what_it_read_then() -> None:
    time = np.arange(0.0, 100.0, 0.02)
    angle = 30.0 * np.sin(0.3 * time) ** 2
    found = act("sensor_freeze", angle, time, held=1.0, since=0.43)
    before, after = time < 0.42 * time[-1], time > 0.44 * time[-1]
    np.testing.assert_allclose(found[before], angle[before], atol=0.01)
    then = float(angle[np.argmin(np.abs(time - 0.43 * time[-1]))])
    np.testing.assert_allclose(found[after], then, atol=0.2)
    sticking = act("sensor_freeze", angle, time, held=0.5, since=0.43)
    np.testing.assert_allclose(sticking[after], 0.5 * (found + angle)[after], atol=1e-9)


def tooth(phase: float, turn: float) -> float:
    return phase / turn if phase < turn else (1.0 - phase) / (1.0 - turn)


def test_a_regulator_that_rings_swings_about_the_command() -> None:
    cell_s = CELL * naive.MS
    pressure = np.repeat([0.0, 20.0], 500)
    time = cell_s * (np.arange(pressure.size) + 0.5)
    found = act("drive_hunting", pressure, time, fall=0.2, period_s=1.5, back=1.0, about=0.5)
    fine_time = naive.MS * (np.arange(500 * CELL) + 0.5)
    swing = np.array([tooth((t / 1.5 + 0.25) % 1.0, 0.5) for t in fine_time])
    np.testing.assert_allclose(found[500:], 20.0 * (1.0 - 0.2 * (coarse(swing) - 0.5)), atol=0.02)
    assert (found[500:].min(), found[500:].max()) == pytest.approx((18.0, 22.0), abs=0.1)


def test_a_supply_gives_no_more_than_it_has() -> None:
    time, asked = CELL * naive.MS * (np.arange(600) + 0.5), np.linspace(0.0, 50.0, 600)
    found = act("supply_limit", asked, time, highest_kpa=30.0, knee=0.002)
    np.testing.assert_allclose(found, np.minimum(asked, 30.0), atol=0.06)
    blunt = act("supply_limit", asked, time, highest_kpa=30.0, knee=0.2)
    assert (np.diff(blunt) > 0.0).all()
    assert blunt[0] == pytest.approx(0.0, abs=1e-9)
    assert blunt.max() < 30.0


def test_a_regulator_that_hunts_lets_a_held_pressure_fall_and_corrects_it() -> None:
    cell_s = CELL * naive.MS
    pressure = np.repeat([0.0, 20.0, 8.0], 500)
    time = cell_s * (np.arange(pressure.size) + 0.5)
    saw = {"fall": 0.25, "period_s": 1.7, "back": 0.0, "about": 0.0}
    found = act("drive_hunting", pressure, time, **saw)
    fine_time = naive.MS * (np.arange(pressure.size * CELL) + 0.5)
    held_s = np.concatenate([fine_time[: 500 * CELL]] * 3)
    lost = np.array([tooth((t / 1.7) % 1.0, 0.99) for t in held_s])
    np.testing.assert_allclose(found, coarse(fine(pressure) * (1.0 - 0.25 * lost)), atol=0.02)
    assert found[:500].max() == 0.0
    assert found[500:1000].min() == pytest.approx(15.0, abs=0.1)
    # A command that always moves is never held.
    ramp = np.linspace(0.0, 20.0, 500)
    moving = act("drive_hunting", ramp, time[:500], **saw)
    np.testing.assert_allclose(moving, ramp, rtol=0.25 * cell_s / 1.7)
