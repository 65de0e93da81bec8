"""Score the blind benchmark: what was answered against what is true, the worst class first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from blind.judge.questions import (
    CLEAR,
    MEASURES,
    Question,
    ShrinkPoint,
    calibrated,
    claims_close,
    claims_cover,
    found,
    in_sets,
    right_first,
    shrink_points,
)
from blind.judge.records import KINDS, VERDICTS, Answer, Ids, Outcome, Truth
from blind.judge.statistics import Calibration, Estimate
from blind.judge.targets import (
    LARGE,
    Group,
    Mark,
    cases,
    marks,
    rich_large,
    rich_two,
    up_large,
)
from spa_fo.plant.effects.library import LIBRARY

SCHEMA = "spa-fo/blind-scores/1"
PAIR = "pair"
NO_EFFECT = "no effect"
_DETECTED = 0.95


@dataclass(frozen=True)
class Arm:
    """Cases of one kind, protocol and size (None: of no size or any), with every measure."""

    kind: str
    protocol: str
    size: float | None
    n: int
    scores: Mapping[str, Estimate]


def arms(outcomes: Sequence[Outcome]) -> tuple[Arm, ...]:
    """Score every arm, in the order of kind, protocol and size."""
    members: dict[tuple[int, str, float], list[Outcome]] = {}
    for outcome in outcomes:
        truth = outcome.truth
        size = -1.0 if truth.size is None else truth.size
        members.setdefault((KINDS.index(truth.kind), truth.protocol, size), []).append(outcome)
    return tuple(
        Arm(KINDS[kind], protocol, None if size < 0 else size, len(own), _every_measure(own))
        for (kind, protocol, size), own in sorted(members.items())
    )


def _every_measure(outcomes: Sequence[Outcome]) -> dict[str, Estimate]:
    return {name: measure(outcomes) for name, measure in MEASURES.items()}


@dataclass(frozen=True)
class Variant:
    """Large effects of the library on the rich protocol that share a form, or the judged model."""

    name: str
    n: int
    scores: Mapping[str, Estimate]


def variants(outcomes: Sequence[Outcome]) -> tuple[Variant, ...]:
    """Score by functional form, and by whose coefficients the judged model has."""
    large = [outcome for outcome in outcomes if rich_large(outcome.truth)]
    found_in: dict[str, list[Outcome]] = {}
    for outcome in large:
        found_in.setdefault(f"form {outcome.truth.form}", []).append(outcome)
        found_in.setdefault(f"model {outcome.truth.model}", []).append(outcome)
    return tuple(
        Variant(name, len(own), _every_measure(own)) for name, own in sorted(found_in.items())
    )


_BY_EFFECT: tuple[tuple[str, Group, str, bool], ...] = (
    # name of the column, its cases, the measure, whether less is better
    ("rich, 4 and more: in sets", rich_large, "in_sets", False),
    ("rich, 4 and more: most probable", rich_large, "right_first", False),
    ("rich, 4 and more: stage", rich_large, "right_stage", False),
    ("rich, 2: found", rich_two, "found", False),
    ("up-steps, 4 and more: in sets", up_large, "in_sets", False),
    ("any size: no wrong name", cases("closed"), "wrong_name", True),
    ("missing: unknown or equal", lambda truth: truth.is_missing, "fair_or_unknown", False),
    ("missing: no wrong name", lambda truth: truth.is_missing, "wrong_name", True),
    ("no false alarm", cases("no_effect"), "found", True),
)


@dataclass(frozen=True)
class EffectScore:
    """How one effect fared; every rate is of what is right, so that less is worse.

    Attributes
    ----------
    effect : str
        Its identifier, or ``no effect``.
    cases : int
    rates : mapping of str to Estimate
        Those it has cases for.
    worst : str
        Name of its lowest rate.
    mistaken_for : str
        Most frequent wrong first explanation of a sizeable effect; empty without any.
    smallest_found, smallest_named : mapping of str to float or None
        By protocol: smallest size tried from which on every case is found, or has the truth in its
        sets; None where none has.
    """

    effect: str
    cases: int
    rates: Mapping[str, Estimate]
    worst: str
    mistaken_for: str
    smallest_found: Mapping[str, float | None]
    smallest_named: Mapping[str, float | None]

    @property
    def worst_rate(self) -> float:
        """Its lowest rate."""
        return self.rates[self.worst].value


def effect_scores(outcomes: Sequence[Outcome]) -> tuple[EffectScore, ...]:
    """Score every effect but pairs, the worst first."""
    members: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.truth.kind != "pair":
            members.setdefault(_row(outcome.truth), []).append(outcome)
    scores = (_effect_score(effect, own) for effect, own in members.items())
    return tuple(sorted(scores, key=lambda score: (score.worst_rate, score.effect)))


def _row(truth: Truth) -> str:
    return next(iter(truth.effects), NO_EFFECT)


def _effect_score(effect: str, outcomes: Sequence[Outcome]) -> EffectScore:
    rates = {}
    for name, group, measure, less_is_better in _BY_EFFECT:
        estimate = MEASURES[measure]([o for o in outcomes if group(o.truth)])
        if estimate.n:
            rates[name] = _complement(estimate) if less_is_better else estimate
    return EffectScore(
        effect=effect,
        cases=len(outcomes),
        rates=rates,
        worst=min(rates, key=lambda name: (rates[name].value, rates[name].high)),
        mistaken_for=_mistaken_for(outcomes),
        smallest_found=_by_protocol(outcomes, found),
        smallest_named=_by_protocol(outcomes, in_sets),
    )


def _complement(share: Estimate) -> Estimate:
    return Estimate(1.0 - share.value, 1.0 - share.high, 1.0 - share.low, share.n)


def _mistaken_for(outcomes: Sequence[Outcome]) -> str:
    wrong = Counter(
        name_of(o.answer.top)
        for o in outcomes
        if (o.truth.size is None or o.truth.size >= LARGE) and not right_first(o.truth, o.answer)
    )
    return min(wrong, key=lambda name: (-wrong[name], name)) if wrong else ""


def name_of(explanation: Ids) -> str:
    """Write a set of effects as people do."""
    return " + ".join(sorted(explanation))


def _by_protocol(outcomes: Sequence[Outcome], question: Question) -> dict[str, float | None]:
    closed = [o for o in outcomes if o.truth.kind == "closed"]
    protocols = sorted({o.truth.protocol for o in closed})
    return {
        protocol: smallest_size([o for o in closed if o.truth.protocol == protocol], question, 1.0)
        for protocol in protocols
    }


def smallest_size(
    outcomes: Sequence[Outcome], question: Question, share: float = _DETECTED
) -> float | None:
    """Smallest size tried at which, and at every larger one, this share of the cases says yes."""
    smallest = None
    for size in sorted({o.truth.size for o in outcomes if o.truth.size is not None}, reverse=True):
        here = [question(o.truth, o.answer) for o in outcomes if o.truth.size == size]
        if sum(here) < share * len(here):
            break
        smallest = size
    return smallest


@dataclass(frozen=True)
class Confusion:
    """How often each truth was answered by each first explanation, shape (rows, columns)."""

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]


def confusion(outcomes: Sequence[Outcome]) -> Confusion:
    """Count the most probable explanations by truth; single effects and cases without any."""
    columns = (*LIBRARY, "none", "unknown", PAIR)
    order = [*LIBRARY, NO_EFFECT]
    present = {_row(o.truth) for o in outcomes}
    rows = [row for row in order if row in present] + sorted(present - set(order))
    counted = Counter((_row(o.truth), _column(o.answer)) for o in outcomes)
    return Confusion(
        tuple(rows),
        columns,
        tuple(tuple(counted[row, column] for column in columns) for row in rows),
    )


def _column(answer: Answer) -> str:
    return next(iter(answer.top)) if len(answer.top) == 1 else PAIR


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


_CONFUSIONS: Mapping[str, Group] = {
    "rich protocol": lambda t: rich_large(t) or cases("no_effect", "rich")(t),
    "up-steps": lambda t: up_large(t) or cases("no_effect", "up_steps")(t),
    "effect missing from the library": lambda t: t.is_missing and (t.size or 0.0) >= LARGE,
}


@dataclass(frozen=True)
class Scores:
    """The scored benchmark.

    Attributes
    ----------
    cases : int
    kinds : mapping of str to int
        Cases by kind.
    short : int
        Cases whose effect could not be made as large as asked; they count by what they reach.
    marks : tuple of Mark
    effects : tuple of EffectScore
        The worst first.
    arms : tuple of Arm
    variants : tuple of Variant
    calibration : mapping of str to Calibration
        All cases, and by kind.
    smallest_found, smallest_named : mapping of str to float or None
        By protocol, over all effects: smallest size with 95 % of the cases found, or named.
    confusion : mapping of str to Confusion
    shrink : tuple of ShrinkPoint
    shrink_left_out : int
        Claims that cannot be judged: the gap on the unseen trials is too near the floor.
    claims : tuple of Claims
        By kind of answer.
    equivalents : mapping of str to list of str
        What counted as a fair answer for an effect that the library lacks.
    """

    cases: int
    kinds: Mapping[str, int]
    short: int
    marks: tuple[Mark, ...]
    effects: tuple[EffectScore, ...]
    arms: tuple[Arm, ...]
    variants: tuple[Variant, ...]
    calibration: Mapping[str, Calibration]
    smallest_found: Mapping[str, float | None]
    smallest_named: Mapping[str, float | None]
    confusion: Mapping[str, Confusion]
    shrink: tuple[ShrinkPoint, ...]
    shrink_left_out: int
    claims: tuple[Claims, ...]
    equivalents: Mapping[str, list[str]]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; a figure without cases becomes None."""
        document = {
            "schema": SCHEMA,
            **asdict(replace(self, marks=(), effects=())),
            "shrink_clear": CLEAR,
            "marks": [_mark_document(mark) for mark in self.marks],
            "effects": [
                asdict(effect) | {"worst_rate": effect.worst_rate} for effect in self.effects
            ],
        }
        plain: dict[str, Any] = _without_nan(document)
        return plain


