"""Every number that the paper prints, once (arXiv:2512.18213 unless said otherwise)."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from spa_fo.plant.transfer_function import TransferFunction

ARXIV = "arXiv:2512.18213"

DESIGNS = ("design_1", "design_2")
MATERIALS = MappingProxyType({"design_1": "Dragon Skin 20", "design_2": "Dragon Skin FX-Pro"})

TABLE_I = MappingProxyType(
    {
        "design_1": TransferFunction(alpha2=1.406, alpha1=1.196, a1=0.794, a0=1.638, b0=0.934),
        "design_2": TransferFunction(alpha2=1.424, alpha1=1.170, a1=0.986, a0=2.103, b0=0.728),
    }
)
"""Table I: the identified parameters."""


@dataclass(frozen=True)
class PrintedError:
    """One entry of the table of RMS errors: in degrees, and in per cent of the setpoint."""

    rms_deg: float
    percent: float


SETPOINTS_DEG = (30.0, 60.0)
MODELS = ("fractional", "nonlinear")
RMS_ERRORS = MappingProxyType(
    {
        ("design_1", 30.0, "fractional"): PrintedError(1.24, 4.13),
        ("design_1", 30.0, "nonlinear"): PrintedError(4.75, 15.83),
        ("design_1", 60.0, "fractional"): PrintedError(2.52, 4.2),
        ("design_1", 60.0, "nonlinear"): PrintedError(3.42, 5.7),
        ("design_2", 30.0, "fractional"): PrintedError(0.95, 3.16),
        ("design_2", 30.0, "nonlinear"): PrintedError(2.79, 9.3),
        ("design_2", 60.0, "fractional"): PrintedError(1.96, 3.3),
        ("design_2", 60.0, "nonlinear"): PrintedError(1.65, 2.8),
    }
)
"""RMS error against the averaged responses by (design, setpoint in degrees, model), Figs. 4-5."""

BOUNDS = MappingProxyType(
    {
        "alpha2": (1.1, 1.9),
        "alpha1": (1.0, 1.5),
        "a1": (0.5, 1.0),
        "a0": (1.0, 2.0),
        "b0": (1.0, 2.0),
    }
)
"""Search bounds of the particle swarm, as printed."""

SWARM_PARTICLES = 200
SWARM_ITERATIONS = 10
# Not printed: the standard values of the paper's reference, Bratton and Kennedy 2007,
# doi:10.1109/SIS.2007.368035.
SWARM_INERTIA = 0.72984
SWARM_ATTRACTION = 1.49618

TRIALS = 7
"""Trials at each setpoint."""
DATASETS = 4
"""Step responses the paper says an identification needs at least."""
POINTS = 50
"""Points taken of each step response."""

# Eq. 5/22. Exponents from the material data base, arXiv:2311.02527; damping ratio and natural
# frequency from the authors' published code.
LUDWICK_EXPONENT = MappingProxyType({"design_1": 2.365, "design_2": 1.727})
DAMPING_RATIO = 0.7
NATURAL_FREQUENCY = 1.812  # rad/s


@dataclass(frozen=True)
class Geometry:
    """The actuator as in the authors' published code."""

    youngs_modulus_kpa: float = 340.0  # Dragon Skin 20
    width_m: float = 0.030
    height_m: float = 0.024
    length_m: float = 0.094
    mass_kg: float = 0.36


GEOMETRY = Geometry()

CLAIMED_RMS_PERCENT = (3.0, 4.0)
"""RMS errors are "around 3-4 %"."""
CLAIMED_IMPROVEMENT_PERCENT = 5.0
"""Accuracy "improved above 5 %" over the nonlinear model at both angles."""
