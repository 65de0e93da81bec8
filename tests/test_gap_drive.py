"""Fits of the measured pressure, and the true pressure that follows."""

from dataclasses import replace

import numpy as np
import pytest

from plant_cases import KPA, SIXTY, X, campaign_data, step_release, trials
from spa_fo import simulate
from spa_fo.gap.data.evidence import collect
from spa_fo.gap.search.drive import examine_drive
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.memory import FINEST_STEP_S

NOISE_KPA = 0.1
RARE = tuple(name for name in LIBRARY if LIBRARY[name].odds < 1.0)  # tried where these do not do


def driven(delays_s, levels_kpa=(SIXTY,), leak_per_s=0.0):
    """Trials of jumps that the drive follows late, each after a delay of its own."""
    rng = np.random.default_rng(3)
    own = []
    commands = [step_release(level) for level in levels_kpa for _ in delays_s]
    for trial, delay_s in zip(trials(*commands), list(delays_s) * len(levels_kpa), strict=True):
        # The command of a row holds until the next one's time.
        at = np.searchsorted(trial.t_s, trial.t_s - delay_s - 1e-9, side="left") - 1
        pressure = np.where(at >= 0, trial.command_kpa[np.maximum(at, 0)], 0.0)
        pressure = pressure * np.exp(-leak_per_s * trial.t_s)
        angle = np.degrees(simulate(trial.t_s, pressure / KPA, *X, hold="zero"))
        noisy = pressure + NOISE_KPA * rng.normal(size=pressure.size)
        own.append(
            replace(
                trial,
                pressure_kpa=noisy,
                angle_deg=angle + 0.1 * rng.normal(size=angle.size),
            )
        )
    return collect(campaign_data(own))


def best(found, count):
    fits = [fit for ids, fit in found.fits.items() if len(ids) == count]
    return max(fits, key=lambda fit: fit.evidence.max())


@pytest.mark.parametrize("delay_s", [0.08, 0.34, 0.9])
def test_a_delay_of_any_length_is_found(delay_s):
    found = examine_drive(driven([delay_s] * 3), RARE, X)
    assert best(found, 1).ids == ("dead_time",)
    assert best(found, 1).z[0] == pytest.approx(delay_s, abs=0.03)
    assert found.gap_deg > 0.3


def test_what_is_weak_alone_is_tried_beside_the_best():
    found = examine_drive(driven([0.3] * 4, leak_per_s=0.01), RARE, X)
    assert best(found, 1).ids == ("dead_time",)
    assert "dead_time" in best(found, 2).ids
    # Where nothing may be missed the second effect counts for a great deal.
    assert best(found, 2).evidence[0] > best(found, 1).evidence[0] + 100.0


def test_the_angle_is_driven_by_what_each_trial_was():
    delays = [0.20, 0.26, 0.32, 0.38]
    evidence = driven(delays)
    pressure = examine_drive(evidence, RARE, X).pressure_kpa
    grid = evidence.grid
    for trial, delay_s in enumerate(delays):
        first, end = grid.cell_starts[trial : trial + 2]
        rise = np.argmax(pressure[first:end] > 0.5 * SIXTY) * FINEST_STEP_S
        assert rise == pytest.approx(0.5 + delay_s, abs=0.035)


def test_a_drive_that_follows_its_command_has_no_gap():
    found = examine_drive(driven([0.0] * 4), RARE, X)
    assert found.gap_deg < 0.3  # a sample's time, at a jump
    none = found.fits[()].evidence.max()
    assert all(fit.evidence.max() < none + 0.5 for fit in found.fits.values())


def test_a_drive_effect_may_be_left_out():
    found = examine_drive(driven([0.3] * 3), ("dead_time", *RARE), X)
    assert all("dead_time" not in ids for ids in found.fits)
