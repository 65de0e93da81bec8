"""What to do next: few steps, fitted to the answer, most telling first, nothing twice."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spa_fo.gap.answer.findings import MISSING, lacking, misses
from spa_fo.gap.diagnosis import Cause, Step
from spa_fo.gap.plan.next_steps import MOST, Option, in_words, next_steps, ranked
from spa_fo.gap.plan.remedies import CAMERA, known_remedies
from spa_fo.plant.effects.library import IDS

A, B, C = ("creep",), ("sensor_creep",), ("leak",)


def campaign(
    protocols: Sequence[str] = ("step",),
    trials: int = 1,
    pressure: bool = True,
    calibrations: int = 2,
    mixed: bool = True,
) -> Any:
    """Evidence as far as it is asked what it lacks; no command, so that nothing is planned."""
    order = list(protocols) * trials if mixed else sorted(list(protocols) * trials)
    places = {name: place for place, name in enumerate(protocols)}
    return SimpleNamespace(
        grid=SimpleNamespace(
            trials=[SimpleNamespace(experiment=name, protocol=name) for name in order],
            command_kpa=None,
            measured_kpa=np.zeros(3) if pressure else None,
        ),
        has_pressure=pressure,
        data=SimpleNamespace(calibrations=[None] * calibrations),
        fixture=object() if calibrations else None,
        alike=np.array([places[name] for name in order]),
    )


EVERYTHING = campaign(("step_release", "staircase", "hold"), trials=2)


def causes(*found: tuple[tuple[str, ...], float]) -> list[Cause]:
    """Every single effect, as a diagnosis lists them, and those that were found."""
    given = dict(found)
    every = dict.fromkeys([(name,) for name in IDS], 0.0) | given
    named = [Cause(ids, share, {}, {}) for ids, share in every.items()]
    return [*named, Cause(("unknown",), 1.0 - sum(given.values()), {}, {})]


def steps(kind: str, *found: tuple[tuple[str, ...], float], of: Any = EVERYTHING):
    sets = [ids for ids, _ in found] if kind in ("ambiguous", "cause") else []
    return next_steps(kind, sets, causes(*found), of, 0.4)


def test_what_a_campaign_lacks_is_named() -> None:
    assert lacking(EVERYTHING) == ()
    poor = campaign(pressure=False, calibrations=0)
    assert lacking(poor) == tuple(name for name in MISSING if name not in ("command", "order"))
    assert misses(poor) == tuple(MISSING[name] for name in lacking(poor))
    assert lacking(campaign(("staircase", "hold"), trials=2, mixed=False)) == ("order",)
    assert {remedy.lacks for remedy in known_remedies()} | {"repeats"} == {"", *MISSING}


def test_drive_or_actuator_without_pressure_is_told_by_a_tap() -> None:
    first, *_ = steps("ambiguous", (("leak",), 0.5), (("creep",), 0.4), of=campaign(pressure=False))
    assert first.do.startswith("log the pressure")
    assert first.apart == (("leak",), ("creep",))


def test_what_the_campaign_has_is_not_asked_for() -> None:
    for kind in ("ambiguous", "unknown", "no_gap", "cause"):
        words = in_words(steps(kind, (("leak",), 0.5), (("hysteresis",), 0.4)))
        assert "tap" not in words
        assert "repeat an experiment unchanged" not in words
        assert "staircase" not in words


def test_sensor_or_actuator_is_told_by_a_calibration() -> None:
    pair = ((("stiffening",), 0.5), (("sensor_nonlinearity",), 0.4))
    assert "known angles" in steps("ambiguous", *pair, of=campaign(calibrations=0))[0].do
    assert "once more, after" in steps("ambiguous", *pair, of=campaign(calibrations=1))[0].do
    assert "camera" in steps("ambiguous", *pair)[0].do


def test_unknown_with_single_trials_begins_with_a_repeat() -> None:
    first, *others = steps("unknown", of=campaign(pressure=False, calibrations=0))
    assert first.do.startswith("repeat an experiment")
    assert len(others) == MOST - 1
    assert others[0].do.startswith("log the pressure")


def test_unknown_with_everything_still_has_a_step() -> None:
    found = steps("unknown")
    assert 1 <= len(found) <= MOST
    assert all(step.apart == () for step in found)


def test_a_part_that_was_found_moves_the_ranking() -> None:
    softening = steps("unknown", (("mullins_softening",), 0.05))
    assert any("fresh specimen" in step.do for step in softening)
    assert not any("fresh specimen" in step.do for step in steps("unknown"))


def test_a_cause_is_told_from_its_rival_only() -> None:
    assert steps("cause", (("creep",), 0.97)) == ()
    (step, *_) = steps("cause", (("creep",), 0.85), (("sensor_creep",), 0.1))
    assert "dwells" in step.do
    assert step.apart == (("creep",), ("sensor_creep",))


@pytest.mark.parametrize("kind", ["ambiguous", "unknown", "no_gap", "cause"])
@pytest.mark.parametrize("of", [EVERYTHING, campaign(pressure=False, calibrations=0, mixed=False)])
def test_steps_are_few_and_none_comes_twice(kind: str, of: Any) -> None:
    sets = [(("leak",), 0.3), (("creep",), 0.3), (("sensor_creep",), 0.2), (("slew_limit",), 0.1)]
    found = steps(kind, *sets, of=of)
    assert len(found) <= MOST
    assert len({step.do for step in found}) == len(found)
    assert all(step.why for step in found)


def test_a_pair_that_nothing_is_known_for_is_filmed() -> None:
    (step,) = steps("ambiguous", (("stiffening",), 0.5), (("hysteresis",), 0.4))
    assert step.do == CAMERA.do


def test_the_step_that_parts_most_comes_first_and_settled_pairs_count_no_more() -> None:
    still_open = {(A, B): 0.2, (A, C): 0.1, (B, C): 0.05}
    both = Option("do both", "why", {(A, B): 0.9, (A, C): 0.9})
    same = Option("do the same", "why", {(A, B): 0.9})
    other = Option("do another", "why", {(B, C): 0.9})
    found = list(ranked(still_open, [same, other, both], named=True))
    assert [step.do for step in found] == ["do both", "do another"]
    assert found[0].apart == (A, B)
    assert list(ranked(still_open, [], named=True)) == []


def test_steps_are_numbered_where_there_are_several() -> None:
    one = Step("weigh it", "it may be heavy")
    assert in_words([one]) == "Weigh it: it may be heavy."
    assert in_words([one, one]).startswith("1. Weigh it: it may be heavy. 2. Weigh it")
