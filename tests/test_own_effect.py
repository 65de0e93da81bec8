"""Effects that a campaign or an installed package brings along."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import campaigns
from plant_cases import KPA, SIXTY, X, step_release, trials, vector
from spa_fo import Campaign, Model
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.plant import Model as Document
from spa_fo.plant import TransferFunction, read_model, write_model
from spa_fo.plant.chain import Chain, chain_for
from spa_fo.plant.effects import own
from spa_fo.plant.effects.effect import Effect, amplitude, shape
from spa_fo.plant.effects.library import IDS, LIBRARY, absent
from spa_fo.plant.effects.own import read_effect, use_effects_of
from spa_fo.plant.grid import campaign_grid
from spa_fo.plant.law import Law
from spa_fo.plant.lawful import with_law

GOOD = """
from spa_fo.plant.effects.effect import Effect, amplitude

def act(pressure_kpa, time_s, fraction):
    return pressure_kpa * (1.0 - fraction)

EFFECT = Effect(
    id="regulator_gain",
    stage="drive",
    parameters=(amplitude("fraction", "1", "what lacks", spread=0.1, high=0.5, start=0.05),),
    act=act,
)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    campaigns.step_campaign(tmp_path / "arm", trials=1)
    (tmp_path / "arm" / "effects").mkdir()
    model = Document("arm", "test rubber", TransferFunction(**campaigns.TRUTH), 30.0)
    write_model(tmp_path / "model.json", model)
    return tmp_path


def place(folder: Path, text: str = GOOD, name: str = "regulator_gain") -> Path:
    path = folder / "arm" / "effects" / f"{name}.py"
    path.write_text(text)
    return path


