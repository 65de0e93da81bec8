"""The ablation as a table, a figure and sentences."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spa_fo.identify.ablation import ALL
from spa_fo.identify.ablation_verdict import nearest_datasets
from spa_fo.plant.estimates import QUANTITIES
from spa_fo.plant.paper import DATASETS, POINTS
from spa_fo.report.figures import QUANTITY_NAMES
from spa_fo.report.style import TWO_COLUMNS_IN, new_figure, styled
from spa_fo.report.tables import Table

_MARKERS = ("o", "s", "^", "D", "v", "x")
_LOSS_NAMES = {
    "linear": "least squares",
    "huber": "robust (Huber)",
    "soft_l1": "robust (soft L1)",
}


def ablation_table(ablations: Mapping[str, pd.DataFrame], provenance: str) -> Table:
    """Lay the ablations of several materials out as one table.

    Parameters
    ----------
    ablations : Mapping[str, pandas.DataFrame]
        Rows of `ablate` by material.
    provenance : str
        Where the data come from.
    """
    rows = pd.concat(
        [table.assign(material=label) for label, table in ablations.items()], ignore_index=True
    )
    columns = {
        "material": "material",
        "group": "experiment",
        "loss": "loss",
        "outliers": "outliers",
        "points": "points",
        "datasets": "datasets",
        "subsets": "subsets",
        "curve_spread_deg": "spread of the curve (°)",
        "theory_deg": "theory (°)",
        "left_out_mean_deg": "error on the mean left out (°)",
        "left_out_trials_deg": "error on trials left out (°)",
        "from_all_deg": "distance from the fit to all (°)",
        **{f"{name}_spread": f"spread of {name}" for name in QUANTITIES},
    }
    return Table(
        rows[list(columns)].rename(columns=columns),
        "Ablation: what more datasets and points buy, and what outliers cost",
        provenance,
        {
            "outliers": ".2f",
            **{name: ".3f" for name in columns.values() if name.endswith("(°)")},
            **{f"spread of {name}": ".3g" for name in QUANTITIES},
        },
    )


def verdict_lines(verdict: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the verdicts on the paper's two statements, a sentence or more each."""
    return (
        f"**“At least {DATASETS} datasets, {DATASETS * POINTS} points”**: {verdict['datasets']}",
        f"**“Sensitive to outliers”**: {verdict['outliers']}",
    )


@styled
def ablation_figure(table: pd.DataFrame) -> Figure:
    """Draw the ablation of one material.

    Parameters
    ----------
    table : pandas.DataFrame
        Rows of `ablate`.

    Returns
    -------
    matplotlib.figure.Figure
        (a) spread of the curve next to theory, (b) error on trials left out by points,
        (c) spread of the parameters, (d) outliers under both losses.
    """
    figure = new_figure(TWO_COLUMNS_IN, 5.2, [["curve", "left out"], ["parameters", "outliers"]])
    axes = {axis.get_label(): axis for axis in figure.axes}
    clean = table[(table["loss"] == "linear") & (table["outliers"] == 0)]
    together = ALL if (table["group"] == ALL).any() else str(table["group"].iloc[0])
    _curve_panel(axes["curve"], clean)
    _left_out_panel(axes["left out"], clean[clean["group"] == together])
    _parameter_panel(axes["parameters"], clean[clean["group"] == together])
    _outlier_panel(axes["outliers"], table[table["group"] == together])
    for axis in (axes["curve"], axes["left out"], axes["parameters"]):
        axis.axvline(DATASETS, color="#555555", linestyle=":", linewidth=0.8)
        axis.set_xlabel("datasets")
    return figure


def _curve_panel(axes: Axes, clean: pd.DataFrame) -> None:
    at_points = clean[clean["points"] == POINTS]
    apart = at_points[at_points["group"] != ALL].groupby("group")
    for (group, rows), marker in zip(apart, cycle(_MARKERS), strict=False):
        (line,) = axes.plot(
            rows["datasets"], rows["curve_spread_deg"], marker=marker, markersize=3, linestyle="-"
        )
        line.set_label(str(group))
        axes.plot(
            rows["datasets"],
            rows["theory_deg"],
            color=line.get_color(),
            linestyle="--",
            linewidth=0.9,
            label=f"{group}, theory",
        )
    axes.set_ylabel("spread of the curve (°)")
    axes.set_ylim(bottom=0)
    axes.set_title("(a) spread of the fitted curve", loc="left")
    axes.legend()


def _left_out_panel(axes: Axes, rows: pd.DataFrame) -> None:
    for (points, group), marker in zip(rows.groupby("points"), cycle(_MARKERS), strict=False):
        axes.plot(
            group["datasets"],
            group["left_out_mean_deg"],
            marker=marker,
            markersize=3,
            label=f"{points} points",
        )
    axes.set_ylabel("RMS error (°)")
    axes.set_ylim(bottom=0)
    axes.set_title("(b) error on the mean of the trials left out", loc="left")
    axes.legend(title="all experiments together" if (rows["group"] == ALL).all() else None)


def _parameter_panel(axes: Axes, rows: pd.DataFrame) -> None:
    chosen = rows[rows["points"] == POINTS]
    for name, marker in zip(QUANTITIES, _MARKERS, strict=True):
        share = 100.0 * chosen[f"{name}_spread"] / chosen[f"{name}_median"].abs()
        label = QUANTITY_NAMES[name]
        axes.plot(chosen["datasets"], share, marker=marker, markersize=3, label=label)
    axes.set_yscale("symlog", linthresh=0.1)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("spread (% of the value)")
    axes.set_title("(c) spread of the parameters", loc="left")
    axes.legend(ncols=2)


def _outlier_panel(axes: Axes, rows: pd.DataFrame) -> None:
    chosen = rows[rows["points"] == POINTS]
    datasets = nearest_datasets(chosen)
    chosen = chosen[chosen["datasets"] == datasets]
    losses = sorted(chosen["loss"].unique(), key=list(_LOSS_NAMES).index)
    for loss, marker in zip(losses, _MARKERS, strict=False):
        group = chosen[chosen["loss"] == loss].sort_values("outliers")
        axes.plot(
            100.0 * group["outliers"],
            group["from_all_deg"],
            marker=marker,
            markersize=3,
            label=_LOSS_NAMES[loss],
        )
    axes.set_xlabel("samples replaced by spikes (%)")
    axes.set_ylabel("distance from the fit to all (°)")
    axes.set_ylim(bottom=0)
    axes.set_title(f"(d) outliers, {datasets} datasets", loc="left")
    axes.legend()
