"""What changed between two campaigns of one actuator."""

from spa_fo.compare.compare import NOTHING_CHANGED, SCHEMA, Comparison
from spa_fo.compare.nominal import compare, compare_pressure

__all__ = ["NOTHING_CHANGED", "SCHEMA", "Comparison", "compare", "compare_pressure"]
