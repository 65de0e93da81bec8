"""What to run next after any answer: the profile that decides, or one that confirms.

Among profiles within the campaign's own limits, the one decides whose smallest separation over all
pairs of explanations is largest (max-min, as in T-optimal design: Atkinson and Fedorov 1975,
doi:10.1093/biomet/62.1.57). Pairs that no profile separates do not count; for them there are other
remedies than pressure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil

import pandas as pd

from spa_fo.errors import BadInput
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.fit.coefficients import rise_s
from spa_fo.gap.plan.profiles import NAMES, Limits, Profile, family, limits_of
from spa_fo.gap.plan.remedies import remedies, twins
from spa_fo.gap.plan.rivals import Rival, Standing
from spa_fo.gap.plan.separation import PairwiseSeparation
from spa_fo.plant.effects.library import Ids, absent
from spa_fo.rig import CampaignData

SEPARABLE = 0.3
"""Noise floors: a smaller difference is what no form of an effect can be trusted for."""
_CLEAR = 2.0  # noise floors of the mean of all runs
_RUNS = (3, 12)
_MOST_NAMED = 3  # pairs in a sentence
_RICH, _NOW = "rich", "this campaign"


@dataclass(frozen=True)
class Plan:
    """Profiles, best first, and how well each separates pairs of explanations, in noise floors.

    `pairs` gives two sets of effects by their pair's name. `scores` holds a column for each pair,
    a row for the campaign itself and for each profile. `separable` names the pairs that some
    profile separates; `score` and `now` are the smallest separation of these (of all, where there
    are none) by the best profile and by the campaign.
    """

    rivals: tuple[Rival, ...]
    tapped: bool
    pairs: dict[str, tuple[Ids, Ids]]
    profiles: tuple[Profile, ...]
    scores: pd.DataFrame
    separable: list[str]
    score: float
    now: float

    @property
    def best(self) -> Profile:
        """The recommended profile."""
        return self.profiles[0]


@dataclass(frozen=True)
class Advice:
    """What to do after a diagnosis: in words, a profile to run, and in a line what it is for.

    `plan` holds the scores where explanations were compared.
    """

    text: str
    profile: Profile
    purpose: str
    plan: Plan | None = None

    def __str__(self) -> str:
        """Return the advice, and the table behind it, as a command prints it."""
        if self.plan is None:
            return self.text
        return f"{self.text}\n\nSeparation in noise floors:\n{table(self.plan)}"


def plan_campaign(
    data: CampaignData,
    standing: Standing,
    max_duration_s: float | None = None,
    max_pressure_kpa: float | None = None,
) -> Advice:
    """Plan what follows the diagnosis of a campaign, with the whole catalogue of profiles.

    `max_duration_s` and `max_pressure_kpa` are limits in place of the campaign's own.

    Raises
    ------
    BadInput
        No profile fits into the limits.
    """
    if standing.reference_kpa is not None:  # the model's, whatever the campaign's own is
        campaign = replace(data.campaign, reference_kpa=standing.reference_kpa)
        data = replace(data, campaign=campaign)
    evidence = collect(data)
    if standing.rivals:
        evidence = replace(evidence, rise_s=rise_s(standing.rivals[0].x, evidence.horizon_s))
    limits = limits_of(evidence.grid)
    if max_duration_s is not None:
        limits = replace(limits, duration_s=max_duration_s)
    if max_pressure_kpa is not None:
        limits = replace(limits, pressure_kpa=max_pressure_kpa)
    return advise(standing, evidence, limits)


def advise(standing: Standing, evidence: Evidence, limits: Limits) -> Advice:
    """Plan what follows a verdict; see `plan_campaign`."""
    if standing.kind == "ambiguous":
        made = plan(standing.rivals, evidence, standing.floor_deg, limits)
        return Advice(recommendation(made), made.best, f"to tell {_apart(made)}", made)
    if standing.kind == "cause":
        return _confirmation(standing, evidence, limits)
    richest = richest_profile(limits)
    if standing.kind == "no_gap":
        text = (
            "Nothing is left to separate: the plain model misses the campaign by no more than "
            f"its trials differ. To test it further: {richest.words}."
        )
        return Advice(text, richest, "to test the plain model on a new protocol")
    part = f" beyond {_listed([r.label for r in standing.rivals])}" if standing.rivals else ""
    text = (
        f"The gap is not explained{part}: run the richest profile, {richest.words}, "
        f"{_RUNS[0]} runs."
    )
    return Advice(text, richest, "to show more of a gap that nothing known explains")


def _confirmation(standing: Standing, evidence: Evidence, limits: Limits) -> Advice:
    """Find the profile on which the cause shows most against the plain model identified again."""
    cause = standing.rivals[0]
    plain = standing.plain or Rival((), cause.x, absent())
    made = plan((cause, plain), evidence, standing.floor_deg, limits)
    if made.separable:
        profile = made.best
        way = (
            f"{profile.words}, where the plain model identified again would miss by "
            f"{made.score:.1f} noise floors (this campaign: {made.now:.1f})"
        )
    else:
        profile = richest_profile(limits)
        way = _listed(remedies(cause.ids, (), made.tapped))
    text = f"Nothing is left to separate: {cause.label} is the cause. To confirm it: {way}."
    return Advice(text, profile, f"to confirm {cause.label}")


def plan(
    rivals: Sequence[Rival],
    evidence: Evidence,
    floor_deg: float,
    limits: Limits | None = None,
    names: tuple[str, ...] = NAMES,
) -> Plan:
    """Score profiles for two or more explanations, within the campaign's limits by default.

    Raises
    ------
    BadInput
        No profile fits into the limits.
    """
    profiles = {p.name: p for p in _offered(limits or limits_of(evidence.grid), names)}
    pairwise = PairwiseSeparation(evidence, floor_deg, rivals)
    pairs = {f"{a.label} from {b.label}": (a.ids, b.ids) for a, b in combinations(rivals, 2)}
    scores = pd.DataFrame(map(pairwise.after, profiles.values()), list(profiles), list(pairs))
    tapped = evidence.has_pressure
    largest = scores.max()
    separable = [
        pair for pair in pairs if largest[pair] >= SEPARABLE and not twins(*pairs[pair], tapped)
    ]
    now = pd.DataFrame([pairwise.now()], [_NOW], list(pairs))
    smallest = scores[separable or list(pairs)].min(axis=1)
    best_first = smallest.sort_values(ascending=False, kind="stable").index
    return Plan(
        rivals=tuple(rivals),
        tapped=tapped,
        pairs=pairs,
        profiles=tuple(profiles[name] for name in best_first),
        scores=pd.concat([now, scores.loc[best_first]]),
        separable=separable,
        score=float(smallest.max()),
        now=float(now[separable or list(pairs)].to_numpy().min()),
    )


def richest_profile(limits: Limits) -> Profile:
    """Return the profile that has most to show within the limits; `BadInput` where none fits."""
    return _offered(limits, (_RICH, *reversed(NAMES)))[0]


def _offered(limits: Limits, names: tuple[str, ...]) -> tuple[Profile, ...]:
    if not limits.pressure_kpa > 0.0:
        raise BadInput("--max-pressure", "expected a campaign that commands some pressure, or one")
    profiles = family(limits, names)
    if not profiles:
        raise BadInput("--max-duration", f"no profile fits into {limits.duration_s:g} s")
    return profiles


def recommendation(made: Plan) -> str:
    """Say in a few sentences what to do next."""
    sentences = []
    if made.separable:
        words = to_run(made)
        sentences.append(
            f"{words[:1].upper()}{words[1:]}: it would separate {_apart(made)} by "
            f"{made.score:.1f} noise floors (this campaign: {made.now:.1f})."
        )
    for pair, (one, other) in made.pairs.items():
        if pair not in made.separable:
            ways = "; or ".join(remedies(one, other, made.tapped))
            sentences.append(f"No pressure profile separates {pair}: {ways}.")
    return " ".join(sentences)


def to_run(made: Plan) -> str:
    """Say what the best profile is, and how often to run it."""
    return made.best.words + ("" if made.best.repeats > 1 else f", {runs(made.score)} runs")


def runs(separation: float) -> int:
    """How often a profile is to be run for its mean to be clear of the noise floor."""
    least, most = _RUNS
    return min(max(least, ceil((_CLEAR / max(separation, 1e-3)) ** 2)), most)


def table(made: Plan) -> str:
    """Lay out every profile's separations, in noise floors, best profile first."""
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"[: len(made.rivals)]
    scores = made.scores.set_axis([f"{a}-{b}" for a, b in combinations(letters, 2)], axis=1)
    scores.insert(0, "s", ["", *(f"{profile.duration_s:.0f}" for profile in made.profiles)])
    key = [f"  {letter}  {one.label}" for letter, one in zip(letters, made.rivals, strict=True)]
    return "\n".join([*key, "", scores.to_string(float_format="{:.2f}".format)])


def _apart(made: Plan) -> str:
    """Name the pairs that the profile is for; every pair where none can be separated."""
    chosen = made.separable or list(made.pairs)
    if len(chosen) <= _MOST_NAMED:
        return _listed(chosen)
    everything = f"all of {_listed([one.label for one in made.rivals])}"
    left = [pair for pair in made.pairs if pair not in chosen]
    return f"{everything} except {_listed(left)}" if left else everything


def _listed(parts: Sequence[str]) -> str:
    """List words with an *and* before the last."""
    return ", ".join(parts[:-1]) + " and " + parts[-1] if len(parts) > 1 else parts[0]
