"""The bench: pump, actuator and sensor in a row, with one life over a whole campaign.

Everything between two trials is simulated as well (the actuator rests), so softening, creep,
friction, drift and slip carry over as the physics has it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from spa_fo.virtual_rig.actuator import SoftActuator
from spa_fo.virtual_rig.arrays import Array, chain
from spa_fo.virtual_rig.converter import Acquisition, Counts
from spa_fo.virtual_rig.flex_sensor import FlexSensor
from spa_fo.virtual_rig.syringe_pump import SyringePump

_STEPS_PER_SECOND = 1000
_SETTLING_S = 2.0  # fills the buffers of a fresh bench
_STAGES = ("pump", "actuator", "sensor", "acquisition")


@dataclass(frozen=True)
class Scatter:
    """What makes no two trials alike: standard deviations of each trial's own draw.

    Parameters
    ----------
    gain : float
        Relative scatter of the gain.
    offset_deg : float
        Scatter of the rest angle that the sensor feels, deg.
    rate : float
        Relative scatter of the time scale.
    """

    gain: float = 0.0
    offset_deg: float = 0.0
    rate: float = 0.0


@dataclass(frozen=True)
class Specimen:
    """One actuator on the bench, complete: what a diagnosis has to find out.

    A stage's field that is None by default is an effect that is absent; its name is the effect's
    identifier.
    """

    pump: SyringePump
    actuator: SoftActuator
    sensor: FlexSensor = field(default_factory=FlexSensor)
    acquisition: Acquisition = field(default_factory=Acquisition)
    scatter: Scatter = field(default_factory=Scatter)

    def effects(self) -> dict[str, Any]:
        """List every effect the rig knows by its identifier: its object, or None where absent."""
        stages = [getattr(self, stage) for stage in _STAGES]
        return {name: getattr(stage, name) for stage in stages for name in _effects_of(stage)}

    def with_effect(self, name: str, effect: object) -> Specimen:
        """Give the same specimen with one effect set, or taken away (None).

        Raises
        ------
        KeyError
            The rig knows no effect of this name.
        """
        for stage_name in _STAGES:
            stage = getattr(self, stage_name)
            if name in _effects_of(stage):
                changed: dict[str, Any] = {stage_name: replace(stage, **{name: effect})}
                return replace(self, **changed)
        raise KeyError(name)


def _effects_of(stage: Any) -> list[str]:
    return [entry.name for entry in fields(stage) if entry.default is None]


class Bench:
    """A specimen with its memory, run from the first calibration to the last.

    Stretches may be of any length, down to one sample: what a live board needs.

    Parameters
    ----------
    specimen : Specimen
        What is mounted.
    rate_hz : float
        Sampling rate of the board.
    starts_s : float
        Campaign time now, s.
    steps_per_second : float
        Simulation steps, about; each sample has a whole number of them.
    """

    def __init__(
        self,
        specimen: Specimen,
        rate_hz: float,
        starts_s: float,
        steps_per_second: float = _STEPS_PER_SECOND,
    ) -> None:
        self._specimen = specimen
        self._rate_hz = rate_hz
        self._steps = max(1, round(steps_per_second / rate_hz))
        step_s = 1.0 / (rate_hz * self._steps)
        latency = specimen.acquisition.channel_latency
        self._pump = specimen.pump.begin(step_s)
        self.now_s = starts_s - _SETTLING_S
        self._actuator = specimen.actuator.begin(step_s, self.now_s)
        self._sensor = specimen.sensor.begin(step_s)
        self._flex_filter = chain([] if latency is None else [latency.begin(step_s)])
        self._couplings = [it.begin(step_s) for it in specimen.acquisition.couplings]
        self._pressure_kpa = self._flex_volts = 0.0
        self.rest(starts_s)

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Draw this trial's own gain, rest offset, rate factor and slip."""
        scatter = self._specimen.scatter
        gain, offset, rate, shift = rng.standard_normal(4)
        self._actuator.retune(1.0 + scatter.gain * gain, 1.0 + scatter.rate * rate)
        self._sensor.mount(scatter.offset_deg * offset, shift)

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
        return self._read(*self.drive_exactly(command_kpa), rng)

    def drive_exactly(self, command_kpa: Array) -> tuple[Array, Array, Array]:
        """Run one sample period for each command; nothing is converted.

        Returns
        -------
        time_s, pressure_kpa, flex_volts : ndarray (n,)
            Campaign time, true pressure and what stands at the flex channel at each sample.
        """
        return self._picked_up(*self._run(command_kpa, None))

    def rest(self, until_s: float) -> None:
        """Let the vented actuator lie until campaign time `until_s`."""
        samples = round((until_s - self.now_s) * self._rate_hz)
        if samples > 0:
            self._run(np.zeros(samples), None)
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
        time, _, flex = self._read(*self.hold_exactly(angle_deg), rng)
        return time, flex

    def hold_exactly(self, angle_deg: Array) -> tuple[Array, Array, Array]:
        """Bend the sensor in the fixture as `hold_in_fixture`, return as `drive_exactly`."""
        return self._picked_up(*self._run(np.zeros(angle_deg.size), angle_deg))

    def _run(self, command_kpa: Array, fixture_deg: Array | None) -> tuple[Array, Array, Array]:
        """Advance the physics; campaign time, true pressure and flex voltage at each sample."""
        command = np.repeat(command_kpa, self._steps)
        pressure = self._pump(command)
        angle = self._actuator(pressure)
        if fixture_deg is None:
            volts = self._sensor(angle)
        else:
            volts = self._sensor.in_fixture(np.repeat(fixture_deg, self._steps))
        volts = self._flex_filter(volts)
        for coupling in self._couplings:
            volts = volts + coupling(command, pressure)
        # The board samples at the start of a period: what the last one ended with.
        ends = slice(self._steps - 1, None, self._steps)
        pressure = np.append(self._pressure_kpa, pressure[ends])
        volts = np.append(self._flex_volts, volts[ends])
        self._pressure_kpa, self._flex_volts = pressure[-1], volts[-1]
        time = self.now_s + np.arange(command_kpa.size) / self._rate_hz
        self.now_s += command_kpa.size / self._rate_hz
        return time, pressure[:-1], volts[:-1]

    def _picked_up(
        self, time_s: Array, pressure_kpa: Array, flex_volts: Array
    ) -> tuple[Array, Array, Array]:
        """Add what the flex channel's wire picks up."""
        pickup = self._specimen.acquisition.mains_pickup
        if pickup is not None:
            flex_volts = flex_volts + pickup.volts(time_s)
        return time_s, pressure_kpa, flex_volts

    def _read(
        self, time_s: Array, pressure_kpa: Array, flex_volts: Array, rng: np.random.Generator
    ) -> tuple[Array, Counts, Counts]:
        """Convert what the sensors say to counts."""
        acquisition = self._specimen.acquisition
        converter = acquisition.converter
        pressure_volts = acquisition.pressure_sensor.volts(pressure_kpa)
        return time_s, converter.counts(pressure_volts, rng), converter.counts(flex_volts, rng)
