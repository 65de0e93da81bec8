"""The virtual rig's blind cases: what a document asks for is really there, sizes are as told."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from blind.first_rig import EFFECTS, FOREIGN, FURTHER, NAME, write_case
from blind.first_rig.asked import Noise, read_document
from blind.first_rig.campaign import Plan, Recorder
from blind.first_rig.case import Case
from blind.first_rig.logs import draw_board_format
from blind.first_rig.noise import exponential, one_over_f, reading_noise
from blind.first_rig.programme import LOG_S, Programme, draw_programme, draw_top_deg
from blind.first_rig.sizing import at_rate, exact_angles, noise_floor_deg, rms, solve, with_core
from blind.first_rig.station import held
from blind_documents import document, read
from spa_fo.errors import BadInput
from spa_fo.plant.effects.library import CONTRACT, IDS
from spa_fo.plant.model_file import read_model
from spa_fo.virtual_rig.campaign_writer import write_folder

NO_NOISE = {"coloured_deg": 0.0, "white_deg": 0.0}
NO_SCATTER = {"gain": 0.0, "time_scale": 0.0, "rest_deg": 0.0}
DIRECT = {"kind": "none"}
FINE = {"bits": 16}
CLEAN = {"jitter": 0.0, "missing": 0.0, "damaged": 0.0}


def case(*effects, **changes) -> Case:
    return Case(read_document(document(*effects, **changes)))


def tree(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def campaign(asked, tmp_path, name="campaign"):
    """Record one campaign of a document and read it."""
    files = Case(read_document(asked)).campaigns()[name]
    folder = tmp_path / f"read_{len(list(tmp_path.iterdir()))}"
    write_folder(files, folder)
    return read(folder)


def angles(data):
    return np.concatenate([trial.angle_deg for trial in data.trials])


# --- the interface ------------------------------------------------------------------------------


def test_the_package_offers_what_a_rig_offers():
    assert NAME == "virtual_rig"
    assert sorted(EFFECTS) == sorted(CONTRACT)
    assert set(FURTHER) <= set(IDS) - set(CONTRACT)
    assert FOREIGN
    assert not set(FOREIGN) & set(EFFECTS)
    assert {name for fair in FOREIGN.values() for name in fair} <= set(IDS)


def test_same_document_same_bytes_and_another_seed_others(tmp_path):
    asked = document("creep", model={"kind": "earlier"}, sampling={"rate_hz": 20.0})
    truth = write_case(asked, tmp_path / "one")
    assert write_case(asked, tmp_path / "two") == truth
    assert json.loads(json.dumps(truth, allow_nan=False)) == truth
    files = tree(tmp_path / "one")
    assert files == tree(tmp_path / "two")
    assert {name.split("/")[0] for name in files} == {"campaign", "later", "earlier"}
    write_case({**asked, "seed": 12}, tmp_path / "other")
    other = tree(tmp_path / "other")
    assert not [name for name in files.keys() & other.keys() if files[name] == other[name]]
    with pytest.raises(BadInput, match="exists already"):
        write_case(asked, tmp_path / "one")


@pytest.mark.parametrize(
    "changes",
    [
        {"schema": "spa-fo/blind-case/2"},
        {"kind": "pair"},
        {"kind": "strange"},
        {"effects": ["creep", "leak"]},
        {"sizes": []},
        {"protocol": {"name": "steps"}},
        {"protocol": {"order": "sorted"}},
        {"model": {"kind": "nominal"}},
        {"noise": {"colour": "pink"}},
        {"calibration": {"kind": "after"}},
        {"effects": ["ghost"]},
        {"effects": ["slow_exhaust"]},
        {"kind": "alien"},
    ],
    ids=str,
)
def test_what_the_interface_does_not_know_is_refused(changes):
    asked = document("creep")
    for key, value in changes.items():
        home = asked["surroundings"] if key in asked["surroundings"] else asked
        home[key] = {**home[key], **value} if isinstance(value, dict) else value
    with pytest.raises(ValueError, match=r"expected one of|effects, each with a size"):
        read_document(asked)


SURROUNDINGS = {
    "slow": {
        "protocol": {"name": "rich", "repeats": 1},
        "sampling": {"rate_hz": 10.0, "jitter": 0.1},
        "calibration": {"kind": "before_and_after", "dwell_s": 2.0, "angles": 3, "directions": 1},
    },
    "fast": {
        "protocol": {"name": "releases", "repeats": 1},
        "sampling": {"rate_hz": 200.0, "jitter": 0.1},
        "calibration": {"dwell_s": 2.0, "angles": 19},
    },
    "coarse": {"converter": {"bits": 8}, "pressure": {"resolution_kpa": 2.0}},
    "fine": {"converter": FINE, "pressure": {"resolution_kpa": 0.05}},
    "one_over_f": {"noise": {"colour": "one_over_f", "coloured_deg": 1.5, "correlation_s": None}},
    "angle": {"calibration": {"kind": "none"}, "pressure": {"lag_s": 0.1}},
    "no_pressure": {"pressure": {"measured": False}, "protocol": {"name": "single"}},
    "broken": {"sampling": {"missing": 0.05, "damaged": 0.02}},
    "csv_counts": {"converter": {"bits": 8}, "pressure": {"resolution_kpa": 0.1}},
    "everything": {"protocol": {"name": "everything", "repeats": 1, "order": "blocked"}},
}


@pytest.mark.parametrize("changes", SURROUNDINGS.values(), ids=SURROUNDINGS.keys())
@pytest.mark.parametrize("seed", [1, 2])
def test_all_surroundings_are_read(changes, seed, tmp_path):
    asked = document(seed=seed, **changes)
    truth = write_case(asked, tmp_path / "case")
    around = asked["surroundings"]
    now, later = read(tmp_path / "case" / "campaign"), read(tmp_path / "case" / "later")
    for data in (now, later):
        csv = data.campaign.log.format == "csv"
        assert csv or around["calibration"]["kind"] != "none"
        seen = [trial.pressure_kpa is not None for trial in data.trials]
        assert set(seen) == {around["pressure"]["measured"]}
        assert all(trial.command_kpa is not None for trial in data.trials)
        kind = around["calibration"]["kind"]
        expected = {"none": 0, "before": 1, "before_and_after": 2}[kind]
        assert len(data.calibrations) == (expected if data is now else min(expected, 1))
    assert sum(trial.t_s[-1] for trial in now.trials) <= LOG_S
    assert sum(trial.t_s[-1] for trial in later.trials) <= 120.0
    assert len(later.campaign.experiments) >= 3
    assert len(later.trials) >= 5
    assert 45.0 < angles(now).max() < 85.0
    assert truth["noise_floor_deg"] > around["noise"]["white_deg"]


def test_both_formats_are_drawn():
    formats = {suffix for seed in range(12) for suffix in [case(seed=seed).formats()[1].suffix]}
    assert formats == {"log", "csv"}


def test_the_banner_says_what_the_converter_is(tmp_path):
    for bits in (8, 16):
        asked = document(converter={"bits": bits}, pressure={"measured": False}, seed=3)
        files = Case(read_document(asked)).campaigns()["campaign"]
        logs = [data for name, data in files.items() if name.endswith(".log")]
        assert len(logs) == 5
        head = f" adc_bits={bits} vref_mv=5000 rate_hz=50 ".encode()
        assert all(head in data.partition(b"\n")[0] for data in logs)
        assert f"adc_max: {2**bits - 1}".encode() in files["campaign.yaml"]
        assert not [data for data in logs if b"p_adc" in data]


# --- what is tried ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["up_steps", "releases", "rich", "everything", "single"])
def test_programmes_are_as_described(name):
    kinds = {
        "up_steps": {"step"},
        "releases": {"step_release"},
        "rich": {"step_release", "staircase", "triangle", "hold"},
    }
    kinds["everything"] = kinds["rich"] | {"free"}
    single = 0
    for seed in range(20):
        for repeats in (1, 3, 8):
            order = ("blocked", "interleaved")[seed % 2]
            protocol = {"name": name, "repeats": repeats, "order": order}
            asked = read_document(document(seed=seed, protocol=protocol))
            programme = draw_programme(asked, CORE)
            length_s = {e.name: e.profile.duration_s for e in programme.experiments}
            assert sum(length_s[trial] for trial in programme.order) <= LOG_S
            assert len(length_s) == len(programme.experiments)
            found = {experiment.profile.protocol for experiment in programme.experiments}
            counts = [programme.order.count(trial) for trial in length_s]
            if name == "single":
                assert set(counts) == {1}
                assert found in ({"free"}, kinds["rich"])
                single += found == {"free"}
                continue
            assert found == kinds[name]
            assert counts[:2] == [repeats] * 2
            assert all(1 <= count <= repeats for count in counts)
            changes = sum(a != b for a, b in pairwise(programme.order))
            assert order == "interleaved" or changes == len(counts) - 1
            if order == "interleaved" and repeats == 8:
                assert changes > len(counts)
    assert name != "single" or 15 < single < 45


CORE = case().core


def test_a_held_command_keeps_its_area():
    rng = np.random.default_rng(0)
    time = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 3.9, 60))])
    command = rng.uniform(0.0, 50.0, 61)
    grid = np.linspace(0.0, 4.0, 2001)
    fine = held(command, time, grid)
    area = command @ np.diff(time, append=4.0)
    assert fine.sum() * 0.002 == pytest.approx(area, rel=1e-9)
    inside = np.searchsorted(time, grid, side="right") - 1
    alone = inside[:-1] == np.searchsorted(time, grid[1:], side="left") - 1
    np.testing.assert_allclose(fine[alone], command[inside[:-1][alone]], atol=1e-8)


# --- noise --------------------------------------------------------------------------------------


def test_exponential_noise_has_its_correlation_whatever_the_times():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.02, 0.3, 200_000))
    noise = exponential(time, rng)
    assert noise.std() == pytest.approx(1.0, rel=0.05)
    for lag in (1, 5, 12):
        expected = np.exp(-(time[lag:] - time[:-lag])).mean()
        assert np.mean(noise[lag:] * noise[:-lag]) == pytest.approx(expected, abs=0.04)
    first = [exponential(time[:5], rng)[0] for _ in range(2000)]
    assert np.std(first) == pytest.approx(1.0, rel=0.08)


def test_one_over_f_noise_has_its_spectrum_and_is_not_periodic():
    rng = np.random.default_rng(2)
    drawn = np.array([one_over_f(1000, rng) for _ in range(400)])
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(1.0, rel=0.04)
    # A trial's own mean has little to it: there is nothing below one period a trial.
    window = np.hanning(1000)
    power = np.mean(np.abs(np.fft.rfft(drawn * window)) ** 2, axis=0)
    cycles = np.arange(5, 400)
    slope = np.polyfit(np.log(cycles), np.log(power[cycles]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.08)
    ends = np.mean(drawn[:, 0] * drawn[:, -1])
    assert abs(ends) < 0.4 * np.mean(drawn[:, 0] * drawn[:, 1])


def test_noise_is_new_in_each_trial_and_as_large_as_asked(tmp_path):
    noise = {"coloured_deg": 0.4, "correlation_s": 0.3, "white_deg": 0.15}
    same = {
        "calibration": DIRECT,
        "converter": FINE,
        "scatter": NO_SCATTER,
        "sampling": {**CLEAN, "rate_hz": 25.0},
        "protocol": {"repeats": 8},
    }
    noisy = campaign(document(noise=noise, **same), tmp_path)
    still = campaign(document(noise=NO_NOISE, **same), tmp_path)
    drawn = [
        one.angle_deg - other.angle_deg
        for one, other in zip(noisy.trials, still.trials, strict=True)
    ]
    assert np.concatenate(drawn).std() == pytest.approx(np.hypot(0.4, 0.15), rel=0.1)
    for lag in (5, 15):
        products = np.concatenate([part[lag:] * part[:-lag] for part in drawn])
        assert products.mean() == pytest.approx(0.16 * np.exp(-lag * 0.04 / 0.3), abs=0.03)
    jumps = np.concatenate([np.diff(part) for part in drawn])
    expected = 2.0 * 0.15**2 + 2.0 * 0.16 * (1.0 - np.exp(-0.04 / 0.3))
    assert jumps.var() == pytest.approx(expected, rel=0.1)
    assert abs(np.corrcoef(drawn[0][:150], drawn[1][:150])[0, 1]) < 0.5


def test_white_noise_alone_is_white():
    noise = Noise("one_over_f", 0.0, None, 0.3)
    drawn = reading_noise(noise, np.arange(20_000) * 0.02, np.random.default_rng(3))
    assert drawn.std() == pytest.approx(0.3, rel=0.03)
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.03


# --- scatter, fixture, sampling -----------------------------------------------------------------


def test_scatter_is_as_asked(tmp_path):
    scatter = {"gain": 0.02, "time_scale": 0.03, "rest_deg": 0.4}
    same = {
        "calibration": DIRECT,
        "converter": FINE,
        "noise": NO_NOISE,
        "sampling": {**CLEAN, "rate_hz": 20.0},
        "protocol": {"repeats": 8},
    }
    found = []
    for seed in range(3):
        bare = case(seed=seed, scatter=NO_SCATTER, **same)
        faster = with_core(bare.bare, at_rate(bare.core, 1.01))
        base = exact_angles(bare.bare, bare.plan)
        by_rate = (exact_angles(faster, bare.plan) - base) / 0.01
        data = campaign(document(seed=seed, scatter=scatter, **same), tmp_path)
        trials = sorted(data.trials, key=lambda trial: trial.order)
        at = np.cumsum([0, *(trial.t_s.size for trial in trials)])
        for trial, i, j in zip(trials, at, at[1:], strict=False):
            shapes = np.stack([base[i:j], by_rate[i:j], np.ones(j - i)], axis=1)
            solved, rest, _, _ = np.linalg.lstsq(shapes, trial.angle_deg - base[i:j], rcond=None)
            found.append(solved)
            assert np.sqrt(rest[0] / (j - i)) < 0.15
    spread = np.std(found, axis=0)
    np.testing.assert_allclose(spread, [0.02, 0.03, 0.4], rtol=0.3)
    assert abs(np.corrcoef(np.transpose(found)) - np.eye(3)).max() < 0.45


def test_each_dwell_of_the_fixture_has_its_own_error(tmp_path):
    asked = document(
        fixture={"error_deg": 0.5},
        noise=NO_NOISE,
        converter=FINE,
        calibration={"kind": "before_and_after", "angles": 19, "directions": 2},
        sampling={**CLEAN, "rate_hz": 10.0},
    )
    curve = Case(read_document(asked)).bare.sensor.curve
    grid = np.linspace(-10.0, 100.0, 5000)
    data = campaign(asked, tmp_path)
    errors = []
    for calibration in data.calibrations:
        assert len(calibration.dwells) == 37
        means = np.array([dwell.mean for dwell in calibration.dwells]) * 5.0 / 65535
        stood = np.interp(means, curve.volts(grid), grid)
        errors.append(stood - [dwell.angle_deg for dwell in calibration.dwells])
    assert np.std(errors) == pytest.approx(0.5, rel=0.3)
    assert abs(np.corrcoef(errors)[0, 1]) < 0.5
    up_and_down = np.array(errors)[:, :18], np.array(errors)[:, :18:-1]
    assert abs(np.corrcoef(np.ravel(up_and_down[0]), np.ravel(up_and_down[1]))[0, 1]) < 0.5


@pytest.mark.parametrize("seed", [1, 3])
def test_rows_are_late_missing_and_damaged_as_often_as_asked(seed, tmp_path):
    sampling = {"rate_hz": 100.0, "jitter": 0.1, "missing": 0.02, "damaged": 0.01}
    asked = document(
        seed=seed, sampling=sampling, protocol={"name": "releases", "repeats": 6}, noise=NO_NOISE
    )
    data = campaign(asked, tmp_path)
    reports = [report for report in data.report.files if "trial" in report.file]
    valid = sum(report.valid for report in reports)
    damaged = sum(d.count for report in reports for d in report.damaged.values())
    assert damaged / (valid + damaged) == pytest.approx(0.01, rel=0.35)
    periods = np.concatenate([np.diff(trial.t_s) for trial in data.trials]) * 100.0
    late = periods[np.abs(periods - 1.0) < 0.6] - 1.0
    assert late.std() == pytest.approx(0.1 * np.sqrt(2.0), rel=0.1)
    lost = np.rint(periods).sum() - periods.size
    assert lost / (valid + lost) == pytest.approx(0.03, rel=0.3)


def test_both_logs_of_rows_were_seen():
    suffixes = [case(seed=seed).formats()[1].suffix for seed in (1, 3)]
    assert sorted(suffixes) == ["csv", "log"]


def test_the_pressure_has_its_step_and_its_lag(tmp_path):
    for bits, resolution in ((12, 0.25), (16, 0.5), (8, 0.25)):
        asked = document(
            converter={"bits": bits},
            pressure={"resolution_kpa": resolution, "lag_s": 0.1},
            protocol={"name": "everything", "repeats": 1},
            sampling=CLEAN,
        )
        data = campaign(asked, tmp_path)
        pressure = np.concatenate([trial.pressure_kpa for trial in data.trials])
        command = np.concatenate([trial.command_kpa for trial in data.trials])
        steps = (pressure - pressure.min()) / resolution
        assert np.abs(steps - np.rint(steps)).max() < 1e-3
        assert abs(np.median(pressure[command == 0.0])) <= 0.5 * resolution
        # A sample sees what the command before it has made of the pressure.
        late = [np.abs(t.pressure_kpa[1:] - t.command_kpa[:-1]) > 1.0 for t in data.trials]
        csv = data.campaign.log.format == "csv"
        assert (np.concatenate(late).mean() > 0.01) == csv


# --- sizes --------------------------------------------------------------------------------------


def test_the_solver_finds_the_size_or_the_end():
    assert solve(lambda x: (x**2, True), 9.0, 0.1, 100.0).amplitude == pytest.approx(3.0, rel=0.02)
    saturating = solve(lambda x: (x / (1.0 + x), True), 5.0, 0.1, 100.0)
    assert (saturating.amplitude, saturating.size) == (100.0, 100.0 / 101.0)
    unread = solve(lambda x: (x, True) if x <= 2.0 else (np.inf, False), 5.0, 0.1, 100.0)
    assert unread.amplitude == pytest.approx(2.0, rel=0.02)  # no curve beyond
    barred = solve(lambda x: (x, x <= 2.0), 5.0, 0.1, 100.0)
    assert 1.95 < barred.amplitude <= 2.0


SHORT = {"sampling": {"rate_hz": 20.0}, "protocol": {"name": "single"}}


def test_sizes_come_out_as_ordered():
    forms = set()
    for i, effect in enumerate([*EFFECTS, *FOREIGN][::3]):
        kind = "alien" if effect in FOREIGN else "closed"
        size = (1.0, 2.0, 4.0)[i % 3]
        truth = case(effect, kind=kind, size=size, seed=i, **SHORT).truth()
        assert truth["sizes_reached"] == [pytest.approx(size, rel=0.03)], effect
        assert set(truth["parameters"]) == {effect}
        forms.add(truth["form"])
    assert forms == {"a", "b", "own"}


@pytest.mark.parametrize("effect", FURTHER)
def test_effects_beyond_the_contracts_come_out_as_ordered(effect):
    truth = case(effect, kind="closed", size=2.0, seed=3, **SHORT).truth()
    assert truth["sizes_reached"] == [pytest.approx(2.0, rel=0.03)]
    assert set(truth["parameters"]) == {effect}


@pytest.mark.parametrize("effect", ["line_lag", "hysteresis", "sensor_slip", "mains_pickup"])
def test_a_size_is_that_of_what_is_logged(effect, tmp_path):
    # The noise is drawn alike: it cancels.
    same = {
        "calibration": DIRECT,
        "converter": FINE,
        "scatter": NO_SCATTER,
        "sampling": {**CLEAN, "jitter": 0.05},
        "protocol": {"name": "releases", "repeats": 2},
        "seed": 5,
    }
    with_it = document(effect, size=3.0, **same)
    change = angles(campaign(with_it, tmp_path)) - angles(campaign(document(**same), tmp_path))
    truth = Case(read_document(with_it)).truth()
    reached = rms(change) / truth["noise_floor_deg"]
    assert reached == pytest.approx(truth["sizes_reached"][0], rel=0.01)
    assert reached == pytest.approx(3.0, rel=0.03)


def test_the_noise_floor_is_what_repeated_trials_differ_by(tmp_path):
    asked = read_document(document(noise={"coloured_deg": 0.3}, converter={"bits": 9}, seed=3))
    it = Case(asked)
    step = it.plan.programme.experiments[1]
    plan = Plan(asked, "campaign", Programme((step,), (step.name,) * 60))
    recorder = Recorder(plan, it.bare, *it.formats())
    write_folder(recorder.run(plan), tmp_path / "case")
    grid = np.arange(0.1, step.profile.duration_s - 0.1, 0.02)
    trials = read(tmp_path / "case").trials
    at = np.array([np.interp(grid, trial.t_s, trial.angle_deg) for trial in trials])
    apart = np.sqrt(at.var(axis=0, ddof=1).mean())
    assert apart == pytest.approx(noise_floor_deg(it.bare, plan), rel=0.12)


def test_amplitudes_stop_where_nobody_could_read_on(tmp_path):
    it = case("sensor_slip", size=60.0, seed=2)
    reached = it.truth()["sizes_reached"][0]
    assert 5.0 < reached < 50.0
    assert exact_angles(it.specimen, it.plan).max() <= 85.0
    for name in ("campaign", "later"):
        campaign(document("sensor_slip", size=60.0, seed=2), tmp_path, name)


def test_a_pair_has_both_effects_each_in_its_size():
    it = case("leak", "sensor_lag", size=3.0, seed=4)
    present = {name for name, effect in it.specimen.effects().items() if effect is not None}
    assert present == {"leak", "sensor_lag"}
    truth = it.truth()
    assert truth["sizes_reached"] == pytest.approx([3.0, 3.0], rel=0.03)
    assert 2.0 < truth["joint_size"] < 6.2
    assert set(truth["parameters"]) == {"leak", "sensor_lag"}
    assert case(seed=4).truth()["joint_size"] is None


# --- what is handed out -------------------------------------------------------------------------


@pytest.mark.parametrize(("effect", "kind"), [("sensor_slip", "closed"), ("gain_wander", "alien")])
def test_nothing_handed_out_tells_of_the_cause(effect, kind):
    told = {"closed", "withheld", "alien", "pair", "no_effect", "effect", "form", "seed", "virtual"}
    words = [rf"\b{word}\b".encode() for word in {*EFFECTS, *FOREIGN, *told}]
    it = case(effect, kind=kind, model={"kind": "earlier"}, sampling={"rate_hz": 20.0})
    for files in it.campaigns().values():
        for name, data in files.items():
            assert not [word for word in words if re.search(word, data)], name
            assert name.split("/")[0].split("_")[0] not in effect.split("_")
    assert it.model_document()["effects"] == []


def test_the_cause_changes_what_it_acts_on_and_nothing_else():
    plain, slipped = case(seed=3).campaigns(), case("sensor_slip", seed=3).campaigns()
    for part in ("campaign", "later"):
        assert slipped[part].keys() == plain[part].keys()
        assert slipped[part]["campaign.yaml"] == plain[part]["campaign.yaml"]
    name = next(name for name in plain["campaign"] if "trial_02" in name)
    rows = [
        np.array([line.split(b"*")[0].split(b",") for line in files[name].splitlines()[20:60]])
        for files in (plain["campaign"], slipped["campaign"])
    ]
    np.testing.assert_array_equal(rows[0][:, :4], rows[1][:, :4])
    assert np.any(rows[0][:, 4] != rows[1][:, 4])


def test_the_later_campaign_goes_on_counting(tmp_path):
    asked = document(calibration={"kind": "before_and_after"})
    write_case(asked, tmp_path / "case")
    now, later = (read(tmp_path / "case" / part).campaign for part in ("campaign", "later"))
    assert later.continues == now.name
    files = tree(tmp_path / "case")
    assert files["later/calibration/pre.log"] == files["campaign/calibration/pre.log"]
    assert later.calibration[0].started_s == now.calibration[0].started_s
    before = [trial for _, _, trial in now.trial_files()]
    after = [trial for _, _, trial in later.trial_files()]
    assert min(trial.order for trial in after) == max(trial.order for trial in before) + 1
    assert min(trial.started_s for trial in after) > now.calibration[-1].started_s + 100.0


def test_the_later_campaign_carries_the_state_on(tmp_path):
    it = case("mullins_softening", size=8.0, calibration=DIRECT, noise=NO_NOISE)
    alone = replace(it.later(), first_s=0.0, continues=None)

    def top(files, folder):
        write_folder(files, tmp_path / folder)
        return np.mean([np.sort(trial.angle_deg)[-50:] for trial in read(tmp_path / folder).trials])

    anew = Recorder(alone, it.specimen, *it.formats()).run(alone)
    assert top(it.campaigns()["later"], "later") > top(anew, "alone") + 0.5


def test_the_earlier_campaign_is_that_of_the_specimen_without_effect(tmp_path):
    changes = {"model": {"kind": "earlier"}, "seed": 8}
    with_it = case("stiffening", **changes).campaigns()
    without = case(**changes).campaigns()
    assert with_it["earlier"] == without["earlier"]
    assert with_it["campaign"] != without["campaign"]
    write_folder(with_it["earlier"], tmp_path / "earlier")
    data = read(tmp_path / "earlier")
    assert 4 <= len(data.trials) <= 6
    assert {trial.protocol for trial in data.trials} <= {"step", "step_release"}
    assert data.campaign.continues is None


def test_the_model_that_is_off_is_as_far_off_as_asked(tmp_path):
    asked = document("parameter_shift", model={"kind": "off", "off": 0.02}, seed=6)
    truth = write_case(asked, tmp_path / "case")
    given = read_model(tmp_path / "case" / "model.json").transfer_function
    ratios = [getattr(given, name) / truth["core"][name] - 1.0 for name in truth["core"]]
    assert list(truth["core"]) == ["alpha2", "alpha1", "a1", "a0", "b0"]
    np.testing.assert_allclose(np.abs(ratios), [0.004, 0.004, 0.02, 0.02, 0.02], rtol=1e-9)
    assert 0.05 < truth["model_error_deg"] < 4.0
    exact = write_case(document(seed=6), tmp_path / "exact")
    assert exact["model_error_deg"] == 0.0
    own = write_case(document(seed=6, model={"kind": "own"}), tmp_path / "own")
    assert own["model_error_deg"] is None
    assert sorted(path.name for path in (tmp_path / "own").iterdir()) == ["campaign", "later"]


def test_the_pressure_sensor_reaches_beyond_every_command():
    for bits in range(8, 17):
        asked = read_document(document(converter={"bits": bits}, pressure={"resolution_kpa": 0.3}))
        sensor = draw_board_format(asked, 60.0).pressure_sensor
        assert 90.0 <= sensor.kpa_at_ends[1] <= 551.6
    assert 46.0 <= draw_top_deg(asked) <= 64.0
