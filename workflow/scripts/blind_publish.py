"""Tables and figures of the blind benchmark."""

import json
from pathlib import Path

from spa_fo.edge import workflow_step
from spa_fo.report.blind import publish

with workflow_step(snakemake.log[0], snakemake.threads):
    scores = json.loads(Path(snakemake.input[0]).read_text(encoding="utf-8"))
    publish(scores, Path(snakemake.output.table).parent)
