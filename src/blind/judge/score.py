"""Score the blind benchmark: what was answered against what is true, rig by rig."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from blind.judge.effects import (
    CONFUSIONS,
    OTHERS,
    RICH,
    Confusion,
    EffectScore,
    confusion,
    effect_scores,
    protocols,
    row,
    smallest_sizes,
)
from blind.judge.questions import (
    CLEAR,
    MEASURES,
    ShrinkPoint,
    calibrated,
    claims_close,
    claims_cover,
    found,
    in_sets,
    names_exactly,
    shrink_points,
    wrong_name,
)
from blind.judge.records import ERROR, KINDS, SHIFT, VERDICTS, Outcome
from blind.judge.statistics import Calibration, Estimate
from blind.judge.targets import ENOUGH, ClassMark, Mark, by_rig, class_marks, marks

SCHEMA = "spa-fo/blind-scores/2"
_DIGITS = 6


@dataclass(frozen=True)
class Arm:
    """Cases of one kind, size (None: of no size or any), rich protocols or others."""

    kind: str
    protocols: str
    size: float | None
    n: int
    scores: Mapping[str, Estimate]


def arms(outcomes: Sequence[Outcome]) -> tuple[Arm, ...]:
    """Score every arm, in the order of kind, protocols and size."""
    members: dict[tuple[int, int, float], list[Outcome]] = {}
    for outcome in outcomes:
        truth = outcome.truth
        size = -1.0 if truth.size is None else truth.size
        key = KINDS.index(truth.kind), (RICH, OTHERS).index(protocols(truth)), size
        members.setdefault(key, []).append(outcome)
    return tuple(
        Arm(
            KINDS[kind],
            (RICH, OTHERS)[protocol],
            None if size < 0 else size,
            len(own),
            {name: measure(own) for name, measure in MEASURES.items()},
        )
        for (kind, protocol, size), own in sorted(members.items())
    )


@dataclass(frozen=True)
class Claims:
    """How the claimed shrinks of one kind of answer held.

    Attributes
    ----------
    verdict : str
        The kind of answer.
    answers : int
        So many there were.
    claims : int
        So many of them claim a shrink.
    close, covered : Estimate
        Of the claims that can be judged: the rates within ten points, and of intervals that hold.
    """

    verdict: str
    answers: int
    claims: int
    close: Estimate
    covered: Estimate


def claims(outcomes: Sequence[Outcome]) -> tuple[Claims, ...]:
    """Part the claimed shrinks by the kind of answer; kinds that never claim any are left out."""
    by_verdict = {
        verdict: [o for o in outcomes if o.answer.verdict == verdict] for verdict in VERDICTS
    }
    return tuple(
        Claims(verdict, len(own), claimed, claims_close(own), claims_cover(own))
        for verdict, own in by_verdict.items()
        if (claimed := sum(o.answer.claim is not None for o in own))
    )


@dataclass(frozen=True)
class Shifts:
    """How often answers named the shift of a model that is off.

    Attributes
    ----------
    cases : int
        Cases whose model is off.
    alone : int
        Without an effect: no false alarm.
    beside : int
        A fair name with the shift beside it: no wrong name.
    instead : int
        With an effect, sure of the shift alone: a wrong name all the same.
    """

    cases: int
    alone: int
    beside: int
    instead: int


def shifts(outcomes: Sequence[Outcome]) -> Shifts:
    """Count what was made of models that are off, where the shift is not the effect itself."""
    off = [o for o in outcomes if o.truth.is_shifted and not o.truth.effects >= SHIFT]
    return Shifts(
        cases=len(off),
        alone=sum(not o.truth.effects and names_exactly(o.truth, o.answer) for o in off),
        beside=sum(_names_beside(o) for o in off),
        instead=sum(o.answer.sets == (SHIFT,) and wrong_name(o.truth, o.answer) for o in off),
    )


def _names_beside(outcome: Outcome) -> bool:
    truth, answer = outcome.truth, outcome.answer
    return answer.names and any(named > SHIFT and truth.fair(named) for named in answer.sets)


@dataclass(frozen=True)
class Failure:
    """A diagnosis that ended in an error, or a model that could not be tried on unseen trials."""

    case: str
    kind: str
    step: str
    message: str


def failures(outcomes: Sequence[Outcome]) -> tuple[Failure, ...]:
    """List what ended in an error; no model of a diagnosis that did is tried."""
    diagnoses = [
        Failure(o.truth.case, o.truth.kind, "diagnosis", o.answer.message)
        for o in outcomes
        if o.answer.verdict == ERROR
    ]
    unseen = [
        Failure(o.truth.case, o.truth.kind, "unseen trials", o.refused)
        for o in outcomes
        if o.answer.verdict != ERROR and o.refused
    ]
    return (*diagnoses, *unseen)


@dataclass(frozen=True)
class RigScores:
    """The cases of one rig, scored.

    Attributes
    ----------
    cases : int
    kinds : mapping of str to int
        Cases by kind.
    short : int
        Cases whose effect could not be made as large as asked; they count by what they reach.
    arms : tuple of Arm
    calibration : mapping of str to Calibration
        All cases, and by kind.
    smallest_found, smallest_named : mapping of str to float or None
        On rich protocols and others, over all effects: smallest size with 95 % of the cases found,
        or named.
    confusion : mapping of str to Confusion
    shrink : tuple of ShrinkPoint
    shrink_left_out : int
        Claims that cannot be judged: the gap on the unseen trials is too near the floor.
    claims : tuple of Claims
        By kind of answer.
    shifts : Shifts
    failures : tuple of Failure
    """

    cases: int
    kinds: Mapping[str, int]
    short: int
    arms: tuple[Arm, ...]
    calibration: Mapping[str, Calibration]
    smallest_found: Mapping[str, float | None]
    smallest_named: Mapping[str, float | None]
    confusion: Mapping[str, Confusion]
    shrink: tuple[ShrinkPoint, ...]
    shrink_left_out: int
    claims: tuple[Claims, ...]
    shifts: Shifts
    failures: tuple[Failure, ...]


@dataclass(frozen=True)
class Scores:
    """The scored benchmark.

    Attributes
    ----------
    cases : int
    marks : tuple of Mark
        Rig by rig, then what is asked of the rigs together.
    classes : tuple of ClassMark
        Every mark in every class of surroundings, the worst first.
    effects : tuple of EffectScore
        The worst first.
    rigs : mapping of str to RigScores
    equivalents : mapping of str to list of str
        What counted as a fair answer for an effect that the library lacks, in any case of it.
    """

    cases: int
    marks: tuple[Mark, ...]
    classes: tuple[ClassMark, ...]
    effects: tuple[EffectScore, ...]
    rigs: Mapping[str, RigScores]
    equivalents: Mapping[str, list[str]]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; a figure without cases becomes None."""
        plain: dict[str, Any] = _plain(
            {
                "schema": SCHEMA,
                "cases": self.cases,
                "shrink_clear": CLEAR,
                "class_enough": ENOUGH,
                "marks": [_mark_document(mark) | {"which": mark.which} for mark in self.marks],
                "classes": [
                    _mark_document(mark) | {"dimension": mark.dimension, "class": mark.name}
                    for mark in self.classes
                ],
                "effects": [
                    asdict(effect) | {"worst_rate": effect.worst_rate} for effect in self.effects
                ],
                "rigs": {rig: asdict(scores) for rig, scores in self.rigs.items()},
                "equivalents": self.equivalents,
            }
        )
        return plain


