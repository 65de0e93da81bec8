"""The report's front page: what each question's answer is, in a sentence a material."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from spa_fo.atomic import write_text
from spa_fo.plant import paper
from spa_fo.report.audit import FAILS, HOLDS, AuditLine
from spa_fo.report.headline import headline
from spa_fo.report.pages import ALL
from spa_fo.report.published import (
    MeasuredMaterial,
    PublishedMaterial,
    identified,
    joint_provenance,
)
from spa_fo.report.study import openings_html
from spa_fo.report.summary import audit_lines


def answers(materials: Sequence[MeasuredMaterial]) -> dict[str, list[str]]:
    """Answer the report's questions.

    Parameters
    ----------
    materials : sequence of PublishedMaterial
        In the order of config.yaml.

    Returns
    -------
    dict of str to list of str
        Sentences by question: ``measured``, ``fit``, ``paper``, ``gap`` and ``changed``.
    """
    found = identified(materials)
    return {
        "measured": [_of(material, _measured(material)) for material in materials],
        "fit": [_of(material, _fit(material)) for material in found],
        "paper": list(_paper(audit_lines(found))),
        "gap": [_of(material, " ".join(headline(material.diagnosis))) for material in found],
        "changed": [
            _of(material, " ".join(material.changed["answer"]))
            for material in materials
            if material.changed is not None
        ],
    }


def write_texts(materials: Sequence[MeasuredMaterial], folder: Path) -> None:
    """Write what the report's captions and front page include, as HTML.

    ``openings.html`` is what it begins with, ``answers_<question>.html`` a list of `answers`;
    ``<material>.html`` and ``tables.html`` say where the data come from.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    write_text(folder / "openings.html", openings_html(materials))
    for question, sentences in answers(materials).items():
        items = "".join(f"<li>{html.escape(sentence)}</li>\n" for sentence in sentences)
        write_text(folder / f"answers_{question}.html", f"<ul>\n{items}</ul>\n")
    origins = {material.name: material.provenance for material in materials}
    for name, line in (origins | {ALL: joint_provenance(materials)}).items():
        write_text(folder / f"{name}.html", f"<p><em>{html.escape(line)}</em></p>\n")


def _of(material: MeasuredMaterial, sentence: str) -> str:
    return f"{material.label}: {sentence}"


def _measured(material: MeasuredMaterial) -> str:
    campaign = material.campaign
    experiments = ", ".join(
        f"{experiment.name} ({len(experiment.trials)})" for experiment in campaign.experiments
    )
    return f"trials by experiment: {experiments}; {campaign.provenance.kind} data."


def _fit(material: PublishedMaterial) -> str:
    errors = "; ".join(_error(error) for error in material.fit["errors"])
    text = f"fitted on {material.fit['fitted_on']}; RMS error {errors}."
    uncertainty = material.fit["uncertainty"]
    if uncertainty is None:
        return text
    if not uncertainty["undetermined"]:
        return f"{text} The data determine every parameter."
    return f"{text} The data do not determine {', '.join(uncertainty['undetermined'])}."


def _error(error: Mapping[str, object]) -> str:
    share = error["percent"]
    relative = "" if share is None else f" ({share:.1f} %)"
    return f"{error['experiment']} {error['rms_deg']:.2f}°{relative}"


def _paper(lines: Sequence[AuditLine]) -> Iterator[str]:
    if not lines:
        yield "No material of this run is compared with the paper (config.yaml: paper)."
        return
    count = Counter(_kind(line.verdict) for line in lines)
    yield (
        f"Of {len(lines)} statements of {paper.ARXIV} that were checked, {count[HOLDS]} hold and "
        f"{count[FAILS]} do not; {count['']} are open. The audit has them one by one."
    )


def _kind(verdict: str) -> str:
    return next((kind for kind in (HOLDS, FAILS) if verdict.startswith(kind)), "")
