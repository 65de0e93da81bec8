"""The virtual actuator for the simulated board: a message in, two counts out, every millisecond.

Run by `simboard --actuator "python firmware/sim/actuator.py"`, which says what the messages are.
"""

from __future__ import annotations

import argparse
import struct
import sys
from typing import BinaryIO

import numpy as np

from spa_fo.virtual_rig.actuators import PLANS
from spa_fo.virtual_rig.board import BenchPlant, Plant

_MESSAGE = struct.Struct("=cf")
_ANSWER = struct.Struct("=HH")


def serve(plant: Plant, messages: BinaryIO, answers: BinaryIO) -> None:
    """Answer each message until there are no more."""
    pressure = np.zeros(1)
    while len(message := messages.read(_MESSAGE.size)) == _MESSAGE.size:
        kind, value = _MESSAGE.unpack(message)
        if kind == b"t":
            plant.begin_trial()
        if kind == b"b":
            flex = plant.bend(np.full(1, value))
        else:
            pressure, flex = plant.drive(np.full(1, value))
        answers.write(_ANSWER.pack(int(pressure[0]), int(flex[0])))
        answers.flush()


def main() -> None:
    """Serve on standard input and output."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--specimen", choices=sorted(PLANS), default="dragon_skin_20")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    plant = BenchPlant(PLANS[options.specimen].specimen, options.seed)
    serve(plant, sys.stdin.buffer, sys.stdout.buffer)


if __name__ == "__main__":
    main()
