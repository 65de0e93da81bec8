"""Guess what the columns of a foreign log mean: by their names, else by how they move."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.rig.column_traits import BY_NAME, ColumnTraits, traits_of, written_unit
from spa_fo.rig.csv_log import longest_increasing
from spa_fo.rig.delimited import Table
from spa_fo.rig.log_format import DATETIME, Column

_TIME_UNITS = ("s", "ms", "us", DATETIME)
_PRESSURE_UNITS = ("Pa", "hPa", "kPa", "bar", "psi")
_ANGLE_UNITS = ("deg", "rad")
_ATMOSPHERE = {"Pa": 101_325.0, "hPa": 1013.25, "kPa": 101.325}  # bar and psi: too near 1 and 15
_PLAUSIBLE_RATES_HZ = (4.0, 5000.0)
_FINE = 0.5  # share of rows with a time of their own, below which a clock is a coarse one
_MOVED = 0.02  # of a command's range
_DEGREES_AT_LEAST = 3.5  # an angle that reaches farther is none in rad


@dataclass(frozen=True)
class Guess:
    """What a column may be, and why; `rivals` are 0-based places that would do as well."""

    place: int
    column: Column
    why: str
    rivals: tuple[int, ...] = ()


def guess_columns(table: Table) -> dict[str, Guess]:
    """Guess the columns of a log by role, in the order of campaign.yaml.

    Names come first, units within them (``time_ms``, ``p [kPa]``) or below them; where there are
    none, a clock is what rises, a command what stays at few levels, a pressure what rests at
    the atmosphere's, an angle what rests near 0 and sweeps tens of degrees, a flex count a whole
    number that does not rest there.

    Parameters
    ----------
    table : Table
        As read by `read_table`.

    Returns
    -------
    dict of str to Guess
        Without a key ``time`` where nothing rises.
    """
    units = [written_unit(table, place) for place in range(table.width)]
    scales = [1.0 if unit is None else unit.scale for unit in units]
    table = dataclasses.replace(table, values=table.values * scales)
    looks = [
        look for i, unit in enumerate(units) if (look := traits_of(table, i, unit)) is not None
    ]
    found: dict[str, Guess] = {}
    clock = _guess_time(looks, table)
    if clock is None:
        return found
    found["time"] = clock
    rest = [look for look in looks if look.place != clock.place]
    for role, guess in (
        ("command", _guess_command),
        ("pressure", _guess_pressure),
        ("angle", _guess_angle),
        ("flex_adc", _guess_flex),
    ):
        chosen = guess(rest, table, found)
        if chosen is not None:
            found[role] = chosen
            rest = [look for look in rest if look.place != chosen.place]
    return found


def rest_rows(values: Floats) -> int:
    """Count the rows before a command first leaves its first value; `values` may hold nan."""
    finite = np.flatnonzero(np.isfinite(values))
    if not finite.size:
        return 0
    moved = np.abs(values - values[finite[0]]) > _MOVED * np.ptp(values[finite])
    return int(np.argmax(moved)) if moved.any() else int(values.size)


def _guess_time(looks: Sequence[ColumnTraits], table: Table) -> Guess | None:
    rising = [look for look in looks if look.measures("time") and _rises(look)]
    if not rising:
        return None
    look = max(
        rising,
        key=lambda one: (
            one.fineness > _FINE,
            _is_clock_name(one),
            not _counts_rows(one),
            -one.place,
        ),
    )
    unit, why = _time_unit(look)
    if look.fineness <= _FINE:
        why += f"; UNSURE: {1.0 / look.fineness:.3g} rows share a time, of which one is kept"
    rivals = tuple(one.place for one in rising if one is not look)
    column = look.column(unit)
    if unit == DATETIME:
        column = dataclasses.replace(column, format=table.stamps[look.place].format)
    return Guess(look.place, column, why, rivals)


def _is_clock_name(look: ColumnTraits) -> bool:
    return look.unit in _TIME_UNITS or (look.named("time") and look.written is None)


def _rises(look: ColumnTraits) -> bool:
    """Say whether a column rises on the whole, some backward or repeated rows allowed."""
    steps = np.diff(look.values)
    need = 0.5 if _is_clock_name(look) else 0.9
    forward = np.count_nonzero(steps > 0.0) / steps.size
    if _is_clock_name(look) and np.all(steps >= 0.0) and steps.any():
        return True
    return bool(
        forward >= need and len(longest_increasing(look.values.tolist())) >= need * look.values.size
    )


def _counts_rows(look: ColumnTraits) -> bool:
    return bool(np.all(np.diff(look.values) == 1.0))


def _time_unit(look: ColumnTraits) -> tuple[str, str]:
    if look.unit == DATETIME:
        doubt = look.written.doubt if look.written is not None else ""
        return look.unit, "it holds dates and times" + (f"; UNSURE: {doubt}" if doubt else "")
    if look.unit in _TIME_UNITS:
        return look.unit, look.why() if look.words else look.why().replace("name", "unit", 1)
    steps = np.diff(look.values)
    step = float(np.median(steps[steps > 0.0]))
    rates = {"s": 1.0 / step, "ms": 1e3 / step, "us": 1e6 / step}
    low, high = _PLAUSIBLE_RATES_HZ
    # Seconds have digits behind the point, at any rate worth logging.
    order = ("s", "ms", "us") if step < 1.0 else ("ms", "us", "s")
    unit = next((unit for unit in order if low <= rates[unit] <= high), order[0])
    return unit, f"it rises; {rates[unit]:.4g} rows a second if in {unit}"


def _guess_command(
    looks: Sequence[ColumnTraits], table: Table, found: Mapping[str, Guess]
) -> Guess | None:
    named = [
        look
        for look in looks
        if look.named("command")
        and not look.named("flex_adc")
        and look.unit not in _ANGLE_UNITS + _TIME_UNITS
    ]
    moving = [look for look in named if look.moves()]
    steps = [look for look in looks if look.measures("pressure") and _is_stepwise(look)]
    steps = [] if named else steps
    look = next(iter([*moving, *named, *steps]), None)
    if look is None:
        return None
    unit = look.unit if look.unit in _PRESSURE_UNITS else "1"
    why = look.why() if named else f"it keeps to {np.unique(look.values).size} levels"
    if unit == "1":
        why += f"; UNSURE: unit unknown, {look.values.min():g} to {look.values.max():g}"
    first = float(look.values[0])
    offset = -first if unit != "1" and look.moves() and first == look.values.min() else 0.0
    if offset:
        why += f"; rests at {first:g}"
    rivals = tuple(one.place for one in (moving if named else steps) if one is not look)
    return Guess(look.place, look.column(unit, offset), why, rivals)


def _is_stepwise(look: ColumnTraits) -> bool:
    levels = np.unique(look.values)
    wide = np.ptp(look.values) > 0.2 * np.abs(look.values).max()
    return bool(
        2 <= levels.size <= max(4, 0.02 * look.values.size) and look.repeats > 0.95 and wide
    )


def _guess_pressure(
    looks: Sequence[ColumnTraits], table: Table, found: Mapping[str, Guess]
) -> Guess | None:
    named = [
        look
        for look in looks
        if (look.named("pressure") or look.unit in _PRESSURE_UNITS) and not look.named("command")
    ]
    absolute = [] if named else [look for look in looks if look.moves() and _atmosphere(look)]
    candidates = [look for look in named if look.moves()] or absolute
    if not candidates:
        return None
    look = _most_alike(candidates, table, found.get("command"))
    rivals = tuple(one.place for one in candidates if one is not look)
    unit = look.unit if look.unit in _PRESSURE_UNITS else ""
    command = found.get("command")
    rest = _rest_value(table, look, command)
    outside = _atmosphere(look)
    if outside is not None and unit in ("", outside[0]):
        unit, low = outside
        zero = rest if abs(rest / low - 1.0) < 0.05 else low
        offset, why = -zero, f"it rests at the atmosphere's {zero:g} {unit}"
    else:
        why = look.why() + ("" if unit else _no_unit(look))
        offset, zero_why = _gauge_offset(look, rest, unit, command)
        why += zero_why
    unit = unit or ("kPa" if look.written is None else "1")
    return Guess(look.place, look.column(unit, offset), why, rivals)


def _no_unit(look: ColumnTraits) -> str:
    if look.written is None:
        return "; UNSURE: unit unknown, kPa assumed"
    return f"; UNSURE: {look.written.written} is no unit of pressure"


def _gauge_offset(
    look: ColumnTraits, rest: float, unit: str, command: Guess | None
) -> tuple[float, str]:
    """Take the command's zero where both have one unit, else the value at rest if far from 0."""
    if command is not None and command.column.unit == unit and command.column.offset:
        return command.column.offset, "; its zero is the command's"
    if abs(rest) > 0.05 * np.ptp(look.values):
        return -rest, f"; rests at {rest:g}"
    return 0.0, ""


