"""Whether a model and a campaign belong together."""

from __future__ import annotations

from spa_fo.plant.model_file import Model
from spa_fo.rig import Campaign

_FACTOR = 3.0  # between two reference pressures of one actuator


def strangers(model: Model, campaign: Campaign) -> str | None:
    """Say in one line how a model and a campaign differ in what they are of, or return None.

    A campaign that continues the model's own is the same actuator's.

    Parameters
    ----------
    model : Model
        Of any campaign.
    campaign : Campaign
        What it is applied to.
    """
    differ = []
    if model.campaign not in (campaign.name, campaign.continues):
        differ.append(f"is of campaign '{model.campaign}', this is '{campaign.name}'")
    if model.material != campaign.material:
        differ.append(f"is of {model.material}, this is {campaign.material}")
    ratio = campaign.reference_kpa / model.reference_kpa
    if not 1.0 / _FACTOR < ratio < _FACTOR:
        differ.append(
            f"has reference_kpa {model.reference_kpa:g}, this campaign {campaign.reference_kpa:g}"
        )
    return f"the model {'; it '.join(differ)}" if differ else None
