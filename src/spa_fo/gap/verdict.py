"""From fitted explanations to probabilities, and from these to an answer, or to none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.candidates import RELEVANT, RELEVANT_PART, Candidates, Ids
from spa_fo.gap.evidence import Evidence
from spa_fo.gap.explanation import Explanation, combined, simulate
from spa_fo.gap.floor import repeats
from spa_fo.plant.effects.library import IDS, LIBRARY

Floats = NDArray[np.float64]
Kind = Literal["no_gap", "cause", "ambiguous", "unknown"]

TEMPER = 0.3
"""Power of the evidence: forms are not quite true, and samples are not quite independent."""
_LOG_NONE = np.log(0.3)
_LOG_SINGLE = np.log(0.5 / len(IDS))
_LOG_PAIR = np.log(0.2 / (len(IDS) * (len(IDS) - 1) / 2))
_LOG_FURTHER = -5.0
_LOG_SHIFTED = -4.0  # other coefficients are how a wrong effect makes up for the right one
_LOG_ALIKE = -5.0
ALIKE: tuple[frozenset[str], ...] = (
    frozenset({"creep", "sensor_creep"}),
    frozenset({"hysteresis", "sensor_hysteresis"}),
    frozenset({"sensor_lag", "channel_latency"}),
    frozenset({"dead_time", "line_lag"}),
    frozenset({"stiffening", "gravity_load", "contact_stop", "sensor_nonlinearity"}),
    frozenset({"sensor_nonlinearity", "sensor_saturation"}),
    frozenset({"contact_stop", "sensor_saturation"}),
    frozenset({"mains_pickup", "sensor_slip"}),  # a slow wave has a phase in every trial
)
"""Effects that look alike: two of them together are mostly one whose form is not quite right."""
_SHORTLIST = 60.0  # nats behind the best that may still matter after tempering
COVERED = 0.93
"""Probability that the verdict's sets hold together, of what is named at all."""
_LEAST = 0.06  # probability below which a set is not listed


@dataclass(frozen=True)
class Scored:
    """An explanation with its weight and what it leaves.

    Attributes
    ----------
    explanation : Explanation
        The explanation, with effects too small to be named.
    named : tuple of str
        Its effects that move the angle by more than a small part of the noise floor.
    moved_deg : dict
        RMS by which each of its effects moves the angle.
    leftover_deg : float
        RMS of what repeats in the residual, samples of a step counting as one.
    fixture_deg : float
        The same of the calibrations' dwells.
    pressure_kpa : float
        The same of the pressure.
    probability : float
        Among the explanations, `unknown` not counted.
    """

    explanation: Explanation
    named: Ids
    moved_deg: dict[str, float]
    leftover_deg: float
    fixture_deg: float
    pressure_kpa: float
    probability: float


@dataclass(frozen=True)
class Verdict:
    """The answer.

    Attributes
    ----------
    kind : {"no_gap", "cause", "ambiguous", "unknown"}
        What sort of answer.
    sets : tuple of tuples of str
        Explanations that stand; with `unknown`, the part that is explained.
    scored : tuple of Scored
        Every explanation that came near, most probable first.
    unknown : float
        Probability that the library lacks the cause.
    p_value : float
        Of no gap: a bound by the Bayes factor against it.
    """

    kind: Kind
    sets: tuple[Ids, ...]
    scored: tuple[Scored, ...]
    unknown: float
    p_value: float

    @property
    def best(self) -> Scored:
        """The most probable explanation, `unknown` not counted."""
        return self.scored[0]

    @property
    def none(self) -> float:
        """Probability of no gap."""
        return sum(s.probability for s in self.scored if not s.named) * (1.0 - self.unknown)


def log_prior(ids: Ids) -> float:
    """Logarithm of a set's probability beforehand: small sets first."""
    if not ids:
        return float(_LOG_NONE)
    if len(ids) == 1:
        return float(_LOG_SINGLE)
    shifted = _LOG_SHIFTED if "parameter_shift" in ids else 0.0
    alike = sum(set(pair) <= group for pair in combinations(ids, 2) for group in ALIKE)
    return float(_LOG_PAIR + _LOG_FURTHER * (len(ids) - 2) + shifted + _LOG_ALIKE * alike)


def log_weight(explanation: Explanation) -> float:
    """Logarithm of an explanation's probability, but for what all have in common."""
    return float(TEMPER * explanation.log_evidence + log_prior(explanation.ids))


def weigh(candidates: Candidates, floor_deg: float) -> list[Scored]:
    """Give every explanation its probability."""
    evidence = candidates.evidence
    whole = combined(candidates)
    score = {e.ids: log_weight(e) for e in whole}
    best = max(score.values())
    near = [e for e in whole if score[e.ids] > best - TEMPER * _SHORTLIST or not e.ids]
    moved = {e.ids: moved_by(e, candidates) for e in near}
    # An idle member is no part of the answer: of sets that are then the same, the best counts.
    best_of: dict[Ids, Explanation] = {}
    for e in sorted(near, key=lambda e: -score[e.ids]):
        least = max(RELEVANT * floor_deg, RELEVANT_PART * max(moved[e.ids].values(), default=0.0))
        active = tuple(n for n in e.ids if moved[e.ids][n] >= least)
        # Idle effects may still hide that the coefficients moved: only the plain model is none.
        if active or not e.ids:
            best_of.setdefault(active, e)
    kept = list(best_of.values())
    weights = np.array([score[e.ids] for e in kept])
    weights = np.exp(weights - weights.max())
    weights /= weights.sum()
    found = [
        Scored(
            explanation=e,
            named=named,
            moved_deg=moved[e.ids],
            leftover_deg=leftover(evidence, e.fit.residual_deg),
            fixture_deg=_fixture_leftover(evidence, e),
            pressure_kpa=0.0
            if e.drive is None
            else float(np.sqrt(np.mean(e.drive.missed_kpa[evidence.used] ** 2))),
            probability=float(weight),
        )
        for (named, e), weight in zip(best_of.items(), weights, strict=True)
    ]
    return sorted(found, key=lambda s: -s.probability)


