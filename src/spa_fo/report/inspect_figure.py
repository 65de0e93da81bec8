"""What a log of unknown make holds, drawn: what was commanded, what was measured, its sampling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spa_fo.report.style import (
    BLACK,
    BLUE,
    GREY,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    save_figure,
    styled,
)
from spa_fo.rig.inspection import PAUSE, Inspection


def write_inspect_figure(inspection: Inspection, stem: Path | str) -> tuple[Path, Path]:
    """Write ``stem.pdf`` and ``stem.png``; raises BadInput where they cannot be written."""
    note = f"{inspection.path.name}: data as found, provenance not stated"
    return save_figure(inspect_figure(inspection), stem, note.replace("$", r"\$"))


@styled
def inspect_figure(inspection: Inspection) -> Figure:
    """Draw a log's input, output and steps of time, one above the other.

    Parameters
    ----------
    inspection : Inspection
        As made by `inspect_log`; panels of signals it does not hold are left out.

    Returns
    -------
    matplotlib.figure.Figure
    """
    signals = inspection.signals
    panels = []
    if {"command", "pressure"} & set(signals):
        panels.append("input")
    panels += [role for role in ("angle", "flex_adc") if role in signals]
    panels.append("steps")
    figure = new_figure(TWO_COLUMNS_IN, 0.6 + 1.4 * len(panels), [[name] for name in panels])
    axes = {str(one.get_label()): one for one in figure.axes}
    if "input" in axes:
        _draw_input(axes["input"], inspection)
    for role, label in (("angle", "angle (deg)"), ("flex_adc", "flex (counts)")):
        if role in axes:
            axes[role].plot(inspection.t_s, signals[role], color=BLUE, linestyle="-")
            axes[role].set_ylabel(label)
    _draw_steps(axes["steps"], inspection)
    for one in figure.axes:
        one.set_xlim(inspection.t_s[0], inspection.t_s[-1])
    figure.axes[-1].set_xlabel("time from the first row (s)")
    figure.axes[0].set_title(inspection.path.name.replace("$", r"\$"), loc="left")
    return figure


def _draw_input(axes: Axes, inspection: Inspection) -> None:
    """Draw command and pressure, on two scales where their units differ."""
    signals, columns = inspection.signals, inspection.log.columns or {}
    counts = inspection.kind == "spa-rig"
    unitless = "command" in columns and columns["command"].unit == "1"
    lines: list[Line2D] = []
    if "command" in signals:
        lines += axes.plot(
            inspection.t_s,
            signals["command"],
            drawstyle="steps-post",
            color=BLACK,
            linestyle="--",
            label="command",
        )
        axes.set_ylabel("command" if unitless else "command (kPa)")
    if "pressure" in signals:
        second = axes
        if "command" in signals and (unitless or counts):
            second = axes.twinx()
            second.grid(visible=False)
            second.spines["right"].set_visible(True)
        lines += second.plot(
            inspection.t_s, signals["pressure"], color=VERMILION, linestyle="-", label="pressure"
        )
        second.set_ylabel("pressure (counts)" if counts else "pressure (kPa)")
    axes.legend(handles=lines, loc="upper right")


def _draw_steps(axes: Axes, inspection: Inspection) -> None:
    """Draw each step of time, the pauses marked."""
    steps_ms = 1e3 * np.diff(inspection.t_s)
    usual_ms = 1e3 * inspection.sampling.step_s
    late = steps_ms > PAUSE * usual_ms
    axes.plot(inspection.t_s[1:], steps_ms, ".", color=BLUE, markersize=1.5)
    axes.plot(inspection.t_s[1:][late], steps_ms[late], "x", color=VERMILION, markersize=4)
    axes.axhline(usual_ms, color=GREY, linestyle="-", linewidth=0.8)
    if steps_ms.max() > 10.0 * steps_ms.min() > 0.0:
        axes.set_yscale("log")
    elif np.ptp(steps_ms) < 0.1 * usual_ms:
        # What is even should look even.
        axes.set_ylim(0.9 * usual_ms, 1.1 * usual_ms)
    axes.set_ylabel("step (ms)")
