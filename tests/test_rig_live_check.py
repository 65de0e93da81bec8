"""The live check: every fault of the wiring is named, and a sound rig is left in peace."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.rig import read_campaign
from spa_fo.rig.calibration import calibrate
from spa_fo.rig.check_command import is_port
from spa_fo.rig.live_check import Finding, check_log
from spa_fo.rig.spa_rig_log import parse_spa_rig_log
from spa_fo.rig.trials import earliest_calibration
from spa_fo.rig.wire import format_line
from virtual_bench import serving

ROOT = Path(__file__).resolve().parent.parent
BANNER = (
    "# spa-rig 1 board=mega2560 adc_bits=10 vref_mv=5000 rate_hz={rate:g} "
    "columns=seq,t_us,cmd_kpa,p_adc,flex_adc\n"
)
COMMAND = np.repeat([0.0, 20.0, 0.0], [100, 200, 100])
PRESSURE = 102.3 + 1023 * 0.8 / 551.6 * COMMAND
FLEX = 255.0 + 2.0 * COMMAND


def made(
    command=COMMAND, pressure=PRESSURE, flex=FLEX, rate=50.0, says=50.0, noise=0.5, jitter=0.0
):
    """A log of given means, with noise."""
    rng = np.random.default_rng(8)
    n = len(command)
    t_us = np.rint(1e6 + np.arange(n) * 1e6 / rate + jitter * rng.standard_normal(n))
    counts = [
        np.clip(np.rint(mean + noise * rng.standard_normal(n)), 0, 1023).astype(int)
        for mean in (pressure, flex)
    ]
    lines = [
        format_line([str(i), f"{t:.0f}", f"{u:.2f}", str(p), str(y)]).decode()
        for i, (t, u, p, y) in enumerate(zip(t_us, command, *counts, strict=True))
    ]
    return BANNER.format(rate=says) + "\n".join(lines) + "\n"


def check(text: str, **options) -> list[Finding]:
    return check_log(parse_spa_rig_log(text.encode(), "log"), **options)


def found(findings: list[Finding]) -> set[tuple[str, str]]:
    return {(finding.level, finding.what) for finding in findings if finding.level != "ok"}


def words(findings: list[Finding]) -> str:
    return " | ".join(finding.words for finding in findings if finding.level != "ok")


def test_a_sound_rig_is_left_in_peace() -> None:
    findings = check(made())
    assert found(findings) == set()
    assert [finding.what for finding in findings] == [
        *("rate", "jitter", "line", "pressure", "flex", "zero", "pressure", "bending")
    ]


@pytest.mark.parametrize("campaign", ["dragon_skin_20", "fx_pro"])
def test_the_committed_campaigns_have_no_fault_but_those_put_in(campaign: str) -> None:
    data = read_campaign(ROOT / "raw" / campaign)
    curve = earliest_calibration(data)
    for experiment, _, trial in data.trial_files():
        if experiment.name != "step_30":
            continue
        log = parse_spa_rig_log(trial.path.read_bytes(), trial.path)
        levels = found(check_log(log, data.pressure_sensor, curve))
        assert levels <= {("warning", "line"), ("fault", "power")}
        assert (("fault", "power") in levels) is (log.report.resets > 0)


CASES = {
    "slow board": (made(rate=47.0), ("fault", "rate"), "too busy"),
    "jitter": (made(jitter=2500.0), ("warning", "jitter"), "not taken by the timer"),
    "much jitter": (made(jitter=6000.0), ("fault", "jitter"), "blocks the board's loop"),
    "ground off": (made(flex=np.full(400, 1100.0)), ("fault", "flex"), "its ground lead is off"),
    "supply off": (made(pressure=np.full(400, -50.0)), ("fault", "pressure"), "5 V lead"),
    "loose": (
        made(flex=np.where(np.arange(400) % 100 == 7, -50.0, FLEX)),
        ("warning", "flex"),
        "a loose contact",
    ),
    "noise": (made(noise=5.0), ("warning", "flex"), "no common ground"),
    "much noise": (made(noise=20.0), ("fault", "flex"), "no common ground"),
    "zero off": (made(pressure=PRESSURE + 20), ("warning", "zero"), "wrong numbers"),
    "swapped": (made(pressure=FLEX, flex=PRESSURE), ("fault", "zero"), "swapped"),
    "tube off": (made(pressure=np.full(400, 102.3)), ("fault", "pressure"), "the tube is off"),
    "ports swapped": (
        made(pressure=204.6 - PRESSURE),
        ("fault", "pressure"),
        "the sensor's ports are swapped",
    ),
    "leak": (
        made(pressure=102.3 + 0.6 * (PRESSURE - 102.3)),
        ("warning", "pressure"),
        "a leak or a weak supply",
    ),
    "kinked": (
        made(pressure=np.interp(np.arange(400) - 130.0, np.arange(400), PRESSURE)),
        ("warning", "pressure"),
        "narrow tube",
    ),
    "does not bend": (made(flex=np.full(400, 255.0)), ("warning", "bending"), "does not bend"),
    "upside down": (made(flex=510.0 - FLEX), ("warning", "bending"), "upside down"),
    "floating": (made(flex=PRESSURE), ("fault", "flex"), "floats and repeats"),
    "dead": (
        made(flex=np.full(400, 300.0), noise=0.0),
        ("fault", "flex"),
        "reads 300 throughout",
    ),
    "few": (made(*(signal[:5] for signal in (COMMAND, PRESSURE, FLEX))), ("fault", "rate"), "few"),
}


@pytest.mark.parametrize("name", CASES)
def test_each_fault_is_named(name: str) -> None:
    text, level, says = CASES[name]
    findings = check(text)
    assert level in found(findings)
    assert says in words(findings)


def test_a_channel_that_dies_in_mid_run() -> None:
    lines = made().splitlines()
    rows = [line.split("*")[0].split(",") for line in lines[1:]]
    for row in rows[250:]:
        row[4] = rows[250][4]
    text = "\n".join([lines[0], *(format_line(row).decode() for row in rows)]) + "\n"
    findings = check(text)
    assert ("fault", "flex") in found(findings)
    assert "from 5.0 s on" in words(findings)


def test_lost_lines_and_resets() -> None:
    lines = made().splitlines(keepends=True)
    kept = "".join(lines[:120] + lines[150:])
    assert ("fault", "line") in found(check(kept))
    again = made().splitlines(keepends=True)
    assert ("fault", "power") in found(check("".join([*lines, *again])))
    damaged = made().replace("*2", "*3", 2)
    findings = check(damaged)
    assert ("warning", "line") in found(findings)
    assert "checksum" in words(findings)


def test_the_sign_of_the_sensor_by_its_calibration() -> None:
    t = np.arange(0.0, 30.0, 0.02)
    angle = np.floor(t / 5.0) * 10.0
    rng = np.random.default_rng(2)
    noise = rng.normal(0.0, 0.5, t.size)
    rising = calibrate(t, angle, 250.0 + 2.0 * angle + noise, "pre.log")
    falling = calibrate(t, angle, 300.0 - 2.0 * angle + noise, "pre.log")
    assert found(check(made(), curve=rising)) == set()
    assert "+20.0 deg by pre.log" in check(made(), curve=rising)[-1].words
    assert found(check(made(), curve=falling)) == {("fault", "bending")}
    assert "the angle falls" in words(check(made(), curve=falling))
    # Falling counts are right where the calibration says so.
    assert found(check(made(flex=550.0 - FLEX), curve=falling)) == set()


def test_a_log_without_a_step_says_what_was_not_tried() -> None:
    findings = check(made(command=np.zeros(400), pressure=np.full(400, 102.3), flex=FLEX))
    assert ("warning", "pressure") in found(findings)
    assert "not tried" in words(findings)


def test_a_calibration_is_checked_as_far_as_it_goes() -> None:
    path = ROOT / "raw" / "fx_pro" / "calibration" / "pre.log"
    findings = check_log(parse_spa_rig_log(path.read_bytes(), path))
    assert found(findings) == set()
    assert [finding.what for finding in findings] == ["rate", "jitter", "line", "flex"]


# --- the command ----------------------------------------------------------------------------------


def run(*arguments: object) -> int:
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as end:
        return int(end.code or 0)


@pytest.mark.parametrize(
    ("faults", "code", "says"),
    [
        ([], 0, " kPa above rest at a command of 10.0 kPa"),
        (["flex-railed@0"], 1, "flex_adc reads full scale"),
        (["pressure-stuck@0"], 1, "p_adc reads"),
        (["reset@3"], 1, "the board reset itself"),
        (["unplug@3"], 1, "the port was lost"),
        (["cut=0.1"], 1, "a bad cable"),
    ],
)
def test_a_board_is_checked(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, faults: list[str], code: int, says: str
) -> None:
    with serving(*faults) as served:
        assert run("check", served.port, "--out", tmp_path / "check.log") == code
    assert says in capfd.readouterr().out
    assert run("check", tmp_path / "check.log") in (0, code)


def test_a_file_is_checked(capfd: pytest.CaptureFixture[str]) -> None:
    folder = ROOT / "raw" / "fx_pro"
    assert run("check", folder / "step_30" / "trial_01.log", "--campaign", folder) == 0
    out = capfd.readouterr().out
    assert "fault" not in out
    assert "deg by calibration/pre.log" in out


@pytest.mark.parametrize("source", ["/nowhere", ROOT / "README.md"])
def test_what_is_neither_port_nor_log(capfd: pytest.CaptureFixture[str], source: object) -> None:
    assert run("check", source) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith(f"spa-fo: {source}: ")


def test_a_port_is_told_from_a_file() -> None:
    assert is_port(Path("/dev/null"))
    assert not is_port(ROOT / "README.md")
    with pytest.raises(BadInput, match="expected a port or a log"):
        is_port(Path("/nowhere"))


def test_a_finding_is_one_line() -> None:
    assert str(Finding("ok", "rate", "50 Hz")) == "ok      rate      50 Hz"
    assert str(Finding("warning", "line", "x")) == "warning line      x"
