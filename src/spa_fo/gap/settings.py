"""Every number that a verdict depends on: its unit, where it comes from, and why.

An origin is one of

derived
    follows from something else, by the reason given;
learned
    from opened cases in drawn surroundings, never from those that judge;
measured
    on real actuators or on this machine;
assumed
    set by hand: a debt.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, Literal

Origin = Literal["derived", "learned", "measured", "assumed"]


def _number(value: float, unit: str, origin: Origin, reason: str) -> Any:
    return field(default=value, metadata={"unit": unit, "origin": origin, "reason": reason})


@dataclass(frozen=True)
class Settings:
    """The numbers; their meaning stands in each field's metadata."""

    # --- noise -----------------------------------------------------------------------------------
    coloured_deg: float = _number(
        0.05, "deg", "assumed", "prior median of each coloured part: half-way between quiet benches"
    )
    coloured_factor: float = _number(
        4.0, "1", "assumed", "prior spread of it, as a factor: from quiet to rough benches"
    )
    scatter: float = _number(
        0.01, "1", "assumed", "prior, of a trial's gain and of its time scale: an ordinary bench"
    )
    rest_scatter_deg: float = _number(0.2, "deg", "assumed", "prior: an ordinary bench")
    dwell_error_deg: float = _number(0.15, "deg", "assumed", "a fixture made with care")
    most_scatter: float = _number(
        6.0, "times", "assumed", "an ordinary scatter, or the fixture's error, is at most larger by"
    )
    level_alone: float = _number(
        0.65, "nat", "learned", "spread of ln(noise level) without repeats, in drawn surroundings"
    )
    level_repeated: float = _number(
        0.5, "nat", "learned", "the same with one repeat; falls with the root of their number"
    )
    # --- the given model -------------------------------------------------------------------------
    response_error: float = _number(
        0.003, "1", "learned", "error of the given model's step response, of its final value"
    )
    model_trials: float = _number(
        8.0, "trials", "learned", "the given model's gain and time scale are the mean of so many"
    )
    model_error: float = _number(
        0.36, "1", "learned", "error of an identified model's response, of what its residual says"
    )
    own_orders: float = _number(
        0.3, "1", "assumed", "prior spread of the orders about a typical actuator's"
    )
    own_logs: float = _number(1.0, "nat", "assumed", "the same of ln a1 and ln a0")
    own_gain: float = _number(0.4, "nat", "assumed", "the same of the static gain's logarithm")
    shift_orders: float = _number(0.05, "1", "assumed", "what another specimen differs by: orders")
    shift_logs: float = _number(0.2, "nat", "assumed", "the same of ln a1 and ln a0")
    shift_gain: float = _number(0.12, "nat", "assumed", "the same of the static gain's logarithm")
    # --- the pressure ----------------------------------------------------------------------------
    pressure_offset_kpa: float = _number(0.4, "kPa", "assumed", "zero of a pressure sensor")
    pressure_gain: float = _number(
        0.004, "1", "assumed", "gain error of a pressure sensor, and prior of a regulator's scatter"
    )
    pressure_lag_s: float = _number(0.03, "s", "assumed", "lag of a pressure sensor")
    angle_late_s: float = _number(0.006, "s", "assumed", "timing error of the log")
    # --- model discrepancy -----------------------------------------------------------------------
    search_share: float = _number(
        0.05, "of the gap", "learned", "model discrepancy while an explanation is fitted"
    )
    right_share: float = _number(
        0.08, "of the gap", "learned", "scale of the discrepancy of a right form, exponential"
    )
    drive_share: float = _number(
        0.04, "of the gap", "learned", "the same of a drive whose pressure was measured"
    )
    # --- prior and evidence ----------------------------------------------------------------------
    temper: float = _number(
        0.15,
        "1",
        "learned",
        "power of the tempered evidence; 0.1 to 1 moves little",
    )
    none: float = _number(
        0.5, "probability", "learned", "prior of none in the drive, and of none in the angle: even"
    )
    nothing: float = _number(
        0.33,
        "odds",
        "learned",
        "prior of no gap, of what both together make it: a fifth of other hands' cases have none",
    )
    single: float = _number(0.35, "probability", "assumed", "prior of one effect")
    unknown: float = _number(
        0.6, "odds", "learned", "prior: a set compensates for another cause, or one is beside it"
    )
    shift_beside: float = _number(
        0.07, "odds", "learned", "prior of a shift beside another effect: mostly compensating"
    )
    # --- what counts -----------------------------------------------------------------------------
    needed: float = _number(
        0.2, "noise floors", "learned", "a member without which the others do as well is none"
    )
    of_all: float = _number(
        0.2,
        "of what the set moves",
        "learned",
        "a member that moves less, or is needed for less, may be a compensating term",
    )
    left: float = _number(
        0.3, "noise floors", "learned", "a smaller systematic residual is no evidence of anything"
    )
    no_gap: float = _number(
        0.4,
        "noise floors",
        "learned",
        "a smaller systematic residual is no gap; what moves the angle by less is no effect",
    )
    # --- the answer ------------------------------------------------------------------------------
    covered: float = _number(0.93, "probability", "learned", "total of the sets that are named")
    least: float = _number(0.1, "probability", "learned", "below which a set is not listed")
    doubt: float = _number(
        0.6,
        "odds",
        "learned",
        "of an unknown cause to all names, above which it is the answer: a wrong name costs more",
    )
    failed: float = _number(
        0.05,
        "probability",
        "learned",
        "all of this reasoning fails: any kind of answer, then; a name, once more: unknown",
    )
    worth: float = _number(
        0.33,
        "of the gap",
        "learned",
        "what closes less on held-out trials is no cause, and no part of one",
    )
    gains: float = _number(
        0.1, "of the gap", "assumed", "what closes by less more than something else is no better"
    )

    @property
    def pair(self) -> float:
        """Prior of two effects: what none and one leave."""
        return 1.0 - self.none - self.single

    def listed(self) -> Iterator[tuple[str, float, str, str, str]]:
        """Yield name, value, unit, origin and reason of each."""
        for each in fields(self):
            meta = each.metadata
            yield each.name, getattr(self, each.name), meta["unit"], meta["origin"], meta["reason"]


SETTINGS = Settings()
