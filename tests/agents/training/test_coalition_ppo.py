"""PPO of a coalition: its policy against slow copies, its noise, and what it spends."""

import numpy as np
import pytest
import torch
from refusals import refuses

pytest.importorskip("sb3_contrib")

from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3 import PPO
from torch.distributions import Normal

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker, decide
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights
from roletrust_agents.training.coalition_policy import (
    CoalitionPolicy,
    begin_with,
    deep_set_of,
    policy_arguments,
)
from roletrust_agents.training.coalition_ppo import CoalitionPpo
from roletrust_agents.training.experience import AfterUpdates, WholeGames
from roletrust_agents.training.universal import universal_coalitions
from roletrust_env import Game, make_scenario, make_task
from roletrust_env.evaluation.measurement import SEARCHED, mean_rewards
from roletrust_env.evaluation.search import Budget, SearchMethod, UnsuitableError
from roletrust_env.game.accounts import ACCOUNT_FEATURES
from roletrust_env.game.coalition import FEATURES, Coalition

BOTH, RATERS, PROVIDERS = ("sr_8", "sr_9", "sp_9"), ("sr_8", "sr_9"), ("sp_9",)
ROUNDS, GAMES = 6, 3
FROM_RANDOM = CoalitionPpo(start="random", n_epochs=1)


def arguments(compromised=BOTH, **changes):
    return {"scenario": "crowd-10x10", "compromised": compromised, "max_cycles": ROUNDS, **changes}


def model_of(compromised=BOTH, seed=0, observation="coalition"):
    """A learner with weights that are far from those at the beginning."""
    task = make_task(**arguments(compromised), observation=observation)
    shape = policy_arguments(task, 5, 4, -1.0)
    env = WholeGames(task, GAMES, seed=seed)
    model = PPO(
        CoalitionPolicy,
        env,
        n_steps=ROUNDS,
        batch_size=9,
        policy_kwargs=shape,
        seed=seed,
        device="cpu",
    )
    with torch.no_grad():
        for weights in model.policy.parameters():
            weights.add_(0.3 * torch.randn_like(weights))
    return model, task, env


def noises(model, env, rounds):
    """The noise of each game and entry in some rounds, (T, E, A), from the actions of the
    policy."""
    seen, result = env.reset(), []
    for _ in range(rounds):
        with torch.no_grad():
            observation = torch.as_tensor(seen)
            action, _, _ = model.policy(observation)
            chances = model.policy.get_distribution(observation).distribution
        result.append(((action - chances.mean) / chances.stddev).numpy())
        seen, *_ = env.step(action.clip(-1, 1).numpy())
    return np.stack(result)


@pytest.mark.parametrize("compromised", [BOTH, RATERS, PROVIDERS])
def test_log_probabilities_are_those_of_normal_distributions(compromised):
    model, task, env = model_of(compromised)
    policy, observation = model.policy, torch.as_tensor(env.reset())
    action, values, log_prob = policy(observation)
    parts = [
        policy.log_std[k]
        for k, there in enumerate((compromised != PROVIDERS, compromised != RATERS))
        if there
    ]
    spread = torch.cat([part.exp().expand(10) for part in parts])
    mean = policy.get_distribution(observation).mode()
    expected = Normal(mean, spread).log_prob(action).sum(dim=1)
    assert action.shape == mean.shape == (GAMES, task.action_size)
    torch.testing.assert_close(log_prob, expected)
    again, after, entropy = policy.evaluate_actions(observation, action)
    torch.testing.assert_close(after, expected)
    torch.testing.assert_close(again, values)
    torch.testing.assert_close(entropy, Normal(mean, spread).entropy().sum(dim=1))


