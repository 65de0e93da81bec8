"""Write cases of the blind benchmark: ``python -m blind.cases --help``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from blind.first_rig.build import (
    KINDS,
    MODELS,
    PROTOCOLS,
    Case,
    build,
    build_continuation,
    model_document,
)
from blind.first_rig.doses import FORMS
from blind.plan import plan_cases, read_plan
from blind.writer import check_seals, label_bytes, seal, write_cases
from spa_fo.errors import BadInput

__all__ = [
    "Case",
    "build",
    "build_continuation",
    "check_seals",
    "label_bytes",
    "main",
    "model_document",
    "plan_cases",
    "read_plan",
    "seal",
    "write_cases",
]

_EXAMPLE = """\
example:
  python -m blind.cases --out /tmp/blind --seed 1 --effect creep --size 4

writes /tmp/blind/case_0001/ (campaign, later, model.json, exclude.txt), its sealed label to
/tmp/blind/labels/case_0001.json and the seal to /tmp/blind/seals.txt.

  python -m blind.cases --out /tmp/blind --plan plan.yaml --workers 2

writes every case of a plan:

  seed: 1
  forms: [a, b]
  closed: {rich: 1, up_steps: 1, sizes: [1, 2, 4, 8]}   # of each effect, form and size
  withheld: {rich: 1, sizes: [4]}
  alien: {rich: 2, sizes: [4, 8]}                       # of each alien effect and size
  no_effect: {rich: 40, up_steps: 20}                   # in all
  pair: {rich: 30}
  own_fit: 0.3                                          # share of cases without a model
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = _parser()
    given = parser.parse_args(arguments)
    try:
        cases = [_case(given)] if given.plan is None else plan_cases(read_plan(given.plan))
    except ValueError as error:
        parser.error(str(error))
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    try:
        write_cases(cases, given.out, given.labels or given.out / "labels", given.workers)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{given.out}: {len(cases)} case{'s' * (len(cases) != 1)}")
    return 0


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
    parser.add_argument("--workers", type=int, default=1, help="processes [1]")
    one = parser.add_argument_group("a single case")
    one.add_argument("--seed", type=int, default=1, help="seed of all that is random [1]")
    one.add_argument("--name", default="case_0001", help="its name [case_0001]")
    one.add_argument("--kind", choices=KINDS, help="[closed, or no_effect without --effect]")
    one.add_argument("--effect", action="append", default=[], help="an effect; twice for a pair")
    one.add_argument("--size", type=float, default=4.0, help="multiples of the noise floor [4]")
    one.add_argument("--form", choices=list(FORMS), default="a", help="functional form [a]")
    one.add_argument("--protocol", choices=PROTOCOLS, default="rich", help="[rich]")
    one.add_argument("--model", choices=MODELS, default="nominal", help="[nominal]")
    return parser


def _case(given: argparse.Namespace) -> Case:
    effects = tuple(given.effect)
    default = ("no_effect", "closed", "pair")[min(len(effects), 2)]
    kind = given.kind or default
    return Case(
        name=given.name,
        seed=given.seed,
        kind=kind,
        effects=effects,
        form=given.form,
        sizes=(given.size,) * len(effects),
        protocol=given.protocol,
        model=given.model,
        exclude=effects if kind == "withheld" else (),
    )


if __name__ == "__main__":
    sys.exit(main())
