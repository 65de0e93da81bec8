"""Tables and figures of the blind benchmark."""

import json
from pathlib import Path

from blind.report.tables import publish
from spa_fo.edge import workflow_step

with workflow_step(snakemake.log[0], snakemake.threads):
    scores = json.loads(Path(snakemake.input[0]).read_text(encoding="utf-8"))
    publish(scores, Path(snakemake.output.table).parent)
