"""Pages of the report that are text: what the logs hold, fit, verdict, and every table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from spa_fo.atomic import write_text
from spa_fo.report.html_page import html_page
from spa_fo.report.published import MeasuredMaterial, PublishedMaterial
from spa_fo.report.tables import Table, markdown_body

ALL = "tables"  # folder of what is made of all materials together
_MOST_ROWS = 500  # Chromium shows no more than 2 MB in a frame


def write_pages(
    materials: Sequence[MeasuredMaterial], tables: Mapping[str, Table], folder: Path
) -> None:
    """Write the pages: ``<material>/<page>.html`` and ``tables/<table>.html``.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    for material in materials:
        for name, page in _material_pages(material):
            write_text(folder / material.name / f"{name}.html", page)
    for name, table in tables.items():
        write_text(folder / ALL / f"{name}.html", _table_page(name, table))


def _material_pages(material: MeasuredMaterial) -> Iterator[tuple[str, str]]:
    if isinstance(material, PublishedMaterial):
        yield from _identified_pages(material)
    if material.changed is not None:
        page = f"{material.changed_page.strip()}\n\n_{material.provenance}_"
        yield "changed", html_page(f"What changed in {material.name}", page)


def _identified_pages(material: PublishedMaterial) -> Iterator[tuple[str, str]]:
    yield "logs", html_page(f"The logs of {material.name}", material.parse_report)
    fit = f"```\n{material.fit_report.strip()}\n```\n\n_{material.provenance}_"
    yield "fit", html_page(f"The model of {material.name}", fit)
    verdict = f"{material.diagnosis_page.strip()}\n\n_{material.provenance}_"
    yield "verdict", html_page(f"Diagnosis of {material.name}", verdict)


def _table_page(name: str, table: Table) -> str:
    shown = replace(table, rows=table.rows.head(_MOST_ROWS))
    cut = len(table.rows) - len(shown.rows)
    note = f"\n\nThe last {cut} rows are in tables/{name}.csv alone." if cut else ""
    return html_page(table.caption, markdown_body(shown) + note)
