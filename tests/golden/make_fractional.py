"""Write fractional.json: reference values to 25 digits, made with mpmath.

Run `python tests/golden/make_fractional.py` from the root of the project (ten seconds).
"""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from pathlib import Path

import mpmath as mp

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from naive_fractional import (  # noqa: E402
    invert,
    naive_jacobian,
    naive_mittag_leffler,
    naive_step_response,
)

CASES = {
    "Dragon Skin 20": [1.406, 1.196, 0.794, 1.638, 0.934],
    "no pole": [0.8, 0.3, 1.5, 0.7, 1.2],
    "pole near the cut": [1.5, 0.7, 2.6, 1.0, 1.0],
    "near-double pole": [1.9995, 0.9998, 2.0, 1.0, 1.0],
    "orders 1e-8 apart": [1.30000001, 1.3, 0.5, 2.0, 1.0],
    "order near 2": [1.9999, 0.4, 0.3, 3.0, 2.0],
    "without middle term": [1.6, 0.9, 0.0, 1.3, 0.8],
    "slow": [0.35, 0.2, 0.1, 0.02, 0.01],
    "stiff": [1.8, 1.2, 30.0, 200.0, 100.0],
}
TIMES = [0.003, 0.05, 0.7, 3.0, 11.0]
MITTAG_LEFFLER = [
    (z, alpha, beta, gamma)
    for alpha, beta, gamma in [
        (0.5, 1.0, 1.0),
        (0.8, 0.8, 1.0),
        (0.7, 1.3, 0.6),
        (1.0, 2.0, 1.7),
        (1.2, 1.0, 2.0),
        (1.406, 2.406, 1.0),
        (1.406, 2.616, 2.0),
        (1.7, 2.5, 3.5),
        (1.95, 1.0, 1.0),
        (1.99, 0.4, 0.7),
    ]
    for z in (-40.0, -9.0, -1.5, -0.1, 0.0, 0.3, 2.0, 8.0)
    if not (alpha < 0.75 and abs(z) > 9.0)
]
SAMPLES = [(0.0, 0.5), (0.4, 1.5), (0.45, 1.4), (1.3, -0.2), (5.0, 0.8), (5.02, 0.9), (9.0, 0.0)]


def sampled(x: list[float], hold: str) -> list[str]:
    """Response at the sample times, by superposition of steps and ramps."""
    alpha2, alpha1, a1, a0, b0 = (mp.mpf(value) for value in x)
    values = []
    for j in range(len(SAMPLES)):
        total = mp.mpf(0)
        for (t0, u0), (t1, u1) in pairwise(SAMPLES[: j + 1]):
            for start, sign in ((t0, 1), (t1, -1)):
                lag = mp.mpf(SAMPLES[j][0]) - mp.mpf(start)
                if lag == 0:
                    continue
                slope = (mp.mpf(u1) - u0) / (mp.mpf(t1) - t0) if hold == "linear" else mp.mpf(0)
                level = mp.mpf(u0 if sign == 1 or hold == "zero" else u1)
                total += sign * invert(
                    lambda s, level=level, slope=slope: (
                        b0 * (level / s + slope / s**2) / (s**alpha2 + a1 * s**alpha1 + a0)
                    ),
                    lag,
                    60,
                )
        values.append(mp.nstr(total, 25))
    return values


mp.mp.dps = 30


def main() -> None:
    """Compute all values and write them beside this script."""
    table = {
        "step": [
            {"x": x, "t": TIMES, "y": [mp.nstr(naive_step_response(t, x), 25) for t in TIMES]}
            for x in CASES.values()
        ],
        "jacobian": [
            {"x": x, "t": t, "gradient": [mp.nstr(value, 25) for value in naive_jacobian(t, x)]}
            for x in CASES.values()
            if x[2] > 0.0
            for t in (0.05, 3.0)
        ],
        "mittag_leffler": [
            {"arguments": list(row), "value": mp.nstr(naive_mittag_leffler(*row), 25)}
            for row in MITTAG_LEFFLER
        ],
        "simulate": [
            {"samples": SAMPLES, "x": CASES[case], "hold": hold, "y": sampled(CASES[case], hold)}
            for case in ("Dragon Skin 20", "no pole")
            for hold in ("linear", "zero")
        ],
    }
    with mp.workdps(30):
        (HERE / "fractional.json").write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
