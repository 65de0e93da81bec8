"""Particle swarm optimisation as in the paper, Eq. 17-19 of arXiv:2512.18213.

What the paper leaves open is taken from its reference, Bratton and Kennedy 2007
(doi:10.1109/SIS.2007.368035), or from common practice:

- inertia 0.72984 and attraction 1.49618, their constriction in inertia form;
- particles may fly out of the bounds and are not evaluated there ("let them fly"), nor where
  alpha1 >= alpha2: no best position ever lies outside;
- positions start uniformly within the bounds, with alpha1 < alpha2; velocities start at zero
  (Engelbrecht 2012, doi:10.1109/CEC.2012.6256112).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.fractional import ResponseMap, step_map
from spa_fo.identify.bounds import Bounds
from spa_fo.identify.fitness import Target, swarm_rmse, target_of
from spa_fo.identify.protocol import StepData
from spa_fo.plant.paper import (
    SWARM_ATTRACTION,
    SWARM_INERTIA,
    SWARM_ITERATIONS,
    SWARM_PARTICLES,
)


@dataclass(frozen=True)
class SwarmResult:
    """Best position found.

    Attributes
    ----------
    x : (5,) array
        In the order of `PARAMETERS`.
    rmse : float
        Over all samples, rad.
    evaluations : int
        Particles moved, times iterations, the start among them.
    history : (iterations + 1,) array
        Best RMSE after the start and after each iteration, rad.
    """

    x: Floats
    rmse: float
    evaluations: int
    history: Floats


def paper_swarm(
    data: StepData,
    bounds: Bounds,
    seed: int,
    particles: int = SWARM_PARTICLES,
    iterations: int = SWARM_ITERATIONS,
) -> SwarmResult:
    """Identify with the paper's swarm.

    Parameters
    ----------
    data : StepData
        Step responses.
    bounds : Bounds
        Of the search.
    seed : int
        The same seed gives the same bits, for any number of threads.
    particles, iterations : int
        The paper's 200 and 10.
    """
    return swarm_on_map(step_map(data.t), target_of(data), bounds, seed, particles, iterations)


def swarm_on_map(
    response: ResponseMap,
    target: Target,
    bounds: Bounds,
    seed: int,
    particles: int = SWARM_PARTICLES,
    iterations: int = SWARM_ITERATIONS,
) -> SwarmResult:
    """Run the swarm on a target whose map is at hand; see `paper_swarm`."""
    generator = np.random.default_rng(seed)
    position = start_positions(generator, bounds, particles)
    velocity = np.zeros_like(position)
    draws = generator.random((iterations, 2, particles, 5))
    draws *= SWARM_ATTRACTION
    fitness = np.empty(particles)
    swarm_rmse(position, bounds.lower, bounds.upper, target, response.arrays, fitness)
    best, best_fitness = position.copy(), fitness.copy()
    leader = int(np.argmin(best_fitness))
    history = np.empty(iterations + 1)
    history[0] = best_fitness[leader]
    for k in range(iterations):
        velocity *= SWARM_INERTIA
        velocity += draws[k, 0] * (best - position)
        velocity += draws[k, 1] * (best[leader] - position)
        position += velocity
        swarm_rmse(position, bounds.lower, bounds.upper, target, response.arrays, fitness)
        better = fitness < best_fitness
        best[better], best_fitness[better] = position[better], fitness[better]
        leader = int(np.argmin(best_fitness))
        history[k + 1] = best_fitness[leader]
    return SwarmResult(
        best[leader].copy(), float(history[-1]), particles * (iterations + 1), history
    )


def start_positions(generator: np.random.Generator, bounds: Bounds, particles: int) -> Floats:
    """Draw positions (particles, 5) uniformly within the bounds, with alpha1 < alpha2."""
    unit = generator.random((particles, 5))
    position = bounds.lower + unit * (bounds.upper - bounds.lower)
    for _ in range(100):
        wrong = np.flatnonzero(position[:, 1] >= position[:, 0])
        if wrong.size == 0:
            break
        again = generator.random((wrong.size, 2))
        span = bounds.upper[:2] - bounds.lower[:2]
        position[wrong, :2] = bounds.lower[:2] + again * span
    return position
