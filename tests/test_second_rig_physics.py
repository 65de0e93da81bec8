"""The second rig's solver, effects and noise."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from blind import second_rig
from blind.second_rig import EFFECTS, FOREIGN, NAME
from blind.second_rig.bank import Core, bank
from blind.second_rig.bench import draw_bench, draw_core, make_plan, off_core, scattered, scene_of
from blind.second_rig.body import VOIGTS, BodyState, Laws, run
from blind.second_rig.effects import LIBRARY
from blind.second_rig.flex import calibrate
from blind.second_rig.foreign import DRAWS
from blind.second_rig.noise import coloured, white
from blind.second_rig.protocols import experiments
from blind.second_rig.sensor import When
from blind.second_rig.sizes import Ruler
from blind.second_rig.timeline import play
from conftest import SHARED
from naive_second_rig import document, step_response
from second_rig_cases import forms, ruler
from spa_fo.plant.effects.library import IDS

PAPER = {
    "DS20": Core(1.406, 1.196, 0.794, 1.638, 0.934),
    "FX-Pro": Core(1.424, 1.170, 0.986, 2.103, 0.728),
}
NO_CREEP = (np.zeros(VOIGTS), np.ones(VOIGTS))
ALL = {**LIBRARY, **DRAWS}


def plain_step(core: Core, length_s: float, step_s: float = 0.002) -> np.ndarray:
    drive = np.full(round(length_s / step_s), core.b0)
    body = bank(core, step_s)
    return run(body, Laws(top=1.0), core.a0, drive, NO_CREEP, BodyState(), step_s)


@pytest.mark.parametrize("material", PAPER)
def test_step_response_is_the_paper_s(
    material: str, golden_step: dict[str, dict[str, str]]
) -> None:
    core = PAPER[material]
    angle = plain_step(core, 100.0)
    for t_s, value in golden_step[material].items():
        found = angle[round(float(t_s) / 0.002)]
        assert abs(found - float(value)) < 0.001 * core.gain


def test_step_response_of_drawn_cores_is_the_inverse_laplace_transform() -> None:
    for seed in range(3):
        _, core = draw_core(np.random.default_rng(seed))
        angle = plain_step(core, 20.0)
        for t_s in (0.1, 0.6, 2.0, 7.0, 20.0):
            found = angle[round(t_s / 0.002)]
            assert abs(found - step_response(core, t_s)) < 0.002 * core.gain


def test_a_body_with_moments_settles_where_they_balance() -> None:
    core = PAPER["DS20"]
    laws = Laws(top=1.0, quadratic=0.2, cubic=0.3, weight=0.1, orientation=0.4)
    drive = np.full(40_000, core.b0)
    y = run(bank(core, 0.01), laws, core.a0, drive, NO_CREEP, BodyState(), 0.01)[-1]
    moment = y * (0.2 * y + 0.3 * y**2) + 0.1 * (np.sin(0.4 + y) - np.sin(0.4))
    assert y + moment == pytest.approx(core.gain, abs=2e-4)


def test_the_list_of_effects_is_the_contract_s() -> None:
    assert NAME == "second_rig"
    assert set(FOREIGN) == set(DRAWS)
    assert len(FOREIGN) >= 10
    contract = SHARED / "contract" / "effects.yaml"
    if not contract.is_file():
        pytest.skip(f"needs {contract} (set SPA_FO_SHARED)")
    named = set(yaml.safe_load(contract.read_text())["effects"])
    assert set(EFFECTS) == named
    assert not named & set(FOREIGN)
    assert all(set(ids) <= set(IDS) for ids in FOREIGN.values())


@pytest.mark.parametrize("name", ALL)
def test_an_effect_is_neutral_at_zero_small_when_small_and_as_large_as_asked(name: str) -> None:
    for effect in forms(ALL[name]):
        assert effect.id == name
        assert ruler().size((effect.sized(0.0),)) == 0.0
        assert ruler().size((effect.sized(1e-3 * effect.limit),)) < 1.0
        sized = ruler().sized(effect, 2.0)
        assert 0.0 < sized.amplitude < effect.limit
        assert ruler().size((sized,)) == pytest.approx(2.0, rel=0.02)


def test_no_code_is_shared_with_what_is_judged() -> None:
    sources = sorted(Path(second_rig.__file__).parent.glob("*.py"))
    assert len(sources) > 10
    for path in sources:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names.append(node.module or "")
            assert not any(name.split(".")[0] == "spa_fo" for name in names), path


def test_what_cannot_be_that_large_is_as_large_as_is_sensible() -> None:
    effect = LIBRARY["contact_stop"](np.random.default_rng(0), ruler().scene)
    sized = ruler().sized(effect, 1e3)
    assert sized.amplitude == effect.limit
    assert np.abs(ruler().angles((sized,))).max() < 85.0


@pytest.mark.parametrize("name", ["sensor_lag", "sensor_creep", "sensor_hysteresis"])
def test_what_sits_in_the_sensor_shows_within_any_calibration(name: str) -> None:
    for order in (0, 5):
        assert calibration_change(name, order) > 0.1


@pytest.mark.parametrize("name", ["sensor_nonlinearity", "sensor_saturation", "sensor_slip"])
def test_what_came_after_the_first_calibration_shows_in_a_later_one(name: str) -> None:
    assert calibration_change(name, 0) == 0.0
    assert calibration_change(name, len(ruler().plan.trials)) > 0.1


def test_what_sits_in_body_or_drive_shows_in_no_calibration() -> None:
    for name in ("creep", "hysteresis", "leak", "gravity_load"):
        assert calibration_change(name, 5) == 0.0


def calibration_change(name: str, order: int) -> float:
    """Mean change of a calibration's counts by an effect, in degrees."""
    effect = ruler().sized(LIBRARY[name](np.random.default_rng(1), ruler().scene), 4.0)
    bench = ruler().bench
    counts = [
        calibrate(
            bench.fixture,
            bench.curve,
            effects,
            bench.surroundings,
            When(0.0, order),
            np.random.default_rng(7),
        ).counts
        for effects in ((), (effect,))
    ]
    slope = float(bench.curve.resolution_deg(np.array([30.0]))[0])
    return float(np.abs(counts[1] - counts[0]).mean()) * slope


