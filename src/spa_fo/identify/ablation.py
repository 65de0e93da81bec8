"""What an identification gains from more datasets and points, and loses to outliers.

Every subset of trials (or many) is fitted, and the fits are compared among themselves, with the
trials left out, and with theory: a curve with five free parameters fitted to n datasets of p
points errs by σ_w sqrt(5/(p n)) from noise that is independent from sample to sample, and by
σ_b/sqrt(n) from what sets trials apart (gain, offset, rate), which no number of points reduces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.fractional import ResponseMap, step_map
from spa_fo.identify.bounds import Bounds
from spa_fo.identify.fit_campaign import campaign_steps
from spa_fo.identify.moderate import moderate_optimum
from spa_fo.identify.noise import trial_noise
from spa_fo.identify.polish import Draws, Optimum, fit_many, fit_optimum
from spa_fo.identify.protocol import StepData
from spa_fo.plant.estimates import QUANTITIES
from spa_fo.plant.paper import POINTS, TRIALS
from spa_fo.rig import CampaignData

ALL = "all"
"""Name of the group of all experiments together."""
_CORRUPTIONS = 8  # different draws of outliers, shared out among the subsets


@dataclass(frozen=True)
class AblationOptions:
    """What is varied.

    Attributes
    ----------
    points : tuple of int
        Points of each dataset, without outliers; the paper's 50 are always among them.
    outliers : tuple of float
        Fractions of samples replaced by spikes, at the paper's 50 points; none (0) is always
        among them.
    outlier_deg : float
        Height of a spike, of either sign.
    losses : tuple of str
        Losses compared where there are outliers; see `fit_optimum`.
    datasets : int
        Largest number of datasets.
    subsets : int
        At most this many subsets of one size.
    """

    points: tuple[int, ...] = (10, 20, 50, 100)
    outliers: tuple[float, ...] = (0.0, 0.02, 0.05, 0.1)
    outlier_deg: float = 20.0
    losses: tuple[str, ...] = ("linear", "huber")
    datasets: int = TRIALS
    subsets: int = 64


def ablate(data: CampaignData, options: AblationOptions, seed: int = 1) -> pd.DataFrame:
    """Fit subsets of a campaign's step responses.

    Parameters
    ----------
    data : CampaignData
        A campaign with step experiments.
    options : AblationOptions
        What is varied.
    seed : int
        Of subsets, outliers and swarms.

    Returns
    -------
    pandas.DataFrame
        One row for each group (experiment, or `ALL`), number of datasets, points, fraction of
        outliers and loss. Columns: those five; ``subsets`` fitted; for each of `QUANTITIES` its
        ``_median`` and ``_spread`` (standard deviation among subsets, as if drawn from endless
        trials); ``curve_spread_deg`` (the same of the fitted curves, RMS over time);
        ``theory_deg`` and its two parts ``theory_white_deg`` and ``theory_between_deg``;
        ``left_out_mean_deg`` and ``left_out_trials_deg`` (RMS error against the mean of the trials
        left out, and against each); ``from_all_deg`` (RMS difference from the fit to all trials
        without outliers). Where nothing is left out, or there is one subset, NaN.
    """
    rows: list[dict[str, float | str | int]] = []
    bounds = _bounds(campaign_steps(data), seed)
    for points in dict.fromkeys((*options.points, POINTS)):
        steps = campaign_steps(data, points)
        response = step_map(steps.t)
        for group, members in _groups(steps).items():
            study = _Study(group, steps.select(members), response, bounds, options, seed)
            rows += study.rows(0.0, "linear")
            if points == POINTS:
                for outliers in dict.fromkeys((0.0, *options.outliers)):
                    for loss in options.losses:
                        if outliers > 0.0 or loss != "linear":
                            rows += study.rows(outliers, loss)
    keys = ["group", "loss", "outliers", "points", "datasets"]
    return pd.DataFrame(rows).sort_values(keys, ignore_index=True)


def _bounds(steps: StepData, seed: int) -> Bounds:
    return moderate_optimum(lambda bounds: fit_optimum(steps, bounds, seed)).bounds


def _groups(steps: StepData) -> dict[str, NDArray[np.int64]]:
    groups = dict(steps.groups)
    if len(groups) > 1:
        groups[ALL] = np.arange(steps.datasets)
    return groups


class _Study:
    """Subsets of one group at one number of points."""

    def __init__(
        self,
        group: str,
        data: StepData,
        response: ResponseMap,
        bounds: Bounds,
        options: AblationOptions,
        seed: int,
    ) -> None:
        self.group, self.data, self.response = group, data, response
        self.bounds, self.options, self.seed = bounds, options, seed
        self.whole: Optimum = fit_optimum(data, bounds, seed)
        self.noise = trial_noise(data, self.whole.rmse)
        self.sizes = range(1, min(options.datasets, data.datasets) + 1)
        generator = np.random.default_rng([seed, data.datasets])
        self.subsets = {n: list(_subsets(data, n, options.subsets, generator)) for n in self.sizes}

    def rows(self, outliers: float, loss: str) -> Iterator[dict[str, float | str | int]]:
        """Fit all subsets of all sizes at once; summarise each size."""
        subsets = [subset for n in self.sizes for subset in self.subsets[n]]
        counts = np.zeros((len(subsets), self.data.datasets))
        for f, subset in enumerate(subsets):
            counts[f, subset] = 1.0
        angles = self._corrupted(outliers)
        found = fit_many(
            self.response,
            self.data,
            self.bounds,
            Draws.from_seed(self.seed),
            counts=counts,
            angles=angles,
            variant=np.arange(len(subsets)) % len(angles),
            start=np.tile(self.whole.x, (len(subsets), 1)),
            loss=loss,
        )
        curves = np.degrees(np.array([self.response.response(x) for x in found.x]))
        first = 0
        for n in self.sizes:
            chosen = slice(first, first + len(self.subsets[n]))
            first = chosen.stop
            yield {
                "group": self.group,
                "datasets": n,
                "points": self.data.points,
                "outliers": outliers,
                "loss": loss,
                "subsets": len(self.subsets[n]),
                **self._parameters(found.x[chosen], n, outliers),
                **self._curves(curves[chosen], n, outliers),
                **self._theory(n),
                **self._left_out(curves[chosen], counts[chosen]),
            }

    def _corrupted(self, outliers: float) -> Floats:
        """Return angles with spikes in a fraction of the samples, several draws of them."""
        angle = self.data.angle_rad
        if outliers == 0.0:
            return angle[np.newaxis]
        generator = np.random.default_rng([self.seed, round(1e6 * outliers)])
        hit = generator.random((_CORRUPTIONS, *angle.shape)) < outliers
        sign = generator.choice([-1.0, 1.0], size=hit.shape)
        spike: Floats = np.radians(self.options.outlier_deg) * sign * hit
        return angle + spike

    def _endless(self, n: int, outliers: float) -> float:
        """Factor from the spread among subsets of a few trials to that of endless trials.

        Outliers are drawn anew for each subset, so there the spread is left as it is.
        """
        total = self.data.datasets
        if outliers > 0.0:
            return 1.0
        return float(np.sqrt(1.0 / (1.0 - n / total))) if n < total else float("nan")

    def _parameters(self, x: Floats, n: int, outliers: float) -> dict[str, float]:
        quantities = np.column_stack([x, x[:, 4] / x[:, 3]])
        spread = _deviation(quantities) * self._endless(n, outliers)
        medians = np.median(quantities, axis=0)
        named = zip(QUANTITIES, medians, spread, strict=True)
        return {
            key: float(value)
            for name, median, deviation in named
            for key, value in ((f"{name}_median", median), (f"{name}_spread", deviation))
        }

    def _curves(self, curves: Floats, n: int, outliers: float) -> dict[str, float]:
        height = float(np.sqrt(np.mean(self.data.u**2)))
        spread = (
            float(np.sqrt(np.mean(_deviation(curves) ** 2))) * height * self._endless(n, outliers)
        )
        whole = np.degrees(self.response.response(self.whole.x))
        return {
            "curve_spread_deg": spread,
            "from_all_deg": float(np.sqrt(np.mean((curves - whole) ** 2))) * height,
        }

    def _theory(self, n: int) -> dict[str, float]:
        white = np.degrees(self.noise.white) * np.sqrt(5.0 / (self.data.points * n))
        between = np.degrees(self.noise.between) / np.sqrt(n)
        return {
            "theory_deg": float(np.hypot(white, between)),
            "theory_white_deg": float(white),
            "theory_between_deg": float(between),
        }

    def _left_out(self, curves: Floats, counts: Floats) -> dict[str, float]:
        """Squared errors on what each subset leaves out, pooled over experiments and subsets."""
        measured = np.degrees(self.data.angle_rad)
        mean_squares, trial_squares = [], []
        for curve, count in zip(curves, counts, strict=True):
            for rows in self.data.groups.values():
                left = rows[count[rows] == 0.0]
                if left.size:
                    model = self.data.u[left, np.newaxis] * curve
                    mean = measured[left].mean(axis=0) - model.mean(axis=0)
                    mean_squares.append(np.mean(mean**2))
                    trial_squares.append(np.mean((measured[left] - model) ** 2))
        if not mean_squares:
            return {"left_out_mean_deg": float("nan"), "left_out_trials_deg": float("nan")}
        return {
            "left_out_mean_deg": float(np.sqrt(np.mean(mean_squares))),
            "left_out_trials_deg": float(np.sqrt(np.mean(trial_squares))),
        }


def _deviation(values: Floats) -> Floats:
    if len(values) < 2:
        return np.full(values.shape[1], np.nan)
    return np.asarray(np.std(values, axis=0, ddof=1))


def _subsets(
    data: StepData, n: int, limit: int, generator: np.random.Generator
) -> Iterator[NDArray[np.int64]]:
    """Yield subsets of n datasets spread evenly over experiments: all, or `limit` of them."""
    groups = list(data.groups.values())
    if len(groups) == 1 and comb(data.datasets, n) <= limit:
        yield from (np.array(subset) for subset in combinations(range(data.datasets), n))
        return
    seen: set[tuple[int, ...]] = set()
    for attempt in range(20 * limit):
        # Which experiments get one more than the others turns with the attempts.
        sizes = [n // len(groups)] * len(groups)
        for k in range(n % len(groups)):
            sizes[(attempt + k) % len(groups)] += 1
        if any(size > len(group) for size, group in zip(sizes, groups, strict=True)):
            continue
        drawn = [
            generator.choice(group, size=size, replace=False)
            for size, group in zip(sizes, groups, strict=True)
        ]
        subset = tuple(sorted(int(i) for i in np.concatenate(drawn)))
        if subset not in seen:
            seen.add(subset)
            yield np.array(subset)
        if len(seen) == limit:
            return
    if not seen:
        yield np.arange(n)
