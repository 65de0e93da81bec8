"""The answer: what kind, and which explanations stand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from spa_fo.gap.noise.interference import Line
from spa_fo.gap.search.drive import DriveFit
from spa_fo.gap.search.fitted import Fitted
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.effect import STAGES, Stage
from spa_fo.plant.effects.library import LIBRARY, Ids

Kind = Literal["no_gap", "cause", "ambiguous", "unknown"]
_LISTED = 1e-12  # probability below which a set is none


@dataclass(frozen=True)
class Scored:
    """An explanation of drive and angle together."""

    named: Ids  # its effects that count
    probability: float  # of all that is considered, `unknown` among it
    angle: Fitted  # its fit of the angle, with effects too small to be named
    drive: DriveFit | None  # its fit of the pressure
    fast: Line | None  # an interference that only single samples show
    moved_deg: Mapping[str, float]  # RMS by which each named effect moves the angle
    left_deg: float  # what repeats and is not explained, RMS


@dataclass(frozen=True)
class Verdict:
    """The answer."""

    kind: Kind
    sets: tuple[Ids, ...]  # explanations that stand; with `unknown`, the part that is explained
    scored: tuple[Scored, ...]  # every one that came near, most probable first; none among them
    unknown: float  # probability that the library lacks the cause
    none: float  # probability that there is no gap
    unknown_drive: float  # share of `unknown` that is the drive's

    def of(self, named: Ids) -> Scored:
        """Return the explanation of these effects."""
        return next(s for s in self.scored if s.named == named)


def judge(scored: Iterable[Scored], unknown: float, unknown_drive: float) -> Verdict:
    """Turn probabilities into an answer; see `Verdict` for the last two."""
    scored = sorted(scored, key=lambda one: -one.probability)
    kind, standing = chosen([(one.named, one.probability) for one in scored], unknown)
    none = sum(one.probability for one in scored if not one.named)
    return Verdict(kind, standing, tuple(scored), unknown, none, unknown_drive)


def judged_anew(
    verdict: Verdict,
    probability: Callable[[Scored], float],
    unknown: float,
    unknown_drive: float | None = None,
) -> Verdict:
    """Give explanations other probabilities, and judge them again; the drive's share stays."""
    scored = [replace(one, probability=probability(one)) for one in verdict.scored]
    of_drive = verdict.unknown_drive if unknown_drive is None else unknown_drive
    return judge(scored, unknown, of_drive)


def chosen(scored: Sequence[tuple[Ids, float]], unknown: float) -> tuple[Kind, tuple[Ids, ...]]:
    """Say what sort of answer probabilities make, and which explanations stand.

    Parameters
    ----------
    scored : sequence of pairs
        Each explanation with its probability, most probable first; nothing is ``()``.
    unknown : float
        Probability that none of them is the cause.

    Notes
    -----
    There is no gap where that is at least as probable as all sets together, and as an unknown
    cause. A name is given where it is clearly more probable than an unknown cause, as a wrong one
    costs more than none.
    """
    s = SETTINGS
    none = sum(probability for ids, probability in scored if not ids)
    total = sum(probability for ids, probability in scored if ids)
    if none >= max(total, unknown):
        return "no_gap", ()
    standing: list[Ids] = []
    held = 0.0
    for ids, probability in scored:
        if not ids:
            continue
        if standing and (held >= s.covered * total or probability < s.least * total):
            break
        standing.append(ids)
        held += probability
    if unknown > s.doubt * total:
        return "unknown", tuple(standing[:1])
    return "cause" if len(standing) == 1 else "ambiguous", tuple(standing)


def with_unknown(verdict: Verdict, more: float) -> Verdict:
    """Let an unknown cause be by so much more probable beside all that adds up to 1."""
    unknown, whole = verdict.unknown + more, 1.0 + more
    of_drive = verdict.unknown_drive * verdict.unknown / max(unknown, 1e-12)
    again = judged_anew(verdict, lambda s: s.probability / whole, unknown / whole, of_drive)
    if again.kind != "unknown":
        return replace(again, kind=verdict.kind, sets=verdict.sets)
    return replace(again, sets=tuple(named for named in again.sets if named in verdict.sets))


StagesOf = Callable[[Scored, str], tuple[Stage, ...]]
"""From an explanation and one of its effects to the stages that this may be in."""


def _own_stage(_: Scored, name: str) -> tuple[Stage, ...]:
    return (LIBRARY[name].stage,)


def stage_shares(verdict: Verdict, stages_of: StagesOf = _own_stage) -> dict[str, float]:
    """Share of the explained squared gap by stage, over all explanations by probability.

    Where an effect may be in several, it is shared evenly.
    """
    shares = dict.fromkeys(STAGES, 0.0)
    for one in verdict.scored:
        squares = {name: size**2 for name, size in one.moved_deg.items()}
        whole = max(sum(squares.values()), 1e-30)
        for name, square in squares.items():
            stages = stages_of(one, name)
            for stage in stages:
                shares[stage] += one.probability * square / whole / len(stages)
    total = sum(shares.values())
    return {stage: share / total if total > 0.0 else 0.0 for stage, share in shares.items()}


def said(verdict: Verdict) -> tuple[dict[Ids, float], float]:
    """Give the probabilities as they are said, of each set and of an unknown cause.

    They sum to 1, and decide nothing: the most probable kind of answer stays. What leads to them
    may be wrong as a whole, and all kinds of answer are as good then; what has a name is as often
    an unknown cause once more; and of what nothing that was tried explains a part is due to effects
    of the library, together or in another form.
    """
    s = SETTINGS
    own = {one.named: one.probability for one in verdict.scored if one.probability > _LISTED}
    none, unknown = own.pop((), 0.0), verdict.unknown
    whole = none + unknown + sum(own.values())
    none, unknown = (
        (1.0 - s.failed) * probability / whole + s.failed / 3.0 for probability in (none, unknown)
    )
    if own:
        unknown -= 2.0 * s.failed * max(unknown - 0.5, 0.0)
    else:
        unknown = 1.0 - none
    unknown += 2.0 * s.failed * max(0.5 - none - unknown, 0.0)
    left = (1.0 - none - unknown) / max(sum(own.values()), 1e-300)
    return {(): none} | {named: left * probability for named, probability in own.items()}, unknown
