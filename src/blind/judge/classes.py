"""Classes of surroundings: where a case stands in each of some dimensions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from blind.judge.records import Outcome, Truth


@dataclass(frozen=True)
class Dimension:
    """One respect in which surroundings differ, and the class of each truth in it."""

    name: str
    classes: tuple[str, ...]
    of: Callable[[Truth], str]


Number = Callable[[Truth], float]


def _classes(unit: str, low: float, high: float) -> tuple[str, str, str]:
    return f"below {low:g}{unit}", f"{low:g} to {high:g}{unit}", f"above {high:g}{unit}"


def _which(number: float, low: float, high: float) -> int:
    """Say which of three classes a number is in; the limits belong to the middle one."""
    return (number >= low) + (number > high)


def _three(
    name: str, low: float, high: float, number: Number, classes: tuple[str, str, str]
) -> Dimension:
    return Dimension(name, classes, lambda truth: classes[_which(number(truth), low, high)])


def _measured(name: str, unit: str, low: float, high: float, number: Number) -> Dimension:
    return _three(name, low, high, number, _classes(unit, low, high))


def _words(name: str, words: Mapping[str, str], value: Callable[[Truth], str]) -> Dimension:
    return Dimension(name, tuple(words.values()), lambda truth: words[value(truth)])


NEARLY_WHITE, ONE_OVER_F = "nearly white", "1/f"
_HARDLY_ANY_DEG = 0.05
_CORRELATION_S = (0.3, 2.0)
_CORRELATED = _classes(" s", *_CORRELATION_S)


def _colour(truth: Truth) -> str:
    noise = truth.surroundings
    if noise.coloured_deg < _HARDLY_ANY_DEG:
        return NEARLY_WHITE
    if noise.correlation_s is None:
        return ONE_OVER_F
    return _CORRELATED[_which(noise.correlation_s, *_CORRELATION_S)]


NO_CALIBRATION = "no calibration"
_FIXTURE_DEG = (0.1, 0.3)
_FIXTURE = _classes("°", *_FIXTURE_DEG)


def _fixture(truth: Truth) -> str:
    if truth.surroundings.calibration == "none":
        return NO_CALIBRATION
    return _FIXTURE[_which(truth.surroundings.fixture_deg, *_FIXTURE_DEG)]


DIMENSIONS: tuple[Dimension, ...] = (
    Dimension("noise colour", (NEARLY_WHITE, *_CORRELATED, ONE_OVER_F), _colour),
    _measured("coloured noise", "°", 0.1, 0.25, lambda t: t.surroundings.coloured_deg),
    _measured("scatter of gain", " %", 0.5, 1.5, lambda t: 100 * t.surroundings.gain),
    _measured("scatter of time scale", " %", 0.5, 1.5, lambda t: 100 * t.surroundings.time_scale),
    _measured("scatter of rest angle", "°", 0.2, 0.5, lambda t: t.surroundings.rest_deg),
    Dimension("fixture error", (NO_CALIBRATION, *_FIXTURE), _fixture),
    _words(
        "calibration",
        {"none": "none", "before": "before", "before_and_after": "before and after"},
        lambda t: t.surroundings.calibration,
    ),
    _measured("sampling rate", " Hz", 25.0, 75.0, lambda t: t.surroundings.rate_hz),
    _three(
        "converter",
        10,
        12,
        lambda t: t.surroundings.bits,
        ("8 or 9 bits", "10 to 12 bits", "above 12 bits"),
    ),
    _words(
        "pressure",
        {"True": "measured", "False": "not measured"},
        lambda t: str(t.surroundings.pressure),
    ),
    _words(
        "protocol",
        {
            "up_steps": "up-steps",
            "releases": "releases",
            "rich": "rich",
            "everything": "everything",
            "single": "single",
        },
        lambda t: t.protocol,
    ),
    _three("repeats", 2, 3, lambda t: t.repeats, ("1", "2 or 3", "4 and more")),
    _words("order", {"interleaved": "interleaved", "blocked": "blocked"}, lambda t: t.order),
    _words(
        "given model",
        {"own": "identified on the campaign", "earlier": "identified earlier", "off": "off"},
        lambda t: t.model,
    ),
)


def parted(outcomes: Sequence[Outcome], dimension: Dimension) -> dict[str, list[Outcome]]:
    """Part cases by their class in one dimension; classes without a case are left out."""
    members: dict[str, list[Outcome]] = {name: [] for name in dimension.classes}
    for outcome in outcomes:
        members[dimension.of(outcome.truth)].append(outcome)
    return {name: own for name, own in members.items() if own}
