"""Diagnose one share of the cases, after writing down which seals were there before."""

import sys
import time
from pathlib import Path

from blind.judge.attempt import attempt
from blind.judge.realised import judged_model
from blind.unseal import fingerprint
from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.gap import diagnose_campaign


def diagnose(case, out, seed):
    exclude = tuple((case / "exclude.txt").read_text(encoding="ascii").split())
    diagnose_campaign(case / "campaign", judged_model(case, out, seed), out, exclude, seed)


with workflow_step(snakemake.log[0], snakemake.threads):
    folder = Path(snakemake.output[0])
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "sealed_by.txt", fingerprint(Path(snakemake.input.seals[0])) + "\n")
    cases = sorted(Path(snakemake.input.cases).glob("case_*"))
    for number, case in enumerate(cases, start=1):
        out, begun = folder / case.name, time.monotonic()
        out.mkdir()
        _, message = attempt(case, diagnose, case, out, snakemake.params.seed)
        if message:
            write_text(out / "error.txt", f"{message}\n")
        done = f"{case.name}: {number} of {len(cases)} diagnosed, {time.monotonic() - begun:.0f} s"
        print(
            f"{snakemake.wildcards.batch}: {done} {message}".rstrip(), file=sys.stderr, flush=True
        )
