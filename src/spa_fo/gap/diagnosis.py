"""What a diagnosis says, ready for a file, a page and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.plant import Model
from spa_fo.plant.effects.effect import Reach
from spa_fo.plant.effects.library import Ids
from spa_fo.plant.law import PLACES

SCHEMA = "spa-fo/diagnosis/1"
_KEYS = (
    *("schema", "campaign", "seed", "provenance", "reference_kpa", "excluded"),
    *("gap", "where", "laws", "causes"),
    *("verdict", "shrink", "evidence", "next_steps", "findings", "baselines"),
)


@dataclass(frozen=True)
class Gap:
    """Whether the plain model misses the campaign by more than trials miss each other, deg."""

    rmse_deg: float
    noise_floor_deg: float
    significant: bool
    p_value: float
    repeats: bool = True  # whether any experiment was run more than once


@dataclass(frozen=True)
class Where:
    """Shares of the explainable squared gap, by bin; `stage` sums to 1 where there is a gap."""

    stage: Mapping[str, float] | None  # None where the data cannot tell it
    phase: Mapping[str, float]
    amplitude: Mapping[str, float]
    direction: Mapping[str, float]
    trial: Mapping[str, float]
    frequency: Mapping[str, float]
    not_known: str | None = None  # why there is no `stage`
    assumed: str | None = None  # what `stage` takes for granted


@dataclass(frozen=True)
class Cause:
    """One explanation that was considered."""

    set: Ids  # its effects; ("none",) and ("unknown",) are explanations too
    probability: float  # all causes' sum to 1
    # Effect -> parameter -> {"value": ..., "ci95": [low, high]}.
    parameters: Mapping[str, Mapping[str, Mapping[str, Any]]]
    transfer_function: Mapping[str, float]  # by name; empty for unknown
    held_out_rmse_deg: float | None = None  # None where it was not worth computing
    leftover_deg: float | None = None  # RMS of what repeats in its residual


@dataclass(frozen=True)
class Likeness:
    """A form that a law resembles."""

    form: str
    explains: float  # share of the curve: 1 less the RMS of what is left over the RMS
    parameters: dict[str, float]  # with their units in the name where they have one
    values: Floats = field(repr=False, compare=False)  # (n,), where the law is drawn


@dataclass(frozen=True)
class LawFound:
    """A free-form law that was weighed beside what has a name."""

    place: str  # one of `spa_fo.plant.law.PLACES`
    stage: str
    probability: float  # of the place, among all places and no law at all
    fraction_closed: float  # share of the gap that closes with it on held-out trials
    log_evidence: float  # against no law, nats; 0 for a law of the drive, sought in the pressure
    resembles: tuple[Likeness, ...]  # the most alike first
    beside: Ids  # named effects that it stands beside
    over: Floats  # (n,), what was visited
    value: Floats  # (n,), its curve, and a band that holds it with 95 %
    low: Floats
    high: Floats
    carried: bool = False  # whether the augmented model carries it

    def to_dict(self) -> dict[str, Any]:
        """Return its entry in diagnosis.json, but for what `Diagnosis.to_dict` makes plain."""
        place = PLACES[self.place]
        return {
            "place": self.place,
            "stage": self.stage,
            "probability": self.probability,
            "fraction_closed": self.fraction_closed,
            "resembles": [
                {"form": each.form, "explains": each.explains, "parameters": each.parameters}
                for each in self.resembles
            ],
            "log_evidence": self.log_evidence,
            "beside": self.beside,
            "in_model": self.carried,
            "curve": {
                "of": place.over,
                "of_unit": place.over_unit,
                "unit": place.unit,
                **{name: getattr(self, name) for name in ("over", "value", "low", "high")},
            },
        }


@dataclass(frozen=True)
class Step:
    """One thing to do next, and what it would tell; no capitals, no full stop."""

    do: str
    why: str
    apart: tuple[Ids, ...] = ()  # the two explanations that it would tell apart first

    @property
    def text(self) -> str:
        """A sentence."""
        return f"{self.do[:1].upper()}{self.do[1:]}: {self.why}."


@dataclass(frozen=True)
class Shrink:
    """How far the gap closes on trials that took no part, deg; contract §4."""

    held_out_on: str
    before_rmse_deg: float
    after_rmse_deg: float
    refit_only_rmse_deg: float
    ceiling_rmse_deg: float | None  # of a free-form correction, without any physics
    noise_floor_deg: float
    fraction_closed: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Traces:
    """Curves for figures, (n,) arrays at averaged samples of all trials in their order.

    Of a held-out trial `explained_deg` and `refit_deg` are by fits that had not seen it.
    """

    experiment: tuple[str, ...]  # of each trial
    label: tuple[str, ...]
    trial: NDArray[np.int64]  # index of each sample's trial
    time_s: Floats  # within the trial
    command_kpa: Floats  # NaN where none was logged
    measured_deg: Floats
    plain_deg: Floats
    explained_deg: Floats  # the plain model's where nothing is explained
    refit_deg: Floats  # the plain model's, identified again
    pressure_kpa: Floats | None  # measured
    drive_kpa: Floats | None  # as the explanation's drive makes it
    held_out: NDArray[np.bool_]  # (trials,)
    # Calibration dwells, window by window, empty without a calibration: known angle, what the curve
    # misreads, what the explanation makes of it.
    fixture_angle_deg: Floats
    fixture_deg: Floats
    fixture_explained_deg: Floats


@dataclass(frozen=True)
class Diagnosis:
    """The whole diagnosis of one campaign."""

    campaign: str
    material: str
    provenance: str  # "measured" or "synthetic"
    seed: int
    excluded: Ids  # effects that the library was to lack
    gap: Gap
    where: Where
    causes: tuple[Cause, ...]  # most probable first
    kind: str  # "no_gap", "cause", "ambiguous" or "unknown"
    sets: tuple[Ids, ...]  # explanations that stand
    next_experiment: str | None  # what would tell them apart, in words
    held_out_on: str  # which trials the causes' errors are of, in words
    shrink: Shrink | None  # None where nothing was explained
    offers: tuple[str, ...]  # what evidence the campaign holds, and what it lacks
    misses: tuple[str, ...]
    findings: tuple[str, ...]  # what else a reader should know
    baselines: Mapping[str, list[str]]  # simpler method -> the effects it would have named
    traces: Traces
    model: Model  # augmented; the plain one where nothing is explained
    next_steps: tuple[Step, ...] = ()  # most telling first
    laws: tuple[LawFound, ...] = ()  # where the cause is unknown, the most probable first
    reach: Reach = field(default_factory=Reach)  # how far the rig goes

    def to_dict(self) -> dict[str, Any]:
        """Return the document of diagnosis.json."""
        document = vars(self) | {
            "schema": SCHEMA,
            "reference_kpa": self.model.reference_kpa,
            "laws": [law.to_dict() for law in self.laws],
            "verdict": {
                "kind": self.kind,
                "sets": self.sets,
                "next_experiment": self.next_experiment,
            },
            "evidence": {
                "offers": self.offers,
                "misses": self.misses,
                "held_out": bool(self.traces.held_out.any()),
                "held_out_on": self.held_out_on,
            },
        }
        return {key: _as_json(document[key]) for key in _KEYS}


def _as_json(value: Any) -> Any:
    """Turn dataclasses, tuples and arrays into what JSON holds."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, Mapping):
        return {key: _as_json(item) for key, item in value.items()}
    return [_as_json(item) for item in value] if isinstance(value, list | tuple) else value
