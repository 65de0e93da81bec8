"""Readings that are held for a while, and logs whose readings are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify_cases import trial
from spa_fo.rig import Trial
from spa_fo.rig.held_readings import held as told
from spa_fo.rig.held_readings import holds_of

RATE = 50.0


def smooth(number: int, noise_deg: float = 0.0) -> Trial:
    """A step and its release, as read anew for every row."""
    command = np.repeat([0.0, 20.0 + 5.0 * number, 0.0], [50, 300, 300])
    return trial(command, RATE, noise_deg=noise_deg, number=number, order=number)


def held(one: Trial, period_s: float, begins_s: float, noise_deg: float = 0.0) -> Trial:
    """The same where the angle is read every `period_s` alone; each row has noise of its own."""
    # A row at the very moment of a reading shows it.
    read_s = np.floor((one.t_s - begins_s) / period_s + 1e-9) * period_s + begins_s
    angle_deg = np.interp(read_s, one.t_s, one.angle_deg)
    noise = noise_deg * np.random.default_rng(one.order).standard_normal(one.t_s.size)
    return replace(one, angle_deg=angle_deg + noise)


def expected(one: Trial, period_s: float, begins_s: float) -> np.ndarray:
    """Seconds since the middle of the hold, as the definition has it."""
    out = []
    for t in one.t_s:
        number = np.floor((t - begins_s) / period_s)
        out.append(t - begins_s - (number + 0.5) * period_s)
    return np.array(out)


def test_holds_are_found_with_period_and_phase() -> None:
    """Every trial may begin at a moment of its own within a hold; a motion lasts several.

    Three motions may be so few that a shorter hold explains them as well, or noise hides them.
    """
    rng, right = np.random.default_rng(4), 0
    plain = [smooth(number) for number in (1, 2, 3)]
    for _ in range(100):
        period_s, noise_deg = rng.uniform(0.07, 0.3), rng.choice([0.0, 0.05])
        begins = rng.uniform(0.0, period_s, len(plain))
        trials = [held(one, period_s, t, noise_deg) for one, t in zip(plain, begins, strict=True)]
        holds = holds_of(trials)
        if holds is None:
            continue
        errors = []
        for one, log, begins_s in zip(plain, trials, begins, strict=True):
            moving = np.abs(np.gradient(one.angle_deg, one.t_s)) > 5.0
            away = holds.since_middle(log) - expected(one, period_s, begins_s)
            errors.append(np.abs(away - period_s * np.round(away / period_s))[moving])
        # When exactly between two rows a reading was taken nobody can tell.
        right += bool(np.quantile(np.concatenate(errors), 0.9) < 1.0 / RATE)
    assert right >= 95


@pytest.mark.parametrize("noise_deg", [0.0, 0.05, 0.5])
def test_readings_that_are_taken_anew_are_not_held(noise_deg: float) -> None:
    assert holds_of([smooth(number, noise_deg) for number in (1, 2, 3)]) is None


def test_a_coarse_converter_holds_nothing() -> None:
    trials = [smooth(number) for number in (1, 2, 3)]
    coarse = [replace(one, angle_deg=np.round(one.angle_deg / 0.5) * 0.5) for one in trials]
    assert holds_of(coarse) is None


def test_logs_without_motion_or_without_an_angle_tell_nothing() -> None:
    one = smooth(1)
    for nothing in (np.zeros(one.t_s.size), np.full(one.t_s.size, np.nan)):
        assert holds_of([replace(one, angle_deg=nothing)]) is None
    assert holds_of([]) is None


def test_a_short_trial_beside_others_has_its_times_too() -> None:
    plain = [smooth(number) for number in (1, 2)]
    short = {
        name: getattr(plain[1], name)[:5] if getattr(plain[1], name) is not None else None
        for name in ("t_s", "command_kpa", "pressure_kpa", "flex_adc", "angle_deg")
    }
    masks = {name: getattr(plain[1], name)[:5] for name in ("after_reset", "outside_calibration")}
    trials = [held(plain[0], 0.2, 0.0), replace(plain[1], **short, **masks)]
    holds = holds_of(trials)
    assert holds is not None
    assert [holds.since_middle(one).size for one in trials] == [plain[0].t_s.size, 5]


def test_a_line_tells_that_readings_are_held() -> None:
    plain = [smooth(number) for number in (1, 2, 3)]
    (line,) = told([held(one, 0.2, 0.0) for one in plain])
    assert "read anew every 0.2 s only, while rows come every 0.02 s" in line
    assert not list(told(plain))
