"""Games that are out of step, and actions that spread less and less."""

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

from roletrust_agents.training.experience import Narrowing, StaggeredGames, WholeGames
from roletrust_agents.training.learners import make_model
from roletrust_agents.training.settings import make_settings
from roletrust_env.game.make_task import make_task


def task(**arguments):
    return make_task("paper-3x3", ("sp_2",), max_cycles=10, **arguments)


@pytest.mark.parametrize("games", [1, 4, 10, 25])
def test_the_first_episodes_end_apart_and_all_others_have_their_length(games):
    env = StaggeredGames(task(), games, seed=0)
    for _ in range(2):
        env.reset()
        ended: list[list[int]] = [[] for _ in range(games)]
        for step in range(1, 31):
            observation, _, dones, infos = env.step(np.zeros((games, 1), np.float32))
            for game in np.flatnonzero(dones):
                ended[game].append(step)
                assert infos[game]["TimeLimit.truncated"]
                assert infos[game]["terminal_observation"][0] > 0
                assert observation[game, 0] == 0
        firsts = [rounds[0] for rounds in ended]
        assert firsts == [-(-10 * (game + 1) // games) for game in range(games)]
        assert all(np.diff(rounds).tolist() == [10] * (len(rounds) - 1) for rounds in ended)


def test_the_spread_falls_below_the_limit():
    env = StaggeredGames(task(), 4, seed=0)
    settings = make_settings(
        "any", "ppo", {"n_steps": 5, "batch_size": 20, "hidden": (8,), "log_std_init": 1.0}
    )
    model, spread = make_model("ppo", settings, env, 0), []

    class Look(Narrowing):
        def _on_rollout_start(self):
            super()._on_rollout_start()
            spread.append(self.model.policy.log_std.item())

    model.learn(100, callback=Look(1.0, -3.0, 80))
    assert spread == pytest.approx([1.0, 0.0, -1.0, -2.0, -3.0], abs=0.05)
    assert np.all(np.array(spread) <= np.array([1.0, 0.0, -1.0, -2.0, -3.0]) + 1e-6)


def test_whole_games_weight_their_rewards():
    rewards = []
    for continuation in (1.0, 0.5):
        env = WholeGames(task(continuation=continuation), 3, seed=0)
        env.reset()
        played = [env.step(np.zeros((3, 1), np.float32)) for _ in range(20)]
        assert [dones.tolist() for _, _, dones, _ in played] == [
            [t % 10 == 9] * 3 for t in range(20)
        ]
        rewards.append(np.stack([reward for _, reward, _, _ in played]))
    weights = np.tile(0.5 ** np.arange(10), 2)[:, None]
    np.testing.assert_allclose(rewards[1], rewards[0] * weights, rtol=1e-6)
