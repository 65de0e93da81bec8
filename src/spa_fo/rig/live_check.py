"""Does the rig measure what it should? One plain sentence a finding, before a day is lost.

Everything is judged on one short log: at rest, under a modest pressure, vented. The thresholds are
those of a 10-bit board with a ratiometric pressure sensor and a flex sensor in a divider.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from spa_fo.arrays import Floats
from spa_fo.rig.calibration import Calibration
from spa_fo.rig.campaign import PressureSensor
from spa_fo.rig.spa_rig_log import SpaRigLog

Level = Literal["ok", "warning", "fault"]

USUAL_SENSOR = PressureSensor((0.5, 4.5), (0.0, 551.6), 5000, 1023)

_RATE_OFF = 0.01  # of the banner's
_JITTER = (0.05, 0.5)  # of a period, 99 % of the samples: noticeable, bad
_LOST = (0.0005, 0.02)  # share of the samples
_NOISE_COUNTS = (2.5, 10.0)  # of 1023
_RAILED = (0.001, 0.5)  # share of the samples
_REST_KPA = (6.0, 30.0)  # that a vented sensor may be off
_FOLLOWS = (0.8, 1.25)  # settled pressure over command
_REACTS = 0.2  # of the command: less is no reaction
_SLOW_S = 2.0  # to half the command
_BEND_COUNTS = 2.0
_COPY_COUNTS = 3.0


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    level : str
        ``ok``, ``warning`` or ``fault``.
    what : str
        What was looked at, a word or two.
    words : str
        What was found and, where it is not ok, what is likely wrong.
    """

    level: Level
    what: str
    words: str

    def __str__(self) -> str:
        return f"{self.level:<8}{self.what:<10}{self.words}"


def check_log(
    log: SpaRigLog, sensor: PressureSensor = USUAL_SENSOR, curve: Calibration | None = None
) -> list[Finding]:
    """Check a rig by one log.

    Parameters
    ----------
    log : SpaRigLog
        Of a trial or of a calibration; of the command at least one step for the last checks.
    sensor : PressureSensor
        Turns counts into kPa.
    curve : Calibration, optional
        Turns flex counts into degrees.

    Returns
    -------
    list of Finding
        In the order of the signal: board, line, channels, pressure, bending.
    """
    found = [*_timing(log), *_line(log)]
    for column, name in (("p_adc", "pressure"), ("flex_adc", "flex")):
        if column in log.columns:
            found += _channel(log, column, name)
    if {"p_adc", "flex_adc"} <= set(log.columns):
        found += _copy(log)
    if {"cmd_kpa", "p_adc"} <= set(log.columns):
        found += _pressure(log, sensor)
    if {"cmd_kpa", "flex_adc"} <= set(log.columns):
        found += _bending(log, curve)
    return found


def _graded(value: float, limits: tuple[float, float]) -> Level:
    return "ok" if value <= limits[0] else "warning" if value <= limits[1] else "fault"


# --- the board and the line -----------------------------------------------------------------------


def _timing(log: SpaRigLog) -> Iterator[Finding]:
    together = (np.diff(log.seq) == 1) & (np.diff(log.segment) == 0)
    steps = np.diff(log.t_s)[together]
    nominal = 1.0 / log.banner.rate_hz
    if steps.size < 10:
        yield Finding("fault", "rate", f"only {log.t_s.size} samples: too few to check anything")
        return
    period = float(np.median(steps))
    off = abs(nominal / period - 1.0)
    words = f"{1.0 / period:.2f} Hz, the banner says {log.banner.rate_hz:g} Hz"
    if off > _RATE_OFF:
        words += ": the board is too busy to keep its rate, or its crystal is off"
    yield Finding("fault" if off > _RATE_OFF else "ok", "rate", words)
    jitter = float(np.quantile(np.abs(steps - period), 0.99))
    level = _graded(jitter / period, _JITTER)
    words = f"{jitter * 1e6:.0f} us (99 % of the samples within)"
    if level != "ok":
        words += ": samples are not taken by the timer; something blocks the board's loop"
    yield Finding(level, "jitter", words)