def _atmosphere(look: ColumnTraits) -> tuple[str, float] | None:
    """Return unit and value where the column's low or first value is the atmosphere's."""
    for low in (float(np.percentile(look.values, 10.0)), float(look.values[0])):
        for unit, one in _ATMOSPHERE.items():
            if abs(low / one - 1.0) < 0.05:
                return unit, _round(low)
    return None


def _rest_value(table: Table, look: ColumnTraits, command: Guess | None) -> float:
    """Return the median before the command first moves; without one, a low percentile."""
    if command is not None:
        rows = rest_rows(table.values[:, command.place])
        before = table.values[:rows, look.place]
        before = before[np.isfinite(before)]
        if before.size > 0 and rows < len(table.values):
            return _round(float(np.median(before)))
    return _round(float(np.percentile(look.values, 10.0)))


def _round(value: float) -> float:
    return float(f"{value:.6g}")


def _most_alike(looks: Sequence[ColumnTraits], table: Table, command: Guess | None) -> ColumnTraits:
    """Return the column that follows the command best; the first one without a command."""
    if command is None:
        return looks[0]
    drive = table.values[:, command.place]
    return max(looks, key=lambda look: _likeness(drive, table.values[:, look.place]))


def _likeness(drive: Floats, response: Floats) -> float:
    both = np.isfinite(drive) & np.isfinite(response)
    x, y = drive[both], response[both]
    if x.size < 2 or not np.ptp(x) or not np.ptp(y):
        return 0.0
    return round(abs(float(np.corrcoef(x / np.abs(x).max(), y / np.abs(y).max())[0, 1])), 6)


