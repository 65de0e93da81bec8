"""From an answer to a model: what is known and what is missed, fitted once more to all trials."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.gap.claim.claimed import exact
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.data.hold_out import HeldOut
from spa_fo.gap.decide.explanation import Explanation, augmented_model, explanation_of
from spa_fo.gap.decide.verdict import Scored
from spa_fo.gap.diagnosis import LawFound
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.places.missing import law_of_all
from spa_fo.gap.search.drive import Drive
from spa_fo.gap.search.explanations import Explanations
from spa_fo.plant import Model
from spa_fo.plant.augmented import ending_memory
from spa_fo.plant.law import Law


def on_all_trials(
    scored: Scored,
    found: Explanations,
    drive: Drive | None,
    everything: Evidence,
    held: HeldOut,
) -> Explanation:
    """Fit a set once more, to all trials."""
    known = exact(scored, found, drive, found.bench)
    if not held.trials.any():
        return known
    bench = bench_of_all(found, everything, held)
    again = exact(replace(scored, angle=known.angle), found, drive, bench)
    return explanation_of(scored, again.angle, known.drive)


def bench_of_all(found: Explanations, everything: Evidence, held: HeldOut) -> Bench:
    """Make all trials ready."""
    if not held.trials.any():
        return found.bench
    bench = found.bench.without(np.zeros_like(held.trials))
    y = found.plain.predicted_deg
    return bench.with_gap(everything.grid.angle_deg - y, y)


def model_of(
    known: Explanation | None,
    law: LawFound | None,
    found: Explanations,
    everything: Evidence,
    held: HeldOut,
    plain: Model,
) -> Model:
    """Write what is known, and a law that is worth it, as a model that `predict` runs.

    Parameters
    ----------
    known : Explanation or None
        The part that has a name, fitted to all trials.
    law : LawFound or None
        A law that the model is to carry.
    found, everything, held
        The fits, the campaign, and its trials that took no part.
    plain : Model
        What is returned where there is neither.
    """
    if law is not None:
        bench = bench_of_all(found, everything, held)
        with suppress(ValueError, BadInput):  # too steep for the steps that a prediction takes
            beside, fit = law_of_all(bench, known or Explanation((), found.plain, None, None), law)
            return _written(augmented_model(beside, everything, plain), everything, fit.law)
    if known is None:
        return plain
    return _written(augmented_model(known, everything, plain), everything)


def _written(model: Model, everything: Evidence, law: Law | None = None) -> Model:
    """Let a model carry a law, and what the specimen remembers at the end."""
    if law is not None:
        model = replace(model, effects=(*model.effects, law.to_effect()))
    memory = ending_memory(model, everything.data)
    return replace(model, extra={**model.extra, "memory": memory})
