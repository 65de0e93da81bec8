"""The command line: ``spa-fo parse``, ``fit``, ``predict``, ``diagnose``, ``compare`` and more.

Every command leaves with 0 when done, with 2 on bad input, after one clear line on stderr, and with
130 when it was stopped by Ctrl-C. What it is given is looked at before its work is imported: a
refusal must not wait for Numba.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from spa_fo import __version__, places
from spa_fo.cli_numbers import positive
from spa_fo.cli_parser import CommandParser
from spa_fo.cli_shared import (
    Commands,
    add_answer,
    add_campaign,
    add_command,
    add_overwrite,
    add_plot,
    add_seed,
    check_outputs,
    in_place_of,
    loaded_campaign,
    spare_inputs,
    tell,
    tell_drawn,
    tell_oddities,
    tell_replaced,
)
from spa_fo.compare_cli import add_compare
from spa_fo.edge import (
    bad_input_exits,
    closed_pipe_is_no_error,
    interrupt_exits,
    keep_blas_to_one_thread,
)
from spa_fo.errors import BadInput
from spa_fo.export_cli import add_export
from spa_fo.rig_cli import add_rig_commands

if TYPE_CHECKING:
    pass

_A_MODEL = "a model file, as spa-fo fit makes one"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the process's exit code is returned, or raised as SystemExit."""
    with interrupt_exits(), bad_input_exits(), closed_pipe_is_no_error():
        options = command_line().parse_args(arguments)
        if isinstance(sys.stdout, io.TextIOWrapper):
            # A terminal of another encoding shows a question mark for χ; it is no reason to fail.
            sys.stdout.reconfigure(errors="replace")
        keep_blas_to_one_thread()
        options.run(options)
    return 0


def command_line() -> argparse.ArgumentParser:
    """Declare every command."""
    parser: argparse.ArgumentParser = CommandParser(
        prog="spa-fo",
        description="Fractional-order models of soft pneumatic actuators, from raw serial logs.",
    )
    parser.add_argument("--version", action="version", version=f"spa-fo {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _add_parse(commands)
    _add_inspect(commands)
    _add_init(commands)
    _add_fit(commands)
    _add_predict(commands)
    _add_diagnose(commands)
    add_compare(commands)
    _add_plan(commands)
    add_export(commands, add_command)
    add_rig_commands(commands, add_command)
    return parser


def _add_parse(commands: Commands) -> None:
    parser = add_command(
        commands,
        "parse",
        "read a campaign's raw logs and say what they hold and what is damaged in them",
        "spa-fo parse raw/dragon_skin_20 --out trials.csv",
    )
    add_campaign(parser)
    parser.add_argument(
        "--out", metavar="FILE.csv", type=Path, help="write the angles, sample by sample"
    )
    add_plot(parser, "every trial")
    add_overwrite(parser)
    parser.set_defaults(run=_parse)


def _parse(options: argparse.Namespace) -> None:
    places.campaign_folder(options.campaign)
    check_outputs(options)
    from spa_fo.api import Campaign
    from spa_fo.rig.trial_table import TABLE_COLUMNS

    campaign = Campaign.load(options.campaign)
    if options.out:
        spare_inputs(options)
        head = ",".join(TABLE_COLUMNS)
        replaced = places.replaced_file(options.out, head, "a table of trials", options.overwrite)
        campaign.save_table(options.out)
        samples = sum(trial.t_s.size for trial in campaign.trials)
        tell(f"{options.out}: {samples} samples{in_place_of(replaced)}")
    if options.plot:
        tell_drawn(campaign.save_figure(options.plot))
    print(f"{campaign.describe()}\n\n{campaign.parse_report.to_markdown()}")


def _add_inspect(commands: Commands) -> None:
    parser = add_command(
        commands,
        "inspect",
        "say what a log of any make holds, guess its columns, and print the section for "
        "campaign.yaml that reads it",
        "spa-fo inspect step_20psi.csv\n  spa-fo inspect step_20psi.csv --plot look",
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="a csv log, or a spa-rig log")
    parser.add_argument("--plot", metavar="STEM", type=Path, help="draw it: STEM.png and STEM.pdf")
    parser.set_defaults(run=_inspect)


def _inspect(options: argparse.Namespace) -> None:
    places.input_file(options.file, "a csv log, or a spa-rig log")
    if options.plot:
        places.output_file(options.plot)
    from spa_fo.rig.inspect_log import inspect_log

    inspection = inspect_log(options.file)
    if options.plot:
        from spa_fo.report.inspect_figure import write_inspect_figure

        write_inspect_figure(inspection, options.plot)
    print(inspection.text(), end="")


def _add_init(commands: Commands) -> None:
    parser = add_command(
        commands,
        "init",
        "draft campaign.yaml and SHA256SUMS from the logs in a folder, and draw them",
        "spa-fo init raw/my_arm\n  spa-fo parse raw/my_arm\n\n"
        "What it is unsure of stands as comments in campaign.yaml. It replaces nothing.",
    )
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="logs of one actuator")
    parser.set_defaults(run=_init)


