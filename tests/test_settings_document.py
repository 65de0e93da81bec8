"""The page of numbers says what the settings say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

from spa_fo.gap.settings import SETTINGS, Origin
from spa_fo.report.settings_document import main, page

ROOT = Path(__file__).resolve().parent.parent


def test_the_page_of_numbers_is_made_from_the_settings() -> None:
    written = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
    swept = (ROOT / "docs" / "settings_sweep.md").is_file()
    assert written == page(swept=swept), "python -m spa_fo.report.settings_document docs"


def test_every_number_is_listed_with_its_origin_and_reason() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| (.+) \|$", page(), re.MULTILINE))
    listed = list(SETTINGS.listed())
    assert list(rows) == [name for name, *_ in listed]
    for name, value, _, origin, reason in listed:
        cells = [cell.strip() for cell in rows[name].split(" | ")]
        assert float(cells[0]) == value
        assert cells[-2:] == [origin, reason]
        assert origin in get_args(Origin)
        assert reason


def test_the_opening_counts_the_origins() -> None:
    head = page().split("| name |")[0]
    ((total, counts),) = re.findall(r"There are (\d+) of them: (.+)\.", head)
    found = re.findall(r"(\d+) (\w+)", counts)
    assert [kind for _, kind in found] == list(get_args(Origin))
    assert sum(int(n) for n, _ in found) == int(total) == len(list(SETTINGS.listed()))


def test_the_command_writes_the_page(tmp_path: Path) -> None:
    assert main([str(tmp_path)]) == 0
    assert (tmp_path / "settings.md").read_text(encoding="utf-8") == page()
    (tmp_path / "settings_sweep.md").touch()
    assert main([str(tmp_path)]) == 0
    assert "](settings_sweep.md)" in (tmp_path / "settings.md").read_text(encoding="utf-8")


def test_the_page_on_diagnoses_names_settings_and_their_origins_as_they_are() -> None:
    """A list of links; behind it, perhaps, the origin that is claimed of all of them."""
    text = " ".join((ROOT / "docs" / "diagnosis.md").read_text(encoding="utf-8").split())
    origins = {name: origin for name, _, _, origin, _ in SETTINGS.listed()}
    link = r"\[`(\w+)`\]\(settings\.md\)"
    assert set(re.findall(link, text)) <= set(origins)
    claims = re.findall(rf"((?:{link},? ?)+)\(?(?:all )?(assumed|learned)", text)
    claimed = {(name, origin) for links, _, origin in claims for name in re.findall(link, links)}
    assert len(claimed) > 8
    assert claimed <= set(origins.items())
