"""What of a model is linear and belongs to the actuator: all that a transfer function can hold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from spa_fo.errors import BadInput
from spa_fo.plant import Model
from spa_fo.plant.augmented import effects_vector, law_in
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.shared import poles
from spa_fo.plant.law import LAW
from spa_fo.plant.static_curve import ID as STATIC_CURVE

# Behind the angle: how it was read and logged, not how the actuator moves.
_MEASURING = ("sensor", "acquisition")
_ROOTED = 0.1  # of a line's lag that may be an orifice's while it counts as linear. Assumed.
_AS_LONG = 0.1  # of a rise, by which a fall may differ and count as one. Assumed.


@dataclass(frozen=True)
class LinearPart:
    """What stands beside G(s) in an export.

    Attributes
    ----------
    dead_time_s : float
        Pure delay of the drive.
    lags_s : tuple of float
        Time constants of its first-order lags.
    leads_s : tuple of float
        Those of the factors 1 + T s that the tail of a lag leaves above them.
    included : tuple of str
        Effects that are exported.
    left_out : tuple of str
        Effects that are not linear: what the export lacks.
    not_of_the_actuator : tuple of str
        Effects of sensor and log: the export's output is the true angle.
    """

    dead_time_s: float = 0.0
    lags_s: tuple[float, ...] = ()
    leads_s: tuple[float, ...] = ()
    included: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    not_of_the_actuator: tuple[str, ...] = ()


def linear_part(
    model: Model, source: Path | str = "model", allow_left_out: bool = False
) -> LinearPart:
    """Sort a model's effects.

    Dead time and lag of the drive are exported exactly. Coefficients of a ``parameter_shift``
    stand in G already. Sensor and log are not part of the actuator. Everything else, a free-form
    law too, is not linear, or varies with time.

    Parameters
    ----------
    model : Model
        Plain or augmented.
    source : Path or str
        Its file, for messages.
    allow_left_out : bool
        Leave out what is not linear, rather than refuse it.

    Raises
    ------
    BadInput
        An effect is not what the library expects, or is not linear and was not allowed to be
        left out.
    """
    vector, law = effects_vector(model, source), law_in(model, source)
    dead_time = 0.0
    lags: tuple[float, ...] = ()
    leads: tuple[float, ...] = ()
    included: list[str] = []
    left_out: list[str] = []
    measuring: list[str] = []
    for effect in model.effects:
        name = effect["id"]
        if name == LAW:
            where = measuring if law is not None and law.stage in _MEASURING else left_out
            where.append(f"free-form law ({effect['place']})")
            continue
        if name == STATIC_CURVE:
            left_out.append(name)
            continue
        values = vector[LIBRARY[name].slots]
        if LIBRARY[name].stage in _MEASURING:
            measuring.append(name)
        elif name == "dead_time":
            dead_time, uneven = values.tolist()
            included.append(name)
            if abs(uneven) > _AS_LONG:
                left_out.append(f"{name} (a rise waits {1.0 + uneven:.2g} times as long)")
        elif name == "line_lag":
            *lag, excess, rooted = values.tolist()
            lags, leads = _of_lag(*lag)
            included.append(name)
            if abs(excess) > _AS_LONG:
                left_out.append(f"{name} (a fall takes {1.0 + excess:.2g} times as long)")
            if rooted > _ROOTED:
                left_out.append(f"{name} ({rooted:.0%} of it is an orifice's)")
        elif name == "parameter_shift":
            included.append(name)
        else:
            left_out.append(name)
    if left_out and not allow_left_out:
        raise BadInput(
            source,
            f"holds {', '.join(left_out)}, which no linear model can hold; --linear-part exports "
            "the rest and says so",
            "effects",
        )
    return LinearPart(dead_time, lags, leads, tuple(included), tuple(left_out), tuple(measuring))


def _of_lag(
    time_constant: float, second: float, tail: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Write a lag with a tail, (1 - w)/((1 + a s)(1 + b s)) + w/(1 + c s), as lags and leads."""
    a, b, c = poles(time_constant, second, tail)
    if tail == 0.0:
        return (a, b), ()
    # As c is 4 (a + b) both zeros are real.
    total, product = (1.0 - tail) * c + tail * (a + b), tail * a * b
    root = math.sqrt(total**2 - 4.0 * product)
    larger = 0.5 * (total + root)
    return (a, b, c), (larger, product / larger if larger > 0.0 else 0.0)
