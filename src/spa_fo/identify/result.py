"""What a fit of a campaign returns: model, errors, uncertainty, report and warnings."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.identify.curve_choice import CurveChoice
from spa_fo.identify.drive_fit import KEY as DRIVE
from spa_fo.identify.drive_fit import DriveFit
from spa_fo.identify.moderate import WORTH
from spa_fo.identify.polish import Optimum
from spa_fo.identify.protocol import StepData
from spa_fo.identify.selection import OrderComparison
from spa_fo.identify.uncertainty import Uncertainty
from spa_fo.plant import PARAMETERS, Model
from spa_fo.plant.estimates import QUANTITIES, Estimate, bare_estimates

ON_STEPS = "up-steps"
ON_WHOLE_LOGS = "whole logs"
FROM_STEPS = "standard error; 95 % profile-likelihood interval"
FROM_WHOLE_LOGS = "standard error, from leaving out one log at a time"


@dataclass(frozen=True)
class ExperimentError:
    """How well the model meets one experiment.

    Attributes
    ----------
    experiment : str
    setpoint_deg : float or None
    trials : int
    rms_deg, percent : float
        Against the mean response on up-steps, as in the paper, in degrees and per cent of the
        setpoint (of the largest mean angle where there is none); against every sample on whole
        logs.
    each_trial_deg : float
        Against the trials one by one.
    """

    experiment: str
    setpoint_deg: float | None
    trials: int
    rms_deg: float
    percent: float
    each_trial_deg: float


@dataclass(frozen=True)
class FitResult:
    """A campaign's identification.

    Attributes
    ----------
    model : Model
        The plain one, for `write_model`.
    fitted_on : str
        `ON_STEPS` or `ON_WHOLE_LOGS`.
    provenance : str
        "measured" or "synthetic".
    optimum : Optimum
        The least squares.
    errors : tuple of ExperimentError
    datasets, samples : int
        Responses and samples the fit rests on.
    uncertainty : Uncertainty or None
        None for whole logs.
    log_errors : (6,) array or None
        Standard errors of `QUANTITIES` for whole logs; None for up-steps and for a single log.
    orders : OrderComparison or None
        The model beside those of integer order, on the same samples.
    curve : CurveChoice or None
        A static curve beside the plain model, where one was asked for.
    drive : DriveFit or None
        From command to pressure, where a curve was asked for and the command is no pressure.
    left_out : tuple of str
        Trials not used, and why.
    data : StepData or None
        The step responses; None for whole logs.
    """

    model: Model
    fitted_on: str
    provenance: str
    optimum: Optimum
    errors: tuple[ExperimentError, ...]
    datasets: int
    samples: int
    uncertainty: Uncertainty | None
    left_out: tuple[str, ...]
    data: StepData | None = None
    log_errors: Floats | None = None
    orders: OrderComparison | None = None
    curve: CurveChoice | None = None
    drive: DriveFit | None = None

    @property
    def chosen_model(self) -> Model:
        """The model with its static curve, where one was asked for and is worth having."""
        model = self.model if self.curve is None else self.curve.augment(self.model)
        if self.drive is None:
            return model
        return replace(model, extra={**model.extra, DRIVE: self.drive.to_dict()})

    @property
    def gain(self) -> float:
        """Static gain K, rad for u = 1."""
        return self.model.transfer_function.gain

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """`QUANTITIES` with their uncertainty; the kind is empty where a single log tells none."""
        return estimates_of(self.model, self.uncertainty, self.log_errors)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the parameters must know, in words."""
        return tuple(_warnings(self))

    def report(self) -> str:
        """Return the fit report: one screen of text."""
        from spa_fo.identify.fit_report import fit_report

        return fit_report(self)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; NaN and infinity become None."""
        document = {
            "model": self.model.to_dict(),
            "fitted_on": self.fitted_on,
            "provenance": self.provenance,
            "gain_rad": self.gain,
            "rmse_deg": float(np.degrees(self.optimum.rmse)),
            "bounds": {
                "name": self.optimum.bounds.name,
                "lower": dict(zip(PARAMETERS, self.optimum.bounds.lower, strict=True)),
                "upper": dict(zip(PARAMETERS, self.optimum.bounds.upper, strict=True)),
            },
            "at_bounds": self.optimum.at_bounds,
            "valid": self.optimum.valid,
            "evaluations": self.optimum.evaluations,
            "datasets": self.datasets,
            "samples": self.samples,
            "errors": [asdict(error) for error in self.errors],
            "uncertainty": None if self.uncertainty is None else _uncertainty(self.uncertainty),
            "log_errors": None
            if self.log_errors is None
            else dict(zip(QUANTITIES, self.log_errors, strict=True)),
            "orders": None if self.orders is None else self.orders.to_dict(),
            "static_curve": None if self.curve is None else self.curve.to_dict(),
            "drive": None if self.drive is None else self.drive.to_dict(),
            "left_out": self.left_out,
            "warnings": self.warnings,
        }
        plain: dict[str, Any] = _plain(document)
        return plain


def estimates_of(
    model: Model, uncertainty: Uncertainty | None, errors: Floats | None
) -> tuple[Estimate, ...]:
    """Give each quantity of a model with its error, and its interval where there is one."""
    bare = bare_estimates(model)
    if uncertainty is not None:
        return tuple(
            replace(
                one,
                error=_known(uncertainty.covariance.standard_error[i]),
                low=profile.low_95,
                high=profile.high_95,
                open_low=profile.open_low,
                open_high=profile.open_high,
                kind=FROM_STEPS,
                determined=profile.determined,
            )
            for i, (one, profile) in enumerate(zip(bare, uncertainty.profiles, strict=True))
        )
    if errors is not None:
        return tuple(
            replace(one, error=_known(error), kind=FROM_WHOLE_LOGS)
            for one, error in zip(bare, errors, strict=True)
        )
    return bare


def _known(error: float) -> float | None:
    return float(error) if np.isfinite(error) else None


# A model that misses the mean response by more than this many standard errors of the trials'
# scatter has a gap, not noise.
_GAP = 3.0


def _warnings(result: FitResult) -> list[str]:
    optimum, found = result.optimum, []
    if not optimum.valid:
        found.append("the search ended before it had converged")
    if optimum.at_bounds:
        found.append(f"on the bounds: {', '.join(optimum.at_bounds)}")
    if optimum.bounds.name == "free" and "alpha1 lower" in optimum.at_bounds:
        found.append(
            f"alpha1 was held at or above {optimum.bounds.lower[1]:g}: below, the squares fall by "
            f"less than {100 * WORTH:g} %, and b0/a0 would be an extrapolation"
        )
    assessed = result.uncertainty
    if assessed is not None:
        if assessed.undetermined:
            widest = assessed.widest
            found.append(
                f"these data do not determine {', '.join(assessed.undetermined)}: with "
                f"{widest.name} anywhere from {widest.low_95:.3g} to {widest.high_95:.3g} the "
                f"refitted curve moves by at most {widest.likely_change_deg:.2g}°"
            )
        if not assessed.profile("K").determined:
            found.append("these data do not determine the gain K")
        if not assessed.noise.repeated:
            found.append("no experiment was repeated: noise is taken from the fit's residuals")
        elif assessed.chi2 > _GAP**2 * assessed.dof:
            times = np.sqrt(assessed.chi2 / assessed.dof)
            found.append(
                f"the model misses the mean responses by {times:.1f} times what the trials' "
                "scatter explains: its form, not noise"
            )
    elif result.log_errors is None:
        found.append("a single log: its errors cannot be told")
    else:
        found.append("errors are from leaving out one log at a time")
    if result.left_out:
        found.append(f"left out: {'; '.join(result.left_out)}")
    return found


def _uncertainty(assessed: Uncertainty) -> dict[str, Any]:
    document = {
        "noise_deg": {
            name: float(np.degrees(getattr(assessed.noise, name)))
            for name in ("total", "white", "between")
        },
        "design_effect": assessed.noise.design_effect,
        "chi2": assessed.chi2,
        "dof": assessed.dof,
        "scale": assessed.scale,
        "condition_number": assessed.covariance.condition_number,
        "standard_error": dict(zip(QUANTITIES, assessed.covariance.standard_error, strict=True)),
        "correlation": assessed.covariance.correlation,
        "profiles": [
            asdict(profile) | {"likely_change_deg": profile.likely_change_deg}
            for profile in assessed.profiles
        ],
        "undetermined": assessed.undetermined,
        "widest": assessed.widest.name,
        "bootstrap": None,
    }
    if assessed.bootstrap is not None:
        b = assessed.bootstrap
        document["bootstrap"] = {
            "resamples": len(b.x),
            "low": dict(zip(QUANTITIES, b.low, strict=True)),
            "high": dict(zip(QUANTITIES, b.high, strict=True)),
            "standard_deviation": dict(zip(QUANTITIES, b.standard_deviation, strict=True)),
            "curve_error_deg": b.curve_error_deg,
        }
    return document


def _plain(value: Any) -> Any:
    """Turn arrays, tuples and NumPy numbers into what JSON knows."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
