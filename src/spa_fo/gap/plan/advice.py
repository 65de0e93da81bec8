"""What to run next after any answer: the profile that decides, or one that confirms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.plan.profile_choice import (
    Plan,
    apart,
    in_a_row,
    offered,
    plan,
    recommendation,
    table,
)
from spa_fo.gap.plan.profiles import FEW, NAMES, Limits, Profile, family, limits_of
from spa_fo.gap.plan.refit import Bench, bench_of
from spa_fo.gap.plan.remedies import remedies
from spa_fo.gap.plan.rivals import Ids, Rival, Standing, rival
from spa_fo.plant.effects.library import absent
from spa_fo.rig import CampaignData

_RUNS = (3, 12)
_RICH = "rich"
_MOST_RIVALS = 4  # that a diagnosis plans for


def report(advice: Advice) -> str:
    """Return the advice, and the table behind it, as a command prints it."""
    if advice.plan is None:
        return advice.text
    return f"{advice.text}\n\nSeparation in noise floors:\n{table(advice.plan)}"


@dataclass(frozen=True)
class Advice:
    """What to do after a diagnosis.

    Attributes
    ----------
    text : str
        In words; a line or a few.
    profile : Profile
        What to run.
    purpose : str
        What it is for, one line.
    plan : Plan or None
        Scores, where explanations were compared.
    """

    text: str
    profile: Profile
    purpose: str
    plan: Plan | None = None


def advise(
    standing: Standing, bench: Bench, limits: Limits, names: tuple[str, ...] = NAMES
) -> Advice:
    """Plan what follows a verdict.

    Parameters
    ----------
    standing : Standing
        The verdict.
    bench : Bench
        The campaign.
    limits : Limits
        Of the profiles.
    names : tuple of str
        Profiles to try.

    Raises
    ------
    BadInput
        No profile fits into the limits.
    """
    if standing.kind == "ambiguous":
        made = plan(standing.rivals, bench, limits, names)
        return Advice(recommendation(made), made.best, f"to tell {apart(made)}", made)
    if standing.kind == "cause":
        return _confirmation(standing, bench, limits, names)
    richest = richest_profile(limits)
    if standing.kind == "no_gap":
        text = (
            "Nothing is left to separate: the plain model misses the campaign by no more than "
            f"its trials differ. To test it further: {richest.words}."
        )
        return Advice(text, richest, "to test the plain model on a new protocol")
    part = in_a_row([one.label for one in standing.rivals]) if standing.rivals else ""
    text = (
        f"The gap is not explained{f' beyond {part}' if part else ''}: run the richest profile, "
        f"{richest.words}, {_RUNS[0]} runs."
    )
    return Advice(text, richest, "to show more of a gap that nothing known explains")


def _confirmation(
    standing: Standing, bench: Bench, limits: Limits, names: tuple[str, ...]
) -> Advice:
    """Find the profile on which the cause shows most against the plain model identified again."""
    cause = standing.rivals[0]
    plain = standing.plain or Rival((), cause.x, absent())
    made = plan((cause, plain), bench, limits, names)
    done = f"Nothing is left to separate: {cause.label} is the cause."
    if not made.separable:
        way = in_a_row(remedies(cause.ids, (), bench.tapped))
        return Advice(
            f"{done} To confirm it: {way}.", richest_profile(limits), f"to confirm {cause.label}"
        )
    score = made.smallest(made.after[0])
    text = (
        f"{done} To confirm it: {made.best.words}, where the plain model identified again would "
        f"miss by {score:.1f} noise floors (this campaign: {made.smallest(made.now):.1f})."
    )
    return Advice(text, made.best, f"to confirm {cause.label}")


def richest_profile(limits: Limits) -> Profile:
    """Return the profile that has most to show within the limits.

    Raises
    ------
    BadInput
        No profile fits into the limits.
    """
    for names in ((_RICH,), NAMES[::-1]):
        profiles = family(limits, names)
        if profiles:
            return profiles[0]
    return offered(limits, NAMES)[0]


def plan_few(
    sets: Sequence[Ids],
    parameters: Sequence[Mapping[str, Mapping[str, Any]]],
    coefficients: Sequence[Mapping[str, float]],
    evidence: Evidence,
    floor_deg: float,
) -> Plan:
    """Plan for the leading explanations of a diagnosis, from few profiles: in a second or two.

    Parameters
    ----------
    sets : sequence of tuples of str
        Explanations that stand, most probable first; the first four are planned for.
    parameters : sequence of mappings
        Effect -> parameter -> value, or ``{"value": ...}``, for each set.
    coefficients : sequence of mappings
        The coefficients by name, for each set.
    evidence : Evidence
        The campaign.
    floor_deg : float
        Noise floor.

    Raises
    ------
    BadInput
        No profile fits into the campaign's limits.
    """
    rivals = [rival(*given) for given in zip(sets, parameters, coefficients, strict=True)]
    bench = bench_of(evidence, floor_deg)
    return plan(rivals[:_MOST_RIVALS], bench, limits_of(evidence.grid), FEW)


def plan_campaign(
    data: CampaignData,
    standing: Standing,
    max_duration_s: float | None = None,
    max_pressure_kpa: float | None = None,
) -> Advice:
    """Plan what follows the diagnosis of a campaign, with the whole family of profiles.

    Parameters
    ----------
    data : CampaignData
        The campaign.
    standing : Standing
        What its diagnosis left open.
    max_duration_s, max_pressure_kpa : float, optional
        Limits in place of the campaign's own.

    Raises
    ------
    BadInput
        No profile fits into the limits.
    """
    evidence = collect(data)
    limits = limits_of(evidence.grid)
    if max_duration_s is not None:
        limits = replace(limits, duration_s=max_duration_s)
    if max_pressure_kpa is not None:
        limits = replace(limits, pressure_kpa=max_pressure_kpa)
    return advise(standing, bench_of(evidence, standing.floor_deg), limits)
