"""From effects of the actuator to the moments, the input and the coefficients of its body."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from blind.second_rig.bank import Bank, Core, bank, dashpot
from blind.second_rig.body import VOIGTS, BodyState, Laws, Pressed, run
from blind.second_rig.effect import Effect, Scene
from blind.second_rig.pressed import damper, damping, grown, rest_set, swung, unfolded

Floats = npt.NDArray[np.float64]

_SETTLED = 1.4  # campaigns after which a linear drift of temperature is over
COEFFICIENTS = ("alpha2", "alpha1", "a1", "a0", "b0")


@dataclass
class Specimen:
    """An actuator with its effects and all that it remembers."""

    core: Core
    laws: Laws
    voigt: tuple[Floats, Floats]
    effects: tuple[Effect, ...]
    state: BodyState = field(default_factory=BodyState)
    mode: Floats = field(default_factory=lambda: np.zeros(2))
    banks: dict[float, Bank] = field(default_factory=dict)
    states: dict[str, Floats] = field(default_factory=dict)

    def bend(
        self, pressure: Floats, step_s: float, started_s: float, gain: float, rate_factor: float
    ) -> Floats:
        """Bend under a pressure.

        Parameters
        ----------
        pressure : ndarray, shape (n,)
            True pressure over the reference, held over each step.
        step_s : float
            Step (s).
        started_s : float
            Campaign time of the first step.
        gain, rate_factor : float
            This trial's own factors on the input and on the rate of the plain physics.

        Returns
        -------
        ndarray, shape (n + 1,)
            Angle (rad).
        """
        felt = rate_factor * step_s
        body = self.banks.setdefault(felt, bank(self.core, felt))
        times = started_s + step_s * np.arange(pressure.size, dtype=np.float64)
        moment = _input(self.effects, pressure, times, step_s, self.states)
        drive = gain * self.core.b0 * moment
        pressed = self._pressed(pressure, step_s, felt)
        angle = run(body, self.laws, self.core.a0, drive, self.voigt, self.state, step_s, pressed)
        for effect in self.effects:
            if effect.id == "body_mode" and effect.amplitude != 0.0:
                angle = angle + self._mode(effect, pressure, angle, step_s)
        return angle

    def _mode(self, effect: Effect, pressure: Floats, angle: Floats, step_s: float) -> Floats:
        """Return the swing of a body's mode (rad)."""
        size = effect.amplitude * self.core.gain
        if effect.form == "linear_mode":
            omega = 2.0 * np.pi * effect.shape["frequency_hz"]
            return size * _ringing(pressure, step_s, omega, effect.shape["damping"], self.mode)
        state = self.states.setdefault(effect.id, np.zeros(3))
        if effect.form == "carried":
            return effect.amplitude * swung(effect, pressure, angle, step_s, self.laws.top, state)
        top = self.laws.top / self.core.gain
        return size * swung(effect, pressure, angle, step_s, top, state)

    def _pressed(self, pressure: Floats, step_s: float, felt: float) -> Pressed | None:
        """Return the set of the rest and the damping that pressure brings, if any does."""
        rest, times = np.zeros(pressure.size), np.zeros(pressure.size)
        damps, found = dashpot(0.0), False
        for effect in self.effects:
            if effect.amplitude == 0.0:
                continue
            if effect.id == "pressure_set" and effect.form != "flow":
                state = self.states.setdefault(effect.id, np.zeros(int(effect.shape["elements"])))
                rest = self.laws.top * rest_set(effect, pressure, step_s, state)
                found = True
            elif effect.id == "pressure_damping":
                times, damps = damping(effect, pressure), damper(effect, self.core, felt)
                found = True
        return Pressed(rest, times, damps) if found else None


def specimen(core: Core, effects: Sequence[Effect], scene: Scene) -> Specimen:
    """Make a fresh actuator: straight, virgin, with the given effects built in."""
    values: dict[str, float] = {}
    compliance, retardation = np.zeros(VOIGTS), np.ones(VOIGTS)
    for effect in effects:
        if effect.amplitude == 0.0:
            continue
        if effect.id == "creep":
            count = int(effect.shape["elements"])
            compliance[:count] = effect.amplitude / count
            retardation[:count] = np.geomspace(
                effect.shape["shortest_s"], effect.shape["longest_s"], count
            )
        elif effect.id == "parameter_shift":
            core = shifted(core, effect)
        elif effect.id in _LAWS:
            values.update(_LAWS[effect.id](effect))
    laws = Laws(top=scene.top_rad, **values)
    return Specimen(core, laws, (compliance, retardation), tuple(effects))


def shifted(core: Core, effect: Effect) -> Core:
    """Return the coefficients of another specimen."""
    changes = {
        name: getattr(core, name) * (1.0 + effect.amplitude * effect.shape[name])
        for name in COEFFICIENTS
    }
    changes["alpha1"] = min(max(changes["alpha1"], 1.03), 1.6)
    changes["alpha2"] = min(max(changes["alpha2"], changes["alpha1"] + 0.05), 1.9)
    return replace(core, **changes)


