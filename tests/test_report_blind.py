"""Tables, figures and page of the blind benchmark: all of it from the scores, alarms first."""

from __future__ import annotations

import copy
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pandas as pd
import pytest

from blind.judge import Answer, Claim, Outcome, Realised, score
from blind.judge.check import goal
from blind.report.document import Further, Origin, document, main
from blind.report.history import Mark, read_history, table, with_run, written
from blind.report.tables import publish, tables
from blind_records import ERROR, QUIET, truth
from spa_fo.errors import BadInput

ORIGIN = Origin("0123abcd", "snakemake --cores 2 blind")
PRIORS = [("scatter.gain", "log-uniform, 0.002 to 0.04", "", "a servo valve, up to a hand")]
PLAN = {"seed": 7, "part": 1, "rigs": ["virtual_rig", "second_rig"]}
FIGURES = ("surroundings", "confusion", "calibration", "size_curve", "shrink")


def outcome(effect: str, named: str, number: int, **others: Any) -> Outcome:
    given = {"case": f"case_{number:04d}"} | others
    case = truth(*([effect] if effect else []), **given)
    if named == "error":
        return Outcome(case, ERROR, refused="there is no diagnosis")
    sets = (frozenset({named}),) if named not in ("none", "unknown") else ()
    verdict = {"none": "no_gap", "unknown": "unknown"}.get(named, "cause")
    claim = Claim(0.8, 0.7, 0.9) if sets else None
    answer = Answer(verdict, sets, frozenset({named}), 0.9, "actuator", claim)
    return Outcome(case, answer, realised=Realised(2.0, 1.0, 1.5))


def scores_of(outcomes: list[Outcome]) -> dict[str, Any]:
    document = score(outcomes).to_dict() | {"benchmark": PLAN}
    plain: dict[str, Any] = json.loads(json.dumps(document))
    return plain


def on_one_rig(rig: str, first: int) -> list[Outcome]:
    named = ["creep"] * 7 + ["leak"] * 3
    noisy = replace(QUIET, coloured_deg=0.3)
    outcomes = [outcome("creep", name, first + i, rig=rig) for i, name in enumerate(named)]
    outcomes += [
        outcome("hysteresis", "hysteresis", first + 20 + i, size=2.0**i, rig=rig) for i in range(4)
    ]
    outcomes += [
        outcome("", name, first + 30 + i, kind="no_effect", size=None, rig=rig, surroundings=noisy)
        for i, name in enumerate(["none"] * 9 + ["error"])
    ]
    outcomes += [outcome("pump_ripple", "unknown", first + 40, kind="alien", rig=rig)]
    return [*outcomes, outcome("creep", "creep", first + 50, protocol="up_steps", rig=rig)]


@pytest.fixture(scope="module")
def scores() -> dict[str, Any]:
    return scores_of(on_one_rig("virtual_rig", 100) + on_one_rig("second_rig", 200))


