"""What some trials differ by from their expected mean, beside what an explanation misses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import campaigns
from spa_fo.gap.claim import claimed
from spa_fo.gap.claim.scatter import Judging
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.decide.explanation import Explanation, simulate
from spa_fo.gap.fit.bench import GAIN, REST, TIME_SCALE, Bench, bench_for
from spa_fo.gap.noise.bench_noise import BenchNoise
from spa_fo.gap.noise.coloured import Scatter, Spectrum
from spa_fo.gap.noise.dwell_error import UNKNOWN
from spa_fo.gap.search.fitted import fit
from spa_fo.rig import read_campaign, read_trials

Floats = NDArray[np.float64]

NOISE_DEG = 0.05
SCATTER = Scatter(gain=0.02, rest_deg=0.3, time_scale=0.01)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    campaigns.step_campaign(folder, trials=3)
    evidence = replace(collect(read_trials(read_campaign(folder))), noise_deg=NOISE_DEG)
    made = bench_for(evidence, np.array(list(campaigns.TRUTH.values())), False, None)
    quiet = BenchNoise(Spectrum(NOISE_DEG**2, np.full(6, 1e-6), 2), SCATTER, UNKNOWN)
    scales = made.scales.copy()
    scales[:3] = SCATTER.gain, SCATTER.rest_deg, SCATTER.time_scale
    return replace(made, noise=quiet, scales=scales).without(
        np.zeros(len(evidence.grid.trials), dtype=bool)
    )


@pytest.fixture(scope="module")
def explained(bench: Bench) -> tuple[Explanation, Floats]:
    known = Explanation((), fit(bench, (), bench.starts), None, None)
    return known, simulate(known, bench.evidence)


def scatter_of(
    bench: Bench,
    explained: tuple[Explanation, Floats],
    more_deg: Floats,
    left_deg: float = 0.0,
) -> float:
    """Let the last trial differ from its prediction by this."""
    known, curve = explained
    evidence: Evidence = bench.evidence
    last = evidence.grid.sample_trial == evidence.grid.sample_trial.max()
    grid = replace(evidence.grid, angle_deg=curve + np.where(last, more_deg, 0.0))
    moved, none = replace(evidence, grid=grid), np.zeros_like(curve)
    return Judging(bench, known, moved, last, none, curve).scatter(left_deg)


def test_a_quiet_trial_has_the_noise_and_what_is_not_known_of_it(
    bench: Bench, explained: tuple[Explanation, Floats]
) -> None:
    found = scatter_of(bench, explained, np.zeros_like(explained[1]))
    assert NOISE_DEG < found < 1.2 * NOISE_DEG


@pytest.mark.parametrize("kind", ["gain", "rest"])
def test_what_the_trial_has_of_its_own_is_scatter(
    bench: Bench, explained: tuple[Explanation, Floats], kind: str
) -> None:
    curve = explained[1]
    more = 0.06 * curve if kind == "gain" else np.full_like(curve, 0.9)  # 3 sigma
    last = bench.evidence.grid.sample_trial == bench.evidence.grid.sample_trial.max()
    size = np.sqrt(np.average(more[last] ** 2, weights=bench.evidence.grid.counts[last]))
    found = scatter_of(bench, explained, more)
    assert found == pytest.approx(np.hypot(size, NOISE_DEG), rel=0.05)


def test_a_delay_of_its_own_is_scatter_where_an_effect_delays(
    bench: Bench, explained: tuple[Explanation, Floats]
) -> None:
    known, curve = explained
    later = -0.05 * bench.evidence.grid.slopes(curve)
    last = bench.evidence.grid.sample_trial == bench.evidence.grid.sample_trial.max()
    size = np.sqrt(np.average(later[last] ** 2, weights=bench.evidence.grid.counts[last]))
    delayed = replace(known, angle=replace(known.angle, delay_s=0.25))
    assert size > 5.0 * NOISE_DEG
    found = scatter_of(bench, (delayed, curve), later)
    assert found == pytest.approx(np.hypot(size, NOISE_DEG), rel=0.1)
    prompt = replace(known, angle=replace(known.angle, delay_s=0.0))
    assert scatter_of(bench, (prompt, curve), later) < 0.9 * size


def test_what_no_trial_has_of_its_own_is_left(
    bench: Bench, explained: tuple[Explanation, Floats]
) -> None:
    wave = np.sin(2.0 * np.pi * bench.evidence.grid.time_s / 3.0)
    assert scatter_of(bench, explained, wave) < 0.4 * np.sqrt(0.5)


def test_what_the_explanation_misses_anyway_is_no_scatter(
    bench: Bench, explained: tuple[Explanation, Floats]
) -> None:
    more = 0.04 * explained[1]
    size = np.sqrt(np.mean(more**2))
    wide = replace(
        bench, whitening=replace(bench.whitening, gap=explained[1][: bench.whitening.rows.size])
    )
    assert scatter_of(wide, explained, more, 0.0) > 0.9 * size
    assert scatter_of(wide, explained, more, 20.0 * size) < 0.8 * size


def test_more_than_trials_ever_scatter_is_left_too(
    bench: Bench, explained: tuple[Explanation, Floats]
) -> None:
    scales = bench.scales.copy()
    scales[[GAIN, REST, TIME_SCALE]] *= 1e-3
    found = scatter_of(replace(bench, scales=scales), explained, 0.3 * explained[1])
    size = np.sqrt(np.mean((0.3 * explained[1]) ** 2))
    assert found < 0.2 * size


def test_a_fast_interference_is_no_noise(
    bench: Bench, explained: tuple[Explanation, Floats]
) -> None:
    known, curve = explained
    humming = replace(bench.evidence, noise_deg=1.0)
    last = humming.grid.sample_trial == humming.grid.sample_trial.max()
    alike = replace(humming, grid=replace(humming.grid, angle_deg=curve))
    plain = Judging(bench, known, alike, last, curve, curve).scatter(0.0)
    humming_too = replace(known, line=(50.0, 1.4))
    waved = Judging(bench, humming_too, alike, last, curve, curve).scatter(0.0)
    assert plain > 1.0
    assert waved < 1.2 * NOISE_DEG


def test_what_an_explanation_takes_of_an_error_is_as_sure_as_trials_scatter(
    bench: Bench, explained: tuple[Explanation, Floats]
) -> None:
    known, curve = explained
    evidence, rng = bench.evidence, np.random.default_rng(1)
    last = evidence.grid.sample_trial >= evidence.grid.sample_trial.max() - 1
    without = 0.9 * curve
    sigma = Judging(bench, known, evidence, last, without, curve).unsure(without)
    taken = []
    for _ in range(2000):
        noise = np.zeros_like(curve)
        for trial in np.unique(evidence.grid.sample_trial[last]):
            own = evidence.grid.sample_trial == trial
            noise[own] = rng.normal(0.0, SCATTER.gain) * curve[own]
            noise[own] += rng.normal(0.0, SCATTER.rest_deg)
        errors = [
            np.average((curve + noise - each)[last] ** 2, weights=evidence.grid.counts[last])
            for each in (without, curve)
        ]
        taken.append(errors[0] - errors[1])
    assert sigma == pytest.approx(np.std(taken), rel=0.15)


def test_what_closes_is_held_against_the_gap_beyond_noise() -> None:
    # Trials that hardly show a gap say little of a share of their whole error.
    assert claimed._closed(0.789, 0.768, 0.766) > 0.4
    assert claimed._closed(4.0, 1.0, 0.5) == pytest.approx(0.95, abs=0.01)
    assert claimed._closed(0.8, 0.9, 0.75) < 0.0
    assert claimed._closed(0.7, 0.7, 0.9) == 0.0
