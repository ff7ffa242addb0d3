"""The skill of consumers that receive what they choose."""

from typing import Any

import numpy as np
import pytest

from roletrust_baselines import OnOff
from roletrust_env import Game, JointPolicy, Scenario, record, trust_models
from roletrust_env.game.rollout import History
from roletrust_env.metrics import received, skill_score
from roletrust_env.world import Choice

ABILITY = np.array([0.9, 0.5, 0.1, 0.7])


def market(raters: int = 12, **access: Any) -> Scenario:
    """A market with four honest providers, and one that could not do better than these."""
    providers = [{"role": "SP", "count": 1, "ability": a} for a in (*ABILITY, 0.9)]
    return Scenario(
        agents=[{"role": "SR", "count": raters, "noise": 0.05}, *providers],
        access=Choice(**({"by": "own", "explore": 0.1} | access)),
        max_cycles=40,
    )


def skill(
    scenario: Scenario, model: Any, policies: Any = None, games: int = 60, seed: int = 0
) -> float:
    game = Game(scenario, model)
    history = record(JointPolicy(game, policies or {}), game.random(seed), (games,))
    abilities = np.array([*ABILITY, 0.9])[:, None]
    consumers, honest = range(game.roster.n_raters), range(4)
    return float(skill_score(received(history, abilities, consumers, honest)).mean())


def test_by_hand() -> None:
    """Two consumers and three providers, of which the last is compromised; two rounds."""
    served, offered = np.zeros((2, 2, 3), bool), np.array([[0.8, 0.2, 0.1], [0.8, 0.2, 0.9]])
    served[0, 0, 0] = served[0, 1, 2] = served[1, 0, 1] = True  # the second one gets nothing then
    fields = dict.fromkeys(History._fields)
    history = History(**(fields | {"served": served, "offered": offered}))
    ability = np.array([1.0, 0.4, 1.0])
    weights = np.array([1.0, 0.5])
    bought = received(history, ability, [0, 1], [0, 1], weights=weights)
    assert 2 * bought.got == pytest.approx(0.8 + 0.1 + 0.5 * 0.2)
    assert 2 * bought.best == pytest.approx(2.5 * 1.0)
    assert 2 * bought.blind == pytest.approx(2.5 * 0.7)
    best = received(history, ability, [0, 1], [0, 1], providers=2).best
    assert 2 * best == pytest.approx(3 * 0.7)
    offered[0, 0] = np.nan  # the first one is absent in the first round
    assert received(history, ability, [1], [0, 1]).best == pytest.approx(0.4)


def test_treatment_is_received_by_each_consumer() -> None:
    served = np.ones((1, 2, 1), bool)
    offered = np.array([[[0.8], [0.2]]])
    fields = dict.fromkeys(History._fields)
    history = History(**(fields | {"served": served, "offered": offered}))
    for consumer, quality in ((0, 0.8), (1, 0.2)):
        assert received(history, np.ones(1), [consumer], [0]).got == pytest.approx(quality)


@pytest.mark.parametrize("name", trust_models())
def test_who_only_explores_has_no_skill(name: str) -> None:
    scenario = market(explore=1.0).change(agents=market().agents[:-1])
    game = Game(scenario, name)
    history = record(JointPolicy(game, {}), game.random(0), (40,))
    bought = received(history, ABILITY[:, None], range(12), range(4))
    assert skill_score(bought).mean() == pytest.approx(0, abs=0.03)


def test_what_a_provider_offers_to_those_who_do_not_come_changes_no_yardstick() -> None:
    """A compromised provider that serves nobody well, or everybody, has the same yardsticks."""
    bought = []
    for bad in (1, 0):
        game = Game(market(explore=1.0), "own-experience")
        policies = {"sp_4": OnOff(good=1, bad=bad, start=0)}
        history = record(JointPolicy(game, policies), game.random(0), (10,))
        bought.append(received(history, np.array([*ABILITY, 0.9])[:, None], range(12), range(4)))
    assert np.array_equal(bought[0].best, bought[1].best)
    assert np.array_equal(bought[0].blind, bought[1].blind)
    assert (bought[0].got > bought[1].got).all()


def test_honest_listeners_gain_and_gain_more_where_there_are_more() -> None:
    ability = np.linspace(0.1, 1.0, 16)

    def gain(raters: int) -> float:
        providers = [{"role": "SP", "count": 1, "ability": a} for a in ability.tolist()]
        agents = [{"role": "SR", "count": raters, "noise": 0.05}, *providers]
        scores = []
        for name in ("first-hand", "own-experience"):
            game = Game(market().change(agents=agents), name)
            history = record(JointPolicy(game, {}), game.random(0), (60,))
            bought = received(history, ability[:, None], range(raters), range(16))
            scores.append(float(skill_score(bought).mean()))
        return scores[0] - scores[1]

    assert 0.05 < gain(2) < gain(12) - 0.05


def test_a_single_consumer_that_could_listen_is_one_that_relies_on_itself() -> None:
    assert skill(market(1), "block") == skill(market(1), "own-experience")
