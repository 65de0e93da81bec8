"""A diagnosis in two lines: for the terminal and for the summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spa_fo.report.diagnosis_figures import percent
from spa_fo.report.effect_words import joined, phrase


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


def _answer(document: Mapping[str, Any]) -> str:
    verdict = document["verdict"]
    sets = [f"{phrase(ids)} ({_probability(document, ids)})" for ids in verdict["sets"]]
    if verdict["kind"] == "no_gap":
        return "No gap: the model stands as it is."
    if verdict["kind"] == "cause":
        return f"Cause: {sets[0]}."
    if verdict["kind"] == "ambiguous":
        return f"Ambiguous, these data cannot tell apart: {joined(sets, 'and')}."
    lacking = f"Unknown: nothing in the library explains it ({_probability(document, ['unknown'])})"
    return f"{lacking}; a part is like {phrase(verdict['sets'][0])}." if sets else f"{lacking}."


def _sizes(document: Mapping[str, Any]) -> str:
    gap, shrink = document["gap"], document["shrink"]
    missed = (
        f"The model misses the campaign by {gap['rmse_deg']:.2f}°, repeated trials each other by "
        f"{gap['noise_floor_deg']:.2f}°"
    )
    if shrink is None:
        return f"{missed}."
    low, high = shrink["ci95"]
    # Without a word on it, as in files of earlier versions, trials were held out.
    where = "held out" if document["evidence"].get("held_out", True) else "on the fitted trials"
    return (
        f"{missed}; {where}: {shrink['before_rmse_deg']:.2f}° -> {shrink['after_rmse_deg']:.2f}°, "
        f"{percent(shrink['fraction_closed'])} of the gap closed ({percent(low)} to "
        f"{percent(high)})."
    )


def _probability(document: Mapping[str, Any], ids: Sequence[str]) -> str:
    return percent(sum(c["probability"] for c in document["causes"] if set(c["set"]) == set(ids)))