def _init(options: argparse.Namespace) -> None:
    places.log_folder(options.folder)
    from spa_fo.api.init import init_campaign

    print(init_campaign(options.folder))


def _add_fit(commands: Commands) -> None:
    parser = add_command(
        commands,
        "fit",
        "identify the fractional-order model of a campaign: on its up-steps, or on whole logs "
        "where it has none",
        "spa-fo fit raw/dragon_skin_20 --out model.json\n"
        "  spa-fo fit raw/soft_arm_steps --static-curve --out curved.json\n\n"
        "A static curve goes into the model where held-out levels are predicted better\n"
        "with it; the report says what it gains. A model with a curve is for `predict`.",
    )
    add_campaign(parser)
    parser.add_argument("--out", metavar="MODEL.json", type=Path, required=True)
    add_seed(parser, "of the swarm")
    parser.add_argument(
        "--whole-logs",
        action="store_true",
        help="fit whole logs even where there are up-steps",
    )
    parser.add_argument(
        "--input",
        choices=("command", "pressure"),
        help="signal that drives the model; pressure is fitted on whole logs (default: command, "
        "where the logs hold one that is a pressure)",
    )
    parser.add_argument(
        "--static-curve",
        action="store_true",
        help="try a monotone curve before or behind the linear part as well, on whole logs, and "
        "judge it by held-out levels",
    )
    parser.add_argument(
        "--bound",
        metavar="NAME=LOW:HIGH",
        action="append",
        default=[],
        help="search a parameter (alpha2, alpha1, a1, a0, b0) within these bounds; may be repeated",
    )
    add_overwrite(parser)
    parser.set_defaults(run=_fit)


def _fit(options: argparse.Namespace) -> None:
    places.campaign_folder(options.campaign)
    check_outputs(options)
    bounds = _bounds(options.bound)
    from spa_fo.api.campaign import search_box

    search_box(bounds)  # refused before the campaign is read
    spare_inputs(options)
    campaign = loaded_campaign(options.campaign)
    replaced = places.replaced_model(options.out, campaign.name, options.overwrite)
    result = campaign.fit(
        seed=options.seed,
        whole_logs=options.whole_logs,
        input=options.input,
        bounds=bounds,
        static_curve=options.static_curve,
    )
    result.save(options.out)
    tell_replaced(options.out, replaced)
    tell_oddities(campaign)
    print(result)


