"""What nobody has a name for: free-form laws, one a place, weighed beside each other.

Every place is screened by the linear problem about what is known; the best are fitted. A place is
as probable as its evidence says at the best share that a form may miss, by the rule of `decide`,
against the other places and against no law at all. Named explanations take no part in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.diagnosis import Likeness
from spa_fo.gap.fit.bench import SHARES, Bench
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.noise.whitening import Factor
from spa_fo.gap.places.filling import FillingFit
from spa_fo.gap.places.law_basis import Basis, motion_basis, order_basis, relaxation_basis
from spa_fo.gap.places.law_problem import LawFit, fit_law
from spa_fo.gap.places.resemblance import likenesses
from spa_fo.gap.search.fitted import Fitted
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.memory import STEPS_S

Floats = NDArray[np.float64]

_FITTED = 3  # places that are fitted, best of the screening
_ENOUGH, _MOST_TRIED = 0.05, 12  # of the search without a law


@dataclass(frozen=True)
class PlacedLaw:
    """A law at its place.

    Attributes
    ----------
    fit : LawFit
        Its fit.
    probability : float
        Of its place, all places and no law at all together 1.
    nats : float
        Log evidence against no law.
    resembles : tuple of Likeness
        Forms, the most alike first.
    """

    fit: LawFit
    probability: float
    nats: float
    resembles: tuple[Likeness, ...]


def place_laws(bench: Bench, base: Fitted) -> tuple[PlacedLaw, ...]:
    """Fit a law at every place beside an explanation, the most probable first.

    Parameters
    ----------
    bench : Bench
        The campaign; trials that judge take no part in it.
    base : Fitted
        What is known: the plain model, or the part that has a name.
    """
    factors = [bench.whitening.factor(base.level, s) for s in (SETTINGS.search_share, *SHARES)]
    without = _without_law(bench, base, factors)
    screened = []
    for basis in bases(bench, base):
        for changed in _variants(bench, base, basis):
            start = replace(base, changed=changed)
            with suppress(ValueError):  # too steep for any motion: there is no such law
                screened.append(_fit(bench, start, basis, factors, rounds=1))
    screened.sort(key=lambda fit: -_score(fit.logs))
    fits = []
    for fit in screened[:_FITTED]:
        try:
            fits.append(_fit(bench, replace(base, changed=fit.changed), fit.basis, factors))
        except ValueError:  # what lies beyond the screening is too steep
            fits.append(fit)
    places = {fit.basis.place: fit for fit in sorted(fits + screened[_FITTED:], key=_worth)}
    scores = np.array([_score(without), *(_score(fit.logs) for fit in places.values())])
    probability = np.exp(scores - logsumexp(scores))[1:]
    ordered = sorted(
        zip(places.values(), probability.tolist(), strict=True), key=lambda each: -each[1]
    )
    return tuple(
        PlacedLaw(
            fit,
            share,
            float(fit.logs[1:].max() - without[1:].max()),
            likenesses(fit.basis, fit.e, fit.covariance, _line(fit)),
        )
        for fit, share in ordered
        if share >= SETTINGS.least and _score(fit.logs) > scores[0]
    )


def law_at(bench: Bench, base: Fitted, place: str) -> LawFit:
    """Fit the law of one place beside an explanation."""
    factors = [bench.whitening.factor(base.level, SETTINGS.search_share)]
    fits = [
        _fit(bench, replace(base, changed=changed), basis, factors)
        for basis in bases(bench, base)
        if basis.place == place
        for changed in _variants(bench, base, basis)
    ]
    return max(fits, key=lambda fit: float(fit.logs[0]))


def drive_law(evidence: Evidence, base: Fitted) -> PlacedLaw:
    """Fit the law of the filling to the measured pressure, in the place of what the drive does."""
    found = FillingFit(evidence)
    fit = LawFit(
        basis=found.basis,
        changed=base.changed,
        e=found.e,
        covariance=found.covariance,
        z=base.z,
        effects=base.effects,
        predicted_deg=base.predicted_deg,
        logs=np.zeros(len(SHARES) + 1),
    )
    return PlacedLaw(fit, 1.0, 0.0, likenesses(fit.basis, fit.e, fit.covariance))


def bases(bench: Bench, base: Fitted) -> list[Basis]:
    """Lay a law at every place over what the trials visited."""
    chain, grid = bench.chain, bench.evidence.grid
    trial = np.searchsorted(grid.step_starts[1:], np.arange(grid.level.size), side="right")
    used = (grid.cells > 0) & bench.evidence.takes_part[trial]
    step_s = np.asarray(STEPS_S[grid.level], dtype=np.float64)
    angle, memory = chain.angles(base.x, base.effects)
    before = np.concatenate([[0.0], angle[:-1]])
    cells = chain.pressure(base.effects, memory.play_kpa)
    visited = {
        "input_map": grid.step_means(cells),
        "moment": 0.5 * (before + angle),
        "damping": (angle - before) / step_s,
        "reading": angle,
    }
    weight = step_s[used]
    laid = [motion_basis(place, over[used], weight) for place, over in visited.items()]
    longest = float(np.max(np.diff(grid.cell_starts))) * float(STEPS_S[0])
    orders = grid.orders[bench.evidence.takes_part].astype(np.float64)
    by_order = [order_basis(place, orders) for place in ("trial_gain", "trial_rest")]
    return [*laid, relaxation_basis(longest), *(each for each in by_order if each is not None)]


def _variants(bench: Bench, base: Fitted, basis: Basis) -> tuple[bool, ...]:
    """Whether a misread angle is that of later calibrations too: nobody knows beforehand."""
    if basis.place == "reading" and bench.evidence.drift_deg.size:
        return (False, True)
    return (base.changed,)


def _fit(
    bench: Bench, base: Fitted, basis: Basis, factors: Sequence[Factor], rounds: int = 4
) -> LawFit:
    return fit_law(bench, base.ids, base.changed, base.z, base.variances, basis, factors, rounds)


def _without_law(bench: Bench, base: Fitted, factors: Sequence[Factor]) -> Floats:
    """Log evidence of what is known by itself, its coefficients as free as beside a law."""
    problem = AngleProblem(bench.shifted(), base.ids, base.changed)
    spread = problem.spread(base.variances)
    found = problem.search(base.z, factors[0], spread, _ENOUGH, _MOST_TRIED)
    linear = problem.linear(found.z)
    weighed = [problem.weigh(linear, factor, base.variances, rounds=3) for factor in factors]
    return np.array([log for log, _, _ in weighed])


def _score(logs: Floats) -> float:
    """How a law stands: its evidence where it misses a share, and what missing that costs."""
    costs = np.array(SHARES) / SETTINGS.right_share
    return float(np.max(SETTINGS.temper * logs[1:] - costs))


def _worth(fit: LawFit) -> float:
    return _score(fit.logs)


def _line(fit: LawFit) -> float | None:
    """Slope of the line that the plain model has at a law's place, where a form may replace it."""
    return 1.0 if fit.basis.place in ("input_map", "reading") else None
