"""Every trust model plays in the face of PettingZoo, and on torch in single precision."""

from typing import Any

import numpy as np
import pytest
import torch

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Game, JointPolicy, make_scenario, parallel_env, record, trust_models

EVERY_MODEL = pytest.mark.parametrize("name", trust_models())


def in_range(trust: Any) -> bool:
    return bool(((trust >= 0) & (trust <= 1)).all())


@EVERY_MODEL
@pytest.mark.parametrize("preset", ["peers", "open-system"])  # who is who, and comers and goers
def test_it_plays_in_pettingzoo(name: str, preset: str) -> None:
    env = parallel_env(preset, trust_model=name, max_cycles=8)
    for k, agent in enumerate(env.possible_agents):
        env.action_space(agent).seed(k)
    env.reset(seed=0)
    rounds, trusts = 0, []
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        observations, _, _, _, infos = env.step(actions)
        assert all(
            env.observation_space(agent).contains(seen) for agent, seen in observations.items()
        )
        trusts.append([info["trust"] for info in infos.values()])
        rounds += 1
    assert rounds == 8
    assert all(in_range(np.array(trust)) for trust in trusts)


@EVERY_MODEL
def test_it_plays_on_torch_as_on_numpy(name: str) -> None:
    """In single precision, with the same luck, under attack on both channels."""
    rules = make_scenario("market").change(max_cycles=6)
    found = []
    for like in (np.zeros(()), torch.zeros(())):
        game = Game(rules, name, like)
        history = record(
            JointPolicy(game, {"sp_0": OnOff(period=4), "sr_1": BadMouthing()}),
            game.random(0),
            (5,),
        )
        assert history.trust.dtype == like.dtype
        assert in_range(history.trust)
        found.append(history)
    assert np.allclose(
        found[0].trust[:2], found[1].trust[:2], atol=1e-4
    )  # later a tie may choose another seller
