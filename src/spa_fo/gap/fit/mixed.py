"""A linear mixed model: what is asked for, nuisances with unknown variances, and white noise.

    r = J δ + Z b + ε,   δ ~ N(δ0, Π),   b ~ N(0, diag γ),   ε ~ N(0, diag R)

The variances γ have a weak prior and maximise the marginal likelihood,
which integrates δ and b out; MacKay's fixed point (1992, doi:10.1162/neco.1992.4.3.415) reaches the
maximum that EM (Laird and Ware 1982, doi:10.2307/2529876) creeps towards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, lapack

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_PRIOR_STRENGTH = 2.0  # degrees of freedom that a variance's prior is worth


@dataclass(frozen=True)
class Normal:
    """The normal equations of all blocks.

    Attributes
    ----------
    matrix : (q, q) array
        HᵀR⁻¹H.
    vector : (q,) array
        HᵀR⁻¹r.
    square : float
        rᵀR⁻¹r.
    log_noise : float
        log|R| + n log 2π.
    rows : int
        n.
    """

    matrix: Floats
    vector: Floats
    square: float
    log_noise: float
    rows: int


@dataclass(frozen=True)
class Prior:
    """What is known beforehand of the columns.

    Attributes
    ----------
    mean, variance : (q,) arrays
        Of each column's coefficient; the variance counts only where `group` is negative.
    group : (q,) array
        Which unknown variance the coefficient has, negative for none.
    scale : (g,) array
        Typical standard deviation of each group.
    most : (g,) array, optional
        The largest that is possible.
    """

    mean: Floats
    variance: Floats
    group: Integers
    scale: Floats
    most: Floats | None = None


@dataclass(frozen=True)
class Solution:
    """Coefficients given the variances, the variances, and the evidence.

    Attributes
    ----------
    coefficients : (q,) array
        Posterior means.
    factor : (k, k) array
        Cholesky factor, lower, of the posterior's precision of the columns that are seen.
    seen : (q,) bool array
        Which rows say anything of; of the others is known what was known beforehand.
    spread : (q,) array
        Prior variances.
    variances : (g,) array
        Of the groups.
    log_evidence : float
        Logarithm of the marginal likelihood, the variances' prior included.
    """

    coefficients: Floats
    factor: Floats
    seen: NDArray[np.bool_]
    spread: Floats
    variances: Floats
    log_evidence: float

    def covariance(self) -> Floats:
        """Posterior covariance, (q, q)."""
        inverse = np.tril(_inverse(self.factor))
        covariance = np.diag(self.spread)
        covariance[np.ix_(self.seen, self.seen)] = inverse + np.tril(inverse, -1).T
        return covariance


def _inverse(factor: Floats) -> Floats:
    """Lower triangle of the inverse of a matrix given by its Cholesky factor."""
    inverse, status = lapack.dpotri(factor, lower=1)
    if status != 0:
        raise np.linalg.LinAlgError("a precision matrix is singular")
    return np.asarray(inverse)


def _inverse_diagonal(factor: Floats) -> Floats:
    """Diagonal of that inverse: half the work of the whole."""
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
    variances = variances.copy()
    # Columns that no row has, such as those of a trial that takes no part, stay at their prior.
    seen = np.diag(normal.matrix) != 0.0  # what is no number is seen, and refused below
    matrix, vector = normal.matrix[np.ix_(seen, seen)], normal.vector[seen]
    mean, group, known_spread = prior.mean[seen], prior.group[seen], prior.variance[seen]
    diagonal = np.arange(vector.size)
    grouped = group >= 0
    groups = prior.scale.size
    sizes = np.bincount(group[grouped], minlength=groups)
    for step in range(rounds + 1):
        spread = known_spread.copy()
        spread[grouped] = variances[group[grouped]]
        a = matrix.copy()
        a[diagonal, diagonal] += 1.0 / spread
        factor = cholesky(a, lower=True, overwrite_a=True, check_finite=False)
        right = vector + mean / spread
        coefficients = cho_solve((factor, True), right, check_finite=False)
        if step == rounds:
            break
        squares = np.bincount(group[grouped], coefficients[grouped] ** 2, minlength=groups)
        undecided = np.bincount(
            group[grouped], (_inverse_diagonal(factor) / spread)[grouped], minlength=groups
        )
        known = np.maximum(sizes - undecided, 0.0)
        variances = (squares + _PRIOR_STRENGTH * prior.scale**2) / (known + _PRIOR_STRENGTH + 2.0)
        if prior.most is not None:
            variances = np.minimum(variances, prior.most**2)
    deviation = coefficients - mean
    fit = normal.square - 2.0 * coefficients @ vector + coefficients @ matrix @ coefficients
    log_determinant = 2.0 * float(np.sum(np.log(np.diag(factor)))) + float(np.sum(np.log(spread)))
    half = _PRIOR_STRENGTH / 2.0
    log_prior = np.sum(
        -(half + 1.0) * np.log(variances / prior.scale**2)
        - half * (prior.scale**2 / variances - 1.0)
    )
    evidence = -0.5 * (
        fit + deviation @ (deviation / spread) + log_determinant + normal.log_noise
    ) + float(log_prior)
    everywhere = prior.variance.copy()
    everywhere[prior.group >= 0] = variances[prior.group[prior.group >= 0]]
    all_coefficients = prior.mean.copy()
    all_coefficients[seen] = coefficients
    return Solution(all_coefficients, factor, seen, everywhere, variances, float(evidence))
