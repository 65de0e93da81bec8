"""The library of effects: identifier, stage, parameters, and what is plausible of them.

Identifiers and physics are the contract's; the parametric forms are ours. Each form has enough
freedom to bend with a neighbouring form of the same physics (one pole or several, cubic or
exponential), because a form too stiff loses to a wrong effect that bends better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stage = Literal["drive", "actuator", "sensor", "acquisition"]
STAGES: tuple[Stage, ...] = ("drive", "actuator", "sensor", "acquisition")
Port = Literal["chain", "coefficients", "curve", "zeros", "line"]


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes
    ----------
    name, unit : str
        As written to model files.
    centre, spread : float
        What is plausible: a normal distribution, of the logarithm where `log`.
    low, high : float
        Bounds that physics sets.
    log : bool
        Whether the logarithm is searched: for times and shapes. Amplitudes are searched as they
        are, zero being no effect.
    starts : tuple of float
        Where searches begin.
    """

    name: str
    unit: str
    centre: float
    spread: float
    low: float
    high: float
    log: bool = False
    starts: tuple[float, ...] = ()


@dataclass(frozen=True)
class Effect:
    """One effect of the library and where its parameters stand in the vector of all.

    `port` says how an identification meets it: as parameters of the simulated chain, as other
    coefficients, as an error of the sensor's curve, as every trial's zero, or as a spectral line.
    """

    id: str
    stage: Stage
    parameters: tuple[Parameter, ...]
    first: int
    port: Port = "chain"

    @property
    def slots(self) -> slice:
        """Its place in the vector of all parameters."""
        return slice(self.first, self.first + len(self.parameters))


def _size(
    name: str, unit: str, spread: float, high: float, start: float, low: float = 0.0
) -> Parameter:
    return Parameter(name, unit, 0.0, spread, low, high, starts=(start,))


def _shape(
    name: str, unit: str, centre: float, factor: float, low: float, high: float, *starts: float
) -> Parameter:
    return Parameter(
        name, unit, centre, float(np.log(factor)), low, high, log=True, starts=starts or (centre,)
    )


def _share(name: str, centre: float = 0.3, spread: float = 0.3, high: float = 1.0) -> Parameter:
    return Parameter(name, "1", centre, spread, 0.0, high, starts=(centre,))


def _late(name: str) -> Parameter:
    return Parameter(name, "s", 0.0, 0.12, 0.0, 2.0, starts=(0.03, 0.12, 0.4))


def _spectrum() -> tuple[Parameter, ...]:
    """Give a creep's spectrum: a bell over the logarithm of time, which bends with any of them.

    Narrow it is a single element, broad a logarithmic law, broad and late a power law.
    """
    return (
        _size("per_decade", "1", 0.05, 0.5, 0.03),
        _shape("typical_s", "s", 12.0, 4.0, 0.1, 3000.0),
        _shape("decades", "1", 1.0, 1.8, 0.35, 5.0),
    )


CURVE_KNOTS_DEG = (-10.0, 0.0, 12.0, 24.0, 36.0, 48.0, 60.0, 75.0, 90.0)
"""Angles between which an unknown sensor curve is drawn straight; it is right at 0°."""

