"""The marks that the diagnosis has to reach, beside what was reached."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from blind.judge.questions import MEASURES
from blind.judge.records import BASELINES, Outcome, Truth
from blind.judge.statistics import Estimate

LARGE = 4.0
"""Multiples of the noise floor from which on an effect should be named."""

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
        return estimate.value >= self.goal if self.at_least else estimate.value <= self.goal


def cases(kind: str, protocol: str | None = None, low: float = 0.0, high: float = 1e9) -> Group:
    """Choose the cases of a kind, a protocol and a range of sizes; those without a size always."""

    def belongs(truth: Truth) -> bool:
        return (
            truth.kind == kind
            and protocol in (None, truth.protocol)
            and (truth.size is None or low <= truth.size <= high)
        )

    return belongs


def everything(_: Truth) -> bool:
    """Choose all cases."""
    return True


rich_large, up_large = cases("closed", "rich", LARGE), cases("closed", "up_steps", LARGE)
rich_two = cases("closed", "rich", 2.0, 2.0)


def _at_least(goal: float, name: str, group: Group, measure: str) -> Target:
    return Target(name, group, measure, goal)


def _at_most(goal: float, name: str, group: Group, measure: str) -> Target:
    return Target(name, group, measure, goal, at_least=False)


_RICH, _UP = "rich protocol, 4 or more times the floor", "up-steps, 4 or more times the floor"
_TWICE = "rich protocol, twice the floor"

TARGETS = (
    _at_least(0.95, f"{_RICH}: truth in the sets", rich_large, "in_sets"),
    _at_most(1.3, f"{_RICH}: sets on average", rich_large, "sets"),
    _at_least(0.92, f"{_RICH}: most probable is right", rich_large, "right_first"),
    _at_least(0.97, f"{_RICH}: stage is right", rich_large, "right_stage"),
    _at_least(0.95, f"{_TWICE}: found", rich_two, "found"),
    _at_least(0.85, f"{_TWICE}: most probable is right", rich_two, "right_first"),
    _at_least(0.90, f"{_UP}: truth in the sets", up_large, "in_sets"),
    _at_most(2.0, f"{_UP}: sets on average", up_large, "sets"),
    _at_most(0.01, "no effect: false alarms", cases("no_effect"), "found"),
    _at_most(0.03, "effect in the library: wrong confident name", cases("closed"), "wrong_name"),
    _at_most(0.10, "effect withheld: wrong confident name", cases("withheld"), "wrong_name"),
    _at_least(0.80, "effect withheld: unknown or equal", cases("withheld"), "fair_or_unknown"),
    _at_most(0.10, "foreign effect: wrong confident name", cases("alien"), "wrong_name"),
    _at_least(0.80, "foreign effect: unknown or equal", cases("alien"), "fair_or_unknown"),
    _at_least(0.70, "pair: both named", cases("pair"), "in_sets"),
    _at_least(0.95, "pair: at least one named", cases("pair"), "one_named"),
    _at_most(0.05, "probabilities: calibration error", everything, "ece"),
    _at_least(0.90, "shrink: claim within 10 points of realised", everything, "shrink_close"),
    _at_least(0.90, "shrink: 95 % interval holds the realised", everything, "shrink_covered"),
)


@dataclass(frozen=True)
class Mark:
    """A target beside what was reached, by the diagnosis and by the baselines."""

    target: Target
    estimate: Estimate
    baselines: Mapping[str, Estimate]


def marks(outcomes: Sequence[Outcome]) -> tuple[Mark, ...]:
    """Hold every target against the cases it is about."""
    rivals = {name: _answered_by(name, outcomes) for name in BASELINES}
    return tuple(
        Mark(
            target,
            _measured(target, outcomes),
            {name: _measured(target, answered) for name, answered in rivals.items()},
        )
        for target in TARGETS
    )


def _measured(target: Target, outcomes: Sequence[Outcome]) -> Estimate:
    return MEASURES[target.measure]([o for o in outcomes if target.group(o.truth)])


def _answered_by(baseline: str, outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [
        replace(outcome, answer=outcome.baselines[baseline])
        for outcome in outcomes
        if baseline in outcome.baselines
    ]
