"""Records of the blind benchmark: the truth about a case, the answer given, what came of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from spa_fo.errors import BadInput
from spa_fo.plant.effects.library import LIBRARY, STAGES

Ids = frozenset[str]
Record = TypeVar("Record")

NONE: Ids = frozenset({"none"})
UNKNOWN: Ids = frozenset({"unknown"})
KINDS = ("closed", "no_effect", "withheld", "alien", "pair")
VERDICTS = ("no_gap", "cause", "ambiguous", "unknown")

REFIT, SMALLEST_BIC, COMMONEST = "refit_only", "smallest_bic", "commonest"
BASELINES = (REFIT, SMALLEST_BIC, COMMONEST)

_AS_ASKED = 0.9  # an effect that reaches less of its size is graded by what it reaches
_ROUNDING = 1e-3


@dataclass(frozen=True)
class Truth:
    """What is true of a case.

    Attributes
    ----------
    case : str
        Its name.
    kind : str
        One of `KINDS`.
    effects : frozenset of str
        What is at work.
    equivalents : frozenset of str
        What would be a fair answer as well where the library lacks the effect; recorded with the
        case, before any diagnosis.
    size : float or None
        RMS change of the angle in multiples of the noise floor: as asked where it was reached,
        else the power of two below what was; None without an effect and for pairs.
    noise_floor_deg : float
        By which repeated trials of the specimen differ.
    protocol : {"rich", "up_steps"}
    model : {"nominal", "own_fit"}
        Whose coefficients the judged model has: the bare core's, or those of a fit on the case.
    form : str
        Functional form of the effects.
    short : bool
        Whether an effect could not be made as large as asked.
    """

    case: str
    kind: str
    effects: Ids
    equivalents: Ids
    size: float | None
    noise_floor_deg: float
    protocol: str
    model: str
    form: str
    short: bool = False

    @property
    def is_missing(self) -> bool:
        """Whether the library lacks the effect."""
        return self.kind in ("withheld", "alien")

    @property
    def stages(self) -> frozenset[str]:
        """Stages of the effects that the library knows."""
        return frozenset(LIBRARY[name].stage for name in self.effects if name in LIBRARY)

    def fair(self, named: Ids) -> bool:
        """Say whether all that is named is at work, or a recorded equivalent of it."""
        return bool(named) and named <= self.effects | self.equivalents


@dataclass(frozen=True)
class Claim:
    """The shrink that a diagnosis claims, with its 95 % interval."""

    fraction_closed: float
    low: float
    high: float


@dataclass(frozen=True)
class Answer:
    """What a diagnosis says.

    Attributes
    ----------
    verdict : str
        One of `VERDICTS`.
    sets : tuple of frozensets of str
        The verdict's sets.
    top : frozenset of str
        Most probable explanation; the first of equals.
    probability : float
        Of `top`.
    stage : str or None
        Stage with the largest share of the gap; None where all shares are zero.
    claim : Claim or None
    """

    verdict: str
    sets: tuple[Ids, ...]
    top: Ids
    probability: float
    stage: str | None
    claim: Claim | None = None

    @property
    def names(self) -> bool:
        """Whether it offers its sets as the explanation, not as a part of one."""
        return self.verdict in ("cause", "ambiguous")


@dataclass(frozen=True)
class Realised:
    """RMS error on trials nobody has seen: plain model, augmented model, refitted plain model."""

    before_deg: float
    after_deg: float
    refit_deg: float


@dataclass(frozen=True)
class Outcome:
    """One case with its answer; the baselines' answers, and the unseen trials, where there are."""

    truth: Truth
    answer: Answer
    baselines: Mapping[str, Answer] = field(default_factory=dict)
    realised: Realised | None = None


def read_truth(document: Mapping[str, Any], path: Path | str) -> Truth:
    """Read a label.

    Parameters
    ----------
    document : Mapping
        As opened from its seal, schema spa-fo/blind-label/1.
    path : Path or str
        Where it stands, for the message.

    Raises
    ------
    BadInput
        A key is missing or holds what it may not.
    """
    return _checked(_truth, document, path, "spa-fo/blind-label/1")


def read_answer(document: Mapping[str, Any], path: Path | str) -> Answer:
    """Read what a diagnosis.json answers, schema spa-fo/diagnosis/1.

    Raises
    ------
    BadInput
        A key is missing or holds what it may not; the probabilities do not sum to 1, or leave out
        ``none`` or ``unknown``.
    """
    return _checked(_answer, document, path, "spa-fo/diagnosis/1")


def read_baselines(document: Mapping[str, Any], path: Path | str) -> dict[str, Answer]:
    """Give what simpler rules would have answered: those that a diagnosis.json records, and refit.

    Raises
    ------
    BadInput
        ``baselines`` is not a mapping of names to lists of the library's identifiers.
    """
    return _checked(_baselines, document, path, "spa-fo/diagnosis/1")


