"""The part of the command line that takes a model elsewhere: ``spa-fo export``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from spa_fo import places
from spa_fo.cli_numbers import positive, whole
from spa_fo.cli_shared import add_overwrite, in_place_of, tell

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
Command: TypeAlias = Callable[[Commands, str, str, str], argparse.ArgumentParser]

# As `spa_fo.export` has them; repeated, so that `--help` need not import it (a test compares).
TARGETS = ("python-control", "simulink", "oustaloup", "csv")
METHODS = ("fitted", "oustaloup")
HOLDS = ("zoh", "tustin")


def add_export(commands: Commands, command: Command) -> None:
    """Declare the command; what it does is imported when it runs."""
    parser = command(
        commands,
        "export",
        "write a model for python-control, Simulink, a filter bank or a microcontroller, with the "
        "error of its rational approximation",
        "spa-fo export model.json --to python-control\n"
        "  spa-fo export model.json --to oustaloup --band 0.01 100 --order 5 --out filters.json\n"
        "  spa-fo export model.json --to csv --sample-time 0.01 --figure approximation.png\n\n"
        "Static gain is exact. The errors over the band and in the step response are computed,\n"
        "printed and written into the file.",
    )
    parser.add_argument("model", metavar="MODEL.json", type=Path)
    parser.add_argument(
        "--to",
        choices=TARGETS,
        required=True,
        help="python-control: a Python file; simulink: a script for MATLAB or Octave; oustaloup: "
        "zeros, poles and gains, JSON; csv: sections of a discrete filter",
    )
    parser.add_argument(
        "--out", metavar="FILE", type=Path, help="default: beside the model, by its name"
    )
    parser.add_argument(
        "--figure", metavar="FILE.png", type=Path, help="draw Bode and step plots, PNG and PDF"
    )
    parser.add_argument(
        "--method",
        choices=METHODS,
        help="oustaloup: Oustaloup's filter for each fractional power (default for --to "
        "oustaloup); fitted: poles and zeros of the whole, more accurate at equal order (default "
        "elsewhere)",
    )
    parser.add_argument(
        "--band",
        nargs=2,
        type=positive,
        metavar=("LOW", "HIGH"),
        help="rad/s where it is to hold (default: two decades around the model's time scales, up "
        "to half the sampling rate)",
    )
    parser.add_argument(
        "--order",
        type=whole,
        metavar="N",
        help="oustaloup: 2N + 1 zeros and poles for each power (default: 5); fitted: number of "
        "poles (default: 10)",
    )
    parser.add_argument(
        "--sample-time",
        metavar="S",
        type=positive,
        help="of the discrete filter (default: that of the model's logs)",
    )
    parser.add_argument(
        "--hold",
        choices=HOLDS,
        default="zoh",
        help="input between samples: held (zoh, the default), or straight (tustin)",
    )
    parser.add_argument(
        "--linear-part",
        action="store_true",
        help="export the linear part of an augmented model, which is otherwise refused",
    )
    add_overwrite(parser)
    parser.set_defaults(run=_export)


def _export(options: argparse.Namespace) -> None:
    places.input_file(options.model, "a model file, as spa-fo fit makes one")
    for path in (options.out, options.figure):
        if path is not None:
            places.output_file(path)
    from spa_fo.api import Model
    from spa_fo.export.exported import file_suffix

    exported = Model.load(options.model).approximate(
        method=options.method or ("oustaloup" if options.to == "oustaloup" else None),
        band=None if options.band is None else tuple(options.band),
        order=options.order,
        sample_time_s=options.sample_time,
        hold=options.hold,
        linear_part=options.linear_part,
    )
    path = options.out or options.model.with_name(options.model.stem + file_suffix(options.to))
    own = f"campaign {exported.made.model.campaign} ("  # every target's first line
    replaced = places.replaced_file(path, own, "an export of the same campaign", options.overwrite)
    exported.save(options.to, path)
    print(exported)
    tell(f"{path}: for {options.to}{in_place_of(replaced)}")
    if options.figure:
        drawn = exported.save_figure(options.figure)
        tell(f"{', '.join(map(str, drawn))}: Bode and step")
