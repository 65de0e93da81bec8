"""Run an identified model on the trials of a campaign."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from spa_fo.errors import BadInput
from spa_fo.fractional import simulate
from spa_fo.identify.whole_log import HOLD, input_of
from spa_fo.plant import Model
from spa_fo.plant.augmented import is_augmented, predict_alone, predict_augmented
from spa_fo.plant.effects.own import use_effects_of
from spa_fo.plant.nominal_drive import drive_of
from spa_fo.plant.static_curve import curve_of
from spa_fo.rig import CampaignData, Trial

PREDICTION_COLUMNS = ("experiment", "trial", "t_s", "angle_deg", "predicted_deg")


def predict_trial(model: Model, trial: Trial) -> NDArray[np.float64]:
    """Predict the angle at every sample of a trial, at rest before it.

    An augmented model knows nothing of earlier trials here: the specimen is a virgin one.

    Returns
    -------
    numpy.ndarray
        Angles in degrees, shape (n,).

    Raises
    ------
    BadInput
        The trial's log does not hold the signal that drives the model, or an effect of the model
        is not what the library expects.
    """
    if input_of(trial, model.signal) is None:
        raise BadInput(trial.label, f"expected a {model.signal} column: it drives the model")
    if is_augmented(model):
        return predict_alone(model, trial)
    return _predict_plain(model, trial)


def predict_campaign(
    model: Model, data: CampaignData, source: Path | str = "model"
) -> pd.DataFrame:
    """Predict all trials: a row for every valid sample, columns `PREDICTION_COLUMNS`.

    An augmented model runs through the campaign in the order of its trials
    (`spa_fo.plant.augmented.predict_augmented`); the plain one starts each trial from rest.

    Parameters
    ----------
    model : Model
        Plain or augmented.
    data : CampaignData
        The campaign.
    source : Path or str
        The model's file, for messages.

    Raises
    ------
    BadInput
        A log does not hold the signal that drives the model, or an effect of the model is not
        what the library expects.
    """
    use_effects_of(data.campaign.folder)
    drive = drive_of(model, source)
    if drive is not None:
        data = drive.applied(data)
    for trial, (_, _, file) in zip(data.trials, data.campaign.trial_files(), strict=True):
        if input_of(trial, model.signal) is None:
            raise BadInput(file.path, f"expected a {model.signal} column: it drives the model")
    if is_augmented(model, source):
        angles = predict_augmented(model, data, source)
    else:
        angles = tuple(trial.zeroed(_predict_plain(model, trial)) for trial in data.trials)
    frames = [
        pd.DataFrame(
            {
                "experiment": trial.experiment,
                "trial": trial.trial,
                "t_s": trial.t_s,
                "angle_deg": trial.angle_deg,
                "predicted_deg": predicted,
            }
        )
        for trial, predicted in zip(data.trials, angles, strict=True)
    ]
    return pd.concat(frames, ignore_index=True)


def _predict_plain(model: Model, trial: Trial) -> NDArray[np.float64]:
    pressure = input_of(trial, model.signal)
    assert pressure is not None
    curve = curve_of(model)
    if curve is not None:
        return curve.predict(model, trial.t_s, pressure, HOLD[model.signal])
    g = model.transfer_function
    u = pressure / model.reference_kpa
    angle = simulate(trial.t_s, u, g.alpha2, g.alpha1, g.a1, g.a0, g.b0, hold=HOLD[model.signal])
    return np.asarray(np.degrees(angle))
