"""The network of a coalition, against loops over providers and units."""

import numpy as np
import pytest
import torch
from refusals import refuses

from roletrust_agents.learned.coalition_attacker import CoalitionAttacker
from roletrust_agents.learned.deep_set import DeepSet, DeepSetArchitecture, random_weights, widened
from roletrust_env import make_scenario, make_task
from roletrust_env.evaluation.measurement import SEARCHED, mean_rewards
from roletrust_env.game.accounts import ACCOUNT_FEATURES
from roletrust_env.game.coalition import FEATURES, IDENTITY_FEATURES

SMALL = DeepSetArchitecture(units=3)
WIDE = DeepSetArchitecture.of(3, wide=True)


def vector(seed=0, architecture=SMALL):
    return 2 * random_weights(architecture, np.random.default_rng(seed)) + 0.01


def network(seed=0, architecture=SMALL):
    return DeepSet.unflatten(architecture, vector(seed, architecture))


def slow(net, features):
    """Return the decision for features of shape (F, P), provider by provider and unit by unit."""
    w, units, p = net.weights, range(net.architecture.units), features.shape[1]

    def dot(matrix, row, values):
        return sum(matrix[row][i] * values[i] for i in range(len(values)))

    first = [
        [np.tanh(dot(w["layer0.weight"], u, features[:, i]) + w["layer0.bias"][u]) for u in units]
        for i in range(p)
    ]
    mean = [sum(first[i][u] for i in range(p)) / p for u in units]
    result = np.zeros((2, p))
    for i in range(p):
        second = [
            np.tanh(
                dot(w["layer1.weight"], u, first[i])
                + dot(w["layer1.mean"], u, mean)
                + w["layer1.bias"][u]
            )
            for u in units
        ]
        lie, quality, gate = (
            0.5
            + 0.5
            * np.tanh(
                3
                * (
                    dot(w["layer2.weight"], k, second)
                    + dot(w["layer2.skip"], k, features[:, i])
                    + w["layer2.bias"][k]
                )
            )
            for k in range(3)
        )
        result[:, i] = 0.5 + gate * (lie - 0.5), quality
    return result


@pytest.mark.parametrize("providers", [1, 3, 7])
def test_it_decides_as_the_loops_do(providers):
    features = np.random.default_rng(1).uniform(-1, 1, (len(FEATURES), providers))
    assert np.allclose(network().decide(features), slow(network(), features), atol=1e-12)


def accounts(*shape):
    random = np.random.default_rng(3)
    return random.uniform(-1, 1, (len(ACCOUNT_FEATURES), 4, *shape)), random.uniform(
        -1, 1, (len(FEATURES), *shape)
    )


def test_treatment_and_silence_are_those_of_the_loops():
    wide, (of_raters, of_providers) = network(0, WIDE), accounts(2)
    w, found = wide.weights, network(0, WIDE).treatment(*accounts(2))
    for s in range(4):
        for i in range(2):
            z, x = of_raters[:, s, i], of_providers[:, i]
            hidden = np.tanh(
                w["treatment0.weight"] @ z + w["treatment0.provider"] @ x + w["treatment0.bias"]
            )
            linear = (
                w["treatment1.weight"] @ hidden + w["treatment1.skip"] @ z + w["treatment1.bias"]
            )
            assert found[s, i] == pytest.approx(0.5 + 0.5 * np.tanh(3 * linear[0]), abs=1e-12)
    order = [2, 0, 3, 1]  # the same rule for all raters
    np.testing.assert_allclose(
        wide.treatment(of_raters[:, order], of_providers), found[order], atol=1e-12
    )
    features = np.random.default_rng(1).uniform(-1, 1, (len(FEATURES), 5))
    narrow = DeepSet(SMALL, {name: w[name] for name in SMALL.shapes()})
    silent = DeepSet(
        SMALL,
        {
            **narrow.weights,
            **{f"layer2.{n}": np.vstack([w[f"silence.{n}"]] * 3) for n in ("weight", "skip")},
            "layer2.bias": np.repeat(w["silence.bias"], 3),
        },
    )
    decided = wide.decide(features)
    np.testing.assert_allclose(decided[:2], narrow.decide(features), atol=1e-12)
    np.testing.assert_allclose(decided[2], silent.decide(features)[1], atol=1e-12)


def test_wide_networks_side_by_side_and_on_torch_decide_as_each_alone():
    together = DeepSet.unflatten(WIDE, np.stack([vector(seed, WIDE) for seed in range(3)]))
    of_raters, of_providers = accounts(2, 3, 5)
    found = together.treatment(of_raters, of_providers)
    on_torch = together.treatment(torch.as_tensor(of_raters), torch.as_tensor(of_providers)).numpy()
    np.testing.assert_allclose(on_torch, found, atol=1e-12)
    for k in range(3):
        alone = network(k, WIDE).treatment(of_raters[..., k, :], of_providers[..., k, :])
        np.testing.assert_allclose(found[..., k, :], alone, atol=1e-12)