def test_noise_is_held_over_a_game_and_differs_between_games():
    model, _, env = model_of()
    noise = noises(model, env, 2 * ROUNDS)
    first, second = noise[:ROUNDS], noise[ROUNDS:]
    for game in (first, second):
        np.testing.assert_allclose(game, np.broadcast_to(game[0], game.shape), atol=1e-4)
    one, other = first[0], second[0]
    assert (np.abs(one - other) > 1e-3).all()
    assert (np.abs(one - np.roll(one, 1, axis=0)) > 1e-4).all()
    assert np.abs(one.std() - 1) < 0.4


def test_only_a_game_that_begins_gets_new_noise():
    model, _, env = model_of()
    held = model.policy.action_dist
    seen = torch.as_tensor(env.reset())
    before = model.policy(seen)[0]
    later = seen.reshape(GAMES, len(FEATURES), -1).clone()
    later[1:, FEATURES.index("clock")] = 0.5  # the first game begins again
    mean = model.policy.get_distribution(later.flatten(1)).mode()
    noise = (model.policy(later.flatten(1))[0] - mean) / held.distribution.stddev
    was = (before - model.policy.get_distribution(seen).mode()) / held.distribution.stddev
    torch.testing.assert_close(noise[1:], was[1:], atol=1e-5, rtol=1e-4)
    assert (noise[0] - was[0]).abs().min() > 1e-4


