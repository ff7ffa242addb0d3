"""Learners of one's own: their games, what they give back, and what they cannot do."""

import numpy as np
import pytest

from roletrust_env.benchmark.learners.contestants import contestant
from roletrust_env.benchmark.learners.learner import CountedGames, Entered, SpentError, Taught
from roletrust_env.benchmark.learners.suite import Task
from roletrust_env.envs.vector import AttackVectorEnv
from roletrust_env.evaluation.search import Budget, find

PROVIDER = Task(task="ProviderAttack", set={"max_cycles": 12, "noise": 0.0, "perturbations": []})
DUAL = Task(task="DualAttack", set={"max_cycles": 12})


class Stubborn:
    """Plays all its rounds, and then the same quality and ratings for ever."""

    games = 4

    def __init__(self, quality=0.5):
        self.quality = quality

    def learn(self, env, budget, seed):
        seen, _ = env.reset()
        assert seen.shape == (4, *env.single_observation_space.shape)
        for _ in range(budget // env.num_envs):
            env.step(np.full(env.action_space.shape, self.quality, np.float32))
        return lambda seen: np.full((len(seen), *env.single_action_space.shape), self.quality, np.float32)


def entered(learner, task=PROVIDER, budget=100, games=3, seed=0):
    return find(Entered(learner, "mine", task.id), task.arguments(), budget=budget, seed=seed, games=games)


def test_what_is_learned_is_played_in_games_of_its_own():
    found = entered(Stubborn(0.25), DUAL)
    assert found.rounds == 100
    assert found.description == "mine in 100 rounds"
    assert found.scores.shape == (3,)
    assert len(set(found.scores)) == 3  # each with luck of its own
    same = entered(Stubborn(0.25), DUAL, budget=8)
    np.testing.assert_array_equal(found.scores, same.scores)  # which learning does not touch


def test_selling_bad_service_pays_as_the_reward_says():
    """Honest play earns 0; half a service sold on trust that follows it earns trust x 1/2 from the second round on."""
    assert entered(Stubborn(1.0)).scores.max() == 0
    assert 0.1 < entered(Stubborn(0.5)).scores.mean() < 0.5


def test_no_round_is_played_beyond_the_budget():
    budget = Budget(10)
    games = CountedGames(AttackVectorEnv(PROVIDER.id, 4, **PROVIDER.arguments()), budget)
    games.reset(seed=0)
    quality = np.full((4, 1), 0.5, np.float32)
    with pytest.raises(ValueError, match="the action holds nan"):
        games.step(quality * np.nan)
    assert budget.spent == 0
    games.step(quality)
    games.step(quality)
    for _ in range(2):
        with pytest.raises(SpentError, match="2 of 10 rounds are left, and a step of 4 games needs more"):
            games.step(quality)
    assert budget.spent == 8
    games.reset(options={"reset_mask": np.ones(4, bool)})  # costs nothing


def test_the_games_have_the_seed_that_the_learner_has():
    class Watches(Stubborn):
        seen = ()

        def learn(self, env, budget, seed):
            self.seen = env.reset()[0], env.step(np.ones(env.action_space.shape, np.float32))[0]
            return super().learn(env, budget - 4, seed)

    watched = [Watches() for _ in range(3)]
    for learner, seed in zip(watched, (0, 0, 1), strict=True):
        entered(learner, DUAL, seed=seed)
    np.testing.assert_array_equal(watched[0].seen[1], watched[1].seen[1])
    assert (watched[0].seen[1] != watched[2].seen[1]).any()


class Counts:
    """Serves worse from round to round: 1, 0.9, 0.8 ..."""

    def begin(self, games):
        self.quality = np.ones((games, 1), np.float32)

    def __call__(self, seen):
        self.quality = self.quality - np.float32(0.1) * (seen[:, :1] >= 0)
        return np.clip(self.quality, 0, 1)


def test_who_remembers_begins_anew_with_every_batch():
    class Teaches:
        def learn(self, env, budget, seed):
            return Counts()

    first, second = (entered(Teaches()).scores for _ in range(2))
    np.testing.assert_array_equal(first, second)
    taught, task = Taught(Counts()), AttackVectorEnv(PROVIDER.id, 2, **PROVIDER.arguments()).task
    for _ in range(2):
        taught.begin(task, task.game.random(0), (1, 3))
        assert taught.play.quality.shape == (3, 1)
        assert taught.play.quality.min() == 1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (None, "it must give what plays"),
        (lambda seen: seen, "the action has shape"),
        (lambda seen: np.full((len(seen), 1), 1.5), "outside"),
        (lambda seen: np.full((len(seen), 1), np.nan), "nan"),
    ],
)
def test_what_does_not_play_is_refused(given, message):
    class Bad:
        def learn(self, env, budget, seed):
            return given

    with pytest.raises(ValueError, match=message):
        entered(Bad())


def test_nothing_but_a_class_of_learners_is_called(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "somebodys.py").write_text(
        "called = []\ndef function(**k):\n    called.append(k)\nclass Other:\n    def __init__(self):\n"
        "        called.append(1)\nclass Fine:\n    def __init__(self, rate=1):\n        self.rate = rate\n"
        "    def learn(self, env, budget, seed):\n        return None\n"
    )
    for name in ("function", "Other"):
        with pytest.raises(ValueError, match=f"learner 'somebodys:{name}' must make a Learner"):
            contestant(f"somebodys:{name}", PROVIDER.id)
    import somebodys

    assert somebodys.called == []
    found = contestant("somebodys:Fine:rate=3", PROVIDER.id)
    assert (found.learner.rate, found.name) == (3, "somebodys:Fine:rate=3")
    for name, message in (
        ("os:system:command=true", "must make a Learner"),
        ("somebodys:Fine:speed=3", "It takes rate"),
        ("nowhere:Fine", "cannot be loaded"),
        ("PPOO", r"unknown learner 'PPOO'; did you mean 'PPO'\? Known: PPO, recurrent PPO, SAC"),
    ):
        with pytest.raises(ValueError, match=message):
            contestant(name, PROVIDER.id)
