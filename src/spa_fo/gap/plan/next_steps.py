"""What to do next: a few steps that fit the answer, most telling first.

A step parts pairs of explanations. What it brings is the product of the probabilities of each pair,
summed over the pairs that it parts and that no better step has parted already: the decrease of the
Gini impurity of the answer. So nothing is asked for twice, and nothing that decides little.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations

from spa_fo.errors import BadInput
from spa_fo.gap.answer.findings import MISSING, lacking
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.diagnosis import Cause, Step
from spa_fo.gap.plan.advice import plan, richest_profile, to_run
from spa_fo.gap.plan.profiles import FEW, limits_of
from spa_fo.gap.plan.remedies import CAMERA, Remedy, known_remedies
from spa_fo.gap.plan.rivals import rival
from spa_fo.plant.effects.library import LIBRARY, Ids

Pair = tuple[Ids, Ids]

MOST = 3
"""Steps that are named."""
_LEAST = 0.08  # of all that is open: what brings less is not worth a day at the bench
_SEEN = 0.8  # how surely an observation parts a pair
_SIMULATED = 0.75  # a profile on which they differ clearly
_CLEAR = 2.0  # noise floors: a smaller difference is as much less sure
_SHOWN = 0.5  # of a richer protocol, whose outcome nobody has foreseen
_CONSIDERED = 0.01  # probability from which a rival of a cause counts
_MOST_RIVALS = 4  # that a profile is planned for
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
    """Say what to do next at the bench: at most `MOST` steps, most telling first.

    After a cause only what would tell it from a rival that is still probable, after no gap only
    what a smaller one would show in: there may be none.

    Parameters
    ----------
    kind, sets : str, sequence of tuples of str
        The verdict's.
    causes : sequence of Cause
        All explanations that were considered.
    evidence : Evidence
        The campaign.
    floor_deg : float
        Noise floor.
    """
    weights = _weights(kind, sets, causes)
    pairs = {(a, b): weights[a] * weights[b] for a, b in combinations(weights, 2)}
    lacks = lacking(evidence)
    useful = [r for r in known_remedies() if not r.lacks or r.lacks in lacks]
    protocols = [r for r in useful if r.protocol]
    by_command = [_option(r, pairs, _SHOWN) for r in protocols]
    if evidence.grid.command_kpa is not None:
        # Where the limits allow none, as in a vacuum, the protocols stay as they are.
        with suppress(BadInput):
            if kind == "ambiguous":
                by_command = _decisive(sets, causes, evidence, floor_deg)
            elif protocols:
                by_command = [_richest(protocols, pairs, evidence)]
    offered = [*(_option(r, pairs, _SEEN) for r in useful if not r.protocol), *by_command]
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

    `pairs` holds what is open: the product of the two probabilities, by pair of explanations. Of
    equal options the first is taken. `named` says whether each step names what it tells apart.
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


def _option(remedy: Remedy, pairs: Mapping[Pair, float], sure: float) -> Option:
    parts = {pair: sure for pair in pairs if remedy.parts(*pair)}
    return Option(remedy.check.do, remedy.check.why, parts)


def _decisive(
    sets: Sequence[Ids], causes: Sequence[Cause], evidence: Evidence, floor_deg: float
) -> list[Option]:
    """Offer the profile that best separates the first sets, as sure as it separates each pair."""
    by_set = {cause.set: cause for cause in causes}
    rivals = [
        rival(ids, by_set[ids].parameters, by_set[ids].transfer_function)
        for ids in sets[:_MOST_RIVALS]
    ]
    made = plan(rivals, evidence, floor_deg, names=FEW)
    if not made.separable:
        return []
    scores = made.scores.loc[made.best.name].to_dict()
    parts = {
        made.pairs[pair]: _SIMULATED * min(1.0, scores[pair] / _CLEAR) for pair in made.separable
    }
    why = (
        f"the explanations differ there by {made.score:.1f} noise floors, in this campaign by "
        f"{made.now:.1f}"
    )
    return [Option(f"run {to_run(made)}", why, parts)]


def _richest(
    protocols: Sequence[Remedy], pairs: Mapping[Pair, float], evidence: Evidence
) -> Option:
    """Offer one rich profile in place of every protocol that the campaign lacks."""
    names = [MISSING[remedy.lacks].split(":")[0].removeprefix("a ") for remedy in protocols]
    return Option(
        f"run {richest_profile(limits_of(evidence.grid)).words}, {_RUNS} runs",
        f"this campaign has no {' and no '.join(names)}",
        {pair: _SHOWN for pair in pairs if any(r.parts(*pair) for r in protocols)},
    )
