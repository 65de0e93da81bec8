"""What changed between two campaigns of one actuator."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import campaigns
from blind.first_rig import write_case
from blind_documents import document, read
from spa_fo.api import Campaign, Comparison
from spa_fo.cli import main
from spa_fo.compare import compare, identify_reference
from spa_fo.compare.zero import _moved_before
from spa_fo.config import match_materials
from spa_fo.errors import BadInput
from spa_fo.identify import fit_campaign
from spa_fo.plant import read_model
from spa_fo.report.change import answer, change_figure
from spa_fo.rig import read_campaign, read_trials
from spa_fo.rig.first_change import before_first_change

RICH = {"name": "rich", "repeats": 2}


def pair(folder: Path, *effects: str, size: float = 6.0) -> tuple[Path, Path]:
    """Measure one specimen of the virtual rig twice: before any effect, and with these."""
    asked = document(*effects, size=size, protocol=RICH, model={"kind": "earlier", "off": 0.0})
    write_case(asked, folder)
    return folder / "earlier", folder / "campaign"


@pytest.fixture(scope="module")
def blocked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return pair(tmp_path_factory.mktemp("blocked"), "contact_stop")


@pytest.fixture(scope="module")
def compared(
    blocked: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Comparison, Path]:
    earlier, campaign = blocked
    comparison = Campaign.load(campaign).compare(earlier)
    folder = tmp_path_factory.mktemp("compared")
    comparison.save(folder)
    return comparison, folder


# --- the zero of a log ---------------------------------------------------------------------------


def test_a_zero_that_was_taken_while_the_angle_moved_is_not_sure(tmp_path: Path) -> None:
    write_case(document(protocol={"name": "single", "repeats": 1}), tmp_path)
    data = read(tmp_path / "campaign")
    assert not data.campaign.logs_are_zeroed  # its zero is the sensor's
    trial = data.trials[0]
    still = _moved_before(trial)
    before = before_first_change(trial)
    angle = trial.angle_deg.copy()
    angle[:before] += np.linspace(-5.0, 0.0, before)
    assert still < 0.5
    assert _moved_before(replace(trial, angle_deg=angle)) == pytest.approx(4.0, abs=0.6)


# --- the comparison ------------------------------------------------------------------------------


def test_nothing_changed_where_nothing_did(tmp_path: Path) -> None:
    earlier, campaign = pair(tmp_path)
    comparison = Campaign.load(campaign).compare(earlier)
    assert comparison.kind == "nothing_changed"
    assert comparison.causes == ()
    document = comparison.document
    assert document["shrink"] is None
    assert set(document["where"]["stage"].values()) == {0.0}
    assert comparison.model.effects == ()
    assert "Nothing changed" in comparison.headline()[0]


def test_where_the_reference_never_was_nothing_is_compared(tmp_path: Path) -> None:
    campaigns.step_campaign(tmp_path / "steps", trials=2)
    data = read_trials(read_campaign(tmp_path / "steps"))
    model = fit_campaign(data, bootstrap=None).model
    trials = [
        replace(t, command_kpa=t.command_kpa + 200.0, angle_deg=t.angle_deg + 200.0)
        for t in data.trials
    ]
    found = compare(data, replace(data, trials=tuple(trials)), model)
    assert found.unvisited > 0.95
    assert (found.kind, found.change.sets, found.change.where.stage) == ("unknown", (), None)
    assert "the reference was hardly ever where" in str(found.change.where.not_known)
    assert "cannot be said" in answer(found)[0]


def test_what_is_pressed_harder_than_ever_and_bends_less_has_changed(tmp_path: Path) -> None:
    campaigns.step_campaign(tmp_path / "steps", trials=2)
    data = read_trials(read_campaign(tmp_path / "steps"))
    model = fit_campaign(data, bootstrap=None).model
    blocked = [
        replace(t, command_kpa=5.0 * t.command_kpa, angle_deg=np.minimum(t.angle_deg, 12.0))
        for t in data.trials
    ]
    found = compare(data, replace(data, trials=tuple(blocked)), model)
    assert found.kind != "nothing_changed"
    shares = found.change.where.stage
    assert shares is not None
    assert max(shares, key=lambda stage: shares[stage]) == "actuator"
    said = [text for text in found.change.findings if "bends less" in text]
    assert len(said) == len(blocked)
    assert said[0].startswith("From 1")  # its step's second


def test_what_the_held_out_trial_alone_shows_is_explained_from_all(tmp_path: Path) -> None:
    """A sensor comes off between two logs, of which the second would be held out."""
    campaigns.step_campaign(tmp_path / "steps", trials=2)
    data = read_trials(read_campaign(tmp_path / "steps"))
    model = fit_campaign(data, bootstrap=None).model
    name = data.trials[0].experiment
    first, second = (t for t in data.trials if t.experiment == name)
    loose = replace(second, angle_deg=0.25 * second.angle_deg)
    found = compare(data, replace(data, trials=(first, loose)), model)
    assert found.change.held_out_on.startswith(
        "none, as what could be held out is all that shows the change"
    )
    shares = found.change.where.stage
    assert shares is not None
    assert max(shares, key=lambda stage: shares[stage]) == "sensor"
    assert found.change.sets
    same = compare(data, replace(data, trials=(first, second)), model)
    assert same.change.held_out_on.startswith("one trial of each of")


@pytest.mark.parametrize("change", ["nothing", "an obstacle"])
def test_an_angle_that_falls_is_compared_as_one_that_rises(change: str, tmp_path: Path) -> None:
    """And one that rests far from 0."""
    campaigns.step_campaign(tmp_path / "steps", trials=3)
    data = read_trials(read_campaign(tmp_path / "steps"))
    top = np.inf if change == "nothing" else 35.0
    falling = [replace(t, angle_deg=-70.0 - t.angle_deg) for t in data.trials]
    blocked = [replace(t, angle_deg=-70.0 - np.minimum(t.angle_deg, top)) for t in data.trials]
    reference, campaign = (
        Campaign(replace(data, trials=tuple(trials))) for trials in (falling, blocked)
    )
    with pytest.raises(BadInput, match="expected an angle that rises with the input"):
        fit_campaign(reference.data)
    comparison = campaign.compare(reference)
    assert (comparison.kind == "nothing_changed") == (change == "nothing")
    assert comparison.result.change.findings[-1].startswith("The angle falls as the input rises")


def test_the_model_of_a_reference_whose_steps_are_of_no_use_is_of_whole_logs(
    tmp_path: Path,
) -> None:
    campaigns.step_campaign(tmp_path / "steps", trials=1)
    data = read_trials(read_campaign(tmp_path / "steps"))
    signals = ("t_s", "command_kpa", "angle_deg", "after_reset", "outside_calibration")
    few = [replace(t, **{name: getattr(t, name)[::40] for name in signals}) for t in data.trials]
    thin = replace(data, trials=tuple(few))
    with pytest.raises(BadInput, match="expected at least 10 samples"):
        fit_campaign(thin)
    known = identify_reference(thin, thin, seed=1)
    assert known.plain.transfer_function.b0 > 0.0
    assert (known.reference, known.data, known.finding) == (thin, thin, "")


def test_where_one_campaign_lacks_commands_the_pressure_drives_both(tmp_path: Path) -> None:
    write_case(document(protocol=RICH, model={"kind": "earlier", "off": 0.0}), tmp_path)
    reference, data = read(tmp_path / "earlier"), read(tmp_path / "campaign")
    without = replace(data, trials=tuple(replace(t, command_kpa=None) for t in data.trials))
    assert identify_reference(reference, data, seed=1).plain.signal == "command"
    assert identify_reference(reference, without, seed=1).plain.signal == "pressure"


def test_a_comparison_needs_no_protocol(tmp_path: Path) -> None:
    """A staircase that says to be a step is refused elsewhere."""
    for name in ("before", "after"):
        document = campaigns.free_campaign(tmp_path / name, trials=2)
        for experiment in document["experiments"]:
            experiment["protocol"] = "step_release"
        campaigns.write_yaml(tmp_path / name, document)
    with pytest.raises(BadInput, match="expected one step"):
        Campaign.load(tmp_path / "before")
    out = tmp_path / "out"
    assert (
        main(["compare", str(tmp_path / "before"), str(tmp_path / "after"), "--out", str(out)]) == 0
    )
    assert json.loads((out / "comparison.json").read_text())["verdict"]["kind"] == "nothing_changed"


def test_a_campaign_is_as_it_is(blocked: tuple[Path, Path]) -> None:
    """Also where the model misses it: what is missed in both is no change."""
    _, campaign = blocked
    assert Campaign.load(campaign).compare(campaign).kind == "nothing_changed"


def test_what_changed_is_named(compared: tuple[Comparison, Path]) -> None:
    comparison, _ = compared
    assert comparison.kind == "cause"
    assert comparison.causes == (("contact_stop",),)
    assert comparison.document["where"]["stage"]["actuator"] > 0.8
    assert "contact_stop" in comparison.model.effects


def test_the_files_are_those_of_the_contract(
    compared: tuple[Comparison, Path], blocked: tuple[Path, Path]
) -> None:
    comparison, folder = compared
    document = json.loads((folder / "comparison.json").read_text())
    earlier, campaign = (read(each).campaign.name for each in blocked)
    assert document["schema"] == "spa-fo/comparison/1"
    assert (document["reference"], document["campaign"]) == (earlier, campaign)
    assert document["verdict"]["kind"] == "cause"
    assert sum(cause["probability"] for cause in document["causes"]) == pytest.approx(1.0)
    model = read_model(folder / "augmented_model.json")
    assert [effect["id"] for effect in model.effects] == document["verdict"]["sets"][0]
    page = (folder / "comparison.md").read_text()
    assert "synthetic data" in page
    for name in ("measured.png", "measured.pdf", "change.png", "change.pdf"):
        assert (folder / name).stat().st_size > 1000
    assert str(comparison).splitlines()[0] == f"What changed in {campaign} since {earlier}"
    assert comparison.plot("change").axes
    with pytest.raises(BadInput, match="expected one of measured, change"):
        comparison.plot("ladder")


def test_the_command(
    blocked: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    earlier, campaign = blocked
    out = tmp_path / "changed"
    assert main(["compare", str(earlier), str(campaign), "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("What changed: ")
    assert said.out.splitlines()[-1] == str(out / "comparison.md")
    with pytest.raises(SystemExit) as left:
        main(["compare", str(campaign), str(earlier), "--out", str(out)])
    assert left.value.code == 2
    assert "--overwrite" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--model", "none.json"], "none.json"),
        (["--exclude-effect", "contact_stpo"], "did you mean 'contact_stop'"),
    ],
)
def test_a_bad_request_is_one_line(
    blocked: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    earlier, campaign = blocked
    out = tmp_path / "changed"
    with pytest.raises(SystemExit) as left:
        main(["compare", str(earlier), str(campaign), "--out", str(out), *arguments])
    assert left.value.code == 2
    assert said in capsys.readouterr().err.splitlines()[-1]
    assert not out.exists()


def test_a_reference_is_another_material(tmp_path: Path) -> None:
    materials = {"arm": {}, "later": {"reference": "amr"}}
    with pytest.raises(BadInput, match=r"config.yaml: materials.later.reference: is 'amr'.*'arm'"):
        match_materials(materials, tmp_path, "config.yaml")
    materials["later"]["reference"] = "arm"
    assert match_materials(materials, tmp_path, "config.yaml") == materials


def test_the_legend_of_a_long_set_is_within_its_figure(
    compared: tuple[Comparison, Path],
) -> None:
    found = compared[0].result
    ids = ("supply_droop", "drive_backlash", "sensor_nonlinearity", "channel_latency", "creep")
    figure = change_figure(replace(found, change=replace(found.change, sets=(ids,))))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    box = figure.legends[0].get_window_extent(canvas.get_renderer())
    width, height = canvas.get_width_height()
    assert 0.0 <= box.x0 < box.x1 <= width
    assert 0.0 <= box.y0 < box.y1 <= height
