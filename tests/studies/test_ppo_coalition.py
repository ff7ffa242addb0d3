"""The example in one file: a short training, and its noise and network."""

import numpy as np
import ppo_coalition
import pytest
import torch
from ppo_coalition import Agent, Settings, condition, main, train, utility
from refusals import refuses

from roletrust_agents.learned.coalition_attacker import decide
from roletrust_env import make_task
from roletrust_env.game.coalition import FEATURES

pytestmark = pytest.mark.slow

SHORT = ("--rounds", "3200", "--starts", "2", "--epochs", "2", "--measured", "10")


def test_it_trains_and_measures(capsys):
    main([*SHORT, "--model", "mean"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 5  # after each of 2 updates of 2 trainings, and at the end
    assert lines[-2].split()[0] == "3,200"
    assert 0.0 < float(lines[-1].split()[1]) < 1.0
    assert lines[-1].endswith("in 10 fresh games, mean")


@pytest.mark.slow
def test_a_few_thousand_rounds_mislead_consumers():
    settings = Settings(rounds=3_200, starts=1, games=4, measured=20)
    untrained = Agent(settings, (0,))
    assert utility(train(settings), settings) < utility(untrained, settings) - 0.05


@pytest.mark.parametrize(("name", "channels"), [("liars", (0,)), ("coalition", (0, 1))])
def test_the_attacker_decides_as_the_agent_does(name, channels):
    settings = Settings(task=name)
    task = make_task(**condition(settings))
    agent = Agent(settings, channels)
    features = np.random.default_rng(0).uniform(-1, 1, (5, len(FEATURES), 10)).astype(np.float32)
    with torch.no_grad():
        expected = agent.actions(torch.as_tensor(features).flatten(1)).mean.numpy()
    decided = decide(task.coalition, agent.attacker().network, np.moveaxis(features, 0, -1))
    flat = np.concatenate([part for part in decided if part is not None])
    np.testing.assert_allclose(2 * flat.T - 1, expected, atol=1e-5)


def test_it_refuses_fewer_rounds_than_a_rollout():
    with refuses(ValueError, "100", "1600"):
        train(Settings(rounds=100))


def test_the_best_of_several_trainings_counts(monkeypatch):
    agents = [Agent(Settings(), (0,)) for _ in range(3)]
    seeds = []
    values = dict(zip(agents, (0.9, 0.4, 0.6), strict=True))
    monkeypatch.setattr(
        ppo_coalition, "train_once", lambda _, seed: seeds.append(seed) or agents[seed - 6]
    )
    monkeypatch.setattr(ppo_coalition, "utility", lambda agent, _, seed: values[agent])
    assert train(Settings(seed=2)) is agents[1]
    assert seeds == [6, 7, 8]  # no other seed has them