def test_a_widened_network_begins_as_the_network_plays():
    team = ("sr_8", "sr_9", "sp_9")
    task = make_task(
        "crowd-10x10",
        team,
        objective="mislead",
        max_cycles=12,
        like=np.zeros(()),
        consumers="raters",
    )
    first, *others = widened(network())
    plays = [
        mean_rewards(task, CoalitionAttacker(one), 0, (1, 6), SEARCHED)[0]
        for one in (network(), first, *others)
    ]
    np.testing.assert_allclose(plays[1], plays[0], atol=0.01)
    assert max(abs(play - plays[0]).max() for play in plays[2:]) > 0.001
    assert widened(first) == [first]


def test_it_treats_all_providers_alike():
    features = np.random.default_rng(1).uniform(-1, 1, (len(FEATURES), 5, 4))
    order = [3, 1, 4, 0, 2]
    assert np.allclose(
        network().decide(features[:, order]), network().decide(features)[:, order], atol=1e-12
    )


def test_networks_side_by_side_decide_as_each_alone():
    vectors = np.stack([vector(seed) for seed in range(3)])
    features = np.random.default_rng(1).uniform(-1, 1, (len(FEATURES), 4, 3, 5))
    of_identities = np.random.default_rng(2).uniform(0, 1, (len(IDENTITY_FEATURES), 2, 3, 5))
    together = DeepSet.unflatten(SMALL, vectors)
    assert np.array_equal(together.flatten(), vectors)
    for k in range(3):
        one = network(k)
        assert np.allclose(
            together.decide(features)[:, :, k], one.decide(features[:, :, k]), atol=1e-12
        )
        assert np.array_equal(
            together.presence(of_identities)[:, k], one.presence(of_identities[:, :, k])
        )


def test_torch_decides_as_numpy_does():
    features = np.random.default_rng(1).uniform(-1, 1, (len(FEATURES), 4, 6))
    found = network().decide(torch.as_tensor(features)).numpy()
    assert np.allclose(found, network().decide(features), atol=1e-12)


def test_decisions_lie_in_the_range_of_actions():
    wild = DeepSet.unflatten(SMALL, 100 * vector())
    decided = wild.decide(np.random.default_rng(1).uniform(-1, 1, (len(FEATURES), 4, 50)))
    assert decided.min() >= 0
    assert decided.max() <= 1


def test_weights_that_do_not_fit_are_refused():
    weights = network().weights
    with refuses(ValueError, "weights", "layer0.weight"):
        DeepSet(SMALL, {name: weight for name, weight in weights.items() if name != "layer0.bias"})
    with refuses(ValueError, "layer0.bias", "(4,)", "(3,)"):
        DeepSet(SMALL, {**weights, "layer0.bias": np.zeros(4)})
    with refuses(ValueError, "layer0.bias"):
        DeepSet(SMALL, {**weights, "layer0.bias": np.full(3, np.nan)})
    with refuses(ValueError, "features"):
        DeepSetArchitecture(features=("published",))


@pytest.mark.parametrize(
    ("preset", "compromised", "objective"),
    [
        ("paper-3x3", ("sr_2",), "damage"),
        ("paper-3x3", ("sp_2",), "exploit"),
        ("crowd-10x10", ("sr_8", "sr_9", "sp_9"), "damage"),
        ("peers", ("srsp_5",), "exploit"),
    ],
)
def test_one_network_plays_every_task(preset, compromised, objective):
    task = make_task(preset, compromised, objective=objective, max_cycles=10, like=np.zeros(()))
    vectors = np.stack([vector(seed) for seed in range(3)])
    together = mean_rewards(
        task, CoalitionAttacker(DeepSet.unflatten(SMALL, vectors)), 0, (3, 4), SEARCHED
    )[0]
    for k in range(3):
        alone = mean_rewards(task, CoalitionAttacker(network(k)), 0, (1, 4), SEARCHED)[0]
        assert np.allclose(alone[0], together[k], atol=1e-9)
    assert together.std() > 0


def test_it_calls_identities_in_reserve():
    groups = [
        {"role": "SR", "count": 3, "noise": 0.1},
        {"role": "SR", "count": 1, "noise": 0.1, "reserve": 2},
        {"role": "SP", "count": 3, "ability": [0.3, 1.0]},
    ]
    scenario = make_scenario("market").change(max_cycles=10, agents=groups)
    task = make_task(scenario, ("sr_3",), objective="damage", like=np.zeros(()))
    vectors = {}
    for name, sign in (("calls", 5.0), ("leaves", -5.0)):
        weights = {key: 0 * weight for key, weight in network().weights.items()}
        weights["presence1.bias"] = np.asarray([sign])
        weights["layer2.bias"] = np.asarray([-5.0, 0.0, 5.0])  # the worst ratings
        vectors[name] = mean_rewards(
            task, CoalitionAttacker(DeepSet(SMALL, weights)), 0, (1, 4), SEARCHED
        )[0].mean()
    assert vectors["calls"] > vectors["leaves"]
