"""The one picture that a diagnosis opens with: where the model is off most, and what closes it."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spa_fo.gap.diagnosis import Diagnosis
from spa_fo.report.experiments import Experiment, worst
from spa_fo.report.style import (
    BLACK,
    BLUE,
    GREY,
    ONE_COLUMN_IN,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    styled,
)


@styled
def opening_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the experiment of the largest gap: measured, the model, the explanation, what is missed.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind; without an explanation only the plain model is drawn.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(TWO_COLUMNS_IN, 0.75 * ONE_COLUMN_IN, [["angle", "missed"]])
    angle, missed = figure.axes
    shown = worst(diagnosis.traces)
    _draw_angle(angle, diagnosis, shown)
    _draw_missed(missed, diagnosis)
    _draw_missed_curves(missed, diagnosis, shown)
    handles = [*angle.get_legend_handles_labels()[0], *missed.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure


def _draw_angle(axes: Axes, diagnosis: Diagnosis, shown: Experiment) -> None:
    traces = diagnosis.traces
    own = traces.trial == shown.shown
    time, measured = traces.time_s[own], traces.measured_deg[own]
    plain = traces.plain_deg[own]
    axes.fill_between(time, measured, plain, color=BLUE, alpha=0.25, linewidth=0, label="the gap")
    axes.plot(time, measured, color=BLACK, linestyle="-", linewidth=1.6, label="measured")
    axes.plot(time, plain, color=BLUE, linestyle="--", linewidth=1.2, label="plain model")
    if diagnosis.sets:
        explained = traces.explained_deg[own]
        axes.plot(
            time, explained, color=VERMILION, linestyle="-", linewidth=1.0, label="augmented model"
        )
    part = ", held out" if traces.held_out[shown.shown] else ""
    axes.set_title(f"{shown.title}, {shown.place}{part}", loc="left")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("angle (°)")


def _draw_missed(axes: Axes, diagnosis: Diagnosis) -> None:
    floor = diagnosis.gap.noise_floor_deg
    axes.axhspan(-floor, floor, color=GREY, alpha=0.3, linewidth=0, label="noise floor")
    axes.set_title("residuals", loc="left")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("measured − model (°)")


def _draw_missed_curves(axes: Axes, diagnosis: Diagnosis, shown: Experiment) -> None:
    traces = diagnosis.traces
    own = traces.trial == shown.shown
    curves = [(traces.plain_deg, BLUE, "--")]
    if diagnosis.sets:
        curves.append((traces.explained_deg, VERMILION, "-"))
    for curve, colour, dashes in curves:
        missed = traces.measured_deg[own] - curve[own]
        axes.plot(traces.time_s[own], missed, color=colour, linestyle=dashes, linewidth=1.2)
