"""What nobody has a name for: free-form laws, one a place, weighed beside each other.

Every place is screened by the linear problem about what is known; the best are fitted. A place is
as probable as its evidence says at the best share that a form may miss, by the rule of `decide`,
against the other places and against no law at all. Named explanations take no part in it. The law
of the drive is fitted to the measured pressure instead: how fast it fills and vents, by what the
command is above it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.fit.bench import SHARES, Bench
from spa_fo.gap.fit.pressure import resolution, timing_error
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.fit.repeated import repeats_say, rest_of
from spa_fo.gap.noise.whitening import Factor
from spa_fo.gap.places.law_basis import (
    ORDERED,
    Basis,
    motion_basis,
    order_basis,
    relaxation_basis,
)
from spa_fo.gap.places.law_problem import ROUNDS, LawFit, fit_law
from spa_fo.gap.search.fitted import Fitted
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.mixed import Normal, Prior, Solution, solve
from spa_fo.plant.lawful import TooSteep
from spa_fo.plant.memory import STEPS_S
from spa_fo.together import each

_FITTED = 3  # places that are fitted, best of the screening
_ENOUGH, _MOST_TRIED = 0.05, 12  # of the search without a law

_TIMES_S = np.geomspace(0.03, 3.0, 13)  # first-order drives that a fit of one may begin with
_ROUNDS, _HALVED = 8, 6
_STEP = 1e-3
_MOST_ALIKE = 0.99  # correlation of neighbouring samples


def place_laws(bench: Bench, base: Fitted) -> list[LawFit]:
    """Fit a law at every place but the drive's beside what is known, the most probable first."""
    without, fits = _without_law(bench, base), fitted_laws(bench, base)
    scores = np.array([standing(without), *(standing(fit.logs) for fit in fits)])
    probability = np.exp(scores - logsumexp(scores))[1:]
    placed = [
        replace(fit, probability=share, nats=float(fit.logs[1:].max() - without[1:].max()))
        for fit, share, score in zip(fits, probability.tolist(), scores[1:], strict=True)
        if share >= SETTINGS.least and score > scores[0]
    ]
    return sorted(placed, key=lambda fit: -fit.probability)


def fitted_laws(
    bench: Bench, base: Fitted, least: float = -np.inf, apart: Sequence[str] = ()
) -> list[LawFit]:
    """Fit a law at every place but the drive's and those `apart`, the best of them to their end.

    Those that a screening finds to stand below `least` are left at that. There is one a place.
    """
    factors = _factors(bench, base)
    candidates = [each for each in _candidates(bench, base) if each[0].place not in apart]
    rough = _fits(bench, candidates, factors, rounds=1)
    screened = [fit for fit in rough if fit is not None]
    screened.sort(key=lambda fit: -standing(fit.logs))
    best = [fit for fit in screened[:_FITTED] if standing(fit.logs) >= least]
    again = [(fit.basis, replace(base, calibrated=fit.beside.calibrated)) for fit in best]
    for k, fit in enumerate(_fits(bench, again, factors)):
        screened[k] = fit or best[k]  # beyond the screening it may be too steep
    # Of the variants of one place the best stands.
    screened.sort(key=lambda fit: standing(fit.logs))
    return list({fit.basis.place: fit for fit in screened}.values())


def _factors(bench: Bench, base: Fitted) -> list[Factor]:
    """Give the factor that a law is fitted with, and those of all shares that it may miss."""
    return [bench.whitening.factor(base.level, s) for s in (SETTINGS.search_share, *SHARES)]


def _fits(
    bench: Bench,
    candidates: Sequence[tuple[Basis, Fitted]],
    factors: Sequence[Factor],
    rounds: int = ROUNDS,
) -> list[LawFit | None]:
    """Fit laws beside what is known; None is one too steep for any motion, or to compute."""

    def tried(candidate: tuple[Basis, Fitted]) -> LawFit | None:
        with suppress(TooSteep, np.linalg.LinAlgError):
            return fit_law(bench, candidate[1], candidate[0], factors, rounds)
        return None

    return each(tried, candidates)


def law_at(bench: Bench, base: Fitted, place: str) -> LawFit:
    """Fit the law of one place beside an explanation; `TooSteep` where it is too steep."""
    if place == "filling":
        return drive_law(bench.evidence, base)
    factors = [bench.whitening.factor(base.level, SETTINGS.search_share)]
    candidates = [each for each in _candidates(bench, base) if each[0].place == place]
    fits = [fit_law(bench, start, basis, factors) for basis, start in candidates]
    return max(fits, key=lambda fit: float(fit.logs[0]))


def bases(bench: Bench, base: Fitted) -> list[Basis]:
    """Lay a law at every place but the drive's over what the trials visited."""
    chain, grid = bench.chain, bench.evidence.grid
    trial = np.searchsorted(grid.step_starts[1:], np.arange(grid.level.size), side="right")
    used = (grid.cells > 0) & bench.evidence.takes_part[trial]
    step_s = np.asarray(STEPS_S[grid.level], dtype=np.float64)
    chain = chain.hung(base.x, base.effects)
    angle, memory = chain.angles(base.x, base.effects)
    before = np.concatenate([[chain.memory.rests_deg], angle[:-1]])
    cells = chain.pressure(base.effects, memory.play_kpa)
    visited = {
        "input_map": grid.step_means(cells),
        "moment": 0.5 * (before + angle),
        "damping": (angle - before) / step_s,
        "reading": angle,
    }
    laid = [motion_basis(place, over[used], step_s[used]) for place, over in visited.items()]
    longest = float(np.max(np.diff(grid.cell_starts))) * float(STEPS_S[0])
    orders = grid.orders[bench.evidence.takes_part].astype(np.float64)
    by_order = [order_basis(place, orders) for place in ORDERED]
    return [*laid, relaxation_basis(longest), *(each for each in by_order if each is not None)]


