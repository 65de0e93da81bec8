"""One case of the blind benchmark: a campaign whose gap has a known cause.

A case is decided by its own few words (`Case`): the specimen, the scatter, the order of the
trials and the secondary parameters of the effect follow from its seed; the principal amplitude is
solved for the size that is asked. What is handed out (`campaign`, the plain model, the effects to
withhold) says nothing of the cause, which stands in the label alone.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from blind.equivalents import equivalents
from blind.first_rig.doses import FORMS, Dose, draw_dose
from blind.first_rig.foreign_effects import ALIENS
from blind.first_rig.sizing import Scale, Sized
from spa_fo.virtual_rig.actuator import FractionalCore, ParameterShift, SoftActuator
from spa_fo.virtual_rig.actuators import (
    DRAGON_SKIN_20_CORE,
    FX_PRO_CORE,
    REFERENCE_KPA,
    CampaignPlan,
    Experiment,
    pressure_for,
)
from spa_fo.virtual_rig.bench import Scatter, Specimen
from spa_fo.virtual_rig.campaign_writer import continued_files, schedule
from spa_fo.virtual_rig.protocols import (
    hold,
    plateaus,
    staircase,
    step,
    step_release,
    triangle,
)
from spa_fo.virtual_rig.syringe_pump import SyringePump
from spa_fo.virtual_rig.wire import Damage

KINDS = ("closed", "no_effect", "withheld", "alien", "pair")
PROTOCOLS = ("rich", "up_steps")
MODELS = ("nominal", "own_fit")

_STAIRS = (0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25)
_RICH_TRIALS = {"step_30": 5, "step_60": 5, "staircase": 3, "triangle": 3, "hold_45": 2}
_UP_STEPS = {"step_30": 7, "step_60": 7}


@dataclass(frozen=True)
class Case:
    """One case of the benchmark.

    Parameters
    ----------
    name : str
        Its folder and the campaign's name, as ``case_0001``: says nothing of the cause.
    seed : int
        Seed of all that is drawn.
    kind : str
        ``closed`` (the library holds the effect), ``no_effect``, ``withheld`` (it does not, as
        `exclude` says), ``alien`` (it never did), or ``pair`` (two effects).
    effects : tuple of str
        What is at work.
    form : {"a", "b"}
        Which functional form the effects have.
    sizes : tuple of float
        RMS change of the angle that each effect makes alone, in multiples of the noise floor.
    protocol : {"rich", "up_steps"}
        What is tried: a rich mixture with calibrations before and after, or the paper's up-steps.
    model : {"nominal", "own_fit"}
        Whether the model to judge holds the bare core's coefficients, or has to be identified on
        the campaign itself.
    exclude : tuple of str
        Effects to withhold from the library.
    """

    name: str
    seed: int
    kind: str = "no_effect"
    effects: tuple[str, ...] = ()
    form: str = "a"
    sizes: tuple[float, ...] = ()
    protocol: str = "rich"
    model: str = "nominal"
    exclude: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, known in (
            ("kind", KINDS),
            ("form", tuple(FORMS)),
            ("protocol", PROTOCOLS),
            ("model", MODELS),
        ):
            if getattr(self, name) not in known:
                raise ValueError(f"a case's {name} is one of {', '.join(known)}")
        count = {"no_effect": 0, "pair": 2}.get(self.kind, 1)
        if len(self.effects) != count or len(self.sizes) != count:
            raise ValueError(f"a case of kind {self.kind} has {count} effects, each with a size")
        for effect in self.effects:
            if effect not in (ALIENS if self.kind == "alien" else FORMS[self.form]):
                raise ValueError(f"no effect of a case of kind {self.kind} is called '{effect}'")


@dataclass(frozen=True)
class _Given:
    """An effect as a case has it."""

    effect: str
    dose: Dose
    sized: Sized


class BuiltCase:
    """A case with everything drawn and solved; its files are made when they are asked for.

    Parameters
    ----------
    case : Case
        What is asked.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        bare = plan_campaign(case)
        self.core = bare.specimen.actuator.core
        scale = Scale(bare, case.seed)
        specimen = bare.specimen
        given: list[_Given] = []
        for effect, size in zip(case.effects, case.sizes, strict=True):
            dose = draw_dose(effect, case.form, _stream(case, effect))
            sized = scale.amplitude_for(dose, size, specimen if given else None)
            given.append(_Given(effect, dose, sized))
            specimen = dose.given_to(specimen, sized.amplitude)
        self._given = tuple(given)
        self._floor_deg = scale.floor_deg
        self._joint_size = scale.weigh(specimen)[0] if len(given) > 1 else None
        self.plan = replace(bare, specimen=specimen)

    @cached_property
    def _files(self) -> tuple[dict[str, bytes], dict[str, bytes]]:
        return continued_files(self.plan, plan_continuation(self.case, self.plan), self.case.seed)

    @property
    def campaign(self) -> dict[str, bytes]:
        """Every file of the campaign's folder."""
        return self._files[0]

    @property
    def later(self) -> dict[str, bytes]:
        """Every file of the campaign that continues it, by other protocols and at other levels."""
        return self._files[1]

    @property
    def label(self) -> dict[str, Any]:
        """The truth, for whoever opens the seal."""
        case = self.case
        return {
            "schema": "spa-fo/blind-label/1",
            "case": case.name,
            "kind": case.kind,
            "effects": list(case.effects),
            "equivalents": _fair_answers(case),
            "form": case.form,
            "sizes": list(case.sizes),
            "sizes_reached": [given.sized.size for given in self._given],
            "joint_size": self._joint_size,
            "noise_floor_deg": self._floor_deg,
            "protocol": case.protocol,
            "model": case.model,
            "exclude": list(case.exclude),
            "seed": case.seed,
            "core": asdict(self.core),
            "scatter": asdict(self.plan.specimen.scatter),
            "parameters": {
                given.effect: asdict(given.dose.make(given.sized.amplitude))  # type: ignore[call-overload]
                for given in self._given
            },
        }


