"""`predict` with augmented models: what the file may say, and what is made of it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import campaigns
from naive_plant import curve
from plant_cases import (
    KPA,
    SIXTY,
    X,
    campaign_data,
    entry,
    model,
    parameters,
    step_release,
    trials,
    triangle,
    vector,
)
from spa_fo import simulate
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.identify import predict_campaign, predict_trial
from spa_fo.plant import Model, read_model, write_model
from spa_fo.plant.augmented import (
    LET_GO,
    effects_vector,
    ending_memory,
    is_augmented,
    past_note,
    predict_augmented,
)
from spa_fo.plant.effects.library import IDS, LIBRARY
from spa_fo.plant.effects.shared import CURVE_KNOTS_DEG
from spa_fo.rig import CampaignData, Trial

ACTING = [name for name in IDS if name not in ("parameter_shift", "mains_pickup")]


def plain(trial: Trial) -> np.ndarray:
    assert trial.command_kpa is not None
    return np.degrees(simulate(trial.t_s, trial.command_kpa / KPA, *X, hold="zero"))


def same_bits(one: CampaignData, a: Model, b: Model) -> bool:
    return predict_campaign(a, one).equals(predict_campaign(b, one))


# --- what the file says ----------------------------------------------------------------------


@pytest.mark.parametrize("name", IDS)
def test_every_effect_is_read(name: str) -> None:
    np.testing.assert_array_equal(effects_vector(model(entry(name))), vector(name))


def test_effects_stand_together_in_any_order() -> None:
    found = effects_vector(model(entry("sensor_lag"), entry("leak"), entry("creep")))
    names = "leak", "creep", "sensor_lag"
    for name in names:
        slots = LIBRARY[name].slots
        np.testing.assert_array_equal(found[slots], vector(name)[slots])
    given = sum(len(LIBRARY[name].parameters) for name in names)
    assert np.count_nonzero(~np.isnan(found)) == given


def test_a_model_of_before_a_parameter_was_added_means_it_at_zero() -> None:
    old = entry("leak")
    added = "renewal_per_kpa", "below_share", "kept_share", "opens_per_kpa"
    for name in added:
        del old["parameters"][name]
    assert (effects_vector(model(old))[LIBRARY["leak"].slots][-len(added) :] == 0.0).all()
    del old["parameters"]["makeup_per_s"]
    with pytest.raises(BadInput, match="makeup_per_s: missing, expected this key"):
        effects_vector(model(old))


def changed(name: str, change: Mapping[str, Any]) -> dict[str, Any]:
    """An effect's entry with some keys and parameters replaced, or taken out by None."""
    one = entry(name)
    for key, value in change.items():
        section, _, inner = key.partition(".")
        place = one[section] if inner else one
        if value is None:
            del place[inner or section]
        else:
            place[inner or section] = value
    return one


@pytest.mark.parametrize(
    ("effect", "key", "message"),
    [
        (changed("creep", {"id": "crep"}), "id", "is 'crep', which is no known effect; did you"),
        (changed("creep", {"stage": "sensor"}), "stage", "is 'sensor', but creep belongs to the a"),
        (changed("creep", {"parameters.decades": None}), "parameters.decades", "missing"),
        (
            changed("creep", {"parameters.decade": 1.0}),
            "parameters.decade",
            "is no parameter of creep; did you mean 'decades'?",
        ),
        (
            changed("creep", {"parameters.decades": "1"}),
            "parameters.decades",
            "a number, found '1'",
        ),
        (
            changed("creep", {"parameters.decades": True}),
            "parameters.decades",
            "a number, found True",
        ),
        (changed("creep", {"parameters.decades": 1e999}), "parameters.decades", "a finite number"),
        (changed("creep", {"parameters.decades": 10**400}), "parameters.decades", "finite number"),
        (
            changed("creep", {"parameters.per_decade": -0.1}),
            "parameters.per_decade",
            "is -0.1; expected 0 to",
        ),
        (
            changed("contact_stop", {"parameters.angle_deg": 999.0}),
            "parameters.angle_deg",
            "is 999; expected",
        ),
        (changed("sensor_slip", {"zeros_deg": [1.0]}), "zeros_deg", "an object"),
        (changed("sensor_slip", {"zeros_deg": {"0": 1.0}}), "zeros_deg.0", "a whole number from 1"),
        (changed("sensor_slip", {"zeros_deg": {"x": 1.0}}), "zeros_deg.x", "a whole number from 1"),
        (changed("sensor_slip", {"zeros_deg": {"3": None}}), "zeros_deg.3", "found None"),
        (changed("sensor_hysteresis", {"branches": 1.0}), "branches", "an object of nothing, log_"),
        (changed("sensor_hysteresis", {"branches": {"first": 1.0}}), "branches.first", "one of no"),
        (
            changed("sensor_hysteresis", {"branches": {"nothing": "1"}}),
            "branches.nothing",
            "found '1'",
        ),
        (changed("creep", {"branches": {"nothing": 1.0}}), "branches", "no loop of the sensor"),
    ],
)
def test_a_bad_effect_names_the_file_and_the_key(
    effect: dict[str, Any], key: str, message: str
) -> None:
    with pytest.raises(BadInput) as refused:
        effects_vector(model(entry("leak"), effect), "out/model.json")
    assert str(refused.value).startswith(f"out/model.json: effects[1].{key}: ")
    assert message in str(refused.value)