_FORMS: tuple[tuple[str, Stage, tuple[Parameter, ...]], ...] = (
    ("dead_time", "drive", (_late("delay_s"),)),
    (
        "line_lag",
        "drive",
        (_late("time_constant_s"), _share("second_pole", high=0.5)),
    ),
    (
        "supply_droop",
        "drive",
        (
            _size("fraction", "1", 0.1, 0.6, 0.05),
            _shape("recovery_s", "s", 2.0, 2.5, 0.1, 60.0),
            _share("slow_share"),
        ),
    ),
    (
        "leak",
        "drive",
        (
            _size("rate_per_s", "1/s", 0.01, 0.3, 0.004),
            _size("makeup_per_s", "1/s", 0.05, 2.0, 0.01),
        ),
    ),
    (
        "slew_limit",
        "drive",
        (
            _shape("rise_kpa_s", "kPa/s", 120.0, 3.0, 2.0, 3000.0, 30.0, 70.0, 200.0),
            _shape("fall_ratio", "1", 1.0, 1.6, 0.1, 10.0),
            _shape("approach_s", "s", 0.03, 2.0, 0.005, 1.0),
        ),
    ),
    ("drive_backlash", "drive", (_size("play_kpa", "kPa", 2.0, 30.0, 1.0), _share("centre", 0.5))),
    (
        "stiffening",
        "actuator",
        (
            _size("fraction_at_60deg", "1", 0.08, 2.0, 0.05),
            _shape("exponent", "1", 2.2, 1.5, 0.8, 8.0),
        ),
    ),
    (
        "gravity_load",
        "actuator",
        (
            _size("along_rest", "rad", 0.08, 0.8, 0.05, low=-0.3),
            _size("across_rest", "rad", 0.12, 1.5, 0.05, low=-0.8),
        ),
    ),
    (
        "contact_stop",
        "actuator",
        (
            _shape("angle_deg", "deg", 45.0, 1.6, 5.0, 90.0, 30.0, 50.0),
            _size("stiffness", "1", 1.5, 50.0, 0.6),
            _shape("softness_deg", "deg", 4.0, 2.5, 0.2, 40.0),
        ),
    ),
    (
        "mullins_softening",
        "actuator",
        (
            _size("fraction", "1", 0.12, 1.0, 0.06),
            _shape("loadings", "1", 2.0, 2.2, 0.2, 30.0),
            _shape("dwell_s", "s", 25.0, 2.5, 1.0, 500.0),
            _size("level_share", "1", 0.6, 1.0, 0.5),
            _shape("span_deg", "deg", 85.0, 1.2, 40.0, 150.0),
        ),
    ),
    (
        "creep",
        "actuator",
        _spectrum(),
    ),
    (
        "hysteresis",
        "actuator",
        (
            _size("moment_deg", "deg", 3.0, 25.0, 1.5),
            _shape("turn_deg", "deg", 25.0, 1.8, 2.0, 160.0),
            _shape("tail", "1", 1.4, 1.5, 0.4, 4.0),
        ),
    ),
    (
        "thermal_drift",
        "actuator",
        (
            _size("per_hour", "1/h", 0.15, 0.9, 0.06, low=-0.7),
            _size("fading_per_hour", "1/h", 0.8, 3.0, 0.3),
        ),
    ),
    ("parameter_shift", "actuator", ()),
    (
        "sensor_nonlinearity",
        "sensor",
        tuple(
            _size(f"at_{angle:.0f}deg".replace("-", "minus_"), "deg", 2.5, 25.0, 0.0, low=-25.0)
            for angle in CURVE_KNOTS_DEG
            if angle != 0.0
        ),
    ),
    (
        "sensor_saturation",
        "sensor",
        (
            _shape("ceiling_deg", "deg", 55.0, 1.35, 8.0, 120.0, 40.0, 58.0),
            _shape("knee_deg", "deg", 3.0, 2.2, 0.1, 30.0),
        ),
    ),
    (
        "sensor_lag",
        "sensor",
        (_late("time_constant_s"), _share("second_pole", high=0.5)),
    ),
    (
        "sensor_creep",
        "sensor",
        _spectrum(),
    ),
    (
        "sensor_hysteresis",
        "sensor",
        (
            _size("width_deg", "deg", 2.0, 20.0, 1.0),
            _shape("turn_deg", "deg", 3.0, 2.5, 0.3, 40.0, 2.0, 7.0),
            _shape("exponent", "1", 0.8, 1.5, 0.3, 2.0),
        ),
    ),
    (
        "sensor_slip",
        "sensor",
        (
            _size("walk_deg", "deg per trial", 0.3, 5.0, 0.05, low=-5.0),
            _size("zero_deg", "deg", 1.0, 25.0, 0.0, low=-25.0),
        ),
    ),
    (
        "channel_latency",
        "acquisition",
        (_late("delay_s"), Parameter("window_share", "1", 0.0, 0.6, 0.0, 1.0, starts=(0.2,))),
    ),
    (
        "mains_pickup",
        "acquisition",
        (
            _size("amplitude_deg", "deg", 2.0, 30.0, 0.5),
            _size("frequency_hz", "Hz", 1e3, 1e6, 10.0),
        ),
    ),
)


_PORTS: Mapping[str, Port] = {
    "parameter_shift": "coefficients",
    "sensor_nonlinearity": "curve",
    "sensor_slip": "zeros",
    "mains_pickup": "line",
}


def _numbered() -> dict[str, Effect]:
    effects, first = {}, 0
    for name, stage, parameters in _FORMS:
        effects[name] = Effect(name, stage, parameters, first, _PORTS.get(name, "chain"))
        first += len(parameters)
    return effects


LIBRARY: Mapping[str, Effect] = _numbered()
IDS = tuple(LIBRARY)
SIZE = sum(len(effect.parameters) for effect in LIBRARY.values())
"""Length of the vector that holds the parameters of all effects."""


def ordered(ids: Sequence[str]) -> tuple[str, ...]:
    """Put effects in the library's order, each once."""
    return tuple(sorted(set(ids), key=IDS.index))


def at_port(port: Port, ids: Sequence[str] = IDS) -> str | None:
    """Return the effect among `ids` that is met at a port; None where there is none."""
    return next((name for name in ids if LIBRARY[name].port == port), None)


def absent() -> Floats:
    """Return the vector of all parameters with no effect in it: NaN in every slot."""
    return np.full(SIZE, np.nan)


def switches(parameters: Floats) -> NDArray[np.bool_]:
    """Say which effects of `IDS` a vector of all parameters holds."""
    return np.array(
        [
            bool(effect.parameters) and not np.isnan(parameters[effect.first])
            for effect in LIBRARY.values()
        ]
    )


def stage_of(ids: Sequence[str]) -> set[Stage]:
    """Return the stages of the effects `ids`."""
    return {LIBRARY[name].stage for name in ids}
