"""Learn how much each sign weighs that the library lacks the cause.

    python benchmarks/learn_unknown.py signs results/blind ... --out benchmarks/unknown_signs.csv
    python benchmarks/learn_unknown.py weights benchmarks/unknown_signs.csv

The first diagnoses opened cases of the blind benchmark (with `--withhold`, those with one effect
in the library also without it: one core needs ten seconds a case) and writes the signs of every
explanation that is either right or stands in for a cause that the library lacks. The second fits
a logistic regression to them and writes `src/spa_fo/gap/unknown_weights.json`. Cases that later
judge the diagnosis must have other seeds.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from blind.equivalents import equivalents
from blind.judge import Truth, read_truth
from blind.judge.realised import campaign_data, plain_model
from spa_fo.atomic import write_text
from spa_fo.gap.diagnose import examine
from spa_fo.gap.unknown import signs

Floats = NDArray[np.float64]
Label = Mapping[str, Any]
Row = dict[str, Any]

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "benchmarks" / "unknown_signs.csv"
WEIGHTS = ROOT / "src" / "spa_fo" / "gap" / "unknown_weights.json"
FACTS = ("seed", "case", "protocol", "effects", "without", "named", "weight", "stands_in")
SEED = 1  # of what is random in a diagnosis
SEEN, MISSED = 1.5, 3.0  # noise floors from which an effect is seen, and missed where withheld
LEAST = 0.02  # probability of an explanation
MISSING = 0.25  # probability beforehand that the library lacks the cause
PULL = 0.3  # towards no weight at all, of signs with unit spread
FOLDS = 10
STATES = ("nothing", "shifted", "own")  # no signs by themselves: what the others are seen against


@dataclass(frozen=True)
class Learned:
    """Log odds that an explanation stands in for another cause: intercept and a weight a sign."""

    intercept: float
    weights: dict[str, float]

    def probability(self, signs: Floats) -> Floats:
        """By row of signs, in the order of `weights`."""
        odds = self.intercept + signs @ np.array(list(self.weights.values()))
        return np.asarray(1.0 / (1.0 + np.exp(-odds)))


def stands_in(truth: Truth, without: Sequence[str], named: frozenset[str]) -> bool | None:
    """Whether an explanation stands in for something else; None where neither can be said."""
    missing = truth.kind == "alien" or bool(without)
    if not missing:
        return False if named == truth.effects else None
    if named and named <= truth.equivalents:
        return None
    if truth.model == "own" and not named:
        return None  # the model may have taken the whole effect up
    if "parameter_shift" in without:
        return None  # the plain model identified again speaks for that one
    return True


def examined(
    folder: Path, label: Mapping[str, Any], without: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Diagnose a case up to its explanations; yield a row for each that teaches something."""
    truth = read_truth(label, folder)
    data = campaign_data(folder / "campaign")
    found = examine(data, plain_model(folder, SEED), without, np.random.default_rng(SEED), SEED)
    for s in found.scored:
        taught = stands_in(truth, without, frozenset(s.named))
        if taught is None or s.probability < LEAST:
            continue
        numbers = signs(s, found.candidates, found.floor_deg)
        yield {
            "seed": label["asked"]["seed"],
            "case": truth.case,
            "protocol": truth.protocol,
            "effects": "+".join(sorted(truth.effects)),
            "without": "+".join(without),
            "named": "+".join(s.named),
            "weight": round(s.probability, 4),
            "stands_in": int(taught),
        } | {name: round(value, 4) for name, value in numbers.items()}


def cases(results: Path) -> list[tuple[Path, Label]]:
    """List the opened cases of a blind benchmark with their labels."""
    labels = json.loads((results / "labels.json").read_text(encoding="utf-8"))
    folders = {path.name: path for path in results.glob("cases/*/case_*")}
    return [(folders[name], entry.get("label", entry)) for name, entry in sorted(labels.items())]


def tasks(results: Sequence[Path], withhold: bool) -> Iterator[tuple[Path, Label, Sequence[str]]]:
    """Say which cases are diagnosed, and without which effects."""
    for folder, label in (case for each in results for case in cases(each)):
        asked = label["asked"]
        closed = asked["kind"] == "closed"
        if not closed or asked["sizes"][0] >= SEEN:
            yield folder, label, label["exclude"]
        rich = read_truth(label, folder).is_rich
        if withhold and closed and rich and asked["sizes"][0] >= MISSED:
            fair = equivalents(asked["effects"][0])
            yield folder, {**label, "equivalents": fair}, asked["effects"]


def write_signs(results: Sequence[Path], out: Path, withhold: bool) -> None:
    rows: list[Row] = []
    for folder, label, without in tasks(results, withhold):
        rows += examined(folder, label, without)
        print(f"{folder.name} {label['asked']['kind']}: {len(rows)} explanations", flush=True)
    write_table(rows, out)


