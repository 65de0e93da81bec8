"""All trials of a campaign, parsed and calibrated to angles."""

from __future__ import annotations

import dataclasses
from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from spa_fo.arrays import Bools, Floats
from spa_fo.errors import BadInput
from spa_fo.rig.calibration import Calibration, Drift, calibrate, drift
from spa_fo.rig.campaign import (
    CalibrationFile,
    Campaign,
    Experiment,
    TrialFile,
)
from spa_fo.rig.csv_log import read_csv_log
from spa_fo.rig.first_change import before_first_change, zero_until
from spa_fo.rig.held_readings import held
from spa_fo.rig.parse_report import FileReport, ParseReport, Tally
from spa_fo.rig.plausibility import implausible
from spa_fo.rig.protocol_check import contradiction, lone_rows
from spa_fo.rig.spa_rig_log import read_spa_rig_log
from spa_fo.rig.stuck import stuck
from spa_fo.rig.trial import Trial
from spa_fo.rig.trial_checks import check_banner, check_levels, overlaps
from spa_fo.rig.wire import Banner

_LONGEST_DROPOUT = 5  # samples
_FAR_FROM_0 = 0.5  # of the typical reading
# Beyond the calibration, as a fraction of its range: nearer than that the curve's line beyond its
# ends serves, as for a sensor that slipped, and samples are flagged; farther ones are left out. A
# trial that lies there for the most part is not this calibration's.
_FAR = 0.25
_MOST = 0.5


@dataclass(frozen=True)
class CampaignData:
    """A campaign's trials in the order of campaign.yaml, its calibrations, and the account.

    `calibrations` are sorted by time; the first made the angles. `drifts` compares each later
    one with it. Calibrations and account are empty where the trials come from a table.
    """

    campaign: Campaign
    trials: tuple[Trial, ...]
    calibrations: tuple[Calibration, ...] = ()
    drifts: tuple[Drift, ...] = ()
    report: ParseReport = field(default_factory=lambda: ParseReport("", (), ()))

    @property
    def calibration(self) -> Calibration | None:
        """The earliest calibration, which every angle came through; None if logs hold angles."""
        return self.calibrations[0] if self.calibrations else None


@dataclass(frozen=True)
class _Samples:
    """A trial's log in common terms, whatever its format."""

    t_s: Floats
    command_kpa: Floats | None
    pressure_kpa: Floats | None
    flex_adc: Floats | None
    angle_deg: Floats | None
    after_reset: Bools
    line: npt.NDArray[np.int64]
    rest: str
    report: FileReport

    def without(self, bad: Bools, reason: str) -> _Samples:
        """Leave out the samples where `bad`, counted as damaged by `reason`."""
        if not bad.any():
            return self
        tally = Tally()
        for line in self.line[bad].tolist():
            tally.add(reason, line)
        report = dataclasses.replace(
            self.report,
            valid=self.report.valid - int(np.count_nonzero(bad)),
            damaged={**self.report.damaged, **tally.damage()},
        )
        arrays: dict[str, Any] = {
            field.name: value[~bad]
            for field in dataclasses.fields(self)
            if isinstance(value := getattr(self, field.name), np.ndarray)
        }
        return dataclasses.replace(self, report=report, **arrays)


def read_trials(
    campaign: Campaign, *, protocols: Literal["checked", "free"] = "checked"
) -> CampaignData:
    """Read every log of a campaign and turn flex counts into angles.

    The angle of a sample is its flex count through the earliest calibration, always; later
    calibrations are reported as drift.

    Parameters
    ----------
    campaign : Campaign
        As read by `read_campaign`.
    protocols : {"checked", "free"}
        Whether a command that contradicts its protocol is refused, or its experiment is taken for
        a free one, with a warning.

    Returns
    -------
    CampaignData
        Trials, calibrations and the `ParseReport`. Where no angle was logged, it is 0.

    Raises
    ------
    BadInput
        A log that cannot be read at all, that is not what campaign.yaml says it is, or that lies
        outside the calibration for the most part; a reference pressure that cannot be.
    """
    reports: list[FileReport] = []
    calibrations = []
    converter: Banner | None = None
    for item in campaign.calibration:
        calibration, report, banner = _read_calibration(campaign, item)
        converter = converter or banner
        calibrations.append(calibration)
        reports.append(report)
    curve = calibrations[0] if calibrations else None
    warnings = list(campaign.warnings)
    logs: list[_Samples] = []
    lies: dict[str, str] = {}  # by experiment
    for experiment, _, file in campaign.trial_files():
        samples = _plausible(_read_samples(campaign, file, converter), campaign)
        samples = _without_lone_rows(samples, campaign, experiment)
        if curve is not None:
            samples = _within(curve, samples, file, warnings)
        lie = _contradicted(campaign, experiment, samples)
        if lie is not None and protocols == "checked":
            raise BadInput(file.path, lie)
        if lie is not None:
            lies.setdefault(experiment.name, f"{file.file}: {lie}; it is taken for a free one")
        logs.append(samples)
    warnings += lies.values()
    campaign = _freed(campaign, lies)
    trials = []
    for (experiment, number, file), samples in zip(campaign.trial_files(), logs, strict=True):
        trial, report = _to_trial(samples, experiment, number, file, curve)
        trials.append(trial)
        reports.append(report)
    check_levels(campaign, trials)
    warnings += [*overlaps(trials), *implausible(campaign, trials), *stuck(campaign, trials)]
    warnings += held(trials)
    return CampaignData(
        campaign,
        tuple(trials),
        tuple(calibrations),
        tuple(drift(calibrations[0], later) for later in calibrations[1:]),
        ParseReport(campaign.name, tuple(reports), tuple(warnings)),
    )


