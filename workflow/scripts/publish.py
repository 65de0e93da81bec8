"""The tables and the page to start from."""

import json
from pathlib import Path

import pandas as pd

from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.report.summary import PublishedMaterial, summary, tables, write_tables
from spa_fo.rig import read_campaign


def load(path):
    return json.loads(Path(path).read_text(encoding="utf-8"))


with workflow_step(snakemake.log[0], snakemake.threads):
    materials = [
        PublishedMaterial(
            name=name,
            campaign=read_campaign(snakemake.params.campaigns[i]),
            design=entry.get("paper"),
            fit=load(snakemake.input.fits[i]),
            comparison=load(snakemake.input.comparisons[i]),
            verdict=load(snakemake.input.ablation_verdicts[i]),
            ablation=pd.read_csv(snakemake.input.ablations[i]),
            fit_report=Path(snakemake.input.reports[i]).read_text(encoding="utf-8"),
            parse_report=Path(snakemake.input.parse_reports[i]).read_text(encoding="utf-8"),
            diagnosis=load(Path(snakemake.input.diagnoses[i]) / "diagnosis.json"),
            figures=tuple(p.stem for p in sorted(Path(snakemake.input.figures[i]).glob("*.png"))),
        )
        for i, (name, entry) in enumerate(snakemake.params.materials.items())
    ]
    folder = Path(snakemake.output.tables)
    write_tables(tables(materials), folder)
    path = Path(snakemake.output.summary)
    write_text(path, summary(materials, folder, path.parent))
