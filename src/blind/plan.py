"""Which cases a blind benchmark has: a few counts, and everything else drawn.

The cases of every rig have the same make-up and surroundings of their own. Each list begins with a
cross-section of itself, so that a part of a benchmark has all kinds, all effects and all sizes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import combinations
from typing import Any

import numpy as np

from blind.equivalents import confounded
from blind.rigs import RIGS, further_of, rig_named
from blind.surroundings import PROTOCOL_NAMES, RICH, draw_model, draw_protocol, draw_surroundings

SCHEMA = "spa-fo/blind-case/1"
KINDS = ("no_effect", "closed", "withheld", "alien", "pair", "several")

_TOGETHER = (2.0, 8.0)  # sizes of effects that act together, each alone
_SEVERAL = (3, 5)  # so many of them
_POOR = tuple(name for name in PROTOCOL_NAMES if name not in RICH)
_SHIFT = "parameter_shift"


@dataclass(frozen=True)
class Case:
    """One case: which rig makes it, what that is asked, and what the library is to lack."""

    rig: str
    asked: Mapping[str, Any]
    exclude: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Its folder."""
        return str(self.asked["name"])


@dataclass(frozen=True)
class BenchmarkPlan:
    """Size of a benchmark; the counts are those of one rig.

    Parameters
    ----------
    seed : int
        Decides everything; another seed gives other cases.
    rigs : tuple of str
        Names of the rigs that make them.
    part : float
        Share of each kind's cases that is made, from the start of its list; at least one of each.
    no_effect, pair, several : int
        Cases without any effect, on every protocol; with two, and with three to five, of 2 to 8
        floors each, on rich ones.
    closed : tuple of float
        Sizes at which each effect of the library is tried on a rich protocol.
    other : tuple of float
        The same on the other protocols.
    withheld : tuple of float
        Sizes among which each effect, taken out of the library, has one on a rich protocol.
    alien : tuple of float
        Sizes among which each foreign effect has one on a rich protocol.
    further : tuple of float
        Sizes at which each effect beyond the contract's is tried on a rich protocol, by a rig that
        can make some.
    """

    seed: int = 1
    rigs: tuple[str, ...] = tuple(RIGS)
    part: float = 1.0
    no_effect: int = 0
    closed: tuple[float, ...] = ()
    other: tuple[float, ...] = ()
    withheld: tuple[float, ...] = ()
    alien: tuple[float, ...] = ()
    pair: int = 0
    several: int = 0
    further: tuple[float, ...] = ()


def benchmark_plan(document: Mapping[str, Any]) -> BenchmarkPlan:
    """Check a plan given as plain dicts, lists and numbers.

    Raises
    ------
    ValueError
        A key is unknown or a value is of the wrong kind; the text names it.
    """
    known = {entry.name: entry.type for entry in fields(BenchmarkPlan)}
    for key in document:
        if key not in known:
            raise ValueError(f"{key}: expected one of {', '.join(known)}")
    return BenchmarkPlan(**{key: _CHECKS[known[key]](key, document[key]) for key in document})


