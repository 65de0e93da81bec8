"""What was answered against what is true."""

import json
from pathlib import Path

from blind.judge import outcomes, score
from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step


def load(path):
    return json.loads(Path(path).read_text(encoding="utf-8"))


with workflow_step(snakemake.log[0], snakemake.threads):
    source = Path(snakemake.input.labels[0])
    files = zip(snakemake.input.diagnoses, snakemake.input.realised, strict=True)
    batches = [(Path(folder), load(realised)) for folder, realised in files]
    scores = score(outcomes(load(source), batches, source)).to_dict()
    document = scores | {"benchmark": dict(snakemake.params.plan)}
    write_text(snakemake.output[0], json.dumps(document, indent=1, allow_nan=False) + "\n")