def score(outcomes: Sequence[Outcome]) -> Scores:
    """Score a benchmark.

    Parameters
    ----------
    outcomes : sequence of Outcome
        One a case; their order does not matter.
    """
    outcomes = sorted(outcomes, key=lambda outcome: outcome.truth.case)
    closed = {
        protocol: [o for o in outcomes if cases("closed", protocol)(o.truth)]
        for protocol in sorted({o.truth.protocol for o in outcomes})
    }
    shrink = shrink_points(outcomes)
    return Scores(
        cases=len(outcomes),
        kinds=dict(Counter(o.truth.kind for o in outcomes)),
        short=sum(o.truth.short for o in outcomes),
        marks=marks(outcomes),
        effects=effect_scores(outcomes),
        arms=arms(outcomes),
        variants=variants(outcomes),
        calibration=_calibrations(outcomes),
        smallest_found={name: smallest_size(own, found) for name, own in closed.items()},
        smallest_named={name: smallest_size(own, in_sets) for name, own in closed.items()},
        confusion={
            name: confusion([o for o in outcomes if group(o.truth)])
            for name, group in _CONFUSIONS.items()
        },
        shrink=shrink,
        shrink_left_out=sum(o.answer.claim is not None for o in outcomes) - len(shrink),
        claims=claims(outcomes),
        equivalents={
            _row(o.truth): sorted(o.truth.equivalents) for o in outcomes if o.truth.is_missing
        },
    )


def _calibrations(outcomes: Sequence[Outcome]) -> dict[str, Calibration]:
    by_kind = {kind: [o for o in outcomes if o.truth.kind == kind] for kind in KINDS}
    return {"all": calibrated(outcomes)} | {
        kind: calibrated(own) for kind, own in by_kind.items() if own
    }


def _mark_document(mark: Mark) -> dict[str, Any]:
    return {
        "name": mark.target.name,
        "measure": mark.target.measure,
        "goal": mark.target.goal,
        "at_least": mark.target.at_least,
        "reached": mark.target.reached(mark.estimate),
        "estimate": asdict(mark.estimate),
        "baselines": {name: asdict(estimate) for name, estimate in mark.baselines.items()},
    }


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
