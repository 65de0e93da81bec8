"""What every effect keeps, the library's and one's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spa_fo.errors import BadInput
from spa_fo.plant.effects.contract import broken
from spa_fo.plant.effects.effect import Effect, amplitude, shape
from spa_fo.plant.effects.library import IDS, LIBRARY

SHARE = amplitude("share", "1", spread=0.1, high=0.5, start=0.05)


def lossy(pressure_kpa, time_s, share):
    return pressure_kpa * (1.0 - share)


def softer(pressure_kpa, angle_deg, time_s, share):
    return pressure_kpa - share * angle_deg


def late(angle_deg, time_s, share):
    return np.interp(time_s - share, time_s, angle_deg)


def late_log(reading_deg, time_s, share):
    return np.interp(time_s - share, time_s, reading_deg)


OWN = {
    "drive": Effect("lossy", "drive", (SHARE,), act=lossy),
    "actuator": Effect("softer", "actuator", (SHARE,), act=softer),
    "sensor": Effect("late", "sensor", (SHARE,), act=late),
    "acquisition": Effect("late_log", "acquisition", (SHARE,), act=late_log),
}


@pytest.mark.parametrize("name", IDS)
def test_an_effect_of_the_library_keeps_the_contract(name: str) -> None:
    assert broken(LIBRARY[name]) == ()


@pytest.mark.parametrize("stage", OWN)
def test_an_effect_of_ones_own_keeps_it_at_every_stage(stage: str) -> None:
    assert broken(OWN[stage]) == ()
    assert tuple(LIBRARY) == IDS


@pytest.mark.parametrize(
    ("act", "word"),
    [
        (lambda pressure, time, share: pressure, "moves the log"),
        (lambda pressure, time, share: pressure * 0.8 - share, "not neutral"),
        (lambda pressure, time, share: pressure * (1.0 - 20.0 * max(share - 0.05, 0.0) - 0.5 * share), "slope"),
        (lambda pressure, time, share: pressure * (1.0 - share * pressure.size / 800.0), "halving"),
    ],
)
def test_what_breaks_the_contract_is_said(act, word: str) -> None:
    found = broken(replace(OWN["drive"], act=act))
    assert [line for line in found if word in line]


def test_what_the_chain_cannot_run_is_refused() -> None:
    with pytest.raises(BadInput, match="act: expected a function of"):
        broken(replace(OWN["drive"], act=lambda pressure: pressure))
    with pytest.raises(BadInput, match="parameters.0.: expected starts"):
        wrong = replace(SHARE, starts=(2.0,))
        broken(replace(OWN["drive"], parameters=(wrong,)))


def test_a_neutral_shape_is_named() -> None:
    ceiling = shape("ceiling_deg", "deg", centre=40.0, factor=1.3, low=5.0, high=200.0)

    def clipped(angle_deg, time_s, ceiling_deg):
        return np.minimum(angle_deg, ceiling_deg)

    stiff = Effect("clipped", "sensor", (ceiling,), act=clipped)
    assert any("neutral" in line for line in broken(stiff))
    assert broken(replace(stiff, neutral={"ceiling_deg": 200.0})) == ()
