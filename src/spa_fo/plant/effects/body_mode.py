"""The body swings after a change: a lightly damped mode beside the slow motion.

A part of the load moves the angle through an oscillator. Seen in the logs of a three-chamber arm
(zhiqiao0256/Soft-Arm-SMART-Controller-), whose angle swings at 0.34 to 0.42 Hz while its pressure
is steady.
"""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape
from spa_fo.plant.effects.pressure_set import lengths_of

_CAMERA = Check(
    "record the angle by a second way, such as a camera, beside the sensor",
    "it shows whether the body swings, or the sensor's filter does",
)


def swung(
    pressure_kpa: Floats, time_s: Floats, share: float, frequency_hz: float, damping: float
) -> Floats:
    """Let a share of the pressure pass an oscillator with a static gain of 1."""
    lengths = lengths_of(time_s)
    late = np.asarray(oscillated(pressure_kpa, lengths, 2.0 * math.pi * frequency_hz, damping))
    return pressure_kpa + share * (late - pressure_kpa)


@njit
def oscillated(load: Floats, length_s: Floats, rate: float, damping: float) -> Floats:
    """Mean over each step of an oscillator under a load that is held in each, from rest.

    What lacks of the load is the real part of one number that turns and shrinks.
    """
    out = np.empty_like(load)
    pole = complex(-damping * rate, rate * math.sqrt(1.0 - damping * damping))
    lack, speed, before = 0.0, 0.0, 0.0
    for i in range(load.size):
        lack += load[i] - before
        before = load[i]
        # lack = Re(z), its rate = Re(pole z)
        imag = (pole.real * lack - speed) / pole.imag
        z = complex(lack, imag)
        turned = z * np.exp(pole * length_s[i])
        out[i] = load[i] - ((turned - z) / (pole * length_s[i])).real
        lack, speed = turned.real, (pole * turned).real
    return out


EFFECT = Effect(
    id="body_mode",
    stage="actuator",
    parameters=(
        amplitude(
            "share",
            "1",
            "share of the load that swings",
            spread=0.15,
            high=2.0,
            start=0.1,
        ),
        shape(
            "frequency_hz",
            "Hz",
            "how often it swings",
            centre=0.8,
            factor=2.0,
            low=0.15,
            high=4.0,
            starts=(0.4, 0.8, 1.6),
        ),
        shape(
            "damping",
            "1",
            "how soon it dies away: after 1/(2π) of its inverse in swings",
            centre=0.08,
            factor=2.0,
            low=0.01,
            high=0.7,
        ),
    ),
    name="swing of the body",
    means="the body swings after each change, lightly damped, while the pressure is steady",
    remedy="support or damp the actuator, change the pressure more slowly, or keep it in the model",
    shown_in=("release",),
    equivalents={
        "drive_overshoot": Check(
            "close a valve at the actuator's inlet right after a step",
            "a body goes on swinging, a regulator's overshoot cannot reach it any more",
        ),
        "sensor_lag": _CAMERA,
    },
    act=swung,
    sees_angle=False,
    odds=RARER,
)
