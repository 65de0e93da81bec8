"""The page about the audit of the paper: ``python -m spa_fo.report.audit_document --help``.

The table is the one that the workflow computes; none of it is typed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from spa_fo.atomic import write_text
from spa_fo.edge import bad_input_exits
from spa_fo.errors import BadInput
from spa_fo.plant import paper

_HEAD = """\
# Audit of the paper

Yang and Tomizuka's paper ([{arxiv}]({address})) held against itself and against what is computed
here, statement by statement. Lines on the paper's own numbers follow from what it prints; those
that speak of particles, seeds or a Fisher matrix come from this run's identification on stand-in
data, as the paper's measurements were never published. Everything in the table is computed
(`src/spa_fo/report/audit.py`); `make audit` writes this page again, and `make reproduce` the table
alone, in `results/tables/`."""


def document(table: str) -> str:
    """Write the page.

    Parameters
    ----------
    table : str
        The audit as Markdown, as the workflow left it in ``tables/audit.md``.

    Returns
    -------
    str
        Markdown.
    """
    number = paper.ARXIV.removeprefix("arXiv:")
    head = _HEAD.format(arxiv=paper.ARXIV, address=f"https://arxiv.org/abs/{number}")
    return f"{head}\n\n{table.strip()}\n"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description="Write the page about the audit of the paper.",
        epilog="example: python -m spa_fo.report.audit_document results docs",
    )
    parser.add_argument("results", metavar="RESULTS", type=Path, help="the workflow's results")
    parser.add_argument("folder", metavar="DOCS", type=Path, help="gets audit.md")
    options = parser.parse_args()
    with bad_input_exits():
        path = options.results / "tables" / "audit.md"
        try:
            table = path.read_text(encoding="utf-8")
        except OSError as error:
            expected = f"cannot be read ({error.strerror}); expected the audit: make reproduce"
            raise BadInput(path, expected) from error
        write_text(options.folder / "audit.md", document(table))


if __name__ == "__main__":
    main()