def test_softening_creep_and_friction_carry_over_to_the_next_trial() -> None:
    asked = document()
    tried = experiments("releases", 4, np.random.default_rng(3))[1:]
    plan = make_plan(
        tried, "blocked", 0.0, asked["surroundings"]["sampling"], np.random.default_rng(4)
    )
    bench, plan = draw_bench(asked["surroundings"], plan, 65.0, np.random.default_rng(5))
    rule = Ruler(bench, plan, scene_of(bench, plan, 65.0))
    count = plan.trials[0].times.size
    for effect in forms(LIBRARY["mullins_softening"]):
        change = (rule.angles((effect.sized(0.3),)) - rule.bare).reshape(4, count)
        lost = -change.min(axis=1)
        assert np.all(np.diff(lost) < 0.0)  # each trial is softer than the last,
        assert lost[2] - lost[3] < lost[0] - lost[1]  # by less and less
    for effect in forms(LIBRARY["hysteresis"]):
        change = (rule.angles((effect.sized(0.1),)) - rule.bare).reshape(4, count)
        assert abs(change[0, 0]) < 1e-6
        assert change[1, 0] > 0.5  # a remnant angle


def test_coloured_noise_is_stationary_of_the_size_and_correlation_asked() -> None:
    times = np.arange(800) / 50.0
    rng = np.random.default_rng(0)
    noise = {"colour": "exponential", "coloured_deg": 0.3, "correlation_s": 0.5, "white_deg": 0.1}
    drawn = np.array([coloured(noise, times, rng) for _ in range(600)])
    assert drawn.std(axis=0) == pytest.approx(0.3, rel=0.15)
    assert drawn[:, 0].std() == pytest.approx(0.3, rel=0.1)
    assert np.mean(drawn[:, :-25] * drawn[:, 25:]) / 0.09 == pytest.approx(np.exp(-1.0), abs=0.03)
    assert white(noise, 20_000, rng).std() == pytest.approx(0.1, rel=0.02)


def test_one_over_f_noise_falls_with_frequency() -> None:
    noise = {"colour": "one_over_f", "coloured_deg": 0.3, "correlation_s": None, "white_deg": 0.0}
    rng = np.random.default_rng(0)
    for count in (1000, 1001):
        drawn = np.array([coloured(noise, np.arange(count) / 50.0, rng) for _ in range(400)])
        assert np.sqrt(np.mean(drawn**2)) == pytest.approx(0.3, rel=0.03)
        power = np.mean(np.abs(np.fft.rfft(drawn)) ** 2, axis=0)
        low, high = power[8:13].mean(), power[80:130].mean()
        assert low / high == pytest.approx(10.0, rel=0.15)


def test_each_dwell_has_an_error_of_its_own() -> None:
    bench = ruler().bench
    fixture = replace(bench.fixture, error_deg=2.0)
    quiet = document(noise={"white_deg": 0.0})["surroundings"]
    grid = np.linspace(-20.0, 110.0, 2000)
    level = bench.curve.level(grid)
    rank = np.argsort(level)
    errors = []
    for seed in range(12):
        log = calibrate(fixture, bench.curve, (), quiet, When(0.0, 0), np.random.default_rng(seed))
        read = np.interp(log.counts, level[rank], grid[rank]) - log.known
        dwells = read.reshape(len(fixture.angles), -1)
        assert dwells.std(axis=1).max() < 0.1
        errors += list(dwells.mean(axis=1))
    assert np.std(errors) == pytest.approx(2.0, rel=0.15)


def test_repeats_differ_from_their_mean_by_the_noise_floor() -> None:
    rule = ruler("releases")
    surroundings, rng = rule.bench.surroundings, np.random.default_rng(8)
    repeats = []
    for _ in range(60):
        plan = scattered(rule.plan, surroundings["scatter"], rng)
        readings = play(rule.bench.core, (), plan.trials, rule.scene)
        noisy = [
            reading.angle
            + coloured(surroundings["noise"], trial.times, rng)
            + white(surroundings["noise"], trial.times.size, rng)
            for reading, trial in zip(readings, plan.trials, strict=True)
        ]
        repeats.append(np.concatenate(noisy))
    step = rule.bench.resolution_deg(rule.bare)
    read = step * np.rint(np.array(repeats) / step)
    found = float(np.sqrt(np.mean(np.var(read, axis=0, ddof=1))))
    assert rule.floor_deg == pytest.approx(found, rel=0.1)


def test_a_model_that_is_off_is_off_by_as_much_as_said() -> None:
    core = ruler().bench.core
    given = off_core(core, 0.01, np.random.default_rng(0))
    for name, error in (("alpha2", 0.002), ("alpha1", 0.002), ("a1", 0.01), ("a0", 0.01)):
        assert abs(getattr(given, name) / getattr(core, name) - 1.0) == pytest.approx(error)
