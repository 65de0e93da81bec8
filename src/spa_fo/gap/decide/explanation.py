"""An explanation as a whole: a drive, an actuator, a sensor, a log; and the model it makes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.decide.verdict import Scored
from spa_fo.gap.search.drive import DriveFit
from spa_fo.gap.search.fitted import Fitted
from spa_fo.plant import PARAMETERS, Model, TransferFunction
from spa_fo.plant.augmented import BRANCHES, LET_GO
from spa_fo.plant.branches import CAME_BEFORE
from spa_fo.plant.effects.library import LIBRARY, Ids, at_port, ordered
from spa_fo.plant.law import Law
from spa_fo.plant.lawful import with_law
from spa_fo.plant.specimen import Mounting

_CARRIED = ("provenance", "sampling")  # keys of the plain model that hold of the augmented one too


@dataclass(frozen=True)
class Explanation:
    """A set of effects with its fits."""

    ids: Ids  # all its effects, in the library's order; empty for none
    angle: Fitted  # its fit of the angle
    drive: DriveFit | None  # its fit of the pressure; None where the drive has no part of its own
    line: tuple[float, float] | None  # frequency (Hz) and amplitude (deg) of an interference

    @property
    def x(self) -> Floats:
        """Coefficients alpha2, alpha1, a1, a0, b0."""
        return self.angle.x

    def effects(self) -> Floats:
        """Parameters of all effects that a simulation needs, NaN where absent."""
        e = self.angle.effects.copy()
        if self.drive is not None:
            for name in self.drive.ids:
                e[LIBRARY[name].slots] = self.drive.effects[LIBRARY[name].slots]
        curve = at_port("curve", self.ids)
        if curve:
            e[LIBRARY[curve].slots] = [*self.angle.curve_deg, self.angle.curve_stretch - 1.0]
        return e

    def in_fixture(self) -> Floats:
        """Parameters of those effects that the calibration's dwells show."""
        e = self.effects()
        if self.angle.calibrated.apart:
            e[LIBRARY.slots(lambda effect: effect.in_trials_alone)] = np.nan
        return e

    def parameters(self, given: Floats, orders: NDArray[np.int64]) -> dict[str, dict[str, Any]]:
        """Parameters of each effect by name, as model files hold them, within their bounds."""
        e = self.effects()
        values = {name: e[LIBRARY[name].slots].tolist() for name in self.ids}
        zeros, line = at_port("zeros", self.ids), at_port("line", self.ids)
        if zeros:
            by_trial = self.angle.zeros_deg
            values[zeros] = [steady_walk(orders, by_trial)[0], float(by_trial[0])]
        if line and self.line is not None:
            values[line] = [self.line[1], self.line[0]]
        found: dict[str, dict[str, Any]] = {
            name: {
                p.name: float(np.clip(value, p.low, p.high))
                for p, value in zip(LIBRARY[name].parameters, own, strict=True)
            }
            for name, own in values.items()
        }
        shift = at_port("coefficients", self.ids)
        if shift:
            found[shift] = dict(zip(PARAMETERS, (self.x / given).tolist(), strict=True))
        return found


def steady_walk(orders: NDArray[np.int64], zeros_deg: Floats) -> tuple[float, float]:
    """Estimate how a zero goes on, deg per trial, and 1 sigma of that.

    The mean of its steps, the less of it the less it differs from what they scatter by: a zero that
    only jumps about is as likely to go back as on.

    Parameters
    ----------
    orders : (trials,) array of int
        Places of the trials in the campaign, ascending.
    zeros_deg : (trials,) array
        The zero in each.

    Notes
    -----
    Positive-part shrinkage: W. James, C. Stein, Proc. 4th Berkeley Symp. 1 (1961) 361.
    """
    if orders.size < 2:
        return 0.0, 0.0
    taken = np.diff(orders)
    mean = float(zeros_deg[-1] - zeros_deg[0]) / float(taken.sum())
    if taken.size < 2:
        return 0.0, abs(mean)  # a single step is a jump as well
    # Of independent steps the variance grows with their number.
    square = float(np.sum((np.diff(zeros_deg) - mean * taken) ** 2 / taken)) / (taken.size - 1)
    error = square / float(taken.sum())
    return mean * max(0.0, 1.0 - error / max(mean**2, 1e-300)), error**0.5


