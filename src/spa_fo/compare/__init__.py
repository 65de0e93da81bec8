"""What changed between two campaigns of one actuator."""

from spa_fo.compare.compare import NOTHING_CHANGED, SCHEMA, Comparison, compare

__all__ = ["NOTHING_CHANGED", "SCHEMA", "Comparison", "compare"]
