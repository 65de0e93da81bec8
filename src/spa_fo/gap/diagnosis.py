"""What a diagnosis says, ready for a file, a page and figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.atomic import write_text
from spa_fo.plant import Model
from spa_fo.plant.law import PLACES

Floats = NDArray[np.float64]
Ids = tuple[str, ...]
SCHEMA = "spa-fo/diagnosis/1"


@dataclass(frozen=True)
class Gap:
    """Whether the plain model misses the campaign by more than trials miss each other, deg.

    `repeats` says whether any experiment was run more than once.
    """

    rmse_deg: float
    noise_floor_deg: float
    significant: bool
    p_value: float
    repeats: bool = True


@dataclass(frozen=True)
class Where:
    """Shares of the explainable squared gap, by bin; `stage` sums to 1 where there is a gap.

    Where the data cannot tell it, `stage` is None and `not_known` says why.
    """

    stage: Mapping[str, float] | None
    phase: Mapping[str, float]
    amplitude: Mapping[str, float]
    direction: Mapping[str, float]
    trial: Mapping[str, float]
    frequency: Mapping[str, float]
    not_known: str | None = None


@dataclass(frozen=True)
class Cause:
    """One explanation that was considered.

    Attributes
    ----------
    set : tuple of str
        Its effects; ``("none",)`` and ``("unknown",)`` are explanations too.
    probability : float
        All causes' sum to 1.
    parameters : mapping
        Effect -> parameter -> ``{"value": ..., "ci95": [low, high]}``.
    transfer_function : mapping
        The coefficients that go with it, by name; empty for unknown.
    held_out_rmse_deg : float or None
        Of its predictions of the held-out trials; None where it was not worth computing.
    leftover_deg : float or None
        RMS of what repeats in its residual.
    """

    set: Ids
    probability: float
    parameters: Mapping[str, Mapping[str, Mapping[str, Any]]]
    transfer_function: Mapping[str, float]
    held_out_rmse_deg: float | None = None
    leftover_deg: float | None = None


@dataclass(frozen=True)
class Likeness:
    """A form that a law resembles.

    Attributes
    ----------
    form : str
        Its name.
    explains : float
        Share of the curve that it gives, 1 less the RMS of what is left over the RMS.
    parameters : dict
        Its parameters by name, with their units in the name where they have one.
    values : (n,) array
        The form where the law is drawn.
    """

    form: str
    explains: float
    parameters: dict[str, float]
    values: Floats = field(repr=False, compare=False)


@dataclass(frozen=True)
class LawFound:
    """A free-form law that was weighed beside what has a name.

    Attributes
    ----------
    place, stage : str
        Where it sits; see `spa_fo.plant.law.PLACES`.
    probability : float
        Of the place, among all places and no law at all.
    fraction_closed : float
        Share of the gap that closes with it on trials that took no part.
    log_evidence : float
        Against no law, nats; 0 for a law of the drive, which is sought in the pressure.
    resembles : tuple of Likeness
        Forms that its curve is like, the most alike first.
    beside : tuple of str
        Named effects that it stands beside.
    over, value, low, high : (n,) arrays
        Its curve over what was visited, and a band that holds it with 95 %.
    carried : bool
        Whether the augmented model carries it.
    """

    place: str
    stage: str
    probability: float
    fraction_closed: float
    log_evidence: float
    resembles: tuple[Likeness, ...]
    beside: Ids
    over: Floats
    value: Floats
    low: Floats
    high: Floats
    carried: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return its entry in diagnosis.json."""
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
                "over": self.over,
                "value": self.value,
                "low": self.low,
                "high": self.high,
            },
        }


@dataclass(frozen=True)
class Step:
    """One thing to do next.

    Attributes
    ----------
    do, why : str
        What, and what it would tell; no capitals, no full stop.
    apart : tuple of tuples of str
        The two explanations that it would tell apart first of all; empty where it is for none.
    """

    do: str
    why: str
    apart: tuple[Ids, ...] = ()

    @property
    def text(self) -> str:
        """A sentence."""
        return f"{self.do[:1].upper()}{self.do[1:]}: {self.why}."