def _line(log: SpaRigLog) -> Iterator[Finding]:
    report = log.report
    expected = log.t_s.size + report.missing_samples
    level = _graded(report.missing_samples / expected, _LOST)
    words = (
        f"{report.missing_samples} of {expected} samples lost, {report.damaged_lines} damaged lines"
    )
    if level != "ok":
        words += (
            f" ({report.why()})" if report.damaged_lines else " in whole lines"
        ) + ": a bad cable or hub, or a line too slow for this rate"
    yield Finding(level, "line", words)
    if report.resets:
        yield Finding(
            "fault",
            "power",
            f"the board reset itself {_times(report.resets)}: its supply dips, likely when pump or "
            "valve switch; feed them from a supply of their own, with a common ground",
        )
    if report.pauses and "cmd_kpa" in log.columns:
        yield Finding(
            "warning", "line", f"the board stopped sampling {_times(report.pauses)} for a while"
        )


# --- the channels ---------------------------------------------------------------------------------


def _channel(log: SpaRigLog, column: str, name: str) -> Iterator[Finding]:
    counts = log.columns[column]
    scale = (log.banner.adc_max + 1) / 1024.0
    for rail, value, reason in (
        ("full scale", log.banner.adc_max, "its ground lead is off, or it is shorted to 5 V"),
        ("0", 0, "its 5 V lead or signal lead is off, or it is shorted to ground"),
    ):
        share = float(np.mean(counts == value))
        level = _graded(share, _RAILED)
        if level != "ok":
            how = "throughout" if share == 1.0 else f"in {100.0 * share:.1f} % of the samples"
            if level == "warning":
                reason = "a loose contact"
            yield Finding(level, name, f"{column} reads {rail} {how}: {reason}")
            if level == "fault":
                return
    noise = _noise(log, counts)
    driven = np.ptp(log.columns.get("cmd_kpa", np.zeros(1))) > 0.0
    tail = _frozen(counts)
    if tail == counts.size and (driven or counts.size >= 100):
        level = "fault" if driven else "warning"
        yield Finding(
            level,
            name,
            f"{column} reads {counts[0]:.0f} throughout, not one count of noise: a dead channel; "
            "is the signal on another pin?",
        )
        return
    if driven and tail > max(100, 0.3 * counts.size) and noise > 0.2:
        yield Finding(
            "fault",
            name,
            f"{column} sticks at {counts[-1]:.0f} from {log.t_s[counts.size - tail]:.1f} s on: "
            "the sensor or its converter died in mid-run",
        )
        return
    level = _graded(noise / scale, _NOISE_COUNTS)
    words = f"{column} {counts[: _first_change(log)].mean():.0f} at rest, noise {noise:.1f} counts"
    if level != "ok":
        words += ": a loose contact, a lead beside those of the pump, or no common ground"
    yield Finding(level, name, words)


def _copy(log: SpaRigLog) -> Iterator[Finding]:
    pressure, flex = log.columns["p_adc"], log.columns["flex_adc"]
    if np.ptp(pressure) >= 3.0 * _COPY_COUNTS and np.all(
        np.abs(_smooth(pressure) - _smooth(flex)) < _COPY_COUNTS
    ):
        yield Finding(
            "fault",
            "flex",
            "flex_adc copies p_adc: its input floats and repeats what the converter read before; "
            "the divider is not connected, or both signals are on one pin",
        )


# --- what the command does ------------------------------------------------------------------------


def _pressure(log: SpaRigLog, sensor: PressureSensor) -> Iterator[Finding]:
    pressure = sensor.pressure_kpa(log.columns["p_adc"])
    rest, high = _levels(log)
    zero = float(np.median(pressure[rest])) if rest.any() else float("nan")
    if rest.any():
        level = _graded(abs(zero), _REST_KPA)
        words = f"{zero:.1f} kPa at rest"
        if level != "ok":
            words += (
                ": it should be 0 when vented; wrong numbers in pressure_sensor, no 5 V at the "
                "sensor, pressure left in the line, or the signals of A0 and A1 swapped"
            )
        yield Finding(level, "zero", words)
    if not high.any() or not rest.any():
        yield Finding("warning", "pressure", "not tried: the log holds no step of the command")
        return
    command = float(log.columns["cmd_kpa"].max())
    reached = float(np.median(pressure[high])) - zero
    share = reached / command
    words = f"{reached:.1f} kPa above rest at a command of {command:.1f} kPa"
    if share < -_REACTS:
        yield Finding(
            "fault",
            "pressure",
            f"{words}: it falls when the command rises; the sensor's ports are swapped",
        )
    elif share < _REACTS:
        yield Finding(
            "fault",
            "pressure",
            f"{words}: it does not follow; the tube is off, pump or valve have no power, or the "
            "sensor is not on the pin of p_adc",
        )
    elif not _FOLLOWS[0] <= share <= _FOLLOWS[1]:
        yield Finding(
            "warning",
            "pressure",
            f"{words}: a leak or a weak supply if it is too low; else wrong numbers in "
            "pressure_sensor",
        )
    else:
        yield _promptness(log, pressure - zero, command, words)