def earliest_calibration(campaign: Campaign) -> Calibration | None:
    """Read the calibration that every angle of a campaign comes through; None where it has none.

    Raises
    ------
    BadInput
        Its log cannot be used.
    """
    first = next(iter(campaign.calibration), None)
    return None if first is None else _read_calibration(campaign, first)[0]


def _read_calibration(
    campaign: Campaign, item: CalibrationFile
) -> tuple[Calibration, FileReport, Banner | None]:
    banner = None
    if campaign.log.format == "csv" and not _is_spa_rig(item.path):
        columns = campaign.log.columns or {}
        if "angle" not in columns or "flex_adc" not in columns:
            raise BadInput(
                item.path, "a csv calibration needs log.columns.angle and log.columns.flex_adc"
            )
        table = read_csv_log(item.path, campaign.log, ("time", "angle", "flex_adc"), item.file)
        t_s, known, counts, report = (
            table.t_s,
            table.columns["angle"],
            table.columns["flex_adc"],
            table.report,
        )
    else:
        log = read_spa_rig_log(item.path, item.file)
        if not {"angle_deg", "flex_adc"} <= set(log.columns) or "cmd_kpa" in log.columns:
            raise BadInput(
                item.path,
                f"{campaign.yaml.name} says it is a calibration, but its columns are "
                f"{','.join(log.banner.columns)}; expected seq,t_us,angle_deg,flex_adc",
                "line 1",
            )
        check_banner(campaign, item.path, log)
        banner = log.banner
        t_s, known, counts = log.t_s, log.columns["angle_deg"], log.columns["flex_adc"]
        report = log.report
    curve = calibrate(t_s, known, counts, item.file, item.started_s, str(item.path))
    return curve, dataclasses.replace(report, notes=report.notes + curve.notes), banner