def augmented(folder: Path, fraction: float) -> Path:
    effect = {"id": "regulator_gain", "stage": "drive", "parameters": {"fraction": fraction}}
    path = folder / "augmented.json"
    model = json.loads((folder / "model.json").read_text())
    path.write_text(json.dumps(model | {"effects": [effect]}))
    return path


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What a command says in one line as it ends with 2."""
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    said = capsys.readouterr().err
    assert (end.value.code, said.count("\n")) == (2, 1)
    return said


# --- files -----------------------------------------------------------------------------------


def test_a_campaigns_own_effects_stand_behind_the_library(folder: Path) -> None:
    place(folder)
    place(folder, GOOD.replace("regulator_gain", "another"), "another")
    assert use_effects_of(folder / "arm") == ("another", "regulator_gain")
    assert tuple(LIBRARY) == (*IDS, "another", "regulator_gain")
    assert LIBRARY["regulator_gain"].first == absent().size - 1
    assert LIBRARY["regulator_gain"].name == "regulator gain"
    assert use_effects_of(folder) == ()
    assert tuple(LIBRARY) == IDS


def test_reading_a_campaign_runs_no_effect(folder: Path) -> None:
    place(folder, "raise SystemExit(1)")
    assert len(Campaign.load(folder / "arm").trials) == 2


def test_nothing_is_written_beside_the_logs(folder: Path) -> None:
    before = {*folder.rglob("*"), place(folder)}
    use_effects_of(folder / "arm")
    assert set(folder.rglob("*")) == before


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("def act", "def act(", "line 4: cannot be run: SyntaxError: "),
        ("EFFECT =", "import nowhere\nEFFECT =", "line 7: cannot be run: ModuleNotFoundError: N"),
        ("EFFECT =", "MINE =", "EFFECT: is missing; expected an Effect of this name"),
        ("EFFECT = Effect", "EFFECT = dict", "EFFECT: is of type dict; expected an Effect"),
        ("regulator_gain", "leak", "id: is 'leak', which is taken; expected another"),
        ("regulator_gain", "unknown", "id: is 'unknown', which is taken; expected another"),
        ("regulator_gain", "My gain", "id: is 'My gain'; expected lower-case letters, digits and"),
        ('"drive"', '"pump"', "stage: is 'pump'; expected one of drive, actuator, sensor, acqui"),
        ("act=act", 'act=act, port="line"', "port: is 'line'; expected 'chain', the default"),
        ("=0.05),)", "=0.05))", "parameters: expected a tuple of one Parameter at least"),
        ("(amplitude(", "((", "parameters[0]: is of type tuple; expected a Parameter"),
        ("spread=0.1", "spread=-1.0", "expected low < high, spread > 0"),
        ("start=0.05", "start=0.7", "parameters[0]: expected starts from 0 to 0.5"),
        ("high=0.5", "high=float('nan')", "parameters[0]: expected finite numbers"),
        ("time_s, fraction", "fraction", "expected a function of (pressure_kpa, time_s, fraction)"),
        ("act=act", "act=act, check='look'", "check: expected a Check, also of equivalents"),
        ("    act=act,\n", "", "act: expected a function of (pressure_kpa, time_s, fraction)"),
    ],
)
def test_a_bad_file_is_one_line_and_ends_with_2(
    folder: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, message: str
) -> None:
    text = GOOD.replace(old, new)
    if new == "((":
        text = text.replace('"what lacks", spread=0.1, high=0.5, start=0.05', '"what lacks"')
    path = place(folder, text)
    arguments = ("diagnose", folder / "arm", "--model", folder / "model.json")
    said = refused(capsys, *arguments, "--out", folder / "out")
    assert str(path) in said
    assert message in said


def test_two_files_with_one_id(folder: Path) -> None:
    place(folder)
    place(folder, GOOD, "regulator_gain_2")
    with pytest.raises(BadInput, match=r"gain_2\.py: id: is 'regulator_gain', as in .*gain\.py"):
        use_effects_of(folder / "arm")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("(1.0 - fraction)", "(1.0 / (time_s - time_s))", "act: is not finite at fraction 0.1"),
        ("return pressure_kpa", "return pressure_kpa[1:]", "act: returned "),
        ("(1.0 - fraction)", "[][3]", "line 5: fails: IndexError: list index out of range"),
    ],
)
def test_what_fails_as_it_acts_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, message: str
) -> None:
    path = place(folder, GOOD.replace(old, new))
    arguments = ("predict", augmented(folder, 0.1), folder / "arm")
    assert f"{path}: {message}" in refused(capsys, *arguments, "--out", folder / "out.csv")


# --- use -------------------------------------------------------------------------------------


def test_a_model_that_names_it_is_predicted_with_it(folder: Path) -> None:
    place(folder)
    for fraction in (0.0, 0.1):
        model, out = augmented(folder, fraction), folder / f"{fraction}.csv"
        assert main(["predict", str(model), str(folder / "arm"), "--out", str(out)]) == 0
    whole, lossy = (pd.read_csv(folder / f"{f}.csv")["predicted_deg"] for f in (0.0, 0.1))
    np.testing.assert_allclose(lossy, 0.9 * whole, atol=1e-6)
    assert whole.max() > 10.0


def test_without_its_file_a_model_that_names_it_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ("predict", augmented(folder, 0.1), folder / "arm", "--out", folder / "out.csv")
    assert "is 'regulator_gain', which is no known effect" in refused(capsys, *arguments)


def test_a_diagnosis_weighs_it_and_can_do_without(folder: Path) -> None:
    place(folder)
    model, campaign = Model(read_model(folder / "model.json")), Campaign.load(folder / "arm")
    others = IDS[1:]
    found = model.diagnose(campaign, exclude=others)
    assert ["regulator_gain"] in [cause["set"] for cause in found.document["causes"]]
    found = model.diagnose(campaign, exclude=(*others, "regulator_gain"))
    assert ["regulator_gain"] not in [cause["set"] for cause in found.document["causes"]]


def test_an_installed_package_brings_one_along(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed = folder / "installed"
    (installed / "gains-1.dist-info").mkdir(parents=True)
    (installed / "gains-1.dist-info" / "METADATA").write_text("Name: gains\nVersion: 1\n")
    points = installed / "gains-1.dist-info" / "entry_points.txt"
    points.write_text(f"[{own.GROUP}]\nregulator_gain = gains_of_mine:EFFECT\n")
    (installed / "gains_of_mine.py").write_text(GOOD)
    monkeypatch.syspath_prepend(installed)
    own._installed.cache_clear()
    try:
        assert use_effects_of(folder / "arm") == ("regulator_gain",)
        points.write_text(f"[{own.GROUP}]\nregulator_gain = gains_of_mine:NOTHING\n")
        own._installed.cache_clear()
        with pytest.raises(BadInput, match="entry point gains_of_mine:NOTHING: cannot be loaded"):
            use_effects_of(folder / "arm")
    finally:
        own._installed.cache_clear()


# --- the chain -------------------------------------------------------------------------------


def stiffened(pressure_kpa, angle_deg, time_s, fraction, exponent):
    lost = fraction * (np.abs(angle_deg) / 60.0) ** exponent * np.radians(angle_deg)
    return pressure_kpa - KPA * lost * X[3] / X[4]


STIFFENED = Effect("stiffened", "actuator", LIBRARY["stiffening"].parameters[:2], act=stiffened)


def held(effect: Effect, *values: float) -> np.ndarray:
    LIBRARY.hold((effect,))
    e = absent()
    e[LIBRARY[effect.id].slots] = values
    return e


def two_steps() -> Chain:
    return chain_for(campaign_grid(trials(step_release(), step_release(0.5 * SIXTY))), X, KPA)


def test_an_actuators_own_effect_is_what_a_kernel_makes_of_it() -> None:
    c = two_steps()
    kernel, _ = c.readings(
        X, vector("stiffening", fraction_at_60deg=0.3, exponent=2.0, by_load=0.0)
    )
    found, _ = c.readings(X, held(STIFFENED, 0.3, 2.0))
    # Within a step one goes by the slopes of its pressure, the other by its moment's.
    np.testing.assert_allclose(found, kernel, atol=0.01)
    assert np.abs(kernel - c.readings(X, absent())[0]).max() > 1.0


def test_too_steep_a_moment_stays_finite() -> None:
    found, _ = two_steps().readings(X, held(STIFFENED, 50.0, 8.0))
    assert np.isfinite(found).all()


def test_beside_a_law_it_sees_the_whole_campaign() -> None:
    c, effects = two_steps(), held(STIFFENED, 0.3, 2.0)
    bare, _ = c.readings(X, effects)
    knots = np.array([-10.0, 80.0])
    softer = with_law(c, Law("moment", knots, -0.05 * KPA * knots / 60.0))
    assert np.abs(softer.readings(X, effects)[0] - bare).max() > 0.5
    steep = with_law(c, Law("moment", knots, 1e4 * knots))
    with pytest.raises(ValueError, match="too steep"):
        steep.readings(X, effects)


def test_a_sensor_remembers_through_the_campaign() -> None:
    def worn(angle_deg, time_s, share):
        return angle_deg + share * np.maximum.accumulate(angle_deg)

    wear = amplitude("share", "1", spread=0.1, high=0.5, start=0.1)
    effects = held(Effect("worn", "sensor", (wear,), act=worn), 0.1)
    c = two_steps()
    bare, _ = c.readings(X, absent())
    found, _ = c.readings(X, effects)
    np.testing.assert_allclose(found, bare + 0.1 * np.maximum.accumulate(bare), atol=1e-9)


def test_a_log_is_changed_trial_by_trial() -> None:
    def warming(reading_deg, time_s, rise_deg, settling_s):
        return reading_deg + rise_deg * (1.0 - np.exp(-time_s / settling_s))

    parameters = (
        amplitude("rise_deg", "deg", spread=1.0, high=5.0, start=1.0),
        shape("settling_s", "s", centre=2.0, factor=2.0, low=0.1, high=20.0),
    )
    effects = held(Effect("warming", "acquisition", parameters, act=warming), 1.0, 2.0)
    c = two_steps()
    reading, _ = c.readings(X, absent())
    for index, trial in enumerate(c.grid.trials):
        at, which = c.grid.locate(index, trial.t_s), np.full(trial.t_s.size, index)
        bare, found = (c.logged(reading, e, *at, which) for e in (absent(), effects))
        np.testing.assert_allclose(found - bare, 1.0 - np.exp(-trial.t_s / 2.0), atol=1e-6)


def test_a_file_may_hold_what_other_modules_hold(folder: Path) -> None:
    text = GOOD.replace("def act", "def unused(x: int | None) -> 'nothing': ...\n\ndef act")
    assert read_effect(place(folder, "from __future__ import annotations\n" + text)).act is not None
