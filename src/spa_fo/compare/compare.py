"""What changed between two campaigns of one actuator.

What the model misses on the reference is learned as a law of fading memory. In the other campaign
it belongs to the actuator's angle, as every effect meets it: what is left there is what changed. It
is diagnosed as any gap is, with what the law misses on trials of the reference that it did not
learn from as part of the noise. Where the reference never went, nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.blas import one_blas_thread
from spa_fo.compare.angle_law import AngleKnown, know_angle
from spa_fo.compare.drive_law import know_drive, shows_drive
from spa_fo.compare.expectation import best, noise_of
from spa_fo.compare.fading_memory import FadingMemoryLaw
from spa_fo.compare.held_to_reference import Reference
from spa_fo.compare.misread import Misread, with_misread
from spa_fo.compare.zero import at_rest_deg, moving_deg
from spa_fo.gap.data.evidence import Foreseen, largest_deg
from spa_fo.gap.decide.examine import silent
from spa_fo.gap.diagnose import diagnose
from spa_fo.gap.diagnosis import Diagnosis
from spa_fo.gap.noise.bench_noise import NOWHERE, TYPICAL, Beyond
from spa_fo.plant import Model
from spa_fo.rig import CampaignData
from spa_fo.rig.dropouts import without_dropouts

Progress = Callable[[str], None]

SCHEMA = "spa-fo/comparison/1"
NOTHING_CHANGED = "nothing_changed"
_NOT_COMPARED = "the reference was hardly ever where this campaign was: nothing can be compared"


@dataclass(frozen=True)
class Comparison:
    """What changed.

    Attributes
    ----------
    reference, data : CampaignData
        Both campaigns, as measured.
    change : Diagnosis
        Of the second campaign, with what is missed in both known.
    angle_law, pressure_law : FadingMemoryLaw or None
        What the model misses on the reference, deg, and what the pressure differs from the
        command by, kPa; None where it was not logged.
    common : tuple of arrays
        By trial of the second campaign: what is missed in both, deg, or kPa where no angle was
        logged.
    unvisited : float
        Share of the second campaign's rows where the reference never was: they say nothing.
    model : Model or None
        Of the reference with the change in it; the plain one where nothing is named. None where no
        angle was logged: all that `change` says in degrees is in kPa then.
    misread : tuple of Misread
        Where the reading of the second campaign is none of an actuator's.
    sigma : tuple of arrays
        By trial of the second campaign: standard deviation of what it may differ by without any
        change, deg; NaN where the reference never was. Empty where no angle was logged.
    """

    reference: CampaignData
    data: CampaignData
    change: Diagnosis
    angle_law: FadingMemoryLaw | None
    pressure_law: FadingMemoryLaw | None
    common: tuple[Floats, ...]
    unvisited: float
    model: Model | None
    misread: tuple[Misread, ...] = ()
    sigma: tuple[Floats, ...] = ()

    @property
    def kind(self) -> str:
        """nothing_changed, cause, ambiguous or unknown."""
        return NOTHING_CHANGED if self.change.kind == "no_gap" else self.change.kind

    @property
    def law(self) -> FadingMemoryLaw:
        """Of the angle; of the pressure where no angle was logged."""
        found = self.angle_law or self.pressure_law
        assert found is not None
        return found

    @property
    def compared(self) -> Literal["angle", "pressure"]:
        """What was compared."""
        return "angle" if self.angle_law is not None else "pressure"

    @property
    def says_nothing(self) -> bool:
        """Whether the angle was hardly ever compared, as the reference was elsewhere."""
        return self.compared == "angle" and self.unvisited > NOWHERE

    @property
    def common_rms(self) -> float:
        """RMS of what is missed in both."""
        return float(np.sqrt(np.mean(np.concatenate(self.common) ** 2)))

    def to_dict(self) -> dict[str, Any]:
        """Return the document of comparison.json: that of a diagnosis, of what changed.

        Where no angle was logged its keys end in ``_kpa`` in place of ``_deg``.
        """
        document = self.change.to_dict()
        found = {
            **document,
            "schema": SCHEMA,
            "reference": self.reference.campaign.name,
            "compared": self.compared,
            "verdict": {**document["verdict"], "kind": self.kind},
            "common": {
                "rmse_deg": self.common_rms,
                "learned_to_deg": self.law.left_rms,
                "unvisited": self.unvisited,
            },
        }
        return found if self.compared == "angle" else _in_kpa(found)


def _in_kpa(part: Any) -> Any:
    """Name what is in kPa so."""
    if isinstance(part, dict):
        return {
            f"{key.removesuffix('_deg')}_kpa" if key.endswith("_deg") else key: _in_kpa(value)
            for key, value in part.items()
        }
    return [_in_kpa(item) for item in part] if isinstance(part, list) else part


@one_blas_thread
def compare(
    reference: CampaignData,
    data: CampaignData,
    plain: Model,
    *,
    excluded: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
) -> Comparison:
    """Say what changed from one campaign of an actuator to another.

    Parameters
    ----------
    reference, data : CampaignData
        How it was, and how it is.
    plain : Model
        A plain model of the reference.
    excluded : sequence of str
        Effects that the library is to lack.
    seed : int
        Of the trials that are held out and of the bootstrap.
    progress : callable
        Told of each step in words.

    Raises
    ------
    BadInput
        A log lacks the signal that drives the model.
    """
    progress(f"learning what the model misses on {len(reference.trials)} trials of the reference")
    sound = without_dropouts(reference), without_dropouts(data)
    known = know_angle(*sound, plain)
    beyond = _beyond(*sound, plain, known)
    trials, of_pressure = data.trials, None
    if plain.signal == "command" and all(map(shows_drive, (*reference.trials, *data.trials))):
        drive = know_drive(reference, data)
        trials, of_pressure = drive.trials, drive.law
        beyond = replace(beyond, pressure=drive.spectrum, pressure_kpa=drive.expected_kpa)
    # The model is the reference's, whatever the campaigns are called.
    change = diagnose(
        replace(data, trials=trials),
        replace(plain, extra={}),
        excluded=excluded,
        seed=seed,
        progress=progress,
        reference=Reference(beyond),
    )
    found = tuple(each for own in known.misread for each in own)
    change = replace(change, findings=(*known.broken, *change.findings))
    change = with_misread(change, found, sum(rows.size for rows in known.unvisited))
    if beyond.says_nothing and not found:
        where = replace(change.where, stage=None, not_known=_NOT_COMPARED, assumed=None)
        change = replace(change, where=where)
    return Comparison(
        reference=reference,
        data=data,
        change=change,
        angle_law=known.law,
        pressure_law=of_pressure,
        common=tuple(mean for mean, _ in known.common),
        unvisited=beyond.unvisited,
        model=replace(change.model, extra={**plain.extra, **change.model.extra}),
        misread=found,
        sigma=tuple(
            np.where(nowhere, np.nan, own)
            for own, nowhere in zip(known.sigma, known.unvisited, strict=True)
        ),
    )


def _beyond(reference: CampaignData, data: CampaignData, plain: Model, known: AngleKnown) -> Beyond:
    """Put together what may differ without any change."""
    predicted = [
        t.angle_deg - s.missed for t, s in zip(reference.trials, known.missed, strict=True)
    ]
    angle_deg = best(known.common, known.unvisited)
    spectrum, scattered = noise_of(known.law, known.missed, predicted, angle_deg)
    rest, moving = at_rest_deg(data, plain), moving_deg((reference, data))
    return Beyond(
        angle=spectrum,
        scatter=replace(scattered, rest_deg=_together(scattered.rest_deg, rest, moving)),
        day=TYPICAL,
        zero_deg=_together(rest, moving),
        angle_deg=angle_deg,
        repeats=known.law.chosen.repeats,
        read_deg=largest_deg(reference.trials),
        unvisited=float(np.mean(np.concatenate(known.unvisited))),
        trials=len(reference.trials),
        broken=bool(known.broken),
        usual=tuple(
            Foreseen(mean, deviation, rows, late)
            for (mean, deviation), rows, late in zip(
                known.common, known.unvisited, known.late, strict=True
            )
        ),
    )


def _together(*deviations: float) -> float:
    return float(np.sqrt(np.sum(np.square(deviations))))
