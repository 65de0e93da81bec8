"""Fractional-calculus kernels: step response, sampled input, Mittag-Leffler function.

Parameters come in the order (alpha2, alpha1, a1, a0, b0) of G(s) = b0/(s^α2 + a1 s^α1 + a0).
"""

from spa_fo.fractional.grunwald_letnikov import (
    grunwald_letnikov_simulate,
    grunwald_letnikov_step,
)
from spa_fo.fractional.intervals import Hold
from spa_fo.fractional.map_kernels import (
    WORK_ROWS,
    MapArrays,
    jacobian_on_map,
    response_on_map,
)
from spa_fo.fractional.prabhakar import mittag_leffler
from spa_fo.fractional.prabhakar_series import prabhakar_series_step
from spa_fo.fractional.response_map import ResponseMap, input_map, step_map
from spa_fo.fractional.sampled_input import simulate
from spa_fo.fractional.step import step_response, step_response_jacobian

__all__ = [
    "WORK_ROWS",
    "Hold",
    "MapArrays",
    "ResponseMap",
    "grunwald_letnikov_simulate",
    "grunwald_letnikov_step",
    "input_map",
    "jacobian_on_map",
    "mittag_leffler",
    "prabhakar_series_step",
    "response_on_map",
    "simulate",
    "step_map",
    "step_response",
    "step_response_jacobian",
]
