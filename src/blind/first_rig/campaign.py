"""Campaigns of a case: their trials run on one bench, and the files of their folders."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from blind.first_rig.asked import Asked
from blind.first_rig.channel import Channel
from blind.first_rig.logs import LogFormat, Samples, SpaRigFormat
from blind.first_rig.noise import reading_noise, white
from blind.first_rig.programme import Programme
from blind.first_rig.station import Exact, Fixture, Station, TrialDraws, draw_fixture
from spa_fo.virtual_rig.actuators import REFERENCE_KPA, Experiment
from spa_fo.virtual_rig.bench import Specimen

_CALIBRATION_S = 120.0  # before the first trial, or after the last one
_REST_S = (35.0, 60.0)


@dataclass(frozen=True)
class PlannedTrial:
    """A trial with its place in the campaign."""

    experiment: Experiment
    number: int
    order: int
    started_s: float

    @property
    def name(self) -> str:
        """What it is called; its log without the ending."""
        return f"{self.experiment.name}/trial_{self.number:02d}"

    @property
    def ends_s(self) -> float:
        """When it ends."""
        return self.started_s + self.experiment.profile.duration_s


@dataclass(frozen=True)
class Plan:
    """A campaign before it is run.

    Parameters
    ----------
    asked : Asked
        Seed and surroundings.
    folder : str
        Which of the case's campaigns it is; its random streams bear this name.
    programme : Programme
        What is tried.
    continues : str or None
        The campaign that it goes on from.
    first_order : int
        Place of its first trial, counted from the first of the campaign it continues.
    first_s : float
        When that starts.
    """

    asked: Asked
    folder: str
    programme: Programme
    continues: str | None = None
    first_order: int = 1
    first_s: float = 0.0

    @property
    def name(self) -> str:
        """What campaign.yaml calls it."""
        name = self.asked.name
        return name if self.folder == "campaign" else f"{name}_{self.folder}"

    def draws(self, trial: PlannedTrial) -> TrialDraws:
        """Open the random streams of a trial that its noise-free run needs."""
        name = f"{self.folder}/{trial.name}"
        return TrialDraws(
            self.asked.stream(f"{name} scatter"), self.asked.stream(f"{name} sample times")
        )

    def fixture(self, calibration: str) -> Fixture:
        """Draw the fixture of one of its calibrations, ``pre`` or ``post``."""
        around = self.asked.surroundings
        rng = self.asked.stream(f"{self.folder}/{calibration} fixture")
        return draw_fixture(around.calibration, around.fixture_error_deg, rng)

    def schedule(self) -> list[PlannedTrial]:
        """List its trials in the order they are run, with the rests between."""
        rng = self.asked.stream(f"{self.folder} rests")
        rest_s = self.asked.stream("rest").uniform(*_REST_S)
        by_name = {experiment.name: experiment for experiment in self.programme.experiments}
        seen: Counter[str] = Counter()
        trials, started_s = [], self.first_s
        for order, name in enumerate(self.programme.order, start=self.first_order):
            seen[name] += 1
            trials.append(PlannedTrial(by_name[name], seen[name], order, started_s))
            started_s = round(trials[-1].ends_s + rest_s * rng.uniform(1.0, 4.0 / 3.0), 1)
        return trials

    @property
    def pre_calibration_s(self) -> float:
        """When the sensor is calibrated first, or would be."""
        return -round(self.fixture("pre").duration_s + _CALIBRATION_S, 1)

    def post_calibration_s(self) -> float | None:
        """When the sensor is calibrated again; None if it is not."""
        kind = self.asked.surroundings.calibration.kind
        if kind != "before_and_after" or self.continues is not None:
            return None
        return round(self.schedule()[-1].ends_s + _CALIBRATION_S, 1)

    def free_s(self) -> float:
        """When everything of it is over."""
        post_s = self.post_calibration_s()
        if post_s is None:
            return self.schedule()[-1].ends_s
        return post_s + self.fixture("post").duration_s


class Recorder:
    """Runs a campaign, and what continues it, on one bench that is calibrated at the start.

    Parameters
    ----------
    first : Plan
        The campaign.
    specimen : Specimen
        What is mounted.
    board, trials : SpaRigFormat, LogFormat
        How calibrations and trials are written.
    """

    def __init__(
        self, first: Plan, specimen: Specimen, board: SpaRigFormat, trials: LogFormat
    ) -> None:
        self._asked = asked = first.asked
        self._first = first
        self._board = board
        self._trials = trials
        direct = asked.surroundings.calibration.kind == "none"
        self._channel = Channel(specimen.sensor.curve, board.converter, direct)
        self._station = Station(specimen, first.pre_calibration_s, trials.pressure_lag_s)
        self._pre = None if direct else self._calibrate(first, "pre", first.pre_calibration_s)

    def run(self, plan: Plan) -> dict[str, bytes]:
        """Run one of them: every file of its folder by its relative name."""
        files = {} if self._pre is None else {"calibration/pre.log": self._pre}
        for trial in plan.schedule():
            files[f"{trial.name}.{self._trials.suffix}"] = self._record(plan, trial)
        post_s = plan.post_calibration_s()
        if post_s is not None:
            files["calibration/post.log"] = self._calibrate(plan, "post", post_s)
        document = {**self._head(plan), **self._trials.describe(), **self._tail(plan, files)}
        files["campaign.yaml"] = yaml.safe_dump(document, sort_keys=False).encode("ascii")
        files["SHA256SUMS"] = _checksums(files)
        return files

    def _record(self, plan: Plan, trial: PlannedTrial) -> bytes:
        around = self._asked.surroundings
        exact = self._station.run_trial(
            trial.started_s, trial.experiment.profile, around.sampling, plan.draws(trial)
        )
        rng = self._asked.stream(f"{plan.folder}/{trial.name} noise")
        noise = reading_noise(around.noise, exact.time_s, rng)
        reading = self._channel.logged(exact.volts, noise, exact.reader)
        pressure = exact.pressure_kpa if around.pressure.measured else None
        samples = Samples(trial.started_s, exact.time_s, exact.command_kpa, pressure, reading)
        return self._trials.trial(samples, self._asked.stream(f"{plan.folder}/{trial.name} wire"))

    def _calibrate(self, plan: Plan, which: str, started_s: float) -> bytes:
        around, name = self._asked.surroundings, f"{plan.folder}/{which}"
        exact = run_fixture(plan, self._station, which, started_s)
        rng = self._asked.stream(f"{name} noise")
        reading = self._channel.logged(exact.volts, white(around.noise, exact.volts.size, rng))
        samples = Samples(started_s, exact.time_s, exact.command_kpa, None, reading)
        return self._board.calibration(samples, self._asked.stream(f"{name} wire"))

    def _head(self, plan: Plan) -> dict[str, Any]:
        continues = {} if plan.continues is None else {"continues": plan.continues}
        provenance = {"kind": "synthetic", "source": "blind benchmark"}
        return {
            "schema": "spa-fo/campaign/1",
            "name": plan.name,
            "material": "case",
            **continues,
            "provenance": provenance,
            "input": {"reference_kpa": REFERENCE_KPA},
        }

    def _tail(self, plan: Plan, files: Mapping[str, bytes]) -> dict[str, Any]:
        started_s = {"pre": self._first.pre_calibration_s, "post": plan.post_calibration_s()}
        calibration = [
            {"file": name, "started_s": started}
            for which, started in started_s.items()
            if (name := f"calibration/{which}.log") in files
        ]
        trials = plan.schedule()
        experiments = [
            {
                "name": experiment.name,
                "setpoint_deg": experiment.setpoint_deg,
                "protocol": experiment.profile.protocol,
                "trials": list(self._entries(trials, experiment)),
            }
            for experiment in plan.programme.experiments
        ]
        return {**({"calibration": calibration} if calibration else {}), "experiments": experiments}

    def _entries(
        self, trials: list[PlannedTrial], experiment: Experiment
    ) -> Iterator[dict[str, Any]]:
        for trial in trials:
            if trial.experiment is experiment:
                file = f"{trial.name}.{self._trials.suffix}"
                yield {"file": file, "order": trial.order, "started_s": trial.started_s}


def run_fixture(plan: Plan, station: Station, which: str, started_s: float) -> Exact:
    """Run a calibration of a campaign without noise, its dwells' errors as drawn."""
    times = plan.asked.stream(f"{plan.folder}/{which} sample times")
    sampling = plan.asked.surroundings.sampling
    return station.run_fixture(started_s, plan.fixture(which), sampling, times)


def _checksums(files: Mapping[str, bytes]) -> bytes:
    lines = [f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files)]
    return "".join(lines).encode("ascii")
