"""Logs in the habits of other programs: what inspect makes of them, the reader reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foreign_habits import HABITS, command, driven
from spa_fo.errors import BadInput
from spa_fo.rig.csv_log import read_csv_log
from spa_fo.rig.inspect_log import inspect_log
from spa_fo.rig.log_format import Column, LogFormat, log_format


@pytest.mark.parametrize("habit", HABITS)
def test_a_log_in_any_habit_is_read_in_its_units(tmp_path: Path, habit: str) -> None:
    made = driven(command((1, 0), (10, 28), (5, 0)))
    path = tmp_path / "log.csv"
    path.write_bytes(HABITS[habit](made))
    before = path.read_bytes()
    found = inspect_log(path)
    assert set(found.signals) == {"command", "pressure", "angle"}, found.text()
    read = read_csv_log(path, found.log)
    np.testing.assert_allclose(read.t_s - read.t_s[0], made.t, atol=2e-3)
    np.testing.assert_allclose(read.columns["command"], made.command, atol=0.02)
    np.testing.assert_allclose(read.columns["angle"], made.angle, atol=0.02)
    report = read.report
    assert report.valid == made.t.size
    assert report.damaged_lines == 0, report.why()
    assert report.lines == report.valid + report.comments + report.banners
    assert path.read_bytes() == before


def section(**keys: Any) -> dict[str, Any]:
    columns: dict[str, Any] = {
        "time": {"column": 1, "unit": "s"},
        "angle": {"column": 2, "unit": "deg"},
    }
    columns["time"].update(keys.pop("time", {}))
    return {"format": "csv", "columns": columns, **keys}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (section(encoding="klingon"), "log.encoding: is 'klingon'; expected a text encoding"),
        (section(encoding="rot13"), "log.encoding: is 'rot13'; expected a text encoding"),
        (section(header=False, header_row=3), "log.header_row: belongs to header: true only"),
        (section(time={"format": "%H:%M:%S"}), "time.format: belongs to unit datetime only"),
        (
            section(time={"unit": "datetime", "format": "%Y"}),
            "log.columns.time.format: is '%Y'; expected the format of a date and time",
        ),
        (section(time={"unit": "datetime", "format": "%Q"}), "is '%Q'; expected the format"),
        (section(time={"unit": "datetime", "scale": 2}), "time.scale: belongs to numbers"),
    ],
)
def test_sections_that_contradict_themselves(entry: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput) as caught:
        log_format(entry, Path("campaign.yaml"))
    assert message in str(caught.value)


def log(**keys: Any) -> LogFormat:
    columns = {"time": Column(1, "s"), "angle": Column(2, "deg")}
    return LogFormat("csv", columns=columns, **{"header": False, **keys})


@pytest.mark.parametrize(
    ("text", "form", "message"),
    [
        (b"1,2\n3,4\n", log(decimal=","), "log.decimal: is ',' as is log.delimiter; expected"),
        (b"a,b\n\n1,2\n", log(header=True, header_row=2), "line 2: holds no names of columns"),
        (b"a,b\n1,2\n", log(header=True, header_row=9), "line 9: holds no names of columns"),
        (b"\xff\xfe\x00\xd8" * 9, log(encoding="utf-16"), "is not utf-16; expected a csv log in"),
        (b"1;2.5\n2;2.5\n", log(delimiter=";", decimal=","), "2 decimal point (lines 1, 2)"),
        (b"1;1.035,5\n2;1.035,6\n", log(delimiter=";", decimal=","), "looks like thousands"),
    ],
)
def test_files_that_are_not_as_the_section_says(
    tmp_path: Path, text: bytes, form: LogFormat, message: str
) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(text)
    with pytest.raises(BadInput) as caught:
        read_csv_log(path, form)
    assert message in str(caught.value)


def test_a_damaged_time_stamp_costs_its_row(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("12:00:01.0,1\nnoon,2\n12:00:02.0,3\n25:00:02.0,3\n,4\n12:00:03,5\n")
    columns = {"time": Column(1, "datetime", format="%H:%M:%S.%f"), "angle": Column(2, "deg")}
    read = read_csv_log(path, LogFormat("csv", header=False, columns=columns))
    assert (read.t_s - read.t_s[0]).tolist() == [0.0, 1.0, 2.0]
    assert read.report.damaged["no date and time"].first_lines == (2, 4)
    assert read.report.damaged["empty field"].first_lines == (5,)


def test_a_header_that_stands_on_another_line_in_each_file(tmp_path: Path) -> None:
    columns = {"time": Column("t", "s"), "angle": Column("a", "deg")}
    form = LogFormat("csv", columns=columns)
    for above in (0, 1, 7):
        path = tmp_path / f"{above}.csv"
        path.write_text("note: x, 1\n" * above + "t,a\n0,1\n1,2\n2,3\n")
        report = read_csv_log(path, form).report
        assert (report.valid, report.comments, report.banners) == (3, above, 1)


def test_coarse_time_stamps_are_told(tmp_path: Path) -> None:
    rows = [f"12:00:{i // 10:02d},{i}.5,{30 * (i > 50)}" for i in range(200)]
    path = tmp_path / "log.csv"
    path.write_text("clock,angle_deg,cmd_kPa\n" + "\n".join(rows) + "\n")
    assert "UNSURE: 10 rows share a time, of which one is kept" in inspect_log(path).section()
