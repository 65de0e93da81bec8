"""A static curve before or behind the linear part, and conditioning by the level reached.

A block-oriented model (Hammerstein: the curve before; Wiener: behind; Giri and Bai 2010,
doi:10.1007/978-1-84996-513-2). The curve rises everywhere and goes through the origin; its slope
is straight between a few knots, constant beyond them, and one on average from the first to the
last, so that the gain stays the linear part's. Conditioning is what a first load leaves (Mullins
1969, doi:10.5254/1.3539210): a level that follows the pressure up, at a rate, and never down adds
a rest angle and a gain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.fractional import Hold, simulate
from spa_fo.plant.model_file import Model
from spa_fo.validation import suggestion

BEFORE, BEHIND = "before", "behind"
POSITIONS = (BEFORE, BEHIND)
ID = "static_curve"
"""Of the effect of a model file that holds one."""
STAGE = "actuator"


@dataclass(frozen=True)
class MonotoneCurve:
    """A rising curve through the origin, its slope straight between knots.

    Parameters
    ----------
    knots : (k,) array
        Rising, from 0.
    slopes : (k,) array
        Positive, at the knots; one on average between the first and the last.
    """

    knots: Floats
    slopes: Floats

    @classmethod
    def normalised(cls, knots: Floats, slopes: Floats) -> MonotoneCurve:
        """Make one of slopes up to a factor."""
        return cls(knots, slopes / (mean_weights(knots) @ slopes))

    def __call__(self, x: Floats) -> Floats:
        """Return the curve's values."""
        return np.asarray(integrated_hats(self.knots, x) @ self.slopes)

    def slope(self, x: Floats) -> Floats:
        """Return its slopes."""
        return np.asarray(np.interp(x, self.knots, self.slopes))


def mean_weights(knots: Floats) -> Floats:
    """Return the weights of slopes at knots whose sum is the mean slope between first and last."""
    share: Floats = np.diff(knots) / (knots[-1] - knots[0])
    return np.asarray(0.5 * (np.append(share, 0.0) + np.append(0.0, share)))


def integrated_hats(knots: Floats, x: Floats) -> Floats:
    """Return the integrals from 0 to `x` of the hat functions at the knots, shape (n, k).

    The first and the last hat stay at one beyond the knots. The integrals times the slopes at the
    knots are the curve.
    """
    inside = np.clip(x, knots[0], knots[-1])[:, np.newaxis]
    width = np.diff(knots)
    # How far through each interval, and the integral of the falling and the rising half.
    through = np.clip((inside - knots[:-1]) / width, 0.0, 1.0)
    rising = 0.5 * width * through**2
    falling = width * through - rising
    columns = np.zeros((x.size, knots.size))
    columns[:, :-1] += falling
    columns[:, 1:] += rising
    columns[:, 0] += np.minimum(x - knots[0], 0.0)
    columns[:, -1] += np.maximum(x - knots[-1], 0.0)
    return columns


def level_reached(t: Floats, level: Floats, time_s: float, start: float = 0.0) -> Floats:
    """Return the level that conditioning has reached: it follows up at a rate, and never down.

    Parameters
    ----------
    t : (n,) array
        Times, s.
    level : (n,) array
        What is reached; each value held until the next.
    time_s : float
        Time constant of the approach.
    start : float
        Reached before.

    Returns
    -------
    (n,) array
        In the level's unit.
    """
    share = -np.expm1(-np.diff(t, append=t[-1]) / time_s)
    reached = np.empty_like(level)
    now = start
    for i, (one, part) in enumerate(zip(level.tolist(), share.tolist(), strict=True)):
        reached[i] = now
        now += part * max(0.0, one - now)
    return reached


@dataclass(frozen=True)
class Conditioning:
    """What pressure leaves behind within a trial, a virgin one at its start.

    Parameters
    ----------
    level_kpa : float
        Level at which the next two hold; below it they are smaller in proportion.
    time_s : float
        How long the level takes to be reached.
    set_deg : float
        Rest angle that it leaves.
    softening : float
        Share by which the gain grows.
    """

    level_kpa: float
    time_s: float
    set_deg: float
    softening: float

    def reached(self, t: Floats, pressure_kpa: Floats) -> Floats:
        """Return the level reached at each sample, in units of `level_kpa`."""
        return level_reached(t, pressure_kpa / self.level_kpa, self.time_s)

    def apply(self, angle: Floats, reached: Floats) -> Floats:
        """Return the conditioned angle in rad."""
        soft: Floats = angle * (1.0 + self.softening * reached)
        return soft + math.radians(self.set_deg) * reached


