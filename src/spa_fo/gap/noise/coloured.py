"""What no two trials of one experiment share: coloured noise, and scatter from trial to trial.

Within a trial the noise is a sum of Ornstein-Uhlenbeck processes, one a decade of correlation time
and a bit, and white noise:

    R = diag(d) + v_0 diag(1/n) + Σ_k v_k C_k,   C_k(t, t') = exp(-|t - t'| / τ_k)

each averaged over the steps that the samples are averaged over. Sums of this kind come near any
falling spectrum, 1/f among them. The variances maximise the restricted likelihood (Patterson and
Thompson 1971, doi:10.1093/biomet/58.3.545) of what repeated trials differ by, with a trial's own
zero, gain, delay and time scale taken out, under a prior as wide as benches are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, helmert, null_space, orth, solve_triangular
from scipy.optimize import minimize, minimize_scalar

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.data.searched import wave
from spa_fo.gap.settings import SETTINGS

CORRELATION_S = 0.06 * 4.0 ** np.arange(6)
"""Correlation times of the coloured parts: 0.06 s, a filter's, to 61 s, slow air's."""
TYPICAL_DEG = SETTINGS.coloured_deg
"""Prior median of each part's standard deviation, deg."""

_PRIOR_SPREAD = np.append(np.full(6, np.log(SETTINGS.coloured_factor)), np.log(1.5))
"""Of each logarithm; last, of the white part's about what neighbouring samples differ by."""
_LOG_VARIANCES = (2.0 * np.log(1e-3), 4.0)
_MOST_ROWS = 100
_LINE_NATS = 10.0  # beyond the price of the search: a line in the differences is no noise
_LINE_HZ = np.linspace(0.03, 3.2, 400)
_REGULAR = 1e-6  # variance that keeps the covariance of a smooth signal regular
_ALWAYS_UNSURE = 0.15  # nat, of ln(noise level), however many repeats there are. Assumed.
_OWN_FREEDOM = 2.0  # degrees of freedom that a bench's typical scatter counts as
_TOLD = [1, 0, 3]  # where gain, zero and time scale stand among what is fitted to a contrast
_LOG_SCATTERS = np.linspace(-np.log(30.0), np.log(100.0), 41)  # about a typical one


@dataclass(frozen=True)
class Averages:
    """What averaged samples are averages of."""

    time_s: Floats  # (n,): middle of what each is over
    width_s: Floats  # (n,): its length
    count: Floats  # (n,): samples in it
    fixed: Floats  # (n,): variance that is known, deg²

    def merged(self, first: Integers) -> Averages:
        """Merge neighbours, each lot of which begins at one of `first`."""
        number = np.diff(np.append(first, self.time_s.size))
        time, width, count, fixed = (
            np.add.reduceat(each, first)
            for each in (self.time_s, self.width_s, self.count, self.fixed)
        )
        return Averages(time / number, width, count, fixed / number**2)

    def correlations(self) -> Floats:
        """Correlations of averaged Ornstein-Uhlenbeck processes of `CORRELATION_S`, (6, n, n).

        The integral of exp(-|t - t'|/τ) over two windows of lengths w and w' that do not overlap is
        τ²/(w w') times 4 sinh(w/2τ) sinh(w'/2τ) exp(-distance of their middles/τ).
        """
        half = 0.5 * (self.width_s[:, None] + self.width_s)
        apart = np.maximum(np.abs(self.time_s[:, None] - self.time_s), half)
        parts = np.empty((CORRELATION_S.size, *apart.shape))
        for part, tau in zip(parts, CORRELATION_S, strict=True):
            w = np.maximum(self.width_s / tau, 1e-6)
            # exp(-w/2) is put into both factors, so that nothing overflows.
            edge = -np.expm1(-w) / w
            part[:] = np.outer(edge, edge) * np.exp((half - apart) / tau)
            own = 2.0 / w**2 * (w + np.expm1(-w))
            np.fill_diagonal(part, np.where(w < 1e-3, 1.0 - w / 3.0, own))
        return parts


@dataclass(frozen=True)
class Spectrum:
    """Noise within a trial."""

    white: float  # variance of one sample's white noise, deg²
    coloured: Floats  # (6,): variance of the part of each of `CORRELATION_S`, deg²
    repeats: int = 0  # degrees of freedom behind it; 0 where only the prior speaks

    @property
    def deviation_deg(self) -> float:
        """Standard deviation of one sample, deg."""
        return float(np.sqrt(self.white + self.coloured.sum()))

    def beside(self, other: Spectrum) -> Spectrum:
        """Add independent noise."""
        return Spectrum(
            self.white + other.white, self.coloured + other.coloured, self.repeats + other.repeats
        )

    def coloured_covariance(self, rows: Averages) -> Floats:
        """Covariance of the coloured noise of averages, (n, n)."""
        return np.tensordot(self.coloured, rows.correlations(), axes=1)

    def variance(self, rows: Averages) -> Floats:
        """Variance of the white noise of averages and of what is known besides, (n,)."""
        return self.white / rows.count + rows.fixed

    def whitener(self, rows: Averages) -> Floats:
        """Whitener of averages of one trial, (n, n)."""
        return whitener(self.coloured_covariance(rows) + np.diag(self.variance(rows)))


