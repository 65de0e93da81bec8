"""The page that says what a diagnosis found, and its figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from spa_fo.atomic import filling, write_text
from spa_fo.gap.diagnose import write_files
from spa_fo.gap.diagnosis import Diagnosis
from spa_fo.report.diagnosis_figures import before_after_figure, gap_figure, ladder_figure
from spa_fo.report.effect_words import phrase
from spa_fo.report.headline import opening
from spa_fo.report.interactive_page import interactive_page
from spa_fo.report.law_figure import law_table, laws_figure
from spa_fo.report.opening_figure import opening_figure
from spa_fo.report.sections import (
    bullets,
    cause_table,
    evidence_part,
    findings_part,
    next_steps,
    parameter_tables,
    shrink_part,
    where_part,
)
from spa_fo.report.stages_figure import has_stages, stages_figure
from spa_fo.report.style import save_figure
from spa_fo.report.verdict_words import verdict
from spa_fo.together import each

PAGE = "diagnosis.md"

INTERACTIVE_PAGE = "diagnosis.html"

_CAPTIONS = {
    "opening": "The experiment that the plain model predicts worst: measured, plain model and "
    "augmented model; right, the residuals, and the noise floor as a band.",
    "gap": "Residual of the plain model over time, coloured by the command, with every trial in "
    "grey and the noise floor as a band; below, where the gap lies.",
    "before_after": "Each experiment measured and modelled, and the residuals of plain and "
    "augmented model; the band is the noise floor, the faint lines are the other trials.",
    "ladder": "The explanations compared: error on held-out trials, and posterior probability. "
    "Those of the verdict are orange-red.",
    "laws": "Free-form laws by place in the chain, with their 95 % bands, over the range of the "
    "trials only, and the forms that they resemble. The linear part is taken out.",
    "stages": "Between the stages: measured pressure against the command, and the sensor in the "
    "calibration fixture.",
}


def write_report(diagnosis: Diagnosis, folder: Path | str) -> tuple[Path, ...]:
    """Write diagnosis.html, .md and .json, the figures and augmented_model.json, all or none.

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
        Figures, PNG and PDF, diagnosis.md, and the page to open, diagnosis.html, last.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    folder = Path(folder)
    draw = {
        "opening": opening_figure,
        "gap": gap_figure,
        "before_after": before_after_figure,
        "ladder": ladder_figure,
    }
    if diagnosis.laws:
        draw["laws"] = laws_figure
    if has_stages(diagnosis.traces):
        draw["stages"] = stages_figure
    with filling(folder) as temporary:

        def drawn(name: str) -> tuple[Path, Path]:
            return save_figure(draw[name](diagnosis), temporary / name, _provenance(diagnosis))

        # Matplotlib's style is of the whole process: no threads.
        figures = tuple(chain.from_iterable(each(drawn, list(draw), threads=False)))
        laws = temporary / "laws.png"
        picture = laws.read_bytes() if diagnosis.laws else None
        write_text(temporary / INTERACTIVE_PAGE, interactive_page(diagnosis, picture))
        write_text(temporary / PAGE, document(diagnosis, tuple(draw)))
        write_files(diagnosis, temporary)
    for name in _CAPTIONS.keys() - draw.keys():
        for suffix in ("png", "pdf"):
            (folder / f"{name}.{suffix}").unlink(missing_ok=True)
    return (*(folder / path.name for path in figures), folder / PAGE, folder / INTERACTIVE_PAGE)


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
        ("In short", [*opening(diagnosis.to_dict()), *_figure("opening", figures)]),
        ("The verdict", [verdict(diagnosis)]),
        ("What to do next", bullets(next_steps(diagnosis))),
        (
            "Which cause",
            [
                cause_table(diagnosis),
                f"Held out: {diagnosis.held_out_on}.",
                *_figure("ladder", figures),
            ],
        ),
        ("The missing law", [*law_table(diagnosis), *_figure("laws", figures)]),
        ("The parameters", [*parameter_tables(diagnosis)]),
        ("How far it shrinks", [*shrink_part(diagnosis), *_figure("before_after", figures)]),
        ("Where", [*where_part(diagnosis), *_figure("gap", figures)]),
        ("Evidence", [*evidence_part(diagnosis), *_figure("stages", figures)]),
        ("Findings", bullets(findings_part(diagnosis))),
    )
    parts: list[str] = []
    for title, paragraphs in sections:
        body = [paragraph for paragraph in paragraphs if paragraph]
        parts += [f"## {title}", *body] if title and body else body
    return "\n\n".join(parts) + "\n"


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
