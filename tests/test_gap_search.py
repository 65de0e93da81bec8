"""Which explanations are found, on small campaigns of an actuator whose coefficients are known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import campaigns
from spa_fo.gap.answer.causes import smallest_bic
from spa_fo.gap.data.evidence import collect
from spa_fo.gap.fit.bench import REST, Bench, bench_for
from spa_fo.gap.fit.least_squares import starts
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.search.explanations import Explanations, explain
from spa_fo.gap.search.fitted import begun, fit, settled
from spa_fo.gap.search.screening import points_of, screen
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.minimise import HOPE
from spa_fo.plant.effects.library import IDS, LIBRARY, ordered, rare
from spa_fo.rig import CampaignData, read_campaign, read_trials

GIVEN = np.array([campaigns.TRUTH[name] for name in ("alpha2", "alpha1", "a1", "a0", "b0")])
LAG_S = 0.4
FEW = ("sensor_lag", "creep", "stiffening", "mains_pickup")
OTHERS = tuple(name for name in IDS if name not in FEW)


def lagging(data: CampaignData) -> CampaignData:
    """Let the sensor follow the angle with a delay of the first order."""
    trials = []
    for trial in data.trials:
        seen = np.empty_like(trial.angle_deg)
        last = trial.angle_deg[0]
        for i, step_s in enumerate(np.diff(trial.t_s, prepend=trial.t_s[0])):
            last += (trial.angle_deg[i] - last) * (1.0 - np.exp(-step_s / LAG_S))
            seen[i] = last
        trials.append(replace(trial, angle_deg=seen))
    return replace(data, trials=tuple(trials))


def come_off(
    data: CampaignData, since_s: float, lost: float = 0.8, level_deg: float = 3.0
) -> CampaignData:
    """Let the sensor read a part of the angle, and a level, from a moment of the campaign on."""
    trials = []
    for trial in data.trials:
        off = trial.started_s + trial.t_s >= since_s
        read = np.where(off, (1.0 - lost) * trial.angle_deg + level_deg, trial.angle_deg)
        trials.append(replace(trial, angle_deg=read))
    return replace(data, trials=tuple(trials))


def hummed(data: CampaignData, hz: float, amplitude_deg: float) -> CampaignData:
    """Add a wave whose phase is each trial's own."""
    phases = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, len(data.trials))
    trials = tuple(
        replace(
            trial,
            angle_deg=trial.angle_deg
            + amplitude_deg * np.sin(2.0 * np.pi * hz * trial.t_s + phase),
        )
        for trial, phase in zip(data.trials, phases, strict=True)
    )
    return replace(data, trials=trials)


def bench_of(data: CampaignData) -> Bench:
    return bench_for(collect(data), GIVEN, own=False, pressure_kpa=None)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> CampaignData:
    folder = tmp_path_factory.mktemp("searched") / "steps"
    campaigns.step_campaign(folder, trials=3)
    return read_trials(read_campaign(folder))


@pytest.fixture(scope="module")
def lagged(clean: CampaignData) -> Explanations:
    return explain(bench_of(lagging(clean)), OTHERS)


def test_the_effect_that_is_there_explains_best(lagged: Explanations) -> None:
    alone = [f for ids, f in lagged.fits.items() if len(ids) == 1]
    best = max(alone, key=lambda f: f.logs.max())
    assert best.ids == ("sensor_lag",)
    assert best.effects[LIBRARY["sensor_lag"].first] == pytest.approx(LAG_S, rel=0.15)
    np.testing.assert_allclose(best.x[4] / best.x[3], GIVEN[4] / GIVEN[3], rtol=0.03)
    assert best.logs.max() > lagged.plain.logs.max() + 20.0


def test_a_screening_puts_it_first(lagged: Explanations) -> None:
    bench = lagged.bench
    plain = fit(bench, (), bench.starts)
    shown = screen(bench, plain, [n for n in FEW if n != "mains_pickup"])
    assert shown[0].name == "sensor_lag"
    assert shown[0].gain > 5.0
    beside = screen(bench, lagged.fits[("sensor_lag",)], ["sensor_lag", "creep"])
    assert {s.name for s in beside} == {"creep"}  # what is there already is not looked for


def rested(data: CampaignData, rest_s: float) -> CampaignData:
    """Let an actuator rest before every trial but the first, so much longer."""
    trials = [replace(t, started_s=t.started_s + (t.order - 1) * rest_s) for t in data.trials]
    return replace(data, trials=tuple(trials))


