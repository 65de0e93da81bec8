"""One share of the blind benchmark's cases; every batch has its own file of seals."""

import sys
from pathlib import Path

from blind import first_rig, second_rig  # noqa: F401 -- so an edit of a rig makes cases again
from blind.plan import plan_cases
from blind.writer import write_cases
from spa_fo.edge import workflow_step
from spa_fo.errors import BadInput


def say(line):
    print(f"{snakemake.wildcards.batch}: {line}", file=sys.stderr, flush=True)


with workflow_step(snakemake.log[0], snakemake.threads):
    plan = dict(snakemake.params.plan)
    batches = plan.pop("batches")
    try:
        cases = plan_cases(plan)
    except ValueError as error:
        raise BadInput("config.yaml", str(error), "blind") from error
    folder, labels = Path(snakemake.output.cases), Path(snakemake.output.labels)
    folder.mkdir(parents=True, exist_ok=True)
    labels.mkdir(parents=True, exist_ok=True)
    write_cases(cases[snakemake.params.share :: batches], folder, labels, say)
