"""From the commanded to the true pressure: pump, regulator, valve and tube.

Pressures are in kPa, each held over a step of the clock. A `Line` remembers what the pneumatics
hold from one stretch of time to the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from numba import njit

from blind.second_rig.effect import Effect
from blind.second_rig.valves import hunting, kick, orifice_flow, windup

Floats = npt.NDArray[np.float64]

_PLAYS = np.array([0.4, 0.8, 1.2, 1.6])  # widths of a soft contact's single plays


@dataclass
class Line:
    """States by effect, and the command as it was last."""

    states: dict[str, Floats] = field(default_factory=dict)

    def of(self, effect: Effect, size: int) -> Floats:
        """Return the state of an effect, zeros at first."""
        return self.states.setdefault(effect.id, np.zeros(size))


Transmit = Callable[[Effect, Floats, float, Floats, float], Floats]


def transmit(
    effects: Sequence[Effect], command: Floats, step_s: float, line: Line, started_s: float
) -> Floats:
    """Return the true pressure for a command.

    Parameters
    ----------
    effects : sequence of Effect
        Those of the drive act, in their order; others are passed over.
    command : ndarray, shape (n,)
        Commanded pressure (kPa), mean over each step.
    step_s : float
        Step (s).
    line : Line
        What the pneumatics remember; changed.
    started_s : float
        Campaign time of the first step.
    """
    pressure = command
    for effect in effects:
        if effect.amplitude != 0.0 and effect.id in _TRANSMIT:
            transmit_one, states = _TRANSMIT[effect.id]
            state = line.of(effect, states)
            pressure = transmit_one(effect, pressure, step_s, state, started_s)
    return pressure


def _dead_time(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Transport delay; between stretches the command is zero for longer than any delay."""
    whole = np.concatenate([[0.0], np.cumsum(command)])
    times = np.arange(whole.size, dtype=np.float64)
    return np.diff(np.interp(times - e.amplitude / step_s, times, whole))


