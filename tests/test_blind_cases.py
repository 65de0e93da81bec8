"""Fair answers of the blind benchmark where the true effect is missing from the library."""

from __future__ import annotations

import pytest

from blind.equivalents import CONFOUNDED, IN_SERIES, REASONS, confounded, equivalents
from blind.first_rig import EFFECTS, FOREIGN
from spa_fo.plant.effects.library import IDS


def test_equivalents_are_effects_of_the_library_and_have_reasons():
    named = set().union(*CONFOUNDED)
    assert named == set(REASONS)
    assert named <= set(EFFECTS)
    for one in EFFECTS:
        for other in equivalents(one):
            assert one != other
            assert confounded(one, other)
            assert one in equivalents(other)
    assert {name for fair in FOREIGN.values() for name in fair} <= set(IDS)


@pytest.mark.parametrize("effect", sorted(IN_SERIES))
def test_filters_in_series_are_one_where_no_pressure_was_measured(effect: str) -> None:
    assert set(equivalents(effect, pressure=False)) == IN_SERIES - {effect}
    assert set(equivalents(effect)) < IN_SERIES
    assert equivalents("creep", pressure=False) == equivalents("creep")
