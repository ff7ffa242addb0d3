"""Attacks of several, on cases worked by hand."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import Collusion, Orchestrated, SelfPromotion
from roletrust_baselines.search import PaperAttacks
from roletrust_env import Game, JointPolicy, make_attacker, make_scenario, record
from roletrust_env.evaluation.scripts import Scripts
from roletrust_env.evaluation.search import find
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.make_task import make_task
from roletrust_env.game.views import ProviderView, RaterView

SERVICE = np.array([0.8, 0.4, 1.0])
PAPER = make_scenario("paper-3x3").change(noise=0.0, perturbations=(), max_cycles=30)


def ratings(policy, round=0.0):
    number = np.array(round)
    view = RaterView(number, 0 * number, SERVICE, SERVICE, SERVICE >= 0, SERVICE, SERVICE >= 0)
    return policy.ratings(view, None, None)[0].tolist()


def quality(policy, round=0.0):
    number = np.array(round)
    return float(policy.quality(ProviderView(number, *[0 * number] * 5), None, None)[0])


def test_self_promotion_praises_its_own_only():
    assert ratings(SelfPromotion(accomplices=(1,))) == [0.8, 1, 1]
    assert ratings(SelfPromotion(accomplices=(0, 1), lift=0.5)) == pytest.approx([0.9, 0.7, 1])
    assert quality(SelfPromotion(accomplices=(1,), bad=0.3)) == 0.3


def test_collusion_sinks_the_others_too():
    assert ratings(Collusion(accomplices=(1,))) == [0, 1, 0]
    assert ratings(Collusion(accomplices=(1,), lift=0.5, sink=0.25)) == pytest.approx(
        [0.6, 0.7, 0.75]
    )
    assert ratings(Collusion(accomplices=(1,), start=2)) == SERVICE.tolist()
    assert quality(Collusion(accomplices=(1,), start=2)) == 1


def test_teams_take_turns():
    teams = [Orchestrated(accomplices=(1,), team=team, turn=2) for team in (0, 1)]
    turns = [[quality(team, round) == 0 for round in range(6)] for team in teams]
    assert turns == [
        [True, True, False, False, True, True],
        [False, False, True, True, False, False],
    ]
    beyond = Orchestrated(accomplices=(1,), team=3, turn=2)  # of two teams it is in the second
    assert [quality(beyond, round) for round in range(6)] == [
        quality(teams[1], round) for round in range(6)
    ]
    assert [ratings(team, 2) for team in teams] == [[0.8, 1, 1], [0, 1, 0]]


def test_two_of_three_raters_turn_the_world_around():
    """In a plain mean, who serves nothing gets (0 + 1 + 1) / 3 and who serves well 1 / 3."""
    game = Game(PAPER, "mean")
    attacks = parse_attacks(["sr_[01]=collusion", "sp_2=collusion"], PAPER)
    assert set(attacks.values()) == {Collusion(accomplices=(2,))}
    history = record(JointPolicy(game, attacks), game.random(0))
    assert history.top[-1] == pytest.approx([1 / 3, 1 / 3, 2 / 3])


def test_a_ring_that_lifts_nobody_is_refused():
    with refuses(ValueError, "collusion:bad=0", "accomplices"):
        parse_attacks(["sr_0=collusion:bad=0"], PAPER)
    with refuses(ValueError, "collusion", "accomplices", "[]"):
        make_attacker("collusion", accomplices=())
    given = parse_attacks(
        ["sr_0=collusion:accomplices=[sp_0,sp_1]", "sp_2=collusion:accomplices=sp_1"], PAPER
    )
    assert [policy.accomplices for policy in given.values()] == [(0, 1), (1,)]
    with refuses(ValueError, "accomplices", "sr_1", "sp_0"):
        parse_attacks(["sr_0=collusion:accomplices=sr_1"], PAPER)


def test_searches_tell_the_ring_who_belongs_to_it():
    arguments = {
        "scenario": "crowd-10x10",
        "compromised": ("sr_8", "sp_9", "sr_9"),
        "max_cycles": 10,
    }
    space = Scripts.of(make_task(**arguments), (Collusion,))
    assert space.size == 9
    assert space.default == dict.fromkeys(("sr_8", "sp_9", "sr_9"), Collusion(accomplices=(9,)))
    finding = find(PaperAttacks(attacks=(Collusion,)), arguments, budget=0, seed=0, games=2)
    assert finding.description == "sr_8, sp_9, sr_9: collusion:bad=0,lift=1,sink=1,accomplices=[9]"
    raters = {**arguments, "compromised": ("sr_8",)}
    with refuses(ValueError, "Collusion", "accomplices"):
        Scripts.of(make_task(**raters), (Collusion,))
