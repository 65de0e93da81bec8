"""The model elsewhere: rational approximations with their errors, and files for other tools."""

from spa_fo.export.accuracy import Accuracy, FilterAccuracy, measure, measure_filter
from spa_fo.export.approximation import (
    METHODS,
    Approximation,
    Band,
    approximate,
    default_band,
)
from spa_fo.export.discrete import HOLDS, DiscreteFilter, discretise
from spa_fo.export.exported import TARGETS, Exported, Options, export_model, write_export
from spa_fo.export.linear_part import LinearPart, linear_part
from spa_fo.export.oustaloup import Operator, oustaloup
from spa_fo.export.python_control import control_system
from spa_fo.export.rational import Rational

__all__ = [
    "HOLDS",
    "METHODS",
    "TARGETS",
    "Accuracy",
    "Approximation",
    "Band",
    "DiscreteFilter",
    "Exported",
    "FilterAccuracy",
    "LinearPart",
    "Operator",
    "Options",
    "Rational",
    "approximate",
    "control_system",
    "default_band",
    "discretise",
    "export_model",
    "linear_part",
    "measure",
    "measure_filter",
    "oustaloup",
    "write_export",
]
