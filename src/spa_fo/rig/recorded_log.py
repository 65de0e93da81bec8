"""A log while it is being recorded, and what became of it."""

from __future__ import annotations

import os
from dataclasses import dataclass

from spa_fo.errors import BadInput


@dataclass(frozen=True)
class Begun:
    """A log that is being recorded.

    Attributes
    ----------
    file : str
        Relative to the folder.
    started_s : float
        Campaign time of its start, s; 0 for the first trial.
    fd : int
        Where its bytes go.
    """

    file: str
    started_s: float
    fd: int

    def write(self, data: bytes) -> None:
        """Append bytes: they are in the file when this returns.

        Raises
        ------
        BadInput
            They cannot be written, for example because the disk is full.
        """
        left = memoryview(data)
        try:
            while left:
                left = left[os.write(self.fd, left) :]
        except OSError as error:
            raise BadInput(self.file, f"cannot be written: {error.strerror}") from error


@dataclass(frozen=True)
class Kept:
    """What became of a log.

    Attributes
    ----------
    file : str
        Relative to the folder; empty where nothing came and nothing is kept.
    place : str
        Where campaign.yaml has it: an experiment, ``calibration``, or nowhere (empty).
    why : str
        Why it is not where it was meant for; empty where it is.
    """

    file: str
    place: str
    why: str
