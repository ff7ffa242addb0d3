"""Plug-in learners: their games, their policies and their limits."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_env.benchmarking.learners.learner import (
    BudgetSpentError,
    CountedGames,
    LearnedAttacker,
    LearnerTraining,
    make_search_method,
)
from roletrust_env.benchmarking.learners.suite import SuiteTask
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.evaluation.search import Budget, find

PROVIDER = SuiteTask(
    task="ProviderAttack", set={"max_cycles": 12, "noise": 0.0, "perturbations": []}
)
DUAL = SuiteTask(task="DualAttack", set={"max_cycles": 12})


class Constant:
    """PlayedCells all its rounds, and then the same quality and ratings for ever."""

    games = 4

    def __init__(self, quality=0.5):
        self.quality = quality

    def learn(self, env, budget, seed):
        observations, _ = env.reset()
        assert observations.shape == (4, *env.single_observation_space.shape)
        for _ in range(budget // env.num_envs):
            env.step(np.full(env.action_space.shape, self.quality, np.float32))
        return lambda observations: np.full(
            (len(observations), *env.single_action_space.shape), self.quality, np.float32
        )


def trained(learner, task=PROVIDER, budget=100, games=3, seed=0):
    return find(
        LearnerTraining(learner, "mine", task.id),
        task.arguments(),
        budget=budget,
        seed=seed,
        games=games,
    )


def test_the_policy_is_measured_in_held_out_games():
    result = trained(Constant(0.25), DUAL)
    assert result.rounds == 100
    assert result.description == "mine in 100 rounds"
    assert result.scores.shape == (3,)
    assert len(set(result.scores)) == 3  # each game has its own random numbers
    same = trained(Constant(0.25), DUAL, budget=8)
    np.testing.assert_array_equal(result.scores, same.scores)  # learning does not change them


def test_the_reward_for_bad_service():
    """Honest play earns 0. Quality 0.5 earns half the trust from the second round on, and trust
    follows quality."""
    assert trained(Constant(1.0)).scores.max() == 0
    assert 0.1 < trained(Constant(0.5)).scores.mean() < 0.5


def test_a_step_beyond_the_budget_is_refused():
    budget = Budget(10)
    games = CountedGames(AttackVectorEnv(PROVIDER.id, 4, **PROVIDER.arguments()), budget)
    games.reset(seed=0)
    quality = np.full((4, 1), 0.5, np.float32)
    with refuses(ValueError, "nan"):
        games.step(quality * np.nan)
    assert budget.spent == 0
    games.step(quality)
    games.step(quality)
    for _ in range(2):
        with refuses(BudgetSpentError, "2", "10", "4"):
            games.step(quality)
    assert budget.spent == 8
    games.reset(options={"reset_mask": np.ones(4, bool)})  # uses no budget


def test_the_games_have_the_seed_of_the_learner():
    class Recorder(Constant):
        observations = ()

        def learn(self, env, budget, seed):
            self.observations = (
                env.reset()[0],
                env.step(np.ones(env.action_space.shape, np.float32))[0],
            )
            return super().learn(env, budget - 4, seed)

    recorders = [Recorder() for _ in range(3)]
    for learner, seed in zip(recorders, (0, 0, 1), strict=True):
        trained(learner, DUAL, seed=seed)
    np.testing.assert_array_equal(recorders[0].observations[1], recorders[1].observations[1])
    assert (recorders[0].observations[1] != recorders[2].observations[1]).any()


class Decreasing:
    """Policy whose quality falls in each round: 1, 0.9, 0.8 ..."""

    def begin(self, games):
        self.quality = np.ones((games, 1), np.float32)

    def __call__(self, observations):
        self.quality = self.quality - np.float32(0.1) * (observations[:, :1] >= 0)
        return np.clip(self.quality, 0, 1)


def test_a_memory_is_reset_for_every_batch():
    class Learner:
        def learn(self, env, budget, seed):
            return Decreasing()

    first, second = (trained(Learner()).scores for _ in range(2))
    np.testing.assert_array_equal(first, second)
    attacker, task = (
        LearnedAttacker(Decreasing()),
        AttackVectorEnv(PROVIDER.id, 2, **PROVIDER.arguments()).task,
    )
    for _ in range(2):
        attacker.begin(task, task.game.random(0), (1, 3))
        assert attacker.play.quality.shape == (3, 1)
        assert attacker.play.quality.min() == 1


@pytest.mark.parametrize(
    ("policy", "word"),
    [
        (None, "policy"),
        (lambda observations: observations, "action"),
        (lambda observations: np.full((len(observations), 1), 1.5), "1.5"),
        (lambda observations: np.full((len(observations), 1), np.nan), "nan"),
    ],
)
def test_an_invalid_policy_is_refused(policy, word):
    class Bad:
        def learn(self, env, budget, seed):
            return policy

    with refuses(ValueError, word):
        trained(Bad())


def test_only_classes_of_learners_are_called(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plugin.py").write_text(
        "called = []\ndef function(**k):\n    called.append(k)\nclass Other:\n    def "
        "__init__(self):\n"
        "        called.append(1)\nclass Fine:\n    def __init__(self, rate=1):\n        self.rate "
        "= rate\n"
        "    def learn(self, env, budget, seed):\n        return None\n"
    )
    for name in ("function", "Other"):
        with refuses(ValueError, name):
            make_search_method(f"plugin:{name}", PROVIDER.id)
    import plugin

    assert plugin.called == []
    method = make_search_method("plugin:Fine:rate=3", PROVIDER.id)
    assert (method.learner.rate, method.name) == (3, "plugin:Fine:rate=3")
    for name, words in (
        ("os:system:command=true", ("os:system",)),
        ("plugin:Fine:speed=3", ("Fine", "speed")),
        ("nowhere:Fine", ("nowhere:Fine",)),
        ("PPOO", ("PPOO", "PPO", "CMA-ES")),
    ):
        with refuses(ValueError, *words):
            make_search_method(name, PROVIDER.id)