def test_an_effect_given_twice() -> None:
    with pytest.raises(BadInput, match=r"effects\[1\]\.id: is 'leak' for the second time"):
        effects_vector(model(entry("leak"), entry("leak")))


@pytest.mark.parametrize("name", [name for name in IDS if LIBRARY[name].parameters])
def test_a_bound_may_have_passed_through_a_logarithm(name: str) -> None:
    for place, outwards in (("low", -4e-16), ("high", 4e-16)):
        edge = {q.name: getattr(q, place) for q in LIBRARY[name].parameters}
        nearly = {key: value + outwards * abs(value) for key, value in edge.items()}
        found = effects_vector(model(entry(name) | {"parameters": nearly}))
        assert found[LIBRARY[name].slots].tolist() == list(edge.values())


# --- which path ------------------------------------------------------------------------------


def test_a_plain_model_is_predicted_as_ever() -> None:
    own = trials(step_release(), triangle())
    table = predict_campaign(model(), campaign_data(own))
    expected = np.concatenate([plain(trial) for trial in own])
    np.testing.assert_array_equal(table["predicted_deg"].to_numpy(), expected)
    np.testing.assert_array_equal(predict_trial(model(), own[1]), plain(own[1]))


def test_what_changes_no_prediction_leaves_the_plain_path() -> None:
    data = campaign_data(trials(step_release(), triangle()))
    shift = entry("parameter_shift") | {"parameters": {"a0": 1.1, "of": "another batch"}}
    silent = model(shift, entry("mains_pickup"))
    assert not is_augmented(silent)
    assert same_bits(data, silent, model())
    louder = model(entry("leak"), entry("mains_pickup"))
    assert same_bits(data, louder, model(entry("leak")))


def test_a_bad_effect_is_refused_even_where_it_changes_nothing() -> None:
    pickup = entry("mains_pickup") | {"stage": "drive"}
    with pytest.raises(BadInput, match="but mains_pickup belongs to the acquisition"):
        predict_campaign(model(pickup), campaign_data(trials(step_release())))


# --- predictions -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ACTING)
def test_every_effect_reaches_the_prediction(name: str) -> None:
    own = trials(step_release(), triangle())
    found = predict_augmented(model(entry(name)), campaign_data(own))
    assert [angle.shape for angle in found] == [trial.t_s.shape for trial in own]
    assert all(np.isfinite(angle).all() for angle in found)
    assert (
        max(np.abs(angle - plain(trial)).max() for angle, trial in zip(found, own, strict=True))
        > 0.3
    )


