"""How far an approximation is from the exact model: over the band, and in the step response."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.export.approximation import Approximation, Band
from spa_fo.export.discrete import DiscreteFilter
from spa_fo.export.fitted import exact_response
from spa_fo.export.oustaloup import Operator
from spa_fo.fractional import step_response
from spa_fo.plant import TransferFunction

_POINTS = 300
_TIMES = 120
_LONGEST = 20_000  # samples of a filter's step response


@dataclass(frozen=True)
class Accuracy:
    """Errors of an approximation against the exact fractional model.

    Attributes
    ----------
    max_db, rms_db, max_deg, rms_deg : float
        Of magnitude and phase, over the band, evenly in the logarithm of the frequency.
    max_step_percent, rms_step_percent : float
        Of the step response from 1/high to 1/low, in per cent of the steady state.
    static_gain_percent : float
        Of the steady state itself.
    """

    max_db: float
    rms_db: float
    max_deg: float
    rms_deg: float
    max_step_percent: float
    rms_step_percent: float
    static_gain_percent: float

    def to_dict(self) -> dict[str, float]:
        """Return the numbers by name."""
        return asdict(self)

    def text(self) -> str:
        """Say it in one line."""
        return (
            f"at most {self.max_db:.2g} dB and {self.max_deg:.2g}° (rms {self.rms_db:.2g} dB, "
            f"{self.rms_deg:.2g}°) over the band; step response at most "
            f"{self.max_step_percent:.2g} % of its steady state (rms {self.rms_step_percent:.2g} "
            f"%), steady state itself {_percent(self.static_gain_percent)}"
        )


def _percent(value: float) -> str:
    return "exact" if abs(value) < 1e-9 else f"{value:.2g} % off"


@dataclass(frozen=True)
class FilterAccuracy:
    """Errors of a discrete filter's step response, in per cent of the steady state.

    Attributes
    ----------
    max_step_percent, rms_step_percent : float
        In double precision, at the samples.
    single_step_percent : float
        Largest with coefficients and states in single precision, as on a small board.
    seconds : float
        How long a response was compared.
    """

    max_step_percent: float
    rms_step_percent: float
    single_step_percent: float
    seconds: float

    def to_dict(self) -> dict[str, float]:
        """Return the numbers by name."""
        return asdict(self)

    def text(self) -> str:
        """Say it in one line."""
        return (
            f"step response at most {self.max_step_percent:.2g} % of its steady state over "
            f"{self.seconds:.3g} s (rms {self.rms_step_percent:.2g} %); in single precision "
            f"{self.single_step_percent:.2g} %"
        )


def frequencies(approximation: Approximation) -> Floats:
    """Return the frequencies (rad/s) at which errors are taken, shape (300,)."""
    return np.geomspace(approximation.band.low, approximation.band.high, _POINTS)


def measure(g: TransferFunction, approximation: Approximation) -> Accuracy:
    """Compare an approximation with the exact model.

    Parameters
    ----------
    g : TransferFunction
        The model.
    approximation : Approximation
        Made from it.
    """
    rational, band = approximation.rational, approximation.band
    omega = frequencies(approximation)
    ratio = rational.response(omega) / exact_response(g, omega)
    magnitude, phase = 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
    t = np.geomspace(1.0 / band.high, 1.0 / band.low, _TIMES)
    step = 100.0 * (rational.step(t) - exact_step(g, t)) / g.gain
    static = rational.response(np.zeros(1))[0].real
    return Accuracy(
        max_db=_largest(magnitude),
        rms_db=_rms(magnitude),
        max_deg=_largest(phase),
        rms_deg=_rms(phase),
        max_step_percent=_largest(step),
        rms_step_percent=_rms(step),
        static_gain_percent=float(100.0 * (static / g.gain - 1.0)),
    )


def measure_operator(operator: Operator, band: Band) -> dict[str, float]:
    """Compare a filter of s^α with s^α over a band: max and rms in dB and degrees."""
    omega = np.geomspace(band.low, band.high, _POINTS)
    ratio = operator.response(omega) / (1j * omega) ** operator.order
    magnitude, phase = 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
    return {
        "max_db": _largest(magnitude),
        "rms_db": _rms(magnitude),
        "max_deg": _largest(phase),
        "rms_deg": _rms(phase),
    }


def measure_filter(g: TransferFunction, made: DiscreteFilter, seconds: float) -> FilterAccuracy:
    """Compare a discrete filter's step response with the exact one at the samples.

    Parameters
    ----------
    g : TransferFunction
        The model.
    made : DiscreteFilter
        The filter of G alone, without lags and dead time.
    seconds : float
        How long; cut to 20 000 samples.
    """
    T = made.sample_time_s
    count = int(np.clip(seconds / T, 10, _LONGEST))
    t = np.arange(count, dtype=np.float64) * T
    exact = exact_step(g, t)
    errors = [
        100.0 * (made.run(np.ones(count, kind)) - exact) / g.gain
        for kind in (np.float64, np.float32)
    ]
    return FilterAccuracy(
        max_step_percent=_largest(errors[0]),
        rms_step_percent=_rms(errors[0]),
        single_step_percent=_largest(errors[1]),
        seconds=float(t[-1]),
    )


def exact_step(g: TransferFunction, t: Floats) -> Floats:
    """Unit-step response of G, exact; see `spa_fo.fractional.step_response`."""
    return step_response(t, g.alpha2, g.alpha1, g.a1, g.a0, g.b0)


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values)))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
