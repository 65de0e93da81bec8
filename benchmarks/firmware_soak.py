"""The firmware at full size: ten minutes at 1 kHz, and 10,000 streams of commands and damage.

python benchmarks/firmware_soak.py     (a few minutes; tests/test_firmware.py is the smaller one)
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parent.parent / "tests"
sys.path.insert(0, str(TESTS))

from simulated_board import Event, play, why_not  # noqa: E402
from test_firmware import differences, read  # noqa: E402

_LINES = 20  # a stream
_TOGETHER = 100  # streams a run of the board


def sustained(seconds: int) -> str:
    """Sample at 1 kHz with set-points all the while; say what was lost and how even it was."""
    end = 100 + 1000 * seconds
    events: list[tuple[int, Event]] = [(100, "run 1000")]
    events += [(ms, f"set {ms % 97}.5 {ms}") for ms in range(400, end, 90)]
    begun = time.monotonic()
    run = play([*events, (end, "stop")], end + 100)
    log = read(run)
    t_us = np.array([int(row[1]) for row in run.rows])
    even = t_us - t_us[0] - 1000 * np.arange(t_us.size)
    taken = int(run.comments[-1].split("=")[1])
    return (
        f"{seconds} s at 1 kHz: {taken} samples taken, {log.report.valid} whole lines, "
        f"{taken - log.report.valid} lost, {log.report.damaged_lines} damaged, "
        f"{log.report.gaps} gaps; off the even grid by {even.min()} to {even.max()} us "
        f"(simulated in {time.monotonic() - begun:.0f} s)"
    )


def fuzzed(streams: int) -> str:
    """Compare the answers to fuzzed streams with those of the virtual board."""
    begun = time.monotonic()
    unequal = [
        pair
        for seed in range(1000, 1000 + -(-streams // _TOGETHER))
        for pair in differences(seed, _LINES * _TOGETHER)
    ]
    for found, wanted in unequal[:5]:
        print(f"  firmware: {found}\n  virtual:  {wanted}", file=sys.stderr)
    return (
        f"{streams} streams of {_LINES} lines, one line in three damaged: {len(unequal)} answers "
        f"that differ from the virtual board's ({time.monotonic() - begun:.0f} s)"
    )


def main() -> None:
    """Run both and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--streams", type=int, default=10_000)
    options = parser.parse_args()
    missing = why_not()
    if missing:
        sys.exit(missing)
    print(sustained(options.seconds), flush=True)
    print(fuzzed(options.streams), flush=True)


if __name__ == "__main__":
    main()
