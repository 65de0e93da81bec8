"""The figures of the blind benchmark, from the plain data of its scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spa_fo.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    SKY,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    styled,
)

_KINDS = {
    "closed": ("effect in the library", BLUE, "o"),
    "no_effect": ("no effect", GREY, "s"),
    "withheld": ("effect withheld", VERMILION, "v"),
    "alien": ("foreign effect", PURPLE, "^"),
    "pair": ("pair", GREEN, "D"),
}
_CURVES = {
    "found": ("found", BLACK, "-"),
    "in_sets": ("truth in the sets", BLUE, "--"),
    "right_first": ("most probable is right", GREEN, "-."),
    "wrong_name": ("wrong confident name", VERMILION, ":"),
}
_PROTOCOLS = {"rich": "rich protocol", "up_steps": "up-steps alone"}
_SHRINK_LIMITS = (-0.6, 1.3)
_TOLERANCE = 0.1
_APART = 1.03  # so that the intervals of one size do not hide each other


@styled
def confusion_figure(confusions: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Draw how often each truth got each first explanation; a panel a group, counts in the cells.

    Parameters
    ----------
    confusions : mapping of str to Mapping
        By title: ``rows``, ``columns`` and ``counts``; groups without a case are left out.
    """
    shown = {title: entry for title, entry in confusions.items() if entry["rows"]}
    heights = [1.0 + 0.13 * len(entry["rows"]) for entry in shown.values()]
    figure = Figure(figsize=(TWO_COLUMNS_IN, 0.5 + sum(heights)))
    panels = figure.subplots(max(len(shown), 1), 1, squeeze=False, height_ratios=heights or None)
    for axes, (title, entry) in zip(panels[:, 0], shown.items(), strict=False):
        _draw_confusion(axes, title, entry)
    return figure


def _draw_confusion(axes: Axes, title: str, entry: Mapping[str, Any]) -> None:
    counts = np.array(entry["counts"], dtype=float)
    axes.imshow(
        counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0),
        cmap="Blues",
        vmin=0.0,
        vmax=1.0,
        aspect="auto",
    )
    for row, column in np.argwhere(counts > 0):
        share = counts[row, column] / counts[row].sum()
        colour = "white" if share > 0.6 else BLACK
        axes.text(
            column,
            row,
            f"{counts[row, column]:.0f}",
            color=colour,
            fontsize=5,
            ha="center",
            va="center",
        )
    axes.set_xticks(range(len(entry["columns"])), entry["columns"], rotation=90, fontsize=5)
    axes.set_yticks(range(len(entry["rows"])), entry["rows"], fontsize=5)
    axes.set_title(f"{title}: truth (rows), most probable explanation (columns)", loc="left")
    axes.grid(visible=False)