def _candidates(bench: Bench, base: Fitted) -> Iterator[tuple[Basis, Fitted]]:
    """Give each place's basis with what stands beside it.

    Whether a misread angle is that of later calibrations too, nobody knows beforehand.
    """
    for basis in bases(bench, base):
        unsure = basis.place == "reading" and bench.evidence.drift_deg.size
        for later in (False, True) if unsure else (base.calibrated.later,):
            yield basis, replace(base, calibrated=replace(base.calibrated, later=later))


def _without_law(bench: Bench, base: Fitted) -> Floats:
    """Log evidence of what is known by itself, its coefficients as free as beside a law.

    Like a law's `logs`, (1 + shares,).
    """
    problem, factors = AngleProblem(bench.freed(), base.ids, base.calibrated), _factors(bench, base)
    spread = problem.spread(base.variances)
    found = problem.search(base.z, factors[0], spread, _ENOUGH, _MOST_TRIED)
    linear = problem.linear(found.z)
    every = [problem.weigh(linear, f, base.variances, rounds=3) for f in factors]
    return np.array([log for log, _, _ in every]) + rest_of(repeats_say(problem, every[0][1]))


def standing(logs: Floats) -> float:
    """How a law stands: its evidence where it misses a share, and what missing that costs."""
    return weighed(logs[1:])


def weighed(logs: Floats) -> float:
    """Weigh log evidence by share that is missed, (shares,), at the best of them."""
    costs = np.array(SHARES) / SETTINGS.right_share
    return float(np.max(SETTINGS.temper * logs - costs))


# --- the drive -----------------------------------------------------------------------------------


def drive_law(evidence: Evidence, base: Fitted) -> LawFit:
    """Fit the law of the filling to the measured pressure, in the place of what the drive does."""
    filling = _Filling(evidence)
    e, covariance = filling.fitted()
    return LawFit(filling.basis, e, covariance, base, np.zeros(len(SHARES) + 1))


class _Filling:
    """The measured pressure of the trials that take part, and a law of it."""

    def __init__(self, evidence: Evidence) -> None:
        self.grid, self.used = evidence.grid, evidence.used
        assert self.grid.command_kpa is not None
        assert self.grid.measured_kpa is not None
        self.command = self.grid.command_kpa
        self.measured = self.grid.measured_kpa[self.used]
        counts = self.grid.counts[self.used]
        white = evidence.pressure_noise_kpa**2 / counts + resolution(evidence) ** 2 / 12.0
        self.sigma = np.sqrt(white + timing_error(evidence)[self.used] ** 2)
        above = self.grid.sampled(self.command)[self.used] - self.measured
        self.basis = motion_basis("filling", above, counts, straight=True)

    def fitted(self) -> tuple[Floats, Floats]:
        """Find coefficients by Gauss and Newton, and their covariance."""
        m = self.basis.size
        lags = [self.basis.coefficients(self.basis.knots / time) for time in _TIMES_S]
        e = min(lags, key=self._square)
        scale, square = float(np.sqrt(np.mean(e**2))), self._square(e)
        variances = np.array([scale**2])
        for _ in range(_ROUNDS):
            solution = self._solved(e, variances, scale)
            variances = solution.variances
            step, before = solution.coefficients[:m] - e, square
            for part in 0.5 ** np.arange(_HALVED):
                there = self._square(e + part * step)
                if there < square:
                    e, square = e + part * step, there
                    break
            if before - square < 1e-3 * before:
                break
        # More of the pressure is left, and for longer, than noise would leave.
        left = self._left(e)
        alike = min(max(float(left[1:] @ left[:-1]) / square, 0.0), _MOST_ALIKE)
        overdone = max(square / left.size * (1.0 + alike) / (1.0 - alike), 1.0)
        return e, solution.covariance()[:m, :m] * overdone

    def _predicted(self, e: Floats) -> Floats:
        cells = self.basis.law(e).driven(self.command, self.grid.cell_starts)
        return self.grid.sampled(cells)[self.used]

    def _left(self, e: Floats) -> Floats:
        return (self.measured - self._predicted(e)) / self.sigma

    def _square(self, e: Floats) -> float:
        left = self._left(e)
        return float(left @ left) if np.isfinite(left).all() else np.inf

    def _solved(self, e: Floats, variances: Floats, scale: float) -> Solution:
        """Solve the linear problem, with the pressure sensor's offset and gain as nuisances."""
        m, here = self.basis.size, self._predicted(e)
        slopes = [
            (self._predicted(e + step) - here) / (_STEP * scale)
            for step in _STEP * scale * np.eye(m)
        ]
        h = np.column_stack([*slopes, np.ones(here.size), here]) / self.sigma[:, None]
        left = (self.measured - here) / self.sigma + h[:, :m] @ e
        known = np.square([SETTINGS.pressure_offset_kpa, SETTINGS.pressure_gain])
        prior = Prior(
            np.zeros(m + 2),
            np.append(np.ones(m), known),
            np.append(np.zeros(m, dtype=np.int64), [-1, -1]),
            np.array([scale]),
        )
        normal = Normal(h.T @ h, h.T @ left, float(left @ left), 0.0, here.size)
        return solve(normal, prior, variances)
