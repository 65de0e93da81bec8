"""Figures of one object: a campaign's trials, a model, a fit, a command profile."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from spa_fo.fractional import step_map, step_response
from spa_fo.gap.plan.profiles import Profile
from spa_fo.identify import FitResult
from spa_fo.plant import Model
from spa_fo.report.figures import Curve, StepPanel, step_figure
from spa_fo.report.style import (
    BLUE,
    ONE_COLUMN_IN,
    ORANGE,
    TWO_COLUMNS_IN,
    new_figure,
    styled,
)
from spa_fo.rig import CampaignData

_COLUMNS = 3


@styled
def campaign_figure(data: CampaignData) -> Figure:
    """Draw every trial: a panel for each experiment, the first trial's input behind.

    Parameters
    ----------
    data : CampaignData
        The campaign.
    """
    experiments = data.campaign.experiments
    names = [experiment.name for experiment in experiments]
    columns = min(_COLUMNS, len(names))
    padded = [*names, *["."] * (-len(names) % columns)]
    mosaic = [padded[i : i + columns] for i in range(0, len(padded), columns)]
    figure = new_figure(TWO_COLUMNS_IN, 0.4 + 1.9 * len(mosaic), mosaic)
    for axes, experiment in zip(list(figure.axes), experiments, strict=True):
        trials = [trial for trial in data.trials if trial.experiment == experiment.name]
        shades = np.linspace(1.0, 0.35, len(trials))[::-1]
        for trial, shade in zip(trials, shades, strict=True):
            axes.plot(
                trial.t_s,
                trial.angle_deg,
                color=BLUE,
                alpha=float(shade),
                linestyle="-",
                linewidth=0.8,
            )
        first = trials[0]
        commanded = first.command_kpa is not None
        behind = first.command_kpa if commanded else first.pressure_kpa
        if behind is not None:
            right = axes.twinx()
            right.step(
                first.t_s,
                behind,
                where="post",
                color=ORANGE,
                linestyle=":",
                linewidth=1.0,
            )
            right.spines["right"].set_visible(True)
            right.grid(visible=False)
            word = "command" if commanded else "pressure"
            unit = " (kPa)" if data.campaign.command_is_pressure or not commanded else ""
            right.set_ylabel(f"{word}{unit}", color=ORANGE)
        count = f"{len(trials)} trials" if len(trials) > 1 else "1 trial"
        axes.set_title(f"{experiment.name}: {count}", loc="left")
        axes.set_xlabel("time (s)")
        axes.set_ylabel("angle (°)", color=BLUE)
    figure.suptitle("all trials, early ones lighter; dotted: the first one's input", fontsize=7)
    return figure


@styled
def model_figure(model: Model) -> Figure:
    """Draw step response and Bode plot of the model's exact G(s)."""
    g = model.transfer_function
    scale = g.a0 ** (-1.0 / g.alpha2)
    omega, t = np.geomspace(0.01, 100.0, 300) / scale, np.linspace(0.0, 12.0 * scale, 400)
    s = 1j * omega
    response = g.b0 / (s**g.alpha2 + g.a1 * s**g.alpha1 + g.a0)
    angle = np.degrees(step_response(t, g.alpha2, g.alpha1, g.a1, g.a0, g.b0))
    figure = new_figure(TWO_COLUMNS_IN, 2.2, [["step", "magnitude", "phase"]])
    step, magnitude, phase = figure.axes
    step.plot(t, angle, color=BLUE, linestyle="-")
    step.axhline(float(np.degrees(g.gain)), color="black", linestyle=":", linewidth=0.6)
    step.set_title(f"(a) step to {model.reference_kpa:g} kPa", loc="left")
    step.set_xlabel("time (s)")
    step.set_ylabel("angle (°)")
    magnitude.semilogx(omega, 20.0 * np.log10(np.abs(response)), color=BLUE, linestyle="-")
    magnitude.set_title("(b) magnitude (dB rad)", loc="left")
    phase.semilogx(omega, np.degrees(np.unwrap(np.angle(response))), color=BLUE, linestyle="-")
    phase.set_title("(c) phase (°)", loc="left")
    for axes in (magnitude, phase):
        axes.set_xlabel("angular frequency (rad/s)")
    return figure


def fit_figure(result: FitResult) -> Figure:
    """Draw the step responses that were fitted, with the model; see `figures.step_figure`.

    Parameters
    ----------
    result : FitResult
        Of up-steps.
    """
    data = result.data
    if data is None:
        raise ValueError("expected a fit of up-steps")
    unit = step_map(data.t).response(result.optimum.x)
    panels = []
    for name, rows in data.groups.items():
        setpoint = float(data.setpoint_deg[rows[0]])
        errors = {error.experiment: error.rms_deg for error in result.errors}
        predicted = np.degrees((data.u[rows, np.newaxis] * unit).mean(axis=0))
        panels.append(
            StepPanel(
                title=name,
                setpoint_deg=None if np.isnan(setpoint) else setpoint,
                t_s=data.t,
                trials_deg=np.degrees(data.angle_rad[rows]),
                curves=(Curve("fractional model", data.t, predicted, errors[name]),),
            )
        )
    return step_figure(panels)


@styled
def profile_figure(profile: Profile, purpose: str) -> Figure:
    """Draw a command profile over time."""
    figure = new_figure(ONE_COLUMN_IN * 1.4, 2.2, [["command"]])
    axes = figure.axes[0]
    t, command = profile.sampled()
    axes.step(t, command, where="post", color=ORANGE, linestyle="-")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("command (kPa)")
    axes.set_title(purpose, loc="left", wrap=True)
    return figure