def _bounds(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    ranges = {}
    for text in texts:
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        try:
            ranges[name] = (float(low), float(high))
        except ValueError:
            raise BadInput(
                "--bound", f"expected NAME=LOW:HIGH, such as a0=1:2, found {text!r}"
            ) from None
    return ranges


def _add_predict(commands: Commands) -> None:
    parser = add_command(
        commands,
        "predict",
        "run a model on a campaign and write the measured and the predicted angle of every sample",
        "spa-fo predict model.json raw/dragon_skin_20 --out prediction.csv\n"
        "  spa-fo predict diagnosis/augmented_model.json raw/arm_later --out later.csv\n\n"
        "A model with effects runs through the whole campaign in the order of its trials; where\n"
        "campaign.yaml says that it continues the model's own, from the state that one ended in.",
    )
    parser.add_argument(
        "model", metavar="MODEL.json", type=Path, help="plain, or augmented with effects"
    )
    add_campaign(parser)
    parser.add_argument("--out", metavar="FILE.csv", type=Path, required=True)
    add_plot(parser, "measured against predicted")
    add_overwrite(parser)
    parser.set_defaults(run=_predict)


def _predict(options: argparse.Namespace) -> None:
    places.input_file(options.model, _A_MODEL)
    places.campaign_folder(options.campaign)
    check_outputs(options)
    from spa_fo.api import Model
    from spa_fo.identify.predict import PREDICTION_COLUMNS

    spare_inputs(options, options.model)
    head = ",".join(PREDICTION_COLUMNS)
    replaced = places.replaced_file(options.out, head, "a prediction", options.overwrite)
    prediction = Model.load(options.model).predict(loaded_campaign(options.campaign))
    prediction.save(options.out)
    for note in filter(None, (prediction.stranger, prediction.note)):
        tell(f"{options.model}: {note}")
    tell_oddities(prediction.campaign)
    samples, trials = len(prediction.table), len(prediction.campaign.trials)
    tell(f"{options.out}: {samples} samples of {trials} trials{in_place_of(replaced)}")
    print(prediction)
    if options.plot:
        tell_drawn(prediction.save_figure(options.plot))


def _add_diagnose(commands: Commands) -> None:
    parser = add_command(
        commands,
        "diagnose",
        "say whether, where and why model and actuator disagree, and how far the gap closes",
        "spa-fo diagnose raw/dragon_skin_20 --model model.json --out diagnosis\n\n"
        "Open DIR/diagnosis.html. DIR/augmented_model.json is the model with the explanation\n"
        "in it; `predict` takes it. An answer of `unknown` is a result: the command ends with 0.\n"
        "Effects of your own, effects/*.py in the campaign's folder, are run and weighed as well.",
    )
    add_campaign(parser)
    parser.add_argument(
        "--model", metavar="MODEL.json", type=Path, required=True, help="plain, without effects"
    )
    add_answer(parser, "of the held-out trials and the bootstrap")
    parser.set_defaults(run=_diagnose)


def _diagnose(options: argparse.Namespace) -> None:
    places.input_file(options.model, _A_MODEL)
    places.campaign_folder(options.campaign)
    places.output_folder(options.out)
    from spa_fo.api import Campaign, Model
    from spa_fo.gap.diagnose import check_request
    from spa_fo.plant.effects.own import use_effects_of

    model = Model.load(options.model)
    use_effects_of(options.campaign)
    check_request(model.document, options.exclude_effect, options.model)
    campaign = Campaign.load(options.campaign)
    replaced = places.replaced_diagnosis(options.out, campaign.name, options.overwrite)
    diagnosis = model.diagnose(
        campaign, exclude=options.exclude_effect, seed=options.seed, progress=tell
    )
    tell("drawing")
    *_, page = diagnosis.save(options.out)
    tell_replaced(options.out, replaced)
    print(*diagnosis.headline(), page, sep="\n")


def _add_plan(commands: Commands) -> None:
    parser = add_command(
        commands,
        "plan",
        "write the pressure profile that best discriminates what a diagnosis left open",
        "spa-fo plan raw/arm --diagnosis diagnosis/diagnosis.json --out next.csv\n\n"
        "FILE.csv holds the command, t_s,cmd_kpa, each row held until the next. The profile is\n"
        "meant for the same actuator, in a campaign that continues this one. It goes no higher\n"
        "and no faster than the campaign did, unless told otherwise.",
    )
    add_campaign(parser)
    parser.add_argument("--diagnosis", metavar="DIAGNOSIS.json", type=Path, required=True)
    parser.add_argument("--out", metavar="FILE.csv", type=Path, required=True)
    parser.add_argument(
        "--max-duration",
        metavar="S",
        type=positive,
        help="longest profile (default: 120, or as long as the campaign's longest trial)",
    )
    parser.add_argument(
        "--max-pressure",
        metavar="KPA",
        type=positive,
        help="largest command (default: the campaign's)",
    )
    add_overwrite(parser)
    parser.set_defaults(run=_plan)


def _plan(options: argparse.Namespace) -> None:
    places.campaign_folder(options.campaign)
    places.input_file(options.diagnosis, "diagnosis.json, as spa-fo diagnose writes one")
    check_outputs(options)
    from spa_fo.api.plan import plan_next
    from spa_fo.gap.plan.profiles import BANNER
    from spa_fo.gap.plan.rivals import read_standing
    from spa_fo.plant.effects.own import use_effects_of

    spare_inputs(options, options.diagnosis)
    replaced = places.replaced_file(options.out, BANNER, "a planned profile", options.overwrite)
    campaign = loaded_campaign(options.campaign)
    use_effects_of(options.campaign)
    standing = read_standing(options.diagnosis, campaign.name)
    plan = plan_next(campaign, standing, options.max_duration, options.max_pressure)
    plan.save(options.out)
    tell_replaced(options.out, replaced)
    tell_oddities(campaign)
    print(plan)


if __name__ == "__main__":
    sys.exit(main())
