"""Specifications of tasks as JSON: what comes back is what was written, or nothing is written."""

import json
from dataclasses import dataclass

import gymnasium
import numpy as np
from refusals import refuses
from task_cases import RATER, same

from roletrust_baselines import BadMouthing
from roletrust_env import make_attacker, make_scenario, make_trust_model
from roletrust_env.envs.spec import _plain
from roletrust_env.game.policy import registry as policies
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.trust.models.central.means import Mean


def test_every_model_and_policy_comes_back_from_json() -> None:
    for registry in (trust_models, policies):
        for name in registry.names():
            try:
                made = registry.make(name)
            except ValueError:  # it needs agents, or a file
                continue
            table = json.loads(json.dumps(_plain("it", made)))
            assert registry.read(table) == made, name


def test_a_task_is_made_again_with_the_same_models_policies_and_worlds() -> None:
    arguments = {
        "trust_model": make_trust_model("role-trust", lam=0.7),
        "others": {"sr_1": BadMouthing(level=0.1), "sp_1": make_attacker("on-off", period=4)},
        "access": make_scenario("paper-3x3").access,
        "max_cycles": np.int64(5),
        "noise": np.float32(0.25),
        "stealth": {"weight": 1.0},
    }
    for env in (
        gymnasium.make(RATER, **arguments),
        gymnasium.make_vec(RATER, num_envs=2, **arguments),
    ):
        again = env.spec.from_json(env.spec.to_json())
        twin = (
            gymnasium.make(again)
            if isinstance(env, gymnasium.Env)
            else gymnasium.make_vec(again, num_envs=2)
        )
        assert repr(twin.unwrapped) == repr(env.unwrapped)
        env.action_space.seed(0)
        assert same(twin.reset(seed=1), env.reset(seed=1))
        assert same(twin.step(action := env.action_space.sample()), env.step(action))
        assert json.loads(twin.spec.to_json()) == json.loads(env.spec.to_json())


@dataclass(frozen=True)
class Own(Mean):
    """A model without a name."""


def test_what_has_no_name_is_refused() -> None:
    for name, value, word in (
        ("trust_model", Own(), repr(Own())),
        ("scenario", make_scenario("paper-3x3"), "scenario"),
        ("like", np.zeros((), np.float32), "like"),
    ):
        with refuses(ValueError, word):
            gymnasium.make(RATER, **{name: value}).spec.to_json()
