"""What pressure does to a body beside bending it: gain, folds, a set of the rest, damping, a mode.

Moments are pressures over the reference; `top` is the largest of them in the campaign.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from blind.second_rig.bank import Core, Damper, dashpot, fractional_damper
from blind.second_rig.effect import Effect

Floats = npt.NDArray[np.float64]

_MOST_STRETCH = 0.9  # of the pressure at which a membrane would burst
_LEAST_DAMPING = -0.95


def grown(e: Effect, moment: Floats) -> Floats:
    """Return the moment of walls that balloon or tighten, or that another chamber opposes."""
    x = moment / e.shape["top"]
    if e.form == "membrane":  # a neo-Hookean tube: stretch^-4 = 1 - pressure/bursting pressure
        return moment / np.sqrt(1.0 - np.minimum(e.amplitude * x, _MOST_STRETCH))
    if e.form == "bellows":  # small strain of the hoop
        return np.asarray(moment * (1.0 + e.amplitude * x))
    if e.form == "tension":  # walls under tension are stiff
        return np.asarray(moment / (1.0 + e.amplitude * x))
    share = e.shape["stretch"]  # an opposing chamber on the same supply, a membrane
    opposed = 1.0 / np.sqrt(1.0 - np.minimum(share * x, _MOST_STRETCH)) - 1.0
    most = 1.0 / np.sqrt(1.0 - share) - 1.0
    return np.asarray(moment * (1.0 - e.amplitude * opposed / most))


def unfolded(e: Effect, moment: Floats, step_s: float, state: Floats) -> Floats:
    """Return the moment of a fold that opens above a pressure; state: how far, and whether."""
    opens = e.shape["opens"] * e.shape["top"]
    if e.form == "crease":
        knee = e.shape["knee"] * opens
        return np.asarray(moment + e.amplitude * knee * np.logaddexp(0.0, (moment - opens) / knee))
    snapped: Floats = _snapped(
        moment, step_s, opens, e.shape["shuts"] * opens, e.shape["snap_s"], state
    )
    return np.asarray(moment + e.amplitude * snapped)


@njit(cache=True)
def _snapped(
    moment: Floats, step_s: float, opens: float, shuts: float, snap_s: float, state: Floats
) -> Floats:
    """Snap open at one pressure and shut at a lower one; an open fold adds a lever."""
    out = np.empty_like(moment)
    keep = np.exp(-step_s / snap_s)
    for n in range(moment.size):
        if moment[n] > opens:
            state[1] = 1.0
        elif moment[n] < shuts:
            state[1] = 0.0
        state[0] = state[1] + keep * (state[0] - state[1])
        out[n] = state[0] * max(moment[n] - 0.5 * shuts, 0.0)
    return out


def rest_set(e: Effect, pressure: Floats, step_s: float, state: Floats) -> Floats:
    """Return by how much pressure has set the rest, over the largest angle."""
    times = np.geomspace(e.shape["shortest_s"], e.shape["longest_s"], int(e.shape["elements"]))
    rest: Floats = _set(
        np.maximum(pressure / e.shape["top"], 0.0), step_s, e.shape["knee"], e.shape["setting_s"],
        times, state,
    )  # fmt: skip
    return np.asarray(e.amplitude * rest)


@njit(cache=True)
def _set(
    x: Floats, step_s: float, knee: float, setting_s: float, recovery: Floats, state: Floats
) -> Floats:
    """Follow a pressure that saturates: soon up to it, slowly back."""
    out = np.empty_like(x)
    most = 1.0 - np.exp(-1.0 / knee)
    up = np.exp(-step_s / setting_s)
    for n in range(x.size):
        aim = (1.0 - np.exp(-x[n] / knee)) / most
        total = 0.0
        for k in range(recovery.size):
            keep = up if aim > state[k] else np.exp(-step_s / recovery[k])
            state[k] = aim + keep * (state[k] - aim)
            total += state[k]
        out[n] = total / recovery.size
    return out


def damping(e: Effect, pressure: Floats) -> Floats:
    """Return by how many times its damper a pressure damps the body."""
    x = np.maximum(pressure / e.shape["top"], 0.0)
    begins = e.shape.get("touches", 0.0)
    felt = (np.maximum(x - begins, 0.0) / (1.0 - begins)) ** e.shape.get("power", 1.0)
    return np.maximum(e.shape.get("sign", 1.0) * e.amplitude * felt, _LEAST_DAMPING)


def damper(e: Effect, core: Core, step: float) -> Damper:
    """Return what damps: as much as the body's own fractional damping, or a dashpot."""
    return fractional_damper(core, step) if e.form == "fractional" else dashpot(core.a0)


def swung(
    e: Effect, pressure: Floats, angle: Floats, step_s: float, scale: float, state: Floats
) -> Floats:
    """Return the swing of a weakly damped mode about the settled angle.

    Parameters
    ----------
    e : Effect
        Its amplitude is left to the caller.
    pressure : ndarray, shape (n,)
        Over the reference; its rises strike the mode.
    angle : ndarray, shape (n + 1,)
        Of the body (rad), which shakes what it carries.
    step_s : float
        Step (s).
    scale : float
        Size of a usual swing, at which drag by air is as told.
    state : ndarray, shape (3,)
        Swing, its rate, and what struck last; changed.
    """
    omega = 2.0 * np.pi * e.shape["frequency_hz"]
    # What is carried on a springy neck lags behind the body's acceleration.
    felt = -np.diff(angle) / step_s if e.form == "carried" else omega * pressure
    swing: Floats = _swing(
        felt, step_s, omega, e.shape["damping"], e.shape.get("drag", 0.0) / scale, state
    )
    return swing


@njit(cache=True)
def _swing(
    felt: Floats, step_s: float, omega: float, damping: float, drag: float, state: Floats
) -> Floats:
    out = np.empty(felt.size + 1)
    out[0] = state[0]
    for n in range(felt.size):
        state[1] += felt[n] - state[2]
        state[2] = felt[n]
        rate = state[1]
        slowed = 2.0 * damping * omega * rate + 2.0 * drag * abs(rate) * rate
        state[1] += step_s * (-omega * omega * state[0] - slowed)
        state[0] += step_s * state[1]
        out[n + 1] = state[0]
    return out
