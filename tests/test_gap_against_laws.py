"""An answer held against laws that have no name."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from spa_fo.gap.claim import against_laws as module
from spa_fo.gap.claim.against_laws import against_laws, alone_if_rare
from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.verdict import Scored, Verdict, judge
from spa_fo.gap.fit.bench import SHARES
from spa_fo.gap.fit.coefficients import usual
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.law import PLACES
from spa_fo.plant.paper import TABLE_I

Ids = tuple[str, ...]
NATS = 1000.0
BENCH = SimpleNamespace(coefficients=usual(TABLE_I["design_1"].as_array(), 6.0), centre=None)
EXAMINED = cast(
    Examined,
    SimpleNamespace(
        drive=None,
        found=SimpleNamespace(bench=BENCH, plain=None),
        everything=SimpleNamespace(data=SimpleNamespace(trials=())),
    ),
)


def logs(nats: float, shares: int = len(SHARES)) -> np.ndarray:
    """Log evidence that no share makes larger."""
    return nats - 200.0 * np.arange(shares)


def answer(named: Ids, probability: float = 0.9) -> Verdict:
    angle = cast(Any, SimpleNamespace(ids=named, logs=logs(NATS)))
    moved = dict.fromkeys(named, 1.0)
    none = Scored((), 0.02, cast(Any, None), None, None, {}, 0.0)
    return judge(
        [Scored(named, probability, angle, None, None, moved, 0.0), none], 0.98 - probability, 0.0
    )


@pytest.fixture
def laws(monkeypatch: pytest.MonkeyPatch) -> Any:
    def of(*nats: float, place: str = "moment") -> None:
        basis = SimpleNamespace(place=place)
        fits = [SimpleNamespace(basis=basis, logs=np.append(0.0, logs(each))) for each in nats]

        def fitted(bench: Any, base: Any, least: float, apart: Sequence[str]) -> list[Any]:
            return [fit for fit in fits if fit.basis.place not in apart]

        monkeypatch.setattr(module, "fitted_laws", fitted)

    return of


def test_a_law_that_does_as_well_as_an_effect_is_no_rival(laws: Any) -> None:
    laws(NATS, NATS - 500.0, NATS - 500.0)
    verdict = answer(("creep",))
    held = against_laws(verdict, EXAMINED)
    assert (held.kind, held.sets) == ("cause", (("creep",),))
    # It is one of three places, and an unknown cause.
    times = SETTINGS.unknown / 3.0
    assert held.unknown == pytest.approx((verdict.unknown + 0.9 * times) / (1.0 + 0.9 * times))
    total = sum(s.probability for s in held.scored) + held.unknown
    assert total == pytest.approx(1.0)


def test_one_law_in_the_place_of_three_effects_is_an_unknown_cause(laws: Any) -> None:
    laws(NATS)
    named = ("stiffening", "gravity_load", "sensor_nonlinearity")
    assert against_laws(answer(named), EXAMINED).kind == "unknown"
    laws(NATS - 40.0 / SETTINGS.temper)
    assert against_laws(answer(named), EXAMINED).kind == "cause"


def test_what_a_law_does_far_better_is_not_known(laws: Any) -> None:
    laws(NATS + 10.0 / SETTINGS.temper)
    held = against_laws(answer(("creep",)), EXAMINED)
    assert held.kind == "unknown"
    assert held.unknown > 0.99


def test_every_effect_is_at_a_place_where_laws_are() -> None:
    assert {effect.place for effect in LIBRARY.values()} <= {"", *PLACES}


def test_a_law_at_the_place_of_an_effect_is_that_effect_in_another_form(laws: Any) -> None:
    laws(NATS + 10.0 / SETTINGS.temper, place="moment")
    verdict = answer(("stiffening",))
    assert against_laws(verdict, EXAMINED) == verdict
    # Beside a law the coefficients are free, as they are beside a shift.
    shifted = answer(("stiffening", "parameter_shift"))
    assert against_laws(shifted, EXAMINED) == shifted
    assert against_laws(answer(("sensor_saturation",)), EXAMINED).kind == "unknown"
    assert against_laws(answer(("stiffening", "gravity_load")), EXAMINED).kind == "unknown"


def test_what_goes_with_the_order_of_the_trials_may_be_their_scatter(laws: Any) -> None:
    laws(NATS + 10.0 / SETTINGS.temper, place="trial_rest")
    verdict = answer(("creep",))
    assert against_laws(verdict, EXAMINED) == verdict


def test_between_two_campaigns_what_is_rare_is_a_cause_by_itself() -> None:
    alone = answer(("opening_fold",))
    assert alone_if_rare(alone) == alone
    held = alone_if_rare(answer(("creep", "opening_fold")))
    assert (held.kind, held.sets) == ("unknown", (("creep", "opening_fold"),))
    both = answer(("creep", "leak"))
    assert alone_if_rare(both) == both


@pytest.mark.parametrize("kind", ["no_gap", "unknown"])
def test_what_has_no_name_is_left_as_it_is(kind: str, laws: Any) -> None:
    laws(NATS + 100.0)
    verdict = answer(("creep",), 0.0 if kind == "no_gap" else 0.1)
    if kind == "no_gap":
        none = [s for s in verdict.scored if not s.named]
        verdict = judge(none, 0.0, 0.0)
    assert verdict.kind == kind
    assert against_laws(verdict, EXAMINED) == verdict
