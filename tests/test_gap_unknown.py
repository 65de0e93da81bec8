"""When the diagnosis says that the library lacks the cause."""

from types import SimpleNamespace

import numpy as np
import pytest

from spa_fo.gap.pickup import is_other_in_fixture, is_uneven
from spa_fo.gap.unknown import KINDS, _is_made_up
from spa_fo.gap.verdict import TEMPER, Scored, log_prior, refit_probability
from spa_fo.plant.effects.library import IDS


def scored(ids, log_evidence, probability=1.0):
    explanation = SimpleNamespace(ids=ids, log_evidence=log_evidence)
    return Scored(explanation, ids, {}, 0.0, 0.0, 0.0, probability)


def candidates(refit, excluded=("parameter_shift",), own=False, drive=None):
    drives = {} if drive is None else {(): SimpleNamespace(log_evidence=drive)}
    free = {((), level): SimpleNamespace(log_evidence=refit) for level in ("shifted", "free")}
    return SimpleNamespace(angles=free, drives=drives, excluded=excluded, own=own)


@pytest.mark.parametrize(
    ("ids", "made_up"),
    [
        (("creep",), False),
        (("parameter_shift",), False),
        (("parameter_shift", "leak"), True),
        (("dead_time", "slew_limit"), True),
        (("sensor_creep", "channel_latency"), True),
        (("stiffening", "sensor_saturation"), True),
        (("dead_time", "leak"), False),
        (("creep", "sensor_creep"), False),
        (("stiffening", "hysteresis"), False),
    ],
)
def test_two_of_a_kind_look_made_up(ids, made_up):
    assert _is_made_up(ids) is made_up


def test_kinds_are_of_known_effects():
    assert set().union(*KINDS) <= set(IDS)


def test_other_coefficients_that_do_as_well_speak_against_any_effect():
    prior = log_prior(("creep",)) - log_prior(("parameter_shift",))
    as_good = refit_probability([scored(("creep",), 0.0)], candidates(prior / TEMPER))
    assert as_good == pytest.approx(0.5)
    assert refit_probability([scored(("creep",), 100.0)], candidates(0.0)) < 1e-9
    assert refit_probability([scored(("creep",), 0.0)], candidates(100.0)) > 0.999


def test_the_pressure_counts_too_where_it_was_measured():
    one = [scored(("leak",), 50.0)]
    alone = refit_probability(one, candidates(40.0))
    assert refit_probability(one, candidates(40.0, drive=-30.0)) < alone


def test_a_shift_that_may_be_named_is_no_sign():
    one = [scored(("creep",), 0.0)]
    assert refit_probability(one, candidates(100.0, excluded=())) == 0.0
    assert refit_probability(one, candidates(100.0, own=True)) == 0.0


def waves(trials, logs=()):
    angle = np.linspace(0.0, 5.0, len(trials) + len(logs))
    size = np.array([*trials, *logs])
    return SimpleNamespace(waves_deg=np.column_stack([size * np.cos(angle), size * np.sin(angle)]))


def evidence(trials):
    grid = SimpleNamespace(trials=[None] * trials)
    return SimpleNamespace(grid=grid, takes_part=np.ones(trials, dtype=bool), fixture=object())


def test_interference_is_about_as_strong_in_every_trial():
    assert not is_uneven(evidence(6), waves([1.0, 1.2, 0.9, 1.1, 1.0, 0.8]))
    assert is_uneven(evidence(6), waves([1.2, 0.1, 0.05, 0.1, 0.02, 0.04]))


def test_beats_are_still_interference():
    assert not is_uneven(evidence(6), waves([1.5, 0.5, 1.4, 0.6, 1.0, 1.2]))


@pytest.mark.parametrize(
    ("logs", "other"), [([1.1, 0.9], False), ([0.1, 0.2], True), ([9, 8], True)]
)
def test_the_fixture_hears_the_same_interference(logs, other):
    assert is_other_in_fixture(evidence(3), waves([1.0, 1.1, 0.9], logs)) is other
