"""Providers whose ability drifts, or changes at once."""

from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from hypothesis import given
from refusals import refuses

from roletrust_baselines import OnOff
from roletrust_env import Game, JointPolicy, Scenario
from roletrust_env.game.rollout import Round, rollout
from roletrust_env.metrics import received
from roletrust_env.world import Choice
from roletrust_env.world.scenario import read_scenario


def market(*providers: dict[str, Any], **fields: Any) -> Scenario:
    groups = [{"role": "SP", "count": 3, "ability": (0.2, 0.9)} | group for group in providers]
    agents = [{"role": "SR", "count": 2}, *groups]
    return read_scenario({"agents": agents, "max_cycles": 20} | fields, "market")


def played(game: Game, batch: tuple[int, ...] = (), policies: Any = None) -> list[Round]:
    random = game.random(seed=0)
    return list(rollout(JointPolicy(game, policies or {}), random, random, batch))


def abilities(scenario: Scenario, batch: tuple[int, ...] = ()) -> np.ndarray:
    """The ability in each round, shape (T, P, ...)."""
    return np.stack([each.before.properties.ability for each in played(Game(scenario), batch)])


@given(
    st.floats(0, 1),
    st.floats(0, 1),
    st.sampled_from([0.0, 1e-6, 0.1, 30.0, 1e6]),
    st.sampled_from([0.0, 1e-6, 0.3, 1.0]),
    st.sampled_from(["float32", "float64"]),
)
def test_an_ability_stays_in_its_range(
    low: float, high: float, drift: float, switch: float, dtype: str
) -> None:
    bounds = (min(low, high), max(low, high))
    scenario = market({"ability": bounds, "drift": drift, "switch": switch}, max_cycles=6)
    for like in (np.zeros((), dtype), torch.zeros((), dtype=getattr(torch, dtype))):
        for each in played(Game(scenario, like=like), (5,)):
            ability, (least, most) = each.state.properties.ability, np.asarray(bounds, dtype)
            assert (ability >= float(least)).all()
            assert (ability <= float(most)).all()


@pytest.mark.parametrize("change", [{"drift": 0.3}, {"switch": 0.3}, {"drift": 0.2, "switch": 0.1}])
def test_abilities_are_uniform_in_the_range_after_many_rounds(change: dict[str, float]) -> None:
    found = abilities(market(change, max_cycles=40), (3000,))
    share = (found - 0.2) / 0.7
    for values in (share[0], share[-1]):
        deciles = np.histogram(values, 10, (0, 1))[0] / values.size
        assert deciles == pytest.approx(0.1, abs=0.015)
    assert abs(np.corrcoef(share[0].ravel(), share[-1].ravel())[0, 1]) < 0.05


def test_a_walk_has_the_deviation_of_its_steps() -> None:
    found = abilities(market({"ability": (0, 1), "drift": 0.01}), (2000,))
    inside = (found[0] > 0.2) & (found[0] < 0.8)
    steps = np.diff(found, axis=0)[:, inside]
    assert steps.mean() == pytest.approx(0, abs=3e-4)
    assert steps.std() == pytest.approx(0.01, rel=0.02)
    assert (found[-1] - found[0])[inside].std() == pytest.approx(0.01 * np.sqrt(19), rel=0.04)


def test_a_switch_has_its_probability_and_nothing_changes_otherwise() -> None:
    found = abilities(market({"switch": 0.1}), (2000,))
    assert (np.diff(found, axis=0) != 0).mean() == pytest.approx(0.1, abs=0.005)


def test_an_ability_that_nothing_changes_stays_the_same_to_the_last_bit() -> None:
    groups = {}, {"drift": 0.1}, {"switch": 0.4}, {"ability": 0.7}
    found, plain = (
        abilities(market(*groups), (50,)),
        abilities(market({}, {}, {}, groups[3]), (50,)),
    )
    same = [*range(3), *range(9, 12)]
    assert np.array_equal(found[:, same], plain[:, same])
    assert np.array_equal(found[0], plain[0])
    for changing in (found[:, 3:6], found[:, 6:9]):
        assert (changing[0] != changing[-1]).any(axis=1).all()


def test_services_have_the_ability_of_their_round() -> None:
    game = Game(market({"drift": 0.1, "switch": 0.2}))
    for before, actions, state, _, _ in played(game, (4,)):
        ability = before.properties.ability
        assert np.array_equal(state.quality, ability)
        assert np.array_equal(state.service, np.broadcast_to(ability, state.service.shape))
        assert np.array_equal(game.offered(before, actions, state), ability)


def test_a_compromised_provider_drifts_like_an_honest_one() -> None:
    game = Game(market({"drift": 0.1, "switch": 0.2}))
    honest, attacked = (
        played(game, policies=policies) for policies in ({}, {"sp_0": OnOff(bad=0.5, start=0)})
    )
    for one, other in zip(honest, attacked, strict=True):
        ability = one.before.properties.ability
        assert np.array_equal(ability, other.before.properties.ability)
        assert other.state.quality[0] <= ability[0]


def test_yardsticks_are_the_abilities_of_the_round() -> None:
    scenario = market({"drift": 0.1, "switch": 0.2}, access=Choice(by="own", explore=0.3))
    game = Game(scenario, "own-experience")
    rounds = played(game, (4,))
    ability = np.stack([each.before.properties.ability for each in rounds])
    history = type(
        "Record",
        (),
        {
            "served": np.stack([each.state.awaiting for each in rounds]),
            "offered": np.stack([game.offered(*each[:3]) for each in rounds]),
        },
    )
    bought = received(history, ability, range(2), range(3))
    np.testing.assert_allclose(bought.best, ability.max(axis=1).sum(axis=0))
    np.testing.assert_allclose(bought.blind, ability.mean(axis=1).sum(axis=0))
    got = np.where(history.served, ability[:, None], 0).sum(axis=2).mean(axis=1).sum(axis=0)
    np.testing.assert_allclose(bought.got, got)


@pytest.mark.parametrize(
    ("group", "words"),
    [
        ({"drift": -0.1}, ["drift", "-0.1"]),
        ({"drift": float("nan")}, ["drift", "nan"]),
        ({"switch": 1.5}, ["switch", "1.5"]),
        ({"drift": 0.25, "ability": 0.6}, ["drift", "0.25", "ability", "0.6"]),
        ({"switch": 0.25, "ability": 1.0}, ["switch", "0.25", "ability", "1.0"]),
        ({"switch": 0.25, "role": "SR", "ability": 1.0}, ["switch", "0.25", "'SR'"]),
    ],
    ids=str,
)
def test_a_change_without_a_range_of_ability_is_refused(
    group: dict[str, Any], words: list[str]
) -> None:
    with refuses(ValueError, "agents.1", *words):
        market(group)
