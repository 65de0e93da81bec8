"""The page to start from: what was measured, how well the model fits, what holds of the paper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd

from spa_fo.identify.reproduction import Reproduction
from spa_fo.report.ablation import ablation_table, verdict_lines
from spa_fo.report.audit import AuditLine, Identified, audit, audit_table
from spa_fo.report.change import caption_of
from spa_fo.report.comparison import (
    MaterialComparison,
    baseline_table,
    parameter_table,
    rms_table,
)
from spa_fo.report.headline import headline
from spa_fo.report.published import (
    MeasuredMaterial,
    PublishedMaterial,
    identified,
    joint_provenance,
)
from spa_fo.report.study import campaign_table, openings_markdown
from spa_fo.report.tables import Table, write_table

# What there is to see in each figure, in the order a reader asks.
_CAPTIONS = {
    "calibration": "Flex sensor against known angles: the calibration curve, its "
    "hysteresis and uncertainty, and its drift until the later calibration.",
    "step_responses": "Step responses as in the paper's Figs. 4 and 5: the trials, their mean, and "
    "the models.",
    "whole_logs": "One trial of each experiment in full: measured, predicted, and the residual.",
    "identifiability": "Profile likelihood of each parameter: where it is flat, the data do not "
    "determine it.",
    "ablation": "How the error of the curve and the spread of the parameters depend on the number "
    "of datasets and points, and what outliers do.",
}


_CHANGED_PAGE = "changed/comparison.md"
_PAGES = ("diagnosis/diagnosis.html", "diagnosis/diagnosis.md")


def tables(materials: Sequence[MeasuredMaterial]) -> dict[str, Table]:
    """Make every table, by the name of its file.

    Parameters
    ----------
    materials : sequence of PublishedMaterial
        In the order of config.yaml.

    Returns
    -------
    dict of str to Table
        Those about step responses only where some material has them; none where nothing was
        identified.
    """
    found = identified(materials)
    return _tables(found) if found else {}


def _tables(materials: Sequence[PublishedMaterial]) -> dict[str, Table]:
    stepped = [material for material in materials if material.comparison is not None]
    found: dict[str, Table] = {}
    if stepped:
        provenance = joint_provenance(stepped)
        compared = [
            MaterialComparison(m.label, m.design, Reproduction.from_dict(m.comparison))
            for m in stepped
            if m.comparison is not None
        ]
        found["table_1"] = parameter_table(compared, provenance)
        found["rms"] = rms_table(compared, provenance)
        found["baselines"] = baseline_table(compared, provenance)
        found["ablation"] = ablation_table({m.label: m.ablation for m in stepped}, provenance)
    found["campaigns"] = campaign_table(materials)
    found["fit_errors"] = _fit_errors(materials)
    designs = _compared(materials)
    if designs:
        found["audit"] = audit_table(audit_lines(designs), joint_provenance(designs))
    return found


def audit_lines(materials: Sequence[PublishedMaterial]) -> tuple[AuditLine, ...]:
    """Check the paper's statements against the materials that are compared with it.

    Parameters
    ----------
    materials : sequence of PublishedMaterial
        Those without a design of the paper are passed over.

    Returns
    -------
    tuple of AuditLine
        Empty where no material is compared with the paper.
    """
    designs = _compared(materials)
    return audit(_identified(designs)) if designs else ()


def _compared(materials: Sequence[PublishedMaterial]) -> list[PublishedMaterial]:
    return [material for material in materials if material.design is not None]


def write_tables(found: Mapping[str, Table], folder: Path) -> None:
    """Write every table as CSV, LaTeX and Markdown into `folder`, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in found.items():
        write_table(table, folder / name)


def summary(materials: Sequence[MeasuredMaterial], tables_folder: Path, root: Path) -> str:
    """Return the summary as Markdown.

    Parameters
    ----------
    materials : sequence of PublishedMaterial
        In the order of config.yaml.
    tables_folder : Path
        Where `write_tables` wrote.
    root : Path
        The folder that the summary will stand in, for its links.
    """
    parts = ["# Results", *openings_markdown(materials), *_provenance(materials)]
    parts += _paper_part(tables_folder)
    for material in materials:
        parts += _material_part(material)
    parts += _files_part(tables_folder, root)
    return "\n\n".join(parts) + "\n"


