"""Campaigns measured by others, where they are at hand: what the diagnosis makes of them."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from spa_fo.report.causes import likelihood

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def real_data() -> ModuleType:
    spec = importlib.util.spec_from_file_location("real_data", ROOT / "benchmarks" / "real_data.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def soft_arm(
    real_data: Any, shared_data: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("soft_arm")
    real_data.OUT = folder / "out"
    real_data.run("soft_arm_steps", shared_data, folder)
    assert (folder / "out" / "soft_arm_steps" / "diagnosis.md").is_file()
    path = folder / "out" / "soft_arm_steps" / "diagnosis.json"
    document: dict[str, Any] = json.loads(path.read_text())
    return document


def test_the_soft_arm_has_a_gap(soft_arm: dict[str, Any]) -> None:
    assert soft_arm["provenance"] == "measured"
    assert soft_arm["gap"]["significant"]
    assert soft_arm["gap"]["rmse_deg"] > 1.0


def test_the_regulators_lag_is_found(soft_arm: dict[str, Any]) -> None:
    """Known of the rig: the pressure reaches 63 % of a step in 0.35 to 0.8 s, longest to 25 psi.

    A lag is as much a line's as that of a regulator which slows as it comes near its setpoint;
    through an orifice it is in between. What of it is the sensor's no pressure tells.
    """
    (finding,) = [text for text in soft_arm["findings"] if text.startswith("The measured pressure")]
    late = re.findall(
        r"(?:time_constant_s|delay_s|lag by|lag of its sensor by) ([\d.e-]+\d)", finding
    )
    assert 0.3 < sum(map(float, late)) < 0.9
    # The lag is no trifle, of a tenth of the gap at least (assumed); the growing gain is more.
    assert 0.1 < soft_arm["where"]["stage"]["drive"] < soft_arm["where"]["stage"]["actuator"]


def test_no_sure_name_where_the_gain_grows_with_the_pressure(soft_arm: dict[str, Any]) -> None:
    """The gain doubles from 5 to 25 psi: of the library a softening alone comes near to that.

    An answer says that it does not know, or has the softening in it and is not sure of itself.
    """
    verdict = soft_arm["verdict"]
    if verdict["kind"] == "cause":
        (named,) = verdict["sets"]
        (found,) = [one for one in soft_arm["causes"] if one["set"] == named]
        assert "stiffening" in named
        assert likelihood(found["probability"]) == "about as likely as not"
    else:
        assert verdict["kind"] in ("unknown", "ambiguous")


def test_a_stage_that_is_not_known_is_said_so(real_data: Any) -> None:
    assert real_data.by_stage({"stage": {"drive": 0.39, "actuator": 0.61}}) == (
        "drive 39 %, actuator 61 %"
    )
    where = {"stage": None, "not_known": "no pressure was logged"}
    assert real_data.by_stage(where) == "not known: no pressure was logged"


def test_one_chamber_of_the_bellow_at_a_time(
    real_data: Any, shared_data: Path, tmp_path: Path
) -> None:
    """Both chambers bend alike, each to its own side: the gains agree."""
    gains = []
    for chamber in (1, 2):
        folder = tmp_path / f"chamber_{chamber}"
        folder.mkdir()
        real_data.bellow(chamber)(shared_data / "bellow_bending", folder)
        real_data.list_checksums(folder)
        data = real_data.read_trials(real_data.read_campaign(folder))
        fitted = real_data.fit_campaign(data, signal="pressure", bootstrap=0)
        gains.append(fitted.model.transfer_function.gain)
    assert gains[0] == pytest.approx(gains[1], rel=0.2)