def build(case: Case) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Make a case.

    Returns
    -------
    files : dict of str to bytes
        The campaign's folder.
    label : dict
        The truth about it.
    """
    built = BuiltCase(case)
    return built.campaign, built.label


def build_continuation(case: Case) -> dict[str, bytes]:
    """Make the campaign that continues a case's on the same specimen: trials nobody has seen.

    Its trials follow on the same bench after a pause and have a scatter of their own; it holds the
    earliest calibration and no other.
    """
    return BuiltCase(case).later


def _fair_answers(case: Case) -> list[str]:
    """List the effects that are a fair answer where the true one is not in the library."""
    fair: tuple[str, ...] = ()
    if case.kind == "alien":
        fair = ALIENS[case.effects[0]].equivalents
    elif case.kind == "withheld":
        fair = equivalents(case.effects[0])
    return list(fair)


def model_document(case: Case) -> dict[str, Any]:
    """Give the plain model of the case's bare core, as a model file holds it."""
    core = draw_core(_stream(case, "core"))
    return {
        "schema": "spa-fo/model/1",
        "campaign": "nominal",
        "material": "case",
        "transfer_function": asdict(core),
        "input": {"signal": "command", "reference_kpa": REFERENCE_KPA},
        "output": {"unit": "rad"},
        "effects": [],
    }


def draw_salt(case: Case) -> str:
    """Draw what keeps a sealed label from being guessed: 128 bits in hexadecimal."""
    return _stream(case, "salt").bytes(16).hex()


def draw_core(rng: np.random.Generator) -> FractionalCore:
    """Draw a core near one of the two actuators': every coefficient within 5 % of its own."""
    core = (DRAGON_SKIN_20_CORE, FX_PRO_CORE)[int(rng.integers(2))]
    return ParameterShift(*rng.uniform(0.95, 1.05, 5).tolist()).shifted(core)


def _stream(case: Case, name: str) -> np.random.Generator:
    """Open the random stream of one thing that is drawn."""
    key = zlib.crc32(name.encode())
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(case.seed, spawn_key=(key,))))


