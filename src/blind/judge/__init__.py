"""The judge of the blind benchmark: truths, answers, and what they are worth."""

from blind.judge.records import (
    Answer,
    Claim,
    Outcome,
    Realised,
    Truth,
    read_answer,
    read_baselines,
    read_realised,
    read_truth,
)
from blind.judge.score import Scores, score

__all__ = [
    "Answer",
    "Claim",
    "Outcome",
    "Realised",
    "Scores",
    "Truth",
    "read_answer",
    "read_baselines",
    "read_realised",
    "read_truth",
    "score",
]
