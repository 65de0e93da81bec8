"""The bench: pump, actuator and sensor in a row, with one life over a whole campaign.

Everything between two trials is simulated as well (the actuator rests), so softening, creep,
friction, drift and slip carry over as the physics has it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from spa_fo.virtual_rig.actuator import SoftActuator
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.converter import Acquisition, Counts
from spa_fo.virtual_rig.flex_sensor import FlexSensor
from spa_fo.virtual_rig.syringe_pump import SyringePump, delay

STEPS_PER_SAMPLE = 20
_SETTLING_S = 2.0  # fills the buffers of a fresh bench


@dataclass(frozen=True)
class Scatter:
    """What makes no two trials alike: standard deviations of each trial's own draw.

    Parameters
    ----------
    gain : float
        Relative scatter of the gain.
    offset_deg : float
        Scatter of the rest angle that the sensor feels, deg.
    pace : float
        Relative scatter of the time scale.
    """

    gain: float = 0.0
    offset_deg: float = 0.0
    pace: float = 0.0


@dataclass(frozen=True)
class Specimen:
    """One actuator on the bench, complete: what the diagnosis has to find out."""

    pump: SyringePump
    actuator: SoftActuator
    sensor: FlexSensor = field(default_factory=FlexSensor)
    acquisition: Acquisition = field(default_factory=Acquisition)
    scatter: Scatter = field(default_factory=Scatter)


class Bench:
    """A specimen with its memory, run from the first calibration to the last.

    Parameters
    ----------
    specimen : Specimen
        What is mounted.
    rate_hz : float
        Sampling rate of the board.
    starts_s : float
        Campaign time now, s.
    """

    def __init__(self, specimen: Specimen, rate_hz: float, starts_s: float) -> None:
        self._specimen = specimen
        self._rate_hz = rate_hz
        self.now_s = starts_s
        step_s = 1.0 / (rate_hz * STEPS_PER_SAMPLE)
        latency = specimen.acquisition.channel_latency
        self._pump = specimen.pump.begin(step_s)
        self._actuator = specimen.actuator.begin(step_s, starts_s)
        self._sensor = specimen.sensor.begin(step_s)
        self._flex_delay = delay(0 if latency is None else round(latency.delay_s / step_s))
        self._pressure_kpa = self._flex_volts = 0.0
        self.now_s = starts_s - _SETTLING_S
        self.rest(starts_s)

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Draw this trial's own gain, rest offset, pace and slip."""
        scatter = self._specimen.scatter
        gain, offset, pace, shift = rng.standard_normal(4)
        self._actuator.retune(1.0 + scatter.gain * gain, 1.0 + scatter.pace * pace)
        self._sensor.seat(scatter.offset_deg * offset, shift)

    def drive(self, command_kpa: Array, rng: np.random.Generator) -> tuple[Array, Counts, Counts]:
        """Run one sample period for each command.

        Parameters
        ----------
        command_kpa : ndarray (n,)
            Command of each sample, held until the next.
        rng : numpy.random.Generator
            Converter noise.

        Returns
        -------
        time_s : ndarray (n,)
            Campaign time of each sample.
        pressure_counts, flex_counts : ndarray (n,)
            What the board reads at each sample, before its command takes effect.
        """
        pressure = self._pump(np.repeat(command_kpa, STEPS_PER_SAMPLE))
        angle = self._actuator(pressure)
        volts = self._flex_delay(self._sensor(angle))
        return self._read(pressure, volts, rng)

    def rest(self, until_s: float) -> None:
        """Let the vented actuator lie until campaign time `until_s`."""
        samples = round((until_s - self.now_s) * self._rate_hz)
        if samples > 0:
            self.drive(np.zeros(samples), np.random.default_rng(0))
        self.now_s = until_s

    def hold_in_fixture(self, angle_deg: Array, rng: np.random.Generator) -> tuple[Array, Counts]:
        """Bend the sensor in the calibration fixture, one angle a sample; the actuator rests.

        Returns
        -------
        time_s : ndarray (n,)
            Campaign time of each sample.
        flex_counts : ndarray (n,)
            What the board reads.
        """
        pressure = self._pump(np.zeros(angle_deg.size * STEPS_PER_SAMPLE))
        self._actuator(pressure)
        volts = self._flex_delay(self._sensor.in_fixture(np.repeat(angle_deg, STEPS_PER_SAMPLE)))
        time, _, flex = self._read(pressure, volts, rng)
        return time, flex

    def _read(
        self, pressure_kpa: Array, flex_volts: Array, rng: np.random.Generator
    ) -> tuple[Array, Counts, Counts]:
        """Convert the values at the start of each sample period."""
        samples = pressure_kpa.size // STEPS_PER_SAMPLE
        acquisition = self._specimen.acquisition
        time = self.now_s + np.arange(samples) / self._rate_hz
        pressure = np.append(
            self._pressure_kpa, pressure_kpa[STEPS_PER_SAMPLE - 1 :: STEPS_PER_SAMPLE]
        )
        flex = np.append(self._flex_volts, flex_volts[STEPS_PER_SAMPLE - 1 :: STEPS_PER_SAMPLE])
        self._pressure_kpa, self._flex_volts = pressure[-1], flex[-1]
        pressure, flex = pressure[:-1], flex[:-1]
        self.now_s += samples / self._rate_hz
        if acquisition.mains_pickup is not None:
            per_count = acquisition.converter.reference_volt / acquisition.converter.maximum
            flex = flex + per_count * acquisition.mains_pickup.counts(time)
        return (
            time,
            acquisition.converter.counts(acquisition.pressure_sensor.volts(pressure), rng),
            acquisition.converter.counts(flex, rng),
        )
