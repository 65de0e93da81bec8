"""From evidence to an answer."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spa_fo.gap.answer.causes import _named, _uncalibrated
from spa_fo.gap.data.hold_out import fraction_closed, hold_out
from spa_fo.gap.decide import part, weigh
from spa_fo.gap.decide.verdict import Scored, judge, said, stage_shares
from spa_fo.gap.fit.bench import SHARES
from spa_fo.gap.noise.interference import Line
from spa_fo.gap.prior import log_prior
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY, absent, acts_like, log_odds

GAP_DEG, FLOOR_DEG = 4.0, 0.5
LEAST_DEG = SETTINGS.no_gap * FLOOR_DEG
SMALL_DEG, SHARE = SETTINGS.left * FLOOR_DEG, SETTINGS.right_share


def scored(ids, probability, moved=None):
    fitted = SimpleNamespace(ids=ids)
    return Scored(ids, probability, fitted, None, None, moved or dict.fromkeys(ids, 1.0), 0.0)


def test_one_set_that_holds_nearly_all_is_the_cause():
    verdict = judge([scored(("creep",), 0.96), scored((), 0.03)], 0.01, 0.0)
    assert verdict.kind == "cause"
    assert verdict.sets == (("creep",),)


def test_sets_that_share_the_probability_are_ambiguous():
    every = [scored(("creep",), 0.6), scored(("sensor_creep",), 0.35), scored(("leak",), 0.05)]
    verdict = judge(every, 0.0, 0.0)
    assert verdict.kind == "ambiguous"
    assert verdict.sets == (("creep",), ("sensor_creep",))


def test_no_gap_names_nothing():
    verdict = judge([scored((), 0.9), scored(("creep",), 0.1)], 0.0, 0.0)
    assert verdict.kind == "no_gap"
    assert verdict.sets == ()


def test_a_name_has_to_be_clearly_more_probable_than_an_unknown_cause():
    every = [scored((), 0.3), scored(("creep",), 0.2), scored(("leak",), 0.15)]
    border = SETTINGS.doubt * 0.35
    assert judge(every[1:], border + 0.01, 0.0).kind == "unknown"
    assert judge(every[1:], border - 0.01, 0.0).kind == "ambiguous"
    # No gap at all may be more probable than either.
    assert judge([scored((), 0.36), *every[1:]], border + 0.01, 0.0).kind == "no_gap"


def test_a_cause_has_to_be_more_probable_than_none():
    for none, kind in ((0.46, "no_gap"), (0.44, "cause")):
        every = [scored((), none), scored(("creep",), 0.9 - none)]
        assert judge(every, 0.1, 0.0).kind == kind


def test_several_causes_count_together_against_none():
    for none, kind in ((0.46, "no_gap"), (0.44, "ambiguous")):
        causes = [scored(("creep",), 0.5 - 0.5 * none), scored(("leak",), 0.4 - 0.5 * none)]
        assert judge([scored((), none), *causes], 0.1, 0.0).kind == kind
    every = [scored((), 0.4), scored(("creep",), 0.3), scored(("leak",), 0.2)]
    assert judge(every, 0.51, 0.0).kind == "unknown"
    assert set(stage_shares(judge([scored((), 1.0)], 0.0, 0.0)).values()) == {0.0}


def test_unknown_keeps_only_the_part_that_is_explained():
    every = [scored(("creep",), 0.06), scored(("leak",), 0.04)]
    verdict = judge(every, 0.9, 0.0)
    assert verdict.kind == "unknown"
    assert verdict.sets == (("creep",),)


@given(
    st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3).filter(lambda p: sum(p) > 0.01),
    st.floats(0.0, 1.0),
)
def test_what_is_said_sums_to_one_and_keeps_the_most_probable_kind(weights, share):
    none, named, unknown = np.array(weights) / sum(weights)
    sets = [(), ("creep",), ("leak",)]
    made = [
        scored(ids, p)
        for ids, p in zip(sets, (none, share * named, (1 - share) * named), strict=True)
    ]
    own, left = said(judge(made, unknown, 0.0))
    assert sum(own.values()) + left == pytest.approx(1.0)
    kinds = own[()], sum(p for ids, p in own.items() if ids), left
    if named > 1e-9:
        before = np.array([none, named, unknown])
        assert before[np.argmax(kinds)] == pytest.approx(before.max(), abs=1e-9)
    assert named <= 1e-9 or max(kinds) <= 1.0 - 2.0 * SETTINGS.failed / 3.0 + 1e-9


def test_an_unknown_cause_beside_sets_is_never_said_for_sure():
    own, left = said(judge([scored(("creep",), 1e-6)], 1.0 - 1e-6, 0.0))
    assert 0.5 < left < 1.0 - SETTINGS.failed
    assert own[("creep",)] > SETTINGS.failed
    assert said(judge([scored((), 0.0)], 1.0, 0.0))[1] > 0.95


def test_what_has_a_name_for_sure_may_be_an_unknown_cause_once_more():
    own, unknown = said(judge([scored(("creep",), 1.0), scored((), 0.0)], 0.0, 0.0))
    assert own[()] == pytest.approx(SETTINGS.failed / 3.0)
    assert unknown - own[()] == pytest.approx(SETTINGS.failed * (1.0 - 4.0 * SETTINGS.failed / 3.0))


def test_stage_shares_weigh_by_square_and_probability():
    every = [
        scored(("leak", "creep"), 0.5, {"leak": 1.0, "creep": 3.0}),
        scored(("sensor_lag",), 0.5),
    ]
    shares = stage_shares(judge(every, 0.0, 0.0))
    assert shares == pytest.approx(
        {"drive": 0.05, "actuator": 0.45, "sensor": 0.5, "acquisition": 0.0}
    )


def uncalibrated(since, follows=1.0):
    """Share a creep and a freeze of the sensor out, which reads a part of what is expected.

    It bends 60° within the first 60 % of the campaign, and is expected to within 2°.
    """
    effects, freeze = absent(), LIBRARY["sensor_freeze"]
    effects[freeze.slots] = 0.8, since
    moved = {"sensor_creep": 1.0, "sensor_freeze": 3.0}
    one = scored(("sensor_creep", "sensor_freeze"), 0.5, moved)
    one = replace(one, angle=SimpleNamespace(effects=effects))
    steps = np.arange(101)
    plain = np.clip(steps, 0, 60).astype(float)
    read = np.where(steps < 100.0 * since, follows, 0.2) * plain
    grid = SimpleNamespace(
        middle_s=50.0 + steps, sample_step=steps, angle_deg=read, counts=np.ones(101)
    )
    stages_of = _uncalibrated(grid, plain, np.full(101, 4.0))
    return _named(judge([one], 0.5, 0.0), stages_of)


def test_without_a_calibration_it_is_even_whose_is_what_the_actuator_may_do_as_well():
    """What nothing in an actuator does alike, as a reading that stands still, is the sensor's."""
    shares, said_so = uncalibrated(since=0.35)
    assert shares == pytest.approx(
        {"drive": 0.0, "actuator": 0.05, "sensor": 0.95, "acquisition": 0.0}
    )
    assert "shared evenly" in said_so
    verdict = judge([scored(("creep",), 0.5)], 0.5, 0.0)
    assert _named(verdict, None) == (stage_shares(verdict), "")
    assert acts_like("sensor_creep", "actuator")
    assert acts_like("sensor_saturation", "actuator")
    assert acts_like("creep", "sensor")
    assert not acts_like("sensor_freeze", "actuator")


