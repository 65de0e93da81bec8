"""Regulator and valves by their own laws: flow through an orifice, overshoot, a limit cycle.

Pressures are gauge pressures in kPa, each held over a step of the clock, as in `drive`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from blind.second_rig.effect import Effect

Floats = npt.NDArray[np.float64]

_AIR_KPA = 101.325  # around the bench
_CRITICAL = 0.5283  # ratio of pressures below which a nozzle is choked by air
_MOST_TURNS = 400  # of a regulator within one step of the clock
_QUIET = 0.05  # share of a swing below which it begins anew


def orifice_flow(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Let air in and out of a volume through orifices; the amplitude is a time constant (s)."""
    pressure: Floats = _through(
        command,
        step_s,
        e.amplitude,
        e.shape["fill_share"],
        e.shape.get("critical", _CRITICAL),
        e.shape["laminar"],
        e.form == "nozzle",
        e.shape.get("supply_kpa", 0.0),
        e.shape.get("band_kpa", 0.0),
        state,
    )
    return pressure


@njit(cache=True)
def _subsonic(ratio: float, critical: float, nozzle: bool) -> float:
    """Flow over the choked flow: Saint-Venant's for a nozzle, else the ellipse of ISO 6358."""
    if nozzle:
        most = critical ** (2.0 / 1.4) - critical ** (2.4 / 1.4)
        return float(np.sqrt((ratio ** (2.0 / 1.4) - ratio ** (2.4 / 1.4)) / most))
    return float(np.sqrt(1.0 - ((ratio - critical) / (1.0 - critical)) ** 2))


@njit(cache=True)
def _passes(ratio: float, critical: float, laminar: float, nozzle: bool) -> float:
    """Flow over the choked flow, for the pressure behind an orifice over that before it."""
    if ratio <= critical:
        return 1.0
    if ratio < laminar:
        return float(_subsonic(ratio, critical, nozzle))
    # Where hardly anything flows it is laminar, and what is left dies away without an end.
    edge = _subsonic(laminar, critical, nozzle)
    return float(edge * max(1.0 - ratio, 0.0) / (1.0 - laminar))


@njit(cache=True)
def _through(
    command: Floats, step_s: float, vent_s: float, fill_share: float, critical: float,
    laminar: float, nozzle: bool, supply: float, band: float, state: Floats,
) -> Floats:  # fmt: skip
    """Fill from the regulator or from a supply behind a valve, vent to whatever is lower."""
    out = np.empty_like(command)
    for n in range(command.size):
        gap = command[n] - state[0]
        inside = _AIR_KPA + state[0]
        beyond = _AIR_KPA + command[n]
        opening = 1.0
        if band > 0.0:  # a valve between supply and outlet, which closes as the target comes near
            opening = min(abs(gap) / band, 1.0)
            beyond = _AIR_KPA + supply if gap > 0.0 else _AIR_KPA
        before, behind = max(inside, beyond), min(inside, beyond)
        time_s = vent_s * fill_share if gap > 0.0 else vent_s
        flow = opening * before * _passes(behind / before, critical, laminar, nozzle) / time_s
        move = min(flow * step_s, abs(gap))
        state[0] += move if gap > 0.0 else -move
        out[n] = state[0]
    return out


def kick(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Push too much at first: a share of each step comes on top and dies away."""
    over: Floats = _kicked(command, step_s, e.shape["rise_s"], e.shape["fall_s"], state)
    return np.maximum(command + e.amplitude * over, 0.0)


@njit(cache=True)
def _kicked(command: Floats, step_s: float, rise_s: float, fall_s: float, state: Floats) -> Floats:
    out = np.empty_like(command)
    quick, slow = np.exp(-step_s / rise_s), np.exp(-step_s / fall_s)
    for n in range(command.size):
        state[0] = command[n] + quick * (state[0] - command[n])
        state[1] = command[n] + slow * (state[1] - command[n])
        out[n] = state[0] - state[1]
    return out


def windup(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Regulate by proportion and integral through a valve of limited flow.

    While the valve is wide open the integral grows beyond what is needed, and the pressure
    overshoots until it is used up. The amplitude is the time from zero to the largest pressure (s).
    """
    pressure: Floats = _wound_up(
        command, step_s, e.amplitude, e.shape["top"], e.shape["proportion"], e.shape["integral"],
        state,
    )  # fmt: skip
    return pressure


@njit(cache=True)
def _wound_up(
    command: Floats, step_s: float, full_s: float, top: float, proportion: float, integral: float,
    state: Floats,
) -> Floats:  # fmt: skip
    out = np.empty_like(command)
    turns = min(max(int(np.ceil(20.0 * step_s / full_s)), 1), _MOST_TURNS)
    share = min(step_s / turns / full_s, 0.1)
    for n in range(command.size):
        for _ in range(turns):
            error = (command[n] - state[0]) / top
            if command[n] > 0.0:
                state[1] += share * integral * error
            else:
                state[1] = 0.0  # switched off: the valve vents
            wanted = proportion * error + state[1]
            state[0] = max(state[0] + share * top * min(max(wanted, -1.0), 1.0), 0.0)
        out[n] = state[0]
    return out


def hunting(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Let a regulator hunt while its command is held: the swing builds up, and a step ends it."""
    shape = e.shape
    swing: Floats = _hunted(
        command / shape["top"], step_s, shape["frequency_hz"], shape["lively_s"], shape["still"],
        ("sine", "relay", "stick_slip").index(e.form), shape.get("skew", 0.5),
        shape.get("second", 0.0), shape["power"], 0.05 * e.series, state,
    )  # fmt: skip
    return np.maximum(command + e.amplitude * shape["top"] * swing, 0.0)


@njit(cache=True)
def _wave(kind: int, phase: float, skew: float, second: float) -> float:
    """One cycle that starts at zero and rises."""
    if kind == 0:
        turn = 2.0 * np.pi * phase
        return float(np.sin(turn) + second * np.sin(2.0 * turn))
    # A relay fills for a share of the cycle and vents for the rest of it.
    at = (phase + 0.5 * skew) % 1.0
    saw = 2.0 * at / skew - 1.0 if at < skew else 1.0 - 2.0 * (at - skew) / (1.0 - skew)
    # A spool that sticks stays at either end, then slips to the other.
    return float(saw) if kind == 1 else float(min(max(3.0 * saw, -1.0), 1.0))


@njit(cache=True)
def _hunted(
    share: Floats, step_s: float, frequency: float, lively_s: float, still: float, kind: int,
    skew: float, second: float, power: float, uneven: Floats, state: Floats,
) -> Floats:  # fmt: skip
    """Swing about each held command; the state is phase, envelope, command and cycles."""
    out = np.empty_like(share)
    keep = np.exp(-step_s / lively_s)
    for n in range(share.size):
        moved = abs(share[n] - state[2])
        state[2] = share[n]
        state[1] = (1.0 - keep * (1.0 - state[1])) * np.exp(-moved / still)
        state[0] += step_s * frequency * (1.0 + uneven[int(state[3]) % uneven.size])
        if state[1] < _QUIET:
            state[0] = 0.0
        elif state[0] >= 1.0:
            state[0] -= 1.0
            state[3] += 1.0
        size = state[1] * max(share[n], 0.0) ** power
        out[n] = size * _wave(kind, state[0], skew, second)
    return out
