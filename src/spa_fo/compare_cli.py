"""The command ``spa-fo compare``: what changed between two campaigns of one actuator."""

from __future__ import annotations

import argparse
from pathlib import Path

from spa_fo import places
from spa_fo.cli_shared import (
    Commands,
    add_campaign,
    add_command,
    add_overwrite,
    add_seed,
    loaded_campaign,
    tell,
    tell_oddities,
    tell_replaced,
)


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
    parser.add_argument("--out", metavar="DIR", type=Path, required=True)
    parser.add_argument(
        "--exclude-effect",
        metavar="ID",
        action="append",
        default=[],
        help="take an effect out of the library; may be repeated",
    )
    add_seed(parser, "of the identification, the held-out trials and the bootstrap")
    add_overwrite(parser)
    parser.set_defaults(run=_compare)


def _compare(options: argparse.Namespace) -> None:
    places.campaign_folder(options.reference)
    places.campaign_folder(options.campaign)
    if options.model:
        places.input_file(options.model, "a model file, as spa-fo fit makes one")
    places.output_folder(options.out)
    from spa_fo.api import Model

    model = Model.load(options.model) if options.model else None
    reference, campaign = loaded_campaign(options.reference), loaded_campaign(options.campaign)
    replaced = places.replaced_comparison(options.out, campaign.name, options.overwrite)
    comparison = campaign.compare(
        reference,
        model=model,
        exclude=options.exclude_effect,
        seed=options.seed,
        progress=tell,
    )
    tell("drawing")
    *_, page = comparison.save(options.out)
    tell_replaced(options.out, replaced)
    tell_oddities(reference)
    tell_oddities(campaign)
    print(*comparison.headline(), page, sep="\n")
