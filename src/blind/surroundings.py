"""What a bench is like around the actuator: drawn for every case from broad priors.

Nothing here comes from what the diagnosis can do. The ranges are those of benches: a good one at
one end (a screened converter, a machined fixture, a servo valve), a rough one at the other (a
breadboard, a protractor, a hand-set regulator).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Generator = np.random.Generator


@dataclass(frozen=True)
class Prior:
    """A quantity of the surroundings and how it is drawn.

    Attributes
    ----------
    key : str
        Where it stands in the case document, ``group.name``.
    draw : callable
        Draws one value with a random generator.
    words : str
        The prior, for a reader.
    unit : str
        Empty where there is none.
    reason : str
        Why this range.
    """

    key: str
    draw: Callable[[Generator], Any]
    words: str
    unit: str
    reason: str


def _log_uniform(key: str, low: float, high: float, unit: str, reason: str) -> Prior:
    def draw(rng: Generator) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.4g}")

    return Prior(key, draw, f"log-uniform, {low:g} to {high:g}", unit, reason)


def _uniform(key: str, low: float, high: float, unit: str, reason: str) -> Prior:
    def draw(rng: Generator) -> float:
        return float(f"{rng.uniform(low, high):.4g}")

    return Prior(key, draw, f"uniform, {low:g} to {high:g}", unit, reason)


def _one_of(key: str, shares: dict[Any, float], unit: str, reason: str) -> Prior:
    values, weights = list(shares), np.array(list(shares.values()))

    def draw(rng: Generator) -> Any:
        return values[int(rng.choice(len(values), p=weights / weights.sum()))]

    words = ", ".join(f"{value} ({weight:.0%})" for value, weight in shares.items())
    return Prior(key, draw, words, unit, reason)


def _whole(key: str, low: int, high: int, unit: str, reason: str) -> Prior:
    def draw(rng: Generator) -> int:
        return int(rng.integers(low, high + 1))

    return Prior(key, draw, f"uniform, {low} to {high}", unit, reason)


PRIORS: tuple[Prior, ...] = (
    _one_of(
        "noise.colour",
        {"exponential": 0.8, "one_over_f": 0.2},
        "",
        "motion of the body, filters of the sensor and hands have a time scale; drift has none",
    ),
    _log_uniform(
        "noise.coloured_deg", 0.02, 0.5, "deg", "a flex sensor at rest, up to a soft arm that sways"
    ),
    _log_uniform(
        "noise.correlation_s", 0.05, 10.0, "s", "a filter's time, up to warmth and slow air"
    ),
    _log_uniform("noise.white_deg", 0.01, 0.2, "deg", "a reading's own noise, one sample"),
    _one_of(
        "converter.bits",
        {8: 0.1, 10: 0.4, 12: 0.3, 14: 0.1, 16: 0.1},
        "bit",
        "boards as they are sold, the ten bits of an AVR most of all",
    ),
    _log_uniform("scatter.gain", 0.002, 0.04, "", "a servo valve, up to a regulator set by hand"),
    _log_uniform("scatter.time_scale", 0.003, 0.04, "", "warmth of silicone, supply and tubing"),
    _log_uniform("scatter.rest_deg", 0.05, 1.0, "deg", "how a soft body comes to rest"),
    _log_uniform(
        "fixture.error_deg", 0.02, 0.8, "deg", "a machined dividing head, up to a paper protractor"
    ),
    _one_of(
        "calibration.kind",
        {"none": 0.25, "before": 0.35, "before_and_after": 0.4},
        "",
        "a camera or an inertial sensor needs none; few calibrate twice",
    ),
    _uniform("calibration.dwell_s", 2.0, 10.0, "s", "by hand and by machine"),
    _whole("calibration.angles", 3, 19, "", "every 45° up to every 5°"),
    _one_of("calibration.directions", {1: 0.35, 2: 0.65}, "", "up alone, or up and down"),
    _one_of(
        "sampling.rate_hz",
        {10.0: 0.1, 20.0: 0.15, 50.0: 0.35, 60.0: 0.1, 100.0: 0.2, 200.0: 0.1},
        "Hz",
        "serial loggers, cameras, boards with a timer",
    ),
    _log_uniform("sampling.jitter", 0.001, 0.2, "period", "a timer, up to a loop with prints"),
    _log_uniform("sampling.missing", 1e-4, 0.01, "", "samples that a busy host loses"),
    _log_uniform("sampling.damaged", 1e-4, 0.005, "", "rows that a bad line breaks"),
    _one_of("pressure.measured", {True: 0.75, False: 0.25}, "", "many benches have no tap"),
    _log_uniform("pressure.resolution_kpa", 0.01, 1.0, "kPa", "16 bit, up to 8 bit of 5 bar"),
    _log_uniform("pressure.lag_s", 0.0005, 0.05, "s", "a sensor at the tap, up to a filtered one"),
)

PROTOCOL_PRIORS: tuple[Prior, ...] = (
    _one_of(
        "protocol.name",
        {"up_steps": 0.2, "releases": 0.2, "rich": 0.3, "everything": 0.15, "single": 0.15},
        "",
        "the paper's up-steps, up to a day of everything; single logs are the commonest data",
    ),
    _whole("protocol.repeats", 1, 8, "", "a single trial, up to more than the paper's seven"),
    _one_of(
        "protocol.order", {"interleaved": 0.6, "blocked": 0.4}, "", "mixed, or one after the other"
    ),
)
PROTOCOL_NAMES = ("up_steps", "releases", "rich", "everything", "single")
RICH = ("rich", "everything")
"""Protocols rich enough for an effect to be named; the rest is reported beside them."""

MODEL_PRIORS: tuple[Prior, ...] = (
    _one_of(
        "model.kind",
        {"own": 1 / 3, "earlier": 1 / 3, "off": 1 / 3},
        "",
        "identified on the campaign itself, on an earlier one, or known up to an error",
    ),
    _log_uniform("model.off", 0.001, 0.01, "", "what a datasheet or another bench leaves"),
)


def draw(priors: tuple[Prior, ...], rng: Generator) -> dict[str, dict[str, Any]]:
    """Draw every quantity, each in its group: ``{"noise": {"colour": ...}, ...}``."""
    groups: dict[str, dict[str, Any]] = {}
    for prior in priors:
        group, name = prior.key.split(".")
        groups.setdefault(group, {})[name] = prior.draw(rng)
    return groups


def draw_surroundings(rng: Generator) -> dict[str, Any]:
    """Draw the surroundings of one case, as its document holds them."""
    found = draw(PRIORS, rng)
    if found["noise"]["colour"] == "one_over_f":
        found["noise"]["correlation_s"] = None
    return found


def draw_protocol(rng: Generator, among: tuple[str, ...] | None = None) -> dict[str, Any]:
    """Draw a protocol, of all or only of some; a rich one has every experiment at least twice."""
    while True:
        protocol = draw(PROTOCOL_PRIORS, rng)["protocol"]
        if among is None or protocol["name"] in among:
            break
    if protocol["name"] in RICH:
        protocol["repeats"] = max(2, min(protocol["repeats"], 5))
    return protocol


def draw_model(rng: Generator, own: bool = True) -> dict[str, Any]:
    """Draw where the judged model comes from; not from the campaign itself where `own` is false."""
    while True:
        model = draw(MODEL_PRIORS, rng)["model"]
        if own or model["kind"] != "own":
            break
    return model if model["kind"] == "off" else {"kind": model["kind"]}


def describe() -> list[tuple[str, str, str, str]]:
    """List every prior for a reader: name, prior in words, unit, reason."""
    return [
        (prior.key, prior.words, prior.unit, prior.reason)
        for prior in (*PRIORS, *PROTOCOL_PRIORS, *MODEL_PRIORS)
    ]
