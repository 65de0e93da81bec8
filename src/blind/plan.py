"""Which cases a blind benchmark has, from a small table of counts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from blind.equivalents import confounded
from blind.first_rig.build import PROTOCOLS, Case
from blind.first_rig.doses import FORMS
from blind.first_rig.foreign_effects import ALIENS
from spa_fo.errors import BadInput

_PAIR_SIZES = (2.0, 8.0)


@dataclass(frozen=True)
class Counts:
    """How often something is tried, by protocol; at each of some sizes where it has one."""

    rich: int = 0
    up_steps: int = 0
    sizes: tuple[float, ...] = (4.0,)


@dataclass(frozen=True)
class BenchmarkPlan:
    """Size of a benchmark.

    Parameters
    ----------
    seed : int
        Decides everything; another seed gives other cases.
    forms : tuple of str
        Functional forms the effects take, each as often as the other.
    every_form : bool
        Whether each effect and size is tried in every form; else the forms take turns.
    closed, withheld : Counts
        Cases of each effect of the library in each form and size, held by the library or withheld.
    alien : Counts
        Cases of each alien effect and size.
    no_effect, pair : Counts
        Cases in all; pairs draw their own sizes between 2 and 8.
    own_fit : float
        Share of the cases whose model has to be identified on their own campaign.
    """

    seed: int = 1
    forms: tuple[str, ...] = ("a", "b")
    every_form: bool = True
    closed: Counts = field(default_factory=Counts)
    no_effect: Counts = field(default_factory=Counts)
    withheld: Counts = field(default_factory=Counts)
    alien: Counts = field(default_factory=Counts)
    pair: Counts = field(default_factory=Counts)
    own_fit: float = 0.0


def read_plan(path: Path) -> BenchmarkPlan:
    """Read a plan from a YAML file.

    Raises
    ------
    BadInput
        The file cannot be read, or is not a plan.
    """
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(path, f"cannot be read: {error.strerror or error}") from error
    except yaml.YAMLError as error:
        raise BadInput(path, f"is no YAML: {error}") from error
    try:
        return benchmark_plan(document)
    except ValueError as error:
        raise BadInput(path, str(error)) from error


def benchmark_plan(document: Mapping[str, Any]) -> BenchmarkPlan:
    """Check a plan given as plain dicts, lists and numbers.

    Raises
    ------
    ValueError
        A key is unknown or a value is of the wrong kind; the text names it.
    """
    _refuse_unknown(document, BenchmarkPlan, "")
    values: dict[str, Any] = {}
    for key, value in document.items():
        if key == "seed":
            values[key] = _whole(value, key)
        elif key == "forms":
            values[key] = tuple(value)
            if not values[key] or not set(values[key]) <= set(FORMS):
                raise ValueError(f"forms: expected some of {', '.join(FORMS)}")
        elif key == "every_form":
            if not isinstance(value, bool):
                raise ValueError("every_form: expected true or false")
            values[key] = value
        elif key == "own_fit":
            if not isinstance(value, int | float) or not 0 <= value <= 1:
                raise ValueError("own_fit: expected a number from 0 to 1")
            values[key] = float(value)
        else:
            values[key] = _counts(value, key)
    return BenchmarkPlan(**values)


def _counts(document: Any, where: str) -> Counts:
    _refuse_unknown(document, Counts, f"{where}.")
    values: dict[str, Any] = {
        key: _whole(document[key], f"{where}.{key}") for key in PROTOCOLS if key in document
    }
    if "sizes" in document:
        sizes = document["sizes"]
        if not isinstance(sizes, list) or not all(
            isinstance(size, int | float) and size > 0 for size in sizes
        ):
            raise ValueError(f"{where}.sizes: expected a list of positive numbers")
        values["sizes"] = tuple(float(size) for size in sizes)
    return Counts(**values)


def _refuse_unknown(document: Any, kind: type[BenchmarkPlan | Counts], where: str) -> None:
    if not isinstance(document, Mapping):
        raise ValueError(f"{where.rstrip('.') or 'plan'}: expected keys and values")
    known = [entry.name for entry in fields(kind)]
    for key in document:
        if key not in known:
            raise ValueError(f"{where}{key}: expected one of {', '.join(known)}")


def _whole(value: Any, where: str) -> int:
    if not isinstance(value, int) or value < 0:
        raise ValueError(f"{where}: expected a whole number that is not negative")
    return value


def plan_cases(plan: BenchmarkPlan | Mapping[str, Any]) -> list[Case]:
    """List the cases of a benchmark, numbered in an order that says nothing of them.

    Parameters
    ----------
    plan : BenchmarkPlan or mapping
        Its size; a mapping is checked as by `benchmark_plan`.
    """
    if not isinstance(plan, BenchmarkPlan):
        plan = benchmark_plan(plan)
    rng = np.random.default_rng(plan.seed)
    cases = list(_unnamed(plan, rng))
    seeds = rng.choice(2**32, size=len(cases), replace=False).tolist()
    own_fit = rng.random(len(cases)) < plan.own_fit
    named: list[Case] = []
    for number, i in enumerate(rng.permutation(len(cases)).tolist(), start=1):
        # Identified on its own campaign another specimen is no gap at all.
        own = own_fit[i] and "parameter_shift" not in cases[i].effects
        model = "own_fit" if own else "nominal"
        named.append(replace(cases[i], name=f"case_{number:04d}", seed=seeds[i], model=model))
    return named


def _unnamed(plan: BenchmarkPlan, rng: np.random.Generator) -> Iterator[Case]:
    blank = Case(name="", seed=0)
    for protocol in PROTOCOLS:
        for _ in range(getattr(plan.no_effect, protocol)):
            yield replace(blank, protocol=protocol)
        for kind, counts in (("closed", plan.closed), ("withheld", plan.withheld)):
            of_each = range(getattr(counts, protocol))
            for turn, (size, _) in enumerate(product(counts.sizes, of_each)):
                for effect, form in _effects(plan, turn):
                    exclude = (effect,) if kind == "withheld" else ()
                    yield Case("", 0, kind, (effect,), form, (size,), protocol, exclude=exclude)
        for size, _ in product(plan.alien.sizes, range(getattr(plan.alien, protocol))):
            for name, alien in ALIENS.items():
                if alien.up_steps or protocol != "up_steps":
                    yield Case("", 0, "alien", (name,), "a", (size,), protocol)
        for i in range(getattr(plan.pair, protocol)):
            form = plan.forms[i % len(plan.forms)]
            effects = _draw_pair(form, rng)
            low, high = np.log(_PAIR_SIZES)
            first, second = np.exp(rng.uniform(low, high, 2)).tolist()
            yield Case("", 0, "pair", effects, form, (first, second), protocol)


def _effects(plan: BenchmarkPlan, turn: int) -> Iterator[tuple[str, str]]:
    """List every effect with the forms it takes this time."""
    for number, effect in enumerate(FORMS[plan.forms[0]]):
        if plan.every_form:
            for form in plan.forms:
                yield effect, form
        else:
            yield effect, plan.forms[(number + turn) % len(plan.forms)]


def _draw_pair(form: str, rng: np.random.Generator) -> tuple[str, str]:
    """Draw two effects that can be told apart; a shifted specimen goes with any other anyhow."""
    names = [name for name in FORMS[form] if name != "parameter_shift"]
    while True:
        one, other = rng.choice(names, size=2, replace=False).tolist()
        if not confounded(one, other):
            return one, other
