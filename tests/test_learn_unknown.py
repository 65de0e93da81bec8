"""How much the signs of an unknown cause weigh, and what they were learned from."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit, logit

from blind_records import truth as made
from spa_fo.gap.unknown import WEIGHTS, Weights

ROOT = Path(__file__).resolve().parent.parent
CREEP, SENSOR_CREEP, LEAK = (frozenset({name}) for name in ("creep", "sensor_creep", "leak"))


@pytest.fixture(scope="module")
def learner():
    spec = importlib.util.spec_from_file_location(
        "learn_unknown", ROOT / "benchmarks" / "learn_unknown.py"
    )
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def truth(kind="closed", effects=CREEP, model="off"):
    return made(*effects, kind=kind, equivalents=SENSOR_CREEP, model=model)


def test_the_weights_are_what_the_table_teaches(learner):
    table = learner.read_table(learner.TABLE)
    learned = learner.learn(table)
    assert set(learned.weights) == set(WEIGHTS.by_sign)
    assert learned.intercept == pytest.approx(WEIGHTS.intercept, abs=2e-3)
    for name, value in learned.weights.items():
        assert value == pytest.approx(WEIGHTS.by_sign[name], abs=2e-3)


def test_what_the_weights_file_says_of_itself_is_computed(learner, tmp_path):
    learner.write_weights(learner.TABLE, tmp_path / "weights.json")
    again = json.loads((tmp_path / "weights.json").read_text())
    committed = json.loads(learner.WEIGHTS.read_text())
    assert again["on_other_campaigns"] == pytest.approx(committed["on_other_campaigns"], abs=2e-3)
    assert (again["explanations"], again["campaigns"]) == (
        committed["explanations"],
        committed["campaigns"],
    )


def test_no_sign_speaks_against_what_it_is_a_sign_of(learner):
    for name, value in WEIGHTS.by_sign.items():
        assert name in learner.STATES or value >= 0.0


def test_a_table_with_a_rule_in_it_teaches_the_rule(learner):
    rng = np.random.default_rng(5)
    signs = rng.standard_normal((3000, 3))
    odds = -0.5 + signs @ [2.0, 0.0, 0.7]
    answers = (rng.random(3000) < expit(odds)).astype(float)
    table = learner.Table(("loud", "idle", "faint"), signs, np.ones(3000), answers, np.arange(3000))
    learned = learner.learn(table)
    # Beforehand it is not as probable as it is frequent here.
    prior = logit(learner.MISSING) - logit(answers.mean())
    assert learned.intercept == pytest.approx(-0.5 + prior, abs=0.15)
    assert list(learned.weights.values()) == pytest.approx([2.0, 0.0, 0.7], abs=0.2)
    np.testing.assert_allclose(
        learned.probability(signs[:1]),
        Weights(learned.intercept, learned.weights).probability(
            dict(zip(table.names, signs[0], strict=True))
        ),
    )


def test_a_campaign_does_not_judge_what_it_taught(learner):
    """Answers that only their own campaign knows cannot be told for unseen ones."""
    rng = np.random.default_rng(6)
    campaign = np.repeat(np.arange(40), 2)
    answers = rng.integers(0, 2, 40)[campaign].astype(float)
    signs = np.eye(40)[campaign] * (2.0 * answers[:, None] - 1.0)
    table = learner.Table(
        tuple(f"s{k}" for k in range(40)), np.abs(signs), np.ones(80), answers, campaign
    )
    assert np.ptp(learner.unseen(table)[answers == 1.0]) < 0.2
    assert learner.learn(table).probability(table.signs)[answers == 1.0].min() > 0.5


@pytest.mark.parametrize(
    ("truth", "without", "named", "expected"),
    [
        (truth(), [], CREEP, False),
        (truth(), [], LEAK, None),
        (truth("no_effect", frozenset()), [], frozenset(), False),
        (truth(), ["creep"], LEAK, True),
        (truth(), ["creep"], SENSOR_CREEP, None),
        (truth(), ["creep"], frozenset(), True),
        (truth(model="own"), ["creep"], frozenset(), None),
        (truth("alien", frozenset({"reference_sag"})), [], LEAK, True),
        (truth(effects=frozenset({"parameter_shift"})), ["parameter_shift"], LEAK, None),
    ],
)
def test_what_an_explanation_teaches(learner, truth, without, named, expected):
    assert learner.stands_in(truth, without, named) is expected
