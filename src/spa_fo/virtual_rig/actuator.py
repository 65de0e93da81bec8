"""True pressure -> true angle: a fractional viscoelastic bending element and its imperfections.

The core is s^α2 θ + a1 s^α1 θ + a0 θ = b0 u with 1 < α1 < α2 < 2. With v = dθ/dt each fractional
term is a fractional derivative of v, of order β = α - 1 in (0, 1), and that is a continuum of
Maxwell branches (the diffusive representation, Montseny 1998; Prony series in rubber elasticity):

    s^β = (sin πβ / π) ∫ r^(β-1) s/(s+r) dr,    r = e^x, trapezoidal rule in x,

so the material is a bundle of dashpots v - y_k behind springs, dy_k/dt = r_k (v - y_k). Branches
slower than the slowest node act as one plain dashpot, those faster than the fastest as inertia:
both tails are summed exactly. Time runs in steps with v linear in each, branches integrated
exactly, and the moment balance solved for the new v by Newton's method: any nonlinear restoring
moment may stand in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array, Effect, chain
from spa_fo.virtual_rig.first_forms import (
    ContactStop,
    Creep,
    GravityLoad,
    Hysteresis,
    MullinsSoftening,
    Stiffening,
    ThermalDrift,
)
from spa_fo.virtual_rig.second_forms import PowerCreep, Warming
from spa_fo.virtual_rig.second_moments import (
    CycleSoftening,
    FoamPad,
    FungStiffening,
    OwnWeight,
    SecondMoment,
    SecondState,
    StopHysteresis,
    remember,
    restoring_besides,
    second_moment,
    second_state,
)

# Rates of the Maxwell branches, 1/s. Three a decade resolve s^β to 3e-6 on the imaginary axis.
_RATES = np.logspace(-4, 4, 25)
_SPACING = np.log(_RATES[1] / _RATES[0])

_Form = TypeVar("_Form")


@dataclass(frozen=True)
class FractionalCore:
    """Coefficients of G(s) = b0 / (s^alpha2 + a1 s^alpha1 + a0), rad per unit u."""

    alpha2: float
    alpha1: float
    a1: float
    a0: float
    b0: float

    def __post_init__(self) -> None:
        if not 1 < self.alpha1 < self.alpha2 < 2:
            raise ValueError("the virtual actuator needs 1 < alpha1 < alpha2 < 2")

    @property
    def gain(self) -> float:
        """Static gain b0/a0, rad per unit u."""
        return self.b0 / self.a0


@dataclass(frozen=True)
class ParameterShift:
    """Another specimen: each coefficient of the core times its factor."""

    alpha2: float = 1.0
    alpha1: float = 1.0
    a1: float = 1.0
    a0: float = 1.0
    b0: float = 1.0

    def shifted(self, core: FractionalCore) -> FractionalCore:
        """Give the core of this specimen."""
        return FractionalCore(
            core.alpha2 * self.alpha2,
            core.alpha1 * self.alpha1,
            core.a1 * self.a1,
            core.a0 * self.a0,
            core.b0 * self.b0,
        )


@dataclass(frozen=True)
class SoftActuator:
    """The specimen: its core and its imperfections; None is an effect that is absent.

    What no library of effects knows: `inside` changes the pressure behind the pressure sensor,
    `drag` (s²/rad) is a damping moment of a0 `drag` (dθ/dt)|dθ/dt|, and each of `damping` makes of
    the pressure the share of a1 by which the body is damped more.
    """

    core: FractionalCore
    reference_kpa: float
    parameter_shift: ParameterShift | None = None
    stiffening: Stiffening | FungStiffening | None = None
    gravity_load: GravityLoad | OwnWeight | None = None
    contact_stop: ContactStop | FoamPad | None = None
    mullins_softening: MullinsSoftening | CycleSoftening | None = None
    creep: Creep | PowerCreep | None = None
    hysteresis: Hysteresis | StopHysteresis | None = None
    thermal_drift: ThermalDrift | Warming | None = None
    inside: tuple[Effect, ...] = ()
    drag: float = 0.0
    damping: tuple[Effect, ...] = ()

    def begin(self, step_s: float, now_s: float = 0.0) -> RunningActuator:
        """Start a virgin specimen at rest at campaign time `now_s`."""
        return RunningActuator(self, step_s, now_s)


class _Branches(NamedTuple):
    """The fractional terms discretised for one step length."""

    weight: Array
    keep: Array
    from_old: Array
    from_new: Array
    dashpot: float
    inertia: float


class _Moment(NamedTuple):
    """Sizes of everything in the restoring moment, as the kernel wants them (rad; 0 is off)."""

    a0: float
    inverse_lock: float
    weight: float
    mounting: float
    stop: float
    stop_stiffness: float
    friction: float
    inverse_yield: float
    softening: float
    break_rate: float
    heal_rate: float
    drag: float


class _State(NamedTuple):
    """What the specimen remembers; the arrays change in place."""

    motion: Array  # θ, dθ/dt, friction z
    branches: Array
    links: Array
    creep: Array


class RunningActuator:
    """A specimen and its memory.

    Parameters
    ----------
    actuator : SoftActuator
        What it is.
    step_s : float
        Simulation step, s.
    now_s : float
        Campaign time it begins at, s.
    """

    def __init__(self, actuator: SoftActuator, step_s: float, now_s: float) -> None:
        shift = actuator.parameter_shift or ParameterShift()
        self._core = shift.shifted(actuator.core)
        self._actuator = actuator
        self._step_s = step_s
        self._now_s = now_s
        self._gain = 1.0
        self._branches = _branches(self._core, 1.0, step_s)
        self._moment = _moment(actuator, self._core)
        self._second = second_moment(
            [
                actuator.stiffening,
                actuator.gravity_load,
                actuator.contact_stop,
                actuator.mullins_softening,
                actuator.hysteresis,
            ]
        )
        self._inside = chain([effect.begin(step_s) for effect in actuator.inside])
        self._damping = [effect.begin(step_s) for effect in actuator.damping]
        mullins = _first_form(actuator.mullins_softening, MullinsSoftening(0.0))
        creep = actuator.creep or Creep(0.0)
        self._thresholds = np.deg2rad(mullins.span_deg) * np.arange(12) / 12.0
        self._creep_keep = np.exp(-step_s / np.array(creep.times_s))
        self._creep_fraction = np.array(creep.shares) / self._core.a0
        self._state = _State(
            np.zeros(3), np.zeros(_RATES.size), np.ones(12), np.zeros(len(creep.times_s))
        )
        self._second_state = second_state()

    def retune(self, gain: float, rate_factor: float) -> None:
        """Give the next trial its own gain and rate (factors; 1 is the specimen's own)."""
        self._gain = gain
        self._branches = _branches(self._core, rate_factor, self._step_s)

    def __call__(self, pressure_kpa: Array) -> Array:
        """Angles in deg at the end of each step with this true pressure during it."""
        drift = self._actuator.thermal_drift or ThermalDrift(0.0)
        time = np.asarray(self._now_s + self._step_s * np.arange(1.0, pressure_kpa.size + 1))
        self._now_s += self._step_s * pressure_kpa.size
        gain = self._gain * drift.gain(time)
        load = self._core.b0 * gain * self._inside(pressure_kpa) / self._actuator.reference_kpa
        damping = np.zeros_like(load)
        for of_pressure in self._damping:
            damping += self._core.a1 * of_pressure(pressure_kpa)
        angle = _advance(
            load,
            damping,
            self._step_s,
            self._branches,
            self._moment,
            self._thresholds,
            self._creep_keep,
            self._creep_fraction,
            self._state,
            self._second,
            self._second_state,
        )
        return np.rad2deg(angle)


def _branches(core: FractionalCore, rate_factor: float, step_s: float) -> _Branches:
    """Weights of the branches of s^α2 + a1 s^α1, with time running `rate_factor` times as fast."""
    weight = np.zeros(_RATES.size)
    dashpot = inertia = 0.0
    for coefficient, alpha in ((1.0, core.alpha2), (core.a1, core.alpha1)):
        beta = alpha - 1.0
        scale = coefficient * rate_factor**-alpha * np.sin(np.pi * beta) / np.pi * _SPACING
        weight += scale * _RATES**beta
        dashpot += scale * _RATES[0] ** beta / np.expm1(beta * _SPACING)
        inertia += scale * _RATES[-1] ** (beta - 1.0) / np.expm1((1.0 - beta) * _SPACING)
    x = _RATES * step_s
    keep = np.exp(-x)
    mean_keep = -np.expm1(-x) / x
    return _Branches(weight, keep, mean_keep - keep, 1.0 - mean_keep, dashpot, inertia)


def _first_form(effect: object, absent: _Form) -> _Form:
    """Give the effect where it has the first form, which is that of `absent`."""
    return effect if isinstance(effect, type(absent)) else absent


def _moment(actuator: SoftActuator, core: FractionalCore) -> _Moment:
    stiffening = _first_form(actuator.stiffening, Stiffening(np.inf))
    gravity = _first_form(actuator.gravity_load, GravityLoad(0.0))
    stop = _first_form(actuator.contact_stop, ContactStop(0.0, 0.0))
    mullins = _first_form(actuator.mullins_softening, MullinsSoftening(0.0))
    hysteresis = _first_form(actuator.hysteresis, Hysteresis(0.0))
    return _Moment(
        a0=core.a0,
        inverse_lock=1.0 / float(np.deg2rad(stiffening.lock_deg)),
        weight=gravity.weight_rad,
        mounting=float(np.deg2rad(gravity.mounting_deg)),
        stop=float(np.deg2rad(stop.angle_deg)),
        stop_stiffness=stop.stiffness,
        friction=float(np.deg2rad(hysteresis.moment_deg)),
        inverse_yield=1.0 / float(np.deg2rad(hysteresis.yield_deg)),
        softening=mullins.fraction,
        break_rate=1.0 / mullins.break_s,
        heal_rate=1.0 / mullins.heal_s,
        drag=actuator.drag,
    )


@njit
def _rubbed(friction: float, turned: float) -> float:
    """Friction state after moving by `turned` yield angles (implicit Euler, so never above 1)."""
    return (friction + turned) / (1.0 + abs(turned))


@njit
def _restoring(
    angle: float, moved: float, friction: float, bundle: float, m: _Moment
) -> tuple[float, float]:
    """Restoring moment over a0 at `angle`, after `moved` from the last one; and its slope."""
    stretch = 1.0 - (angle * m.inverse_lock) ** 2
    # A lock is never reached by design; the bound keeps Newton's first guesses finite.
    stretch = max(stretch, 0.05)
    stiff = 1.0 + m.softening * bundle
    moment = angle / stretch * stiff
    slope = (2.0 - stretch) / stretch**2 * stiff
    moment += m.weight * (np.cos(m.mounting) - np.cos(m.mounting + angle))
    slope += m.weight * np.sin(m.mounting + angle)
    beyond = max(angle - m.stop, 0.0)
    moment += m.stop_stiffness * beyond**1.5
    slope += 1.5 * m.stop_stiffness * beyond**0.5
    turned = moved * m.inverse_yield
    friction = _rubbed(friction, turned)
    moment += m.friction * friction
    slope += m.friction * m.inverse_yield * (1.0 - np.sign(moved) * friction) / (1.0 + abs(turned))
    return moment, slope


@njit
def _advance(
    load: Array,
    damping: Array,
    step: float,
    branches: _Branches,
    moment: _Moment,
    thresholds: Array,
    creep_keep: Array,
    creep_fraction: Array,
    state: _State,
    second: SecondMoment,
    second_state: SecondState,
) -> Array:
    out = np.empty_like(load)
    angle, rate, friction = state.motion[0], state.motion[1], state.motion[2]
    y, links, creep = state.branches, state.links, state.creep
    resistance = (
        np.sum(branches.weight * (1.0 - branches.from_new))
        + branches.dashpot
        + branches.inertia / step
    )
    for i in range(load.size):
        pull = branches.inertia / step * rate
        for k in range(y.size):
            y[k] = branches.keep[k] * y[k] + branches.from_old[k] * rate
            pull += branches.weight[k] * y[k]
        bundle = 0.0
        for k in range(links.size):
            bundle += links[k]
        bundle /= links.size
        new_rate = rate
        for _ in range(20):
            moved = 0.5 * step * (rate + new_rate)
            restoring, slope = _restoring(angle + moved, moved, friction, bundle, moment)
            if second.active:
                more, steeper = restoring_besides(angle + moved, moved, second, second_state)
                restoring, slope = restoring + more, slope + steeper
            drag = moment.a0 * moment.drag * abs(new_rate)
            plain = resistance + damping[i]
            excess = (plain + drag) * new_rate - pull + moment.a0 * restoring - load[i]
            change = excess / (plain + 2.0 * drag + moment.a0 * slope * 0.5 * step)
            new_rate -= change
            if abs(change) < 1e-13:
                break
        moved = 0.5 * step * (rate + new_rate)
        friction = _rubbed(friction, moved * moment.inverse_yield)
        angle += moved
        if second.active:
            remember(angle, moved, step, second, second_state)
        for k in range(y.size):
            y[k] += branches.from_new[k] * new_rate
        rate = new_rate
        for k in range(links.size):
            if angle > thresholds[k]:
                links[k] -= step * moment.break_rate * links[k]
            else:
                links[k] += step * moment.heal_rate * (1.0 - links[k])
        total = angle
        for k in range(creep.size):
            creep[k] += (1.0 - creep_keep[k]) * (creep_fraction[k] * load[i] - creep[k])
            total += creep[k]
        out[i] = total
    state.motion[0], state.motion[1], state.motion[2] = angle, rate, friction
    return out
