"""Bode and step plots of a model against its rational approximation."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from spa_fo.arrays import Floats
from spa_fo.export import Exported
from spa_fo.export.accuracy import exact_step
from spa_fo.export.fitted import exact_response
from spa_fo.export.rational import Complexes
from spa_fo.report.style import (
    BLUE,
    GREY,
    SKY,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    styled,
)

_NAMES = {"fitted": "poles and zeros fitted", "oustaloup": "Oustaloup"}
_BEYOND = 10.0  # drawn beyond the band, a factor


@styled
def export_figure(exported: Exported) -> Figure:
    """Draw magnitude, phase and step response above, and what the approximation misses below.

    Dead time and lags, which are exported exactly, are left away.

    Parameters
    ----------
    exported : Exported
        From `spa_fo.export.export_model`.
    """
    g, made = exported.model.transfer_function, exported.approximation
    band, rational = made.band, made.rational
    omega = np.geomspace(band.low / _BEYOND, band.high * _BEYOND, 400)
    t = np.geomspace(1.0 / band.high, 1.0 / band.low, 200)
    exact, near = exact_response(g, omega), rational.response(omega)
    ratio = near / exact
    step, near_step = exact_step(g, t), rational.step(t)
    sampled = exported.filter
    names = ["magnitude", "phase", "step"]
    figure = new_figure(TWO_COLUMNS_IN, 3.9, [names, [f"{name} error" for name in names]])
    axes = {one.get_label(): one for one in figure.axes}

    upper = {
        "magnitude": (omega, _db(exact), _db(near)),
        "phase": (omega, _degrees(exact), _degrees(near)),
        "step": (t, step, near_step),
    }
    for name, (x, right, other) in upper.items():
        axes[name].semilogx(x, right, color=GREY, linestyle="-", linewidth=2.4, label="exact G(s)")
        label = f"{_NAMES[made.method]}, {rational.states} poles"
        axes[name].semilogx(x, other, color=BLUE, linestyle="--", label=label)
    lower = {
        "magnitude": (omega, _db(ratio)),
        "phase": (omega, np.degrees(np.angle(ratio))),
        "step": (t, 100.0 * (near_step - step) / g.gain),
    }
    for name, (x, error) in lower.items():
        below = axes[f"{name} error"]
        below.semilogx(x, error, color=VERMILION, linestyle="-")
        within = np.abs(error[(x >= band.low) & (x <= band.high)]) if name != "step" else error
        limit = 1.6 * float(np.max(np.abs(within)))
        below.set_ylim(-limit, limit)
    for name in ("magnitude", "phase"):
        for either in (axes[name], axes[f"{name} error"]):
            either.axvspan(band.low, band.high, color=SKY, alpha=0.15, linewidth=0, label="band")
    first = sampled.sample_time_s
    axes["step error"].axvline(first, color=GREY, linestyle=":", linewidth=0.8)
    axes["step error"].annotate(
        "one sample",
        (first, 0.97),
        xycoords=("data", "axes fraction"),
        fontsize=6,
        rotation=90,
        ha="right",
        va="top",
        color="#555555",
    )

    axes["magnitude"].set_title("(a) magnitude (dB rad)", loc="left")
    axes["phase"].set_title("(b) phase (°)", loc="left")
    axes["step"].set_title("(c) step response (rad for u = 1)", loc="left")
    accuracy = exported.accuracy
    axes["magnitude error"].set_title(f"error (dB), at most {accuracy.max_db:.2g}", loc="left")
    axes["phase error"].set_title(f"error (°), at most {accuracy.max_deg:.2g}", loc="left")
    axes["step error"].set_title(
        f"error (% of gain), at most {accuracy.max_step_percent:.2g}", loc="left"
    )
    for name in ("magnitude", "phase"):
        axes[f"{name} error"].set_xlabel("frequency (rad/s)")
    axes["step error"].set_xlabel("time after the step (s)")
    handles, labels = axes["magnitude"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _db(response: Complexes) -> Floats:
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _degrees(response: Complexes) -> Floats:
    return np.asarray(np.degrees(np.unwrap(np.angle(response))))
