"""The figures of a diagnosis: the gap and its shares, before and after, the explanations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, FigureBase

from spa_fo.arrays import Floats
from spa_fo.gap.diagnosis import Diagnosis, Traces
from spa_fo.report.causes import MOST_CAUSES, named, percent, plain_held_out, probability_of
from spa_fo.report.effect_words import MAP_WORDS, bin_words, phrase
from spa_fo.report.experiments import (
    Experiment,
    driving,
    experiments,
    has_command,
    mean_over_trials,
    rms,
)
from spa_fo.report.share_maps import share_maps
from spa_fo.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    styled,
)

_COLUMNS = 3
_LABEL_WIDTH = 44  # characters
LOOKS: dict[str, dict[str, Any]] = {
    "plain": {"color": BLUE, "linestyle": "--", "linewidth": 1.1},
    "refit": {"color": GREEN, "linestyle": ":", "linewidth": 1.3},
    "explained": {"color": VERMILION, "linestyle": "-", "linewidth": 1.3},
}
DOTS: dict[str, Any] = {
    "color": BLACK,
    "linestyle": "none",
    "marker": ".",
    "markersize": 2.5,
    "alpha": 0.6,
}
# Bins in the order a reader expects; others follow as they come.
_BINS = (
    *("rest", "rise", "hold", "fall", "released", "ramp"),
    *("below 5 deg", "5-15 deg", "15-30 deg", "30-45 deg", "45-60 deg", "above 60 deg"),
    *("bending", "still", "relaxing"),
    *("first third", "second third", "last third"),
)


def _grid(names: Sequence[str]) -> list[list[str]]:
    """Lay panels out in rows of `_COLUMNS` or fewer, the last row filled up."""
    columns = min(len(names), _COLUMNS)
    padded = list(names) + ["."] * (-len(names) % columns)
    return [padded[i : i + columns] for i in range(0, len(padded), columns)]


@styled
def gap_figure(diagnosis: Diagnosis) -> Figure:
    """Draw what the plain model misses over time and pressure, and where the gap lies.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind; share maps that are not known, empty or all zero are left out.

    Returns
    -------
    matplotlib.figure.Figure
    """
    traces = diagnosis.traces
    drawn = experiments(traces)
    maps = share_maps(diagnosis.where)
    rows = _grid([f"time {e.name}" for e in drawn])
    bars = _grid([f"share {name}" for name in maps]) if maps else []
    figure = Figure(figsize=(TWO_COLUMNS_IN, 0.6 + 1.45 * len(rows) + 1.35 * len(bars)))
    heights = [0.3 + 1.1 * len(rows), 0.2 + len(bars)] if bars else [1.0]
    blocks = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    _draw_gap(blocks[0], rows, diagnosis, drawn)
    if bars:
        panels = panels_by_name(blocks[1], bars)
        for name, shares in maps.items():
            _draw_shares(panels[f"share {name}"], MAP_WORDS[name], shares)
        blocks[1].suptitle("share of the gap (%)", fontsize=8)
    return figure


def panels_by_name(
    part: FigureBase, rows: Sequence[Sequence[str]], heights: Sequence[float] | None = None
) -> dict[str, Axes]:
    """Lay axes out in a figure or a part of it, by name."""
    return part.subplot_mosaic([list(row) for row in rows], height_ratios=heights)


def _draw_gap(
    part: FigureBase,
    rows: Sequence[Sequence[str]],
    diagnosis: Diagnosis,
    drawn: Sequence[Experiment],
) -> None:
    axes_of = panels_by_name(part, rows)
    traces, floor = diagnosis.traces, diagnosis.gap.noise_floor_deg
    missed = traces.measured_deg - traces.plain_deg
    pressure = driving(traces)
    scale = Normalize(float(pressure.min()), max(float(pressure.max()), 1e-9))
    low, high = min(float(missed.min()), -floor), max(float(missed.max()), floor)
    for e in drawn:
        axes = axes_of[f"time {e.name}"]
        band = axes.axhspan(-floor, floor, color=GREY, alpha=0.25, linewidth=0)
        for i in e.trials:
            own = traces.trial == i
            (trial,) = axes.plot(
                traces.time_s[own], missed[own], color=GREY, linestyle="-", linewidth=0.4
            )
        time, mean = mean_over_trials(traces, e.trials, missed)
        _, kpa = mean_over_trials(traces, e.trials, pressure)
        axes.axhline(0.0, color=BLACK, linestyle="-", linewidth=0.5)
        dots = axes.scatter(time, mean, c=kpa, s=3, cmap="viridis", norm=scale, zorder=3)
        axes.set_title(f"{e.title}, {_counted(len(e.trials), 'trial')}", loc="left")
        axes.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
        axes.set_xlabel("time (s)")
    for row in rows:
        axes_of[row[0]].set_ylabel("measured − model (°)")
    bar = part.colorbar(dots, ax=list(axes_of.values()), aspect=30, pad=0.01)
    bar.set_label("command (kPa)" if has_command(traces) else "pressure (kPa)")
    part.legend(
        [trial, dots, band],
        ["each trial", "their mean", "noise floor"],
        loc="outside upper center",
        ncols=3,
    )


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _draw_shares(axes: Axes, title: str, shares: Mapping[str, float]) -> None:
    order = sorted(shares, key=lambda name: _BINS.index(name) if name in _BINS else len(_BINS))
    values = [100.0 * shares[name] for name in order]
    axes.set_title(title, loc="left")
    axes.barh(range(len(order)), values, color=BLUE, height=0.65)
    axes.set_yticks(range(len(order)), [bin_words(name) for name in order])
    axes.set_ylim(len(order) - 0.4, -0.6)
    axes.set_xlim(0.0, 120.0)
    axes.set_xticks([0, 25, 50, 75, 100])
    axes.grid(visible=False, axis="y")
    for place, value in enumerate(values):
        _write_beside(axes, f"{value:.0f}", value, place)


@styled
def before_after_figure(diagnosis: Diagnosis) -> Figure:
    """Draw each experiment measured and modelled, and below it what is missed before and after.

    One trial of each is drawn in full, one that took no part where there is one; the residuals of
    the others are drawn faintly.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind; without an explanation only the plain model is drawn.

    Returns
    -------
    matplotlib.figure.Figure
    """
    traces = diagnosis.traces
    drawn = experiments(traces)
    angles = _grid([f"angle {e.name}" for e in drawn])
    missed = _grid([f"missed {e.name}" for e in drawn])
    mosaic = [row for pair in zip(angles, missed, strict=True) for row in pair]
    figure = Figure(figsize=(TWO_COLUMNS_IN, 0.6 + 2.55 * len(angles)))
    heights = [1.5, 1.0] * len(angles)
    axes_of = panels_by_name(figure, mosaic, heights)
    models = _models(diagnosis)
    handles: dict[str, Any] = {}
    for e in drawn:
        handles |= _draw_angles(axes_of[f"angle {e.name}"], traces, e, models)
        handles |= _draw_missed(axes_of[f"missed {e.name}"], diagnosis, e)
    for row in angles:
        axes_of[row[0]].set_ylabel("angle (°)")
    for row in missed:
        axes_of[row[0]].set_ylabel("measured −\nmodel (°)")
    figure.legend(
        list(handles.values()), list(handles), loc="outside upper center", ncols=len(handles)
    )
    return figure


def has_explanation(diagnosis: Diagnosis) -> bool:
    """Say whether there is an explanation beside the plain model."""
    return bool(diagnosis.sets)


def _models(diagnosis: Diagnosis) -> dict[str, tuple[str, Floats]]:
    """Return what each model is called and its curve, by its look."""
    traces = diagnosis.traces
    models = {"plain": ("plain model", traces.plain_deg)}
    if has_explanation(diagnosis):
        models["refit"] = ("plain model, refitted", traces.refit_deg)
        models["explained"] = ("augmented model", traces.explained_deg)
    return models


def _draw_angles(
    axes: Axes, traces: Traces, e: Experiment, models: Mapping[str, tuple[str, Floats]]
) -> dict[str, Any]:
    own = traces.trial == e.shown
    time = traces.time_s[own]
    handles: dict[str, Any] = {}
    (handles["measured"],) = axes.plot(time, traces.measured_deg[own], **DOTS)
    for look, (name, curve) in models.items():
        (handles[name],) = axes.plot(time, curve[own], **LOOKS[look])
    part = ", held out" if traces.held_out[e.shown] else ""
    axes.set_title(f"{e.title}, {e.place}{part}", loc="left")
    axes.tick_params(labelbottom=False)
    return handles


def _draw_missed(axes: Axes, diagnosis: Diagnosis, e: Experiment) -> dict[str, Any]:
    traces, floor = diagnosis.traces, diagnosis.gap.noise_floor_deg
    curves = {"plain": traces.plain_deg}
    if has_explanation(diagnosis):
        curves["explained"] = traces.explained_deg
    handles = {"noise floor": axes.axhspan(-floor, floor, color=GREY, alpha=0.3, linewidth=0)}
    sizes = []
    for look, curve in curves.items():
        missed = traces.measured_deg - curve
        for i in e.trials:
            own = traces.trial == i
            colour = LOOKS[look]["color"]
            if i == e.shown:
                axes.plot(traces.time_s[own], missed[own], color=colour, linestyle="-")
                sizes.append(f"{rms(traces.time_s[own], missed[own]):.2f}°")
            else:
                axes.plot(
                    traces.time_s[own],
                    missed[own],
                    color=colour,
                    linestyle="-",
                    linewidth=0.5,
                    alpha=0.25,
                )
    axes.set_title("RMS " + " → ".join(sizes), loc="left")
    axes.set_xlabel("time (s)")
    return handles


@dataclass(frozen=True)
class _Rung:
    """One line of the ladder."""

    label: str
    rmse_deg: float | None
    probability: float | None
    colour: str


@styled
def ladder_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the ladder of explanations: error on held-out trials, and probability.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind; without the plain model's held-out error its error on all trials stands alone.

    Returns
    -------
    matplotlib.figure.Figure
    """
    rungs = _rungs(diagnosis)
    labels = [fill(rung.label, _LABEL_WIDTH, break_long_words=False) for rung in rungs]
    lines = max(label.count("\n") + 1 for label in labels)
    figure = new_figure(
        TWO_COLUMNS_IN,
        0.9 + (0.12 + 0.12 * lines) * len(rungs),
        [["error", "error", "probability"]],
    )
    error, probability = figure.axes
    places = range(len(rungs))
    errors = [0.0 if rung.rmse_deg is None else rung.rmse_deg for rung in rungs]
    error.barh(places, errors, color=[rung.colour for rung in rungs], height=0.6)
    error.set_yticks(places, labels)
    floor = (
        diagnosis.gap.noise_floor_deg
        if diagnosis.shrink is None
        else diagnosis.shrink.noise_floor_deg
    )
    error.axvline(floor, color=BLACK, linestyle="--", linewidth=0.8)
    error.set_xlim(0.0, 1.15 * max([*errors, floor]))
    held_out = plain_held_out(diagnosis) is not None and diagnosis.traces.held_out.any()
    on = "held-out trials" if held_out else "all trials"
    error.set_xlabel(f"RMSE on {on} (°); dashed: noise floor, {floor:.2f}°")
    for place, rung in zip(places, rungs, strict=True):
        text = "–" if rung.rmse_deg is None else f"{rung.rmse_deg:.2f}"
        _write_beside(error, text, 0.0 if rung.rmse_deg is None else rung.rmse_deg, place)
        if rung.probability is not None:
            probability.barh(place, rung.probability, color=rung.colour, height=0.6)
            _write_beside(probability, percent(rung.probability), rung.probability, place)
    probability.set_xlim(0.0, 1.25)
    probability.set_xticks([0.0, 0.5, 1.0], ["0", "50 %", "100 %"])
    probability.set_yticks(places, [""] * len(rungs))
    probability.set_xlabel("probability")
    for axes in (error, probability):
        axes.set_ylim(len(rungs) - 0.4, -0.6)
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
    return figure


