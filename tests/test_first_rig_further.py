"""Effects beyond the contract's, as the virtual rig's blind cases have them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from blind.first_rig import FURTHER, write_case
from blind.first_rig import further_effects as further
from blind.first_rig import reading_effects as reading
from blind.first_rig.asked import read_document
from blind.first_rig.case import Case
from blind.first_rig.doses import draw_dose
from blind.first_rig.further_effects import FURTHER_FORMS
from blind.first_rig.reading_effects import Moments
from blind.first_rig.sizing import exact_readings, solve
from blind_documents import document, read
from spa_fo.plant.effects.library import CONTRACT, IDS
from spa_fo.virtual_rig.actuator import SoftActuator
from spa_fo.virtual_rig.actuators import DRAGON_SKIN_20_CORE
from spa_fo.virtual_rig.campaign_writer import write_folder

RICH = {"protocol": {"name": "rich", "repeats": 1}, "sampling": {"rate_hz": 20.0}}
DIRECT = {"calibration": {"kind": "none"}}
SEEDS = {"a": 1, "b": 2}  # each draws this form
STEP_S = 0.002
TIME = np.arange(0.0, 40.0, STEP_S)
HELD = np.where((TIME > 1.0) & (TIME < 25.0), 40.0, 0.0)


def case(*effects, **changes) -> Case:
    return Case(read_document(document(*effects, **changes)))


def test_the_rig_makes_every_effect_of_the_library():
    # Those that no case of this rig has; the other rig has a tear, as a foreign cause.
    assert set(FURTHER) == set(IDS) - set(CONTRACT) - {"supply_limit", "tear"}
    assert FURTHER_FORMS["a"].keys() == FURTHER_FORMS["b"].keys()
    rng = np.random.default_rng(0)
    for name in FURTHER_FORMS["a"]:
        made = {type(draw_dose(name, form, rng, 14).make(0.5)) for form in ("a", "b")}
        assert len(made) == 2


@pytest.mark.parametrize("form", SEEDS)
@pytest.mark.parametrize("effect", FURTHER)
def test_sizes_are_as_ordered_or_told_to_be_less(effect, form):
    # Each effect at both sizes, in one form each.
    size = {"a": 4.0, "b": 8.0}[form] if effect in FURTHER[::2] else {"a": 8.0, "b": 4.0}[form]
    it = case(effect, size=size, seed=SEEDS[form], **RICH)
    truth = it.truth()
    reached = truth["sizes_reached"][0]
    assert reached == pytest.approx(size, rel=0.03) or 0.2 * size < reached < size
    assert truth["form"] == form
    assert set(truth["parameters"]) == {effect}
    assert json.loads(json.dumps(truth, allow_nan=False)) == truth
    again = it._scale.weigh(it.specimen)
    assert again == (pytest.approx(reached), True)


@pytest.mark.parametrize(
    ("effect", "form"), list(zip(FURTHER_FORMS["a"], "ababa", strict=True)), ids=str
)
def test_same_document_same_bytes(effect, form, tmp_path):
    asked = document(
        effect, seed=SEEDS[form], protocol={"name": "single"}, sampling={"rate_hz": 10.0}
    )
    truths = [write_case(asked, tmp_path / name) for name in ("one", "two")]
    files = [
        {
            path.relative_to(folder): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file()
        }
        for folder in (tmp_path / "one", tmp_path / "two")
    ]
    assert truths[0] == truths[1]
    assert files[0] == files[1]


def test_a_pair_may_hold_them():
    it = case("sensor_detachment", "creep", size=2.0, seed=4, **RICH, **DIRECT)
    truth = it.truth()
    assert truth["sizes_reached"] == pytest.approx([2.0, 2.0], rel=0.03)
    assert set(truth["parameters"]) == {"sensor_detachment", "creep"}


def test_halving_finds_what_goes_by_leaps_and_passes_what_cannot_be_read():
    def weigh(x):
        return (0.1, not 0.2 < x < 0.3) if x < 0.6 else (1000.0 * (x - 0.6), True)

    assert solve(weigh, 8.0, 1.0, 5.0, halving=True).size == pytest.approx(8.0, rel=0.02)


# --- drive and actuator -------------------------------------------------------------------------


@pytest.mark.parametrize(
    "effect", [further.SelfExcited(3.0, 0.3, 1.2), further.BangBang(3.0, 3.0, 0.4)], ids=str
)
def test_a_regulator_hunts_while_its_command_is_held(effect):
    off = effect.begin(STEP_S)(HELD) - HELD
    late = off[(TIME > 15.0) & (TIME < 25.0)]
    assert 2.2 < late.max() < 3.5
    assert -3.5 < late.min() < -2.2
    assert 4 <= np.sum(np.diff(np.sign(late)) != 0) <= 8
    assert np.abs(off[TIME < 1.0]).max() == 0.0
    assert np.abs(off[TIME > 28.0]).max() < 0.05
    ramp = np.minimum(TIME * 4.0, 60.0)
    led = (effect.begin(STEP_S)(ramp) - ramp)[TIME < 15.0]
    assert np.abs(led).max() < 0.5
    assert effect.begin(STEP_S)(HELD).min() >= 0.0


@pytest.mark.parametrize(
    "effect",
    [
        further.SelfExcited(3.0, 0.3, 1.2),
        further.BangBang(3.0, 3.0, 0.4),
        further.SqueezedFolds(0.5, 1.5),
        further.TouchingWalls(0.5, 10.0, 5.0),
    ],
    ids=str,
)
def test_stretches_may_be_of_any_length(effect):
    run = effect.begin(STEP_S)
    pieces = [run(piece) for piece in np.split(HELD, [1, 2, 500, 501, 7000])]
    np.testing.assert_allclose(np.concatenate(pieces), effect.begin(STEP_S)(HELD), atol=1e-12)


@pytest.mark.parametrize("share", [0.5, -0.5])
@pytest.mark.parametrize("form", [further.SqueezedFolds, further.TouchingWalls])
def test_damping_slows_the_rise_and_leaves_rest_and_end(form, share):
    effect = form(share, 1.0) if form is further.SqueezedFolds else form(share, 10.0, 8.0)
    bare = SoftActuator(DRAGON_SKIN_20_CORE, 50.0)
    damped = replace(bare, damping=(effect,))
    plain, other = (actuator.begin(STEP_S)(HELD) for actuator in (bare, damped))
    assert np.sign(plain.max() - other.max()) == np.sign(share)
    assert other[TIME < 24.9][-1] == pytest.approx(plain[TIME < 24.9][-1], abs=0.3)
    # Vented it is as it was, but for what it remembers.
    assert other[-1] == pytest.approx(plain[-1], abs=0.1)


# --- the reading --------------------------------------------------------------------------------


def moments(trial: int) -> Moments:
    return Moments(trial, np.arange(0.0, 10.0, 0.01), 10.0)


ANGLE = 50.0 * np.sin(moments(1).time_s)
NOISE = np.random.default_rng(0).normal(0.0, 0.3, ANGLE.size)


def test_an_unsigned_reading_is_never_below_its_zero():
    for effect in (reading.Folded(-5.0), reading.Blended(-5.0, 1.0)):
        read = np.sum(effect.read(moments(1), (ANGLE, NOISE)), axis=0)
        assert read.min() >= -5.0
        bent, back = ANGLE > 5.0, ANGLE < -15.0
        np.testing.assert_allclose(read[bent], (ANGLE + NOISE)[bent], atol=0.03)
        np.testing.assert_allclose(read[back], -10.0 - (ANGLE + NOISE)[back], atol=0.03)


def test_a_sensor_stays_off():
    torn = reading.Torn(0.2, 3.0, trial=4, at=0.5)
    peeling = reading.Peeling(0.2, 3.0, trial=4, at=0.5, peels_s=1.0, slack_deg=5.0)
    steady = np.full(ANGLE.size, 45.0)
    for effect, end in ((torn, 39.0), (peeling, 39.9)):
        reads = {n: effect.read(moments(n), (steady, NOISE))[0] for n in (3, 4, 5, 9)}
        np.testing.assert_array_equal(reads[3], steady)
        np.testing.assert_array_equal(reads[4][:500], steady[:500])
        np.testing.assert_allclose(reads[5], end)
        np.testing.assert_allclose(reads[9], end)
        assert reads[4][-1] == pytest.approx(end, abs=0.1)
    assert torn.read(moments(4), (steady, NOISE))[0][500] == pytest.approx(39.0)
    assert peeling.read(moments(4), (steady, NOISE))[0][500] == pytest.approx(45.0)


def test_a_film_jams_and_a_register_sticks():
    windows = ((2, 0.2, 0.6),)
    inside = slice(201, 599)
    for effect in (reading.Jammed(windows, 0.2), reading.Stuck(windows)):
        assert effect.read(moments(1), (ANGLE, NOISE))[0] == pytest.approx(ANGLE)
        angle, noise = effect.read(moments(2), (ANGLE, NOISE))
        np.testing.assert_allclose(angle[inside], ANGLE[200])
        np.testing.assert_array_equal(angle[:200], ANGLE[:200])
        assert angle[-1] == pytest.approx(ANGLE[-1], abs=1e-6)
        # A film that jams has the noise of its wires still.
        assert bool(np.ptp(noise[inside]) == 0.0) == isinstance(effect, reading.Stuck)


@pytest.mark.parametrize("calibration", ["none", "before"])
def test_a_stuck_reading_is_logged_as_one_value(calibration, tmp_path):
    changes = {"calibration": {"kind": calibration}, "sampling": {"damaged": 0.0, "rate_hz": 50.0}}
    it = case("sensor_freeze", seed=SEEDS["b"], size=6.0, **changes)
    trial, start, end = it.truth()["parameters"]["sensor_freeze"]["windows"][0]
    write_folder(it.campaigns()["campaign"], tmp_path / "case")
    found = next(data for data in read(tmp_path / "case").trials if data.order == trial)
    share = found.t_s / found.t_s[-1]
    inside = (share > start + 0.01) & (share < end - 0.01)
    assert inside.sum() > 5
    assert np.ptp(found.angle_deg[inside]) == 0.0
    assert np.ptp(found.angle_deg[~inside]) > 20.0


def test_a_detached_sensor_is_still_off_in_the_later_campaign():
    it = case("sensor_detachment", seed=SEEDS["a"], size=6.0, **DIRECT)
    runs = [exact_readings(one, it.plan, it.later()) for one in (it.bare, it.specimen)]
    apart = [np.abs(a.angle_deg - b.angle_deg).max() for a, b in zip(*runs, strict=True)]
    off = it.truth()["parameters"]["sensor_detachment"]["trial"]
    assert max(apart[: off - 1], default=0.0) < 1e-6
    assert min(apart[off - 1 :]) > 0.5
