"""Anyone's csv log, by configuration alone."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import naive_rig
from spa_fo.errors import BadInput
from spa_fo.rig.csv_log import CsvLog, longest_increasing, read_csv_log
from spa_fo.rig.log_format import Column, LogFormat

NAMED = LogFormat(
    "csv",
    columns={"time": Column("t", "s"), "command": Column("p", "kPa"), "angle": Column("a", "deg")},
)
INDEXED = LogFormat(
    "csv",
    header=False,
    columns={"time": Column(1, "s"), "command": Column(2, "kPa"), "angle": Column(3, "deg")},
)


def read(tmp_path: Path, text: str | bytes, log: LogFormat = INDEXED) -> CsvLog:
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    result = read_csv_log(path, log)
    report = result.report
    total = report.valid + report.damaged_lines + report.duplicates + report.comments
    assert total + report.banners == report.lines
    assert np.all(np.diff(result.t_s) > 0)
    assert all(np.isfinite(array).all() for array in result.columns.values())
    assert result.line.size == report.valid
    return result


def counts(log: CsvLog) -> dict[str, int]:
    return {reason: item.count for reason, item in log.report.damaged.items()}


def test_columns_by_name_in_any_order(tmp_path: Path) -> None:
    result = read(tmp_path, "a,t,x,p\n1,0.0,?,10\n2,0.1,,20\n", NAMED)
    assert result.t_s.tolist() == [0.0, 0.1]
    assert result.columns["angle"].tolist() == [1.0, 2.0]
    assert result.columns["command"].tolist() == [10.0, 20.0]


def test_columns_by_index_beside_a_header(tmp_path: Path) -> None:
    log = LogFormat("csv", columns=INDEXED.columns)
    assert read(tmp_path, "t,p\n0,1,2\n1,2,3\n", log).report.valid == 2


@pytest.mark.parametrize(
    ("delimiter", "text"),
    [
        (";", "0;1;2\n1;2;3\n"),
        ("|", "0|1|2\n1|2|3\n"),
        ("\t", "0\t1\t2\n1\t2\t3\n"),
        (" ", "  0   1 2\n1\t 2   3  \n"),
        ("whitespace", "0 1\t2\n1 2 3\n"),
        (" | ", "0 | 1 | 2\n1 | 2 | 3\n"),
        ("::", "0::1::2\r\n1::2::3\r\n"),
        (",", '"0", "1" ,2\n 1 ,2,3\n'),
    ],
)
def test_any_delimiter(tmp_path: Path, delimiter: str, text: str) -> None:
    result = read(tmp_path, text, LogFormat("csv", delimiter, False, INDEXED.columns))
    assert result.columns["angle"].tolist() == [2.0, 3.0]
    assert result.t_s.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("role", "unit", "value"),
    [
        ("time", "s", 3.0),
        ("time", "ms", 0.003),
        ("time", "us", 3e-6),
        ("command", "Pa", 0.003),
        ("command", "hPa", 0.3),
        ("command", "kPa", 3.0),
        ("command", "bar", 300.0),
        ("command", "psi", 3 * 6.894757293168361),
        ("command", "1", 3.0),
        ("angle", "deg", 3.0),
        ("angle", "rad", math.degrees(3.0)),
    ],
)
def test_units(tmp_path: Path, role: str, unit: str, value: float) -> None:
    assert INDEXED.columns is not None
    columns = dict(INDEXED.columns)
    place = columns[role].column
    columns[role] = Column(place, unit)
    result = read(tmp_path, "0,0,0\n3,3,3\n", LogFormat("csv", header=False, columns=columns))
    found = result.t_s[1] if role == "time" else result.columns[role][1]
    assert found == pytest.approx(value, rel=1e-15)


def test_scale_and_offset_come_before_the_unit(tmp_path: Path) -> None:
    columns = {"time": Column(1, "s"), "angle": Column(2, "deg", scale=2.0, offset=1.0)}
    columns["pressure"] = Column(3, "hPa", offset=-1011.65)
    log = LogFormat("csv", header=False, columns=columns)
    result = read(tmp_path, "0,10,1011.65\n1,20,2011.65\n", log)
    assert result.columns["angle"].tolist() == [21.0, 41.0]
    np.testing.assert_allclose(result.columns["pressure"], [0.0, 100.0], atol=1e-10)


def test_each_row_left_out_is_counted_by_reason(tmp_path: Path) -> None:
    text = "\n".join(
        [
            "# a comment",
            "0,1,2",
            "0.1,1",
            "0.2,nan,2",
            "0.3,1,",
            "",
            "0.4,1,x",
            "0.5,1,1_0",
            "0.6,1,inf",
            "0.7,1,1.234.567",
            *(f"{1 + i / 10:.1f},1,2,ragged,,," for i in range(200)),
            "99,1,2",
            "22,1,2",
            "22,1,2",
            "22,1,7",
            "23,1,2",
            "24,1,4",
            "25,1,2",
        ]
    )
    result = read(tmp_path, text)
    assert counts(result) == {
        "fields": 1,
        "nan": 2,
        "empty field": 1,
        "blank": 1,
        "not a number": 2,
        "thousands dots": 1,
        "backward time": 1,
        "repeated time": 1,
        "cut": 1,
    }
    assert result.report.duplicates == 1
    assert result.report.comments == 1
    assert result.report.damaged["cut"].first_lines == (217,)
    assert result.report.damaged["backward time"].first_lines == (211,)


def test_a_last_line_without_end_counts_if_its_columns_are_whole(tmp_path: Path) -> None:
    assert read(tmp_path, "0,1,2\n1,2,3\n2,3,4,").report.valid == 3
    assert counts(read(tmp_path, "0,1,2\n1,2,3\n2,3,4")) == {"cut": 1}
    assert counts(read(tmp_path, "0,1,2\n1,2,3\n2,3")) == {"cut": 1}


def test_a_decimal_comma_is_named(tmp_path: Path) -> None:
    log = LogFormat("csv", ";", False, INDEXED.columns)
    with pytest.raises(BadInput, match="2 decimal comma"):
        read(tmp_path, "0,0;1;2\n0,1;1;2\n", log)


def test_thousands_dots_are_refused_where_they_are_the_rule(tmp_path: Path) -> None:
    # 534.000 might be 534 or 534000: the good-looking rows cannot be trusted either.
    text = "".join(f"{i}.000,1,2\n" for i in range(900, 1000, 10))
    text += "".join(f"{i // 1000}.{i % 1000:03d}.000,1,2\n" for i in range(1000, 9000, 10))
    with pytest.raises(BadInput, match=r"log\.csv: line 11: '1\.000\.000' looks like thousands"):
        read(tmp_path, text)


def test_a_byte_order_mark_and_quoted_names(tmp_path: Path) -> None:
    text = b'\xef\xbb\xbf"t" , "p", "a"\r\n0,1,2\r\n1,2,3\r\n'
    assert read(tmp_path, text, NAMED).report.valid == 2


def test_bytes_that_are_not_utf8_do_no_harm_elsewhere(tmp_path: Path) -> None:
    assert read(tmp_path, b"0,1,2,\xb0C\n1,2,3,\xff\n").report.valid == 2


@pytest.mark.parametrize(
    ("text", "log", "message"),
    [
        (b"", INDEXED, "is empty; expected a csv log"),
        (b"\x00\x01\x02" * 100, INDEXED, "is binary or UTF-16"),
        ("0,1,2\n".encode("utf-16"), INDEXED, "is binary or UTF-16"),
        (b"a note, saved as text\n", INDEXED, "holds 0 valid rows in 1 lines"),
        (b"0,1,2\n", INDEXED, "holds 1 valid rows in 1 lines; expected at least 2"),
        (b"0,1\n1,1\n", INDEXED, "left out: 2 fields (lines 1, 2)"),
        (b"0,nan,2\n1,nan,2\n", INDEXED, "left out: 2 nan (lines 1, 2)"),
        (b"t,p,angel\n0,1,2\n", NAMED, "log.columns.angle: line 1 names no column 'a'; "),
        (b"0,1,2\n1,2,3\n", NAMED, "the first line holds numbers: header: false?"),
        (b"t,p,a,a\n0,1,2,3\n", NAMED, "names 'a' twice; expected an index"),
        (b"t,p,a\n0,1,2,3\n1,2,3,4\n", NAMED, "header has 3 names but the rows have 4 fields"),
        (b"\n\n", NAMED, "holds no line; expected a header and rows"),
        (b"t,p,a\n", NAMED, "holds 0 valid rows in 1 lines"),
    ],
)
def test_logs_that_cannot_be_used(
    tmp_path: Path, text: bytes, log: LogFormat, message: str
) -> None:
    with pytest.raises(BadInput) as caught:
        read(tmp_path, text, log)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_header_behind_a_hash(tmp_path: Path) -> None:
    result = read(tmp_path, "# made by hand\n# t,p,a\n0,1,2\n1,2,3\n", NAMED)
    assert (result.report.valid, result.report.comments) == (2, 1)


def test_a_first_or_last_time_far_from_the_others(tmp_path: Path) -> None:
    body = "".join(f"{100 + i},1,2\n" for i in range(20))
    for text in (body + "99999,1,2\n", "-5000,1,2\n" + body):
        assert counts(read(tmp_path, text)) == {"implausible time": 1}
    assert read(tmp_path, body + "140,1,2\n").report.valid == 21


def test_a_trailing_delimiter_is_no_column(tmp_path: Path) -> None:
    assert read(tmp_path, "t,p,a\n0,1,2,\n1,2,3,\n", NAMED).report.valid == 2
    assert read(tmp_path, "t,p,a,\n0,1,2,\n1,2,3,\n", NAMED).report.valid == 2


@given(st.lists(st.integers(0, 12).map(float), max_size=20))
def test_the_longest_increasing_sequence(values: list[float]) -> None:
    chain = longest_increasing(values)
    assert len(chain) == naive_rig.naive_longest_increasing(values)
    assert all(i < j and values[i] < values[j] for i, j in pairwise(chain))


@given(st.binary(max_size=300))
def test_arbitrary_bytes_never_crash(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    folder = tmp_path_factory.mktemp("csv")
    for log in (INDEXED, NAMED):
        for prefix in (b"", b"t,p,a\n0,1,2\n1,2,3\n"):
            try:
                read(folder, prefix + data, log)
            except BadInput as error:
                message = str(error)
            else:
                message = ""
            assert "\n" not in message
