"""Truths and answers made by hand, for the tests of the blind benchmark's judge."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from blind.judge import Answer, Outcome, Surroundings, Truth, failed
from spa_fo.plant.effects.library import LIBRARY


def ids(*names: str) -> frozenset[str]:
    return frozenset(names)


QUIET = Surroundings(
    noise_colour="exponential",
    coloured_deg=0.04,
    correlation_s=1.0,
    gain=0.004,
    time_scale=0.01,
    rest_deg=0.1,
    calibration="before",
    fixture_deg=0.2,
    rate_hz=50.0,
    bits=12,
    pressure=True,
)


def truth(*effects: str, kind: str = "closed", size: float | None = 4.0, **others: Any) -> Truth:
    given: dict[str, Any] = {
        "case": "case_0001",
        "rig": "virtual_rig",
        "equivalents": ids(),
        "noise_floor_deg": 0.5,
        "protocol": "rich",
        "repeats": 3,
        "order": "interleaved",
        "model": "own",
        "surroundings": QUIET,
    }
    return Truth(kind=kind, effects=ids(*effects), size=size, **given | others)


def answer(*sets: Iterable[str], verdict: str | None = None, **others: Any) -> Answer:
    """Answer with these sets, sure of the first."""
    named = tuple(frozenset(each) for each in sets)
    kind = verdict or ("no_gap", "cause", "ambiguous")[min(len(named), 2)]
    top = named[0] if named else ids("none")
    given: dict[str, Any] = {"top": top, "probability": 0.9, "stage": None}
    return Answer(kind, named, **given | others)


CREEP, LEAK = truth("creep"), truth("leak")
NOTHING = truth(kind="no_effect", size=None)
UNKNOWN = answer(verdict="unknown", top=ids("unknown"))
ERROR = failed("log.csv: line 3: expected a number")


def named(effect: str, hits: int, misses: int, **others: Any) -> list[Outcome]:
    """Make cases of one effect, some of them taken for another."""
    stage = LIBRARY[effect].stage
    right = Outcome(truth(effect, **others), answer([effect], stage=stage))
    wrong = Outcome(truth(effect, **others), answer(["thermal_drift"], stage=stage))
    return [right] * hits + [wrong] * misses
