"""Which order do the data ask for: the fractional model beside one and two poles.

AIC and BIC of Gaussian residuals with one unknown variance (Akaike 1974,
doi:10.1109/TAC.1974.1100705; Schwarz 1978, doi:10.1214/aos/1176344136),

    AIC = m ln(S/n) + 2 (k + 1),    BIC = m ln(S/n) + (k + 1) ln m,

with the sum of squares S over n samples, k parameters and the variance. Residuals of one trial are
alike from sample to sample, so that n samples are worth m < n independent ones, which a criterion
that counts samples has to know: m is n over the residuals' integrated autocorrelation time (Geyer
1992, doi:10.1214/ss/1177011137), taken of the model with the smallest S and used for all, as an
overdispersion is (Burnham and Anderson 2002, doi:10.1007/b97636, 2.5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.fractional import simulate, step_map
from spa_fo.identify.baselines import Baseline, fit_first_order, fit_on_logs, fit_second_order
from spa_fo.identify.polish import Optimum
from spa_fo.identify.protocol import StepData
from spa_fo.identify.whole_log import LogData, held_response
from spa_fo.plant.transfer_function import PARAMETERS

KEY = "orders"
"""Key of a model file that holds the comparison."""
FRACTIONAL = "fractional order"


@dataclass(frozen=True)
class Contender:
    """One model of the comparison.

    Attributes
    ----------
    model : str
        "fractional order", "second order" or "first order".
    parameters : mapping
        Values in SI units, angles in rad.
    rms_deg : float
        Over all samples of all trials.
    aic, bic : float or None
        None where the independent samples are too few.
    """

    model: str
    parameters: Mapping[str, float]
    rms_deg: float
    aic: float | None
    bic: float | None


@dataclass(frozen=True)
class OrderComparison:
    """The models side by side, the fractional one first.

    Attributes
    ----------
    contenders : tuple of Contender
    samples : int
        n.
    independent : float
        m: how many of them count.
    """

    contenders: tuple[Contender, ...]
    samples: int
    independent: float

    def best(self, criterion: str) -> str | None:
        """Name the model with the smallest "aic" or "bic"; None where there are none."""
        known = [one for one in self.contenders if getattr(one, criterion) is not None]
        return min(known, key=lambda one: float(getattr(one, criterion))).model if known else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "samples": self.samples,
            "independent_samples": self.independent,
            "noise": "Gaussian, one variance, autocorrelated as the residuals of the best model",
            "models": [asdict(one) for one in self.contenders],
        }


def compare_on_steps(data: StepData, optimum: Optimum) -> OrderComparison:
    """Compare on up-steps; `optimum` is the fractional model's."""
    unit = step_map(data.t).response(optimum.x)
    residuals = {FRACTIONAL: list(data.angle_rad - data.u[:, np.newaxis] * unit)}
    integer = [fit_second_order(data), fit_first_order(data)]
    for one in integer:
        residuals[one.kind] = [
            angle - one.step(data.t, float(u))
            for u, angle in zip(data.u, data.angle_rad, strict=True)
        ]
    return _compare(residuals, optimum, integer)


def compare_on_logs(logs: Sequence[LogData], optimum: Optimum) -> OrderComparison:
    """Compare on whole logs; `optimum` is the fractional model's."""
    g = optimum.transfer_function
    residuals = {
        FRACTIONAL: [
            (
                log.angle_rad
                - simulate(log.t, log.u, g.alpha2, g.alpha1, g.a1, g.a0, g.b0, hold=log.hold)
            )[log.known]
            for log in logs
        ]
    }
    integer = [fit_on_logs(logs, poles) for poles in (2, 1)]
    for one in integer:
        unit_step = partial(_unit_step, one)
        residuals[one.kind] = [
            (log.angle_rad - held_response(log, unit_step))[log.known] for log in logs
        ]
    return _compare(residuals, optimum, integer)


def _unit_step(model: Baseline, t: Floats) -> Floats:
    return model.step(t, 1.0)


def independent_samples(series: Sequence[Floats]) -> float:
    """Return how many independent samples autocorrelated ones are worth, at least one a series.

    Parameters
    ----------
    series : sequence of arrays
        Residuals, trial by trial.
    """
    longest = max(one.size for one in series)
    size = 2 * longest
    # Autocovariances of all lags at once; their mean is not taken off, it is misfit too.
    spectra = [np.abs(np.fft.rfft(one, size)) ** 2 for one in series]
    covariance = np.fft.irfft(np.sum(spectra, axis=0), size)[:longest]
    total = sum(one.size for one in series)
    if covariance[0] <= 0.0:
        return float(total)
    correlation = covariance / covariance[0]
    # Geyer: sums of neighbouring lags, as long as they are positive.
    pairs = correlation[: longest - longest % 2].reshape(-1, 2).sum(axis=1)
    positive = pairs > 0.0
    last = pairs.size if positive.all() else int(np.argmin(positive))
    time = max(1.0, 2.0 * float(pairs[:last].sum()) - 1.0)
    return max(float(len(series)), total / time)


def _compare(
    residuals: Mapping[str, Sequence[Floats]], optimum: Optimum, integer: Sequence[Baseline]
) -> OrderComparison:
    squares = {name: float(sum(one @ one for one in series)) for name, series in residuals.items()}
    best = min(squares, key=lambda name: squares[name])
    samples = sum(one.size for one in residuals[best])
    independent = independent_samples(residuals[best])
    parameters = {FRACTIONAL: dict(zip(PARAMETERS, optimum.x.tolist(), strict=True))}
    parameters |= {one.kind: dict(one.parameters) for one in integer}
    contenders = []
    for name, values in parameters.items():
        variance = squares[name] / samples
        aic, bic = criteria(variance, len(values), independent)
        rms = float(np.degrees(np.sqrt(variance)))
        contenders.append(Contender(name, values, rms, aic, bic))
    return OrderComparison(tuple(contenders), samples, independent)


def criteria(
    variance: float, parameters: int, independent: float
) -> tuple[float | None, float | None]:
    """Return AIC and BIC of residuals; None where the independent samples are too few.

    Parameters
    ----------
    variance : float
        Of the residuals.
    parameters : int
        Of the model.
    independent : float
        Samples that count, see `independent_samples`.
    """
    free = parameters + 1
    if variance <= 0.0 or independent <= len(PARAMETERS) + 1:
        return None, None
    deviance = independent * float(np.log(variance))
    return deviance + 2.0 * free, deviance + free * float(np.log(independent))