def _count(key: str, value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(f"{key}: expected a whole number that is not negative")
    return value


def _share(key: str, value: Any) -> float:
    if not isinstance(value, int | float) or not 0 < value <= 1:
        raise ValueError(f"{key}: expected a number above 0, 1 at most")
    return float(value)


def _sizes(key: str, value: Any) -> tuple[float, ...]:
    sizes = value.get("sizes") if isinstance(value, Mapping) and set(value) == {"sizes"} else None
    if not isinstance(sizes, list) or not all(
        isinstance(size, int | float) and size > 0 for size in sizes
    ):
        raise ValueError(f"{key}: expected sizes: and a list of positive numbers")
    return tuple(float(size) for size in sizes)


def _names(key: str, value: Any) -> tuple[str, ...]:
    if not isinstance(value, list) or not value or not set(value) <= set(RIGS):
        raise ValueError(f"{key}: expected some of {', '.join(RIGS)}")
    return tuple(value)


_CHECKS: Mapping[Any, Callable[[str, Any], Any]] = {
    "int": _count,
    "float": _share,
    "tuple[float, ...]": _sizes,
    "tuple[str, ...]": _names,
}


def plan_cases(plan: BenchmarkPlan | Mapping[str, Any]) -> list[Case]:
    """List the cases of a benchmark, numbered in an order that says nothing of them.

    Parameters
    ----------
    plan : BenchmarkPlan or mapping
        The mapping as `benchmark_plan` reads it.

    Raises
    ------
    ValueError
        As `benchmark_plan`.
    """
    if not isinstance(plan, BenchmarkPlan):
        plan = benchmark_plan(plan)
    cases = [case for rig in plan.rigs for case in _cases_of(plan, rig)]
    rng = np.random.default_rng([plan.seed, 0])
    seeds = rng.choice(2**31, size=len(cases), replace=False).tolist()
    order = rng.permutation(len(cases)).tolist()
    return [
        replace(cases[i], asked=_numbered(cases[i].asked, number, seeds[i]))
        for number, i in enumerate(order, start=1)
    ]


def _numbered(asked: Mapping[str, Any], number: int, seed: int) -> dict[str, Any]:
    return {"schema": SCHEMA, "name": f"case_{number:04d}", "seed": seed, **asked}


def _cases_of(plan: BenchmarkPlan, rig: str) -> Iterator[Case]:
    """List the cases of one rig, kind by kind."""
    lists: Mapping[str, Callable[[], Iterator[tuple[tuple[str, ...], tuple[float, ...]]]]] = {
        "no_effect": lambda: iter([((), ())] * plan.no_effect),
        "closed": lambda: _each(rig_named(rig).EFFECTS, plan.closed),
        "other": lambda: _each(rig_named(rig).EFFECTS, plan.other),
        "withheld": lambda: _one_each(rig_named(rig).EFFECTS, plan.withheld),
        "alien": lambda: _one_each(tuple(rig_named(rig).FOREIGN), plan.alien),
        "pair": lambda: _together(
            plan.pair, (2, 2), rig_named(rig).EFFECTS, _stream(plan, rig, "pairs")
        ),
        "several": lambda: _together(
            plan.several, _SEVERAL, rig_named(rig).EFFECTS, _stream(plan, rig, "several effects")
        ),
        "further": lambda: _each(further_of(rig_named(rig)), plan.further),
    }
    for name, make in lists.items():
        rng = _stream(plan, rig, name)
        among = {"no_effect": None, "other": _POOR}.get(name, RICH)
        kind = "closed" if name in ("other", "further") else name
        cases = [_case(rig, kind, effects, sizes, among, rng) for effects, sizes in make()]
        yield from cases[: math.ceil(plan.part * len(cases))]


def _stream(plan: BenchmarkPlan, rig: str, name: str) -> np.random.Generator:
    """Open the random stream of one list of one rig."""
    return np.random.default_rng([plan.seed, *f"{rig}/{name}".encode()])


def _case(
    rig: str,
    kind: str,
    effects: tuple[str, ...],
    sizes: tuple[float, ...],
    among: tuple[str, ...] | None,
    rng: np.random.Generator,
) -> Case:
    asked = {
        "kind": kind,
        "effects": list(effects),
        "sizes": list(sizes),
        "protocol": draw_protocol(rng, among),
        # Identified on its own campaign, another specimen is no gap at all.
        "model": draw_model(rng, own=_SHIFT not in effects),
        "surroundings": draw_surroundings(rng),
    }
    return Case(rig, asked, exclude=effects if kind == "withheld" else ())


def _each(
    effects: tuple[str, ...], sizes: tuple[float, ...]
) -> Iterator[tuple[tuple[str, ...], tuple[float, ...]]]:
    """List every effect at every size: each effect once before any comes again."""
    for turn in range(len(sizes)):
        for i, effect in enumerate(effects):
            yield (effect,), (sizes[(i + turn) % len(sizes)],)


def _one_each(
    effects: tuple[str, ...], sizes: tuple[float, ...]
) -> Iterator[tuple[tuple[str, ...], tuple[float, ...]]]:
    """List every effect at one size; the sizes take turns."""
    if sizes:
        yield from (((effect,), (sizes[i % len(sizes)],)) for i, effect in enumerate(effects))


def _together(
    count: int, among: tuple[int, int], effects: tuple[str, ...], rng: np.random.Generator
) -> Iterator[tuple[tuple[str, ...], tuple[float, ...]]]:
    """Draw so many sets of effects that can be told apart, of sizes from one to the other.

    A shifted specimen goes with any other anyhow.
    """
    names = [name for name in effects if name != _SHIFT]
    low, high = np.log(_TOGETHER)
    for _ in range(count):
        drawn = _drawn(names, among, rng)
        while any(confounded(one, other) for one, other in combinations(drawn, 2)):
            drawn = _drawn(names, among, rng)
        yield drawn, tuple(np.exp(rng.uniform(low, high, len(drawn))).round(3).tolist())


def _drawn(names: list[str], among: tuple[int, int], rng: np.random.Generator) -> tuple[str, ...]:
    few, many = among
    count = few if few == many else int(rng.integers(few, many + 1))
    return tuple(names[place] for place in rng.permutation(len(names))[:count].tolist())
