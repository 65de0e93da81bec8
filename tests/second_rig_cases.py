"""One campaign's ruler, and the forms an effect is drawn in, for the second rig's tests."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from blind.second_rig.bench import draw_bench, make_plan, scene_of
from blind.second_rig.effect import Effect, Scene
from blind.second_rig.protocols import experiments
from blind.second_rig.sizes import Ruler
from naive_second_rig import document


@cache
def ruler(name: str = "rich") -> Ruler:
    asked = document()
    surroundings = asked["surroundings"]
    tried = experiments(name, 1, np.random.default_rng(3))
    shares = make_plan(
        tried, "interleaved", 0.0, surroundings["sampling"], np.random.default_rng(4)
    )
    bench, plan = draw_bench(surroundings, shares, 65.0, np.random.default_rng(5))
    return Ruler(bench, plan, scene_of(bench, plan, 65.0))


def forms(draw: Callable[[np.random.Generator, Scene], Effect]) -> list[Effect]:
    drawn = [draw(np.random.default_rng(k), ruler().scene) for k in range(10)]
    return list({effect.form: effect for effect in drawn}.values())
