"""From the true to the read angle: the flex sensor, its pocket, and the channel it is logged by.

Angles are in degrees on the points of the clock, one more than there are steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from numba import njit

from blind.second_rig.effect import Effect

Floats = npt.NDArray[np.float64]


@dataclass
class Skin:
    """What the sensor remembers: states by effect, made at the first angle it sees."""

    states: dict[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class When:
    """Place of a stretch in the campaign.

    Attributes
    ----------
    started_s : float
        Campaign time of its first point.
    order : int
        0 before the first trial, else how many trials have begun.
    """

    started_s: float
    order: int


See = Callable[[Effect, Floats, Floats, float, Skin, When], Floats]


def see(
    effects: Sequence[Effect],
    angle: Floats,
    pressure: Floats,
    step_s: float,
    skin: Skin,
    when: When,
) -> Floats:
    """Return the angle that the sensor shows.

    Parameters
    ----------
    effects : sequence of Effect
        Those of the sensor act, in their order; others are passed over.
    angle, pressure : ndarray, shape (n + 1,)
        True angle (deg) and true pressure (in units of the largest command).
    step_s : float
        Step (s).
    skin : Skin
        What the sensor remembers; changed.
    when : When
        Place in the campaign.
    """
    shown = angle
    for effect in effects:
        if effect.amplitude != 0.0 and effect.id in _SEE:
            shown = _SEE[effect.id](effect, shown, pressure, step_s, skin, when)
    return shown


def log(
    effects: Sequence[Effect], shown: Floats, step_s: float, times: Floats, when: When
) -> Floats:
    """Return the reading at the times of the samples, after the effects of the log itself.

    Parameters
    ----------
    effects : sequence of Effect
        Those of the acquisition act.
    shown : ndarray, shape (n + 1,)
        What the sensor shows (deg).
    step_s : float
        Step (s).
    times : ndarray, shape (m,)
        Of the samples, from the stretch's start (s).
    when : When
        Place in the campaign.
    """
    clock = step_s * np.arange(shown.size, dtype=np.float64)
    read = np.interp(times, clock, shown)
    for effect in effects:
        if effect.amplitude == 0.0:
            continue
        if effect.id == "channel_latency":
            read = _late(effect, clock, shown, times)
        elif effect.id == "mains_pickup":
            read = read + _pickup(effect, when.started_s + times)
        elif effect.id == "frozen_reading":
            read = _frozen(effect, read, times, when)
        elif effect.id == "baseline_wander":
            phase = 2.0 * np.pi * effect.shape["frequency_hz"] * (when.started_s + times)
            read = read + effect.amplitude * np.sin(phase + effect.shape["phase"])
    return read


def _late(e: Effect, clock: Floats, shown: Floats, times: Floats) -> Floats:
    """Hold readings back in a buffer, or average them over twice the delay."""
    if e.form == "buffer":
        return np.interp(times - e.amplitude, clock, shown)
    window = 2.0 * e.amplitude
    ends = np.concatenate([[-window], clock])  # before the log the angle was what it is at first
    parts = np.concatenate([[0.0, window * shown[0]], shown[1:] * np.diff(clock)])
    area = np.cumsum(parts)
    average: Floats = (
        np.interp(times, ends, area) - np.interp(times - window, ends, area)
    ) / window
    return average


def _pickup(e: Effect, at_s: Floats) -> Floats:
    phase = 2.0 * np.pi * e.shape["frequency_hz"] * at_s + e.shape["phase"]
    third = e.shape.get("third_harmonic", 0.0)
    wave: Floats = e.amplitude * (np.sin(phase) + third * np.sin(3.0 * phase + 1.0))
    return wave


def _frozen(e: Effect, read: Floats, times: Floats, when: When) -> Floats:
    """Hold the last value in some stretches; the amplitude is their length (s)."""
    slots = np.floor((when.started_s + times) / e.shape["every_s"]).astype(np.int64)
    begins = slots * e.shape["every_s"] - when.started_s
    stuck = (e.series[slots % e.series.size] < e.shape["share"]) & (times - begins < e.amplitude)
    held = np.interp(np.maximum(begins, 0.0), times, read)
    return np.where(stuck, held, read)


def _nonlinearity(
    e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When
) -> Floats:
    """Bend the curve: it has aged since the first calibration, and later ones see it bent."""
    if when.order == 0:
        return y
    span, way = e.shape["span_deg"], e.shape["sign"]
    x = y / span
    if e.form == "wave":
        bend = np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
    else:
        bend = 4.0 * x * (1.0 - np.clip(x, -0.5, 1.2))
    return np.asarray(y + way * e.amplitude * span * bend, dtype=np.float64)


def _saturation(
    e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When
) -> Floats:
    """Stop at the amplifier's rail, sunk since the first calibration; later ones meet it too."""
    if when.order == 0:
        return y
    rail, knee = e.shape["top_deg"] * (1.6 - e.amplitude), e.shape.get("knee_deg", 0.0)
    if knee == 0.0:
        return np.minimum(y, rail)
    return np.asarray(y - knee * np.logaddexp(0.0, (y - rail) / knee), dtype=np.float64)


