"""Cases of anybody's rig, judged by the goals of the blind benchmark."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from blind import other_rig
from blind.judge.records import Outcome, Realised
from blind.other_rig import main, marks_of, outcome, read_labels
from blind.report.history import read_history
from blind_records import answer, ids
from spa_fo.errors import BadInput
from test_blind_reading import diagnosis

LABEL: dict[str, Any] = {
    "id": "case_001",
    "kind": "single",
    "effects": ["creep"],
    "exclude": [],
    "floors": 3.7,
}


def labels(folder: Path, *changes: dict[str, Any]) -> Path:
    path = folder / "labels.json"
    path.write_text(json.dumps([LABEL | each for each in changes]), encoding="utf-8")
    return path


def answered(folder: Path) -> Path:
    """Answer the case, and predict its unseen trials."""
    work = folder / "work" / "case_001"
    work.mkdir(parents=True)
    (folder / "case_001" / "unseen").mkdir(parents=True)
    (work / "diagnosis.json").write_text(json.dumps(diagnosis()), encoding="utf-8")
    (work / "realised.json").write_text('{"before_deg": 2.0, "after_deg": 0.5}', encoding="utf-8")
    return work.parent


def test_a_label_says_what_is_true_of_a_case(tmp_path: Path) -> None:
    path = labels(
        tmp_path,
        {},
        {"kind": "none", "effects": [], "floors": 0.0},
        {"kind": "withheld", "exclude": ["creep"], "floors": 8.1, "protocol": "lean"},
        {"effects": ["gain_growth"], "floor_deg": 0.4},
    )
    single, none, withheld, further = (label.truth for label in read_labels(path, "a rig"))
    assert (single.kind, single.size, single.is_rich) == ("closed", 4.0, True)
    assert (none.kind, none.size, none.effects) == ("no_effect", None, ids())
    assert (withheld.kind, withheld.size, withheld.is_rich) == ("withheld", 8.0, False)
    assert withheld.fair(ids("sensor_creep"))
    assert not single.fair(ids("sensor_creep"))
    assert (further.kind, further.noise_floor_deg) == ("further", 0.4)


def test_what_is_withheld_is_no_fair_answer_nor_what_only_pressure_tells(tmp_path: Path) -> None:
    change = {"kind": "withheld", "effects": ["line_lag"], "exclude": ["line_lag", "dead_time"]}
    path = labels(tmp_path, change, change | {"pressure": False})
    measured, unmeasured = (label.truth for label in read_labels(path, "a rig"))
    assert measured.equivalents == ids()
    assert unmeasured.equivalents == ids("channel_latency", "sensor_lag")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "closed"}, r"labels.json: \[0\].kind: is 'closed'; expected one of none, single"),
        ({"effects": ["crep"]}, r"labels.json: \[0\].effects: is 'crep'; expected a known effect"),
        ({"floors": 0.0}, r"labels.json: \[0\].floors: is 0.0; expected a positive number"),
        ({"protocol": "poor"}, r"labels.json: \[0\].protocol: is 'poor'; expected rich or lean"),
        ({"effects": None}, r"\[0\].effects: is None; expected a list"),
        ({"effects": [["creep"]]}, r"\[0\].effects: is \['creep'\]; expected a known effect"),
        ({"kind": ["none"]}, r"\[0\].kind: is \['none'\]; expected one of"),
        ({"kind": "pair"}, r"\[0\].effects: holds 1, which a case of 'pair' does not"),
        ({"kind": "none"}, r"\[0\].effects: holds 1, which a case of 'none' does not"),
        ({"kind": "withheld"}, r"\[0\].exclude: lacks what is withheld"),
        ({"floor_deg": None}, r"\[0\].floor_deg: is None; expected a positive number"),
        ({"floors": float("inf")}, r"\[0\].floors: is inf; expected a positive number"),
        ({"pressure": "no"}, r"\[0\].pressure: is 'no'; expected true or false"),
    ],
)
def test_a_bad_label_is_one_line(change: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=said):
        read_labels(labels(tmp_path, change), "a rig")


def test_labels_that_are_none_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="expected a list of labels as JSON"):
        read_labels(tmp_path / "labels.json", "a rig")
    (tmp_path / "labels.json").write_text('[{"id": "case_001"}]', encoding="utf-8")
    with pytest.raises(BadInput, match=r"\[0\].kind: is missing"):
        read_labels(tmp_path / "labels.json", "a rig")


def test_each_goal_is_held_against_the_cases_that_it_is_about(tmp_path: Path) -> None:
    path = labels(tmp_path, {"floor_deg": 0.3}, {"id": "case_002"}, {"kind": "none", "effects": []})
    first, second, none = (label.truth for label in read_labels(path, "a rig"))
    found = marks_of(
        [
            Outcome(first, answer(["creep"])),
            Outcome(second, answer(["leak"])),
            Outcome(none, answer()),
        ],
        1,
        "abc",
    )
    values = {mark.mark: (mark.value, mark.n, mark.reached) for mark in found}
    assert values["no effect: false alarms"] == ("0.000", 1, "yes")
    large = "rich protocol, 4 or more times the floor"
    assert values[f"{large}: truth in the sets"] == ("0.500", 2, "no")
    assert values["effect in the library: wrong confident name"] == ("0.500", 2, "no")
    assert not any("pair" in mark for mark in values)
    assert {(mark.rig, mark.seed, mark.cases) for mark in found} == {("a rig", 1, 3)}


def test_a_case_is_diagnosed_once_and_an_error_is_an_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    label = read_labels(labels(tmp_path, {}), "a rig")[0]
    found = outcome(tmp_path, label, tmp_path / "work", 1)
    assert found.answer.verdict == "error"
    assert "expected one campaign, found 0" in found.answer.message
    monkeypatch.setattr(other_rig, "_diagnose", None)
    assert outcome(tmp_path, label, tmp_path / "work", 1) == found


def judge(folder: Path, rig: str, commit: str, work: str = "work") -> int:
    told = ["--rig", rig, "--set", "1", "--commit", commit, "--work", str(folder / work)]
    return main([str(folder), *told, "--out", str(folder / "others.csv"), "--processes", "1"])


def test_a_set_is_judged_once_by_one_engine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another rig may have a set of the same number."""
    labels(tmp_path, {"kind": "none", "effects": [], "floors": 0.0})
    work = tmp_path / "work" / "case_001"
    work.mkdir(parents=True)
    (work / "error.txt").write_text("no gap, no answer\n", encoding="utf-8")
    for rig in ("one", "two", "one"):
        assert judge(tmp_path, rig, "a") == 0
    said = capsys.readouterr()
    assert "case_001  no_effect: no_effect  ->  error" in said.err
    assert "no effect: false alarms: 1.000 of 1, goal ≤ 0.02 missed" in said.out
    once = [(mark.rig, mark.commit) for mark in read_history(tmp_path / "others.csv")]
    assert sorted(once) == [("one", "a"), ("two", "a")]
    for rig, work_of, text in (
        ("one", "other", "others.csv: holds set 1 of the one, judged by a"),
        ("three", "work", 'made_by.json: expected {"commit": "b", "seed": 1}'),
    ):
        with pytest.raises(SystemExit) as left:
            judge(tmp_path, rig, "b", work_of)
        assert left.value.code == 2
        assert text in capsys.readouterr().err


def test_without_a_noise_floor_no_claim_is_judged(tmp_path: Path) -> None:
    label = read_labels(labels(tmp_path, {}), "a rig")[0]
    folder = answered(tmp_path)
    assert outcome(tmp_path, label, folder, 1).realised is None


def test_a_claim_is_held_against_what_was_predicted_before(tmp_path: Path) -> None:
    label = read_labels(labels(tmp_path, {"floor_deg": 0.3}), "a rig")[0]
    found = outcome(tmp_path, label, answered(tmp_path), 1)
    assert isinstance(found.realised, Realised)
    assert (found.realised.before_deg, found.realised.after_deg) == (2.0, 0.5)
    by_name = {mark.mark: mark for mark in marks_of([found], 1, "abc")}
    close = by_name["shrink: claim within 10 points of realised"]
    assert (close.n, close.reached) == (1, "yes")  # 0.9 is claimed of 0.96
