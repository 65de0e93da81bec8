"""Free-form laws in the simulator, against plain twins, and as model files hold them."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import naive_law
import plant_cases
from spa_fo.errors import BadInput
from spa_fo.export.linear_part import linear_part
from spa_fo.plant.augmented import is_augmented, law_in, predict_augmented
from spa_fo.plant.chain import Chain, chain_for
from spa_fo.plant.effects.library import absent
from spa_fo.plant.grid import campaign_grid
from spa_fo.plant.law import PLACES, Law, Past, relaxing
from spa_fo.plant.lawful import TooSteep, with_law
from spa_fo.plant.memory import STEPS_S

COMMANDS = (plant_cases.step_release(), plant_cases.triangle(), plant_cases.step_release(25.0))
KNOTS = {
    "filling": (-60.0, 0.0, 60.0),
    "input_map": (0.0, 30.0, 60.0),
    "moment": (0.0, 30.0, 60.0),
    "damping": (-100.0, 0.0, 100.0),
    "relaxation": (0.3, 3.0, 30.0),
    "trial_gain": (1.0, 2.0, 3.0),
    "reading": (0.0, 30.0, 60.0),
    "trial_rest": (1.0, 2.0, 3.0),
}
VALUES = {
    "filling": (-300.0, 0.0, 300.0),
    "input_map": (0.0, -3.0, 4.0),
    "moment": (0.0, 3.0, -4.0),
    "damping": (3.0, 0.0, -3.0),
    "relaxation": (0.05, 0.1, 0.05),
    "trial_gain": (-0.1, 0.0, 0.2),
    "reading": (0.0, 2.0, -3.0),
    "trial_rest": (1.0, 0.0, -1.0),
}


def law(place: str, size: float = 1.0) -> Law:
    return Law(place, np.array(KNOTS[place]), size * np.array(VALUES[place]))


def chain(longest: int = 3) -> Chain:
    grid = campaign_grid(plant_cases.trials(*COMMANDS), longest=longest)
    return chain_for(grid, plant_cases.X, plant_cases.KPA)


def angles(one: Chain) -> np.ndarray:
    return one.run(plant_cases.X, absent())[0]


ADDING = [place for place in PLACES if place != "filling"]


@pytest.mark.parametrize("place", ADDING)
def test_a_law_that_is_zero_is_neutral(place: str) -> None:
    bent = angles(with_law(chain(), law(place, 0.0)))
    np.testing.assert_allclose(bent, angles(chain()), rtol=1e-12)


@pytest.mark.parametrize("place", PLACES)
def test_every_law_moves_the_angle_and_ends_in_a_state(place: str) -> None:
    bent, memory = with_law(chain(), law(place)).run(plant_cases.X, absent())
    assert np.abs(bent - angles(chain())).max() > 0.3
    assert memory.ends_s == chain().grid.ends_s


def test_a_filling_that_is_quick_is_none() -> None:
    quick = Law("filling", np.array([-60.0, 60.0]), np.array([-60.0, 60.0]) * 40.0)
    plain = angles(chain())
    assert np.abs(angles(with_law(chain(), quick)) - plain).max() < 0.1 * plain.max()


def test_a_straight_law_of_the_input_is_a_gain() -> None:
    gain = Law("input_map", np.array([0.0, 20.0, 60.0]), 0.1 * np.array([0.0, 20.0, 60.0]))
    np.testing.assert_allclose(angles(with_law(chain(), gain)), 1.1 * angles(chain()), rtol=1e-9)


def test_a_straight_law_of_the_angle_is_a_stiffness() -> None:
    a0, b0 = plant_cases.X[3:]
    softer = 0.1 * np.radians(1.0) * a0 / b0 * plant_cases.KPA  # kPa per degree
    x = plant_cases.X * [1.0, 1.0, 1.0, 0.9, 1.0]
    straight = Law("moment", np.array([0.0, 60.0]), softer * np.array([0.0, 60.0]))
    fine = chain(longest=0)
    softened = with_law(fine, straight).run(plant_cases.X, absent())[0]
    expected = replace(fine).run(x, absent())[0]
    assert np.abs(softened - expected).max() < 2e-3 * expected.max()


@pytest.mark.parametrize("place", ["moment", "damping", "relaxation"])
def test_what_follows_the_motion_is_that_of_a_plain_twin(place: str) -> None:
    one = with_law(chain(), law(place))
    fast, _ = one.angles(plant_cases.X, absent())
    slow = naive_law.stepped(chain(), law(place), plant_cases.X)
    np.testing.assert_allclose(fast, slow, atol=1e-4)


@pytest.mark.parametrize("place", ["moment", "damping", "relaxation"])
def test_beside_an_effect_it_is_the_same_law(place: str) -> None:
    nothing = plant_cases.vector("stiffening", fraction_at_60deg=0.0)
    one = with_law(chain(), law(place))
    alone, _ = one.angles(plant_cases.X, absent())
    beside, memory = one.angles(plant_cases.X, nothing)
    np.testing.assert_allclose(beside, alone, atol=1e-4)
    assert memory.ends_s == chain().grid.ends_s


def test_dry_friction_holds_the_actuator_however_steep_it_is() -> None:
    knots = np.array([-60.0, -20.0, -2.0, 0.0, 2.0, 20.0, 60.0])
    rubbing = Law("damping", knots, np.array([6.0, 6.0, 6.0, 0.0, -6.0, -6.0, -6.0]))
    plain, _ = chain().angles(plant_cases.X, absent())
    held, _ = with_law(chain(), rubbing).angles(plant_cases.X, absent())
    first = slice(0, chain().grid.trial_steps[0])
    assert held[first].max() < plain[first].max() - 1.0
    # Let go, it comes to rest before it is back.
    assert held[first][-1] > plain[first][-1] + 1.0


def test_relaxation_is_the_convolution_that_it_says() -> None:
    rng = np.random.default_rng(1)
    step_s = STEPS_S[rng.integers(0, 5, 60)]
    angle = np.cumsum(rng.normal(size=60))
    times = np.array([0.05, 0.7, 20.0])
    slow = naive_law.relaxing(angle, step_s, times)
    fast, _ = relaxing(angle, step_s, times, Past(0.0, np.zeros(times.size)))
    np.testing.assert_allclose(fast, slow, atol=2e-3)


def test_filling_is_that_of_a_plain_twin() -> None:
    command = np.concatenate([np.zeros(20), np.full(100, 40.0), np.zeros(80)])
    starts = np.array([0, 120, 200])
    one = law("filling")
    slow = naive_law.filled(command, starts, one)
    np.testing.assert_allclose(one.driven(command, starts), slow, atol=0.05)


def test_a_law_too_steep_for_any_motion_is_refused() -> None:
    steep = plant_cases.model(law("moment", 1e6).to_effect())
    data = plant_cases.campaign_data(plant_cases.trials(*COMMANDS))
    with pytest.raises(BadInput, match=r"m\.json: effects: the law at moment is too steep"):
        predict_augmented(steep, data, "m.json")


@pytest.mark.parametrize("place", PLACES)
def test_a_model_carries_a_law(place: str) -> None:
    model = plant_cases.model(law(place).to_effect())
    read = law_in(model)
    assert read is not None
    assert read.place == place
    np.testing.assert_array_equal(read.values, law(place).values)
    assert is_augmented(model)
    data = plant_cases.campaign_data(plant_cases.trials(*COMMANDS))
    plain = predict_augmented(plant_cases.model(), data)
    bent = predict_augmented(model, data)
    assert max(np.abs(a - b).max() for a, b in zip(plain, bent, strict=True)) > 0.3


def changed(**parameters: Any) -> dict[str, Any]:
    entry = law("moment").to_effect()
    entry["parameters"] = {**entry["parameters"], **parameters}
    return entry


def without(key: str) -> dict[str, Any]:
    entry = law("moment").to_effect()
    del entry["parameters"][key]
    return entry


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (law("moment").to_effect() | {"place": "momen"}, r"place: .*found 'momen'.*moment"),
        (law("moment").to_effect() | {"place": None}, r"place: expected one of"),
        (law("moment").to_effect() | {"stage": "drive"}, r"stage: is 'drive', but moment"),
        (without("knots"), r"parameters\.knots: missing"),
        (changed(knot=[1.0]), r"parameters\.knot: is no parameter.*knots"),
        (changed(knots=[0.0, 2.0, 1.0]), r"parameters\.knots: expected numbers that rise"),
        (changed(values=[0.0, 1.0]), r"parameters\.values: expected 3 numbers"),
        (changed(values=[0.0, "1", 2.0]), r"parameters\.values: expected numbers, found '1'"),
        (changed(values=[0.0, True, 2.0]), r"parameters\.values: expected numbers, found True"),
        (changed(values=[0.0, 1e300, 2.0]), r"parameters\.values: expected numbers below 1e\+09"),
        (changed(values=7.0), r"parameters\.values: expected a list of 2 to"),
        (
            law("relaxation", -1.0).to_effect(),
            r"parameters: expected relaxation times above 0",
        ),
    ],
)
def test_a_bad_law_names_the_file_and_the_key(entry: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=r"m\.json: effects\[0\]\." + message):
        law_in(plant_cases.model(entry), "m.json")


def test_one_law_at_most() -> None:
    two = plant_cases.model(law("moment").to_effect(), law("reading").to_effect())
    with pytest.raises(BadInput, match="holds 2 laws; expected one at most"):
        law_in(two)


def test_an_export_does_not_hold_a_law_of_the_actuator() -> None:
    model = plant_cases.model(law("moment").to_effect())
    with pytest.raises(BadInput, match=r"holds free-form law \(moment\), which no linear model"):
        linear_part(model)
    part = linear_part(model, allow_left_out=True)
    assert part.left_out == ("free-form law (moment)",)


def test_an_export_is_of_the_angle_not_of_its_reading() -> None:
    part = linear_part(plant_cases.model(law("reading").to_effect()))
    assert part.not_of_the_actuator == ("free-form law (reading)",)
    assert not part.left_out


def test_a_law_that_is_too_steep_says_so_from_another_process_too() -> None:
    error = TooSteep("moment")
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "the law at moment is too steep: no motion agrees with it"