def _draw_scatter(rng: np.random.Generator) -> Scatter:
    return Scatter(
        gain=rng.uniform(0.003, 0.01),
        offset_deg=rng.uniform(0.1, 0.3),
        pace=rng.uniform(0.003, 0.01),
    )


def plan_campaign(case: Case) -> CampaignPlan:
    """Plan the campaign of a case, its specimen without any effect."""
    core = draw_core(_stream(case, "core"))
    rng = _stream(case, "campaign")
    rich = case.protocol == "rich"
    return CampaignPlan(
        name=case.name,
        material="case",
        specimen=Specimen(
            SyringePump(),
            SoftActuator(core, REFERENCE_KPA),
            scatter=_draw_scatter(_stream(case, "scatter")),
        ),
        experiments=_rich_experiments(core) if rich else _up_steps(core),
        order=_shuffled(_RICH_TRIALS, rng) if rich else _paper_order(rng),
        damage=Damage(flipped=2, cut=1, lost=1),
        clock_error_ppm=round(rng.uniform(-60.0, 60.0), 1),
        post_calibration=rich,
        source="virtual rig",
    )


def _rich_experiments(core: FractionalCore) -> tuple[Experiment, ...]:
    """List experiments that together take less than eight minutes of log."""
    sixty = pressure_for(core, 60.0)
    levels = [round(sixty * share, 2) for share in _STAIRS]
    return (
        Experiment("step_30", 30.0, step_release(pressure_for(core, 30.0))),
        Experiment("step_60", 60.0, step_release(sixty)),
        Experiment("staircase", None, staircase(levels, dwell_s=3.5, release_s=4.0)),
        Experiment("triangle", None, triangle(sixty, ramp_s=6.0, release_s=3.5)),
        Experiment("hold_45", 45.0, hold(pressure_for(core, 45.0), up_s=40.0, release_s=10.0)),
    )


def _up_steps(core: FractionalCore) -> tuple[Experiment, ...]:
    return tuple(
        Experiment(f"step_{angle}", float(angle), step(pressure_for(core, angle)))
        for angle in (30, 60)
    )


def plan_continuation(case: Case, plan: CampaignPlan) -> CampaignPlan:
    """Plan what comes after: levels and protocols that the case's campaign does not hold."""
    core = draw_core(_stream(case, "core"))
    rng = _stream(case, "later")
    last = schedule(plan, case.seed)[-1]
    pause_s = rng.uniform(900.0, 1500.0)
    trials = {"step_45": 2, "triangle_50": 2, "free_1": 1, "free_2": 1}
    return replace(
        plan,
        name=f"{case.name}_later",
        continues=case.name,
        first_order=last.order + 1,
        first_s=round(last.started_s + last.experiment.profile.duration_s + pause_s, 1),
        post_calibration=False,
        damage=Damage(flipped=1),
        experiments=(
            Experiment("step_45", 45.0, step_release(pressure_for(core, 45.0))),
            Experiment("triangle_50", None, triangle(pressure_for(core, 50.0), ramp_s=5.0)),
            _at_random("free_1", core, rng),
            _at_random("free_2", core, rng),
        ),
        order=_shuffled(trials, rng),
    )


def _at_random(name: str, core: FractionalCore, rng: np.random.Generator) -> Experiment:
    """Hold six levels drawn at random between 8° and 60°."""
    levels = [pressure_for(core, angle) for angle in rng.uniform(8.0, 60.0, 6).tolist()]
    return Experiment(name, None, plateaus("free", levels, 1.5, 3.5, release_s=4.0))


def _shuffled(trials: Mapping[str, int], rng: np.random.Generator) -> tuple[str, ...]:
    names = [name for name, count in trials.items() for _ in range(count)]
    return tuple(names[i] for i in rng.permutation(len(names)))


def _paper_order(rng: np.random.Generator) -> tuple[str, ...]:
    """Half of the campaigns all of one setpoint first, half of them mixed."""
    if rng.random() < 0.5:
        return tuple(name for name, count in _UP_STEPS.items() for _ in range(count))
    return _shuffled(_UP_STEPS, rng)
