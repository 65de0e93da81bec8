"""The judge of the blind benchmark: truths, answers, and what they are worth."""

from spa_fo.gap.blind.records import (
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
from spa_fo.gap.blind.score import Scores, score

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
