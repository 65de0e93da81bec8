"""What surroundings do to the diagnosis: alarms, `unknown` and wrong names, rig by rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blind.judge.classes import DIMENSIONS
from blind.judge.targets import FALSE_ALARMS, UNKNOWN_RATE, WRONG_NAMES, Target
from blind.report.words import rig_name
from spa_fo.report.style import BLUE, GREY, TWO_COLUMNS_IN, VERMILION, new_figure, styled

_MARKS = {
    "false alarms\nwithout an effect": FALSE_ALARMS,
    "unknown, large effects\nof the library": UNKNOWN_RATE,
    "wrong confident names,\neffects of the library": WRONG_NAMES,
}
_SHOWN = ("noise colour", "scatter of gain", "fixture error")
_LABELS = {
    "noise colour": "coloured noise: correlation time",
    "scatter of gain": "scatter of gain between trials",
    "fixture error": "error of the calibration's angles",
}
_LOOKS = ((BLUE, "o"), (VERMILION, "s"))
_APART = 0.16


@styled
def surroundings_figure(classes: Sequence[Mapping[str, Any]], rigs: Sequence[str]) -> Figure:
    """Draw three marks over three dimensions of the surroundings, with intervals.

    Parameters
    ----------
    classes : sequence of Mapping
        ``rig``, ``name`` of the mark, ``dimension``, ``class`` and ``estimate`` of each.
    rigs : sequence of str
        In the order of the legend.
    """
    shown = [dimension for dimension in DIMENSIONS if dimension.name in _SHOWN]
    names = [[f"{row} {entry.name}" for entry in shown] for row in _MARKS]
    figure = new_figure(TWO_COLUMNS_IN, 6.0, names)
    panels = np.array(figure.axes).reshape(len(_MARKS), len(shown))
    for row, (label, target) in zip(panels, _MARKS.items(), strict=True):
        for axes, dimension in zip(row, shown, strict=True):
            own = [
                entry
                for entry in classes
                if entry["name"] == target.name and entry["dimension"] == dimension.name
            ]
            _draw(axes, own, target, dimension.classes, rigs)
            axes.set_ylim(*_limits(classes, target))
        row[0].set_ylabel(label)
    for axes, dimension in zip(panels[-1], shown, strict=True):
        axes.set_xlabel(_LABELS[dimension.name])
    for axes in panels[:-1].flat:
        axes.tick_params(labelbottom=False)
    figure.align_labels()
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _limits(classes: Sequence[Mapping[str, Any]], target: Target) -> tuple[float, float]:
    """Give one row's limits: the largest interval that is shown, and room for the goal."""
    highest = [
        entry["estimate"]["high"]
        for entry in classes
        if entry["name"] == target.name and entry["dimension"] in _SHOWN
    ]
    top = min(1.05 * max([2.0 * target.goal, *highest]), 1.0)
    return -0.03 * top, 1.03 * top


def _draw(
    axes: Axes,
    entries: Sequence[Mapping[str, Any]],
    target: Target,
    classes: Sequence[str],
    rigs: Sequence[str],
) -> None:
    axes.axhline(target.goal, color=GREY, linestyle="--", linewidth=0.8, label="goal over all")
    for i, rig in enumerate(rigs):
        own = {entry["class"]: entry["estimate"] for entry in entries if entry["rig"] == rig}
        at = np.array([classes.index(name) for name in own]) + _APART * (i - (len(rigs) - 1) / 2)
        value = np.array([estimate["value"] for estimate in own.values()])
        ends = np.array([[e["low"], e["high"]] for e in own.values()]).reshape(-1, 2).T
        colour, marker = _LOOKS[i % len(_LOOKS)]
        axes.errorbar(
            at,
            value,
            np.abs(ends - value),
            color=colour,
            marker=marker,
            linestyle="none",
            markersize=3,
            elinewidth=0.7,
            label=rig_name(rig),
        )
    axes.set_xticks(range(len(classes)), classes, rotation=30, ha="right", fontsize=6)
    axes.set_xlim(-0.5, len(classes) - 0.5)
