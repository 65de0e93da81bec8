"""An explanation as a whole: a drive, an actuator, a sensor, a log; and the model it makes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.candidates import Candidates, Ids, ordered
from spa_fo.gap.drive import DriveFit
from spa_fo.gap.evidence import Evidence, angle_chain
from spa_fo.gap.explain import PICKUP, Fit
from spa_fo.plant import Model, TransferFunction
from spa_fo.plant.chain import Seat
from spa_fo.plant.effects.library import LIBRARY

Floats = NDArray[np.float64]

_CARRIED = ("provenance", "sampling")  # keys of the plain model that hold of the augmented one too


@dataclass(frozen=True)
class Explanation:
    """A set of effects with its fits.

    Attributes
    ----------
    ids : tuple of str
        All its effects, in the library's order; empty for none.
    fit : Fit
        Of the angle.
    drive : DriveFit or None
        Of the pressure; None where it was not measured.
    pickup : tuple of float or None
        Frequency (Hz) and amplitude (deg) of an interference.
    log_evidence : float
        Of angle and pressure together.
    """

    ids: Ids
    fit: Fit
    drive: DriveFit | None
    pickup: tuple[float, float] | None
    log_evidence: float

    def effects(self) -> Floats:
        """Parameters of all effects that a simulation needs, NaN where absent."""
        e = self.fit.effects.copy()
        if self.drive is not None:
            for name in self.drive.ids:
                e[LIBRARY[name].slots] = self.drive.effects[LIBRARY[name].slots]
        if "sensor_nonlinearity" in self.ids:
            e[LIBRARY["sensor_nonlinearity"].slots] = self.fit.curve_deg
        return e

    def parameters(self, given: Floats, orders: NDArray[np.int64]) -> dict[str, dict[str, Any]]:
        """Parameters of each effect by name, as model files hold them."""
        e = self.effects()
        result: dict[str, dict[str, Any]] = {}
        for name in self.ids:
            effect = LIBRARY[name]
            # What the mixed model fits as columns and variances knows no bounds.
            result[name] = {
                p.name: float(np.clip(v, p.low, p.high))
                for p, v in zip(effect.parameters, e[effect.slots], strict=True)
            }
        if "parameter_shift" in result:
            names = ("alpha2", "alpha1", "a1", "a0", "b0")
            ratio = self.fit.x / given
            result["parameter_shift"] = dict(zip(names, ratio.tolist(), strict=True))
        if "sensor_slip" in result:
            zeros = self.fit.zeros_deg
            walk = float(np.polyfit(orders, zeros, 1)[0]) if orders.size > 1 else 0.0
            slip = LIBRARY["sensor_slip"].parameters
            values = zip(slip, (walk, float(zeros[0])), strict=True)
            result["sensor_slip"] = {p.name: min(max(v, p.low), p.high) for p, v in values}
        if "mains_pickup" in result and self.pickup is not None:
            result["mains_pickup"] = {
                "amplitude_deg": min(self.pickup[1], LIBRARY["mains_pickup"].parameters[0].high),
                "frequency_hz": self.pickup[0],
            }
        return result


def combined(candidates: Candidates) -> list[Explanation]:
    """Put every fit of the drive together with every fit of the angle.

    With the given model's coefficients held, the angle's own effects; with them free, a shift of
    the parameters beside them, unless the model was fitted to this very campaign.
    """
    drives: list[DriveFit | None] = list(candidates.drives.values()) or [None]
    result: dict[Ids, Explanation] = {}
    for drive in drives:
        for (ids, level), fit in candidates.angles.items():
            if candidates.own and level != "own":
                continue
            names = set(ids) | set(drive.ids if drive is not None else ())
            if level in ("shifted", "free") and not candidates.own:
                if "parameter_shift" in candidates.excluded:
                    continue
                names.add("parameter_shift")
            evidence = fit.log_evidence + (drive.log_evidence if drive is not None else 0.0)
            pickup = None
            if "mains_pickup" in ids and candidates.slow is not None:
                amplitude = float(np.sqrt(2.0 * fit.solution.variances[PICKUP]))
                pickup = (candidates.slow.frequency_hz, amplitude)
                evidence -= candidates.slow.search_price
            whole = Explanation(ordered(tuple(names)), fit, drive, pickup, evidence)
            for each in (whole, _with_fast_line(whole, candidates)):
                if each is not None:
                    known = result.get(each.ids)
                    if known is None or each.log_evidence > known.log_evidence:
                        result[each.ids] = each
    return list(result.values())


def _with_fast_line(whole: Explanation, candidates: Candidates) -> Explanation | None:
    """Add interference above 3 Hz, which the averaged angles do not show."""
    fast = candidates.fast
    if fast.fast_gain <= 0.0 or "mains_pickup" in (*whole.ids, *candidates.excluded):
        return None
    return replace(
        whole,
        ids=ordered((*whole.ids, "mains_pickup")),
        pickup=(fast.frequency_hz, fast.amplitude_deg),
        log_evidence=whole.log_evidence + fast.fast_gain,
    )


def simulate(
    explanation: Explanation, evidence: Evidence, without: Ids = (), given: Floats | None = None
) -> Floats:
    """Angle (deg) at the averaged samples from the command, some effects left out.

    Parameters
    ----------
    explanation : Explanation
        What is at work.
    evidence : Evidence
        The campaign.
    without : tuple of str
        Its effects to leave out.
    given : (5,) array, optional
        Coefficients instead of the explanation's: those before a shift of the parameters.
    """
    e = explanation.effects()
    for name in without:
        e[LIBRARY[name].slots] = np.nan
    x = explanation.fit.x if given is None else given
    slip = "sensor_slip" in explanation.ids and "sensor_slip" not in without
    e[LIBRARY["sensor_slip"].slots] = np.nan
    e[LIBRARY["mains_pickup"].slots] = np.nan
    chain = angle_chain(evidence, x, None)
    angle, _ = chain.seated(seat_of(evidence, e)).run(x, e)
    if slip:
        angle = angle + explanation.fit.zeros_deg[evidence.grid.sample_trial]
    return angle


def seat_of(evidence: Evidence, effects: Floats) -> Seat:
    """How these effects leave the sensor after its first calibration."""
    return Seat() if evidence.fixture is None else evidence.fixture.simulate(effects)[1]


def augmented_model(explanation: Explanation, evidence: Evidence, plain: Model) -> Model:
    """Write an explanation as a model that `predict` runs.

    Beside the contract's keys it holds ``sensor_seat``, how the first calibration left the sensor.
    The campaign is that of the evidence; a memory is added by the caller.
    """
    orders = evidence.grid.orders
    parameters = explanation.parameters(plain.transfer_function.as_array(), orders)
    effects = []
    for name in explanation.ids:
        effect: dict[str, Any] = {
            "id": name,
            "stage": LIBRARY[name].stage,
            "parameters": parameters[name],
        }
        if name == "sensor_slip":
            zeros = explanation.fit.zeros_deg.tolist()
            effect["zeros_deg"] = {str(o): z for o, z in zip(orders.tolist(), zeros, strict=True)}
        effects.append(effect)
    seat = seat_of(evidence, explanation.effects())
    # Its coefficients are other ones: the uncertainty of the plain model's is not theirs.
    extra: dict[str, Any] = {key: plain.extra[key] for key in _CARRIED if key in plain.extra}
    if seat.bias_deg.any() or seat.film.any():
        extra["sensor_seat"] = seat.to_dict()
    return Model(
        campaign=evidence.data.campaign.name,
        material=plain.material,
        transfer_function=TransferFunction.from_array(explanation.fit.x),
        reference_kpa=plain.reference_kpa,
        signal=plain.signal,
        effects=tuple(effects),
        extra=extra,
    )
