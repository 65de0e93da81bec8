"""``spa-fo record`` and ``spa-fo ports``: from options to a series of trials."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from spa_fo.atomic import write_bytes
from spa_fo.errors import BadInput
from spa_fo.rig.board_link import BoardInfo, BoardLink, ports
from spa_fo.rig.campaign import Protocol
from spa_fo.rig.campaign_files import Setup
from spa_fo.rig.command_profile import CommandProfile, plateaus, read_profile, triangle
from spa_fo.rig.record_series import (
    INTERRUPTED,
    STOPPED,
    Interruption,
    Series,
    record_dwells,
    record_series,
)
from spa_fo.rig.recording import RecordingFolder

ANGLES_DEG = (*range(0, 91, 15), *range(75, -1, -15))

_COPY = "profile.csv"
_SHAPE: Mapping[str, Mapping[str, float]] = {
    "step": {"rest": 1.5, "dwell": 10.0, "release": 0.0},
    "step_release": {"rest": 1.5, "dwell": 10.0, "release": 8.0},
    "staircase": {"rest": 1.5, "dwell": 5.0, "release": 5.0},
    "hold": {"rest": 1.5, "dwell": 60.0, "release": 15.0},
    "triangle": {"rest": 1.5, "ramp": 8.0, "release": 4.0, "cycles": 2},
}


# --- the profile ----------------------------------------------------------------------------------


def profile_of(options: Mapping[str, Any], folder: Path) -> CommandProfile:
    """Make a command profile from its options: protocol, and levels_kpa and shape, or a file.

    Raises
    ------
    BadInput
        The pressures are missing, or the protocol takes others.
    """
    protocol: Protocol = options["protocol"]
    if "file" in options:
        return read_profile(folder / options["file"], protocol)
    if protocol == "free":
        raise BadInput("--profile", "expected a file with t_s,cmd_kpa for protocol free")
    levels = options.get("levels_kpa")
    if not levels:
        raise BadInput("--pressure", "expected the command in kPa: the board knows no angles")
    if protocol != "staircase" and len(levels) > 1:
        raise BadInput("--pressure", f"expected one pressure for a {protocol}, found {len(levels)}")
    if protocol == "staircase" and len(levels) < 2:
        raise BadInput("--pressure", "expected the levels of the staircase: 10,20,30,20,10")
    shape = {**_SHAPE[protocol], **options.get("shape", {})}
    if protocol == "triangle":
        return triangle(
            levels[0], int(shape["cycles"]), shape["rest"], shape["ramp"], shape["release"]
        )
    return plateaus(protocol, levels, shape["rest"], shape["dwell"], shape["release"])


def asked_for(given: argparse.Namespace, before: Mapping[str, Any] | None) -> dict[str, Any]:
    """Combine what the command line says of the profile with what this experiment did before."""
    if given.profile is not None:
        return {"protocol": given.protocol or "free", "file": f"{given.experiment}/{_COPY}"}
    shape = {
        key: value
        for key in ("rest", "dwell", "release", "ramp", "cycles")
        if (value := getattr(given, key)) is not None
    }
    said = given.protocol or given.pressure or shape
    if before is not None and not said:
        return dict(before)
    base = before if before is not None and "file" not in before else {}
    protocol = given.protocol or base.get("protocol", "step_release")
    unknown = set(shape) - set(_SHAPE.get(protocol, {}))
    if unknown:
        raise BadInput(f"--{min(unknown)}", f"a {protocol} has none")
    return {
        "protocol": protocol,
        "levels_kpa": given.pressure or base.get("levels_kpa"),
        "shape": {**base.get("shape", {}), **shape},
    }


def pressure_for(angle_deg: float, model: Path) -> float:
    """Give the pressure at which a plain model settles at an angle, kPa to two decimals."""
    import json

    try:
        document = json.loads(model.read_text(encoding="utf-8"))
        b0 = float(document["transfer_function"]["b0"])
        a0 = float(document["transfer_function"]["a0"])
        reference_kpa = float(document["input"]["reference_kpa"])
        return round(math.radians(angle_deg) * a0 / b0 * reference_kpa, 2)
    except (OSError, ValueError, KeyError, TypeError, ZeroDivisionError) as error:
        raise BadInput(model, f"cannot be used ({error!r}); expected a model file") from error


# --- the commands ---------------------------------------------------------------------------------


def run_ports(options: argparse.Namespace) -> None:
    """Print the serial ports, one a line."""
    found = ports()
    for port in found:
        print(f"{port.path}  {port.what}".rstrip())
    if not found:
        print("no serial port with anything plugged in", file=sys.stderr)


def run_record(options: argparse.Namespace) -> None:
    """Record a series of trials, or a calibration."""
    calibrating = options.port[0] == "calibration"
    port = _port(options.port[1:] if calibrating else options.port)
    if not calibrating:
        _check_series(options)
    interruption = Interruption()
    with interruption.heeded(), BoardLink(port, options.baud) as link:
        tell(f"waiting for the board at {port}")
        info = link.wait_ready()
        tell(f"board {info.banner.board or 'unknown'}, up to {info.limit_kpa:g} kPa")
        setup = _setup(options, info)
        campaign = RecordingFolder(options.campaign, setup, options.continues)
        with campaign as folder, interruption.gently():
            for kept in folder.recovered:
                if kept.file:
                    tell(f"recovered {kept.file}: {kept.why}, now {kept.place or 'set aside'}")
            if calibrating:
                angles = _led(options, interruption)
                result = [
                    record_dwells(
                        link, info, folder, angles, options.dwell or 4.0, options.rate,
                        options.started_s, interruption, tell,
                    )
                ]  # fmt: skip
                wanted = 1
            else:
                series = _series(options, folder, info)
                result = record_series(link, info, folder, series, interruption, tell)
                wanted = series.trials
    bad = [kept for kept in result if kept.why]
    if interruption.why == STOPPED:
        raise SystemExit(INTERRUPTED)
    if bad or len(result) < wanted:
        raise SystemExit(1)


def tell(text: str) -> None:
    """Say something to the person at the bench."""
    print(text, file=sys.stderr, flush=True)


def _port(given: Sequence[str]) -> str:
    if len(given) == 1:
        return given[0]
    if given:
        raise BadInput("PORT", f"expected one port, found {' '.join(given)}")
    boards = ports()
    if len(boards) != 1:
        raise BadInput("PORT", f"expected a port, as {len(boards)} are there (spa-fo ports)")
    return boards[0].path


def _check_series(options: argparse.Namespace) -> None:
    name = options.experiment
    if name is None:
        raise BadInput("--experiment", "expected a name, such as step_30")
    if name in ("", ".", "..", "calibration") or not all(c.isalnum() or c in "-_." for c in name):
        raise BadInput("--experiment", f"expected letters, digits, - and _, found {name!r}")


def _setup(options: argparse.Namespace, info: BoardInfo) -> Setup | None:
    if options.material is None or (options.campaign / "campaign.yaml").exists():
        return None
    virtual = info.banner.board.startswith("virtual")
    return Setup(
        material=options.material,
        reference_kpa=options.reference,
        vref_mv=info.banner.vref_mv,
        adc_max=info.banner.adc_max,
        kind="synthetic" if virtual or options.synthetic else "measured",
        note="recorded from a virtual board" if virtual else options.note,
    )


def _series(options: argparse.Namespace, folder: RecordingFolder, info: BoardInfo) -> Series:
    before = folder.profile(options.experiment)
    if options.model is not None and options.setpoint is not None and options.pressure is None:
        options.pressure = [pressure_for(options.setpoint, options.model)]
    if _needs_pressure(options, before):
        reference_kpa = float(folder.campaign["input"]["reference_kpa"])
        options.pressure = [reference_kpa]
        print(
            f"note: neither --pressure nor --model for {options.setpoint:g} deg: commands the "
            f"campaign's reference of {reference_kpa:g} kPa",
            file=sys.stderr,
        )
    asked = asked_for(options, before)
    asked["setpoint_deg"] = options.setpoint
    if options.setpoint is None:
        asked["setpoint_deg"] = _known_setpoint(folder, options.experiment, before)
    if options.profile is not None:
        _keep_profile(options.profile, folder, options.experiment)
    profile = profile_of(asked, folder.folder)
    if profile.largest_kpa > info.limit_kpa:
        raise BadInput(
            "--pressure",
            f"commands up to {profile.largest_kpa:g} kPa, but the board's limit is "
            f"{info.limit_kpa:g} kPa",
        )
    _check_rate(options.rate, info)
    return Series(
        options.experiment,
        asked["setpoint_deg"],
        profile,
        asked,
        options.trials,
        options.rest_between,
        options.rate,
        options.started_s,
    )


def _needs_pressure(options: argparse.Namespace, before: Mapping[str, Any] | None) -> bool:
    """Whether a first step to a setpoint comes without a pressure."""
    single = options.protocol in (None, "step", "step_release", "hold", "triangle")
    return (
        options.setpoint is not None
        and options.pressure is None
        and options.profile is None
        and before is None
        and single
    )


def _known_setpoint(
    folder: RecordingFolder, experiment: str, before: Mapping[str, Any] | None
) -> float | None:
    entry = folder.experiment(experiment) or before or {}
    known = entry.get("setpoint_deg")
    return None if known is None else float(known)


def _keep_profile(source: Path, folder: RecordingFolder, experiment: str) -> None:
    """Copy a profile file beside the trials that follow it."""
    read_profile(source)
    copy = folder.folder / experiment / _COPY
    data = source.read_bytes()
    if copy.exists() and copy.read_bytes() != data and folder.trials(experiment):
        raise BadInput(
            source,
            f"is not the profile of the trials that '{experiment}' has ({copy}); expected the "
            "same, or another --experiment",
        )
    write_bytes(copy, data)


def _check_rate(rate_hz: int, info: BoardInfo) -> None:
    if rate_hz > info.max_rate_hz:
        raise BadInput("--rate", f"{rate_hz} Hz, but the board samples at {info.max_rate_hz:g} Hz")


def _led(options: argparse.Namespace, interruption: Interruption) -> Iterator[float]:
    """Give the angles; where a person moves the fixture, wait for each to stand still."""
    angles = options.angles or ANGLES_DEG
    for place, angle in enumerate(angles, start=1):
        if options.settle is not None:
            time.sleep(options.settle)
        else:
            interruption.ask(
                f"{place}/{len(angles)}: set the fixture to {angle:g} deg, then press Enter "
            )
        if interruption() is not None:
            return
        yield angle
