"""The curves of a diagnosis as figures to zoom into, one an experiment (plotly)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from plotly import graph_objects as go

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.diagnosis import Diagnosis
from spa_fo.report.experiments import Experiment, driving, experiments, has_command, worst
from spa_fo.report.style import BLACK, BLUE, GREEN, GREY, VERMILION

MOST_EXPERIMENTS = 12
"""Experiments to choose from: those of the largest gap."""
_POINTS = 400  # of a trace: what a screen shows
_ALL_POINTS = 1900  # of a trace of all experiments together: they keep the page below 5 MB
_DOMAINS = {"y": (0.5, 1.0), "y2": (0.19, 0.46), "y3": (0.0, 0.13)}
_TITLES = {"y": "angle (°)", "y2": "measured −<br>model (°)"}


def figures(diagnosis: Diagnosis) -> dict[str, go.Figure]:
    """Draw every experiment, as far as the page has room for them.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind.

    Returns
    -------
    dict of str to plotly.graph_objects.Figure
        By title; the one of the largest gap first.
    """
    traces = diagnosis.traces
    foremost = worst(traces)
    every = experiments(traces, MOST_EXPERIMENTS)
    ordered = sorted(every, key=lambda e: e != foremost)
    points = min(_POINTS, _ALL_POINTS // len(ordered))
    return {e.title: figure_of(diagnosis, e, points) for e in ordered}


def figure_of(diagnosis: Diagnosis, e: Experiment, points: int = _POINTS) -> go.Figure:
    """Draw one experiment: the angle, what is missed of it, and what drove it.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind; without an explanation only the plain model is drawn.
    e : Experiment
        One of its experiments; the trial that it shows is drawn.
    points : int
        Of each trace, at most.
    """
    traces = diagnosis.traces
    rows = np.flatnonzero(traces.trial == e.shown)
    rows = rows[_kept(traces.measured_deg[rows] - traces.plain_deg[rows], points)]
    figure = go.Figure(layout=_layout(diagnosis, e))
    _draw_angles(figure, diagnosis, rows)
    _draw_missed(figure, diagnosis, rows)
    figure.add_scatter(
        x=_short(traces.time_s[rows]),
        y=_short(driving(traces)[rows]),
        yaxis="y3",
        name="command" if has_command(traces) else "pressure",
        line={"color": GREY, "width": 1.5, "shape": "hv"},
        hovertemplate="%{y:.1f} kPa",
        showlegend=False,
    )
    return figure


def _kept(values: Floats, most: int) -> Integers:
    """Choose what a screen shows: the least and the largest of each of many short stretches."""
    if values.size <= most:
        return np.arange(values.size)
    stretches = np.array_split(np.arange(values.size), (most - 2) // 2)
    ends = [(own[np.argmin(values[own])], own[np.argmax(values[own])]) for own in stretches]
    return np.unique([0, *np.ravel(ends), values.size - 1])


def _short(values: Floats) -> NDArray[np.float32]:
    """Four bytes a number: six digits, more than any sensor's."""
    return values.astype(np.float32)


def _draw_angles(figure: go.Figure, diagnosis: Diagnosis, rows: Integers) -> None:
    traces = diagnosis.traces
    curves: list[tuple[str, Floats, dict[str, Any]]] = [
        ("measured", traces.measured_deg, {"line": {"color": BLACK, "width": 3}}),
        (
            "plain model",
            traces.plain_deg,
            {
                "line": {"color": BLUE, "width": 2, "dash": "dash"},
                "fill": "tonexty",
                "fillcolor": "rgba(0, 114, 178, 0.25)",
            },
        ),
    ]
    if diagnosis.sets:
        look: dict[str, Any] = {"line": {"color": VERMILION, "width": 2}}
        curves.append(("augmented model", traces.explained_deg, look))
        look = {"line": {"color": GREEN, "width": 2, "dash": "dot"}, "visible": "legendonly"}
        curves.append(("plain model, refitted", traces.refit_deg, look))
    for name, curve, options in curves:
        figure.add_scatter(
            x=_short(traces.time_s[rows]),
            y=_short(curve[rows]),
            name=name,
            mode="lines",
            hovertemplate="%{y:.2f}°",
            **options,
        )


def _draw_missed(figure: go.Figure, diagnosis: Diagnosis, rows: Integers) -> None:
    traces = diagnosis.traces
    curves: list[tuple[str, Floats, dict[str, Any]]] = [
        ("residual of the plain model", traces.plain_deg, {"color": BLUE, "dash": "dash"})
    ]
    if diagnosis.sets:
        explained = traces.explained_deg
        curves.append(("residual of the augmented model", explained, {"color": VERMILION}))
    for name, curve, line in curves:
        figure.add_scatter(
            x=_short(traces.time_s[rows]),
            y=_short(traces.measured_deg[rows] - curve[rows]),
            yaxis="y2",
            name=name,
            mode="lines",
            line={"width": 2, **line},
            hovertemplate="%{y:.2f}°",
            showlegend=False,
        )


def _layout(diagnosis: Diagnosis, e: Experiment) -> dict[str, Any]:
    traces, floor = diagnosis.traces, diagnosis.gap.noise_floor_deg
    drive = "command" if has_command(traces) else "pressure"
    below = f"time (s)<br><sup>{_origin(diagnosis, e)}</sup>"
    titles = _TITLES | {"y3": f"{drive}<br>(kPa)"}
    look = {"showline": True, "ticks": "outside", "showgrid": False}
    axes = {
        f"yaxis{name[1:]}": {
            "domain": domain,
            "title": {"text": titles[name]},
            "zeroline": name == "y2",
            **look,
        }
        for name, domain in _DOMAINS.items()
    }
    band = {"type": "rect", "xref": "paper", "yref": "y2", "x0": 0, "x1": 1, "layer": "below"}
    return {
        "template": "none",
        "height": 600,
        "margin": {"l": 70, "r": 20, "t": 80, "b": 80},
        "hovermode": "x unified",
        "hoversubplots": "axis",
        "legend": {
            "orientation": "h",
            "x": 0,
            "y": 1.0,
            "yanchor": "bottom",
            "traceorder": "normal",
        },
        "font": {"family": "system-ui, sans-serif", "size": 13},
        "xaxis": {"title": {"text": below}, "anchor": "y3", **look},
        "shapes": [
            band | {"y0": -floor, "y1": floor, "fillcolor": GREY, "opacity": 0.3, "line_width": 0}
        ],
        "annotations": [_band_words(floor)],
        **axes,
    }


def _band_words(floor: float) -> dict[str, Any]:
    return {
        "text": f"grey: noise floor ± {floor:.2f}°",
        **{"xref": "paper", "yref": "y2 domain", "x": 1, "y": 1},
        **{"xanchor": "right", "yanchor": "bottom", "showarrow": False, "font": {"size": 11}},
    }


def _origin(diagnosis: Diagnosis, e: Experiment) -> str:
    part = ", held out" if diagnosis.traces.held_out[e.shown] else ""
    return f"{diagnosis.provenance} data; {diagnosis.campaign}, {e.title}, {e.place}{part}"
