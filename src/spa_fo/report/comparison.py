"""Table I and the table of RMS errors: the paper's numbers beside those found here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from spa_fo.identify.reproduction import ExperimentMean, ModelResult, Reproduction
from spa_fo.plant import PARAMETERS, paper
from spa_fo.report.figures import Curve, StepPanel
from spa_fo.report.tables import Table

# Which curves stand in Figs. 4 and 5, in this order; the first that is there of each line.
_DRAWN = (
    ("swarm", "widened"),
    ("optimum", "free"),
    ("literature per setpoint", ""),
    ("refitted", ""),
)


@dataclass(frozen=True)
class MaterialComparison:
    """One material's reproduction with its label and the paper's design, if any."""

    label: str
    design: str | None
    reproduction: Reproduction


def parameter_table(materials: Sequence[MaterialComparison], provenance: str) -> Table:
    """Lay out Table I: identified parameters, a row a model, the paper's own among them."""
    rows = [
        {
            "material": material.label,
            "model": model.name,
            "datasets": model.datasets or None,
            **{name: model.parameters[name] for name in PARAMETERS},
            "b0/a0": model.parameters["b0"] / model.parameters["a0"],
            "RMSE of the fit (°)": model.fit_rmse_deg,
            "at bounds": ", ".join(model.at_bounds),
        }
        for material in materials
        for model in material.reproduction.models
        if model.kind == "fractional"
    ]
    decimals = dict.fromkeys([*PARAMETERS, "b0/a0", "RMSE of the fit (°)"], ".3f")
    return Table(
        pd.DataFrame(rows),
        "Table I: identified parameters of the fractional-order model, as printed and found here",
        provenance,
        {**decimals, "datasets": ".0f"},
    )


def baseline_table(materials: Sequence[MaterialComparison], provenance: str) -> Table:
    """Lay out the parameters of the baselines."""
    rows = [
        {"material": material.label, "model": model.name, "parameter": name, "value": value}
        for material in materials
        for model in material.reproduction.models
        if model.kind != "fractional"
        for name, value in model.parameters.items()
    ]
    return Table(
        pd.DataFrame(rows),
        "Parameters of the baselines (SI units, angles in rad)",
        provenance,
        {"value": ".4g"},
    )


def rms_table(materials: Sequence[MaterialComparison], provenance: str) -> Table:
    """Lay out the RMS errors against the averaged responses, here and in the paper."""
    rows = [row for material in materials for row in _rms_rows(material)]
    return Table(
        pd.DataFrame(rows),
        "RMS errors against the averaged step responses: every model here, and the paper's",
        provenance,
        {
            "setpoint (°)": ".0f",
            "here (°)": ".2f",
            "here (%)": ".2f",
            "paper (°)": ".2f",
            "paper (%)": ".2f",
        },
    )


def _rms_rows(material: MaterialComparison) -> Iterator[Mapping[str, Any]]:
    for experiment in material.reproduction.experiments:
        setpoint = experiment.setpoint_deg
        for model in material.reproduction.models:
            rms = model.rms_deg[experiment.name]
            printed = _printed(material.design, setpoint, model)
            yield {
                "material": material.label,
                "experiment": experiment.name,
                "setpoint (°)": setpoint,
                "model": model.name,
                "here (°)": rms,
                "here (%)": None if setpoint is None else 100.0 * rms / setpoint,
                "paper (°)": None if printed is None else printed.rms_deg,
                "paper (%)": None if printed is None else printed.percent,
            }


def _printed(
    design: str | None, setpoint: float | None, model: ModelResult
) -> paper.PrintedError | None:
    """Return what the paper prints for the model that stands for its own."""
    if design is None or setpoint is None:
        return None
    if model.source == "swarm" and model.bounds == "widened":
        return paper.RMS_ERRORS.get((design, setpoint, "fractional"))
    if model.source.startswith("literature"):
        return paper.RMS_ERRORS.get((design, setpoint, "nonlinear"))
    return None


def step_panels(material: MaterialComparison) -> tuple[StepPanel, ...]:
    """Return the panels of Figs. 4 and 5: trials, their mean, and the models."""
    reproduction = material.reproduction
    t_s = np.array(reproduction.t_s)
    chosen = [
        next((m for m in reproduction.models if (m.source, m.bounds) == key), None)
        for key in _DRAWN
    ]
    return tuple(
        StepPanel(
            title=_title(material, experiment),
            setpoint_deg=experiment.setpoint_deg,
            t_s=t_s[1:],
            trials_deg=np.array(experiment.trials_deg),
            curves=tuple(
                Curve(
                    _short(model),
                    t_s,
                    np.array(model.curves_deg[experiment.name]),
                    model.rms_deg[experiment.name],
                )
                for model in chosen
                if model is not None
            ),
        )
        for experiment in reproduction.experiments
    )


def _short(model: ModelResult) -> str:
    return f"fractional, {model.name}" if model.kind == "fractional" else model.name


def _title(material: MaterialComparison, experiment: ExperimentMean) -> str:
    place = experiment.name if experiment.setpoint_deg is None else f"{experiment.setpoint_deg:g}°"
    return f"{material.label}, {place}"
