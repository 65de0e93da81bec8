"""The fractional memory of the actuator as a few damped modes, stepped with any load.

The impulse response of G(s) is its inverse Laplace integral. On a contour s = r e^{±iψ(r)} it reads

    g(t) = (1/π) Im ∫ [G(s) - R/(s-p) - R̄/(s-p̄)] e^{st} ds  +  2 Re R e^{pt},

p = |p|e^{iθ} being the pole of G, if there is one. The trapezoidal rule in ln r makes a mode
z' = s z + v of every node. Its error falls as e^{-2πw/d}, d the spacing and w the angle between the
contour and the nearest singularity or the imaginary axis (Trefethen and Weideman 2014,
doi:10.1137/130932132). The pole is taken out, and the cut along ψ = π is no obstacle, as G
continues analytically across it: beyond it p̄ is the first to come, so ψ lies half-way between π/2
and 2π - θ. The slowest nodes lie on the cut: elsewhere the static gain would come out too small.
Nodes faster than any step follow the load at once, so one node stands for all of them.

Steps may differ: h = FINEST_STEP_S · 2^level. Within each the load is a line, from half its rise
below its mean to half of it above: a fast actuator on a ramp would lag by half a step else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit, njit_inlined
from spa_fo.arrays import Floats, Integers
from spa_fo.fractional.characteristic import cexp, find_pole

Complexes = NDArray[np.complex128]

FINEST_STEP_S = 0.02
LEVELS = 18  # the longest step is 44 min
STEPS_S = FINEST_STEP_S * 2.0 ** np.arange(LEVELS)

_SPACING = 0.62
_RATES = np.exp(np.arange(math.log(1e-5), math.log(1e3), _SPACING))
MODES = _RATES.size + 1  # the last one is the pole's

_WIDTH = 32  # room for all modes, a power of two
_HALVES = (16, 8, 4, 2, 1)  # by which it is summed

_SMALL = 1e-3

_NO_POLE = 0.75 * math.pi
_CLEAR = 0.72  # rad, a little less than there is at worst where a contour is chosen: errs by 7e-4
_FASTER = 40  # nodes beyond the last one, up to 6e13/s: a small order has much of its gain there
_TURN = math.log(2e-3)  # ln of the rate about which the contour leaves the cut


@dataclass(frozen=True)
class Contour:
    """Nodes on one contour and what every step length does to their modes.

    Attributes
    ----------
    nodes, angles, weights : (n,) arrays
        s = r e^{iψ}, ψ, and ds/π of the trapezoidal rule.
    keep, gain, tilt : (LEVELS, n) complex arrays
        z becomes keep·z + gain·v + tilt·r over a step with a load of the mean v that rises by r.
    """

    nodes: Complexes
    angles: Floats
    weights: Complexes
    keep: Complexes
    gain: Complexes
    tilt: Complexes


def contour_for(x: Floats) -> Contour:
    """Choose the contour that stays clear of the pole of G with the coefficients `x`."""
    theta = find_pole(x[0], x[1], x[2], x[3]).imag
    return _contour(round(1.25 * math.pi - 0.5 * theta, 1) if theta > 0.0 else _NO_POLE)


def kept_or_chosen(contour: Contour, x: Floats) -> Contour:
    """Keep a contour while it stays clear of the pole of G with other coefficients `x`.

    On one contour the error varies smoothly with the coefficients, as a fit needs it. Too near to
    the pole's conjugate it is large, and jumps where the pole leaves the sheet.
    """
    theta = find_pole(x[0], x[1], x[2], x[3]).imag or math.pi
    clear = 2.0 * math.pi - theta - contour.angles[-1]
    return contour if clear > _CLEAR else contour_for(x)


@lru_cache(maxsize=32)
def _contour(fast_angle: float) -> Contour:
    x = np.log(_RATES)
    turn = 1.0 / (1.0 + np.exp(-(x - _TURN)))
    angle = math.pi - (math.pi - fast_angle) * turn
    slope = -(math.pi - fast_angle) * turn * (1.0 - turn)
    nodes = _RATES * np.exp(1j * angle)
    weights = _SPACING / math.pi * nodes * (1.0 + 1j * slope)
    exponent = STEPS_S[:, None] * nodes[None, :]
    gain, tilt = np.expm1(exponent) / nodes, STEPS_S[:, None] * tilted(exponent)
    return Contour(nodes, angle, weights, np.exp(exponent), gain, tilt)


@njit
def tilted(x: Complexes) -> Complexes:
    r"""Give :math:`\int_0^1 e^{x(1-t)} (t - 1/2) dt`, by its series where it would lose digits."""
    series = -x / 12.0 * (1.0 + x / 2.0 + 3.0 * x * x / 20.0)
    safe = np.where(np.abs(x) < _SMALL, 1.0 + 0j, x)
    grown = np.exp(safe)
    exact = (grown - 1.0 - safe) / (safe * safe) - 0.5 * (grown - 1.0) / safe
    return np.where(np.abs(x) < _SMALL, series, exact)


@njit
def mode_weights(
    x: Floats, nodes: Complexes, angles: Floats, node_weights: Complexes
) -> tuple[Complexes, complex]:
    """Weights of the modes, and the pole.

    Parameters
    ----------
    x : (5,) array
        alpha2, alpha1, a1, a0, b0.
    nodes, angles, node_weights : (n,) arrays
        From `contour_for`.

    Returns
    -------
    weights : (n + 1,) complex array
        The angle is Im(sum of weights·modes) over the nodes and the pole's mode.
    pole : complex
        0 where no pole is to be added.
    """
    n = nodes.size
    weights = np.empty(n + 1, dtype=np.complex128)
    w = find_pole(x[0], x[1], x[2], x[3])
    pole, residue = 0j, 0j
    if w != 0j:
        pole = cexp(w)
        slope = x[0] * cexp((x[0] - 1.0) * w) + x[1] * x[2] * cexp((x[1] - 1.0) * w)
        residue = x[4] / slope
    for k in range(n):
        weights[k] = node_weights[k] * _less_pole(x, nodes[k], angles[k], pole, residue)
    s, share = nodes[n - 1], node_weights[n - 1] / nodes[n - 1]
    for _ in range(_FASTER):
        s *= math.exp(_SPACING)
        weights[n - 1] += nodes[n - 1] * share * _less_pole(x, s, angles[n - 1], pole, residue)
    weights[n] = 2j * residue  # Im(2iRz) = 2 Re(Rz)
    return weights, pole


@njit
def _less_pole(x: Floats, s: complex, angle: float, pole: complex, residue: complex) -> complex:
    """G(s) without its pole and the pole's conjugate; `angle` is that of s."""
    log_s = complex(math.log(abs(s)), angle)
    g: complex = x[4] / (cexp(x[0] * log_s) + x[2] * cexp(x[1] * log_s) + x[3])
    if residue != 0j:
        g -= residue / (s - pole) + residue.conjugate() / (s - pole.conjugate())
    return g


