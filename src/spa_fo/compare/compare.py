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
from numpy.typing import NDArray

from spa_fo.blas import one_blas_thread
from spa_fo.compare.fading_memory import FadingMemoryLaw, Signal
from spa_fo.compare.learning import learn
from spa_fo.compare.misread import Misread, misread, rows_of, with_misread
from spa_fo.errors import BadInput
from spa_fo.gap.data.evidence import Foreseen, largest_deg
from spa_fo.gap.decide.examine import silent
from spa_fo.gap.diagnose import diagnose
from spa_fo.gap.diagnosis import Diagnosis
from spa_fo.gap.noise.bench_noise import NOWHERE, TYPICAL, Beyond
from spa_fo.gap.noise.coloured import (
    CORRELATION_S,
    TYPICAL_DEG,
    Scatter,
    Spectrum,
    estimate,
    misfit,
    scatter,
)
from spa_fo.identify.whole_log import input_of
from spa_fo.plant import Model
from spa_fo.plant.augmented import predict_augmented
from spa_fo.plant.grid import acting_command
from spa_fo.rig import CampaignData, Trial
from spa_fo.rig.trials import before_first_change

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

SCHEMA = "spa-fo/comparison/1"
NOTHING_CHANGED = "nothing_changed"
_NOT_COMPARED = "the reference was hardly ever where this campaign was: nothing can be compared"
_JUMP = 0.02  # of the commands' range, from one sample to the next
_ABOUT = 5  # samples about it
_MOST = 0.5  # of a trial
_WHITE = 1e-3  # deg or kPa: what is averaged holds next to no white noise


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
    missed, there = _missed(reference, plain), _missed(data, plain)
    law = learn(missed, _unrepeated_deg(reference))
    common, unvisited = law.predict(there), law.unvisited(there)
    predicted = [t.angle_deg - s.missed for t, s in zip(reference.trials, missed, strict=True)]
    foreseen = [
        trial.angle_deg - signal.missed + mean
        for trial, signal, (mean, _) in zip(data.trials, there, common, strict=True)
    ]
    sigma = [
        np.where(nowhere, np.inf, np.hypot(own, _of_a_day(angle)))
        for angle, (_, own), nowhere in zip(foreseen, common, unvisited, strict=True)
    ]
    wrong = misread(reference, data, [signal.input for signal in there], foreseen, sigma)
    unvisited = [
        rows | rows_of(found, rows.size) for rows, found in zip(unvisited, wrong, strict=True)
    ]
    angle_deg = _best(common, unvisited)
    spectrum, scattered = noise_of(law, missed, predicted, angle_deg)
    rest = max(_bent_at_rest(trial, plain) for trial in data.trials) if _zeroed(data) else 0.0
    zeroed = [t for each in (reference, data) if _zeroed(each) for t in each.trials]
    moving = max(map(_moved_before, zeroed), default=0.0)
    beyond = Beyond(
        angle=spectrum,
        scatter=replace(scattered, rest_deg=_together(scattered.rest_deg, rest, moving)),
        day=TYPICAL,
        zero_deg=_together(rest, moving),
        angle_deg=angle_deg,
        repeats=law.chosen.repeats,
        read_deg=largest_deg(reference.trials),
        unvisited=float(np.mean(np.concatenate(unvisited))),
        trials=len(reference.trials),
        usual=tuple(
            Foreseen(mean, deviation, rows)
            for (mean, deviation), rows in zip(common, unvisited, strict=True)
        ),
    )
    trials, of_pressure = data.trials, None
    if plain.signal == "command" and all(map(shows_drive, (*reference.trials, *data.trials))):
        lost = [lost_in_drive(trial) for trial in reference.trials]
        of_pressure = learn(lost, unrepeated_kpa(lost))
        usual = of_pressure.predict([lost_in_drive(trial) for trial in data.trials])
        expected_kpa = expected(of_pressure, usual)
        beyond = replace(
            beyond,
            pressure=noise_of(of_pressure, lost, [s.input for s in lost], expected_kpa)[0],
            pressure_kpa=expected_kpa,
        )
        trials = tuple(
            replace(t, pressure_kpa=_of(t.pressure_kpa) - mean)
            for t, (mean, _) in zip(trials, usual, strict=True)
        )
    # The model is the reference's, whatever the campaigns are called.
    change = diagnose(
        replace(data, trials=trials),
        replace(plain, extra={}),
        excluded=excluded,
        seed=seed,
        progress=progress,
        beyond=beyond,
    )
    found = tuple(each for own in wrong for each in own)
    change = with_misread(change, found, sum(rows.size for rows in unvisited))
    if beyond.says_nothing and not found:
        where = replace(change.where, stage=None, not_known=_NOT_COMPARED, assumed=None)
        change = replace(change, where=where)
    model = replace(change.model, extra={**plain.extra, **change.model.extra})
    return Comparison(
        reference=reference,
        data=data,
        change=change,
        angle_law=law,
        pressure_law=of_pressure,
        common=tuple(mean for mean, _ in common),
        unvisited=beyond.unvisited,
        model=model,
        misread=found,
        sigma=tuple(
            np.where(nowhere, np.nan, own) for own, nowhere in zip(sigma, unvisited, strict=True)
        ),
    )


