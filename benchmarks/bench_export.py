"""Rational approximations of G(s) at equal order: error over the band, in the step, at rest.

What `spa-fo export` uses is compared with what else the literature offers, and with two ways to
spoil it: another split of the orders, and polynomial coefficients. All errors are computed here
against the exact model; nothing is timed.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import AAA
from scipy.linalg import solve_continuous_lyapunov
from scipy.signal import lfilter, sos2tf
from tabulate import tabulate

from spa_fo.export import Band, Rational, approximate, default_band, discretise, oustaloup
from spa_fo.export.accuracy import exact_step
from spa_fo.export.approximation import Approximation
from spa_fo.export.fitted import exact_response
from spa_fo.plant import TransferFunction

Floats = NDArray[np.float64]
Response = Callable[[Floats], NDArray[np.complex128]]

SAMPLE_TIME_S = 0.02
REACH = 10.0
MODELS = {
    "Dragon Skin 20, Table I": TransferFunction(1.406, 1.196, 0.794, 1.638, 0.934),
    "near 2 (fit of raw/dragon_skin_20)": TransferFunction(1.98, 1.0675, 1.7656, 1.7401, 0.9892),
    "slow (orders below 1)": TransferFunction(0.7, 0.3, 1.0, 1.0, 1.0),
}


@dataclass(frozen=True)
class Row:
    """One approximation; step is NaN where only its frequency response is formed."""

    code: str
    states: int | str
    db: float
    deg: float
    step: float
    static: float
    remark: str = ""


def operators(
    g: TransferFunction, power: Callable[[float, Floats], NDArray[np.complex128]]
) -> Response:
    """Put some approximation of s^a into G."""

    def response(omega: Floats) -> NDArray[np.complex128]:
        return g.b0 / (power(g.alpha2, omega) + g.a1 * power(g.alpha1, omega) + g.a0)

    return response


def split(whole: Callable[[float], int], filtered: Callable[[float, Floats], NDArray]) -> Callable:
    """s^a = s^n times a filter for s^(a - n)."""

    def power(a: float, omega: Floats) -> NDArray[np.complex128]:
        n = whole(a)
        return (1j * omega) ** n * filtered(a - n, omega)

    return power


def plain_filter(reach: Band, n: int) -> Callable[[float, Floats], NDArray]:
    def filtered(exponent: float, omega: Floats) -> NDArray[np.complex128]:
        if exponent == 0.0:
            return np.ones(omega.shape, complex)
        zeros, poles, gain = oustaloup(exponent, reach.low, reach.high, n)
        s = 1j * omega[:, np.newaxis]
        return gain * np.prod((s - zeros) / (s - poles), axis=1)

    return filtered


def refined_filter(reach: Band, n: int, b: float = 10.0, d: float = 9.0) -> Callable:
    """Refined Oustaloup filter: Xue, Zhao and Chen, IEEE ICMA 2006."""

    def filtered(exponent: float, omega: Floats) -> NDArray[np.complex128]:
        s = 1j * omega
        zeros, poles, _ = oustaloup(exponent, reach.low, reach.high, n)
        product = np.prod((s[:, None] - zeros) / (s[:, None] - poles), axis=1)
        quadratic = (d * s**2 + b * reach.high * s) / (
            d * (1.0 - exponent) * s**2 + b * reach.high * s + d * exponent
        )
        return (d * reach.high / b) ** exponent * quadratic * product

    return filtered


def matsuda_filter(reach: Band, n: int) -> Callable[[float, Floats], NDArray]:
    """Continued fraction through ω^a at 2n + 1 frequencies: Matsuda and Fujii 1993, J. Guidance."""
    nodes = np.geomspace(reach.low, reach.high, 2 * n + 1)

    def filtered(exponent: float, omega: Floats) -> NDArray[np.complex128]:
        values, coefficients = nodes**exponent, []
        for k in range(nodes.size):
            coefficients.append(values[k])
            with np.errstate(divide="ignore", invalid="ignore"):
                values = (nodes - nodes[k]) / (values - coefficients[k])
        s = 1j * omega
        result = np.full(s.shape, coefficients[-1], complex)
        for k in range(nodes.size - 2, -1, -1):
            result = coefficients[k] + (s - nodes[k]) / result
        return result

    return filtered


def balanced(g: TransferFunction, reach: Band, states: int) -> tuple[Response, Callable]:
    """Balanced truncation (Moore 1981, doi:10.1109/TAC.1981.1102568) of the step's transient.

    The transient (G(s) - G(0))/s of an Oustaloup form of 100 poles is reduced; so the static gain
    stays exact, and the bound 2 sum(sigma) is one of the step response.
    """
    form = approximate(g, "oustaloup", Band(reach.low, reach.high), 24).rational.state_space()
    A, B, C = form.A, np.linalg.solve(form.A, form.B), form.C
    P = _root(solve_continuous_lyapunov(A, -B @ B.T))
    Q = _root(solve_continuous_lyapunov(A.T, -C.T @ C))
    U, sigma, Vt = np.linalg.svd(Q.T @ P)
    right = P @ Vt[:states].T / np.sqrt(sigma[:states])
    left = Q @ U[:, :states] / np.sqrt(sigma[:states])
    Ar, Br, Cr = left.T @ A @ right, left.T @ B, C @ right
    feed = g.gain + (Cr @ Br)[0, 0]
    system = control.ss(Ar, Ar @ Br, Cr, [[feed]])

    def step(t: Floats) -> Floats:
        w, V = np.linalg.eig(Ar)
        modes = (Cr @ V)[0] * np.linalg.solve(V, (Br[:, 0]).astype(complex))
        return g.gain + np.real(np.exp(np.outer(t, w)) @ modes)

    return lambda omega: np.asarray(system(1j * omega)), step


def _root(matrix: Floats) -> Floats:
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return vectors * np.sqrt(np.clip(values, 0.0, None))


def aaa(g: TransferFunction, reach: Band, states: int) -> tuple[Response, str]:
    """AAA (Nakatsukasa, Sete and Trefethen 2018, doi:10.1137/16M1106122) on both half axes."""
    omega = np.geomspace(reach.low, reach.high, 300)
    z = 1j * np.concatenate([-omega, omega])
    values = exact_response(g, omega)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = AAA(z, np.concatenate([values.conj(), values]), max_terms=states + 1, rtol=1e-15)
    unstable = int(np.count_nonzero(fit.poles().real > 0))
    return lambda w: fit(1j * w), f"{unstable} unstable poles" if unstable else ""


def measured(
    g: TransferFunction,
    band: Band,
    code: str,
    states: int | str,
    response: Response,
    step: Callable[[Floats], Floats] | None = None,
    remark: str = "",
) -> Row:
    omega = np.geomspace(band.low, band.high, 300)
    ratio = response(omega) / exact_response(g, omega)
    t = np.geomspace(1.0 / band.high, 1.0 / band.low, 120)
    largest = np.nan
    if step is not None:
        largest = float(np.max(np.abs(step(t) - exact_step(g, t))) / g.gain * 100.0)
    with np.errstate(invalid="ignore"):
        static = abs(response(np.array([1e-9 * band.low]))[0]) / g.gain - 1.0
    return Row(
        code,
        states,
        float(np.max(np.abs(20.0 * np.log10(np.abs(ratio))))),
        float(np.max(np.abs(np.degrees(np.angle(ratio))))),
        largest,
        100.0 * float(static),
        remark,
    )


def own(g: TransferFunction, band: Band, method: str, order: int, code: str) -> Row:
    made: Approximation = approximate(g, method, band, order)
    rational = made.rational
    return measured(g, band, code, rational.states, rational.response, rational.step)


def compare(g: TransferFunction, n: int) -> list[Row]:
    """Oustaloup's filters of N = n, and everything else with as many poles as they make."""
    band = default_band(g, SAMPLE_TIME_S)
    reach = band.widened(REACH)
    states = approximate(g, "oustaloup", band, n).rational.states
    rows = [
        own(g, band, "oustaloup", n, "Oustaloup (--method oustaloup)"),
        own(g, band, "fitted", min(states, 24), "fitted (--method fitted)"),
    ]
    half = max(3, states // 2)
    rows.append(own(g, band, "fitted", half, "fitted, half as many poles"))
    filters = {
        "Oustaloup, split s^a = s^floor(a) s^(a-floor(a))": (np.floor, plain_filter(reach, n)),
        "Oustaloup, band not widened": (nearest, plain_filter(band, n)),
        "refined Oustaloup, split as ours": (nearest, refined_filter(reach, n)),
        "Matsuda-Fujii, split as ours": (nearest, matsuda_filter(reach, 2 * n + 1)),
    }
    for code, (whole, filtered) in filters.items():
        power = split(lambda a, whole=whole: int(whole(a)), filtered)
        rows.append(measured(g, band, code, states, operators(g, power)))
    reduced, step = balanced(g, reach, states)
    rows.append(measured(g, band, "balanced truncation of the step", states, reduced, step))
    rational, remark = aaa(g, band, states)
    rows.append(measured(g, band, "AAA of the whole", states, rational, remark=remark))
    return rows


def nearest(a: float) -> int:
    return 2 if a > 1.5 else 1


def conditioning(g: TransferFunction) -> list[list[str]]:
    """What is left of an approximation that passes through polynomial coefficients."""
    band = default_band(g, SAMPLE_TIME_S)
    omega = np.geomspace(band.low, band.high, 100)
    rows = []
    for n in (2, 5, 10, 15):
        rational = approximate(g, "oustaloup", band, n).rational
        exact = rational.response(omega)
        form = rational.state_space()
        chain = control.ss(form.A, form.B, form.C, form.D)
        above = np.real(np.poly(rational.zeros)) * rational.leading_gain
        polynomial = control.tf(above, np.real(np.poly(rational.poles)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            companion = control.tf2ss(polynomial)
        errors = [
            np.max(np.abs(system(1j * omega) / exact - 1.0))
            for system in (chain, polynomial, companion)
        ]
        moved = [_moved(rational.poles, np.asarray(s.poles())) for s in (chain, companion)]
        sampled = _sampled(rational)
        numbers = (*errors, *moved, *sampled)
        rows.append([f"{rational.states}", *(f"{value:.1e}" for value in numbers)])
    return rows


def _sampled(rational: Rational) -> tuple[float, float]:
    """Errors of a filter's first 1000 samples, as sections and as one fraction."""
    made = discretise(rational, SAMPLE_TIME_S)
    exact = rational.step(np.arange(1000) * SAMPLE_TIME_S)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        direct = lfilter(*sos2tf(made.sos), np.ones(1000))
    return tuple(
        float(np.max(np.abs(y - exact)) / rational.gain) for y in (made.run(np.ones(1000)), direct)
    )


def _moved(poles: NDArray, found: NDArray) -> float:
    """Largest relative distance of a pole to the nearest one found."""
    return max(float(np.min(np.abs(found - pole)) / abs(pole)) for pole in poles)


def document() -> str:
    """All tables, as markdown."""
    parts = ["## Rational approximations at equal order\n"]
    for name, g in MODELS.items():
        band = default_band(g, SAMPLE_TIME_S)
        for n in (2, 4):
            parts.append(
                f"### {name}, N = {n}\n\nLargest errors over {band.low:.3g} to {band.high:.3g} "
                "rad/s, of the step response from 1/high to 1/low, and of the static gain.\n"
            )
            rows = [
                [
                    row.code,
                    row.states,
                    f"{row.db:.2g}",
                    f"{row.deg:.2g}",
                    "" if np.isnan(row.step) else f"{row.step:.2g}",
                    "exact" if abs(row.static) < 1e-6 else f"{row.static:.2g}",
                    row.remark,
                ]
                for row in compare(g, n)
            ]
            heads = ["approximation", "poles", "dB", "°", "step (%)", "static gain (%)", ""]
            parts.append(tabulate(rows, heads, tablefmt="github", disable_numparse=True) + "\n")
    parts.append(
        "### Polynomials lose the digits\n\nRelative error of the frequency response, of the "
        "poles, and of the sampled step response (20 s at 50 Hz), against the zero-pole form: "
        "Oustaloup's approximation of Dragon Skin 20.\n"
    )
    heads = [
        "poles",
        "chain of sections",
        "tf",
        "tf2ss",
        "poles of the chain",
        "poles of tf2ss",
        "discrete sections",
        "discrete tf",
    ]
    rows = conditioning(MODELS["Dragon Skin 20, Table I"])
    parts.append(tabulate(rows, heads, tablefmt="github", disable_numparse=True) + "\n")
    return "\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, metavar="FILE.md")
    options = parser.parse_args()
    text = document()
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
