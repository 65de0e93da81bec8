"""Made-up logs in the habits of the programs that people log with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

import campaigns
from spa_fo import simulate

RATE_HZ = 25.0
BEGUN = datetime(2026, 3, 4, 14, 5, 6)


@dataclass(frozen=True)
class Signals:
    """One trial: time (s), command and pressure (kPa), angle (deg), all of shape (n,)."""

    t: np.ndarray
    command: np.ndarray
    pressure: np.ndarray
    angle: np.ndarray
    begun: datetime = BEGUN


def driven(command: np.ndarray, seed: int = 0, minutes: float = 0.0) -> Signals:
    """Return what a linear actuator does under a command at 25 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(command.size) / RATE_HZ
    angle = np.degrees(
        simulate(t, command / campaigns.REFERENCE_KPA, **campaigns.TRUTH, hold="zero")
    ) + rng.normal(0.0, 0.2, t.size)
    lag = np.exp(-np.arange(50) / 5.0)
    pressure = np.convolve(command, lag / lag.sum())[: t.size] + rng.normal(0.0, 0.05, t.size)
    return Signals(t, command, pressure, angle, BEGUN + timedelta(minutes=minutes))


def table(
    signals: Signals,
    names: str,
    delimiter: str,
    *,
    decimal: str = ".",
    stamp: Callable[[datetime], str] | None = None,
    columns: Sequence[str] = ("t", "command", "pressure", "angle"),
    factors: Sequence[float] = (1.0, 1.0, 1.0, 1.0),
) -> str:
    """Write names and rows; `stamp` writes the time, `factors` are units in those of `Signals`."""
    lines = [names]
    for i, t in enumerate(signals.t.tolist()):
        values = [getattr(signals, name)[i] * f for name, f in zip(columns, factors, strict=True)]
        texts = [f"{value:.6f}".replace(".", decimal) for value in values]
        if stamp is not None:
            texts[0] = stamp(signals.begun + timedelta(seconds=t))
        lines.append(delimiter.join(texts))
    return "\n".join(lines) + "\n"


def plain(s: Signals) -> bytes:
    return table(s, "time_s,p_set_kPa,p_kPa,angle_deg", ",").encode()


def german_excel(s: Signals) -> bytes:
    """Semicolons, decimal commas, a byte-order mark, CRLF."""
    text = table(s, "Zeit [s];Soll [kPa];Druck [kPa];Winkel [°]", ";", decimal=",")
    return text.replace("\n", "\r\n").encode("utf-8-sig")


def cp1252(s: Signals) -> bytes:
    names = "Zeit [ms];Druck Soll [mbar];Druck Ist [mbar];Winkel [°]"
    text = table(s, names, ";", decimal=",", factors=(1e3, 10.0, 10.0, 1.0))
    return text.encode("cp1252")


def labview(s: Signals) -> bytes:
    """A LabVIEW measurement file: two headers, tabs, an empty last column."""
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        "Decimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tAbsolute\n"
        "Operator\tlab\nDate\t2026/03/04\nTime\t14:05:06.123456789\n***End_of_Header***\t\n\t\n"
        f"Channels\t3\t\t\t\nSamples\t{s.t.size}\t{s.t.size}\t{s.t.size}\t\n"
        "Date\t2026/03/04\t2026/03/04\t2026/03/04\t\n"
        "Y_Unit_Label\tkPa\tkPa\tdeg\t\nX_Dimension\tTime\tTime\tTime\t\n"
        "X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\n"
        "Delta_X\t0.040000\t0.040000\t0.040000\t\n***End_of_Header***\t\t\t\t\n"
    )
    names = "X_Value\tSetpoint kPa\tPressure kPa\tAngle deg\tComment"
    rows = table(s, names, "\t").replace("\n", "\t\n").replace("Comment\t", "Comment")
    return (head + rows).replace("\n", "\r\n").encode()


