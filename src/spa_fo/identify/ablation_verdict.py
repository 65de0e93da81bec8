"""What an ablation says of the paper's statements on datasets, points and outliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from spa_fo.identify.ablation import ALL
from spa_fo.plant.paper import DATASETS, POINTS
from spa_fo.plant.transfer_function import PARAMETERS


@dataclass(frozen=True)
class AblationVerdict:
    """What the ablation says of the paper's two statements, each in words and numbers.

    Attributes
    ----------
    datasets, outliers : str
        On "at least 4 datasets and 200 points", and on "sensitive to outliers".
    numbers : dict
        What the words rest on, by name.
    """

    datasets: str
    outliers: str
    numbers: dict[str, float]


_KNEE = 0.15
"""An exponent this near to that of 1/sqrt(n) is a plain average: there is no threshold."""
_HARM = 1.5
"""Outliers that move the curve by less than this times its own error do little harm."""


def ablation_verdict(table: pd.DataFrame) -> AblationVerdict:
    """Put the ablation in words.

    How errors fall with the number of datasets is judged within each experiment, where datasets
    differ by chance alone; outliers on all experiments together, as the paper mixes them.

    Parameters
    ----------
    table : pandas.DataFrame
        From `ablate`.
    """
    numbers: dict[str, float] = {}
    groups = [str(group) for group in table["group"].unique() if group != ALL]
    together = ALL if (table["group"] == ALL).any() else groups[0]
    clean = table[(table["loss"] == "linear") & (table["outliers"] == 0)]
    sentences = [_scaling(clean[clean["group"] == group], group, numbers) for group in groups]
    return AblationVerdict(
        datasets=" ".join([*sentences, _points_verdict(clean, together, numbers)]).strip(),
        outliers=_outliers_verdict(table[table["group"] == together], numbers),
        numbers=numbers,
    )


def nearest_datasets(rows: pd.DataFrame) -> int:
    """Return the number of datasets in `rows` that is nearest to the paper's."""
    sizes = rows["datasets"].unique()
    return int(sizes[np.argmin(np.abs(sizes - DATASETS))])


def _scaling(clean: pd.DataFrame, group: str, numbers: dict[str, float]) -> str:
    """Say how curve and parameters depend on the number of datasets of one experiment."""
    rows = clean[(clean["points"] == POINTS) & clean["curve_spread_deg"].notna()]
    if len(rows) < 2:
        return f"{group}: too few trials to tell."
    four = nearest_datasets(rows)
    rows = rows.set_index("datasets").sort_index()
    n = rows.index.to_numpy(dtype=float)
    last = int(n[-1])
    curve = rows["curve_spread_deg"]
    exponent = float(np.polyfit(np.log(n), np.log(curve), 1)[0])
    share = {
        name: 100.0 * rows[f"{name}_spread"] / rows[f"{name}_median"].abs() for name in PARAMETERS
    }
    widest = max(share, key=lambda name: float(share[name].loc[four]))
    drift = share[widest]
    numbers |= {
        f"{group}.exponent": exponent,
        f"{group}.curve_spread_deg_1": float(curve.iloc[0]),
        f"{group}.curve_spread_deg_{four}": float(curve.loc[four]),
        f"{group}.curve_spread_deg_{last}": float(curve.iloc[-1]),
        f"{group}.theory_deg_{four}": float(rows["theory_deg"].loc[four]),
        f"{group}.{widest}_spread_percent_1": float(drift.iloc[0]),
        f"{group}.{widest}_spread_percent_{four}": float(drift.loc[four]),
        f"{group}.{widest}_spread_percent_{last}": float(drift.iloc[-1]),
    }
    knee = (
        "like 1/sqrt(n), so that four is no threshold"
        if abs(exponent + 0.5) < _KNEE
        else "not like 1/sqrt(n)"
    )
    return (
        f"{group}: the curve's error falls as n^{exponent:.2f}, {knee} ({curve.iloc[0]:.2f}° with "
        f"1 dataset, {curve.loc[four]:.2f}° with {four}, where theory says "
        f"{rows['theory_deg'].loc[four]:.2f}°, {curve.iloc[-1]:.2f}° with {last}); the most "
        f"uncertain parameter, {widest}, varies by {drift.iloc[0]:.0f} %, {drift.loc[four]:.0f} % "
        f"and {drift.iloc[-1]:.0f} %."
    )


def _points_verdict(clean: pd.DataFrame, group: str, numbers: dict[str, float]) -> str:
    """Say what more points buy at the paper's number of datasets, and what four datasets do."""
    rows = clean[clean["group"] == group]
    four = nearest_datasets(rows)
    rows = rows[rows["datasets"] == four].set_index("points").sort_index()
    left_out = float(rows["left_out_mean_deg"].iloc[-1])
    rows = rows[rows["curve_spread_deg"].notna()]
    sentences = []
    if len(rows) > 1:
        few, many = int(rows.index[0]), int(rows.index[-1])
        coarse, fine = (float(rows["curve_spread_deg"].iloc[i]) for i in (0, -1))
        numbers |= {
            f"curve_spread_deg_{few}_points": coarse,
            f"curve_spread_deg_{many}_points": fine,
        }
        # Independent noise would fall by sqrt(many / few): at least half of that, as a power?
        averages = coarse / fine >= (many / few) ** 0.25
        sentences.append(
            f"With {four} datasets {few} points each give {coarse:.2f}°, {many} points "
            f"{fine:.2f}°: "
            + (
                "more points average the noise."
                if averages
                else "trials differ among themselves by more than points can average."
            )
        )
    if np.isfinite(left_out):
        numbers["left_out_mean_deg"] = left_out
        sentences.append(f"Against the mean of trials left out the error is {left_out:.2f}°.")
    return " ".join(sentences)


def _outliers_verdict(rows: pd.DataFrame, numbers: dict[str, float]) -> str:
    chosen = rows[rows["points"] == POINTS]
    if chosen["outliers"].max() == 0:
        return "Outliers were not tried."
    four = nearest_datasets(chosen)
    chosen = chosen[chosen["datasets"] == four]
    worst = float(chosen["outliers"].max())
    error = {
        (str(loss), float(outliers)): float(value)
        for loss, outliers, value in zip(
            chosen["loss"], chosen["outliers"], chosen["from_all_deg"], strict=True
        )
    }
    losses = sorted({loss for loss, _ in error}, key=lambda loss: loss != "linear")
    parts = []
    for loss in losses:
        clean, spoilt = error[loss, 0.0], error[loss, worst]
        numbers[f"{loss}.from_all_deg_clean"] = clean
        numbers[f"{loss}.from_all_deg_outliers"] = spoilt
        name = "least squares" if loss == "linear" else f"the robust loss {loss}"
        parts.append(f"from {clean:.2f}° to {spoilt:.2f}° by {name}")
    # Beside what the trials' own scatter does to the curve: a fit to all of them moves by nothing.
    scatter = max(error[losses[0], 0.0], float(chosen["theory_deg"].iloc[0]), 1e-9)
    harm = error[losses[0], worst] / scatter
    numbers["outlier_harm"] = harm
    word = "Confirmed" if harm >= _HARM else "Not confirmed here"
    return (
        f"{word}: with spikes in {100 * worst:.0f} % of the samples of {four} datasets the "
        f"curve's distance from the fit to all clean trials grows {', '.join(parts)}."
    )