@pytest.mark.parametrize(
    ("since_s", "rest_s", "lost", "level_deg"),
    [
        (63.137, 0.0, 0.8, 3.0),  # as it bends
        (69.137, 0.0, 0.8, 3.0),  # as it relaxes
        (3.137, 300.0, 0.8, 3.0),  # most of the campaign is a rest
        (63.137, 0.0, 1.0, 3.0),  # all is lost, the most that may be
        (63.137, 0.0, 0.5, -12.0),
    ],
)
def test_the_moment_at_which_a_sensor_comes_off_is_found(
    clean: CampaignData, since_s: float, rest_s: float, lost: float, level_deg: float
) -> None:
    bench = bench_of(come_off(rested(clean, rest_s), since_s, lost, level_deg))
    plain = fit(bench, (), bench.starts)
    shown = screen(bench, plain, ["sensor_detachment"])
    assert min(one.gain for one in shown) > -1e-6
    points = points_of(shown, "sensor_detachment")
    assert not np.allclose(*points, atol=1e-4)
    found = fit(bench, ("sensor_detachment",), points, plain)
    found_lost, found_deg, since = found.effects[LIBRARY["sensor_detachment"].slots]
    assert since * bench.evidence.grid.middle_s[-1] == pytest.approx(since_s, abs=0.1)
    assert found_lost == pytest.approx(lost, abs=0.02)
    assert found_deg == pytest.approx(level_deg, abs=0.5)


def test_a_weight_that_only_bends_the_vented_actuator_is_seen(clean: CampaignData) -> None:
    """What its search begins with has no such part: each part of a sum is weighed by itself."""
    hung = [replace(trial, angle_deg=trial.angle_deg + 2.0) for trial in clean.trials]
    bench = bench_of(replace(clean, trials=tuple(hung)))
    plain = fit(bench, (), bench.starts)
    (one,) = screen(bench, plain, ["gravity_load"])
    assert one.gain > 2.0
    assert one.z[-1] > 0.0
    found = fit(bench, ("gravity_load",), [one.z], plain)
    assert np.degrees(found.effects[LIBRARY["gravity_load"].slots][-1]) == pytest.approx(
        2.0, abs=0.3
    )


def test_every_fit_that_is_ranked_is_searched_to_the_end(lagged: Explanations) -> None:
    ranked = {ids: f for ids, f in lagged.fits.items() if np.isfinite(f.logs).all()}
    assert len(ranked) > 1
    assert {ids: f.decrement for ids, f in ranked.items() if f.decrement >= 0.01} == {}


def test_what_is_not_weighed_is_far_behind(lagged: Explanations) -> None:
    best = max(f.quick for f in lagged.fits.values())
    rough = [f for f in lagged.fits.values() if not np.isfinite(f.logs).all()]
    assert rough
    assert all(f.quick + HOPE * f.decrement < best - 60.0 for f in rough)


def test_a_search_in_two_parts_ends_where_a_long_one_does(lagged: Explanations) -> None:
    bench, plain = lagged.bench, lagged.plain
    rough = begun(
        bench, ("sensor_lag",), starts(AngleProblem(bench, ("sensor_lag",)), plain.z), plain
    )
    assert rough.decrement > 0.01
    ended = settled(bench, rough, plain)
    known = lagged.fits[("sensor_lag",)]
    assert ended.quick == pytest.approx(known.quick, abs=0.02)
    assert ended.tried > rough.tried


def test_the_smallest_criterion_names_nothing_that_was_taken_out(lagged: Explanations) -> None:
    def smallest(*excluded: str) -> list[str]:
        return smallest_bic(cast(Any, SimpleNamespace(found=lagged, excluded=excluded)))

    assert smallest() == ["sensor_lag"]
    assert "sensor_lag" not in smallest("sensor_lag")


