"""One case of the blind benchmark: what is asked, drawn, simulated, written and told."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from blind.second_rig import foreign, further
from blind.second_rig.actuator import coefficients
from blind.second_rig.bench import (
    Bench,
    Plan,
    draw_bench,
    in_kpa,
    make_plan,
    off_core,
    scattered,
    scene_of,
)
from blind.second_rig.effect import Draw, Effect, Scene
from blind.second_rig.effects import LIBRARY
from blind.second_rig.flex import calibrate
from blind.second_rig.protocols import earlier_experiments, experiments, later_experiments
from blind.second_rig.record import calibration_bytes, trial_bytes, write_campaign
from blind.second_rig.sensor import When
from blind.second_rig.sizes import Ruler, rms
from blind.second_rig.timeline import Reading, play

SCHEMA = "spa-fo/blind-case/1"
_STREAMS = (
    "protocol", "bench", "effects", "model", "campaign", "later", "earlier", "calibration",
)  # fmt: skip


@dataclass(frozen=True)
class Streams:
    """Random numbers, a stream for each purpose, all of one seed."""

    seed: int

    def of(self, purpose: str, part: int = 0) -> np.random.Generator:
        """Return the stream of a purpose, from its beginning."""
        key = (_STREAMS.index(purpose), part)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))


def write_case(document: dict[str, Any], folder: Path | str) -> dict[str, Any]:
    """Make the campaigns of one case.

    Parameters
    ----------
    document : dict
        The case document, schema spa-fo/blind-case/1.
    folder : Path or str
        Where campaign/, later/, and earlier/ or model.json go.

    Returns
    -------
    dict
        The truth, plain data.

    Raises
    ------
    ValueError
        The document is of another schema, or asks for an effect that this rig does not make.
    """
    if document.get("schema") != SCHEMA:
        raise ValueError(f"schema is {document.get('schema')!r}; expected {SCHEMA!r}")
    folder = Path(folder)
    streams = Streams(int(document["seed"]))
    protocol, surroundings = document["protocol"], document["surroundings"]
    tried = experiments(protocol["name"], int(protocol["repeats"]), streams.of("protocol"))
    shares = make_plan(
        tried, protocol["order"], 0.0, surroundings["sampling"], streams.of("protocol", 1)
    )
    top_deg = float(streams.of("protocol", 2).uniform(52.0, 72.0))
    bench, plan = draw_bench(surroundings, shares, top_deg, streams.of("bench"))
    ruler = Ruler(bench, plan, scene_of(bench, plan, top_deg))
    effects = _sized(ruler, document, streams)
    _record_specimen(folder, document["name"], protocol, bench, plan, effects, ruler.scene, streams)
    model_error = _record_model(folder, document, ruler, streams)
    return {
        "noise_floor_deg": ruler.floor_deg,
        "sizes_reached": [ruler.size((effect,)) for effect in effects],
        "joint_size": ruler.size(effects) if len(effects) > 1 else None,
        "model_error_deg": model_error,
        "form": " + ".join(effect.form for effect in effects) or "plain",
        "parameters": {effect.id: effect.plain() for effect in effects},
        "core": coefficients(bench.core),
        "protocol": _told(plan, bench),
    }


def _sized(ruler: Ruler, document: dict[str, Any], streams: Streams) -> tuple[Effect, ...]:
    """Draw the effects asked for, each as large alone as it is asked to be."""
    effects = []
    asked_for = zip(document["effects"], document["sizes"], strict=True)
    for place, (name, asked) in enumerate(asked_for):
        draw = _draw(name, document["kind"])
        if draw is None:
            raise ValueError(f"effect {name!r} is not of this rig")
        effects.append(ruler.sized(draw(streams.of("effects", place), ruler.scene), float(asked)))
    return tuple(effects)


def _draw(name: str, kind: str) -> Draw | None:
    """Find an effect; a name that is both foreign and a library's is foreign to an alien case."""
    known = {**foreign.DRAWS, **further.DRAWS, **LIBRARY}
    return foreign.DRAWS.get(name, known.get(name)) if kind == "alien" else known.get(name)


