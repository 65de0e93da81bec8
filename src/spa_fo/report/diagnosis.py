"""The page that says what a diagnosis found, and its figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from spa_fo.atomic import filling, write_text
from spa_fo.gap.diagnose import write_files
from spa_fo.gap.diagnosis import Cause, Diagnosis
from spa_fo.gap.together import each
from spa_fo.report.diagnosis_figures import (
    MOST_CAUSES,
    before_after_figure,
    gap_figure,
    has_stages,
    ladder_figure,
    named,
    percent,
    plain_held_out,
    probability_of,
    stages_figure,
)
from spa_fo.report.effect_words import (
    EFFECT_WORDS,
    MAP_WORDS,
    STAGE_WORDS,
    bin_words,
    joined,
    parameter_words,
    phrase,
)
from spa_fo.report.style import save_figure

PAGE = "diagnosis.md"

_CAPTIONS = {
    "gap": "What the plain model misses over time, coloured by the command, with every trial in "
    "grey and the noise floor as a band; below, where the gap lies.",
    "before_after": "Each experiment measured and modelled, and what is missed before and after; "
    "the band is the noise floor, the faint lines are the other trials.",
    "ladder": "The ladder of explanations: error on trials that took no part, and probability. The "
    "explanations that stand are orange-red.",
    "stages": "Between the stages: measured pressure against the command, and the sensor in the "
    "calibration fixture.",
}
_BASELINE_WORDS = {"smallest_bic": "smallest BIC", "commonest": "commonest effect"}
_USE_MODEL = (
    "Predict with the augmented model: `spa-fo predict augmented_model.json CAMPAIGN --out FILE`."
)
_MOST_BINS = 4


def write_report(diagnosis: Diagnosis, folder: Path | str) -> tuple[Path, ...]:
    """Write diagnosis.md, its figures, diagnosis.json and augmented_model.json, all or none.

    Figures of an earlier diagnosis that this one has no use for are removed.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind.
    folder : Path or str
        Where to.

    Returns
    -------
    tuple of Path
        Figures, PNG and PDF, and the page last.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    folder = Path(folder)
    draw = {"gap": gap_figure, "before_after": before_after_figure, "ladder": ladder_figure}
    if has_stages(diagnosis.traces):
        draw["stages"] = stages_figure
    with filling(folder) as temporary:

        def drawn(name: str) -> tuple[Path, Path]:
            return save_figure(draw[name](diagnosis), temporary / name, _provenance(diagnosis))

        # Matplotlib's style is of the whole process: no threads.
        figures = chain.from_iterable(each(drawn, list(draw), threads=False))
        write_text(temporary / PAGE, document(diagnosis, tuple(draw)))
        write_files(diagnosis, temporary)
    for name in _CAPTIONS.keys() - draw.keys():
        for suffix in ("png", "pdf"):
            (folder / f"{name}.{suffix}").unlink(missing_ok=True)
    return (*(folder / path.name for path in figures), folder / PAGE)


def document(diagnosis: Diagnosis, figures: Sequence[str] = ()) -> str:
    """Write the page.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind.
    figures : sequence of str
        Names of the figures beside the page, without suffix.

    Returns
    -------
    str
        Markdown.
    """
    sections = (
        ("", _head(diagnosis)),
        ("The verdict", [verdict(diagnosis)]),
        ("What to do next", _bullets(_next_steps(diagnosis))),
        (
            "Which cause",
            [
                _cause_table(diagnosis),
                f"Held out: {diagnosis.held_out_on}.",
                *_figure("ladder", figures),
            ],
        ),
        ("How far it shrinks", [*_shrink(diagnosis), *_figure("before_after", figures)]),
        ("Where", [*_where(diagnosis), *_figure("gap", figures)]),
        ("What the evidence is", [*_evidence(diagnosis), *_figure("stages", figures)]),
        ("Findings", _bullets(_findings(diagnosis))),
    )
    parts: list[str] = []
    for title, paragraphs in sections:
        body = [paragraph for paragraph in paragraphs if paragraph]
        parts += [f"## {title}", *body] if title and body else body
    return "\n\n".join(parts) + "\n"


def verdict(diagnosis: Diagnosis) -> str:
    """Say in two sentences how large the gap is and where, and what causes it.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind.
    """
    gap = diagnosis.gap
    if diagnosis.kind == "no_gap":
        return (
            f"The model misses {diagnosis.campaign} by {gap.rmse_deg:.2f}°, which repeated trials "
            f"account for: they differ by {gap.noise_floor_deg:.2f}° among themselves "
            f"({_chance(diagnosis)}). There is **no gap** to explain: the model stands as it is."
        )
    against = (
        "where" if gap.rmse_deg > gap.noise_floor_deg else "in the same way every time, though"
    )
    size = (
        f"The model misses {diagnosis.campaign} by {gap.rmse_deg:.2f}° {against} repeated trials "
        f"differ by {gap.noise_floor_deg:.2f}° among themselves "
        f"({_chance(diagnosis)}){_mostly(diagnosis)}."
    )
    cause = {"cause": _one_cause, "ambiguous": _several_causes, "unknown": _no_cause}
    return f"{size} {cause[diagnosis.kind](diagnosis)}"


