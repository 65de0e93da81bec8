"""Estimates with their uncertainty, and how many digits of them mean something."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spa_fo.errors import BadInput
from spa_fo.plant.model_file import Model
from spa_fo.plant.transfer_function import PARAMETERS

QUANTITIES = (*PARAMETERS, "K")
"""The parameters, and the static gain K = b0/a0."""
KEY = "uncertainty"
"""Key of a model file that holds its estimates' uncertainty."""


@dataclass(frozen=True)
class Estimate:
    """One quantity of a model and how well it is known.

    Attributes
    ----------
    name : str
        One of `QUANTITIES`.
    value : float
        In its unit: orders and a1, a0, b0 as G(s) has them, K in rad for u = 1.
    error : float or None
        Standard error; None where it is not known, or means nothing (on a bound).
    low, high : float or None
        Ends of the interval; None where there is none.
    open_low, open_high : bool
        Whether a bound of the search, not the data, ended it there.
    kind : str
        What error and interval are; empty where nothing is known.
    determined : bool or None
        Whether the data determine it; None where that is not known.
    """

    name: str
    value: float
    error: float | None = None
    low: float | None = None
    high: float | None = None
    open_low: bool = False
    open_high: bool = False
    kind: str = ""
    determined: bool | None = None

    @property
    def unit(self) -> str:
        """Physical unit, empty for an order."""
        return _UNITS[self.name]

    @property
    def half_width(self) -> float | None:
        """Standard error, or half of the interval where there is no standard error."""
        if self.error is not None:
            return self.error
        if self.low is not None and self.high is not None:
            return 0.5 * (self.high - self.low)
        return None

    def text(self) -> str:
        """Write value ± error, or the value with the digits that its interval allows."""
        if self.error is not None and self.error > 0.0:
            return plus_minus(self.value, self.error)
        return rounded(self.value, self.half_width)

    def interval_text(self) -> str:
        """Write the interval; an open end is marked. Empty where there is none."""
        if self.low is None or self.high is None:
            return ""
        spread = 0.5 * (self.high - self.low)
        low, high = rounded(self.low, spread), rounded(self.high, spread)
        return f"{'(open) ' * self.open_low}{low} .. {high}{' (open)' * self.open_high}"


_UNITS = {
    "alpha2": "",
    "alpha1": "",
    "a1": "s^(alpha1-alpha2)",
    "a0": "s^-alpha2",
    "b0": "rad s^-alpha2",
    "K": "rad",
}


def plus_minus(value: float, error: float) -> str:
    """Write a value and its standard error, both to the digits that the error justifies.

    The error keeps two digits where its three leading ones are at most 354 and otherwise one, as
    the Particle Data Group rounds (Review of Particle Physics, Introduction 5.3,
    doi:10.1103/PhysRevD.110.030001).
    """
    decimals = _decimals(error)
    upwards = error * (1.0 + 1e-9)  # 0.95 is a little less in binary
    return f"{_fixed(value, decimals)} ± {_fixed(upwards, decimals)}"


def rounded(value: float, error: float | None = None) -> str:
    """Write a value with the digits that an error justifies; four digits where it has none."""
    if error is None or not 0.0 < error < math.inf:
        return f"{value:.4g}"
    return _fixed(value, _decimals(error))


def _decimals(error: float) -> int:
    leading = math.floor(math.log10(error))
    first_three = round(error / 10.0 ** (leading - 2))
    return (1 if first_three <= 354 or first_three >= 950 else 0) - leading - (first_three >= 950)


def _fixed(value: float, decimals: int) -> str:
    return f"{round(value, decimals):.{max(decimals, 0)}f}"


def bare_estimates(model: Model) -> tuple[Estimate, ...]:
    """Return the values of `QUANTITIES`, without any uncertainty."""
    values = [*model.transfer_function.as_array().tolist(), model.transfer_function.gain]
    return tuple(Estimate(name, value) for name, value in zip(QUANTITIES, values, strict=True))


def uncertainty_entry(estimates: Sequence[Estimate]) -> dict[str, Any]:
    """Return what a model file holds under `KEY`."""
    entries = {}
    for estimate in estimates:
        entry: dict[str, Any] = {"error": estimate.error}
        if estimate.low is not None:
            entry["interval"] = [estimate.low, estimate.high]
            entry["open"] = [estimate.open_low, estimate.open_high]
        if estimate.determined is not None:
            entry["determined"] = estimate.determined
        entries[estimate.name] = entry
    return {"kind": estimates[0].kind, **entries}


def read_estimates(model: Model, source: Path | str = "model") -> tuple[Estimate, ...]:
    """Return `QUANTITIES` with the uncertainty that the model file holds, if any.

    Raises
    ------
    BadInput
        The entry is not what `uncertainty_entry` wrote; the text names the key.
    """
    bare = bare_estimates(model)
    if KEY not in model.extra:
        return bare
    stored = model.extra[KEY]
    if not isinstance(stored, Mapping) or not isinstance(stored.get("kind"), str):
        raise BadInput(source, "expected an object with the kind of its intervals", KEY)
    return tuple(_read(estimate, stored, source) for estimate in bare)


def _read(bare: Estimate, stored: Mapping[str, Any], source: Path | str) -> Estimate:
    where = f"{KEY}.{bare.name}"
    entry = stored.get(bare.name)
    if not isinstance(entry, Mapping):
        raise BadInput(source, "expected an object with error or interval", where)
    error, interval = entry.get("error"), entry.get("interval", [None, None])
    opened = entry.get("open", [False, False])
    if not _is_list(interval) or not _is_list(opened):
        raise BadInput(source, "expected two values", f"{where}.interval")
    for value in (error, *interval):
        if not (value is None or (_is_number(value) and math.isfinite(value))):
            raise BadInput(source, f"expected finite numbers, found {value!r}", where)
    low, high = interval
    return Estimate(
        bare.name,
        bare.value,
        error,
        low,
        high if low is not None else None,
        bool(opened[0]),
        bool(opened[1]),
        stored["kind"],
        entry.get("determined"),
    )


def _is_list(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
