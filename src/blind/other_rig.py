"""Judge the diagnosis on cases of anybody's rig: ``python -m blind.other_rig --help``.

A rig that learned nothing from this one, and taught it nothing, judges best. Its cases need no seal
where nobody here has looked at them; what they come out as is published all the same, set by set.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numba

from blind.equivalents import equivalents
from blind.judge.attempt import attempt
from blind.judge.reading import AS_ASKED, answer_in
from blind.judge.realised import campaign_data, rmse_deg
from blind.judge.records import Outcome, Realised, Surroundings, Truth
from blind.judge.targets import TARGETS
from blind.report.history import Mark, read_history, written
from blind.report.words import REACHED
from spa_fo.atomic import write_text
from spa_fo.edge import bad_input_exits, keep_blas_to_one_thread
from spa_fo.errors import BadInput
from spa_fo.gap import diagnose_campaign
from spa_fo.plant import read_model
from spa_fo.plant.effects.library import CONTRACT, LIBRARY

_KINDS = {
    "none": "no_effect",
    "single": "closed",
    "pair": "pair",
    "several": "several",
    "withheld": "withheld",
    "foreign": "alien",
}
_RICH, _LEAN = "rich", "lean"
_UNSAID = Surroundings(
    "exponential", math.nan, None, math.nan, math.nan, math.nan, "none", math.nan, math.nan, 0, True
)
"""Nothing is asked of another rig's surroundings: no mark here goes by their classes."""

_EXAMPLE = """\
example:
  python -m blind.other_rig sixth/1 --rig "sixth rig" --set 1 --commit 1a2b3c4 \\
    --work /tmp/sixth_1 --out docs/blind/other_rigs.csv

CASES holds labels.json and for each case a folder of its name:

  case_001/raw/<campaign>/     what is diagnosed
  case_001/model.json          the plain model that is given
  case_001/unseen/<campaign>/  of the same specimen, for the claim; may be missing

labels.json is a list of

  {"id": "case_001",
   "kind": "none" | "single" | "pair" | "several" | "withheld" | "foreign",
   "effects": ["creep"],       what is at work; none of a foreign one
   "exclude": ["creep"],       what the library is to lack
   "floors": 4.0,              size of one effect, in noise floors
   "floor_deg": 0.3,           by which repeats differ; without it no claim is judged
   "protocol": "rich",         repeats and releases; "lean" for less
   "pressure": true}           whether it was measured; true where it is missing

A case that has been diagnosed in the --work folder is not diagnosed again.
"""


@dataclass(frozen=True)
class Label:
    """What a case of another rig is, as its labels.json says."""

    truth: Truth
    exclude: tuple[str, ...]


def read_labels(path: Path, rig: str) -> tuple[Label, ...]:
    """Read the labels of a folder of cases.

    Raises
    ------
    BadInput
        There is no such file; a label lacks a key, or holds what it may not.
    """
    try:
        labels = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(path, f"expected a list of labels as JSON: {error}") from error
    if not isinstance(labels, list) or not all(isinstance(one, dict) for one in labels):
        raise BadInput(path, "expected a list of JSON objects")
    return tuple(_label(one, rig, path, f"[{place}]") for place, one in enumerate(labels))


def _label(label: Mapping[str, Any], rig: str, path: Path, where: str) -> Label:
    lost = [key for key in ("id", "kind", "effects", "exclude", "floors") if key not in label]
    if lost:
        raise BadInput(path, "is missing", f"{where}.{lost[0]}")
    kind = label["kind"]
    if kind not in _KINDS:
        raise BadInput(path, f"is {kind!r}; expected one of {', '.join(_KINDS)}", f"{where}.kind")
    for key in ("effects", "exclude"):
        for name in label[key]:
            if name not in LIBRARY:
                raise BadInput(path, f"is {name!r}; expected a known effect", f"{where}.{key}")
    protocol = label.get("protocol", _RICH)
    if protocol not in (_RICH, _LEAN):
        raise BadInput(path, f"is {protocol!r}; expected rich or lean", f"{where}.protocol")
    effects, exclude = frozenset(label["effects"]), tuple(label["exclude"])
    pressure = bool(label.get("pressure", True))
    missing = kind == "withheld"
    fair = frozenset(e for name in effects for e in equivalents(name, pressure)) - set(exclude)
    further = kind == "single" and not effects <= set(CONTRACT)
    sized = kind in ("single", "withheld", "foreign")
    truth = Truth(
        case=str(label["id"]),
        rig=rig,
        kind="further" if further else _KINDS[kind],
        effects=effects,
        equivalents=fair if missing else frozenset(),
        size=_size(label["floors"], path, where) if sized else None,
        noise_floor_deg=float(label.get("floor_deg", math.nan)),
        protocol="rich" if protocol == _RICH else "up_steps",
        repeats=2 if protocol == _RICH else 1,
        order="interleaved",
        model="earlier",
        surroundings=_UNSAID,
    )
    return Label(truth, exclude)


