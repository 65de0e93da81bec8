"""The minimum-data ablation of one material, and its verdict in words."""

import dataclasses
import json

import pandas as pd

from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.identify import AblationOptions, ablate, ablation_verdict
from spa_fo.identify.protocol import is_step
from spa_fo.rig import CampaignData, load_trials, read_campaign

with workflow_step(snakemake.log[0], snakemake.threads):
    campaign = read_campaign(snakemake.params.campaign)
    data = CampaignData(campaign, load_trials(snakemake.input.trials, campaign))
    given = snakemake.params.options
    options = AblationOptions(
        points=tuple(given["points"]),
        outliers=tuple(given["outliers"]),
        outlier_deg=given["outlier_deg"],
    )
    # Without step experiments there is nothing to leave out: the header alone, and no verdict.
    table, verdict = pd.DataFrame({"group": []}), None
    if any(is_step(trial) for trial in data.trials):
        table = ablate(data, options, snakemake.params.seed)
        verdict = dataclasses.asdict(ablation_verdict(table))
    write_text(snakemake.output.table, table.to_csv(index=False, lineterminator="\n"))
    write_text(snakemake.output.verdict, json.dumps(verdict, indent=1, allow_nan=False) + "\n")
