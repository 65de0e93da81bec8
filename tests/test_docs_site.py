"""The documentation site: builds without a warning, has no dead link, and is readable."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote, urlsplit

import pytest

from browser import CHROMIUM, DESKTOP, PHONE, Page, address, browser
from pages import Addresses, words
from reduced_workflow import ROOT
from spa_fo.cli import command_line


@pytest.fixture(scope="module")
def site(examples: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


@pytest.fixture(scope="module")
def found(site: Path) -> dict[Path, Addresses]:
    """The addresses on every page."""
    return {path: Addresses(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}


def is_outside(link: str) -> bool:
    return bool(urlsplit(link).scheme or urlsplit(link).netloc)


def test_every_page_of_the_docs_is_there(site: Path) -> None:
    made = {path.relative_to(site).with_suffix("").as_posix() for path in site.rglob("*.html")}
    written = {
        path.relative_to(ROOT / "docs").with_suffix("").as_posix()
        for path in (ROOT / "docs").rglob("*.md")
    }
    parts = {"blind/note", "blind/other_rigs_told"}  # of docs/blind.md and docs/other_rigs.md
    assert written - parts | {"commands"} <= made


def test_no_link_is_dead(site: Path, found: dict[Path, Addresses]) -> None:
    dead = []
    for path, page in found.items():
        for link in (*page.loaded, *page.linked):
            if is_outside(link) or not link:
                continue
            parts = urlsplit(link)
            # The page that stands in for any other is at home at the site's root.
            base = site if path.name == "404.html" else path.parent
            target = base / unquote(parts.path).lstrip("/") if parts.path else path
            if target.is_dir():
                target = target / "index.html"
            if not target.is_file():
                dead.append((path.relative_to(site).as_posix(), link))
            elif parts.fragment and target.suffix == ".html":
                anchors = found[target.resolve()].anchors | {"__search", "__drawer"}
                if unquote(parts.fragment) not in anchors:
                    dead.append((path.relative_to(site).as_posix(), link))
    assert dead == []


def test_links_to_elsewhere_are_complete(found: dict[Path, Addresses]) -> None:
    outside = {link for page in found.values() for link in page.linked if is_outside(link)}
    assert any(link.startswith("https://doi.org/10.") for link in outside)
    assert [link for link in outside if urlsplit(link).scheme not in ("https", "mailto")] == []
    assert [link for link in outside if not urlsplit(link).path.strip("/")] == []


def test_the_site_loads_nothing_from_elsewhere(site: Path, found: dict[Path, Addresses]) -> None:
    for page in found.values():
        assert [link for link in page.loaded if is_outside(link) and link[:5] != "data:"] == []
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert "url(http" not in styles
    assert "@import" not in styles


def test_formulas_are_drawn_by_the_browser_itself(site: Path) -> None:
    page = (site / "maths.html").read_text(encoding="utf-8")
    assert page.count("<math ") >= 40
    assert "arithmatex" not in page


def test_the_reference_has_every_command_and_option(site: Path) -> None:
    text = words((site / "commands.html").read_text(encoding="utf-8"))
    (commands,) = [action for action in command_line()._actions if action.choices]
    assert commands.choices
    for name, parser in dict(commands.choices).items():
        assert f"usage: spa-fo {name}" in text
        for action in parser._actions:
            for option in action.option_strings:
                assert option in text, (name, option)


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    if CHROMIUM is None:
        pytest.skip("needs chromium (make browser)")
    with browser() as opened:
        yield opened


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_no_page_is_wider_than_the_window(page: Page, site: Path, size: tuple[int, int]) -> None:
    for path in sorted([*site.glob("*.html"), *site.glob("examples/*.html")]):
        page.open(address(path), size)
        width = page.run("document.documentElement.scrollWidth")
        assert width <= size[0], (path.name, width)
        title = page.run("document.querySelector('h1').innerText")
        assert title.strip("¶ \n") in words(path.read_text(encoding="utf-8"))
    assert page.errors == []
    assert {request.split(":")[0] for request in page.requests} <= {"file", "data", "blob"}


def test_the_search_works_from_a_disk(page: Page, site: Path) -> None:
    page.open(address(site / "index.html"))
    page.run(
        "(() => { const field = document.querySelector('.md-search__input'); field.focus();"
        " field.value = 'Duhem'; field.dispatchEvent(new Event('input', {bubbles: true}));"
        " field.dispatchEvent(new Event('keyup', {bubbles: true})); })()"
    )
    answer = (
        "new Promise(done => { const look = () => {"
        " const text = document.querySelector('.md-search-result').innerText;"
        " /matching/.test(text) ? done(text) : setTimeout(look, 50); };"
        " look(); setTimeout(() => done('nothing'), 10000); })"
    )
    assert "The mathematics" in page.run(answer)