@dataclass(frozen=True)
class Shrink:
    """How far the gap closes on trials that took no part, deg; contract §4.

    `ceiling_rmse_deg` is what a free-form correction reaches, without any physics.
    """

    held_out_on: str
    before_rmse_deg: float
    after_rmse_deg: float
    refit_only_rmse_deg: float
    ceiling_rmse_deg: float | None
    noise_floor_deg: float
    fraction_closed: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Traces:
    """Curves for figures, (n,) arrays at averaged samples of all trials in their order.

    Attributes
    ----------
    experiment, label : tuple of str
        Of each trial.
    trial : (n,) array
        Index of the trial.
    time_s, command_kpa, measured_deg, plain_deg, explained_deg, refit_deg : (n,) arrays
        Within the trial; the command is NaN where none was logged. `explained_deg` is the
        explanation's prediction, the plain model's where nothing is explained; `refit_deg` the
        plain model's identified again; both, of a held-out trial, by a fit that had not seen it.
    pressure_kpa, drive_kpa : (n,) arrays or None
        Measured, and as the explanation's drive makes it.
    held_out : (trials,) bool array
        Trials that took no part.
    fixture_angle_deg, fixture_deg, fixture_explained_deg : arrays
        Calibration dwells, window by window: known angle, what the curve misreads, what the
        explanation makes of it; empty without a calibration.
    """

    experiment: tuple[str, ...]
    label: tuple[str, ...]
    trial: NDArray[np.int64]
    time_s: Floats
    command_kpa: Floats
    measured_deg: Floats
    plain_deg: Floats
    explained_deg: Floats
    refit_deg: Floats
    pressure_kpa: Floats | None
    drive_kpa: Floats | None
    held_out: NDArray[np.bool_]
    fixture_angle_deg: Floats
    fixture_deg: Floats
    fixture_explained_deg: Floats


@dataclass(frozen=True)
class Diagnosis:
    """The whole diagnosis of one campaign.

    Attributes
    ----------
    campaign, material, provenance : str
        Of the campaign; provenance is "measured" or "synthetic".
    seed : int
        Of all that is random.
    excluded : tuple of str
        Effects that the library was to lack.
    gap, where, causes, shrink
        See their classes; causes most probable first; shrink None where nothing was explained.
    kind : str
        "no_gap", "cause", "ambiguous" or "unknown".
    sets : tuple of tuples of str
        Explanations that stand.
    next_experiment : str or None
        What would tell them apart, in words.
    held_out_on : str
        Which trials the causes' ``held_out_rmse_deg`` are of, in words.
    offers, misses, findings : tuple of str
        What evidence the campaign holds, what it lacks, and what else a reader should know.
    baselines : mapping
        What simpler methods would have answered: name -> list of effects.
    traces : Traces
        Curves for figures.
    model : Model
        Augmented; the plain one where nothing is explained.
    next_steps : tuple of Step
        What to do at the bench, most telling first; see `spa_fo.gap.plan.next_steps`.
    laws : tuple of LawFound
        Free-form laws where the cause is unknown, the most probable first.
    """

    campaign: str
    material: str
    provenance: str
    seed: int
    excluded: Ids
    gap: Gap
    where: Where
    causes: tuple[Cause, ...]
    kind: str
    sets: tuple[Ids, ...]
    next_experiment: str | None
    held_out_on: str
    shrink: Shrink | None
    offers: tuple[str, ...]
    misses: tuple[str, ...]
    findings: tuple[str, ...]
    baselines: Mapping[str, list[str]]
    traces: Traces
    model: Model
    next_steps: tuple[Step, ...] = ()
    laws: tuple[LawFound, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the document of diagnosis.json."""
        document = {
            "schema": SCHEMA,
            "campaign": self.campaign,
            "seed": self.seed,
            "provenance": self.provenance,
            "excluded": self.excluded,
            "gap": self.gap,
            "where": self.where,
            "laws": [law.to_dict() for law in self.laws],
            "causes": self.causes,
            "verdict": {
                "kind": self.kind,
                "sets": self.sets,
                "next_experiment": self.next_experiment,
            },
            "shrink": self.shrink,
            "evidence": {
                "offers": self.offers,
                "misses": self.misses,
                "held_out": bool(self.traces.held_out.any()),
                "held_out_on": self.held_out_on,
            },
            "next_steps": self.next_steps,
            "findings": self.findings,
            "baselines": self.baselines,
        }
        return {key: _as_json(value) for key, value in document.items()}


def _as_json(value: Any) -> Any:
    """Turn dataclasses, tuples and arrays into what JSON holds."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, Mapping):
        return {key: _as_json(item) for key, item in value.items()}
    return [_as_json(item) for item in value] if isinstance(value, list | tuple) else value


def write_diagnosis(path: Path | str, diagnosis: Diagnosis) -> None:
    """Write diagnosis.json, whole or not at all; `BadInput` where it cannot be written."""
    write_text(path, json.dumps(diagnosis.to_dict(), indent=2, allow_nan=False) + "\n")
