"""What changed in one material's campaign since its reference: document, page, figures, model.

Where one of the two holds no angle, by command and pressure alone.
"""

# From their own modules: `spa_fo.api` loads them late, and what they need would not be seen.
from spa_fo.api.campaign import Campaign
from spa_fo.api.comparison import Comparison
from spa_fo.api.model import Model
from spa_fo.edge import workflow_step

with workflow_step(snakemake.log[0], snakemake.threads):
    given = snakemake.params
    if given.compared == "pressure":
        comparison = Comparison.of_pressure(given.reference, given.campaign, seed=given.seed)
    else:
        comparison = Campaign.load(given.campaign).compare(
            given.reference, model=Model.load(snakemake.input.model), seed=given.seed
        )
    comparison.save(snakemake.output[0])