def test_a_static_curve_is_the_plain_prediction_bent() -> None:
    own = trials(step_release(), triangle())
    bent = model(entry("sensor_nonlinearity"))
    *errors, wider = parameters("sensor_nonlinearity").values()
    knots = (1.0 + wider) * np.array(CURVE_KNOTS_DEG)
    errors.insert(CURVE_KNOTS_DEG.index(0.0), 0.0)
    for angle, trial in zip(predict_augmented(bent, campaign_data(own)), own, strict=True):
        y = plain(trial)
        above = y > 0.0
        np.testing.assert_allclose(angle[above], curve(y[above], knots, errors), atol=0.03)


def test_every_sample_has_its_prediction() -> None:
    """Uneven times, a gap and samples after a reset included; a late channel read in between."""
    full = trials(step_release())[0]
    keep = np.ones(full.t_s.size, dtype=bool)
    keep[60:75] = False
    keep[::7] = False
    keep[0] = True
    assert full.command_kpa is not None
    after = np.arange(full.t_s.size) > 200
    cut = replace(
        full,
        **{
            name: getattr(full, name)[keep]
            for name in ("t_s", "command_kpa", "angle_deg", "outside_calibration")
        },
        after_reset=after[keep],
    )
    late = entry("channel_latency", delay_s=0.1)
    late["parameters"] |= {k: 0.0 for k in late["parameters"] if k != "delay_s"}
    found = predict_augmented(model(late), campaign_data([cut]))[0]
    assert found.size == keep.sum()
    # The command is held over what is lost, as for the plain model.
    linear = np.degrees(simulate(cut.t_s, cut.command_kpa / KPA, *X, hold="zero"))
    np.testing.assert_allclose(found, np.interp(cut.t_s - 0.1, cut.t_s, linear), atol=0.25)


def test_a_late_log_that_holds_its_readings_is_predicted_with_its_holds() -> None:
    """Whoever holds readings for 0.2 s is late by half of it on the mean, and in steps."""
    plain = trials(step_release(), step_release(0.5 * SIXTY))
    read = [np.floor(one.t_s / 0.2 + 1e-9) * 0.2 for one in plain]
    own = [
        replace(one, angle_deg=np.interp(at, one.t_s, one.angle_deg))
        for one, at in zip(plain, read, strict=True)
    ]
    late = entry("channel_latency", delay_s=0.1)
    late["parameters"] |= {k: 0.0 for k in late["parameters"] if k != "delay_s"}
    predicted = predict_augmented(model(late), campaign_data(own))
    for one, before, found in zip(own, plain, predicted, strict=True):
        on_the_mean = np.interp(one.t_s - 0.1, before.t_s, before.angle_deg)
        assert np.std(one.angle_deg - found) < 0.3 * np.std(one.angle_deg - on_the_mean)


def test_trials_come_back_in_the_order_of_the_file() -> None:
    """Experiments may be interleaved: the state follows `order`, the answer the list."""
    own = trials(step_release(), step_release(0.5 * SIXTY), step_release(), step_release())
    soft = model(entry("mullins_softening"), entry("sensor_slip"))
    straight = predict_augmented(soft, campaign_data(own))
    mixed = [own[i] for i in (2, 0, 3, 1)]
    found = predict_augmented(soft, campaign_data(mixed))
    for trial, angle in zip(mixed, found, strict=True):
        np.testing.assert_array_equal(angle, straight[trial.order - 1])
    table = predict_campaign(soft, campaign_data(mixed))
    np.testing.assert_array_equal(table["predicted_deg"].to_numpy(), np.concatenate(found))
    assert table["trial"].drop_duplicates().tolist() == [3, 1, 4, 2]


def test_a_single_trial_is_a_specimens_first() -> None:
    own = trials(step_release(), step_release())
    soft = model(entry("mullins_softening"))
    first, second = predict_augmented(soft, campaign_data(own))
    np.testing.assert_array_equal(predict_trial(soft, own[0]), first)
    alone = predict_trial(soft, own[1])
    assert np.abs(alone - first).max() < 0.05
    assert second[220] > alone[220] + 0.3


def test_a_model_of_the_pressure_has_no_drive() -> None:
    own = tuple(
        replace(trial, pressure_kpa=trial.command_kpa)
        for trial in trials(step_release(), triangle())
    )
    data = campaign_data(own)
    both = model(entry("dead_time"), entry("creep"), signal="pressure")
    creep = model(entry("creep"), signal="pressure")
    assert same_bits(data, both, creep)
    by_command = predict_augmented(model(entry("dead_time"), entry("creep")), data)
    assert np.abs(by_command[0] - predict_augmented(both, data)[0]).max() > 3.0


