"""The control: what is rated changes nothing, so an attack does no harm, and trust is of no use to
anybody."""

import numpy as np
import pytest

from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Game, JointPolicy, make_scenario, record
from roletrust_env.game.rollout import History
from roletrust_env.metrics import auc, damage, present_trust, recovery, rounds_to_detection, utility


def histories(trust_model: str) -> tuple[History, History]:
    """Sixty rounds of the market, whose sellers differ, without an attack and under one by a seller
    and a buyer."""
    game = Game(make_scenario("market").change(max_cycles=60, initial_trust=0.4), trust_model)
    attack = {"sp_0": OnOff(), "sr_2": BadMouthing()}
    honest, attacked = (
        record(JointPolicy(game, policies), game.random(0), (30,)) for policies in ({}, attack)
    )
    return honest, attacked


def test_no_attack_does_harm_or_is_found() -> None:
    honest, attacked = histories("constant")
    for history in (honest, attacked):
        assert np.all(present_trust(history) == 0.4)
    assert np.any(honest.ratings != attacked.ratings)
    buyers, sellers = attacked.tor.shape[1], attacked.top.shape[1]
    trust, twin = present_trust(attacked), present_trust(honest)
    others = [k for k in range(buyers + sellers) if k not in (2, buyers)]
    assert np.all(damage(trust, twin, others).value == 0)
    assert np.all(recovery(trust, twin, others, stop=30).value == 0)
    assert np.all(auc(trust[-1], [2, buyers]).value == 0.5)
    assert np.isnan(rounds_to_detection(trust, [2, buyers]).value).all()


def test_choosing_by_it_is_choosing_at_random() -> None:
    """Its utility is that of the mean seller, and less than what a model gives that listens."""
    honest, _ = histories("constant")
    listening, _ = histories("mean")
    at_random = honest.offered[1:].mean(axis=1).sum(axis=0) / honest.offered[1:].max(axis=1).sum(
        axis=0
    )
    assert utility(honest.top, honest.offered).value == pytest.approx(at_random)
    assert utility(listening.top, listening.offered).value.mean() > at_random.mean() + 0.15