def _of_a_day(angle_deg: Floats) -> Floats:
    """Say by how much one day's angles differ from another's, at each row, deg."""
    return np.asarray(np.hypot(TYPICAL.gain * angle_deg, TYPICAL.rest_deg))


def _bent_at_rest(trial: Trial, plain: Model) -> float:
    """Return about what the first command bends: a log that begins under it has no known zero."""
    drive = input_of(trial, plain.signal)
    assert drive is not None
    share = abs(float(drive[0])) / max(float(np.max(np.abs(drive))), 1e-9)
    return share * float(np.max(np.abs(trial.angle_deg)))


def _zeroed(data: CampaignData) -> bool:
    """Say whether each log's zero is its own mean before the input changes, not the sensor's."""
    return any(column.rest == "zero" for column in (data.campaign.log.columns or {}).values())


def _moved_before(trial: Trial) -> float:
    """Return how far the angle goes before the input changes: its mean there is no sure zero."""
    before = trial.angle_deg[: before_first_change(trial)]
    fifth = before.size // 5
    return abs(float(before[-fifth:].mean() - before[:fifth].mean())) if fifth else 0.0


def _together(*deviations: float) -> float:
    return float(np.sqrt(np.sum(np.square(deviations))))


def _of(signal: Floats | None) -> Floats:
    assert signal is not None
    return signal


def _driving(trial: Trial, plain: Model, data: CampaignData) -> Floats:
    drive = input_of(trial, plain.signal)
    if drive is None:
        raise BadInput(
            data.campaign.folder,
            f"expected a {plain.signal} column: it drives the model",
            trial.label,
        )
    return drive


def _missed(data: CampaignData, plain: Model) -> list[Signal]:
    """Return what the model misses of each trial, what a trial leaves to the next with it."""
    driving = [_driving(trial, plain, data) for trial in data.trials]
    predicted = predict_augmented(replace(plain, extra={}), data)
    return [
        Signal(t.started_s, t.t_s, drive, t.angle_deg - angle)
        for t, drive, angle in zip(data.trials, driving, predicted, strict=True)
    ]


def shows_drive(trial: Trial) -> bool:
    """Say whether command and pressure of a trial were logged."""
    return trial.command_kpa is not None and trial.pressure_kpa is not None


def lost_in_drive(trial: Trial) -> Signal:
    """Return what the pressure of a trial differs from its command by.

    About a jump it says when, not how much, and is doubtful. Where that would be most of a trial
    the command does not jump, it moves: what a row shows then differs from what acted on it.
    """
    command, pressure = _of(trial.command_kpa), _of(trial.pressure_kpa)
    step = np.abs(np.diff(command, prepend=command[0]))
    jumps = step > _JUMP * np.ptp(command)
    about = np.convolve(jumps, np.ones(_ABOUT), mode="same") > 0.0
    if about.mean() < _MOST:
        return Signal(trial.started_s, trial.t_s, command, pressure - command, about)
    acting = acting_command(trial)
    return Signal(trial.started_s, trial.t_s, acting, pressure - acting)


def expected(law: FadingMemoryLaw, found: Sequence[tuple[Floats, Floats]]) -> float:
    """RMS of what a law lets expect that it misses where it was asked, or missed before."""
    deviation = np.concatenate([each for _, each in found])
    return max(float(np.sqrt(np.mean(deviation**2))), law.left_rms)


def _best(found: Sequence[tuple[Floats, Floats]], unvisited: Sequence[NDArray[np.bool_]]) -> float:
    """Return the harmonic mean of the variances that are foreseen, as a deviation, deg."""
    deviation = np.concatenate([each for _, each in found])
    known = ~np.concatenate(unvisited)
    if not known.any():
        known[:] = True
    return float(np.mean(deviation[known] ** -2.0) ** -0.5)


def _unrepeated_deg(reference: CampaignData) -> float:
    """Say what repeats of a trial of some campaign differ by, where none is there to show it."""
    angle = np.concatenate([trial.angle_deg for trial in reference.trials])
    coloured = TYPICAL_DEG * np.sqrt(CORRELATION_S.size)
    return _together(coloured, TYPICAL.gain * float(np.sqrt(np.mean(angle**2))))


def unrepeated_kpa(lost: Sequence[Signal]) -> float:
    """Say the same of the pressure that a drive makes of a command."""
    command = np.concatenate([signal.input for signal in lost])
    return max(TYPICAL.gain * float(np.sqrt(np.mean(command**2))), _WHITE)


def noise_of(
    law: FadingMemoryLaw, signals: Sequence[Signal], shapes: Sequence[Floats], size: float
) -> tuple[Spectrum, Scatter]:
    """Estimate the noise that the law's own misses are on trials it did not learn from.

    Each is taken over what was expected there, and made as large as `size`. `shapes` are what a
    gain of a trial's own would multiply.
    """
    differences = [
        misfit(signal.t_s, size / deviation * left, size / deviation * shape)
        for signal, left, deviation, shape in zip(
            signals, law.left, law.expected, shapes, strict=True
        )
    ]
    spectrum = estimate(differences, _WHITE)
    return replace(spectrum, white=0.0), scatter(differences, spectrum, TYPICAL)
