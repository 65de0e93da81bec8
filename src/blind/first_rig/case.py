"""One case: everything drawn, effects solved for their sizes, files written, the truth told.

What is handed out (`campaign`, `later`, `earlier`, the plain model) says nothing of the cause.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from blind.first_rig.asked import Asked, read_document
from blind.first_rig.campaign import Plan, Recorder
from blind.first_rig.doses import Dose, draw_dose
from blind.first_rig.logs import LogFormat, SpaRigFormat, draw_board_format, draw_trial_format
from blind.first_rig.programme import draw_earlier, draw_later, draw_programme, draw_top_deg
from blind.first_rig.sizing import Scale, Sized, with_core
from spa_fo.atomic import write_text
from spa_fo.virtual_rig.actuator import FractionalCore, ParameterShift, SoftActuator
from spa_fo.virtual_rig.actuators import (
    DRAGON_SKIN_20_CORE,
    FX_PRO_CORE,
    REFERENCE_KPA,
    pressure_for,
)
from spa_fo.virtual_rig.bench import Specimen
from spa_fo.virtual_rig.campaign_writer import write_folder
from spa_fo.virtual_rig.flex_sensor import DividerCurve, FlexSensor
from spa_fo.virtual_rig.syringe_pump import SyringePump

_BOW = (-0.05, -0.01)  # a film that even three angles calibrate to about 0.2°
_PAUSE_S = (200.0, 600.0)  # before the campaign that follows
_ORDER_ERROR = 0.2  # orders are known so much better than the other coefficients


def write_case(document: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Make the case that a document asks for.

    Parameters
    ----------
    document : mapping
        As src/blind/CASE.md says.
    folder : Path
        Where ``campaign``, ``later``, ``earlier`` and ``model.json`` are put.

    Returns
    -------
    dict
        The truth, plain data.

    Raises
    ------
    ValueError
        The document asks for something that the interface or this rig does not know.
    BadInput
        One of the folders exists already, or cannot be written.
    """
    case = Case(read_document(document))
    for name, files in case.campaigns().items():
        write_folder(files, folder / name)
    if case.asked.model == "off":
        write_text(folder / "model.json", json.dumps(case.model_document(), indent=2) + "\n")
    return case.truth()


@dataclass(frozen=True)
class _Given:
    """An effect as a case has it."""

    effect: str
    dose: Dose
    sized: Sized


class Case:
    """A case with everything drawn and solved; its files are made when they are asked for.

    Parameters
    ----------
    asked : Asked
        What is asked.
    """

    def __init__(self, asked: Asked) -> None:
        self.asked = asked
        self.bare = draw_specimen(asked)
        self.plan = Plan(asked, "campaign", draw_programme(asked, self.core))
        self._form = "ab"[int(asked.stream("form").integers(2))]

    @property
    def core(self) -> FractionalCore:
        """The specimen's own, whatever it suffers from."""
        return self.bare.actuator.core

    @property
    def specimen(self) -> Specimen:
        """The specimen with its effects."""
        return self._affected[0]

    @cached_property
    def _scale(self) -> Scale:
        return Scale(self.bare, self.plan, self.later())

    @cached_property
    def _affected(self) -> tuple[Specimen, tuple[_Given, ...]]:
        """Give the specimen its effects, each in its size."""
        specimen = self.bare
        given: list[_Given] = []
        trials = len(self.plan.programme.order)
        for effect, size in zip(self.asked.effects, self.asked.sizes, strict=True):
            dose = draw_dose(effect, self._form, self.asked.stream(effect), trials)
            sized = self._scale.amplitude_for(dose, size, specimen if given else None)
            given.append(_Given(effect, dose, sized))
            specimen = dose.given_to(specimen, sized.amplitude)
        return specimen, tuple(given)

    def campaigns(self) -> dict[str, dict[str, bytes]]:
        """Every file of every campaign, by folder and relative name."""
        recorder = Recorder(self.plan, self.specimen, *self.formats())
        campaigns = {plan.folder: recorder.run(plan) for plan in (self.plan, self.later())}
        if self.asked.model == "earlier":
            plan = Plan(self.asked, "earlier", draw_earlier(self.asked, self.core))
            campaigns[plan.folder] = Recorder(plan, self.bare, *self.formats()).run(plan)
        return campaigns

    def later(self) -> Plan:
        """Plan what follows, after a pause, on the same bench."""
        pause_s = self.asked.stream("pause").uniform(*_PAUSE_S)
        return Plan(
            self.asked,
            "later",
            draw_later(self.asked, self.core),
            continues=self.asked.name,
            first_order=len(self.plan.programme.order) + 1,
            first_s=round(self.plan.free_s() + pause_s, 1),
        )

    def formats(self) -> tuple[SpaRigFormat, LogFormat]:
        """How calibrations and trials are written, in all campaigns of the case."""
        largest_kpa = pressure_for(self.core, draw_top_deg(self.asked))
        board = draw_board_format(self.asked, largest_kpa)
        return board, draw_trial_format(self.asked, board)

    def model_core(self) -> FractionalCore:
        """Give the core of the model that is handed out: each coefficient wrong by its error."""
        signs = self.asked.stream("model").choice([-1.0, 1.0], 5)
        errors = self.asked.off * signs * [_ORDER_ERROR, _ORDER_ERROR, 1.0, 1.0, 1.0]
        return ParameterShift(*(1.0 + errors).tolist()).shifted(self.core)

    def model_document(self) -> dict[str, Any]:
        """Give that model as a model file holds it."""
        return {
            "schema": "spa-fo/model/1",
            "campaign": "given",
            "material": "case",
            "transfer_function": asdict(self.model_core()),
            "input": {"signal": "command", "reference_kpa": REFERENCE_KPA},
            "output": {"unit": "rad"},
            "effects": [],
        }

    def truth(self) -> dict[str, Any]:
        """Tell everything, for whoever opens the seal."""
        specimen, effects = self._affected
        parameters = {
            given.effect: asdict(given.dose.make(given.sized.amplitude))  # type: ignore[call-overload]
            for given in effects
        }
        joint = self._scale.weigh(specimen)[0] if len(effects) > 1 else None
        return {
            "noise_floor_deg": self._scale.floor_deg,
            "sizes_reached": [given.sized.size for given in effects],
            "joint_size": joint,
            "model_error_deg": self._model_error_deg() if self.asked.model == "off" else None,
            "form": {"no_effect": "none", "alien": "own"}.get(self.asked.kind, self._form),
            "parameters": json.loads(json.dumps(parameters)),  # lists rather than tuples
            "core": asdict(self.core),
            "protocol": self.plan.programme.describe(),
        }

    def _model_error_deg(self) -> float:
        """RMS by which the given model differs from the bare core in the campaign."""
        size, _ = self._scale.weigh(with_core(self.bare, self.model_core()))
        return size * self._scale.floor_deg


def draw_specimen(asked: Asked) -> Specimen:
    """Draw a specimen without any effect: its core near one of the two actuators', its film."""
    bow = asked.stream("film").uniform(*_BOW)
    return Specimen(
        SyringePump(),
        SoftActuator(draw_core(asked.stream("core")), REFERENCE_KPA),
        FlexSensor(DividerCurve(bow=bow)),
        scatter=asked.surroundings.scatter,
    )


def draw_core(rng: np.random.Generator) -> FractionalCore:
    """Draw a core near one of the two actuators': every coefficient within 5 % of its own."""
    core = (DRAGON_SKIN_20_CORE, FX_PRO_CORE)[int(rng.integers(2))]
    return ParameterShift(*rng.uniform(0.95, 1.05, 5).tolist()).shifted(core)