@styled
def calibration_figure(calibrations: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Draw how often the most probable explanation is right against its probability.

    Parameters
    ----------
    calibrations : mapping of str to Mapping
        ``all`` and by kind of case: ``ece``, ``by_chance`` and ``bins``.
    """
    figure = new_figure(TWO_COLUMNS_IN, 3.0, [["all", "kinds"]])
    every, kinds = figure.axes
    for axes in (every, kinds):
        axes.plot([0, 1], [0, 1], color=GREY, linestyle="-", linewidth=0.8)
        axes.set_xlabel("probability claimed")
        axes.set_xlim(0, 1.02)
        axes.set_ylim(-0.02, 1.02)
    whole = calibrations["all"]
    _draw_bins(every, whole["bins"], BLUE, "o", f"{whole['ece']['n']} cases")
    for entry in whole["bins"]:
        every.annotate(
            str(entry["right"]["n"]),
            (entry["claimed"], entry["right"]["value"]),
            xytext=(3, -8),
            textcoords="offset points",
            fontsize=6,
        )
    every.set_ylabel("share that is right")
    every.set_title(
        f"(a) calibration error {whole['ece']['value']:.3f}, {whole['by_chance']:.3f} by chance",
        loc="left",
    )
    for kind, (label, colour, marker) in _KINDS.items():
        if kind in calibrations:
            error = calibrations[kind]["ece"]["value"]
            _draw_bins(kinds, calibrations[kind]["bins"], colour, marker, f"{label}: {error:.2f}")
    kinds.set_title("(b) by kind of case, with the error of each", loc="left")
    kinds.legend(loc="best", fontsize=6)
    return figure


def _draw_bins(
    axes: Axes, bins: Sequence[Mapping[str, Any]], colour: str, marker: str, label: str
) -> None:
    claimed = [entry["claimed"] for entry in bins]
    _draw_rates(
        axes,
        claimed,
        [entry["right"] for entry in bins],
        color=colour,
        marker=marker,
        linestyle="-",
        label=label,
    )


def _draw_rates(
    axes: Axes, at: Sequence[float], rates: Sequence[Mapping[str, float]], **look: Any
) -> None:
    """Draw rates with their intervals."""
    value = np.array([rate["value"] for rate in rates])
    ends = np.array([[rate["low"], rate["high"]] for rate in rates]).T
    axes.errorbar(
        at, value, np.abs(ends - value), markersize=3, linewidth=1.0, elinewidth=0.6, **look
    )


@styled
def size_figure(arms: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw how the answers improve with the size of an effect of the library, by protocol.

    Parameters
    ----------
    arms : sequence of Mapping
        ``kind``, ``protocol``, ``size`` and ``scores`` of each.
    """
    closed = [arm for arm in arms if arm["kind"] == "closed"]
    protocols = list(dict.fromkeys(arm["protocol"] for arm in closed)) or ["rich"]
    figure = new_figure(TWO_COLUMNS_IN, 2.8, [protocols])
    for axes, protocol in zip(figure.axes, protocols, strict=True):
        own = [arm for arm in closed if arm["protocol"] == protocol and arm["size"] > 0]
        for i, (key, (label, colour, line)) in enumerate(_CURVES.items()):
            _draw_rates(
                axes,
                [arm["size"] * _APART**i for arm in own],
                [arm["scores"][key] for arm in own],
                color=colour,
                linestyle=line,
                marker=".",
                label=label,
            )
        sizes = sorted({arm["size"] for arm in own})
        axes.set_xscale("log", base=2)
        axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
        axes.set_xlabel("size of the effect (multiples of the noise floor)")
        axes.set_title(
            {"rich": "rich protocol", "up_steps": "up-steps alone"}[protocol], loc="left"
        )
        axes.set_ylim(-0.03, 1.03)
    figure.axes[0].set_ylabel("share of the cases")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(_CURVES))
    return figure


@styled
def shrink_figure(points: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the share of the gap that is closed: claimed, and on trials nobody has seen.

    Parameters
    ----------
    points : sequence of Mapping
        ``kind``, ``claimed``, ``low``, ``high``, ``realised`` and ``refit`` of each case.
    """
    figure = new_figure(TWO_COLUMNS_IN, 3.2, [["claims", "refit"]])
    claims, refit = figure.axes
    line = np.array(_SHRINK_LIMITS)
    claims.fill_between(
        line, line - _TOLERANCE, line + _TOLERANCE, color=SKY, alpha=0.3, linewidth=0
    )
    for axes in (claims, refit):
        axes.plot(line, line, color=GREY, linestyle="-", linewidth=0.8)
        axes.set_xlim(*_SHRINK_LIMITS)
        axes.set_ylim(*_SHRINK_LIMITS)
        axes.set_ylabel("realised on unseen trials")
    for kind, (label, colour, marker) in _KINDS.items():
        own = [point for point in points if point["kind"] == kind]
        if not own:
            continue
        look: dict[str, Any] = {
            "color": colour,
            "marker": marker,
            "linestyle": "none",
            "markersize": 2.5,
            "label": label,
        }
        realised = np.clip([point["realised"] for point in own], *_SHRINK_LIMITS)
        claimed = np.clip([point["claimed"] for point in own], *_SHRINK_LIMITS)
        ends = np.clip([[point["low"], point["high"]] for point in own], *_SHRINK_LIMITS).T
        claims.errorbar(claimed, realised, xerr=np.abs(ends - claimed), elinewidth=0.4, **look)
        refit.plot(np.clip([point["refit"] for point in own], *_SHRINK_LIMITS), realised, **look)
    claims.set_xlabel("claimed fraction closed, 95 % interval")
    claims.set_title("(a) claimed against realised, band of ±0.1", loc="left")
    refit.set_xlabel("fraction closed by refitting alone")
    refit.set_title("(b) what the explanation adds to refitting", loc="left")
    if points:
        claims.legend(loc="upper left", fontsize=6)
    return figure
