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
