"""Free-form laws: an unnamed relation at one place of the chain, given by its values at knots.

Between the knots a law is a natural cubic spline, beyond them straight. Whatever it does in the
actuator is told as the pressure that would do the same, so that it stands beside any effect:

    u = (p + Δ(p) + m(θ) + r(θ') − Σ w_k ∫ e^{−(t−s)/τ_k} dθ) / reference.

A law that follows the motion makes the load depend on the angle: see `spa_fo.plant.lawful`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from scipy.interpolate import CubicSpline

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.errors import BadInput
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.validation import suggestion

LAW = "law"
"""The id of a law in a model's list of effects."""

_MOST_KNOTS, _LARGEST = 200, 1e9
_FINE = 100  # entries of a table a knot


@dataclass(frozen=True)
class Place:
    """Where a law may sit.

    Attributes
    ----------
    stage : str
        Of the chain.
    words : str
        The relation that it adds to.
    over, over_unit : str
        What it is a function of.
    gives, unit : str
        What it adds.
    """

    stage: str
    words: str
    over: str
    over_unit: str
    gives: str
    unit: str


PLACES = {
    "filling": Place(
        "drive",
        "how fast the pressure follows the command",
        "command less pressure",
        "kPa",
        "rate of the pressure",
        "kPa/s",
    ),
    "input_map": Place(
        "actuator", "what load a pressure makes", "pressure", "kPa", "added load", "kPa"
    ),
    "moment": Place(
        "actuator", "what moment an angle brings back", "angle", "deg", "added load", "kPa"
    ),
    "damping": Place(
        "actuator", "what moment resists motion", "rate of the angle", "deg/s", "added load", "kPa"
    ),
    "relaxation": Place(
        "actuator", "how stress relaxes", "relaxation time", "s", "stiffness", "kPa/deg"
    ),
    "trial_gain": Place(
        "actuator", "how the gain changes over the trials", "trial", "", "added gain", "1"
    ),
    "reading": Place("sensor", "what an angle is read as", "angle", "deg", "added reading", "deg"),
    "trial_rest": Place(
        "sensor", "how the rest angle changes over the trials", "trial", "", "added angle", "deg"
    ),
}
"""All places, in the order of the chain."""


@dataclass(frozen=True)
class Past:
    """What a law that follows the motion remembers.

    Attributes
    ----------
    angle_deg : float
        The last angle.
    stress : (k,) array
        What is left of the angle's changes, by relaxation time, deg.
    """

    angle_deg: float
    stress: Floats


@dataclass(frozen=True)
class Law:
    """A law at its place.

    Attributes
    ----------
    place : str
        One of `PLACES`.
    knots, values : (k,) arrays
        Where it is given, rising, and its values there.
    """

    place: str
    knots: Floats
    values: Floats

    @property
    def stage(self) -> str:
        """The stage of the chain that it belongs to."""
        return PLACES[self.place].stage

    @property
    def follows_motion(self) -> bool:
        """Whether the load depends on the angle."""
        return self.place in ("moment", "damping", "relaxation")

    @cached_property
    def _spline(self) -> tuple[CubicSpline, float, float]:
        spline = CubicSpline(self.knots, self.values, bc_type="natural")
        slope = spline.derivative()
        return spline, float(slope(self.knots[0])), float(slope(self.knots[-1]))

    def at(self, over: Floats) -> Floats:
        """Value of the law, same shape."""
        spline, low, high = self._spline
        inside = np.clip(over, self.knots[0], self.knots[-1])
        return np.asarray(spline(inside) + np.where(over < inside, low, high) * (over - inside))

    def _in_range(self, order: Floats) -> Floats:
        """Value by place in the campaign: beyond the knots that of the nearest."""
        return self.at(np.clip(order, self.knots[0], self.knots[-1]))

    def table(self) -> tuple[Floats, Floats]:
        """Lay the law out evenly, so finely that it is straight in between."""
        fine = np.linspace(self.knots[0], self.knots[-1], _FINE * self.knots.size)
        return fine, self.at(fine)

    def of_input(self, pressure_kpa: Floats, order: Floats) -> Floats:
        """Give what it adds to each step's pressure, kPa; `order` is the step's trial's."""
        if self.place == "input_map":
            return self.at(pressure_kpa)
        if self.place == "trial_gain":
            return self._in_range(order) * pressure_kpa
        return np.zeros_like(pressure_kpa)

    def of_motion(
        self, angle_deg: Floats, step_s: Floats, past: Past | None = None
    ) -> tuple[Floats, Past]:
        """Give what it adds to the pressure of each step, kPa, and what it remembers after them.

        Parameters
        ----------
        angle_deg, step_s : (n,) arrays
            True angle at the end of each step, and lengths of the steps.
        past : Past, optional
            Before the first step; at rest at 0 by default.
        """
        past = past or Past(0.0, np.zeros(self.knots.size))
        before = np.concatenate([[past.angle_deg], angle_deg[:-1]])
        after = Past(float(angle_deg[-1]), past.stress)
        if self.place == "moment":
            return self.at(0.5 * (before + angle_deg)), after
        if self.place == "damping":
            return self.at((angle_deg - before) / step_s), after
        mean, stress = relaxing(angle_deg, step_s, self.knots, past)
        return np.asarray(-mean @ self.values), Past(after.angle_deg, stress)

    def driven(self, command_kpa: Floats, starts: Integers) -> Floats:
        """Pressure on the cells behind a drive whose filling follows the law, kPa."""
        if self.place != "filling":
            return command_kpa
        return np.asarray(_filled(command_kpa, starts, *self.table()))

    def of_reading(self, angle_deg: Floats, order: Floats) -> Floats:
        """Give what it adds to logged angles, deg; `order` is each sample's trial's."""
        if self.place == "reading":
            return self.at(angle_deg)
        if self.place == "trial_rest":
            return self._in_range(order)
        return np.zeros_like(angle_deg)

    def to_effect(self) -> dict[str, Any]:
        """Return the entry of a model's list of effects."""
        return {
            "id": LAW,
            "stage": self.stage,
            "place": self.place,
            "parameters": {"knots": self.knots.tolist(), "values": self.values.tolist()},
        }


