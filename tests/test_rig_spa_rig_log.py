"""Whole spa-rig logs: every line accounted for, time made whole, nothing guessed."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import naive_rig
from naive_rig import BANNER, data_line, log, rows
from spa_fo.errors import BadInput
from spa_fo.rig.parse_report import FileReport
from spa_fo.rig.spa_rig_log import SpaRigLog, parse_spa_rig_log, read_spa_rig_log
from spa_fo.rig.wire import format_line

ROWS = rows(120)


def parse(data: bytes) -> SpaRigLog:
    result = parse_spa_rig_log(data, "trial.log")
    report = result.report
    assert accounted(report) == report.lines
    assert report.valid == result.t_s.size == result.line.size == result.after_reset.size
    assert np.all(np.diff(result.t_s) > 0)
    return result


def accounted(report: FileReport) -> int:
    return (
        report.valid + report.damaged_lines + report.duplicates + report.comments + report.banners
    )


def counts(report: FileReport) -> dict[str, int]:
    return {reason: item.count for reason, item in report.damaged.items()}


def test_a_clean_log() -> None:
    result = parse(log(ROWS))
    assert result.report.lines == 121
    assert result.report.valid == 120
    assert result.report.damaged == {}
    assert result.t_s[0] == 0.0
    t_us = [int(row.split(b",")[1]) for row in ROWS]
    np.testing.assert_allclose(result.t_s, (np.array(t_us) - t_us[0]) / 1e6, rtol=0, atol=1e-12)
    expected = [float(row.split(b",")[2]) for row in ROWS]
    assert result.columns["cmd_kpa"].tolist() == expected
    assert set(result.columns) == {"cmd_kpa", "p_adc", "flex_adc"}


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_line_ends_and_a_whole_last_line_without_one(end: bytes) -> None:
    data = log(ROWS, end=end)
    assert parse(data).report.valid == 120
    assert parse(data.removesuffix(end)).report.valid == 120
    cut = parse(data.removesuffix(end)[:-1])
    assert cut.report.valid == 119
    assert counts(cut.report) == {"cut": 1}
    assert cut.report.damaged["cut"].first_lines == (121,)


def test_every_kind_of_damage_is_counted_by_reason_with_its_lines() -> None:
    lines = list(ROWS)
    lines[10] = lines[10][:-2] + b"ZZ"
    lines[20] = lines[20][:9]
    lines[30] = b""
    lines[40] = b"#" + lines[40]
    lines[50] = lines[50][:5] + b"\xfe" + lines[50][5:]
    lines[60] = data_line(60, 2200000, "0.00", 100)
    lines[70] = data_line(70, 2400000, "nan", 100, 350)
    lines[80] = data_line(80, 2600012, "20.00", 1024, 350)
    lines[90] = data_line(90, 2**32, "20.00", 100, 350)
    lines[100] = b"# spa-rig 1 adc_bits=1"
    lines[101] = b"# a comment"
    lines.insert(110, lines[109])
    report = parse(log(lines)).report
    assert counts(report) == {
        "checksum": 1,
        "cut": 1,
        "blank": 1,
        "hash": 1,
        "not ascii": 1,
        "fields": 1,
        "not a number": 1,
        "adc range": 1,
        "implausible time": 1,
        "banner": 1,
    }
    assert report.damaged["checksum"].first_lines == (12,)
    assert report.damaged["adc range"].first_lines == (82,)
    assert report.comments == 1
    assert report.duplicates == 1
    assert report.gaps == 10
    assert report.missing_samples == 11
    assert "1 adc range (line 82)" in report.why()


def test_only_the_first_lines_of_a_reason_are_listed() -> None:
    lines = [line[:-1] if i % 10 == 0 else line for i, line in enumerate(ROWS)]
    damage = parse(log(lines)).report.damaged["cut"]
    assert damage.count == 12
    assert damage.first_lines == (2, 12, 22, 32, 42)


def test_gaps_in_seq_are_counted() -> None:
    report = parse(log(ROWS[:30] + ROWS[31:60] + ROWS[75:])).report
    assert (report.gaps, report.missing_samples) == (2, 16)
    assert report.damaged == {}


def test_micros_wraps() -> None:
    lines = rows(120, start_us=2**32 - 1_000_000)
    result = parse(log(lines))
    assert result.report.wraps == 1
    assert result.report.valid == 120
    np.testing.assert_allclose(np.diff(result.t_s), 0.02, atol=1e-4)


def test_a_wrap_is_seen_across_damage_and_a_gap() -> None:
    lines = rows(120, start_us=2**32 - 1_000_000)
    lines[49] = lines[49][:-1]
    result = parse(log(lines[:50] + lines[60:]))
    assert result.report.wraps == 1
    assert result.t_s[-1] == pytest.approx(119 * 0.02, abs=1e-3)


def test_a_banner_in_mid_file_is_a_reset() -> None:
    lines = [*ROWS, BANNER.encode(), *rows(50, seed=3, start_us=700_000)]
    result = parse(log(lines))
    assert result.report.resets == 1
    assert result.report.resets_without_banner == 0
    assert result.report.banners == 2
    assert result.report.gaps == 0
    assert result.after_reset.sum() == 50
    assert not result.after_reset[:120].any()
    first = int(rows(50, seed=3, start_us=700_000)[0].split(b",")[1]) / 1e6
    assert result.t_s[120] == pytest.approx(result.t_s[119] + 0.01 + first, abs=1e-4)


@pytest.mark.parametrize(("before", "estimates"), [(10, 0), (120, 50)])
def test_after_a_reset_at_rest_no_time_is_an_estimate(before: int, estimates: int) -> None:
    """Nothing has been commanded: how long it rested does not matter."""
    lines = [*ROWS[:before], BANNER.encode(), *rows(50, seed=3, start_us=700_000)]
    result = parse(log(lines))
    assert result.columns["cmd_kpa"][before - 1] == (0.0 if before == 10 else 20.0)
    assert (result.report.resets, int(result.after_reset.sum())) == (1, estimates)


def test_seq_going_back_without_a_banner_is_a_reset_too() -> None:
    for damaged in ([], [b"# spa-rig 1 adc_b"], [b"\x00\x00\xf0"]):
        lines = [*ROWS, *damaged, *rows(50, seed=3, start_us=700_000)]
        result = parse(log(lines))
        assert result.report.resets == 1
        assert result.report.resets_without_banner == 1
        assert result.after_reset.sum() == 50


def test_a_reset_on_the_same_clock_line_is_no_repetition() -> None:
    # The board always starts its count at the same time after a reset.
    result = parse(log([*ROWS, *rows(60, seed=9)]))
    assert result.report.resets_without_banner == 1
    assert result.report.valid >= 170


def test_two_resets_and_a_banner_given_twice() -> None:
    banner = BANNER.encode()
    lines = [*rows(40), banner, *rows(40, seed=1), banner, banner, *rows(40, seed=2)]
    result = parse(log(lines))
    assert result.report.resets == 3
    assert result.report.valid == 120
    assert set(result.segment.tolist()) == {0, 1, 2}


def test_a_banner_while_the_clock_runs_on_is_no_reset() -> None:
    result = parse(log([*ROWS[:60], BANNER.encode(), *ROWS[60:]]))
    assert result.report.resets == 0
    assert not result.after_reset.any()
    assert "the clock ran on" in result.report.notes[0]
    assert result.t_s[-1] == pytest.approx(119 * 0.02, abs=1e-3)


def test_one_row_of_wrong_time_does_not_condemn_its_neighbours() -> None:
    for place in (0, 1, 60, 118, 119):
        for seq, t_us in ((place, 9_000_000), (place + 500, 1_000_012 + 20_000 * place)):
            lines = list(ROWS)
            lines[place] = data_line(seq, t_us, "0.00", 100, 350)
            report = parse(log(lines)).report
            assert counts(report) == {"implausible time": 1}, place
            assert report.damaged["implausible time"].first_lines == (place + 2,)
            assert report.valid == 119


def moved(row: bytes, *, seq: int = 0, t_us: int = 0) -> bytes:
    """The row with its seq and time moved, its checksum made good."""
    fields = row.split(b"*")[0].decode().split(",")
    return data_line(int(fields[0]) + seq, int(fields[1]) + t_us, *fields[2:])


def test_two_wrong_rows_in_a_row_are_not_believed_either() -> None:
    for shift in (-1_000_000, 3_000_000):
        lines = [moved(row, t_us=shift) if i in (60, 61) else row for i, row in enumerate(ROWS)]
        report = parse(log(lines)).report
        assert counts(report) == {"implausible time": 2}
        assert (report.valid, report.pauses, report.resets) == (118, 0, 0)


@pytest.mark.parametrize("shift", [-30_000, 30_000])
def test_a_row_out_of_turn_is_implausible(shift: int) -> None:
    lines = list(ROWS)
    lines[60] = moved(lines[60], t_us=shift)
    assert counts(parse(log(lines)).report) == {"implausible time": 1}


def test_a_clock_that_restarts_while_seq_goes_on_is_a_reset() -> None:
    lines = [*ROWS[:60], *(moved(row, t_us=-1_500_000) for row in ROWS[60:])]
    report = parse(log(lines)).report
    assert (report.valid, report.resets_without_banner, report.pauses) == (120, 1, 0)


def test_a_resonator_that_drifts_over_a_long_gap_is_no_pause() -> None:
    lines = [*ROWS[:60], *(moved(row, seq=2000, t_us=2000 * 20_080) for row in ROWS[60:])]
    report = parse(log(lines)).report
    assert (report.valid, report.gaps, report.missing_samples) == (120, 1, 2000)
    assert report.pauses == 0


def test_a_real_pause_condemns_nobody() -> None:
    late = [moved(row, t_us=3_000_000) for row in ROWS[60:]]
    result = parse(log(ROWS[:60] + late))
    assert result.report.valid == 120
    assert result.report.pauses == 1
    assert result.report.damaged == {}
    assert result.t_s[60] - result.t_s[59] == pytest.approx(3.02, abs=1e-3)


def test_a_sample_late_by_less_than_a_period_is_kept() -> None:
    lines = list(ROWS)
    lines[50] = moved(lines[50], t_us=17_000)
    assert parse(log(lines)).report.valid == 120


def test_an_irregular_loop_is_read_as_it_is() -> None:
    rng = np.random.default_rng(0)
    t_us = 1_000_000 + np.cumsum(rng.uniform(2_000, 60_000, 200)).astype(int)
    lines = [data_line(i, int(t), "5.00", 100, 350) for i, t in enumerate(t_us)]
    assert parse(log(lines)).report.valid == 200


def test_repeated_lines_are_duplicates() -> None:
    twice = [line for line in ROWS for _ in range(2)]
    report = parse(log(twice)).report
    assert (report.valid, report.duplicates, report.resets) == (120, 120, 0)
    block = parse(log(ROWS[:60] + ROWS[40:60] + ROWS[60:])).report
    assert (block.valid, block.duplicates, block.resets) == (120, 20, 0)


def test_the_same_seq_with_other_values_is_no_duplicate() -> None:
    lines = list(ROWS)
    lines.insert(60, data_line(59, lines[59].split(b",")[1].decode(), "0.00", 1, 1))
    report = parse(log(lines)).report
    assert (report.valid, report.duplicates, counts(report)) == (120, 0, {"implausible time": 1})


@pytest.mark.parametrize("n", [1, 2, 3])
def test_very_short_logs(n: int) -> None:
    assert parse(log(ROWS[:n])).report.valid == n


def test_what_the_port_held_before_the_banner_is_damage() -> None:
    data = b"93,354*24\r\n\xff\xf0\r\n" + log(ROWS, end=b"\r\n")
    report = parse(data).report
    assert report.valid == 120
    assert report.resets == 0
    assert counts(report) == {"checksum": 1, "not ascii": 1}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "trial.log: is empty; expected a spa-rig log"),
        (b"\n\n", "trial.log: line 1: expected the banner"),
        (bytes(range(256)) * 20, "trial.log: line 1: expected the banner"),
        (log(ROWS, "hello"), "trial.log: line 1: expected the banner"),
        (log(ROWS, BANNER.replace("spa-rig 1", "spa-rig 7")), "line 1: expected '# spa-rig 1"),
        (log(ROWS, BANNER.replace("=10", "=1O")), "line 1: adc_bits=1O; expected"),
        (b"\n".join(ROWS), "trial.log: line 1: expected the banner"),
        (b"\n".join([*ROWS, BANNER.encode(), *ROWS]), "trial.log: line 1: expected the banner"),
        (BANNER.encode(), "holds no valid sample in 1 lines"),
        (log([row[:-2] + b"00" for row in ROWS]), "holds no valid sample in 121 lines: 120 check"),
        (BANNER.encode()[:-8] + b"\n", "line 1: unknown column"),
    ],
)
def test_logs_that_cannot_be_used(data: bytes, message: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_spa_rig_log(data, "trial.log")
    text = str(caught.value)
    assert message in text
    assert text.isprintable()
    assert len(text) < 400


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"no\.log: cannot be read"):
        read_spa_rig_log(tmp_path / "no.log")


@given(st.binary(max_size=400))
def test_arbitrary_bytes_never_crash(data: bytes) -> None:
    for text in (data, BANNER.encode() + b"\n" + data, log(ROWS[:5]) + data):
        with contextlib.suppress(BadInput):  # anything else fails the test
            parse(text)


@st.composite
def damaged_logs(draw: st.DrawFn) -> bytes:
    lines = list(ROWS[:40])
    for _ in range(draw(st.integers(1, 8))):
        at = draw(st.integers(0, len(lines) - 1))
        line = lines[at]
        kind = draw(st.sampled_from(["cut", "twice", "drop", "byte", "insert", "join", "banner"]))
        if kind == "cut":
            lines[at] = line[: draw(st.integers(0, len(line)))]
        elif kind == "twice":
            lines.insert(draw(st.integers(at, min(at + 3, len(lines)))), line)
        elif kind == "drop":
            del lines[at]
        elif kind == "byte" and line:
            i = draw(st.integers(0, len(line) - 1))
            lines[at] = line[:i] + bytes([draw(st.integers(0, 255))]) + line[i + 1 :]
        elif kind == "insert":
            i = draw(st.integers(0, len(line)))
            lines[at] = line[:i] + bytes([draw(st.integers(1, 255))]) + line[i:]
        elif kind == "join" and at + 1 < len(lines):
            lines[at : at + 2] = [line + lines[at + 1]]
        elif kind == "banner":
            lines.insert(at, b"# a comment")
        if len(lines) < 10:
            break
    return log(lines, end=draw(st.sampled_from([b"\n", b"\r\n"])))


@settings(max_examples=150, deadline=None)
@given(damaged_logs())
def test_damage_never_makes_a_row_that_was_not_sent(data: bytes) -> None:
    result = parse(data)
    sent = {row: i for i, row in enumerate(ROWS)}
    lines = data.replace(b"\r\n", b"\n").split(b"\n")
    kept = [lines[number - 1] for number in result.line]
    assert all(line in sent for line in kept)
    t_us = [int(line.split(b",")[1]) for line in kept]
    np.testing.assert_allclose(result.t_s, (np.array(t_us) - t_us[0]) / 1e6, rtol=0, atol=1e-9)
    # Every whole line that follows the first is there, once.
    whole = set(naive_rig.naive_valid_lines(data)) & set(sent)
    assert len(kept) == len(set(kept))
    assert len(whole) - len(kept) <= 2  # a jump in the last rows stays unconfirmed


def test_swapped_bytes_of_seq_and_time_are_caught() -> None:
    # The checksum cannot see a swap: the clock must.
    accepted = damaged = 0
    for place in range(20, 100, 7):
        line = ROWS[place]
        for i in range(line.index(b",", 4) - 5):
            swapped = line[:i] + line[i + 1 : i + 2] + line[i : i + 1] + line[i + 2 :]
            if swapped == line:
                continue
            lines = list(ROWS)
            lines[place] = swapped
            report = parse(log(lines)).report
            damaged += 1
            accepted += report.valid == 120
            assert report.valid >= 119
    assert damaged > 50
    assert accepted == 0


def test_a_column_of_the_board_s_own_is_said_to_be_passed_over() -> None:
    whole = parse(log(ROWS))
    banner = BANNER.replace("flex_adc", "flex_adc,temp_dc")
    warm = [format_line([*row[:-3].decode().split(","), "-3.5"]) for row in ROWS]
    found = parse(log(warm, banner))
    assert found.columns.keys() == whole.columns.keys()
    for name, values in whole.columns.items():
        np.testing.assert_array_equal(found.columns[name], values)
    assert found.report.notes == ("columns passed over: temp_dc",)


def test_the_tail_of_a_line_may_hold_by_chance_before_the_banner() -> None:
    """What is lost of it has a checksum of 0, as 11 has; whole lines are another matter."""
    row = data_line("11", "20000", "0.00", "93", "354")
    tail = row.split(b"11", 1)[1]
    found = parse(tail + b"\n" + log(ROWS))
    assert counts(found.report) == {"not a number": 1}
    assert found.t_s.size == len(ROWS)
    with pytest.raises(BadInput, match="expected the banner"):
        parse_spa_rig_log(b"\n".join([row, row]) + b"\n" + log(ROWS), "trial.log")
