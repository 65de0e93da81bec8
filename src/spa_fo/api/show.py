"""How the objects print themselves: text tables, and HTML for notebooks."""

from __future__ import annotations

import html
from collections.abc import Sequence

from tabulate import tabulate

from spa_fo.plant.estimates import Estimate

# Colours of the page around it show through, so that dark notebooks stay readable.
_FRAME = (
    "border:1px solid rgba(128,128,128,.35);border-radius:6px;padding:.6em 1em;max-width:60em;"
    "font-family:system-ui,sans-serif;font-size:14px;line-height:1.45"
)
_MUTED = "opacity:.72;font-size:90%"
_CELL = "text-align:left;vertical-align:top;padding:.15em .9em .15em 0"
_LINE = "border-top:1px solid rgba(128,128,128,.35)"

_SYMBOLS = {"alpha2": "α₂", "alpha1": "α₁", "a1": "a₁", "a0": "a₀", "b0": "b₀", "K": "K = b₀/a₀"}
_UNITS = {
    "s^(alpha1-alpha2)": "s^(α₁−α₂)",
    "s^-alpha2": "s^−α₂",
    "rad s^-alpha2": "rad s^−α₂",
    "rad": "rad",
    "": "",
}
COLUMNS = ("parameter", "value ± standard error", "interval", "unit", "determined")


def estimate_rows(estimates: Sequence[Estimate]) -> list[list[str]]:
    """Return a row of text for each estimate, in the order of `COLUMNS`."""
    words = {True: "yes", False: "no", None: ""}
    return [
        [
            _SYMBOLS[one.name],
            one.text(),
            one.interval_text(),
            _UNITS[one.unit],
            words[one.determined],
        ]
        for one in estimates
    ]


def text_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of text; columns that are empty throughout are left away."""
    kept = _filled(columns, rows)
    return str(
        tabulate(
            [[row[i] for i in kept] for row in rows],
            [columns[i] for i in kept],
            tablefmt="simple",
            disable_numparse=True,
        )
    )


def card(
    title: str,
    lines: Sequence[str],
    columns: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
    notes: Sequence[str] = (),
    muted: str = "",
) -> str:
    """Return a block of HTML: a title, lines, a table, notes, a line in small.

    Everything is escaped here.
    """
    parts = [f'<div style="{_FRAME}"><strong>{html.escape(title)}</strong>']
    if muted:
        parts.append(f'<div style="{_MUTED}">{html.escape(muted)}</div>')
    parts += [f"<div>{html.escape(line)}</div>" for line in lines]
    if rows:
        parts.append(_html_table(columns, rows))
    if notes:
        items = "".join(f"<li>{html.escape(note)}</li>" for note in notes)
        parts.append(f'<ul style="margin:.4em 0 0;padding-left:1.2em">{items}</ul>')
    return "".join([*parts, "</div>"])


def _html_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    kept = _filled(columns, rows)
    heads = "".join(f'<th style="{_CELL}">{html.escape(columns[i])}</th>' for i in kept)
    body = "".join(
        f'<tr style="{_LINE};background:none">'
        + "".join(f'<td style="{_CELL}">{html.escape(row[i])}</td>' for i in kept)
        + "</tr>"
        for row in rows
    )
    return (
        '<div style="overflow-x:auto">'
        '<table style="border-collapse:collapse;margin:.5em 0;font-size:inherit">'
        f"<thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _filled(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    return [i for i in range(len(columns)) if any(row[i] for row in rows)]
