"""First forms of the effects of the actuator; `second_forms` and `second_moments` hold others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo.virtual_rig.arrays import Array


@dataclass(frozen=True)
class Stiffening:
    """Limiting extensibility (Gent 1996): moment a0 θ / (1 - (θ/θ_lock)²)."""

    lock_deg: float


@dataclass(frozen=True)
class GravityLoad:
    """A weight at the tip: moment a0 w (cos ψ - cos(ψ + θ)), ψ the mounting angle.

    Parameters
    ----------
    weight_rad : float
        w, the weight's moment at a horizontal lever over a0, rad.
    mounting_deg : float
        ψ; 0 hangs down, 90 lies flat.
    """

    weight_rad: float
    mounting_deg: float = 0.0


@dataclass(frozen=True)
class ContactStop:
    """A Hertzian contact (exponent 3/2) beyond `angle_deg`, `stiffness` times a0 per rad^(1/2)."""

    angle_deg: float
    stiffness: float


@dataclass(frozen=True)
class MullinsSoftening:
    """A bundle of weak links that break where the strain exceeds their threshold.

    Twelve links with thresholds spread evenly up to `span_deg`. A link above its threshold decays
    with time constant `break_s`, and heals at rest with `heal_s`.

    Parameters
    ----------
    fraction : float
        Extra stiffness of the virgin bundle, as a share of a0.
    """

    fraction: float
    span_deg: float = 75.0
    break_s: float = 12.0
    heal_s: float = 20000.0


@dataclass(frozen=True)
class Creep:
    """Kelvin-Voigt elements in series with the core: extra angle, shares of the static angle.

    Parameters
    ----------
    fraction : float
        Share of the static angle that each element adds in the end.
    times_s : tuple of float
        Retardation times, one an element.
    """

    fraction: float
    times_s: tuple[float, ...] = (3.0, 15.0, 75.0)

    @property
    def shares(self) -> tuple[float, ...]:
        """Share of each element."""
        return (self.fraction,) * len(self.times_s)


@dataclass(frozen=True)
class Hysteresis:
    """Bouc-Wen friction (n = 1) beside the restoring moment: dz = dθ/θ_y - |dθ| z/θ_y.

    Parameters
    ----------
    moment_deg : float
        Saturated friction moment over a0, deg: half the height of the loop.
    yield_deg : float
        Angle θ_y over which the friction turns round.
    """

    moment_deg: float
    yield_deg: float = 20.0


@dataclass(frozen=True)
class ThermalDrift:
    """The material warms and softens: the gain grows by `per_hour` an hour, compounding."""

    per_hour: float

    def gain(self, time_s: Array) -> Array:
        """Gain at campaign times."""
        return np.asarray((1.0 + self.per_hour) ** (time_s / 3600.0))
