"""What is found in logs of any make, and that the printed section reads them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import naive_rig
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.rig.csv_log import read_csv_log
from spa_fo.rig.inspect_log import inspect_log, repeats_of, sampling_of
from spa_fo.rig.inspection import Inspection, spark
from spa_fo.rig.log_format import Column, LogFormat, log_format
from spa_fo.validation import load_yaml, package_schema, validate

ROWS = 200


def as_pasted(inspection: Inspection, folder: Path) -> LogFormat:
    """Paste the section into a campaign.yaml and read that as a campaign is read."""
    path = folder / "campaign.yaml"
    path.write_text(inspection.section(), encoding="utf-8")
    section = load_yaml(path)["log"]
    document: dict[str, Any] = naive_rig.description(1) | {"log": section}
    validate(document, package_schema("spa_fo.rig", "campaign.schema.yaml"), path)
    if inspection.complete:
        return log_format(section, path)
    columns = {
        role: Column(**{"unit": "1"} | item | ({"unit": str(item["unit"])}))
        for role, item in section["columns"].items()
    }
    with pytest.raises(BadInput, match="expected a column 'angle' or 'flex_adc'"):
        log_format(section, path)
    keys = ("decimal", "encoding", "header_row")
    extra = {key: section[key] for key in keys if key in section}
    return LogFormat("csv", section["delimiter"], section["header"], columns, **extra)


def round_trip(path: Path, folder: Path) -> Inspection:
    inspection = inspect_log(path)
    pasted = as_pasted(inspection, folder)
    assert pasted == inspection.log
    if inspection.kind == "csv":
        read = read_csv_log(path, pasted)
        assert read.report.valid == inspection.t_s.size >= 2
        np.testing.assert_array_equal(read.t_s - read.t_s[0], inspection.t_s)
        assert set(read.columns) == set(inspection.signals)
        for role, values in read.columns.items():
            np.testing.assert_array_equal(values, inspection.signals[role])
    return inspection


def signals(rows: int = ROWS, seed: int = 0) -> dict[str, np.ndarray]:
    """A step at 50 Hz: time (s), command and pressure (kPa), angle (deg), flex (counts)."""
    rng = np.random.default_rng(seed)
    t_s = 0.02 * np.arange(rows) + rng.uniform(0.0, 0.004, rows)
    command = np.where(np.arange(rows) < rows // 4, 0.0, 30.0)
    lag = 1.0 - np.exp(-np.maximum(0, np.arange(rows) - rows // 4) / 20.0)
    return {
        "t": t_s,
        "command": command,
        "pressure": 30.0 * lag + rng.normal(0.0, 0.05, rows),
        "angle": 2.0 + 40.0 * lag + rng.normal(0.0, 0.1, rows),
        "flex": np.round(350.0 - 100.0 * lag + rng.normal(0.0, 1.0, rows)),
    }


def write(path: Path, columns: list[np.ndarray], delimiter: str = ",", head: str = "") -> Path:
    lines = [
        delimiter.join(f"{value:.6g}" for value in row) for row in np.column_stack(columns).tolist()
    ]
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return path


SHARED = {
    "bellow_bending": ({"time": 1, "command": 6, "pressure": 2, "angle": 12}, "hPa", "deg"),
    "soft_arm_steps": (
        {
            "time": "t_s",
            "command": "command_psi",
            "pressure": "pressure_psi",
            "angle": "angle_deg",
        },
        "psi",
        "deg",
    ),
}
QUIRKS: dict[str, tuple[dict[str, int | str], int] | str] = {
    "OldPumpDynamics__PressureVoltage__Exp1102OudeActuator__data12.txt": (
        {"time": 1, "pressure": 4},
        1026,
    ),
    "OldPumpDynamics__PressureVoltage__OudeData__data.txt": ({"time": 1, "pressure": 5}, 481),
    "OldPumpDynamics__PressureVoltage__OudeData__data10b.txt": ({"time": 1}, 210),
    "OldPumpDynamics__PressureVoltage__OudeData__data13.txt": ({"time": 1, "pressure": 5}, 107),
    "OldPumpDynamics__PressureVoltage__V4__dataxxx.txt": "is empty; expected a csv log",
    "OldPumpDynamics__PumpwActuatorwAirtank__README.txt": "no rows of numbers but 'Step input",
    "OldPumpDynamics__StepResponse__README.txt": "no rows of numbers but 'These experiments",
    "OldPumpDynamics__StepResponse__pomp12.txt": ({"time": 1, "pressure": 4}, 1072),
    "PIDpressureControl__OldMeasurements__PressurePIDxxx.txt": "no rows of numbers but 'Documen",
    "aborted_run.csv": "holds 1 row of numbers in 2 lines; expected at least 2",
    "flex_adc_dropout.csv": ({"time": "Time_ms", "flex_adc": "Thumb"}, 400),
    "header_37_rows_41.csv": ({"time": 1, "command": 2}, 399),
    "padded_no_header.txt": ({"time": 1}, 300),
    "thousands_dots_CC0.csv": "line 10: '1.035.000' looks like thousands grouped by dots",
}


def test_every_shared_log_reads_with_its_printed_section(tmp_path: Path, shared_data: Path) -> None:
    for path in sorted(path for path in shared_data.rglob("*") if path.is_file()):
        if isinstance(QUIRKS.get(path.name, {}), str) or path.suffix == ".md":
            with pytest.raises(BadInput, match=re.escape(path.name)):
                inspect_log(path)
        else:
            assert "log:\n  format: csv\n" in round_trip(path, tmp_path).text()


@pytest.mark.parametrize("folder", sorted(SHARED))
def test_the_actuators_columns_are_those_of_the_examples(shared_data: Path, folder: str) -> None:
    expected, pressure_unit, angle_unit = SHARED[folder]
    paths = sorted((shared_data / folder).iterdir())
    assert len(paths) >= 3
    for path in paths:
        columns = inspect_log(path).log.columns
        assert columns is not None
        assert {role: item.column for role, item in columns.items()} == expected
        assert columns["pressure"].unit == pressure_unit
        assert (columns["angle"].unit, columns["angle"].rest) == (angle_unit, "zero")


@pytest.mark.parametrize("file", sorted(QUIRKS))
def test_logs_at_their_worst(shared_data: Path, file: str) -> None:
    expected = QUIRKS[file]
    path = shared_data / "log_quirks" / file
    if isinstance(expected, str):
        with pytest.raises(BadInput) as caught:
            inspect_log(path)
        assert expected in str(caught.value)
        return
    inspection = inspect_log(path)
    places = {role: item.column for role, item in (inspection.log.columns or {}).items()}
    assert (places, inspection.sampling.rows) == expected


def test_every_quirk_has_an_expectation(shared_data: Path) -> None:
    assert {path.name for path in (shared_data / "log_quirks").iterdir()} == set(QUIRKS)


def test_a_loose_contact_is_named(shared_data: Path) -> None:
    text = inspect_log(shared_data / "log_quirks" / "flex_adc_dropout.csv").text()
    assert "flex_adc falls to 0 in 1 rows, first at 1.97 s" in text


def test_names_with_units_and_a_row_of_units(tmp_path: Path) -> None:
    s = signals()
    columns = [1e3 * s["t"], 10.0 * s["command"], 0.01 * s["pressure"], np.radians(s["angle"])]
    head = "Time [ms],Setpoint (mbar),manifoldPressure_bar,tip angle/rad\n"
    found = round_trip(write(tmp_path / "a.csv", columns, head=head), tmp_path)
    assert {role: item.unit for role, item in (found.log.columns or {}).items()} == {
        "time": "ms",
        "command": "hPa",
        "pressure": "bar",
        "angle": "rad",
    }
    assert found.signals["angle"].max() == pytest.approx(s["angle"].max(), rel=1e-4)
    units_below = "Time,Setpoint,Pressure,Angle\nms,mbar,bar,rad\n"
    below = round_trip(write(tmp_path / "b.csv", columns, head=units_below), tmp_path)
    assert below.log.columns is not None
    assert [item.unit for item in below.log.columns.values()] == ["ms", "hPa", "bar", "rad"]
    assert (below.report.banners, below.report.damaged) == (2, {})


@pytest.mark.parametrize(
    ("factor", "unit"), [(1.0, "s"), (1e3, "ms"), (1e6, "us")], ids=["s", "ms", "us"]
)
def test_the_clocks_unit_from_its_sampling(tmp_path: Path, factor: float, unit: str) -> None:
    s = signals()
    clock = np.round(s["t"] * factor, 0 if factor > 1 else 4)
    found = round_trip(write(tmp_path / "log.csv", [clock, s["angle"], s["command"]]), tmp_path)
    assert found.log.columns is not None
    assert found.log.columns["time"] == Column(1, unit)
    assert found.sampling.rate_hz == pytest.approx(50.0, rel=0.1)


def test_a_counter_of_rows_is_not_the_clock(tmp_path: Path) -> None:
    s = signals()
    path = write(tmp_path / "log.csv", [np.arange(ROWS), s["t"], s["command"], s["angle"]])
    assert inspect_log(path).guesses["time"].place == 1


def test_columns_without_names_by_how_they_move(tmp_path: Path) -> None:
    s = signals()
    absolute = 1013.0 + 10.0 * s["pressure"]
    columns = [s["flex"], absolute, s["angle"], np.full(ROWS, 7.0), s["command"], s["t"]]
    found = round_trip(write(tmp_path / "log.csv", columns, ";"), tmp_path)
    assert {role: guess.place + 1 for role, guess in found.guesses.items()} == {
        "time": 6,
        "command": 5,
        "pressure": 2,
        "angle": 3,
    }
    assert found.log.columns is not None
    assert found.log.columns["pressure"].offset == pytest.approx(-1013.0, abs=0.5)
    assert found.log.columns["angle"].rest == "zero"


def test_names_that_cannot_be_trusted_give_way_to_indices(tmp_path: Path) -> None:
    s = signals()
    columns = [s["t"], s["command"], s["angle"], s["angle"]]
    for head in ("t,command,angle\n", "# t,command\n"):
        found = round_trip(write(tmp_path / "log.csv", columns, head=head), tmp_path)
        assert found.log.columns is not None
        assert {item.column for item in found.log.columns.values()} == {1, 2, 3}, head
        assert found.sampling.rows == ROWS
    twice = write(tmp_path / "log.csv", columns, head="t,command,angle,angle\n")
    found = round_trip(twice, tmp_path)
    assert found.log.columns is not None
    assert [item.column for item in found.log.columns.values()] == ["t", "command", 3]


def test_a_header_behind_a_hash(tmp_path: Path) -> None:
    s = signals()
    path = write(tmp_path / "log.csv", [s["t"], s["command"], s["angle"]], head="# t,cmd,angle\n")
    found = round_trip(path, tmp_path)
    assert found.sampling.rows == ROWS
    assert found.log.columns is not None
    assert found.log.columns["angle"].column == "angle"


def test_names_that_yaml_would_read_as_something_else(tmp_path: Path) -> None:
    s = signals()
    head = '"yes: {time}";"null";angle # tip °\n'
    path = write(tmp_path / "log.csv", [s["t"], s["command"], s["angle"]], ";", head)
    found = round_trip(path, tmp_path)
    assert found.log.columns is not None
    assert found.log.columns["time"].column == "yes: {time}"
    assert found.log.columns["angle"].column == "angle # tip °"


def test_the_sampling(tmp_path: Path) -> None:
    t_s = 0.02 * np.arange(100.0)
    t_s[60:] += 1.0
    sampling = sampling_of(t_s)
    assert sampling.rate_hz == pytest.approx(50.0)
    assert sampling.pauses == 1
    assert sampling.longest_s == pytest.approx(1.02)
    assert sampling.longest_at_s == pytest.approx(0.02 * 59)
    assert sampling.jitter_s == pytest.approx(0.0, abs=1e-9)
    jittered = sampling_of(0.02 * np.arange(1000.0) + np.tile([0.0, 0.004], 500))
    assert jittered.jitter_s == pytest.approx(0.004, rel=1e-2)
    assert jittered.early_s == pytest.approx(0.016)
    assert jittered.late_s == pytest.approx(0.024)


def test_stale_rows_are_those_where_all_repeats() -> None:
    t_s = 0.1 * np.arange(8.0)
    a = np.array([1.0, 1, 2, 2, 2, 3, 4, 4])
    b = np.array([1.0, 2, 2, 2, 2, 3, 3, 3])
    assert (repeats_of(t_s, a).share, repeats_of(t_s, a).longest) == (0.5, 2)
    both = repeats_of(t_s, a, b)
    assert (both.share, both.longest) == (3 / 8, 2)
    assert both.at_s == pytest.approx(0.3)
    assert repeats_of(t_s, t_s).longest == 0


def test_backward_time_and_stale_rows_are_told(tmp_path: Path) -> None:
    s = signals()
    for name in ("pressure", "angle"):
        s[name][100:120] = s[name][100]
    s["t"][150] = s["t"][20]
    columns = [s["t"], s["command"], s["pressure"], s["angle"]]
    path = write(tmp_path / "log.csv", columns, head="t,cmd_kpa,p_kpa,angle_deg\n")
    text = round_trip(path, tmp_path).text()
    assert "1 repeated time (line 152)" in text or "1 backward time (line 152)" in text
    assert "stale rows (all of these): 9.5 % of the rows repeat the one before, 19 on end" in text


def test_a_spark_rises_with_its_values() -> None:
    assert spark(np.arange(8.0), 8) == "▁▂▃▄▅▆▇█"
    assert spark(np.zeros(5)) == "▁▁▁▁▁"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "is empty; expected a csv log"),
        (b"\x00\x01" * 50, "is binary or UTF-16"),
        (b"one note\nanother note\n", "holds no rows of numbers but 'one note'"),
        (b"1\n2\n3\n", "holds no rows of numbers but '1'"),
        (b"t,a\n1,2\n", "holds 1 row of numbers in 2 lines"),
        (b"a,b\n3,1\n1,3\n2,2\n2,1\n", "none rises as time does"),
        (b"1.000,1;1,5\n2.000,2;1,6\n", "line 1: '1.000,1' looks like thousands"),
        (naive_rig.data_line(0, 1, "0.00", 93, 354) + b"\n", "expected the banner '# spa-rig 1"),
        (b"# spa-rig 1 board=x\n", "line 1: the banner lacks adc_bits="),
    ],
)
def test_files_that_hold_no_log(
    tmp_path: Path, text: bytes, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(text)
    with pytest.raises(SystemExit) as left:
        main(["inspect", str(path)])
    assert left.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith(f"spa-fo: {path}: ")
    assert message in captured.err


def test_a_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["inspect", str(tmp_path / "none.csv")])
    assert left.value.code == 2
    assert "none.csv: is not there" in capsys.readouterr().err


def test_a_spa_rig_log_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "trial_01.log"
    path.write_bytes(b"\n".join([naive_rig.BANNER.encode(), *naive_rig.rows()]) + b"\n")
    stem = tmp_path / "look"
    assert main(["inspect", str(path), "--plot", str(stem)]) == 0
    out = capsys.readouterr().out
    assert "a spa-rig log (trial), board mega2560, 50 Hz" in out
    assert out.endswith("log: {format: spa-rig}\n")
    assert stem.with_suffix(".png").stat().st_size > 1000
    inspection = inspect_log(path)
    assert inspection.sampling.rows == 200
    assert inspection.sampling.rate_hz == pytest.approx(50.0, rel=0.01)
    assert as_pasted(inspection, tmp_path) == LogFormat("spa-rig")


def test_the_plot_shows_what_the_log_holds(tmp_path: Path) -> None:
    from spa_fo.report.inspect_figure import inspect_figure

    s = signals()
    s["t"][100:] += 3.0
    columns = [s["t"], s["command"], s["pressure"], s["angle"]]
    path = write(tmp_path / "log.csv", columns, head="t_s,cmd_kpa,p_kpa,angle_deg\n")
    figure = inspect_figure(inspect_log(path))
    axes = {axes.get_label(): axes for axes in figure.axes}
    assert set(axes) == {"input", "angle", "steps"}
    np.testing.assert_allclose(
        np.asarray(axes["angle"].lines[0].get_ydata()), s["angle"], rtol=1e-4
    )
    assert len(np.asarray(axes["steps"].lines[1].get_ydata())) == 1


def test_a_damaged_first_row_is_no_row_of_units(tmp_path: Path) -> None:
    s = signals()
    path = write(tmp_path / "log.csv", list(s.values())[:4], head="t,cmd,p,angle\nx,x,,1.956\n")
    found = round_trip(path, tmp_path)
    places = {role: guess.place for role, guess in found.guesses.items()}
    assert places == {"time": 0, "command": 1, "pressure": 2, "angle": 3}


NAMES = {
    "t": ["t", "time_s", "Time", "Timestamp"],
    "command": ["cmd", "Setpoint", "pd", "target"],
    "pressure": ["p", "pressure", "manifold"],
    "angle": ["angle", "bend_deg", "theta"],
    "flex": ["flex", "flex_adc"],
}
DAMAGE = st.sampled_from(["nan", "", "x", "inf", "cut", "long", "blank", "comment", "repeat"])


@st.composite
def made_up_logs(draw: st.DrawFn) -> tuple[bytes, dict[str, int]]:
    """A log of named columns in any order, damaged here and there; and where each column is."""
    s = signals(draw(st.integers(30, 60)), draw(st.integers(0, 9)))
    order = draw(st.permutations(["t", "command", "pressure", draw(st.sampled_from(["angle"]))]))
    if draw(st.booleans()):
        order = [*order, "flex"]
    delimiter = draw(st.sampled_from([",", ";", "\t", "|", " "]))
    pad = draw(st.sampled_from(["", " "])) if delimiter != " " else ""
    end = draw(st.sampled_from(["\n", "\r\n"]))
    lines = [
        (delimiter + pad).join(f"{s[name][i]:.6g}" for name in order) for i in range(s["t"].size)
    ]
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(lines) - 1))
        lines[at] = _damage(lines, at, draw(DAMAGE), delimiter, draw)
    head = delimiter.join(draw(st.sampled_from(NAMES[name])) for name in order)
    text = end.join([head, *lines]) + (end if draw(st.booleans()) else "")
    bom = b"\xef\xbb\xbf" if draw(st.booleans()) else b""
    return bom + text.encode(), {name: place for place, name in enumerate(order)}


def _damage(lines: list[str], at: int, kind: str, delimiter: str, draw: st.DrawFn) -> str:
    line = lines[at]
    if kind == "cut":
        return line[: draw(st.integers(0, len(line)))]
    if kind == "long":
        return line + 3 * f"{delimiter}1"
    if kind == "repeat":
        return lines[max(0, at - 1)]
    if kind in ("blank", "comment"):
        return "" if kind == "blank" else "# " + line
    fields = line.split(delimiter)
    fields[draw(st.integers(0, len(fields) - 1))] = kind
    return delimiter.join(fields)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(made_up_logs())
def test_made_up_logs_are_understood(tmp_path: Path, made: tuple[bytes, dict[str, int]]) -> None:
    data, places = made
    path = tmp_path / "log.csv"
    path.write_bytes(data)
    found = round_trip(path, tmp_path)
    guessed = {role: guess.place for role, guess in found.guesses.items()}
    assert guessed["time"] == places["t"]
    assert guessed["angle"] == places["angle"]
    assert guessed["command"] == places["command"]
    assert guessed["pressure"] == places["pressure"]
    assert guessed.get("flex_adc") == places.get("flex")
    assert found.t_s.size >= 20
    assert found.log.columns is not None
    assert all(isinstance(item.column, str) for item in found.log.columns.values())


def understood_or_refused(path: Path, folder: Path) -> Inspection | None:
    """Return what is found, or None where it is refused; then in one line."""
    try:
        return round_trip(path, folder)
    except BadInput as error:
        message = str(error)
    assert "\n" not in message
    return None


NUMBERS = st.one_of(
    st.integers(-5, 2000).map(str), st.floats(-1e3, 1e3).map("{:.4g}".format), st.just("nan")
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    st.lists(st.lists(NUMBERS, min_size=2, max_size=5), min_size=2, max_size=30),
    st.lists(st.text(max_size=8), max_size=5),
    st.sampled_from([",", ";", "\t", " ", "|"]),
)
def test_any_table_is_read_or_refused_in_one_line(
    tmp_path: Path, rows: list[list[str]], names: list[str], delimiter: str
) -> None:
    clock = [[str(i / 50), *row] for i, row in enumerate(rows)]
    lines = [delimiter.join(row) for row in ([names, *clock] if names else clock)]
    path = tmp_path / "log.csv"
    path.write_bytes("\n".join(lines).encode("utf-8", errors="replace") + b"\n")
    inspection = understood_or_refused(path, tmp_path)
    if inspection is not None:
        assert math.isfinite(inspection.sampling.rate_hz)
        assert inspection.text().count("log:\n") == 1


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.binary(max_size=300))
def test_arbitrary_bytes_never_crash(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "log.csv"
    for prefix in (b"", b"t,p,a\n0,1,2\n1,2,3\n"):
        path.write_bytes(prefix + data)
        inspection = understood_or_refused(path, tmp_path)
        assert inspection is None or inspection.t_s.size >= 2
