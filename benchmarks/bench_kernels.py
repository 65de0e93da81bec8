"""Speed and accuracy of the fractional-calculus kernels beside other codes, in one run.

Every time is the least of several repeats on this machine, now; every error is measured against
mpmath in the same run. Errors of responses are relative to the static gain b0/a0.
"""

from __future__ import annotations

import argparse
import math
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mpmath as mp
import numba
import numfracpy
import numpy as np
import pymittagleffler
from numba import get_thread_id, prange
from tabulate import tabulate

from spa_fo.fractional import (
    grunwald_letnikov_simulate,
    grunwald_letnikov_step,
    input_map,
    jacobian_on_map,
    mittag_leffler,
    response_on_map,
    simulate,
    step_map,
    step_response,
    step_response_jacobian,
)

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from naive_fractional import invert, naive_mittag_leffler, naive_step_response

X = (1.406, 1.196, 0.794, 1.638, 0.934)  # Dragon Skin 20, Table I of arXiv:2512.18213
GAIN = X[4] / X[3]
GRID = np.arange(1, 51) * 0.2


@dataclass(frozen=True)
class Row:
    """One code in a comparison: seconds for the whole task and its error."""

    code: str
    seconds: float
    error: float
    remark: str = ""


@numba.njit(nogil=True)
def evaluate_serially(count, x, arrays, work, out):
    for _ in range(count):
        response_on_map(x, arrays, work, out)


@numba.njit(nogil=True)
def differentiate_serially(count, x, arrays, work, out):
    for _ in range(count):
        jacobian_on_map(x, arrays, work, out)


@numba.njit(parallel=True)
def evaluate_in_parallel(xs, arrays, work, scratch, data, sums):
    for i in prange(xs.shape[0]):
        y = scratch[get_thread_id()]
        response_on_map(xs[i], arrays, work[get_thread_id()], y)
        total = 0.0
        for j in range(y.size):
            total += (y[j] - data[j]) ** 2
        sums[i] = total


def least_time(task: Callable[[], object], budget: float) -> float:
    """Shortest time of one call within a budget of seconds, at least two calls."""
    task()
    best = math.inf
    end = time.perf_counter() + budget
    calls = 0
    while calls < 2 or time.perf_counter() < end:
        start = time.perf_counter()
        task()
        best = min(best, time.perf_counter() - start)
        calls += 1
    return best


def series_in_doubles(t: np.ndarray, terms: int = 40) -> np.ndarray:
    """The corrected series of Prabhakar functions as one would write it down, in doubles."""
    alpha2, alpha1, a1, a0, b0 = X
    y = np.zeros(t.size)
    for j, time_ in enumerate(t):
        z = -a0 * time_**alpha2
        for k in range(terms):
            exponent = (alpha2 - alpha1) * k + alpha2
            inner, factor = 0.0, 1.0
            for n in range(terms):
                inner += factor / math.gamma(alpha2 * n + exponent + 1.0)
                factor *= (k + 1 + n) / (n + 1) * z
            y[j] += b0 * (-a1) ** k * time_**exponent * inner
    return y


def series_of_numfracpy(t: np.ndarray, terms: int = 40) -> np.ndarray:
    """The same series with numfracpy's three-parameter function."""
    alpha2, alpha1, a1, a0, b0 = X
    y = np.zeros(t.size)
    for j, time_ in enumerate(t):
        for k in range(terms):
            exponent = (alpha2 - alpha1) * k + alpha2
            e = numfracpy.Mittag_Leffler_three(-a0 * time_**alpha2, alpha2, exponent + 1.0, k + 1)
            y[j] += b0 * (-a1) ** k * time_**exponent * np.real(e)
    return y


def numfracpy_values(z: np.ndarray, alpha: float, beta: float, gamma: float) -> np.ndarray:
    """Its three-parameter function at every argument; NaN where it raises."""
    values = np.full(z.size, np.nan)
    for j, argument in enumerate(z):
        try:
            values[j] = np.real(numfracpy.Mittag_Leffler_three(argument, alpha, beta, gamma))
        except (ArithmeticError, ValueError, IndexError, TypeError):
            continue
    return values


