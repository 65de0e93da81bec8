"""Seconds and memory of a diagnosis, as JSON on stdout: of whichever spa_fo PYTHONPATH names.

    python benchmarks/timed_diagnosis.py CAMPAIGN MODEL --processes 2 1

A first diagnosis, which is not timed, compiles. `side_by_side.py` runs it with two engines, so it
asks of a package only what both have.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from pathlib import Path

import numba

import spa_fo
from spa_fo.gap import diagnose
from spa_fo.plant import read_model
from spa_fo.rig import read_campaign, read_trials


def megabytes(whose: int) -> float:
    return resource.getrusage(whose).ru_maxrss / 1024.0


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("campaign", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--processes", type=int, nargs="+", default=[2, 1])
    given = parser.parse_args()
    data, plain = read_trials(read_campaign(given.campaign)), read_model(given.model)
    numba.set_num_threads(max(given.processes))
    found = diagnose(data, plain)
    seconds = {}
    for processes in given.processes:
        numba.set_num_threads(processes)
        start = time.perf_counter()
        found = diagnose(data, plain)
        seconds[processes] = time.perf_counter() - start
    own, copy = megabytes(resource.RUSAGE_SELF), megabytes(resource.RUSAGE_CHILDREN)
    answer = {
        "sources": str(Path(spa_fo.__file__).resolve().parent.parent),
        "seconds": seconds,
        "own_mb": own,
        "copy_mb": copy,
        "kind": found.kind,
        "sets": [list(names) for names in found.sets],
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