def _guess_angle(
    looks: Sequence[ColumnTraits], table: Table, found: Mapping[str, Guess]
) -> Guess | None:
    named = [
        look
        for look in looks
        if (look.named("angle") or look.unit in _ANGLE_UNITS)
        and look.measures("angle")
        and not look.named("command")
        and not _is_count(look)
    ]
    swings = [] if named else [look for look in looks if _sweeps_from_zero(look, table, found)]
    swings = [look for look in swings if look.written is None and not look.named("pressure")]
    candidates = named or swings
    if not candidates:
        return None
    look = max(candidates, key=lambda one: one.range) if swings else candidates[0]
    unit = look.unit if look.unit in _ANGLE_UNITS else ""
    why = look.why() if named else "it rests near 0 and sweeps as an angle in deg may"
    if not unit:
        unit = "deg" if np.abs(look.values).max() > _DEGREES_AT_LEAST else "rad"
        if named:
            why += f"; UNSURE: unit unknown, {unit} by its size"
    driven = found.get("command") or found.get("pressure")
    rest = _rest_value(table, look, found.get("command")) if driven else 0.0
    zero = driven is not None and abs(rest) > 0.005 * np.ptp(look.values)
    if zero:
        why += f"; rests at {rest:.3g}"
    rivals = tuple(one.place for one in candidates if one is not look)
    return Guess(look.place, look.column(unit, rest="zero" if zero else "keep"), why, rivals)


def _is_count(look: ColumnTraits) -> bool:
    return look.named("flex_adc") and look.unit == ""


def _sweeps_from_zero(look: ColumnTraits, table: Table, found: Mapping[str, Guess]) -> bool:
    rest = _rest_value(table, look, found.get("command"))
    fine = np.unique(look.values).size > 20
    return bool(fine and 5.0 <= look.range <= 400.0 and abs(rest) < 0.2 * look.range)


def _guess_flex(
    looks: Sequence[ColumnTraits], table: Table, found: Mapping[str, Guess]
) -> Guess | None:
    named = [look for look in looks if look.named("flex_adc") and look.moves()]
    counts = [look for look in looks if look.written is None and _like_counts(look)]
    counts = [] if named or "angle" in found else counts
    candidates = named or counts
    if not candidates:
        return None
    look = max(candidates, key=lambda one: one.range)
    why = BY_NAME if named else "whole numbers, as an ADC gives them"
    rivals = tuple(one.place for one in candidates if one is not look)
    return Guess(look.place, Column(look.place + 1, "1"), why, rivals)


def _like_counts(look: ColumnTraits) -> bool:
    values = look.values
    whole = bool(np.all(values == np.round(values)) and values.min() >= 0 and values.max() < 65536)
    return whole and np.unique(values).size > 20 and not _is_stepwise(look)