def angle_part(named: Ids, drive: DriveFit | None, fast: bool) -> Ids:
    """Say which effects of a set the angle's fit holds; the others stand in drive and log."""
    line = at_port("line", named) if fast else None
    return tuple(
        n for n in named if n != line and not (drive is not None and LIBRARY[n].stage == "drive")
    )


def explanation_of(scored: Scored, angle: Fitted, drive: DriveFit | None) -> Explanation:
    """Put an explanation together from fits of its effects beyond the drive, and of its drive."""
    line = angle.line
    if scored.fast is not None:
        line = scored.fast.frequency_hz, scored.fast.amplitude_deg
    return Explanation(ordered(scored.named), angle, drive, line)


def simulate(
    explanation: Explanation,
    evidence: Evidence,
    given: Floats | None = None,
    law: Law | None = None,
) -> Floats:
    """Angle (deg) at the averaged samples from the command.

    Parameters
    ----------
    explanation : Explanation
        What is at work. The random phases of an interference are left out.
    evidence : Evidence
        The campaign.
    given : (5,) array, optional
        Coefficients instead of the explanation's: those before a shift of the parameters.
    law : Law, optional
        A free-form law beside its effects.
    """
    e, x = explanation.effects(), explanation.x if given is None else given
    zeros, line = at_port("zeros"), at_port("line")
    for name in (zeros, line):
        if name is not None:
            e[LIBRARY[name].slots] = np.nan
    chain = angle_chain(evidence, x, None).mounted(mounting_of(evidence, explanation.in_fixture()))
    chain = replace(chain, branches=explanation.angle.branches)
    angle, _ = (chain if law is None else with_law(chain, law)).run(x, e)
    if zeros in explanation.ids:
        angle = angle + explanation.angle.zeros_deg[evidence.grid.sample_trial]
    return angle


def mounting_of(evidence: Evidence, effects: Floats) -> Mounting:
    """How these effects leave the sensor after its first calibration."""
    return Mounting() if evidence.fixture is None else evidence.fixture.simulate(effects)[1]


def augmented_model(explanation: Explanation, evidence: Evidence, plain: Model) -> Model:
    """Write an explanation as a model that `predict` runs.

    Beside the contract's keys it holds ``sensor_seat``, how the first calibration left the sensor,
    the branches of its loop that logs begin on (`BRANCHES`), and whether the actuator is let go
    between trials (`LET_GO`) where its effects carry on there. The campaign is that of the
    evidence; a memory is added by the caller.
    """
    orders = evidence.grid.orders
    parameters = explanation.parameters(plain.transfer_function.as_array(), orders)
    effects: list[dict[str, Any]] = [
        {"id": name, "stage": LIBRARY[name].stage, "parameters": parameters[name]}
        for name in explanation.ids
    ]
    for effect in effects:
        if LIBRARY[effect["id"]].port == "zeros":
            zeros = explanation.angle.zeros_deg.tolist()
            effect["zeros_deg"] = {str(o): z for o, z in zip(orders.tolist(), zeros, strict=True)}
        if effect["id"] in explanation.angle.branches:
            of_kind = explanation.angle.branches[effect["id"]].tolist()
            effect[BRANCHES] = dict(zip(CAME_BEFORE, of_kind, strict=True))
    mounting = mounting_of(evidence, explanation.in_fixture())
    # Its coefficients are other ones: the uncertainty of the plain model's is not theirs.
    extra: dict[str, Any] = {key: plain.extra[key] for key in _CARRIED if key in plain.extra}
    if mounting.bias_deg.any() or mounting.film.any():
        extra["sensor_seat"] = mounting.to_dict()
    if evidence.let_go and any(LIBRARY[name].carries_on for name in explanation.ids):
        extra[LET_GO] = True
    return Model(
        campaign=evidence.data.campaign.name,
        material=plain.material,
        transfer_function=TransferFunction.from_array(explanation.x),
        reference_kpa=plain.reference_kpa,
        signal=plain.signal,
        effects=tuple(effects),
        extra=extra,
    )