def test_what_moves_beyond_all_measure_is_left_out_and_ends_nothing(
    lagged: Explanations, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = AngleProblem.search

    def exploding(problem: AngleProblem, *told: Any) -> Any:
        if problem.ids == ("creep",):
            raise np.linalg.LinAlgError("a matrix is not positive definite")
        return search(problem, *told)

    monkeypatch.setattr(AngleProblem, "search", exploding)
    found = explain(lagged.bench, OTHERS)
    assert ("creep",) in lagged.fits
    assert ("creep",) not in found.fits
    assert ("sensor_lag",) in found.fits


def test_of_several_starts_those_that_can_be_searched_count(
    lagged: Explanations, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, plain, ids = lagged.bench, lagged.plain, ("sensor_lag",)
    search, points = AngleProblem.search, starts(AngleProblem(bench, ids), plain.z)
    best, nowhere = begun(bench, ids, points, plain), points[0] + 1e-9

    def exploding(problem: AngleProblem, start: Any, *told: Any) -> Any:
        if np.array_equal(start, nowhere):
            raise np.linalg.LinAlgError("a matrix is not positive definite")
        return search(problem, start, *told)

    monkeypatch.setattr(AngleProblem, "search", exploding)
    assert begun(bench, ids, [nowhere, *points], plain).quick == best.quick
    with pytest.raises(np.linalg.LinAlgError, match="every start"):
        begun(bench, ids, [nowhere], plain)


def shaken(data: CampaignData, deg: float) -> CampaignData:
    """Add coloured noise, of 0.3 s."""
    draw, trials = np.random.default_rng(2), []
    for trial in data.trials:
        keep = np.exp(-np.diff(trial.t_s, prepend=trial.t_s[0] - 0.01) / 0.3)
        noise = np.zeros(trial.t_s.size)
        for i, new in enumerate(deg * draw.standard_normal(noise.size)):
            noise[i] = keep[i] * noise[i - 1] + np.sqrt(1.0 - keep[i] ** 2) * new
        trials.append(replace(trial, angle_deg=trial.angle_deg + noise))
    return replace(data, trials=tuple(trials))


def test_lone_trials_that_are_noisier_than_expected_are_searched_at_their_noise(
    clean: CampaignData, lagged: Explanations
) -> None:
    one_each = {t.experiment: t for t in clean.trials}
    noisy = shaken(lagging(replace(clean, trials=tuple(one_each.values()))), 0.8)
    found = explain(bench_of(noisy), OTHERS)
    assert found.bench.level >= 2.0
    best = max(found.fits.values(), key=lambda f: f.quick)
    assert "sensor_lag" in best.ids
    assert best.level == pytest.approx(found.bench.level, rel=0.5)
    assert lagged.bench.level == 1.0


def test_what_the_library_lacks_is_not_fitted(lagged: Explanations) -> None:
    again = ("parameter_shift",)  # but for the plain model identified again, to hold others against
    named = {name for ids in lagged.fits if ids != again for name in ids}
    assert named <= set(FEW)
    assert lagged.excluded == OTHERS
    assert again in lagged.fits


def test_no_interference_is_fitted_where_there_is_none(lagged: Explanations) -> None:
    assert lagged.line.gain == 0.0
    assert not any("mains_pickup" in ids for ids in lagged.fits)


def test_a_slow_interference_is_found_beside_another_effect(clean: CampaignData) -> None:
    found = explain(bench_of(hummed(lagging(clean), 0.31, 2.0)), OTHERS)
    assert found.line.frequency_hz == pytest.approx(0.31, rel=0.05)
    best = max(found.fits.values(), key=lambda f: f.logs.max())
    assert set(best.ids) >= {"sensor_lag", "mains_pickup"}
    assert best.line is not None
    assert best.line[1] == pytest.approx(2.0, rel=0.3)
    alone = [f for ids, f in found.fits.items() if len(ids) == 1]
    assert best.logs.max() > max(f.logs.max() for f in alone) + 12.0


def test_what_makes_the_best_pair_is_tried_beside_its_kin(clean: CampaignData) -> None:
    """A lag and a latency are alike, so whatever stands beside one is fitted beside the other."""
    few = ("sensor_lag", "channel_latency", "stiffening", "sensor_creep", "creep")
    found = explain(bench_of(lagging(clean)), tuple(n for n in IDS if n not in few))
    alone = {name: found.fits[name,].quick for name in few if (name,) in found.fits}
    hosts = sorted(alone, key=lambda name: -alone[name])[:3]
    pairs = {ids: f for ids, f in found.fits.items() if len(ids) == 2}
    best = max(pairs, key=lambda ids: pairs[ids].quick)
    for host in hosts:
        for name in best:
            assert host in best or ordered((host, name)) in pairs


def test_no_explanation_holds_two_effects_that_are_rare(clean: CampaignData) -> None:
    few = ("sensor_lag", "gain_growth", "pressure_set")
    found = explain(bench_of(lagging(clean)), tuple(n for n in IDS if n not in few))
    assert any(any(map(rare, ids)) for ids in found.fits)
    assert all(sum(map(rare, ids)) < 2 for ids in found.fits)


def test_repeats_that_a_slip_sets_apart_do_not_hide_it(clean: CampaignData) -> None:
    order = {trial.label: place for place, trial in enumerate(clean.trials)}
    slipped = tuple(
        replace(t, angle_deg=t.angle_deg + 3.0 * (order[t.label] > 1)) for t in clean.trials
    )
    bench = bench_of(replace(clean, trials=slipped))
    problem = AngleProblem(bench, ("sensor_slip",))
    assert bench.scales[REST] > 2.0 * SETTINGS.rest_scatter_deg
    assert problem.scales[REST] == SETTINGS.rest_scatter_deg
    np.testing.assert_array_equal(AngleProblem(bench, ("creep",)).scales, bench.scales)
