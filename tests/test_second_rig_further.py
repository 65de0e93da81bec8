"""The second rig's effects beyond the contract's: each form does what its name says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from blind.second_rig import EFFECTS, FOREIGN, FURTHER, write_case
from blind.second_rig.actuator import specimen
from blind.second_rig.bank import Core
from blind.second_rig.channel import end
from blind.second_rig.drive import Line, transmit
from blind.second_rig.effect import Effect
from blind.second_rig.effects import LIBRARY, ORIFICES
from blind.second_rig.further import DRAWS
from blind.second_rig.sensor import When
from blind.second_rig.timeline import Reading, play
from conftest import SHARED
from naive_second_rig import document
from second_rig_cases import forms, ruler
from spa_fo.plant.effects.library import IDS
from spa_fo.rig import CampaignData, read_campaign, read_trials

STEP_S = 0.005
CORE = Core(1.406, 1.196, 0.794, 1.638, 0.934)
SHORT = document(seed=6, protocol={"name": "releases", "repeats": 1}, sampling={"rate_hz": 20.0})


def read(folder: Path) -> CampaignData:
    return read_trials(read_campaign(folder))


def held(level: float, held_s: float, rest_s: float) -> np.ndarray:
    """A second of rest, a level, and rest again."""
    parts = ((0.0, 1.0), (level, held_s), (0.0, rest_s))
    return np.concatenate([np.full(round(long_s / STEP_S), share) for share, long_s in parts])


def piped(effect: Effect, command: np.ndarray) -> np.ndarray:
    return transmit((effect,), command, STEP_S, Line(), 0.0)


def bent(effects: tuple[Effect, ...], pressure: np.ndarray) -> np.ndarray:
    body = specimen(CORE, effects, ruler().scene)
    return body.bend(pressure, STEP_S, 0.0, 1.0, 1.0)[1:]


def test_the_list_is_of_ids_that_a_library_may_hold() -> None:
    assert len(FURTHER) == len(set(FURTHER)) == 10
    assert set(FURTHER) <= set(IDS)
    assert not set(FURTHER) & set(EFFECTS)
    contract = SHARED / "contract" / "effects.yaml"
    if contract.is_file():
        assert not set(FURTHER) & set(yaml.safe_load(contract.read_text())["effects"])


@pytest.mark.parametrize("name", FURTHER)
def test_an_effect_is_neutral_at_zero_small_when_small_and_as_large_as_asked(name: str) -> None:
    drawn = forms(DRAWS[name])
    assert len(drawn) > 1
    for effect in drawn:
        assert effect.id == name
        assert ruler().size((effect.sized(0.0),)) == 0.0
        assert ruler().size((effect.sized(1e-3 * effect.limit),)) < 0.2
        for asked in (4.0, 8.0):
            sized = ruler().sized(effect, asked)
            found = ruler().size((sized,))
            assert found < 1.03 * asked
            if found < 0.97 * asked:  # short, for it is as large as is sensible
                assert found > 1.5
                larger = effect.sized(1.2 * sized.amplitude)
                angle = ruler().angles((larger,))
                beyond = larger.amplitude > effect.limit or not -18.0 <= angle.min() <= angle.max()
                assert beyond or angle.max() > 84.0


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], CampaignData]:
    folder = tmp_path_factory.mktemp("bare")
    return write_case(SHORT, folder), read(folder / "campaign")


@pytest.mark.parametrize("name", FURTHER)
def test_every_effect_makes_a_campaign_that_is_read(
    name: str, bare: tuple[dict[str, Any], CampaignData], tmp_path: Path
) -> None:
    kind = "closed" if len(name) % 2 else "withheld"
    asked = {**SHORT, "kind": kind, "effects": [name], "sizes": [4.0]}
    truth = write_case(asked, tmp_path)
    assert truth["sizes_reached"][0] > 1.0
    assert truth["noise_floor_deg"] == bare[0]["noise_floor_deg"]
    assert truth["form"] == truth["parameters"][name]["form"]
    data, without = read(tmp_path / "campaign"), bare[1]
    read(tmp_path / "later")
    change = [
        np.mean((a.angle_deg - np.interp(a.t_s, b.t_s, b.angle_deg)) ** 2)
        for a, b in zip(data.trials, without.trials, strict=True)
    ]
    assert np.sqrt(np.mean(change)) > 0.7 * truth["noise_floor_deg"]


def test_same_document_same_bytes(tmp_path: Path) -> None:
    for name in ("sensor_freeze", "drive_hunting"):
        asked = {**SHORT, "kind": "closed", "effects": [name], "sizes": [4.0]}
        truths = [write_case(asked, tmp_path / name / turn) for turn in ("a", "b")]
        assert truths[0] == truths[1]
        sums = [(tmp_path / name / turn / "campaign/SHA256SUMS").read_text() for turn in ("a", "b")]
        assert sums[0] == sums[1]


def test_a_name_that_is_foreign_too_is_found_by_the_kind_of_case(tmp_path: Path) -> None:
    assert set(FOREIGN) & set(FURTHER) == {"body_mode"}
    found = {
        kind: write_case(
            {**SHORT, "kind": kind, "effects": ["body_mode"], "sizes": [3.0]}, tmp_path / kind
        )["form"]
        for kind in ("alien", "closed", "withheld")
    }
    assert found["alien"] == "linear_mode"
    assert found["closed"] == found["withheld"] in {e.form for e in forms(DRAWS["body_mode"])}


def test_venting_through_an_orifice_is_unlike_filling_and_slow_near_its_end() -> None:
    for effect in forms(LIBRARY["line_lag"]):
        if effect.form not in ORIFICES:
            continue
        top = ruler().scene.top_kpa
        pressure = piped(effect.sized(0.5), held(top, 6.0, 6.0))
        assert np.all((pressure >= 0.0) & (pressure <= top))
        assert pressure[round(6.9 / STEP_S)] == pytest.approx(top, rel=1e-3)
        venting = pressure[round(7.0 / STEP_S) :]
        first = np.searchsorted(-venting, -0.5 * top)
        assert np.searchsorted(-venting, -0.02 * top) > 2.5 * first
        filling = pressure[round(1.0 / STEP_S) : round(7.0 / STEP_S)]
        assert np.abs(filling + venting[: filling.size] - top).max() > 0.02 * top


def test_a_regulator_overshoots_and_settles() -> None:
    for effect in forms(DRAWS["drive_overshoot"]):
        pressure = piped(effect.sized(0.3 * effect.limit), held(30.0, 20.0, 3.0))
        assert pressure.max() > 31.0
        assert pressure[round(20.9 / STEP_S)] == pytest.approx(30.0, abs=0.3)
        assert pressure.min() >= 0.0


def test_a_regulator_hunts_about_a_held_command_only() -> None:
    for effect in forms(DRAWS["drive_hunting"]):
        top = ruler().scene.top_kpa
        pressure = piped(effect.sized(0.1), held(top, 40.0, 5.0))
        swing = pressure[round(15.0 / STEP_S) : round(40.0 / STEP_S)] / top - 1.0
        assert 0.07 < swing.max() < 0.13
        assert abs(swing.mean()) < 0.02
        assert np.count_nonzero(np.diff(np.sign(swing))) > 5
        assert np.all(pressure[-200:] == 0.0)
        ramp = np.linspace(0.0, top, round(6.0 / STEP_S))
        assert np.abs(piped(effect.sized(0.1), ramp) - ramp).max() < 0.03 * top


def test_a_gain_grows_or_falls_with_pressure() -> None:
    ways = set()
    for effect in forms(DRAWS["gain_growth"]):
        top = ruler().scene.top_input
        settled = [
            bent((effect.sized(0.3),), np.full(8000, share * top))[-1] / share
            for share in (0.05, 0.5, 1.0)
        ]
        ways.add(np.sign(settled[1] - settled[0]))
        assert np.sign(settled[2] - settled[1]) == np.sign(settled[1] - settled[0])
        assert settled[0] == pytest.approx(CORE.gain * top, rel=0.05)
    assert ways == {-1.0, 1.0}


def test_pressure_sets_the_rest_which_saturates_and_recovers() -> None:
    for effect in forms(DRAWS["pressure_set"]):
        top = ruler().scene.top_input
        pressure = np.concatenate([held(top, 60.0, 60.0), held(top, 60.0, 600.0)])
        change = bent((effect.sized(0.1),), pressure) - bent((), pressure)
        rest = change[[round(at / STEP_S) for at in (0.5, 120.5, 241.5, 780.0)]]
        assert rest[0] == 0.0
        assert rest[1] > 0.01 * ruler().scene.top_rad
        assert rest[2] < 1.7 * rest[1]
        assert rest[3] < 0.7 * rest[2]


def test_a_fold_changes_the_slope_and_snaps_shut_lower_than_it_opened() -> None:
    top = ruler().scene.top_input
    rise = np.linspace(0.0, top, round(200.0 / STEP_S))
    for effect in forms(DRAWS["opening_fold"]):
        pressure = np.concatenate([rise, rise[::-1]])
        change = bent((effect.sized(0.2),), pressure) - bent((), pressure)
        up, down = change[: rise.size], change[rise.size :][::-1]
        assert np.abs(up[: rise.size // 5]).max() < 0.01
        assert up[-1] > 0.05
        # Damping makes a loop of its own; a snap makes one between its two pressures.
        loop = np.abs(down - up)[rise.size // 10 : -rise.size // 10].max()
        assert (loop > 0.03) == (effect.form == "snap")


def test_damping_by_pressure_leaves_the_settled_angle() -> None:
    pressure = held(ruler().scene.top_input, 40.0, 30.0)
    plain = bent((), pressure)
    for effect in forms(DRAWS["pressure_damping"]):
        change = bent((effect.sized(0.6),), pressure) - plain
        assert np.abs(change).max() > 0.05
        assert abs(change[round(40.9 / STEP_S)]) < 0.02


def test_a_mode_swings_about_the_settled_angle() -> None:
    pressure = held(1.0, 30.0, 1.0)
    plain = bent((), pressure)
    for effect in forms(DRAWS["body_mode"]):
        change = (bent((effect.sized(0.1),), pressure) - plain)[200 : round(31.0 / STEP_S)]
        # It begins at rest, goes to either side of the settled angle, and fades.
        assert abs(change[0]) < 0.01
        assert change.max() > 0.004
        assert change.min() < -0.004
        assert np.abs(change[-1000:]).max() < 0.8 * np.abs(change).max()
        swings = np.count_nonzero(np.diff(np.sign(change[: round(10.0 / STEP_S)])))
        assert swings / 20.0 == pytest.approx(effect.shape["frequency_hz"], abs=0.15)


def test_a_reading_without_sign_is_never_below_its_fold_noise_included() -> None:
    times = np.arange(500) / 50.0
    noisy = np.linspace(-15.0, 60.0, 500) + np.random.default_rng(0).normal(size=500)
    for effect in forms(DRAWS["unsigned_reading"]):
        shown = end((effect.sized(22.0),), noisy, times, When(0.0, 1))
        assert shown.min() >= 2.0
        assert np.abs(shown - noisy)[noisy > 20.0].max() < 0.5
        assert shown[0] > 10.0


def test_a_sensor_comes_off_at_a_moment_for_good_or_for_a_trial() -> None:
    scene = ruler().scene
    seen = set()
    for seed in range(12):
        effect = DRAWS["sensor_detachment"](np.random.default_rng(seed), scene)
        readings = played((effect.sized(0.3 * effect.limit),))
        change = [np.abs(a.angle - b.angle) for a, b in zip(readings, played(()), strict=True)]
        trial = round(effect.shape["trial"]) - 1
        assert all(np.all(part == 0.0) for part in change[:trial])
        before = ruler().plan.trials[trial].times + scene.starts_s[trial] < effect.shape["at_s"]
        assert np.all(change[trial][before] == 0.0)
        assert change[trial].max() > 1.0
        after = [part.max() > 1.0 for part in change[trial + 1 :]]
        assert all(after) if not effect.form.endswith("for_a_trial") else not any(after)
        seen.add(effect.form)
    assert len(seen) > 3


def played(effects: tuple[Effect, ...]) -> list[Reading]:
    return play(ruler().bench.core, effects, ruler().plan.trials, ruler().scene)


def test_a_reading_freezes_noise_included_for_a_while_or_to_the_end() -> None:
    times = np.arange(1000) / 50.0
    noisy = np.random.default_rng(0).normal(size=1000)
    for effect in forms(DRAWS["sensor_freeze"]):
        trial = round(effect.shape["first_trial"])
        shown = end((effect.sized(3.0),), noisy, times, When(0.0, trial))
        stuck = np.flatnonzero(shown != noisy)
        assert 148 <= stuck.size <= 152
        assert np.ptp(shown[stuck]) == 0.0
        assert (stuck[-1] == 999) == (effect.form == "to_the_end")
        assert np.array_equal(end((effect,), noisy, times, When(0.0, 0)), noisy)
