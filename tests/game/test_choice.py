"""Raters that choose one provider by trust, receive its service, and remember it."""

from typing import Any

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_env import (
    Game,
    JointPolicy,
    Policy,
    Scenario,
    make_task,
    make_trust_model,
    parallel_env,
    record,
)
from roletrust_env.game.rollout import Round, rollout
from roletrust_env.metrics import received
from roletrust_env.trust.models.personal.similarity import OwnExperience
from roletrust_env.world import Choice


def market(**access: Any) -> Scenario:
    agents = [
        {"role": "SR", "count": 6, "noise": 0.1},
        {"role": "SP", "count": 4, "ability": (0.0, 1.0), "drift": 0.1, "switch": 0.1},
    ]
    return Scenario(agents=agents, access=Choice(**access), ratings={"lost": 0.3}, max_cycles=25)


class Grumbler(Policy):
    """A rater that rates all services 0.1."""

    attacks = frozenset({"ratings"})

    def ratings(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.service + 0.1, memory


def played(game: Game, batch: tuple[int, ...] = ()) -> list[Round]:
    random = game.random(seed=0)
    return list(rollout(JointPolicy(game, {}), random, random, batch))


@pytest.mark.parametrize("name", ["first-hand", "travos", "role-trust"])
def test_each_rater_goes_to_the_provider_that_it_trusts_most(name: str) -> None:
    game = Game(market(by="own"), name)
    for each in played(game, (8,)):
        trust, served = game.known_trust(each.state), each.state.awaiting
        assert (served.sum(axis=1) == 1).all()
        got = np.where(served, trust, 0).sum(axis=1)
        assert (got >= trust.max(axis=1) - 1e-5).all()  # nearer trusts are ties


class LeastMet(OwnExperience):
    """Own experience whose judges choose the provider that served them least."""

    def preference(self, state: Any, noise: Any) -> Any:
        return 0.5 * noise - state.known.counts


def test_a_model_may_choose_by_a_rule_of_its_own() -> None:
    game = Game(market(by="model"), LeastMet())
    counts = np.zeros((6, 4))
    for each in played(game):
        assert (counts[each.state.awaiting] == counts.min(axis=1)).all()
        counts += each.state.awaiting


def test_a_rule_of_its_own_needs_a_model_that_has_one_and_no_other_exploration() -> None:
    with refuses(ValueError, "preference", "OwnExperience"):
        Game(market(by="model"), make_trust_model("own-experience"))
    for name in ("explore", "temperature"):
        with refuses(ValueError, name, "0.25"):
            Choice(by="model", **{name: 0.25})


@pytest.mark.parametrize("name", ["first-hand", "role-trust"])
def test_compiled_rounds_are_those_of_the_rules(name: str) -> None:
    scenario = market(by="own", explore=0.3)
    envs = [parallel_env(scenario, trust_model=name, engine=e) for e in ("rules", "compiled")]
    for env in envs:
        env.reset(seed=4)
    random = np.random.default_rng(0)
    while envs[0].agents:
        actions = {a: random.random(envs[0].action_space(a).shape) for a in envs[0].agents}
        steps = [env.step(actions) for env in envs]
        for agent, seen in steps[0][0].items():
            np.testing.assert_allclose(seen, steps[1][0][agent], rtol=0, atol=1e-12)


@pytest.mark.parametrize("asarray", [np.asarray, torch.asarray], ids=["numpy", "torch"])
def test_a_task_may_be_about_what_consumers_received(asarray: Any) -> None:
    """The attacker always serves as well as it can, and the rewards are the regret of consumers."""
    task = make_task(
        market(by="own", explore=0.2),
        ("sp_3",),
        objective="mislead",
        consumers="received",
        trust_model="first-hand",
        others={"sr_5": Grumbler()},
        like=asarray(np.zeros(())),
    )
    random, total = task.game.random(seed=2), 0.0
    state = task.start(task.game.draw(random, (3,), start=True), random)
    ones, ability = asarray(np.ones((1, 3))), []
    for _ in range(task.game.scenario.max_cycles):
        ability.append(np.asarray(state.game.properties.ability))
        state, outcome = task.step(state, ones, task.game.draw(random, (3,)), random)
        total = total + np.asarray(outcome.objective)
    game = Game(task.game.scenario, task.game.model)
    history = record(JointPolicy(game, {"sr_5": Grumbler()}), game.random(seed=2), (3,))
    bought = received(history, np.stack(ability), range(5), range(3))
    np.testing.assert_allclose(total, bought.best - bought.got, rtol=0, atol=1e-9)


def test_what_was_received_needs_a_choice_and_an_honest_provider() -> None:
    task = {"objective": "mislead", "consumers": "received"}
    with refuses(ValueError, "received", "'everyone'"):
        make_task("paper-3x3", ("sp_0",), **task)
    with refuses(ValueError, "received"):
        make_task(market(), ("sp_0", "sp_1", "sp_2", "sp_3"), **task)
