"""A diagnosis in two lines: for the terminal, and for a person at the bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spa_fo.plant.law import PLACES
from spa_fo.report.causes import likelihood, percent
from spa_fo.report.effect_words import joined, phrase, words_of

SMALL_ERRORS = "errors of the given model and of the sensor's curve"

_MOST_SETS = 3  # that a sentence names


def headline(document: Mapping[str, Any]) -> tuple[str, str]:
    """Say what a diagnosis answers, and what it rests on.

    Parameters
    ----------
    document : Mapping
        As in diagnosis.json.

    Returns
    -------
    answer, sizes : str
        One line each.
    """
    return _answer(document), _sizes(document)


def opening(document: Mapping[str, Any]) -> tuple[str, str]:
    """Say in two sentences what is wrong and how sure that is; what it brings and what to do.

    Parameters
    ----------
    document : Mapping
        As in diagnosis.json.

    Returns
    -------
    wrong, following : str
        A sentence each, for someone who knows the bench but not the method.
    """
    return f"{_missed(document)}{_blamed(document)}.", _following(document)


def first_step(document: Mapping[str, Any]) -> str:
    """Return what to do next, without the reason for it; empty where there is nothing to do."""
    steps = document.get("next_steps") or ()
    return steps[0]["do"] if steps else ""


def _answer(document: Mapping[str, Any]) -> str:
    verdict = document["verdict"]
    sets = [f"{phrase(ids)} ({percent(probability(document, ids))})" for ids in verdict["sets"]]
    if verdict["kind"] == "no_gap":
        return "No gap above the noise floor."
    if verdict["kind"] == "cause":
        return f"Cause: {sets[0]}."
    if verdict["kind"] == "ambiguous":
        return f"Ambiguous, these data cannot tell apart: {joined(sets, 'and')}."
    chance = percent(probability(document, ["unknown"]))
    lacking = f"Unknown: nothing in the library explains it ({chance})"
    return f"{lacking}; a part resembles {phrase(verdict['sets'][0])}." if sets else f"{lacking}."


def _sizes(document: Mapping[str, Any]) -> str:
    gap, shrink = document["gap"], document["shrink"]
    missed = (
        f"The model's RMS error is {gap['rmse_deg']:.2f}°, repeated trials "
        f"{_differ(document)} {gap['noise_floor_deg']:.2f}°"
    )
    if shrink is None:
        return f"{missed}."
    low, high = shrink["ci95"]
    where = "held out" if _held_out(document) else "on the fitted trials"
    return (
        f"{missed}; {where}: {shrink['before_rmse_deg']:.2f}° -> {shrink['after_rmse_deg']:.2f}°, "
        f"{percent(shrink['fraction_closed'])} of the gap closed ({percent(low)} to "
        f"{percent(high)})."
    )


def _held_out(document: Mapping[str, Any]) -> bool:
    # Without a word on it, as in files of earlier versions, trials were held out.
    return bool(document["evidence"].get("held_out", True))


def probability(document: Mapping[str, Any], ids: Sequence[str]) -> float:
    """Return the probability of a set of effects, of ``none`` or of ``unknown``."""
    return float(sum(c["probability"] for c in document["causes"] if set(c["set"]) == set(ids)))


def _how_sure(document: Mapping[str, Any], ids: Sequence[str]) -> str:
    share = probability(document, ids)
    return f"{likelihood(share)}, {percent(share)}"


# --- two sentences for the bench ----------------------------------------------------------------


def _together(ids: Sequence[str]) -> str:
    names = joined([phrase((each,)) for each in ids], "and")
    return f"{names} together" if len(ids) > 1 else names


def _beside(first: Sequence[str], ids: Sequence[str]) -> str:
    """Name a set of effects after another one: only what it has besides, where it holds that."""
    more = [each for each in ids if each not in first]
    if len(first) > 1 and len(more) + len(first) == len(ids):
        return f"the same with {joined([phrase((each,)) for each in more], 'and')}"
    return _together(ids)


def _missed(document: Mapping[str, Any]) -> str:
    gap = document["gap"]
    error, floor = gap["rmse_deg"], gap["noise_floor_deg"]
    scatter = f"repeated trials {_differ(document)}"
    text = f"The RMS error of the model is {error:.2f}°"
    if document["verdict"]["kind"] == "no_gap":
        if error <= floor:
            return f"{text}, which is no more than {scatter} ({floor:.2f}°)"
        return (
            f"{text}, {error / floor:.1f} times what {scatter} ({floor:.2f}°), but no more than "
            f"that and {SMALL_ERRORS} may make it"
        )
    if error <= floor:
        return f"{text}, the same in every trial, though {scatter} {floor:.2f}°"
    return f"{text}, {error / floor:.1f} times what {scatter} ({floor:.2f}°)"


def _differ(document: Mapping[str, Any]) -> str:
    """Say whether the noise floor is of repeats, or what is expected of an ordinary bench."""
    return "differ by" if document["gap"].get("repeats", True) else "would be expected to differ by"


def _blamed(document: Mapping[str, Any]) -> str:
    kind, sets = document["verdict"]["kind"], document["verdict"]["sets"]
    if kind == "no_gap":
        return f": there is nothing to explain ({_how_sure(document, ['none'])})"
    if kind == "cause":
        does = "; ".join(words_of(each).means for each in sets[0][:_MOST_SETS])
        return f", because of {_together(sets[0])} ({_how_sure(document, sets[0])}): {does}"
    if kind == "ambiguous":
        first = f"{_together(sets[0])} ({_how_sure(document, sets[0])})"
        others = [
            f"{_beside(sets[0], ids)} ({percent(probability(document, ids))})"
            for ids in sets[1:_MOST_SETS]
        ]
        found = [first, *others]
        more = len(sets) - len(found)
        found += [f"one of {more} more"] if more else []
        return f", and these data leave open whether that is {joined(found, 'or')}"
    sure = _how_sure(document, ["unknown"])
    if sets:
        return f", and its cause is not known ({sure}): a part resembles {_together(sets[0])}"
    return f", and no effect of the library explains it ({sure})"


def _following(document: Mapping[str, Any]) -> str:
    kind, sets = document["verdict"]["kind"], document["verdict"]["sets"]
    closed, step = _closed(document), first_step(document)
    if kind == "no_gap":
        return f"Use the model as it is{f'; to look closer, {step}' if step else ''}."
    if kind == "cause":
        return f"{closed}; what to do: {words_of(sets[0][0]).remedy}."
    return f"{closed}{f'; next, {step}' if step else ''}."


def _closed(document: Mapping[str, Any]) -> str:
    shrink, kind = document["shrink"], document["verdict"]["kind"]
    trials = "held-out trials" if _held_out(document) else "the fitted trials"
    carried = [law for law in document.get("laws", ()) if law["in_model"]]
    if carried:
        return (
            "No effect of the library is the cause, but with a free-form law of "
            f"{PLACES[carried[0]['place']].words} in the model "
            f"{percent(carried[0]['fraction_closed'])} of the gap closes on {trials}"
        )
    if shrink is None:
        return "Nothing is explained so far, so the model stays as it is"
    what = {"cause": "that", "ambiguous": "the first of them", "unknown": "what it resembles"}[kind]
    return (
        f"With {what} in the model the error on {trials} goes from "
        f"{shrink['before_rmse_deg']:.2f}° to {shrink['after_rmse_deg']:.2f}°, which closes "
        f"{percent(shrink['fraction_closed'])} of the gap"
    )
