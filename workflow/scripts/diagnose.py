"""The diagnosis of one material: diagnosis.json, its page and figures, the augmented model."""

from pathlib import Path

from spa_fo.edge import workflow_step
from spa_fo.gap import diagnose_files, write_files
from spa_fo.report.diagnosis import write_report

with workflow_step(snakemake.log[0], snakemake.threads):
    folder = Path(snakemake.output[0])
    diagnosis = diagnose_files(
        snakemake.params.campaign, snakemake.input.model, seed=snakemake.params.seed
    )
    write_report(diagnosis, folder)
    write_files(diagnosis, folder)
