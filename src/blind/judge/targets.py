"""The marks that the diagnosis has to reach on every rig, beside what was reached."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from blind.judge.classes import DIMENSIONS, parted
from blind.judge.questions import MEASURES
from blind.judge.records import Outcome, Truth
from blind.judge.statistics import Estimate, difference, nothing

LARGE = 4.0
"""Multiples of the noise floor from which on an effect should be named."""

ENOUGH = 10
"""Cases from which on a class of surroundings is judged by itself."""

BOTH_RIGS = "both"

Group = Callable[[Truth], bool]


@dataclass(frozen=True)
class Target:
    """A mark that the diagnosis has to reach in a group of cases."""

    name: str
    group: Group
    measure: str
    goal: float
    at_least: bool = True

    def reached(self, estimate: Estimate) -> bool | None:
        """Say whether it is; None without any case."""
        if estimate.n == 0:
            return None
        return self.shortfall(estimate) <= 0.0

    def shortfall(self, estimate: Estimate) -> float:
        """Tell by how much the goal is missed; negative where it is not."""
        return self.goal - estimate.value if self.at_least else estimate.value - self.goal

    def surely_missed_by(self, estimate: Estimate) -> float:
        """Tell by how much the better end of the interval misses the goal."""
        return self.goal - estimate.high if self.at_least else estimate.low - self.goal

    def measured(self, outcomes: Sequence[Outcome]) -> Estimate:
        """Measure the cases that it is about."""
        return MEASURES[self.measure]([o for o in outcomes if self.group(o.truth)])


def cases(kind: str, rich: bool | None = None, low: float = 0.0, high: float = 1e9) -> Group:
    """Choose the cases of a kind, on rich protocols or others, in a range of sizes.

    Those without a size always belong.
    """

    def belongs(truth: Truth) -> bool:
        return (
            truth.kind == kind
            and rich in (None, truth.is_rich)
            and (truth.size is None or low <= truth.size <= high)
        )

    return belongs


def everything(_: Truth) -> bool:
    """Choose all cases."""
    return True


def missing(truth: Truth) -> bool:
    """Choose the cases whose effect the library lacks."""
    return truth.is_missing


no_effect = cases("no_effect")
rich_large, rich_two = cases("closed", True, LARGE), cases("closed", True, 2.0, 2.0)
other_large = cases("closed", False, LARGE)
further_large = cases("further", True, LARGE)


def _at_least(goal: float, name: str, group: Group, measure: str) -> Target:
    return Target(name, group, measure, goal)


def _at_most(goal: float, name: str, group: Group, measure: str) -> Target:
    return Target(name, group, measure, goal, at_least=False)


_LARGE = "rich protocol, 4 or more times the floor"
_TWICE = "rich protocol, twice the floor"
_MISSING = "effect withheld or foreign"
_BEYOND = "effect beyond the contract's, 4 or more times the floor"

FALSE_ALARMS = _at_most(0.02, "no effect: false alarms", no_effect, "false_alarm")
WORST_CLASS = _at_most(
    0.05, "no effect: false alarms, worst class of surroundings", no_effect, "false_alarm"
)
UNKNOWN_RATE = _at_most(0.08, f"{_LARGE}: unknown", rich_large, "unknown")
WRONG_NAMES = _at_most(
    0.03, "effect in the library: wrong confident name", cases("closed"), "wrong_name"
)
IN_SETS = _at_least(0.92, f"{_LARGE}: truth in the sets", rich_large, "in_sets")
UNNAMED = _at_least(0.75, f"{_MISSING}: unknown or equal", missing, "fair_or_unknown")
CALIBRATION = _at_most(0.05, "probabilities: calibration error", everything, "ece")
_BY_NAME = (
    IN_SETS,
    _at_least(0.90, f"{_LARGE}: most probable is right", rich_large, "right_first"),
    _at_most(1.3, f"{_LARGE}: sets on average", rich_large, "sets"),
    UNKNOWN_RATE,
    _at_least(0.90, f"{_TWICE}: found", rich_two, "found"),
    _at_least(0.80, f"{_TWICE}: most probable is right", rich_two, "right_first"),
    WRONG_NAMES,
    _at_least(0.92, f"{_BEYOND}: truth in the sets", further_large, "in_sets"),
    _at_most(0.03, f"{_BEYOND}: wrong confident name", further_large, "wrong_name"),
    _at_most(0.08, f"{_MISSING}: wrong confident name", missing, "wrong_name"),
    UNNAMED,
    _at_least(0.70, "pair: both named", cases("pair"), "in_sets"),
    _at_least(
        0.70, "three to five effects: named, none wrongly", cases("several"), "rightly_named"
    ),
    _at_most(0.08, "three to five effects: wrong confident name", cases("several"), "wrong_name"),
    _at_least(0.90, "shrink: claim within 10 points of realised", everything, "shrink_close"),
    _at_least(0.90, "shrink: 95 % interval holds the realised", everything, "shrink_covered"),
    CALIBRATION,
)
TARGETS = (FALSE_ALARMS, *_BY_NAME)
"""Those that are measured in any group of cases: on a rig, and in each class of surroundings."""

BETWEEN_RIGS = _at_most(
    0.05, "difference between the rigs beyond the intervals, any mark", everything, ""
)


@dataclass(frozen=True)
class Mark:
    """A target beside what was reached on a rig; `which` names the worst where one is sought."""

    rig: str
    target: Target
    estimate: Estimate
    which: str = ""


@dataclass(frozen=True)
class ClassMark:
    """A target beside what was reached on a rig in one class of surroundings."""

    rig: str
    target: Target
    dimension: str
    name: str
    estimate: Estimate


def marks(outcomes: Sequence[Outcome], classes: Sequence[ClassMark]) -> tuple[Mark, ...]:
    """Hold every target against the cases it is about: rig by rig, then the rigs together."""
    found = [mark for rig, own in by_rig(outcomes).items() for mark in _of_rig(rig, own, classes)]
    return (*found, _between_rigs(found))


def by_rig(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """Part cases by the rig that made them; the rigs by name, the virtual rig first."""
    rigs = sorted({o.truth.rig for o in outcomes}, key=lambda rig: (rig != "virtual_rig", rig))
    return {rig: [o for o in outcomes if o.truth.rig == rig] for rig in rigs}


def class_marks(outcomes: Sequence[Outcome]) -> tuple[ClassMark, ...]:
    """Hold every target against each class of surroundings on each rig, the worst first.

    Those come first whose goal is missed most even at the better end of the interval.
    """
    found = [
        ClassMark(rig, target, dimension.name, name, estimate)
        for rig, own in by_rig(outcomes).items()
        for dimension in DIMENSIONS
        for name, members in parted(own, dimension).items()
        for target in TARGETS
        if (estimate := target.measured(members)).n
    ]
    return tuple(sorted(found, key=lambda mark: -mark.target.surely_missed_by(mark.estimate)))


def _of_rig(rig: str, outcomes: Sequence[Outcome], classes: Sequence[ClassMark]) -> Iterator[Mark]:
    yield Mark(rig, FALSE_ALARMS, FALSE_ALARMS.measured(outcomes))
    yield _worst_class([mark for mark in classes if mark.rig == rig], rig)
    for target in _BY_NAME:
        yield Mark(rig, target, target.measured(outcomes))


def _worst_class(classes: Sequence[ClassMark], rig: str) -> Mark:
    """Find the class of surroundings with most false alarms among those with enough cases."""
    enough = [m for m in classes if m.target == FALSE_ALARMS and m.estimate.n >= ENOUGH]
    if not enough:
        return Mark(rig, WORST_CLASS, nothing())
    worst = max(enough, key=lambda mark: (mark.estimate.value, mark.estimate.n))
    return Mark(rig, WORST_CLASS, worst.estimate, f"{worst.dimension}: {worst.name}")


def _between_rigs(found: Sequence[Mark]) -> Mark:
    """Find the mark that differs most between two rigs beyond what their intervals explain."""
    apart = []
    for target in TARGETS:
        own = [mark.estimate for mark in found if mark.target == target]
        pairs = [difference(one, other) for i, one in enumerate(own) for other in own[i + 1 :]]
        apart += [(target.name, pair) for pair in pairs if pair.n]
    if not apart:
        return Mark(BOTH_RIGS, BETWEEN_RIGS, nothing())
    name, worst = max(apart, key=lambda entry: (entry[1].low, entry[1].value))
    beyond = Estimate(worst.low, worst.low, worst.high, worst.n)
    return Mark(BOTH_RIGS, BETWEEN_RIGS, beyond, f"{name}, {worst.value:.3f} apart")