@given(st.permutations(range(10)))
@settings(max_examples=10, deadline=None)
def test_the_policy_treats_providers_alike(order):
    model, _, _ = model_of()
    features = torch.rand(4, len(FEATURES), 10) * 2 - 1
    with torch.no_grad():
        mean, turned = (
            model.policy.get_distribution(x.flatten(1)).mode()
            for x in (features, features[..., order])
        )
        value, same = (
            model.policy.predict_values(x.flatten(1)) for x in (features, features[..., order])
        )
    torch.testing.assert_close(
        mean.reshape(4, 2, 10)[..., order], turned.reshape(4, 2, 10), atol=1e-5, rtol=1e-4
    )
    torch.testing.assert_close(value, same, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("observation", ["coalition", "accounts"])
@pytest.mark.parametrize("compromised", [BOTH, RATERS, PROVIDERS])
def test_the_network_decides_as_the_policy_does_without_noise(compromised, observation):
    model, task, env = model_of(compromised, observation=observation)
    network, seen = deep_set_of(model.policy), env.reset()
    for _ in range(ROUNDS):
        expected, _ = model.predict(seen, deterministic=True)
        split, coalition = len(FEATURES) * task.game.roster.n_providers, task.coalition
        features, later = seen.T[:split].reshape(len(FEATURES), -1, GAMES), seen.T[split:]
        shape = len(ACCOUNT_FEATURES), task.game.roster.n_raters, len(coalition.providers), GAMES
        decided = decide(
            coalition, network, features, later.reshape(shape) if coalition.treats else None
        )
        flat = np.concatenate([part.reshape(-1, GAMES) for part in decided if part is not None])
        np.testing.assert_allclose(2 * flat.T - 1, expected, atol=1e-5)
        seen, *_ = env.step(expected)
    assert not network.presence(np.ones((6, 2, GAMES), np.float32)).any()


def test_a_wide_network_claims_first_what_it_lies_about_most() -> None:
    scenario = make_scenario("marketplace").change(max_cycles=ROUNDS, ratings={"open": 2})
    game = Game(scenario)
    coalition = Coalition(game, ("sr_10", "sr_11"), wide=True)
    architecture = DeepSetArchitecture.of(5, wide=True)
    network = DeepSet.unflatten(
        architecture, random_weights(architecture, np.random.default_rng(0)).astype(np.float32)
    )
    features = np.random.default_rng(1).uniform(-1, 1, (len(FEATURES), 12, 3))
    decision = decide(coalition, network, features)
    np.testing.assert_allclose(decision.claims, 2 * abs(decision.lie - 0.5))


def test_a_policy_begins_as_a_network_that_also_calls_identities():
    model, _, _ = model_of()
    weights = random_weights(DeepSetArchitecture(units=5), np.random.default_rng(0)).astype(
        np.float32
    )
    network = DeepSet.unflatten(DeepSetArchitecture(units=5), weights)
    begin_with(model.policy, network)
    np.testing.assert_array_equal(deep_set_of(model.policy, network).flatten(), weights)


def test_a_search_begins_with_a_universal_coalition():
    """Its games are paid for, and a learning rate of almost 0 keeps it."""
    ready = universal_coalitions(wide=False)
    least = 40 * ROUNDS + len(ready) * 16 * ROUNDS
    still = CoalitionPpo(learning_rate=1e-12, n_epochs=1, wide=False)
    ready_weights = [network.flatten() for network in ready.values()]
    result = still.search(arguments(), Budget(least + 5 * ROUNDS), 0)
    assert result.rounds > len(ready) * 16 * ROUNDS + 30 * ROUNDS
    weights = result.attacker.network.flatten()
    assert min(np.abs(weights - ready_one).max() for ready_one in ready_weights) < 1e-6
    harmful = CoalitionPpo(learning_rate=0.3, n_epochs=1, wide=False).search(
        arguments(), Budget(least + 5 * ROUNDS), 0
    )
    kept = harmful.attacker.network.flatten()
    assert any((kept == ready_one).all() for ready_one in ready_weights), (
        "a training ends below its start"
    )
    with refuses(UnsuitableError, least):
        still.search(arguments(), Budget(least - 1), 0)


def test_the_end_of_a_game_ends_its_rewards():
    _, task, env = model_of()
    env.reset()
    for _ in range(ROUNDS):
        _, _, dones, infos = env.step(np.zeros((GAMES, task.action_size), np.float32))
    assert dones.all()
    assert not any(info["TimeLimit.truncated"] for info in infos)


def test_a_call_follows_each_update():
    model, _, _ = model_of()
    calls = []

    def note(updates):
        calls.append((updates, model._n_updates // model.n_epochs))

    model.learn(3 * ROUNDS * GAMES, callback=AfterUpdates(ROUNDS * GAMES, note))
    assert calls == [(1, 1), (2, 2), (3, 3)]


@pytest.mark.parametrize("rounds", [40 * ROUNDS, 777])
def test_a_search_spends_its_budget_and_no_more(rounds):
    budget = Budget(rounds)
    result = FROM_RANDOM.search(arguments(), budget, 0)
    assert result.rounds == budget.spent <= rounds
    assert budget.left < 16 * ROUNDS
    assert isinstance(CoalitionPpo(), SearchMethod)


def test_a_seed_finds_the_same_attack_again():
    found = [FROM_RANDOM.search(arguments(), Budget(240), seed).attacker for seed in (0, 0, 1)]
    first, again, other = (attacker.network.flatten() for attacker in found)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.01


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ("budget", "239")),
        (
            {"knowledge": "grey_box"},
            ("black_box", "knowledge", "grey_box"),
        ),
    ],
)
def test_what_it_refuses(changes, words):
    with refuses(UnsuitableError, *words):
        FROM_RANDOM.search(arguments(**changes), Budget(239), 0)


def test_a_wide_one_refuses_open_reports():
    opened = arguments(ratings={"open": 7})
    with refuses(UnsuitableError, "ratings.open", 7):
        FROM_RANDOM.search(opened, Budget(1000), 0)
    narrow = CoalitionPpo(start="random", n_epochs=1, wide=False)
    assert narrow.search(opened, Budget(1000), 0).rounds <= 1000


@pytest.mark.slow
def test_it_learns_within_few_games():
    found = (
        CoalitionPpo(start="random", n_epochs=4, wide=False)
        .search(arguments(), Budget(600), 0)
        .attacker
    )
    untrained = CoalitionAttacker(deep_set_of(model_of()[0].policy))
    task = make_task(**arguments())
    after, before = (
        mean_rewards(task, who, 9, (1, 50), SEARCHED)[0].mean() for who in (found, untrained)
    )
    assert after > before
