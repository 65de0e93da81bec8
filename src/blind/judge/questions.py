"""What is asked of an answer, and what that makes of a group of cases.

Every question is put to one case and answered by yes or no; its measure is the share of yes.
Strict where there is a choice: naming more than what is at work is wrong, an `unknown` that holds
the truth as its explained part does not name it, equivalents recorded with a case count only where
the library lacks the effect, and a diagnosis that ended in an error saw and named nothing, but is a
false alarm where there is no effect. A model that is off is a shift of the parameters: naming that
is no false alarm, and beside the truth no wrong name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from blind.judge.records import ERROR, NONE, UNKNOWN, Answer, Outcome, Truth
from blind.judge.statistics import (
    Calibration,
    Estimate,
    calibration,
    expected_error,
    mean,
    rate,
)

SHRINK_TOLERANCE = 0.10
CLEAR = 2.5
"""Multiples of the floor from which on the gap on unseen trials gives a fraction to judge by.

The square of the scatter of six trials varies by 30 %: a gap of 1.5 times the floor would have its
fraction known within 24 points only, one of 2.5 times within 6.
"""


Question = Callable[[Truth, Answer], bool]
Measure = Callable[[Sequence[Outcome]], Estimate]


def found(_: Truth, answer: Answer) -> bool:
    """Whether it saw a gap."""
    return answer.verdict not in ("no_gap", ERROR)


def false_alarm(truth: Truth, answer: Answer) -> bool:
    """Whether it is anything but `no_gap`; a shift, named alone, is there where a model is off."""
    return answer.verdict != "no_gap" and not names_exactly(truth, answer)


def names_exactly(truth: Truth, answer: Answer) -> bool:
    """Whether all that it names is exactly what is at work."""
    return answer.names and all(map(truth.is_exactly, answer.sets))


def in_sets(truth: Truth, answer: Answer) -> bool:
    """Whether it named the truth, alone or among what it cannot tell apart."""
    if truth.kind == "no_effect":
        return not false_alarm(truth, answer)
    return answer.names and any(map(truth.is_exactly, answer.sets))


def right_first(truth: Truth, answer: Answer) -> bool:
    """Whether its first explanation is the truth; `unknown` or fair, where that is missing."""
    if truth.is_missing:
        return answer.top == UNKNOWN or truth.fair(answer.top)
    if truth.kind == "no_effect" and answer.top == NONE:
        return True
    return bool(answer.top) and truth.is_exactly(answer.top)


def right_stage(truth: Truth, answer: Answer) -> bool:
    """Whether it puts most of the gap where the effect is; of two, where either is."""
    return answer.stage in truth.stages


def wrong_name(truth: Truth, answer: Answer) -> bool:
    """Whether it is sure of a cause that is not at work."""
    return answer.verdict == "cause" and not truth.fair(answer.sets[0])


def abstained(_: Truth, answer: Answer) -> bool:
    """Whether it said that it does not know."""
    return answer.verdict == "unknown"


def fair_or_unknown(truth: Truth, answer: Answer) -> bool:
    """Whether it said that it does not know, or named nothing but fair answers."""
    return abstained(truth, answer) or rightly_named(truth, answer)


def rightly_named(truth: Truth, answer: Answer) -> bool:
    """Whether it named something, and nothing that is not at work."""
    return answer.names and all(map(truth.fair, answer.sets))


def one_named(truth: Truth, answer: Answer) -> bool:
    """Whether at least one of the effects is in its sets."""
    return any(truth.effects & named for named in answer.sets)


def share_of(question: Question, says_stage: bool = False) -> Measure:
    """Make the measure that is the share of cases where the answer to `question` is yes.

    Parameters
    ----------
    question : callable
    says_stage : bool
        Whether only cases count that have a stage, and answers that say one.
    """

    def measure(outcomes: Sequence[Outcome]) -> Estimate:
        return rate(
            [
                question(outcome.truth, outcome.answer)
                for outcome in outcomes
                if not says_stage or (outcome.truth.stages and outcome.answer.stage)
            ]
        )

    return measure


def set_count(outcomes: Sequence[Outcome]) -> Estimate:
    """Mean number of sets of the answers that name any."""
    return mean([float(len(o.answer.sets)) for o in outcomes if o.answer.names])


def claimed_and_right(outcomes: Sequence[Outcome]) -> tuple[list[float], list[bool]]:
    """List the probabilities of the most probable explanations, and whether these were right."""
    said = [
        (o.answer.probability, right_first(o.truth, o.answer))
        for o in outcomes
        if o.answer.probability is not None
    ]
    return [probability for probability, _ in said], [right for _, right in said]


def calibrated(outcomes: Sequence[Outcome]) -> Calibration:
    """How well the probability of the most probable explanation is calibrated."""
    return calibration(*claimed_and_right(outcomes))


def calibration_error(outcomes: Sequence[Outcome]) -> Estimate:
    """Compute the calibration error alone."""
    return expected_error(*claimed_and_right(outcomes))


def fraction_closed(before_deg: float, after_deg: float, floor_deg: float) -> float:
    """Share of the gap that a model closes: 1 - (after² - floor²) / (before² - floor²)."""
    return 1.0 - (after_deg**2 - floor_deg**2) / (before_deg**2 - floor_deg**2)


@dataclass(frozen=True)
class ShrinkPoint:
    """One case's shrink: claimed with its interval, and what the unseen trials say."""

    case: str
    kind: str
    size: float | None
    claimed: float
    low: float
    high: float
    realised: float
    refit: float

    @property
    def close(self) -> bool:
        """Whether the claim is within `SHRINK_TOLERANCE` of what is realised."""
        return abs(self.claimed - self.realised) <= SHRINK_TOLERANCE

    @property
    def covered(self) -> bool:
        """Whether the claimed interval holds what is realised."""
        return self.low <= self.realised <= self.high