def _is_spa_rig(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(9) == b"# spa-rig"


def _read_samples(campaign: Campaign, file: TrialFile, converter: Banner | None) -> _Samples:
    if campaign.log.format == "csv":
        return _csv_samples(campaign, file)
    log = read_spa_rig_log(file.path, file.file)
    columns = log.columns
    if "cmd_kpa" not in columns and "p_adc" not in columns:
        raise BadInput(
            file.path,
            f"{campaign.yaml.name} says it is a trial, but its columns are "
            f"{','.join(log.banner.columns)}; expected seq,t_us,cmd_kpa,p_adc,flex_adc",
            "line 1",
        )
    check_banner(campaign, file.path, log, converter)
    pressure = None
    if "p_adc" in columns:
        if campaign.pressure_sensor is None:
            raise BadInput(
                campaign.yaml, f"is missing; {file.file} holds p_adc, ADC counts", "pressure_sensor"
            )
        pressure = campaign.pressure_sensor.pressure_kpa(columns["p_adc"])
    return _Samples(
        log.t_s,
        columns.get("cmd_kpa"),
        pressure,
        columns.get("flex_adc"),
        columns.get("angle_deg"),
        log.after_reset,
        log.line,
        "keep",
        log.report,
    )


def _csv_samples(campaign: Campaign, file: TrialFile) -> _Samples:
    columns, output = campaign.log.columns or {}, campaign.output
    roles = [role for role in ("command", "pressure", output) if role in columns]
    table = read_csv_log(file.path, campaign.log, roles, file.file)
    return _Samples(
        table.t_s,
        table.columns.get("command"),
        table.columns.get("pressure"),
        table.columns.get("flex_adc"),
        table.columns.get("angle") if campaign.has_angle else np.zeros(table.t_s.shape),
        np.zeros(table.t_s.shape, dtype=np.bool_),
        table.line,
        "zero" if campaign.logs_are_zeroed else "keep",
        table.report,
    )


def _plausible(samples: _Samples, campaign: Campaign) -> _Samples:
    """Leave out what neither the pump nor the converter can have meant."""
    sensor = campaign.pressure_sensor
    if sensor is not None and samples.command_kpa is not None:
        low, high = sensor.kpa
        centre, reach = 0.5 * (low + high), 1.5 * (high - low)
        beyond = np.abs(samples.command_kpa - centre) > reach
        samples = samples.without(beyond, "command range")
    if samples.flex_adc is not None:
        samples = samples.without(dropouts(samples.flex_adc), "adc dropout")
    elif samples.angle_deg is not None:
        samples = samples.without(dropouts(samples.angle_deg), "angle dropout")
    if samples.t_s.size < 2:
        raise BadInput(campaign.folder / samples.report.file, "holds fewer than 2 valid samples")
    return samples


def _without_lone_rows(samples: _Samples, campaign: Campaign, experiment: Experiment) -> _Samples:
    """Leave out rows whose command is another for that row alone; a free one may mean them."""
    said = campaign.log.format == "spa-rig" and experiment.protocol != "free"
    if not said or samples.command_kpa is None:
        return samples
    return samples.without(lone_rows(samples.command_kpa), "command for one row")


def dropouts(reading: Floats) -> Bools:
    """Find readings of 0 that are a broken contact: a few samples between alike ones far from 0."""
    zero = reading == 0.0
    found = np.zeros(reading.shape, dtype=np.bool_)
    if not zero.any() or zero.all():
        return found
    far = _FAR_FROM_0 * float(np.median(np.abs(reading[~zero])))
    edges = np.flatnonzero(np.diff(np.concatenate(([False], zero, [False])).astype(int)))
    for begin, end in edges.reshape(-1, 2):
        if begin == 0 or end == reading.size or end - begin > _LONGEST_DROPOUT:
            continue
        before, after = reading[begin - 1], reading[end]
        found[begin:end] = min(abs(before), abs(after)) > max(far, abs(after - before))
    return found


def _contradicted(campaign: Campaign, experiment: Experiment, samples: _Samples) -> str | None:
    """Say how a command contradicts what it is said to be, or return None."""
    if samples.command_kpa is None or samples.after_reset.any():
        return None  # a reset may have cut the protocol short, or begun it again
    lie = contradiction(experiment.protocol, samples.t_s, samples.command_kpa)
    if lie is None:
        return None
    said = f"experiment '{experiment.name}' is a {experiment.protocol}"
    return f"{campaign.yaml.name} says that {said}, but {lie}"


def _freed(campaign: Campaign, names: Container[str]) -> Campaign:
    """Take experiments of these names for free ones."""
    experiments = tuple(
        dataclasses.replace(each, protocol="free") if each.name in names else each
        for each in campaign.experiments
    )
    return dataclasses.replace(campaign, experiments=experiments)


def _to_trial(
    samples: _Samples,
    experiment: Experiment,
    number: int,
    file: TrialFile,
    curve: Calibration | None,
) -> tuple[Trial, FileReport]:
    flex = samples.flex_adc
    if flex is not None and curve is not None:
        angle = curve.angle_deg(flex)
        outside = curve.outside(flex)
    elif samples.angle_deg is not None:
        angle = samples.angle_deg
        outside = np.zeros(angle.shape, dtype=np.bool_)
    else:
        raise BadInput(file.path, "holds flex counts, but campaign.yaml names no calibration")
    notes, until_s = samples.report.notes, 0.0
    if samples.rest == "zero":
        before = before_first_change(samples)
        angle = angle - angle[:before].mean()
        until_s = zero_until(samples)
        if before == angle.size:
            notes += ("its input never changes: its zero is the mean of the whole log",)
        elif before < 5:
            notes += (f"its zero is the mean of only {before} samples",)
    report = dataclasses.replace(
        samples.report, outside_calibration=int(np.count_nonzero(outside)), notes=notes
    )
    trial = Trial(
        experiment=experiment.name,
        trial=number,
        protocol=experiment.protocol,
        setpoint_deg=experiment.setpoint_deg,
        order=file.order,
        started_s=file.started_s,
        t_s=samples.t_s - samples.t_s[0],
        command_kpa=samples.command_kpa,
        pressure_kpa=samples.pressure_kpa,
        flex_adc=flex,
        angle_deg=angle,
        after_reset=samples.after_reset,
        outside_calibration=outside,
        zero_until_s=until_s,
    )
    return trial, report


def _within(
    curve: Calibration, samples: _Samples, file: TrialFile, warnings: list[str]
) -> _Samples:
    """Leave out samples far beyond the calibration, and refuse a trial that mostly lies there."""
    if samples.flex_adc is None:
        return samples
    angle = curve.angle_deg(samples.flex_adc)
    low, high = curve.range_deg
    beyond = np.maximum(low - angle, angle - high) / (high - low)
    far = beyond > _FAR
    if np.count_nonzero(far) > _MOST * angle.size:
        raise BadInput(
            file.path,
            f"angle outside calibration: {np.count_nonzero(far)} of {angle.size} samples, "
            f"{angle.min():.0f} to {angle.max():.0f} deg, but {curve.file} covers "
            f"{low:g} to {high:g} deg",
        )
    if far.any():
        warnings.append(
            f"{file.file}: {np.count_nonzero(far)} of {angle.size} samples lie far outside the "
            f"calibration, {low:g} to {high:g} deg, and are left out"
        )
    return samples.without(far, "far outside calibration")
