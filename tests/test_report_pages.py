"""Pages of the report: Markdown and tables as HTML that stands alone."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from pages import Addresses, words
from spa_fo.report.audit_document import document
from spa_fo.report.html_page import html_page
from spa_fo.report.pages import write_pages
from spa_fo.report.tables import Table

TEXT = """\
Some **words**.

| name | value |
|:-----|------:|
| a<b  |     1 |

![what it shows](figure.png)

*what it shows*

## After it
"""


def table(rows: int) -> Table:
    return Table(
        pd.DataFrame({"x": [float(row) for row in range(rows)]}),
        "Errors & more",
        "synthetic data; virtual rig",
        {"x": ".1f"},
    )


def test_a_page_has_a_heading_its_table_and_no_picture() -> None:
    page = html_page("Logs <of> an arm", TEXT)
    assert "<title>Logs &lt;of&gt; an arm</title>" in page
    assert page.count("<h1") == 1
    assert '<div class="wide"><table>' in page
    assert "a&lt;b" in page
    assert "what it shows" not in page
    assert "<h2>After it</h2>" in page
    assert Addresses(page).loaded == []


def test_a_heading_of_its_own_is_kept() -> None:
    page = html_page("tab", "# Diagnosis of arm\n\nText.")
    assert page.count("<h1") == 1
    assert "<h1>Diagnosis of arm</h1>" in page
    assert "<title>tab</title>" in page


def test_a_table_says_what_it_shows_and_where_its_data_come_from(tmp_path: Path) -> None:
    write_pages([], {"errors": table(3)}, tmp_path)
    page = (tmp_path / "tables" / "errors.html").read_text(encoding="utf-8")
    text = words(page)
    assert "Errors &amp; more" in page
    assert "Errors & more" in text
    assert "2.0" in text
    assert "synthetic data; virtual rig" in text
    assert "last" not in text


def test_a_table_too_long_for_a_frame_says_what_is_left_out(tmp_path: Path) -> None:
    write_pages([], {"errors": table(507)}, tmp_path)
    text = words((tmp_path / "tables" / "errors.html").read_text(encoding="utf-8"))
    assert "499.0" in text
    assert "500.0" not in text
    assert "The last 7 rows are in tables/errors.csv alone." in text


def test_the_page_of_the_audit_holds_the_table_as_it_was_computed() -> None:
    page = document("**Audit**\n\n| where |\n|:--|\n| Eq. 15 |\n")
    assert page.startswith("# Audit of the paper\n")
    assert page.endswith("| Eq. 15 |\n")
    assert "https://arxiv.org/abs/2512.18213" in page
