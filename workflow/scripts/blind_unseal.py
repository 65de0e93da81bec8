"""Every label, once it is clear that it is the one that was sealed."""

import json
from pathlib import Path

from blind.unseal import unseal
from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step

with workflow_step(snakemake.log[0], snakemake.threads):
    labels = unseal(
        Path(snakemake.input.seals[0]),
        [path for folder in snakemake.input.labels for path in Path(folder).glob("*.json")],
        [Path(folder) / "sealed_by.txt" for folder in snakemake.input.diagnoses],
    )
    write_text(snakemake.output[0], json.dumps(labels, indent=1, allow_nan=False) + "\n")
