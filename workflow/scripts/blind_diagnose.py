"""Diagnose one share of the cases, after writing down which seals were there before."""

from pathlib import Path

from blind.judge.realised import campaign_data, fitted_model
from blind.unseal import fingerprint
from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.gap import diagnose_campaign
from spa_fo.plant import write_model


def judged_model(case, out):
    """The model that the case hands out, or the campaign's own where it hands out none."""
    given = case / "model.json"
    if given.is_file():
        return given
    own = out / "model.json"
    write_model(own, fitted_model(campaign_data(case / "campaign"), snakemake.params.seed))
    return own


with workflow_step(snakemake.log[0], snakemake.threads):
    folder = Path(snakemake.output[0])
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "sealed_by.txt", fingerprint(Path(snakemake.input.seals[0])) + "\n")
    for case in sorted(Path(snakemake.input.cases).glob("case_*")):
        out = folder / case.name
        out.mkdir()
        exclude = tuple((case / "exclude.txt").read_text(encoding="ascii").split())
        model = judged_model(case, out)
        diagnose_campaign(case / "campaign", model, out, exclude, snakemake.params.seed)
