"""The known angles of a calibration err: how smooth a curve their scatter speaks for.

A sensor differs smoothly over the angle, an angle set by hand does not. So the known angles a at
the counts c, and what the ways up and down differ by, are

    a_i = g(x_i) + e_i,   e_i ~ N(0, σ²/n_i + v_i),   g = quadratic + τ ∭ dW,

x being the counts from 0 to 1, n_i the dwells at an angle and v_i the noise of their readings: a
smoothing spline of fifth degree (Wahba 1978, doi:10.1111/j.2517-6161.1978.tb01050.x). σ, which both
share, and each τ are weighed by restricted likelihood and averaged over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.special import logsumexp

from spa_fo.arrays import Floats

_ERROR_DEG = 0.1  # prior median of σ and its spread as a factor: assumed, wide
_ERROR_FACTOR = 5.0
_BEND_DEG = 10.0  # the same of τ: 2° of the reading are then no quadratic
_BEND_FACTOR = 10.0
_WITHIN = 2.5  # spreads of either that are looked at
_QUADRATIC = 3  # coefficients
_ERRORS, _BENDS = 19, 15  # values of either


@dataclass(frozen=True)
class Series:
    """Values over the counts, from 0 to 1; of one fixture, in degrees."""

    at: Floats  # (k,), rising
    values: Floats  # (k,)
    noise: Floats  # (k,), known variance
    share: Floats  # (k,), variance of each in units of a dwell's


def smoother(angles: Series, differences: Series | None = None) -> Floats:
    """Say how the knots of a smooth curve are made of known angles.

    Parameters
    ----------
    angles : Series
        The known angles.
    differences : Series, optional
        What the ways up and down differ by at more than three angles that both hold.

    Returns
    -------
    (k, k) array
        Times the known angles it gives the knots. Where three or fewer are known it is the
        identity; it comes near that where they do not scatter.
    """
    k = angles.at.size
    if k <= _QUADRATIC:
        return np.eye(k)
    errors, log_errors = _grid(_ERROR_DEG, _ERROR_FACTOR, _ERRORS)
    bends, log_bends = _grid(_BEND_DEG, _BEND_FACTOR, _BENDS)
    known = _contrasts(angles)
    logs = np.array([[known.log(error, bend) for bend in bends] for error in errors])
    logs += log_errors[:, None] + log_bends
    if differences is not None:
        beside = _contrasts(differences)
        said = [[beside.log(error, bend) for bend in bends] for error in errors]
        logs += logsumexp(np.array(said) + log_bends, axis=1)[:, None]
    weights = np.exp(logs - logsumexp(logs))
    found = np.zeros((k, k))
    for (i, j), weight in np.ndenumerate(weights):
        found += weight * known.smoother(float(errors[i]), float(bends[j]))
    return found


def _grid(median: float, factor: float, count: int) -> tuple[Floats, Floats]:
    """Values of a positive number, evenly over its logarithm, and their log prior."""
    deviations = np.linspace(-_WITHIN, _WITHIN, count)
    return median * factor**deviations, -0.5 * deviations**2


@dataclass(frozen=True)
class _Contrasts:
    """Values with what a quadratic may be of them taken out."""

    series: Series
    free: Floats  # (k, k - 3), orthonormal
    bent: Floats  # (k - 3, k - 3), covariance of the contrasts for a τ of 1

    def own(self, error: float) -> Floats:
        """Variance of each value's error, (k,)."""
        return np.asarray(error**2 * self.series.share + self.series.noise)

    def covariance(self, error: float, bend: float) -> Floats:
        """Covariance of the contrasts, (k - 3, k - 3)."""
        return bend**2 * self.bent + (self.free.T * self.own(error)) @ self.free

    def log(self, error: float, bend: float) -> float:
        """Restricted log likelihood."""
        root = np.linalg.cholesky(self.covariance(error, bend))
        left = np.linalg.solve(root, self.free.T @ self.series.values)
        return -0.5 * float(left @ left) - float(np.sum(np.log(np.diag(root))))

    def smoother(self, error: float, bend: float) -> Floats:
        """Give what makes the posterior mean of the curve of the values, (k, k)."""
        solved = np.linalg.solve(self.covariance(error, bend), self.free.T)
        return np.asarray(np.eye(solved.shape[1]) - self.own(error)[:, None] * (self.free @ solved))


def _contrasts(series: Series) -> _Contrasts:
    x = series.at
    low, apart = np.minimum(x[:, None], x), np.abs(x[:, None] - x)
    kernel = low**5 / 20.0 + apart * low**4 / 8.0 + apart**2 * low**3 / 12.0
    free = null_space(np.vander(x, _QUADRATIC).T)
    return _Contrasts(series, free, free.T @ kernel @ free)
