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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from spa_fo.gap.settings import SETTINGS

Floats = NDArray[np.float64]

CORRELATION_S = 0.06 * 4.0 ** np.arange(6)
"""Correlation times of the coloured parts: 0.06 s, a filter's, to 61 s, slow air's."""

TYPICAL_DEG = SETTINGS.coloured_deg
"""Prior median of each part's standard deviation, deg."""
PRIOR_SPREAD = np.log(SETTINGS.coloured_factor)
"""Prior spread of the logarithm of a standard deviation."""
WHITE_SPREAD = np.log(1.5)
"""The same of the white part about what differences of neighbouring samples say."""

_QUIETEST_DEG = 1e-3
_MOST_ROWS = 100
_LINE_NATS = 10.0  # beyond the price of the search: a line in the differences is no noise
_LINE_HZ = np.linspace(0.03, 3.2, 400)


@dataclass(frozen=True)
class Spectrum:
    """Noise within a trial.

    Attributes
    ----------
    white : float
        Variance of one sample's white noise, deg².
    coloured : (6,) array
        Variance of the part of each of `CORRELATION_S`, deg².
    repeats : int
        Degrees of freedom behind it: repeated trials less their experiments; 0 where only the
        prior speaks.
    """

    white: float
    coloured: Floats
    repeats: int = 0

    @property
    def deviation_deg(self) -> float:
        """Standard deviation of one sample, deg."""
        return float(np.sqrt(self.white + self.coloured.sum()))

    def beside(self, other: Spectrum) -> Spectrum:
        """Add independent noise."""
        return Spectrum(
            self.white + other.white, self.coloured + other.coloured, self.repeats + other.repeats
        )

    def covariance(self, time_s: Floats, width_s: Floats, count: Floats) -> Floats:
        """Covariance of averages, (n, n).

        Parameters
        ----------
        time_s, width_s : (n,) arrays
            Middle and length of what each average is over.
        count : (n,) array
            Samples in each.
        """
        parts = averaged(time_s, width_s)
        total = np.tensordot(self.coloured, parts, axes=1)
        total[np.diag_indices_from(total)] += self.white / count
        return np.asarray(total)


def averaged(time_s: Floats, width_s: Floats) -> Floats:
    """Correlations of averages of Ornstein-Uhlenbeck processes, (6, n, n).

    The integral of exp(-|t - t'|/τ) over two windows of lengths w and w' that do not overlap is
    τ²/(w w') times the product of 4 sinh(w/2τ) sinh(w'/2τ) and exp(-distance of their middles/τ).
    """
    distance = np.abs(time_s[:, None] - time_s[None, :])
    apart = np.maximum(distance, 0.5 * (width_s[:, None] + width_s[None, :]))
    parts = np.empty((CORRELATION_S.size, time_s.size, time_s.size))
    for k, tau in enumerate(CORRELATION_S):
        w = np.maximum(width_s / tau, 1e-6)
        # exp(-w/2) is put into both factors, so that nothing overflows.
        edge = -np.expm1(-w) / w
        gap = apart / tau - 0.5 * (w[:, None] + w[None, :])
        parts[k] = np.outer(edge, edge) * np.exp(-gap)
        own = 2.0 / w**2 * (w + np.expm1(-w))
        parts[k][np.diag_indices(time_s.size)] = np.where(w < 1e-3, 1.0 - w / 3.0, own)
    return parts


@dataclass(frozen=True)
class Differences:
    """What trials of one experiment differ by.

    Attributes
    ----------
    values : (contrasts, n) array
        Orthonormal contrasts of the trials: each has the noise of one trial.
    nuisances : (n, q) array
        What a trial's own zero, gain, delay and time scale make of the mean.
    fixed : (n,) array
        Variance that is known, deg².
    time_s, width_s, count : (n,) arrays
        Of the averages.
    between : (contrasts, trials) array
        What they are contrasts of.
    """

    values: Floats
    nuisances: Floats
    fixed: Floats
    time_s: Floats
    width_s: Floats
    count: Floats
    between: Floats

    def own(self, spectrum: Spectrum) -> tuple[Floats, Floats]:
        """Fit the nuisances to each contrast.

        Returns
        -------
        values : (contrasts, q) array
            Zero (deg), gain, delay (s) and time scale.
        variance : (q,) array
            Of their errors.
        """
        covariance = spectrum.covariance(self.time_s, self.width_s, self.count)
        white = whitener(covariance + np.diag(self.fixed))
        x = white @ self.nuisances
        inverse = np.linalg.pinv(x.T @ x)
        return self.values @ white.T @ x @ inverse, np.diag(inverse)


