"""Augmented models: what a model file says of its effects, and its run through a campaign."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.errors import BadInput
from spa_fo.plant.branches import CAME_BEFORE
from spa_fo.plant.chain import Chain, chain_for, log_delays
from spa_fo.plant.effects.effect import Effect, Parameter
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.plant.grid import campaign_grid
from spa_fo.plant.law import LAW, Law, law_of
from spa_fo.plant.lawful import TooSteep, with_law
from spa_fo.plant.model_file import Model
from spa_fo.plant.specimen import Memory, Mounting
from spa_fo.plant.static_curve import curve_of
from spa_fo.rig import Campaign, CampaignData, Trial
from spa_fo.rig.held_readings import holds_of
from spa_fo.validation import suggestion

Source = Path | str

_LISTED = "zeros_deg"  # key of a slipping sensor's zeros, by order
_MOUNTING = "sensor_seat"  # key of a model: film and bias that the first calibration left
BRANCHES = "branches"
"""Key of a loop of the sensor: on which branch logs begin, by `branches.CAME_BEFORE`."""
LET_GO = "let_go_between_trials"
"""Key of a model: whether its actuator begins each trial at rest, whatever a pump has left."""
_ROUNDING = 1e-9  # a bound that has passed through a logarithm


def effects_vector(model: Model, source: Source = "model") -> Floats:
    """Return the parameters of all effects in the library's order, NaN where absent.

    The parameters of ``parameter_shift`` are for the reader: its coefficients already stand in
    the transfer function. A free-form law (`law_in`) and a static curve (`static_curve.curve_of`)
    are no effects of the library.

    Parameters
    ----------
    model : Model
        Plain or augmented.
    source : Path or str
        The file that it was read from, for the message.

    Raises
    ------
    BadInput
        An effect is unknown, given twice or at a wrong stage; one of its parameters is missing,
        unknown, not a number or out of range. The text names the key.
    """
    vector = absent()
    seen: set[str] = set()
    if curve_of(model, source) is not None:
        return vector
    for index, effect in enumerate(model.effects):
        if effect["id"] == LAW:
            continue
        entry = _Entry(effect, f"effects[{index}]", source)
        form = entry.form()
        if form.id in seen:
            entry.refuse("id", f"is '{form.id}' for the second time; expected each effect once")
        seen.add(form.id)
        entry.listed_zeros()
        entry.branches()
        if form.parameters:
            vector[form.slots] = entry.values(form)
    return vector


def law_in(model: Model, source: Source = "model") -> Law | None:
    """Return the free-form law that a model holds, if any.

    Raises
    ------
    BadInput
        Its place, stage, knots or values are not what a law has, or there is a second one.
    """
    laws = [
        law_of(effect, f"effects[{index}]", source)
        for index, effect in enumerate(model.effects)
        if effect["id"] == LAW
    ]
    if len(laws) > 1:
        raise BadInput(source, f"holds {len(laws)} laws; expected one at most", "effects")
    return laws[0] if laws else None


def is_augmented(model: Model, source: Source = "model") -> bool:
    """Say whether any effect of a model changes what it predicts.

    ``parameter_shift`` is in the coefficients, and the phase of ``mains_pickup`` is random.

    Raises
    ------
    BadInput
        See `effects_vector`.
    """
    vector = effects_vector(model, source)
    vector[LIBRARY.slots(lambda effect: effect.port == "line")] = np.nan
    return law_in(model, source) is not None or not bool(np.isnan(vector).all())


def predict_augmented(
    model: Model, data: CampaignData, source: Source = "model"
) -> tuple[Floats, ...]:
    """Run a model through a whole campaign, its state carried from trial to trial.

    A campaign that continues the model's own starts from the memory stored in the model, after
    the rest in between; any other starts with a virgin specimen (see `past_note`).

    Returns
    -------
    tuple of (n,) arrays
        Angles in degrees at every sample of each trial, in the order of ``data.trials``.

    Raises
    ------
    BadInput
        An effect or the memory is not what the library expects (see `effects_vector`), or a log
        does not hold the signal that drives the model.
    """
    campaign = data.campaign
    same_sensor = model.campaign in (campaign.name, campaign.continues)
    memory = _memory_for(model, campaign, source)
    return _predict(_run(model, data.trials, memory, source), model, data.trials, same_sensor)


def predict_alone(model: Model, trial: Trial, source: Source = "model") -> Floats:
    """Predict a single trial of the model's own campaign as if it were a specimen's first load.

    Raises
    ------
    BadInput
        See `predict_augmented`.
    """
    run = _run(model, [trial], Memory(), source)
    return _predict(run, model, [trial], same_sensor=True)[0]


def ending_memory(model: Model, data: CampaignData, source: Source = "model") -> dict[str, Any]:
    """Run a model through its own campaign and return what it stores as ``memory``.

    Returns
    -------
    dict
        `Memory.to_dict` at the end of the last trial, and ``orders``, that trial's order.

    Raises
    ------
    BadInput
        See `predict_augmented`.
    """
    run = _run(model, data.trials, _memory_for(model, data.campaign, source), source)
    return {**run.memory.to_dict(), "orders": int(run.chain.grid.orders[-1])}


def past_note(model: Model, campaign: Campaign, source: Source = "model") -> str | None:
    """Say what a prediction makes of the past of a campaign that continues another.

    Returns
    -------
    str or None
        None where there is no past, or where the model holds it and it ends before the campaign.

    Raises
    ------
    BadInput
        The memory in the model is not a specimen's state.
    """
    if campaign.continues is None:
        return None
    past = f"{campaign.name} continues '{campaign.continues}'"
    if campaign.continues != model.campaign:
        return f"{past}, the model is of '{model.campaign}': predicted as a virgin specimen"
    if "memory" not in model.extra:
        return f"{past}, whose end the model does not hold: predicted as a virgin specimen"
    ended_s = _memory_for(model, campaign, source).ends_s
    starts_s = min(file.started_s for _, _, file in campaign.trial_files())
    if starts_s < ended_s:
        return f"{past}, which ended at {ended_s:g} s, but starts at {starts_s:g} s: without a rest"
    return None


@dataclass(frozen=True)
class _Run:
    chain: Chain
    effects: Floats
    reading: Floats
    memory: Memory


def _run(model: Model, trials: Sequence[Trial], memory: Memory, source: Source) -> _Run:
    rested_from_s = None if math.isnan(memory.ends_s) else memory.ends_s
    grid = campaign_grid(trials, source, rested_from_s, longest=0)
    driven = grid.pressure_kpa if model.signal == "pressure" else grid.command_kpa
    if driven is None:
        raise BadInput(source, f"drives the trials by a {model.signal} that they do not hold")
    x, effects = model.transfer_function.as_array(), effects_vector(model, source)
    pressure = driven if model.signal == "pressure" else None
    chain = chain_for(grid, x, model.reference_kpa, pressure, memory)
    known = [_Entry(e, f"effects[{i}]", source) for i, e in enumerate(model.effects)]
    branches = {e.effect["id"]: e.branches() for e in known if BRANCHES in e.effect}
    chain = replace(chain, let_go=_let_go(model, source), branches=branches)
    mounting = _mounting(model, source)
    # After an earlier campaign the film is as its last trial left it.
    fresh = math.isnan(memory.ends_s)
    chain = chain.mounted(mounting) if fresh else replace(chain, mounting=mounting)
    law = law_in(model, source)
    if law is not None:
        chain = with_law(chain, law)
    chain = chain.hung(x, effects)
    try:
        reading, after = chain.readings(x, effects)
    except TooSteep as error:
        raise BadInput(source, str(error), "effects") from error
    return _Run(chain, effects, reading, after)


def _predict(
    run: _Run, model: Model, trials: Sequence[Trial], same_sensor: bool
) -> tuple[Floats, ...]:
    grid = run.chain.grid
    place = {trial.order: i for i, trial in enumerate(grid.trials)}
    zeros = _zeros_deg(model, run.effects, grid.orders, same_sensor)
    effects = run.effects.copy()
    effects[LIBRARY["sensor_slip"].slots] = np.nan
    holds = None if log_delays(effects) is None else holds_of(grid.trials)
    angles = []
    for trial in trials:
        i = place[trial.order]
        step, share = grid.locate(i, trial.t_s)
        held_s = None if holds is None else holds.since_middle(grid.trials[i])
        at = step, share, np.full(step.size, i)
        angle = run.chain.logged(run.reading, effects, *at, held_s)
        angles.append(trial.zeroed(angle) if trial.zero_until_s > 0.0 else angle + zeros[i])
    return tuple(angles)


def _zeros_deg(model: Model, effects: Floats, orders: Integers, same_sensor: bool) -> Floats:
    """Zero of the sensor by trial: as listed, and walking on from the last one listed before."""
    walk, zero = effects[LIBRARY["sensor_slip"].slots]
    if math.isnan(walk):
        return np.zeros(orders.size)
    listed: Mapping[int, float] = {}
    if same_sensor:
        slip = next(effect for effect in model.effects if effect["id"] == "sensor_slip")
        listed = {int(order): float(value) for order, value in slip.get(_LISTED, {}).items()}
    zeros = []
    for order in orders.tolist():
        earlier = max((known for known in listed if known <= order), default=1)
        zeros.append(listed.get(earlier, zero) + walk * (order - earlier))
    return np.array(zeros)


def _mounting(model: Model, source: Source) -> Mounting:
    """How the sensor comes from its calibration, if the model says so."""
    if _MOUNTING not in model.extra:
        return Mounting()
    try:
        return Mounting.from_dict(model.extra[_MOUNTING])
    except KeyError as error:
        raise BadInput(
            source, "missing, expected this key", f"{_MOUNTING}.{error.args[0]}"
        ) from error
    except (TypeError, ValueError, OverflowError) as error:
        raise BadInput(source, f"expected a sensor's state: {error}", _MOUNTING) from error


def _let_go(model: Model, source: Source) -> bool:
    """Whether the actuator is let go between trials, if the model says so."""
    said = model.extra.get(LET_GO, False)
    if not isinstance(said, bool):
        raise BadInput(source, f"is {said!r}; expected true or false", LET_GO)
    return said


def _memory_for(model: Model, campaign: Campaign, source: Source) -> Memory:
    if campaign.continues != model.campaign or "memory" not in model.extra:
        return Memory()
    try:
        return Memory.from_dict(model.extra["memory"])
    except KeyError as error:
        raise BadInput(source, "missing, expected this key", f"memory.{error.args[0]}") from error
    except (TypeError, ValueError, OverflowError) as error:
        raise BadInput(source, f"expected the state of a specimen: {error}", "memory") from error


@dataclass(frozen=True)
class _Entry:
    """One entry of a model's list of effects; every refusal names the file and the key."""

    effect: Mapping[str, Any]
    where: str
    source: Source

    def refuse(self, key: str, expected: str) -> NoReturn:
        raise BadInput(self.source, expected, f"{self.where}.{key}")

    def form(self) -> Effect:
        name, stage = self.effect["id"], self.effect["stage"]
        if name not in LIBRARY:
            self.refuse("id", f"is '{name}', which is no known effect{suggestion(name, LIBRARY)}")
        form = LIBRARY[name]
        if stage != form.stage:
            self.refuse("stage", f"is '{stage}', but {name} belongs to the {form.stage}")
        return form

    def values(self, form: Effect) -> list[float]:
        given = self.effect["parameters"]
        names = [parameter.name for parameter in form.parameters]
        for name in given:
            if name not in names:
                self.refuse(
                    f"parameters.{name}",
                    f"is no parameter of {form.id}{suggestion(name, names)}",
                )
        return [self._value(parameter) for parameter in form.parameters]

    def _value(self, parameter: Parameter) -> float:
        key = f"parameters.{parameter.name}"
        if parameter.name not in self.effect["parameters"]:
            if parameter.is_addition:
                return 0.0
            self.refuse(key, "missing, expected this key")
        value = self._number(key, self.effect["parameters"][parameter.name])
        slack = _ROUNDING * max(abs(parameter.low), abs(parameter.high))
        if not parameter.low - slack <= value <= parameter.high + slack:
            self.refuse(
                key,
                f"is {value:g}; expected {parameter.low:g} to {parameter.high:g} {parameter.unit}",
            )
        return min(max(value, parameter.low), parameter.high)

    def listed_zeros(self) -> None:
        """Check the zeros that a slipping sensor had in the trials it was seen in."""
        listed = self.effect.get(_LISTED, {})
        if not isinstance(listed, Mapping):
            self.refuse(_LISTED, "expected an object of order and zero")
        for order, value in listed.items():
            if not (order.isdecimal() and int(order) >= 1):
                self.refuse(f"{_LISTED}.{order}", "expected a trial's order, a whole number from 1")
            self._number(f"{_LISTED}.{order}", value)

    def branches(self) -> Floats:
        """Give the branches that logs begin on, 0 where none is said."""
        said = self.effect.get(BRANCHES, {})
        if not isinstance(said, Mapping):
            self.refuse(BRANCHES, f"expected an object of {', '.join(CAME_BEFORE)}")
        for kind in said:
            if kind not in CAME_BEFORE:
                self.refuse(f"{BRANCHES}.{kind}", f"expected one of {', '.join(CAME_BEFORE)}")
        if said and LIBRARY[self.effect["id"]].half_loop is None:
            self.refuse(BRANCHES, f"{self.effect['id']} has no loop of the sensor; expected none")
        return np.array([self._number(f"{BRANCHES}.{k}", said.get(k, 0.0)) for k in CAME_BEFORE])

    def _number(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(key, f"expected a number, found {value!r}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.refuse(key, "expected a finite number")
        return number
