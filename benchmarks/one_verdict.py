"""The verdict on one case with other numbers than `spa_fo.gap.settings` has, as JSON on stdout.

    python benchmarks/one_verdict.py CASE --models FOLDER --set temper=0.3
    python benchmarks/one_verdict.py CASE --models FOLDER --redecide least=0.03 least=0.12

The first fits all explanations with the other number; the second fits them as they are, and
decides anew with each. A process of its own, for some numbers are read while modules are imported.
`settings_sweep.py` runs it for every number and many cases.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

SEED = 1
Said = tuple[str, list[list[str]]]  # the kind, and the sets named


def load_settings() -> Any:
    """Import the settings before the package that they are in, whose modules read them."""
    name = "spa_fo.gap.settings"
    package = importlib.util.find_spec("spa_fo")
    assert package is not None
    assert package.submodule_search_locations
    path = Path(package.submodule_search_locations[0]) / "gap" / "settings.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.SETTINGS


def put(settings: Any, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        getattr(settings, name)
        # Frozen for the package; who asks what another number would do has to change it.
        object.__setattr__(settings, name, value)


def decider(case: Path, models: Path) -> Callable[[], Said]:
    """Fit all explanations of a case; return what decides, by the settings of that moment."""
    import numba
    import numpy as np

    from blind.judge.realised import campaign_data, judged_model
    from spa_fo.gap.claim.claimed import Claim, claim
    from spa_fo.gap.decide.examine import examine
    from spa_fo.gap.decide.weigh import decide
    from spa_fo.gap.diagnose import held_against_trials
    from spa_fo.gap.noise.interference import NONE, fast_line
    from spa_fo.plant import read_model
    from spa_fo.plant.effects.library import at_port

    numba.set_num_threads(1)
    models.mkdir(parents=True, exist_ok=True)
    plain = read_model(judged_model(case, models, SEED))
    excluded = (case / "exclude.txt").read_text(encoding="ascii").split()
    rng = np.random.default_rng(SEED)
    e = examine(campaign_data(case / "campaign"), plain, excluded, rng)
    evidence = replace(e.everything, takes_part=~e.held.trials)
    fast = NONE if at_port("line") in e.excluded else fast_line(evidence)
    known: list[Claim] = []  # with all that is closed by the sets asked of so far

    def said() -> Said:
        verdict = decide(e.found, e.drive, fast, evidence, e.floor_deg)
        if not known or not set(verdict.sets) <= set(known[0].closed):
            new = claim(e, verdict, rng)
            before = known.pop() if known else new
            closed = dict.fromkeys(verdict.sets, 0.0) | before.closed | new.closed
            unsure = before.unsure | new.unsure
            by_chance = before.by_chance | new.by_chance
            both = replace(new, closed=closed, unsure=unsure, by_chance=by_chance)
            known.append(both)
        verdict = held_against_trials(replace(e, verdict=verdict), known[0])
        return verdict.kind, [list(names) for names in verdict.sets]

    return said


def value_of(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    return name, float(value)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", type=Path, help="folder of a case of the blind benchmark")
    parser.add_argument("--models", type=Path, required=True, help="gets its model if it has none")
    parser.add_argument("--set", type=value_of, nargs="*", default=[], metavar="NAME=VALUE")
    parser.add_argument("--redecide", type=value_of, nargs="*", default=[], metavar="NAME=VALUE")
    given = parser.parse_args(arguments)
    settings = load_settings()
    put(settings, dict(given.set))
    said = decider(given.case, given.models)
    answer = {"said": said(), "redecided": []}
    for name, value in given.redecide:
        before = getattr(settings, name)
        put(settings, {name: value})
        answer["redecided"].append((name, value, said()))
        put(settings, {name: before})
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
