"""Rings whose providers cheat while they are trusted, on cases worked by hand."""

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import CheatingRing, DividedRing, MilkingRing
from roletrust_env import make_scenario
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.randomness import Random

PAPER = make_scenario("paper-3x3")


def served(policy, trusts):
    """The qualities of two providers, of which the second has the trust of the first, a round
    later."""
    random, found = Random(np.random.default_rng(0)), []
    memory = policy.begin(random, (2,))
    for round, pair in enumerate(zip(trusts, [0.0, *trusts], strict=False)):
        trust = np.array(pair)
        view = ProviderView(np.full(2, float(round)), *[trust] * 3, trust[None], trust[None] > 0)
        quality, memory = policy.quality(view, memory, random)
        found.append(quality.tolist())
    return [list(column) for column in zip(*found, strict=True)]


def test_a_provider_of_the_ring_cheats_while_it_is_trusted():
    ring = CheatingRing(accomplices=(0,), threshold=0.6, bad=0.2)
    trusts = [0.5, 0.6, 0.7, 0.59, 0.6]
    assert served(ring, trusts) == [[1, 0.2, 0.2, 1, 0.2], [1, 1, 0.2, 0.2, 1]]
    assert served(CheatingRing(accomplices=(0,), threshold=0.0, start=2, stop=4), trusts)[0] == [
        1,
        1,
        0,
        0,
        1,
    ]


def test_a_milking_provider_compares_its_trust_with_its_own_highest():
    ring = MilkingRing(accomplices=(0,), threshold=0.9, patience=1, start=1)
    trusts = [0.5, 0.4, 0.46, 0.8, 0.7, 0.73, 0.5]
    assert served(ring, trusts)[0] == [1, 1, 0, 0, 1, 0, 1]
    assert served(ring, trusts)[1] == [1, 1, 1, 0, 0, 1, 0]


def test_each_rater_of_a_divided_ring_praises_one_of_its_providers():
    random, raters = Random(np.random.default_rng(0)), 60
    ring, published = DividedRing(accomplices=(3, 1)), np.full((4, raters), 0.25)
    memory = ring.begin(random, (raters,))
    unmet = np.zeros((4, raters), bool)
    view = RaterView(np.zeros(raters), published[0], published, *[published, unmet] * 2)
    given, memory = ring.ratings(view, memory, random)
    praised = given == 1
    assert (praised.sum(axis=0) == 1).all()
    assert (given[~praised] == 0.25).all()
    assert praised.sum(axis=1).tolist() == [0, 60 - praised[3].sum(), 0, praised[3].sum()]
    assert 15 < praised[3].sum() < 45
    claims, _ = ring.claims(view, memory, random)
    assert claims.tolist() == (0.75 * praised).tolist()


@pytest.mark.parametrize("name", ["cheating-ring", "milking-ring", "divided-ring"])
def test_the_command_line_names_its_providers(name):
    ring = parse_attacks([f"sr_[01]={name}", f"sp_2={name}"], PAPER)
    assert {policy.accomplices for policy in ring.values()} == {(2,)}
    with refuses(ValueError, name, "accomplices"):
        parse_attacks([f"sr_0={name}"], PAPER)
