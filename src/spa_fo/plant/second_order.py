"""Step response of the linear second-order model, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def second_order_step(
    t: ArrayLike, gain: float, damping_ratio: float, natural_frequency: float
) -> NDArray[np.float64]:
    """Unit-step response of gain wn² / (s² + 2 zeta wn s + wn²).

    Parameters
    ----------
    t : array_like
        Times in s; the response is 0 up to t = 0.
    gain : float
        Final value, rad for u = 1.
    damping_ratio : float
        zeta > 0: under-, critically and overdamped alike.
    natural_frequency : float
        wn > 0 in rad/s.

    Returns
    -------
    numpy.ndarray
        Same shape as `t`, rad.

    Raises
    ------
    ValueError
        The damping ratio or the natural frequency is not a positive finite number.
    """
    for name, value in (("damping ratio", damping_ratio), ("natural frequency", natural_frequency)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"the {name} must be a positive number, not {value}")
    tau = natural_frequency * np.maximum(np.asarray(t, dtype=np.float64), 0.0)
    # y = gain (1 - c - zeta s), c and s the damped cosine and sine (hyperbolic if overdamped).
    root = np.sqrt(abs(1.0 - damping_ratio**2))
    if damping_ratio < 1:
        decay = np.exp(-damping_ratio * tau)
        c, s = decay * np.cos(root * tau), decay * tau * np.sinc(root * tau / np.pi)
    else:
        # exp(-(zeta - root) tau) without the cancellation in zeta - root.
        slow = np.exp(-tau / (damping_ratio + root))
        fading = -np.expm1(-2.0 * root * tau)
        c = slow * (1.0 - 0.5 * fading)
        s = 0.5 * slow * (fading / root if root > 0 else 2.0 * tau)
    return np.asarray(gain * (1.0 - c - damping_ratio * s))
