"""Errors of the plain, the augmented and the refitted model on each claim's unseen trials."""

import json
from dataclasses import asdict
from pathlib import Path

from blind.judge.attempt import attempt
from blind.judge.realised import realise
from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step


def of_case(case, out, seed):
    """The errors, or why there are none: as where the sensor left its range; or no claim at all."""
    if (out / "error.txt").is_file():
        return {"error": "there is no diagnosis"}
    found, message = attempt(case, realise, case, out, seed)
    return {"error": message} if message else found and asdict(found)


with workflow_step(snakemake.log[0], snakemake.threads):
    cases, diagnoses = Path(snakemake.input.cases), Path(snakemake.input.diagnoses[0])
    realised = {
        case.name: of_case(case, diagnoses / case.name, snakemake.params.seed)
        for case in sorted(cases.glob("case_*"))
    }
    write_text(snakemake.output[0], json.dumps(realised, indent=1, allow_nan=False) + "\n")
