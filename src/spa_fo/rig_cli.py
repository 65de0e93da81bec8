"""The bench's part of the command line: ``spa-fo ports``, ``record``, ``check``, ``rig serve``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from spa_fo import places
from spa_fo.cli_numbers import finite, positive, whole

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
Command: TypeAlias = Callable[[Commands, str, str, str], argparse.ArgumentParser]

_BAUD = 500_000
_PROTOCOLS = ("step", "step_release", "staircase", "triangle", "hold", "free")


def add_rig_commands(commands: Commands, command: Command) -> None:
    """Declare the commands; what they do is imported when they run."""
    _add_ports(commands, command)
    _add_record(commands, command)
    _add_check(commands, command)
    _add_rig(commands, command)


def _add_ports(commands: Commands, command: Command) -> None:
    parser = command(
        commands, "ports", "list the serial ports with a board on them", "spa-fo ports"
    )
    parser.set_defaults(run=_ports)


def _ports(options: argparse.Namespace) -> None:
    from spa_fo.rig.record_command import run_ports

    run_ports(options)


def _add_record(commands: Commands, command: Command) -> None:
    parser = command(
        commands,
        "record",
        "record trials from a board into a campaign folder, or its sensor's calibration",
        'spa-fo record calibration /dev/ttyACM0 --campaign raw/arm --material "Ecoflex 00-30"\n'
        "  spa-fo record /dev/ttyACM0 --campaign raw/arm --experiment step_30 --setpoint 30 \\\n"
        "      --pressure 28 --trials 7\n"
        "  spa-fo record /dev/ttyACM0 --campaign raw/arm --experiment next --profile next.csv\n\n"
        "Ctrl-C vents the actuator and keeps the trial, marked as aborted. Nothing is ever\n"
        "overwritten; more trials of an experiment need no more than its name. Exit code 0: all\n"
        "trials are complete; 1: one is not; 2: bad input; 130: stopped by Ctrl-C.",
    )
    parser.add_argument(
        "port",
        nargs="+",
        metavar="[calibration] PORT",
        help="such as /dev/ttyACM0; calibration PORT leads through the known angles",
    )
    parser.add_argument("--campaign", metavar="DIR", type=Path, required=True)
    parser.add_argument("--baud", metavar="N", type=int, default=_BAUD)
    parser.add_argument(
        "--rate", metavar="HZ", type=whole, default=50, help="samples a second (default: 50)"
    )

    series = parser.add_argument_group("the trials")
    series.add_argument("--experiment", metavar="NAME", help="such as step_30")
    series.add_argument("--setpoint", metavar="DEG", type=finite, help="the angle aimed at")
    series.add_argument("--trials", metavar="N", type=whole, default=1)
    series.add_argument(
        "--rest-between",
        metavar="S",
        type=_duration,
        default=60.0,
        help="rest between two trials (default: 60)",
    )

    profile = parser.add_argument_group("the command")
    profile.add_argument(
        "--protocol", choices=_PROTOCOLS, help="default: step_release, or free with --profile"
    )
    profile.add_argument(
        "--pressure",
        metavar="KPA[,KPA...]",
        type=_pressures,
        help="command at the setpoint; all levels of a staircase",
    )
    profile.add_argument(
        "--model",
        metavar="MODEL.json",
        type=Path,
        help="take the pressure at which this model settles at the setpoint",
    )
    profile.add_argument(
        "--profile", metavar="FILE.csv", type=Path, help="columns t_s,cmd_kpa, as of spa-fo plan"
    )
    for name, what in (
        ("rest", "before the first change (default: 1.5)"),
        ("dwell", "at each level (default: 10; staircase 5, hold 60, calibration 4)"),
        ("release", "vented, at the end (default: 8; step 0, staircase 5, hold 15, triangle 4)"),
        ("ramp", "of a triangle, one way (default: 8)"),
    ):
        profile.add_argument(f"--{name}", metavar="S", type=_duration, help=what)
    profile.add_argument("--cycles", metavar="N", type=whole, help="triangles (default: 2)")

    calibration = parser.add_argument_group("the calibration")
    calibration.add_argument(
        "--angles",
        metavar="DEG,DEG,...",
        type=_angles,
        help="known angles (default: 0 to 90 and back by 15)",
    )
    calibration.add_argument(
        "--settle",
        metavar="S",
        type=_duration,
        help="do not ask at each angle, wait so long for the fixture to get there",
    )

    new = parser.add_argument_group("a new campaign")
    new.add_argument("--material", metavar="TEXT", help="begins one where DIR has none")
    new.add_argument(
        "--reference",
        metavar="KPA",
        type=positive,
        default=30.0,
        help="pressure that is u = 1 (default: 30)",
    )
    new.add_argument("--note", metavar="TEXT", default="", help="for its provenance")
    new.add_argument(
        "--synthetic", action="store_true", help="the board's actuator is a simulated one"
    )
    new.add_argument(
        "--continues", metavar="DIR", type=Path, help="earlier campaign of the same actuator"
    )
    new.add_argument(
        "--started-s",
        metavar="S",
        type=finite,
        help="campaign time of the next log, where the recorder cannot know it",
    )
    parser.set_defaults(run=_record)


def _record(options: argparse.Namespace) -> None:
    if options.port[-1].startswith("/"):
        places.input_file(Path(options.port[-1]), "a serial port (spa-fo ports lists them)")
    from spa_fo.rig.record_command import run_record

    run_record(options)


def _add_check(commands: Commands, command: Command) -> None:
    parser = command(
        commands,
        "check",
        "say whether board, wiring and sensors work, by a short run or by a log",
        "spa-fo check /dev/ttyACM0 --pressure 10\n"
        "  spa-fo check raw/arm/step_30/trial_01.log --campaign raw/arm\n\n"
        "On a port it rests, commands the pressure for four seconds, and vents. Exit code 0: no\n"
        "fault; 1: a fault was found; 2: bad input.",
    )
    parser.add_argument("source", metavar="PORT|FILE", help="a serial port, or a spa-rig log")
    parser.add_argument(
        "--pressure",
        metavar="KPA",
        type=_duration,
        default=10.0,
        help="command to try (default: 10; 0: only listen)",
    )
    parser.add_argument(
        "--campaign", metavar="DIR", type=Path, help="for its pressure sensor and calibration"
    )
    parser.add_argument("--rate", metavar="HZ", type=whole, default=50)
    parser.add_argument("--baud", metavar="N", type=int, default=_BAUD)
    parser.add_argument("--out", metavar="FILE.log", type=Path, help="keep the run's log")
    parser.set_defaults(run=_check)


def _check(options: argparse.Namespace) -> None:
    places.input_file(Path(options.source), "a serial port (spa-fo ports lists them), or a log")
    if options.campaign is not None:
        places.campaign_folder(options.campaign)
    if options.out is not None:
        places.output_file(options.out)
    from spa_fo.rig.check_command import run_check

    run_check(options)


def _add_rig(commands: Commands, command: Command) -> None:
    parser = command(
        commands,
        "rig",
        "a rig with no board on the table",
        "spa-fo rig serve --link /tmp/board",
    )
    rigs = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    serve = command(
        rigs,
        "serve",
        "open a pseudo-terminal that behaves like a board with an actuator",
        "spa-fo rig serve --link /tmp/board --speed 20 --fault cut=0.01 --fault reset@5#2\n\n"
        "Faults: a share of the data lines (flipped, cut, doubled, glued, lost), KIND=SHARE; or\n"
        "an event so many seconds into each run, KIND@S, or into the N-th only, KIND@S#N: stall\n"
        "(+S for how long), reset, unplug, wrap (of micros), pressure-stuck, pressure-railed,\n"
        "flex-stuck, flex-railed. Another --baud than the recorder's is noise at both ends.\n"
        "Ctrl-C ends it.",
    )
    serve.add_argument(
        "--specimen",
        metavar="NAME",
        default="dragon_skin_20",
        help="dragon_skin_20 (default) or fx_pro",
    )
    serve.add_argument(
        "--speed", metavar="X", type=positive, default=1.0, help="times real time (default: 1)"
    )
    serve.add_argument("--fault", metavar="ORDER", action="append", default=[])
    serve.add_argument("--baud", metavar="N", type=int, default=_BAUD)
    serve.add_argument("--limit", metavar="KPA", type=positive, default=100.0)
    serve.add_argument("--link", metavar="PATH", type=Path, help="a name for the port")
    serve.add_argument("--seed", metavar="N", type=int, default=1)
    serve.set_defaults(run=_serve)


def _serve(options: argparse.Namespace) -> None:
    from spa_fo.virtual_rig.serve import serve

    serve(
        options.specimen,
        options.speed,
        options.fault,
        options.baud,
        options.limit,
        options.link,
        options.seed,
    )


def _duration(text: str) -> float:
    value = finite(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"expected a number from 0, found {text!r}")
    return value


def _pressures(text: str) -> list[float]:
    return [_duration(part) for part in text.split(",")]


def _angles(text: str) -> list[float]:
    return [finite(part) for part in text.split(",")]
