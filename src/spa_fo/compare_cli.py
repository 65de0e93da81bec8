"""The command ``spa-fo compare``: what changed between two campaigns of one actuator."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from spa_fo import places
from spa_fo.cli_shared import (
    Commands,
    add_answer,
    add_campaign,
    add_command,
    tell,
    tell_replaced,
    tell_warnings,
)

if TYPE_CHECKING:
    from spa_fo.api import Comparison


def add_compare(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "compare",
        "say what changed from one campaign of an actuator to another",
        "spa-fo compare raw/arm_in_may raw/arm_in_june --out changed\n\n"
        "What the model misses in both alike is no change. Start with DIR/comparison.md; that\n"
        "nothing changed is a result, and so is `unknown`: the command leaves with 0.",
    )
    parser.add_argument(
        "reference", metavar="REFERENCE", type=Path, help="folder of the earlier campaign"
    )
    add_campaign(parser)
    parser.add_argument(
        "--model",
        metavar="MODEL.json",
        type=Path,
        help="plain model of REFERENCE (default: one is identified on it)",
    )
    add_answer(parser, "of the identification, the held-out trials and the bootstrap")
    parser.set_defaults(run=_compare)


def _compare(options: argparse.Namespace) -> None:
    places.campaign_folder(options.reference)
    places.campaign_folder(options.campaign)
    if options.model:
        places.input_file(options.model, "a model file, as spa-fo fit makes one")
    places.output_folder(options.out)
    if _without_angle(options.reference) or _without_angle(options.campaign):
        _compare_pressure(options)
        return
    from spa_fo.api import Campaign, Model

    model = Model.load(options.model) if options.model else None
    reference, campaign = (
        Campaign.load(folder, protocols="free") for folder in (options.reference, options.campaign)
    )
    replaced = places.replaced_comparison(options.out, campaign.name, options.overwrite)
    comparison = campaign.compare(
        reference,
        model=model,
        exclude=options.exclude_effect,
        seed=options.seed,
        progress=tell,
    )
    _write(options, comparison, replaced)


def _without_angle(folder: Path) -> bool:
    from spa_fo.rig import read_campaign

    return not read_campaign(folder, angle=False).has_angle


def _compare_pressure(options: argparse.Namespace) -> None:
    """Compare by command and pressure: an angle that one campaign alone holds says nothing."""
    from spa_fo.api import Comparison
    from spa_fo.errors import BadInput
    from spa_fo.rig import read_campaign

    if options.model:
        raise BadInput("--model", "belongs to campaigns that both hold an angle")
    name = read_campaign(options.campaign, angle=False).name
    replaced = places.replaced_comparison(options.out, name, options.overwrite)
    comparison = Comparison.of_pressure(
        options.reference,
        options.campaign,
        exclude=options.exclude_effect,
        seed=options.seed,
        progress=tell,
    )
    _write(options, comparison, replaced)


def _write(options: argparse.Namespace, comparison: Comparison, replaced: str) -> None:
    tell("drawing")
    *_, page = comparison.save(options.out)
    tell_replaced(options.out, replaced)
    tell_warnings(comparison.result.reference)
    tell_warnings(comparison.result.data)
    print(*comparison.headline(), page, sep="\n")