def _provenance(materials: Sequence[MeasuredMaterial]) -> Iterator[str]:
    lines = [
        f"- **{material.label}** (`{material.campaign.name}`): {material.provenance}."
        for material in materials
    ]
    yield "## What was measured"
    yield "\n".join(lines)


def _paper_part(folder: Path) -> Iterator[str]:
    for name, title in (
        ("rms", "## How well the models fit"),
        ("table_1", "## Table I"),
        ("audit", "## What holds of the paper"),
    ):
        path = folder / f"{name}.md"
        if path.is_file():
            yield title
            yield path.read_text(encoding="utf-8").strip()


def _material_part(material: MeasuredMaterial) -> Iterator[str]:
    if isinstance(material, PublishedMaterial):
        yield from _identified_part(material)
    elif material.changed is not None:
        yield f"## {material.label}"
        yield from _changed_part(material)


def _identified_part(material: PublishedMaterial) -> Iterator[str]:
    yield f"## {material.label}"
    yield f"```\n{material.fit_report.strip()}\n```"
    yield from _diagnosis_part(material)
    yield from _changed_part(material)
    if material.verdict is not None:
        yield "### How many datasets"
        yield "\n".join(f"- {line}" for line in verdict_lines(material.verdict))
    for name, caption in _CAPTIONS.items():
        if name in material.figures:
            yield f"![{caption}]({material.name}/figures/{name}.png)"
            yield f"*{caption}*"
    yield "### The logs"
    yield material.parse_report.strip()


def _diagnosis_part(material: PublishedMaterial) -> Iterator[str]:
    yield "### Why model and actuator disagree"
    answer, sizes = headline(material.diagnosis)
    yield f"**{answer}** {sizes}"
    following = material.diagnosis["verdict"]["next_experiment"]
    if following:
        yield f"Next: {following}"
    links = [f"[{page}]({material.name}/{page})" for page in _PAGES]
    yield f"The pages of this diagnosis: {' to zoom into, and as text '.join(links)}."


def _changed_part(material: MeasuredMaterial) -> Iterator[str]:
    if material.changed is None:
        return
    yield f"### What changed since `{material.changed['reference']}`"
    answer, sizes = material.changed["answer"]
    yield f"**{answer}** {sizes}"
    caption = caption_of("change", material.changed["compared"])
    yield f"![{caption}]({material.name}/changed/change.png)"
    yield f"*{caption}*"
    yield f"The page of this comparison: [{_CHANGED_PAGE}]({material.name}/{_CHANGED_PAGE})."


def _files_part(tables_folder: Path, root: Path) -> Iterator[str]:
    links = [
        f"- [{path.name}]({path.relative_to(root).as_posix()})"
        for path in sorted(tables_folder.glob("[!.]*"))
    ]
    if links:
        yield "## Every table"
        yield "\n".join(links)


def _fit_errors(materials: Sequence[PublishedMaterial]) -> Table:
    rows = [
        {
            "material": material.label,
            "fitted on": material.fit["fitted_on"],
            "experiment": error["experiment"],
            "trials": error["trials"],
            "RMS (°)": error["rms_deg"],
            "RMS (%)": error["percent"],
        }
        for material in materials
        for error in material.fit["errors"]
    ]
    return Table(
        pd.DataFrame(rows),
        "The identified model (model.json) against what it was fitted to",
        joint_provenance(materials),
        {"trials": ".0f", "RMS (°)": ".2f", "RMS (%)": ".2f"},
    )


def _identified(materials: Sequence[PublishedMaterial]) -> dict[str, Identified]:
    found = {}
    for material in materials:
        uncertainty = material.fit["uncertainty"]
        if material.design is None or material.comparison is None or uncertainty is None:
            continue
        widest = next(
            entry for entry in uncertainty["profiles"] if entry["name"] == uncertainty["widest"]
        )
        found[material.name] = Identified(
            label=material.label,
            condition_number=uncertainty["condition_number"],
            undetermined=tuple(uncertainty["undetermined"]),
            widest=widest["name"],
            low=widest["low_95"],
            high=widest["high_95"],
            curve_change_deg=widest["likely_change_deg"],
            swarm=Reproduction.from_dict(material.comparison).swarm_repeats[-1],
        )
    return found
