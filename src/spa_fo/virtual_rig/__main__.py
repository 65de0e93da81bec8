"""Write a campaign of the virtual rig: ``python -m spa_fo.virtual_rig --help``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from spa_fo.errors import BadInput
from spa_fo.virtual_rig.actuators import PLANS
from spa_fo.virtual_rig.campaign_writer import write_campaign

_EXAMPLE = """\
example:
  python -m spa_fo.virtual_rig dragon_skin_20 --seed 1 --out /tmp/raw

writes /tmp/raw/dragon_skin_20: the same seed gives the same bytes.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m spa_fo.virtual_rig",
        description="Record a campaign from a simulated soft actuator, as raw serial logs.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("campaign", choices=[*PLANS, "all"], help="which actuator is on the bench")
    parser.add_argument("--seed", type=int, default=1, help="seed of all that is random [1]")
    parser.add_argument(
        "--out", type=Path, required=True, help="where the campaign's folder is made"
    )
    given = parser.parse_args(arguments)
    if given.seed < 0:
        parser.error("--seed: expected a whole number that is not negative")
    names = list(PLANS) if given.campaign == "all" else [given.campaign]
    try:
        for name in names:
            write_campaign(PLANS[name], given.seed, given.out / name)
            print(given.out / name)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