def test_a_log_without_the_models_signal() -> None:
    data = campaign_data(trials(step_release()))
    with pytest.raises(BadInput, match=r"arm/1\.csv: expected a pressure column"):
        predict_campaign(model(entry("creep"), signal="pressure"), data)
    with pytest.raises(BadInput, match="expected a pressure column"):
        predict_trial(model(entry("creep"), signal="pressure"), data.trials[0])
    with pytest.raises(BadInput, match=r"m\.json: drives the trials by a pressure"):
        ending_memory(model(entry("creep"), signal="pressure"), data, "m.json")


# --- a slipping sensor -----------------------------------------------------------------------


def zeros(slip: dict[str, Any], data: CampaignData) -> list[float]:
    found = predict_augmented(model(slip), data)
    still = predict_augmented(model(entry("sensor_slip", walk_deg=0.0, zero_deg=0.0)), data)
    return [float(np.mean(a - b)) for a, b in zip(found, still, strict=True)]


def test_a_sensor_walks_from_its_zero() -> None:
    data = campaign_data(trials(*[step_release()] * 3, first_order=4))
    assert zeros(entry("sensor_slip", walk_deg=0.5, zero_deg=-1.0), data) == pytest.approx(
        [0.5, 1.0, 1.5]
    )


def test_listed_zeros_take_the_walks_place_and_it_goes_on_from_them() -> None:
    slip = entry("sensor_slip", walk_deg=0.5, zero_deg=-1.0)
    slip["zeros_deg"] = {"2": 3.0, "3": 7.0}
    own = trials(*[step_release()] * 5)
    assert zeros(slip, campaign_data(own)) == pytest.approx([-1.0, 3.0, 7.0, 7.5, 8.0])
    later = campaign_data(own[3:], "later", continues="arm")
    assert zeros(slip, later) == pytest.approx([7.5, 8.0])
    # Another specimen's sensor is another sensor.
    assert zeros(slip, campaign_data(own, "other")) == pytest.approx([-1.0, -0.5, 0.0, 0.5, 1.0])


# --- a loop of the sensor --------------------------------------------------------------------


def test_logs_begin_on_the_branch_that_is_said() -> None:
    even = {"width_deg": 4.0, "turn_deg": 3.0, "exponent": 1.0, "begins": 0.0, "lens": 0.0}
    loop = entry("sensor_hysteresis", **even)
    own = trials(*[step_release()] * 4)

    def moved(data: CampaignData, memory: dict[str, Any]) -> list[list[float]]:
        """Give by how much the branches move a first angle of each log, and its last."""
        on = loop | {"branches": {"nothing": 1.0, "log_to_rest": -0.5}}
        models = [replace(model(one), extra=memory) for one in (on, loop)]
        found = [predict_augmented(one, data) for one in models]
        return [[float(a[i] - b[i]) for i in (4, -1)] for a, b in zip(*found, strict=True)]

    # Half a loop away, or half of that and to the other side, until the actuator bends.
    first, *others = moved(campaign_data(own), {})
    assert first == pytest.approx([-2.0, 0.0], abs=0.02)
    assert others == [pytest.approx([1.0, 0.0], abs=0.02)] * 3
    # What continues a campaign comes from its rest.
    memory = {"memory": ending_memory(model(loop), campaign_data(own[:2]))}
    later = moved(campaign_data(own[2:], "later", continues="arm"), memory)
    assert later == [pytest.approx([1.0, 0.0], abs=0.02)] * 2


# --- campaigns that go on --------------------------------------------------------------------

SLOW = (
    "mullins_softening",
    "creep",
    "hysteresis",
    "thermal_drift",
    "sensor_creep",
    "drive_backlash",
)


def with_memory(data: CampaignData, *names: str) -> Model:
    bare = model(*[entry(name) for name in names])
    return replace(bare, extra={"memory": ending_memory(bare, data)})


