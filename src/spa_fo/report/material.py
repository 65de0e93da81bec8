"""Everything drawn of one material."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from spa_fo.identify import predict_trial
from spa_fo.identify.protocol import is_step
from spa_fo.identify.reproduction import Reproduction
from spa_fo.plant import Model
from spa_fo.report.ablation import ablation_figure
from spa_fo.report.comparison import MaterialComparison, step_panels
from spa_fo.report.figures import (
    LogPanel,
    Profile,
    calibration_figure,
    identifiability_figure,
    log_figure,
    step_figure,
)
from spa_fo.report.provenance import provenance_line
from spa_fo.report.style import save_figure
from spa_fo.rig import CampaignData, Trial


@dataclass(frozen=True)
class MaterialResults:
    """What the figures of one material are drawn from.

    Attributes
    ----------
    data : CampaignData
        The campaign.
    model : Model
        Its identified model.
    fit : Mapping
        As `FitResult.to_dict` returned it.
    comparison : Mapping or None
        As `Reproduction.to_dict` returned it; None where the campaign has no steps.
    ablation : pandas.DataFrame
        Rows of the ablation; empty where the campaign has no steps.
    design : str or None
        The paper's actuator.
    """

    data: CampaignData
    model: Model
    fit: Mapping[str, Any]
    comparison: Mapping[str, Any] | None
    ablation: pd.DataFrame
    design: str | None


def draw_material(results: MaterialResults, folder: Path) -> tuple[Path, ...]:
    """Draw every figure that the campaign allows, PDF and PNG each.

    Parameters
    ----------
    results : MaterialResults
        Of one material.
    folder : Path
        Where to.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    provenance = provenance_line(results.data.campaign.provenance)
    files: list[Path] = []
    for name, figure in _figures(results):
        files += save_figure(figure, folder / name, provenance)
    return tuple(files)


def _figures(results: MaterialResults) -> Iterator[tuple[str, Figure]]:
    data = results.data
    if data.calibration is not None:
        yield "calibration", calibration_figure(data.calibration, data.drifts)
    if results.comparison is not None:
        reproduction = Reproduction.from_dict(results.comparison)
        comparison = MaterialComparison(data.campaign.material, results.design, reproduction)
        yield "step_responses", step_figure(step_panels(comparison))
    yield "whole_logs", log_figure(log_panels(data, results.model), "model")
    uncertainty = results.fit["uncertainty"]
    if uncertainty is not None:
        yield "identifiability", identifiability_figure(profiles_of(results.fit))
    if len(results.ablation):
        yield "ablation", ablation_figure(results.ablation)


def log_panels(data: CampaignData, model: Model) -> list[LogPanel]:
    """Return the first trial of each experiment with its prediction, steps last."""
    first: dict[str, Trial] = {}
    for trial in data.trials:
        first.setdefault(trial.experiment, trial)
    ordered = sorted(first.values(), key=is_step)
    commanded = data.campaign.command_is_pressure
    return [
        LogPanel(
            title=trial.label,
            t_s=trial.t_s,
            measured_deg=trial.angle_deg,
            predicted_deg=predict_trial(model, trial),
            pressure_kpa=trial.command_kpa if commanded else trial.pressure_kpa,
        )
        for trial in ordered
    ]


def profiles_of(fit: Mapping[str, Any]) -> list[Profile]:
    """Return the profile likelihoods of a fit as `FitResult.to_dict` returned it."""
    return [_profile(entry) for entry in fit["uncertainty"]["profiles"]]


def _profile(entry: Mapping[str, Any]) -> Profile:
    return Profile(
        name=entry["name"],
        values=np.array(entry["values"]),
        rise=np.array(entry["rise"]),
        estimate=entry["estimate"],
        low=entry["low_95"],
        high=entry["high_95"],
        determined=entry["determined"],
    )
