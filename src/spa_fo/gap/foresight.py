"""How well a protocol would tell two explanations apart, were the wrong one identified again.

One explanation is simulated as the truth, the campaign so far and then the protocol, on the same
specimen. The other takes up what it can of the difference by its coefficients, its effects'
parameters, the trials' own gain, rest angle and pace, the timing of the channels and the error of
the calibrated curve, each held by its prior and all by the campaign: a least-squares problem,
solved by Gauss-Newton steps and weighed by the noise floor. What the protocol adds to its
minimum, as an RMS in noise floors, is the separation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from spa_fo.gap.evidence import Evidence, Fixture, curve_columns
from spa_fo.gap.explain import (
    COEFFICIENT_SPREAD,
    GAIN,
    OFFSET,
    PACE,
    SCALES,
    TIMING_S,
    Slot,
    paced,
    to_x,
    to_z,
)
from spa_fo.gap.profiles import Profile
from spa_fo.gap.rivals import Rival
from spa_fo.plant.chain import Chain, Memory, Seat, chain_for
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.grid import CampaignGrid, campaign_grid
from spa_fo.plant.memory import STEPS_S
from spa_fo.rig import Trial

Floats = NDArray[np.float64]

_REST_S = 120.0  # between the campaign and what follows it
_LONGEST_LEVEL = 2  # 0.08 s: ramps and sines have no jumps that would ask for short steps
_PIECE_S = 0.5  # the floor deviates independently from one such piece of a trial to the next
_ASSUMED_TAP_KPA = 0.5
_ROUNDS = 3
_SLOPE_STEP = 1e-4
_PACE_STEP = 2e-3


@dataclass(frozen=True)
class Bench:
    """What the next experiment is run on and seen with.

    Attributes
    ----------
    grid : CampaignGrid
        The campaign so far; the specimen remembers it.
    reference_kpa : float
        Pressure at which u = 1.
    floor_deg, floor_kpa : float
        What repeated trials differ by.
    tapped : bool
        Whether the pressure is measured.
    curve_sigma_deg : (knots,) array
        Error of the calibrated curve.
    fixture : Fixture or None
        The calibrations, which a sensor with a memory remembers.
    """

    grid: CampaignGrid
    reference_kpa: float
    floor_deg: float
    floor_kpa: float
    tapped: bool
    curve_sigma_deg: Floats
    fixture: Fixture | None


def bench_of(evidence: Evidence, floor_deg: float) -> Bench:
    """Take the bench as the campaign shows it."""
    noise_kpa = evidence.pressure_noise_kpa
    return Bench(
        grid=evidence.grid,
        reference_kpa=evidence.data.campaign.reference_kpa,
        floor_deg=floor_deg,
        floor_kpa=float(np.hypot(noise_kpa, evidence.tolerance_kpa))
        if evidence.has_pressure
        else _ASSUMED_TAP_KPA,
        tapped=evidence.has_pressure,
        curve_sigma_deg=evidence.curve_sigma_deg,
        fixture=evidence.fixture,
    )


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


class Foresight:
    """A campaign as every one of its explanations sees it, and what could follow.

    Parameters
    ----------
    bench : Bench
        The campaign so far.
    rivals : sequence of Rival
        The explanations.
    """

    def __init__(self, bench: Bench, rivals: Sequence[Rival]) -> None:
        self.bench = bench
        self.past = [_View(bench, _Form(one, bench), bench.grid) for one in rivals]

    def now(self, pairs: Pairs) -> list[Separation]:
        """How well the campaign's own protocol separates each pair of explanations."""
        return [
            Separation(
                *(self._smaller(self._past, i, j, tapped) for tapped in (self.bench.tapped, True))
            )
            for i, j in pairs
        ]