@pytest.mark.parametrize(
    ("since", "follows", "sensor"),
    [
        (0.35, 1.0, 0.95),  # it had read 35° rightly
        (0.35, 0.55, 0.5),  # and here hardly more than half of them
        (0.05, 1.0, 0.5),  # nothing that would have shown anything
    ],
)
def test_a_sensor_that_was_not_seen_sound_may_be_an_actuator_that_bends_less(
    since, follows, sensor
):
    shares, _ = uncalibrated(since, follows)
    assert shares == pytest.approx(
        {"drive": 0.0, "actuator": 1.0 - sensor, "sensor": sensor, "acquisition": 0.0}
    )


def test_small_sets_come_first_and_a_shift_beside_another_last():
    one, two, three = ("creep",), ("creep", "leak"), ("creep", "leak", "line_lag")
    assert log_prior(()) > log_prior(one) > log_prior(two) > log_prior(three)
    assert log_prior(("creep", "parameter_shift")) < log_prior(two)


def weighed(named, logs):
    """An explanation whose log evidence is `logs`, by the share that it misses."""
    missed = part.missed_of(GAP_DEG, 0.0)
    small_deg = SMALL_DEG if named else LEAST_DEG
    right, unknown = part.weighed(named, np.array(logs), missed, small_deg, SHARE)
    return part.Part(named, right, unknown, None, {}, 0.0)


