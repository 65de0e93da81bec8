"""A drive that lags and a pressure sensor that does: alike in the pressure, not in the angle."""

import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_cases import KPA, SIXTY, X, campaign_data, model, step_release, trials
from spa_fo import simulate
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.decide.examine import examine
from spa_fo.gap.decide.weigh import _weighed_drive, decide_drive
from spa_fo.gap.fit.bench import bench_for
from spa_fo.gap.fit.pressure import lagged
from spa_fo.gap.search.drive import QUICK_S, Drive, examine_drive
from spa_fo.gap.search.drive_by_angle import joined
from spa_fo.gap.search.explanations import explain
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import IDS, LIBRARY
from spa_fo.plant.memory import FINEST_STEP_S

LAG_S = 0.06
OTHERS = tuple(name for name in IDS if name not in ("line_lag", "creep"))


def behind(t_s, values, lag_s):
    """Follow values that hold until the next time, by a plain loop."""
    seen = np.zeros_like(values)
    for i in range(1, values.size):
        decay = np.exp(-(t_s[i] - t_s[i - 1]) / lag_s)
        seen[i] = values[i - 1] + (seen[i - 1] - values[i - 1]) * decay
    return seen


def campaign(drive_lags: bool, lag_s: float = LAG_S) -> Evidence:
    """Trials whose pressure reads late: as the drive was late, or as the sensor is."""
    rng = np.random.default_rng(5)
    own = []
    for trial in trials(*[step_release(SIXTY) for _ in range(4)]):
        late = behind(trial.t_s, trial.command_kpa, lag_s)
        true = late if drive_lags else trial.command_kpa
        hold = "linear" if drive_lags else "zero"
        angle = np.degrees(simulate(trial.t_s, true / KPA, *X, hold=hold))
        own.append(
            replace(
                trial,
                pressure_kpa=late + 0.1 * rng.normal(size=late.size),
                angle_deg=angle + 0.05 * rng.normal(size=late.size),
            )
        )
    return collect(campaign_data(own))


def told_apart(evidence: Evidence, others: tuple[str, ...] = OTHERS) -> tuple[Drive, Drive]:
    alone = examine_drive(evidence, others, X)
    bench = bench_for(evidence, X, own=False, pressure_kpa=alone.pressure_kpa)
    return alone, joined(alone, explain(bench, others))


@pytest.mark.parametrize("drive_lags", [False, True])
def test_the_angle_says_whether_the_drive_was_late(drive_lags):
    alone, known = told_apart(campaign(drive_lags))
    lead = [
        f.fits[("line_lag",)].evidence.max() - f.fits[()].evidence.max() for f in (alone, known)
    ]
    # The pressure hardly says: 2.4 nats once tempered, most of them for what a line has beside.
    assert abs(lead[0]) < 16.0
    if drive_lags:
        assert lead[1] > lead[0] + 10.0
        assert known.best.ids == ("line_lag",)
        assert known.gap_deg > 0.3
    else:
        assert lead[1] < lead[0] - 10.0
        assert known.best.ids == ()
        assert known.best.z[-1] == pytest.approx(LAG_S, abs=0.01)
        assert known.gap_deg < 0.05


@pytest.mark.parametrize("drive_lags", [False, True])
def test_a_sensor_that_need_not_lag_is_tried_without(drive_lags):
    evidence = campaign(drive_lags)
    alone, known = told_apart(evidence)
    shared = [f for f in alone.fits.values() if f.z[-1] > QUICK_S]
    assert any(fit.prompt is not None for fit in shared)
    for fit in shared:
        if fit.prompt is not None:
            assert fit.prompt.z[-1] == 0.0
            assert fit.prompt.evidence.max() <= fit.evidence.max() + 0.01
    # All of it may be the line's, and hardly any of it a command's that nothing filters.
    line, command = (alone.fits[ids] for ids in (("line_lag",), ()))
    lag_of_line = line if line.prompt is None else line.prompt
    assert lag_of_line.z[0] == pytest.approx(LAG_S, abs=0.01)
    if command.prompt is not None:
        assert command.prompt.evidence.max() < command.evidence.max() - 100.0
    assert known.best.z[-1] < QUICK_S if drive_lags else known.best.z[-1] > QUICK_S


