"""What the parameters of the effects mean, in words."""

from __future__ import annotations

from collections.abc import Mapping

_CREEP = {
    "per_decade": "growth in each tenfold of time, as a share of the angle",
    "typical_s": "time about which most of it happens",
    "decades": "over how many tenfolds of time it spreads",
}
_LAG = {
    "time_constant_s": "time constants added up: how late a slow change comes",
    "second_pole": "part of it that a second, equal filter has: 0 is a single exponential",
}
_SHIFT = {
    "alpha2": "order of the inertia term",
    "alpha1": "order of the damping term",
    "a1": "damping",
    "a0": "stiffness",
    "b0": "strength of the pressure",
}

PARAMETER_MEANS: Mapping[str, Mapping[str, str]] = {
    "dead_time": {"delay_s": "how long the pressure waits after the command"},
    "line_lag": _LAG,
    "supply_droop": {
        "fraction": "part of a rise of pressure that is missing at first",
        "recovery_s": "time in which most of it comes back",
        "slow_share": "part of it that comes back more slowly",
    },
    "leak": {
        "rate_per_s": "share of the pressure that is lost in a second",
        "makeup_per_s": "share of the loss that the supply makes good in a second",
    },
    "slew_limit": {
        "rise_kpa_s": "fastest rise of the pressure",
        "fall_ratio": "fastest fall, as a multiple of the fastest rise",
        "approach_s": "time constant of the last bit towards the command",
    },
    "drive_backlash": {
        "play_kpa": "change of the command without a change of the pressure",
        "centre": "where the play stands about the command: 0.5 is in the middle",
    },
    "stiffening": {
        "fraction_at_60deg": "extra restoring moment at 60°, as a share of the elastic one",
        "exponent": "how steeply it grows with the angle",
    },
    "gravity_load": {
        "along_rest": "moment of the weight that grows with the sine of the angle",
        "across_rest": "moment of the weight that grows with 1 − cosine of the angle",
    },
    "contact_stop": {
        "angle_deg": "angle from which something pushes back",
        "stiffness": "its stiffness, as a multiple of the actuator's",
        "softness_deg": "angle over which the contact closes",
    },
    "mullins_softening": {
        "fraction": "extra stiffness of virgin material",
        "loadings": "loadings in which it goes",
        "dwell_s": "time under load that does the same",
        "level_share": "part of it that is lost level by level",
        "span_deg": "angles over which there is any to lose",
    },
    "creep": _CREEP,
    "hysteresis": {
        "moment_deg": "width of the loop, as an angle",
        "turn_deg": "travel after a reversal until the other branch is reached",
        "tail": "how the travels of its elements are spread",
    },
    "thermal_drift": {
        "per_hour": "change of the gain in the first hour",
        "fading_per_hour": "how fast the change slows down",
    },
    "parameter_shift": _SHIFT,
    "sensor_nonlinearity": {
        f"at_{angle}deg": f"error of the curve at {angle.replace('minus_', '−')}°"
        for angle in ("minus_10", "12", "24", "36", "48", "60", "75", "90")
    },
    "sensor_saturation": {
        "ceiling_deg": "largest angle that it reads",
        "knee_deg": "how far below the reading begins to bend",
    },
    "sensor_lag": _LAG,
    "sensor_creep": _CREEP,
    "sensor_hysteresis": {
        "width_deg": "width of the loop",
        "turn_deg": "travel after a reversal until the other branch is reached",
        "exponent": "shape of the way there: 1 is exponential",
    },
    "sensor_slip": {
        "walk_deg": "steady walk of the zero",
        "zero_deg": "error of the zero at the first trial",
    },
    "channel_latency": {
        "delay_s": "how late the angle is logged",
        "window_share": "part of the delay that is smeared, as by an average",
    },
    "mains_pickup": {
        "amplitude_deg": "amplitude of the interference",
        "frequency_hz": "its frequency",
    },
}
"""Effect -> parameter -> meaning."""
