"""Logs in which others gave an actuator the same command again, laid out as campaigns.

A repeat is a log, or a cycle of one: its lines are written as they are.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from real_data import list_checksums
from spa_fo.atomic import write_bytes, write_text

Floats = NDArray[np.float64]

ABOVE = 0.25  # psi above rest: a cycle has begun


@dataclass(frozen=True)
class Columns:
    """What the columns of a log are.

    Parameters
    ----------
    unit : str
        Of both pressures.
    angle : str or None
        Name of a column; None where no angle was logged.
    pressure : str
        Name of a column.
    command : str or None
        None where the log's command is no pressure: then the measured pressure is the input.
    repeated : str
        The column that repeats say the same in.
    """

    unit: str
    angle: str | None
    pressure: str
    command: str | None
    repeated: str


@dataclass(frozen=True)
class Series:
    """Repeats of one command.

    Parameters
    ----------
    name, words : str
        For tables, and what is commanded.
    material : str
    files : tuple of str
        Logs below the folder of the data: a repeat each, or one that holds all cycles.
    columns : Columns
    rest_command, rest_pressure : float
        What these columns read while the actuator rests: the zero of both.
    reference_kpa : float
        Pressure at which u = 1.
    cycles : tuple of tuples of int
        Cycles of the one log that make up each repeat, from 1; empty where a log is a repeat.
    lead_s : float
        Rest before each cycle that belongs to it.
    rest_angle : float or None
        The zero of every repeat; where None, each begins at its own.
    """

    name: str
    words: str
    material: str
    files: tuple[str, ...]
    columns: Columns
    rest_command: float
    rest_pressure: float
    reference_kpa: float = 100.0
    cycles: tuple[tuple[int, ...], ...] = ()
    lead_s: float = 1.0
    rest_angle: float | None = None

    @property
    def signal(self) -> str | None:
        """What drives the model; None leaves it to the fit, which takes the command."""
        return None if self.columns.command else "pressure"


ARM = Columns("psi", "angle_deg", "pressure_p1_psi", "command_p1_psi", "command_p1_psi")
ARM_STEPS = Columns("psi", "angle_deg", "pressure_psi", "command_psi", "command_psi")
PNEUNET = Columns("kPa", "angle_deg", "pressure_kpa", None, "setpoint_deg")
SOFT_ARM, SILICONE = "silicone soft arm", "silicone PneuNet"
# The first two cycles condition the actuator; the sixth of the logs with a bias ends otherwise.
EACH, EACH_OF_FIVE = ((3,), (4,), (5,), (6,)), ((3,), (4,), (5,))
BY_TWO = ((3, 4), (5, 6))


def arm(name: str, words: str, log: str, rest: tuple[float, float], **options: Any) -> Series:
    """Make a series of cycles of the soft arm; `rest` is that of command and pressure in psi."""
    columns = ARM if log.startswith("arm_open_loop") else ARM_STEPS
    return Series(name, words, SOFT_ARM, (f"{log}.csv",), columns, *rest, **options)


def in_both_ways(
    name: str, words: str, log: str, rest: tuple[float, float], **options: Any
) -> tuple[Series, Series]:
    """Make two series of one log: a cycle a repeat, and two cycles a repeat."""
    return (
        arm(name, words, log, rest, cycles=EACH, **options),
        arm(f"{name}_by_two", f"{words}; two at a time", log, rest, cycles=BY_TWO, **options),
    )


SERIES = (
    Series(
        "ramp",
        "ramp 3 to 33 psi and back, 1 psi/s",
        SOFT_ARM,
        tuple(f"arm_open_loop/ramp_1psi_per_s_rep{n}.csv" for n in (1, 2)),
        ARM,
        rest_command=3.0,
        rest_pressure=2.2,
    ),
    Series(
        "pneunet",
        "steps of a controller's setpoint up to 170° and back",
        SILICONE,
        tuple(f"pneunet/steps170_same_command_rep{n}.csv" for n in (1, 2, 3)),
        PNEUNET,
        rest_command=0.0,
        rest_pressure=0.3,
        reference_kpa=10.0,
    ),
    arm(
        "pulse25_bias0",
        "pulses 0 to 25 psi, other chambers at 0 psi",
        "arm_open_loop/step25_bias0_x6",
        (0.0, 2.03),
        cycles=EACH_OF_FIVE,
    ),
    arm(
        "pulse25_bias1",
        "pulses 1 to 25 psi, other chambers at 1 psi",
        "arm_open_loop/step25_bias1_x6",
        (1.0, 2.03),
        cycles=EACH_OF_FIVE,
    ),
    *in_both_ways(
        "triangle_bias1",
        "triangles 1 to 25 psi, other chambers at 1 psi",
        "arm_open_loop/triangle_bias1_x6",
        (1.0, 2.03),
        lead_s=0.0,
    ),
    *in_both_ways(
        "pulse10", "pulses 1.5 to 10 psi", "arm_open_loop/step_from1p5_to10_x5", (1.5, 1.39)
    ),
    *in_both_ways(
        "pulse25", "pulses 1.5 to 25 psi", "arm_open_loop/step_from1p5_to25_x5", (1.5, 1.22)
    ),
    *in_both_ways("pulse05", "pulses 1.5 to 5 psi", "soft_arm_steps/step_05psi", (1.5, 1.37)),
    *in_both_ways("pulse15", "pulses 1.5 to 15 psi", "soft_arm_steps/step_15psi", (1.5, 1.38)),
    *in_both_ways("pulse20", "pulses 1.5 to 20 psi", "soft_arm_steps/step_20psi", (1.5, 1.34)),
)


@dataclass(frozen=True)
class Repeat:
    """One repeat: a name within its series, and the bytes of its logs."""

    name: str
    logs: tuple[bytes, ...]


def repeats_of(series: Series, data: Path) -> list[Repeat]:
    """Read the repeats of a series; where one log holds all, slice it into its cycles."""
    raw = [(data / file).read_bytes() for file in series.files]
    if not series.cycles:
        return [Repeat(f"rep{n}", (log,)) for n, log in enumerate(raw, 1)]
    cycles = slice_cycles(raw[0], series)
    return [
        Repeat("cycle" + "_".join(map(str, numbers)), tuple(cycles[n - 1] for n in numbers))
        for numbers in series.cycles
    ]


def slice_cycles(log: bytes, series: Series) -> list[bytes]:
    """Slice a log into its cycles: the header and the lines of each, byte by byte.

    A cycle lasts from `lead_s` before its command rises to `lead_s` before that of the next one;
    the last one as long as the one before it.
    """
    header, *lines = log.splitlines(keepends=True)
    time, command = numbers(log, "t_s", series.columns.repeated)
    rises = time[cycle_starts(command, series.rest_command + ABOVE)] - series.lead_s
    ends = [*rises[1:], rises[-1] + (rises[-1] - rises[-2])]
    edges = [np.searchsorted(time, edge) for edge in zip(rises, ends, strict=True)]
    return [header + b"".join(lines[first:last]) for first, last in edges]


def cycle_starts(command: Floats, level: float) -> NDArray[np.int64]:
    """Return the samples at which the command comes to lie above `level`."""
    above = command > level
    return np.flatnonzero(above[1:] & ~above[:-1]) + 1


def numbers(log: bytes, *columns: str) -> tuple[Floats, ...]:
    """Read columns of a log whose every row is whole."""
    header, *rows = csv.reader(io.StringIO(log.decode()))
    return tuple(np.array([float(row[header.index(name)]) for row in rows]) for name in columns)


def lay_out(series: Series, repeat: Repeat, name: str, folder: Path) -> Path:
    """Write a repeat as a campaign folder called `name`."""
    files = [f"{number}.csv" for number in range(1, len(repeat.logs) + 1)]
    for file, log in zip(files, repeat.logs, strict=True):
        write_bytes(folder / name / file, log)
    list_checksums(folder / name)
    starts = [float(numbers(log, "t_s")[0][0]) for log in repeat.logs]
    document = configuration(series, name, files, [start - starts[0] for start in starts])
    write_text(folder / name / "campaign.yaml", yaml.safe_dump(document, sort_keys=False))
    return folder / name


def configuration(
    series: Series, name: str, files: Sequence[str], starts: Sequence[float]
) -> dict[str, Any]:
    """Return campaign.yaml: what rests reads zero, trials are whole logs of any protocol."""
    columns = series.columns
    inputs = {"pressure": (columns.pressure, series.rest_pressure)}
    if columns.command:
        inputs = {"command": (columns.command, series.rest_command), **inputs}
    angle: dict[str, dict[str, Any]] = {}
    if columns.angle:
        angle["angle"] = {"column": columns.angle, "unit": "deg", "rest": "zero"}
        if series.rest_angle is not None:
            angle["angle"] |= {"rest": "keep", "offset": -series.rest_angle}
    return {
        "schema": "spa-fo/campaign/1",
        "name": name,
        "material": series.material,
        "provenance": {"kind": "measured", "source": ", ".join(series.files)},
        "log": {
            "format": "csv",
            "columns": {
                "time": {"column": "t_s", "unit": "s"},
                **{
                    role: {"column": column, "unit": columns.unit, "offset": -rest}
                    for role, (column, rest) in inputs.items()
                },
                **angle,
            },
        },
        "input": {"reference_kpa": series.reference_kpa},
        "experiments": [
            {
                "name": series.name,
                "protocol": "free",
                "trials": [
                    {"file": file, "order": order, "started_s": round(start, 3)}
                    for order, (file, start) in enumerate(zip(files, starts, strict=True), 1)
                ],
            }
        ],
    }