def whitener(covariance: Floats) -> Floats:
    """Lower-triangular W with W R Wᵀ = 1, for a covariance R, (n, n); its rows are contiguous."""
    lower = np.linalg.cholesky(covariance)
    eye = np.eye(lower.shape[0])
    return np.ascontiguousarray(solve_triangular(lower, eye, lower=True, check_finite=False))


@dataclass(frozen=True)
class Differences(Averages):
    """What trials of one experiment differ by."""

    values: Floats  # (contrasts, n): orthonormal, each has the noise of one trial
    nuisances: Floats  # (n, q): what a trial's own zero, gain, delay and time scale make
    between: Floats  # (contrasts, trials): what they are contrasts of

    def own(self, spectrum: Spectrum) -> tuple[Floats, Floats]:
        """Fit each contrast's zero (deg), gain, delay (s) and time scale; their variances."""
        white = spectrum.whitener(self)
        x = white @ self.nuisances
        inverse = np.linalg.pinv(x.T @ x)
        return self.values @ white.T @ x @ inverse, np.diag(inverse)


def contrasts(
    angles_deg: Floats,
    rows: Averages,
    quicker: Floats,
    which: Floats | None = None,
    shown: Floats | None = None,
) -> Differences:
    """Take repeated trials, (trials, n), apart into their mean and orthonormal contrasts.

    `quicker`, (n,), is what a time scale of its own does to a trial, deg; `which` are these among
    all trials, (trials, all), where there are others; `shown`, (n,), is how much shows of a
    gain or time scale of its own: all of it by default.
    """
    between = helmert(len(angles_deg))
    values, mean = between @ angles_deg, angles_deg.mean(axis=0)
    own = between if which is None else between @ which
    return _differences(values, rows, mean, quicker, own, shown)


def misfit(time_s: Floats, left: Floats, shape: Floats) -> Differences:
    """Take what is left of one trial's signal for noise, (n,) arrays.

    `shape` is what a gain of the trial's own would multiply.
    """
    ones = np.ones(left.size)
    rows = Averages(time_s, ones * np.median(np.diff(time_s)), ones, 0.0 * ones)
    found = _differences(left[None, :], rows, shape, 0.0 * ones, np.ones((1, 1)))
    alike = np.ones(found.count.size)  # a shorter last row is taken for one like the others
    return replace(found, width_s=found.width_s[0] * alike, fixed=_REGULAR * alike)


