"""Attackers in the live system: the observations of a node's policy, and its decisions."""

from pathlib import Path

import numpy as np
import pytest

from roletrust_agents.learned import learned
from roletrust_baselines import BadMouthing
from roletrust_env import Game, JointPolicy, Policy, make_scenario, record
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.policy import registry as attackers
from roletrust_env.world.roster import Roster
from roletrust_manager.dds.nodes.agent_nodes import QualitySelector, RatingSelector

ZOO = Path(__file__).parents[3] / "agents" / "roletrust_agents" / "zoo"
RULES = make_scenario("paper-3x3").change(max_cycles=40, perturbations=()).change(noise=0.0)
ROSTER = Roster.of(RULES)
PARAMETERS = {
    "learned": f"path={ZOO / 'rater-3x3'}",
    "collusion": "accomplices=[sp_0]",
    "orchestrated": "accomplices=[sp_0]",
    "cheating-ring": "accomplices=[sp_0]",
    "milking-ring": "accomplices=[sp_0]",
    "divided-ring": "accomplices=[sp_0]",
}

ELSEWHERE = {
    *("self-promotion", "personal-milking-ring", "personal-sybil-ring"),
    *("sybil", "sybil-ring", "whitewashing", "whitewashing-ring"),
}
"""Attacks of agents with both roles, or with identities in reserve."""


class PublishedBoard:
    """The published trust of a game."""

    def __init__(self, tor, top):
        self.of = dict(
            zip(
                (*ROSTER.rater_names, *ROSTER.provider_names),
                np.append(tor, top).tolist(),
                strict=True,
            )
        )
        self.tor = self.top = self.of.__getitem__


@pytest.mark.parametrize(
    "policy",
    [
        BadMouthing(level=0.2),
        learned(path=str(ZOO / "rater-3x3")),
        learned(path="universal-raters"),
        learned(path="universal-coalition", accomplices=(2,)),
        Policy(),
    ],
    ids=["lie", "learned", "universal", "coalition", "honest"],
)
def test_a_live_rater_gives_the_same_ratings_as_in_the_game(policy):
    game = Game(RULES, "role-trust")
    history = record(JointPolicy(game, {"sr_2": policy}), game.random(seed=0))
    board = PublishedBoard(np.full(3, RULES.initial_trust), np.full(3, RULES.initial_trust))
    selector = RatingSelector("sr_2", ROSTER.provider_names, policy, board, 0)
    for round in range(len(history.tor)):
        if history.rated[round, 2].any():
            seen = dict(
                zip(ROSTER.provider_names, history.quality[round - 1].tolist(), strict=True)
            )
            ratings = selector.ratings(round, seen)
            assert ratings == dict(
                zip(ROSTER.provider_names, history.ratings[round, 2].tolist(), strict=True)
            ), round
        board.__init__(history.tor[round], history.top[round])


@pytest.mark.parametrize("name", attackers.names())
def test_every_registered_attacker_plays_if_the_node_has_its_channel(name):
    parameters = PARAMETERS.get(name, "")
    try:
        (policy,) = parse_attacks([f"sr_2={name}:{parameters}"], RULES).values()
        JointPolicy(Game(RULES), {"sr_2": policy})
    except ValueError:
        assert name in ELSEWHERE or not attackers.factory(name).attacks & {"ratings", "silence"}
        return
    selector = RatingSelector(
        "sr_2", ROSTER.provider_names, policy, PublishedBoard(np.full(3, 0.5), np.full(3, 0.5)), 0
    )
    for round in range(5):
        ratings = selector.ratings(round, {"sp_0": 0.9, "sp_2": 0.8})
        assert set(ratings) <= {"sp_0", "sp_2"}
        assert all(0 <= rating <= 1 for rating in ratings.values())


def test_a_trained_provider_reacts_to_its_ratings():
    policy = learned(path=str(ZOO / "provider-3x3"))
    rated = np.ones(3, bool)
    praised, blamed = QualitySelector(policy, 0), QualitySelector(policy, 0)
    sold = [
        (praised.quality(r, 0.9, np.ones(3), rated), blamed.quality(r, 0.9, np.zeros(3), rated))
        for r in range(20)
    ]
    assert all(0 <= quality <= 1 for pair in sold for quality in pair)
    assert any(one != other for one, other in sold)


def test_a_member_of_a_coalition_serves_in_a_live_camera_as_in_the_game():
    policy = learned(path="universal-coalition", accomplices=(2,))
    game = Game(RULES, "role-trust")
    history = record(JointPolicy(game, {"sp_2": policy}), game.random(seed=0))
    selector, trust = QualitySelector(policy, 0), RULES.initial_trust
    for round in range(RULES.max_cycles):
        quality = selector.quality(
            round, trust, history.ratings[round, :, 2], history.rated[round, :, 2]
        )
        assert quality == history.quality[round, 2], round
        trust = history.top[round, 2]


class Withholding(Policy):
    """Rates a quarter of the service, and sends no rating of the first provider."""

    def ratings(self, view, memory, random):
        return view.service / 4, memory

    def withholds(self, view, memory, random):
        return np.array([True, False, False]), (*memory, view)

    def begin(self, random, shape):
        return ()


def test_a_policy_sees_the_ratings_that_it_sent_and_not_those_that_it_withheld():
    selector = RatingSelector(
        "sr_2", ROSTER.provider_names, Withholding(), PublishedBoard(np.ones(3), np.ones(3)), 0
    )
    for round in range(2):
        assert selector.ratings(round, {"sp_0": 0.8, "sp_1": 0.4, "new": 0.3}) == {
            "sp_1": 0.1,
            "new": 0.3,
        }
    last = selector._memory[-1]
    np.testing.assert_array_equal(last.ratings, [0, 0.1, 0])
    np.testing.assert_array_equal(last.rated, [False, True, False])
