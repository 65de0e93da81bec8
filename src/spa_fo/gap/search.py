"""Search the parameters of an explanation: Gauss and Newton, damped after Marquardt.

The nuisances are integrated out at every point, their variances estimated there, so points are
compared by what the parameters alone are worth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.mixed import (
    Block,
    Normal,
    Prior,
    Solution,
    bordered,
    normal_equations,
    solve,
)

Floats = NDArray[np.float64]

_CONVERGED = 0.1  # nats
_STANDING = 1e-3  # a step of fewer prior spreads is none
_LONGEST = 2.0  # prior spreads: farther the linearisation is not trusted
_DAMPING, _FACTOR = 1e-4, 10.0
_POINT_ROUNDS, _FINAL_ROUNDS = 2, 3  # of the variances' estimate


class Problem(Protocol):
    """What is searched: parameters first among the columns, nuisances after them.

    Attributes
    ----------
    parameters, size : int
        Numbers of parameters and of all columns.
    spread : (parameters,) array
        Prior standard deviations.
    scales : (groups,) array
        Typical standard deviations of the nuisances' groups.
    """

    parameters: int
    size: int
    spread: Floats
    scales: Floats

    def blocks(self, z: Floats) -> tuple[list[Block], Floats]:
        """Give what is left at `z`, and the nuisances' columns; the prediction too."""

    def slopes(self, z: Floats) -> list[Floats]:
        """By block, the parameters' columns at `z`."""

    def prior(self, z: Floats) -> Prior:
        """Prior of all columns, the parameters' as steps from `z`."""

    def inside(self, z: Floats) -> Floats:
        """Move a point to within the bounds."""


@dataclass(frozen=True)
class Point:
    """One point of a search.

    Attributes
    ----------
    z : (parameters,) array
        Where it is.
    y : array
        The prediction there.
    blocks : list of Block
        What is left there, and the nuisances' columns; once it is `linearised` the parameters' too.
    normal : Normal
        Their normal equations, those of missing columns being zeros.
    variances : (groups,) array
        Of the nuisances.
    log_posterior : float
        Of the parameters.
    """

    z: Floats
    y: Floats
    blocks: list[Block]
    normal: Normal
    variances: Floats
    log_posterior: float


def climb(problem: Problem, start: Floats, most_steps: int) -> tuple[Point, Solution]:
    """Climb from `start` to the nearest top (Marquardt 1963, doi:10.1137/0111030).

    Returns
    -------
    point : Point
        The best point met.
    solution : Solution
        At this point: coefficients of the nuisances, those of the parameters' steps being 0; the
        factor of all of them; and Laplace's evidence.
    """
    best = linearised(problem, point_at(problem, problem.inside(start), problem.scales**2))
    damping = _DAMPING
    for _ in range(most_steps if problem.parameters else 0):
        new = problem.inside(best.z + _step(problem, best, damping))
        if np.max(np.abs(new - best.z) / problem.spread) < _STANDING:
            break
        tried = point_at(problem, new, best.variances)
        gained = tried.log_posterior - best.log_posterior
        if gained > 0.0:
            best, damping = linearised(problem, tried), damping / _FACTOR
        else:
            damping = _FACTOR * max(damping, _DAMPING)
        if 0.0 < gained < _CONVERGED:
            break
    return best, _laplace(problem, best)


def _laplace(problem: Problem, point: Point) -> Solution:
    """Take the linearisation for the curvature alone: its optimum may lie where nothing is so."""
    p = problem.parameters
    full = solve(point.normal, problem.prior(point.z), point.variances, rounds=_FINAL_ROUNDS)
    held = _held(problem, point.z, point.normal, full.variances, rounds=0)
    step = full.coefficients[:p]
    missed = 0.0
    if p:
        missed = 0.5 * float(step @ np.linalg.solve(full.covariance()[:p, :p], step))
    return replace(
        full,
        coefficients=np.concatenate([np.zeros(p), held.coefficients]),
        log_evidence=full.log_evidence - missed,
    )


def _held(problem: Problem, z: Floats, normal: Normal, variances: Floats, rounds: int) -> Solution:
    """Estimate the nuisances with the parameters held at `z`."""
    prior = problem.prior(z)
    rest = slice(problem.parameters, None)
    inner = replace(normal, matrix=normal.matrix[rest, rest], vector=normal.vector[rest])
    nuisances = Prior(prior.mean[rest], prior.variance[rest], prior.group[rest], prior.scale)
    return solve(inner, nuisances, variances, rounds)


def point_at(problem: Problem, z: Floats, variances: Floats) -> Point:
    """Integrate the nuisances out at `z`, their variances starting from these."""
    blocks, y = problem.blocks(z)
    normal = normal_equations(blocks, problem.size)
    held = _held(problem, z, normal, variances, rounds=_POINT_ROUNDS)
    away = problem.prior(z).mean[: problem.parameters] / problem.spread
    posterior = held.log_evidence - 0.5 * float(away @ away)
    return Point(z, y, blocks, normal, held.variances, posterior)


def linearised(problem: Problem, point: Point) -> Point:
    """Give a point the parameters' slopes: what most simulations go into, and few points need."""
    slopes = problem.slopes(point.z)
    first = np.arange(problem.parameters)
    normal = bordered(point.normal, point.blocks, slopes, [first] * len(slopes), problem.size)
    wider = [
        replace(
            block,
            columns=np.hstack([own, block.columns]),
            index=np.concatenate([first, block.index]),
        )
        for block, own in zip(point.blocks, slopes, strict=True)
    ]
    return replace(point, blocks=wider, normal=normal)


def _step(problem: Problem, point: Point, damping: float) -> Floats:
    """Step to the optimum of the linearisation."""
    p = np.arange(problem.parameters)
    matrix = point.normal.matrix.copy()
    matrix[p, p] *= 1.0 + damping
    damped: Normal = replace(point.normal, matrix=matrix)
    solution = solve(damped, problem.prior(point.z), point.variances, rounds=0)
    step = solution.coefficients[: problem.parameters]
    longest = float(np.max(np.abs(step) / problem.spread))
    return step * min(1.0, _LONGEST / longest) if longest > 0.0 else step
