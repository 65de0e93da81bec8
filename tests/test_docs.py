"""Documentation that repeats what the code says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from spa_fo.plant.effects.library import LIBRARY, Effect

ROOT = Path(__file__).resolve().parent.parent
DOCS = sorted((ROOT / "docs").glob("*.md"))
_MOST_NAMES = 6


def rows() -> dict[str, list[str]]:
    """Rows of the library's table, by the effect's id."""
    text = (ROOT / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    found = {}
    for line in text.splitlines():
        match = re.match(r"\| `(\w+)` \|", line)
        if match:
            found[match[1]] = [cell.strip() for cell in line.strip("|").split("|")]
    return found


def parameters(effect: Effect) -> str:
    names = [f"`{parameter.name}`" for parameter in effect.parameters]
    return ", ".join(names) if len(names) <= _MOST_NAMES else f"{names[0]} … {names[-1]}"


def test_the_table_of_the_library_is_the_library() -> None:
    table = rows()
    assert list(table) == list(LIBRARY)
    for name, effect in LIBRARY.items():
        _, stage, form, listed = table[name]
        assert (stage, listed) == (effect.stage, parameters(effect))
        assert form


@pytest.mark.parametrize("page", [ROOT / "README.md", *DOCS], ids=lambda page: page.name)
def test_every_file_that_a_page_links_to_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    missing = [link for link in links if not (page.parent / link).exists()]
    assert not missing
