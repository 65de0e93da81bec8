"""What to do next: a few steps that fit the answer, most telling first.

A step parts pairs of explanations. What it brings is the product of the probabilities of each pair,
summed over the pairs that it parts and that no better step has parted already: the decrease of the
Gini impurity of the answer. So nothing is asked for twice, and nothing that decides little.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from spa_fo.errors import BadInput
from spa_fo.gap.answer.findings import MISSING, lacking
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.diagnosis import Cause, Step
from spa_fo.gap.plan.advice import plan_few, richest_profile
from spa_fo.gap.plan.profile_choice import Plan, to_run
from spa_fo.gap.plan.profiles import limits_of
from spa_fo.gap.plan.remedies import CAMERA, Remedy, known_remedies
from spa_fo.gap.plan.rivals import Ids
from spa_fo.plant.effects.library import LIBRARY

Pair = tuple[Ids, Ids]

MOST = 3
"""Steps that are named."""
_LEAST = 0.08  # of all that is open: what brings less is not worth a day at the bench
_SEEN = 0.8  # how surely an observation parts a pair
_SIMULATED = 0.75  # a profile on which they differ clearly
_CLEAR = 2.0  # noise floors: a smaller difference is as much less sure
_SHOWN = 0.5  # of a richer protocol, whose outcome nobody has foreseen
_CONSIDERED = 0.01  # probability from which a rival of a cause counts
_RUNS = 3
_REPEAT = Step(
    "repeat an experiment unchanged, three times or more",
    "what does not repeat in every trial is noise, and no model can explain it",
)


@dataclass(frozen=True)
class Option:
    """A step that might be taken, and how surely it parts each pair that it parts."""

    do: str
    why: str
    parts: Mapping[Pair, float]

    def worth(self, still_open: Mapping[Pair, float]) -> float:
        """Sum what it would settle of what is open."""
        return sum(still_open[pair] * sure for pair, sure in self.parts.items())


def next_steps(
    kind: str,
    sets: Sequence[Ids],
    causes: Sequence[Cause],
    evidence: Evidence,
    floor_deg: float,
) -> tuple[Step, ...]:
    """Say what to do next at the bench.

    Parameters
    ----------
    kind : str
        Of the verdict.
    sets : sequence of tuples of str
        The verdict's.
    causes : sequence of Cause
        All explanations that were considered.
    evidence : Evidence
        The campaign.
    floor_deg : float
        Noise floor.

    Returns
    -------
    tuple of Step
        At most `MOST`, most telling first. After a cause only what would tell it from a rival that
        is still probable, after no gap only what a smaller one would show in: may be empty.
    """
    weights = _weights(kind, sets, causes)
    pairs = {(a, b): weights[a] * weights[b] for a, b in combinations(weights, 2)}
    lacks = lacking(evidence)
    if kind == "ambiguous":
        made = _planned(sets, causes, evidence, floor_deg)
        offered = [*remedy_options(pairs, lacks, made is None), *_profile_option(made, pairs)]
    else:
        offered = _open_ended(pairs, lacks, evidence)
    named = kind in ("ambiguous", "cause")
    first = (_REPEAT,) if "repeats" in lacks and not named else ()
    steps = (*first, *ranked(pairs, offered, named))[:MOST]
    if not steps and kind in ("ambiguous", "unknown"):
        return (Step(CAMERA.do, CAMERA.why),)
    return steps


def in_words(steps: Sequence[Step]) -> str:
    """Write steps as one text, numbered where there are several."""
    if len(steps) == 1:
        return steps[0].text
    return " ".join(f"{place}. {step.text}" for place, step in enumerate(steps, 1))


def ranked(pairs: Mapping[Pair, float], offered: Sequence[Option], named: bool) -> Iterator[Step]:
    """Choose the step that brings most, then the one that brings most of what it leaves, and so on.

    Parameters
    ----------
    pairs : mapping
        What is open: the product of the two probabilities, by pair of explanations.
    offered : sequence of Option
        Steps to choose from; of equals the first is taken.
    named : bool
        Whether each step is to say which explanations it tells apart.
    """
    still_open, left = dict(pairs), list(offered)
    least = _LEAST * sum(pairs.values())
    for _ in range(MOST):
        best = max(left, key=lambda option: option.worth(still_open), default=None)
        if best is None or not best.worth(still_open) > least:
            return
        left.remove(best)
        foremost = max(best.parts, key=lambda pair: still_open[pair] * best.parts[pair])
        yield Step(best.do, best.why, foremost if named else ())
        for pair, sure in best.parts.items():
            still_open[pair] *= 1.0 - sure


def remedy_options(
    pairs: Mapping[Pair, float], lacks: Sequence[str], protocols: bool
) -> list[Option]:
    """Offer the remedies that a campaign has use for.

    Parameters
    ----------
    pairs : mapping
        What is open.
    lacks : sequence of str
        What the campaign lacks.
    protocols : bool
        Whether to offer those that a planned profile would replace.
    """
    return [
        _option(remedy, pairs, _SHOWN if remedy.protocol else _SEEN)
        for remedy in known_remedies()
        if (not remedy.lacks or remedy.lacks in lacks) and (protocols or not remedy.protocol)
    ]


def _option(remedy: Remedy, pairs: Mapping[Pair, float], sure: float) -> Option:
    return Option(
        remedy.do, remedy.why, {pair: sure for pair in pairs if remedy.parts(pair[0], pair[1])}
    )


def _weights(kind: str, sets: Sequence[Ids], causes: Sequence[Cause]) -> dict[Ids, float]:
    """Weigh the explanations that a next step has to choose among.

    Where the cause is not known, half of the weight is on what was found, and half on all effects
    alike: the names found stand in for another, and the step that shows most of any is wanted.
    """
    found = {cause.set: cause.probability for cause in causes if set(cause.set) <= set(LIBRARY)}
    if kind == "ambiguous":
        return {ids: found[ids] for ids in sets}
    likely = {ids: share for ids, share in found.items() if share > _CONSIDERED}
    if kind == "cause":
        return likely
    singles = [ids for ids in found if len(ids) == 1]
    even: dict[Ids, float] = {ids: 1.0 / len(singles) for ids in singles}
    if kind == "no_gap" or not likely:
        return even
    total = sum(likely.values())
    return {
        ids: 0.5 * even.get(ids, 0.0) + 0.5 * likely.get(ids, 0.0) / total for ids in even | likely
    }


def _planned(
    sets: Sequence[Ids], causes: Sequence[Cause], evidence: Evidence, floor_deg: float
) -> Plan | None:
    """Plan the profile that would decide; None where there is no command, or none that fits."""
    if evidence.grid.command_kpa is None:
        return None
    by_set = {cause.set: cause for cause in causes}
    standing = [by_set[ids] for ids in sets]
    try:
        return plan_few(
            sets,
            [cause.parameters for cause in standing],
            [cause.transfer_function for cause in standing],
            evidence,
            floor_deg,
        )
    except BadInput:  # a vacuum, say, which the catalogue has no profiles for
        return None


def _profile_option(made: Plan | None, pairs: Mapping[Pair, float]) -> Iterator[Option]:
    """Offer the planned profile, as sure as it separates each pair."""
    if made is None or not made.separable:
        return
    parts = {}
    for place in made.separable:
        i, j = made.pairs[place]
        pair = made.rivals[i].ids, made.rivals[j].ids
        if pair in pairs:
            parts[pair] = _SIMULATED * min(1.0, made.after[0][place].seen / _CLEAR)
    score, now = made.smallest(made.after[0]), made.smallest(made.now)
    yield Option(
        f"run {to_run(made)}",
        f"the explanations differ there by {score:.1f} noise floors, in this campaign by {now:.1f}",
        parts,
    )


def _open_ended(
    pairs: Mapping[Pair, float], lacks: Sequence[str], evidence: Evidence
) -> list[Option]:
    """Offer one rich profile in place of every protocol that the campaign lacks."""
    protocols = [r for r in known_remedies() if r.protocol and r.lacks in lacks]
    try:
        if evidence.grid.command_kpa is None or not protocols:
            return remedy_options(pairs, lacks, protocols=True)
        rich = richest_profile(limits_of(evidence.grid))
    except BadInput:
        return remedy_options(pairs, lacks, protocols=True)
    names = [MISSING[remedy.lacks].split(":")[0] for remedy in protocols]
    option = Option(
        f"run {rich.words}, {_RUNS} runs",
        f"this campaign has no {' and no '.join(name.removeprefix('a ') for name in names)}",
        {pair: _SHOWN for pair in pairs if any(r.parts(pair[0], pair[1]) for r in protocols)},
    )
    return [*remedy_options(pairs, lacks, protocols=False), option]
