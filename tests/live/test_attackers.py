"""Attackers on the wire: what a node's policy is shown, and what it does about it."""

from pathlib import Path

import numpy as np
import pytest
from roletrust_agents.learned import learned
from roletrust_baselines import BadMouthing

from roletrust_env import Game, JointPolicy, Policy, make_scenario, record
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.live.nodes.assess import _Critic
from roletrust_env.live.nodes.cam import _Seller
from roletrust_env.world.roster import Roster

ZOO = Path(__file__).parents[2] / "agents" / "roletrust_agents" / "zoo"
RULES = make_scenario("paper-3x3").change(max_cycles=40, perturbations=()).change(noise=0.0)
ROSTER = Roster.of(RULES)
TOLD = {
    "learned": f"path={ZOO / 'rater-3x3'}",
    "collusion": "accomplices=[sp_0]",
    "orchestrated": "accomplices=[sp_0]",
}

ELSEWHERE = {"self-promotion", "sybil", "whitewashing"}
"""Of agents with both roles, or with identities in reserve."""


class Board:
    """Trust that a game published."""

    def __init__(self, tor, top):
        self.of = dict(zip((*ROSTER.rater_names, *ROSTER.provider_names), np.append(tor, top).tolist(), strict=True))
        self.tor = self.top = self.of.__getitem__


@pytest.mark.parametrize(
    "policy", [BadMouthing(level=0.2), learned(path=str(ZOO / "rater-3x3")), Policy()], ids=["lie", "learned", "honest"]
)
def test_a_rater_says_on_the_wire_what_it_says_in_the_game(policy):
    game = Game(RULES, "role-trust")
    history = record(JointPolicy(game, {"sr_2": policy}), game.random(seed=0))
    board = Board(np.full(3, RULES.initial_trust), np.full(3, RULES.initial_trust))
    critic = _Critic("sr_2", ROSTER.provider_names, policy, board, 0)
    for round in range(len(history.tor)):
        if history.rated[round, 2].any():
            seen = dict(zip(ROSTER.provider_names, history.quality[round - 1].tolist(), strict=True))
            said = critic.ratings(round, seen)
            assert said == dict(zip(ROSTER.provider_names, history.ratings[round, 2].tolist(), strict=True)), round
        board.__init__(history.tor[round], history.top[round])


@pytest.mark.parametrize("name", attackers.names())
def test_every_attacker_of_the_registry_plays_where_a_node_has_its_channel(name):
    told = TOLD.get(name, "")
    try:
        (policy,) = parse_attacks([f"sr_2={name}:{told}"], RULES).values()
        JointPolicy(Game(RULES), {"sr_2": policy})
    except ValueError:
        assert name in ELSEWHERE or not attackers.factory(name).attacks & {"ratings", "silence"}
        return
    critic = _Critic("sr_2", ROSTER.provider_names, policy, Board(np.full(3, 0.5), np.full(3, 0.5)), 0)
    for round in range(5):
        said = critic.ratings(round, {"sp_0": 0.9, "sp_2": 0.8})
        assert set(said) <= {"sp_0", "sp_2"}
        assert all(0 <= rating <= 1 for rating in said.values())


def test_a_trained_provider_reads_what_is_said_of_it():
    policy = learned(path=str(ZOO / "provider-3x3"))
    rated = np.ones(3, bool)
    praised, blamed = _Seller(policy, 0), _Seller(policy, 0)
    sold = [(praised.quality(r, 0.9, np.ones(3), rated), blamed.quality(r, 0.9, np.zeros(3), rated)) for r in range(20)]
    assert all(0 <= quality <= 1 for pair in sold for quality in pair)
    assert any(one != other for one, other in sold)
