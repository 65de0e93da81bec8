"""Many campaigns together: the table of them, and what the report opens with."""

from __future__ import annotations

import csv
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from pages import Addresses, words
from spa_fo.gap.diagnosis import Diagnosis, Gap
from spa_fo.report.headline import opening
from spa_fo.report.published import MeasuredMaterial, PublishedMaterial
from spa_fo.report.study import (
    MOST_OPENINGS,
    campaign_table,
    openings_html,
    openings_markdown,
    worst_first,
)
from spa_fo.report.summary import tables
from spa_fo.report.tables import write_table
from spa_fo.rig import Provenance
from test_diagnosis_report import AMBIGUOUS, NO_GAP, UNEXPLAINED, diagnosis

PNG = b"\x89PNG picture"


def published(name: str, found: Diagnosis, provenance: str = "synthetic") -> PublishedMaterial:
    given: dict[str, Any] = {field.name: None for field in fields(PublishedMaterial)}
    origin = Provenance(provenance, "virtual rig", "")  # type: ignore[arg-type]
    given |= {
        "name": name,
        "campaign": SimpleNamespace(name=name, material=f"rubber {name}", provenance=origin),
        "diagnosis": found.to_dict(),
        "opening_png": PNG,
        "alone": True,
    }
    return PublishedMaterial(**given)


FOUR = [
    published("fine", NO_GAP),
    published("creeps", diagnosis()),
    published("open", replace(AMBIGUOUS, gap=Gap(3.0, 0.5, True, 0.001))),
    published("odd", replace(UNEXPLAINED, gap=Gap(5.0, 0.5, True, 0.001)), "measured"),
]
MANY = [replace(FOUR[i % 4], name=f"study_{i:03d}") for i in range(30)]


def test_the_largest_gap_above_the_floor_comes_first() -> None:
    assert [one.name for one in worst_first(FOUR)] == ["odd", "open", "creeps", "fine"]
    noisy = published("noisy", replace(NO_GAP, gap=Gap(6.0, 5.9, False, 0.4)))
    assert [one.name for one in worst_first([noisy, *FOUR])].index("noisy") == 3


def test_the_table_says_of_each_campaign_what_is_wrong_and_what_to_do(tmp_path: Path) -> None:
    write_table(campaign_table(FOUR), tmp_path / "campaigns")
    with (tmp_path / "campaigns.csv").open(encoding="utf-8") as stream:
        odd, open_, creeps, fine = csv.DictReader(stream)
    assert (odd["verdict"], odd["cause"], odd["gap closed"]) == ("unknown", "–", "")
    assert float(odd["probability"]) == 0.97
    assert open_["cause"] == "creep of the material or creep of the sensor"
    assert open_["next step"] == "calibrate with dwells of 60 s"
    assert (creeps["verdict"], float(creeps["probability"])) == ("cause", 0.83)
    assert float(creeps["gap closed"]) == 0.95
    assert creeps["next step"].startswith("keep it in the model")
    assert (fine["verdict"], float(fine["probability"])) == ("no gap", 0.98)
    assert "measured data" in odd["provenance"]
    text = (tmp_path / "campaigns.md").read_text(encoding="utf-8")
    assert "largest gap above the noise floor first" in text
    assert "| 2.14 |" in " ".join(text.split())


def test_the_report_opens_with_two_sentences_and_a_picture_of_each_campaign() -> None:
    page = openings_html(FOUR)
    assert page.count("<img") == len(FOUR)
    assert all(place.startswith("data:image/png;base64,") for place in Addresses(page).loaded)
    shown = words(page)
    for one in FOUR:
        assert opening(one.diagnosis)[0] in shown
        assert f"{one.name}/diagnosis/diagnosis.html" in Addresses(page).linked
    assert "measured data" in shown


def test_of_many_campaigns_the_table_comes_first_and_the_worst_have_pictures() -> None:
    page = openings_html(MANY)
    assert page.count("<img") == MOST_OPENINGS
    assert page.index("<table>") < page.index("<img")
    assert page.count("<tr>") == len(MANY) + 1
    pictured = page[page.index("</table>") :]
    assert "study_003" in pictured
    assert "study_000" not in pictured


def test_the_summary_opens_alike() -> None:
    few, many = ("\n".join(openings_markdown(given)) for given in (FOUR, MANY))
    assert few.index("rubber fine") < few.index("rubber odd")
    assert few.count("](") == 2 * len(FOUR)
    assert many.count("![") == MOST_OPENINGS
    assert "tables/campaigns.csv" in many


def test_what_was_only_compared_has_its_sentences_and_no_row() -> None:
    campaign: Any = FOUR[0].campaign
    compared = [
        MeasuredMaterial(
            name="june", campaign=campaign, changed={"answer": ["A < B.", "By 2 kPa."]}
        ),
        MeasuredMaterial(name="may", campaign=campaign),
    ]
    page = openings_html([*compared, *FOUR])
    assert page.startswith(openings_html(FOUR))
    assert page.removeprefix(openings_html(FOUR)).count("A &lt; B. By 2 kPa.") == 1
    lines = list(openings_markdown([*compared, *FOUR]))
    assert lines[:-1] == list(openings_markdown(FOUR))
    assert lines[-1] == "**rubber fine** (synthetic data). A < B. By 2 kPa."
    assert list(openings_markdown(compared)) == ["## In short", lines[-1]]
    assert tables(compared) == {}
