"""The control: what is rated changes nothing, so an attack does no harm."""

import numpy as np

from baselines import BadMouthing
from roletrust_env import Cast, Game, make_scenario, record


def test_no_attack_does_harm() -> None:
    game = Game(make_scenario("crowd-10x10").change(max_cycles=20, initial_trust=0.4), "constant")
    honest, attacked = (record(Cast(game, attack), game.random(0)) for attack in ({}, {"sr_2": BadMouthing()}))
    for trust in (honest.tor, honest.top, attacked.tor, attacked.top):
        assert np.all(trust == 0.4)
    assert np.any(honest.ratings != attacked.ratings)
