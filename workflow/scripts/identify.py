"""The model of one material with its uncertainty, and the paper's comparison on its steps."""

import json

from spa_fo.atomic import write_text
from spa_fo.edge import workflow_step
from spa_fo.errors import BadInput
from spa_fo.identify import campaign_steps, fit_campaign, own_bounds
from spa_fo.identify.protocol import is_step
from spa_fo.identify.reproduction import Options, reproduce
from spa_fo.plant import write_model
from spa_fo.plant.paper import LUDWICK_EXPONENT
from spa_fo.rig import CampaignData, load_trials, read_campaign


def bounds_of(material):
    """The material's own bounds, None where it has none."""
    if "bounds" not in material:
        return None
    try:
        return own_bounds(material["bounds"])
    except ValueError as error:
        where = f"materials.{snakemake.wildcards.material}.bounds"
        raise BadInput("config.yaml", str(error), where) from error


with workflow_step(snakemake.log[0], snakemake.threads):
    campaign = read_campaign(snakemake.params.campaign)
    data = CampaignData(campaign, load_trials(snakemake.input.trials, campaign))
    material, options = snakemake.params.material, snakemake.params.options
    fit = fit_campaign(
        data,
        seed=snakemake.params.seed,
        signal=material.get("input"),
        points=options["points"],
        bootstrap=options["bootstrap"],
        bounds=bounds_of(material),
    )
    comparison, design = None, material.get("paper")
    if any(is_step(trial) for trial in data.trials):
        protocol = Options(
            datasets=options["datasets"],
            particles=options["swarm"]["particles"],
            iterations=options["swarm"]["iterations"],
            seeds=options["swarm_seeds"],
            design=design,
            ludwick_n=material.get("ludwick_n", LUDWICK_EXPONENT.get(design)),
        )
        steps = campaign_steps(data, options["points"])
        comparison = reproduce(steps, protocol, snakemake.params.seed).to_dict()
    write_model(snakemake.output.model, fit.model)
    write_text(snakemake.output.fit, json.dumps(fit.to_dict(), indent=1, allow_nan=False) + "\n")
    write_text(snakemake.output.report, fit.report() + "\n")
    write_text(snakemake.output.comparison, json.dumps(comparison, allow_nan=False) + "\n")
