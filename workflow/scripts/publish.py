"""The tables, the page to start from, and the texts of the report."""

import json
from pathlib import Path

import pandas as pd

from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.report.answers import write_texts
from spa_fo.report.change import DOCUMENT
from spa_fo.report.change import PAGE as CHANGED
from spa_fo.report.diagnosis import PAGE
from spa_fo.report.pages import write_pages
from spa_fo.report.published import MeasuredMaterial, PublishedMaterial, told_apart
from spa_fo.report.summary import summary, tables, write_tables
from spa_fo.rig import read_campaign


def read(path):
    return Path(path).read_text(encoding="utf-8")


def load(path):
    return json.loads(read(path))


def what_changed(name, changes):
    """What every material has: the campaign, and where it was compared what that found."""
    found = {"name": name, "campaign": read_campaign(snakemake.params.campaigns[name], angle=False)}
    if name in changes:
        found["changed"] = load(changes[name] / DOCUMENT)
        found["changed_page"] = read(changes[name] / CHANGED)
    return found


def what_was_found(i, entry):
    """What the i-th of those has that were identified and diagnosed."""
    given = snakemake.input
    diagnosis = Path(given.diagnoses[i])
    return {
        "design": entry.get("paper"),
        "fit": load(given.fits[i]),
        "comparison": load(given.comparisons[i]),
        "verdict": load(given.ablation_verdicts[i]),
        "ablation": pd.read_csv(given.ablations[i]),
        "fit_report": read(given.reports[i]),
        "parse_report": read(given.parse_reports[i]),
        "diagnosis": load(diagnosis / "diagnosis.json"),
        "diagnosis_page": read(diagnosis / PAGE),
        "opening_png": (diagnosis / "opening.png").read_bytes(),
        "figures": tuple(p.stem for p in sorted(Path(given.figures[i]).glob("*.png"))),
    }


with workflow_step(snakemake.log[0], snakemake.threads):
    changes = dict(zip(snakemake.params.changed, map(Path, snakemake.input.changes), strict=True))
    identified = {name: i for i, name in enumerate(snakemake.params.identified)}
    materials = [
        PublishedMaterial(**what_changed(name, changes), **what_was_found(identified[name], entry))
        if name in identified
        else MeasuredMaterial(**what_changed(name, changes))
        for name, entry in snakemake.params.materials.items()
    ]
    materials = told_apart(materials)
    folder = Path(snakemake.output.tables)
    made = tables(materials)
    write_tables(made, folder)
    write_pages(materials, made, Path(snakemake.output.pages))
    write_texts(materials, Path(snakemake.output.texts))
    path = Path(snakemake.output.summary)
    write_text(path, summary(materials, folder, path.parent))