def write_table(rows: Sequence[Row], out: Path) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(out, text.getvalue())


@dataclass(frozen=True)
class Table:
    """Signs (n, k) with their names, weights (n,) and answers (n,); campaigns (n,) as numbers."""

    names: tuple[str, ...]
    signs: Floats
    weight: Floats
    stands_in: Floats
    campaign: NDArray[np.int64]

    def part(self, rows: NDArray[np.bool_]) -> Table:
        """Some of the rows."""
        return Table(
            self.names,
            self.signs[rows],
            self.weight[rows],
            self.stands_in[rows],
            self.campaign[rows],
        )


def read_table(path: Path) -> Table:
    rows = list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"))))
    names = tuple(name for name in rows[0] if name not in FACTS)
    campaigns = {key: n for n, key in enumerate(dict.fromkeys(row["seed"] for row in rows))}
    return Table(
        names=names,
        signs=np.array([[float(row[name]) for name in names] for row in rows]),
        weight=np.array([float(row["weight"]) for row in rows]),
        stands_in=np.array([float(row["stands_in"]) for row in rows]),
        campaign=np.array([campaigns[row["seed"]] for row in rows]),
    )


def learn(table: Table) -> Learned:
    """Fit by penalised likelihood; the penalty is on signs with unit spread.

    What is a sign of an unknown cause by its meaning may weigh nothing, but not speak against it.
    """
    centre, spread = table.signs.mean(axis=0), table.signs.std(axis=0) + 1e-9
    x = np.column_stack([(table.signs - centre) / spread, np.ones(len(table.signs))])
    sense = 2.0 * table.stands_in - 1.0
    weight = table.weight * np.where(table.stands_in == 1.0, MISSING, 1.0 - MISSING)
    for answer in (0.0, 1.0):
        weight[table.stands_in == answer] /= table.weight[table.stands_in == answer].sum()
    weight *= table.weight.sum()

    def cost(w: Floats) -> tuple[float, Floats]:
        odds = x @ w
        missed = 1.0 / (1.0 + np.exp(-odds)) - table.stands_in
        pull = np.append(w[:-1], 0.0)
        value = weight @ np.logaddexp(0.0, -sense * odds) + PULL * pull @ pull
        return float(value), x.T @ (weight * missed) + 2.0 * PULL * pull

    bounds = [(None if name in STATES else 0.0, None) for name in table.names] + [(None, None)]
    start = np.zeros(x.shape[1])
    w = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, tol=1e-10).x
    scaled = w[:-1] / spread
    by_sign = {name: float(value) for name, value in zip(table.names, scaled, strict=True)}
    return Learned(float(w[-1] - scaled @ centre), by_sign)


def unseen(table: Table) -> Floats:
    """Probability for each row from rows of other campaigns."""
    fold = np.random.default_rng(0).permutation(table.campaign.max() + 1)[table.campaign] % FOLDS
    result = np.empty(len(fold))
    for k in range(FOLDS):
        result[fold == k] = learn(table.part(fold != k)).probability(table.signs[fold == k])
    return result


def write_weights(path: Path, out: Path) -> None:
    table = read_table(path)
    learned, p = learn(table), unseen(table)
    wrong = table.stands_in == 1.0
    right_as_unknown = np.average(p[~wrong] > 0.5, weights=table.weight[~wrong])
    wrong_as_unknown = np.average(p[wrong] > 0.5, weights=table.weight[wrong])
    loss = -np.average(np.log(np.where(wrong, p, 1.0 - p)), weights=table.weight)
    document = {
        "learned_by": "python benchmarks/learn_unknown.py weights benchmarks/unknown_signs.csv",
        "explanations": len(p),
        "campaigns": int(table.campaign.max() + 1),
        "on_other_campaigns": {
            "right_taken_for_unknown": round(float(right_as_unknown), 4),
            "wrong_taken_for_unknown": round(float(wrong_as_unknown), 4),
            "log_loss": round(float(loss), 4),
        },
        "intercept": round(learned.intercept, 4),
        "weights": {name: round(value, 4) for name, value in learned.weights.items()},
    }
    write_text(out, json.dumps(document, indent=1) + "\n")
    print(json.dumps(document, indent=1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    collect = commands.add_parser("signs", help="diagnose opened cases, write their signs")
    collect.add_argument("results", type=Path, nargs="+", help="results of a blind benchmark")
    collect.add_argument("--withhold", action="store_true", help="also with the effect missing")
    collect.add_argument("--out", type=Path, default=TABLE)
    weights = commands.add_parser("weights", help="fit the weights to a table of signs")
    weights.add_argument("table", type=Path, nargs="?", default=TABLE)
    weights.add_argument("--out", type=Path, default=WEIGHTS)
    given = parser.parse_args()
    if given.command == "signs":
        write_signs(given.results, given.out, given.withhold)
    else:
        write_weights(given.table, given.out)


if __name__ == "__main__":
    main()
