"""A command that is no pressure: the nominal drive, and what is judged against it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from pump_cases import FULL, RATE_HZ, Pump, held, pump_campaign
from spa_fo.api import Campaign, Comparison
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.gap.data.evidence import collect
from spa_fo.gap.data.hold_out import hold_out
from spa_fo.gap.decide.examine import examine
from spa_fo.identify.nominal_fit import Form, _distinct, _folds, _Log, _tried, identify_drive
from spa_fo.identify.predict import predict_campaign
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.plant.nominal_drive import KEY, NominalDrive, driven_by, follow
from spa_fo.rig import CampaignData, Trial
from spa_fo.virtual_rig.first_forms import ContactStop
from spa_fo.virtual_rig.syringe_pump import DeadTime, Leak

PLAIN = NominalDrive(np.array([0.0, 10.0]), np.array([0.0, 50.0]), np.array([2.0, 2.0]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pumps")


@pytest.fixture(scope="module")
def before(folder: Path) -> Path:
    return pump_campaign(folder / "before", seed=1)


@pytest.fixture(scope="module")
def model(folder: Path, before: Path) -> Path:
    path = folder / "model.json"
    Campaign.load(before).fit().save(path)
    return path


def trial_of(command: np.ndarray, pressure: np.ndarray | None = None) -> Trial:
    t = np.arange(command.size) / RATE_HZ
    zero = np.zeros(command.size)
    return Trial(
        "one", 1, "free", None, 1, 0.0, t, command, pressure, None, zero, zero > 1, zero > 1
    )


# --- the drive by itself --------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-5.0, 60.0), min_size=3, max_size=30),
    st.floats(0.0, 20.0),
    st.floats(0.1, 10.0),
    st.floats(0.0, 40.0),
)
def test_it_follows_as_a_fine_integration_does(
    levels: list[float], rate: float, venting: float, begins: float
) -> None:
    fine, p, means = 400, begins, []
    for level in levels:
        total = 0.0
        for _ in range(fine):
            total += p / fine
            k = rate * (venting if level < p else 1.0)
            p += FINEST_STEP_S / fine * k * (level - p)
        means.append(total)
    found = follow(np.array(levels), np.full(len(levels), rate), venting, begins)
    np.testing.assert_allclose(found, means, atol=0.02 * (1.0 + max(map(abs, [begins, *levels]))))


def test_a_pressure_without_a_rate_is_held() -> None:
    np.testing.assert_array_equal(follow(np.full(9, 30.0), np.zeros(9), 1.0, 12.0), np.full(9, 12))


def test_levels_go_on_straight_and_rates_as_they_are() -> None:
    drive = NominalDrive(np.array([0.0, 1.0, 3.0]), np.array([0.0, 4.0, 6.0]), np.arange(1.0, 4.0))
    np.testing.assert_allclose(drive.levels(np.array([-1.0, 2.0, 4.0])), [-4.0, 5.0, 7.0])
    np.testing.assert_allclose(drive.rates(np.array([-1.0, 2.0, 4.0])), [1.0, 2.5, 3.0])


def test_what_stands_for_the_command_is_held_from_row_to_row() -> None:
    """Its mean from one row to the next is that of the nominal pressure."""
    command = np.where(np.arange(200) < 50, 0.0, 10.0)
    trial = trial_of(command)
    cells = PLAIN.cells(trial.t_s, command)
    np.testing.assert_allclose(PLAIN.commanded(trial), cells[: command.size], atol=1e-9)
    assert PLAIN.commanded(trial)[-1] == pytest.approx(50.0 * (1.0 - np.exp(-2.0 * 3.0)), rel=0.01)


def test_a_delay_moves_all_of_it() -> None:
    command = np.where(np.arange(200) < 50, 0.0, 10.0)
    trial = trial_of(command)
    late = replace(PLAIN, delay_s=0.2)
    np.testing.assert_allclose(late.at_rows(trial)[10:], PLAIN.at_rows(trial)[:-10], atol=1e-6)


def test_it_begins_under_the_pressure_that_was_measured() -> None:
    command = np.zeros(100)
    assert PLAIN.at_rows(trial_of(command, np.full(100, 8.0)))[0] == pytest.approx(8.0, rel=0.05)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"level_kpa": [5.0, 1.0]}, "levels with them"),
        ({"command": [1.0]}, "as many numbers each"),
        ({"rate_per_s": "fast"}, "nominal_drive.rate_per_s: expected a list of numbers"),
        ({"venting": None}, "nominal_drive.venting: expected a number"),
        ({"delay_s": -1.0}, "of 0 or more"),
    ],
)
def test_what_a_model_says_of_it_is_checked(change: dict[str, Any], words: str) -> None:
    entry = PLAIN.to_dict()
    assert NominalDrive.from_dict(entry).to_dict() == entry
    with pytest.raises(BadInput, match=words):
        NominalDrive.from_dict({**entry, **change}, "model.json")


# --- its identification ---------------------------------------------------------------------------


def test_curve_and_rates_come_back() -> None:
    truth = NominalDrive(
        np.array([0.0, 50.0, 100.0]), np.array([0.0, 10.0, 40.0]), np.full(3, 4.0), 0.5, 0.06
    )
    rng = np.random.default_rng(3)
    trials = []
    for top in (50.0, 100.0, 75.0):
        command = np.repeat([0.0, top, 50.0, 0.0], [50, 200, 200, 250])
        pressure = truth.at_rows(trial_of(command)) + rng.normal(0.0, 0.1, command.size)
        trials.append(trial_of(command, pressure))
    found = identify_drive(trials)
    assert found.form.venting
    assert found.drive.venting == pytest.approx(0.5, rel=0.03)
    assert found.drive.delay_s == pytest.approx(0.06, abs=0.01)
    commands = np.array([0.0, 50.0, 75.0, 100.0])
    np.testing.assert_allclose(found.drive.levels(commands), truth.levels(commands), atol=0.4)
    assert found.rms_kpa == pytest.approx(0.1, rel=0.1)


def test_what_is_left_out_takes_no_part(before: Path) -> None:
    """What is expected of a log that is left out is the same, whatever it holds."""
    trials = list(Campaign.load(before).trials[:6])
    assert trials[0].pressure_kpa is not None
    strange = replace(trials[0], pressure_kpa=2.0 * trials[0].pressure_kpa)
    expected = []
    for first in (trials[0], strange):
        logs = [_Log.of(trial, 0) for trial in [first, *trials[1:]]]
        positions = _distinct(np.concatenate([log.command for log in logs]))
        found = _tried(logs, Form(3, venting=True), positions, _folds(logs))
        expected.append(logs[0].every - found.left[0])
    apart = expected[0] - expected[1]
    begins = 2.0 * np.abs(strange.pressure_kpa[:5]).mean()  # which is measured
    assert np.abs(apart).max() < 0.5 + begins


def test_a_lone_log_is_judged_by_its_quarters(before: Path) -> None:
    found = identify_drive(Campaign.load(before).trials[-1:])
    assert found.left_out_by == "quarters"
    assert found.left[0].size == Campaign.load(before).trials[-1].t_s.size
    assert found.left_out_kpa >= found.rms_kpa


def test_the_pump_of_the_virtual_rig_is_found_though_no_form_is_its(before: Path) -> None:
    found = identify_drive(Campaign.load(before).trials)
    pwm = FULL * np.array([0.3, 0.5, 0.6, 0.9])
    np.testing.assert_allclose(found.drive.levels(pwm), Pump().levels(pwm), atol=0.7)
    assert found.left_out_kpa < 0.02 * Pump().top_kpa


# --- fit and files --------------------------------------------------------------------------------


def test_the_measured_pressure_drives_the_model(model: Path) -> None:
    assert json.loads(model.read_text())["input"] == {"signal": "pressure", "reference_kpa": 40.0}


def test_nothing_is_said_to_be_odd_about_the_command(before: Path) -> None:
    campaign = Campaign.load(before)
    assert campaign.parse_report.warnings == ()
    assert "kPa" not in campaign.overview[0].cells()[7]


def test_without_a_measured_pressure_the_command_drives_it_as_it_is(tmp_path: Path) -> None:
    arm = pump_campaign(tmp_path / "arm", repeats=1, columns=("command", "angle"))
    assert Campaign.load(arm).fit().model.document.signal == "command"


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as leaving:
        main(words)
    assert leaving.value.code == 2
    (line,) = [s for s in capsys.readouterr().err.splitlines() if s.startswith("spa-fo:")]
    return line


def test_another_unit_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = pump_campaign(tmp_path / "arm", repeats=1, unit="V")
    line = refused(["fit", str(arm), "--out", str(tmp_path / "m.json")], capsys)
    said = "log.columns.command.unit: is 'V'; expected one of: 1, Pa, bar, hPa, kPa, psi"
    assert line == f"spa-fo: {arm / 'campaign.yaml'}: {said}"


def test_a_command_that_never_changes_shows_no_drive(
    tmp_path: Path, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arm = pump_campaign(tmp_path / "arm", repeats=1)
    document = yaml.safe_load((arm / "campaign.yaml").read_text())
    document["log"]["columns"]["command"]["scale"] = 0.0
    (arm / "campaign.yaml").write_text(yaml.safe_dump(document))
    out = tmp_path / "out"
    line = refused(["diagnose", str(arm), "--model", str(model), "--out", str(out)], capsys)
    assert "log.columns.command: the command never changes; expected one that does" in line
    assert not out.exists()


def test_a_model_of_the_command_is_refused(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = tmp_path / "wrong.json"
    Campaign.load(before).fit(input="command").save(wrong)
    out = str(tmp_path / "out")
    line = refused(["diagnose", str(before), "--model", str(wrong), "--out", out], capsys)
    assert "so the command is no pressure; expected a model that the pressure drives" in line
    words = ["compare", str(before), str(before), "--model", str(wrong), "--out", out]
    assert "expected a model that the pressure drives" in refused(words, capsys)


def test_campaigns_of_two_kinds_are_not_compared(before: Path, tmp_path: Path) -> None:
    other = pump_campaign(tmp_path / "other", repeats=1, unit="kPa")
    with pytest.raises(BadInput, match="expected a command of unit 1 and a measured pressure"):
        Campaign.load(other).compare(before)


# --- diagnosis ------------------------------------------------------------------------------------


def test_held_out_trials_take_no_part(before: Path, model: Path) -> None:
    """Whatever is held out, the drive is the same: it was never looked at."""
    from spa_fo.api import Model

    data, plain = Campaign.load(before).data, Model.load(model).document
    held_out = hold_out(collect(data), np.random.default_rng(1)).trials
    assert held_out.any()
    ordered = sorted(data.trials, key=lambda trial: trial.order)
    spoilt = {t.order for t, out in zip(ordered, held_out, strict=True) if out}
    one = examine(data, plain, (), np.random.default_rng(1))
    other = examine(with_pressures(data, spoilt, 1.5), plain, (), np.random.default_rng(1))
    assert one.nominal is not None
    assert other.nominal is not None
    assert one.nominal.fit.drive.to_dict() == other.nominal.fit.drive.to_dict()


def with_pressures(data: CampaignData, orders: set[int], factor: float) -> CampaignData:
    """Multiply the measured pressure of some trials."""
    trials = [
        replace(t, pressure_kpa=factor * t.pressure_kpa)
        if t.order in orders and t.pressure_kpa is not None
        else t
        for t in data.trials
    ]
    return replace(data, trials=tuple(trials))


def test_where_nothing_is_wrong_there_is_no_gap(before: Path, model: Path, tmp_path: Path) -> None:
    from spa_fo.api import Model

    found = Model.load(model).diagnose(before)
    assert found.kind == "no_gap"
    found.save(tmp_path / "out")
    page = (tmp_path / "out" / "diagnosis.md").read_text()
    assert "The command is no pressure: a nominal drive was identified from it" in page
    assert "a leak or a gain of the drive's own cannot be told from it" in page
    written = json.loads((tmp_path / "out" / "augmented_model.json").read_text())
    assert written["input"]["signal"] == "pressure"
    assert written["effects"] == []


def test_a_drive_that_always_leaks_is_not_given_a_wrong_name(tmp_path: Path) -> None:
    arm = pump_campaign(tmp_path / "leaking", seed=4, leak=Leak(0.05))
    found = Campaign.load(arm).fit().model.diagnose(arm)
    assert found.kind in ("unknown", "no_gap") or found.causes[0] == ("leak",)


# --- comparison -----------------------------------------------------------------------------------


def test_nothing_changed_where_nothing_did(before: Path, folder: Path) -> None:
    again = pump_campaign(folder / "again", seed=2)
    found = Campaign.load(again).compare(before)
    assert found.kind == "nothing_changed"
    assert any("nothing changed in the drive" in each for each in found.result.change.findings)
    assert Comparison.of_pressure(before, again).kind == "nothing_changed"


@pytest.fixture(scope="module")
def leaking(before: Path, folder: Path) -> Comparison:
    after = pump_campaign(folder / "leak", seed=4, leak=Leak(0.05))
    return Campaign.load(after).compare(before)


def test_a_leak_is_named(leaking: Comparison) -> None:
    assert leaking.causes == (("leak",),)
    assert leaking.document["where"]["stage"]["drive"] > 0.8
    assert any("the drive has changed" in each for each in leaking.result.change.findings)


def test_its_model_runs_from_the_command_that_was_logged(
    leaking: Comparison, folder: Path, tmp_path: Path
) -> None:
    """Through the nominal drive and the leak; the measured pressure is not looked at."""
    written = leaking.model.document
    assert written.signal == "command"
    assert written.extra[KEY]["command"]
    data = Campaign.load(folder / "leak").data
    table = predict_campaign(written, data)
    error = np.sqrt(np.mean((table["angle_deg"] - table["predicted_deg"]) ** 2))
    assert error < 1.0
    leaking.save(tmp_path / "changed")
    out = tmp_path / "predicted.csv"
    words = ["predict", str(tmp_path / "changed" / "augmented_model.json"), str(folder / "leak")]
    assert main([*words, "--out", str(out)]) == 0


def test_a_longer_dead_time_is_a_change_of_the_drive(before: Path, folder: Path) -> None:
    after = pump_campaign(folder / "late", seed=3, dead_time=DeadTime(0.15))
    found = Campaign.load(after).compare(before)
    assert found.kind != "nothing_changed"
    assert found.document["where"]["stage"]["drive"] > 0.8
    alone = Comparison.of_pressure(before, after)
    assert alone.kind != "nothing_changed"


def test_a_change_of_the_actuator_is_none_of_the_drive(before: Path, folder: Path) -> None:
    after = pump_campaign(folder / "blocked", seed=6, contact=ContactStop(35.0, 6.0))
    found = Campaign.load(after).compare(before)
    assert found.causes == (("contact_stop",),)
    assert found.model.document.signal == "pressure"
    assert any("nothing changed in the drive" in each for each in found.result.change.findings)


def test_a_model_without_an_effect_of_the_drive_needs_no_nominal_one(model: Path) -> None:
    from spa_fo.api import Model

    plain = Model.load(model).document
    assert driven_by(plain, PLAIN) == plain
    effect = {"id": "leak", "stage": "drive", "parameters": {}}
    assert KEY in driven_by(replace(plain, effects=(effect,)), PLAIN).extra


def test_commands_are_shares_of_the_full_pwm() -> None:
    assert held((1.0, 0.5)).tolist() == [FULL / 2.0] * RATE_HZ
