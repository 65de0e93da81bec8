"""Repeats in logs that others measured: sliced as they are, judged by a rule for false causes."""

from __future__ import annotations

import csv
import hashlib
import io
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spa_fo.rig import read_campaign, read_trials

ROOT = Path(__file__).resolve().parent.parent
BENCHMARKS = ROOT / "benchmarks"
MODULES = ("measured_repeats", "repeated_commands", "real_data")
HEADER = b"t_s,command_p1_psi,pressure_p1_psi,angle_deg\r\n"
INTERVAL, ON, OFF, LEAD = 0.1, 3.0, 4.0, 1.0


@pytest.fixture(scope="module")
def judged() -> Iterator[Any]:
    """The benchmark as a module; its neighbours are found as when it is run."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        import measured_repeats

        yield measured_repeats
    finally:
        sys.path.remove(str(BENCHMARKS))
        for name in MODULES:
            sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def layout(judged: Any) -> Any:
    return sys.modules["repeated_commands"]


def pulses(count: int, late_s: float = 0.0) -> bytes:
    """Write a log of pulses 1 -> 6 psi; the angle at rest is 20 deg, 5 more in each pulse."""
    lines = []
    for n in range(round((2.0 + count * (ON + OFF)) / INTERVAL)):
        time = n * INTERVAL
        cycle, since = divmod(time - 2.0 - late_s + 1e-9, ON + OFF)
        on = cycle >= 0 and since < ON
        angle = 20.0 + (5.0 * (cycle + 1) if on else 0.0)
        lines.append(
            b"%.4f,%.3f,%.3f,%.3f\r\n" % (time, 6.0 if on else 1.0, 7.1 if on else 2.1, angle)
        )
    return HEADER + b"".join(lines)


@pytest.fixture
def series(layout: Any) -> Any:
    return layout.Series(
        "pulse",
        "pulses 1 to 6 psi",
        "made up",
        ("log.csv",),
        layout.ARM,
        rest_command=1.0,
        rest_pressure=2.1,
        cycles=((2,), (3,)),
    )


def test_a_log_is_sliced_into_its_cycles_byte_by_byte(layout: Any, series: Any) -> None:
    log = pulses(4)
    cycles = layout.slice_cycles(log, series)
    assert len(cycles) == 4
    assert all(cycle.startswith(HEADER) for cycle in cycles)
    together = b"".join(cycle.removeprefix(HEADER) for cycle in cycles)
    whole = log.removeprefix(HEADER)
    before = whole.index(together)
    assert layout.numbers(HEADER + whole[:before], "t_s")[0][-1] == pytest.approx(2.0 - LEAD - 0.1)
    for cycle in cycles:
        time, command = layout.numbers(cycle, "t_s", "command_p1_psi")
        (rise,) = layout.cycle_starts(command, 1.25)
        assert time[rise] - time[0] == pytest.approx(LEAD)


def test_the_last_cycle_is_as_long_as_the_one_before(layout: Any, series: Any) -> None:
    rest = b"".join(b"%.4f,1.000,2.100,20.000\r\n" % (23.0 + 0.1 * n) for n in range(200))
    *_, before, last = layout.slice_cycles(pulses(3) + rest, series)
    assert last.count(b"\n") == before.count(b"\n")


def test_repeats_are_the_cycles_that_were_chosen(layout: Any, series: Any, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(pulses(4))
    cycles = layout.slice_cycles(pulses(4), series)
    each = layout.repeats_of(series, tmp_path)
    assert [(r.name, r.logs) for r in each] == [
        ("cycle2", (cycles[1],)),
        ("cycle3", (cycles[2],)),
    ]
    (both,) = layout.repeats_of(replace(series, cycles=((2, 3),)), tmp_path)
    assert both.name == "cycle2_3"
    assert both.logs == (cycles[1], cycles[2])


def test_a_log_that_is_a_repeat_keeps_its_bytes(layout: Any, series: Any, tmp_path: Path) -> None:
    logs = {"one.csv": pulses(1), "two.csv": pulses(1, late_s=0.3)}
    for name, log in logs.items():
        (tmp_path / name).write_bytes(log)
    repeats = layout.repeats_of(replace(series, files=tuple(logs), cycles=()), tmp_path)
    assert [repeat.logs for repeat in repeats] == [(log,) for log in logs.values()]


def test_a_repeat_is_laid_out_as_a_campaign(layout: Any, series: Any, tmp_path: Path) -> None:
    source = tmp_path / "data"
    source.mkdir()
    (source / "log.csv").write_bytes(pulses(4))
    (repeat,) = layout.repeats_of(replace(series, cycles=((2, 4),)), source)
    folder = layout.lay_out(series, repeat, "pulse_2_4", tmp_path / "raw")
    sums = dict(
        reversed(line.split("  ")) for line in (folder / "SHA256SUMS").read_text().splitlines()
    )
    assert sums == {
        f"{n}.csv": hashlib.sha256(log).hexdigest() for n, log in enumerate(repeat.logs, 1)
    }
    campaign = read_campaign(folder)
    data = read_trials(campaign)
    assert campaign.name == "pulse_2_4"
    assert [trial.started_s for trial in data.trials] == [0.0, 14.0]
    for trial, height in zip(data.trials, (10.0, 20.0), strict=True):
        assert trial.command_kpa is not None
        assert trial.pressure_kpa is not None
        assert trial.command_kpa.max() == pytest.approx(5.0 * 6.894757)
        assert trial.pressure_kpa.min() == pytest.approx(0.0, abs=1e-9)
        assert [trial.angle_deg.min(), trial.angle_deg.max()] == pytest.approx([0.0, height])
    assert (source / "log.csv").read_bytes() == pulses(4)


def test_a_command_that_is_no_pressure_is_left_out(layout: Any) -> None:
    pneunet = next(s for s in layout.SERIES if s.name == "pneunet")
    columns = layout.configuration(pneunet, "name", ["1.csv"], [0.0])["log"]["columns"]
    assert set(columns) == {"time", "pressure", "angle"}
    assert pneunet.signal == "pressure"


def test_every_series_has_a_name_of_its_own_and_no_early_cycle(layout: Any) -> None:
    assert len({s.name for s in layout.SERIES}) == len(layout.SERIES)
    for one in layout.SERIES:
        assert len(one.cycles) > 1 or len(one.files) > 1
        assert all(number >= 3 for repeat in one.cycles for number in repeat)


def test_marks_are_jumps_or_else_the_turn(judged: Any) -> None:
    time = np.arange(6.0)
    assert judged.marks(time, np.array([0, 0, 5, 5, 0, 0.0])).tolist() == [2.0, 4.0]
    assert judged.marks(time, np.array([0, 1, 2, 3, 2, 1.0])).tolist() == [3.0]


def test_repeats_are_held_against_each_other_from_mark_to_mark(judged: Any) -> None:
    """A pulse pressed later and held longer is no other pulse."""

    def track(rise: float, fall: float, height: float) -> Any:
        t = np.arange(0.0, 20.0, 0.05)
        angle = np.where((t >= rise) & (t < fall), np.minimum(t - rise, 2.0) * height, 0.0)
        return judged.Track(t, angle, np.array([rise, fall]))

    one, later = track(2.0, 8.0, 10.0), track(3.0, 10.0, 10.0)
    assert judged.rms(judged.differences(one, later)) < 0.5  # of one sample at the jump
    higher = judged.differences(one, track(2.0, 8.0, 11.0))
    assert higher.max() == pytest.approx(2.0)
    assert higher.min() == pytest.approx(0.0)
    with pytest.raises(ValueError, match="expected 2 marks, not 1"):
        judged.differences(one, replace(one, marks_s=np.array([1.0])))


def says(judged: Any, kind: str, *sets: set[str]) -> Any:
    return judged.Answer(kind, tuple(frozenset(ids) for ids in sets), 0.9, 1.0, 0.1)


def pair(judged: Any, of_a: Any, of_copy: Any, of_b: Any, **options: Any) -> Any:
    sizes = {"swing_deg": 50.0, "between_deg": 1.0, "on_a_deg": 2.0, "on_b_deg": 2.1, **options}
    return judged.Pair("pulse", "cycle3", "cycle4", **sizes, of_a=of_a, of_copy=of_copy, of_b=of_b)


CREEP, BOTH = {"creep"}, {"creep", "leak"}


@pytest.mark.parametrize(
    ("of_a", "of_b", "is_false"),
    [
        (("unknown",), ("cause", CREEP), True),
        (("no_gap",), ("cause", CREEP), True),
        (("error",), ("cause", CREEP), True),
        (("cause", CREEP), ("cause", CREEP), False),
        (("ambiguous", {"leak"}, CREEP), ("cause", CREEP), False),
        (("unknown", CREEP), ("cause", CREEP), False),
        (("cause", CREEP), ("cause", BOTH), True),
        (("cause", BOTH), ("cause", CREEP), True),
        (("unknown",), ("ambiguous", CREEP, {"leak"}), False),
        (("unknown",), ("unknown", CREEP), False),
        (("unknown",), ("no_gap",), False),
        (("unknown",), ("error",), False),
    ],
)
def test_a_false_cause_is_one_that_appears_between_repeats(
    judged: Any, of_a: Any, of_b: Any, is_false: bool
) -> None:
    own, other = says(judged, *of_a), says(judged, *of_b)
    assert pair(judged, own, says(judged, "unknown"), other).false_cause is is_false
    same = pair(judged, own, other, other)
    assert same.of_no_difference is is_false
    assert not pair(judged, own, says(judged, "unknown"), other).of_no_difference


def test_repeats_are_alike_within_a_share_of_the_swing(judged: Any) -> None:
    unknown = says(judged, "unknown")
    near, far = (
        pair(judged, unknown, unknown, unknown, between_deg=share * 50.0) for share in (0.04, 0.06)
    )
    assert near.alike
    assert not far.alike


def test_an_answer_is_read_with_the_probability_of_what_it_says(judged: Any) -> None:
    document = {
        "verdict": {"kind": "cause", "sets": [["leak", "creep"]]},
        "causes": [
            {"set": ["creep", "leak"], "probability": 0.8},
            {"set": ["unknown"], "probability": 0.15},
            {"set": ["none"], "probability": 0.05},
        ],
        "gap": {"rmse_deg": 1.0, "noise_floor_deg": 0.1},
    }
    assert judged.answer(document).words == "cause: creep + leak (0.80)"
    document["verdict"] = {"kind": "unknown", "sets": []}
    assert judged.answer(document).probability == pytest.approx(0.15)
    document["verdict"] = {"kind": "no_gap", "sets": []}
    assert judged.answer(document).probability == pytest.approx(0.05)


def test_an_error_is_an_answer_with_its_message(judged: Any, tmp_path: Path) -> None:
    said = judged.ask(tmp_path / "nowhere", tmp_path / "model.json")
    assert said.kind == judged.ERROR
    assert said.message.startswith("BadInput: model.json")
    assert str(tmp_path) not in said.message


def test_the_page_names_every_false_cause_and_every_error(judged: Any, series: Any) -> None:
    unknown = says(judged, "unknown")
    wrong = pair(judged, unknown, unknown, says(judged, "cause", CREEP))
    broken = replace(
        pair(judged, unknown, unknown, judged.Answer("error", message="ValueError: no")), b="cycle5"
    )
    page = judged.page({series: []}, [wrong, broken], "make repeats")
    assert "named in 1 of 2 pairs**" in page
    assert "0 of the 1 are named of a copy" in page
    assert "| cause: creep (0.90) | unknown (0.90) |" in page
    assert "| ValueError: no |" in page.replace("  ", "")
    rows = list(csv.DictReader(io.StringIO(judged.table_of_pairs([wrong, broken]))))
    assert [row["false_cause"] for row in rows] == ["1", "0"]
    assert rows[1]["error_of_b"] == "ValueError: no"


def test_the_measured_logs_hold_the_repeats_that_are_named(layout: Any, shared_data: Path) -> None:
    """Known of the data: six cycles a log, and a log is a repeat where there are several."""
    for one in layout.SERIES:
        repeats = layout.repeats_of(one, shared_data)
        assert len(repeats) == len(one.cycles or one.files)
        for repeat in repeats:
            for log in repeat.logs:
                time, command = layout.numbers(log, "t_s", one.columns.repeated)
                assert 14.0 < np.ptp(time) < 70.0
                assert np.ptp(command) > 3.0
                if one.lead_s and one.cycles:
                    assert np.unique(np.round(command, 1)).size == 2
        if one.cycles:
            log = (shared_data / one.files[0]).read_bytes()
            assert len(layout.slice_cycles(log, one)) == 6


def test_a_measured_pair_is_judged(
    judged: Any, shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The later pulses repeat well, and the model misses both of them alike."""
    found = next(s for s in judged.SERIES if s.name == "pulse10")
    found = replace(found, cycles=((5,), (6,)))
    with monkeypatch.context() as patched:  # one diagnosis will do
        patched.setattr(judged, "ask", lambda *_: says(judged, "unknown"))
        a, b = (judged.fit(found, r, tmp_path) for r in judged.repeats_of(found, shared_data))
    one = judged.compare(found, a, b)
    assert (one.a, one.b) == ("cycle5", "cycle6")
    assert one.alike
    assert one.between_deg < 0.2
    assert one.on_a_deg == pytest.approx(one.on_b_deg, rel=0.2)
    assert one.of_b.kind in judged.KINDS
    assert one.of_b.gap_deg == pytest.approx(one.on_b_deg, rel=0.05)


def test_every_ordered_pair_is_judged_with_the_model_of_the_first(
    judged: Any, series: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "log.csv").write_bytes(pulses(5))
    asked = []

    def ask(campaign: Path, model: Path) -> Any:
        asked.append((campaign.name, model.stem))
        return says(judged, "unknown")

    monkeypatch.setattr(judged, "ask", ask)
    three = replace(series, cycles=((3,), (4,), (5,)))
    _, pairs = judged.run(three, tmp_path, tmp_path / "work", lambda _: None)
    assert len({(one.a, one.b) for one in pairs}) == len(pairs) == 6
    assert set(asked) == {
        (f"pulse_cycle{b}{copy}", f"pulse_cycle{a}")
        for a in (3, 4, 5)
        for b, copy in ((3, ""), (4, ""), (5, ""), (a, "_copy"))
    }
