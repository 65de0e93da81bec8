"""When to say that the library lacks the cause.

With the true effect missing a neighbour takes over most of the gap, so how much a set explains says
little. What it leaves does: structure that repeats from trial to trial, in the angle, the
pressure, the calibrations' dwells or their drift, beyond what a right but foreign form leaves.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.candidates import Candidates, Ids
from spa_fo.gap.explain import COEFFICIENT_SPREAD, DISCREPANCY, GAIN, SCALES, to_z
from spa_fo.gap.verdict import Scored, refit_probability

Floats = NDArray[np.float64]

# A right explanation leaves about these parts of the noise floor and of what it explains. Found
# on campaigns of the virtual rig that judge nothing.
_OF_FLOOR = 0.13
_OF_EXPLAINED = 0.065
# The plain physics with other coefficients is no foreign form: it leaves noise alone.
_OF_FLOOR_EXACT, _OF_EXPLAINED_EXACT = 0.07, 0.02
# Interference that swells and fades is not a single line.
_OF_PICKUP = 0.5
_FIXTURE_DEG, _OF_FIXTURE = 0.07, 0.15
_OF_PRESSURE = 0.18
_DRIFT_DEG, _OF_DRIFT = 0.22, 0.18
# A trend counts where it moves the angle by this part of the floor and is so many errors large.
_SWING, _CERTAIN, _FEWEST_TRIALS = 0.2, 4.2, 8
_FAINT, _NO_SPREAD = 0.2, 0.02  # stresses, and spreads, below are all alike
_WORTH_ASKING = 0.02  # probability of an explanation
_NO_HELP = 0.1  # of what one effect moves: seconds that move less are all alike
KINDS: tuple[frozenset[str], ...] = (
    frozenset({"dead_time", "line_lag", "slew_limit"}),
    frozenset({"sensor_lag", "channel_latency", "sensor_creep", "sensor_hysteresis"}),
    frozenset(
        {"stiffening", "gravity_load", "contact_stop", "sensor_nonlinearity", "sensor_saturation"}
    ),
)
"""Effects of one kind: smoothing of a jump, memory of the film, a static curve.

