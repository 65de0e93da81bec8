"""A specimen on the bench, sampled at any instants: what stands at the board's inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind.first_rig.asked import Calibration, Sampling
from blind.first_rig.reading_effects import Moments, Reader, reader_of
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.bench import Bench, Specimen
from spa_fo.virtual_rig.protocols import Profile
from spa_fo.virtual_rig.syringe_pump import LowPass

STEPS_PER_SECOND = 500.0  # a step of 60° is then within 0.015° RMS of the core's own response

_MOVE_S = 2.0  # from one dwell of the fixture to the next
_LATEST = 0.45  # a sample's largest error of time, as a share of the period


def sample_times(sampling: Sampling, count: int, rng: np.random.Generator) -> Array:
    """Draw when `count` samples are taken, s from the first."""
    late = np.clip(sampling.jitter * rng.standard_normal(count), -_LATEST, _LATEST)
    late[:1] = 0.0
    return np.asarray((np.arange(count) + late) / sampling.rate_hz)


@dataclass(frozen=True)
class Fixture:
    """One calibration: where the log says that the fixture stands, and where it does.

    Parameters
    ----------
    said_deg, true_deg : ndarray (d,)
        Of each dwell.
    dwell_s : float
        Length of each.
    """

    said_deg: Array
    true_deg: Array
    dwell_s: float

    @property
    def duration_s(self) -> float:
        """From the first move to the end of the last dwell."""
        return self.said_deg.size * (_MOVE_S + self.dwell_s)

    @property
    def starts_s(self) -> Array:
        """When each dwell starts."""
        return np.asarray(np.arange(self.said_deg.size) * (_MOVE_S + self.dwell_s) + _MOVE_S)

    def angle_deg(self, time_s: Array) -> Array:
        """Where it stands at times from the first move, which starts where the first dwell is."""
        corners = np.stack([self.starts_s - _MOVE_S, self.starts_s], axis=1).ravel()
        before = np.concatenate([self.true_deg[:1], self.true_deg[:-1]])
        stands = np.stack([before, self.true_deg], axis=1).ravel()
        return np.asarray(np.interp(time_s, corners, stands))


def draw_fixture(calibration: Calibration, error_deg: float, rng: np.random.Generator) -> Fixture:
    """Draw a calibration's errors; up and, in two directions, down again."""
    up = np.round(np.linspace(0.0, 90.0, calibration.angles), 2)
    said = np.concatenate([up, up[-2::-1]]) if calibration.directions == 2 else up
    return Fixture(said, said + error_deg * rng.standard_normal(said.size), calibration.dwell_s)


@dataclass(frozen=True)
class Exact:
    """What stands at the board's inputs at each sample, before the sample's command takes effect.

    Parameters
    ----------
    time_s : ndarray (n,)
        From the trial's start.
    command_kpa, pressure_kpa, volts : ndarray (n,)
        Command, output of the pressure sensor, voltage of the flex channel.
    reader : Reader or None
        What the reading makes of it, where it makes anything of it.
    """

    time_s: Array
    command_kpa: Array
    pressure_kpa: Array
    volts: Array
    reader: Reader | None = None


class Station:
    """A bench that runs finely and is sampled at any instants, without noise.

    Parameters
    ----------
    specimen : Specimen
        What is mounted.
    starts_s : float
        Campaign time now, s.
    pressure_lag_s : float
        Time constant of the pressure sensor.
    """

    def __init__(self, specimen: Specimen, starts_s: float, pressure_lag_s: float = 0.0) -> None:
        # What the wire picks up is too fast to be interpolated: it is added at the samples.
        self._pickup = specimen.acquisition.mains_pickup
        self._specimen = specimen
        self._trials = 0
        bare = specimen.with_effect("mains_pickup", None)
        self._bench = Bench(bare, STEPS_PER_SECOND, starts_s, STEPS_PER_SECOND)
        self._pressure_lag = LowPass(pressure_lag_s) if pressure_lag_s > 0.0 else None

    def run_trial(
        self, started_s: float, profile: Profile, sampling: Sampling, draws: TrialDraws
    ) -> Exact:
        """Rest until a trial starts, and run it."""
        self._bench.rest(started_s)
        self._bench.begin_trial(draws.scatter)
        command = profile.sampled(sampling.rate_hz)
        time = sample_times(sampling, command.size, draws.times)
        end_s = command.size / sampling.rate_hz
        fine = held(command, time, self._grid(end_s))
        _, pressure, volts = self._bench.drive_exactly(fine)
        if self._pressure_lag is not None:
            pressure = self._pressure_lag.begin(1.0 / STEPS_PER_SECOND)(pressure)
        self._trials += 1
        reader = reader_of(self._specimen, Moments(self._trials, time, end_s))
        at_samples = self._at(time, pressure), self._volts(started_s, time, volts)
        return Exact(time, command, *at_samples, reader)

    def run_fixture(
        self, started_s: float, fixture: Fixture, sampling: Sampling, rng: np.random.Generator
    ) -> Exact:
        """Rest until a calibration starts, and run it; the samples of its dwells alone.

        Its command is where the log says that the fixture stands.
        """
        self._bench.rest(started_s)
        grid = self._grid(fixture.duration_s)[:-1]
        _, pressure, volts = self._bench.hold_exactly(fixture.angle_deg(grid))
        count = round(fixture.dwell_s * sampling.rate_hz)
        time = np.concatenate(
            [start + sample_times(sampling, count, rng) for start in fixture.starts_s.tolist()]
        )
        said = np.repeat(fixture.said_deg, count)
        return Exact(time, said, self._at(time, pressure), self._volts(started_s, time, volts))

    def _grid(self, duration_s: float) -> Array:
        """List where the simulation's steps begin, and the last one's end."""
        return np.arange(np.ceil(duration_s * STEPS_PER_SECOND) + 1) / STEPS_PER_SECOND

    def _at(self, time_s: Array, signal: Array) -> Array:
        return np.asarray(np.interp(time_s * STEPS_PER_SECOND, np.arange(signal.size), signal))

    def _volts(self, started_s: float, time_s: Array, volts: Array) -> Array:
        at_samples = self._at(time_s, volts)
        if self._pickup is None:
            return at_samples
        return at_samples + self._pickup.volts(started_s + time_s)


@dataclass(frozen=True)
class TrialDraws:
    """Random streams of one trial: what is scattered, and when it is sampled."""

    scatter: np.random.Generator
    times: np.random.Generator


def held(command: Array, time_s: Array, grid_s: Array) -> Array:
    """Mean command of each step of a grid, each command held from its sample until the next."""
    end_s = max(grid_s[-1], time_s[-1])
    pushed = np.cumsum(command * np.diff(time_s, append=end_s))
    area = np.interp(grid_s, np.append(time_s, end_s), np.append(0.0, pushed))
    # Rounded, as the command is: the sums leave it a hair beside the level.
    return np.asarray(np.round(np.diff(area) / np.diff(grid_s), 9))
