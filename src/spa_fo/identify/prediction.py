"""A model run on a campaign: the table behind ``spa-fo predict``."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from spa_fo.errors import BadInput
from spa_fo.plant.model_file import Model
from spa_fo.plant.predict import predict_deg
from spa_fo.rig import CampaignData, Trial


def predict_campaign(model: Model, data: CampaignData) -> pd.DataFrame:
    """Predict every valid sample of every trial.

    Parameters
    ----------
    model : Model
        A plain model.
    data : CampaignData
        The campaign, as read from its logs.

    Returns
    -------
    pandas.DataFrame
        Columns experiment, trial, t_s, angle_deg, predicted_deg; a row a sample.

    Raises
    ------
    BadInput
        A trial lacks the signal that drives the model.
    """
    tables = [
        pd.DataFrame(
            {
                "experiment": trial.experiment,
                "trial": trial.trial,
                "t_s": trial.t_s,
                "angle_deg": trial.angle_deg,
                "predicted_deg": predict_deg(model, trial.t_s, _drive(model, trial, data)),
            }
        )
        for trial in data.trials
    ]
    return pd.concat(tables, ignore_index=True)


def _drive(model: Model, trial: Trial, data: CampaignData) -> NDArray[np.float64]:
    pressure = trial.command_kpa if model.signal == "command" else trial.pressure_kpa
    if pressure is None:
        raise BadInput(
            data.campaign.yaml,
            f"the model is driven by the {model.signal}, which {trial.label} does not hold",
            "log.columns",
        )
    return pressure
