"""What changed in one material's campaign since its reference: document, page, figures, model."""

# From their own modules: `spa_fo.api` loads them late, and what they need would not be seen.
from spa_fo.api.campaign import Campaign
from spa_fo.api.model import Model
from spa_fo.edge import workflow_step

with workflow_step(snakemake.log[0], snakemake.threads):
    comparison = Campaign.load(snakemake.params.campaign).compare(
        snakemake.params.reference,
        model=Model.load(snakemake.input.model),
        seed=snakemake.params.seed,
    )
    comparison.save(snakemake.output[0])
