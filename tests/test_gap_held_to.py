"""An answer held against trials that took no part: what is left of it."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from spa_fo.compare.held_to_reference import (
    SURELY,
    beyond_expected,
    differs,
    not_compared,
    only_part_differs,
    unnamed,
    unsure_of_the_sensor,
    unsure_to_close,
    with_equivalents,
)
from spa_fo.gap.answer.causes import _stood
from spa_fo.gap.answer.findings import findings
from spa_fo.gap.claim.claimed import (
    CLEARLY,
    Claim,
    _by_chance,
    held_to,
    if_it_varies,
    is_hardly_a_gap,
    too_large_for_none,
    too_small_for_any,
    without_none,
)
from spa_fo.gap.decide.verdict import Scored, Verdict, judge
from spa_fo.gap.diagnose import _alone_does, _is_doubtful, held_against_trials
from spa_fo.gap.diagnosis import LawFound, Shrink
from spa_fo.gap.noise.bench_noise import Beyond
from spa_fo.gap.noise.coloured import Scatter, Spectrum, level_spread
from spa_fo.gap.noise.dwell_error import DwellError
from spa_fo.gap.places.missing import Missing
from spa_fo.gap.settings import SETTINGS

Ids = tuple[str, ...]
NOT_READ = cast(Any, None)


def answer(probabilities: dict[Ids, float], unknown: float) -> Verdict:
    scored = [
        Scored(named, probability, NOT_READ, None, None, dict.fromkeys(named, 1.0), 0.0)
        for named, probability in probabilities.items()
    ]
    return judge(sorted(scored, key=lambda s: -s.probability), unknown, 0.0)


def claims(closed: dict[Ids, float], doubt: float = 0.0) -> Claim:
    return Claim({}, {}, closed, None, dict.fromkeys(closed, doubt))


def test_a_cause_that_closes_the_gap_stands() -> None:
    verdict = answer({("creep",): 0.9}, 0.1)
    assert held_to(verdict, claims({("creep",): 0.9})) == verdict


def test_a_cause_that_closes_nothing_is_none() -> None:
    held = held_to(answer({("creep",): 0.9}, 0.1), claims({("creep",): 0.0}))
    assert (held.kind, held.sets) == ("unknown", ())
    assert held.unknown == pytest.approx(1.0)


@pytest.mark.parametrize("way", [0.2, 0.49, 0.51, 0.8, 1.0])
def test_nothing_changed_no_more_probably_than_the_size_says(way: float) -> None:
    """Also where no effect explains what differs."""
    nothing = answer({(): 0.95, ("creep",): 0.02}, 0.03)
    found = beyond_expected(nothing, 1.0 + way * (SURE - 1.0), HALF)
    assert found.none <= 1.0 - way + 1e-9
    assert found.none + found.unknown + 0.02 * way == pytest.approx(1.0)
    assert (found.kind == "no_gap") == (way < 0.5)
    assert found.sets == ()


def test_trials_that_scatter_by_as_much_refute_nothing() -> None:
    verdict = answer({("creep",): 0.9}, 0.1)
    assert held_to(verdict, claims({("creep",): -0.2}, 0.5)) == verdict
    assert held_to(verdict, claims({("creep",): -0.2}, 0.2)).kind == "unknown"


def test_nobody_foretells_a_slip_so_it_stands_by_what_it_moves() -> None:
    verdict = answer({("sensor_slip",): 0.9}, 0.1)
    held_out = claims({("sensor_slip",): -0.2})
    assert held_to(verdict, replace(held_out, by_chance={("sensor_slip",): 0.9})) == verdict
    # One that hardly moves a trial is not what the gap is.
    small = replace(held_out, by_chance={("sensor_slip",): 0.05})
    assert (held_to(verdict, small).kind, held_to(verdict, small).sets) == ("unknown", ())


def test_a_cause_has_to_close_what_the_plain_model_does_identified_again() -> None:
    verdict = answer({("creep",): 0.9}, 0.1)
    half = claims({("creep",): 0.5})
    assert held_to(verdict, replace(half, by_refit=0.55)) == verdict
    refuted = held_to(verdict, replace(half, by_refit=0.95))
    assert (refuted.kind, refuted.unknown) == ("unknown", pytest.approx(1.0))
    assert held_to(verdict, replace(claims({("creep",): 0.5}, 0.4), by_refit=0.95)) == verdict
    again = answer({("parameter_shift",): 0.9}, 0.1)
    shift = claims({("parameter_shift",): 0.5})
    assert held_to(again, replace(shift, by_refit=0.95)) == again


@pytest.mark.parametrize(("closed", "left"), [(-2.5, ()), (0.9, (("creep", "sensor_slip"),))])
def test_a_part_is_said_for_what_it_closes_elsewhere(closed: float, left: tuple[Ids, ...]) -> None:
    named = ("creep", "sensor_slip")
    held = held_to(answer({named: 0.1}, 0.9), claims({named: closed}))
    assert (held.kind, held.sets) == ("unknown", left)


def test_where_the_leader_is_refuted_what_closes_instead_is_said_to_be_a_part() -> None:
    first, second = ("sensor_nonlinearity",), ("parameter_shift",)
    verdict = answer({first: 0.6, second: 0.05}, 0.35)
    assert verdict.sets == (first,)
    held = held_to(verdict, claims({first: 0.1, second: 0.98}))
    assert (held.kind, held.sets) == ("unknown", (second,))
    assert held_to(verdict, claims({first: 0.1, second: 0.2})).sets == ()


HALF = 1.5
"""From which a change is as probable as not."""
SURE = 1.0 + SURELY * (HALF - 1.0)


def test_what_the_drive_does_anyway_leaves_the_rest_of_a_set_its_name() -> None:
    both, late, lag = ("line_lag", "channel_latency"), ("channel_latency",), ("line_lag",)
    verdict = answer({both: 0.7, late: 0.05, lag: 0.05}, 0.2)
    assert verdict.sets == (both,)
    found = beyond_expected(verdict, 10.0, HALF, 1.0)
    assert (found.kind, found.sets) == ("cause", (late,))
    assert found.of(late).probability == pytest.approx(0.75)
    assert found.unknown == pytest.approx(0.25)  # the drive's alone is lost
    # By itself it has to close enough, too.
    refuted = held_to(verdict, claims({both: 0.9, late: -0.1, lag: 0.2}))
    closed = claims({both: 0.9, late: -0.1, lag: 0.2})
    again = beyond_expected(refuted, 10.0, HALF, 1.0, closed)
    assert (again.kind, again.sets) == ("unknown", ())
    assert beyond_expected(verdict, 10.0, HALF, 1.0, claims({both: 0.9})).sets == ()
    # A drive that differs clearly keeps its own.
    assert beyond_expected(verdict, 10.0, HALF, 3.0).sets == (both,)
    # Where the pressure was not measured nothing tells them apart.
    assert beyond_expected(verdict, 10.0, HALF).sets == (both,)


def test_what_is_no_larger_than_expected_is_no_change() -> None:
    verdict = beyond_expected(answer({("creep",): 0.95}, 0.05), 0.9, HALF)
    assert (verdict.kind, verdict.sets) == ("no_gap", ())
    drive = answer({("leak",): 0.95, (): 0.0}, 0.05)
    assert beyond_expected(drive, 0.9, HALF, 3.5) == drive
    assert beyond_expected(drive, 0.9, HALF).kind == "no_gap"
    assert beyond_expected(drive, 0.9, HALF, 1.4).kind == "no_gap"


def test_what_is_hardly_larger_than_expected_has_a_name_in_part() -> None:
    found = answer({("creep",): 0.9, (): 0.04}, 0.06)
    way = 0.6
    near = beyond_expected(found, 1.0 + way * (SURE - 1.0), HALF)
    assert (near.kind, near.sets) == ("cause", (("creep",),))
    assert near.of(("creep",)).probability == pytest.approx(way * 0.9)
    lost = 0.06 + (1.0 - way) * 0.9
    assert near.unknown == pytest.approx(way * lost)
    assert near.none == pytest.approx(0.04 + (1.0 - way) * lost)
    assert beyond_expected(found, 1.0 + 0.2 * (SURE - 1.0), HALF).kind == "no_gap"
    surely = beyond_expected(found, SURE, HALF)
    assert (surely.kind, surely.sets, surely.none) == ("cause", found.sets, 0.0)
    assert surely.of(("creep",)).probability == pytest.approx(0.9 / 0.96)
    assert surely.unknown == pytest.approx(0.06 / 0.96)
    drive = answer({("leak",): 0.95}, 0.05)
    assert beyond_expected(drive, 1.5, HALF, CLEARLY + 0.01) == drive
    assert beyond_expected(drive, 3.5, HALF, 1.5).kind == "unknown"
    both = beyond_expected(answer({("leak", "creep"): 0.9}, 0.1), 2.8, HALF, 1.2)
    assert both.of(("leak", "creep")).probability == pytest.approx(0.1 * 0.9)


def test_what_is_far_larger_than_expected_is_a_change_whatever_it_is() -> None:
    none = answer({(): 0.9}, 0.1)
    for sizes in ((3.1, HALF), (0.9, HALF, 3.1)):
        verdict = beyond_expected(none, *sizes)
        assert (verdict.kind, verdict.sets) == ("unknown", ())
    assert beyond_expected(none, 0.9, HALF, 2.0).kind == "no_gap"


def test_the_fewer_trials_a_reference_has_the_larger_a_change_must_be() -> None:
    quiet, nothing = Spectrum(0.0, np.zeros(6)), Scatter(0.0, 0.0, 0.0)
    borders = [
        Beyond(quiet, nothing, nothing, angle_deg=1.0, trials=trials).changed
        for trials in (1, 2, 4, 1000)
    ]
    assert borders == sorted(borders, reverse=True)
    assert borders[0] == pytest.approx(np.sqrt(5.0) * borders[-1], rel=0.01)
    assert borders[2] < 0.55 * borders[0]  # few repeats say what one trial cannot


def test_a_gap_beyond_all_that_is_expected_is_none_of_it() -> None:
    none = answer({(): 0.9, ("creep",): 0.05}, 0.05)
    found = too_large_for_none(none)
    assert (found.kind, found.none) == ("unknown", 0.0)
    assert found.unknown == pytest.approx(0.95)
    cause = answer({("creep",): 0.9}, 0.1)
    assert too_large_for_none(cause) == cause


def test_where_there_surely_is_a_gap_all_else_is_as_probable_as_it_was() -> None:
    none = answer({(): 0.6, ("creep",): 0.25, ("leak",): 0.1}, 0.05)
    found = without_none(none)
    assert (found.kind, found.none) == ("ambiguous", 0.0)
    creep, leak = (found.of((name,)).probability for name in ("creep", "leak"))
    assert creep / leak == pytest.approx(2.5)
    assert creep + leak + found.unknown == pytest.approx(1.0)
    # What was none is as probable as an effect that no one knows: a tenth of what it was, and less.
    assert 0.05 < found.unknown * 0.25 / creep < 0.05 + 0.1 * 0.6
    unknown = without_none(answer({(): 0.7, ("creep",): 0.05}, 0.25))
    assert (unknown.kind, unknown.none) == ("unknown", 0.0)
    # What was no answer before stays none, and what stood still stands.
    part = answer({(): 0.1, ("creep",): 0.2}, 0.7)
    assert without_none(part).sets == part.sets
    cause = answer({(): 0.2, ("creep",): 0.7, ("leak",): 0.04}, 0.06)
    assert (without_none(cause).kind, without_none(cause).sets) == ("cause", cause.sets)
    sure = without_none(answer({(): 1.0}, 0.0))
    assert (sure.kind, sure.unknown, sure.none) == ("unknown", pytest.approx(1.0), 0.0)


def test_a_gap_that_is_hardly_more_than_repeats_differ_by_is_none() -> None:
    cause = answer({("creep",): 0.6, ("leak", "creep"): 0.2, (): 0.1}, 0.1)
    found = too_small_for_any(cause)
    assert (found.kind, found.none, found.unknown) == ("no_gap", pytest.approx(0.9), 0.1)
    # What repeats differ by may be larger for it.
    for name in ("sensor_slip", "mains_pickup"):
        stays = answer({(name,): 0.6, ("creep",): 0.1, (): 0.2}, 0.1)
        assert too_small_for_any(stays).sets == ((name,),)
    unknown = answer({("creep",): 0.2, (): 0.1}, 0.7)
    assert too_small_for_any(unknown) == unknown
    # A model that was identified with a drive misses nothing, whatever the pressure does.
    of_drive = replace(unknown, unknown_drive=1.0)
    taken_up = too_small_for_any(of_drive)
    assert (taken_up.kind, taken_up.none) == ("no_gap", pytest.approx(1.0))
    # One that was fitted to the gap itself has bent with the drive.
    assert too_small_for_any(of_drive, own=True) == of_drive
    bent = too_small_for_any(answer({("leak",): 0.6, ("creep",): 0.1, (): 0.2}, 0.1), own=True)
    assert (bent.sets, bent.none, bent.unknown) == ((("leak",),), pytest.approx(0.3), 0.1)


def test_where_trials_vary_what_leaves_them_alike_is_a_part() -> None:
    alike = answer({("sensor_nonlinearity",): 0.9, (): 0.02}, 0.08)
    found = if_it_varies(alike)
    assert (found.kind, found.sets) == ("unknown", (("sensor_nonlinearity",),))
    assert (found.unknown, found.none) == pytest.approx((0.98, 0.02))
    for name in ("mullins_softening", "sensor_slip", "mains_pickup", "tear"):
        varies = answer({("creep", name): 0.9}, 0.1)
        assert if_it_varies(varies) == varies
    # What is left decides, where something that varies is probable, too.
    either = if_it_varies(answer({("creep",): 0.1, ("thermal_drift",): 0.8}, 0.1))
    assert (either.kind, either.sets) == ("cause", (("thermal_drift",),))
    none = answer({("creep",): 0.1, (): 0.8}, 0.1)
    assert if_it_varies(none).kind == "no_gap"


def test_what_closes_a_gap_that_is_too_large_for_none_is_a_part() -> None:
    none = answer({(): 0.9, ("creep",): 0.05}, 0.05)
    part = claims({("creep",): 0.9})
    for found in (
        too_large_for_none(none, part),
        beyond_expected(none, 3.1, HALF, claimed=part),
    ):
        assert (found.kind, found.sets) == ("unknown", (("creep",),))
        assert found.unknown == pytest.approx(0.95)
    assert too_large_for_none(none, claims({("creep",): 0.1})).sets == ()
    assert too_large_for_none(none, claims({})).sets == ()


def test_what_the_reference_never_saw_is_neither_the_same_nor_changed() -> None:
    found = not_compared(answer({(): 0.9, ("creep",): 0.05}, 0.05))
    assert (found.kind, found.sets, found.none, found.unknown) == ("unknown", (), 0.0, 1.0)


def test_where_little_was_compared_nothing_has_a_name() -> None:
    found = unnamed(answer({("creep",): 0.9, (): 0.04}, 0.06))
    assert (found.kind, found.sets, found.none) == ("unknown", (), 0.04)
    assert found.unknown == pytest.approx(0.96)


def test_what_acts_alike_elsewhere_stands_if_it_closes_as_much() -> None:
    found = answer({("sensor_creep",): 0.9, ("creep",): 0.05}, 0.05)
    close, far = {("sensor_creep",): 0.9, ("creep",): 0.85}, {("sensor_creep",): 0.9}
    both = with_equivalents(found, claims(close), True)
    assert (both.kind, both.sets) == ("ambiguous", (("sensor_creep",), ("creep",)))
    assert with_equivalents(found, claims({**far, ("creep",): 0.5}), True) == found
    assert with_equivalents(found, claims(far), True) == found
    unknown = answer({("sensor_creep",): 0.2, ("creep",): 0.05}, 0.75)
    assert with_equivalents(unknown, claims(close), True) == unknown


def test_without_the_pressure_a_delay_of_the_drive_is_one_of_the_log() -> None:
    found = answer({("channel_latency",): 0.9, ("dead_time",): 0.02}, 0.08)
    closed = claims({("channel_latency",): 0.9, ("dead_time",): 0.85})
    assert with_equivalents(found, closed, True) == found
    both = with_equivalents(found, closed, False)
    assert (both.kind, both.sets) == ("ambiguous", (("channel_latency",), ("dead_time",)))


def test_without_a_calibration_a_sensor_s_effect_is_a_part_of_what_is_unknown() -> None:
    slip = unsure_of_the_sensor(answer({("sensor_slip",): 0.9, (): 0.04}, 0.06))
    assert (slip.kind, slip.sets) == ("unknown", (("sensor_slip",),))
    assert slip.of(("sensor_slip",)).probability == pytest.approx(0.45)
    assert (slip.unknown, slip.none) == pytest.approx((0.51, 0.04))
    # So it is beside an effect of the actuator, if it acts like one itself.
    both = unsure_of_the_sensor(answer({("gravity_load", "sensor_nonlinearity"): 0.9}, 0.1))
    assert (both.kind, both.sets) == ("unknown", (("gravity_load", "sensor_nonlinearity"),))
    for other in (
        {("creep",): 0.9},
        {("sensor_creep",): 0.5, ("creep",): 0.4},
        {("creep", "sensor_detachment"): 0.9},
        {(): 0.9},
    ):
        found = answer(other, 0.1)
        assert unsure_of_the_sensor(found) == found


@pytest.mark.parametrize(("low", "stands"), [(-1.0, False), (0.3, False), (0.4, True)])
def test_a_change_that_may_not_close_has_no_cause(low: float, stands: bool) -> None:
    shrink = Shrink("none", 30.0, 23.0, 26.0, 0.1, 23.0, 1.0, (low, 1.1))
    claimed = replace(claims({("gravity_load",): 1.0}), shrink=shrink)
    found = answer({("gravity_load",): 0.6, (): 0.1}, 0.3)
    held = unsure_to_close(found, claimed)
    assert (held == found) is stands
    assert held.sets == found.sets
    if not stands:
        assert held.kind == "unknown"
        assert held.of(("gravity_load",)).probability == pytest.approx(0.3)
        assert (held.unknown, held.none) == pytest.approx((0.6, 0.1))
    several = answer({("gravity_load",): 0.45, ("stiffening",): 0.45}, 0.1)
    assert several.kind == "ambiguous"
    assert unsure_to_close(several, claimed) == several


def examined(repeats: int, response: Any = None, fixture: Any = None) -> Any:
    """A trial that reads 10° throughout, with a noise floor of 0.3°."""
    grid = SimpleNamespace(angle_deg=np.full(50, 10.0), counts=np.ones(50))
    scales = np.array([0.0, 0.0, 0.0, 0.32, 0.0, 0.0])
    dwells = DwellError(0.32, 9.0, 0.24)
    noise = SimpleNamespace(spectrum=SimpleNamespace(repeats=repeats), fixture=dwells)
    coefficients = SimpleNamespace(response=response)
    bench = SimpleNamespace(noise=noise, scales=scales, coefficients=coefficients)
    everything = SimpleNamespace(grid=grid, noise_deg=0.0, fixture=fixture)
    found = SimpleNamespace(bench=bench)
    return SimpleNamespace(found=found, everything=everything, floor_deg=0.3)


def test_all_trials_say_how_large_a_change_is_each_as_far_as_it_was_foretold() -> None:
    grid = SimpleNamespace(angle_deg=np.repeat([1.0, 5.0], 50), counts=np.ones(100))
    day = Scatter(0.0, 0.0, 0.0)
    none = Spectrum(0.0, np.zeros(6))
    beyond, plain_deg = Beyond(none, day, day, angle_deg=2.0), np.zeros(100)

    def known(sigma: list[float], variance: list[float]) -> Any:
        foreseen, doubt = np.repeat(sigma, 50), np.repeat(variance, 50)
        return cast(
            Any, SimpleNamespace(grid=grid, foreseen_deg=foreseen, variance=doubt, rows=rows)
        )

    rows = [np.arange(50), np.arange(50, 100)]
    alike = known([2.0, 2.0], [0.0, 0.0])
    assert differs(alike, plain_deg, beyond) == pytest.approx((np.sqrt(13.0), 2.0))
    # Each of these trials is off by one angle throughout, which an unsure zero explains.
    unsure, _ = differs(alike, plain_deg, replace(beyond, zero_deg=2.0))
    assert unsure == pytest.approx(0.5 * np.sqrt(13.0))
    # Where the reference never was, or hardly knows, what is missed says next to nothing.
    for nowhere in (known([2.0, 2.0], [0.0, 1e6]), known([2.0, 1e3], [0.0, 0.0])):
        size, expected = differs(nowhere, plain_deg, beyond)
        assert (size, expected) == pytest.approx((1.0, 2.0), rel=0.01)
    # Of what one day differs by from another, a share goes with the angle.
    other = replace(beyond, day=Scatter(0.1, 0.5, 0.0))
    _, expected = differs(known([2.0, 2.0], [0.0, 0.0]), np.full(100, 5.0), other)
    assert expected == pytest.approx(np.sqrt(4.0 + 0.25 + 0.25))


def test_what_only_some_trials_show_is_told_from_what_all_do() -> None:
    grid = SimpleNamespace(counts=np.ones(100), sample_trial=np.repeat([0, 1], 50))
    day = Scatter(0.0, 0.0, 0.0)
    beyond = Beyond(Spectrum(0.0, np.zeros(6)), day, day, angle_deg=2.0, trials=2)

    def only(sizes: tuple[float, float], held: tuple[bool, bool]) -> str | None:
        angle = SimpleNamespace(**vars(grid), angle_deg=np.repeat(sizes, 50))
        everything = SimpleNamespace(
            grid=angle,
            foreseen_deg=np.full(100, 2.0),
            variance=np.zeros(100),
            rows=[np.arange(50), np.arange(50, 100)],
        )
        return only_part_differs(cast(Any, everything), np.array(held), np.zeros(100), beyond)

    assert only((1.0, 9.0), (False, True)) == "held"
    assert only((9.0, 1.0), (False, True)) == "others"
    assert only((9.0, 9.0), (False, True)) is None
    assert only((1.0, 1.0), (False, True)) is None
    assert only((1.0, 9.0), (False, False)) is None
    assert only((1.0, 9.0), (True, True)) is None
    # A lone reference knows little: the others may differ by as much without any change.
    beyond = replace(beyond, trials=1)
    assert only((6.4, 6.4), (False, True)) is None
    assert only((6.4, 15.0), (False, True)) == "held"
    beyond = replace(beyond, broken=True)
    assert only((1.0, 15.0), (False, True)) is None


DETACHED, LAG = ("sensor_detachment",), ("sensor_lag",)


@pytest.mark.parametrize(
    ("first", "unknown", "standing", "weight"),
    [
        ({DETACHED: 0.3}, 0.7, {DETACHED}, 0.3),
        ({DETACHED: 0.04, (): 0.96}, 0.0, {DETACHED}, 1.0),
        ({DETACHED: 0.04, (): 0.92}, 0.04, {DETACHED}, 0.5),
        ({DETACHED: 0.3, LAG: 0.5}, 0.2, {DETACHED}, 0.3),
        ({DETACHED: 0.3, LAG: 0.5}, 0.2, set(), 0.0),
        ({(): 1.0}, 0.0, set(), 0.0),
    ],
)
def test_a_part_says_where_as_far_as_it_stood_beside_unknown_causes(
    first: dict[Ids, float], unknown: float, standing: set[Ids], weight: float
) -> None:
    assert _stood(answer(first, unknown), standing) == pytest.approx(weight)


def law(closes: float, beside: tuple[str, ...]) -> LawFound:
    """A law that closes so much beside these."""
    nothing = np.zeros(0)
    return LawFound(
        "angle", "actuator", 0.9, closes, 10.0, (), beside, nothing, nothing, nothing, nothing
    )


@pytest.mark.parametrize(
    ("part", "compared", "does"),
    [
        (0.3, False, True),  # the part closes little: the law is all there is
        (0.3, True, True),
        (0.9, False, True),  # it closes as much as the law: of a change it has its place
        (0.9, True, False),
    ],
)
def test_of_a_change_a_part_that_closes_as_much_as_a_law_keeps_its_place(
    part: float, compared: bool, does: bool
) -> None:
    slip = ("sensor_slip",)
    beside = Missing((law(0.9, slip),), slip, part)
    alone = Missing((law(0.9, ()),), (), 0.0)
    assert _alone_does(alone, beside, compared) is does


def test_a_law_alone_that_closes_less_than_beside_a_part_does_not() -> None:
    slip = ("sensor_slip",)
    beside = Missing((law(0.9, slip),), slip, 0.3)
    assert not _alone_does(Missing((law(0.6, ()),), (), 0.0), beside, False)
    assert not _alone_does(Missing(), beside, False)


@pytest.mark.parametrize(("part", "doubtful"), [(0.35, False), (0.2, True)])
def test_what_is_clearly_less_probable_than_an_unknown_cause_is_no_part(
    part: float, doubtful: bool
) -> None:
    verdict = answer({("creep",): part, ("leak",): 0.05}, 0.5)
    assert (verdict.kind, verdict.sets) == ("unknown", (("creep",),))
    assert _is_doubtful(verdict) is doubtful


def test_what_is_refuted_is_shared_by_what_else_is_probable() -> None:
    verdict, refuted = answer({("creep",): 0.8, (): 0.05}, 0.15), claims({("creep",): -3.0}, 0.2)
    held = held_to(verdict, refuted)
    assert (held.kind, held.sets) == ("unknown", ())
    assert (held.none, held.unknown) == pytest.approx((0.25, 0.75))
    nothing = held_to(answer({("creep",): 0.8, (): 0.15}, 0.05), refuted)
    assert (nothing.kind, nothing.none) == ("no_gap", pytest.approx(0.75))
    sure = held_to(answer({("creep",): 1.0}, 0.0), refuted)  # of a gap, and that it is no creep
    assert (sure.kind, sure.unknown) == ("unknown", pytest.approx(1.0))


def test_an_unknown_bench_s_floor_may_be_larger() -> None:
    for repeats in (0, 1, 5, 100):
        border = np.hypot(1.0, SETTINGS.no_gap) * np.exp(level_spread(repeats))
        assert is_hardly_a_gap(0.99 * border, 1.0, repeats)
        assert not is_hardly_a_gap(1.01 * border, 1.0, repeats)
        assert is_hardly_a_gap(1.1, 1.0, repeats, own=True) == (repeats == 0)


def test_what_is_refuted_where_there_is_hardly_a_gap_is_none() -> None:
    verdict, refuted = answer({("creep",): 0.8, (): 0.05}, 0.15), claims({("creep",): -3.0}, 0.2)
    none = held_to(verdict, refuted, hardly=True)
    assert (none.kind, none.sets) == ("no_gap", ())
    assert (none.none, none.unknown) == pytest.approx((0.85, 0.15))
    drive = held_to(
        answer({("line_lag",): 0.8, (): 0.05}, 0.15), claims({("line_lag",): -3.0}, 0.2), True
    )
    assert drive.kind == "no_gap"
    # Slips are in the noise floor: where they are refuted nobody knows.
    slip = held_to(
        answer({("sensor_slip",): 0.8, (): 0.05}, 0.15), claims({("sensor_slip",): -3.0}, 0.2), True
    )
    assert slip.kind == "unknown"
    # What is refuted beside it changes nothing in that.
    both = {("creep",): 0.3, ("sensor_slip",): 0.58, (): 0.02}
    mixed = held_to(answer(both, 0.1), claims({named: -3.0 for named in both if named}, 0.2), True)
    assert mixed.kind == "unknown"
    assert mixed.none == pytest.approx(0.02 + 0.3 + 0.58 * 0.02 / 0.12)
    # What stands does, and what an unknown cause was probable by stays its own.
    stands = claims({("creep",): 0.9}, 0.05)
    assert held_to(verdict, stands, hardly=True) == verdict
    unsure = held_to(answer({("creep",): 0.3, (): 0.1}, 0.6), refuted, hardly=True)
    assert (unsure.kind, unsure.sets) == ("unknown", ())


@pytest.mark.parametrize(("ordinary", "kind"), [(True, "no_gap"), (False, "unknown")])
def test_what_varies_between_trials_is_hardly_a_gap_on_an_ordinary_bench_alone(
    ordinary: bool, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is in the gap and in the floor alike."""
    known = {"is_hardly_a_gap": True}
    for name, value in known.items():
        place = sys.modules["spa_fo.gap.diagnose"]  # a function has its name in the package
        monkeypatch.setattr(place, name, lambda *_, value=value: value)
    one = examined(repeats=4)
    drive = SimpleNamespace(is_ordinary=ordinary)
    one.found.bench.noise.is_ordinary, one.found.bench.own = True, False
    grid = SimpleNamespace(counts=np.ones(50), angle_deg=np.zeros(50), sample_trial=np.zeros(50))
    one.everything.grid = grid
    verdict = replace(answer({(): 0.7, ("drive_hunting",): 0.1}, 0.2), unknown_drive=1.0)
    asked = SimpleNamespace(**{**vars(one), "drive": drive, "verdict": verdict})
    curves = {"plain": np.ones(50), "explained": np.ones(50)}
    claimed = replace(claims({}), curves=curves)
    assert held_against_trials(cast(Any, asked), claimed).kind == kind


