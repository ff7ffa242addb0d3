"""Batches of games and gradients that do not fit into the memory are refused before they are
played."""

import numpy as np
import pytest
import torch
from refusals import refuses
from small_market import TASK

from roletrust_agents import smooth
from roletrust_agents.planning.planner import Planner
from roletrust_agents.training.coalition_methods import (
    EvolutionSearch,
    EvolutionStrategySearch,
)
from roletrust_agents.training.coalition_ppo import CoalitionPpo
from roletrust_agents.training.search_method import ppo
from roletrust_env import memory
from roletrust_env.evaluation import measurement
from roletrust_env.evaluation.attackers import OpenLoop, Scripted
from roletrust_env.evaluation.measurement import HELD_OUT, SEARCHED, exact_task, mean_rewards
from roletrust_env.evaluation.search import Budget, find
from roletrust_env.game.make_task import make_task
from roletrust_env.trust import make_trust_model


@pytest.fixture(autouse=True)
def _small_machine(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 1e5)


@pytest.fixture
def everything_is_tried(monkeypatch):
    monkeypatch.setattr(measurement, "_ANYWHERE", 0)


def test_games_that_do_not_fit_are_refused_and_fewer_are_not(everything_is_tried):
    task = exact_task(TASK)
    with refuses(ValueError, "640", "0.1") as error:
        mean_rewards(task, Scripted({}), 0, (64, 10), HELD_OUT)
    fits = int(str(error.value).rpartition(" ")[2])
    assert 5 < fits < 640
    mean_rewards(task, Scripted({}), 0, (1, fits), HELD_OUT)


@pytest.mark.parametrize(
    "method",
    [EvolutionSearch(), EvolutionStrategySearch(), CoalitionPpo(start="random"), ppo()],
    ids=lambda method: method.name,
)
def test_a_search_in_a_world_that_is_too_large_is_refused(everything_is_tried, monkeypatch, method):
    monkeypatch.setattr(memory, "available", lambda: 1e4)
    with refuses(ValueError, "games"):
        find(method, {**TASK, "trust_model": "beta"}, budget=50_000, seed=0, games=1)


def test_gradients_that_do_not_fit_are_refused(monkeypatch):
    monkeypatch.setattr(smooth, "_ANYWHERE", 0)
    with refuses(ValueError, "10"):
        Planner().search(
            {**TASK, "trust_model": "beta", "objective": "promote", "accomplices": ["sp_0"]},
            Budget(50_000),
            0,
        )


def test_a_rollout_that_does_not_fit_is_refused():
    with refuses(ValueError, "games", "32"):
        CoalitionPpo(start="random").search({**TASK, "trust_model": "beta"}, Budget(50_000), 0)


@pytest.mark.parametrize("model", ["beta", "role-trust"])
def test_what_a_backward_pass_keeps_grows_with_games_and_rounds(monkeypatch, model):
    sizes = {
        "agents": [{"role": "SR", "count": 30}, {"role": "SP", "count": 20}],
        "scenario": "crowd-10x10",
    }
    trust_model = smooth.smooth_model(make_trust_model(model))
    task = make_task(
        **{**TASK, **sizes, "objective": "damage"}, trust_model=trust_model, like=torch.zeros(())
    )
    attacker = OpenLoop(torch.full((10, task.action_size), 0.5).requires_grad_())
    foreseen = smooth._kept(task, attacker) * 10 * 8
    kept: dict[int, int] = {}

    def keep(part):
        kept[part.untyped_storage().data_ptr()] = part.untyped_storage().nbytes()
        return part

    with torch.autograd.graph.saved_tensors_hooks(keep, lambda part: part):
        score = mean_rewards(task, attacker, 0, (1, 8), SEARCHED)[0].mean()
    assert bool(score.requires_grad)
    assert foreseen == pytest.approx(np.sum(list(kept.values())), rel=0.3)