def score(outcomes: Sequence[Outcome]) -> Scores:
    """Score a benchmark.

    Parameters
    ----------
    outcomes : sequence of Outcome
        One a case; their order does not matter.
    """
    outcomes = sorted(outcomes, key=lambda outcome: outcome.truth.case)
    classes = class_marks(outcomes)
    fair: dict[str, set[str]] = {}
    for outcome in outcomes:
        if outcome.truth.is_missing:
            fair.setdefault(row(outcome.truth), set()).update(outcome.truth.equivalents)
    return Scores(
        cases=len(outcomes),
        marks=marks(outcomes, classes),
        classes=classes,
        effects=effect_scores(outcomes),
        rigs={rig: _rig_scores(own) for rig, own in by_rig(outcomes).items()},
        equivalents={effect: sorted(names) for effect, names in fair.items()},
    )


def _rig_scores(outcomes: Sequence[Outcome]) -> RigScores:
    shrink = shrink_points(outcomes)
    contract = [o for o in outcomes if o.truth.kind == "closed"]
    return RigScores(
        cases=len(outcomes),
        kinds=dict(Counter(o.truth.kind for o in outcomes)),
        short=sum(o.truth.short for o in outcomes),
        arms=arms(outcomes),
        calibration=_calibrations(outcomes),
        smallest_found=smallest_sizes(contract, found),
        smallest_named=smallest_sizes(contract, in_sets),
        confusion={
            name: confusion([o for o in outcomes if group(o.truth)])
            for name, group in CONFUSIONS.items()
        },
        shrink=shrink,
        shrink_left_out=sum(o.answer.claim is not None for o in outcomes) - len(shrink),
        claims=claims(outcomes),
        shifts=shifts(outcomes),
        failures=failures(outcomes),
    )


def _calibrations(outcomes: Sequence[Outcome]) -> dict[str, Calibration]:
    by_kind = {kind: [o for o in outcomes if o.truth.kind == kind] for kind in KINDS}
    return {"all": calibrated(outcomes)} | {
        kind: calibrated(own) for kind, own in by_kind.items() if own
    }


def _mark_document(mark: Mark | ClassMark) -> dict[str, Any]:
    return {
        "rig": mark.rig,
        "name": mark.target.name,
        "measure": mark.target.measure,
        "goal": mark.target.goal,
        "at_least": mark.target.at_least,
        "reached": mark.target.reached(mark.estimate),
        "missed_beyond_interval": mark.target.surely_missed_by(mark.estimate) > 0.0,
        "estimate": asdict(mark.estimate),
    }


def _plain(value: Any) -> Any:
    """Write numbers with the digits that mean something, and none where there is none."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return round(value, _DIGITS) if math.isfinite(value) else None
    return value
