"""Models of the actuator: the fractional one, its baselines, and the files that hold them."""

from spa_fo.plant.ludwick import Ludwick, ludwick_step, second_moment, second_moment_as_printed
from spa_fo.plant.model_file import Model, read_model, write_model
from spa_fo.plant.paper import TABLE_I
from spa_fo.plant.second_order import second_order_step
from spa_fo.plant.transfer_function import PARAMETERS, TransferFunction

__all__ = [
    "PARAMETERS",
    "TABLE_I",
    "Ludwick",
    "Model",
    "TransferFunction",
    "ludwick_step",
    "read_model",
    "second_moment",
    "second_moment_as_printed",
    "second_order_step",
    "write_model",
]