@dataclass(frozen=True)
class StaticCurve:
    """A curve at its place beside G(s).

    Parameters
    ----------
    position : {"before", "behind"}
        From pressure to load, in kPa; or from the linear angle to the angle, in degrees.
    curve : MonotoneCurve
        In these units.
    conditioning : Conditioning or None
    """

    position: str
    curve: MonotoneCurve
    conditioning: Conditioning | None = None

    def predict(self, model: Model, t: Floats, pressure_kpa: Floats, hold: Hold) -> Floats:
        """Return the angle in degrees at times `t` (s), at rest before the first."""
        g = model.transfer_function
        load = self.curve(pressure_kpa) if self.position == BEFORE else pressure_kpa
        u = load / model.reference_kpa
        angle = np.degrees(simulate(t, u, g.alpha2, g.alpha1, g.a1, g.a0, g.b0, hold=hold))
        if self.position == BEHIND:
            angle = self.curve(angle)
        if self.conditioning is not None:
            reached = self.conditioning.reached(t, pressure_kpa)
            angle = np.degrees(self.conditioning.apply(np.radians(angle), reached))
        return np.asarray(angle)

    def to_effect(self) -> dict[str, Any]:
        """Return the entry of a model file's list of effects."""
        parameters = {
            "position": self.position,
            _KNOTS[self.position]: self.curve.knots.tolist(),
            "slopes": self.curve.slopes.tolist(),
        }
        if self.conditioning is not None:
            parameters["conditioning"] = asdict(self.conditioning)
        return {"id": ID, "stage": STAGE, "parameters": parameters}


_KNOTS = {BEFORE: "knots_kpa", BEHIND: "knots_deg"}
_CONDITIONING = tuple(Conditioning.__dataclass_fields__)


def curve_of(model: Model, source: Path | str = "model") -> StaticCurve | None:
    """Return the static curve of a model; None where it has none.

    Raises
    ------
    BadInput
        It is not what `StaticCurve.to_effect` writes, or other effects stand beside it. The text
        names the key.
    """
    places = [i for i, effect in enumerate(model.effects) if effect["id"] == ID]
    if not places:
        return None
    if len(model.effects) > 1:
        raise BadInput(source, f"expected {ID} to stand alone, found other effects", "effects")
    return _Reader(source).curve(model.effects[0])


class _Reader:
    """Checks the entry; every refusal names the file and the key."""

    def __init__(self, source: Path | str) -> None:
        self.source = source

    def curve(self, effect: Mapping[str, Any]) -> StaticCurve:
        if effect["stage"] != STAGE:
            self._refuse("stage", f"is '{effect['stage']}', but {ID} belongs to the {STAGE}")
        given = effect["parameters"]
        position = given.get("position")
        if position not in POSITIONS:
            self._refuse("position", f"expected one of {', '.join(POSITIONS)}, found {position!r}")
        names = ("position", _KNOTS[position], "slopes", "conditioning")
        for name in given:
            if name not in names:
                self._refuse(name, f"is no parameter of {ID}{suggestion(name, names)}")
        knots = self._array(given, _KNOTS[position])
        slopes = self._array(given, "slopes")
        if knots.size < 2 or knots[0] != 0.0 or np.any(np.diff(knots) <= 0.0):
            self._refuse(_KNOTS[position], "expected two knots or more that rise from 0")
        if slopes.size != knots.size or np.any(slopes <= 0.0):
            self._refuse("slopes", f"expected {knots.size} positive numbers, one a knot")
        return StaticCurve(position, MonotoneCurve(knots, slopes), self._conditioning(given))

    def _conditioning(self, given: Mapping[str, Any]) -> Conditioning | None:
        if "conditioning" not in given:
            return None
        section = given["conditioning"]
        if not isinstance(section, Mapping) or set(section) != set(_CONDITIONING):
            self._refuse("conditioning", f"expected an object with {', '.join(_CONDITIONING)}")
        values = {name: self._number(section[name], name) for name in _CONDITIONING}
        for name in ("level_kpa", "time_s"):
            if values[name] <= 0.0:
                self._refuse(name, f"expected a positive number, found {values[name]:g}")
        return Conditioning(**values)

    def _array(self, given: Mapping[str, Any], name: str) -> Floats:
        values = given.get(name)
        if not isinstance(values, list):
            self._refuse(name, "expected a list of numbers")
        return np.array([self._number(value, name) for value in values])

    def _number(self, value: Any, name: str) -> float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not math.isfinite(value):
            self._refuse(name, f"expected finite numbers, found {value!r}")
        return float(value)

    def _refuse(self, name: str, expected: str) -> NoReturn:
        where = "effects[0].stage" if name == "stage" else f"effects[0].parameters.{name}"
        raise BadInput(self.source, expected, where)