def _promptness(log: SpaRigLog, pressure: Floats, command: float, words: str) -> Finding:
    up = int(np.argmax(log.columns["cmd_kpa"] >= 0.99 * command))
    half = np.flatnonzero(pressure[up:] >= 0.5 * command)
    late = float(log.t_s[up + half[0]] - log.t_s[up]) if half.size else float("inf")
    begun = int(np.argmax(log.columns["cmd_kpa"] > 0.0))
    ramped = log.t_s[up] - log.t_s[begun] > 1.0
    if late > _SLOW_S and not ramped:
        return Finding(
            "warning",
            "pressure",
            f"{words}, but {late:.1f} s late: a kinked or narrow tube, or a weak pump",
        )
    return Finding("ok", "pressure", f"{words}, half of it after {late:.2f} s")


def _bending(log: SpaRigLog, curve: Calibration | None) -> Iterator[Finding]:
    flex = log.columns["flex_adc"]
    rest, high = _levels(log)
    if not high.any() or not rest.any():
        return
    moved = float(np.median(flex[high]) - np.median(flex[rest]))
    noise = max(_noise(log, flex), 0.3)
    least = max(_BEND_COUNTS, 3.0 * noise / np.sqrt(min(rest.sum(), high.sum())))
    words = f"flex_adc moves by {moved:+.0f} counts under pressure"
    if abs(moved) < least:
        yield Finding(
            "warning",
            "bending",
            f"{words}: nothing to speak of; the actuator does not bend, or the flex sensor is not "
            "in its pocket",
        )
        return
    if curve is not None:
        turned = float(
            curve.angle_deg(np.median(flex[high])) - curve.angle_deg(np.median(flex[rest]))
        )
        words += f", {turned:+.1f} deg by {curve.file}"
        if turned < 0.0:
            yield Finding(
                "fault",
                "bending",
                f"{words}: the angle falls when the pressure rises; the sensor sits the wrong way "
                "round, or was calibrated bent the other way",
            )
            return
    elif moved < 0.0:
        yield Finding(
            "warning",
            "bending",
            f"{words}: they fall when it bends; the divider is upside down or the sensor sits face "
            "down, which is harmless if it is calibrated in the same way",
        )
        return
    yield Finding("ok", "bending", words)


# --- shared by the checks -------------------------------------------------------------------------


def _first_change(log: SpaRigLog) -> int:
    """Count the samples before the command first changes; all where it never does."""
    command = log.columns.get("cmd_kpa")
    if command is None:
        angle = log.columns.get("angle_deg", np.zeros(log.t_s.size))
        command = angle
    moved = np.flatnonzero(command != command[0])
    return int(moved[0]) if moved.size and moved[0] >= 5 else command.size


def _noise(log: SpaRigLog, counts: Floats) -> float:
    """Scatter of one sample (counts), from neighbours at rest: drift does not count."""
    rest = counts[: _first_change(log)]
    if rest.size < 2:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(rest) ** 2) / 2.0))


def _frozen(counts: Floats) -> int:
    """Count the last readings that are all the same."""
    other = np.flatnonzero(counts != counts[-1])
    return counts.size - (int(other[-1]) + 1 if other.size else 0)


def _levels(log: SpaRigLog) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Mark the samples at rest before the first pressure, and the settled ones at the largest."""
    command, t = log.columns["cmd_kpa"], log.t_s
    none = np.zeros(t.size, dtype=np.bool_)
    on = command > 0.0
    if not on.any():
        return ~on, none
    rest = none.copy()
    rest[: int(np.argmax(on))] = True
    high = command >= 0.99 * command.max()
    begins, ends = _longest_run(high)
    settled = none.copy()
    settled[begins + (ends - begins) // 2 : ends] = True
    return rest, settled


def _longest_run(mask: npt.NDArray[np.bool_]) -> tuple[int, int]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    runs = edges.reshape(-1, 2)
    begin, end = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int(begin), int(end)


def _smooth(counts: Floats) -> Floats:
    width = min(5, counts.size)
    return np.asarray(np.convolve(counts, np.full(width, 1.0 / width), mode="valid"))


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
