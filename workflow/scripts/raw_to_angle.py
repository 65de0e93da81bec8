"""Raw logs to angles, with the account of what was damaged and the calibration."""

import json

from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.report.provenance import provenance_line
from spa_fo.rig import read_campaign, read_trials, write_trials

with workflow_step(snakemake.log[0], snakemake.threads):
    data = read_trials(read_campaign(snakemake.params.campaign))
    write_trials(snakemake.output.trials, data.trials)
    provenance = provenance_line(data.campaign.provenance)
    write_text(snakemake.output.report, f"{data.report.to_markdown().strip()}\n\n_{provenance}_\n")
    calibration = {
        "calibrations": [curve.to_dict() for curve in data.calibrations],
        "drifts": [drift.to_dict() for drift in data.drifts],
    }
    write_text(
        snakemake.output.calibration, json.dumps(calibration, indent=1, allow_nan=False) + "\n"
    )
