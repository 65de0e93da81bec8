"""Samples -> the bytes of a log, in the board's format or as csv, and what goes wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from blind.first_rig.asked import Asked, Sampling
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.clock import BoardClock
from spa_fo.virtual_rig.converter import Converter, PressureSensor
from spa_fo.virtual_rig.wire import Damage, banner, data_line

_LARGEST_KPA = 551.6  # range of the pressure sensor
_HEADROOM = 1.5  # of that range over the largest command
_SLOWEST_BOARD_S = 0.0015  # lag of a pressure sensor of more than 100 Hz


@dataclass(frozen=True)
class Samples:
    """One log: a row for each sample.

    Parameters
    ----------
    started_s : float
        Campaign time of the log's start.
    time_s : ndarray (n,)
        From there.
    command_kpa : ndarray (n,)
        The command; in a calibration the fixture's angle.
    pressure_kpa : ndarray (n,) or None
        Measured pressure.
    reading : ndarray (n,)
        Flex counts, or the angle in degrees.
    """

    started_s: float
    time_s: Array
    command_kpa: Array
    pressure_kpa: Array | None
    reading: Array


class LogFormat(Protocol):
    """A way to write logs."""

    @property
    def suffix(self) -> str:
        """How the names of its trials end."""

    @property
    def pressure_lag_s(self) -> float:
        """Lag of the pressure sensor that goes with it."""

    def describe(self) -> dict[str, Any]:
        """Give what campaign.yaml says of it."""

    def trial(self, samples: Samples, rng: np.random.Generator) -> bytes:
        """Write a trial."""


@dataclass(frozen=True)
class SpaRigFormat:
    """What the board writes.

    Parameters
    ----------
    sampling : Sampling
        Rate and damages.
    converter : Converter
        Its converter.
    pressure_sensor : PressureSensor
        What its pressure counts mean.
    resolution_kpa : float
        Step of the pressure, a whole number of counts.
    pressure_lag_s : float
        Lag of the pressure sensor.
    clock : BoardClock
        Its micros().
    line_end : bytes
        LF or CRLF.
    """

    sampling: Sampling
    converter: Converter
    pressure_sensor: PressureSensor
    resolution_kpa: float
    pressure_lag_s: float
    clock: BoardClock
    line_end: bytes

    suffix = "log"

    def describe(self) -> dict[str, Any]:
        """Give what campaign.yaml says of it."""
        sensor, converter = self.pressure_sensor, self.converter
        return {
            "log": {"format": "spa-rig"},
            "pressure_sensor": {
                "volts": list(sensor.volts_at_ends),
                "kpa": list(sensor.kpa_at_ends),
                "vref_mv": round(1000.0 * converter.reference_volt),
                "adc_max": converter.maximum,
            },
        }

    def trial(self, samples: Samples, rng: np.random.Generator) -> bytes:
        """Write a trial."""
        pressure = samples.pressure_kpa
        commands = [f"{kpa:.2f}" for kpa in samples.command_kpa.tolist()]
        if pressure is None:
            return self._log("cmd_kpa,flex_adc", samples, [commands], rng)
        stepped = np.rint(pressure / self.resolution_kpa) * self.resolution_kpa
        exact = self.pressure_sensor.volts(stepped) / self.converter.volts_per_count
        # Steps are whole counts, beside a zero that may lie midway between two: all go one way.
        counts = np.floor(exact + 0.5 + 1e-6).astype(np.int64)
        counts = np.clip(counts, 0, self.converter.maximum)
        return self._log("cmd_kpa,p_adc,flex_adc", samples, [commands, counts.tolist()], rng)

    def calibration(self, samples: Samples, rng: np.random.Generator) -> bytes:
        """Write a calibration."""
        angles = [f"{angle:.2f}" for angle in samples.command_kpa.tolist()]
        return self._log("angle_deg,flex_adc", samples, [angles], rng)

    def _log(
        self,
        columns: str,
        samples: Samples,
        before_flex: list[list[Any]],
        rng: np.random.Generator,
    ) -> bytes:
        stamps = self.clock.micros(samples.started_s + samples.time_s, rng).tolist()
        flex = samples.reading.astype(np.int64).tolist()
        rows = zip(range(len(stamps)), stamps, *before_flex, flex, strict=True)
        logged = _logged(self.sampling, len(stamps), rng)
        lines = [data_line(*row) for row, there in zip(rows, logged, strict=True) if there]
        head = banner(f"seq,t_us,{columns}", self.sampling.rate_hz, converter=self.converter)
        hit = rng.binomial(len(lines), self.sampling.damaged)
        flipped, cut, doubled = rng.multinomial(hit, [1 / 3] * 3).tolist()
        damage = Damage(flipped=flipped, cut=cut, doubled=doubled)
        return damage.apply([head, *lines], self.line_end, rng, frozenset({0}))


@dataclass(frozen=True)
class CsvFormat:
    """A table as another program would write it.

    Parameters
    ----------
    sampling : Sampling
        Missing and unreadable rows.
    delimiter : str
        Between fields.
    header : bool
        Whether the first line names the columns.
    time_unit, angle_unit : str
        ``s`` or ``ms``; ``deg`` or ``rad``, or ``1`` for flex counts.
    measured : bool
        Whether there is a pressure.
    resolution_kpa, pressure_lag_s : float
        Of the pressure.
    """

    sampling: Sampling
    delimiter: str
    header: bool
    time_unit: str
    angle_unit: str
    measured: bool
    resolution_kpa: float
    pressure_lag_s: float

    suffix = "csv"

    def describe(self) -> dict[str, Any]:
        """Give what campaign.yaml says of it."""
        columns = {
            role: {"column": role if self.header else place, "unit": unit}
            for place, (role, unit) in enumerate(self._columns().items(), start=1)
        }
        layout = {"format": "csv", "delimiter": self.delimiter, "header": self.header}
        return {"log": {**layout, "columns": columns}}

    def _columns(self) -> dict[str, str]:
        """Units of the columns, by role."""
        pressure = {"pressure": "kPa"} if self.measured else {}
        reading = "flex_adc" if self.angle_unit == "1" else "angle"
        return {"time": self.time_unit, "command": "kPa", **pressure, reading: self.angle_unit}

    def trial(self, samples: Samples, rng: np.random.Generator) -> bytes:
        """Write a trial."""
        columns = [_texts(samples.time_s, *{"s": (1.0, 6), "ms": (1e3, 3)}[self.time_unit])]
        columns.append(_texts(samples.command_kpa, 1.0, 2))
        if samples.pressure_kpa is not None:
            stepped = np.rint(samples.pressure_kpa / self.resolution_kpa) * self.resolution_kpa
            columns.append(_texts(stepped, 1.0, 4))
        scale, digits = {"deg": (1.0, 4), "rad": (np.pi / 180.0, 6), "1": (1.0, 0)}[self.angle_unit]
        columns.append(_texts(samples.reading, scale, digits))
        logged = _logged(self.sampling, samples.time_s.size, rng)
        rows = [row for row, there in zip(zip(*columns, strict=True), logged, strict=True) if there]
        unreadable = rng.random(len(rows)) < self.sampling.damaged
        unreadable[[0, -1]] = False
        lines = [self.delimiter.join(self._columns())] if self.header else []
        for row, hit in zip(rows, unreadable.tolist(), strict=True):
            lines.append(self.delimiter.join(_spoilt(row, rng) if hit else row))
        return "".join(f"{line}\n" for line in lines).encode("ascii")


def _logged(sampling: Sampling, count: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Draw which samples are logged; the first and the last are."""
    logged = rng.random(count) >= sampling.missing
    logged[[0, -1]] = True
    return logged