def _record_specimen(
    folder: Path,
    name: str,
    protocol: dict[str, Any],
    bench: Bench,
    plan: Plan,
    effects: Sequence[Effect],
    scene: Scene,
    streams: Streams,
) -> None:
    """Write campaign/ and later/: the same specimen, one after the other."""
    rng = streams.of("later")
    kind = bench.surroundings["calibration"]["kind"]
    after_s = round(plan.ended_s + rng.uniform(60.0, 240.0), 1)
    begins_s = round(after_s + bench.fixture.length_s + rng.uniform(120.0, 900.0), 1)
    sampling = bench.surroundings["sampling"]
    order = protocol["order"]
    later = in_kpa(make_plan(later_experiments(rng), order, begins_s, sampling, rng), bench.top_kpa)
    scatter = bench.surroundings["scatter"]
    plan = scattered(plan, scatter, streams.of("campaign"))
    later = scattered(later, scatter, rng)
    readings = play(bench.core, effects, (*plan.trials, *later.trials), scene, bench.lag_s)
    calibrations = []
    if kind != "none":
        calibrations.append(_calibration(bench, effects, "first", None, 0, streams))
    earliest = tuple(calibrations)
    if kind == "before_and_after":
        known = len(plan.trials)
        calibrations.append(_calibration(bench, effects, "again", after_s, known, streams))
    logs = _logs(bench, plan, readings, streams, "campaign", effects)
    write_campaign(folder / "campaign", name, bench, plan, logs, calibrations)
    after = readings[len(plan.trials) :]
    logs = _logs(bench, later, after, streams, "later", effects, len(plan.trials))
    write_campaign(
        folder / "later", f"{name}_later", bench, later, logs, earliest, name, len(plan.trials) + 1
    )


def _calibration(
    bench: Bench,
    effects: Sequence[Effect],
    name: str,
    at_s: float | None,
    trials: int,
    streams: Streams,
) -> tuple[str, float, bytes]:
    """Calibrate; before the first trial where no time is given."""
    rng = streams.of("calibration", 1 + trials)
    if at_s is None:
        at_s = -round(bench.fixture.length_s + rng.uniform(60.0, 600.0), 1)
    when = When(at_s, trials)
    log = calibrate(bench.fixture, bench.curve, effects, bench.surroundings, when, rng)
    return f"calibration/{name}.log", at_s, calibration_bytes(bench, log, rng)


def _logs(
    bench: Bench,
    plan: Plan,
    readings: Sequence[Reading],
    streams: Streams,
    purpose: str,
    effects: Sequence[Effect] = (),
    before: int = 0,
) -> list[bytes]:
    """Log a plan's trials; `before` is how many the specimen had before them."""
    return [
        trial_bytes(
            bench, trial, reading, streams.of(purpose, 1 + place), effects, before + 1 + place
        )
        for place, (trial, reading) in enumerate(
            zip(plan.trials, readings[: len(plan.trials)], strict=True)
        )
    ]


def _record_model(
    folder: Path, document: dict[str, Any], ruler: Ruler, streams: Streams
) -> float | None:
    """Write earlier/ or model.json, as asked; return what the model misses by (deg)."""
    kind = document["model"]["kind"]
    bench = ruler.bench
    if kind == "earlier":
        _record_earlier(folder, document["name"], bench, ruler.scene, streams)
    if kind != "off":
        return None
    given = off_core(bench.core, float(document["model"]["off"]), streams.of("model"))
    model = {
        "schema": "spa-fo/model/1",
        "campaign": document["name"],
        "material": bench.material,
        "transfer_function": coefficients(given),
        "input": {"signal": "command", "reference_kpa": bench.reference_kpa},
        "output": {"unit": "rad"},
        "effects": [],
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.json").write_text(json.dumps(model, indent=1) + "\n", encoding="utf-8")
    return rms(ruler.angles((), given) - ruler.bare)


def _record_earlier(folder: Path, name: str, bench: Bench, scene: Scene, streams: Streams) -> None:
    """Write earlier/: the specimen before any effect, with a calibration of its own."""
    rng = streams.of("earlier")
    sampling = bench.surroundings["sampling"]
    plan = make_plan(earlier_experiments(rng), "interleaved", 0.0, sampling, rng)
    plan = scattered(in_kpa(plan, bench.top_kpa), bench.surroundings["scatter"], rng)
    readings = play(bench.core, (), plan.trials, scene, bench.lag_s)
    calibrations = []
    if bench.calibrated:
        at_s = -round(bench.fixture.length_s + rng.uniform(60.0, 600.0), 1)
        log = calibrate(bench.fixture, bench.curve, (), bench.surroundings, When(at_s, 0), rng)
        calibrations.append(("calibration/first.log", at_s, calibration_bytes(bench, log, rng)))
    logs = _logs(bench, plan, readings, streams, "earlier")
    write_campaign(folder / "earlier", f"{name}_earlier", bench, plan, logs, calibrations)


def _told(plan: Plan, bench: Bench) -> dict[str, Any]:
    """Return what was tried, in numbers."""
    return {
        "largest_kpa": bench.top_kpa,
        "log_s": sum(e.length_s * e.repeats for e in plan.experiments),
        "experiments": [
            {
                "name": e.name,
                "protocol": e.protocol,
                "trials": e.repeats,
                "pieces": [[p.length_s, p.begin, p.end] for p in e.pieces],
            }
            for e in plan.experiments
        ],
    }
