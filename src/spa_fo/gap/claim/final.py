"""From an answer to a model: what is known and what is missed, fitted once more to all trials."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.explanation import (
    Explanation,
    angle_part,
    augmented_model,
    explanation_of,
)
from spa_fo.gap.decide.verdict import Scored
from spa_fo.gap.diagnosis import LawFound
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.places.laws import law_at
from spa_fo.gap.search.fitted import fit, without_others
from spa_fo.plant import Model
from spa_fo.plant.augmented import ending_memory
from spa_fo.plant.effects.library import LIBRARY


def exact(scored: Scored, examined: Examined, bench: Bench | None = None) -> Explanation:
    """Fit just the effects that a set names, to the trials of a bench or those that took part."""
    found, drive = examined.found, examined.drive
    own = pressed = None
    if drive is not None:
        ids = tuple(n for n in scored.named if LIBRARY[n].stage == "drive")
        own, pressed = drive.best, drive.fits.get(ids) if ids else None
    ids = angle_part(scored.named, own, scored.fast is not None)
    known = found.fits.get(ids)
    if known is None or bench is not None:
        start = without_others(scored.angle, ids) if known is None else known.z
        known = fit(bench or found.bench, ids, [start], found.plain)
    return explanation_of(scored, known, pressed)


def on_all_trials(scored: Scored, examined: Examined) -> Explanation:
    """Fit a set once more, to all trials; its drive stays as it is."""
    known = exact(scored, examined)
    if not examined.held.trials.any():
        return known
    return exact(replace(scored, angle=known.angle), examined, _bench_of_all(examined))


def model_of(
    known: Explanation | None, law: LawFound | None, examined: Examined, plain: Model
) -> Model:
    """Write what is known of all trials, and a law worth it, as a model that `predict` runs.

    Where there is neither it is the plain model.
    """
    if law is not None:
        beside = known or Explanation((), examined.found.plain, None, None)
        with suppress(ValueError, BadInput):  # too steep for the steps that a prediction takes
            again = law_at(_bench_of_all(examined), beside.angle, law.place)
            model = augmented_model(replace(beside, angle=again.beside), examined.everything, plain)
            model = replace(model, effects=(*model.effects, again.law.to_effect()))
            return _remembering(model, examined)
    if known is None:
        return plain
    return _remembering(augmented_model(known, examined.everything, plain), examined)


def _bench_of_all(examined: Examined) -> Bench:
    """Make all trials ready."""
    found, trials = examined.found, examined.held.trials
    if not trials.any():
        return found.bench
    y = found.plain.predicted_deg
    gap = examined.everything.grid.angle_deg - y
    return found.bench.without(np.zeros_like(trials)).with_gap(gap, y)


def _remembering(model: Model, examined: Examined) -> Model:
    """Let a model say what the specimen remembers at the end."""
    memory = ending_memory(model, examined.everything.data)
    return replace(model, extra={**model.extra, "memory": memory})
