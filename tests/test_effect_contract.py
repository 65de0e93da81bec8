"""What every effect keeps: the library's, and one's own at every stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spa_fo.errors import BadInput
from spa_fo.plant.effects.contract import broken
from spa_fo.plant.effects.effect import Effect, amplitude, shape
from spa_fo.plant.effects.library import IDS, LIBRARY

SHARE = amplitude("share", "1", "part of it that is lost", spread=0.1, high=0.5, start=0.05)


def lossy(pressure_kpa, time_s, share):
    return pressure_kpa * (1.0 - share)


def softer(pressure_kpa, angle_deg, time_s, share):
    return pressure_kpa - share * angle_deg


def late(angle_deg, time_s, share):
    return np.interp(time_s - share, time_s, angle_deg)


def own(name, stage, act):
    return Effect(name, stage, (SHARE,), means="some is lost", remedy="bring it back", act=act)


OWN = [
    own("lossy", "drive", lossy),
    own("softer", "actuator", softer),
    own("late", "sensor", late),
    own("late_log", "acquisition", late),
]


@pytest.mark.parametrize("effect", [*LIBRARY.values(), *OWN], ids=lambda effect: effect.id)
def test_an_effect_keeps_the_contract(effect: Effect) -> None:
    assert broken(effect) == ()
    assert tuple(LIBRARY) == IDS


def with_a_corner(pressure_kpa, time_s, share):
    return pressure_kpa * (1.0 - 20.0 * max(share - 0.05, 0.0) - 0.5 * share)


def by_step(pressure_kpa, time_s, share):
    return pressure_kpa * (1.0 - share * pressure_kpa.size / 800.0)


def with_a_past():
    calls = []

    def act(pressure_kpa, time_s, share):
        calls.append(share)
        return pressure_kpa * (1.0 - share * len(calls))

    return act


@pytest.mark.parametrize(
    ("act", "word"),
    [
        (lambda pressure, time, share: pressure, "moves the log"),
        (lambda pressure, time, share: pressure * 0.8 - share, "not neutral"),
        (with_a_corner, "slope"),
        (by_step, "halving"),
        (with_a_past(), "asked again"),
    ],
)
def test_what_breaks_the_contract_is_said(act, word: str) -> None:
    found = broken(replace(OWN[0], act=act))
    assert [line for line in found if word in line]


def test_words_that_lack_and_numbers_out_of_bounds_are_said() -> None:
    bare = Effect("lossy", "drive", (replace(SHARE, means=""),), act=lossy)
    assert broken(replace(bare, neutral={"share": 3.0})) == (
        "means: expected words of its own",
        "remedy: expected words of its own",
        "share: expected words on what it is",
        "share: expected numbers within its bounds",
        "it is not neutral: 2e+02 of 3.3 deg are left",
    )
    found = broken(replace(OWN[0], neutral={"shre": 0.0}))
    assert found == ("neutral: 'shre' is none of its parameters",)


def test_what_the_chain_cannot_run_is_refused() -> None:
    with pytest.raises(BadInput, match="act: expected a function of"):
        broken(replace(OWN[0], act=lambda pressure: pressure))


def test_a_neutral_shape_is_named() -> None:
    words = "largest angle that it reads"
    ceiling = shape("ceiling_deg", "deg", words, centre=40.0, factor=1.3, low=5.0, high=200.0)

    def clipped(angle_deg, time_s, ceiling_deg):
        return np.minimum(angle_deg, ceiling_deg)

    stiff = replace(OWN[2], parameters=(ceiling,), act=clipped)
    assert any("neutral" in line for line in broken(stiff))
    assert broken(replace(stiff, neutral={"ceiling_deg": 200.0})) == ()
