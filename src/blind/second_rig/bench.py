"""One case's bench: the specimen's plain physics, its instruments, and its plan of trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from blind.second_rig.bank import Core
from blind.second_rig.effect import Scene, sign
from blind.second_rig.flex import Curve, Fixture, draw_curve, draw_fixture, jittered
from blind.second_rig.protocols import Experiment
from blind.second_rig.timeline import Trial, play
from blind.second_rig.wire import Board, Table, draw_board, draw_table

Floats = npt.NDArray[np.float64]
Rng = np.random.Generator

# Table I of the paper; specimens are drawn around its two materials.
_MATERIALS = {
    "silicone A": Core(1.406, 1.196, 0.794, 1.638, 0.934),
    "silicone B": Core(1.424, 1.170, 0.986, 2.103, 0.728),
}
_REST_S = (45.0, 110.0)  # between trials: linear memory fades
_ANGLE_RANGE_DEG = 180.0  # of a converter that logs the angle itself


@dataclass(frozen=True)
class Plan:
    """Experiments, and their trials in the order they happen."""

    experiments: tuple[Experiment, ...]
    trials: tuple[Trial, ...]

    @property
    def ended_s(self) -> float:
        """Campaign time at the end of the last log."""
        return self.trials[-1].started_s + self.trials[-1].length_s


@dataclass(frozen=True)
class Bench:
    """What one specimen stands on, the same for all its campaigns.

    Attributes
    ----------
    material : str
        For campaign.yaml.
    core : Core
        Plain physics.
    surroundings : dict
        Of the case document.
    reference_kpa : float
        Pressure of a unit input.
    top_kpa : float
        Largest command.
    range_kpa : float
        Span of the pressure sensor.
    curve, fixture : Curve, Fixture
        Flex sensor and its calibration.
    board : Board
        That writes spa-rig logs.
    table : Table or None
        How csv logs look; None where trials are spa-rig logs.
    """

    material: str
    core: Core
    surroundings: dict[str, Any]
    reference_kpa: float
    top_kpa: float
    range_kpa: float
    curve: Curve
    fixture: Fixture
    board: Board
    table: Table | None

    @property
    def calibrated(self) -> bool:
        """Whether angles come from a flex sensor."""
        return bool(self.surroundings["calibration"]["kind"] != "none")

    @property
    def top_input(self) -> float:
        """Largest command over the reference."""
        return self.top_kpa / self.reference_kpa

    @property
    def lag_s(self) -> float:
        """Time constant of the pressure sensor."""
        lag = float(self.surroundings["pressure"]["lag_s"])
        return lag if self.table is not None else min(lag, 0.0015)

    def resolution_deg(self, angle_deg: Floats) -> Floats:
        """Return the converter's step at angles (deg)."""
        if self.calibrated:
            return self.curve.resolution_deg(angle_deg)
        return np.full_like(angle_deg, _ANGLE_RANGE_DEG / 2**self.curve.bits)

    def sensed_kpa(self, pressure: Floats) -> Floats:
        """Return pressures as far as the sensor resolves them."""
        step = float(self.surroundings["pressure"]["resolution_kpa"])
        return step * np.rint(pressure / step) if step > 0.0 else pressure

    def pressure_counts(self, pressure: Floats) -> npt.NDArray[np.int64]:
        """Return the converter's counts for sensed pressures: a tenth of its range is zero."""
        share = 0.1 + 0.8 * pressure / self.range_kpa
        return np.clip(np.rint(share * self.curve.full), 0, self.curve.full).astype(np.int64)


def draw_core(rng: Rng) -> tuple[str, Core]:
    """Draw a specimen around one of the paper's two materials."""
    material = str(rng.choice(list(_MATERIALS)))
    usual = _MATERIALS[material]
    return material, Core(
        alpha2=usual.alpha2 * (1.0 + rng.uniform(-0.04, 0.04)),
        alpha1=usual.alpha1 * (1.0 + rng.uniform(-0.04, 0.04)),
        a1=usual.a1 * (1.0 + rng.uniform(-0.1, 0.1)),
        a0=usual.a0 * (1.0 + rng.uniform(-0.1, 0.1)),
        b0=usual.b0 * (1.0 + rng.uniform(-0.1, 0.1)),
    )


def off_core(core: Core, off: float, rng: Rng) -> Core:
    """Return a model that is off by a relative error in each coefficient, orders by a fifth."""
    factors = [1.0 + share * off * sign(rng) for share in (0.2, 0.2, 1.0, 1.0, 1.0)]
    values = (core.alpha2, core.alpha1, core.a1, core.a0, core.b0)
    return Core(*(value * factor for value, factor in zip(values, factors, strict=True)))