Two of a kind together are mostly one that the library lacks, bent into shape by the other.
"""


@dataclass(frozen=True)
class Stress:
    """How much more than a right explanation would a set leaves; 1 is the border.

    Attributes
    ----------
    angle, fixture, pressure, drift, trials : float
        By kind of evidence; `trials` is how their own gain or rest angle goes with their order.
    """

    angle: float
    fixture: float
    pressure: float
    drift: float
    trials: float

    @property
    def largest(self) -> tuple[str, float]:
        """The kind of evidence that speaks loudest, and how loud."""
        every = vars(self)
        name = max(every, key=lambda key: every[key])
        return name, float(every[name])


def stress(scored: Scored, candidates: Candidates, floor_deg: float) -> Stress:
    """Measure what an explanation leaves."""
    evidence = candidates.evidence
    wave = scored.moved_deg.get("mains_pickup", 0.0)
    others = [size for name, size in scored.moved_deg.items() if name != "mains_pickup"]
    explained = np.hypot.reduce([0.0, *others])
    of_floor, of_explained = _OF_FLOOR, _OF_EXPLAINED
    if scored.named == ("parameter_shift",):
        of_floor, of_explained = _OF_FLOOR_EXACT, _OF_EXPLAINED_EXACT
    right = [of_floor * floor_deg, of_explained * explained, _OF_PICKUP * wave]
    angle = scored.leftover_deg / float(np.hypot.reduce(right))
    fixture = 0.0
    if evidence.fixture is not None:
        seen = float(np.sqrt(np.mean(evidence.fixture.deviation_deg**2)))
        right = [_FIXTURE_DEG, _OF_FIXTURE * seen, _OF_PICKUP * wave]
        fixture = scored.fixture_deg / float(np.hypot.reduce(right))
    pressure = 0.0
    if candidates.drives:
        gain = candidates.centre[4] / candidates.centre[3] / evidence.data.campaign.reference_kpa
        per_kpa = float(np.degrees(gain))
        plain = candidates.drives[()].missed_kpa[evidence.used]
        seen = per_kpa * float(np.sqrt(np.mean(plain**2)))
        left = per_kpa * scored.pressure_kpa
        pressure = left / float(np.hypot(_OF_FLOOR * floor_deg, _OF_PRESSURE * seen))
    drift, trend = _drift(scored, candidates), _trend(scored, candidates, floor_deg)
    if "mains_pickup" in scored.named:
        # A slow wave moves every trial and every calibration by chance.
        drift = trend = 0.0
    return Stress(angle, fixture, pressure, drift, trend)


def unknown_probability(
    scored: list[Scored], candidates: Candidates, floor_deg: float
) -> tuple[float, Stress]:
    """Probability that no set of the library holds the cause.

    Parameters
    ----------
    scored : list of Scored
        All explanations, most probable first.
    candidates : Candidates
        What was fitted.
    floor_deg : float
        The noise floor.

    Returns
    -------
    probability : float
        0 to 1.
    stress : Stress
        Of the most probable explanation.
    """
    total = sum(
        s.probability * WEIGHTS.probability(signs(s, candidates, floor_deg))
        for s in scored
        if s.probability >= _WORTH_ASKING
    )
    # Identified again, the plain model may do as well as any effect.
    total = 1.0 - (1.0 - total) * (1.0 - refit_probability(scored, candidates))
    return min(total, 0.999), stress(scored[0], candidates, floor_deg)


def signs(scored: Scored, candidates: Candidates, floor_deg: float) -> dict[str, float]:
    """List the signs that an explanation stands in for a cause that the library lacks.

    Parameters
    ----------
    scored : Scored
        The explanation.
    candidates : Candidates
        What was fitted.
    floor_deg : float
        The noise floor.

    Returns
    -------
    dict
        Sign -> a number of order one: logarithms, or 1 for yes.
    """
    named, fit = scored.named, scored.explanation.fit
    left = {
        name: float(np.log(max(value, _FAINT)))
        for name, value in vars(stress(scored, candidates, floor_deg)).items()
    }
    sd = np.log(np.maximum(np.sqrt(fit.solution.variances) / SCALES, _NO_SPREAD))
    moved = to_z(fit.x) - to_z(candidates.given)
    near, free = (
        float(np.mean((moved / COEFFICIENT_SPREAD[level]) ** 2)) for level in ("near", "free")
    )
    shifted = "parameter_shift" in named
    held = bool(named) and not shifted and not candidates.own
    # An interference that swells and fades asks for corrections of its own.
    steady = "mains_pickup" not in named
    sizes = sorted(scored.moved_deg[name] for name in named)
    # Only of two can one be a helper: sets of three and more are what real campaigns have. And no
    # wave with phases of its own makes up for a response.
    helped = len(sizes) == 2 and scored.moved_deg.get("mains_pickup") != sizes[0]
    part = max(sizes[0] / sizes[1], _NO_HELP) if helped else 1.0
    return {
        **left,
        "loudest": max(left.values()),
        "nothing": float(not named),
        "made_up": float(_is_made_up(named)),
        "helper": float(-np.log(part)),
        "shifted": float(shifted),
        "own": float(candidates.own),
        "moved": float(np.log(0.01 + near)) if held else 0.0,
        "implausible": float(np.log1p(free)) if shifted and not candidates.own else 0.0,
        "correction": float(sd[DISCREPANCY]) if named and steady else 0.0,
        "uneven": float(sd[GAIN]) if steady else 0.0,
    }


@dataclass(frozen=True)
class Weights:
    """Logistic regression on signs.

    Attributes
    ----------
    intercept : float
        Log odds with all signs 0.
    by_sign : mapping
        Sign -> what one unit of it adds to the log odds of an unknown cause.
    """

    intercept: float
    by_sign: Mapping[str, float]

    def probability(self, signs: Mapping[str, float]) -> float:
        """Probability that an explanation with these signs stands in for something else."""
        odds = self.intercept + sum(self.by_sign[name] * value for name, value in signs.items())
        return float(1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0))))


def _learned() -> Weights:
    text = files("spa_fo.gap").joinpath("unknown_weights.json").read_text(encoding="utf-8")
    learned = json.loads(text)
    return Weights(learned["intercept"], learned["weights"])


WEIGHTS = _learned()
"""Learned by ``benchmarks/learn_unknown.py``."""


def _is_made_up(named: Ids) -> bool:
    """Whether a set looks like one effect that the library lacks, made up of others."""
    if "parameter_shift" in named and len(named) > 1:
        return True
    return any(len(kind & set(named)) > 1 for kind in KINDS)


def _drift(scored: Scored, candidates: Candidates) -> float:
    evidence = candidates.evidence
    if not evidence.drift_deg.size:
        return 0.0
    predicted = scored.explanation.fit.drift_deg
    missed = evidence.drift_deg - predicted
    left = float(np.sqrt(max(float(np.mean(missed**2 - evidence.drift_sigma_deg**2)), 0.0)))
    seen = float(np.sqrt(np.mean(evidence.drift_deg**2)))
    return left / float(np.hypot(_DRIFT_DEG, _OF_DRIFT * seen))


def _trend(scored: Scored, candidates: Candidates, floor_deg: float) -> float:
    """How surely the trials' own gain or rest angle goes up or down with their order."""
    evidence = candidates.evidence
    used = evidence.takes_part
    orders = evidence.grid.orders[used].astype(np.float64)
    if orders.size < _FEWEST_TRIALS:
        return 0.0
    size = float(np.sqrt(np.mean(evidence.grid.angle_deg**2)))
    loudest = 0.0
    # Gain and rest angle, as degrees; a sensor that slips explains its zeros itself.
    columns = {0: size, 1: 1.0}
    if "sensor_slip" in scored.explanation.ids:
        del columns[1]
    for column, per_unit in columns.items():
        own = scored.explanation.fit.trial_effects[used, column] * per_unit
        slope, error = _slope(orders, own)
        swing = abs(slope) * float(np.std(orders))
        if swing > _SWING * floor_deg:
            loudest = max(loudest, abs(slope) / error / _CERTAIN)
    return loudest


def _slope(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of a line and its standard error."""
    centred = x - x.mean()
    square = float(centred @ centred)
    slope = float(centred @ y) / square
    left = y - y.mean() - slope * centred
    return slope, float(np.sqrt(left @ left / max(x.size - 2, 1) / square)) + 1e-12
