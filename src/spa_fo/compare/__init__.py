"""What changed between two campaigns of one actuator."""

from spa_fo.compare.compare import NOTHING_CHANGED, SCHEMA, Comparison
from spa_fo.compare.nominal import compare, compare_pressure, with_finding
from spa_fo.compare.reference_model import ReferenceModel, identify_reference

__all__ = [
    "NOTHING_CHANGED",
    "SCHEMA",
    "Comparison",
    "ReferenceModel",
    "compare",
    "compare_pressure",
    "identify_reference",
    "with_finding",
]
