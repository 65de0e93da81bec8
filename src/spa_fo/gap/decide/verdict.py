"""The answer: what kind, and which explanations stand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from spa_fo.gap.noise.interference import Line
from spa_fo.gap.search.drive import DriveFit
from spa_fo.gap.search.fitted import Fitted
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY

Ids = tuple[str, ...]
Kind = Literal["no_gap", "cause", "ambiguous", "unknown"]


@dataclass(frozen=True)
class Scored:
    """An explanation of drive and angle together.

    Attributes
    ----------
    named : tuple of str
        Its effects that count.
    probability : float
        Of all that is considered, `unknown` among it.
    angle : Fitted
        Its fit of the angle, with effects too small to be named.
    drive : DriveFit or None
        Its fit of the pressure.
    fast : Line or None
        An interference that only single samples show.
    moved_deg : dict
        RMS by which each named effect moves the angle.
    left_deg : float
        What repeats and is not explained, RMS.
    """

    named: Ids
    probability: float
    angle: Fitted
    drive: DriveFit | None
    fast: Line | None
    moved_deg: Mapping[str, float]
    left_deg: float


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
        Every explanation that came near, most probable first; none among them.
    unknown, none : float
        Probabilities that the library lacks the cause, and that there is no gap.
    unknown_drive : float
        Probability that what is unknown is the drive's.
    """

    kind: Kind
    sets: tuple[Ids, ...]
    scored: tuple[Scored, ...]
    unknown: float
    none: float
    unknown_drive: float

    def of(self, named: Ids) -> Scored:
        """Return the explanation of these effects."""
        return next(s for s in self.scored if s.named == named)


def judge(scored: Sequence[Scored], unknown: float, unknown_drive: float) -> Verdict:
    """Turn probabilities into an answer.

    Parameters
    ----------
    scored : sequence of Scored
        All explanations, most probable first.
    unknown : float
        Probability that none of them is the cause.
    unknown_drive : float
        Share of it that is the drive's.
    """
    kind, standing = chosen([(one.named, one.probability) for one in scored], unknown)
    none = sum(one.probability for one in scored if not one.named)
    return Verdict(kind, standing, tuple(scored), unknown, none, unknown_drive)


def chosen(scored: Sequence[tuple[Ids, float]], unknown: float) -> tuple[Kind, tuple[Ids, ...]]:
    """Say what sort of answer probabilities make, and which explanations stand.

    Parameters
    ----------
    scored : sequence of pairs
        Each explanation with its probability, most probable first; nothing is ``()``.
    unknown : float
        Probability that none of them is the cause.
    """
    s = SETTINGS
    named = [(ids, probability) for ids, probability in scored if ids]
    none = sum(probability for ids, probability in scored if not ids)
    total = sum(probability for _, probability in named)
    if none >= total + unknown:
        return "no_gap", ()
    standing: list[Ids] = []
    held = 0.0
    for ids, probability in named:
        if standing and (held >= s.covered * total or probability < s.least * total):
            break
        standing.append(ids)
        held += probability
    if unknown > total:
        return "unknown", tuple(standing[:1])
    return "cause" if len(standing) == 1 else "ambiguous", tuple(standing)


def stage_shares(verdict: Verdict) -> dict[str, float]:
    """Share of the explained squared gap by stage, over all explanations by probability."""
    shares = {"drive": 0.0, "actuator": 0.0, "sensor": 0.0, "acquisition": 0.0}
    for one in verdict.scored:
        squares = {name: size**2 for name, size in one.moved_deg.items()}
        total = max(sum(squares.values()), 1e-30)
        for name, square in squares.items():
            shares[LIBRARY[name].stage] += one.probability * square / total
    total = sum(shares.values())
    return {stage: share / total if total > 0.0 else 0.0 for stage, share in shares.items()}