def _input(
    effects: Sequence[Effect],
    pressure: Floats,
    times: Floats,
    step_s: float,
    states: dict[str, Floats],
) -> Floats:
    """Return what pressure bends with: gains that change, thresholds, ballooning."""
    moment = pressure
    for effect in effects:
        size, shape = effect.amplitude, effect.shape
        if size == 0.0:
            continue
        if effect.id == "thermal_drift":
            moment = moment * (1.0 + shape["sign"] * size * _warmth(effect, times))
        elif effect.id == "tear":
            moment = moment * np.where(times >= shape["at_s"], 1.0 - size, 1.0)
        elif effect.id == "ballooning":
            moment = moment * (1.0 + size * (moment / shape["top"]) ** 2)
        elif effect.id == "gain_growth":
            moment = grown(effect, moment)
        elif effect.id == "opening_fold" and effect.form != "hinge":
            state = states.setdefault(effect.id, np.zeros(2))
            moment = unfolded(effect, moment, step_s, state)
        elif effect.id == "fold_threshold":
            threshold = size * shape["top"]
            knee = shape["knee"] * threshold
            wide = knee * np.logaddexp(0.0, (moment - threshold) / knee)
            moment = wide - knee * np.logaddexp(0.0, -threshold / knee)
    return np.asarray(moment, dtype=np.float64)


def _warmth(effect: Effect, times: Floats) -> Floats:
    """Return how warm it is: 0 at the start, 1 at the campaign's end, and some more afterwards."""
    elapsed = np.maximum(times, 0.0) / effect.shape["length_s"]
    if effect.form == "linear":
        return np.minimum(elapsed, _SETTLED)
    rate = effect.shape["length_s"] / effect.shape["time_s"]
    warmth: Floats = np.expm1(-rate * elapsed) / np.expm1(-rate)
    return warmth


@njit(cache=True)
def _ringing(push: Floats, step_s: float, omega: float, damping: float, state: Floats) -> Floats:
    """Motion of a lightly damped mode about its own rest: what is left when the push is held."""
    out = np.empty(push.size + 1)
    out[0] = state[0]
    last = push[0] if push.size else 0.0
    for n in range(push.size):
        state[0] -= push[n] - last
        last = push[n]
        state[1] += step_s * (-omega * omega * state[0] - 2.0 * damping * omega * state[1])
        state[0] += step_s * state[1]
        out[n + 1] = state[0]
    return out


Values = Mapping[str, float]


def _stiffening(e: Effect) -> Values:
    if e.form == "locking":
        return {"lock": e.amplitude}
    return {
        "quadratic": e.amplitude * e.shape["quadratic_share"],
        "cubic": e.amplitude * (1.0 - e.shape["quadratic_share"]),
    }


def _gravity(e: Effect) -> Values:
    return {
        "weight": e.amplitude,
        "orientation": e.shape["orientation_rad"],
        "sag": 1.0 if e.form == "hanging" else 0.0,
    }


def _contact(e: Effect) -> Values:
    return {
        "contact": e.amplitude,
        "contact_at": e.shape["at_rad"],
        "contact_power": e.shape["power"],
    }


def _mullins(e: Effect) -> Values:
    if e.form == "dose":
        return {"virgin": e.amplitude, "dose": e.shape["dose"]}
    return {"virgin": e.amplitude, "break_s": e.shape["break_s"]}


def _friction(e: Effect) -> Values:
    smooth = 1.0 if e.form == "bouc_wen" else 0.0
    return {"friction": e.amplitude, "slip": e.shape["slip_rad"], "smooth": smooth}


def _drag(e: Effect) -> Values:
    return {"swing": e.amplitude}


def _set(e: Effect) -> Values:
    return {"plastic": e.amplitude, "yield_at": e.shape["yield_rad"]}


def _pressure_set(e: Effect) -> Values:
    """Let the set flow with the angle; forms that follow the pressure itself act elsewhere."""
    if e.form != "flow":
        return {}
    most = e.amplitude * e.shape["top_rad"]
    rate = most / (e.shape["top_rad"] - e.shape["yield_rad"]) / e.shape["setting_s"]
    return {
        "plastic": rate,
        "yield_at": e.shape["yield_rad"],
        "set_most": most,
        "set_back_s": e.shape["longest_s"],
    }


def _fold(e: Effect) -> Values:
    """Let a crease act as a hinge beyond an angle; folds that pressure opens act elsewhere."""
    if e.form != "hinge":
        return {}
    return {"loose": e.amplitude, "loose_at": e.shape["opens_rad"]}


_LAWS: dict[str, Callable[[Effect], Values]] = {
    "stiffening": _stiffening,
    "gravity_load": _gravity,
    "contact_stop": _contact,
    "mullins_softening": _mullins,
    "hysteresis": _friction,
    "quadratic_drag": _drag,
    "shape_set": _set,
    "pressure_set": _pressure_set,
    "opening_fold": _fold,
}


def coefficients(core: Core) -> dict[str, Any]:
    """Return the five coefficients as plain data."""
    return {name: float(getattr(core, name)) for name in COEFFICIENTS}