def make_plan(
    experiments: Sequence[Experiment],
    order: str,
    started_s: float,
    sampling: dict[str, Any],
    rng: Rng,
) -> Plan:
    """Put trials in order, with rests between; commands are shares of the largest.

    Parameters
    ----------
    experiments : sequence of Experiment
        What is tried.
    order : str
        interleaved or blocked.
    started_s : float
        Campaign time of the first trial.
    sampling : dict
        Of the case document.
    rng : Generator
        Draws order, rests and the times of samples.
    """
    slots = [(i, k) for i, e in enumerate(experiments) for k in range(e.repeats)]
    if order == "interleaved":
        slots = [slots[k] for k in rng.permutation(len(slots))]
        slots = _numbered(slots)
    trials = []
    rate = float(sampling["rate_hz"])
    for place, number in slots:
        experiment = experiments[place]
        nominal = np.arange(int(experiment.length_s * rate)) / rate
        times = jittered(nominal, 1.0 / rate, float(sampling["jitter"]), rng)
        command = experiment.command(nominal)
        trials.append(Trial(place, number, started_s, times, command))
        started_s = round(started_s + experiment.length_s + rng.uniform(*_REST_S), 1)
    return Plan(tuple(experiments), tuple(trials))


def _numbered(slots: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Count each experiment's trials in the order they happen."""
    seen: dict[int, int] = {}
    numbered = []
    for place, _ in slots:
        numbered.append((place, seen.get(place, 0)))
        seen[place] = seen.get(place, 0) + 1
    return numbered


def in_kpa(plan: Plan, top_kpa: float) -> Plan:
    """Turn shares into pressures, as fine as they are logged."""
    trials = [replace(t, command=np.round(t.command * top_kpa, 2)) for t in plan.trials]
    return replace(plan, trials=tuple(trials))


def scattered(plan: Plan, scatter: dict[str, Any], rng: Rng) -> Plan:
    """Give each trial its own gain, rate factor and rest angle."""
    trials = [
        replace(
            trial,
            gain=float(np.exp(float(scatter["gain"]) * rng.normal())),
            rate_factor=float(np.exp(float(scatter["time_scale"]) * rng.normal())),
            rest_deg=float(scatter["rest_deg"]) * rng.normal(),
        )
        for trial in plan.trials
    ]
    return replace(plan, trials=tuple(trials))


def scene_of(bench: Bench, plan: Plan, top_deg: float) -> Scene:
    """Return the scales that effects are drawn to."""
    return Scene(
        top_kpa=bench.top_kpa,
        top_input=bench.top_input,
        top_rad=float(np.deg2rad(top_deg)),
        length_s=plan.ended_s,
        trials=len(plan.trials),
        starts_s=tuple(trial.started_s for trial in plan.trials),
        lengths_s=tuple(trial.length_s for trial in plan.trials),
    )


def draw_bench(
    surroundings: dict[str, Any], shares: Plan, top_deg: float, rng: Rng
) -> tuple[Bench, Plan]:
    """Draw specimen and instruments, and levels that bend it to `top_deg`.

    Parameters
    ----------
    surroundings : dict
        Of the case document.
    shares : Plan
        Of the campaign, in shares of the largest command.
    top_deg : float
        Largest angle of the bare body.
    rng : Generator
        Draws all else.

    Returns
    -------
    Bench
        All that stays the same.
    Plan
        In kPa.
    """
    material, core = draw_core(rng)
    unit = Scene(1.0, 1.0, 1.0, shares.ended_s, len(shares.trials))
    largest = max(float(r.angle.max()) for r in play(core, (), shares.trials, unit))
    top_input = top_deg / largest
    bits = int(surroundings["converter"]["bits"])
    csv = surroundings["calibration"]["kind"] == "none" or rng.random() < 0.25
    resolution = float(surroundings["pressure"]["resolution_kpa"])
    range_kpa = rng.uniform(250.0, 700.0)
    if resolution > 0.0:
        range_kpa = min(range_kpa, 0.8 * (2**bits - 1) * resolution)
    reference = min(rng.uniform(18.0, 45.0), range_kpa / (1.4 * top_input))
    reference = float(np.format_float_positional(reference, precision=3, fractional=False))
    top_kpa = round(top_input * reference, 2)
    curve = draw_curve(bits, rng)
    rate = float(surroundings["sampling"]["rate_hz"])
    measured = bool(surroundings["pressure"]["measured"])
    bench = Bench(
        material=material,
        core=core,
        surroundings=surroundings,
        reference_kpa=reference,
        top_kpa=top_kpa,
        range_kpa=float(np.round(range_kpa, 3)),
        curve=curve,
        fixture=draw_fixture(surroundings, top_deg, rng),
        board=draw_board(bits, rate, rng),
        table=draw_table(surroundings["calibration"]["kind"] == "none", measured, rng)
        if csv
        else None,
    )
    return bench, in_kpa(shares, top_kpa)
