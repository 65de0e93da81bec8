"""The paper's comparison for one material: every model against the averaged step responses.

The paper's protocol (four datasets of fifty points, swarm of 200 x 10) beside the optimum, in
the bounds as printed and widened until they hold Table I; the optimum of all trials in free
bounds; Table I as printed; and the baselines.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.fractional import ResponseMap, step_map
from spa_fo.identify.baselines import (
    Baseline,
    fit_ludwick,
    fit_ludwick_literature,
    fit_ludwick_per_step,
    fit_second_order,
)
from spa_fo.identify.bounds import Bounds, printed_bounds, widened_bounds
from spa_fo.identify.fitness import target_of
from spa_fo.identify.moderate import moderate_optimum
from spa_fo.identify.polish import Optimum, fit_optimum
from spa_fo.identify.protocol import StepData, paper_selection
from spa_fo.identify.swarm import swarm_on_map
from spa_fo.plant.paper import DATASETS, SWARM_ITERATIONS, SWARM_PARTICLES, TABLE_I
from spa_fo.plant.transfer_function import PARAMETERS

NEAR_OPTIMUM = 1.01
"""A swarm has found the optimum when its RMSE is below this times the least one."""


@dataclass(frozen=True)
class Options:
    """What of the protocol can be set.

    Attributes
    ----------
    datasets : int
        Step responses of the paper's protocol.
    particles, iterations : int
        Of its swarm.
    seeds : int
        How often the swarm is repeated to see how often it finds the optimum.
    design : str or None
        The paper's actuator to compare with, "design_1" or "design_2".
    ludwick_n : float or None
        Ludwick's exponent from the literature.
    """

    datasets: int = DATASETS
    particles: int = SWARM_PARTICLES
    iterations: int = SWARM_ITERATIONS
    seeds: int = 30
    design: str | None = None
    ludwick_n: float | None = None


@dataclass(frozen=True)
class ModelResult:
    """One model held against the averaged responses.

    Attributes
    ----------
    name : str
        For tables and legends.
    kind : str
        "fractional", "ludwick" or "second order".
    source : str
        How its parameters came about: "swarm", "optimum", "paper", or as for `Baseline`.
    bounds : str
        "printed", "widened", "free", or "" where there are none.
    datasets : int
        Step responses it was fitted to; 0 for the paper's own.
    parameters : Mapping[str, float]
    at_bounds : tuple of str
        Parameters that ended on a bound, such as "a0 upper".
    fit_rmse_deg : float
        Root mean square error over the samples it was fitted to; None where it was not.
    rms_deg : Mapping[str, float]
        By experiment: RMS error against the averaged response.
    curves_deg : Mapping[str, list of float]
        By experiment: the angle at `Reproduction.t_s`.
    """

    name: str
    kind: str
    source: str
    bounds: str
    datasets: int
    parameters: Mapping[str, float]
    at_bounds: tuple[str, ...]
    fit_rmse_deg: float | None
    rms_deg: Mapping[str, float]
    curves_deg: Mapping[str, list[float]]


@dataclass(frozen=True)
class SwarmRepeats:
    """How often the paper's swarm finds the optimum of its own data and bounds."""

    bounds: str
    particles: int
    iterations: int
    seeds: int
    hits: int
    median_excess: float  # median RMSE over the least one, less 1


@dataclass(frozen=True)
class ExperimentMean:
    """The averaged response of one experiment."""

    name: str
    setpoint_deg: float | None
    u: float
    trials: int
    trials_deg: list[list[float]]
    mean_deg: list[float]


