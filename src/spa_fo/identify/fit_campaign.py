"""One call from a campaign's trials to a model with its uncertainty."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.blas import one_blas_thread
from spa_fo.errors import BadInput
from spa_fo.fractional import simulate, step_map
from spa_fo.identify.bounds import Bounds
from spa_fo.identify.curve_choice import CurveChoice, choose_curve
from spa_fo.identify.drive_fit import fit_drive
from spa_fo.identify.moderate import moderate_optimum
from spa_fo.identify.polish import Optimum, fit_optimum
from spa_fo.identify.protocol import StepData, is_step, step_data
from spa_fo.identify.result import ON_STEPS, ON_WHOLE_LOGS, ExperimentError, FitResult, estimates_of
from spa_fo.identify.selection import KEY as ORDERS
from spa_fo.identify.selection import OrderComparison, compare_on_logs, compare_on_steps
from spa_fo.identify.uncertainty import Uncertainty, assess
from spa_fo.identify.whole_log import LogData, fit_whole_logs, input_of, log_data, log_errors
from spa_fo.plant import Model
from spa_fo.plant.estimates import KEY, uncertainty_entry
from spa_fo.plant.paper import POINTS
from spa_fo.rig import CampaignData, Trial
from spa_fo.rig.plausibility import stands_still

_RISEN_FIRST = 0.3  # of a response, at its first point


class NoGain(BadInput):
    """The angle does not go the way of the input: no model is one of it."""


@one_blas_thread
def fit_campaign(
    data: CampaignData,
    *,
    seed: int = 1,
    whole_logs: bool = False,
    signal: str | None = None,
    points: int = POINTS,
    bootstrap: int | None = 400,
    bounds: Bounds | None = None,
    static_curve: bool = False,
) -> FitResult:
    """Identify a campaign's model: the optimum in free bounds (see `moderate`), or in given ones.

    On the up-steps of its step experiments; on whole logs where it has none, or where
    `whole_logs` says so, the input is to be the measured pressure, or a static curve is asked for.

    Parameters
    ----------
    data : CampaignData
        As read by `rig.read_trials`.
    seed : int
        Of every random number.
    whole_logs : bool
        Fit whole logs even where there are up-steps.
    signal : {"command", "pressure"}, optional
        Which pressure drives the model: the command, or where no log holds one, or the command is
        no pressure, the measured pressure, unless given.
    points : int
        Points taken of each step response; more where that would miss how it rises.
    bootstrap : int or None
        Resamples of the trial bootstrap; None says nothing of how certain a fit to steps is,
        which takes most of its time.
    bounds : Bounds, optional
        Of the search; see `own_bounds`.
    static_curve : bool
        Try a static curve before or behind the linear part as well; see `choose_curve`.

    Raises
    ------
    BadInput
        The campaign holds nothing to fit, or its angle stands still; see `step_data`, `log_data`.
    NoGain
        The angle falls as the input rises, or stays at 0.
    """
    _refuse_stillness(data)
    has_steps = any(is_step(trial) for trial in data.trials)
    signal = signal or _signal_of(data)
    on_logs = whole_logs or static_curve or not has_steps
    if signal == "command" and not on_logs:
        return _fit_steps(data, seed, points, bootstrap, bounds)
    return _fit_logs(data, signal, bounds, static_curve)


def _signal_of(data: CampaignData) -> str:
    """Return the command, or the measured pressure where no log holds one that is a pressure."""
    if not data.campaign.command_is_pressure:
        return "pressure"
    logged = any(trial.command_kpa is not None for trial in data.trials)
    return "command" if logged else "pressure"


def campaign_steps(data: CampaignData, points: int = POINTS) -> StepData:
    """Return all up-steps of a campaign; see `step_data`."""
    campaign = data.campaign
    return step_data(data.trials, campaign.reference_kpa, points, campaign.yaml, _files(data))


def _resolved_steps(data: CampaignData, points: int) -> StepData:
    """Return all up-steps with so many points, or twice as many until the first are on the rise.

    A response that has risen before the first point says nothing of how it did: anything fits. No
    more are taken than samples were, nor where more show no more of it, as of an angle at rest.
    """
    interval_s = max(float(np.median(np.diff(t.t_s))) for t in data.trials if is_step(t))
    steps = campaign_steps(data, points)
    while _risen(steps) > _RISEN_FIRST and steps.t[0] >= 2.0 * interval_s:
        finer = campaign_steps(data, 2 * steps.points)
        if not _risen(finer) < _risen(steps):
            break
        steps = finer
    return steps


def _risen(steps: StepData) -> float:
    """Share of the mean response that the first point has."""
    mean = np.mean(steps.angle_rad / steps.u[:, None], axis=0)
    top = float(mean[np.argmax(np.abs(mean))])
    return float(mean[0]) / top if top else 0.0


def _files(data: CampaignData) -> dict[tuple[str, int], Path]:
    return {
        (experiment.name, place): file.path
        for experiment, place, file in data.campaign.trial_files()
    }


def _fit_steps(
    data: CampaignData, seed: int, points: int, bootstrap: int | None, bounds: Bounds | None
) -> FitResult:
    steps = _resolved_steps(data, points)
    optimum = _optimum(lambda box: fit_optimum(steps, box, seed), bounds)
    response = np.outer(steps.u, step_map(steps.t).response(optimum.x))
    _refuse_no_gain(float(np.sum(response * steps.angle_rad)), data)
    uncertainty = None if bootstrap is None else assess(steps, optimum, seed, bootstrap)
    orders = compare_on_steps(steps, optimum)
    return FitResult(
        model=_recorded(_model(data, optimum, "command"), data, uncertainty, None, orders),
        fitted_on=ON_STEPS,
        provenance=data.campaign.provenance.kind,
        optimum=optimum,
        errors=_step_errors(steps, optimum),
        datasets=steps.datasets,
        samples=steps.angle_rad.size,
        uncertainty=uncertainty,
        left_out=steps.left_out,
        data=steps,
        orders=orders,
    )


def _fit_logs(
    data: CampaignData, signal: str, bounds: Bounds | None, static_curve: bool
) -> FitResult:
    campaign = data.campaign
    logs = log_data(data.trials, campaign.reference_kpa, signal, campaign.yaml)
    optimum = _optimum(lambda box: fit_whole_logs(logs, box), bounds)
    g = optimum.transfer_function
    agreement = 0.0
    for log in logs:
        response = simulate(log.t, log.u, g.alpha2, g.alpha1, g.a1, g.a0, g.b0, hold=log.hold)
        agreement += float(response[log.known] @ log.angle_rad[log.known])
    _refuse_no_gain(agreement, data)
    without = [trial.label for trial in data.trials if input_of(trial, signal) is None]
    errors = log_errors(logs, optimum)
    orders = compare_on_logs(logs, optimum)
    return FitResult(
        model=_recorded(_model(data, optimum, signal), data, None, errors, orders),
        fitted_on=ON_WHOLE_LOGS,
        provenance=campaign.provenance.kind,
        optimum=optimum,
        errors=_log_errors(logs, optimum),
        datasets=len(logs),
        samples=sum(int(np.count_nonzero(log.known)) for log in logs),
        uncertainty=None,
        left_out=tuple(f"{label}: no {signal} in its log" for label in without),
        log_errors=errors,
        orders=orders,
        curve=_curve(logs, optimum, data) if static_curve else None,
        drive=fit_drive(data) if static_curve else None,
    )


def _curve(logs: list[LogData], optimum: Optimum, data: CampaignData) -> CurveChoice:
    try:
        return choose_curve(logs, optimum, data.campaign.reference_kpa)
    except ValueError as error:
        raise BadInput(data.campaign.yaml, f"a static curve: {error}", "experiments") from None


def _refuse_stillness(data: CampaignData) -> None:
    if all(stands_still(trial) for trial in data.trials):
        raise BadInput(
            data.campaign.yaml,
            "the angle does not move in any trial; expected a measured one",
            "log.columns.angle" if data.campaign.log.columns else "experiments",
        )


def _refuse_no_gain(agreement: float, data: CampaignData) -> None:
    """Refuse data whose angle does not go the model's way, or stays at 0."""
    if agreement <= 0.0:
        columns = data.campaign.log.columns
        hint = (
            "; a sign to turn, log.columns.angle.scale: -1, or a rest to take off, rest: zero?"
            if columns
            else ""
        )
        raise NoGain(
            data.campaign.yaml, f"expected an angle that rises with the input{hint}", "experiments"
        )