def contrasts(
    angles_deg: Floats,
    time_s: Floats,
    width_s: Floats,
    count: Floats,
    fixed: Floats,
    quicker: Floats,
    which: Floats | None = None,
) -> Differences:
    """Take repeated trials, (trials, n), apart into their mean and orthonormal contrasts.

    `quicker`, (n,), is what a time scale of its own does to a trial, deg; `which` are these among
    all trials, (trials, all), where there are others.
    """
    # A restricted likelihood costs the third power of the rows; merged ones lose little.
    merge = -(-time_s.size // _MOST_ROWS)
    first = np.arange(0, time_s.size, merge)
    number = np.add.reduceat(np.ones(time_s.size), first)
    angles_deg = np.add.reduceat(angles_deg, first, axis=1) / number
    time_s = np.add.reduceat(time_s, first) / number
    fixed = np.add.reduceat(fixed, first) / number**2
    quicker = np.add.reduceat(quicker, first) / number
    width_s, count = np.add.reduceat(width_s, first), np.add.reduceat(count, first)
    trials = angles_deg.shape[0]
    mean = angles_deg.mean(axis=0)
    helmert = np.linalg.qr(np.column_stack([np.ones(trials), np.eye(trials)[:, 1:]]))[0][:, 1:].T
    slope = np.gradient(mean, time_s)
    nuisances = np.column_stack([np.ones(mean.size), mean, slope, quicker])
    between = helmert if which is None else helmert @ which
    return Differences(helmert @ angles_deg, nuisances, fixed, time_s, width_s, count, between)


def misfit(time_s: Floats, left: Floats, shape: Floats) -> Differences:
    """Take what is left of one trial's signal for noise, (n,) arrays.

    `shape` is what a gain of the trial's own would multiply.
    """
    merge = -(-left.size // _MOST_ROWS)
    first = np.arange(0, left.size, merge)
    count = np.add.reduceat(np.ones(left.size), first)

    def merged(values: Floats) -> Floats:
        return np.asarray(np.add.reduceat(values, first) / count)

    time, angle = merged(time_s), merged(shape)
    width = np.full(first.size, float(np.median(np.diff(time_s))) * merge)
    nuisances = np.column_stack([np.ones(first.size), angle, np.gradient(angle, time), 0.0 * time])
    return Differences(
        values=merged(left)[None, :],
        nuisances=nuisances,
        fixed=np.full(first.size, 1e-6),
        time_s=time,
        width_s=width,
        count=count,
        between=np.ones((1, 1)),
    )


def estimate(differences: Sequence[Differences], white_deg: float) -> Spectrum:
    """Estimate the noise within trials.

    Parameters
    ----------
    differences : sequence of Differences
        Of every experiment that was repeated; may be empty.
    white_deg : float
        White noise of one sample, by differences of neighbours.

    Returns
    -------
    Spectrum
        The maximum of restricted likelihood and prior.
    """
    found = _estimate(differences, white_deg)
    line = _line(differences, found)
    return found if line is None else _estimate([_without(d, line) for d in differences], white_deg)


def _estimate(differences: Sequence[Differences], white_deg: float) -> Spectrum:
    groups = [_Group(d) for d in differences]
    centre = np.log(np.append(np.full(CORRELATION_S.size, TYPICAL_DEG**2), white_deg**2))
    spread = 2.0 * np.append(np.full(CORRELATION_S.size, PRIOR_SPREAD), WHITE_SPREAD)

    def loss(z: Floats) -> tuple[float, Floats]:
        away = (z - centre) / spread
        value, slope = 0.5 * float(away @ away), away / spread
        variances = np.exp(z)
        for group in groups:
            more, by = group.loss(variances)
            value += more
            slope = slope + by * variances
        return value, slope

    low = 2.0 * np.log(_QUIETEST_DEG)
    found = minimize(loss, centre, jac=True, method="L-BFGS-B", bounds=[(low, 4.0)] * centre.size)
    variances = np.exp(found.x)
    freedom = sum(d.values.shape[0] for d in differences)
    return Spectrum(float(variances[-1]), variances[:-1], freedom)


class _Group:
    """The restricted likelihood of one experiment's contrasts."""

    def __init__(self, differences: Differences) -> None:
        d = differences
        full = np.linalg.qr(d.nuisances, mode="complete")[0]
        q = full[:, np.linalg.matrix_rank(d.nuisances) :]
        parts = [q.T @ part @ q for part in averaged(d.time_s, d.width_s)]
        self._parts = [*parts, (q.T / d.count) @ q]
        self._fixed = (q.T * d.fixed) @ q
        self._values = d.values @ q

    def loss(self, variances: Floats) -> tuple[float, Floats]:
        """Minus the log likelihood, and its slope over the variances."""
        covariance = self._fixed + sum(v * c for v, c in zip(variances, self._parts, strict=True))
        factor = cho_factor(covariance, lower=True, check_finite=False)
        solved = cho_solve(factor, self._values.T, check_finite=False)
        inverse = cho_solve(factor, np.eye(covariance.shape[0]), check_finite=False)
        number = self._values.shape[0]
        value = 0.5 * float(np.sum(self._values.T * solved))
        value += number * float(np.sum(np.log(np.diag(factor[0]))))
        # d/dv of ½ (r'S⁻¹r + log|S|) is ½ (tr S⁻¹C - a'Ca), a being S⁻¹r.
        weight = number * inverse - solved @ solved.T
        return value, np.array([0.5 * float(np.sum(weight * part)) for part in self._parts])


def _line(differences: Sequence[Differences], spectrum: Spectrum) -> float | None:
    """Find the frequency of a periodic interference that stands out of the noise, Hz."""
    gain = np.zeros(_LINE_HZ.size)
    for d in differences:
        white = whitener(spectrum.covariance(d.time_s, d.width_s, d.count) + np.diag(d.fixed))
        basis = np.linalg.qr(white @ d.nuisances)[0]
        values = d.values @ white.T
        values = values - (values @ basis) @ basis.T
        for k, hz in enumerate(_LINE_HZ):
            wave = white @ _wave(hz, d)
            wave = np.linalg.qr(wave - basis @ (basis.T @ wave))[0]
            gain[k] += 0.5 * float(np.sum((values @ wave) ** 2))
    freedom = sum(d.values.shape[0] for d in differences)
    best = int(np.argmax(gain))
    stands_out = gain[best] - freedom > _LINE_NATS + np.log(gain.size)
    return float(_LINE_HZ[best]) if stands_out else None


def _wave(hz: float, d: Differences) -> Floats:
    phase = 2.0 * np.pi * hz * d.time_s
    return np.asarray(
        np.sinc(hz * d.width_s)[:, None] * np.column_stack([np.cos(phase), np.sin(phase)])
    )


def _without(d: Differences, hz: float) -> Differences:
    nuisances = np.hstack([d.nuisances, _wave(hz, d)])
    return replace(d, nuisances=nuisances)


def whitener(covariance: Floats) -> Floats:
    """Lower-triangular W with W R Wᵀ = 1, for a covariance R, (n, n)."""
    lower = np.linalg.cholesky(covariance)
    return np.asarray(solve_triangular(lower, np.eye(lower.shape[0]), lower=True))


@dataclass(frozen=True)
class Scatter:
    """What trials scatter by, 1 sigma: gain, rest angle (deg), time scale."""

    gain: float
    rest_deg: float
    time_scale: float

    def beside(self, other: Scatter) -> Scatter:
        """Add independent scatter."""
        return Scatter(
            float(np.hypot(self.gain, other.gain)),
            float(np.hypot(self.rest_deg, other.rest_deg)),
            float(np.hypot(self.time_scale, other.time_scale)),
        )


def scatter(
    differences: Sequence[Differences],
    spectrum: Spectrum,
    typical: Scatter,
    weight: float = 2.0,
    zeros_deg: Floats | None = None,
) -> Scatter:
    """Estimate what trials scatter by; `typical` counts as `weight` degrees of freedom.

    `zeros_deg`, (trials,), is what is known to move their zeros.
    """
    squares, freedom = np.zeros(3), weight
    start: Floats = weight * np.square([typical.rest_deg, typical.gain, typical.time_scale])
    for d in differences:
        fitted, variance = d.own(spectrum)
        if zeros_deg is not None and zeros_deg.size:
            fitted[:, 0] -= d.between @ zeros_deg
        which = [0, 1, 3]  # zero, gain, time scale
        number = d.values.shape[0]
        squares += np.sum(fitted[:, which] ** 2, axis=0) - number * variance[which]
        freedom += number
    rest, gain, scale = np.sqrt((start + np.maximum(squares, 0.0)) / freedom)
    return Scatter(float(gain), float(rest), float(scale))
