"""The next experiment: the profile that best tells the explanations apart that still stand.

Among a family of profiles within the campaign's own limits, the one whose smallest separation
over all pairs of explanations is largest (max-min, as in T-optimal design: Atkinson and Fedorov
1975, doi:10.1093/biomet/62.1.57). Pairs that no profile separates do not count; for them there are
other remedies than pressure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import ceil

from spa_fo.errors import BadInput
from spa_fo.gap.plan.profiles import NAMES, Limits, Profile, family, limits_of
from spa_fo.gap.plan.refit import Bench
from spa_fo.gap.plan.remedies import remedies, twins
from spa_fo.gap.plan.rivals import Rival
from spa_fo.gap.plan.separation import PairwiseSeparation, Separation

SEPARABLE = 0.3
"""Noise floors: a smaller difference is what no form of an effect can be trusted for."""
_CLEAR = 2.0  # noise floors of the mean of all runs
_RUNS = (3, 12)
_MOST_NAMED = 3  # pairs in a sentence


@dataclass(frozen=True)
class Plan:
    """Profiles and how well each would separate the explanations.

    Attributes
    ----------
    rivals : tuple of Rival
        The explanations.
    pairs : tuple of (int, int)
        Which of them are compared.
    bench : Bench
        The campaign.
    now : tuple of Separation
        By the campaign's own protocol, for each pair.
    profiles : tuple of Profile
        Best first.
    after : tuple of tuples of Separation
        By each profile, for each pair.
    """

    rivals: tuple[Rival, ...]
    pairs: tuple[tuple[int, int], ...]
    bench: Bench
    now: tuple[Separation, ...]
    profiles: tuple[Profile, ...]
    after: tuple[tuple[Separation, ...], ...]

    @property
    def best(self) -> Profile:
        """The recommended profile."""
        return self.profiles[0]

    @property
    def separable(self) -> tuple[int, ...]:
        """Places in `pairs` of those that some profile separates."""
        return _separable(self.rivals, self.pairs, self.bench.tapped, self.after)

    @property
    def inseparable(self) -> tuple[int, ...]:
        """Places in `pairs` of the others."""
        return tuple(k for k in range(len(self.pairs)) if k not in self.separable)

    def smallest(self, row: Sequence[Separation]) -> float:
        """Smallest separation over the pairs that can be separated; over all where none can."""
        return _smallest(row, self.separable)


def plan(
    rivals: Sequence[Rival],
    bench: Bench,
    limits: Limits | None = None,
    names: tuple[str, ...] = NAMES,
) -> Plan:
    """Score the family of profiles for some explanations of a campaign.

    Parameters
    ----------
    rivals : sequence of Rival
        Two or more explanations.
    bench : Bench
        The campaign.
    limits : Limits, optional
        Of the profiles; the campaign's own by default.
    names : tuple of str
        Profiles to try.

    Raises
    ------
    BadInput
        No profile fits into the limits.
    """
    profiles = offered(limits or limits_of(bench.grid), names)
    pairs = tuple(combinations(range(len(rivals)), 2))
    pairwise = PairwiseSeparation(bench, rivals)
    after = [tuple(pairwise.after(profile, pairs)) for profile in profiles]
    counted = _separable(rivals, pairs, bench.tapped, after)
    ranked = sorted(range(len(profiles)), key=lambda i: -_smallest(after[i], counted))
    return Plan(
        rivals=tuple(rivals),
        pairs=pairs,
        bench=bench,
        now=tuple(pairwise.now(pairs)),
        profiles=tuple(profiles[i] for i in ranked),
        after=tuple(after[i] for i in ranked),
    )


def offered(limits: Limits, names: tuple[str, ...]) -> tuple[Profile, ...]:
    """List the profiles of some names that the limits allow.

    Raises
    ------
    BadInput
        There is none.
    """
    if not limits.pressure_kpa > 0.0:
        raise BadInput("--max-pressure", "expected a campaign that commands some pressure, or one")
    profiles = family(limits, names)
    if not profiles:
        raise BadInput("--max-duration", f"no profile fits into {limits.duration_s:g} s")
    return profiles


def _separable(
    rivals: Sequence[Rival],
    pairs: Sequence[tuple[int, int]],
    tapped: bool,
    after: Sequence[Sequence[Separation]],
) -> tuple[int, ...]:
    return tuple(
        k
        for k, (i, j) in enumerate(pairs)
        if not twins(rivals[i].ids, rivals[j].ids, tapped)
        and max(row[k].seen for row in after) >= SEPARABLE
    )


def _smallest(row: Sequence[Separation], counted: Sequence[int]) -> float:
    return min(row[k].seen for k in counted or range(len(row)))


def runs(separation: float) -> int:
    """How often a profile is to be run for its mean to be clear of the noise floor."""
    least, most = _RUNS
    return min(max(least, ceil((_CLEAR / max(separation, 1e-3)) ** 2)), most)


# --- in words ---------------------------------------------------------------------------------


def recommendation(made: Plan) -> str:
    """Say in a few sentences what to do next."""
    sentences = []
    if made.separable:
        score = made.smallest(made.after[0])
        sentences.append(
            f"{_capital(to_run(made))}: it would separate {apart(made)} by {score:.1f} noise "
            f"floors (this campaign: {made.smallest(made.now):.1f})."
        )
    sentences += [_remedy(made, k) for k in made.inseparable]
    return " ".join(sentences)


def to_run(made: Plan) -> str:
    """Say what the best profile is, and how often to run it."""
    if made.best.repeats > 1:
        return made.best.words
    return f"{made.best.words}, {runs(made.smallest(made.after[0]))} runs"


def _remedy(made: Plan, pair: int) -> str:
    i, j = made.pairs[pair]
    one, other = made.rivals[i], made.rivals[j]
    words = remedies(one.ids, other.ids, made.bench.tapped)
    tapped, profile = max(
        ((row[pair].tapped, p) for row, p in zip(made.after, made.profiles, strict=True)),
        key=lambda item: item[0],
    )
    gain = ""
    if not made.bench.tapped and tapped >= SEPARABLE:
        gain = f" With a pressure tap they differ by {tapped:.1f} noise floors ({profile.name})."
    return f"No pressure profile separates {_versus(made, pair)}: {'; or '.join(words)}.{gain}"


def apart(made: Plan) -> str:
    """Name the pairs that the profile is for; every pair where none can be separated."""
    chosen = made.separable or tuple(range(len(made.pairs)))
    if len(chosen) <= _MOST_NAMED:
        return in_a_row([_versus(made, k) for k in chosen])
    everything = f"all of {in_a_row([one.label for one in made.rivals])}"
    if len(chosen) == len(made.pairs):
        return everything
    return f"{everything} except {in_a_row([_versus(made, k) for k in made.inseparable])}"


def _versus(made: Plan, pair: int) -> str:
    i, j = made.pairs[pair]
    return f"{made.rivals[i].label} from {made.rivals[j].label}"


def table(made: Plan) -> str:
    """Lay out every profile's separations, in noise floors, best profile first."""
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    heads = [f"{letters[i]}-{letters[j]}" for i, j in made.pairs]
    lines = [f"  {letters[k]}  {one.label}" for k, one in enumerate(made.rivals)]
    lines += ["", "  ".join([f"{'profile':<24}", f"{'s':>5}", *(f"{h:>6}" for h in heads)])]
    rows = [("this campaign", "", made.now)]
    rows += [
        (profile.name, f"{profile.duration_s:.0f}", row)
        for profile, row in zip(made.profiles, made.after, strict=True)
    ]
    for name, seconds, row in rows:
        cells = [f"{name:<24}", f"{seconds:>5}", *(f"{s.seen:6.2f}" for s in row)]
        lines.append("  ".join(cells))
    return "\n".join(lines)


def in_a_row(parts: Sequence[str]) -> str:
    """List words with an *and* before the last."""
    return ", ".join(parts[:-1]) + " and " + parts[-1] if len(parts) > 1 else parts[0]


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