def test_a_campaign_and_its_continuation_are_one_long_campaign(tmp_path: Path) -> None:
    own = trials(step_release(), triangle(), step_release(), step_release(0.5 * SIXTY))
    write_model(tmp_path / "m.json", with_memory(campaign_data(own[:2]), *SLOW))
    whole = read_model(tmp_path / "m.json")
    assert whole.extra["memory"]["orders"] == 2
    long = predict_augmented(whole, campaign_data(own))
    later = predict_augmented(whole, campaign_data(own[2:], "later", continues="arm"))
    for found, expected in zip(later, long[2:], strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-9)
    virgin = predict_augmented(whole, campaign_data(own[2:], "later"))
    assert np.abs(virgin[0] - later[0]).max() > 1.0


def test_a_longer_rest_lets_more_recover() -> None:
    own = trials(*[step_release(up=8.0)] * 3)
    crept = with_memory(campaign_data(own[:2]), "creep")
    at_rest = [
        predict_augmented(
            crept,
            campaign_data([replace(own[2], started_s=120.0 + rest)], "later", continues="arm"),
        )[0][0]
        for rest in (0.0, 600.0, 36000.0)
    ]
    assert at_rest[0] > 2.0 * at_rest[1] > 0.0
    assert at_rest[2] == pytest.approx(0.0, abs=0.02)


def test_the_models_own_campaign_starts_virgin() -> None:
    own = trials(step_release(), step_release())
    data = campaign_data(own)
    soft = with_memory(data, "mullins_softening")
    np.testing.assert_array_equal(
        predict_augmented(soft, data)[0],
        predict_augmented(replace(soft, extra={}), data)[0],
    )
    assert past_note(soft, data.campaign) is None


def test_the_past_of_a_third_campaign_follows_from_the_memory_of_the_second() -> None:
    """A model of a campaign that continues another goes through it from the memory it has."""
    own = trials(*[step_release()] * 3)
    soft = with_memory(campaign_data(own[:1]), "mullins_softening")
    second = ending_memory(soft, campaign_data(own[1:2], "second", continues="arm"))
    together = ending_memory(soft, campaign_data(own[:2]))
    assert second["orders"] == together["orders"] == 2
    np.testing.assert_allclose(second["virgin"], together["virgin"])
    assert second["ends_s"] == together["ends_s"] == pytest.approx(60.0 + 7.0, abs=0.03)


def test_what_is_said_of_the_past() -> None:
    own = trials(step_release(), step_release())
    first = campaign_data(own[:1])
    soft = with_memory(first, "mullins_softening")
    later = campaign_data(own[1:], "later", continues="arm").campaign
    assert past_note(soft, first.campaign) is None
    assert past_note(soft, campaign_data(own, "another").campaign) is None
    assert past_note(soft, later) is None
    other = past_note(soft, replace(later, continues="arm_2"))
    assert other == "later continues 'arm_2', the model is of 'arm': predicted as a virgin specimen"
    forgot = past_note(replace(soft, extra={}), later)
    assert forgot is not None
    assert "whose end the model does not hold" in forgot
    hasty = campaign_data([replace(own[1], started_s=3.0)], "later", continues="arm").campaign
    note = past_note(soft, hasty)
    assert note is not None
    assert note.endswith("which ended at 6.98 s, but starts at 3 s: without a rest")


def test_no_memory_and_other_pasts_start_virgin() -> None:
    own = trials(step_release(), step_release())
    soft = with_memory(campaign_data(own[:1]), "mullins_softening")
    fresh = predict_augmented(soft, campaign_data(own[1:], "later"))[0]
    for given, past in ((soft, "arm_2"), (replace(soft, extra={}), "arm")):
        found = predict_augmented(given, campaign_data(own[1:], "later", continues=past))[0]
        np.testing.assert_array_equal(found, fresh)


