"""What every effect keeps: it can be absent, it can be fitted, and its steps can be trusted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.chain import Chain, chain_for
from spa_fo.plant.effects.effect import Effect, Parameter
from spa_fo.plant.effects.library import IDS, LIBRARY, absent
from spa_fo.plant.effects.own import acted, checked
from spa_fo.plant.grid import campaign_grid
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.plant.paper import TABLE_I
from spa_fo.rig import Trial

_KPA = 30.0
_X = TABLE_I["design_1"].as_array()
_STARTED_S = 1800.0
_COARSEST = 2  # level of the longest steps that are halved, twice
_SLOPE = 2e-3  # of what is plausible: by so much a parameter is moved for a slope
_TINY, _SEEN = 1e-4, 0.2  # a search that came to 0 has to see the way back: as much of a slope
_SEEN_DEG, _NOTHING_DEG = 0.01, 1e-6
_NEUTRAL, _ALIKE, _FINER = 0.05, 0.1, 0.6  # shares, of what the effect does or of a difference
_ROUGH = 0.01  # of what the effect does, which steps may miss
_SLOWED = {"s": 1, "1/s": -1, "1/h": -1, "Hz": -1, "kPa/s": -1, "deg/s": -1}


def broken(effect: Effect) -> tuple[str, ...]:
    """Say what an effect breaks of the contract.

    It says in words what it is. Its numbers lie within their bounds. It moves the log where it is
    present, by finite numbers, and by the same when it is asked again; with amplitudes of zero, or
    `Effect.neutral`, it moves nothing. What a small change of a parameter makes of the log is the
    same to either side. Halving the step converges. A spectral line and other coefficients are
    not simulated: of them only words and bounds are asked.

    Parameters
    ----------
    effect : Effect
        Of the library, or one's own.

    Returns
    -------
    tuple of str
        A sentence each; empty where it keeps the contract.

    Raises
    ------
    BadInput
        An effect of one's own is not one that the chain can run.
    """
    said = tuple(_unsaid(effect))
    if effect.port in ("line", "coefficients"):
        return said
    held = LIBRARY.further
    if effect.act is not None and effect.id not in IDS:
        LIBRARY.hold((checked(effect, effect.source),))
    try:
        return (*said, *_broken(LIBRARY[effect.id]))
    finally:
        LIBRARY.hold(held)


def _unsaid(effect: Effect) -> Iterator[str]:
    """Say which words lack, and which numbers lie outside of their bounds."""
    bare = Effect(effect.id, effect.stage)
    for key in ("means", "remedy"):
        if getattr(effect, key) in ("", getattr(bare, key)):
            yield f"{key}: expected words of its own"
    for parameter in effect.parameters:
        if not parameter.means:
            yield f"{parameter.name}: expected words on what it is"
        neutral = effect.neutral.get(parameter.name, parameter.starts[0])
        if not all(parameter.low <= v <= parameter.high for v in (*parameter.starts, neutral)):
            yield f"{parameter.name}: expected numbers within its bounds"
    for name in effect.neutral:
        if name not in {parameter.name for parameter in effect.parameters}:
            yield f"neutral: '{name}' is none of its parameters"


def _broken(effect: Effect) -> Iterator[str]:
    finest = _chain(0)
    bare, values = _logged(finest, absent()), _example(effect)
    first, again = (_logged(finest, _vector(effect, values)) for _ in range(2))
    change = first - bare
    size = float(np.abs(change).max())
    if not np.isfinite(size):
        yield "what it makes of the log is not finite"
        return
    if not np.array_equal(first, again):
        yield "asked again it gives something else"
    if size < _SEEN_DEG:
        yield f"it moves the log by {size:.2g} deg where it should show"
        return
    left = float(np.abs(_logged(finest, _vector(effect, _neutral(effect))) - bare).max())
    if left > max(_NEUTRAL * size, _NOTHING_DEG):
        yield f"it is not neutral: {left:.2g} of {size:.2g} deg are left"
    for place, parameter in enumerate(effect.parameters):
        ahead, behind = (_slope(effect, values, place, side) for side in (1.0, -1.0))
        apart, steep = float(np.std(ahead - behind)), float(np.std(ahead + behind)) / 2.0
        if apart > _ALIKE * steep + _ALIKE * size:
            yield f"{parameter.name}: its slope is {steep:.2g} deg, {apart:.2g} apart to both sides"
    for place, parameter in enumerate(effect.parameters):
        if parameter.log or parameter.low != 0.0:
            continue
        at_end = np.where(np.arange(values.size) == place, 0.0, values)
        small, large = (
            float(np.std(_slope(effect, at_end, place, 1.0, share))) for share in (_TINY, _SLOPE)
        )
        if small < _SEEN * large and large > _ALIKE * size:
            yield f"{parameter.name}: from 0 its slope is {small:.2g} deg, a little on {large:.2g}"
    coarse, halved = _differences(effect, values)
    if halved > _FINER * coarse + _ROUGH * size:
        yield f"halving the step does not converge: it moves by {coarse:.2g}, then {halved:.2g}"


def _example(effect: Effect) -> Floats:
    """Parameters with which it shows: where searches begin, or as is plausible."""
    return np.array([p.starts[0] or p.centre + p.spread for p in effect.parameters])


def _neutral(effect: Effect) -> Floats:
    """Parameters with which it does nothing."""
    return np.array(
        [
            effect.neutral.get(p.name, value if p.log else 0.0)
            for p, value in zip(effect.parameters, _example(effect), strict=True)
        ]
    )


def _vector(effect: Effect, values: Floats) -> Floats:
    vector = absent()
    vector[effect.slots] = values
    return vector


def _slope(
    effect: Effect, values: Floats, place: int, side: float, share: float = _SLOPE
) -> Floats:
    """Give what the log changes by, for a change of a parameter by as much as is plausible."""
    moved = values.copy()
    moved[place] = _moved(effect.parameters[place], values[place], side * share)
    here, there = (_logged(_chain(0), _vector(effect, each)) for each in (values, moved))
    return (there - here) / (side * share)


def _moved(parameter: Parameter, value: float, share: float) -> float:
    step = share * parameter.spread
    return float(value * np.exp(step)) if parameter.log else value + step


def _command(slowed: int = 1) -> Floats:
    """Two loadings and releases without a corner, kPa, on cells."""
    n = slowed * 800
    time = (np.arange(n) + 0.5) * FINEST_STEP_S / slowed
    rise = [np.clip((time - start) / 0.8, 0.0, 1.0) for start in (0.4, 3.4, 5.4, 9.4)]
    eased = [r**3 * (10.0 - 15.0 * r + 6.0 * r**2) for r in rise]
    return np.asarray(50.0 * (eased[0] - eased[1]) + 55.0 * (eased[2] - eased[3]))


@cache
def _chain(level: int) -> Chain:
    """Lay a trial in steps of one length."""
    cells = _command()
    none = np.zeros(cells.size, dtype=bool)
    trial = Trial(
        experiment="contract",
        trial=1,
        protocol="free",
        setpoint_deg=None,
        order=2,
        started_s=_STARTED_S,
        t_s=FINEST_STEP_S * np.arange(cells.size, dtype=np.float64),
        command_kpa=cells,
        pressure_kpa=None,
        flex_adc=None,
        angle_deg=np.zeros(cells.size),
        after_reset=none,
        outside_calibration=none,
    )
    width, n = 2**level, cells.size // 2**level
    step = width * FINEST_STEP_S
    grid = replace(
        campaign_grid([trial]),
        command_kpa=cells,
        cell_starts=np.array([0, cells.size]),
        level=np.full(n, level),
        first_cell=width * np.arange(n),
        cells=np.full(n, width),
        middle_s=_STARTED_S + step * (np.arange(n) + 0.5),
        step_starts=np.array([0, n]),
        trial_steps=np.array([n]),
    )
    return chain_for(grid, _X, _KPA)


def _logged(chain: Chain, effects: Floats) -> Floats:
    """Give what the log holds at the ends of the longest steps, deg."""
    coarse = 2**_COARSEST * FINEST_STEP_S
    time = coarse * np.arange(1, _command().size // 2**_COARSEST)
    chain = replace(chain)  # one that remembers no load, whatever an effect made of it before
    reading, _ = chain.readings(_X, effects)
    step, share = chain.grid.locate(0, time)
    return chain.logged(reading, effects, step, share, np.zeros(time.size, dtype=np.int64))


def _differences(effect: Effect, values: Floats) -> tuple[float, float]:
    """How much a log, or a pressure, changes as the step is halved once, and once more."""
    if effect.stage == "drive":
        coarse, half, quarter = (_pressure(effect, values, slowed) for slowed in (1, 2, 4))
    else:
        coarse, half, quarter = (
            _logged(_chain(level), _vector(effect, values)) - _logged(_chain(level), absent())
            for level in (_COARSEST, _COARSEST - 1, _COARSEST - 2)
        )
    return float(np.abs(half - coarse).max()), float(np.abs(quarter - half).max())


def _pressure(effect: Effect, values: Floats, slowed: int) -> Floats:
    """Pressure of a drive with an effect, on coarse cells, its steps so many times as fine.

    Cells are what they are: the library's effects are given a command that takes longer, and times
    as much longer.
    """
    command = _command(slowed)
    if effect.act is not None:
        time = (np.arange(command.size) + 0.5) * FINEST_STEP_S / slowed
        found = acted(effect, values, command, time)
    else:
        powers = [_SLOWED.get(p.unit, 0) for p in effect.parameters]
        slow = values * np.power(float(slowed), powers)
        chain = _chain(0)
        grid = replace(chain.grid, command_kpa=command, cell_starts=np.array([0, command.size]))
        driven = replace(chain, grid=grid, input_kpa=command)
        found = driven.pressure(_vector(effect, slow), np.zeros(2))
    return np.asarray(found.reshape(-1, slowed).mean(axis=1))
