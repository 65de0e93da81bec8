"""What several commands share: options, checks of their outputs, and what they tell."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from spa_fo import places

if TYPE_CHECKING:
    from spa_fo.api import Campaign
    from spa_fo.rig import CampaignData

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def add_command(
    commands: Commands, name: str, summary: str, example: str
) -> argparse.ArgumentParser:
    """Declare a command whose help ends with an example."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    return parser


def add_campaign(parser: argparse.ArgumentParser) -> None:
    """Take a campaign."""
    parser.add_argument(
        "campaign", metavar="CAMPAIGN", type=Path, help="folder with campaign.yaml and the logs"
    )


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """Let it be drawn: `what` says what."""
    parser.add_argument(
        "--plot", metavar="FILE", type=Path, help=f"draw {what}: FILE.png and FILE.pdf"
    )


def add_overwrite(parser: argparse.ArgumentParser) -> None:
    """Let anything be replaced."""
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="replace what --out holds, whatever it is; without it only an earlier result of the "
        "same kind and campaign",
    )


def add_answer(parser: argparse.ArgumentParser, purpose: str) -> None:
    """Say where an answer goes, what it is to do without, and its seed: `purpose` says of what."""
    parser.add_argument("--out", metavar="DIR", type=Path, required=True)
    parser.add_argument(
        "--exclude-effect",
        metavar="ID",
        action="append",
        default=[],
        help="take an effect out of the library; may be repeated",
    )
    add_seed(parser, purpose)
    add_overwrite(parser)


def add_seed(parser: argparse.ArgumentParser, purpose: str) -> None:
    """Take a seed: `purpose` says of what."""
    parser.add_argument(
        "--seed", metavar="N", type=_seed, default=1, help=f"{purpose} (default: 1)"
    )


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"expected a whole number from 0, found {text!r}")
    return int(text)


def check_outputs(options: argparse.Namespace) -> None:
    """Refuse files that cannot be written, before anything is computed."""
    for path in (options.out, getattr(options, "plot", None)):
        if path is not None:
            places.output_file(path)


def spare_inputs(options: argparse.Namespace, *others: Path) -> None:
    """Refuse to write over the campaign, or over other files that are read."""
    from spa_fo.rig.checksums import spare

    spare(options.out, options.campaign, *others)


def in_place_of(what: str) -> str:
    """Add to a line what was replaced, if anything was."""
    return f", in place of {what}" if what else ""


def tell_replaced(place: Path, what: str) -> None:
    """Say on stderr what was replaced, if anything was; only now, as a refusal is one line."""
    if what:
        tell(f"{place}: replaced {what}")


def tell_drawn(paths: Sequence[Path]) -> None:
    """Say on stderr where the pictures are."""
    tell(f"drawn: {', '.join(map(str, paths))}")


def loaded_campaign(folder: Path) -> Campaign:
    """Read a campaign."""
    from spa_fo.api import Campaign

    return Campaign.load(folder)


def tell_oddities(campaign: Campaign) -> None:
    """Say what is odd about a campaign; only when all went well, as a refusal is one line."""
    tell_warnings(campaign.data)


def tell_warnings(data: CampaignData) -> None:
    """Say what is odd about a campaign's data."""
    for warning in data.report.warnings:
        tell(f"{data.campaign.folder}: {warning}")


def tell(step: str) -> None:
    """Say something on stderr, at once."""
    print(step, file=sys.stderr, flush=True)
