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
from spa_fo.report.published import PublishedMaterial, told_apart
from spa_fo.report.summary import summary, tables, write_tables
from spa_fo.rig import read_campaign


def read(path):
    return Path(path).read_text(encoding="utf-8")


with workflow_step(snakemake.log[0], snakemake.threads):
    changes = dict(zip(snakemake.params.changed, map(Path, snakemake.input.changes), strict=True))
    materials = [
        PublishedMaterial(
            name=name,
            campaign=read_campaign(snakemake.params.campaigns[i]),
            design=entry.get("paper"),
            fit=json.loads(read(snakemake.input.fits[i])),
            comparison=json.loads(read(snakemake.input.comparisons[i])),
            verdict=json.loads(read(snakemake.input.ablation_verdicts[i])),
            ablation=pd.read_csv(snakemake.input.ablations[i]),
            fit_report=read(snakemake.input.reports[i]),
            parse_report=read(snakemake.input.parse_reports[i]),
            diagnosis=json.loads(read(Path(snakemake.input.diagnoses[i]) / "diagnosis.json")),
            diagnosis_page=read(Path(snakemake.input.diagnoses[i]) / PAGE),
            opening_png=(Path(snakemake.input.diagnoses[i]) / "opening.png").read_bytes(),
            changed=json.loads(read(changes[name] / DOCUMENT)) if name in changes else None,
            changed_page=read(changes[name] / CHANGED) if name in changes else "",
            figures=tuple(p.stem for p in sorted(Path(snakemake.input.figures[i]).glob("*.png"))),
        )
        for i, (name, entry) in enumerate(snakemake.params.materials.items())
    ]
    materials = told_apart(materials)
    folder = Path(snakemake.output.tables)
    made = tables(materials)
    write_tables(made, folder)
    write_pages(materials, made, Path(snakemake.output.pages))
    write_texts(materials, Path(snakemake.output.texts))
    path = Path(snakemake.output.summary)
    write_text(path, summary(materials, folder, path.parent))
