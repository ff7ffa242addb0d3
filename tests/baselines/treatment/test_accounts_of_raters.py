"""Providers that treat each rater by the ratings that it gave them, on cases worked by hand and in
whole games."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from refusals import refuses

from roletrust_baselines import (
    PersonalMilking,
    PersonalMilkingRing,
    PersonalSybilRing,
    QuietDiscrimination,
    Rotation,
)
from roletrust_env import Game, JointPolicy, Policy, Scenario, make_scenario, record
from roletrust_env.evaluation.scripts import Space
from roletrust_env.evaluation.specs import parse_attacks
from roletrust_env.game.accounts import ACCOUNT_FEATURES, Accounts, account_features
from roletrust_env.game.views import ProviderView
from roletrust_env.randomness import Random

PAPER = make_scenario("paper-3x3").change(noise=0.0, perturbations=(), max_cycles=40)
NAN = float("nan")


def test_the_last_rating_stays_while_none_arrives() -> None:
    accounts = Accounts.begin(np.zeros((2, 1))).hear(
        np.array([[0.5], [0.25]]), np.array([[True], [True]])
    )
    later = accounts.hear(np.array([[1.0], [1.0]]), np.array([[False], [True]]))
    assert later.last.tolist() == [[0.5], [1.0]]
    assert later.mean.tolist() == [[0.5], [0.625]]
    none = np.zeros((2, 1))
    features = account_features(later, best_other=np.array(0.0), given=none, ally=none, place=none)
    assert features[ACCOUNT_FEATURES.index("voice")].tolist() == [[0.5], [1.0]]


def treated(policy: Policy, rounds: Sequence[Sequence[float]]) -> list[list[float]]:
    """What two providers give the raters: the ratings of the first are those of a round, NaN where
    none arrived.

    The second one is never rated. The memory of the policy goes from round to round.
    """
    random, found = Random(np.random.default_rng(0)), []
    memory: Any = policy.begin(random, (2,))
    for round, given in enumerate(rounds):
        ratings = np.array([[rating, NAN] for rating in given])
        rated, zero = ~np.isnan(ratings), np.zeros(2)
        view = ProviderView(zero + round, zero, zero, zero, np.nan_to_num(ratings), rated)
        treatment, memory = policy.treats(view, memory, random)
        assert treatment is not None
        found.append(np.broadcast_to(treatment, ratings.shape)[:, 0].tolist())
        unknown = np.broadcast_to(treatment, ratings.shape)[:, 1]
        assert isinstance(policy, QuietDiscrimination | Rotation) or (unknown == 1).all()
    return found


MILKING = [
    PersonalMilking(threshold=0.6, bad=0.1),
    PersonalMilkingRing(threshold=0.6, bad=0.1, accomplices=(0,)),
    PersonalSybilRing(threshold=0.6, bad=0.1, accomplices=(0,)),
]


@pytest.mark.parametrize("policy", MILKING, ids=repr)
def test_only_raters_that_think_well_of_it_are_cheated(policy: Policy) -> None:
    """The means of three raters: nothing, 1, 1/2, 2/3; 0.5, 0.5, 0.5, 0.75; none at all."""
    rounds = [[NAN, 0.5, NAN], [1, NAN, NAN], [0, NAN, NAN], [1, 1, NAN]]
    assert treated(policy, rounds) == [[1, 1, 1], [0.1, 1, 1], [1, 1, 1], [0.1, 0.1, 1]]


def test_of_a_ring_only_the_provider_that_a_rater_thinks_best_of_cheats_it() -> None:
    """By hand: rater 0 thinks best of the first, rater 1 of the second, rater 2 of both alike,
    rater 3 well of none."""
    ratings, zero = np.array([[1.0, 0.9], [0.7, 0.8], [1.0, 1.0], [0.5, 0.0]]), np.zeros(2)
    view, random = (
        ProviderView(*[zero] * 4, ratings, ratings >= 0),
        Random(np.random.default_rng(0)),
    )
    ring, alone = PersonalMilkingRing(accomplices=(0, 1)), PersonalMilking()
    together, apart = (
        policy.treats(view, policy.begin(random, (2,)), random)[0] for policy in (ring, alone)
    )
    assert np.array_equal(together, [[0, 1], [1, 0], [0, 0], [1, 1]])
    assert np.array_equal(apart, [[0, 0], [0, 0], [0, 0], [1, 1]])


def test_raters_of_the_ring_sink_the_best_of_the_others_and_lift_the_rest() -> None:
    ring = PersonalMilkingRing(accomplices=(0,), cut=0.4, sink=0.5, lift=0.25)
    assert ring.lies(np.array([0.8, 0.6, 0.2]), np.array([0.0, 0.5, 1.0])) == pytest.approx(
        [0.4, 0.7, 0.4]
    )


def test_with_a_prior_the_threshold_rises_with_ratings_and_more_of_them_are_better() -> None:
    """By hand, at 0.8 of a perfect rival, which has 3/4 after one rating, and 5/6 after two: 0.6,
    and 2/3, is enough.

    The means of rater 1 are 0.62 and 0.66. Of two providers with ratings 0.85 and 0.85, and 0.9,
    the first is better.
    """
    ring, plain = (
        PersonalMilkingRing(threshold=0.8, prior=prior, accomplices=(0, 1)) for prior in (1.0, 0.0)
    )
    rounds = [[1.0, 0.74], [1.0, 0.74]]
    assert treated(ring, rounds) == [[0, 0], [0, 1]]
    assert treated(plain, rounds) == [[0, 1], [0, 1]]
    zero, random = np.zeros(2), Random(np.random.default_rng(0))
    for policy, cheats in ((ring, [0, 1]), (plain, [1, 0])):
        memory = policy.begin(random, (2,))
        for ratings in ([[0.85, 0.9]], [[0.85, NAN]]):
            given = np.array(ratings)
            treatment, memory = policy.treats(
                ProviderView(*[zero] * 4, np.nan_to_num(given), given >= 0), memory, random
            )
        assert treatment is not None
        assert treatment.tolist() == [cheats]


def test_patience_counts_ratings_and_the_window_rounds() -> None:
    rounds = [[1.0, NAN], [1.0, NAN], [NAN, 1.0], [NAN, NAN]]
    assert treated(PersonalMilking(patience=2), rounds) == [[1, 1], [0, 1], [0, 1], [0, 1]]
    assert treated(PersonalMilking(start=2, stop=3), rounds) == [[1, 1], [1, 1], [0, 0], [1, 1]]


def test_raters_with_the_fewest_ratings_are_cheated_and_the_first_of_equal_ones() -> None:
    rounds = [[NAN, NAN, NAN, NAN], [1, NAN, 1, 1], [NAN, 1, NAN, NAN], [1, 1, NAN, NAN]]
    half = treated(QuietDiscrimination(share=0.5), rounds)
    assert half == [[0, 0, 1, 1], [0, 0, 1, 1], [0, 0, 1, 1], [1, 1, 0, 0]]
    assert treated(QuietDiscrimination(share=0.1), rounds[:3]) == [
        [0, 1, 1, 1],
        [1, 0, 1, 1],
        [0, 1, 1, 1],
    ]


def test_groups_of_raters_are_cheated_in_turn() -> None:
    nothing = [[NAN] * 5] * 7
    two = treated(Rotation(groups=2, turn=2, start=1), nothing)
    first, second = [0, 0, 0, 1, 1], [1, 1, 1, 0, 0]
    assert two == [[1] * 5, first, first, second, second, first, first]
    assert treated(Rotation(groups=9, turn=1), nothing)[:3] == [
        [0, 1, 1, 1, 1],
        [1, 0, 1, 1, 1],
        [1] * 5,
    ]


def test_each_provider_of_a_ring_has_accounts_of_its_own() -> None:
    """By hand, without noise: a provider learns of a service two rounds later, and then has 1, 1,
    2/3, 1/2, ..."""
    game = Game(PAPER, "mean")
    history = record(
        JointPolicy(game, {"sp_0": PersonalMilking(), "sp_1": PersonalMilking(threshold=1.0)}),
        game.random(0),
    )
    offered = history.offered[:6]
    assert (offered[:, :, 2] == 1).all()
    assert (np.ptp(offered, axis=1) == 0).all()  # the raters are alike
    assert offered[:, 0, 0].tolist() == [1, 1, 0, 0, 0, 1]
    assert offered[:, 0, 1].tolist() == [1, 1, 0, 0, 1, 1]


def test_identities_join_and_are_not_known_yet() -> None:
    scenario = Scenario(
        agents=[
            {"role": "SR", "count": 3},
            {"role": "SP", "count": 2},
            {"role": "SP", "reserve": 2},
        ],
        max_cycles=12,
    )
    game = Game(scenario, "mean")
    ring = PersonalSybilRing(reserve=2, start=3, every=4, accomplices=(2, 3, 4))
    history = record(JointPolicy(game, {"sp_2": ring}), game.random(0))
    joined = history.present.argmax(axis=0)
    assert joined[-3:].tolist() == [0, 3, 7]
    assert np.nanmin(history.offered[:3, :, 2]) == 1
    for provider, first in zip((3, 4), joined[-2:], strict=True):
        assert (history.offered[first + 1, :, provider] == 1).all()


def test_searches_reach_them_by_their_ranges() -> None:
    """The corners of a cube: an exit by rater is personal milking that starts late."""
    space = Space(PersonalMilking, (0,), (1,), 50)
    assert space.decode([0.0] * space.size) == PersonalMilking(
        start=0, threshold=0.0, patience=1, bad=0.0
    )
    assert space.decode([1.0] * space.size) == PersonalMilking(
        start=50, threshold=1.0, patience=10, bad=1.0
    )
    ring = Space(PersonalMilkingRing, (0,), (1,), 50)
    assert ring.decode([0.5] * ring.size).accomplices == (1,)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["personal-milking-ring", "personal-sybil-ring"])
def test_the_command_line_names_its_providers(name: str) -> None:
    if name == "personal-milking-ring":
        ring = parse_attacks([f"sr_[01]={name}", f"sp_2={name}"], PAPER)
        assert {policy.accomplices for policy in ring.values()} == {(2,)}  # type: ignore[attr-defined]
    with refuses(ValueError, name):
        parse_attacks([f"sr_0={name}"], PAPER)
