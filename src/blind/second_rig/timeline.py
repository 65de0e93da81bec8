"""A specimen on its bench from one trial to the next: rests and trials on one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from blind.second_rig.actuator import specimen
from blind.second_rig.bank import Core
from blind.second_rig.drive import Line, transmit
from blind.second_rig.effect import Effect, Scene
from blind.second_rig.sensor import Skin, When, log, see

Floats = npt.NDArray[np.float64]

STEP_S = 0.002  # while a log is taken
_REST_STEP_S = 0.04
_SETTLE_S = 240.0  # before the first trial: a hanging body sags


@dataclass(frozen=True)
class Trial:
    """One trial as it happens.

    Attributes
    ----------
    experiment, number : int
        Place of its experiment in the campaign, and its own place there, from 0.
    started_s : float
        Campaign time.
    times : ndarray, shape (n,)
        When each sample is taken, from the start (s).
    command : ndarray, shape (n,)
        What is commanded from each sample until the next (kPa).
    gain, rate_factor : float
        This trial's own factors on gain and rate.
    rest_deg : float
        This trial's own rest angle.
    """

    experiment: int
    number: int
    started_s: float
    times: Floats
    command: Floats
    gain: float = 1.0
    rate_factor: float = 1.0
    rest_deg: float = 0.0

    @property
    def length_s(self) -> float:
        """From the start to the last sample."""
        return float(self.times[-1])


@dataclass(frozen=True)
class Reading:
    """What the channels show at a trial's samples before noise and converter."""

    angle: Floats  # deg
    pressure: Floats  # kPa


def play(
    core: Core,
    effects: Sequence[Effect],
    trials: Sequence[Trial],
    scene: Scene,
    lag_s: float = 0.0,
) -> list[Reading]:
    """Run a fresh specimen through trials in their order.

    Parameters
    ----------
    core : Core
        Plain physics.
    effects : sequence of Effect
        What is added to it.
    trials : sequence of Trial
        In the order they happen.
    scene : Scene
        Scales.
    lag_s : float
        Time constant of the pressure sensor.
    """
    actuator, line, skin = specimen(core, effects, scene), Line(), Skin()
    reference = scene.top_kpa / scene.top_input
    clock_s = trials[0].started_s - _SETTLE_S
    readings = []

    def stretch(
        command: Floats, step_s: float, start_s: float, trial: Trial, order: int
    ) -> tuple[Floats, Floats]:
        pressure = transmit(effects, command, step_s, line, start_s)
        angle = actuator.bend(pressure / reference, step_s, start_s, trial.gain, trial.rate_factor)
        true = np.rad2deg(angle) + trial.rest_deg
        felt = np.concatenate([pressure[:1], pressure]) / scene.top_kpa
        return see(effects, true, felt, step_s, skin, When(start_s, order)), pressure

    for order, trial in enumerate(trials, start=1):
        rest_s = trial.started_s - clock_s
        count = max(1, int(np.ceil(rest_s / _REST_STEP_S)))
        stretch(np.zeros(count), rest_s / count, clock_s, trial, order)
        command = _held(trial.times, trial.command)
        shown, pressure = stretch(command, STEP_S, trial.started_s, trial, order)
        angle = log(effects, shown, STEP_S, trial.times, When(trial.started_s, order))
        readings.append(Reading(angle, _sensed(pressure, trial.times, lag_s)))
        clock_s = trial.started_s + command.size * STEP_S
    return readings


def _held(times: Floats, command: Floats) -> Floats:
    """Return the mean of a command, held between samples, over each step of the clock."""
    count = int(np.ceil(times[-1] / STEP_S)) + 1
    clock = STEP_S * np.arange(count + 1)
    ends = np.concatenate([[0.0], times, [clock[-1] + 1.0]])
    levels = np.concatenate([[0.0], command])
    area = np.concatenate([[0.0], np.cumsum(levels * np.diff(ends))])
    mean: Floats = np.diff(np.interp(clock, ends, area)) / STEP_S
    return mean


def _sensed(pressure: Floats, times: Floats, lag_s: float) -> Floats:
    """Return what the pressure sensor shows at the samples: read as the command goes out."""
    shown: Floats = _low_pass(pressure, float(np.exp(-STEP_S / lag_s)) if lag_s > 0.0 else 0.0)
    sensed: Floats = shown[np.floor(times / STEP_S + 1e-6).astype(np.int64)]
    return sensed


@njit(cache=True)
def _low_pass(pressure: Floats, keep: float) -> Floats:
    out = np.empty(pressure.size + 1)
    out[0] = pressure[0]
    for n in range(pressure.size):
        out[n + 1] = pressure[n] + keep * (out[n] - pressure[n])
    return out
