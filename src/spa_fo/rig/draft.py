"""A campaign.yaml drafted from a folder of logs: what they hold, and which are repeats."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.places import log_folder
from spa_fo.rig import checksums
from spa_fo.rig.campaign import Protocol
from spa_fo.rig.csv_log import read_csv_log
from spa_fo.rig.inspect_log import inspect_log
from spa_fo.rig.inspection import Inspection
from spa_fo.rig.log_format import DATETIME, Column, LogFormat
from spa_fo.rig.protocol_guess import guess_protocol, same_command
from spa_fo.rig.raw import read_bytes
from spa_fo.rig.timestamps import has_date

WRITTEN = ("campaign.yaml", checksums.NAME, "overview.png")
_NO_LOGS = re.compile(
    r"\.(?:yaml|yml|json|md|rst|pdf|png|jpg|jpeg|svg|gif|avi|mp4|mov|"
    r"py|m|ino|mat|xls|xlsx|ods|doc|docx|zip|gz|tdms|bin|html)",
    re.IGNORECASE,
)
_PAUSE_S = 60.0  # assumed between logs that do not say when they were made
_CALIBRATED_S = 600.0  # assumed between a calibration and the trials


@dataclass(frozen=True)
class Log:
    """One log that can be a trial: times as logged (s), its signals, and what it holds."""

    file: str
    t_s: Floats
    signals: dict[str, Floats]
    inspection: Inspection

    @property
    def drive(self) -> Floats | None:
        """What drives the actuator: the command, or else the pressure."""
        return self.signals.get("command", self.signals.get("pressure"))


@dataclass(frozen=True)
class DraftTrial:
    """One trial: `order` in the campaign, `started_s` campaign time (s)."""

    file: str
    order: int
    started_s: float


@dataclass(frozen=True)
class DraftExperiment:
    """Trials of one command; `doubt` is of the protocol."""

    name: str
    protocol: Protocol
    doubt: str
    trials: tuple[DraftTrial, ...]


@dataclass(frozen=True)
class Draft:
    """What campaign.yaml is to say, and what is unsure of it.

    Attributes
    ----------
    folder : Path
        Where the logs lie.
    log : Inspection
        Of one of them, with the log format of all.
    reference_kpa : float
        The largest command, rounded.
    experiments : tuple of DraftExperiment
    calibration : tuple of (str, float)
        File and campaign time, s.
    doubts : dict of str to str
        By key of campaign.yaml.
    left_out : dict of str to str
        Files that are no part of it, and why.
    """

    folder: Path
    log: Inspection
    reference_kpa: float
    experiments: tuple[DraftExperiment, ...]
    calibration: tuple[tuple[str, float], ...]
    doubts: dict[str, str]
    left_out: dict[str, str]

    @property
    def files(self) -> list[str]:
        """Every raw file that SHA256SUMS has to list: those named, and all of format spa-rig."""
        named = [trial.file for one in self.experiments for trial in one.trials]
        strays = [file for file in self.left_out if file.endswith(".log")]
        return sorted({*named, *(file for file, _ in self.calibration), *strays})


def draft_campaign(folder: Path | str) -> Draft:
    """Look through a folder of logs and guess the campaign.

    Parameters
    ----------
    folder : Path or str
        Logs of one actuator, in subfolders or not. Nothing in it is changed.

    Raises
    ------
    BadInput
        There is no folder, no log that can be read, or none that holds an angle.
    """
    folder = Path(folder)
    log_folder(folder)
    found, left_out = _inspected(folder)
    if not found:
        first = next((f"; {file}: {why}" for file, why in left_out.items()), "")
        raise BadInput(folder, f"holds no log to read; expected csv or spa-rig logs{first}")
    spa_rig = {file: one for file, one in found.items() if one.kind == "spa-rig"}
    if 2 * len(spa_rig) >= len(found):
        left_out |= dict.fromkeys(set(found) - set(spa_rig), "is no spa-rig log as the others")
        return _drafted(folder, *_spa_rig_logs(folder, spa_rig), left_out)
    form, doubts = _common_format(folder, found)
    logs = _csv_logs(folder, found, form, left_out)
    return _drafted(folder, logs, (), doubts, left_out)


def _inspected(folder: Path) -> tuple[dict[str, Inspection], dict[str, str]]:
    found, left_out = {}, {}
    digests: dict[bytes, str] = {}
    for path in sorted(folder.rglob("*"), key=lambda one: _natural(one.as_posix())):
        file = path.relative_to(folder).as_posix()
        hidden = any(part.startswith(".") for part in Path(file).parts)
        if hidden or not path.is_file() or file in WRITTEN or _NO_LOGS.fullmatch(path.suffix):
            continue
        try:
            data = read_bytes(path, "a log")
            twin = digests.setdefault(data, file) if data else file
            if twin != file:
                left_out[file] = f"holds the same bytes as {twin}"
                continue
            found[file] = inspect_log(path)
        except BadInput as error:
            left_out[file] = f"{error.where}: {error.expected}".removeprefix(": ")
    return found, left_out


def _common_format(folder: Path, found: dict[str, Inspection]) -> tuple[Inspection, dict[str, str]]:
    """Return one inspection with the format that most complete logs have, and what is unsure."""
    complete = [one for one in found.values() if one.kind == "csv" and one.complete]
    angles = [one for one in complete if "angle" in one.signals]
    if not angles:
        file, one = next(iter(found.items()))
        held = ", ".join(("time", *one.signals))
        hint = " and a calibration" if complete else ""
        raise BadInput(
            folder, f"holds no log with an angle{hint} ({file}: {held}); expected a column with it"
        )
    keys = [_key(one.log) for one in angles]
    usual = max(dict.fromkeys(keys), key=keys.count)
    alike = [one for one, key in zip(angles, keys, strict=True) if key == usual]
    columns = {
        role: _common_column(role, item, [(one.log.columns or {})[role] for one in alike])
        for role, item in (alike[0].log.columns or {}).items()
        if role != "flex_adc"
    }
    offsets = {
        role for role in columns if len({(one.log.columns or {})[role].offset for one in alike}) > 1
    }
    doubts = dict.fromkeys(offsets, "the logs rest at different values, the middle one is taken")
    return replace(alike[0], log=replace(alike[0].log, columns=columns)), doubts


def _key(log: LogFormat) -> tuple[object, ...]:
    columns = {
        role: (item.column, item.unit, item.scale, item.format)
        for role, item in (log.columns or {}).items()
    }
    return (log.delimiter, log.decimal, log.encoding, log.header, tuple(columns.items()))


def _common_column(role: str, item: Column, all_of: Sequence[Column]) -> Column:
    offset = float(np.median([one.offset for one in all_of]))
    zero = any(one.rest == "zero" for one in all_of)
    return replace(item, offset=offset, rest="zero" if zero else "keep")


def _csv_logs(
    folder: Path, found: dict[str, Inspection], form: Inspection, left_out: dict[str, str]
) -> list[Log]:
    logs = []
    for file, one in found.items():
        if one.kind != "csv":
            left_out[file] = "is a spa-rig log, not csv as the others"
            continue
        try:
            read = read_csv_log(folder / file, form.log)
        except BadInput as error:
            left_out[file] = f"is not written as the others: {error.expected}"
            continue
        logs.append(Log(file, read.t_s, dict(read.columns), form))
    return logs


def _spa_rig_logs(
    folder: Path, found: dict[str, Inspection]
) -> tuple[list[Log], tuple[str, ...], dict[str, str]]:
    logs, calibrations = [], []
    for file, one in found.items():
        columns = one.banner.columns if one.banner is not None else ()
        if "angle_deg" in columns and "flex_adc" in columns:
            calibrations.append(file)
        else:
            logs.append(Log(file, one.t_s, dict(one.signals), one))
    if any("angle" not in log.signals for log in logs) and not calibrations:
        raise BadInput(folder, "holds flex counts without a calibration; expected a log of one")
    calibrations.sort(key=lambda file: (_is_later(file), _natural(file)))
    doubts = {}
    if any("pressure" in log.signals for log in logs):
        doubts["pressure_sensor"] = "no log says which sensor it is"
    return logs, tuple(calibrations), doubts


def _is_later(file: str) -> bool:
    return bool(re.search(r"post|after|nach|end", Path(file).stem.lower()))


def _drafted(
    folder: Path,
    logs: Sequence[Log],
    calibrations: Sequence[str],
    doubts: dict[str, str],
    left_out: dict[str, str],
) -> Draft:
    if not logs:
        raise BadInput(folder, "holds no log of a trial; expected one with a command or a pressure")
    starts, doubt = _starts(logs)
    order = sorted(logs, key=lambda log: starts[log.file])
    trials = {
        log.file: DraftTrial(log.file, place, round(starts[log.file], 3))
        for place, log in enumerate(order, start=1)
    }
    reference, why = _reference(logs)
    doubts = {**doubts, "started_s": doubt, "reference_kpa": why}
    end = max(starts[log.file] + float(log.t_s[-1] - log.t_s[0]) for log in logs)
    times = [-_CALIBRATED_S * (len(calibrations) - i) for i in range(len(calibrations))]
    placed = [
        (file, end + _CALIBRATED_S if i and _is_later(file) else times[i])
        for i, file in enumerate(calibrations)
    ]
    return Draft(
        folder=folder,
        log=logs[0].inspection,
        reference_kpa=reference,
        experiments=tuple(_experiments(order, trials)),
        calibration=tuple(placed),
        doubts={key: text for key, text in doubts.items() if text},
        left_out=dict(sorted(left_out.items())),
    )


def _starts(logs: Sequence[Log]) -> tuple[dict[str, float], str]:
    """Return when each log began, s from the first, and what is unsure of it."""
    time = (logs[0].inspection.log.columns or {}).get("time")
    ordered = sorted(logs, key=lambda log: float(log.t_s[0]))
    runs_on = all(later.t_s[0] >= earlier.t_s[-1] for earlier, later in pairwise(ordered))
    if runs_on and (len(logs) > 1 or (time is not None and time.unit == DATETIME)):
        first = float(ordered[0].t_s[0])
        dated = time is not None and time.unit == DATETIME and has_date(time.format)
        doubt = "" if dated else "the clock of the logs is taken to run on from log to log"
        return {log.file: float(log.t_s[0]) - first for log in logs}, doubt
    starts, clock = {}, 0.0
    for log in sorted(logs, key=lambda one: _natural(one.file)):
        starts[log.file] = clock
        clock += float(np.ceil(log.t_s[-1] - log.t_s[0])) + _PAUSE_S
    return starts, (
        f"the logs do not say when they began: in the order of their names, {_PAUSE_S:g} s apart"
    )


def _reference(logs: Sequence[Log]) -> tuple[float, str]:
    drives = [log.drive for log in logs if log.drive is not None]
    largest = max((float(np.abs(drive).max()) for drive in drives), default=0.0)
    if largest == 0.0:
        return 1.0, "no log holds a command or a pressure"
    return float(f"{largest:.2g}"), ""


def _experiments(logs: Sequence[Log], trials: dict[str, DraftTrial]) -> Iterable[DraftExperiment]:
    groups: list[list[Log]] = []
    for log in logs:
        alike = next((group for group in groups if _are_repeats(group[0], log)), None)
        if alike is None:
            groups.append([log])
        else:
            alike.append(log)
    taken: set[str] = set()
    for group in groups:
        protocol, doubt = _protocol(group)
        name = _unique(_name(group, groups, protocol), taken)
        taken.add(name)
        yield DraftExperiment(name, protocol, doubt, tuple(trials[log.file] for log in group))


def _are_repeats(first: Log, second: Log) -> bool:
    if first.drive is None or second.drive is None:
        return False
    return same_command((first.t_s, first.drive), (second.t_s, second.drive))


def _protocol(group: Sequence[Log]) -> tuple[Protocol, str]:
    """Return the protocol that all trials of a group are of; ``free`` where they differ."""
    if any("command" not in log.signals for log in group):
        return "free", "no command is logged"
    guesses = [guess_protocol(log.t_s - log.t_s[0], log.signals["command"]) for log in group]
    if len({protocol for protocol, _ in guesses}) > 1:
        return "free", "its trials differ"
    return guesses[0]


def _name(group: Sequence[Log], groups: Sequence[Sequence[Log]], protocol: str) -> str:
    """Name an experiment after its folder where that holds it alone, else after its command."""
    folders = {Path(log.file).parent for log in group}
    others = {Path(log.file).parent for one in groups if one is not group for log in one}
    if len(folders) == 1 and not folders & others and folders != {Path()}:
        return "_".join(folders.pop().parts)
    drive = group[0].signals.get("command")
    if drive is None:
        return Path(group[0].file).stem
    column = (group[0].inspection.log.columns or {}).get("command")
    unit = "" if column is not None and column.unit == "1" else "kpa"
    return f"{protocol}_{drive[np.argmax(np.abs(drive))]:.3g}{unit}".replace(".", "p")


def _unique(name: str, taken: set[str]) -> str:
    names = [name, *(f"{name}_{i}" for i in range(2, len(taken) + 3))]
    return next(one for one in names if one not in taken)


def _natural(text: str) -> tuple[tuple[int, int | str], ...]:
    """Sort key that puts run_2 before run_10."""
    parts = re.split(r"(\d+)", text.lower())
    return tuple((0, int(part)) if part.isdecimal() else (1, part) for part in parts)
