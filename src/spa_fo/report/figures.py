"""The figures: each takes plain arrays, draws, and returns the figure; `style` saves it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.special import chdtri

from spa_fo.arrays import Floats
from spa_fo.identify.goodness import fit_percent, rms_error
from spa_fo.identify.uncertainty import LEVELS
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
from spa_fo.rig import Calibration, Drift

_PANELS_A_ROW = 3
_LETTERS = 26


@dataclass(frozen=True)
class Curve:
    """A model's step response, degrees, shape (n,), and its RMS error against the mean."""

    label: str
    t_s: Floats
    angle_deg: Floats
    rms_deg: float


@dataclass(frozen=True)
class StepPanel:
    """One setpoint: the trials, shape (trials, n), their mean and the models' curves."""

    title: str
    setpoint_deg: float | None
    t_s: Floats
    trials_deg: Floats
    curves: tuple[Curve, ...]


_CURVE_STYLES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-", "linewidth": 1.6},
    {"color": VERMILION, "linestyle": "--", "linewidth": 1.6},
    {"color": GREEN, "linestyle": "-.", "linewidth": 1.2},
    {"color": PURPLE, "linestyle": ":", "linewidth": 1.4},
    {"color": ORANGE, "linestyle": (0, (5, 1)), "linewidth": 1.2},
)


@styled
def step_figure(panels: Sequence[StepPanel]) -> Figure:
    """Draw step responses as in Figs. 4 and 5: one panel a setpoint, trials in grey, models on top.

    Parameters
    ----------
    panels : sequence of StepPanel
        In the order (a), (b), ...

    Returns
    -------
    matplotlib.figure.Figure
    """
    names = [chr(ord("a") + i) if i < _LETTERS else str(i + 1) for i in range(len(panels))]
    rows = [names[i : i + _PANELS_A_ROW] for i in range(0, len(names), _PANELS_A_ROW)]
    empty = ["."] * (len(rows[0]) - len(rows[-1]))
    figure = new_figure(
        TWO_COLUMNS_IN, 3.2 + 2.7 * (len(rows) - 1), [*rows[:-1], [*rows[-1], *empty]]
    )
    for axes, name, panel in zip(figure.axes, names, panels, strict=True):
        trials = axes.plot(panel.t_s, panel.trials_deg.T, color=GREY, linestyle="-", linewidth=0.6)
        (mean,) = axes.plot(
            panel.t_s,
            panel.trials_deg.mean(axis=0),
            color=BLACK,
            linestyle="none",
            marker=".",
            markersize=2.5,
        )
        models = [
            axes.plot(curve.t_s, curve.angle_deg, **look)[0]
            for curve, look in zip(panel.curves, _CURVE_STYLES, strict=False)
        ]
        if panel.setpoint_deg is not None:
            axes.axhline(panel.setpoint_deg, color=BLACK, linestyle=":", linewidth=0.6)
        axes.set_title(f"({name}) {panel.title}", loc="left")
        axes.set_xlabel("time after the step (s)")
        axes.set_ylabel("bending angle (°)")
        axes.set_xlim(0, panel.t_s[-1])
        axes.set_ylim(bottom=min(0.0, float(panel.trials_deg.min())))
        errors = [f"{curve.rms_deg:.2f}°" for curve in panel.curves[: len(models)]]
        axes.legend(models, errors, title="RMS against the mean", loc="lower right", ncols=2)
    labels = [curve.label for curve in panels[0].curves[: len(models)]]
    counts = {len(panel.trials_deg) for panel in panels}
    figure.legend(
        [trials[0], mean, *models],
        [f"{counts.pop()} trials" if len(counts) == 1 else "each trial", "their mean", *labels],
        loc="outside upper center",
        ncols=3,
    )
    return figure


@dataclass(frozen=True)
class LogPanel:
    """One trial of any protocol: measured and predicted angle, deg, and the pressure, kPa."""

    title: str
    t_s: Floats
    measured_deg: Floats
    predicted_deg: Floats
    pressure_kpa: Floats | None


@styled
def log_figure(panels: Sequence[LogPanel], model_label: str) -> Figure:
    """Draw whole trials, a row each: angle measured and predicted, pressure behind, residual.

    Parameters
    ----------
    panels : sequence of LogPanel
        One row each.
    model_label : str
        What the prediction is called.

    Returns
    -------
    matplotlib.figure.Figure
    """
    mosaic = [[f"log {i}", f"log {i}", f"residual {i}"] for i in range(len(panels))]
    figure = new_figure(TWO_COLUMNS_IN, 0.5 + 1.55 * len(panels), mosaic)
    axes_of = {axes.get_label(): axes for axes in figure.axes}
    for i, panel in enumerate(panels):
        axes, residual = axes_of[f"log {i}"], axes_of[f"residual {i}"]
        axes.plot(panel.t_s, panel.measured_deg, color=GREY, linestyle="-", label="measured")
        axes.plot(panel.t_s, panel.predicted_deg, color=BLUE, linestyle="-", label=model_label)
        if panel.pressure_kpa is not None:
            right = axes.twinx()
            right.plot(panel.t_s, panel.pressure_kpa, color=ORANGE, linestyle=":", linewidth=0.9)
            right.set_ylabel("command (kPa)", color=ORANGE)
            right.spines["right"].set_visible(True)
            right.grid(visible=False)
        axes.set_title(panel.title, loc="left")
        axes.set_ylabel("angle (°)")
        error = panel.measured_deg - panel.predicted_deg
        residual.plot(panel.t_s, error, color=VERMILION, linestyle="-", linewidth=0.7)
        residual.axhline(0.0, color=BLACK, linestyle="-", linewidth=0.5)
        rms = rms_error(panel.measured_deg, panel.predicted_deg)
        fit = fit_percent(panel.measured_deg, panel.predicted_deg)
        shown = "" if np.isnan(fit) else f", fit {fit:.1f} %"
        residual.set_title(f"RMS {rms:.2f}°{shown}", loc="left")
        residual.set_ylabel("meas. − pred. (°)")
    axes_of["log 0"].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
    for name in ("log", "residual"):
        axes_of[f"{name} {len(panels) - 1}"].set_xlabel("time (s)")
    return figure