def answer(*parts):
    return weigh._normalised(parts)


PLAIN = weighed((), [-900.0, -800.0, -700.0, -500.0, -200.0, -100.0])


def test_what_leaves_nothing_is_the_cause():
    named, _, unknown = answer(
        PLAIN, weighed(("creep",), [0.0, -30.0, -90.0, -200.0, -300.0, -400.0])
    )
    assert named[("creep",)] > 0.9
    assert unknown < 0.1


def test_what_leaves_much_stands_in_for_something_unknown():
    named, _, unknown = answer(
        PLAIN, weighed(("creep",), [-400.0, -200.0, -90.0, 0.0, -20.0, -60.0])
    )
    assert unknown > 0.5 > named[("creep",)]


def test_a_smooth_error_is_no_small_one_as_a_small_share_fits_it_best():
    logs = np.array([-900.0, -30.0, 0.0, -5.0, -200.0, -400.0])
    alike = []
    for left_deg in (0.0, 0.9 * GAP_DEG):
        missed = part.missed_of(GAP_DEG, left_deg)
        right, unknown = part.weighed((), logs, missed, LEAST_DEG, SHARE)
        plain = part.Part((), right, unknown, None, {}, 0.0)
        alike.append(answer(plain)[2])
    assert alike[0] < 0.5 < alike[1]


def test_without_repeats_what_is_left_speaks_for_nothing():
    logs = np.array([-400.0, -200.0, -90.0, 0.0, -20.0, -60.0])
    missed = part.missed_of(GAP_DEG, 0.0)
    _, unknown = part.weighed((), logs, missed, SMALL_DEG, SHARE, repeats=False)
    assert np.all(np.isneginf(unknown))
    right, unknown = part.weighed(("creep",), logs, missed, SMALL_DEG, SHARE, repeats=False)
    assert right > log_prior(("creep",)) - 2.0
    # A set that leaves something may stand in for something else all the same.
    _, repeated = part.weighed(("creep",), logs, missed, SMALL_DEG, SHARE)
    np.testing.assert_allclose(unknown, repeated - np.log(SETTINGS.unknown))
    assert np.isfinite(unknown).any()


def test_structure_that_is_too_small_is_no_gap():
    """The same evidence, of a gap of a tenth of the floor."""
    logs = np.array([0.0, 1.0, 5.0, 20.0, 25.0, 10.0])
    for gap_deg, alone in ((0.1 * FLOOR_DEG, True), (4.0 * FLOOR_DEG, False)):
        missed = part.missed_of(gap_deg, 0.0)
        right, unknown = part.weighed((), logs, missed, LEAST_DEG, SHARE)
        plain = part.Part((), right, unknown, None, {}, 0.0)
        named, _, elsewhere = weigh._normalised([plain])
        assert (named[()] > 0.9) is alone
        assert (elsewhere < 0.1) is alone


def fit(ids, curve, moved):
    """A fit of the angle that predicts `curve` everywhere."""
    logs = np.full(len(SHARES), -1.0)
    shared = np.full(10, curve)
    return SimpleNamespace(
        ids=ids,
        logs=logs,
        moved_deg=moved,
        shared_deg=shared,
        trend_deg=0.0,
        trend_nats=0.0,
        left_deg=0.0,
    )


def test_a_member_without_which_the_others_do_as_well_is_not_named():
    fits = [
        fit((), 0.0, {}),
        fit(("creep",), 2.0, {"creep": 2.0}),
        fit(("leak",), 0.1, {"leak": 2.0}),
        fit(("leak", "creep"), 2.01, {"leak": 2.0, "creep": 2.0}),
    ]
    evidence = SimpleNamespace(grid=SimpleNamespace(counts=np.ones(10)))
    noise = SimpleNamespace(spectrum=SimpleNamespace(repeats=5))
    bench = SimpleNamespace(evidence=evidence, gap_deg=GAP_DEG, noise=noise)
    found = SimpleNamespace(fits={f.ids: f for f in fits}, bench=bench, excluded=())
    named = {p.fit.ids: p.named for p in weigh._of_angle(found, FLOOR_DEG)}
    assert named[("leak", "creep")] == ("creep",)
    assert named[("creep",)] == ("creep",)


