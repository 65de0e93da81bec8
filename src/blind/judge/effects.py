"""How single effects fared: their rates, the worst first, and what they were taken for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from blind.judge.questions import MEASURES, Question, found, in_sets, right_first
from blind.judge.records import ALONE, ERROR, TOGETHER, Answer, Outcome, Truth
from blind.judge.statistics import Estimate
from blind.judge.targets import (
    LARGE,
    Group,
    by_rig,
    cases,
    further_large,
    missing,
    no_effect,
    other_large,
    rich_large,
    rich_two,
)
from spa_fo.plant.effects.library import LIBRARY

PAIR, OTHER = "pair", "other"
NO_EFFECT = "no effect"
RICH, OTHERS = "rich", "other"
DETECTED = 0.95

_RATES: tuple[tuple[str, Group, str, bool], ...] = (
    # name of the column, its cases, the measure, whether less is better
    ("rich, 4 and more: in sets", rich_large, "in_sets", False),
    ("rich, 4 and more: most probable", rich_large, "right_first", False),
    ("rich, 4 and more: stage", rich_large, "right_stage", False),
    ("rich, 2: found", rich_two, "found", False),
    ("other, 4 and more: in sets", other_large, "in_sets", False),
    ("any size: no wrong name", cases("closed"), "wrong_name", True),
    ("beyond the contract's, 4 and more: in sets", further_large, "in_sets", False),
    ("beyond the contract's, any size: no wrong name", cases("further"), "wrong_name", True),
    ("missing: unknown or equal", missing, "fair_or_unknown", False),
    ("missing: no wrong name", missing, "wrong_name", True),
    ("no false alarm", no_effect, "false_alarm", True),
)


@dataclass(frozen=True)
class EffectScore:
    """How one effect fared on one rig; every rate is of what is right, so that less is worse.

    Attributes
    ----------
    rig : str
    effect : str
        Its identifier, or ``no effect``.
    cases : int
    rates : mapping of str to Estimate
        Those it has cases for.
    worst : str
        Name of the rate that is lowest even at the upper end of its interval: one miss in one case
        says less than ten in a hundred.
    mistaken_for : str
        Most frequent wrong first explanation of a sizeable effect; empty without any.
    smallest_found, smallest_named : mapping of str to float or None
        On rich protocols and others: smallest size tried from which on every case is found, or has
        the truth in its sets; None where none has.
    """

    rig: str
    effect: str
    cases: int
    rates: Mapping[str, Estimate]
    worst: str
    mistaken_for: str
    smallest_found: Mapping[str, float | None]
    smallest_named: Mapping[str, float | None]

    @property
    def worst_rate(self) -> float:
        """Its worst rate."""
        return self.rates[self.worst].value


def effect_scores(outcomes: Sequence[Outcome]) -> tuple[EffectScore, ...]:
    """Score every single effect on every rig, the worst first."""
    scores = []
    for rig, own in by_rig(outcomes).items():
        members: dict[str, list[Outcome]] = {}
        for outcome in own:
            if outcome.truth.kind not in TOGETHER:
                members.setdefault(row(outcome.truth), []).append(outcome)
        scores += [_effect_score(rig, effect, of_it) for effect, of_it in members.items()]
    return tuple(sorted(scores, key=_badness))


def _badness(score: EffectScore) -> tuple[float, float, str, str]:
    return score.rates[score.worst].high, score.worst_rate, score.effect, score.rig


def row(truth: Truth) -> str:
    """Name the effect of a case."""
    return next(iter(truth.effects), NO_EFFECT)


def _effect_score(rig: str, effect: str, outcomes: Sequence[Outcome]) -> EffectScore:
    rates = {}
    for name, group, measure, less_is_better in _RATES:
        estimate = MEASURES[measure]([o for o in outcomes if group(o.truth)])
        if estimate.n:
            rates[name] = _complement(estimate) if less_is_better else estimate
    return EffectScore(
        rig=rig,
        effect=effect,
        cases=len(outcomes),
        rates=rates,
        worst=min(rates, key=lambda name: (rates[name].high, rates[name].value)),
        mistaken_for=_mistaken_for(outcomes),
        smallest_found=smallest_sizes(outcomes, found, 1.0),
        smallest_named=smallest_sizes(outcomes, in_sets, 1.0),
    )


def _complement(share: Estimate) -> Estimate:
    return Estimate(1.0 - share.value, 1.0 - share.high, 1.0 - share.low, share.n)


def _mistaken_for(outcomes: Sequence[Outcome]) -> str:
    wrong = Counter(
        " + ".join(sorted(o.answer.top)) or ERROR
        for o in outcomes
        if (o.truth.size is None or o.truth.size >= LARGE) and not right_first(o.truth, o.answer)
    )
    return min(wrong, key=lambda name: (-wrong[name], name)) if wrong else ""


def protocols(truth: Truth) -> str:
    """Name the group of protocols of a case: rich ones, or others."""
    return RICH if truth.is_rich else OTHERS


def smallest_sizes(
    outcomes: Sequence[Outcome], question: Question, share: float = DETECTED
) -> dict[str, float | None]:
    """Give the smallest size of an effect of the library for rich protocols and for others."""
    closed = [o for o in outcomes if o.truth.kind in ALONE]
    present = {protocols(o.truth) for o in closed}
    return {
        name: smallest_size([o for o in closed if protocols(o.truth) == name], question, share)
        for name in (RICH, OTHERS)
        if name in present
    }


def smallest_size(
    outcomes: Sequence[Outcome], question: Question, share: float = DETECTED
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


CONFUSIONS: Mapping[str, Group] = {
    "rich protocols": lambda t: rich_large(t) or (no_effect(t) and t.is_rich),
    "effect beyond the contract's": further_large,
    "effect missing from the library": lambda t: missing(t) and (t.size or 0.0) >= LARGE,
}


def confusion(outcomes: Sequence[Outcome]) -> Confusion:
    """Count the most probable explanations by truth; single effects and cases without any."""
    columns = (*LIBRARY, "none", "unknown", PAIR, OTHER, ERROR)
    order = [*LIBRARY, NO_EFFECT]
    present = {row(o.truth) for o in outcomes}
    rows = [name for name in order if name in present] + sorted(present - set(order))
    counted = Counter((row(o.truth), _column(o.answer, columns)) for o in outcomes)
    return Confusion(
        tuple(rows),
        columns,
        tuple(tuple(counted[name, column] for column in columns) for name in rows),
    )


def _column(answer: Answer, columns: Sequence[str]) -> str:
    if len(answer.top) != 1:
        return PAIR if answer.top else ERROR
    (name,) = answer.top
    return name if name in columns else OTHER