def _line_lag(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    if "fill_share" in e.shape:
        return orifice_flow(e, command, step_s, state, at_s)
    second = e.shape.get("second", 0.0) * e.amplitude
    pressure: Floats = _tube(command, step_s, e.amplitude, second, state)
    return pressure


@njit(cache=True)
def _tube(command: Floats, step_s: float, first_s: float, second_s: float, state: Floats) -> Floats:
    """Tube and volume, one node or two."""
    out = np.empty_like(command)
    keep = np.exp(-step_s / first_s)
    keep2 = np.exp(-step_s / second_s) if second_s > 0.0 else 0.0
    for n in range(command.size):
        state[0] = command[n] + keep * (state[0] - command[n])
        state[1] = state[0] + keep2 * (state[1] - state[0])
        out[n] = state[1]
    return out


def _supply_droop(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    share = e.form == "regulator"
    pressure: Floats = _reservoir(
        command, step_s, e.amplitude, e.shape["recovery_s"], e.shape["top"], share, state
    )
    return pressure


@njit(cache=True)
def _reservoir(
    command: Floats,
    step_s: float,
    size: float,
    recovery_s: float,
    top: float,
    share: bool,
    state: Floats,
) -> Floats:
    """Each rise draws the supply down; it recovers with a time constant."""
    out = np.empty_like(command)
    keep = np.exp(-step_s / recovery_s)
    for n in range(command.size):
        rise = max(command[n] - state[1], 0.0)
        state[1] = command[n]
        state[0] = keep * state[0] + size * rise
        sag = state[0] / top * command[n] if share else state[0]
        out[n] = max(command[n] - sag, 0.0)
    return out


def _leak(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    pressure: Floats = _seep(
        command, step_s, e.amplitude, e.shape["top"], e.form == "orifice", state
    )
    return pressure


@njit(cache=True)
def _seep(
    command: Floats, step_s: float, rate: float, top: float, orifice: bool, state: Floats
) -> Floats:
    """Move the difference of commands into a volume that loses air, as a syringe does."""
    out = np.empty_like(command)
    for n in range(command.size):
        pressure = max(state[0] + command[n] - state[1], 0.0)
        state[1] = command[n]
        lost = np.sqrt(pressure * top) if orifice else pressure
        state[0] = max(pressure - rate * step_s * lost, 0.0)
        out[n] = state[0]
    return out


def _slew_limit(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    rate = e.shape["top"] / e.amplitude
    pressure: Floats = _flow(
        command, step_s, rate, e.shape.get("knee", 0.0) * e.shape["top"], state
    )
    return pressure


@njit(cache=True)
def _flow(command: Floats, step_s: float, rate: float, knee: float, state: Floats) -> Floats:
    """Limit a pump's flow; with a knee it falls off as the target comes near."""
    out = np.empty_like(command)
    for n in range(command.size):
        gap = command[n] - state[0]
        if knee > 0.0:
            most = rate * step_s * np.tanh(abs(gap) / knee)
            move = min(max(gap, -most), most)
        else:
            move = min(max(gap, -rate * step_s), rate * step_s)
        state[0] += move
        out[n] = state[0]
    return out


def _drive_backlash(
    e: Effect, command: Floats, step_s: float, state: Floats, at_s: float
) -> Floats:
    width = e.amplitude * e.shape["top"]
    widths = width * (_PLAYS if e.form == "soft_play" else np.ones(4))
    pressure: Floats = _play(command, widths, e.shape["engaged"], state)
    return pressure


@njit(cache=True)
def _play(command: Floats, widths: Floats, engaged: float, state: Floats) -> Floats:
    """Play: the pressure waits until the gap is crossed; several plays make a soft contact."""
    out = np.empty_like(command)
    for n in range(command.size):
        total = 0.0
        for k in range(widths.size):
            low = command[n] - (1.0 - engaged) * widths[k]
            high = command[n] + engaged * widths[k]
            state[k] = min(max(state[k], low), high)
            total += state[k]
        out[n] = total / widths.size
    return out


def _overshoot(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Let a regulator swing about its target; the amplitude is the period (s)."""
    omega = 2.0 * np.pi / e.amplitude
    pressure: Floats = _swinging(command, step_s, omega, e.shape["damping"], state)
    return pressure


@njit(cache=True)
def _swinging(
    command: Floats, step_s: float, omega: float, damping: float, state: Floats
) -> Floats:
    """Step an underdamped second order by its exact solution; the state is error, rate, target."""
    out = np.empty_like(command)
    slow = damping * omega
    fast = omega * np.sqrt(1.0 - damping * damping)
    fading = np.exp(-slow * step_s)
    along, across = fading * np.cos(fast * step_s), fading * np.sin(fast * step_s) / fast
    for n in range(command.size):
        error = state[0] + state[2] - command[n]
        state[2] = command[n]
        state[0] = (along + slow * across) * error + across * state[1]
        state[1] = (along - slow * across) * state[1] - omega * omega * across * error
        out[n] = max(command[n] + state[0], 0.0)
    return out


def _drive_overshoot(
    e: Effect, command: Floats, step_s: float, state: Floats, at_s: float
) -> Floats:
    """Overshoot as a second order, by what comes on top at first, or by an integral wound up."""
    law: Transmit = {"second_order": _overshoot, "kick": kick, "windup": windup}[e.form]
    return law(e, command, step_s, state, at_s)


def _slow_vent(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    pressure: Floats = _orifice(
        command, step_s, e.shape["fill_share"] * e.amplitude, e.amplitude, state
    )
    return pressure


@njit(cache=True)
def _orifice(command: Floats, step_s: float, fill_s: float, vent_s: float, state: Floats) -> Floats:
    """Fill and vent through orifices of unlike size."""
    out = np.empty_like(command)
    for n in range(command.size):
        gap = command[n] - state[0]
        state[0] += gap * -np.expm1(-step_s / (fill_s if gap > 0.0 else vent_s))
        out[n] = state[0]
    return out


def _limit_cycle(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Let a valve hunt about its set-point: a triangle wave in proportion to the pressure."""
    phase = (at_s + step_s * np.arange(command.size)) * e.shape["frequency_hz"] % 1.0
    wave = 4.0 * np.abs(phase - 0.5) - 1.0
    hunting: Floats = np.maximum(command * (1.0 + e.amplitude * wave), 0.0)
    return hunting


def _supply_wander(e: Effect, command: Floats, step_s: float, state: Floats, at_s: float) -> Floats:
    """Let the supply wander: a smooth random factor on the pressure over campaign time."""
    times = (at_s + step_s * np.arange(command.size)) / e.shape["knot_s"] + 8.0
    wander = np.interp(times, np.arange(e.series.size, dtype=np.float64), e.series)
    wandering: Floats = np.maximum(command * (1.0 + e.amplitude * wander), 0.0)
    return wandering


_TRANSMIT: dict[str, tuple[Transmit, int]] = {
    "supply_droop": (_supply_droop, 2),
    "supply_wander": (_supply_wander, 1),
    "dead_time": (_dead_time, 1),
    "drive_backlash": (_drive_backlash, 4),
    "slew_limit": (_slew_limit, 1),
    "regulator_overshoot": (_overshoot, 3),
    "drive_overshoot": (_drive_overshoot, 3),
    "slow_vent": (_slow_vent, 1),
    "valve_limit_cycle": (_limit_cycle, 1),
    "drive_hunting": (hunting, 4),
    "line_lag": (_line_lag, 2),
    "leak": (_leak, 2),
}