@pytest.mark.parametrize(
    ("last_deg", "compared", "pays"),
    [(2.0, False, True), (9.0, False, False), (2.0, True, False)],
)
def test_a_zero_that_moves_before_the_first_trial_alone_pays_for_that(
    last_deg: float, compared: bool, pays: bool
) -> None:
    slip = fit(("sensor_slip",), 2.0, {"sensor_slip": 2.0})
    slip.zeros_deg = np.array([2.0, 2.0, 2.0, last_deg])
    evidence = SimpleNamespace(grid=SimpleNamespace(counts=np.ones(10)))
    noise = SimpleNamespace(spectrum=SimpleNamespace(repeats=5), compared=compared)
    bench = SimpleNamespace(evidence=evidence, gap_deg=GAP_DEG, noise=noise)
    fits = {f.ids: f for f in (slip, fit(("creep",), 2.0, {"creep": 2.0}), fit((), 0.0, {}))}
    found = SimpleNamespace(fits=fits, bench=bench, excluded=())
    right = {p.named: p.right for p in weigh._of_angle(found, FLOOR_DEG)}
    paid = right[("creep",)] - right[("sensor_slip",)]
    assert paid == pytest.approx(np.log(4.0) if pays else 0.0)


def test_what_moves_less_than_a_part_of_the_floor_is_none():
    least = SETTINGS.no_gap * FLOOR_DEG
    assert part._that_move({"creep": 1.01 * least, "leak": 0.99 * least}, least) == ("creep",)


def test_fraction_closed_is_the_contracts():
    before, after, floor = 2.1**2, 0.6**2, 0.5
    expected = 1.0 - (after - floor**2) / (before - floor**2)
    assert fraction_closed(before, after, floor) == pytest.approx(expected)
    # What is left below the floor closes no more than all of the gap.
    assert fraction_closed(before, 0.4**2, floor) == 1.0


def trials(names):
    listed = tuple(SimpleNamespace(experiment=name, label=f"{name} {i}") for i, name in names)
    grid = SimpleNamespace(trials=listed, cell_starts=2 * np.arange(len(listed) + 1))
    grid.command_kpa, grid.pressure_kpa = np.tile([0.0, 20.0], len(listed)), None
    return SimpleNamespace(grid=grid)


def test_one_trial_of_each_repeated_experiment_is_held_out_and_never_the_first():
    names = list(enumerate(["a"] * 5 + ["b"] * 4 + ["c"]))
    for seed in range(20):
        held = hold_out(trials(names), np.random.default_rng(seed))
        assert held.trials[:5].sum() == 1
        assert held.trials[5:9].sum() == 1
        assert not held.trials[[0, 5, 9]].any()


def test_where_few_can_be_held_out_it_is_those_that_show_a_gap():
    names = [(i, name) for i, name in enumerate(["low", "high", "low", "high", "low", "high"])]
    own = trials(names)
    own.rows = [np.array([i]) for i in range(6)]
    own.grid.counts = np.ones(6)
    for missed, shows in (([0.3, 2.0] * 3, "high"), ([2.0, 0.3] * 3, "low")):
        held = hold_out(own, np.random.default_rng(0), np.array(missed))
        assert [t.experiment for t, h in zip(own.grid.trials, held.trials, strict=True) if h] == [
            shows
        ]
        assert not held.trials[:2].any()


def test_without_repeats_one_experiment_is_held_out():
    held = hold_out(trials(list(enumerate("abcd"))), np.random.default_rng(0))
    assert held.trials.sum() == 1


@pytest.mark.parametrize(
    ("reached", "stay"),
    [
        ([10.0, 30.0, 20.0], [1]),
        ([10.0, 20.4, 20.0], []),
        ([50.0, -40.0, 20.0], [0, 1]),  # each to its own side
        ([0.0, -0.1, 20.0], [2]),
    ],
)
def test_what_goes_farther_than_all_else_is_not_held_out_alone(reached, stay):
    own = trials(list(enumerate("abc")))
    own.grid.command_kpa = np.column_stack([np.zeros(3), reached]).ravel()
    drawn = {
        int(np.flatnonzero(hold_out(own, np.random.default_rng(seed)).trials)[0])
        for seed in range(40)
    }
    assert drawn == set(range(3)) - set(stay)
    own.rows, own.grid.counts = [np.array([i]) for i in range(3)], np.ones(3)
    held = hold_out(own, np.random.default_rng(0), np.array([1.0, 2.0, 0.1]))
    assert np.flatnonzero(held.trials).tolist() == [next(i for i in (1, 0, 2) if i not in stay)]


