"""What changed between two campaigns of one actuator."""

from spa_fo.compare.compare import NOTHING_CHANGED, SCHEMA, Comparison, compare
from spa_fo.compare.pressure_alone import compare_pressure

__all__ = ["NOTHING_CHANGED", "SCHEMA", "Comparison", "compare", "compare_pressure"]
