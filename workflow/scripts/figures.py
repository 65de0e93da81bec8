"""Every figure of one material; which ones there are depends on what the campaign holds."""

import json
from pathlib import Path

import pandas as pd

from spa_fo.edge import workflow_step
from spa_fo.plant import read_model
from spa_fo.report.material import MaterialResults, draw_material
from spa_fo.rig import read_campaign, read_trials


def load(path):
    return json.loads(Path(path).read_text(encoding="utf-8"))


with workflow_step(snakemake.log[0], snakemake.threads):
    results = MaterialResults(
        data=read_trials(read_campaign(snakemake.params.campaign)),
        model=read_model(snakemake.input.model),
        fit=load(snakemake.input.fit),
        comparison=load(snakemake.input.comparison),
        ablation=pd.read_csv(snakemake.input.ablation),
        design=snakemake.params.material.get("paper"),
    )
    draw_material(results, Path(snakemake.output[0]))
