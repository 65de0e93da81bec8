"""The sim-to-real gap: where it lies, what causes it, how far it shrinks, and when nobody knows."""

from spa_fo.gap.diagnose import diagnose, diagnose_campaign, write_files
from spa_fo.gap.diagnosis import Cause, Diagnosis, Gap, Shrink, Traces, Where

__all__ = [
    "Cause",
    "Diagnosis",
    "Gap",
    "Shrink",
    "Traces",
    "Where",
    "diagnose",
    "diagnose_campaign",
    "write_files",
]
