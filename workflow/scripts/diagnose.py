"""The diagnosis of one material: diagnosis.json, its page and figures, the augmented model."""

from spa_fo.edge import workflow_step
from spa_fo.gap import diagnose_campaign
from spa_fo.report.diagnosis import write_report

with workflow_step(snakemake.log[0], snakemake.threads):
    diagnosis = diagnose_campaign(
        snakemake.params.campaign, snakemake.input.model, seed=snakemake.params.seed
    )
    write_report(diagnosis, snakemake.output[0])