def read_realised(document: Mapping[str, Any], path: Path | str) -> Realised:
    """Read the errors of one case on its unseen trials.

    Raises
    ------
    BadInput
        A key is missing or is no number.
    """
    return _checked(
        lambda entry: Realised(**{key: _number(value) for key, value in entry.items()}),
        document,
        path,
    )


def _checked(
    read: Callable[[Mapping[str, Any]], Record],
    document: Any,
    path: Path | str,
    schema: str | None = None,
) -> Record:
    """Turn what goes wrong while reading a document into one line that names the file."""
    if not isinstance(document, Mapping):
        raise BadInput(path, "expected a JSON object")
    if schema is not None and document.get("schema") != schema:
        raise BadInput(path, f'expected "{schema}", found {document.get("schema")!r}', "schema")
    try:
        return read(document)
    except KeyError as error:
        raise BadInput(path, "is missing", str(error.args[0])) from error
    except (TypeError, ValueError, AttributeError) as error:
        raise BadInput(path, str(error)) from error


def _truth(label: Mapping[str, Any]) -> Truth:
    return Truth(
        case=str(label["case"]),
        kind=_one_of(label["kind"], KINDS, "kind"),
        effects=_ids(label["effects"]),
        equivalents=_ids(label["equivalents"]),
        size=_size(label),
        noise_floor_deg=_number(label["noise_floor_deg"]),
        protocol=str(label["protocol"]),
        model=str(label["model"]),
        form=str(label["form"]),
        short=_is_short(label),
    )


def _size(label: Mapping[str, Any]) -> float | None:
    if len(label["sizes"]) != 1:
        return None
    if not _is_short(label):
        return _number(label["sizes"][0])
    reached = _number(label["sizes_reached"][0])
    return 2.0 ** math.floor(math.log2(reached / _AS_ASKED)) if reached > 0 else 0.0


def _is_short(label: Mapping[str, Any]) -> bool:
    sizes = zip(label["sizes"], label["sizes_reached"], strict=True)
    return any(_number(reached) < _AS_ASKED * _number(asked) for asked, reached in sizes)


def _answer(document: Mapping[str, Any]) -> Answer:
    causes = [(_ids(cause["set"]), _number(cause["probability"])) for cause in document["causes"]]
    if not {NONE, UNKNOWN} <= {named for named, _ in causes}:
        raise ValueError("causes: expected none and unknown among them")
    if abs(sum(probability for _, probability in causes) - 1.0) > _ROUNDING:
        raise ValueError("causes: expected probabilities that sum to 1")
    top, probability = max(causes, key=lambda cause: cause[1])
    verdict = document["verdict"]
    kind = _one_of(verdict["kind"], VERDICTS, "verdict.kind")
    sets = tuple(_ids(named) for named in verdict["sets"])
    if (kind == "cause" and len(sets) != 1) or (kind == "no_gap" and sets):
        raise ValueError(f"verdict.sets: has {len(sets)}, which {kind} does not allow")
    return Answer(
        verdict=kind,
        sets=sets,
        top=top,
        probability=probability,
        stage=_largest(document["where"]["stage"]),
        claim=_claim(document["shrink"]),
    )


def _largest(shares: Mapping[str, Any]) -> str | None:
    stage = max(STAGES, key=lambda name: _number(shares[name]))
    return stage if shares[stage] > 0 else None


def _claim(shrink: Mapping[str, Any] | None) -> Claim | None:
    if shrink is None:
        return None
    low, high = shrink["ci95"]
    return Claim(_number(shrink["fraction_closed"]), _number(low), _number(high))


def _baselines(document: Mapping[str, Any]) -> dict[str, Answer]:
    recorded = document.get("baselines", {})
    named = {name: _ids(recorded[name]) for name in (SMALLEST_BIC, COMMONEST) if name in recorded}
    return {REFIT: _certain(frozenset())} | {name: _certain(ids) for name, ids in named.items()}


def _certain(named: Ids) -> Answer:
    """Answer as a rule does that is always sure of one explanation; none where it names nothing."""
    if not named - NONE:
        return Answer("no_gap", (), NONE, 1.0, None)
    return Answer("cause", (named,), named, 1.0, LIBRARY[min(named)].stage)


def _ids(names: Iterable[str]) -> Ids:
    if isinstance(names, str):
        raise TypeError(f"expected a list of identifiers, found {names!r}")
    return frozenset(map(str, names))


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError(f"expected a finite number, found {value!r}")
    return float(value)


def _one_of(value: Any, known: tuple[str, ...], where: str) -> str:
    if value not in known:
        raise ValueError(f"{where}: expected one of {', '.join(known)}, found {value!r}")
    return str(value)
