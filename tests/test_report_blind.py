"""Tables, figures and page of the blind benchmark: all of it from the scores, the worst first."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from blind.judge import Answer, Claim, Outcome, Realised, Truth, score
from blind.report.document import Origin, document, main
from blind.report.history import Mark, read_history, table, with_run, written
from blind.report.tables import publish, tables
from spa_fo.errors import BadInput

ORIGIN = Origin("0123abcd", "snakemake --cores 2 blind")


def outcome(effect: str, named: str, number: int, **others: Any) -> Outcome:
    given: dict[str, Any] = {"kind": "closed", "size": 4.0, "protocol": "rich"} | others
    truth = Truth(
        case=f"case_{number:04d}",
        effects=frozenset({effect} - {""}),
        equivalents=frozenset(),
        noise_floor_deg=0.5,
        model="nominal",
        form="a",
        **given,
    )
    sets = (frozenset({named}),) if named not in ("none", "unknown") else ()
    verdict = {"none": "no_gap", "unknown": "unknown"}.get(named, "cause")
    claim = Claim(0.8, 0.7, 0.9) if sets else None
    answer = Answer(verdict, sets, frozenset({named}), 0.9, "actuator", claim)
    return Outcome(truth, answer, realised=Realised(2.0, 1.0, 1.5))


def scores_of(outcomes: list[Outcome]) -> dict[str, Any]:
    document = score(outcomes).to_dict() | {"benchmark": {"seed": 7, "closed": {"rich": 1}}}
    plain: dict[str, Any] = json.loads(json.dumps(document))
    return plain


@pytest.fixture(scope="module")
def scores() -> dict[str, Any]:
    named = ["creep"] * 7 + ["leak"] * 3
    outcomes = [outcome("creep", name, i) for i, name in enumerate(named)]
    outcomes += [outcome("hysteresis", "hysteresis", 20 + i, size=2.0**i) for i in range(4)]
    outcomes += [outcome("", "none", 30 + i, kind="no_effect", size=None) for i in range(3)]
    outcomes += [outcome("pump_ripple", "unknown", 40, kind="alien")]
    outcomes += [outcome("creep", "creep", 50, protocol="up_steps")]
    return scores_of(outcomes)


def test_everything_is_published_and_says_that_it_is_synthetic(
    scores: dict[str, Any], tmp_path: Path
) -> None:
    publish(scores, tmp_path)
    for name in ("confusion", "calibration", "size_curve", "shrink"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / f"{name}.pdf").read_bytes().startswith(b"%PDF")
    assert (tmp_path / "table.md").read_text().count("synthetic: virtual rig") == 3
    rows = pd.read_csv(tmp_path / "per_effect.csv")
    assert rows["effect"][0] == "creep"
    assert rows["worst rate"].is_monotonic_increasing
    assert rows["worst rate"][0] == pytest.approx(0.7)
    assert rows["of"][0] == 10


def test_a_benchmark_without_effects_can_be_published(tmp_path: Path) -> None:
    publish(scores_of([outcome("", "none", 1, kind="no_effect", size=None)]), tmp_path)
    assert "| no effect" in (tmp_path / "table.md").read_text()


def test_sizes_from_which_on_an_effect_is_found(scores: dict[str, Any]) -> None:
    rows = tables(scores)["per_effect"].rows.set_index("effect")
    assert rows.loc["hysteresis", "rich: found from"] == 1.0
    assert rows.loc["creep", "rich: found from"] == 4.0
    assert pd.isna(rows.loc["creep", "rich: named from"])


def test_the_page_leads_with_the_worst_class(scores: dict[str, Any]) -> None:
    page = document(scores, ORIGIN)
    lead = page.split("##")[0]
    assert "**creep**: right in 70 % of 10 cases" in lead
    assert "taken for `leak`" in lead
    assert "`0123abcd`" in page
    assert "seed: 7" in page


def test_the_numbers_of_the_page_are_those_of_the_scores(scores: dict[str, Any]) -> None:
    changed = copy.deepcopy(scores)
    rate = changed["effects"][0]["rates"][changed["effects"][0]["worst"]]
    rate["value"] = 0.123
    changed["marks"][0]["estimate"]["value"] = 0.4567
    page = document(changed, ORIGIN)
    assert "right in 12 % of 10 cases" in page
    assert "| 0.457 |" in page
    assert "70 %" not in page.split("##")[0]


def test_the_page_parts_the_claims_by_kind_of_answer(scores: dict[str, Any]) -> None:
    (claims,) = scores["claims"]
    page = document(scores, ORIGIN)
    row = next(line for line in page.splitlines() if line.startswith("| one cause |"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    counts = [claims["answers"], claims["claims"], claims["close"]["n"]]
    assert cells[1:4] == [str(count) for count in counts]
    assert cells[4] == f"{claims['close']['value']:.3f}"


def test_the_command_copies_the_results_beside_the_page(
    scores: dict[str, Any], tmp_path: Path
) -> None:
    results, documents = tmp_path / "results", tmp_path / "docs"
    results.mkdir()
    (results / "scores.json").write_text(json.dumps(scores))
    publish(scores, results)
    assert main([str(results), str(documents), "--command", "snakemake blind"]) == 0
    page = (documents / "blind.md").read_text()
    links = {part.split(")")[0] for part in page.split("](")[1:]}
    assert len(links) == 7
    for link in links:
        assert (documents / link).is_file(), link
    assert "`snakemake blind`" in page


def test_a_folder_without_scores_is_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main([str(tmp_path), str(tmp_path / "docs"), "--command", "x"])
    assert left.value.code == 2
    assert "scores.json" in capsys.readouterr().err
    assert not (tmp_path / "docs").exists()


def test_every_run_stays_on_the_page(scores: dict[str, Any], tmp_path: Path) -> None:
    results, documents = tmp_path / "results", tmp_path / "docs"
    results.mkdir()
    for seed in (7, 8, 8):
        told = scores | {"benchmark": {"seed": seed}}
        (results / "scores.json").write_text(json.dumps(told))
        publish(told, results)
        assert main([str(results), str(documents), "--command", "snakemake blind"]) == 0
    page = (documents / "blind.md").read_text()
    assert "| mark | goal | seed 7 | seed 8 |\n" in page
    history = read_history(documents / "blind" / "history.csv")
    assert len(history) == 2 * len(scores["marks"])
    missed = next(mark for mark in history if mark.reached == "no")
    assert f"| {missed.mark} | {missed.goal} | **{missed.value}** | **{missed.value}** |" in page
    reached = sum(mark["reached"] is True for mark in scores["marks"])
    judged = sum(mark["reached"] is not None for mark in scores["marks"])
    assert f"| marks reached | | {reached} of {judged} | {reached} of {judged} |" in page


def test_history_is_read_as_it_was_written(tmp_path: Path) -> None:
    runs = [
        Mark(1, "abc", 340, "found, or not", "≥ 0.95", "0.955", 44, "yes"),
        Mark(2, "abc", 340, "found, or not", "≥ 0.95", "", 0, ""),
    ]
    path = tmp_path / "history.csv"
    assert read_history(path) == []
    path.write_text(written(runs), encoding="utf-8")
    assert read_history(path) == runs
    again = with_run(runs, [Mark(1, "abc", 340, "found, or not", "≥ 0.95", "0.9", 44, "no")])
    assert [mark.seed for mark in again] == [2, 1]
    assert "| found, or not | ≥ 0.95 | – | **0.9** |" in table(again)


@pytest.mark.parametrize(("text", "where"), [("seed,commit\n1,abc\n", "line 1"), (None, "line 2")])
def test_a_damaged_history_is_bad_input(tmp_path: Path, text: str | None, where: str) -> None:
    path = tmp_path / "history.csv"
    whole = written([Mark(1, "abc", 340, "found", "≥ 0.95", "0.955", 44, "yes")])
    path.write_text(text or whole.replace("340", "many"), encoding="utf-8")
    with pytest.raises(BadInput, match=f"history.csv: {where}: expected"):
        read_history(path)
