"""Run an identified model on the trials of a campaign."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from spa_fo.errors import BadInput
from spa_fo.fractional import simulate
from spa_fo.identify.whole_log import HOLD, input_of
from spa_fo.plant import Model
from spa_fo.rig import CampaignData, Trial

PREDICTION_COLUMNS = ("experiment", "trial", "t_s", "angle_deg", "predicted_deg")


def predict_trial(model: Model, trial: Trial) -> NDArray[np.float64]:
    """Predict the angle at every sample of a trial, at rest before it.

    Returns
    -------
    numpy.ndarray
        Angles in degrees, shape (n,).

    Raises
    ------
    BadInput
        The trial's log does not hold the signal that drives the model.
    """
    pressure = input_of(trial, model.signal)
    if pressure is None:
        raise BadInput(trial.label, f"expected a {model.signal} column: it drives the model")
    g = model.transfer_function
    u = pressure / model.reference_kpa
    angle = simulate(trial.t_s, u, g.alpha2, g.alpha1, g.a1, g.a0, g.b0, hold=HOLD[model.signal])
    return np.asarray(np.degrees(angle))


def predict_campaign(model: Model, data: CampaignData) -> pd.DataFrame:
    """Predict all trials: a row for every valid sample, columns `PREDICTION_COLUMNS`.

    Raises
    ------
    BadInput
        A log does not hold the signal that drives the model.
    """
    for trial, (_, _, file) in zip(data.trials, data.campaign.trial_files(), strict=True):
        if input_of(trial, model.signal) is None:
            raise BadInput(file.path, f"expected a {model.signal} column: it drives the model")
    frames = [
        pd.DataFrame(
            {
                "experiment": trial.experiment,
                "trial": trial.trial,
                "t_s": trial.t_s,
                "angle_deg": trial.angle_deg,
                "predicted_deg": predict_trial(model, trial),
            }
        )
        for trial in data.trials
    ]
    return pd.concat(frames, ignore_index=True)
