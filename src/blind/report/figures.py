"""The figures of the blind benchmark, from the plain data of its scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blind.report.words import PROTOCOL_NAMES, rig_name
from spa_fo.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    styled,
)

_KINDS = {
    "closed": ("effect in the library", BLUE, "o"),
    "further": ("effect beyond the contract's", ORANGE, "X"),
    "no_effect": ("no effect", GREY, "s"),
    "withheld": ("effect withheld", VERMILION, "v"),
    "alien": ("foreign effect", PURPLE, "^"),
    "pair": ("pair", GREEN, "D"),
    "several": ("three to five", SKY, "P"),
}
_CURVES = {
    "found": ("found", BLACK, "-"),
    "in_sets": ("truth in the sets", BLUE, "--"),
    "right_first": ("most probable is right", GREEN, "-."),
    "wrong_name": ("wrong confident name", VERMILION, ":"),
}
_SHRINK_LIMITS = (-0.6, 1.3)
_TOLERANCE = 0.1
_APART = 1.03  # so that the intervals of one size do not hide each other


@styled
def confusion_figure(confusions: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Figure:
    """Draw how often each truth got each first explanation; a column a rig, counts in the cells.

    Parameters
    ----------
    confusions : mapping of str to Mapping
        By rig and title: ``rows``, ``columns`` and ``counts``; titles without a case are left out.
    """
    titles = list(dict.fromkeys(title for own in confusions.values() for title in own))
    lengths = {
        title: max(len(own[title]["rows"]) for own in confusions.values()) for title in titles
    }
    shown = [title for title in titles if lengths[title]]
    heights = [1.0 + 0.12 * lengths[title] for title in shown]
    figure = Figure(figsize=(TWO_COLUMNS_IN, 0.5 + sum(heights)))
    panels = figure.subplots(
        max(len(shown), 1), max(len(confusions), 1), squeeze=False, height_ratios=heights or None
    )
    for column, (rig, own) in zip(panels.T, confusions.items(), strict=False):
        for axes, title in zip(column, shown, strict=False):
            _draw_confusion(axes, f"{rig_name(rig)}: {title}", own[title])
    return figure


def _draw_confusion(axes: Axes, title: str, entry: Mapping[str, Any]) -> None:
    counts = np.array(entry["counts"], dtype=float).reshape(-1, len(entry["columns"]))
    if not len(counts):
        axes.set_axis_off()
        return
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
            fontsize=4,
            ha="center",
            va="center",
        )
    axes.set_xticks(range(len(entry["columns"])), entry["columns"], rotation=90, fontsize=5)
    axes.set_yticks(range(len(entry["rows"])), entry["rows"], fontsize=5)
    axes.set_title(title, loc="left")
    axes.grid(visible=False)


@styled
def calibration_figure(calibrations: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Figure:
    """Draw how often the most probable explanation is right against its probability.

    Parameters
    ----------
    calibrations : mapping of str to Mapping
        By rig: ``all`` and by kind of case ``ece``, ``by_chance`` and ``bins``.
    """
    figure = new_figure(TWO_COLUMNS_IN, 2.7 * len(calibrations), _grid(calibrations, 2))
    for (every, kinds), (rig, own) in zip(_pairs(figure), calibrations.items(), strict=True):
        _draw_calibration(every, kinds, rig, own)
    return figure


def _grid(rigs: Mapping[str, Any], columns: int) -> list[list[str]]:
    return [[f"{rig} {column}" for column in range(columns)] for rig in rigs]


def _pairs(figure: Figure) -> list[tuple[Axes, Axes]]:
    return list(zip(figure.axes[::2], figure.axes[1::2], strict=True))


def _draw_calibration(
    every: Axes, kinds: Axes, rig: str, own: Mapping[str, Mapping[str, Any]]
) -> None:
    for axes in (every, kinds):
        axes.plot([0, 1], [0, 1], color=GREY, linestyle="-", linewidth=0.8)
        axes.set_xlabel("probability claimed")
        axes.set_xlim(0, 1.02)
        axes.set_ylim(-0.02, 1.02)
    every.set_ylabel("share that is right")
    whole = own["all"]
    if not whole["bins"]:
        return
    _draw_bins(every, whole["bins"], BLUE, "o", f"{whole['ece']['n']} cases")
    for entry in whole["bins"]:
        every.annotate(
            str(entry["right"]["n"]),
            (entry["claimed"], entry["right"]["value"]),
            xytext=(3, -8),
            textcoords="offset points",
            fontsize=6,
        )
    error = f"error {whole['ece']['value']:.3f}, {whole['by_chance']:.3f} by chance"
    every.set_title(f"{rig_name(rig)}: {error}", loc="left")
    for kind, (label, colour, marker) in _KINDS.items():
        if kind in own and own[kind]["bins"]:
            of_kind = f"{label}: {own[kind]['ece']['value']:.2f}"
            _draw_bins(kinds, own[kind]["bins"], colour, marker, of_kind)
    kinds.set_title("by kind of case, with the error of each", loc="left")
    _legend_beside(kinds, kinds)


def _legend_beside(axes: Axes, of: Axes) -> None:
    """Put the legend of some axes on the right of these, where no interval is."""
    labelled = of.get_legend_handles_labels()
    axes.legend(*labelled, loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=6)


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
def size_figure(arms: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    """Draw how the answers improve with the size of an effect of the library, by protocol.

    Parameters
    ----------
    arms : mapping of str to sequence of Mapping
        By rig: ``kind``, ``protocols``, ``size`` and ``scores`` of each arm.
    """
    figure = new_figure(TWO_COLUMNS_IN, 0.4 + 2.2 * len(arms), _grid(arms, 2))
    for pair, (rig, own) in zip(_pairs(figure), arms.items(), strict=True):
        for axes, (protocols, name) in zip(pair, PROTOCOL_NAMES.items(), strict=True):
            _draw_sizes(axes, [arm for arm in own if arm["protocols"] == protocols])
            axes.set_title(f"{rig_name(rig)}: {name}", loc="left")
        pair[0].set_ylabel("share of the cases")
    for axes in figure.axes[-2:]:
        axes.set_xlabel("size of the effect (multiples of the noise floor)")
    handles = {axes: axes.get_legend_handles_labels() for axes in figure.axes}
    most = max(handles.values(), key=lambda entry: len(entry[1]))
    figure.legend(*most, loc="outside upper center", ncols=len(_CURVES))
    return figure


def _draw_sizes(axes: Axes, arms: Sequence[Mapping[str, Any]]) -> None:
    own = [arm for arm in arms if arm["kind"] == "closed" and arm["size"] > 0]
    axes.set_ylim(-0.03, 1.03)
    if not own:
        return
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


@styled
def shrink_figure(points: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    """Draw the share of the gap that is closed: claimed, and on trials nobody has seen.

    Parameters
    ----------
    points : mapping of str to sequence of Mapping
        By rig: ``kind``, ``claimed``, ``low``, ``high``, ``realised`` and ``refit`` of each case.
    """
    figure = new_figure(TWO_COLUMNS_IN, 3.0 * len(points), _grid(points, 2))
    for (claims, refit), (rig, own) in zip(_pairs(figure), points.items(), strict=True):
        _draw_shrink(claims, refit, own)
        claims.set_title(f"{rig_name(rig)}: band of ±0.1", loc="left")
        refit.set_title("what the explanation adds to refitting", loc="left")
    return figure


def _draw_shrink(claims: Axes, refit: Axes, points: Sequence[Mapping[str, Any]]) -> None:
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
    refit.set_xlabel("fraction closed by refitting alone")
    if points:
        _legend_beside(refit, claims)
