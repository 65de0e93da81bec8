"""Plain slow twins of the gap room's linear algebra."""

from __future__ import annotations

import numpy as np


def log_evidence(residual, noise, columns, mean, variance):
    """Log density of r = H c + e, with c and e normal, by the full covariance matrix."""
    covariance = np.diag(noise) + columns @ np.diag(variance) @ columns.T
    off = residual - columns @ mean
    sign, logdet = np.linalg.slogdet(2.0 * np.pi * covariance)
    assert sign > 0
    return -0.5 * (off @ np.linalg.solve(covariance, off) + logdet)


def posterior(residual, noise, columns, mean, variance):
    """Posterior mean and covariance of c, by conditioning the joint normal distribution."""
    prior = np.diag(variance)
    covariance = np.diag(noise) + columns @ prior @ columns.T
    gain = prior @ columns.T @ np.linalg.inv(covariance)
    return mean + gain @ (residual - columns @ mean), prior - gain @ columns @ prior


def em(normal, prior, variances, rounds):
    """Variances of the groups by EM with their prior (Laird and Ware 1982), slowly."""
    strength = np.broadcast_to(prior.strength, prior.scale.shape)
    for _ in range(rounds):
        spread = np.where(prior.group < 0, prior.variance, variances[prior.group])
        covariance = np.linalg.inv(normal.matrix + np.diag(1.0 / spread))
        b = covariance @ (normal.vector + prior.mean / spread)
        second = b**2 + np.diag(covariance)
        variances = np.array(
            [
                (second[prior.group == g].sum() + strength[g] * prior.scale[g] ** 2)
                / (np.count_nonzero(prior.group == g) + strength[g] + 2.0)
                for g in range(prior.scale.size)
            ]
        )
    return variances