class Stepper(NamedTuple):
    """The modes made ready to be stepped; beyond `MODES` there are zeros.

    Real and imaginary parts stand apart, and products are summed by halves: a processor does
    several of them at a time, and takes half as long as for one mode after another.

    Attributes
    ----------
    keep_re, keep_im, gain_re, gain_im, tilt_re, tilt_im : (LEVELS, width) arrays
        As a `Contour` has them, the pole's last.
    weights_re, weights_im, re, im : (width,) arrays
        The angle is Im(sum of weights·modes).
    parts : (width,) array
        Room for the products.
    direct, leaning : (LEVELS,) arrays
        What a load of 1, and one that rises by 1 about 0, add to the angle within a step.
    """

    keep_re: Floats
    keep_im: Floats
    gain_re: Floats
    gain_im: Floats
    tilt_re: Floats
    tilt_im: Floats
    weights_re: Floats
    weights_im: Floats
    re: Floats
    im: Floats
    parts: Floats
    direct: Floats
    leaning: Floats


@njit
def stepper(
    x: Floats,
    nodes: Complexes,
    angles: Floats,
    node_weights: Complexes,
    keep: Complexes,
    gain: Complexes,
    tilt: Complexes,
    modes: Complexes,
) -> Stepper:
    """Make the modes ready for an actuator with the coefficients `x`; see `Contour`."""
    n = nodes.size
    weights, pole = mode_weights(x, nodes, angles, node_weights)
    kept, gained = np.ones((LEVELS, n + 1), np.complex128), np.zeros((LEVELS, n + 1), np.complex128)
    leant = np.zeros((LEVELS, n + 1), np.complex128)
    kept[:, :n], gained[:, :n], leant[:, :n] = keep, gain, tilt
    if pole != 0j:
        kept[:, n] = np.exp(pole * STEPS_S)
        gained[:, n] = (kept[:, n] - 1.0) / pole
        leant[:, n] = STEPS_S * tilted((pole * STEPS_S).astype(np.complex128))
    direct = np.array([np.sum(weights * own).imag for own in gained])
    leaning = np.array([np.sum(weights * own).imag for own in leant])
    keep_re, keep_im = _wide(kept.real), _wide(kept.imag)
    gain_re, gain_im = _wide(gained.real), _wide(gained.imag)
    tilt_re, tilt_im = _wide(leant.real), _wide(leant.imag)
    by = np.empty((2, n + 1), np.complex128)
    by[0], by[1] = weights, modes
    re, im = _wide(by.real), _wide(by.imag)
    return Stepper(
        keep_re,
        keep_im,
        gain_re,
        gain_im,
        tilt_re,
        tilt_im,
        re[0],
        im[0],
        re[1],
        im[1],
        np.zeros(_WIDTH),
        direct,
        leaning,
    )


