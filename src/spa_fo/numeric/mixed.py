"""A linear mixed model: what is asked for, nuisances with unknown variances, and white noise.

    r = J δ + Z b + ε,   δ ~ N(δ0, Π),   b ~ N(0, diag γ),   ε ~ N(0, diag R)

The variances γ have a prior and maximise the marginal likelihood,
which integrates δ and b out; MacKay's fixed point (1992, doi:10.1162/neco.1992.4.3.415) reaches the
maximum that EM (Laird and Ware 1982, doi:10.2307/2529876) creeps towards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, lapack

from spa_fo.arrays import Floats, Integers

WEAK = 2.0
"""Degrees of freedom that a variance's prior is worth where nothing was measured of it."""


@dataclass(frozen=True)
class Normal:
    """The normal equations of all blocks, H = [J Z]."""

    matrix: Floats  # (q, q), HᵀR⁻¹H
    vector: Floats  # (q,), HᵀR⁻¹r
    square: float  # rᵀR⁻¹r
    log_noise: float  # log|R| + n log 2π
    rows: int  # n


@dataclass(frozen=True)
class Prior:
    """What is known beforehand of the columns."""

    mean: Floats  # (q,), of each column's coefficient
    variance: Floats  # (q,), which counts only where `group` is negative
    group: Integers  # (q,), which unknown variance the coefficient has, negative for none
    scale: Floats  # (g,), typical standard deviation of each group
    most: Floats | None = None  # (g,), the largest that is possible
    strength: Floats | float = WEAK  # (g,), degrees of freedom behind each scale

    def of(self, some: NDArray[np.bool_]) -> Prior:
        """Return that of some columns, (q,) bool."""
        own = self.mean[some], self.variance[some], self.group[some]
        return Prior(*own, self.scale, self.most, self.strength)

    def spread(self, variances: Floats) -> Floats:
        """Prior variance of each column for the groups' variances, (q,)."""
        grouped = self.group >= 0
        return np.where(grouped, variances[np.where(grouped, self.group, 0)], self.variance)


@dataclass(frozen=True)
class Solution:
    """Coefficients given the variances, the variances, and the evidence."""

    coefficients: Floats  # (q,), posterior means
    factor: Floats  # Cholesky factor, lower, of the posterior's precision of `seen` columns
    seen: NDArray[np.bool_]  # (q,), which rows say anything of; the others stay at their prior
    spread: Floats  # (q,), prior variances
    variances: Floats  # (g,), of the groups
    log_evidence: float  # logarithm of the marginal likelihood, the variances' prior included

    def covariance(self) -> Floats:
        """Posterior covariance, (q, q)."""
        covariance = np.diag(self.spread)
        inverse = cho_solve((self.factor, True), np.eye(self.factor.shape[0]))
        covariance[np.ix_(self.seen, self.seen)] = inverse
        return covariance


def _inverse_diagonal(factor: Floats) -> Floats:
    """Diagonal of the inverse of a matrix given by its Cholesky factor: half of the whole work."""
    inverse, status = lapack.dtrtri(factor, lower=1)
    if status != 0:
        raise np.linalg.LinAlgError("a precision matrix is singular")
    return np.asarray(np.einsum("ij,ij->j", inverse, inverse))


def solve(normal: Normal, prior: Prior, variances: Floats, rounds: int = 3) -> Solution:
    """Estimate coefficients and variances.

    Parameters
    ----------
    normal : Normal
        The equations.
    prior : Prior
        Of the coefficients.
    variances : (g,) array
        First guess of the groups' variances.
    rounds : int
        Steps of the fixed point; 0 keeps the variances.

    Returns
    -------
    Solution
        With the evidence at the last variances.
    """
    # Columns that no row has, such as those of a trial that takes no part, stay at their prior.
    seen = np.diag(normal.matrix) != 0.0  # what is no number is seen, and refused below
    matrix, vector = normal.matrix[np.ix_(seen, seen)], normal.vector[seen]
    own, scale, strength = prior.of(seen), prior.scale, prior.strength
    grouped = own.group >= 0

    def by_group(values: Floats) -> Floats:
        return np.asarray(np.bincount(own.group[grouped], values[grouped], scale.size), float)

    for step in range(rounds + 1):
        spread = own.spread(variances)
        factor = cholesky(matrix + np.diag(1.0 / spread), lower=True, check_finite=False)
        coefficients = cho_solve((factor, True), vector + own.mean / spread, check_finite=False)
        if step < rounds:
            known = np.maximum(by_group(1.0 - _inverse_diagonal(factor) / spread), 0.0)
            squares = by_group(coefficients**2) + strength * scale**2
            variances = squares / (known + strength + 2.0)
            if prior.most is not None:
                variances = np.minimum(variances, prior.most**2)
    away = coefficients - own.mean
    fit = normal.square - 2.0 * coefficients @ vector + coefficients @ matrix @ coefficients
    log_determinant = 2.0 * np.sum(np.log(np.diag(factor))) + np.sum(np.log(spread))
    against = variances / scale**2
    half = np.asarray(strength) / 2.0
    log_prior = -np.sum((half + 1.0) * np.log(against) + half * (1.0 / against - 1.0))
    evidence = log_prior - 0.5 * (fit + away @ (away / spread) + log_determinant + normal.log_noise)
    everywhere = prior.mean.copy()
    everywhere[seen] = coefficients
    return Solution(everywhere, factor, seen, prior.spread(variances), variances, float(evidence))
