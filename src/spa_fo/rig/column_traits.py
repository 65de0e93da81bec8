"""One column of a foreign log at a glance: its name, its unit, and how its numbers move."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.rig.delimited import Table
from spa_fo.rig.log_format import DATETIME, Column
from spa_fo.rig.units import Kind, Unit, unit_of_name

# Words in the languages of the logs met so far, as the parts of a name: t_s is t and s.
_WORDS = {
    "time": "t time timestamp clock elapsed zeit tijd temps micros millis sec secs seconds",
    "command": "cmd command commanded setpoint set target desired des ref reference pd pwm input",
    "pressure": "p pressure press druck pressione pm gauge manifold",
    "angle": "angle bend bending theta phi pitch roll yaw winkel hoek rotation deg degrees rad",
    "flex_adc": "flex adc raw counts bendsensor",
}
BY_NAME = "its name says so"
_FEWEST = 0.05  # share of the rows that must hold a number


@dataclass(frozen=True)
class ColumnTraits:
    """One column at a glance; `values` hold its finite numbers alone."""

    place: int
    values: Floats
    words: frozenset[str]
    written: Unit | None
    share: float

    @property
    def unit(self) -> str:
        """The unit of campaign.yaml that the values are in; empty where it is not known."""
        return self.written.unit if self.written is not None else ""

    @property
    def scale(self) -> float:
        """What the raw numbers are to be multiplied by to be in `unit`."""
        return self.written.scale if self.written is not None else 1.0

    @property
    def range(self) -> float:
        """From the 1st to the 99th percentile: a dropout must not count."""
        return float(np.subtract(*np.percentile(self.values, [99.0, 1.0])))

    @property
    def repeats(self) -> float:
        """Share of the values that repeat the one before."""
        return float(np.mean(np.diff(self.values) == 0.0))

    @property
    def fineness(self) -> float:
        """Share of the rows with a value of their own."""
        return float(np.unique(self.values).size / self.values.size)

    def named(self, role: str) -> bool:
        """Say whether its name is one of a role."""
        return bool(self.words & set(_WORDS[role].split()))

    def moves(self) -> bool:
        """Say whether its values differ at all."""
        return bool(np.ptp(self.values) > 0.0)

    def measures(self, kind: Kind) -> bool:
        """Say whether its unit, where it has one, is one of `kind`."""
        return self.written is None or self.written.kind == kind

    def why(self) -> str:
        """Say what its name tells, and what of its unit is in doubt."""
        if self.written is None or self.written.kind == "other":
            return BY_NAME
        scaled = f"; {self.written.written} is {self.scale:.6g} {self.unit}"
        doubt = f"; UNSURE: {self.written.doubt}" if self.written.doubt else ""
        return BY_NAME + (scaled if self.scale != 1.0 else "") + doubt

    def column(
        self, unit: str, offset: float = 0.0, rest: Literal["zero", "keep"] = "keep"
    ) -> Column:
        """Return what campaign.yaml says of it."""
        return Column(self.place + 1, unit, self.scale, offset + 0.0, rest)


def written_unit(table: Table, place: int) -> Unit | None:
    """Read the unit of a column from its name, or from the row of units."""
    if place in table.stamps:
        return Unit("", "time", DATETIME, doubt=table.stamps[place].doubt)
    name = table.names[place] if table.names else ""
    return unit_of_name(name, table.units[place] if table.units else "")


def traits_of(table: Table, place: int, unit: Unit | None) -> ColumnTraits | None:
    """Describe a column; None where hardly a row holds a number."""
    column = table.values[:, place]
    values = column[np.isfinite(column)]
    if values.size < max(2, _FEWEST * column.size):
        return None
    words = _words(table.names[place] if table.names else "")
    return ColumnTraits(place, values, words, unit, float(values.size / column.size))


def _words(name: str) -> frozenset[str]:
    """Split a name into lower-case words: ``Time_ms``, ``tipAngle [deg]``, ``p1``."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", name)
    return frozenset(re.findall(r"[^\W\d_]+|°", apart.lower()))
