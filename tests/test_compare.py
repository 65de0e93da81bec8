"""What changed between two campaigns of one actuator."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import campaigns
from blind.first_rig import write_case
from blind_documents import document, read
from spa_fo.api import Campaign, Comparison
from spa_fo.cli import main
from spa_fo.compare import compare
from spa_fo.compare.compare import _moved_before, _zeroed
from spa_fo.compare.fading_memory import FadingMemoryLaw, Signal, inputs, kernel, learn, telling
from spa_fo.config import match_materials
from spa_fo.errors import BadInput
from spa_fo.identify import fit_campaign
from spa_fo.plant import read_model
from spa_fo.report.change import answer
from spa_fo.rig import read_campaign, read_trials
from spa_fo.rig.trials import before_first_change

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


# --- the law of what is missed in both -----------------------------------------------------------


def signals(trials: int = 3, gain: float = 1.0) -> list[Signal]:
    """Trials of an actuator whose misses depend on a slow lag of the input, squared."""
    made = []
    for trial in range(trials):
        t = np.arange(0.0, 12.0, 0.05)
        drive = np.where((t > 1.0) & (t < 7.0), 10.0 + 4.0 * trial, 0.0)
        (x,) = inputs([Signal(0.0, t, drive, t)], np.array([2.0]))
        made.append(Signal(1000.0 * trial, t, drive, gain * 0.01 * x[:, 1] ** 2))
    return made


def test_the_law_predicts_a_trial_between_those_that_it_learned_from() -> None:
    first, between, last = signals()
    law = learn([first, last])
    ((mean, deviation),) = law.predict([between])
    size = float(np.sqrt(np.mean(between.missed**2)))
    assert float(np.sqrt(np.mean((mean - between.missed) ** 2))) < 0.2 * size
    assert deviation.shape == mean.shape


def test_the_law_goes_back_to_nothing_where_nothing_like_it_was_seen() -> None:
    law = learn(signals())
    far = replace(signals(1)[0], input=40.0 * signals(1)[0].input)
    ((mean, deviation),) = law.predict([far])
    on = far.input > 0.0
    assert np.abs(mean[on]).max() < 0.2 * law.amplitude
    assert deviation[on].min() > 0.9 * law.amplitude


def test_where_nothing_is_missed_the_law_is_nothing() -> None:
    quiet = signals(gain=0.0)
    law = learn(quiet)
    assert law.left_rms == 0.0
    assert all(np.all(mean == 0.0) for mean, _ in law.predict(quiet))


def test_what_was_left_out_took_no_part() -> None:
    """The misses on a left-out trial are those of a law that never saw it."""
    trials = signals()
    trials[1] = replace(trials[1], missed=trials[1].missed + 5.0)
    law = learn(trials)
    others = plainly_left_out(trials, 1, law)
    np.testing.assert_allclose(law.left[1], others, atol=1e-6)
    assert np.mean(law.left[1]) == pytest.approx(5.0, abs=1.5)


def plainly_left_out(trials: list[Signal], out: int, law: FadingMemoryLaw) -> np.ndarray:
    """Learn from the chosen samples of the other trials, by the textbook's formula."""
    every = (np.concatenate(inputs(trials, law.lags_s)) - law.centre) / law.scale
    ends = np.cumsum([0, *(t.t_s.size for t in trials)])
    chosen = telling(every)
    learned = chosen[(chosen < ends[out]) | (chosen >= ends[out + 1])]
    y = np.concatenate([t.missed for t in trials])
    k = kernel(every[learned], every[learned], law.length) + law.noise * np.eye(learned.size)
    weights = np.linalg.solve(k, y[learned])
    mine = slice(int(ends[out]), int(ends[out + 1]))
    return y[mine] - kernel(every[mine], every[learned], law.length) @ weights


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.0, 50.0), min_size=2, max_size=6), st.floats(0.1, 20.0))
def test_the_lags_are_those_of_a_plain_loop(levels: list[float], lag_s: float) -> None:
    t = np.arange(0.0, 2.0 * len(levels), 0.02)
    drive = np.repeat(levels, 100)[: t.size]
    (x,) = inputs([Signal(0.0, t, drive, t)], np.array([lag_s]))
    state, plain = 0.0, []
    for value in drive:
        state += (1.0 - np.exp(-0.02 / lag_s)) * (value - state)
        plain.append(state)
    np.testing.assert_allclose(x[:, 1], plain, atol=1e-6 * max(1.0, max(levels)))
    np.testing.assert_array_equal(x[:, 2], np.maximum.accumulate(drive))


def test_a_trial_begins_with_what_the_one_before_left() -> None:
    t = np.arange(0.0, 4.0, 0.02)
    first = Signal(0.0, t, np.full(t.size, 8.0), t)
    second = Signal(first.t_s[-1] + 5.0, t, np.zeros(t.size), t)
    at_once, later = inputs([first, second], np.array([3.0]))
    left = at_once[-1, 1] * np.exp(-5.0 / 3.0)
    assert later[0, 1] == pytest.approx(left, rel=0.02)


# --- the zero of a log ---------------------------------------------------------------------------


def test_a_zero_that_was_taken_while_the_angle_moved_is_not_sure(tmp_path: Path) -> None:
    write_case(document(protocol={"name": "single", "repeats": 1}), tmp_path)
    data = read(tmp_path / "campaign")
    assert not _zeroed(data)  # its zero is the sensor's
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
    trials = [replace(t, command_kpa=t.command_kpa + 200.0) for t in data.trials]
    found = compare(data, replace(data, trials=tuple(trials)), model)
    assert found.unvisited > 0.95
    assert (found.kind, found.change.sets, found.change.where.stage) == ("unknown", (), None)
    assert "the reference was hardly ever where" in str(found.change.where.not_known)
    assert "cannot be said" in answer(found)[0]


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
