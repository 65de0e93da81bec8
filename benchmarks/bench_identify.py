"""Speed and quality of the identification beside pyswarms and SciPy, in one run.

All optimisers minimise the same objective through the same compiled response, on the paper's
amount of data: 4 datasets of 50 points with 0.5 degrees of noise. A time is the least of the
repeats on this machine, now, except where it says median. A seed "finds the optimum" when its RMSE
is within 1 % of the least that any optimiser found on that problem, and the "sharp" column asks for
the sum of squares within 1e-6.
"""

from __future__ import annotations

import argparse
import logging
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
import pyswarms
from scipy.optimize import differential_evolution
from tabulate import tabulate

from spa_fo.atomic import write_text
from spa_fo.fractional import ResponseMap, step_map
from spa_fo.identify import (
    Bounds,
    Draws,
    StepData,
    fit_many,
    free_bounds,
    printed_bounds,
    swarm_on_map,
    widened_bounds,
)
from spa_fo.identify.fitness import Target, swarm_rmse, target_of
from spa_fo.plant import TABLE_I
from spa_fo.plant.paper import SWARM_ATTRACTION, SWARM_INERTIA

NOISE_DEG = 0.5
NEAR = 1.01
SHARP = 1e-6


@dataclass(frozen=True)
class Problem:
    data: StepData
    bounds: Bounds
    response: ResponseMap
    target: Target


@dataclass(frozen=True)
class Entry:
    name: str
    run: Callable[[Problem, int], float]  # (problem, seed) to the RMSE in rad


def problem(bounds: Bounds) -> Problem:
    t = np.arange(1, 51) / 5.0
    u = np.array([1.0, 1.0, 2.0, 2.0])
    response = step_map(t)
    clean = np.outer(u, response.response(TABLE_I["design_1"].as_array()))
    noise = np.radians(NOISE_DEG) * np.random.default_rng(0).standard_normal(clean.shape)
    data = StepData(
        experiments=("low", "low", "high", "high"),
        trials=(1, 2, 1, 2),
        orders=np.arange(4),
        setpoint_deg=np.array([30.0, 30.0, 60.0, 60.0]),
        u=u,
        t=t,
        angle_rad=clean + noise,
    )
    return Problem(data, bounds, response, target_of(data))


def fitness(p: Problem, positions: np.ndarray) -> np.ndarray:
    out = np.empty(len(positions))
    swarm_rmse(
        np.ascontiguousarray(positions),
        p.bounds.lower,
        p.bounds.upper,
        p.target,
        p.response.arrays,
        out,
    )
    return np.where(np.isfinite(out), out, 1e3)


def polish(p: Problem, seed: int) -> float:
    found = fit_many(p.response, p.data, p.bounds, Draws.from_seed(seed))
    return float(np.sqrt(found.sum_squares[0] / p.data.angle_rad.size))


def swarm(iterations: int) -> Callable[[Problem, int], float]:
    return lambda p, seed: swarm_on_map(p.response, p.target, p.bounds, seed, 200, iterations).rmse


def pyswarms_swarm(iterations: int) -> Callable[[Problem, int], float]:
    options = {"c1": SWARM_ATTRACTION, "c2": SWARM_ATTRACTION, "w": SWARM_INERTIA}

    def run(p: Problem, seed: int) -> float:
        np.random.seed(seed)  # noqa: NPY002 - pyswarms knows no other
        optimiser = pyswarms.single.GlobalBestPSO(
            200, 5, options, bounds=(p.bounds.lower, p.bounds.upper)
        )
        cost, _ = optimiser.optimize(lambda x: fitness(p, x), iterations, verbose=False)
        return float(cost)

    return run


def evolution(p: Problem, seed: int) -> float:
    found = differential_evolution(
        lambda x: float(fitness(p, x[np.newaxis])[0]),
        list(zip(p.bounds.lower, p.bounds.upper, strict=True)),
        rng=seed,
    )
    return float(found.fun)