def test_what_makes_up_for_a_form_has_no_price_but_counts_as_missed():
    fit = SimpleNamespace(ids=("creep", "leak"))
    logs, moved = np.array([0.0, -30.0, -90.0, -200.0, -300.0, -400.0]), {"creep": 3.0, "leak": 0.1}

    def weighed(alone_deg):
        apart = {(): 3.0, ("leak",): 3.0, ("creep",): alone_deg}.get
        worth = dict.fromkeys([("leak",), ("creep",)], 0.0).get
        sizes = part.Sizes(3.0, GAP_DEG, 0.0, FLOOR_DEG, LEAST_DEG, SMALL_DEG, SHARE)
        (one,) = part.parts_of(fit, logs, moved, apart, worth, sizes)
        return one

    helped, unknown_to_all = weighed(0.25), weighed(np.inf)
    assert helped.named == unknown_to_all.named == ("creep",)
    one, two = log_prior(("creep",)), log_prior(("creep", "leak"))
    assert unknown_to_all.right - two < helped.right - two
    # The fit is best where nothing is missed, so that only the price differs.
    assert helped.right == pytest.approx(unknown_to_all.right - two + one)
    assert np.isneginf(unknown_to_all.unknown[1])
    assert np.isfinite(helped.unknown[1])


def test_many_ways_to_make_up_for_a_form_are_no_more_than_the_best():
    found = weighed(("creep",), [0.0, -30.0, -90.0, -200.0, -300.0, -400.0])
    rival = weighed(("leak",), [1.0, -30.0, -90.0, -200.0, -300.0, -400.0])
    once, _, _ = answer(PLAIN, rival, found)
    often, _, _ = answer(PLAIN, rival, *[found] * 9)
    assert often[("creep",)] == pytest.approx(once[("creep",)])


def test_what_stands_in_is_as_probable_as_unknown_effects_however_rare_it_is():
    one, two = log_prior(("creep",)), log_prior(("creep", "leak"))
    assert log_odds(("gain_growth",)) < 0.0
    for ids in ((), ("creep",), ("gain_growth",)):
        assert part.stands_in(ids) == pytest.approx(one)
    for ids in (("creep", "leak"), ("creep", "gain_growth"), ("creep", "leak", "line_lag")):
        assert part.stands_in(ids) == pytest.approx(two)


def test_where_either_of_two_does_as_well_either_is_named():
    fit = SimpleNamespace(ids=("creep", "leak"))
    logs, moved = np.array([0.0, -30.0, -90.0, -200.0, -300.0, -400.0]), {"creep": 3.0, "leak": 2.9}
    apart = {(): 3.0, ("leak",): 0.02, ("creep",): 0.01}.get
    worth = {("leak",): -4.0, ("creep",): -1.0}.get
    sizes = part.Sizes(3.0, GAP_DEG, 0.0, FLOOR_DEG, LEAST_DEG, SMALL_DEG, SHARE)
    parts = part.parts_of(fit, logs, moved, apart, worth, sizes)
    assert [p.named for p in parts] == [("creep",), ("leak",)]
    behind = log_prior(("leak",)) - log_prior(("creep",)) - 3.0 * SETTINGS.temper
    assert parts[1].right - parts[0].right == pytest.approx(behind)


def test_of_effects_that_stand_in_for_each_other_one_is_named():
    apart = {
        ("contact_stop", "sensor_lag"): 0.02,
        ("contact_stop", "channel_latency"): 0.03,
        ("sensor_lag", "channel_latency"): 3.0,
        ("contact_stop",): 2.2,
        ("sensor_lag",): 3.1,
        ("channel_latency",): 3.2,
    }
    one, other = ("contact_stop", "channel_latency"), ("contact_stop", "sensor_lag")
    worth = dict.fromkeys(apart, 0.0) | {one: 1.0, other: 0.8}
    triple = ("contact_stop", "sensor_lag", "channel_latency")

    def enough(least_deg, least_nats=-60.0):
        return part._enough(triple, apart.__getitem__, worth.__getitem__, least_deg, least_nats)

    assert enough(0.1) == [one, other]
    # Where the best so many do not do as well, no others do.
    assert enough(0.025) == [triple]
    # What is worth far less than the set does not do as well, however near it comes.
    assert enough(0.1, 0.9) == [one]
    assert enough(0.1, 2.0) == [triple]


