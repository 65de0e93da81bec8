"""The speed of a diagnosis beside that of another commit, in one run on one machine.

    python benchmarks/side_by_side.py --other 7d1a92d --out docs/diagnosis_speed.md

The two engines take turns, each time in a new process, on the same logs with the same models: of a
committed campaign, with its own fit, and of one of the rich protocol of the rig for learning.
A round takes about five minutes where nothing else runs.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import platform
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tabulate import tabulate

from spa_fo.atomic import write_text

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PROCESSES = (2, 1)


@dataclass(frozen=True)
class Engine:
    """An engine: its commit, and the sources that are run."""

    commit: str
    sources: Path


@dataclass(frozen=True)
class Timed:
    """What an engine took for a campaign: the least seconds, the most memory of all rounds."""

    seconds: Mapping[int, float]
    own_mb: float
    copy_mb: float
    said: str


def commit(name: str = "HEAD") -> str:
    git = ["git", "-C", str(ROOT)]
    head = subprocess.run(
        [*git, "rev-parse", "--short", f"{name}^{{commit}}"],
        capture_output=True,
        text=True,
        check=True,
    )
    return head.stdout.strip()


def here() -> Engine:
    """Return the engine of the checkout, with a + where it differs from its commit."""
    git = ["git", "-C", str(ROOT), "diff", "--quiet", "HEAD", "--", "src"]
    changed = subprocess.run(git, check=False).returncode
    return Engine(commit() + "+" * bool(changed), ROOT / "src")


def other(name: str, folder: Path) -> Engine:
    """Lay the sources of another commit out in a folder."""
    git = ["git", "-C", str(ROOT), "archive", "--format=tar", name, "src"]
    archive = subprocess.run(git, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        tar.extractall(folder, filter="data")
    return Engine(commit(name), folder / "src")


def run(script: str, arguments: Sequence[str], sources: Path) -> str:
    """Run a script with these sources; what it says on stderr is passed on."""
    env = {
        **os.environ,
        "PYTHONPATH": str(sources),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_WAIT_POLICY": "passive",
        "NUMBA_NUM_THREADS": str(max(PROCESSES)),
    }
    command = [sys.executable, str(HERE / script), *arguments]
    return subprocess.run(command, env=env, stdout=subprocess.PIPE, text=True, check=True).stdout


def measured(folder: Path, engine: Engine) -> dict[str, Any]:
    """Time one engine on one campaign."""
    processes = [str(n) for n in PROCESSES]
    arguments = [str(folder / "campaign"), str(folder / "model.json"), "--processes", *processes]
    answer: dict[str, Any] = json.loads(run("timed_diagnosis.py", arguments, engine.sources))
    if Path(answer["sources"]) != engine.sources.resolve():
        raise SystemExit(f"{engine.commit}: another engine was run, of {answer['sources']}")
    seconds = ", ".join(f"{t:.1f} s on {n}" for n, t in answer["seconds"].items())
    print(f"{folder.name}, {engine.commit}: {seconds}", file=sys.stderr, flush=True)
    return answer


def best(answers: Sequence[Mapping[str, Any]]) -> Timed:
    last = answers[-1]
    sets = " or ".join(" and ".join(names) for names in last["sets"])
    return Timed(
        seconds={n: min(answer["seconds"][str(n)] for answer in answers) for n in PROCESSES},
        own_mb=max(answer["own_mb"] for answer in answers),
        copy_mb=max(answer["copy_mb"] for answer in answers),
        said=f"{last['kind']}: {sets}" if sets else last["kind"],
    )


def taking_turns(
    folders: Sequence[Path], engines: Sequence[Engine], rounds: int
) -> Iterator[tuple[str, list[Timed]]]:
    """Yield each campaign with what the engines took, which ran in turns."""
    for folder in folders:
        turns = [[measured(folder, engine) for engine in engines] for _ in range(rounds)]
        yield folder.name, [best(answers) for answers in zip(*turns, strict=True)]


_PAGE = """\
# Speed of a diagnosis

Two engines in one run, which took turns ({rounds}): commit {new} beside {old}. Each turn is a
process of its own, which diagnoses the campaign once to compile, and then on {processes}; the same
logs and the same models. Seconds are the least of the rounds; the ratio is {new} to {old}. Memory
is the most that was resident, of the process itself and of the largest of its copies, which share
much of it with the process.

{machine}.

{table}

What they say:

{said}
"""


def document(
    found: Sequence[tuple[str, Sequence[Timed]]], engines: Sequence[Engine], rounds: int
) -> str:
    """Return the page in Markdown; the other engine comes first in `engines` and in `found`."""
    old, new = engines
    lines, said = [], []
    for name, (before, after) in found:
        for n in PROCESSES:
            a, b = before.seconds[n], after.seconds[n]
            what = f"{name}: seconds on {_of_processes(n)}"
            lines.append((what, f"{a:.1f}", f"{b:.1f}", f"{b / a:.2f}"))
        for what, a, b in (
            ("of the process", before.own_mb, after.own_mb),
            ("of its largest copy", before.copy_mb, after.copy_mb),
        ):
            lines.append((f"{name}: MB {what}", f"{a:.0f}", f"{b:.0f}", f"{b / a:.2f}"))
        said.append(f"- {name}: {old.commit} {before.said}; {new.commit} {after.said}")
    head = ("campaign", old.commit, new.commit, "ratio")
    align = ("left", "right", "right", "right")
    return _PAGE.format(
        rounds=f"{rounds} round{'s' * (rounds != 1)}",
        new=new.commit,
        old=old.commit,
        processes=" and on ".join(_of_processes(n) for n in PROCESSES),
        machine=f"{platform.machine()}, {os.cpu_count()} processors, "
        f"Python {platform.python_version()}",
        table=tabulate(lines, head, tablefmt="pipe", disable_numparse=True, colalign=align),
        said="\n".join(said),
    )


def _of_processes(n: int) -> str:
    return f"{n} process{'es' * (n != 1)}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--other", required=True, metavar="COMMIT", help="whose engine is beside")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", metavar="NAME", help="one campaign, by how its name begins")
    parser.add_argument("--out", type=Path, help="the page; on stdout without it")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        engines = [other(given.other, Path(scratch) / "other"), here()]
        campaigns = Path(scratch) / "campaigns"
        run("timed_campaigns.py", [str(campaigns)], here().sources)
        folders = sorted(p for p in campaigns.iterdir() if p.name.startswith(given.only or ""))
        found = list(taking_turns(folders, engines, given.rounds))
    text = document(found, engines, given.rounds)
    if given.out:
        write_text(given.out, text)
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
