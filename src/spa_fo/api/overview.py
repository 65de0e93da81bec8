"""What was read of each experiment: how much, how fast, between what values, and from what rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spa_fo.api.show import text_table
from spa_fo.arrays import Floats
from spa_fo.rig import CampaignData, Experiment, Trial
from spa_fo.rig.first_change import before_first_change

Range = tuple[float, float]

COLUMNS = (
    "experiment",
    "protocol",
    "setpoint",
    "trials",
    "samples",
    "longest",
    "rate",
    "command",
    "pressure",
    "angle",
    "at rest",
)
_BLOCKS = "▁▂▃▄▅▆▇█"
_LINE = 40  # characters


@dataclass(frozen=True)
class ExperimentOverview:
    """One experiment at a glance.

    Attributes
    ----------
    experiment : Experiment
        As campaign.yaml has it.
    trials, samples : int
        How many were read.
    longest_s : float
        Of its trials.
    rate_hz : float
        Samples a second, by the middle interval.
    command_kpa, pressure_kpa : (float, float) or None
        Smallest and largest; None where no log holds it.
    angle_deg : (float, float)
        Smallest and largest.
    rest_deg : (float, float) or None
        Smallest and largest of the trials' mean angles before the input first changes; None where
        it never does.
    line_deg : (n,) array
        The first trial's angle, for a small line.
    command_unit : str
        Empty where the command is no pressure.
    """

    experiment: Experiment
    trials: int
    samples: int
    longest_s: float
    rate_hz: float
    command_kpa: Range | None
    pressure_kpa: Range | None
    angle_deg: Range
    rest_deg: Range | None
    line_deg: Floats
    command_unit: str = " kPa"

    def cells(self) -> list[str]:
        """Return a row of text, in the order of `COLUMNS`."""
        setpoint = self.experiment.setpoint_deg
        return [
            self.experiment.name,
            self.experiment.protocol,
            "" if setpoint is None else f"{setpoint:g}°",
            f"{self.trials}",
            f"{self.samples}",
            f"{self.longest_s:.1f} s",
            f"{self.rate_hz:.3g} Hz",
            _range_text(self.command_kpa, self.command_unit),
            _range_text(self.pressure_kpa, " kPa"),
            _range_text(self.angle_deg, "°"),
            _range_text(self.rest_deg, "°"),
        ]


def overview(data: CampaignData) -> tuple[ExperimentOverview, ...]:
    """Look at every experiment of a campaign, in the order of campaign.yaml."""
    unit = " kPa" if data.campaign.command_is_pressure else ""
    return tuple(
        _experiment(experiment, [t for t in data.trials if t.experiment == experiment.name], unit)
        for experiment in data.campaign.experiments
    )


def overview_text(seen: Sequence[ExperimentOverview]) -> str:
    """Write a table with a row for each experiment, and below it a line that draws its angle."""
    rows = [one.cells() for one in seen]
    angle = COLUMNS.index("angle")
    width = max(len(row[0]) for row in rows)
    lines = []
    for one, row in zip(seen, rows, strict=True):
        rest = f", at rest {row[angle + 1]}" if row[angle + 1] else ""
        line = spark_line(one.line_deg)
        lines.append(f"{row[0].ljust(width)}  {line.ljust(_LINE)}  {row[angle]}{rest}")
    table = text_table(COLUMNS[:angle], [row[:angle] for row in rows])
    return "\n".join([table, "", "angle: the first trial's line, all trials' range", *lines])


def spark_line(values: Floats, length: int = _LINE) -> str:
    """Draw values as blocks from their lowest to their highest; `length` of them at most."""
    means = [part.mean() for part in np.array_split(values, min(length, values.size))]
    low, span = min(means), max(np.ptp(means), 1e-12)
    return "".join(_BLOCKS[round((mean - low) / span * (len(_BLOCKS) - 1))] for mean in means)


def _experiment(
    experiment: Experiment, trials: Sequence[Trial], command_unit: str
) -> ExperimentOverview:
    intervals = np.concatenate([np.diff(trial.t_s) for trial in trials])
    return ExperimentOverview(
        experiment=experiment,
        trials=len(trials),
        samples=sum(trial.t_s.size for trial in trials),
        longest_s=max(float(trial.t_s[-1]) for trial in trials),
        rate_hz=1.0 / float(np.median(intervals)),
        command_kpa=_range([trial.command_kpa for trial in trials]),
        pressure_kpa=_range([trial.pressure_kpa for trial in trials]),
        angle_deg=_range([trial.angle_deg for trial in trials]) or (np.nan, np.nan),
        rest_deg=_range([_rest(trial) for trial in trials]),
        line_deg=trials[0].angle_deg,
        command_unit=command_unit,
    )


def _rest(trial: Trial) -> Floats | None:
    """Return the mean angle before the input first changes, as one value."""
    before = before_first_change(trial)
    return trial.angle_deg[:before].mean(keepdims=True) if before < trial.t_s.size else None


def _range(parts: Sequence[Floats | None]) -> Range | None:
    known = [part for part in parts if part is not None]
    if not known:
        return None
    return min(float(part.min()) for part in known), max(float(part.max()) for part in known)


def _range_text(ends: Range | None, unit: str) -> str:
    if ends is None:
        return ""
    low, high = (f"{round(end, 1) + 0.0:.1f}" for end in ends)
    return f"{low}{unit}" if low == high else f"{low} .. {high}{unit}"
