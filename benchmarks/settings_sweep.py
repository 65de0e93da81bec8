"""How many verdicts move when a number of `spa_fo.gap.settings` is halved or doubled.

    python benchmarks/settings_sweep.py CASES... --out docs/settings_sweep.md --work FOLDER

CASES are opened cases of the blind benchmark, or folders of them, with their labels beside: in
.../labels/case_0001.json for .../cases/case_0001. Those of the rig that is for learning are taken.
Numbers that only the decision reads are decided anew on all of them; the others need every
explanation fitted anew, which is done on fewer (`--refit`). A run that is started again with the
same `--work` goes on where it was. Each fit takes about ten seconds of processor time.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spa_fo.edge import keep_blas_to_one_thread

keep_blas_to_one_thread()

from tabulate import tabulate  # noqa: E402

from real_data import commit  # noqa: E402
from spa_fo.atomic import write_text  # noqa: E402
from spa_fo.gap.settings import SETTINGS  # noqa: E402

HERE = Path(__file__).resolve().parent
RIG = "virtual_rig"
FACTORS = (0.5, 2.0)
HIGHEST = 0.95  # of a probability that is doubled
DECIDED = (
    *("right_share", "drive_share", "unknown", "nothing", "doubt", "of_all", "needed"),
    *("left", "covered", "least", "gains", "failed"),
)
"""Numbers that are read after all is fitted: in `gap/decide`, and for the trials held out.

The last says how sure one is of a verdict, and moves none.
"""

Said = tuple[str, frozenset[frozenset[str]]] | None  # the kind and the sets; None for an error
Answers = Mapping[str, Said]  # by case
Change = tuple[str, float]  # a number's name, and its other value


@dataclass(frozen=True)
class Row:
    """What one number moves.

    Parameters
    ----------
    name, unit, origin : str
    value : float
        Of the number, as in the settings.
    moves : tuple of int
        Verdicts that move when it is halved, and doubled.
    of : int
        Cases tried.
    refitted : bool
        Whether all was fitted anew.
    """

    name: str
    unit: str
    origin: str
    value: float
    moves: tuple[int, ...]
    of: int
    refitted: bool

    @property
    def share(self) -> float:
        return max(self.moves) / max(self.of, 1)


def varied(name: str, factor: float) -> float:
    units = {each: unit for each, _, unit, _, _ in SETTINGS.listed()}
    value = factor * getattr(SETTINGS, name)
    return min(value, HIGHEST) if units[name] == "probability" else value


def opened(folders: Sequence[Path]) -> Iterator[Path]:
    """Yield the cases in folders whose labels are open and of the rig that is for learning."""
    for folder in folders:
        for campaign in sorted(folder.resolve().glob("**/campaign")):
            case = campaign.parent
            label = label_of(case)
            known = json.loads(label.read_text(encoding="utf-8")) if label.is_file() else {}
            if known and known.get("rig", RIG) == RIG:
                yield case


def label_of(case: Path) -> Path:
    parts = list(case.parts)
    if "cases" in parts:
        parts[len(parts) - 1 - parts[::-1].index("cases")] = "labels"
    return Path(*parts[:-1], f"{case.name}.json")


def evenly(cases: Sequence[Any], count: int) -> list[Any]:
    """Take so many, evenly spread."""
    count = min(count, len(cases))
    return [cases[(2 * i + 1) * len(cases) // (2 * count)] for i in range(count)]


def ask(case: Path, work: Path, tag: str, options: Sequence[str]) -> dict[str, Any]:
    """Run one process on one case, unless its answer stands in `work`; errors are answers."""
    folder = work / hashlib.sha256(str(case).encode()).hexdigest()[:12]
    kept = folder / f"{tag}.json"
    if not kept.is_file():
        command = [sys.executable, str(HERE / "one_verdict.py"), str(case)]
        run = subprocess.run(
            [*command, "--models", str(folder / "model"), *options],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1"},
        )
        if run.returncode < 0 or run.returncode == 130:
            raise SystemExit(f"{case.name}: stopped")
        error = json.dumps({"error": run.stderr.strip().rpartition("\n")[2]})
        write_text(kept, error if run.returncode else run.stdout)
    answer: dict[str, Any] = json.loads(kept.read_text(encoding="utf-8"))
    return answer


def heard(said: Any) -> Said:
    return said and (said[0], frozenset(frozenset(names) for names in said[1]))


class Bar:
    """Progress on stderr."""

    def __init__(self, what: str, total: int) -> None:
        self.what, self.total, self.done, self.begun = what, total, 0, time.monotonic()

    def step(self, words: str) -> None:
        self.done += 1
        spent = time.monotonic() - self.begun
        left = spent / self.done * (self.total - self.done) / 60.0
        line = f"{self.what}: {self.done} of {self.total}, {left:.0f} min left: {words}"
        print(line, file=sys.stderr, flush=True)


def decided(
    cases: Sequence[Path], names: Sequence[str], work: Path, processes: int
) -> tuple[dict[str, Said], dict[Change, dict[str, Said]]]:
    """Return the verdicts as they are, and with each number of the decision halved and doubled."""
    changes = [(name, varied(name, factor)) for name in names for factor in FACTORS]
    options = [f"{name}={value!r}" for name, value in changes]
    tag = "_".join(["decided", hashlib.sha256(" ".join(options).encode()).hexdigest()[:8]])
    bar = Bar("deciding anew", len(cases))
    base: dict[str, Said] = {}
    others: dict[Change, dict[str, Said]] = {change: {} for change in changes}

    def one(case: Path) -> None:
        answer = ask(case, work, tag, ["--redecide", *options])
        base[str(case)] = said = heard(answer.get("said"))
        for name, value, other in answer.get("redecided", []):
            others[name, value][str(case)] = heard(other)
        bar.step(f"{case.name} {said[0] if said else answer['error']}")

    with ThreadPoolExecutor(processes) as pool:
        list(pool.map(one, cases))
    return base, others


def refitted(
    cases: Sequence[Path], names: Sequence[str], work: Path, processes: int
) -> dict[Change, dict[str, Said]]:
    """Return the verdicts with each of the other numbers halved and doubled."""
    changes = [(name, varied(name, factor)) for name in names for factor in FACTORS]
    bar = Bar("fitting anew", len(cases) * len(changes))
    others: dict[Change, dict[str, Said]] = {change: {} for change in changes}

    def one(job: tuple[Path, Change]) -> None:
        case, (name, value) = job
        answer = ask(case, work, f"{name}={value!r}", ["--set", f"{name}={value!r}"])
        others[name, value][str(case)] = heard(answer.get("said"))
        bar.step(f"{case.name} {name} {value:g} {answer.get('error', '')}".rstrip())

    with ThreadPoolExecutor(processes) as pool:
        list(pool.map(one, [(case, change) for case in cases for change in changes]))
    return others


def rows(base: Answers, others: Mapping[Change, Answers]) -> list[Row]:
    """Count what moves; the number that moves the most comes first."""
    found = []
    for name, value, unit, origin, _ in SETTINGS.listed():
        answers = [others.get((name, varied(name, factor))) for factor in FACTORS]
        tried = [a for a in answers if a]
        if len(tried) < len(FACTORS):
            continue  # not asked
        moves = tuple(sum(base[case] != said for case, said in a.items()) for a in tried)
        found.append(Row(name, unit, origin, value, moves, len(tried[0]), name not in DECIDED))
    return sorted(found, key=lambda row: -row.share)


_PAGE = """\
# How much each number matters

