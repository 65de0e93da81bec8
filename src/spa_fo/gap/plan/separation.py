"""How well a protocol would tell two explanations apart, were the wrong one identified again.

One explanation is simulated as the truth, the campaign so far and then the protocol, on the same
specimen. The other compensates for the difference by its coefficients, its effects'
parameters, the trials' own gain, rest angle and rate, the timing of the channels and the error of
the calibrated curve, each held by its prior and all by the campaign: a least-squares problem,
solved by Gauss-Newton steps and weighed by the noise floor. What the protocol adds to its
minimum, as an RMS in noise floors, is the separation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.plan.profiles import Profile
from spa_fo.gap.plan.refit import Bench, Form, Refit, Stretch, View, refit, refit_at
from spa_fo.gap.plan.rivals import Rival
from spa_fo.plant.grid import CampaignGrid, campaign_grid
from spa_fo.rig import Trial

Floats = NDArray[np.float64]

_REST_S = 120.0  # between the campaign and what follows it
_LONGEST_LEVEL = 2  # 0.08 s: ramps and sines have no jumps that would ask for short steps


@dataclass(frozen=True)
class Separation:
    """What tells two explanations apart, RMS in noise floors.

    Attributes
    ----------
    seen : float
        With the signals that the campaign logs.
    tapped : float
        With the pressure measured as well.
    """

    seen: float
    tapped: float


Pairs = Sequence[tuple[int, int]]


class PairwiseSeparation:
    """The separation of pairs of explanations, by the campaign and by what could follow it.

    Parameters
    ----------
    bench : Bench
        The campaign so far.
    rivals : sequence of Rival
        The explanations.
    """

    def __init__(self, bench: Bench, rivals: Sequence[Rival]) -> None:
        self.bench = bench
        self.forms = [Form(one, bench) for one in rivals]
        self.past = [View(form, bench, bench.grid) for form in self.forms]
        self._refits: dict[tuple[int, int, bool], Refit] = {}

    def now(self, pairs: Pairs) -> list[Separation]:
        """Say how well the campaign's own protocol separates each pair of explanations."""

        def missed(k: int, truth: int, tapped: bool) -> float:
            return self.past[k].rms(self._refit_past(k, truth, tapped).cost)

        return [self._separation(missed, pair) for pair in pairs]

    def after(self, profile: Profile, pairs: Pairs) -> list[Separation]:
        """Say how well a profile that follows the campaign would separate each pair."""
        grid = _grid_after(self.bench.grid, profile)
        views = [
            View(form, self.bench, grid, past.ends)
            for form, past in zip(self.forms, self.past, strict=True)
        ]

        def added(k: int, truth: int, tapped: bool) -> float:
            before = self._refit_past(k, truth, self.bench.tapped)
            past = Stretch(self.past[k], self.past[truth], self.bench.tapped)
            course = [past, Stretch(views[k], views[truth], tapped)]
            found = refit(self.forms[k], course, before.theta)
            # Where the first refit stopped short of its minimum, the second may show it.
            least = min(before.cost, refit_at(self.forms[k], [past], found.theta).cost)
            return views[k].rms(found.cost - least)

        return [self._separation(added, pair) for pair in pairs]

    def _separation(
        self, missed: Callable[[int, int, bool], float], pair: tuple[int, int]
    ) -> Separation:
        """Take the smaller of both directions, as either explanation may be the true one.

        One that holds all effects of the other can always do without those it has on top: only
        the smaller one can then be found wanting.
        """
        i, j = pair
        directions = [(i, j), (j, i)]
        one, other = set(self.forms[i].ids), set(self.forms[j].ids)
        if one < other:
            directions = [(i, j)]
        elif other < one:
            directions = [(j, i)]
        seen = min(missed(k, truth, self.bench.tapped) for k, truth in directions)
        if self.bench.tapped:
            return Separation(seen, seen)
        return Separation(seen, min(missed(k, truth, True) for k, truth in directions))

    def refitted(self, k: int, truth: int) -> Rival:
        """Give explanation `k` identified again on the campaign that explanation `truth` makes."""
        return self.forms[k].rival(self._refit_past(k, truth, self.bench.tapped).theta)

    def _refit_past(self, k: int, truth: int, tapped: bool) -> Refit:
        key = (k, truth, tapped)
        if key not in self._refits:
            course = [Stretch(self.past[k], self.past[truth], tapped)]
            self._refits[key] = refit(self.forms[k], course, np.zeros(self.forms[k].z.size))
        return self._refits[key]


def _grid_after(grid: CampaignGrid, profile: Profile) -> CampaignGrid:
    """Lay a profile behind a campaign, repeated as it asks."""
    t, command = profile.sampled()
    none = np.zeros(t.size, dtype=bool)
    trials = [
        Trial(
            experiment=profile.name,
            trial=k + 1,
            protocol="free",
            setpoint_deg=None,
            order=int(grid.orders[-1]) + 1 + k,
            started_s=grid.ends_s + _REST_S + k * profile.every_s,
            t_s=t,
            command_kpa=command,
            pressure_kpa=None,
            flex_adc=None,
            angle_deg=np.zeros(t.size),
            after_reset=none,
            outside_calibration=none,
        )
        for k in range(profile.repeats)
    ]
    return campaign_grid(trials, profile.name, grid.ends_s, longest=_LONGEST_LEVEL)
