"""The report: one file, complete, in order, asking for nothing from elsewhere, and readable."""

from __future__ import annotations

import base64
import html
import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from browser import CHROMIUM, DESKTOP, PHONE, Page, address, browser
from pages import Addresses, words
from reduced_workflow import REDUCED, ROOT, snakemake
from spa_fo.validation import load_yaml

pytestmark = pytest.mark.workflow

CONTENTS = load_yaml(ROOT / "workflow" / "report" / "contents.yaml")
STYLE = ROOT / "workflow" / "report" / "report.css"
# A proxy that nobody listens on: whoever asks the network fails.
NO_NETWORK = dict.fromkeys(
    ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9"
)


def make_report(folder: Path) -> Path:
    path = folder / "report.html"
    options = ("--report", str(path), "--report-stylesheet", str(STYLE))
    run = snakemake(folder, *options, environment=NO_NETWORK)
    assert run.returncode == 0, run.stdout + run.stderr
    return path


@pytest.fixture(scope="module")
def report(finished: Path) -> Path:
    return make_report(finished)


@pytest.fixture(scope="module")
def shown(report: Path) -> dict[str, Any]:
    """What the report holds, by its path."""
    results: dict[str, Any] = value_of("results", report)
    return results


def value_of(name: str, report: Path) -> Any:
    """A variable that the report's page begins with."""
    match = re.search(rf"<script id=[^>]+>\s*var {name} = (.*);$", report.read_text(), re.MULTILINE)
    assert match
    return json.loads(match[1])


def test_the_report_loads_nothing_but_itself(report: Path, shown: dict[str, Any]) -> None:
    pages = [report.read_text()]
    for result in shown.values():
        if result["mime_type"] == "text/html":
            pages.append(base64.b64decode(result["data_uri"].split("base64,")[1]).decode())
    assert len(pages) > 1
    loaded = [address for page in pages for address in Addresses(page).loaded]
    assert [address for address in loaded if not address.startswith("data:")] == []


def test_every_figure_and_table_is_shown(finished: Path, shown: dict[str, Any]) -> None:
    figures = {path.relative_to(finished).as_posix() for path in finished.rglob("results/**/*.png")}
    tables = {
        f"results/pages/tables/{path.stem}.html"
        for path in (finished / "results" / "tables").glob("*.csv")
    }
    texts = {
        f"results/pages/{material}/{page}.html"
        for material in REDUCED["materials"]
        for page in ("logs", "fit", "verdict")
    } | {"results/pages/fx_pro/changed.html"}
    assert len(figures) >= 9
    assert len(tables) >= 6
    assert set(shown) == figures | tables | texts


def test_every_result_has_words_of_its_own_and_says_where_its_data_come_from(
    shown: dict[str, Any],
) -> None:
    captions: dict[str, str] = {}
    for path, result in shown.items():
        said = words(result["caption"])
        caption, _, origin = said.partition("synthetic data")
        assert len(caption.split()) > 8, f"{path} has no caption"
        assert "virtual rig" in origin
        assert "{" not in said
        item = Path(path).stem + Path(path).suffix
        assert captions.setdefault(caption, item) == item


def test_the_questions_stand_in_the_order_a_reader_asks(finished: Path, report: Path) -> None:
    categories = value_of("categories", report)
    assert sorted(categories) == list(CONTENTS)
    front = words(value_of("workflow_desc", report))
    places = [front.index(question) for question in CONTENTS]
    assert places == sorted(places)
    for question, titles in CONTENTS.items():
        stems = {Path(path).stem for group in categories[question].values() for path in group}
        # Laws are drawn where a cause is unknown.
        drawn = {path.stem for path in (finished / "results").rglob("laws.png")}
        assert stems == set(titles) - ({"laws"} - drawn)


def test_the_front_page_answers_with_the_numbers_of_this_run(finished: Path, report: Path) -> None:
    front = words(value_of("workflow_desc", report))
    for material in REDUCED["materials"]:
        results = finished / "results" / material
        gap = json.loads((results / "diagnosis" / "diagnosis.json").read_text())["gap"]
        assert f"RMS error of the model is {gap['rmse_deg']:.2f}°" in front
        for error in json.loads((results / "fit.json").read_text())["errors"]:
            assert f"{error['experiment']} {error['rms_deg']:.2f}°" in front
    changed = finished / "results" / "fx_pro" / "changed" / "comparison.json"
    for sentence in json.loads(changed.read_text())["answer"]:
        assert html.escape(sentence) in front
    audit = (finished / "results" / "tables" / "audit.csv").read_text().splitlines()
    assert f"Of {len(audit) - 1} statements" in front


def test_a_figure_without_a_place_in_the_contents_is_refused(
    finished: Path, tmp_path: Path
) -> None:
    shutil.copytree(finished, tmp_path, symlinks=True, dirs_exist_ok=True)
    figures = tmp_path / "results" / "fx_pro" / "figures"
    shutil.copy(figures / "ablation.png", figures / "novelty.png")
    run = snakemake(tmp_path, "--report", "report.html")
    assert run.returncode != 0
    assert "'novelty' has no place in workflow/report/contents.yaml" in run.stdout + run.stderr


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    if CHROMIUM is None:
        pytest.skip("needs chromium (make browser)")
    with browser() as opened:
        yield opened


def inked(png: bytes) -> float:
    """Share of a picture that is not of its commonest colour."""
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("L")).ravel()
    return 1.0 - float(np.bincount(pixels).max()) / pixels.size


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_a_browser_shows_the_report(
    page: Page, report: Path, shown: dict[str, Any], size: tuple[int, int]
) -> None:
    page.open(address(report), size)
    assert "from raw logs to why the model is wrong" in page.run("document.body.innerText")
    assert inked(page.screenshot()) > 0.05
    links = page.run("document.querySelectorAll('.contents a').length")
    assert links == len(shown)
    opened = set()
    for place in range(links):
        page.run("app.setView({navbarMode: 'menu', content: 'rulegraph'})")
        page.settle()
        page.run(f"document.querySelectorAll('.contents a')[{place}].click()")
        page.settle()
        path = page.run("app.state.resultPath")
        opened.add(path)
        seen = page.run("document.querySelector('nav').innerText")
        caption = words(shown[path]["caption"]).split()
        assert " ".join(caption[:6]) in " ".join(seen.split())
        if path.endswith(".png"):
            assert page.run("document.querySelector('img[src^=\"data:image/png\"]').naturalWidth")
        else:
            assert page.run("document.querySelector('iframe').clientHeight") > 300
        assert page.run("document.documentElement.scrollWidth") <= size[0]
    assert opened == set(shown)
    assert page.errors == []
    assert {request.split(":")[0] for request in page.requests} == {"file", "data"}
