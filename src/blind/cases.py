"""Write cases of the blind benchmark: ``python -m blind.cases --help``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import yaml

from blind.plan import KINDS, SCHEMA, Case, plan_cases
from blind.rigs import RIGS, further_of, rig_named
from blind.surroundings import PROTOCOL_NAMES, draw_model, draw_protocol, draw_surroundings
from blind.writer import write_cases
from spa_fo.errors import BadInput

_EXAMPLE = """\
example:
  python -m blind.cases --out /tmp/blind --rig virtual_rig --seed 1 --effect creep --size 4

writes /tmp/blind/case_0001/ (campaign, later, exclude.txt, and earlier or model.json), its sealed
label to /tmp/blind/labels/case_0001.json and the seal to /tmp/blind/seals.txt.

  python -m blind.cases --out /tmp/blind --plan plan.yaml

writes every case of a plan:

  seed: 1
  rigs: [virtual_rig, second_rig]
  no_effect: 40                    # a rig; so are the rest
  closed: {sizes: [1, 2, 4, 8]}    # each effect of the library at each size, rich protocols
  other: {sizes: [2, 8]}           # the same on the other protocols
  withheld: {sizes: [4, 8]}        # each effect once, taken out of the library
  alien: {sizes: [4, 8]}           # each foreign effect once
  further: {sizes: [4, 8]}         # each effect beyond the contract's
  pair: 10
  several: 10                      # three to five effects at once
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = _parser()
    given = parser.parse_args(arguments)
    try:
        cases = [_case(given)] if given.plan is None else _planned(given.plan)
        write_cases(
            cases,
            given.out,
            given.labels or given.out / "labels",
            lambda line: print(line, file=sys.stderr),
        )
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    except ValueError as error:
        parser.error(str(error))
    print(f"{given.out}: {len(cases)} case{'s' * (len(cases) != 1)}")
    return 0


def _planned(path: Path) -> list[Case]:
    try:
        return plan_cases(yaml.safe_load(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise BadInput(path, f"cannot be read: {error.strerror or error}") from error
    except yaml.YAMLError as error:
        raise BadInput(path, f"is no YAML: {error}") from error
    except (ValueError, TypeError) as error:
        raise BadInput(path, str(error)) from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m blind.cases",
        description="Record campaigns whose cause of the gap is known, and seal it.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the cases")
    parser.add_argument("--labels", type=Path, help="folder of the labels [OUT/labels]")
    parser.add_argument("--plan", type=Path, help="a YAML file that says which cases")
    one = parser.add_argument_group("a single case, its surroundings drawn by the seed")
    one.add_argument("--rig", choices=list(RIGS), default="virtual_rig", help="[virtual_rig]")
    one.add_argument("--seed", type=int, default=1, help="seed of all that is random [1]")
    one.add_argument("--name", default="case_0001", help="its name [case_0001]")
    one.add_argument("--kind", choices=KINDS, help="[closed, or no_effect without --effect]")
    one.add_argument("--effect", action="append", default=[], help="an effect; again for more")
    one.add_argument("--size", type=float, default=4.0, help="multiples of the noise floor [4]")
    one.add_argument("--protocol", choices=PROTOCOL_NAMES, default="rich", help="[rich]")
    return parser


def _case(given: argparse.Namespace) -> Case:
    effects = tuple(given.effect)
    kind = given.kind or ("no_effect", "closed", "pair", "several")[min(len(effects), 3)]
    if kind != "several" and len(effects) != {"no_effect": 0, "pair": 2}.get(kind, 1):
        raise ValueError(f"a case of kind {kind} has another number of effects: {len(effects)}")
    rig = rig_named(given.rig)
    known = tuple(rig.FOREIGN) if kind == "alien" else (*rig.EFFECTS, *further_of(rig))
    for effect in effects:
        if effect not in known:
            raise ValueError(f"no effect of a case of kind {kind} is called '{effect}'")
    rng = np.random.default_rng(given.seed)
    asked = {
        "schema": SCHEMA,
        "name": given.name,
        "seed": given.seed,
        "kind": kind,
        "effects": list(effects),
        "sizes": [given.size] * len(effects),
        "protocol": draw_protocol(rng, (given.protocol,)),
        "model": draw_model(rng, own="parameter_shift" not in effects),
        "surroundings": draw_surroundings(rng),
    }
    return Case(given.rig, asked, effects if kind == "withheld" else ())


if __name__ == "__main__":
    sys.exit(main())
