"""The sweep of the diagnosis's numbers: what is decided anew, what moves, what the page lists."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spa_fo.gap
from spa_fo.gap.decide import part
from spa_fo.gap.settings import SETTINGS

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"
CAUSE = ("cause", frozenset({frozenset({"creep"})}))
NONE = ("no_gap", frozenset())
READ_AFTER_ALL_IS_FITTED = {
    "causes.py",
    "part.py",
    "weigh.py",
    "verdict.py",
    "claimed.py",
    "against_laws.py",
    "diagnose.py",
    "laws.py",
    "missing.py",
}


@pytest.fixture(scope="module")
def sweep() -> Iterator[Any]:
    """The benchmark as a module; its neighbours are found as when it is run."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        import settings_sweep

        yield settings_sweep
    finally:
        sys.path.remove(str(BENCHMARKS))
        for name in ("settings_sweep", "real_data"):
            sys.modules.pop(name, None)


def read_in(path: Path) -> set[str]:
    """Names of the settings that a file reads, by their own name or by a shorter one."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    homes = {"SETTINGS"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            for names, values in (
                (getattr(target, "elts", [target]), getattr(node.value, "elts", [node.value]))
                for target in node.targets
            ):
                homes |= {
                    name.id
                    for name, value in zip(names, values, strict=False)
                    if isinstance(value, ast.Name) and value.id == "SETTINGS"
                }
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in homes
    }


def test_what_is_decided_anew_is_read_after_all_is_fitted(sweep: Any) -> None:
    readers: dict[str, set[str]] = {each.name: set() for each in fields(SETTINGS)}
    for path in Path(spa_fo.gap.__file__).parent.rglob("*.py"):
        for name in read_in(path) & set(readers):
            readers[name].add(path.name)
    assert all(readers.values()), "every number is read"
    late = {name for name, paths in readers.items() if paths <= READ_AFTER_ALL_IS_FITTED}
    assert set(sweep.DECIDED) == late


def test_another_number_is_there_before_the_modules_that_read_it() -> None:
    code = (
        "import inspect, json, one_verdict as v; s = v.load_settings();"
        "v.put(s, {'search_share': 0.5, 'single': 0.25, 'coloured_deg': 0.5});"
        "from spa_fo.gap.decide import part; from spa_fo.gap.noise import coloured;"
        "from spa_fo.gap.search import fitted; from spa_fo.gap.settings import SETTINGS;"
        "default = inspect.signature(fitted.fit).parameters['share'].default;"
        "print(json.dumps([default, part.stands_in(), coloured.TYPICAL_DEG, s is SETTINGS]))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=BENCHMARKS, capture_output=True, text=True, check=True
    )
    share, stands_in, typical, same = json.loads(run.stdout)
    assert (share, typical, same) == (0.5, 0.5, True)
    assert stands_in == pytest.approx(part.stands_in() + np.log(0.25 / SETTINGS.single))


def test_probabilities_are_doubled_to_a_bound(sweep: Any) -> None:
    assert sweep.varied("covered", 2.0) == sweep.HIGHEST
    assert sweep.varied("covered", 0.5) == SETTINGS.covered / 2.0
    assert sweep.varied("level_alone", 2.0) == 2.0 * SETTINGS.level_alone


def test_only_opened_cases_of_the_rig_for_learning_are_taken(sweep: Any, tmp_path: Path) -> None:
    labels = {"case_1": {"case": "case_1"}, "case_2": {"rig": "virtual_rig"}}
    labels |= {"case_3": {"rig": "second_rig"}}
    for name in (*labels, "case_4"):
        (tmp_path / "cases" / "batch_0" / name / "campaign").mkdir(parents=True)
    for name, label in labels.items():
        path = tmp_path / "labels" / "batch_0" / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(label), encoding="utf-8")
    found = [case.name for case in sweep.opened([tmp_path])]
    assert found == ["case_1", "case_2"]


def test_cases_are_spread_evenly(sweep: Any) -> None:
    assert sweep.evenly(range(10), 2) == [2, 7]
    assert sweep.evenly(range(3), 5) == [0, 1, 2]


def test_the_page_lists_every_number_and_what_moves_most_first(sweep: Any) -> None:
    base = {"a": CAUSE, "b": NONE}
    others = {}
    for name, *_ in SETTINGS.listed():
        few = base if name in sweep.DECIDED else {"a": CAUSE}
        others |= {(name, sweep.varied(name, factor)): dict(few) for factor in sweep.FACTORS}
    others["least", sweep.varied("least", 2.0)]["b"] = CAUSE
    others["temper", sweep.varied("temper", 0.5)]["a"] = None
    text = sweep.document(base, others, errors=1)
    rows = re.findall(r"^\| `(\w+)` +\| (.+) \|$", text, re.MULTILINE)
    cells = {name: [cell.strip() for cell in row.split("|")] for name, row in rows}
    assert [name for name, _ in rows][:2] == ["temper", "least"]
    assert cells.keys() == {name for name, *_ in SETTINGS.listed()}
    assert cells["temper"][-4:] == ["1", "0", "1", "fitted"]
    assert cells["least"][-4:] == ["0", "1", "2", "decided"]
    assert cells["none"][:3] == ["probability", "learned", f"{SETTINGS.none:g}"]
    assert "2 opened cases" in text
    assert "1 `cause`, 1 `no_gap`" in text
    assert "1 more cases end in one" in text
