"""Citation, licence, changelog and version say the same, and no source is missing."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import spa_fo
from spa_fo.report.references import entry, page

ROOT = Path(__file__).resolve().parent.parent
CITATION: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
SOURCES = {
    path: path.read_text(encoding="utf-8")
    for folder, pattern in (("src", "*.py"), ("docs", "*.md"), ("tests", "naive_*.py"))
    for path in sorted((ROOT / folder).rglob(pattern))
    if path.name != "references.md"
} | {ROOT / "README.md": (ROOT / "README.md").read_text(encoding="utf-8")}
TEXT = "\n".join(SOURCES.values())
# Laird and Ware (1982), Weideman & Trefethen 2007, von Neumann 1941, "Oustaloup et al., 2000".
AUTHOR_YEAR = re.compile(
    r"([A-Z][\w'-]+)(?:(?:,| and| &)\s+([A-Z][\w'-]+))*,?\s+\(?((?:1[89]|20)\d\d)\b"
)


def identifier(doi: str) -> str:
    """arXiv numbers its DOIs after its papers, which texts cite by number."""
    return doi.removeprefix("10.48550/arXiv.")


def cited() -> set[str]:
    # A parenthesis belongs to a DOI where the DOI opens it.
    dois = re.findall(r"doi(?:\.org/|:)\s*(10\.\d{4,}/(?:\([^\s()]*\)|[^\s,;()\]\"'`])+)", TEXT)
    return {doi.rstrip(".") for doi in dois} | set(re.findall(r"arXiv:(\d{4}\.\d{4,5})", TEXT))


def plain_day(value: object) -> str:
    return str(value)


def test_the_citation_file_keeps_to_its_published_schema() -> None:
    schema = json.loads((ROOT / "tests" / "cff" / "schema_1.2.0.json").read_text(encoding="utf-8"))
    document = json.loads(json.dumps(CITATION, default=plain_day))
    jsonschema.Draft7Validator(schema).validate(document)


def test_every_source_that_is_cited_is_in_the_citation_file() -> None:
    known = {identifier(source["doi"]) for source in CITATION["references"] if "doi" in source}
    assert cited() - known == set()


@pytest.mark.parametrize("source", CITATION["references"], ids=lambda source: source["title"][:40])
def test_every_source_in_the_citation_file_is_cited(source: dict[str, Any]) -> None:
    if "doi" in source and identifier(source["doi"]) in cited():
        return
    first = source["authors"][0]
    name = first.get("name") or first["family-names"]
    assert re.search(rf"{name}[^.]{{0,60}}{source['year']}", TEXT, re.DOTALL)


def test_every_author_and_year_in_the_text_is_a_source() -> None:
    known = {
        (author.get("family-names", "").split()[-1], source["year"])
        for source in CITATION["references"]
        for author in source["authors"]
        if "family-names" in author
    }
    others = {"January", "February", "March", "April", "May", "June", "July", "August"}
    others |= {"September", "October", "November", "December", "Press"}
    unknown = {
        match[0]
        for match in AUTHOR_YEAR.finditer(TEXT)
        if (match[1], int(match[3])) not in known and match[1] not in others
    }
    assert unknown == set()


def test_the_page_of_sources_is_made_from_the_citation_file() -> None:
    written = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")
    assert written == page(CITATION), "make references"


def test_a_source_is_one_line() -> None:
    source = {
        "notes": "Fits.",
        "authors": [{"family-names": "Laird", "given-names": "N."}, {"family-names": "Ware"}],
        "year": 1982,
        "title": "Models",
        "journal": "Biometrics",
        "volume": 38,
        "start": 963,
        "end": 974,
        "doi": "10.1/x",
    }
    assert entry(source) == (
        "**Fits.** Laird and Ware (1982), *Models*, Biometrics 38, 963–974, "
        "[doi:10.1/x](https://doi.org/10.1/x)"
    )


def test_one_version_and_one_licence() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert "version" in project["dynamic"]
    assert CITATION["version"] == spa_fo.__version__
    assert project["license"] == CITATION["license"] == "MIT"
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("MIT License")


def test_the_changelog_begins_with_this_version() -> None:
    lines = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    released = [line for line in lines if line.startswith("## ") and "Unreleased" not in line]
    assert released[0] == f"## [{spa_fo.__version__}] - {CITATION['date-released']}"
    versions = [tuple(map(int, re.findall(r"\d+", line)[:3])) for line in released]
    assert versions == sorted(versions, reverse=True)
