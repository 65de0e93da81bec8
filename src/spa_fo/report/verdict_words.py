"""The verdict of a diagnosis in two sentences, with every number that it rests on."""

from __future__ import annotations

from spa_fo.gap.diagnosis import Diagnosis
from spa_fo.report.causes import percent, probability_of
from spa_fo.report.effect_words import STAGE_WORDS, joined, phrase, words_of
from spa_fo.report.headline import SMALL_ERRORS


def verdict(diagnosis: Diagnosis) -> str:
    """Say in two sentences how large the gap is and where, and what causes it.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind.
    """
    gap = diagnosis.gap
    differ = "differ" if gap.repeats else "would be expected to differ"
    if diagnosis.kind == "no_gap":
        more = gap.rmse_deg > gap.noise_floor_deg
        beside = f" with {SMALL_ERRORS}" if more else ""
        return (
            f"The RMS error of the model on {diagnosis.campaign} is {gap.rmse_deg:.2f}°, which the "
            f"noise floor{beside} accounts for: repeated trials {differ} by "
            f"{gap.noise_floor_deg:.2f}° ({_chance(diagnosis)}). There is **no gap** to explain."
        )
    against = "where" if gap.rmse_deg > gap.noise_floor_deg else "the same in every trial, though"
    size = (
        f"The RMS error of the model on {diagnosis.campaign} is {gap.rmse_deg:.2f}°, {against} "
        f"repeated trials {differ} by {gap.noise_floor_deg:.2f}° "
        f"({_chance(diagnosis)}){_mostly(diagnosis)}."
    )
    cause = {"cause": _one_cause, "ambiguous": _several_causes, "unknown": _no_cause}
    return f"{size} {cause[diagnosis.kind](diagnosis)}"


def _chance(diagnosis: Diagnosis) -> str:
    return f"no gap: {percent(probability_of(diagnosis.causes, 'none'))} probable"


def _mostly(diagnosis: Diagnosis) -> str:
    shares = diagnosis.where.stage
    if shares is None:
        why = diagnosis.where.not_known
        return f", and where it arises is not known{f' ({why})' if why else ''}"
    if not any(shares.values()):
        return ""
    stage = max(shares, key=lambda name: shares[name])
    assumed = f" ({diagnosis.where.assumed})" if diagnosis.where.assumed else ""
    return f", and {percent(shares[stage])} of that gap arises in {STAGE_WORDS[stage]}{assumed}"


def _one_cause(diagnosis: Diagnosis) -> str:
    ids = diagnosis.sets[0]
    means = "; ".join(words_of(each).means for each in ids)
    return (
        f"The cause is **{phrase(ids)}** ({means}), with a probability of "
        f"{percent(_probability(diagnosis, ids))}{_reached(diagnosis)}."
    )


def _several_causes(diagnosis: Diagnosis) -> str:
    sets = [
        f"**{phrase(ids)}** ({percent(_probability(diagnosis, ids))})" for ids in diagnosis.sets
    ]
    return (
        f"These data cannot tell apart {joined(sets, 'and')}"
        f"{_reached(diagnosis, 'the first of them')}."
    )


def _no_cause(diagnosis: Diagnosis) -> str:
    lacking = percent(probability_of(diagnosis.causes, "unknown"))
    text = f"The cause is **unknown**: nothing in the library explains it ({lacking} probable)"
    if not diagnosis.sets:
        return f"{text}, and no part of it is explained."
    part = joined([phrase(ids) for ids in diagnosis.sets], "or")
    return f"{text}; **{part}** explains a part{_reached(diagnosis)}."


def _probability(diagnosis: Diagnosis, ids: tuple[str, ...]) -> float:
    return sum(cause.probability for cause in diagnosis.causes if set(cause.set) == set(ids))


def judged(diagnosis: Diagnosis) -> str:
    """Name the trials that the shrink is of: a lone trial cannot be held out."""
    return "held-out trials" if diagnosis.traces.held_out.any() else "the fitted trials"


def _reached(diagnosis: Diagnosis, subject: str = "it") -> str:
    shrink = diagnosis.shrink
    if shrink is None:
        return ""
    low, high = shrink.ci95
    return (
        f"; with {subject} in the model the error on {judged(diagnosis)} goes from "
        f"{shrink.before_rmse_deg:.2f}° to {shrink.after_rmse_deg:.2f}°, which closes "
        f"{percent(shrink.fraction_closed)} of the gap (95 % interval {percent(low)} to "
        f"{percent(high)})"
    )