Each of [the numbers of the diagnosis](settings.md) halved and doubled, and how many verdicts move:
another kind of answer, or other sets named. The cases are {cases} opened cases of the blind
benchmark, all of its rig for learning ({kinds}); such cases taught the numbers that are *learned*,
so this says how firmly a number holds the verdicts, and not how right they are.

Made by `benchmarks/settings_sweep.py` at commit {commit}, seed {seed}. Numbers that are read only
after all is fitted are *decided* anew on all cases; with the others everything is *fitted* anew,
on {fewer} of the cases, evenly spread. A probability is doubled to {highest:g} at most. The
trials that are held out are the same throughout. An error counts as an answer{errors}.

{table}
"""


def document(base: Answers, others: Mapping[Change, Answers], errors: int = 0) -> str:
    """Return the page in Markdown; `errors` is the number of cases without a verdict."""
    found = rows(base, others)
    kinds = Counter(said[0] for said in base.values() if said)
    fewer = max((row.of for row in found if row.refitted), default=0)
    return _PAGE.format(
        cases=len(base),
        kinds=", ".join(f"{count} `{kind}`" for kind, count in kinds.most_common()),
        commit=commit(),
        seed=1,
        fewer=fewer,
        highest=HIGHEST,
        errors=f"; {errors} more cases end in one and are left out" if errors else "",
        table=_table(found),
    )


def _table(found: Sequence[Row]) -> str:
    head = ("number", "unit", "origin", "value", "halved: move", "doubled: move", "of", "how")
    lines = [
        (
            f"`{row.name}`",
            "" if row.unit == "1" else row.unit,
            row.origin,
            f"{row.value:g}",
            *row.moves,
            row.of,
            "fitted" if row.refitted else "decided",
        )
        for row in found
    ]
    align = ("left", "left", "left", "right", "right", "right", "right", "left")
    return str(tabulate(lines, head, tablefmt="pipe", disable_numparse=True, colalign=align))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path, nargs="+", metavar="CASES", help="folders")
    parser.add_argument("--out", type=Path, help="the page; on stdout without it")
    parser.add_argument("--decide", type=int, metavar="N", help="cases in all, evenly spread [all]")
    parser.add_argument("--refit", type=int, default=16, metavar="N", help="of these, fitted anew")
    names = [name for name, *_ in SETTINGS.listed()]
    parser.add_argument(
        "--only", nargs="+", choices=names, default=names, metavar="NAME", help="numbers [all]"
    )
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--work", type=Path, help="keeps models and answers [a temporary folder]")
    given = parser.parse_args(arguments)
    cases = list(opened(given.cases))
    if not cases:
        parser.error(f"no opened case of {RIG} in {', '.join(map(str, given.cases))}")
    cases = evenly(cases, given.decide or len(cases))
    with tempfile.TemporaryDirectory() as scratch:
        # Answers are of one state of the code.
        work = (given.work or Path(scratch)).resolve() / commit()
        quick = [name for name in given.only if name in DECIDED]
        base, others = decided(cases, quick, work, given.processes)
        answered = [case for case in cases if base[str(case)]]
        slow = [name for name in given.only if name not in DECIDED]
        fewer = evenly(answered, given.refit)
        more = refitted(fewer, slow, work, given.processes)
    known = {str(case): base[str(case)] for case in answered}
    text = document(known, {**others, **more}, len(cases) - len(answered))
    if given.out:
        write_text(given.out, text)
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