def _texts(values: Array, scale: float, digits: int) -> list[str]:
    return [f"{value:.{digits}f}" for value in (values * scale + 0.0).tolist()]


def _spoilt(row: Sequence[str], rng: np.random.Generator) -> Sequence[str]:
    """Make a row unreadable: a field empty, no number, or the row's end missing."""
    fields, at = list(row), int(rng.integers(len(row)))
    fault = rng.choice(["", "nan", "err", "cut"])
    if fault == "cut":
        return fields[: max(at, 1)]
    fields[at] = str(fault)
    return fields


def draw_board_format(asked: Asked, largest_kpa: float) -> SpaRigFormat:
    """Draw how the board writes; a step of its pressure is one count, or a few of a fine one."""
    rng, around = asked.stream("board"), asked.surroundings
    converter = Converter(bits=around.bits, noise_counts=0.0)
    # The sensor's 0.5 to 4.5 V are four fifths of the converter's range.
    range_kpa = 0.8 * converter.maximum * around.pressure.resolution_kpa
    range_kpa /= np.ceil(range_kpa / _LARGEST_KPA)
    if not around.pressure.measured or range_kpa < _HEADROOM * largest_kpa:
        range_kpa = _LARGEST_KPA
    return SpaRigFormat(
        around.sampling,
        converter,
        PressureSensor(kpa_at_ends=(0.0, round(float(range_kpa), 6))),
        around.pressure.resolution_kpa,
        min(around.pressure.lag_s, _SLOWEST_BOARD_S),
        BoardClock(-rng.uniform(700.0, 4700.0), jitter_us=0.0),  # on before the first log
        bytes(rng.choice([b"\n", b"\r\n"])),
    )


def draw_trial_format(asked: Asked, board: SpaRigFormat) -> LogFormat:
    """Draw how trials are written.

    By the board where it can: where the sensor is calibrated, and where its converter resolves
    the pressure as finely as is asked.
    """
    rng, around = asked.stream("log format"), asked.surroundings
    calibrated, pressure = around.calibration.kind != "none", around.pressure
    kpa_per_count = board.pressure_sensor.kpa_at_ends[1] / (0.8 * board.converter.maximum)
    too_coarse = pressure.measured and kpa_per_count > 1.001 * pressure.resolution_kpa
    csv = rng.random() < 0.25
    if calibrated and not too_coarse and not csv:
        return board
    return CsvFormat(
        around.sampling,
        delimiter=str(rng.choice([",", ";", "\t"])),
        header=bool(rng.random() < 0.7),
        time_unit=str(rng.choice(["s", "ms"])),
        angle_unit="1" if calibrated else str(rng.choice(["deg", "rad"])),
        measured=pressure.measured,
        resolution_kpa=pressure.resolution_kpa,
        pressure_lag_s=pressure.lag_s,
    )