@pytest.fixture(scope="module")
def results(scores: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    (folder / "scores.json").write_text(json.dumps(scores))
    publish(scores, folder)
    return folder


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Surroundings that are drawn from one prior."""
    stand_in = ModuleType("blind.surroundings")
    stand_in.describe = lambda: PRIORS  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "blind.surroundings", stand_in)


def test_everything_is_published_and_says_that_it_is_synthetic(results: Path) -> None:
    for name in FIGURES:
        assert (results / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (results / f"{name}.pdf").read_bytes().startswith(b"%PDF")
    assert (results / "table.md").read_text().count("synthetic: virtual rig and second rig") == 3
    rows = pd.read_csv(results / "per_effect.csv")
    assert list(rows["effect"][:2]) == ["creep", "creep"]
    assert set(rows["rig"][:2]) == {"virtual_rig", "second_rig"}
    assert rows["worst rate"][0] == pytest.approx(0.7)
    assert rows["of"][0] == 10


def test_every_class_of_surroundings_is_in_its_table(results: Path, scores: dict[str, Any]) -> None:
    rows = pd.read_csv(results / "classes.csv")
    assert len(rows) == len(scores["classes"])
    noisy = rows[(rows["class"] == "above 0.25°") & (rows["mark"] == "no effect: false alarms")]
    assert sorted(noisy["rig"]) == ["second_rig", "virtual_rig"]
    assert list(noisy["value"]) == [0.1, 0.1]
    assert list(noisy["cases"]) == [10, 10]


def test_a_benchmark_of_one_case_can_be_published(tmp_path: Path) -> None:
    lone = scores_of([outcome("", "none", 1, kind="no_effect", size=None)])
    publish(lone, tmp_path)
    assert "| no effect" in (tmp_path / "table.md").read_text()
    assert document(lone, ORIGIN, Further()).startswith("# The blind benchmark")


def test_sizes_from_which_on_an_effect_is_found(scores: dict[str, Any]) -> None:
    rows = tables(scores)["per_effect"].rows.set_index(["effect", "rig"])
    assert rows.loc[("hysteresis", "second_rig"), "rich protocols: found from"] == 1.0
    assert rows.loc[("creep", "second_rig"), "rich protocols: found from"] == 4.0
    assert pd.isna(rows.loc[("creep", "virtual_rig"), "rich protocols: named from"])


def test_the_page_opens_with_the_false_alarms_of_each_rig(scores: dict[str, Any]) -> None:
    lead = document(scores, ORIGIN, Further()).split("\n\n")[1]
    alarms = "a false alarm in 10 % of 10 cases (2 to 40 %) of the virtual rig and in 10 % of 10"
    assert f"Without any effect it gives {alarms}" in lead
    assert lead.index("false alarm") < lead.index("wrong name") < lead.index("goals")


def test_the_note_stands_under_the_summary(scores: dict[str, Any]) -> None:
    parts = document(scores, ORIGIN, Further(note="This run means little.")).split("\n\n")
    assert parts[2] == "This run means little."


def test_the_numbers_of_the_page_are_those_of_the_scores(scores: dict[str, Any]) -> None:
    changed = copy.deepcopy(scores)
    alarms = changed["marks"][0]
    assert alarms["name"] == "no effect: false alarms"
    alarms["estimate"]["value"] = 0.1234
    page = document(changed, ORIGIN, Further())
    assert "a false alarm in 12 % of 10 cases" in page
    assert "| **0.123** |" in page
    assert "`0123abcd`" in page
    assert "seed: 7" in page


def test_the_marks_stand_side_by_side_and_the_worst_class_is_named(scores: dict[str, Any]) -> None:
    page = document(scores, ORIGIN, Further())
    assert "| mark | goal | virtual rig | 95 % | cases | second rig | 95 % | cases |" in page
    assert "| no effect: false alarms | ≤ 0.02 | **0.100** | 0.018 to 0.404 | 10 | **0.1" in page
    assert "with at least 10 cases without an effect: on the virtual rig *" in page
    worst = next(entry for entry in scores["classes"] if entry["estimate"]["n"] >= 10)
    where = f"{worst['rig'].replace('_', ' ')} | {worst['dimension']}: {worst['class']}"
    assert f"| {where} | {worst['name']} | {goal(worst)} |" in page


def test_errors_are_listed_with_their_messages(scores: dict[str, Any]) -> None:
    page = document(scores, ORIGIN, Further())
    assert "2 diagnoses ended in an error" in page
    row = f"| second rig | no effect | diagnosis | `{ERROR.message}` | 1 |"
    assert row in page
    silent = scores_of([outcome("creep", "creep", 1)])
    assert "No diagnosis ended in an error" in document(silent, ORIGIN, Further())


def test_the_page_parts_the_claims_by_rig_and_kind_of_answer(scores: dict[str, Any]) -> None:
    (claims,) = scores["rigs"]["second_rig"]["claims"]
    page = document(scores, ORIGIN, Further())
    start = "| second rig | one cause |"
    row = next(line for line in page.splitlines() if line.startswith(start))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    counts = [claims["answers"], claims["claims"], claims["close"]["n"]]
    assert cells[2:5] == [str(count) for count in counts]
    assert cells[5] == f"{claims['close']['value']:.3f}"


def test_the_page_parts_the_claims_by_how_sure_they_are(scores: dict[str, Any]) -> None:
    own = scores["rigs"]["second_rig"]
    point = {"case": "one", "kind": "closed", "size": 4.0, "refit": 0.0}
    narrow = point | {"claimed": 0.9, "low": 0.85, "high": 1.0, "realised": 0.95}
    wide = point | {"claimed": 0.9, "low": -1.0, "high": 1.0, "realised": 0.2}
    rigs = scores["rigs"] | {"second_rig": own | {"shrink": [narrow, wide, wide, narrow]}}
    page = document(scores | {"rigs": rigs}, ORIGIN, Further())
    starts = tuple(f"| second rig | {width} |" for width in ("0 to 0.25", "0.25 to 0.5", "0.5 up"))
    lines = [line for line in page.splitlines() if line.startswith(starts)]
    assert [line.split("|")[2:5] for line in lines] == [
        [" 0 to 0.25 ", " 2 ", " 1.000 "],
        [" 0.25 to 0.5 ", " 0 ", " – "],
        [" 0.5 up ", " 2 ", " 0.000 "],
    ]


def test_priors_and_measured_actuators_are_on_the_page(scores: dict[str, Any]) -> None:
    page = document(scores, ORIGIN, Further(priors=PRIORS, measured="Three of them were quiet."))
    assert f"| {' | '.join(PRIORS[0])} |" in page
    assert "## Measured actuators, nothing changed\n\nThree of them were quiet." in page
    assert "Measured actuators" not in document(scores, ORIGIN, Further())


def test_rigs_of_other_hands_are_added_up(scores: dict[str, Any]) -> None:
    """Of all sets, and of the first ones; more is on their own page."""
    name = "no effect: false alarms"
    others = [
        Mark(number, "abcdef0", "1", "sixth_rig", 84, name, "≤ 0.02", value, 10, reached)
        for number, value, reached in ((1, "0.000", "yes"), (2, "0.100", "no"))
    ]
    page = document(scores, ORIGIN, Further(others=others))
    part = page.split("## Rigs of other hands")[1].split("\n## ")[0]
    assert f"| {name} | ≤ 0.02 | 1 of 20 (5 %, 1 to 24) | 0 of 10 (0 %, 0 to 28) |" in part
    assert "false alarms in 5.0 % of 20 cases" in page.split("## ")[0]
    assert "igs of other hands" not in document(scores, ORIGIN, Further()).split("## Words")[0]


# --- the command ----------------------------------------------------------------------------------


DOCS = Path(__file__).parents[1] / "docs"

OLD = """\
seed,commit,cases,mark,goal,value,n,reached
2035,abcdef012,340,found,≥ 0.95,0.955,44,yes
"""


@pytest.mark.usefixtures("drawn")
def test_the_command_copies_the_results_beside_the_page(results: Path, tmp_path: Path) -> None:
    documents = tmp_path / "docs"
    beside = documents / "blind"
    beside.mkdir(parents=True)
    (beside / "history_one_rig.csv").write_text(OLD)
    (beside / "note.md").write_text("# A note\n\nWhat it means.\n")
    (beside / "measured_repeats.md").write_text(
        "# Repeats\n\nOf [nine](measured_repeats.md) [campaigns](../real.md)\n"
        "none was found to differ.\n"
        "\n## What is asked\n\nToo long.\n"
    )
    for name in ("real", "diagnosis", "other_rigs"):
        (documents / f"{name}.md").write_text("Measured.\n")
    assert main([str(results), str(documents), "--command", "snakemake blind"]) == 0
    page = (documents / "blind.md").read_text()
    links = {part.split(")")[0] for part in page.split("](")[1:]}
    assert {"blind/measured_repeats.md", "real.md"} <= links
    assert len(links) == 9 + len(FIGURES)
    for link in links:
        assert (documents / link.split("#")[0]).is_file(), link
    assert "`snakemake blind`" in page
    assert "\n\nWhat it means.\n\n" in page
    assert "none was found to differ" in page
    assert "Too long." not in page
    assert PRIORS[0][1] in page
    assert "classes" not in json.loads((beside / "scores.json").read_text())


def test_the_published_page_is_made_of_what_stands_beside_it(tmp_path: Path) -> None:
    documents = tmp_path / "docs"
    shutil.copytree(DOCS / "blind", documents / "blind")
    before = {path.name: path.read_bytes() for path in (documents / "blind").iterdir()}
    told = [str(documents / "blind"), str(documents), "--command", "snakemake --cores 2 blind"]
    assert main(told) == 0
    assert (documents / "blind.md").read_text() == (DOCS / "blind.md").read_text()
    assert {path.name: path.read_bytes() for path in (documents / "blind").iterdir()} == before


def test_a_folder_without_scores_is_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main([str(tmp_path), str(tmp_path / "docs"), "--command", "x"])
    assert left.value.code == 2
    assert "scores.json" in capsys.readouterr().err
    assert not (tmp_path / "docs").exists()


@pytest.mark.usefixtures("drawn")
def test_every_run_stays_on_the_page(scores: dict[str, Any], tmp_path: Path) -> None:
    results, documents = tmp_path / "results", tmp_path / "docs"
    results.mkdir()
    for changes in ({"seed": 7}, {"seed": 8, "part": 0.1}, {"seed": 8}, {"seed": 8}):
        told = scores | {"benchmark": PLAN | changes}
        (results / "scores.json").write_text(json.dumps(told))
        assert main([str(results), str(documents), "--command", "snakemake blind"]) == 0
    page = (documents / "blind.md").read_text()
    assert page.count("| mark | goal | seed 7 | seed 8, 10 % | seed 8 |\n") == 2
    assert "### Virtual rig\n" in page
    history = read_history(documents / "blind" / "history.csv")
    assert len(history) == 3 * len(scores["marks"])
    assert [mark.rig for mark in history[-2:]] == ["second_rig", "both"]
    missed = next(mark for mark in history if mark.reached == "no")
    cell = f"**{missed.value}**"
    assert f"| {missed.mark} | {missed.goal} | {cell} | {cell} | {cell} |" in page
    of_rig = [mark for mark in scores["marks"] if mark["rig"] in ("virtual_rig", "both")]
    reached = sum(mark["reached"] is True for mark in of_rig)
    judged = sum(mark["reached"] is not None for mark in of_rig)
    assert f"| marks reached | | {reached} of {judged} | {reached} of {judged} |" in page


# --- the history ----------------------------------------------------------------------------------


def test_history_is_read_as_it_was_written(tmp_path: Path) -> None:
    runs = [
        Mark(1, "abc", "1", "virtual_rig", 340, "found, or not", "≥ 0.95", "0.955", 44, "yes"),
        Mark(2, "abc", "0.5", "second_rig", 340, "found, or not", "≥ 0.95", "", 0, ""),
    ]
    path = tmp_path / "history.csv"
    assert read_history(path) == []
    path.write_text(written(runs), encoding="utf-8")
    assert read_history(path) == runs
    again = with_run(runs, [replace(runs[0], value="0.9", reached="no")])
    assert [mark.seed for mark in again] == [2, 1]
    assert "| found, or not | ≥ 0.95 | **0.9** |" in table(again, "virtual_rig")
    assert "| found, or not | ≥ 0.95 | – |" in table(again, "second_rig")


def test_a_history_without_rigs_is_that_of_the_virtual_rig(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    path.write_text(OLD, encoding="utf-8")
    (mark,) = read_history(path)
    assert (mark.rig, mark.share, mark.cases) == ("virtual_rig", "1", 340)


@pytest.mark.parametrize(("text", "where"), [("seed,commit\n1,abc\n", "line 1"), (None, "line 2")])
def test_a_damaged_history_is_bad_input(tmp_path: Path, text: str | None, where: str) -> None:
    path = tmp_path / "history.csv"
    one = Mark(1, "abc", "1", "virtual_rig", 340, "found", "≥ 0.95", "0.955", 44, "yes")
    path.write_text(text or written([one]).replace("340", "many"), encoding="utf-8")
    with pytest.raises(BadInput, match=f"history.csv: {where}: expected"):
        read_history(path)


def test_goals_are_written_as_people_do() -> None:
    assert goal({"goal": 0.95, "at_least": True}) == "≥ 0.95"
    assert goal({"goal": 1.3, "at_least": False}) == "≤ 1.3"
