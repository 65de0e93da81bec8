"""The page of sources, from CITATION.cff: what the software is, and what its methods rest on.

``python -m spa_fo.report.references CITATION.cff docs/references.md`` writes it.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spa_fo.atomic import write_text
from spa_fo.edge import bad_input_exits
from spa_fo.validation import load_yaml

_HEAD = """\
# Sources

How to cite this software stands in `CITATION.cff`, which reference managers read:

> {authors} ({year}), *{title}*, version {version}.

Please cite the first source below with it: the paper whose model it is built around.

Each method names its source where it is written, in the code and on these pages. All of them:

"""


def page(citation: Mapping[str, Any]) -> str:
    """Return the page of sources in Markdown.

    Parameters
    ----------
    citation : Mapping
        The document of a CITATION.cff; the ``notes`` of a reference say what it is used for.
    """
    head = _HEAD.format(
        authors=_names(citation["authors"]),
        title=citation["title"],
        version=citation["version"],
        year=str(citation["date-released"])[:4],
    )
    return head + "".join(f"- {entry(source)}\n" for source in citation["references"])


def entry(source: Mapping[str, Any]) -> str:
    """Return one source in a line: what it is used for, authors, year, title, place, DOI."""
    where = source.get("journal") or source.get("collection-title")
    where = where or source.get("publisher", {}).get("name")
    place = " ".join(str(part) for part in (where, source.get("volume")) if part)
    pages = "–".join(str(source[key]) for key in ("start", "end") if key in source)
    parts = [
        f"**{source['notes']}** {_names(source['authors'])} ({source['year']})",
        f"*{source['title']}*",
        ", ".join(part for part in (place, pages) if part),
        f"[doi:{source['doi']}](https://doi.org/{source['doi']})" if "doi" in source else "",
    ]
    return ", ".join(part for part in parts if part)


def _names(authors: Sequence[Mapping[str, str]]) -> str:
    names = [author.get("name") or author["family-names"] for author in authors]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m spa_fo.report.references", description=__doc__)
    parser.add_argument("citation", type=Path, help="CITATION.cff")
    parser.add_argument("out", type=Path, help="the page to write")
    given = parser.parse_args(arguments)
    with bad_input_exits():
        write_text(given.out, page(load_yaml(given.citation)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