@njit
def _wide(values: Floats) -> Floats:
    """Fill rows up with zeros."""
    out = np.zeros((values.shape[0], _WIDTH))
    out[:, : values.shape[1]] = values
    return out


@njit_inlined
def coast(s: Stepper, level: int) -> float:
    """Step all modes without a load; returns the angle (rad) that they make."""
    keep_re, keep_im, re, im, parts = s.keep_re[level], s.keep_im[level], s.re, s.im, s.parts
    weights_re, weights_im = s.weights_re, s.weights_im
    for j in range(_WIDTH):
        real = keep_re[j] * re[j] - keep_im[j] * im[j]
        imaginary = keep_re[j] * im[j] + keep_im[j] * re[j]
        re[j], im[j] = real, imaginary
        parts[j] = weights_re[j] * imaginary + weights_im[j] * real
    for half in _HALVES:
        for j in range(half):
            parts[j] += parts[j + half]
    return float(parts[0])


@njit_inlined
def push(s: Stepper, level: int, load: float, rise: float) -> None:
    """Add what a load makes of the modes within the step that they have coasted."""
    gain_re, gain_im, re, im = s.gain_re[level], s.gain_im[level], s.re, s.im
    tilt_re, tilt_im = s.tilt_re[level], s.tilt_im[level]
    for j in range(_WIDTH):
        re[j] += gain_re[j] * load + tilt_re[j] * rise
        im[j] += gain_im[j] * load + tilt_im[j] * rise


@njit
def rises(load: Floats, level: Integers) -> Floats:
    """Give by how much a load rises within each step, (n,), from its means over the steps.

    By the smaller of the slopes to either side (van Leer 1977, doi:10.1016/0021-9991(77)90095-X):
    0 beside a jump and where the load is held.
    """
    out = np.zeros_like(load)
    before = 0.0
    for i in range(load.size - 1):
        own = STEPS_S[level[i]]
        after = (load[i + 1] - load[i]) / (0.5 * (own + STEPS_S[level[i + 1]]))
        if before * after > 0.0:
            out[i] = own * math.copysign(min(abs(before), abs(after)), after)
        before = after
    return out


@njit
def means_over(cells: Floats, first: Integers, count: Integers) -> Floats:
    """Average `count` cells from each `first` on, (n,); 0 where there are none."""
    out = np.zeros(first.size)
    for i in range(first.size):
        total = 0.0
        for cell in range(first[i], first[i] + count[i]):
            total += cells[cell]
        if count[i] > 0:
            out[i] = total / count[i]
    return out


@njit
def read_rows(
    cells: Floats,
    before: Integers,
    over: Integers,
    following: Integers,
    cells_on: Floats,
    starts: Integers,
) -> Floats:
    """Sum up what rows read, from each of `starts` to the next, (n,); see `CampaignGrid.read`.

    A row reads the cell that is `over`, and how far it goes `cells_on` by the smaller slope to its
    neighbours. In one go it takes a fifth of the time that whole arrays do.
    """
    out = np.zeros(starts.size)
    for i in range(starts.size):
        end = starts[i + 1] if i + 1 < starts.size else over.size
        for row in range(starts[i], end):
            here = cells[over[row]]
            rise, goes_on = here - cells[before[row]], cells[following[row]] - here
            if rise * goes_on > 0.0:
                here += math.copysign(min(abs(rise), abs(goes_on)), rise) * cells_on[row]
            out[i] += here
    return out


@njit
def keep_modes(s: Stepper, modes: Complexes) -> None:
    """Write the modes back to where they came from."""
    for j in range(modes.size):
        modes[j] = complex(s.re[j], s.im[j])