def _chance(diagnosis: Diagnosis) -> str:
    return f"no gap: {percent(probability_of(diagnosis.causes, 'none'))} probable"


def _mostly(diagnosis: Diagnosis) -> str:
    shares = diagnosis.where.stage
    if not any(shares.values()):
        return ""
    stage = max(shares, key=lambda name: shares[name])
    return f", and {percent(shares[stage])} of that gap arises in {STAGE_WORDS[stage]}"


def _one_cause(diagnosis: Diagnosis) -> str:
    ids = diagnosis.sets[0]
    means = "; ".join(EFFECT_WORDS[each].means for each in ids)
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


def _judged(diagnosis: Diagnosis) -> str:
    """Name the trials that the shrink is of: a lone trial cannot be held out."""
    return "held-out trials" if diagnosis.traces.held_out.any() else "the fitted trials"


def _reached(diagnosis: Diagnosis, subject: str = "it") -> str:
    shrink = diagnosis.shrink
    if shrink is None:
        return ""
    low, high = shrink.ci95
    return (
        f"; with {subject} in the model the error on {_judged(diagnosis)} goes from "
        f"{shrink.before_rmse_deg:.2f}° to {shrink.after_rmse_deg:.2f}°, which closes "
        f"{percent(shrink.fraction_closed)} of the gap (95 % interval {percent(low)} to "
        f"{percent(high)})"
    )


def _head(diagnosis: Diagnosis) -> Iterator[str]:
    yield f"# Diagnosis of {diagnosis.campaign}: why model and actuator disagree"
    yield (
        f"**{diagnosis.provenance.capitalize()} data.** {diagnosis.material}, seed "
        f"{diagnosis.seed}."
    )
    if diagnosis.excluded:
        names = ", ".join(phrase((each,)) for each in diagnosis.excluded)
        yield f"Taken out of the library for this diagnosis: {names}."


def _provenance(diagnosis: Diagnosis) -> str:
    return f"{diagnosis.provenance} data; campaign {diagnosis.campaign}"


def _figure(name: str, figures: Sequence[str]) -> list[str]:
    if name not in figures:
        return []
    return [f"![{_CAPTIONS[name]}]({name}.png)", f"*{_CAPTIONS[name]}*"]


def _bullets(lines: Sequence[str]) -> list[str]:
    return ["\n".join(f"- {line}" for line in lines)]


def _sentence(text: str) -> str:
    return _ended(f"{text[:1].upper()}{text[1:]}")


def _ended(text: str) -> str:
    return text if text.endswith((".", "!", "?")) else f"{text}."


def _next_steps(diagnosis: Diagnosis) -> list[str]:
    steps = {"no_gap": _keep, "cause": _mend, "ambiguous": _decide, "unknown": _look}
    return list(steps[diagnosis.kind](diagnosis))


def _keep(diagnosis: Diagnosis) -> Iterator[str]:
    yield "Use the model as it is."
    yield from _lacking(diagnosis, "A smaller gap would show with")


def _mend(diagnosis: Diagnosis) -> Iterator[str]:
    for effect in diagnosis.sets[0]:
        yield _sentence(f"{phrase((effect,))}: {EFFECT_WORDS[effect].remedy}")
    yield _USE_MODEL


