"""The sections of the page about the blind benchmark; every number comes from scores.json."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

from blind.judge.check import goal
from blind.judge.effects import DETECTED
from blind.judge.questions import ShrinkPoint
from blind.judge.statistics import rate
from blind.judge.targets import (
    BOTH_RIGS,
    CALIBRATION,
    ENOUGH,
    FALSE_ALARMS,
    IN_SETS,
    WORST_CLASS,
    WRONG_NAMES,
    Target,
)
from blind.report.words import (
    KIND_NAMES,
    PROTOCOL_NAMES,
    ends,
    figure,
    interval,
    percent,
    rig_name,
    rows,
)

Scores = Mapping[str, Any]

_WORST_CLASSES = 12
_MOST_MESSAGES = 20
_ENOUGH_OF_A_SIZE = 20  # cases: one more or less that is found is five points
_WIDTHS = (0.25, 0.5)  # of a claim's interval
_ANSWER_NAMES = {
    "no_gap": "no gap",
    "cause": "one cause",
    "ambiguous": "several that these data cannot tell apart",
    "unknown": "unknown, but a part is explained",
}


def summary(scores: Scores) -> str:
    """Say in one sentence how often it is right, false alarms first, rig by rig."""
    judged = [mark["reached"] for mark in scores["marks"] if mark["reached"] is not None]
    return (
        "How often the diagnosis is right on synthetic campaigns whose cause it was not told. "
        f"Without any effect it gives a false alarm {_by_rig(scores, FALSE_ALARMS)}; an effect "
        "of its library of at least four times the noise floor, on a protocol with releases and "
        f"repeats, is among what it names {_by_rig(scores, IN_SETS)}; it is sure of a wrong name "
        f"{_by_rig(scores, WRONG_NAMES)}; of {len(judged)} goals {sum(judged)} are reached."
    )


def _by_rig(scores: Scores, target: Target) -> str:
    parts = []
    for rig in scores["rigs"]:
        estimate = _marks_of(scores, rig)[target.name]["estimate"]
        if estimate["n"]:
            found = f"{percent(estimate['value'])} of {estimate['n']} cases"
            parts.append(f"in {found} ({interval(estimate)}) of the {rig_name(rig)}")
    return " and ".join(parts) or "in no case, as there was none"


def _marks_of(scores: Scores, rig: str) -> dict[str, Mapping[str, Any]]:
    return {mark["name"]: mark for mark in scores["marks"] if mark["rig"] == rig}


def origin_of_data(scores: Scores) -> str:
    """Say that all is synthetic, and how much there is."""
    parts = [f"{own['cases']} of the {rig_name(rig)}" for rig, own in scores["rigs"].items()]
    return f"All data are synthetic: {scores['cases']} campaigns, {' and '.join(parts)}."


def marks(scores: Scores) -> str:
    """Set the marks of the rigs side by side; what is not reached is bold."""
    rigs = {rig: _marks_of(scores, rig) for rig in scores["rigs"]}
    titles = [part for rig in rigs for part in (rig_name(rig), "95 %", "cases")]
    first = next(iter(rigs.values()), {})
    cells = [
        [name, goal(mark)] + [part for own in rigs.values() for part in _mark_cells(own[name])]
        for name, mark in first.items()
    ]
    parts = [rows(("mark", "goal", *titles), "ll" + "rlr" * len(rigs), cells)]
    worst = [
        f"on the {rig_name(rig)} *{own[WORST_CLASS.name]['which']}*"
        for rig, own in rigs.items()
        if own[WORST_CLASS.name]["which"]
    ]
    if worst:
        parts.append(
            f"The class of surroundings with most false alarms, among those with at least "
            f"{ENOUGH} cases without an effect: {', '.join(worst)}."
        )
    return "\n\n".join([*parts, *_together(scores)])


def _mark_cells(mark: Mapping[str, Any]) -> list[str]:
    estimate = mark["estimate"]
    value = figure(estimate["value"])
    return [
        f"**{value}**" if mark["reached"] is False else value,
        ends(estimate),
        str(estimate["n"]),
    ]


def _together(scores: Scores) -> list[str]:
    said = []
    for mark in _marks_of(scores, BOTH_RIGS).values():
        if mark["reached"] is None:
            continue
        reached = "reached" if mark["reached"] else "**not reached**"
        said.append(
            f"Beyond what the intervals of the two explain, the rigs differ most in "
            f"*{mark['which']}*: {figure(mark['estimate']['value'])} of it is beyond, goal "
            f"{goal(mark)}, {reached}."
        )
    return said


def classes(scores: Scores, folder: str) -> str:
    """Tell the worst classes of surroundings."""
    enough = [
        entry
        for entry in scores["classes"]
        # Few cases bias it, whatever the diagnosis does.
        if entry["estimate"]["n"] >= ENOUGH and entry["name"] != CALIBRATION.name
    ]
    missed = sum(entry["reached"] is False for entry in enough)
    surely = sum(entry["missed_beyond_interval"] for entry in enough)
    cells = [
        [
            rig_name(entry["rig"]),
            f"{entry['dimension']}: {entry['class']}",
            entry["name"],
            goal(entry),
            figure(entry["estimate"]["value"]),
            ends(entry["estimate"]),
            str(entry["estimate"]["n"]),
        ]
        for entry in enough[:_WORST_CLASSES]
    ]
    titles = ("rig", "class", "mark", "goal", "value", "95 %", "cases")
    return (
        "Every mark but the calibration error, which few cases make larger, in every class of "
        f"surroundings on each rig: of the {len(enough)} with at least {ENOUGH} cases {missed} "
        f"miss the goal that is set for all cases together, {surely} of them with their whole "
        "interval, some by chance. The worst, by the better end of the interval:\n\n"
        f"{rows(titles, 'llllrlr', cells)}\n\n"
        f"All of them, the worst first: [{folder}/classes.csv]({folder}/classes.csv)."
    )


def effects(scores: Scores, folder: str) -> str:
    """Tell every effect that is not always right, the worst first."""
    wrong = [effect for effect in scores["effects"] if effect["worst_rate"] < 1.0]
    always = len(scores["effects"]) - len(wrong)
    cells = []
    for effect in wrong:
        rate = effect["rates"][effect["worst"]]
        cells.append(
            [
                effect["effect"],
                rig_name(effect["rig"]),
                percent(rate["value"]),
                interval(rate),
                str(rate["n"]),
                effect["worst"],
                effect["mistaken_for"] or "–",
            ]
        )
    titles = ("effect", "rig", "worst rate", "95 %", "of cases", "which", "mostly taken for")
    return (
        f"Ordered by the upper end of the interval.\n\n{rows(titles, 'llrlrll', cells)}\n\n"
        f"The other {always} are right throughout. Every rate of every effect: "
        f"[{folder}/per_effect.csv]({folder}/per_effect.csv); every kind, group of protocols and "
        f"size: [{folder}/table.md]({folder}/table.md)."
    )


def sizes(scores: Scores) -> str:
    """Say from which size on effects are found and named, where enough cases tell."""
    said, few = [], []
    for rig, own in scores["rigs"].items():
        for protocols, size in own["smallest_found"].items():
            on = f"on the {rig_name(rig)}, {PROTOCOL_NAMES[protocols]}"
            least = min(
                (
                    arm["n"]
                    for arm in own["arms"]
                    if arm["kind"] == "closed" and arm["protocols"] == protocols
                ),
                default=0,
            )
            if least < _ENOUGH_OF_A_SIZE:
                few.append(on)
                continue
            said.append(
                f"{on[0].upper()}{on[1:]}, {percent(DETECTED)} of the cases are found "
                f"{_from(size)}, and have the truth in the sets "
                f"{_from(own['smallest_named'][protocols])}."
            )
    if few:
        said.append(
            f"From which size on {percent(DETECTED)} of the cases are found is not known where a "
            f"size has fewer than {_ENOUGH_OF_A_SIZE} cases: {', '.join(few)}."
        )
    return " ".join(said)


def _from(size: float | None) -> str:
    return "at no size that was tried" if size is None else f"from {size:g} times the floor on"


def claims(scores: Scores) -> str:
    """Tell how claims of the shrink held, by rig and kind of answer."""
    cells = [
        [
            rig_name(rig),
            _ANSWER_NAMES[entry["verdict"]],
            str(entry["answers"]),
            str(entry["claims"]),
            str(entry["close"]["n"]),
            figure(entry["close"]["value"]),
            ends(entry["close"]),
            figure(entry["covered"]["value"]),
        ]
        for rig, own in scores["rigs"].items()
        for entry in own["claims"]
    ]
    titles = (
        "rig",
        "answer",
        "of this kind",
        "claim something",
        "judged",
        "within 10 points",
        "95 %",
        "interval holds",
    )
    return rows(titles, "llrrrrlr", cells)


def claims_by_width(scores: Scores) -> str:
    """Tell how claims held, by how sure they are of themselves."""
    cells = []
    for rig, own in scores["rigs"].items():
        points = [ShrinkPoint(**point) for point in own["shrink"]]
        for low, high in pairwise((0.0, *_WIDTHS, math.inf)):
            close = asdict(rate([p.close for p in points if low <= p.high - p.low < high]))
            words = "up" if math.isinf(high) else f"to {high:g}"
            share = close["value"] if close["n"] else None
            width = f"{low:g} {words}"
            cells.append([rig_name(rig), width, str(close["n"]), figure(share), ends(close)])
    titles = ("rig", "width of the claim's 95 % interval", "judged", "within 10 points", "95 %")
    return rows(titles, "llrrl", cells)


def shifts(scores: Scores) -> str:
    """Say how often the shift of a model that is off was named."""
    cells = [
        [
            rig_name(rig),
            *(str(own["shifts"][key]) for key in ("cases", "alone", "beside", "instead")),
        ]
        for rig, own in scores["rigs"].items()
    ]
    titles = (
        "rig",
        "cases with an error of the model",
        "no effect, shift alone: no false alarm",
        "shift beside a right name: no wrong name",
        "sure of the shift instead of the effect: a wrong name",
    )
    return rows(titles, "lrrrr", cells)


def errors(scores: Scores) -> str:
    """List what ended in an error, with the messages."""
    found = Counter(
        (rig_name(rig), KIND_NAMES[entry["kind"]], entry["step"], entry["message"])
        for rig, own in scores["rigs"].items()
        for entry in own["failures"]
    )
    if not found:
        return "No diagnosis ended in an error, and every model could be tried on later trials."
    cells = [
        [*facts, f"`{message}`".replace("|", "\\|"), str(n)]
        for (*facts, message), n in found.most_common(_MOST_MESSAGES)
    ]
    diagnoses = sum(n for (_, _, step, _), n in found.items() if step == "diagnosis")
    return (
        f"{diagnoses} diagnoses ended in an error, which counts as a false alarm where there is no "
        "effect and as not named where there is one; "
        f"{found.total() - diagnoses} models could not be tried on later trials.\n\n"
        + rows(("rig", "case", "where", "message", "cases"), "llllr", cells)
    )


def cases(scores: Scores) -> str:
    """Say how many cases there are of each kind."""
    kinds = list(dict.fromkeys(kind for own in scores["rigs"].values() for kind in own["kinds"]))
    cells = [
        [rig_name(rig), *(str(own["kinds"].get(kind, 0)) for kind in kinds), str(own["short"])]
        for rig, own in scores["rigs"].items()
    ]
    titles = ("rig", *(KIND_NAMES[kind] for kind in kinds), "smaller than asked")
    return (
        rows(titles, "l" + "r" * (len(kinds) + 1), cells)
        + "\n\n*Smaller than asked*: the effect could not be made as large without leaving what is "
        "physical; such a case counts by the size that it reached."
    )


def priors(listed: Sequence[tuple[str, str, str, str]]) -> str:
    """List what the surroundings are drawn from: name, prior, unit and reason of each."""
    return rows(("what", "drawn from", "unit", "why"), "llll", [list(entry) for entry in listed])


def equivalents(scores: Scores) -> str:
    """List what counted as a fair answer where the library lacks the effect."""
    lines = [
        f"- {effect}: {', '.join(fair)}"
        for effect, fair in sorted(scores["equivalents"].items())
        if fair
    ]
    return (
        "Recorded with the sealed labels, before any diagnosis; the reasons stand in "
        "`blind/equivalents.py` and in each rig. For every effect that is not listed only "
        "`unknown` is right; the column *unknown* of the table by kind counts that alone. A lag or "
        "a delay of the drive and one of the reading are fair for each other only where the "
        "pressure was not measured.\n\n" + "\n".join(lines)
    )