def shrink_points(outcomes: Sequence[Outcome]) -> tuple[ShrinkPoint, ...]:
    """List the claimed shrinks, where the gap on the unseen trials is clear of the floor."""
    points = []
    for outcome in outcomes:
        truth, claim, seen = outcome.truth, outcome.answer.claim, outcome.realised
        floor = truth.noise_floor_deg
        if claim is None or seen is None or seen.before_deg < CLEAR * floor:
            continue
        points.append(
            ShrinkPoint(
                case=truth.case,
                kind=truth.kind,
                size=truth.size,
                claimed=claim.fraction_closed,
                low=claim.low,
                high=claim.high,
                realised=fraction_closed(seen.before_deg, seen.after_deg, floor),
                refit=fraction_closed(seen.before_deg, seen.refit_deg, floor),
            )
        )
    return tuple(points)


def claims_close(outcomes: Sequence[Outcome]) -> Estimate:
    """Share of claimed shrinks within `SHRINK_TOLERANCE` of what is realised."""
    return rate([point.close for point in shrink_points(outcomes)])


def claims_cover(outcomes: Sequence[Outcome]) -> Estimate:
    """Share of claimed shrinks whose interval holds what is realised."""
    return rate([point.covered for point in shrink_points(outcomes)])


MEASURES: Mapping[str, Measure] = {
    "found": share_of(found),
    "false_alarm": share_of(false_alarm),
    "in_sets": share_of(in_sets),
    "sets": set_count,
    "right_first": share_of(right_first),
    "right_stage": share_of(right_stage, says_stage=True),
    "wrong_name": share_of(wrong_name),
    "unknown": share_of(abstained),
    "fair_or_unknown": share_of(fair_or_unknown),
    "rightly_named": share_of(rightly_named),
    "one_named": share_of(one_named),
    "ece": calibration_error,
    "shrink_close": claims_close,
    "shrink_covered": claims_cover,
}
