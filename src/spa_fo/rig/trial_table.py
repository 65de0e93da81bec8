"""The table of trials: what later steps read in place of the raw logs."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from spa_fo import atomic
from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.rig.campaign import Campaign, Experiment, TrialFile
from spa_fo.rig.first_change import zero_until
from spa_fo.rig.trial import Trial

TABLE_COLUMNS = (
    "experiment",
    "trial",
    "t_s",
    "command_kpa",
    "pressure_kpa",
    "flex_adc",
    "angle_deg",
    "after_reset",
    "outside_calibration",
)


def write_trials(path: Path | str, trials: Sequence[Trial]) -> None:
    """Write trials as one CSV table (`TABLE_COLUMNS`), floats so that they read back exactly."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(TABLE_COLUMNS)
    for trial in trials:
        size = trial.t_s.size
        writer.writerows(
            zip(
                [trial.experiment] * size,
                [trial.trial] * size,
                _texts(trial.t_s, size),
                _texts(trial.command_kpa, size),
                _texts(trial.pressure_kpa, size),
                _texts(trial.flex_adc, size),
                _texts(trial.angle_deg, size),
                trial.after_reset.astype(int).tolist(),
                trial.outside_calibration.astype(int).tolist(),
                strict=True,
            )
        )
    atomic.write_text(path, stream.getvalue())


def load_trials(path: Path | str, campaign: Campaign) -> tuple[Trial, ...]:
    """Read a table of `write_trials` back, in the order of campaign.yaml.

    Raises
    ------
    BadInput
        The table is missing, has other columns, or does not hold exactly the campaign's trials.
    """
    path = Path(path)
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            head, *rows = csv.reader(stream)
    except (OSError, UnicodeDecodeError, ValueError, csv.Error) as error:
        raise BadInput(path, "cannot be read; expected a table of trials") from error
    if tuple(head) != TABLE_COLUMNS:
        raise BadInput(path, f"expected the columns {','.join(TABLE_COLUMNS)}", "line 1")
    groups: dict[tuple[str, str], list[list[str]]] = {}
    for line, row in enumerate(rows, start=2):
        if len(row) != len(TABLE_COLUMNS):
            raise BadInput(path, f"expected {len(TABLE_COLUMNS)} fields", f"line {line}")
        groups.setdefault((row[0], row[1]), []).append(row)
    trials = []
    for experiment, number, file in campaign.trial_files():
        group = groups.pop((experiment.name, str(number)), None)
        if group is None:
            raise BadInput(path, f"lacks {experiment.name} trial {number} of {campaign.name}")
        zeroed = campaign.logs_are_zeroed
        trials.append(_from_rows(path, group, experiment, number, file, zeroed))
    if groups:
        name, place = next(iter(groups))
        raise BadInput(path, f"holds {name} trial {place}, which {campaign.name} does not name")
    return tuple(trials)


def _from_rows(
    path: Path,
    rows: list[list[str]],
    experiment: Experiment,
    number: int,
    file: TrialFile,
    zeroed: bool,
) -> Trial:
    columns = dict(zip(TABLE_COLUMNS, zip(*rows, strict=True), strict=True))
    try:
        arrays: Mapping[str, Floats | None] = {
            name: None if not any(columns[name]) else np.array(columns[name], dtype=np.float64)
            for name in TABLE_COLUMNS[2:]
        }
    except ValueError as error:
        raise BadInput(path, f"{experiment.name} trial {number}: {error}") from error
    if any(array is not None and not np.isfinite(array).all() for array in arrays.values()):
        raise BadInput(path, f"{experiment.name} trial {number}: expected finite numbers")
    required = {}
    for name in ("t_s", "angle_deg", "after_reset", "outside_calibration"):
        array = arrays[name]
        if array is None:
            raise BadInput(path, f"{experiment.name} trial {number}: {name} is empty")
        required[name] = array
    trial = Trial(
        experiment=experiment.name,
        trial=number,
        protocol=experiment.protocol,
        setpoint_deg=experiment.setpoint_deg,
        order=file.order,
        started_s=file.started_s,
        t_s=required["t_s"],
        command_kpa=arrays["command_kpa"],
        pressure_kpa=arrays["pressure_kpa"],
        flex_adc=arrays["flex_adc"],
        angle_deg=required["angle_deg"],
        after_reset=required["after_reset"] != 0,
        outside_calibration=required["outside_calibration"] != 0,
    )
    return replace(trial, zero_until_s=zero_until(trial)) if zeroed else trial


def _texts(values: Floats | None, size: int) -> list[str]:
    return [""] * size if values is None else [repr(value) for value in values.tolist()]
