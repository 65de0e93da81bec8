"""One writer for every table: CSV, LaTeX (booktabs) and Markdown from the same rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from spa_fo.atomic import write_text

FORMATS = ("csv", "tex", "md")

# A cell longer than this wraps in LaTeX.
_SENTENCE = 60

# What LaTeX would take for markup, and the signs its default fonts lack.
_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "°": r"\ensuremath{^\circ}",
    "±": r"\ensuremath{\pm}",
    "≤": r"\ensuremath{\leq}",
    "≥": r"\ensuremath{\geq}",
    "−": r"\ensuremath{-}",
    "×": r"\ensuremath{\times}",
    "→": r"\ensuremath{\rightarrow}",
    "σ": r"\ensuremath{\sigma}",
    "ζ": r"\ensuremath{\zeta}",
    "ω": r"\ensuremath{\omega}",
    "θ": r"\ensuremath{\theta}",
    "α": r"\ensuremath{\alpha}",
    "β": r"\ensuremath{\beta}",
    "Δ": r"\ensuremath{\Delta}",
    "²": r"\ensuremath{^2}",
    "³": r"\ensuremath{^3}",
    "∞": r"\ensuremath{\infty}",
    "√": r"\ensuremath{\surd}",
    "–": "--",
    "—": "---",
}


@dataclass(frozen=True)
class Table:
    """A table as people read it.

    Attributes
    ----------
    rows : pandas.DataFrame
        The data, one column a quantity, numbers as numbers.
    caption : str
        What the table shows.
    provenance : str
        Whether the data are measured or synthetic, and from where.
    decimals : Mapping[str, str]
        Column name to format specification, for example ``{"rms_deg": ".2f"}``; it applies to
        Markdown and LaTeX. CSV keeps every digit.
    """

    rows: pd.DataFrame
    caption: str
    provenance: str
    decimals: Mapping[str, str] = field(default_factory=dict)


def write_table(table: Table, stem: Path | str) -> tuple[Path, ...]:
    """Write ``stem.csv``, ``stem.tex`` and ``stem.md``, each whole or not at all.

    Parameters
    ----------
    table : Table
        What to write.
    stem : Path or str
        The path without its suffix.

    Returns
    -------
    tuple of Path
        The three files, in the order of `FORMATS`.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    texts = {"csv": _csv(table), "tex": _latex(table), "md": _markdown(table)}
    paths = tuple(Path(f"{stem}.{suffix}") for suffix in FORMATS)
    for path, suffix in zip(paths, FORMATS, strict=True):
        write_text(path, texts[suffix])
    return paths


def _csv(table: Table) -> str:
    # The provenance stands in a column of its own: a comment line would break readers.
    rows = table.rows.assign(provenance=table.provenance)
    return str(rows.to_csv(index=False, lineterminator="\n"))


def _markdown(table: Table) -> str:
    """Write a table in Markdown, its caption above in bold."""
    return f"**{table.caption}**\n\n{markdown_body(table)}"


def markdown_body(table: Table) -> str:
    """Write a table in Markdown without its caption, its provenance below."""
    cells = _cells(table).map(lambda text: text.replace("|", "\\|"))
    body = cells.to_markdown(index=False, disable_numparse=True, colalign=_alignment(table))
    return f"{body}\n\n_{table.provenance}_\n"


def _latex(table: Table) -> str:
    cells = _cells(table).map(_escape)
    columns = "".join(_latex_columns(table, cells))
    lines = [
        r"\begin{table}",
        r"\centering\footnotesize",
        rf"\caption{{{_escape(table.caption)} ({_escape(table.provenance)})}}",
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        " & ".join(_escape(str(name)) for name in cells.columns) + r" \\",
        r"\midrule",
        *(" & ".join(row) + r" \\" for row in cells.itertuples(index=False, name=None)),
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _latex_columns(table: Table, cells: pd.DataFrame) -> list[str]:
    """Return a column type each; columns of sentences share most of the line and wrap."""
    long = [int(cells[name].str.len().max()) > _SENTENCE for name in cells.columns]
    width = 0.85 / max(sum(long), 1)
    return [
        rf"p{{{width:.2f}\linewidth}}" if wraps else "r" if side == "right" else "l"
        for wraps, side in zip(long, _alignment(table), strict=True)
    ]


def _cells(table: Table) -> pd.DataFrame:
    """Every cell as the text a person reads; a missing value is a dash."""
    columns = {
        str(name): [_cell(value, table.decimals.get(str(name), "")) for value in table.rows[name]]
        for name in table.rows.columns
    }
    return pd.DataFrame(columns, dtype=object)


def _cell(value: object, decimals: str) -> str:
    if isinstance(value, str):
        return value
    if value is None or value != value:
        return "–"
    return format(value, decimals)


def _alignment(table: Table) -> list[str]:
    return [
        "right" if pd.api.types.is_numeric_dtype(table.rows[name]) else "left"
        for name in table.rows.columns
    ]


def _escape(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)
