"""The judge of the blind benchmark: truths, answers, and what they are worth."""

from blind.judge.reading import (
    answer_in,
    outcomes,
    read_answer,
    read_realised,
    read_truth,
)
from blind.judge.records import (
    Answer,
    Claim,
    Outcome,
    Realised,
    Surroundings,
    Truth,
    failed,
)
from blind.judge.score import Scores, score

__all__ = [
    "Answer",
    "Claim",
    "Outcome",
    "Realised",
    "Scores",
    "Surroundings",
    "Truth",
    "answer_in",
    "failed",
    "outcomes",
    "read_answer",
    "read_realised",
    "read_truth",
    "score",
]