@dataclass(frozen=True)
class Reproduction:
    """The comparison of one material."""

    t_s: list[float]
    experiments: tuple[ExperimentMean, ...]
    models: tuple[ModelResult, ...]
    swarm_repeats: tuple[SwarmRepeats, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> Reproduction:
        """Make one from what `to_dict` returned."""
        return cls(
            t_s=document["t_s"],
            experiments=tuple(ExperimentMean(**entry) for entry in document["experiments"]),
            models=tuple(
                ModelResult(**{**entry, "at_bounds": tuple(entry["at_bounds"])})
                for entry in document["models"]
            ),
            swarm_repeats=tuple(SwarmRepeats(**entry) for entry in document["swarm_repeats"]),
        )


def reproduce(data: StepData, options: Options, seed: int) -> Reproduction:
    """Fit every model to a material's step responses and compare.

    Parameters
    ----------
    data : StepData
        All step responses of the material.
    options : Options
        Of the protocol.
    seed : int
        Of the swarms.

    Returns
    -------
    Reproduction
    """
    comparison = _Comparison(data)
    chosen = paper_selection(data, min(options.datasets, data.datasets))
    models: list[ModelResult] = []
    repeats: list[SwarmRepeats] = []
    for bounds in (printed_bounds(), widened_bounds(options.design)):
        swarm, optimum, repeated = _swarm_and_optimum(comparison, chosen, bounds, options, seed)
        models += [swarm, optimum]
        repeats.append(repeated)
    free = moderate_optimum(lambda bounds: fit_optimum(data, bounds, seed))
    models.append(comparison.optimum(free, data.datasets))
    if options.design is not None:
        models.append(
            comparison.fractional(
                "Table I as printed", "paper", "", 0, TABLE_I[options.design].as_array(), (), None
            )
        )
    models += [comparison.baseline(model) for model in _baselines(data, options)]
    return Reproduction(
        t_s=comparison.t_s.tolist(),
        experiments=tuple(comparison.experiments()),
        models=tuple(models),
        swarm_repeats=tuple(repeats),
    )


def _swarm_and_optimum(
    comparison: _Comparison, chosen: StepData, bounds: Bounds, options: Options, seed: int
) -> tuple[ModelResult, ModelResult, SwarmRepeats]:
    optimum = fit_optimum(chosen, bounds, seed)
    response, target = step_map(chosen.t), target_of(chosen)
    runs = [
        swarm_on_map(response, target, bounds, seed + i, options.particles, options.iterations)
        for i in range(options.seeds)
    ]
    excess = np.array([run.rmse for run in runs]) / optimum.rmse
    first = runs[0]
    swarm = comparison.fractional(
        f"swarm {options.particles}×{options.iterations}, {bounds.name} bounds",
        "swarm",
        bounds.name,
        chosen.datasets,
        first.x,
        bounds.touched(first.x),
        float(np.degrees(first.rmse)),
    )
    hits = int(np.count_nonzero(excess < NEAR_OPTIMUM))
    repeats = SwarmRepeats(
        bounds.name,
        options.particles,
        options.iterations,
        len(runs),
        hits,
        float(np.median(excess) - 1.0),
    )
    return swarm, comparison.optimum(optimum, chosen.datasets), repeats


def _baselines(data: StepData, options: Options) -> Iterable[Baseline]:
    if options.ludwick_n is not None:
        yield fit_ludwick_literature(data, options.ludwick_n)
        yield fit_ludwick_per_step(data, options.ludwick_n)
    yield fit_ludwick(data)
    yield fit_second_order(data)


class _Comparison:
    """The averaged responses, and how a model is held against them."""

    def __init__(self, data: StepData) -> None:
        self.data = data
        # From t = 0, so that curves start where the step does.
        self.t_s: Floats = np.concatenate([[0.0], data.t])
        self.means = {
            name: np.degrees(data.angle_rad[rows].mean(axis=0))
            for name, rows in data.groups.items()
        }
        self.heights = {name: float(data.u[rows].mean()) for name, rows in data.groups.items()}
        self._map: ResponseMap = step_map(data.t)

    def experiments(self) -> Iterable[ExperimentMean]:
        for name, rows in self.data.groups.items():
            setpoint = float(self.data.setpoint_deg[rows[0]])
            yield ExperimentMean(
                name=name,
                setpoint_deg=None if np.isnan(setpoint) else setpoint,
                u=self.heights[name],
                trials=len(rows),
                trials_deg=np.degrees(self.data.angle_rad[rows]).tolist(),
                mean_deg=self.means[name].tolist(),
            )

    def fractional(
        self,
        name: str,
        source: str,
        bounds: str,
        datasets: int,
        x: Floats,
        at_bounds: tuple[str, ...],
        fit_rmse_deg: float | None,
    ) -> ModelResult:
        unit = np.degrees(self._map.response(x))
        rms, curves = self._against_means({g: u * unit for g, u in self.heights.items()})
        parameters = dict(zip(PARAMETERS, x.tolist(), strict=True))
        return ModelResult(
            name,
            "fractional",
            source,
            bounds,
            datasets,
            parameters,
            at_bounds,
            fit_rmse_deg,
            rms,
            curves,
        )

    def optimum(self, found: Optimum, datasets: int) -> ModelResult:
        return self.fractional(
            f"optimum, {found.bounds.name} bounds",
            "optimum",
            found.bounds.name,
            datasets,
            found.x,
            found.at_bounds,
            float(np.degrees(found.rmse)),
        )

    def baseline(self, model: Baseline) -> ModelResult:
        angles = {g: np.degrees(model.step(self.data.t, u)) for g, u in self.heights.items()}
        rms, curves = self._against_means(angles)
        each = np.array([np.degrees(model.step(self.data.t, float(u))) for u in self.data.u])
        errors = each - np.degrees(self.data.angle_rad)
        return ModelResult(
            model.name,
            model.kind,
            model.source,
            "",
            self.data.datasets,
            dict(model.parameters),
            (),
            float(np.sqrt(np.mean(errors**2))),
            rms,
            curves,
        )

    def _against_means(
        self, angles: Mapping[str, Floats]
    ) -> tuple[dict[str, float], dict[str, list[float]]]:
        rms = {
            name: float(np.sqrt(np.mean((angle - self.means[name]) ** 2)))
            for name, angle in angles.items()
        }
        return rms, {name: [0.0, *angle.tolist()] for name, angle in angles.items()}