def law_of(effect: Mapping[str, Any], where: str, source: object) -> Law:
    """Read an entry of a model's list of effects.

    Raises
    ------
    BadInput
        It is no law; the text names the key.
    """

    def refuse(key: str, expected: str) -> NoReturn:
        raise BadInput(str(source), expected, f"{where}.{key}")

    place, stage, parameters = effect.get("place"), effect["stage"], effect["parameters"]
    if not isinstance(place, str) or place not in PLACES:
        near = suggestion(place, list(PLACES)) if isinstance(place, str) else ""
        refuse("place", f"expected one of {', '.join(PLACES)}, found {place!r}{near}")
    if stage != PLACES[place].stage:
        refuse("stage", f"is '{stage}', but {place} belongs to the {PLACES[place].stage}")
    names = ("knots", "values")
    for name in parameters:
        if name not in names:
            refuse(f"parameters.{name}", f"is no parameter of a law{suggestion(name, names)}")
    for name in names:
        if name not in parameters:
            refuse(f"parameters.{name}", "missing, expected this key")
    read = {}
    for name in names:
        found = _numbers(parameters[name])
        if isinstance(found, str):
            refuse(f"parameters.{name}", found)
        read[name] = found
    knots, values = read["knots"], read["values"]
    if values.size != knots.size:
        refuse("parameters.values", f"expected {knots.size} numbers, one a knot")
    if not (np.diff(knots) > 0.0).all():
        refuse("parameters.knots", "expected numbers that rise")
    if place == "relaxation" and not (knots[0] > 0.0 and (values >= 0.0).all()):
        refuse("parameters", "expected relaxation times above 0 and values that are not negative")
    return Law(place, knots, values)


def _numbers(given: Any) -> Floats | str:
    """Return the numbers, or what was expected instead."""
    if not isinstance(given, list) or not 2 <= len(given) <= _MOST_KNOTS:
        return f"expected a list of 2 to {_MOST_KNOTS} numbers"
    for value in given:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return f"expected numbers, found {value!r}"
        if not abs(value) < _LARGEST:
            return f"expected numbers below {_LARGEST:g} in size, found {value!r}"
    return np.array(given, dtype=np.float64)


def relaxing(
    angle_deg: Floats, step_s: Floats, times_s: Floats, past: Past
) -> tuple[Floats, Floats]:
    """Give what is left of the angle's changes: mean over each step (n, k), and at the end (k,)."""
    stress = past.stress.copy()
    return np.asarray(_relaxing(angle_deg, step_s, times_s, past.angle_deg, stress)), stress


@njit
def _relaxing(
    angle: Floats, step: Floats, times: Floats, before_first: float, stress: Floats
) -> Floats:
    """States of Maxwell elements, the angle straight within a step; `stress` is carried on."""
    out = np.empty((angle.size, times.size))
    for k in range(times.size):
        state, before = stress[k], before_first
        for i in range(angle.size):
            ratio = step[i] / times[k]
            lost = -math.expm1(-ratio)
            rate = (angle[i] - before) / ratio
            # z' = −z/τ + θ', its mean over the step: (∫ z = τ (Δθ − Δz))
            after = state * (1.0 - lost) + rate * lost
            out[i, k] = (angle[i] - before - after + state) / ratio
            state, before = after, angle[i]
        stress[k] = state
    return out


@njit
def _filled(command: Floats, starts: Integers, over: Floats, rate: Floats) -> Floats:
    """Pressure whose rate is a table over what the command is above it; Heun's rule."""
    out = np.empty(command.size)
    for trial in range(starts.size - 1):
        p = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            first = _looked_up(command[i] - p, over, rate)
            there = p + FINEST_STEP_S * first
            second = _looked_up(command[i] - there, over, rate)
            after = p + 0.5 * FINEST_STEP_S * (first + second)
            after = min(max(after, -_LARGEST), _LARGEST)
            out[i] = 0.5 * (p + after)
            p = after
    return out


@njit
def _looked_up(at: float, over: Floats, values: Floats) -> float:
    """Straight between the entries of an even table, and beyond them."""
    step = over[1] - over[0]
    k = min(max(int((at - over[0]) / step), 0), over.size - 2)
    value: float = values[k] + (values[k + 1] - values[k]) * (at - over[k]) / step
    return value