def iso_stamps(s: Signals) -> bytes:
    """Python's own: no fraction at a whole second."""
    return table(s, "timestamp,setpoint (psi),pressure (psi),theta (rad)", ",", stamp=str, factors=(
        1.0, 1 / 6.894757293168361, 1 / 6.894757293168361, np.pi / 180)).encode()  # fmt: skip


def german_stamps(s: Signals) -> bytes:
    def stamp(moment: datetime) -> str:
        return f"{moment:%d.%m.%Y %H:%M:%S},{moment.microsecond // 1000:03d}"

    names = "Datum/Uhrzeit;p_soll_bar;p_ist_bar;Winkel_Grad"
    return table(s, names, ";", decimal=",", stamp=stamp, factors=(1.0, 0.01, 0.01, 1.0)).encode()


def time_of_day(s: Signals) -> bytes:
    """Over midnight, behind a preamble of its own."""
    late = s.begun.replace(hour=23, minute=59, second=58)

    def stamp(moment: datetime) -> str:
        moment = late + (moment - s.begun)
        return f"{moment:%H:%M:%S}.{moment.microsecond // 1000:03d}"

    head = "Soft arm test bench\nOperator: A. B., 3 valves\n\n"
    return (head + table(s, "Time,Setpoint_KPA,Pressure_KPA,Angle_DEG", ",", stamp=stamp)).encode()


def american_stamps(s: Signals) -> bytes:
    def stamp(moment: datetime) -> str:
        return f"{moment:%m/%d/%Y %I:%M:%S}.{moment.microsecond // 1000:03d} {moment:%p}"

    names = "Time,Command (psig),Pressure (psig),Bend (degrees)"
    return table(s, names, ",", stamp=stamp, factors=(
        1.0, 1 / 6.894757293168361, 1 / 6.894757293168361, 1.0)).encode()  # fmt: skip


def row_of_units(s: Signals) -> bytes:
    names = "Time\tCommand\tPressure\tAngle\ns\tMPa\tMPa\tmrad"
    factors = (1.0, 1e-3, 1e-3, 1e3 * np.pi / 180)
    return table(s, names, "\t", factors=factors).encode()


def utf16(s: Signals) -> bytes:
    """Excel's Unicode text."""
    return table(s, "t [µs]\tp_soll [hPa]\tp [hPa]\tWinkel [°]", "\t", decimal=",", factors=(
        1e6, 10.0, 10.0, 1.0)).encode("utf-16")  # fmt: skip


def quoted(s: Signals) -> bytes:
    """Every field in quotes, decimal commas between commas."""
    rows = table(s, "t_s|cmd_kPa|p_kPa|angle_deg", "|", decimal=",").splitlines()
    return "\n".join(",".join(f'"{f}"' for f in row.split("|")) for row in rows).encode() + b"\n"


HABITS: dict[str, Callable[[Signals], bytes]] = {
    habit.__name__: habit
    for habit in (
        plain, german_excel, cp1252, labview, iso_stamps, german_stamps, time_of_day,
        american_stamps, row_of_units, utf16, quoted,
    )
}  # fmt: skip


def command(*pieces: tuple[float, float]) -> np.ndarray:
    """Return levels held for some seconds each: pairs of seconds and kPa."""
    return np.concatenate([np.full(round(s * RATE_HZ), kpa) for s, kpa in pieces])


def write_folder(folder: Path, habit: Callable[[Signals], bytes], suffix: str = ".csv") -> Path:
    """Write three steps of 28 kPa, one of 50 kPa and a staircase, ten minutes apart."""
    folder.mkdir(parents=True, exist_ok=True)
    stairs = command((1, 0), (4, 10), (4, 20), (4, 30), (4, 20), (4, 0))
    step, high = command((1, 0), (10, 28), (5, 0)), command((1, 0), (10, 50), (5, 0))
    for i, one in enumerate((step, high, step, stairs, step)):
        (folder / f"run_{i + 1:02d}{suffix}").write_bytes(habit(driven(one, i, 10.0 * i)))
    return folder