def _optimum(fit: Callable[[Bounds], Optimum], bounds: Bounds | None) -> Optimum:
    return moderate_optimum(fit) if bounds is None else fit(bounds)


def _model(data: CampaignData, optimum: Optimum, signal: str) -> Model:
    campaign = data.campaign
    return Model(
        campaign=campaign.name,
        material=campaign.material,
        transfer_function=optimum.transfer_function,
        reference_kpa=campaign.reference_kpa,
        signal=signal,
    )


def _recorded(
    model: Model,
    data: CampaignData,
    uncertainty: Uncertainty | None,
    errors: Floats | None,
    orders: OrderComparison,
) -> Model:
    """Let the model's file say what it rests on: provenance, sampling, uncertainty, rivals."""
    intervals = [np.median(np.diff(trial.t_s)) for trial in data.trials]
    extra: dict[str, Any] = {
        "provenance": asdict(data.campaign.provenance),
        "sampling": {"interval_s": float(np.round(np.median(intervals), 6))},
    }
    estimates = estimates_of(model, uncertainty, errors)
    if estimates[0].kind:
        extra[KEY] = uncertainty_entry(estimates)
    extra[ORDERS] = orders.to_dict()
    return replace(model, extra=extra)


def _step_errors(data: StepData, optimum: Optimum) -> tuple[ExperimentError, ...]:
    unit = step_map(data.t).response(optimum.x)
    errors = []
    for name, rows in data.groups.items():
        measured = data.angle_rad[rows]
        mean = measured.mean(axis=0)
        setpoint = float(data.setpoint_deg[rows[0]])
        predicted = data.u[rows, np.newaxis] * unit
        errors.append(
            _error(
                name,
                None if np.isnan(setpoint) else setpoint,
                len(rows),
                mean - predicted.mean(axis=0),
                measured - predicted,
                mean,
            )
        )
    return tuple(errors)


