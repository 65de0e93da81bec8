"""The figure of what was measured between the stages: pressure, and sensor in the fixture."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, ScalarFormatter

from spa_fo.gap.diagnosis import Diagnosis, Traces
from spa_fo.report.diagnosis_figures import DOTS, LOOKS, has_explanation, panels_by_name
from spa_fo.report.experiments import (
    Experiment,
    experiments,
    has_command,
    rms,
)
from spa_fo.report.style import (
    BLUE,
    SKY,
    TWO_COLUMNS_IN,
    styled,
)

_MOST_STAGE_PANELS = 3
_LINEAR_KPA = 5.0


def has_stages(traces: Traces) -> bool:
    """Say whether pressure was measured beside a command, or the sensor calibrated."""
    pressure = traces.pressure_kpa is not None and has_command(traces)
    return pressure or traces.fixture_deg.size > 0


@styled
def stages_figure(diagnosis: Diagnosis) -> Figure:
    """Draw what was measured between the stages: pressure against command, sensor in the fixture.

    Parameters
    ----------
    diagnosis : Diagnosis
        With a measured pressure or a calibration (see `has_stages`).

    Returns
    -------
    matplotlib.figure.Figure
    """
    traces = diagnosis.traces
    drive = _drive_experiments(traces)
    names = [e.name for e in drive]
    mosaic, heights = [], []
    if drive:
        mosaic += [[f"pressure {n}" for n in names], [f"lost {n}" for n in names]]
        heights += [1.3, 1.0]
    if traces.fixture_deg.size:
        mosaic.append(["fixture"] * max(len(names), 1))
        heights.append(1.4)
    figure = Figure(figsize=(TWO_COLUMNS_IN, 0.6 + 1.2 * sum(heights)))
    axes_of = panels_by_name(figure, mosaic, heights)
    for e in drive:
        _draw_pressure(axes_of[f"pressure {e.name}"], axes_of[f"lost {e.name}"], traces, e)
    if drive:
        axes_of[f"pressure {names[0]}"].set_ylabel("pressure (kPa)")
        axes_of[f"lost {names[0]}"].set_ylabel("pressure −\ncommand (kPa)")
        axes_of[f"lost {names[0]}"].set_title(
            f"logarithmic beyond ±{_LINEAR_KPA:g} kPa", loc="left", fontsize=6
        )
        handles, labels = axes_of[f"pressure {names[0]}"].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    if traces.fixture_deg.size:
        _draw_fixture(axes_of["fixture"], diagnosis)
    return figure


def _drive_experiments(traces: Traces) -> list[Experiment]:
    """Return the experiments in which the pressure strays most from the command."""
    pressure = traces.pressure_kpa
    if pressure is None or not has_command(traces):
        return []
    every = experiments(traces)

    def strays(e: Experiment) -> float:
        own = traces.trial == e.shown
        return rms(traces.time_s[own], pressure[own] - traces.command_kpa[own])

    chosen = sorted(every, key=strays, reverse=True)[:_MOST_STAGE_PANELS]
    return [e for e in every if e in chosen]


def _draw_pressure(above: Axes, below: Axes, traces: Traces, e: Experiment) -> None:
    own = traces.trial == e.shown
    time, command = traces.time_s[own], traces.command_kpa[own]
    assert traces.pressure_kpa is not None
    measured = traces.pressure_kpa[own]
    above.plot(time, command, color=BLUE, linestyle="--", linewidth=1.0, label="command")
    above.plot(time, measured, label="measured", **DOTS)
    below.axhline(0.0, color=BLUE, linestyle="--", linewidth=1.0)
    below.plot(time, measured - command, **DOTS)
    if traces.drive_kpa is not None:
        look = LOOKS["explained"]
        above.plot(time, traces.drive_kpa[own], label="explained", **look)
        below.plot(time, traces.drive_kpa[own] - command, **look)
    above.set_title(f"drive: {e.title}", loc="left")
    above.tick_params(labelbottom=False)
    # Edges of the command are missed by tens of kPa for an instant; a droop is a few.
    below.set_yscale("symlog", linthresh=_LINEAR_KPA)
    below.set_yticks([-50, -_LINEAR_KPA, 0, _LINEAR_KPA, 50])
    below.yaxis.set_major_formatter(ScalarFormatter())
    below.yaxis.set_minor_locator(NullLocator())
    reach = 2.0 * max(float(np.abs(measured - command).max()), _LINEAR_KPA)
    below.set_ylim(-reach, reach)
    below.set_xlabel("time (s)")


def _draw_fixture(axes: Axes, diagnosis: Diagnosis) -> None:
    traces = diagnosis.traces
    window = np.arange(traces.fixture_deg.size)
    known = axes.twinx()
    known.step(
        window, traces.fixture_angle_deg, where="mid", color=SKY, linestyle="-", linewidth=0.8
    )
    known.set_ylabel("known angle (°)", color=BLUE)
    known.grid(visible=False)
    known.spines["right"].set_visible(True)
    axes.set_zorder(known.get_zorder() + 1)
    axes.patch.set_visible(False)
    axes.plot(window, traces.fixture_deg, label="measured", **DOTS)
    if has_explanation(diagnosis):
        axes.plot(window, traces.fixture_explained_deg, label="explained", **LOOKS["explained"])
    # A sensor without fault shows its noise alone: do not blow it up.
    reach = 1.15 * max(float(np.abs(traces.fixture_deg).max()), 0.5 * diagnosis.gap.noise_floor_deg)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("calibration dwells, window by window")
    axes.set_ylabel("reading − known (°)")
    axes.set_title("sensor: error of the curve in the calibration fixture", loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
