"""A campaign: one actuator, one series of measurements, described by campaign.yaml."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.places import campaign_folder
from spa_fo.rig import checksums
from spa_fo.rig.log_format import ANGLES, NO_UNIT, LogFormat, log_format
from spa_fo.validation import load_yaml, package_schema, validate

Protocol = Literal["step", "step_release", "staircase", "triangle", "hold", "free"]


@dataclass(frozen=True)
class Provenance:
    """Where the data come from: ``kind`` is ``measured`` or ``synthetic``."""

    kind: Literal["measured", "synthetic"]
    source: str = ""
    note: str = ""


@dataclass(frozen=True)
class PressureSensor:
    """A ratiometric sensor: ADC counts to volts to gauge pressure, linear."""

    volts: tuple[float, float]
    kpa: tuple[float, float]
    vref_mv: float
    adc_max: int

    def pressure_kpa(self, counts: npt.ArrayLike) -> Floats:
        """Return the gauge pressure (kPa) of ADC `counts`, same shape."""
        volts = np.asarray(counts, dtype=np.float64) * (self.vref_mv / 1000.0 / self.adc_max)
        slope = (self.kpa[1] - self.kpa[0]) / (self.volts[1] - self.volts[0])
        return self.kpa[0] + slope * (volts - self.volts[0])


@dataclass(frozen=True)
class CalibrationFile:
    """A log of the flex sensor against known angles; `started_s` is campaign time (s)."""

    file: str
    path: Path
    started_s: float


@dataclass(frozen=True)
class TrialFile:
    """One trial's log.

    `order` is its place in the campaign, `started_s` campaign time (s), `number` its 1-based place
    in the experiment's list, which stays its own where other trials are left out.
    """

    file: str
    path: Path
    order: int
    started_s: float
    number: int


@dataclass(frozen=True)
class Experiment:
    """Trials of one protocol; `setpoint_deg` is None where there is none."""

    name: str
    setpoint_deg: float | None
    protocol: Protocol
    trials: tuple[TrialFile, ...]


@dataclass(frozen=True)
class Campaign:
    """Everything campaign.yaml says, checked against the files."""

    folder: Path
    name: str
    material: str
    provenance: Provenance
    log: LogFormat
    reference_kpa: float
    experiments: tuple[Experiment, ...]
    calibration: tuple[CalibrationFile, ...] = ()  # earliest first
    pressure_sensor: PressureSensor | None = None
    continues: str | None = None
    warnings: tuple[str, ...] = ()

    @property
    def has_angle(self) -> bool:
        """Whether its logs say how far the actuator bends."""
        return self.log.columns is None or bool(ANGLES & self.log.columns.keys())

    @property
    def output(self) -> str:
        """Which column of its logs, if it has columns, the angle comes from."""
        has_flex = "flex_adc" in (self.log.columns or {})
        return "flex_adc" if has_flex and self.calibration else "angle"

    @property
    def logs_are_zeroed(self) -> bool:
        """Whether each log's zero is its own mean before its input changes, not the sensor's."""
        column = (self.log.columns or {}).get(self.output)
        return column is not None and column.rest == "zero"

    @property
    def command_is_pressure(self) -> bool:
        """Whether the command stands for a pressure.

        It does not where its unit is 1, as of a PWM, a duty or volts, and a pressure was measured
        beside it.
        """
        command, pressure = ((self.log.columns or {}).get(n) for n in ("command", "pressure"))
        if command is None or pressure is None:
            return True
        return command.unit != NO_UNIT or pressure.unit == NO_UNIT

    @property
    def yaml(self) -> Path:
        """The file all this was read from."""
        return self.folder / "campaign.yaml"

    def trial_files(self) -> Iterator[tuple[Experiment, int, TrialFile]]:
        """Yield (experiment, 1-based place in its list, file) in the order of campaign.yaml."""
        for experiment in self.experiments:
            for trial in experiment.trials:
                yield experiment, trial.number, trial


def read_campaign(folder: Path | str, angle: bool = True) -> Campaign:
    """Read and check a campaign folder; the logs themselves are read by `read_trials`.

    Parameters
    ----------
    folder : Path or str
        Holds campaign.yaml, SHA256SUMS and the logs they name.
    angle : bool
        Whether its logs have to hold an angle.

    Returns
    -------
    Campaign
        Its calibrations sorted by `started_s`, its trials as listed. A trial whose log holds no
        byte is left out, as is a calibration after the earliest, and a warning says so.

    Raises
    ------
    BadInput
        campaign.yaml does not hold to its schema or contradicts itself (a file or order twice,
        an experiment without trials, time running against order), a file is missing, all trials
        or the earliest calibration are empty, or bytes are not those of SHA256SUMS.
    """
    campaign = read_description(folder, angle)
    _check_sense(campaign)
    return _without_empty(replace(campaign, warnings=_check_files(campaign)))


def read_description(folder: Path | str, angle: bool = True) -> Campaign:
    """Read campaign.yaml alone; nothing is checked against the files.

    Parameters
    ----------
    folder : Path or str
        Holds campaign.yaml.
    angle : bool
        Whether its logs have to hold an angle.

    Raises
    ------
    BadInput
        campaign.yaml is missing, or does not hold to its schema.
    """
    folder = Path(folder)
    path = campaign_folder(folder)
    document = load_yaml(path)
    validate(document, package_schema("spa_fo.rig", "campaign.schema.yaml"), path)
    return build_campaign(document, folder, angle)


def _without_empty(campaign: Campaign) -> Campaign:
    """Leave out what recordings that failed left behind: logs without a single byte."""
    trials = [trial for _, _, trial in campaign.trial_files() if _is_empty(trial.path)]
    later = [item for item in campaign.calibration[1:] if _is_empty(item.path)]
    if campaign.calibration and _is_empty(campaign.calibration[0].path):
        raise BadInput(
            campaign.calibration[0].path,
            "is empty; expected a log: every angle comes through the earliest calibration",
        )
    experiments = tuple(
        replace(experiment, trials=tuple(item for item in experiment.trials if item not in trials))
        for experiment in campaign.experiments
    )
    left = tuple(experiment for experiment in experiments if experiment.trials)
    if not left:
        raise BadInput(trials[0].path, "is empty, as are all trials; expected a log")
    files = [item.file for item in later] + [trial.file for trial in trials]
    return replace(
        campaign,
        experiments=left,
        calibration=tuple(item for item in campaign.calibration if item not in later),
        warnings=(*campaign.warnings, *(f"{file} is empty: left out" for file in files)),
    )


def _is_empty(path: Path) -> bool:
    return path.stat().st_size == 0


def build_campaign(document: Mapping[str, Any], folder: Path, angle: bool = True) -> Campaign:
    """Build a campaign from a valid campaign.yaml; nothing is checked against the files."""
    calibration = [
        CalibrationFile(_plain(item["file"]), folder / item["file"], float(item["started_s"]))
        for item in document.get("calibration", [])
    ]
    experiments = tuple(
        Experiment(
            name=item["name"],
            setpoint_deg=_number(item.get("setpoint_deg")),
            protocol=item["protocol"],
            trials=tuple(
                TrialFile(
                    _plain(trial["file"]),
                    folder / trial["file"],
                    trial["order"],
                    float(trial["started_s"]),
                    number,
                )
                for number, trial in enumerate(item["trials"], start=1)
            ),
        )
        for item in document["experiments"]
    )
    return Campaign(
        folder=folder,
        name=document["name"],
        material=document["material"],
        provenance=Provenance(**document["provenance"]),
        log=log_format(document["log"], folder / "campaign.yaml", angle),
        reference_kpa=float(document["input"]["reference_kpa"]),
        experiments=experiments,
        calibration=tuple(sorted(calibration, key=lambda item: item.started_s)),
        pressure_sensor=_pressure_sensor(document.get("pressure_sensor"), folder / "campaign.yaml"),
        continues=document.get("continues"),
    )


def _plain(file: str) -> str:
    return Path(file).as_posix()  # ./a and a//b are names for a and a/b


def _number(value: float | None) -> float | None:
    return None if value is None else float(value)


def _pressure_sensor(entry: Mapping[str, Any] | None, path: Path) -> PressureSensor | None:
    if entry is None:
        return None
    volts, kpa = entry["volts"], entry["kpa"]
    for key, pair in (("volts", volts), ("kpa", kpa)):
        if not pair[0] < pair[1]:
            raise BadInput(
                path, f"is {pair}; expected two rising numbers", f"pressure_sensor.{key}"
            )
    return PressureSensor(
        (float(volts[0]), float(volts[1])),
        (float(kpa[0]), float(kpa[1])),
        float(entry["vref_mv"]),
        int(entry["adc_max"]),
    )


def _check_sense(campaign: Campaign) -> None:
    """Refuse what the schema cannot see: contradictions within campaign.yaml."""
    path = campaign.yaml
    names: set[str] = set()
    files: dict[str, str] = {}
    orders: dict[int, str] = {}
    for i, item in enumerate(campaign.calibration):
        _claim(files, item.file, f"calibration[{i}].file", path, "file")
    for i, experiment in enumerate(campaign.experiments):
        where = f"experiments[{i}]"
        if experiment.name in names:
            raise BadInput(path, f"'{experiment.name}' is the name of two", f"{where}.name")
        names.add(experiment.name)
        if not experiment.trials:
            raise BadInput(
                path,
                f"experiment '{experiment.name}' has no trials; expected at least one",
                f"{where}.trials",
            )
        for j, trial in enumerate(experiment.trials):
            key = f"{where}.trials[{j}]"
            _claim(files, trial.file, f"{key}.file", path, "file")
            _claim(orders, trial.order, f"{key}.order", path, "order")
    trials = sorted((trial for _, _, trial in campaign.trial_files()), key=lambda item: item.order)
    for earlier, later in pairwise(trials):
        if not later.started_s > earlier.started_s:
            raise BadInput(
                path,
                f"order {later.order} starts at {later.started_s:g} s, not after order "
                f"{earlier.order} at {earlier.started_s:g} s; expected it to rise with order",
                f"{orders[later.order].removesuffix('.order')}.started_s",
            )
    columns = campaign.log.columns
    if (
        columns is not None
        and "flex_adc" in columns
        and "angle" not in columns
        and (not campaign.calibration)
    ):
        raise BadInput(path, "is missing; the logs hold flex_adc, not an angle", "calibration")


def _claim(taken: dict[Any, str], value: Any, where: str, path: Path, kind: str) -> None:
    if value in taken:
        raise BadInput(path, f"{kind} {value} is already taken by {taken[value]}", where)
    taken[value] = where


def _check_files(campaign: Campaign) -> tuple[str, ...]:
    """Check that every file is there and sound; return what is odd about them."""
    wheres = {item.file: "calibration" for item in campaign.calibration}
    for experiment, number, trial in campaign.trial_files():
        wheres[trial.file] = f"experiment '{experiment.name}', trial {number}"
    for file, where in wheres.items():
        path = campaign.folder / file
        if ".." in Path(file).parts or Path(file).is_absolute():
            raise BadInput(
                campaign.yaml, f"file {file}: expected a plain path inside the folder", where
            )
        if not path.is_file():
            raise BadInput(path, f"is not there, but {campaign.yaml.name} names it", where)
    groups = {file: where.rsplit(", trial ", 1)[0] for file, where in wheres.items()}
    return checksums.verify(campaign.folder, groups)