@pytest.mark.parametrize(
    ("floor_deg", "repeats", "kind"),
    [(0.5, 4, "no_gap"), (0.9 / CLEARLY, 4, "unknown"), (0.9 / CLEARLY, 0, "no_gap")],
)
def test_a_gap_of_many_floors_is_one_though_the_trials_that_took_part_show_none(
    floor_deg: float, repeats: int, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor is it none where all that would explain it is refuted; without repeats who knows."""
    place = sys.modules["spa_fo.gap.diagnose"]
    monkeypatch.setattr(place, "is_hardly_a_gap", lambda *_: False)
    one = examined(repeats=repeats)
    one.found.bench.noise.is_ordinary, one.found.bench.own = True, False
    one.everything.grid = SimpleNamespace(
        counts=np.ones(50), angle_deg=np.zeros(50), sample_trial=np.zeros(50)
    )
    curves = {"plain": np.ones(50), "explained": np.ones(50)}
    claimed = replace(claims({("creep",): -3.0}), curves=curves)
    for verdict in (answer({(): 0.7}, 0.3), answer({("creep",): 0.7, (): 0.2}, 0.1)):
        asked = SimpleNamespace(
            **{**vars(one), "drive": None, "verdict": verdict, "floor_deg": floor_deg}
        )
        assert held_against_trials(cast(Any, asked), claimed).kind == kind


@pytest.mark.parametrize(
    ("likely", "says"), [(0.2, "creep, is clearly less probable"), (0.0, "holds on the held-out")]
)
def test_what_is_less_probable_is_not_said_to_be_refuted(likely: float, says: str) -> None:
    doubtful = replace(answer({("creep",): likely}, 1.0 - likely), sets=())
    assert says in findings(doubtful, own=False, repeats=True, floor_deg=0.3)[0]


@pytest.mark.parametrize(("beside", "kind"), [(True, "cause"), (False, "unknown")])
def test_trials_that_vary_beside_no_set_are_as_its_own_memory_has_them(
    beside: bool, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What remembers earlier trials lets repeats differ, though it is the same in all."""
    place = sys.modules["spa_fo.gap.diagnose"]
    verdict = answer({("sensor_hysteresis",): 0.9}, 0.1)
    known = {"is_hardly_a_gap": False, "leaves_trials_alike": beside, "against_laws": verdict}
    for name, value in known.items():
        monkeypatch.setattr(place, name, lambda *_, value=value: value)
    one = examined(repeats=4)
    one.found.bench.noise.is_ordinary, one.found.bench.own = False, False
    one.everything.grid = SimpleNamespace(
        counts=np.ones(50), angle_deg=np.zeros(50), sample_trial=np.zeros(50)
    )
    asked = SimpleNamespace(**{**vars(one), "drive": None, "verdict": verdict})
    curves = {"plain": np.ones(50), "explained": np.ones(50)}
    claimed = replace(claims({("sensor_hysteresis",): 0.9}), curves=curves)
    assert held_against_trials(cast(Any, asked), claimed).kind == kind


@pytest.mark.parametrize(("name", "closes"), [("channel_latency", 0.04), ("sensor_lag", 0.0)])
def test_what_clocks_differ_by_closes_nothing(name: str, closes: float) -> None:
    angle = SimpleNamespace(delays_deg=0.2)
    moved = {name: 1.0}
    scored = SimpleNamespace(named=(name,), moved_deg=moved, angle=angle, fast=None)
    assert _by_chance(cast(Any, scored), taken_off=False) == pytest.approx(closes)