def test_what_goes_with_the_order_is_an_effect_more_beside_a_set():
    nats = 10.0

    def unknown_by(ids, size_deg=FLOOR_DEG):
        fit = SimpleNamespace(
            ids=ids,
            logs=np.array([0.0, -30.0, -90.0, -200.0, -300.0, -400.0]),
            shared_deg=np.array([float(len(ids))]),
            moved_deg=dict.fromkeys(ids, 2.0),
            left_deg=0.0,
            trend_deg=size_deg,
            trend_nats=nats,
        )
        bench = SimpleNamespace(
            noise=SimpleNamespace(spectrum=SimpleNamespace(repeats=3)),
            evidence=SimpleNamespace(grid=SimpleNamespace(counts=np.ones(1))),
            gap_deg=GAP_DEG,
        )
        (one,) = weigh._of_angle(
            SimpleNamespace(bench=bench, fits={ids: fit}, excluded=()), FLOOR_DEG
        )
        return one.unknown

    for ids in (("creep",), ("creep", "leak"), ("creep", "leak", "line_lag")):
        odds = np.log(SETTINGS.unknown**2)
        one_more = log_prior((*ids, "contact_stop"))
        shares = np.exp(-np.array(SHARES) / SETTINGS.right_share)
        expected = SETTINGS.temper * nats + one_more + odds - np.log(shares.sum())
        assert unknown_by(ids)[-1] == pytest.approx(expected)
        # Too small to be a gap it says nothing.
        assert unknown_by(ids, 0.9 * SETTINGS.no_gap * FLOOR_DEG).size == len(SHARES)


def test_an_interference_counts_from_twice_what_another_cause_does() -> None:
    least = SETTINGS.no_gap * FLOOR_DEG
    assert part._that_move({"creep": 1.1 * least}, least) == ("creep",)
    assert part._that_move({"mains_pickup": 1.1 * least}, least) == ()
    assert part._that_move({"mains_pickup": 2.1 * least}, least) == ("mains_pickup",)


@pytest.mark.parametrize(("times", "has_a_price"), [(1.9, False), (2.1, True)])
def test_an_interference_too_small_to_be_named_has_no_price(
    times: float, has_a_price: bool
) -> None:
    """No prediction holds its waves: it is no further from what explains the same without it."""
    moved = {"creep": 2.0, "mains_pickup": times * LEAST_DEG}
    waved = fit(("creep", "mains_pickup"), 2.01, moved)
    fits = {f.ids: f for f in (fit((), 0.0, {}), fit(("creep",), 2.0, {"creep": 2.0}), waved)}
    fits[("creep",)].logs = waved.logs - 1000.0  # an interference may be worth any evidence
    evidence = SimpleNamespace(grid=SimpleNamespace(counts=np.ones(10)))
    noise = SimpleNamespace(spectrum=SimpleNamespace(repeats=5))
    bench = SimpleNamespace(evidence=evidence, gap_deg=GAP_DEG, noise=noise)
    parts = weigh._of_angle(SimpleNamespace(fits=fits, bench=bench, excluded=()), FLOOR_DEG)
    (one,) = [p for p in parts if p.fit.ids == waved.ids]
    assert one.named == (waved.ids if has_a_price else ("creep",))


def test_an_interference_that_the_library_lacks_is_an_unknown_cause():
    hum = Line(20.0, 2.0, 500.0)
    named, unknown = weigh._of_line(hum, FLOOR_DEG, ())
    assert named[("mains_pickup",)] > 0.99
    assert unknown == 0.0
    assert weigh._of_line(hum, FLOOR_DEG, ("mains_pickup",)) == (
        {(): 1.0},
        named[("mains_pickup",)],
    )
    faint = Line(20.0, 0.5 * FLOOR_DEG, 500.0)
    assert weigh._of_line(faint, FLOOR_DEG, ("mains_pickup",)) == ({(): 1.0}, 0.0)