def refit_probability(scored: Sequence[Scored], candidates: Candidates) -> float:
    """Probability that the plain model with other coefficients does as well, where it is no answer.

    Identified again is what every explanation has to beat, also where the library is to lack a
    shift of the parameters.
    """
    if candidates.own or "parameter_shift" not in candidates.excluded:
        return 0.0
    drive = candidates.drives.get(())
    identified = [candidates.angles[((), level)] for level in ("shifted", "free")]
    evidence = max(fit.log_evidence for fit in identified)
    evidence += drive.log_evidence if drive is not None else 0.0
    refit = TEMPER * evidence + log_prior(("parameter_shift",))
    best = scored[0]
    score = log_weight(best.explanation)
    odds = np.exp(np.clip(score - refit, -50.0, 50.0)) / best.probability
    return float(1.0 / (1.0 + odds))


def moved_by(explanation: Explanation, candidates: Candidates) -> dict[str, float]:
    """RMS over the samples by which each effect of a set moves the angle, deg."""
    evidence = candidates.evidence
    full = simulate(explanation, evidence)
    result = {}
    for name in explanation.ids:
        if name == "parameter_shift":
            less = simulate(explanation, evidence, given=candidates.given)
        elif name == "mains_pickup" and explanation.pickup is not None:
            result[name] = explanation.pickup[1] / float(np.sqrt(2.0))
            continue
        elif name == "sensor_slip":
            less = full - explanation.fit.zeros_deg[evidence.grid.sample_trial]
        else:
            less = simulate(explanation, evidence, without=(name,))
        weight = evidence.grid.counts
        result[name] = float(np.sqrt(np.average((full - less) ** 2, weights=weight)))
    return result


def leftover(evidence: Evidence, residual: Floats) -> float:
    """RMS of what repeats in a residual, noise taken off, deg."""
    square = count = 0.0
    for repeated in repeats(evidence, residual, evidence.takes_part):
        seen = np.isfinite(repeated.values)
        number = seen.sum(axis=0)
        mean = np.where(seen, repeated.values, 0.0).sum(axis=0) / np.maximum(number, 1)
        noise = evidence.variance[repeated.rows] / np.maximum(number, 1)
        square += float(np.sum((mean**2 - noise)[number > 0]))
        count += float(np.count_nonzero(number))
    return float(np.sqrt(max(square / count, 0.0)))


def _fixture_leftover(evidence: Evidence, explanation: Explanation) -> float:
    fixture = evidence.fixture
    if fixture is None:
        return 0.0
    missed = explanation.fit.fixture_deg
    return float(np.sqrt(max(float(np.mean(missed**2 - fixture.sigma_deg**2)), 0.0)))


def beating(
    scored: Sequence[Scored],
    errors: Mapping[Ids, tuple[float, float]],
    limits: tuple[float, float],
) -> list[Scored]:
    """Leave out explanations that predict worse than need be.

    Parameters
    ----------
    scored : sequence of Scored
        All explanations.
    errors : mapping
        RMS errors of those that were tried, deg: on held-out trials, and on all.
    limits : (float, float)
        What both must stay below, deg.
    """
    kept = [
        s
        for s in scored
        if not s.named
        or all(own < most for own, most in zip(errors.get(s.named, ()), limits, strict=False))
    ]
    total = sum(s.probability for s in kept)
    if total <= 0.0:  # nothing is left but the plain model, however improbable it was beside them
        return [replace(s, probability=float(not s.named)) for s in kept]
    kept = [replace(s, probability=s.probability / total) for s in kept]
    return sorted(kept, key=lambda s: -s.probability)


def judge(scored: Sequence[Scored], unknown: float, p_value: float, significant: bool) -> Verdict:
    """Turn probabilities into an answer.

    Parameters
    ----------
    scored : sequence of Scored
        All explanations, most probable first.
    unknown : float
        Probability that none of them is the cause.
    p_value : float
        Of no gap.
    significant : bool
        Whether there is a gap at all. The cause is unknown where, given a gap, that is more
        probable than all that is named together.
    """
    kind: Kind
    named = [s for s in scored if s.named]
    if not significant:
        return Verdict("no_gap", (), tuple(scored), unknown, p_value)
    total = sum(s.probability for s in named)
    standing: list[Ids] = []
    held = 0.0
    for s in named:
        if standing and (held >= COVERED * total or s.probability < _LEAST * total):
            break
        standing.append(s.named)
        held += s.probability
    if unknown > total * (1.0 - unknown):
        kind = "unknown"
        standing = standing[:1]
    else:
        kind = "cause" if len(standing) == 1 else "ambiguous"
    return Verdict(kind, tuple(standing), tuple(scored), unknown, p_value)


def stage_shares(verdict: Verdict) -> dict[str, float]:
    """Share of the explained squared gap by stage, over all explanations by probability."""
    shares = {"drive": 0.0, "actuator": 0.0, "sensor": 0.0, "acquisition": 0.0}
    for s in verdict.scored:
        squares = {name: size**2 for name, size in s.moved_deg.items()}
        total = max(sum(squares.values()), 1e-30)
        for name, square in squares.items():
            shares[LIBRARY[name].stage] += s.probability * square / total
    total = sum(shares.values())
    if total <= 0.0 or verdict.kind == "no_gap":
        return dict.fromkeys(shares, 0.0)
    return {stage: share / total for stage, share in shares.items()}
