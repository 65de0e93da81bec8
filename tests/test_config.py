from pathlib import Path
from typing import Any

import pytest
import yaml

from spa_fo.config import check_compared, has_angle, match_materials, read_config
from spa_fo.errors import BadInput

ROOT = Path(__file__).resolve().parent.parent
SCHEMA = ROOT / "workflow" / "schemas" / "config.schema.yaml"


def read(document: dict[str, Any]) -> dict[str, Any]:
    return read_config(document, "config.yaml", SCHEMA)


def test_the_shipped_config_is_valid_and_complete() -> None:
    document = yaml.safe_load((ROOT / "config.yaml").read_text())
    config = read(document)
    assert list(config["materials"]) == list(document["materials"])
    # What the file says is what the run uses: defaults only add.
    assert config["identify"] | document["identify"] == config["identify"]


def test_one_line_makes_a_material_and_the_rest_is_the_papers() -> None:
    config = read({"materials": {"my_arm": None}})
    assert config["materials"] == {"my_arm": {}}
    assert config["identify"]["swarm"] == {"particles": 200, "iterations": 10}
    assert config["ablation"]["points"] == [10, 20, 50, 100]


def test_the_document_is_not_changed() -> None:
    document: dict[str, Any] = {"materials": {"my_arm": None}}
    read(document)
    assert document == {"materials": {"my_arm": None}}


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({}, "config.yaml: materials: is missing"),
        ({"materials": {}}, "config.yaml: materials: is {}; expected at least 1 entries"),
        (
            {"materials": {"my arm": None}},
            "config.yaml: materials: is 'my arm'; expected a name of letters, digits and _ . - "
            "(it names folders)",
        ),
        (
            {"materials": {"a": None}, "identfy": {}},
            "config.yaml: identfy: unknown key; did you mean 'identify'?",
        ),
        (
            {"materials": {"a": {"papre": "design_1"}}},
            "config.yaml: materials.a.papre: unknown key; did you mean 'paper'?",
        ),
        (
            {"materials": {"a": {"paper": "design_3"}}},
            "config.yaml: materials.a.paper: is 'design_3'; did you mean 'design_2'?",
        ),
        (
            {"materials": {"a": {"bounds": {"a0": [2, 1]}}}},
            "config.yaml: materials.a.bounds.a0: is [2, 1]: reversed; "
            "expected the lower bound first",
        ),
        (
            {"materials": {"a": None}, "identify": {"swarm": {"particles": 1.5}}},
            "config.yaml: identify.swarm.particles: is 1.5; expected a whole number",
        ),
    ],
)
def test_bad_config_is_one_clear_line(document: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput) as error:
        read(document)
    assert str(error.value) == message


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    for name in ("study_002", "study_001", "study_010", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "campaign.yaml").touch()
    (tmp_path / "study_notes").mkdir()
    return tmp_path


def test_a_pattern_is_an_entry_for_every_campaign_it_matches(raw: Path) -> None:
    config = read({"materials": {"study_*": {"paper": "design_1"}}})
    materials = match_materials(config["materials"], raw, "config.yaml")
    assert list(materials) == ["study_001", "study_002", "study_010"]
    assert all(entry == {"paper": "design_1"} for entry in materials.values())


def test_an_entry_of_its_own_goes_before_a_pattern_and_a_pattern_before_a_later_one(
    raw: Path,
) -> None:
    entries = {"study_0[01]*": {"ludwick_n": 2.0}, "*": {}, "study_002": {"paper": "design_2"}}
    materials = match_materials(read({"materials": entries})["materials"], raw, "config.yaml")
    assert materials == {
        "study_001": {"ludwick_n": 2.0},
        "study_010": {"ludwick_n": 2.0},
        "other": {},
        "study_002": {"paper": "design_2"},
    }


def test_a_pattern_without_a_campaign_is_one_clear_line(raw: Path) -> None:
    with pytest.raises(BadInput) as error:
        match_materials({"sutdy_*": {}}, raw, "config.yaml")
    assert str(error.value) == (
        f"config.yaml: materials.sutdy_*: matches no campaign's folder in {raw}"
    )


def test_a_campaign_without_an_angle_has_a_reference_or_is_one() -> None:
    folders = {name: Path("raw") / name for name in ("may", "june")}
    check_compared({"may": {}, "june": {"reference": "may", "campaign": "june"}}, folders, "c.yaml")
    with pytest.raises(BadInput) as error:
        check_compared({"may": {}, "june": {}}, folders, "config.yaml")
    assert str(error.value) == (
        "config.yaml: materials.may.reference: is missing; raw/may/campaign.yaml names no column "
        "'angle' or 'flex_adc', so it can only be compared; expected another entry, an earlier "
        "campaign of the actuator"
    )


def test_what_a_campaign_without_an_angle_cannot_use_is_refused() -> None:
    materials = {"may": {}, "june": {"reference": "may", "paper": "design_1"}}
    with pytest.raises(BadInput) as error:
        check_compared(materials, {"june": Path("raw/june")}, "config.yaml")
    assert str(error.value) == (
        "config.yaml: materials.june.paper: belongs to a campaign with an angle; "
        "raw/june/campaign.yaml names none"
    )


def test_a_description_that_cannot_be_used_is_left_to_the_first_step(raw: Path) -> None:
    assert has_angle(raw / "other")
    assert has_angle(raw / "nowhere")
    assert has_angle(ROOT / "raw" / "fx_pro")
