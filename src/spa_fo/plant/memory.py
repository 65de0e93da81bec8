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

Steps may differ: h = FINEST_STEP_S · 2^level, with the load constant in each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit
from spa_fo.fractional.characteristic import cexp, find_pole

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FINEST_STEP_S = 0.02
LEVELS = 18  # the longest step is 44 min
STEPS_S = FINEST_STEP_S * 2.0 ** np.arange(LEVELS)

_SPACING = 0.62
_RATES = np.exp(np.arange(math.log(1e-5), math.log(1e3), _SPACING))
MODES = _RATES.size + 1  # the last one is the pole's

_NO_POLE = 0.75 * math.pi
_FASTER = 40  # nodes beyond the last one, up to 6e13/s: a small order has much of its gain there
_TURN = math.log(2e-3)  # ln of the rate about which the contour leaves the cut


@dataclass(frozen=True)
class Contour:
    """Nodes on one contour and what every step length does to their modes.

    Attributes
    ----------
    nodes, angles, weights : (n,) arrays
        s = r e^{iψ}, ψ, and ds/π of the trapezoidal rule.
    keep, gain : (LEVELS, n) complex arrays
        z becomes keep·z + gain·v over a step with load v.
    """

    nodes: Complexes
    angles: Floats
    weights: Complexes
    keep: Complexes
    gain: Complexes


def contour_for(x: Floats) -> Contour:
    """Choose the contour that stays clear of the pole of G with the coefficients `x`.

    A fit keeps the contour it began with: on it the error varies smoothly with the coefficients.
    """
    theta = find_pole(x[0], x[1], x[2], x[3]).imag
    return _contour(round(1.25 * math.pi - 0.5 * theta, 1) if theta > 0.0 else _NO_POLE)


@lru_cache(maxsize=32)
def _contour(fast_angle: float) -> Contour:
    x = np.log(_RATES)
    turn = 1.0 / (1.0 + np.exp(-(x - _TURN)))
    angle = math.pi - (math.pi - fast_angle) * turn
    slope = -(math.pi - fast_angle) * turn * (1.0 - turn)
    nodes = _RATES * np.exp(1j * angle)
    weights = _SPACING / math.pi * nodes * (1.0 + 1j * slope)
    exponent = STEPS_S[:, None] * nodes[None, :]
    return Contour(nodes, angle, weights, np.exp(exponent), np.expm1(exponent) / nodes)


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
