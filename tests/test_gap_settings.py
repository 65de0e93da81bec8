"""The numbers that a verdict depends on, and that the rooms know no effect by name."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest

import spa_fo.gap
from spa_fo.gap.settings import SETTINGS, Settings
from spa_fo.plant.effects.library import IDS

MOST = 40


def test_there_are_few_and_each_says_where_it_comes_from() -> None:
    listed = list(SETTINGS.listed())
    assert len(listed) == len(fields(Settings)) <= MOST
    assert len({name for name, *_ in listed}) == len(listed)
    for name, value, unit, origin, reason in listed:
        assert isinstance(value, float), name
        assert unit.strip(), name
        assert origin in ("derived", "learned", "measured", "assumed"), name
        assert len(reason.split()) > 1, name


def words(tree: ast.AST) -> Iterator[str]:
    """Yield what a source says beside its comments and sentences: whole strings and names."""
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str() as text):
                yield text
            case ast.Name(id=name) | ast.arg(arg=name) | ast.keyword(arg=str() as name):
                yield name
            case ast.Attribute(attr=name):
                yield name


@pytest.mark.parametrize(
    ("source", "named"),
    [("x = 'creep'", True), ("x.creep", True), ("# creep", False), ("'creep, or play'", False)],
)
def test_a_name_is_told_from_a_sentence(source: str, named: bool) -> None:
    assert ("creep" in set(words(ast.parse(source)))) is named


def test_no_room_knows_an_effect_by_name() -> None:
    folder = Path(spa_fo.gap.__file__).parent
    found = {
        path.name: sorted(named)
        for path in folder.rglob("*.py")
        if (named := set(words(ast.parse(path.read_text(encoding="utf-8")))) & set(IDS))
    }
    assert found == {}
    assert (folder / "search" / "drive.py").is_file()