def _size(floors: Any, path: Path, where: str) -> float:
    """Give the largest power of two that a size reaches nine tenths of: goals are set for these."""
    if isinstance(floors, bool) or not isinstance(floors, int | float) or not floors > 0.0:
        raise BadInput(path, f"is {floors!r}; expected a positive number", f"{where}.floors")
    return float(2.0 ** math.floor(math.log2(floors / AS_ASKED)))


def outcome(cases: Path, label: Label, work: Path, seed: int) -> Outcome:
    """Diagnose a case, where that has not been done, and hold its claim against unseen trials."""
    name = label.truth.case
    case, out = cases / name, work / name
    if not any((out / done).is_file() for done in ("diagnosis.json", "error.txt")):
        out.mkdir(parents=True, exist_ok=True)
        _, message = attempt(case, _diagnose, case, label.exclude, out, seed)
        if message:
            write_text(out / "error.txt", f"{message}\n")
    answer, seen, refused = answer_in(out), None, ""
    can_tell = (case / "unseen").is_dir() and math.isfinite(label.truth.noise_floor_deg)
    if answer.claim is not None and can_tell:
        # What an identification anew would close is not asked here.
        seen, refused = attempt(case, _realised, case, out)
    return Outcome(label.truth, answer, seen, refused)


def _diagnose(case: Path, exclude: Sequence[str], out: Path, seed: int) -> None:
    diagnose_campaign(_only(case / "raw"), case / "model.json", out, tuple(exclude), seed)


def _realised(case: Path, out: Path) -> Realised:
    known = out / "realised.json"
    if not known.is_file():
        data = campaign_data(_only(case / "unseen"))
        models = case / "model.json", out / "augmented_model.json"
        before, after = (rmse_deg(read_model(path), data, path) for path in models)
        write_text(known, json.dumps({"before_deg": before, "after_deg": after}) + "\n")
    return Realised(**json.loads(known.read_text(encoding="utf-8")), refit_deg=math.nan)


def _only(folder: Path) -> Path:
    """Name the only folder in one."""
    found = sorted(path for path in folder.glob("*") if path.is_dir())
    if len(found) != 1:
        raise BadInput(folder, f"expected one campaign, found {len(found)}")
    return found[0]


def marks_of(outcomes: Sequence[Outcome], number: int, commit: str) -> list[Mark]:
    """Hold the goals of the blind benchmark against a set of cases; those without a case are out.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Of one rig.
    number : int
        Of the set.
    commit : str
        The engine that answered.
    """
    found = [(target, target.measured(outcomes)) for target in TARGETS]
    return [
        Mark(
            seed=number,
            commit=commit,
            share="1",
            rig=outcomes[0].truth.rig,
            cases=len(outcomes),
            mark=target.name,
            goal=f"{'≥' if target.at_least else '≤'} {target.goal:g}",
            value=f"{estimate.value:.3f}",
            n=estimate.n,
            reached=REACHED[target.reached(estimate)] or "",
        )
        for target, estimate in found
        if estimate.n
    ]


def _lines(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Say of each case what it is, and what was answered."""
    for one in outcomes:
        true = " + ".join(sorted(one.truth.effects)) or one.truth.kind
        sets = " or ".join(" + ".join(sorted(named)) for named in one.answer.sets)
        yield f"{one.truth.case}  {one.truth.kind}: {true}  ->  {one.answer.verdict}: {sets}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.other_rig",
        description="Diagnose a folder of labelled cases and judge the answers by the goals of the "
        "blind benchmark.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("cases", type=Path, metavar="CASES", help="labels.json and the cases")
    parser.add_argument("--rig", required=True, help="what the rig is called")
    parser.add_argument("--set", type=int, required=True, dest="number", help="number of the set")
    parser.add_argument("--commit", required=True, help="of the engine that answers")
    parser.add_argument("--work", type=Path, required=True, help="folder for the diagnoses")
    parser.add_argument("--out", type=Path, required=True, help="table that the marks are added to")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--seed", type=int, default=1, help="of the diagnoses")
    given = parser.parse_args(arguments)
    with bad_input_exits():
        labels = read_labels(given.cases / "labels.json", given.rig)
        known = read_history(given.out)
        tasks = [(given.cases, label, given.work, given.seed) for label in labels]
        with ProcessPoolExecutor(
            given.processes, mp_context=get_context("spawn"), initializer=_alone
        ) as pool:
            outcomes = []
            for task in [pool.submit(outcome, *task) for task in tasks]:
                outcomes.append(task.result())
                print(*_lines(outcomes[-1:]), file=sys.stderr, flush=True)
        found = marks_of(outcomes, given.number, given.commit)
        others = [m for m in known if (m.rig, m.seed) != (given.rig, given.number)]
        write_text(given.out, written([*others, *found]))
    for mark in found:
        missed = " missed" if mark.reached == "no" else ""
        print(f"{mark.mark}: {mark.value} of {mark.n}, goal {mark.goal}{missed}")
    return 0


def _alone() -> None:
    """Let a process of several use one processor."""
    keep_blas_to_one_thread()
    numba.set_num_threads(1)


if __name__ == "__main__":
    raise SystemExit(main())