@pytest.mark.parametrize(
    ("memory", "message"),
    [
        ({}, "memory.modes: missing, expected this key"),
        ([], "memory: expected the state of a specimen"),
        ({"modes": [1.0]}, "memory: expected the state of a specimen: modes: expected"),
    ],
)
def test_a_bad_memory_names_the_file(memory: Any, message: str) -> None:
    own = trials(step_release(), step_release())
    given = model(entry("creep"), extra={"memory": memory})
    later = campaign_data(own[1:], "later", continues="arm")
    with pytest.raises(BadInput) as refused:
        predict_augmented(given, later, "m.json")
    assert str(refused.value).startswith(f"m.json: {message}")


def test_a_model_says_whether_its_actuator_is_let_go_between_trials() -> None:
    data = campaign_data(trials(step_release(), step_release()))
    play = entry("drive_backlash", play_kpa=6.0, centre=1.0)
    holds, goes = (
        predict_augmented(model(play, extra={LET_GO: said}), data)[1] for said in (False, True)
    )
    assert holds[0] > 1.0 > abs(goes[0])
    with pytest.raises(BadInput) as refused:
        predict_augmented(model(play, extra={LET_GO: "yes"}), data, "m.json")
    assert str(refused.value) == f"m.json: {LET_GO}: is 'yes'; expected true or false"


def test_a_memory_is_plain_json() -> None:
    memory = ending_memory(model(entry("creep")), campaign_data(trials(step_release())))
    assert json.loads(json.dumps(memory, allow_nan=False)) == memory
    assert math.isfinite(memory["ends_s"])


# --- the command -----------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "raw" / "steps"
    path.mkdir(parents=True)
    campaigns.step_campaign(path, trials=2)
    return path


def augmented(path: Path, *effects: dict[str, Any], **extra: Any) -> Path:
    write_model(path, replace(model(*effects, extra=extra), campaign="steps"))
    return path


def continued(folder: Path, name: str, past: str) -> Path:
    """A campaign of one trial that goes on from another."""
    later = folder.parent / name
    later.mkdir()
    campaigns.write_log(later / "step/trial_01.csv", campaigns.step_command(50.0), 25.0, seed=9)
    one = {"file": "step/trial_01.csv", "order": 5, "started_s": 400.0}
    document = campaigns.document(
        name, [{"name": "step", "setpoint_deg": None, "protocol": "free", "trials": [one]}]
    )
    campaigns.write_yaml(later, document | {"continues": past})
    campaigns.write_sums(later)
    return later


def test_the_command_runs_an_augmented_model(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bent = augmented(tmp_path / "m.json", entry("stiffening"), entry("sensor_lag"))
    assert main(["predict", str(bent), str(folder), "--out", str(tmp_path / "p.csv")]) == 0
    assert capsys.readouterr().err == f"{tmp_path / 'p.csv'}: 1600 samples of 4 trials\n"
    table = pd.read_csv(tmp_path / "p.csv")
    assert list(table) == ["experiment", "trial", "t_s", "angle_deg", "predicted_deg"]
    high = table[(table["experiment"] == "step_60") & (table["t_s"].between(9.0, 10.9))]
    assert (high["angle_deg"] - high["predicted_deg"]).mean() > 4.0
    assert table.groupby(["experiment", "trial"])["t_s"].first().eq(0.0).all()


def test_the_command_says_once_that_the_past_is_unknown(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    soft = augmented(tmp_path / "m.json", entry("mullins_softening"))
    later = continued(folder, "later", "steps")
    assert main(["predict", str(soft), str(later), "--out", str(tmp_path / "p.csv")]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert lines[0] == (
        f"{soft}: later continues 'steps', whose end the model does not hold: "
        "predicted as a virgin specimen"
    )
    plain_model = augmented(tmp_path / "plain.json")
    assert main(["predict", str(plain_model), str(later), "--out", str(tmp_path / "p.csv")]) == 0
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_the_command_refuses_a_bad_effect_before_it_writes(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = augmented(tmp_path / "m.json", entry("creep") | {"stage": "drive"})
    with pytest.raises(SystemExit) as left:
        main(["predict", str(bad), str(folder), "--out", str(tmp_path / "p.csv")])
    assert left.value.code == 2
    assert capsys.readouterr().err == (
        f"spa-fo: {bad}: effects[0].stage: is 'drive', but creep belongs to the actuator\n"
    )
    assert not (tmp_path / "p.csv").exists()
