"""What the heads of a coalition see, and that the saved network plays as the learner does."""

import numpy as np
import pytest
import torch

pytest.importorskip("sb3_contrib")

from roletrust_agents.learned.cards import observation_fields
from roletrust_agents.training.experience import StaggeredGames
from roletrust_agents.training.heads import heads_of
from roletrust_agents.training.learners import (
    make_model,
    network_of,
    parameters_bytes,
    set_parameters,
)
from roletrust_agents.training.settings import make_settings
from roletrust_env.envs.task_batch import task_spaces
from roletrust_env.game.make_task import make_task

COALITION = ("sr_2", "sp_1", "srsp_0", "sr_0")


def coalition(**arguments):
    scenario = {
        "agents": (
            {"role": "SR", "count": 3},
            {"role": "SP", "count": 2},
            {"role": "SR+SP", "count": 1},
        )
    }
    return make_task("paper-3x3", COALITION, **scenario, **arguments)


def seen_by(task):
    """For each entry of an action, the names of the fields that it sees, with the place in those of
    several entries."""
    size = task_spaces(task)[0].shape[0]
    names = []
    for field in observation_fields(task.game.scenario, task.compromised, task.knowledge, size):
        names += (
            [field.name] if field.size == 1 else [f"{field.name}[{k}]" for k in range(field.size)]
        )
    heads = heads_of(task, size)
    return heads, {
        o: [names[k] for k in seen]
        for head in heads
        for o, seen in zip(head.outputs, head.sees, strict=True)
    }


def test_an_action_sees_the_coalition_and_the_provider_that_it_is_about():
    heads, seen = seen_by(coalition())
    # sr_2 rates three, sp_1 serves, srsp_0 serves and rates three, sr_0 rates three.
    assert [head.outputs for head in heads] == [(0, 1, 2, 8, 9, 10), (3,), (4,), (5, 6, 7)]
    by_rater = ["published[1]", "service[1]", "awaiting[1]", "ratings[1]", "rated[1]"]
    numbers = ["round", "trust"]
    of_both = ["trust", *(f"provider.{name}" for name in (*numbers, "value", "quality"))]
    of_both += [f"rater.{name}" for name in (*numbers, *by_rater)]
    own = {
        "sr_2": [f"sr_2.{name}" for name in (*numbers, *by_rater)],
        "sr_0": [f"sr_0.{name}" for name in (*numbers, *by_rater)],
        "sp_1": [f"sp_1.{name}" for name in (*numbers, "value", "quality")],
        "srsp_0": [f"srsp_0.{name}" for name in of_both],
    }
    assert seen[1] == own["sr_2"] + own["sr_0"] + own["sp_1"] + own["srsp_0"]
    assert seen[9] == own["sr_0"] + own["sr_2"] + own["sp_1"] + own["srsp_0"]
    assert seen[6] == own["srsp_0"] + own["sr_0"] + own["sr_2"] + own["sp_1"]
    # A quality also sees what every rater noted.
    notes = [f"sp_1.{name}[{i}]" for name in ("ratings", "rated") for i in range(4)]
    assert set(seen[3]) == {*seen[1], *notes}
    assert not set(notes) & set(seen[1])


@pytest.mark.parametrize("knowledge", ["grey_box", "white_box"])
def test_all_see_all_that_more_knowledge_shows(knowledge):
    wide, narrow = (
        task_spaces(task)[0].shape[0] for task in (coalition(knowledge=knowledge), coalition())
    )
    heads = [heads_of(coalition(knowledge=knowledge), wide), heads_of(coalition(), narrow)]
    for one, other in zip(*heads, strict=True):
        for seen, less in zip(one.sees, other.sees, strict=True):
            assert seen == less + tuple(range(narrow, wide))


@pytest.mark.parametrize("knowledge", ["black_box", "grey_box", "white_box"])
def test_the_saved_network_plays_as_the_learner_does(knowledge):
    env = StaggeredGames(coalition(max_cycles=10, knowledge=knowledge), 4, seed=0)
    settings = make_settings("any", "ppo", {"heads": (6, 5), "hidden": (8,), "batch_size": 100})
    model, other = make_model("ppo", settings, env, 0), make_model("ppo", settings, env, 1)
    with torch.no_grad():
        for weights in model.policy.action_net.parameters():
            weights.add_(torch.randn_like(weights))
    set_parameters(other, parameters_bytes(model))
    network, seen = network_of(other), env.reset()
    rng, played = np.random.default_rng(0), []
    for _ in range(4):
        expected, _ = model.predict(seen, deterministic=True)
        assert np.allclose(network(seen.T)[0].T * 2 - 1, expected, atol=1e-4)
        played.append(expected)
        seen, *_ = env.step(rng.uniform(-1, 1, expected.shape).astype(np.float32))
    assert (
        np.ptp(np.concatenate(played), axis=0) > 0.01
    ).sum() > 5  # of 11, the others always at a bound