@pytest.mark.parametrize("otherwise", [False, True])
def test_the_angle_is_explained_again_where_it_is_driven_otherwise(
    otherwise: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also by the same effects: their share of a lag may be another."""
    module, times = sys.modules["spa_fo.gap.decide.examine"], []

    def driven(drive: Drive, _: object) -> Drive:
        kpa = drive.pressure_kpa + (0.5 if otherwise else 0.0)
        return replace(drive, pressure_kpa=kpa)

    def counted(*asked: object) -> object:
        times.append(asked)
        return explain(*asked)

    monkeypatch.setattr(module, "joined", driven)
    monkeypatch.setattr(module, "explain", counted)
    data = campaign(True).data
    examine(data, replace(model(), campaign="earlier"), OTHERS, np.random.default_rng(1))
    assert len(times) == (2 if otherwise else 1)


@pytest.mark.parametrize(("of_gap", "named"), [(1.1, ()), (0.4, ("line_lag",))])
def test_a_drive_that_moves_less_than_the_floor_is_the_benchs_own(of_gap, named):
    _, known = told_apart(campaign(True))
    floor_deg = of_gap * known.gap_deg
    found, _, unknown = _weighed_drive(known, campaign(True), *(floor_deg,) * 3, 0.0)
    assert max(found, key=found.get) == named
    assert found[named] > 0.5 > unknown


def drooping(t_s, command_kpa, fraction, recovery_s):
    """Let each rise lack a fraction that comes back, by a plain loop."""
    seen, missing = np.zeros_like(command_kpa), 0.0
    for i in range(1, t_s.size):
        missing *= np.exp(-(t_s[i] - t_s[i - 1]) / recovery_s)
        missing += fraction * max(command_kpa[i] - command_kpa[i - 1], 0.0)
        missing = min(missing, command_kpa[i])
        seen[i] = command_kpa[i] - missing
    return seen


def test_a_part_of_a_pressure_counts_by_what_it_moves_the_angle_by():
    """A quick lag misses far more kPa, for moments that an angle hardly feels."""
    quick_s, others = 0.08, tuple(n for n in OTHERS if n != "supply_droop")
    rng, own, missed_kpa = np.random.default_rng(5), [], []
    for trial in trials(*[step_release(SIXTY) for _ in range(4)]):
        late = behind(trial.t_s, trial.command_kpa, quick_s)
        both = behind(trial.t_s, drooping(trial.t_s, trial.command_kpa, 0.03, 2.5), quick_s)
        missed_kpa.append([np.std(late - trial.command_kpa), np.std(both - late)])
        angle = np.degrees(simulate(trial.t_s, both / KPA, *X, hold="linear"))
        read = both + 0.1 * rng.normal(size=both.size)
        noisy = angle + 0.05 * rng.normal(size=angle.size)
        own.append(replace(trial, pressure_kpa=read, angle_deg=noisy))
    quick_kpa, slow_kpa = np.mean(missed_kpa, axis=0)
    assert quick_kpa > 6.0 * slow_kpa
    evidence = collect(campaign_data(own))
    _, drive = told_apart(evidence, others)
    least_deg = 0.1 * drive.gap_deg
    found, fits, _ = _weighed_drive(drive, evidence, 3.0 * least_deg, least_deg, least_deg, 0.0)
    assert max(found, key=found.get) == ("line_lag", "supply_droop")
    moved_deg = fits[("line_lag", "supply_droop")].moved_deg
    assert moved_deg["supply_droop"] > 0.3 * moved_deg["line_lag"]


def test_no_sensor_is_as_late_as_a_slow_line():
    """Of which the library then knows nothing."""
    drives = [name for name in IDS if LIBRARY[name].stage == "drive"]
    drive = examine_drive(campaign(True, 0.8), drives, X)
    assert drive.best.z[-1] <= 5.0 * SETTINGS.pressure_lag_s
    assert drive.best.left_kpa > 0.05 * KPA
    _, _, unknown = decide_drive(drive, campaign(True, 0.8), 0.5)
    assert unknown > 0.9


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(0.0, 200.0), min_size=3, max_size=40),
    st.floats(0.002, 2.0),
    st.integers(1, 2),
)
def test_a_lag_is_that_of_small_steps(levels, lag_s, parts):
    cells = np.array(levels)
    starts = np.array([0, cells.size]) if parts == 1 else np.array([0, 2, cells.size])
    fine = 400
    expected = []
    for first, end in pairwise(starts):
        seen = cells[first]
        decay = np.exp(-FINEST_STEP_S / fine / lag_s)
        for level in cells[first:end]:
            path = level + (seen - level) * decay ** np.arange(fine + 1)
            expected.append(np.mean((path[:-1] + path[1:]) / 2.0))
            seen = path[-1]
    np.testing.assert_allclose(lagged(cells, starts, lag_s), expected, rtol=1e-4, atol=1e-3)


def test_a_sensor_without_lag_shows_the_pressure():
    cells = np.array([0.0, 5.0, 5.0])
    np.testing.assert_array_equal(lagged(cells, np.array([0, 3]), 0.0), cells)
