"""Units as people write them, and what they are in those of campaign.yaml."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spa_fo.rig.csv_log import UNITS, read_csv_log
from spa_fo.rig.inspect_log import inspect_log
from spa_fo.rig.log_format import Column
from spa_fo.rig.units import read_unit, unit_of_name

# As written: unit of campaign.yaml, and how many of it one is.
WRITTEN: dict[str, tuple[str, float]] = {
    **dict.fromkeys(["kPa", "KPA", "kpa", "Kpa", "KPa", "kPag"], ("kPa", 1.0)),
    **dict.fromkeys(["hPa", "HPA", "hpa", "mbar", "mBar", "MBAR", "millibar"], ("hPa", 1.0)),
    **dict.fromkeys(["Pa", "PA", "pa", "pascal"], ("Pa", 1.0)),
    **dict.fromkeys(["bar", "Bar", "BAR", "barg", "bara"], ("bar", 1.0)),
    **dict.fromkeys(["psi", "PSI", "Psi", "psig", "PSIG", "psia", "lbf/in^2"], ("psi", 1.0)),
    **dict.fromkeys(["mmHg", "MMHG", "mmhg"], ("kPa", 0.133322387415)),
    **dict.fromkeys(["inHg", "INHG"], ("kPa", 3.38638864034)),
    **dict.fromkeys(["torr", "Torr"], ("kPa", 0.133322368421)),
    **dict.fromkeys(["MPa", "N/mm2", "N/mm²"], ("kPa", 1000.0)),
    "atm": ("kPa", 101.325),
    "cmH2O": ("kPa", 0.0980665),
    "kgf/cm2": ("kPa", 98.0665),
    **dict.fromkeys(["s", "S", "sec", "secs", "Sec", "second", "seconds"], ("s", 1.0)),
    **dict.fromkeys(["ms", "MS", "Ms", "msec", "millis", "milliseconds"], ("ms", 1.0)),
    **dict.fromkeys(["us", "US", "µs", "μs", "usec", "micros", "microseconds"], ("us", 1.0)),
    "ns": ("us", 0.001),
    "min": ("s", 60.0),
    "h": ("s", 3600.0),
    **dict.fromkeys(["deg", "Deg", "DEG", "degs", "degree", "degrees", "°", "º"], ("deg", 1.0)),
    **dict.fromkeys(["rad", "RAD", "rads", "radian", "radians"], ("rad", 1.0)),
    "mrad": ("rad", 0.001),
    "turn": ("deg", 360.0),
}
ALONE = ("min", "h", "turn", "lbf/in^2", "N/mm2", "N/mm²", "kgf/cm2", "pascal")


@pytest.mark.parametrize("text", WRITTEN)
def test_a_unit_as_it_may_be_written(text: str) -> None:
    found = read_unit(text)
    assert found is not None
    assert (found.unit, found.scale, found.doubt) == (*WRITTEN[text], "")


@pytest.mark.parametrize(
    "form", ["x [{}]", "x ({})", "x/{}", "x / {}", "x1({})", "x {{{}}}", "x (left) [{}]"]
)
@pytest.mark.parametrize("text", WRITTEN)
def test_a_unit_set_apart_in_a_name(text: str, form: str) -> None:
    found = unit_of_name(form.format(text))
    assert found is not None
    assert (found.unit, found.scale) == WRITTEN[text]


@pytest.mark.parametrize("form", ["x_set_{}", "setpoint {}", "x.{}", "x, {}", "x in {}", "x-{}"])
@pytest.mark.parametrize("text", [text for text in WRITTEN if text not in ALONE])
def test_a_unit_as_a_word_of_a_name(text: str, form: str) -> None:
    name = form.format(text)
    found = unit_of_name(name.upper() if text == "S" else name)
    assert found is not None
    assert (found.unit, found.scale) == WRITTEN[text]


@pytest.mark.parametrize("text", WRITTEN)
def test_a_unit_in_a_row_below_the_names(text: str) -> None:
    for below in (text, f"[{text}]", f" ({text}) "):
        found = unit_of_name("x", below)
        assert found is not None
        assert (found.unit, found.scale) == WRITTEN[text]


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("pressureKPa", "kPa"),
        ("pressurekPa", "kPa"),
        ("manifoldPressure_bar", "bar"),
        ("angledeg", "deg"),
        ("tipAngleDeg", "deg"),
        ("timems", "ms"),
        ("timeMs", "ms"),
        ("p1kPa", "kPa"),
        ("kPa", "kPa"),
        ("pressure_psi_1", "psi"),
        ("kPa abs.", "kPa"),
        ("TIME_S", "s"),
    ],
)
def test_a_unit_in_one_word_with_a_name(name: str, unit: str) -> None:
    found = unit_of_name(name)
    assert found is not None
    assert (found.unit, found.scale) == (unit, 1.0)


@pytest.mark.parametrize("text", ["MPA", "mpa", "mPa", "grad", "Grad"])
def test_an_ambiguous_unit_is_said_to_be_unsure(text: str) -> None:
    found = read_unit(text)
    assert found is not None
    assert f"'{text}' may be" in found.doubt or text in found.doubt or "grad" in found.doubt


@pytest.mark.parametrize(
    "name", ["p", "t", "set", "p_min", "Sensor S", "angle (left)", "P (A)", "time (h:mm:ss)", ""]
)
def test_what_is_no_unit(name: str) -> None:
    assert unit_of_name(name) is None


@pytest.mark.parametrize("name", ["gyro deg/s", "gyro_deg_s", "omega [°/s]", "p [V]", "T (°C)"])
def test_units_of_what_no_campaign_needs(name: str) -> None:
    found = unit_of_name(name)
    assert found is not None
    assert (found.kind, found.unit) == ("other", "")


def write_step(path: Path, names: tuple[str, str, str], per_kpa: float, per_deg: float) -> None:
    rows = [",".join(names)]
    for i in range(100):
        kpa = 30.0 * (i >= 25)
        deg = 40.0 * (1.0 - np.exp(-max(0, i - 25) / 20.0))
        rows.append(f"{0.02 * i:.3f},{kpa * per_kpa:.8g},{deg * per_deg:.8g}")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


@pytest.mark.parametrize(
    "text", [text for text, (unit, _) in WRITTEN.items() if unit in ("kPa", "hPa", "Pa", "psi")]
)
def test_no_pressure_is_wrong_by_a_thousand(tmp_path: Path, text: str) -> None:
    unit, scale = WRITTEN[text]
    one_kpa = 1.0 / (UNITS[unit] * scale)
    names = ("t [s]", f"p_set [{text}]", "angle [deg]")
    write_step(tmp_path / "log.csv", names, one_kpa, 1.0)
    inspection = inspect_log(tmp_path / "log.csv")
    assert inspection.log.columns is not None
    assert inspection.log.columns["command"] == Column(names[1], unit, scale)
    assert inspection.signals["command"].max() == pytest.approx(30.0, rel=1e-6)
    assert read_csv_log(tmp_path / "log.csv", inspection.log).columns["command"].max() == (
        pytest.approx(30.0, rel=1e-6)
    )


def test_offsets_are_in_the_unit_behind_the_scale(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{0.02 * i:.3f},{750.0 + 225.0 * (i > 25)},{i}" for i in range(100)]
    path.write_text("time/s,p_cmd/mmHg,angle/mrad\n" + "\n".join(rows) + "\n")
    inspection = inspect_log(path)
    assert inspection.signals["command"].min() == pytest.approx(0.0, abs=1e-9)
    assert inspection.signals["command"].max() == pytest.approx(30.0, rel=1e-3)
    assert inspection.signals["angle"].max() == pytest.approx(np.degrees(0.099), rel=1e-9)
    assert "mmHg is 0.133322 kPa" in inspection.section()


def test_an_ambiguous_unit_is_told_where_it_is_used(tmp_path: Path) -> None:
    write_step(tmp_path / "log.csv", ("t_s", "p_cmd_MPA", "angle_deg"), 1e-3, 1.0)
    section = inspect_log(tmp_path / "log.csv").section()
    assert "UNSURE: 'MPA' may be megapascal or millipascal" in section
    assert "scale: 1000.0" in section


def test_another_units_column_is_not_taken_for_the_angle(tmp_path: Path) -> None:
    rows = [f"{0.02 * i:.3f},{30 * (i > 25)},{i % 7},{0.3 * i}" for i in range(100)]
    path = tmp_path / "log.csv"
    path.write_text("t_s,p_cmd_kPa,pitch [deg/s],pitch [deg]\n" + "\n".join(rows) + "\n")
    assert inspect_log(path).guesses["angle"].place == 3


def test_a_pressure_is_not_taken_for_an_angle(tmp_path: Path) -> None:
    rows = [f"{0.02 * i:.3f},{30 * (i > 25)},{0.3 * i:.2f}" for i in range(100)]
    path = tmp_path / "log.csv"
    path.write_text("t_s,command_kpa,far_kpa\n" + "\n".join(rows) + "\n")
    assert "angle" not in inspect_log(path).guesses
    path.write_text("t_s,setpoint_deg,angle_deg\n" + "\n".join(rows) + "\n")
    guesses = inspect_log(path).guesses
    assert guesses["angle"].place == 2
    assert "command" not in guesses
