"""What was answered against what is true."""

import json
from pathlib import Path

from blind.judge import (
    Outcome,
    read_answer,
    read_baselines,
    read_realised,
    read_truth,
    score,
)
from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step


def load(path):
    return json.loads(Path(path).read_text(encoding="utf-8"))


def outcomes(labels, folder, realised):
    """The outcomes of one batch of diagnoses."""
    for path in sorted(Path(folder).glob("case_*/diagnosis.json")):
        diagnosis, case = load(path), path.parent.name
        yield Outcome(
            truth=read_truth(labels[case], snakemake.input.labels[0]),
            answer=read_answer(diagnosis, path),
            baselines=read_baselines(diagnosis, path),
            realised=None if realised[case] is None else read_realised(realised[case], path),
        )


with workflow_step(snakemake.log[0], snakemake.threads):
    labels = load(snakemake.input.labels[0])
    judged = [
        outcome
        for folder, file in zip(snakemake.input.diagnoses, snakemake.input.realised, strict=True)
        for outcome in outcomes(labels, folder, load(file))
    ]
    document = score(judged).to_dict() | {"benchmark": dict(snakemake.params.plan)}
    write_text(snakemake.output[0], json.dumps(document, indent=1, allow_nan=False) + "\n")