def worst(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest absolute difference, infinite if a value is missing."""
    difference = np.abs(np.asarray(found) - expected)
    return float(np.max(difference)) if np.all(np.isfinite(difference)) else math.inf


def compare_mittag_leffler(budget: float, count: int) -> list[tuple[str, list[Row]]]:
    """Arguments z = -x on a logarithmic grid; one table for each set of parameters.

    On one thread, as the other codes.
    """
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    z = -np.geomspace(0.01, 40.0, count)
    tables = []
    for alpha, beta, gamma in [(0.7, 1.0, 1.0), (1.406, 2.406, 1.0), (1.9, 1.0, 1.0),
                               (0.7, 1.3, 2.0), (1.406, 2.616, 2.0)]:  # fmt: skip
        inside = z[np.abs(z) ** (1.0 / alpha) < 120.0]
        expected = np.array([float(naive_mittag_leffler(v, alpha, beta, gamma)) for v in inside])
        codes: list[tuple[str, Callable[[], np.ndarray]]] = [
            (
                "spa-fo mittag_leffler",
                lambda z=inside, a=alpha, b=beta, g=gamma: mittag_leffler(z, a, b, g),
            )
        ]
        if gamma == 1.0:
            complex_z = inside.astype(complex)
            codes.append(
                (
                    "pymittagleffler",
                    lambda z=complex_z, a=alpha, b=beta: pymittagleffler.mittag_leffler(z, a, b),
                )
            )
        codes.append(
            (
                "numfracpy",
                lambda z=inside, a=alpha, b=beta, g=gamma: numfracpy_values(z, a, b, g),
            )
        )
        rows = [
            Row(name, least_time(task, budget) / inside.size, worst(np.real(task()), expected))
            for name, task in codes
        ]
        title = f"E^γ_{{α,β}}(−x), α = {alpha}, β = {beta}, γ = {gamma:g}: time per value"
        tables.append((title, rows))
    numba.set_num_threads(threads)
    return tables


def compare_step(budget: float, points: int) -> list[Row]:
    """Step response at 50 points up to 10 s; errors at `points` of them."""
    expected = np.array([float(naive_step_response(t, X)) for t in GRID])
    x = np.array(X)
    response_map = step_map(GRID)
    arrays, work, out = response_map.arrays, response_map.work(), np.empty(50)
    slopes = np.empty((5, 50))
    loops = 1000
    fixed = least_time(lambda: evaluate_serially(loops, x, arrays, work, out), budget) / loops
    slope = least_time(lambda: differentiate_serially(loops, x, arrays, work, slopes), budget)
    per_point = step_response_jacobian(GRID, *X)
    rows = [
        Row("spa-fo fixed grid (inside the fit)", fixed, worst(out, expected) / GAIN),
        Row(
            "spa-fo fixed grid, Jacobian in 5 parameters",
            slope / loops,
            worst(slopes.T, per_point) / GAIN,
            "error against the Jacobian per point",
        ),
        Row(
            "spa-fo step_response (per point)",
            least_time(lambda: step_response(GRID, *X), budget),
            worst(step_response(GRID, *X), expected) / GAIN,
        ),
        Row(
            "Grünwald-Letnikov, 500 steps",
            least_time(lambda: grunwald_letnikov_step(GRID, *X, steps=500), budget),
            worst(grunwald_letnikov_step(GRID, *X, steps=500), expected) / GAIN,
        ),
        Row(
            "Prabhakar series in doubles, 40 x 40 terms",
            least_time(lambda: series_in_doubles(GRID), budget),
            worst(series_in_doubles(GRID), expected) / GAIN,
        ),
    ]
    few = np.arange(2, 50, max(1, 48 // points))
    some = GRID[few]
    rows.append(
        Row(
            "Prabhakar series with numfracpy, 40 terms",
            least_time(lambda: series_of_numfracpy(some), 0.0) * 50 / some.size,
            worst(series_of_numfracpy(some), expected[few]) / GAIN,
            f"{some.size} points, time scaled to 50",
        )
    )
    return rows


def trapezoid_reference(times: np.ndarray) -> np.ndarray:
    """Response to u rising over 1..3 s and falling over 20..21 s, by four ramps in mpmath."""
    alpha2, alpha1, a1, a0, b0 = (mp.mpf(value) for value in X)
    values = []
    for t in times:
        total = mp.mpf(0)
        for start, slope in ((1.0, 0.5), (3.0, -0.5), (20.0, -1.0), (21.0, 1.0)):
            if t > start:
                total += invert(
                    lambda s, slope=slope: b0 * slope / (s**2 * (s**alpha2 + a1 * s**alpha1 + a0)),
                    mp.mpf(float(t)) - start,
                )
        values.append(float(total))
    return np.array(values)


def compare_sampled_input(budget: float) -> list[Row]:
    """5000 samples over 100 s, uniform and jittered."""
    rng = np.random.default_rng(1)
    corners = [1.0, 3.0, 20.0, 21.0]
    t = np.arange(5000) * 0.02
    jittered = t + rng.uniform(0.0, 0.01, t.size)
    for corner in corners:
        jittered[round(corner / 0.02)] = corner

    def shape(times):
        return np.interp(times, corners, [0.0, 1.0, 1.0, 0.0])

    t[[round(corner / 0.02) for corner in corners]] = corners
    u, v = shape(t), shape(jittered)
    some = np.array([60, 149, 151, 400, 1020, 1100, 3000, 4999])
    expected, expected_jittered = trapezoid_reference(t[some]), trapezoid_reference(jittered[some])
    folded = input_map(t, u)
    scheme = grunwald_letnikov_simulate(t, u, *X)
    return [
        Row(
            "spa-fo simulate",
            least_time(lambda: simulate(t, u, *X), budget),
            worst(simulate(t, u, *X)[some], expected) / GAIN,
        ),
        Row(
            "spa-fo simulate, jittered times",
            least_time(lambda: simulate(jittered, v, *X), budget),
            worst(simulate(jittered, v, *X)[some], expected_jittered) / GAIN,
        ),
        Row(
            "spa-fo input_map, new parameters",
            least_time(lambda: folded.response(X), budget),
            worst(folded.response(X)[some], expected) / GAIN,
            f"after {least_time(lambda: input_map(t, u), 0.0) * 1e3:.0f} ms once for the input",
        ),
        Row(
            "spa-fo input_map, Jacobian in 5 parameters",
            least_time(lambda: folded.jacobian(X), budget),
            math.nan,
        ),
        Row(
            "Grünwald-Letnikov",
            least_time(lambda: grunwald_letnikov_simulate(t, u, *X), 0.0),
            worst(scheme[some], expected) / GAIN,
        ),
    ]


def evaluations_per_second(budget: float) -> list[tuple[int, int, float, float, bool]]:
    """Sums of squares of 50 residuals: (batch, threads, seconds, rate, same bits as 1 thread)."""
    rng = np.random.default_rng(2)
    response_map = step_map(GRID)
    data = response_map.response(X)
    rows = []
    for batch in (200, 20000):
        xs = np.array(X) * rng.uniform(0.9, 1.1, (batch, 5))
        xs[:, 1] = np.minimum(xs[:, 1], xs[:, 0] - 0.01)
        reference = None
        for threads in sorted({1, min(2, numba.config.NUMBA_NUM_THREADS)}):
            numba.set_num_threads(threads)
            work = np.stack([response_map.work() for _ in range(threads)])
            scratch, sums = np.empty((threads, GRID.size)), np.empty(batch)
            arguments = (xs, response_map.arrays, work, scratch, data, sums)
            seconds = least_time(lambda a=arguments: evaluate_in_parallel(*a), budget)
            reference = sums.copy() if reference is None else reference
            same = bool(np.array_equal(sums, reference))
            rows.append((batch, threads, seconds, batch / seconds, same))
    return rows


def as_table(rows: list[Row]) -> str:
    """Markdown with ratios to the first row."""
    first = rows[0].seconds
    return tabulate(
        [
            (
                row.code,
                f"{row.seconds * 1e6:.3g}",
                f"{row.seconds / first:.3g}",
                "" if math.isnan(row.error) else f"{row.error:.1e}",
                row.remark,
            )
            for row in rows
        ],
        headers=["code", "µs", "time ratio", "largest error", "remark"],
        tablefmt="github",
        disable_numparse=True,
    )


def report(quick: bool) -> str:
    """Run everything and return the Markdown."""
    budget = 0.05 if quick else 0.5
    parts = [
        "# Kernels side by side",
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
        f"numba {numba.__version__}; parameters of Dragon Skin 20.",
    ]
    parts += ["## Step response, 50 points up to 10 s", as_table(compare_step(budget, 6))]
    parts += ["## Sampled input, 5000 samples", as_table(compare_sampled_input(budget))]
    parts.append("## Mittag-Leffler function")
    for title, rows in compare_mittag_leffler(budget, 12 if quick else 30):
        parts += [f"{title}", as_table(rows)]
    rates = [
        (batch, threads, f"{seconds * 1e6:.0f}", f"{rate / 1e6:.2f}", "yes" if same else "NO")
        for batch, threads, seconds, rate, same in evaluations_per_second(budget)
    ]
    parts += [
        f"## Evaluations on a fixed grid in a parallel loop ({numba.threading_layer()})",
        tabulate(
            rates,
            headers=["batch", "threads", "µs", "million evaluations/s", "same bits"],
            tablefmt="github",
        ),
    ]
    return "\n\n".join(parts) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="example: python benchmarks/bench_kernels.py --quick --out bench_kernels.md",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="short repeats, fewer values")
    parser.add_argument("--out", type=Path, help="write the Markdown to this file as well")
    arguments = parser.parse_args()
    with warnings.catch_warnings():
        # Other codes overflow on the way; their errors are in the tables.
        warnings.simplefilter("ignore")
        text = report(arguments.quick)
    print(text)
    if arguments.out is not None:
        arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
