"""The training of a defence: its numbers, what it learns, and that it repeats."""

import numpy as np
import pytest
from refusals import refuses

pytest.importorskip("torch")

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.training.adam_training import EvolutionStrategy
from roletrust_agents.training.defence import AttackerMixture, Climb, train_defence
from roletrust_agents.training.defence_learners import ParameterLearner, learner_of
from roletrust_agents.training.settings import StrategySettings
from roletrust_agents.training.universal import universal_coalitions
from roletrust_env import make_scenario
from roletrust_env.benchmarking.known_attacks import KnownAttack
from roletrust_env.evaluation.attackers import Scripted, record_of
from roletrust_env.evaluation.specs import parse_trust_model
from roletrust_env.game.make_task import make_task
from roletrust_env.game.policy import registry as attackers
from roletrust_env.trust import Ratings

AGENTS = [
    {"role": "SR", "count": 5, "noise": 0.05},
    {"role": "SP", "count": 4, "ability": [0.3, 1.0]},
]
SCENARIO = make_scenario("crowd-10x10").change(max_cycles=12, agents=AGENTS)
TASK = {
    "scenario": SCENARIO,
    "compromised": ("sr_3", "sr_4"),
    "objective": "mislead",
    "trust_model": "mean",
}
LEARNED = ("role-trust", "beta", "leave-one-out", "wary-role-trust", "first-hand")
SHORT = Climb(steps=6, pairs=4, games=4, attackers=4, validation=16, validate_every=3)


def attack(name, attacker):
    return KnownAttack(
        name=name, scenario="crowd", track="raters", share=0.4, record=record_of(attacker)
    )


LIARS = attack(
    "liars", Scripted({name: attackers.make("complementary") for name in TASK["compromised"]})
)
COALITION = attack("coalition", CoalitionAttacker(universal_coalitions()["universal-raters"]))
FRONT = AttackerMixture(TASK, (LIARS, COALITION), np.array([0.75, 0.25]))


@pytest.mark.parametrize("name", LEARNED)
def test_a_learner_begins_at_the_defaults(name):
    learner = ParameterLearner(name)
    assert parse_trust_model(learner.spec(learner.start()), SCENARIO) == parse_trust_model(
        name, SCENARIO
    )


@pytest.mark.parametrize("name", [*LEARNED, "network"])
def test_models_side_by_side_play_as_each_alone(name):
    """Each row has the trust of the model that its spec names, also outside the ranges."""
    learner, rng = learner_of(name), np.random.default_rng(0)
    vectors = learner.start() + rng.normal(0, 0.5, (5, len(learner.start())))
    ratings = rng.random((6, 4, 5, 3)).astype(np.float32)
    together = played(learner.models(vectors, 0.4), ratings)
    for k, vector in enumerate(vectors):
        alone = parse_trust_model(learner.spec(vector), SCENARIO.change(initial_trust=0.4))
        for seen, expected in zip(together, played(alone, ratings[..., k, :]), strict=True):
            np.testing.assert_allclose(seen[..., k, :], expected, atol=2e-5)


def played(model, ratings):
    state, mask = model.start(ratings), ratings > 0.3
    for now in (ratings, 1 - ratings, ratings**2):
        state = model.update(state, Ratings(now, mask))
    own = (
        [model.judge_trust(state)] if hasattr(model, "judge_trust") else []
    )  # by which its consumers go
    return model.rater_trust(state), model.provider_trust(state), *own


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("constant", ()),
        ("zhang-cohen", ()),
        ("networks", ("network",)),
        ("bta", ("beta",)),
    ],
)
def test_what_cannot_be_learned_is_refused(name, words):
    with refuses(ValueError, name, *words):
        learner_of(name)


def test_a_defence_learns():
    """Trust that counts all raters alike is easily misled; the power of their trust is the
    remedy."""
    learner = ParameterLearner("leave-one-out")
    start = learner.start()
    power = list(learner.ranges).index("power")
    start[power] = 0.0
    steps = []
    found = train_defence(learner, [FRONT], start, SHORT, 0, lambda: steps.append(1))
    assert found.score > found.start + 0.02
    assert found.vector[power] > 0.05
    assert len(steps) == SHORT.steps


def test_a_training_repeats_and_never_ends_below_its_start():
    learner = ParameterLearner("beta")
    once, again = (
        train_defence(learner, [FRONT, FRONT], learner.start(), SHORT, 3) for _ in range(2)
    )
    assert np.array_equal(once.vector, again.vector)
    assert once[1:] == again[1:]
    assert once.score >= once.start
    validations = 3 * 2 * 2 * 16  # of two conditions, each with two attackers
    drawn = once.rounds / 12 - validations
    assert 6 * 8 * 2 * 4 <= drawn <= 6 * 8 * 2 * 2 * 4  # one or two attackers are drawn


def test_the_score_weighs_the_attackers():
    learner, still = (
        ParameterLearner("mean"),
        Climb(steps=1, pairs=1, games=1, attackers=1, validation=8),
    )
    fronts = {
        name: AttackerMixture(TASK, (one,), np.ones(1))
        for name, one in (("a", LIARS), ("b", COALITION))
    }
    alone = {
        k: train_defence(learner, [one], learner.start(), still, 0).start
        for k, one in fronts.items()
    }
    both = train_defence(learner, [FRONT], learner.start(), still, 0).start
    assert both == pytest.approx(0.75 * alone["a"] + 0.25 * alone["b"], abs=1e-6)
    assert alone["a"] != pytest.approx(alone["b"], abs=1e-4)


# --- an attacker against a mixture
# ------------------------------------------------------------------


def mixed(shares, budget=20_000):
    tasks = [make_task(**{**TASK, "trust_model": model}) for model in ("mean", "wary-role-trust")]
    settings = StrategySettings(games=2, pairs=2, units=4, candidates=2, validation=8)
    return EvolutionStrategy(tasks, settings, 0, budget, shares=shares)


def test_a_mixture_weighs_its_models():
    ends = [mixed(shares).validate().mean for shares in ([1.0, 0.0], [0.0, 1.0])]
    weights = [mixed(shares).weights for shares in ([1.0, 0.0], [0.0, 1.0])]
    assert ends[0] != ends[1]
    one = mixed([0.75, 0.25])
    one._adam.restore(
        {"weights": one._adam.vector.detach() * 0, "adam": one._adam.optimiser.state_dict()}
    )
    plain = [
        float(one.play(task, one.networks(one.weights[None, :]), 8, 1_000_000_000).mean())
        for task in one.tasks
    ]
    assert one.validate().mean == pytest.approx(0.75 * plain[0] + 0.25 * plain[1])
    assert len(weights[0]) == len(weights[1])


def test_a_step_draws_its_models_by_their_shares():
    one, drawn = mixed([0.9, 0.1]), []
    for step in range(200):
        one.steps = step
        drawn.append(one.turn)
    assert all(turn in ([0], [1], [0, 1], [1, 0]) for turn in drawn)
    share = np.mean([turn.count(0) / len(turn) for turn in drawn])
    assert 0.85 < share < 0.95


def test_it_steps_while_the_rounds_allow_it():
    one = mixed([0.5, 0.5], budget=10_000)
    judged = list(one.within(10_000))
    assert one.rounds <= 10_000 < one.rounds + one.most_rounds
    assert judged[-1]
    assert len(judged) == one.steps