@styled
def calibration_figure(calibration: Calibration, drifts: Sequence[Drift]) -> Figure:
    """Draw the flex sensor's curve with its dwells, and what hysteresis and drift it shows.

    Parameters
    ----------
    calibration : Calibration
        The earliest: every angle came through it.
    drifts : sequence of Drift
        The later ones seen through it.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(TWO_COLUMNS_IN, 2.6, [["curve", "difference"]])
    curve, difference = figure.axes
    counts = np.linspace(calibration.counts[0], calibration.counts[-1], 400)
    angles = calibration.angle_deg(counts)
    sigma = calibration.sigma_deg(counts)
    curve.plot(counts, angles, color=BLUE, linestyle="-", label="monotone curve")
    difference.fill_between(
        angles, -sigma, sigma, color=SKY, alpha=0.4, linewidth=0, label="1 σ of the curve"
    )
    for direction, marker in (("up", "^"), ("down", "v")):
        dwells = [dwell for dwell in calibration.dwells if dwell.direction == direction]
        known = np.array([dwell.angle_deg for dwell in dwells])
        means = np.array([dwell.mean for dwell in dwells])
        look: dict[str, Any] = {
            "color": BLACK,
            "linestyle": "none",
            "marker": marker,
            "markersize": 3,
        }
        curve.plot(means, known, label=f"dwells {direction}", **look)
        read = calibration.angle_deg(means) - known
        difference.plot(known, read, label=f"{direction}: read − known", **look)
    colours = cycle((VERMILION, PURPLE, GREEN, ORANGE))
    for drift, colour in zip(drifts, colours, strict=False):
        hours = (drift.started_s - calibration.started_s) / 3600.0
        difference.plot(
            drift.angles_deg,
            drift.drift_deg,
            color=colour,
            linestyle="--",
            marker=".",
            label=f"drift after {hours:.1f} h",
        )
    curve.set_xlabel("flex count")
    curve.set_ylabel("bending angle (°)")
    curve.set_title("(a) calibration before the trials", loc="left")
    curve.legend()
    difference.set_xlabel("known angle (°)")
    difference.set_ylabel("difference (°)")
    difference.set_title("(b) hysteresis, drift, uncertainty", loc="left")
    difference.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3, columnspacing=1.0)
    return figure


@dataclass(frozen=True)
class Profile:
    """One parameter's profile likelihood: values, rise of chi-square, estimate, 95 % interval."""

    name: str
    values: Floats
    rise: Floats
    estimate: float
    low: float
    high: float
    determined: bool


QUANTITY_NAMES = {
    "alpha2": r"$\alpha_2$",
    "alpha1": r"$\alpha_1$",
    "a1": "$a_1$",
    "a0": "$a_0$",
    "b0": "$b_0$",
    "K": "$K = b_0/a_0$ (rad)",
}
_RISES = {f"{100 * level:g} %": float(chdtri(1, 1.0 - level)) for level in LEVELS}
_HIGHEST_RISE = 6.0


def _shown(profile: Profile) -> tuple[float, float]:
    """Return the part of the axis worth showing: where the rise is within the figure."""
    within = np.flatnonzero(profile.rise <= _HIGHEST_RISE)
    first, last = max(within[0] - 1, 0), min(within[-1] + 1, profile.values.size - 1)
    return float(profile.values[first]), float(profile.values[last])


@styled
def identifiability_figure(profiles: Sequence[Profile]) -> Figure:
    """Draw how far chi-square rises when one parameter is held and the others are fitted again."""
    names = [profile.name for profile in profiles]
    half = (len(names) + 1) // 2
    mosaic = [names[:half], names[half:] + ["."] * (2 * half - len(names))]
    figure = new_figure(TWO_COLUMNS_IN, 3.6, mosaic)
    for axes, profile in zip(figure.axes, profiles, strict=True):
        axes.plot(profile.values, profile.rise, color=BLUE, linestyle="-")
        for label, rise in _RISES.items():
            axes.axhline(rise, color=GREY, linestyle="--", linewidth=0.7)
            axes.annotate(
                label,
                (1.0, rise),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                fontsize=6,
                color="#555555",
            )
        axes.axvline(profile.estimate, color=BLACK, linestyle=":", linewidth=0.8)
        axes.axvspan(profile.low, profile.high, color=SKY, alpha=0.25, linewidth=0)
        low, high = _shown(profile)
        if high > 10 * low > 0:
            axes.set_xscale("log")
        axes.set_xlim(low, high)
        axes.set_ylim(0, _HIGHEST_RISE)
        axes.set_xlabel(QUANTITY_NAMES[profile.name])
        word = "determined" if profile.determined else "not determined"
        axes.set_title(word, loc="left", color=GREEN if profile.determined else VERMILION)
    for axes in figure.axes[::half]:
        axes.set_ylabel("rise of χ²")
    return figure