def _lag(e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When) -> Floats:
    poles = 2 if e.form == "two_poles" else 1
    state = skin.states.setdefault(e.id, np.full(poles, y[0]))
    for k in range(poles):
        y = _follow(y, step_s, e.amplitude / poles, state[k : k + 1])
    return y


@njit(cache=True)
def _follow(y: Floats, step_s: float, time_s: float, state: Floats) -> Floats:
    out = np.empty_like(y)
    keep = np.exp(-step_s / time_s)
    out[0] = state[0]
    for n in range(1, y.size):
        state[0] = y[n] + keep * (state[0] - y[n])
        out[n] = state[0]
    return out


def _creep(e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When) -> Floats:
    times = np.geomspace(e.shape["shortest_s"], e.shape["longest_s"], int(e.shape["elements"]))
    state = skin.states.setdefault(e.id, np.zeros(times.size))
    drift = np.zeros_like(y)
    for k in range(times.size):
        drift += _follow(y, step_s, times[k], state[k : k + 1])
    return np.asarray(y + e.amplitude * drift / times.size, dtype=np.float64)


def _hysteresis(
    e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When
) -> Floats:
    state = skin.states.setdefault(e.id, np.array([0.0, y[0]]))
    turned: Floats = _dahl(y, e.shape["turn_deg"], e.form == "stop", state)
    return np.asarray(y + e.amplitude * turned, dtype=np.float64)


@njit(cache=True)
def _dahl(y: Floats, turn: float, hard: bool, state: Floats) -> Floats:
    """Friction in the pocket: -1 to 1, turning over with the direction of bending."""
    out = np.empty_like(y)
    for n in range(y.size):
        dy = y[n] - state[1]
        state[1] = y[n]
        step = dy / turn
        if hard:
            state[0] = min(max(state[0] + step, -1.0), 1.0)
        elif dy > 0.0:
            state[0] = 1.0 + (state[0] - 1.0) * np.exp(-step)
        else:
            state[0] = -1.0 + (state[0] + 1.0) * np.exp(step)
        out[n] = state[0]
    return out


def _slip(e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When) -> Floats:
    return np.asarray(y + e.amplitude * e.series[when.order], dtype=np.float64)


def _detached(
    e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When
) -> Floats:
    """Come partly off at a moment: gain is lost, the zero jumps, for good or until a trial ends."""
    at_s = when.started_s + step_s * np.arange(y.size)
    off = np.clip((at_s - e.shape["at_s"]) / e.shape["peel_s"], 0.0, 1.0)
    off = e.amplitude * np.where(at_s < e.shape.get("until_s", np.inf), off, 0.0)
    return np.asarray(y + off * (e.shape["zero_deg"] - e.shape["gain"] * y), dtype=np.float64)


def _cross_talk(
    e: Effect, y: Floats, pressure: Floats, step_s: float, skin: Skin, when: When
) -> Floats:
    """Pressure squeezes the sensor: its reading takes part of it at once."""
    return np.asarray(y + e.amplitude * pressure, dtype=np.float64)


_SEE: dict[str, See] = {
    "sensor_slip": _slip,
    "sensor_detachment": _detached,
    "sensor_hysteresis": _hysteresis,
    "sensor_creep": _creep,
    "sensor_lag": _lag,
    "pressure_cross_talk": _cross_talk,
    "sensor_nonlinearity": _nonlinearity,
    "sensor_saturation": _saturation,
}