def _log_errors(logs: list[LogData], optimum: Optimum) -> tuple[ExperimentError, ...]:
    g = optimum.transfer_function
    residuals: dict[str, list[Floats]] = {}
    trials: dict[str, Trial] = {}
    for log in logs:
        model = simulate(log.t, log.u, g.alpha2, g.alpha1, g.a1, g.a0, g.b0, hold=log.hold)
        residual = (log.angle_rad - model)[log.known]
        residuals.setdefault(log.trial.experiment, []).append(residual)
        trials[log.trial.experiment] = log.trial
    return tuple(
        _error(
            name,
            trials[name].setpoint_deg,
            len(parts),
            np.concatenate(parts),
            np.concatenate(parts),
            np.radians(trials[name].angle_deg),
        )
        for name, parts in residuals.items()
    )


def _error(
    name: str,
    setpoint: float | None,
    trials: int,
    residual: Floats,
    each: Floats,
    measured: Floats,
) -> ExperimentError:
    rms = float(np.degrees(np.sqrt(np.mean(residual**2))))
    reference = setpoint if setpoint else float(np.degrees(np.max(np.abs(measured))))
    return ExperimentError(
        experiment=name,
        setpoint_deg=setpoint,
        trials=trials,
        rms_deg=rms,
        percent=100.0 * rms / reference if reference > 0 else float("nan"),
        each_trial_deg=float(np.degrees(np.sqrt(np.mean(each**2)))),
    )