OPTIMUM = "spa-fo: swarm 40×10 and Levenberg-Marquardt"
PAPER_SWARM = "spa-fo: swarm 200×10, as in the paper"
ENTRIES = (
    Entry(OPTIMUM, polish),
    Entry(PAPER_SWARM, swarm(10)),
    Entry("pyswarms: 200×10", pyswarms_swarm(10)),
    Entry("spa-fo: swarm 200×100", swarm(100)),
    Entry("pyswarms: 200×100", pyswarms_swarm(100)),
    Entry("SciPy: differential_evolution", evolution),
)


def compare(p: Problem, seeds: int, slow_seeds: int) -> str:
    results = {}
    for entry in ENTRIES:
        entry.run(p, 0)  # compiles
        times, rmse = [], []
        for seed in range(slow_seeds if entry.run is evolution else seeds):
            start = time.perf_counter()
            rmse.append(entry.run(p, seed))
            times.append(time.perf_counter() - start)
        results[entry.name] = np.array(times), np.array(rmse)
    best = min(float(rmse.min()) for _, rmse in results.values())
    base = float(results[OPTIMUM][0].min())
    rows = [
        [
            name,
            1e3 * times.min(),
            1e3 * np.median(times),
            times.min() / base,
            f"{np.count_nonzero(rmse < NEAR * best)}/{rmse.size}",
            f"{np.count_nonzero(rmse**2 < (1 + SHARP) * best**2)}/{rmse.size}",
            100 * (np.median(rmse) / best - 1),
        ]
        for name, (times, rmse) in results.items()
    ]
    heads = [
        "optimiser",
        "ms",
        "median ms",
        "ratio",
        "finds the optimum",
        "sharp",
        "median excess %",
    ]
    table = tabulate(rows, heads, "pipe", floatfmt=(".0f", ".2f", ".2f", ".1f", "", "", ".2g"))
    return f"### {p.bounds.name} bounds\n\n{table}\n"


def many_fits(p: Problem, fits: int) -> str:
    """Throughput of the ablation and the bootstrap: many fits in one kernel."""
    counts = np.random.default_rng(1).multinomial(4, [0.25] * 4, size=fits).astype(float)
    draws = Draws.from_seed(1)
    rows = []
    before = numba.get_num_threads()
    for threads in range(1, min(2, numba.config.NUMBA_NUM_THREADS) + 1):
        numba.set_num_threads(threads)
        times = []
        for _ in range(4):
            start = time.perf_counter()
            fit_many(p.response, p.data, p.bounds, draws, counts=counts)
            times.append(time.perf_counter() - start)
        rows.append([threads, fits / min(times)])
    numba.set_num_threads(before)
    table = tabulate(rows, ["threads", "fits a second"], "pipe", floatfmt=".0f")
    return f"### Many fits at once ({fits} resamples, {p.bounds.name} bounds)\n\n{table}\n"


def report(quick: bool) -> str:
    logging.disable(logging.INFO)  # pyswarms logs every run
    seeds, slow_seeds = (5, 1) if quick else (30, 5)
    parts = [
        "# Identification: speed and quality\n",
        f"{platform.processor() or platform.machine()}, {numba.get_num_threads()} threads, "
        f"Python {platform.python_version()}, {seeds} seeds\n",
    ]
    parts += [
        compare(problem(bounds), seeds, slow_seeds)
        for bounds in (printed_bounds(), widened_bounds(), free_bounds())
    ]
    parts.append(many_fits(problem(widened_bounds()), 200 if quick else 2000))
    return "\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example:\n  python benchmarks/bench_identify.py --quick --out bench_identify.md",
    )
    parser.add_argument("--quick", action="store_true", help="few seeds: half a minute")
    parser.add_argument("--out", metavar="FILE.md", type=Path, help="write the tables there too")
    options = parser.parse_args()
    text = report(options.quick)
    print(text)
    if options.out:
        write_text(options.out, text)


if __name__ == "__main__":
    main()