def _decide(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.next_experiment:
        yield _ended(f"**To decide:** {diagnosis.next_experiment}")
    yield from _lacking(diagnosis, "This campaign lacks")
    yield (
        f"{_USE_MODEL} It holds the first explanation; its parameters are no physics before the "
        "others are ruled out."
    )


def _look(diagnosis: Diagnosis) -> Iterator[str]:
    yield "Trust no name here: look at the rig where and when the gap is largest (figures below)."
    if diagnosis.next_experiment:
        yield _ended(f"**To learn more:** {diagnosis.next_experiment}")
    yield from _lacking(diagnosis, "This campaign lacks")
    if diagnosis.sets:
        yield f"{_USE_MODEL} It holds the part that is explained."


def _lacking(diagnosis: Diagnosis, lead: str) -> Iterator[str]:
    """Name what evidence is missing; what for stands under the evidence."""
    names = [missing.split(":")[0] for missing in diagnosis.misses]
    if names:
        yield f"{lead} {joined(names, 'and')}."


def _cause_table(diagnosis: Diagnosis) -> str:
    shown = named(diagnosis.causes, MOST_CAUSES)
    rows = [_cause_row(cause, cause.set in diagnosis.sets) for cause in shown]
    none, unknown = (probability_of(diagnosis.causes, name) for name in ("none", "unknown"))
    rest = 1.0 - none - unknown - sum(cause.probability for cause in shown)
    if rest > 5e-4:
        rows.append(("others together", percent(rest), "", ""))
    rows.append((phrase(("none",)), percent(none), "", _degrees(plain_held_out(diagnosis))))
    rows.append((phrase(("unknown",)), percent(unknown), "", ""))
    return _table(
        ("explanation", "probability", "parameters (95 % interval)", "held-out RMSE (°)"),
        rows,
        ":--|--:|:--|--:",
    )


def _cause_row(cause: Cause, stands: bool) -> tuple[str, ...]:
    name = phrase(cause.set, " + ")
    name = f"**{name}**" if stands else name
    return name, percent(cause.probability), _parameters(cause), _degrees(cause.held_out_rmse_deg)


def _degrees(error: float | None) -> str:
    return "" if error is None else f"{error:.2f}"


def _parameters(cause: Cause) -> str:
    parts = []
    for effect, parameters in cause.parameters.items():
        values = ", ".join(_parameter(effect, name, p) for name, p in parameters.items())
        several = len(cause.parameters) > 1
        parts.append(f"{phrase((effect,))}: {values}" if several else values)
    return "; ".join(part for part in parts if part)


def _parameter(effect: str, name: str, entry: Mapping[str, Any]) -> str:
    words, unit = parameter_words(effect, name)
    gap = "" if unit.startswith("°") else " "
    text = f"{words} {_number(entry['value'])}"
    if entry.get("ci95") is not None:
        low, high = entry["ci95"]
        text += f" ({_number(low)} to {_number(high)})"
    return f"{text}{gap}{unit}".rstrip()


def _number(value: float) -> str:
    """Write three digits that count, without exponents."""
    text = np.format_float_positional(value, precision=3, fractional=False, trim="-")
    return text.replace("-", "−")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], alignment: str) -> str:
    lines = [" | ".join(head), alignment, *(" | ".join(row) for row in rows)]
    return "\n".join(f"| {line} |" if line != alignment else f"|{line}|" for line in lines)


def _shrink(diagnosis: Diagnosis) -> Iterator[str]:
    shrink = diagnosis.shrink
    if shrink is None:
        if diagnosis.kind == "no_gap":
            yield "There is no gap to close."
        else:
            yield "Nothing is explained, so there is nothing to hold against unseen trials."
        return
    low, high = shrink.ci95
    rows = [
        ("plain model", shrink.before_rmse_deg),
        ("refit only", shrink.refit_only_rmse_deg),
        ("**with the explanation**", shrink.after_rmse_deg),
        ("free-form correction (no physics)", shrink.ceiling_rmse_deg),
        ("noise floor", shrink.noise_floor_deg),
    ]
    yield (
        f"On {_judged(diagnosis)} the explanation closes **{percent(shrink.fraction_closed)}** of "
        f"the gap above the noise floor (95 % interval {percent(low)} to {percent(high)})."
    )
    yield _table(
        ("", "RMSE (°)"),
        [(name, f"{value:.2f}") for name, value in rows if value is not None],
        ":--|--:",
    )
    if shrink.protocol is not None:
        other = shrink.protocol
        yield (
            f"On an experiment that took no part ({other['held_out_on']}; chosen among the leading "
            f"explanations and fitted without it: {phrase(other['set'])}): "
            f"{other['before_rmse_deg']:.2f}° → {other['after_rmse_deg']:.2f}°, "
            f"{percent(other['fraction_closed'])} of the gap closed."
        )


def _where(diagnosis: Diagnosis) -> Iterator[str]:
    rows = [
        (MAP_WORDS[name], _largest(shares))
        for name, shares in vars(diagnosis.where).items()
        if any(shares.values())
    ]
    if rows:
        yield _table(("by", "share of the gap"), rows, ":--|:--")


def _largest(shares: Mapping[str, float]) -> str:
    ordered = sorted(shares.items(), key=lambda item: -item[1])
    shown = [f"{bin_words(name)} {percent(share)}" for name, share in ordered[:_MOST_BINS] if share]
    return ", ".join(shown) + (", …" if len(ordered) > _MOST_BINS else "")


def _evidence(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.offers:
        yield "The campaign offers:"
        yield from _bullets([_sentence(offer) for offer in diagnosis.offers])
    if diagnosis.misses:
        yield "It lacks:"
        yield from _bullets([_sentence(missing) for missing in diagnosis.misses])


def _findings(diagnosis: Diagnosis) -> list[str]:
    found = [_sentence(finding) for finding in diagnosis.findings]
    answers = [
        f"{_BASELINE_WORDS.get(name, name)}: {phrase(ids) if ids else 'no effect'}"
        for name, ids in diagnosis.baselines.items()
    ]
    if answers:
        found.append(f"Simpler methods would have said: {'; '.join(answers)}.")
    return found
