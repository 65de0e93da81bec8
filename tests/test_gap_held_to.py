"""An answer held against trials that took no part: what is left of it."""

from __future__ import annotations

from typing import Any, cast

import pytest

from spa_fo.gap.claim.claimed import Claim, held_to
from spa_fo.gap.decide.verdict import Scored, Verdict, judge

Ids = tuple[str, ...]
NOT_READ = cast(Any, None)


def answer(probabilities: dict[Ids, float], unknown: float) -> Verdict:
    scored = [
        Scored(named, probability, NOT_READ, None, None, dict.fromkeys(named, 1.0), 0.0)
        for named, probability in probabilities.items()
    ]
    return judge(sorted(scored, key=lambda s: -s.probability), unknown, 0.0)


def claims(closed: dict[Ids, float]) -> Claim:
    return Claim({}, {}, closed, None)


def test_a_cause_that_closes_the_gap_stands() -> None:
    verdict = answer({("creep",): 0.9}, 0.1)
    assert held_to(verdict, claims({("creep",): 0.9})) == verdict


def test_a_cause_that_closes_nothing_is_none() -> None:
    held = held_to(answer({("creep",): 0.9}, 0.1), claims({("creep",): 0.0}))
    assert (held.kind, held.sets) == ("unknown", ())
    assert held.unknown == pytest.approx(1.0)


def test_nobody_foretells_a_slip_so_it_stands() -> None:
    verdict = answer({("sensor_slip",): 0.9}, 0.1)
    assert held_to(verdict, claims({("sensor_slip",): -0.2})) == verdict


@pytest.mark.parametrize(("closed", "left"), [(-2.5, ()), (0.9, (("creep", "sensor_slip"),))])
def test_a_part_is_said_for_what_it_closes_elsewhere(closed: float, left: tuple[Ids, ...]) -> None:
    named = ("creep", "sensor_slip")
    held = held_to(answer({named: 0.1}, 0.9), claims({named: closed}))
    assert (held.kind, held.sets) == ("unknown", left)