def _differences(
    values: Floats,
    rows: Averages,
    shape: Floats,
    quicker: Floats,
    between: Floats,
    shown: Floats | None = None,
) -> Differences:
    """Merge neighbours, as a restricted likelihood costs the third power of the rows."""
    shown = np.ones(shape.size) if shown is None else shown
    first = np.arange(0, shape.size, -(-shape.size // _MOST_ROWS))
    number = np.diff(np.append(first, shape.size))
    few = rows.merged(first)
    values, shape, gain, quicker = (
        np.add.reduceat(each, first, axis=-1) / number
        for each in (values, shape, shown * shape, shown * quicker)
    )
    nuisances = [np.ones(first.size), gain, np.gradient(shape, few.time_s), quicker]
    return Differences(**vars(few), values=values, nuisances=np.array(nuisances).T, between=between)


def unexplained(differences: Sequence[Differences]) -> float:
    """Sum of squares of what contrasts show beside zeros, gains, delays and time scales, deg²."""
    return float(sum(np.sum((d.values @ null_space(d.nuisances.T)) ** 2) for d in differences))


def estimate(differences: Sequence[Differences], white_deg: float) -> Spectrum:
    """Estimate the noise within trials: the maximum of restricted likelihood and prior.

    Parameters
    ----------
    differences : sequence of Differences
        Of every experiment that was repeated; may be empty.
    white_deg : float
        White noise of one sample, by differences of neighbours.
    """
    found = _most_probable(differences, white_deg)
    hz = _line(differences, found)
    if hz is None:
        return found
    waves = [np.hstack([d.nuisances, wave(hz, d.time_s, d.width_s)]) for d in differences]
    without = [replace(d, nuisances=n) for d, n in zip(differences, waves, strict=True)]
    return _most_probable(without, white_deg)


def _most_probable(differences: Sequence[Differences], white_deg: float) -> Spectrum:
    groups = [_restricted(d) for d in differences]
    centre = np.log(np.append(np.full(CORRELATION_S.size, TYPICAL_DEG**2), white_deg**2))

    def loss(z: Floats) -> tuple[float, Floats]:
        away = (z - centre) / (2.0 * _PRIOR_SPREAD)
        value, slope = 0.5 * float(away @ away), away / (2.0 * _PRIOR_SPREAD)
        variances = np.exp(z)
        for values, fixed, parts in groups:
            covariance = fixed + np.tensordot(variances, parts, axes=1)
            factor = cho_factor(covariance, lower=True, check_finite=False)
            solved = cho_solve(factor, values.T, check_finite=False)
            inverse = cho_solve(factor, np.eye(len(fixed)), check_finite=False)
            log_root = float(np.sum(np.log(np.diag(factor[0]))))
            value += 0.5 * float(np.sum(values.T * solved)) + len(values) * log_root
            # d/dv of ½ (r'S⁻¹r + log|S|) is ½ (tr S⁻¹C - a'Ca), a being S⁻¹r.
            weight = len(values) * inverse - solved @ solved.T
            slope = slope + 0.5 * np.tensordot(parts, weight, axes=2) * variances
        return value, slope

    bounds = [_LOG_VARIANCES] * centre.size
    found = minimize(loss, centre, jac=True, method="L-BFGS-B", bounds=bounds)
    variances = np.exp(found.x)
    freedom = sum(len(d.values) for d in differences)
    return Spectrum(float(variances[-1]), variances[:-1], freedom)


def _restricted(d: Differences) -> tuple[Floats, Floats, Floats]:
    """Contrasts cleared of nuisances, their known covariance, and what each variance adds."""
    q = null_space(d.nuisances.T)
    parts = [*d.correlations(), np.diag(1.0 / d.count)]
    return d.values @ q, (q.T * d.fixed) @ q, np.array([q.T @ part @ q for part in parts])


def _line(differences: Sequence[Differences], spectrum: Spectrum) -> float | None:
    """Find the frequency of a periodic interference that stands out of the noise, Hz."""
    gain = np.zeros(_LINE_HZ.size)
    for d in differences:
        white = spectrum.whitener(d)
        basis = orth(white @ d.nuisances)  # some may be none
        clear = white - basis @ (basis.T @ white)
        waves = clear @ np.moveaxis(wave(_LINE_HZ, d.time_s, d.width_s), 1, 0)
        gain += 0.5 * np.sum((d.values @ clear.T @ np.linalg.qr(waves)[0]) ** 2, axis=(1, 2))
    freedom = sum(len(d.values) for d in differences)
    best = int(np.argmax(gain))
    stands_out = gain[best] - freedom > _LINE_NATS + np.log(gain.size)
    return float(_LINE_HZ[best]) if stands_out else None


def level_spread(repeats: int) -> float:
    """By how much the noise is more or less than estimated: 1 sigma of its logarithm."""
    if not repeats:
        return SETTINGS.level_alone
    return SETTINGS.level_repeated / float(np.sqrt(repeats)) + _ALWAYS_UNSURE


@dataclass(frozen=True)
class Scatter:
    """What trials scatter by, 1 sigma: gain, rest angle (deg), time scale."""

    gain: float
    rest_deg: float
    time_scale: float

    def beside(self, other: Scatter) -> Scatter:
        """Add independent scatter."""
        return Scatter(*map(math.hypot, astuple(self), astuple(other)))


def scatter(
    differences: Sequence[Differences],
    spectrum: Spectrum,
    typical: Scatter,
    zeros_deg: Floats | None = None,
    gains: Floats | None = None,
) -> Scatter:
    """Estimate what trials scatter by, about what is typical: the most probable variance of each.

    An experiment whose transients hardly tell its trials' time scales counts as little as that.

    `zeros_deg` and `gains`, (trials,), are what is known to go with their order. What is typically
    0 is 0.
    """
    values, errors = [np.zeros((0, 4))], [np.zeros((0, 4))]
    for d in differences:
        fitted, variance = d.own(spectrum)
        if zeros_deg is not None:
            fitted[:, 0] -= d.between @ zeros_deg
        if gains is not None:
            fitted[:, 1] -= d.between @ gains
        values.append(fitted)
        errors.append(np.broadcast_to(variance, fitted.shape))
    each = zip(
        np.vstack(values).T[_TOLD], np.vstack(errors).T[_TOLD], astuple(typical), strict=True
    )
    return Scatter(*(_deviation(*one) for one in each))


def _deviation(values: Floats, variance: Floats, typical: float) -> float:
    """Find the deviation that values, (n,), with errors of their own, scatter by about 0.

    Beforehand its square is as if `_OWN_FREEDOM` such values had been of a typical size.
    """
    if typical == 0.0 or not values.size:
        return typical

    def loss(log: float) -> float:
        square = math.exp(2.0 * log)
        own = _OWN_FREEDOM * (2.0 * log + typical**2 / square)
        return own + float(np.sum(np.log(square + variance) + values**2 / (square + variance)))

    tried = math.log(typical) + _LOG_SCATTERS
    best = int(np.argmin([loss(log) for log in tried.tolist()]))
    near = tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)]
    return math.exp(minimize_scalar(loss, bounds=near, method="bounded").x)
