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
from typing import Any, NoReturn

import numba

from blind.equivalents import equivalents
from blind.judge.attempt import attempt
from blind.judge.reading import AS_ASKED, answer_in
from blind.judge.realised import campaign_data, rmse_deg
from blind.judge.records import Outcome, Realised, Surroundings, Truth
from blind.judge.targets import TARGETS
from blind.report import other_rigs
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
_COUNTS = {
    "none": (0, 0),
    "single": (1, 1),
    "pair": (2, 2),
    "several": (3, 5),
    "withheld": (1, 1),
    "foreign": (0, 0),
}
_RICH, _LEAN = "rich", "lean"
_UNSAID = Surroundings(
    "exponential", math.nan, None, math.nan, math.nan, math.nan, "none", math.nan, math.nan, 0, True
)
"""Nothing is asked of another rig's surroundings: no mark here goes by their classes."""

_EXAMPLE = """\
example:
  python -m blind.other_rig sixth/1 --rig "sixth rig" --set 1 --commit 1a2b3c4 \\
    --work /tmp/sixth_1 --out docs/blind/other_rigs.csv \\
    --answers docs/blind/other_rigs_answers.csv

CASES holds labels.json and for each case a folder of its name:

  case_001/raw/<campaign>/     what is diagnosed
  case_001/model.json          the plain model that is given
  case_001/unseen/<campaign>/  of the same specimen, for the claim; may be missing

labels.json is a list of

  {"id": "case_001",
   "kind": "none" | "single" | "pair" | "several" | "withheld" | "foreign",
   "effects": ["creep"],       what is at work; none of a foreign one
   "exclude": ["creep"],       what the library is to lack
   "floors": 4.0,              size of a single or withheld effect, in noise floors
   "floor_deg": 0.3,           by which repeats differ; without it no claim is judged
   "protocol": "rich",         repeats and releases; "lean" for less
   "pressure": true}           whether it was measured; true where it is missing

A case that has been diagnosed in the --work folder is not diagnosed again, and a set that another
commit has judged is not judged again.
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
        There is no such file; a label lacks a key, holds what it may not, or contradicts itself.
    """
    try:
        labels = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(path, f"expected a list of labels as JSON: {error}") from error
    if not isinstance(labels, list) or not all(isinstance(one, dict) for one in labels):
        raise BadInput(path, "expected a list of JSON objects")
    return tuple(_Reader(one, path, f"[{place}]").label(rig) for place, one in enumerate(labels))


@dataclass(frozen=True)
class _Reader:
    """A label in a file, read key by key."""

    given: Mapping[str, Any]
    path: Path
    where: str

    def label(self, rig: str) -> Label:
        kind, effects = self._kind(), self._names("effects")
        exclude, protocol = self._names("exclude"), self._key("protocol", _RICH)
        at_least, at_most = _COUNTS[kind]
        if not at_least <= len(effects) <= at_most:
            self._refuse("effects", f"holds {len(effects)}, which a case of '{kind}' does not")
        if kind == "withheld" and not set(effects) <= set(exclude):
            self._refuse("exclude", "lacks what is withheld")
        if protocol not in (_RICH, _LEAN):
            self._refuse("protocol", f"is {protocol!r}; expected rich or lean")
        pressure = self._key("pressure", True)
        if not isinstance(pressure, bool):
            self._refuse("pressure", f"is {pressure!r}; expected true or false")
        fair = {e for name in effects for e in equivalents(name, pressure)} - set(exclude)
        further = kind == "single" and not set(effects) <= set(CONTRACT)
        truth = Truth(
            case=str(self._key("id")),
            rig=rig,
            kind="further" if further else _KINDS[kind],
            effects=frozenset(effects),
            equivalents=frozenset(fair if kind == "withheld" else ()),
            size=self._size() if kind in ("single", "withheld") else None,
            noise_floor_deg=self._positive("floor_deg") if "floor_deg" in self.given else math.nan,
            protocol="rich" if protocol == _RICH else "up_steps",
            repeats=2 if protocol == _RICH else 1,
            order="interleaved",
            model="earlier",
            surroundings=_UNSAID,
        )
        return Label(truth, exclude)

    def _kind(self) -> str:
        kind = self._key("kind")
        if not isinstance(kind, str) or kind not in _KINDS:
            self._refuse("kind", f"is {kind!r}; expected one of {', '.join(_KINDS)}")
        return str(kind)

    def _names(self, key: str) -> tuple[str, ...]:
        names = self._key(key)
        if not isinstance(names, list):
            self._refuse(key, f"is {names!r}; expected a list")
        for name in names:
            if not isinstance(name, str) or name not in LIBRARY:
                self._refuse(key, f"is {name!r}; expected a known effect")
        return tuple(names)

    def _size(self) -> float:
        """Give the largest power of two that a size reaches nine tenths of: goals are for these."""
        return float(2.0 ** math.floor(math.log2(self._positive("floors") / AS_ASKED)))

    def _positive(self, key: str) -> float:
        value = self._key(key)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0.0 < value < math.inf:
            self._refuse(key, f"is {value!r}; expected a positive number")
        return float(value)

    def _key(self, key: str, otherwise: Any = None) -> Any:
        if key not in self.given and otherwise is None:
            self._refuse(key, "is missing")
        return self.given.get(key, otherwise)

    def _refuse(self, key: str, text: str) -> NoReturn:
        raise BadInput(self.path, text, f"{self.where}.{key}")


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


def _judged_once(known: Sequence[Mark], path: Path, rig: str, number: int, commit: str) -> None:
    """Refuse a set that another engine has judged: its answers have been read."""
    for mark in known:
        if (mark.rig, mark.seed) == (rig, number) and mark.commit != commit:
            raise BadInput(path, f"holds set {number} of the {rig}, judged by {mark.commit}")


def _by_one_engine(work: Path, made: Mapping[str, Any]) -> None:
    """Refuse a folder with diagnoses of another engine or seed."""
    note = work / "made_by.json"
    if not note.is_file():
        work.mkdir(parents=True, exist_ok=True)
        write_text(note, json.dumps(made) + "\n")
    elif json.loads(note.read_text(encoding="utf-8")) != made:
        raise BadInput(note, f"expected {json.dumps(made)}: diagnoses of one engine and seed")


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
    parser.add_argument("--answers", type=Path, help="table that the answers are added to")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--seed", type=int, default=1, help="of the diagnoses")
    given = parser.parse_args(arguments)
    with bad_input_exits():
        labels = read_labels(given.cases / "labels.json", given.rig)
        known = read_history(given.out)
        told = [] if given.answers is None else other_rigs.read_answers(given.answers)
        _judged_once(known, given.out, given.rig, given.number, given.commit)
        _by_one_engine(given.work, {"commit": given.commit, "seed": given.seed})
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
        if given.answers is not None:
            told = [one for one in told if (one.rig, one.number) != (given.rig, given.number)]
            told += [other_rigs.given(one, given.number, given.commit) for one in outcomes]
            write_text(given.answers, other_rigs.written(told))
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