def _rungs(diagnosis: Diagnosis) -> list[_Rung]:
    causes = diagnosis.causes
    shrink = diagnosis.shrink
    before = plain_held_out(diagnosis)
    held_out = before is not None
    if not held_out:
        before = diagnosis.gap.rmse_deg
    rungs = [_Rung("plain model", before, probability_of(causes, "none"), BLUE)]
    if shrink is not None:
        rungs.append(_Rung("plain model, refitted", shrink.refit_only_rmse_deg, None, GREEN))
    for cause in named(causes, MOST_CAUSES):
        colour = VERMILION if cause.set in diagnosis.sets else ORANGE
        error = cause.held_out_rmse_deg if held_out else None
        rungs.append(_Rung(phrase(cause.set, " + "), error, cause.probability, colour))
    rungs.append(_Rung(phrase(("unknown",)), None, probability_of(causes, "unknown"), GREY))
    if shrink is not None and shrink.ceiling_rmse_deg is not None:
        rungs.append(_Rung("refitted + mean residual", shrink.ceiling_rmse_deg, None, PURPLE))
    return rungs


def _write_beside(axes: Axes, text: str, value: float, place: int) -> None:
    axes.annotate(
        text,
        (value, place),
        xytext=(3, 0),
        textcoords="offset points",
        va="center",
        fontsize=6,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.3},
    )
