"""Errors of the plain, the augmented and the refitted model on the unseen trials of each case."""

import json
import logging
from dataclasses import asdict
from pathlib import Path

from blind.judge.realised import realise
from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.errors import BadInput


def judged_model(case, out):
    given = case / "model.json"
    return given if given.is_file() else out / "model.json"


def of_case(case, out, seed):
    """The errors; None where the unseen trials are refused, as when the sensor left its range."""
    try:
        return asdict(realise(case, judged_model(case, out), out / "augmented_model.json", seed))
    except BadInput as error:
        logging.warning("%s: %s", case.name, error)
        return None


with workflow_step(snakemake.log[0], snakemake.threads):
    cases, diagnoses = Path(snakemake.input.cases), Path(snakemake.input.diagnoses[0])
    realised = {
        case.name: of_case(case, diagnoses / case.name, snakemake.params.seed)
        for case in sorted(cases.glob("case_*"))
    }
    write_text(snakemake.output[0], json.dumps(realised, indent=1, allow_nan=False) + "\n")
