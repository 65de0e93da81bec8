"""The characteristic function D(s) = s^α2 + a1 s^α1 + a0 and its pole on the principal sheet."""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit

# Nearer to the cut than this the pole stays inside every contour and needs no separate treatment.
POLE_ANGLE_LIMIT = 0.97 * math.pi


def check_parameters(
    alpha2: float, alpha1: float, a1: float, a0: float, b0: float
) -> tuple[float, float, float, float, float]:
    """Return the five parameters as floats, or refuse them.

    The domain is 0 < α1 < α2 <= 2, a1 >= 0, a0 > 0 and any finite b0, and of α2 = 2 a1 > 0: there
    G(s) is stable, has the static gain b0/a0 and at most one conjugate pair of poles.

    Raises
    ------
    ValueError
        If a parameter is outside that domain or not finite.
    """
    values = tuple(float(value) for value in (alpha2, alpha1, a1, a0, b0))
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"parameters must be finite, got {values}")
    if not 0.0 < values[1] < values[0] <= 2.0:
        raise ValueError(
            f"orders must satisfy 0 < alpha1 < alpha2 <= 2, got alpha1={alpha1}, alpha2={alpha2}"
        )
    if values[2] < 0.0:
        raise ValueError(f"a1 must not be negative, got {a1}")
    if values[2] == 0.0 and values[0] == 2.0:
        raise ValueError("a1 must be positive where alpha2 = 2: nothing else damps")
    if values[3] <= 0.0:
        raise ValueError(f"a0 must be positive, got {a0}")
    return values[0], values[1], values[2], values[3], values[4]


@njit
def over(a: complex, b: complex) -> complex:
    """a/b without the range checks of complex division (moduli within 1e±150)."""
    scale = 1.0 / (b.real * b.real + b.imag * b.imag)
    return complex(
        (a.real * b.real + a.imag * b.imag) * scale, (a.imag * b.real - a.real * b.imag) * scale
    )


@njit
def cexp(w: complex) -> complex:
    """Complex exponential."""
    r = math.exp(w.real)
    return complex(r * math.cos(w.imag), r * math.sin(w.imag))


@njit
def find_pole(alpha2: float, alpha1: float, a1: float, a0: float) -> complex:
    r"""Logarithm of the root of D in the upper half plane, 0 where there is none to subtract.

    With p = ρ e^{iθ} the imaginary parts of D(p) and of e^{-iα1 θ} D(p) give

    .. math:: ρ^{α_2-α_1} = -a_1 \sin α_1θ / \sin α_2θ, \qquad
              ρ^{α_2} = a_0 \sin α_1θ / \sin (α_2-α_1)θ,

    hence one real equation for θ. It rises monotonically from −∞ to ∞ on
    (π/α2, π/max(α1, α2−α1)); the root is a pole if θ < π. In the logit of the position within
    that interval it is nearly linear, and every sine is taken of the distance to its own zero,
    so that nothing cancels at the ends.

    Returns
    -------
    complex
        ln p, or 0 if there is no pole with |arg p| < 0.97π (its imaginary part, θ > π/2, tells).
    """
    if alpha2 <= 1.0:
        return 0j
    low = math.pi / alpha2
    if a1 == 0.0:
        return complex(math.log(a0) / alpha2, low) if low < POLE_ANGLE_LIMIT else 0j
    larger = max(alpha1, alpha2 - alpha1)
    smaller = alpha2 - larger
    if alpha1 < alpha2 - alpha1:
        smaller = alpha1
    share = larger / alpha2
    rest = smaller / alpha2
    gap = math.pi * (larger - smaller) / (larger * smaller)
    width = math.pi * smaller / (larger * alpha2)
    constant = (1.0 - alpha1 / alpha2) * math.log(a0) - math.log(a1)

    # Bracket and first guess from the asymptotes: f ~ x at the left end, share * x at the right.
    x = 0.0
    below = -800.0
    above = 800.0
    log_ratio = 0.0
    theta = low
    for _ in range(100):
        growth = math.exp(-abs(x))
        if x > 0.0:
            left = width / (1.0 + growth)
            right = width * growth / (1.0 + growth)
        else:
            left = width * growth / (1.0 + growth)
            right = width / (1.0 + growth)
        theta = low + left
        slope_scale = left * right / width
        angle2 = alpha2 * left
        angle_larger = larger * right
        angle_smaller = smaller * theta
        if angle_smaller > 1.5:
            angle_smaller = smaller * (right + gap)
            sign = 1.0
        else:
            sign = -1.0
        sin2 = math.sin(angle2)
        sin_larger = math.sin(angle_larger)
        sin_smaller = math.sin(angle_smaller)
        log_larger = math.log(sin_larger)
        log_smaller = math.log(sin_smaller)
        f = constant + math.log(sin2) - share * log_larger - rest * log_smaller
        slope = slope_scale * (
            alpha2 * math.cos(angle2) / sin2
            + share * larger * math.cos(angle_larger) / sin_larger
            + sign * rest * smaller * math.cos(angle_smaller) / sin_smaller
        )
        log_ratio = log_larger - log_smaller
        if f > 0.0:
            above = x
        else:
            below = x
        step = f / slope
        following = x - step
        if not (below < following < above):
            following = 0.5 * (below + above)
        if abs(step) < 1e-6 or above - below < 1e-12:
            # One more Newton step in ln p below makes 1e-6 into 1e-12, a second one full precision.
            break
        x = following
    if theta > POLE_ANGLE_LIMIT:
        return 0j
    if alpha1 < alpha2 - alpha1:
        log_ratio = -log_ratio
    w = complex((math.log(a0) + log_ratio) / alpha2, theta)
    for _ in range(2):
        power2 = cexp(alpha2 * w)
        power1 = a1 * cexp(alpha1 * w)
        w -= over(power2 + power1 + a0, alpha2 * power2 + alpha1 * power1)
    return w


CIRCLE = 16
ON_CIRCLE = np.exp(2j * np.pi * (np.arange(CIRCLE) + 0.5) / CIRCLE)


@njit
def circle_radius(p: complex) -> float:
    """Radius of the circles used near the pole: a tenth of its distance to the cut.

    The transform less its pole is analytic up to the cut, so the mean of 16 values on such a
    circle is its value at the centre to 1e-16. It replaces the value itself where the centre is
    within half a radius of the pole, and the difference would lose digits.
    """
    return 0.1 * (p.imag if p.real < 0.0 else abs(p))


@njit
def transform_less_poles(
    s: complex,
    power: float,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    p: complex,
    residue: complex,
) -> complex:
    """s^power/D(s) − R/(s − p) − R̄/(s − p̄)."""
    log_s = complex(math.log(abs(s)), math.atan2(s.imag, s.real))
    d = cexp(alpha2 * log_s) + a1 * cexp(alpha1 * log_s) + a0
    value = over(cexp(power * log_s), d)
    if residue != 0j:
        value -= over(residue, s - p) + over(residue.conjugate(), s - p.conjugate())
    return value


@njit
def transform_on_circle(
    s: complex,
    power: float,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    p: complex,
    residue: complex,
) -> complex:
    """`transform_less_poles` near the pole, as its mean over a circle around s."""
    radius = circle_radius(p)
    total = 0j
    for i in range(CIRCLE):
        z = s + radius * ON_CIRCLE[i]
        total += transform_less_poles(z, power, alpha2, alpha1, a1, a0, p, residue)
    return total * (1.0 / CIRCLE)
