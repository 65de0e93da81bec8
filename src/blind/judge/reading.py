"""Labels, diagnoses and errors on unseen trials as they stand in files, read into records."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from blind.judge.records import (
    KINDS,
    NONE,
    UNKNOWN,
    VERDICTS,
    Answer,
    Claim,
    Ids,
    Outcome,
    Realised,
    Surroundings,
    Truth,
    failed,
)
from spa_fo.errors import BadInput
from spa_fo.plant.effects.effect import STAGES
from spa_fo.plant.effects.library import CONTRACT

Record = TypeVar("Record")

AS_ASKED = 0.9
"""Of its size: an effect that reaches less is graded by what it reaches."""
_ROUNDING = 1e-3


def outcomes(
    labels: Mapping[str, Any], batches: Iterable[tuple[Path, Mapping[str, Any]]], source: Path
) -> list[Outcome]:
    """Put every truth beside its answer.

    Parameters
    ----------
    labels : Mapping
        By case, from `source`.
    batches : iterable of (Path, Mapping)
        A batch's folder of diagnoses, and what came of them on unseen trials by case.
    source : Path
        For messages.

    Raises
    ------
    BadInput
        A label is not one; a case has no diagnosis, or a diagnosis no case.
    """
    found = [
        Outcome(read_truth(labels[folder.name], source), answer_in(folder), *unseen)
        for batch, realised in batches
        for folder, unseen in _diagnoses(batch, labels, realised)
    ]
    lost = labels.keys() - {outcome.truth.case for outcome in found}
    if lost:
        raise BadInput(source, f"expected a diagnosis of {min(lost)}, found none")
    return found


def _diagnoses(
    batch: Path, labels: Mapping[str, Any], realised: Mapping[str, Any]
) -> Iterator[tuple[Path, tuple[Realised | None, str]]]:
    for folder in sorted(batch.glob("case_*")):
        if folder.name not in labels:
            raise BadInput(folder, "is a diagnosis of a case without a label")
        yield folder, _unseen(realised[folder.name], folder)


def _unseen(entry: Mapping[str, Any] | None, folder: Path) -> tuple[Realised | None, str]:
    """Read what came of a claim: nothing was claimed, or nothing can be said, or the errors."""
    if entry is None:
        return None, ""
    return (None, str(entry["error"])) if "error" in entry else (read_realised(entry, folder), "")


def answer_in(folder: Path) -> Answer:
    """Read the answer to a case: what ended in an error or breaks the contract is one as well.

    Raises
    ------
    BadInput
        There is neither an answer nor an error.
    """
    error, path = folder / "error.txt", folder / "diagnosis.json"
    if error.is_file():
        return failed(error.read_text(encoding="utf-8").strip())
    if not path.is_file():
        raise BadInput(folder, "expected diagnosis.json or error.txt, found neither")
    try:
        return read_answer(json.loads(path.read_text(encoding="utf-8")), path.name)
    except (BadInput, ValueError) as broken:
        return failed(str(broken))


def read_truth(document: Mapping[str, Any], path: Path | str) -> Truth:
    """Read a label.

    Parameters
    ----------
    document : Mapping
        As opened from its seal, schema spa-fo/blind-label/2.
    path : Path or str
        Where it stands, for the message.

    Raises
    ------
    BadInput
        A key is missing or holds what it may not.
    """
    return _checked(_truth, document, path, "spa-fo/blind-label/2")


def read_answer(document: Mapping[str, Any], path: Path | str) -> Answer:
    """Read what a diagnosis.json answers, schema spa-fo/diagnosis/1.

    Raises
    ------
    BadInput
        A key is missing or holds what it may not; the probabilities do not sum to 1, or leave out
        ``none`` or ``unknown``.
    """
    return _checked(_answer, document, path, "spa-fo/diagnosis/1")


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
    except (TypeError, ValueError, AttributeError, IndexError) as error:
        raise BadInput(path, str(error)) from error


def _truth(label: Mapping[str, Any]) -> Truth:
    asked, truth = label["asked"], label["truth"]
    protocol, error = asked["protocol"], truth["model_error_deg"]
    return Truth(
        case=str(label["case"]),
        rig=str(label["rig"]),
        kind=_kind(asked),
        effects=_ids(asked["effects"]),
        equivalents=_ids(label["equivalents"]),
        size=_size(asked["sizes"], truth["sizes_reached"]),
        noise_floor_deg=_number(truth["noise_floor_deg"]),
        protocol=str(protocol["name"]),
        repeats=1 if protocol["name"] == "single" else int(protocol["repeats"]),
        order=str(protocol["order"]),
        model=_one_of(asked["model"]["kind"], ("own", "earlier", "off"), "asked.model.kind"),
        surroundings=_surroundings(asked["surroundings"]),
        model_error_deg=None if error is None else _number(error),
        short=_is_short(asked["sizes"], truth["sizes_reached"]),
    )


def _kind(asked: Mapping[str, Any]) -> str:
    """Tell the effects beyond the contract's from its own: the goals are set for these."""
    kind = _one_of(asked["kind"], KINDS, "asked.kind")
    return "further" if kind == "closed" and not _ids(asked["effects"]) <= set(CONTRACT) else kind


def _surroundings(asked: Mapping[str, Any]) -> Surroundings:
    noise, scatter, calibration = asked["noise"], asked["scatter"], asked["calibration"]
    correlation = noise["correlation_s"]
    return Surroundings(
        noise_colour=_one_of(noise["colour"], ("exponential", "one_over_f"), "noise.colour"),
        coloured_deg=_number(noise["coloured_deg"]),
        correlation_s=None if correlation is None else _number(correlation),
        gain=_number(scatter["gain"]),
        time_scale=_number(scatter["time_scale"]),
        rest_deg=_number(scatter["rest_deg"]),
        calibration=_one_of(
            calibration["kind"], ("none", "before", "before_and_after"), "calibration.kind"
        ),
        fixture_deg=_number(asked["fixture"]["error_deg"]),
        rate_hz=_number(asked["sampling"]["rate_hz"]),
        bits=int(asked["converter"]["bits"]),
        pressure=bool(asked["pressure"]["measured"]),
    )


def _size(asked: list[Any], reached: list[Any]) -> float | None:
    if len(asked) != 1:
        return None
    if not _is_short(asked, reached):
        return _number(asked[0])
    size = _number(reached[0])
    return 2.0 ** math.floor(math.log2(size / AS_ASKED)) if size > 0 else 0.0


def _is_short(asked: list[Any], reached: list[Any]) -> bool:
    sizes = zip(asked, reached, strict=True)
    return any(_number(got) < AS_ASKED * _number(wanted) for wanted, got in sizes)


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


def _largest(shares: Mapping[str, Any] | None) -> str | None:
    """Name the stage with the largest share; None where the data cannot tell or there is no gap."""
    if shares is None:
        return None
    stage = max(STAGES, key=lambda name: _number(shares[name]))
    return stage if shares[stage] > 0 else None


def _claim(shrink: Mapping[str, Any] | None) -> Claim | None:
    if shrink is None:
        return None
    low, high = shrink["ci95"]
    return Claim(_number(shrink["fraction_closed"]), _number(low), _number(high))


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
