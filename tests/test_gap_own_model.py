"""Whether a model was fitted to the campaign that it is held against."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from scipy.optimize import least_squares

import campaigns
from blind.first_rig import write_case
from blind_documents import document, read
from spa_fo.gap.data.evidence import Evidence, angle_chain, collect
from spa_fo.gap.data.searched import HIGHEST, LOWEST, at_rate, to_x, to_z
from spa_fo.gap.decide import examine
from spa_fo.gap.decide.verdict import Scored, Verdict, with_unknown
from spa_fo.gap.diagnose import diagnose
from spa_fo.gap.fit.coefficients import rise_s
from spa_fo.gap.fit.own_model import bent_odds, is_own, still_taken
from spa_fo.plant import PARAMETERS, Model, TransferFunction, read_model
from spa_fo.plant.effects.effect import USUAL_RISE_S
from spa_fo.plant.effects.library import absent

Floats = np.ndarray


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Model]:
    """A campaign with an effect, and the model of its bare core."""
    folder = tmp_path_factory.mktemp("bent")
    write_case(document("stiffening", size=8.0), folder)
    return folder / "campaign", read_model(folder / "model.json")


def fitted(evidence: Evidence, start: Floats) -> Floats:
    """Fit the coefficients by somebody else's least squares."""
    weight = np.sqrt(evidence.grid.counts)

    def left(z: Floats) -> Floats:
        own = to_x(z)
        curve, _ = angle_chain(evidence, own, None).run(own, absent())
        return np.asarray(weight * (evidence.grid.angle_deg - curve))

    first = np.clip(to_z(start), LOWEST + 1e-3, HIGHEST - 1e-3)
    return to_x(least_squares(left, first, bounds=(LOWEST, HIGHEST)).x)


def test_least_squares_leave_their_own_coefficients_nothing(bent: tuple[Path, Model]) -> None:
    folder, core = bent
    evidence = collect(read(folder))
    given = core.transfer_function.as_array()
    assert not is_own(still_taken(evidence, given))
    own = fitted(evidence, given)
    assert is_own(still_taken(evidence, own))
    assert still_taken(evidence, own) < 0.1 * still_taken(evidence, given)


def test_a_model_that_could_take_much_more_was_hardly_fitted_here() -> None:
    odds = [bent_odds(taken) for taken in (0.0, 0.01, 0.3, 0.7, 0.95, 1.0)]
    assert odds == sorted(odds, reverse=True)
    assert odds[1] > 1.0 > odds[2]
    assert odds[-1] == 0.0


def test_the_diagnosis_sees_by_itself_that_a_model_is_the_campaign_s_own(
    bent: tuple[Path, Model],
) -> None:
    folder, core = bent
    data = read(folder)
    evidence = collect(data)
    x = fitted(evidence, core.transfer_function.as_array())
    nameless = replace(core, transfer_function=TransferFunction.from_array(x), extra={})
    said = diagnose(data, nameless)
    assert any("fitted to this campaign" in finding for finding in said.findings)
    assert all("parameter_shift" not in ids for ids in said.sets)
    assert not any("fitted to this" in each for each in diagnose(data, core).findings)


def test_a_model_that_a_fit_has_bent_half_way_is_no_other_specimen_s(tmp_path: Path) -> None:
    write_case(document("stiffening", size=16.0), tmp_path)
    data, core = read(tmp_path / "campaign"), read_model(tmp_path / "model.json")
    evidence, x = collect(data), core.transfer_function.as_array()
    x = 0.5 * (x + fitted(evidence, x))
    assert not is_own(still_taken(evidence, x))
    crude = replace(core, transfer_function=TransferFunction.from_array(x), extra={})
    said = diagnose(data, replace(crude, campaign=data.campaign.name))
    # How far it has bent nobody knows: an unknown cause is about as probable as the name.
    assert said.kind != "no_gap"
    named = [cause for cause in said.causes if cause.set[0] not in ("unknown", "none")]
    assert named[0].set == ("stiffening",)
    assert sum(one.probability for one in named if "parameter_shift" in one.set) < 0.05
    assert any("fitted to this campaign" in finding for finding in said.findings)
    # One that says that it was identified elsewhere has not bent with this gap.
    other = diagnose(data, replace(crude, campaign="another"))
    assert not any("fitted to this campaign" in finding for finding in other.findings)
    assert len(other.sets[0]) > 1  # something makes up for how it is bent


def test_an_own_model_is_one_by_how_much_better_it_explains() -> None:
    sure = Verdict(
        "cause", (("creep",),), (scored(("creep",), 0.9), scored((), 0.1)), 0.0, 0.1, 0.0
    )
    less = with_unknown(sure, 1.0 / 3.0)
    assert [one.probability for one in less.scored] == pytest.approx([0.675, 0.075])
    assert less.unknown == pytest.approx(0.25)
    assert (less.kind, less.sets) == ("cause", (("creep",),))
    assert with_unknown(sure, 1.5).kind == "unknown"


@pytest.mark.parametrize(
    ("kind", "named", "by_pressure", "by_angle"),
    [
        ("unknown", (), True, True),
        ("cause", ("creep",), False, False),
        ("no_gap", (), False, False),
        ("cause", ("stiffening", "sensor_creep"), True, True),
        ("cause", ("leak", "sensor_creep"), False, True),  # of which the pressure tells one
        ("cause", ("leak", "line_lag", "sensor_creep"), False, True),
        ("cause", ("leak", "parameter_shift"), True, True),
        ("cause", ("parameter_shift",), False, False),
    ],
)
def test_a_model_may_be_bent_where_something_makes_up_for_it(
    kind: str, named: tuple[str, ...], by_pressure: bool, by_angle: bool
) -> None:
    verdict = Verdict(cast(Any, kind), (named,) if named else (), (), 0.0, 0.0, 0.0)
    pressed = cast(Any, object())
    assert examine._may_be_bent(verdict, pressed) is by_pressure
    assert examine._may_be_bent(verdict, None) is by_angle


def scored(named: tuple[str, ...], probability: float) -> Scored:
    nothing = cast(Any, None)
    return Scored(named, probability, nothing, None, None, {}, 0.0)


def test_a_slow_actuator_s_times_are_long(bent: tuple[Path, Model]) -> None:
    folder, core = bent
    said = [diagnose(read(folder), each).reach.time for each in (core, slowed(core, 4.0))]
    takes_s = rise_s(core.transfer_function.as_array(), 60.0)
    assert said[0] < 2.0
    assert said[1] == pytest.approx(4.0 * takes_s / USUAL_RISE_S, rel=0.3)


def slowed(model: Model, times: float) -> Model:
    """The same actuator, so many times as slow."""
    x = at_rate(model.transfer_function.as_array(), 1.0 / times)
    return replace(model, transfer_function=TransferFunction.from_array(x), extra={})


def test_a_model_of_another_actuator_is_no_own_one_of_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaigns.step_campaign(tmp_path / "steps", trials=3)
    data = read(tmp_path / "steps")
    x = np.array([campaigns.TRUTH[name] for name in PARAMETERS])
    x[0], x[2] = x[0] + 0.2, 1.6 * x[2]
    other = Model(data.campaign.name, "", TransferFunction(*x), data.campaign.reference_kpa)
    asked: list[str] = []
    monkeypatch.setattr(examine, "_may_be_bent", lambda *_: True)
    said = diagnose(data, other, progress=asked.append)
    assert any(step.startswith("once more, as if") for step in asked)
    assert said.kind != "no_gap"  # with its coefficients free nothing is left
    assert not any("fitted to this campaign" in each for each in said.findings)
