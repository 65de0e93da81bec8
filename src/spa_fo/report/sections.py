"""Parts of a diagnosis in Markdown, which its page and its document share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from spa_fo.gap.diagnosis import Cause, Diagnosis, Step
from spa_fo.report.causes import (
    MOST_CAUSES,
    likelihood,
    named,
    percent,
    plain_held_out,
    probability_of,
)
from spa_fo.report.effect_words import MAP_WORDS, bin_words, joined, phrase, words_of
from spa_fo.report.glossary import HEAD, Fitted, agree, entries, listed
from spa_fo.report.share_maps import share_maps, stage_note
from spa_fo.report.verdict_words import judged

_BASELINE_WORDS = {"smallest_bic": "smallest BIC", "commonest": "commonest effect"}
_USE_MODEL = (
    "Predict with the augmented model: `spa-fo predict augmented_model.json CAMPAIGN --out FILE`."
)
_MOST_BINS = 4


def bullets(lines: Sequence[str]) -> list[str]:
    """Write lines as a list."""
    return ["\n".join(f"- {line}" for line in lines)]


def _sentence(text: str) -> str:
    return _ended(f"{text[:1].upper()}{text[1:]}")


def _ended(text: str) -> str:
    return text if text.endswith((".", "!", "?")) else f"{text}."


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """Say what to do next, a line each, most telling first."""
    written = [step_line(step) for step in diagnosis.next_steps]
    if diagnosis.kind == "no_gap":
        return ["Use the model as it is.", *(f"To test it further: {line}" for line in written)]
    if diagnosis.kind == "cause":
        mended = [
            _sentence(f"{phrase((effect,))}: {words_of(effect).remedy}")
            for effect in diagnosis.sets[0]
        ]
        return [*mended, *(f"To confirm it: {line}" for line in written), _USE_MODEL]
    if diagnosis.kind == "ambiguous":
        first = (
            f"{_USE_MODEL} It holds the first explanation; do not interpret its parameters before"
        )
        return [*written, f"{first} the others are ruled out."]
    look = "No effect is identified: inspect the rig where and when the gap is largest."
    held = ["the part that is explained"] if diagnosis.sets else []
    held += ["a free-form law"] if any(law.carried for law in diagnosis.laws) else []
    part = [f"{_USE_MODEL} It holds {joined(held, 'and')}."] if held else []
    return [*written, look, *part]


def step_line(step: Step) -> str:
    """Write a step with what it would tell."""
    line = f"**{step.do[:1].upper()}{step.do[1:]}**: {step.why}."
    if not step.apart:
        return line
    one, other = (
        phrase([each for each in ids if each not in against], " + ")
        for ids, against in (step.apart, step.apart[::-1])
    )
    if one and other:
        return f"{line} It tells {one} from {other}."
    return f"{line} It tells whether {one or other} contributes."


def cause_table(diagnosis: Diagnosis) -> str:
    """Tabulate the explanations with their probabilities, in numbers and in words."""
    shown = named(diagnosis.causes, MOST_CAUSES)
    rows = [_cause_row(cause, cause.set in diagnosis.sets) for cause in shown]
    none, unknown = (probability_of(diagnosis.causes, name) for name in ("none", "unknown"))
    rest = 1.0 - none - unknown - sum(cause.probability for cause in shown)
    if rest > 5e-4:
        rows.append(("others together", percent(rest), "", ""))
    before = _degrees(plain_held_out(diagnosis))
    rows.append((phrase(("none",)), percent(none), likelihood(none), before))
    rows.append((phrase(("unknown",)), percent(unknown), likelihood(unknown), ""))
    return _table(
        ("explanation", "probability", "in words", "held-out RMSE (°)"),
        rows,
        ":--|--:|:--|--:",
    )


def _cause_row(cause: Cause, stands: bool) -> tuple[str, ...]:
    name = phrase(cause.set, " + ")
    name = f"**{name}**" if stands else name
    return (
        name,
        percent(cause.probability),
        likelihood(cause.probability),
        _degrees(cause.held_out_rmse_deg),
    )


def _degrees(error: float | None) -> str:
    return "" if error is None else f"{error:.2f}"


def parameter_tables(diagnosis: Diagnosis) -> Iterator[str]:
    """Lay out the parameters of the explanations that count, one a row, a table each.

    An effect whose values lie where it was laid out first is not laid out again.
    """
    above: dict[str, Fitted] = {}
    for cause in listed(diagnosis):
        own = cause.parameters
        alike = tuple(name for name in own if name in above and agree(own[name], above[name]))
        rows = [entry.cells for entry in entries(cause, diagnosis.reach, alike)]
        if own:
            yield f"**{phrase(cause.set, ' + ')}** ({percent(cause.probability)}):"
        if rows:
            yield _table(HEAD, rows, ":--|:--|--:|:--:|:--|:--|:--")
        if alike:
            yield f"As first given above, every value in the interval there: {phrase(alike, ', ')}."
        above = {**own, **above}


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], alignment: str) -> str:
    lines = [" | ".join(head), alignment, *(" | ".join(row) for row in rows)]
    return "\n".join(f"| {line} |" if line != alignment else f"|{line}|" for line in lines)


def shrink_part(diagnosis: Diagnosis) -> Iterator[str]:
    """Say how far the gap closes, beside what it has to beat."""
    yield shrink_words(diagnosis)
    shrink = diagnosis.shrink
    if shrink is None:
        return
    rows = [
        ("plain model", shrink.before_rmse_deg),
        ("plain model, refitted", shrink.refit_only_rmse_deg),
        ("**augmented model**", shrink.after_rmse_deg),
        ("refitted model plus mean residual (no physics)", shrink.ceiling_rmse_deg),
        ("noise floor", shrink.noise_floor_deg),
    ]
    yield _table(
        ("", "RMSE (°)"),
        [(name, f"{value:.2f}") for name, value in rows if value is not None],
        ":--|--:",
    )


def shrink_words(diagnosis: Diagnosis) -> str:
    """Say how far the gap closes."""
    shrink = diagnosis.shrink
    if shrink is None and diagnosis.kind == "no_gap":
        return "There is no gap to close."
    if shrink is None:
        return "Nothing is explained, so there is nothing to validate on held-out trials."
    low, high = shrink.ci95
    return (
        f"On {judged(diagnosis)} the explanation closes **{percent(shrink.fraction_closed)}** of "
        f"the gap above the noise floor (95 % interval {percent(low)} to {percent(high)})."
    )


def where_part(diagnosis: Diagnosis) -> Iterator[str]:
    """Tabulate where the gap lies, the largest shares first."""
    cells = {name: _largest(shares) for name, shares in share_maps(diagnosis.where).items()}
    note = stage_note(diagnosis.where)
    if note:
        said = f"{cells['stage']} ({note})" if "stage" in cells else note
        cells = {"stage": said} | {name: cell for name, cell in cells.items() if name != "stage"}
    if cells:
        rows = [(MAP_WORDS[name], cell) for name, cell in cells.items()]
        yield _table(("by", "share of the gap"), rows, ":--|:--")


def _largest(shares: Mapping[str, float]) -> str:
    ordered = sorted(shares.items(), key=lambda item: -item[1])
    shown = [f"{bin_words(name)} {percent(share)}" for name, share in ordered[:_MOST_BINS] if share]
    return ", ".join(shown) + (", …" if len(ordered) > _MOST_BINS else "")


def evidence_part(diagnosis: Diagnosis) -> Iterator[str]:
    """Say what the campaign offers, and name what it lacks."""
    if diagnosis.offers:
        yield "The campaign offers:"
        yield from bullets([_sentence(offer) for offer in diagnosis.offers])
    if diagnosis.misses:
        names = [missing.split(":")[0] for missing in diagnosis.misses]
        yield f"It lacks {joined(names, 'and')}."


def findings_part(diagnosis: Diagnosis) -> list[str]:
    """Write what else a reader should know, a line each."""
    found = [_sentence(finding) for finding in diagnosis.findings]
    answers = [
        f"{_BASELINE_WORDS.get(name, name)}: {phrase(ids) if ids else 'no effect'}"
        for name, ids in diagnosis.baselines.items()
    ]
    if answers:
        found.append(f"Simpler methods would have said: {'; '.join(answers)}.")
    return found
