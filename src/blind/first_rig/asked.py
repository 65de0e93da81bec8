"""What a case document asks for (src/blind/CASE.md), as frozen dataclasses."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from blind.first_rig.doses import FORMS
from blind.first_rig.foreign_effects import FOREIGN_EFFECTS
from blind.first_rig.further_effects import FURTHER_FORMS
from blind.first_rig.measured_effects import MEASURED_EFFECTS
from spa_fo.virtual_rig.bench import Scatter

SCHEMA = "spa-fo/blind-case/1"
KINDS = ("no_effect", "closed", "withheld", "alien", "pair", "several")
_COUNTS = {"no_effect": (0, 0), "pair": (2, 2), "several": (3, 5)}  # of effects; else one
PROTOCOLS = ("up_steps", "releases", "rich", "everything", "single")
ORDERS = ("interleaved", "blocked")
MODELS = ("own", "earlier", "off")
COLOURS = ("exponential", "one_over_f")
CALIBRATIONS = ("none", "before", "before_and_after")


@dataclass(frozen=True)
class Noise:
    """Noise of the angle reading: coloured, drawn anew each trial, and white."""

    colour: str
    coloured_deg: float
    correlation_s: float | None
    white_deg: float


@dataclass(frozen=True)
class Calibration:
    """When the sensor is calibrated, and the fixture's dwells."""

    kind: str
    dwell_s: float = 5.0
    angles: int = 7
    directions: int = 2


@dataclass(frozen=True)
class Sampling:
    """When samples are taken, and what becomes of them."""

    rate_hz: float
    jitter: float
    missing: float
    damaged: float


@dataclass(frozen=True)
class Pressure:
    """Whether the pressure is measured, and how."""

    measured: bool
    resolution_kpa: float
    lag_s: float


@dataclass(frozen=True)
class Surroundings:
    """All that is no effect."""

    noise: Noise
    bits: int
    scatter: Scatter
    fixture_error_deg: float
    calibration: Calibration
    sampling: Sampling
    pressure: Pressure


@dataclass(frozen=True)
class Asked:
    """A case document.

    `off` is the relative error of the given model's coefficients; without meaning where `model` is
    another kind than ``off``.
    """

    name: str
    seed: int
    kind: str
    effects: tuple[str, ...]
    sizes: tuple[float, ...]
    protocol: str
    repeats: int
    order: str
    model: str
    off: float
    surroundings: Surroundings

    def stream(self, what: str) -> np.random.Generator:
        """Open the random stream of one thing that is drawn."""
        key = zlib.crc32(what.encode())
        sequence = np.random.SeedSequence(self.seed, spawn_key=(key,))
        return np.random.Generator(np.random.PCG64(sequence))


def read_document(document: Mapping[str, Any]) -> Asked:
    """Read a case document.

    Raises
    ------
    ValueError
        It asks for something that the interface does not know; the text names it.
    """
    _known("schema", document["schema"], (SCHEMA,))
    model = document["model"]
    asked = Asked(
        name=document["name"],
        seed=document["seed"],
        kind=_known("kind", document["kind"], KINDS),
        effects=tuple(document["effects"]),
        sizes=tuple(float(size) for size in document["sizes"]),
        protocol=_known("protocol.name", document["protocol"]["name"], PROTOCOLS),
        repeats=document["protocol"]["repeats"],
        order=_known("protocol.order", document["protocol"]["order"], ORDERS),
        model=_known("model.kind", model["kind"], MODELS),
        off=float(model["off"]) if model["kind"] == "off" else 0.0,
        surroundings=_surroundings(document["surroundings"]),
    )
    few, many = _COUNTS.get(asked.kind, (1, 1))
    if not few <= len(asked.effects) <= many or len(asked.sizes) != len(asked.effects):
        counted = f"{few}" if few == many else f"{few} to {many}"
        raise ValueError(f"a case of kind {asked.kind} has {counted} effects, each with a size")
    own = (*FORMS["a"], *MEASURED_EFFECTS, *FURTHER_FORMS["a"])
    named = tuple(FOREIGN_EFFECTS) if asked.kind == "alien" else own
    for effect in asked.effects:
        _known("effects", effect, named)
    return asked


def _surroundings(given: Mapping[str, Any]) -> Surroundings:
    noise, scatter = Noise(**given["noise"]), given["scatter"]
    _known("noise.colour", noise.colour, COLOURS)
    kind = _known("calibration.kind", given["calibration"]["kind"], CALIBRATIONS)
    calibrated = kind != "none"  # else whatever stands there has no meaning
    return Surroundings(
        noise=noise,
        bits=given["converter"]["bits"],
        scatter=Scatter(scatter["gain"], scatter["rest_deg"], scatter["time_scale"]),
        fixture_error_deg=given["fixture"]["error_deg"] if calibrated else 0.0,
        calibration=Calibration(**given["calibration"]) if calibrated else Calibration(kind),
        sampling=Sampling(**given["sampling"]),
        pressure=Pressure(**given["pressure"]),
    )


def _known(what: str, value: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise ValueError(f"{what}: expected one of {', '.join(known)}, found {value!r}")
    return value
